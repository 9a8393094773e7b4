"""Solvers of one's own in C or C++, in a shared object: ``plugin:PATH``, by include/fclib_plugin.h.

The function is called in the process of the caller, in its thread and without Python's lock; what
it does to that process is its own affair. A campaign runs each solver in processes of its own.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib import _core
from fclib._registry import make_solver

PREFIX = "plugin:"
SOLVERS = "plugin:./libmine.so"
FUNCTION = "fclib_plugin_solve"
Stop = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(ctypes.c_double))


class Given(ctypes.Structure):
    """struct fclib_plugin_problem."""

    _fields_ = (
        ("size", ctypes.c_int),
        ("spacedim", ctypes.c_int),
        ("contacts", ctypes.c_int),
        ("start", ctypes.c_void_p),
        ("column", ctypes.c_void_p),
        ("value", ctypes.c_void_p),
        ("q", ctypes.c_void_p),
        ("mu", ctypes.c_void_p),
        ("tolerance", ctypes.c_double),
        ("stop", Stop),
        ("context", ctypes.c_void_p),
    )


class Plugin:
    """The function of a shared object, as a solver in Python is one."""

    def __init__(self, path: Path) -> None:
        """Load a shared object.

        Raises:
            OptionError: it cannot be loaded, or has no such function.
        """
        self.path = path
        if not path.is_file():
            raise _core.OptionError(f"solver '{PREFIX}{path}': there is no such file")
        try:
            self._solve = getattr(ctypes.CDLL(str(path.resolve())), FUNCTION)
        except OSError as error:
            raise _core.OptionError(f"solver '{PREFIX}{path}': cannot be loaded: {error}") from None
        except AttributeError:
            raise _core.OptionError(
                f"solver '{PREFIX}{path}': has no function {FUNCTION} (include/fclib_plugin.h)"
            ) from None
        self._solve.argtypes = [ctypes.POINTER(Given), ctypes.c_void_p]
        self._solve.restype = ctypes.c_int

    def __call__(
        self, problem: _core.LocalProblem, r: npt.NDArray[np.float64], monitor: _core.Monitor
    ) -> npt.NDArray[np.float64]:
        """Solve a problem.

        Raises:
            ValueError: the function returned another number than 0.
        """
        W = sp.csr_array(problem.W)
        start, column = (np.ascontiguousarray(a, dtype=np.intc) for a in (W.indptr, W.indices))
        value, q, mu = (
            np.ascontiguousarray(a, dtype=np.float64) for a in (W.data, problem.q, problem.mu)
        )
        result = np.array(r, dtype=np.float64)
        raised: list[BaseException] = []

        def stop(_: Any, iterate: Any) -> int:
            try:
                return int(monitor.stop(np.ctypeslib.as_array(iterate, shape=(result.size,))))
            except BaseException as error:  # told once the function has returned
                raised.append(error)
                return 1

        callback = Stop(stop)
        given = Given(
            ctypes.sizeof(Given),
            problem.spacedim,
            problem.nc,
            start.ctypes.data,
            column.ctypes.data,
            value.ctypes.data,
            q.ctypes.data,
            mu.ctypes.data,
            monitor.tolerance,
            callback,
            None,
        )
        code = self._solve(ctypes.byref(given), result.ctypes.data)
        if raised:
            raise raised[0]
        if code:
            raise ValueError(f"{self.path}: {FUNCTION} returned {code}")
        return result


def missing() -> str:
    """Nothing is to be installed."""
    return ""


def version() -> str:
    """None: a shared object is asked for nothing but solutions."""
    return ""


def solvers() -> Sequence[_core.SolverInfo]:
    """None is listed: their names are paths."""
    return ()


def find(name: str) -> _core.SolverInfo:
    """The entry of a shared object.

    Raises:
        OptionError: it cannot be loaded, or has no such function.
    """
    return make_solver(
        Plugin(Path(name.removeprefix(PREFIX))),
        name=name,
        family="plugin",
        title="A function of a shared object",
        citation="",
        origin="plugin",
        dimensions=(2, 3),
        rolling_dimensions=(),
        max_iterations=1_000_000,
    )
