"""CPU time of this fclib beside another one's, on files, in one run.

    python -m workshop.tables.against_another OTHER FILE... [--solver auto] [--tol 1e-8]
        [--repeats 5]

OTHER is the Python that imports the other fclib (a virtual environment of an older version). Both
solve each file in turn, in processes of their own; the least CPU time of the repeats counts, with
what surrounds the solver (`cpu_s + setup_s`). The table has a row for each file, the last line the
geometric mean of the ratios, this one's over the other's.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

WORKER = """
import json, sys
import fclib
for line in sys.stdin:
    job = json.loads(line)
    try:
        result = fclib.solve(fclib.read(job["file"]), job["solver"], job["tol"], time_limit=60)
        answer = [result.status, result.cpu_s + result.setup_s, result.iterations, result.error]
    except fclib.Error as error:
        answer = [type(error).__name__, None, 0, None]
    print(json.dumps(answer), flush=True)
"""


class Worker:
    """A process that solves files with the fclib of its Python."""

    def __init__(self, python: str) -> None:
        self._python = python
        self._process = subprocess.Popen(
            [python, "-c", WORKER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def solve(self, **job: Any) -> tuple[str, float | None, int, float | None]:
        """Status, CPU time [s], iterations and error."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(job) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit(f"{self._python}: has ended with {self._process.wait()}")
        status, cpu_s, iterations, error = json.loads(line)
        return status, cpu_s, iterations, error


def main() -> None:
    """Solve, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("other", help="the Python of the other fclib")
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--solver", default="auto")
    parser.add_argument("--tol", type=float, default=1e-8)
    parser.add_argument("--repeats", type=int, default=5)
    asked = parser.parse_args()
    workers = Worker(sys.executable), Worker(asked.other)
    ratios = []
    print(f"{'file':40} {'this':>12} {'other':>12} {'CPU ratio':>10}")
    for file in asked.files:
        job = {"file": str(file.resolve()), "solver": asked.solver, "tol": asked.tol}
        runs: list[list[Any]] = [[], []]
        for _ in range(asked.repeats + 1):  # the first warms up
            for own, worker in zip(runs, workers, strict=True):
                own.append(worker.solve(**job))
        words = [own[-1][0] for own in runs]
        times = [min((one[1] for one in own[1:] if one[1] is not None), default=0) for own in runs]
        ratio = times[0] / times[1] if all(times) else math.nan
        if words[0] == words[1] == "converged":
            ratios.append(ratio)
        print(f"{file.name[:40]:40} {words[0]:>12} {words[1]:>12} {ratio:10.2f}")
    if ratios:
        mean = math.exp(sum(map(math.log, ratios)) / len(ratios))
        print(f"\ngeometric mean over {len(ratios)} that both solve: {mean:.3f}")


if __name__ == "__main__":
    main()
