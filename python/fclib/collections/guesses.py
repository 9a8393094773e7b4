"""A guess for the problem of the next step: the impulses of the same contacts."""

from __future__ import annotations

from typing import Any

import numpy as np

from fclib import _core, _geometry
from fclib._solve import Given


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
