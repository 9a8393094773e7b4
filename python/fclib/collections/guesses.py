"""What a solution says of the problem of the next step: the impulses of the same contacts."""

from __future__ import annotations

from typing import Any

import numpy as np

from fclib import _core, _geometry
from fclib._solve import Given


def guess_of(before: Any, solution: Given, problem: Any) -> _core.Solution | None:
    """What a solution of a problem says of another one's, contact by contact.

    A contact that is new has no reaction, and multipliers stay where there are as many. None where
    one of the two problems does not name its contacts.

    Raises:
        ValueError: the solution is not of the size of its problem.
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
