"""Stiffness of a block of equal bricks of eight nodes, for any constant tangent.

K_(a i)(b j) = sum_km C_ikjm int d_k N_a d_m N_b. On a brick the integrals are products of one for
each axis, which are exact; all sums are taken in one order, the same everywhere.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

Vector: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]
Table: TypeAlias = tuple[tuple[float, ...], ...]

# of the two linear functions on [0, 1]: int N_a N_b, int N_a' N_b, int N_a' N_b'
MASS: Final[Table] = ((1 / 3, 1 / 6), (1 / 6, 1 / 3))
MIXED: Final[Table] = ((-0.5, -0.5), (0.5, 0.5))
STIFFNESS: Final[Table] = ((1.0, -1.0), (-1.0, 1.0))
CORNERS: Final = tuple(itertools.product((0, 1), repeat=3))  # of a brick, x first


@dataclass(frozen=True)
class Block:
    """A block of bricks, with one corner in the origin."""

    counts: tuple[int, int, int]  # bricks along x, y, z
    edges: tuple[float, float, float]  # of a brick [m]

    @property
    def nodes(self) -> tuple[int, int, int]:
        """Nodes along x, y, z."""
        x, y, z = self.counts
        return x + 1, y + 1, z + 1

    def numbers(self) -> Integers:
        """The numbers of the nodes, by their places along x, y, z."""
        return np.arange(int(np.prod(self.nodes)), dtype=np.int64).reshape(self.nodes)

    def places(self) -> Vector:
        """(nodes x 3) [m]."""
        axes = [edge * np.arange(count) for edge, count in zip(self.edges, self.nodes, strict=True)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    def bricks(self) -> Integers:
        """(bricks x 8) their nodes, in the order of CORNERS."""
        number = self.numbers()
        x, y, z = self.counts
        parts = [number[a : a + x, b : b + y, c : c + z].ravel() for a, b, c in CORNERS]
        return np.stack(parts, axis=1)

    def stiffness(self, tangents: Sequence[Vector], which: Integers) -> Any:
        """K (3 nodes x 3 nodes), not symmetric if a tangent is not.

        Args:
            tangents: C (3 x 3 x 3 x 3) each: stress_ik = C_ikjm strain_jm [Pa].
            which: (bricks) the tangent of each.
        """
        own = [self._brick(tangent).ravel() for tangent in tangents]
        values = np.stack(own)[which]
        dofs = (3 * self.bricks()[:, :, None] + np.arange(3)).reshape(len(which), 24)
        size = 3 * int(np.prod(self.nodes))
        rows = np.broadcast_to(dofs[:, :, None], (len(which), 24, 24)).ravel()
        columns = np.broadcast_to(dofs[:, None, :], (len(which), 24, 24)).ravel()
        # summed in the order of the bricks
        keys, place = np.unique(columns * size + rows, return_inverse=True)
        sums = np.bincount(place.ravel(), weights=values.ravel())
        where = (keys % size, keys // size)
        return sp.csc_array((sums, where), shape=(size, size))

    def _brick(self, tangent: Vector) -> Vector:
        """(24 x 24) of one brick."""
        K = np.zeros((8, 3, 8, 3))
        for k, m in itertools.product(range(3), repeat=2):
            integrals = self._integrals(k, m)
            K += integrals[:, None, :, None] * tangent[:, k, :, m][None, :, None, :]
        whole: Vector = K.reshape(24, 24)
        same = tangent == tangent.transpose(2, 3, 0, 1)
        if same.all():  # rounding aside, K is symmetric
            whole = 0.5 * (whole + whole.T)
        return whole

    def _integrals(self, k: int, m: int) -> Vector:
        """(8 x 8) int d_k N_a d_m N_b over a brick."""
        found = np.ones((8, 8))
        for axis in range(3):
            edge = self.edges[axis]
            table: Table
            if axis == k and axis == m:
                table, scale = STIFFNESS, 1 / edge
            elif axis == k:
                table, scale = MIXED, 1.0
            elif axis == m:
                table, scale = tuple(zip(*MIXED, strict=True)), 1.0
            else:
                table, scale = MASS, edge
            for a, first in enumerate(CORNERS):
                for b, second in enumerate(CORNERS):
                    found[a, b] *= scale * table[first[axis]][second[axis]]
        return found


def isotropic(young: float, poisson: float) -> Vector:
    """C of linear elasticity [Pa]."""
    shear = young / (2 * (1 + poisson))
    lame = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    return of_moduli(lame, shear)


def of_moduli(lame: float, shear: float) -> Vector:
    """C_ikjm = lambda d_ik d_jm + G (d_ij d_km + d_im d_kj)."""
    C = np.zeros((3, 3, 3, 3))
    for i, k, j, m in itertools.product(range(3), repeat=4):
        C[i, k, j, m] = lame * (i == k) * (j == m) + shear * (
            (i == j) * (k == m) + (i == m) * (k == j)
        )
    return C
