"""A row of spur gears on pins with clearance, driven at one end and braked at the other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter

PRESSURE = math.radians(20)  # angle of the standard rack
FLANK = 6  # points of an involute
BORE = 24  # faces of a bore
IRON = "0.45 0.47 0.5 1"


@dataclass(frozen=True, kw_only=True)
class GearTrain(Published):
    """Involute gears mesh in a row; each hangs on a fixed pin, with play in its bore.

    Why it is here: few degrees of freedom and many contacts. One to two pairs of teeth mesh at a
    time, and the load jumps from one to two and back; with the pins each gear is held by three to
    five contacts, which come and go. A tooth changes flank when the play is passed, with an impact
    that runs through the whole train.

    A motor drives the first gear, and a damper brakes the last one. The mean speeds of the gears
    follow from the numbers of teeth. Without friction so do the torques.

    The involute: L. Euler, De aptissima figura rotarum dentibus tribuenda, Novi Commentarii
    academiae scientiarum Petropolitanae 5, 1760.
    """

    title: ClassVar[str] = "Gear train with clearances"
    description: ClassVar[str] = "Spur gears with backlash in a row, on pins with play; planar."
    application: ClassVar[str] = "multibody systems, machines"
    authors: ClassVar[str] = "the authors of FCLIB, after L. Euler"
    friction: ClassVar[str] = "Coulomb, one coefficient for teeth and pins"
    collection: ClassVar[str] = "machines"
    problems: ClassVar[int] = 600

    gears: int = parameter(5, "1", "number of gears, at least 2")
    teeth: int = parameter(18, "1", "teeth of the first gear, and of every second one, at least 12")
    others: int = parameter(27, "1", "teeth of the gears between, at least 12")
    module: float = parameter(0.01, "m", "pitch diameter for each tooth")
    backlash: float = parameter(2e-4, "m", "play between the teeth, along the pitch circle")
    clearance: float = parameter(5e-5, "m", "play of a pin in its bore")
    width: float = parameter(0.02, "m", "of the gears")
    torque: float = parameter(20.0, "N m", "of the motor; it turns around for a part of a period")
    brake: float = parameter(2.0, "N m s/rad", "damping of the last gear")
    period: float = parameter(0.3, "s", "of the motor; it pulls back in the last third")
    density: float = parameter(7800.0, "kg/m^3", "mass density")
    mu: float = parameter(0.1, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(5e-4, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("module", "width", "period", "density", "clearance", "time_step"),
            non_negative=("mu", "backlash", "torque", "brake"),
            at_least={"gears": 2, "teeth": 12, "others": 12},
        )

    def teeth_of(self, gear: int) -> int:
        """How many teeth a gear has."""
        return self.others if gear % 2 else self.teeth

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws at which angle the first gear stands."""
        random = np.random.Generator(np.random.PCG64(seed))
        counts = [self.teeth_of(i) for i in range(self.gears)]
        # a gear's angle about y at which a tooth points along x: meshing asks for a gap opposite
        angle = float(random.uniform()) * 2 * math.pi / counts[0]
        height = 0.75 * self.module * max(counts)
        bodies, x = [], 0.0
        for i, count in enumerate(counts):
            if i:
                before = counts[i - 1]
                x += 0.5 * self.module * (before + count)
                # opposite to a tooth of the one before there is a gap of this one
                phase = angle * before / (2 * math.pi)
                angle = math.pi - 2 * math.pi / count * (0.5 + phase)
            bodies += self._gear(i, (x, height), angle)
        drive = [
            # else normals leave the plane by more than rounding
            '<option ccd_tolerance="1e-12" ccd_iterations="200"/>',
            f'<actuator><motor joint="turn0" gear="{self.torque!r}"/></actuator>',
            "<keyframe>",
            *(
                f'<key name="gait{k}" time="{share * self.period!r}" ctrl="{value!r}"/>'
                for k, (share, value) in enumerate(
                    ((0.0, 1.0), (0.64, 1.0), (0.66, -1.0), (0.98, -1.0), (1.0, 1.0))
                )
            ),
            "</keyframe>",
        ]
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            assets=[self._tooth(f"tooth{count}", count) for count in dict.fromkeys(counts)],
            tile=10 * self.module,
            rest=drive,
            planar=True,
        )

    def _gear(self, i: int, place: tuple[float, float], angle: float) -> list[str]:
        """A gear at (x, z), a tooth at an angle from x to z, and its pin."""
        count = self.teeth_of(i)
        # neighbours mesh; a pin touches its own bore alone, as bores are apart
        bits = f'contype="{1 << (i % 2)}" conaffinity="{2 >> (i % 2)}"'
        friction = mjcf.surface(self.mu)
        teeth = ""
        for k in range(count):
            turn = angle + 2 * math.pi * k / count
            teeth += (
                f'<geom type="mesh" mesh="tooth{count}" euler="{mjcf.numbers(0, -turn, 0)}"'
                f' density="{self.density!r}" {bits} {friction} material="solid"'
                f' rgba="{mjcf.shade(k, count)}"/>'
            )
        bore = 0.2 * self.module * count
        wall = 0.1 * self.module * count
        faces = ""
        for k in range(BORE):
            turn = angle + 2 * math.pi * k / BORE
            away = bore + 0.5 * wall
            centre = (away * math.cos(turn), 0, away * math.sin(turn))
            half = (0.5 * wall, 0.5 * self.width, bore * math.tan(math.pi / BORE))
            faces += (
                f'<geom type="box" size="{mjcf.numbers(*half)}" pos="{mjcf.numbers(*centre)}"'
                f' euler="{mjcf.numbers(0, -turn, 0)}" contype="8" conaffinity="4"'
                f' density="{self.density!r}" {friction} material="solid" rgba="{IRON}"/>'
            )
        # the disc between bore and teeth: mass, and touched by nothing
        outer = 0.5 * self.module * (count - 2.5)
        inner = bore + wall
        mass = self.density * math.pi * (outer**2 - inner**2) * self.width
        disc = (
            f'<geom type="cylinder" size="{mjcf.numbers(outer, 0.4 * self.width)}"'
            f' euler="{mjcf.numbers(0.5 * math.pi, 0, 0)}" mass="{mass!r}" contype="0"'
            f' conaffinity="0" material="solid" rgba="{mjcf.shade(i, self.gears)}"/>'
        )
        joints = (
            f'<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>'
            f'<joint name="turn{i}" axis="0 1 0"'
            f' damping="{self.brake if i == self.gears - 1 else 0.0!r}"/>'
        )
        x, z = place
        pin = (
            f'<geom name="pin{i}" type="sphere" size="{bore - self.clearance!r}"'
            f' pos="{mjcf.numbers(x, 0, z)}" contype="4" conaffinity="8" {friction}'
            f' material="solid" rgba="{IRON}"/>'
        )
        body = f'<body name="gear{i}" pos="{mjcf.numbers(x, 0, z)}">{joints}{disc}{faces}{teeth}'
        return [pin, body + "</body>"]

    def _tooth(self, name: str, count: int) -> str:
        """A tooth along x from the root to its tip, between two involutes: convex."""
        pitch = 0.5 * self.module * count
        base = pitch * math.cos(PRESSURE)
        root, tip = pitch - 1.25 * self.module, pitch + self.module
        # half the angle of a tooth on the base circle
        half = (0.25 * math.pi * self.module - 0.25 * self.backlash) / pitch
        half += math.tan(PRESSURE) - PRESSURE
        points = []
        for radius in np.linspace(max(base, root), tip, FLANK).tolist():
            roll = math.acos(min(1.0, base / radius))
            points.append((radius, half - (math.tan(roll) - roll)))
        if root < base:  # straight to the centre
            points.insert(0, (root, half))
        corners = [
            (radius * math.cos(turn), side, radius * math.sin(turn))
            for radius, angle in points
            for turn in (-angle, angle)
            for side in (-0.5 * self.width, 0.5 * self.width)
        ]
        return mjcf.polyhedron_mesh(name, np.array(corners))
