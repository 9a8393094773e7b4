"""Polyhedra and spheres that flow down a chute."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter

Vector: TypeAlias = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Chute(Published):
    """Grains that start as a bed on a steep slope, slide down between two walls, and pile up below.

    A grain is a sphere or a polyhedron with eight corners. Those that slide together are in loose
    contact; those that come to rest in the trough are the hyperstatic end of the set.

    After the sets Chute_1000 and Chute_4000 of the FCLIB library by V. Acary and S. Sinclair: 1000
    and 4000 random polyhedra, mu = 1; Chute1000 and Chute4000 are as large. The spheres, the slope,
    the trough and the positions at the start are chosen here.
    """

    title: ClassVar[str] = "Chute"
    description: ClassVar[str] = "Polyhedra and spheres that flow down a chute and pile up below."
    application: ClassVar[str] = "granular matter"
    authors: ClassVar[str] = "V. Acary, S. Sinclair"
    collection: ClassVar[str] = "granular"
    problems: ClassVar[int] = 400

    grains: int = parameter(240, "1", "number of grains, at least 1")
    spheres: float = parameter(0.25, "1", "share of the grains that are spheres, in [0, 1]")
    shapes: int = parameter(40, "1", "polyhedra that differ, at least 1")
    radius: float = parameter(0.1, "m", "largest radius of a grain, to its corners")
    spread: float = parameter(0.4, "1", "the smallest radius is smaller by this share, in [0, 1)")
    density: float = parameter(2500.0, "kg/m^3", "mass density")
    mu: float = parameter(1.0, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    slope: float = parameter(1.0, "rad", "angle of the slope, in (0, pi/2)")
    across: int = parameter(6, "1", "grains of the bed from wall to wall, at least 1")
    layers: int = parameter(5, "1", "layers of the bed, at least 1")
    trough: float = parameter(1.2, "m", "length of the floor below the slope")
    hexahedra: bool = parameter(
        False, "1", "whether polyhedra have six flat faces, which touch in several points"
    )
    thinnest: float = parameter(
        1.0, "1", "hexahedra are flattened by shares from this to 1, in (0, 1]"
    )
    tilt: float = parameter(
        1.0, "1", "share of a random rotation, from hexahedra that lie on the slope, in [0, 1]"
    )
    gaps: bool = parameter(
        False, "1", "law of gaps: every contact within a step's reach, open ones too"
    )
    margin: float = parameter(0.0, "m", "with the law of gaps: a gap up to this is a contact too")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(4e-3, "s", "time step h")

    def __post_init__(self) -> None:
        name = type(self).__name__
        mjcf.check(
            self,
            positive=("radius", "thinnest", "density", "slope", "trough", "time_step"),
            non_negative=("mu", "spread", "spheres", "tilt", "margin"),
            at_least={"grains": 1, "shapes": 1, "across": 1, "layers": 1},
        )
        for what, bound in (("spread", 1), ("slope", math.pi / 2)):
            if not getattr(self, what) < bound:
                raise ValueError(f"{name}: {what} must be < {bound:g}, not {getattr(self, what)}")
        for what in ("spheres", "thinnest", "tilt"):
            if not getattr(self, what) <= 1:
                raise ValueError(f"{name}: {what} must be <= 1, not {getattr(self, what)}")
        if not self.hexahedra and min(self.thinnest, self.tilt) < 1:
            raise ValueError(f"{name}: thinnest and tilt are of hexahedra")
        if self.gaps and self.restitution:
            raise ValueError(f"{name}: restitution must be 0 by the law of gaps")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the grains and how they are turned."""
        random = np.random.Generator(np.random.PCG64(seed))
        corners = (mjcf.hexahedra if self.hexahedra else mjcf.polyhedra)(random, self.shapes)
        if self.thinnest < 1:
            corners[:, :, 2] *= random.uniform(self.thinnest, 1.0, size=(self.shapes, 1))
            corners /= np.linalg.norm(corners, axis=2).max(axis=1)[:, None, None]
        corners *= self.radius * (1 - self.spread * random.uniform(size=(self.shapes, 1, 1)))
        draws = random.uniform(size=(self.grains, 3))
        turned = mjcf.rotations(random, self.grains)
        if self.tilt < 1:
            corners = mjcf.on_a_face(corners)
            turned = self._lying(turned)

        pitch = 2.05 * self.radius
        width = pitch * self.across
        # up the slope, along the wall, away from the slope
        up = np.array([-math.cos(self.slope), 0, math.sin(self.slope)])
        away = np.array([math.sin(self.slope), 0, math.cos(self.slope)])
        bodies = self._chute(pitch, width, up, away)
        for i, (kind, size, shape) in enumerate(draws.tolist()):
            row, cell = divmod(i, self.across * self.layers)
            layer, column = divmod(cell, self.across)
            # the lowest row begins at the height at which its lower layers are above the floor
            place = pitch * (row + 1 + self.layers / math.tan(self.slope)) * up
            place += pitch * (layer + 0.5) * away
            place[1] = pitch * (column + 0.5) - 0.5 * width
            form = (
                f'type="sphere" size="{self.radius * (1 - self.spread * size)!r}"'
                if kind < self.spheres
                else f'type="mesh" mesh="grain{int(shape * self.shapes)}"'
            )
            bodies.append(
                mjcf.grain(
                    f"grain{i}",
                    place,
                    f'{form} density="{self.density!r}"',
                    self._surface(),
                    mjcf.shade(i, self.grains),
                    turned[i],
                )
            )
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            assets=[mjcf.polyhedron_mesh(f"grain{k}", c) for k, c in enumerate(corners)],
            tile=2 * pitch,
            rest=mjcf.margins(self.margin),
            law="gap" if self.gaps else "velocity",
        )

    def _lying(self, turned: Vector) -> Vector:
        """The rotations (k x 4) that a share of each leads to, from a face on the slope."""
        half = self.tilt * np.arccos(np.clip(turned[:, 0], -1, 1))
        axis = turned[:, 1:] / np.linalg.norm(turned[:, 1:], axis=1)[:, None]
        w, (x, y, z) = np.cos(half), (np.sin(half)[:, None] * axis).T
        # then about y, by the slope
        c, s = math.cos(0.5 * self.slope), math.sin(0.5 * self.slope)
        return np.column_stack((c * w - s * y, c * x + s * z, c * y + s * w, c * z - s * x))

    def _surface(self) -> str:
        """The friction of a grain; that of a contact is the larger one of its two geometries."""
        return mjcf.surface(self.mu)

    def _chute(self, pitch: float, width: float, up: Vector, away: Vector) -> list[str]:
        """The slope, and walls beside it and at the end of the trough; planes without end."""
        friction = mjcf.surface(self.mu)
        rows = -(-self.grains // (self.across * self.layers))
        length = pitch * (rows + 2 + self.layers / math.tan(self.slope))
        elements = [
            f'<geom name="slope" type="plane" size="{mjcf.numbers(0.5 * width, 0.5 * length, 1)}"'
            f' pos="{mjcf.numbers(*(0.5 * length * up))}"'
            f' xyaxes="{mjcf.numbers(0, 1, 0, *up)}" {friction} rgba="0.62 0.6 0.57 1"/>'
        ]
        height = 1.2 * self.layers * pitch
        walls = (
            ((0, -0.5 * width, 0), (0, 1, 0)),
            ((0, 0.5 * width, 0), (0, -1, 0)),
            ((self.trough, 0, 0), (-1, 0, 0)),
        )
        for i, (place, axis) in enumerate(walls):
            elements.append(
                f'<geom name="wall{i}" type="plane" size="0 0 1" pos="{mjcf.numbers(*place)}"'
                f' zaxis="{mjcf.numbers(*axis)}" {friction} rgba="0 0 0 0"/>'
            )
        # the frame: the edges of the slope and of the trough, and the rim of the side walls
        ends = []
        for y in (-0.5 * width, 0.5 * width):
            foot, end = np.array([0, y, 0]), np.array([self.trough, y, 0])
            top = np.array([self.trough, y, height])
            rim = foot + height / math.sin(self.slope) * up
            for start, stop in ((foot, foot + length * up), (foot, end), (end, top), (top, rim)):
                elements.append(mjcf.bar(start, stop, 0.1 * self.radius))
            ends.append(top)
        elements.append(mjcf.bar(ends[0], ends[1], 0.1 * self.radius))
        return elements


@dataclass(frozen=True, kw_only=True)
class Chute1000(Chute):
    """The chute with 1000 grains, until most have reached the trough.

    After the set Chute_1000 of the FCLIB library by V. Acary and S. Sinclair.
    """

    title: ClassVar[str] = "Chute, 1000 grains"
    problems: ClassVar[int] = 140
    small: ClassVar[Mapping[str, Any]] = {"grains": 24, "across": 3, "layers": 2, "shapes": 5}

    grains: int = parameter(1000, "1", "number of grains, at least 1")
    across: int = parameter(10, "1", "grains of the bed from wall to wall, at least 1")
    layers: int = parameter(8, "1", "layers of the bed, at least 1")
    time_step: float = parameter(8e-3, "s", "time step h")


@dataclass(frozen=True, kw_only=True)
class Chute4000(Chute1000):
    """The chute with 4000 grains, as long as all of them slide.

    After the set Chute_4000 of the FCLIB library by V. Acary and S. Sinclair.
    """

    title: ClassVar[str] = "Chute, 4000 grains"
    problems: ClassVar[int] = 90

    grains: int = parameter(4000, "1", "number of grains, at least 1")
    across: int = parameter(16, "1", "grains of the bed from wall to wall, at least 1")
    layers: int = parameter(10, "1", "layers of the bed, at least 1")
