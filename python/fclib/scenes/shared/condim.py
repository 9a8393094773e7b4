"""Which moments the contacts of a MuJoCo model may resist: its condim and friction."""

from __future__ import annotations

from typing import Any


def spins(m: Any) -> bool:
    """Whether a contact of the model may resist spin (condim 4 and 6)."""
    of_shapes = (m.geom_condim >= 4) & collides(m) & (m.geom_friction[:, 1] > 0)
    of_pairs = (m.pair_dim >= 4) & (m.pair_friction[:, 2] > 0)
    return bool(of_shapes.any() or of_pairs.any())


def has_condim(m: Any, condim: int) -> bool:
    """Whether a contact of the model may have so many components; with 6 it resists rolling."""
    return bool(condim in m.geom_condim[collides(m)] or condim in m.pair_dim)


def collides(m: Any) -> Any:
    """The geoms that may touch others, as booleans."""
    return (m.geom_contype != 0) | (m.geom_conaffinity != 0)
