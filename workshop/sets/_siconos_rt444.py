"""A script of Siconos: a scene of RT-0444, with Bullet.

    /usr/bin/python3 workshop/sets/_siconos_rt444.py SCENE END [STEP.npz]

rt444_states.py records its steps, and solves them: Siconos' nsgs or ADMM end at 1e-5 or so from
nine boxes above each other on, and the stack falls. It begins where the recorded STEP begins, or at
the start of the scene, and ends at END [s]. There is one iteration of Newton's a step.
"""

from __future__ import annotations

import io as streams
import os
import sys
import tempfile
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse
import siconos.io.mechanics_run as mechanics_run
import siconos.kernel as kernel
import siconos.numerics as numerics
from _rt444_scenes import SCENES, Body  # type: ignore[import-not-found]
from siconos.mechanics.collision.bullet import SiconosBulletOptions
from siconos.mechanics.collision.tools import Contactor

KINDS = {"box": "Box", "capsule": "Capsule", "sphere": "Sphere"}


def solved_by(connection: Any) -> Any:
    """Makes friction problems that the process at the other end solves."""

    class Asked(kernel.FrictionContact):  # type: ignore[misc]
        def solve(self, *_: object) -> int:
            problem = self.frictionContactProblemPtr()
            m = problem.dimension * problem.numberOfContacts
            W = problem.M
            if self.getMStorageType() == numerics.NM_SPARSE_BLOCK:
                numerics.NM_clear_not_SBM(W)  # otherwise the values of a step before remain
                W = numerics.NM_csc(W)
            else:
                W = np.array(W)[:m, :m]
            W, q = scipy.sparse.csc_matrix(W), np.array(self.q())[:m]
            told = streams.BytesIO()
            mu = np.array(problem.mu)[: problem.numberOfContacts]
            np.savez(told, data=W.data, indices=W.indices, indptr=W.indptr, q=q, mu=mu)
            connection.send_bytes(told.getvalue())
            r = np.frombuffer(connection.recv_bytes())
            self.z()[:m], self.w()[:m] = r, W @ r + q
            return 0

    # a class that is itself in siconos.kernel computes in C++
    return lambda *arguments: Asked(*arguments)


def beginning(name: str, step: Path | None) -> tuple[list[Body], float]:
    """The bodies of a scene, at its start or at that of a recorded step, and the time [s]."""
    bodies = SCENES[name].bodies()
    if step is None:
        return bodies, 0.0
    with np.load(step) as known:
        start = float(known["end"]) - float(known["h"])
        positions, velocities = known["positions"], known["velocities"]
    # Siconos counts the bodies that move from 1
    order = np.argsort(positions[:, 0])
    states = iter(zip(positions[order, 1:], velocities[order, 1:], strict=True))
    found = []
    for body in bodies:
        if body.mass:
            pose, twist = (tuple(values.tolist()) for values in next(states))
            body = replace(body, place=pose[:3], turn=pose[3:], velocity=twist)
        found.append(body)
    return found, start


def make(file: str, bodies: list[Body], mu: float) -> None:
    """Write the scene as Siconos' mechanics reads it."""
    with mechanics_run.MechanicsHdf5Runner(mode="w", io_filename=file) as io:
        for body in bodies:
            shape = f"{body.kind} {' '.join(map(str, body.sizes))}"
            io.add_primitive_shape(shape, KINDS[body.kind], body.sizes)
            moving = {"mass": body.mass, "inertia": body.inertia} if body.mass else {}
            io.add_object(
                body.name,
                [Contactor(shape)],
                translation=list(body.place),
                orientation=list(body.turn),
                velocity=list(body.velocity),
                **moving,
            )
        io.add_Newton_impact_friction_nsl("contact", mu=mu, e=0.0)


def main() -> None:
    name, end, *step = sys.argv[1:]
    scene = SCENES[name]
    kernel.FrictionContact = solved_by(Connection(int(os.environ["FCLIB_SOLVES"])))
    bodies, start = beginning(name, Path(step[0]) if step else None)
    collision = SiconosBulletOptions()
    collision.contactBreakingThreshold = scene.near
    with tempfile.TemporaryDirectory() as folder:
        file = str(Path(folder) / "scene.hdf5")
        make(file, bodies, scene.mu)
        with mechanics_run.MechanicsHdf5Runner(mode="r+", io_filename=file) as io:
            io.run(
                t0=start,
                T=float(end),
                h=scene.step,
                theta=scene.theta,
                bullet_options=collision,
                Newton_options=kernel.SICONOS_TS_LINEAR,
                Newton_max_iter=1,
                verbose=False,
                verbose_progress=False,
                output_frequency=round(scene.end / scene.step) + 1,
            )


if __name__ == "__main__":
    main()
