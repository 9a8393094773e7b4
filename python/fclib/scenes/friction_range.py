"""One wall with coefficients of friction of 0 to 10."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter

COEFFICIENTS = (0.0, 0.01, 0.1, 0.3, 0.6, 1.0, 2.0, 5.0, 10.0)  # mu


@dataclass(frozen=True, kw_only=True)
class FrictionRange:
    """One pushed wall in running bond, from no friction to more than any material has.

    At mu = 0 the cone is a half-line; the larger mu, the stronger the coupling of normal and
    tangential parts, and the further the law is from an optimisation problem.
    """

    title: ClassVar[str] = "Wall with another friction"
    description: ClassVar[str] = (
        "A wall of blocks, one step from rest, with one of several coefficients of friction."
    )
    application: ClassVar[str] = "masonry"
    authors: ClassVar[str] = "the authors of FCLIB"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "ladder"
    problems: ClassVar[int] = len(COEFFICIENTS)
    # parameters of a small wall, which is solved quickly
    small: ClassVar[Mapping[str, Any]] = {"contacts": 40}

    contacts: int = parameter(250, "1", "number of contacts, about; at least 4")
    push: float = parameter(0.5, "1", "impulse on the top course, in weights of all blocks")

    def __post_init__(self) -> None:
        mjcf.check(self, non_negative=("push",), at_least={"contacts": 4})

    def problem(self, number: int, seed: int = 0) -> Any:
        """The wall of COEFFICIENTS[number]; the seed draws the masses."""
        mu = COEFFICIENTS[number]
        bodies = assembly.running_bond(self.contacts, seed, push=self.push)
        return bodies.problem(mu, f"mu = {mu:g}")
