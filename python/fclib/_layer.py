"""Solving as a layer of a network: batches of local problems, and the gradient of a loss.

It uses plain arrays; ``fclib.torch`` and ``fclib.jax`` connect it to their differentiation.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from fclib import _core
from fclib._batch import solve_batch
from fclib._derivatives import vjp
from fclib._registry import SolverError

Floats: TypeAlias = npt.NDArray[np.float64]


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


def forward(
    W: Floats, q: Floats, mu: Floats, spacedim: int, tol: float, threads: int
) -> tuple[Floats, Floats]:
    """Find r and u of problems whose leading sizes are equal.

    Raises:
        SolverError: a problem of the batch was not solved; it names the first.
        ProblemError: an entry is not finite, or mu is negative.
    """
    m = q.shape[-1]
    found = solve_batch(
        W.reshape(-1, m, m),
        q.reshape(-1, m),
        mu.reshape(-1, m // spacedim),
        spacedim=spacedim,
        tol=tol,
        threads=threads,
    )
    for k in np.flatnonzero(~found.converged)[:1]:
        raise SolverError(
            f"problem {k} of {len(found)}: {found.statuses[found.status[k]]}, error"
            f" {found.error[k]:.1e}, and {tol:g} was asked for"
        )
    return found.r.reshape(q.shape), found.u.reshape(q.shape)


def backward(
    W: Floats, q: Floats, mu: Floats, r: Floats, spacedim: int, by_r: Floats, by_u: Floats
) -> tuple[Floats, Floats, Floats]:
    """The derivatives of a loss by W, q and mu, from those by r and u."""
    grad_W, grad_q, grad_mu = np.empty(W.shape), np.empty(q.shape), np.empty(mu.shape)
    for k in np.ndindex(q.shape[:-1]):
        problem = _core.LocalProblem(spacedim=spacedim, W=W[k], q=q[k], mu=mu[k])
        found = vjp(problem, r[k], r=by_r[k], u=by_u[k])
        grad_W[k], grad_q[k], grad_mu[k] = found.W, found.q, found.mu
    return grad_W, grad_q, grad_mu
