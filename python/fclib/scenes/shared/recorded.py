"""Steps of other engines as arrays in a file; their problems are made without the engine.

The file is an .npz. `about` is JSON: engine, law, notes, of each field whether it is the engine's
or follows from a formula, and the problems' digests. `half` has the half edges of the boxes. Of any
other array the steps come one after another, and `NAME_ends` has the end of each.
"""

from __future__ import annotations

import functools
import json
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
    """A step of free boxes: what the engine made its equations of, and its own answer.

    M v = H r + f, u = H^T v + w; v has the velocity and the spin of each box in turn.
    """

    time: Vector  # (1) at its start [s]
    step: Vector  # (1) h [s]
    M: Any  # (n x n)
    H: Any  # (n x 3 nc)
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


@dataclass(frozen=True, eq=False)
class File:
    """The content of a file."""

    about: dict[str, Any]
    half: Vector  # (nb x 3) [m]
    steps: tuple[Step, ...]
    digests: tuple[str, ...] = ()  # of the problems, as they were when the file was made


def write(path: Path, file: File) -> None:
    """Store steps."""
    about = json.dumps({**file.about, "digests": file.digests})
    arrays: dict[str, Any] = {"about": np.array(about), "half": file.half}
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
    parts = {
        name: np.split(values, arrays[f"{name}_ends"][:-1])
        for name, values in arrays.items()
        if not name.endswith("_ends")
    }
    steps = []
    for k in range(len(parts["time"])):
        own = {name: values[k] for name, values in parts.items()}
        n = len(own["f"])
        for name, columns in (("M", n), ("H", len(own["w"]))):
            three = tuple(own.pop(f"{name}_{part}") for part in ("data", "indices", "indptr"))
            own[name] = sp.csc_array(three, shape=(n, columns))
        steps.append(Step(**own))
    digests = tuple(about.pop("digests"))
    return File(about, half, tuple(steps), digests)


def problem_of(file: File, number: int) -> Any:
    """The problem of a step, with its contacts and bodies; its description is JSON."""
    step = file.steps[number]
    time, h = float(step.time[0]), float(step.step[0])
    return _core.GlobalProblem(
        spacedim=3,
        M=step.M,
        H=step.H,
        f=step.f,
        w=step.w,
        mu=step.mu,
        contacts=None if step.place is None else _contacts(step),
        bodies=None if step.place is None else _bodies(step, file.half),
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


def _bodies(step: Step, half: Vector) -> Bodies:
    """The ground, then the boxes; one shape each."""
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
