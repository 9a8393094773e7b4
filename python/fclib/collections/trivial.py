"""Problems that r = 0 solves: they tell no solver from another."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from fclib import _core
from fclib._judge import judge

NO_APPROACH: Final = "no contact approaches"  # also if joints hold the bodies
ZERO: Final = "r = 0 is a solution"  # up to the tolerance


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
