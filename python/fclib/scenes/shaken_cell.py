"""Polyhedra that fall on a floor that shakes and sinks, in a periodic cell; after a deck."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from fclib.scenes.shared import deck_made, mjcf
from fclib.scenes.shared.family import Scene, parameter
from fclib.scenes.shared.interaction import Course

FLOOR: Final = 0.06  # half thickness of the floor [m]


@dataclass(frozen=True, kw_only=True)
class ShakenCell:
    """Equal polyhedra of eight corners, dropped one above the other in two columns.

    After the deck 100_PR_PerioBox of V. Acary and the developers of LMGC90: its polyhedron, the
    places at the start, the floor and its motion, periods, friction, alert distances, step and
    theta. The floor's half edges are rounded.
    """

    title: ClassVar[str] = "Polyhedra in a shaken cell"
    description: ClassVar[str] = (
        "Polyhedra fall on a floor that shakes and sinks, in a periodic cell, after the LMGC90"
        " deck 100_PR_PerioBox."
    )
    application: ClassVar[str] = "granular matter"
    authors: ClassVar[str] = "V. Acary, the developers of LMGC90"
    friction: ClassVar[str] = "Coulomb, one coefficient between polyhedra, one on the floor"
    collection: ClassVar[str] = "decks"
    problems: ClassVar[int] = 800

    polyhedra: int = parameter(100, "1", "number of polyhedra, at least 1")
    edge: float = parameter(6.0, "m", "edge of the square, and height, of a polyhedron")
    ridge: float = parameter(2.535898, "m", "length of its ridges above and below the square")
    period: float = parameter(25.0, "m", "edge of the cell, along x and along y")
    density: float = parameter(5800.0, "kg/m^3", "mass density")
    mu: float = parameter(0.3, "1", "coefficient of friction between polyhedra")
    mu_floor: float = parameter(0.5, "1", "coefficient of friction on the floor")
    alert: float = parameter(0.3, "m", "alert distance between polyhedra")
    alert_floor: float = parameter(0.1, "m", "alert distance to the floor")
    shake: float = parameter(0.08, "m/s", "amplitude of the floor's velocity along x and y")
    omega: float = parameter(0.5, "rad/s", "of the floor's velocity")
    sink: float = parameter(0.1, "m/s", "speed of the floor downwards")
    restitution: float = parameter(0.0, "1", "0: the law IQS_CLB is inelastic")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    theta: float = parameter(0.5, "1", "theta of the scheme, in [1/2, 1]")
    time_step: float = parameter(0.02, "s", "time step h")

    # of a scene of this kind that is quickly simulated
    small: ClassVar[Mapping[str, Any]] = {"polyhedra": 6}

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("edge", "density", "time_step"),
            non_negative=("mu", "mu_floor", "alert", "alert_floor", "ridge", "shake", "omega"),
            at_least={"polyhedra": 1, "period": 2.1 * self.edge},
        )
        if self.restitution:
            raise ValueError(f"ShakenCell: restitution must be 0, not {self.restitution}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; nothing of it is random."""
        a, b = 0.5 * self.edge, 0.5 * self.ridge
        square = [(a, -a, 0), (a, a, 0), (-a, a, 0), (-a, -a, 0)]
        corners = [*square, (b, 0, a), (-b, 0, a), (b, 0, -a), (-b, 0, -a)]
        radius = math.sqrt(2) * a
        # two columns, one after the other, along a diagonal of space
        pitch = radius * np.array([0.866025, 1.0, 1.802776])
        bodies = [
            deck_made.body(radius + pitch * (i % 2, i % 2, i), "POLYR", "BLEUx", vertices=corners)
            for i in range(self.polyhedra)
        ]
        middle = radius + 0.5 * pitch[:2]
        floor = (1.01 * self.period, 1.01 * self.period, FLOOR)
        bodies.append(deck_made.body((*middle, -FLOOR), "PLANx", "VERTx", floor))
        wave = Course(amplitude=self.shake, omega=self.omega, phase=0.5 * math.pi)
        courses = {0: wave, 1: wave, 2: Course(constant=-self.sink)}
        return deck_made.scene(
            self,
            seed,
            rigid=bodies,
            sees=[
                (("POLYR", "BLEUx"), ("POLYR", "BLEUx"), self.mu, self.alert),
                (("POLYR", "BLEUx"), ("PLANx", "VERTx"), self.mu_floor, self.alert_floor),
            ],
            driven=deck_made.held(self.polyhedra, courses),
            period=(self.period, self.period),
            focus=(0.0, 0.0, 0.5 * self.period, 0.6 * self.period),
        )
