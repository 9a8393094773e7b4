"""Reference solutions: found from the problem alone, judged by both maps, put into files.

    /solution       there only if it is a solution: its error by both maps is at most TOLERANCE
                    attributes: error, merit, natural, scaled_natural, solver, status, ends, date,
                    fclib
    /solutions      all that are known, of a problem with several
    /guesses/K      the best iterate, as the last guess, if no solution is known: attributes alike
    /fclib_*/info   attribute `solution`: why there is none

A solver works to the tolerance that was asked for. FINISH then goes on from what it found, to
TARGET. Near a solution Newton's methods take a few iterations, and all others take many. If they do
not come nearer, as with elastic bodies, `auto` does.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, Final

from fclib import _core, _solve
from fclib._judge import MARK, TOLERANCE, Judgement, judge
from fclib.collections.catalog import PROVEN

# the best that doubles allow of most problems: rounding of a product W r is 1e-14 of its terms
TARGET: Final = 1e-12
REACHED: Final = f"{TARGET:g} is reached"
# who goes on, and iterations at most; no time, so that all machines end at the same solution
FINISH: Final = (("nsn-jm", 30), ("auto", 3000))
AUTO: Final = "auto"
CONVERGED: Final = "converged"  # the status of what is a solution by both maps
EPOCH: Final = "SOURCE_DATE_EPOCH"  # environment: the time that files are to carry, in seconds


@dataclass(frozen=True)
class Found:
    """The best that is known of a problem: a solution, or an iterate."""

    solution: _core.Solution
    judgement: Judgement
    solver: str
    status: str  # what the solver said
    ends: str  # why there are no more digits, in words
    date: str = ""  # when it was found; empty: today
    # what `fclib.analysis.reference` says of it, if that was asked for
    certificate: Mapping[str, float | str] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether it is a solution."""
        return self.judgement.ok

    @property
    def error(self) -> float:
        """By both maps."""
        return self.judgement.error

    @property
    def refuted(self) -> bool:
        """Whether there is a proof that the problem has no solution."""
        return not self.ok and self.status == PROVEN

    @property
    def attributes(self) -> dict[str, float | str]:
        """What a file says of it."""
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
        """What a catalogue says of it."""
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
    """The day of a reference; that of SOURCE_DATE_EPOCH, for files that do not tell the day."""
    told = os.environ.get(EPOCH)
    now = datetime.now(timezone.utc)
    return (datetime.fromtimestamp(int(told), timezone.utc) if told else now).date().isoformat()


def find(problem: Any, solver: str, tol: float, **options: Any) -> Found:
    """Solve a problem from nothing, and go on to TARGET.

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
    """The same to TARGET, or to the last digit that FINISH reaches from it."""
    tried = []
    for name, iterations in FINISH:
        # what was no solution for `auto` is none the second time
        if found.error <= TARGET or (name == AUTO and not found.ok):
            break
        try:
            result = _solve.solve(
                problem,
                name,
                tol=TARGET,
                guess=found.solution,
                max_iterations=iterations,
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
    """The solution that two unrelated algorithms agree on; else the same, and why it is not one.

    Raises as `fclib.analysis.reference` does.
    """
    from fclib import analysis  # takes a while

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
    """A solution that is there already, and who found it."""
    judgement = judge(problem, solution)
    status = CONVERGED if judgement.ok else "inaccurate"
    return Found(solution, judgement, solver, status, "as it was given", date)


def carried(found: Found, local: Any) -> Found:
    """Of a global problem, as that of its local form, which is another one by rounding."""
    whole = found.solution
    own = _core.Solution(r=whole.r, u=whole.u, l=whole.l)
    judgement = judge(local, own)
    if not judgement.ok:
        own = _core.Solution(r=whole.r, l=whole.l)  # u follows
        judgement = judge(local, own)
    # what a certificate says is of the global form
    proof = {name: value for name, value in found.certificate.items() if name[:6] != "merit_"}
    mine = replace(found, solution=own, judgement=judgement, certificate=proof)
    # its own digits end elsewhere
    return finished(local, replace(mine, ends="")) if found.ok else mine


def best_first(found: Found, problem: Any, several: Sequence[_core.Solution]) -> Found:
    """Of several known solutions one that has reactions, if the solver found that without any."""
    if not several or found.solution.r.any():
        return found
    own = [given(problem, one, "enumeration") for one in several if one.r.any()]
    return next((one for one in own if one.ok), found)


def write(
    path: Path,
    problem: Any,
    found: Found | None,
    guesses: Sequence[_core.Solution] = (),
    several: Sequence[_core.Solution] = (),
    **settings: Any,
) -> None:
    """Write a problem with what is known of it.

    Args:
        path: of the file.
        problem: what it is.
        found: the best that is known; None: nothing was looked for.
        guesses: of other origin.
        several: all known solutions, if there are more than one.
        settings: of `fclib.write`.
    """
    own = list(guesses)
    solution = found.solution if found is not None and found.ok else None
    iterate = None if found is None or found.ok or found.refuted else found
    if iterate is not None:
        own.append(_core.Solution(r=iterate.solution.r, l=iterate.solution.l))
    _core.write(path, problem, solution, own, **settings)
    if len(several) > 1:
        _core.write_solutions(path, several)
    if found is None:
        return
    if solution is not None:
        _core.write_attributes(path, "solution", found.attributes)
        return
    if iterate is not None:
        _core.write_attributes(path, f"guesses/{len(own)}", found.attributes)
    _core.write_attributes(path, "info", {MARK: why_none(found, len(own))})


def why_none(found: Found, guess: int) -> str:
    """Why a file has no solution, in words."""
    if found.refuted:
        return "there is none, by a checked proof (Farkas' lemma)"
    return (
        f"none is known: guess {guess} is the best iterate, error {found.error:.1e} by both maps,"
        f" {found.solver}; a solution's is at most {TOLERANCE:g}"
    )
