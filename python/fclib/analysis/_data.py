"""What the parts of the analysis share: a problem's matrices as SciPy has them, its cones."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib import _core, _solve

Array: TypeAlias = npt.NDArray[np.float64]
Local: TypeAlias = _core.LocalProblem | _core.LocalRollingProblem
Global: TypeAlias = _core.GlobalProblem | _core.GlobalRollingProblem

SYMMETRIC = 1e-12  # max |A - A^T| / max |A| up to which a matrix counts as symmetric


def columns(a: Any) -> Any:
    """Any matrix as csc_array: duplicates added up, zeros left out."""
    result = sp.csc_array(a, copy=True)
    result.sum_duplicates()
    result.eliminate_zeros()
    return result


def largest(a: Any) -> float:
    """The largest |entry|."""
    return float(abs(a).max()) if a.nnz else 0.0


def asymmetry(a: Any) -> float:
    """Max |A - A^T| / max |A|, 0 for the zero matrix."""
    size = largest(a)
    return largest(columns(a - a.T)) / size if size else 0.0


@dataclass(frozen=True)
class Data:
    """A problem, and its local form."""

    problem: _solve.Problem
    local: Local  # the problem itself, or condensed

    @classmethod
    def of(cls, problem: _solve.Problem) -> Data:
        """Raises fclib.UnsuitableError where M is singular."""
        if isinstance(problem, (_core.GlobalProblem, _core.GlobalRollingProblem)):
            return cls(problem, problem.condense())
        return cls(problem, problem)

    @cached_property
    def matrices(self) -> dict[str, Any]:
        """Those of the problem and of its local form, by their names."""
        found = {name: getattr(self.problem, name, None) for name in ("M", "H", "G")}
        found |= {name: getattr(self.local, name) for name in ("W", "V", "R")}
        return {name: columns(a) for name, a in found.items() if a is not None}

    @property
    def d(self) -> int:
        """Components of a contact."""
        return self.problem.spacedim

    @property
    def W(self) -> Any:
        """The Delassus matrix."""
        return self.matrices["W"]

    @cached_property
    def symmetric(self) -> bool:
        """Whether W is symmetric, up to rounding."""
        return asymmetry(self.W) <= SYMMETRIC

    @property
    def friction(self) -> list[tuple[Array, slice]]:
        """The coefficients, each with the components of a contact that it bounds."""
        d = self.d
        if isinstance(self.local, _core.LocalRollingProblem):
            half = (d + 1) // 2
            return [(self.local.mu, slice(1, half)), (self.local.mu_r, slice(half, d))]
        return [(self.local.mu, slice(1, d))]

    def resistance(self, u: Array) -> Array:
        """Mu ||u_T|| (+ mu_r ||u_R||) of each contact."""
        parts = u.reshape(-1, self.d)
        terms = [mu * np.linalg.norm(parts[:, part], axis=1) for mu, part in self.friction]
        return np.asarray(np.sum(terms, axis=0))

    def dual_margin(self, u: Array) -> Array:
        """How far each contact's u is inside K*: u_N - mu ||u_T|| (- mu_r ||u_R||)."""
        return np.asarray(u[:: self.d] - self.resistance(u))

    @property
    def stiffness(self) -> float:
        """The mean of the diagonal of W, 1 where it vanishes."""
        return float(self.W.diagonal().mean()) or 1.0 if self.problem.nc else 1.0

    @property
    def speed(self) -> float:
        """||q||, 1 where it vanishes."""
        return float(np.linalg.norm(self.local.q)) or 1.0
