"""Spheres dropped into a box that bounce until they lie."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class BouncingPile(Published):
    """Equal spheres that fall into an open box and bounce, by Newton's law of impact.

    The right-hand side has e u_N^- at each contact, which is 0 in families with e = 0. Newton's law
    with friction may gain energy if an impact slides and stops (Kane and Levinson, 1985): the
    sets keep such steps as they are.
    """

    title: ClassVar[str] = "Bouncing pile"
    description: ClassVar[str] = "Spheres that fall into a box and bounce, with restitution."
    application: ClassVar[str] = "impacts"
    collection: ClassVar[str] = "impacts"
    problems: ClassVar[int] = 200

    spheres: int = parameter(100, "1", "number of spheres, at least 1")
    across: int = parameter(4, "1", "spheres of a layer along x and along y, at least 1")
    radius: float = parameter(0.1, "m", "radius of a sphere")
    density: float = parameter(2500.0, "kg/m^3", "mass density")
    mu: float = parameter(0.3, "1", "coefficient of friction")
    restitution: float = parameter(0.8, "1", "Newton's coefficient of restitution, in [0, 1]")
    height: float = parameter(0.2, "m", "of the lowest layer's fall")
    offset: float = parameter(0.1, "1", "largest offset at the start, in radii, at most 0.2")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(2e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("radius", "density", "time_step"),
            non_negative=("mu", "height", "offset"),
            at_least={"spheres": 1, "across": 1},
        )
        if not self.offset <= 0.2:
            raise ValueError(f"BouncingPile: offset must be <= 0.2, not {self.offset}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the offsets."""
        random = np.random.Generator(np.random.PCG64(seed))
        draws = random.uniform(-self.offset, self.offset, size=(self.spheres, 3))
        pitch = 2.5 * self.radius
        friction = mjcf.surface(self.mu)
        bodies = mjcf.walls(0.5 * pitch * self.across, pitch * self.across, self.mu)
        for i, draw in enumerate(draws):
            layer, cell = divmod(i, self.across**2)
            place = np.array([*divmod(cell, self.across), layer]) * pitch
            place[:2] -= 0.5 * pitch * (self.across - 1)
            place[2] += self.radius + self.height
            place += self.radius * draw
            bodies.append(mjcf.sphere(i, self.spheres, place, self.radius, self.density, friction))
        return Scene.of_bodies(self, seed, bodies=bodies, tile=4 * self.radius)
