"""Families of scenes: one family, one file.

A family is a frozen dataclass of parameters with a method ``scene(seed)``. A file dropped into
this folder is found by a scan; nothing else names it. `_family.py` says what a family must have.

    >>> import fclib.scenes
    >>> sorted(fclib.scenes.families())
    ['BoxesStack']
    >>> scene = fclib.scenes.get("BoxesStack")(boxes=8).scene(seed=0)
"""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil
from typing import TypeGuard

from fclib.scenes._family import Family, Law, Scene, parameter

__all__ = ["Family", "Law", "Scene", "families", "get", "parameter"]


def families() -> dict[str, type[Family]]:
    """The families found in this folder, by name, in alphabetical order."""
    found: dict[str, type[Family]] = {}
    for module_info in pkgutil.iter_modules(__path__):
        if module_info.name.startswith("_"):
            continue
        module = importlib.import_module(f"{__name__}.{module_info.name}")
        for name, member in vars(module).items():
            if is_family(member) and member.__module__ == module.__name__:
                found[name] = member
    return dict(sorted(found.items()))


def is_family(member: object) -> TypeGuard[type[Family]]:
    """Whether a member of a module is a family: a dataclass that makes scenes."""
    return (
        isinstance(member, type) and dataclasses.is_dataclass(member) and hasattr(member, "scene")
    )


def get(name: str) -> type[Family]:
    """The family called `name`. KeyError, with the known names, where there is none."""
    known = families()
    if name not in known:
        raise KeyError(f"no family of scenes is called {name!r}; known: {', '.join(known)}")
    return known[name]
