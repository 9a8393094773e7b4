"""A trajectory: the stored states from which problems are assembled again, without a solve.

    problem = trajectory.problem(i).problem     a function of the scene and of state i alone

A state is a configuration q (nq) and a velocity v (n) at the start of a step; q has the time if
loads or controls depend on it. The scene has all else that the assembly needs, and is in the file:
the MJCF text or the elastic blocks, time step, law, restitution, activation. Impulses of the
step before are not needed: they are a guess for a solver, not part of a problem.

States are rounded to multiples of a power of 2 (`simulate/rounding.py`), and problems are assembled
from the rounded ones: nothing adds up, since each problem starts from its own state. Multiples of a
fixed quantum are used, not floats of 32 bits: a body at rest 100 m above the ground needs the same
resolution of its gap as one on the ground. And values at rest become 0, which takes no room.

The file is a ZIP archive, which any tool opens. It is compressed by LZMA, which is in Python's own
library:

    trajectory.json     the contents, the scene, the simulator, and the shapes of the arrays
    position.bin        (K x nq) integers of the quantum, see below
    velocity.bin        (K x n)
    number.bin, step.bin            (K) int64, little-endian
    digest.bin, structure.bin       (K x 32) bytes, `fclib.digest` and the digest of the pattern
    sketch.bin          (K x 13 x 2) float64, little-endian: two sums of each matrix's entries with
                        signs, in the order of `_digest.FIELDS`; NaN if there is no such matrix

of states without those of the steps before, also what the simulation carried over from these, for
all states one after the other:

    guess.bin           float32, little-endian: a guess needs no more digits
    guesses.bin         (K) int32, little-endian: how many numbers each has; -1: not known

of states that another engine handed over (`handed.py`), with C contacts in all, also:

    point.bin (C x 3), normal.bin (C x 3), gap.bin (C)      integers of the quantum, as they are
    count.bin (K), body.bin (C x 2), feature.bin (C)        int32, little-endian

Integers are stored as second differences along K, or as they are if that is shorter: states may be
far from each other, or of different roundings. Those of one coordinate stand one after the other,
in zigzag order (0, -1, 1, -2, ...), the bytes of equal weight together, the lowest first.

No state is stored twice. A file of problems that a set chose from a stored family names the file of
their states, SET/FAMILY-VERSION.trajectory below the same folder, and has guess, guesses, number
and digest only.
"""

from __future__ import annotations

import json
import lzma
import math
import os
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib import _core, _digest
from fclib.collections import handed as engines
from fclib.collections.handed import Handed
from fclib.scenes import Scene
from fclib.scenes.shared.interaction import Course, Drive, Interaction
from fclib.scenes.shared.solids import Bed, Block, HexMesh, Load, Solids, Surface

if TYPE_CHECKING:
    from fclib._core import ProblemInfo
    from fclib.simulate import Model
    from fclib.simulate.moreau_jean import MoreauJean, StepProblem

Vector = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

FORMAT: Final = 1
SUFFIX: Final = ".trajectory"
OWN: Final = f"states{SUFFIX}"  # name beside the problems of a build that simulated it
EPOCH: Final = (1980, 1, 1, 0, 0, 0)  # so that equal trajectories make equal files
LARGEST: Final = 2**53  # integers that a double holds
DIFFERENCES: Final = 2  # order of differences along the steps, if a file names no other
ORDERS: Final = (DIFFERENCES, 0)  # those of which the shorter is stored
# arrays of a trajectory, with a row for each state
ARRAYS: Final = ("number", "step", "position", "velocity", "sketch")
HEXES: Final = ("digest", "structure")
# arrays of contacts that another engine handed over, and the one with a row for each state
NUMBERS: Final = ("point", "normal", "gap")
INTEGERS: Final = ("count", "body", "feature")


class TrajectoryError(ValueError):
    """A file is not a trajectory, or this version cannot read it."""


@dataclass(frozen=True)
class Told:
    """The problem of a state of another engine, which has no model."""

    problem: _core.GlobalProblem


Assembled: TypeAlias = "StepProblem | Told"


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """K stored states of a scene, and known facts of their problems."""

    scene: Scene
    # the settings of its simulation, in JSON's types: collection (the set), version, and `settings`
    # of the
    # simulation: solver, tol, warm_start, options, stabilization, fclib (its version)
    origin: Mapping[str, Any]
    exponent: int  # states are multiples of 2^exponent
    number: Integers  # (K) numbers of the problems in their family, increasing
    step: Integers  # (K) steps of the simulation
    position: Vector  # (K x nq)
    velocity: Vector  # (K x n)
    digest: tuple[str, ...] = ()  # (K) `fclib.digest` of the problems at publication
    structure: tuple[str, ...] = ()  # (K) digests of their patterns
    sketch: Vector = field(default_factory=lambda: np.zeros((0, len(_digest.FIELDS), 2)))
    handed: Handed | None = None  # bodies and contacts of another engine that made the states
    # (K) reactions that the simulation carried over from the step before, as a guess; None of a
    # state: not known. Empty: the step before is stored too, where there is one
    guess: tuple[Vector | None, ...] = ()

    def __len__(self) -> int:
        return len(self.number)

    @cached_property
    def model(self) -> Model:
        """The model of the scene, left in the state that was assembled last."""
        from fclib.simulate import model_of

        return model_of(self.scene)

    @cached_property
    def scheme(self) -> MoreauJean:
        """The assembly of its steps into problems."""
        from fclib.simulate import scheme_of

        return scheme_of(self.model, self.origin["settings"]["stabilization"])

    @cached_property
    def words(self) -> Callable[..., ProblemInfo]:
        """The function that gives the info of a problem, by its step and number."""
        from fclib.simulate import descriptions

        known = {name: self.origin[name] for name in ("collection", "version")}
        settings = self.origin["settings"] | known
        return descriptions(self.scene, self.scheme, settings, self.model.left_out)

    def index(self, number: int) -> int:
        """The place of a problem's number. KeyError if there is no such problem."""
        place = int(np.searchsorted(self.number, number))
        if place == len(self) or self.number[place] != number:
            name = f"{self.origin['collection']}/{self.scene.name}/{number:04d}"
            raise KeyError(f"version {self.origin['version']} has no problem {name}")
        return place

    @property
    def time_step(self) -> float:
        """H [s]."""
        if self.scene.time_step is not None:
            return self.scene.time_step
        return float(self.model.time_step)

    def time(self, place: int) -> float:
        """The time at the start of a state's step [s]."""
        return float(self.step[place] * self.time_step)

    @property
    def left_out(self) -> tuple[str, ...]:
        """What the problems do not have of the scene."""
        return () if self.handed is not None else tuple(self.model.left_out)

    def moved(self, part: Assembled) -> int:
        """The number of bodies that the contacts of a problem move."""
        if self.handed is not None:
            return int(part.problem.n) // engines.TWIST
        return int(np.unique(self.model.trees[part.dofs]).size)  # type: ignore[union-attr]

    def problem(self, place: int) -> Assembled:
        """The problem of a state, by its place 0, 1, ..., K - 1; nothing is solved.

        If the scene cannot be assembled, it raises as `fclib.simulate.simulate` does.
        """
        if self.handed is not None:
            number, step = int(self.number[place]), int(self.step[place])
            own = engines.info_of(self.scene, self.origin, number, step)
            state = self.position[place], self.velocity[place]
            return Told(self.handed.problem(place, *state, self.time_step, own))
        from fclib.simulate import geometry_of, problem_at

        info = self.words(int(self.step[place]), number=int(self.number[place]))
        state = self.position[place], self.velocity[place]
        part = problem_at(self.model, self.scheme, *state, info)
        contacts, bodies = geometry_of(self.model, part.contacts)
        start = np.zeros(part.problem.n)  # auxiliary degrees of freedom begin at rest
        start[: len(part.dofs)] = self.velocity[place][part.dofs]
        bodies = bodies.started(start, part.problem)
        return replace(part, problem=part.problem.replace(contacts=contacts, bodies=bodies))

    def differences(self, place: int, problem: Any) -> dict[str, float]:
        """The distance of a problem from the published one, for each array that differs.

        Returns:
            For each ||A - A'|| / ||A|| in the Frobenius norm, estimated from two sums with signs
            (`_digest.distance`); infinite for all if the pattern differs.
        """
        if _digest.structure(problem) != self.structure[place]:
            return dict.fromkeys(_digest.parts(problem), math.inf)
        return _digest.distance(problem, self.sketch[place])


def part(states: Trajectory, numbers: Iterable[int], collection: str, version: str) -> Trajectory:
    """Some problems of a trajectory, as a version of another set. Raises KeyError."""
    places = [states.index(number) for number in sorted(numbers)]
    values: dict[str, Any] = {name: getattr(states, name)[places] for name in ARRAYS}
    values |= {name: tuple(getattr(states, name)[i] for i in places) for name in HEXES}
    values["handed"] = states.handed.taken(places) if states.handed is not None else None
    values["guess"] = tuple(states.guess[i] for i in places) if states.guess else ()
    origin = {**states.origin, "collection": collection, "version": version}
    return replace(states, origin=origin, **values)


# ---- rounding


def exponent_of(model: Model) -> int:
    """The quantum 2^e to which the states of a model are rounded."""
    from fclib.simulate.rounding import exponent_of

    return exponent_of(model.smallest_size)


def rounded(values: Vector, exponent: int) -> Vector:
    """Values as multiples of 2^exponent; the nearest one; of two, the even one.

    ValueError if a value is not finite, or is too large to have such a multiple.
    """
    integers = np.rint(np.ldexp(values, -exponent))
    if not (np.abs(integers) < LARGEST).all():
        raise ValueError(f"a state is out of range: {np.abs(values).max():g}")
    multiples: Vector = np.ldexp(integers, exponent)
    return multiples


# ---- files


def write(path: Path, trajectory: Trajectory, source: str = "") -> None:
    """Write a trajectory; equal ones make equal files. Raises OSError, FileExistsError.

    A file is never rewritten: another trajectory is another version, in a file of its own.

    Args:
        path: the file; with a source it is BASE/SET/FAMILY-VERSION.trajectory.
        trajectory: its content.
        source: the file below BASE of which it is a `part`, and which has its states.
    """
    head: dict[str, Any] = {
        "format": FORMAT,
        "origin": dict(trajectory.origin),
        "problems": len(trajectory),
    }
    arrays: dict[str, bytes] = {}
    if source:
        head["source"] = source
    else:
        arrays, shapes = states_of(trajectory)
        head |= {"exponent": trajectory.exponent, "arrays": shapes}
        head["scene"] = record(trajectory.scene)
        if trajectory.handed is not None:
            head["handed"] = trajectory.handed.head()
    if trajectory.guess:
        known = [np.zeros(0) if one is None else one for one in trajectory.guess]
        counts = [-1 if one is None else len(one) for one in trajectory.guess]
        arrays["guess"] = np.concatenate(known).astype("<f4").tobytes()
        arrays["guesses"] = np.array(counts, "<i4").tobytes()
    arrays["number"] = trajectory.number.astype("<i8").tobytes()
    if not source:
        arrays["step"] = trajectory.step.astype("<i8").tobytes()
    arrays["digest"] = bytes.fromhex("".join(trajectory.digest))
    if not source:
        arrays["structure"] = bytes.fromhex("".join(trajectory.structure))
        arrays["sketch"] = trajectory.sketch.astype("<f8").tobytes()
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.exists():
        raise FileExistsError(f"{path}: is there already, and a trajectory is never rewritten")
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with zipfile.ZipFile(beside, "w", zipfile.ZIP_LZMA) as archive:
            content = {"trajectory.json": json.dumps(head, indent=1, sort_keys=True).encode()}
            content |= {f"{name}.bin": data for name, data in arrays.items()}
            for name, data in content.items():
                entry = zipfile.ZipInfo(name, date_time=EPOCH)
                entry.compress_type = zipfile.ZIP_LZMA
                entry.external_attr = 0o644 << 16
                archive.writestr(entry, data)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def states_of(trajectory: Trajectory) -> tuple[dict[str, bytes], dict[str, Any]]:
    """The states and contacts of a trajectory as bytes, and the shapes of their arrays."""
    arrays: dict[str, bytes] = {}
    shapes: dict[str, Any] = {}
    columns: list[tuple[str, Vector, tuple[int, ...]]] = [
        (name, getattr(trajectory, name), ORDERS) for name in ("position", "velocity")
    ]
    if trajectory.handed is not None:
        # contacts that follow each other are no steps
        columns += [(name, getattr(trajectory.handed, name), (0,)) for name in NUMBERS]
        for name in INTEGERS:
            arrays[name] = getattr(trajectory.handed, name).astype("<i4").tobytes()
    for name, values, orders in columns:
        values = values.reshape(len(values), math.prod(values.shape[1:]))
        found = [(*packed(values, trajectory.exponent, order), order) for order in orders]
        arrays[name], width, order = min(found, key=lambda one: len(lzma.compress(one[0])))
        shapes[name] = {"shape": list(values.shape), "bytes": width}
        if order != DIFFERENCES and len(orders) > 1:
            shapes[name]["order"] = order
    return arrays, shapes


def head_of(path: Path, archive: zipfile.ZipFile) -> dict[str, Any]:
    """The description in a file."""
    head: dict[str, Any] = json.loads(archive.read("trajectory.json"))
    if head["format"] != FORMAT:
        raise TrajectoryError(
            f"{path}: is of format {head['format']}, and this version of fclib reads {FORMAT}:"
            " a later one reads it"
        )
    return head


@contextmanager
def opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """The archive of a trajectory. OSError, TrajectoryError."""
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except (
        *(zipfile.BadZipFile, lzma.LZMAError, KeyError, TypeError, EOFError, ValueError),
        RecursionError,  # two files that name each other as the source
    ) as error:
        if isinstance(error, TrajectoryError):
            raise
        raise TrajectoryError(f"{path}: is no trajectory, or a damaged one: {error}") from error


def read_origin(path: Path) -> tuple[Scene, dict[str, Any]]:
    """The scene of a trajectory and its origin. OSError, TrajectoryError."""
    with opened(path) as archive:
        head = head_of(path, archive)
    if "source" in head:
        return read_origin(source_of(path, head))[0], head["origin"]
    return scene_of(head["scene"]), head["origin"]


def source_of(path: Path, head: Mapping[str, Any]) -> Path:
    """The file with the states of one that has none. Raises TrajectoryError if it is not there."""
    source: Path = path.parents[1] / head["source"]
    if not source.is_file():
        raise TrajectoryError(f"{path}: its states are in {source}, which is not there")
    return source


def read_digests(path: Path) -> dict[int, str]:
    """The digest of each problem of a trajectory, by its number. OSError, TrajectoryError."""
    with opened(path) as archive:
        head_of(path, archive)
        numbers = np.frombuffer(archive.read("number.bin"), "<i8").tolist()
        digests = archive.read("digest.bin")
        return {n: digests[32 * i : 32 * i + 32].hex() for i, n in enumerate(numbers)}


def read(path: Path) -> Trajectory:
    """Read a trajectory. OSError, TrajectoryError."""
    with opened(path) as archive:
        head = head_of(path, archive)
        arrays = {
            entry.removesuffix(".bin"): archive.read(entry)
            for entry in archive.namelist()
            if entry.endswith(".bin")
        }
        count = head["problems"]

        def guesses() -> tuple[Vector | None, ...]:
            if "guesses" not in arrays:
                return ()
            values = np.frombuffer(arrays["guess"], "<f4").astype(float)
            counts = np.frombuffer(arrays["guesses"], "<i4")
            ends = np.cumsum(np.maximum(counts, 0))
            rows = zip(counts.tolist(), ends.tolist(), strict=True)
            return tuple(None if n < 0 else values[end - n : end] for n, end in rows)

        def hexes(name: str) -> tuple[str, ...]:
            return tuple(arrays[name][32 * i : 32 * i + 32].hex() for i in range(count))

        number = np.frombuffer(arrays["number"], "<i8").astype(np.int64)
        if "source" in head:
            source, own = source_of(path, head), head["origin"]
            found = part(read(source), number, own["collection"], own["version"])
            if found.digest != hexes("digest"):
                raise TrajectoryError(f"{path}: {source} has other problems of these numbers")
            return replace(found, origin=own, guess=guesses())
        exponent = head["exponent"]

        def states(name: str, order: int = DIFFERENCES) -> Vector:
            known = {"order": order} | head["arrays"][name]
            return unpacked(arrays[name], **known, exponent=exponent)

        def contacts() -> Handed | None:
            if "handed" not in head:
                return None
            own: dict[str, Any] = {name: states(name, 0) for name in NUMBERS}
            own |= {name: np.frombuffer(arrays[name], "<i4").astype(int) for name in INTEGERS}
            own |= {"gap": own["gap"].ravel(), "body": own["body"].reshape(-1, 2)}
            return engines.of(head["handed"], **own)

        return Trajectory(
            scene=scene_of(head["scene"]),
            origin=head["origin"],
            exponent=exponent,
            number=number,
            step=np.frombuffer(arrays["step"], "<i8").astype(np.int64),
            position=states("position"),
            velocity=states("velocity"),
            digest=hexes("digest"),
            structure=hexes("structure"),
            sketch=np.frombuffer(arrays["sketch"], "<f8")
            .astype(float)
            .reshape(count, len(_digest.FIELDS), 2),
            handed=contacts(),
            guess=guesses(),
        )


def packed(values: Vector, exponent: int, order: int = DIFFERENCES) -> tuple[bytes, int]:
    """Multiples of 2^exponent (K x m) as bytes, and the number of bytes for each.

    The integers are differences of this order along K.
    """
    integers = np.rint(np.ldexp(values, -exponent)).astype(np.int64)
    for _ in range(order):
        integers = np.diff(integers, axis=0, prepend=np.zeros((1, integers.shape[1]), np.int64))
    zigzag = ((integers << 1) ^ (integers >> 63)).T.astype("<u8", order="C")
    planes = zigzag.view(np.uint8).reshape(-1, 8).T
    width = 8
    while width > 1 and not planes[width - 1].any():
        width -= 1
    return planes[:width].tobytes(), width


def unpacked(
    data: bytes, *, shape: list[int], bytes: int, exponent: int, order: int = DIFFERENCES
) -> Vector:
    """The multiples (K x m) that `packed` has made into bytes."""
    rows, columns = shape
    planes = np.zeros((8, rows * columns), dtype=np.uint8)
    planes[:bytes] = np.frombuffer(data, np.uint8).reshape(bytes, rows * columns)
    zigzag = np.ascontiguousarray(planes.T).view("<u8").reshape(columns, rows).T.astype(np.uint64)
    integers = (zigzag >> np.uint64(1)).astype(np.int64) ^ -(zigzag & np.uint64(1)).astype(np.int64)
    for _ in range(order):
        integers = np.cumsum(integers, axis=0)
    values: Vector = np.ldexp(integers.astype(float), exponent)
    return values


def record(scene: Scene) -> dict[str, Any]:
    """A scene in JSON's types: all of it except the path of its file on this machine."""
    known = asdict(replace(scene, parameters=dict(scene.parameters), path=None))
    if not scene.includes:
        del known["includes"]
    if scene.view is None:
        del known["view"]
    if scene.ground is None:
        del known["ground"]
    if not scene.allowance:
        del known["allowance"]
    for name in ("interactions", "drives", "left_out"):
        if not getattr(scene, name):
            del known[name]
    if scene.solids is not None and not scene.solids.meshes:
        del known["solids"]["meshes"]
    return known


def scene_of(known: Mapping[str, Any]) -> Scene:
    """The scene of a record."""
    # a missing allowance means zero: older scenes had none
    values: dict[str, Any] = {"allowance": False} | {
        name: tuples(value) if name != "parameters" else value for name, value in known.items()
    }
    if known["solids"] is not None:
        solids = {
            name: value if name == "meshes" else tuples(value)
            for name, value in known["solids"].items()
        }
        for name, kind in (("blocks", Block), ("beds", Bed), ("loads", Load)):
            own: Any = kind
            solids[name] = tuple(
                own(**{key: tuples(value) for key, value in part.items()}) for part in solids[name]
            )
        solids["meshes"] = tuple(mesh_of(mesh) for mesh in solids.get("meshes", ()))
        values["solids"] = Solids(**solids)
    interactions, drives = known.get("interactions", ()), known.get("drives", ())
    values["interactions"] = tuple(
        Interaction(**{key: tuples(value) for key, value in one.items()}) for one in interactions
    )
    values["drives"] = tuple(
        Drive(
            dof=one["dof"],
            velocity=one["velocity"],
            course=Course(**{key: tuples(value) for key, value in one["course"].items()}),
        )
        for one in drives
    )
    return Scene(**values)


def mesh_of(known: Mapping[str, Any]) -> HexMesh:
    """The mesh of a record."""
    values = {name: tuples(value) for name, value in known.items()}
    values["surfaces"] = tuple(
        Surface(**{key: tuples(value) for key, value in one.items()}) for one in known["surfaces"]
    )
    return HexMesh(**values)


def tuples(value: Any) -> Any:
    """Lists as tuples, as frozen dataclasses need them."""
    return tuple(tuples(item) for item in value) if isinstance(value, list) else value
