"""A wall whose courses grow heavier upwards, by ratios of 1 to a million."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter

RATIOS = (1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6)  # of the top course to the lowest


@dataclass(frozen=True, kw_only=True)
class MassRatios:
    """One pushed wall in running bond, the masses of its courses in geometric progression.

    Splitting methods suffer most from heavy bodies on light ones: an error in a light body below
    means an error in the heavy one above that is larger by the ratio of the masses.
    """

    title: ClassVar[str] = "Wall with heavy courses on light ones"
    description: ClassVar[str] = (
        "A wall of blocks, one step from rest; its courses grow heavier upwards."
    )
    application: ClassVar[str] = "masonry"
    authors: ClassVar[str] = "the authors of FCLIB"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "ladder"
    problems: ClassVar[int] = len(RATIOS)

    contacts: int = parameter(250, "1", "number of contacts, about; at least 4")
    mu: float = parameter(0.6, "1", "coefficient of friction")
    push: float = parameter(0.5, "1", "impulse on the top course, in weights of all blocks")

    def __post_init__(self) -> None:
        mjcf.check(self, non_negative=("mu", "push"), at_least={"contacts": 4})

    def problem(self, number: int, seed: int = 0) -> Any:
        """The wall of RATIOS[number]; the seed draws the masses."""
        ratio = RATIOS[number]
        bodies = assembly.running_bond(self.contacts, seed, push=self.push, ratio=ratio)
        return bodies.problem(self.mu, f"mass ratio {ratio:g}")
