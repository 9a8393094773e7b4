"""Check that a folder still agrees with its catalogue."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fclib import _core, _digest
from fclib._judge import MARK, Judgement, judge
from fclib.collections import catalog, published, set_index, trajectory

LACKING = ("unfinished", "not listed")  # statuses of entries that a catalogue lacks
ROUNDING = 1e-9  # relative difference of a matrix that is allowed on another machine


@dataclass(frozen=True)
class Verdict:
    """The result for one file."""

    id: str  # name of the problem; if the catalogue lacks the file or family, its path
    path: str  # from the catalogue's folder
    status: str  # "ok", or the fault: missing, changed, unreadable, ...
    error: float | None  # of the stored solution, by both maps, if it could be judged
    message: str = ""
    # origin of the form with the digest: "published", "differs" from the published, or "yours"
    origin: str = ""
    # relative difference from the published one, for each matrix that differs; see `distance`
    differences: Mapping[str, float] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether the file agrees with the catalogue."""
        return self.status == "ok"


def verify(folder: str | Path, progress: Callable[[str], None] | None = None) -> Iterator[Verdict]:
    """Hash each file of a folder again, read it, and judge its solutions from the data alone.

    A stored solution must be one, by the same judgement as `fclib check`; if there are several,
    each must be one. A file without one must say why. So no file is ok that `check` refuses. The
    data of the form that the catalogue describes must have the digest in the catalogue. A problem
    that has the name and version of a published one must be that one, up to rounding on another
    machine (ROUNDING). Entries that the catalogue lacks come last: families whose build was cut,
    and files without a row.

    Raises:
        CatalogError: the folder has no catalogue.
    """
    folder = Path(folder)
    rows = catalog.read_catalog(folder).to_pylist()
    for row in rows:
        for path, digest in catalog.files_of(row):
            if progress is not None:
                progress(path)
            yield verdict_on(folder, row["id"], path, digest, row)
    for family in catalog.unfinished(folder):
        message = f"{folder / family}: its build was cut, or goes on; the same command finishes it"
        yield Verdict(family, family, "unfinished", None, message)
    for path in catalog.lacking(folder, rows):
        yield Verdict(path, path, "not listed", None, f"{folder / path}: is not in the catalogue")


def verdict_on(folder: Path, name: str, path: str, digest: str, row: dict[str, Any]) -> Verdict:
    """Check one file."""
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
    origin, apart = "", dict[str, float]()
    if problem.formulation == row["formulation"]:
        if _digest.digest(problem) != row["digest"]:
            return Verdict(name, path, "wrong digest", None, f"{file}: holds another problem")
        origin = set_index.origin_of(row)
        if origin == "differs":
            apart = distance(problem, row)
            worst = max(apart, key=apart.__getitem__) if apart else "all of it"
            if not apart.get(worst, math.inf) <= ROUNDING:
                message = (
                    f"{file}: is not {name} of version {row['version']} as it is published; the"
                    f" largest relative difference is {apart.get(worst, math.inf):.1e}, in {worst}"
                )
                return Verdict(name, path, "not published", None, message, origin, apart)
    if solution is None:
        # an older catalogue had no status for a vector that is not a solution
        expected = row["has_solution"]
        if expected is None:
            expected = row["solver"] is not None
        if expected:
            return Verdict(name, path, "no solution", None, f"{file}: its solution is not there")
        if MARK not in _core.read_attributes(file, "info"):
            message = f"{file}: has no solution, and does not say why; build it anew"
            return Verdict(name, path, "no solution", None, message)
        return Verdict(name, path, "ok", None, "", origin, apart)
    try:
        judgement = judge(problem, solution)
        others = [judge(problem, one) for one in _core.read_solutions(file)]
    except _core.Error as reason:
        return Verdict(name, path, "unreadable", None, f"{file}: {reason}")
    for where, one in [("/solution", judgement), *numbered(others)]:
        if not one.ok:
            message = (
                f"{file}: {where}: is no solution, its error by both maps is {one.error:.1e};"
                f" it may be {one.tol:g}"
            )
            return Verdict(name, path, "wrong", one.error, message, origin, apart)
    return Verdict(name, path, "ok", judgement.error, "", origin, apart)


def numbered(several: Sequence[Judgement]) -> list[tuple[str, Judgement]]:
    """All known solutions, each with its place in the file."""
    return [(f"/solutions/{k}", one) for k, one in enumerate(several, 1)]


def distance(problem: Any, row: Mapping[str, Any]) -> dict[str, float]:
    """The distance of a problem from the published one of its name, for each matrix that differs.

    It is the largest difference of two entries over the largest entry. The published matrix comes
    from the shipped file, or from the problem that the stored state gives here, if that agrees with
    the published one up to rounding. Otherwise it is ||A - A'|| / ||A||, as
    `Trajectory.differences` estimates it. If only the digest is known, the result is empty.
    """
    folder = f"{row['collection']}/{row['family']}"
    if row["collection"] in set_index.SHIPPED:
        shipped = set_index.DATA / f"{folder}/{row['number']:04d}"
        for form in ("global", "local"):
            path = shipped.with_name(f"{shipped.name}-{form}.hdf5")
            if path.is_file():
                return _digest.difference(_core.read(path), problem)
    stored = published.path_of(folder, row["version"])
    if stored is None:
        return {}
    states = _states(stored)
    place = states.index(row["number"])
    estimate = states.differences(place, problem)
    if math.inf in estimate.values():
        return estimate
    try:
        own = states.problem(place).problem
    except ImportError:
        return estimate
    rounding = states.differences(place, own)
    if max(rounding.values(), default=0.0) > ROUNDING:
        return estimate
    apart = _digest.difference(own, problem)
    # the sums tell whether only this machine's rounding differs; they may even be equal
    return apart or rounding or dict.fromkeys(_digest.parts(problem), 0.0)


_states = functools.lru_cache(maxsize=2)(trajectory.read)
