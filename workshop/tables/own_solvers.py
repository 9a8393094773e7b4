"""`auto` beside each of our own solvers, family by family.

    python -m workshop.tables.own_solvers FILE... [--tol 1e-4] [--solvers NAME...] [--seconds 2]
        [--results own-solvers-1e-4]

CPU time of a whole solve, conversions included: the least of three runs, of more if they are short,
or one if it is long. A solver that does not solve a problem counts with twice the limit. Of each
family there is the geometric mean of its problems for `auto`, over that of the best of the solvers,
chosen in hindsight for the family. `most of auto` is the method on which `auto` spends most in the
family. `looser` is the worst ratio of the time of `auto` to this tolerance over that to a hundredth
of it: above 1.05, a loose tolerance costs more than a tight one.
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import fclib
from workshop.tables import _results

SOLVERS = ["nsgs", "admm", "apgd", "bb", "nsn-ac", "nsip", "ppa-nsn"]
RUNS = 3
LONG = 0.1  # [s] a run that is not repeated
ENOUGH = 0.01  # [s] more runs are made until they took so long


def seconds(problem: Any, solver: str, tol: float, limit: float) -> tuple[float, Any]:
    """The least CPU time of a solve, or twice the limit, and the last result."""
    least = math.inf
    runs, spent = 0, 0.0
    while runs < RUNS or spent < ENOUGH:
        start = time.process_time()
        try:
            result = fclib.solve(problem, solver, tol, time_limit=limit)
        except fclib.UnsuitableError:  # it does not take the law of the problem
            return 2 * limit, None
        taken = time.process_time() - start
        runs, spent, least = runs + 1, spent + taken, min(least, taken)
        if result.status != "converged":
            return 2 * limit, result
        if least > LONG:
            break
    return least, result


def mean(values: list[float]) -> float:
    return math.exp(sum(map(math.log, values)) / len(values))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--tol", type=float, default=1e-4)
    parser.add_argument("--solvers", nargs="+", default=SOLVERS)
    parser.add_argument("--seconds", type=float, default=2, help="limit of a solve")
    _results.add_option(parser)
    arguments = parser.parse_args()

    times: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    spent: dict[str, Counter[str]] = defaultdict(Counter)
    looser: dict[str, float] = defaultdict(float)
    for path in arguments.files:
        problem: Any = fclib.read(path)
        family = path.parent.name
        own, result = seconds(problem, "auto", arguments.tol, arguments.seconds)
        tight, _ = seconds(problem, "auto", arguments.tol / 100, arguments.seconds)
        looser[family] = max(looser[family], own / tight)
        spent[family]["conversions and judge"] += result.setup_s
        for stage in result.stages:
            spent[family][stage.name] += stage.cpu_s
        times[family]["auto"].append(own)
        for solver in arguments.solvers:
            found, _ = seconds(problem, solver, arguments.tol, arguments.seconds)
            times[family][solver].append(found)

    rows = []
    for family, by_solver in sorted(times.items()):
        means = {solver: mean(values) for solver, values in by_solver.items()}
        best = min(arguments.solvers, key=means.__getitem__)
        rows.append(
            {
                "family": family,
                "problems": str(len(by_solver["auto"])),
                "auto [ms]": f"{1e3 * means['auto']:.3g}",
                "best": best,
                "best [ms]": f"{1e3 * means[best]:.3g}",
                "ratio": f"{means['auto'] / means[best]:.2f}",
                "most of auto": spent[family].most_common(1)[0][0],
                "looser": f"{looser[family]:.2f}",
            }
        )
    rows.sort(key=lambda row: -float(row["ratio"]))
    for row in rows:
        print("  ".join(f"{value:>12}" for value in row.values()))
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="auto beside each of our own solvers",
            note=f"Tolerance {arguments.tol:g}, limit {arguments.seconds:g} s of a solve.",
        )


if __name__ == "__main__":
    main()
