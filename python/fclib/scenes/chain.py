"""A hanging chain: few bodies, each with its neighbours in rolling and sliding contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Scene, parameter


@dataclass(frozen=True, kw_only=True)
class Chain:
    """Links that hang one in another, the first one held, the lower end set in motion.

    A link is a loop of straight rods: two sides, and two ends that follow a half circle. Where the
    number of an end's rods is odd, the neighbour rests on the middle of one; where it is even, in
    the corner of two. With `rods_above` odd and one rod more on every second link, a joint has two
    and four contacts in turn, close to each other: most of them redundant. Small gaps at the start
    make the links fall into each other one by one.

    After the family Chain of V. Acary, M. Bremond, T. Koziara and F. Perignon, FCLIB: a collection
    of discrete 3D Frictional Contact problems, Inria report RT-0444, 2014. The number of links,
    length, thickness, mass, friction and the speed of the tip are its own; the width of a link,
    the rods of its ends and the gaps are chosen here.
    """

    title: ClassVar[str] = "Hanging chain"
    description: ClassVar[str] = (
        "Links of rods hanging one in another, the first one held, the lower end set in motion."
    )
    application: ClassVar[str] = "multibody systems"
    authors: ClassVar[str] = "V. Acary, M. Bremond, T. Koziara, F. Perignon"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "rt444"
    problems: ClassVar[int] = 1514

    links: int = parameter(11, "1", "number of links, the held one among them, at least 2")
    length: float = parameter(13.7, "m", "length of the chain")
    thickness: float = parameter(7.6e-3, "m", "diameter of the rods")
    width: float = parameter(0.06, "m", "outer width of a link")
    mass: float = parameter(1.0, "kg", "mass of a link")
    mu: float = parameter(0.3, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    tip_speed: float = parameter(0.05, "m/s", "speed of the lower end at the start, along x")
    gap: float = parameter(0.05, "m", "clearance of two links at the start")
    rods_above: int = parameter(5, "1", "rods of a link's upper end, at least 1")
    rods_below: int = parameter(6, "1", "rods of a link's lower end, at least 1")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(5e-4, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("length", "thickness", "mass", "time_step"),
            non_negative=("mu", "gap"),
            at_least={"links": 2, "rods_above": 1, "rods_below": 1, "width": 4 * self.thickness},
        )
        if not self.length > 2 * self.links * self.width:
            raise ValueError(
                f"Chain: length must be above {2 * self.links * self.width:g}, not {self.length}"
            )

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the gaps between a half and the whole of `gap`."""
        random = np.random.Generator(np.random.PCG64(seed))
        gaps = self.gap * random.uniform(0.5, 1.0, size=self.links - 1)

        # clear length of a link: all links together, without gaps, have the length asked for
        pitch = (self.length - 2 * self.thickness) / self.links

        # the first joint is the pivot; the tip's speed is that of a rigid rotation about it
        pivot = -0.5 * pitch
        spin = -self.tip_speed / (self.links * pitch)
        links = []
        velocities = []
        z = 0.0
        for i in range(self.links):
            turn = 0.5 * math.pi * (i % 2)
            links.append(
                f'<body name="link{i}" pos="{mjcf.numbers(0, 0, z)}"'
                f' euler="{mjcf.numbers(0, 0, turn)}">'
                + ("<freejoint/>" if i else "")
                + "".join(self._rods(pitch, i))
                + "</body>"
            )
            if i:
                # MuJoCo takes the angular velocity of a free body in its own axes
                velocities += [spin * (z - pivot), 0, 0]
                velocities += [spin * math.sin(turn), spin * math.cos(turn), 0]
            if i < self.links - 1:
                z -= pitch - gaps[i]
        return Scene.of(
            self,
            seed,
            mjcf.document(
                "Chain",
                bodies=links,
                time_step=self.time_step,
                gravity=self.gravity,
                floor_mu=self.mu,
                floor_z=-self.length,
                tile=0.1 * self.length,
                velocity=velocities,
            ),
            # the joint in the middle: the whole chain would be a hair
            focus=(0.0, 0.0, -(self.links // 2 - 0.5) * pitch, 2.5 * self.width),
        )

    def _rods(self, pitch: float, link: int) -> list[str]:
        """The rods of a link of some clear length, around its middle; mass is spread by length."""
        radius = 0.5 * (self.width - self.thickness)
        ends = []
        for start, count in (
            (0.0, self.rods_above + (link + 1) % 2),
            (math.pi, self.rods_below),
        ):
            angles = np.linspace(start, start + math.pi, count + 1)
            arc = radius * np.column_stack((np.cos(angles), np.sin(angles)))
            # the outermost point of the axes lies half a rod beyond the clear length
            reach = np.abs(arc[:, 1]).max()
            arc[:, 1] += math.copysign(0.5 * (pitch + self.thickness) - reach, math.pi / 2 - start)
            ends.append(arc)
        corners = np.vstack(ends)
        following = np.roll(corners, -1, axis=0)
        lengths = np.linalg.norm(following - corners, axis=1)
        masses = self.mass * lengths / lengths.sum()
        return [
            f'<geom type="capsule" size="{0.5 * self.thickness!r}"'
            f' fromto="{mjcf.numbers(x, 0, z, x2, 0, z2)}" mass="{mass.item()!r}"'
            f' friction="{self.mu!r}" condim="3" material="solid"'
            f' rgba="{mjcf.shade(link, self.links)}"/>'
            for (x, z), (x2, z2), mass in zip(corners, following, masses, strict=True)
        ]
