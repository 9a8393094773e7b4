"""One wall whose contacts are there once, twice, up to 16 times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter

TIMES = (1, 2, 4, 8, 16)  # copies of each contact


@dataclass(frozen=True, kw_only=True)
class RepeatedContacts:
    """One pushed wall in running bond, each contact repeated, as collision detection may do.

    The velocities stay the same, W has the rank it had, and the reactions are the less unique.
    """

    title: ClassVar[str] = "Wall with repeated contacts"
    description: ClassVar[str] = (
        "A wall of blocks, one step from rest, with every contact repeated."
    )
    application: ClassVar[str] = "masonry"
    authors: ClassVar[str] = "the authors of FCLIB"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "ladder"
    problems: ClassVar[int] = len(TIMES)

    contacts: int = parameter(
        250, "1", "number of contacts before they are repeated, about; at least 4"
    )
    mu: float = parameter(0.6, "1", "coefficient of friction")
    push: float = parameter(0.5, "1", "impulse on the top course, in weights of all blocks")

    def __post_init__(self) -> None:
        mjcf.check(self, non_negative=("mu", "push"), at_least={"contacts": 4})

    def problem(self, number: int, seed: int = 0) -> Any:
        """The wall of TIMES[number]; the seed draws the masses."""
        times = TIMES[number]
        bodies = assembly.running_bond(self.contacts, seed, push=self.push).repeated(times)
        return bodies.problem(self.mu, f"each contact {times} times")
