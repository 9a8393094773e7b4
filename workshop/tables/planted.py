"""How many small problems with a known solution `auto` solves, with and without some stages.

    python -m workshop.tables.planted [--count 2000] [--first 100000]
        [--without pivoting "random starts"] [--results planted]
    python -m workshop.tables.planted --each [--count 10000] [--results planted-each]

No campaign can do this: the problems bring guesses, and here the judge of campaigns is judged too,
in ball arithmetic. The problems are those of tests/planted_judge.py: random ones of every
formulation (masses over twelve decades, redundant joints, blocks of every rank, friction up to 100,
rolling, guesses) and those that ask for all digits (`digits` there). Left out are problems whose
data do not hold their own solution to a tenth of the tolerance. CPU time is that of all solves of a
kind.

With --each, the problems of all regimes of tests/planted_judge.py that have a solution go to one of
the built-in solvers each, until there are COUNT of each law. Each word is judged in ball
arithmetic, and the merits of wrong solutions with it.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from pathlib import Path
from typing import Any

import fclib
from workshop.tables import _results

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests"))
import planted_judge
from ball_judge import judge
from helpers import auto_chain

KINDS = {"random": planted_judge.planted, "all digits": planted_judge.hard}


def counted(plant: Any, numbers: range, chain: list[str] | None) -> dict[str, Any]:
    """Of the problems of these numbers: how many there are and are solved, and the CPU time."""
    problems = solved = false = 0
    spent = 0.0
    for number in numbers:
        problem, solution, guess = plant(number)
        if judge(problem, solution).error > 0.1 * planted_judge.TOLERANCE:
            continue
        start = None if guess is None else fclib.Solution(r=guess)
        options: Any = {} if chain is None else {"chain": chain}
        before = time.process_time()
        result = fclib.solve(problem, guess=start, **options)
        spent += time.process_time() - before
        problems += 1
        solved += result.converged
        false += result.status in planted_judge.FALSE
    return {"problems": problems, "solved": solved, "false words": false, "CPU time [s]": spent}


# regimes with a solution, and the laws of their problems
SOLVABLE = {
    ("random", "digits", "corners", "held limits"): ("Coulomb", "rolling"),
    ("spin",): ("spin", "spin, rolling", "ellipsoid"),
}


def by_solver(count: int, first: int) -> list[dict[str, Any]]:
    """A row for each built-in solver: what it was given, solved, and said that was false."""
    laws = [law for own in SOLVABLE.values() for law in own]
    titles = [f"{law}{words}" for law in laws for words in ("", ", solved")] + ["false words"]
    found: dict[str, dict[str, int]] = {}
    given = dict.fromkeys(laws, 0)
    for number in itertools.count(first):
        wanted = [
            regime
            for regimes, own in SOLVABLE.items()
            if min(given[law] for law in own) < count
            for regime in regimes
        ]
        if not wanted:
            break
        for regime in wanted:
            said = planted_judge.REGIMES[regime](number, solver="each")
            if said.word == "rounding":
                continue
            row = found.setdefault(said.solver, dict.fromkeys(titles, 0))
            row[said.law] += 1
            row[f"{said.law}, solved"] += said.word == "converged"
            row["false words"] += said.false
            given[said.law] += 1
            if said.false:
                print(f"{regime} {number}: {said.solver}: {said.word}", flush=True)
    rows = [{"solver": solver, **found[solver]} for solver in sorted(found)]
    return [*rows, {"solver": "all", **{x: sum(row[x] for row in rows) for x in titles}}]


def main() -> None:
    """A row for each kind and chain, or for each solver."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--count", type=int, default=2000, help="numbers of each kind")
    parser.add_argument("--each", action="store_true", help="all built-in solvers in turn")
    parser.add_argument("--first", type=int, default=100_000)
    parser.add_argument("--without", nargs="*", default=["pivoting", "random starts"])
    _results.add_option(parser)
    arguments = parser.parse_args()
    if arguments.each:
        rows = by_solver(arguments.count, arguments.first)
        for row in rows:
            print(*row.values(), sep="  ")
        if arguments.results:
            _results.store(
                arguments.results,
                rows,
                title="Planted problems by solver",
                note=f"tolerance {planted_judge.TOLERANCE:g}, numbers from {arguments.first}; at "
                f"most {planted_judge.ITERATIONS} iterations of auto and {planted_judge.SWEEPS} of "
                "each other solver; false words are proven in ball arithmetic",
            )
        return
    numbers = range(arguments.first, arguments.first + arguments.count)
    lines = auto_chain()
    names = {line.split(":")[0].strip() for line in lines}
    if unknown := set(arguments.without) - names:
        parser.error(f"no stage of auto is called {', '.join(sorted(unknown))}")
    left = [line for line in lines if line.split(":")[0].strip() not in arguments.without]
    chains = {"auto": None, "without " + " and ".join(arguments.without): left}
    rows = []
    for kind, plant in KINDS.items():
        for chain, text in chains.items():
            row = {"kind": kind, "chain": chain, **counted(plant, numbers, text)}
            rows.append(row)
            print(*row.values(), sep="  ", flush=True)
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="Small problems with a known solution",
            note=f"tolerance {planted_judge.TOLERANCE:g}, numbers {numbers.start} to "
            f"{numbers.stop - 1} of each kind",
        )


if __name__ == "__main__":
    main()
