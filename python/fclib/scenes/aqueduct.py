"""An aqueduct of stones laid dry, arcades in tiers: a pier settles, and the masonry cracks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

from fclib.scenes.shared import masonry, mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class Aqueduct(Published):
    """Tiers of semicircular arcades upon each other, between two walls of rock.

    Rings, backing, spandrels, piers and decks are rigid stones; every joint has four contacts, so
    that there are several times as many contact components as degrees of freedom. The plinth of
    one pier sinks: the aqueduct stands, cracks, and the lower tier parts from the upper, which
    spans the gap.

    After the family Aqueduct_PR of V. Acary, M. Bremond and O. Huber, On solving contact problems
    with Coulomb friction: formulations and numerical comparisons, Inria report RR-9118, 2018 (the
    equilibrium of a Roman aqueduct, simulated by LMGC90): its friction. The geometry and the
    settlement are chosen here, with fewer stones.
    """

    title: ClassVar[str] = "Aqueduct"
    description: ClassVar[str] = (
        "Arcades of rigid stones without mortar in tiers, a pier of which settles, under gravity."
    )
    application: ClassVar[str] = "masonry"
    authors: ClassVar[str] = "V. Acary, M. Bremond, O. Huber; LMGC90 development team"
    collection: ClassVar[str] = "masonry"
    problems: ClassVar[int] = 60
    # parameters of a small scene, which is simulated quickly
    small: ClassVar[Mapping[str, Any]] = {"spans": 2, "tiers": 1}

    spans: int = parameter(3, "1", "arches of a tier, at least 2")
    tiers: int = parameter(2, "1", "tiers, at least 1")
    voussoirs: int = parameter(9, "1", "number of voussoirs of an arch, at least 3")
    courses: int = parameter(3, "1", "courses of a pier in the lowest tier, at least 1")
    radius: float = parameter(1.5, "m", "radius of a ring's middle line")
    thickness: float = parameter(0.3, "m", "of a ring, below the radius")
    width: float = parameter(1.2, "m", "of the aqueduct across")
    split: bool = parameter(
        False, "1", "whether voussoirs, spandrels and every second slab are of two stones across"
    )
    bond: bool = parameter(
        False, "1", "whether voussoirs and columns are of two and three stones across in turn"
    )
    settlement: float = parameter(0.8, "m/s", "speed at which a plinth sinks; 0: fixed")
    density: float = parameter(2200.0, "kg/m^3", "mass density of the stones")
    mu: float = parameter(0.8, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    lap: float = parameter(1e-5, "m", "penetration of the joints at the start, which closes them")
    arris: float = parameter(
        0.01, "m", "cut off the stones' edges, so that diagonal ones are apart"
    )
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(1e-2, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("radius", "thickness", "width", "arris", "density", "time_step"),
            non_negative=("mu", "settlement", "lap"),
            at_least={"spans": 2, "tiers": 1, "voussoirs": 3, "courses": 1},
        )
        if self.thickness >= self.radius:
            raise ValueError(
                f"Aqueduct: the thickness of a ring ({self.thickness}) must be below its radius"
                f" ({self.radius})"
            )

    def scene(self, seed: int = 0) -> Scene:
        """The scene; nothing of it is random."""
        built = masonry.Masonry(density=self.density, mu=self.mu, lap=self.lap, arris=self.arris)
        front, back = -0.5 * self.width, 0.5 * self.width
        course = 1.5 * self.thickness
        plinth = 0.5 * self.radius
        bottom = plinth
        walls: dict[int, list[list[masonry.Point]]] = {-1: [], 1: []}
        piers: list[tuple[float, float]] = []
        for tier in range(self.tiers):
            # one course on an upper tier
            courses = self.courses if tier == 0 else 1
            arcade = masonry.Arcade(
                spans=self.spans,
                voussoirs=self.voussoirs,
                radius=self.radius,
                thickness=self.thickness,
                start=0.0,
                between=0.5 * self.thickness,
                base=bottom + courses * course,
                cover=0.5 * self.thickness,
                slab=0.5 * self.thickness,
                slabs=4 * self.spans + tier % 2,
            )
            piers = [arcade.pier(i) for i in range(self.spans - 1)]
            stones = arcade.stones()
            for i, (left, right) in enumerate(piers):
                for k in range(courses):
                    low = bottom + k * course
                    # every second course is of two stones
                    edges = [left, right] if k % 2 == 0 else [left, 0.5 * (left + right), right]
                    stones += [
                        (f"pier{i}.{k}.{j}", masonry.rectangle(a, b, low, low + course))
                        for j, (a, b) in enumerate(pairwise(edges))
                    ]
            for i, (name, outline) in enumerate(stones):
                colour = mjcf.shade(i + tier % 2 * len(stones), 2 * len(stones))
                leaves = [front, *self._joints(name), back]
                for k, (near, far) in enumerate(pairwise(leaves)):
                    built.stone(f"tier{tier}.{name}.{k}", outline, near, far, colour)
            for side, wall in walls.items():
                wall += arcade.wall(side, bottom, 2 * self.thickness)
            bottom = arcade.top
        for name, side in (("left", -1), ("right", 1)):
            built.support(name, walls[side], front, back)
        for i, (left, right) in enumerate(piers):
            outline = masonry.rectangle(
                left - 0.5 * self.thickness, right + 0.5 * self.thickness, 0.0, plinth
            )
            sinks = i == (self.spans - 1) // 2
            built.support(
                f"plinth{i}",
                [outline],
                1.1 * front,
                1.1 * back,
                speed=self.settlement if sinks else 0.0,
            )
        return Scene.of_bodies(
            self,
            seed,
            bodies=built.bodies,
            assets=built.assets,
            tile=self.radius,
            rest=[*built.rest, *built.keyframe()],
            focus=(0.0, 0.0, 0.5 * bottom, 0.45 * bottom),
        )

    def _joints(self, name: str) -> list[float]:
        """The places at which a stone is divided across, y [m].

        Two stones that meet never have their joints at the same place. Otherwise a front half and a
        back half would meet in an edge only, and such stones must not touch.
        """
        kind = name.rstrip("0123456789.")
        odd = int(name[-1]) % 2 == 1
        if self.bond:
            sixth = self.width / 6
            if kind in ("voussoir", "column"):
                return [0.0] if odd == (kind == "voussoir") else [-sixth, sixth]
            if kind in ("slab", "backing"):
                return [-2 * sixth, 2 * sixth] if odd else [-1.5 * sixth, 1.5 * sixth]
            return []
        if not self.split:
            return []
        aside = 0.1 * self.width
        if kind == "voussoir":
            return [aside if odd else -aside]
        if kind == "column":
            return [-aside if odd else aside]
        if kind == "slab":
            return [0.0] if odd else []
        return []
