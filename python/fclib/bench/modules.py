"""Solvers of the user's own that a campaign loads: files of Python, and shared objects."""

from __future__ import annotations

import importlib.util
import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Final

from fclib import _core, _registry
from fclib._regular import regular
from fclib.external import plugin

TRIED: Final = "tried:"  # before what a process says that has loaded a shared object
TRY: Final = f"""
import json, sys
sys.path[:] = json.loads(sys.argv[2])
import fclib
fault = ""
try:
    fclib.find_solver(sys.argv[1])
except fclib.OptionError as error:
    fault = str(error)
except Exception as error:
    fault = f"solver '{{sys.argv[1]}}': loading it raises: {{error}}"
print({TRIED!r} + fault, flush=True)
"""
PATIENCE: Final = 60.0  # [s] for the code that a shared object runs when it is loaded

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


def try_plugin(name: str) -> None:
    """Load a shared object in another process first: what it runs then may end the process.

    Raises:
        fclib.OptionError: it cannot be loaded, ends the process, or takes for ever. If there is no
            such file, whoever loads it says so.
    """
    if not (name.startswith(plugin.PREFIX) and Path(name.removeprefix(plugin.PREFIX)).is_file()):
        return
    command = [sys.executable, "-c", TRY, name, json.dumps(sys.path)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        fault = f"solver '{name}': takes more than {PATIENCE:g} s to be loaded"
        raise _core.OptionError(fault) from None
    _, tried, fault = done.stdout.decode(errors="replace").partition(TRIED)
    if not tried:
        ended = f"exit status {done.returncode}"
        if done.returncode < 0:
            ended = signal.Signals(-done.returncode).name
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        last = f": {lines[-1].strip()[:300]}" if lines else ""
        fault = f"solver '{name}': ends the process that loads it ({ended}){last}"
    if fault.strip():
        raise _core.OptionError(fault.strip())
