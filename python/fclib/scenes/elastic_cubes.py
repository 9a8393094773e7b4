"""Two elastic unit cubes, one lying on the other, after decks of LMGC90."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Scene, parameter
from fclib.scenes.shared.interaction import Course, Drive, Interaction
from fclib.scenes.shared.solids import HexMesh, Solids, Surface


@dataclass(frozen=True, kw_only=True)
class ElasticCubes:
    """A cube of stone on another, which is clamped at its foot; their weight acts from time 0 on.

    The nodes of the upper one's lower face are held against the faces below, node on node.

    After the decks cubes_H8_2, cubes_H8_5 and cubes_H8_20 of V. Acary and the developers of LMGC90:
    their meshes, lumped masses, material, friction, law GAP_SGR_CLB, alert distance, step and
    theta.
    """

    title: ClassVar[str] = "Two cubes of stone"
    description: ClassVar[str] = (
        "A cube of 8-node hexahedra lies on another, after the LMGC90 decks cubes_H8."
    )
    application: ClassVar[str] = "deformable solids"
    authors: ClassVar[str] = "V. Acary, the developers of LMGC90"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "decks"
    problems: ClassVar[int] = 200
    allowance: ClassVar[bool] = False  # the law of gaps has none

    elements: int = parameter(5, "1", "elements along an edge of a cube, at least 1")
    edge: float = parameter(1.0, "m", "edge of a cube")
    young: float = parameter(7e10, "Pa", "Young's modulus")
    poisson: float = parameter(0.2, "1", "Poisson's ratio")
    density: float = parameter(2750.0, "kg/m^3", "mass density")
    mu: float = parameter(0.3, "1", "coefficient of friction")
    alert: float = parameter(0.1, "m", "alert distance")
    restitution: float = parameter(0.0, "1", "0: the law GAP_SGR_CLB is inelastic")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    theta: float = parameter(0.505, "1", "theta of the scheme, in [1/2, 1]")
    time_step: float = parameter(0.01, "s", "time step h")

    # of a scene of this kind that is quickly simulated
    small: ClassVar[Mapping[str, Any]] = {"elements": 2}

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("edge", "young", "density", "time_step"),
            non_negative=("mu", "alert"),
            at_least={"elements": 1},
        )
        if self.restitution:
            raise ValueError(f"{type(self).__name__}: restitution must be 0")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; nothing of it is random."""
        lower = self._cube(0.0, Surface(kind=1, candidate=False, quads=self._face(top=True)))
        upper = self._cube(self.edge, Surface(kind=0, candidate=True, quads=self._face(top=False)))
        foot = (self.elements + 1) ** 2
        return Scene.of(
            self,
            seed,
            solids=Solids(
                blocks=(),
                meshes=(lower, upper),
                mu=self.mu,
                reach=self.alert,
                gravity=self.gravity,
            ),
            interactions=(
                Interaction(kinds=(0, 1), mu=self.mu, alert=self.alert, law="GAP_SGR_CLB"),
            ),
            drives=tuple(Drive(dof=i, velocity=True, course=Course()) for i in range(3 * foot)),
            law="gap",
            theta=self.theta,
        )

    def _node(self, i: int, j: int, k: int) -> int:
        return i + (self.elements + 1) * (j + (self.elements + 1) * k)

    def _cube(self, z: float, surface: Surface) -> HexMesh:
        count = self.elements
        axis = np.linspace(0.0, self.edge, count + 1).tolist()
        ring = ((0, 0), (1, 0), (1, 1), (0, 1))
        return HexMesh(
            nodes=tuple((x, y, z + height) for height in axis for y in axis for x in axis),
            elements=tuple(
                tuple(self._node(i + a, j + b, k + c) for c in (0, 1) for a, b in ring)
                for k, j, i in itertools.product(range(count), repeat=3)
            ),
            young=self.young,
            poisson=self.poisson,
            density=self.density,
            lumped=True,
            surfaces=(surface,),
        )

    def _face(self, *, top: bool) -> tuple[tuple[int, ...], ...]:
        """The quads of the upper or the lower face, outwards."""
        ring = ((0, 0), (1, 0), (1, 1), (0, 1))[:: 1 if top else -1]
        k = self.elements if top else 0
        return tuple(
            tuple(self._node(i + a, j + b, k) for a, b in ring)
            for j, i in itertools.product(range(self.elements), repeat=2)
        )


@dataclass(frozen=True, kw_only=True)
class ElasticCubesx2(ElasticCubes):
    """The cubes with two elements a side: nine nodes meet."""

    elements: int = parameter(2, "1", "elements along an edge of a cube, at least 1")


@dataclass(frozen=True, kw_only=True)
class ElasticCubesx20(ElasticCubes):
    """The cubes with twenty elements a side: 54,243 degrees of freedom, 441 nodes meet."""

    problems: ClassVar[int] = 5

    elements: int = parameter(20, "1", "elements along an edge of a cube, at least 1")
