"""What the bench itself costs a run: small problems, many runs, what is not the solver's.

    .venv/bin/python benchmarks/bench_overhead.py --runs 10000 --jobs 2

The overhead is the CPU time of the campaign and its supervisors, with their start, less what the
runs took, over the runs; the memory is that of the process that conducts the campaign. No run may
be lost or doubled.
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import time
from pathlib import Path

import _results

from fclib import bench
from fclib.bench import profiles


def spent() -> float:
    """[s] of CPU of this process and of those that it has waited for."""
    kinds = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(u.ru_utime + u.ru_stime for u in map(resource.getrusage, kinds))


def main() -> None:
    """Run, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--jobs", type=int, default=1)
    _results.add_option(parser)
    arguments = parser.parse_args()
    campaign = bench.Campaign.of(
        {
            "name": "overhead",
            "solvers": ["auto", "nsgs"],
            "tolerances": [1e-6],
            "repeats": max(1, arguments.runs // 20),
            "problems": [{"planted": {"count": 10, "contacts": 10}}],
        }
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "overhead.sqlite"
        start, before = time.perf_counter(), spent()
        progress = bench.run_campaign(campaign, path, jobs=arguments.jobs)
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
    runs = sum(row["total_cpu_s"] for row in rows)
    entry = {
        "runs": count,
        "solved": progress.solved,
        "at once": arguments.jobs,
        "CPU of the runs [s]": runs,
        "overhead a run, CPU [ms]": 1e3 * (cpu - runs) / count,
        "wall clock [s]": wall,
        "memory of the campaign [MB]": memory,
        "profile, CPU [s]": profile_cpu,
        "profile, wall clock [s]": profile,
        "load": os.getloadavg()[0],
    }
    for name, value in entry.items():
        print(f"{name}: {value:.4g}")
    if arguments.results:
        _results.store(arguments.results, [entry], title="What the bench costs a run")


if __name__ == "__main__":
    main()
