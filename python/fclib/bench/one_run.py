"""One run: a problem, a solver and the result."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from fclib import _core, _solve

LONGEST = 60  # characters of an option that a table shows


@dataclass(frozen=True)
class Run:
    """One run, in the form that is printed and stored; the first eleven columns are its record."""

    problem: str
    formulation: str
    n: int  # degrees of freedom, 0 for a local problem
    nc: int  # contacts
    solver: str  # with the options set: "nsgs relaxation=1.2"
    status: str
    iterations: int
    cpu_s: float  # [s] CPU time of the solver alone
    error: float  # the merit that the tolerance bounds, recomputed from the returned solution
    natural: float
    scaled_natural: float
    result: _core.Result = field(repr=False, compare=False)

    @property
    def record(self) -> dict[str, Any]:
        """The columns of the run, without the solution itself."""
        return {name: getattr(self, name) for name in COLUMNS}


COLUMNS = (
    "problem",
    "formulation",
    "n",
    "nc",
    "solver",
    "status",
    "iterations",
    "cpu_s",
    "error",
    "natural",
    "scaled_natural",
)


def run(
    name: str,
    problem: _solve.Problem,
    solver: str = "auto",
    tol: float = 1e-8,
    time_limit: float | None = None,
    options: Mapping[str, Any] = MappingProxyType({}),
    callback: Callable[[int, float, float, str], bool | None] | None = None,
    merit: _solve.MeritKind = "both",
) -> Run:
    """Solve a problem and judge the solution.

    Args:
        name: name of the problem in the record.
        problem: any formulation.
        solver: a name of ``fclib.solvers()``.
        tol: bound on the merit.
        time_limit: [s] wall clock.
        options: the solver's own.
        callback: as ``fclib.solve`` has it.
        merit: what ``tol`` bounds, as ``fclib.solve`` has it.

    Raises:
        fclib.Error: as ``fclib.solve`` does.
    """
    result = _solve.solve(
        problem, solver, tol, time_limit=time_limit, callback=callback, merit=merit, **options
    )
    judged = _core.merit(problem, result.solution)
    error = judged.error_by(merit)
    status = result.status
    if status == "converged" and not error <= tol:
        status = "inaccurate"
    label = " ".join([solver, *(f"{key}={shown(value)}" for key, value in options.items())])
    return Run(
        problem=name,
        formulation=problem.formulation,
        n=problem.n,
        nc=problem.nc,
        solver=label,
        status=status,
        iterations=result.iterations,
        cpu_s=result.cpu_s,
        error=error,
        natural=judged.natural,
        scaled_natural=judged.scaled_natural,
        result=result,
    )


def shown(value: Any) -> str:
    """An option in a table: of a text of several lines, as a chain, the first one."""
    first, *others = str(value).strip().splitlines() or [""]
    return f"{first[:LONGEST]}..." if others or len(first) > LONGEST else first
