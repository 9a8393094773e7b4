"""Files of Python with solvers of the user's own, which a campaign names and its workers import."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from fclib import _registry


def load_modules(paths: list[str]) -> None:
    """Import files of Python, once, so that the solvers in them are registered.

    Raises:
        fclib.SolverError: a file cannot be imported.
    """
    for path in paths:
        name = Path(path).stem
        known = sys.modules.get(name)
        if known is not None and getattr(known, "__file__", None) == path:
            continue
        spec = importlib.util.spec_from_file_location(name, path)
        if spec is None or spec.loader is None:
            raise _registry.SolverError(f"{path}: is no file of Python")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except Exception as error:
            del sys.modules[name]
            raise _registry.SolverError(f"{path}: {type(error).__name__}: {error}") from error
