"""Whether a problem looks as if its data were in another order than N, T1, T2.

Nothing in a problem says which component of a contact is the normal: with the rows T1, T2, N it is
another problem, which may be solved with an error of 0 while bodies fall through each other. Two
signs of it are looked for, which contacts with the normal first do not have together:

- components that close (q < 0, as by gravity) where the first one does not;
- entries of W's diagonal: of a round body those of T1 and T2 are equal, and that of N is not.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from fclib import _core, _solve
from fclib.analysis._data import columns

MOST: Final = 0.9  # share of the contacts that must show a sign
FEW: Final = 0.1  # share of the contacts that may close along the first component
EQUAL: Final = 1e-6  # relative difference of entries that are equal
DIFFERENT: Final = 1e-2  # and of entries that are not
SMALL: Final = 1e-9  # of the largest q: below it a component neither closes nor opens
LARGEST: Final = 1000  # contacts of a global problem up to which it is condensed to be looked at


def conventions(problem: _solve.Problem) -> list[str]:
    """What about a problem's data suggests another convention, a line each; mostly nothing.

    Of a global problem with more contacts than LARGEST nothing.
    """
    if isinstance(problem, (_core.GlobalProblem, _core.GlobalRollingProblem)):
        if problem.nc > LARGEST:
            return []
        try:
            local = problem.condense()
        except _core.Error:  # what is wrong with it others say better
            return []
    else:
        local = problem
    d, nc = local.spacedim, local.nc
    force = 2 if d == 2 or (d == 3 and local.kind.endswith("rolling")) else 3
    diagonal = columns(local.W).diagonal().reshape(nc, d)[:, :force]
    q = np.asarray(local.q).reshape(nc, d)[:, :force]
    # limits have no tangents
    whole = (diagonal > 0).all(axis=1)
    diagonal, q = diagonal[whole], q[whole]
    if not len(q):
        return []
    closes = (q < -SMALL * np.abs(q).max()).mean(axis=0)
    count = len(q)
    for k in range(1, force):
        if closes[k] >= MOST and closes[0] <= FEW:
            return [
                f"q_N is negative in {round(closes[0] * count)} of {count} contacts, and component"
                f" {k + 1} of q in {round(closes[k] * count)}: is the normal first?"
            ]
        other = 3 - k  # of the two that may be tangents
        if force < 3 or closes[0] >= MOST:
            continue
        near = np.abs(diagonal[:, 0] - diagonal[:, other]) <= EQUAL * diagonal[:, 0]
        far = np.abs(diagonal[:, 0] - diagonal[:, k]) > DIFFERENT * diagonal[:, 0]
        round_ones = (near & far).sum()
        if round_ones >= MOST * count:
            return [
                f"component {k + 1} has an entry of its own on the diagonal of W, and W_NN is that"
                f" of component {other + 1}, in {round_ones} of {count} contacts: is the normal"
                " first?"
            ]
    return []
