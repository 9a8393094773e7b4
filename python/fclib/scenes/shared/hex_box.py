"""Upright boxes of equal hexahedra, for scenes of meshes."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from fclib.scenes.shared.solids import Face, HexMesh, Surface, Triple

Quads = tuple[tuple[int, ...], ...]
RING = ((0, 0), (1, 0), (1, 1), (0, 1))


@dataclass(frozen=True, kw_only=True)
class HexBox:
    """A box; its nodes are numbered along x, then y, then z."""

    low: Triple  # its lowest corner [m]
    size: Triple  # edges [m]
    elements: tuple[int, int, int]  # along each edge, at least 1

    @property
    def nodes(self) -> tuple[Triple, ...]:
        """The places of the nodes [m]."""
        x, y, z = (
            (start + np.linspace(0.0, edge, count + 1)).tolist()
            for start, edge, count in zip(self.low, self.size, self.elements, strict=True)
        )
        return tuple((a, b, c) for c in z for b in y for a in x)

    def quads(self, face: Face) -> Quads:
        """The quads of a face, in rings about the outward normal."""
        axis, upper = "xyz".index(face[0]), face[1] == "+"
        first, second = (axis + 1) % 3, (axis + 2) % 3
        found = []
        for j, i in itertools.product(range(self.elements[second]), range(self.elements[first])):
            quad = []
            for a, b in RING[:: 1 if upper else -1]:
                place = [0, 0, 0]
                place[axis] = self.elements[axis] if upper else 0
                place[first], place[second] = i + a, j + b
                quad.append(self._node(*place))
            found.append(tuple(quad))
        return tuple(found)

    def mesh(
        self, *, young: float, poisson: float, density: float, surfaces: tuple[Surface, ...]
    ) -> HexMesh:
        """The elastic body, of lumped mass."""
        nx, ny, nz = self.elements
        return HexMesh(
            nodes=self.nodes,
            elements=tuple(
                tuple(self._node(i + a, j + b, k + c) for c in (0, 1) for a, b in RING)
                for k, j, i in itertools.product(range(nz), range(ny), range(nx))
            ),
            young=young,
            poisson=poisson,
            density=density,
            lumped=True,
            surfaces=surfaces,
        )

    def _node(self, i: int, j: int, k: int) -> int:
        nx, ny, _ = self.elements
        return i + (nx + 1) * (j + (ny + 1) * k)
