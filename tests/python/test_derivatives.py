"""Derivatives of solutions, against differences of solutions."""

import copy
import dataclasses
import pickle
import warnings
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import fclib
from helpers import planted_global, planted_local, planted_spin

STEP = 1e-6


def changes(problem: Any, seed: int) -> dict[str, Any]:
    """A change of every datum; of W and M one that keeps the symmetry and the pattern."""
    rng = np.random.default_rng(seed)
    found: dict[str, Any] = {"mu": rng.uniform(size=problem.nc)}
    for name in ("mu_s", "mu_r"):
        if getattr(problem, name, None) is not None:
            found[name] = rng.uniform(size=problem.nc)
    for name in ("q", "s", "f", "w", "b"):
        if getattr(problem, name, None) is not None:
            found[name] = rng.normal(size=getattr(problem, name).shape)
    for name in ("W", "M", "H"):
        if (matrix := getattr(problem, name, None)) is None:
            continue
        dense = matrix.toarray()
        change = 0.1 * rng.normal(size=dense.shape)
        if name != "H":
            change = change + change.T
        found[name] = np.where(dense != 0, change, 0)
    return found


def moved(problem: Any, change: dict[str, Any], step: float) -> Any:
    def plus(name: str, value: Any) -> Any:
        old = getattr(problem, name)
        old = old.toarray() if hasattr(old, "toarray") else old
        return old + step * value

    return problem.replace(**{name: plus(name, value) for name, value in change.items()})


def with_rolling(seed: int, d: int, nc: int, p: int) -> Any:
    return planted_local(seed=seed, d=d, nc=nc, p=p, rolling=True)


def with_spin(seed: int, d: int, nc: int, p: int) -> Any:
    """D = 4 with p = 1 is the ellipsoid."""
    law = "ellipsoid" if p else "product"
    problem, r = planted_spin(law, d, seed, nc=nc, edges=False)
    problem = problem.replace(W=sp.csr_array(problem.W))
    return SimpleNamespace(problem=problem, solution=fclib.Solution(r=r))


def problems() -> list[Any]:
    laws = [(with_rolling, 3, 0), (with_rolling, 5, 3), (with_spin, 4, 0), (with_spin, 6, 0)]
    laws.append((with_spin, 4, 1))
    return [pytest.param(*law, id=f"{law[0].__name__}-{law[1]}-{law[2]}") for law in laws] + [
        pytest.param(kind, d, p, id=f"{kind.__name__[8:]}-{d}D-{'mixed' if p else 'plain'}")
        for kind in (planted_local, planted_global)
        for d in (2, 3)
        for p in (0, 3)
    ]


def solved(problem: Any, guess: Any) -> Any:
    result = fclib.solve(problem, tol=1e-14, guess=guess)
    assert result.error < 1e-11
    return result.solution


@pytest.mark.parametrize(("kind", "d", "p"), problems())
def test_forward_is_the_difference_of_solutions(kind: Any, d: int, p: int) -> None:
    planted = kind(seed=5, d=d, nc=6, p=p)
    problem = planted.problem
    solution = solved(problem, planted.solution)
    for seed, names in enumerate(
        (None, "mu", "mu_s", "mu_r", "q", "W", "f", "w", "M", "H", "s", "b")
    ):
        change = changes(problem, seed)
        if names is not None:
            change = {name: value for name, value in change.items() if name == names}
        if not change:
            continue
        tangent = fclib.jvp(problem, solution, **change)
        assert tangent.unique
        assert not tangent.degenerate.any()
        one = solved(moved(problem, change, STEP), solution)
        other = solved(moved(problem, change, -STEP), solution)
        for name in ("r", "u", "v", "l"):
            expected = getattr(one, name)
            if expected is None:
                assert getattr(tangent, name) is None
                continue
            difference = (expected - getattr(other, name)) / (2 * STEP)
            scale = 1e-5 * (1 + np.abs(difference).max())
            assert np.abs(getattr(tangent, name) - difference).max() < scale, (names, name)


@pytest.mark.parametrize(("kind", "d", "p"), problems())
def test_adjoint_is_the_transpose_of_forward(kind: Any, d: int, p: int) -> None:
    planted = kind(seed=7, d=d, nc=6, p=p)
    problem, solution = planted.problem, planted.solution
    change = changes(problem, 3)
    tangent = fclib.jvp(problem, solution, **change)
    rng = np.random.default_rng(0)
    weights = {
        name: rng.normal(size=getattr(tangent, name).shape)
        for name in ("r", "u", "v", "l")
        if getattr(tangent, name) is not None
    }
    gradient = fclib.vjp(problem, solution, **weights)

    def inner(a: Any, b: Any) -> float:
        a = a.toarray() if hasattr(a, "toarray") else a
        return float(np.sum(a * b))

    forward = sum(inner(getattr(tangent, name), value) for name, value in weights.items())
    adjoint = sum(inner(getattr(gradient, name), value) for name, value in change.items())
    assert adjoint == pytest.approx(forward, rel=1e-9)


def test_borders_are_flagged_with_the_derivative_of_one_side() -> None:
    # at rest on the limit of friction: pushed on it slides, pushed back it sticks
    problem = fclib.LocalProblem(W=np.eye(3), q=[-1, 0.5, 0], mu=[0.5])
    tangent = fclib.jvp(problem, [1, -0.5, 0], q=[0, 1, 0])
    assert tangent.degenerate.tolist() == [True]
    slides, sticks = np.allclose(tangent.r, 0), np.allclose(tangent.r, [0, -1, 0])
    assert slides or sticks
    # a contact that grazes
    grazing = fclib.LocalProblem(W=np.eye(3), q=[0, 0.5, 0], mu=[0.5])
    assert fclib.jvp(grazing, np.zeros(3), q=[1, 0, 0]).degenerate.all()


@pytest.mark.parametrize("noise", [0.0, 1e-15, 1e-12, 1e-9])
def test_rounding_gives_no_direction_of_sliding(noise: float) -> None:
    """At rest at the limit of friction: the derivative is that of sticking, or that of sliding."""
    rng = np.random.default_rng(3)
    t = np.array([0, np.cos(0.7), np.sin(0.7)])
    r = np.array([1, 0, 0]) - 0.5 * t
    for _ in range(30):
        A = rng.normal(size=(3, 3))
        W = A @ A.T + 0.1 * np.eye(3)
        q = -W @ r + noise * np.append(0, rng.normal(size=2))
        sliding = fclib.jvp(fclib.LocalProblem(W=W, q=q + 1e-5 * t, mu=[0.5]), r, mu=[1.0])
        assert not sliding.degenerate.any()
        whole = fclib.jvp(fclib.LocalProblem(W=W, q=q, mu=[0.5]), r, mu=[1.0])
        batch = fclib.jvp_batch(W[None], q[None], 0.5, r[None], dmu=np.ones((1, 1)))
        # two contacts are not solved in closed form
        twice = np.kron(np.eye(2), W)[None]
        pair = fclib.jvp_batch(
            twice, np.tile(q, 2)[None], 0.5, np.tile(r, 2)[None], dmu=np.ones((1, 2))
        )
        for dr in (whole.r, batch.r[0], pair.r[0, :3], pair.r[0, 3:]):
            assert min(abs(dr).max(), abs(dr - sliding.r).max()) < 1e-3
        assert whole.degenerate.all()
        assert batch.degenerate.all()
        assert pair.degenerate.all()


@pytest.mark.parametrize("noise", [0.0, 1e-15, 1e-12, 1e-9])
def test_rounding_gives_no_direction_on_an_ellipsoid(noise: float) -> None:
    rng = np.random.default_rng(5)
    e = np.array([0.5, 0.5, 0.2])  # of the two tangents and of spin
    for _ in range(30):
        w = rng.normal(size=3)
        r = np.append(1, -e * e * w / np.linalg.norm(e * w))
        A = rng.normal(size=(4, 4))
        W = A @ A.T + 0.1 * np.eye(4)
        given: Any = {"W": W, "mu": [0.5], "mu_s": [0.2], "coupled": 1, "spacedim": 4}
        q = -W @ r + noise * np.append(0, rng.normal(size=3))
        away = 1e-4 * np.append(0, w)
        sliding = fclib.jvp(fclib.LocalSpinProblem(q=q + away, **given), r, mu=[1.0])
        assert not sliding.degenerate.any()
        found = fclib.jvp(fclib.LocalSpinProblem(q=q, **given), r, mu=[1.0])
        assert found.degenerate.all()
        size = max(1.0, abs(sliding.r).max())
        assert min(abs(found.r).max(), abs(found.r - sliding.r).max()) < 1e-2 * size


def test_an_ellipsoid_without_friction_has_the_derivative_of_none() -> None:
    spin = fclib.LocalSpinProblem(
        spacedim=4, W=np.eye(4), q=[-1, 0.7, 0, 1], mu=[0], mu_s=[0], coupled=True
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tangent = fclib.jvp(spin, [1, 0, 0, 0], q=np.ones(4))
    np.testing.assert_allclose(tangent.r, [-1, 0, 0, 0])
    assert not tangent.degenerate.any()
    at_rest = spin.replace(q=[-1, 0, 0, 0])
    assert fclib.jvp(at_rest, [1, 0, 0, 0], q=np.ones(4)).degenerate.all()


def test_no_contacts_have_derivatives_of_each_law() -> None:
    none: dict[str, Any] = {"W": np.zeros((0, 0)), "q": [], "mu": []}
    for problem in (
        fclib.LocalProblem(**none),
        fclib.LocalRollingProblem(**none, spacedim=5, mu_r=[]),
        fclib.LocalSpinProblem(**none, spacedim=4, mu_s=[]),
        fclib.LocalSpinProblem(**none, spacedim=6, mu_s=[], mu_r=[]),
    ):
        gradient = fclib.vjp(problem, fclib.solve(problem), r=[])
        assert gradient.mu.shape == (0,)
        assert gradient.unique


def test_redundant_contacts_leave_u_determined() -> None:
    rng = np.random.default_rng(0)
    h = rng.normal(size=(3, 9))
    q = h.T @ [-1.0, 0.2, 0.1]
    q[::3] = -np.abs(q[::3])
    problem = fclib.LocalProblem(W=h.T @ h, q=q, mu=[0.9] * 3)
    result = fclib.solve(problem, tol=1e-12)
    change = h.T @ rng.normal(size=3)
    tangent = fclib.jvp(problem, result, q=change)
    other = fclib.solve(problem.replace(q=q + 1e-6 * change), tol=1e-12)
    assert other.solution.u is not None
    assert result.solution.u is not None
    difference = (other.solution.u - result.solution.u) / 1e-6
    assert np.abs(tangent.u - difference).max() < 1e-3


def test_derivatives_are_values() -> None:
    planted: Any = planted_global(seed=0, nc=3)
    problem, solution = planted.problem, planted.solution
    change = {"f": np.arange(problem.n, dtype=float)}
    tangents = [fclib.jvp(problem, solution, **change) for _ in range(2)]
    gradients = [fclib.vjp(problem, solution, r=np.ones(problem.m)) for _ in range(2)]
    for one, again in (tangents, gradients):
        assert one == again
        assert hash(one) == hash(again)
        assert pickle.loads(pickle.dumps(one)) == copy.deepcopy(one) == one
    assert tangents[0] != fclib.jvp(problem, solution, f=2 * change["f"])
    other = fclib.vjp(problem, solution, r=2 * np.ones(problem.m))
    assert gradients[0] != other
    assert gradients[0] != tangents[0]
    assert gradients[0] != dataclasses.replace(gradients[0], H=other.H)


def test_wrong_input_is_refused_by_its_name() -> None:
    planted: Any = planted_local(seed=0, nc=3)
    problem, solution = planted.problem, planted.solution
    with pytest.raises(fclib.ProblemError, match="f: this problem has no such datum"):
        fclib.jvp(problem, solution, f=np.zeros(3))
    with pytest.raises(fclib.ProblemError, match="q: has the shape"):
        fclib.jvp(problem, solution, q=np.zeros(3))
    with pytest.raises(fclib.ProblemError, match="v: has the shape"):
        fclib.vjp(problem, solution, v=np.zeros(3))
    with pytest.raises(fclib.ProblemError, match="mu_s: this problem has no such datum"):
        fclib.jvp(problem, solution, mu_s=np.zeros(3))


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ([np.nan, 0, 0], "not a finite number"),
        ([1j, 0, 0], "not an array of real numbers"),
        ("abc", "not an array of real numbers"),
        ([[1], [2, 3]], "not an array of numbers"),
        (np.ma.array([1.0, 0, 0], mask=[True, False, False]), "masked"),
    ],
)
def test_what_is_no_number_is_refused(values: Any, said: str) -> None:
    problem = fclib.LocalProblem(W=np.eye(3), q=[-1, 0.2, 0], mu=[0.5])
    solution = fclib.solve(problem)
    with pytest.raises(fclib.ProblemError, match=f"^q: .*{said}"):
        fclib.jvp(problem, solution, q=values)
    with pytest.raises(fclib.ProblemError, match=f"^r: .*{said}"):
        fclib.vjp(problem, solution, r=values)


def test_a_solution_that_is_none_is_told_by_its_error() -> None:
    problem = fclib.LocalProblem(W=np.eye(3), q=[-1, 0.2, 0], mu=[0.5])
    assert fclib.jvp(problem, fclib.solve(problem), q=problem.q).error <= 1e-8
    assert fclib.jvp(problem, np.zeros(3), q=problem.q).error > 0.5
    assert fclib.vjp(problem, np.zeros(3), r=problem.q).error > 0.5
    with pytest.raises(fclib.ProblemError, match=r"r\[0\]: .*finite"):
        fclib.jvp(problem, [np.nan, 0, 0], q=problem.q)


def test_matrices_without_a_scale() -> None:
    still = fclib.LocalProblem(W=np.zeros((3, 3)), q=[1, 0.2, 0], mu=[0.5])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tangent = fclib.jvp(still, np.zeros(3), q=[1, 2, 3])
    np.testing.assert_array_equal(tangent.u, [1, 2, 3])
    assert not tangent.r.any()
    massless = fclib.GlobalProblem(
        M=np.diag([1.0, 1, 0]), H=np.eye(3), f=np.ones(3), w=np.zeros(3), mu=[0.5]
    )
    with pytest.raises(fclib.UnsuitableError, match="M is not positive definite"):
        fclib.jvp(massless, np.zeros(3), f=np.ones(3))


@pytest.mark.parametrize(
    ("coefficients", "q"),
    [
        ((0.0, 0.5), [-1.0, 0.5, 0.0, 0.2]),  # it slides freely, and the spin sticks
        ((0.5, 0.0), [-1.0, 0.2, 0.1, 0.4]),  # it spins freely, and sticks
        ((0.0, 0.5), [-1.0, 0.5, 0.3, 0.9]),
        ((0.5, 0.0), [-1.0, 0.9, 0.3, 0.2]),
    ],
)
def test_an_ellipsoid_with_one_coefficient_of_zero(
    coefficients: tuple[float, float], q: list[float]
) -> None:
    """What has no friction moves freely; the rest sticks or slides as if it were alone."""
    A = np.random.default_rng(1).standard_normal((4, 4))
    mu, mu_s = coefficients
    problem = fclib.LocalSpinProblem(
        spacedim=4, W=np.eye(4) + 0.1 * A @ A.T, q=q, mu=[mu], mu_s=[mu_s], coupled=True
    )

    def solved(**changes: Any) -> Any:
        return fclib.solve(problem.replace(**changes), tol=1e-15).solution

    at = solved()
    for k in range(4):
        step = 1e-6 * np.eye(4)[k]
        difference = solved(q=problem.q + step).r - solved(q=problem.q - step).r
        tangent = fclib.jvp(problem, at, q=np.eye(4)[k])
        np.testing.assert_allclose(tangent.r, difference / 2e-6, atol=1e-7)
        assert not tangent.degenerate.any()
    # the coefficient of zero can only grow
    name = "mu" if mu == 0 else "mu_s"
    grown = solved(**{name: [1e-7]})
    tangent = fclib.jvp(problem, at, **{name: [1.0]})
    np.testing.assert_allclose(tangent.r, (grown.r - at.r) / 1e-7, atol=1e-6)
    np.testing.assert_allclose(tangent.u, (grown.u - at.u) / 1e-7, atol=1e-6)
