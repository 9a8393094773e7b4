"""A solver of fclib beside solvers of Siconos, problem by problem, in one run on one machine.

    .venv/bin/python benchmarks/against_siconos.py FILE... [--solver auto] [--siconos all]
        [--tol 1e-8] [--limit 10] [--csv OUT]

With several of Siconos' solvers, or `all`, each problem is compared with the fastest of those that
solved it, picked in hindsight. Theirs have their own default options, and no limit of iterations.

Takes local 3D problems, and global ones after condensation. Both sides solve the same numbers from
r = 0; the time is the CPU time of the solve alone, one thread, the least of several repeats where
a solve is short. Siconos runs in its own interpreter (--python, Debian's python3-siconos) and
gets W as 3 x 3 blocks, the storage it uses itself. Its tolerance is relative to
max(||q||, ||r||, ||u||): where the natural-map error relative to ||q|| ends above --tol, it is run
again with its tolerance scaled to mean the same.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

import fclib

SHORT = 0.02  # [s] solves shorter than this are repeated
REPEATS = 5
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")  # one each: CPU time

WORKER = r"""
import json, sys, time
import numpy as np
import siconos.numerics as sn

def solve(path, tol, m):
    problem = sn.frictionContact_new_from_filename(path)
    options = sn.SolverOptions(getattr(sn, "SICONOS_FRICTION_3D_" + solver))
    if local:
        inner = getattr(sn, "SICONOS_FRICTION_3D_ONECONTACT_" + local)
        sn.solver_options_update_internal(options, 0, inner)
    options.iparam[0] = 10**7
    options.dparam[0] = tol
    r, u = np.zeros(m), np.zeros(m)
    start = time.process_time()
    sn.fc3d_driver(problem, r, u, options)
    return time.process_time() - start, int(options.iparam[1]), r

path, solver, local = sys.argv[1:4]
tol, m, short, repeats = map(float, sys.argv[4:])
cpu, iterations, r = solve(path, tol, int(m))
if cpu < short:
    cpu = min([cpu] + [solve(path, tol, int(m))[0] for _ in range(int(repeats))])
print(json.dumps({"cpu_s": cpu, "iterations": iterations, "r": r.tolist()}))
"""


# name: Siconos' solver, and its solver of one contact where that is not the default
SICONOS = {
    "NSGS": ("NSGS", ""),
    "NSGS-quartic": ("NSGS", "QUARTIC"),
    "NSGS-projection": ("NSGS", "ProjectionOnConeWithLocalIteration"),
    **{
        name: (name, "")
        for name in (
            "NSN_AC",
            "NSN_FB",
            "NSN_NM",
            "PROX",
            "ADMM",
            "ACLMFP",
            "TFP",
            "VI_FPP",
            "VI_EG",
            "DSFP",
            "SOCLCP",
            "HP",
        )
    },
}


def write_siconos(path: Path, problem: fclib.LocalProblem) -> None:
    """The problem in Siconos' text format with sparse blocks, all digits kept."""
    nc = problem.nc
    # a zero times every diagonal block keeps them in the pattern
    blocks = sp.bsr_array(sp.csr_array(problem.W), blocksize=(3, 3))
    diagonal = sp.bsr_array(
        (np.zeros((nc, 3, 3)), np.arange(nc), np.arange(nc + 1)), shape=blocks.shape
    )
    blocks = (blocks + diagonal).tobsr((3, 3))
    blocks.sort_indices()
    ends = " ".join(str(3 * (k + 1)) for k in range(nc))
    lines = ["3", str(nc), "1", str(3 * nc), str(3 * nc), str(len(blocks.data)), str(nc), str(nc)]
    lines += [ends, ends, str(nc + 1), str(len(blocks.data))]
    lines += [" ".join(map(str, blocks.indptr)), " ".join(map(str, blocks.indices))]
    for k, block in enumerate(blocks.data):
        lines += [str(k), *(f"{value:.17g}" for value in block.T.ravel())]
    for vector in (problem.q, problem.mu):
        lines.append(" ".join(f"{value:.17g}" for value in vector))
    path.write_text("\n".join(lines) + "\n")


def run_siconos(
    python: str, path: Path, problem: fclib.LocalProblem, solver: str, tol: float, limit: float
) -> dict[str, Any] | None:
    """What a solver of Siconos reached, or None where it did not end well within the limit."""
    arguments = [str(path), *SICONOS[solver], repr(tol), str(problem.m), repr(SHORT), str(REPEATS)]
    try:
        done = subprocess.run(
            [python, "-c", WORKER, *arguments],
            env=os.environ | dict.fromkeys(THREADS, "1"),
            capture_output=True,
            text=True,
            timeout=limit + 2,
            check=True,
        )
    except (subprocess.TimeoutExpired, subprocess.CalledProcessError):
        return None
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    result["r"] = np.array(result["r"])
    if not np.isfinite(result["r"]).all():
        return None
    result["error"] = fclib.merit(problem, fclib.Solution(r=result["r"])).error
    return result


def best_of_siconos(
    python: str,
    path: Path,
    problem: fclib.LocalProblem,
    solvers: Sequence[str],
    tol: float,
    limit: float,
) -> dict[str, Any] | None:
    """The fastest solver that reached the tolerance, else the one that came nearest."""
    results = []
    for solver in solvers:
        result = run_siconos(python, path, problem, solver, tol, limit)
        if result is not None and result["error"] > tol:
            u = problem.W @ result["r"] + problem.q
            size = [float(np.linalg.norm(x)) for x in (problem.q, result["r"], u)]
            matched = 0.99 * tol * size[0] / max(size)
            result = run_siconos(python, path, problem, solver, matched, limit)
        if result is not None:
            results.append(result | {"solver": solver})
    solved = [result for result in results if result["error"] <= 1.01 * tol]
    if solved:
        return min(solved, key=lambda result: result["cpu_s"])
    return min(results, key=lambda result: result["error"], default=None)


def compare(
    path: Path, solver: str, python: str, theirs_of: Sequence[str], tol: float, limit: float
) -> dict[str, Any]:
    """The row of one problem."""
    problem = fclib.read(path)
    if isinstance(problem, fclib.GlobalProblem):
        problem = problem.condense()
    if not isinstance(problem, fclib.LocalProblem):
        sys.exit(f"{path}: is a {problem.formulation} problem; fc3d of Siconos takes none")
    row: dict[str, Any] = {"problem": path.stem, "nc": problem.nc}

    ours = fclib.solve(problem, solver, tol, time_limit=limit)
    cpu = ours.cpu_s
    if cpu < SHORT:
        repeats = [fclib.solve(problem, solver, tol).cpu_s for _ in range(REPEATS)]
        cpu = min(cpu, *repeats)
    row |= {"cpu_s": cpu, "iterations": ours.iterations, "error": ours.error}
    row["solved"] = ours.converged

    with tempfile.TemporaryDirectory() as folder:
        text = Path(folder) / "problem.dat"
        write_siconos(text, problem)
        theirs = best_of_siconos(python, text, problem, theirs_of, tol, limit)
    row |= {
        "siconos_solver": theirs and theirs["solver"],
        "siconos_cpu_s": theirs and theirs["cpu_s"],
        "siconos_iterations": theirs and theirs["iterations"],
        "siconos_error": theirs and theirs["error"],
        "siconos_solved": theirs is not None and theirs["error"] <= 1.01 * tol,
    }
    both = theirs is not None and row["solved"] and row["siconos_solved"]
    row["ratio"] = cpu / theirs["cpu_s"] if both and theirs is not None else None
    return row


def main() -> None:
    """Compare file by file, and print the table and the median ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--solver", default="auto", help="of fclib")
    parser.add_argument("--siconos", nargs="+", default=["all"], choices=["all", *SICONOS])
    parser.add_argument("--tol", type=float, default=1e-8)
    parser.add_argument("--limit", type=float, default=10.0, help="[s] for each solve")
    parser.add_argument("--python", default="/usr/bin/python3", help="has siconos.numerics")
    parser.add_argument("--csv", type=Path, help="write the rows there")
    arguments = parser.parse_args()
    probe = [arguments.python, "-c", "import siconos.numerics"]
    if subprocess.run(probe, capture_output=True, check=False).returncode != 0:
        sys.exit(f"{arguments.python} cannot import siconos.numerics: install python3-siconos")

    theirs = list(SICONOS) if "all" in arguments.siconos else arguments.siconos
    rows = []
    print(f"{'problem':44} {'nc':>5} {'fclib s':>10} {'siconos s':>10} {'ratio':>7}  of siconos")
    for path in arguments.files:
        row = compare(
            path, arguments.solver, arguments.python, theirs, arguments.tol, arguments.limit
        )
        rows.append(row)
        ours = f"{row['cpu_s']:.2e}" if row["solved"] else "unsolved"
        peer = f"{row['siconos_cpu_s']:.2e}" if row["siconos_solved"] else "unsolved"
        ratio = f"{row['ratio']:.3f}" if row["ratio"] else ""
        name = row["problem"][:44]
        print(
            f"{name:44} {row['nc']:5} {ours:>10} {peer:>10} {ratio:>7}  {row['siconos_solver']}",
            flush=True,
        )
    ratios = [row["ratio"] for row in rows if row["ratio"]]
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
        large = [row["ratio"] for row in rows if row["ratio"] and row["nc"] >= 100]
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
