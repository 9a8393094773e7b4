"""Rolling friction: files, merits and solutions, against the equations in ball arithmetic."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import fclib
from ball_judge import judge
from helpers import as_global, converged, dense
from helpers import planted_rolling as planted

Array = npt.NDArray[np.float64]
CASES = [(d, seed) for d in (3, 5) for seed in range(6)]


@pytest.mark.parametrize(("d", "seed"), CASES)
def test_a_planted_solution_has_no_error_and_another_has_the_error_of_the_equations(
    d: int, seed: int
) -> None:
    problem, r = planted(d, seed)
    assert fclib.merit(problem, fclib.Solution(r=r)).error < 1e-13
    assert fclib.merit(as_global(problem), fclib.Solution(r=r)).natural < 1e-12
    wrong = r + 0.3 * np.random.default_rng(seed).normal(size=r.size)
    expected = float(judge(problem, fclib.Solution(r=wrong)).natural)
    assert expected > 1e-2
    merit = fclib.merit(problem, fclib.Solution(r=wrong))
    assert merit.natural == pytest.approx(expected, rel=1e-12)
    assert fclib.merit(as_global(problem), fclib.Solution(r=wrong)).natural == pytest.approx(
        expected, rel=1e-9
    )


@pytest.mark.parametrize(("d", "seed"), CASES)
def test_statuses_are_told_apart(d: int, seed: int) -> None:
    problem, r = planted(d, seed, nc=10)
    merit = fclib.merit(problem, fclib.Solution(r=r))
    assert (merit.open, merit.stick, merit.slide) == (2, 2, 6)


@pytest.mark.parametrize(
    "solver", [s.name for s in fclib.solvers() if s.origin == "fclib" and s.rolling_dimensions]
)
@pytest.mark.parametrize(("d", "seed"), CASES)
def test_every_solver_that_claims_rolling_solves_it(solver: str, d: int, seed: int) -> None:
    if d not in fclib.find_solver(solver).rolling_dimensions:
        pytest.skip(f"{solver} takes no rolling problems of spacedim {d}")
    problem, _ = planted(d, seed)
    for form in (problem, as_global(problem)):
        result = converged(form, solver, tol=1e-9)
        own = fclib.Solution(r=result.solution.r)
        assert judge(problem, own).natural <= 1.1e-9


@pytest.mark.parametrize(("d", "seed"), CASES)
def test_files_keep_every_number(d: int, seed: int, tmp_path: Path) -> None:
    local, r = planted(d, seed)
    path = tmp_path / "rolling.hdf5"
    for problem in (local, as_global(local)):
        fclib.write(path, problem, fclib.Solution(r=r))
        back: Any = fclib.read(path)
        assert type(back) is type(problem)
        np.testing.assert_array_equal(back.mu_r, problem.mu_r)
        assert back.spacedim == d
        solution = fclib.read_solution(path)
        assert solution is not None
        np.testing.assert_array_equal(solution.r, r)
        assert fclib.merit(back, solution).error < 1e-12


def test_condensing_a_rolling_problem_gives_one() -> None:
    problem, _ = planted(5, 0)
    local = as_global(problem).condense()
    assert isinstance(local, fclib.LocalRollingProblem)
    np.testing.assert_allclose(dense(local.W), np.asarray(problem.W), atol=1e-12)
    np.testing.assert_array_equal(local.mu_r, problem.mu_r)
    assert local.formulation == "R3DFC"


def test_what_is_wrong_is_named() -> None:
    good: dict[str, Any] = {
        "W": np.eye(5),
        "q": np.ones(5),
        "mu": [0.5],
        "mu_r": [0.1],
        "spacedim": 5,
    }
    fclib.LocalRollingProblem(**good).validate()
    cases: tuple[tuple[dict[str, Any], str], ...] = (
        ({"mu_r": [-0.1]}, "mu_r"),
        ({"mu_r": [0.1, 0.1]}, "mu_r"),
        ({"spacedim": 2}, "spacedim"),
        ({"spacedim": 4}, "spacedim"),
        ({"q": np.ones(3)}, "q"),
    )
    for wrong, named in cases:
        with pytest.raises(fclib.ProblemError, match=named):
            fclib.LocalRollingProblem(**(good | wrong)).validate()


def test_real_rolling_problems_have_the_sizes_of_the_index(real_data: Path) -> None:
    with (real_data / "INDEX.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["kind"].startswith("rolling")]
    assert len(rows) == 5
    for row in rows:
        problem = fclib.read(real_data / row["kind"] / f"{row['name']}.hdf5")
        assert problem.spacedim == int(row["spacedim"])
        assert (problem.nc, problem.m) == (int(row["nc"]), int(row["m"]))
