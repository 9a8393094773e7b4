"""A pile of equal spheres on rough ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class Spheres(Published):
    """A column of equal spheres that collapses into a pile.

    Coulomb friction alone does not hold a pile on a plane: its spheres roll. Here the ground is a
    bed of fixed half spheres, and those that leave it roll away.

    After the set Spheres of the FCLIB library, 2000 spheres that fall on the ground, mu = 0.7. The
    bed and all sizes are chosen here.
    """

    title: ClassVar[str] = "Pile of spheres"
    description: ClassVar[str] = (
        "A column of equal spheres that collapses on a bed of half spheres."
    )
    application: ClassVar[str] = "granular matter"
    authors: ClassVar[str] = "V. Acary"
    collection: ClassVar[str] = "granular"
    problems: ClassVar[int] = 200

    spheres: int = parameter(250, "1", "number of spheres, at least 1")
    radius: float = parameter(1.0, "m", "radius of a sphere")
    density: float = parameter(2500.0, "kg/m^3", "mass density")
    mu: float = parameter(0.7, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    across: int = parameter(5, "1", "spheres of a layer along x and along y, at least 1")
    bed: int = parameter(15, "1", "half spheres of the bed along x and along y, at least 1")
    offset: float = parameter(0.1, "1", "largest offset at the start, in radii, at most 0.2")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(0.02, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("radius", "density", "time_step"),
            non_negative=("mu", "offset"),
            at_least={"spheres": 1, "across": 1, "bed": 1},
        )
        if not self.offset <= 0.2:
            raise ValueError(f"Spheres: offset must be <= 0.2, not {self.offset}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the offsets."""
        random = np.random.Generator(np.random.PCG64(seed))
        draws = random.uniform(-self.offset, self.offset, size=(self.spheres, 3))
        friction = mjcf.surface(self.mu)
        shape = f'type="sphere" size="{self.radius!r}"'
        bodies = []
        # the bed: touching, their centres in the plane of the floor
        half = 0.5 * (self.bed - 1)
        for i in range(self.bed * self.bed):
            x, y = 2 * self.radius * (np.array(divmod(i, self.bed)) - half)
            bodies.append(
                f'<geom {shape} pos="{mjcf.numbers(x, y, 0)}" {friction} rgba="0.62 0.6 0.57 1"/>'
            )
        # the column: offsets leave no overlap
        pitch = 2 * (1 + self.offset) * self.radius
        for i, draw in enumerate(draws):
            layer, cell = divmod(i, self.across**2)
            place = np.array([*divmod(cell, self.across), 0]) - 0.5 * (self.across - 1)
            place[2] = layer
            place = pitch * place + self.radius * draw
            place[2] += self.radius * (2 + self.offset)
            bodies.append(
                mjcf.grain(
                    f"sphere{i}",
                    place,
                    f'{shape} density="{self.density!r}"',
                    friction,
                    mjcf.shade(i, self.spheres),
                )
            )
        return Scene.of_bodies(self, seed, bodies=bodies, tile=4 * self.radius)
