"""The leaderboard: the solvers of each set, by what they solve, with version, machine and date.

`boards` says which parts a set has. Solvers are compared as everywhere (`bench.comparison`): on the
instances that all of them have run and take, each family with the same weight. Times of several
machines are brought to the scale of one by their calibrations.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

from fclib.bench import comparison, profiles
from fclib.bench.comparison import in_order, numbers_in, odds, words_in
from fclib.results.beside import alone
from fclib.results.boards import at_one_limit, by_name, digests_of, sources
from fclib.results.shards import Shard, rows_of

WEIGH: profiles.Weigh = "families"


def leaders(parts: Sequence[Shard]) -> list[dict[str, Any]]:
    """A row for each set, tolerance and solver, the best first.

    `of` has the problems that a solver has run and takes; the interval is Wilson's, of the chance
    to solve one more of the set. `mean [s]` is the shifted geometric mean of CPU times.

    Raises:
        BesideError: parts of several machines, of which one was not calibrated.
        ShardError: a part cannot be read.
        ProfileError: there is nothing to compare.
    """
    return [row for name, own in sources(by_name(parts)).items() for row in of_set(name, own)]


def of_set(name: str, parts: Sequence[Shard]) -> list[dict[str, Any]]:
    """The rows of a set."""
    digests = digests_of(name, parts)
    if not digests:
        return []
    measured: dict[str, set[str]] = defaultdict(set)  # the machines of each solver
    for part in parts:
        for row in rows_of(part.path, ("solver", "node", "hash")):
            if row["hash"] in digests:
                measured[row["solver"]].add(row["node"])
    with alone([part.path for part in parts], digests) as joined:
        runs = at_one_limit(name, profiles.load(joined.path))
    costs = comparison.compared(profiles.gather(runs))
    solver, started = words_in(runs, "solver"), numbers_in(runs, "started")
    found = []
    for row in profiles.summary(costs, weigh=WEIGH):
        if row["solver"] == profiles.VIRTUAL_BEST:
            continue
        own = runs.where(solver == row["solver"])
        label = row["solver"].partition(" (")[0]
        low, high = odds(row["solved"], row["of"])
        found.append(
            {
                "set": name,
                "tol": row["tol"],
                "solver": row["solver"],
                "version": ", ".join(str(word) for word in in_order(words_in(own, "version"))),
                "solved": row["solved"],
                "of": row["of"],
                "share": row["share"],
                "95 % interval": f"{low:.2f} to {high:.2f}",
                "mean [s]": row["mean"],
                "machine": ", ".join(sorted(measured[label])),
                "date": day(max(started[solver == row["solver"]], default=0.0)),
            }
        )
    return found


def day(seconds: float) -> str:
    """The day of a time since 1970."""
    return time.strftime("%Y-%m-%d", time.gmtime(seconds))
