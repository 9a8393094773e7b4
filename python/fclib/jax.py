"""Contact problems in JAX: for jit, vmap, grad and jvp.

>>> import fclib.jax
>>> r, u = fclib.jax.solve(W, q, mu)
>>> jax.grad(lambda mu: (fclib.jax.solve(W, q, mu)[1] ** 2).sum())(mu)
"""

from __future__ import annotations

from functools import partial
from typing import Any, NoReturn

import jax
import jax.numpy as jnp
import numpy as np

from fclib import _core, _layer

__all__ = ["solve"]


def solve(
    W: Any,
    q: Any,
    mu: Any,
    *,
    spacedim: int = 3,
    tol: float = 1e-10,
    threads: int = 1,
    status: bool = False,
) -> tuple[Any, ...]:
    """Reactions and velocities of local problems, as ``fclib.solve_batch`` finds them.

    It is a callback of the host, with the derivatives of ``fclib.vjp`` and ``fclib.jvp``, but no
    second ones. Inside all is computed in double precision. The result has the common type of W, q
    and mu, which is single if ``jax_enable_x64`` is not set. Derivatives are those at the r that is
    returned: in single precision they are coarse for a contact that slides slowly.

    W is (..., m, m), q (..., m) and mu (..., nc); their leading sizes are broadcast. The other
    arguments are those of ``fclib.solve_batch``, numbers and not traced; gradients need a tol far
    below 1e-6.

    On a machine with one core, callbacks of JAX with large arrays wait for ever under ``jit``. Set
    the environment variable NPROC to 2 there, before JAX is imported.

    A problem that is not valid, has no solution or is not solved to tol has NaN for r and u, and
    does not disturb the others. To leave such problems out of a loss, take
    ``jnp.where((status == 0)[..., None], r, 0)``, and u likewise: their gradients are then zeros.

    Returns:
        r and u, (..., m). With ``status``, also (...) places in ``fclib.BatchResult.statuses``; 0
        is converged.

    Raises:
        ProblemError: shapes do not agree, or numbers are complex.
        OptionError: tol or threads is out of range, or traced.
        UnsuitableError: a second derivative is asked for.
    """
    W, q, mu = (jnp.asarray(one) for one in (W, q, mu))
    batch = _layer.check_shapes(W.shape, q.shape, mu.shape, spacedim)
    _layer.check_options(tol, threads)
    for name, one in (("W", W), ("q", q), ("mu", mu)):
        if jnp.iscomplexobj(one):
            _layer.refuse_complex(name)
    kind = jnp.result_type(W, q, mu)
    if not jnp.issubdtype(kind, jnp.floating):
        kind = jnp.result_type(float)
    m = q.shape[-1]
    found: tuple[Any, ...] = _solve(
        spacedim,
        tol,
        threads,
        jnp.broadcast_to(W.astype(kind), (*batch, m, m)),
        jnp.broadcast_to(q.astype(kind), (*batch, m)),
        jnp.broadcast_to(mu.astype(kind), (*batch, m // spacedim)),
    )
    return found if status else found[:2]


@partial(jax.custom_jvp, nondiff_argnums=(0, 1, 2))
def _solve(spacedim: int, tol: float, threads: int, W: Any, q: Any, mu: Any) -> tuple[Any, ...]:
    shape = jax.ShapeDtypeStruct(q.shape, q.dtype)
    statuses = jax.ShapeDtypeStruct(q.shape[:-1], np.int32)

    def call(*given: Any) -> tuple[Any, ...]:
        W, q, mu = _doubles(given)
        r, u, status = _layer.forward(W, q, mu, spacedim, tol, threads)
        return r.astype(shape.dtype), u.astype(shape.dtype), status

    found = jax.pure_callback(call, (shape, shape, statuses), W, q, mu, vmap_method="broadcast_all")
    return tuple(found)


@_solve.defjvp  # type: ignore[untyped-decorator, unused-ignore]
def _solve_jvp(spacedim: int, tol: float, threads: int, at: Any, change: Any) -> Any:
    """The rest is products of matrices, which JAX transposes and maps by itself."""
    W, q, mu = at
    dW, dq, dmu = change
    r, u, status = _solve(spacedim, tol, threads, W, q, mu)
    by_q, by_mu = _sensitivities(spacedim, threads, W, q, mu, r)
    # a problem without a solution, left out of a loss, must not make 0 times NaN
    solved = (status == 0)[..., None]
    r_or_zero = jnp.where(solved, r, 0)
    W_or_zero = jnp.where(solved[..., None], W, 0)
    moved = _told(solved, dq + _times(dW, r_or_zero))
    dr = _told(solved, _times(by_q, moved) + _times(by_mu, _told(solved, dmu)))
    du = _told(solved, _times(W_or_zero, dr) + moved)
    nothing = np.zeros(status.shape, dtype=jax.dtypes.float0)
    return (r, u, status), (dr, du, nothing)


def _told(solved: Any, change: Any) -> Any:
    """The change, but NaN for one of a problem that is not solved, in both directions.

    No change stays none: who leaves such a problem out of a loss gets zeros.
    """

    def own(_: Any, change: Any) -> Any:
        return jnp.where(solved | (change == 0), change, jnp.nan)

    # JAX takes it for a linear function that is its own transpose, and does not look into it
    return jax.lax.custom_linear_solve(lambda x: x, change, own, symmetric=True)


@partial(jax.custom_jvp, nondiff_argnums=(0, 1))
def _sensitivities(spacedim: int, threads: int, W: Any, q: Any, mu: Any, r: Any) -> Any:
    shapes = (
        jax.ShapeDtypeStruct(W.shape, W.dtype),
        jax.ShapeDtypeStruct((*q.shape, mu.shape[-1]), W.dtype),
    )

    def call(*given: Any) -> tuple[Any, ...]:
        W, q, mu, r = _doubles(given)
        found = _layer.sensitivities(W, q, mu, r, spacedim, threads)
        return tuple(one.astype(shapes[0].dtype) for one in found)

    return jax.pure_callback(call, shapes, W, q, mu, r, vmap_method="broadcast_all")


@_sensitivities.defjvp  # type: ignore[untyped-decorator, unused-ignore]
def _no_second_derivative(spacedim: int, threads: int, at: Any, change: Any) -> NoReturn:
    raise _core.UnsuitableError(_layer.ONCE.format("fclib.jax.solve"))


def _times(matrix: Any, vector: Any) -> Any:
    return jnp.einsum("...ij,...j->...i", matrix, vector)


def _doubles(given: Any) -> list[Any]:
    return [np.asarray(one, dtype=np.float64) for one in given]
