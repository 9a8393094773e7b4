"""One name for a problem's data, whatever its file, storage or library version."""

from __future__ import annotations

import hashlib
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Numbers: TypeAlias = npt.NDArray[np.float64]

# the data of Coulomb's law: matrices, vectors and coefficients, in this order
FIELDS = ("M", "H", "G", "W", "V", "R", "f", "w", "b", "q", "s", "mu", "mu_r")
# what spin friction adds; the sketch is without it
SPIN = ("mu_s",)
# relative to a matrix's largest entry: a smaller entry may be 0 on another machine
ROUNDING = 1e-12


def digest(problem: Any) -> str:
    """SHA-256 of a problem's data (64 hexadecimal digits).

    Equal problems have equal digests: matrices count by their entries, so neither their storage
    nor explicit zeros matter, and duplicates of a triplet are summed; titles and descriptions do
    not count. -0 and 0 are equal.

    Args:
        problem: any formulation.
    """
    sha = hashlib.sha256(_sizes(problem).encode())
    for name, part in parts(problem).items():
        if isinstance(part, np.ndarray):
            sha.update(f" {name} {part.size} ".encode())
            numbers = part
        else:
            sha.update(f" {name} {part.shape[0]}x{part.shape[1]} {part.nnz} ".encode())
            # int64 and little-endian on every machine
            sha.update(part.indptr.astype("<i8").data)
            sha.update(part.indices.astype("<i8").data)
            numbers = part.data
        sha.update((numbers.astype("<f8", copy=False) + 0.0).data)
    return sha.hexdigest()


def _sizes(problem: Any) -> str:
    coupled = " coupled" if getattr(problem, "coupled", 0) else ""
    return f"{problem.kind} {problem.spacedim}{coupled}"


def structure(problem: Any) -> str:
    """SHA-256 of a problem's sizes and of the places of its matrices' entries.

    Entries below ROUNDING of the largest do not count: a zero on one machine is 1e-17 on another.
    """
    sha = hashlib.sha256(_sizes(problem).encode())
    for name, part in parts(problem).items():
        if isinstance(part, np.ndarray):
            sha.update(f" {name} {part.size} ".encode())
            continue
        sha.update(f" {name} {part.shape[0]}x{part.shape[1]} ".encode())
        size = np.abs(part.data)
        kept = size > ROUNDING * size.max(initial=0.0)
        sha.update(places(part)[kept].astype("<u8").tobytes())
    return sha.hexdigest()


def sketch(problem: Any) -> Numbers:
    """Two sums with signs of the entries of each matrix and vector (13 x 2), NaN if it has none.

    The signs are those of a hash of the entry's place. If two problems have the same structure, the
    root mean square of a matrix's two differences estimates the Frobenius norm of its difference.
    """
    sums = np.full((len(FIELDS), 2), np.nan)
    for name, part in parts(problem).items():
        if name in SPIN:  # stored sketches have a row for each of FIELDS
            continue
        place, numbers = places(part), part if isinstance(part, np.ndarray) else part.data
        sums[FIELDS.index(name)] = [numbers @ signs(place, k) for k in range(2)]
    return sums


def distance(problem: Any, known: Numbers) -> dict[str, float]:
    """The distance of a problem from that of a sketch: ||A - A'|| / ||A||, if it is not 0.

    It is estimated from two sums with signs. If many entries differ, one in 64 estimates is more
    than eight times too small; if few differ, they may cancel. The sizes must be equal. Sketches
    have no coefficients of spin friction.
    """
    own = sketch(problem)
    found = {}
    for name, part in parts(problem).items():
        if name in SPIN:
            continue
        numbers = part if isinstance(part, np.ndarray) else part.data
        row = FIELDS.index(name)
        apart = float(np.sqrt(np.mean((own[row] - known[row]) ** 2)))
        size = float(np.linalg.norm(numbers))
        if apart:
            found[name] = apart / size if size else np.inf
    return found


def difference(first: Any, second: Any) -> dict[str, float]:
    """The largest difference of two entries, relative to the largest entry, if it is not 0.

    Returns:
        For each matrix and vector that differs; infinite if its size differs.
    """
    one, two = parts(first), parts(second)
    found = {}
    for name in one.keys() | two.keys():
        a, b = one.get(name), two.get(name)
        if a is None or b is None or a.shape != b.shape:
            found[name] = np.inf
            continue
        apart, size = float(abs(a - b).max()) if min(a.shape) else 0.0, 0.0
        if apart:
            size = float(abs(a).max())
            found[name] = apart / size if size else np.inf
    return {name: found[name] for name in FIELDS if name in found}


def parts(problem: Any) -> dict[str, Any]:
    """A problem's matrices, by columns without explicit zeros, and its vectors, by name."""
    import scipy.sparse as sp  # the import takes a while, and not everyone needs it

    found: dict[str, Any] = {}
    for name in FIELDS + SPIN:
        value = getattr(problem, name, None)
        if value is None:
            continue
        if sp.issparse(value) or np.ndim(value) == 2:
            if getattr(value, "format", "") == "csc" and value.has_canonical_format:
                matrix = value
            else:
                matrix = sp.csc_array(value, copy=True)
                matrix.sum_duplicates()
            if not matrix.data.all():
                matrix = matrix.copy()
                matrix.eliminate_zeros()
            found[name] = matrix
        else:
            found[name] = np.asarray(value, dtype=float)
    return found


def places(part: Any) -> npt.NDArray[np.uint64]:
    """The place of each entry of a matrix, column by column, or of a vector."""
    if isinstance(part, np.ndarray):
        return np.arange(part.size, dtype=np.uint64)
    columns = np.repeat(np.arange(part.shape[1], dtype=np.uint64), np.diff(part.indptr))
    place: npt.NDArray[np.uint64] = columns * np.uint64(part.shape[0])
    place += part.indices.astype(np.uint64)
    return place


def signs(place: npt.NDArray[np.uint64], which: int) -> Numbers:
    """Signs of places: a bit of a hash of each (splitmix64)."""
    x = place + np.uint64((which + 1) * 0x9E3779B97F4A7C15 % 2**64)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        x = (x ^ (x >> np.uint64(shift))) * np.uint64(factor)
    x ^= x >> np.uint64(31)
    return 1.0 - 2.0 * (x & np.uint64(1)).astype(float)
