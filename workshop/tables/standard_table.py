"""How the solvers did on the set `standard`, by the published runs.

    python -m workshop.tables.standard_table [--results]

Nothing is run. The runs are compared as `fclib profile` compares those of a store
(`fclib.bench.comparison`): on the problems that all of the solvers take; each family weighs the
same.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter, defaultdict
from typing import Any

import numpy as np

import fclib
from fclib import results
from fclib.bench import comparison, profiles
from fclib.bench.comparison import numbers_in
from fclib.results.boards import by_name, sources
from workshop.tables import _results, published

WEIGH: profiles.Weigh = "families"  # so that a large family decides no figure
SET = "standard"


def solver_rows(costs: profiles.Costs, taken: Counter[str]) -> list[dict[str, Any]]:
    """A row a solver, the one that solves the largest share first."""
    quotients = profiles.ratios(costs.values)
    weights = costs.weights(WEIGH)
    within = profiles.share_within(quotients, np.array([2.0, 10.0]), weights)
    found = []
    for row in profiles.summary(costs, weigh=WEIGH)[1:]:
        k = costs.solvers.index(row["solver"])
        alone = costs.solved[:, k] & (costs.solved.sum(axis=1) == 1)
        found.append(
            {
                "solver": row["solver"],
                "family": fclib.find_solver(row["solver"]).family,
                "takes": taken[row["solver"]],
                "solved": f"{row['solved']} of {row['of']}",
                "share": f"{100 * row['share']:.0f} %",
                "alone": int(alone.sum()),
                "fastest": row["fastest"],
                "within 2x of the fastest": f"{100 * within[k, 0]:.0f} %",
                "within 10x": f"{100 * within[k, 1]:.0f} %",
                "mean [ms]": 1e3 * row["mean"],
            }
        )
    return found


def main() -> None:
    """Print the tables, or store them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--results", action="store_true", help="store them in docs/results/")
    arguments = parser.parse_args()

    where = results.folder()
    parts = sources(by_name(results.shards(where) if where else [])).get(SET, [])
    one = published.set_of(SET, parts)
    if one is None:
        raise SystemExit(f"no runs of {SET} are published here")
    every = one.every.at(one.every.tolerances[-1])
    costs = every.shared()
    taken = Counter(
        dict(zip(every.solvers, (~np.isnan(every.values)).sum(axis=0).tolist(), strict=True))
    )
    solvers = solver_rows(costs, taken)

    kinds: dict[str, list[int]] = defaultdict(list)
    for k, instance in enumerate(every.instances):
        kinds[published.kind_of(instance.family)].append(k)
    table: list[dict[str, Any]] = []
    for kind, places in kinds.items():
        # of a kind that only some take, these
        part = comparison.compared(every.on_instances(places))
        rows = {row["solver"]: row for row in profiles.summary(part, weigh=WEIGH)[1:]}
        ranked = [name for name in rows if name != "auto"]
        row = {"kind": kind, "problems": len(part.instances), "solvers": len(rows)}
        for title, solver in (("auto", "auto"), ("next", ranked[0]), ("then", ranked[1])):
            if title != "auto":
                row[title] = solver
            row[f"{title}: solved"] = rows[solver]["solved"]
            row[f"{title}: mean [ms]"] = 1e3 * rows[solver]["mean"]
        fewest = min(rows[name]["share"] for name in ranked)
        row["others: fewest solved"] = f"{100 * fewest:.0f} %"
        table.append(row)
    table.sort(key=lambda row: -row["problems"])

    limits = sorted({one.limit for one in every.instances})
    started = numbers_in(one.rows, "started")
    dates = [time.strftime("%Y-%m-%d", time.gmtime(day)) for day in (started.min(), started.max())]
    note = (
        f"{len(every.instances)} problems to 1e-8 by both merits, or proved to have no solution;"
        f" {' or '.join(f'{limit:g}' for limit in limits)} s of CPU a run; of these"
        f" {len(costs.instances)} that all {len(costs.solvers)} solvers take; each family weighs"
        " the same in shares and means, failures count as ten times the limit; the runs are of"
        f" {' to '.join(dict.fromkeys((dates[0], dates[-1])))}."
    )
    if arguments.results:
        _results.store("standard-solvers", solvers, title="The set standard", note=note)
        _results.store("standard-kinds", table, title="The set standard, by kind", note=note)
    for printed in (solvers, table):
        print(_results.table(list(printed[0]), printed))


if __name__ == "__main__":
    main()
