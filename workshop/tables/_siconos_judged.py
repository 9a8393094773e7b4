"""A script of Siconos: free boxes on a plane, for judged_engines.py, which records its steps.

    /usr/bin/python3 workshop/tables/_siconos_judged.py STEPS BOXES

BOXES is a list in JSON of half edges, mass, place and velocity.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

import siconos.io.mechanics_run as mechanics_run
import siconos.kernel as kernel
import siconos.mechanics.collision.bullet as bullet
import siconos.numerics as numerics
from siconos.mechanics.collision.tools import Contactor

STEP = 2e-3  # [s]
MU = 0.5
SCALE = 5.0  # Bullet's margins are made for edges of 1 m


def main() -> None:
    steps, boxes = int(sys.argv[1]), json.loads(sys.argv[2])
    options = kernel.solver_options_create(numerics.SICONOS_GLOBAL_FRICTION_3D_NSGS_WR)
    options.iparam[numerics.SICONOS_IPARAM_MAX_ITER] = 10_000
    options.dparam[numerics.SICONOS_DPARAM_TOL] = 1e-8
    collision = bullet.SiconosBulletOptions()
    collision.worldScale = SCALE
    with tempfile.TemporaryDirectory() as folder:
        file = str(Path(folder) / "scene.hdf5")
        with mechanics_run.MechanicsHdf5Runner(mode="w", io_filename=file) as io:
            io.add_primitive_shape("Ground", "Box", (100, 100, 1))
            io.add_object("ground", [Contactor("Ground")], translation=[0, 0, -0.5])
            for i, box in enumerate(boxes):
                edges = [2 * half for half in box["half"]]
                squares = [edge**2 for edge in edges]
                io.add_primitive_shape(f"Box{i}", "Box", edges)
                io.add_object(
                    f"box{i}",
                    [Contactor(f"Box{i}")],
                    translation=box["place"],
                    velocity=[*box["velocity"], 0, 0, 0],
                    mass=box["mass"],
                    inertia=[box["mass"] / 12 * (sum(squares) - own) for own in squares],
                )
            io.add_Newton_impact_friction_nsl("contact", mu=MU, e=0.0)
        with mechanics_run.MechanicsHdf5Runner(mode="r+", io_filename=file) as io:
            io.run(
                T=steps * STEP,
                h=STEP,
                theta=0.50001,
                Newton_max_iter=1,
                osi=kernel.MoreauJeanGOSI,
                bullet_options=collision,
                solver_options=options,
                verbose=False,
                verbose_progress=False,
                output_frequency=steps + 1,
            )


if __name__ == "__main__":
    main()
