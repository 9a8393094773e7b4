"""What a factorisation costs: by minimum degree, by nested dissection, by other libraries.

    python -m workshop.tables.factorisation orderings [--results factorisation]
    python -m workshop.tables.factorisation libraries [--results other-lu]
        [--kind Packing Wall] [--contacts 300 1000 3000 10000]

The linear systems of `auto` on problems of these sizes: on the contacts (blocks of 3 x 3, linked
if they share a body) and on the bodies. Only the pattern is the problem's; the numbers are
random, with a dominant diagonal. CPU times of one thread, of a factorisation the least of three.
Needs a C++ compiler, Eigen, METIS and the core that `make setup` builds.

Of orderings, the column "ratio" is plan and factorisation by the better ordering over those by
minimum degree, if a plan is used for --uses factorisations. "memory" is what a factorisation by
minimum degree took at its peak, in MB, and over what was predicted.

The libraries are UMFPACK, CHOLMOD and Eigen (SparseLU). Each orders the matrix as it does by
default. All get the same matrix, but CHOLMOD: it takes symmetric matrices alone, so it gets one of
the same pattern, and does half of the work. A library that is not installed has no column.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from fclib import scenes
from workshop.tables import _results

PROGRAM = Path(__file__).with_suffix(".cpp")
CORE_LIBRARY = _results.ROOT / "build" / "libfclib_core.a"
LIBRARIES = {"UMFPACK": ("umfpack.h", "umfpack"), "CHOLMOD": ("cholmod.h", "cholmod")}
CORE = _results.ROOT / "core"
INCLUDES = (CORE, "/usr/include/eigen3", "/usr/include/suitesparse")
OURS = "ours"
# largest error of a solve; that of another library rests on its own pivots
ACCURATE = {"orderings": 1e-10, "libraries": 1e-8}


def compiled(target: Path, source: Path, more: list[str]) -> bool:
    """Whether a source could be compiled and linked."""
    flags = ["-std=c++20", "-O3", "-DNDEBUG", "-pthread"]
    flags += [f"-I{folder}" for folder in INCLUDES]
    done = subprocess.run(["c++", *flags, "-o", target, source, *more], capture_output=True)
    return done.returncode == 0


def built(folder: Path) -> Path:
    """The program that times, with those libraries that are installed."""
    trial, program = folder / "trial.cpp", folder / "factorisation"
    words: list[str] = []
    for name, (header, library) in LIBRARIES.items():
        trial.write_text(f"#include <{header}>\nint main() {{}}\n")
        if compiled(folder / "trial", trial, [f"-l{library}"]):
            words += [f"-DWITH_{name}", f"-l{library}"]
    if not compiled(program, PROGRAM, [str(CORE_LIBRARY), *words, "-lmetis"]):
        raise SystemExit(
            f"{PROGRAM}: cannot be compiled: it needs a C++ compiler, Eigen, METIS and"
            f" {CORE_LIBRARY}"
        )
    return program


def patterns(problem: Any) -> dict[str, tuple[int, Any]]:
    """Those of its systems: the side of a block, and the links."""
    H = sp.csc_array(abs(problem.H))
    d = problem.spacedim
    blocks = sp.kron(sp.eye_array(problem.nc), np.ones((d, 1)), format="csr")
    touched = H @ blocks
    M = abs(sp.csc_array(problem.M))
    # contacts that share a body, if M has nothing between bodies
    bodies = sp.csc_array(touched @ touched.T + M)
    mobile = sp.csc_array(M @ touched)
    return {"contacts": (d, sp.csc_array(touched.T @ mobile)), "bodies": (1, bodies)}


def timed(program: Path, against: str, d: int, links: Any) -> list[list[str]]:
    """The words of each line that the program prints."""
    pattern = sp.csc_array(links + sp.eye_array(links.shape[0]))
    pattern.sort_indices()
    text = " ".join(map(str, [d, pattern.shape[0], pattern.nnz, *pattern.indptr, *pattern.indices]))
    # the libraries' dense algebra has threads of its own
    env = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [program, against], input=text, capture_output=True, text=True, check=True, env=env
    )
    return [line.split() for line in done.stdout.splitlines()]


def columns_of_orderings(lines: list[list[str]], uses: int) -> dict[str, float]:
    """By minimum degree, and by METIS."""
    degree, dissected = ([float(word) for word in line] for line in lines)
    if max(degree[4], dissected[4]) > ACCURATE["orderings"]:
        raise SystemExit(f"a factorisation is wrong: {lines}")
    better = dissected if dissected[1] < degree[1] else degree
    plans = degree[0] + dissected[0]  # the plan by minimum degree is always made
    return {
        "minimum degree: plan [ms]": 1e3 * degree[0],
        "multiplications [1e6]": degree[1] / 1e6,
        "factorisation [ms]": 1e3 * degree[3],
        "METIS: plan [ms]": 1e3 * dissected[0],
        "its multiplications [1e6]": dissected[1] / 1e6,
        "its factorisation [ms]": 1e3 * dissected[3],
        "ratio": (plans + uses * better[3]) / (degree[0] + uses * degree[3]),
        "memory [MB]": degree[6] / 1e6,
        "memory over predicted": degree[6] / degree[5],
    }


def columns_of_libraries(lines: list[list[str]]) -> dict[str, float]:
    """Ours, and how many times as long each other one takes."""
    found = {name: (float(plan), float(least), float(error)) for name, plan, least, error in lines}
    for name, (_, _, error) in found.items():
        if not error < ACCURATE["libraries"]:
            raise SystemExit(f"{name}: the solve has an error of {error}")
    plan, least, _ = found.pop(OURS)
    others = {f"{name} / ours": other[1] / least for name, other in sorted(found.items())}
    return {"our plan [ms]": 1e3 * plan, "our factorisation [ms]": 1e3 * least, **others}


def main() -> None:
    """A row for each problem and system."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("against", choices=["orderings", "libraries"])
    parser.add_argument("--kind", nargs="+", default=["Packing", "Wall"])
    parser.add_argument("--contacts", type=int, nargs="+", default=[300, 1000, 3000])
    parser.add_argument("--uses", type=int, default=20, help="factorisations by one plan")
    _results.add_option(parser)
    arguments = parser.parse_args()
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        program = built(Path(folder))
        for kind in arguments.kind:
            for contacts in arguments.contacts:
                family: Any = scenes.assemblies()[kind]()
                problem = family.of_size(contacts, 0.0, 0)
                for system, (d, links) in patterns(problem).items():
                    lines = timed(program, arguments.against, d, links)
                    orderings = arguments.against == "orderings"
                    rows.append(
                        {"problem": kind, "contacts": problem.nc, "system on": system}
                        | (
                            columns_of_orderings(lines, arguments.uses)
                            if orderings
                            else columns_of_libraries(lines)
                        )
                    )
                    print(rows[-1], flush=True)
    if arguments.results:
        title, note = {
            "orderings": (
                "Factorisations by minimum degree and by nested dissection",
                f"a plan for {arguments.uses} factorisations",
            ),
            "libraries": (
                "Factorisations by other libraries, beside ours",
                "of a factorisation without its plan; CHOLMOD has a symmetric matrix of the same"
                " pattern, which is half the work",
            ),
        }[arguments.against]
        note = f"CPU times of one thread, {note}"
        _results.store(arguments.results, rows, title=title, note=note)


if __name__ == "__main__":
    main()
