"""No peer loses by our adapter: its solver called by hand gives the same, in as many iterations."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
import pytest

import fclib
from helpers import converged, planted_local

TOLERANCE = 1e-7


def by_hand(which: str, problem: Any, tolerance: float) -> tuple[Any, int]:
    """Pinocchio's solver on the same numbers, with its own defaults: r and the iterations."""
    pin = importlib.import_module("pinocchio")
    m = problem.m
    order = np.arange(m).reshape(-1, 3)[:, [1, 2, 0]].ravel()
    W = problem.with_storage("dense").W[np.ix_(order, order)]
    stiffness, speed = W.diagonal().mean(), np.linalg.norm(problem.q)
    model = pin.Model()
    here = pin.SE3.Identity()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), here, "body")
    models, datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
    for mu in problem.mu:
        contact = pin.PointContactConstraintModel(model, 0, here, joint, here)
        contact.setFriction(float(mu))
        models.append(pin.ConstraintModel(contact))
        datas.append(models[-1].createData())
    settings = getattr(pin, f"{which}SolverSettings")()
    settings.max_iterations = 10**6
    settings.absolute_feasibility_tol = settings.absolute_complementarity_tol = tolerance
    settings.relative_feasibility_tol = settings.relative_complementarity_tol = 0
    result = getattr(pin, f"{which}SolverResult")()
    solver = getattr(pin, f"{which}ConstraintSolver")(m)
    delassus = pin.DelassusOperatorDense(np.asfortranarray(W / stiffness))
    solver.solve(delassus, problem.q[order] / speed, models, datas, settings, result)
    r = np.zeros(m)
    r[order] = np.array(result.retrieveConstraintImpulses()) * (speed / stiffness)
    return r, result.iterations


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("which", ["ADMM", "PGS"])
def test_pinocchio_is_called_as_by_hand(which: str, seed: int) -> None:
    name = f"pinocchio:{which.lower()}"
    try:
        fclib.find_solver(name)
    except fclib.OptionError as absent:
        pytest.skip(str(absent))
    problem = planted_local(seed, d=3, nc=40).problem
    result = converged(problem, name, TOLERANCE)
    # where its tolerances do not mean the same, it is run again with tighter ones
    tolerance = TOLERANCE
    while True:
        r, iterations = by_hand(which, problem, tolerance)
        error = fclib.merit(problem, fclib.Solution(r=r)).error
        if error <= TOLERANCE:
            break
        assert iterations != result.iterations
        tolerance *= 0.5 * min(TOLERANCE / error, 0.5)
    assert result.iterations == iterations
    np.testing.assert_allclose(result.solution.r, r, rtol=1e-9, atol=1e-12)
    # the limit is the caller's: no slices that begin anew
    cut = fclib.solve(problem, name, TOLERANCE, max_iterations=3)
    assert cut.iterations == 3
