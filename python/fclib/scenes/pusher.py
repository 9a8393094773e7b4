"""An arm that pushes a pile of blocks over the floor with a blade."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter

NEAR, FAR = 0.3, 0.85  # of the blade from the shoulder, in lengths of the whole arm
KEYS = 16  # of the way there, and of the way back
REST = 0.2  # share of a cycle in which the blade waits and the pile settles
PUSHED = 0.75  # share of a cycle at whose end the blade turns back
STIFFNESS = 2e4  # [N m/rad] of the servo of a joint
DAMPING = 4e2  # [N m s/rad] of it
IRON = "0.45 0.47 0.5 1"


@dataclass(frozen=True, kw_only=True)
class Pusher(Published):
    """An arm of three vertical hinges leads a blade on a straight line through a pile of blocks.

    Blocks of drawn sizes fall onto the floor before the blade. It pushes them outwards: they heap
    up before it, slide over the floor and each other, and some escape around its ends. Then it
    comes back and begins again. A block that slides steadily before the blade feels mu times what
    it presses the floor with. The angles of the joints follow a plan; servos hold them.
    """

    title: ClassVar[str] = "Arm pushing a pile"
    description: ClassVar[str] = "An arm pushes a pile of blocks over the floor with a blade."
    application: ClassVar[str] = "robotics, manipulation"
    collection: ClassVar[str] = "robots"
    problems: ClassVar[int] = 1000

    blocks: int = parameter(40, "1", "number of blocks, at least 1")
    across: int = parameter(4, "1", "blocks side by side before the blade, at least 1")
    along: int = parameter(4, "1", "blocks one behind the other, at least 1")
    edge: float = parameter(0.05, "m", "largest edge of a block; the least is half of it")
    density: float = parameter(1000.0, "kg/m^3", "mass density of the blocks")
    arm: float = parameter(0.4, "m", "length of each of the two links")
    mass: float = parameter(2.0, "kg", "mass of a link, and of the blade")
    blade: float = parameter(0.4, "m", "width of the blade")
    period: float = parameter(1.6, "s", "of waiting, pushing and coming back")
    mu: float = parameter(0.5, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(1e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("edge", "density", "arm", "mass", "blade", "period", "time_step"),
            non_negative=("mu",),
            at_least={"blocks": 1, "across": 1, "along": 1},
        )

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the sizes of the blocks and how they are turned."""
        random = np.random.Generator(np.random.PCG64(seed))
        turned = mjcf.rotations(random, self.blocks)
        halves = 0.25 * self.edge * (1 + random.uniform(size=(self.blocks, 3)))
        pitch = math.sqrt(3) * self.edge  # whatever the rotation, they do not touch
        bodies = [self._arm()]
        for i in range(self.blocks):
            layer, cell = divmod(i, self.across * self.along)
            row, column = divmod(cell, self.across)
            place = (
                self._reach(0) + 0.5 * self._thickness + (row + 0.6) * pitch,
                (column - 0.5 * (self.across - 1)) * pitch,
                (layer + 0.55) * pitch,
            )
            bodies.append(
                mjcf.grain(
                    f"block{i}",
                    place,
                    f'type="box" size="{mjcf.numbers(*halves[i])}" density="{self.density!r}"',
                    mjcf.surface(self.mu),
                    mjcf.shade(i, self.blocks),
                    turned[i],
                )
            )
        start = np.array(self._angles(self._reach(0)))
        keys: list[str] = []
        for time, share in self._plan():
            angles = np.array(self._angles(self._reach(share))) - start
            keys.append(
                f'<key name="gait{len(keys)}" time="{time!r}" ctrl="{mjcf.numbers(*angles)}"/>'
            )
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            tile=0.5 * self.arm,
            rest=[
                "<actuator>",
                *(
                    f'<position joint="{name}" kp="{STIFFNESS!r}" kv="{DAMPING!r}"/>'
                    for name in ("shoulder", "elbow", "wrist")
                ),
                "</actuator>",
                "<keyframe>",
                *keys,
                "</keyframe>",
            ],
        )

    @property
    def _thickness(self) -> float:
        """The thickness of the blade [m]."""
        return 0.4 * self.edge

    def _reach(self, share: float) -> float:
        """The reach of the blade from the shoulder [m], at a share of its way out."""
        return 2 * self.arm * (NEAR + (FAR - NEAR) * share)

    def _plan(self) -> list[tuple[float, float]]:
        """Times [s], and the place of the blade as a share of its way."""
        ahead = [
            (REST + (PUSHED - REST) * k / KEYS, 0.5 - 0.5 * math.cos(math.pi * k / KEYS))
            for k in range(KEYS + 1)
        ]
        back = [
            (PUSHED + (1 - PUSHED) * k / KEYS, 0.5 + 0.5 * math.cos(math.pi * k / KEYS))
            for k in range(1, KEYS)
        ]
        # the first and the last alike, to the last bit
        shares = [(0.0, 0.0), *ahead, *back, (1.0, 0.0)]
        return [(time * self.period, share) for time, share in shares]

    def _angles(self, reach: float) -> tuple[float, float, float]:
        """The angles of shoulder, elbow, wrist [rad]; the blade is at (reach, 0), along x."""
        elbow = math.acos(0.5 * (reach / self.arm) ** 2 - 1)
        return -0.5 * elbow, elbow, -0.5 * elbow

    def _arm(self) -> str:
        """The arm above the pile, the blade close above the floor."""
        shoulder, elbow, wrist = self._angles(self._reach(0))
        layers = math.ceil(self.blocks / (self.across * self.along))
        height = (layers + 1) * math.sqrt(3) * self.edge
        clearance = 0.1 * self.edge
        size = (0.5 * self._thickness, 0.5 * self.blade, 0.5 * (height - clearance))
        link = (
            f'<geom type="capsule" size="{0.3 * self.edge!r}" contype="0" conaffinity="0"'
            f' fromto="{mjcf.numbers(0, 0, 0, self.arm, 0, 0)}" mass="{self.mass!r}"'
            f' material="solid" rgba="{IRON}"/>'
        )

        def hinged(name: str, place: tuple[float, float, float], turn: float, inside: str) -> str:
            return (
                f'<body name="{name}" pos="{mjcf.numbers(*place)}"'
                f' euler="{mjcf.numbers(0, 0, turn)}"><joint name="{name}" axis="0 0 1"/>'
                f"{inside}</body>"
            )

        blade = (
            f'<geom name="blade" type="box" size="{mjcf.numbers(*size)}"'
            f' pos="{mjcf.numbers(0, 0, -size[2])}" mass="{self.mass!r}"'
            f' {mjcf.surface(self.mu)} material="solid" rgba="{IRON}"/>'
        )
        end = (self.arm, 0.0, 0.0)
        hand = hinged("wrist", end, wrist, blade)
        lower = hinged("elbow", end, elbow, link + hand)
        return hinged("shoulder", (0.0, 0.0, height), shoulder, link + lower)
