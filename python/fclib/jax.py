"""Contact problems in JAX: for jit, vmap and grad.

>>> import fclib.jax
>>> r, u = fclib.jax.solve(W, q, mu)
>>> jax.grad(lambda mu: (fclib.jax.solve(W, q, mu)[1] ** 2).sum())(mu)
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from fclib import _layer

__all__ = ["solve"]


def solve(
    W: Any, q: Any, mu: Any, *, spacedim: int = 3, tol: float = 1e-10, threads: int = 1
) -> tuple[Any, Any]:
    """Reactions and velocities of local problems, as ``fclib.solve_batch`` finds them.

    It is a callback of the host, with the derivative of ``fclib.vjp`` in reverse mode. Inside all
    is computed in double precision. The result has the common type of W, q and mu, which is single
    if ``jax_enable_x64`` is not set.

    W is (..., m, m), q (..., m) and mu (..., nc); their leading sizes are broadcast. The other
    arguments are those of ``fclib.solve_batch``; gradients need a tol far below 1e-6.

    Returns:
        r and u, (..., m).

    Raises:
        ProblemError: shapes do not agree. For errors inside the callback (wrong entries, problems
            that are not solved) JAX raises its own errors.
    """
    W, q, mu = (jnp.asarray(one) for one in (W, q, mu))
    batch = _layer.check_shapes(W.shape, q.shape, mu.shape, spacedim)
    kind = jnp.result_type(W, q, mu, jnp.float32)
    m = q.shape[-1]
    found: tuple[Any, Any] = _solve(
        spacedim,
        tol,
        threads,
        jnp.broadcast_to(W.astype(kind), (*batch, m, m)),
        jnp.broadcast_to(q.astype(kind), (*batch, m)),
        jnp.broadcast_to(mu.astype(kind), (*batch, m // spacedim)),
    )
    return found


@partial(jax.custom_vjp, nondiff_argnums=(0, 1, 2))
def _solve(spacedim: int, tol: float, threads: int, W: Any, q: Any, mu: Any) -> tuple[Any, Any]:
    shape = jax.ShapeDtypeStruct(q.shape, q.dtype)

    def call(*given: Any) -> tuple[Any, ...]:
        W, q, mu = _doubles(given)
        found = _layer.forward(W, q, mu, spacedim, tol, threads)
        return tuple(one.astype(shape.dtype) for one in found)

    found = jax.pure_callback(call, (shape, shape), W, q, mu, vmap_method="broadcast_all")
    return found[0], found[1]


def _forward(spacedim: int, tol: float, threads: int, W: Any, q: Any, mu: Any) -> tuple[Any, Any]:
    found = _solve(spacedim, tol, threads, W, q, mu)
    return found, (W, q, mu, found[0])


def _backward(spacedim: int, tol: float, threads: int, kept: Any, by: Any) -> Any:
    shapes = tuple(jax.ShapeDtypeStruct(one.shape, one.dtype) for one in kept[:3])

    def call(*given: Any) -> tuple[Any, ...]:
        W, q, mu, r, by_r, by_u = _doubles(given)
        found = _layer.backward(W, q, mu, r, spacedim, by_r, by_u)
        return tuple(one.astype(shapes[0].dtype) for one in found)

    return jax.pure_callback(call, shapes, *kept, *by, vmap_method="broadcast_all")


_solve.defvjp(_forward, _backward)


def _doubles(given: Any) -> list[Any]:
    return [np.asarray(one, dtype=np.float64) for one in given]
