"""A four-legged walker on uneven ground: each leg is a linkage with a closed loop."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter

Pair = tuple[float, float]

# of a leg, in lengths of its crank: pivot of the rocker seen from that of the crank, coupler from
# joint to joint, rocker, and the foot in the axes of the coupler
PIVOT = (1.38, 1.37)
COUPLER = 1.64
ROCKER = 1.45
FOOT = (1.04, -3.74)
STRIDE = 1.4  # middle of the foot's way, ahead of the crank's pivot
LIFTED = math.radians(80)  # angle of the crank at which the foot is highest


@dataclass(frozen=True, kw_only=True)
class Quadruped(Published):
    """A walker whose four legs are four-bar linkages, trotting over blocks of drawn heights.

    Each leg is a linkage whose coupler goes on to the foot: a crank driven at constant speed
    leads the foot back along the ground for 200 degrees of a turn, nearly level, and forwards
    through the air for the rest. Diagonal legs step together. The loop of a leg is closed by a
    bilateral constraint of three rows between coupler and rocker; the rocker hangs in a universal
    joint, so that none of them is redundant, however the trunk leans.

    The proportions of the linkage come from a search for a level foot.
    """

    title: ClassVar[str] = "Quadruped on uneven ground"
    description: ClassVar[str] = (
        "A walker with four legs of closed linkages, driven by cranks over uneven ground."
    )
    application: ClassVar[str] = "robotics, mechanisms"
    collection: ClassVar[str] = "mixed"
    problems: ClassVar[int] = 500

    crank: float = parameter(0.06, "m", "length of a crank; the legs are in proportion")
    mass: float = parameter(8.0, "kg", "mass of the trunk")
    speed: float = parameter(6.0, "rad/s", "speed of a crank")
    inertia: float = parameter(0.01, "kg m^2", "of a crank with its gear")
    gain: float = parameter(20.0, "N m s/rad", "of the motor that holds the speed of a crank")
    roughness: float = parameter(0.02, "m", "largest height of the ground's blocks")
    block: float = parameter(0.2, "m", "edge of a block of the ground, seen from above")
    density: float = parameter(1000.0, "kg/m^3", "mass density of the legs")
    mu: float = parameter(0.6, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(4e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("crank", "mass", "block", "density", "time_step"),
            non_negative=("mu", "inertia", "gain", "roughness"),
        )

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the heights of the ground."""
        random = np.random.Generator(np.random.PCG64(seed))
        a = self.crank
        # lowest place of a foot, over a turn
        lowest = min(self._foot(angle)[1] for angle in np.linspace(-math.pi, math.pi, 361).tolist())
        height = self.roughness + self._radius - lowest + 2e-3
        axles, legs, loops, motors = "", "", [], []
        for end, x in (("front", (5 - STRIDE) * a), ("hind", -(5 + STRIDE) * a)):
            for pivot in ((x, 0.0), (x + a * PIVOT[0], a * PIVOT[1])):
                axles += (
                    f'<geom type="capsule" size="{0.2 * a!r}" contype="0" conaffinity="0" mass="0"'
                    f' fromto="{mjcf.numbers(pivot[0], -2.5 * a, pivot[1])}'
                    f' {mjcf.numbers(pivot[0], 2.5 * a, pivot[1])}" rgba="0.45 0.47 0.5 1"/>'
                )
            for side, y in (("left", 2.5 * a), ("right", -2.5 * a)):
                name = f"{end}.{side}"
                # diagonal legs step together
                phase = LIFTED if (end == "front") == (side == "left") else LIFTED - math.pi
                legs += self._leg(name, x, y, phase)
                loops.append(
                    f'<connect body1="coupler.{name}" body2="rocker.{name}"'
                    f' anchor="{mjcf.numbers(COUPLER * a, 0, 0)}"/>'
                )
                motors.append(f'<velocity joint="crank.{name}" kv="{self.gain!r}"/>')
        trunk = (
            f'<body name="trunk" pos="{mjcf.numbers(0, 0, height)}"><freejoint/>'
            f'<geom type="box" size="{mjcf.numbers(7 * a, 1.5 * a, 0.8 * a)}"'
            f' pos="{mjcf.numbers(0, 0, 0.8 * a)}" mass="{self.mass!r}" condim="3"'
            f' friction="{self.mu!r}" material="solid" rgba="{mjcf.shade(0, 5)}"/>'
            f"{axles}{legs}</body>"
        )
        # backwards: the foot that stands goes to the rear
        controls = mjcf.numbers(*[-self.speed] * 4)
        return Scene.of_bodies(
            self,
            seed,
            bodies=[
                *mjcf.uneven_ground(
                    random, self.roughness, self.block, (-10 * a, 40 * a), 7 * a, self.mu
                ),
                trunk,
            ],
            tile=self.block,
            rest=mjcf.driven(loops, motors, controls),
        )

    @property
    def _radius(self) -> float:
        """The radius of a foot [m]."""
        return 0.3 * self.crank

    def _angles(self, angle: float) -> tuple[Pair, float, float]:
        """The crank's end, and the angles of coupler and rocker [rad], the crank at an angle."""
        end = (self.crank * math.cos(angle), self.crank * math.sin(angle))
        pivot = (self.crank * PIVOT[0], self.crank * PIVOT[1])
        span = math.hypot(pivot[0] - end[0], pivot[1] - end[1])
        slope = math.atan2(pivot[1] - end[1], pivot[0] - end[0])
        # law of cosines in the triangle of coupler, rocker and span, the lower of two
        coupler, rocker = self.crank * COUPLER, self.crank * ROCKER
        inner = math.acos((coupler**2 + span**2 - rocker**2) / (2 * coupler * span))
        outer = math.acos((rocker**2 + span**2 - coupler**2) / (2 * rocker * span))
        return end, slope - inner, slope + math.pi + outer

    def _foot(self, angle: float) -> Pair:
        """The place of the foot, from the crank's pivot (x, z) [m]."""
        (x, z), coupler, _ = self._angles(angle)
        along, across = self.crank * FOOT[0], self.crank * FOOT[1]
        return (
            x + along * math.cos(coupler) - across * math.sin(coupler),
            z + along * math.sin(coupler) + across * math.cos(coupler),
        )

    def _leg(self, name: str, x: float, y: float, phase: float) -> str:
        """A leg in the plane y of the trunk, its crank's pivot at x, its loop closed."""
        end, coupler, rocker = self._angles(phase)
        a = self.crank
        joint, foot = (a * COUPLER, 0.0), (a * FOOT[0], a * FOOT[1])
        lower = self._bar(
            f"coupler.{name}",
            end,
            y,
            coupler,
            self._rod((0, 0), joint, 2)
            + self._rod((0, 0), foot, 2)
            + self._rod(joint, foot, 2)
            + self._sole(foot),
            phase,
        )
        crank = self._rod((0, 0), (a, 0), 1)
        guide = self._rod((0, 0), (ROCKER * a, 0), 3)
        pivot = (x + a * PIVOT[0], a * PIVOT[1])
        return self._bar(
            f"crank.{name}", (x, 0), y, phase, crank + lower, drive=self.inertia
        ) + self._bar(f"rocker.{name}", pivot, y, rocker, guide, swings=True)

    def _bar(
        self,
        name: str,
        at: Pair,
        y: float,
        angle: float,
        inside: str,
        base: float | None = None,
        drive: float = 0.0,
        swings: bool = False,
    ) -> str:
        """A body that turns about y, at an angle to x; `base` is the angle of what carries it."""
        x, z = at
        if base is not None:
            # into the axes of the body that carries it
            x, z = (
                x * math.cos(base) + z * math.sin(base),
                z * math.cos(base) - x * math.sin(base),
            )
            y = 0.0
        turn = (base or 0.0) - angle
        return (
            f'<body name="{name}" pos="{mjcf.numbers(x, y, z)}"'
            f' euler="{mjcf.numbers(0, turn, 0)}">'
            f'<joint name="{name}" axis="0 -1 0" armature="{drive!r}"/>'
            + (f'<joint name="{name}.aside" axis="0 0 1"/>' if swings else "")
            + f"{inside}</body>"
        )

    def _rod(self, start: Pair, end: Pair, index: int) -> str:
        """A rod in the plane of its body that touches nothing."""
        return (
            f'<geom type="capsule" size="{0.15 * self.crank!r}" contype="0" conaffinity="0"'
            f' fromto="{mjcf.numbers(start[0], 0, start[1], end[0], 0, end[1])}"'
            f' density="{self.density!r}" material="solid" rgba="{mjcf.shade(index, 5)}"/>'
        )

    def _sole(self, foot: Pair) -> str:
        """A foot: a bar across, as wide as two of them need to carry the trunk."""
        half = 2.2 * self.crank
        ends = mjcf.numbers(foot[0], -half, foot[1], foot[0], half, foot[1])
        return (
            f'<geom type="capsule" size="{self._radius!r}" condim="3" friction="{self.mu!r}"'
            f' fromto="{ends}" density="{self.density!r}" material="solid"'
            f' rgba="{mjcf.shade(4, 5)}"/>'
        )
