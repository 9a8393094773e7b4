"""A low wall of elastic blocks, pushed at its top while a load passes over it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter
from fclib.scenes.shared.solids import Block, Load, Solids


@dataclass(frozen=True, kw_only=True)
class LowWallFEM(Published):
    """Dry blocks in running bond on a rigid floor, each meshed coarsely.

    Its weight and a pressure on its top press the wall. A wave of further pressure passes along the
    top, and a push along the top shears the wall. Every second course ends in half blocks; head
    joints have a small gap that the seed draws.

    After the set LowWall_FEM of the published FCLIB library, made by LMGC90, a shear test on a low
    wall. All sizes, the material, the loads and the step are chosen here.
    """

    title: ClassVar[str] = "Low wall of elastic blocks"
    description: ClassVar[str] = (
        "A low wall of elastic blocks of 8-node hexahedra, sheared while a load passes over it."
    )
    application: ClassVar[str] = "masonry, deformable solids"
    authors: ClassVar[str] = "V. Acary, F. Dubois; original simulation by the developers of LMGC90"
    collection: ClassVar[str] = "deformable"
    problems: ClassVar[int] = 50
    # parameters of a small scene, which is simulated quickly
    small: ClassVar[Mapping[str, Any]] = {"courses": 2, "length": 2}

    courses: int = parameter(5, "1", "number of courses, at least 1")
    length: int = parameter(10, "1", "blocks of a course, at least 1")
    block: float = parameter(0.4, "m", "length of a block")
    height: float = parameter(0.2, "m", "height of a block")
    depth: float = parameter(0.2, "m", "depth of a block")
    elements: int = parameter(2, "1", "elements along height and depth, and half the length")
    joint: float = parameter(5e-4, "m", "largest gap of a head joint at the start")
    young: float = parameter(1e9, "Pa", "Young's modulus")
    poisson: float = parameter(0.2, "1", "Poisson's ratio")
    density: float = parameter(2000.0, "kg/m^3", "density")
    mu: float = parameter(0.8, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution: 0, by the law")
    pressure: float = parameter(1e5, "Pa", "pressure on the top")
    wave: float = parameter(2e5, "Pa", "greatest pressure of the wave, beyond that")
    push: float = parameter(5e4, "Pa", "traction on the top, along the wall")
    rise: float = parameter(0.03, "s", "time in which each load grows; the push begins at the end")
    width: float = parameter(1.6, "m", "length of the wave")
    speed: float = parameter(25.0, "m/s", "speed of the wave")
    damping: float = parameter(1e-4, "s", "Kelvin-Voigt damping, C = damping K")
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    theta: float = parameter(0.5, "1", "theta of the scheme, in [1/2, 1]")
    time_step: float = parameter(2e-3, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=(
                *("block", "height", "depth", "young", "density", "rise", "width", "time_step"),
            ),
            non_negative=("mu", "joint", "damping"),
            at_least={"courses": 1, "length": 1, "elements": 1},
        )
        if self.restitution != 0:
            raise ValueError(f"LowWallFEM: restitution must be 0, not {self.restitution}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the gaps of the head joints."""
        random = np.random.Generator(np.random.PCG64(seed))
        # a random row for each course, all drawn at once: a higher wall begins like a lower one
        gaps = self.joint * random.uniform(0.0, 1.0, size=(self.courses, self.length + 1))
        blocks: list[Block] = []
        top: list[int] = []
        for course in range(self.courses):
            whole = course % 2 == 0
            shares = [1.0] * self.length if whole else [0.5, *[1.0] * (self.length - 1), 0.5]
            x = -0.5 * self.length * self.block
            top = []
            for share, gap in zip(shares, gaps[course].tolist(), strict=False):
                size = share * self.block - gap
                top.append(len(blocks))
                blocks.append(
                    Block(
                        centre=(x + 0.5 * share * self.block, 0.0, (course + 0.5) * self.height),
                        size=(size, self.depth, self.height),
                        elements=(round(2 * share * self.elements), self.elements, self.elements),
                        young=self.young,
                        poisson=self.poisson,
                        density=self.density,
                    )
                )
                x += share * self.block
        solids = Solids(
            blocks=tuple(blocks),
            mu=self.mu,
            reach=0.1 * self.height,
            gravity=self.gravity,
            damping=self.damping,
            floor=True,
            loads=(
                Load(
                    blocks=tuple(top),
                    face="z+",
                    traction=(0.0, 0.0, -self.pressure),
                    rise=self.rise,
                ),
                Load(
                    blocks=tuple(top),
                    face="z+",
                    traction=(0.0, 0.0, -self.wave),
                    rise=self.rise,
                    width=self.width,
                    start=-0.3 * self.length * self.block,
                    speed=self.speed,
                ),
                Load(
                    blocks=tuple(top),
                    face="z+",
                    traction=(self.push, 0.0, 0.0),
                    begin=self.rise,
                    rise=self.rise,
                ),
            ),
        )
        # from nearly the front, since it is long
        view = (105.0, -12.0)
        return Scene.of(self, seed, solids=solids, law="gap", theta=self.theta, view=view)
