"""Large walls: CPU time of `auto` by size, on one thread and on several, and the memory.

    python -m workshop.tables.walls [--contacts 10000 30000 100000] [--threads 1 2]
        [--push 1] [--tol 1e-6] [--limit 600] [--memory 20] [--results walls]

The walls are of the family Wall, in running bond; PUSH is a horizontal impulse on one block. Each
solve is a process of its own: CPU time and time of the wall clock with conversions, the largest
memory of the process, which may take at most --memory GB of addresses. The exponent is that of the
CPU time over the number of contacts, from the row before with as many threads. The load is that of
the machine as the solve began: on a busy one the wall clock says little of threads.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import time
from typing import Any

import fclib
from fclib import scenes
from workshop.tables import _results


def solved(job: dict[str, Any]) -> dict[str, Any]:
    """One solve, in this process."""
    most = int(job["memory"] * 1e9)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    made: Any = scenes.assemblies()["Wall"]()
    problem = made.of_size(job["contacts"], job["push"], 0)
    load, wall, cpu = os.getloadavg()[0], time.perf_counter(), time.process_time()
    result = fclib.solve(
        problem, "auto", job["tol"], time_limit=job["limit"], threads=job["threads"]
    )
    return {
        "contacts": problem.nc,
        "threads": job["threads"],
        "ends": result.status,
        "error": result.error,
        "CPU [s]": time.process_time() - cpu,
        "wall clock [s]": time.perf_counter() - wall,
        "factorisations": sum(stage.factorisations for stage in result.stages),
        "memory [GB]": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9,
        "load": load,
    }


def main() -> None:
    """A row for each size and number of threads."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--contacts", type=int, nargs="+", default=[10_000, 30_000, 100_000])
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--push", type=float, default=1.0)
    parser.add_argument("--tol", type=float, default=1e-6)
    parser.add_argument("--limit", type=float, default=600, help="[s] of a solve")
    parser.add_argument("--memory", type=float, default=20, help="[GB]")
    _results.add_option(parser)
    arguments = parser.parse_args()
    rows: list[dict[str, Any]] = []
    last: dict[int, dict[str, Any]] = {}
    for contacts in arguments.contacts:
        for threads in arguments.threads:
            job = {**vars(arguments), "contacts": contacts, "threads": threads}
            done = subprocess.run(
                [sys.executable, __file__, "--solve", json.dumps(job)],
                capture_output=True,
                text=True,
            )
            if done.returncode != 0:
                raise SystemExit(done.stderr)
            row: dict[str, Any] = json.loads(done.stdout)
            before = last.get(threads)
            times = before and row["CPU [s]"] / before["CPU [s]"]
            row["exponent"] = (
                math.log(times) / math.log(row["contacts"] / before["contacts"])
                if before and times
                else ""
            )
            last[threads] = row
            rows.append(row)
            print(*row.values(), sep="  ", flush=True)
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="Large walls, on one thread and on two",
            note=f"Family Wall, a push of {arguments.push:g}, to {_results.power(arguments.tol)}, "
            f"at most {arguments.limit:g} s and {arguments.memory:g} GB; load is that of the "
            "machine as the solve began.",
        )


if __name__ == "__main__":
    if "--solve" in sys.argv:
        print(json.dumps(solved(json.loads(sys.argv[-1]))))
    else:
        main()
