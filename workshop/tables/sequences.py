"""What the impulses of the step before are worth to a solver, along stored sequences.

    python -m workshop.tables.sequences [--steps 20] [--solvers auto,nsgs] [FAMILY...]

A campaign (docs/bench.md, "Along a sequence"): consecutive problems of each family, from the middle
of its stored states, are solved by each solver from its own solution of the step before, contact by
contact, and from nothing.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

from fclib import bench, collections
from fclib.bench import profiles
from workshop.tables import _results

SET = "rt444"
FAMILIES = ("Chain", "Capsules", "BoxesStack", "KaplasTower")
SOLVERS = "auto,nsgs,nsn-ac,siconos:nsgs"


def group(family: str, count: int) -> dict[str, Any]:
    """The middle of a family's stored states as the problems of a campaign."""
    name = family if "/" in family else f"{SET}/{family}"
    path = collections.plan_of(collections.folders([name])[0]).trajectory
    if path is None:
        raise SystemExit(f"no states are stored of {name}")
    first = max(0, (len(collections.read_trajectory(path)) - count) // 2)
    return {"set": name, "sequence": {"start": first, "count": count}}


def shown(row: dict[str, Any]) -> dict[str, Any]:
    """A row of the table as the page has it."""
    drift = row["drift"]
    return {
        "family": row["sequence"].partition(",")[0].partition("/")[2],
        "solver": row["solver"],
        "cold CPU / warm CPU": f"{row['cold CPU / warm CPU']:.2f}",
        "iterations warm": row["iterations warm"],
        "cold": row["iterations cold"],
        "solved warm": row["solved warm"],
        "solved cold": row["solved cold"],
        "of": row["of"],
        "drift of u": "-" if drift is None else f"{drift:.0e}",
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
    families = arguments.families or list(FAMILIES)
    campaign = bench.Campaign.of(
        {
            "name": "sequences",
            "solvers": [{"name": s, "optional": True} for s in arguments.solvers.split(",")],
            "tolerances": [arguments.tol],
            "time_limit": arguments.limit,
            "wall_limit": 10 * arguments.limit,  # of CPU time is enough on a busy machine
            "problems": [group(family, arguments.steps) for family in families],
        }
    )
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "sequences.sqlite"
        bench.run_campaign(campaign, store, tell=print)
        rows = profiles.load(store, start=None)
        load = max(row["load"] for row in rows)
        table = [shown(row) for row in profiles.along(store, rows)]
    for row in table:
        print(*row.values())
    if arguments.results:
        _results.store(
            arguments.results,
            table,
            title="Warm against cold along sequences",
            note=f"tolerance {arguments.tol:g}, {arguments.limit:g} s of CPU a solve, consecutive"
            f" problems from the middle of the stored states; load up to {load:.1f}",
        )


if __name__ == "__main__":
    main()
