"""The files of a campaign: their list, and the facts that a campaign needs of each problem."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from fclib import _core, _digest, _sequence
from fclib._origin import origin_of
from fclib._regular import resolved
from fclib._words import counted
from fclib.bench.job import ProblemFacts

T = TypeVar("T")

SUFFIXES = (".hdf5", ".h5")
FORM = re.compile(r"(.+)-(global|local)")  # the stem of a file with one form of a problem


def files_of(
    patterns: Sequence[str],
    base: Path,
    form: str | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> list[Path]:
    """The FCLIB files that patterns stand for: files, folders with all below them, globs.

    A sequence stands for its steps, and "run.h5#17" for one of them. Two files NAME-global and
    NAME-local of one folder are the forms of one problem.

    Args:
        patterns: files, folders or globs.
        base: the folder that they are relative to.
        form: of a problem with both forms: "global", "local" or "both"; None takes the global one,
            and each file that is named by itself.
        tell: called with the number of files that are left out, if there are any.

    Raises:
        fclib.FileError: a pattern matches no file.
    """
    found: dict[Path, bool] = {}  # whether it is named by itself
    for pattern in patterns:
        path = Path(os.path.expandvars(pattern)).expanduser()
        path = path if path.is_absolute() else base / path
        if path.is_dir():
            matches = [p for p in path.rglob("*") if p.suffix in SUFFIXES]
        elif _sequence.place_of(path)[0].is_file():
            matches = [path]
        else:
            matches = [p for p in _glob(path) if p.is_file()]
        if not matches:
            raise _core.FileError(
                f"{path}: there is no such file, and none in such a folder{_how_to_have(path)}"
            )
        for match in sorted(map(resolved, matches)):
            for one in _sequence.expanded(match):
                found[one] = path.is_file() or found.get(one, False)
    if form == "both":
        return list(found)
    kept, dropped = ("local", "global") if form == "local" else ("global", "local")
    left = set()
    for path, named in found.items():
        own = FORM.fullmatch(path.stem)
        if own is None or own[2] != dropped or (named and form is None):
            continue
        if path.with_name(f"{own[1]}-{kept}{path.suffix}") in found:
            left.add(path)
    if left:
        tell(
            f"left out: {counted(len(left), 'file')}, the first is {min(left)}; each has the"
            f' {dropped} form of a problem whose {kept} form is run; form = "both" runs both'
        )
    return [path for path in found if path not in left]


def _how_to_have(path: Path) -> str:
    """The command that builds the problems that a folder of the collection lacks; "" elsewhere."""
    from fclib.collections import library, sets

    try:
        name, *parts = path.relative_to(library.default_folder()).parts
    except ValueError:
        return ""
    if name not in sets():
        return ""
    family = f"/{parts[0]}" if parts and not any(c in parts[0] for c in "*?[") else ""
    folder = f" --out {library.default_folder()}"
    return f"; it is built by: fclib collection build {name}{family}{folder}"


def check_names(path: str, kind: str) -> None:
    """Whether a problem names its contacts, so that a guess can go from step to step.

    Raises:
        fclib.Error: it does not, or cannot be read.
    """
    if _core.read(path, kind).contacts is None:
        raise _core.Error(
            f"{path}: does not name its contacts (/contacts), and a sequence carries the reactions"
            " of each contact to the next step by its name"
        )


def _glob(path: Path) -> Iterator[Path]:
    parts = path.parts
    fixed = next((k for k, part in enumerate(parts) if any(c in part for c in "*?[")), len(parts))
    folder = Path(*parts[:fixed])
    return folder.glob(str(Path(*parts[fixed:]))) if fixed < len(parts) else iter(())


def sample(items: list[T], count: int | None) -> list[T]:
    """So many of the items, spread evenly; one is the middle one. Without a count: all."""
    if count is None or count >= len(items):
        return items
    first = 0 if count > 1 else (len(items) - 1) / 2
    chosen = np.linspace(first, len(items) - 1, count).round().astype(int)
    return [items[k] for k in chosen]


def look(path: Path, family: str = "") -> ProblemFacts:
    """The facts of the problem of a file; if there are several, of the global one.

    Args:
        path: an FCLIB file.
        family: if empty, the scene that the problem names, or else the folder's name.

    Raises:
        fclib.Error: it cannot be read.
    """
    kinds = _core.kinds(path)
    kind = "global" if "global" in kinds else kinds[0] if kinds else None
    problem = _core.read(path, kind)
    stem = _sequence.name_of(path)
    matrix: Any = getattr(problem, "W", None)
    if matrix is None:
        matrix = getattr(problem, "M", None)
    return ProblemFacts(
        hash=_digest.digest(problem),
        name=f"{path.parent.name}/{stem}" if stem[0].isdigit() else stem,
        family=family or str(origin_of(problem.info).get("scene", "")) or _sequence.family_of(path),
        path=str(path),
        kind=problem.kind,
        formulation=problem.formulation,
        spacedim=problem.spacedim,
        n=problem.n,
        p=problem.p,
        nc=problem.nc,
        nnz=int(getattr(matrix, "nnz", getattr(matrix, "size", 0))),
        title=problem.info.title,
    )
