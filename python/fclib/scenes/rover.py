"""A vehicle of six wheels on rockers that drives over a bed of loose stones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter

SIDES = 16  # of a wheel, a prism
IRON = "0.45 0.47 0.5 1"
SAND = "0.66 0.56 0.4 1"


@dataclass(frozen=True, kw_only=True)
class Rover(Published):
    """A rover of six wheels drives over stones that roll, slide and wedge under it.

    On each side a rocker turns about the hull; it has the front wheel, and a bogie with the two
    others. A differential turns one rocker as far down as the other goes up, which holds the hull
    level between them. So all six wheels touch uneven ground. A motor turns each wheel, and lets it
    slip if the friction is too small. On even ground the wheels carry the weight by the lever
    rule.

    Why it is here: a mechanism with joints and a closed loop stands on free bodies that are not at
    rest. The masses differ by a factor of a hundred. Friction itself decides the direction
    in which a spinning wheel slides. If a stone wedges between wheel and ground, several solutions
    may exist.

    The suspension: D. B. Bickler, US patent 4,840,394, 1989.
    """

    title: ClassVar[str] = "Rover on rubble"
    description: ClassVar[str] = "A rover of six driven wheels on rockers climbs over loose stones."
    application: ClassVar[str] = "robotics, vehicles"
    authors: ClassVar[str] = "the authors of FCLIB, after D. B. Bickler"
    collection: ClassVar[str] = "machines"
    problems: ClassVar[int] = 1000

    stones: int = parameter(80, "1", "number of stones, 0 for even ground")
    across: int = parameter(8, "1", "stones side by side, at least 1")
    layers: int = parameter(2, "1", "layers of stones, at least 1")
    stone: float = parameter(0.06, "m", "largest radius of a stone")
    rock: float = parameter(2500.0, "kg/m^3", "mass density of the stones")
    wheel: float = parameter(0.12, "m", "radius of a wheel")
    hull: float = parameter(40.0, "kg", "mass of the hull")
    mass: float = parameter(2.0, "kg", "mass of a wheel, of a rocker and of a bogie")
    base: float = parameter(0.35, "m", "from one wheel to the next one")
    speed: float = parameter(5.0, "rad/s", "of the wheels, were there no load")
    torque: float = parameter(40.0, "N m", "of a motor that is held")
    mu: float = parameter(0.7, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "0: the law of gaps is inelastic")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(2e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("stone", "rock", "wheel", "hull", "mass", "base", "speed", "time_step"),
            non_negative=("mu", "torque"),
            at_least={"stones": 0, "across": 1, "layers": 1},
        )
        if self.restitution:
            raise ValueError(f"Rover: restitution must be 0, not {self.restitution}")
        if not 2.2 * self.wheel < self.base:
            raise ValueError(f"Rover: base must be above {2.2 * self.wheel:g}, not {self.base}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the stones and how they are turned."""
        random = np.random.Generator(np.random.PCG64(seed))
        shapes = mjcf.hexahedra(random, self.stones)
        turned = mjcf.rotations(random, self.stones)
        radii = self.stone * random.uniform(0.6, 1.0, size=self.stones)
        pitch = 2.02 * self.stone
        angles = 2 * math.pi * (np.arange(SIDES) + 0.5) / SIDES
        # if a wheel stands on a flat side, its height follows from its radius
        rim = (
            self.wheel
            / math.cos(math.pi / SIDES)
            * np.column_stack((np.cos(angles), np.sin(angles)))
        )
        corners = [(x, side * 0.35 * self.wheel, z) for x, z in rim.tolist() for side in (-1, 1)]
        assets = [mjcf.polyhedron_mesh("wheel", np.array(corners))]
        assets += [
            mjcf.polyhedron_mesh(f"stone{i}", radii[i] * shapes[i]) for i in range(self.stones)
        ]
        bodies = [self._rover()]
        first = self.wheel + 2 * self.stone  # before the foremost wheel
        for i in range(self.stones):
            rest, column = divmod(i, self.across)
            row, layer = divmod(rest, self.layers)
            place = (
                first + pitch * row,
                pitch * (column - 0.5 * (self.across - 1)),
                self.stone * 1.01 + pitch * layer,
            )
            bodies.append(
                mjcf.grain(
                    f"stone{i}",
                    place,
                    f'type="mesh" mesh="stone{i}" density="{self.rock!r}"',
                    mjcf.surface(self.mu),
                    SAND,
                    turned[i],
                )
            )
        names = [f"{side}{k}" for side in ("left", "right") for k in range(3)]
        kv = self.torque / self.speed
        speeds = mjcf.numbers(*[self.speed] * len(names))
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            assets=assets,
            tile=self.base,
            rest=[
                '<equality><joint joint1="leftrocker" joint2="rightrocker"'
                ' polycoef="0 -1 0 0 0"/></equality>',
                "<actuator>",
                *(f'<velocity joint="{name}" kv="{kv!r}"/>' for name in names),
                "</actuator>",
                f'<keyframe><key name="start" ctrl="{speeds}"/></keyframe>',
            ],
            law="gap",
        )

    def _rover(self) -> str:
        """The rover, its front wheel at x = 0; its own x looks ahead."""
        gap = 1e-3
        axle = self.wheel + gap  # height of the wheels' axles
        pivot = axle + 0.8 * self.wheel  # of the rockers
        width = 0.9 * self.base
        sides = ""
        for name, y in (("left", 0.5 * width), ("right", -0.5 * width)):
            # seen from the rocker's pivot, which is between the front wheel and the bogie
            low = axle - pivot
            bogie = self._turning(
                f"{name}bogie",
                (-0.5 * self.base, y, 0.5 * low),
                [(0.5 * self.base, 0.5 * low), (-0.5 * self.base, 0.5 * low)],
                self._wheel(f"{name}1", (0.5 * self.base, 0.5 * low), y)
                + self._wheel(f"{name}2", (-0.5 * self.base, 0.5 * low), y),
            )
            sides += self._turning(
                f"{name}rocker",
                (0.0, y, 0.0),
                [(self.base, low), (-0.5 * self.base, 0.5 * low)],
                self._wheel(f"{name}0", (self.base, low), y) + bogie,
            )
        size = mjcf.numbers(0.9 * self.base, 0.3 * self.base, 0.15 * self.base)
        return (
            f'<body name="hull" pos="{mjcf.numbers(-self.base, 0, pivot)}"><freejoint/>'
            f'<geom name="hull" type="box" size="{size}" mass="{self.hull!r}"'
            f' pos="{mjcf.numbers(0, 0, 0.1 * self.base)}" contype="2" conaffinity="1"'
            f' {mjcf.surface(self.mu)} material="solid" rgba="{mjcf.shade(0, 2)}"/>'
            f"{sides}</body>"
        )

    def _turning(
        self,
        name: str,
        place: tuple[float, float, float],
        ends: list[tuple[float, float]],
        rest: str,
    ) -> str:
        """A beam with a hinge at a place, and bars to its ends in the plane x, z."""
        bars = "".join(
            f'<geom type="capsule" size="{0.1 * self.wheel!r}" contype="0" conaffinity="0"'
            f' fromto="{mjcf.numbers(0, 0, 0, x, 0, z)}" mass="{self.mass / len(ends)!r}"'
            f' material="solid" rgba="{IRON}"/>'
            for x, z in ends
        )
        # the rocker is beside the hull, the bogie in the rocker's plane
        x, y, z = place
        beside = y if name.endswith("rocker") else 0.0
        # it would roll on without end: the bearing of a real one has friction too
        joint = f'<joint name="{name}" axis="0 1 0" damping="{0.1 * self.mass!r}"/>'
        return f'<body name="{name}" pos="{mjcf.numbers(x, beside, z)}">{joint}{bars}{rest}</body>'

    def _wheel(self, name: str, place: tuple[float, float], y: float) -> str:
        """A driven wheel, outside of its beam."""
        out = math.copysign(0.55 * self.wheel, y)
        return (
            f'<body name="{name}" pos="{mjcf.numbers(place[0], out, place[1])}">'
            f'<joint name="{name}" axis="0 1 0"/>'
            f'<geom name="{name}" type="mesh" mesh="wheel" mass="{self.mass!r}" contype="2"'
            f' conaffinity="1" {mjcf.surface(self.mu)} material="solid" rgba="0.25 0.26 0.28 1"/>'
            "</body>"
        )
