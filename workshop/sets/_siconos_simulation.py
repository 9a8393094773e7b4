"""A script of Siconos: a scene by its mechanics and Bullet, in m, kg and s.

    /usr/bin/python3 workshop/sets/_siconos_simulation.py KIND BODIES MU STEPS

siconos_scenes.py records its steps.
"""

from __future__ import annotations

import math
import random
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.spatial
import siconos.io.mechanics_run as mechanics_run
import siconos.kernel as kernel
import siconos.numerics as numerics
from siconos.mechanics.collision.bullet import SiconosBulletOptions
from siconos.mechanics.collision.tools import Contactor

STEP = 0.005  # [s]


class Scene:
    """What is put into the file that Siconos simulates."""

    def __init__(self, io: Any) -> None:
        self.io = io
        self.random = random.Random(1)
        self.count = 0

    def body(
        self,
        shape: str,
        at: Sequence[float],
        velocity: Sequence[float],
        mass: float,
        inertia: Sequence[float] | np.ndarray,
        orientation: Sequence[float] = (1, 0, 0, 0),
    ) -> None:
        """A moving body; velocity has the angular one behind it."""
        self.count += 1
        self.io.add_object(
            f"body{self.count}",
            [Contactor(shape)],
            translation=list(at),
            orientation=list(orientation),
            velocity=list(velocity),
            mass=mass,
            inertia=inertia,
        )

    def box(
        self, sizes: Sequence[float], at: Sequence[float], velocity: Sequence[float], mass: float
    ) -> None:
        x, y, z = sizes
        shape = f"box{self.count}"
        self.io.add_primitive_shape(shape, "Box", sizes)
        inertia = [mass * (a * a + b * b) / 12 for a, b in ((y, z), (x, z), (x, y))]
        self.body(shape, at, velocity, mass, inertia)

    def ground(self) -> None:
        self.io.add_primitive_shape("Ground", "Box", (100, 100, 1))
        self.io.add_object("ground", [Contactor("Ground")], translation=[0, 0, -0.5])

    def bin(self, half: float) -> None:
        """A ground with four walls around it."""
        self.ground()
        for axis, sizes in enumerate(((0.5, 2 * half + 1, 40), (2 * half + 1, 0.5, 40))):
            self.io.add_primitive_shape(f"Side{axis}", "Box", sizes)
            for sign in (-1, 1):
                at = [0.0, 0.0, 20.0]
                at[axis] = sign * (half + 0.25)
                self.io.add_object(f"side{axis}{sign}", [Contactor(f"Side{axis}")], translation=at)

    def spin(self) -> list[float]:
        return [self.random.random() for _ in range(3)]


def hull(rng: random.Random) -> tuple[np.ndarray, np.ndarray, float]:
    """The corners of a rock of about 1 m, about its centre and principal axes; inertia / density
    and volume.
    """
    points = np.array([[rng.gauss(0, 1) for _ in range(3)] for _ in range(12)])
    points /= np.linalg.norm(points, axis=1)[:, None]
    points *= [[0.5 * (0.8 + 0.4 * rng.random())] for _ in points]
    faces = scipy.spatial.ConvexHull(points).simplices
    middle = points.mean(axis=0)
    edges = points[faces] - middle
    volumes = np.abs(np.linalg.det(edges)) / 6  # of tetrahedra with a corner in the middle
    points = points - middle - (volumes @ edges.sum(axis=1)) / 4 / volumes.sum()
    second = np.zeros((3, 3))  # the integral of x x^T
    for corners in points[faces]:
        volume = abs(np.linalg.det(corners)) / 6
        total = corners.sum(axis=0)
        second += volume / 20 * (corners.T @ corners + np.outer(total, total))
    values, axes = np.linalg.eigh(np.trace(second) * np.eye(3) - second)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    return points @ axes, values, float(volumes.sum())


def rocks(scene: Scene, bodies: int) -> None:
    """Polyhedra that fall onto a ground."""
    scene.ground()
    side = math.ceil(bodies ** (1 / 3))
    for k in range(bodies):
        corners, inertia, volume = hull(scene.random)
        shape = f"rock{k}"
        scene.io.add_convex_shape(shape, corners, insideMargin=0.02)
        i, j, level = k // side % side, k % side, k // side**2
        at = [1.25 * i + 0.2 * scene.random.random(), 1.25 * j, 0.9 + 1.25 * level]
        scene.body(shape, at, [0, 0, 0, *scene.spin()], 2500 * volume, 2500 * inertia)


def boxes(scene: Scene, bodies: int) -> None:
    """Boxes of several sizes that fall into a bin."""
    scene.bin(2.2)
    for k in range(bodies):
        sizes = [0.5 + 0.8 * scene.random.random() for _ in range(3)]
        at = [1.35 * (k // 3 % 3 - 1), 1.35 * (k % 3 - 1), 1 + 1.7 * (k // 9)]
        scene.box(sizes, at, [0, 0, -2, *scene.spin()], 1000 * math.prod(sizes))


def spheres(scene: Scene, bodies: int) -> None:
    """Spheres of several sizes that fall into a bin."""
    scene.bin(2)
    for k in range(bodies):
        radius = 0.25 + 0.2 * scene.random.random()
        mass = 1000 * 4 / 3 * math.pi * radius**3
        shape = f"sphere{k}"
        scene.io.add_primitive_shape(shape, "Sphere", (radius,))
        jitter = 0.02 * scene.random.random()
        at = [0.93 * (k // 4 % 4 - 1.5) + jitter, 0.93 * (k % 4 - 1.5), 0.6 + 0.95 * (k // 16)]
        scene.body(shape, at, [0, 0, -3, 0, 0, 0], mass, [0.4 * mass * radius**2] * 3)


def capsules(scene: Scene, bodies: int) -> None:
    """Capsules that fall into a bin."""
    scene.bin(1.6)
    scene.io.add_primitive_shape("Capsule", "Capsule", (0.2, 0.8))
    for k in range(bodies):
        half = scene.random.random() * math.pi / 2
        turned = [math.cos(half), 0.6 * math.sin(half), 0, 0.8 * math.sin(half)]
        at = [k // 2 % 3 - 1.0, 1.4 * (k % 2) - 0.8, 0.8 + 0.6 * (k // 6)]
        scene.body("Capsule", at, [0, 0, -2, 0, 0, 0], 100, [12, 2, 12], turned)


def wall(scene: Scene, bodies: int) -> None:
    """A wall, so many bricks high and long, that a ball hits."""
    scene.ground()
    for row in range(bodies):
        for column in range(bodies):
            at = [column + 0.5 * (row % 2), 0, 0.2 + 0.4 * row]
            scene.box((1, 0.5, 0.4), at, [0] * 6, 400)
    scene.io.add_primitive_shape("Ball", "Sphere", (0.5,))
    at = [bodies / 2, -2, 0.2 * bodies]
    scene.body("Ball", at, [0, 8, 0, 0, 0, 0], 3000, [300] * 3)


def towers(scene: Scene, bodies: int) -> None:
    """Three towers side by side, so many cubes of 1 to 1000 kg high; one of each is pushed."""
    scene.ground()
    for tower in range(3):
        for level in range(bodies):
            pushed = 1.5 if level == bodies // 2 else 0
            at = [tower, 0, 0.5 + level]
            scene.box((1, 1, 1), at, [pushed, 0, 0, 0, 0, 0], 10.0 ** (level % 4))


KINDS = {make.__name__: make for make in (rocks, boxes, spheres, capsules, wall, towers)}


class Cold(mechanics_run.FCTrace):  # type: ignore[misc]
    """A friction problem in blocks, solved without the step before: steps are independent."""

    def setMStorageType(self, storage: Any) -> None:
        super().setMStorageType(numerics.NM_SPARSE_BLOCK)

    def compute(self, time: float) -> int:
        self.setKeepLambdaAndYState(False)
        info: int = super().compute(time)
        return info


def main() -> None:
    kind, bodies, mu, steps = sys.argv[1:]
    options = kernel.solver_options_create(numerics.SICONOS_FRICTION_3D_NSGS)
    options.iparam[numerics.SICONOS_IPARAM_MAX_ITER] = 300
    options.dparam[numerics.SICONOS_DPARAM_TOL] = 1e-5
    bullet = SiconosBulletOptions()
    bullet.worldScale = 1.0
    bullet.perturbationIterations = 3
    bullet.minimumPointsPerturbationThreshold = 3
    mechanics_run.FCTrace = Cold
    with tempfile.TemporaryDirectory() as folder:
        file = str(Path(folder) / "scene.hdf5")
        with mechanics_run.MechanicsHdf5Runner(mode="w", io_filename=file) as io:
            KINDS[kind](Scene(io), int(bodies))
            io.add_Newton_impact_friction_nsl("contact", mu=float(mu), e=0.0)
        with mechanics_run.MechanicsHdf5Runner(mode="r+", io_filename=file) as io:
            io.run(
                bullet_options=bullet,
                T=int(steps) * STEP,
                h=STEP,
                theta=0.50001,
                Newton_max_iter=1,
                solver_options=options,
                verbose=False,
                verbose_progress=False,
                output_frequency=int(steps) + 1,
                friction_contact_trace_params=True,
            )


if __name__ == "__main__":
    main()
