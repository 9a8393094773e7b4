"""A solver of fclib beside solvers of Siconos, problem by problem, in one run on one machine.

    .venv/bin/python benchmarks/against_siconos.py FILE... [--solver auto] [--siconos all]
        [--tol 1e-8] [--limit 10] [--csv OUT]

With several of Siconos' solvers, or `all`, each problem is compared with the fastest of those that
solved it, picked in hindsight. Theirs have their own default options, and no limit of iterations.

Takes local 3D problems, and global ones after condensation. Both sides solve the same numbers from
r = 0; the time is the CPU time of the solve alone, one thread, the least of several repeats where
a solve is short. Siconos runs in its own interpreter (fclib.external.siconos), and gets W as 3 x 3
blocks, the storage it uses itself. Its tolerance is relative to max(||q||, ||r||, ||u||): where the
error relative to ||q|| ends above --tol, it is run again with its tolerance scaled to mean the
same, and the time is that of the second run.
"""

from __future__ import annotations

import argparse
import csv
import math
import statistics
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fclib
from fclib.external import siconos

SHORT = 0.02  # [s] solves shorter than this are repeated
REPEATS = 5
MOST_ITERATIONS = 10**7

# its solvers with their default options
SICONOS = (
    "nsgs",
    "nsgs-quartic",
    "nsgs-projection",
    "nsn-ac",
    "nsn-fb",
    "nsn-nm",
    "prox",
    "admm",
    "aclmfp",
    "tfp",
    "vi-fp",
    "vi-eg",
    "dsfp",
    "soclcp",
    "hp",
)


@dataclass(frozen=True)
class Run:
    """What a solver made of a problem."""

    solver: str
    solved: bool
    cpu_s: float
    iterations: int
    error: float


def read(path: Path) -> fclib.LocalProblem:
    """A local 3D problem, or a global one condensed."""
    problem = fclib.read(path)
    if isinstance(problem, fclib.GlobalProblem):
        problem = problem.condense()
    if not isinstance(problem, fclib.LocalProblem) or problem.spacedim != 3:
        sys.exit(f"{path}: is a {problem.formulation} problem; fc3d of Siconos takes none")
    return problem


def require_siconos() -> None:
    """End with what is missing."""
    if word := siconos.missing():
        sys.exit(word)


def measure(
    problem: fclib.LocalProblem, solver: str, tol: float, limit: float, **options: Any
) -> Run:
    """Solve, again where the time is short; no limit but that of wall-clock time [s].

    A solver of Siconos whose process ends, as some do by an assertion, has not solved the problem.
    """

    def solve() -> fclib.Result:
        return fclib.solve(
            problem, solver, tol, max_iterations=MOST_ITERATIONS, time_limit=limit, **options
        )

    try:
        result = solve()
    except fclib.SolverError:
        return Run(solver, False, 0.0, 0, math.inf)
    solved = result.error <= 1.01 * tol
    cpu_s = result.cpu_s
    if solved and cpu_s < SHORT:
        cpu_s = min(cpu_s, *(solve().cpu_s for _ in range(REPEATS)))
    return Run(solver, solved, cpu_s, result.iterations, result.error)


def compare(
    path: Path, solver: str, theirs: list[str], tol: float, limit: float
) -> tuple[dict[str, Any], float | None]:
    """The row of one problem, and the ratio of the times where both sides solve it."""
    problem = read(path)
    ours = measure(problem, solver, tol, limit)
    runs = [measure(problem, siconos.PREFIX + name, tol, limit) for name in theirs]
    # the fastest that reached the tolerance, else the one that came nearest
    best = min(runs, key=lambda run: (not run.solved, run.cpu_s if run.solved else run.error))
    ratio = ours.cpu_s / best.cpu_s if ours.solved and best.solved else None
    row: dict[str, Any] = {"problem": path.stem, "nc": problem.nc}
    for prefix, run in (("", ours), ("siconos_", best)):
        row |= {prefix + name: value for name, value in vars(run).items()}
    return row | {"ratio": ratio}, ratio


def main() -> None:
    """Compare file by file, and print the table and the median ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--solver", default="auto", help="of fclib")
    parser.add_argument("--siconos", nargs="+", default=["all"], choices=["all", *SICONOS])
    parser.add_argument("--tol", type=float, default=1e-8)
    parser.add_argument("--limit", type=float, default=10.0, help="[s] for each solve")
    parser.add_argument("--csv", type=Path, help="write the rows there")
    arguments = parser.parse_args()
    require_siconos()
    theirs = list(SICONOS) if "all" in arguments.siconos else arguments.siconos
    rows, ratios, large = [], [], []
    print(f"{'problem':44} {'nc':>5} {'fclib s':>10} {'siconos s':>10} {'ratio':>7}  of siconos")
    for path in arguments.files:
        row, ratio = compare(path, arguments.solver, theirs, arguments.tol, arguments.limit)
        rows.append(row)
        if ratio is not None:
            ratios.append(ratio)
            large += [ratio] if row["nc"] >= 100 else []
        ours = f"{row['cpu_s']:.2e}" if row["solved"] else "unsolved"
        peer = f"{row['siconos_cpu_s']:.2e}" if row["siconos_solved"] else "unsolved"
        shown = f"{ratio:.3f}" if ratio else ""
        print(
            f"{row['problem'][:44]:44} {row['nc']:5} {ours:>10} {peer:>10} {shown:>7}  "
            f"{row['siconos_solver']}",
            flush=True,
        )
    print(
        f"\nsolved: fclib {sum(row['solved'] for row in rows)}, "
        f"siconos {sum(row['siconos_solved'] for row in rows)}, of {len(rows)}"
    )
    if ratios:
        mean = statistics.geometric_mean(ratios)
        print(
            f"CPU ratio fclib / siconos where both solve ({len(ratios)}): "
            f"median {statistics.median(ratios):.3f}, geometric mean {mean:.3f}, "
            f"worst {max(ratios):.3f}"
        )
    if large:
        mean = statistics.geometric_mean(large)
        print(f"... of 100 contacts and more ({len(large)}): geometric mean {mean:.3f}")
    if arguments.csv:
        with arguments.csv.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
