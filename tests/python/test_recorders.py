"""Steps of other simulators: what their reactions give is their next velocity."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import fclib
from fclib import recorders
from fclib.cli import app
from fclib.external import siconos
from helpers import dense

H = 1e-3
DOWN = -9.81 * H
FRAME = np.eye(3)[[2, 0, 1]]  # N is up


def solved(made: recorders.Assembled) -> Any:
    result = fclib.solve(made.problem, tol=1e-10)
    assert result.converged
    return result.solution


# ---- assemble


@pytest.mark.parametrize("order", ["NTT", "TTN"])
def test_a_block_slides(order: Any) -> None:
    rows = FRAME if order == "NTT" else FRAME[[1, 2, 0]]
    contacts = recorders.Contacts(jacobian=rows, mu=[0.5], order=order)
    made = recorders.assemble(2 * np.eye(3), [0.1, 0, DOWN], H, contacts)
    solution = solved(made)
    np.testing.assert_allclose(solution.v, [0.1 + 0.5 * DOWN, 0, 0], atol=1e-9)
    np.testing.assert_allclose(solution.r, [-2 * DOWN, DOWN, 0], atol=1e-9)


def test_compliance_adds_to_the_diagonal_of_w() -> None:
    """N yields by R r: u_N = v_N + R r_N, as does the tangent in its own way."""
    R = np.array([0.3, 0.1, 0.2])
    contacts = recorders.Contacts(jacobian=FRAME, mu=[0.5], w=[-0.02, 0, 0])
    made = recorders.assemble(2 * np.eye(3), [0.01, 0, DOWN], H, contacts, compliance=R)
    local = made.problem.condense()
    np.testing.assert_allclose(dense(local.W), np.diag(0.5 + R), atol=1e-15)
    np.testing.assert_allclose(local.q, [DOWN - 0.02, 0.01, 0], atol=1e-15)
    r = solved(made).r
    np.testing.assert_allclose(r[0], (0.02 - DOWN) / 0.8, rtol=1e-8)


def test_the_associated_law_opens_what_slides() -> None:
    contacts = recorders.Contacts(jacobian=FRAME, mu=[0.5])
    made = recorders.assemble(np.eye(3), [0.1, 0, DOWN], H, contacts)
    result = recorders.solve_associated(made.problem, tol=1e-10)
    v, r = result.solution.v, result.solution.r
    # v is the projection of the free velocity onto K*, v_N = mu |v_T|
    assert v[2] == pytest.approx(0.5 * v[0], abs=1e-9)
    assert v[0] == pytest.approx((0.1 + 0.5 * DOWN) / 1.25, abs=1e-9)
    assert recorders.associated_error(made.problem, r) < 1e-9
    assert fclib.merit(made.problem, result.solution).error > 1e-2
    coulomb = solved(made).r
    assert recorders.associated_error(made.problem, coulomb) > 1e-2


def test_redundant_joints_are_left_out_and_contradictions_measured() -> None:
    """Three rows of rank two, in single precision too; what is left gives the same velocity."""
    rng = np.random.default_rng(0)
    J = rng.normal(size=(2, 4))
    rows = np.vstack((J[0], J[1], J[0] - 2 * J[1])).astype(np.float32).astype(float)
    b = np.array([0.3, -0.1, 0.5])
    M = np.diag([1.0, 2.0, 3.0, 4.0])
    joints = recorders.Joints(jacobian=rows, b=b, rank=1e-5)
    made = recorders.assemble(M, np.zeros(4), H, joints=joints)
    assert made.problem.p == 2
    assert len(made.redundant) == 1
    assert made.violated < 1e-6
    v = solved(made).v
    np.testing.assert_allclose(rows @ v + b, 0, atol=1e-6)
    broken = recorders.Joints(jacobian=rows, b=b + np.array([0, 0, 1]), rank=1e-5)
    assert recorders.assemble(M, np.zeros(4), H, joints=broken).violated > 0.1


def test_dry_friction_and_limits() -> None:
    row = np.array([[1.0, 0.0]])
    dry = recorders.DryFriction(jacobian=row, bound=[40.0])
    limits = recorders.Limits(jacobian=[[0.0, -1.0]], w=[0.2])
    made = recorders.assemble(np.diag([2.0, 1.0]), [0.1, 0.5], H, None, None, limits, dry)
    solution = solved(made)
    # slips: 0.1 - h 40 / 2; the limit leaves 0.2
    np.testing.assert_allclose(solution.v[:2], [0.08, 0.2], atol=1e-9)
    assert (made.dofs, made.problem.n, made.problem.nc) == (2, 3, 2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"M": -np.eye(3)}, "not positive definite"),
        ({"M": np.eye(2)}, "M: is of shape"),
        ({"h": 0}, "time step"),
        ({"v_free": [0, 0, math.nan]}, "not finite"),
        ({"contacts": recorders.Contacts(jacobian=np.eye(3), mu=[1, 1])}, "is of shape"),
        ({"compliance": [-1, 0, 0]}, "must be >= 0"),
        ({"contacts": None, "compliance": [0]}, "there are none"),
        (
            {"dry_friction": recorders.DryFriction(jacobian=np.eye(3), bound=[1, 1, -1])},
            "bound of dry friction",
        ),
    ],
)
def test_wrong_data_are_named(change: dict[str, Any], message: str) -> None:
    known: dict[str, Any] = {
        "M": np.eye(3),
        "v_free": np.zeros(3),
        "h": H,
        "contacts": recorders.Contacts(jacobian=FRAME, mu=[0.5]),
    }
    with pytest.raises(ValueError, match=message):
        recorders.assemble(**known | change)


# ---- engines, where they are installed


def described(recorded: recorders.Recorded) -> dict[str, Any]:
    origin: dict[str, Any] = json.loads(recorded.problem.info.description.splitlines()[-1])
    return origin


def plant_of_boxes(height: float) -> tuple[Any, Any, Any]:
    """Two turning boxes of eight balls each, whose centres are at a height above the ground."""
    drake = pytest.importorskip("pydrake.all", reason="Drake is not installed")
    builder = drake.DiagramBuilder()
    plant, _ = drake.AddMultibodyPlantSceneGraph(builder, H)
    plant.set_contact_model(drake.ContactModel.kPoint)
    plant.set_discrete_contact_approximation(drake.DiscreteContactApproximation.kSap)
    plant.SetUseSampledOutputPorts(False)

    def properties(stiffness: float, friction: float) -> Any:
        known = drake.ProximityProperties()
        drake.AddContactMaterial(
            point_stiffness=stiffness,
            friction=drake.CoulombFriction(friction, friction),
            properties=known,
        )
        known.AddProperty("material", "relaxation_time", 0.02)
        return known

    plant.RegisterCollisionGeometry(
        plant.world_body(),
        drake.RigidTransform([0, 0, -0.5]),
        drake.Box(9, 9, 1),
        "ground",
        properties(3e6, 0.7),
    )
    corners = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)]
    for i in range(2):
        inertia = drake.SpatialInertia.SolidBoxWithMass(1.0 + i, 0.2, 0.2, 0.2)
        body = plant.AddRigidBody(f"box{i}", inertia)
        for k, corner in enumerate(corners):
            plant.RegisterCollisionGeometry(
                body,
                drake.RigidTransform(corner),
                drake.Sphere(0.01),
                f"ball{i}.{k}",
                properties(1e6, 0.3),
            )
    plant.Finalize()
    simulator = drake.Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for i in range(2):
        body = plant.GetBodyByName(f"box{i}")
        turn = drake.RollPitchYaw(0.1 * i, 0, 0.2)
        plant.SetFreeBodyPose(context, body, drake.RigidTransform(turn, [0.5 * i, 0, height]))
        velocity = drake.SpatialVelocity(w=[2.0, -3.0, 1.0], v=[1.0 - i, 0.3, 0])
        plant.SetFreeBodySpatialVelocity(context, body, velocity)
    return plant, simulator, context


def test_drakes_own_problem_is_reproduced() -> None:
    plant, simulator, context = plant_of_boxes(0.1095)
    seen = 0
    for time in (0.0, 0.02, 0.3):
        simulator.AdvanceTo(time)
        hard, sap = (recorders.drake(plant, context, law) for law in ("hard", "sap"))
        assert hard.mismatch is not None
        # as far as Drake's solver goes
        assert hard.mismatch < 1e-9
        assert described(hard)["fields"]["H"] == "exact"
        if not hard.problem.nc:
            continue
        seen += 1
        assert fclib.solve(hard.problem, tol=1e-8).converged
        assert sap.guess is not None
        # Drake's reaction solves the compliant, associated problem, which ours solves as well
        assert recorders.associated_error(sap.problem, sap.guess.r) < 1e-7
        ours = recorders.solve_associated(sap.problem, tol=1e-9).solution
        np.testing.assert_allclose(ours.v[: sap.assembled.dofs], sap.velocity, atol=5e-8)
    assert seen >= 2


def test_drakes_free_velocity_is_ours() -> None:
    plant, simulator, context = plant_of_boxes(5.0)
    for time in (0.0, 0.01):
        simulator.AdvanceTo(time)
        recorded = recorders.drake(plant, context)
        assert recorded.problem.nc == 0
        assert recorded.mismatch is not None
        assert recorded.mismatch < 1e-12


def test_bullets_reaction_gives_its_velocity() -> None:
    bullet = pytest.importorskip("pybullet", reason="PyBullet is not installed")
    client = bullet.connect(bullet.DIRECT)
    try:
        bullet.setGravity(0, 0, -9.81, physicsClientId=client)
        plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=client)
        bullet.createMultiBody(0, plane, physicsClientId=client)
        box = bullet.createCollisionShape(
            bullet.GEOM_BOX, halfExtents=[0.1, 0.2, 0.1], physicsClientId=client
        )
        for i in range(3):
            body = bullet.createMultiBody(
                1 + i,
                box,
                basePosition=[0.02 * i, 0, 0.1 + 0.2 * i],
                baseInertialFramePosition=[0.01, 0, 0],
                physicsClientId=client,
            )
            bullet.changeDynamics(
                body,
                -1,
                linearDamping=0,
                angularDamping=0,
                lateralFriction=0.7,
                physicsClientId=client,
            )
            bullet.resetBaseVelocity(body, [0.3, 0, 0], [0, 0, 1], physicsClientId=client)
        contacts = 0
        for _ in range(20):
            recorded = recorders.pybullet(client)
            contacts += recorded.problem.nc
            if recorded.problem.nc:
                assert recorded.mismatch is not None
                assert recorded.mismatch < 1e-12
        assert contacts > 20
        assert fclib.solve(recorded.problem).converged
        # of body and ground: the coefficients multiply
        assert np.min(recorded.problem.mu) == pytest.approx(0.7 * 0.5)
    finally:
        bullet.disconnect(client)


def test_pinocchio_gives_mass_jacobian_and_free_velocity() -> None:
    pin = pytest.importorskip("pinocchio", reason="Pinocchio is not installed")
    coal = pytest.importorskip("coal", reason="Pinocchio is not installed")
    model, geometry = pin.Model(), pin.GeometryModel()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "box")
    inertia = pin.Inertia.FromBox(2.0, 0.2, 0.2, 0.2)
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    box = pin.GeometryObject("box", joint, pin.SE3.Identity(), coal.Box(0.2, 0.2, 0.2))
    ground = pin.SE3(np.eye(3), np.array([0, 0, -0.5]))
    floor = pin.GeometryObject("floor", 0, ground, coal.Box(9, 9, 1))
    pair = [geometry.addGeometryObject(one) for one in (floor, box)]
    geometry.addCollisionPair(pin.CollisionPair(*pair))
    q, v = pin.neutral(model), np.zeros(6)
    q[2], v[0] = 0.0999, 0.5
    recorded = recorders.pinocchio(model, geometry, q, v, h=H, mu=0.6)
    assert recorded.problem.nc >= 1
    solution: Any = fclib.solve(recorded.problem, tol=1e-10).solution
    r = solution.r.reshape(-1, 3)
    # the floor pushes upwards, and friction is at its limit
    assert r[:, 0].sum() > 0
    assert solution.v[0] < 0.5
    np.testing.assert_allclose(np.hypot(r[:, 1], r[:, 2]), 0.6 * r[:, 0], rtol=1e-6)


SCRIPT = """
import sys
import pybullet
client = pybullet.connect(pybullet.DIRECT)
pybullet.setGravity(0, 0, -9.81)
plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE)
pybullet.createMultiBody(0, plane)
ball = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.1)
pybullet.createMultiBody(1, ball, basePosition=[0, 0, 0.1])
for _ in range(int(sys.argv[1])):
    pybullet.stepSimulation()
pybullet.disconnect()
"""


def test_a_script_is_recorded(tmp_path: Path) -> None:
    pytest.importorskip("pybullet", reason="PyBullet is not installed")
    script = tmp_path / "rolls.py"
    script.write_text(SCRIPT, encoding="utf-8")
    out = tmp_path / "out"
    common = ["record", "pybullet", str(script), "11", "--every", "5", "--out", str(out)]
    before = list(sys.argv), list(sys.path)
    done = CliRunner().invoke(app, common)
    assert done.exit_code == 0, done.output
    assert "of 11 steps" in done.output
    files = sorted(out.glob("*.hdf5"))
    assert [path.stem for path in files] == [f"pybullet-{k:06d}" for k in (0, 5, 10)]
    problem: Any = fclib.read(files[-1])
    assert problem.nc == 1
    assert len(fclib.read_guesses(files[-1])) == 1
    assert (list(sys.argv), list(sys.path)) == before
    again = CliRunner().invoke(app, common)
    assert again.exit_code == 1
    assert "has files already" in " ".join(again.output.split())


# spheres: nothing gyroscopic; the second runs into the first
SICONOS = """
import sys, tempfile
import siconos.io.mechanics_run as mechanics_run
import siconos.kernel as kernel
import siconos.numerics as numerics
from siconos.mechanics.collision.tools import Contactor

scheme, solver, steps = sys.argv[1:4]
with tempfile.TemporaryDirectory() as folder:
    file = folder + "/scene.hdf5"
    with mechanics_run.MechanicsHdf5Runner(mode="w", io_filename=file) as io:
        io.add_primitive_shape("Ground", "Box", (100, 100, 1))
        io.add_object("ground", [Contactor("Ground")], translation=[0, 0, -0.5])
        io.add_primitive_shape("Ball", "Sphere", (0.5,))
        for i in range(3):
            io.add_object(
                f"ball{i}",
                [Contactor("Ball")],
                translation=[1.01 * i, 0, 0.5],
                velocity=[3 - 3 * i, 0, 0, 0, 0, i],
                mass=1 + i,
            )
        io.add_Newton_impact_friction_nsl("contact", mu=0.5, e=0.0)
    options = kernel.solver_options_create(getattr(numerics, solver))
    options.iparam[numerics.SICONOS_IPARAM_MAX_ITER] = 10000
    options.dparam[numerics.SICONOS_DPARAM_TOL] = 1e-10
    with mechanics_run.MechanicsHdf5Runner(mode="r+", io_filename=file) as io:
        io.run(
            T=int(steps) * 0.005,
            h=0.005,
            theta=0.5,
            Newton_max_iter=1,
            osi=getattr(kernel, scheme),
            solver_options=options,
            verbose=False,
            verbose_progress=False,
            output_frequency=1000,
        )
if len(sys.argv) > 4:
    sys.exit(3)
"""
GLOBAL = ("MoreauJeanGOSI", "SICONOS_GLOBAL_FRICTION_3D_NSGS_WR")
LOCAL = ("MoreauJeanOSI", "SICONOS_FRICTION_3D_NSGS")


def needs_siconos() -> None:
    if siconos.missing():
        pytest.skip("Siconos is not installed")
    code = "import siconos.io.mechanics_run, siconos.mechanics.collision.bullet"
    if subprocess.run([siconos.python(), "-c", code], capture_output=True, check=False).returncode:
        pytest.skip("Siconos has no mechanics with Bullet")


def test_siconos_own_problem_is_recorded(tmp_path: Path) -> None:
    needs_siconos()
    script = tmp_path / "balls.py"
    script.write_text(SICONOS, encoding="utf-8")
    before: Any = None
    touched = set()
    for recorded in recorders.siconos(script, arguments=(*GLOBAL, "12")):
        problem, v = recorded.problem, np.asarray(recorded.velocity)
        assert problem.kind == "global"
        assert problem.n == 18
        assert recorded.h == pytest.approx(0.005)
        # the solver's velocity, from its reaction
        assert recorded.mismatch is not None
        assert recorded.mismatch < 1e-12
        if before is not None:
            # the engine's free velocity: that of the step before, and its gravity
            free = before + np.tile([0, 0, -9.80665 * recorded.h, 0, 0, 0], 3)
            np.testing.assert_allclose(problem.f, problem.M @ free, atol=1e-12)
        before = v
        assert recorded.guess is not None
        assert fclib.merit(problem, recorded.guess).error < 1e-6
        result: Any = fclib.solve(problem, tol=1e-10)
        assert result.converged
        np.testing.assert_allclose(result.solution.v, v, atol=1e-6)
        pairs = described(recorded)["bodies"]
        assert len(pairs) == problem.nc
        touched |= {tuple(pair) for pair in pairs}
    # each ball on the ground, which moves nothing, and next to another
    assert touched == {(-1, 1), (-1, 2), (-1, 3), (1, 2), (2, 3)}


def test_siconos_local_problem_is_recorded(tmp_path: Path) -> None:
    needs_siconos()
    script = tmp_path / "balls.py"
    script.write_text(SICONOS, encoding="utf-8")
    out = tmp_path / "out"
    common = ["record", "siconos", str(script), *LOCAL, "12", "--every", "5", "--out", str(out)]
    done = CliRunner().invoke(app, common)
    assert done.exit_code == 0, done.output
    assert "3 of 12 steps" in done.output
    files = sorted(out.glob("*.hdf5"))
    assert [path.stem for path in files] == [f"siconos-{k:06d}" for k in (0, 5, 10)]
    for file in files:
        problem: Any = fclib.read(file)
        assert problem.kind == "local"
        (guess,) = fclib.read_guesses(file)
        assert fclib.merit(problem, guess).error < 1e-6
        assert fclib.solve(problem).converged


def test_a_script_of_siconos_that_fails_keeps_its_steps(tmp_path: Path) -> None:
    needs_siconos()
    script = tmp_path / "balls.py"
    script.write_text(SICONOS, encoding="utf-8")
    out = tmp_path / "out"
    arguments = ["record", "siconos", str(script), *LOCAL, "3", "--out", str(out)]
    done = CliRunner().invoke(app, [*arguments, "--", "fail"])
    assert done.exit_code == 1
    assert "ended with status 3" in " ".join(done.output.split())
    assert len(list(out.glob("*.hdf5"))) == 3


def test_what_cannot_be_recorded_is_named(tmp_path: Path) -> None:
    for arguments, message in (
        (
            ["nothing", "x.py"],
            "no engine 'nothing' is recorded; there is: drake, pybullet, siconos",
        ),
        (["drake", str(tmp_path / "none.py")], "no such script"),
    ):
        done = CliRunner().invoke(app, ["record", *arguments, "--out", str(tmp_path / "out")])
        assert done.exit_code == 1
        assert message in " ".join(done.output.split())
    assert not (tmp_path / "out").exists()
