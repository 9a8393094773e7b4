"""Decks of LMGC90, a folder DATBOX: what its files say, without any mechanics.

    deck = read(folder)

BODIES.DAT (rigid bodies RBDY3 and meshes MAILx, with their contactors), BULK_BEHAV.DAT (gravity and
materials), TACT_BEHAV.DAT (laws, and which contactors see each other), and, if they are there,
MODELS.DAT (of meshes), DOF.INI (the start) and DRV_DOF.DAT (velocities and forces that are given).

LMGC90 numbers bodies of a kind by their order in the file; the numbers that are written need not
agree, since decks are often joined. A number that begins again at 1 therefore begins a part. What a
file holds and nobody here knows is left out, and named with its line in `Deck.unknown`.

F. Dubois, M. Jean, M. Renouf, R. Mozul, A. Martin, M. Bagneris, LMGC90, 10e colloque national en
  calcul des structures, 2011.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NoReturn

import numpy as np
import numpy.typing as npt

from fclib.scenes.shared.interaction import LAWS, Course

Vector = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

FOLDER: Final = "DATBOX"
NEEDED: Final = ("BODIES.DAT", "BULK_BEHAV.DAT", "TACT_BEHAV.DAT")
MODELS, START, DRIVEN = "MODELS.DAT", "DOF.INI", "DRV_DOF.DAT"
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
_PAIR = re.compile(r"([A-Za-z_]\w*(?:\(\d\))?)\s*[=:]\s*(\S+)")


class DeckError(ValueError):
    """A deck that is wrong: the message names the file and the line."""


@dataclass(frozen=True)
class Place:
    """A line of a file."""

    path: Path
    line: int

    def __str__(self) -> str:
        return f"{self.path.name}:{self.line}"

    def fail(self, words: str) -> NoReturn:
        """Raise DeckError."""
        raise DeckError(f"{self.path}:{self.line}: {words}")


@dataclass(frozen=True, kw_only=True)
class Contactor:
    """A shape of a rigid body, at its centre and along the axes of BODIES.DAT."""

    kind: str  # SPHER, PLANx or POLYR
    colour: str
    size: tuple[float, ...] = ()  # SPHER: radius; PLANx: half edges [m]
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


def folder_of(path: str | Path) -> Path | None:
    """The folder of a deck, if a path is one: it or its DATBOX has BODIES.DAT."""
    for folder in (Path(path), Path(path) / FOLDER):
        if folder.is_dir() and any((folder / name).exists() for name in NEEDED):
            return folder
    return None


def read(path: str | Path) -> Deck:
    """Read a deck. DeckError if it is wrong, OSError if a file cannot be read."""
    folder = folder_of(path)
    if folder is None:
        raise DeckError(f"{path}: is no deck of LMGC90: it has no {NEEDED[0]}")
    for name in NEEDED:
        if not (folder / name).is_file():
            raise DeckError(f"{folder / name}: is missing; a deck has {', '.join(NEEDED)}")
    return _Reader(folder).deck()


def number(text: str, place: Place, name: str) -> float:
    """A finite number as Fortran writes it, 0.1D+01. DeckError."""
    try:
        value = float(re.sub("[dD]", "e", text))
    except ValueError:
        place.fail(f"{name}: {text!r} is no number")
    if not math.isfinite(value):
        place.fail(f"{name}: {text!r} is not finite")
    return value


def whole(text: str, place: Place, name: str) -> int:
    """An integer. DeckError."""
    try:
        return int(text)
    except ValueError:
        place.fail(f"{name}: {text!r} is no whole number")


def check_numbers(written: list[tuple[int, Place]]) -> None:
    """DeckError if the numbers of bodies do not increase in each part; 1 begins a part.

    Of two bodies 1 in a row, the second begins a part, so the next one is body 2 of it.
    """
    for i, (now, place) in enumerate(written):
        before = written[i - 1][0] if i else 0
        if now > before and (i < 2 or now == 2 or (before, written[i - 2][0]) != (1, 1)):
            continue
        last = i + 1 == len(written)
        if now == 1 and (before != 1 or not last):
            continue
        twice, there = (before, written[i - 1][1]) if now > before else (now, place)
        there.fail(f"the number {twice} of a body is there twice, or out of order")


@dataclass(frozen=True)
class Line:
    """A line with words."""

    place: Place
    text: str

    @property
    def words(self) -> list[str]:
        """Its words."""
        return self.text.split()

    @property
    def values(self) -> list[tuple[str, str]]:
        """Its entries NAME= VALUE, in order."""
        return _PAIR.findall(self.text)

    def named(self, name: str) -> str:
        """The value of a name. DeckError if there is none."""
        for key, value in self.values:
            if key.lower() == name.lower():
                return value
        self.place.fail(f"has no {name}= (the line is cut, or another one was expected here)")

    def numbers(self, count: int, what: str) -> list[float]:
        """So many numbers NAME= VALUE. DeckError if there are fewer."""
        values = self.values
        if len(values) < count:
            self.place.fail(
                f"{what}: {count} numbers are expected here, and there are {len(values)}"
            )
        return [number(text, self.place, name) for name, text in values[:count]]


class _Lines:
    """The lines of a file, after its heading, without comments."""

    def __init__(self, path: Path) -> None:
        content = path.read_bytes()
        self.path, self.sha256 = path, hashlib.sha256(content).hexdigest()
        self.lines = []
        inside = False
        for i, text in enumerate(content.decode("latin-1").splitlines(), 1):
            stripped = text.strip()
            inside |= stripped.startswith("$")
            if inside and stripped and not stripped.startswith("!"):
                self.lines.append(Line(Place(path, i), stripped))
        self.next = 0
        self.end = Place(path, content.count(b"\n") + 1)

    def __bool__(self) -> bool:
        return self.next < len(self.lines)

    def peek(self) -> Line | None:
        """The next line; None at the end."""
        return self.lines[self.next] if self else None

    def take(self, what: str) -> Line:
        """The next line, inside of a record. DeckError if there is none."""
        if not self:
            self.end.fail(f"the file ends where {what} is expected")
        self.next += 1
        return self.lines[self.next - 1]

    def body(self) -> Iterator[Line]:
        """The lines up to the next keyword, which begins with $."""
        while self and not self.lines[self.next].text.startswith("$"):
            yield self.take("")


def keyword(line: Line) -> str:
    """The word after $, or empty."""
    return line.words[0][1:] if line.text.startswith("$") else ""


class _Reader:
    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.unknown: list[str] = []
        self.sha256: dict[str, str] = {}
        # (k) of each mesh of the file its number among those that are taken; -1: left out
        self.mesh_number: list[int] = []

    def lines(self, name: str) -> _Lines | None:
        """The lines of a file; None if there is no such file."""
        path = self.folder / name
        if not path.is_file():
            return None
        found = _Lines(path)
        self.sha256[name] = found.sha256
        return found

    def skip(self, place: Place, words: str) -> None:
        """Say that something is left out."""
        self.unknown.append(f"{place}: {words}")

    def deck(self) -> Deck:
        gravity, materials = self.bulk()
        lumped = self.models()
        rigid, meshes = self.bodies()
        if not rigid and not meshes:
            raise DeckError(f"{self.folder / NEEDED[0]}:1: has no body that is known here")
        laws, sees = self.tact()
        named = [(body.material, body.place) for body in rigid]
        named += [(mesh.material, mesh.place) for mesh in meshes]
        for name, place in named:
            if name not in materials:
                place.fail(f"the material {name!r} is not in BULK_BEHAV.DAT")
        for mesh in meshes:
            if mesh.model not in lumped:
                mesh.place.fail(f"the model {mesh.model!r} is not in MODELS.DAT")
            if materials[mesh.material].young is None:
                mesh.place.fail(f"the material {mesh.material!r} is rigid, and this is a mesh")
        self.nodes = {RIGID: [1] * len(rigid), MESH: [len(mesh.nodes) for mesh in meshes]}
        starts = self.starts()
        driven = self.driven()
        self.check_unread()
        return Deck(
            path=self.folder,
            gravity=gravity,
            materials=materials,
            lumped=lumped,
            laws=laws,
            sees=self.known_sees(laws, sees, rigid, meshes),
            rigid=rigid,
            meshes=meshes,
            starts=starts,
            driven=driven,
            unknown=tuple(self.unknown),
            sha256=self.sha256,
        )

    # ---- BULK_BEHAV.DAT, MODELS.DAT

    def bulk(self) -> tuple[Vector, dict[str, Material]]:
        lines = self.lines("BULK_BEHAV.DAT")
        assert lines is not None
        gravity = np.zeros(3)
        materials: dict[str, Material] = {}
        while lines:
            head = lines.take("a keyword")
            word = keyword(head)
            rest = list(lines.body())
            if word == "gravy":
                if not rest:
                    head.place.fail("gravity: grv1, grv2 and grv3 are expected")
                gravity = np.array(rest[0].numbers(3, "gravity"))
            elif word == "behav":
                name, material = self.material(head, rest)
                if name in materials:
                    rest[0].place.fail(f"the material {name!r} is there twice")
                materials[name] = material
            else:
                self.skip(head.place, f"the keyword {head.words[0]} is not known")
        return gravity, materials

    def material(self, head: Line, rest: list[Line]) -> tuple[str, Material]:
        if not rest or len(rest[0].words) < 2:
            (rest[0] if rest else head).place.fail("a material: its name and kind are expected")
        name, kind = rest[0].words[:2]
        place = rest[0].place
        density = number(rest[0].named("Umas"), place, "Umas")
        if not density > 0:
            place.fail(f"the density of {name!r} must be > 0, not {density:g}")
        if kind == "RIGID":
            return name, Material(density=density, place=place)
        if kind != "ELAS":
            self.skip(place, f"the material {kind} is not known: {name!r} is taken as rigid")
            return name, Material(density=density, place=place)
        young = poisson = None
        for line in rest[1:]:
            for key, text in line.values:
                if key == "EYng":
                    young = number(text, line.place, key)
                elif key == "Epss":
                    poisson = number(text, line.place, key)
                elif (key, text) not in (("elas", "standard"), ("ani_", "isotropic")):
                    self.skip(line.place, f"{key}= {text} of the material {name!r} is not known")
        if young is None or poisson is None:
            place.fail(f"the elastic material {name!r} has no EYng= or no Epss=")
        if not young > 0 or not -1 < poisson < 0.5:
            place.fail(f"{name!r}: EYng must be > 0 and Epss in (-1, 0.5): {young:g}, {poisson:g}")
        return name, Material(density=density, young=young, poisson=poisson, place=place)

    def models(self) -> dict[str, bool]:
        lines = self.lines(MODELS)
        known: dict[str, bool] = {}
        while lines:
            head = lines.take("a keyword")
            rest = list(lines.body())
            if keyword(head) != "model":
                self.skip(head.place, f"the keyword {head.words[0]} is not known")
                continue
            if not rest:
                head.place.fail("a model: its name is expected")
            name = rest[0].words[0]
            if name in known:
                rest[0].place.fail(f"the model {name!r} is there twice")
            known[name] = True
            words = [(word, line) for line in rest for word in line.words][1:]
            texts = [word for word, _ in words]
            if "Rxx3D" in texts:
                continue
            options = [pair for pair in words if pair[0] not in ("MECAx", ELEMENT)]
            usual = {"kine_": "small", "isext": "yes__", "aniso": "iso__", "mater": "elas_"}
            for (option, line), (value, _) in zip(options[::2], options[1::2], strict=False):
                if option == "mstrg":
                    known[name] = value == "lump_"
                    if value not in ("lump_", "coher"):
                        self.skip(line.place, f"mstrg {value} is not known: lump_ is taken")
                elif usual.get(option) != value:
                    self.skip(line.place, f"{option} {value} of the model {name!r} is not known")
            if len(options) % 2:
                options[-1][1].place.fail(f"the option {options[-1][0]} has no value")
        return known

    # ---- BODIES.DAT

    def bodies(self) -> tuple[tuple[RigidBody, ...], tuple[Mesh, ...]]:
        lines = self.lines("BODIES.DAT")
        assert lines is not None
        numbers: dict[str, list[tuple[int, Place]]] = {RIGID: [], MESH: []}
        rigid: list[RigidBody] = []
        meshes: list[Mesh] = []
        while lines:
            head = lines.take("a keyword")
            if keyword(head) == "bdyty":
                kind, written, place = self.head(lines)
                if kind not in CONTACTORS:
                    if kind not in OTHER_BODIES:
                        place.fail(f"{kind!r} is no kind of body")
                    self.skip(place, f"bodies {kind} are not known: this one is left out")
                    while lines and keyword(lines.lines[lines.next]) != "$$$$$":
                        lines.take("")
                    continue
                numbers[kind].append((written, place))
                if kind == RIGID:
                    rigid.append(self.rigid_body(lines, place))
                else:
                    mesh = self.mesh(lines, place)
                    self.mesh_number.append(-1 if mesh is None else len(meshes))
                    if mesh is not None:
                        meshes.append(mesh)
            elif head.text.startswith("$$"):
                continue
            else:
                head.place.fail(f"{head.text[:20]!r}: $bdyty or $$$$$$ is expected here")
        for own in numbers.values():
            check_numbers(own)
        return tuple(rigid), tuple(meshes)

    def head(self, lines: _Lines) -> tuple[str, int, Place]:
        """Kind and number of a body, after $bdyty."""
        line = lines.take("the kind and number of a body")
        if len(line.words) < 2:
            line.place.fail("the kind and number of a body are expected")
        kind, text = line.words[:2]
        written = whole(text, line.place, "the number of a body")
        if written < 1:
            line.place.fail(f"the number of a body must be at least 1, not {written}")
        return kind, written, line.place

    def part(self, lines: _Lines, name: str, place: Place) -> list[Line]:
        """The lines of a part of a body."""
        head = lines.peek()
        if head is None or keyword(head) != name:
            (place if head is None else head.place).fail(f"${name} is expected here")
        lines.take(name)
        return list(lines.body())

    def closed(self, lines: _Lines, place: Place) -> None:
        """A body ends by $$$$$$. DeckError."""
        line = lines.peek()
        if line is None or not line.text.startswith("$$"):
            (lines.end if line is None else line.place).fail(
                f"$$$$$$ is expected here, the end of the body of line {place.line}"
            )

    def rigid_body(self, lines: _Lines, place: Place) -> RigidBody:
        bulk = self.part(lines, "blmty", place)
        if not bulk or bulk[0].words[0] != "PLAIN":
            (bulk[0].place if bulk else place).fail("a rigid body has the element PLAIN")
        words = bulk[0].words
        if "behav" not in words[:-1]:
            bulk[0].place.fail("has no behav (the line is cut)")
        entries = {key: number(text, line.place, key) for line in bulk for key, text in line.values}
        node = self.part(lines, "nodty", place)
        if not node or not node[0].words[0].startswith("NO6"):
            (node[0].place if node else place).fail("a rigid body has a node NO6xx")
        centre = np.array(node[0].numbers(3, "the place of a body"))
        contactors = []
        rest = self.part(lines, "tacty", place)
        while rest:
            contactor = self.contactor(rest)
            if contactor is not None:
                contactors.append(contactor)
        self.closed(lines, place)
        return RigidBody(
            material=words[words.index("behav") + 1],
            radius=entries.get("avrd", 0.0),
            gyration=entries.get("gyrd", 0.0),
            inertia=(entries.get("I1", 0.0), entries.get("I2", 0.0), entries.get("I3", 0.0)),
            centre=centre,
            contactors=tuple(contactors),
            place=place,
        )

    def contactor(self, rest: list[Line]) -> Contactor | None:
        """Take the lines of the next contactor; None if it is left out."""
        head = rest.pop(0)
        kind = head.words[0]
        if kind not in CONTACTORS[RIGID]:
            if kind not in OTHER_CONTACTORS:
                head.place.fail(f"{kind!r} is no contactor")
            self.skip(head.place, f"contactors {kind} are not known: this one is left out")
            while rest and "color" not in rest[0].words:
                rest.pop(0)
            return None
        colour = self.colour(head)
        if kind == "SPHER":
            radius = number(head.named("byrd"), head.place, "byrd")
            if not radius > 0:
                head.place.fail(f"the radius of a SPHER must be > 0, not {radius:g}")
            return Contactor(kind=kind, colour=colour, size=(radius,), place=head.place)
        if kind == "PLANx":
            half = head.numbers(3, "the half edges of a PLANx")
            if not min(half) > 0:
                head.place.fail(f"the half edges of a PLANx must be > 0, not {half}")
            return Contactor(kind=kind, colour=colour, size=tuple(half), place=head.place)
        counts = [whole(text, head.place, key) for key, text in head.values]
        if len(counts) < 2 or counts[0] < 4 or counts[1] < 4:
            head.place.fail("a POLYR has nb_vertex= and nb_faces=, each at least 4")
        vertices = [
            self.row(rest, head, "a vertex").numbers(3, "a vertex") for _ in range(counts[0])
        ]
        faces = []
        for _ in range(counts[1]):
            line = self.row(rest, head, "a face")
            if len(line.values) < 3:
                line.place.fail("a face: ver1=, ver2= and ver3= are expected here")
            face = [whole(text, line.place, key) for key, text in line.values[:3]]
            if not all(1 <= corner <= counts[0] for corner in face):
                line.place.fail(f"a face has vertices 1 to {counts[0]}, not {face}")
            faces.append(face)
        return Contactor(
            kind=kind,
            colour=colour,
            vertices=np.array(vertices),
            faces=np.array(faces, np.int64) - 1,
            place=head.place,
        )

    def row(self, rest: list[Line], head: Line, what: str) -> Line:
        """The next line of a contactor. DeckError if it has ended."""
        if not rest:
            head.place.fail(f"the contactor ends before all its lines: {what} is missing")
        if rest[0].words[0] in (*CONTACTORS[RIGID], *OTHER_CONTACTORS):
            rest[0].place.fail(f"{what} of the contactor of line {head.place.line} is missing here")
        return rest.pop(0)

    def colour(self, line: Line) -> str:
        """The colour of a contactor."""
        words = line.words
        if "color" not in words[:-1]:
            line.place.fail("a contactor has a color")
        return words[words.index("color") + 1]

    def mesh(self, lines: _Lines, place: Place) -> Mesh | None:
        elements: list[list[int]] = []
        models: list[tuple[str, str]] = []
        known = True
        bulk = self.part(lines, "blmty", place)
        while bulk:
            line = bulk.pop(0)
            words = line.words
            if "model" in words:
                continue
            if words[0] != ELEMENT:
                known = False
                self.skip(line.place, f"elements {words[0]} are not known: the mesh is left out")
                break
            if "nodes" not in words or len(words) < words.index("nodes") + 9:
                line.place.fail(f"an element {ELEMENT} has 8 nodes")
            at = words.index("nodes") + 1
            elements.append([whole(word, line.place, "a node") for word in words[at : at + 8]])
            more = bulk[0].words if bulk else []
            if len(more) < 4 or more[0] != "model" or more[2] != "behav":
                (bulk[0].place if bulk else line.place).fail("model and behav are expected here")
            models.append((more[1], more[3]))
        nodes = []
        for i, line in enumerate(self.part(lines, "nodty", place), 1):
            if line.words[0] != "NO3xx":
                line.place.fail(f"a node NO3xx is expected here, not {line.words[0]!r}")
            written = whole([*line.words, ""][1], line.place, "the number of a node")
            if written != i:
                line.place.fail(f"the number of this node must be {i}, not {written}")
            nodes.append(line.numbers(3, "a node"))
        patches: list[Patch] = []
        for line in self.part(lines, "tacty", place):
            patch = self.patch(line, len(nodes))
            if patch is None:
                continue
            if line.text.startswith("+") and patches and patches[-1].kind == patch.kind:
                before = patches[-1]
                quads = np.concatenate((before.quads, patch.quads))
                patches[-1] = Patch(
                    kind=before.kind, colour=before.colour, quads=quads, place=before.place
                )
            else:
                patches.append(patch)
        self.closed(lines, place)
        if not known:
            return None
        if not elements:
            place.fail("a mesh without elements")
        if len(set(models)) > 1:
            place.fail(f"a mesh of one model and one material is known here, not {set(models)}")
        array = np.array(elements, np.int64)
        if array.min() < 1 or array.max() > len(nodes):
            place.fail(
                f"an element has nodes 1 to {len(nodes)}, not {array.min()} or {array.max()}"
            )
        return Mesh(
            nodes=np.array(nodes),
            elements=array - 1,
            model=models[0][0],
            material=models[0][1],
            patches=tuple(patches),
            place=place,
        )

    def patch(self, line: Line, nodes: int) -> Patch | None:
        kind = line.words[0].lstrip("+")
        if kind not in CONTACTORS[MESH]:
            if kind not in OTHER_CONTACTORS:
                line.place.fail(f"{kind!r} is no contactor")
            self.skip(line.place, f"contactors {kind} are not known: this one is left out")
            return None
        if len(line.values) < 4:
            line.place.fail(f"{kind}: four nodes are expected")
        quad = [whole(text, line.place, key) for key, text in line.values[:4]]
        if not all(1 <= corner <= nodes for corner in quad):
            line.place.fail(f"{kind}: the nodes are 1 to {nodes}, not {quad}")
        return Patch(
            kind=kind, colour=self.colour(line), quads=np.array([quad]) - 1, place=line.place
        )

    # ---- TACT_BEHAV.DAT

    def tact(self) -> tuple[dict[str, Law], list[See]]:
        lines = self.lines("TACT_BEHAV.DAT")
        assert lines is not None
        laws: dict[str, Law] = {}
        sees: list[See] = []
        while lines:
            head = lines.take("a keyword")
            rest = list(lines.body())
            if keyword(head) == "behav":
                if not rest or len(rest[0].words) < 2:
                    (rest[0] if rest else head).place.fail("a law: name and kind are expected")
                name, law = rest[0].words[:2]
                if name in laws:
                    rest[0].place.fail(f"the law {name!r} is there twice")
                laws[name] = self.law(rest[0], law)
            elif keyword(head) == "seety":
                sees.extend(self.see(head, rest))
            else:
                self.skip(head.place, f"the keyword {head.words[0]} is not known")
        return laws, sees

    def law(self, line: Line, name: str) -> Law:
        if name not in LAWS:
            return Law(name=name, mu=None, place=line.place)
        mu = number(line.named("fric"), line.place, "fric")
        if mu < 0:
            line.place.fail(f"the friction must be >= 0, not {mu:g}")
        return Law(name=name, mu=mu, place=line.place)

    def see(self, head: Line, rest: list[Line]) -> Iterator[See]:
        rows = [line for line in rest if line.words[0] != "cdbdy" and line.text[0] != "+"]
        if not rows:
            head.place.fail("a see table without a row")
        for line in rows:
            words = line.words
            if len(words) < 8:
                line.place.fail(
                    "a see table has cdbdy, cdtac, cdcol, behav, anbdy, antac, ancol and alert"
                )
            for body, contactor in (words[0:2], words[4:6]):
                self.check_seen(line.place, body, contactor)
            alert = number(words[7], line.place, "alert")
            if alert < 0:
                line.place.fail(f"the alert distance must be >= 0, not {alert:g}")
            yield See(
                first=(words[1], words[2]),
                second=(words[5], words[6]),
                law=words[3],
                alert=alert,
                place=line.place,
            )

    def check_seen(self, place: Place, body: str, contactor: str) -> None:
        """DeckError if LMGC90 has no such body or contactor."""
        if body not in (*CONTACTORS, *OTHER_BODIES):
            place.fail(f"the see table names bodies {body!r}, and there is no such kind of body")
        mine = [SEEN.get(name, name) for names in CONTACTORS.values() for name in names]
        if contactor not in (*mine, *OTHER_CONTACTORS):
            place.fail(f"the see table names {contactor!r}, and there is no such contactor")

    def known_sees(
        self,
        laws: dict[str, Law],
        sees: list[See],
        rigid: tuple[RigidBody, ...],
        meshes: tuple[Mesh, ...],
    ) -> tuple[See, ...]:
        """The see tables that this deck can use; the others are named."""
        there = {(c.kind, c.colour) for body in rigid for c in body.contactors}
        there |= {(SEEN[p.kind], p.colour) for mesh in meshes for p in mesh.patches}
        kept: list[See] = []
        for see in sees:
            if see.law not in laws:
                see.place.fail(f"the see table names the law {see.law!r}, and there is none such")
            law = laws[see.law]
            missing = [one for one in (see.first, see.second) if one not in there]
            if law.mu is None:
                self.skip(law.place, f"the law {law.name} is not known: {see.place} is left out")
            elif missing:
                names = " ".join(missing[0])
                self.skip(see.place, f"nothing is {names}: this see table has no effect")
            elif any({one.first, one.second} == {see.first, see.second} for one in kept):
                see.place.fail("these contactors see each other in an earlier table already")
            else:
                kept.append(see)
        return tuple(kept)

    # ---- DOF.INI, DRV_DOF.DAT

    def records(self, lines: _Lines) -> Iterator[tuple[str, int, Line]]:
        """Each $nodty of each body: kind and number of the body from 0, and the node's line."""
        kind, index, place = "", -1, None
        while lines:
            head = lines.take("a keyword")
            word = keyword(head)
            if word == "bdyty":
                kind, written, place = self.head(lines)
                if kind not in CONTACTORS:
                    if kind not in OTHER_BODIES:
                        place.fail(f"{kind!r} is no kind of body")
                    self.skip(place, f"bodies {kind} are not known: this one is left out")
                index = written - 1
                if kind == MESH:
                    if index >= len(self.mesh_number):
                        place.fail(f"there is no body {kind} {written}")
                    index = self.mesh_number[index]
            elif word == "nodty":
                if place is None:
                    head.place.fail("$nodty is expected after $bdyty")
                node = lines.take("a node")
                if kind in CONTACTORS and index >= 0:
                    yield kind, index, node
                else:
                    while lines and keyword(lines.lines[lines.next]) in ("", "dofty"):
                        lines.take("")
            elif word in ("steps", "model", "dofty") or head.text.startswith("$$"):
                # rows of several nodes follow
                if word == "dofty":
                    head.place.fail("$dofty is expected after $nodty")
                list(lines.body())
            else:
                self.skip(head.place, f"the keyword {head.words[0]} is not known")
                list(lines.body())

    def body_at(self, place: Place, kind: str, index: int, node: int) -> None:
        """DeckError if there is no such node of such a body."""
        if index >= len(self.nodes[kind]):
            place.fail(f"there is no body {kind} {index + 1}, only {len(self.nodes[kind])}")
        if not 0 <= node < self.nodes[kind][index]:
            place.fail(f"body {kind} {index + 1} has no node {node + 1}")

    def starts(self) -> dict[tuple[str, int, int], Start]:
        lines = self.lines(START)
        found: dict[tuple[str, int, int], Start] = {}
        if lines is None:
            return found
        for kind, index, first in self.records(lines):
            line = first
            while True:
                node = whole([*line.words, ""][1], line.place, "the number of a node") - 1
                self.body_at(line.place, kind, index, node)
                key = (kind, index, node)
                if key in found:
                    line.place.fail(f"{kind} {index + 1}, node {node + 1} is there twice")
                found[key] = self.start(lines, line, kind)
                following = lines.peek()
                if following is None or following.text.startswith("$"):
                    break
                line = lines.take("a node")
        return found

    def start(self, lines: _Lines, line: Line, kind: str) -> Start:
        values: dict[str, float] = {}
        wanted = [f"{letter}({i})" for letter in "XV" for i in range(1, 7 if kind == RIGID else 4)]
        if kind == RIGID:
            wanted += [f"{letter}({i})" for letter in "abc" for i in range(1, 4)]
        here: Line = line
        while True:
            for name, text in here.values:
                values[name] = number(text, here.place, name)
            if all(name in values for name in wanted):
                break
            following = lines.peek()
            if (
                following is None
                or following.text.startswith("$")
                or following.words[0][:2] == "NO"
            ):
                missing = next(name for name in wanted if name not in values)
                here.place.fail(f"the start of a body: {missing}= is missing")
            here = lines.take("the start of a body")
        half = len(wanted[: 12 if kind == RIGID else 6]) // 2
        numbers = np.array([values[name] for name in wanted])
        frame = None
        if kind == RIGID:
            frame = numbers[12:].reshape(3, 3).T
            if not np.abs(frame.T @ frame - np.eye(3)).max() < FRAME or np.linalg.det(frame) < 0:
                line.place.fail("the axes a, b, c are not at right angles and of length 1")
            if np.abs(numbers[3:6]).max():
                self.skip(line.place, "X(4), X(5), X(6): the axes a, b, c tell the rotation")
        return Start(
            displacement=numbers[:half],
            velocity=numbers[half : 2 * half],
            frame=frame,
            place=line.place,
        )

    def driven(self) -> tuple[Driven, ...]:
        lines = self.lines(DRIVEN)
        found: dict[tuple[str, int, int, int, bool], Driven] = {}
        if lines is None:
            return ()
        for kind, index, line in self.records(lines):
            node = whole([*line.words, ""][1], line.place, "the number of a node") - 1
            self.body_at(line.place, kind, index, node)
            head = lines.peek()
            if head is None or keyword(head) != "dofty":
                (lines.end if head is None else head.place).fail("$dofty is expected here")
            lines.take("$dofty")
            for row in lines.body():
                words = row.words
                if words[0] not in ("vlocy", "force"):
                    self.skip(row.place, f"{words[0]!r} is not known: neither vlocy nor force")
                    continue
                axis = whole([*words, ""][1], row.place, "the number of a degree of freedom") - 1
                if not 0 <= axis < (6 if kind == RIGID else 3):
                    row.place.fail(f"{kind} has no degree of freedom {axis + 1}")
                key = (kind, index, node, axis, words[0] == "vlocy")
                if key in found:
                    row.place.fail(f"this {words[0]} is given twice, also in {found[key].place}")
                found[key] = Driven(
                    body=(kind, index),
                    node=node,
                    axis=axis,
                    velocity=key[4],
                    course=self.course(row),
                    place=row.place,
                )
        return tuple(found.values())

    def course(self, row: Line) -> Course:
        """How a driven value changes with time."""
        words = row.words[2:]
        if words and words[0] == "evolution":
            if len(words) < 2:
                row.place.fail("evolution: the name of a file is expected")
            return self.evolution(row, words[1])
        if len(words) < 6:
            row.place.fail(
                "a driven value has six numbers, CT, AMP, OMEGA, PHI, RAMPI and RAMP, and there"
                f" are {len(words)}"
            )
        names = ("CT", "AMP", "OMEGA", "PHI", "RAMPI", "RAMP")
        values = [number(w, row.place, n) for w, n in zip(words, names, strict=False)]
        return Course(
            constant=values[0],
            amplitude=values[1],
            omega=values[2],
            phase=values[3],
            ramp=values[4],
            ramp_rate=values[5],
        )

    def evolution(self, row: Line, name: str) -> Course:
        """The table of times and values of a file."""
        path = self.folder / name
        if not path.is_file():
            row.place.fail(f"the file {name} is missing")
        content = path.read_bytes()
        self.sha256[name] = hashlib.sha256(content).hexdigest()
        points: list[tuple[float, float]] = []
        for i, text in enumerate(content.decode("latin-1").splitlines(), 1):
            words, place = text.split(), Place(path, i)
            if not words or words[0][0] in "!#":
                continue
            if len(words) < 2:
                place.fail("a time and a value are expected")
            time, value = (
                number(w, place, n) for w, n in zip(words, ("time", "value"), strict=False)
            )
            if points and not time > points[-1][0]:
                place.fail(f"the times must increase, and {time:g} follows {points[-1][0]:g}")
            points.append((time, value))
        if not points:
            raise DeckError(f"{path}:1: has no times and values")
        return Course(points=tuple(points))

    def check_unread(self) -> None:
        """Name the files of a start that are not used, if they hold something."""
        for name, what in (("Vloc_Rloc.INI", "reactions"), ("GPV.INI", "stresses")):
            lines = self.lines(name)
            while lines:
                line = lines.take("")
                if keyword(line) not in ("steps", ""):
                    self.skip(line.place, f"{what} at the start are not used")
                    break


FRAME: Final = 1e-5  # axes of a body are written with seven digits
