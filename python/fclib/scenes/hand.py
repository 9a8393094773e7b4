"""A hand of jointed fingers that closes on an object, lifts it and sets it down."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter

STIFFNESS = 1e5  # [N/m] of the servo that holds the height
DAMPING = 2e3  # [N s/m] of it
IRON = "0.45 0.47 0.5 1"
SKIN = "0.72 0.6 0.5 1"
TIP = 0.3  # height of the tips above the floor, in heights of the object


@dataclass(frozen=True, kw_only=True)
class Hand(Published):
    """Fingers of two links reach down around a prism with as many sides, press on it and lift it.

    Torques drive the hinges, and no servo knows their angles: the object alone keeps the fingers in
    their places. A finger presses with its tip, so the object may turn about the line of two
    tips, and roll between them. The least force of a tip that carries the object is m g / (k mu)
    for k fingers; it is `squeeze` times that here, and below 1 the object slips out.

    Why it is here: few contacts, each of which counts. The grasp holds by internal forces: it is
    statically indeterminate, and most contacts are near their limit of friction. If
    a tip begins to slip or to roll in a step, the solution is far from the one before. The links
    are far lighter than the object.

    J. K. Salisbury, B. Roth, Kinematic and force analysis of articulated mechanical hands, Journal
    of Mechanisms, Transmissions, and Automation in Design 105, 1983.
    """

    title: ClassVar[str] = "Hand with an object"
    description: ClassVar[str] = "Fingers of two links close on a prism, lift it and set it down."
    application: ClassVar[str] = "robotics, grasping"
    authors: ClassVar[str] = "the authors of FCLIB, after J. K. Salisbury and B. Roth"
    collection: ClassVar[str] = "machines"
    problems: ClassVar[int] = 600

    fingers: int = parameter(6, "1", "number of fingers and of the object's sides, at least 3")
    size: float = parameter(0.04, "m", "from the object's axis to its sides")
    height: float = parameter(0.12, "m", "of the object")
    density: float = parameter(1000.0, "kg/m^3", "mass density of the object")
    link: float = parameter(0.1, "m", "length of a finger's lower link")
    finger: float = parameter(0.02, "kg", "mass of a link")
    tip: float = parameter(8e-3, "m", "radius of a finger")
    damping: float = parameter(0.02, "N m s/rad", "of a hinge")
    squeeze: float = parameter(1.5, "1", "force of a tip, of the least that holds the object")
    lift: float = parameter(0.1, "m", "how far it is lifted")
    tilt: float = parameter(0.1, "rad", "largest turn of the object about its axis at the start")
    period: float = parameter(1.0, "s", "of closing, lifting and coming back")
    mu: float = parameter(0.6, "1", "coefficient of friction, above 0")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(1e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=(
                *("size", "height", "density", "link", "finger", "tip", "period", "mu"),
                "time_step",
            ),
            non_negative=("damping", "squeeze", "lift", "tilt"),
            at_least={"fingers": 3},
        )

    @property
    def mass(self) -> float:
        """The mass of the object [kg]."""
        area = self.fingers * self.size**2 * math.tan(math.pi / self.fingers)
        return self.density * area * self.height

    @property
    def force(self) -> float:
        """The horizontal force of a tip [N]."""
        return self.squeeze * self.mass * self.gravity / (self.fingers * self.mu)

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws how the object is turned about its axis."""
        random = np.random.Generator(np.random.PCG64(seed))
        turn = self.tilt * float(random.uniform(-1, 1))
        angles = 2 * math.pi * (np.arange(self.fingers) + 0.5) / self.fingers
        reach = self.size / math.cos(math.pi / self.fingers)
        corners = np.array(
            [
                (reach * math.cos(angle), reach * math.sin(angle), z)
                for angle in angles.tolist()
                for z in (-0.5 * self.height, 0.5 * self.height)
            ]
        )
        rotation = (math.cos(0.5 * turn), 0.0, 0.0, math.sin(0.5 * turn))
        thing = mjcf.grain(
            "object",
            (0, 0, 0.5 * self.height),
            f'type="mesh" mesh="object" density="{self.density!r}"',
            mjcf.surface(self.mu),
            mjcf.shade(0, 2),
            rotation,
        )
        # a tip presses with its torque about a hinge over the distance below it
        torques = (self.force * 2 * self.link, self.force * self.link)
        heights = ((0.0, 0.0), (0.25, 0.0), (0.55, 1.0), (0.65, 1.0), (0.95, 0.0), (1.0, 0.0))
        keys = [
            f'<key name="gait{i}" time="{share * self.period!r}"'
            f' ctrl="{mjcf.numbers(*torques * self.fingers, up * self.lift)}"/>'
            for i, (share, up) in enumerate(heights)
        ]
        motors = [
            f'<motor joint="{name}{k}"/>'
            for k in range(self.fingers)
            for name in ("upper", "lower")
        ]
        return Scene.of_bodies(
            self,
            seed,
            bodies=[thing, self._hand()],
            assets=[mjcf.polyhedron_mesh("object", corners)],
            tile=2 * self.size,
            rest=[
                "<actuator>",
                *motors,
                f'<position joint="lift" kp="{STIFFNESS!r}" kv="{DAMPING!r}"/>',
                "</actuator>",
                "<keyframe>",
                *keys,
                "</keyframe>",
            ],
            # a capsule and a mesh touch in one point then
            multiccd=False,
        )

    def _hand(self) -> str:
        """A palm that rises, with its fingers straight down, tips a little off the object."""
        top = TIP * self.height + 2 * self.link
        away = self.size / math.cos(self.tilt) + self.size * math.tan(self.tilt) + self.tip + 2e-3
        fingers = ""
        for k in range(self.fingers):
            angle = 2 * math.pi * k / self.fingers
            # hinges about the tangent: positive turns bring the tip inwards
            axis = mjcf.numbers(-math.sin(angle), math.cos(angle), 0)
            place = (away * math.cos(angle), away * math.sin(angle))
            lower = self._link(f"lower{k}", (0, 0, -self.link), axis, "")
            fingers += self._link(f"upper{k}", (*place, 0), axis, lower)
        return (
            f'<body name="palm" pos="{mjcf.numbers(0, 0, top)}">'
            '<joint name="lift" type="slide" axis="0 0 1"/>'
            f'<geom type="cylinder" size="{mjcf.numbers(away + self.tip, self.tip)}"'
            f' pos="{mjcf.numbers(0, 0, 2 * self.tip)}" mass="0.5" contype="0" conaffinity="0"'
            f' material="solid" rgba="{IRON}"/>{fingers}</body>'
        )

    def _link(self, name: str, place: tuple[float, float, float], axis: str, inside: str) -> str:
        """A link straight down from its hinge."""
        # its end is the tip: as far below the hinge as the torque is told
        return (
            f'<body name="{name}" pos="{mjcf.numbers(*place)}">'
            f'<joint name="{name}" axis="{axis}" damping="{self.damping!r}"/>'
            f'<geom type="capsule" size="{self.tip!r}" mass="{self.finger!r}"'
            f' fromto="{mjcf.numbers(0, 0, 0, 0, 0, -self.link)}" contype="2" conaffinity="1"'
            f' {mjcf.surface(self.mu)} material="solid" rgba="{SKIN}"/>{inside}</body>'
        )
