"""Verdicts that were wrong outside of Coulomb's law with ordinary friction, and what is true."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fclib
from helpers import case, converged


def stored(name: str) -> fclib.Merit:
    """What the solution of a file is worth."""
    problem: Any = fclib.read(case(name))
    solution = fclib.read_solution(case(name))
    assert solution is not None
    return fclib.merit(problem, solution)


def rolling(**changes: Any) -> fclib.LocalRollingProblem:
    """One contact of a body that slides at 1 m/s, and does not roll."""
    data: dict[str, Any] = {
        "spacedim": 5,
        "W": np.eye(5),
        "q": [0.0, 1, 0, 0, 0],
        "mu": [0.5],
        "mu_r": [0.1],
    }
    return fclib.LocalRollingProblem(**data | changes)


def test_a_body_that_penetrates_is_not_ok() -> None:
    merit = stored("rolling-nan-false-ok.hdf5")
    assert merit.error > 0.1
    assert np.isfinite(merit.scaled_natural)


def test_an_exact_solution_with_large_friction_is_ok() -> None:
    assert stored("rolling-exact-refused.hdf5").error <= 1e-15


@pytest.mark.parametrize("mu", [0.3, 0.96, 1e5, 3e6, 1e9, 1e12])
@pytest.mark.parametrize("mu_r", [0.0, 0.2, 1e6])
def test_a_contact_that_slides_and_does_not_roll(mu: float, mu_r: float) -> None:
    law = {"mu": [mu], "mu_r": [mu_r]}
    grazing = rolling(**law)
    assert fclib.merit(grazing, np.zeros(5)).error == 0
    penetrating = rolling(q=[-0.75, 1, 0, 0, 0], **law)
    assert fclib.merit(penetrating, np.zeros(5)).error > 0.5


def test_a_solve_without_a_solution_returns_the_best_iterate() -> None:
    problem: Any = fclib.read(case("empty-r-fp-ds.hdf5"))
    result = fclib.solve(problem, solver="fp-ds", tol=1e-12)
    assert result.solution.r.size == problem.m
    nothing = fclib.merit(problem, np.zeros(problem.m)).error
    assert result.error <= nothing
    assert result.error == fclib.merit(problem, result.solution).error


def test_multipliers_of_ones_own_do_not_hide_a_joint() -> None:
    assert stored("multipliers-hide-joint.hdf5").bilateral > 0.1


@pytest.mark.parametrize("size", [1e6, 1e10, 1e14, 1e17])
@pytest.mark.parametrize("stored", [True, False])
def test_a_self_stress_hides_nothing(size: float, stored: bool) -> None:
    """Two equal joints pull against each other, and two walls press a body."""
    H = np.zeros((2, 4))
    H[0, 0], H[0, 2] = 1, -1
    G = np.array([[0.0, 0], [1, 1]])
    problem = fclib.GlobalProblem(
        spacedim=2, M=np.eye(2), H=H, f=[0.0, 1.0], w=np.zeros(4), mu=[0.5, 0.5], G=G, b=[0.0, 0]
    )
    still: dict[str, Any] = {"v": [0.0, 0], "u": np.zeros(4)} if stored else {}
    r = [size, 0, size, 0]
    right = fclib.Solution(r=r, l=[-1.0, 0], **still)
    assert fclib.merit(problem, right).error <= 1e-15
    if size <= 1e14:  # else doubles do not hold it
        right = fclib.Solution(r=r, l=[-1.0 - size, size], **still)
        assert fclib.merit(problem, right).error <= 1e-15
    moves = fclib.Solution(r=r, l=[-size, size], **still)
    assert fclib.merit(problem, moves).error > 0.1
    if stored:
        flies = fclib.Solution(r=r, l=[-1.0, 0], v=[1.0, 0], u=[1.0, 0, -1.0, 0])
        assert fclib.merit(problem, flies).dynamics > 0.1


@pytest.mark.parametrize("coupling", [0.0, 1e-30, 1e-15, 1e-9, 1e-6])
@pytest.mark.parametrize("ratio", [1e6, 1e12])
def test_a_weak_coupling_hides_nothing(coupling: float, ratio: float) -> None:
    """A light body is next to uncoupled from a heavy one."""
    M = np.diag([1 / ratio, ratio])
    M[0, 1] = M[1, 0] = coupling / ratio
    problem = fclib.GlobalProblem(
        spacedim=2, M=M, H=np.zeros((2, 2)), f=M @ [1.0, 1.0], w=[1.0, 0], mu=[0.5]
    )
    good = fclib.Solution(v=[1.0, 1.0], u=[1.0, 0], r=np.zeros(2))
    assert fclib.merit(problem, good).error <= 1e-13
    wrong = fclib.Solution(v=[1.0 + 1e-6, 1.0], u=[1.0, 0], r=np.zeros(2))
    assert fclib.merit(problem, wrong).dynamics == pytest.approx(1e-6, rel=1e-2)


@pytest.mark.parametrize("mu", [1e5, 1e8, 1e10, 1e16, 1e40])
def test_huge_friction_is_judged_right(mu: float) -> None:
    """Contacts that stick for any mu above 6; the last digit of r is no slip."""
    W = np.diag([2.0, 2, 2, 1, 1, 1])
    W[0, 3] = W[3, 0] = 0.5
    W[1, 0] = W[0, 1] = 0.3
    q = np.array([-1.0, 0.3, 0, -2, 0, 0.1])
    exact = np.linalg.solve(W, -q)
    problem = fclib.LocalProblem(spacedim=3, W=W, q=q, mu=[mu, mu])
    assert fclib.merit(problem, exact).error <= 1e-15
    assert fclib.merit(problem, exact + 1e-6 * np.arange(6)).error > 1e-6
    result = converged(problem)
    assert result.solution.r == pytest.approx(exact, abs=1e-8)
