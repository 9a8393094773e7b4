"""Walls of blocks from 4 to some 100,000 contacts, assembled directly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter


@dataclass(frozen=True, kw_only=True)
class Wall:
    """A wall in running bond, one step from rest, in growing sizes; every second one is pushed.

    Four contacts for each pair of faces make it hyperstatic. A pushed wall has an impulse on the
    end of its top course, as large as the weight of the whole wall in that step.
    """

    title: ClassVar[str] = "Wall"
    description: ClassVar[str] = (
        "A wall of blocks in running bond on the ground, one step from rest."
    )
    application: ClassVar[str] = "masonry"
    authors: ClassVar[str] = "the authors of FCLIB"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "ladder"
    problems: ClassVar[int] = 2 * len(assembly.SIZES)

    mu: float = parameter(0.6, "1", "coefficient of friction")
    push: float = parameter(1.0, "1", "impulse on every second wall, in weights of all its blocks")

    def __post_init__(self) -> None:
        mjcf.check(self, non_negative=("mu", "push"))

    def problem(self, number: int, seed: int = 0) -> Any:
        """Sizes of `assembly.SIZES`, each at rest and pushed; the seed draws the masses."""
        size, pushed = divmod(number, 2)
        return self.of_size(assembly.SIZES[size], self.push if pushed else 0.0, seed)

    def of_size(self, contacts: int, push: float, seed: int = 0) -> Any:
        """A wall of about so many contacts."""
        bodies = assembly.running_bond(contacts, seed, push=push)
        return bodies.problem(self.mu, f"{len(bodies.masses)} blocks, push {push:g}")
