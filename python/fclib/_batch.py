"""Many small problems in one call, from plain arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from numbers import Integral
from typing import Any, ClassVar, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib import _core, _device
from fclib._equality import EqualByEntries
from fclib._solve import check_limits, name_wrong_type
from fclib._words import counted

Floats: TypeAlias = npt.NDArray[np.float64]
DOUBLE = np.dtype(np.float64)


@dataclass(frozen=True, eq=False)
class BatchResult(EqualByEntries):
    """What ``fclib.solve_batch`` returns: arrays over the problems. Equal if the arrays are.

    Attributes:
        r: reactions [N s], in the shape of q.
        u: velocities W r + q [m/s], in the shape of q.
        status: (count,) places in ``BatchResult.statuses``; 0 is converged.
        error: (count,) of each at least Merit.error, and at most a thousandth of tol above it.
        iterations: (count,) sweeps and Newton steps; those of ``auto`` if it solved the problem.
        offsets: (count + 1,) start of each problem's part of r and u, if the numbers of contacts
            vary; else None.
        by_auto: number of problems that the solver ``auto`` got, because the fast method did not
            solve them.
        v: velocities of the bodies, of global problems; else None.
        wrong: what is wrong with the first problem whose data are not valid; "" if all are.
    """

    r: Floats
    u: Floats
    status: npt.NDArray[np.int32]
    error: Floats
    iterations: npt.NDArray[np.int32]
    offsets: npt.NDArray[np.int64] | None
    by_auto: int
    v: Floats | None = None
    wrong: str = ""

    statuses: ClassVar[tuple[str, ...]] = tuple(_core.status_names())

    def __len__(self) -> int:
        return len(self.status)

    @property
    def converged(self) -> npt.NDArray[np.bool_]:
        """(count,) whether the merit of each is at most the tolerance."""
        return np.equal(self.status, 0)

    def __repr__(self) -> str:
        worst = np.max(self.error, initial=0.0)
        return (
            f"<BatchResult: {np.count_nonzero(self.converged)} of {len(self)} converged, "
            f"worst error {worst:.1e}>"
        )


@dataclass(frozen=True)
class Law:
    """The coefficients of friction of a batch, as the caller gives them."""

    mu: Any
    mu_r: Any = None
    mu_s: Any = None
    coupled: Any = False

    @property
    def turns(self) -> bool:
        """Whether contacts resist rolling or spin."""
        return self.mu_r is not None or self.mu_s is not None

    def check(self, spacedim: object) -> None:
        """ProblemError if the law has no contacts of so many components."""
        rolls, spins = self.mu_r is not None, self.mu_s is not None
        plain = not (rolls or spins) and self.coupled is False and type(spacedim) is int
        if plain and spacedim in (2, 3):
            return
        known = {(False, False): (2, 3), (True, False): (3, 5), (False, True): (4,)}
        fits = known.get((rolls, spins), (6,))
        if not isinstance(spacedim, (int, Integral)) or spacedim not in fits:
            given = [name for name in ("mu_r", "mu_s") if getattr(self, name) is not None]
            words = f"expected {' or '.join(map(str, fits))}"
            raise _core.ProblemError(
                f"spacedim: is {spacedim!r}, {words}"
                + (f" as there is {' and '.join(given)}" if given else "")
            )
        if not isinstance(self.coupled, bool):
            raise _core.ProblemError(f"coupled: is {self.coupled!r}, expected True or False")
        if self.coupled and (rolls or not spins):
            raise _core.ProblemError("coupled: is for spacedim 4, which has mu_s")

    def spread(
        self, shape: tuple[int, ...], counts: npt.NDArray[np.int32] | None = None
    ) -> dict[str, Any]:
        """The coefficients of all contacts, one after another, as the core names them."""
        found: dict[str, Any] = {"coupled": self.coupled}
        for name in ("mu", "mu_r", "mu_s"):
            values = getattr(self, name)
            if values is not None:
                given = values if counts is None else flat(name, values, counts)
                values = broadcast(name, given, shape).reshape(-1)
            found[name] = values
        return found


def solve_batch(
    W: Any = None,
    q: Any = None,
    mu: Any = None,
    *,
    jacobian: Any = None,
    inverse_mass: Any = None,
    velocity: Any = None,
    spacedim: int = 3,
    mu_r: Any = None,
    mu_s: Any = None,
    coupled: bool = False,
    contacts: Any = None,
    pattern: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    guess: Any = None,
    tol: float = 1e-8,
    threads: int = 1,
    time_limit: float | None = None,
    unsolved: Literal["cpu", "leave"] = "cpu",
) -> Any:
    """Solve many local problems, u = W r + q with one law, without Python between them.

    Small problems have their own method, which allocates no memory for each. Contacts that no block
    of W connects are solved apart from each other. Problems that the method does not solve go to
    the solver ``auto``. Python's lock is released.

    Args:
        W: (count, m, m) matrices, m = spacedim * nc. If ``contacts`` is given: all entries one
            after another, matrix by matrix, each by rows. Or a list of matrices of any sizes,
            which may be sparse ones of SciPy. If ``pattern`` is given: (count, blocks, spacedim,
            spacedim).
        q: (count, m) velocities without reactions; flat, or a list, as W.
        mu: (count, nc) coefficients of friction, or anything that NumPy broadcasts to it: (nc,), a
            number. Flat, or a list, as W.
        jacobian: (count, m, coordinates) instead of W: W = J M^-1 J^T. If ``contacts`` is given:
            (m of all problems, coordinates).
        inverse_mass: M^-1 of the jacobian's coordinates: (coordinates,) or (count, coordinates) if
            it is diagonal, or (count, coordinates, coordinates). 0 for what is fixed; a world with
            a negative one is invalid.
        velocity: (count, coordinates) free velocities of the bodies: q = J velocity, and what is
            given as q besides.
        spacedim: 3, or 2 for planar problems; 5 (3) with mu_r, 4 with mu_s, 6 with both.
        mu_r: coefficients of rolling friction [m], as mu. Then ``auto`` solves each problem.
        mu_s: coefficients of spin friction [m], likewise.
        coupled: whether sliding and spin share one limit, an ellipsoid (spacedim 4).
        contacts: (count,) numbers of contacts, if they differ between problems.
        pattern: (starts, columns) of the blocks of every W, as ``indptr`` and ``indices`` of
            SciPy's bsr_array: starts (nc + 1), columns (blocks).
        guess: reactions to start from, in the shape of q.
        tol: bound on Merit.error of each.
        threads: number of threads that share the batch; 0: all of the machine. The result is the
            same.
        time_limit: [s] for all of them; problems left undone have the status time_limit.
        unsolved: for arrays on a GPU: whether what it does not solve goes to the solver ``auto`` on
            the CPU ("cpu"), or stays as it is ("leave"); then nothing waits for the GPU.

    If an array is on a GPU (of CuPy, PyTorch, JAX, Warp), all is solved there, without a copy and
    in the order of the caller's stream, and a ``DeviceBatchResult`` is returned. This needs
    ``fclib[gpu]``. A problem that is not valid then has r = 0.

    Returns:
        Arrays over the problems. A problem is ``converged`` only if its merit confirms it,
        recomputed in extended precision, or in double precision with a bound on the rounding. A
        problem with an entry that is not finite, or a negative mu, has NaN for r and u and the
        status "invalid"; it changes nothing for the others.

    Raises:
        ProblemError: sizes that do not agree.
        OptionError: tol, threads or time_limit out of range.
    """
    law = Law(mu, mu_r, mu_s, coupled)
    law.check(spacedim)
    check_limits(tol, time_limit, threads=threads)
    if unsolved not in ("cpu", "leave"):
        raise _core.OptionError(f'unsolved: is {unsolved!r}, expected "cpu" or "leave"')
    if jacobian is None and (inverse_mass is not None or velocity is not None):
        raise _core.ProblemError("jacobian: is missing, and inverse_mass or velocity is given")
    if jacobian is not None and W is not None:
        raise _core.ProblemError("W: is given, and so is a jacobian")
    if mu is None:
        raise _core.ProblemError("mu: is missing")
    if _device.on_device(W, q, mu, jacobian, inverse_mass, velocity, contacts, guess):
        if law.turns:
            raise _core.ProblemError(
                "mu_r, mu_s: are for arrays on the CPU; a GPU has Coulomb's law"
            )
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
    if pattern is not None and (jacobian is not None or W is None):
        raise _core.ProblemError("pattern: is for W, given by blocks")
    masses: npt.NDArray[np.bool_] | None = None
    if jacobian is not None:
        W, q, masses = _of_bodies(spacedim, jacobian, inverse_mass, velocity, q, contacts)
    sizes: tuple[int, ...]
    offsets: npt.NDArray[np.int64] | None = None
    counts: npt.NDArray[np.int32] | None = None
    starts = columns = None
    if pattern is not None:
        if contacts is not None:
            raise _core.ProblemError("pattern: is for problems with the same contacts")
        starts, columns, matrices = _blocks_of(pattern, W, spacedim)
        count, each = len(matrices), len(starts) - 1
        sizes = (count, each * spacedim)
    elif isinstance(W, (list, tuple)) and contacts is None:
        contacts = [np.size(one) // spacedim for one in _sequence("q", q)]
    if contacts is not None:
        counts = check_contacts(contacts)
        count, each = len(counts), 0
        lengths = spacedim * counts.astype(np.int64)
        offsets = np.concatenate(([0], np.cumsum(lengths))).astype(np.int64)
        sizes = (int(offsets[-1]),)
        if isinstance(W, (list, tuple)) and any(hasattr(one, "tocsr") for one in W):
            starts, columns, matrices = _blocks_of_each(W, counts, spacedim)
        else:
            matrices = shaped("W", flat("W", W, lengths**2), (int(np.sum(lengths**2)),))
        velocity = shaped("q", flat("q", q, lengths), sizes)
        friction = law.spread((int(counts.sum()),), counts)
        start = None if guess is None else shaped("guess", flat("guess", guess, lengths), sizes)
    else:
        if pattern is None:
            matrices = floats("W", W)
            if matrices.ndim != 3 or matrices.shape[1] != matrices.shape[2]:
                raise _core.ProblemError(
                    f"W: has the shape {matrices.shape}, expected (count, m, m); problems of "
                    "different sizes need contacts, or lists"
                )
            sizes = matrices.shape[:2]
            count, m = sizes
            if m % spacedim:
                raise _core.ProblemError(f"W: m = {m} is no multiple of spacedim = {spacedim}")
            each = m // spacedim
        friction = law.spread((count, each))
        velocity = shaped("q", q, sizes)
        start = None if guess is None else shaped("guess", guess, sizes)
    given = {
        "W": matrices.reshape(-1),
        "q": velocity.reshape(-1),
        "starts": starts,
        "columns": columns,
        "one_pattern": pattern is not None,
    }
    result = run(
        given, spacedim, count, each, counts, offsets, sizes, friction, start, None, tol, threads,
        time_limit,
    )  # fmt: skip
    if masses is not None and not masses.all():
        first = np.argmin(masses)
        if result.wrong.startswith(f"problem {first}: W"):
            words = "is not symmetric, or negative, or not finite"
            result = replace(result, wrong=f"problem {first}: inverse_mass: {words}")
    return result


def check_contacts(contacts: npt.ArrayLike) -> npt.NDArray[np.int32]:
    """The numbers of contacts, of each problem one."""
    given = np.asarray(contacts)
    if given.ndim != 1 or (given.dtype.kind not in "iu" and given.size > 0):
        raise _core.ProblemError("contacts: is not a list of whole numbers")
    if given.size > 0 and not 0 <= given.min() <= given.max() <= 15000:
        raise _core.ProblemError("contacts: a number is not in 0 to 15000")
    return np.ascontiguousarray(given, dtype=np.int32)


def run(
    given: dict[str, Any],
    spacedim: int,
    count: int,
    each: int,
    counts: npt.NDArray[np.int32] | None,
    offsets: npt.NDArray[np.int64] | None,
    shape: tuple[int, ...],
    friction: dict[str, Any],
    guess: Floats | None,
    v: Floats | None,
    tol: float,
    threads: int,
    time_limit: float | None,
) -> BatchResult:
    """Solve problems whose sizes have been checked; `given` has what the core names so."""
    r, u = np.empty(shape), np.empty(shape)
    status = np.empty(count, dtype=np.int32)
    error = np.empty(count)
    iterations = np.empty(count, dtype=np.int32)
    get = given.get
    try:
        # by their places: for one small problem, names would take as long as its solution
        by_auto, first, wrong = _core.solve_batch(
            spacedim, count, each, counts, get("W"), get("q"), get("starts"), get("columns"),
            get("one_pattern", False), get("n_each", 0), get("n"), get("M"), get("H"), get("f"),
            get("w"), friction["mu"], friction["mu_r"], friction["mu_s"], friction["coupled"],
            None if guess is None else guess.reshape(-1), r.reshape(-1), u.reshape(-1),
            None if v is None else v.reshape(-1), status, error, iterations, tol, threads,
            math.inf if time_limit is None else time_limit,
        )  # fmt: skip
    except TypeError:
        name_wrong_type(tol=tol, threads=threads, time_limit=time_limit)
        raise
    if wrong:
        wrong = f"problem {first}: {wrong}"
    return BatchResult(r, u, status, error, iterations, offsets, by_auto, v, wrong)


def _indices(name: str, values: npt.ArrayLike) -> npt.NDArray[np.int32]:
    array = np.asarray(values)
    if array.ndim != 1 or (array.dtype.kind not in "iu" and array.size > 0):
        raise _core.ProblemError(f"pattern: {name} is not a list of whole numbers")
    return np.ascontiguousarray(array, dtype=np.int32)


def _blocks_of(
    pattern: Any, W: Any, spacedim: int
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], Floats]:
    """One pattern and the blocks of each problem."""
    if not isinstance(pattern, (list, tuple)) or len(pattern) != 2:
        raise _core.ProblemError("pattern: is not (starts, columns)")
    starts, columns = _indices("starts", pattern[0]), _indices("columns", pattern[1])
    if len(starts) == 0 or starts[-1] != len(columns):
        raise _core.ProblemError("pattern: the last of starts is not the number of columns")
    blocks = floats("W", W)
    wanted = (len(columns), spacedim, spacedim)
    if blocks.ndim != 4 or blocks.shape[1:] != wanted:
        raise _core.ProblemError(
            f"W: has the shape {blocks.shape}, expected (count, {', '.join(map(str, wanted))}) as "
            "pattern has these blocks"
        )
    return starts, columns, blocks


def _blocks_of_each(
    W: Sequence[Any], counts: npt.NDArray[np.int32], spacedim: int
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], Floats]:
    """The blocks of matrices of SciPy, one problem behind another."""
    import scipy.sparse as sp

    if len(W) != len(counts):
        raise _core.ProblemError(
            f"W: has {counted(len(W), 'problem')}, expected {len(counts)} as there are contacts"
        )
    starts, columns, values = [], [], []
    for k, (one, nc) in enumerate(zip(W, counts, strict=True)):
        m = spacedim * int(nc)
        if np.shape(one) != (m, m):
            raise _core.ProblemError(
                f"W: problem {k} has the shape {np.shape(one)}, expected {(m, m)}"
            )
        own = sp.csr_array(_core.matrix_from(one, f"problem {k}: W"))
        blocks = own.tobsr(blocksize=(spacedim, spacedim))
        blocks.sort_indices()
        starts.append(blocks.indptr)
        columns.append(blocks.indices)
        values.append(floats("W", blocks.data).reshape(-1))
    empty = np.empty(0)
    return (
        np.concatenate([empty, *starts]).astype(np.int32),
        np.concatenate([empty, *columns]).astype(np.int32),
        np.concatenate([empty, *values]),
    )


def _of_bodies(
    spacedim: int, jacobian: Any, inverse_mass: Any, velocity: Any, q: Any, contacts: Any
) -> tuple[Any, Any, npt.NDArray[np.bool_]]:
    """W and q of problems given by their bodies, lists if the numbers of contacts vary.

    And which masses of a world are some: of the others W is NaN.
    """
    matrix = floats("jacobian", jacobian)
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
    inverse = floats("inverse_mass", inverse_mass)
    shapes = [(nv,), (count, nv), (count, nv, nv)]
    if inverse.shape not in shapes:
        raise _core.ProblemError(
            f"inverse_mass: has the shape {inverse.shape}, expected one of {shapes}"
        )
    of_each = inverse.ndim > 1
    moving = None if velocity is None else shaped("velocity", velocity, (count, nv))
    sizes = None if contacts is None else spacedim * np.asarray(contacts)
    rows = matrix if sizes is None else np.split(matrix, np.cumsum(sizes)[:-1])
    if sizes is not None and len(matrix) != sizes.sum():
        raise _core.ProblemError(
            f"jacobian: has {counted(len(matrix), 'row')}, expected {sizes.sum()}"
        )
    if q is not None:
        if sizes is None:
            q = shaped("q", q, matrix.shape[:2])
        else:
            q = np.split(shaped("q", flat("q", q, sizes), (len(matrix),)), np.cumsum(sizes)[:-1])
    if not of_each:
        inverse = np.broadcast_to(inverse, (count, nv))
    good = _are_masses(inverse)
    inverse = np.where(np.expand_dims(good, tuple(range(1, inverse.ndim))), inverse, np.nan)
    if sizes is None:
        W = _device.gram(matrix, inverse)
        moved = 0.0 if moving is None else (matrix @ moving[..., None])[..., 0]
        return W, moved if q is None else moved + q, good
    found = [
        _device.local(
            one, inverse[k], None if moving is None else moving[k], None if q is None else q[k]
        )
        for k, one in enumerate(rows)
    ]
    matrices, velocities = ([one[part] for one in found] for part in range(2))
    return matrices, velocities, good


def _are_masses(inverse: Floats) -> npt.NDArray[np.bool_]:
    """Of each world, whether M^-1 has no negative eigenvalue."""
    if inverse.ndim == 2:
        return np.asarray(((inverse >= 0) & (inverse < np.inf)).all(axis=1))
    size = np.sqrt(np.abs(np.diagonal(inverse, axis1=1, axis2=2)))
    with np.errstate(invalid="ignore"):  # NaN is not good
        gap = np.abs(inverse - inverse.transpose(0, 2, 1))
        allowed = _device.ROUNDING_OF_MASS * size[:, :, None] * size[:, None, :]
        good = np.asarray((gap <= allowed).all(axis=(1, 2)))
    # scaled, so that a light coordinate counts as a heavy one
    over = np.where(np.isfinite(size) & (size > 0), 1 / np.where(size > 0, size, 1), 0)
    scaled = np.where(good[:, None, None], inverse, 0) * over[:, :, None] * over[:, None, :]
    least = np.linalg.eigvalsh(scaled).min(axis=1, initial=0)
    return np.asarray(good & (least >= -_device.ROUNDING_OF_MASS))


def floats(name: str, values: Any) -> Floats:
    """A contiguous array of numbers; no copy if it is one already."""
    if type(values) is np.ndarray and values.dtype is DOUBLE and values.flags.c_contiguous:
        return values
    try:
        array = np.asarray(values)
    except ValueError:
        raise _core.ProblemError(f"{name}: is not an array of numbers") from None
    if array.dtype.kind not in "biuf":
        raise _core.ProblemError(f"{name}: is not an array of real numbers")
    if np.ma.is_masked(values):
        raise _core.ProblemError(f"{name}: has masked entries")
    return np.ascontiguousarray(array, dtype=np.float64)


def shaped(name: str, values: Any, shape: tuple[int, ...]) -> Floats:
    array = floats(name, values)
    if array.shape != shape:
        raise _core.ProblemError(f"{name}: has the shape {array.shape}, expected {shape}")
    return array


def broadcast(name: str, values: Any, shape: tuple[int, ...]) -> Floats:
    array = floats(name, values)
    if array.shape == shape:
        return array
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


def flat(name: str, values: Any, sizes: npt.NDArray[Any]) -> Any:
    """The parts of a list one behind another, each of its size; an array as it is."""
    if not isinstance(values, (list, tuple)):
        return values
    if len(values) != len(sizes):
        raise _core.ProblemError(
            f"{name}: has {counted(len(values), 'problem')}, expected {len(sizes)} as there are"
            " contacts"
        )
    parts = [floats(name, one).reshape(-1) for one in values]
    for k, (part, size) in enumerate(zip(parts, sizes, strict=True)):
        if part.size != size and not (name.startswith("mu") and part.size == 1):
            raise _core.ProblemError(
                f"{name}: problem {k} has {part.size} entries, expected {size}"
            )
        if part.size != size:
            parts[k] = np.broadcast_to(part, (int(size),))
    return np.concatenate(parts) if parts else np.empty(0)
