"""A humanoid on stones: a tree of joints with springs, dampers and limits, and box feet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter

Triple = tuple[float, float, float]

_AXES = {"roll": (1, 0, 0), "pitch": (0, 1, 0), "yaw": (0, 0, 1)}


@dataclass(frozen=True)
class Limb:
    """A part of the body, for a height of 1.7 m; x points ahead, y to the left, z up."""

    name: str
    parent: str
    at: tuple[float, float, float]  # its joint, in the axes of its parent [m]
    end: tuple[float, float, float]  # of its axis, from the joint [m]
    radius: float  # [m]
    share: float  # of the body's mass
    # axis of rotation, angle at which the springs rest, limits [rad]
    joints: tuple[tuple[str, float, float, float], ...] = ()
    box: tuple[float, float, float] | None = None  # half edges [m] of a box at `end`, no capsule


def _side(name: str, sign: int) -> list[Limb]:
    """Arm and leg of one side."""
    return [
        Limb(
            f"thigh.{name}",
            "trunk",
            (0, 0.1 * sign, -0.1),
            (0, 0, -0.4),
            0.06,
            0.11,
            (("roll", 0.0, -0.5, 0.5), ("pitch", -0.5, -2.0, 0.4)),
        ),
        Limb(
            f"shin.{name}",
            f"thigh.{name}",
            (0, 0, -0.4),
            (0, 0, -0.38),
            0.045,
            0.06,
            (("pitch", 1.0, 0.0, 2.4),),
        ),
        Limb(
            f"foot.{name}",
            f"shin.{name}",
            (0, 0, -0.38),
            (0.05, 0, -0.05),
            0.0,
            0.02,
            (("pitch", -0.5, -0.9, 0.7), ("roll", 0.0, -0.4, 0.4)),
            box=(0.12, 0.045, 0.02),
        ),
        Limb(
            f"arm.{name}",
            "trunk",
            (0, 0.22 * sign, 0.38),
            (0, 0, -0.28),
            0.04,
            0.03,
            (("pitch", 0.2, -2.5, 1.0), ("roll", 0.2 * sign, -1.6, 1.6)),
        ),
        Limb(
            f"forearm.{name}",
            f"arm.{name}",
            (0, 0, -0.28),
            (0, 0, -0.27),
            0.035,
            0.02,
            (("pitch", -0.6, -2.4, 0.0),),
        ),
    ]


LIMBS = [
    Limb("head", "trunk", (0, 0, 0.45), (0, 0, 0.15), 0.09, 0.07, (("pitch", 0.0, -0.5, 0.5),)),
    *_side("left", 1),
    *_side("right", -1),
]


def holding(limb: Limb) -> Limb:
    """A limb of a body that holds a bar: its hands are in front."""
    if not limb.name.startswith("forearm"):
        return limb
    return replace(limb, end=(0.27, 0, 0), joints=(("pitch", 0.0, -0.8, 1.5),))


@dataclass(frozen=True, kw_only=True)
class Humanoid(Published):
    """A humanoid of 23 degrees of freedom, dropped on stones, held by springs in its joints.

    Feet touch the ground at their corners. The springs hold the joints near a crouch; with the
    default ones the body stands, or falls on its knees, as the stones let it. A limit of a joint
    is a contact without friction. M is one dense block that couples all contacts of the body.
    """

    title: ClassVar[str] = "Humanoid on stones"
    description: ClassVar[str] = (
        "An articulated humanoid with springs and limits in its joints, dropped on uneven ground."
    )
    application: ClassVar[str] = "robotics, biomechanics"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere; limits without friction"
    collection: ClassVar[str] = "mixed"
    problems: ClassVar[int] = 500

    height: float = parameter(1.7, "m", "height of the body")
    mass: float = parameter(70.0, "kg", "mass of the body, without the stones")
    mu: float = parameter(0.8, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    stiffness: float = parameter(400.0, "N m/rad", "of a joint")
    damping: float = parameter(10.0, "N m s/rad", "of a joint")
    drop: float = parameter(0.05, "m", "height of the soles above the stones at the start")
    stones: int = parameter(16, "1", "stones under the feet, at least 0")
    stone: float = parameter(0.04, "m", "largest half axis of a stone")
    roughness: float = parameter(0.0, "m", "largest height of the ground's blocks; 0: a floor")
    block: float = parameter(0.15, "m", "edge of a block of the ground, seen from above")
    bar: float = parameter(0.0, "kg", "mass of a bar that both hands hold, two loops; 0: none")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(2e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("height", "mass", "stone", "block", "time_step"),
            non_negative=("mu", "stiffness", "damping", "drop", "roughness", "bar"),
            at_least={"stones": 0},
        )

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws places and sizes of the stones."""
        random = np.random.Generator(np.random.PCG64(seed))
        draws = random.uniform(-1.0, 1.0, size=(self.stones, 3))
        # sole below the hips: thigh, shin, foot
        hip = (0.1 + 0.4 + 0.38 + 0.07) * self._scale
        top = (1.2 * self.stone if self.stones else 0.0) + self.roughness
        hips = top + self.drop + hip
        bodies = [self._trunk(hips)]
        places = []  # of the free bodies after the trunk
        side = max(1, int(np.ceil(np.sqrt(self.stones))))
        for i, (x, y, size) in enumerate(draws.tolist()):
            a = self.stone * (0.85 + 0.15 * size)
            # a grid with a little disorder, so that no two stones overlap
            place = np.array(divmod(i, side)) - 0.5 * (side - 1)
            place = 2.4 * self.stone * place + 0.15 * self.stone * np.array([x, y])
            places.append((*place.tolist(), self.roughness + 0.6 * a))
            bodies.append(
                f'<body name="stone{i}" pos="{mjcf.numbers(*places[-1])}">'
                f"<freejoint/>"
                f'<geom type="ellipsoid" size="{mjcf.numbers(a, 0.8 * a, 0.6 * a)}"'
                f' density="2500" friction="{self.mu!r}" condim="3" material="solid"'
                f' rgba="{mjcf.shade(i, self.stones)}"/></body>'
            )
        if self.roughness:
            reach = 0.5 * self.height
            bodies += mjcf.uneven_ground(
                random, self.roughness, self.block, (-reach, reach + self._way), reach, self.mu
            )
        rest = []
        if self.bar:
            # shoulder, elbow, hand
            places.append((self._scale * 0.27, 0.0, hips + self._scale * (0.38 - 0.28)))
            bodies.append(self._bar(places[-1]))
            for limb in self._limbs_held:
                if not limb.name.startswith("forearm"):
                    continue
                anchor = self._numbers(*limb.end)
                pair = f'body1="{limb.name}" body2="bar"'
                rest += [
                    f'<equality><connect {pair} anchor="{anchor}"/></equality>',
                    f"<contact><exclude {pair}/></contact>",
                ]
        rest += self._drive(hips, places)
        return Scene.of_bodies(self, seed, bodies=bodies, tile=0.25 * self.height, rest=rest)

    @property
    def _limbs_held(self) -> list[Limb]:
        """The limbs, as the hands hold a bar or not."""
        return [holding(limb) for limb in LIMBS] if self.bar else LIMBS

    @property
    def _way(self) -> float:
        """The distance that the body goes ahead [m]."""
        return 0.0

    def _drive(self, hips: float, places: Sequence[Triple]) -> list[str]:
        """Motors and a start; hips at a height [m], and the places of the other free bodies."""
        return []

    def _bar(self, place: Triple) -> str:
        """A bar across in both hands."""
        surface = self._surface(len(LIMBS))
        return (
            f'<body name="bar" pos="{mjcf.numbers(*place)}"><freejoint/>'
            f'<geom type="capsule" size="{self._numbers(0.02)}" mass="{self.bar!r}"'
            f' fromto="{self._numbers(0, -0.4, 0, 0, 0.4, 0)}" {surface}/></body>'
        )

    @property
    def _scale(self) -> float:
        """The scale of lengths, relative to a body of 1.7 m."""
        return self.height / 1.7

    def _numbers(self, *lengths: float) -> str:
        return mjcf.numbers(*(self._scale * x for x in lengths))

    def _trunk(self, z: float) -> str:
        """The whole body, hips at a height z [m]."""
        mass = self.mass * (1 - sum(limb.share for limb in LIMBS))
        return (
            f'<body name="trunk" pos="{mjcf.numbers(0, 0, z)}"><freejoint/>'
            f'<geom type="capsule" size="{self._numbers(0.11)}" mass="{mass!r}"'
            f' fromto="{self._numbers(0, 0, 0, 0, 0, 0.3)}" {self._surface(0)}/>'
            f"{self._limbs('trunk')}</body>"
        )

    def _limbs(self, parent: str) -> str:
        """The limbs that hang on a part of the body."""
        return "".join(
            f'<body name="{limb.name}" pos="{self._numbers(*limb.at)}">'
            f"{self._joints(limb)}{self._shape(limb, 1 + i)}{self._limbs(limb.name)}</body>"
            for i, limb in enumerate(self._limbs_held)
            if limb.parent == parent
        )

    def _joints(self, limb: Limb) -> str:
        return "".join(
            f'<joint name="{limb.name}.{axis}" axis="{mjcf.numbers(*_AXES[axis])}"'
            f" {self._held(limb, rest)}"
            f' limited="true" range="{mjcf.numbers(low, high)}"/>'
            for axis, rest, low, high in limb.joints
        )

    def _held(self, limb: Limb, rest: float) -> str:
        """The spring and damper of a joint of a limb; the spring rests at an angle [rad]."""
        return f'springref="{rest!r}" stiffness="{self.stiffness!r}" damping="{self.damping!r}"'

    def _shape(self, limb: Limb, index: int) -> str:
        ends: Sequence[float] = (0, 0, 0, *limb.end)
        form = (
            f'type="capsule" size="{self._numbers(limb.radius)}" fromto="{self._numbers(*ends)}"'
            if limb.box is None
            else f'type="box" size="{self._numbers(*limb.box)}" pos="{self._numbers(*limb.end)}"'
        )
        return f'<geom {form} mass="{self.mass * limb.share!r}" {self._surface(index)}/>'

    def _surface(self, index: int) -> str:
        return (
            f'friction="{self.mu!r}" condim="3" material="solid"'
            f' rgba="{mjcf.shade(index, len(LIMBS) + 1)}"'
        )
