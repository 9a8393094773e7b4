"""Recorded problems that `auto` once gave up; skipped where the files are not at hand."""

from __future__ import annotations

from pathlib import Path

import pytest

import fclib
from ball_judge import judge
from helpers import converged

CASES = Path(__file__).parents[2].parent / "shared" / "data" / "cases"

pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason="no recorded cases here")


def case(name: str) -> fclib.Problem:
    (path,) = CASES.glob(f"{name}*.hdf5")
    return fclib.read(path)


def assert_solved(problem: fclib.Problem, result: fclib.Result) -> None:
    assert result.status == "converged", (result.status, result.error)
    assert judge(problem, result.solution).error <= 1e-8


def test_an_overflow_in_the_first_sweeps_does_not_end_the_chain() -> None:
    problem = case("cx15")
    assert_solved(problem, fclib.solve(problem))
    for name in ("cx14_infeasible_ends_diverged_149", "cx14_infeasible_ends_diverged_213"):
        assert fclib.solve(case(name)).status != "diverged"


@pytest.mark.parametrize("solver", ["auto", "nsgs", "psor"])
@pytest.mark.parametrize("name", ["rank1_three_finger_gripper", "mixed_robotiq_gripper"])
def test_fingers_of_few_joints_are_solved_in_a_few_iterations(name: str, solver: str) -> None:
    problem = case(name)
    result = fclib.solve(problem, solver=solver)
    assert_solved(problem, result)
    assert result.iterations <= 20


def test_a_guess_does_not_keep_a_problem_from_being_solved() -> None:
    problem = case("warm_start_diverges")
    (path,) = CASES.glob("warm_start_diverges*.hdf5")
    assert_solved(problem, fclib.solve(problem))
    guesses = fclib.read_guesses(path)
    assert len(guesses) >= 1
    for guess in guesses:
        assert_solved(problem, fclib.solve(problem, guess=guess))


def test_nearly_parallel_joints_between_light_and_heavy_bodies() -> None:
    problem = case(
        "cx07"
    )  # multipliers of 1e11, rounded to a metre per second of the lightest body
    result = converged(problem)
    assert fclib.merit(problem, result.solution).error <= 1e-8


def test_reactions_that_round_to_more_than_the_tolerance() -> None:
    problem = case("cx08_false_infeasible_ratio2e28")
    assert_solved(problem, fclib.solve(problem))
