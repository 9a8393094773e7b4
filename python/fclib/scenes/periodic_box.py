"""Polyhedra stacked in a cell that repeats itself on all sides."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Published, Scene, parameter


@dataclass(frozen=True, kw_only=True)
class PeriodicBox(Published):
    """Random polyhedra that fall on a floor, in a square cell with periodic boundaries.

    What leaves on one side comes in on the other, so that the stack has no walls. A contact across
    the boundary acts on its two bodies like any other; see `fclib.simulate.periodic`. The law of
    contact is that of gaps, near to the one of LMGC90.

    After the set 100_PR_PerioBox of the FCLIB library: 100 polyhedra, mu = 0.8, a period of 25
    along x and y, by LMGC90. The polyhedra and their size in the cell are chosen here.
    """

    title: ClassVar[str] = "Polyhedra in a periodic box"
    description: ClassVar[str] = (
        "Random polyhedra stacked on a floor, in a cell with periodic boundaries."
    )
    application: ClassVar[str] = "granular matter"
    authors: ClassVar[str] = "V. Acary, the developers of LMGC90"
    collection: ClassVar[str] = "granular"
    problems: ClassVar[int] = 220
    # parameters of a small scene, which is simulated quickly
    small: ClassVar[Mapping[str, Any]] = {"polyhedra": 18, "shapes": 5, "period": 19.0}

    polyhedra: int = parameter(100, "1", "number of polyhedra, at least 1")
    shapes: int = parameter(25, "1", "polyhedra that differ, at least 1")
    radius: float = parameter(3.0, "m", "largest radius of a polyhedron, to its corners")
    spread: float = parameter(0.3, "1", "the smallest radius is smaller by this share, in [0, 1)")
    density: float = parameter(2500.0, "kg/m^3", "mass density")
    mu: float = parameter(0.8, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "0: the law of gaps is inelastic")
    period: float = parameter(25.0, "m", "edge of the cell, along x and along y")
    hexahedra: bool = parameter(
        False, "1", "whether polyhedra have six flat faces, on one of which each begins"
    )
    lift: float = parameter(
        0.2, "1", "hexahedra begin higher than their layer, by up to this share of a layer"
    )
    margin: float = parameter(0.0, "m", "a gap up to this is a contact too")
    all_bodies: bool = parameter(
        False, "1", "whether problems have the polyhedra that nothing touches too"
    )
    gravity: float = parameter(9.81, "m/s^2", "acceleration of gravity, downwards")
    time_step: float = parameter(0.02, "s", "time step h")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("radius", "density", "time_step"),
            non_negative=("mu", "spread", "lift", "margin"),
            at_least={"polyhedra": 1, "shapes": 1, "period": 4.2 * self.radius},
        )
        if self.restitution:
            raise ValueError(f"PeriodicBox: restitution must be 0, not {self.restitution}")
        if not self.spread < 1:
            raise ValueError(f"PeriodicBox: spread must be < 1, not {self.spread}")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; the seed draws the polyhedra and how they are turned."""
        random = np.random.Generator(np.random.PCG64(seed))
        corners = (mjcf.hexahedra if self.hexahedra else mjcf.polyhedra)(random, self.shapes)
        corners *= self.radius * (1 - self.spread * random.uniform(size=(self.shapes, 1, 1)))
        kinds = random.integers(self.shapes, size=self.polyhedra)
        turned = mjcf.rotations(random, self.polyhedra)
        lifts = self.lift * random.uniform(size=self.polyhedra)
        if self.hexahedra:
            # about the vertical only, and little, so that they lie close to each other
            half = 0.1 * turned[:, 3]
            turned = np.column_stack((np.cos(half), 0 * half, 0 * half, np.sin(half)))
            corners = mjcf.on_a_face(corners)
            depth, rise = -corners[:, :, 2].min(axis=1), np.ptp(corners[:, :, 2], axis=1).max()

        side = math.floor(self.period / ((1.22 if self.hexahedra else 2.05) * self.radius))
        pitch, height = self.period / side, 2.05 * self.radius
        bodies = mjcf.posts(0.5 * self.period, self.period)
        for i in range(self.polyhedra):
            layer, cell = divmod(i, side * side)
            x, y = pitch * (np.array(divmod(cell, side)) - 0.5 * (side - 1))
            # on a face, each a little higher than its layer
            z = height * (layer + 0.5)
            if self.hexahedra:
                z = (1 + self.lift) * rise * layer + depth[kinds[i]] + lifts[i] * rise
            bodies.append(
                mjcf.grain(
                    f"polyhedron{i}",
                    (x, y, z),
                    f'type="mesh" mesh="shape{kinds[i]}" density="{self.density!r}"',
                    mjcf.surface(self.mu),
                    mjcf.shade(i, self.polyhedra),
                    turned[i],
                )
            )
        return Scene.of_bodies(
            self,
            seed,
            bodies=bodies,
            assets=[mjcf.polyhedron_mesh(f"shape{k}", c) for k, c in enumerate(corners)],
            tile=0.125 * self.period,
            rest=mjcf.margins(self.margin),
            law="gap",
            period=(self.period, self.period),
            focus=(0.0, 0.0, 0.5 * self.period, 0.55 * self.period),
        )
