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
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from fclib.scenes.shared.deck_bodies import BodiesReader
from fclib.scenes.shared.deck_data import (
    CONTACTORS,
    ELEMENT,
    FRAME,
    MESH,
    OTHER_BODIES,
    OTHER_CONTACTORS,
    RIGID,
    SEEN,
    Deck,
    Driven,
    Law,
    Material,
    Mesh,
    RigidBody,
    See,
    Start,
    Vector,
)
from fclib.scenes.shared.deck_lines import DeckError, Line, Lines, Place, keyword, number, whole
from fclib.scenes.shared.interaction import LAWS, Course

__all__ = ["DeckError", "folder_of", "read"]

FOLDER: Final = "DATBOX"
NEEDED: Final = ("BODIES.DAT", "BULK_BEHAV.DAT", "TACT_BEHAV.DAT")
MODELS, START, DRIVEN = "MODELS.DAT", "DOF.INI", "DRV_DOF.DAT"


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


class _Reader(BodiesReader):
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

    def records(self, lines: Lines) -> Iterator[tuple[str, int, Line]]:
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

    def start(self, lines: Lines, line: Line, kind: str) -> Start:
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
        if any(values[:2]) and (values[4] < -1 or values[5] < 0):
            self.skip(
                row.place,
                f"below -1 the ramp {values[4]:g} + {values[5]:g} t goes on, as in LMGC90's engine;"
                " its manual says that it stays at -1",
            )
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
        if len(points) < 2:
            raise DeckError(f"{path}:1: an evolution has two times and values at least")
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
