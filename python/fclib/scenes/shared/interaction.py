"""Which shapes meet by which law, and what is driven: for scenes whose shapes have colours.

    scene.interactions, scene.drives

The laws are LMGC90's, with the gap g in the middle of a step, q + (1 - theta) h v:

IQS_CLB      a gap is closed at most, u_N + g / h >= 0; a penetration stays: u_N >= 0
GAP_SGR_CLB  u_N + g / h >= 0; a penetration is undone
VEL_SGR_CLB  u_N >= 0 if g <= 0; an open contact has no reaction
"""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass
from typing import Final

LAWS: Final = ("IQS_CLB", "GAP_SGR_CLB", "VEL_SGR_CLB")


@dataclass(frozen=True, kw_only=True)
class Interaction:
    """Two kinds of shapes that meet."""

    kinds: tuple[int, int]  # numbers of kinds, from 0; of elastic bodies: of faces
    mu: float  # coefficient of friction
    alert: float  # contacts have a gap of at most this [m]
    law: str  # one of LAWS

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise ValueError(f"the law is one of {', '.join(LAWS)}, not {self.law!r}")
        if not (self.mu >= 0 and self.alert >= 0):
            raise ValueError(
                f"friction and alert distance must be >= 0, not {self.mu}, {self.alert}"
            )


@dataclass(frozen=True, kw_only=True)
class Course:
    """A value that changes with time t.

    (constant + amplitude cos(omega t + phase)) min(1, ramp + ramp_rate t), or linear between two
    or more points (t, value), and beyond them as between the first two or the last two. So
    LMGC90's engine has it; its manual says that a ramp stays above -1, and the engine does not.
    """

    constant: float = 0.0
    amplitude: float = 0.0
    omega: float = 0.0  # [rad/s]
    phase: float = 0.0  # [rad]
    ramp: float = 1.0
    ramp_rate: float = 0.0  # [1/s]
    points: tuple[tuple[float, float], ...] = ()

    def at(self, time: float) -> float:
        """The value at a time [s]."""
        if self.points:
            i = bisect.bisect_right(self.points, time, key=lambda point: point[0])
            i = min(max(i, 1), len(self.points) - 1)
            (start, first), (end, last) = self.points[i - 1 : i + 1]
            return first + (last - first) * (time - start) / (end - start)
        wave = self.constant + self.amplitude * math.cos(self.omega * time + self.phase)
        return wave * min(1.0, self.ramp + self.ramp_rate * time)

    @property
    def is_zero(self) -> bool:
        """Whether it is 0 at all times."""
        if self.points:
            return not any(value for _, value in self.points)
        flat = not self.ramp and not self.ramp_rate
        return flat or not (self.constant or self.amplitude)


@dataclass(frozen=True, kw_only=True)
class Drive:
    """A degree of freedom of a scene whose velocity is given, or on which a force acts."""

    dof: int  # its place in v
    velocity: bool  # else a force
    course: Course  # [m/s], [rad/s], [N], [N m]
