"""Whether a solution is one: the one question of check, of the collection and of its verify."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fclib import _core
from fclib._solve import MeritKind

# of the error: what `solve` and `check` ask by default, and what a stored solution must hold
TOLERANCE = 1e-8
MARK = "solution"  # attribute of /fclib_*/info of a file without one: why there is none


@dataclass(frozen=True)
class Judgement:
    """What the data of a problem say of a solution."""

    merit: _core.Merit
    kind: MeritKind  # both maps, or the natural one alone
    tol: float

    @property
    def error(self) -> float:
        """What the tolerance bounds."""
        return self.merit.error_by(self.kind)

    @property
    def ok(self) -> bool:
        """Whether it is a solution; an error that is no number says no."""
        return self.error <= self.tol


def judge(
    problem: Any, solution: _core.Solution, tol: float = TOLERANCE, kind: MeritKind = "both"
) -> Judgement:
    """Judge a solution from the data of its problem alone.

    Raises:
        fclib.Error: the solution is not of the size of its problem, or M is singular.
    """
    return Judgement(_core.merit(problem, solution), kind, tol)
