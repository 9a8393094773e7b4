"""A solver of fclib beside solvers of Siconos, problem by problem, in one run on one machine.

    python -m workshop.tables.against_siconos FILE... [--solver auto] [--siconos all]
        [--tol 1e-8] [--limit 10] [--csv OUT] [--results NAME]

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
from workshop.tables import _results

SHORT = 0.02  # [s] solves shorter than this are repeated
REPEATS = 5
MOST_ITERATIONS = 10**7
LARGE = 100  # contacts: where the time is the solver's, not that of the call

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


def compare(path: Path, solver: str, theirs: list[str], tol: float, limit: float) -> dict[str, Any]:
    """The row of one problem, with the ratio of the times where both sides solve it."""
    problem = read(path)
    ours = measure(problem, solver, tol, limit)
    runs = [measure(problem, siconos.PREFIX + name, tol, limit) for name in theirs]
    # the fastest that reached the tolerance, else the one that came nearest
    best = min(runs, key=lambda run: (not run.solved, run.cpu_s if run.solved else run.error))
    ratio = ours.cpu_s / best.cpu_s if ours.solved and best.solved else None
    row: dict[str, Any] = {"problem": path.stem, "nc": problem.nc}
    for prefix, run in (("", ours), ("siconos_", best)):
        row |= {prefix + name: value for name, value in vars(run).items()}
    return row | {"ratio": ratio}


def summarise(rows: list[dict[str, Any]], solver: str) -> list[dict[str, Any]]:
    """What the rows come to."""
    ratios = [row["ratio"] for row in rows if row["ratio"]]
    large = [row["ratio"] for row in rows if row["ratio"] and row["nc"] >= LARGE]
    found: list[tuple[str, Any]] = [
        ("problems", len(rows)),
        (f"solved by {solver}", sum(row["solved"] for row in rows)),
        ("solved by one of Siconos", sum(row["siconos_solved"] for row in rows)),
        ("solved by both", len(ratios)),
    ]
    if ratios:
        found += [
            ("geometric mean of CPU ratios", statistics.geometric_mean(ratios)),
            ("median CPU ratio", statistics.median(ratios)),
            ("worst CPU ratio", max(ratios)),
        ]
    found.append((f"solved by both from {LARGE} contacts on", len(large)))
    if large:
        found.append((f"geometric mean from {LARGE} contacts on", statistics.geometric_mean(large)))
    return [
        {"figure": name, "value": f"{value:.3f}" if isinstance(value, float) else value}
        for name, value in found
    ]


def main() -> None:
    """Compare file by file, and print the table and the median ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--solver", default="auto", help="of fclib")
    parser.add_argument("--siconos", nargs="+", default=["all"], choices=["all", *SICONOS])
    parser.add_argument("--tol", type=float, default=1e-8)
    parser.add_argument("--limit", type=float, default=10.0, help="[s] for each solve")
    parser.add_argument("--csv", type=Path, help="write the rows there")
    _results.add_option(parser)
    arguments = parser.parse_args()
    require_siconos()
    theirs = list(SICONOS) if "all" in arguments.siconos else arguments.siconos
    rows = []
    print(f"{'problem':44} {'nc':>5} {'fclib s':>10} {'siconos s':>10} {'ratio':>7}  of siconos")
    for path in arguments.files:
        row = compare(path, arguments.solver, theirs, arguments.tol, arguments.limit)
        rows.append(row)
        ours = f"{row['cpu_s']:.2e}" if row["solved"] else "unsolved"
        peer = f"{row['siconos_cpu_s']:.2e}" if row["siconos_solved"] else "unsolved"
        shown = f"{row['ratio']:.3f}" if row["ratio"] else ""
        print(
            f"{row['problem'][:44]:44} {row['nc']:5} {ours:>10} {peer:>10} {shown:>7}  "
            f"{row['siconos_solver']}",
            flush=True,
        )
    summary = summarise(rows, arguments.solver)
    print()
    for line in summary:
        print(": ".join(str(entry) for entry in line.values()))
    if arguments.results:
        _results.store(
            arguments.results,
            summary,
            title=f"`{arguments.solver}` beside the fastest solver of Siconos, picked in hindsight",
            note=f"At {_results.power(arguments.tol)}, at most {arguments.limit:g} s of wall-clock "
            "time a solve.",
        )
    if arguments.csv:
        with arguments.csv.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
