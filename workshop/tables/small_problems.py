"""Small problems on one core: fclib.solve_batch, 60 lines of PGS, Pinocchio and Siconos.

    python -m workshop.tables.small_problems [--results small-problems] [--tolerances 1e-4 1e-8]

Worlds of boxes (small_scenes.py), thrown or at rest, cold or from the reactions of a problem whose
q differs by a hundredth. Every solver gets the same W, q and mu, in this process and one thread.
CPU time is that of the solver, the least of some rounds, in which they take turns. What each takes
to build its own objects is left out, but for the batch: its time is that of the whole call from
Python.

PGS (small_pgs.cpp, -O3) runs twice: until the change of a sweep is at most the tolerance, which is
its own criterion, and until the error of both natural maps in double precision is so too. The worst
`Merit.error` says what each has reached. MuJoCo solves another law; batch.py compares with it.
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import fclib
from workshop.tables import _results, small_scenes

Floats = npt.NDArray[np.float64]
COUNTS = {
    "1": 2000,
    "1 at a corner": 2000,
    "4": 500,
    "8": 150,
    "16": 40,
    "32": 20,
    "64": 6,
    "64 in 8 islands": 10,
}
# a peer gets fewer: its objects are built in Python
FEW = 10
# contacts up to which the peers take seconds, not minutes
MOST_OF_PEERS = 16
MOST_SWEEPS = 20000
# rounds go on for so long
SECONDS = 1.0


class Pgs:
    """The library of small_pgs.cpp."""

    def __init__(self, folder: Path) -> None:
        source = Path(__file__).with_name("small_pgs.cpp")
        made = folder / "small_pgs.so"
        subprocess.run(
            ["c++", "-std=c++20", "-O3", "-shared", "-fPIC", str(source), "-o", str(made)],
            check=True,
        )
        self.library = ctypes.CDLL(str(made))

    def solve(
        self, W: Floats, q: Floats, mu: Floats, start: Floats, tol: float, judged: bool
    ) -> tuple[float, Floats]:
        """CPU time [s] and the reactions."""
        r = start.copy()
        arrays = [one.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for one in (W, q, mu, r)]
        begin = time.process_time_ns()
        self.library.pgs(
            ctypes.c_int64(len(q)), mu.shape[1], *arrays[:3], ctypes.c_double(tol), MOST_SWEEPS,
            int(judged), arrays[3],
        )  # fmt: skip
        return 1e-9 * (time.process_time_ns() - begin), r


def by_batch(
    W: Floats, q: Floats, mu: Floats, start: Floats | None, tol: float
) -> tuple[float, Floats]:
    """CPU time [s] of the call, and the reactions."""
    begin = time.process_time_ns()
    found = fclib.solve_batch(W, q, mu, guess=start, tol=tol)
    return 1e-9 * (time.process_time_ns() - begin), found.r


def by_solver(
    name: str, problems: list[fclib.LocalProblem], start: Floats | None, tol: float
) -> tuple[float, Floats]:
    """A solver of another package, by its adapter: the CPU time that the solver takes."""
    spent, found = 0.0, []
    for k, problem in enumerate(problems):
        guess = None if start is None else fclib.Solution(r=start[k])
        result = fclib.solve(problem, solver=name, tol=tol, guess=guess, time_limit=10)
        spent += result.cpu_s
        found.append(result.solution.r)
    return spent, np.array(found)


def worst(problems: list[fclib.LocalProblem], reactions: Floats) -> float:
    """The largest Merit.error."""
    return max(
        fclib.merit(problem, fclib.Solution(r=r)).error
        for problem, r in zip(problems, reactions, strict=False)
    )


PEERS = ("pinocchio:admm", "pinocchio:pgs", "siconos:nsgs")


def peers() -> Iterator[str]:
    """Those of them that are installed."""
    problem = fclib.LocalProblem(W=np.eye(3), q=[-1, 0, 0], mu=[0.5])
    for name in PEERS:
        try:
            fclib.solve(problem, solver=name)
        except (fclib.SolverError, fclib.UnsuitableError, fclib.OptionError, ImportError) as error:
            print(f"{name} is left out: {error}")
            continue
        yield name


HEADS = ("contacts", "state", "start", "tolerance", "solver", "CPU [us]", "over PGS", "worst error")


def rows_of(
    name: str, count: int, tolerances: list[float], rounds: int, pgs: Pgs, others: list[str]
) -> Iterator[dict[str, Any]]:
    """The rows of one kind of worlds."""
    for at_rest in (False, True):
        W, q, mu, _ = small_scenes.problems(name, count, 1, at_rest)
        noise = np.random.default_rng(0).normal(size=q.shape)
        before = fclib.solve_batch(W, q * (1 + 0.01 * noise), mu, tol=1e-10).r
        few = min(count, FEW)
        problems = [fclib.LocalProblem(W=W[k], q=q[k], mu=mu[k]) for k in range(few)]
        for warm in (False, True):
            start = before if warm else np.zeros_like(q)
            for tol in tolerances:
                guess = before if warm else None
                runs: dict[str, tuple[int, Callable[[], tuple[float, Floats]]]] = {
                    "PGS, by its change": (count, partial(pgs.solve, W, q, mu, start, tol, False)),
                    "PGS, by the error": (count, partial(pgs.solve, W, q, mu, start, tol, True)),
                    "fclib.solve_batch": (count, partial(by_batch, W, q, mu, guess, tol)),
                }
                for peer in others if mu.shape[1] <= MOST_OF_PEERS else ():
                    runs[peer] = (few, partial(by_solver, peer, problems, guess, tol))
                # in turn, and for some time: a slow moment of the machine counts for all of them
                least = dict.fromkeys(runs, np.inf)
                last: dict[str, Floats] = {}
                begin = time.perf_counter()
                k = 0
                while k < rounds or time.perf_counter() - begin < SECONDS:
                    for solver, (number, run) in runs.items():
                        if k == 0 or number == count:
                            spent, last[solver] = run()
                            least[solver] = min(least[solver], spent / number)
                    k += 1
                base = 0.0
                for solver, spent in least.items():
                    base = spent if solver == "PGS, by the error" else base
                    yield {
                        "contacts": name,
                        "state": "at rest" if at_rest else "thrown",
                        "start": "warm" if warm else "cold",
                        "tolerance": _results.power(tol),
                        "solver": solver,
                        "CPU [us]": f"{1e6 * spent:.3g}",
                        "over PGS": f"{spent / base:.2f}" if base else "",
                        "worst error": f"{worst(problems, last[solver]):.0e}",
                    }


def beside(rows: list[dict[str, Any]], peer: str) -> str:
    """In how many rows the batch takes longer than the peer, and how much."""
    spent: dict[tuple[str, ...], dict[str, float]] = {}
    for row in rows:
        case = tuple(row[key] for key in HEADS[:4])
        spent.setdefault(case, {})[row["solver"]] = float(row["CPU [us]"])
    over = [own["fclib.solve_batch"] / own[peer] for own in spent.values()]
    slower = [one for one in over if one > 1]
    words = f"{peer}, in {len(slower)} of {len(over)} rows"
    return words + (f", at most {max(slower):.2f} times" if slower else "")


def main() -> None:
    """Solve, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--contacts", nargs="+", default=list(COUNTS), choices=list(COUNTS))
    parser.add_argument("--tolerances", nargs="+", type=float, default=[1e-3, 1e-4, 1e-6, 1e-8])
    parser.add_argument("--rounds", type=int, default=5, help="at least; the least time counts")
    _results.add_option(parser)
    arguments = parser.parse_args()
    print(f"| {' | '.join(HEADS)} |\n{'|---' * len(HEADS)}|")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        pgs = Pgs(Path(folder))
        others = list(peers())
        for name in arguments.contacts:
            for row in rows_of(
                name, COUNTS[name], arguments.tolerances, arguments.rounds, pgs, others
            ):
                print(f"| {' | '.join(map(str, row.values()))} |", flush=True)
                rows.append(row)
    words = "The batch takes longer than " + ", and than ".join(
        beside(rows, peer) for peer in ("PGS, by the error", "PGS, by its change")
    )
    print(f"\n{words}.")
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="Small problems on one core, cold and warm",
            note=f"the least of {arguments.rounds} rounds or more, within {SECONDS:g} s, one for "
            "solvers of other packages; "
            f"worlds of each kind: {COUNTS}; worst error of the first {FEW}. {words}.",
        )


if __name__ == "__main__":
    main()
