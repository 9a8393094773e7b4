"""Guaranteed bounds: sums in rational numbers, one-sided bounds of eigen- and singular values.

To show that a matrix has no eigenvalue below a bound, the bound and the rounding are subtracted
from its diagonal. It suffices that the result has a Cholesky factorisation (Rump 2006,
"Verification of positive definiteness").
"""

from __future__ import annotations

from fractions import Fraction
from math import inf, nextafter, sqrt
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fclib.analysis._data import DENSE, EPS, Array

Exact = list[dict[int, Fraction]]  # rows


def exact_rows(a: Any, other: Any = None) -> Exact:
    """The rows in rational numbers; or of half the sum with another matrix."""
    rows: Exact = [{} for _ in range(a.shape[0])]
    for matrix in (a,) if other is None else (a, other):
        entries = sp.coo_array(matrix)
        half = Fraction(1) if other is None else Fraction(1, 2)
        for row, col, value in zip(
            entries.row.tolist(), entries.col.tolist(), entries.data.tolist(), strict=True
        ):
            own = rows[row]
            own[col] = own.get(col, Fraction()) + half * Fraction(value)
    return rows


def dot(row: dict[int, Fraction], x: list[Fraction]) -> Fraction:
    """Row . x."""
    return sum((value * x[col] for col, value in row.items()), Fraction())


def least_singular(B: Any) -> float:
    """A lower bound of the singular values of a matrix with more columns than rows."""
    B = sp.csr_array(B)
    product = sp.csr_array(B @ B.T)
    # rounding error of a sum of so many terms
    lost = (int(np.diff(B.indptr).max(initial=0)) + 2) * EPS * (abs(B) @ abs(B).T)
    off = float(lost.sum(axis=1).max()) if lost.nnz else 0.0
    product = sp.csr_array((product + product.T) / 2)
    return sqrt(max(0.0, lower_bound(product) - 2 * off)) * (1 - 1e-14)


def length(row: dict[int, Fraction]) -> Fraction:
    """An upper bound of ||row||."""
    return root_above(sum((one * one for one in row.values()), Fraction()))


def below(x: Fraction) -> float:
    """A double that is at most x."""
    try:
        return nextafter(float(x), -inf)
    except OverflowError:
        return float(np.finfo(float).max) if x > 0 else -inf


def root_above(x: Fraction) -> Fraction:
    """A rational number at least the root, and larger by at most 1e-15 of it."""
    if x <= 0:
        return Fraction()
    shift = (x.denominator.bit_length() - x.numerator.bit_length()) // 2
    scale = Fraction(2) ** shift
    guess = Fraction(sqrt(float(x * scale * scale)) * (1 + 1e-15)) / scale
    while guess * guess < x:
        guess *= 1 + Fraction(1, 10**15)
    return guess


def lower_bound(a: Any) -> float:
    """A lower bound of the eigenvalues of a symmetric matrix; -inf if none was found.

    It is found by independent blocks, each up to the side DENSE.
    """
    a = sp.csr_array(a)
    if a.nnz == 0:
        return 0.0
    labels = connected_components(a, directed=False)[1]
    order = np.argsort(labels, kind="stable")
    sizes = np.bincount(labels)
    # rows that nothing couples, for example all of a diagonal matrix, at once
    least = float(a.diagonal()[sizes[labels] == 1].min(initial=inf))
    for block in np.split(order, np.cumsum(sizes)[:-1]):
        if block.size == 1:
            continue
        if block.size > DENSE:
            return -inf
        least = min(least, _lower_bound(a[block][:, block].toarray()))
    return least


def _lower_bound(a: Array) -> float:
    """Whether the Cholesky factorisation of a dense block a - shift succeeds."""
    n = len(a)
    diagonal = np.diag(a)
    if n == 1:
        return float(diagonal[0])
    if not np.isfinite(a).all():
        return -inf
    try:
        guess = float(np.linalg.eigvalsh(a)[0])
    except np.linalg.LinAlgError:
        return -inf
    gamma = (n + 2) * EPS  # rounding of n + 1 terms
    size = n * EPS * float(abs(a).max())
    for target in (guess / 2, 2 * guess, 0.0, *(-size * 4.0**k for k in range(8))):
        if target > guess:
            continue
        own = gamma * float(np.abs(diagonal - target).sum()) * (1 + 1e-6) + 1e-300
        shifted = a - (target + 2 * own) * np.eye(n)
        try:
            np.linalg.cholesky(shifted)
        except np.linalg.LinAlgError:
            continue
        return target
    return -inf
