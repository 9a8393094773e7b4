"""`auto` beside the solvers of Siconos if each is called again and again, as in a simulation.

    python -m workshop.tables.siconos_in_a_loop FILE... [--tol 1e-8] [--seconds 2] [--each FILE]
        [--results siconos-loop]

A run of a campaign is one call: nothing of the problem or the code is in the caches of the
processor. Here each solver solves the same problem up to 50 times, in 10 ms at most, and the least
CPU time of the solve alone counts. Siconos repeats its calls in its own process, so the clock of
the adapter counts for neither. `--each` writes a line of CSV for each problem: the times of `auto`
and of the fastest solver of Siconos, chosen in hindsight, and its name.
"""

from __future__ import annotations

import argparse
import csv
import math
from pathlib import Path
from typing import Any

import numpy as np

import fclib
from fclib.external import siconos
from workshop.tables import _results, campaign

CALLS = 50
ENOUGH = 0.01  # [s] of all calls, as in the adapter of Siconos


def of_auto(problem: Any, tol: float, limit: float) -> float:
    """The least CPU time [s] of `auto`; inf if it does not solve the problem."""
    least, spent = math.inf, 0.0
    for _ in range(CALLS):
        result = fclib.solve(problem, tol=tol, time_limit=limit)
        if result.status != "converged":
            return math.inf
        least, spent = min(least, result.cpu_s), spent + result.cpu_s
        if spent > ENOUGH:
            break
    return least


def of_siconos(problem: Any, solver: str, tol: float, limit: float) -> float:
    """The least CPU time [s] of a solver of Siconos; inf if it does not solve the problem."""
    try:
        result = fclib.solve(problem, solver, tol, time_limit=limit, calls=CALLS)
    except (fclib.UnsuitableError, fclib.SolverError):
        return math.inf
    return result.cpu_s if result.status == "converged" else math.inf


def main() -> None:
    """Measure each problem, and print the figures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--tol", type=float, default=1e-8)
    parser.add_argument("--seconds", type=float, default=2, help="limit of a call")
    parser.add_argument("--each", type=Path, help="a line for each problem")
    _results.add_option(parser)
    arguments = parser.parse_args()
    tol, limit = arguments.tol, arguments.seconds
    names = [f"{campaign.SICONOS}{name}" for name in siconos.FC3D]
    problems: list[dict[str, Any]] = []
    for path in arguments.files:
        problem: Any = fclib.read(path)
        times = {name: of_siconos(problem, name, tol, limit) for name in names}
        best = min(times, key=times.__getitem__)
        own = of_auto(problem, tol, limit)
        row = {"file": path.name, "contacts": problem.nc, "auto [s]": own, "best [s]": times[best]}
        problems.append({**row, "best": best if math.isfinite(times[best]) else ""})
        print(*problems[-1].values(), f"{own / times[best]:.3f}", flush=True)
    if arguments.each:
        with arguments.each.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(problems[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(problems)
    ours, theirs = (np.array([row[name] for row in problems]) for name in ("auto [s]", "best [s]"))
    contacts = np.array([row["contacts"] for row in problems])
    rows = campaign.hindsight_figures(ours, theirs, contacts)
    print(_results.table(list(rows[0]), rows))
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="`auto` beside the fastest solver of Siconos, each called again and again",
            note=f"{len(names)} solvers of Siconos; tolerance {tol:g}; limit {limit:g} s.",
        )


if __name__ == "__main__":
    main()
