"""Velocities and forces that a scene gives: `Scene.drives`, over one step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fclib.scenes.shared.interaction import Drive
from fclib.simulate.arrays import Vector
from fclib.simulate.moreau_jean import Driven


@dataclass(frozen=True)
class Drives:
    """The drives of a model of n degrees of freedom."""

    drives: tuple[Drive, ...]
    size: int  # n

    @classmethod
    def of(cls, name: str, drives: Sequence[Drive], size: int) -> Drives | None:
        """Those of a scene; None if it has none. ValueError if one is of nothing."""
        for drive in drives:
            if not 0 <= drive.dof < size:
                raise ValueError(
                    f"{name}: a drive is of degree of freedom {drive.dof}, and there are {size}"
                )
        return cls(tuple(drives), size) if drives else None

    def driven(self, time: float) -> Driven | None:
        """The velocities at a time [s]; None if none is given."""
        mine = [drive for drive in self.drives if drive.velocity]
        if not mine:
            return None
        return Driven(
            np.array([drive.dof for drive in mine], dtype=np.int64),
            np.array([drive.course.at(time) for drive in mine]),
        )

    def force(self, time: float, h: float, theta: float) -> Vector:
        """The mean of the forces over a step from a time [s], by theta (n)."""
        total = np.zeros(self.size)
        for drive in self.drives:
            if not drive.velocity:
                start, end = drive.course.at(time), drive.course.at(time + h)
                total[drive.dof] += (1 - theta) * start + theta * end
        return total

    def begin(self, velocity: Vector, time: float) -> None:
        """Set the given ones among velocities (n) to those of a time."""
        now = self.driven(time)
        if now is not None:
            velocity[now.dof] = now.velocity
