"""What the commands share about files that hold several things."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import fclib
from fclib import _sequence
from fclib.cli._output import fail


@dataclass(frozen=True)
class Contents:
    """The problems of a file, by their kinds, and the one to which all else belongs."""

    kinds: tuple[str, ...]
    owner: str | None
    solution: bool
    guesses: bool
    solutions: bool


def contents_of(path: Path) -> Contents:
    """The content of a file.

    Raises:
        fclib.FileError: the file cannot be read.
    """
    names = fclib.contents(path)
    others = ("solution", "guesses", "solutions")
    kinds = tuple(name for name in names if name not in others)
    owner = "global" if "global" in kinds else kinds[0] if kinds else None
    return Contents(kinds, owner, *(name in names for name in others))


def keep_input(output: Path | None, *inputs: Path) -> None:
    """End the command if the output would replace what it reads: a file, or one of a folder."""
    if output is None or not output.is_file():
        return
    for one in inputs:
        read, _ = _sequence.place_of(one)
        if read.is_dir() and output.suffix in _sequence.SUFFIXES:
            read /= output.name
        if read.is_file() and read.samefile(output):
            fail(f"{output}: is what is read, and would be replaced; name another file")


def read_owner(path: Path) -> fclib.Problem:
    """The problem that a solution in the file belongs to: the global one if there are several.

    Raises:
        fclib.Error: the file cannot be read, or the problem is not valid.
    """
    return fclib.read(path, contents_of(path).owner)
