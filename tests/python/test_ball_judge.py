"""The judge of these tests itself, on cases by hand."""

import math

import numpy as np
import pytest

import fclib
from ball_judge import NOTHING, judge
from helpers import local_problem, planted_global, planted_local

EXACT = 1e-15


def test_coulomb_in_space() -> None:
    problem = local_problem(np.eye(3), [-1, 2, 0], [0.5])
    solved = judge(problem, fclib.Solution(r=np.array([1, -0.5, 0])))
    assert solved.error <= EXACT
    assert (solved.open, solved.stick, solved.slide) == (0, 0, 1)
    # r = 0: F = -P_K(-u^), u^ = (-1 + 0.5 * 2, 2, 0), P_K(0, -2, 0) = (0.8, -0.4, 0)
    wrong = judge(problem, fclib.Solution(r=np.zeros(3)))
    assert float(wrong.natural) == pytest.approx(math.hypot(0.8, 0.4) / math.sqrt(5))
    # it closes at 1 m/s, which is more than F says
    assert float(wrong.scaled_natural) == pytest.approx(1 / math.sqrt(5))
    assert float(wrong.dual_cone) == pytest.approx(math.hypot(0.8, 0.4))


def test_rolling_in_space() -> None:
    q = [-0.75, 2, 0, 1, 0]
    problem = fclib.LocalRollingProblem(spacedim=5, W=np.eye(5), q=q, mu=[0.25], mu_r=[0.25])
    # u^_N = -0.75 + 0.25 (2 + 1) = 0; both limits bind: n = 0.75 / 1.125
    n = 0.75 / 1.125
    verdict = judge(problem, fclib.Solution(r=np.zeros(5)))
    size = math.sqrt(n**2 + 2 * (0.25 * n) ** 2)
    assert float(verdict.natural) == pytest.approx(size / np.linalg.norm(q))
    # one limit: n = 0.5 / 1.0625, and what rolls is within its limit
    problem = problem.replace(q=[-0.5, 2, 0, 0, 0.0])
    n = 0.5 / 1.0625
    verdict = judge(problem, fclib.Solution(r=np.zeros(5)))
    assert float(verdict.natural) == pytest.approx(math.hypot(n, 0.25 * n) / math.hypot(0.5, 2))
    assert (verdict.open, verdict.stick, verdict.slide) == (0, 0, 1)


def test_a_penetration_shows_whatever_the_friction() -> None:
    for mu in (1e3, 1e10, 1e40, 1e150):
        problem = local_problem(np.eye(3), [-1, 1, 0], [mu])
        verdict = judge(problem, fclib.Solution(r=np.zeros(3)))
        assert verdict.natural < max(2 / mu, NOTHING)
        assert float(verdict.scaled_natural) == pytest.approx(1 / math.sqrt(2))


def test_reactions_that_hide_a_velocity_from_doubles() -> None:
    problem = local_problem(np.eye(3), [-1e20, 1, 0], [1e-30])
    verdict = judge(problem, fclib.Solution(r=np.array([1e20, 0, 0])))
    # it slides, and what it lacks is a reaction of 1e-10
    assert verdict.natural > 0.99e-10 / 1e20
    assert verdict.natural < 1.01e-10 / 1e20


def test_each_equation_of_a_global_problem() -> None:
    problem = fclib.GlobalProblem(
        spacedim=2,
        M=np.diag([2.0, 4.0, 1.0]),
        H=np.array([[1.0, 0], [0, 1], [0, 0]]),
        f=[2.0, 0, 3],
        w=[0.0, 0],
        mu=[0.5],
        G=np.array([[0.0], [0], [1]]),
        b=[-2.0],
    )
    v, lam = np.array([1.0, 0, 2]), np.array([-1.0])
    exact = fclib.Solution(v=v, u=v[:2], r=np.zeros(2), l=lam)
    assert judge(problem, exact).error <= EXACT
    # v_0 = (1, 0, 3); the joint alone is stopped by 5 N s, so that the third body has 5 m/s
    off = judge(problem, fclib.Solution(v=[1, 0, 2.5], r=np.zeros(2), l=lam))
    assert float(off.dynamics) == pytest.approx(0.5 / 5)
    assert float(off.bilateral) == pytest.approx(0.5 / 5)
    # the contact has 1 m/s
    off = judge(problem, fclib.Solution(v=v, u=[1.25, 0], r=np.zeros(2), l=lam))
    assert float(off.kinematics) == pytest.approx(0.25)
    off = judge(problem, fclib.Solution(r=np.zeros(2), l=np.array([-2.0])))
    assert float(off.bilateral) == pytest.approx(1 / 5)
    assert off.dynamics <= EXACT


@pytest.mark.parametrize("part", ["v", "u", "r", "l"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_no_number_is_an_infinite_error(part: str, value: float) -> None:
    case = planted_global(1, p=2)
    members = {name: np.array(getattr(case.solution, name)) for name in ("v", "u", "r", "l")}
    members[part][1] = value
    assert judge(case.problem, fclib.Solution(**members)).error > 1e300


def test_only_the_allowance_for_rounding_is_taken_off() -> None:
    for case in (planted_local(3, p=2), planted_global(3, p=2)):
        noise = np.random.default_rng(0).standard_normal(case.problem.m)
        for size in (0.0, 1e-15, 1e-9, 1e-3):
            solution = fclib.Solution(r=case.solution.r + size * noise, l=case.solution.l)
            whole, rest = (judge(case.problem, solution, rounding=taken) for taken in (False, True))
            for name in ("natural", "scaled_natural", "bilateral"):
                own, left = (float(getattr(verdict, name)) for verdict in (whole, rest))
                assert left <= own
                assert left >= own - 1e-12
            if size == 0.0:
                assert rest.error < whole.error
