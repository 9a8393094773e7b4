"""A user's own solvers in C or C++, in a shared object: ``plugin:PATH``, by include/fclib_plugin.h.

The core loads and calls it, in the process and the thread of the caller and without Python's lock;
what it does to that process is its own affair. A campaign runs each solver in processes of its own.
"""

from __future__ import annotations

from collections.abc import Sequence

from fclib import _core

PREFIX = "plugin:"
SOLVERS = "plugin:./libmine.so"


def missing() -> str:
    """Nothing is to be installed."""
    return ""


def version() -> str:
    """None: a shared object has no version."""
    return ""


def solvers() -> Sequence[_core.SolverInfo]:
    """None is listed: their names are paths."""
    return ()


def find(name: str) -> _core.SolverInfo:
    """The entry of a shared object.

    Raises:
        OptionError: it cannot be loaded, or has no such function.
    """
    return _core.find_solver(name)
