"""Whether a folder still holds what its catalogue says."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fclib import _core, _digest
from fclib.collections import catalog


@dataclass(frozen=True)
class Verdict:
    """What was found of one file."""

    id: str  # of the problem
    path: str  # from the catalogue's folder
    status: str  # "ok", or what is wrong: missing, changed, unreadable, ...
    error: float | None  # of the stored solution, where it could be judged
    message: str = ""

    @property
    def ok(self) -> bool:
        """Whether all is as the catalogue says."""
        return self.status == "ok"


def verify(folder: str | Path, progress: Callable[[str], None] | None = None) -> Iterator[Verdict]:
    """Hash each file of a folder again, read it, and judge its solution from the data alone.

    A stored solution must be as good as the catalogue says, and the data of the form that the
    catalogue describes must have the digest that stands there.

    Raises:
        CatalogError: the folder has no catalogue.
    """
    folder = Path(folder)
    for row in catalog.read_catalog(folder).to_pylist():
        for path, digest in catalog.files_of(row):
            if progress is not None:
                progress(path)
            yield judge(folder, row["id"], path, digest, row)


def judge(folder: Path, name: str, path: str, digest: str, row: dict[str, Any]) -> Verdict:
    """The verdict on one file."""
    file = folder / path
    if not file.is_file():
        return Verdict(name, path, "missing", None, f"{file}: is not there")
    if catalog.sha256(file) != digest:
        return Verdict(name, path, "changed", None, f"{file}: its SHA-256 is not the catalogue's")
    try:
        problem: Any = _core.read(file)
        solution = _core.read_solution(file)
    except _core.Error as reason:
        return Verdict(name, path, "unreadable", None, str(reason))
    if solution is None:
        return Verdict(name, path, "no solution", None, f"{file}: its solution is not there")
    # the sets were made by this merit
    error = _core.merit(problem, solution).error_by("natural")
    if problem.formulation == row["formulation"] and _digest.digest(problem) != row["digest"]:
        return Verdict(name, path, "wrong digest", error, f"{file}: holds another problem")
    stored = float(row["error"])
    # the local form is another problem by rounding, and its error another number
    bound = max(2 * stored, float(row["tol"]))
    if not error <= bound:
        message = f"{file}: the solution's error is {error:.1e}, the catalogue says {stored:.1e}"
        return Verdict(name, path, "worse", error, message)
    return Verdict(name, path, "ok", error)
