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
from scipy.sparse.csgraph import connected_components, structural_rank
from scipy.sparse.linalg import eigsh, splu

from fclib.analysis._data import DENSE, EPS, Array, asymmetry

SPARSE_SYMMETRIC = 1e-10  # threshold of the rank, relative to the largest singular value
SPARSE_GRAM = 1e-6  # the same, if A^T A is used for A
# largest side of a block whose singular values a quick look finds directly. For an H of 700 x 1500
# they take four times as long as the eigenvalues of H H^T
SVD = 300
ROOTS = 1e-7  # threshold of the rank if the eigenvalues of A^T A are found, whose roots lose digits
LANCZOS = 60  # steps of an estimate: each is a product with A and one with A^T
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
        estimate: whether the rank is only an upper bound, and the conditioning a lower one.
    """

    rank: int
    largest: float
    smallest: float
    method: str
    threshold: float
    extremes: tuple[float, float] | None = None
    doubtful: int = 0
    estimate: bool = False

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


def quick_spectrum(a: Any, limit: int, rounding: float = 0.0) -> Spectrum:
    """Rank and conditioning of a csc_array, in a time that is bounded; for files that are built.

    The singular values of a block of up to `limit` rows or columns are found: the eigenvalues of a
    symmetric one, the singular values of one of up to SVD, and for others the roots of the
    eigenvalues of A^T A or A A^T, above ROOTS of the largest. For a larger block they are
    estimated: the rank is at most the structural one, and the conditioning at least that of the
    bidiagonal matrix of LANCZOS steps (Golub & Kahan 1965).
    """
    square = a.shape[0] == a.shape[1] and asymmetry(a) <= max(a.shape) * EPS
    blocks = blocks_of(a, limit, square)
    relative = max(a.shape, default=0) * EPS
    values: list[Array] = []
    signed: list[Array] = []
    words: dict[str, None] = {}
    for stack in blocks.dense:
        if square:
            signed.append(np.asarray(np.linalg.eigvalsh(stack), dtype=float).ravel())
            values.append(abs(signed[-1]))
            words["dense eigenvalues"] = None
        elif min(stack.shape[1:]) <= SVD:
            values.append(np.asarray(np.linalg.svd(stack, compute_uv=False), dtype=float).ravel())
            words["dense SVD"] = None
        else:
            wide = stack.shape[1] < stack.shape[2]
            over = stack.transpose(0, 2, 1)
            gram = stack @ over if wide else over @ stack
            values.append(np.sqrt(np.maximum(np.linalg.eigvalsh(gram), 0.0)).ravel())
            words["dense eigenvalues of A^T A" if not wide else "dense eigenvalues of A A^T"] = None
            relative = max(relative, ROOTS)
    found = np.concatenate(values) if values else np.zeros(0)
    bound = 0
    ends: list[Array] = []
    for block in blocks.sparse:
        ends.append(bidiagonal(block.__matmul__, block.T.__matmul__, block.shape[1]))
        bound += int(structural_rank(block))
        words[f"the structural rank and {LANCZOS} steps of Lanczos"] = None
    top = float(max([found.max(initial=0.0), *(end.max(initial=0.0) for end in ends)]))
    threshold = max(relative * top, rounding)
    kept = found[found > threshold]
    least = [float(part[part > threshold].min(initial=np.inf)) for part in (kept, *ends)]
    smallest = min(least)
    extremes = None
    if square and not ends:
        held = sum(one.size for one in signed)
        everything = np.concatenate([*signed, np.zeros(1 if held < a.shape[0] else 0)])
        if everything.size:
            extremes = float(everything.min()), float(everything.max())
    method = " and ".join(words) or "dense eigenvalues"
    if values and len(blocks.dense) + len(blocks.sparse) > 1:
        method += " by blocks"
    return Spectrum(
        int(kept.size) + bound,
        top,
        smallest if np.isfinite(smallest) else 0.0,
        method,
        threshold,
        extremes,
        int(((found > relative * top) & (found <= threshold)).sum()),
        bool(ends),
    )


def bidiagonal(apply: Any, transposed: Any, size: int, steps: int = LANCZOS) -> Array:
    """Approximate singular values of an operator on `size` numbers, from inside their range.

    Golub and Kahan's bidiagonalisation, with full reorthogonalisation, from a fixed start.
    """
    # of the range of A^T: nothing of the null space, whose values would look small
    v = np.asarray(transposed(apply(np.random.default_rng(0).standard_normal(size))), dtype=float)
    if not v.any():
        return np.zeros(0)
    right: list[Array] = [v / np.linalg.norm(v)]
    left: list[Array] = []
    diagonal: list[float] = []
    above: list[float] = []
    for _ in range(min(steps, size)):
        u = np.asarray(apply(right[-1]), dtype=float)
        for own in (left, left):  # twice is enough
            for other in own:
                u -= (other @ u) * other
        alpha = float(np.linalg.norm(u))
        if alpha <= EPS * max([*diagonal, *above], default=0.0) or alpha == 0:
            break
        left.append(u / alpha)
        diagonal.append(alpha)
        v = np.asarray(transposed(left[-1]), dtype=float)
        for own in (right, right):
            for other in own:
                v -= (other @ v) * other
        beta = float(np.linalg.norm(v))
        if beta <= EPS * max(diagonal):
            break
        above.append(beta)
        right.append(v / beta)
    if not diagonal:
        return np.zeros(0)
    count = len(diagonal)
    matrix = np.diag(diagonal) + np.diag(above[: count - 1], 1)
    return np.asarray(np.linalg.svd(matrix, compute_uv=False))


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
        shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
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
