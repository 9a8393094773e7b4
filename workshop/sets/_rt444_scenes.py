"""Scenes by the authors' own scripts, in m, kg and s: RT-0444's and the spheres of 2024.

For any interpreter.

The numbers are those of the data files of the repository FrictionalContactLibrary/fclib-scripts, as
the rules that make them. The files do not have inertias: here they are those of homogeneous bodies.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

UPRIGHT: Final = (1.0, 0.0, 0.0, 0.0)
QUARTER: Final = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)  # a turn about x: y points upwards


@dataclass(frozen=True)
class Body:
    """A body, at the start; without mass it is fixed."""

    name: str
    kind: str  # box: three edges; sphere: radius; capsule: also length of its cylinder, along y
    sizes: tuple[float, ...]
    place: tuple[float, float, float]
    turn: tuple[float, ...] = UPRIGHT  # quaternion w, x, y, z
    mass: float = 0.0
    velocity: tuple[float, ...] = (0.0,) * 6  # then the spin, in the body's own axes

    @property
    def inertia(self) -> tuple[float, float, float]:
        """About its own axes, of a homogeneous body."""
        if self.kind == "box":
            x, y, z = (edge * edge * self.mass / 12 for edge in self.sizes)
            return y + z, x + z, x + y
        if self.kind == "sphere":
            moment = 0.4 * self.mass * self.sizes[0] ** 2
            return moment, moment, moment
        radius, height = self.sizes
        # a cylinder and two half balls of one density
        ball = 4 * radius / (3 * height + 4 * radius) * self.mass
        cylinder = self.mass - ball
        along = radius**2 * (cylinder / 2 + 0.4 * ball)
        across = cylinder * (radius**2 / 4 + height**2 / 12)
        across += ball * (0.4 * radius**2 + height**2 / 4 + 0.375 * radius * height)
        return across, along, across


@dataclass(frozen=True)
class Scene:
    """What a script of the authors' simulates."""

    script: str  # its folder in their repository
    bodies: Callable[[], list[Body]]
    mu: float
    theta: float
    end: float  # [s]
    # [m] from this distance on Bullet looks for contacts. It adds one point of a pair a step: a
    # face that hits with fewer than four spins, and the stack falls. So the fastest box or plank
    # must need four steps or more. What rolls has one point: it keeps its old ones up to this
    # distance, and sinks by them. For it this is Siconos' own 0.02.
    near: float
    step: float = 5e-4  # [s]


def ground() -> Body:
    """Its top is at 0."""
    return Body("ground", "box", (400.0, 400.0, 1.0), (0.0, 0.0, -0.5))


def turned(angle: float, turn: tuple[float, ...] = UPRIGHT) -> tuple[float, ...]:
    """An orientation, turned further about the vertical."""
    c, s = math.cos(angle / 2), math.sin(angle / 2)
    w, x, y, z = turn
    return c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w


def boxes() -> list[Body]:
    """50 boxes above each other: each drops on the ones below."""
    sizes = (2.0, 2.0, 2.0)
    return [ground()] + [
        Body(f"box{k:02d}", "box", sizes, (0.0, 0.0, 6.0 * k + 6.0), mass=1.0) for k in range(50)
    ]


def planks() -> list[Body]:
    """11 rings of 12 planks on edge, each ring 1 m above the one below."""
    sizes = (0.78267, 11.74, 2.348)  # outwards, along the ring, upwards
    found = [ground()]
    for k in range(11):
        for i in range(12):
            angle = math.pi / 6 * (i + 0.5 * (k % 2))
            x, y = 23.48 * math.cos(angle), 23.48 * math.sin(angle)
            place = x, y, (sizes[2] + 1.0) * k + 3.18
            found.append(
                Body(f"plank{k:02d}.{i:02d}", "box", sizes, place, turned(angle), mass=1.0)
            )
    return found


def walled() -> list[Body]:
    """The ground, and four walls around a square."""
    found = [ground()]
    for i in range(4):
        angle = math.pi / 2 * i
        place = 20.0 * math.cos(angle), 20.0 * math.sin(angle), 5.0
        found.append(Body(f"wall{i}", "box", (1.0, 10.0, 40.0), place, turned(angle, QUARTER)))
    return found


def capsules() -> list[Body]:
    """100 capsules above each other, in an open box: each drops on the heap below."""
    found = walled()
    for k in range(100):
        place = 0.0, 0.0, 6.0 * k + 20.0
        found.append(Body(f"capsule{k:02d}", "capsule", (1.0, 3.0), place, QUARTER, mass=1.0))
    return found


def spheres() -> list[Body]:
    """20 layers of 10 x 10 spheres, a little out of their rows, that fall into an open box."""
    found = walled()
    drawn = random.Random(0)
    for layer, x, y in itertools.product(range(20), range(10), range(10)):
        aside = drawn.uniform(0, 0.1), drawn.uniform(0, 0.1)
        place = 10.0 - 2.0 * x + aside[0], 10.0 - 2.0 * y + aside[1], 2.0 * layer + 5.0
        found.append(Body(f"sphere{layer:02d}.{x}.{y}", "sphere", (0.7,), place, mass=1.0))
    return found


SCENES: Final = {
    "BoxesStack": Scene("BoxesStack", boxes, 0.7, 0.51, 10.0, 0.2),
    "KaplasTower": Scene("Kaplas", planks, 0.3, 0.50001, 10.0, 0.05),
    "Capsules": Scene("Capsules", capsules, 0.7, 0.50001, 30.0, 0.02),
    "Spheres": Scene("Spheres", spheres, 0.7, 0.50001, 30.0, 0.02),
}
