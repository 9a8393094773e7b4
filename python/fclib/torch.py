"""Contact problems in PyTorch: r and u are tensors with gradients.

>>> import fclib.torch
>>> r, u = fclib.torch.solve(W, q, mu)
>>> (u**2).sum().backward()
"""

from __future__ import annotations

from typing import Any

import torch
from torch.autograd.function import once_differentiable

from fclib import _layer

__all__ = ["solve"]


class _Solve(torch.autograd.Function):  # type: ignore[misc]
    """The function for tensors whose leading sizes are equal."""

    @staticmethod
    def forward(
        ctx: Any,
        W: torch.Tensor,
        q: torch.Tensor,
        mu: torch.Tensor,
        spacedim: int,
        tol: float,
        threads: int,
    ) -> tuple[torch.Tensor, torch.Tensor]:
        r, u = _layer.forward(_array(W), _array(q), _array(mu), spacedim, tol, threads)
        ctx.spacedim = spacedim
        ctx.reactions = r
        ctx.save_for_backward(W, q, mu)
        return torch.from_numpy(r).to(q), torch.from_numpy(u).to(q)

    @staticmethod
    @once_differentiable  # type: ignore[untyped-decorator, unused-ignore]
    def backward(ctx: Any, by_r: torch.Tensor, by_u: torch.Tensor) -> tuple[Any, ...]:
        W, q, mu = ctx.saved_tensors
        found = _layer.backward(
            _array(W),
            _array(q),
            _array(mu),
            ctx.reactions,
            ctx.spacedim,
            _array(by_r),
            _array(by_u),
        )
        by_W, by_q, by_mu = (torch.from_numpy(one).to(q) for one in found)
        return by_W, by_q, by_mu, None, None, None


def solve(
    W: torch.Tensor,
    q: torch.Tensor,
    mu: torch.Tensor,
    *,
    spacedim: int = 3,
    tol: float = 1e-10,
    threads: int = 1,
) -> tuple[torch.Tensor, torch.Tensor]:
    """Reactions and velocities of local problems, as ``fclib.solve_batch`` finds them.

    The gradient is that of ``fclib.vjp``; there is no second one. All is computed in double
    precision on the CPU, and returned in the type and on the device of q.

    W is (..., m, m), q (..., m) and mu (..., nc); their leading sizes are broadcast. The other
    arguments are those of ``fclib.solve_batch``; gradients need a tol far below 1e-6.

    Returns:
        r and u, (..., m).

    Raises:
        ProblemError: as there; or shapes do not agree.
        SolverError: a problem was not solved to the tolerance, or has no solution.
    """
    batch = _layer.check_shapes(tuple(W.shape), tuple(q.shape), tuple(mu.shape), spacedim)
    m = q.shape[-1]
    return _Solve.apply(  # type: ignore[no-any-return, no-untyped-call, unused-ignore]
        W.expand(*batch, m, m),
        q.expand(*batch, m),
        mu.expand(*batch, m // spacedim),
        spacedim,
        tol,
        threads,
    )


def _array(tensor: torch.Tensor) -> Any:
    return tensor.detach().to("cpu", torch.float64).contiguous().numpy()
