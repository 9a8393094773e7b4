"""Contact problems in PyTorch: r and u are tensors with gradients.

>>> import fclib.torch
>>> r, u = fclib.torch.solve(W, q, mu)
>>> (u**2).sum().backward()
"""

from __future__ import annotations

import functools
from typing import Any, NoReturn

import torch

from fclib import _core, _layer

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
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        r, u, status = _layer.forward(_array(W), _array(q), _array(mu), spacedim, tol, threads)
        ctx.options = (spacedim, threads)
        ctx.reactions = r.copy()  # r itself becomes the caller's, who may change it
        ctx.save_for_backward(W, q, mu)
        ctx.save_for_forward(W, q, mu)
        statuses = torch.from_numpy(status).to(q.device)
        ctx.mark_non_differentiable(statuses)
        return torch.from_numpy(r).to(q), torch.from_numpy(u).to(q), statuses

    @staticmethod
    def backward(ctx: Any, by_r: torch.Tensor, by_u: torch.Tensor, _: Any) -> tuple[Any, ...]:
        W, q, mu = ctx.saved_tensors
        found = _Gradient.apply(W, q, mu, by_r, by_u, ctx.reactions, *ctx.options)
        return (*found, None, None, None)

    @staticmethod
    def jvp(ctx: Any, dW: Any, dq: Any, dmu: Any, *_: Any) -> tuple[Any, ...]:
        W, q, mu = ctx.saved_tensors
        spacedim, threads = ctx.options
        dr, du = _layer.tangent(
            _array(W), _array(q), _array(mu), ctx.reactions, spacedim,
            [None if one is None else _array(one) for one in (dW, dq, dmu)],
            threads,
        )  # fmt: skip
        return torch.from_numpy(dr).to(q), torch.from_numpy(du).to(q), None


class _Gradient(torch.autograd.Function):  # type: ignore[misc]
    """The gradient, a function of its own, so that a second one is refused by name."""

    @staticmethod
    def forward(
        ctx: Any, W: Any, q: Any, mu: Any, by_r: Any, by_u: Any, r: Any, spacedim: int, threads: int
    ) -> tuple[torch.Tensor, ...]:
        del ctx
        found = _layer.backward(
            _array(W), _array(q), _array(mu), r, spacedim, _array(by_r), _array(by_u), threads
        )
        return tuple(torch.from_numpy(one).to(x) for one, x in zip(found, (W, q, mu), strict=True))

    @staticmethod
    def backward(ctx: Any, *by: Any) -> NoReturn:
        raise _core.UnsuitableError(_layer.ONCE.format("fclib.torch.solve"))


def solve(
    W: torch.Tensor,
    q: torch.Tensor,
    mu: torch.Tensor,
    *,
    spacedim: int = 3,
    tol: float = 1e-10,
    threads: int = 1,
    status: bool = False,
) -> Any:
    """Reactions and velocities of local problems, as ``fclib.solve_batch`` finds them.

    The gradient is that of ``fclib.vjp_batch``, and in forward mode of ``fclib.jvp_batch``; there
    is no second one, and neither ``torch.func`` nor ``vectorize=True`` is supported. All is
    computed in double precision on the CPU, and returned on the device of q, in the common type of
    W, q and mu; integers count as the default type of floats.

    W is (..., m, m), q (..., m) and mu (..., nc), tensors or what becomes one; their leading sizes
    are broadcast. The other arguments are those of ``fclib.solve_batch``; gradients need a tol far
    below 1e-6.

    A problem that is not valid, has no solution or is not solved to tol has NaN for r and u, and
    does not disturb the others. To leave such problems out of a loss, take
    ``torch.where((status == 0)[..., None], r, 0)``, and u likewise: their gradients are then zeros.

    Returns:
        r and u, (..., m). With ``status``, also (...) places in ``fclib.BatchResult.statuses``; 0
        is converged.

    Raises:
        ProblemError: shapes do not agree, or numbers are complex.
        OptionError: tol or threads is out of range.
        UnsuitableError: a second derivative is asked for.
    """
    W, q, mu = _of_one_type(W, q, mu)
    batch = _layer.check_shapes(tuple(W.shape), tuple(q.shape), tuple(mu.shape), spacedim)
    _layer.check_options(tol, threads)
    m = q.shape[-1]
    r, u, statuses = _Solve.apply(  # type: ignore[no-untyped-call, unused-ignore]
        W.expand(*batch, m, m),
        q.expand(*batch, m),
        mu.expand(*batch, m // spacedim),
        spacedim,
        tol,
        threads,
    )
    return (r, u, statuses) if status else (r, u)


def _of_one_type(*given: Any) -> tuple[torch.Tensor, ...]:
    """Dense tensors of the common type of all, of floats."""
    tensors = []
    for name, one in zip(("W", "q", "mu"), given, strict=True):
        # what is no tensor is copied: its owner may change it before the gradient is asked for
        tensor = one if isinstance(one, torch.Tensor) else torch.tensor(one)
        if tensor.is_complex():
            _layer.refuse_complex(name)
        tensors.append(tensor if tensor.layout == torch.strided else tensor.to_dense())
    kind = functools.reduce(torch.promote_types, (tensor.dtype for tensor in tensors))
    if not kind.is_floating_point:
        kind = torch.get_default_dtype()
    return tuple(tensor.to(kind) for tensor in tensors)


def _array(tensor: torch.Tensor) -> Any:
    return tensor.detach().to("cpu", torch.float64).contiguous().numpy()
