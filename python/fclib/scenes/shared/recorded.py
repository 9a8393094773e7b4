"""Steps of other engines as arrays in a file; their problems are made without the engine.

The file is an .npz. `about` is JSON: engine, law, notes, of each field whether it is the engine's
or follows from a formula, and the problems' digests. The bodies are boxes, of which `half` has the
half edges, or polyhedra, with `vertices`, `faces` and their ends for each body. Of any other array
the steps come one after another, and `NAME_ends` has the end of each.

A step has M and H, or what they follow from: `mass`, of the file, and for H the places of contacts
and the middles and axes of bodies in the step. The sums of H are taken in one order, so that it is
the same everywhere, to the last bit.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar, Final, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib import _core
from fclib._geometry import KINDS, Bodies, Contacts

Vector: TypeAlias = npt.NDArray[np.float64]

FOLDER: Final = Path(__file__).resolve().parents[1] / "recorded"
UPRIGHT: Final = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """A step of free bodies: what the engine made its equations of, and its own answer.

    M v = H r + f, u = H^T v + w; v has the velocity and the spin of each box in turn.
    """

    time: Vector  # (1) at its start [s]
    step: Vector  # (1) h [s]
    M: Any = None  # (n x n); None: it follows from the masses of the file
    H: Any = None  # (n x 3 nc); None: it follows from centre and axes
    f: Vector  # (n)
    w: Vector  # (3 nc)
    mu: Vector  # (nc)
    reaction: Vector  # (3 nc) the engine's own [N s]
    velocity: Vector  # (n) the engine's own, after the step
    # places of contacts and boxes, if the engine gives them
    body: Any = None  # (nc x 2) N points to the second; 0 is the ground
    point: Any = None  # (nc x 3) [m]
    normal: Any = None  # (nc x 3)
    tangent: Any = None  # (nc x 3) T1
    gap: Any = None  # (nc) [m]
    place: Any = None  # (nb x 3) of the boxes at the start of the step [m]
    turn: Any = None  # (nb x 4) quaternions w, x, y, z
    # of polyhedra, those that do not move too: in the middle of the step
    centre: Any = None  # (nb x 3) [m]
    axes: Any = None  # (nb x 3 x 3) columns


@dataclass(frozen=True, eq=False)
class Polyhedra:
    """Bodies that are polyhedra: all of them, those that do not move too."""

    moves: npt.NDArray[np.int64]  # (nb) 1 or 0
    mass: Vector  # (n) of each degree of freedom of those that move
    vertices: tuple[Vector, ...]  # of each body (k x 3), in its own frame [m]
    faces: tuple[npt.NDArray[np.int64], ...]  # of each body (f x 3) triangles


@dataclass(frozen=True, eq=False)
class File:
    """The content of a file."""

    about: dict[str, Any]
    half: Vector  # (nb x 3) of boxes [m]
    steps: tuple[Step, ...]
    digests: tuple[str, ...] = ()  # of the problems, as they were when the file was made
    polyhedra: Polyhedra | None = None  # the bodies, if they are no boxes


def write(path: Path, file: File) -> None:
    """Store steps."""
    about = json.dumps({**file.about, "digests": file.digests})
    arrays: dict[str, Any] = {"about": np.array(about), "half": file.half}
    if file.polyhedra is not None:
        own = file.polyhedra
        arrays |= {"solid_moves": own.moves, "solid_mass": own.mass}
        tables: dict[str, tuple[Any, ...]] = {"vertices": own.vertices, "faces": own.faces}
        for name, rows in tables.items():
            arrays[f"solid_{name}"] = np.concatenate(rows)
            arrays[f"solid_{name}_of"] = np.cumsum([len(row) for row in rows])
    parts: dict[str, list[Any]] = {}
    for step in file.steps:
        for field in fields(Step):
            value = getattr(step, field.name)
            if sp.issparse(value):
                columns = sp.csc_array(value)
                columns.sort_indices()
                for part in ("data", "indices", "indptr"):
                    parts.setdefault(f"{field.name}_{part}", []).append(getattr(columns, part))
            elif value is not None:
                parts.setdefault(field.name, []).append(np.asarray(value))
    for name, values in parts.items():
        joined = np.concatenate(values)
        arrays[name] = joined.astype(np.int32) if joined.dtype.kind == "i" else joined
        arrays[f"{name}_ends"] = np.cumsum([len(value) for value in values])
    np.savez_compressed(path, **arrays)


@functools.cache
def read(path: Path) -> File:
    """The content of a file that `write` stored."""
    with np.load(path) as stored:
        arrays = {name: stored[name] for name in stored.files}
    about = json.loads(str(arrays.pop("about")))
    half = arrays.pop("half")
    own = {name: arrays.pop(name) for name in list(arrays) if name.startswith("solid_")}
    polyhedra = None
    if own:
        vertices, faces = (
            tuple(np.split(own[f"solid_{name}"], own[f"solid_{name}_of"][:-1]))
            for name in ("vertices", "faces")
        )
        polyhedra = Polyhedra(own["solid_moves"], own["solid_mass"], vertices, faces)
    parts = {
        name: np.split(values, arrays[f"{name}_ends"][:-1])
        for name, values in arrays.items()
        if not name.endswith("_ends")
    }
    steps = []
    for k in range(len(parts["time"])):
        mine = {name: values[k] for name, values in parts.items()}
        n = len(mine["f"])
        for name, columns in (("M", n), ("H", len(mine["w"]))):
            if f"{name}_data" in mine:
                three = tuple(mine.pop(f"{name}_{part}") for part in ("data", "indices", "indptr"))
                mine[name] = sp.csc_array(three, shape=(n, columns))
        steps.append(Step(**mine))
    digests = tuple(about.pop("digests"))
    return File(about, half, tuple(steps), digests, polyhedra)


def problem_of(file: File, number: int) -> Any:
    """The problem of a step, with its contacts and bodies; its description is JSON."""
    step = file.steps[number]
    time, h = float(step.time[0]), float(step.step[0])
    M, H = step.M, step.H
    placed = step.place is not None or file.polyhedra is not None
    if file.polyhedra is not None:
        M = sp.csc_array(sp.diags_array(file.polyhedra.mass))
        H = sp.csc_array(_jacobian(step)[np.repeat(file.polyhedra.moves, 6) > 0])
    return _core.GlobalProblem(
        spacedim=3,
        M=M,
        H=H,
        f=step.f,
        w=step.w,
        mu=step.mu,
        contacts=_contacts(step) if placed else None,
        bodies=_bodies(step, file) if placed else None,
        info=_core.ProblemInfo(
            title=f"t = {time:g} s",
            description=json.dumps({**file.about, "time": time, "time_step": h}),
            math_info=(
                f"one step, h = {h:g} s; M v = H r + f, u = H^T v + w; v in m/s and rad/s,"
                " r in N s, components N, T1, T2"
            ),
        ),
    )


def _contacts(step: Step) -> Contacts:
    """Shapes are numbered as bodies are; features count the contacts of a pair."""
    seen: dict[tuple[int, ...], int] = {}
    feature = []
    for pair in map(tuple, step.body.tolist()):
        feature.append(seen.get(pair, 0))
        seen[pair] = feature[-1] + 1
    return Contacts(
        body=step.body,
        shape=step.body,
        feature=np.array(feature, np.int32),
        point=step.point,
        normal=step.normal,
        tangent=step.tangent,
        gap=step.gap,
    )


def _jacobian(step: Step) -> Vector:
    """H (6 nb x 3 nc) of all bodies: the second's velocity less the first's."""
    second = np.cross(step.normal, step.tangent)
    frame = np.stack((step.normal, step.tangent, second), axis=1)
    signs = (-1.0, 1.0)
    sides = [(step.body[:, side], sign) for side, sign in enumerate(signs)]
    return jacobian(sides, step.point, frame, step.centre, step.axes)


def jacobian(
    sides: Sequence[tuple[npt.NDArray[np.int64], float]],
    point: Vector,
    frame: Vector,
    centre: Vector,
    axes: Vector,
) -> Vector:
    """H (6 nb x 3 nc) of rigid bodies: velocities of their points, in the frames of contacts.

    A body has the velocity of its centre and its spin about its own axes.

    Args:
        sides: of each side of the contacts the bodies (nc), and the sign of their velocity.
        point: (nc x 3).
        frame: (nc x 3 x 3) rows N, T1, T2.
        centre: (nb x 3).
        axes: (nb x 3 x 3) columns.
    """
    nc = len(point)
    H = np.zeros((len(centre), 6, nc, 3))
    each = np.arange(nc)
    for body, sign in sides:
        arm = point - centre[body]
        moment = np.cross(arm[:, None], frame)  # nc, row, in the world
        own = axes[body]
        # in one order everywhere, which a matrix product would not have
        spin = (
            moment[:, :, 0, None] * own[:, None, 0]
            + moment[:, :, 1, None] * own[:, None, 1]
            + moment[:, :, 2, None] * own[:, None, 2]
        )
        H[body, :3, each] += sign * frame.transpose(0, 2, 1)
        H[body, 3:, each] += sign * spin.transpose(0, 2, 1)
    return H.reshape(6 * len(centre), 3 * nc)


def _bodies(step: Step, file: File) -> Bodies:
    """The ground, then the boxes; or the polyhedra; one shape each."""
    if file.polyhedra is not None:
        return _polyhedra(step, file.polyhedra)
    half = file.half
    count = len(half)
    kinds = [KINDS.index("plane"), *[KINDS.index("box")] * count]
    return Bodies(
        name="\n".join(["ground", *(f"box {i}" for i in range(count))]),
        moves=np.array([0] + [1] * count, np.int32),
        place=np.vstack((np.zeros(3), step.place)),
        turn=np.vstack((UPRIGHT, step.turn)),
        shape_body=np.arange(1 + count, dtype=np.int32),
        shape_kind=np.array(kinds, np.int32),
        shape_size=np.vstack((np.zeros(3), half)),
        shape_place=np.zeros((1 + count, 3)),
        shape_turn=np.tile(UPRIGHT, (1 + count, 1)),
        shape_mesh=np.full(1 + count, -1, np.int32),
    )


def _polyhedra(step: Step, own: Polyhedra) -> Bodies:
    """Bodies in the middle of the step, where the engine finds contacts."""
    count = len(own.moves)
    ends = [
        np.cumsum([0, *(len(value) for value in values)]) for values in (own.vertices, own.faces)
    ]
    faces = np.concatenate(own.faces)
    return Bodies(
        name="\n".join(f"body {i + 1}" for i in range(count)),
        moves=own.moves.astype(np.int32),
        place=step.centre,
        turn=step.turn,
        shape_body=np.arange(count, dtype=np.int32),
        shape_kind=np.full(count, KINDS.index("mesh"), np.int32),
        shape_size=np.zeros((count, 3)),
        shape_place=np.zeros((count, 3)),
        shape_turn=np.tile(UPRIGHT, (count, 1)),
        shape_mesh=np.arange(count, dtype=np.int32),
        mesh_first=np.column_stack(ends).astype(np.int32),
        vertex=np.concatenate(own.vertices),
        face=np.column_stack((faces, np.full(len(faces), -1))).astype(np.int32),
    )


class Recorded:
    """A family whose problems are the steps of a file of its name in `recorded/`."""

    collection: ClassVar[str] = "simulators"
    problems: ClassVar[int] = 16
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    application: ClassVar[str] = "simulation of rigid bodies"

    def problem(self, number: int, seed: int = 0) -> Any:
        """The problem of a step; there is nothing that the seed could draw."""
        return problem_of(self.file(), number)

    def reaction(self, number: int) -> _core.Solution:
        """The engine's own, which its law makes, with the velocity that it went on with."""
        step = self.file().steps[number]
        return _core.Solution(r=step.reaction, v=step.velocity)

    @classmethod
    def digests(cls) -> tuple[str, ...]:
        """The digests of the problems as they were stored."""
        return cls.file().digests

    @classmethod
    def file(cls) -> File:
        """The stored steps."""
        return read(FOLDER / f"{cls.__name__}.npz")
