"""Whether a vector is a solution: the same test for check, the collection and its verify."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fclib import _core
from fclib._solve import MeritKind

# bound of the error: the default of `solve` and `check`, and required of a stored solution
TOLERANCE = 1e-8
MARK = "solution"  # attribute of /fclib_*/info in a file without a solution: the reason


@dataclass(frozen=True)
class Judgement:
    """The verdict on a solution from the data of its problem."""

    merit: _core.Merit
    kind: MeritKind  # both maps, or only the natural one
    tol: float

    @property
    def error(self) -> float:
        """The error that the tolerance bounds."""
        return self.merit.error_by(self.kind)

    @property
    def ok(self) -> bool:
        """Whether it is a solution; if the error is NaN, it is not."""
        return self.error <= self.tol


def judge(
    problem: Any, solution: _core.Solution, tol: float = TOLERANCE, kind: MeritKind = "both"
) -> Judgement:
    """Judge a solution from the data of its problem alone.

    Raises:
        fclib.Error: the solution does not fit the size of its problem, or M is singular.
    """
    return Judgement(_core.merit(problem, solution), kind, tol)
