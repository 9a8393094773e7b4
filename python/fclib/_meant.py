"""Suggestions for an unknown name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def meant(name: str, known: Iterable[str]) -> str:
    """A question with the nearest of the known names, to put before a list; "" if none is near.

    Upper and lower case are equal.
    """
    names = {one.lower(): one for one in known}
    close = difflib.get_close_matches(name.lower(), names, 1)
    return f"did you mean {names[close[0]]}? " if close else ""
