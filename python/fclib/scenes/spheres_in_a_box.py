"""Spheres of many sizes that fill a box."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class SpheresInABox(Published):
    """Spheres of a range of sizes, poured into an open box, that come to rest.

    As many as the box's section holds lie in a layer of the start, the layers a little apart. The
    packing is disordered, and its masses differ by (1 - spread)^-3.

    Or fewer lie in a layer: a column that falls, and spreads in the box. So begin the sets Spheres
    and Spheres_1mm of the FCLIB library, 2000 equal spheres, which have these figures in the set
    `fclib2024`. The figures below are chosen here.
    """

    title: ClassVar[str] = "Spheres in a box"
    description: ClassVar[str] = "Spheres of many sizes poured into an open box, under gravity."
    application: ClassVar[str] = "granular matter"
    authors: ClassVar[str] = "V. Acary"
    collection: ClassVar[str] = "granular"
    problems: ClassVar[int] = 240

    spheres: int = parameter(150, "1", "number of spheres, at least 1")
    radius: float = parameter(1.0, "m", "largest radius of a sphere")
    spread: float = parameter(0.4, "1", "the smallest radius is smaller by this share, in [0, 1)")
    density: float = parameter(2500.0, "kg/m^3", "mass density")
    mu: float = parameter(0.7, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    width: float = parameter(10.6, "m", "inner edge of the box, a square")
    gap: float = parameter(0.1, "m", "clearance of two places of the grid at the start")
    across: int = parameter(
        0, "1", "places of a layer along x and along y at the start; 0: as many as the box holds"
    )
    lift: float = parameter(0.0, "m", "height of the lowest layer's places at the start")
    offset: float = parameter(0.0, "m", "further room of a sphere in its place, at most gap / 2")
    all_bodies: bool = parameter(
        False, "1", "whether spheres that touch nothing are in the problems too"
    )
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(0.0125, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("radius", "density", "time_step"),
            non_negative=("mu", "spread", "gap", "lift", "offset"),
            at_least={
                "spheres": 1,
                "across": 0,
                "width": max(1, self.across) * (2 * self.radius + self.gap),
            },
        )
        if not self.spread < 1:
            raise ValueError(f"SpheresInABox: spread must be < 1, not {self.spread}")
        if not self.offset <= 0.5 * self.gap:
            raise ValueError(
                f"SpheresInABox: offset must be at most gap / 2 = {0.5 * self.gap:g}, not"
                f" {self.offset}"
            )

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the radii, and the places in their cells."""
        random = np.random.Generator(np.random.PCG64(seed))
        # a random row for each sphere, all drawn at once: more spheres begin like fewer
        draws = random.uniform(size=(self.spheres, 4))
        radii = self.radius * (1 - self.spread * draws[:, 0])
        pitch = 2 * self.radius + self.gap
        side = self.across or math.floor(self.width / pitch)
        friction = mjcf.surface(self.mu)
        bodies = mjcf.walls(0.5 * self.width, self.width, self.mu)
        for i, radius in enumerate(radii.tolist()):
            layer, cell = divmod(i, side * side)
            # somewhere in the cell, without touching its faces
            room = self.radius - radius + self.offset
            x, y = pitch * (np.array(divmod(cell, side)) - 0.5 * (side - 1))
            z = self.lift + pitch * (layer + 0.5)
            place = np.array([x, y, z]) + room * (2 * draws[i, 1:] - 1)
            bodies.append(mjcf.sphere(i, self.spheres, place, radius, self.density, friction))
        return Scene.of_bodies(self, seed, bodies=bodies, tile=0.25 * self.width)
