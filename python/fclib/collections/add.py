"""Take existing files, and the steps of sequences, into a collection, as a set.

    OUT/NAME/FAMILY/0000-local.hdf5   a copy, with a reference solution (references.py)
                    catalog.parquet   of the family; column `source` has the file's path
                    distribution.*    histograms of its problems

The family is the folder of a file. The files themselves are read and never written. The path and
SHA-256 of its file identify a row. So a file taken in before is left as it is, a file that has
changed is a new problem, and a run that was killed goes on. Files of equal problems are all taken
in; column `same_as` names the first of them.
"""

from __future__ import annotations

import hashlib
import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fclib import _core, _sequence
from fclib._files import replace_file
from fclib._judge import MARK, TOLERANCE, judge, trivial
from fclib._regular import resolved
from fclib.collections import catalog, references, set_index
from fclib.collections.build import CHECKPOINT, facts_of, nnz
from fclib.collections.figures import draw_distribution
from fclib.collections.references import Found

SUFFIXES = (".hdf5", ".h5")
VERSION = "own"
OF_FILE = "the file"  # stands in place of a solver, if the file's own solution is better


@dataclass(frozen=True, kw_only=True)
class Rules:
    """Rules for taking files in."""

    references: bool = True  # whether solutions are looked for
    tol: float = TOLERANCE  # tolerance of the solver
    time_limit: float = 20.0  # [s] for each problem
    license: str | None = None  # license of the data
    citation: str | None = None  # citation of the data


@dataclass(frozen=True)
class Refusal:
    """A file that is left out, and why."""

    path: Path
    reason: str


def add(
    source: str | Path,
    out: str | Path,
    name: str | None = None,
    rules: Rules | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> list[Refusal]:
    """Take the FCLIB files below a folder into a collection, as a set of it.

    Args:
        source: the folder of the files.
        out: the folder of the collection; made if it is missing.
        name: name of the set; by default that of the folder.
        rules: see `Rules`.
        progress: called with the family, the files done and their number.

    Returns:
        The files that were left out: they hold no valid problem.

    Raises:
        NotADirectoryError: the source is not a folder.
        ValueError: a published set or a built family already has the name.
        FileNotFoundError: there is no HDF5 file in the source.
        OSError: the collection cannot be written.
    """
    catalog.arrow()
    source, out = resolved(source), resolved(out)
    if not source.is_dir():
        raise NotADirectoryError(f"{source}: is no folder")
    collection = plain(name or source.name)
    if collection in set_index.sets() or collection in set_index.SETS:
        raise ValueError(f"{collection}: is the name of a published set; choose another (--name)")
    families: dict[str, list[Path]] = {}
    for path in sorted(source.rglob("*")):
        # the collection may lie inside the source
        if path.suffix in SUFFIXES and path.is_file() and out not in path.parents:
            inner = path.parent.relative_to(source).parts
            family = plain("-".join(inner) or source.name)
            families.setdefault(family, []).extend(_sequence.steps_or_file(path))
    if not families:
        raise FileNotFoundError(f"{source}: holds no file *{' and no *'.join(SUFFIXES)}")
    report = progress or (lambda family, done, total: None)
    refused: list[Refusal] = []
    for family, paths in families.items():
        part = Part(source, out, collection, family, rules or Rules())
        for done, refusal in enumerate(part.add_files(paths), 1):
            refused += [refusal] if refusal is not None else []
            report(f"{collection}/{family}", done, len(paths))
        catalog.gather(out)
    return refused


def _sha256(path: Path) -> str:
    """The SHA-256 of a file; of a step, that of its own file: the sequence may grow."""
    if _sequence.place_of(path)[1] is None:
        return catalog.sha256(path)
    return hashlib.sha256(_sequence.content(path)).hexdigest()


def plain(name: str) -> str:
    """A name for a folder, without characters that URLs or shells refuse."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name).strip(".") or "files"


class Part:
    """A family that is being taken in."""

    def __init__(self, source: Path, out: Path, collection: str, family: str, rules: Rules) -> None:
        """Read the rows that are there already."""
        self.source, self.out, self.rules = source, out, rules
        self.collection, self.family = collection, family
        self.catalogue = out / collection / family / catalog.FILE
        self.rows: dict[tuple[str, str], dict[str, Any]] = {}  # by path and SHA-256 of the source
        if self.catalogue.is_file():
            table = catalog.read_catalog(self.catalogue)
            if "source" not in table.column_names:
                raise ValueError(
                    f"{self.catalogue.parent}: was built from a scene; choose another name (--name)"
                )
            for row in table.to_pylist():
                self.rows[row["source"], row["source_sha256"]] = row

    def add_files(self, paths: Sequence[Path]) -> Iterator[Refusal | None]:
        """Take files in. For each, return None, or the reason why it is left out."""
        last = time.monotonic()
        try:
            for path in paths:
                try:
                    self._add_file(path)
                    refusal = None
                except (_core.Error, OSError) as error:
                    # an error in writing the collection is not a fault of the file
                    if isinstance(error, OSError) and Path(error.filename or path) != path:
                        raise
                    words = str(error)
                    named = words.startswith(str(path))
                    refusal = Refusal(path, words if named else f"{path}: {words}")
                yield refusal
                if time.monotonic() - last > CHECKPOINT:
                    self._write()
                    last = time.monotonic()
        finally:
            self._write()
        rows = list(self.rows.values())
        if rows:
            draw_distribution(rows, self.catalogue.parent, self.family)

    def _write(self) -> None:
        if not self.rows:
            return
        catalog.write_catalog(self.catalogue, self.rows.values())

    def _add_file(self, path: Path) -> None:
        own = path.relative_to(self.source).as_posix()
        try:
            own.encode()
        except UnicodeEncodeError:
            raise _core.FileError(f"{path}: its name is not UTF-8, which a catalogue has") from None
        key = own, _sha256(path)
        row = self.rows.get(key)
        if row is not None and all(
            (self.out / file).is_file() and catalog.sha256(self.out / file) == digest
            for file, digest in catalog.files_of(row)
        ):
            return
        taken = [own["number"] for own in self.rows.values()]
        number = row["number"] if row is not None else max(taken, default=-1) + 1
        self.rows[key] = self._store(path, number) | dict(
            zip(("source", "source_sha256"), key, strict=True)
        )

    def _store(self, path: Path, number: int) -> dict[str, Any]:
        """Write the copy of a file, and return its row."""
        kinds = _core.kinds(path)
        if not kinds:
            raise _core.FileError(f"{path}: holds no problem of FCLIB")
        # the problem of the file's solution
        kind = "global" if "global" in kinds else kinds[0]
        problem: Any = _core.read(path, kind)
        own = _core.read_solution(path)
        found, untried = self._reference(problem, own)
        form = "global" if problem.kind.startswith("global") else "local"
        file = self.catalogue.parent / f"{number:04d}-{form}.hdf5"

        def copy(beside: Path) -> None:
            stored = _core.read_solutions(path)
            several = [one for one in stored if judge(problem, one).ok]
            kept = own is None if found is None else found.ok and found.solver == OF_FILE
            if len(kinds) == 1 and kept and len(several) == len(stored):
                _sequence.copy(path, beside)
                if found is not None:
                    _core.write_attributes(beside, "solution", found.attributes)
                else:
                    _core.write_attributes(beside, "info", {MARK: untried})
                return
            # if it is not a solution, it is removed with all facts stored of it
            told = _core.read_attributes(path, "info")
            told.pop(MARK, None)
            guesses = _core.read_guesses(path)
            references.write(beside, problem, found, guesses, several, untried)
            if told:
                _core.write_attributes(beside, "info", told)

        file.parent.mkdir(parents=True, exist_ok=True)
        replace_file(file, copy)
        stored = {
            f"{form}_file": file.relative_to(self.out).as_posix(),
            f"{form}_sha256": catalog.sha256(file),
        }
        return {
            "id": f"{self.collection}/{self.family}/{number:04d}",
            "collection": self.collection,
            "version": VERSION,
            "family": self.family,
            "number": number,
            **facts_of(problem),
            "nnz_W": nnz(problem.W) if form == "local" else None,
            "trivial": trivial(problem),
            **(found.row | {"tol": self.rules.tol} if found is not None else {}),
            **dict.fromkeys(catalog.FILES),
            **stored,
            "license": self.rules.license,
            "citation": self.rules.citation,
        }

    def _reference(self, problem: Any, own: _core.Solution | None) -> tuple[Found | None, str]:
        """The best known solution: the file's own, or a better one; or None, and why."""
        rules = self.rules
        of_file = references.given(problem, own, OF_FILE) if own is not None else None
        if not rules.references or (of_file is not None and of_file.ok):
            return of_file, references.NOT_TRIED
        try:
            found = references.find(problem, "auto", rules.tol, time_limit=rules.time_limit)
        except _core.Error as error:  # M is singular; the problem is kept all the same
            return of_file, f"none is known: no solver takes the problem: {error}"
        better = of_file is None or found.refuted or found.error < of_file.error
        return (found if better else of_file), ""
