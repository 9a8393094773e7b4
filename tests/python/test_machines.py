"""Gears, a hand, a rover, a net of rings and a shear box: each does what statics say of it."""

import math
from typing import Any

import numpy as np
import pytest

from fclib import collections, scenes
from fclib.collections import published

# MuJoCo has no release for the oldest Python that fclib takes
pytest.importorskip("mujoco")

from fclib.simulate import MujocoModel, Step, simulate
from helpers_simulate import force_on, mujoco_of

DEEPEST = 0.02  # penetration, of the smallest body's diameter


def depth(step: Step) -> float:
    """The largest penetration, of the diameter of the smallest body."""
    size: Any = step.model.smallest_size
    return float(np.max(-step.contacts.gap, initial=0.0) / (2 * size))


# ---- all of them

SMALL: dict[str, tuple[dict[str, Any], int]] = {
    "GearTrain": ({"gears": 3}, 200),
    "ChainMail": ({"across": 4}, 300),
    "ShearBox": ({"across": 8, "layers": 5}, 400),
    "Rover": ({"stones": 16, "across": 4, "time_step": 1e-3}, 500),
    "Hand": ({}, 400),
}


@pytest.mark.parametrize("name", SMALL)
def test_nothing_sinks_into_another_body(name: str) -> None:
    smaller, count = SMALL[name]
    touched = 0
    for step in simulate(scenes.get(name)(**smaller).scene(seed=0), count, tol=1e-8):
        assert step.result.converged
        assert depth(step) < DEEPEST
        touched += step.problem.nc > 0
    assert touched > 0.3 * count


@pytest.mark.parametrize("name", SMALL)
def test_stored_states_have_contacts_and_no_deep_ones(name: str) -> None:
    folder = f"machines/{name}"
    for version in published.versions(folder):
        path = published.path_of(folder, version)
        assert path is not None
        states = collections.read_trajectory(path)
        size: Any = states.model.smallest_size
        for place in range(0, len(states), 3):
            step: Any = states.problem(place)
            assert step.problem.nc
            assert -step.contacts.gap.min() < DEEPEST * 2 * size
        # the plan takes those that are stored, and no others
        plan = collections.plan_of(folder, version=version)
        assert plan.numbers().tolist() == states.number.tolist()
        assert collections.plan_of(folder, version=version, count=2).numbers().tolist() == [
            states.number[0],
            states.number[-1],
        ]


# ---- gears


def turning(mu: float) -> tuple[Any, Any, Any]:
    """A pair of gears under a constant torque: the family, mean speeds, and the brake's torque.

    After some times the inertia over the brake, over the last 200 steps.
    """
    family: Any = scenes.get("GearTrain")(gears=2, mu=mu, period=1e3, gravity=0.0)
    steps = list(simulate(family.scene(seed=1), 700, tol=1e-9))
    speeds = np.mean([step.velocity[[2, 5]] for step in steps[-200:]], axis=0)
    return family, speeds, family.brake * speeds[1]


def test_gears_turn_and_pull_as_their_teeth_say() -> None:
    """omega_1 z_1 = -omega_0 z_0; without friction the torques are as z_1 / z_0."""
    family, speeds, braked = turning(mu=0.0)
    ratio = family.others / family.teeth
    assert speeds[0] / speeds[1] == pytest.approx(-ratio, rel=0.01)
    assert abs(braked) == pytest.approx(ratio * family.torque, rel=0.02)


def test_friction_of_teeth_and_pins_takes_a_part_of_the_torque() -> None:
    family, speeds, braked = turning(mu=0.2)
    ratio = family.others / family.teeth
    assert speeds[0] / speeds[1] == pytest.approx(-ratio, rel=0.01)
    assert 0.7 < abs(braked) / (ratio * family.torque) < 0.98


def test_gears_touch_in_more_points_than_they_need() -> None:
    *_, last = simulate(scenes.get("GearTrain")().scene(seed=0), 100, tol=1e-8)
    assert last.problem.n == 15
    assert last.problem.nc > 15


# ---- net of rings


def test_net_hands_its_weight_to_its_edge() -> None:
    """Action and reaction: what the fast rings give is the weight, and what it accelerates by."""
    family: Any = scenes.get("ChainMail")(across=3, drop=1e-3)
    carried = []
    for step in simulate(family.scene(seed=0), 500, tol=1e-9):
        if step.index < 250:
            continue
        model = mujoco_of(step)
        r = np.reshape(step.result.solution.r, (-1, 3))
        up = np.einsum("ci,ci->c", r, step.contacts.frame[:, :, 2])
        fast = model.body_weldid[model.geom_bodyid[step.contacts.pair]] == 0
        # a contact's normal goes from the first to the second
        given = up @ (fast[:, 0].astype(float) - fast[:, 1])
        moves = model.body_weldid[1:] > 0
        masses = model.body_mass[1:][moves]
        upwards = 6 * np.arange(len(masses)) + 2
        gained = masses @ (step.velocity - step.start.velocity)[upwards]
        weight = masses.sum() * family.gravity * family.time_step
        assert given == pytest.approx(weight + gained, abs=1e-4 * weight)
        carried.append(given / weight)
    # it swings, and does not fall
    assert np.mean(carried) == pytest.approx(1.0, abs=0.2)
    assert -0.2 * family.spacing * family.across < step.position[-5] < 1.5 * family.ball


# ---- shear box


def macroscopic_friction(load: float, mu: float) -> float:
    """Force that drives the box over that on its lid, in the middle of the first stroke.

    Of two fillings: with this many discs one alone differs by a fifth from the next.
    """
    family: Any = scenes.get("ShearBox")(
        across=12, layers=6, load=load, mu=mu, stroke=0.02, time_step=1e-3
    )
    begin = family.settle * 1.1
    pairs = []
    steps = round((begin + family.stroke / family.speed) / family.time_step)
    for seed in (1, 2):
        for step in simulate(family.scene(seed=seed), steps, tol=1e-5):
            if step.time > begin + 0.25 * family.stroke / family.speed:
                lid, box = force_on(step, "lid"), force_on(step, "box")
                pairs.append((-(lid + box)[0], lid[2]))
    drive, press = np.mean(pairs, axis=0)
    return float(drive / press)


@pytest.mark.long
def test_shear_strength_does_not_depend_on_the_load_and_does_on_friction() -> None:
    """Rigid grains have no scale of stress: the force grows as the load does (Coulomb 1776)."""
    light, heavy = macroscopic_friction(50, 0.5), macroscopic_friction(200, 0.5)
    assert 0.2 < light < 1.2
    assert heavy == pytest.approx(light, rel=0.3)
    assert macroscopic_friction(50, 0.0) < 0.8 * light


# ---- rover


def pressed_by_ground(step: Step) -> Any:
    """(3) force [N] of the ground, and (3) its moment [N m] about the centre of mass."""
    assert isinstance(step.model, MujocoModel)
    model, data = step.model.model, step.model.data
    first, second = model.geom_bodyid[step.contacts.pair].T
    sign = (first == 0).astype(float) - (second == 0)
    forces = sign[:, None] * step.contacts.forces(step.result.solution.r) / model.opt.timestep
    arms = step.contacts.point - data.subtree_com[0]
    return forces.sum(axis=0), np.cross(arms, forces).sum(axis=0)


def test_rover_at_rest_stands_on_six_wheels_by_the_lever_rule() -> None:
    """On even ground each bogie halves its part of the load, and the hinges halve again.

    A wheel touches along a line, so that its force may be anywhere on it. Then statics give no
    share of each side, but the sums of forces and moments, and the shares of front and back.
    """
    family: Any = scenes.get("Rover")(stones=0, torque=0.0)
    loads, sums = [], []
    for step in simulate(family.scene(seed=0), 400, tol=1e-10):
        if step.index >= 300:
            loads.append(
                [[force_on(step, f"{side}{k}")[2] for k in range(3)] for side in ("left", "right")]
            )
            sums.append(pressed_by_ground(step))
    model = mujoco_of(step)
    weight = model.body_mass.sum() * family.gravity
    front, middle, back = np.mean(loads, axis=0).mean(axis=0)
    force, moment = np.mean(sums, axis=0)
    np.testing.assert_allclose(force, [0, 0, weight], atol=1e-6 * weight)
    np.testing.assert_allclose(moment, 0, atol=1e-6 * weight * family.wheel)
    assert 2 * (front + middle + back) == pytest.approx(weight, rel=1e-3)
    # of a side: about the rocker's pivot the front wheel has twice the lever arm of the bogie,
    # and there are wheels and bars themselves
    m, side = family.mass, 0.5 * family.hull + 5 * family.mass
    wanted = (m + m / 8 + 0.5 * (side - 3 * m)) / 1.5 * family.gravity
    assert middle == pytest.approx(back, rel=0.01)
    assert front == pytest.approx(wanted, rel=0.01)


def test_rover_drives_as_fast_as_its_wheels_turn() -> None:
    family: Any = scenes.get("Rover")(stones=0)
    *_, last = simulate(family.scene(seed=0), 700, tol=1e-8)
    assert last.velocity[0] == pytest.approx(family.speed * family.wheel, rel=0.1)
    # a rover on ice does not
    *_, ice = simulate(scenes.get("Rover")(stones=0, mu=0.0).scene(seed=0), 200, tol=1e-8)
    assert abs(ice.velocity[0]) < 1e-3


# ---- hand


def held(squeeze: float) -> tuple[Any, Step]:
    """A hand and its object where it is highest."""
    family: Any = scenes.get("Hand")(squeeze=squeeze)
    *_, step = simulate(family.scene(seed=1), round(0.645 * family.period / family.time_step))
    assert step.result.converged
    return family, step


def test_hand_lifts_its_object_by_the_friction_of_its_tips() -> None:
    family, step = held(1.5)
    assert step.position[2] == pytest.approx(0.5 * family.height + family.lift, abs=1e-2)
    # in the tips it slides where the lift begins alone
    u: Any = step.result.solution.u
    assert np.hypot(*np.reshape(u, (-1, 3))[:, 1:].T).max() < 1e-3
    force = force_on(step, "object")
    weight = family.mass * family.gravity
    assert mujoco_of(step).body("object").mass[0] == pytest.approx(family.mass, rel=1e-6)
    np.testing.assert_allclose(force, [0, 0, weight], atol=0.02 * weight)
    # all fingers press on it; what they give it comes from the palm
    tips = [force_on(step, f"lower{k}") for k in range(family.fingers)]
    np.testing.assert_allclose(np.sum(tips, axis=0), -force, atol=1e-6 * weight)
    for k, tip in enumerate(tips):
        out = 2 * math.pi * k / family.fingers
        assert tip @ [math.cos(out), math.sin(out), 0] > 0.3 * family.force


def test_hand_that_presses_too_little_leaves_its_object() -> None:
    family, step = held(0.8)
    assert step.position[2] < 0.5 * family.height + 0.2 * family.lift
