"""Boxes, cylinders, capsules and ellipsoids, mixed in a box."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter

# half axes of a shape for its radius: boxes x, y, z; cylinders and capsules radius, half length
SHAPES = {
    "box": (0.7, 0.55, 0.45),
    "cylinder": (0.6, 0.6),
    "capsule": (0.45, 0.55),
    "ellipsoid": (1.0, 0.7, 0.5),
}


@dataclass(frozen=True, kw_only=True)
class PrimitiveSoup(Published):
    """Bodies of four shapes, turned at random, that fall into an open box and come to rest.

    Faces of boxes meet in several points, most of them redundant; other shapes meet in one, which
    wanders. The gap law keeps such bodies apart: with the velocity law they sink into each other.

    After the set PrimitiveSoup of the FCLIB library by V. Acary: 1000 bodies of five primitives,
    mu = 0.7. Shapes, sizes and the box are chosen here.
    """

    title: ClassVar[str] = "Soup of primitives"
    description: ClassVar[str] = (
        "Boxes, cylinders, capsules and ellipsoids dropped into an open box, under gravity."
    )
    application: ClassVar[str] = "granular matter"
    authors: ClassVar[str] = "V. Acary"
    collection: ClassVar[str] = "granular"
    problems: ClassVar[int] = 240

    bodies: int = parameter(120, "1", "number of bodies, at least 1")
    radius: float = parameter(1.0, "m", "of the ball in which a body fits")
    density: float = parameter(1000.0, "kg/m^3", "mass density")
    mu: float = parameter(0.7, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "0: the law of gaps is inelastic")
    width: float = parameter(8.5, "m", "inner edge of the box, a square")
    gyroscopic: bool = parameter(False, "1", "whether M has the derivative of gyroscopic terms")
    all_bodies: bool = parameter(
        False, "1", "whether bodies that touch nothing are in the problems too"
    )
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(0.0125, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("radius", "density", "time_step"),
            non_negative=("mu",),
            at_least={"bodies": 1, "width": 2.1 * self.radius},
        )
        if self.restitution:
            name = type(self).__name__
            raise ValueError(f"{name}: restitution must be 0, not {self.restitution}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the shapes and how they are turned."""
        random = np.random.Generator(np.random.PCG64(seed))
        kinds = random.integers(len(SHAPES), size=self.bodies)
        turned = mjcf.rotations(random, self.bodies)
        pitch = 2.05 * self.radius
        side = math.floor(self.width / pitch)
        bodies = mjcf.walls(0.5 * self.width, self.width, self.mu)
        for i in range(self.bodies):
            layer, cell = divmod(i, side * side)
            place = np.array([*divmod(cell, side), layer + 0.5])
            place[:2] -= 0.5 * (side - 1)
            shape = list(SHAPES)[kinds[i]]
            size = mjcf.numbers(*(self.radius * np.array(SHAPES[shape])))
            bodies.append(
                mjcf.grain(
                    f"{shape}{i}",
                    pitch * place,
                    f'type="{shape}" size="{size}" density="{self.density!r}"',
                    self._surface(),
                    mjcf.shade(i, self.bodies),
                    turned[i],
                )
            )
        return Scene.of_bodies(
            self, seed, bodies=bodies, tile=0.25 * self.width, multiccd=False, law="gap"
        )

    def _surface(self) -> str:
        """The friction of a body; that of a contact is the larger one of its two geometries."""
        return mjcf.surface(self.mu)
