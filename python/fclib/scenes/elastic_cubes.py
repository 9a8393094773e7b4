"""Two elastic unit cubes, one lying on the other, after decks of LMGC90."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Scene, parameter
from fclib.scenes.shared.hex_box import HexBox
from fclib.scenes.shared.interaction import Course, Drive, Interaction
from fclib.scenes.shared.solids import Face, HexMesh, Solids, Surface


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
        lower = self._cube(0.0, kind=1, face="z+")
        upper = self._cube(self.edge, kind=0, face="z-")
        foot = (self.elements + 1) ** 2
        return Scene.of(
            self,
            seed,
            solids=Solids(
                blocks=(), meshes=(lower, upper), mu=self.mu, reach=self.alert, gravity=self.gravity
            ),
            interactions=(
                Interaction(kinds=(0, 1), mu=self.mu, alert=self.alert, law="GAP_SGR_CLB"),
            ),
            drives=tuple(Drive(dof=i, velocity=True, course=Course()) for i in range(3 * foot)),
            law="gap",
            theta=self.theta,
        )

    def _cube(self, z: float, kind: int, face: Face) -> HexMesh:
        """A cube from some height on; the nodes of kind 0 look for faces."""
        box = HexBox(low=(0.0, 0.0, z), size=(self.edge,) * 3, elements=(self.elements,) * 3)
        return box.mesh(
            young=self.young,
            poisson=self.poisson,
            density=self.density,
            surfaces=(Surface(kind=kind, candidate=kind == 0, quads=box.quads(face)),),
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
