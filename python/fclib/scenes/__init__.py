"""Families of problems: one family, one file.

A family is a frozen dataclass of parameters with a method ``scene(seed)``, for what is simulated,
or ``problem(number, seed)``, for what is assembled directly. A file dropped into this folder is
found by a scan; nothing else names it. `shared/family.py` says what a family must have, and the
package `shared` holds what families are made with. A variant of a family is a subclass of it, in
its file or in one of its own (`chute.py`, `rolling_chute.py`).

An installed package adds families by the entry point group ``fclib.families``: a class, or a
module with classes. They are used like those of this folder (`shared/added.py`).

    >>> import fclib.scenes
    >>> sorted(fclib.scenes.families())
    ['BoxesStack']
    >>> scene = fclib.scenes.get("BoxesStack")(boxes=8).scene(seed=0)
"""

from __future__ import annotations

import functools
import importlib
import pkgutil
from typing import Any

from fclib._suggest import suggestion
from fclib.scenes.shared import added
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
    """All families, by name: those of this folder, and those that installed packages add."""
    members = own()
    return tuple(sorted({**added.families(members), **members}.items()))


@functools.cache
def own() -> dict[str, Any]:
    """The families of this folder's files, by name."""
    members: dict[str, Any] = {}
    for module_info in pkgutil.iter_modules(__path__):
        if not module_info.ispkg:  # a package has what families share
            module = importlib.import_module(f"{__name__}.{module_info.name}")
            members |= added.families_of(module)
    return members


def identity_of(name: str) -> dict[str, str]:
    """What decides the problems of a family, beside its parameters, its seed and fclib's version.

    Of a family of another package it is its file.
    """
    others = dict(found())
    if name in own() or name not in others:
        return {}
    return {"family_sha256": added.digest_of_source(others[name])}


def get(name: str) -> type[Family]:
    """The family of scenes called `name`. If there is none, a KeyError has the known names."""
    known = families()
    if name not in known:
        raise KeyError(
            f"no family of scenes is called {name!r}; {suggestion(name, known)}"
            f"there is: {', '.join(known)}"
        )
    return known[name]
