"""What the stages of `auto` that start from a guess are worth, along simulations.

    python -m workshop.tuning.guesses NAME... [--steps 16] [--from 0] [--tols 1e-4 1e-6 1e-8]
        [--results auto-guesses]

NAME is a set or SET/FAMILY whose states follow each other, such as `sequences`, or SCENE@STEP: the
steps of a scene that is simulated, from this one on. Each step is solved from nothing (cold), and
from the solution of the step before by `auto` as it is (warm), with the table and with each change
of it: without a stage, or with another rule. A time is the least CPU time of three solves, without
conversions; changes take turns in random order, so the load of the machine is the same for all. A
solve that does not converge counts with its time.

A row says of a change, to a tolerance: the ratio of cold to warm as a geometric mean over the steps
of a family and then over families; and the family whose sums of times have the least ratio. A stage
pays if the mean is less without it. A second table, NAME-families, has the means and the ratio of
each family with the table as it is. What is chosen is chosen on `sequences`, BoxesStack and
Capsules; others judge.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

import fclib
from fclib import collections
from fclib.bench import generated
from workshop.tables import _results
from workshop.tuning.choose_auto import name_of, place, table, with_rules, without

REPEATS = 3
WHOLE = "gauss-seidel"
SWEEPS = "gauss-seidel from the guess"
NEWTON = "newton from the guess"
POINT = "proximal point from the guess"
TRIED: dict[str, dict[str, tuple[float, ...]]] = {
    WHOLE: {"limit": (5, 10)},
    SWEEPS: {"left": (10, 20, 80), "limit": (20,), "at_least": (5, 20)},
    NEWTON: {
        "below": (1e-3, 1e-2, 3e-2),
        "at_least": (5, 20),
        "most_flops": (2, 5),
        "patience": (2,),
        "limit": (6, 24),
    },
    POINT: {"below": (1e-4, 1e-2), "limit": (12, 25, 100)},
}


def changes(lines: list[str]) -> Iterator[tuple[str, Callable[[list[str]], list[str]]]]:
    """Each of the stages left out, all of them, and other values of their rules."""
    yield "as it is", lambda own: own
    guessed = [name_of(line) for line in lines if "guessed=true" in line]
    yield "without all of them", lambda own: [x for x in own if name_of(x) not in guessed]
    for name in guessed:
        yield f"without {name}", without(place(lines, name))
    for name, rules in TRIED.items():
        for key, values in rules.items():
            for value in values:
                change = with_rules(place(lines, name), **{key: f"{value:g}"})
                yield f"{name}: {key}={value:g}", change


def problems_of(name: str, first: int, count: int) -> Iterator[tuple[int, Any]]:
    """Problems of a simulation, each with its step."""
    scene, at, step = name.partition("@")
    if at:
        numbers = range(int(step), int(step) + count)
        paths = generated.simulated(scene, {}, list(numbers), seed=0, form="global")
        yield from ((int(path.stem.rpartition("-")[2]), fclib.read(path)) for path in paths)
        return
    path = collections.plan_of(name).trajectory
    if path is None:
        raise SystemExit(f"{name}: no states are stored")
    states = collections.read_trajectory(path)
    for k in range(first, min(first + count, len(states))):
        yield int(states.step[k]), states.problem(k).problem


def steps(name: str, first: int, count: int, tol: float) -> Iterator[tuple[Any, Any]]:
    """Problems of steps that follow each other, with the guess from the step before."""
    before: Any = None
    last = -1
    for step, problem in problems_of(name, first, count + 1):
        guess = None
        if before is not None and step == last + 1:
            guess = collections.guess_of(before[0], before[1], problem)
        last = step
        result = fclib.solve(problem, tol=tol, guess=guess)
        if guess is not None:
            yield problem, guess
        before = (problem, result.solution)


def measured(name: str, arguments: argparse.Namespace, tol: float) -> dict[str, list[float]]:
    """The CPU times [s] of the steps of a family, by change; "" is cold."""
    lines = table()
    chains = {change: "\n".join(apply(lines)) for change, apply in changes(lines)}
    ways = {"": chains["as it is"], **chains}
    found: dict[str, list[float]] = {way: [] for way in ways}
    order = np.random.default_rng(0)
    for problem, guess in steps(name, arguments.first, arguments.steps, tol):
        least = dict.fromkeys(ways, np.inf)
        for _ in range(REPEATS):
            for way in order.permutation(list(ways)):
                start = guess if way else None
                run = fclib.solve(problem, tol=tol, guess=start, time_limit=20, chain=ways[way])
                least[way] = min(least[way], run.cpu_s)
        for way, seconds in least.items():
            found[way].append(seconds)
    return found


def rows_of(times: dict[str, dict[str, list[float]]], tol: float) -> Iterator[dict[str, object]]:
    """A row for each change."""
    for name in [name for name in next(iter(times.values())) if name]:
        means, sums = {}, {}
        for family, found in times.items():
            cold, warm = np.array(found[""]), np.array(found[name])
            means[family] = float(np.mean(np.log(cold / warm)))
            sums[family] = float(cold.sum() / warm.sum())
        least = min(sums, key=lambda family: sums[family])
        yield {
            "change": name,
            "tolerance": _results.power(tol),
            "cold over warm, mean": float(np.exp(np.mean(list(means.values())))),
            "least, of sums": sums[least],
            "of": least,
        }


def row_of_family(name: str, tol: float, times: dict[str, list[float]]) -> dict[str, object]:
    """The means of a family, cold and warm, with the table as it is."""
    cold, warm = np.mean(times[""]), np.mean(times["as it is"])
    return {
        "family": name,
        "tolerance": _results.power(tol),
        "steps": len(times[""]),
        "cold [ms]": f"{1e3 * cold:.3g}",
        "warm [ms]": f"{1e3 * warm:.3g}",
        "cold over warm": f"{cold / warm:.2f}",
    }


def main(words: Sequence[str] | None = None) -> None:
    """Measure all, and print a row for each."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("names", nargs="+", metavar="NAME")
    parser.add_argument("--steps", type=int, default=16, help="of each family")
    parser.add_argument("--from", dest="first", type=int, default=0, help="the first state")
    parser.add_argument("--tols", type=float, nargs="+", default=[1e-4, 1e-6, 1e-8])
    _results.add_option(parser)
    arguments = parser.parse_args(words)
    scenes = [name for name in arguments.names if "@" in name]
    stored = [name for name in arguments.names if "@" not in name]
    names = [*(collections.folders(stored) if stored else []), *scenes]
    rows: list[dict[str, object]] = []
    families: list[dict[str, object]] = []
    for tol in arguments.tols:
        times = {}
        for name in names:
            found = measured(name, arguments, tol)
            if found[""]:
                times[name] = found
                families.append(row_of_family(name, tol, found))
                print(*families[-1].values(), flush=True)
        if not times:
            raise SystemExit("no step follows the one before it: give other names, or --from")
        rows += rows_of(times, tol)
    print(_results.table(list(rows[0]), rows))
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="Stages of auto that start from a guess, and changes of them",
            note=f"{len(times)} families, {arguments.steps} steps of each at most.",
        )
        _results.store(
            f"{arguments.results}-families",
            families,
            title="auto along steps, in a loop: cold beside warm",
            note=f"{arguments.steps} steps of a family at most; means of the least of {REPEATS}.",
        )


if __name__ == "__main__":
    main()
