"""Features of problems: of their structure, and of the behaviour of solvers on them.

The behaviour is that of solvers of different kinds, each with a few iterations. The cost of a step
of Newton's method or of a sweep does not count, so another machine gives the same figures.

SciPy and the analysis are imported only when they are used: the command line names this module
whenever it shows the commands of `fclib collection`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from fclib import _core, _solve, scenes

Array = npt.NDArray[np.float64]

TOLERANCE: Final = 1e-8
# a solver of each kind, and its largest number of iterations: sweeps, steps of a gradient method,
# Newton's
SOLVERS: Final[Mapping[str, int]] = {
    "nsgs": 100,
    "apgd": 200,
    "admm": 200,
    "nsn-ac": 20,
    "nsip": 20,
    "ppa-nsn": 60,
    "auto": 200,
}
TIME_LIMIT: Final = 0.5  # [s] for each solver; large problems end by it
DENSE: Final = 1500  # largest number of contact components for which W's spectrum is found
NEAR: Final = 1e-3  # relative difference of W and of q: below it two problems are nearly the same


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

    def near(self, other: Matrix, bound: float = NEAR) -> bool:
        """Whether W and q of both differ by less than `bound` of their norms, and mu is equal."""
        from scipy.sparse.linalg import norm

        if self.W.shape != other.W.shape or self.problem.kind != other.problem.kind:
            return False
        if not np.array_equal(self.mu, other.mu):
            return False
        if np.linalg.norm(self.q - other.q) > bound * np.linalg.norm(self.q):
            return False
        return bool(norm(self.W - other.W) <= bound * norm(self.W))


def thinned(matrices: Iterable[tuple[int, Matrix]]) -> list[tuple[int, Matrix]]:
    """The problems that are not nearly the same as an earlier one."""
    kept: list[tuple[int, Matrix]] = []
    for number, matrix in matrices:
        if not any(matrix.near(other) for _, other in kept):
            kept.append((number, matrix))
    return kept


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


def spectrum_of(problem: Any, m: int) -> tuple[int | None, float | None]:
    """Rank and conditioning of W, without its bilateral constraints; None if m is large."""
    from fclib.analysis._data import Data
    from fclib.analysis._spectrum import spectrum

    if m > DENSE:
        return None, None
    try:
        reduced = Data.of_problem(problem).reduced
    except _core.Error:
        return None, None
    if reduced is None:
        return None, None
    found = spectrum(reduced.W, rounding=reduced.rounding)
    return found.rank, found.conditioning


def behaviour(matrix: Matrix) -> dict[str, float | None]:
    """The error and the iterations of each of SOLVERS; None if it does not take the problem."""
    found: dict[str, float | None] = {}
    for name, iterations in SOLVERS.items():
        try:
            # condensed once for all solvers
            result = _solve.solve(
                matrix.local,
                name,
                TOLERANCE,
                max_iterations=iterations,
                time_limit=TIME_LIMIT,
            )
        except _core.UnsuitableError:
            error, effort = None, None
        else:
            error = result.error if np.isfinite(result.error) else 1e3
            effort = float(min(result.iterations, iterations) if result.converged else iterations)
        found |= {f"{name}_error": error, f"{name}_iterations": effort}
    return found


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


def points(rows: list[dict[str, Any]]) -> Array:
    """Rows of features as points (rows x features): logarithms of mean 0, scaled by weight.

    A value that is not known is set to the mean. Each feature of a solver counts half; all together
    count as much as seven of the structure.
    """
    made = [column(rows, name, log, least) * weight for name, log, least, weight in SCALES]
    for name in SOLVERS:
        if any(row.get(f"{name}_error") is not None for row in rows):
            made.append(0.5 * column(rows, f"{name}_error", True, 1e-8))
            made.append(0.5 * column(rows, f"{name}_iterations", True, 1.0))
    return np.array(made).T


def column(rows: list[dict[str, Any]], name: str, log: bool, least: float) -> Array:
    """A feature of all rows, with mean 0 and deviation 1."""
    values = np.array([np.nan if row.get(name) is None else float(row[name]) for row in rows])
    if log:
        values = np.log10(np.maximum(values, least))
    known = values[~np.isnan(values)]
    if not known.size:
        return np.zeros(len(rows))
    deviation = float(known.std()) or 1.0
    return np.where(np.isnan(values), 0.0, (values - known.mean()) / deviation)
