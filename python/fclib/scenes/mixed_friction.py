"""Walls whose contacts have friction of their own: drawn, or ice and rubber by courses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter

SIZES = (30, 100, 300, 1000)
SPREADS = (0.0, 0.5, 1.0, 2.0)  # of ln(mu)
ICE, RUBBER = 0.02, 1.2


@dataclass(frozen=True, kw_only=True)
class MixedFriction:
    """A wall of blocks, pushed at the top, with another coefficient of friction at each contact.

    There are five walls of each size. For four of them ln(mu) is drawn from a normal distribution
    about ln of the median, with a spread that grows from wall to wall. The fifth has joints of ice
    and of rubber in turn.
    """

    title: ClassVar[str] = "Mixed friction"
    description: ClassVar[str] = "A pushed wall of blocks, the coefficient of friction by contact."
    application: ClassVar[str] = "masonry"
    authors: ClassVar[str] = "the authors of FCLIB"
    friction: ClassVar[str] = "Coulomb, the coefficient of each contact drawn, or by its joint"
    collection: ClassVar[str] = "dynamics"
    problems: ClassVar[int] = len(SIZES) * (len(SPREADS) + 1)

    median: float = parameter(0.5, "1", "of the coefficients that are drawn")
    push: float = parameter(0.1, "1", "impulse on the top course, in weights of all blocks")

    def __post_init__(self) -> None:
        mjcf.check(self, positive=("median",), non_negative=("push",))

    def problem(self, number: int, seed: int = 0) -> Any:
        """By size, then spread; the seed draws masses and coefficients."""
        size, kind = divmod(number, len(SPREADS) + 1)
        bodies = assembly.running_bond(SIZES[size], seed, push=self.push)
        random = np.random.Generator(np.random.PCG64([seed, number]))
        if kind < len(SPREADS):
            drawn = random.standard_normal(len(bodies.normals))
            factors = assembly.exponentials(SPREADS[kind] * drawn)
            if seed == 0:
                factors = assembly.as_published(f"MixedFriction/{number}", factors)
            mu = self.median * factors
            return bodies.problem(mu, f"{len(mu)} contacts, spread {SPREADS[kind]:g}")
        mu = np.where(np.rint(bodies.points[:, 2]) % 2 == 0, RUBBER, ICE)
        return bodies.problem(mu, f"{len(mu)} contacts, ice and rubber")
