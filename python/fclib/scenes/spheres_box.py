"""Equal spheres in a box, pressed by a wall that moves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class SpheresBox(Published):
    """Equal spheres in layers, a little disturbed, under a heavy lid that slides down.

    The columns buckle under the lid, and the lattice gives way to denser packings. The law of gaps
    takes every contact within a step's reach, as LMGC90 does, open ones too.

    After the set 945_SP_Box_PL of the FCLIB library: 945 spheres, mu = 0.8, by LMGC90. Its box is
    not documented; the lattice of 9 x 7 x 15 places and the lid are chosen here.
    """

    title: ClassVar[str] = "Spheres in a box under a lid"
    description: ClassVar[str] = "Equal spheres in a box, pressed by a wall that moves down."
    application: ClassVar[str] = "granular matter"
    authors: ClassVar[str] = "V. Acary, the developers of LMGC90"
    collection: ClassVar[str] = "granular"
    problems: ClassVar[int] = 32
    # parameters of a small scene, which is simulated quickly
    small: ClassVar[Mapping[str, Any]] = {"spheres": 36, "along_x": 4, "along_y": 3}

    spheres: int = parameter(945, "1", "number of spheres, at least 1")
    along_x: int = parameter(9, "1", "spheres of a layer along x, at least 1")
    along_y: int = parameter(7, "1", "spheres of a layer along y, at least 1")
    radius: float = parameter(1.0, "m", "radius of a sphere")
    density: float = parameter(2500.0, "kg/m^3", "mass density")
    mu: float = parameter(0.8, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "0: the law of gaps is inelastic")
    offset: float = parameter(0.05, "1", "largest offset to a side, in radii, at most 0.2")
    gap: float = parameter(2e-3, "m", "between two layers, at the start")
    load: float = parameter(0.2, "1", "mass of the lid, for that of all spheres")
    margin: float = parameter(0.0, "m", "a gap up to this is a contact too")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(0.02, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("radius", "density", "load", "time_step"),
            non_negative=("mu", "offset", "gap", "margin"),
            at_least={"spheres": 1, "along_x": 1, "along_y": 1},
        )
        if not self.offset <= 0.2:
            raise ValueError(f"SpheresBox: offset must be <= 0.2, not {self.offset}")
        if self.restitution:
            raise ValueError(f"SpheresBox: restitution must be 0, not {self.restitution}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the offsets."""
        random = np.random.Generator(np.random.PCG64(seed))
        draws = random.uniform(-self.offset, self.offset, size=(self.spheres, 2))
        friction = mjcf.surface(self.mu)
        pitch, rise = 2 * (1 + self.offset) * self.radius, 2 * self.radius + self.gap
        sides = np.array([self.along_x, self.along_y])
        bodies = []
        for i, draw in enumerate(draws):
            layer, cell = divmod(i, self.along_x * self.along_y)
            place = pitch * (np.array(divmod(cell, self.along_y)) - 0.5 * (sides - 1))
            place += self.radius * draw
            place = np.append(place, (layer + 0.5) * rise)
            bodies.append(mjcf.sphere(i, self.spheres, place, self.radius, self.density, friction))
        layers = -(-self.spheres // (self.along_x * self.along_y))
        x, y = (0.5 * pitch * sides).tolist()
        height, half = rise * layers, 0.5 * self.radius
        mass = self.load * self.spheres * self.density * 4 / 3 * math.pi * self.radius**3
        bodies.append(
            f'<body name="lid" pos="{mjcf.numbers(0, 0, height + half)}">'
            '<joint type="slide" axis="0 0 1"/>'
            f'<geom type="box" size="{mjcf.numbers(x, y, half)}" mass="{mass!r}" {friction}'
            ' material="solid" rgba="0.45 0.47 0.5 1"/></body>'
        )
        bodies += mjcf.walls((x, y), height, self.mu)
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            tile=4 * self.radius,
            rest=mjcf.margins(self.margin),
            law="gap",
        )
