"""Messages of a campaign and its processes: a job goes out, a record comes back."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from fclib import _laws
from fclib._solve import MeritKind
from fclib._verdicts import is_solved

# how a run may end; the solver says the first group, and the merit confirms it
STATUSES: Mapping[str, str] = MappingProxyType(
    {
        "converged": "the recomputed error is at most the tolerance, within the limits",
        "iteration_limit": "stopped itself at its limit of iterations",
        "time_limit": "stopped itself at the time limit, or came too late",
        "stalled": "gave up: nothing left to try",
        "diverged": "says itself that it diverged",
        "infeasible": "proved that the problem has no solution; the proof was checked",
        "interrupted": "stopped for another reason",
        "inaccurate": "said to be done, and the recomputed error is above the tolerance; "
        "or said that there is no solution, and proved nothing",
        "invalid": "returned numbers that are not finite",
        "nothing": "returned no solution: none at all, the starting point as it was, or one worse "
        "than no reactions",
        "garbage": "returned what is no solution of this problem: another shape, another format",
        "unsuitable": "has declared that it does not take problems of this kind",
        "error": "raised an exception, or ended with an exit status other than 0",
        "cpu_limit": "was killed: it had used the CPU time, and did not stop",
        "wall_limit": "was killed: the wall clock had run out, and it did not stop",
        "memory": "ran out of the memory that it was allowed",
        "crashed": "was ended by a signal of its own making, as a segmentation fault, or of which "
        "nobody knows who sent it",
        "lied": "said that it took less than nothing, or more than the kernel has seen",
        "killed": "was killed from outside, by the system or by a person, as the kernel says",
        "unreadable": "the problem cannot be read, or its file has changed",
        "no_space": "a disk is full, or the system has no more files to give",
        "lost": "the process that watches it, or the machine, has ended or does not answer",
    }
)
# faults from outside, not of the solver. The run is tried again, and then counts as not run
SURROUNDINGS = ("killed", "unreadable", "no_space", "lost")
KEPT = ("u", "r", "l")  # the vectors of a solution that are stored
# after these a worker is kept; after any other, who knows what the solver did to its process
ORDERLY = frozenset(
    (
        "converged",
        "iteration_limit",
        "time_limit",
        "stalled",
        "diverged",
        "infeasible",
        "interrupted",
        "unsuitable",
    )
)


@dataclass(frozen=True)
class ProblemFacts:
    """The facts of a problem that campaigns know: its file, form and size."""

    hash: str  # fclib.digest
    name: str
    family: str
    path: str  # absolute
    kind: str  # which problem of the file
    formulation: str
    spacedim: int
    n: int  # degrees of freedom, 0 for a local problem
    p: int  # bilateral constraints
    nc: int  # contacts
    nnz: int  # of W, or of M
    title: str


@dataclass(frozen=True)
class SolverChoice:
    """A solver with the options that are set; an option left out has its default."""

    name: str
    options: Mapping[str, Any]
    version: str = ""
    family: str = ""
    origin: str = ""
    label: str = ""  # its name in tables
    about: str = ""  # the description of the solver in JSON: `campaign.described`
    # dimensions it takes, by the law of contact; None: not known
    dimensions: Mapping[str, Sequence[int]] | None = None

    def suits(self, problem: ProblemFacts) -> bool:
        """Whether the solver takes problems of this kind, by what it declares."""
        if self.dimensions is None:
            return True
        return problem.spacedim in self.dimensions[_laws.law_of(problem.kind)]

    @property
    def title(self) -> str:
        """The label, or the name with its options: "nsgs relaxation=1.2"."""
        words = (f"{key}={value}" for key, value in self.options.items())
        return self.label or " ".join((self.name, *words))

    @cached_property
    def part_of_key(self) -> str:
        """What it adds to the key of a run."""
        options = sorted((name, repr(value)) for name, value in self.options.items())
        return ", ".join(map(json.dumps, (self.name, options, self.version)))


@dataclass(frozen=True)
class Limits:
    """The limits of a run."""

    time: float  # [s] of CPU, all of its processes together
    wall: float  # [s]
    memory: float  # [MB] resident size, beyond that of the idle worker

    @cached_property
    def part_of_key(self) -> str:
        """What they add to the key of a run."""
        return json.dumps([repr(float(x)) for x in (self.time, self.wall, self.memory)])


@dataclass(frozen=True)
class Along:
    """The place of a run in a sequence of steps, solved one after another."""

    sequence: str
    step: int  # 0, 1, ...; the first has nothing to start from
    after: str  # key of the run of the step before by this solver; empty at the first


@dataclass(frozen=True)
class Guess:
    """A solution of an earlier step, from which a run starts, contact by contact."""

    problem: ProblemFacts  # the problem of that step
    step: int
    r: bytes  # (m) float64
    multipliers: bytes | None  # (p) float64

    def order(self) -> dict[str, Any]:
        """The guess in JSON's types, as it is sent to a worker."""
        vectors = {"r": self.r, "l": self.multipliers}
        facts = {name: getattr(self.problem, name) for name in ("path", "kind", "hash")}
        return facts | {
            name: None if value is None else np.frombuffer(value).tolist()
            for name, value in vectors.items()
        }


@dataclass(frozen=True)
class Job:
    """One run to be done."""

    problem: ProblemFacts
    solver: SolverChoice
    tol: float
    limits: Limits
    repeat: int
    threads: int
    history: bool = False
    modules: tuple[str, ...] = ()  # files of Python with users' solvers, imported first
    merit: MeritKind = "both"  # what the tolerance bounds
    along: Along | None = None  # None: cold, from nothing
    keep: bool = False  # whether the solution is stored
    guess: Guess | None = None  # known once the run begins; `along` decides it
    renumber: bool = False  # whether each repeat but the first is of a copy: copies.py
    # key of the run at a smaller tolerance whose history may answer this job: reached.py
    off: str = ""
    first: str = ""  # key of the first run, if this repeat is needed only if that run solved

    @property
    def start(self) -> str:
        """The start of the solver: "cold" from nothing, "warm" from a step before."""
        return "warm" if self.along else "cold"

    @property
    def key(self) -> str:
        """Two runs of one key are the same; a store keeps one row for each key and machine."""
        parts = [
            json.dumps(self.problem.hash),
            self.solver.part_of_key,
            f'"{float(self.tol)!r}"',
            self.limits.part_of_key,
            f"{self.threads}, {self.repeat}",
        ]
        if self.merit != "natural":  # it was the only one when stores began
            parts.append(json.dumps(self.merit))
        if self.along:
            parts.append(json.dumps(["after", self.along.after]))
        if self.copy:
            parts.append('"copy"')
        if self.off:
            parts.append('"off"')
        return hashlib.sha256(f"[{', '.join(parts)}]".encode()).hexdigest()[:32]

    @property
    def after(self) -> str:
        """The key of the run that this one waits for; empty if there is none."""
        return self.along.after if self.along else self.off or self.first

    @property
    def copy(self) -> int:
        """Which copy of the problem is solved; 0 for the problem itself."""
        return self.repeat if self.renumber else 0

    def order(self) -> dict[str, Any]:
        """The job in JSON's types, as it is sent to a supervisor."""
        return {
            "path": self.problem.path,
            "kind": self.problem.kind,
            "hash": self.problem.hash,
            "spacedim": self.problem.spacedim,
            "copy": self.copy,
            "suits": self.solver.suits(self.problem),
            "solver": self.solver.name,
            "options": dict(self.solver.options),
            "tol": self.tol,
            "merit": self.merit,
            "limits": asdict(self.limits),
            "history": self.history,
            "threads": self.threads,
            "modules": list(self.modules),
            "keep": self.keep,
            "guess": self.guess.order() if self.guess else None,
        }


@dataclass
class Record:
    """The result of a job; None means not known, for example the error of a run that was killed."""

    status: str
    message: str = ""
    iterations: int | None = None
    cpu_s: float | None = None  # [s] of the solver alone, as far as the kernel confirms it
    said_cpu_s: float | None = None  # [s] of the solver alone, as the driver and the solver say
    setup_s: float | None = None  # [s] of conversions and judgement inside the solve
    total_cpu_s: float | None = None  # [s] of all processes of the run, counted by the kernel
    wall_s: float | None = None  # [s]
    memory: float | None = None  # [MB] largest growth of all processes of the run together
    merits: Mapping[str, float] | None = None  # value of each of MERITS, recomputed by the bench
    certificate: str | None = None  # JSON, the proof that there is no solution
    stages: str | None = None  # JSON, the stages of a solver that chains others
    history: list[tuple[int, float, float, str]] | None = None  # iteration, error, time [s], stage
    guessed: bool = False  # whether it started from the guess of its job
    solution: Mapping[str, bytes] | None = None  # u, r and l as float64, if it is to be stored
    measured: str = ""  # the way of measuring: "cgroup", "cgroup, PSS" or "processes"
    warm: bool = False  # whether the solver had been called before in this process
    pinned: bool = False  # whether the run had cores for itself
    machine: Mapping[str, Any] | None = None
    load: float | None = None  # [1] mean load of the last minute, at the start
    frequency: float | None = None  # [MHz] at the start
    started: float = 0.0  # [s] since 1970

    @property
    def solved(self) -> bool:
        """Whether the recomputed error met the tolerance within the limits, or a proof holds."""
        return is_solved(self.status)

    @property
    def ran(self) -> bool:
        """Whether the solver alone decided the result, and nothing from outside."""
        return self.status not in SURROUNDINGS


# does jobs, here or elsewhere; yields each with its record once it is done
Runner: TypeAlias = Callable[[Iterator[Job]], Iterator[tuple[Job, Record]]]
