"""Controls of a simulation from outside: a file's rows, or a function of time and state."""

from __future__ import annotations

import importlib
import sys
import traceback
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fclib._regular import regular, resolved
from fclib.simulate.simulation import Control, State

FILES = (".csv", ".npy")


def control_of(source: str) -> Control:
    """The controls of a name: FILE.csv, FILE.npy or MODULE:FUNCTION.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not a table of numbers, or there is no such function. Later: the function
            raises.
    """
    if Path(source).suffix in FILES:
        return control_of_rows(read_rows(Path(source)))
    return policy_of(source)


def control_of_rows(rows: np.ndarray) -> Control:
    """Row k (steps x nu) in step k; the last row stays in force."""

    def control(time: float, state: State) -> np.ndarray:
        chosen: np.ndarray = rows[min(state.index, len(rows) - 1)]
        return chosen

    return control


def read_rows(path: Path) -> np.ndarray:
    """The table (steps x nu) of a file: one line for each step. Raises OSError, ValueError."""
    try:
        if path.suffix == ".npy":
            rows = np.atleast_2d(
                np.asarray(np.load(regular(path), allow_pickle=False), dtype=float)
            )
        else:
            lines = regular(path).read_text(encoding="utf-8").splitlines()
            lines = [line for line in lines if line.partition("#")[0].strip()]
            rows = np.loadtxt(lines, delimiter=",", ndmin=2) if lines else np.zeros((0, 0))
    except (ValueError, EOFError) as error:
        raise ValueError(f"{path}: is no table of controls, steps x nu: {error}") from None
    if rows.ndim != 2 or not rows.size:
        raise ValueError(f"{path}: is no table of controls, steps x nu: shape {rows.shape}")
    return rows


def policy_of(name: str) -> Control:
    """The function MODULE:FUNCTION; a module may lie in the current folder. Raises ValueError.

    The module may also be a file; then the file's folder is searched first.
    """
    module, _, function = name.rpartition(":")
    if not function or not module:
        raise ValueError(f"{name!r}: is no MODULE:FUNCTION, and no .csv or .npy file")
    folder = Path.cwd()
    if module.endswith(".py"):
        file = resolved(module)
        if not file.is_file():
            raise ValueError(f"{name!r}: the module cannot be imported: there is no file {file}")
        folder, module = file.parent, file.stem
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))
    try:
        found = importlib.import_module(module)
    except ModuleNotFoundError as error:
        missing = error.name or module
        if module == missing or module.startswith(f"{missing}."):
            raise ValueError(
                f"{name!r}: the module cannot be imported: no module {missing!r} is installed, nor"
                f" is there a file {folder / missing.replace('.', '/')}.py"
            ) from None
        raise ValueError(
            f"{name!r}: the module cannot be imported: it imports {missing!r}, which is not"
            f" installed{place_of(error)}; install it for {sys.executable}"
        ) from error
    except Exception as error:
        raise ValueError(f"{name!r}: the module cannot be imported: {raised(error)}") from error
    policy = getattr(found, function, None)
    if not callable(policy):
        raise ValueError(f"{name!r}: {module} has no function {function!r}")

    def control(time: float, state: State) -> npt.ArrayLike:
        try:
            chosen: npt.ArrayLike = policy(time, state)
        except Exception as error:
            raise ValueError(f"{name!r}: in step {state.index} {raised(error)}") from error
        return chosen

    return control


def raised(error: Exception) -> str:
    """The error of foreign code and its place, in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}{place_of(error)}"


def place_of(error: Exception) -> str:
    """The last line of foreign code that an error passed through; empty if it passed none."""
    # an object that cannot be called or read has no line of its own
    ours = (__file__, importlib.__file__)
    theirs = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename not in ours and not frame.filename.startswith("<frozen ")
    ]
    return f", {Path(theirs[-1].filename).name}, line {theirs[-1].lineno}" if theirs else ""
