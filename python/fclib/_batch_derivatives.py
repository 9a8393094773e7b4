"""How the solutions of many small problems change with their data, in one call."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fclib import _core
from fclib._batch import Floats, Law, broadcast, floats, shaped
from fclib._equality import EqualByEntries
from fclib._solve import check_limits, name_wrong_type

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class BatchTangent(EqualByEntries):
    """What ``fclib.jvp_batch`` returns. Equal if the arrays are.

    Attributes:
        r, u: the changes of reactions and velocities, in the shape of the changes of q.
        degenerate: (count, nc) contacts on a border between two statuses.
        unique: (count,) whether the changes are determined; if not, that of r is one of many.
    """

    r: Floats
    u: Floats
    degenerate: Flags
    unique: Flags


@dataclass(frozen=True, eq=False)
class BatchGradient(EqualByEntries):
    """What ``fclib.vjp_batch`` returns. Equal if the arrays are.

    Attributes:
        W: (count, [sides,] m, m) derivatives; the entries count as independent.
        q: (count, [sides,] m)
        mu: (count, [sides,] nc)
        degenerate: (count, nc) contacts on a border between two statuses.
        unique: (count,) whether the derivative is unique; if not, it belongs to one of the
            changes of r.
    """

    W: Floats
    q: Floats
    mu: Floats
    degenerate: Flags
    unique: Flags


class _Solved:
    """Problems of one size and their solutions, as the core takes them."""

    def __init__(
        self,
        W: npt.ArrayLike,
        q: npt.ArrayLike,
        mu: npt.ArrayLike,
        r: npt.ArrayLike,
        spacedim: int,
        threads: int,
    ) -> None:
        Law(mu).check(spacedim)
        check_limits(0, None, threads=threads)
        name_wrong_type(threads=threads)
        matrices = floats("W", W)
        if matrices.ndim != 3 or matrices.shape[1] != matrices.shape[2]:
            raise _core.ProblemError(f"W: has the shape {matrices.shape}, expected (count, m, m)")
        self.count, self.m = matrices.shape[:2]
        if self.m % spacedim:
            raise _core.ProblemError(f"W: m = {self.m} is no multiple of spacedim = {spacedim}")
        self.nc = self.m // spacedim
        shape = (self.count, self.m)
        self.degenerate = np.zeros((self.count, self.nc), dtype=np.uint8)
        self.unique = np.zeros(self.count, dtype=np.uint8)
        self.given: dict[str, Any] = {
            "spacedim": spacedim,
            "count": self.count,
            "each": self.nc,
            "W": matrices.reshape(-1),
            "q": shaped("q", q, shape).reshape(-1),
            "mu": broadcast("mu", mu, (self.count, self.nc)).reshape(-1),
            "r": shaped("r", r, shape).reshape(-1),
            "threads": threads,
        }

    @property
    def flags(self) -> dict[str, Any]:
        return {"degenerate": self.degenerate.reshape(-1), "unique": self.unique}

    def sides(self, given: dict[str, Any], own: dict[str, tuple[int, ...]]) -> tuple[Any, int]:
        """The arrays flat, and how many right-hand sides each problem has; 0 is one, without an
        axis of its own.
        """
        arrays = {name: floats(name, one) for name, one in given.items() if one is not None}
        sides = -1
        for name, array in arrays.items():
            shape = own[name]
            mine = array.shape[1] if array.ndim == len(shape) + 2 else 0
            wanted = (self.count, *((mine,) if mine else ()), *shape)
            if array.shape != wanted or sides not in (-1, mine):
                raise _core.ProblemError(
                    f"{name}: has the shape {array.shape}, expected"
                    f" {(self.count, *shape)}, or with the number of right-hand sides behind"
                    f" {self.count}, the same for all"
                )
            sides = mine
        return {name: array.reshape(-1) for name, array in arrays.items()}, max(sides, 0)


def vjp_batch(
    W: npt.ArrayLike,
    q: npt.ArrayLike,
    mu: npt.ArrayLike,
    solution: npt.ArrayLike,
    *,
    r: npt.ArrayLike | None = None,
    u: npt.ArrayLike | None = None,
    spacedim: int = 3,
    threads: int = 1,
) -> BatchGradient:
    """The derivatives of r . r* + u . u* by the data of many local problems: adjoint mode.

    Each is that of ``fclib.vjp``, without Python between them. One factorisation of a problem
    serves all its right-hand sides. A problem that is not valid, or whose r is not a number, gets
    NaN, but zeros for zero weights.

    Args:
        W: (count, m, m) matrices.
        q: (count, m) velocities without reactions.
        mu: (count, nc), or what NumPy broadcasts to it.
        solution: (count, m) the reactions r*, found to a tol far below 1e-6.
        r: (count, m) weights of r*, or (count, sides, m); zeros if left out.
        u: the same for u*.
        spacedim: 3, or 2 for planar problems.
        threads: number of threads that share the batch; 0: all of the machine.

    Raises:
        ProblemError: sizes that do not agree.
        OptionError: threads is negative.
    """
    solved = _Solved(W, q, mu, solution, spacedim, threads)
    m, nc = solved.m, solved.nc
    weights, sides = solved.sides({"r": r, "u": u}, {"r": (m,), "u": (m,)})
    lead = (solved.count, *((sides,) if sides else ()))
    by_W, by_q, by_mu = np.empty((*lead, m, m)), np.empty((*lead, m)), np.empty((*lead, nc))
    _core.vjp_batch(
        **solved.given,
        nc=None,
        sides=sides or 1,
        by_r=weights.get("r"),
        by_u=weights.get("u"),
        by_W=by_W.reshape(-1),
        by_q=by_q.reshape(-1),
        by_mu=by_mu.reshape(-1),
        **solved.flags,
    )
    return BatchGradient(
        by_W, by_q, by_mu, solved.degenerate.astype(bool), solved.unique.astype(bool)
    )


def jvp_batch(
    W: npt.ArrayLike,
    q: npt.ArrayLike,
    mu: npt.ArrayLike,
    solution: npt.ArrayLike,
    *,
    dW: npt.ArrayLike | None = None,
    dq: npt.ArrayLike | None = None,
    dmu: npt.ArrayLike | None = None,
    spacedim: int = 3,
    threads: int = 1,
) -> BatchTangent:
    """The changes of many solutions if their data change: forward mode.

    Args:
        W: (count, m, m) matrices.
        q: (count, m) velocities without reactions.
        mu: (count, nc), or what NumPy broadcasts to it.
        solution: (count, m) the reactions, found to a tol far below 1e-6.
        dW: (count, m, m) changes of W, or (count, sides, m, m); zeros if left out.
        dq: (count, m) of q, or with sides.
        dmu: (count, nc) of mu, or with sides.
        spacedim: 3, or 2 for planar problems.
        threads: number of threads that share the batch; 0: all of the machine.

    Raises:
        ProblemError: sizes that do not agree.
        OptionError: threads is negative.
    """
    solved = _Solved(W, q, mu, solution, spacedim, threads)
    m, nc = solved.m, solved.nc
    changes, sides = solved.sides(
        {"dW": dW, "dq": dq, "dmu": dmu}, {"dW": (m, m), "dq": (m,), "dmu": (nc,)}
    )
    lead = (solved.count, *((sides,) if sides else ()))
    dr, du = np.empty((*lead, m)), np.empty((*lead, m))
    _core.jvp_batch(
        **solved.given,
        nc=None,
        sides=sides or 1,
        **{name: changes.get(name) for name in ("dW", "dq", "dmu")},
        dr=dr.reshape(-1),
        du=du.reshape(-1),
        **solved.flags,
    )
    return BatchTangent(dr, du, solved.degenerate.astype(bool), solved.unique.astype(bool))


def sensitivities_batch(
    W: Floats, q: Floats, mu: Floats, r: Floats, spacedim: int, threads: int
) -> tuple[Floats, Floats]:
    """The matrices of dr = by_q (dq + dW r) + by_mu dmu, of each problem; zeros if r is NaN."""
    solved = _Solved(W, q, mu, r, spacedim, threads)
    by_q = np.empty((solved.count, solved.m, solved.m))
    by_mu = np.empty((solved.count, solved.m, solved.nc))
    _core.sensitivities_batch(**solved.given, by_q=by_q.reshape(-1), by_mu=by_mu.reshape(-1))
    return by_q, by_mu
