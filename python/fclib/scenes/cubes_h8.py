"""Two elastic cubes meshed by hexahedra, one pressed and pushed over the other."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter
from fclib.scenes.shared.solids import Bed, Block, Load, Solids


@dataclass(frozen=True, kw_only=True)
class CubesH8(Published):
    """An elastic cube on another, which is held on a stiff layer.

    The upper one falls a short way, is pressed down, and then pushed from the side until it slides.
    It is smaller, turned and set off a little, so that its nodes meet the faces below anywhere.

    After the set Cubes_H8 of the published FCLIB library, made by LMGC90: 2, 5 and 20 elements a
    side, mu = 0.3, the lower cube held by stiff springs. Sizes, material, loads, step and theta
    are chosen here.
    """

    title: ClassVar[str] = "Two elastic cubes"
    description: ClassVar[str] = (
        "Two elastic cubes of 8-node hexahedra, one falling on the other, pressed and pushed."
    )
    application: ClassVar[str] = "deformable solids"
    authors: ClassVar[str] = "V. Acary; original simulation by the developers of LMGC90"
    collection: ClassVar[str] = "deformable"
    problems: ClassVar[int] = 40

    elements: int = parameter(5, "1", "elements along an edge of a cube, at least 1")
    size: float = parameter(1.0, "m", "edge of the lower cube")
    upper: float = parameter(0.8, "m", "edge of the upper cube")
    young: float = parameter(1e7, "Pa", "Young's modulus")
    poisson: float = parameter(0.3, "1", "Poisson's ratio")
    density: float = parameter(1000.0, "kg/m^3", "density")
    mu: float = parameter(0.3, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution: 0, by the law")
    gap: float = parameter(2e-3, "m", "clearance of the cubes at the start")
    offset: float = parameter(
        0.03, "m", "largest horizontal offset of the upper cube along x and y"
    )
    yaw: float = parameter(0.2, "rad", "largest rotation of the upper cube about the vertical")
    fall: float = parameter(0.5, "m/s", "speed of the upper cube at the start, downwards")
    pressure: float = parameter(3e5, "Pa", "pressure on the upper cube")
    push: float = parameter(1e5, "Pa", "traction on a side of the upper cube, along x")
    rise: float = parameter(0.1, "s", "time in which the pressure grows, and after it the push")
    bed: float = parameter(1e9, "Pa/m", "stiffness of the layer below the lower cube")
    damping: float = parameter(1e-4, "s", "Kelvin-Voigt damping, C = damping K")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    theta: float = parameter(0.5, "1", "theta of the scheme, in [1/2, 1]")
    time_step: float = parameter(5e-3, "s", "time step h")

    # parameters of a small scene, which is simulated quickly
    small: ClassVar[Mapping[str, Any]] = {}

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("size", "upper", "young", "density", "rise", "time_step"),
            non_negative=("mu", "gap", "offset", "yaw", "fall", "bed", "damping"),
            at_least={"elements": 1},
        )
        if self.restitution != 0:
            raise ValueError(f"CubesH8: restitution must be 0, not {self.restitution}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the upper cube's offset and rotation."""
        random = np.random.Generator(np.random.PCG64(seed))
        x, y, yaw = (
            random.uniform(-1.0, 1.0, size=3) * (self.offset, self.offset, self.yaw)
        ).tolist()
        lower = Block(
            centre=(0.0, 0.0, 0.5 * self.size),
            size=(self.size,) * 3,
            elements=(self.elements,) * 3,
            young=self.young,
            poisson=self.poisson,
            density=self.density,
        )
        upper = dataclasses.replace(
            lower,
            centre=(x, y, self.size + self.gap + 0.5 * self.upper),
            size=(self.upper,) * 3,
            yaw=yaw,
            velocity=(0.0, 0.0, -self.fall),
        )
        solids = Solids(
            blocks=(lower, upper),
            mu=self.mu,
            reach=0.1 * self.size + self.gap,
            gravity=self.gravity,
            damping=self.damping,
            beds=(Bed(block=0, face="z-", stiffness=self.bed),),
            loads=(
                Load(blocks=(1,), face="z+", traction=(0.0, 0.0, -self.pressure), rise=self.rise),
                Load(
                    blocks=(1,),
                    face="x-",
                    traction=(self.push, 0.0, 0.0),
                    begin=self.rise,
                    rise=self.rise,
                ),
            ),
        )
        return Scene.of(self, seed, solids=solids, law="gap", theta=self.theta)


@dataclass(frozen=True, kw_only=True)
class CubesH8x2(CubesH8):
    """The cubes with two elements a side: a handful of contacts."""

    elements: int = parameter(2, "1", "elements along an edge of a cube, at least 1")


@dataclass(frozen=True, kw_only=True)
class CubesH8x20(CubesH8):
    """The cubes with twenty elements a side: 55,566 degrees of freedom."""

    problems: ClassVar[int] = 2
    small: ClassVar[Mapping[str, Any]] = {"elements": 3}

    elements: int = parameter(20, "1", "elements along an edge of a cube, at least 1")
