"""`auto` on robots: those that installed packages ship, and one in free flight that needs none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fclib

pytest.importorskip("mujoco", reason="simulates")

from fclib.scenes import Scene
from fclib.simulate import simulate
from helpers import converged
from workshop.sets import published_robots

STEPS = 10  # of each published model: workshop/sets/published_robots.py makes 100
MODELS = 12  # of each package, evenly spread over its files

# a trunk with three legs, each with its hip and its knee at a limit, high above the floor
HOPPER = """
<mujoco>
  <option timestep="0.002"/>
  <compiler angle="degree"/>
  <worldbody>
    <geom type="plane" size="5 5 1"/>
    <body pos="0 0 10" euler="10 20 30">
      <freejoint/>
      <geom type="box" size="0.2 0.1 0.05" mass="5"/>
      {legs}
    </body>
  </worldbody>
  <keyframe><key name="start" qpos="0 0 10 0.9 0.1 0.3 0.2 {angles}" qvel="{velocity}"/></keyframe>
</mujoco>
"""
LEG = """
<body pos="{x} 0 -0.05">
  <joint name="hip{x}" axis="0 1 0.1" range="0 60" limited="true"/>
  <geom type="capsule" fromto="0 0 0 0.1 0 -0.3" size="0.03" mass="0.7"/>
  <body pos="0.1 0 -0.3">
    <joint name="knee{x}" axis="0 1 0" range="-90 0" limited="true"/>
    <geom type="capsule" fromto="0 0 0 -0.1 0 -0.3" size="0.02" mass="0.4"/>
  </body>
</body>
"""


def in_flight(velocity: str, hip: float = 0.0) -> Scene:
    """The robot, joints at their limits, moving as a whole but for its first hip [rad/s]."""
    legs = "".join(LEG.format(x=x) for x in (-0.15, 0.0, 0.15))
    xml = HOPPER.format(legs=legs, angles="0 0 " * 3, velocity=f"{velocity} {hip} 0 0 0 0 0")
    return Scene(name="in flight", xml=xml)


@pytest.mark.parametrize("velocity", ["0 0 0 0 0 0", "0 0 -40 0 0 0", "3 -2 100 0 0 0"])
def test_a_robot_in_free_flight_with_joints_at_their_limits_needs_no_reaction(
    velocity: str,
) -> None:
    seen = 0
    for step in simulate(in_flight(velocity), 40):
        problem: Any = step.problem
        if not problem.nc:
            continue
        q, rounding = published_robots.free_velocity(problem)
        assert q <= rounding <= 1e-10
        result = fclib.solve(problem)
        assert result.status == "converged", (step.index, result.error, q, rounding)
        assert not result.solution.r.any()
        merit = fclib.merit(problem, fclib.Solution(r=np.zeros(problem.m)))
        assert merit.error <= 1e-8
        seen += 1
    assert seen >= 5


def test_what_moves_a_joint_against_its_limit_in_flight_is_no_rounding() -> None:
    moving = in_flight("0 0 -40 0 0 0", hip=-1e-6)
    problem: Any = next(iter(simulate(moving, 1))).problem
    result = converged(problem)
    assert result.solution.r.any()
    assert fclib.merit(problem, fclib.Solution(r=np.zeros(problem.m))).error > 1e-3


@pytest.mark.slow
def test_robots_of_installed_packages_are_solved() -> None:
    by_package: dict[str, list[Any]] = {}
    for robot in published_robots.robots():
        by_package.setdefault(robot.package, []).append(robot)
    if not by_package:
        pytest.skip("no installed package ships MJCF files")
    left: list[str] = []
    solved = 0
    for found in by_package.values():
        for robot in found[:: max(1, len(found) // MODELS)]:
            try:
                for problem in published_robots.problems(robot.path, STEPS):
                    result = fclib.solve(problem)
                    solved += result.converged
                    if result.converged or result.status == "infeasible":
                        continue
                    q, rounding = published_robots.free_velocity(problem)
                    left.append(f"{robot.package} {robot.name}: {result.status}, {q}, {rounding}")
                    # what is rounding is solved by no reaction
                    assert q > rounding, left[-1]
            except (ValueError, ArithmeticError, MemoryError, OSError):
                continue  # not a model of its own, or one that no problem can hold
    assert len(left) <= 0.001 * solved, left
