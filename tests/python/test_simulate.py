"""The time stepper against mechanics: what has a closed form is compared with it."""

import dataclasses
import importlib
import math
import sys
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import fclib
from fclib import scenes
from fclib.scenes import Scene

# MuJoCo has no release for the oldest Python that fclib takes
mujoco = pytest.importorskip("mujoco")

from fclib.simulate import (  # noqa: E402
    MoreauJean,
    MujocoModel,
    NoRenderer,
    Step,
    UnsupportedSceneError,
    provenance,
    render,
    simulate,
)
from fclib.simulate.equalities import are_independent, dependence  # noqa: E402
from workshop.tables import loop_rounding  # noqa: E402

G = 9.81  # m/s^2
H = 5e-3  # s

FLOOR = '<geom name="floor" type="plane" size="0 0 1" friction="{mu}"/>'
SPHERE = '<body pos="0 0 {z}"><freejoint/><geom size="0.1" mass="2" friction="{mu}" {more}/></body>'
SLAB = (
    '<body pos="0 0 0.1"><freejoint/>'
    '<geom type="mesh" mesh="slab" mass="2" friction="{mu}" {more}/></body>'
)
CORNERS = "  ".join(f"{x} {y} {z}" for x in (-1, 1) for y in (-1, 1) for z in (-0.1, 0.1))

# two closed loops: in a plane, and in space; consistent in the positions of the model
PLANE_LOOP = """
<body name="a" pos="0 0 2"><joint name="ja" axis="0 1 0"/>
  <geom type="capsule" size="0.02" fromto="0 0 0 0 0 0.5" mass="1"/>
  <body name="b" pos="0 0 0.5"><joint axis="0 1 0"/>
    <geom type="capsule" size="0.02" fromto="0 0 0 1 0 0.2" mass="1"/></body></body>
<body name="c" pos="1 0 2"><joint name="jc" axis="0 1 0"/>
  <geom type="capsule" size="0.02" fromto="0 0 0 0 0 0.7" mass="1"/></body>
"""
PLANE_CONNECT = '<equality><connect body1="b" body2="c" anchor="1 0 0.2"/></equality>'
ARM_OF_SLIDES = """
<mujoco><worldbody><body><joint type="slide" axis="1 0 0"/><geom size="0.1"/>
<body><joint type="slide" axis="0 1 0"/><geom size="0.1"/></body></body></worldbody></mujoco>
"""
ARM = """
<body name="arm" pos="0 0 1"><joint name="shoulder" type="ball"/>
  <geom type="capsule" size="0.05" fromto="0 0 0 0.6 0 -0.3" mass="1"/>
  <body name="hand" pos="0.6 0 -0.3"><joint name="elbow" axis="0.2 1 0"/>
    <geom name="hand" type="capsule" size="0.05" fromto="0 0 0 0.3 0.1 -0.7" mass="0.5"/>
  </body></body>
<body name="free" pos="-0.5 0 0.15"><freejoint/>
  <geom type="box" size="0.3 0.2 0.16" euler="0 0 0.2" mass="3"/></body>
"""


def mjcf(
    bodies: str, *, floor: bool = True, gravity: str = f"0 0 {-G}", rest: str = "", **values: Any
) -> str:
    """An MJCF document; `values` fill the braces, mu = 0.5 and nothing more by default."""
    values = {"mu": 0.5, "more": "", "z": 1.0} | values
    return (
        f'<mujoco><compiler angle="radian"/><option gravity="{gravity}" timestep="{H}"/>'
        f'<asset><mesh name="slab" vertex="{CORNERS}"/></asset>'
        f"<worldbody>{FLOOR if floor else ''}{bodies}</worldbody>{rest}</mujoco>"
    ).format(**values)


def start(qpos: str, qvel: str) -> str:
    return f'<keyframe><key name="start" qpos="{qpos}" qvel="{qvel}"/></keyframe>'


SCENE = ("restitution", "law", "ignore", "all_bodies")  # options of `run`, beside those of simulate


# a step's arrays are optional in general, and all there in these tests: hence list[Any]
def run(xml: str, steps: int, **options: Any) -> list[Any]:
    scene_options = {k: options.pop(k) for k in SCENE if k in options}
    scene = Scene(name="test", xml=xml, **scene_options)
    return list(simulate(scene, steps, **{"tol": 1e-10, **options}))


def velocities(steps: list[Any]) -> Any:
    """The velocity (steps x n) at the end of each step."""
    return np.array([step.velocity for step in steps])


def energies(scene: Scene, steps: int, **options: Any) -> Iterator[float]:
    for step in simulate(scene, steps, **options):
        yield step.model.energy()


# ---- motion with a closed form


def test_free_fall() -> None:
    """With theta = 1, v_k = v_0 - k h g, z_k = z_0 + h sum of v_1 ... v_k."""
    steps = run(mjcf(SPHERE, rest=start("0 0 9 1 0 0 0", "1 0 2 0 0 3")), 50)
    k = np.arange(50)
    z = np.array([step.position[2] for step in steps])
    np.testing.assert_allclose(z, 9 + 2 * H * k - G * H**2 * k * (k + 1) / 2, rtol=0, atol=1e-12)
    expected = np.tile([1.0, 0, 2, 0, 0, 3], (50, 1))
    expected[:, 2] -= G * H * (k + 1)
    np.testing.assert_allclose(velocities(steps), expected, rtol=0, atol=1e-12)
    assert all(step.problem.nc == 0 for step in steps)
    np.testing.assert_allclose([step.time for step in steps], H * k)


SLIDER = (
    '<body name="ball" pos="0 0 {z}"><joint name="slide" type="slide" axis="0 0 1"/>'
    '<geom size="0.1" mass="1"/></body>'
)


@pytest.mark.parametrize("z", [0.5, 0.1])
@pytest.mark.parametrize(
    ("equalities", "named"),
    [
        (
            '<joint name="low" joint1="slide"/><joint name="high" joint1="slide"'
            ' polycoef="0.2 0 0 0 0"/>',
            "joint high, joint low contradict each other: .* off by 0.2 m",
        ),
        (
            '<joint joint1="slide"/><joint joint1="slide" polycoef="0.2 0 0 0 0"/>',
            "joint 0 of slide, joint 1 of slide contradict",
        ),
        (
            '<weld body1="ball" relpose="0 0 0.1 1 0 0 0"/>'
            '<joint name="up" joint1="slide" polycoef="0.3 0 0 0 0"/>',
            "joint up, weld 0 of ball and world contradict",
        ),
    ],
)
def test_equalities_that_contradict_each_other_are_named(
    z: float, equalities: str, named: str
) -> None:
    """In the air and on the floor; no number of a row is said."""
    xml = (
        f"<mujoco><worldbody>{FLOOR.format(mu=0.5)}{SLIDER.format(z=z)}</worldbody>"
        f"<equality>{equalities}</equality></mujoco>"
    )
    with pytest.raises(fclib.UnsuitableError, match=f"two, step 0: the equalities {named}"):
        list(simulate(Scene(name="two", xml=xml), 3))


def test_rows_of_equalities_that_are_rounding_are_left_out() -> None:
    """A loop in a plane, but for 1e-11: bearings keep what is out of it.

    Rows of such noise would ask for multipliers of 1e11 and more.
    """
    link = '<geom size="0.1" mass="1" pos="0.5 0 0"/>'
    xml = (
        '<mujoco><worldbody><body><joint axis="0 1 0"/>'
        f'{link}<body name="second" pos="1 0 0.5"><joint axis="0 1 1e-11"/>{link}</body></body>'
        '</worldbody><equality><connect body1="second" anchor="1 0 0"/></equality></mujoco>'
    )
    for step in simulate(Scene(name="loop", xml=xml), 3):
        G: Any = step.problem.G
        sizes = np.linalg.norm(G.toarray(), axis=0)
        assert sizes.min() > 1e-9 * sizes.max()
        assert step.result.converged


@pytest.mark.parametrize("angle", [0.0, 1e-8, 1e-6, 1e-3, 0.7])
@pytest.mark.parametrize("mass", [1.0, 1e-5])
def test_a_loop_in_an_inclined_plane(angle: float, mass: float) -> None:
    """A four-bar linkage: of the three rows of its last hinge two are independent."""

    def bar(length: float, weight: float) -> str:
        ends = f"0 0 0 {length} 0 0"
        return (
            '<joint axis="0 1 0"/>'
            f'<geom type="capsule" fromto="{ends}" size="0.02" mass="{weight}"/>'
        )

    xml = (
        f'<mujoco><compiler angle="radian"/><worldbody><body euler="0 0 {angle}" pos="0 0 1">'
        f'<body>{bar(0.5, 1)}<body pos="0.5 0 0" euler="0 1 0">{bar(0.7, mass)}'
        f'<body name="last" pos="0.7 0 0" euler="0 0.7 0">{bar(0.6, 1)}</body></body></body></body>'
        '</worldbody><equality><connect body1="last" anchor="0.6 0 0"/></equality></mujoco>'
    )
    for step in simulate(Scene(name="loop", xml=xml), 50):
        assert step.result.converged
        assert step.problem.p == (3 if angle else 2)  # the row out of the plane says 0 = 0
        assert np.abs(np.asarray(step.result.solution.l)).max() < 1


PLACES = [(1e-9, 0.0), (1e-9, 1.0), (1e-3, 0.0), (1e-3, 1e6), (1.0, 1e6), (1e3, 0.0), (1e3, 1e6)]


def linkage(size: float, away: float, off: float) -> Scene:
    """A four-bar linkage in an inclined plane; its last hinge is tied twice, to points off apart.

    A wheel turns with its first bar: of nanometres the other rows are 1e-9 of its row.
    """

    def bar(k: int, inside: str) -> str:
        place, length = (lengths[k - 1] if k else 0.0), lengths[k]
        return (
            f'<body pos="{place!r} 0 0" euler="0 {turns[k]} 0"><joint name="bar{k}" axis="0 1 0"/>'
            f'<inertial pos="{length / 2!r} 0 0" mass="{size**-2!r}" diaginertia=".1 .1 .1"/>'
            f"{inside}</body>"
        )

    # turned sites: MuJoCo puts others within 1e-6 m of their body there
    site = '<site name="{}" pos="{!r} 0 {!r}" quat="0.8 0.6 0 0"/>'
    turns, lengths = (0.3, 1.0, 0.7), (0.5 * size, 0.7 * size, 0.6 * size)
    inside, angle, x, z = site.format("end", lengths[2], 0.0), 0.0, 0.0, 0.0
    for k in (2, 1, 0):
        inside = bar(k, inside)
    for turn, length in zip(turns, lengths, strict=True):
        angle += turn
        x, z = x + length * math.cos(angle), z - length * math.sin(angle)
    xml = (
        f'<mujoco><compiler angle="radian"/><option gravity="0 0 {-9.81 * size!r}"/><worldbody>'
        f'<body pos="{away!r} {0.7 * away!r} 0" euler="0.2 0.1 0.7">{inside}'
        f"{site.format('first', x, z)}{site.format('second', x + off, z)}</body>"
        '<body><joint name="wheel" axis="0 0 1"/><inertial pos="0 0 0" mass="1"'
        ' diaginertia="1 1 1"/></body></worldbody><equality><joint joint1="wheel" joint2="bar0"/>'
        '<connect name="first" site1="end" site2="first"/>'
        '<connect name="second" site1="end" site2="second"/></equality></mujoco>'
    )
    return Scene(name="loop", xml=xml)


@pytest.mark.parametrize(("size", "away"), PLACES)
def test_a_redundant_loop_runs_at_every_size_and_place(size: float, away: float) -> None:
    for step in simulate(linkage(size, away, 0.0), 20):
        assert step.result.converged
        assert step.problem.p == 7
    assert 0.1 < np.abs(step.velocity).max() < 10


@pytest.mark.parametrize(("size", "away"), PLACES)
def test_a_contradiction_is_named_at_every_size_and_place(size: float, away: float) -> None:
    with pytest.raises(fclib.UnsuitableError, match="connect first, connect second contradict"):
        next(simulate(linkage(size, away, 1e-3 * size), 1))


@pytest.mark.parametrize(("size", "away"), [(1.0, 0.0), (1e-3, 1.0), (1.0, 1e6)])
def test_a_loop_that_moves_only_since_rows_depend_keeps_moving(size: float, away: float) -> None:
    """Bennett's linkage: each step opens it, where its rows are independent and would lock it."""
    xml = loop_rounding.document(loop_rounding.bennett(size), size, away, 0.7, 0.0)
    for step in simulate(Scene(name="loop", xml=xml), 150):
        assert step.result.converged
        assert np.abs(np.asarray(step.result.solution.l)).max() * size < 1
    assert np.abs(step.velocity).max() > 0.1


def test_independent_rows_are_told_without_their_factors() -> None:
    """By the singular values of their products: never where a row follows from others."""
    rng = np.random.default_rng(0)
    found = {True: 0, False: 0}
    for _ in range(400):
        n = int(rng.integers(3, 60))
        p = int(rng.integers(2, n + 1))
        columns = rng.standard_normal((n, p)) * (rng.random((n, p)) < 0.5)
        follows = columns[:, :-1] @ rng.standard_normal(p - 1)
        if rng.random() < 0.5:
            noise = rng.standard_normal(n) * np.linalg.norm(follows)
            columns[:, -1] = follows + 10 ** rng.uniform(-14, 0) * noise
        violation = rng.standard_normal(p) * 10 ** rng.uniform(-16, -2)
        rounding = np.full(p, 10 ** rng.uniform(-17, -8))
        G = sp.csc_array(columns)
        others = dependence(columns, violation, rounding)[1]
        told = are_independent(G, violation, rounding)
        found[told] += 1
        assert not (told and len(others))
    assert min(found.values()) > 50


def test_rows_that_are_small_beside_their_rounding_ask_for_no_large_multipliers() -> None:
    """Far from the origin a loop in a plane that is inclined by 1e-9: a row of 1e-9."""
    xml = linkage(1.0, 1e4, 0.0).xml.replace("0.2 0.1 0.7", "1e-9 0 1e-9")
    for step in simulate(Scene(name="loop", xml=xml), 20):
        assert step.result.converged
        assert np.abs(np.asarray(step.result.solution.l)).max() < 1


def test_box_at_rest_stays() -> None:
    steps = run(mjcf(SLAB), 100)
    assert {step.problem.nc for step in steps} == {4}
    assert np.abs(velocities(steps)).max() < 1e-8
    assert min(step.contacts.gap.min() for step in steps) > -1e-7
    # the floor carries the weight
    weight = steps[-1].result.solution.r.reshape(-1, 3)[:, 0].sum() / H
    np.testing.assert_allclose(weight, 2 * G, rtol=1e-7)


def test_sliding_box_stops_by_coulomb() -> None:
    mu, v0 = 0.3, 2.0
    steps = run(mjcf(SLAB, mu=mu, rest=start("0 0 0.1 1 0 0 0", f"{v0} 0 0 0 0 0")), 160)
    v = velocities(steps)[:, 0]
    k = np.arange(1, 161)
    np.testing.assert_allclose(v, np.maximum(v0 - mu * G * H * k, 0), atol=1e-6)
    # to the first order in h
    assert steps[-1].position[0] == pytest.approx(v0**2 / (2 * mu * G), abs=H * v0)


@pytest.mark.parametrize(("mu", "slides"), [(0.2, True), (0.6, False)])
def test_box_on_an_incline(mu: float, slides: bool) -> None:
    angle = 0.4
    gravity = f"{G * math.sin(angle)} 0 {-G * math.cos(angle)}"
    v = velocities(run(mjcf(SLAB, gravity=gravity, mu=mu), 50))[:, 0]
    along = G * (math.sin(angle) - mu * math.cos(angle)) if slides else 0.0
    np.testing.assert_allclose(v, along * H * np.arange(1, 51), atol=1e-6)


@pytest.mark.parametrize("e", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("body", [SPHERE, SLAB.replace("0 0 0.1", "0 0 {z}", 1)])
def test_rebound_is_newtons(e: float, body: str) -> None:
    steps = run(mjcf(body, z=0.4), 60, restitution=e)
    impact = next(step for step in steps if step.problem.nc)
    before = steps[impact.index - 1].result.solution.v[2]
    assert before < -0.5
    np.testing.assert_allclose(impact.result.solution.v[2], -e * before, atol=1e-9)


@pytest.mark.parametrize(("theta", "kept"), [(0.5, True), (1.0, False)])
def test_spring_keeps_its_energy_at_the_midpoint(theta: float, kept: bool) -> None:
    """A mass of 2 kg on a spring of 800 N/m, 20 rad/s."""
    spring = (
        '<body><joint type="slide" axis="1 0 0" stiffness="800"/><geom size="0.1" mass="2"/></body>'
    )
    scene = Scene(name="test", xml=mjcf(spring, floor=False, rest=start("0", "1")), theta=theta)
    speed, place = [], []
    for step in simulate(scene, 200):
        speed.append(float(step.start.velocity[0]))
        place.append(float(step.position[0]))
    energy = np.square(speed) + 400 * np.square(place)
    if kept:
        np.testing.assert_allclose(energy, energy[0], rtol=1e-12)
        # the midpoint rule turns by 2 atan(h omega / 2) a step
        angle = 2 * math.atan(0.5 * H * 20)
        np.testing.assert_allclose(speed, np.cos(angle * np.arange(200)), atol=1e-9)
    else:
        assert np.all(np.diff(energy) < 0)


def test_fast_body_is_caught_before_it_passes() -> None:
    """A contact is active where g + h/2 u_N <= 0: at 100 m/s, 0.25 m ahead."""
    steps = run(mjcf(SPHERE, rest=start("0 0 2.8 1 0 0 0", "0 0 -100 0 0 0")), 10)
    impact = next(step for step in steps if step.problem.nc)
    assert 0 < impact.contacts.gap[0] <= 0.5 * H * 101
    assert impact.result.solution.v[2] == pytest.approx(0.0, abs=1e-8)


def test_frictionless_contact_is_a_contact_with_mu_zero() -> None:
    xml = mjcf(SLAB, more='condim="1"', rest=start("0 0 0.1 1 0 0 0", "2 0 0 0 0 0"))
    steps = run(xml.replace('name="floor"', 'name="floor" condim="1"'), 20)
    assert steps[0].problem.nc == 4
    np.testing.assert_array_equal(steps[0].problem.mu, 0.0)
    np.testing.assert_allclose(velocities(steps)[:, 0], 2.0, atol=1e-8)


def test_friction_is_mujocos() -> None:
    """The larger coefficient of the two geometries, or that of an explicit pair."""
    xml = mjcf(SLAB, mu=0.3).replace('friction="0.3"', 'friction="0.8"', 1)
    np.testing.assert_array_equal(run(xml, 1)[0].problem.mu, 0.8)
    pair = '<contact><pair geom1="floor" geom2="box" condim="3" friction="0.1 0.1"/></contact>'
    xml = mjcf(SLAB, more='name="box"', rest=pair)
    np.testing.assert_array_equal(run(xml, 1)[0].problem.mu, 0.1)


def test_energy_does_not_grow() -> None:
    scene = scenes.get("BoxesStack")(boxes=4, gap=0.01).scene(seed=3)
    energy = np.array(list(energies(scene, 100, tol=1e-10)))
    assert np.diff(energy).max() < 1e-6 * energy[0]
    assert energy[-1] < energy[0]


# ---- laws


def test_gap_law_keeps_bodies_apart() -> None:
    steps = run(mjcf(SPHERE, z=0.4), 80, law="gap")
    gaps = [step.contacts.gap.min() for step in steps if step.problem.nc]
    assert min(gaps) > -1e-4
    assert steps[-1].position[2] == pytest.approx(0.1, abs=1e-4)


def test_gap_law_undoes_a_share_of_a_penetration() -> None:
    first = run(mjcf(SPHERE, z=0.09), 1, law="gap")[0]
    np.testing.assert_allclose(first.problem.w, [0.2 * -0.01 / H, 0, 0], rtol=1e-9)
    assert first.result.solution.v[2] == pytest.approx(0.2 * 0.01 / H, rel=1e-6)


def test_margins_are_the_reach_of_geometries() -> None:
    xml = (
        '<mujoco><worldbody><geom type="plane" size="1 1 1" margin="0.5"/>'
        '<body pos="0 0 1"><freejoint/><geom size="0.1" pos="1 0 0"/><geom size="0.2"/></body>'
        '<body/><body pos="0 0 3"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>'
    )
    model = MujocoModel(Scene(name="reach", xml=xml))
    v = np.array([3.0, 0, 4.0, 0, 0, 0, 0, 2.0, 0, 0, 0, 1.0])
    model.set_state(model.position, v)
    model.assemble(H)
    slack = model.model.geom_margin - H**2 * G
    # the plane keeps its own margin; a sphere that turns reaches further by its radius
    np.testing.assert_allclose(model.model.geom_margin[0], 0.5)
    np.testing.assert_allclose(slack[1:] / H, [5, 5, 2.1], rtol=1e-6)
    np.testing.assert_allclose(
        model.model.body_margin, [0.5, *model.model.geom_margin[[1]], 0, model.model.geom_margin[3]]
    )


def test_the_mass_matrix_has_no_zeros() -> None:
    model = MujocoModel(Scene(name="slides", xml=ARM_OF_SLIDES))
    M = model.assemble(H).M
    mass = 4e3 / 3 * math.pi * 0.1**3
    np.testing.assert_allclose(M.toarray(), np.diag([2 * mass, mass]))
    # slides at right angles have no inertia in common
    assert M.nnz == 2


def test_only_active_contacts_enter() -> None:
    boxes = SPHERE.replace("{z}", "0.1") + SPHERE.replace("{z}", "0.31")
    step = run(mjcf(boxes), 1)[0]
    assert step.problem.nc == 1
    np.testing.assert_array_equal(step.contacts.pair, [[0, 1]])
    # the gap law takes what is within reach, here both
    xml = mjcf(boxes, rest=start("0 0 0.1 1 0 0 0 0 0 0.31 1 0 0 0", "0 0 0 0 0 0 0 0 -4 0 0 0"))
    assert run(xml, 1, law="gap")[0].problem.nc == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"h": 0.0}, "time step"),
        ({"h": H, "restitution": 1.5}, "restitution"),
        ({"h": H, "stabilization": -1}, "stabilization"),
        ({"h": H, "theta": 0.4}, "theta must be in"),
        ({"h": H, "law": "force"}, '"velocity" or "gap"'),
        ({"h": H, "law": "gap", "restitution": 0.5}, "inelastic"),
    ],
)
def test_scheme_refuses_nonsense(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        MoreauJean(**options)


# ---- the terms of the problem


def moving_model(xml: str, seed: int = 0) -> MujocoModel:
    """A model with random velocities."""
    model = MujocoModel(Scene(name="test", xml=xml))
    v = np.random.Generator(np.random.PCG64(seed)).normal(size=model.velocity.size)
    model.integrate(1e-3, v)
    return model


def test_mass_matrix_is_mujocos() -> None:
    model = moving_model(mjcf(ARM))
    M = model.assemble(H).M.toarray()
    full = np.zeros(M.shape)
    mujoco.mj_fullM(model.model, model.data, full)
    np.testing.assert_allclose(M, full, rtol=0, atol=1e-14)
    assert np.abs(M - np.diag(np.diag(M))).max() > 1e-3


def test_forces_are_mujocos() -> None:
    """Springs, dampers, actuators, gyroscopic terms and pushes: v' = v + h a without contact."""
    bodies = ARM.replace('name="elbow"', 'name="elbow" stiffness="3" damping="0.4" armature="0.1"')
    rest = (
        '<tendon><fixed name="cord" stiffness="2" damping="0.3"><joint joint="elbow" coef="1"/>'
        '</fixed></tendon><actuator><position joint="elbow" kp="5" kv="0.2"/></actuator>'
    )
    model = moving_model(mjcf(bodies, floor=False, rest=rest))
    model.data.ctrl[:] = 0.7
    model.data.qfrc_applied[:] = np.arange(model.velocity.size)
    model.data.xfrc_applied[2] = [1, 2, 3, 4, 5, 6]
    system, v = model.assemble(H), model.velocity
    acceleration = np.linalg.solve(system.M.toarray(), system.force)
    mujoco.mj_forward(model.model, model.data)
    np.testing.assert_allclose(acceleration, model.data.qacc_smooth, rtol=1e-9, atol=1e-9)

    problem: Any = MoreauJean(h=H).problem(system, v).problem
    expected = system.M @ (v + H * acceleration) + H * system.C @ v
    np.testing.assert_allclose(problem.f, expected, rtol=1e-9, atol=1e-9)
    matrix = system.M + H * system.C + H**2 * system.K
    np.testing.assert_allclose(problem.M.toarray(), matrix.toarray(), atol=1e-14)


def test_springs_and_dampers_are_the_derivatives_of_the_force() -> None:
    bodies = ARM.replace('name="elbow"', 'name="elbow" stiffness="3" damping="0.4"')
    rest = '<actuator><position joint="elbow" kp="5" kv="0.2" gear="2"/></actuator>'
    model = moving_model(mjcf(bodies, floor=False, gravity="0 0 0", rest=rest))
    elbow = int(model.model.jnt_dofadr[1])
    system, v = model.assemble(H), model.velocity
    model.data.qvel[:] = 0  # no gyroscopic terms
    at_rest = model.assemble(H).force
    model.data.qvel[elbow] = step = 1e-6
    moving = model.assemble(H).force
    np.testing.assert_allclose((at_rest - moving)[elbow] / step, 0.4 + 0.2 * 2**2, rtol=1e-5)
    np.testing.assert_allclose(system.C.toarray()[elbow, elbow], 0.4 + 0.2 * 2**2)
    assert system.C.nnz == 1
    model.integrate(step, np.eye(v.size)[elbow])
    model.data.qvel[:] = 0
    np.testing.assert_allclose((at_rest - model.assemble(H).force)[elbow] / step, 23, rtol=1e-5)
    np.testing.assert_allclose(system.K.toarray()[elbow, elbow], 3 + 5 * 2**2)


@pytest.mark.parametrize("flag", ["spring", "damper", "actuation", "group"])
def test_what_the_scene_disables_is_not_there(flag: str) -> None:
    bodies = ARM.replace('name="elbow"', 'name="elbow" stiffness="3" damping="0.4"')
    rest = '<actuator><position joint="elbow" kp="5" kv="0.2" group="1"/></actuator>'
    option = f'><flag {flag}="disable"/></option>'
    if flag == "group":
        option = ' actuatorgroupdisable="1"/>'
    xml = mjcf(bodies, floor=False, rest=rest + f"<option{option}")
    system = moving_model(xml).assemble(H)
    damping = {"spring": 0.6, "damper": 0.2}.get(flag, 0.4)
    stiffness = {"spring": 5, "damper": 8}.get(flag, 3)
    np.testing.assert_allclose([system.C.sum(), system.K.sum()], [damping, stiffness])


def test_controls_of_delayed_actuators_act_at_once() -> None:
    rest = '<actuator><motor joint="elbow" delay="0.1" nsample="20"/></actuator>'
    model = moving_model(mjcf(ARM, floor=False, rest=rest))
    before = model.assemble(H).force
    model.data.ctrl[:] = 2
    np.testing.assert_allclose((model.assemble(H).force - before).sum(), 2, rtol=1e-9)


def test_stiff_damper_does_not_blow_up() -> None:
    """Damping worth 1e3 times the inertia in a step: an explicit scheme would diverge."""
    stiff = '<body><joint axis="0 0 1" damping="1e3"/><geom size="0.1" mass="1"/></body>'
    xml = mjcf(stiff, floor=False, rest=start("0", "2"))
    speeds = np.abs(velocities(run(xml, 20)))[:, 0]
    assert np.all(np.diff(speeds) <= 0)
    assert speeds[-1] < 1e-9


def test_contact_columns_give_the_velocity_of_contact_points() -> None:
    """H^T v is the rate of p2 - p1, two points fixed to the bodies, in the frame N, T1, T2."""
    model = moving_model(mjcf(ARM))
    system, v = model.assemble(H), model.velocity
    contacts = system.contacts
    assert len(set(map(tuple, contacts.pair.tolist()))) >= 2

    body = model.model.geom_bodyid[contacts.pair]

    def in_world(local: Any) -> Any:
        mujoco.mj_kinematics(model.model, model.data)
        turn = model.data.xmat.reshape(-1, 3, 3)[body]
        return model.data.xpos[body] + np.einsum("cbij,cbj->cbi", turn, local)

    mujoco.mj_kinematics(model.model, model.data)
    turn = model.data.xmat.reshape(-1, 3, 3)[body]
    arm = contacts.point[:, None, :] - model.data.xpos[body]
    local = np.einsum("cbji,cbj->cbi", turn, arm)

    step = 1e-6
    model.integrate(step, v)
    ahead = in_world(local)
    model.integrate(-2 * step, v)
    behind = in_world(local)
    rate = ((ahead - behind)[:, 1] - (ahead - behind)[:, 0]) / (2 * step)
    expected = np.einsum("cij,cj->ci", contacts.frame, rate).ravel()
    np.testing.assert_allclose(system.H.T @ v, expected, rtol=0, atol=1e-8)
    assert np.abs(expected).max() > 0.1
    # and N opens the gap
    np.testing.assert_allclose(np.linalg.det(contacts.frame), 1.0, rtol=1e-12)


def test_solution_satisfies_the_kinematics() -> None:
    for step in run(mjcf(ARM), 10, restitution=0.3):
        u = step.problem.H.T @ step.result.solution.v + step.problem.w
        np.testing.assert_allclose(step.result.solution.u, u, atol=1e-9)
        assert np.count_nonzero(step.problem.H.data) == step.problem.H.nnz


# ---- bilateral constraints


@pytest.mark.parametrize(
    ("bodies", "equality"),
    [
        (PLANE_LOOP, PLANE_CONNECT),
        (ARM, '<equality><connect body1="hand" body2="free" anchor="0.3 0.1 -0.7"/></equality>'),
        (ARM, '<equality><weld body1="hand" body2="free"/></equality>'),
        (PLANE_LOOP, '<equality><joint joint1="ja" joint2="jc" polycoef="0 2 1 0 0"/></equality>'),
    ],
)
def test_bilateral_columns_give_the_rate_of_the_violation(bodies: str, equality: str) -> None:
    model = moving_model(mjcf(bodies, floor=False, rest=equality))
    system, v = model.assemble(H), model.velocity
    step = 1e-6
    model.integrate(step, v)
    ahead = model.assemble(H).violation
    model.integrate(-2 * step, v)
    behind = model.assemble(H).violation
    np.testing.assert_allclose(system.G.T @ v, (ahead - behind) / (2 * step), atol=1e-6)
    assert np.abs(system.G.T @ v).max() > 1e-2


def test_closed_loop_moves_and_stays_closed() -> None:
    # the links that the loop joins overlap at its joint
    apart = '<contact><exclude body1="b" body2="c"/></contact>'
    xml = mjcf(PLANE_LOOP, floor=False, gravity=f"2 0 {-G}", rest=PLANE_CONNECT + apart)
    steps = run(xml, 200)
    assert not any(step.problem.nc for step in steps)
    first = steps[0].problem
    # three rows, of which the one out of the plane says nothing
    assert first.G.shape == (3, 2)
    np.testing.assert_allclose(first.b, 0.0, atol=1e-12)
    speed = 0.0
    for step in steps:
        v = step.result.solution.v
        np.testing.assert_allclose(step.problem.G.T @ v + step.problem.b, 0.0, atol=1e-6)
        # b = 0.2 violation / h; a step drifts by up to (h |v|)^2 / 2 [m]
        speed = max(speed, float(np.abs(v).max()))
        assert np.abs(step.problem.b).max() * H / 0.2 < 0.5 * (H * speed) ** 2 / 0.2 + 1e-6
    assert np.abs(velocities(steps)).max() > 0.5


def test_bilateral_constraint_with_contact() -> None:
    """Two balls on a common pivot slide on the floor: velocities obey it, impulses balance."""
    ball = '<body name="{0}" pos="{1} 0 0.1"><freejoint/><geom size="0.1" mass="1"/></body>'
    bodies = ball.format("left", 0) + ball.format("right", 0.5)
    pivot = '<equality><connect body1="left" body2="right" anchor="0.25 0 0.1"/></equality>'
    at = "0 0 0.1 1 0 0 0 0.5 0 0.1 1 0 0 0"
    steps = run(mjcf(bodies, rest=pivot + start(at, "0 1 0 0 0 0 0 1 0 0 0 0")), 20)
    assert steps[0].problem.nc == 2
    for step in steps:
        assert step.result.converged
        assert step.problem.G.shape == (12, 3)
        v, r = step.result.solution.v, step.result.solution.r
        np.testing.assert_allclose(step.problem.G.T @ v + step.problem.b, 0.0, atol=1e-6)
        impulse = step.problem.H @ r + step.problem.G @ step.result.solution.l + step.problem.f
        np.testing.assert_allclose(step.problem.M @ v, impulse, atol=1e-7)


# ---- controls that change with time

SERVO = (
    '<body pos="0 0 1"><joint name="slide" type="slide" axis="1 0 0"/>'
    '<geom type="sphere" size="0.1" mass="1" contype="0" conaffinity="0"/></body>'
    '<body pos="2 0 0.1"><freejoint/><geom type="sphere" size="0.1"/></body>'
)


def gait(*keys: tuple[float, float]) -> str:
    """A stiff servo, and keyframes of its control: time, place."""
    texts = [f'<key name="gait{i}" time="{t}" ctrl="{x}"/>' for i, (t, x) in enumerate(keys)]
    servo = '<position joint="slide" kp="1e8" kv="0"/>'
    return f"<actuator>{servo}</actuator><keyframe>{''.join(texts)}</keyframe>"


def test_controls_of_a_gait_follow_its_keyframes_and_come_back() -> None:
    steps = run(mjcf(SERVO, rest=gait((0, 0), (0.02, 0.4), (0.05, 0.1), (0.06, 0))), 25)
    times = np.array([step.time for step in steps])
    wanted = np.interp(times % 0.06, [0, 0.02, 0.05, 0.06], [0, 0.4, 0.1, 0])
    places = [step.position[0] for step in steps]
    np.testing.assert_allclose(places, wanted, atol=1e-3)
    np.testing.assert_allclose([step.position[-1] for step in steps], times, atol=1e-12)


def test_gait_goes_on_from_a_step_in_its_middle() -> None:
    scene = Scene(name="test", xml=mjcf(SERVO, rest=gait((0, 0), (0.02, 0.4), (0.06, 0))))
    whole = list(simulate(scene, 20))
    for one, other in zip(whole[13:], simulate(scene, 7, start=whole[13].start), strict=True):
        for a, b in zip(arrays(one), arrays(other), strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    ("keys", "reason"),
    [
        ([(0, 0)], "two or more"),
        ([(0.1, 0), (0.2, 0)], "from 0"),
        ([(0, 0), (0.2, 1), (0.1, 0)], "increasing"),
        ([(0, 0), (0.2, 1)], "'gait0' and 'gait1'"),
    ],
)
def test_gait_that_makes_no_cycle_is_refused(keys: Any, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        run(mjcf(SERVO, rest=gait(*keys)), 1)


# ---- the simulation


def arrays(step: Any) -> list[Any]:
    p = step.problem
    return [*(p.M.toarray(), p.H.toarray(), p.f, p.w, p.mu), step.result.solution.r, step.position]


def test_runs_are_equal_bit_for_bit() -> None:
    def steps() -> list[Step]:
        return list(simulate(scenes.get("BoxesStack")(boxes=3, gap=0.005).scene(seed=5), 20))

    for one, other in zip(steps(), steps(), strict=True):
        for a, b in zip(arrays(one), arrays(other), strict=True):
            np.testing.assert_array_equal(a, b)


def test_problem_is_regenerated_from_its_description() -> None:
    scene = scenes.get("BoxesStack")(boxes=2, gap=0.004, time_step=H).scene(seed=11)
    *_, last = simulate(scene, 12, tol=1e-9, warm_start=False, max_iterations=500)
    assert last.problem.nc
    assert "BoxesStack" in last.problem.info.description
    assert "Moreau-Jean" in last.problem.info.math_info
    assert "step 11" in last.problem.info.title

    origin = provenance(last.problem.info)
    assert origin["time"] == last.time
    assert origin["mujoco"] == mujoco.__version__
    again = scenes.get(origin["scene"])(**origin["parameters"]).scene(origin["seed"])
    *_, twin = simulate(
        again,
        origin["step"] + 1,
        solver=origin["solver"],
        tol=origin["tol"],
        warm_start=origin["warm_start"],
        stabilization=origin["stabilization"],
        **origin["options"],
    )
    for a, b in zip(arrays(last), arrays(twin), strict=True):
        np.testing.assert_array_equal(a, b)


def test_provenance_of_another_problem_is_an_error() -> None:
    with pytest.raises(ValueError, match="does not say"):
        provenance(fclib.ProblemInfo(title="mine", description="by hand"))


def test_missed_tolerance_is_seen_and_the_simulation_goes_on() -> None:
    scene = scenes.get("BoxesStack")(boxes=3, gap=0.0).scene(seed=0)
    steps = list(simulate(scene, 3, tol=1e-14, max_iterations=1))
    assert [step.index for step in steps] == [0, 1, 2]
    assert not steps[-1].result.converged
    assert str(steps[-1].result.status) != "converged"


def test_warm_start_saves_iterations() -> None:
    scene = scenes.get("BoxesStack")(boxes=3, gap=0.0, offset=0.1).scene(seed=0)
    counts = [
        sum(step.result.iterations for step in simulate(scene, 20, warm_start=warm))
        for warm in (True, False)
    ]
    assert counts[0] < counts[1]


def test_negative_number_of_steps() -> None:
    with pytest.raises(ValueError, match="steps"):
        simulate(Scene(name="test", xml=mjcf(SPHERE)), -1)


# ---- any MJCF


def test_scene_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "ball.xml"
    path.write_text(mjcf(SPHERE), encoding="utf-8")
    scene = Scene.from_file(path, restitution=0.5)
    steps = list(simulate(scene, 2))
    origin = provenance(steps[1].problem.info)
    assert origin["scene"] == "ball"
    assert origin["time_step"] == H  # the file's own
    assert origin["restitution"] == 0.5
    assert len(origin["parameters"]["sha256"]) == 64


LIMITED = ARM.replace('name="elbow"', 'name="elbow" limited="true" range="-1 1"')


@pytest.mark.parametrize(
    ("xml", "message"),
    [
        (mjcf(SPHERE, more='adhesion="1"'), "adhesion"),
        (mjcf(SPHERE, more='surfacevel="1 0 0 0 0 0"'), "surfacevel"),
        (
            mjcf(ARM, rest='<actuator><general joint="elbow" dyntype="user"/></actuator>'),
            "states of actuators",
        ),
        (mjcf(SPHERE, more='solref="0.01 1"'), "solref"),
        (mjcf(SPHERE, more='margin="0.1" gap="0.05"'), "margins"),
        (mjcf(ARM.replace('name="elbow"', 'name="elbow" range="-1 1" margin="0.1"')), "margins"),
        (
            mjcf(ARM, rest='<actuator><motor joint="elbow" delay="0.1" nsample="20"/></actuator>'),
            "delays",
        ),
        (
            mjcf(SPHERE, rest='<option o_friction="1 1 1 1 1"><flag override="enable"/></option>'),
            "override",
        ),
        (mjcf(ARM.replace('name="elbow"', 'name="elbow" stiffness="9" springyield="1"')), "yield"),
        (
            mjcf(ARM.replace('name="elbow"', 'name="elbow" frictionloss="1" solreffriction="2 1"')),
            "dry friction",
        ),
        (
            mjcf(
                SPHERE.replace("<geom ", '<geom name="ball" '),
                rest='<contact><pair geom1="floor" geom2="ball" solreffriction="2 1"/></contact>',
            ),
            "dry friction",
        ),
    ],
)
def test_what_is_left_out_is_said_and_strictly_refused(xml: str, message: str) -> None:
    with pytest.raises(UnsupportedSceneError, match=f"^test: not supported: .*{message}"):
        run(xml, 1, strict=True)
    (step,) = run(xml, 1)
    assert any(message in line for line in step.model.left_out)
    assert message in step.problem.info.description.splitlines()[-2]
    assert provenance(step.problem.info)["left_out"] == list(step.model.left_out)


def test_anisotropic_friction_is_named() -> None:
    pair = '<contact><pair geom1="floor" geom2="box" condim="3" friction="0.1 0.4"/></contact>'
    xml = mjcf(SLAB, more='name="box"', rest=pair)
    with pytest.raises(UnsupportedSceneError, match="anisotropic"):
        run(xml, 1, strict=True)
    np.testing.assert_allclose(run(xml, 1)[0].problem.mu, 0.2)


def test_what_is_left_out_on_demand_is_said() -> None:
    steps = run(mjcf(SPHERE, z=0.1, more='condim="4"'), 2, ignore=("torsion",))
    assert provenance(steps[0].problem.info)["ignore"] == ["torsion"]
    assert steps[0].problem.formulation == "G3DFC"
    with pytest.raises(ValueError, match="cannot ignore contacts; only activation, anisotropy"):
        run(mjcf(LIMITED), 2, ignore=("contacts",))


# ---- dry friction in joints and tendons: contacts of auxiliary degrees of freedom


Torque = Callable[[float], float]


def driven(loss: float, torque: Torque, *, v0: float = 0.0) -> list[Any]:
    """A flywheel of 2 kg m^2 with dry friction, by a motor whose torque follows the steps."""
    wheel = (
        f'<body><joint name="axle" frictionloss="{loss}"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="1 1 2"/></body>'
    )
    motor = '<actuator><motor joint="axle"/></actuator>'
    xml = mjcf(wheel, floor=False, rest=motor + start("0", str(v0)))
    return run(xml, 100, control=lambda t, state: [torque(t)])


@pytest.mark.parametrize(
    ("torque", "v0", "signs"),
    [
        (lambda t: 0.0, 0.5, {0, 1}),
        (lambda t: 2.5, 0.0, {0}),
        (lambda t: 4.0, 0.0, {1}),
        (lambda t: 4 * math.sin(20 * t), -0.5, {-1, 0, 1}),
    ],
    ids=["slips and stops", "sticks", "slips", "reverses"],
)
def test_dry_friction_in_a_joint_is_exact(torque: Torque, v0: float, signs: set[int]) -> None:
    """Each step: I v' = I v + h T - p, |p| <= h F, which stops the joint if it can."""
    inertia, loss, v = 2.0, 3.0, v0
    seen = set()
    for step in driven(loss, torque, v0=v0):
        problem = step.problem
        assert (problem.nc, problem.n) == (1, 2)
        free = v + H * torque(step.time) / inertia
        v = math.copysign(max(abs(free) - H * loss / inertia, 0), free)
        seen.add(float(np.sign(v)))
        np.testing.assert_allclose(step.velocity, [v], atol=1e-9)
        r = step.result.solution.r
        np.testing.assert_allclose(r[0], H * loss, rtol=1e-8)
        np.testing.assert_allclose(r[1], (v - free) * inertia, atol=1e-9)
        np.testing.assert_array_equal(step.contacts.pair[0], [-1 - 1, 0])
    assert seen == signs


def test_dry_friction_of_a_tendon_stops_what_it_pulls() -> None:
    slide = '<body name="{0}"><joint name="{0}" type="slide" axis="1 0 0"/><geom size="1"' + (
        ' contype="0" conaffinity="0" mass="{1}"/></body>'
    )
    tendon = (
        '<tendon><fixed frictionloss="6"><joint joint="a" coef="1"/><joint joint="b" coef="-2"/>'
        "</fixed></tendon>"
    )
    xml = mjcf(
        slide.format("a", 2) + slide.format("b", 1),
        floor=False,
        gravity="0 0 0",
        rest=tendon + start("0 0", "0.3 0"),
    )
    steps = run(xml, 40)
    mass, pull = np.array([2.0, 1.0]), np.array([1.0, -2.0])
    inverse = float(pull @ (pull / mass))
    v = np.array([0.3, 0.0])
    for step in steps:
        rate = float(pull @ v)
        impulse = math.copysign(min(H * 6, abs(rate) / inverse), rate)
        v = v - pull * impulse / mass
        np.testing.assert_allclose(step.velocity, v, atol=1e-9)
    assert abs(pull @ v) < 1e-9


def test_dry_friction_of_a_tendon_acts_along_it_at_each_angle() -> None:
    """A cord from (1, 0, 0) to the end of an arm at (cos a, 0, sin a) is 2 sin(a / 2) long."""
    arm = (
        '<body><joint axis="0 -1 0"/><site name="end" pos="1 0 0"/>'
        '<inertial pos="0.5 0 0" mass="1" diaginertia="0.1 0.1 0.1"/></body>'
    )
    cord = (
        '<tendon><spatial frictionloss="0.1"><site site="post"/><site site="end"/></spatial>'
        "</tendon>"
    )
    post = '<site name="post" pos="1 0 0"/>'
    xml = mjcf(post + arm, floor=False, gravity="0 0 0", rest=cord + start("1", "2"))
    for step in run(xml, 30):
        assert step.problem.H[0, 1] == pytest.approx(math.cos(step.position[0] / 2), rel=1e-12)


def test_dry_friction_holds_an_arm_beside_contacts_in_the_plane_and_in_space() -> None:
    """A box on the ground, and an arm with a limit whose friction exceeds its weight's moment."""
    arm = (
        '<body pos="0 0 1"><joint axis="0 1 0" frictionloss="{loss}" limited="true" range="-1 1"/>'
        '<geom type="capsule" size="0.02" fromto="0 0 0 0.5 0 0" mass="1"/></body>'
    )
    block = (
        '<body pos="2 0 0.1"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>'
        '<joint axis="0 1 0"/><geom type="box" size="0.2 0.1 0.1" mass="1" friction="0.5"/></body>'
    )
    held, falls = G * 0.25 * 1.01, G * 0.25 * 0.5
    for planar in (False, True):
        for loss, angle in ((held, 0.0), (falls, 1.0)):
            scene = Scene(name="test", xml=mjcf(arm.format(loss=loss) + block), planar=planar)
            *_, last = simulate(scene, 160, tol=1e-10)
            assert last.position[0] == pytest.approx(angle, abs=0.05)
            assert abs(last.velocity[0]) < 1e-9
            assert last.result.converged


# ---- actuators with a state, controls, keyframes


@pytest.mark.parametrize("dynamics", ["filter", "filterexact", "integrator"])
def test_states_of_actuators_follow_their_rates(dynamics: str) -> None:
    """As MuJoCo's own Euler step has them, whose forces are the same where nothing touches."""
    wheel = '<body><joint name="axle"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 2"/></body>'
    motor = (
        f'<actuator><general joint="axle" dyntype="{dynamics}" dynprm="0.05"'
        ' actlimited="true" actrange="-1 0.8"/></actuator>'
    )
    xml = mjcf(wheel, floor=False, rest=motor)
    m = mujoco.MjModel.from_xml_string(xml)
    d = mujoco.MjData(m)
    d.ctrl[:] = 1.5
    for step in run(xml, 150, control=lambda t, state: [1.5]):
        np.testing.assert_allclose(step.position[:2], [d.qpos[0], d.act[0]], atol=1e-12)
        mujoco.mj_step(m, d)
    assert d.act[0] == 0.8


def test_muscle_contracts() -> None:
    arm = '<body><joint name="j" axis="0 1 0"/><geom size="0.1" pos="0.3 0 0" mass="1"/></body>'
    muscle = '<actuator><muscle joint="j" lengthrange="-1 1" force="5"/></actuator>'
    xml = mjcf(arm, floor=False, gravity="0 0 0", rest=muscle)
    m = mujoco.MjModel.from_xml_string(xml)
    d = mujoco.MjData(m)
    d.ctrl[:] = 0.7
    for step in run(xml, 30, control=lambda t, state: [0.7]):
        np.testing.assert_allclose(step.position[1], d.act[0], atol=1e-6)
        mujoco.mj_step(m, d)
    assert 0.3 < d.act[0] < 0.8


def test_controls_and_the_states_they_act_on_are_regenerated() -> None:
    """A step is a function of its state, which has the controls; also from a stored one."""
    sent = []

    def policy(time: float, state: Any) -> Any:
        sent.append((time, state.index))
        return [3 * math.sin(20 * time) - state.velocity[0]]

    wheel = '<body><joint name="j"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 2"/></body>'
    rest = '<actuator><general joint="j" dyntype="filter" dynprm="0.02"/></actuator>'
    scene = Scene(name="test", xml=mjcf(wheel + SPHERE, z=0.1, rest=rest))
    steps = list(simulate(scene, 20, control=policy))
    assert sent == [(H * i, i) for i in range(20)]
    later = list(simulate(scene, 5, start=steps[15].start, control=policy))
    np.testing.assert_array_equal(later[-1].velocity, steps[19].velocity)
    model = MujocoModel(scene)
    scheme = fclib.simulate.scheme_of(model)
    for step in (steps[3], steps[12]):
        again = fclib.simulate.problem_at(
            model, scheme, step.start.position, step.start.velocity
        ).problem
        assert fclib.digest(again) == fclib.digest(step.problem)


@pytest.mark.parametrize(("given", "message"), [([1.0, 2.0], "1 controls"), ([math.nan], "finite")])
def test_wrong_controls_are_named(given: Any, message: str) -> None:
    wheel = '<body><joint name="j"/><geom size="0.1"/></body>'
    xml = mjcf(wheel, floor=False, rest='<actuator><motor joint="j"/></actuator>')
    with pytest.raises(ValueError, match=message):
        run(xml, 1, control=lambda t, state: given)
    with pytest.raises(ValueError, match="no actuators"):
        run(mjcf(SPHERE), 1, control=lambda t, state: given)


def test_keyframes_by_name_and_by_use() -> None:
    keys = (
        '<keyframe><key name="other" qpos="0 0 7 1 0 0 0"/><key name="home" qpos="0 0 5 1 0 0 0"/>'
        "</keyframe>"
    )
    scene = Scene(name="test", xml=mjcf(SPHERE, rest=keys))
    model = MujocoModel(scene)
    assert (model.keyframe, model.position[2]) == ("home", 5)
    named = MujocoModel(dataclasses.replace(scene, keyframe="other"))
    assert (named.keyframe, named.position[2]) == ("other", 7)
    with pytest.raises(ValueError, match="no keyframe 'stand'; it has: other, home"):
        MujocoModel(dataclasses.replace(scene, keyframe="stand"))


# ---- limits of joints and tendons: contacts without friction


def test_limit_of_a_planar_scene() -> None:
    """Twenty joints and one geometry: a limit's number is that of a joint."""
    links = "".join(
        f'<body pos="{i} 0 9"><joint axis="0 1 0" limited="true" range="-0.1 0.1"/>'
        '<inertial pos="0.2 0 0" mass="1" diaginertia="1 1 1"/></body>'
        for i in range(20)
    )
    scene = Scene(name="test", xml=mjcf(links), planar=True)
    *_, last = simulate(scene, 100)
    assert last.problem.nc == 20
    assert np.abs(last.velocity).max() < 1e-8


def test_what_no_joint_moves_is_no_contact() -> None:
    """A mocap body within another fixed one: rows without entries, and no problem of no bodies."""
    fixed = '<body mocap="true" pos="0 0 0.05"><geom size="0.1"/></body>'
    steps = run(mjcf(fixed), 2)
    assert [step.problem.nc for step in steps] == [0, 0]


def test_limit_stops_a_joint() -> None:
    bar = (
        '<body pos="0 0 1"><joint axis="0 1 0" limited="true" range="-0.5 0.3"/>'
        '<geom type="capsule" size="0.02" fromto="0 0 0 0.5 0 0" mass="1"/></body>'
    )
    steps = run(mjcf(bar, floor=False), 120)
    angles = np.array([step.position[0] for step in steps])
    # falls to the limit, at most a step beyond it, and stays
    assert 0.3 - 1e-9 < angles[-1] < 0.3 + 0.5 * H * 5
    assert np.ptp(angles[-20:]) < 1e-9
    last = steps[-1]
    assert last.problem.nc == 1
    np.testing.assert_array_equal(last.problem.mu, 0.0)
    assert last.problem.H.nnz == 1  # no tangents
    np.testing.assert_array_equal(last.contacts.pair[0], [-1 - 3, 0])
    # its impulse is the moment of the weight about the joint
    moment = G * 0.25 * math.cos(angles[-1]) * H
    np.testing.assert_allclose(last.result.solution.r, [moment, 0, 0], rtol=1e-6)


def test_limit_of_a_tendon() -> None:
    bars = (
        '<body pos="0 0 1"><joint name="a" type="slide" axis="1 0 0"/><geom size="0.1" mass="1"/>'
        '</body><body pos="0 0 2"><joint name="b" type="slide" axis="1 0 0"/>'
        '<geom size="0.1" mass="1"/></body>'
    )
    tendon = (
        '<tendon><fixed limited="true" range="-0.1 0.1"><joint joint="a" coef="1"/>'
        '<joint joint="b" coef="-1"/></fixed></tendon>'
    )
    steps = run(mjcf(bars, floor=False, gravity="0 0 0", rest=tendon + start("0 0", "2 0")), 40)
    # the first drags the second: momentum is kept, and shared
    np.testing.assert_allclose(velocities(steps)[-1], [1, 1], rtol=1e-9)


# ---- rolling friction


def test_rolling_resistance_stops_a_ball() -> None:
    """On a level floor, a ball that rolls slows down by mu_r g / R and the inertia it carries."""
    mu_r, radius, speed = 1e-3, 0.1, 1.0
    xml = mjcf(
        SPHERE,
        z=radius,
        more=f'condim="6" friction="0.5 0 {mu_r}"',
        rest=start(f"0 0 {radius - 1e-6} 1 0 0 0", f"{speed} 0 0 0 {speed / radius} 0"),
    ).replace('friction="0.5" condim', "condim")
    steps = run(xml, 100)
    assert {step.problem.formulation for step in steps} == {"GR3DFC"}
    assert steps[0].problem.spacedim == 5
    np.testing.assert_array_equal(steps[0].problem.mu_r, mu_r)
    v = velocities(steps)
    # m dv = F dt, I domega = (- M_r - F R) dt, v = omega R, M_r = mu_r m g, I = 2/5 m R^2
    slowing = mu_r * G / (1.4 * radius)
    np.testing.assert_allclose(v[:, 0], speed - slowing * H * np.arange(1, 101), atol=1e-5)
    np.testing.assert_allclose(v[:, 4], v[:, 0] / radius, atol=1e-4)


def test_spin_and_rolling_columns_are_the_relative_spin_about_the_frame() -> None:
    model = moving_model(mjcf(SPHERE, z=0.1, more='condim="6"'))
    system, v = model.assemble(H), model.velocity
    assert system.H.shape == (6, 6)
    mujoco.mj_kinematics(model.model, model.data)
    omega = model.data.xmat[1].reshape(3, 3) @ v[3:]
    np.testing.assert_allclose((system.H.T @ v)[3:], system.contacts.frame[0] @ omega)


# ---- what contacts do not move


def test_free_bodies_are_left_out_of_the_problem() -> None:
    bodies = SPHERE.replace("{z}", "0.0999") + SPHERE.replace('"0 0 {z}"', '"1 0 5"')
    steps = run(mjcf(bodies), 30)
    for step in steps:
        assert step.problem.nc == 1
        np.testing.assert_array_equal(step.dofs, np.arange(6))
        assert step.problem.M.shape == (6, 6)
        np.testing.assert_allclose(step.velocity[6:9], [0, 0, -G * H * (step.index + 1)])
        np.testing.assert_array_equal(step.velocity[:6], step.result.solution.v)


def test_problems_with_all_bodies_have_the_free_ones_too() -> None:
    bodies = SPHERE.replace("{z}", "0.0999") + SPHERE.replace('"0 0 {z}"', '"1 0 5"')
    some = run(mjcf(bodies), 5)
    every = run(mjcf(bodies), 5, all_bodies=True)
    for step, larger in zip(some, every, strict=True):
        np.testing.assert_array_equal(larger.dofs, np.arange(12))
        np.testing.assert_array_equal(larger.problem.H.toarray()[:6], step.problem.H.toarray())
        assert not larger.problem.H.toarray()[6:].any()
        np.testing.assert_allclose(larger.velocity, step.velocity, rtol=0, atol=1e-12)
        assert '"all_bodies": true' in larger.problem.info.description
        assert "all_bodies" not in step.problem.info.description


def test_free_bodies_keep_their_bilateral_constraints() -> None:
    ball = '<body name="{0}" pos="{1} 0 5"><freejoint/><geom size="0.1" mass="1"/></body>'
    bodies = SPHERE.replace("{z}", "0.0999") + ball.format("left", 1) + ball.format("right", 1.5)
    pivot = '<equality><connect body1="left" body2="right" anchor="0.25 0 0"/></equality>'
    at = "0 0 0.0999 1 0 0 0 1 0 5 1 0 0 0 1.5 0 5 1 0 0 0"
    steps = run(mjcf(bodies, rest=pivot + start(at, "0 0 0 0 0 0  0 1 0 0 0 0  0 0 0 0 0 0")), 5)
    for step in steps:
        assert step.problem.nc == 1
        assert step.problem.G is None
        assert step.problem.M.shape == (6, 6)
    model = steps[-1].model
    system = model.assemble(H)
    drift = np.abs(system.G.T @ steps[-1].velocity)
    assert drift.max() < 0.05  # of a speed of 1 m/s, turned by one step
    np.testing.assert_allclose(steps[-1].velocity[[7, 13]].sum(), 1.0, rtol=1e-9)


def test_bad_mjcf_is_one_line() -> None:
    with pytest.raises(ValueError, match=r"^test: MuJoCo refuses the MJCF: [^\n]*balloon[^\n]*$"):
        simulate(Scene(name="test", xml=mjcf("<balloon/>")), 1)


def test_full_memory_is_an_error() -> None:
    many = "".join(SLAB.replace("0 0 0.1", f"{3 * i} 0 0.1", 1) for i in range(20))
    xml = mjcf(many).replace("<asset>", '<size memory="24K"/><asset>', 1)
    with pytest.raises(MemoryError, match="memory"):
        run(xml, 1)


@pytest.mark.parametrize(
    ("module", "message"),
    [(types.SimpleNamespace(__version__="3.2.1"), "found 3.2.1"), (None, "cannot be imported")],
)
def test_another_mujoco_is_refused(
    monkeypatch: pytest.MonkeyPatch, module: Any, message: str
) -> None:
    pinned = importlib.import_module("fclib.simulate._mujoco")
    monkeypatch.setitem(sys.modules, "mujoco", module)
    with pytest.raises(ImportError, match=rf"{message}.*pip install 'fclib\[simulate\]'"):
        pinned.load()


# ---- pictures


def test_picture(tmp_path: Path) -> None:
    *_, step = simulate(scenes.get("BoxesStack")(boxes=2, gap=0.0).scene(), 2)
    pictures = {}
    try:
        for name, source in (("forces", step), ("bodies", step.model)):
            render(source, tmp_path / f"{name}.png", size=(120, 160))
            pictures[name] = (tmp_path / f"{name}.png").read_bytes()
    except NoRenderer as reason:
        pytest.skip(str(reason))
    for content in pictures.values():
        assert content[:8] == b"\x89PNG\r\n\x1a\n"
        assert int.from_bytes(content[16:20], "big") == 120
        assert int.from_bytes(content[20:24], "big") == 160
    assert pictures["forces"] != pictures["bodies"]


def test_arrows_of_a_crowd_do_not_hide_each_other() -> None:
    module: Any = importlib.import_module("fclib.simulate.render")
    mujoco = module.mujoco
    x, y = np.meshgrid(np.arange(4) * 0.1, np.arange(3) * 0.1)
    grid = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    # a contact of two points in one place has no distance of its own
    assert module.spacing(np.concatenate([grid, grid[:2]])) == pytest.approx(0.1)
    assert module.spacing(grid[:1]) == math.inf
    sizes = {}
    for name, points in (("crowd", grid), ("alone", grid[:1])):
        scene = mujoco.MjvScene(mujoco.MjModel.from_xml_string("<mujoco/>"), maxgeom=100)
        module.draw_arrows(scene, points, np.tile([0.0, 0.0, 2.0], (len(points), 1)), 1.0)
        assert scene.ngeom == len(points)
        sizes[name] = np.array(scene.geoms[0].size)
    assert sizes["crowd"][0] < 0.1 / 2 < sizes["alone"][0] * 2
    assert sizes["crowd"][2] < sizes["alone"][2]


def test_no_renderer_says_so_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = importlib.import_module("fclib.simulate.render")
    module.backend.cache_clear()
    failed = types.SimpleNamespace(returncode=1)
    monkeypatch.setattr(module.subprocess, "run", lambda *args, **kwargs: failed)
    with pytest.raises(NoRenderer, match=r"^no picture: [^\n]*install libosmesa6$"):
        render(MujocoModel(Scene(name="test", xml=mjcf(SPHERE))), tmp_path / "none.png")
    module.backend.cache_clear()


# ---- the plane

IN_PLANE = (
    '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint axis="0 1 0"/>'
)
BAR = (
    '<body name="bar" pos="0 0 0.1">' + IN_PLANE + '<geom type="mesh" mesh="slab" mass="2"'
    ' friction="{mu}" {more}/></body>'
)
BALL = (
    '<body pos="{x} 0 0.1">' + IN_PLANE + '<geom size="0.1" mass="2" friction="{mu} 0 {mu_r}"'
    " {more}/></body>"
)


def planar(xml: str, steps: int, **options: Any) -> list[Any]:
    scene = Scene(name="test", xml=xml, planar=True, restitution=options.pop("restitution", 0.0))
    return list(simulate(scene, steps, **{"tol": 1e-10, **options}))


def test_bar_slides_in_the_plane_as_in_space() -> None:
    mu, v0 = 0.3, 2.0
    steps = planar(mjcf(BAR, mu=mu, rest=start("0 0 0", f"{v0} 0 0")), 160)
    first = steps[0].problem
    # an edge of the slab touches in two points of the plane, not in four of space
    assert (first.spacedim, first.n, first.nc) == (2, 3, 2)
    assert first.M.nnz == 3
    k = np.arange(1, 161)
    np.testing.assert_allclose(
        velocities(steps)[:, 0], np.maximum(v0 - mu * G * H * k, 0), atol=1e-6
    )
    weight = steps[-1].result.solution.r.reshape(-1, 2)[:, 0].sum() / H
    np.testing.assert_allclose(weight, 2 * G, rtol=1e-7)


def test_planar_columns_are_those_of_space() -> None:
    """H^T v is what the contact in space has along N and T; the third direction is at rest."""
    xml = mjcf(BAR + BAR.replace("0 0 0.1", "0.3 0 0.3").replace("bar", "other"), mu=0.4)
    steps = [run(xml, 1)[0], planar(xml, 1)[0]]
    models = [step.model for step in steps]
    v = np.random.Generator(np.random.PCG64(1)).normal(size=6)
    space, plane = (model.assemble(H, shared_speed=True) for model in models)
    u = (space.H.T @ v).reshape(-1, 3)
    world = np.einsum("cij,ci->cj", space.contacts.frame, u)
    np.testing.assert_allclose(world[:, 1], 0, atol=1e-12)
    flat = (plane.H.T @ v).reshape(-1, 2)
    assert 2 * len(flat) == len(u) == 8
    np.testing.assert_allclose(np.linalg.det(plane.contacts.frame), 1, rtol=1e-12)
    np.testing.assert_array_equal(plane.contacts.frame[:, 2], np.tile([0, 1.0, 0], (4, 1)))
    for contact, velocity in zip(plane.contacts.point, flat, strict=True):
        # both ends of the line across the plane
        near = np.linalg.norm(space.contacts.point[:, [0, 2]] - contact[[0, 2]], axis=1) < 1e-9
        same = near & np.isclose(u[:, 0], velocity[0], atol=1e-12)
        assert same.sum() == 2
        frame = plane.contacts.frame[np.flatnonzero(plane.contacts.point[:, 0] == contact[0])[0]]
        np.testing.assert_allclose(world[same] @ frame[1], velocity[1], atol=1e-12)


def test_rolling_resistance_in_the_plane_stops_a_ball() -> None:
    """The speed falls by g mu_r / R / (1 + I / m R^2) a second; I = 2/5 m R^2."""
    R, mu_r, v0 = 0.1, 0.01, 1.0
    rolls: dict[str, Any] = {"mu": 0.5, "mu_r": mu_r, "x": 0, "more": 'condim="6"'}
    floor = FLOOR.replace("/>", ' condim="6"/>')
    xml = mjcf(floor + BALL, floor=False, rest=start("0 0 0", f"{v0} 0 {v0 / R}"), **rolls)
    steps = planar(xml, 100)
    problem = steps[0].problem
    assert (problem.spacedim, problem.n, problem.nc) == (3, 3, 1)
    assert problem.formulation == "GR2DFC" or problem.kind == "global_rolling"
    v = velocities(steps)
    slowing = G * mu_r / R / 1.4
    expected = np.maximum(v0 - slowing * H * np.arange(1, 101), 0)
    np.testing.assert_allclose(v[:, 0], expected, atol=1e-7)
    np.testing.assert_allclose(R * v[:, 2], expected, atol=1e-7)


def test_warm_start_in_the_plane_knows_the_reactions() -> None:
    steps = planar(mjcf(BAR), 3)
    second = steps[1]
    again = fclib.solve(second.problem, "nsgs", tol=1e-8, guess=steps[0].result.solution)
    assert again.iterations <= 1
    np.testing.assert_allclose(
        steps[0].contacts.forces(steps[0].result.solution.r).sum(axis=0),
        [0, 0, 2 * G * H],
        atol=1e-8,
    )


@pytest.mark.parametrize(
    ("bodies", "message"),
    [
        (SPHERE, "joint 0 .* leaves the plane"),
        (BALL.replace("1 0 0", "1 1 0"), "joint 0 .* leaves the plane"),
        (
            BALL.replace("<geom ", '<geom pos="0 0.02 0" ')
            + BALL.replace("{x} 0 0.1", "0.01 0 0.26"),
            "out of the plane",
        ),
    ],
)
def test_planar_scene_refuses_what_leaves_the_plane(bodies: str, message: str) -> None:
    with pytest.raises(UnsupportedSceneError, match=message):
        planar(mjcf(bodies, x=0, mu_r=0), 1)
