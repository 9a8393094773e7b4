"""The powers of 2 to whose multiples stored states are rounded."""

from __future__ import annotations

import math
from typing import Final

# quanta 2^e in m, rad, m/s, rad/s, s: about 1 nm; finer in proportion for bodies below 16 mm
RIGID: Final = -30
PER_SIZE: Final = -24  # exponent relative to the smallest body's size
# elastic displacements are small: 1e-12 m
ELASTIC: Final = -40


def exponent_of(size: float | None) -> int:
    """The exponent e, for the size of the smallest body [m]; None: elastic displacements."""
    if size is None:
        return ELASTIC
    return min(RIGID, PER_SIZE + math.floor(math.log2(size)))
