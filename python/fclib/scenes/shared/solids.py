"""Elastic blocks and what acts on them: the scenes that `fclib.simulate.deformable` simulates.

A block is an upright box, turned about the vertical, of equal hexahedra. Its faces are named by its
own axes and their side: "x-", "x+", "y-", "y+", "z-", "z+".
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

Triple = tuple[float, float, float]
Face = Literal["x-", "x+", "y-", "y+", "z-", "z+"]


@dataclass(frozen=True, kw_only=True)
class Block:
    """A homogeneous elastic box, without stress at its first place."""

    centre: Triple  # [m]
    size: Triple  # edges [m]
    elements: tuple[int, int, int]  # along each edge
    young: float  # Young's modulus [Pa]
    poisson: float  # Poisson's ratio
    density: float  # [kg/m^3]
    yaw: float = 0.0  # about the vertical [rad]
    velocity: Triple = (0.0, 0.0, 0.0)  # of all its points at the start [m/s]


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Quads of a mesh that touch others: their nodes are candidates, or their faces are touched."""

    kind: int  # number of the kind, for the scene's interactions
    candidate: bool  # whether the nodes of the quads look for faces
    quads: tuple[tuple[int, ...], ...]  # nodes, in rings about the outward normals


@dataclass(frozen=True, kw_only=True)
class HexMesh:
    """A homogeneous elastic body of hexahedra of any shape, without stress at its first place."""

    nodes: tuple[Triple, ...]  # [m]
    elements: tuple[tuple[int, ...], ...]  # 8 nodes each: a lower ring, then the upper one
    young: float  # Young's modulus [Pa]
    poisson: float  # Poisson's ratio
    density: float  # [kg/m^3]
    lumped: bool = False  # whether the mass is diagonal
    surfaces: tuple[Surface, ...] = ()
    displacement: tuple[Triple, ...] = ()  # of the nodes at the start [m]; empty: none
    velocity: tuple[Triple, ...] = ()  # of the nodes at the start [m/s]; empty: none


@dataclass(frozen=True, kw_only=True)
class Load:
    """A traction on a face of some blocks, that grows evenly from nothing until `rise`.

    If it has a width, it is a wave cos^2 of that length along x, whose middle goes from `start`
    at some speed.
    """

    blocks: tuple[int, ...]
    face: Face
    traction: Triple  # [Pa], in the world
    begin: float = 0.0  # when it begins [s]
    rise: float = 0.0  # how long it grows [s]
    width: float | None = None  # along x [m]; None: everywhere
    start: float = 0.0  # x of its middle at time 0 [m]
    speed: float = 0.0  # [m/s]

    def share(self, time: float) -> float:
        """The share of the full traction at a time [s]."""
        if time <= self.begin:
            return 0.0
        return 1.0 if time >= self.begin + self.rise else (time - self.begin) / self.rise


@dataclass(frozen=True, kw_only=True)
class Bed:
    """A face held by springs in all directions, as if glued on an elastic layer."""

    block: int
    face: Face
    stiffness: float  # [Pa/m]


@dataclass(frozen=True, kw_only=True)
class Solids:
    """Blocks in contact with each other, and with a rigid floor z = 0, if there is one.

    The nodes of a block are kept outside the faces of the blocks before it in the list, so the
    lower block comes first. Two faces can touch if they look at each other and are no further apart
    than `reach` at the start.

    Instead of blocks there may be meshes.
    """

    blocks: tuple[Block, ...]
    mu: float  # coefficient of friction
    reach: float  # [m]
    gravity: float = 9.81  # downwards [m/s^2]
    damping: float = 0.0  # Kelvin-Voigt: C = damping K [s]
    floor: bool = False
    beds: tuple[Bed, ...] = ()
    loads: tuple[Load, ...] = ()
    # meshes have no floor, beds and loads; they touch by the interactions of the scene, and each
    # has its friction
    meshes: tuple[HexMesh, ...] = ()

    def __post_init__(self) -> None:
        if self.meshes and (self.blocks or self.beds or self.loads or self.floor):
            raise ValueError("meshes have no blocks, beds, loads and floor beside them")
        for i, block in enumerate(self.blocks):
            if min(block.size) <= 0 or min(block.elements) < 1:
                raise ValueError(f"block {i}: its edges must be > 0 and have at least 1 element")
            if not (block.young > 0 and block.density > 0 and -1 < block.poisson < 0.5):
                raise ValueError(
                    f"block {i}: needs Young's modulus > 0, density > 0 and Poisson's ratio in"
                    f" (-1, 0.5), not {block.young}, {block.density}, {block.poisson}"
                )
        for which in (*(b.block for b in self.beds), *(n for a in self.loads for n in a.blocks)):
            if not 0 <= which < len(self.blocks):
                raise ValueError(f"there is no block {which}, only {len(self.blocks)} blocks")
        for name, value in self._numbers():
            if not (value >= 0 and math.isfinite(value)):
                raise ValueError(f"{name} must be >= 0, not {value}")

    def _numbers(self) -> Iterator[tuple[str, float]]:
        yield "mu", self.mu
        yield "reach", self.reach
        yield "damping", self.damping
        for bed in self.beds:
            yield "stiffness of a bed", bed.stiffness
        for load in self.loads:
            yield "rise of a load", load.rise
