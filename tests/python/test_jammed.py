"""Jammed packings: without a solution, and proved so, until what they grew is taken back."""

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.optimize import linprog

import fclib
from fclib import scenes
from fclib.scenes.jammed import RELEASED, SIZES

FAMILY: Any = scenes.assemblies()["Jammed"]()


def margin(problem: Any) -> float:
    """The largest normal velocity that all contacts can have at once [m/s], by linear programming.

    Speeds are at most 100 m/s and rad/s.
    """
    N = sp.csc_array(problem.H)[:, 0 :: problem.spacedim].T
    rows = sp.hstack([-N, sp.csc_array(np.ones((problem.nc, 1)))])
    cost = np.append(np.zeros(problem.n), -1.0)
    bounds = [(-100.0, 100.0)] * problem.n + [(None, 1.0)]
    gaps = np.asarray(problem.w)[0 :: problem.spacedim]
    return -float(linprog(cost, A_ub=rows, b_ub=gaps, bounds=bounds).fun)


@pytest.mark.parametrize("size", range(len(SIZES)))
def test_jammed_packing_balances_and_so_has_no_solution(size: int) -> None:
    """Forces y >= 0 move nothing, H y = 0, and w^T y < 0: nothing opens all that overlaps."""
    count = SIZES[size]
    problem = FAMILY.of_size(count, 0.0)
    y = FAMILY.proof(problem, count)
    assert y.min() >= 0
    assert np.abs(problem.H @ y).max() < 1e-14
    sums = [np.asarray(FAMILY.of_size(count, r).w) @ y for r in RELEASED]
    # in proportion to what is left of the growth: jamming is at 1
    np.testing.assert_allclose(sums, sums[-1] * (1 - np.array(RELEASED)), rtol=1e-3)
    # just as rigid as it must be: 3 contacts a sphere, less what rattles
    assert 2.5 * count < np.count_nonzero(y) < 3.3 * count
    gaps = np.asarray(FAMILY.bodies(count).gaps)
    assert -gaps.min() < 0.02 * 2 * 0.8 * FAMILY.radius


@pytest.mark.parametrize("size", range(2))
def test_a_solution_exists_above_jamming_and_none_below(size: int) -> None:
    """Whether the normal velocities can all be >= 0 decides it, by another method."""
    for released in RELEASED:
        assert (margin(FAMILY.of_size(SIZES[size], released)) > 0) == (released > 1)


def test_a_released_packing_is_solved_and_a_jammed_one_never() -> None:
    assert fclib.solve(FAMILY.of_size(SIZES[0], 3.0), time_limit=30.0).converged
    jammed = fclib.solve(FAMILY.of_size(SIZES[0], 0.0), time_limit=1.0)
    assert not jammed.converged


def test_the_largest_packing_is_of_its_size() -> None:
    problem = FAMILY.problem(FAMILY.problems - 1)
    assert problem.n == 6 * SIZES[-1]
    assert 20_000 < problem.nc < 21_000
    assert "0 of the growth" in problem.info.title
