"""Robots that grip and push: friction carries what it should, and no more."""

from typing import Any

import numpy as np
import pytest

from fclib import scenes

# MuJoCo has no release for the oldest Python that fclib takes
pytest.importorskip("mujoco")

from fclib.simulate import MujocoModel, Step, simulate
from helpers_simulate import force_on, mujoco_of

LIFTED = 0.645  # share of the gripper's cycle in which it holds the row up
FALLEN = 1e-3  # [m]


def heights(step: Step, blocks: int) -> Any:
    """Of the blocks' centres [m]: they come first."""
    return step.position[: 7 * blocks].reshape(-1, 7)[:, 2]


def penetration(step: Step) -> float:
    """The deepest at the start of a step [m]."""
    return float(np.max(-step.contacts.gap, initial=0.0))


# ---- the gripper


@pytest.mark.parametrize(("blocks", "squeeze"), [(1, 1.5), (5, 4.0)])
def test_gripper_lifts_the_row_and_brings_it_back(blocks: int, squeeze: float) -> None:
    # pressed less, a row slides when the lift begins, and how it turns then is not unique
    family: Any = scenes.get("Gripper")(blocks=blocks, squeeze=squeeze)
    steps = list(simulate(family.scene(seed=1), round(family.period / family.time_step) + 1))
    assert all(step.result.converged for step in steps)
    held = steps[round(LIFTED * family.period / family.time_step)]
    # all of it, as high as the servo goes; nothing slides
    np.testing.assert_allclose(heights(held, blocks), family.height / 2 + family.lift, rtol=0.05)
    assert np.ptp(heights(held, blocks)) < FALLEN
    assert penetration(held) < 0.015 * family.thickness
    back = heights(steps[-1], blocks)
    assert np.abs(back - family.height / 2).max() < 0.15 * family.lift


def test_gripper_carries_the_weight_by_the_friction_of_its_jaws() -> None:
    """Action and reaction: what its jaws give the row is the row's weight."""
    # pressed less, the row slides for some steps, and how it turns then is not unique; how much
    # each jaw carries is not unique in any case
    family: Any = scenes.get("Gripper")(squeeze=2.0)
    *_, before, held = simulate(
        family.scene(seed=2), round(LIFTED * family.period / family.time_step)
    )
    carried = {jaw: force_on(held, jaw) for jaw in ("left", "right")}
    # the servo still rises, slower and slower
    weight = family.mass * family.gravity
    rising = [step.velocity[2 : 6 * family.blocks : 6].mean() for step in (before, held)]
    change = family.mass * (rising[1] - rising[0]) / family.time_step
    assert abs(change) < 0.05 * weight
    lifted = -sum(force[2] for force in carried.values())
    assert lifted == pytest.approx(weight + change, rel=1e-6)
    for jaw, outwards in (("left", -1), ("right", 1)):
        assert outwards * carried[jaw][1] == pytest.approx(family.force, rel=1e-3)
        assert abs(carried[jaw][2]) < family.mu * family.force
    # the block at the left jaw hands on what it does not need itself
    handed = force_on(held, "block1", by="block0")[2]
    share = weight / family.blocks
    assert handed == pytest.approx(-carried["left"][2] - share, abs=0.01 * weight)


def test_gripper_that_presses_too_little_lets_the_row_go() -> None:
    family: Any = scenes.get("Gripper")(squeeze=0.9)
    *_, held = simulate(family.scene(seed=1), round(LIFTED * family.period / family.time_step))
    z = heights(held, family.blocks)
    assert z.min() < family.height / 2 + 0.1 * family.lift
    assert held.result.converged


# ---- the pusher


def test_a_block_before_the_blade_feels_the_friction_of_the_floor() -> None:
    """It slides as fast as the blade, which pushes with mu times what it presses the floor with."""
    family: Any = scenes.get("Pusher")(blocks=1)
    # half the way, where the plan has no acceleration
    middle = round(0.475 * family.period / family.time_step)
    *_, step = simulate(family.scene(seed=0), middle)
    assert step.result.converged
    drag, press = (-force_on(step, "block0", by="world"))[[0, 2]] * [1, -1]
    assert drag == pytest.approx(family.mu * press, rel=1e-3)
    # the blade gives that, and what the block accelerates by
    mass = mujoco_of(step).body("block0").mass[0]
    after = np.asarray(step.result.solution.v)[np.isin(step.dofs, (3, 4, 5))]
    acceleration = (after - step.start.velocity[3:6]) / family.time_step
    forces = force_on(step, "block0") + mass * np.array([0, 0, -family.gravity])
    np.testing.assert_allclose(forces, mass * acceleration, atol=1e-6)
    push = force_on(step, "block0", by="wrist")[0]
    assert push == pytest.approx(drag, rel=0.2)
    # as fast as the blade: 0.5 pi of the mean speed
    way = 2 * family.arm * (0.85 - 0.3)
    speed = 0.5 * np.pi * way / (0.55 * family.period)
    assert step.velocity[3] == pytest.approx(speed, rel=0.02)


def test_the_blade_lets_no_block_through() -> None:
    family: Any = scenes.get("Pusher")(blocks=8, across=3, along=2)
    steps = list(simulate(family.scene(seed=3), round(0.5 * family.period / family.time_step)))
    assert all(step.result.converged for step in steps)
    # half the smallest edge would be through
    assert max(map(penetration, steps)) < 0.25 * family.edge / 2
    first, last = (
        step.position[3 : 3 + 7 * family.blocks].reshape(-1, 7) for step in (steps[0], steps[-1])
    )
    assert (last[:, 2] < 3 * family.edge).all()
    assert (last[:, 2] > 0).all()
    moved = last[:, 0] - first[:, 0]
    assert moved.mean() > 0.1
    # none is behind it, but those that came around its ends
    model = steps[-1].model
    assert isinstance(model, MujocoModel)
    blade = float(model.data.geom("blade").xpos[0])
    inside = np.abs(last[:, 1]) < 0.5 * family.blade - family.edge
    assert inside.any()
    assert (last[inside, 0] > blade).all()
