"""One contact: what a call costs beside the solving, from Python and from C.

    python -m workshop.tables.one_contact [--rounds 30] [--calls 2000] [--results NAME]

One sliding contact, solved again and again from nothing. The CPU time of a call is that of a loop
over its calls, the least of many rounds that the calls take by turns, for a busy machine disturbs
most rounds and not all. The solver is the time in its own loop (`Result.cpu_s`), mean over the
same round; what is left of the call is setup: checks, copies, conversions, the merit that judges,
and the language. A workspace and a batch do not tell their solver apart: setup is at most the call.
Builds the C library first; needs a C compiler.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import fclib
from workshop.tables import _results
from workshop.tables._c_library import c_library

ROOT = Path(__file__).resolve().parents[2]
BATCH = 1000  # problems of a batch
HEADS = ("call", "CPU [us]", "solver [us]", "setup [us]")


def contact() -> fclib.LocalProblem:
    """A body that is thrown on the ground, and slides; its W is full."""
    W = np.array([[2.0, 0.3, -0.2], [0.3, 5.0, 0.4], [-0.2, 0.4, 4.0]])
    return fclib.LocalProblem(W=W, q=[-1.0, 3.0, 1.0], mu=[0.5])


def from_python(problem: fclib.LocalProblem, rounds: int, calls: int) -> dict[str, list[float]]:
    """Call, and [us] of all of it and of the solver, which is -1 if it is not told."""
    workspace = fclib.Workspace()
    W = np.repeat(np.asarray(problem.W)[None], BATCH, axis=0)
    q, mu = np.repeat(problem.q[None], BATCH, axis=0), np.repeat(problem.mu[None], BATCH, axis=0)

    def step() -> fclib.Result:
        workspace.forget()  # no call starts from the solution
        return workspace.solve(problem)

    ways: dict[str, tuple[Callable[[], Any], int]] = {
        "fclib.solve": (lambda: fclib.solve(problem), 1),
        "fclib.Workspace.solve": (step, 1),
        f"fclib.solve_batch, of {BATCH}": (lambda: fclib.solve_batch(W, q, mu), BATCH),
    }
    found = {name: [np.inf, -1.0] for name in ways}
    for _ in range(rounds):
        for name, (call, each) in ways.items():
            times = max(calls // each, 1)
            start = time.process_time_ns()
            results = [call() for _ in range(times)]
            spent = 1e-3 * (time.process_time_ns() - start) / times / each
            assert all(np.all(result.converged) for result in results)
            own = -1.0
            if name == "fclib.solve":
                own = 1e6 * sum(result.cpu_s for result in results) / times
            found[name] = min(found[name], [spent, own])
    return found


def from_c(problem: fclib.LocalProblem, rounds: int, calls: int) -> dict[str, list[float]]:
    """The same of the C library."""
    library = c_library()
    numbers = [*np.asarray(problem.W).ravel(), *problem.q, *problem.mu]
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "one_contact"
        subprocess.run(
            [
                *("cc", "-O2", f"-I{ROOT / 'include'}", Path(__file__).with_suffix(".c")),
                *("-o", program, library, f"-Wl,-rpath,{library.parent}"),
            ],
            check=True,
        )
        done = subprocess.run(
            [program, str(rounds), str(calls), *map(repr, map(float, numbers))],
            capture_output=True,
            text=True,
            check=True,
        )
    found = {}
    for line in done.stdout.splitlines():
        name, *figures = line.split()
        found[f"{name}, from C"] = [float(figure) for figure in figures]
    return found


def main() -> None:
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=30, help="the least time counts")
    parser.add_argument("--calls", type=int, default=2000, help="of a round")
    _results.add_option(parser)
    arguments = parser.parse_args()
    problem = contact()
    found = from_python(problem, arguments.rounds, arguments.calls)
    found |= from_c(problem, arguments.rounds, arguments.calls)
    rows = []
    for name, (total, own) in found.items():
        told = own >= 0
        cells = (
            name,
            f"{total:.2f}",
            f"{own:.2f}" if told else "",
            f"{total - own:.2f}" if told else f"{total:.2f} at most",
        )
        rows.append(dict(zip(HEADS, cells, strict=True)))
        print("{:32} {:>8} {:>8} {:>16}".format(*cells))
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="One contact, CPU time of a call",
            note=f"One sliding contact, the least of {arguments.rounds} rounds of "
            f"{arguments.calls} calls.",
        )


if __name__ == "__main__":
    main()
