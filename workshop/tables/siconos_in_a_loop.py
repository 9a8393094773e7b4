"""`auto` beside the solvers of Siconos if each is called again and again, as in a simulation.

    python -m workshop.tables.siconos_in_a_loop FILE... [--contacts 1 3000] [--most 2] [--tol 1e-8]
        [--seconds 2] [--each FILE] [--results siconos-loop]

A run of a campaign is one call: nothing of the problem or the code is in the caches of the
processor. Here each solver solves the same problem up to 50 times, in 10 ms at most, and the least
CPU time of the solve alone counts. Siconos repeats its calls in its own process, so the clock of
the adapter counts for neither. `--contacts` and `--most` take the problems with so many contacts,
and the first so many of them in each folder. `--each` writes a line of CSV for each problem: the
times of `auto` and of the fastest solver of Siconos, chosen in hindsight, and its name.

A second table, NAME-stages, says where `auto` spends its time on the problems from 100 contacts on:
of each stage, its mean share of the CPU time of a problem, and how many problems it takes at least
half of.
"""

from __future__ import annotations

import argparse
import csv
import math
import statistics
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import fclib
from fclib.external import siconos
from workshop.tables import _results, campaign

CALLS = 50
ENOUGH = 0.01  # [s] of all calls, as in the adapter of Siconos
LEAST_SHARE = 0.01  # of a stage that is shown


def taken(files: Sequence[Path], contacts: Sequence[int], most: int) -> Iterator[tuple[Path, Any]]:
    """The first problems of each folder with so many contacts that Siconos' solvers take.

    These are local and spatial ones with Coulomb friction, without bilateral constraints.
    """
    count: Counter[Path] = Counter()
    for path in files:
        if count[path.parent] < most:
            problem: Any = fclib.read(path)
            takes = isinstance(problem, fclib.LocalProblem) and problem.spacedim == 3
            takes = takes and problem.p == 0 and bool(problem.mu.any())
            if takes and contacts[0] <= problem.nc <= contacts[1]:
                count[path.parent] += 1
                yield path, problem


def of_auto(problem: Any, tol: float, limit: float) -> tuple[float, dict[str, float]]:
    """The least CPU time [s] of `auto`, and each stage's share of it.

    The time is inf if `auto` does not solve the problem.
    """
    least, shares, spent = math.inf, dict[str, float](), 0.0
    for _ in range(CALLS):
        result = fclib.solve(problem, tol=tol, time_limit=limit)
        if result.status != "converged":
            return math.inf, {}
        if result.cpu_s < least:
            least = result.cpu_s
            shares = {stage.name: stage.cpu_s / least for stage in result.stages}
        spent += result.cpu_s
        if spent > ENOUGH:
            break
    return least, shares


def where_the_time_goes(shares: Sequence[dict[str, float]]) -> list[dict[str, Any]]:
    """The stages, those with most of the time first."""
    if not shares:
        return []
    of = {name: [own.get(name, 0.0) for own in shares] for name in set().union(*shares)}
    of["outside the stages"] = [1 - sum(own.values()) for own in shares]
    return [
        {
            "stage": name.replace("_", " "),
            "mean share": f"{statistics.mean(values):.3f}",
            "problems": sum(value > 0 for value in values),
            "half of it or more": sum(value >= 0.5 for value in values),
        }
        for name, values in sorted(of.items(), key=lambda one: -statistics.mean(one[1]))
        if statistics.mean(values) >= LEAST_SHARE
    ]


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
    parser.add_argument("--contacts", nargs=2, type=int, default=(0, sys.maxsize))
    parser.add_argument("--most", type=int, help="problems of a folder; all by default")
    parser.add_argument("--tol", type=float, default=1e-8)
    parser.add_argument("--seconds", type=float, default=2, help="limit of a call")
    parser.add_argument("--each", type=Path, help="a line for each problem")
    _results.add_option(parser)
    arguments = parser.parse_args()
    tol, limit = arguments.tol, arguments.seconds
    names = [f"{campaign.SICONOS}{name}" for name in siconos.FC3D]
    problems: list[dict[str, Any]] = []
    shares: list[dict[str, float]] = []
    most = arguments.most or len(arguments.files)
    for path, problem in taken(arguments.files, arguments.contacts, most):
        times = {name: of_siconos(problem, name, tol, limit) for name in names}
        best = min(times, key=times.__getitem__)
        own, stages = of_auto(problem, tol, limit)
        if stages and problem.nc >= campaign.LARGE:
            shares.append(stages)
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
    stages_of = where_the_time_goes(shares)
    for table in filter(None, (rows, stages_of)):
        print(_results.table(list(table[0]), table))
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="`auto` beside the fastest solver of Siconos, each called again and again",
            note=f"{len(names)} solvers of Siconos; tolerance {tol:g}; limit {limit:g} s.",
        )
    if arguments.results and stages_of:
        _results.store(
            f"{arguments.results}-stages",
            stages_of,
            title=f"Where `auto` spends its time, from {campaign.LARGE} contacts on",
            note=f"{len(shares)} problems that it solves, to {tol:g}; each weighs the same.",
        )


if __name__ == "__main__":
    main()
