"""One name for a problem's data, whatever file, storage or library version it came from."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

# what Coulomb's law is asked of: matrices, vectors and coefficients, in this order
FIELDS = ("M", "H", "G", "W", "V", "R", "f", "w", "b", "q", "s", "mu", "mu_r")


def digest(problem: Any) -> str:
    """SHA-256 of a problem's data (64 hexadecimal digits).

    Equal problems have equal digests: matrices count by their entries, so neither their storage
    nor explicit zeros matter, and duplicates of a triplet are summed; titles and descriptions do
    not count. -0 and 0 are one.

    Args:
        problem: any formulation.
    """
    import scipy.sparse as sp  # takes a while, and not everyone needs it

    sha = hashlib.sha256(f"{problem.kind} {problem.spacedim}".encode())
    for name in FIELDS:
        value = getattr(problem, name, None)
        if value is None:
            continue
        if sp.issparse(value) or np.ndim(value) == 2:
            matrix = sp.csc_array(value, copy=True)
            matrix.sum_duplicates()
            matrix.eliminate_zeros()
            sha.update(f" {name} {matrix.shape[0]}x{matrix.shape[1]} {matrix.nnz} ".encode())
            # int64 and little-endian on every machine
            sha.update(matrix.indptr.astype("<i8").tobytes())
            sha.update(matrix.indices.astype("<i8").tobytes())
            numbers = matrix.data
        else:
            numbers = np.asarray(value)
            sha.update(f" {name} {numbers.size} ".encode())
        sha.update((numbers.astype("<f8") + 0.0).tobytes())
    return sha.hexdigest()
