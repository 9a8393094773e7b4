"""An engine of slider-cranks whose small ends have clearance: the pin rattles inside its bore."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class SliderCrank(Published):
    """Slider-cranks on one shaft; each slider hangs on its rod by a pin in a wider bore.

    The rods move in their planes with all three degrees of freedom: at the big end a bilateral
    constraint closes the loop on the crank, at the small end the contacts of pin and bore alone
    do. The bore is a regular polygon about its circle; the pin touches one face or two, each at
    both of its ends, a redundant pair. It flies from one side of the bore to the other when the
    slider slows down; the steps are short, so that its penetration stays far below the clearance.

    The mechanism with clearance is that of P. Flores, J. Ambrosio, J. C. P. Claro and H. M.
    Lankarani, Kinematics and Dynamics of Multibody Systems with Imperfect Joints, Springer, 2008;
    sizes, the number of sliders and the polygon are chosen here.
    """

    title: ClassVar[str] = "Slider-cranks with clearance"
    description: ClassVar[str] = (
        "Driven slider-cranks on one shaft, whose pins have clearance in the bores of their rods."
    )
    application: ClassVar[str] = "mechanisms"
    collection: ClassVar[str] = "mixed"
    problems: ClassVar[int] = 500

    sliders: int = parameter(4, "1", "number of slider-cranks on the shaft, at least 1")
    crank: float = parameter(0.05, "m", "length of a crank, below that of the rod")
    rod: float = parameter(0.15, "m", "length of a rod")
    pin: float = parameter(0.01, "m", "radius of a pin")
    clearance: float = parameter(1e-3, "m", "radius of the bore's circle less that of the pin")
    sides: int = parameter(16, "1", "sides of a bore's polygon, at least 3")
    speed: float = parameter(60.0, "rad/s", "speed of the shaft")
    inertia: float = parameter(0.02, "kg m^2", "of the shaft with its flywheel")
    gain: float = parameter(5.0, "N m s/rad", "of the motor that holds the speed of the shaft")
    density: float = parameter(7800.0, "kg/m^3", "mass density of rods and sliders")
    mu: float = parameter(0.1, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution, in [0, 1]")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(2e-4, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("crank", "rod", "pin", "clearance", "density", "time_step"),
            non_negative=("mu", "inertia", "gain"),
            at_least={"sliders": 1, "sides": 3},
        )
        if self.crank >= self.rod:
            raise ValueError(
                f"SliderCrank: the crank ({self.crank}) must be shorter than the rod ({self.rod})"
            )

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the angle of the shaft at the start."""
        random = np.random.Generator(np.random.PCG64(seed))
        start = random.uniform(-math.pi, math.pi)
        pitch = 8 * self.pin  # of two sliders along the shaft
        shaft, bodies, loops = "", [], []
        for i in range(self.sliders):
            y = pitch * (i - 0.5 * (self.sliders - 1))
            colour = mjcf.shade(i, self.sliders)
            angle = start + 2 * math.pi * i / self.sliders
            x, z = self.crank * math.cos(angle), self.crank * math.sin(angle)
            tilt = math.asin(-z / self.rod)
            shaft += self._web(y, x, z, colour)
            bodies += [
                self._rod(i, x, y, z, tilt, colour),
                self._slider(i, x + self.rod * math.cos(tilt), y, colour),
            ]
            loops.append(
                f'<connect body1="rod{i}" body2="shaft" anchor="{mjcf.numbers(0, 0, 0)}"/>'
            )
        half = 0.5 * pitch * self.sliders
        shaft = (
            f'<body name="shaft" pos="{mjcf.numbers(0, 0, self._height)}">'
            f'<joint name="shaft" axis="0 -1 0" armature="{self.inertia!r}"/>'
            f"{self._bar((0, -half, 0), (0, half, 0), 0.8 * self.pin, IRON)}{shaft}</body>"
        )
        rails = [
            self._bar((0.5 * self.crank, y, z), (self._reach, y, z), 0.4 * self.pin, IRON, mass=0)
            for i in range(self.sliders)
            for y in [pitch * (i - 0.5 * (self.sliders - 1))]
            for z in (self._height - 3.4 * self.pin, self._height + 3.4 * self.pin)
        ]
        controls = mjcf.numbers(self.speed)
        return Scene.of_bodies(
            self,
            seed,
            bodies=[shaft, *bodies, *rails],
            tile=2 * self.crank,
            rest=[
                "<equality>",
                *loops,
                "</equality>",
                f'<actuator><velocity joint="shaft" kv="{self.gain!r}"/></actuator>',
                f'<keyframe><key name="start" ctrl="{controls}"/></keyframe>',
            ],
        )

    @property
    def _height(self) -> float:
        """The height of the shaft above the floor [m]."""
        return 2 * self.crank + 5 * self.pin

    @property
    def _reach(self) -> float:
        """The largest distance of a pin from the shaft [m]."""
        return self.crank + self.rod + 4 * self.pin

    @property
    def _width(self) -> float:
        """Half the width of a rod, and of the part of the pin that touches it [m]."""
        return 1.2 * self.pin

    def _web(self, y: float, x: float, z: float, colour: str) -> str:
        """A crank of the shaft and its pin at (x, z)."""
        return "".join(
            self._bar((0, side, 0), (x, side, z), self.pin, colour)
            for side in (y - 2.2 * self.pin, y + 2.2 * self.pin)
        ) + self._bar((x, y - 2.2 * self.pin, z), (x, y + 2.2 * self.pin, z), 0.6 * self.pin, IRON)

    def _rod(self, i: int, x: float, y: float, z: float, tilt: float, colour: str) -> str:
        """A rod in its plane, its big end on the crank pin; its small end is a polygon."""
        circle = self.pin + self.clearance
        wall = 0.5 * self.pin
        faces = []
        for k in range(self.sides):
            angle = 2 * math.pi * k / self.sides
            away = circle + 0.5 * wall
            place = (self.rod + away * math.cos(angle), 0, away * math.sin(angle))
            # a little longer than a side, so that the corners are closed
            half = (0.5 * wall, self._width, circle * math.tan(math.pi / self.sides))
            faces.append(
                f'<geom type="box" size="{mjcf.numbers(*half)}" pos="{mjcf.numbers(*place)}"'
                f' euler="{mjcf.numbers(0, -angle, 0)}" contype="2" conaffinity="1" condim="3"'
                f' friction="{self.mu!r}" density="{self.density!r}" material="solid"'
                f' rgba="{colour}"/>'
            )
        bar = self._bar((0, 0, 0), (self.rod - circle - wall, 0, 0), wall, colour)
        joints = "".join(
            f'<joint name="rod{i}{name}" type="{kind}" axis="{axis}"/>'
            for name, kind, axis in (
                ("x", "slide", "1 0 0"),
                ("z", "slide", "0 0 1"),
                ("turn", "hinge", "0 -1 0"),
            )
        )
        # joints act before the body's own rotation
        return (
            f'<body name="plane{i}" pos="{mjcf.numbers(x, y, self._height + z)}">'
            f'<body name="rod{i}" euler="{mjcf.numbers(0, -tilt, 0)}">'
            f"{joints}{bar}{''.join(faces)}</body></body>"
        )

    def _slider(self, i: int, x: float, y: float, colour: str) -> str:
        """A slider with its pin, two cheeks beside the rod and a crown."""
        cheek = mjcf.numbers(2.2 * self.pin, 0.4 * self.pin, 1.2 * self.pin)
        crown = mjcf.numbers(0.5 * self.pin, 3 * self.pin, 3 * self.pin)
        look = (
            f'contype="0" conaffinity="0" density="{self.density!r}" material="solid"'
            f' rgba="{colour}"'
        )
        cheeks = "".join(
            f'<geom type="box" size="{cheek}" pos="{mjcf.numbers(self.pin, side, 0)}" {look}/>'
            for side in (-2.2 * self.pin, 2.2 * self.pin)
        )
        end = self._width - self.pin * 0.1
        return (
            f'<body name="slider{i}" pos="{mjcf.numbers(x, y, self._height)}">'
            f'<joint name="slider{i}" type="slide" axis="1 0 0"/>'
            f'<geom type="capsule" size="{self.pin!r}" contype="1" conaffinity="2" condim="3"'
            f' fromto="{mjcf.numbers(0, -end, 0, 0, end, 0)}" friction="{self.mu!r}"'
            f' density="{self.density!r}" material="solid" rgba="{IRON}"/>{cheeks}'
            f'<geom type="box" size="{crown}" pos="{mjcf.numbers(3.5 * self.pin, 0, 0)}" {look}/>'
            "</body>"
        )

    def _bar(
        self,
        start: tuple[float, float, float],
        end: tuple[float, float, float],
        radius: float,
        colour: str,
        mass: float | None = None,
    ) -> str:
        """A bar that touches nothing."""
        weight = f'density="{self.density!r}"' if mass is None else f'mass="{mass!r}"'
        return (
            f'<geom type="capsule" size="{radius!r}" contype="0" conaffinity="0" {weight}'
            f' fromto="{mjcf.numbers(*start, *end)}" material="solid" rgba="{colour}"/>'
        )


IRON = "0.45 0.47 0.5 1"
