"""Features of the data of problems, and which problems are nearly the same in their space.

Nothing here is measured: another machine gives the same figures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from fclib import _core, scenes

Array = npt.NDArray[np.float64]

DENSE: Final = 1500  # largest number of contact components for which W's spectrum is found
# Distance in the space of features below which two problems are nearly the same. Of 630 pairs of
# neighbours nearer than 0.05, among 1,762 problems of 48 families, all but 7 are steps of one
# simulation; of 169 more pairs nearer than 0.1, all. `nsgs` has the same error after 100 sweeps
# on both to about a third, and `ppa-nsn` takes the same number of iterations to about a fifth.
# From 0.2 on both differ by factors.
NEAR: Final = 0.1


class Matrix:
    """W and q of a problem, in the form that is compared."""

    def __init__(self, problem: Any) -> None:
        """Make it from a problem of any form."""
        from fclib.analysis._data import columns

        local = problem.condense() if problem.kind.startswith("global") else problem
        self.problem = problem
        self.local = local
        self.W = columns(local.W)
        self.q = np.asarray(local.q, dtype=float)
        self.mu = np.asarray(local.mu, dtype=float)


def structure(matrix: Matrix, source: Any) -> dict[str, float | None]:
    """Features of a problem's data; None if not known.

    Args:
        matrix: W and q of the problem.
        source: its scene, or its family.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    problem, W = matrix.problem, matrix.W
    d, nc = problem.spacedim, problem.nc
    m = d * nc
    rolling = problem.kind.endswith("rolling")
    trace = W.diagonal().reshape(nc, d).sum(axis=1)
    positive = trace[trace > 0]
    blocks = coo_array(W)
    pairs = coo_array(
        (np.ones(blocks.nnz), (blocks.row // d, blocks.col // d)), shape=(nc, nc)
    ).tocsr()
    _, label = connected_components(pairs, directed=False)
    sizes = np.bincount(label)
    normal = matrix.q.reshape(nc, d)[:, 0]
    total = float(np.linalg.norm(matrix.q))
    rank, conditioning = spectrum_of(problem, m)
    simulated = isinstance(source, scenes.Scene)
    return {
        "nc": nc,
        "n": problem.n,
        "p": problem.p,
        "spacedim": d,
        "rolling": float(rolling),
        "planar": float(d == (3 if rolling else 2)),
        "elastic": float(simulated and source.solids is not None),
        "gaps": float(simulated and source.law == "gap"),
        "periodic": float(simulated and source.period is not None),
        "density": m / problem.n if problem.n else None,
        "rank_ratio": m / rank if rank else None,
        "conditioning": conditioning or None,
        "neighbours": pairs.nnz / nc - 1,
        "islands": float(len(sizes)),
        "largest_island": float(sizes.max() / nc),
        "mu": float(matrix.mu.mean()),
        "mu_spread": float(matrix.mu.max() - matrix.mu.min()),
        "frictionless": float((matrix.mu == 0).mean()),
        "diagonal_spread": float(positive.max() / positive.min()) if positive.size else 1.0,
        "approaching": float((normal < 0).mean()),
        "normal_part": float(np.linalg.norm(normal) / total) if total else 0.0,
    }


def spectrum_of(problem: Any, m: int, most: int = DENSE) -> tuple[int | None, float | None]:
    """Rank and conditioning of W, without its bilateral constraints; None if m exceeds most."""
    from fclib.analysis._data import Data
    from fclib.analysis._spectrum import spectrum

    if m > most:
        return None, None
    try:
        reduced = Data.of_problem(problem).reduced
    except _core.Error:
        return None, None
    if reduced is None:
        return None, None
    found = spectrum(reduced.W, rounding=reduced.rounding)
    return found.rank, found.conditioning


# the scale of each feature: name, whether by logarithm, least value, weight
SCALES: Final[tuple[tuple[str, bool, float, float], ...]] = (
    ("nc", True, 1.0, 2.0),
    ("n", True, 1.0, 1.0),
    ("p", True, 1.0, 0.5),
    ("spacedim", False, 0.0, 1.0),
    ("rolling", False, 0.0, 1.0),
    ("planar", False, 0.0, 1.0),
    ("elastic", False, 0.0, 1.0),
    ("gaps", False, 0.0, 0.5),
    ("periodic", False, 0.0, 0.5),
    ("density", False, 0.0, 1.0),
    ("rank_ratio", False, 0.0, 1.0),
    ("conditioning", True, 1.0, 1.0),
    ("neighbours", True, 0.1, 1.0),
    ("islands", True, 1.0, 1.0),
    ("largest_island", False, 0.0, 1.0),
    ("mu", False, 0.0, 1.0),
    ("mu_spread", False, 0.0, 1.0),
    ("frictionless", False, 0.0, 0.5),
    ("diagonal_spread", True, 1.0, 1.0),
    ("approaching", False, 0.0, 0.5),
    ("normal_part", False, 0.0, 0.5),
)


def points(rows: Sequence[Mapping[str, Any]]) -> Array:
    """Rows of features as points (rows x features): logarithms of mean 0, scaled by weight.

    A value that is not known is set to the mean.
    """
    return np.array([column(rows, name, log, least) * w for name, log, least, w in SCALES]).T


def nearly_same(rows: Sequence[Mapping[str, Any]], bound: float = NEAR) -> list[int | None]:
    """For each row an earlier one that is nearer than the bound; None for the rows that stay.

    Only rows that stay are compared with. So a chain of near problems does not vanish as a whole.
    """
    from scipy.spatial import cKDTree

    if not rows:
        return []
    neighbours = cKDTree(points(rows)).query_ball_point(points(rows), bound)
    found: list[int | None] = []
    for place, near in enumerate(neighbours):
        stay = [k for k in near if k < place and found[k] is None]
        found.append(min(stay, default=None))
    return found


def farthest(place: Array, most: int) -> list[int]:
    """Points that are far apart, at most so many, in order.

    The first is the one nearest to the middle of all, each further one the farthest from those
    before it.
    """
    if len(place) <= most:
        return list(range(len(place)))
    found = [int(np.linalg.norm(place - place.mean(axis=0), axis=1).argmin())]
    apart = np.full(len(place), np.inf)
    while len(found) < most:
        apart = np.minimum(apart, np.linalg.norm(place - place[found[-1]], axis=1))
        found.append(int(apart.argmax()))
    return sorted(found)


def column(rows: Sequence[Mapping[str, Any]], name: str, log: bool, least: float) -> Array:
    """A feature of all rows, with mean 0 and deviation 1."""
    values = np.array([np.nan if row.get(name) is None else float(row[name]) for row in rows])
    if log:
        values = np.log10(np.maximum(values, least))
    known = values[~np.isnan(values)]
    if not known.size:
        return np.zeros(len(rows))
    deviation = float(known.std()) or 1.0
    return np.where(np.isnan(values), 0.0, (values - known.mean()) / deviation)
