"""What the bench itself costs a run: small problems, many runs, what is not the solver's.

    python -m workshop.tables.bench_overhead --runs 10000 --jobs 2

One row is of built-in solvers, whose runs share a process, and one of a solver in Python, of which
each run has its own. The overhead is the CPU time of the campaign and its supervisors, with their
start, less what the runs took, over the runs; the memory is that of the process that conducts the
campaign. No run may be lost or doubled.
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import time
from pathlib import Path
from typing import Any

from fclib import bench
from fclib.bench import profiles
from workshop.tables import _results

FOREIGN = """
import fclib

@fclib.solver("overhead")
def overhead(problem, r, monitor):
    '''Calls one of the built-in solvers.'''
    if not monitor.stop(r):
        r[:] = fclib.solve(problem, "nsgs", monitor.tolerance / 2).solution.r
        monitor.stop(r)
"""
SHARE = 0.1  # of the runs that are of the foreign solver


def spent() -> float:
    """[s] of CPU of this process and of those that it has waited for."""
    kinds = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(u.ru_utime + u.ru_stime for u in map(resource.getrusage, kinds))


def measured(name: str, entries: dict[str, Any], runs: int, jobs: int) -> dict[str, Any]:
    """Run a campaign of so many runs; its row."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "overhead.py").write_text(FOREIGN)
        usual = {
            "name": name,
            "tolerances": [1e-6],
            "repeats": max(1, runs // (10 * len(entries["solvers"]))),
            "problems": [{"planted": {"count": 10, "contacts": 10}}],
        }
        campaign = bench.Campaign.of(usual | entries, Path(folder))
        path = Path(folder) / "overhead.sqlite"
        start, before = time.perf_counter(), spent()
        progress = bench.run_campaign(campaign, path, jobs=jobs)
        wall, cpu = time.perf_counter() - start, spent() - before
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
        with bench.Store(path) as store:
            rows = store.results()
        start, before = time.perf_counter(), spent()
        loaded = profiles.load(path)
        costs = profiles.costs(loaded)
        profiles.summary(costs)
        profiles.pairs(costs)
        profile, profile_cpu = time.perf_counter() - start, spent() - before
    count, keys = len(rows), len({row["key"] for row in rows})
    assert count == keys == progress.planned, (count, keys, progress.planned)
    taken = sum(row["total_cpu_s"] for row in rows)
    return {
        "solver": name,
        "runs": count,
        "solved": progress.solved,
        "at once": jobs,
        "CPU of the runs [s]": taken,
        "overhead a run, CPU [ms]": 1e3 * (cpu - taken) / count,
        "wall clock [s]": wall,
        "memory of the campaign [MB]": memory,
        "profile, CPU [s]": profile_cpu,
        "profile, wall clock [s]": profile,
        "load": os.getloadavg()[0],
    }


def main() -> None:
    """Run, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--jobs", type=int, default=1)
    _results.add_option(parser)
    arguments = parser.parse_args()
    kinds: list[tuple[str, dict[str, Any], int]] = [
        ("built in", {"solvers": ["auto", "nsgs"]}, arguments.runs),
        (
            "foreign",
            {"solvers": ["overhead"], "modules": ["overhead.py"]},
            int(SHARE * arguments.runs),
        ),
    ]
    entries = [measured(name, more, runs, arguments.jobs) for name, more, runs in kinds]
    for entry in entries:
        shown = (f"{v:.4g}" if isinstance(v, float) else str(v) for v in entry.values())
        print("; ".join(f"{name}: {value}" for name, value in zip(entry, shown, strict=True)))
    if arguments.results:
        _results.store(arguments.results, entries, title="What the bench costs a run")


if __name__ == "__main__":
    main()
