"""The state of each contact of a solution, and the energy balance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fclib import _core, _laws, _solve
from fclib.analysis._data import Array, Data


def completed(data: Data, solution: _core.Solution) -> tuple[Array, Array]:
    """R and u, recomputed from the data."""
    problem, r = data.problem, solution.r
    if isinstance(problem, _laws.Global):
        return r, data.matrices["H"].T @ velocity(problem, data, solution) + problem.w
    u = data.W @ r + data.local.q
    if solution.l is not None and "V" in data.matrices:
        u = u + data.matrices["V"] @ solution.l
    return r, u


def velocity(problem: _laws.Global, data: Data, solution: _core.Solution) -> Array:
    """The generalised velocity: the solution's, or the one that follows from its reactions."""
    if solution.v is not None:
        return solution.v
    impulse = data.matrices["H"] @ solution.r + problem.f
    if solution.l is not None and "G" in data.matrices:
        impulse = impulse + data.matrices["G"] @ solution.l
    return _velocity_of(data, impulse)


def _velocity_of(data: Data, impulse: Array) -> Array:
    from scipy.sparse.linalg import splu

    M = data.matrices["M"]
    return np.asarray(splu(M).solve(impulse)) if M.shape[0] else impulse


def contacts(problem: _solve.Problem, solution: _core.Solution) -> npt.NDArray[np.void]:
    """One row for each contact, in a form that ``pandas.DataFrame(contacts(...))`` takes.

    Args:
        problem: any formulation.
        solution: its solution; u is recomputed from the data, never taken from the solution.

    Returns:
        A structured array (nc,): contact, island, mu (and mu_r with rolling, mu_s with spin),
        status (open, stick or slide, as in Merit), r_n and r_t [N s], u_n and u_t [m/s] (and r_r,
        u_r with rolling, r_s, u_s with spin), used (||r_T|| / (mu r_N), nan without friction or
        reaction), error (||r - P_K(r - u^)|| of the contact, [N s] + [m/s] as in the merit), cone
        [N s] and dual_cone [m/s] (distances from K and K*), dissipated [J] (-r . u).

    Raises:
        fclib.ProblemError: problem or solution is not valid.
    """
    each = _core.contact_merits(problem, solution)
    data = Data.of_problem(problem)
    d, nc = data.d, problem.nc
    r, u = solution.r, each["u"]
    rows, speeds = r.reshape(nc, d), u.reshape(nc, d)
    parts = _laws.parts(problem)
    coefficients = _laws.coefficients(problem)
    columns: dict[str, Any] = {
        "contact": np.arange(nc, dtype=np.int32),
        "island": data.local.islands().contact,
        **coefficients,
        "status": each["status"],
        "r_n": rows[:, 0],
        **{f"r_{k}": np.linalg.norm(rows[:, part], axis=1) for k, part in parts.items()},
        "u_n": speeds[:, 0],
        **{f"u_{k}": np.linalg.norm(speeds[:, part], axis=1) for k, part in parts.items()},
    }
    limit = data.local.mu * rows[:, 0]
    columns["used"] = np.divide(
        columns["r_t"], limit, out=np.full(nc, np.nan), where=np.asarray(limit > 0)
    )
    columns["error"] = each["natural"]
    columns["cone"] = each["cone"]
    columns["dual_cone"] = each["dual_cone"]
    columns["dissipated"] = -(rows * speeds).sum(axis=1)
    table = np.empty(nc, dtype=[(name, values.dtype) for name, values in columns.items()])
    for name, values in columns.items():
        table[name] = values
    return table


@dataclass(frozen=True)
class Energy:
    """The energy balance of a solution, in J; powers if r is a force.

    Of the velocity without reactions v_f and the one with them v,

        kinetic - free = work - prescribed + bilateral,   work = r . (u + q) / 2.

    Attributes:
        work: work of the reactions, r . (u + q) / 2, in the frame of the prescribed motion (w).
        dissipated: energy lost by friction and separation, -r . u: the sum over the contacts.
        prescribed: r . w, work of the prescribed motion; nan for a local problem, which has no w.
        bilateral: work of the bilateral constraints, lambda . (G^T (v + v_f)) / 2 or its local
            form.
        kinetic, free: v . M v / 2 and v_f . M v_f / 2; nan for a local problem.
        residual: rest of the balance, relative to its largest term: of the kinetic energy for
            a global problem, whose M must be symmetric; of r . u = r . (W r + V lambda + q), u the
            solution's, for a local one.
    """

    work: float
    dissipated: float
    prescribed: float
    bilateral: float
    kinetic: float
    free: float
    residual: float


def energy(problem: _solve.Problem, solution: _core.Solution) -> Energy:
    """The energy balance of a solution.

    Raises:
        fclib.ProblemError: problem or solution is not valid.
    """
    _core.merit(problem, solution)  # this validates both
    data = Data.of_problem(problem)
    r, u = completed(data, solution)
    q = data.local.q
    work = float(r @ (u + q)) / 2
    nan = float("nan")
    if isinstance(problem, _laws.Global):
        M = data.matrices["M"]
        v, still = velocity(problem, data, solution), _velocity_of(data, problem.f)
        kinetic, free = float(v @ (M @ v)) / 2, float(still @ (M @ still)) / 2
        prescribed = float(r @ problem.w)
        bilateral = 0.0
        if solution.l is not None and "G" in data.matrices:
            bilateral = float(solution.l @ (data.matrices["G"].T @ (v + still))) / 2
        terms = [kinetic, free, work, prescribed, bilateral]
        rest = kinetic - free - work + prescribed - bilateral
    else:
        kinetic = free = prescribed = nan
        pull = 0.0 * u
        bilateral = 0.0
        if solution.l is not None and "V" in data.matrices:
            assert problem.s is not None
            V, R, lam = data.matrices["V"], data.matrices["R"], solution.l
            pull = V @ lam
            # s without reactions, V^T r + R lambda + s = 0 with them
            bilateral = float(lam @ (V.T @ r + R @ lam + 2 * problem.s)) / 2
        own = u if solution.u is None else solution.u
        terms = [float(r @ own), float(r @ (data.W @ r)), float(r @ q), float(r @ pull)]
        rest = terms[0] - sum(terms[1:])
    largest = max(map(abs, terms)) or 1.0
    return Energy(
        work=work,
        dissipated=-float(r @ u),
        prescribed=prescribed,
        bilateral=bilateral,
        kinetic=kinetic,
        free=free,
        residual=abs(rest) / largest,
    )
