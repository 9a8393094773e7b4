"""Clarabel, an interior-point method for conic programs: a wheel of PyPI.

Goulart & Chen, "Clarabel: an interior-point solver for conic programs with quadratic objectives"
(2024).
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import importlib.util
from collections.abc import Sequence
from typing import Any

import numpy as np

from fclib import _core

PREFIX = "clarabel:"
SOLVERS = "clarabel:aclm, clarabel:relaxation"


def missing() -> str:
    """The package to install."""
    return "" if importlib.util.find_spec("clarabel") else "pip install clarabel"


def version() -> str:
    """The version of the package."""
    return importlib.metadata.version("clarabel")


@functools.cache
def solvers() -> Sequence[_core.SolverInfo]:
    """The entries."""
    from fclib.external import _convex

    return _convex.entries(
        "clarabel", "the interior-point method Clarabel", "Goulart & Chen 2024", Conic
    )


class Conic:
    """One program for several c; each solve starts from Clarabel's own point."""

    def __init__(self, program: Any, tolerance: float) -> None:
        self.package = importlib.import_module("clarabel")
        self.settings = self.package.DefaultSettings()
        self.settings.verbose = False
        self.settings.presolve_enable = False  # presolve would allow no change of c
        self.settings.max_threads = 1
        self.settings.tol_feas = max(tolerance, 1e-14)
        # the solution is known to the root of the gap; a precision that cannot be reached is given
        # up soon
        self.settings.tol_gap_abs = self.settings.tol_gap_rel = max(tolerance**2, 1e-20)
        self.program = program
        self.solver: Any = None

    def solve(self, c: Any, x: Any, time_left: float) -> Any:
        """The solution; x is not used."""
        self.settings.time_limit = max(time_left, 1e-3)
        if self.solver is None:
            program = self.program
            cones = [self.package.ZeroConeT(program.zeros)] if program.zeros else []
            if program.nonnegatives:
                cones.append(self.package.NonnegativeConeT(program.nonnegatives))
            cones += map(self.package.SecondOrderConeT, program.cones)
            b = np.zeros(program.A.shape[0])
            self.solver = self.package.DefaultSolver(
                program.P, c, program.A, b, cones, self.settings
            )
        else:
            self.solver.update(q=c, settings=self.settings)
        return np.array(self.solver.solve().x)
