"""What the bench itself costs a run: small problems, many runs, the time that is not the solver's.

    .venv/bin/python benchmarks/bench_overhead.py --runs 10000 --jobs 2

The overhead is the wall clock times the jobs, less the wall clock of the solves, over the runs. No
run may be lost or doubled.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from pathlib import Path

from fclib import bench


def main() -> None:
    """Run, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--jobs", type=int, default=1)
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
        start = time.perf_counter()
        progress = bench.run_campaign(campaign, path, jobs=arguments.jobs)
        wall = time.perf_counter() - start
        with bench.Store(path) as store:
            rows = store.results()
    count, keys = len(rows), len({row["key"] for row in rows})
    assert count == keys == progress.planned, (count, keys, progress.planned)
    solves = sum(row["wall_s"] for row in rows)
    overhead = (wall * arguments.jobs - solves) / count
    print(
        f"{count} runs, {progress.solved} solved, {wall:.1f} s; the solves {solves:.1f} s; "
        f"overhead {1e3 * overhead:.1f} ms a run; load {os.getloadavg()[0]:.1f}"
    )


if __name__ == "__main__":
    main()
