"""Grains in a shear box: the upper half moves over the lower one under a load."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter

GREY = "0.5 0.5 0.5 1"
SINKS = 0.3  # [m/s] the plate under its load, with nothing below it: a damper
FAST = 1e3  # what drives the box loses 1/FAST of its speed under the load


@dataclass(frozen=True, kw_only=True)
class ShearBox(Published):
    """Discs between two rough plates: the lower half of the box is fast, the upper one is driven.

    The upper plate rises and sinks freely under its load. First it settles, then the box is
    sheared: the discs dilate, a band between the halves flows, the others form chains of force
    that stand until they buckle. The macroscopic friction is the force that drives the box over
    the load. Rigid grains have no scale of stress, so it is the same for all loads.

    Why it is here: the packing is dense, and its network of contacts is just rigid. Most contacts
    stick; a few slide, and these change from step to step. Chains of force make it ill-conditioned.
    Each plate has many contacts and is far heavier than a grain.

    GDR MiDi, On dense granular flows, European Physical Journal E 14, 2004. F. da Cruz, S. Emam,
    M. Prochnow, J.-N. Roux, F. Chevoir, Rheophysics of dense granular materials, Physical Review
    E 72, 2005.
    """

    title: ClassVar[str] = "Shear box"
    description: ClassVar[str] = "Discs sheared between two rough plates under a load; planar."
    application: ClassVar[str] = "granular matter, soil mechanics"
    authors: ClassVar[str] = "the authors of FCLIB, after GDR MiDi"
    collection: ClassVar[str] = "machines"
    problems: ClassVar[int] = 800

    across: int = parameter(24, "1", "discs side by side, at least 4")
    layers: int = parameter(10, "1", "layers of discs, at least 2")
    radius: float = parameter(5e-3, "m", "largest radius of a disc")
    spread: float = parameter(0.4, "1", "the smallest radius is smaller by this share, in [0, 1)")
    density: float = parameter(2500.0, "kg/m^2", "mass density")
    load: float = parameter(20.0, "1", "on the upper plate, in weights of all discs")
    speed: float = parameter(0.1, "m/s", "of the upper half")
    settle: float = parameter(0.12, "s", "time before the shear begins, and between the strokes")
    stroke: float = parameter(0.04, "m", "way of the upper half, there and back")
    mu: float = parameter(0.5, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "0: the law of gaps is inelastic")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(5e-4, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=(
                *("radius", "density", "load", "settle", "speed", "stroke"),
                *("gravity", "time_step"),
            ),
            non_negative=("mu", "spread"),
            at_least={"across": 4, "layers": 2},
        )
        if self.restitution:
            raise ValueError(f"ShearBox: restitution must be 0, not {self.restitution}")
        if not self.spread < 1:
            raise ValueError(f"ShearBox: spread must be < 1, not {self.spread}")

    @property
    def weight(self) -> float:
        """The weight of all discs, if all had the mean radius [N]."""
        r = self.radius * (1 - 0.5 * self.spread)
        return self.gravity * self.density * math.pi * r**2 * self.across * self.layers

    @property
    def pressed(self) -> float:
        """The load and the weight of the plate [N]: the plate is a hundredth of the load."""
        return 1.01 * self.load * self.weight

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws radii, places and the lugs of the plates."""
        random = np.random.Generator(np.random.PCG64(seed))
        count = self.across * self.layers
        draws = random.uniform(size=(count, 2))
        radii = self.radius * (1 - self.spread * draws[:, 0])
        friction = mjcf.surface(self.mu)
        pitch = 2.02 * self.radius
        half = 0.5 * pitch * (self.across + 0.5)
        bodies = []
        for i, radius in enumerate(radii.tolist()):
            row, column = divmod(i, self.across)
            # every second row is set off by half a disc
            x = pitch * (column - 0.5 * (self.across - 1) + (0.25 if row % 2 else -0.25))
            room = self.radius - radius
            z = self.radius * 2 + row * pitch
            look = f'{friction} rgba="{mjcf.shade(i, count)}"'
            bodies.append(
                mjcf.disc(
                    f"disc{i}", (x + room * (2 * draws[i, 1] - 1), z), radius, self.density, look
                )
            )
        top = pitch * self.layers + 2 * self.radius
        level = 0.45 * top  # of the gap between the two halves
        bodies += [
            self._lugs("lower", random, half, 0.0, friction),
            *self._sides("lower", half, 0.0, level, friction),
        ]
        plate = 0.01 * self.load * self.weight / self.gravity
        damping = self.pressed / SINKS
        lid = (
            f'<body name="lid" pos="{mjcf.numbers(0, 0, top + self.radius)}">'
            f'<joint name="lid" type="slide" axis="0 0 1" damping="{damping!r}"/>'
            f'<inertial pos="0 0 0" mass="{plate!r}" diaginertia="{mjcf.numbers(*[plate] * 3)}"/>'
            f"{self._lugs('upper', random, half, 0.0, friction)}</body>"
        )
        sides = "".join(self._sides("upper", half, level, 1.2 * top, friction))
        bodies.append(
            '<body name="box"><joint name="box" type="slide" axis="1 0 0"/>'
            f'<inertial pos="0 0 0" mass="{plate!r}" diaginertia="{mjcf.numbers(*[plate] * 3)}"/>'
            f"{sides}{lid}</body>"
        )
        # strong, and so the speed is held
        kv = FAST * self.pressed / self.speed
        there, wait = self.stroke / self.speed, self.settle
        start = 0.1 * wait  # of a stroke, and end
        keys, time = [(0.0, 0.0)], 0.0
        for sign in (1, -1):
            for pause, share in ((wait, 0.0), (start, sign), (there, sign), (start, 0.0)):
                time += pause
                keys.append((time, share * self.speed))
        force = repr(-self.load * self.weight)
        drive = [
            "<actuator>",
            f'<velocity joint="box" kv="{kv!r}"/><motor joint="lid"/>',
            "</actuator>",
            "<keyframe>",
            *(
                f'<key name="gait{k}" time="{time!r}" ctrl="{speed!r} {force}"/>'
                for k, (time, speed) in enumerate(keys)
            ),
            "</keyframe>",
        ]
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            floor_z=-20 * self.radius,
            tile=4 * self.radius,
            rest=drive,
            law="gap",
            planar=True,
            focus=(0.0, 0.0, 0.5 * top, 1.2 * half),
        )

    def _lugs(
        self, name: str, random: np.random.Generator, half: float, z: float, friction: str
    ) -> str:
        """A plate of fixed discs, two thirds as large as the grains, of drawn heights about z."""
        radius = self.radius * 2 / 3
        places = np.linspace(-half, half, math.ceil(2 * half / (1.5 * radius)) + 1)
        heights = z + 0.3 * radius * random.uniform(-1, 1, size=len(places))
        return "".join(
            f'<geom name="{name}{k}" type="sphere" size="{radius!r}"'
            f' pos="{mjcf.numbers(x, 0, height)}" contype="2" conaffinity="1" {friction}'
            f' material="solid" rgba="{GREY}"/>'
            for k, (x, height) in enumerate(zip(places.tolist(), heights.tolist(), strict=True))
        )

    def _sides(self, name: str, half: float, low: float, high: float, friction: str) -> list[str]:
        """Two walls from one height to another."""
        thick = self.radius
        size = mjcf.numbers(thick, thick, 0.5 * (high - low))
        return [
            f'<geom name="{name}{side}" type="box" size="{size}"'
            f' pos="{mjcf.numbers(place * (half + thick), 0, 0.5 * (low + high))}"'
            f' contype="2" conaffinity="1" {friction} material="solid" rgba="{GREY}"/>'
            for side, place in (("left", -1), ("right", 1))
        ]
