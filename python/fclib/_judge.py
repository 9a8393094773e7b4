"""Whether a vector is a solution: the same test for check, the collection and its verify."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from fclib import _core
from fclib._solve import MeritKind

# bound of the error: the default of `solve` and `check`, and required of a stored solution
TOLERANCE = 1e-8
NO_APPROACH: Final = "no contact approaches"  # also if joints hold the bodies
ZERO: Final = "r = 0 is a solution"  # up to the tolerance
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


def trivial(problem: Any) -> str | None:
    """Why a problem is trivial, in words; None if it is not.

    If it has joints, their multipliers follow from r = 0. If they cannot be eliminated, or M cannot
    be inverted, nothing is said.

    Args:
        problem: the problem; its local form is quicker, if it is at hand.
    """
    try:
        local = problem.condense() if problem.kind.startswith("global") else problem
        reduced = local.eliminate() if local.p else local
        zero = np.zeros(local.spacedim * local.nc)
        if not judge(reduced, _core.Solution(r=zero)).ok:
            return None
    except _core.Error:
        return None
    normal = np.asarray(reduced.q).reshape(local.nc, local.spacedim)[:, 0]
    return NO_APPROACH if (normal >= 0).all() else ZERO
