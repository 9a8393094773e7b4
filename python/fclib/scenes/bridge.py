"""A small masonry bridge that a wagon crosses while an abutment gives way."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from fclib.scenes.shared import masonry, mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class Bridge(Published):
    """A segmental arch with backing, spandrels and deck; the right abutment gives way.

    Held between two abutments that stay, the masonry jams and carries almost anything. As they
    move apart the arch opens hinges; it comes down under a wagon that rolls over it. The wagon's
    wheels have no friction, the stones have: mu is 0 at some contacts. Every joint has four.

    After the family Bridge_PR of V. Acary, M. Bremond and O. Huber, On solving contact problems
    with Coulomb friction: formulations and numerical comparisons, Inria report RR-9118, 2018 (a
    small unstable bridge, simulated by LMGC90): its friction, and as many bodies. The geometry
    and the load are chosen here.
    """

    title: ClassVar[str] = "Masonry bridge"
    description: ClassVar[str] = (
        "An arch bridge of rigid stones without mortar, crossed by a wagon, under gravity."
    )
    application: ClassVar[str] = "masonry"
    authors: ClassVar[str] = "V. Acary, M. Bremond, O. Huber; LMGC90 development team"
    friction: ClassVar[str] = "Coulomb, the same coefficient between stones; wheels without"
    collection: ClassVar[str] = "masonry"
    problems: ClassVar[int] = 500

    voussoirs: int = parameter(9, "1", "number of voussoirs, at least 3")
    slabs: int = parameter(6, "1", "number of slabs of the deck, at least 1")
    radius: float = parameter(3.0, "m", "radius of the ring's middle line")
    thickness: float = parameter(0.3, "m", "of the ring, below the radius")
    opening: float = parameter(2.2, "rad", "angle of the ring, at most pi")
    width: float = parameter(1.2, "m", "of the bridge across")
    cover: float = parameter(0.1, "m", "of masonry over the crown, below the slabs")
    slab: float = parameter(0.15, "m", "thickness of a slab")
    load: float = parameter(3000.0, "kg", "mass of the wagon; 0: no wagon")
    speed: float = parameter(2.0, "m/s", "of the wagon at the start")
    spread: float = parameter(0.3, "m/s", "speed of the right abutment, outwards; 0: fixed")
    density: float = parameter(2200.0, "kg/m^3", "mass density of the stones")
    mu: float = parameter(0.9, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    lap: float = parameter(1e-5, "m", "penetration of the joints at the start, which closes them")
    arris: float = parameter(
        0.01, "m", "cut off the stones' edges, so that diagonal ones are apart"
    )
    activation: float = parameter(0.0, "m", "gap of a corner that counts as closed")
    all_bodies: bool = parameter(
        False, "1", "whether problems have the stones that nothing touches too"
    )
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(5e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=(
                "radius",
                "thickness",
                "opening",
                "width",
                "cover",
                "slab",
                "arris",
                "density",
                "time_step",
            ),
            non_negative=("mu", "load", "speed", "spread", "lap", "activation"),
            at_least={"voussoirs": 3, "slabs": 1},
        )
        if self.opening > math.pi or self.thickness >= self.radius:
            raise ValueError(
                f"Bridge: no ring has an opening of {self.opening} (at most pi) and a thickness of"
                f" {self.thickness} (below the radius, {self.radius})"
            )

    def scene(self, seed: int = 0) -> Scene:
        """The scene; nothing of it is random."""
        built = masonry.Masonry(density=self.density, mu=self.mu, lap=self.lap, arris=self.arris)
        arcade = masonry.Arcade(
            spans=1,
            voussoirs=self.voussoirs,
            radius=self.radius,
            thickness=self.thickness,
            start=0.5 * (math.pi - self.opening),
            between=2 * self.thickness,
            base=0.4 * self.radius,
            cover=self.cover,
            slab=self.slab,
            slabs=self.slabs,
        )
        front, back = -0.5 * self.width, 0.5 * self.width
        stones = arcade.stones()
        for i, (name, outline) in enumerate(stones):
            built.stone(name, outline, front, back, mjcf.shade(i, len(stones)))
        # long enough for the wagon to stand on it
        approach = 4 * WAGON * self.width
        velocity = [0.0] * (6 * len(stones))
        if self.load:
            built.bodies.append(self._wagon(-arcade.end - 0.6 * approach, arcade.top))
            velocity += [self.speed, 0, 0, 0, 0, 0]
        built.support("left", arcade.wall(-1, 0.0, approach), front, back)
        right = arcade.wall(1, 0.0, approach)
        built.support("right", right, front, back, axis=(1, 0, 0), speed=self.spread)
        velocity += [0.0] * len(built.speeds)
        reach = arcade.end + 0.5 * approach
        return Scene.of_bodies(
            self,
            seed,
            bodies=built.bodies,
            assets=built.assets,
            tile=0.5 * self.radius,
            rest=[*built.rest, *built.keyframe(velocity)],
            focus=(0.0, 0.0, 0.5 * arcade.top, 0.5 * reach),
        )

    def _wagon(self, x: float, z: float) -> str:
        """A wagon on the deck, z its top [m]; the wheels' lack of friction comes first."""
        a = WAGON * self.width
        wheels = "".join(
            f'<geom type="sphere" size="{0.4 * a!r}" mass="{0.05 * self.load!r}" condim="1"'
            f' pos="{mjcf.numbers(along * a, across * a, 0.4 * a)}" priority="1"'
            ' material="solid" rgba="0.25 0.26 0.28 1"/>'
            for along in (-1, 1)
            for across in (-0.8, 0.8)
        )
        # the law on velocities keeps a small penetration
        return (
            f'<body name="wagon" pos="{mjcf.numbers(x, 0, z - 0.5 * self.lap)}"><freejoint/>'
            f'<geom type="box" size="{mjcf.numbers(1.3 * a, 0.9 * a, 0.35 * a)}"'
            f' pos="{mjcf.numbers(0, 0, 0.9 * a)}" mass="{0.8 * self.load!r}" condim="3"'
            f' friction="{self.mu!r}" material="solid" rgba="0.62 0.2 0.16 1"/>{wheels}</body>'
        )


WAGON = 0.35  # half the distance of its axles, in widths of the bridge
