"""What the commands share about files that hold several things."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import fclib


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


def read_owner(path: Path) -> fclib.Problem:
    """The problem that a solution in the file belongs to: the global one if there are several.

    Raises:
        fclib.Error: the file cannot be read, or the problem is not valid.
    """
    return fclib.read(path, contents_of(path).owner)
