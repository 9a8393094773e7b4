"""SCS, an operator-splitting method for conic programs: a wheel of PyPI.

O'Donoghue, "Operator splitting for a homogeneous embedding of the linear complementarity problem"
(2021). It is meant for moderate accuracy.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import importlib.metadata
import importlib.util
import io
import math
import sys
import threading
from collections.abc import Sequence
from typing import Any

import numpy as np

from fclib import _core

PREFIX = "scs:"
SOLVERS = "scs:aclm, scs:relaxation"
MAX_ITERATIONS = 20_000  # largest number for one convex problem


def missing() -> str:
    """The package to install."""
    return "" if importlib.util.find_spec("scs") else "pip install scs"


def version() -> str:
    """The version of the package."""
    return importlib.metadata.version("scs")


@functools.cache
def solvers() -> Sequence[_core.SolverInfo]:
    """The entries."""
    from fclib.external import _convex

    return _convex.entries("scs", "the splitting conic solver SCS", "O'Donoghue 2021", Conic)


class _Others(io.TextIOBase):
    """Standard output for other threads: SCS always prints failures, so this thread is silenced."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream
        self.silent = threading.get_ident()

    def write(self, text: str) -> int:
        if self.stream is None or threading.get_ident() == self.silent:
            return len(text)
        return int(self.stream.write(text))

    def flush(self) -> None:
        if self.stream is not None:
            self.stream.flush()


_start = threading.Lock()  # only one thread at a time may redirect standard output


class Conic:
    """One program for several c, each solve from the last one's solution."""

    def __init__(self, program: Any, tolerance: float) -> None:
        self.package = importlib.import_module("scs")
        self.program = program
        self.tolerance = max(tolerance, 1e-14)
        self.solver: Any = None

    def solve(self, c: Any, x: Any, time_left: float) -> Any:
        """The solution. Raises ArithmeticError if SCS cannot begin."""
        program = self.program
        if self.solver is None:
            data = {"P": program.P, "A": program.A, "b": np.zeros(program.A.shape[0]), "c": c}
            cones = {"z": program.zeros, "l": program.nonnegatives, "q": list(program.cones)}
            try:
                with _start, contextlib.redirect_stdout(_Others(sys.stdout)):
                    self.solver = self.package.SCS(
                        data,
                        cones,
                        verbose=False,
                        eps_abs=self.tolerance,
                        eps_rel=0.0,
                        max_iters=MAX_ITERATIONS,
                        time_limit_secs=time_left if math.isfinite(time_left) else 0.0,
                    )
            except ValueError as error:  # W is not positive semidefinite, or too large a number
                raise ArithmeticError(str(error)) from error
            return self.solver.solve(warm_start=True, x=x)["x"]
        self.solver.update(c=c)
        return self.solver.solve(warm_start=True)["x"]
