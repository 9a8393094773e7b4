"""Solving as a layer: gradients of batches, in NumPy, PyTorch and JAX, against differences."""

from typing import Any

import numpy as np
import pytest

import fclib
from fclib import _layer
from helpers import planted_local


def batch(count: int = 3, nc: int = 3, d: int = 3) -> tuple[Any, Any, Any]:
    """Problems with contacts of all three statuses, none on a border."""
    problems: Any = [planted_local(seed=seed, nc=nc, d=d).problem for seed in range(count)]
    W = np.stack([one.with_storage("dense").W for one in problems])
    return W, np.stack([one.q for one in problems]), np.stack([one.mu for one in problems])


def weights(shape: tuple[int, ...]) -> tuple[Any, Any]:
    rng = np.random.default_rng(1)
    return rng.normal(size=shape), rng.normal(size=shape)


@pytest.mark.parametrize("d", [2, 3])
def test_the_gradient_is_that_of_differences(d: int) -> None:
    W, q, mu = batch(d=d)
    by_r, by_u = weights(q.shape)

    def loss(W: Any, q: Any, mu: Any) -> float:
        r, u = _layer.forward(W, q, mu, d, 1e-13, 1)
        return float((by_r * r).sum() + (by_u * u).sum())

    r, _ = _layer.forward(W, q, mu, d, 1e-13, 1)
    found = _layer.backward(W, q, mu, r, d, by_r, by_u)
    rng = np.random.default_rng(2)
    for place, (value, gradient) in enumerate(zip((W, q, mu), found, strict=True)):
        change = rng.normal(size=value.shape)
        change = change + change.swapaxes(1, 2) if place == 0 else change
        sides = []
        for step in (1e-6, -1e-6):
            data = [W, q, mu]
            data[place] = value + step * change
            sides.append(loss(*data))
        expected = (sides[0] - sides[1]) / 2e-6
        assert (gradient * change).sum() == pytest.approx(expected, rel=1e-5, abs=1e-6)


def test_wrong_shapes_and_unsolved_problems_are_named() -> None:
    shapes = _layer.check_shapes
    assert shapes((6, 6), (4, 6), (2,), 3) == (4,)
    with pytest.raises(fclib.ProblemError, match=r"mu: has the shape \(3,\), expected \(..., 2\)"):
        shapes((6, 6), (6,), (3,), 3)
    with pytest.raises(fclib.ProblemError, match=r"W: has the shape \(5, 6\)"):
        shapes((5, 6), (6,), (2,), 3)
    with pytest.raises(fclib.ProblemError, match="leading sizes"):
        shapes((2, 6, 6), (3, 6), (2,), 3)
    with pytest.raises(fclib.ProblemError, match=r"q: has the shape \(5,\)"):
        shapes((5, 5), (5,), (1,), 3)
    W = np.stack([np.eye(3), np.zeros((3, 3))])
    with pytest.raises(fclib.SolverError, match="problem 1 of 2: infeasible"):
        _layer.forward(W, np.full((2, 3), -1.0), np.full((2, 1), 0.5), 3, 1e-10, 1)


def test_torch_agrees_with_differences() -> None:
    torch = pytest.importorskip("torch")
    import fclib.torch

    W, q, mu = (torch.tensor(one, requires_grad=True) for one in batch(count=2, nc=2))
    half = W.detach() / 2

    def both(half: Any, q: Any, mu: Any) -> Any:
        return fclib.torch.solve(half + half.mT, q, mu, tol=1e-13)

    given = (half.requires_grad_(), q, mu)
    assert torch.autograd.gradcheck(both, given, eps=1e-6, atol=1e-4, rtol=1e-4)
    # one W for all, and a gradient that is summed over them
    r, u = fclib.torch.solve(W[0], q, mu[0])
    assert r.shape == q.shape
    (r * u).sum().backward()
    assert W.grad.shape == W.shape
    single, _ = fclib.torch.solve(W[0], q[1], mu[0])
    torch.testing.assert_close(single, r[1])
    with pytest.raises(fclib.ProblemError, match="mu: has the shape"):
        fclib.torch.solve(W, q, mu[:, :1])


def test_jax_agrees_with_differences() -> None:
    jax = pytest.importorskip("jax")
    check_grads = pytest.importorskip("jax.test_util").check_grads
    import fclib.jax

    jax.config.update("jax_enable_x64", True)
    W, q, mu = batch(count=2, nc=2)
    half = W / 2

    def loss(half: Any, q: Any, mu: Any) -> Any:
        r, u = fclib.jax.solve(half + half.swapaxes(-1, -2), q, mu, tol=1e-13)
        return (r * u).sum() + (u**2).sum() + r.sum()

    check_grads(
        jax.jit(loss), (half, q, mu), order=1, modes=["rev"], eps=1e-6, atol=1e-4, rtol=1e-4
    )
    # vmap goes through as one batch, and grad through vmap
    whole = jax.grad(loss, argnums=(0, 1, 2))(half, q, mu)
    mapped = jax.vmap(jax.grad(loss, argnums=(0, 1, 2)))(half, q, mu)
    for one, other in zip(whole, mapped, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)
    r, _ = fclib.jax.solve(W[0], q, mu[0])
    assert r.shape == q.shape
    with pytest.raises(fclib.ProblemError, match="mu: has the shape"):
        fclib.jax.solve(W, q, mu[:, :1])
