"""Spheres squeezed between walls: with a solution, or proved to have none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter

SIDES = (1, 2, 4, 8)  # spheres along an edge
MARGINS = (1.0, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)  # in speeds of the walls


@dataclass(frozen=True, kw_only=True)
class Squeezed:
    """A cubic lattice of spheres in a closed box whose walls along x come together, or part.

    A row of spheres along x is k + 1 contacts between two walls that cannot move: the walls fix the
    sum of its normal velocities, to -s if they come together by s. All of them have to be >= 0: no
    solution exists, with or without friction, and normal reactions y = 1 along the row, which move
    nothing (H y = 0, w^T y = -s), prove it. With s < 0 there is one.

    Of each size the margin s goes from 1 to 1e-12 of the speed, each without and with a solution.
    """

    title: ClassVar[str] = "Squeezed spheres"
    description: ClassVar[str] = "Spheres between walls that come together, or part."
    application: ClassVar[str] = "existence of solutions"
    authors: ClassVar[str] = "the authors of FCLIB"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "existence"
    problems: ClassVar[int] = 2 * len(SIDES) * len(MARGINS)

    mu: float = parameter(0.5, "1", "coefficient of friction")
    speed: float = parameter(1.0, "m/s", "with which margins are multiplied")
    radius: float = parameter(0.01, "m", "radius of a sphere")

    def __post_init__(self) -> None:
        mjcf.check(self, positive=("speed", "radius"), non_negative=("mu",))

    def problem(self, number: int, seed: int = 0) -> Any:
        """By size, then margin, then without (even) and with a solution (odd)."""
        rest, parts = divmod(number, 2)
        size, margin = divmod(rest, len(MARGINS))
        return self.of_size(SIDES[size], MARGINS[margin] * self.speed * (-1 if parts else 1))

    def of_size(self, side: int, closing: float) -> Any:
        """side^3 spheres, the walls along x coming together at a speed `closing` [m/s]."""
        grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        centres: npt.NDArray[np.float64] = np.multiply(2 * self.radius, grid + 0.5)
        ids = np.arange(side**3).reshape(side, side, side)
        first, second, normals, points, w = [], [], [], [], []
        for axis in range(3):
            lines = np.moveaxis(ids, axis, -1).reshape(-1, side)
            unit = np.eye(3)[axis]
            for line in lines:
                for k in range(side + 1):
                    # from the wall or the sphere before to the sphere or the wall behind
                    a, b = (line[k - 1] if k else -1), (line[k] if k < side else -1)
                    forwards = b >= 0
                    first.append(a if forwards else -1)
                    second.append(b if forwards else a)
                    normals.append(unit if forwards else -unit)
                    body = line[k] if forwards else line[-1]
                    points.append(centres[body] - self.radius * unit * (1 if forwards else -1))
                    # the first contact has all of it: half of it for each wall would lose a digit
                    w.append(-closing if axis == 0 and k == 0 else 0.0)
        masses = np.full(side**3, 2500 * 4 / 3 * np.pi * self.radius**3)
        bodies = assembly.Bodies(
            masses=masses,
            inertias=np.repeat((0.4 * masses * self.radius**2)[:, None], 3, axis=1),
            centres=centres,
            first=np.array(first),
            second=np.array(second),
            normals=np.array(normals),
            points=np.array(points),
            impulses=np.zeros((side**3, 3)),
            kind="sphere",
            sizes=np.full((side**3, 3), self.radius),
            planes=self._planes(side),
        )
        word = "no solution" if closing > 0 else "a solution"
        problem = bodies.problem(self.mu, f"{side**3} spheres, {word}, margin {abs(closing):g} m/s")
        velocities = np.zeros(3 * len(w))
        velocities[0::3] = w
        return problem.replace(w=velocities)

    def _planes(self, side: int) -> npt.NDArray[np.float64]:
        """The six walls: a point of each and its normal, into the box."""
        low, high = np.zeros(3), np.full(3, 2 * self.radius * side)
        return np.concatenate(
            [
                np.hstack((np.tile(low, (3, 1)), np.eye(3))),
                np.hstack((np.tile(high, (3, 1)), -np.eye(3))),
            ]
        )

    @staticmethod
    def proof(side: int) -> Any:
        """Normal reactions y (nc) of the first row: H y = 0, w^T y = -s."""
        y = np.zeros(3 * side**2 * (side + 1))
        y[: side + 1] = 1.0
        return y
