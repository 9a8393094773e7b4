"""The low wall after LMGC90's deck: its problems by NumPy, its balances, how it slides."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

from fclib import scenes
from fclib.collections import published, trajectory
from helpers_elastic import bodies_of, masses

pytest.importorskip("mujoco")

from fclib.simulate import simulate

H, THETA = 1e-3, 0.5  # of the deck
FAST = {"speed": 0.02}  # so that it slides within 15 ms of the plate's start


def family(**changes: Any) -> Any:
    """A wall of two courses, two blocks long."""
    kind: Any = scenes.get("ElasticLowWall")
    return kind(**{**kind.small, **changes})


def states_of(own: Any, steps: int) -> list[Any]:
    """The steps of a wall, each with its reactions (nc x 3) and its velocity before."""
    found = []
    before = None
    for step in simulate(own.scene(0), steps, tol=1e-11):
        assert step.result.converged
        r = np.reshape(step.result.solution.r, (-1, 3))
        before = np.zeros_like(step.velocity) if before is None else before
        found.append((step, r, before))
        before = step.velocity
    return found


@functools.cache
def fast() -> list[Any]:
    """60 steps of a wall that begins to slide after 25 to 40 of them."""
    return states_of(family(**FAST), 60)


def weight(own: Any, time: float) -> float:
    """Of the plate [N]: it grows evenly while the plate stands still."""
    length, depth = own.length * own.block + 2 * own.margin, own.depth + 2 * own.margin
    return float(148146.0 * length * depth * own.plate * 9.81 * min(1.0, time / 0.021))


def velocity(own: Any, time: float) -> float:
    """Of the plate along x [m/s]."""
    return float(-own.speed * min(max((time - 0.021) / 0.019, 0.0), 1.0))


def at(contacts: Any, height: float) -> Any:
    """Which contacts are in a bed joint at some height, or at the floor or the plate."""
    flat = contacts.frame[:, 0, 2] ** 2 > 0.5
    return flat & (np.abs(contacts.point[:, 2] - height) < 0.01)


# ---- the facts of the deck


def test_it_has_the_facts_of_the_deck() -> None:
    scene: Any = scenes.get("ElasticLowWall")().scene(0)
    assert (scene.time_step, scene.theta, scene.solids.gravity) == (H, THETA, 0.0)
    *blocks, plate, floor = scene.solids.meshes
    assert {(m.young, m.poisson, m.density, m.lumped) for m in blocks} == {(2.2e9, 0.2, 2e3, True)}
    assert plate.density == 148146.0
    assert {one.law for one in scene.interactions} == {"GAP_SGR_CLB"}
    assert {(one.mu, one.alert) for one in scene.interactions} == {(0.53, 1e-3), (0.83, 1e-2)}
    # the published problems have 7,212 degrees of freedom, and 624 to 688 contacts
    given = [drive for drive in scene.drives if drive.velocity]
    nodes = sum(len(mesh.nodes) for mesh in scene.solids.meshes)
    assert 3 * nodes - len(given) == pytest.approx(7212, rel=0.1)
    # all of the floor is held, of the plate the motion along x is given
    last = 3 * (nodes - len(floor.nodes))
    assert [drive.dof for drive in given if drive.dof >= last] == list(range(last, 3 * nodes))
    first = last - 3 * len(plate.nodes)
    moved = [drive for drive in given if drive.dof < last]
    assert [drive.dof for drive in moved] == list(range(first, last, 3))
    # it stands still for 21 ms, and moves by 1 mm/s from 40 ms on
    for drive in moved:
        for time, speed in ((0.0, 0.0), (0.021, 0.0), (0.0305, -5e-4), (0.04, -1e-3), (9, -1e-3)):
            assert drive.course.at(time) == pytest.approx(speed, abs=1e-12)


def test_stored_problems_are_as_large_as_published() -> None:
    path = published.path_of("decks/ElasticLowWall", "1")
    if path is None:
        pytest.skip("no states of it are stored")
    states = trajectory.read(path)
    assert (len(states), states.step[0], states.step[-1]) == (50, 0, 499)
    assert set(np.diff(states.step).tolist()) <= {10, 11}
    for place in (0, 24, 49):
        problem = states.problem(place).problem
        assert problem.n == pytest.approx(7212, rel=0.1)
        assert 0.9 * 624 <= problem.nc <= 1.1 * 688


# ---- balances


def test_impulses_balance_the_motion_of_wall_and_plate() -> None:
    own = family(**FAST)
    mass = masses(bodies_of(next(iter(fast()))[0].model)).diagonal().reshape(-1, 3)[:, 0]
    blocks, plate = slice(0, -16), slice(-16, -8)
    top = own.courses * own.height
    for step, r, before in fast():
        c = step.contacts
        force = step.contacts.forces(r.ravel())  # on the nodes of blocks
        gained = mass[:, None] * (step.velocity - before).reshape(-1, 3)
        time = step.index * H
        load = 0.5 * H * (weight(own, time) + weight(own, time + H))
        floor, lid = at(c, 0.0), at(c, top)
        scale = max(load, H * 1e3)
        # blocks: floor and plate act on them
        outer = force[floor].sum(axis=0) + force[lid].sum(axis=0)
        np.testing.assert_allclose(gained[blocks].sum(axis=0), outer, atol=1e-7 * scale)
        # plate: its weight, and the wall; along x it is driven
        held = -force[lid].sum(axis=0) - (0.0, 0.0, load)
        np.testing.assert_allclose(gained[plate].sum(axis=0)[1:], held[1:], atol=1e-7 * scale)
        np.testing.assert_allclose(
            step.velocity.reshape(-1, 3)[plate, 0], velocity(own, time + H), atol=1e-15
        )
        assert not step.velocity.reshape(-1, 3)[-8:].any()


def test_the_wall_carries_the_plate() -> None:
    """In the mean over three of its periods, while it stands still."""
    own = family(still=0.1)
    carried = [r[at(step.contacts, 0.0), 0].sum() / H for step, r, _ in states_of(own, 100)]
    expected = [weight(own, (k + 0.5) * H * 0.021 / 0.1) for k in range(100)]
    assert np.mean(carried[-40:]) == pytest.approx(np.mean(expected[-40:]), rel=1e-2)
    assert np.min(carried) >= 0


# ---- contacts


def test_nothing_is_pressed_into_another() -> None:
    """But by a step's slip times the slopes of deformed faces, which the next step undoes."""
    for step, r, _ in fast():
        assert step.contacts.gap.min() > -1e-3 * FAST["speed"] * H
        assert (r[:, 0] >= -1e-9 * r[:, 0].max()).all()


@pytest.mark.parametrize(("changes", "height", "mu"), [({}, 0.2, 0.53), ({"mu": 1.2}, None, 0.83)])
def test_it_slides_where_friction_is_least(changes: Any, height: float | None, mu: float) -> None:
    """In the joint by 0.53; if blocks hold each other better, on floor and plate by 0.83."""
    ratios, slips = [], []
    for step, r, _ in states_of(family(**FAST, **changes), 60)[40:]:
        u = np.reshape(step.result.solution.u, (-1, 3))
        own = [at(step.contacts, z) for z in (0.0, 0.2, 0.4)]
        pressed = r[:, 0] > 1e-3 * r[:, 0].max()
        ratio = [np.hypot(*r[k][:, 1:].sum(axis=0)) / r[k, 0].sum() for k in own]
        ratios.append(ratio)
        slips.append([np.abs(u[k & pressed, 1]).mean() for k in own])
        limit = np.asarray(step.problem.mu) * r[:, 0]
        assert (np.hypot(r[:, 1], r[:, 2]) <= limit + 1e-6 * limit.max()).all()
    slip = np.mean(slips, axis=0)
    most = 1 if height is not None else int(np.argmax(slip))
    assert int(np.argmax(slip)) == most
    assert (most == 1) == (height is not None)
    largest = np.max(ratios, axis=0)[most]
    assert 0.9 * mu < largest <= mu * (1 + 1e-6)


def test_narrow_head_joints_have_contacts_too() -> None:
    """One for each node of a left end; wide ones have none."""
    for joint, nodes in ((2e-4, 3 * 4), (2e-3, 0)):
        own = family(joint=joint)
        step, *_ = (step for step, *_ in states_of(own, 3))
        along = np.abs(step.contacts.frame[:, 0, 0]) > 0.9
        # one joint in the lower course, two in the upper one
        assert along.sum() == 3 * nodes
        np.testing.assert_allclose(step.contacts.gap[along], joint, atol=1e-9)
        np.testing.assert_array_equal(np.asarray(step.problem.mu)[along], 0.53)


# ---- what is refused


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"restitution": 0.5}, "restitution must be 0"),
        ({"joint": 0.2}, "joint must be less than half of block"),
        ({"layers": 0}, "layers"),
        ({"still": 0.0}, "still"),
    ],
)
def test_nonsense_is_refused(changes: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        family(**changes)
