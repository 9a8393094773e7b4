"""What a factorisation costs by minimum degree and by nested dissection (METIS).

    python -m workshop.tables.factorisation [--kind Packing Wall]
        [--contacts 300 1000 3000 10000] [--results factorisation]

The linear systems of `auto` on problems of these sizes: on the contacts (blocks of 3 x 3, linked
where they share a body) and on the bodies. Only the pattern is the problem's; the numbers are
random, with a dominant diagonal. CPU times of one thread, of a factorisation the least of three.
The column "ratio" is plan and factorisation by the better ordering over those by minimum degree,
where a plan is used for --uses factorisations. "memory" is what a factorisation by minimum degree
took at its peak, in MB, and over what was predicted. Needs a C++ compiler, Eigen and METIS.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from fclib import scenes
from workshop.tables import _results

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(__file__).with_suffix(".cpp")
PARTS = ("fronts", "multifrontal", "workers")


def built(folder: Path) -> Path:
    """The program that times."""
    program = folder / "factorisation"
    sources = [str(ROOT / "core" / "linalg" / f"{name}.cpp") for name in PARTS]
    subprocess.run(
        ["c++", "-std=c++20", "-O3", "-DNDEBUG", "-DFCLIB_METIS", "-pthread", f"-I{ROOT / 'core'}",
         "-I/usr/include/eigen3", "-o", program, PROGRAM, *sources, "-lmetis"],
        check=True,
    )  # fmt: skip
    return program


def patterns(problem: Any) -> dict[str, tuple[int, Any]]:
    """Those of its systems: the side of a block, and the links."""
    H = sp.csc_array(abs(problem.H))
    d = problem.spacedim
    blocks = sp.kron(sp.eye_array(problem.nc), np.ones((d, 1)), format="csr")
    touched = H @ blocks
    M = abs(sp.csc_array(problem.M))
    # contacts that share a body, where M has nothing between bodies
    bodies = sp.csc_array(touched @ touched.T + M)
    mobile = sp.csc_array(M @ touched)
    return {"contacts": (d, sp.csc_array(touched.T @ mobile)), "bodies": (1, bodies)}


def timed(program: Path, d: int, links: Any) -> list[list[float]]:
    """Of each ordering: plan [s], operations, numbers, factorisation [s], error, memory [bytes].

    Memory is that which a factorisation was said to take, and that which it took.
    """
    pattern = sp.csc_array(links + sp.eye_array(links.shape[0]))
    pattern.sort_indices()
    text = " ".join(map(str, [d, pattern.shape[0], pattern.nnz, *pattern.indptr, *pattern.indices]))
    done = subprocess.run([program], input=text, capture_output=True, text=True, check=True)
    rows = [[float(word) for word in line.split()] for line in done.stdout.splitlines()]
    if len(rows) != 2 or not all(row[4] < 1e-10 for row in rows):
        raise SystemExit(f"a factorisation is wrong, or METIS is not there:\n{done.stdout}")
    return rows


def main() -> None:
    """A row for each problem and system."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--kind", nargs="+", default=["Packing", "Wall"])
    parser.add_argument("--contacts", type=int, nargs="+", default=[300, 1000, 3000, 10000])
    parser.add_argument("--uses", type=int, default=20, help="factorisations by one plan")
    _results.add_option(parser)
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        program = built(Path(folder))
        for kind in arguments.kind:
            for contacts in arguments.contacts:
                made: Any = scenes.assemblies()[kind]()
                problem = made.of_size(contacts, 0.0, 0)
                for system, (d, links) in patterns(problem).items():
                    degree, dissected = timed(program, d, links)
                    better = dissected if dissected[1] < degree[1] else degree
                    # the plan by minimum degree is always made
                    plans = degree[0] + dissected[0]
                    row = {
                        "problem": kind,
                        "contacts": problem.nc,
                        "system on": system,
                        "minimum degree: plan [ms]": 1e3 * degree[0],
                        "multiplications [1e6]": degree[1] / 1e6,
                        "factorisation [ms]": 1e3 * degree[3],
                        "METIS: plan [ms]": 1e3 * dissected[0],
                        "its multiplications [1e6]": dissected[1] / 1e6,
                        "its factorisation [ms]": 1e3 * dissected[3],
                        "ratio": (plans + arguments.uses * better[3])
                        / (degree[0] + arguments.uses * degree[3]),
                        "memory [MB]": degree[6] / 1e6,
                        "memory over predicted": degree[6] / degree[5],
                    }
                    rows.append(row)
                    print(
                        "  ".join(f"{v:.4g}" if isinstance(v, float) else str(v)
                                  for v in row.values()),
                        flush=True,
                    )  # fmt: skip
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="Factorisations by minimum degree and by nested dissection",
            note=f"CPU times of one thread, a plan for {arguments.uses} factorisations",
        )


if __name__ == "__main__":
    main()
