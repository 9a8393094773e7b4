"""A rope over a fixed drum, a long chain of links in contact; one end hangs lower."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class Rope(Published):
    """Capsules linked by hinges, laid around the upper half of a drum, in the plane.

    Its own weight counts: with B = 2 mu / (1 + mu^2) times the weight of a rope as long as the
    drum's radius, it holds while T_long < exp(mu pi) (T_short + B) + B (Euler and Eytelwein, for a
    rope without weight B = 0). The links are one tree, hence M is full.
    """

    title: ClassVar[str] = "Rope over a drum"
    description: ClassVar[str] = "A rope of many links over a rough drum, in the plane."
    application: ClassVar[str] = "multibody systems"
    authors: ClassVar[str] = "the authors of FCLIB, after L. Euler and J. A. Eytelwein"
    collection: ClassVar[str] = "dynamics"
    problems: ClassVar[int] = 120

    over: int = parameter(24, "1", "links on the drum, at least 4")
    short: int = parameter(10, "1", "links of the shorter end, at least 1")
    long: int = parameter(40, "1", "links of the longer end, at least 1")
    drum: float = parameter(0.5, "m", "radius of the drum")
    thickness: float = parameter(0.02, "m", "radius of the rope")
    density: float = parameter(1000.0, "kg/m^3", "mass density")
    mu: float = parameter(0.3, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(2e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("drum", "thickness", "density", "time_step"),
            non_negative=("mu",),
            at_least={"over": 4, "short": 1, "long": 1},
        )

    @property
    def limit(self) -> float:
        """Links of the longer end from which on the rope slides."""
        half_angle = 0.5 * math.pi / self.over
        radius = 0.5 / math.tan(half_angle)  # of the links' middles, in links
        own = 2 * self.mu / (1 + self.mu**2) * radius
        return math.exp(math.pi * self.mu) * (self.short + own) + own

    def scene(self, seed: int = 0) -> Scene:
        """The scene; nothing of it is random."""
        # links are chords about the drum: their ends are farther out than their middles
        half_angle = 0.5 * math.pi / self.over
        reach = (self.drum + self.thickness - 1e-6) / math.cos(half_angle)
        link = 2 * reach * math.sin(half_angle)
        count = self.short + self.over + self.long
        height = link * max(self.short, self.long) + 2 * self.thickness
        # direction of each link in the plane, from straight up over the drum to straight down
        angles = [0.5 * math.pi] * self.short
        angles += [0.5 * math.pi - (2 * i + 1) * half_angle for i in range(self.over)]
        angles += [-0.5 * math.pi] * self.long
        text = ""
        previous = 0.0
        for i, angle in enumerate(angles):
            # about y, positive turns x towards -z
            turn = -(angle - previous)
            joints = mjcf.IN_PLANE if i == 0 else '<joint axis="0 1 0"/>'
            place = (-reach, 0, height - link * self.short) if i == 0 else (link, 0, 0)
            text += (
                f'<body name="link{i}" pos="{mjcf.numbers(*place)}"'
                f' euler="{mjcf.numbers(0, turn, 0)}">{joints}'
                f'<geom type="capsule" size="{self.thickness!r}"'
                f' fromto="{mjcf.numbers(0, 0, 0, link, 0, 0)}" density="{self.density!r}"'
                f' contype="2" conaffinity="1" {mjcf.surface(self.mu)} material="solid"'
                f' rgba="{mjcf.shade(i, count)}"/>'
            )
            previous = angle
        text += "</body>" * count
        # links touch the drum and the ground, not each other
        drum = (
            f'<geom name="drum" type="sphere" size="{self.drum!r}"'
            f' pos="{mjcf.numbers(0, 0, height)}" {mjcf.surface(self.mu)}'
            ' material="solid" rgba="0.5 0.5 0.5 1"/>'
        )
        return Scene.of_bodies(
            self, seed, bodies=[drum, text], floor_z=-height, tile=self.drum, planar=True
        )
