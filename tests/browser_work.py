"""The solvers in the module for browsers beside the native ones, on the problems of golden_work.

    python tests/browser_work.py            what differs from browser_work.csv; exit status 1 if any
    python tests/browser_work.py --write    make the table anew, once a change has been agreed with

Both run by a clock that stands still. browser_work.csv has the runs whose iterations, stages or
status differ, or whose errors differ by more than 1e-12: the mathematics of WebAssembly rounds
otherwise in products of matrices, and what follows from a last digit may be another path.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Iterator
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import fclib
import golden_work
from browser_module import Module
from fclib import _core

TABLE = Path(__file__).with_suffix(".csv")
SAME = 1e-12  # of errors


@dataclass(frozen=True)
class Pair:
    """A run, natively and in the module."""

    problem: str
    solver: str
    native: str  # STATUS ITERATIONS ERROR
    browser: str

    @property
    def key(self) -> tuple[str, str]:
        return self.problem, self.solver


@dataclass(frozen=True)
class Comparison:
    """A pair, and how far it is one."""

    pair: Pair
    same: bool  # status, iterations and stages, and errors within SAME
    bits: bool  # of r


def pairs(module: Module) -> Iterator[Comparison]:
    """Every solver on every problem that it takes."""
    solvers = [solver for solver in fclib.solvers() if solver.origin == "fclib"]
    for name, problem, guess in golden_work.problems():
        kind = "rolling_dimensions" if "Rolling" in type(problem).__name__ else "dimensions"
        for solver in solvers:
            if problem.spacedim in getattr(solver, kind):
                yield compared(module, name, problem, solver, guess)


def compared(module: Module, name: str, problem: Any, solver: Any, guess: Any) -> Comparison:
    native = _core.solve(
        problem,
        solver,
        golden_work.TOLERANCE,
        golden_work.ITERATIONS,
        math.inf,
        {},
        guess,
        None,
        False,
        True,
        lambda: 0.0,
    )
    settings = {
        "solver": solver.name,
        "tol": golden_work.TOLERANCE,
        "max_iterations": golden_work.ITERATIONS,
        "merit": "natural",
        "guess": guess,
    }
    browser = module("solve_still", problem, settings)
    names = ("name", "calls", "iterations", "factorisations")
    stages = [tuple(getattr(stage, one) for one in names) for stage in native.stages]
    same = (native.status, native.iterations, stages) == (
        browser["status"],
        browser["iterations"],
        [tuple(stage[one] for one in names) for stage in browser["stages"]],
    )
    distance = abs(native.error - browser["error"])
    pair = Pair(
        name,
        solver.name,
        f"{native.status} {native.iterations} {native.error:.1e}",
        f"{browser['status']} {browser['iterations']} {browser['error']:.1e}",
    )
    near = distance <= SAME or native.error == browser["error"]
    bits = native.solution.r.tobytes() == browser["solution"]["r"].tobytes()
    return Comparison(pair, same and near, bits)


def read() -> dict[tuple[str, str], Pair]:
    with TABLE.open(newline="") as file:
        found = [Pair(**row) for row in csv.DictReader(file)]
    return {pair.key: pair for pair in found}


def write(table: list[Pair]) -> None:
    with TABLE.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(field.name for field in fields(Pair))
        writer.writerows(astuple(pair) for pair in table)


def unexpected(found: list[Comparison]) -> list[str]:
    """The runs that differ and are not in the table, nor free to differ by rounding."""
    table, golden = read(), golden_work.read()
    return [
        f"{' | '.join(one.pair.key)}\n"
        f"    native   {one.pair.native}\n    browser  {one.pair.browser}"
        for one in found
        if not one.same
        and one.pair.key not in table
        and golden[one.pair.key].may_differ not in ("free", golden_work.CLOCK)
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="make the table anew")
    arguments = parser.parse_args()
    with Module() as module:
        found = list(pairs(module))
    if arguments.write:
        write([one.pair for one in found if not one.same])
    wrong = unexpected(found)
    print(
        f"{len(found)} runs; {sum(one.same for one in found)} with the same iterations and error,"
        f" {sum(one.bits for one in found)} with the same bits"
    )
    print("\n".join(wrong) or "as the table")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
