"""A low wall of stones laid dry in English bond, pushed over by a ram."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

from fclib.scenes.shared import masonry, mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class LowWall(Published):
    """A wall two stones thick: courses of headers between courses of stretchers, laid dry.

    A stone rests on three or four others and touches its neighbours, each in four points: the
    problem has seven times as many contact components as degrees of freedom. A ram pushes against
    the upper courses, the wall cracks and the stones come loose.

    The friction is that of LowWall_FEM in the table of V. Acary, M. Bremond and O. Huber, On
    solving contact problems with Coulomb friction: formulations and numerical comparisons,
    Inria report RR-9118, 2018, whose stones are deformable.
    """

    title: ClassVar[str] = "Low wall"
    description: ClassVar[str] = (
        "A wall of rigid stones in English bond, without mortar, pushed over by a ram."
    )
    application: ClassVar[str] = "masonry"
    collection: ClassVar[str] = "masonry"
    problems: ClassVar[int] = 50

    stretchers: int = parameter(3, "1", "length of the wall in stretchers and a half, at least 2")
    courses: int = parameter(5, "1", "number of courses, at least 1; the lowest is of headers")
    length: float = parameter(0.4, "m", "length of a stone, twice its width")
    height: float = parameter(0.15, "m", "height of a stone")
    push: float = parameter(0.5, "m/s", "speed of the ram; 0: no ram")
    density: float = parameter(2200.0, "kg/m^3", "mass density of the stones")
    mu: float = parameter(0.83, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    lap: float = parameter(1e-5, "m", "penetration of the joints at the start, which closes them")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(1e-2, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("length", "height", "density", "time_step"),
            non_negative=("mu", "push", "lap"),
            at_least={"stretchers": 2, "courses": 1},
        )

    def scene(self, seed: int = 0) -> Scene:
        """The scene; nothing of it is random."""
        built = masonry.Masonry(density=self.density, mu=self.mu, lap=self.lap)
        for course in range(self.courses):
            bottom = course * self.height
            for i, (left, right, front, back) in enumerate(self._course(course)):
                built.stone(
                    f"stone{course}.{i}",
                    masonry.rectangle(left, right, bottom, bottom + self.height),
                    front,
                    back,
                    mjcf.shade(2 * course + i % 2, 2 * self.courses),
                )
        if self.push:
            # against the middle of the wall, below its top
            top = (self.courses - 0.25) * self.height
            built.support(
                "ram",
                [
                    masonry.rectangle(
                        -0.75 * self.length, 0.75 * self.length, top - 1.5 * self.height, top
                    )
                ],
                -1.3 * self.length,
                -0.6 * self.length,
                axis=(0, 1, 0),
                speed=self.push,
            )
        return Scene.of_bodies(
            self,
            seed,
            bodies=built.bodies,
            assets=built.assets,
            tile=self.length,
            rest=[*built.rest, *built.keyframe()],
            # from behind: the ram would hide the wall
            view=(-55.0, -14.0),
        )

    def _course(self, course: int) -> Iterator[tuple[float, float, float, float]]:
        """The stones of a course: left, right, front, back [m].

        Head joints lie at 0 and 1/2 (headers), at 3/4 and at 1/4 (the two rows of stretchers) of
        a stone, so that four stones never meet in an edge.
        """
        n, half = self.stretchers, 0.5 * self.length
        if course % 2 == 0:
            edges = [0.5 * i for i in range(2 * n + 2)]
            rows = [(edges, -half, half)]
        else:
            near = [0.0, *(0.75 + i for i in range(n)), n + 0.5]
            far = [0.0, *(1.25 + i for i in range(n - 1)), n + 0.5]
            if course % 4 == 3:
                near, far = far, near
            rows = [(near, -half, 0.0), (far, 0.0, half)]
        middle = 0.5 * (n + 0.5)
        for edges, front, back in rows:
            for left, right in pairwise(edges):
                yield self.length * (left - middle), self.length * (right - middle), front, back
