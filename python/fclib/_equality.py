"""Equality of objects that hold arrays."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np


class EqualByEntries:
    """A dataclass whose fields may be arrays: equal if these are, entry by entry."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(_equal(a, b) for a, b in zip(_values(self), _values(other), strict=True))

    def __hash__(self) -> int:
        return hash((type(self), tuple(np.shape(value) for value in _values(self))))


def _values(one: Any) -> list[Any]:
    return [getattr(one, field.name) for field in dataclasses.fields(one)]


def _equal(a: Any, b: Any) -> bool:
    if type(a) is not type(b) or np.shape(a) != np.shape(b):
        return False
    if hasattr(a, "nnz"):  # sparse: SciPy is not imported for this
        return bool(a.nnz == b.nnz and abs(a - b).sum() == 0)
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    return bool(a == b)
