"""What a deck of LMGC90 says: bodies, materials, laws, starts and what is driven."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from fclib.scenes.shared.deck_lines import Place
from fclib.scenes.shared.interaction import Course

Vector = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

RIGID, MESH = "RBDY3", "MAILx"
# what LMGC90 has and this reader does not take: it is left out
OTHER_BODIES: Final = ("RBDY2", "MBS2D", "MBS3D")
OTHER_CONTACTORS: Final = (
    *("SPHEb", "PLANb", "POLYF", "CYLND", "DNLYC", "PT3Dx", "POLYD", "CSpx3", "CSpx6", "CSpx8"),
    *("ASpx3", "ASpx6", "ASpx8", "CLxxx", "ALpxx", "DISKx", "JONCx", "xKSID", "POLYG", "PT2Dx"),
)
# the word for contactors of meshes in see tables
SEEN: Final = {"CSpx4": "CSxxx", "ASpx4": "ASpxx"}
CONTACTORS: Final = {RIGID: ("SPHER", "PLANx", "POLYR"), MESH: ("CSpx4", "ASpx4")}
ELEMENT: Final = "H8xxx"
FRAME: Final = 1e-5  # axes of a body are written with seven digits


@dataclass(frozen=True, kw_only=True)
class Contactor:
    """A shape of a rigid body, at its centre and along the axes of BODIES.DAT."""

    kind: str  # SPHER, PLANx or POLYR
    colour: str
    size: tuple[float, ...] = ()  # SPHER: radius; PLANx: half edges [m]
    turn: Vector = field(default_factory=lambda: np.eye(3))  # PLANx: its axes, as columns
    shift: Vector = field(default_factory=lambda: np.zeros(3))  # PLANx: its place [m]
    vertices: Vector = field(default_factory=lambda: np.zeros((0, 3)))  # POLYR (k x 3) [m]
    faces: Integers = field(default_factory=lambda: np.zeros((0, 3), np.int64))  # (f x 3) from 0
    place: Place


@dataclass(frozen=True, kw_only=True)
class RigidBody:
    """A rigid body, RBDY3."""

    material: str
    radius: float  # of a sphere of its volume, avrd; 0: the volume follows from the contactors [m]
    gyration: float  # gyrd [m]; 0: the inertia follows from the contactors
    inertia: tuple[float, float, float]  # I1, I2, I3 for the density 1; 0: as above [m^5]
    centre: Vector  # (3) the origin of the contactors [m]
    contactors: tuple[Contactor, ...]
    place: Place


@dataclass(frozen=True, kw_only=True)
class Patch:
    """Quads of a mesh that are contactors together."""

    kind: str  # CSpx4, whose points are candidates, or ASpx4
    colour: str
    quads: Integers  # (q x 4) nodes, from 0
    place: Place


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """A deformable body, MAILx, of elements H8."""

    nodes: Vector  # (k x 3) [m]
    elements: Integers  # (e x 8) nodes, from 0
    model: str
    material: str
    patches: tuple[Patch, ...]
    place: Place


@dataclass(frozen=True, kw_only=True)
class Material:
    """A bulk behaviour."""

    density: float  # [kg/m^3]
    young: float | None = None  # Young's modulus [Pa]; None: rigid
    poisson: float = 0.0  # Poisson's ratio
    place: Place


@dataclass(frozen=True, kw_only=True)
class Law:
    """A contact behaviour."""

    name: str  # of LMGC90, as IQS_CLB
    mu: float | None  # None: a law that is not known here
    place: Place


@dataclass(frozen=True, kw_only=True)
class See:
    """Which contactors see each other, up to the alert distance [m], and by which law."""

    first: tuple[str, str]  # kind and colour of the candidate
    second: tuple[str, str]
    law: str  # the nickname
    alert: float
    place: Place


@dataclass(frozen=True, kw_only=True)
class Start:
    """The start of a node, or of a rigid body."""

    displacement: Vector  # (3), (6) [m], [rad]
    velocity: Vector  # (3), (6) [m/s], [rad/s]; spins about the axes of inertia
    frame: Vector | None  # (3 x 3) columns: the axes of the body
    place: Place


@dataclass(frozen=True, kw_only=True)
class Driven:
    """A degree of freedom whose velocity or force is given."""

    body: tuple[str, int]  # RBDY3 or MAILx, number from 0 in the order of BODIES.DAT
    node: int  # from 0
    axis: int  # 0, ..., 5
    velocity: bool  # else a force
    course: Course
    place: Place


@dataclass(frozen=True, kw_only=True)
class Deck:
    """All that a folder says."""

    path: Path
    gravity: Vector  # (3) [m/s^2]
    materials: dict[str, Material]
    lumped: dict[str, bool]  # of each model of meshes: whether its mass is lumped
    laws: dict[str, Law]
    sees: tuple[See, ...]
    rigid: tuple[RigidBody, ...]
    meshes: tuple[Mesh, ...]
    starts: dict[tuple[str, int, int], Start]  # by kind, number and node, from 0
    driven: tuple[Driven, ...]
    unknown: tuple[str, ...]  # what is left out, with file and line
    sha256: dict[str, str]  # of each file that was read
