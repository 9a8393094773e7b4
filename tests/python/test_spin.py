"""Spin friction: files, merits and solutions, against the equations in ball arithmetic."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import fclib
from ball_judge import judge
from fclib import _laws, analysis
from fclib.analysis._certificate import _at_least_roots, _outside
from helpers import SPIN_LAWS, as_global, converged, dense
from helpers import planted_spin as planted

Array = npt.NDArray[np.float64]
CASES = [(law, d, seed) for law, d in SPIN_LAWS for seed in range(3)]
TAKERS = ("nsgs", "nsn-ac", "ppa-nsn", "admm", "apgd", "nsip", "homotopy", "auto")


@pytest.mark.parametrize("without", [False, True])
@pytest.mark.parametrize(("law", "d", "seed"), CASES)
def test_a_planted_solution_has_no_error_and_another_has_the_error_of_the_equations(
    law: str, d: int, seed: int, without: bool
) -> None:
    problem, r = planted(law, d, seed, without=without, ratio=1e4 if seed == 2 else 1.0)
    assert fclib.merit(problem, fclib.Solution(r=r)).error < 1e-12
    assert fclib.merit(as_global(problem), fclib.Solution(r=r)).natural < 1e-11
    wrong = r + 0.3 * np.random.default_rng(seed).normal(size=r.size)
    expected = judge(problem, fclib.Solution(r=wrong))
    merit = fclib.merit(problem, fclib.Solution(r=wrong))
    assert float(expected.natural) > 1e-4
    for name in ("natural", "scaled_natural", "cone", "dual_cone", "complementarity"):
        assert getattr(merit, name) == pytest.approx(float(getattr(expected, name)), rel=1e-11), (
            name
        )
    assert (merit.open, merit.stick, merit.slide) == (expected.open, expected.stick, expected.slide)


@pytest.mark.parametrize("without", [False, True])
@pytest.mark.parametrize("solver", TAKERS)
@pytest.mark.parametrize(("law", "d", "seed"), CASES)
def test_every_solver_that_claims_spin_solves_it(
    solver: str, law: str, d: int, seed: int, without: bool
) -> None:
    problem, _ = planted(law, d, seed, without=without)
    forms = (problem, as_global(problem)) if seed == 0 else (problem,)
    for form in forms:
        result = fclib.solve(form, solver, tol=1e-9, max_iterations=20_000)
        assert result.converged, (result.status, result.error)
        assert judge(problem, fclib.Solution(r=result.solution.r)).error <= 1.1e-9


def test_the_others_say_that_they_do_not_take_it() -> None:
    problem, _ = planted("product", 4, 0)
    takers = [s.name for s in fclib.solvers() if s.spin_dimensions]
    assert sorted(takers) == sorted(TAKERS)
    for solver in fclib.solvers():
        if solver.origin == "fclib" and not solver.spin_dimensions:
            with pytest.raises(fclib.UnsuitableError, match="does not take S3DFC"):
                fclib.solve(problem, solver.name)


def test_formulations_are_told_apart() -> None:
    names = {
        (law, d): (planted(law, d, 0)[0].formulation, as_global(planted(law, d, 0)[0]).formulation)
        for law, d in SPIN_LAWS
    }
    assert names == {
        ("product", 4): ("S3DFC", "GS3DFC"),
        ("product", 6): ("SR3DFC", "GSR3DFC"),
        ("ellipsoid", 4): ("SE3DFC", "GSE3DFC"),
    }


@pytest.mark.parametrize(("law", "d", "seed"), CASES)
def test_files_keep_every_number(law: str, d: int, seed: int, tmp_path: Path) -> None:
    local, r = planted(law, d, seed)
    path = tmp_path / "spin.hdf5"
    for problem in (local, as_global(local)):
        fclib.write(path, problem, fclib.Solution(r=r))
        back: Any = fclib.read(path)
        assert type(back) is type(problem)
        np.testing.assert_array_equal(back.mu_s, problem.mu_s)
        np.testing.assert_array_equal(back.mu_r, problem.mu_r)
        assert (back.spacedim, back.coupled) == (d, problem.coupled)
        assert fclib.digest(back) == fclib.digest(problem)
        solution = fclib.read_solution(path)
        assert solution is not None
        np.testing.assert_array_equal(solution.r, r)


def test_condensing_and_units_keep_the_law() -> None:
    for law, d in SPIN_LAWS:
        problem, r = planted(law, d, 0)
        local = as_global(problem).condense()
        assert isinstance(local, fclib.LocalSpinProblem)
        np.testing.assert_allclose(dense(local.W), np.asarray(problem.W), atol=1e-12)
        np.testing.assert_array_equal(local.mu_s, problem.mu_s)
        assert local.formulation == problem.formulation
        other = problem.scaled(velocity=3.0, impulse=0.2, length=100.0)
        np.testing.assert_allclose(other.mu_s, 100.0 * problem.mu_s)
        moved = fclib.Solution(r=r).scaled(problem, velocity=3.0, impulse=0.2, length=100.0)
        assert fclib.merit(other, moved).error < 1e-12


def test_the_law_is_part_of_the_digest() -> None:
    product, _ = planted("product", 4, 0)
    coupled = product.replace(coupled=1)
    assert fclib.digest(product) != fclib.digest(coupled)
    assert fclib.digest(product) != fclib.digest(product.replace(mu_s=2 * product.mu_s))


def test_what_is_wrong_is_named() -> None:
    good: dict[str, Any] = {
        "W": np.eye(4),
        "q": np.ones(4),
        "mu": [0.5],
        "mu_s": [0.1],
        "spacedim": 4,
    }
    fclib.LocalSpinProblem(**good).validate()
    cases: tuple[tuple[dict[str, Any], str], ...] = (
        ({"mu_s": [-0.1]}, "mu_s"),
        ({"mu_s": [0.1, 0.1]}, "mu_s"),
        ({"mu_r": [0.1]}, "mu_r"),
        ({"spacedim": 3}, "spacedim"),
        ({"spacedim": 5}, "spacedim"),
        ({"coupled": 2}, "coupled"),
        ({"W": np.eye(6), "q": np.ones(6), "spacedim": 6}, "mu_r"),
        ({"W": np.eye(6), "q": np.ones(6), "spacedim": 6, "mu_r": [0.1], "coupled": 1}, "coupled"),
    )
    for wrong, named in cases:
        with pytest.raises(fclib.ProblemError, match=named):
            fclib.LocalSpinProblem(**(good | wrong)).validate()


def test_there_is_no_planar_spin_and_no_text_of_siconos(tmp_path: Path) -> None:
    problem, _ = planted("product", 4, 0)
    with pytest.raises(fclib.UnsuitableError, match="not planar"):
        problem.embed()
    with pytest.raises(fclib.UnsuitableError, match="spin"):
        fclib.write_siconos(tmp_path / "spin.dat", problem)


@pytest.mark.parametrize(("law", "d"), SPIN_LAWS)
def test_a_proof_that_there_is_no_solution_holds(law: str, d: int) -> None:
    # two contacts that press a body that cannot yield
    bounds: dict[str, Any] = {"mu": [0.5, 0.5], "mu_s": [0.1, 0.1]} | (
        {"mu_r": [0.1, 0.1]} if d == 6 else {}
    )
    H = np.zeros((d, 2 * d))
    H[:, :d], H[:, d:] = np.eye(d), -np.eye(d)
    w = np.zeros(2 * d)
    w[[0, d]] = -1.0
    problem = fclib.GlobalSpinProblem(
        spacedim=d, M=np.eye(d), H=H, f=np.zeros(d), w=w, coupled=int(law == "ellipsoid"), **bounds
    )
    for form in (problem, problem.condense()):
        result = fclib.solve(form, "auto")
        assert result.status == "infeasible"
        assert result.certificate is not None
        proof = fclib.analysis.check_arrays(form, result.certificate, result.certificate_z)
        assert proof.gain > 0


def test_the_distance_of_a_certificate_from_the_dual_cone_is_exact() -> None:
    rng = np.random.default_rng(3)
    states = set()
    for law, d in SPIN_LAWS:
        problem, _ = planted(law, d, 1, without=True)
        for a in range(problem.nc):
            for _ in range(20):
                y = rng.integers(-9, 9, d).astype(float)
                y[0] = abs(y[0])
                rows = np.broadcast_to(y, (problem.nc, d))
                margin = y[0] - sum(g.resistance(rows)[a] for g in _laws.groups(problem))
                found = _outside(problem, a, [Fraction(x) for x in y])
                assert (found == 0) == (margin >= 0)
                # the distance from a cone is at most that along one axis
                assert found <= max(0.0, -margin) * (1 + 1e-9)
                states.add(found == 0)
    assert states == {True, False}


def test_a_number_is_compared_with_roots_exactly() -> None:
    rng = np.random.default_rng(4)
    for count in (1, 2, 3):
        for _ in range(200):
            roots = [Fraction(int(x), 7) for x in rng.integers(0, 50, count)]
            total = sum(roots, Fraction())
            squares = [x * x for x in roots]
            assert _at_least_roots(total, squares)
            assert _at_least_roots(total + Fraction(1, 10**30), squares)
            assert not _at_least_roots(total - Fraction(1, 10**30), squares)


@pytest.mark.parametrize(("mu", "mu_s"), [(0.0, 2.0**20), (0.0, 0.25), (0.25, 0.0)])
def test_an_ellipsoid_that_is_a_segment_or_a_disk_is_analysed(mu: float, mu_s: float) -> None:
    """What slides or spins there meets no resistance, and says nothing of the rest."""
    H = np.eye(4)[:, [0, 1, 2, 3, 0, 1, 2, 3]]  # two contacts at one place
    problem = fclib.LocalSpinProblem(
        spacedim=4,
        W=H.T @ H,
        q=np.tile([-1, 0.7 * (mu == 0), 0, 0.7 * (mu_s == 0)], 2),
        mu=[mu, mu],
        mu_s=[mu_s, mu_s],
        coupled=True,
    )
    for share in (0.0, 0.5):  # of the second contact: reactions are not unique
        solution = fclib.Solution(r=[1 - share, 0, 0, 0, share, 0, 0, 0])
        assert fclib.merit(problem, solution).error == 0
    found = analysis.analyze(problem, time_limit=1.0)
    assert found.reactions.verdict != "unique"
    alone = problem.replace(W=np.eye(4), q=problem.q[:4], mu=problem.mu[:1], mu_s=problem.mu_s[:1])
    assert analysis.analyze(alone, time_limit=1.0).existence.verdict[:6] == "exists"


def test_spin_without_a_limit_may_have_any_unit() -> None:
    """W_SS is out of all proportion, and mu_s = 0: the spin takes no part."""
    W = np.array([[1, 0.3, 0.2, 0], [0.3, 1, 0.1, 0], [0.2, 0.1, 1.5, 0], [0, 0, 0, 1e12]])
    r, u = np.array([1, -0.3, -0.4, 0]), np.array([0, 0.6, 0.8, 1e5])
    problem = fclib.LocalSpinProblem(spacedim=4, W=W, q=u - W @ r, mu=[0.5], mu_s=[0.0], coupled=1)
    result = converged(problem, "nsgs", max_iterations=10)
    np.testing.assert_allclose(result.solution.r, r, atol=1e-8)
