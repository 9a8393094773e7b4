"""Necklaces: chains closed into loops that fall over a bar, on each other and on the floor."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class ClosedChains(Published):
    """Chains of rods with ball joints, each closed into a loop, dropped over a bar one by one.

    A loop is a tree of joints in minimal coordinates, closed by a bilateral constraint of three
    rows: M is dense in each loop, and the loops that touch are coupled by contacts. They hang
    over the bar and over each other; with a larger `offset` they slide off to the floor. Without
    restitution the law is the one on gaps: contacts within reach are in the problem whether they
    close or not.
    """

    title: ClassVar[str] = "Closed chains"
    description: ClassVar[str] = (
        "Chains of rods closed into loops, falling over a bar, on each other and on a floor."
    )
    application: ClassVar[str] = "mechanisms, multibody systems"
    collection: ClassVar[str] = "mixed"
    problems: ClassVar[int] = 500

    chains: int = parameter(5, "1", "number of chains, at least 1")
    links: int = parameter(10, "1", "rods of a chain, at least 3")
    length: float = parameter(0.15, "m", "length of a rod, joint to joint")
    radius: float = parameter(0.015, "m", "radius of a rod")
    gap: float = parameter(0.04, "m", "height of a chain above the one below it at the start")
    offset: float = parameter(0.05, "m", "largest offset of a chain along x and along y")
    tilt: float = parameter(0.1, "rad", "largest rotation of a chain about x and about y")
    damping: float = parameter(2e-3, "N m s/rad", "of a joint")
    density: float = parameter(1000.0, "kg/m^3", "mass density of the rods")
    mu: float = parameter(0.5, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(2e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("length", "radius", "gap", "density", "time_step"),
            non_negative=("mu", "offset", "tilt", "damping"),
            at_least={"chains": 1, "links": 3},
        )

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws offsets and rotations of the chains."""
        random = np.random.Generator(np.random.PCG64(seed))
        draws = random.uniform(-1.0, 1.0, size=(self.chains, 5))
        # the circle through the joints of a regular polygon
        circle = 0.5 * self.length / math.sin(math.pi / self.links)
        height = 0.8 * circle + 0.5 * self.length
        ends = mjcf.numbers(0, -1.3 * circle, height, 0, 1.3 * circle, height)
        bar = 2 * self.radius
        bodies = [
            f'<geom name="bar" type="capsule" size="{bar!r}" fromto="{ends}" condim="3"'
            f' friction="{self.mu!r}" material="solid" rgba="0.45 0.47 0.5 1"/>'
        ]
        rest = []
        # the lowest lies on the bar, its joints at rest
        draws[:1, 2:4] = 0
        z = height + bar + self.radius - 1e-3 * self.radius
        for i, (x, y, roll, pitch, yaw) in enumerate(draws.tolist()):
            if i:
                # room for the tilt
                z += self.gap + 2 * self.tilt * circle
            turn = (self.tilt * roll, self.tilt * pitch, math.pi / self.links * yaw)
            # the middle of the first rod, seen from the middle of the polygon
            middle = turn[2] - 0.5 * math.pi
            apothem, half = circle * math.cos(math.pi / self.links), 0.5 * self.length
            place = (
                self.offset * x + apothem * math.cos(middle) - half * math.cos(turn[2]),
                self.offset * y + apothem * math.sin(middle) - half * math.sin(turn[2]),
                z,
            )
            bodies.append(self._chain(i, place, turn))
            last = self.links - 1
            rest += [
                f'<equality><connect body1="link{i}.{last}" body2="link{i}.0"'
                f' anchor="{mjcf.numbers(self.length, 0, 0)}"/></equality>',
                f'<contact><exclude body1="link{i}.{last}" body2="link{i}.0"/></contact>',
            ]
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            tile=self.length,
            rest=rest,
            # ends of rods are fast: nothing is to be passed through
            law="velocity" if self.restitution else "gap",
        )

    def _chain(
        self, chain: int, place: tuple[float, float, float], turn: tuple[float, float, float]
    ) -> str:
        """A regular polygon that begins at a place, turned by angles about x, y and z."""
        bend = 2 * math.pi / self.links
        inner = ""
        for k in reversed(range(self.links)):
            where = (
                f'pos="{mjcf.numbers(*place)}" euler="{mjcf.numbers(*turn)}"'
                if k == 0
                else f'pos="{mjcf.numbers(self.length, 0, 0)}" euler="{mjcf.numbers(0, 0, bend)}"'
            )
            joint = "<freejoint/>" if k == 0 else f'<joint type="ball" damping="{self.damping!r}"/>'
            # rods end before the joint: round ends of two links meet there
            inner = (
                f'<body name="link{chain}.{k}" {where}>{joint}'
                f'<geom type="capsule" size="{self.radius!r}"'
                f' fromto="{mjcf.numbers(0, 0, 0, self.length, 0, 0)}" condim="3"'
                f' friction="{self.mu!r}" density="{self.density!r}" material="solid"'
                f' rgba="{mjcf.shade(chain, self.chains)}"/>{inner}</body>'
            )
        return inner
