"""Many small problems in one call, from plain arrays."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib import _core, _device
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
    W: Any = None,
    q: Any = None,
    mu: Any = None,
    *,
    jacobian: Any = None,
    inverse_mass: Any = None,
    velocity: Any = None,
    spacedim: int = 3,
    contacts: Any = None,
    guess: Any = None,
    tol: float = 1e-8,
    threads: int = 1,
    time_limit: float | None = None,
    unsolved: Literal["cpu", "leave"] = "cpu",
) -> Any:
    """Solve many local problems, u = W r + q with Coulomb's law, without Python between them.

    Small problems have their own method, which allocates no memory for each. Problems that it does
    not solve go to the solver ``auto``. Python's lock is released.

    Args:
        W: (count, m, m) matrices, m = spacedim * nc. If ``contacts`` is given: all entries one
            after another, matrix by matrix, each by rows. Or a list of matrices of any sizes.
        q: (count, m) velocities without reactions; flat, or a list, as W.
        mu: (count, nc) coefficients of friction, or anything that NumPy broadcasts to it: (nc,), a
            number. Flat, or a list, as W.
        jacobian: (count, m, coordinates) instead of W: W = J M^-1 J^T. If ``contacts`` is given:
            (m of all problems, coordinates).
        inverse_mass: M^-1 of the jacobian's coordinates: (coordinates,) or (count, coordinates) if
            it is diagonal, or (count, coordinates, coordinates).
        velocity: (count, coordinates) free velocities of the bodies: q = J velocity, and what is
            given as q besides.
        spacedim: 3, or 2 for planar problems.
        contacts: (count,) numbers of contacts, if they differ between problems.
        guess: reactions to start from, in the shape of q.
        tol: bound on Merit.error of each.
        threads: number of threads that share the batch; 0: all of the machine. The result is the
            same.
        time_limit: [s] for all of them; problems left undone have the status time_limit.
        unsolved: for arrays on a GPU: whether what it does not solve goes to the solver ``auto`` on
            the CPU ("cpu"), or stays as it is ("leave"); then nothing waits for the GPU.

    If an array is on a GPU (of CuPy, PyTorch, JAX, Warp), all is solved there, without a copy and
    in the order of the caller's stream, and a ``DeviceBatchResult`` is returned. This needs
    ``fclib[gpu]``. A problem with an entry that is not finite, or a negative mu, then has the
    status "invalid", and r = 0.

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
    if unsolved not in ("cpu", "leave"):
        raise _core.OptionError(f'unsolved: is {unsolved!r}, expected "cpu" or "leave"')
    if jacobian is None and (inverse_mass is not None or velocity is not None):
        raise _core.ProblemError("jacobian: is missing, and inverse_mass or velocity is given")
    if jacobian is not None and W is not None:
        raise _core.ProblemError("W: is given, and so is a jacobian")
    if mu is None:
        raise _core.ProblemError("mu: is missing")
    if _device.on_device(W, q, mu, jacobian, inverse_mass, velocity, contacts, guess):
        return _device.solve_batch(
            W,
            q,
            mu,
            jacobian=jacobian,
            inverse_mass=inverse_mass,
            velocity=velocity,
            spacedim=spacedim,
            contacts=contacts,
            guess=guess,
            tol=tol,
            threads=threads,
            time_limit=time_limit,
            unsolved=unsolved,
            on_cpu=solve_batch,
        )
    if jacobian is not None:
        W, q = _of_bodies(spacedim, jacobian, inverse_mass, velocity, q, contacts)
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


def _of_bodies(
    spacedim: int, jacobian: Any, inverse_mass: Any, velocity: Any, q: Any, contacts: Any
) -> tuple[Any, Any]:
    """W and q of problems given by their bodies; lists of them if the numbers of contacts vary."""
    matrix = _floats("jacobian", jacobian)
    if inverse_mass is None:
        raise _core.ProblemError("inverse_mass: is missing")
    if velocity is None and q is None:
        raise _core.ProblemError("velocity: is missing, and so is q")
    if matrix.ndim != (3 if contacts is None else 2):
        raise _core.ProblemError(
            f"jacobian: has the shape {matrix.shape}, expected (count, m, coordinates), or with "
            "contacts (m of all problems, coordinates)"
        )
    nv = matrix.shape[-1]
    count = len(matrix) if contacts is None else len(contacts)
    inverse = _floats("inverse_mass", inverse_mass)
    shapes = [(nv,), (count, nv), (count, nv, nv)]
    if inverse.shape not in shapes:
        raise _core.ProblemError(
            f"inverse_mass: has the shape {inverse.shape}, expected one of {shapes}"
        )
    of_each, full = inverse.ndim > 1, inverse.ndim == 3
    moving = None if velocity is None else _shaped("velocity", velocity, (count, nv))
    sizes = None if contacts is None else spacedim * np.asarray(contacts)
    rows = matrix if sizes is None else np.split(matrix, np.cumsum(sizes)[:-1])
    if sizes is not None and len(matrix) != sizes.sum():
        raise _core.ProblemError(f"jacobian: has {len(matrix)} rows, expected {sizes.sum()}")
    if q is not None:
        if sizes is None:
            q = _shaped("q", q, matrix.shape[:2])
        else:
            q = np.split(_shaped("q", _flat("q", q, sizes), (len(matrix),)), np.cumsum(sizes)[:-1])
    found = [
        _device.local(
            one,
            inverse[k] if of_each else inverse,
            full,
            None if moving is None else moving[k],
            None if q is None else q[k],
        )
        for k, one in enumerate(rows)
    ]
    matrices, velocities = ([one[part] for one in found] for part in range(2))
    if sizes is None:
        m = matrix.shape[1]
        return np.reshape(matrices, (count, m, m)), np.reshape(velocities, (count, m))
    return matrices, velocities


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
