"""Data at the edges of mechanics: `auto` solves what has a solution, and every solver is honest."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import pytest

import fclib
from ball_judge import judge
from fclib import _core
from helpers import converged, dense, local_problem, planted_global, planted_law

sys.path.insert(0, str(Path(__file__).parents[1]))
from planted_judge import REGIMES, claim, verdict

Array: TypeAlias = npt.NDArray[np.float64]

SOLVERS = [solver.name for solver in fclib.solvers() if solver.origin == "fclib"]
FORMS = [(2, False), (3, False), (3, True), (5, True)]


def of_rank(
    rank: int, d: int, rolling: bool, seed: int, mu: float | None = None, twice: bool = False
) -> Any:
    """Contacts that move their bodies in `rank` directions each, and r = 0 solves none of them."""
    rng = np.random.default_rng(seed)
    nc, n = 5, 40
    law, (u, r, _) = planted_law(rng, d, nc, mu, rolling)
    H = np.zeros((n, d * nc))
    for a in range(nc):
        rows = slice(6 * a, 6 * a + 10)
        H[rows, d * a : d * a + d] = rng.standard_normal((10, rank)) @ rng.standard_normal(
            (rank, d)
        )
    if twice:
        H, u, r = np.hstack([H, H]), np.vstack([u, u]), np.vstack([r, r])
        law = {name: np.tile(values, 2) for name, values in law.items()}
    kind: Any = fclib.LocalRollingProblem if rolling else fclib.LocalProblem
    W = H.T @ H
    return kind(spacedim=d, W=W, q=u.ravel() - W @ r.ravel(), **law)


def fits(name: str, d: int, rolling: bool) -> bool:
    (entry,) = (solver for solver in fclib.solvers() if solver.name == name)
    return d in (entry.rolling_dimensions if rolling else entry.dimensions)


@pytest.mark.parametrize(("d", "rolling"), FORMS)
def test_contacts_of_any_rank_are_solved(d: int, rolling: bool) -> None:
    for rank in range(d + 1):
        for seed in range(6):
            for twice in (False, True):
                problem = of_rank(rank, d, rolling, seed, twice=twice)
                result = fclib.solve(problem)
                assert result.status == "converged", (rank, seed, twice, result.status)
                assert judge(problem, result.solution).error <= 1e-8


@pytest.mark.parametrize("rank", [1, 2])
@pytest.mark.parametrize("solver", ["nsgs", "psor"])
def test_sweeps_do_not_diverge_on_contacts_of_rank_one_and_two(solver: str, rank: int) -> None:
    for seed in range(10):
        result = fclib.solve(of_rank(rank, 3, False, seed, mu=0.8), solver=solver, time_limit=20)
        assert result.status != "diverged", seed


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver_is_honest_on_contacts_of_low_rank(solver: str) -> None:
    for d, rolling in FORMS:
        if not fits(solver, d, rolling):
            continue
        for rank in range(d):
            problem = of_rank(rank, d, rolling, 3)
            result = fclib.solve(problem, solver=solver, max_iterations=300)
            error = float(judge(problem, result.solution).error)
            assert np.isfinite(error)
            assert result.converged == (error <= 1.0001e-8 and result.error <= 1e-8)
            assert result.status != "infeasible"


@pytest.mark.parametrize("mu", [0.0, 1e-9, 1.0, 1e3, 1e7])
def test_any_friction_is_solved_or_said_not_to_be(mu: float) -> None:
    for seed in range(5):
        problem = of_rank(3, 3, False, seed, mu=mu)
        result = fclib.solve(problem)
        assert result.status not in {"diverged", "infeasible"}
        assert result.converged == (result.error <= 1e-8)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6, 1e100, 1e300])
def test_a_guess_never_makes_a_solvable_problem_unsolved(size: float) -> None:
    for seed in range(8):
        for d, rolling in FORMS:
            problem = of_rank(d, d, rolling, seed)
            guess = size * np.random.default_rng(seed).standard_normal(problem.m)
            result = fclib.solve(problem, guess=fclib.Solution(r=guess))
            assert result.status == "converged", (seed, d, rolling, result.status)


@pytest.mark.parametrize(("d", "rolling"), FORMS)
def test_a_guess_where_nothing_moves_does_not_round_the_others(d: int, rolling: bool) -> None:
    problem = of_rank(d, d, rolling, 1)
    still = slice(d, 2 * d)
    W, q = dense(problem.W).copy(), problem.q.copy()
    W[still], W[:, still], q[still] = 0, 0, 0
    problem = problem.replace(W=W, q=q)
    guess = fclib.Solution(r=1e12 * np.abs(np.random.default_rng(1).standard_normal(problem.m)))
    for solver in ("auto", "nsgs"):
        result = converged(problem, solver, guess=guess)
        assert not result.solution.r[still].any()
        assert judge(problem, result.solution).error <= 1e-8


@pytest.mark.parametrize(("heavy", "tol"), [(1e2, 1e-8), (1e3, 1e-8), (1e4, 1e-8), (1e5, 1e-6)])
def test_a_pebble_that_rolls_under_a_heavy_body_is_solved(heavy: float, tol: float) -> None:
    """Beside the normal reaction its limit of rolling is small, and its inertia far smaller."""
    light, radius = 1e-3, 5e-3
    M = np.diag([light] * 3 + [0.4 * light * radius**2] * 2 + [heavy] * 3 + [0.4 * heavy] * 2)
    lever = np.zeros((5, 5))
    lever[3, 1] = lever[4, 2] = radius
    H = np.block([[np.eye(5) + lever, -np.eye(5) + lever], [np.zeros((5, 5)), np.eye(5)]])
    problem = fclib.GlobalRollingProblem(
        spacedim=5,
        M=M,
        H=H,
        f=[-9.81e-3 * light, 0, 0, 0, 0, -1.01 * heavy, 0.2 * heavy, 0, 0, 0],
        w=np.zeros(10),
        mu=[0.6, 0.6],
        mu_r=[1e-4, 1e-4],
    )
    result = converged(problem, tol=tol)
    assert judge(problem, result.solution).error <= tol


@pytest.mark.parametrize("mass", [1e-9, 1e-3, 1e3, 1e9])
def test_units_of_mass_do_not_matter(mass: float) -> None:
    for seed in range(5):
        problem = of_rank(2, 3, False, seed)
        converged(problem.replace(W=problem.W / mass))


def test_planted_problems_of_every_formulation_get_no_false_word() -> None:
    for number in range(300):
        said = verdict(number)
        assert not said.false, (number, said)


@pytest.mark.parametrize("regime", list(REGIMES))
def test_every_regime_gets_no_false_word_from_any_solver(regime: str) -> None:
    for number in range(72):
        said = REGIMES[regime](number, solver="each")
        assert not said.false, (number, said)


class Looks:
    """A clock that ticks when it is looked at."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self) -> float:
        self.count += 1
        return float(self.count)


def test_problems_without_a_solution_get_a_proof_or_no_claim() -> None:
    words = Counter(claim(number).word for number in range(150))
    assert not [word for word in words if word.startswith("false")], words
    # of bodies and with whole numbers each has an exact proof, and is there half of the times
    assert words["infeasible, exactly"] > 60


def dense_contacts() -> fclib.LocalProblem:
    rng = np.random.default_rng(0)
    nc = 50
    root = rng.standard_normal((3 * nc, 2 * nc))
    q = rng.standard_normal(3 * nc) - 1
    return fclib.LocalProblem(spacedim=3, W=root @ root.T / nc, q=q, mu=np.full(nc, 0.9))


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver_looks_at_the_clock_and_ends_soon_after_the_limit(solver: str) -> None:
    problem = dense_contacts()
    (entry,) = (s for s in fclib.solvers() if s.name == solver)
    for limit in (1.0, 4.0, 12.0):
        clock = Looks()
        result = _core.solve(
            problem, entry, 1e-15, 0, limit, {}, None, None, False, False, clock=clock
        )
        assert result.status == "time_limit", (limit, result.status)
        assert sum(stage.factorisations for stage in result.stages) <= limit
        assert clock.count <= limit + 40


def test_the_clock_is_looked_at_before_each_factorisation_between_reports() -> None:
    (entry,) = (s for s in fclib.solvers() if s.name == "ppa-nsn")
    clock = Looks()
    counts: list[int] = []

    def follow(*_: object) -> bool:
        counts.append(clock.count)
        return len(counts) < 6

    _core.solve(dense_contacts(), entry, 1e-15, 0, 1e9, {}, None, follow, False, False, clock=clock)
    # a report looks four times at most, and a proximal step takes several factorisations
    assert max(np.diff(counts)) > 6, counts


def test_conversions_are_held_to_the_limit() -> None:
    """Nothing is done after the limit, not even a judgement that takes as long."""
    planted = planted_global(3, p=2)
    problem: Any = planted.problem
    (entry,) = (s for s in fclib.solvers() if s.name == "auto")
    unjudged = 0
    for limit in np.arange(0.5, 12.5):
        for guess in (None, planted.solution):
            clock = Looks()
            result = _core.solve(
                problem, entry, 1e-15, 0, limit, {}, guess, None, False, False, clock=clock
            )
            if result.error == np.inf:
                # a look at the start, and none after the one that was too late
                assert clock.count <= limit + 2
                assert result.status == "time_limit"
                assert result.iterations == 0
                unjudged += 1
            else:
                assert float(judge(problem, result.solution).error) == pytest.approx(result.error)
            assert result.solution.v is not None
    # once M is factorised, and before each block of columns of two products
    assert unjudged >= 6


@pytest.mark.parametrize("k", [20, 25, 28, 40])
@pytest.mark.parametrize("d", [2, 3])
def test_a_light_body_under_a_heavy_one_is_never_infeasible(k: int, d: int) -> None:
    # W is positive definite: what closes the contacts has a small velocity, and not none
    W = np.kron([[1, -1], [-1, 1 + 2.0**-k]], np.eye(d))
    q = ([-1.0] + [0.1] * (d - 1)) * 2
    problem = local_problem(W, q, [0.5, 0.5])
    result = fclib.solve(problem, max_iterations=3000)
    assert result.status != "infeasible"
