"""A disc that slides and spins until both end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fclib.scenes.shared import mjcf, turning
from fclib.scenes.shared.family import parameter

STEPS = 30  # of each law, until what moves longest has stopped


@dataclass(frozen=True, kw_only=True)
class Spinner:
    """A disc on a floor, step by step of its motion until it rests.

    Its radius of gyration is mu_s / mu, so that both laws have a closed form. If sliding and spin
    share an ellipsoid, the speed (mu v, mu_s omega) keeps its direction and loses mu^2 g h in each
    step: both motions end together, as under a patch that obeys Coulomb's law point by point
    (Contensou). If each has a limit of its own, v loses mu g h, omega loses mu g h mu / mu_s, and
    they end one after the other.

    P. Contensou, Couplage entre frottement de glissement et frottement de pivotement dans la
      theorie de la toupie, in Kreiselprobleme, Springer, 1963.
    R. I. Leine, Ch. Glocker, A set-valued force law for spatial Coulomb-Contensou friction,
      European Journal of Mechanics A/Solids 22, 2003.
    """

    title: ClassVar[str] = "Spinner"
    description: ClassVar[str] = "A disc on a floor that slides and spins down, step by step."
    application: ClassVar[str] = "dynamics of rigid bodies"
    authors: ClassVar[str] = "the authors of FCLIB, after P. Contensou"
    friction: ClassVar[str] = "Coulomb and spin, as an ellipsoid and with limits of their own"
    collection: ClassVar[str] = "spin"
    problems: ClassVar[int] = 2 * STEPS

    mass: float = parameter(0.1, "kg", "mass of the disc")
    mu: float = parameter(0.3, "1", "coefficient of friction")
    mu_s: float = parameter(0.006, "m", "coefficient of spin friction")
    speed: float = parameter(0.5, "m/s", "velocity at first")
    heading: float = parameter(0.7, "rad", "direction of the velocity")
    spin: float = parameter(40.0, "rad/s", "angular velocity at first")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")

    def __post_init__(self) -> None:
        mjcf.check(self, positive=("mass", "mu", "mu_s", "speed", "spin", "gravity"))

    def lasting(self, coupled: int) -> float:
        """The time until the disc rests [s]."""
        sliding, spinning = self.mu * self.speed, self.mu_s * self.spin
        longest = np.hypot(sliding, spinning) if coupled else max(sliding, spinning)
        return float(longest / (self.mu**2 * self.gravity))

    def motion(self, number: int, time: float) -> tuple[float, float]:
        """V and omega at a time [m/s, rad/s]."""
        if number < STEPS:
            left = max(0.0, 1 - time / self.lasting(1))
            return left * self.speed, left * self.spin
        lost = self.mu**2 * self.gravity * time
        sliding, spinning = self.mu * self.speed - lost, self.mu_s * self.spin - lost
        return max(0.0, sliding) / self.mu, max(0.0, spinning) / self.mu_s

    def step(self, number: int) -> tuple[float, float]:
        """The times at the ends of a problem's step [s]; the disc rests after the last one."""
        h = self.lasting(int(number < STEPS)) / STEPS
        return h * (number % STEPS), h * (number % STEPS + 1)

    def problem(self, number: int, seed: int = 0) -> Any:
        """First the ellipsoid, then limits of their own, a step of the motion each."""
        begin, end = self.step(number)
        v, omega = self.motion(number, begin)
        axes = turning.frame((0.0, 0.0, 1.0), (np.cos(self.heading), np.sin(self.heading), 0.0))
        # the disc moves in its plane: v, omega_z, and v_z
        H = turning.columns(axes, (0.0, 0.0, 0.0), 4)[[0, 1, 2, 5]]
        masses = self.mass * np.array([1.0, 1.0, 1.0, (self.mu_s / self.mu) ** 2])
        way = v * axes[1]
        f = masses * np.array([way[0], way[1], -self.gravity * (end - begin), omega])
        coupled = int(number < STEPS)
        law = {"mu": np.array([self.mu]), "mu_s": np.array([self.mu_s]), "coupled": coupled}
        words = "ellipsoid" if coupled else "limits of their own"
        return turning.problem(masses, H, f, law, f"{words}, t = {begin:.4g} s")
