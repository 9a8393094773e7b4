"""A humanoid on uneven ground that holds a bar with both hands: loops through its arms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fclib.scenes.humanoid import Humanoid
from fclib.scenes.shared.family import parameter


@dataclass(frozen=True, kw_only=True)
class Carrier(Humanoid):
    """The humanoid of the family Humanoid with a bar in its hands, on blocks of drawn heights.

    Each hand is held to the bar by a bilateral constraint of three rows, so that trunk, arms and
    bar make a closed loop. Soles meet the edges of the blocks. It does not walk: the springs of
    its joints hold it near a crouch, and it stands or stumbles as the ground lets it.
    """

    title: ClassVar[str] = "Humanoid with a bar on uneven ground"
    description: ClassVar[str] = (
        "An articulated humanoid that holds a bar with both hands, dropped on uneven ground."
    )

    stones: int = parameter(0, "1", "stones under the feet, at least 0")
    roughness: float = parameter(0.03, "m", "largest height of the ground's blocks; 0: a floor")
    bar: float = parameter(8.0, "kg", "mass of a bar that both hands hold, two loops; 0: none")
