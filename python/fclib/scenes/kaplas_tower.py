"""A round tower of kaplas, the wooden planks of a children's game, laid without glue."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class KaplasTower(Published):
    """Rings of planks laid flat, each level turned by half a plank; a small gap below each level.

    The levels land one after the other, so that the problems grow from one ring on the floor to
    the whole tower. Every plank lies on two others and no plank is needed for it to stand: W is
    singular, and the reactions are far from unique.

    After the family KaplasTower of V. Acary, M. Bremond, T. Koziara and F. Perignon, FCLIB: a
    collection of discrete 3D Frictional Contact problems, Inria report RT-0444, 2014. Sizes,
    masses, friction and the number of levels are its own; the clearance between the planks of a
    ring and the gaps below the levels are chosen here. The stored problems of `rt444` are not of
    this scene but of the authors' own, which Siconos stepped: planks stand on edge, and drop.
    """

    title: ClassVar[str] = "Tower of kaplas"
    description: ClassVar[str] = (
        "Wooden planks laid in rings, one upon another, on a horizontal floor, under gravity."
    )
    application: ClassVar[str] = "masonry, multibody systems"
    authors: ClassVar[str] = "V. Acary, M. Bremond, T. Koziara, F. Perignon"
    collection: ClassVar[str] = "rt444"
    problems: ClassVar[int] = 201

    levels: int = parameter(12, "1", "number of rings, at least 1")
    planks: int = parameter(12, "1", "planks of a ring, at least 5")
    length: float = parameter(0.114, "m", "length of a plank")
    width: float = parameter(0.02348, "m", "width of a plank")
    thickness: float = parameter(0.0078267, "m", "thickness of a plank")
    mass: float = parameter(1.0, "kg", "mass of a plank")
    mu: float = parameter(0.7, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    clearance: float = parameter(2e-3, "m", "distance of two neighbours' inner corners")
    gap: float = parameter(1e-3, "m", "clearance below each level at the start")
    offset: float = parameter(2e-4, "m", "largest horizontal offset of a plank along x and along y")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(5e-4, "s", "time step h")
    activation: float = parameter(1e-5, "m", "gap of a corner that counts as closed")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("length", "width", "thickness", "mass", "time_step"),
            non_negative=("mu", "activation", "clearance", "gap", "offset"),
            at_least={"levels": 1, "planks": 5},
        )

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the offsets."""
        random = np.random.Generator(np.random.PCG64(seed))
        draws = random.uniform(-self.offset, self.offset, size=(self.levels, self.planks, 2))

        # neighbours meet in the inner corners
        radius = (self.length + self.clearance) / (2 * math.tan(math.pi / self.planks))
        radius += 0.5 * self.width
        bodies = []
        for level in range(self.levels):
            z = (level + 0.5) * self.thickness + (level + 1) * self.gap
            for i in range(self.planks):
                angle = 2 * math.pi * (i + 0.5 * (level % 2)) / self.planks
                x = radius * math.cos(angle) + draws[level, i, 0]
                y = radius * math.sin(angle) + draws[level, i, 1]
                bodies.append(
                    f'<body name="plank{level}.{i}" pos="{mjcf.numbers(x, y, z)}"'
                    f' euler="{mjcf.numbers(0, 0, angle + math.pi / 2)}"><freejoint/>'
                    f'<geom type="mesh" mesh="plank" mass="{self.mass!r}" friction="{self.mu!r}"'
                    f' condim="3" material="solid"'
                    f' rgba="{mjcf.shade(2 * level + i % 2, 2 * self.levels)}"/></body>'
                )
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            assets=[mjcf.block_mesh("plank", self.length, self.width, self.thickness)],
            tile=self.length,
        )
