"""How a store lies in SQLite: tables, their columns, and the checksum of each row.

The column `checksum` of a row is the CRC-32 (ISO 3309) of two parts. First come its numbers, in the
order of the columns, as doubles in little endian, with nan for NULL. Then come its texts and blobs,
in the order of the columns, with a null character between two, each in the file's bytes, and 0xFF
for NULL. If the checksum does not agree, the row was damaged after it was written.
"""

from __future__ import annotations

import dataclasses
import functools
import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np
import numpy.typing as npt

from fclib._solve import MERITS
from fclib.bench.job import ProblemFacts

VERSION = 5  # of the schema
RELEASED = 4  # version before: it has no checksums and no descriptions of solvers
APPLICATION = 0x46434C42  # "FCLB"
NOTHING = b"\xff"  # stands for NULL among bytes: no text in UTF-8 contains it

SCHEMA = """
CREATE TABLE campaigns (
    id INTEGER PRIMARY KEY, name TEXT, text TEXT, planned INTEGER, skipped INTEGER, pid INTEGER,
    node TEXT, started REAL, seen REAL, ended REAL, checksum INTEGER
);
CREATE TABLE problems (
    id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, name TEXT, family TEXT, path TEXT, kind TEXT,
    formulation TEXT, spacedim INTEGER, n INTEGER, p INTEGER, nc INTEGER, nnz INTEGER, title TEXT,
    checksum INTEGER
);
CREATE TABLE solvers (
    id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, label TEXT, name TEXT, options TEXT,
    version TEXT, family TEXT, origin TEXT, about TEXT, checksum INTEGER
);
CREATE TABLE machines (
    id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, node TEXT, cpu TEXT, cores INTEGER,
    memory_gb REAL, facts TEXT, checksum INTEGER
);
CREATE TABLE runs (
    id INTEGER PRIMARY KEY, key TEXT NOT NULL,
    campaign INTEGER REFERENCES campaigns, problem INTEGER NOT NULL REFERENCES problems,
    solver INTEGER NOT NULL REFERENCES solvers, machine INTEGER NOT NULL REFERENCES machines,
    tol REAL, time_limit REAL, wall_limit REAL, memory_limit REAL, threads INTEGER, repeat INTEGER,
    merit TEXT NOT NULL DEFAULT 'natural',
    status TEXT NOT NULL, message TEXT, solved INTEGER NOT NULL, iterations INTEGER,
    cpu_s REAL, said_cpu_s REAL, setup_s REAL, total_cpu_s REAL, wall_s REAL, memory_mb REAL,
    {merits}, stages TEXT, measured TEXT, warm INTEGER, pinned INTEGER,
    load REAL, frequency_mhz REAL, started REAL,
    start TEXT NOT NULL DEFAULT 'cold', sequence TEXT, step INTEGER, guess INTEGER, after TEXT,
    copy INTEGER, checksum INTEGER,
    UNIQUE (key, machine)
);
CREATE TABLE faults (
    id INTEGER PRIMARY KEY, key TEXT NOT NULL, campaign INTEGER REFERENCES campaigns,
    problem INTEGER NOT NULL REFERENCES problems, solver INTEGER NOT NULL REFERENCES solvers,
    tol REAL, status TEXT NOT NULL, message TEXT, started REAL, checksum INTEGER
);
CREATE INDEX runs_by_campaign ON runs (campaign);
CREATE TABLE history (
    run INTEGER NOT NULL REFERENCES runs, iteration INTEGER, error REAL, time REAL, stage TEXT,
    checksum INTEGER
);
CREATE INDEX history_by_run ON history (run);
CREATE TABLE certificates (
    run INTEGER PRIMARY KEY REFERENCES runs, certificate TEXT NOT NULL, checksum INTEGER
);
CREATE TABLE solutions (
    run INTEGER PRIMARY KEY REFERENCES runs, u BLOB, r BLOB, l BLOB, checksum INTEGER
);
CREATE TABLE files (
    path TEXT PRIMARY KEY, size INTEGER, modified INTEGER, problem INTEGER REFERENCES problems,
    checksum INTEGER
);
CREATE VIEW results AS SELECT
    runs.id AS run, runs.key, campaigns.name AS campaign,
    problems.name AS problem, problems.family, problems.formulation, problems.spacedim, problems.n,
    problems.p, problems.nc, problems.nnz, problems.title, problems.hash,
    solvers.label AS solver, solvers.name AS solver_name, solvers.options, solvers.version,
    solvers.family AS solver_family, solvers.origin, solvers.about,
    runs.tol, runs.merit, runs.time_limit, runs.wall_limit, runs.memory_limit, runs.threads,
    runs.repeat, COALESCE(runs.copy, 0) AS copy, runs.status, runs.message, runs.solved,
    runs.iterations, runs.cpu_s,
    runs.said_cpu_s, runs.setup_s, runs.total_cpu_s, runs.wall_s, runs.memory_mb, {run_merits},
    runs.start, runs.sequence, runs.step, runs.guess,
    runs.stages, runs.measured, runs.warm, runs.pinned, machines.node, machines.cpu,
    machines.cores, machines.hash AS machine, runs.load, runs.frequency_mhz, runs.started
FROM runs
JOIN problems ON problems.id = runs.problem
JOIN solvers ON solvers.id = runs.solver
JOIN machines ON machines.id = runs.machine
LEFT JOIN campaigns ON campaigns.id = runs.campaign;
""".format(
    merits=", ".join(f"{name} REAL" for name in MERITS),
    run_merits=", ".join(f"runs.{name}" for name in MERITS),
)
STATEMENTS = SCHEMA.split(";\n")[:-1]
VIEW = STATEMENTS[-1]

PROBLEM = tuple(field.name for field in dataclasses.fields(ProblemFacts))
SOLVER = ("hash", "label", "name", "options", "version", "family", "origin", "about")
MACHINE = ("hash", "node", "cpu", "cores", "memory_gb", "facts")
CAMPAIGN = ("name", "text", "planned", "skipped", "pid", "node", "started", "seen", "ended")
RUN = (
    *("key", "campaign", "problem", "solver", "machine"),
    *("tol", "merit", "time_limit", "wall_limit", "memory_limit", "threads", "repeat", "copy"),
    *("status", "message", "solved", "iterations"),
    *("cpu_s", "said_cpu_s", "setup_s", "total_cpu_s", "wall_s", "memory_mb"),
    *(*MERITS, "stages", "measured", "warm", "pinned", "load", "frequency_mhz", "started"),
    *("start", "sequence", "step", "guess", "after"),
)
FAULT = ("key", "campaign", "problem", "solver", "tol", "status", "message", "started")
HISTORY = ("iteration", "error", "time", "stage")
OF_A_RUN = ("history", "certificates", "solutions")  # tables with further data of a run


@dataclass(frozen=True)
class Layout:
    """The columns of a table, except its checksum."""

    table: str
    numbers: tuple[str, ...]
    texts: tuple[str, ...]  # and blobs
    declared: tuple[tuple[str, str], ...]  # all names with their types, in order

    @property
    def names(self) -> tuple[str, ...]:
        """The checksum of a row that `query` gives; the row's own checksum is left out."""
        return self.numbers + self.texts

    def query(self, condition: str = "") -> str:
        """The query for rows that `wrong` takes: the row's number first, its checksum last."""
        texts = (f"COALESCE(CAST({name} AS BLOB), x'{NOTHING.hex()}')" for name in self.texts)
        columns = ", ".join((*self.numbers, *texts))
        where = condition and f" WHERE {condition}"
        return f"SELECT rowid, {columns}, checksum FROM {self.table}{where} ORDER BY rowid"


@functools.cache
def layouts() -> dict[str, Layout]:
    """The layouts of all tables, as SQLite understands the schema."""
    database = sqlite3.connect(":memory:")
    found = {}
    for statement in STATEMENTS:
        database.execute(statement)
    for (table,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'"):
        declared = declared_in(database, table)
        kinds = dict(declared)
        kinds.pop("checksum")
        numbers = tuple(name for name, kind in kinds.items() if kind in ("INTEGER", "REAL"))
        texts = tuple(name for name in kinds if name not in numbers)
        found[table] = Layout(table, numbers, texts, declared)
    database.close()
    return found


def declared_in(database: sqlite3.Connection, table: str) -> tuple[tuple[str, str], ...]:
    """The columns that a table of a file has, with their types, in order."""
    return tuple((row[1], row[2]) for row in database.execute(f"PRAGMA table_info({table})"))


@functools.cache
def columns() -> tuple[str, ...]:
    """The columns of the view `results`, in order."""
    database = sqlite3.connect(":memory:")
    for statement in STATEMENTS:
        database.execute(statement)
    found = tuple(name for name, _ in declared_in(database, "results"))
    database.close()
    return found


def numbers_of(layout: Layout, rows: Sequence[tuple[Any, ...]]) -> npt.NDArray[np.float64]:
    """The numbers of rows as `Layout.query` selects them (rows, numbers); nan for NULL.

    Raises ValueError, TypeError or OverflowError if something is not a number.
    """
    end = 1 + len(layout.numbers)
    found = np.array([row[1:end] for row in rows], dtype="<f8")
    return found.reshape(len(rows), len(layout.numbers))


def checksums(
    layout: Layout, rows: Sequence[tuple[Any, ...]], numbers: npt.NDArray[np.float64]
) -> list[int]:
    """The checksums of rows that `Layout.query` selects, with their numbers."""
    data, size, end = numbers.tobytes(), 8 * len(layout.numbers), 1 + len(layout.numbers)
    return [
        crc32(b"\0".join(row[end:-1]), crc32(data[k * size : (k + 1) * size]))
        for k, row in enumerate(rows)
    ]


def right(
    layout: Layout, rows: Sequence[tuple[Any, ...]]
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.float64]]:
    """A mask of the undamaged rows, and the numbers of all rows."""
    try:
        numbers = numbers_of(layout, rows)
        found = checksums(layout, rows, numbers)
    except (ValueError, TypeError, OverflowError):
        if len(rows) == 1:
            return np.array([False]), np.full((1, len(layout.numbers)), np.nan)
        parts = [right(layout, [row]) for row in rows]
        return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    good = [row[-1] == checksum for row, checksum in zip(rows, found, strict=True)]
    return np.array(good, dtype=bool), numbers
