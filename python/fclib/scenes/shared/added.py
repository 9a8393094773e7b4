"""Families of other packages, which name them in the entry point group ``fclib.families``.

An entry point is a family's class, or a module: then its dataclasses with `scene` or `problem` are
families. A family that is not as it must be is left out, with a warning that says why; it keeps no
other one from being found.
"""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
import re
from collections.abc import Collection, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from fclib import _entry_points

GROUP = "fclib.families"
TEXTS = ("title", "description", "application", "authors", "friction", "collection")
# sets that consist of problems of other sets (collections/set_index.py)
LISTS = ("extended", "fclib2024", "hard", "open", "sequences", "standard", "tiny")
FOLDER = re.compile(r"\w[\w.-]*", re.ASCII)  # a set's name is that of a folder, too


def families_of(module: ModuleType) -> dict[str, Any]:
    """The families that a module defines, by name."""
    return {
        name: member
        for name, member in vars(module).items()
        if isinstance(member, type) and member.__module__ == module.__name__ and is_family(member)
    }


def is_family(member: type) -> bool:
    """Whether a class is a dataclass that makes scenes or problems."""
    return dataclasses.is_dataclass(member) and (
        hasattr(member, "scene") or hasattr(member, "problem")
    )


def families(own: Mapping[str, Any]) -> dict[str, Any]:
    """The families of other packages, by name.

    Args:
        own: fclib's families. Their names, and the names of their sets, are taken.
    """
    sets = {family.collection for family in own.values()} | set(LISTS)
    found: dict[str, Any] = {}
    for name, item in _entry_points.loaded(GROUP):
        members = [item]
        if isinstance(item, ModuleType):
            members = list(families_of(item).values())
        if not members:
            _entry_points.leave_out(GROUP, name, f"the module {item.__name__} has no family")
        for member in members:
            reason = fault(member, {*own, *found}, sets)
            if reason:
                _entry_points.leave_out(GROUP, name, reason)
            else:
                found[member.__name__] = member
    return found


def fault(member: Any, names: Collection[str], sets: Collection[str]) -> str:
    """What keeps an object from being a family; "" if nothing does.

    Args:
        member: the object of an entry point.
        names: names of other families.
        sets: sets that take no more families, since their problems never change.
    """
    if not isinstance(member, type):
        return f"{member!r} is neither a class nor a module"
    name = member.__name__
    if not is_family(member):
        return f"{name} is no dataclass with scene(seed) or problem(number, seed)"
    if name in names:
        return f"there is another family called {name}"
    texts = {text: getattr(member, text, None) for text in TEXTS}
    for text, value in texts.items():
        if not isinstance(value, str):
            return f"{name} has no text '{text}'"
    count = getattr(member, "problems", None)
    if not isinstance(count, int) or count < 1:
        return f"{name} has no number of 'problems'"
    for item in dataclasses.fields(member):
        if item.default is dataclasses.MISSING or not {"unit", "doc"} <= set(item.metadata):
            return f"{name}: '{item.name}' has no default, unit or meaning; write parameter(...)"
    own_set = str(texts["collection"])
    if own_set in sets:
        return f"{name} is in the set {own_set}, which is fclib's; name a set of your own"
    if not FOLDER.fullmatch(own_set):
        return f"{name} is in the set {own_set!r}: only letters, digits, _, - and . make a name"
    return ""


def digest_of_source(member: Any) -> str:
    """The SHA-256 of the file that defines a class; "" if there is no such file."""
    try:
        return hashlib.sha256(Path(inspect.getfile(member)).read_bytes()).hexdigest()
    except (OSError, TypeError):
        return ""
