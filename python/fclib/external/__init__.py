"""Solvers of other packages and programs, behind the contract of our own.

One file, one adapter, found by being here. An adapter has

    PREFIX       of its solvers' names, ``siconos:``
    SOLVERS      what it offers, in words
    missing()    what is to be installed, empty where nothing is
    version()    of the package, where nothing is missing; empty where it tells none
    solvers()    its entries, where nothing is missing
    find(name)   the entry of this name, or None

The package is an entry point of ``fclib.solvers``, like a user's own.
"""

from __future__ import annotations

import functools
import importlib
import pkgutil
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from fclib import _core


class Adapter(Protocol):
    """What a module of this folder has."""

    PREFIX: str
    SOLVERS: str

    def missing(self) -> str:
        """What is to be installed, empty where nothing is."""

    def version(self) -> str:
        """The version of the package, where nothing is missing; empty where it tells none."""

    def solvers(self) -> Sequence[_core.SolverInfo]:
        """The entries, where nothing is missing."""

    def find(self, name: str) -> _core.SolverInfo | None:
        """The entry of a name that begins with the prefix."""


@dataclass(frozen=True)
class Absent:
    """Solvers that could be here, and what is missing."""

    solvers: str
    missing: str


@functools.cache
def adapters() -> tuple[Adapter, ...]:
    """The modules of this folder, by name."""
    names = sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_"))
    return tuple(importlib.import_module(f"{__name__}.{name}") for name in names)


def solvers() -> list[_core.SolverInfo]:
    """Those that can be used here."""
    return [info for adapter in adapters() if not adapter.missing() for info in adapter.solvers()]


def absent() -> list[Absent]:
    """Those that cannot be used here."""
    missing = [(adapter.SOLVERS, adapter.missing()) for adapter in adapters()]
    return [Absent(solvers, word) for solvers, word in missing if word]


def find(name: str) -> _core.SolverInfo | None:
    """The solver of this name, where its prefix is that of an adapter.

    Raises:
        OptionError: something must be installed for it, or the adapter has no such solver.
    """
    for adapter in adapters():
        if not name.startswith(adapter.PREFIX):
            continue
        if word := adapter.missing():
            raise _core.OptionError(f"solver '{name}': {word}")
        found = adapter.find(name)
        if found is None:
            known = ", ".join(info.name for info in adapter.solvers())
            raise _core.OptionError(f"solver '{name}': unknown; there is: {known}")
        return found
    return None
