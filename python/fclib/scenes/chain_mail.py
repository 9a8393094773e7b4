"""A net of rings that hang in each other, held at its edge, into which a ball falls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class ChainMail(Published):
    """Flat rings in rows and columns, each two neighbours joined by an upright ring; a ball on it.

    The outer rings are fast. A ball falls onto the net, which sags until its rings are taut.

    Why it is here: it has no joint; contacts alone hold it together, one to three for each pair of
    rings. Long chains of contacts carry the weight of the ball to the edge. There the forces are a
    few times larger than in the flat part of the net. So a small error far inside becomes a large
    one at the edge, and local methods need many sweeps.
    """

    title: ClassVar[str] = "Net of rings"
    description: ClassVar[str] = "Chain mail held at its edge, and a ball that falls into it."
    application: ClassVar[str] = "multibody systems"
    collection: ClassVar[str] = "machines"
    problems: ClassVar[int] = 600

    across: int = parameter(6, "1", "flat rings of a row and of a column, the fast ones too, >= 3")
    spacing: float = parameter(0.05, "m", "from a flat ring to the next one")
    wire: float = parameter(2.5e-3, "m", "radius of the wire")
    rods: int = parameter(8, "1", "straight rods of a ring, at least 5")
    density: float = parameter(7800.0, "kg/m^3", "mass density of the rings")
    ball: float = parameter(0.06, "m", "radius of the ball; 0: there is none")
    mass: float = parameter(2.0, "kg", "mass of the ball")
    drop: float = parameter(0.02, "m", "gap between net and ball at the start")
    mu: float = parameter(0.3, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "0: the law of gaps is inelastic")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(5e-4, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("spacing", "wire", "density", "mass", "time_step"),
            non_negative=("mu", "ball", "drop"),
            at_least={"across": 3, "rods": 5},
        )
        if self.restitution:
            raise ValueError(f"ChainMail: restitution must be 0, not {self.restitution}")
        if not self.wire <= 0.05 * self.spacing:
            bound = 0.05 * self.spacing
            raise ValueError(f"ChainMail: wire must be at most {bound:g}, not {self.wire}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws how the rings are turned, and the place of the ball."""
        random = np.random.Generator(np.random.PCG64(seed))
        flat, upright = 0.4 * self.spacing, 0.27 * self.spacing
        middle = 0.5 * (self.across - 1)
        bodies: list[str] = []
        last = self.across - 1
        count = self.across**2 + 2 * self.across * last
        for i in range(self.across):
            for j in range(self.across):
                place = (self.spacing * (i - middle), self.spacing * (j - middle), 0.0)
                fast = i in (0, last) or j in (0, last)
                turn = (0.0, 0.0, float(random.uniform()) * math.pi)
                bodies.append(self._ring(len(bodies), count, place, flat, turn, fast))
        for i in range(self.across):
            for j in range(self.across):
                for along in (0, 1):
                    fast = (j if along == 0 else i) in (0, last)
                    # between two fast rings there is none
                    if (i, j)[along] == last or fast:
                        continue
                    place = (
                        self.spacing * (i - middle + (0.5 if along == 0 else 0.0)),
                        self.spacing * (j - middle + (0.5 if along else 0.0)),
                        0.0,
                    )
                    turn = (0.5 * math.pi, 0.5 * math.pi * along, 0.0)
                    # upright, in the plane through the two rings that it joins
                    bodies.append(self._ring(len(bodies), count, place, upright, turn, False))
        if self.ball:
            shift = 0.25 * self.spacing * random.uniform(-1, 1, size=2)
            high = self.ball + upright + self.wire + self.drop
            shape = f'type="sphere" size="{self.ball!r}" mass="{self.mass!r}"'
            bodies.append(
                mjcf.grain("ball", (*shift, high), shape, mjcf.surface(self.mu), "0.62 0.3 0.2 1")
            )
        low = -self.spacing * self.across
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            floor_z=low,
            tile=self.spacing,
            law="gap",
            focus=(0.0, 0.0, 0.0, 0.65 * self.spacing * self.across),
        )

    def _ring(
        self,
        index: int,
        count: int,
        place: tuple[float, float, float],
        radius: float,
        turn: tuple[float, float, float],
        fast: bool,
    ) -> str:
        """A ring in the plane of its own x and y, a free body or fast."""
        angles = 2 * math.pi * np.arange(self.rods + 1) / self.rods
        x, y = radius * np.cos(angles), radius * np.sin(angles)
        colour = "0.45 0.47 0.5 1" if fast else mjcf.shade(index, count)
        rods = "".join(
            f'<geom type="capsule" size="{self.wire!r}" density="{self.density!r}"'
            f' fromto="{mjcf.numbers(x[k], y[k], 0, x[k + 1], y[k + 1], 0)}"'
            f' {mjcf.surface(self.mu)} material="solid" rgba="{colour}"/>'
            for k in range(self.rods)
        )
        joint = "" if fast else "<freejoint/>"
        return (
            f'<body name="ring{index}" pos="{mjcf.numbers(*place)}"'
            f' euler="{mjcf.numbers(*turn)}">{joint}{rods}</body>'
        )
