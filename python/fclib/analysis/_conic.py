"""Conic programs for Clarabel: s = b - A x in zeros, nonnegatives and second-order cones."""

from __future__ import annotations

import importlib
import importlib.util
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp

from fclib.analysis._data import Array, Data

MISSING = 'the analysis needs Clarabel: pip install "fclib[analysis]"'


def available() -> bool:
    """Whether Clarabel is installed."""
    return importlib.util.find_spec("clarabel") is not None


@dataclass
class Program:
    """min 1/2 x^T P x + c^T x subject to the constraints added."""

    size: int
    zeros: list[tuple[Any, Array]] = field(default_factory=list)
    nonnegatives: list[tuple[Any, Array]] = field(default_factory=list)
    cones: list[tuple[Any, Array, int]] = field(default_factory=list)

    def equal(self, B: Any, e: Array) -> None:
        """B x = e."""
        self.zeros.append((sp.csr_array(B), e))

    def nonnegative(self, B: Any, c: Array) -> None:
        """B x + c >= 0."""
        self.nonnegatives.append((-sp.csr_array(B), c))

    def second_order(self, B: Any, c: Array, size: int) -> None:
        """B x + c in cones of `size` rows each, the first row bounds the norm of the others."""
        if c.size:
            self.cones.append((-sp.csr_array(B), c, size))

    def solve(self, c: Array, P: Any = None, tol: float = 1e-10, time_limit: float = 60.0) -> Any:
        """Clarabel's answer. Without Clarabel an ImportError says what to install."""
        if not available():
            raise ImportError(MISSING)
        clarabel = importlib.import_module("clarabel")
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.time_limit = time_limit
        settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = tol
        cones = [clarabel.ZeroConeT(e.size) for _, e in self.zeros if e.size]
        cones += [clarabel.NonnegativeConeT(b.size) for _, b in self.nonnegatives if b.size]
        for _, b, size in self.cones:
            cones += [clarabel.SecondOrderConeT(size)] * (b.size // size)
        rows = [*self.zeros, *self.nonnegatives, *((B, b) for B, b, _ in self.cones)]
        A = sp.csc_array(sp.vstack([B for B, _ in rows]))
        b = np.concatenate([b for _, b in rows])
        quadratic = sp.csc_array((self.size, self.size)) if P is None else sp.triu(P, format="csc")
        return clarabel.DefaultSolver(quadratic, c, A, b, cones, settings).solve()


def add_dual_cones(program: Program, data: Data, A: Any, c: Array, first: int) -> None:
    """A x + c in K*, for all contacts: u_N >= mu ||u_T||, or the sum over groups.

    Args:
        program: receives the constraints.
        data: the problem.
        A: (m, number of unknowns of the program).
        c: (m,).
        first: place of the first unknown that shares u_N between the groups: nc of them for each
            group but the last.
    """
    d, nc = data.d, data.problem.nc
    A = sp.csr_array(A)
    rest, constant = A[::d], c[::d]
    for number, group in enumerate(data.friction):
        # each cone gets its share, and the last one the rest
        if number + 1 < len(data.friction):
            own = first + nc * number + np.arange(nc)
            top = sp.csr_array((np.ones(nc), (np.arange(nc), own)), shape=(nc, program.size))
            known = np.zeros(nc)
            rest = rest - top
            program.nonnegative(top, known)
            if number + 2 == len(data.friction):
                program.nonnegative(rest, constant)
        else:
            top, known = rest, constant
        resists = group.axes.any(axis=1)
        without = np.flatnonzero(~resists)
        program.nonnegative(top[without], known[without])
        contacts = np.flatnonzero(resists)
        components = list(range(d))[group.part]
        axes = group.axes[contacts].T
        size = 1 + len(components)
        # rows contact by contact: the normal one, then the others times their half-axes
        stacked = sp.vstack(
            [top[contacts]]
            + [
                sp.diags_array(axis) @ A[d * contacts + k]
                for axis, k in zip(axes, components, strict=True)
            ]
        )
        values = np.concatenate(
            [
                known[contacts],
                *(axis * c[d * contacts + k] for axis, k in zip(axes, components, strict=True)),
            ]
        )
        order = np.arange(size * contacts.size).reshape(size, -1).T.ravel()
        program.second_order(sp.csr_array(stacked)[order], values[order], size)


def shares(data: Data) -> int:
    """The number of unknowns that add_dual_cones needs."""
    return data.problem.nc * (len(data.friction) - 1)
