"""Many small problems on a GPU: what `solve_batch` does with arrays that are there.

The method is core/embed/proximal_small, which CuPy compiles for the sizes of a batch. Arrays of
other libraries come in without a copy, by DLPack or `__cuda_array_interface__`, and their order of
work is kept: DLPack makes the stream of CuPy wait for theirs, and theirs for CuPy's.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final, Literal

import numpy as np

from fclib import _core
from fclib._words import counted

# of CuPy: without its package there is no type to name
DeviceArray = Any

INCLUDE: Final = re.compile(r'#include "embed/proximal_small/([\w.]+)"')

FORMS: Final = {"W": 0, "bodies": 1, "few coordinates": 2}
MOST_CONTACTS: Final = 64  # larger ones are for `auto`, as on the CPU
# K of so many coordinates stays in registers; of 24, it left half of the multiprocessor idle and
# was slower by a third
FEW_COORDINATES: Final = 12
SHARED_COPY: Final = 8  # contacts up to which W is copied; from 16 on it is slower by a tenth
# steps that a problem may take: of those of docs/results/gpu.csv, all but one need under 100
MOST_STEPS: Final = 400
CUDA_DEVICE: Final = 2  # kDLCUDA of DLPack
# how symmetric a full M^-1 must be, over the root of its diagonal entries: an inverse that was
# computed is so up to its condition
ROUNDING_OF_MASS: Final = 1e-9

# two events of CuPy that are recorded around each kernel, for measurements; else None
TIMER: tuple[Any, Any] | None = None


@dataclass(frozen=True, eq=False)
class DeviceBatchResult:
    """What ``fclib.solve_batch`` returns for arrays on a GPU: arrays of CuPy over the problems.

    Other libraries take them without a copy: ``torch.from_dlpack(result.r)``.

    Attributes:
        r: reactions [N s], (count, m); one after another if the numbers of contacts vary.
        u: velocities W r + q [m/s], in the shape of r.
        status: (count,) places in ``DeviceBatchResult.statuses``; 0 is converged.
        error: (count,) Merit.error of each, in double precision.
        iterations: (count,) Newton steps; those of ``auto`` if it solved the problem.
        offsets: (count + 1,) start of each problem's part of r and u, if the numbers of contacts
            vary; else None.
        by_auto: number of problems that were solved on the CPU, since the GPU left them.
    """

    r: DeviceArray
    u: DeviceArray
    status: DeviceArray
    error: DeviceArray
    iterations: DeviceArray
    offsets: DeviceArray | None
    by_auto: int

    statuses: ClassVar[tuple[str, ...]] = tuple(dict.fromkeys((*_core.status_names(), "invalid")))

    def __len__(self) -> int:
        return len(self.status)

    @property
    def converged(self) -> DeviceArray:
        """(count,) whether the error of each is at most the tolerance."""
        return self.status == 0

    @functools.cached_property
    def unsolved(self) -> DeviceArray:
        """The problems that are not converged. It waits for the GPU."""
        return _cupy().flatnonzero(self.status)

    def __repr__(self) -> str:
        return f"<DeviceBatchResult: {counted(len(self), 'problem')} on a GPU>"


def on_device(*arrays: Any) -> bool:
    """Whether any of them is on a GPU."""
    for one in arrays:
        # most are such, and a small batch takes less time than a call for each
        if one is not None and type(one) is not np.ndarray and _is_device(one):
            return True
    return False


def _is_device(array: Any) -> bool:
    if type(array) is np.ndarray or array is None:
        return False
    if isinstance(array, (list, tuple, float, int)):
        return False
    if hasattr(type(array), "__dlpack_device__"):
        return bool(array.__dlpack_device__()[0] == CUDA_DEVICE)
    return hasattr(array, "__cuda_array_interface__")


def missing() -> str:
    """What keeps this machine from solving on a GPU; "" if nothing does."""
    try:
        import cupy
    except ImportError as failure:
        return f"CuPy cannot be imported ({failure}): pip install 'fclib[gpu]'"
    try:
        count = cupy.cuda.runtime.getDeviceCount()
    except cupy.cuda.runtime.CUDARuntimeError as failure:
        return f"no GPU can be used: {failure}"
    return "" if count > 0 else "there is no GPU"


def name() -> str:
    """The GPU that CuPy uses."""
    cupy = _cupy()
    properties = cupy.cuda.runtime.getDeviceProperties(cupy.cuda.Device().id)
    return f"{properties['name'].decode()}, CuPy {cupy.__version__}"


def _cupy() -> Any:
    try:
        import cupy
    except ImportError as failure:
        raise _core.ProblemError(
            f"arrays on a GPU need CuPy ({failure}): pip install 'fclib[gpu]'"
        ) from None
    return cupy


def sources() -> str:
    """The kernel with its headers, as one text: NVRTC reads no files."""
    here = Path(__file__).resolve().parent
    folder = here / "device"
    if not folder.is_dir():  # a development install
        folder = here.parents[1] / "core" / "embed" / "proximal_small"
    taken: set[str] = set()

    def whole(name: str) -> str:
        if name in taken:
            return ""
        taken.add(name)
        text = (folder / name).read_text(encoding="utf-8").replace("#pragma once", "")
        return INCLUDE.sub(lambda found: whole(found[1]), text)

    return whole("kernel.cu")


def plan(
    form: str, spacedim: int, contacts: int, fixed: bool, coordinates: int = 0, width: int = 0
) -> dict[str, int]:
    """The macros of the kernel for a batch: its sizes, and the lanes that were fastest for them."""
    if form == "bodies" and coordinates <= FEW_COORDINATES:
        form = "few coordinates"
    if form == "few coordinates":
        lanes = _power(contacts, 1, 32)
    elif form == "bodies":
        lanes = 128 if coordinates > 48 else 64 if coordinates > 32 else 32
    else:
        lanes = (
            _power(4 * contacts if contacts > 4 else contacts, 1, 32)
            if contacts <= SHARED_COPY
            else 64 if contacts <= 16 else 128 if contacts <= 32 else 256
        )  # fmt: skip
    groups = max(1, 32 // lanes)
    return {
        "SPACEDIM": spacedim,
        "CONTACTS": contacts,
        "FIXED": contacts if fixed else 0,
        "FORM": FORMS[form],
        "COPIES": int(contacts <= SHARED_COPY),
        "COORDINATES": coordinates,
        "WIDTH": width,
        "LANES": lanes,
        "WARPS": 4,
        "WAITING": (3 * groups + 7) // 8,
        "GLOBAL": 0,
    }


def _power(n: int, least: int, most: int) -> int:
    """The power of two that is at least n, within bounds."""
    return min(most, max(least, 1 << (n - 1).bit_length()))


@dataclass(frozen=True)
class Kernel:
    """A kernel and how it is launched."""

    solve: Any
    threads: int
    shared: int  # bytes of a block
    workspace: int  # bytes of a block in global memory
    blocks: int  # that the GPU holds at a time
    groups: int  # problems of a block at a time


@functools.cache
def kernel(device: int, macros: tuple[tuple[str, int], ...]) -> Kernel:
    """The kernel for these macros on a device; blocks smaller until they fit."""
    cupy = _cupy()
    options = ("-std=c++17", *(f"-D{name}={value}" for name, value in macros))
    module = cupy.RawModule(code=sources(), options=options)
    sizes = cupy.zeros(3, dtype=cupy.int32)
    module.get_function("sizes")((1,), (1,), (sizes,))
    threads, size, groups = (int(number) for number in sizes.get())
    properties = cupy.cuda.runtime.getDeviceProperties(device)
    chosen = dict(macros)
    if not chosen["GLOBAL"] and size > properties["sharedMemPerBlockOptin"]:
        smaller = (
            {"WARPS": chosen["WARPS"] // 2}
            if chosen["LANES"] <= 32 and chosen["WARPS"] > 1
            else {"GLOBAL": 1}
        )
        return kernel(device, tuple({**chosen, **smaller}.items()))
    solve = module.get_function("solve")
    shared = 0 if chosen["GLOBAL"] else size
    solve.max_dynamic_shared_size_bytes = shared
    held = cupy.cuda.driver.occupancyMaxActiveBlocksPerMultiprocessor(
        solve.kernel.ptr, threads, shared
    )
    return Kernel(
        solve,
        threads,
        shared,
        size - shared,
        max(1, held) * properties["multiProcessorCount"],
        groups,
    )


def solve_batch(
    W: Any,
    q: Any,
    mu: Any,
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
    on_cpu: Callable[..., Any],
) -> DeviceBatchResult:
    """As `fclib.solve_batch`, which has checked the options and gives itself as `on_cpu`."""
    cupy = _cupy()
    counts = None
    if contacts is not None:
        counts = cupy.asnumpy(contacts).astype(np.int64) if _is_device(contacts) else contacts
    bodies = jacobian is not None
    matrices = _floats(cupy, *(("jacobian", jacobian) if bodies else ("W", W)))
    device = matrices.device.id
    with cupy.cuda.Device(device):
        sizes = _Sizes(cupy, matrices, spacedim, counts, bodies)
        arrays = _arrays(cupy, sizes, q, mu, velocity, inverse_mass, guess, matrices)
        result = _launch(cupy, device, sizes, arrays, tol)
        if unsolved == "cpu" and len(result):
            result = _finish(cupy, sizes, arrays, result, tol, threads, time_limit, on_cpu)
    return result


class _Sizes:
    """The numbers of contacts, and where each problem stands in the arrays."""

    def __init__(
        self, cupy: Any, matrices: DeviceArray, spacedim: int, counts: Any, bodies: bool
    ) -> None:
        self.spacedim, self.bodies = spacedim, bodies
        self.coordinates = matrices.shape[-1] if bodies else 0
        name = "jacobian" if bodies else "W"
        self.ragged = counts is not None
        if counts is None:
            square = bodies or (matrices.ndim == 3 and matrices.shape[1] == matrices.shape[2])
            if matrices.ndim != 3 or not square:
                shape = "(count, m, coordinates)" if bodies else "(count, m, m)"
                raise _core.ProblemError(
                    f"{name}: has the shape {matrices.shape}, expected {shape}; problems of "
                    "different sizes need contacts"
                )
            count, m = matrices.shape[:2]
            if m % spacedim:
                raise _core.ProblemError(f"{name}: m = {m} is no multiple of spacedim = {spacedim}")
            counts = np.full(count, m // spacedim, dtype=np.int64)
        counts = np.asarray(counts)
        if counts.ndim != 1 or counts.dtype.kind not in "iu" or (counts < 0).any():
            raise _core.ProblemError("contacts: is not a list of whole numbers")
        self.counts = counts.astype(np.int64)
        self.count = len(counts)
        self.most = int(self.counts.max(initial=0)) if self.ragged else m // spacedim
        self.first = _starts(self.counts)
        lengths = spacedim * self.counts
        entries = lengths * self.coordinates if bodies else lengths**2
        self.entries = _starts(entries)
        if matrices.size != self.entries[-1]:
            raise _core.ProblemError(
                f"{name}: has {matrices.size} entries, expected {self.entries[-1]}"
            )
        self.shape: tuple[int, ...] = (int(spacedim * self.first[-1]),)
        if not self.ragged:
            self.shape = (self.count, spacedim * self.most)


def _starts(sizes: Any) -> Any:
    return np.concatenate(([0], np.cumsum(sizes))).astype(np.int64)


def _floats(cupy: Any, name: str, values: Any) -> DeviceArray:
    """A contiguous array of doubles on the GPU; no copy if it is one already."""
    if getattr(values, "requires_grad", False):
        raise _core.ProblemError(f"{name}: requires a gradient: give {name}.detach()")
    try:
        if isinstance(values, cupy.ndarray):
            array = values
        elif _is_device(values) and hasattr(values, "__dlpack__"):
            array = cupy.from_dlpack(values)
        else:
            array = cupy.asarray(values)
    except (TypeError, ValueError) as failure:
        raise _core.ProblemError(f"{name}: is not an array of numbers ({failure})") from None
    if array.dtype.kind not in "biuf":
        raise _core.ProblemError(f"{name}: is not an array of real numbers")
    return cupy.ascontiguousarray(array, dtype=cupy.float64)


def _arrays(
    cupy: Any,
    sizes: _Sizes,
    q: Any,
    mu: Any,
    velocity: Any,
    inverse_mass: Any,
    guess: Any,
    matrices: DeviceArray,
) -> dict[str, DeviceArray | None]:
    """What the kernel reads; None for what is not given."""

    def shaped(name: str, values: Any, shape: tuple[int, ...]) -> DeviceArray | None:
        if values is None:
            return None
        array = _floats(cupy, name, values)
        if array.device != matrices.device:
            raise _core.ProblemError(
                f"{name}: is on {array.device}, and the matrices are on {matrices.device}"
            )
        if array.shape != shape:
            raise _core.ProblemError(f"{name}: has the shape {array.shape}, expected {shape}")
        return array

    friction_shape = (sizes.count, sizes.most) if not sizes.ragged else (int(sizes.first[-1]),)
    friction = _floats(cupy, "mu", mu)
    try:
        friction = cupy.ascontiguousarray(cupy.broadcast_to(friction, friction_shape))
    except ValueError:
        raise _core.ProblemError(
            f"mu: has the shape {friction.shape}, which does not become {friction_shape}"
        ) from None
    arrays = {
        "matrices": matrices,
        "mu": friction,
        "q": shaped("q", q, sizes.shape),
        "guess": shaped("guess", guess, sizes.shape),
        "velocity": None,
        "inverse": None,
    }
    if not sizes.bodies:
        if q is None:
            raise _core.ProblemError("q: is missing")
        return arrays
    nv = sizes.coordinates
    if inverse_mass is None:
        raise _core.ProblemError("inverse_mass: is missing")
    if velocity is None and q is None:
        raise _core.ProblemError("velocity: is missing, and so is q")
    arrays["velocity"] = shaped("velocity", velocity, (sizes.count, nv))
    inverse = _floats(cupy, "inverse_mass", inverse_mass)
    expected = [(nv,), (sizes.count, nv), (sizes.count, nv, nv)]
    if inverse.shape not in expected:
        raise _core.ProblemError(
            f"inverse_mass: has the shape {inverse.shape}, expected one of {expected}"
        )
    if inverse.ndim < 3:
        arrays["inverse"] = inverse
        return arrays
    if sizes.ragged:
        raise _core.ProblemError("inverse_mass: a full matrix needs problems of the same contacts")
    # M^-1 = L L^T: the bodies L^-1 v have unit mass
    if arrays["velocity"] is not None:
        moved = cupy.matmul(matrices, arrays["velocity"][:, :, None])[:, :, 0]
        arrays["q"] = moved if arrays["q"] is None else moved + arrays["q"]
        arrays["velocity"] = None
    arrays["matrices"] = cupy.matmul(matrices, _root(cupy, inverse))
    arrays["inverse"] = cupy.ones(nv)
    return arrays


def _root(cupy: Any, inverse: DeviceArray) -> DeviceArray:
    """L of inverse = L L^T; NaN for a world where there is none. Coordinates may be fixed.

    CuPy does not say for which worlds its factors are wrong, so they are multiplied.
    """
    turned = inverse.transpose(0, 2, 1)
    fixed = (inverse == 0).all(axis=2) & (turned == 0).all(axis=2)
    unit = cupy.eye(inverse.shape[-1]) * fixed[:, :, None]
    root = cupy.linalg.cholesky((inverse + turned) / 2 + unit) * ~fixed[:, :, None]
    size = cupy.sqrt(cupy.abs(cupy.diagonal(inverse, axis1=1, axis2=2)))
    allowed = ROUNDING_OF_MASS * size[:, :, None] * size[:, None, :]
    gap = cupy.abs(cupy.matmul(root, root.transpose(0, 2, 1)) - inverse)
    good = (gap <= allowed).all(axis=(1, 2))
    return cupy.where(good[:, None, None], root, cupy.nan)


def _width(cupy: Any, sizes: _Sizes, jacobian: DeviceArray) -> int:
    """How many coordinates a contact touches at most."""
    nv = sizes.coordinates
    touched = (jacobian.reshape(-1, sizes.spacedim, nv) != 0).any(axis=1)
    return max(1, int(touched.sum(axis=1).max()))


def _launch(
    cupy: Any, device: int, sizes: _Sizes, arrays: dict[str, DeviceArray | None], tol: float
) -> DeviceBatchResult:
    count, timer = sizes.count, TIMER
    r, u = (cupy.zeros(sizes.shape) for _ in range(2))
    status, iterations = (cupy.zeros(count, dtype=cupy.int32) for _ in range(2))
    error = cupy.zeros(count)
    offsets = cupy.asarray(sizes.spacedim * sizes.first) if sizes.ragged else None
    result = DeviceBatchResult(r, u, status, error, iterations, offsets, 0)
    if count == 0 or sizes.most == 0:
        return result
    if sizes.most > MOST_CONTACTS:
        status.fill(result.statuses.index("stalled"))
        error.fill(np.inf)
        return result
    matrices = arrays["matrices"]
    wide = sizes.bodies and sizes.coordinates > FEW_COORDINATES
    macros = plan(
        "bodies" if sizes.bodies else "W",
        sizes.spacedim,
        sizes.most,
        not sizes.ragged,
        sizes.coordinates,
        _width(cupy, sizes, matrices) if wide else 0,
    )
    found = kernel(device, tuple(macros.items()))
    if not sizes.bodies and not macros["COPIES"]:
        matrices = _by_columns(cupy, sizes, matrices)
    blocks = min(found.blocks, -(-count // found.groups))
    workspace = cupy.empty(max(1, found.workspace * blocks // 8))
    nothing = np.uint64(0)
    inverse = arrays["inverse"]
    arguments = (
        np.int64(count),
        np.int32(sizes.most),
        cupy.asarray(sizes.counts.astype(np.int32)) if sizes.ragged else nothing,
        cupy.asarray(sizes.first) if sizes.ragged else nothing,
        cupy.asarray(sizes.entries) if sizes.ragged else nothing,
        matrices,
        nothing if inverse is None else inverse,
        np.int64(sizes.coordinates if inverse is not None and inverse.ndim == 2 else 0),
        *(nothing if arrays[name] is None else arrays[name] for name in ("velocity", "q")),
        arrays["mu"],
        nothing if arrays["guess"] is None else arrays["guess"],
        np.float64(tol),
        np.int32(MOST_STEPS),
        cupy.zeros(1, dtype=cupy.uint64),
        r,
        u,
        status,
        error,
        iterations,
        workspace,
    )
    if timer is not None:
        timer[0].record()
    found.solve((blocks,), (found.threads,), arguments, shared_mem=found.shared)
    if timer is not None:
        timer[1].record()
    # the kernel's endings: converged, unsolved, invalid
    places = ("converged", "stalled", "invalid")
    named = cupy.asarray([result.statuses.index(name) for name in places], dtype=cupy.int32)
    status[...] = named[status]
    return result


def _by_columns(cupy: Any, sizes: _Sizes, W: DeviceArray) -> DeviceArray:
    """Each matrix transposed: lanes of neighbouring rows then read neighbouring entries."""
    if not sizes.ragged:
        return cupy.ascontiguousarray(W.transpose(0, 2, 1))
    result = cupy.empty_like(W)
    for nc in np.unique(sizes.counts):
        m = int(sizes.spacedim * nc)
        starts = cupy.asarray(sizes.entries[:-1][sizes.counts == nc])
        places = starts[:, None] + cupy.arange(m * m)
        result[places] = W[places].reshape(-1, m, m).transpose(0, 2, 1).reshape(-1, m * m)
    return result


def _finish(
    cupy: Any,
    sizes: _Sizes,
    arrays: dict[str, DeviceArray | None],
    result: DeviceBatchResult,
    tol: float,
    threads: int,
    time_limit: float | None,
    on_cpu: Callable[..., Any],
) -> DeviceBatchResult:
    """Solves on the CPU what the GPU left, from where it left it."""
    left = cupy.asnumpy(result.unsolved)
    status = cupy.asnumpy(result.status[result.unsolved])
    left = left[status != result.statuses.index("invalid")]
    if not len(left):
        return result
    problems = [_on_host(cupy, sizes, arrays, int(k)) for k in left]
    d = sizes.spacedim
    flat = {name: result.__dict__[name].reshape(-1) for name in ("r", "u")}
    parts = [slice(d * int(sizes.first[k]), d * int(sizes.first[k + 1])) for k in left]
    found = on_cpu(
        *([one[k] for one in problems] for k in range(3)),
        spacedim=d,
        guess=[cupy.asnumpy(flat["r"][part]) for part in parts],
        tol=tol,
        threads=threads,
        time_limit=time_limit,
    )
    assert found.offsets is not None
    for part, begin, end in zip(parts, found.offsets[:-1], found.offsets[1:], strict=True):
        for name in ("r", "u"):
            flat[name][part] = cupy.asarray(getattr(found, name)[begin:end])
    places = cupy.asarray(left)
    names = [result.statuses.index(found.statuses[k]) for k in found.status]
    result.status[places] = cupy.asarray(names, dtype=cupy.int32)
    result.error[places] = cupy.asarray(found.error)
    result.iterations[places] = cupy.asarray(found.iterations)
    return DeviceBatchResult(
        result.r, result.u, result.status, result.error, result.iterations, result.offsets,
        len(left),
    )  # fmt: skip


def _on_host(
    cupy: Any, sizes: _Sizes, arrays: dict[str, DeviceArray | None], k: int
) -> tuple[Any, Any, Any]:
    """W, q and mu of problem k."""
    d, nc = sizes.spacedim, int(sizes.counts[k])
    first, last = (int(x) for x in sizes.first[k : k + 2])

    def part(name: str, begin: int, end: int) -> Any:
        array = arrays[name]
        return None if array is None else cupy.asnumpy(array.reshape(-1)[begin:end])

    matrix = part("matrices", int(sizes.entries[k]), int(sizes.entries[k + 1]))
    q, mu = part("q", d * first, d * last), part("mu", first, last)
    if not sizes.bodies:
        return matrix.reshape(d * nc, d * nc), q, mu
    nv = sizes.coordinates
    inverse = arrays["inverse"]
    assert inverse is not None
    row = cupy.asnumpy(inverse[k] if inverse.ndim == 2 else inverse)
    moving = part("velocity", nv * k, nv * (k + 1))
    return *local(matrix.reshape(d * nc, nv), row, moving, q), mu


def gram(jacobian: Any, inverse: Any) -> Any:
    """W = J M^-1 J^T of one world, or of each; the inverse is full, or the diagonal."""
    full = inverse.ndim == jacobian.ndim
    halfway = jacobian @ inverse if full else jacobian * inverse[..., None, :]
    return halfway @ np.swapaxes(jacobian, -1, -2)


def local(jacobian: Any, inverse: Any, velocity: Any, q: Any) -> tuple[Any, Any]:
    """W and q of a problem given by its bodies."""
    moved = 0.0 if velocity is None else jacobian @ velocity
    return gram(jacobian, inverse), moved if q is None else moved + q
