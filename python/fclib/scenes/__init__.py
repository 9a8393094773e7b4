"""Families of problems: one family, one file.

A family is a frozen dataclass of parameters with a method ``scene(seed)``, for what is simulated,
or ``problem(number, seed)``, for what is assembled directly. A file dropped into this folder is
found by a scan; nothing else names it. `shared/family.py` says what a family must have, and the
package `shared` holds what families are made with. A variant of a family is a subclass of it, in
its file or in one of its own (`chute.py`, `rolling_chute.py`).

    >>> import fclib.scenes
    >>> sorted(fclib.scenes.families())
    ['BoxesStack']
    >>> scene = fclib.scenes.get("BoxesStack")(boxes=8).scene(seed=0)
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
import pkgutil
from typing import Any

from fclib._suggest import suggestion
from fclib.scenes.shared.family import Assembled, Assembly, Described, Family, Law, Scene, parameter

__all__ = [
    "Assembled",
    "Assembly",
    "Described",
    "Family",
    "Law",
    "Scene",
    "assemblies",
    "families",
    "get",
    "parameter",
]


def families() -> dict[str, type[Family]]:
    """The families of scenes, by name, in alphabetical order."""
    return {name: member for name, member in found() if hasattr(member, "scene")}


def assemblies() -> dict[str, type[Assembly]]:
    """The families whose problems are assembled directly, by name, in alphabetical order."""
    return {name: member for name, member in found() if hasattr(member, "problem")}


@functools.cache
def found() -> tuple[tuple[str, Any], ...]:
    """The dataclasses of this folder's files, by name."""
    members: dict[str, Any] = {}
    for module_info in pkgutil.iter_modules(__path__):
        if module_info.ispkg:  # what families share
            continue
        module = importlib.import_module(f"{__name__}.{module_info.name}")
        for name, member in vars(module).items():
            own = isinstance(member, type) and member.__module__ == module.__name__
            if own and dataclasses.is_dataclass(member):
                members[name] = member
    return tuple(sorted(members.items()))


def get(name: str) -> type[Family]:
    """The family of scenes called `name`. If there is none, a KeyError has the known names."""
    known = families()
    if name not in known:
        raise KeyError(
            f"no family of scenes is called {name!r}; {suggestion(name, known)}"
            f"there is: {', '.join(known)}"
        )
    return known[name]
