"""Stones laid without mortar, as MJCF: prisms of any convex outline, and supports that move.

Every stone is a mesh: two flat faces touch in the corners of their overlap, also when the joint
opens about an edge, where the box primitive would change its points.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from fclib.scenes import _mjcf

Point = tuple[float, float]  # x, z [m]

YIELD = 1e-3  # a driven support loses this share of its speed under the weight of all stones


@dataclass(kw_only=True)
class Masonry:
    """The stones of a scene, gathered one by one.

    Each stone is grown by half the `lap` on all sides, so that all joints are closed from the
    start: the law on velocities keeps a penetration as it is. The `arris` is cut off the edges
    along y, so that stones that meet in an edge only do not touch.
    """

    density: float  # [kg/m^3]
    mu: float  # [1]
    lap: float  # [m]
    arris: float = 0.0  # [m]
    mass: float = 0.0  # of all free stones [kg]
    assets: list[str] = field(default_factory=list)
    bodies: list[str] = field(default_factory=list)
    rest: list[str] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)  # of the driven supports [m/s]

    def stone(
        self, name: str, outline: Sequence[Point], front: float, back: float, colour: str
    ) -> None:
        """Lay a free stone: its outline (x, z) counterclockwise, from y = front to y = back [m]."""
        self.mass += self.density * area(outline) * (back - front)
        self._body(name, outline, front, back, colour, "<freejoint/>")

    def support(
        self,
        name: str,
        outline: Sequence[Point],
        front: float,
        back: float,
        *,
        axis: tuple[float, float, float] = (0.0, 0.0, -1.0),
        speed: float = 0.0,
    ) -> None:
        """Set a support: fixed, or driven along an axis at a speed [m/s]; it never meets the floor.

        To be set after the stones, whose weight says how strong the drive must be.
        """
        if not speed:
            self._body(name, outline, front, back, SUPPORT, "")
            return
        joint = f'<joint name="{name}" type="slide" axis="{_mjcf.numbers(*axis)}"/>'
        self._body(name, outline, front, back, SUPPORT, joint)
        # at 10 m/s^2
        gain = self.mass * 10.0 / (YIELD * abs(speed))
        self.rest += [
            f'<contact><exclude body1="world" body2="{name}"/></contact>',
            f'<actuator><velocity joint="{name}" kv="{gain!r}"/></actuator>',
        ]
        self.speeds.append(speed)

    def keyframe(self, velocity: Sequence[float] = ()) -> list[str]:
        """The start: the speeds of the drives, and velocities (n) if any."""
        words = [f'ctrl="{_mjcf.numbers(*self.speeds)}"'] if self.speeds else []
        words += [f'qvel="{_mjcf.numbers(*velocity)}"'] if velocity else []
        return [f'<keyframe><key name="start" {" ".join(words)}/></keyframe>'] if words else []

    def _body(
        self,
        name: str,
        outline: Sequence[Point],
        front: float,
        back: float,
        colour: str,
        joint: str,
    ) -> None:
        x = sum(corner[0] for corner in outline) / len(outline)
        z = sum(corner[1] for corner in outline) / len(outline)
        y = 0.5 * (front + back)
        shape = grown([(a - x, b - z) for a, b in outline], 0.5 * self.lap)
        if self.arris:
            shape = cut(shape, self.arris)
        reach = 0.5 * (back - front + self.lap)
        corners = [_mjcf.numbers(a, side * reach, b) for side in (-1, 1) for a, b in shape]
        self.assets.append(f'<mesh name="{name}" vertex="{"  ".join(corners)}"/>')
        self.bodies.append(
            f'<body name="{name}" pos="{_mjcf.numbers(x, y, z)}">{joint}'
            f'<geom type="mesh" mesh="{name}" condim="3" density="{self.density!r}"'
            f' friction="{self.mu!r}" material="solid" rgba="{colour}"/></body>'
        )


SUPPORT = "0.42 0.44 0.48 1"


def rectangle(left: float, right: float, bottom: float, top: float) -> list[Point]:
    """An outline [m]."""
    return [(left, bottom), (right, bottom), (right, top), (left, top)]


def ring(
    radius: float, thickness: float, start: float, end: float, count: int, centre: Point = (0, 0)
) -> list[list[Point]]:
    """The outlines of the voussoirs between two angles [rad], radius to the middle line [m]."""
    step = (end - start) / count
    inner, outer = radius - 0.5 * thickness, radius + 0.5 * thickness
    return [
        [
            on_circle(outer, start + i * step, centre),
            on_circle(outer, start + (i + 1) * step, centre),
            on_circle(inner, start + (i + 1) * step, centre),
            on_circle(inner, start + i * step, centre),
        ]
        for i in range(count)
    ]


def on_circle(radius: float, angle: float, centre: Point = (0, 0)) -> Point:
    """The point of a circle at an angle to x [rad]."""
    return centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle)


def area(outline: Sequence[Point]) -> float:
    """The area [m^2] of an outline, positive where it runs counterclockwise."""
    total = 0.0
    for (a, b), (c, d) in zip(outline, [*outline[1:], outline[0]], strict=True):
        total += 0.5 * (a * d - b * c)
    return total


def grown(outline: Sequence[Point], distance: float) -> list[Point]:
    """The convex outline with every side moved outwards by a distance [m]."""
    # side i goes from corner i to corner i + 1: normal . x = offset
    sides = []
    for (a, b), (c, d) in zip(outline, [*outline[1:], outline[0]], strict=True):
        length = math.hypot(c - a, d - b)
        normal = ((d - b) / length, (a - c) / length)
        sides.append((*normal, normal[0] * a + normal[1] * b + distance))
    corners = []
    for (p, q, e), (r, s, f) in zip([sides[-1], *sides[:-1]], sides, strict=True):
        determinant = p * s - q * r
        corners.append(((e * s - q * f) / determinant, (p * f - e * r) / determinant))
    return corners


def cut(outline: Sequence[Point], arris: float) -> list[Point]:
    """The outline with its corners cut off, `arris` [m] along each side."""
    corners = []
    for i, (x, z) in enumerate(outline):
        for a, b in (outline[i - 1], outline[(i + 1) % len(outline)]):
            share = arris / math.hypot(a - x, b - z)
            corners.append((x + share * (a - x), z + share * (b - z)))
    return corners
