"""Solvers of other packages and programs, behind the contract of our own.

Each file in this folder is one adapter. An adapter has

    PREFIX       prefix of its solvers' names, for example ``siconos:``
    SOLVERS      its solvers, in words
    missing()    the package to install; empty if nothing is missing
    version()    version of the package, if nothing is missing; empty if it has none
    solvers()    its entries, if nothing is missing
    find(name)   the entry of this name; not there if solvers() has them all

The package is an entry point of ``fclib.solvers``, like a user's own.
"""

from __future__ import annotations

import functools
import importlib
import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from fclib import _core


class Adapter(Protocol):
    """The contents of a module of this folder."""

    PREFIX: str
    SOLVERS: str

    def missing(self) -> str:
        """The package to install; empty if nothing is missing."""

    def version(self) -> str:
        """The version of the package, if nothing is missing; empty if it has none."""

    def solvers(self) -> Sequence[_core.SolverInfo]:
        """The entries, if nothing is missing."""


@dataclass(frozen=True)
class Absent:
    """Solvers that are not installed, and the missing packages."""

    solvers: str
    missing: str


@functools.cache
def adapters() -> tuple[Adapter, ...]:
    """The modules of this folder, by name."""
    names = sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_"))
    return tuple(importlib.import_module(f"{__name__}.{name}") for name in names)


def solvers() -> list[_core.SolverInfo]:
    """The adapters that can be used here."""
    return [info for adapter in adapters() if not adapter.missing() for info in adapter.solvers()]


def absent() -> list[Absent]:
    """The adapters that cannot be used here."""
    missing = [(adapter.SOLVERS, adapter.missing()) for adapter in adapters()]
    return [Absent(solvers, word) for solvers, word in missing if word]


def find(name: str) -> _core.SolverInfo | None:
    """The solver of this name, if its prefix is that of an adapter.

    Raises:
        OptionError: something must be installed for it, or the adapter has no such solver.
    """
    for adapter in adapters():
        if not name.startswith(adapter.PREFIX):
            continue
        if word := adapter.missing():
            raise _core.OptionError(f"solver '{name}': cannot be used here: {word}")
        own: Callable[[str], _core.SolverInfo] | None = getattr(adapter, "find", None)
        if own:
            return own(name)
        entries = {info.name: info for info in adapter.solvers()}
        if name not in entries:
            raise _core.OptionError(f"solver '{name}': unknown; there is: {', '.join(entries)}")
        return entries[name]
    return None
