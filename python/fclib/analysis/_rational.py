"""Linear systems and linear programs in rational arithmetic, for proofs.

Doubles are rational numbers, so that nothing is rounded. The simplex method keeps one table of
integers with one denominator (Edmonds 1967, "Systems of distinct representatives and linear
algebra"; Bareiss 1968): all its divisions are exact.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from math import inf, lcm
from typing import Any

import numpy as np

CONSTANT = -1  # the key of an equation's right side
GREEDY = 200  # pivots by the steepest column, before Bland's rule makes the end certain

Equation = dict[int, Fraction]  # sum over k of equation[k] x_k = equation[CONSTANT]


class LateError(Exception):
    """The time limit is over."""


@dataclass
class Elimination:
    """Unknowns eliminated from equations, and how they follow from the others."""

    equations: list[Equation]
    pivots: list[tuple[int, Equation]] = field(default_factory=list)
    end: float = inf  # time by time.monotonic() after which LateError is raised
    determinant: Fraction = Fraction(1)  # determinant of the eliminated part, up to its sign

    def take_out(self, unknowns: Iterable[int], among: set[int] | None = None) -> list[int]:
        """Eliminate unknowns by the equations of these numbers, or by all; return those left.

        An equation that was used is empty afterwards.
        """
        left = []
        for k in unknowns:
            if time.monotonic() > self.end:
                raise LateError
            holders = [
                number
                for number, equation in enumerate(self.equations)
                if k in equation and (among is None or number in among)
            ]
            if not holders:
                left.append(k)
                continue
            chosen = min(holders, key=lambda number: len(self.equations[number]))
            factor = self.equations[chosen][k]
            pivot = {j: value / factor for j, value in self.equations[chosen].items()}
            self.equations[chosen] = {}
            self.pivots.append((k, pivot))
            self.determinant *= abs(factor)
            for equation in self.equations:
                if (times := equation.get(k)) is None:
                    continue
                for j, value in pivot.items():
                    rest = equation.get(j, Fraction()) - times * value
                    if rest:
                        equation[j] = rest
                    else:
                        equation.pop(j, None)
        return left

    def complete(self, x: Mapping[int, Fraction], constant: int = 1) -> dict[int, Fraction]:
        """All unknowns: the eliminated ones follow, others that are not in x are zero.

        The right sides of the equations are multiplied by `constant`: 0 gives changes of unknowns.
        """
        result = dict(x)
        for k, pivot in reversed(self.pivots):
            total = constant * pivot.get(CONSTANT, Fraction())
            for j, value in pivot.items():
                if j not in (k, CONSTANT) and j in result:
                    total -= value * result[j]
            result[k] = total
        return result


def integers(row: list[Fraction]) -> list[int]:
    """A multiple of the row, without denominators."""
    common = lcm(*(value.denominator for value in row))
    return [int(value * common) for value in row]


class Table:
    """A table of the simplex method: A x = b, x >= 0, with the rows solved for a basis.

    Columns may be barred (not `allowed`): their variables are zero.
    """

    def __init__(self, A: Any, b: Any, denominator: int = 1) -> None:
        """A (rows, columns) and b (rows,), arrays of objects that are int, over a denominator.

        If unknowns were eliminated in integers, it is the determinant of the elimination.
        """
        sign = np.where(b < 0, -1, 1).astype(object)
        self.T = np.concatenate([A, b[:, None]], axis=1) * sign[:, None]
        self.denominator = denominator
        # -1 stands for an artificial variable of the row, which must become zero
        self.basis = np.full(len(b), -1)
        self.ray: dict[int, Fraction] = {}

    def copy(self) -> Table:
        """A copy with its own arrays."""
        result = object.__new__(Table)
        result.T, result.denominator = self.T.copy(), self.denominator
        result.basis, result.ray = self.basis.copy(), {}
        return result

    def value(self, k: int) -> Fraction:
        """The reduced column of the variable k."""
        rows = np.flatnonzero(self.basis == k)
        return Fraction(self.T[rows[0], -1], self.denominator) if rows.size else Fraction()

    def free(self, allowed: Any) -> Any:
        """The columns that are allowed and not in the basis."""
        outside = allowed.copy()
        outside[self.basis[self.basis >= 0]] = False
        return np.flatnonzero(outside)

    def _pivot(self, row: int, column: int) -> None:
        by = self.T[row, column]
        pivot_row = self.T[row].copy()
        result = (self.T * by - np.outer(self.T[:, column], pivot_row)) // self.denominator
        result[row] = pivot_row
        if by < 0:
            result, by = -result, -by
        self.T, self.denominator = result, by
        if row < self.basis.size:
            self.basis[row] = column

    def _minimise(self, cost: Any, own: int, allowed: Any, enough: int | None = None) -> Any:
        """Minimise cost . x over the allowed columns; `own` is the cost of artificial variables.

        It ends early if the variable `enough` is positive. It returns the last row of the table:
        the reduced costs and minus the least value, times the denominator; None if there is none.
        """
        at = np.where(self.basis < 0, own, cost[self.basis]).astype(object)
        last = np.append(cost, 0) * self.denominator - at @ self.T
        self.ray = {}
        self.T = np.concatenate([self.T, last[None, :]])
        try:
            for count in range(10**9):
                if enough is not None and self.value(enough) > 0:
                    return self.T[-1].copy()
                columns = self.free(allowed)
                reduced = self.T[-1, columns]
                falling = columns[reduced < 0]
                if falling.size == 0:
                    return self.T[-1].copy()
                column = falling[0] if count > GREEDY else columns[np.argmin(reduced)]
                rows = np.flatnonzero(self.T[:-1, column] > 0)
                if rows.size == 0:
                    self.ray = {int(column): Fraction(1)}
                    for row in np.flatnonzero(self.T[:-1, column]):
                        change = Fraction(-self.T[row, column], self.denominator)
                        self.ray[int(self.basis[row])] = change
                    return None
                ratios = [Fraction(self.T[i, -1], self.T[i, column]) for i in rows]
                least = min(ratios)
                tied = rows[[ratio == least for ratio in ratios]]
                self._pivot(int(tied[np.argmin(self.basis[tied])]), int(column))
        finally:
            self.T = self.T[:-1]

    def feasible(self, allowed: Any) -> Any:
        """Bring barred variables to zero. None if that is possible, else the proof that it is not.

        The proof (columns + 1,) is y . A and y . b, in integers, for some y: y . b > 0, and y . A
        <= 0 for the allowed columns.
        """
        cost = np.where(allowed, 0, 1).astype(object)
        last = self._minimise(cost, 1, allowed)
        if last[-1] < 0:
            return np.append(cost, 0) * self.denominator - last
        # barred variables at zero leave the basis; if none can replace one, its row does not
        # restrict the allowed ones
        for row in range(self.basis.size):
            k = self.basis[row]
            if k >= 0 and allowed[k]:
                continue
            others = self.free(allowed)
            held = others[self.T[row, others] != 0]
            if held.size:
                self._pivot(row, int(held[0]))
        kept = (self.basis >= 0) | (self.T[:, :-1] != 0).any(axis=1)
        self.T, self.basis = self.T[kept], self.basis[kept]
        return None

    def point(self) -> dict[int, Fraction]:
        """The nonzero variables; moved along the ray if one was found."""
        x = dict(self.ray)
        for row, k in enumerate(self.basis):
            if k >= 0 and self.T[row, -1]:
                value = Fraction(self.T[row, -1], self.denominator)
                x[int(k)] = x.get(int(k), Fraction()) + value
        return x

    def positive(self, k: int, allowed: Any) -> Any:
        """Make x_k positive in `point`. None if that is possible, else a proof that it is zero.

        The table must be feasible. The proof (columns + 1,) is z . A and z . b for some z: z . b =
        0, z . A >= 0 for the allowed columns, and (z . A)_k > 0.
        """
        cost = np.zeros(self.T.shape[1] - 1, dtype=object)
        cost[k] = -1
        last = self._minimise(cost, 0, allowed, enough=k)
        if last is None or self.value(k) > 0:
            return None
        return last - np.append(cost, 0) * self.denominator

    def rises(self, gain: Any, allowed: Any) -> bool:
        """Whether gain . x can be increased. The table must be feasible, and is changed."""
        start = self._dot(gain)
        last = self._minimise(-gain, 0, allowed)
        return last is None or self._dot(gain) > start

    def _dot(self, gain: Any) -> Fraction:
        held = self.basis >= 0
        return Fraction(int(gain[self.basis[held]] @ self.T[held, -1]), self.denominator)
