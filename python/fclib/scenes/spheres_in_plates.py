"""Spheres of three sizes that fall into an open box of plates, after a deck of LMGC90."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from fclib.scenes.shared import deck_made, mjcf
from fclib.scenes.shared.family import Scene, parameter

PLATE: Final = 0.00345  # half thickness of a plate [m]


@dataclass(frozen=True, kw_only=True)
class SpheresInPlates:
    """Spheres of 5, 10 and 15 mm on a lattice of 30 mm, in a box of smooth plates.

    After the deck 945_SP_Box_PL of V. Acary and the developers of LMGC90: its lattice, sizes of
    spheres, plates, friction, alert distances, step and theta. Which sphere has which size is drawn
    here: a third of each, as there.
    """

    title: ClassVar[str] = "Spheres in a box of plates"
    description: ClassVar[str] = (
        "Spheres of three sizes fall into an open box, after the LMGC90 deck 945_SP_Box_PL."
    )
    application: ClassVar[str] = "granular matter"
    authors: ClassVar[str] = "V. Acary, the developers of LMGC90; the sizes' order is chosen here"
    friction: ClassVar[str] = "Coulomb between spheres, none on the plates"
    collection: ClassVar[str] = "decks"
    problems: ClassVar[int] = 500

    columns: int = parameter(15, "1", "spheres along x, at least 1")
    rows: int = parameter(9, "1", "spheres along y, at least 1")
    layers: int = parameter(7, "1", "layers of spheres, at least 1")
    pitch: float = parameter(0.03, "m", "distance of neighbours in a layer")
    density: float = parameter(580.0, "kg/m^3", "mass density of the spheres")
    mu: float = parameter(0.8, "1", "coefficient of friction between spheres")
    mu_plate: float = parameter(0.0, "1", "coefficient of friction on the plates")
    alert: float = parameter(0.01, "m", "alert distance between spheres")
    alert_plate: float = parameter(5e-5, "m", "alert distance to the plates")
    restitution: float = parameter(0.0, "1", "0: the law IQS_CLB is inelastic")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    theta: float = parameter(0.5, "1", "theta of the scheme, in [1/2, 1]")
    time_step: float = parameter(2e-3, "s", "time step h")

    # of a scene of this kind that is quickly simulated
    small: ClassVar[Mapping[str, Any]] = {"columns": 3, "rows": 2, "layers": 2}

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("pitch", "density", "time_step"),
            non_negative=("mu", "mu_plate", "alert", "alert_plate"),
            at_least={"columns": 1, "rows": 1, "layers": 1},
        )
        if self.restitution:
            raise ValueError(f"SpheresInPlates: restitution must be 0, not {self.restitution}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the size of each sphere."""
        random = np.random.Generator(np.random.PCG64(seed))
        a = self.pitch
        radii = (
            a
            * np.array([1 / 6, 1 / 3, 1 / 2])[
                random.integers(3, size=self.layers * self.columns * self.rows)
            ]
        )
        places = np.array(
            [
                (
                    0.5 * a + a * math.sqrt(3) / 2 * (i + 0.5 * (k % 2)),
                    0.5 * a + a * (j + 0.5 * ((i + k) % 2)),
                    0.5 * a + a * math.sqrt(13) / 4 * k,
                )
                for k in range(self.layers)
                for i in range(self.columns)
                for j in range(self.rows)
            ]
        )
        # the box holds the lattice, with room for half a sphere on each side
        x, y, z = places.max(axis=0) + 0.5 * a
        bodies = [
            deck_made.body(place, "SPHER", "BLEUx", (radius,))
            for place, radius in zip(places, radii, strict=True)
        ]
        first = len(bodies)
        up = np.eye(3)
        # the third axis of a plate looks inwards
        plates = [
            ((-PLATE, y / 2, z / 2), up[[2, 1, 0]] * ((-1,), (1,), (1,))),
            ((x + PLATE, y / 2, z / 2), up[[2, 1, 0]] * ((1,), (1,), (-1,))),
            ((x / 2, y + PLATE, z / 2), up[[0, 2, 1]] * ((1,), (1,), (-1,))),
            ((x / 2, -PLATE, z / 2), up[[0, 2, 1]] * ((-1,), (1,), (1,))),
            ((x / 2, y / 2, -PLATE), up),
        ]
        size = (max(x, y), max(x, y), PLATE)
        bodies += [deck_made.body(place, "PLANx", "VERTx", size) for place, _ in plates]
        numbers = range(first, len(bodies))
        return deck_made.scene(
            self,
            seed,
            rigid=bodies,
            sees=[
                (("SPHER", "BLEUx"), ("PLANx", "VERTx"), self.mu_plate, self.alert_plate),
                (("SPHER", "BLEUx"), ("SPHER", "BLEUx"), self.mu, self.alert),
            ],
            starts={
                i: deck_made.turned(rows.T) for i, (_, rows) in zip(numbers, plates, strict=True)
            },
            driven=[drive for i in numbers for drive in deck_made.held(i)],
            focus=(x / 2, y / 2, z / 2, 0.6 * max(x, y)),
        )
