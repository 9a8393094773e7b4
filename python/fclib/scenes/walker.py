"""A humanoid that walks over uneven ground with a bar in its hands: loops through its arms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.humanoid import Humanoid, Limb, Triple
from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import parameter

# of a body of 1.7 m [m]: from the trunk's origin to its hips, from there to knee and ankle
HIP, THIGH, SHIN = 0.1, 0.4, 0.38
KEYS = 64  # of a period


@dataclass(frozen=True, kw_only=True)
class Walker(Humanoid):
    """The humanoid with a bar in its hands, walking over blocks of drawn heights.

    Each hand is held to the bar by a bilateral constraint of three rows, so that trunk, arms and
    bar make a closed loop. Each joint of the legs has a servo that follows a plan: the trunk goes
    ahead at constant speed and from side to side along a sine, such that the zero moment point of
    a mass point at its height goes from one foot to the other; the soles stay level, and one foot
    at a time is lifted. Nothing is fed back but the angles of the joints: on ground that is too
    rough for it the body falls.

    The zero moment point: M. Vukobratovic, B. Borovac, Zero-moment point: thirty five years of its
    life, International Journal of Humanoid Robotics 1, 2004, 157-173.
    """

    title: ClassVar[str] = "Humanoid that walks on uneven ground"
    description: ClassVar[str] = (
        "An articulated humanoid that holds a bar with both hands and walks over uneven ground."
    )
    problems: ClassVar[int] = 750

    drop: float = parameter(0.0, "m", "height of the soles above the highest block at the start")
    stones: int = parameter(0, "1", "stones under the feet, at least 0")
    roughness: float = parameter(0.01, "m", "largest height of the ground's blocks; 0: a floor")
    bar: float = parameter(4.0, "kg", "mass of a bar that both hands hold, two loops; 0: none")
    period: float = parameter(1.2, "s", "of the gait, two steps")
    stride: float = parameter(0.3, "m", "that the trunk goes ahead in a period")
    lift: float = parameter(0.05, "m", "height of a foot in the middle of its way")
    airborne: float = parameter(0.3, "1", "share of a period that a foot is lifted, below 1/2")
    sway: float = parameter(0.1, "m", "that the zero moment point goes to either side")
    lean: float = parameter(0.02, "m", "that the trunk is ahead of the middle of the feet's way")
    crouch: float = parameter(0.06, "m", "that the hips are lower than on straight legs")
    gain: float = parameter(3000.0, "N m/rad", "of a servo in the legs")
    gain_rate: float = parameter(200.0, "N m s/rad", "of a servo in the legs, on the speed")
    time_step: float = parameter(4e-3, "s", "time step h")

    def __post_init__(self) -> None:
        super().__post_init__()
        mjcf.check(
            self,
            positive=("period", "airborne", "gain", "crouch"),
            non_negative=("stride", "lift", "sway", "gain_rate"),
        )
        if not self.airborne < 0.5:
            raise ValueError(f"Walker: airborne must be < 0.5, not {self.airborne}")
        try:
            for i in range(KEYS):
                self._controls(self.period * i / KEYS)
        except ValueError:
            raise ValueError(
                f"Walker: legs of a body of {self.height} m do not reach the feet's way; take less"
                f" stride ({self.stride}), lift ({self.lift}) or sway ({self.sway}), or another"
                f" crouch ({self.crouch})"
            ) from None

    @property
    def _way(self) -> float:
        return 8 * self.stride

    def trunk(self, time: float) -> float:
        """How far to the left the trunk is, at a time [s]; over the left foot at 0 [m]."""
        omega = 2 * math.pi / self.period
        height = self._scale * (HIP + THIGH + SHIN) - self.crouch
        # the zero moment point of y is y - height y'' / g
        return self.sway / (1 + height * omega**2 / self.gravity) * math.cos(omega * time)

    def ankle(self, side: int, time: float) -> Triple:
        """From the hip of a side (1: left, -1: right) to its ankle, at a time [s] [m]."""
        # a foot is in the middle of its way through the air half a period after its trunk's turn
        phase = (time / self.period + (0.0 if side > 0 else 0.5)) % 1.0
        way = (phase - 0.5) / self.airborne + 0.5
        x, up = -phase, 0.0
        if way >= 1:
            x += 1
        elif way > 0:
            # a cycloid: at both ends its speed is that of the ground
            x += way - math.sin(2 * math.pi * way) / (2 * math.pi)
            up = 0.5 * self.lift * (1 - math.cos(2 * math.pi * way))
        down = self._scale * (THIGH + SHIN) - self.crouch
        return x * self.stride - self.lean, -self.trunk(time), up - down

    def angles(self, side: int, time: float) -> list[float]:
        """The angles of a leg's joints from the hip down, with a level sole [rad]."""
        x, y, z = self.ankle(side, time)
        thigh, shin = self._scale * THIGH, self._scale * SHIN
        down = math.hypot(y, z)
        span = math.hypot(x, down)
        # law of cosines in the triangle of thigh, shin and span
        knee = math.pi - math.acos((thigh**2 + shin**2 - span**2) / (2 * thigh * shin))
        inner = math.acos((thigh**2 + span**2 - shin**2) / (2 * thigh * span))
        roll, pitch = math.atan2(y, -z), -math.atan2(x, down) - inner
        return [roll, pitch, knee, -pitch - knee, -roll]

    def _drive(self, hips: float, places: Sequence[Triple]) -> list[str]:
        motors = [
            f'<position joint="{limb.name}.{axis}" kp="{self.gain!r}" kv="{self.gain_rate!r}"/>'
            for limb in self._limbs_held
            if driven(limb)
            for axis, *_ in limb.joints
        ]
        keys = [
            f'<key name="gait{i}" time="{self.period * i / KEYS!r}"'
            f' ctrl="{mjcf.numbers(*self._controls(self.period * (i % KEYS) / KEYS))}"/>'
            for i in range(KEYS + 1)
        ]
        ahead, aside = self.stride / self.period, self.trunk(0.0)
        rest = (1.0, 0.0, 0.0, 0.0)
        position = [0.0, aside, hips - self.crouch, *rest]
        velocity = [ahead, 0.0, 0.0, 0.0, 0.0, 0.0]
        before, now, after = (self._controls(time) for time in (-1e-4, 0.0, 1e-4))
        legs = list(zip(now, (np.array(after) - np.array(before)) / 2e-4, strict=True))
        for limb in self._limbs_held:
            for _ in limb.joints:
                angle, speed = legs.pop(0) if driven(limb) else (0.0, 0.0)
                position.append(angle)
                velocity.append(float(speed))
        for i, (x, y, z) in enumerate(places):
            held = i == self.stones
            position += [x, y + aside, z - self.crouch, *rest] if held else [x, y, z, *rest]
            velocity += [ahead if held else 0.0, *[0.0] * 5]
        return [
            "<actuator>",
            *motors,
            "</actuator>",
            "<keyframe>",
            f'<key name="start" qpos="{mjcf.numbers(*position)}"'
            f' qvel="{mjcf.numbers(*velocity)}"/>',
            *keys,
            "</keyframe>",
        ]

    def _controls(self, time: float) -> list[float]:
        """The controls of all servos, left leg first."""
        return [*self.angles(1, time), *self.angles(-1, time)]

    def _held(self, limb: Limb, rest: float) -> str:
        # a servo's gear turns with the joint; the arms rest in the pose in which they hold the bar
        return 'armature="0.05"' if driven(limb) else super()._held(limb, 0.0)


def driven(limb: Limb) -> bool:
    """Whether its joints have servos: the legs'."""
    return limb.name.startswith(("thigh", "shin", "foot"))
