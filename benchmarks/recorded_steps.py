"""Steps recorded from other engines: how exact they are, and `auto` beside the engine's reaction.

    .venv/bin/python benchmarks/recorded_steps.py

A pile of boxes in Drake and in PyBullet, three steps each; engines that are not installed are left
out. CPU times: that of the engine is of its whole step, collisions and all; that of FCLIB is of the
solve of the problem alone.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from typing import Any

import fclib
from fclib import recorders

STEPS = (50, 150, 300)
TIMED = 10  # steps before, whose mean time is told
BOXES = 6
SIZE = 0.1  # [m] half an edge


def drakes() -> Iterator[tuple[Any, Any, float]]:
    """Drake's steps by both laws, and the CPU seconds of its own."""
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
        pose = drake.RigidTransform(
            drake.RollPitchYaw(0, 0, 0.1 * i), [0.02 * i, 0, 0.105 + 0.21 * i]
        )
        plant.SetFreeBodyPose(context, plant.GetBodyByName(f"box{i}"), pose)
    for step in STEPS:
        simulator.AdvanceTo((step - TIMED) * 2e-3)
        start = time.process_time()
        simulator.AdvanceTo(step * 2e-3)
        took = (time.process_time() - start) / TIMED
        for law in ("hard", "sap"):
            yield recorders.drake(plant, context, law), law, took


def bullets() -> Iterator[tuple[Any, Any, float]]:
    """PyBullet's steps."""
    import pybullet as bullet

    client = bullet.connect(bullet.DIRECT)
    bullet.setGravity(0, 0, -9.81)
    bullet.createMultiBody(0, bullet.createCollisionShape(bullet.GEOM_PLANE))
    box = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=[SIZE] * 3)
    for i in range(BOXES):
        body = bullet.createMultiBody(1.0 + i, box, basePosition=[0.02 * i, 0, 0.105 + 0.21 * i])
        bullet.changeDynamics(body, -1, linearDamping=0, angularDamping=0)
    took = 0.0
    for step in range(max(STEPS) + 1):
        if step in STEPS:
            yield recorders.pybullet(client), "hard", took
            continue
        start = time.process_time()
        bullet.stepSimulation()
        took = time.process_time() - start
    bullet.disconnect()


def main() -> None:
    """Print the table."""
    print("| engine | law | contacts | free velocity | own error | its step, ms | FCLIB | ms |")
    print("|---|---|---|---|---|---|---|---|")
    for steps in (drakes, bullets):
        with contextlib.suppress(ImportError):
            for recorded, law, took in steps():
                problem = recorded.problem
                own = fclib.merit(problem, recorded.guess).error
                said = f"{own:.1e}"
                if law == "sap":
                    by_its_own = recorders.associated_error(problem, recorded.guess.r)
                    result: Any = recorders.solve_associated(problem, tol=1e-8)
                    reached = recorders.associated_error(problem, result.solution.r)
                    said, name = f"{own:.0e}; by its law {by_its_own:.0e}", "`associated` "
                else:
                    result = fclib.solve(problem, tol=1e-8)
                    reached, name = result.error, "`auto` "
                print(
                    f"| {recorded.engine} {recorded.version} | {law} | {problem.nc} |"
                    f" {recorded.mismatch:.0e} m/s | {said} |"
                    f" {1e3 * took:.2f} |"
                    f" {name}{reached:.0e} | {1e3 * result.cpu_s:.2f} |",
                    flush=True,
                )


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
