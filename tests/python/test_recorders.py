"""Steps of other simulators: what their reactions give is their next velocity."""

from __future__ import annotations

import copy
import dataclasses
import json
import math
import re
import sys
from importlib import metadata
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import recorders
from fclib.recorders import _genesis, _newton
from helpers import converged, dense, needs_siconos_mechanics
from helpers_cli import invoke

H = 1e-3
DOWN = -9.81 * H
FRAME = np.eye(3)[[2, 0, 1]]  # N is up


def solved(made: recorders.Assembled) -> Any:
    result = converged(made.problem, tol=1e-10)
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


@pytest.mark.parametrize("order", ["NTT", "TTN"])
def test_moments_follow_the_forces_in_any_order(order: Any) -> None:
    """A body of six coordinates on one contact, whose rows are its own coordinates."""
    rows = np.eye(6)[[2, 0, 1, 5, 3, 4]]  # N, T1, T2, S, R1, R2
    given = rows if order == "NTT" else rows[[1, 2, 0, 3, 4, 5]]
    speed = np.array([1.0, 0, -1, 0.1, 0, 50])
    contacts = recorders.Contacts(jacobian=given, mu=[0.5], mu_s=[0.2], mu_r=[0.1], order=order)
    limits = recorders.Limits(jacobian=[[0, 1.0, 0, 0, 0, 0]], w=[1.0])
    made = recorders.assemble(np.eye(6), speed, H, contacts, limits=limits)
    assert (made.problem.kind, made.problem.spacedim, made.problem.nc) == ("global_spin", 6, 2)
    # stops; slides, spins at their limits; rolling stops
    np.testing.assert_allclose(solved(made).v, [0.5, 0, 0, 0, 0, 49.8], atol=1e-8)


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
        ({"contacts": recorders.Contacts(jacobian=FRAME, mu=[1], mu_s=[1])}, "is of shape"),
        (
            {"contacts": recorders.Contacts(jacobian=np.ones((4, 3)), mu=[1], mu_s=[1, 1])},
            "mu_s: has 2 numbers, not 1",
        ),
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


# ---- Newton's data, which need no Newton


def test_kaminos_rows_become_those_of_a_problem() -> None:
    """Two rows of joints that yield, three rigid ones of rank two, and some of the others.

    The velocity is that of Kamino's own equation with Kamino's rows.
    """
    rng = np.random.default_rng(1)
    n, d = 8, 2 + 3 + 1 + 2 + 6
    root, J, w = rng.normal(size=(n, n)), rng.normal(size=(d, n)), rng.normal(size=d)
    J[4], w[4], w[5] = J[2] - 2 * J[3], w[2] - 2 * w[3], 0
    M, v_free, reaction = root @ root.T + np.eye(n), rng.normal(size=n), rng.normal(size=d)
    inverse_mass = np.array([0.5, 4.0])
    # J v + w + lambda / m = 0 of the rows that yield
    soft = J[:2] @ np.linalg.solve(M, J[:2].T) + np.diag(inverse_mass)
    pushed = v_free + np.linalg.solve(M, J[2:].T @ reaction[2:])
    reaction[:2] = -np.linalg.solve(soft, J[:2] @ pushed + w[:2])
    step = _newton.Step(
        time=0.5,
        h=H,
        M=M,
        v_free=v_free,
        velocity=v_free + np.linalg.solve(M, J.T @ reaction),
        J=J,
        w=w,
        reaction=reaction,
        yielding=2,
        rigid=3,
        dry=1,
        limits=2,
        inverse_mass=inverse_mass,
        bound=np.array([0.3]),
        mu=np.array([0.5, 0.7]),
        bodies=np.array([[-1, 0], [0, 1]]),
    )
    recorded = _newton.recorded(step, "1.8.0")
    problem = recorded.problem
    assert (problem.n, problem.nc, problem.p) == (n + 1, 5, 2)
    assert recorded.assembled.violated < 1e-12
    assert recorded.mismatch is not None
    assert recorded.mismatch < 1e-12
    # contacts T1, T2, N become N, T1, T2; then limits, then dry friction
    columns = dense(problem.H)[:n].T
    own = J[8:].reshape(2, 3, n)[:, [2, 0, 1]].reshape(6, n)
    np.testing.assert_array_equal(columns[:6], own)
    np.testing.assert_array_equal(columns[[6, 9, 13]], J[[6, 7, 5]])
    np.testing.assert_array_equal(columns[[7, 8, 10, 11, 12, 14]], 0)
    np.testing.assert_array_equal(problem.w[:10:3], w[[10, 13, 6, 7]])
    np.testing.assert_array_equal(problem.mu, [0.5, 0.7, 0, 0, 1])
    guess: Any = recorded.guess
    r = guess.r.reshape(5, 3)
    np.testing.assert_array_equal(r[:2], reaction[8:].reshape(2, 3)[:, [2, 0, 1]])
    np.testing.assert_array_equal(r[2:4, 0], reaction[6:8])
    np.testing.assert_allclose(r[4], [0.3, reaction[5], 0])
    assert described(recorded)["bodies"] == [[-1, 0], [0, 1]]
    # contacts that yield in N, by the third of their rows; limits that do are refused
    soft = np.zeros(d)
    soft[10] = 0.2
    yields = _newton.recorded(dataclasses.replace(step, compliance=soft), "1.8.0").problem
    assert yields.n == n + 2
    assert dense(yields.M)[n, n] == pytest.approx(1 / 0.2)
    np.testing.assert_array_equal(dense(yields.H)[n], np.eye(15)[0])
    soft[6] = 0.1
    with pytest.raises(ValueError, match="limit_compliance"):
        _newton.recorded(dataclasses.replace(step, compliance=soft), "1.8.0")


def test_kaminos_jacobian_is_read_from_an_array_and_from_blocks() -> None:
    def held(values: Any) -> Any:
        return SimpleNamespace(numpy=lambda: np.asarray(values))

    J = np.arange(36.0).reshape(3, 12)
    J[0, 6:] = 0
    flat = np.concatenate((np.full(5, -1.0), J.ravel()))
    data = SimpleNamespace(J_cts_offsets=held([0, 5]), J_cts_data=held(flat))
    np.testing.assert_array_equal(_newton.jacobian(SimpleNamespace(data=data), 1, 3, 12), J)
    spots = [(2, 6), (0, 0), (1, 0), (1, 6), (2, 0)]
    blocks = SimpleNamespace(
        nzb_start=held([0, 1]),
        num_nzb=held([1, 5]),
        nzb_coords=held([(0, 0), *spots, (0, 0)]),
        nzb_values=held([np.ones(6), *(J[i, k : k + 6] for i, k in spots), np.ones(6)]),
    )
    sparse = SimpleNamespace(_J_cts=SimpleNamespace(bsm=blocks))
    np.testing.assert_array_equal(_newton.jacobian(sparse, 1, 3, 12), J)


def test_another_version_of_newton_is_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "newton", ModuleType("newton"))
    monkeypatch.setattr(metadata, "version", lambda _: "1.9.2")
    script = tmp_path / "falls.py"
    script.write_text("", encoding="utf-8")
    out = tmp_path / "out"
    done = invoke("record", "newton", script, "--out", out, code=1)
    said = " ".join(done.output.split())
    assert "newton 1.9.2 is installed" in said
    assert "newton==1.8.*" in said


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


@pytest.fixture
def drakes() -> Any:
    """A function that makes a plant of Drake's, an arm with a motor and two balls on a floor.

    `change` is called before the plant is finalized, and returns what is done to its context.
    """
    drake = pytest.importorskip("pydrake.all", reason="Drake is not installed")

    def made(change: Any, model: str = "kPoint", **options: Any) -> tuple[Any, Any]:
        builder = drake.DiagramBuilder()
        plant, _ = drake.AddMultibodyPlantSceneGraph(builder, 1e-3)
        plant.SetUseSampledOutputPorts(options.get("sampled", False))
        plant.set_contact_model(getattr(drake.ContactModel, model))
        material = drake.ProximityProperties()
        drake.AddContactMaterial(
            point_stiffness=1e6, friction=drake.CoulombFriction(0.5, 0.5), properties=material
        )
        soft = drake.ProximityProperties(material)
        drake.AddCompliantHydroelasticProperties(0.05, 1e6, soft)
        half = drake.RigidTransform([0, 0, -0.5])
        floor = drake.Box(9, 9, 1)
        stiff = drake.ProximityProperties(material)
        drake.AddRigidHydroelasticProperties(0.5, stiff)
        plant.RegisterCollisionGeometry(plant.world_body(), half, floor, "floor", stiff)
        inertia = drake.SpatialInertia.SolidBoxWithMass(1, 0.1, 0.1, 0.1)
        turning = plant.AddRigidBody("arm", inertia)
        joint = drake.RevoluteJoint(
            "joint",
            plant.world_frame(),
            turning.body_frame(),
            [0, 1, 0],
            *options.get("bounds", ()),
        )
        joint = plant.AddJoint(joint)
        motor = plant.AddJointActuator("motor", joint, effort_limit=5.0)
        balls = [plant.AddRigidBody(name, inertia) for name in ("one", "two")]
        for ball in balls:
            plant.RegisterCollisionGeometry(
                ball, drake.RigidTransform(), drake.Sphere(0.1), "ball", soft
            )
        after = change(drake, plant, joint, motor, balls)
        plant.Finalize()
        context = plant.GetMyMutableContextFromRoot(builder.Build().CreateDefaultContext())
        for x, ball in enumerate(balls):
            place = drake.RigidTransform(drake.RollPitchYaw(0.5, 0, 1), [x, 0, 0.0999])
            plant.SetFreeBodyPose(context, ball, place)
        port = plant.get_actuation_input_port()
        port.FixValue(context, [options.get("torque", 0.0)])
        if after is not None:
            after(context)
        return plant, context

    return made


def test_forces_that_drake_applies_are_in_the_problem(drakes: Any) -> None:
    def pushed(drake: Any, plant: Any, joint: Any, motor: Any, balls: Any) -> Any:
        def push(context: Any) -> None:
            one = drake.ExternallyAppliedSpatialForce_[float]()
            one.body_index = balls[0].index()
            one.p_BoBq_B = np.array([0.1, 0.2, 0.0])
            one.F_Bq_W = drake.SpatialForce(np.array([0.3, 0.1, 0.2]), np.array([40.0, 5, -3]))
            port = plant.get_applied_spatial_force_input_port()
            kind: Any = list
            port.FixValue(context, drake.Value[kind[type(one)]]([one]))

        return push

    def held(drake: Any, plant: Any, joint: Any, motor: Any, balls: Any) -> Any:
        motor.set_controller_gains(drake.PdControllerGains(p=1000, d=10))

        def aim(context: Any) -> None:
            port = plant.get_desired_state_input_port(motor.model_instance())
            port.FixValue(context, [0.001, 0.0])

        return aim

    def nothing(*_: Any) -> None:
        return None

    # a force on a body, a motor beyond its limit, and one with gains within it
    for change, torque in ((pushed, 0.0), (nothing, 50.0), (held, 0.0)):
        plant, context = drakes(change, torque=torque)
        for recorded in (recorders.drake(plant, context, law) for law in ("hard", "sap")):
            assert recorded.problem.nc == 2
            assert np.abs(recorded.velocity).max() > 0.04
            assert recorded.mismatch is not None
            assert recorded.mismatch < 1e-6
            assert described(recorded)["fields"]["f"] == "exact"


def test_what_drakes_problem_does_not_have_is_refused(drakes: Any) -> None:
    def tied(drake: Any, plant: Any, joint: Any, motor: Any, balls: Any) -> None:
        plant.AddDistanceConstraint(balls[0], np.zeros(3), balls[1], np.zeros(3), 1.0)

    def locked(drake: Any, plant: Any, joint: Any, motor: Any, balls: Any) -> Any:
        return joint.Lock

    def bent(drake: Any, plant: Any, joint: Any, motor: Any, balls: Any) -> Any:
        def bend(context: Any) -> None:
            joint.set_angle(context, 0.11)
            joint.set_angular_rate(context, 1.0)

        return bend

    def nothing(*_: Any) -> None:
        return None

    with pytest.raises(ValueError, match="the plant's output is that of the last step"):
        recorders.drake(*drakes(nothing, sampled=True))
    with pytest.raises(ValueError, match="the plant has constraints"):
        recorders.drake(*drakes(tied))
    with pytest.raises(ValueError, match="joint joint is locked"):
        recorders.drake(*drakes(locked))
    with pytest.raises(ValueError, match="contacts of surfaces are not recorded"):
        recorders.drake(*drakes(nothing, model="kHydroelasticWithFallback"))
    plant, context = drakes(bent, bounds=(-0.1, 0.1))
    with pytest.raises(ValueError, match='at its limit, which is recorded by the law "hard" only'):
        recorders.drake(plant, context, "sap")
    assert recorders.drake(plant, context).problem.nc == 3


def test_what_bullet_does_not_tell_is_named_or_refused() -> None:
    bullet = pytest.importorskip("pybullet", reason="PyBullet is not installed")
    client = bullet.connect(bullet.DIRECT)
    options = {"physicsClientId": client}

    def world() -> list[int]:
        """Two boxes on the ground."""
        bullet.resetSimulation(**options)
        bullet.setPhysicsEngineParameter(numSubSteps=0, **options)
        bullet.setGravity(0, 0, -9.81, **options)
        found: list[int] = []
        for mass, z, half in (
            (0, -0.5, (5, 5, 0.5)),
            (1, 0.0999, [0.1] * 3),
            (1, 0.0999, [0.1] * 3),
        ):
            shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half, **options)
            place = [float(len(found)), 0, z]
            body = bullet.createMultiBody(mass, shape, basePosition=place, **options)
            bullet.changeDynamics(body, -1, linearDamping=0, angularDamping=0, **options)
            found.append(body)
        return found

    try:
        world()
        assert described(recorders.pybullet(client))["fields"]["M"] == "exact"
        _, one, _ = world()
        bullet.applyExternalForce(one, -1, [9, 0, 0], [1, 0, 0], bullet.WORLD_FRAME, **options)
        pushed = recorders.pybullet(client)
        assert described(pushed)["fields"]["M"] == "reconstructed"
        assert any("gives its next velocity to" in note for note in pushed.notes)
        world()
        with pytest.raises(ValueError, match=r"the engine's step is 0\.00416667 s, not 0\.001"):
            recorders.pybullet(client, h=1e-3)
        bullet.setPhysicsEngineParameter(numSubSteps=4, **options)
        with pytest.raises(ValueError, match="a step of several substeps"):
            recorders.pybullet(client)
        _, one, two = world()
        bullet.createConstraint(
            one, -1, two, -1, bullet.JOINT_FIXED, [0, 0, 0], [1, 0, 0], [0, 0, 0], **options
        )
        with pytest.raises(ValueError, match="constraint 0: bodies without constraints"):
            recorders.pybullet(client)
        _, one, _ = world()
        bullet.changeDynamics(one, -1, rollingFriction=0.1, **options)
        with pytest.raises(ValueError, match=f"body {one}: resists rolling or spin"):
            recorders.pybullet(client)
        _, one, two = world()
        bullet.resetBasePositionAndOrientation(two, [1, 0, 0.2999], [0, 0, 0, 1], **options)
        with pytest.raises(ValueError, match=f"body {two}: moves, and is not among the recorded"):
            recorders.pybullet(client, [one])
    finally:
        bullet.disconnect(client)


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


def tree_of_bullet(bullet: Any, client: int, mass: float) -> int:
    """A body of a base (fixed without a mass) and links that turn, slide and are fixed."""
    options = {"physicsClientId": client}
    random = np.random.default_rng(0)

    def vectors(size: float, width: int = 3) -> Any:
        found = random.normal(size=(4, width))
        if width == 4:
            found /= np.linalg.norm(found, axis=1)[:, None]
        return (size * found).tolist()

    shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=[0.05, 0.1, 0.15], **options)
    kinds = (
        bullet.JOINT_REVOLUTE,
        bullet.JOINT_PRISMATIC,
        bullet.JOINT_FIXED,
        bullet.JOINT_REVOLUTE,
    )
    body: int = bullet.createMultiBody(
        mass,
        shape,
        basePosition=[0.1, 0.2, 1.2],
        baseOrientation=vectors(1, 4)[0],
        baseInertialFramePosition=[0.03, 0.02, 0.01],
        baseInertialFrameOrientation=vectors(1, 4)[0],
        linkMasses=[1, 2, 1.5, 0.7],
        linkCollisionShapeIndices=[shape] * 4,
        linkVisualShapeIndices=[-1] * 4,
        linkPositions=vectors(0.3),
        linkOrientations=vectors(1, 4),
        linkInertialFramePositions=vectors(0.1),
        linkInertialFrameOrientations=vectors(1, 4),
        linkParentIndices=[0, 1, 1, 3],
        linkJointTypes=kinds,
        linkJointAxis=np.eye(3)[[0, 1, 2, 1]].tolist(),
        **options,
    )
    bullet.changeDynamics(body, -1, linearDamping=0, angularDamping=0, **options)
    for joint in (0, 1, 3):
        bullet.setJointMotorControl2(
            body, joint, bullet.VELOCITY_CONTROL, targetVelocity=3, force=0.2 * joint, **options
        )
        bullet.resetJointState(body, joint, 0.3 + joint, 1 - joint, **options)
    if mass:
        bullet.resetBaseVelocity(body, [0.1, 0.2, 0.3], [1, 2, 3], **options)
    return body


@pytest.mark.parametrize("mass", [0, 3])
def test_bullets_joints_give_the_velocity(mass: float) -> None:
    bullet = pytest.importorskip("pybullet", reason="PyBullet is not installed")
    ends, contacts = [], 0
    for recorded in (True, False):
        client = bullet.connect(bullet.DIRECT)
        options = {"physicsClientId": client}
        try:
            bullet.setTimeStep(1e-3, **options)
            bullet.setGravity(0, 0, -9.81, **options)
            plane = bullet.createCollisionShape(bullet.GEOM_PLANE, **options)
            bullet.createMultiBody(0, plane, **options)
            body = tree_of_bullet(bullet, client, mass)
            joints = (0, 1, 3)
            q = [bullet.getJointState(body, joint, **options)[0] for joint in joints]
            own = np.array(bullet.calculateMassMatrix(body, q, **options))
            for number in range(400):
                if not recorded:
                    bullet.stepSimulation(**options)
                    continue
                step = recorders.pybullet(client)
                assert step.problem.n == 3 + 6 * bool(mass)
                assert step.mismatch is not None
                # axes come to Bullet in single precision
                assert step.mismatch < 1e-6 * max(1, np.abs(step.velocity).max())
                contacts += step.problem.nc
                if number == 0 and not mass:
                    # Bullet's own is that of the frame of the base if the base moves
                    np.testing.assert_allclose(dense(step.problem.M), own, atol=1e-6)
            ends.append([bullet.getJointState(body, joint, **options)[:2] for joint in joints])
        finally:
            bullet.disconnect(client)
    assert contacts > 50 or not mass
    assert "found for the motors" in step.notes[1]
    # to record a step changes nothing
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-9)


PENDULUM = """
<robot name="pendulum">
  <link name="post"/>
  <link name="arm"><inertial><origin xyz="0 0 -0.1"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.015" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="elbow" type="{kind}"><parent link="post"/><child link="arm"/>
    <origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><dynamics damping="0.5" friction="0"/>
    <limit lower="-0.4" upper="0.4" effort="1" velocity="1"/></joint>
</robot>
"""


def test_bullets_dampers_are_recorded_and_other_joints_named(tmp_path: Path) -> None:
    bullet = pytest.importorskip("pybullet", reason="PyBullet is not installed")
    client = bullet.connect(bullet.DIRECT)
    options = {"physicsClientId": client}

    def pendulum(kind: str, rate: float = 0.0) -> int:
        bullet.resetSimulation(**options)
        bullet.setGravity(0, 0, -9.81, **options)
        path = tmp_path / f"{kind}.urdf"
        path.write_text(PENDULUM.format(kind=kind), encoding="utf-8")
        body: int = bullet.loadURDF(str(path), useFixedBase=True, **options)
        for link in (-1, 0):
            bullet.changeDynamics(body, link, linearDamping=0, angularDamping=0, **options)
        if kind == "revolute":
            bullet.resetJointState(body, 0, 0.3, rate, **options)
            bullet.setJointMotorControl2(body, 0, bullet.VELOCITY_CONTROL, force=0, **options)
        return body

    try:
        pendulum("revolute", -2.0)
        assert recorders.pybullet(client).mismatch == pytest.approx(0, abs=1e-6)
        body = pendulum("revolute", 40.0)
        with pytest.raises(ValueError, match=f"body {body}: joint elbow is at its limit"):
            recorders.pybullet(client)
        body = pendulum("spherical")
        with pytest.raises(recorders.SetupError, match=f"body {body}: joint elbow is not revolute"):
            recorders.pybullet(client)
    finally:
        bullet.disconnect(client)


def pinocchios_box(height: float, **options: Any) -> Any:
    """A step of a box of 0.2 m that slides above a floor, z its middle [m]."""
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
    q[2], v[0] = height, 0.5
    return recorders.pinocchio(model, geometry, q, v, mu=0.6, **options)


def test_pinocchio_gives_mass_jacobian_and_free_velocity() -> None:
    recorded = pinocchios_box(0.0999, h=H)
    assert recorded.problem.nc >= 1
    solution: Any = fclib.solve(recorded.problem, tol=1e-10).solution
    r = solution.r.reshape(-1, 3)
    # the floor pushes upwards, and friction is at its limit
    assert r[:, 0].sum() > 0
    assert solution.v[0] < 0.5
    np.testing.assert_allclose(np.hypot(r[:, 1], r[:, 2]), 0.6 * r[:, 0], rtol=1e-6)


@pytest.mark.parametrize(("gap", "fall"), [(5e-4, 0.05), (2e-3, 0.0981), (-1e-3, 0.0)])
def test_a_contact_within_pinocchios_margin_closes_its_gap(gap: float, fall: float) -> None:
    """A body falls as far as its gap is wide, and freely if it does not reach the floor."""
    h = 1e-2
    recorded = pinocchios_box(0.1 + gap, h=h, margin=0.01)
    assert recorded.problem.nc >= 1
    np.testing.assert_allclose(recorded.contacts.gap, gap, atol=1e-9)
    solution: Any = fclib.solve(recorded.problem, tol=1e-10).solution
    assert solution.v[2] == pytest.approx(-fall, abs=1e-6)


def newtons_solver(build: Any, **options: Any) -> tuple[Any, Any]:
    """A solver of Kamino's for what `build` adds to a builder, and a function that steps it."""
    newton = pytest.importorskip("newton", reason="Newton is not installed")
    try:
        _newton.pinned()
    except ImportError as error:
        pytest.skip(str(error))
    kind = newton.solvers.SolverKamino
    builder = newton.ModelBuilder()
    kind.register_custom_attributes(builder)
    build(newton, builder)
    model = builder.finalize(device="cpu")
    solver = kind(model, kind.Config(use_collision_detector=True, **options))
    states = [model.state(), model.state()]

    def step(count: int) -> None:
        for _ in range(count):
            solver.step(*states, None, None, 2e-3)
            states.reverse()

    return solver, step


def free_velocity_off(solver: Any, step: Any) -> float:
    """How far u without reactions is from Newton's, relative to its size where that is above 1."""
    data = solver._solver_kamino.problem_fd.data
    count = int(data.dim.numpy()[0])
    own = (data.v_f.numpy()[:count] / data.P.numpy()[:count]).astype(float)
    return float(np.abs(step.J @ step.v_free + step.w - own).max() / max(1.0, np.abs(own).max()))


def boxes_of_newton(restitution: float) -> Any:
    """Two boxes, one on the other, that fall and slide on a plane."""

    def boxes(newton: Any, builder: Any) -> None:
        material = newton.ModelBuilder.ShapeConfig(mu=0.5, restitution=restitution)
        builder.add_ground_plane(cfg=material)
        for i in range(2):
            body = builder.add_body(xform=((0.03 * i, 0, 0.1005 + 0.201 * i), (0, 0, 0, 1)))
            builder.add_shape_box(body, hx=0.1, hy=0.1, hz=0.1, cfg=material)
            builder.body_qd[body] = (0.5, 0, -0.3, 0, 0, 0.4 * i)

    return boxes


@pytest.mark.parametrize(
    ("method", "restitution"), [("padmm", 0.0), ("padmm", 0.4), ("dvi", 0.0), ("dvi", 0.4)]
)
def test_newtons_own_problem_is_recorded(method: str, restitution: float) -> None:
    solver, step = newtons_solver(boxes_of_newton(restitution), dynamics_solver=method)
    touched = set()
    # the first of them is an impact
    for count in (1, 10, 20):
        step(count)
        before = np.asarray(recorders.newton(solver).velocity)
        step(1)
        recorded = recorders.newton(solver)
        problem, kamino = recorded.problem, solver._solver_kamino
        assert (problem.n, problem.p) == (12, 0)
        assert problem.nc >= 8
        read = _newton.read(kamino, solver._contacts_kamino, 0)
        assert free_velocity_off(solver, read) < 1e-6
        # Newton's impact: the normal velocity before the step, times the coefficient
        bias = kamino.problem_fd.data.v_b.numpy()[2 : 3 * problem.nc : 3]
        impact = restitution * (read.J[2::3] @ before)
        off = np.abs(np.asarray(problem.w)[::3] - bias - impact)
        assert off.max() < 1e-6 * max(1.0, np.abs(bias).max())
        assert recorded.mismatch is not None
        assert recorded.mismatch < 1e-5
        result: Any = fclib.solve(problem, tol=1e-8)
        assert result.converged
        origin = described(recorded)
        assert origin["fields"]["H"] == "exact"
        touched |= {tuple(pair) for pair in origin["bodies"]}
        contacts: Any = recorded.contacts
        # rows of the second body are those of the frame; N points towards it
        moved = np.reshape(contacts.jacobian, (-1, 3, 12))
        for k, (_, after) in enumerate(contacts.bodies):
            block = moved[k][[2, 0, 1], 6 * after : 6 * after + 3]
            np.testing.assert_allclose(block, contacts.frame[k], atol=1e-6)
    assert touched >= {(-1, 0), (0, 1)}
    assert recorded.time == pytest.approx(33 * 2e-3, abs=1e-5)


def test_newtons_belt_moves_what_lies_on_it() -> None:
    """A kinematic body is no unknown: its velocity is in w, and drags the box."""

    def belt(newton: Any, builder: Any) -> None:
        body = builder.add_body(xform=((0, 0, 0), (0, 0, 0, 1)), is_kinematic=True)
        builder.add_shape_box(body, hx=1, hy=1, hz=0.1)
        builder.body_qd[body] = (0.3, 0, 0, 0, 0, 0)
        body = builder.add_body(xform=((0, 0, 0.2), (0, 0, 0, 1)))
        builder.add_shape_box(body, hx=0.1, hy=0.1, hz=0.1)

    solver, step = newtons_solver(belt)
    step(2)
    recorded = recorders.newton(solver)
    problem = recorded.problem
    assert problem.n == 6
    read = _newton.read(solver._solver_kamino, solver._contacts_kamino, 0)
    assert free_velocity_off(solver, read) < 1e-6
    assert recorded.mismatch is not None
    assert recorded.mismatch < 1e-5
    result: Any = fclib.solve(problem, tol=1e-8)
    assert result.converged
    assert 0.01 < result.solution.v[0] < 0.3
    assert recorded.velocity[0] == pytest.approx(result.solution.v[0], abs=1e-3)


def test_newtons_reaction_is_coulombs() -> None:
    """A box rests: its weight is carried, and Kamino's reaction is as exact as single precision."""

    def box(newton: Any, builder: Any) -> None:
        builder.add_ground_plane()
        body = builder.add_body(xform=((0, 0, 0.1), (0, 0, 0, 1)))
        builder.add_shape_box(body, hx=0.1, hy=0.1, hz=0.1)

    solver, step = newtons_solver(box)
    step(30)
    recorded = recorders.newton(solver)
    guess: Any = recorded.guess
    weight = 8.0 * 9.81 * 2e-3
    assert guess.r[::3].sum() == pytest.approx(weight, rel=1e-3)
    assert fclib.merit(recorded.problem, guess).error < 1e-3
    solution: Any = fclib.solve(recorded.problem, tol=1e-10).solution
    assert solution.r[::3].sum() == pytest.approx(weight, rel=1e-3)


def test_newtons_loops_lose_their_redundant_rows() -> None:
    """A leaning four-bar falls, with armature and dry friction in its joints."""
    lean, length = 0.5, 0.4
    x, z = length * math.sin(lean), length * math.cos(lean)
    turn = (0, math.sin(lean / 2), 0, math.cos(lean / 2))
    upright = (0, 0, 0, 1)

    def bars(newton: Any, builder: Any) -> None:
        places = [((x / 2, 0, z / 2), turn), ((x + 0.2, 0, z), upright)]
        places.append(((x / 2 + 0.4, 0, z / 2), turn))
        links = [builder.add_link(xform=place) for place in places]
        for k, link in enumerate(links):
            # the rods of a parallelogram
            half = (0.2, 0.02, 0.02) if k == 1 else (0.02, 0.02, 0.2)
            builder.add_shape_box(link, hx=half[0], hy=half[1], hz=half[2])

        def hinge(parent: int, child: int, before: Any, after: Any) -> int:
            joint: int = builder.add_joint_revolute(
                parent,
                child,
                parent_xform=before,
                child_xform=after,
                axis=(0, 1, 0),
                armature=0.01,
                friction=0.5,
            )
            return joint

        back = (0, -turn[1], 0, turn[3])
        low, high = (0, 0, -0.2), (0, 0, 0.2)
        joints = [
            hinge(-1, links[0], ((0, 0, 0), upright), (low, back)),
            hinge(links[0], links[1], (high, back), ((-0.2, 0, 0), upright)),
            hinge(links[1], links[2], ((0.2, 0, 0), upright), (high, back)),
        ]
        builder.add_articulation(joints)
        hinge(-1, links[2], ((0.4, 0, 0), upright), (low, back))
        builder.shape_collision_filter_pairs.extend([(0, 1), (1, 2), (0, 2)])

    solver, step = newtons_solver(bars)
    for _ in range(3):
        step(10)
        recorded = recorders.newton(solver)
        problem = recorded.problem
        # four dry frictions; 20 rows of rank 17
        assert (problem.nc, problem.p, len(recorded.assembled.redundant)) == (4, 17, 3)
        assert recorded.assembled.violated < 1e-3
        assert recorded.mismatch is not None
        assert recorded.mismatch < 1e-4
        result: Any = fclib.solve(problem, tol=1e-8)
        assert result.converged
        np.testing.assert_allclose(result.solution.v[:18], recorded.velocity, atol=1e-3)
    # it moves
    assert np.abs(recorded.velocity).max() > 0.05


def pendulum_of_newton(**joint: Any) -> Any:
    """A pendulum that swings, next to a box that rests."""

    def pendulum(newton: Any, builder: Any) -> None:
        upright = (0, 0, 0, 1)
        rod = builder.add_link(xform=((0, 0, 0.5), upright))
        builder.add_shape_box(rod, hx=0.02, hy=0.02, hz=0.2)
        hinge = builder.add_joint_revolute(
            -1,
            rod,
            parent_xform=((0, 0, 0.7), upright),
            child_xform=((0, 0, 0.2), upright),
            axis=(0, 1, 0),
            **joint,
        )
        builder.add_articulation([hinge])
        builder.body_qd[rod] = (-0.2, 0, 0, 0, 1, 0)
        box = builder.add_body(xform=((0, 0.5, 0.0999), upright))
        builder.add_shape_box(box, hx=0.1, hy=0.1, hz=0.1)
        builder.add_ground_plane()

    return pendulum


@pytest.mark.parametrize(
    ("joint", "rows"),
    [
        ({"limit_lower": -0.5, "limit_upper": 0.005}, (0, 1)),
        ({"damping": 0.3}, (1, 0)),
        ({"target_ke": 50.0, "target_kd": 2.0, "actuator_mode": 3}, (1, 0)),
    ],
)
def test_newtons_limits_dampers_and_drives(joint: dict[str, Any], rows: tuple[int, int]) -> None:
    solver, step = newtons_solver(pendulum_of_newton(**joint))
    step(20)
    recorded = recorders.newton(solver)
    problem = recorded.problem
    read = _newton.read(solver._solver_kamino, solver._contacts_kamino, 0)
    assert (read.yielding, read.limits) == rows
    assert (problem.p, problem.nc) == (5, 4 + rows[1])
    assert free_velocity_off(solver, read) < 1e-6
    assert recorded.mismatch is not None
    assert recorded.mismatch < 1e-5
    result: Any = fclib.solve(problem, tol=1e-8)
    assert result.converged
    np.testing.assert_allclose(result.solution.v, recorded.velocity, atol=1e-4)


def test_each_of_newtons_worlds_is_recorded() -> None:
    def worlds(newton: Any, builder: Any) -> None:
        for speed in (0.0, 0.5):
            one = newton.ModelBuilder()
            newton.solvers.SolverKamino.register_custom_attributes(one)
            pendulum_of_newton()(newton, one)
            one.body_qd[1] = (speed, 0, 0, 0, 0, 0)
            builder.add_world(one)

    solver, step = newtons_solver(worlds)
    step(5)
    first, second = (recorders.newton(solver, world) for world in (0, 1))
    for recorded in (first, second):
        assert (recorded.problem.p, recorded.problem.nc) == (5, 4)
        assert recorded.mismatch is not None
        assert recorded.mismatch < 1e-5
    # the box of the second slides
    assert abs(first.velocity[6]) < 1e-3
    assert second.velocity[6] == pytest.approx(0.5 - 5 * 9.81 * 2e-3, abs=1e-2)


def test_what_newton_cannot_give_is_named() -> None:
    solver, step = newtons_solver(boxes_of_newton(0.0))
    step(1)
    with pytest.raises(ValueError, match="no world 1: the model has 1"):
        recorders.newton(solver, 1)
    with pytest.raises(TypeError, match="SolverKamino"):
        recorders.newton(object())
    solver, step = newtons_solver(boxes_of_newton(0.0), dynamics_solver="lox")
    step(1)
    with pytest.raises(ValueError, match='"lox" has no dual problem'):
        recorders.newton(solver)
    drive = {"target_ke": 50.0, "target_kd": 2.0, "actuator_mode": 3, "effort_limit": 0.1}
    solver, step = newtons_solver(pendulum_of_newton(**drive))
    step(1)
    with pytest.raises(ValueError, match="effort_limit"):
        recorders.newton(solver)


NEWTON = """
import sys
import newton
builder = newton.ModelBuilder()
newton.solvers.SolverKamino.register_custom_attributes(builder)
builder.add_ground_plane()
ball = builder.add_body(xform=((0, 0, 0.1), (0, 0, 0, 1)))
builder.add_shape_sphere(ball, radius=0.1)
model = builder.finalize(device="cpu")
solver = newton.solvers.SolverKamino(model)
before, after = model.state(), model.state()
pipeline = newton.CollisionPipeline(model)
contacts = pipeline.contacts()
for _ in range(int(sys.argv[1])):
    pipeline.collide(before, contacts)
    solver.step(before, after, None, contacts, 2e-3)
    before, after = after, before
"""


def test_a_script_of_newton_is_recorded(tmp_path: Path) -> None:
    pytest.importorskip("newton", reason="Newton is not installed")
    script = tmp_path / "rests.py"
    script.write_text(NEWTON, encoding="utf-8")
    out = tmp_path / "out"
    common = ["record", "newton", str(script), "11", "--every", "5", "--out", str(out)]
    done = invoke(*common)
    assert "3 of 11 steps" in done.output
    files = sorted(out.glob("*.hdf5"))
    assert [path.stem for path in files] == [f"newton-{k:06d}" for k in (0, 5, 10)]
    problem: Any = fclib.read(files[-1])
    assert problem.nc == 1
    (guess,) = fclib.read_guesses(files[-1])
    assert fclib.merit(problem, guess).error < 1e-3


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
    done = invoke(*common)
    assert "of 11 steps" in done.output
    files = sorted(out.glob("*.hdf5"))
    assert [path.stem for path in files] == [f"pybullet-{k:06d}" for k in (0, 5, 10)]
    problem: Any = fclib.read(files[-1])
    assert problem.nc == 1
    assert len(fclib.read_guesses(files[-1])) == 1
    assert (list(sys.argv), list(sys.path)) == before
    again = invoke(*common, code=1)
    assert "has steps already; name another folder" in " ".join(again.output.split())


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


def test_siconos_own_problem_is_recorded(tmp_path: Path) -> None:
    needs_siconos_mechanics()
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
    needs_siconos_mechanics()
    script = tmp_path / "balls.py"
    script.write_text(SICONOS, encoding="utf-8")
    out = tmp_path / "out"
    common = ["record", "siconos", str(script), *LOCAL, "12", "--every", "5", "--out", str(out)]
    done = invoke(*common)
    assert "3 of 12 steps" in done.output
    files = sorted(out.glob("*.hdf5"))
    assert [path.stem for path in files] == [f"siconos-{k:06d}" for k in (0, 5, 10)]
    for file in files:
        problem: Any = fclib.read(file)
        assert problem.kind == "local"
        (guess,) = fclib.read_guesses(file)
        assert fclib.merit(problem, guess).error < 1e-6
        assert fclib.solve(problem).converged


MIXED = ("MoreauJeanOSI", "SICONOS_GENERIC_MECHANICAL_NSGS")
# the first ball is on a slide, which lets it turn about no axis
SLIDE = """        io.add_joint(
            "slide", "ball0", points=None, axes=[[1, 0, 0]], joint_class="PrismaticJointR"{more}
        )
        io.add_Newton"""


def test_siconos_joints_are_bilateral_rows(tmp_path: Path) -> None:
    needs_siconos_mechanics()
    script = tmp_path / "slide.py"
    text = SICONOS.replace("        io.add_Newton", SLIDE.format(more=""))
    script.write_text(text, encoding="utf-8")
    steps = list(recorders.siconos(script, arguments=(*MIXED, "12")))
    assert len(steps) == 12
    errors = []
    for recorded in steps:
        problem: Any = recorded.problem
        assert (problem.kind, problem.p) == ("local", 5)
        assert set(recorded.fields) == {"W", "V", "R", "q", "s", "mu"}
        assert recorded.mismatch is not None
        assert recorded.mismatch < 1e-12
        assert recorded.guess is not None
        held = problem.V.T @ recorded.guess.r + problem.R @ recorded.guess.l + problem.s
        np.testing.assert_allclose(held, 0, atol=1e-9)
        errors.append(fclib.merit(problem, recorded.guess).error)
        assert fclib.solve(problem, tol=1e-10).converged
    # this solver of Siconos stops by a measure of its own
    assert min(errors) < 1e-9
    assert max(errors) < 1e-3


def test_stops_of_siconos_joints_are_refused(tmp_path: Path) -> None:
    needs_siconos_mechanics()
    script = tmp_path / "stop.py"
    stop = SLIDE.format(more=", stops=[[0, 0.001, -1]]")
    script.write_text(SICONOS.replace("        io.add_Newton", stop), encoding="utf-8")
    with pytest.raises(recorders.SetupError, match="a joint has a stop, which is not recorded"):
        list(recorders.siconos(script, arguments=(*MIXED, "12")))


@pytest.mark.parametrize("scheme", [GLOBAL, LOCAL])
def test_siconos_bodies_that_touch_nothing_fall(scheme: tuple[str, str], tmp_path: Path) -> None:
    """Balls above the ground: they fall while it is recorded, as they do while it is not."""
    needs_siconos_mechanics()
    script = tmp_path / "falling.py"
    script.write_text(SICONOS.replace("[1.01 * i, 0, 0.5]", "[2 * i, 0, 0.52]"), encoding="utf-8")
    recording = recorders.Recording(tmp_path / "out")
    recorders.ENGINES["siconos"](recording, script, (*scheme, "20"))
    assert recording.seen == 20
    first = min(int(file.stem[-6:]) for file in (tmp_path / "out").glob("*.hdf5"))
    # it takes sqrt(2 gap / g) = 64 ms, and Bullet sees the ground a little before
    assert 5 <= first <= 13
    problem: Any = fclib.read(tmp_path / "out" / f"siconos-{first:06d}.hdf5")
    local = problem.condense() if problem.kind == "global" else problem
    # at the end of the step, without reactions; theta = 0.5
    assert local.q[0] == pytest.approx(-9.80665 * 0.005 * (first + 1), rel=1e-9)


def test_a_script_of_siconos_that_fails_keeps_its_steps(tmp_path: Path) -> None:
    needs_siconos_mechanics()
    script = tmp_path / "balls.py"
    script.write_text(SICONOS, encoding="utf-8")
    out = tmp_path / "out"
    arguments = ["record", "siconos", str(script), *LOCAL, "3", "--out", str(out)]
    done = invoke(*arguments, "--", "fail", code=1)
    assert "ended with status 3" in " ".join(done.output.split())
    assert len(list(out.glob("*.hdf5"))) == 3


def test_what_cannot_be_recorded_is_named(tmp_path: Path) -> None:
    for arguments, message in (
        (
            ["nothing", "x.py"],
            "no engine 'nothing' is recorded; there is: drake, genesis, lmgc90, mujoco,"
            " mujoco_warp, newton, pybullet, siconos",
        ),
        (["drake", str(tmp_path / "none.py")], "no such script"),
    ):
        done = invoke("record", *arguments, "--out", tmp_path / "out", code=1)
        assert message in " ".join(done.output.split())
    assert not (tmp_path / "out").exists()


def test_an_engine_that_is_missing_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "script.py").write_text("import nothing_of_this_name\n")
    monkeypatch.setitem(sys.modules, "pybullet", None)
    arguments = ["record", "pybullet", str(tmp_path / "script.py"), "--out", str(tmp_path / "out")]
    done = invoke(*arguments, code=1)
    said = " ".join(done.output.split())
    assert "pybullet is not installed; install it with: pip install 'fclib[recorders]'" in said


# ---- MuJoCo's own steps

ARM = """
<mujoco>
  <option integrator="{integrator}" cone="{cone}" timestep="0.002" jacobian="{jacobian}"/>
  <worldbody>
    <geom type="plane" size="1 1 1" condim="{condim}"/>
    <body name="box" pos="0 0 .12" euler="20 30 0">
      <freejoint/>
      <geom type="box" size=".1 .1 .1" condim="{condim}" margin=".01"/>
    </body>
    <body name="arm" pos="1 0 .1">
      <joint name="a" type="hinge" axis="0 1 0" damping=".5" frictionloss=".2" range="-1 20"/>
      <geom type="capsule" size=".02" fromto="0 0 0 .3 0 0"/>
      <body pos=".3 0 0">
        <joint name="b" type="hinge" axis="0 1 0" damping=".1" stiffness="2"/>
        <geom type="capsule" size=".02" fromto="0 0 0 .2 0 0"/>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="a" joint2="b" polycoef="0 .5 0 0 0"/></equality>
  <actuator><position joint="b" kp="20" kv="1"/></actuator>
</mujoco>
"""


def arm(**changes: Any) -> tuple[Any, Any]:
    """A box thrown on a plane, and an arm with all that a model may have."""
    mujoco = pytest.importorskip("mujoco")
    usual = {"integrator": "Euler", "cone": "elliptic", "jacobian": "dense", "condim": 3}
    model = mujoco.MjModel.from_xml_string(ARM.format(**usual | changes))
    data = mujoco.MjData(model)
    data.qvel[:6] = 0.5, 0.2, 0, 3, 0, 1
    data.ctrl[:] = 0.3
    return model, data


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
@pytest.mark.parametrize("condim", [1, 3, 4, 6])
def test_mujocos_reaction_gives_its_next_velocity(
    integrator: str, cone: str, jacobian: str, condim: int
) -> None:
    model, data = arm(integrator=integrator, cone=cone, jacobian=jacobian, condim=condim)
    mujoco = pytest.importorskip("mujoco")
    contacts = 0
    for k in range(200):
        if k % 4:
            mujoco.mj_step(model, data)
            continue
        step = recorders.mujoco(model, data)
        assert step.guess is not None
        assert step.mismatch is not None
        assert step.mismatch < 1e-12
        assert step.contacts is not None
        contacts = max(contacts, len(step.contacts))
        r = step.guess.r.reshape(-1, {4: 4, 6: 6}.get(condim, 3))
        assert (r[:, 0] >= 0).all()
        if cone == "elliptic":  # the corners of a pyramid are outside of the cone
            assert recorders.criteria_of(step.problem, step.guess)["cone"] < 1e-8
    assert contacts > 1
    assert step.problem.kind == ("global_spin" if condim > 3 else "global")
    assert step.assembled.problem.p == 1
    assert fclib.solve(step.problem).converged


@pytest.mark.parametrize(
    ("condim", "friction", "kind", "d"),
    [
        (4, "0.5 0.02 0", "global_spin", 4),
        (6, "0.5 0.02 0.01", "global_spin", 6),
        (6, "0.5 0 0.01", "global_rolling", 5),
        (3, "0.5 0.02 0.01", "global", 3),
    ],
)
def test_the_moment_that_brakes_a_top_is_recorded(
    condim: int, friction: str, kind: str, d: int
) -> None:
    """A ball that spins where it lies: m_N = -mu_s r_N, by MuJoCo and by Coulomb's law."""
    mujoco = pytest.importorskip("mujoco")
    shape = f'condim="{condim}" friction="{friction}"'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option cone="elliptic"/><worldbody><geom type="plane" size="1 1 1" {shape}/>'
        f'<body pos="0 0 .1"><freejoint/><geom size=".1" mass="2" {shape}/></body>'
        '<body pos="1 0 1"><joint range="0 20"/><geom type="capsule" size=".02 .1"/></body>'
        "</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    for _ in range(500):
        data.qvel[5] = 1  # MuJoCo's law lifts what spins faster
        step = recorders.mujoco(model, data)
    problem: Any = step.problem
    assert (problem.kind, problem.spacedim) == (kind, d)
    assert step.mismatch is not None
    assert step.mismatch < 1e-9
    assert problem.info.math_info.count("S") == (d in (4, 6))
    assert step.guess is not None
    r = step.guess.r[:d]
    assert r[0] == pytest.approx(2 * 9.81 * 0.002, rel=1e-3)
    result = converged(problem, tol=1e-10)
    assert result.solution.r[0] == pytest.approx(r[0], rel=1e-3)
    if kind == "global_spin":
        assert problem.mu_s[0] == 0.02
        assert r[3] == pytest.approx(-0.02 * r[0], rel=1e-6)
        assert result.solution.r[3] == pytest.approx(-0.02 * result.solution.r[0], rel=1e-8)


class Worlds:
    """Worlds as those of MuJoCo Warp, each kept in MuJoCo's own data."""

    def __init__(self, data: Any, count: int, njmax: int = 1000) -> None:
        self.worlds = [copy.copy(data) for _ in range(count)]
        self.nworld, self.njmax = count, njmax

    @property
    def nefc(self) -> Any:
        return SimpleNamespace(numpy=lambda: np.array([data.nefc for data in self.worlds]))


def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    """A module that takes the steps of MuJoCo Warp by MuJoCo."""
    mujoco = pytest.importorskip("mujoco")

    def step(model: Any, data: Worlds) -> None:
        for world in data.worlds:
            mujoco.mj_step(model.source, world)

    module = SimpleNamespace(
        step=step,
        put_model=lambda model: SimpleNamespace(source=model),
        get_data_into=lambda into, model, data, k: mujoco.mj_copyData(into, model, data.worlds[k]),
        __version__="4.0.0",
    )
    monkeypatch.setitem(sys.modules, "mujoco_warp", module)


def test_a_world_of_mujoco_warp_gives_mujocos_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    mujoco = pytest.importorskip("mujoco")
    stand_in(monkeypatch)
    model, data = arm()
    while data.ncon < 2:
        mujoco.mj_step(model, data)
    warp_model, worlds = SimpleNamespace(source=model), Worlds(data, 2)
    worlds.worlds[0].qvel[:] = 0
    step = recorders.mujoco_warp(model, warp_model, worlds, 1)
    own = recorders.mujoco(model, data)
    assert step.engine == "MuJoCo Warp"
    assert step.version == "4.0.0"
    assert "The data are of single precision." in step.notes
    assert fclib.digest(step.assembled.problem) == fclib.digest(own.assembled.problem)
    assert step.guess is not None
    assert own.guess is not None
    np.testing.assert_array_equal(step.guess.r, own.guess.r)
    with pytest.raises(ValueError, match="there is no world 2: there are 2"):
        recorders.mujoco_warp(model, warp_model, worlds, 2)
    worlds.njmax = 3
    with pytest.raises(ValueError, match="memory for 3: make njmax larger"):
        recorders.mujoco_warp(model, warp_model, worlds)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    with pytest.raises(ValueError, match="mjINT_IMPLICITFAST of MuJoCo Warp is not recorded"):
        recorders.mujoco_warp(model, warp_model, worlds)


def test_a_script_of_mujoco_warp_is_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(monkeypatch)
    model, data = arm()
    monkeypatch.setitem(sys.modules, "scene", SimpleNamespace(model=model, data=Worlds(data, 1)))
    script = tmp_path / "drop.py"
    script.write_text(
        "import mujoco_warp as mjw\nfrom scene import model, data\n"
        "made = mjw.put_model(model)\nfor _ in range(6):\n    mjw.step(made, data)\n"
    )
    recording = recorders.record_script("mujoco_warp", script, tmp_path / "out", every=5)
    assert (recording.seen, recording.written) == (6, 2)


def test_mujocos_body_at_rest_is_near_coulombs_law() -> None:
    """A box that lies: soft or not, its weight is carried, and the error says how soft."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom type='plane' size='1 1 1'/><body pos='0 0 .1'><freejoint/>"
        "<geom type='box' size='.1 .1 .1' mass='2'/></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    for _ in range(1000):
        step = recorders.mujoco(model, data)
    assert step.guess is not None
    assert step.guess.r[::3].sum() == pytest.approx(2 * 9.81 * 0.002, rel=1e-6)
    assert fclib.merit(step.problem, step.guess).error < 1e-6
    origin = json.loads(step.problem.info.description.splitlines()[-1])
    assert (origin["engine"], origin["fields"]["w"]) == ("MuJoCo", "reconstructed")


def test_a_script_of_mujoco_is_recorded(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    script = tmp_path / "drop.py"
    script.write_text(
        "import mujoco\nfrom mujoco import mj_step\n"
        "model = mujoco.MjModel.from_xml_string(\n"
        "    \"<mujoco><worldbody><geom type='plane' size='1 1 1'/><body pos='0 0 .099'>\"\n"
        "    \"<freejoint/><geom type='sphere' size='.1'/></body></worldbody></mujoco>\")\n"
        "data = mujoco.MjData(model)\n"
        "mujoco.mj_step(model, data)\nmj_step(model, data, nstep=9)\nprint(data.time)\n"
    )
    before = mujoco.mj_step
    done = invoke("record", "mujoco", script, "--out", tmp_path / "out", "--every", "5")
    assert "2 of 10 steps" in done.output
    assert mujoco.mj_step is before
    files = sorted((tmp_path / "out").glob("*.hdf5"))
    assert [file.name for file in files] == ["mujoco-000000.hdf5", "mujoco-000005.hdf5"]
    assert fclib.solve(fclib.read(files[0])).converged


SPHERE = """
import mujoco
model = mujoco.MjModel.from_xml_string(
    "<mujoco><option><flag autoreset='disable'/></option><worldbody>"
    "<geom type='plane' size='1 1 1'/><body pos='0 0 .099'><freejoint/>"
    "<geom size='.1'/></body>%s</worldbody></mujoco>")
data = mujoco.MjData(model)
"""
CLOTH = (
    "<flexcomp name='cloth' type='grid' count='3 3 1' spacing='.05 .05 .05' pos='.5 0 .02' dim='2'"
    " radius='.01' mass='.1'><edge equality='true'/></flexcomp>"
)


def test_a_script_is_recorded_into_a_sequence(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    script, path = tmp_path / "drop.py", tmp_path / "new" / "run.h5"
    script.write_text(SPHERE % "" + "mujoco.mj_step(model, data, 12)\n")
    words = ["record", "mujoco", str(script), "--every", "3"]
    done = invoke(*words, "--out", path)
    assert "4 of 12 steps" in done.output
    invoke(*words, "--out", tmp_path / "files")
    steps, files = fclib.Sequence(path), sorted((tmp_path / "files").iterdir())
    assert len(steps) == len(files) == 4
    for k, file in enumerate(files):
        assert fclib.digest(steps[k]) == fclib.digest(fclib.read(file))
        assert steps[k].info == fclib.read(file).info
        (guess,), (same,) = steps.guesses(k), fclib.read_guesses(file)
        assert (guess.r == same.r).all()
    before = path.read_bytes()
    done = invoke(*words, "--out", path, code=1)
    assert "is there already; name another file" in " ".join(done.output.split())
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("more", "text", "count", "said"),
    [
        (CLOTH, "", 0, "is one of a flexible body"),
        (
            "",
            "data.xfrc_applied[1, 2] = math.nan\nmujoco.mj_step(model, data, 3)\n"
            "mujoco.mj_resetData(model, data)\nmujoco.mj_step(model, data, 5)\n",
            3,
            "number 10, and 2 more. Of number 10: there is a number that is not finite",
        ),
    ],
)
def test_a_step_that_cannot_be_recorded_is_left_out(
    more: str, text: str, count: int, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings into a file there
    script, path = tmp_path / "drop.py", tmp_path / "run.h5"
    script.write_text(
        SPHERE % more
        + "import math\nmujoco.mj_step(model, data, 10)\n"
        + (text or "mujoco.mj_step(model, data, 200)\n")
        + "print(f'it ran to its end, with {data.time:.3f} s')\n"
    )
    done = invoke("record", "mujoco", script, "--out", path)
    assert "it ran to its end, with" in done.output
    assert said in " ".join(done.output.split())
    left = re.search(r"(\d+) of (\d+) steps", done.output)
    assert left is not None
    assert len(fclib.Sequence(path)) == int(left[1]) > 5
    if count:
        assert int(left[2]) - int(left[1]) == count
    problems: Any = fclib.Sequence(path)
    assert all(np.isfinite(problem.f).all() for problem in problems)


def test_what_is_not_recorded_of_mujoco_is_named() -> None:
    model, data = arm(integrator="RK4")
    with pytest.raises(ValueError, match="mjINT_RK4 is not recorded"):
        recorders.mujoco(model, data)
    assert data.time == 0


@pytest.mark.parametrize(
    ("option", "joint", "exact"),
    [
        ("", 'damping="2"', True),
        ('<flag damper="disable"/>', 'damping="2"', True),
        ('<flag eulerdamp="disable"/>', 'damping="2"', True),
        ("", 'damping="2 3 .5"', False),
    ],
)
def test_what_mujocos_reaction_does_not_explain_is_said(
    option: str, joint: str, exact: bool
) -> None:
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><option>{option}</option><worldbody><body>"
        f"<joint type='hinge' axis='0 1 0' {joint}/>"
        "<geom type='capsule' size='.05' fromto='0 0 0 1 0 0'/></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    data.qvel[0] = 3
    for _ in range(20):
        step = recorders.mujoco(model, data)
        assert step.mismatch is not None
        assert (step.mismatch < 1e-12) is exact
        assert step.fields["M"] == ("exact" if exact else "reconstructed")
        assert any("next velocity" in note for note in step.notes) is not exact


def test_sleeping_bodies_of_mujoco_are_refused() -> None:
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><option><flag sleep='enable'/></option><worldbody><body><freejoint/>"
        "<geom size='.1'/></body></worldbody></mujoco>"
    )
    with pytest.raises(ValueError, match="bodies that sleep"):
        recorders.mujoco(model, mujoco.MjData(model))


@pytest.mark.parametrize(
    ("text", "status", "said"),
    [
        ("import sys\nstep(3)\nsys.exit(0)\n", 0, "3 of 3 steps"),
        ("import sys\nstep(3)\nsys.exit(4)\n", 1, "ended with 4"),
        ("step(1)\nraise ValueError('mine')\n", 1, "script.py:8: ValueError: mine"),
        ("import nosuchmodule\n", 1, "script.py:7: ModuleNotFoundError"),
        ("def f(:\n", 1, "script.py:7: SyntaxError"),
        ("\0", 1, "script.py"),
        ("pass\n", 0, "it took no step of mujoco"),
        ("import os\nos.chdir('/')\nstep(2)\n", 0, "2 of 2 steps"),
        ("mujoco.mj_step(m=model, d=data, nstep=4)\n", 0, "4 of 4 steps"),
    ],
)
def test_scripts_end_as_they_like(
    text: str, status: int, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mujoco")
    script = tmp_path / "script.py"
    script.write_text(
        "import mujoco\n"
        "model = mujoco.MjModel.from_xml_string(\n"
        "    \"<mujoco><worldbody><geom type='plane' size='1 1 1'/><body pos='0 0 .099'>\"\n"
        "    \"<freejoint/><geom size='.1'/></body></worldbody></mujoco>\")\n"
        "data = mujoco.MjData(model)\n"
        "step = lambda n: mujoco.mj_step(model, data, n)\n" + text
    )
    monkeypatch.chdir(tmp_path)
    done = invoke("record", "mujoco", "script.py", "--out", "out", code=status)
    assert said in " ".join(done.output.split())
    if said.endswith("steps"):
        assert len(list((tmp_path / "out").glob("*.hdf5"))) == int(said[0])


class Tensor:
    """An array of one world, as Genesis keeps it: the world is the last axis."""

    def __init__(self, values: Any) -> None:
        self.values = np.asarray(values)[..., None]
        if self.values.dtype == float:
            self.values = self.values.astype(np.float32)
        self.shape = self.values.shape

    def to_numpy(self) -> Any:
        return self.values


class Mapped(Tensor):
    """An array of contacts with components: the world is the second axis."""

    def __init__(self, values: Any) -> None:
        super().__init__(values)
        self.values = np.moveaxis(self.values, -1, 1)


WEIGHT = 2 * 9.81  # [N]


def box_in_genesis(
    monkeypatch: pytest.MonkeyPatch, elliptic: bool, spins: bool = False, world: int = 0
) -> Any:
    """What Genesis keeps of a box at rest on the ground, which it pushes to a side."""
    corners = 0.1 * np.array([(x, y, -1.0) for x in (-1, 1) for y in (-1, 1)])
    n, mu = np.array([0.0, 0, -1]), 0.5  # from the box to the ground
    d1, d2 = np.array([-1.0, 0, 0]), np.array([0.0, 1, 0])

    def row(axis: Any, turn: Any, at: Any) -> Any:
        return np.concatenate([axis, np.cross(at, axis) + turn])

    zero = np.zeros(3)
    if elliptic:
        axes = [(-n, zero), (d1, zero), (d2, zero), *([(zero, -n)] if spins else [])]
        forces = [WEIGHT / 4, 0.25, 0.0, *([0.0] if spins else [])]
    else:
        axes = [(sign * mu * d - n, zero) for d in (d1, d2) for sign in (-1, 1)]
        own = 0.25 / (2 * mu)
        forces = [WEIGHT / 16 - own, WEIGHT / 16 + own, WEIGHT / 16, WEIGHT / 16]
    J = np.array([row(*axis, at) for at in corners for axis in axes])
    M = np.diag([2.0, 2, 2, 0.01, 0.01, 0.01])
    force = np.tile(forces, 4)
    h, smooth = 0.005, np.array([0.0, 0, -9.81, 0, 0, 0])
    vel = Tensor(np.zeros(6))
    after = h * (smooth + np.linalg.solve(M, J.T @ force))
    kinds = SimpleNamespace(approximate_implicitfast=2)

    def integrator(value: int) -> Any:
        return SimpleNamespace(name="Euler")

    integrator.approximate_implicitfast = kinds.approximate_implicitfast  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "genesis", SimpleNamespace(integrator=integrator))
    monkeypatch.setattr(_genesis, "pinned", lambda: "1.4.5")
    solver = SimpleNamespace(
        rigid_config=SimpleNamespace(
            integrator=2,
            enable_elliptic_friction=elliptic,
            enable_torsional_friction=spins,
            enable_rolling_friction=False,
            enable_signorini_contact=elliptic,
            rows_per_contact=len(axes),
            use_hibernation=False,
        ),
        sim=SimpleNamespace(coupler=None, cur_t=0.1),
        substep_dt=h,
        links=[SimpleNamespace(name="ground"), SimpleNamespace(name="box")],
        rigid_info=SimpleNamespace(mass_mat=Tensor(np.tril(M))),
        dyn_state=SimpleNamespace(dofs=SimpleNamespace(vel=vel, acc_smooth=Tensor(smooth))),
        constraint_solver=SimpleNamespace(
            constraint_state=SimpleNamespace(
                n_constraints=Tensor(len(J)),
                n_constraints_equality=Tensor(0),
                n_constraints_frictionloss=Tensor(0),
                jac=Tensor(J),
                efc_force=Tensor(force),
                efc_frictionloss=Tensor(np.zeros(len(J))),
            )
        ),
        collider=SimpleNamespace(
            collider_state=SimpleNamespace(
                n_contacts=Tensor(4),
                contact_sort_idx=Tensor(np.arange(4)[::-1]),
                contact_data=SimpleNamespace(
                    link_a=Tensor(np.zeros(4, int)),
                    link_b=Tensor(np.ones(4, int)),
                    pos=Mapped(corners[::-1]),
                    normal=Mapped(np.tile(n, (4, 1))),
                    penetration=Tensor(np.full(4, 1e-5)),
                    friction=Tensor(np.full(4, mu)),
                    friction_torsional=Tensor(np.full(4, 0.01)),
                    friction_rolling=Tensor(np.zeros(4)),
                ),
            )
        ),
    )

    def substep(f: int) -> None:
        vel.values = np.asarray(after, dtype=np.float32)[:, None]

    solver.substep = substep
    return SimpleNamespace(rigid_solver=solver, step=lambda: solver.substep(0))


@pytest.mark.parametrize(("elliptic", "spins"), [(True, False), (False, False), (True, True)])
def test_a_step_of_genesis_gives_its_problem(
    elliptic: bool, spins: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    step = recorders.genesis(box_in_genesis(monkeypatch, elliptic, spins))
    problem = step.problem
    assert (problem.nc, problem.spacedim) == (4, 3 + spins)
    assert step.mismatch is not None
    assert step.mismatch < 1e-6
    assert step.contacts is not None
    frame, point = step.contacts.frame, step.contacts.point
    assert frame is not None
    assert point is not None
    np.testing.assert_array_equal(np.linalg.det(frame), 1)
    np.testing.assert_array_equal(frame[:, 0], np.tile([0, 0, 1], (4, 1)))
    # the columns of H are those of the points and the frames
    H = problem.H.toarray()
    for k in range(4):
        rows = np.hstack([frame[k], np.cross(point[k], frame[k])])
        own = H[:, problem.spacedim * k : problem.spacedim * k + 3].T
        np.testing.assert_allclose(own, rows, atol=1e-7)
    assert step.guess is not None
    r = step.guess.r.reshape(4, -1)
    np.testing.assert_allclose(r[:, 0], 0.005 * WEIGHT / 4, rtol=1e-6)
    np.testing.assert_allclose(
        np.einsum("ki,kij->kj", r[:, :3], frame)[:, 0], -0.005 * 0.25, rtol=1e-6
    )
    assert fclib.solve(problem, tol=1e-9).converged
    assert "single precision" in " ".join(step.notes)


def test_a_reaction_that_does_not_give_the_velocity_makes_nothing_exact(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = box_in_genesis(monkeypatch, elliptic=True)
    assert recorders.genesis(scene).fields["M"] == "exact"
    # as the forces of a sweep that follows the solver
    scene.rigid_solver.constraint_solver.constraint_state.efc_force.values[0] *= 1.5
    step = recorders.genesis(scene)
    assert (step.fields["M"], step.fields["f"]) == ("reconstructed", "reconstructed")
    assert "Genesis's reaction gives its next velocity to" in step.notes[-1]


def test_steps_of_genesis_that_are_not_recorded_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = box_in_genesis(monkeypatch, elliptic=False)
    config = scene.rigid_solver.rigid_config
    with pytest.raises(ValueError, match="there is no world 1: there are 1"):
        recorders.genesis(scene, 1)
    for name, value, word in (
        ("integrator", 0, "integrator Euler of Genesis is not recorded"),
        ("use_hibernation", True, "bodies that sleep"),
        ("enable_torsional_friction", True, "pyramids with torsional friction"),
    ):
        before = getattr(config, name)
        setattr(config, name, value)
        with pytest.raises(recorders.SetupError, match=word):
            recorders.genesis(scene)
        setattr(config, name, before)
    scene.rigid_solver.collider.collider_state.contact_data.friction.values[1] = 0
    with pytest.raises(ValueError, match="contact 2: a pyramid without friction"):
        recorders.genesis(scene)


def test_another_version_of_genesis_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "genesis", SimpleNamespace())
    monkeypatch.setattr("importlib.metadata.version", lambda name: "1.5.0")
    with pytest.raises(ImportError, match=r"pip install \"genesis-world==1.4.\*\""):
        recorders.genesis(None)


def test_a_script_of_genesis_is_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each substep, but for the one that a scene takes and undoes while it is built."""
    scene = box_in_genesis(monkeypatch, elliptic=True)
    solver, substep = scene.rigid_solver, scene.rigid_solver.substep

    class RigidSolver:
        def substep(self, f: int) -> None:
            substep(f)

    class Scene:
        def build(self) -> None:
            self.solver = RigidSolver()
            vars(self.solver).update({k: v for k, v in vars(solver).items() if k != "substep"})
            self.solver.substep(0)

        def step(self) -> None:
            self.solver.substep(0)

    module: Any = sys.modules["genesis"]
    module.Scene = Scene
    name = "genesis.engine.solvers.rigid.rigid_solver"
    monkeypatch.setitem(sys.modules, name, SimpleNamespace(RigidSolver=RigidSolver))
    script = tmp_path / "box.py"
    script.write_text(
        "import genesis as gs\nscene = gs.Scene()\nscene.build()\n"
        "for _ in range(6):\n    scene.step()\n"
    )
    recording = recorders.record_script("genesis", script, tmp_path / "out", every=5)
    assert (recording.seen, recording.written) == (6, 2)
    assert [p.name for p in sorted((tmp_path / "out").glob("*"))] == [
        "genesis-000000.hdf5",
        "genesis-000005.hdf5",
    ]
