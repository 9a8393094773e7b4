"""A screwdriver on a screw on a plate: two contacts in a row that transmit a torque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fclib.scenes.shared import mjcf, turning
from fclib.scenes.shared.family import parameter

TORQUES, GRIPS = 10, 6


@dataclass(frozen=True, kw_only=True)
class Screwdriver:
    """A driver is pressed on a screw and turned, one step from rest.

    The tip transmits at most mu_s P by its spin friction, P the axial impulse; the screw turns if
    this exceeds what holds it, b P. The handle is also pushed sideways, which the tip bears by its
    friction and by its rolling friction. Let T be the impulse of the torque, and J1, J2 the moments
    of inertia about the axis of the driver and the screw. Then

      nothing turns                               if T <= mu_s P and T <= b P
      the driver slips, (T - mu_s P) / J1         if mu_s <= b and T > mu_s P
      both turn together, (T - b P) / (J1 + J2)   if the tip bears T - J1 omega
      each turns, (T - mu_s P) / J1 and (mu_s - b) P / J2   else
    """

    title: ClassVar[str] = "Screwdriver"
    description: ClassVar[str] = "A screwdriver on a screw, torques and grips from small to large."
    application: ClassVar[str] = "manipulation"
    authors: ClassVar[str] = "the authors of FCLIB"
    friction: ClassVar[str] = "Coulomb, spin and rolling, with limits of their own"
    collection: ClassVar[str] = "spin"
    problems: ClassVar[int] = TORQUES * GRIPS

    mass: float = parameter(0.1, "kg", "mass of the driver")
    length: float = parameter(0.2, "m", "length of the driver")
    radius: float = parameter(0.012, "m", "radius of gyration of the driver about its axis")
    screw: float = parameter(0.05, "kg", "mass of the screw, and of what turns with it")
    head: float = parameter(0.012, "m", "radius of gyration of the screw, about all axes")
    height: float = parameter(0.02, "m", "length of the screw")
    push: float = parameter(40.0, "N", "axial force")
    aside: float = parameter(0.5, "N", "force on the handle, across the axis")
    mu: float = parameter(0.4, "1", "coefficient of friction")
    mu_r: float = parameter(0.004, "m", "coefficient of rolling friction")
    bound: float = parameter(0.002, "m", "coefficient of spin friction of the screw on the plate")
    time_step: float = parameter(1e-3, "s", "time step h")

    def __post_init__(self) -> None:
        positive = ("mass", "length", "radius", "screw", "head", "height", "push", "time_step")
        mjcf.check(self, positive=positive, non_negative=("aside", "mu", "mu_r", "bound"))

    def load(self, number: int) -> tuple[float, float]:
        """The torque [N m], and mu_s of the tip [m]."""
        torque, grip = divmod(number, GRIPS)
        return (
            2.5 * self.bound * self.push * (torque + 0.5) / TORQUES,
            2 * self.bound * grip / (GRIPS - 1),
        )

    def speeds(self, number: int) -> tuple[float, float]:
        """The angular velocities of driver and screw after the step [rad/s]."""
        torque, mu_s = self.load(number)
        T, P = torque * self.time_step, self.push * self.time_step
        own, other = self.mass * self.radius**2, self.screw * self.head**2
        if min(mu_s, self.bound) * P >= T:
            return 0.0, 0.0
        if mu_s <= self.bound:
            return (T - mu_s * P) / own, 0.0
        together = (T - self.bound * P) / (own + other)
        if T - own * together <= mu_s * P:
            return together, together
        return (T - mu_s * P) / own, (mu_s - self.bound) * P / other

    def problem(self, number: int, seed: int = 0) -> Any:
        """Torques, with grips of the tip for each."""
        torque, mu_s = self.load(number)
        h = self.time_step
        axes = turning.frame((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
        middle = self.length / 2, self.height / 2
        H = np.zeros((12, 12))
        # the driver on the screw, and the screw on the plate
        H[:6, :6] = turning.columns(axes, (0.0, 0.0, -middle[0]), 6)
        H[6:, :6] = -turning.columns(axes, (0.0, 0.0, middle[1]), 6)
        H[6:, 6:] = turning.columns(axes, (0.0, 0.0, -middle[1]), 6)
        across = self.mass * self.length**2 / 12
        masses = np.concatenate(
            (
                [self.mass] * 3 + [across, across, self.mass * self.radius**2],
                [self.screw] * 3 + [self.screw * self.head**2] * 3,
            )
        )
        f = np.zeros(12)
        # the force is at the end of the handle: its moment about the centre is about y
        f[:6] = [self.aside * h, 0.0, -self.push * h, 0.0, self.aside * h * middle[0], torque * h]
        law = {
            "mu": np.full(2, self.mu),
            "mu_s": np.array([mu_s, self.bound]),
            "mu_r": np.full(2, self.mu_r),
        }
        title = f"torque {torque:.4g} N m, mu_s = {mu_s:.4g} m"
        return turning.problem(masses, H, f, law, title)
