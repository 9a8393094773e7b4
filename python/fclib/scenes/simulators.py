"""Problems that other engines solved: a pile of boxes that comes down, recorded in each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fclib.scenes.shared.recorded import Recorded


@dataclass(frozen=True, kw_only=True)
class DrakeBoxes(Recorded):
    """Six boxes of growing mass, each further out than the one below, that lean and come down.

    Drake made M, H and f of each step, and found its contacts, with spheres in the corners of each
    box against the faces of others. Its own law is compliant; here its contacts are rigid, w = 0.
    A file has Drake's reaction as its guess.
    """

    title: ClassVar[str] = "Boxes in Drake"
    description: ClassVar[str] = "A leaning pile of boxes comes down, stepped by Drake."
    authors: ClassVar[str] = "the authors of FCLIB, with Drake"


@dataclass(frozen=True, kw_only=True)
class NewtonBoxes(Recorded):
    """Six boxes of growing mass, each further out than the one below, that lean and come down.

    Kamino, Newton's solver of rigid bodies, made all data of each step, in single precision:
    penetrations are corrected by w, and contacts that are still open have w = gap / h. A file has
    Kamino's reaction as its guess.
    """

    title: ClassVar[str] = "Boxes in Newton"
    description: ClassVar[str] = "A leaning pile of boxes comes down, stepped by Newton's Kamino."
    authors: ClassVar[str] = "the authors of FCLIB, with Newton"


@dataclass(frozen=True, kw_only=True)
class PyBulletBoxes(Recorded):
    """Six boxes of growing mass, each further out than the one below, that lean and come down.

    Bullet found the contacts, up to four of a pair, kept from step to step. It corrects
    penetrations, which the problem does not: w = 0. A file has Bullet's reaction as its guess.
    """

    title: ClassVar[str] = "Boxes in PyBullet"
    description: ClassVar[str] = "A leaning pile of boxes comes down, stepped by PyBullet."
    authors: ClassVar[str] = "the authors of FCLIB, with PyBullet"


@dataclass(frozen=True, kw_only=True)
class SiconosBoxes(Recorded):
    """Six boxes of growing mass, each further out than the one below, that lean and come down.

    Siconos made all data of each step by Moreau and Jean's scheme, with the law that is FCLIB's
    own; Bullet found the contacts. The boxes have edges of 1 m, and spins are in their own frames.
    If a contact is tilted about two axes, T1 is not at right angles to N: so Siconos solved it. A
    file has the reaction of Siconos' nonsmooth Gauss-Seidel as its guess; it has no points.
    """

    title: ClassVar[str] = "Boxes in Siconos"
    description: ClassVar[str] = "A leaning pile of boxes comes down, stepped by Siconos."
    authors: ClassVar[str] = "the authors of FCLIB, with Siconos"
