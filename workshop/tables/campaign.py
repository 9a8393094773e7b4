"""Run a published campaign within a budget, and store the tables that pages quote.

    python -m workshop.tables.campaign rt444 --budget 10min --time-limit 1
    python -m workshop.tables.campaign rt444 --tables      # from the store alone

The store is build/campaigns/NAME.sqlite; the same command goes on with it. The tables are
docs/results/campaign-NAME.csv (solvers) and campaign-NAME-families.csv, or with --solved the one
of who solves what, campaign-NAME-solved.csv; `make campaigns` packs stores and tables. A budget
bounds the time of the runs, and each run ends at --time-limit; what that leaves out is said in the
note of the tables.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from fclib import bench
from fclib.bench import campaign, comparison, profiles, runner
from workshop.tables import _results

STORES = _results.ROOT / "build" / "campaigns"
WEIGH: profiles.Weigh = "families"  # so that a large family decides no figure


def main() -> None:
    """Run it, and write the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("name", help="a campaign of campaigns/")
    parser.add_argument("--budget", default="10min")
    parser.add_argument("--time-limit", help="[s] of CPU a run, instead of the campaign's own")
    parser.add_argument("--wall-limit", help="[s] of the clock a run, on a machine that is shared")
    parser.add_argument("--sample", help="so many problems of each group")
    parser.add_argument("--repeats", help="instead of the campaign's own")
    parser.add_argument("--jobs", default="1")
    parser.add_argument("--tables", action="store_true", help="run nothing")
    parser.add_argument("--solved", action="store_true", help="the table of who solved what alone")
    arguments = parser.parse_args()
    store = STORES / f"{arguments.name}.sqlite"
    if not arguments.tables:
        STORES.mkdir(parents=True, exist_ok=True)
        command = [str(Path(sys.executable).with_name("fclib")), "bench", arguments.name]
        command += ["--store", str(store), "--budget", arguments.budget, "-j", arguments.jobs]
        for option in ("time_limit", "wall_limit", "sample", "repeats"):
            if (value := getattr(arguments, option)) is not None:
                command += [f"--{option.replace('_', '-')}", value]
        subprocess.run(command, check=True)
    (write_solved if arguments.solved else write)(arguments.name, store)


def write_solved(name: str, store: Path) -> None:
    """How many problems of each family each solver solves, and which ones not all of them do.

    Each solver has its own set here: the problems that it has run and takes.
    """
    rows = profiles.load(store)
    whole = comparison.compared(profiles.gather(rows), own_set=True)
    titles = comparison.names_of(whole.instances)
    order = sorted(range(len(whole.solvers)), key=lambda k: whole.solvers[k])
    table = []
    for family in sorted({one.family for one in whole.instances}):
        places = [k for k, one in enumerate(whole.instances) if one.family == family]
        part = whole.of(places)
        sizes = [one.nc for one in part.instances]
        ends = dict.fromkeys((min(sizes), max(sizes)))
        cells: dict[str, Any] = {"family": family, "contacts": " to ".join(map(str, ends))}
        counts = part.counts()
        for k in order:
            solved, of = counts[k]
            cells[short(whole.solvers[k])] = f"{solved} of {of}" if of else "takes none"
        missed = []
        for place, own in zip(places, part.values, strict=True):
            names = [short(whole.solvers[k]) for k in order if np.isinf(own[k])]
            if names:
                missed.append(f"{titles[place]}: {', '.join(names)}")
        cells["not solved"] = "; ".join(sorted(missed))
        table.append(cells)
    note = profiles.caption(whole, rows, "instances", own_set=True) + "."
    title = f"Campaign {name}: who solves what"
    _results.store(f"campaign-{name}-solved", table, title=title, note=note)


def short(solver: str) -> str:
    """The label of a solver, without its version."""
    return solver.partition(" (")[0]


def write(name: str, store: Path) -> None:
    """The tables of a store: on the common set, where each family weighs the same."""
    rows = profiles.load(store)
    every = profiles.gather(rows)
    whole = comparison.compared(every)
    with bench.Store(store, create=False) as opened:
        (first, *_) = opened.status()
        runs = opened.table(more=("key",))
    spent = runner.spent(runs, set(runs["key"].values))
    note = (
        f"{profiles.caption(whole, rows, WEIGH)}. {first.done} of the campaign's {first.planned}"
        f" runs, in {spent / 60:.0f} min of runs."
    )
    for row in profiles.left_out(every, whole):
        note += (
            f" Not compared: {short(row['solver'])}, which solves {row['solved']} of the"
            f" {row['of']} that it has run to {_results.power(row['tol'])}."
        )
    if busy := sum(profiles.loaded(rows).values()):
        note += f" {busy} of {len(rows)} runs were begun under a load above the number of cores."
    solvers: list[dict[str, Any]] = []
    for tol in whole.tolerances:
        costs = whole.at(tol)
        bounds = np.array([2.0, 10.0])
        within = profiles.performance_profile(costs.values, bounds, costs.weights(WEIGH))
        shares = dict(zip(costs.solvers, within.tolist(), strict=True))
        for row in profiles.summary(costs, weigh=WEIGH):
            two, ten = shares.get(row["solver"], (1.0, 1.0))
            solvers.append(
                {
                    "tolerance": _results.power(tol),
                    "solver": short(row["solver"]),
                    "solved": f"{row['solved']} of {row['of']}",
                    "share": f"{100 * row['share']:.0f} %",
                    "fastest": row["fastest"],
                    "mean [s]": row["mean"],
                    "to best": row["to best"],
                    "within 2x": f"{100 * two:.0f} %",
                    "within 10x": f"{100 * ten:.0f} %",
                }
            )
    _results.store(f"campaign-{name}", solvers, title=f"Campaign {name}: the solvers", note=note)
    families = [
        {
            "family": row["family"],
            "problems": row["problems"],
            "contacts": row["contacts"],
            "tolerance": _results.power(row["tol"]),
            "mean of the fastest [s]": row["mean of fastest"],
            **({"published [s]": row["published"] or ""} if "published" in row else {}),
            "unsolved": row["unsolved"],
            "most often the fastest": short(row["most often fastest"]),
        }
        for row in profiles.families(whole, campaign.published_means(store))
    ]
    title = f"Campaign {name}: the fastest solver of each problem"
    _results.store(f"campaign-{name}-families", families, title=title, note=note)


if __name__ == "__main__":
    main()
