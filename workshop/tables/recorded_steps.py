"""Steps recorded from other engines: how exact they are, and `auto` beside the engine's reaction.

    PYTHON -m workshop.tables.recorded_steps [--results recorded-steps]

A pile of boxes in each engine, three steps each. PYTHON has fclib, Drake, Newton and PyBullet;
Siconos has an interpreter of its own (fclib.external.siconos). Engines that are not installed are
left out, and said. CPU times: that of Drake and of PyBullet is of their whole step, collisions and
all; that of Newton, of Siconos and of FCLIB is of the solve of the problem alone.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator
from typing import Any

import fclib
from fclib import recorders
from workshop.tables import _results

STEPS = (50, 150, 300)
TIMED = 10  # steps before, whose mean time is told
BOXES = 6
SIZE = 0.1  # [m] half an edge
LEAN = 0.02  # [m] that a box is further out than the one below it
TOLERANCE = 1e-8
REPEATS = 5  # of a solve, the least time counts
SICONOS = _results.ROOT / "workshop/sets/_siconos_boxes.py"


def place(i: int, lean: float) -> list[float]:
    """Of a box of the pile at the start [m]."""
    return [lean * i, 0, 0.105 + 0.21 * i]


def drake_pile(lean: float = LEAN) -> tuple[Any, Any]:
    """A plant of Drake's with the pile, and its simulator."""
    import pydrake.all as drake

    builder = drake.DiagramBuilder()
    plant, _ = drake.AddMultibodyPlantSceneGraph(builder, 2e-3)
    plant.set_contact_model(drake.ContactModel.kPoint)
    plant.set_discrete_contact_approximation(drake.DiscreteContactApproximation.kSap)
    plant.SetUseSampledOutputPorts(False)

    def properties() -> Any:
        known = drake.ProximityProperties()
        friction = drake.CoulombFriction(0.5, 0.5)
        drake.AddContactMaterial(point_stiffness=1e6, friction=friction, properties=known)
        known.AddProperty("material", "relaxation_time", 0.02)
        return known

    floor = drake.RigidTransform([0, 0, -0.5])
    plant.RegisterCollisionGeometry(
        plant.world_body(), floor, drake.Box(9, 9, 1), "floor", properties()
    )
    edge = 2 * SIZE
    for i in range(BOXES):
        inertia = drake.SpatialInertia.SolidBoxWithMass(1.0 + i, edge, edge, edge)
        body = plant.AddRigidBody(f"box{i}", inertia)
        plant.RegisterCollisionGeometry(
            body, drake.RigidTransform(), drake.Box(edge, edge, edge), f"box{i}", properties()
        )
        for k in range(8):
            corner = [SIZE * (1 - 2 * (k >> axis & 1)) for axis in range(3)]
            plant.RegisterCollisionGeometry(
                body, drake.RigidTransform(corner), drake.Sphere(0.005), f"{i}.{k}", properties()
            )
    plant.Finalize()
    simulator = drake.Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for i in range(BOXES):
        pose = drake.RigidTransform(drake.RollPitchYaw(0, 0, 0.1 * i), place(i, lean))
        plant.SetFreeBodyPose(context, plant.GetBodyByName(f"box{i}"), pose)
    return plant, simulator


def drakes() -> Iterator[tuple[Any, Any, float]]:
    """Drake's steps by both laws, and the CPU seconds of its own."""
    plant, simulator = drake_pile()
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for step in STEPS:
        simulator.AdvanceTo((step - TIMED) * 2e-3)
        start = time.process_time()
        simulator.AdvanceTo(step * 2e-3)
        took = (time.process_time() - start) / TIMED
        for law in ("hard", "sap"):
            yield recorders.drake(plant, context, law), law, took


def bullet_pile(lean: float = LEAN) -> tuple[Any, int, list[int]]:
    """PyBullet, a client of it with the pile, and the boxes."""
    import pybullet as bullet

    client = bullet.connect(bullet.DIRECT)
    bullet.setGravity(0, 0, -9.81)
    bullet.createMultiBody(0, bullet.createCollisionShape(bullet.GEOM_PLANE))
    box = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=[SIZE] * 3)
    bodies = []
    for i in range(BOXES):
        bodies.append(bullet.createMultiBody(1.0 + i, box, basePosition=place(i, lean)))
        bullet.changeDynamics(bodies[-1], -1, linearDamping=0, angularDamping=0)
    return bullet, client, bodies


def bullets() -> Iterator[tuple[Any, Any, float]]:
    """PyBullet's steps."""
    bullet, client, _ = bullet_pile()
    took = 0.0
    for step in range(max(STEPS) + 1):
        if step in STEPS:
            yield recorders.pybullet(client), "hard", took
            continue
        start = time.process_time()
        bullet.stepSimulation()
        took = time.process_time() - start
    bullet.disconnect()


def newton_pile(lean: float = LEAN) -> tuple[Any, list[Any]]:
    """Newton's Kamino, as it is by default but for its own collisions, and two states."""
    import newton
    import warp

    builder = newton.ModelBuilder()
    newton.solvers.SolverKamino.register_custom_attributes(builder)
    kind = newton.ModelBuilder.ShapeConfig
    builder.add_ground_plane(cfg=kind(mu=0.5))
    for i in range(BOXES):
        turn = warp.quat_from_axis_angle(warp.vec3(0, 0, 1), 0.1 * i)
        body = builder.add_body(xform=warp.transform(warp.vec3(*place(i, lean)), turn))
        material = kind(mu=0.5, density=(1.0 + i) / (2 * SIZE) ** 3)
        builder.add_shape_box(body, hx=SIZE, hy=SIZE, hz=SIZE, cfg=material)
    model = builder.finalize(device="cpu")
    solver = newton.solvers.SolverKamino(
        model, newton.solvers.SolverKamino.Config(use_collision_detector=True)
    )
    return solver, [model.state(), model.state()]


def newtons() -> Iterator[tuple[Any, Any, float]]:
    """Newton's steps by Kamino."""
    solver, states = newton_pile()
    # the solve of the problem alone
    own = solver._solver_kamino.solver_fd
    solve = own.solve
    took = 0.0

    def timed(**options: Any) -> None:
        nonlocal took
        start = time.process_time()
        solve(**options)
        took = time.process_time() - start

    own.solve = timed
    for step in range(max(STEPS) + 1):
        solver.step(*states, None, None, 2e-3)
        states.reverse()
        if step in STEPS:
            yield recorders.newton(solver), "hard", took


def siconos_pile(steps: int, lean: float = LEAN) -> list[str]:
    """Arguments of SICONOS: the pile with edges of 1 m, in steps of 5 ms."""
    out = 0.5 * lean / SIZE
    boxes = [
        {
            "half": [0.5] * 3,
            "mass": 1.0 + i,
            "place": [out * i, 0, 0.52 + 1.05 * i],
            "velocity": [0, 0, 0, 0.1, 0.2, 0.3],
        }
        for i in range(BOXES)
    ]
    return [str(steps), "0.005", "1", json.dumps(boxes)]


def siconoses() -> Iterator[tuple[Any, Any, float]]:
    """Siconos' steps, in steps of 5 ms."""
    every, arguments = min(STEPS), siconos_pile(max(STEPS) + 1)
    for recorded in recorders.siconos(SICONOS, arguments=arguments, every=every):
        if round(recorded.time / recorded.h) in STEPS:
            yield recorded, "hard", recorded.more["solve_cpu_s"]


def rows() -> Iterator[dict[str, Any]]:
    """A line of the table for each step."""
    for steps in (drakes, bullets, newtons, siconoses):
        try:
            for recorded, law, took in steps():
                yield row(recorded, law, took)
        except ImportError as error:
            print(f"left out: {error}", file=sys.stderr)


def row(recorded: Any, law: str, took: float) -> dict[str, Any]:
    """A step: its exactness, and both sides' errors and times."""
    problem = recorded.problem
    own = fclib.merit(problem, recorded.guess).error
    by_its_law = ""
    times = []
    for _ in range(REPEATS):
        result: Any
        if law == "sap":
            result = recorders.solve_associated(problem, tol=TOLERANCE)
        else:
            result = fclib.solve(problem, tol=TOLERANCE)
        times.append(result.cpu_s)
    reached = result.error
    if law == "sap":
        by_its_law = f"{recorders.associated_error(problem, recorded.guess.r):.0e}"
        reached = recorders.associated_error(problem, result.solution.r)
    return {
        "engine": f"{recorded.engine} {recorded.version}",
        "law": law,
        "contacts": problem.nc,
        "velocity off [m/s]": f"{recorded.mismatch:.0e}",
        "its error": f"{own:.0e}",
        "its error, own law": by_its_law,
        "its time [ms]": f"{1e3 * took:.2f}",
        "FCLIB": "associated" if law == "sap" else "auto",
        "FCLIB's error": f"{reached:.0e}",
        "FCLIB's time [ms]": f"{1e3 * min(times):.2f}",
    }


def main() -> None:
    """Print the table, and store it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    _results.add_option(parser)
    arguments = parser.parse_args()
    table = list(rows())
    if not table:
        sys.exit("no engine is installed: pip install 'fclib[recorders]'")
    for line in table:
        print("  ".join(str(entry) for entry in line.values()), flush=True)
    if arguments.results:
        path = _results.store(
            arguments.results,
            table,
            title="Steps of other engines",
            note=f"A pile of {BOXES} boxes; FCLIB to {TOLERANCE:g}. CPU time of Drake's and"
            " PyBullet's whole step, of Newton's, Siconos' and FCLIB's solve alone.",
            command="PYTHON -m workshop.tables.recorded_steps --results recorded-steps",
        )
        print(path)


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
