"""Reference solutions: to the limit of double precision, by two unrelated algorithms.

The first algorithm gives the solution, the second one confirms it: it shares no iteration with the
first, and its velocity must agree. It starts from zero. If it fails, or ends at another solution
(frictional problems may have several), it starts again from the first's reactions, rounded to three
digits.

If the reactions of a velocity are not unique, the solution has those of least norm
(`_least_norm.py`).
"""

from __future__ import annotations

import datetime
import importlib.metadata
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fclib import _core, _registry, _solve
from fclib.analysis._contacts import completed
from fclib.analysis._data import Array, Data
from fclib.analysis._least_norm import least_norm

TARGET = 1e-12  # for the merit
CONFIRMED = 1e2  # the confirming error may be this many times the target
AGREE = 1e-8  # distance of the velocities, relative to max(||u||, ||q||)
DIGITS = 3  # digits of the reactions from which a second try starts

FIRST = ("auto", "nsn-jm", "nsn-ac", "ppa-nsn", "admm", "nsgs", "apgd")
SECOND = ("nsn-jm", "nsn-ac", "admm", "apgd", "aclm", "nsgs", "fp-eg-upk", "ppa-nsgs")


@dataclass(frozen=True)
class Confirmation:
    """A run of one algorithm.

    Attributes:
        solver: its name; families: the methods of which it consists.
        error: the merit it reached; status: of the result.
        difference: distance of its velocity from the reference's, relative to max(||u||, ||q||); 0
            for the first.
        start: "zero" or "rounded", the first's reactions, to three digits.
    """

    solver: str
    families: tuple[str, ...]
    error: float
    status: str
    difference: float
    start: str


@dataclass(frozen=True)
class Reference:
    """A solution and the evidence for it.

    Attributes:
        solution: the reference, None if no algorithm came within 100 targets.
        merit: merit of the solution, on the problem as given.
        target: target of the merit.
        runs: the runs of the algorithms: the first, and those that should confirm it.
        confirmed: whether a run without a common family agrees.
        reaction: "unique" (given the velocity), "minimum norm" or "one of several".
        freedom: dimension of the reactions of this velocity, before the cones bound them.
        others: velocity differences of other solutions found, with an error within the target: the
            velocity is not unique.
        reason: the reason why it is not certified; empty if it is.
    """

    problem: _solve.Problem = field(repr=False, compare=False)
    solution: _core.Solution | None = field(repr=False, compare=False)
    merit: _core.Merit | None
    target: float
    runs: tuple[Confirmation, ...]
    confirmed: bool
    reaction: str
    freedom: int
    others: tuple[float, ...]
    reason: str

    @property
    def certified(self) -> bool:
        """Whether the merit is within the target, and a second algorithm agrees."""
        return not self.reason

    @property
    def error(self) -> float:
        """The error of the solution; nan without one."""
        return self.merit.error if self.merit is not None else float("nan")

    @property
    def second(self) -> Confirmation | None:
        """The run that confirms the solution."""
        return self.runs[-1] if self.confirmed else None

    @property
    def record(self) -> dict[str, Any]:
        """One flat dictionary of JSON values."""
        merit = self.merit
        second = self.second
        return {
            "formulation": self.problem.formulation,
            "nc": self.problem.nc,
            "certified": self.certified,
            "error": merit.error if merit else None,
            "scaled_natural": merit.scaled_natural if merit else None,
            "algorithm": self.runs[0].solver if self.runs else None,
            "second": second.solver if second else None,
            "second_start": second.start if second else None,
            "second_error": second.error if second else None,
            "difference": second.difference if second else None,
            "reaction": self.reaction,
            "freedom": self.freedom,
            "other_velocities": list(self.others),
            "open": merit.open if merit else None,
            "stick": merit.stick if merit else None,
            "slide": merit.slide if merit else None,
            "reason": self.reason,
        }

    @property
    def attributes(self) -> dict[str, float | str]:
        """The attributes of /solution in a file: the merits, algorithms, versions and date."""
        if self.solution is None or self.merit is None:
            raise _core.ProblemError("there is no solution to speak of")
        merits = {f"merit_{name}": float(getattr(self.merit, name)) for name in _solve.ERRORS}
        sentences = [
            f"{run.solver} ({'+'.join(run.families)}) from {run.start}: error {run.error:.1e}, "
            f"velocity differs by {run.difference:.1e}"
            for run in self.runs
        ]
        now = datetime.datetime.now(datetime.timezone.utc)
        return {
            "error": self.merit.error,
            "merit": "both",
            "solver": self.runs[0].solver,
            **merits,
            "merit_1": _core.merit_1(self.problem, self.solution),
            "algorithms": "; ".join(
                sentences[:1] + sentences[-1:] if self.confirmed else sentences[:1]
            ),
            "certified": "yes" if self.certified else f"no: {self.reason}",
            "reaction": self.reaction,
            "versions": versions(),
            "date": now.strftime("%Y-%m-%dT%H:%M:%SZ"),
        }


def versions() -> str:
    """The versions of fclib and of the libraries that it uses."""
    names = ("numpy", "scipy", "clarabel")
    found = [f"fclib {_core.version}"]
    for name in names:
        try:
            found.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    return ", ".join(found)


def reference(
    problem: _solve.Problem, *, target: float = TARGET, time_limit: float = 10.0
) -> Reference:
    """The reference solution of a problem.

    Args:
        problem: any formulation.
        target: bound on the merit.
        time_limit: [s] wall clock of each run. The number of runs depends on the problem: two if
            all goes well.

    Raises:
        fclib.ProblemError: the data is not valid.
        fclib.UnsuitableError: M or R is singular.
        ImportError: reactions are not unique, and Clarabel is not installed.
    """
    problem.validate()
    data = Data.of_problem(problem)
    first, run = _first(data, target, time_limit)
    if not first.error <= CONFIRMED * target:
        reason = f"no algorithm came nearer than {first.error:.1e}"
        return Reference(problem, None, None, target, (run,), False, "none", 0, (), reason)
    solution = first.solution
    runs, confirmed, others = _confirm(data, solution, run, target, time_limit)
    reaction, freedom, solution = least_norm(data, solution, target)
    merit = _core.merit(problem, solution)
    reasons = []
    if not merit.error <= target:
        reasons.append(f"the error {merit.error:.1e} is above {target:.0e}")
    if not confirmed:
        tries = min((r.difference for r in runs[1:]), default=float("nan"))
        reasons.append(f"no unrelated algorithm agrees (the nearest differs by {tries:.1e})")
    return Reference(
        problem,
        solution,
        merit,
        target,
        runs,
        confirmed,
        reaction,
        freedom,
        others,
        "; ".join(reasons),
    )


def _families(result: _core.Result) -> tuple[str, ...]:
    """The methods in a solver; in a chain, those that worked on the solution."""
    if result.solver != "auto":
        return (_registry.find_solver(result.solver).family,)
    found: set[str] = set()
    for stage in result.stages:
        # nearly every chain begins with sweeps: they count only if they ended the work
        if stage.solved or stage.families != "splitting":
            found |= set(stage.families.split(", "))
    return tuple(sorted(found)) or ("none",)


def _first(data: Data, target: float, time_limit: float) -> tuple[_core.Result, Confirmation]:
    """The best result of the first algorithms, ending once one is within the target."""
    best = None
    for name in FIRST:
        try:
            result = _solve.solve(data.problem, name, target / 10, time_limit=time_limit)
            if best is not None and not result.error < best.error:
                continue
        except _core.UnsuitableError:
            if name == "auto":
                raise
            continue
        best = result
        if best.error <= target or best.status == "infeasible":
            break
    assert best is not None
    run = Confirmation(best.solver, _families(best), best.error, best.status, 0.0, "zero")
    return best, run


def _confirm(
    data: Data, solution: _core.Solution, run: Confirmation, target: float, time_limit: float
) -> tuple[tuple[Confirmation, ...], bool, tuple[float, ...]]:
    """Runs of other families until one agrees, and the velocities of other solutions."""
    _, u = completed(data, solution)
    speed = max(float(np.linalg.norm(u)), data.speed)
    tried: list[Confirmation] = [run]
    others: list[float] = []
    for start in ("zero", "rounded"):
        guess = None if start == "zero" else _rounded(solution)
        # do not wait for a solution that does not come soon from zero
        limit = min(time_limit, 2.0) if start == "zero" else time_limit
        for name in SECOND:
            info = _registry.find_solver(name)
            if info.family in run.families or not _takes(info, data):
                continue
            try:
                result = _solve.solve(data.problem, name, target, time_limit=limit, guess=guess)
            except _core.UnsuitableError:
                continue
            difference = float(np.linalg.norm(completed(data, result.solution)[1] - u)) / speed
            found = Confirmation(
                name, (info.family,), result.error, result.status, difference, start
            )
            tried.append(found)
            if found.error <= CONFIRMED * target and difference <= AGREE:
                return tuple(tried), True, tuple(others)
            if found.error <= target and difference > AGREE:
                others.append(difference)
    return tuple(tried), False, tuple(others)


def _takes(info: _core.SolverInfo, data: Data) -> bool:
    return data.d in _registry.dimensions_of(info, data.problem.kind)


def _rounded(solution: _core.Solution) -> _core.Solution:
    def short(x: Array) -> Array:
        return np.array([float(f"{value:.{DIGITS - 1}e}") for value in x])

    multiplier = None if solution.l is None else short(solution.l)
    return _core.Solution(r=short(solution.r), l=multiplier)
