"""How the solvers did on the set `standard`, by the runs that its classes follow from.

    .venv/bin/python benchmarks/standard_table.py [--results]

Nothing is run: the runs are those of campaigns/standard.toml, which `fclib collection status
standard --add STORE` has taken in (collection/fclib_collection/results/runs.csv). A run counts as
solved where it reached 1e-8 by both merits, or proved that there is no solution, within the limit.
A mean is the shifted geometric mean of the CPU times (shift 1 ms); a failure is charged as ten
times the limit.
"""

from __future__ import annotations

import argparse
from collections import Counter, defaultdict
from typing import Any

import _results
import numpy as np

import fclib
from fclib import scenes
from fclib.bench import profiles
from fclib.collections import standing


def mean(runs: list[standing.Run]) -> float:
    """The shifted geometric mean of the times [ms]."""
    times = np.array([[run.cpu if run.solved and run.cpu else np.inf] for run in runs])
    charges = np.array([run.limit or 0.0 for run in runs])
    return 1e3 * float(profiles.shifted_geometric_mean(times, charges)[0])


def votes() -> dict[tuple[str, str], standing.Run]:
    """The last run of each problem and solver that takes it, at the limit of its family.

    Of the solvers that were tried on the whole set: other campaigns share some of its problems.
    """
    rows, basis = standing.standings(standing.FIRST)
    assert basis is not None, "no runs are stored"
    own = {row.digest[: standing.DIGITS]: row for row in rows if row.limit is not None}
    found = {}
    for run in sorted(standing.runs(), key=standing.when):
        row = own.get(run.digest)
        if row is not None and run.limit == row.limit:
            found[row.id, run.solver] = run
    tried = Counter(solver for _, solver in found)
    most = max(tried.values())
    return {
        (name, solver): run
        for (name, solver), run in found.items()
        if tried[solver] == most and run.status != "unsuitable"
    }


def main() -> None:
    """Print the tables, or store them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--results", action="store_true", help="store them in docs/results/")
    arguments = parser.parse_args()

    runs = votes()
    own: dict[str, list[standing.Run]] = defaultdict(list)
    best: dict[str, float] = {}
    for (name, solver), run in runs.items():
        own[solver].append(run)
        if run.solved and run.cpu is not None:
            best[name] = min(run.cpu, best.get(name, np.inf))
    by_solver = {
        solver: {name: runs[name, solver] for name, s in runs if s == solver} for solver in own
    }

    solvers: list[dict[str, Any]] = []
    for solver, mine in by_solver.items():
        solved = {name: run for name, run in mine.items() if run.solved}
        ratios = np.array([(run.cpu or 0.0) / best[name] for name, run in solved.items()])
        solvers.append(
            {
                "solver": solver,
                "family": fclib.find_solver(solver).family,
                "takes": len(mine),
                "solved": len(solved),
                "alone": sum(
                    not any(runs[n, s].solved for n, s in runs if n == name and s != solver)
                    for name in solved
                ),
                "fastest": int((ratios <= 1).sum()),
                "within 2x of the fastest": f"{100 * (ratios <= 2).sum() / len(mine):.0f} %",
                "within 10x": f"{100 * (ratios <= 10).sum() / len(mine):.0f} %",
                "mean [ms]": mean([*mine.values()]),
            }
        )
    solvers.sort(key=lambda row: (-row["solved"] / row["takes"], row["mean [ms]"]))

    kinds: dict[str, dict[str, dict[str, standing.Run]]] = defaultdict(lambda: defaultdict(dict))
    families = scenes.families() | scenes.assemblies()
    for (name, solver), run in runs.items():
        kinds[families[name.split("/")[1]].collection][solver][name] = run
    table: list[dict[str, Any]] = []
    for kind, found in kinds.items():
        row: dict[str, Any] = {"kind": kind, "problems": max(map(len, found.values()))}
        ranked = sorted(
            (s for s in found if s != "auto"),
            key=lambda s: (-sum(r.solved for r in found[s].values()), mean([*found[s].values()])),
        )
        for title, solver in (("auto", "auto"), ("next", ranked[0]), ("then", ranked[1])):
            mine_ = found[solver]
            count = sum(run.solved for run in mine_.values())
            if title != "auto":
                row[title] = solver
            row[f"{title}: solved"] = count
            row[f"{title}: mean [ms]"] = mean([*mine_.values()])
        row["others: fewest solved"] = min(
            sum(r.solved for r in found[s].values()) / len(found[s]) for s in ranked
        )
        row["others: fewest solved"] = f"{100 * row['others: fewest solved']:.0f} %"
        table.append(row)
    table.sort(key=lambda row: -row["problems"])

    some = next(iter(runs.values()))
    dates = sorted({run.date for run in runs.values()})
    note = (
        f"{len({name for name, _ in runs})} problems, to 1e-8 by both merits, {some.limit:g} s of"
        f" CPU a run, means with failures as ten times that; the runs are of"
        f" {' to '.join(dict.fromkeys((dates[0], dates[-1])))}."
    )
    if arguments.results:
        _results.store("standard-solvers", solvers, title="The set standard", note=note)
        _results.store("standard-kinds", table, title="The set standard, by kind", note=note)
    for rows in (solvers, table):
        print(_results.table(list(rows[0]), rows))


if __name__ == "__main__":
    main()
