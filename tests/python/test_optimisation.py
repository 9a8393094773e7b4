"""The optimisation family: fixed points, ADMM and projected gradients, and their options."""

from typing import Any

import numpy as np
import pytest

import fclib
from ball_judge import judge
from helpers import converged, dense, local_problem, planted_global, planted_local

FAMILY = ["aclm", "admm", "apgd", "bb", "panagiotopoulos", "tresca"]
OPTIONS: list[tuple[str, dict[str, Any]]] = [
    *(
        ("aclm", {"inner": x})
        for x in ("gauss_seidel", "projected_gradient", "interior_point", "admm")
    ),
    ("aclm", {"relaxation": 0.7}),
    *(("tresca", {"inner": x}) for x in ("gauss_seidel", "projected_gradient", "admm")),
    ("tresca", {"relaxation": 0.7, "local_iterations": 1, "inner_accuracy": 0.5}),
    *(("panagiotopoulos", {"inner": x}) for x in ("gauss_seidel", "projected_gradient")),
    *(("admm", {"penalty": x}) for x in ("constant", "balance", "spectral")),
    ("admm", {"acceleration": "restart", "relaxation": 1.0}),
    ("admm", {"weights": False, "rho": 0.3, "penalty_interval": 5}),
    ("apgd", {"restart": False}),
    ("apgd", {"growth": 1.2, "reduction": 0.5, "weights": False}),
    *(("bb", {"step": x}) for x in ("long", "short", "alternating")),
    ("bb", {"memory": 1, "weights": False}),
]
NAMES = [f"{solver}-{'-'.join(f'{k}={v}' for k, v in o.items())}" for solver, o in OPTIONS]


def slides(d: int) -> fclib.LocalProblem:
    """One contact that slides: the associated flow rule lifts it, Coulomb's law does not."""
    return local_problem(np.eye(d), [-1, 2, 0][:d], [0.5])


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(("solver", "options"), OPTIONS, ids=NAMES)
def test_every_option_finds_the_solution_of_nsgs(
    solver: str, options: dict[str, Any], d: int
) -> None:
    for seed in range(3):
        for make in (planted_local, planted_global):
            case = make(seed, d=d, nc=8)
            result = converged(case.problem, solver, 1e-8, time_limit=20, **options)
            assert judge(case.problem, result.solution).error <= 1e-8 * (1 + 1e-6)
            expected = fclib.solve(case.problem, "nsgs", 1e-10)
            np.testing.assert_allclose(result.solution.r, expected.solution.r, atol=1e-5)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("solver", ["apgd", "bb"])
def test_the_relaxation_without_shift_is_not_called_solved(solver: str, d: int) -> None:
    result = fclib.solve(slides(d), solver, 1e-8, time_limit=20, shift="none")
    assert result.status == "stalled"
    assert result.error > 0.1
    assert float(judge(slides(d), result.solution).error) == pytest.approx(result.error)
    assert fclib.solve(slides(d), solver, 1e-8, shift="iterated").converged


@pytest.mark.parametrize("solver", ["apgd", "bb"])
def test_the_relaxation_is_coulombs_law_where_nothing_slides(solver: str) -> None:
    problem = local_problem(np.eye(3), [-1, 0.2, 0], [0.5])
    assert fclib.solve(problem, solver, 1e-8, shift="none").converged


@pytest.mark.parametrize("solver", FAMILY)
def test_masses_may_differ(solver: str) -> None:
    problem = planted_local(5).problem
    assert isinstance(problem, fclib.LocalProblem)
    scale = np.repeat(10.0 ** np.linspace(-1, 1, problem.nc), 3)
    stretched = local_problem(
        scale[:, None] * dense(problem.W) * scale, problem.q * scale, problem.mu
    )
    assert fclib.solve(stretched, solver, 1e-8, time_limit=20).converged


@pytest.mark.parametrize("solver", FAMILY)
def test_the_best_iterate_is_returned(solver: str) -> None:
    errors: list[float] = []

    def remember(_iteration: int, error: float, *_: Any) -> bool:
        errors.append(error)
        return True

    problem = planted_local(11, nc=30).problem
    result = fclib.solve(problem, solver, 1e-14, max_iterations=25, callback=remember)
    assert result.error <= min(errors) * (1 + 1e-3)


def test_the_interior_point_refuses_rolling_friction() -> None:
    rolling = fclib.LocalRollingProblem(
        spacedim=5, W=np.eye(5), q=[-1.0, 1, 0, 1, 0], mu=[0.5], mu_r=[0.1]
    )
    with pytest.raises(fclib.UnsuitableError, match="rolling"):
        fclib.solve(rolling, "aclm", inner="interior_point")
    assert fclib.solve(rolling, "aclm", 1e-8).converged
