"""The files of a problem that the site offers, with their SHA-256 and citation."""

from __future__ import annotations

import math
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fclib import _core
from fclib._solve import MERITS
from fclib.collections.catalog import sha256
from fclib.report.error import ReportError

CHUNK = 100  # number of problems in one data file
FORMS = ("global", "local")


class Downloads:
    """The files of a site: copies, links to a published address, or none."""

    def __init__(self, site: Path, source: Path | None, with_files: bool, address: str) -> None:
        """Raises ReportError if files are wanted without a catalogue."""
        if (with_files or address) and source is None:
            raise ReportError("files are those of a catalogue: name one by --catalog")
        self.site = site
        self.source = source
        self.with_files = with_files
        self.address = address.rstrip("/")

    @property
    def kind(self) -> str:
        """The offer of the pages: "here", an address, or nothing."""
        return "here" if self.with_files else self.address

    def picture(self, row: Mapping[str, Any]) -> Path | None:
        """The file for the picture of a problem; None if it is not asked for."""
        file = row.get("global_file") or row.get("local_file")
        if not self.with_files or not file:
            return None
        return self.site / "files" / stem(file, "picture.png")

    def record(self, row: Mapping[str, Any]) -> dict[str, Any]:
        """Digest, version and files of a problem; the files are copied if that is asked for.

        Raises:
            ReportError: a file is not the one of the catalogue.
        """
        keys = ("digest", "version", "number", "license", "citation")
        found = {key: row[key] for key in keys if row.get(key) is not None}
        files = []
        for form in FORMS:
            path, digest = row.get(f"{form}_file"), row.get(f"{form}_sha256")
            if not path or not digest or self.source is None:
                continue
            own = {"what": f"problem, {form} form", "path": path, "sha256": digest}
            if (self.source / path).is_file():
                own["bytes"] = (self.source / path).stat().st_size
            if self.with_files:
                self._copy(path, digest)
                own["href"] = f"files/{path}"
                own["merit"] = merit_of(self.source / path)
            elif self.address:
                own["href"] = f"{self.address}/{path}"
            files.append(own)
        if self.with_files and files:
            first = self.source / files[0]["path"] if self.source else Path()
            reference = self.site / "files" / stem(files[0]["path"], "reference.npz")
            if write_reference(first, reference):
                files.append(self._own("reference solution: v, u, r, l", reference))
            drawn = self.picture(row)
            if drawn is not None and drawn.is_file():
                files.append(self._own("picture", drawn))
        if files:
            found["files"] = files
        return found

    def _copy(self, path: str, digest: str) -> None:
        assert self.source is not None
        target = self.site / "files" / path
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            shutil.copyfile(self.source / path, target)
        except OSError as error:
            raise ReportError(f"{self.source / path}: {error.strerror}") from None
        if sha256(target) != digest:
            raise ReportError(f"{self.source / path}: is not the catalogue's file; build it anew")

    def _own(self, what: str, path: Path) -> dict[str, Any]:
        own = path.relative_to(self.site).as_posix()
        return {
            "what": what,
            "path": own.removeprefix("files/"),
            "href": own,
            "sha256": sha256(path),
            "bytes": path.stat().st_size,
        }


def stem(file: str, ending: str) -> str:
    """SET/FAMILY/0100-global.hdf5 with another ending: SET/FAMILY/0100-ENDING."""
    for form in FORMS:
        file = file.removesuffix(f"-{form}.hdf5")
    return f"{file}-{ending}"


def write_reference(file: Path, target: Path) -> bool:
    """Write the solution of a file as arrays of NumPy; False if it has none."""
    solution = _core.read_solution(file)
    if solution is None:
        return False
    arrays = {name: getattr(solution, name, None) for name in ("v", "u", "r", "l")}
    target.parent.mkdir(parents=True, exist_ok=True)
    kept: dict[str, Any] = {name: x for name, x in arrays.items() if x is not None and len(x)}
    np.savez_compressed(target, **kept)
    return True


def merit_of(file: Path) -> dict[str, float | None] | None:
    """All merits of the solution in a file, to their last digit; None if it has none.

    A value that is not finite becomes None: JSON has no such number.
    """
    if "solution" not in _core.contents(file):
        return None
    problem: Any = _core.read(file)
    solution = _core.read_solution(file)
    assert solution is not None
    merit = _core.merit(problem, solution)
    found = {name: getattr(merit, name) for name in MERITS}
    return {name: value if math.isfinite(value) else None for name, value in found.items()}
