"""Capsules dropped into a box: a random heap of round and slender bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class Capsules(Published):
    """Equal capsules, layer above layer, that fall into an open box.

    They start on a grid wide enough that they do not touch, in random directions near the
    horizontal, and with a small random velocity.

    After the family Capsules of V. Acary, M. Bremond, T. Koziara and F. Perignon, FCLIB: a
    collection of discrete 3D Frictional Contact problems, Inria report RT-0444, 2014. Number,
    sizes, masses and friction are its own; the box and the positions at the start are chosen here.
    The stored problems of `rt444` are not of this scene but of the authors' own, which Siconos
    stepped: the capsules start above each other, and drop into the middle of a wide box.
    """

    title: ClassVar[str] = "Capsules in a box"
    description: ClassVar[str] = "Equal capsules dropped into an open box, under gravity."
    application: ClassVar[str] = "granular matter"
    authors: ClassVar[str] = "V. Acary, M. Bremond, T. Koziara, F. Perignon"
    collection: ClassVar[str] = "rt444"
    problems: ClassVar[int] = 1705

    capsules: int = parameter(100, "1", "number of capsules, at least 1")
    length: float = parameter(5.0, "m", "length of a capsule, caps included")
    radius: float = parameter(1.0, "m", "radius of a capsule")
    mass: float = parameter(1.0, "kg", "mass of a capsule")
    mu: float = parameter(0.7, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    tilt: float = parameter(0.2, "rad", "largest slope of a capsule at the start")
    gap: float = parameter(0.05, "m", "clearance of two layers at the start")
    width: float = parameter(20.0, "m", "inner edge of the box, a square")
    speed: float = parameter(1.0, "m/s", "largest component of a velocity at the start")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(2.5e-3, "s", "time step h")
    activation: float = parameter(1e-3, "m", "gap of an end that counts as closed")
    gaps: bool = parameter(
        False, "1", "law of gaps: every contact within a step's reach, open ones too"
    )
    margin: float = parameter(0.0, "m", "with the law of gaps: a gap up to this is a contact too")
    gyroscopic: bool = parameter(
        False, "1", "whether M has the derivative of gyroscopic terms, and W is not symmetric"
    )

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("length", "radius", "mass", "width", "time_step"),
            non_negative=("mu", "activation", "tilt", "gap", "speed", "margin"),
            at_least={"capsules": 1},
        )
        if not self.length > 2 * self.radius:
            raise ValueError(f"Capsules: length must be above {2 * self.radius}, not {self.length}")
        if self.gaps and (self.restitution or self.activation):
            raise ValueError("Capsules: by the law of gaps, restitution and activation must be 0")
        if not self.width >= self.length:
            raise ValueError(f"Capsules: width must be at least {self.length}, not {self.width}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the directions and the velocities."""
        random = np.random.Generator(np.random.PCG64(seed))
        # a random row for each capsule, all drawn at once: more capsules begin like fewer
        draws = random.uniform(-1.0, 1.0, size=(self.capsules, 5))
        heading, rise = math.pi * draws[:, 0], self.tilt * draws[:, 1]
        directions = np.column_stack(
            (np.cos(rise) * np.cos(heading), np.cos(rise) * np.sin(heading), np.sin(rise))
        )
        velocities = self.speed * draws[:, 2:]

        side = int(self.width // self.length)
        half = 0.5 * self.length - self.radius
        height = 2 * (self.radius + half * math.sin(self.tilt)) + self.gap
        cells = (np.arange(side) - 0.5 * (side - 1)) * self.width / side
        bodies = []
        for i, axis in enumerate(directions):
            layer, cell = divmod(i, side * side)
            x, y, z = cells[cell % side], cells[cell // side], (layer + 0.5) * height
            ends = mjcf.numbers(*(-half * axis), *(half * axis))
            bodies.append(
                f'<body name="capsule{i}" pos="{mjcf.numbers(x, y, z)}"><freejoint/>'
                f'<geom type="capsule" size="{self.radius!r}" fromto="{ends}"'
                f' mass="{self.mass!r}" friction="{self.mu!r}" condim="3" material="solid"'
                f' rgba="{mjcf.shade(i, self.capsules)}"/></body>'
            )
        bodies += mjcf.walls(0.5 * self.width, self.width, self.mu)
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            tile=0.25 * self.width,
            velocity=np.column_stack((velocities, np.zeros_like(velocities))).ravel(),
            rest=mjcf.margins(self.margin),
            law="gap" if self.gaps else "velocity",
        )
