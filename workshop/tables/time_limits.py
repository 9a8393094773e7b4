"""By how much solvers exceed a time limit, beside what one factorisation costs.

    python -m workshop.tables.time_limits [--limit 1 ...] [--only nsgs auto ...]
        [--case dense wall packing ...] [--dense 1500] [--wall 59000] [--packing 7000]

A solver looks at the clock before each factorisation and between its sweeps: it may end late by one
factorisation, since none is cut short. The cases are contacts of which each moves with each other,
a wall of blocks and a packing of spheres, as local problems and as global ones (of `dense`, all
contacts on one elastic body, whose M is dense); a global one is condensed within the limit.

The limit is told by the CPU clock, so that other work on the machine does not matter; of
`fclib.solve` it is wall-clock time. Of each case: what a factorisation of a Newton method costs
(the first step of `nsn-ac`) and, of a global one, that of M and the whole condensation. Of each
run: its CPU time, by how much that is over the limit, and what part of the costlier factorisation;
more than 1 is marked. The tolerance is one that nobody reaches.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

import fclib
from fclib import _core, scenes

TOLERANCE = 1e-15
SLACK = 0.1  # [s] over the limit that count for nothing: a product with W, a sweep


@dataclass(frozen=True)
class Case:
    """A problem, and what its conversion and factorisations take [CPU s]."""

    name: str
    problem: Any
    factorisation: float
    of_mass: float
    condensation: float


def spent(work: Callable[[], Any]) -> tuple[float, Any]:
    """The CPU time of some work [s], and what it gives."""
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def limited(problem: Any, solver: str, limit: float) -> tuple[float, Any]:
    """The CPU time of a solve under a limit of CPU time [s], and its result."""
    entry = next(entry for entry in fclib.solvers() if entry.name == solver)
    return spent(
        lambda: _core.solve(
            problem, entry, TOLERANCE, 0, limit, {}, None, None, False, False,
            clock=time.process_time,
        )
    )  # fmt: skip


def dense_local(nc: int, seed: int = 0) -> fclib.LocalProblem:
    """Contacts of which each moves with each other: W is dense and has a null space."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((3 * nc, 2 * nc))
    q = rng.standard_normal(3 * nc) - 1
    return fclib.LocalProblem(spacedim=3, W=root @ root.T / nc, q=q, mu=np.full(nc, 0.9))


def dense_global(nc: int, seed: int = 0) -> fclib.GlobalProblem:
    """One elastic body with a dense M, each contact at a node of its own."""
    rng = np.random.default_rng(seed)
    n = 3 * nc
    root = rng.standard_normal((n, n))
    frames = np.linalg.qr(rng.standard_normal((nc, 3, 3)))[0]
    return fclib.GlobalProblem(
        spacedim=3,
        M=sp.csc_array(root @ root.T / n + np.eye(n)),
        H=sp.csc_array(sp.block_diag(list(frames))),
        f=rng.standard_normal(n) - 1,
        w=np.zeros(n),
        mu=np.full(nc, 0.9),
    )


def cases(arguments: argparse.Namespace) -> list[Case]:
    """The cases that are asked for."""
    kinds: dict[str, Any] = dict(scenes.assemblies())
    made: dict[str, Callable[[], Any]] = {
        "dense": lambda: dense_local(arguments.dense),
        "dense-bodies": lambda: dense_global(arguments.dense),
        "wall": lambda: kinds["Wall"]().of_size(arguments.wall, 1.0).condense(),
        "wall-bodies": lambda: kinds["Wall"]().of_size(arguments.wall, 1.0),
        "packing": lambda: kinds["Packing"]().of_size(arguments.packing, 1.0).condense(),
        "packing-bodies": lambda: kinds["Packing"]().of_size(arguments.packing, 1.0),
    }
    found = []
    for name in arguments.case or made:
        problem = made[name]()
        step = fclib.solve(problem, "nsn-ac", tol=TOLERANCE, max_iterations=1)
        condensation = of_mass = 0.0
        if isinstance(problem, fclib.GlobalProblem):
            condensation = spent(lambda p=problem: p.condense())[0]  # type: ignore[misc]
            # what is done before the clock is first looked at
            of_mass = limited(problem, "nsgs", 1e-9)[0]
        found.append(Case(name, problem, step.cpu_s, of_mass, condensation))
    return found


def main() -> None:
    """Print a line for each solver and case."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--limit", type=float, nargs="+", default=[1.0], help="[CPU s]")
    parser.add_argument("--only", nargs="+", help="solvers; by default all of fclib's own")
    parser.add_argument("--case", nargs="+", help="by default all")
    parser.add_argument("--dense", type=int, default=1500, help="contacts")
    parser.add_argument("--wall", type=int, default=59_000, help="contacts")
    parser.add_argument("--packing", type=int, default=7_000, help="contacts")
    arguments = parser.parse_args()
    solvers = arguments.only or [s.name for s in fclib.solvers() if s.origin == "fclib"]
    late = 0
    for case in cases(arguments):
        allowed = max(case.factorisation, case.of_mass)
        print(
            f"{case.name}: {case.problem.nc} contacts, factorisation {case.factorisation:.2f} s,"
            f" of M {case.of_mass:.2f} s, condensation {case.condensation:.2f} s"
        )
        print(f"    {'solver':17}{'status':16}{'limit s':>8}{'cpu s':>8}{'over s':>8}{'of it':>7}")
        for name in solvers:
            for limit in arguments.limit:
                cpu, result = limited(case.problem, name, limit)
                over = max(0.0, cpu - limit)
                beyond = over > allowed + SLACK
                late += beyond
                print(
                    f"    {name:17}{result.status:16}{limit:8.2f}{cpu:8.2f}{over:8.2f}"
                    f"{over / allowed:7.2f}{'  LATE' if beyond else ''}",
                    flush=True,
                )
    print(f"{late} runs end later than one factorisation after the limit")


if __name__ == "__main__":
    main()
