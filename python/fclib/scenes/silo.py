"""Grains in a narrow silo, whose walls carry most of their weight; an outlet may be open."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class Silo(Published):
    """Discs in the plane between two rough walls, on a floor with an outlet in its middle.

    With the outlet open the grains flow. With it closed and a floor that sinks slowly, friction on
    the walls points upwards, and the load on the floor saturates as the silo is filled higher:
    H. A. Janssen, Versuche ueber Getreidedruck in Silozellen, Zeitschrift des Vereines deutscher
    Ingenieure 39, 1895. (On a floor at rest the reactions of rigid grains are not unique, and their
    sum may be above the weight.)
    """

    title: ClassVar[str] = "Silo"
    description: ClassVar[str] = "Discs in a narrow silo, at rest or flowing out, under gravity."
    application: ClassVar[str] = "granular matter"
    authors: ClassVar[str] = "the authors of FCLIB, after H. A. Janssen"
    collection: ClassVar[str] = "dynamics"
    problems: ClassVar[int] = 250

    discs: int = parameter(160, "1", "number of discs, at least 1")
    across: int = parameter(8, "1", "discs from wall to wall, at least 2")
    radius: float = parameter(0.05, "m", "largest radius of a disc")
    spread: float = parameter(0.2, "1", "the smallest radius is smaller by this share, in [0, 1)")
    outlet: float = parameter(3.0, "1", "width of the outlet, in largest diameters; 0: closed")
    sink: float = parameter(0.0, "m/s", "speed of the floor, downwards")
    density: float = parameter(2500.0, "kg/m^2", "mass density")
    mu: float = parameter(0.5, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(2.5e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("radius", "density", "time_step"),
            non_negative=("mu", "spread", "outlet", "sink"),
            at_least={"discs": 1, "across": 2},
        )
        if not self.spread < 1:
            raise ValueError(f"Silo: spread must be < 1, not {self.spread}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the radii, and the places in their cells."""
        random = np.random.Generator(np.random.PCG64(seed))
        draws = random.uniform(size=(self.discs, 2))
        radii = self.radius * (1 - self.spread * draws[:, 0])
        friction = mjcf.surface(self.mu)
        pitch = 2.02 * self.radius
        half = 0.5 * pitch * (self.across + 0.5)
        height = 2 * pitch * math.ceil(self.discs / self.across)
        look = f'{friction} rgba="0.5 0.5 0.5 1"'
        sides = (((half, 0.0), (half, height)), ((-half, height), (-half, 0.0)))
        bodies = mjcf.lines(sides, friction)
        # the floor of the silo, in two parts on one slide; below it the ground
        hole = self.outlet * self.radius
        deep = 2 * self.radius
        parts = ""
        for side in (-1, 1):
            length = 0.5 * (half - hole)
            place = (side * (hole + length), 0.0, -deep)
            parts += (
                f'<geom type="box" size="{mjcf.numbers(length, deep, deep)}"'
                f' pos="{mjcf.numbers(*place)}" material="solid" {look} mass="1"/>'
            )
        for i, radius in enumerate(radii.tolist()):
            row, column = divmod(i, self.across)
            room = self.radius - radius
            # every second row is set off by half a disc
            x = pitch * (column - 0.5 * (self.across - 1) + (0.25 if row % 2 else -0.25))
            z = self.radius + row * pitch
            bodies.append(
                mjcf.disc(
                    f"disc{i}",
                    (x + room * (2 * draws[i, 1] - 1), z),
                    radius,
                    self.density,
                    f'{friction} rgba="{mjcf.shade(i, self.discs)}"',
                )
            )
        # last, so that it does not number the discs
        bodies.append(
            '<body name="floor"><joint name="floor" type="slide" axis="0 0 -1"/>'
            + parts
            + "</body>"
        )
        # strong: under all discs it loses 1 mm/s
        weight = self.gravity * self.density * math.pi * float((radii**2).sum())
        drive = [
            '<contact><exclude body1="world" body2="floor"/></contact>',
            f'<actuator><velocity joint="floor" kv="{weight / 1e-3!r}"/></actuator>',
            f'<keyframe><key name="start" ctrl="{self.sink!r}"/></keyframe>',
        ]
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            floor_z=-10 * self.radius,
            tile=4 * self.radius,
            rest=drive,
            planar=True,
        )
