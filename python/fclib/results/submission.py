"""Runs that somebody submits: one file, and the judgement of the solutions that it has.

It is a part (`shards.py`) with the solutions of a sample. Whoever takes it in judges these again,
on problems of their own, and needs neither the solver nor the machine for it.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np

from fclib import _core, _digest
from fclib._judge import judge
from fclib._words import counted
from fclib.bench.calibration import calibration_in
from fclib.bench.problems import SUFFIXES
from fclib.bench.store import Store
from fclib.collections.ratings import solution_of
from fclib.results.shards import VECTORS, Shard, ShardError, error_of, pack, rows_of, verify

ENOUGH: Final = 5  # solutions that a submission has at least
# a recomputed error may differ so much from the stored one, relative and absolute: another machine
# rounds otherwise
SAME: Final = (1e-3, 1e-14)


def submit(
    store: Store, where: Path, name: str, machine: str = "", there: Iterable[Shard] = ()
) -> Path:
    """Write a store as one file, with the solutions of a sample.

    Args:
        store: the runs that are handed in.
        where: folder of the file.
        name: of the set that they are of.
        machine: as for `pack`.
        there: published parts, whose runs, which `unpack` may have put there, are left out.

    Raises:
        ShardError: it has too few solutions, no run, runs of a machine that was not calibrated, or
            what `verify` does not take; and as `pack`.
    """
    if any(calibration_in(facts) is None for facts in store.machines().values()):
        raise ShardError(
            f"{store.path}: has runs of a machine that was not calibrated before, which do not"
            " compare with those of others: `fclib bench --calibrate`, and then run it anew, into"
            " another store"
        )
    count = len(store.with_solutions())
    if count < ENOUGH:
        raise ShardError(
            f"{store.path}: has {counted(count, 'solution')}, and {ENOUGH} are asked for: a"
            " campaign with `repeated` below 1 keeps those of the problems that it repeats"
        )
    before = set(where.glob("*"))
    path = pack(store, where, name, machine, there, solutions=True)
    if path is None:
        raise ShardError(f"{store.path}: has no run that is not published yet")
    if wrong := verify(path):
        if path not in before:
            path.unlink()
        raise ShardError(f"{store.path}: {wrong[0]}")
    return path


def judged(path: Path, folders: Iterable[Path]) -> list[dict[str, Any]]:
    """A row for each solution of a part: its error by the data, and whether that is what it says.

    Args:
        path: of the part.
        folders: with the files of its problems, as `fclib collection build` writes them.

    Raises:
        ShardError: the part has no solutions.
        fclib.Error: a file of a problem cannot be read.
    """
    rows = [row for row in rows_of(path) if row.get(VECTORS[0]) is not None]
    if len(rows) < ENOUGH:
        raise ShardError(
            f"{path}: has {counted(len(rows), 'solution')} to judge, and {ENOUGH} are asked for"
        )
    files = files_by_digest({row["hash"]: row["problem"] for row in rows}, folders)
    return [verdict(row, files.get(row["hash"])) for row in rows]


def verdict(row: dict[str, Any], file: Path | None) -> dict[str, Any]:
    """The judgement on a row: "ok", "wrong", or "no problem" if its file is not there."""
    own = {name: row[name] for name in ("problem", "solver", "tol")}
    if file is None:
        return {**own, "said": error_of(row), "error": None, "status": "no problem"}
    problem = _core.read(file, row["kind"] or None)
    said = error_of(row)
    try:
        r, multipliers = (vector(row.get(name)) for name in VECTORS)
        found = judge(problem, solution_of(r, multipliers), row["tol"], row["merit"])
    except (TypeError, ValueError, _core.Error) as error:  # no doubles, or of another number
        return {**own, "said": said, "error": None, "status": "wrong", "why": str(error)}
    same = said is not None and abs(found.error - said) <= SAME[0] * said + SAME[1]
    status = "ok" if found.ok and same else "wrong"
    return {**own, "said": said, "error": found.error, "status": status}


def vector(content: Any) -> Any:
    """The doubles of an entry; None if there is none. TypeError, ValueError: it is no vector."""
    return None if content is None else np.frombuffer(content, "<f8")


def files_by_digest(wanted: dict[str, str], folders: Iterable[Path]) -> dict[str, Path]:
    """The files of some problems, by their digests; only files of their names are read."""
    names = {name.rpartition("/")[2].partition("-")[0] for name in wanted.values()}
    found: dict[str, Path] = {}
    for folder in folders:
        for path in sorted(folder.rglob("*")):
            if path.suffix in SUFFIXES and path.stem.partition("-")[0] in names:
                for kind in _core.kinds(path):
                    digest = _digest.digest(_core.read(path, kind))
                    if digest in wanted:
                        found.setdefault(digest, path)
        if len(found) == len(wanted):
            break
    return found
