"""The families of spin friction against their closed forms, and what `simulate` makes of condim."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import scenes
from fclib.scenes import Scene
from fclib.scenes.screwdriver import Screwdriver
from fclib.scenes.soft_finger import LOADS, SoftFinger
from fclib.scenes.spinner import Spinner
from fclib.simulate import simulate

EXACT = 1e-6  # of a closed form, relative to the largest velocity of the family
SOLVERS = ("auto", "nsgs", "ppa-nsn")


def velocity(problem: Any, solver: str) -> Any:
    result = fclib.solve(problem, solver, tol=1e-9, max_iterations=20_000)
    assert result.converged, (solver, result.status, result.error)
    return result.solution.v


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_rod_hangs_from_soft_fingers_until_its_moment_is_too_much(solver: str) -> None:
    family = SoftFinger()
    h = family.time_step
    weight, grip = family.mass * family.gravity * h, family.grip * h
    moment = weight * family.arm
    inertia = family.mass * (3 * family.radius**2 + family.length**2) / 12
    inertia += family.mass * family.arm**2
    states = set()
    for number in range(2 * LOADS):
        v = velocity(family.problem(number), solver)
        mu_s, fast = family.mu_s(number), moment / inertia
        if number < LOADS:
            omega = max(0.0, moment - 2 * mu_s * grip) / inertia
            expected = np.zeros(7)
            # it turns about the pads
            expected[[2, 4]] = -family.arm * omega, omega
            np.testing.assert_allclose(v, expected, atol=EXACT * fast)
            states.add((0, omega > 0))
            continue
        # the ellipsoid: at the limit (W / mu)^2 + (W c / mu_s)^2 = (2 P)^2
        share = np.inf if mu_s == 0 else (moment / mu_s) ** 2
        holds = (weight / family.mu) ** 2 + share <= (2 * grip) ** 2
        assert (np.abs(v).max() < EXACT * fast) == holds, number
        states.add((1, holds))
    assert len(states) == 4


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_spinner_stops_sliding_and_turning_together_or_not(solver: str) -> None:
    family = Spinner()
    ends: dict[int, list[tuple[float, float]]] = {0: [], 1: []}
    for number in range(family.problems):
        v = velocity(family.problem(number), solver)
        speed, omega = family.motion(number, family.step(number)[1])
        way = [np.cos(family.heading), np.sin(family.heading)]
        np.testing.assert_allclose(v[:2], np.multiply(way, speed), atol=EXACT * family.speed)
        assert v[3] == pytest.approx(omega, abs=EXACT * family.spin)
        ends[family.problem(number).coupled].append((np.hypot(*v[:2]), v[3]))
    for coupled, motion in ends.items():
        # the last step in which it slides, and the last in which it turns
        last = [max(k for k, state in enumerate(motion) if state[part] > 1e-3) for part in range(2)]
        assert (last[0] == last[1]) == bool(coupled)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_screwdriver_turns_a_screw_as_far_as_it_grips(solver: str) -> None:
    family = Screwdriver()
    cases = set()
    for number in range(family.problems):
        v = velocity(family.problem(number), solver)
        driver, screw = family.speeds(number)
        scale = EXACT * max(1.0, driver)
        expected = np.zeros(12)
        expected[[5, 11]] = driver, screw
        np.testing.assert_allclose(v, expected, atol=scale, err_msg=str(number))
        cases.add((driver > 0, screw > 0, driver > screw))
    assert cases == {
        (False, False, False),
        (True, False, True),
        (True, True, False),
        (True, True, True),
    }


@pytest.mark.parametrize("name", ["SoftFinger", "Spinner", "Screwdriver"])
def test_each_family_has_sixty_problems(name: str) -> None:
    assert scenes.assemblies()[name].problems == 60


# ---- simulate

TOP = """
<mujoco>
  <option timestep="0.002" gravity="0 0 -9.81"/>
  <worldbody>
    <geom type="plane" size="1 1 1" condim="{condim}" friction="0.3 0.006 0.0002"/>
    <body pos="0 0 0.05">
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
      <joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 0 1"/>
      <geom type="sphere" size="0.05" mass="0.1" condim="{condim}" friction="0.3 0.006 0.0002"/>
      <inertial pos="0 0 0" mass="0.1" diaginertia="4e-5 4e-5 4e-5"/>
    </body>
  </worldbody>
  <keyframe><key name="start" qpos="0 0 0 0" qvel="0.5 0 0 40"/></keyframe>
</mujoco>
"""


def run(tmp_path: Path, condim: int, steps: int, **more: Any) -> list[Any]:
    path = tmp_path / f"top{condim}.xml"
    path.write_text(TOP.format(condim=condim), encoding="utf-8")
    return list(simulate(Scene.from_file(path, **more), steps, tol=1e-11))


def test_simulate_takes_condim_4_as_an_ellipsoid(tmp_path: Path) -> None:
    steps = run(tmp_path, 4, 130)
    problem = steps[1].problem
    assert isinstance(problem, fclib.GlobalSpinProblem)
    assert (problem.spacedim, problem.coupled, problem.formulation) == (4, 1, "GSE3DFC")
    assert (problem.mu[0], problem.mu_s[0]) == (0.3, 0.006)
    assert "left_out" not in problem.info.description
    # the radius of gyration is mu_s / mu: both velocities end together, linearly
    loss = 0.3**2 * 9.81 * 0.002
    first = np.hypot(0.3 * 0.5, 0.006 * 40)
    for k, step in enumerate(steps[:100]):
        left = max(0.0, 1 - (k + 1) * loss / first)
        np.testing.assert_allclose(step.velocity[[0, 3]], [0.5 * left, 40 * left], atol=1e-5)


def test_simulate_takes_condim_6_with_a_limit_for_each(tmp_path: Path) -> None:
    steps = run(tmp_path, 6, 5)
    problem = steps[1].problem
    assert isinstance(problem, fclib.GlobalSpinProblem)
    assert problem.mu_r is not None
    assert (problem.spacedim, problem.coupled, problem.formulation) == (6, 0, "GSR3DFC")
    assert (problem.mu_s[0], problem.mu_r[0]) == (0.006, 0.0002)
    for k, step in enumerate(steps):
        lost = (k + 1) * 0.002 * 9.81 * np.array([0.3, 0.1 * 0.006 / 4e-5])
        np.testing.assert_allclose(step.velocity[[0, 3]], [0.5, 40] - lost, atol=1e-6)


def test_torsion_is_left_out_if_it_is_asked_for(tmp_path: Path) -> None:
    steps = run(tmp_path, 4, 2, ignore=("torsion",))
    assert steps[1].problem.kind == "global"
