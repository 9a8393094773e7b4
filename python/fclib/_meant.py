"""What may have been meant by a name that there is not."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def meant(name: str, known: Iterable[str]) -> str:
    """A question with the nearest of the known names, to put before a list; "" where none is near.

    Capitals do not count.
    """
    names = {one.lower(): one for one in known}
    close = difflib.get_close_matches(name.lower(), names, 1)
    return f"did you mean {names[close[0]]}? " if close else ""
