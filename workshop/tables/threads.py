"""Sweeps on several threads: what the order by colours costs, and what the threads gain.

    python -m workshop.tables.threads FILE... [--solver nsgs] [--threads 1 2 4]
        [--tol 1e-4] [--limit 60] [--sweeps 100] [--repeat 3] [--results NAME]

For each number of threads: the sweeps to the tolerance and their wall-clock time, the making of
the colours with it; then the CPU time of a sweep, all threads together, and its wall-clock time,
the least over windows of a few sweeps and one evaluation of the error, in --repeat runs of --sweeps
sweeps: short windows find the moments in which a shared machine is free. The runs of different
numbers take turns. The ratios in brackets are to the first number. One thread sweeps in the given
order, several by colours.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import fclib
from workshop.tables import _results

WINDOW = 4  # sweeps


@dataclass
class Timed:
    """The runs of one number of threads; times in s."""

    sweeps: int = 0
    to_tolerance: float = 0.0
    converged: bool = False
    wall: list[float] = field(default_factory=list)  # of a sweep
    cpu: list[float] = field(default_factory=list)


def wall_of(result: fclib.Result) -> float:
    """[s] from the first report of the solver to its last."""
    assert result.history is not None
    return float(np.ptp(result.history["time"]))


def run(problem: fclib.Problem, arguments: argparse.Namespace) -> dict[int, Timed]:
    """All runs on one problem, by the number of threads."""
    timed = {threads: Timed() for threads in arguments.threads}
    for threads, entry in timed.items():
        result = fclib.solve(
            problem,
            arguments.solver,
            arguments.tol,
            threads=threads,
            time_limit=arguments.limit,
            history=True,
        )
        entry.sweeps, entry.converged = result.iterations, result.converged
        entry.to_tolerance = wall_of(result)
    for _ in range(arguments.repeat):
        for threads, entry in timed.items():
            result = fclib.solve(
                problem,
                arguments.solver,
                0.0,
                threads=threads,
                max_iterations=arguments.sweeps,
                error_interval=WINDOW,
                history=True,
            )
            assert result.history is not None
            times = result.history["time"][1:]  # the first has the making of the colours before it
            entry.wall.append(float(np.diff(times).min()) / WINDOW)
            entry.cpu.append(result.cpu_s / result.iterations)
    return timed


def main() -> None:
    """Print a row for each problem and number of threads."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--solver", choices=["nsgs", "psor"], default="nsgs")
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--tol", type=float, default=1e-4)
    parser.add_argument("--limit", type=float, default=60.0, help="[s] for each solve")
    parser.add_argument("--sweeps", type=int, default=100, help="timed, at --repeat times")
    parser.add_argument("--repeat", type=int, default=3)
    _results.add_option(parser)
    arguments = parser.parse_args()
    heads = [
        "problem",
        "contacts",
        "threads",
        "sweeps",
        "wall clock [s]",
        "a sweep, wall clock [ms]",
        "a sweep, CPU [ms]",
    ]
    print(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|")
    rows = []
    for path in arguments.files:
        problem = fclib.read(path)
        if isinstance(problem, fclib.GlobalProblem):
            problem = problem.condense()
        timed = run(problem, arguments)
        first = timed[arguments.threads[0]]
        for threads, entry in timed.items():
            wall, cpu = min(entry.wall), min(entry.cpu)
            gain = f" ({entry.to_tolerance / first.to_tolerance:.2f})"
            cells = [
                path.stem,
                str(problem.nc),
                str(threads),
                f"{entry.sweeps}" if entry.converged else f"more than {entry.sweeps}",
                f"{entry.to_tolerance:.3g}{gain if entry.converged and first.converged else ''}",
                f"{1e3 * wall:.3g} ({wall / min(first.wall):.2f})",
                f"{1e3 * cpu:.3g} ({cpu / min(first.cpu):.2f})",
            ]
            print(f"| {' | '.join(cells)} |", flush=True)
            rows.append(dict(zip(heads, cells, strict=True)))
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="Sweeps on several threads; in brackets the ratio to the first row of a problem",
            note=f"`{arguments.solver}` to {_results.power(arguments.tol)} within "
            f"{arguments.limit:g} s, and {arguments.repeat} times {arguments.sweeps} sweeps.",
        )


if __name__ == "__main__":
    main()
