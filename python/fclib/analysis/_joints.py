"""Whether joints agree with each other: B x = e, decided on the data as given.

With M symmetric, x is the velocity of the bodies, and B = G^T. Nothing is rounded:

- Rows that are clearly independent have a solution. `least` is a lower bound of the singular values
  of B, so that some x* with B x* = e is within ||B x - e|| / least of any x.
- Other rows are eliminated in rational numbers. Each row carries its name along, which gives the
  combination z of rows that vanishes, B^T z = 0. If e . z is not zero, there is no x. Otherwise
  these rows follow from the others, which are enough.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import inf, isfinite

import numpy as np
import scipy.sparse as sp
from scipy.linalg import qr
from scipy.sparse.csgraph import connected_components

from fclib import _laws
from fclib._words import counted
from fclib.analysis._bounds import dot, exact_rows, least_singular, root_above
from fclib.analysis._data import DENSE, Array, Data
from fclib.analysis._rational import CONSTANT, Elimination, Equation, LateError

EXACT = 5.0  # [s] wall clock, limit of the elimination in rational numbers


@dataclass(frozen=True)
class Joints:
    """The rows of joints, B x = e.

    Attributes:
        B: (p x size), e: (p,).
        agree: whether some x satisfies them all, exactly; None if that is not shown.
        reason: in words, if they do not agree, or if that is not shown.
        kept: rows from which all others follow exactly, if they agree.
        scale: (p,) powers of two that bring the rows to a length near 1.
        least: lower bound of the singular values of the rows kept, times their scale; 0 if none is
            shown.
        combination: z with B^T z = 0 and e . z != 0, by row, if they contradict each other.
    """

    B: sp.csr_array = field(repr=False)
    e: Array = field(repr=False)
    agree: bool | None = True
    reason: str = ""
    kept: Array = field(default_factory=lambda: np.zeros(0, dtype=int), repr=False)
    scale: Array = field(default_factory=lambda: np.zeros(0), repr=False)
    least: float = inf
    combination: Mapping[int, Fraction] = field(default_factory=dict, repr=False)

    @property
    def certain(self) -> bool:
        """Whether they agree, and their rank does not depend on the last digits."""
        return self.agree is True and self.least > 0

    @property
    def gap(self) -> float:
        """The violation [m/s] of the largest row of the combination if the others hold."""
        if not self.combination:
            return 0.0
        total = sum((z * Fraction(float(self.e[k])) for k, z in self.combination.items()), _ZERO)
        return abs(float(total / max(map(abs, self.combination.values()))))

    def distance(self, x: Array) -> float:
        """A bound of the distance from x to a point that satisfies the rows; inf: not shown."""
        if not self.certain or not np.isfinite(x).all():
            return inf
        exact = [Fraction(float(one)) for one in x]
        square = _ZERO
        rows = exact_rows(self.B[self.kept])
        for k, row in zip(self.kept.tolist(), rows, strict=True):
            rest = dot(row, exact) - Fraction(float(self.e[k]))
            square += (rest * Fraction(float(self.scale[k]))) ** 2
        return float(root_above(square)) * (1 + 1e-15) / self.least if square else 0.0


_ZERO = Fraction()


def joints_of(data: Data, time_limit: float = EXACT) -> Joints:
    """The joints of a problem: G^T v = -b, or V^T r + R lambda = -s."""
    problem = data.problem
    if problem.p == 0:
        return Joints(sp.csr_array((0, 0)), np.zeros(0))
    if isinstance(problem, _laws.Global):
        assert problem.b is not None
        return joints_of_rows(sp.csr_array(data.matrices["G"].T), -problem.b, time_limit)
    assert problem.s is not None
    both = sp.hstack([data.matrices["V"].T, data.matrices["R"]])
    return joints_of_rows(sp.csr_array(both), -problem.s, time_limit)


def joints_of_rows(B: sp.csr_array, e: Array, time_limit: float = EXACT) -> Joints:
    """The joints of the rows B x = e."""
    if e.size == 0:
        return Joints(B, e)
    end = time.monotonic() + time_limit
    B = sp.csr_array(B)
    B.sum_duplicates()
    B.eliminate_zeros()
    lengths = np.sqrt(np.asarray(B.multiply(B).sum(axis=1)).ravel())
    empty = np.flatnonzero(np.diff(B.indptr) == 0)
    if wrong := [int(k) for k in empty if e[k] != 0]:
        return _contradicting(Joints(B, e), {wrong[0]: Fraction(1)})
    filled = np.flatnonzero(np.diff(B.indptr))
    if not (np.isfinite(lengths).all() and (lengths[filled] > 0).all()):
        return Joints(B, e, None, "the numbers of the joints are too large or too small", least=0.0)
    scale = np.ones(e.size)
    scale[filled] = np.exp2(-np.round(np.log2(lengths[filled])))
    scaled = sp.csr_array(sp.diags_array(scale) @ B)
    links = sp.csr_array(abs(scaled) @ abs(scaled).T)
    labels = connected_components(links, directed=False)[1]
    kept: list[int] = []
    least, unknown = inf, ""
    worst: Joints | None = None
    for label in np.unique(labels[filled]):
        rows = filled[labels[filled] == label]
        own = scaled[rows]
        own = own[:, np.flatnonzero(np.diff(sp.csc_array(own).indptr))]
        if max(own.shape) > DENSE:
            unknown = f"a loop of {counted(rows.size, 'row')} of joints is too large to be decided"
            continue
        if rows.size <= own.shape[1] and (bound := least_singular(own)) > 0:
            kept += rows.tolist()
            least = min(least, bound)
            continue
        try:
            rank, combination = _eliminated(B[rows], e[rows], end)
        except LateError:
            unknown = (
                f"no time was left to decide whether {counted(rows.size, 'row')} of joints agree"
            )
            continue
        if combination:
            named = {int(rows[k]): value for k, value in combination.items()}
            found = _contradicting(Joints(B, e), named)
            worst = found if worst is None or found.gap > worst.gap else worst
            continue
        order = qr(own.toarray().T, mode="r", pivoting=True)[1][:rank]
        chosen = np.sort(order)
        kept += rows[chosen].tolist()
        least = min(least, least_singular(own[chosen]) if rank else inf)
    if worst is not None:
        return worst
    found = Joints(B, e, True, "", np.array(sorted(kept), dtype=int), scale, least)
    if unknown:
        return replace(found, agree=None, reason=unknown, least=0.0)
    if not least > 0:
        return replace(found, reason="the rank of the joints rests on the last digits of the data")
    return found


def _contradicting(joints: Joints, combination: Mapping[int, Fraction]) -> Joints:
    found = replace(joints, agree=False, combination=combination, least=0.0)
    rows = ", ".join(map(str, sorted(combination)[:4])) + (", ..." if len(combination) > 4 else "")
    gap = f"by {found.gap:.1e} m/s" if isfinite(found.gap) else "by more than doubles hold"
    return replace(found, reason=f"bilateral constraints {rows} contradict each other {gap}")


def _eliminated(B: sp.csr_array, e: Array, end: float) -> tuple[int, dict[int, Fraction]]:
    """The rank, and the vanishing combination of rows that contradicts e the most, if any."""
    size = B.shape[1]
    equations: list[Equation] = exact_rows(B)
    for k, equation in enumerate(equations):
        equation[size + k] = Fraction(1)
        if e[k]:
            equation[CONSTANT] = Fraction(float(e[k]))
    elimination = Elimination(equations, end=end)
    elimination.take_out(range(size))
    most, found = _ZERO, {}
    for equation in equations:
        if not (off := abs(equation.get(CONSTANT, _ZERO))):
            continue
        z = {k - size: value for k, value in equation.items() if k != CONSTANT}
        terms = sum((abs(value * Fraction(float(e[k]))) for k, value in z.items()), _ZERO)
        if off / terms > most:
            most, found = off / terms, z
    return len(elimination.pivots), found
