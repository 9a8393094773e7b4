"""Renumbered copies of a problem: the mechanics are the same, the numbers differ.

The contacts are in another order, and the tangential directions of each are turned. Velocities and
impulses are in another unit, the same for both, so that W and all relative errors do not change. A
solver that knows an answer by heart does not know the answer of a copy. A result that depends on
the luck of rounding differs from copy to copy. The solution is carried back first, and judged on
the original problem.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

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
        self.turn = turned(draw, order, problem.spacedim, problem.kind.endswith("rolling"))
        changes: dict[str, Any] = {"mu": problem.mu[order], "contacts": None, "bodies": None}
        if problem.kind.endswith("rolling"):
            changes["mu_r"] = problem.mu_r[order]
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


def turned(draw: np.random.Generator, order: npt.NDArray[np.int64], d: int, rolling: bool) -> Any:
    """The orthogonal matrix (m, m) that puts contacts into an order and turns their frames.

    Planar ones are mirrored, or not.
    """
    nc = len(order)
    blocks = np.zeros((nc, d, d))
    blocks[:, 0, 0] = 1.0
    pairs = [(1, 2), (3, 4)] if rolling and d == 5 else [(1, 2)] if d == 3 and not rolling else []
    angle = draw.uniform(0.0, 2 * np.pi, nc)
    for first, second in pairs:
        blocks[:, first, first] = blocks[:, second, second] = np.cos(angle)
        blocks[:, first, second], blocks[:, second, first] = -np.sin(angle), np.sin(angle)
    if not pairs:
        sign = draw.choice([-1.0, 1.0], nc)
        for component in range(1, d):
            blocks[:, component, component] = sign
    if nc == 0:
        return sp.csr_array((0, 0))
    whole = sp.bsr_array((blocks, order, np.arange(nc + 1)), shape=(d * nc, d * nc))
    return whole.tocsr()
