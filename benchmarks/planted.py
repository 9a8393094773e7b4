"""How many small problems with a known solution `auto` solves, with and without some stages.

    .venv/bin/python benchmarks/planted.py [--count 2000] [--first 100000]
        [--without pivoting "random starts"] [--results planted]

The problems are those of tests/planted_judge.py: random ones of every formulation (masses over
twelve decades, redundant joints, blocks of every rank, friction up to 100, rolling, guesses) and
those that ask for all digits (`digits` there). Left out are problems whose data do not hold their
own solution to a tenth of the tolerance. CPU time is that of all solves of a kind.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import _results

import fclib

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
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


def main() -> None:
    """A row for each kind and chain."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--count", type=int, default=2000, help="numbers of each kind")
    parser.add_argument("--first", type=int, default=100_000)
    parser.add_argument("--without", nargs="*", default=["pivoting", "random starts"])
    _results.add_option(parser)
    arguments = parser.parse_args()
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
