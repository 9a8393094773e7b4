"""What a sweep and an iteration of the interior point cost: for the cost model of `auto`.

    python -m workshop.tuning.costs FILE... [--seconds 1]

`auto` sweeps on while that costs less than the interior point would (core/chain/stages.cpp:
sweep_operations, sweep_operations_of_others, iteration_operations). A row has the median over the
problems of a law: CPU time of a sweep of `nsgs` and of an iteration of `nsip` for each contact, and
their ratio.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path
from statistics import median
from typing import Any

import fclib
from fclib.collections.build import facts_of

SWEEPS = 60
ITERATIONS = 40
LEAST = (15, 5)  # with fewer sweeps or iterations, a time says little


def main() -> None:
    """Print the costs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--seconds", type=float, default=1, help="limit of a solve")
    own = parser.parse_args()
    found: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for path in own.files:
        problem: Any = fclib.read(path)
        times = []
        for solver, most, least in (("nsgs", SWEEPS, LEAST[0]), ("nsip", ITERATIONS, LEAST[1])):
            result = fclib.solve(
                problem, solver, 1e-12, max_iterations=most, time_limit=own.seconds
            )
            if result.iterations >= least:
                times.append(result.cpu_s / result.iterations / problem.nc)
        if len(times) == len(LEAST):
            found[facts_of(problem)["law"]].append((times[0], times[1]))
    for law, rows in sorted(found.items()):
        sweep, iteration = (1e9 * median(row[k] for row in rows) for k in range(2))
        ratio = median(b / a for a, b in rows)
        print(
            f"{law:>10}  problems {len(rows):4d}  sweep {sweep:7.1f} ns a contact"
            f"  iteration {iteration:8.1f} ns  ratio {ratio:6.1f}"
        )


if __name__ == "__main__":
    main()
