"""The convex problems for conic solvers.

The relaxation is

    min 1/2 r^T W r + q^T r   over r in K_mu,

whose solution has u in K*, while the frictional one has u^ in K*: sliding bodies rise from each
other. If nothing slides, it is the frictional problem. ACLM finds the latter as the fixed point of

    s -> mu ||u_T||,   u = W r + q,   r the solution of the relaxation with q + [s, 0, 0].

Cadoux, "Optimization and fixed point methods for frictional contact" (2009); Acary, Cadoux,
Lemarechal & Malick, "A formulation of the linear discrete Coulomb friction problem via convex
optimization" (2011).

W must be symmetric. The numbers are scaled: the mean of the diagonal of W and ||q|| become 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib import _core, _laws, _registry
from fclib._registry import make_solver
from fclib.external._words import RELAXATION

Array: TypeAlias = npt.NDArray[np.float64]
Local: TypeAlias = _core.LocalProblem | _core.LocalRollingProblem
# stop after so many iterations of ACLM without a better one: the inner solver limits the accuracy
PATIENCE = 50
CITATION = "Acary, Cadoux, Lemarechal & Malick 2011"


@dataclass(frozen=True)
class Program:
    """min 1/2 x^T P x + c^T x, A x + s = 0, s = (zeros, nonnegatives, second-order cones)."""

    P: Any  # (m x m), its upper triangle, by columns
    A: Any  # (rows x m), by columns
    zeros: int
    nonnegatives: int
    cones: tuple[int, ...]  # sizes of the cones


class ConicSolver(Protocol):
    """A solver of one program for several c."""

    def solve(self, c: Array, x: Array, time_left: float) -> Array:
        """The solution, from x, or from the solver's own starting point.

        Raises:
            ArithmeticError: no solution can be computed with these numbers.
        """


Make: TypeAlias = Callable[[Program], ConicSolver]


class Relaxation:
    """The relaxation of a problem for varying s."""

    def __init__(self, problem: Local, make: Make) -> None:
        """Raises UnsuitableError if W is not symmetric."""
        W = sp.csc_array(problem.W)
        if abs(W - W.T).max() > 1e-10 * abs(W).max():
            raise _core.UnsuitableError("a convex solver takes no asymmetric W")
        self.W, self.q, self.d = W, problem.q, problem.spacedim
        self.friction = _friction(problem)
        self.stiffness = float(W.diagonal().mean()) or 1.0
        self.speed = float(np.linalg.norm(problem.q)) or 1.0
        self.program = _program(W / self.stiffness, self.friction, self.d)
        self.solver = make(self.program)

    def modification(self, r: Array) -> Array:
        """The s of each contact: mu ||u_T|| (+ mu_r ||u_R||)."""
        u = (self.W @ r + self.q).reshape(-1, self.d)
        terms = [mu * np.linalg.norm(u[:, part], axis=1) for mu, part in self.friction]
        return np.asarray(np.sum(terms, axis=0))

    def solve(self, s: Array, r: Array, time_left: float) -> Array:
        """The solution of the relaxation with q + [s, 0, 0]."""
        c = self.q.copy()
        c[:: self.d] += s
        scale = self.speed / self.stiffness
        return scale * self.solver.solve(c / self.speed, r / scale, time_left)


def _friction(problem: Local) -> list[tuple[Array, slice]]:
    """The coefficients, each with the components of a contact that it bounds."""
    return [(group.coefficient, group.part) for group in _laws.groups(problem)]


def _program(P: Any, friction: list[tuple[Array, slice]], d: int) -> Program:
    """The cones of all contacts as rows of A, in the order that conic solvers agree on."""
    zeros: list[tuple[int, float]] = []  # column and value: one entry a row
    nonnegatives: list[tuple[int, float]] = []
    others: list[tuple[int, float]] = []
    cones = []
    for mu, part in friction:
        for contact, coefficient in enumerate(mu):
            tangent = [d * contact + k for k in range(d)[part]]
            if coefficient > 0:
                others.append((d * contact, -float(coefficient)))
                others += [(column, -1.0) for column in tangent]
                cones.append(1 + len(tangent))
            else:
                nonnegatives.append((d * contact, -1.0))
                zeros += [(column, 1.0) for column in tangent]
    entries = zeros + nonnegatives + others
    columns = [column for column, _ in entries]
    values = [value for _, value in entries]
    A = sp.csc_array((values, (range(len(entries)), columns)), shape=(len(entries), P.shape[0]))
    return Program(sp.triu(P, format="csc"), A, len(zeros), len(nonnegatives), tuple(cones))


Inner = Annotated[
    float,
    _registry.Option("tolerance of the convex problems, relative to tol", lowest=1e-6, highest=1),
]


def entries(
    package: str, title: str, citation: str, conic: Callable[[Program, float], ConicSolver]
) -> tuple[_core.SolverInfo, ...]:
    """ACLM and the relaxation by one conic solver; conic(program, tolerance) makes it."""

    def aclm(problem: Local, r: Array, monitor: _core.Monitor, *, inner: Inner = 1e-2) -> Array:
        return _aclm(problem, r, monitor, lambda p: conic(p, inner * monitor.tolerance))

    def relaxation(
        problem: Local, r: Array, monitor: _core.Monitor, *, inner: Inner = 1e-2
    ) -> Array:
        return _relaxation(problem, r, monitor, lambda p: conic(p, inner * monitor.tolerance))

    def entry(function: Callable[..., Array], family: str, words: str) -> _core.SolverInfo:
        return make_solver(
            function,
            name=f"{package}:{function.__name__}",
            family=family,
            title=words,
            citation=f"{citation}; {CITATION}",
            origin=package,
            dimensions=(2, 3),
            rolling_dimensions=(3, 5),
            max_iterations=10_000,
        )

    return (
        entry(aclm, "optimisation", f"Fixed point of convex problems, by {title}"),
        entry(relaxation, "relaxation", f"Convex relaxation, by {title}: {RELAXATION}"),
    )


def _relaxation(problem: Local, r: Array, monitor: _core.Monitor, make: Make) -> Array:
    """One convex problem; a failure is reported as inaccurate."""
    if monitor.stop(r):
        return r
    try:
        r = Relaxation(problem, make).solve(np.zeros(problem.nc), r, monitor.time_left)
    except ArithmeticError:
        monitor.status = "stalled"
        return r
    if not monitor.stop(r):
        monitor.status = "inaccurate"
    return r


def _aclm(problem: Local, r: Array, monitor: _core.Monitor, make: Make) -> Array:
    """The fixed point, with one convex problem for each iteration; it returns the best iterate."""
    if monitor.stop(r):
        return r
    convex = Relaxation(problem, make)
    s = convex.modification(r) if r.any() else np.zeros(problem.nc)
    best, least, since = r, monitor.error(r), 0
    while True:
        try:
            r = convex.solve(s, r, monitor.time_left)
        except ArithmeticError:
            monitor.status = "stalled"
            return best
        stop = monitor.stop(r)
        error = monitor.error(r)
        since += 1
        if error < least:
            best, least, since = r, error, 0
        if stop:
            return best
        if since == PATIENCE:
            monitor.status = "stalled"
            return best
        s = convex.modification(r)
