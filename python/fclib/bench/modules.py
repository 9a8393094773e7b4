"""Files of Python with solvers of the user's own, which a campaign names and its workers import."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from fclib import _registry
from fclib._regular import regular

_loaded: dict[str, str] = {}  # the files of those that are imported, by their names


def load_modules(paths: list[str]) -> None:
    """Import files of Python, once, so that the solvers in them are registered.

    Raises:
        fclib.SolverError: a file cannot be imported, or has the name of another module.
    """
    for path in paths:
        name = Path(path).stem
        if _loaded.get(name) == path and name in sys.modules:
            continue
        known = sys.modules.get(name)
        if known is not None and getattr(known, "__file__", None) == path:
            continue
        if name in sys.stdlib_module_names or (known is not None and name not in _loaded):
            raise _registry.SolverError(f"{path}: another module is called {name}; rename the file")
        spec = importlib.util.spec_from_file_location(name, path)
        if spec is None or spec.loader is None:
            raise _registry.SolverError(f"{path}: is no file of Python")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            regular(path)  # to read a pipe waits for ever
            spec.loader.exec_module(module)
        except (Exception, SystemExit) as error:
            del sys.modules[name]
            raise _registry.SolverError(f"{path}: {type(error).__name__}: {error}") from error
        _loaded[name] = path
