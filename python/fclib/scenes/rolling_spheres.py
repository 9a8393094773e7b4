"""A pile of spheres with rolling friction, poured on a floor."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class RollingSpheres(Published):
    """Spheres of a few sizes that fall in a column and spread into a heap.

    Without rolling friction they would roll away; with it the heap keeps a slope. A contact has
    five components: N, T1, T2 and the rolling moments R1, R2.

    The law is that of V. Acary and F. Bourrier, Coulomb friction with rolling resistance as a cone
    complementarity problem, European Journal of Mechanics A/Solids 85, 2021.
    """

    title: ClassVar[str] = "Rolling spheres"
    description: ClassVar[str] = "Spheres poured on a horizontal floor, with rolling friction."
    application: ClassVar[str] = "granular matter"
    friction: ClassVar[str] = "Coulomb and rolling, the same coefficients everywhere"
    collection: ClassVar[str] = "rolling"
    problems: ClassVar[int] = 500

    spheres: int = parameter(100, "1", "number of spheres, at least 1")
    radius: float = parameter(0.05, "m", "largest radius of a sphere")
    spread: float = parameter(0.3, "1", "the smallest radius is smaller by this share, in [0, 1)")
    density: float = parameter(2500.0, "kg/m^3", "mass density")
    mu: float = parameter(0.5, "1", "coefficient of friction")
    mu_r: float = parameter(0.015, "m", "coefficient of rolling friction")
    mixed: float = parameter(0.0, "1", "deviation of ln(mu) and of ln(mu_r), drawn for each sphere")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    per_layer: int = parameter(9, "1", "spheres of a layer of the column, a square number")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(4e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("radius", "density", "time_step"),
            non_negative=("mu", "mu_r", "mixed", "spread"),
            at_least={"spheres": 1, "per_layer": 1},
        )
        if not self.spread < 1:
            raise ValueError(f"RollingSpheres: spread must be < 1, not {self.spread}")
        if math.isqrt(self.per_layer) ** 2 != self.per_layer:
            raise ValueError(f"RollingSpheres: per_layer must be a square, not {self.per_layer}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the radii, the offsets and the coefficients."""
        random = np.random.Generator(np.random.PCG64(seed))
        # a random row for each sphere, all drawn at once: more spheres begin like fewer
        draws = random.uniform(size=(self.spheres, 3))
        radii = self.radius * (1 - self.spread * draws[:, 0])
        # after all others, so that these stay; a contact has the larger of its two
        factors = np.exp(self.mixed * random.standard_normal(size=(self.spheres, 2)))
        side = math.isqrt(self.per_layer)
        # offsets of a fifth of the radius leave no overlap
        pitch = 2.4 * self.radius
        bodies = []
        for i, radius in enumerate(radii.tolist()):
            layer, cell = divmod(i, self.per_layer)
            place = np.array([cell % side, cell // side]) - 0.5 * (side - 1)
            x, y = pitch * place + 0.2 * self.radius * (2 * draws[i, 1:] - 1)
            z = self.radius + layer * pitch
            mu, mu_r = (factors[i] * (self.mu, self.mu_r)).tolist()
            bodies.append(
                f'<body name="sphere{i}" pos="{mjcf.numbers(x, y, z)}"><freejoint/>'
                f'<geom type="sphere" size="{radius!r}" density="{self.density!r}"'
                f' friction="{mu!r} 0 {mu_r!r}" condim="6" material="solid"'
                f' rgba="{mjcf.shade(i, self.spheres)}"/></body>'
            )
        return Scene.of_bodies(
            self, seed, bodies=bodies, tile=4 * self.radius, condim=6, floor_mu_r=self.mu_r
        )
