"""The bridge of voussoirs of LMGC90's authors, as LMGC90's engine stepped it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fclib.scenes.shared.recorded import Recorded


@dataclass(frozen=True, kw_only=True)
class LMGC90Bridge(Recorded):
    """22 voussoirs on a fixed plate, loaded by weights and by a force that grows on one of them.

    LMGC90's engine, as compas_lmgc90 has it, stepped the deck Bridge_PR of V. Acary and the
    developers of LMGC90: each tenth of 500 steps of 1 ms. Its contacts are those of faces that meet
    at the start. The engine takes one coefficient of friction, that between voussoirs (1.15); the
    deck has 0.9 on the plate. A file has the engine's reaction as its guess; sweeps of the engine
    stop early.
    """

    title: ClassVar[str] = "A bridge in LMGC90"
    description: ClassVar[str] = "A bridge of voussoirs under load, stepped by LMGC90."
    authors: ClassVar[str] = "V. Acary, the developers of LMGC90; recorded with compas_lmgc90"
    application: ClassVar[str] = "masonry"
    collection: ClassVar[str] = "decks"
    problems: ClassVar[int] = 50
