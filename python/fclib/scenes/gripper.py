"""A gripper that closes on a row of blocks, lifts it by friction alone and shakes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter

JAW = (0.8, 0.15, 0.4)  # half edges of a jaw, along the row its thickness, in heights of a block
CLEARANCE = 0.1  # of a jaw from the floor, in heights of a block
STIFFNESS = 1e5  # [N/m] of the servo that holds the height
DAMPING = 2e3  # [N s/m] of it


@dataclass(frozen=True, kw_only=True)
class Gripper(Published):
    """Two jaws press on the ends of a row of blocks and lift it; nothing is under the blocks.

    A row of k blocks of mass m hangs on the friction of the two jaws. At rest it holds as long as
    the force of a jaw is at least k m g / (2 mu); the force here is `squeeze` times that, and below
    1 the row slides out. Between the blocks the shear goes from k m g / 2 at the jaws to 0 in the
    middle. Each face has four contacts, which are redundant. The lift begins so fast that the row
    slides for some steps, unless the jaws press harder (`squeeze=4`). How it turns then depends on
    how the contacts of a face share the force of the jaw, which is not unique: the last digits of a
    solver decide.

    A servo holds the height: the row rests while the jaws close, rises, and comes back, again and
    again.
    """

    title: ClassVar[str] = "Gripper lifting a row of blocks"
    description: ClassVar[str] = "A gripper closes on a row of blocks and lifts it by friction."
    application: ClassVar[str] = "robotics, grasping"
    collection: ClassVar[str] = "robots"
    problems: ClassVar[int] = 400

    blocks: int = parameter(5, "1", "blocks in the row, at least 1")
    height: float = parameter(0.08, "m", "height and width of a block")
    thickness: float = parameter(0.03, "m", "of a block, along the row")
    density: float = parameter(1000.0, "kg/m^3", "mass density of the blocks")
    jaw: float = parameter(0.5, "kg", "mass of a jaw")
    damping: float = parameter(100.0, "N s/m", "of a jaw's slide")
    squeeze: float = parameter(1.5, "1", "force of a jaw, of the least that holds the row")
    gap: float = parameter(1e-3, "m", "largest gap between blocks at the start")
    lift: float = parameter(0.1, "m", "how far the row is lifted")
    period: float = parameter(1.2, "s", "of closing, lifting and coming back")
    mu: float = parameter(0.5, "1", "coefficient of friction, above 0")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(2e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("height", "thickness", "density", "jaw", "period", "mu", "time_step"),
            non_negative=("damping", "squeeze", "gap", "lift"),
            at_least={"blocks": 1},
        )

    @property
    def mass(self) -> float:
        """The mass of the row [kg]."""
        return self.blocks * self.density * self.thickness * self.height**2

    @property
    def force(self) -> float:
        """The force of a jaw [N]."""
        return self.squeeze * self.mass * self.gravity / (2 * self.mu)

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the gaps between the blocks."""
        random = np.random.Generator(np.random.PCG64(seed))
        half = 0.5 * self.height
        bodies = []
        y = -0.5 * self.blocks * (self.thickness + self.gap)
        for i in range(self.blocks):
            y += self.gap * random.uniform() + 0.5 * self.thickness
            size = mjcf.numbers(half, 0.5 * self.thickness, half)
            bodies.append(
                mjcf.grain(
                    f"block{i}",
                    (0, y, half),
                    f'type="box" size="{size}" density="{self.density!r}"',
                    mjcf.surface(self.mu),
                    mjcf.shade(i, self.blocks),
                )
            )
            y += 0.5 * self.thickness
        reach = 0.5 * self.blocks * (self.thickness + self.gap) + 5e-3
        bodies.append(self._hand(reach))
        squeeze = (self.force, self.force)
        # closing, up, and down again
        heights = ((0.0, 0.0), (0.25, 0.0), (0.55, 1.0), (0.65, 1.0), (0.95, 0.0), (1.0, 0.0))
        keys = [
            f'<key name="gait{i}" time="{share * self.period!r}"'
            f' ctrl="{mjcf.numbers(*squeeze, up * self.lift)}"/>'
            for i, (share, up) in enumerate(heights)
        ]
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            tile=2 * self.height,
            rest=[
                "<actuator>",
                '<motor joint="left"/>',
                '<motor joint="right"/>',
                f'<position joint="lift" kp="{STIFFNESS!r}" kv="{DAMPING!r}"/>',
                "</actuator>",
                "<keyframe>",
                *keys,
                "</keyframe>",
            ],
        )

    def _hand(self, reach: float) -> str:
        """A carriage that rises, and two jaws in it whose faces are at y = +-reach [m]."""
        size = np.multiply(JAW, self.height)
        height = CLEARANCE * self.height + size[2]
        jaws = ""
        for name, side in (("left", -1.0), ("right", 1.0)):
            jaws += (
                f'<body name="{name}" pos="{mjcf.numbers(0, side * (reach + size[1]), 0)}">'
                f'<joint name="{name}" type="slide" axis="{mjcf.numbers(0, -side, 0)}"'
                f' damping="{self.damping!r}"/>'
                f'<geom type="box" size="{mjcf.numbers(*size)}" mass="{self.jaw!r}"'
                f' {mjcf.surface(self.mu)} material="solid" rgba="0.45 0.47 0.5 1"/></body>'
            )
        top = 1.5 * self.height
        width = reach + 2 * size[1]
        return (
            f'<body name="hand" pos="{mjcf.numbers(0, 0, height)}">'
            f'<joint name="lift" type="slide" axis="0 0 1"/>'
            f'<geom type="capsule" size="{0.1 * self.height!r}" contype="0" conaffinity="0"'
            f' fromto="{mjcf.numbers(0, -width, top, 0, width, top)}" mass="{4 * self.jaw!r}"'
            f' rgba="0.45 0.47 0.5 1"/>{jaws}</body>'
        )
