"""One recorded step, and a folder of them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from fclib import _core
from fclib.recorders._assemble import Assembled, Contacts

Origin = Literal["exact", "reconstructed"]


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

        It is a `GlobalProblem`, or a `LocalProblem` if the engine gives only W.
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
        if isinstance(problem, _core.GlobalProblem):
            equations = "M v = H r + G lambda + f, u = H^T v + w, G^T v + b = 0"
        axes = "N, T" if problem.spacedim == 2 else "N, T1, T2"
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
        guesses = [] if self.guess is None else [self.guess]
        _core.write(path, self.problem, None, guesses)


class Recording:
    """A folder for recorded steps: each `every`-th step with contacts is written.

    with Recording("steps", every=10) as recording:
        ...
        recording.add(recorded)
    """

    def __init__(self, folder: str | Path, every: int = 1) -> None:
        """ValueError if `every` is below 1, FileExistsError if there are files already."""
        if every < 1:
            raise ValueError(f"every must be at least 1, not {every}")
        # a script may change to another folder
        self.folder, self.every = Path(folder).absolute(), every
        self.seen = self.written = 0
        if self.folder.is_dir() and any(self.folder.glob("*.hdf5")):
            raise FileExistsError(f"{self.folder}: has files already; name another folder")

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def nothing(self, engine: str) -> str:
        """Why no step was written, in words."""
        if not self.seen:
            return f"it took no step of {engine} of the kind that is recorded"
        return f"of {self.seen} steps, none that was kept has a contact between points"

    @property
    def wanted(self) -> bool:
        """Whether the next step is kept; otherwise it need not be assembled."""
        return self.seen % self.every == 0

    def add(self, recorded: Recorded | None) -> None:
        """Count a step, and write it if it is to be kept and something touches."""
        number, kept = self.seen, self.wanted
        self.seen += 1
        if not kept or recorded is None or not recorded.assembled.problem.nc:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        recorded.write(self.folder / f"{recorded.engine.lower()}-{number:06d}.hdf5")
        self.written += 1
