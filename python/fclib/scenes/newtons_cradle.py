"""Balls in a row that hang touching each other, struck by one of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class NewtonsCradle(Published):
    """Equal balls on rods, each on a hinge of its own; the first ones swing into the others.

    With a gap between the balls impacts come one after the other, and with e = 1 as many balls
    leave as came in. Without a gap all impacts are simultaneous, and Newton's law differs from real
    balls: all balls that were at rest leave together, each at 2/n of the speed, and the ball that
    struck comes back at (n - 2)/n.
    """

    title: ClassVar[str] = "Newton cradle"
    description: ClassVar[str] = "Hanging balls in a row, struck by some of them; restitution 1."
    application: ClassVar[str] = "impacts"
    collection: ClassVar[str] = "impacts"
    problems: ClassVar[int] = 60

    balls: int = parameter(7, "1", "number of balls, at least 2")
    struck: int = parameter(1, "1", "how many swing in, at least 1")
    radius: float = parameter(0.05, "m", "radius of a ball")
    length: float = parameter(0.6, "m", "of a rod, from the hinge to the ball's centre")
    gap: float = parameter(0.0, "m", "between two balls at rest")
    speed: float = parameter(0.5, "m/s", "of those that swing in, at the start")
    density: float = parameter(7800.0, "kg/m^3", "mass density")
    mu: float = parameter(0.2, "1", "coefficient of friction")
    restitution: float = parameter(1.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(2e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("radius", "length", "density", "time_step"),
            non_negative=("mu", "gap", "speed"),
            at_least={"balls": 2, "struck": 1},
        )
        if self.struck >= self.balls:
            raise ValueError(f"NewtonsCradle: struck must be < {self.balls}, not {self.struck}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; nothing of it is random."""
        pitch = 2 * self.radius + self.gap
        height = 1.5 * self.length
        bodies = []
        for i in range(self.balls):
            x = pitch * (i - 0.5 * (self.balls - 1))
            # a rigid pendulum: the ball does not turn on its rod
            bodies.append(
                f'<body name="ball{i}" pos="{mjcf.numbers(x, 0, height)}">'
                '<joint type="hinge" axis="0 1 0"/>'
                f'<geom type="sphere" size="{self.radius!r}" density="{self.density!r}"'
                f' pos="{mjcf.numbers(0, 0, -self.length)}" {mjcf.surface(self.mu)}'
                f' material="solid" rgba="{mjcf.shade(i, self.balls)}"/>'
                + mjcf.bar((0, 0, 0), (0, 0, -self.length), 0.05 * self.radius)
                + "</body>"
            )
        # forwards is about -y
        swing = [-self.speed / self.length * (i < self.struck) for i in range(self.balls)]
        return Scene.of_bodies(self, seed, bodies=bodies, tile=4 * self.radius, velocity=swing)
