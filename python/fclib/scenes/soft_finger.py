"""Two soft fingers hold a rod by its end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fclib.scenes.shared import mjcf, turning
from fclib.scenes.shared.family import parameter

LOADS = 30  # steps of the moment that the pads can bear, for each law
MOST = 1.5  # largest of them, over the moment of the weight


@dataclass(frozen=True, kw_only=True)
class SoftFinger:
    """A horizontal rod between two pads at its end, one step from rest.

    One pad is fixed, the other one is pressed. With point contacts (mu_s = 0, the first problem of
    each law) the rod turns about the pads. With spin friction it hangs until its weight is too much
    for them. The laws: sliding and spin have a limit each, or share an ellipsoid.

    Let P be the impulse of the grip, W = m g h that of the weight, c the distance from the pads to
    the centre of mass, and J = m (3 a^2 + L^2) / 12 + m c^2. With limits of their own the rod hangs
    if W c <= 2 mu_s P. Else it turns about the pads at omega = (W c - 2 mu_s P) / J. With an
    ellipsoid it hangs if (W / mu)^2 + (W c / mu_s)^2 <= (2 P)^2.

    R. D. Howe, M. R. Cutkosky, Practical force-motion models for sliding manipulation,
      International Journal of Robotics Research 15, 1996.
    """

    title: ClassVar[str] = "Soft fingers"
    description: ClassVar[str] = "A rod that two pads hold by its end, with more and more friction."
    application: ClassVar[str] = "grasping"
    authors: ClassVar[str] = "the authors of FCLIB"
    friction: ClassVar[str] = "Coulomb and spin, with limits of their own and as an ellipsoid"
    collection: ClassVar[str] = "spin"
    problems: ClassVar[int] = 2 * LOADS

    mass: float = parameter(0.2, "kg", "mass of the rod")
    length: float = parameter(0.3, "m", "length of the rod")
    radius: float = parameter(0.01, "m", "radius of the rod")
    pad: float = parameter(0.05, "kg", "mass of the pad that is pressed")
    grip: float = parameter(20.0, "N", "force that presses it")
    mu: float = parameter(0.8, "1", "coefficient of friction")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(1e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self, positive=("mass", "length", "radius", "pad", "grip", "mu", "gravity", "time_step")
        )

    def mu_s(self, number: int) -> float:
        """The coefficient of spin friction of a problem [m]."""
        held = self.mass * self.gravity * self.arm / (2 * self.grip)
        return MOST * held * (number % LOADS) / (LOADS - 1)

    @property
    def arm(self) -> float:
        """The distance from the pads to the centre of mass [m]."""
        return self.length / 2

    def problem(self, number: int, seed: int = 0) -> Any:
        """First the laws with limits of their own, then the ellipsoids; mu_s from 0 on."""
        coupled = number // LOADS
        side = np.array([0.0, 1.0, 0.0])
        H = np.zeros((7, 8))
        for k, sign in enumerate((1.0, -1.0)):
            axes = turning.frame(sign * side, (0.0, 0.0, 1.0))
            place = (-self.arm, -sign * self.radius, 0.0)
            H[:6, 4 * k : 4 * k + 4] = turning.columns(axes, place, 4)
        # the second pad moves along y, against its normal
        H[6, 4:8] = [1.0, 0.0, 0.0, 0.0]
        across = self.mass * (3 * self.radius**2 + self.length**2) / 12
        along = self.mass * self.radius**2 / 2
        masses = np.array([self.mass] * 3 + [along, across, across, self.pad])
        f = np.zeros(7)
        f[2] = -self.mass * self.gravity * self.time_step
        f[6] = -self.grip * self.time_step
        mu_s = self.mu_s(number)
        law = {"mu": np.full(2, self.mu), "mu_s": np.full(2, mu_s), "coupled": coupled}
        words = "ellipsoid" if coupled else "limits of their own"
        return turning.problem(masses, H, f, law, f"{words}, mu_s = {mu_s:.4g} m")
