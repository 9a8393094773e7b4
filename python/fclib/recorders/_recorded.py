"""One recorded step, and a folder of them."""

from __future__ import annotations

import importlib
import importlib.metadata
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from fclib import _core
from fclib._sequence import SUFFIXES
from fclib._words import counted
from fclib.recorders._assemble import Assembled, Contacts

Origin = Literal["exact", "reconstructed"]
# largest difference of the velocities of a step that is exact, relative, by the bytes of a number
EXACT: Final = {4: 1e-4, 8: 1e-8}
# components of a contact, by their number
AXES: Final = {
    2: "N, T",
    3: "N, T1, T2",
    4: "N, T1, T2, S",
    5: "N, T1, T2, R1, R2",
    6: "N, T1, T2, S, R1, R2",
}


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """The problem of one step of another engine, and that engine's own result."""

    assembled: Assembled
    engine: str  # name of the engine
    version: str
    licence: str
    law: str  # the law that the engine solves, in words
    time: float  # at the start of the step [s]
    h: float  # [s]
    # origin of M, f, H, w, mu, G, b or W, q: from the engine, or by formulas
    fields: Mapping[str, Origin]
    guess: _core.Solution | None = None  # the engine's own reaction
    # (n), of a local problem (m), velocity of the engine after the step; None: unknown
    velocity: Any = None
    contacts: Contacts | None = None
    notes: tuple[str, ...] = ()
    more: Mapping[str, Any] = field(default_factory=dict)  # in JSON's types

    @property
    def problem(self) -> Any:
        """The problem; the last line of its description, in JSON, tells its origin.

        It is global, or a `LocalProblem` if the engine gives only W.
        """
        origin = {
            "generator": "fclib.recorders",
            "fclib": _core.version,
            "engine": self.engine,
            "version": self.version,
            "licence": self.licence,
            "law": self.law,
            "time": self.time,
            "time_step": self.h,
            "fields": dict(self.fields),
            "redundant": list(self.assembled.redundant),
            **dict(self.more),
        }
        if self.contacts is not None and self.contacts.bodies is not None:
            origin["bodies"] = np.asarray(self.contacts.bodies).tolist()
        words = [
            f"A step of {self.engine} {self.version} ({self.licence}), recorded.",
            f"Law of the engine: {self.law}.",
            *self.notes,
        ]
        problem = self.assembled.problem
        equations = "u = W r + q"
        if hasattr(problem, "M"):
            equations = "M v = H r + G lambda + f, u = H^T v + w, G^T v + b = 0"
        elif problem.p:
            equations = "u = W r + V lambda + q, V^T r + R lambda + s = 0"
        axes = AXES[problem.spacedim]
        info = _core.ProblemInfo(
            title=f"{self.engine}, t = {self.time:g} s",
            description="\n".join([*words, json.dumps(origin)]),
            math_info=(
                f"{equations}; velocities in m/s and rad/s, r in N s over h = {self.h:g} s,"
                f" components {axes}"
            ),
        )
        return problem.replace(info=info)

    @property
    def mismatch(self) -> float | None:
        """The largest difference of the engine's velocity from that of its reaction [m/s].

        The velocity is v, or u of a local problem. None if the engine gives no reaction or
        velocity.
        """
        problem = self.assembled.problem
        if isinstance(problem, _core.LocalProblem):
            if self.guess is None or self.velocity is None:
                return None
            u = problem.W @ self.guess.r + problem.q
            if problem.V is not None:
                if self.guess.l is None:
                    return None
                u = u + problem.V @ self.guess.l
            return float(np.abs(u - np.asarray(self.velocity)).max(initial=0.0))
        untold = (problem.m and self.guess is None) or (
            problem.p and (self.guess is None or self.guess.l is None)
        )
        if untold or self.velocity is None:
            return None
        import scipy.sparse as sp
        import scipy.sparse.linalg as spl

        pushed = problem.f if self.guess is None else problem.H @ self.guess.r + problem.f
        if self.guess is not None and problem.p:
            pushed = pushed + problem.G @ self.guess.l
        v = spl.spsolve(sp.csc_array(problem.M), pushed)
        found = np.atleast_1d(v)[: self.assembled.dofs]
        return float(np.abs(found - np.asarray(self.velocity)).max(initial=0.0))

    def write(self, path: str | Path) -> None:
        """An FCLIB file: the problem, and the engine's reaction as a guess. FileError."""
        _core.write(path, self.problem, None, self.guesses)

    @property
    def guesses(self) -> list[_core.Solution]:
        """The engine's reaction, if it gave one."""
        return [] if self.guess is None else [self.guess]


def checked(recorded: Recorded, exact: float) -> Recorded:
    """The step; its M and f are exact only if the reaction gives the engine's velocity.

    Args:
        recorded: a step whose engine gave its reaction.
        exact: largest difference of the velocities, relative to the largest one, or to 1.
    """
    off = recorded.mismatch or 0.0
    if off <= exact * max(1.0, float(np.abs(recorded.velocity).max(initial=0.0))):
        return recorded
    # a force that the integrator treats in a way of its own, as damping that is not linear
    return replace(
        recorded,
        fields={**recorded.fields, "M": "reconstructed", "f": "reconstructed"},
        notes=(
            *recorded.notes,
            f"{recorded.engine}'s reaction gives its next velocity to {off:.1e} only: in m/s or"
            " rad/s.",
        ),
    )


def pinned(module: str, package: str, wanted: str) -> str:
    """The version of an engine whose private data are read. ImportError if it is another one."""
    importlib.import_module(module)
    version = importlib.metadata.version(package)
    if version.split(".")[:2] != wanted.split("."):
        raise ImportError(
            f"{package} {version} is installed, and private data of {package} {wanted} are read:"
            f' pip install "{package}=={wanted}.*"'
        )
    return version


Maker = Callable[[], Recorded | None]


def no_step() -> None:
    """Make no step: it is not kept, or nothing touches."""


class SetupError(ValueError):
    """No step of this simulation can be recorded, because of its settings."""


class Recording:
    """A folder or a sequence for recorded steps: each `every`-th step with contacts is written.

    with Recording("steps", every=10) as recording:
        ...
        recording.add(recorded)

    A name that ends in .h5 or .hdf5 is that of a sequence, any other one that of a folder. A step
    that cannot be recorded, because of a flexible body or a number that is not finite, is left out,
    and `left_out` says why.
    """

    def __init__(self, path: str | Path, every: int = 1) -> None:
        """ValueError if `every` is below 1, FileExistsError if there are files already."""
        if every < 1:
            raise ValueError(f"every must be at least 1, not {every}")
        # a script may change to another folder
        self.path, self.every = Path(path).absolute(), every
        self.seen = self.written = 0
        self.left_out: list[tuple[int, str]] = []  # number of the step, and the reason
        self._sequence: _core.SequenceWriter | None = None
        if self.path.is_file():
            raise FileExistsError(f"{self.path}: is there already; name another file")
        if self.path.is_dir() and any(self.path.glob("*.hdf5")):
            raise FileExistsError(f"{self.path}: has steps already; name another folder")

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End a sequence. FileError if it cannot be written."""
        if self._sequence is not None:
            self._sequence.close()

    def nothing(self, engine: str) -> str:
        """Why no step was written, in words."""
        if not self.seen:
            return f"it took no step of {engine} of the kind that is recorded"
        if self.left_out:
            return self.without
        return f"of {counted(self.seen, 'step')}, none that was kept has a contact between points"

    @property
    def without(self) -> str:
        """What was left out, in words; empty if nothing was."""
        if not self.left_out:
            return ""
        number, why = self.left_out[0]
        count = len(self.left_out)
        more = f", and {count - 1} more" if count > 1 else ""
        return (
            f"left out of {counted(self.seen, 'step')}: number {number}{more}. Of number {number}:"
            f" {why}"
        )

    @property
    def wanted(self) -> bool:
        """Whether the next step is kept; otherwise it need not be assembled."""
        return self.seen % self.every == 0

    def add(self, recorded: Recorded | None) -> None:
        """Count a step, and write it if it is to be kept and something touches."""
        self.take(lambda: recorded)

    def take(self, make: Maker) -> None:
        """The same of a step that is made only if it is to be kept.

        Raises:
            SetupError: no step can be recorded.
            FileError: it cannot be written.
        """
        number, kept = self.seen, self.wanted
        self.seen += 1
        if not kept:
            return
        try:
            recorded = make()
            if recorded is not None and recorded.assembled.problem.nc:
                self._write(number, recorded)
                self.written += 1
        except SetupError:
            raise
        except ValueError as error:  # np.linalg.LinAlgError and ProblemError are such
            self.left_out.append((number, str(error)))

    def _write(self, number: int, recorded: Recorded) -> None:
        if self.path.suffix not in SUFFIXES:
            self.path.mkdir(parents=True, exist_ok=True)
            recorded.write(self.path / f"{recorded.engine.lower()}-{number:06d}.hdf5")
            return
        if self._sequence is None:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._sequence = _core.SequenceWriter(self.path)
        self._sequence.append(recorded.problem, None, recorded.guesses)
