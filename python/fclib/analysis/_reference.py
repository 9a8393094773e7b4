"""Reference solutions: to the limit of double precision, by two unrelated algorithms.

The first algorithm gives the solution, the second one confirms it: it shares no iteration with the
first, and its velocity must agree. It starts from zero. If no run from zero reaches this solution,
it starts again from the first's reactions, rounded to three digits. If this start is itself a
solution, the reactions are disturbed: a run that has nothing to do confirms nothing.

A run from zero may also end at another velocity, as frictional problems may have several
solutions. It is that of another solution only if their mean is clearly no solution, and if no
theorem says that there is one velocity. Otherwise the problem may be so close to singular that an
error within the target does not tell the velocity: then the solution is not certified.

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
from fclib.analysis._analyze import velocity_is_unique
from fclib.analysis._contacts import completed
from fclib.analysis._data import EPS, Array, Data, check_arguments
from fclib.analysis._least_norm import least_norm

TARGET = 1e-12  # for the merit
CONFIRMED = 1e2  # the confirming error may be this many times the target
AGREE = 1e-8  # distance of the velocities, relative to max(||u||, ||q||)
DIGITS = 3  # digits of the reactions from which a second try starts
CLEAR = 1e2  # a start must miss the confirming error by this factor
ROUNDED = 16  # times EPS ||w||: a velocity of contacts that may be rounding
DISTURBED = 2.0**-10  # size of the disturbance, relative to the reactions
# Of two solutions with an error e, min(r, u) is at most about the root of e at their mean if both
# approximate one solution of a monotone problem. The mean of others has an error of more than so
# many roots.
APART = 10.0

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
        start: "zero", "rounded" (the first's reactions, to three digits) or "disturbed".
        iterations: the number of its iterations; a run without any confirms nothing.
    """

    solver: str
    families: tuple[str, ...]
    error: float
    status: str
    difference: float
    start: str
    iterations: int = 0


@dataclass(frozen=True)
class Reference:
    """A solution and the evidence for it.

    Attributes:
        solution: the reference, None if no algorithm came within 100 targets.
        merit: merit of the solution, on the problem as given.
        target: target of the merit.
        runs: the runs of the algorithms: the first, and those that should confirm it.
        confirmed: whether a run without a common family agrees.
        reaction: "unique" (given the velocity), "minimum norm" (no reactions of this velocity are
            smaller), "one of several" or "undecided"; "none" without a solution.
        freedom: dimension of the reactions of this velocity, before the cones bound them.
        others: velocity differences of other solutions found, with an error within the target, if
            this error does not explain the difference: the velocity is not unique.
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
        fclib.OptionError: target or time_limit is no positive number.
        fclib.UnsuitableError: M is singular, or joints contradict each other.
        ImportError: reactions are not unique, and Clarabel is not installed.
    """
    check_arguments(problem, time_limit=time_limit, target=target)
    problem.validate()
    data = Data.of_problem(problem)
    first, run = _first(data, target, time_limit)
    if not first.error <= CONFIRMED * target:
        reason = f"no algorithm came nearer than {first.error:.1e}"
        return Reference(problem, None, None, target, (run,), False, "none", 0, (), reason)
    solution = first.solution
    check = _confirm(data, solution, run, target, time_limit)
    reaction, freedom, solution = least_norm(data, solution, target)
    merit = _core.merit(problem, solution)
    reasons = []
    if not merit.error <= target:
        reasons.append(f"the error {merit.error:.1e} is above {target:.0e}")
    if check.doubt:
        reasons.append(check.doubt)
    return Reference(
        problem,
        solution,
        merit,
        target,
        check.runs,
        not check.doubt,
        reaction,
        freedom,
        check.others,
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
    run = Confirmation(
        best.solver, _families(best), best.error, best.status, 0.0, "zero", best.iterations
    )
    return best, run


@dataclass(frozen=True)
class _Check:
    """The first run and those that should confirm it, and why they do not; see Reference."""

    runs: tuple[Confirmation, ...]
    others: tuple[float, ...]
    doubt: str = ""


def _confirm(
    data: Data, solution: _core.Solution, run: Confirmation, target: float, time_limit: float
) -> _Check:
    """Runs of other families until one agrees, and the velocities of other solutions."""
    _, u = completed(data, solution)
    speed = max(float(np.linalg.norm(u)), data.speed)
    # a difference by rounding is none; velocities of bodies may be large where those of contacts
    # cancel
    rounding = ROUNDED * EPS * float(np.linalg.norm(getattr(data.problem, "w", np.zeros(0))))
    tried: list[Confirmation] = [run]
    others: list[float] = []
    unexplained: list[float] = []  # differences of solutions that may be the same one, or not
    for start, guess in _starts(data, solution, CLEAR * CONFIRMED * target):
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
            apart = float(np.linalg.norm(completed(data, result.solution)[1] - u))
            difference = max(0.0, apart - rounding) / speed
            found = Confirmation(
                name,
                (info.family,),
                result.error,
                result.status,
                difference,
                start,
                result.iterations,
            )
            tried.append(found)
            # that r = 0 is a solution is seen without any iteration
            worked = found.iterations > 0 or not result.solution.r.any()
            if worked and found.error <= CONFIRMED * target and difference <= AGREE:
                return _Check(tuple(tried), tuple(others))
            if found.error <= target and difference > AGREE:
                shown = _another(data, solution, result.solution, target)
                (others if shown else unexplained).append(difference)
        if start == "zero" and unexplained:
            doubt = (
                "each unrelated algorithm that reaches a solution from zero ends at another"
                f" velocity (the nearest differs by {min(unexplained):.1e})"
            )
            return _Check(tuple(tried), tuple(others), doubt)
    doubt = "no start is far enough from the solution for an unrelated algorithm to confirm it"
    if differences := [one.difference for one in tried[1:]]:
        doubt = f"no unrelated algorithm agrees (the nearest differs by {min(differences):.1e})"
    return _Check(tuple(tried), tuple(others), doubt)


def _takes(info: _core.SolverInfo, data: Data) -> bool:
    return data.d in _registry.dimensions_of(info, data.problem.kind)


def _starts(
    data: Data, solution: _core.Solution, bound: float
) -> list[tuple[str, _core.Solution | None]]:
    """The starts of confirming runs: those with a merit above the bound.

    Solvers start from reactions, so each start has the multipliers of the solution.
    """
    if data.problem.nc == 0:
        return [("zero", None)]

    def misses(r: Array) -> bool:
        return _core.merit(data.problem, _core.Solution(r=r, l=solution.l)).error > bound

    starts: list[tuple[str, _core.Solution | None]] = []
    if misses(np.zeros(data.problem.m)):
        starts.append(("zero", None))
    near = [("rounded", _rounded(solution.r))]
    usual = max(float(abs(solution.r).max()), data.speed / data.stiffness)
    # if ||q|| is rounding, that is no size; 1 m/s is one
    for size in (usual, -usual, 1 / data.stiffness):
        near.append(("disturbed", _disturbed(data, solution.r, DISTURBED * size)))
    found = [(name, r) for name, r in near if misses(r)]
    return starts + [(name, _core.Solution(r=r, l=solution.l)) for name, r in found[:1]]


def _rounded(r: Array) -> Array:
    return np.array([float(f"{value:.{DIGITS - 1}e}") for value in r])


def _disturbed(data: Data, r: Array, size: float) -> Array:
    """Reactions with other normal parts, each changed by another amount."""
    found = r.copy()
    found[:: data.d] += size * np.linspace(1, 2, data.problem.nc)
    return found


def _another(data: Data, solution: _core.Solution, other: _core.Solution, target: float) -> bool:
    """Whether two velocities are of two solutions, and no error explains their difference."""

    def mean(name: str) -> Array | None:
        a, b = getattr(solution, name), getattr(other, name)
        return None if a is None or b is None else (a + b) / 2

    r = (solution.r + other.r) / 2
    between = _core.Solution(r=r, l=mean("l"), v=mean("v"))
    if not _core.merit(data.problem, between).error > APART * float(np.sqrt(target)):
        return False
    return not velocity_is_unique(data)
