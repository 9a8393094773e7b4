"""The leaderboard: the solvers of each set, by what they solve, with version, machine and date.

`boards` says which parts a set has. Solvers are compared as everywhere (`bench.comparison`): on the
instances that all of them have run and take, each family with the same weight. Times of several
machines are brought to the scale of one by their calibrations.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Container, Sequence
from typing import Any, TypeAlias

from fclib.bench import comparison, profiles
from fclib.bench.comparison import in_order, numbers_in, odds, words_in
from fclib.results.beside import alone
from fclib.results.boards import by_name, digests_of, sources
from fclib.results.shards import Shard, rows_of

Tell: TypeAlias = Callable[[str], object]
WEIGH: profiles.Weigh = "families"


def leaders(parts: Sequence[Shard], tell: Tell | None = None) -> list[dict[str, Any]]:
    """A row for each set, tolerance and solver, the best first.

    `of` has the problems that a solver has run and takes. `share` is the share of solved ones, each
    family with the same weight. Its interval is Wilson's, for as many problems as these weights
    are worth (Kish 1965). `mean [s]` is the shifted geometric mean of CPU times.

    Args:
        parts: the parts.
        tell: is called with a line for each reason why solvers are left out of a set.

    Raises:
        BesideError: parts of several machines, of which one was not calibrated.
        ShardError: a part cannot be read.
        ProfileError: there is nothing to compare.
    """
    groups = sources(by_name(parts))
    return [row for name, own in groups.items() for row in of_set(name, own, tell)]


def of_set(name: str, parts: Sequence[Shard], tell: Tell | None = None) -> list[dict[str, Any]]:
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
        runs, short = profiles.load(joined.path), joined.short
    costs = comparison.compared(profiles.gather(runs))
    solver, started = words_in(runs, "solver"), numbers_in(runs, "started")
    labels = {found: named(found, measured) for found in map(str, solver.present())}
    compared = {labels[one] for one in costs.solvers}
    few = "they have run too few of its problems"
    most = max(numbers_in(runs, "time_limit"))
    left_out: dict[str, list[str]] = defaultdict(list)  # the solvers, by the reason
    for one in sorted((short.keys() | set(labels.values())) - compared):
        limited = one in short
        why = f"they had {short[one]:g} s or less, and most solvers {most:g} s" if limited else few
        left_out[why].append(one)
    for why, names in left_out.items():
        if tell is not None:
            tell(f"{name}: left out because {why}: {', '.join(names)}")
    weights = {tol: costs.at(tol).weights(WEIGH) for tol in costs.tolerances}
    found = []
    for row in profiles.summary(costs, weigh=WEIGH):
        if row["solver"] == profiles.VIRTUAL_BEST:
            continue
        own = runs.where(solver == row["solver"])
        place = costs.solvers.index(row["solver"])
        worth = 1 / float((weights[row["tol"]][:, place] ** 2).sum())
        share = min(1.0, row["share"])
        low, high = odds(share * worth, worth)
        found.append(
            {
                "set": name,
                "tol": row["tol"],
                "solver": row["solver"],
                "version": ", ".join(str(word) for word in in_order(words_in(own, "version"))),
                "solved": row["solved"],
                "of": row["of"],
                "share": share,
                "95 % interval": f"{low:.2f} to {high:.2f}",
                "mean [s]": row["mean"],
                "machine": ", ".join(sorted(measured[labels[row["solver"]]])),
                "date": day(max(started[solver == row["solver"]], default=0.0)),
            }
        )
    return found


def named(label: str, known: Container[str]) -> str:
    """The name of a solver without what tells its versions apart."""
    while label not in known and " (" in label:
        label = label.rpartition(" (")[0]
    return label


def day(seconds: float) -> str:
    """The day of a time since 1970."""
    return time.strftime("%Y-%m-%d", time.gmtime(seconds))
