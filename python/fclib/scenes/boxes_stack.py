"""Boxes dropped one upon another: a tower under its own weight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class BoxesStack(Published):
    """A column of equal cubes, a small gap below each, that falls on the floor and comes to rest.

    A tall stack is hard for a first-order method: a reaction at the bottom carries the weight of
    all that is above, and information climbs one box a sweep.

    After the family BoxesStack of V. Acary, M. Bremond, T. Koziara and F. Perignon, FCLIB: a
    collection of discrete 3D Frictional Contact problems, Inria report RT-0444, 2014. Sizes,
    masses and friction are its own; the gaps, offsets and rotations are chosen here. The stored
    problems of `rt444` are not of this scene but of the authors' own, which Siconos stepped: the
    boxes start far above each other, and drop one upon another.
    """

    title: ClassVar[str] = "Stack of boxes"
    description: ClassVar[str] = (
        "Equal cubes dropped one upon another on a horizontal floor, under gravity."
    )
    application: ClassVar[str] = "multibody systems, masonry"
    authors: ClassVar[str] = "V. Acary, M. Bremond, T. Koziara, F. Perignon"
    collection: ClassVar[str] = "rt444"
    problems: ClassVar[int] = 1514

    boxes: int = parameter(50, "1", "number of boxes, at least 1")
    size: float = parameter(2.0, "m", "edge of a box")
    mass: float = parameter(1.0, "kg", "mass of a box")
    mu: float = parameter(0.7, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    gap: float = parameter(0.1, "m", "clearance below each box at the start")
    offset: float = parameter(0.05, "m", "largest horizontal offset of a box along x and along y")
    yaw: float = parameter(0.05, "rad", "largest rotation of a box about the vertical")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(2e-3, "s", "time step h")
    activation: float = parameter(1e-4, "m", "gap of a corner that counts as closed")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("size", "mass", "time_step"),
            non_negative=("mu", "activation", "gap", "offset", "yaw"),
            at_least={"boxes": 1},
        )

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the offsets and the rotations."""
        random = np.random.Generator(np.random.PCG64(seed))
        # one row a box (x, y, yaw), drawn at once: a taller stack begins like a smaller one
        draws = random.uniform(-1.0, 1.0, size=(self.boxes, 3))
        draws *= (self.offset, self.offset, self.yaw)

        bodies = []
        for i, (x, y, yaw) in enumerate(draws):
            z = (i + 0.5) * self.size + (i + 1) * self.gap
            bodies.append(
                f'<body name="box{i}" pos="{mjcf.numbers(x, y, z)}"'
                f' euler="{mjcf.numbers(0, 0, yaw)}"><freejoint/>'
                f'<geom type="mesh" mesh="box" mass="{self.mass!r}" friction="{self.mu!r}"'
                f' condim="3" material="solid" rgba="{mjcf.shade(i, self.boxes)}"/></body>'
            )
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            assets=[mjcf.block_mesh("box", self.size, self.size, self.size)],
            tile=self.size,
        )
