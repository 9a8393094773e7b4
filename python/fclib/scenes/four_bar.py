"""Four-bar linkages that kick blocks over the floor: closed loops and contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter

Pair = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class FourBar(Published):
    """Four-bar linkages in a row, driven by their cranks, each before a stack of blocks.

    Crank and rocker turn on a frame; the coupler hangs on the crank, and a bilateral constraint
    closes the loop at its other end. The rocker goes on below its pivot as a leg that kicks the
    blocks. In minimal coordinates: M is not diagonal and depends on the angles, and the
    constraint has a redundant row out of its plane, which is left out.
    """

    title: ClassVar[str] = "Four-bar linkages"
    description: ClassVar[str] = (
        "Driven four-bar linkages, closed loops, whose legs kick stacks of blocks over a floor."
    )
    application: ClassVar[str] = "mechanisms, robotics"
    collection: ClassVar[str] = "mixed"
    problems: ClassVar[int] = 500

    linkages: int = parameter(3, "1", "number of linkages, at least 1")
    blocks: int = parameter(3, "1", "blocks of the stack before a linkage, at least 1")
    crank: float = parameter(0.1, "m", "length of a crank")
    coupler: float = parameter(0.3, "m", "length of a coupler")
    rocker: float = parameter(0.25, "m", "length of a rocker")
    frame: float = parameter(0.3, "m", "distance of the two pivots on a frame")
    speed: float = parameter(6.0, "rad/s", "speed of a crank")
    inertia: float = parameter(0.05, "kg m^2", "of a crank's flywheel")
    gain: float = parameter(3.0, "N m s/rad", "of the motor that holds the speed of a crank")
    block: float = parameter(0.1, "m", "edge of a block")
    density: float = parameter(1000.0, "kg/m^3", "mass density of all bodies")
    mu: float = parameter(0.4, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(2e-3, "s", "time step h")

    def __post_init__(self) -> None:
        lengths = (self.crank, self.coupler, self.rocker, self.frame)
        mjcf.check(
            self,
            positive=("crank", "coupler", "rocker", "frame", "block", "density", "time_step"),
            non_negative=("mu", "gain", "inertia"),
            at_least={"linkages": 1, "blocks": 1},
        )
        # Grashof's condition for a crank that turns all around
        if self.crank > min(lengths) or 2 * (self.crank + max(lengths)) > sum(lengths):
            raise ValueError(f"FourBar: a crank cannot turn all around with the lengths {lengths}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the angles of the cranks and the offsets of the blocks."""
        random = np.random.Generator(np.random.PCG64(seed))
        draws = random.uniform(-1, 1, size=(self.linkages, 1 + self.blocks))

        # places of the leg's foot over a turn of the crank; blocks stand in the middle of its way
        turn = np.linspace(-math.pi, math.pi, 361)
        foot = np.array([self._foot(angle) for angle in turn.tolist()])
        back = turn[foot.argmin()].item()
        middle = 0.5 * (foot.min() + foot.max()) + 0.5 * self.block + 2 * self._radius

        bodies: list[str] = []
        for i, (phase, *offsets) in enumerate(draws.tolist()):
            y = 3 * self.block * i
            bodies.append(self._linkage(i, y, back + 0.5 * phase))
            for k, offset in enumerate(offsets):
                x, z = middle + 0.1 * self.block * offset, (k + 0.5) * self.block
                bodies.append(
                    f'<body name="block{i}.{k}" pos="{mjcf.numbers(x, y, z)}"><freejoint/>'
                    f'<geom type="mesh" mesh="block" condim="3" friction="{self.mu!r}"'
                    f' density="{self.density!r}" material="solid"'
                    f' rgba="{mjcf.shade(k, self.blocks)}"/></body>'
                )
        loops, motors = [], []
        for i in range(self.linkages):
            loops.append(
                f'<connect body1="coupler{i}" body2="rocker{i}"'
                f' anchor="{mjcf.numbers(self.coupler, 0, 0)}"/>'
            )
            motors.append(f'<velocity joint="crank{i}" kv="{self.gain!r}"/>')
        controls = mjcf.numbers(*[self.speed] * self.linkages)
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            assets=[mjcf.block_mesh("block", self.block, self.block, self.block)],
            tile=4 * self.block,
            rest=mjcf.driven(loops, motors, controls),
        )

    @property
    def _radius(self) -> float:
        """The radius of all rods [m]."""
        return 0.1 * self.crank

    @property
    def _leg(self) -> float:
        """Length of the rocker below its pivot [m]: pivots are 2.5 blocks above the floor."""
        return 2 * self.block

    def _angles(self, angle: float) -> tuple[Pair, Pair, float, float]:
        """The end of the crank, the pivot of the rocker, the angles of coupler and rocker [rad]."""
        end = (self.crank * math.cos(angle), self.crank * math.sin(angle))
        span = math.hypot(self.frame - end[0], end[1])
        slope = math.atan2(-end[1], self.frame - end[0])
        # law of cosines in the triangle of coupler, rocker and span, the upper of two
        inner = math.acos((self.coupler**2 + span**2 - self.rocker**2) / (2 * self.coupler * span))
        outer = math.acos((self.rocker**2 + span**2 - self.coupler**2) / (2 * self.rocker * span))
        return end, (self.frame, 0.0), slope + inner, slope + math.pi - outer

    def _foot(self, angle: float) -> float:
        """The place of the foot along x [m] for an angle of the crank."""
        *_, rocker = self._angles(angle)
        return self.frame - self._leg * math.cos(rocker)

    def _linkage(self, index: int, y: float, angle: float) -> str:
        """One linkage in the plane y, its crank at an angle, its loop closed."""
        end, pivot, coupler, rocker = self._angles(angle)
        parts = self._bar(
            f"crank{index}",
            (0.0, 0.0),
            angle,
            self._rod(self.crank, index)
            + self._bar(f"coupler{index}", end, coupler, self._rod(self.coupler, index), angle),
            flywheel=self.inertia,
        )
        parts += self._bar(
            f"rocker{index}",
            pivot,
            rocker,
            self._rod(self.rocker, index) + self._rod(-self._leg, index, touches=True),
        )
        height = 2.5 * self.block
        return f'<body name="frame{index}" pos="{mjcf.numbers(0, y, height)}">{parts}</body>'

    def _bar(
        self,
        name: str,
        at: Pair,
        angle: float,
        inside: str,
        base: float = 0.0,
        flywheel: float = 0.0,
    ) -> str:
        """A body that turns about y, at an angle to x; `base` is the angle of what carries it."""
        x, z = at
        # into the axes of the body that carries it
        place = mjcf.numbers(
            x * math.cos(base) + z * math.sin(base), 0, z * math.cos(base) - x * math.sin(base)
        )
        return (
            f'<body name="{name}" pos="{place}" euler="{mjcf.numbers(0, base - angle, 0)}">'
            f'<joint name="{name}" axis="0 -1 0" armature="{flywheel!r}"/>{inside}</body>'
        )

    def _rod(self, length: float, index: int, touches: bool = False) -> str:
        """A rod along x from the origin of its body; only what touches collides."""
        collides = "" if touches else ' contype="0" conaffinity="0"'
        return (
            f'<geom type="capsule" size="{self._radius!r}"{collides} condim="3"'
            f' fromto="{mjcf.numbers(0, 0, 0, length, 0, 0)}" density="{self.density!r}"'
            f' friction="{self.mu!r}" material="solid"'
            f' rgba="{mjcf.shade(2 * index, 2 * self.linkages)}"/>'
        )
