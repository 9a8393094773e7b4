"""Solving as a layer of a network: batches of local problems, and the gradient of a loss.

It uses plain arrays; ``fclib.torch`` and ``fclib.jax`` connect it to their differentiation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NoReturn, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib import _core
from fclib._batch import solve_batch
from fclib._batch_derivatives import jvp_batch, sensitivities_batch, vjp_batch
from fclib._solve import check_limits

Floats: TypeAlias = npt.NDArray[np.float64]
Statuses: TypeAlias = npt.NDArray[np.int32]

ONCE = "{}: has first derivatives only; a second derivative would have to go through its gradient"


def check_shapes(
    W: tuple[int, ...], q: tuple[int, ...], mu: tuple[int, ...], spacedim: int
) -> tuple[int, ...]:
    """The shape of the batch, () for one problem. ProblemError if shapes do not agree."""
    if spacedim not in (2, 3):
        raise _core.ProblemError(f"spacedim: is {spacedim}, expected 2 or 3")
    if not q or q[-1] % spacedim:
        raise _core.ProblemError(f"q: has the shape {q}, expected (..., {spacedim} nc)")
    m = q[-1]
    for name, shape, own in (("W", W, (m, m)), ("mu", mu, (m // spacedim,))):
        if shape[len(shape) - len(own) :] != own:
            wanted = ", ".join(str(size) for size in own)
            raise _core.ProblemError(
                f"{name}: has the shape {shape}, expected (..., {wanted}) as q has {m} entries"
            )
    try:
        return np.broadcast_shapes(W[:-2], q[:-1], mu[:-1])
    except ValueError:
        raise _core.ProblemError(
            f"W, q, mu: their leading sizes {W[:-2]}, {q[:-1]} and {mu[:-1]} do not agree"
        ) from None


def check_options(tol: float, threads: int) -> None:
    """OptionError if one is out of range, or no number, as one that is traced."""
    check_limits(tol, None, threads=threads)


def refuse_complex(name: str) -> NoReturn:
    """For a type of numbers that no problem has."""
    raise _core.ProblemError(f"{name}: has complex numbers, expected real ones")


def _batch(q: Floats, *sizes: int) -> tuple[int, ...]:
    """The shape of an array with a row for each problem, which may have no entry."""
    return (math.prod(q.shape[:-1]), *sizes)


def forward(
    W: Floats, q: Floats, mu: Floats, spacedim: int, tol: float, threads: int
) -> tuple[Floats, Floats, Statuses]:
    """Find r and u of problems whose leading sizes are equal, and the status of each.

    A problem that is not solved has NaN for r and u, so that nobody takes them for a solution.
    """
    m = q.shape[-1]
    found = solve_batch(
        W.reshape(_batch(q, m, m)),
        q.reshape(_batch(q, m)),
        mu.reshape(_batch(q, m // spacedim)),
        spacedim=spacedim,
        tol=tol,
        threads=threads,
    )
    for array in (found.r, found.u):
        array[~found.converged] = np.nan
    return found.r.reshape(q.shape), found.u.reshape(q.shape), found.status.reshape(q.shape[:-1])


def backward(
    W: Floats,
    q: Floats,
    mu: Floats,
    r: Floats,
    spacedim: int,
    by_r: Floats,
    by_u: Floats,
    threads: int,
) -> tuple[Floats, Floats, Floats]:
    """The derivatives of a loss by W, q and mu, from those by r and u."""
    m = q.shape[-1]
    found = vjp_batch(
        W.reshape(_batch(q, m, m)),
        q.reshape(_batch(q, m)),
        mu.reshape(_batch(q, m // spacedim)),
        r.reshape(_batch(q, m)),
        r=by_r.reshape(_batch(q, m)),
        u=by_u.reshape(_batch(q, m)),
        spacedim=spacedim,
        threads=threads,
    )
    return found.W.reshape(W.shape), found.q.reshape(q.shape), found.mu.reshape(mu.shape)


def tangent(
    W: Floats,
    q: Floats,
    mu: Floats,
    r: Floats,
    spacedim: int,
    changes: Sequence[Floats | None],
    threads: int,
) -> tuple[Floats, Floats]:
    """The changes of r and u, from those of W, q and mu."""
    m = q.shape[-1]
    sizes = ((m, m), (m,), (m // spacedim,))
    dW, dq, dmu = (
        None if one is None else one.reshape(_batch(q, *own))
        for one, own in zip(changes, sizes, strict=True)
    )
    found = jvp_batch(
        W.reshape(_batch(q, m, m)),
        q.reshape(_batch(q, m)),
        mu.reshape(_batch(q, m // spacedim)),
        r.reshape(_batch(q, m)),
        dW=dW,
        dq=dq,
        dmu=dmu,
        spacedim=spacedim,
        threads=threads,
    )
    return found.r.reshape(q.shape), found.u.reshape(q.shape)


def sensitivities(
    W: Floats, q: Floats, mu: Floats, r: Floats, spacedim: int, threads: int
) -> tuple[Floats, Floats]:
    """The matrices of dr = by_q (dq + dW r) + by_mu dmu."""
    m, nc = q.shape[-1], mu.shape[-1]
    by_q, by_mu = sensitivities_batch(
        W.reshape(_batch(q, m, m)),
        q.reshape(_batch(q, m)),
        mu.reshape(_batch(q, nc)),
        r.reshape(_batch(q, m)),
        spacedim,
        threads,
    )
    return by_q.reshape(W.shape), by_mu.reshape(*q.shape, nc)
