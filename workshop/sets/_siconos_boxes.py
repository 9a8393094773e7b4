"""A script of Siconos: a pile of boxes, in m, kg and s, by the integrator that keeps M and H.

    /usr/bin/python3 workshop/sets/_siconos_boxes.py STEPS [LEAN]

recorded_steps.py and record_simulators.py record its steps. LEAN is how far a box is further out
than the one below it, in edges.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import siconos.io.mechanics_run as mechanics_run
import siconos.kernel as kernel
import siconos.numerics as numerics
from siconos.mechanics.collision.tools import Contactor

STEP = 0.005  # [s]
BOXES = 6
EDGE = 1.0  # [m] Bullet's margins are made for such sizes
TOLERANCE = 1e-8
MOST_ITERATIONS = 10_000


def main() -> None:
    steps = int(sys.argv[1])
    lean = float(sys.argv[2]) if len(sys.argv) > 2 else 0.1
    options = kernel.solver_options_create(numerics.SICONOS_GLOBAL_FRICTION_3D_NSGS_WR)
    options.iparam[numerics.SICONOS_IPARAM_MAX_ITER] = MOST_ITERATIONS
    options.dparam[numerics.SICONOS_DPARAM_TOL] = TOLERANCE
    with tempfile.TemporaryDirectory() as folder:
        file = str(Path(folder) / "scene.hdf5")
        with mechanics_run.MechanicsHdf5Runner(mode="w", io_filename=file) as io:
            io.add_primitive_shape("Ground", "Box", (100, 100, 1))
            io.add_object("ground", [Contactor("Ground")], translation=[0, 0, -0.5])
            io.add_primitive_shape("Box", "Box", (EDGE, EDGE, EDGE))
            for i in range(BOXES):
                mass = 1.0 + i
                io.add_object(
                    f"box{i}",
                    [Contactor("Box")],
                    translation=[lean * EDGE * i, 0, (0.52 + 1.05 * i) * EDGE],
                    velocity=[0, 0, 0, 0.1, 0.2, 0.3],
                    mass=mass,
                    inertia=[mass * EDGE**2 / 6] * 3,
                )
            io.add_Newton_impact_friction_nsl("contact", mu=0.5, e=0.0)
        with mechanics_run.MechanicsHdf5Runner(mode="r+", io_filename=file) as io:
            io.run(
                T=steps * STEP,
                h=STEP,
                theta=0.50001,
                Newton_max_iter=1,
                osi=kernel.MoreauJeanGOSI,
                solver_options=options,
                verbose=False,
                verbose_progress=False,
                output_frequency=steps + 1,
            )


if __name__ == "__main__":
    main()
