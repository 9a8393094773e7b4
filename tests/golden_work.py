"""The work that every solver of fclib needs on a few problems, against a table of it.

    python tests/golden_work.py             what differs from golden_work.csv; exit status 1 if any
    python tests/golden_work.py --exact     the rows that rounding moves compared as well
    python tests/golden_work.py --write     make the table anew, once a change has been agreed with

A row has the status, the iterations and, of a solver with stages, its stages in the order of their
first call, with calls, iterations and factorisations of each. No clock ends a run. Runs on data
that differ by rounding tell how far a row may be trusted; column `may_differ` says

    (empty)   the same in all of them: equal everywhere
    10 %      the same status, iterations and stages within a tenth
    free      the rest: compared by --exact alone, on a machine that rounds as the table's
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

import fclib
import fclib.scenes
from helpers import (
    bodies,
    dense,
    local_problem,
    planted_bodies,
    planted_global,
    planted_local,
    planted_rolling,
)

Array: TypeAlias = npt.NDArray[np.float64]

TABLE = Path(__file__).with_suffix(".csv")
TINY = Path(fclib.__file__).parent / "collections" / "data" / "tiny"
TOLERANCE = 1e-8
ITERATIONS = 1000
DATA = ("M", "H", "G", "W", "V", "R", "f", "q", "w", "s", "b")  # of a problem, without friction
BITS = 30  # kept of a generated number: libraries of linear algebra agree on them
ROUNDING = 1e-15
POLL = 0.1  # [s] after which some solvers evaluate their error once more
TRIES = 5  # of a run on a busy machine
CLOCK = "clock"  # the mark of a run that took longer in all of them, which is not compared
SEEDS = range(1, 6)  # of the runs on data that differ by rounding


# ---- the problems


def entries(values: Array) -> Array:
    """The numbers cut to BITS bits, those that rounding left near zero to none."""
    mantissas, exponents = np.frexp(values)
    cut = np.ldexp(np.round(np.ldexp(mantissas, BITS)), exponents - BITS)
    return np.where(np.abs(values) < ROUNDING * np.abs(values).max(initial=0), 0.0, cut)


def mapped(problem: Any, change: Callable[[Any], Any]) -> Any:
    """The problem with its matrices and vectors changed."""
    found = {name: getattr(problem, name, None) for name in DATA}
    return problem.replace(**{n: change(value) for n, value in found.items() if value is not None})


def cut(problem: Any) -> Any:
    """The problem with all its numbers cut: the same bits on all machines."""

    def change(value: Any) -> Any:
        if not sp.issparse(value):
            return entries(value)
        result = value.copy()
        result.data = entries(result.data)
        return result

    return mapped(problem, change)


def stretched() -> Any:
    """Masses from 2^-20 to 2^20 in one problem."""
    problem: Any = cut(planted_local(5, nc=11).problem)
    scale = np.repeat(2.0 ** np.arange(-10, 11, 2), 3)
    return local_problem(scale[:, None] * dense(problem.W) * scale, problem.q * scale, problem.mu)


def blocks(*problems: Any) -> Any:
    """Problems side by side: as many islands at least."""
    return local_problem(
        sp.block_diag([problem.W for problem in problems]).toarray(),
        np.concatenate([problem.q for problem in problems]),
        np.concatenate([problem.mu for problem in problems]),
    )


def rolling_bodies(d: int) -> fclib.GlobalRollingProblem:
    """Bodies of different masses, each contact between two of them, and a bilateral constraint."""
    rng = np.random.default_rng(d)
    count, size = 8, 6
    n, nc = count * size, 10
    H = np.zeros((n, d * nc))
    for a in range(nc):
        for body in rng.choice(count, 2, replace=False):
            rows = slice(size * body, size * (body + 1))
            H[rows, d * a : d * (a + 1)] = rng.standard_normal((size, d))
    G = np.zeros((n, 2))
    G[:size], G[size : 2 * size] = rng.standard_normal((2, size, 2))
    return fclib.GlobalRollingProblem(
        spacedim=d,
        M=np.diag(2.0 ** rng.integers(-3, 4, n)),
        H=H,
        G=G,
        f=rng.standard_normal(n),
        w=np.zeros(d * nc),
        b=np.zeros(2),
        mu=np.full(nc, 0.5),
        mu_r=np.full(nc, 0.1),
    )


def column(height: int) -> fclib.GlobalProblem:
    """Blocks on one another, each twice as heavy as that below it, the top one pushed aside."""
    n = 3 * height
    H = np.eye(n) - np.eye(n, k=-3).T
    mass = np.repeat(2.0 ** np.arange(height), 3)
    f = np.zeros(n)
    f[0::3] = -mass[0::3] / 8
    f[-2] = mass[-1] / 32
    return fclib.GlobalProblem(
        M=sp.diags_array(mass).tocsc(), H=H, f=f, w=np.zeros(n), mu=np.full(height, 0.375)
    )


def assembled(family: str, *arguments: Any, **parameters: Any) -> Any:
    made: Any = fclib.scenes.assemblies()[family](**parameters)
    return made.of_size(*arguments) if hasattr(made, "of_size") else made.problem(*arguments)


def rolling(d: int, seed: int, nc: int) -> Any:
    return planted_rolling(d, seed, nc)[0]


GENERATED: dict[str, Callable[[], Any]] = {
    "one planar contact": lambda: planted_local(1, d=2, nc=1).problem,
    "twenty planar contacts": lambda: planted_local(2, d=2, nc=20).problem,
    "forty contacts, dense": lambda: planted_local(3, nc=40, storage="dense").problem,
    "mixed planar": lambda: planted_local(4, d=2, p=3).problem,
    "mixed": lambda: planted_local(5, nc=12, p=5).problem,
    "global planar": lambda: planted_global(6, d=2, nc=9).problem,
    "global": lambda: planted_global(7, nc=15).problem,
    "global mixed planar": lambda: planted_global(18, d=2, nc=8, p=3).problem,
    "global mixed": lambda: planted_global(8, nc=8, p=4).problem,
    "no friction": lambda: planted_global(9, nc=10, mu=0.0).problem,
    "much friction": lambda: planted_local(10, nc=10, mu=8.0).problem,
    "asymmetric": lambda: planted_local(11, nc=9, skew=1.0).problem,
    "redundant": lambda: local_problem(
        np.kron(np.ones((4, 4)), np.eye(3)), [-1.0, 0.25, 0.125] * 4, [0.375] * 4
    ),
    "stretched": stretched,
    "islands": lambda: blocks(*(planted_local(seed, nc=6).problem for seed in (12, 13, 14))),
    "column": lambda: column(6),
    "wall": lambda: assembled("RepeatedContacts", 0, contacts=24),
    "wall, contacts twice": lambda: assembled("RepeatedContacts", 1, contacts=24),
    "packing at rest": lambda: assembled("Packing", 60, 0.0),
    "packing pushed": lambda: assembled("Packing", 60, 1.0),
    "bodies, light and heavy": lambda: bodies(
        2, 8, ratio=1e4, mu=10, hyperstatic=True, duplicated=2, boundary=True
    ),
    "bodies, each mass its own": lambda: bodies(
        3, 8, ratio=1e6, mu=3, hyperstatic=True, boundary=True
    ),
    "bodies, hyperstatic": lambda: bodies(4, 8, hyperstatic=True),
    "bodies, much friction, few": lambda: bodies(0, 8, ratio=1e4, mu=10, hyperstatic=True),
    "bodies, much friction": lambda: bodies(0, 20, mu=10, hyperstatic=True),
    "bodies, at the limit, few": lambda: bodies(1, 8, mu=10, hyperstatic=True, boundary=True),
    "bodies, at the limit": lambda: bodies(1, 20, mu=10, hyperstatic=True, boundary=True),
    "bodies, stretched, few": lambda: bodies(1, 8, ratio=1e6, mu=10, hyperstatic=True),
    "bodies, stretched": lambda: bodies(6, 20, ratio=1e4, mu=10, hyperstatic=True),
    "closing walls": lambda: blocks(
        planted_local(15, nc=3).problem,
        local_problem(np.kron([[1, -1], [-1, 1]], np.eye(3)), [-1.0, 0.0, 0.0] * 2, [0.5, 0.5]),
    ),
    "rolling planar": lambda: rolling(3, 16, 10),
    "rolling": lambda: rolling(5, 17, 10),
    "rolling planar, global mixed": lambda: rolling_bodies(3),
    "rolling, global mixed": lambda: rolling_bodies(5),
}


GUESSED: dict[str, Callable[[], tuple[Any, Array]]] = {
    "few bodies": lambda: planted_bodies(5, 40, hyperstatic=True),
    "many bodies": lambda: planted_bodies(3, 12, ratio=1e4),
    "rolling": lambda: planted_rolling(5, 17, 10),
}


def problems() -> Iterator[tuple[str, Any, fclib.Solution | None]]:
    """All of them, by name, some with a guess."""
    for path in sorted(TINY.glob("*/*.hdf5")):
        yield f"{path.parent.name}/{path.stem}", fclib.read(path), None
    for name, make in GENERATED.items():
        yield name, cut(make()), None
    for name, planted in GUESSED.items():
        problem, r = planted()
        near = r * (1 + 1e-3 * np.random.default_rng(0).uniform(-1, 1, r.size))
        yield f"{name}, from a guess", cut(problem), fclib.Solution(r=entries(near))


def nearby(problem: Any, seed: int) -> Any:
    """The problem with data that differ by rounding, symmetric where they were."""
    rng = np.random.default_rng(seed)

    def change(value: Any) -> Any:
        noise = 1 + ROUNDING * rng.uniform(-1, 1, value.shape)
        if value.ndim == 1 or not sp.issparse(value):
            if value.ndim == 2 and value.shape[0] == value.shape[1]:
                noise = np.triu(noise) + np.triu(noise, 1).T
            return value * noise
        result = value.tocoo()
        low, high = np.sort(np.stack([result.row, result.col]), axis=0)
        rows, columns = (low, high) if value.shape[0] == value.shape[1] else result.coords
        result.data = result.data * noise[rows, columns]
        return result.asformat(value.format)

    return mapped(problem, change)


# ---- the work


@dataclass(frozen=True)
class Row:
    """The work of a solver on a problem."""

    problem: str
    solver: str
    status: str
    iterations: int
    stages: str  # NAME CALLS/ITERATIONS/FACTORISATIONS, joined by "; "
    may_differ: str = ""

    @property
    def key(self) -> tuple[str, str]:
        return self.problem, self.solver

    @property
    def counts(self) -> dict[str, int]:
        """All numbers of the row, by their name."""
        result = {"iterations": self.iterations}
        for stage in filter(None, self.stages.split("; ")):
            name, numbers = stage.rsplit(" ", 1)
            for what, count in zip(
                ("calls", "iterations", "factorisations"), numbers.split("/"), strict=True
            ):
                result[f"{name}: {what}"] = int(count)
        return result

    def __str__(self) -> str:
        return f"{self.status}, {self.iterations} iterations" + (
            f" ({self.stages})" if self.stages else ""
        )


def row(name: str, solver: str, problem: Any, guess: fclib.Solution | None) -> Row:
    """The work of a run that was too short to look at the clock, or marked as one that was not."""
    for _ in range(TRIES):
        start = time.monotonic()
        result = fclib.solve(
            problem, solver, TOLERANCE, max_iterations=ITERATIONS, guess=guess, merit="natural"
        )
        word = "" if time.monotonic() - start < POLL else CLOCK
        if not word:
            break
    stages = (
        f"{stage.name} {stage.calls}/{stage.iterations}/{stage.factorisations}"
        for stage in result.stages
    )
    return Row(name, solver, result.status, result.iterations, "; ".join(stages), word)


def runs(seed: int = 0) -> dict[tuple[str, str], Row]:
    """All rows; where there is a seed, on problems that differ by rounding."""
    rows = {}
    solvers = [solver for solver in fclib.solvers() if solver.origin == "fclib"]
    for name, problem, guess in problems():
        kind = "rolling_dimensions" if "Rolling" in type(problem).__name__ else "dimensions"
        changed = nearby(problem, seed) if seed else problem
        for solver in solvers:
            if problem.spacedim in getattr(solver, kind):
                made = row(name, solver.name, changed, guess)
                rows[made.key] = made
    return rows


def near(first: Row, second: Row) -> bool:
    """Whether the rows have one status, the same stages, and counts within a tenth."""
    a, b = first.counts, second.counts
    return (
        first.status == second.status
        and a.keys() == b.keys()
        and all(10 * abs(a[name] - b[name]) <= max(a[name], b[name]) for name in a)
    )


def same(first: Row, second: Row) -> bool:
    return replace(first, may_differ="") == replace(second, may_differ="")


def trusted() -> list[Row]:
    """The rows of now, with how far they may differ elsewhere."""
    result = runs()
    others = [runs(seed) for seed in SEEDS]
    for key, here in result.items():
        there = [other[key] for other in others]
        if any(row.may_differ == CLOCK for row in (here, *there)):
            result[key] = replace(here, may_differ=CLOCK)
        elif not all(same(here, row) for row in there):
            word = "10 %" if all(near(here, row) for row in there) else "free"
            result[key] = replace(here, may_differ=word)
    return list(result.values())


# ---- the table


def read() -> dict[tuple[str, str], Row]:
    with TABLE.open(newline="") as file:
        lines: Any = csv.DictReader(file)
        rows = [Row(**{**line, "iterations": int(line["iterations"])}) for line in lines]
    return {row.key: row for row in rows}


def write(rows: list[Row]) -> None:
    with TABLE.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(field.name for field in fields(Row))
        writer.writerows(astuple(row) for row in rows)


def differences(
    table: dict[tuple[str, str], Row], now: dict[tuple[str, str], Row], exact: bool = False
) -> list[str]:
    """What is not as the table has it, a line or two for each row."""
    result = []
    for key in [*table, *(key for key in now if key not in table)]:
        was, is_ = table.get(key), now.get(key)
        if was and is_:
            if same(was, is_):
                continue
            if is_.may_differ == CLOCK:
                continue
            if not exact and (
                was.may_differ == "free" or (was.may_differ == "10 %" and near(was, is_))
            ):
                continue
        result.append(
            f"{' | '.join(key)}\n    was  {was or 'not there'}\n    is   {is_ or 'not there'}"
        )
    return result


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="make the table anew")
    parser.add_argument("--exact", action="store_true", help="compare all rows")
    arguments = parser.parse_args()
    old = read() if TABLE.exists() else {}
    if arguments.write:
        rows = trusted()
        if any(row.may_differ == CLOCK for row in rows):
            print("the machine is too busy: some runs took so long that they looked at the clock")
            return 1
        write(rows)
        found = differences(old, {row.key: row for row in rows}, exact=True)
        marks = [row.may_differ for row in rows]
        print(f"{len(rows)} rows, {marks.count('10 %')} of them 10 %, {marks.count('free')} free")
    else:
        found = differences(old, runs(), arguments.exact)
    print("\n".join(found) or "as the table")
    return 1 if found and not arguments.write else 0


if __name__ == "__main__":
    sys.exit(main())
