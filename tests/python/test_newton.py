"""The Newton and proximal point families beside Gauss-Seidel, on problems of known solution."""

from itertools import pairwise

import numpy as np
import pytest

import fclib
from ball_judge import judge
from fclib.scenes.mass_ratios import RATIOS, MassRatios
from helpers import planted_local

OWN = [solver for solver in fclib.solvers() if solver.origin == "fclib"]
NEWTON = [solver.name for solver in OWN if solver.family == "newton"]
FAMILIES = {"newton", "proximal point", "interior point"}
SAME = [solver.name for solver in OWN if solver.family in FAMILIES]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("solver", SAME)
def test_agrees_with_gauss_seidel(solver: str, d: int) -> None:
    for seed in range(5):
        case = planted_local(seed, d=d, nc=12)
        expected = fclib.solve(case.problem, "nsgs", 1e-11)
        result = fclib.solve(case.problem, solver, 1e-9)
        assert expected.converged
        assert result.converged
        np.testing.assert_allclose(result.solution.r, expected.solution.r, atol=1e-7)
        np.testing.assert_allclose(result.solution.r, case.solution.r, atol=1e-7)


def test_sweeps_find_the_direction_of_sliding_that_the_interior_point_cannot() -> None:
    plain = 0
    for seed in range(20):
        case = planted_local(seed, d=3, nc=12)
        plain += fclib.solve(case.problem, "nsip", 1e-10, sweeps=0).converged
        assert fclib.solve(case.problem, "nsip", 1e-10).converged
    assert plain < 20


@pytest.mark.parametrize("solver", NEWTON)
def test_the_last_steps_are_fast(solver: str) -> None:
    problem = planted_local(4, d=3, nc=12).problem
    errors: list[float] = []

    def follow(iteration: int, error: float, seconds: float, stage: str) -> None:
        errors.append(error)

    assert fclib.solve(problem, solver, 1e-13, callback=follow).converged
    # the number of digits grows by half at least, once there are some
    last = [error for error in errors if error < 1e-2]
    for before, after in pairwise(last):
        assert after <= max(30 * before**1.5, 1e-13)


def test_the_relaxation_says_what_it_is() -> None:
    slides = fclib.LocalProblem(spacedim=3, W=np.eye(3), q=[-1.0, 2, 0], mu=[0.5])
    sticks = fclib.LocalProblem(spacedim=3, W=np.eye(3), q=[-1.0, 0.2, 0], mu=[0.5])
    assert fclib.solve(sticks, "associated", 1e-6).converged
    result = fclib.solve(slides, "associated", 1e-6)
    assert result.status == "inaccurate"
    # it is the projection of -q on the cone
    np.testing.assert_allclose(result.solution.r, [1.6, -0.8, 0], atol=1e-5)


def test_heavy_bodies_on_light_ones() -> None:
    """Large reactions, a large proximal parameter: the rounding of u must not come back by it."""
    problem = MassRatios().problem(RATIOS.index(1e6))
    for case in (problem, problem.condense()):
        result = fclib.solve(case, "ppa-nsn", 1e-8)
        assert result.converged, result
        assert judge(case, result.solution).error <= 1.01e-8
