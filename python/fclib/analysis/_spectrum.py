"""Rank and conditioning of a matrix, by its blocks.

A matrix decomposes into blocks that share no row and no column; its singular values are theirs.
Small blocks are treated densely, all of one shape at once. For a large block the singular values
are counted: those of a symmetric A above t are the eigenvalues of A - t and -A - t that are
positive, which Sylvester's law reads off a sparse factorisation (Parlett, "The symmetric eigenvalue
problem", 1980, section 3.3); those of any other are the roots of the eigenvalues of A^T A.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import eigsh, splu

from fclib.analysis._data import DENSE, EPS, Array, asymmetry

SPARSE_SYMMETRIC = 1e-10  # threshold of the rank, relative to the largest singular value
SPARSE_GRAM = 1e-6  # the same, if A^T A is used for A
HALVINGS = 12  # bisections of the decades between the threshold and the largest singular value


@dataclass(frozen=True)
class Spectrum:
    """A summary of the singular values of a matrix.

    Attributes:
        rank: number of singular values above the threshold.
        largest, smallest: the largest, and the smallest above the threshold; 0 without any.
        conditioning: their ratio; 0 without any. It is the condition number if the rank is full.
        method: the method that found them.
        threshold: absolute bound below which a value counts as zero.
        extremes: the lowest and the highest eigenvalue of a symmetric matrix that is treated
            densely, else None.
        doubtful: number of singular values that may be only rounding.
    """

    rank: int
    largest: float
    smallest: float
    method: str
    threshold: float
    extremes: tuple[float, float] | None = None
    doubtful: int = 0

    @property
    def conditioning(self) -> float:
        """The conditioning of the nonsingular part."""
        return self.largest / self.smallest if self.smallest else 0.0


@dataclass(frozen=True)
class Blocks:
    """The blocks of a matrix: dense ones stacked by shape, and sparse ones."""

    dense: list[Array]  # (count, rows, cols)
    sparse: list[Any]

    @property
    def method(self) -> str:
        """The method in words."""
        words = ["dense"] if self.dense or not self.sparse else []
        return " and ".join([*words, *(["Sylvester's inertia"] if self.sparse else [])])


def blocks_of(a: Any, limit: int = DENSE, square: bool = False) -> Blocks:
    """The nonempty blocks of a csc_array; those up to `limit` are dense.

    With `square`, a row and the column of the same number stay together, as for a matrix that acts
    on one space.
    """
    rows, cols = a.shape
    entries = a.tocoo()
    if square:
        graph, shift = sp.coo_array((np.ones(a.nnz), (entries.row, entries.col)), (rows, rows)), 0
    else:
        nodes = (rows + cols, rows + cols)
        graph = sp.coo_array((np.ones(a.nnz), (entries.row, rows + entries.col)), nodes)
        shift = rows
    count, label = connected_components(graph, directed=False)
    block_row, block_col = label[:rows], label[shift : shift + cols]
    height, width = np.bincount(block_row, minlength=count), np.bincount(block_col, minlength=count)
    inner_row, inner_col = _places(block_row, count), _places(block_col, count)
    own = block_col[entries.col]
    order = np.argsort(own, kind="stable")
    starts = np.searchsorted(own[order], np.arange(count + 1))
    shapes: dict[tuple[int, int], list[int]] = defaultdict(list)
    for held in np.flatnonzero(np.diff(starts)):
        shapes[int(height[held]), int(width[held])].append(int(held))
    dense, sparse = [], []
    for shape, members in shapes.items():
        if min(shape) > limit:
            for block in members:
                k = order[starts[block] : starts[block + 1]]
                place = (inner_row[entries.row[k]], inner_col[entries.col[k]])
                sparse.append(sp.csc_array((entries.data[k], place), shape=shape))
            continue
        stack = np.zeros((len(members), *shape))
        for at, block in enumerate(members):
            k = order[starts[block] : starts[block + 1]]
            stack[at, inner_row[entries.row[k]], inner_col[entries.col[k]]] = entries.data[k]
        dense.append(stack)
    return Blocks(dense, sparse)


def _places(label: Any, count: int) -> Any:
    """The place of each entry among those of its label."""
    order = np.argsort(label, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(label, minlength=count))])[:-1]
    places = np.empty(label.size, dtype=np.int64)
    places[order] = np.arange(label.size) - starts[label[order]]
    return places


def spectrum(a: Any, limit: int = DENSE, rounding: float = 0.0) -> Spectrum:
    """Rank and conditioning of a csc_array; dense blocks have at most `limit` rows or columns.

    The threshold is that of NumPy's matrix_rank, max(shape) eps sigma_1, if all is dense, or
    `rounding` if that is more.
    """
    square = a.shape[0] == a.shape[1] and asymmetry(a) <= max(a.shape) * EPS
    blocks = blocks_of(a, limit, square)
    extremes = None
    if square:
        signed = [np.linalg.eigvalsh(stack).ravel() for stack in blocks.dense]
        values = [abs(one) for one in signed]
        if not blocks.sparse:
            held = sum(one.size for one in signed)
            # rows without an entry have the eigenvalue 0
            everything = np.concatenate([*signed, np.zeros(1 if held < a.shape[0] else 0)])
            if everything.size:
                extremes = float(everything.min()), float(everything.max())
    else:
        values = [np.linalg.svd(stack, compute_uv=False).ravel() for stack in blocks.dense]
    found = np.concatenate(values) if values else np.zeros(0)
    large = [_Counter(block) for block in blocks.sparse]
    top = max([*(counter.largest for counter in large), float(found.max(initial=0))])
    relative = max(a.shape, default=0) * EPS
    relative = max([relative, *(counter.threshold for counter in large)])
    threshold = max(relative * top, rounding)
    kept = found[found > threshold]
    doubtful = int(((found > relative * top) & (found <= threshold)).sum())
    rank = int(kept.size) + sum(counter.above(threshold) for counter in large)
    smallest = [counter.smallest_above(threshold) for counter in large]
    if kept.size:
        smallest.append(float(kept.min()))
    dense = "dense eigenvalues" if square else "dense SVD"
    words = blocks.method.replace("dense", dense)
    if values and len(blocks.dense) + len(blocks.sparse) > 1:
        words += " by blocks"
    return Spectrum(rank, top, min(smallest, default=0.0), words, threshold, extremes, doubtful)


class _Counter:
    """Counts the singular values of a large sparse matrix above any number."""

    def __init__(self, a: Any) -> None:
        square = a.shape[0] == a.shape[1]
        self.gram = not (square and asymmetry(a) <= 1e-12)
        self.matrix = a.T @ a if self.gram and a.shape[0] >= a.shape[1] else a
        if self.gram and a.shape[0] < a.shape[1]:
            self.matrix = a @ a.T
        self.threshold = SPARSE_GRAM if self.gram else SPARSE_SYMMETRIC
        # a fixed start makes the same matrix give the same digits
        start = np.random.default_rng(0).standard_normal(self.matrix.shape[0])
        top = float(abs(eigsh(self.matrix, k=1, v0=start, return_eigenvectors=False)[0]))
        self.largest = float(np.sqrt(top)) if self.gram else top

    def above(self, value: float) -> int:
        """The number of singular values above the value."""
        if self.gram:
            return positive(self.matrix, value**2)
        return positive(self.matrix, value) + positive(-self.matrix, value)

    def smallest_above(self, value: float) -> float:
        """The smallest singular value above the value, to a hundredth."""
        count = self.above(value)
        if count == 0:
            return np.inf
        low, high = np.log(value), np.log(self.largest)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (middle, high) if self.above(np.exp(middle)) == count else (low, middle)
        return float(np.exp((low + high) / 2))


def positive(a: Any, shift: float) -> int:
    """The number of eigenvalues of a symmetric sparse A above the shift."""
    shifted = sp.csc_array(a - shift * sp.eye_array(a.shape[0]))
    # pivots on the diagonal: U's diagonal is D of L D L^T
    factors = splu(
        shifted,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    return int((factors.U.diagonal() > 0).sum())


def lowest_eigenvalue(a: Any, limit: int = DENSE) -> tuple[float, float, str]:
    """The smallest and the largest eigenvalue of a symmetric csc_array, and the method.

    For sparse blocks only the sign of the smallest is known: it is -threshold or 0.
    """
    blocks = blocks_of(a, limit, square=True)
    values = [np.linalg.eigvalsh(stack).ravel() for stack in blocks.dense]
    held = sum(stack.shape[0] * stack.shape[1] for stack in blocks.dense)
    held += sum(block.shape[0] for block in blocks.sparse)
    # rows without an entry have the eigenvalue 0
    found = np.concatenate([*values, np.zeros(1 if held < a.shape[0] else 0)])
    low, high = float(found.min(initial=np.inf)), float(found.max(initial=-np.inf))
    for block in blocks.sparse:
        top = _Counter(block).largest
        high = max(high, top)
        below = positive(-block, SPARSE_SYMMETRIC * top) > 0
        inside = positive(block, SPARSE_SYMMETRIC * top) == block.shape[0]
        low = min(low, -2 * SPARSE_SYMMETRIC * top if below else top * SPARSE_SYMMETRIC * inside)
    method = blocks.method.replace("dense", "dense eigenvalues")
    return (0.0 if np.isinf(low) else low), (0.0 if np.isinf(high) else high), method
