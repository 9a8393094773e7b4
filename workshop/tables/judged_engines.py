"""How far engines are from Coulomb's law, each on the same scenes, beside our own steps.

    PYTHON -m workshop.tables.judged_engines [--scene slide ...] [--steps 500] [--page FILE]
        [--results judged-engines]

PYTHON has fclib, MuJoCo, MuJoCo Warp, Drake, Genesis, Newton and PyBullet; Siconos has an
interpreter of its own (fclib.external.siconos). Engines that are not installed are left out, and
said. Each engine has its default settings, but for the scene, the time step of 2 ms, Coulomb's
coefficient and the damping of velocities, which is 0; Genesis has elliptic cones. PyBullet presses
the gripper by motors whose force is limited: the limit is the force. Siconos has another integrator
for the gripper, that of joints. The criteria are those of `fclib judge`.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import fclib
from fclib import recorders
from fclib.report.judged import shown, write_judged
from workshop.tables import _results

H = 2e-3  # [s]
STEPS = 500
MU = 0.5
ROOM = 200  # contacts for which MuJoCo Warp keeps memory
KEPT = 5  # one step in so many is judged
SICONOS = _results.ROOT / "workshop/sets/_siconos_boxes.py"
SICONOS_SCALE = "5"  # of edges of 0.2 m


@dataclass(frozen=True)
class Box:
    """A free box."""

    half: tuple[float, float, float]  # [m]
    mass: float  # [kg]
    place: tuple[float, float, float]  # of its centre at the start [m]
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m/s]


CUBE = (0.1, 0.1, 0.1)
SCENES = {
    "slide": [Box(CUBE, 2.0, (0, 0, 0.1), (2.0, 0, 0))],
    "stack": [Box(CUBE, 1.0 + i, (0, 0, 0.1 + 0.2 * i)) for i in range(6)],
    "pile": [Box(CUBE, 1.0 + i, (0.06 * i, 0, 0.105 + 0.21 * i)) for i in range(6)],
    "gripper": [Box(CUBE, 2.0, (0, 0, 1))],
}
# boxes on slides along x, each pressed towards x = 0 by PRESS: they hold a box in the air
PADS = {
    "gripper": [Box((0.05, 0.1, 0.1), 1.0, (-0.15, 0, 1)), Box((0.05, 0.1, 0.1), 1.0, (0.15, 0, 1))]
}
PRESS = 40.0  # [N]
FASTEST = 10.0  # speed that PyBullet's motors never reach [m/s]


def mjcf(boxes: list[Box], pads: list[Box]) -> str:
    """The scene as MuJoCo's file, with elliptic cones."""
    bodies = "".join(
        f'<body pos="{words(box.place)}"><freejoint/>'
        f'<geom type="box" size="{words(box.half)}" mass="{box.mass}"/></body>'
        for box in boxes
    )
    speeds = " ".join(f"{words(box.velocity)} 0 0 0" for box in boxes)
    places = " ".join(f"{words(box.place)} 1 0 0 0" for box in boxes)
    zeros, forces = " 0" * len(pads), f" {PRESS}" * len(pads)
    return (
        f'<mujoco><option timestep="{H}" cone="elliptic"/>'
        f'<default><geom friction="{MU} 0 0"/></default><worldbody>'
        f'<geom type="plane" size="9 9 1"/>{bodies}{slides(pads)}</worldbody><actuator>'
        + "".join(f'<motor joint="slide{i}"/>' for i in range(len(pads)))
        + f'</actuator><keyframe><key name="start" qpos="{places}{zeros}" qvel="{speeds}{zeros}"'
        f' ctrl="{forces}"/></keyframe></mujoco>'
    )


def slides(pads: list[Box]) -> str:
    """The pads as bodies of MuJoCo's file."""
    return "".join(
        f'<body pos="{words(pad.place)}"><joint name="slide{i}" type="slide"'
        f' axis="{inwards(pad)} 0 0"/>'
        f'<geom type="box" size="{words(pad.half)}" mass="{pad.mass}"/></body>'
        for i, pad in enumerate(pads)
    )


def inwards(pad: Box) -> float:
    """The direction along x in which a pad is pressed."""
    return -math.copysign(1, pad.place[0])


def words(numbers: Any) -> str:
    """Numbers, side by side."""
    return " ".join(map(str, numbers))


def scene_text(scene: str) -> str:
    """The scene as MuJoCo's file."""
    return mjcf(SCENES[scene], PADS.get(scene, []))


def mujocos(scene: str, steps: int) -> Iterator[Any]:
    """MuJoCo's steps."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(scene_text(scene))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(steps):
        yield recorders.mujoco(model, data)


def mujoco_warps(scene: str, steps: int) -> Iterator[Any]:
    """MuJoCo Warp's steps, in single precision."""
    import mujoco
    import mujoco_warp

    model = mujoco.MjModel.from_xml_string(scene_text(scene))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    warp_model = mujoco_warp.put_model(model)
    warp_data = mujoco_warp.put_data(model, data, nconmax=ROOM, njmax=4 * ROOM)
    for _ in range(steps):
        yield recorders.mujoco_warp(model, warp_model, warp_data)


def geneses(scene: str, steps: int) -> Iterator[Any]:
    """Genesis' steps, in single precision, by its law for sliding contacts."""
    import genesis as gs

    boxes, pads = SCENES[scene], PADS.get(scene, [])
    if not getattr(gs, "_initialized", False):
        gs.init(backend=gs.cpu, logging_level="error")
    world = gs.Scene(
        show_viewer=False,
        sim_options=gs.options.SimOptions(dt=H, substeps=1),
        rigid_options=gs.options.RigidOptions(friction_cone=gs.friction_cone.elliptic),
    )
    world.add_entity(gs.morphs.Plane(), material=gs.materials.Rigid(friction=MU))
    bodies = []
    for box in boxes:
        size = tuple(2 * half for half in box.half)
        rho = box.mass / math.prod(size)
        bodies.append(
            world.add_entity(
                gs.morphs.Box(pos=box.place, size=size),
                material=gs.materials.Rigid(rho=rho, friction=MU),
            )
        )
    if pads:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "pads.xml"
            file.write_text(f"<mujoco><worldbody>{slides(pads)}</worldbody></mujoco>")
            gripper = world.add_entity(
                gs.morphs.MJCF(file=str(file)), material=gs.materials.Rigid(friction=MU)
            )
    world.build()
    if pads:
        gripper.control_dofs_force([PRESS] * len(pads))
    for body, box in zip(bodies, boxes, strict=True):
        body.set_dofs_velocity([*box.velocity, 0.0, 0.0, 0.0])
    for _ in range(steps):
        yield recorders.genesis(world)


def drakes(scene: str, steps: int) -> Iterator[Any]:
    """Drake's steps, judged by the law of rigid contacts."""
    import pydrake.all as drake

    boxes, pads = SCENES[scene], PADS.get(scene, [])
    builder = drake.DiagramBuilder()
    plant, _ = drake.AddMultibodyPlantSceneGraph(builder, H)
    plant.set_contact_model(drake.ContactModel.kPoint)
    plant.set_discrete_contact_approximation(drake.DiscreteContactApproximation.kSap)
    plant.SetUseSampledOutputPorts(False)

    def properties() -> Any:
        known = drake.ProximityProperties()
        friction = drake.CoulombFriction(MU, MU)
        drake.AddContactMaterial(friction=friction, properties=known)
        return known

    floor = drake.RigidTransform([0, 0, -0.5])
    plant.RegisterCollisionGeometry(
        plant.world_body(), floor, drake.Box(90, 90, 1), "floor", properties()
    )
    for i, box in enumerate([*boxes, *pads]):
        edges = [2 * half for half in box.half]
        body = plant.AddRigidBody(
            f"box{i}", drake.SpatialInertia.SolidBoxWithMass(box.mass, *edges)
        )
        plant.RegisterCollisionGeometry(
            body, drake.RigidTransform(), drake.Box(*edges), f"box{i}", properties()
        )
        # Drake has one point for two boxes: small spheres give the corners
        for k in range(8):
            corner = [half * (1 - 2 * (k >> axis & 1)) for axis, half in enumerate(box.half)]
            plant.RegisterCollisionGeometry(
                body, drake.RigidTransform(corner), drake.Sphere(1e-4), f"{i}.{k}", properties()
            )
    for i, pad in enumerate(pads, len(boxes)):
        place = drake.RigidTransform(list(pad.place))
        start = drake.FixedOffsetFrame(f"start{i}", plant.world_frame(), place)
        joint = drake.PrismaticJoint(
            f"slide{i}",
            plant.AddFrame(start),
            plant.GetBodyByName(f"box{i}").body_frame(),
            [inwards(pad), 0, 0],
        )
        plant.AddJointActuator(f"press{i}", plant.AddJoint(joint))
    plant.Finalize()
    simulator = drake.Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    if pads:
        plant.get_actuation_input_port().FixValue(context, [PRESS] * len(pads))
    for i, box in enumerate(boxes):
        body = plant.GetBodyByName(f"box{i}")
        plant.SetFreeBodyPose(context, body, drake.RigidTransform(list(box.place)))
        speed = drake.SpatialVelocity(w=[0, 0, 0], v=list(box.velocity))
        plant.SetFreeBodySpatialVelocity(body, speed, context)
    for step in range(steps):
        yield recorders.drake(plant, context)
        simulator.AdvanceTo((step + 1) * H)


def bullets(scene: str, steps: int) -> Iterator[Any]:
    """PyBullet's steps."""
    import pybullet as bullet

    boxes, pads = SCENES[scene], PADS.get(scene, [])
    client = bullet.connect(bullet.DIRECT)
    bullet.setGravity(0, 0, -9.81)
    bullet.setTimeStep(H)
    bodies = [bullet.createMultiBody(0, bullet.createCollisionShape(bullet.GEOM_PLANE))]
    for box in boxes:
        shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=box.half)
        bodies.append(bullet.createMultiBody(box.mass, shape, basePosition=box.place))
        bullet.resetBaseVelocity(bodies[-1], box.velocity)
    for pad in pads:
        shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=pad.half)
        bodies.append(
            bullet.createMultiBody(
                basePosition=pad.place,
                linkMasses=[pad.mass],
                linkCollisionShapeIndices=[shape],
                linkVisualShapeIndices=[-1],
                linkPositions=[[0, 0, 0]],
                linkOrientations=[[0, 0, 0, 1]],
                linkInertialFramePositions=[[0, 0, 0]],
                linkInertialFrameOrientations=[[0, 0, 0, 1]],
                linkParentIndices=[0],
                linkJointTypes=[bullet.JOINT_PRISMATIC],
                linkJointAxis=[[inwards(pad), 0, 0]],
            )
        )
        bullet.setJointMotorControl2(
            bodies[-1], 0, bullet.VELOCITY_CONTROL, targetVelocity=FASTEST, force=PRESS
        )
    for body in bodies:
        bullet.changeDynamics(body, -1, linearDamping=0, angularDamping=0)
        # coefficients multiply; with a damping in the same call Bullet changes the base, not a link
        for link in range(-1, bullet.getNumJoints(body)):
            bullet.changeDynamics(body, link, lateralFriction=MU**0.5)
    for _ in range(steps):
        yield recorders.pybullet(client)
    bullet.disconnect()


def newtons(scene: str, steps: int) -> Iterator[Any]:
    """Newton's steps by Kamino, in single precision."""
    import newton
    import warp

    boxes, pads = SCENES[scene], PADS.get(scene, [])
    builder = newton.ModelBuilder()
    newton.solvers.SolverKamino.register_custom_attributes(builder)
    kind = newton.ModelBuilder.ShapeConfig
    builder.add_ground_plane(cfg=kind(mu=MU))
    for box in boxes:
        body = builder.add_body(xform=warp.transform(warp.vec3(*box.place), warp.quat_identity()))
        x, y, z = box.half
        material = kind(mu=MU, density=box.mass / (8 * x * y * z))
        builder.add_shape_box(body, hx=x, hy=y, hz=z, cfg=material)
    for pad in pads:
        place = warp.transform(warp.vec3(*pad.place), warp.quat_identity())
        body = builder.add_link(xform=place)
        x, y, z = pad.half
        material = kind(mu=MU, density=pad.mass / (8 * x * y * z))
        builder.add_shape_box(body, hx=x, hy=y, hz=z, cfg=material)
        axis = warp.vec3(inwards(pad), 0, 0)
        joint = builder.add_joint_prismatic(-1, body, parent_xform=place, axis=axis)
        builder.add_articulation([joint])
    model = builder.finalize(device="cpu")
    solver = newton.solvers.SolverKamino(
        model, newton.solvers.SolverKamino.Config(use_collision_detector=True)
    )
    states, control = [model.state(), model.state()], model.control()
    control.joint_f.assign([0.0] * (6 * len(boxes)) + [PRESS] * len(pads))
    speeds = [[*box.velocity, 0.0, 0.0, 0.0] for box in [*boxes, *pads]]
    states[0].body_qd.assign(speeds)
    for _ in range(steps):
        solver.step(*states, control, None, H)
        states.reverse()
        yield recorders.newton(solver)


def siconoses(scene: str, steps: int) -> Iterator[Any]:
    """Siconos' steps."""
    boxes = [asdict(box) for box in SCENES[scene]]
    boxes += [asdict(pad) | {"press": PRESS * inwards(pad)} for pad in PADS.get(scene, [])]
    arguments = [str(steps), str(H), SICONOS_SCALE, json.dumps(boxes)]
    yield from recorders.siconos(SICONOS, arguments=arguments)


def ours(scene: str, steps: int) -> Iterator[Any]:
    """Our own steps, by `auto`."""
    from fclib import scenes, simulate

    for step in simulate.simulate(scenes.Scene(name=scene, xml=scene_text(scene)), steps):
        yield Own(step.problem, step.result.solution)


@dataclass(frozen=True)
class Own:
    """A step of our own, to be written as those that are recorded."""

    problem: Any
    guess: Any

    def write(self, path: Path) -> None:
        """Write the problem, and the solution as a guess."""
        fclib.write(path, self.problem, None, [self.guess])


ENGINES: dict[str, Callable[[str, int], Iterator[Any]]] = {
    "MuJoCo": mujocos,
    "MuJoCo Warp": mujoco_warps,
    "Drake": drakes,
    "Genesis": geneses,
    "Newton": newtons,
    "PyBullet": bullets,
    "Siconos": siconoses,
    "FCLIB": ours,
}


def judged(engine: str, scene: str, steps: int) -> list[recorders.Judgement]:
    """One step in KEPT that has contacts, judged."""
    with tempfile.TemporaryDirectory() as folder:
        paths = []
        for k, one in enumerate(ENGINES[engine](scene, steps)):
            if k % KEPT == 0 and one is not None and one.problem.nc:
                paths.append(Path(folder) / f"{k:06d}.hdf5")
                one.write(paths[-1])
        return list(recorders.judge(paths))


def main() -> None:
    """Print the table, and store it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    every = list(SCENES)
    parser.add_argument("--scene", action="append", choices=every)
    parser.add_argument("--engine", action="append", choices=list(ENGINES))
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--pages", type=Path, help="folder for a page of each scene")
    _results.add_option(parser)
    arguments = parser.parse_args()
    table = []
    for scene in arguments.scene or every:
        runs = {}
        for engine in arguments.engine or ENGINES:
            try:
                steps = judged(engine, scene, arguments.steps)
            except (ImportError, ValueError, ChildProcessError) as error:
                print(f"left out: {engine}: {error}", file=sys.stderr)
                continue
            if not steps:
                print(f"left out: {engine}: {scene}: nothing touches", file=sys.stderr)
                continue
            runs[engine] = steps
            row = {"scene": scene, **recorders.summary(steps), "engine": engine}
            table.append({key: shown(value) for key, value in row.items()})
            print("  ".join(table[-1].values()), flush=True)
        if arguments.pages and runs:
            write_judged(runs, arguments.pages / f"{scene}.html")
    if not table:
        sys.exit("no engine is installed: pip install 'fclib[recorders]'")
    if arguments.results:
        path = _results.store(
            arguments.results,
            table,
            title="Engines beside Coulomb's law",
            note="Medians and the worst of the steps. Engines have their default settings.",
            command="PYTHON -m workshop.tables.judged_engines --results judged-engines",
        )
        print(path)


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
