"""What a store of a million runs costs: to profile it, and to go on with its campaign.

    python -m workshop.tables.million_runs [--runs 1000000] [--keep FOLDER] [--results NAME]

The problems are real, small and planted; the campaign over them is planned as any, and its runs are
made up instead of run: statuses, times and errors by lot, stages as `auto` tells them. Each command
is a process of its own, `fclib profile STORE` and `fclib bench CAMPAIGN`, which finds that nothing
is left to be run; its CPU time and its largest memory are those that the kernel counted.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from fclib import bench
from fclib._solve import MERITS
from fclib.bench.job import Job, Record
from workshop.tables import _results

FCLIB = shutil.which("fclib", path=Path(sys.executable).parent) or "fclib"
SOLVERS = ("auto", "nsgs", "apgd", "admm", "ppa-nsn", "nsn-ac", "nsip", "homotopy")
TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8)
PROBLEMS = 3125
AT_ONCE = 10_000  # runs of one transaction
CAMPAIGN = """
name = "million"
solvers = {solvers}
tolerances = {tolerances}
repeats = {repeats}
[[problems]]
family = "planted"
planted = {{ count = {problems}, contacts = 3, seed = 1 }}
"""
STAGES = json.dumps(
    [
        {"name": name, "families": "splitting", "time": 1.25e-4, "iterations": 100, "solved": True}
        for name in ("sweeps", "islands", "newton")
    ]
)


def record_of(job: Job, draw: random.Random) -> Record:
    """A run that was not run."""
    place = SOLVERS.index(job.solver.name)
    digits = -math.log10(job.tol)
    solved = draw.random() < 0.99 - 0.03 * place - 0.01 * digits
    seconds = 10 ** draw.gauss(-3.5 + 0.1 * place + 0.1 * digits, 0.5)
    error = job.tol * draw.random() if solved else draw.random()
    return Record(
        "converged" if solved else draw.choice(("iteration_limit", "stalled", "time_limit")),
        "" if solved else f"error {error:.3g} after all iterations",
        iterations=draw.randrange(1, 10_000),
        cpu_s=seconds,
        said_cpu_s=seconds,
        setup_s=0.1 * seconds,
        total_cpu_s=1.3 * seconds,
        wall_s=1.4 * seconds,
        memory=draw.uniform(1, 20),
        merits=dict.fromkeys(MERITS, error),
        stages=STAGES if job.solver.name == "auto" else None,
        measured="cgroup",
        warm=True,
        pinned=True,
        machine={"node": "made", "cpu": "up", "cores": 64},
        load=1.0,
        frequency=3000.0,
        started=1.7e9,
    )


def fill(path: Path, jobs: list[Job]) -> None:
    """Store a made-up run of each job."""
    draw = random.Random(1)
    with bench.Store(path) as store:
        number = store.begin("million", "", len(jobs), 0, "made")
        for first in range(0, len(jobs), AT_ONCE):
            part = jobs[first : first + AT_ONCE]
            store.add_all(((job, record_of(job, draw)) for job in part), number)
        store.alive(number, ended=True)


def measured(command: list[str | Path]) -> dict[str, Any]:
    """CPU time, clock and largest memory of a command."""
    begin = time.perf_counter()
    process = subprocess.Popen([FCLIB, *map(str, command)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    words = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise SystemExit(f"{command}: ended with {status}")
    print(words[:2000])
    return {
        "CPU [s]": usage.ru_utime + usage.ru_stime,
        "clock [s]": time.perf_counter() - begin,
        "memory [MB]": usage.ru_maxrss / 1024,
    }


def main() -> None:
    """Make the store, and measure the commands."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1_000_000)
    parser.add_argument("--keep", type=Path, help="keep campaign and store in this folder")
    _results.add_option(parser)
    options = parser.parse_args()
    each = len(SOLVERS) * len(TOLERANCES)
    problems = min(PROBLEMS, max(1, options.runs // each))
    repeats = max(1, options.runs // (problems * each))
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        file, store = folder / "million.toml", folder / "million.sqlite"
        text = CAMPAIGN.format(
            solvers=json.dumps(SOLVERS),
            tolerances=list(TOLERANCES),
            problems=problems,
            repeats=repeats,
        )
        if not store.exists():
            file.write_text(text, encoding="utf-8")
            fill(store, bench.Campaign.read(file).plan())
        rows = []
        for title, command in (
            ("fclib profile STORE", ["profile", store]),
            ("fclib bench CAMPAIGN, all of it done", ["bench", file, "--store", store]),
        ):
            rows.append({"command": title, **measured(command)})
        runs = problems * repeats * each
    print(_results.table(list(rows[0]), rows))
    if options.results:
        _results.store(
            options.results,
            rows,
            title=f"A store of {runs:,} runs",
            note=f"{problems:,} problems by {len(SOLVERS)} solvers at {len(TOLERANCES)} tolerances,"
            f" {repeats} repeats; the runs are made up.",
        )


if __name__ == "__main__":
    main()
