"""Bodies that spin fast as they touch the ground and each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class SpinningBodies(Published):
    """Flat ellipsoids that fall spinning into a box.

    The gyroscopic moment is taken at the end of a step: M has h times its derivative, and neither M
    nor W is symmetric. The law on velocities is that of the other families.
    """

    title: ClassVar[str] = "Spinning bodies"
    description: ClassVar[str] = "Flat ellipsoids that fall spinning fast; W is not symmetric."
    application: ClassVar[str] = "multibody systems"
    collection: ClassVar[str] = "dynamics"
    problems: ClassVar[int] = 150

    bodies: int = parameter(48, "1", "number of bodies, at least 1")
    across: int = parameter(4, "1", "bodies of a layer along x and along y, at least 1")
    radius: float = parameter(0.1, "m", "largest half axis")
    flatness: float = parameter(0.4, "1", "smallest half axis, of the largest, in (0, 1]")
    density: float = parameter(2500.0, "kg/m^3", "mass density")
    mu: float = parameter(0.4, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    spin: float = parameter(150.0, "rad/s", "at the start, about any axis")
    gyroscopic: bool = parameter(True, "1", "whether M has the derivative of gyroscopic terms")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(1e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("radius", "flatness", "density", "time_step"),
            non_negative=("mu", "spin"),
            at_least={"bodies": 1, "across": 1},
        )
        if not self.flatness <= 1:
            raise ValueError(f"SpinningBodies: flatness must be <= 1, not {self.flatness}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws how bodies are turned and about what they spin."""
        random = np.random.Generator(np.random.PCG64(seed))
        turned = mjcf.rotations(random, self.bodies)
        axes = random.standard_normal(size=(self.bodies, 3))
        axes *= self.spin / np.linalg.norm(axes, axis=1, keepdims=True)
        pitch = 2.1 * self.radius
        bodies = mjcf.walls(0.5 * pitch * self.across, pitch * self.across, self.mu)
        sizes = mjcf.numbers(self.radius, 0.8 * self.radius, self.flatness * self.radius)
        for i in range(self.bodies):
            layer, cell = divmod(i, self.across**2)
            place = np.array([*divmod(cell, self.across), layer]) * pitch
            place[:2] -= 0.5 * pitch * (self.across - 1)
            place[2] += 1.05 * self.radius
            bodies.append(
                mjcf.grain(
                    f"body{i}",
                    place,
                    f'type="ellipsoid" size="{sizes}" density="{self.density!r}"',
                    mjcf.surface(self.mu),
                    mjcf.shade(i, self.bodies),
                    turned[i],
                )
            )
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            tile=4 * self.radius,
            velocity=np.column_stack((np.zeros_like(axes), axes)).ravel(),
        )
