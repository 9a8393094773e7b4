"""Simulations of robots as they come: servos, held bodies, terrains, what a file asks too much."""

import dataclasses
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp

import fclib
from fclib import _core, collections
from fclib.scenes import Scene
from fclib.scenes.shared.interaction import Course, Drive, Interaction
from helpers import dense, ran
from helpers_cli import run as command
from helpers_simulate import mujoco_of

# MuJoCo has no release for the oldest Python that fclib takes
mujoco = pytest.importorskip("mujoco")

from fclib.collections import trajectory  # noqa: E402
from fclib.simulate import MujocoModel, StoppedError, UnsupportedSceneError, logged, simulate  # noqa: E402
from fclib.simulate import simulation as module  # noqa: E402
from fclib.simulate.geometry import places_of  # noqa: E402
from fclib.simulate.simulation import STILL, carry_over, same_contacts, trouble  # noqa: E402

H = 0.002  # s


def document(bodies: str, rest: str = "", friction: float = 0.7) -> str:
    return (
        f'<mujoco><option timestep="{H}"/><default><geom friction="{friction}"/></default>'
        f"<worldbody>{bodies}</worldbody>{rest}</mujoco>"
    )


def run(xml: str, steps: int, **options: Any) -> list[Any]:
    return list(simulate(Scene(name="test", xml=xml), steps, **options))


# ---- servos


def arm(joint: str = "", tendon: str = "", actuators: str = "") -> str:
    """A mass of 1 kg on an arm of 1 m, which gravity pulls down; a tendon lifts it."""
    return document(
        f'<body><joint name="j" axis="0 1 0" {joint}/>'
        '<geom size="0.05" pos="1 0 0" mass="1" contype="0" conaffinity="0"/>'
        '<site name="end" pos="1 0 0"/></body><site name="above" pos="1 0 1"/>',
        f'<tendon><spatial name="t" {tendon}><site site="end"/><site site="above"/></spatial>'
        f"</tendon><actuator>{actuators}</actuator>",
    )


SERVOS = {
    "of the actuator": arm(actuators='<position joint="j" kp="2000" forcerange="-1 1"/>'),
    "of the joint": arm('actuatorfrcrange="-1 1"', actuators='<position joint="j" kp="2000"/>'),
    "of the tendon": arm(
        tendon='actuatorfrcrange="-1 1"', actuators='<position tendon="t" kp="2000"/>'
    ),
    "of a speed": arm(actuators='<velocity joint="j" kv="200" forcerange="-2 2"/>'),
    "of two on a joint": arm(
        'actuatorfrcrange="-3 3"',
        actuators='<position joint="j" kp="2000" kv="5"/><velocity joint="j" kv="30"/>',
    ),
    "of two on a tendon": arm(
        tendon='actuatorfrcrange="-12 12"',
        actuators='<position tendon="t" kp="2000" kv="40"/><velocity tendon="t" kv="100"'
        ' forcerange="-5 5"/>',
    ),
    "that is left again": arm(
        actuators='<position joint="j" kp="2000" kv="400" forcerange="-12 12"/>'
    ),
}


def by_mujoco(xml: str, time: float) -> tuple[float, float]:
    """Position and velocity of MuJoCo's implicit integrator, with small steps."""
    m = mujoco.MjModel.from_xml_string(xml)
    m.opt.timestep = H / 20
    m.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICIT
    d = mujoco.MjData(m)
    for _ in range(round(time / m.opt.timestep)):
        mujoco.mj_step(m, d)
    return float(d.qpos[0]), float(d.qvel[0])


@pytest.mark.parametrize("limit", SERVOS)
def test_a_servo_at_a_limit_is_a_constant_force(limit: str) -> None:
    xml = SERVOS[limit]
    for time in (0.1, 0.3):
        *_, last = run(xml, round(time / H))
        position, velocity = by_mujoco(xml, time)
        # the scheme is of order one: a step of gravity
        assert abs(last.model.position[0] - position) <= 1.5 * H * 9.81 * time
        assert abs(last.velocity[0] - velocity) <= H * 9.81


def test_a_limit_within_a_step_limits_the_force() -> None:
    """At rest the servo is within its range, and so stiff that it would hold the arm."""
    xml = arm(actuators='<position joint="j" kp="1e9" forcerange="-1 1"/>')
    (step,) = run(xml, 1)
    assert step.velocity[0] == pytest.approx(H * (9.81 - 1) / 1.001, rel=1e-3)


def test_a_servo_leaves_its_limit_within_a_step() -> None:
    """It comes to its speed without going back and forth between its limits."""
    slide = (
        '<body><joint name="j" type="slide"/><geom size="0.1" mass="1" contype="0"'
        ' conaffinity="0"/></body>'
    )
    servo = '<actuator><velocity joint="j" kv="1e6" forcerange="-1 1"/></actuator>'
    rest = '<keyframe><key name="start" ctrl="0.0211"/></keyframe>'
    xml = document(slide, servo + rest).replace("<option", '<option gravity="0 0 0"')
    speeds = [float(step.velocity[0]) for step in run(xml, 20)]
    np.testing.assert_allclose(speeds[:10], H * np.arange(1, 11), rtol=1e-9)
    np.testing.assert_allclose(speeds[10:], 0.0211, rtol=1e-4)


def test_a_servo_presses_with_its_limit() -> None:
    """Against a wall, the target behind it: the reaction is the limit, however stiff it is."""
    bodies = (
        '<geom type="box" size="0.1 1 1" pos="-0.1 0 0"/>'
        '<body pos="0.1 0 0"><joint name="j" type="slide" axis="1 0 0"/>'
        '<geom type="box" size="0.1 0.1 0.1" mass="1"/></body>'
    )
    servo = '<actuator><position joint="j" kp="1e8" forcerange="-3 3"/></actuator>'
    rest = '<keyframe><key name="start" ctrl="-0.5"/></keyframe>'
    for step in run(document(bodies, servo + rest), 20):
        r = np.reshape(step.result.solution.r, (-1, 3))
        assert r[:, 0].sum() == pytest.approx(3 * H, rel=1e-6)


# ---- held bodies

PADS = """
<body pos="-0.03 0 0.5"><joint type="slide" axis="1 0 0" damping="20" name="l"/>
  <geom type="box" size="0.02 0.03 0.03" mass="0.2"/></body>
<body pos="0.03 0 0.5"><joint type="slide" axis="-1 0 0" damping="20" name="r"/>
  <geom type="box" size="0.02 0.03 0.03" mass="0.2"/></body>
<body pos="0 0 0.5"><freejoint/><geom {shape} mass="0.045"/></body>"""
SQUEEZE = (
    '<actuator><position joint="l" kp="1500"/><position joint="r" kp="1500"/></actuator>'
    '<keyframe><key name="start" ctrl="0.01 0.01" qpos="0.006 0.006 0 0 0.5 1 0 0 0"/></keyframe>'
)
HELD = {
    "capsule": 'type="capsule" size="0.004 0.02" euler="90 0 0"',
    "sphere": 'type="sphere" size="0.004"',
    "box": 'type="box" size="0.004 0.02 0.01" euler="30 0 0"',
    "cylinder": 'type="cylinder" size="0.004 0.02" euler="90 0 0"',
    "ellipsoid": 'type="ellipsoid" size="0.004 0.02 0.01"',
}


@pytest.mark.parametrize("shape", HELD)
def test_what_pads_hold_stays(shape: str) -> None:
    steps = run(document(PADS.format(shape=HELD[shape]), SQUEEZE), 250)
    assert all(step.result.converged for step in steps)
    fallen = steps[0].position[4] - steps[-1].model.position[4]
    assert abs(fallen) < 1e-6  # 29 mm, where a contact is lost for a step now and then


def boxes(count: int) -> str:
    box = '<body pos="0 0 {}"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="1"/></body>'
    floor = '<geom type="plane" size="1 1 0.1"/>'
    return document(floor + "".join(box.format(0.1 + 0.2 * i) for i in range(count)))


def test_a_stack_at_rest_keeps_its_contacts_and_reactions() -> None:
    """Edges lie on edges: rounding would say how many points there are."""
    steps = run(boxes(5), 300)
    assert {step.problem.nc for step in steps} == {20}
    r = np.array([step.result.solution.r for step in steps])
    assert np.abs(r[10:] - r[10]).max() < 1e-6 * np.abs(r[10]).max()
    assert np.abs(steps[-1].position - steps[10].position).max() < 1e-9


def arch() -> Scene:
    """Stones whose edges lie on each other, and whose joints are closed but for rounding."""
    scene = fclib.scenes.get("Arch")(voussoirs=12, spread=0.0, lap=0.0).scene()
    return dataclasses.replace(scene, allowance=True)


def test_an_arch_at_rest_keeps_its_corners_and_reactions() -> None:
    known: Any = None
    for step in simulate(arch(), 60):
        assert step.result.converged
        assert step.problem.nc == 4 * 13
        r = np.reshape(step.result.solution.r, (-1, 3))
        places = places_of(step.model, step.contacts)
        if step.index == 5:
            known = step.position, step.contacts.pair, places, r
        elif step.index > 5:
            source = same_contacts(known[1], known[2], step.contacts.pair, places)
            assert np.abs(r - known[3][source]).max() < 1e-6 * np.abs(r).max()
            assert np.abs(step.position - known[0]).max() < 1e-7


def test_reactions_at_rest_stay_whatever_the_solver_returns() -> None:
    """One that begins from 0, and goes through the contacts in another order at each step."""
    seen: list[Any] = []

    @fclib.solver("t-cold")
    def cold(problem: Any, r: Any, monitor: Any) -> Any:
        monitor.stop(r)
        if not any(np.array_equal(problem.q, one) for one in seen):
            seen.append(np.array(problem.q))
            r = fclib.solve(problem, "nsgs", 1e-8, shuffle="once", seed=len(seen)).solution.r
        monitor.stop(r)
        return r

    known: Any = None
    # with a callback, a guess that is a solution goes to the solver too
    scene = Scene(name="two", xml=boxes(2))
    for step in simulate(scene, 8, solver="t-cold", callback=lambda *report: None):
        assert len(seen) == step.index + 1
        r = np.reshape(step.result.solution.r, (-1, 3))
        places = places_of(step.model, step.contacts)
        known = known or (step.contacts.pair, places, r)
        source = same_contacts(known[0], known[1], step.contacts.pair, places)
        assert np.abs(r - known[2][source]).max() < 1e-6 * np.abs(r).max()


def test_reactions_nearest_to_others_move_nothing() -> None:
    problem = next(simulate(arch(), 1)).problem
    solution = fclib.solve(problem, tol=1e-12).solution
    # another solution: the reactions of a self-stress of two corners of one joint added
    other = np.array(solution.r)
    other += 1e-3 * np.random.default_rng(0).standard_normal(len(other))
    near = _core.nearest_at_rest(problem, solution, other, STILL)
    assert near is not None
    assert np.abs(near - other).max() < np.abs(solution.r - other).max()
    change = problem.H @ (near - solution.r)
    assert np.abs(change).max() < 1e-10
    # no other one is nearer: what is left does not lie in the null space of H
    left = other - near
    null = scipy.linalg.null_space(dense(problem.H))
    assert np.abs(null.T @ left).max() < 1e-9


def test_a_second_solve_finds_what_it_does_alone() -> None:
    """It takes the factors of the first one over, and its result is the same to the last bit."""
    steps = run(boxes(3), 4)
    problem, solver = steps[-1].problem, fclib.find_solver("auto")

    def solved(guess: Any, still: float | None = None) -> Any:
        return _core.solve(
            problem, solver, 1e-8, 0, math.inf, {}, guess, None, False, False, still=still
        )

    guess = 1.3 * fclib.solve(problem).solution.r
    first = solved(guess)
    assert first.iterations
    near = _core.nearest_at_rest(problem, first.solution, guess, STILL)
    assert near is not None
    both = solved(guess, STILL)
    assert both == solved(near)
    assert both != first
    # bodies that count as moving are not solved again
    assert solved(guess, -1.0) == first


def test_a_published_family_has_no_allowance() -> None:
    """Its states were simulated without; what is stored says nothing of one."""
    scene = fclib.scenes.get("LowWall")().scene()
    assert not scene.allowance
    known = trajectory.record(scene)
    assert "allowance" not in known
    assert not trajectory.scene_of(known).allowance
    own = Scene(name="own", xml=boxes(1))
    assert trajectory.scene_of(trajectory.record(own)).allowance


def test_an_allowance_lets_no_body_hover() -> None:
    """A falling box is stopped where it touches, to a small share of the step."""
    xml = document(
        '<geom type="plane" size="1 1 0.1"/><body pos="0 0 0.30037"><freejoint/>'
        '<geom type="box" size="0.1 0.1 0.1" mass="1"/></body>'
    )
    *_, last = run(xml, 300)
    speed = math.sqrt(2 * 9.81 * 0.2)
    assert -0.6 * H * speed < last.model.position[2] - 0.1 < 0.52 * H * speed


def test_contacts_are_the_same_by_their_place() -> None:
    """MuJoCo changes the order of the points of a pair."""
    pair = np.array([[0, 1], [0, 1], [2, 3], [0, 1], [-4, 0]])
    place = np.zeros((5, 2, 3))
    place[:, :, 0] = np.array([0, 1, 0, 2, 0])[:, None]
    order = np.array([3, 4, 0, 2, 1])
    found = same_contacts(pair, place, pair[order], place[order] + 0.1)
    np.testing.assert_array_equal(found, order)
    # one is gone, and one is new
    found = same_contacts(pair[1:], place[1:], pair[[2, 1, 0]], place[[2, 1, 0]])
    assert found.tolist()[:2] == [1, 0]
    assert same_contacts(pair[:0], place[:0], pair, place).tolist() == [-1] * 5


def test_reactions_of_a_body_at_rest_are_carried_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """The guess of each step has the merit of a solution, whatever the order of the points."""
    errors = []

    def seen(state: Any, contacts: Any, places: Any) -> Any:
        guess = carry_over(state, contacts, places)
        errors.append(guess)
        return guess

    monkeypatch.setattr(module, "carry_over", seen)
    steps = run(boxes(3), 40)
    for step, guess in zip(steps[1:], errors, strict=True):
        assert fclib.merit(step.problem, fclib.Solution(r=guess)).error < 1e-6


# ---- what is solved


def test_both_errors_are_bounded_unless_one_is_asked_for() -> None:
    """NSGS stops as soon as it may; light bodies have the larger scaled error."""
    xml = boxes(3).replace('mass="1"', 'mass="0.001"')
    found = {}
    for merit in ("both", "natural"):
        options = {} if merit == "both" else {"merit": merit}
        (step,) = run(xml, 1, solver="nsgs", tol=1e-4, **options)
        assert step.result.converged
        found[merit] = fclib.merit(step.problem, step.result.solution)
    assert found["both"].error <= 1e-4
    assert found["natural"].natural <= 1e-4 < found["natural"].scaled_natural


def test_a_step_that_is_not_solved_can_stop() -> None:
    xml = boxes(4)
    assert len(run(xml, 3, solver="nsgs", max_iterations=1, tol=1e-15)) == 3
    with pytest.raises(StoppedError, match=r"^test, step 0: it was not solved \(nsgs: .*error"):
        run(xml, 3, solver="nsgs", max_iterations=1, tol=1e-15, unsolved="stop")
    with pytest.raises(ValueError, match='"best" or "stop", not'):
        run(xml, 1, unsolved="perhaps")


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e300])
def test_no_velocity_that_makes_no_sense_goes_on(
    bad: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    solve = _core.solve

    def wrong(problem: Any, *arguments: Any, **options: Any) -> Any:
        class Wrong:
            solution = fclib.Solution(r=np.zeros(problem.m), v=np.full(problem.n, bad))
            solver, status, error, converged = "wrong", "converged", 0.0, True

        return Wrong() if problem.nc else solve(problem, *arguments, **options)

    monkeypatch.setattr(_core, "solve", wrong)
    with pytest.raises(StoppedError, match="step 0: its velocity is out of range"):
        run(boxes(1), 3)


def test_an_error_as_large_as_that_of_no_reactions_stops() -> None:
    class Result:
        solver, status, converged = "x", "stalled", False
        error = math.nan

    result: Any = Result()
    velocity = np.array([1.0, 0, 0])

    def problem(speed: float) -> Any:
        return fclib.GlobalProblem(
            spacedim=3, M=np.eye(3), H=np.eye(3), f=[speed, 0, 0], w=np.zeros(3), mu=[0.5]
        )

    for error, stops in ((math.nan, True), (math.inf, True), (1.0, True), (1e-3, False)):
        result.error = error
        assert bool(trouble(problem(-1.0), result, velocity, 1e6, stop=False)) == stops
        assert trouble(problem(-1.0), result, velocity, 1e6, stop=True)
    # what a body in free flight asks of its joints is rounding
    result.error = 6.0
    assert not trouble(problem(-1e-12), result, velocity, 1e6, stop=False)
    result.converged = True
    assert not trouble(problem(-1.0), result, velocity, 1e6, stop=True)


RUNAWAY = document(
    '<geom type="plane" size="1 1 0.1"/><body pos="0 0 0.1"><joint type="slide" axis="1 0 0"'
    ' name="j"/><geom type="box" size="0.1 0.1 0.1" mass="1"/></body>',
    '<actuator><motor joint="j"/></actuator><keyframe><key name="start" ctrl="1e8"/></keyframe>',
)


def test_what_came_before_a_stop_is_stored_and_said(tmp_path: Path) -> None:
    """A body that a force drives out of range."""
    path = tmp_path / "runaway.xml"
    path.write_text(RUNAWAY, encoding="utf-8")
    out = tmp_path / "out"
    result = command("simulate", path, "--steps", 500, "--out", out, "--no-pictures", code=1)
    assert "Stopped: runaway, step " in result.stderr
    assert "the steps before are stored" in result.stderr
    states = trajectory.read(out / "scenes" / "runaway" / trajectory.OWN)
    assert 0 < len(states) < 500
    assert np.isfinite(states.position).all()
    assert np.isfinite(states.velocity).all()
    assert len(list(out.rglob("*-global.hdf5"))) == len(states)


def test_unsolved_steps_are_said(tmp_path: Path) -> None:
    plan = collections.Plan(
        scene=Scene(name="four", xml=boxes(4)),
        collection="scenes",
        problems=None,
        steps=4,
        simulation=collections.Simulation(
            solver="nsgs", tol=1e-15, options={"max_iterations": 1}, deepest=None
        ),
    )
    collections.build([plan], tmp_path, jobs=1)
    from fclib.cli._build import spans, steps_of

    (line,) = steps_of(plan, tmp_path)
    assert line.startswith("scenes/four: 4 steps were not solved to 1e-15")
    assert line.endswith(": 0-3")
    assert spans([1, 3, 4, 5, 9]) == "1, 3-5, 9"


# ---- terrains


def terrain(cells: int, body: str, more: str = "") -> str:
    return (
        f'<mujoco><option timestep="{H}"/><asset><hfield name="t" nrow="{cells}" ncol="{cells}"'
        f' size="1 1 .1 .1"/></asset><worldbody><geom name="ground" type="hfield" hfield="t"'
        f" {more}/>{body}</worldbody></mujoco>"
    )


BOX = '<body pos="0.013 0.007 {z}"><freejoint/><geom type="box" size="{size}" mass="1"/></body>'


@pytest.mark.parametrize("cells", [60, 100])
def test_a_body_rests_on_a_fine_terrain(cells: int) -> None:
    *_, last = run(terrain(cells, BOX.format(z=0.06, size="0.2 0.2 0.05")), 40)
    assert last.result.converged
    np.testing.assert_allclose(last.model.position[:4], [0.013, 0.007, 0.05, 1.0], atol=1e-3)


def test_contacts_of_a_fine_terrain_are_under_the_whole_body() -> None:
    body = BOX.format(z=0.05, size="0.2 0.1 0.05")
    (step,) = run(terrain(100, body), 1)
    low, high = step.contacts.point.min(axis=0), step.contacts.point.max(axis=0)
    np.testing.assert_allclose(low[:2], [0.013 - 0.2, 0.007 - 0.1], atol=0.03)
    np.testing.assert_allclose(high[:2], [0.013 + 0.2, 0.007 + 0.1], atol=0.03)
    # the field is as it was
    m = step.model.model
    assert m.hfield_nrow[0] == m.hfield_ncol[0] == 100
    np.testing.assert_array_equal(m.hfield_size[0], [1, 1, 0.1, 0.1])
    assert (m.geom_contype == 1).all()


def test_a_turned_terrain_holds_a_body() -> None:
    """The windows of a field lie where the field does."""
    more = 'pos="0.3 0.1 0.2" euler="5 3 20"'
    body = BOX.format(z=0.27, size="0.2 0.2 0.05").replace("0.013 0.007", "0.3 0.1")
    flat = body.replace("<freejoint/>", "<freejoint/>").replace("<body ", '<body euler="5 3 20" ')
    steps = run(terrain(100, flat, more), 60)
    assert steps[-1].model.position[2] > 0.23
    assert np.abs(steps[-1].velocity).max() < 0.5


NAMED = '<contact><pair geom1="{}" geom2="box" friction="0.2 0.2" margin="{}"/>{}</contact>'


def counted(contacts: Any) -> dict[tuple[int, ...], int]:
    """The number of contacts of each pair."""
    pairs, counts = np.unique(np.sort(contacts.pair, axis=1), axis=0, return_counts=True)
    return dict(zip(map(tuple, pairs.tolist()), counts.tolist(), strict=True))


ON_TOP = '<pair geom1="ball" geom2="box" friction="0.3 0.3"/>'
BALL = '<body pos="0.013 0.007 0.15"><freejoint/><geom name="ball" size="0.05" mass="1"/></body>'


@pytest.mark.parametrize("bits", ["", 'contype="0" conaffinity="0"'])
def test_named_pairs_on_a_terrain_count_once(bits: str) -> None:
    box = BOX.format(z=0.05, size="0.4 0.4 0.05")
    plain = MujocoModel(Scene(name="test", xml=terrain(100, box))).assemble(H).contacts
    assert len(plain) > 1000
    bodies = box.replace("<geom ", '<geom name="box" ') + BALL
    named = terrain(100, bodies).replace("<geom ", f"<geom {bits} ")
    named = named.replace("</worldbody>", "</worldbody>" + NAMED.format("ground", 0, ON_TOP))
    contacts = MujocoModel(Scene(name="test", xml=named)).assemble(H).contacts
    assert counted(contacts) == {(0, 1): len(plain), (1, 2): 1}
    on_field = (contacts.pair == 0).any(axis=1)
    assert set(contacts.mu[on_field].tolist()) == {0.2}
    assert contacts.mu[~on_field].tolist() == [0.3]


def test_the_margin_of_a_named_pair_reaches_beside_a_body() -> None:
    """A wall of a terrain beside a box is within the pair's margin."""
    heights = " ".join("1" if column >= 65 else "0" for column in range(100))
    field = f'<hfield name="t" elevation="{" ".join([heights] * 100)}" '
    box = BOX.format(z=0.051, size="0.2 0.2 0.05").replace("<geom ", '<geom name="box" ')
    named = NAMED.format("ground", 0.15, "")
    xml = terrain(100, box).replace("</worldbody>", "</worldbody>" + named)
    model = MujocoModel(Scene(name="test", xml=xml.replace('<hfield name="t" ', field)))
    contacts = model.assemble(H).contacts
    assert contacts.gap.max() <= 0.15
    # the wall begins at x = 0.3, the box ends at 0.213
    assert ((contacts.point[:, 0] > 0.22) & (np.abs(contacts.frame[:, 0, 0]) > 0.9)).sum() > 10


def test_limits_beside_interactions_are_refused() -> None:
    """The kinds of shapes were asked of limits, which have none."""
    shape = '<geom name="{}" type="{}" size="0.1 0.1 0.1" mass="1" user="0"/>'
    limited = "".join(
        (
            f'<body pos="0 0 {z}"><joint name="{name}" type="slide" axis="0 0 1" range="0 1"/>'
            f"{shape.format(name, 'sphere')}</body>"
        )
        for name, z in (("low", 0.2), ("high", 0.4))
    )
    xml = document(shape.format("ground", "box").replace(" mass", ' pos="0 0 0" mass') + limited)
    one = Interaction(kinds=(0, 0), mu=0.3, alert=0.05, law="IQS_CLB")
    scene = Scene(name="both", xml=xml, law="gap", interactions=(one,))
    with pytest.raises(UnsupportedSceneError, match="both: joint low has limits, for which no law"):
        MujocoModel(scene)
    ignoring = dataclasses.replace(scene, ignore=("limits",))
    (step,) = simulate(ignoring, 1)
    assert step.contacts.mu.tolist() == [0.3, 0.3]


def test_named_pairs_of_stones_count_once() -> None:
    """Equal stones, each turned a little, so that MuJoCo keeps four points of eight corners."""
    box = " ".join(f"{x} {y} {z}" for x in (-1, 1) for y in (-1, 1) for z in (-1, 1))
    asset = f'<asset><mesh name="stone" scale=".1 .1 .1" vertex="{box}"/></asset>'
    stones = (
        '<geom name="ground" type="mesh" mesh="stone" pos="0 0 -0.1"/>'
        '<body pos="0 0 0.1" euler="0 0 45"><freejoint/>'
        '<geom name="box" type="mesh" mesh="stone"/></body>'
        '<body pos="0 0 0.25"><freejoint/><geom name="ball" size="0.05" mass="1"/></body>'
    )
    plain, named = (
        MujocoModel(Scene(name="test", xml=document(stones, asset + rest))).assemble(H).contacts
        for rest in ("", NAMED.format("ground", 0, ON_TOP))
    )
    assert counted(plain) == counted(named) == {(0, 1): 8, (1, 2): 1}
    assert sorted(set(named.mu.tolist())) == [0.2, 0.3]


# ---- what a file asks too much

URDF = """<robot name="finger">
<link name="base"><inertial><mass value="1"/><inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0"
 iyz="0"/></inertial><collision><geometry><box size=".1 .02 .02"/></geometry></collision></link>
<link name="a"><inertial><mass value=".1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0"
 iyz="0"/></inertial><collision><geometry><box size=".01 .02 .05"/></geometry></collision></link>
<joint name="q" type="continuous"><parent link="base"/><child link="a"/><origin xyz="0 0 .08"/>
<axis xyz="0 1 0"/>{mimic}</joint></robot>"""


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    path = tmp_path / "finger.urdf"
    path.write_text(URDF.format(mimic='<mimic joint="unknown"/>'), encoding="utf-8")
    return path


def test_what_the_compiler_drops_is_said_and_strictly_refused(robot: Path) -> None:
    scene = Scene.from_file(robot)
    (step,) = simulate(scene, 1)
    assert any("<mimic> on joint 'q' ignored" in line for line in step.model.left_out)
    with pytest.raises(UnsupportedSceneError, match="mimic"):
        next(simulate(scene, 1, strict=True))


@pytest.mark.parametrize(
    ("attribute", "word"),
    [
        ('friction="nan"', "geom g: its friction is not finite"),
        ('friction="inf"', "geom g: its friction is not finite"),
        ('friction="1 nan 0"', "geom g: its friction is not finite"),
        ('margin="nan"', "geom g: its margin is not finite"),
        ('mass="inf"', "body 1: its mass is not finite"),
    ],
)
def test_data_that_are_not_finite_are_refused(attribute: str, word: str) -> None:
    ball = f'<body pos="0 0 0.1"><freejoint/><geom name="g" size="0.1" {attribute}/></body>'
    with pytest.raises(ValueError, match=f"test: {word}"):
        run(document(ball), 1)


@pytest.mark.parametrize(
    ("joint", "rest", "word"),
    [
        ('damping="1 nan 1"', "", "joint j: its dampingpoly"),
        ("", '<option viscosity="nan"/>', "option: its viscosity"),
        ("", '<option wind="nan 0 0"/>', "option: its wind"),
        ("", '<keyframe><key ctrl="nan"/></keyframe>', "keyframe 0: its ctrl"),
        ("", '<tendon><fixed frictionloss="nan">{}</fixed></tendon>', "tendon 0: its frictionloss"),
        ("", '<tendon><fixed limited="true" range="-1 nan">{}</fixed></tendon>', "tendon 0: its r"),
        ("", '<equality><joint joint1="j" polycoef="nan"/></equality>', "equality 0: its data"),
    ],
)
def test_no_number_that_is_not_finite_is_taken(joint: str, rest: str, word: str) -> None:
    """MuJoCo leaves some out, and the simulation went on without them."""
    arm = f'<body><joint name="j" {joint}/><geom size="0.1" mass="1" contype="0"/></body>'
    motor = '<actuator><motor joint="j"/></actuator>'
    more = rest.replace("{}", '<joint joint="j" coef="1"/>')
    xml = document(arm).replace("</mujoco>", f"{motor}{more}</mujoco>")
    with pytest.raises(ValueError, match=f"test: {word}.* not finite"):
        run(xml, 1)


def test_a_number_that_the_compiler_replaces_is_said() -> None:
    ball = '<body pos="0 0 0.1"><freejoint/><geom size="0.1" mass="nan"/></body>'
    (step,) = run(document(ball), 1)
    assert any("NaN" in line for line in step.model.left_out)


@pytest.mark.parametrize("bounds", ["", 'lower="1" upper="-1"', 'lower="1" upper="1"'])
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_limits_that_the_compiler_drops_are_said(kind: str, bounds: str, tmp_path: Path) -> None:
    moments = "ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'"
    inertial = f"<inertial><mass value='1'/><inertia {moments}/></inertial>"
    path = tmp_path / "arm.urdf"
    text = (
        f"<robot name='arm'><link name='base'/><link name='arm'>{inertial}</link>"
        f"<joint name='elbow' type='{kind}'><parent link='base'/><child link='arm'/>"
        f"<axis xyz='0 1 0'/><limit effort='1' velocity='1' {bounds}/></joint></robot>"
    )
    path.write_text(text)
    said = "limits of elbow (the lower is not below the upper: none is there)"
    (step,) = simulate(Scene.from_file(path), 1)
    assert said in step.model.left_out
    (step,) = simulate(Scene.from_file(path, ignore=("limits",)), 1)
    assert said not in step.model.left_out
    path.write_text(text.replace(bounds, "") if bounds else text)
    path.write_text(path.read_text().replace("effort", "lower='-1' upper='1' effort"))
    (step,) = simulate(Scene.from_file(path), 1)
    assert step.model.left_out == ()
    if bounds:
        upper = bounds.split('"')[-2]
        arm = f'<body><joint name="elbow" range="1 {upper}"/><geom size="0.1" mass="1"/></body>'
        (step,) = run(document(arm), 1)
        assert said in step.model.left_out


def test_a_robot_floats_above_a_ground(robot: Path) -> None:
    fixed = next(simulate(Scene.from_file(robot), 1)).model
    assert isinstance(fixed, MujocoModel)
    assert fixed.model.nv == 1
    assert "nothing can touch" not in fixed.untouchable  # the finger may touch the base
    steps = list(simulate(Scene.from_file(robot, floating=True, ground=0.25), 50))
    model = steps[0].model
    assert isinstance(model, MujocoModel)
    assert model.model.nv == 7
    # the plane is where the lowest shape is, and its friction counts
    assert steps[0].problem.nc
    np.testing.assert_allclose(steps[0].contacts.mu, 0.25)
    np.testing.assert_allclose(steps[0].contacts.gap, 0, atol=1e-12)
    assert abs(steps[-1].model.position[2]) < 1e-3


def test_a_floating_scene_is_stored_and_read_again(robot: Path) -> None:
    scene = Scene.from_file(robot, floating=True, ground=0.25)
    again = trajectory.scene_of(trajectory.record(scene))
    one, other = (next(simulate(s, 1)).problem for s in (scene, again))
    assert fclib.digest(one) == fclib.digest(other)


def test_meshes_are_found_beside_a_robot_that_floats(tmp_path: Path) -> None:
    (tmp_path / "part.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    path = tmp_path / "robot.urdf"
    text = URDF.format(mimic="").replace(
        '<box size=".1 .02 .02"/>', '<mesh filename="part.obj" scale=".1 .1 .1"/>'
    )
    path.write_text(text, encoding="utf-8")
    (step,) = simulate(Scene.from_file(path, floating=True, ground=0.5), 1)
    assert isinstance(step.model, MujocoModel)
    assert step.model.model.nmesh == 1
    assert step.problem.nc


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("<mujoco/>", "floating is for URDF files"),
        ("<robot", "is no XML"),
        ('<robot name="x"><link name="a"/><link name="b"/></robot>', "has 2 links"),
        (
            '<robot name="x"><link name="world"/><link name="b"/><joint name="j" type="fixed">'
            '<parent link="world"/><child link="b"/></joint></robot>',
            'its root is the link "world"',
        ),
    ],
)
def test_what_cannot_float_is_said(text: str, word: str, tmp_path: Path) -> None:
    path = tmp_path / "x.urdf"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=f"x.urdf: {word}"):
        Scene.from_file(path, floating=True)


def test_the_command_says_that_nothing_can_touch(tmp_path: Path) -> None:
    path = tmp_path / "finger.urdf"
    path.write_text(URDF.format(mimic="").replace("collision", "visual"), encoding="utf-8")
    result = command("simulate", path, "--steps", 2, "--out", tmp_path / "a", "--no-pictures")
    assert "Note: nothing can touch" in result.stderr
    assert "--floating, --ground" in result.stderr
    assert "Closed gaps: within 4 roundings" in result.stderr


def test_a_model_without_shapes_makes_problems(tmp_path: Path) -> None:
    path = tmp_path / "pendulum.xml"
    path.write_text(
        document(
            '<body pos="0 0 1"><joint name="j" axis="0 1 0" range="-10 10" frictionloss="0.1"/>'
            '<inertial pos=".2 0 0" mass="1" diaginertia=".01 .01 .01"/></body>'
        ),
        encoding="utf-8",
    )
    out = tmp_path / "out"
    command("simulate", path, "--steps", 60, "--out", out, "--no-pictures")
    files = sorted(out.rglob("*-global.hdf5"))
    assert len(files) == 60
    problem: Any = fclib.read(files[-1])
    assert problem.contacts.shape.max() == -1
    assert problem.contacts.body.min() >= 0


@pytest.mark.parametrize(
    ("name", "word"),
    [
        (
            "nothing:policy",
            "cannot be imported: no module 'nothing' is installed, nor is there a file .*nothing",
        ),
        ("needs:policy", "it imports 'nosuchthing', which is not installed, needs.py, line 1"),
        ("missing.py:policy", "there is no file .*missing.py"),
        ("policy", "is no MODULE:FUNCTION"),
    ],
)
def test_a_policy_that_cannot_be_imported_is_explained(
    name: str, word: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from fclib.simulate import control_of

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "needs.py").write_text("import nosuchthing\n", encoding="utf-8")
    with pytest.raises(ValueError, match=word):
        control_of(name)


def test_a_policy_by_its_file(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "mine.py").write_text("def zero(time, state):\n    return [0.0]\n")
    code = "from fclib.simulate import control_of; print(control_of('sub/mine.py:zero')(0, None))"
    done = ran(sys.executable, "-c", code, cwd=tmp_path)
    assert done.stdout.strip() == "[0.0]"


# ---- logged states

PUSHED = document(
    '<geom type="plane" size="1 1 0.1"/><body pos="0 0 0.1"><joint type="slide" axis="1 0 0"'
    ' name="j"/><joint type="slide" axis="0 0 1"/><geom type="box" size="0.1 0.1 0.1" mass="1"/>'
    '</body><body pos="1 0 0.1"><freejoint/><geom size="0.1" mass="1"/></body>',
    '<actuator><position joint="j" kp="100"/></actuator>',
)


@pytest.fixture
def log(tmp_path: Path) -> dict[str, Any]:
    """Ten states of a simulation of MuJoCo's own, and the scene in a file."""
    (tmp_path / "pushed.xml").write_text(PUSHED, encoding="utf-8")
    m = mujoco.MjModel.from_xml_string(PUSHED)
    d = mujoco.MjData(m)
    rows: dict[str, Any] = {"qpos": [], "qvel": [], "ctrl": []}
    for k in range(10):
        d.ctrl[:] = 0.01 * k
        mujoco.mj_step(m, d)
        for name, values in rows.items():
            values.append(getattr(d, name).copy())
    return {name: np.array(values) for name, values in rows.items()}


def as_csv(log: dict[str, Any]) -> str:
    names = [f"{name}{i}" for name, values in log.items() for i in range(values.shape[1])]
    table = np.hstack(list(log.values())).tolist()
    lines = [",".join(["note", *names])]
    lines += [",".join(["x", *map(repr, row)]) for row in table]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("kind", ["npz", "csv"])
def test_logged_states_become_problems(kind: str, log: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / f"log.{kind}"
    if kind == "npz":
        np.savez(path, time=np.arange(10), **log)
    else:
        path.write_text(as_csv(log), encoding="utf-8")
    out = tmp_path / "out"
    scene = tmp_path / "pushed.xml"
    command("simulate", scene, "--states", path, "--out", out, "--no-pictures")
    states = trajectory.read(out / "scenes" / "pushed" / trajectory.OWN)
    assert states.step.tolist() == list(range(10))
    both = np.hstack((log["qpos"], log["ctrl"]))
    np.testing.assert_allclose(states.position, both, rtol=0, atol=2.0**-30)
    np.testing.assert_allclose(states.velocity, log["qvel"], rtol=0, atol=2.0**-30)
    for file, place in zip(sorted(out.rglob("*-global.hdf5")), range(10), strict=True):
        assert fclib.digest(fclib.read(file)) == fclib.digest(states.problem(place).problem)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"qvel": None}, "has no qvel"),
        ({"qpos": np.zeros((10, 3))}, r"qpos has the shape \(10, 3\), and pushed needs \(10, 9\)"),
        ({"ctrl": np.zeros((9, 1))}, r"ctrl has the shape \(9, 1\)"),
        ({"qvel": np.full((10, 8), np.nan)}, "qvel, row 0: is not finite"),
    ],
)
def test_a_log_that_does_not_fit_is_said(
    change: dict[str, Any], word: str, log: dict[str, Any], tmp_path: Path
) -> None:
    log = {name: values for name, values in (log | change).items() if values is not None}
    np.savez(tmp_path / "log.npz", **log)
    model = MujocoModel(Scene(name="pushed", xml=PUSHED))
    with pytest.raises(ValueError, match=f"log.npz: {word}"):
        logged(tmp_path / "log.npz", model)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "has no qpos"),
        ("qpos0,qpos2\n1,2\n", r"its columns of qpos are \[0, 2\]"),
        ("qpos0,qvel0\n1,\n", "line 2: qvel is not a row of numbers"),
        ("qpos0,qvel0\n", "has no state"),
    ],
)
def test_a_table_that_is_no_log_is_said(text: str, word: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=f"log.csv: {word}"):
        logged(path, MujocoModel(Scene(name="pushed", xml=PUSHED)))
    (tmp_path / "log.npz").write_text("no", encoding="utf-8")
    with pytest.raises(ValueError, match=r"log.npz: is no \.npz file"):
        logged(tmp_path / "log.npz", MujocoModel(Scene(name="pushed", xml=PUSHED)))


# ---- states with the time and controls

DRIVEN = (
    Drive(dof=0, velocity=True, course=Course(amplitude=0.5, omega=20.0)),
    Drive(dof=2, velocity=False, course=Course(ramp=0.0, ramp_rate=50.0, constant=3.0)),
)


@pytest.fixture
def driven() -> Scene:
    """A driven box that is pushed by a servo too, and a ball under a force that grows."""
    return Scene(name="driven", xml=PUSHED, drives=DRIVEN)


def test_a_driven_state_holds_the_time_and_the_controls(driven: Scene) -> None:
    def control(time: float, state: Any) -> list[float]:
        return [0.2 + time]

    steps = list(simulate(driven, 6, control=control))
    m = mujoco_of(steps[0])
    assert len(steps[4].position) == m.nq + 1 + m.nu
    np.testing.assert_allclose(steps[4].position[m.nq :], [4 * H, 0.2 + 4 * H], rtol=1e-12)
    # a new model makes the same problem of the state alone
    model = MujocoModel(driven)
    scheme = module.scheme_of(model)
    for step in steps:
        part = module.problem_at(model, scheme, step.position, step.start.velocity)
        assert fclib.digest(part.problem) == fclib.digest(step.problem)
    # without controls the state has none
    (step,) = simulate(driven, 1)
    assert len(step.position) == m.nq + 1
    # and a simulation goes on from it
    again = list(simulate(driven, 3, control=control, start=steps[3].start))
    for one, other in zip(again, steps[3:], strict=True):
        assert fclib.digest(one.problem) == fclib.digest(other.problem)


@pytest.mark.parametrize("kind", ["npz", "csv"])
def test_a_log_of_a_driven_scene_has_the_time(
    kind: str, driven: Scene, log: dict[str, Any], tmp_path: Path
) -> None:
    path = tmp_path / f"log.{kind}"
    times = 0.1 + H * np.arange(10)

    def write(**more: Any) -> None:
        if kind == "npz":
            np.savez(path, **log, **more)
        else:
            path.write_text(as_csv(log | more).replace("time0", "time"), encoding="utf-8")

    model = MujocoModel(driven)
    write()
    word = "log.* has no time, on which the drives of driven depend"
    with pytest.raises(ValueError, match=word):
        logged(path, model)
    write(time=times if kind == "npz" else times[:, None])
    position, velocity = logged(path, model)
    both = np.hstack((log["qpos"], times[:, None], log["ctrl"]))
    np.testing.assert_array_equal(position, both)
    model.set_state(position[7], velocity[7])
    assert model.data.time == times[7]
    np.testing.assert_array_equal(model.data.ctrl, log["ctrl"][7])


def test_the_part_of_a_change_that_moves_bodies_is_the_least_that_does() -> None:
    rng = np.random.default_rng(0)
    # four directions are pushed, and a fifth one follows from them
    matrix = rng.normal(size=(5, 4)) @ rng.normal(size=(4, 30))
    H = sp.csc_array(matrix)
    change = rng.normal(size=30)
    part = _core.moving_part(H, 5, change)
    np.testing.assert_allclose(part, np.linalg.pinv(matrix) @ (matrix @ change), atol=1e-12)
    # what moves nothing is left, whatever its size
    still = change - part
    assert np.abs(_core.moving_part(H, 5, 1e6 * still)).max() < 1e-8
    assert not _core.moving_part(H, 5, np.zeros(30)).any()


def test_the_rounding_of_large_reactions_at_rest_is_removed() -> None:
    """Frames that turn from step to step leave an error in large reactions, which would push."""
    problem = next(simulate(arch(), 1)).problem
    solution = fclib.solve(problem, tol=1e-12).solution
    H = dense(problem.H)
    null = scipy.linalg.null_space(H)
    rng = np.random.default_rng(0)
    # a self-stress a million times the weight, each reaction off by 1e-9 of itself
    size = 1e6 * np.abs(solution.r).max()
    large = solution.r + size * null @ rng.uniform(-1, 1, null.shape[1])
    turned = large * (1 + 1e-9 * rng.standard_normal(len(large)))
    near = _core.nearest_at_rest(problem, solution, turned, STILL)
    assert near is not None
    pushed, left = (np.abs(H @ (r - solution.r)).max() for r in (turned, near))
    assert pushed > 1e-4 * np.abs(problem.f).max()
    # what is left is the rounding of the sums
    rounding = np.finfo(float).eps * (np.abs(H) @ np.abs(near)).max()
    assert left < 20 * rounding < 1e-4 * pushed
    # and it is the same self-stress
    assert np.abs(near - large).max() < 1e-7 * size
