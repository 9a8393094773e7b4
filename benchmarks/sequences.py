"""What the impulses of the step before are worth to a solver, along stored sequences.

    .venv/bin/python benchmarks/sequences.py [--steps 20] [--solvers auto,nsgs] [FAMILY...]

Consecutive problems of each family, from the middle of its stored states, are solved twice: from
the solver's own solution of the step before, contact by contact, and from nothing. CPU times are
those of the solver alone, warm and cold in turn, in one run. The drift is the largest difference of
the two velocities at the contacts, relative to the largest velocity, in the last third of the
steps: as the problems are given, an error of one step feeds the next one by the guess alone.
"""

from __future__ import annotations

import argparse
from typing import Any

import _results
import numpy as np

import fclib
from fclib import collections

FAMILIES = ("Chain", "Capsules", "BoxesStack", "KaplasTower")
SOLVERS = "auto,nsgs,nsn-ac,siconos:nsgs"


def problems_of(family: str, count: int) -> list[Any]:
    """Consecutive problems of a family with stored states."""
    path = collections.plan_of(collections.folders([family])[0]).trajectory
    if path is None:
        raise SystemExit(f"no states are stored of {family}")
    states = collections.read_trajectory(path)
    first = max(0, (len(states) - count) // 2)
    found = [states.problem(place).problem for place in range(first, first + count)]
    steps = np.diff(states.step[first : first + count])
    if (steps != 1).any():
        raise SystemExit(f"{family}: its stored steps are not consecutive there")
    return found


def along(problems: list[Any], solver: str, tol: float, limit: float) -> dict[str, Any]:
    """A row: the solver on a sequence, warm and cold; the first problem is left out."""
    before: Any = None
    warm_cpu, cold_cpu, warm_count, cold_count, warm_solved, cold_solved = np.zeros(6)
    apart: list[float] = []
    for problem in problems:
        settings: dict[str, Any] = {"tol": tol, "time_limit": limit}
        cold = fclib.solve(problem, solver, **settings)
        if before is None:
            before = problem, cold.solution
            continue
        guess = collections.guess_of(before[0], before[1], problem)
        warm = fclib.solve(problem, solver, guess=guess, **settings)
        before = problem, warm.solution
        warm_cpu, cold_cpu = warm_cpu + warm.cpu_s, cold_cpu + cold.cpu_s
        warm_count, cold_count = warm_count + warm.iterations, cold_count + cold.iterations
        warm_solved, cold_solved = warm_solved + warm.converged, cold_solved + cold.converged
        one, other = np.asarray(cold.solution.u), np.asarray(warm.solution.u)
        if warm.converged and cold.converged:
            size = max(float(np.abs(one).max()), 1e-300)
            apart.append(float(np.abs(other - one).max()) / size)
    last = apart[-(len(apart) // 3) :] if len(apart) > 2 else apart
    return {
        "cold CPU / warm CPU": f"{cold_cpu / warm_cpu:.2f}",
        "iterations warm": int(warm_count),
        "cold": int(cold_count),
        "solved warm": int(warm_solved),
        "solved cold": int(cold_solved),
        "of": len(problems) - 1,
        "drift of u": f"{max(last):.0e}" if last else "-",
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("families", nargs="*", help=f"by default {', '.join(FAMILIES)}")
    parser.add_argument("--steps", type=int, default=20, help="problems of each (default 20)")
    parser.add_argument("--solvers", default=SOLVERS)
    parser.add_argument("--tol", type=float, default=1e-6)
    parser.add_argument("--limit", type=float, default=3.0, help="of a solve [s]")
    _results.add_option(parser)
    arguments = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for family in arguments.families or FAMILIES:
        problems = problems_of(family, arguments.steps)
        for solver in arguments.solvers.split(","):
            figures = along(problems, solver, arguments.tol, arguments.limit)
            rows.append({"family": family, "solver": solver, **figures})
            print(*rows[-1].values(), flush=True)
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="Warm against cold along sequences",
            note=f"tolerance {arguments.tol:g}, {arguments.limit:g} s a solve, consecutive problems"
            " from the middle of the stored states",
        )


if __name__ == "__main__":
    main()
