"""A masonry arch whose supports move apart: it stands, cracks into hinges, and falls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from fclib.scenes.shared import masonry, mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class Arch(Published):
    """Equal voussoirs laid to a circular arch on two abutments; the right one moves away.

    Every joint has four contacts, one in each corner. Three are enough to hold a stone, so the
    reactions are far from unique. Under its own weight a semicircular arch stands if its thickness
    is more than 0.107 of the radius of its middle line (P. Couplet 1730, M. Milankovitch 1907;
    0.106 in J. Heyman, The safety of masonry arches, International Journal of Mechanical Sciences
    11, 1969), if the friction keeps it from sliding. A spread of the abutments, however small,
    opens three hinges; the arch stands on them until it has become too flat.
    """

    title: ClassVar[str] = "Masonry arch"
    description: ClassVar[str] = (
        "Voussoirs without mortar between two abutments that move apart, under gravity."
    )
    application: ClassVar[str] = "masonry"
    collection: ClassVar[str] = "masonry"
    problems: ClassVar[int] = 500

    voussoirs: int = parameter(24, "1", "number of voussoirs, at least 2")
    radius: float = parameter(2.0, "m", "radius of the middle line")
    thickness: float = parameter(0.3, "m", "of the ring, below the radius")
    depth: float = parameter(0.8, "m", "width of the arch along its axis")
    opening: float = parameter(math.pi, "rad", "angle of the ring, at most pi")
    springing: float = parameter(0.4, "m", "height of the abutments")
    spread: float = parameter(0.2, "m/s", "speed at which the right abutment moves away; 0: fixed")
    density: float = parameter(2200.0, "kg/m^3", "mass density of the stones")
    mu: float = parameter(0.8, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    lap: float = parameter(1e-5, "m", "penetration of the joints at the start, which closes them")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(5e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=(
                "radius",
                "thickness",
                "depth",
                "opening",
                "springing",
                "density",
                "time_step",
            ),
            non_negative=("mu", "spread", "lap"),
            at_least={"voussoirs": 2},
        )
        if self.opening > math.pi or self.thickness >= self.radius:
            raise ValueError(
                f"Arch: no ring has an opening of {self.opening} (at most pi) and a thickness of"
                f" {self.thickness} (below the radius, {self.radius})"
            )

    def scene(self, seed: int = 0) -> Scene:
        """The scene; nothing of it is random."""
        built = masonry.Masonry(density=self.density, mu=self.mu, lap=self.lap)
        start = 0.5 * (math.pi - self.opening)
        # the foot of the ring, inside and outside, stands above the floor by the springing
        foot = (self.radius - 0.5 * self.thickness) * math.sin(start)
        centre = (0.0, self.springing - foot)
        front, back = -0.5 * self.depth, 0.5 * self.depth
        outlines = masonry.ring(
            self.radius, self.thickness, start, math.pi - start, self.voussoirs, centre
        )
        for i, outline in enumerate(outlines):
            built.stone(f"voussoir{i}", outline, front, back, mjcf.shade(i, self.voussoirs))

        # the top of an abutment goes on beyond the foot on both sides
        more = 0.1 * self.thickness
        inner = masonry.on_circle(self.radius - 0.5 * self.thickness - more, start, centre)
        outer = masonry.on_circle(self.radius + 0.5 * self.thickness + more, start, centre)
        right = [(inner[0], 0.0), (outer[0], 0.0), outer, inner]
        left = [(-x, z) for x, z in reversed(right)]
        built.support("left", [left], front - more, back + more)
        built.support(
            "right", [right], front - more, back + more, axis=(1, 0, 0), speed=self.spread
        )
        return Scene.of_bodies(
            self,
            seed,
            bodies=built.bodies,
            assets=built.assets,
            tile=0.5 * self.radius,
            rest=[*built.rest, *built.keyframe()],
        )
