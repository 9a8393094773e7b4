"""Stones laid without mortar, as MJCF: prisms of any convex outline, and supports that move.

Every stone is a mesh: two flat faces touch in the corners of their overlap, also when the joint
opens about an edge. The box primitive would then change its points.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from fclib.scenes.shared import mjcf

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
    supports: dict[str, bool] = field(default_factory=dict)  # whether each is driven
    speeds: list[float] = field(default_factory=list)  # of the driven supports [m/s]

    def stone(
        self, name: str, outline: Sequence[Point], front: float, back: float, colour: str
    ) -> None:
        """Lay a free stone: its outline (x, z) counterclockwise, from y = front to y = back [m]."""
        self.mass += self.density * area(outline) * (back - front)
        self._body(name, [outline], front, back, colour, "<freejoint/>")

    def support(
        self,
        name: str,
        outlines: Sequence[Sequence[Point]],
        front: float,
        back: float,
        *,
        axis: tuple[float, float, float] = (0.0, 0.0, -1.0),
        speed: float = 0.0,
    ) -> None:
        """Set a support of one or more pieces: fixed, or driven along an axis at a speed [m/s].

        It does not collide with the floor, nor with another support.

        Set it after the stones: their weight decides the strength of the drive.
        """
        joint = ""
        # fixed ones do not collide anyway
        apart = [other for other, driven in self.supports.items() if driven or speed]
        self.rest += [
            f'<contact><exclude body1="{other}" body2="{name}"/></contact>'
            for other in (["world", *apart] if speed else apart)
        ]
        self.supports[name] = bool(speed)
        if speed:
            joint = f'<joint name="{name}" type="slide" axis="{mjcf.numbers(*axis)}"/>'
            # at 10 m/s^2
            gain = self.mass * 10.0 / (YIELD * abs(speed))
            self.rest.append(f'<actuator><velocity joint="{name}" kv="{gain!r}"/></actuator>')
            self.speeds.append(speed)
        self._body(name, outlines, front, back, SUPPORT, joint)

    def keyframe(self, velocity: Sequence[float] = ()) -> list[str]:
        """The start: the speeds of the drives, and velocities (n) if any."""
        words = [f'ctrl="{mjcf.numbers(*self.speeds)}"'] if self.speeds else []
        words += [f'qvel="{mjcf.numbers(*velocity)}"'] if velocity else []
        return [f'<keyframe><key name="start" {" ".join(words)}/></keyframe>'] if words else []

    def _body(
        self,
        name: str,
        outlines: Sequence[Sequence[Point]],
        front: float,
        back: float,
        colour: str,
        joint: str,
    ) -> None:
        """A body of one or more prisms, in the middle of the first."""
        x = sum(corner[0] for corner in outlines[0]) / len(outlines[0])
        z = sum(corner[1] for corner in outlines[0]) / len(outlines[0])
        reach = 0.5 * (back - front + self.lap)
        shapes = ""
        for i, outline in enumerate(outlines):
            shape = grown([(a - x, b - z) for a, b in outline], 0.5 * self.lap)
            if self.arris:
                shape = cut(shape, self.arris)
            corners = [mjcf.numbers(a, side * reach, b) for side in (-1, 1) for a, b in shape]
            mesh = f"{name}.{i}" if i else name
            self.assets.append(f'<mesh name="{mesh}" vertex="{"  ".join(corners)}"/>')
            # the mesh is drawn at the places of its vertices
            shapes += (
                f'<geom type="mesh" mesh="{mesh}" condim="3" density="{self.density!r}"'
                f' friction="{self.mu!r}" material="solid" rgba="{colour}"/>'
            )
        place = mjcf.numbers(x, 0.5 * (front + back), z)
        self.bodies.append(f'<body name="{name}" pos="{place}">{joint}{shapes}</body>')


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


@dataclass(frozen=True, kw_only=True)
class Arcade:
    """A row of equal arches with their piers, backing, spandrels and deck, between two walls.

    x is 0 in the middle, z is the height of the springings above `base`. The haunches are backed by
    level stones, the rest of a ring carries columns up to the deck, each on its voussoir. Piers
    between arches need rings that spring vertically (start = 0).
    """

    spans: int
    voussoirs: int  # of a ring
    radius: float  # of the middle line [m]
    thickness: float  # of the ring [m]
    start: float  # angle of the springings above the horizontal [rad]
    between: float  # clear distance of two neighbours' extrados at the springings [m]
    base: float  # height of the springings [m]
    cover: float  # from the crown's extrados to the deck's slabs [m]
    slab: float  # thickness of a slab of the deck [m]
    slabs: int  # of the whole deck

    @property
    def outer(self) -> float:
        """Radius of the extrados [m]."""
        return self.radius + 0.5 * self.thickness

    @property
    def inner(self) -> float:
        """Radius of the intrados [m]."""
        return self.radius - 0.5 * self.thickness

    @property
    def below(self) -> float:
        """Height of the rings' centres [m]: their intrados springs at the base."""
        return self.base - self.inner * math.sin(self.start)

    @property
    def deck(self) -> float:
        """Height below the slabs [m]."""
        return self.below + self.outer + self.cover

    @property
    def top(self) -> float:
        """Height above the slabs [m]."""
        return self.deck + self.slab

    @property
    def pitch(self) -> float:
        """Distance of two arches [m]."""
        return 2 * self.outer * math.cos(self.start) + self.between

    @property
    def centres(self) -> list[float]:
        """The centres of the rings, along x [m]."""
        return [self.pitch * (i - 0.5 * (self.spans - 1)) for i in range(self.spans)]

    @property
    def end(self) -> float:
        """The place at which the right wall begins, x [m]; the left one is its mirror."""
        return 0.5 * self.pitch * self.spans

    def stones(self) -> list[tuple[str, list[Point]]]:
        """The free stones, from the springings up: names and outlines."""
        step = (math.pi - 2 * self.start) / self.voussoirs
        # of the extrados' corners, seen from the centre of a ring; the right half goes upwards
        corners = [
            on_circle(self.outer, self.start + i * step, (0.0, self.below))
            for i in range(self.voussoirs + 1)
        ]
        backed = sum(1 for i in range(1, len(corners)) if self.start + i * step < BACKED)
        found: list[tuple[str, list[Point]]] = []
        for i, x in enumerate(self.centres):
            outlines = ring(
                self.radius,
                self.thickness,
                self.start,
                math.pi - self.start,
                self.voussoirs,
                (x, self.below),
            )
            found += [(f"voussoir{i}.{j}", outline) for j, outline in enumerate(outlines)]
        # between the walls and the arches, and between two arches
        left = [None, *self.centres]
        right = [*self.centres, None]
        for i, (one, other) in enumerate(zip(left, right, strict=True)):

            def edge(j: int, one: float | None = one, other: float | None = other) -> Point:
                """The two ends of the masonry at the height of corner j."""
                return (
                    -self.end if one is None else one + corners[j][0],
                    self.end if other is None else other - corners[j][0],
                )

            for j in range(backed):
                (a, b), (c, d) = edge(j), edge(j + 1)
                z, above = corners[j][1], corners[j + 1][1]
                found.append((f"backing{i}.{j}", [(a, z), (b, z), (d, above), (c, above)]))
            a, b = edge(backed)
            found.append((f"fill{i}", rectangle(a, b, corners[backed][1], self.deck)))
        for i, x in enumerate(self.centres):
            for j in range(backed, self.voussoirs - backed):
                (a, z), (b, above) = corners[j], corners[j + 1]
                outline = [(x + b, above), (x + a, z), (x + a, self.deck), (x + b, self.deck)]
                found.append((f"column{i}.{j}", outline))
        length = 2 * self.end / self.slabs
        for i in range(self.slabs):
            start = -self.end + i * length
            found.append((f"slab{i}", rectangle(start, start + length, self.deck, self.top)))
        return found

    def wall(self, side: int, bottom: float, width: float) -> list[list[Point]]:
        """The wall at an end, right (1) or left (-1): skewback and what holds the backing.

        bottom: its lowest height [m]; width: from the wall's face outwards [m]
        """
        x = self.centres[-1]
        foot = on_circle(self.inner, self.start, (x, self.below))
        head = on_circle(self.outer, self.start, (x, self.below))
        far = self.end + width
        # level, or inclined as the ring's first joint
        slope = [head] if self.start else []
        skewback = [(foot[0], bottom), (far, bottom), (far, head[1]), *slope, foot]
        pieces = [skewback, rectangle(self.end, far, head[1], self.top)]
        if side > 0:
            return pieces
        return [[(-a, b) for a, b in reversed(piece)] for piece in pieces]

    def pier(self, i: int) -> tuple[float, float]:
        """The two ends of the pier between arches i and i + 1, x [m]."""
        return self.centres[i] + self.inner, self.centres[i + 1] - self.inner


BACKED = math.radians(50)  # angle above the horizontal at which the backing of a ring ends


def on_circle(radius: float, angle: float, centre: Point = (0, 0)) -> Point:
    """The point of a circle at an angle to x [rad]."""
    return centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle)


def area(outline: Sequence[Point]) -> float:
    """The area [m^2] of an outline, positive if it runs counterclockwise."""
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
