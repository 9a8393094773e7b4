"""One wall in units from mm to km and from g to t."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter

LENGTHS = (1e-3, 1.0, 1e3)  # unit of length [m]
MASSES = (1e-3, 1.0, 1e3)  # unit of mass [kg]


@dataclass(frozen=True, kw_only=True)
class Units:
    """One pushed wall in running bond, whose numbers are those of other units.

    The mechanics is the same for all. The unit of length changes the scale of moments relative to
    forces, and the unit of mass that of reactions relative to velocities.
    """

    title: ClassVar[str] = "Wall in other units"
    description: ClassVar[str] = (
        "A wall of blocks, one step from rest, in one of nine systems of units."
    )
    application: ClassVar[str] = "masonry"
    authors: ClassVar[str] = "the authors of FCLIB"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "ladder"
    problems: ClassVar[int] = len(LENGTHS) * len(MASSES)

    contacts: int = parameter(250, "1", "number of contacts, about; at least 4")
    mu: float = parameter(0.6, "1", "coefficient of friction")
    push: float = parameter(0.5, "1", "impulse on the top course, in weights of all blocks")

    def __post_init__(self) -> None:
        mjcf.check(self, non_negative=("mu", "push"), at_least={"contacts": 4})

    def problem(self, number: int, seed: int = 0) -> Any:
        """The wall in LENGTHS[number // 3] and MASSES[number % 3]; the seed draws the masses."""
        length, mass = LENGTHS[number // len(MASSES)], MASSES[number % len(MASSES)]
        bodies = assembly.running_bond(self.contacts, seed, push=self.push)
        return bodies.in_units(length, mass).problem(
            self.mu, f"unit of length {length:g} m, of mass {mass:g} kg"
        )
