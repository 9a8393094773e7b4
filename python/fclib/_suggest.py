"""Suggestions for an unknown name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

NEAREST = 5  # names that a suggestion has, if the list of all is long


def nearest(name: str, known: Iterable[str]) -> str:
    """The names that are nearest to one, the best first: "nsgs, nsip"."""
    names = {one.lower(): one for one in known}
    close = difflib.get_close_matches(name.lower(), names, NEAREST, cutoff=0)
    return ", ".join(names[one] for one in close)


def suggestion(name: str, known: Iterable[str]) -> str:
    """A question with the nearest of the known names, to put before a list; "" if none is near.

    Upper and lower case are equal.
    """
    names = {one.lower(): one for one in known}
    close = difflib.get_close_matches(name.lower(), names, 1)
    return f"did you mean {names[close[0]]}? " if close else ""
