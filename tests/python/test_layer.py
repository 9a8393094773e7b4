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
        r, u, _ = _layer.forward(W, q, mu, d, 1e-13, 1)
        return float((by_r * r).sum() + (by_u * u).sum())

    r, _, _ = _layer.forward(W, q, mu, d, 1e-13, 1)
    found = _layer.backward(W, q, mu, r, d, by_r, by_u, 1)
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


def test_wrong_shapes_are_named() -> None:
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


def test_no_contacts_are_solved_and_wrong_options_named() -> None:
    """Worlds in which nothing touches."""
    nothing = np.zeros((4, 0, 0)), np.zeros((4, 0)), np.zeros((4, 0))
    r, u, status = _layer.forward(*nothing, 3, 1e-10, 1)
    assert r.shape == u.shape == (4, 0)
    assert status.tolist() == [0] * 4
    by = _layer.backward(*nothing, r, 3, r, u, 1)
    assert [one.shape for one in by] == [(4, 0, 0), (4, 0), (4, 0)]
    dr, du = _layer.tangent(*nothing, r, 3, [None, r, None], 1)
    assert dr.shape == du.shape == (4, 0)
    by_q, by_mu = _layer.sensitivities(*nothing, r, 3, 1)
    assert (by_q.shape, by_mu.shape) == ((4, 0, 0), (4, 0, 0))
    with pytest.raises(fclib.OptionError, match="threads: -1"):
        _layer.check_options(1e-10, -1)
    with pytest.raises(fclib.OptionError, match="tol"):
        _layer.check_options(float("nan"), 1)


def worlds_with_bad_ones() -> tuple[Any, Any, Any]:
    """One that is solved, one without a solution, one that is no problem, one that is solved."""
    W = np.stack([np.eye(3), np.zeros((3, 3)), np.eye(3), 2 * np.eye(3)])
    q = np.array([[-1, 0.1, 0], [-1, 0, 0], [np.nan, 0, 0], [-1, 0, 3.0]])
    return W, q, np.full((4, 1), 0.5)


def test_a_bad_world_has_its_status_and_hurts_no_other() -> None:
    W, q, mu = worlds_with_bad_ones()
    r, u, status = _layer.forward(W, q, mu, 3, 1e-10, 1)
    names = [fclib.BatchResult.statuses[k] for k in status]
    assert names == ["converged", "infeasible", "invalid", "converged"]
    assert np.isnan(r[1:3]).all()
    assert np.isnan(u[1:3]).all()
    good = [0, 3]
    alone, _, _ = _layer.forward(W[good], q[good], mu[good], 3, 1e-10, 1)
    assert np.array_equal(r[good], alone)
    # left out of a loss, they have no gradient; asked for one, they say that there is none
    by = np.ones((4, 3))
    by[1:3] = 0
    found = _layer.backward(W, q, mu, r, 3, by, by, 1)
    for one in found:
        assert (one[1:3] == 0).all()
        assert np.isfinite(one).all()
    assert np.isnan(_layer.backward(W, q, mu, r, 3, np.ones((4, 3)), by, 1)[1][1:3]).all()


def test_a_whole_batch_has_no_loop_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """A call of the core for all of them, whatever their number."""
    calls: list[int] = []
    own = fclib._core.vjp_batch

    def counted(*arguments: Any, **named: Any) -> Any:
        calls.append(1)
        return own(*arguments, **named)

    monkeypatch.setattr(fclib._core, "vjp_batch", counted)
    W, q, mu = (np.concatenate([one] * 40) for one in batch(count=3, nc=2))
    r, _, _ = _layer.forward(W, q, mu, 3, 1e-12, 2)
    _layer.backward(W, q, mu, r, 3, *weights(q.shape), 2)
    assert len(calls) == 1


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


def test_torch_takes_what_becomes_a_tensor_and_gives_what_may_be_changed() -> None:
    torch = pytest.importorskip("torch")
    import fclib.torch

    q, mu = torch.tensor([-1.0, 3, 0]).double(), torch.tensor([0.5]).double()
    found = []
    for in_place in (False, True):
        W = torch.eye(3).double().requires_grad_()
        r, u = fclib.torch.solve(W, q, mu)
        if in_place:
            r *= 2  # the caller's own
        else:
            r = r * 2
        found.append(torch.autograd.grad(r.sum() + u.sum(), W)[0])
    torch.testing.assert_close(*found)
    r, _ = fclib.torch.solve(2 * np.eye(3), [-3, 1, 0], [1])
    assert r.tolist() == [1.5, -0.5, 0]
    half = q.to(torch.float16).requires_grad_()
    W = torch.eye(3).double().requires_grad_()
    (fclib.torch.solve(W, 300 * half, mu)[0] ** 2).sum().backward()
    assert torch.isfinite(W.grad).all()
    with pytest.raises(fclib.ProblemError, match="W: has complex numbers"):
        fclib.torch.solve(1j * W, q, mu)
    nothing = fclib.torch.solve(np.zeros((4, 0, 0)), np.zeros((4, 0)), np.zeros((4, 0)))
    assert [one.shape for one in nothing] == [(4, 0), (4, 0)]
    # an array may be changed before the gradient is asked for
    array = np.eye(3)
    sought = q.clone().requires_grad_()
    u = fclib.torch.solve(array, sought, mu)[1]
    array[:] = 0
    (by,) = torch.autograd.grad(u.sum(), sought)
    (own,) = torch.autograd.grad(fclib.torch.solve(np.eye(3), sought, mu)[1].sum(), sought)
    torch.testing.assert_close(by, own)
    with pytest.raises(fclib.ProblemError, match=r"mu: has the shape \(\)"):
        fclib.torch.solve(W, q, 0.5)


def test_torch_masks_bad_worlds_and_refuses_a_second_derivative() -> None:
    torch = pytest.importorskip("torch")
    import fclib.torch

    W, q, mu = (torch.tensor(one, requires_grad=True) for one in worlds_with_bad_ones())
    r, u, status = fclib.torch.solve(W, q, mu, status=True)
    assert status.tolist() == [0, 7, 8, 0]
    r, u = (torch.where((status == 0)[:, None], one, 0) for one in (r, u))
    loss = (r * r + u).sum()
    by = torch.autograd.grad(loss, (W, q, mu), create_graph=True)
    for one in by:
        assert torch.isfinite(one).all()
        assert (one[1:3] == 0).all()
        assert (one[0] != 0).any() or (one[3] != 0).any()
    with pytest.raises(fclib.UnsuitableError, match=r"fclib\.torch\.solve: has first derivatives"):
        torch.autograd.grad(by[1].sum(), q)
    # forward mode
    given = [torch.tensor(one) for one in batch(count=2, nc=2)]
    change = [
        torch.tensor(np.random.default_rng(k).normal(size=g.shape)) for k, g in enumerate(given)
    ]
    with torch.autograd.forward_ad.dual_level():
        dual = [
            torch.autograd.forward_ad.make_dual(g, c) for g, c in zip(given, change, strict=True)
        ]
        _, u = fclib.torch.solve(*dual, tol=1e-13)
        du = torch.autograd.forward_ad.unpack_dual(u).tangent
    sides = [
        fclib.torch.solve(*(g + s * c for g, c in zip(given, change, strict=True)), tol=1e-13)[1]
        for s in (1e-6, -1e-6)
    ]
    torch.testing.assert_close(du, (sides[0] - sides[1]) / 2e-6, rtol=1e-4, atol=1e-4)


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
        jax.jit(loss), (half, q, mu), order=1, modes=["rev", "fwd"], eps=1e-6, atol=1e-4, rtol=1e-4
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


def test_jax_tells_that_a_problem_is_not_solved() -> None:
    """Who leaves it in a loss gets no finite gradient, in both modes."""
    jax = pytest.importorskip("jax")
    import fclib.jax

    jax.config.update("jax_enable_x64", True)
    W, q, mu = worlds_with_bad_ones()

    def loss(W: Any, q: Any, mu: Any) -> Any:
        return fclib.jax.solve(W, q, mu)[0].sum(axis=-1)

    by = jax.jacrev(loss, argnums=1)(W, q, mu)
    own = np.array([by[k, k] for k in range(4)])
    assert np.isnan(own).any(axis=1).tolist() == [False, True, True, False]
    assert np.isfinite(by[[0, 0, 3, 3], [1, 2, 1, 2]]).all()  # others are not disturbed
    _, change = jax.jvp(lambda mu: loss(W, q, mu), (mu,), (np.ones_like(mu),))
    assert np.isnan(change).tolist() == [False, True, True, False]
    with pytest.raises(fclib.OptionError, match="tol"):
        jax.jit(lambda tol: fclib.jax.solve(W, q, mu, tol=tol))(1e-8)
    with pytest.raises(fclib.ProblemError, match="q: has complex numbers"):
        fclib.jax.solve(W, 1j * q, mu)
    nothing = fclib.jax.solve(np.zeros((4, 0, 0)), np.zeros((4, 0)), np.zeros((4, 0)))
    assert [one.shape for one in nothing] == [(4, 0), (4, 0)]
    assert fclib.jax.solve(2 * np.eye(3, dtype=int), [-3, 1, 0], [1])[0].tolist() == [1.5, -0.5, 0]


def test_jax_masks_bad_worlds_and_refuses_a_second_derivative() -> None:
    jax = pytest.importorskip("jax")
    import jax.numpy as jnp

    import fclib.jax

    jax.config.update("jax_enable_x64", True)

    def loss(W: Any, q: Any, mu: Any) -> Any:
        r, u, status = fclib.jax.solve(W, q, mu, status=True)
        r, u = (jnp.where((status == 0)[..., None], one, 0) for one in (r, u))
        return (r * r + u).sum()

    W, q, mu = worlds_with_bad_ones()
    by = jax.jit(jax.grad(loss, argnums=(0, 1, 2)))(W, q, mu)
    for one in by:
        assert np.isfinite(one).all()
        assert (one[1:3] == 0).all()
        assert (one[0] != 0).any() or (one[3] != 0).any()
    statuses = jax.vmap(lambda *one: fclib.jax.solve(*one, status=True)[2])(W, q, mu)
    assert statuses.tolist() == [0, 7, 8, 0]
    with pytest.raises(fclib.UnsuitableError, match=r"fclib\.jax\.solve: has first derivatives"):
        jax.grad(lambda q: jax.grad(loss, argnums=1)(W, q, mu)[0].sum())(q)
    # the change of one direction, of all directions at once, and by differences
    W, q, mu = batch(count=2, nc=2)
    change = np.random.default_rng(0).normal(size=q.shape)

    def velocity(q: Any) -> Any:
        return fclib.jax.solve(W, q, mu, tol=1e-13)[1]

    _, du = jax.jvp(velocity, (q,), (change,))
    jacobian = jax.jacfwd(velocity)(q)
    np.testing.assert_allclose(jnp.einsum("kiln,ln->ki", jacobian, change), du, atol=1e-9)
    differences = (velocity(q + 1e-6 * change) - velocity(q - 1e-6 * change)) / 2e-6
    np.testing.assert_allclose(du, differences, rtol=1e-4, atol=1e-4)
