"""A slender block that rocks on the ground from one edge to the other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class RockingBlock(Published):
    """A block that is tilted and let go; each time it comes down it strikes with its other edge.

    A slender block turns about an edge for (1/p) acosh(1 / (1 - theta / alpha)) until it comes
    down, p = sqrt(3 g / (4 R)), alpha the angle of its diagonal, R half of that.

    G. W. Housner, The behavior of inverted pendulum structures during earthquakes, Bulletin of the
    Seismological Society of America 53(2), 1963.
    """

    title: ClassVar[str] = "Rocking block"
    description: ClassVar[str] = "A slender block in the plane that rocks from edge to edge."
    application: ClassVar[str] = "impacts"
    authors: ClassVar[str] = "the authors of FCLIB, after G. W. Housner"
    collection: ClassVar[str] = "impacts"
    problems: ClassVar[int] = 300

    width: float = parameter(0.2, "m", "of the block")
    height: float = parameter(2.0, "m", "of the block")
    mass: float = parameter(100.0, "kg", "of the block")
    tilt: float = parameter(0.5, "1", "angle at the start, of the diagonal's, in (0, 1)")
    mu: float = parameter(1.0, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(5e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self, positive=("width", "height", "mass", "tilt", "time_step"), non_negative=("mu",)
        )
        if not self.tilt < 1:
            raise ValueError(f"RockingBlock: tilt must be < 1, not {self.tilt}")

    @property
    def slenderness(self) -> float:
        """Angle alpha of the diagonal to the vertical [rad]: beyond it the block tips over."""
        return math.atan2(self.width, self.height)

    def scene(self, seed: int = 0) -> Scene:
        """The scene; nothing of it is random."""
        angle = self.tilt * self.slenderness
        half = 0.5 * math.hypot(self.width, self.height)
        # on the right edge, at the origin; just closed
        x = -half * math.sin(self.slenderness - angle)
        z = half * math.cos(self.slenderness - angle) - 1e-9
        return Scene.of_bodies(
            self,
            seed,
            bodies=[
                mjcf.block("block", (0.0, 0.0), "block", self.mass, mjcf.surface(self.mu)).replace(
                    'material="solid"', 'material="solid" rgba="0.45 0.5 0.6 1"'
                )
            ],
            assets=[mjcf.block_mesh("block", self.width, self.width, self.height)],
            tile=self.width,
            rest=[f'<keyframe><key name="start" qpos="{mjcf.numbers(x, z, angle)}"/></keyframe>'],
            planar=True,
        )
