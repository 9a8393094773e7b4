"""The store of a campaign: one SQLite file, one row a run.

Tables: runs, and what they refer to by number: problems, solvers, machines, campaigns; history has
the reports of runs for which they were asked; faults has what kept runs from being done, and is no
solver's. The view `results` has all of a run in one row. The
columns and their units are in docs/bench.md, and `SCHEMA` below is what that says.

A run is identified by its key (`fclib.bench.job.Job.key`). `Store.add` inserts it in one statement
unless there is one of that key: a run is stored once, whatever is interrupted and however many
campaigns write. The file is in WAL mode, which needs a local file system.
"""

from __future__ import annotations

import csv
import dataclasses
import json
import os
import sqlite3
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fclib import _core
from fclib._solve import MERITS
from fclib._verdicts import SOLVED
from fclib.bench.job import KEPT, Job, ProblemFacts, Record
from fclib.bench.table import Table

# of the schema; 1 had neither certificates nor `merit`, which was "natural"; 2 had no faults, but
# runs that were killed or unreadable, and does not say how a run was measured; 3 had no sequences
VERSION = 4
APPLICATION = 0x46434C42  # "FCLB"
PATIENCE = 60.0  # [s] to wait for another writer

SCHEMA = """
CREATE TABLE campaigns (
    id INTEGER PRIMARY KEY, name TEXT, text TEXT, planned INTEGER, skipped INTEGER, pid INTEGER,
    node TEXT, started REAL, seen REAL, ended REAL
);
CREATE TABLE problems (
    id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, name TEXT, family TEXT, path TEXT, kind TEXT,
    formulation TEXT, spacedim INTEGER, n INTEGER, p INTEGER, nc INTEGER, nnz INTEGER, title TEXT
);
CREATE TABLE solvers (
    id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, label TEXT, name TEXT, options TEXT,
    version TEXT, family TEXT, origin TEXT
);
CREATE TABLE machines (
    id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, node TEXT, cpu TEXT, cores INTEGER,
    memory_gb REAL, facts TEXT
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
    UNIQUE (key, machine)
);
CREATE TABLE faults (
    id INTEGER PRIMARY KEY, key TEXT NOT NULL, campaign INTEGER REFERENCES campaigns,
    problem INTEGER NOT NULL REFERENCES problems, solver INTEGER NOT NULL REFERENCES solvers,
    tol REAL, status TEXT NOT NULL, message TEXT, started REAL
);
CREATE INDEX runs_by_campaign ON runs (campaign);
CREATE TABLE history (
    run INTEGER NOT NULL REFERENCES runs, iteration INTEGER, error REAL, time REAL, stage TEXT
);
CREATE INDEX history_by_run ON history (run);
CREATE TABLE certificates (
    run INTEGER PRIMARY KEY REFERENCES runs, certificate TEXT NOT NULL
);
CREATE TABLE solutions (
    run INTEGER PRIMARY KEY REFERENCES runs, u BLOB, r BLOB, l BLOB
);
CREATE TABLE files (
    path TEXT PRIMARY KEY, size INTEGER, modified INTEGER, problem INTEGER REFERENCES problems
);
CREATE VIEW results AS SELECT
    runs.id AS run, runs.key, campaigns.name AS campaign,
    problems.name AS problem, problems.family, problems.formulation, problems.spacedim, problems.n,
    problems.p, problems.nc, problems.nnz, problems.title, problems.hash,
    solvers.label AS solver, solvers.name AS solver_name, solvers.options, solvers.version,
    solvers.family AS solver_family, solvers.origin,
    runs.tol, runs.merit, runs.time_limit, runs.wall_limit, runs.memory_limit, runs.threads,
    runs.repeat, runs.status, runs.message, runs.solved, runs.iterations, runs.cpu_s,
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
STATEMENTS = SCHEMA.split(";\n")


def _statement(start: str) -> str:
    return next(one for one in STATEMENTS if one.strip().startswith(start))


# what a store of each version lacks against the next one
ADDED = {
    1: (
        "ALTER TABLE runs ADD COLUMN merit TEXT NOT NULL DEFAULT 'natural'",
        _statement("CREATE TABLE certificates"),
    ),
    2: (
        *(
            f"ALTER TABLE runs ADD COLUMN {column}"
            for column in ("said_cpu_s REAL", "measured TEXT", "warm INTEGER", "pinned INTEGER")
        ),
        _statement("CREATE TABLE faults"),
        "INSERT INTO faults (key, campaign, problem, solver, tol, status, message, started)"
        " SELECT key, campaign, problem, solver, tol, status, message, started FROM runs"
        " WHERE status IN ('killed', 'unreadable')",
        "DELETE FROM runs WHERE status IN ('killed', 'unreadable')",
    ),
    3: (
        "ALTER TABLE runs ADD COLUMN start TEXT NOT NULL DEFAULT 'cold'",
        *(
            f"ALTER TABLE runs ADD COLUMN {column}"
            for column in ("sequence TEXT", "step INTEGER", "guess INTEGER", "after TEXT")
        ),
        _statement("CREATE TABLE solutions"),
        "DROP VIEW IF EXISTS results",
        _statement("CREATE VIEW results"),
    ),
}
PROBLEM = tuple(field.name for field in dataclasses.fields(ProblemFacts))
SOLVER = ("hash", "label", "name", "options", "version", "family", "origin")
MACHINE = ("hash", "node", "cpu", "cores", "memory_gb", "facts")
RUN = (
    *("key", "campaign", "problem", "solver", "machine"),
    *("tol", "merit", "time_limit", "wall_limit", "memory_limit", "threads", "repeat"),
    *("status", "message", "solved", "iterations"),
    *("cpu_s", "said_cpu_s", "setup_s", "total_cpu_s", "wall_s", "memory_mb"),
    *(*MERITS, "stages", "measured", "warm", "pinned", "load", "frequency_mhz", "started"),
    *("start", "sequence", "step", "guess", "after"),
)
OF_A_RUN = ("history", "certificates", "solutions")  # tables with more of a run
FAULT = ("key", "campaign", "problem", "solver", "tol", "status", "message", "started")


def text_of(text: str) -> str:
    """What SQLite takes for a text: without lone surrogates and null characters."""
    return text.encode(errors="replace").decode().replace("\0", "?")


class StoreError(_core.Error, ValueError):
    """A file is no store, or one of another version."""


class DamagedError(StoreError):
    """A store was damaged."""


def _one_line(word: str) -> str:
    return " ".join(word.split())


def _rows(source: sqlite3.Connection, table: str) -> Iterator[tuple[Any, ...]]:
    """The rows of a table, over what of it cannot be read."""
    last, step = -1, 1
    while step < 1 << 40:
        query = f"SELECT rowid, * FROM {table} WHERE rowid > ? ORDER BY rowid"
        try:
            for number, *row in source.execute(query, (last,)):
                last, step = number, 1
                yield tuple(row)
            return
        except sqlite3.DatabaseError:
            last, step = last + step, 2 * step


@dataclass(frozen=True)
class Status:
    """How far a campaign is."""

    name: str
    planned: int
    done: int
    solved: int
    statuses: dict[str, int]
    started: float  # [s] since 1970
    seen: float  # when it last said that it is alive
    ended: float | None
    node: str
    pid: int
    done_before: int  # of the runs planned, those that were there at the start

    @property
    def rate(self) -> float:
        """Runs a second, since it was started."""
        return (self.done - self.done_before) / max(1e-9, (self.ended or self.seen) - self.started)


class Store:
    """An open store; ``with Store(path) as store``."""

    def __init__(self, path: str | Path, create: bool = True) -> None:
        """Open a store, or make it.

        Raises:
            StoreError: the file is no store, or there is none and none is to be made.
        """
        self.path = Path(path)
        if not create and not self.path.exists():
            raise StoreError(f"{self.path}: there is no such store")
        if self.path.is_dir():
            raise StoreError(f"{self.path}: is a folder, and no store")
        if not self.path.parent.is_dir():
            raise StoreError(f"{self.path}: there is no folder {self.path.parent}")
        self._ids: dict[tuple[str, str], int] = {}
        self.read_only = self.path.exists() and not (
            os.access(self.path, os.W_OK) and os.access(self.path.parent, os.W_OK)
        )
        if not create and not self.path.stat().st_size:
            raise StoreError(f"{self.path}: is empty, and no store")
        try:
            self.db = sqlite3.connect(
                # WAL wants to write beside the file, even to read it
                f"{self.path.resolve().as_uri()}?mode=ro&immutable=1"
                if self.read_only
                else self.path,
                timeout=PATIENCE,
                isolation_level=None,
                uri=self.read_only,
            )
            self._prepare()
        except sqlite3.OperationalError as error:
            raise StoreError(f"{self.path}: {error}") from None
        except sqlite3.DatabaseError as error:
            raise self._damaged(str(error)) from None

    def _prepare(self) -> None:
        db = self.db
        version = db.execute("PRAGMA user_version").fetchone()[0]
        empty = not db.execute("SELECT 1 FROM sqlite_master LIMIT 1").fetchone()
        if not empty and version not in (*ADDED, VERSION):
            db.close()
            if version == 0:
                raise StoreError(f"{self.path}: is a database, but no store of fclib bench")
            raise StoreError(
                f"{self.path}: is of version {version}, this fclib knows {VERSION}; "
                "read it with the fclib that made it"
            )
        if not empty:
            (word,) = db.execute("PRAGMA quick_check(1)").fetchone()
            if word != "ok":
                raise self._damaged(word)
        if self.read_only:
            self._prepare_copy(empty, version)
            return
        db.execute("PRAGMA journal_mode = WAL")
        db.execute("PRAGMA synchronous = NORMAL")
        if empty:
            with self.transaction():
                # another may have made it meanwhile
                if not db.execute("SELECT 1 FROM sqlite_master LIMIT 1").fetchone():
                    for statement in STATEMENTS:
                        db.execute(statement)
                    db.execute(f"PRAGMA application_id = {APPLICATION}")
                    db.execute(f"PRAGMA user_version = {VERSION}")
        elif version < VERSION:
            self._upgrade()

    def _prepare_copy(self, empty: bool, version: int) -> None:
        """Of a file that cannot be written an older one is brought up to date in memory."""
        if empty:
            raise StoreError(f"{self.path}: is empty, and cannot be written")
        if version < VERSION:
            copy = sqlite3.connect(":memory:", isolation_level=None)
            self.db.backup(copy)
            self.db.close()
            self.db = copy
            self._upgrade()

    def _upgrade(self) -> None:
        with self.transaction():
            # another may have brought it up to date meanwhile
            version = self.db.execute("PRAGMA user_version").fetchone()[0]
            for known in range(version, VERSION):
                for statement in ADDED[known]:
                    self.db.execute(statement)
            self.db.execute(f"PRAGMA user_version = {VERSION}")

    def _damaged(self, word: str) -> DamagedError:
        try:
            with Store.recover(self.path) as saved:
                runs = len(saved.keys())
            what = f"{runs} of its runs can be read: fclib bench merge NEW.sqlite {self.path}"
        except (StoreError, sqlite3.DatabaseError):
            what = "nothing of it can be read"
        return DamagedError(f"{self.path}: is damaged, or no store: {_one_line(word)}; {what}")

    @classmethod
    def recover(cls, path: str | Path) -> Store:
        """What can be read of a damaged store, in memory.

        Raises:
            StoreError: nothing can.
        """
        made = cls.__new__(cls)
        made.path, made.read_only, made._ids = Path(path), True, {}
        made.db = sqlite3.connect(":memory:", isolation_level=None)
        source = sqlite3.connect(f"{made.path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)
        try:
            version = source.execute("PRAGMA user_version").fetchone()[0]
            parts = source.execute("SELECT type, name, sql FROM sqlite_master").fetchall()
            if version not in (*ADDED, VERSION):
                raise StoreError(f"{path}: is no store that this fclib knows")
            tables = [(name, sql) for kind, name, sql in parts if kind == "table" and sql]
            for name, sql in tables:
                made.db.execute(sql)
                for row in _rows(source, name):
                    marks = ", ".join("?" * len(row))
                    made.db.execute(f"INSERT OR IGNORE INTO {name} VALUES ({marks})", row)
            made.db.execute(next(sql for kind, _, sql in parts if kind == "view"))
            made.db.execute(f"PRAGMA user_version = {version}")
            if version < VERSION:
                made._upgrade()
        except (sqlite3.DatabaseError, StopIteration) as error:
            made.close()
            raise StoreError(f"{path}: {_one_line(str(error))}") from None
        finally:
            source.close()
        return made

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self.db.close()

    def discard(self) -> None:
        """Close the file, and remove it where no campaign was ever begun in it."""
        begun = self.db.execute("SELECT 1 FROM campaigns LIMIT 1").fetchone()
        self.close()
        if not begun:
            self.path.unlink(missing_ok=True)

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """All or nothing of what is done in it."""
        self.db.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self.db.execute("ROLLBACK")
            self._ids.clear()
            raise
        self.db.execute("COMMIT")

    def _id(self, table: str, names: Sequence[str], values: Sequence[Any]) -> int:
        """The number of a row of a table whose first column is its hash; it is made if needed."""
        key = table, values[0]
        if key not in self._ids:
            marks = ", ".join("?" * len(names))
            self.db.execute(
                f"INSERT INTO {table} ({', '.join(names)}) VALUES ({marks}) ON CONFLICT DO NOTHING",
                values,
            )
            query = f"SELECT id FROM {table} WHERE hash = ?"
            self._ids[key] = int(self.db.execute(query, (values[0],)).fetchone()[0])
        return self._ids[key]

    def begin(self, name: str, text: str, planned: int, skipped: int, node: str) -> int:
        """Note that a campaign starts; `skipped` of its `planned` runs are there. Its number."""
        now = time.time()
        cursor = self.db.execute(
            "INSERT INTO campaigns (name, text, planned, skipped, pid, node, started, seen)"
            " VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
            (name, text, planned, skipped, os.getpid(), node, now, now),
        )
        assert cursor.lastrowid is not None
        return cursor.lastrowid

    def alive(self, campaign: int, ended: bool = False) -> None:
        """Note that a campaign is at work, or has ended."""
        now = time.time()
        self.db.execute(
            "UPDATE campaigns SET seen = ?, ended = ? WHERE id = ?",
            (now, now if ended else None, campaign),
        )

    def keys(self) -> set[str]:
        """The keys of all runs."""
        return {key for (key,) in self.db.execute("SELECT key FROM runs")}

    def spent(self, keys: Sequence[str]) -> float:
        """[s] that the runs of some keys have taken, of CPU, or of waiting where that ended it."""
        cost = "CASE status WHEN 'wall_limit' THEN wall_s ELSE total_cpu_s END"
        query = f"SELECT key, COALESCE({cost}, 0) FROM runs"
        wanted = set(keys)
        return float(sum(cost for key, cost in self.db.execute(query) if key in wanted))

    def forget(self, keys: Sequence[str], statuses: Sequence[str]) -> int:
        """Remove the runs of some keys that ended in one of the statuses; how many.

        With a run of a sequence go those of the steps after it, which follow from it.
        """
        marks = ", ".join("?" * len(statuses))
        query = f"SELECT id, key FROM runs WHERE status IN ({marks})"
        wanted = set(keys)
        found = [row for row in self.db.execute(query, list(statuses)) if row[1] in wanted]
        runs: dict[int, None] = {}
        with self.transaction():
            later = list(self.db.execute("SELECT id, key, after FROM runs WHERE after != ''"))
            while found:
                runs |= dict.fromkeys(run for run, _ in found)
                gone = {key for _, key in found}
                found = [(run, key) for run, key, after in later if after in gone]
            rows = [(run,) for run in runs]
            for table in OF_A_RUN:
                self.db.executemany(f"DELETE FROM {table} WHERE run = ?", rows)
            self.db.executemany("DELETE FROM runs WHERE id = ?", rows)
        return len(runs)

    def has(self, key: str) -> bool:
        """Whether there is a run of a key."""
        return self.db.execute("SELECT 1 FROM runs WHERE key = ?", (key,)).fetchone() is not None

    def _of(self, job: Job) -> tuple[int, int]:
        """The numbers of the problem and of the solver of a job."""
        choice = job.solver
        options = json.dumps(dict(choice.options), sort_keys=True)
        values = (choice.title, choice.name, options, choice.version)
        return (
            self._id("problems", PROBLEM, [getattr(job.problem, name) for name in PROBLEM]),
            self._id(
                "solvers",
                SOLVER,
                ["\n".join(values), *values, choice.family, choice.origin],
            ),
        )

    def fault(self, job: Job, record: Record, campaign: int | None = None) -> None:
        """Note what has kept a run from being done, as often as it was tried."""
        with self.transaction():
            self.db.execute(
                f"INSERT INTO faults ({', '.join(FAULT)}) VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                (
                    job.key,
                    campaign,
                    *self._of(job),
                    job.tol,
                    record.status,
                    text_of(record.message),
                    record.started,
                ),
            )

    def faults(self) -> list[dict[str, Any]]:
        """What was not run, for a cause from outside, and has not been run since."""
        query = (
            "SELECT solvers.label AS solver, problems.name AS problem, problems.family,"
            " problems.hash, campaigns.name AS campaign, faults.tol, faults.status, faults.message,"
            " MAX(faults.started) AS started FROM faults"
            " JOIN problems ON problems.id = faults.problem"
            " JOIN solvers ON solvers.id = faults.solver"
            " LEFT JOIN campaigns ON campaigns.id = faults.campaign"
            " WHERE faults.key NOT IN (SELECT key FROM runs) GROUP BY faults.key"
        )
        cursor = self.db.execute(query)
        names = [column[0] for column in cursor.description]
        return [dict(zip(names, row, strict=True)) for row in cursor]

    def add(self, job: Job, record: Record, campaign: int | None = None) -> bool:
        """Store a run; False where there is one of its key."""
        merits = record.merits or {}
        with self.transaction():
            problem, solver = self._of(job)
            facts = dict(record.machine or {})
            text = json.dumps(facts, sort_keys=True)
            machine = self._id(
                "machines", MACHINE, [text, *(facts.get(name) for name in MACHINE[1:-1]), text]
            )
            values = [
                job.key,
                campaign,
                problem,
                solver,
                machine,
                job.tol,
                job.merit,
                job.limits.time,
                job.limits.wall,
                job.limits.memory,
                job.threads,
                job.repeat,
                record.status,
                text_of(record.message),
                int(record.solved),
                record.iterations,
                record.cpu_s,
                record.said_cpu_s,
                record.setup_s,
                record.total_cpu_s,
                record.wall_s,
                record.memory,
                *(merits.get(name) for name in MERITS),
                record.stages,
                record.measured,
                int(record.warm),
                int(record.pinned),
                record.load,
                record.frequency,
                record.started,
                job.start,
                *((job.along.sequence, job.along.step) if job.along else (None, None)),
                job.guess.step if job.guess and record.guessed else None,
                job.along.after if job.along else None,
            ]
            marks = ", ".join("?" * len(RUN))
            cursor = self.db.execute(
                f"INSERT INTO runs ({', '.join(RUN)}) SELECT {marks}"
                " WHERE NOT EXISTS (SELECT 1 FROM runs WHERE key = ?)",
                [*values, job.key],
            )
            if cursor.rowcount == 0:
                return False
            run = cursor.lastrowid
            if record.certificate:
                self.db.execute("INSERT INTO certificates VALUES (?, ?)", (run, record.certificate))
            if record.solution:
                vectors = [record.solution.get(name) for name in KEPT]
                self.db.execute("INSERT INTO solutions VALUES (?, ?, ?, ?)", (run, *vectors))
            if record.history:
                self.db.executemany(
                    "INSERT INTO history VALUES (?, ?, ?, ?, ?)",
                    [(run, *report) for report in record.history],
                )
        return True

    # ---- what is known of files, so that a campaign need not read them again

    def known(self, path: Path) -> ProblemFacts | None:
        """The problem of a file that has not changed since it was noted."""
        info = path.stat()
        row = self.db.execute(
            f"SELECT {', '.join('problems.' + name for name in PROBLEM)} FROM files"
            " JOIN problems ON problems.id = files.problem"
            " WHERE files.path = ? AND size = ? AND modified = ?",
            (str(path), info.st_size, info.st_mtime_ns),
        ).fetchone()
        if row is None:
            return None
        return ProblemFacts(**dict(zip(PROBLEM, row, strict=True)) | {"path": str(path)})

    def note(self, path: Path, facts: ProblemFacts) -> None:
        """Note what a file holds."""
        info = path.stat()
        with self.transaction():
            problem = self._id("problems", PROBLEM, [getattr(facts, name) for name in PROBLEM])
            self.db.execute(
                "INSERT OR REPLACE INTO files VALUES (?, ?, ?, ?)",
                (str(path), info.st_size, info.st_mtime_ns, problem),
            )

    # ---- what others read

    def columns(self) -> list[str]:
        """The columns of `results`."""
        return [row[1] for row in self.db.execute("PRAGMA table_info(results)")]

    def results(self, where: str = "", values: Sequence[Any] = ()) -> list[dict[str, Any]]:
        """All runs, a row each, in the order in which they were stored.

        Args:
            where: a condition of SQL on the columns of `results`, with a ? for each of the values.
            values: in their order.
        """
        condition = f" WHERE {where}" if where else ""
        cursor = self.db.execute(f"SELECT * FROM results{condition} ORDER BY run", values)
        names = [column[0] for column in cursor.description]
        return [dict(zip(names, row, strict=True)) for row in cursor]

    def table(self, more: Sequence[str] = ()) -> Table:
        """All runs in columns."""
        rows = self.results()
        if "path" in more:
            paths = dict(self.db.execute("SELECT hash, path FROM problems"))
            rows = [row | {"path": paths[row["hash"]]} for row in rows]
        return Table.of(rows)

    def history(self, run: int) -> list[tuple[int, float, float, str]]:
        """The reports of a run: iteration, error, time [s], stage."""
        query = "SELECT iteration, error, time, stage FROM history WHERE run = ? ORDER BY rowid"
        return list(self.db.execute(query, (run,)))

    def certificate(self, run: int) -> str | None:
        """The proof that a run gave that there is no solution, in JSON."""
        query = "SELECT certificate FROM certificates WHERE run = ?"
        row = self.db.execute(query, (run,)).fetchone()
        return None if row is None else str(row[0])

    def solution(self, run: int) -> dict[str, npt.NDArray[np.float64]]:
        """The vectors u, r and l that a run of a sequence found; empty where it solved nothing."""
        row = self.db.execute("SELECT u, r, l FROM solutions WHERE run = ?", (run,)).fetchone()
        pairs = zip(KEPT, row or (), strict=bool(row))
        return {name: np.frombuffer(value) for name, value in pairs if value is not None}

    def solution_of(self, key: str) -> tuple[bytes, bytes | None] | None:
        """The reactions and multipliers that the run of a key found; None where it found none."""
        query = (
            "SELECT r, l FROM solutions JOIN runs ON runs.id = solutions.run"
            " WHERE runs.key = ? ORDER BY runs.id LIMIT 1"
        )
        found: tuple[bytes, bytes | None] | None = self.db.execute(query, (key,)).fetchone()
        return found

    def texts(self) -> list[str]:
        """The campaigns that have written here, as their files have them."""
        query = "SELECT DISTINCT text FROM campaigns WHERE text IS NOT NULL"
        return [text for (text,) in self.db.execute(query)]

    def status(self) -> list[Status]:
        """The campaigns that have written here, the last one first."""
        found = []
        rows = self.db.execute(
            "SELECT id, name, planned, skipped, started, seen, ended, node, pid FROM campaigns"
            " ORDER BY id DESC"
        ).fetchall()
        for number, name, planned, skipped, started, seen, ended, node, pid in rows:
            counts = dict(
                self.db.execute(
                    "SELECT status, COUNT(*) FROM runs WHERE campaign = ? GROUP BY status",
                    (number,),
                )
            )
            done = sum(counts.values())
            found.append(
                Status(
                    name=name,
                    planned=planned,
                    done=skipped + done,
                    solved=sum(counts.get(name, 0) for name in SOLVED),
                    statuses=counts,
                    started=started,
                    seen=seen,
                    ended=ended,
                    node=node,
                    pid=pid,
                    done_before=skipped,
                )
            )
        return found

    def merge(self, others: Iterable[str | Path]) -> int:
        """Take over the runs of other stores, those of other machines beside the own ones.

        A run of the same key from the same machine is taken once.

        Returns:
            How many were new.

        Raises:
            StoreError: one of them is no store.
        """
        added = 0
        for path in others:
            if Path(path).resolve() == self.path.resolve():
                raise StoreError(f"{path}: is the store that the others are to be merged into")
            try:
                other = Store(path, create=False)
            except DamagedError:
                other = Store.recover(path)
            with other, self.transaction():
                added += self._take(other)
        return added

    def _take(self, other: Store) -> int:
        numbers: dict[str, dict[int, int]] = {}
        for table, names in (("problems", PROBLEM), ("solvers", SOLVER), ("machines", MACHINE)):
            rows = other.db.execute(f"SELECT id, {', '.join(names)} FROM {table}")
            numbers[table] = {row[0]: self._id(table, names, row[1:]) for row in rows}
        campaigns: dict[int | None, int | None] = {None: None}
        columns = "name, text, planned, skipped, pid, node, started, seen, ended"
        for number, *row in other.db.execute(f"SELECT id, {columns} FROM campaigns"):
            same = "SELECT id FROM campaigns WHERE name IS ? AND node IS ? AND started IS ?"
            found = self.db.execute(same, (row[0], row[5], row[6])).fetchone()
            campaigns[number] = (
                found[0]
                if found
                else self.db.execute(
                    f"INSERT INTO campaigns ({columns}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", row
                ).lastrowid
            )

        def refer(row: dict[str, Any], columns: Sequence[str]) -> bool:
            row["campaign"] = campaigns.get(row["campaign"])
            for column in columns:
                row[column] = numbers[f"{column}s"].get(row[column])
            return all(row[column] is not None for column in columns)

        for values in other.db.execute(f"SELECT {', '.join(FAULT)} FROM faults"):
            fault = dict(zip(FAULT, values, strict=True))
            same = "SELECT 1 FROM faults WHERE key = ? AND started IS ?"
            known = self.db.execute(same, (fault["key"], fault["started"])).fetchone()
            if not known and refer(fault, ("problem", "solver")):
                self.db.execute(
                    f"INSERT INTO faults ({', '.join(FAULT)}) VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                    list(fault.values()),
                )
        added = 0
        marks = ", ".join("?" * len(RUN))
        for number, *values in other.db.execute(f"SELECT id, {', '.join(RUN)} FROM runs"):
            run = dict(zip(RUN, values, strict=True))
            if not refer(run, ("problem", "solver", "machine")):
                continue  # of a damaged one
            cursor = self.db.execute(
                f"INSERT INTO runs ({', '.join(RUN)}) VALUES ({marks}) ON CONFLICT DO NOTHING",
                list(run.values()),
            )
            if cursor.rowcount:
                added += 1
                new = cursor.lastrowid
                if certificate := other.certificate(number):
                    self.db.execute("INSERT INTO certificates VALUES (?, ?)", (new, certificate))
                query = "SELECT u, r, l FROM solutions WHERE run = ?"
                if vectors := other.db.execute(query, (number,)).fetchone():
                    self.db.execute("INSERT INTO solutions VALUES (?, ?, ?, ?)", (new, *vectors))
                self.db.executemany(
                    "INSERT INTO history VALUES (?, ?, ?, ?, ?)",
                    [(new, *report) for report in other.history(number)],
                )
        return added

    def export(self, path: str | Path) -> int:
        """Write `results` as .csv or .parquet, whole or not at all; the number of rows.

        Raises:
            StoreError: the name ends otherwise.
            ImportError: Parquet needs pyarrow.
        """
        path = Path(path)
        rows, columns = self.results(), self.columns()
        part = path.with_name(f".{path.name}.part")
        try:
            if path.suffix == ".csv":
                with part.open("w", newline="") as file:
                    writer = csv.DictWriter(file, columns)
                    writer.writeheader()
                    writer.writerows(rows)
            elif path.suffix == ".parquet":
                import pyarrow as pa
                import pyarrow.parquet as pq

                table = pa.table({name: [row[name] for row in rows] for name in columns})
                pq.write_table(table, part)
            else:
                raise StoreError(f"{path}: a store is exported to .csv or .parquet")
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        return len(rows)
