"""BODIES.DAT of a deck of LMGC90: rigid bodies and meshes, with their contactors."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fclib.scenes.shared.deck_data import (
    CONTACTORS,
    ELEMENT,
    FRAME,
    MESH,
    OTHER_BODIES,
    OTHER_CONTACTORS,
    RIGID,
    Contactor,
    Mesh,
    Patch,
    RigidBody,
    Vector,
)
from fclib.scenes.shared.deck_lines import Line, Lines, Place, keyword, number, whole


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


class BodiesReader:
    """What reads the bodies of a folder, and notes what it does not know."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.unknown: list[str] = []
        self.sha256: dict[str, str] = {}
        # (k) of each mesh of the file its number among those that are taken; -1: left out
        self.mesh_number: list[int] = []

    def lines(self, name: str) -> Lines | None:
        """The lines of a file; None if there is no such file."""
        path = self.folder / name
        if not path.is_file():
            return None
        found = Lines(path)
        self.sha256[name] = found.sha256
        return found

    def skip(self, place: Place, words: str) -> None:
        """Say that something is left out."""
        self.unknown.append(f"{place}: {words}")

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

    def head(self, lines: Lines) -> tuple[str, int, Place]:
        """Kind and number of a body, after $bdyty."""
        line = lines.take("the kind and number of a body")
        if len(line.words) < 2:
            line.place.fail("the kind and number of a body are expected")
        kind, text = line.words[:2]
        written = whole(text, line.place, "the number of a body")
        if written < 1:
            line.place.fail(f"the number of a body must be at least 1, not {written}")
        return kind, written, line.place

    def part(self, lines: Lines, name: str, place: Place) -> list[Line]:
        """The lines of a part of a body."""
        head = lines.peek()
        if head is None or keyword(head) != name:
            (place if head is None else head.place).fail(f"${name} is expected here")
        lines.take(name)
        return list(lines.body())

    def closed(self, lines: Lines, place: Place) -> None:
        """A body ends by $$$$$$. DeckError."""
        line = lines.peek()
        if line is None or not line.text.startswith("$$"):
            (lines.end if line is None else line.place).fail(
                f"$$$$$$ is expected here, the end of the body of line {place.line}"
            )

    def rigid_body(self, lines: Lines, place: Place) -> RigidBody:
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
            turn, shift = self.local_frame(rest, head)
            return Contactor(
                kind=kind, colour=colour, size=tuple(half), turn=turn, shift=shift, place=head.place
            )
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

    def local_frame(self, rest: list[Line], head: Line) -> tuple[Vector, Vector]:
        """The axes (3 x 3, columns) and place (3) of a PLANx in its body, if they follow it."""
        if not rest or rest[0].words[0] != "localframe":
            return np.eye(3), np.zeros(3)
        place = rest.pop(0).place
        what = "the frame of a PLANx"
        axes = [self.row(rest, head, what).numbers(3, what) for _ in range(3)]
        turn = np.array(axes).T
        if not np.abs(turn.T @ turn - np.eye(3)).max() < FRAME or np.linalg.det(turn) < 0:
            place.fail("the axes of the PLANx are not at right angles and of length 1")
        return turn, np.array(self.row(rest, head, what).numbers(3, what))

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

    def mesh(self, lines: Lines, place: Place) -> Mesh | None:
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
