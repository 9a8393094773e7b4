"""What installed packages add to FCLIB: the objects of their entry points."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Iterator
from typing import Any


@functools.cache
def listed(group: str) -> tuple[Any, ...]:
    """The entry points of a group, by name, from all installed packages; none is loaded."""
    from importlib.metadata import entry_points

    return tuple(sorted(entry_points(group=group), key=lambda point: point.name))


def loaded(group: str) -> Iterator[tuple[str, Any]]:
    """The name and the object of each entry point. One that cannot be loaded is left out."""
    for point in listed(group):
        try:
            found = point.load()
        except Exception as error:
            leave_out(group, point.name, f"cannot be loaded: {error!r}")
        else:
            yield point.name, found


def leave_out(group: str, name: str, reason: str) -> None:
    """Warn that an entry point is left out. The others are used."""
    message = f"entry point {name} of {group}: {reason}; it is left out"
    warnings.warn(message, RuntimeWarning, stacklevel=3)
