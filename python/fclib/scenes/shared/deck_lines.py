"""The lines of the files of a deck of LMGC90, and errors that name them."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from fclib._regular import regular

_PAIR = re.compile(r"([A-Za-z_]\w*(?:\(\d\))?)\s*[=:]\s*(\S+)")


class DeckError(ValueError):
    """A deck that is wrong: the message names the file and the line."""


@dataclass(frozen=True)
class Place:
    """A line of a file."""

    path: Path
    line: int

    def __str__(self) -> str:
        return f"{self.path.name}:{self.line}"

    def fail(self, words: str) -> NoReturn:
        """Raise DeckError."""
        raise DeckError(f"{self.path}:{self.line}: {words}")


def number(text: str, place: Place, name: str) -> float:
    """A finite number as Fortran writes it, 0.1D+01. DeckError."""
    try:
        value = float(re.sub("[dD]", "e", text))
    except ValueError:
        place.fail(f"{name}: {text!r} is no number")
    if not math.isfinite(value):
        place.fail(f"{name}: {text!r} is not finite")
    return value


def whole(text: str, place: Place, name: str) -> int:
    """An integer. DeckError."""
    try:
        return int(text)
    except ValueError:
        place.fail(f"{name}: {text!r} is no whole number")


@dataclass(frozen=True)
class Line:
    """A line with words."""

    place: Place
    text: str

    @property
    def words(self) -> list[str]:
        """Its words."""
        return self.text.split()

    @property
    def values(self) -> list[tuple[str, str]]:
        """Its entries NAME= VALUE, in order."""
        return _PAIR.findall(self.text)

    def named(self, name: str) -> str:
        """The value of a name. DeckError if there is none."""
        for key, value in self.values:
            if key.lower() == name.lower():
                return value
        self.place.fail(f"has no {name}= (the line is cut, or another one was expected here)")

    def numbers(self, count: int, what: str) -> list[float]:
        """So many numbers NAME= VALUE. DeckError if there are fewer."""
        values = self.values
        if len(values) < count:
            self.place.fail(
                f"{what}: {count} numbers are expected here, and there are {len(values)}"
            )
        return [number(text, self.place, name) for name, text in values[:count]]


class Lines:
    """The lines of a file, after its heading, without comments."""

    def __init__(self, path: Path) -> None:
        content = regular(path).read_bytes()
        self.path, self.sha256 = path, hashlib.sha256(content).hexdigest()
        self.lines = []
        inside = False
        for i, text in enumerate(content.decode("latin-1").splitlines(), 1):
            stripped = text.strip()
            inside |= stripped.startswith("$")
            if inside and stripped and not stripped.startswith("!"):
                self.lines.append(Line(Place(path, i), stripped))
        self.next = 0
        self.end = Place(path, content.count(b"\n") + 1)

    def __bool__(self) -> bool:
        return self.next < len(self.lines)

    def peek(self) -> Line | None:
        """The next line; None at the end."""
        return self.lines[self.next] if self else None

    def take(self, what: str) -> Line:
        """The next line, inside of a record. DeckError if there is none."""
        if not self:
            self.end.fail(f"the file ends where {what} is expected")
        self.next += 1
        return self.lines[self.next - 1]

    def body(self) -> Iterator[Line]:
        """The lines up to the next keyword, which begins with $."""
        while self and not self.lines[self.next].text.startswith("$"):
            yield self.take("")


def keyword(line: Line) -> str:
    """The word after $, or empty."""
    return line.words[0][1:] if line.text.startswith("$") else ""
