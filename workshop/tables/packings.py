"""What a solver does on jammed packings: each size and seed, at rest and pushed.

    python -m workshop.tables.packings [--contacts 1000 3000] [--limit 20 120]
        [--seeds 0 1 2 3 4 5 6 7] [--counts 8 4] [--solver auto] [--results packings]

One row a size and kind. A limit is CPU time of a solve [s], one for each size; --counts are the
seeds of each size, of --seeds the first ones. What is not solved counts with the error of its best
iterate. The self-stress is what `fclib analyze` proves, and its time that of the whole analysis.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections import Counter
from typing import Any

import fclib
from fclib import analysis
from fclib.scenes import assemblies
from workshop.tables import _results

KINDS = {"at rest": 0.0, "pushed": 1.0}


def row(solver: str, contacts: int, kind: str, seeds: list[int], limit: float) -> dict[str, Any]:
    """Solve the packings of a size and kind."""
    family: Any = assemblies()["Packing"]()
    sizes, spent, proofs, errors, stresses = [], [], [], [], Counter[str]()
    proven = 0
    for seed in seeds:
        problem = family.of_size(contacts, KINDS[kind], seed)
        end = time.process_time() + limit
        result = fclib.solve(problem, solver, callback=lambda *_, e=end: time.process_time() < e)
        merit = fclib.merit(problem, result.solution)
        sizes.append(problem.nc)
        if result.converged:
            spent.append(result.cpu_s)
        else:
            errors.append(merit.error)
        start = time.process_time()
        stress = analysis.analyze(problem).self_stress.verdict
        proofs.append(time.process_time() - start)
        stresses[stress] += 1
        proven += stress == "solvable" and proofs[-1] <= limit
        print(
            f"{kind}, {problem.nc} contacts, seed {seed}: {result.status} in {result.cpu_s:.1f} s, "
            f"error {merit.error:.1e}, self-stress {stress} in {proofs[-1]:.1f} s",
            flush=True,
        )
    return {
        "contacts": f"{min(sizes)} to {max(sizes)}",
        "packing": kind,
        "limit [s]": f"{limit:g}",
        "solved to 1e-8": f"{len(spent)} of {len(seeds)}",
        "median CPU of these [s]": f"{statistics.median(spent):.1f}" if spent else "",
        "errors of the others": f"{min(errors):.0e} to {max(errors):.0e}" if errors else "",
        "proven solvable within the limit": f"{proven} of {len(seeds)}",
        "self-stress": ", ".join(f"{count} {name}" for name, count in sorted(stresses.items())),
        "median CPU of the analysis [s]": f"{statistics.median(proofs):.1f}",
    }


def main() -> None:
    """Print a line for each solve, and the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--contacts", type=int, nargs="+", default=[1000])
    parser.add_argument("--limit", type=float, nargs="+", default=[20.0])
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(8)))
    parser.add_argument("--counts", type=int, nargs="+", help="all by default")
    parser.add_argument("--solver", default="auto")
    _results.add_option(parser)
    arguments = parser.parse_args()
    if len(arguments.limit) != len(arguments.contacts):
        parser.error("--limit: one for each of --contacts")
    counts = arguments.counts or [len(arguments.seeds)] * len(arguments.contacts)
    if len(counts) != len(arguments.contacts):
        parser.error("--counts: one for each of --contacts")
    sizes = zip(arguments.contacts, arguments.limit, counts, strict=True)
    rows = [
        row(arguments.solver, contacts, kind, arguments.seeds[:count], limit)
        for contacts, limit, count in sizes
        for kind in KINDS
    ]
    for line in rows:
        print(", ".join(f"{key}: {value}" for key, value in line.items()))
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title=f"Packings by {arguments.solver}",
            note="Family Packing, the first of the seeds " + ", ".join(map(str, arguments.seeds)),
        )


if __name__ == "__main__":
    main()
