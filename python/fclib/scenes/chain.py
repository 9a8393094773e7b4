"""A hanging chain: few bodies, each with its neighbours in rolling and sliding contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter

Vector: TypeAlias = npt.NDArray[np.float64]

OVERLAP: Final = 1e-6  # [m], at the start: the law on velocities keeps such joints closed


@dataclass(frozen=True, kw_only=True)
class Chain(Published):
    """Links that hang one in another, the first one held, the lower end set in motion.

    A link is a loop of straight rods, all links alike: two sides, and two ends that follow a half
    circle. If the number of an end's rods is even, the neighbour may find its place in the
    corner of two; four contacts if both are even, close to each other and most of them
    redundant. At the start the links touch beside these corners, each in one point, but for the
    lowest ones, which fall. Problems count from `begin` on, when no joint above them is open.

    After the family Chain of V. Acary, M. Bremond, T. Koziara and F. Perignon, FCLIB: a collection
    of discrete 3D Frictional Contact problems, Inria report RT-0444, 2014. The number of links,
    length, thickness, mass, friction and the speed of the tip are its own; the width of a link,
    the rods of its ends, their places and the gaps are chosen here, such that sizes and numbers of
    contacts are those of the report.
    """

    title: ClassVar[str] = "Hanging chain"
    description: ClassVar[str] = (
        "Links of rods hanging one in another, the first one held, the lower end set in motion."
    )
    application: ClassVar[str] = "multibody systems"
    authors: ClassVar[str] = "V. Acary, M. Bremond, T. Koziara, F. Perignon"
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
    offset: float = parameter(2e-3, "m", "largest distance of a link from the middle of its joint")
    loose: int = parameter(2, "1", "links at the lower end that fall at the start")
    gap: float = parameter(5e-3, "m", "clearance of these at the start")
    rods_above: int = parameter(6, "1", "rods of a link's upper end, at least 1")
    rods_below: int = parameter(6, "1", "rods of a link's lower end, at least 1")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(2.5e-4, "s", "time step h")
    begin: float = parameter(7.5e-3, "s", "when the first problem is")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("length", "thickness", "mass", "time_step"),
            non_negative=("mu", "offset", "gap", "begin"),
            at_least={
                "links": 2,
                "loose": 0,
                "rods_above": 1,
                "rods_below": 1,
                "width": 4 * self.thickness,
            },
        )
        if not self.length > 2 * self.links * self.width:
            raise ValueError(
                f"Chain: length must be above {2 * self.links * self.width:g}, not {self.length}"
            )

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the offsets, and the gaps between a half and the whole."""
        random = np.random.Generator(np.random.PCG64(seed))
        draws = random.uniform(-1.0, 1.0, size=(self.links - 1, 3))
        # a link that is further out lies against the side of its neighbour
        side = 0.5 * (self.width - self.thickness) - self.thickness + OVERLAP
        offsets = np.clip(self.offset * draws[:, :2], -side, side)
        gaps = self.gap * (0.75 + 0.25 * draws[:, 2])

        # clear length of a link: all links together, without gaps, have the length asked for
        pitch = (self.length - 2 * self.thickness) / self.links

        # the first joint is the pivot; the tip's speed is that of a rigid rotation about it
        pivot = -0.5 * pitch
        spin = -self.tip_speed / (self.links * pitch)
        links = []
        velocities = []
        x = y = z = 0.0
        for i in range(self.links):
            turn = 0.5 * math.pi * (i % 2)
            links.append(
                f'<body name="link{i}" pos="{mjcf.numbers(x, y, z)}"'
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
                x, y = x + offsets[i, 0], y + offsets[i, 1]
                # links of even number lie in the plane x, z
                along, across = offsets[i] if i % 2 == 0 else offsets[i, ::-1]
                z += self._height(pitch, along, across)
                if i >= self.links - 1 - self.loose:
                    z += gaps[i]
        return Scene.of_bodies(
            self,
            seed,
            bodies=links,
            floor_z=-self.length,
            tile=0.1 * self.length,
            velocity=velocities,
            # a link in the middle with its two joints: the whole chain would be a hair
            focus=(0.0, 0.0, -(self.links // 2) * pitch, 0.3 * pitch),
            view=(125.0, -60.0),
        )

    def _ends(self, pitch: float) -> tuple[Vector, Vector]:
        """The corners of a link's upper and lower end (k x 2), x and z around its middle."""
        radius = 0.5 * (self.width - self.thickness)
        ends = []
        for start, count in ((0.0, self.rods_above), (math.pi, self.rods_below)):
            angles = np.linspace(start, start + math.pi, count + 1)
            arc = radius * np.column_stack((np.cos(angles), np.sin(angles)))
            # the outermost point of the axes lies half a rod beyond the clear length
            reach = np.abs(arc[:, 1]).max()
            arc[:, 1] += math.copysign(0.5 * (pitch + self.thickness) - reach, math.pi / 2 - start)
            ends.append(arc)
        return ends[0], ends[1]

    def _height(self, pitch: float, along: float, across: float) -> float:
        """The height of the next link's middle relative to this one's if they just touch (< 0) [m].

        The next link lies `along` the ends of this one, beside its middle, and this one lies
        `across` beside the middle of the next. Of two rods with the slopes a and b, seen from above
        at a right angle, the axes are D sqrt(1 + a^2 + b^2) apart along the vertical if the
        distance is D. Each end is the envelope of its rods.
        """
        above, below = self._ends(pitch)
        a, lower = lines(below, along)
        b, upper = lines(above, across)
        apart = (self.thickness - OVERLAP) * np.sqrt(1 + a[:, None] ** 2 + b**2)
        return float((lower[:, None] + apart - upper).max())

    def _rods(self, pitch: float, link: int) -> list[str]:
        """The rods of a link of some clear length, around its middle; mass is spread by length."""
        corners = np.vstack(self._ends(pitch))
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


def lines(corners: Vector, place: float) -> tuple[Vector, Vector]:
    """The slopes of the lines through corners that follow (k + 1 x 2), and their heights there."""
    run, rise = np.diff(corners, axis=0).T
    slope: Vector = rise / run
    return slope, corners[:-1, 1] + slope * (place - corners[:-1, 0])
