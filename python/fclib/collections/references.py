"""Reference solutions: found from the problem alone, judged by both maps, and stored in files.

    /solution       exists only if its error by both maps is at most TOLERANCE
                    attributes: error, merit, natural, scaled_natural, solver, status, ends, date,
                    fclib
    /solutions      all known ones, if a problem has several
    /guesses/K      if no solution is known: the best iterate, as the last guess, with the same
    attributes /fclib_*/info   attribute `solution`: the reason if there is none, always

A solver works to the tolerance asked for. FINISH then goes on from its result, to TARGET. Near a
solution Newton's methods take a few iterations, and all others take many. If FINISH comes no
nearer, for example with elastic bodies, `auto` goes on.

`guess_of` makes a guess for the problem of the next step: the impulses of the same contacts.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, Final

import numpy as np

from fclib import _core, _geometry, _solve
from fclib._judge import MARK, TOLERANCE, Judgement, judge
from fclib._solve import Given
from fclib.collections.catalog import PROVEN

# the best that doubles allow for most problems: a product W r is rounded by 1e-14 of its terms
TARGET: Final = 1e-12
REACHED: Final = f"{TARGET:g} is reached"
# the solver that goes on, and its largest number of iterations; without a time limit, so that all
# machines end at the same solution
FINISH: Final = (("nsn-jm", 30), ("auto", 3000))
AUTO: Final = "auto"
NOT_TRIED: Final = "none was looked for"
CONVERGED: Final = "converged"  # status of a solution by both maps
OTHERS: Final = 1000  # largest number of contacts for which other solutions than r = 0 are tried
SIZES: Final = (1.0, 10.0)  # starts, in reactions that stop one contact alone
APART: Final = 1e-6  # difference of velocities, over ||q||, from which on solutions are different
EPOCH: Final = "SOURCE_DATE_EPOCH"  # environment variable: the time stamp for files, in seconds


@dataclass(frozen=True)
class Found:
    """The best known result for a problem: a solution, or an iterate."""

    solution: _core.Solution
    judgement: Judgement
    solver: str
    status: str  # status of the solver
    ends: str  # reason why there are no more digits, in words
    date: str = ""  # day on which it was found; empty: today
    # verdict of `fclib.analysis.reference`, if that was asked for
    certificate: Mapping[str, float | str] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether it is a solution."""
        return self.judgement.ok

    @property
    def error(self) -> float:
        """The error by both maps."""
        return self.judgement.error

    @property
    def refuted(self) -> bool:
        """Whether there is a proof that the problem has no solution."""
        return not self.ok and self.status == PROVEN

    @property
    def attributes(self) -> dict[str, float | str]:
        """The attributes of it in a file."""
        merit = self.judgement.merit
        return {
            **self.certificate,
            "error": self.error,
            "merit": self.judgement.kind,
            "natural": merit.natural,
            "scaled_natural": merit.scaled_natural,
            "solver": self.solver,
            "status": self.status,
            "ends": self.ends,
            "date": self.date or today(),
            "fclib": _core.version,
        }

    @property
    def row(self) -> dict[str, Any]:
        """The columns of it in a catalogue."""
        merit = self.judgement.merit
        return {
            "open": merit.open,
            "stick": merit.stick,
            "slide": merit.slide,
            "solver": self.solver,
            "status": self.status,
            "error": self.error,
            "has_solution": self.ok,
        }


def today() -> str:
    """The day of a reference; SOURCE_DATE_EPOCH, if set, so that files are equal."""
    told = os.environ.get(EPOCH)
    now = datetime.now(timezone.utc)
    return (datetime.fromtimestamp(int(told), timezone.utc) if told else now).date().isoformat()


def find(problem: Any, solver: str, tol: float, **options: Any) -> Found:
    """Solve a problem from a zero start, and go on to TARGET.

    Raises as `fclib.solve` does.
    """
    result = _solve.solve(problem, solver, tol=tol, **options)
    found = Found(
        result.solution,
        judge(problem, result.solution),
        result.solver,
        str(result.status),
        result.message,
    )
    return found if found.refuted else finished(problem, found)


def finished(problem: Any, found: Found) -> Found:
    """Improve a reference to TARGET, or to the last digit that FINISH reaches."""
    tried = []
    for name, iterations in FINISH:
        # if `auto` found no solution, a second try finds none either
        if found.error <= TARGET or (name == AUTO and not found.ok):
            break
        try:
            result = _solve.solve(
                problem, name, tol=TARGET, guess=found.solution, max_iterations=iterations
            )
        except _core.UnsuitableError:
            continue
        tried.append(name)
        judgement = judge(problem, result.solution)
        if judgement.error < found.error:
            solver = found.solver if found.solver.endswith(name) else f"{found.solver}, {name}"
            found = replace(
                found,
                solution=result.solution,
                judgement=judgement,
                solver=solver,
                status=CONVERGED if judgement.ok else str(result.status),
                ends=result.message,
            )
    if found.error <= TARGET:
        return replace(found, ends=REACHED)
    names = ", ".join(dict.fromkeys([*found.solver.split(", "), *tried]))
    reached = f"{found.error:.1e} is the least that {names} reach"
    return replace(found, ends=f"{reached}: {found.ends}" if found.ends else reached)


def certified(problem: Any, found: Found) -> Found:
    """The solution on which two unrelated algorithms agree; else the old one, with the reason.

    Raises as `fclib.analysis.reference` does.
    """
    from fclib import analysis  # the import takes a while

    known = analysis.reference(problem)
    if known.solution is None or not known.error <= TARGET:
        return replace(found, certificate={"certified": f"no: {known.reason}"})
    return replace(
        found,
        solution=known.solution,
        judgement=judge(problem, known.solution),
        solver=known.runs[0].solver,
        status=CONVERGED,
        ends=REACHED,
        certificate=known.attributes,
    )


def given(problem: Any, solution: _core.Solution, solver: str, date: str = "") -> Found:
    """A reference from an existing solution, and who found it."""
    judgement = judge(problem, solution)
    status = CONVERGED if judgement.ok else "inaccurate"
    return Found(solution, judgement, solver, status, "as it was given", date)


def carried(found: Found, local: Any) -> Found:
    """The reference of a global problem from that of its local form, which rounding changes."""
    whole = found.solution
    own = _core.Solution(r=whole.r, u=whole.u, l=whole.l)
    judgement = judge(local, own)
    if not judgement.ok:
        own = _core.Solution(r=whole.r, l=whole.l)  # u follows from r
        judgement = judge(local, own)
    # a certificate is about the global form
    proof = {name: value for name, value in found.certificate.items() if name[:6] != "merit_"}
    mine = replace(found, solution=own, judgement=judgement, certificate=proof)
    # the local form reaches other digits
    return finished(local, replace(mine, ends="")) if found.ok else mine


def others(problem: Any, found: Found) -> list[_core.Solution]:
    """Further solutions of a problem that r = 0 solves, with other velocities; none if it is large.

    `nsn-ac` starts from normal reactions that are large enough to stop all bodies. Other solvers
    come back to r = 0 from there.
    """
    if not found.ok or found.solution.r.any() or problem.nc > OTHERS:
        return []
    local = problem.condense() if problem.kind.startswith("global") else problem
    # tr W / m and ||q|| are those of a contact that stops alone
    response = float(np.mean(local.W.diagonal())) if problem.nc else 0.0
    near = APART * float(np.linalg.norm(local.q))
    own: list[_core.Solution] = []
    known = [np.asarray(found.solution.u)]
    for size in SIZES if response > 0 else ():
        start = np.zeros(problem.spacedim * problem.nc)
        start[:: problem.spacedim] = size * float(np.abs(local.q).max()) / response
        multipliers = np.zeros(problem.p) if problem.p else None
        guess = _core.Solution(r=start, l=multipliers)
        try:
            result = _solve.solve(problem, "nsn-ac", TARGET, guess=guess, max_iterations=30)
        except _core.UnsuitableError:
            return []
        u = np.asarray(result.solution.u)
        # near solutions are one that rounding has moved
        apart = [np.linalg.norm(u - one) > near for one in known]
        if all(apart) and judge(problem, result.solution).ok:
            known.append(u)
            own.append(_core.Solution(r=result.solution.r, l=result.solution.l))
    return own


def best_first(found: Found, problem: Any, several: Sequence[_core.Solution], by: str) -> Found:
    """One of several known solutions that has reactions, if the solver's own has none."""
    if not several or found.solution.r.any():
        return found
    own = [given(problem, one, by) for one in several if one.r.any()]
    return next((one for one in own if one.ok), found)


def write(
    path: Path,
    problem: Any,
    found: Found | None,
    guesses: Sequence[_core.Solution] = (),
    several: Sequence[_core.Solution] = (),
    untried: str = NOT_TRIED,
    **settings: Any,
) -> None:
    """Write a problem with the facts known of it.

    Args:
        path: path of the file.
        problem: the problem.
        found: the best known result; None: none was looked for.
        guesses: guesses of other origin.
        several: all known solutions, if there are more than one.
        untried: why nothing was found, if there is no result.
        settings: settings of `fclib.write`.
    """
    own = list(guesses)
    solution = found.solution if found is not None and found.ok else None
    iterate = None if found is None or found.ok or found.refuted else found
    if iterate is not None:
        own.append(_core.Solution(r=iterate.solution.r, l=iterate.solution.l))
    _core.write(path, problem, solution, own, **settings)
    if len(several) > 1:
        _core.write_solutions(path, several)
    if solution is not None and found is not None:
        _core.write_attributes(path, "solution", found.attributes)
        return
    if iterate is not None:
        _core.write_attributes(path, f"guesses/{len(own)}", iterate.attributes)
    _core.write_attributes(path, "info", {MARK: why_none(found, len(own)) if found else untried})


def why_none(found: Found, guess: int) -> str:
    """The reason why a file has no solution, in words."""
    if found.refuted:
        return "there is none, by a checked proof (Farkas' lemma)"
    return (
        f"none is known: guess {guess} is the best iterate, error {found.error:.1e} by both maps,"
        f" {found.solver}; a solution's is at most {TOLERANCE:g}"
    )


def guess_of(before: Any, solution: Given, problem: Any) -> _core.Solution | None:
    """A guess for one problem from the solution of another, contact by contact.

    A new contact gets no reaction. The multipliers stay if their number is the same. The result is
    None if one of the two problems does not name its contacts.

    Raises:
        ValueError: the size of the solution does not fit its problem.
    """
    if before.contacts is None or problem.contacts is None or before.spacedim != problem.spacedim:
        return None
    solution = _core.solution_from(solution)
    planar = problem.bodies is not None and problem.bodies.is_planar
    r = _geometry.carried(
        before.contacts, problem.contacts, solution.r, problem.spacedim, planar=planar
    )
    multipliers = None
    if problem.p:
        same = solution.l is not None and len(solution.l) == problem.p
        multipliers = solution.l if same else np.zeros(problem.p)
    return _core.Solution(r=r, l=multipliers)
