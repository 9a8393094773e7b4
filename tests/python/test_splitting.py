"""What is specific to the splitting and the projection methods: options, agreement, limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import sparse

import fclib
from helpers import converged, dense, local_problem, planted_local, planted_rolling

LOCAL_SOLVERS = ("exact", "projection", "diagonal", "alart-curnier", "fischer-burmeister", "hybrid")
PROJECTIONS = ("fp-ds", "fp-vi-upk", "fp-vi-upts", "fp-eg-upk", "fp-eg-upts", "hyperplane")
METHODS = ("nsgs", "psor", *PROJECTIONS)
SWEEPS: list[dict[str, Any]] = [
    {"symmetric": True},
    {"freeze": 3},
    {"freeze": 10, "freeze_below": 1e-3, "symmetric": True},
    {"freeze": 2, "shuffle": "always", "relaxation": 0.9},
]


def packing(stretch: float = 1.0) -> fclib.LocalProblem:
    """Thirty contacts in a row, with masses that spread over `stretch` squared."""
    problem = planted_local(11, nc=30).problem
    assert isinstance(problem, fclib.LocalProblem)
    scale = np.repeat(np.geomspace(1, stretch, problem.nc), 3)
    W = scale[:, None] * dense(problem.W) * scale
    return local_problem(W, problem.q * scale, problem.mu)


# ---- the one-contact solvers of Gauss-Seidel


@pytest.mark.parametrize("local_solver", LOCAL_SOLVERS)
@pytest.mark.parametrize("method", ["nsgs", "psor"])
@pytest.mark.parametrize("d", [2, 3])
def test_local_solvers_agree(method: str, local_solver: str, d: int) -> None:
    for seed in range(4):
        case = planted_local(seed, d=d)
        result = converged(
            case.problem, method, 1e-11, local_solver=local_solver, max_iterations=20_000
        )
        np.testing.assert_allclose(result.solution.r, case.solution.r, atol=1e-8)


@pytest.mark.parametrize("local_solver", LOCAL_SOLVERS)
@pytest.mark.parametrize("d", [3, 5])
def test_local_solvers_take_rolling_contacts(local_solver: str, d: int) -> None:
    problem, r = planted_rolling(d, seed=2)
    result = converged(
        problem, "nsgs", 1e-10, local_solver=local_solver, max_iterations=100_000, time_limit=20
    )
    np.testing.assert_allclose(result.solution.r, r, atol=1e-7)


def test_a_rolling_contact_is_solved_in_each_sweep() -> None:
    problem = fclib.load("tiny/RollingDiscs/0040")
    by_newton = converged(problem, "nsgs", 1e-6, max_iterations=1000)
    projected = fclib.solve(problem, "nsgs", 1e-6, local_solver="projection", max_iterations=1000)
    assert by_newton.iterations < projected.iterations / 10


# a rolling velocity over W_RR is much more than the reaction ever is
def test_fast_rolling_of_what_hardly_moves_hides_no_error() -> None:
    problem, r = planted_rolling(5, 1, nc=6)
    usual = converged(problem, "nsgs", 1e-10)
    W = dense(problem.W)
    u = W @ r + problem.q
    slow = np.tile([1, 1, 1, 1e-6, 1e-6], problem.nc)
    W = slow[:, None] * W * slow
    result = converged(problem.replace(W=W, q=u - W @ r), "nsgs", 1e-10)
    assert result.iterations <= usual.iterations


@pytest.mark.parametrize("size", [1e6, 1e12])
def test_a_guess_that_is_far_too_large_costs_few_sweeps(size: float) -> None:
    problem = planted_local(1).problem
    cold = converged(problem, "nsgs")
    result = converged(problem, "nsgs", guess=np.full(problem.m, size))
    assert result.iterations < cold.iterations + 20


def test_newton_takes_the_sweeps_of_the_exact_solver() -> None:
    exact = fclib.solve(packing(), "nsgs", 1e-9)
    for local_solver in ("alart-curnier", "hybrid"):
        newton = fclib.solve(packing(), "nsgs", 1e-9, local_solver=local_solver)
        assert newton.iterations == exact.iterations
        np.testing.assert_allclose(newton.solution.r, exact.solution.r, atol=1e-8)


@pytest.mark.parametrize("options", SWEEPS)
def test_orders_of_sweeping_lead_to_the_same_solution(options: dict[str, Any]) -> None:
    for seed in range(4):
        case = planted_local(seed)
        result = converged(case.problem, "nsgs", 1e-11, **options)
        np.testing.assert_allclose(result.solution.r, case.solution.r, atol=1e-8)


def test_omega_1_is_gauss_seidel() -> None:
    sweeps = fclib.solve(packing(), "nsgs", 1e-9)
    psor = fclib.solve(packing(), "psor", 1e-9, omega=1)
    np.testing.assert_allclose(psor.solution.r, sweeps.solution.r, atol=1e-12)
    assert psor.iterations == sweeps.iterations


@pytest.mark.parametrize("omega", [0.5, 0.9, 1.2])
def test_relaxed_sweeps_stay_in_the_cone(omega: float) -> None:
    for limit in (1, 2, 5):
        result = fclib.solve(packing(), "psor", 0, omega=omega, max_iterations=limit)
        r = result.solution.r.reshape(-1, 3)
        excess = np.hypot(r[:, 1], r[:, 2]) - packing().mu * r[:, 0]
        assert excess.max() <= 1e-12


# ---- several threads


def row(nc: int = 400, seed: int = 3) -> fclib.LocalProblem:
    """Contacts in a row, each coupled with three on either side."""
    random = np.random.default_rng(seed)
    H = sparse.lil_array((3 * (nc + 3), 3 * nc))
    for a in range(nc):
        H[3 * a : 3 * a + 12, 3 * a : 3 * a + 3] = random.normal(size=(12, 3))
    H = H.tocsc()
    W = H.T @ H + 0.1 * sparse.eye_array(3 * nc)
    return fclib.LocalProblem(
        spacedim=3, W=W.tocsc(), q=random.normal(size=3 * nc), mu=random.uniform(0, 1, nc)
    )


@pytest.mark.parametrize(
    ("method", "options"),
    [("psor", {"omega": 1.2}), ("psor", {"symmetric": True}), ("nsgs", {})]
    + [("nsgs", options) for options in SWEEPS],
)
def test_the_number_of_threads_does_not_change_a_bit(method: str, options: dict[str, Any]) -> None:
    two = converged(row(), method, 1e-10, threads=2, **options)
    for threads in (3, 7):
        more = fclib.solve(row(), method, 1e-10, threads=threads, **options)
        assert more.iterations == two.iterations
        np.testing.assert_array_equal(more.solution.r, two.solution.r)
    one = fclib.solve(row(), method, 1e-10, **options)
    np.testing.assert_allclose(two.solution.r, one.solution.r, atol=1e-8)


@pytest.mark.parametrize("method", ["nsgs", "psor"])
def test_threads_take_all_that_one_takes(method: str) -> None:
    for d in (2, 3):
        case = planted_local(1, d=d)
        result = fclib.solve(case.problem, method, 1e-11, threads=4)
        np.testing.assert_allclose(result.solution.r, case.solution.r, atol=1e-8)
    for d in (3, 5):
        problem, r = planted_rolling(d, seed=1)
        result = fclib.solve(problem, method, 1e-9, threads=4, time_limit=20)
        np.testing.assert_allclose(result.solution.r, r, atol=1e-6)
    mu = np.array([0.5])
    empty = fclib.LocalProblem(spacedim=3, W=np.zeros((0, 0)), q=np.zeros(0), mu=mu[:0])
    assert fclib.solve(empty, method, threads=4).converged


@pytest.mark.parametrize("threads", [0, -1, 257, 10**9, 1.5, "all"])
def test_a_number_of_threads_that_makes_no_sense_is_refused(threads: Any) -> None:
    with pytest.raises(fclib.OptionError, match="threads"):
        fclib.solve(row(10), "nsgs", threads=threads)


def test_more_threads_than_contacts_and_limits_are_kept() -> None:
    assert fclib.solve(row(10), "nsgs", 1e-8, threads=256).converged
    result = fclib.solve(row(), "nsgs", 0, threads=3, max_iterations=7)
    assert (result.status, result.iterations) == ("iteration_limit", 7)
    result = fclib.solve(row(), "nsgs", 0, threads=3, max_iterations=10**12, time_limit=0.1)
    assert result.status == "time_limit"
    result = fclib.solve(row(), "psor", 0, threads=3, callback=lambda *_: False)
    assert result.status == "interrupted"


def test_times_of_all_threads_are_told() -> None:
    result = fclib.solve(row(4000), "nsgs", 0, threads=2, max_iterations=30)
    assert result.cpu_s > 0
    assert result.setup_s > 0


# ---- projections on the variational inequality


@pytest.mark.parametrize("metric", ["contact", "uniform"])
@pytest.mark.parametrize("method", PROJECTIONS)
@pytest.mark.parametrize("d", [2, 3])
def test_projections_agree_with_the_planted_solution(method: str, d: int, metric: str) -> None:
    for seed in range(4):
        case = planted_local(seed, d=d)
        result = converged(case.problem, method, 1e-10, metric=metric, time_limit=20)
        np.testing.assert_allclose(result.solution.r, case.solution.r, atol=1e-7)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("d", [3, 5])
def test_rolling_contacts(method: str, d: int) -> None:
    problem, r = planted_rolling(d, seed=1)
    result = converged(problem, method, 1e-9, time_limit=20)
    np.testing.assert_allclose(result.solution.r, r, atol=1e-6)


@pytest.mark.parametrize("method", PROJECTIONS)
def test_a_metric_of_each_contact_bears_unlike_masses(method: str) -> None:
    problem = packing(stretch=30)
    own = converged(problem, method, 1e-6, time_limit=30)
    same = fclib.solve(
        problem, method, 1e-6, metric="uniform", max_iterations=4 * own.iterations, time_limit=30
    )
    assert not same.converged


@pytest.mark.parametrize("method", PROJECTIONS[1:])
@pytest.mark.parametrize("rho", [1e-6, 1e6])
def test_the_first_step_hardly_matters(method: str, rho: float) -> None:
    case = planted_local(3)
    result = converged(case.problem, method, 1e-8, rho=rho)
    assert result.iterations <= 2 * fclib.solve(case.problem, method, 1e-8).iterations + 100


def test_a_constant_step_that_is_too_long_is_not_called_converged() -> None:
    result = fclib.solve(packing(), "fp-ds", 1e-8, rho=50, max_iterations=500)
    assert not result.converged


def test_the_hyperplane_is_better_met_inside_the_cone() -> None:
    problem = packing()
    both = fclib.solve(problem, "hyperplane", 1e-6)
    in_turn = fclib.solve(
        problem, "hyperplane", 1e-6, intersection=False, max_iterations=2 * both.iterations
    )
    assert both.converged
    assert both.error <= in_turn.error


# ---- limits and starts


@pytest.mark.parametrize("method", METHODS)
def test_the_time_limit_is_kept_in_the_middle_of_a_solve(method: str) -> None:
    result = fclib.solve(packing(30), method, 0, max_iterations=10**12, time_limit=0.1)
    assert result.status == "time_limit"
    assert result.cpu_s < 10


@pytest.mark.parametrize("method", METHODS)
def test_more_iterations_never_give_a_worse_result(method: str) -> None:
    errors = [
        fclib.solve(packing(), method, 0, max_iterations=limit).error for limit in (1, 4, 16, 64)
    ]
    assert errors == sorted(errors, reverse=True)


@pytest.mark.parametrize("method", METHODS)
def test_a_better_start_takes_fewer_iterations(method: str) -> None:
    problem = packing()
    rough = fclib.solve(problem, method, 1e-4)
    cold = fclib.solve(problem, method, 1e-6)
    warm = converged(problem, method, 1e-6, guess=rough.solution)
    assert warm.iterations < cold.iterations
