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
from fclib.bench.problems import SUFFIXES
from fclib.bench.store import Store
from fclib.collections.ratings import solution_of
from fclib.results.shards import VECTORS, ShardError, error_of, pack, rows_of

ENOUGH: Final = 5  # solutions that a submission has at least
# a recomputed error may differ so much from the stored one, relative and absolute: another machine
# rounds otherwise
SAME: Final = (1e-3, 1e-14)


def submit(store: Store, where: Path, name: str, machine: str = "") -> Path:
    """Write a store as one file, with the solutions of a sample.

    Raises:
        ShardError: it has too few solutions, or no run; and as `pack`.
    """
    count = len(store.with_solutions())
    if count < ENOUGH:
        raise ShardError(
            f"{store.path}: has {counted(count, 'solution')}, and {ENOUGH} are asked for: a"
            " campaign with `repeated` below 1 keeps those of the problems that it repeats"
        )
    path = pack(store, where, name, machine, solutions=True)
    if path is None:
        raise ShardError(f"{store.path}: has no run")
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
    if not rows:
        raise ShardError(f"{path}: has no solution to judge")
    files = files_by_digest({row["hash"]: row["problem"] for row in rows}, folders)
    return [verdict(row, files.get(row["hash"])) for row in rows]


def verdict(row: dict[str, Any], file: Path | None) -> dict[str, Any]:
    """The judgement on a row: "ok", "wrong", or "no problem" if its file is not there."""
    own = {name: row[name] for name in ("problem", "solver", "tol")}
    if file is None:
        return {**own, "said": error_of(row), "error": None, "status": "no problem"}
    problem = _core.read(file, row["kind"] or None)
    r, multipliers = (
        None if row[name] is None else np.frombuffer(row[name], "<f8") for name in VECTORS
    )
    found = judge(problem, solution_of(r, multipliers), row["tol"], row["merit"])
    said = error_of(row)
    same = said is not None and abs(found.error - said) <= SAME[0] * said + SAME[1]
    status = "ok" if found.ok and same else "wrong"
    return {**own, "said": said, "error": found.error, "status": status}


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
