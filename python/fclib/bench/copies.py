"""Renumbered copies of a problem: the mechanics are the same, the numbers differ.

The contacts are in another order, and the tangential directions of each are turned. Velocities and
impulses are in another unit, the same for both, so that W and all relative errors do not change. A
solver that knows an answer by heart does not know the answer of a copy. A result that depends on
the luck of rounding differs from copy to copy. The solution is carried back first, and judged on
the original problem.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib import _laws

# the unit lies between 1 / FACTOR and FACTOR; a power of 2 would not change the rounding
FACTOR = 10.0


class Copy:
    """A copy of a problem, and the way back from its solution."""

    def __init__(self, problem: Any, number: int) -> None:
        """Make a copy.

        Args:
            problem: in any formulation.
            number: number of the copy; 0 is the problem itself. The same number gives the same
                copy.
        """
        draw = np.random.default_rng([number, problem.nc])
        self.unit = float(FACTOR ** draw.uniform(-1.0, 1.0))
        order = draw.permutation(problem.nc)
        parts = list(_laws.parts(problem).values())
        self.turn = turned(draw, order, problem.spacedim, parts)
        changes: dict[str, Any] = {"contacts": None, "bodies": None}
        for name, values in _laws.coefficients(problem).items():
            changes[name] = values[order]
        local = problem.kind.startswith("local")
        for name, matrix in (("W", "both"), ("V", "rows")) if local else (("H", "columns"),):
            if (given := getattr(problem, name)) is not None:
                changes[name] = self.of_matrix(given, matrix)
        for name in ("q",) if local else ("w",):
            changes[name] = self.unit * (self.turn @ getattr(problem, name))
        for name in ("s",) if local else ("f", "b"):
            if (vector := getattr(problem, name)) is not None:
                changes[name] = self.unit * vector
        self.problem = problem.replace(**changes)

    def of_matrix(self, matrix: Any, sides: str) -> Any:
        """A matrix of the copy, stored as it was."""
        made = matrix
        if sides in ("both", "rows"):
            made = self.turn @ made
        if sides in ("both", "columns"):
            made = made @ self.turn.T
        return made if isinstance(matrix, np.ndarray) else made.asformat(matrix.format)

    def back(self, vectors: Mapping[str, Any]) -> dict[str, Any]:
        """The problem's solution, from the copy's; an array of wrong size stays as it is."""
        found = dict(vectors)
        for name, value in vectors.items():
            if name in ("u", "r", "certificate_y") and value.shape == self.turn.shape[:1]:
                found[name] = self.turn.T @ value / self.unit
            elif name in ("v", "l", "certificate_z"):
                found[name] = value / self.unit
        return found


def turned(
    draw: np.random.Generator, order: npt.NDArray[np.int64], d: int, parts: Sequence[slice]
) -> Any:
    """The orthogonal matrix (m, m) that puts contacts into an order and turns their frames.

    Planar ones are mirrored, or not. The spin stays as it is: it is about the normal.

    Args:
        draw: random numbers.
        order: the contacts in their new order.
        d: components of a contact.
        parts: the groups of tangential components.
    """
    nc = len(order)
    blocks = np.zeros((nc, d, d))
    blocks[:, 0, 0] = 1.0
    pairs = [(part.start, part.start + 1) for part in parts if part.stop - part.start == 2]
    alone = [part.start for part in parts if part.stop - part.start == 1]
    angle = draw.uniform(0.0, 2 * np.pi, nc)
    for first, second in pairs:
        blocks[:, first, first] = blocks[:, second, second] = np.cos(angle)
        blocks[:, first, second], blocks[:, second, first] = -np.sin(angle), np.sin(angle)
    if not pairs:
        sign = draw.choice([-1.0, 1.0], nc)
        for component in alone:
            blocks[:, component, component] = sign
    else:
        for component in alone:
            blocks[:, component, component] = 1.0
    if nc == 0:
        return sp.csr_array((0, 0))
    whole = sp.bsr_array((blocks, order, np.arange(nc + 1)), shape=(d * nc, d * nc))
    return whole.tocsr()
