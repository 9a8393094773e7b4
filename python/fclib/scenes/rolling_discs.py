"""A heap of discs in the plane, with rolling friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class RollingDiscs(Published):
    """Discs of a few sizes that fall in a column and spread into a heap on a rough floor.

    Bodies move in a vertical plane (n = 3 for each). A contact has three components: N, T and the
    rolling moment R. Without it the discs would roll away.

    The law is that of V. Acary and F. Bourrier, Coulomb friction with rolling resistance as a cone
    complementarity problem, European Journal of Mechanics A/Solids 85, 2021, in the plane.
    """

    title: ClassVar[str] = "Rolling discs"
    description: ClassVar[str] = "Discs poured on a floor in a vertical plane, rolling friction."
    application: ClassVar[str] = "granular matter"
    friction: ClassVar[str] = "Coulomb and rolling in the plane, the same coefficients everywhere"
    collection: ClassVar[str] = "planar"
    problems: ClassVar[int] = 350

    discs: int = parameter(80, "1", "number of discs, at least 1")
    radius: float = parameter(0.05, "m", "largest radius of a disc")
    spread: float = parameter(0.3, "1", "the smallest radius is smaller by this share, in [0, 1)")
    density: float = parameter(1000.0, "kg/m^2", "mass of a square metre of disc")
    mu: float = parameter(0.5, "1", "coefficient of friction")
    mu_r: float = parameter(0.01, "m", "coefficient of rolling friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    per_row: int = parameter(8, "1", "discs of a row at the start, at least 1")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(4e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("radius", "density", "time_step"),
            non_negative=("mu", "mu_r", "spread"),
            at_least={"discs": 1, "per_row": 1},
        )
        if not self.spread < 1:
            raise ValueError(f"RollingDiscs: spread must be < 1, not {self.spread}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the radii and the offsets."""
        random = np.random.Generator(np.random.PCG64(seed))
        # a random row for each disc, all drawn at once: more discs begin like fewer
        draws = random.uniform(size=(self.discs, 3))
        radii = self.radius * (1 - self.spread * draws[:, 0])
        # offsets of a fifth of the radius leave no overlap
        pitch = 2.4 * self.radius
        bodies = []
        for i, radius in enumerate(radii.tolist()):
            row, cell = divmod(i, self.per_row)
            dx, dz = 0.2 * self.radius * (2 * draws[i, 1:] - 1)
            # every second row lies over the gaps of the one below
            x = (cell - 0.5 * (self.per_row - 1) + 0.5 * (row % 2)) * pitch
            place = (x + dx, (row + 0.6) * pitch + dz)
            bodies.append(
                mjcf.disc(
                    f"disc{i}",
                    place,
                    radius,
                    self.density,
                    f'friction="{self.mu!r} 0 {self.mu_r!r}" condim="6"'
                    f' rgba="{mjcf.shade(i, self.discs)}"',
                )
            )
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            tile=4 * self.radius,
            condim=6,
            floor_mu_r=self.mu_r,
            planar=True,
        )
