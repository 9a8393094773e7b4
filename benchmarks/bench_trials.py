"""What the bench withstands, and how well it repeats itself.

    .venv/bin/python benchmarks/bench_trials.py nasty               # solvers that cheat and leak
    .venv/bin/python benchmarks/bench_trials.py kills --kills 200   # of workers and supervisors
    .venv/bin/python benchmarks/bench_trials.py twice --jobs 1      # the same campaign two times

`nasty` runs the solvers of tests/python/test_bench_limits.py: by how much each exceeds its limit,
and the CPU time of a run after it over that of one before. `kills` compares every row with that
of a quiet campaign. `twice` compares statuses, iterations and times. Each ends with exit status 1
where something is not as it should be.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import importlib
import os
import random
import signal
import statistics
import sys
import tempfile
import textwrap
import threading
import time
from pathlib import Path
from typing import Any

import _results

from fclib import bench
from fclib.bench import pool, processes

ROOT = Path(__file__).resolve().parents[1]
LATE = 2.0  # [s] beyond its limit, when a run has to have ended
TOUCHED = 0.2  # change of the CPU time of the next run
SAME = ("problem", "solver", "tol", "repeat", "status", "solved", "iterations", "error")
FLOOD = """

@bad
def floods(problem, r, monitor):
    # 10 GB of output, as far as it comes within its limit
    for _ in range(10_000):
        for fd in (1, 2):
            os.write(fd, b"garbage " * 62_500)
    solved(monitor, r)
"""


def campaign(**changes: Any) -> bench.Campaign:
    """Small problems, by three solvers."""
    entries: dict[str, Any] = {
        "name": "trials",
        "solvers": ["auto", "nsgs", "nsn-ac"],
        "tolerances": [1e-6],
        "repeats": 1,
        "problems": [{"planted": {"count": 6, "contacts": 60, "seed": 1}, "family": "planted"}],
    }
    return bench.Campaign.of(entries | changes)


def rows_of(path: Path) -> list[dict[str, Any]]:
    """The runs of a store, by what they are of."""
    with bench.Store(path) as store:
        return sorted(store.results(), key=lambda row: [str(row[name]) for name in SAME[:4]])


def nasty(folder: Path, _: argparse.Namespace) -> tuple[list[dict[str, Any]], bool]:
    """A row a solver."""
    sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "python")]
    trials: Any = importlib.import_module("test_bench_limits")
    trials.BAD += textwrap.indent(FLOOD, "    ")
    trials.EXPECTED["floods"] = "cpu_limit or wall_limit"
    prepared = folder / "bad"
    prepared.mkdir()
    trials.prepare(prepared)
    os.environ["FCLIB_TEST_SPIN"] = str(prepared / "spin.so")
    supervisor = pool.SupervisorClient(1)
    found, good = [], True
    usual = dataclasses.replace(
        trials.job(prepared, "nsn-ac"), problem=campaign().plan()[0].problem
    )
    for name, expected in trials.EXPECTED.items():
        wall = trials.LIMIT if expected == "wall_limit" else 60 * trials.LIMIT
        before = least(supervisor, usual)
        record = supervisor.do(trials.job(prepared, f"bad-{name}", wall=wall))
        after = least(supervisor, usual)
        over = (record.total_cpu_s or 0.0) - trials.LIMIT
        if expected == "wall_limit":
            over = (record.wall_s or 0.0) - trials.LIMIT
        right = (
            record.status in expected.split(" or ")
            and over < LATE
            and after < (1 + TOUCHED) * before
        )
        good = good and right
        found.append(
            {
                "solver": name,
                "status": record.status,
                "beyond its limit [s]": max(0.0, over),
                "next run's CPU, over that before": after / before,
                "as it should be": "yes" if right else f"no, expected {expected}",
            }
        )
    supervisor.end()
    return found, good


def least(supervisor: pool.SupervisorClient, job: Any) -> float:
    """[s] of CPU of a solve, the least of twelve."""
    return min(supervisor.do(job).cpu_s or float("inf") for _ in range(12))


def kills(folder: Path, arguments: argparse.Namespace) -> tuple[list[dict[str, Any]], bool]:
    """Compare a campaign of which processes are killed with a quiet one."""
    chosen = campaign(repeats=arguments.repeats)
    bench.run_campaign(chosen, folder / "quiet.sqlite", jobs=2)
    stop = threading.Event()
    killed = {"supervisors": 0, "workers": 0}
    draw = random.Random(1)

    def kill() -> None:
        while not stop.is_set() and sum(killed.values()) < arguments.kills:
            time.sleep(draw.uniform(0.02, 0.15))
            supervisors = [
                pid
                for pid in processes.children(os.getpid())
                if pool.MARK.encode() in environment(pid)
            ]
            workers = [pid for one in supervisors for pid in processes.children(one)]
            kind = "workers" if draw.random() < 0.7 else "supervisors"
            if targets := workers if kind == "workers" else supervisors:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(draw.choice(targets), signal.SIGKILL)
                    killed[kind] += 1

    killer = threading.Thread(target=kill)
    killer.start()
    starts = 0
    while True:
        starts += 1
        progress = bench.run_campaign(chosen, folder / "killed.sqlite", jobs=2)
        if progress.done == progress.planned or starts > 100:
            break
    stop.set()
    killer.join()
    quiet, loud = rows_of(folder / "quiet.sqlite"), rows_of(folder / "killed.sqlite")
    different = sum(
        any(a[name] != b[name] for name in SAME) for a, b in zip(quiet, loud, strict=False)
    ) + abs(len(quiet) - len(loud))
    entry = {"runs": len(quiet), **killed, "campaigns begun": starts, "rows that differ": different}
    return [entry], different == 0 and sum(killed.values()) >= arguments.kills


def environment(pid: int) -> bytes:
    """That a process was started with."""
    try:
        return Path(f"/proc/{pid}/environ").read_bytes()
    except OSError:
        return b""


def twice(folder: Path, arguments: argparse.Namespace) -> tuple[list[dict[str, Any]], bool]:
    """Compare a campaign with itself."""
    chosen = campaign(repeats=arguments.repeats)
    for name in ("first", "second"):
        bench.run_campaign(chosen, folder / f"{name}.sqlite", jobs=arguments.jobs)
    first, second = rows_of(folder / "first.sqlite"), rows_of(folder / "second.sqlite")
    different = sum(
        any(a[name] != b[name] for name in SAME) for a, b in zip(first, second, strict=True)
    )
    best: list[dict[tuple[str, str], float]] = [{}, {}]
    for own, rows in zip(best, (first, second), strict=True):
        for row in rows:
            key = row["problem"], row["solver"]
            own[key] = min(own.get(key, float("inf")), row["cpu_s"])
    ratios = [best[1][key] / best[0][key] for key in best[0]]
    median = statistics.median(ratios)
    entry = {
        "runs": len(first),
        "rows that differ": different,
        "median ratio of times": median,
        "least": min(ratios),
        "largest": max(ratios),
        "load": os.getloadavg()[0],
    }
    return [entry], different == 0 and abs(median - 1) < 0.05


TRIALS = {"nasty": nasty, "kills": kills, "twice": twice}


def main() -> None:
    """Run one of them, and print its table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("trial", choices=TRIALS)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=1)
    _results.add_option(parser)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows, good = TRIALS[arguments.trial](Path(folder), arguments)
    for row in rows:
        shown = (f"{v:.3g}" if isinstance(v, float) else str(v) for v in row.values())
        print("; ".join(f"{name}: {value}" for name, value in zip(row, shown, strict=True)))
    if arguments.results:
        _results.store(arguments.results, rows, title=(TRIALS[arguments.trial].__doc__ or ""))
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
