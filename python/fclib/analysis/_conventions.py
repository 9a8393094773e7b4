"""Whether a problem's data seem to be in another order than N, T1, T2.

Nothing in a problem says which component of a contact is the normal: with the rows T1, T2, N it is
another problem. That one may be solved with an error of 0 while bodies fall through each other.
There are two signs; contacts with the normal first do not have both:

- components close (q < 0, for example by gravity), but the first one does not;
- of a round body, the contact's block of W is diagonal, with equal entries for T1 and T2, and
  another one for N. At a corner of a block it is not diagonal.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from fclib import _core, _laws, _solve
from fclib.analysis._data import columns

MOST: Final = 0.9  # least share of the contacts that must show a sign
FEW: Final = 0.1  # largest share of the contacts that may close along the first component
EQUAL: Final = 1e-6  # relative difference of entries that count as equal
DIFFERENT: Final = 1e-2  # and of entries that count as different
SMALL: Final = 1e-9  # relative to the largest q: below it a component neither closes nor opens
LARGEST: Final = 1000  # a global problem with more contacts is not condensed for this check


def conventions(problem: _solve.Problem) -> list[str]:
    """The signs of another convention in a problem's data, one line each; usually none.

    A global problem with more contacts than LARGEST is not checked.
    """
    if isinstance(problem, _laws.Global):
        if problem.nc > LARGEST:
            return []
        try:
            local = problem.condense()
        except _core.Error:  # other checks report the error better
            return []
    else:
        local = problem
    d, nc = local.spacedim, local.nc
    force = _laws.of_force(local.kind, d)
    W = columns(local.W)
    diagonal = W.diagonal().reshape(nc, d)[:, :force]
    coupled = largest_beside(W, d, force)
    q = np.asarray(local.q).reshape(nc, d)[:, :force]
    # limits have no tangents
    whole = (diagonal > 0).all(axis=1)
    diagonal, q, coupled = diagonal[whole], q[whole], coupled[whole]
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
        other = 3 - k  # the other of the two possible tangents
        if force < 3 or closes[0] >= MOST:
            continue
        near = np.abs(diagonal[:, 0] - diagonal[:, other]) <= EQUAL * diagonal[:, 0]
        far = np.abs(diagonal[:, 0] - diagonal[:, k]) > DIFFERENT * diagonal[:, 0]
        apart = coupled <= EQUAL * diagonal[:, 0]
        round_ones = (near & far & apart).sum()
        if round_ones >= MOST * count:
            return [
                f"component {k + 1} has an entry of its own on the diagonal of W, and W_NN is that"
                f" of component {other + 1}, in {round_ones} of {count} contacts: is the normal"
                " first?"
            ]
    return []


def largest_beside(W: Any, d: int, force: int) -> npt.NDArray[np.float64]:
    """The largest size of an entry beside the diagonal of each contact's block of forces."""
    entries = W.tocoo()
    row, column = entries.row, entries.col
    same = row // d == column // d
    beside = same & (row != column) & (row % d < force) & (column % d < force)
    found = np.zeros(W.shape[0] // d)
    np.maximum.at(found, row[beside] // d, np.abs(entries.data[beside]))
    return found
