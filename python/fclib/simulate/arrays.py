"""The few operations on sparse matrices that a step needs, on their arrays.

SciPy checks and copies at every operation. This takes tens of microseconds, more than the entries
of a robot take. What each step does is in the core (core/stepping). Sums are taken in SciPy's
order, entry after entry, so that problems are the same to the last bit.
"""

from __future__ import annotations

import functools
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

Vector: TypeAlias = npt.NDArray[np.float64]
Sparse: TypeAlias = Any  # a SciPy sparse array
Index: TypeAlias = npt.NDArray[Any]


def pointers(lengths: Index) -> npt.NDArray[np.int32]:
    """The pointers (k + 1) of k rows or columns stored one after the other."""
    found = np.zeros(len(lengths) + 1, dtype=np.int32)
    lengths.cumsum(dtype=np.int32, out=found[1:])
    return found


@functools.lru_cache(maxsize=256)
def empty(shape: tuple[int, int]) -> Sparse:
    """A matrix by columns without entries; not to be changed."""
    return sp.csc_array(shape)


def by_columns(data: Vector, rows: Index, starts: Index, shape: tuple[int, int]) -> Sparse:
    """A matrix by columns from arrays that are known to fit; they are not copied."""
    matrix = sp.csc_array.__new__(sp.csc_array)
    # faster than copy.copy, and than SciPy's check of arrays that are known to fit
    matrix.__dict__.update(empty(shape).__dict__)
    matrix.data, matrix.indices, matrix.indptr = data, rows, starts
    return matrix


def matrix_of(arrays: tuple[Any, ...], shape: tuple[int, int]) -> Sparse:
    """A matrix by columns from the three arrays that the core returns."""
    data, rows, starts = arrays
    return by_columns(data, rows, starts, shape)


def lengths_of(starts: Index) -> Index:
    """The lengths (k) of rows or columns with these pointers (k + 1)."""
    lengths: Index = starts[1:] - starts[:-1]  # np.diff takes four times as long
    return lengths


def columns_of(matrix: Sparse) -> npt.NDArray[np.intp]:
    """The column (nnz) of each entry."""
    return np.arange(len(matrix.indptr) - 1).repeat(lengths_of(matrix.indptr))


def transposed_times(matrix: Sparse, x: Vector) -> Vector:
    """A^T x."""
    weights = matrix.data * x.take(matrix.indices)
    sums = np.bincount(columns_of(matrix), weights, matrix.shape[1])
    return np.asarray(sums, dtype=float)


def submatrix(matrix: Sparse, columns: Index, rows: Index | None = None) -> Sparse:
    """The columns of these numbers; -1 means an empty one. `rows` has the new number of each row.

    All entries must lie in rows that have a number.
    """
    first = matrix.indptr.take(columns)
    # for -1 it is the pointer past the end
    lengths = np.maximum(matrix.indptr.take(columns + 1) - first, 0)
    starts = pointers(lengths)
    entries = (first - starts[:-1]).repeat(lengths) + np.arange(starts[-1])
    indices = matrix.indices.take(entries)
    size = matrix.shape[0]
    if rows is not None:
        indices, size = rows.take(indices), int((rows >= 0).sum())
    return by_columns(matrix.data.take(entries), indices, starts, (size, len(columns)))


def without_zeros(data: Vector, rows: Index, starts: Index, shape: tuple[int, int]) -> Sparse:
    """A matrix by columns from arrays, which are copied; zeros are dropped."""
    kept = data.nonzero()[0]
    if len(kept) == len(data):
        starts = starts.astype(np.int32, copy=False)
        return by_columns(data.copy(), rows.astype(np.int32), starts, shape)
    starts = kept.searchsorted(starts).astype(np.int32)
    return by_columns(data.take(kept), rows.take(kept).astype(np.int32, copy=False), starts, shape)
