"""Common data of the analysis: a problem's matrices in SciPy's form, and its cones."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.linalg import cholesky, solve_triangular

from fclib import _core, _laws, _solve
from fclib._symmetry import SYMMETRIC as SYMMETRIC
from fclib._symmetry import asymmetry as asymmetry
from fclib._symmetry import columns as columns
from fclib._symmetry import largest as largest

Array: TypeAlias = npt.NDArray[np.float64]
Local: TypeAlias = _laws.Local
Global: TypeAlias = _laws.Global

DENSE = 2000  # largest side of a matrix that is treated densely
EPS = float(np.finfo(float).eps)


def check_arguments(
    problem: object,
    *,
    time_limit: object,
    tol: object = 0.0,
    target: object = 1.0,
    no_time: bool = False,
) -> None:
    """The errors of `fclib.solve`, before anything is computed.

    With `no_time`, a time limit of 0 is one.

    Raises:
        fclib.ProblemError: the problem is none.
        fclib.OptionError: a number is none, or out of range. A target must be positive.
    """
    _solve.check_problem(problem)
    for name, value in (("tol", tol), ("target", target)):
        if not isinstance(value, Real):
            raise _core.OptionError(f"{name}: {value!r} is not a number")
    if not isinstance(time_limit, Real):
        raise _core.OptionError(f"time_limit: {time_limit!r} is not a number of seconds")
    seconds = None if no_time and time_limit == 0 else float(time_limit)
    _solve.check_limits(float(tol), seconds)  # type: ignore[arg-type]
    if not 0 < float(target) < np.inf:  # type: ignore[arg-type]
        raise _core.OptionError(f"target: {target} is not a positive finite number")


def norm(x: Any) -> float:
    """||x||, computed without overflow or underflow; at most the largest double."""
    with np.errstate(over="ignore"):
        found = float(np.hypot.reduce(np.asarray(x, dtype=float), initial=0.0))
    return min(found, float(np.finfo(float).max))


def balanced(a: Any, size: Array | None = None) -> Any:
    """D A D of a square csc_array, D = 1 / size; by default the diagonal becomes one.

    A row without a diagonal entry gets the size that makes its largest entry one.
    """
    if a.nnz == 0:
        return a
    if size is None:
        size = np.sqrt(abs(a.diagonal()))
        held = size > 0
        inverse = np.where(held, 1 / np.where(held, size, 1.0), 0.0)
        entries = abs(a) + abs(a).T
        across = (entries @ sp.diags_array(inverse)).max(axis=1).toarray().ravel()
        alone = np.sqrt(entries.max(axis=1).toarray().ravel())
        size = np.where(held, size, np.where(across > 0, across, alone))
    inverse = sp.diags_array(1 / np.where(size > 0, size, 1.0))
    return columns(inverse @ a @ inverse)


@dataclass(frozen=True)
class Reduced:
    """W' = W - V R^-1 V^T, and the bound below which its eigenvalues may be rounding.

    Attributes:
        W: W'.
        rounding: rounding of its eigenvalues.
        own_size, own_rounding: entry (i, j) is rounded by own_rounding own_size_i own_size_j; no
            sizes if W' is W.
    """

    W: Any
    rounding: float
    own_size: Array | None = None
    own_rounding: float = 0.0


@dataclass(frozen=True)
class Data:
    """A problem, and its local form."""

    problem: _solve.Problem
    local: Local  # the problem itself, or condensed

    @classmethod
    def of_problem(cls, problem: _solve.Problem) -> Data:
        """Raises fclib.UnsuitableError if M is singular."""
        if isinstance(problem, _laws.Global):
            return cls(problem, problem.condense())
        return cls(problem, problem)

    @cached_property
    def matrices(self) -> dict[str, Any]:
        """The matrices of the problem and of its local form, by their names."""
        found = {name: getattr(self.problem, name, None) for name in ("M", "H", "G")}
        found |= {name: getattr(self.local, name) for name in ("W", "V", "R")}
        return {name: columns(a) for name, a in found.items() if a is not None}

    @property
    def d(self) -> int:
        """The number of components of a contact."""
        return self.problem.spacedim

    @property
    def W(self) -> Any:
        """The Delassus matrix."""
        return self.matrices["W"]

    @cached_property
    def reduced(self) -> Reduced | None:
        """W' = W - V R^-1 V^T, the W without bilateral constraints; None if it is rounding.

        Of a symmetric global problem it is A^T A, with A the part of M^-1/2 H orthogonal to the
        range of M^-1/2 G. So there is no difference of large terms, and joints may be redundant.
        """
        return self.reduced_within(DENSE)

    def reduced_within(self, limit: int) -> Reduced | None:
        """The same; None also if a side is above the limit."""
        if self.problem.p == 0:
            return Reduced(self.W, 0.0)
        if max(self.problem.n, self.problem.m, self.problem.p) > limit:
            return None
        problem = self.problem
        if isinstance(problem, _laws.Global) and (asymmetry(self.matrices["M"]) <= SYMMETRIC):
            M = self.matrices["M"].toarray()
            try:
                factor = cholesky((M + M.T) / 2, lower=True)
            except np.linalg.LinAlgError:
                return None
            H = self.matrices["H"].toarray()
            A, B = (
                solve_triangular(factor, a, lower=True) for a in (H, self.matrices["G"].toarray())
            )
            size = np.linalg.norm(B, axis=0)
            U, sigma, _ = np.linalg.svd(B / np.where(size > 0, size, 1.0), full_matrices=False)
            digits = max(B.shape) * EPS
            # because of rounding, it is undecided whether the joints hold this direction
            if ((sigma > digits) & (sigma < 1e6 * digits)).any():
                return None
            Q = U[:, sigma > digits]
            left = A - Q @ (Q.T @ A)
            left -= Q @ (Q.T @ left)
            off = max(A.shape) * EPS * float(1 / sigma[sigma > digits].min(initial=1.0))
            lengths = np.linalg.norm(A, axis=0)
            # if the joints hold a column entirely, it is zero, not rounding
            left[:, np.linalg.norm(left, axis=0) <= 16 * off * lengths] = 0
            digits = 16 * off
            largest_length = float(lengths.max(initial=0.0))
            return Reduced(columns(left.T @ left), digits * largest_length**2, lengths, digits)
        V, R = self.matrices["V"].toarray(), self.matrices["R"].toarray()
        sigma = np.linalg.svd(R, compute_uv=False)
        if not sigma[-1] > 1e-10 * sigma[0]:
            return None
        held = V @ np.linalg.solve(R, V.T)
        W = self.W.toarray()
        off = max(W.shape) * EPS * float(sigma[0] / sigma[-1])
        rounding = 16 * off * (abs(W) + abs(held))
        left = W - held
        left[abs(left) <= rounding] = 0
        own = np.sqrt(np.diag(abs(W) + abs(held)))
        return Reduced(columns(left), float(rounding.max(initial=0.0)), own, 16 * off)

    @cached_property
    def symmetric(self) -> bool:
        """Whether W is symmetric, up to rounding."""
        return asymmetry(self.W) <= SYMMETRIC

    @property
    def friction(self) -> list[_laws.Group]:
        """The groups of components that friction bounds."""
        return _laws.groups(self.local)

    def resistance(self, u: Array) -> Array:
        """What friction adds to u_N in u^ of each contact: mu ||u_T||, or the sum over groups."""
        parts = u.reshape(-1, self.d)
        return np.asarray(np.sum([group.resistance(parts) for group in self.friction], axis=0))

    def dual_margin(self, u: Array) -> Array:
        """The depth of each contact's u inside K*: u_N less what friction adds in u^."""
        return np.asarray(u[:: self.d] - self.resistance(u))

    @property
    def stiffness(self) -> float:
        """The mean of the diagonal of W; 1 if it vanishes."""
        return float(self.W.diagonal().mean()) or 1.0 if self.problem.nc else 1.0

    @property
    def speed(self) -> float:
        """||q||; 1 if it vanishes."""
        return norm(self.local.q) or 1.0
