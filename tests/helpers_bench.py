"""Stores of runs that were not run, of problems that are nowhere else."""

from pathlib import Path
from typing import Any

from fclib.bench import Job, Limits, ProblemFacts, Record, SolverChoice, Store


def facts_of(hash: str, name: str, **facts: Any) -> ProblemFacts:
    """A problem that is nowhere but in a store: a small local one, if nothing else is said."""
    small = {"formulation": "3DFC", "spacedim": 3, "n": 0, "p": 0, "nc": 4, "nnz": 9, "title": ""}
    given = {"hash": hash, "name": name, "family": "Family", "path": "", "kind": "local"}
    return ProblemFacts(**{**given, **small, **facts})


def add_run(
    store: Path,
    problem: ProblemFacts,
    solver: str,
    seconds: float | None,
    status: str = "",
    *,
    tol: float = 1e-6,
    repeat: int = 0,
    limit: float = 10.0,
    error: float = 1.0,
    node: str = "here",
    **job: Any,
) -> None:
    """A run; without a time it has failed, with this error."""
    status = status or ("converged" if seconds is not None else "cpu_limit")
    record = Record(
        status=status,
        cpu_s=seconds,
        total_cpu_s=seconds,
        wall_s=seconds,
        merits={"error": tol / 2 if status == "converged" else error},
        machine={"node": node},
    )
    limits = Limits(limit, limit, 1000)
    with Store(store) as opened:
        choice = SolverChoice(solver, {}, "1")
        assert opened.add(Job(problem, choice, tol, limits, repeat, 1, **job), record)
