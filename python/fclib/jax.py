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


def solve(
    W: Any, q: Any, mu: Any, *, spacedim: int = 3, tol: float = 1e-10, threads: int = 1
) -> tuple[Any, Any]:
    """Reactions and velocities of local problems, u = W r + q with Coulomb's law.

    A callback of the host, with a derivative in reverse mode: that of ``fclib.vjp``, by one element
    of the generalised Jacobian where a contact grazes or rests on the limit of friction, by the
    least change of r where redundant contacts leave r undetermined. Inside all is computed in
    double precision; the result is of q's type, single where ``jax_enable_x64`` is not set.

    Args:
        W: (..., m, m), m = spacedim * nc. Leading sizes are broadcast with those of q and mu.
        q: (..., m)
        mu: (..., nc)
        spacedim: 3, or 2 for planar problems.
        tol: bound on ``Merit.error``; gradients need one far below 1e-6.
        threads: that share a batch, 0 for all.

    Returns:
        r and u, (..., m).

    Raises:
        ProblemError: shapes that do not agree. Inside the callback, where JAX makes them errors of
            its own: entries that are not finite, a negative mu.
        SolverError: the same, where a problem was not solved to the tolerance.
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
