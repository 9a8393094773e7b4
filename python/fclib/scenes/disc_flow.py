"""Discs in the plane that flow down a ramp against a wall."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class DiscFlow(Published):
    """Discs of a few sizes that begin on a grid above a ramp, flow down, and pile up before a wall.

    Bodies move in a vertical plane (n = 3 for each), and a contact has two components, N and T.
    """

    title: ClassVar[str] = "Flow of discs on a wall"
    description: ClassVar[str] = "Discs in a vertical plane that flow down a ramp against a wall."
    application: ClassVar[str] = "granular matter"
    friction: ClassVar[str] = "Coulomb in the plane, the same coefficient everywhere"
    collection: ClassVar[str] = "planar"
    problems: ClassVar[int] = 500

    discs: int = parameter(150, "1", "number of discs, at least 1")
    radius: float = parameter(0.05, "m", "largest radius of a disc")
    spread: float = parameter(0.3, "1", "the smallest radius is smaller by this share, in [0, 1)")
    density: float = parameter(1000.0, "kg/m^2", "mass of a square metre of disc")
    mu: float = parameter(0.4, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    per_row: int = parameter(10, "1", "discs of a row at the start, at least 1")
    slope: float = parameter(0.6, "rad", "angle of the ramp, in (0, pi/2)")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(4e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("radius", "density", "slope", "time_step"),
            non_negative=("mu", "spread"),
            at_least={"discs": 1, "per_row": 1},
        )
        if not self.spread < 1:
            raise ValueError(f"DiscFlow: spread must be < 1, not {self.spread}")
        if not self.slope < math.pi / 2:
            raise ValueError(f"DiscFlow: slope must be below pi/2, not {self.slope}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the radii and the offsets."""
        random = np.random.Generator(np.random.PCG64(seed))
        # a random row for each disc, all drawn at once: more discs begin like fewer
        draws = random.uniform(size=(self.discs, 3))
        radii = self.radius * (1 - self.spread * draws[:, 0])
        # offsets of a fifth of the radius leave no overlap
        pitch = 2.4 * self.radius
        # the ramp ends at x = 0, the wall stands at x = width / 2
        width = self.per_row * pitch
        rise = math.tan(self.slope)
        bodies = []
        for i, radius in enumerate(radii.tolist()):
            row, cell = divmod(i, self.per_row)
            dx, dz = 0.2 * self.radius * (2 * draws[i, 1:] - 1)
            x = -width + (cell + 0.5) * pitch
            # rows follow the ramp
            z = (row + 1.0) * pitch / math.cos(self.slope) - rise * x
            bodies.append(
                mjcf.disc(
                    f"disc{i}",
                    (x + dx, z + dz),
                    radius,
                    self.density,
                    f'friction="{self.mu!r}" condim="3" rgba="{mjcf.shade(i, self.discs)}"',
                )
            )
        end = 0.5 * width
        walls = [((-1.2 * width, 1.2 * rise * width), (0.0, 0.0)), ((end, 0.0), (end, 1.5 * end))]
        return Scene.of_bodies(
            self,
            seed,
            bodies=[*bodies, *mjcf.lines(walls, f'friction="{self.mu!r}"')],
            tile=4 * self.radius,
            planar=True,
        )
