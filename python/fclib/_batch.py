"""Many small problems in one call, from plain arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib import _core
from fclib._equality import EqualByEntries

Floats: TypeAlias = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BatchResult(EqualByEntries):
    """What ``fclib.solve_batch`` returns: arrays over the problems. Equal if the arrays are.

    Attributes:
        r: reactions [N s], in the shape of q.
        u: velocities W r + q [m/s], in the shape of q.
        status: (count,) places in ``BatchResult.statuses``; 0 is converged.
        error: (count,) Merit.error of each.
        iterations: (count,) sweeps and Newton steps; those of ``auto`` if it solved the problem.
        offsets: (count + 1,) start of each problem's part of r and u, if the numbers of contacts
            vary; else None.
        by_auto: number of problems that the solver ``auto`` got, because the fast method did not
            solve them.
    """

    r: Floats
    u: Floats
    status: npt.NDArray[np.int32]
    error: Floats
    iterations: npt.NDArray[np.int32]
    offsets: npt.NDArray[np.int64] | None
    by_auto: int

    statuses: ClassVar[tuple[str, ...]] = tuple(_core.status_names())

    def __len__(self) -> int:
        return len(self.status)

    @property
    def converged(self) -> npt.NDArray[np.bool_]:
        """(count,) whether the merit of each is at most the tolerance."""
        return np.equal(self.status, 0)

    def __repr__(self) -> str:
        worst = self.error.max() if len(self) else 0.0
        return (
            f"<BatchResult: {np.count_nonzero(self.converged)} of {len(self)} converged, "
            f"worst error {worst:.1e}>"
        )


def solve_batch(
    W: npt.ArrayLike | Sequence[npt.ArrayLike],
    q: npt.ArrayLike | Sequence[npt.ArrayLike],
    mu: npt.ArrayLike | Sequence[npt.ArrayLike],
    *,
    spacedim: int = 3,
    contacts: npt.ArrayLike | None = None,
    guess: npt.ArrayLike | Sequence[npt.ArrayLike] | None = None,
    tol: float = 1e-8,
    threads: int = 1,
    time_limit: float | None = None,
) -> BatchResult:
    """Solve many local problems, u = W r + q with Coulomb's law, without Python between them.

    Small problems have their own method, which allocates no memory for each. Problems that it does
    not solve go to the solver ``auto``. Python's lock is released.

    Args:
        W: (count, m, m) matrices, m = spacedim * nc. If ``contacts`` is given: all entries one
            after another, matrix by matrix, each by rows. Or a list of matrices of any sizes.
        q: (count, m) velocities without reactions; flat, or a list, as W.
        mu: (count, nc) coefficients of friction, or anything that NumPy broadcasts to it: (nc,), a
            number. Flat, or a list, as W.
        spacedim: 3, or 2 for planar problems.
        contacts: (count,) numbers of contacts, if they differ between problems.
        guess: reactions to start from, in the shape of q.
        tol: bound on Merit.error of each.
        threads: number of threads that share the batch; 0: all of the machine. The result is the
            same.
        time_limit: [s] for all of them; problems left undone have the status time_limit.

    Returns:
        Arrays over the problems. A problem is ``converged`` only if the merit, recomputed in
        extended precision, confirms it.

    Raises:
        ProblemError: sizes that do not agree, entries that are not finite, a negative mu; it names
            the problem.
        OptionError: tol, threads or time_limit out of range.
    """
    if spacedim not in (2, 3):
        raise _core.ProblemError(f"spacedim: is {spacedim}, expected 2 or 3")
    if not tol >= 0:
        raise _core.OptionError(f"tol: {tol} is not a positive number")
    if threads < 0:
        raise _core.OptionError(f"threads: {threads} is negative")
    if time_limit is not None and not time_limit > 0:
        raise _core.OptionError(f"time_limit: {time_limit} is not a positive number of seconds")
    ragged = isinstance(W, (list, tuple)) and contacts is None
    if ragged:
        contacts = [np.size(one) // spacedim for one in _sequence("q", q)]
    offsets: npt.NDArray[np.int64] | None = None
    counts: npt.NDArray[np.int32] | None = None
    shape: tuple[int, ...]
    if contacts is None:
        matrices = _floats("W", W)
        if matrices.ndim != 3 or matrices.shape[1] != matrices.shape[2]:
            raise _core.ProblemError(
                f"W: has the shape {matrices.shape}, expected (count, m, m); problems of different "
                "sizes need contacts, or lists"
            )
        count, m = matrices.shape[:2]
        if m % spacedim:
            raise _core.ProblemError(f"W: m = {m} is no multiple of spacedim = {spacedim}")
        each, shape = m // spacedim, (count, m)
        friction = _broadcast("mu", mu, (count, each))
        velocity = _shaped("q", q, shape)
        start = None if guess is None else _shaped("guess", guess, shape)
    else:
        given = np.asarray(contacts)
        if given.ndim != 1 or (given.dtype.kind not in "iu" and given.size > 0):
            raise _core.ProblemError("contacts: is not a list of whole numbers")
        if given.size > 0 and not 0 <= given.min() <= given.max() <= 15000:
            raise _core.ProblemError("contacts: a number is not in 0 to 15000")
        counts = np.ascontiguousarray(given, dtype=np.int32)
        count, each = len(counts), 0
        sizes = spacedim * counts.astype(np.int64)
        offsets = np.concatenate(([0], np.cumsum(sizes))).astype(np.int64)
        shape = (int(offsets[-1]),)
        matrices = _shaped("W", _flat("W", W, sizes**2), (int(np.sum(sizes**2)),))
        velocity = _shaped("q", _flat("q", q, sizes), shape)
        friction = _broadcast("mu", _flat("mu", mu, counts), (int(counts.sum()),))
        start = None if guess is None else _shaped("guess", _flat("guess", guess, sizes), shape)
    r, u = np.empty(shape), np.empty(shape)
    status = np.empty(count, dtype=np.int32)
    error = np.empty(count)
    iterations = np.empty(count, dtype=np.int32)
    by_auto = _core.solve_batch(
        spacedim,
        count,
        each,
        counts,
        matrices.reshape(-1),
        velocity.reshape(-1),
        friction.reshape(-1),
        None if start is None else start.reshape(-1),
        r.reshape(-1),
        u.reshape(-1),
        status,
        error,
        iterations,
        tol,
        threads,
        math.inf if time_limit is None else time_limit,
    )
    return BatchResult(r, u, status, error, iterations, offsets, by_auto)


def _floats(name: str, values: Any) -> Floats:
    """A contiguous array of numbers; no copy if it is one already."""
    try:
        array = np.asarray(values)
    except ValueError:
        raise _core.ProblemError(f"{name}: is not an array of numbers") from None
    if array.dtype.kind not in "biuf":
        raise _core.ProblemError(f"{name}: is not an array of real numbers")
    if np.ma.is_masked(values):
        raise _core.ProblemError(f"{name}: has masked entries")
    return np.ascontiguousarray(array, dtype=np.float64)


def _shaped(name: str, values: Any, shape: tuple[int, ...]) -> Floats:
    array = _floats(name, values)
    if array.shape != shape:
        raise _core.ProblemError(f"{name}: has the shape {array.shape}, expected {shape}")
    return array


def _broadcast(name: str, values: Any, shape: tuple[int, ...]) -> Floats:
    array = _floats(name, values)
    try:
        return np.ascontiguousarray(np.broadcast_to(array, shape))
    except ValueError:
        raise _core.ProblemError(
            f"{name}: has the shape {np.shape(values)}, which does not become {shape}"
        ) from None


def _sequence(name: str, values: Any) -> Any:
    if not isinstance(values, (list, tuple, np.ndarray)):
        raise _core.ProblemError(f"{name}: is not a list, as W is")
    return values


def _flat(name: str, values: Any, sizes: npt.NDArray[Any]) -> Any:
    """The parts of a list one behind another, each of its size; an array as it is."""
    if not isinstance(values, (list, tuple)):
        return values
    if len(values) != len(sizes):
        raise _core.ProblemError(
            f"{name}: has {len(values)} problems, expected {len(sizes)} as there are contacts"
        )
    parts = [_floats(name, one).reshape(-1) for one in values]
    for k, (part, size) in enumerate(zip(parts, sizes, strict=True)):
        if part.size != size and not (name == "mu" and part.size == 1):
            raise _core.ProblemError(
                f"{name}: problem {k} has {part.size} entries, expected {size}"
            )
        if part.size != size:
            parts[k] = np.broadcast_to(part, (int(size),))
    return np.concatenate(parts) if parts else np.empty(0)
