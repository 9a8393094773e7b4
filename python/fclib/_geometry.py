"""The places of contacts and the bodies that touch: the groups /contacts and /bodies.

    problem.contacts, problem.bodies        None if a file has none
    problem.replace(contacts=..., bodies=...)

Each column is a dataset of the group, row after row; `docs/format.md` lists them. Lengths are in
the unit that the bodies name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from fclib._words import counted

Integers = npt.NDArray[np.int32]
Numbers = npt.NDArray[np.float64]

# kinds of shapes, by their numbers in a file
KINDS: Final = ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")


def column(count: str, width: int, kind: Any, doc: str) -> dict[str, Any]:
    """The description of a field: `count` rows of `width` numbers each; kind: int, float or str."""
    return {"count": count, "width": width, "kind": kind, "doc": doc, "optional": False}


def optional(count: str, width: int, kind: Any, doc: str) -> Any:
    """A field that is empty where its column is absent."""
    metadata = column(count, width, kind, doc) | {"optional": True}
    if kind is str:
        return field(default="", metadata=metadata)
    shape = (0, width) if width > 1 else 0
    return field(default_factory=lambda: np.zeros(shape, _type(kind)), metadata=metadata)


def _type(kind: Any) -> Any:
    return np.int32 if kind is int else np.float64


class _Table:
    """The common part of both tables: columns of a file, checked when they are made."""

    @classmethod
    def _made(cls, columns: Mapping[str, Any], group: str) -> Any:
        """Make it from the columns of a file. ValueError names a wrong one; others are ignored."""
        values = {}
        for own in fields(cls):  # type: ignore[arg-type]
            known = own.metadata
            if own.name not in columns:
                if known["optional"]:
                    continue
                raise ValueError(f"/{group}/{own.name}: the dataset is missing")
            value = columns[own.name]
            if known["kind"] is str:
                if not isinstance(value, str):
                    raise ValueError(f"/{group}/{own.name}: does not hold text")
            elif isinstance(value, str) or (known["kind"] is int and value.dtype != np.int32):
                raise ValueError(f"/{group}/{own.name}: does not hold numbers of type int")
            elif value.size % known["width"]:
                raise ValueError(
                    f"/{group}/{own.name}: has {value.size} entries, no multiple of"
                    f" {known['width']}"
                )
            elif known["width"] > 1:
                value = value.reshape(-1, known["width"])
            values[own.name] = value
        return cls(**values)

    def columns(self) -> dict[str, Any]:
        """The columns in a file's form: one dimension, without empty ones."""
        found = {}
        for own in fields(self):  # type: ignore[arg-type]
            value = getattr(self, own.name)
            if own.metadata["kind"] is not str:
                value = np.ascontiguousarray(value, dtype=_type(own.metadata["kind"])).ravel()
                # without contacts /contacts/gap is still written, but optional columns are not
                if own.metadata["optional"] and not value.size:
                    continue
            elif own.metadata["optional"] and not value:
                continue
            found[own.name] = value
        return found

    def _check(self, group: str, counts: Mapping[str, int]) -> None:
        for own in fields(self):  # type: ignore[arg-type]
            known = own.metadata
            value = getattr(self, own.name)
            if known["kind"] is str or (known["optional"] and not len(value)):
                continue
            if known["count"] in counts and len(value) != counts[known["count"]]:
                raise ValueError(
                    f"/{group}/{own.name}: has {counted(len(value), 'row')}, expected"
                    f" {known['count']} = {counts[known['count']]}"
                )
            if value.dtype.kind == "f" and not np.isfinite(value).all():
                raise ValueError(f"/{group}/{own.name}: has a value that is not finite")


@dataclass(frozen=True, eq=False, kw_only=True)
class Contacts(_Table):
    """The places of nc contacts, in the order of the problem.

    Bodies, shapes and feature of a contact are its identity: the same in the next step.
    """

    body: Integers = field(
        metadata=column("nc", 2, int, "the two; the normal points to the second")
    )
    shape: Integers = field(
        metadata=column("nc", 2, int, "their shapes; -1 for the limit of a joint")
    )
    feature: Integers = field(metadata=column("nc", 1, int, "which contact of these two it is"))
    point: Numbers = field(metadata=column("nc", 3, float, "midway between the two, in the world"))
    normal: Numbers = field(metadata=column("nc", 3, float, "N, in the world; 0 for a limit"))
    tangent: Numbers = field(
        metadata=column("nc", 3, float, "T1; T2 = N x T1, in the plane T1 is T")
    )
    gap: Numbers = field(metadata=column("nc", 1, float, "signed distance, < 0 if they overlap"))

    def __post_init__(self) -> None:
        """Raises ValueError if the columns contradict each other."""
        self._check("contacts", {"nc": len(self.gap)})

    @classmethod
    def of(cls, columns: Mapping[str, Any], count: int | None = None) -> Contacts:
        """Make it from the columns of a file, for so many contacts. Raises ValueError."""
        made: Contacts = cls._made(columns, "contacts")
        if count is not None and len(made) != count:
            raise ValueError(
                f"/contacts: has {counted(len(made), 'row')}, and the problem"
                f" {counted(count, 'contact')}"
            )
        return made

    def __len__(self) -> int:
        return len(self.gap)

    @property
    def frame(self) -> Numbers:
        """(nc x 3 x 3) rows N, T1, T2 in the world; 0 for a limit."""
        return np.stack((self.normal, self.tangent, np.cross(self.normal, self.tangent)), axis=1)

    @property
    def identity(self) -> list[tuple[int, ...]]:
        """(nc) the name of each contact in all steps: bodies, shapes, feature."""
        rows = np.column_stack((self.body, self.shape, self.feature))
        return [tuple(row) for row in rows.tolist()]


@dataclass(frozen=True, eq=False, kw_only=True)
class Bodies(_Table):
    """Bodies, their shapes, and their places.

    A shape lies at `shape_place`, turned by `shape_turn`, in its body, which lies at `place`,
    turned by `turn`, in the world. Turns are quaternions w, x, y, z.
    """

    name: str = field(metadata=column("nb", 1, str, "the names of the bodies, a line for each"))
    moves: Integers = field(metadata=column("nb", 1, int, "1 if something moves it, 0: fixed"))
    place: Numbers = field(metadata=column("nb", 3, float, "of the body's frame, in the world"))
    turn: Numbers = field(metadata=column("nb", 4, float, "of the body's frame"))
    shape_body: Integers = field(metadata=column("ns", 1, int, "the body of each shape"))
    shape_kind: Integers = field(
        metadata=column("ns", 1, int, f"{', '.join(f'{i} {k}' for i, k in enumerate(KINDS))}")
    )
    shape_size: Numbers = field(
        metadata=column("ns", 3, float, "half edges, radii, ...; docs/format.md")
    )
    shape_place: Numbers = field(metadata=column("ns", 3, float, "in the body"))
    shape_turn: Numbers = field(metadata=column("ns", 4, float, "in the body"))
    shape_mesh: Integers = field(metadata=column("ns", 1, int, "its mesh, -1 for another kind"))
    mesh_first: Integers = optional(
        "nm + 1", 2, int, "the first vertex and the first face of each mesh, and their numbers"
    )
    vertex: Numbers = optional("", 3, float, "of all meshes, in the shape")
    displacement: Numbers = optional(
        "", 3, float, "of an elastic body's vertices since it was without stress"
    )
    face: Integers = optional(
        "", 4, int, "vertices of a face of its mesh about the outward normal; -1: three only"
    )
    period: Numbers = optional(
        "2", 1, float, "edges of a cell about the origin that repeats along x and y"
    )
    planar: Integers = optional("1", 1, int, "1 if all moves in the plane x, z; else absent")
    mass: Numbers = optional("nb", 1, float, "of each rigid body; 0 of a fixed one")
    inertia: Numbers = optional(
        "nb", 3, float, "principal moments of each rigid body, about its centre"
    )
    center: Numbers = optional("nb", 3, float, "centre of mass, in the body")
    axes: Numbers = optional("nb", 4, float, "of the principal axes, in the body")
    velocity: Numbers = optional("n", 1, float, "v0, generalised, at the start of the step")
    impulse: Numbers = optional(
        "n", 1, float, "of all known forces during the step: f = M v0 + impulse"
    )
    unit: str = optional("1", 1, str, "of lengths; absent if it is m")
    mass_unit: str = optional("1", 1, str, "of masses; absent if it is kg")

    def __post_init__(self) -> None:
        """Raises ValueError if the columns contradict each other."""
        counts = {"nb": len(self.moves), "ns": len(self.shape_kind), "1": 1, "2": 2}
        self._check("bodies", counts)
        if len(self.names) != counts["nb"]:
            raise ValueError(
                f"/bodies/name: has {counted(len(self.names), 'line')}, expected {counts['nb']}"
            )
        for name, values, bound in (
            ("shape_body", self.shape_body, counts["nb"]),
            ("shape_kind", self.shape_kind, len(KINDS)),
            ("shape_mesh", self.shape_mesh, max(len(self.mesh_first) - 1, 0)),
        ):
            if len(values) and not (values.min() >= -1 and values.max() < bound):
                raise ValueError(f"/bodies/{name}: has a number that is out of range")

    @classmethod
    def of(cls, columns: Mapping[str, Any]) -> Bodies:
        """Make it from the columns of a file. Raises ValueError."""
        made: Bodies = cls._made(columns, "bodies")
        return made

    def __len__(self) -> int:
        return len(self.moves)

    @property
    def names(self) -> list[str]:
        """(nb) the names of the bodies."""
        return self.name.split("\n")

    @property
    def is_planar(self) -> bool:
        """Whether all moves in the plane x, z."""
        return bool(len(self.planar) and self.planar[0])

    def started(self, velocity: Numbers, problem: Any) -> Bodies:
        """The table with v0 (n), and with the impulse of all forces that gives f of a problem."""
        impulse = np.asarray(problem.f) - problem.M @ velocity
        return replace(self, velocity=velocity, impulse=impulse)

    def mesh(self, shape: int) -> tuple[Numbers, Integers] | None:
        """Vertices (k x 3) in the shape and faces (f x 4) of a shape; None if it has no mesh."""
        which = self.shape_mesh[shape]
        if which < 0:
            return None
        (vertex, face), (end, last) = self.mesh_first[which], self.mesh_first[which + 1]
        return self.vertex[vertex:end], self.face[face:last]

    def poses(self) -> tuple[Numbers, Numbers]:
        """The poses of the shapes in the world: places (ns x 3) and rotations (ns x 3 x 3)."""
        body = rotations(self.turn)[self.shape_body]
        place = self.place[self.shape_body] + np.einsum("sij,sj->si", body, self.shape_place)
        return place, body @ rotations(self.shape_turn)


def rotations(turn: Numbers) -> Numbers:
    """The rotations (k x 3 x 3) of unit quaternions w, x, y, z (k x 4)."""
    w, x, y, z = turn.T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def carried(
    before: Contacts, now: Contacts, r: npt.ArrayLike, d: int, *, planar: bool = False
) -> Numbers:
    """A guess of reactions (d nc): those that the same contacts had in another step.

    They are rotated through the world into the new frames, forces and moments alike. A contact
    whose feature is new takes the nearest remaining one of its two shapes. If its two shapes did
    not touch before, it gets none.

    Args:
        before: the contacts of the other step.
        now: those of this one.
        r: the reactions of the other step (d nc).
        d: number of components of a contact.
        planar: whether all moves in the plane x, z.

    Raises:
        ValueError: the reactions are not of the other step's size.
    """
    local = np.asarray(r, dtype=float)
    if local.size != d * len(before):
        raise ValueError(
            f"{counted(local.size, 'reaction')} for {counted(len(before), 'contact')} of {d}"
            " components"
        )
    local = local.reshape(-1, d)

    source = np.full(len(now), -1)
    known = {name: i for i, name in enumerate(before.identity)}
    names = now.identity
    for i, name in enumerate(names):
        source[i] = known.pop(name, -1)
    # the remaining contacts of each pair
    left: dict[tuple[int, ...], list[int]] = {}
    for name, i in known.items():
        left.setdefault(name[:-1], []).append(i)
    for i in np.flatnonzero(source < 0).tolist():
        rest = left.get(names[i][:-1])
        if rest:
            away = np.linalg.norm(before.point[rest] - now.point[i], axis=1)
            source[i] = rest.pop(int(away.argmin()))

    force, axis = 2 if planar else 3, first_axis(planar, d)
    parts = (slice(0, force), slice(0, force)), (slice(force, d), slice(axis, axis + d - force))
    limits = np.any(now.shape < 0, axis=1)
    return turned(local, source, before.frame, now.frame, parts, limits)


def first_axis(planar: bool, d: int) -> int:
    """The row of a contact's frame for its first moment: y in the plane, T1, or N with spin."""
    return 2 if planar else 0 if d % 2 == 0 else 1


def turned(
    r: Numbers,
    source: npt.NDArray[Any],
    before: Numbers,
    now: Numbers,
    parts: Sequence[tuple[slice, slice]],
    limits: npt.NDArray[np.bool_],
) -> Numbers:
    """Reactions of contacts in their new frames (d nc), by way of the world.

    Args:
        r: those of the other step, a row for each contact of it.
        source: (nc) which of these each contact was, -1 for none: then it gets no reaction.
        before: (... x 3 x 3) frames of the other step, N, T1, T2 in rows.
        now: (nc x 3 x 3) those of this one.
        parts: components of a vector, and their axes in the frame.
        limits: (nc) contacts without a frame, whose components are not rotated.
    """
    found = (source >= 0).nonzero()[0]
    source = source.take(found)
    result = np.zeros((len(now), r.shape[1]))
    result[found] = rotated(
        r.take(source, axis=0),
        before.take(source, axis=0),
        now.take(found, axis=0),
        parts,
        limits.take(found),
    )
    return result.ravel()


def rotated(
    r: Numbers,
    before: Numbers,
    now: Numbers,
    parts: Sequence[tuple[slice, slice]],
    limits: npt.NDArray[np.bool_],
) -> Numbers:
    """The same row by row (k x d), if each contact existed before."""
    carried = np.zeros_like(r)
    for part, axes in parts:
        if part.start >= r.shape[1]:  # no rolling
            continue
        world = np.einsum("cij,ci->cj", before[:, axes], r[:, part])
        carried[:, part] = np.einsum("cij,cj->ci", now[:, axes], world)
    return np.where(limits[:, None], r, carried)
