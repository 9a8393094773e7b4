"""Pinocchio: its ADMM and PGS for contacts, a wheel of PyPI (``pin``).

Carpentier, Le Lidec & Montaut, "From compliant to rigid contact simulation: a unified and efficient
approach" (2024).

It takes spatial contacts, their normal component last. The numbers are scaled: the mean of the
diagonal of W and ||q|| become 1. It is called once, with its own defaults and the caller's limit
of iterations. Its tolerances are on feasibility and complementarity; if they are met before the
error is, it runs again from the same point with tighter ones, and time and iterations are those of
that run. It knows no time limit: iterations are limited to those that W times a vector leaves time
for, so that none is cut off early; a solve that factorises often ends later than asked.

W is passed dense. Pinocchio copies it to the stack, and ends the process if that is too small:
larger problems are refused. A sparse W only ADMM would take, at seconds an iteration.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import importlib.util
import math
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from fclib import _core
from fclib._registry import make_solver

PREFIX = "pinocchio:"
SOLVERS = "pinocchio:admm, pinocchio:pgs"
SPEED = 2e9  # multiplications a second, more than one thread can do
STACK = 0.75 * 2**23  # [bytes] largest size of W, of the usual stack of 8 MiB
MOST = math.isqrt(int(STACK / 8)) // 3  # largest number of contacts
LEAST = 1e-16  # least tolerance


def missing() -> str:
    """The package to install."""
    if importlib.util.find_spec("pinocchio") is None:
        return "pip install 'pin>=4.1'"
    if not hasattr(importlib.import_module("pinocchio"), "ADMMConstraintSolver"):
        return "pip install 'pin>=4.1': the one that is there has no such solvers"
    return ""


def version() -> str:
    """The version of the package."""
    return importlib.metadata.version("pin")


@functools.cache
def solvers() -> Sequence[_core.SolverInfo]:
    """The entries."""
    return (
        _entry("ADMM", "optimisation", "ADMM with a spectral penalty"),
        _entry("PGS", "splitting", "Projected Gauss-Seidel"),
    )


def _entry(which: str, family: str, title: str) -> _core.SolverInfo:
    def function(problem: _core.LocalProblem, r: Any, monitor: _core.Monitor) -> Any:
        return _solve(which, problem, r, monitor)

    return make_solver(
        function,
        name=PREFIX + which.lower(),
        family=family,
        title=title,
        citation="Carpentier, Le Lidec & Montaut 2024",
        origin="pinocchio",
        dimensions=(3,),
        rolling_dimensions=(),
        max_iterations=1_000_000,
    )


def _solve(which: str, problem: _core.LocalProblem, r: Any, monitor: _core.Monitor) -> Any:
    """One call, and further ones if its tolerances differ in meaning from the caller's."""
    if monitor.stop(r):
        return r
    import scipy.sparse as sp

    start = time.thread_time()
    pin = importlib.import_module("pinocchio")
    m = problem.m
    if m**2 * 8 > STACK:
        raise _core.UnsuitableError(f"Pinocchio takes up to {MOST} contacts, not {problem.nc}")
    order = np.arange(m).reshape(-1, 3)[:, [1, 2, 0]].ravel()
    W = sp.csc_matrix(sp.csr_array(problem.W)[order][:, order])
    if which == "ADMM" and abs(W - W.T).max() > 1e-10 * abs(W).max():
        raise _core.UnsuitableError("ADMM of Pinocchio takes no asymmetric W")
    stiffness = float(W.diagonal().mean()) or 1.0
    speed = float(np.linalg.norm(problem.q)) or 1.0
    W, q = W / stiffness, problem.q[order] / speed
    delassus = pin.DelassusOperatorDense(np.asfortranarray(W.toarray()))
    models, datas = _contacts(pin, problem.mu)
    prepared = time.thread_time() - start
    settings = getattr(pin, f"{which}SolverSettings")()
    settings.relative_feasibility_tol = settings.relative_complementarity_tol = 0.0
    affordable = monitor.time_left * SPEED / max(m**2, 1)
    limit = int(min(monitor.max_iterations, max(affordable, 1), 2**31 - 1))
    tolerance = max(monitor.tolerance, LEAST)
    best, least = r, monitor.error(r)
    guess = r[order] * (stiffness / speed)
    while True:
        settings.absolute_feasibility_tol = settings.absolute_complementarity_tol = tolerance
        settings.max_iterations = limit
        start = time.thread_time()
        result = getattr(pin, f"{which}SolverResult")()
        if guess.any():
            result.setConstraintImpulseGuess(guess)
        solver = getattr(pin, f"{which}ConstraintSolver")(m)
        content = solver.solve(delassus, q, models, datas, settings, result)
        monitor.cpu_s = prepared + time.thread_time() - start
        iterations = min(max(1, result.iterations), limit)
        found = np.zeros(m)
        found[order] = np.array(result.retrieveConstraintImpulses()) * (speed / stiffness)
        error = monitor.error(found)
        if error < least:
            best, least = found, error
        met = error <= monitor.tolerance
        if met or not content or tolerance <= LEAST or monitor.time_left <= 0:
            monitor.stop(best, iterations)
            if not met and iterations < limit:
                monitor.status = "stalled"
            return best
        # the error is proportional to the tolerance
        tolerance = max(0.5 * tolerance * min(monitor.tolerance / error, 0.5), LEAST)


def _contacts(pin: Any, mu: Any) -> tuple[Any, Any]:
    """Contacts with these coefficients, of a model that has no other meaning."""
    model = pin.Model()
    placement = pin.SE3.Identity()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), placement, "body")
    models, datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
    for coefficient in mu:
        contact = pin.PointContactConstraintModel(model, 0, placement, joint, placement)
        contact.setFriction(float(coefficient))
        entry = pin.ConstraintModel(contact)
        models.append(entry)
        datas.append(entry.createData())
    return models, datas
