"""Sequences: files of many problems. A step of one is a path too, "run.h5#000017"."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from fclib import _core
from fclib._solve import Problem
from fclib._words import counted

SUFFIXES = (".h5", ".hdf5")  # of a name that is that of a file, and not of a folder
STEP = re.compile(r"(.+)#([0-9]+)", re.DOTALL)


def place_of(path: str | os.PathLike[str]) -> tuple[Path, int | None]:
    """The file that a path leads to, and the step in it; None if the path is a file of its own."""
    found = STEP.fullmatch(os.fspath(path))
    if found is None or Path(path).exists() or not Path(found[1]).exists():
        return Path(path), None
    return Path(found[1]), int(found[2])


def expanded(path: Path) -> list[Path]:
    """The steps of a sequence; of another file, or of a sequence without a step, the path itself.

    Raises:
        fclib.FileError: the file cannot be read.
    """
    found = _core.steps(path) if path.is_file() else None
    if not found:
        return [path]
    return [Path(_core.step_path(path, k)) for k in range(len(found))]


def steps_or_file(path: Path) -> list[Path]:
    """The steps of a sequence, or the file itself: reading says what is wrong with it."""
    try:
        return expanded(path)
    except _core.Error:
        return [path]


def name_of(path: Path) -> str:
    """A name for a file of a problem, without folder and suffix: run-000017 for a step."""
    file, step = place_of(path)
    return file.stem if step is None else f"{file.stem}-{step:06d}"


def family_of(path: Path) -> str:
    """The folder of a file; of a step, the sequence."""
    file, step = place_of(path)
    return file.parent.name if step is None else file.stem


def copy(path: Path, target: Path) -> None:
    """Copy a file; a step becomes a file of its own, which libfclib 3.1 reads.

    Raises:
        fclib.Error: the step cannot be read, or the file not be written.
        OSError: the same of a file.
    """
    if place_of(path)[1] is None:
        shutil.copyfile(path, target)
        return
    solution, told = _core.read_solution(path), _core.read_attributes(path, "solution")
    _core.write(target, _core.read(path), solution, _core.read_guesses(path))
    if told:
        _core.write_attributes(target, "solution", told)


def content(path: Path) -> bytes:
    """The bytes of that file.

    Raises:
        fclib.Error: a step cannot be read.
        OSError: a file cannot be read.
    """
    if place_of(path)[1] is None:
        return path.read_bytes()
    with tempfile.TemporaryDirectory(prefix="fclib-step-") as folder:
        file = Path(folder) / "step.hdf5"
        copy(path, file)
        return file.read_bytes()


class Sequence:
    """The problems of a sequence, read when they are asked for.

    >>> steps = fclib.Sequence("run.h5")
    >>> len(steps), steps[17], steps.solution(17)

    Its length is that of the file when it was opened; ``refresh`` looks again, if a simulation
    still writes to it. ``worlds`` and ``numbers`` say of each step which simulation it is of, and
    which of its steps.

    Raises:
        FileError: the file cannot be read, or is no sequence.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Look how many steps there are."""
        self._path = Path(path)
        self.refresh()

    def refresh(self) -> None:
        """Look for new steps."""
        found = _core.steps(self._path)
        if found is None:
            raise _core.FileError(f"{self._path}: is no sequence, but one problem: use fclib.read")
        self.worlds = [world for world, _ in found]
        self.numbers = [number for _, number in found]

    def __len__(self) -> int:
        """How many steps there are."""
        return len(self.worlds)

    def path(self, k: int) -> str:
        """The path of a step, for all functions that read files.

        Raises:
            IndexError: there is no such step.
        """
        step = k + len(self) if k < 0 else k
        if not 0 <= step < len(self):
            raise IndexError(
                f"{self._path} has {counted(len(self), 'step')}, and none of number {k}"
            )
        return _core.step_path(self._path, step)

    def __getitem__(self, k: int) -> Problem:
        """The problem of a step."""
        return _core.read(self.path(k))

    def __iter__(self) -> Iterator[Problem]:
        """The problems in their order."""
        return (self[k] for k in range(len(self)))

    def solution(self, k: int) -> _core.Solution | None:
        """The solution of a step, or None."""
        return _core.read_solution(self.path(k))

    def guesses(self, k: int) -> list[_core.Solution]:
        """The guesses of a step."""
        return _core.read_guesses(self.path(k))

    def __repr__(self) -> str:
        """Say the path and the length."""
        return f"<Sequence {self._path}: {counted(len(self), 'step')}>"
