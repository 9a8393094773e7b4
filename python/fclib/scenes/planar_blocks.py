"""A wall of blocks in the plane, struck by a disc."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class PlanarBlocks(Published):
    """Blocks in running bond that settle, a small gap below each course, until a disc strikes them.

    Bodies move in a vertical plane (n = 3 for each), and two blocks touch in the two ends of what
    their edges share. Standing, the wall is hyperstatic.
    """

    title: ClassVar[str] = "Wall of blocks in the plane"
    description: ClassVar[str] = "Blocks in running bond in a vertical plane, struck by a disc."
    application: ClassVar[str] = "masonry"
    friction: ClassVar[str] = "Coulomb in the plane, the same coefficient everywhere"
    collection: ClassVar[str] = "planar"
    problems: ClassVar[int] = 400

    courses: int = parameter(10, "1", "number of courses, at least 1")
    blocks: int = parameter(5, "1", "blocks of a course, at least 1; a half more in every second")
    length: float = parameter(0.4, "m", "length of a block")
    height: float = parameter(0.2, "m", "height of a block")
    density: float = parameter(400.0, "kg/m^2", "mass of a square metre of block")
    mu: float = parameter(0.6, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    gap: float = parameter(1e-3, "m", "clearance below each course and between neighbours")
    offset: float = parameter(2e-4, "m", "largest offset of a block along x")
    disc_radius: float = parameter(0.3, "m", "radius of the disc; 0: no disc")
    disc_speed: float = parameter(6.0, "m/s", "speed of the disc at the start, along x")
    delay: float = parameter(0.2, "s", "time in which the disc would reach the wall at that speed")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(2e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("length", "height", "density", "time_step"),
            non_negative=("mu", "gap", "offset", "disc_radius", "disc_speed", "delay"),
            at_least={"courses": 1, "blocks": 1},
        )
        if not self.offset <= 0.5 * self.gap:
            raise ValueError(f"PlanarBlocks: offset must be at most gap / 2, not {self.offset}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the offsets."""
        random = np.random.Generator(np.random.PCG64(seed))
        draws = random.uniform(-self.offset, self.offset, size=(self.courses, self.blocks + 1))
        pitch = self.length + self.gap
        half = 0.5 * (self.length - self.gap)
        look = f'friction="{self.mu!r}" condim="3"'
        bodies = []
        for course in range(self.courses):
            z = (course + 0.5) * self.height + (course + 1) * self.gap
            bonded = course % 2
            for i in range(self.blocks + bonded):
                x = (i - 0.5 * (self.blocks - 1 + bonded)) * pitch + draws[course, i]
                # every second course ends in half blocks
                first, last = bonded and i == 0, bonded and i == self.blocks
                x += 0.25 * pitch * (first - last)
                bodies.append(
                    mjcf.block(
                        f"block{course}.{i}",
                        (x, z),
                        "half" if first or last else "block",
                        self.density * (half if first or last else self.length) * self.height,
                        f'{look} rgba="{mjcf.shade(2 * course + i % 2, 2 * self.courses)}"',
                    )
                )
        velocity = np.zeros((len(bodies), 3))
        if self.disc_radius:
            away = self.disc_speed * self.delay + 0.5 * (self.blocks + 1) * pitch
            place = (-away - self.disc_radius, self.courses * self.height * 0.8)
            bodies.append(
                mjcf.disc(
                    "disc", place, self.disc_radius, self.density, f'{look} rgba="0.35 0.37 0.42 1"'
                )
            )
            # thrown so high that it comes down at the place of its start
            up = 0.5 * self.gravity * self.delay
            velocity = np.vstack((velocity, [self.disc_speed, up, 0.0]))
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            assets=[
                mjcf.block_mesh("block", self.length, self.height, self.height),
                mjcf.block_mesh("half", half, self.height, self.height),
            ],
            tile=self.length,
            velocity=velocity.ravel(),
            planar=True,
        )
