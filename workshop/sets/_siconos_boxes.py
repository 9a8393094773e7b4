"""A script of Siconos: boxes on a plane, in m, kg and s.

    /usr/bin/python3 workshop/sets/_siconos_boxes.py STEPS STEP SCALE BOXES

recorded_steps.py, record_simulators.py and judged_engines.py record its steps. STEP is the time
step; SCALE is Bullet's, whose margins are made for edges of 1 m. BOXES is a list in JSON of half
edges, mass, place and velocity: of the centre, or with the angular one behind it. A box with a
"press" [N] is on a slide along x, and pressed that way. Without such boxes the integrator is that
which keeps M and H; with them it is that which has joints.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import siconos.io.mechanics_run as mechanics_run
import siconos.kernel as kernel
import siconos.mechanics.collision.bullet as bullet
import siconos.numerics as numerics
from scipy import constants
from siconos.mechanics.collision.tools import Contactor

MU = 0.5
TOLERANCE = 1e-8
MOST_ITERATIONS = 10_000


def main() -> None:
    steps, step = int(sys.argv[1]), float(sys.argv[2])
    boxes = json.loads(sys.argv[4])
    presses = {i + 1: box["press"] for i, box in enumerate(boxes) if "press" in box}
    integrator, solver = kernel.MoreauJeanGOSI, numerics.SICONOS_GLOBAL_FRICTION_3D_NSGS_WR
    if presses:
        integrator, solver = kernel.MoreauJeanOSI, numerics.SICONOS_GENERIC_MECHANICAL_NSGS
    options = kernel.solver_options_create(solver)
    options.iparam[numerics.SICONOS_IPARAM_MAX_ITER] = MOST_ITERATIONS
    options.dparam[numerics.SICONOS_DPARAM_TOL] = TOLERANCE
    collision = bullet.SiconosBulletOptions()
    collision.worldScale = float(sys.argv[3])

    def pushed(body: Any) -> None:
        press = presses.get(body.number(), 0.0)
        body.setFExtPtr([press, 0, -body.scalarMass() * constants.g])

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
                    velocity=[*box["velocity"], 0, 0, 0][:6],
                    mass=box["mass"],
                    inertia=[box["mass"] / 12 * (sum(squares) - own) for own in squares],
                )
                if "press" in box:
                    io.add_joint(
                        f"slide{i}",
                        f"box{i}",
                        points=None,
                        axes=[[1, 0, 0]],
                        joint_class="PrismaticJointR",
                        absolute=True,
                    )
            io.add_Newton_impact_friction_nsl("contact", mu=MU, e=0.0)
        with mechanics_run.MechanicsHdf5Runner(mode="r+", io_filename=file) as io:
            io.run(
                T=steps * step,
                h=step,
                theta=0.50001,
                Newton_max_iter=1,
                osi=integrator,
                bullet_options=collision,
                solver_options=options,
                set_external_forces=pushed,
                verbose=False,
                verbose_progress=False,
                output_frequency=steps + 1,
            )


if __name__ == "__main__":
    main()
