"""The store of a campaign: one SQLite file, one row a run.

The table `runs` refers by number to problems, solvers, machines and campaigns. `history` has the
reports of runs, if they were asked for. `faults` has the causes that kept runs from being done,
which are no solver's. The view `results` has all facts of a run in one row. docs/bench.md, which
describes `layout.SCHEMA`, has the columns and their units.

The key of a run (`fclib.bench.job.Job.key`) identifies it. `Store.add` inserts a run in one
statement, unless there is one of that key. So a run is stored once, whatever is interrupted and
however many campaigns write. The file is in WAL mode, which needs a local file system.

Each row has a checksum (`layout.py`). All readers of a store leave a damaged row out, and also the
runs that refer to it; a `DamageWarning` names the row. Names in a store are text: no name is looked
up anywhere, or run.
"""

from __future__ import annotations

import json
import os
import sqlite3
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fclib import _core, _sequence
from fclib._files import replace_file, write_csv
from fclib._solve import MERITS
from fclib._verdicts import SOLVED
from fclib.bench import layout
from fclib.bench.job import KEPT, Job, ProblemFacts, Record
from fclib.bench.layout import (
    CAMPAIGN,
    FAULT,
    HISTORY,
    MACHINE,
    NOTHING,
    OF_A_RUN,
    PROBLEM,
    RELEASED,
    RUN,
    SOLVER,
    STATEMENTS,
    VERSION,
    layouts,
)
from fclib.bench.table import TEXTS, Column, Table, Words, numbers_of, object_in

PATIENCE = 60.0  # [s] to wait for another writer
BATCH = 20_000  # rows read at once: some 20 MB
NAMED = 5  # a warning names at most so many damaged rows of a table one by one
# columns whose texts differ from run to run, and a problem's path, which differs by machine
LONG = ("key", "message", "stages")
MORE = (*LONG, "path")
# tables that a run refers to: for each column of `results`, the column in that table
REFERRED: dict[str, dict[str, str]] = {
    "problem": {"problem": "name"}
    | {name: name for name in ("family", "formulation", "spacedim", "n", "p", "nc", "nnz")}
    | {"title": "title", "hash": "hash", "path": "path"},
    "solver": {"solver": "label", "solver_name": "name", "options": "options"}
    | {"version": "version", "solver_family": "family", "origin": "origin", "about": "about"},
    "machine": {"node": "node", "cpu": "cpu", "cores": "cores", "machine": "hash"},
    "campaign": {"campaign": "name"},
}
MENDING = "fclib bench merge NEW.sqlite saves what can be read"
NUMBER = {"run": "id"}  # columns of `results` that have another name in `runs`


def text_of(text: str) -> str:
    """The text that SQLite accepts: without lone surrogates and null characters."""
    return text.encode(errors="replace").decode().replace("\0", "?")


class StoreError(_core.Error, ValueError):
    """A file is not a store, or is one of another version."""


class DamagedError(StoreError):
    """A store was damaged."""


class DamageWarning(UserWarning):
    """Rows of a store were damaged; they are left out."""


def _one_line(word: str) -> str:
    return " ".join(word.split())


def explained(path: Path, error: Exception) -> StoreError:
    """The meaning of an error of SQLite for a store, and what to do."""
    word = _one_line(str(error))
    if "readonly" in word:
        todo = "cannot be written: copy it into a folder of your own"
    elif "locked" in word or "busy" in word:
        todo = f"another program has kept it for {PATIENCE:.0f} s: try again when that has ended"
    elif "full" in word or "disk I/O" in word:
        todo = (
            "cannot be written further: the disk is full, or a limit on sizes of files is reached."
            " What was stored before stays; free some space, and give the same command again"
        )
    elif "unable to open" in word:
        todo = "cannot be opened: are there rights to its folder, and space in it?"
    else:
        return DamagedError(f"{path}: is damaged, or no store: {word}")
    return StoreError(f"{path}: {todo} (SQLite: {word})")


class _Cursor(sqlite3.Cursor):
    """A cursor that raises the errors of stores."""

    def execute(self, *arguments: Any) -> Any:
        return self._explained(super().execute, *arguments)

    def executemany(self, *arguments: Any) -> Any:
        return self._explained(super().executemany, *arguments)

    def fetchone(self) -> Any:
        return self._explained(super().fetchone)

    def fetchmany(self, size: int = 1) -> Any:  # type: ignore[override]
        return self._explained(super().fetchmany, size)

    def fetchall(self) -> Any:
        return self._explained(super().fetchall)

    def __next__(self) -> Any:
        return self._explained(super().__next__)

    def _explained(self, call: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return call(*arguments)
        # SQLite's own message may quote bytes that are not text
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
            path = getattr(self.connection, "path", None)
            if path is None or isinstance(error, sqlite3.ProgrammingError):
                raise
            raise explained(path, error) from None


class _Connection(sqlite3.Connection):
    """A connection that raises the errors of stores, once it has a path."""

    path: Path

    def cursor(self, factory: Any = _Cursor) -> Any:
        return super().cursor(factory)

    def execute(self, *arguments: Any) -> Any:
        return self.cursor().execute(*arguments)

    def executemany(self, *arguments: Any) -> Any:
        return self.cursor().executemany(*arguments)


def _rows_of(places: Sequence[int]) -> str:
    """Rows by their numbers, in words."""
    words = ", ".join(map(str, places[:NAMED]))
    more = f" and {len(places) - NAMED} more" if len(places) > NAMED else ""
    return f"row{'s' if len(places) > 1 else ''} {words}{more}"


def _rows(source: sqlite3.Connection, table: str) -> Iterator[tuple[Any, ...]]:
    """The rows of a table, without those that cannot be read."""
    last, step = -1, 1
    while step < 1 << 40:
        query = f"SELECT rowid, * FROM {table} WHERE rowid > ? ORDER BY rowid"
        try:
            for number, *row in source.execute(query, (last,)):
                last, step = number, 1
                yield tuple(row)
            return
        except (sqlite3.DatabaseError, UnicodeDecodeError):
            last, step = last + step, 2 * step


@dataclass(frozen=True)
class Status:
    """The progress of a campaign."""

    name: str
    planned: int
    done: int
    solved: int
    statuses: dict[str, int]
    started: float  # [s] since 1970
    seen: float  # time of its last sign of life
    ended: float | None
    node: str
    pid: int
    done_before: int  # planned runs that were there at the start

    @property
    def rate(self) -> float:
        """Runs per second since its start."""
        return (self.done - self.done_before) / max(1e-9, (self.ended or self.seen) - self.started)


class Store:
    """An open store; use it as ``with Store(path) as store``."""

    def __init__(self, path: str | Path, create: bool = True) -> None:
        """Open a store, or make it.

        Raises:
            StoreError: the file is not a store, or there is no file and none may be made.
        """
        self.path = Path(path)
        if not create and not self.path.exists():
            raise StoreError(f"{self.path}: there is no such store")
        if self.path.is_dir():
            raise StoreError(f"{self.path}: is a folder, and no store")
        if self.path.exists() and not self.path.is_file():
            raise StoreError(f"{self.path}: is no regular file, and no store")
        if not self.path.parent.is_dir():
            raise StoreError(f"{self.path}: there is no folder {self.path.parent}")
        self._ids: dict[str, dict[str, int]] = {}
        self.read_only = self.path.exists() and not (
            os.access(self.path, os.W_OK) and os.access(self.path.parent, os.W_OK)
        )
        self._made = not self.path.exists()
        size = 0 if self._made else self.path.stat().st_size
        if not create and not size:
            raise StoreError(f"{self.path}: is empty, and no store")
        if size == 1:  # SQLite takes it for an empty file, and writes over it
            raise StoreError(f"{self.path}: is no database, and no store")
        try:
            self.db = sqlite3.connect(
                # WAL mode writes beside the file, even to read it
                f"{self.path.resolve().as_uri()}?mode=ro&immutable=1"
                if self.read_only
                else self.path,
                timeout=PATIENCE,
                isolation_level=None,
                uri=self.read_only,
                factory=_Connection,
            )
            self.db.path = self.path
        except sqlite3.OperationalError as error:
            raise explained(self.path, error) from None
        try:
            self._prepare(create)
        except DamagedError as error:
            self.db.close()
            raise DamagedError(f"{error}; {self._saved()}") from None
        except BaseException:
            self.db.close()
            raise

    def _prepare(self, create: bool) -> None:
        db = self.db
        db.execute("PRAGMA trusted_schema = OFF")
        self._refuse_foreign()
        version = db.execute("PRAGMA user_version").fetchone()[0]
        empty = not db.execute("SELECT 1 FROM sqlite_master LIMIT 1").fetchone()
        if not empty and version not in (RELEASED, VERSION):
            if version == 0:
                raise StoreError(f"{self.path}: is a database, but no store of fclib bench")
            raise StoreError(
                f"{self.path}: is of version {version}, this fclib knows {VERSION}; "
                "read it with the fclib that made it"
            )
        if not empty:
            (word,) = db.execute("PRAGMA quick_check(1)").fetchone()
            if word != "ok":
                raise DamagedError(f"{self.path}: is damaged: {_one_line(word)}")
        if empty and not create:
            raise StoreError(f"{self.path}: is a database without tables, and no store")
        if self.read_only:
            if empty:
                raise StoreError(f"{self.path}: is empty, and cannot be written")
            if version == RELEASED:
                # an older version is brought up to date in memory
                copy = sqlite3.connect(":memory:", isolation_level=None, factory=_Connection)
                copy.path = self.path
                db.backup(copy)
                db.close()
                self.db = copy
                self._upgrade()
            self._check_tables()
            return
        db.execute("PRAGMA journal_mode = WAL")
        db.execute("PRAGMA synchronous = NORMAL")
        if empty:
            with self.transaction():
                # another process may have made it meanwhile
                if not db.execute("SELECT 1 FROM sqlite_master LIMIT 1").fetchone():
                    for statement in STATEMENTS:
                        db.execute(statement)
                    db.execute(f"PRAGMA application_id = {layout.APPLICATION}")
                    db.execute(f"PRAGMA user_version = {VERSION}")
        elif version == RELEASED:
            self._upgrade()
        self._check_tables()

    def _refuse_foreign(self) -> None:
        """StoreError if the file has what runs when it is used: triggers, and other views."""
        for kind, name in self.db.execute("SELECT type, name FROM sqlite_master"):
            ours = kind in ("table", "index") or (kind, name) == ("view", "results")
            if not ours:
                raise StoreError(
                    f"{self.path}: has the {kind} {_one_line(str(name))!r}, which no store has: "
                    "somebody put it there. Do not use the file, and tell whom it is from"
                )

    def _check_tables(self) -> None:
        """DamagedError if the file's tables are not those of this version."""
        for table, own in layouts().items():
            if layout.declared_in(self.db, table) != own.declared:
                raise DamagedError(f"{self.path}: is damaged: the columns of {table} are others")

    def _upgrade(self) -> None:
        with self.transaction():
            # another process may have brought it up to date meanwhile
            if self.db.execute("PRAGMA user_version").fetchone()[0] == VERSION:
                return
            for table, own in layouts().items():
                there = {name for name, _ in layout.declared_in(self.db, table)}
                if not there or "checksum" in there:
                    raise DamagedError(f"{self.path}: is damaged: it has no version")
                for name, kind in own.declared:
                    if name not in there:
                        self.db.execute(f"ALTER TABLE {table} ADD COLUMN {name} {kind}")
            self.db.execute("DROP VIEW IF EXISTS results")
            self.db.execute(layout.VIEW)
            self.seal()
            self.db.execute(f"PRAGMA user_version = {VERSION}")

    def _saved(self) -> str:
        """The advice for a damaged store."""
        try:
            with warnings.catch_warnings(), Store.recover(self.path) as saved:
                warnings.simplefilter("ignore", DamageWarning)
                runs = len(saved.table())
        except StoreError:
            return "nothing of it can be read"
        return f"{runs} of its runs can be read: fclib bench merge NEW.sqlite {self.path}"

    @classmethod
    def recover(cls, path: str | Path) -> Store:
        """The readable part of a damaged store, in memory.

        Raises:
            StoreError: nothing can be read.
        """
        made = cls.__new__(cls)
        made.path, made.read_only, made._made, made._ids = Path(path), True, False, {}
        made.db = sqlite3.connect(":memory:", isolation_level=None, factory=_Connection)
        source = sqlite3.connect(f"{made.path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)
        # a damaged text is read as bytes, and then has another checksum
        source.text_factory = lambda data: data.decode(errors="replace")
        try:
            names = "SELECT name FROM sqlite_master WHERE type = 'table'"
            there = {name for (name,) in source.execute(names)}
            # our own schema: that of the file may be damaged too
            for statement in STATEMENTS:
                made.db.execute(statement)
            made.db.execute(f"PRAGMA user_version = {VERSION}")
            for table, own in layouts().items():
                if table not in there:
                    continue
                columns = [name for name, _ in layout.declared_in(source, table)]
                # tables of the released version, which had no checksums
                bare = len(columns) < len(own.declared) and "checksum" not in columns
                names = ", ".join(
                    [name for name, _ in own.declared if name not in ("about", "copy", "checksum")]
                    if bare
                    else [name for name, _ in own.declared]
                )
                for row in _rows(source, table):
                    marks = ", ".join("?" * len(row))
                    query = f"INSERT OR IGNORE INTO {table} ({names}) VALUES ({marks})"
                    made.db.execute(query, row)
                if bare:
                    made._seal(table, "")
            if "runs" not in there:
                raise StoreError(f"{path}: is no store that this fclib knows")
        except (sqlite3.DatabaseError, StoreError, UnicodeDecodeError) as error:
            made.close()
            raise StoreError(f"{path}: {_one_line(str(error))}") from None
        finally:
            source.close()
        made.db.path = made.path
        return made

    # ---- rows and their checksums

    def _batches(
        self, table: str, condition: str = "", values: Sequence[Any] = ()
    ) -> Iterator[list[tuple[Any, ...]]]:
        """The rows of a table as they are in the file, in the columns of `Layout.query`."""
        cursor = self.db.cursor()
        rows: list[tuple[Any, ...]] = []
        first = True
        while first or rows:
            # read texts as bytes during this call, since a damaged text may not decode
            self.db.text_factory = bytes
            try:
                if first:
                    cursor.execute(layouts()[table].query(condition), values)
                    first = False
                rows = cursor.fetchmany(BATCH)
            finally:
                self.db.text_factory = str
            if rows:
                yield rows

    def _right(
        self, table: str, condition: str = "", values: Sequence[Any] = ()
    ) -> Iterator[tuple[list[tuple[Any, ...]], npt.NDArray[np.float64]]]:
        """The undamaged rows of a table, with their numbers.

        A warning names the others.
        """
        wrong: list[int] = []
        last = -(1 << 63)
        for rows in self._batches(table, condition, values):
            good, numbers = layout.right(layouts()[table], rows)
            places = np.array([row[0] for row in rows], dtype=np.int64)
            # in a damaged tree a row may appear twice
            good &= places > np.maximum.accumulate(np.concatenate([[last], places[:-1]]))
            last = max(last, int(places.max()))
            if not good.all():
                wrong += places[~good].tolist()
                rows = [row for row, fine in zip(rows, good, strict=True) if fine]
                numbers = numbers[good]
            yield rows, numbers
        if wrong:
            self._warn(f"{_rows_of(wrong)} of {table}", len(wrong), "damaged, and left out")

    def _warn(self, which: str, count: int, what: str) -> None:
        verb = "is" if count == 1 else "are"
        warnings.warn(f"{self.path}: {which} {verb} {what}", DamageWarning, stacklevel=4)

    def _read(
        self, table: str, condition: str = "", values: Sequence[Any] = ()
    ) -> Iterator[dict[str, Any]]:
        """The undamaged rows of a table as dicts, with `rowid`."""
        own = layouts()[table]
        whole = [kind == "INTEGER" for name in own.numbers for n, kind in own.declared if n == name]
        blobs = {name for name, kind in own.declared if kind == "BLOB"}
        for rows, _ in self._right(table, condition, values):
            for row in rows:
                found: dict[str, Any] = {"rowid": row[0]}
                for name, value, is_whole in zip(own.numbers, row[1:], whole, strict=False):
                    found[name] = value if value is None or not is_whole else int(value)
                for name, value in zip(own.texts, row[1 + len(whole) : -1], strict=True):
                    if value == NOTHING:
                        found[name] = None
                    else:
                        found[name] = value if name in blobs else value.decode(errors="replace")
                yield found

    def _seal(self, table: str, condition: str, *values: Any) -> None:
        """Write the checksums of rows."""
        own = layouts()[table]
        update = f"UPDATE {table} SET checksum = ? WHERE rowid = ?"
        for rows in self._batches(table, condition, values):
            found = layout.checksums(own, rows, layout.numbers_of(own, rows))
            self.db.executemany(update, [(c, row[0]) for c, row in zip(found, rows, strict=True)])

    def seal(self) -> None:
        """Write the checksums of all rows anew; needed after rows were written by hand."""
        for table in layouts():
            self._seal(table, "")

    def __enter__(self) -> Store:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None and self._made:  # what could not begin leaves no store
            self._discard()
        else:
            self.close()

    def close(self) -> None:
        """Close the file."""
        self.db.close()

    def _discard(self) -> None:
        """Close the file, and remove it if nothing was ever put into it."""
        query = "SELECT 1 FROM campaigns UNION ALL SELECT 1 FROM runs LIMIT 1"
        try:
            begun = bool(self.db.execute(query).fetchone())
        except StoreError:  # the first error says more
            begun = True
        self.close()
        if not begun:
            self.path.unlink(missing_ok=True)

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """A transaction: all that is done inside is stored, or nothing."""
        self.db.execute("BEGIN IMMEDIATE")
        try:
            yield
            self.db.execute("COMMIT")
        except BaseException:
            self._ids.clear()
            if self.db.in_transaction:  # otherwise a full disk has ended it
                self.db.execute("ROLLBACK")
            raise

    @contextmanager
    def snapshot(self) -> Iterator[None]:
        """What is read inside is of one moment, also if a campaign writes meanwhile."""
        if self.db.in_transaction:
            yield
            return
        self.db.execute("BEGIN")
        try:
            yield
        finally:
            self.db.rollback()  # nothing was written, and a fault may have ended it

    def _id(self, table: str, names: Sequence[str], values: Sequence[Any]) -> int:
        """The number of the row with a hash in its first column; it is made if needed."""
        if table not in self._ids:
            self._ids[table] = {row["hash"]: row["id"] for row in self._read(table)}
        known, digest = self._ids[table], values[0]
        if digest not in known:
            marks = ", ".join("?" * len(names))
            cursor = self.db.execute(
                f"INSERT INTO {table} ({', '.join(names)}) VALUES ({marks}) ON CONFLICT DO NOTHING",
                [text_of(value) if isinstance(value, str) else value for value in values],
            )
            if cursor.rowcount:
                known[digest] = cursor.lastrowid
                self._seal(table, "id = ?", known[digest])
            else:
                # another campaign has written it meanwhile
                known |= {row["hash"]: row["id"] for row in self._read(table)}
                if digest not in known:
                    raise DamagedError(f"{self.path}: is damaged: a row of {table}; {MENDING}")
        return known[digest]

    def begin(self, name: str, text: str, planned: int, skipped: int, node: str) -> int:
        """Note that a campaign starts with `skipped` runs stored. Return its number."""
        now = time.time()
        with self.transaction():
            cursor = self.db.execute(
                "INSERT INTO campaigns (name, text, planned, skipped, pid, node, started, seen)"
                " VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                (text_of(name), text_of(text), planned, skipped, os.getpid(), node, now, now),
            )
            number: int = cursor.lastrowid
            self._seal("campaigns", "id = ?", number)
        return number

    def alive(self, campaign: int, ended: bool = False, skipped: int | None = None) -> None:
        """Note that a campaign is at work, or has ended; `skipped` runs need not be done."""
        now = time.time()
        with self.transaction():
            self.db.execute(
                "UPDATE campaigns SET seen = ?, ended = ?, skipped = ifnull(?, skipped)"
                " WHERE id = ?",
                (now, now if ended else None, skipped, campaign),
            )
            self._seal("campaigns", "id = ?", campaign)

    def mend(self) -> int:
        """Remove damaged rows and all rows that refer to them. Return the number of runs removed.

        A warning names the rows. The campaign that goes on runs them again.
        """
        with self.snapshot():
            if not self._damaged():
                return 0
        with self.transaction(), warnings.catch_warnings():
            # once more, since a campaign may have stored runs meanwhile
            warnings.simplefilter("ignore", DamageWarning)
            gone = self._damaged()
            # indexes hold the values that rows had before the damage
            self.db.execute("REINDEX")
            for table, places in gone.items():
                rows = [(place,) for place in places]
                self.db.executemany(f"DELETE FROM {table} WHERE rowid = ?", rows)
        self._ids.clear()
        runs = gone.get("runs", [])
        if runs:
            what = "damaged, or of damaged rows, and removed: a campaign runs them again"
            self._warn(f"{_rows_of(runs)} of runs", len(runs), what)
        return len(runs)

    def _damaged(self) -> dict[str, list[int]]:
        """The damaged rows of each table, and those that refer to them."""
        gone: dict[str, list[int]] = {}
        kept: dict[str, set[int]] = {}
        for table, own in layouts().items():
            at = {name: own.numbers.index(by) for name, by in refers(own.numbers)}
            kept[table] = set()
            for rows, numbers in self._right(table):
                good = np.ones(len(rows), dtype=bool)
                for other, column in at.items():
                    good &= [x != x or x in kept[other] for x in numbers[:, column].tolist()]
                kept[table].update(row[0] for row, fine in zip(rows, good, strict=True) if fine)
            (count,) = self.db.execute(f"SELECT COUNT(*) FROM {table} NOT INDEXED").fetchone()
            if count != len(kept[table]):
                every = self.db.execute(f"SELECT rowid FROM {table} NOT INDEXED").fetchall()
                gone[table] = [row for (row,) in every if row not in kept[table]]
        return gone

    def mended(self) -> Table:
        """All runs with their keys, after the damaged rows are removed."""
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always", DamageWarning)
            runs = self.table(more=("key",))
        if warned:
            self.mend()
            runs = self.table(more=("key",))
        return runs

    def keys(self) -> set[str]:
        """The keys of all runs."""
        return set(self.table(more=("key",))["key"].values)

    def forget(self, keys: Iterable[str], statuses: Sequence[str]) -> int:
        """Remove the runs of some keys that ended in one of the statuses. Return their number.

        The runs of later steps of a sequence follow from an earlier one, so they go with it.
        """
        wanted, ended = set(keys), set(statuses)
        every = [(row["id"], row["key"], row["status"], row["after"]) for row in self._read("runs")]
        found = [(run, key) for run, key, status, _ in every if key in wanted and status in ended]
        runs: dict[int, None] = {}
        while found:
            runs |= dict.fromkeys(run for run, _ in found)
            gone = {key for _, key in found}
            found = [(run, key) for run, key, _, after in every if after and after in gone]
        with self.transaction():
            rows = [(run,) for run in runs]
            for table in OF_A_RUN:
                self.db.executemany(f"DELETE FROM {table} WHERE run = ?", rows)
            self.db.executemany("DELETE FROM runs WHERE id = ?", rows)
        return len(runs)

    def has(self, key: str) -> bool:
        """Whether there is a run of a key."""
        return self.db.execute("SELECT 1 FROM runs WHERE key = ?", (key,)).fetchone() is not None

    def has_sequences(self) -> bool:
        """Whether there are runs along sequences."""
        query = "SELECT 1 FROM runs WHERE start <> 'cold' LIMIT 1"
        return self.db.execute(query).fetchone() is not None

    def _of(self, job: Job) -> tuple[int, int]:
        """The numbers of the problem and of the solver of a job."""
        choice = job.solver
        options = json.dumps(dict(choice.options), sort_keys=True)
        values = (choice.title, choice.name, options, choice.version)
        problem = self._id("problems", PROBLEM, [getattr(job.problem, name) for name in PROBLEM])
        facts = ("\n".join(values), *values, choice.family, choice.origin, choice.about)
        solver = self._id("solvers", SOLVER, facts)
        if choice.about:  # a store of an earlier version lacks this
            query = "UPDATE solvers SET about = ? WHERE id = ? AND about IS NULL"
            if self.db.execute(query, (choice.about, solver)).rowcount:
                self._seal("solvers", "id = ?", solver)
        return problem, solver

    def fault(self, job: Job, record: Record, campaign: int | None = None) -> None:
        """Note the cause that kept a run from being done, once for each try."""
        with self.transaction():
            self._insert_fault(
                (
                    job.key,
                    campaign,
                    *self._of(job),
                    job.tol,
                    record.status,
                    text_of(record.message),
                    record.started,
                )
            )

    def _insert_fault(self, values: Sequence[Any]) -> None:
        query = f"INSERT INTO faults ({', '.join(FAULT)}) VALUES (?, ?, ?, ?, ?, ?, ?, ?)"
        self._seal("faults", "id = ?", self.db.execute(query, values).lastrowid)

    def faults(self) -> list[dict[str, Any]]:
        """The runs that a cause from outside prevented, and that have not been done since."""
        with self.snapshot():
            return self._faults()

    def _faults(self) -> list[dict[str, Any]]:
        last: dict[str, dict[str, Any]] = {}
        for row in self._read("faults"):
            if row["key"] not in last or (row["started"] or 0) > (last[row["key"]]["started"] or 0):
                last[row["key"]] = row
        last = {key: row for key, row in last.items() if not self.has(key)}
        if not last:
            return []
        known = {column: self._by_number(column) for column in ("problem", "solver", "campaign")}
        found = []
        for row in last.values():
            problem = known["problem"].get(row["problem"])
            solver = known["solver"].get(row["solver"])
            campaign = known["campaign"].get(row["campaign"], {"name": None})
            if problem is None or solver is None:
                continue  # refers to a damaged row, which was named
            found.append(
                {
                    "solver": solver["label"],
                    "problem": problem["name"],
                    "family": problem["family"],
                    "hash": problem["hash"],
                    "campaign": campaign["name"],
                    **{name: row[name] for name in ("tol", "status", "message", "started")},
                }
            )
        return found

    def _by_number(self, column: str) -> dict[int, dict[str, Any]]:
        """The undamaged rows that runs refer to by a column."""
        return {row["id"]: row for row in self._read(f"{column}s")}

    def add(self, job: Job, record: Record, campaign: int | None = None) -> bool:
        """Store a run; False if there is one of its key."""
        return self.add_all([(job, record)], campaign) == 1

    def add_all(self, runs: Iterable[tuple[Job, Record]], campaign: int | None = None) -> int:
        """Store runs, all or none. Return how many of their keys were new."""
        with self.transaction():
            added = [self._add(job, record, campaign) for job, record in runs]
            new = [run for run in added if run is not None]
            if new:  # they are the last rows: nobody else writes meanwhile
                self._seal("runs", "id >= ?", new[0])
        return len(new)

    def _add(self, job: Job, record: Record, campaign: int | None) -> int | None:
        """Store a run without its checksum. Return its number; None if it is there already."""
        merits = record.merits or {}
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
            job.copy,
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
            job.after or None,
        ]
        marks = ", ".join("?" * len(RUN))
        cursor = self.db.execute(
            f"INSERT INTO runs ({', '.join(RUN)}) SELECT {marks}"
            " WHERE NOT EXISTS (SELECT 1 FROM runs WHERE key = ?)",
            [*values, job.key],
        )
        if cursor.rowcount == 0:
            return None
        run: int = cursor.lastrowid
        solution = record.solution
        self._add_more(
            run,
            record.certificate,
            [solution.get(name) for name in KEPT] if solution else None,
            record.history or (),
        )
        return run

    def _add_more(
        self,
        run: int,
        certificate: str | None,
        vectors: Sequence[bytes | None] | None,
        history: Sequence[Sequence[Any]],
    ) -> None:
        """Store the parts of a run that lie in other tables."""
        if certificate:
            query = "INSERT INTO certificates (run, certificate) VALUES (?, ?)"
            self.db.execute(query, (run, certificate))
            self._seal("certificates", "run = ?", run)
        if vectors:
            query = "INSERT INTO solutions (run, u, r, l) VALUES (?, ?, ?, ?)"
            self.db.execute(query, (run, *vectors))
            self._seal("solutions", "run = ?", run)
        if history:
            query = f"INSERT INTO history (run, {', '.join(HISTORY)}) VALUES (?, ?, ?, ?, ?)"
            self.db.executemany(query, [(run, *report) for report in history])
            self._seal("history", "run = ?", run)

    # ---- facts of files, so that a campaign need not read them again

    def known(self, path: Path) -> ProblemFacts | None:
        """The problem of a file that has not changed since it was noted."""
        info = _sequence.place_of(path)[0].stat()
        same = "path = ? AND size = ? AND modified = ?"
        noted = (text_of(str(path)), info.st_size, info.st_mtime_ns)
        for row in self._read("files", same, noted):
            for facts in self._read("problems", "id = ?", (row["problem"],)):
                return ProblemFacts(**{name: facts[name] for name in PROBLEM} | {"path": str(path)})
        return None

    def note(self, path: Path, facts: ProblemFacts) -> None:
        """Note the facts of the problem in a file."""
        if text_of(str(path)) != str(path):
            return  # SQLite cannot store such names
        info = _sequence.place_of(path)[0].stat()
        with self.transaction():
            problem = self._id("problems", PROBLEM, [getattr(facts, name) for name in PROBLEM])
            self.db.execute(
                "INSERT OR REPLACE INTO files (path, size, modified, problem) VALUES (?, ?, ?, ?)",
                (str(path), info.st_size, info.st_mtime_ns, problem),
            )
            self._seal("files", "path = ?", str(path))

    # ---- reading, for other modules

    def table(self, more: Sequence[str] = ()) -> Table:
        """All runs, in the order in which they were stored, in the columns of `results`.

        Args:
            more: the columns of `MORE` to read too.
        """
        with self.snapshot():
            return self._table(more)

    def _table(self, more: Sequence[str]) -> Table:
        own = layouts()["runs"]
        known = {column: list(self._by_number(column).values()) for column in REFERRED}
        wanted = [name for name in (*layout.columns(), "path") if name not in MORE or name in more]
        referred = {name for columns in REFERRED.values() for name in columns}
        mine = [name for name in wanted if name not in referred]
        numbers = {n: own.numbers.index(NUMBER.get(n, n)) for n in mine if n not in TEXTS}
        texts = {n: own.texts.index(n) + 1 + len(own.numbers) for n in mine if n in TEXTS}
        found: dict[str, list[Any]] = {name: [np.empty(0)] for name in (*numbers, *REFERRED)}
        words: dict[str, _Places] = {name: _Places() for name in texts}
        codes: dict[str, list[npt.NDArray[np.int64]]] = {n: [np.empty(0, np.int64)] for n in texts}
        for rows, values in self._right("runs"):
            for name, place in numbers.items():
                found[name].append(values[:, place].copy())
            for name in REFERRED:
                found[name].append(values[:, own.numbers.index(name)].copy())
            for name, place in texts.items():
                numbered = map(words[name].__getitem__, [row[place] for row in rows])
                codes[name].append(np.fromiter(numbered, np.int64, len(rows)))
        columns: dict[str, Column] = {
            name: numbers_of(name, np.concatenate(found.pop(name))) for name in numbers
        }
        for name in texts:
            columns[name] = Words.of_texts(_text(value) for value in words.pop(name))[
                np.concatenate(codes.pop(name))
            ]
        there = np.ones(len(columns["run"]), dtype=bool)
        for column, names in REFERRED.items():
            places, exists = _places(np.concatenate(found.pop(column)), known[column])
            there &= exists
            for name, other in names.items():
                if name not in wanted:
                    continue
                given = [row[other] for row in known[column]] + [None]  # the last: NULL
                if name in TEXTS:
                    columns[name] = Words.of_texts(given)[places]
                else:
                    columns[name] = numbers_of(name, given)[places]
        table = Table({name: columns[name] for name in wanted})
        if there.all():
            return table
        lost = table["run"][~there].tolist()
        self._warn(f"{_rows_of(lost)} of runs", len(lost), "of damaged rows, and left out")
        return table.where(there)

    def columns(self) -> list[str]:
        """The columns of `results`."""
        return list(layout.columns())

    def results(
        self, where: str = "", values: Sequence[Any] = (), **wanted: Any
    ) -> list[dict[str, Any]]:
        """All runs, a row each, in the order in which they were stored.

        Args:
            where: a condition of SQL on the columns of `results`, with a ? for each of the values.
            values: in their order.
            wanted: only runs that have these values in these columns.
        """
        table = self.table(more=LONG)
        if where:
            chosen = self.db.execute(f"SELECT run FROM results WHERE {where}", values).fetchall()
            table = table.where(np.isin(table["run"], [run for (run,) in chosen]))
        for name, value in wanted.items():
            table = table.where(table[name] == value)
        return list(table)

    def history(self, run: int) -> list[tuple[int, float, float, str]]:
        """The reports of a run, each with iteration, error, time [s] and stage."""
        return [
            tuple(row[name] for name in HISTORY)
            for row in self._read("history", "run = ?", (run,))
            if row["run"] == run  # an index may be damaged
        ]

    def certificate(self, run: int) -> str | None:
        """The proof of a run that there is no solution, in JSON."""
        for row in self._read("certificates", "run = ?", (run,)):
            return str(row["certificate"])
        return None

    def solution(self, run: int) -> dict[str, npt.NDArray[np.float64]]:
        """The vectors u, r and l that a run found; empty if they are not stored."""
        for row in self._read("solutions", "run = ?", (run,)):
            return {name: np.frombuffer(row[name]) for name in KEPT if row[name] is not None}
        return {}

    def with_solutions(self) -> list[int]:
        """The runs whose solutions are stored, in their order."""
        return [row["run"] for row in self._read("solutions")]

    def run_of(self, key: str) -> dict[str, Any] | None:
        """The run of a key, in the columns of the table `runs`; None if there is none."""
        for run in self._read("runs", "key = ?", (key,)):
            if run["key"] == key:  # an index may be damaged
                return run
        return None

    def solution_of(self, key: str) -> tuple[bytes, bytes | None] | None:
        """The reactions and multipliers that the run of a key found; None if it found none."""
        run = self.run_of(key)
        for row in self._read("solutions", "run = ?", (run["id"],)) if run else ():
            return row["r"], row["l"]
        return None

    def texts(self) -> list[str]:
        """The texts of the campaigns that have written here."""
        found = [row["text"] for row in self._read("campaigns")]
        return list(dict.fromkeys(text for text in found if text is not None))

    def status(self) -> list[Status]:
        """The campaigns that have written here, the latest first."""
        own = layouts()["runs"]
        campaign = own.numbers.index("campaign")
        status = own.texts.index("status") + 1 + len(own.numbers)
        done: dict[float, Counter[str]] = {}
        for rows, numbers in self._right("runs"):
            for number, row in zip(numbers[:, campaign].tolist(), rows, strict=True):
                done.setdefault(number, Counter())[row[status].decode(errors="replace")] += 1
        found = []
        for row in reversed(list(self._read("campaigns"))):
            counts = done.get(float(row["id"]), Counter())
            found.append(
                Status(
                    name=row["name"],
                    planned=row["planned"],
                    done=row["skipped"] + counts.total(),
                    solved=sum(counts[name] for name in SOLVED),
                    statuses=dict(counts),
                    started=row["started"],
                    seen=row["seen"],
                    ended=row["ended"],
                    node=row["node"],
                    pid=row["pid"],
                    done_before=row["skipped"],
                )
            )
        return found

    def merge(self, others: Iterable[str | Path]) -> int:
        """Take over the runs of other stores; runs of other machines stay apart.

        A run of the same key from the same machine is taken once.

        Returns:
            The number of new runs.

        Raises:
            StoreError: one of them is not a store.
        """
        added = 0
        self.mend()
        for path in others:
            if Path(path).resolve() == self.path.resolve():
                raise StoreError(f"{path}: is the store that the others are to be merged into")
            try:
                other = Store(path, create=False)
            except DamagedError:
                other = Store.recover(path)
            with other, other.snapshot(), self.transaction():
                added += self._take(other)
        return added

    def _take(self, other: Store) -> int:
        numbers: dict[str, dict[Any, Any]] = {}
        kinds = (("problem", PROBLEM), ("solver", SOLVER), ("machine", MACHINE))
        for column, names in kinds:
            numbers[column] = {
                number: self._id(f"{column}s", names, [row[name] for name in names])
                for number, row in other._by_number(column).items()
            }
        numbers["campaign"] = {None: None}
        for number, row in other._by_number("campaign").items():
            same = "SELECT id FROM campaigns WHERE name IS ? AND node IS ? AND started IS ?"
            found = self.db.execute(same, (row["name"], row["node"], row["started"])).fetchone()
            if found is None:
                query = f"INSERT INTO campaigns ({', '.join(CAMPAIGN)}) VALUES ({_marks(CAMPAIGN)})"
                new = self.db.execute(query, [row[name] for name in CAMPAIGN]).lastrowid
                self._seal("campaigns", "id = ?", new)
            numbers["campaign"][number] = found[0] if found else new

        def adapt(row: dict[str, Any]) -> bool:
            """Give a row the numbers used here; False if it refers to a damaged row."""
            columns = [column for column in numbers if column in row]
            good = all(row[column] in numbers[column] for column in columns)
            if good:
                row |= {column: numbers[column][row[column]] for column in columns}
            return good

        for row in other._read("faults"):
            same = "SELECT 1 FROM faults WHERE key = ? AND started IS ?"
            known = self.db.execute(same, (row["key"], row["started"])).fetchone()
            if not known and adapt(row):
                self._insert_fault([row[name] for name in FAULT])
        added, first, lost = 0, 0, []
        insert = f"INSERT INTO runs ({', '.join(RUN)}) VALUES ({_marks(RUN)})"
        for row in other._read("runs"):
            number = row["id"]
            if not adapt(row):
                lost.append(number)
                continue
            cursor = self.db.execute(
                f"{insert} ON CONFLICT DO NOTHING", [row[name] for name in RUN]
            )
            if cursor.rowcount:
                added += 1
                first = first or cursor.lastrowid
                vectors = next(other._read("solutions", "run = ?", (number,)), None)
                self._add_more(
                    cursor.lastrowid,
                    other.certificate(number),
                    [vectors[name] for name in KEPT] if vectors else None,
                    other.history(number),
                )
        if first:
            self._seal("runs", "id >= ?", first)
        if lost:
            other._warn(f"{_rows_of(lost)} of runs", len(lost), "of damaged rows, and left out")
        return added

    def add_rows(
        self, rows: Iterable[Mapping[str, Any]], machines: Mapping[str, Mapping[str, Any]]
    ) -> int:
        """Take over runs that are rows of `results`, with `kind`, and `history` as dicts.

        A run whose key is there, of a machine of this node, is left out.

        Args:
            rows: from another store. Columns that are left out are missing values.
            machines: the facts of each machine, by the `node` of its rows.

        Returns:
            The number of new runs.
        """
        insert = f"INSERT INTO runs ({', '.join(RUN)}) SELECT {_marks(RUN)}"
        insert += " WHERE NOT EXISTS (SELECT 1 FROM runs JOIN machines"
        insert += " ON machines.id = runs.machine WHERE runs.key = ? AND machines.node = ?)"
        added, first = 0, 0
        with self.transaction():
            for row in rows:
                own = {**row, "name": row["problem"], "path": row.get("path") or ""}
                problem = self._id("problems", PROBLEM, [own.get(name) for name in PROBLEM])
                values = [row[name] for name in ("solver", "solver_name", "options", "version")]
                about = [row.get(name) for name in ("solver_family", "origin", "about")]
                digest = "\n".join(map(str, values))
                solver = self._id("solvers", SOLVER, (digest, *values, *about))
                facts = {**machines.get(row["node"], {}), "node": row["node"]}
                text = json.dumps(facts, sort_keys=True)
                columns = (text, *(facts.get(name) for name in MACHINE[1:-1]), text)
                machine = self._id("machines", MACHINE, columns)
                own |= {"campaign": None, "problem": problem, "solver": solver, "machine": machine}
                cursor = self.db.execute(insert, [*map(own.get, RUN), row["key"], row["node"]])
                if cursor.rowcount:
                    added += 1
                    first = first or cursor.lastrowid
                    history = [[one[name] for name in HISTORY] for one in row.get("history") or ()]
                    self._add_more(cursor.lastrowid, None, None, history)
            if first:
                self._seal("runs", "id >= ?", first)
        return added

    def lower_limits(self, limits: Mapping[int, float]) -> int:
        """Let runs, by their numbers, count under smaller limits of CPU time [s].

        One that took longer has failed. Returns the number of runs.
        """
        with self.transaction():
            for run, limit in limits.items():
                self.db.execute("UPDATE runs SET time_limit = ? WHERE id = ?", (limit, run))
                self.db.execute(
                    "UPDATE runs SET status = 'time_limit', solved = 0"
                    " WHERE id = ? AND solved AND cpu_s > ?",
                    (run, limit),
                )
                self._seal("runs", "id = ?", run)
        return len(limits)

    def machines(self) -> dict[str, dict[str, Any]]:
        """The facts of the machines of all runs, by the column `machine`."""
        return {row["hash"]: object_in(row["facts"]) for row in self._by_number("machine").values()}

    def machine_of(self, run: Mapping[str, Any]) -> dict[str, Any]:
        """The facts of the machine of a run, given in the columns of the table `runs`."""
        rows = self._read("machines", "id = ?", (run["machine"],))
        return next((object_in(row["facts"]) for row in rows), {})

    def kinds(self) -> dict[str, str]:
        """The kind of each problem, by its hash."""
        return {row["hash"]: row["kind"] for row in self._by_number("problem").values()}

    def campaigns(self) -> list[dict[str, Any]]:
        """The campaigns, in the order in which they began."""
        return list(self._by_number("campaign").values())

    def export(self, path: str | Path) -> int:
        """Write `results` as .csv or .parquet, whole or not at all. Return the number of rows.

        Raises:
            StoreError: the name has another ending.
            ImportError: Parquet needs pyarrow.
        """
        path = Path(path)
        if path.suffix not in (".csv", ".parquet"):
            raise StoreError(f"{path}: a store is exported to .csv or .parquet")
        table = self.table(more=LONG)
        if path.suffix == ".csv":
            write_csv(path, table.names, zip(*map(table.values, table.names), strict=True))
        else:
            import pyarrow as pa
            import pyarrow.parquet as pq

            columns = pa.table({name: table.values(name) for name in table.names})
            replace_file(path, lambda beside: pq.write_table(columns, beside))
        return len(table)


class _Places(dict[bytes, int]):
    """Numbers things in the order of their first appearance."""

    def __missing__(self, key: bytes) -> int:
        self[key] = number = len(self)
        return number


def _text(value: bytes) -> str | None:
    """The value of a text that `Layout.query` selects."""
    return None if value == NOTHING else value.decode(errors="replace")


def _marks(names: Sequence[str]) -> str:
    return ", ".join("?" * len(names))


def _places(
    numbers: npt.NDArray[np.float64], known: Sequence[dict[str, Any]]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """The places of numbers among rows (the last place for nan), and whether the row exists."""
    ids = np.array([row["id"] for row in known], dtype=np.float64)
    order = np.argsort(ids)
    at = np.searchsorted(ids[order], numbers)
    nothing = np.isnan(numbers)
    places = np.append(order, len(ids))[np.where(nothing, len(ids), np.minimum(at, len(ids)))]
    return places, nothing | (np.append(ids, np.nan)[places] == numbers)


def refers(numbers: Sequence[str]) -> Iterator[tuple[str, str]]:
    """The tables that rows with these columns refer to, and the columns that refer to them."""
    for column in (*REFERRED, "run"):
        if column in numbers:
            yield f"{column}s", column
