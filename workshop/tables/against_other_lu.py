"""What a factorisation costs by our LU, and by those of UMFPACK, CHOLMOD and Eigen (SparseLU).

    python -m workshop.tables.against_other_lu [--kind Packing Wall]
        [--contacts 300 1000 3000] [--results other-lu]

The linear systems of `auto` on problems of these sizes (`factorisation.py` makes the patterns).
All libraries get the same matrix, but CHOLMOD: it takes symmetric matrices alone, so it gets one
of the same pattern, and does half of the work. CPU times of one thread, of a factorisation the
least of three; each library orders the matrix as it does by default. A library that is not
installed has no column. Needs a C++ compiler, Eigen and METIS.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import scipy.sparse as sp

from fclib import scenes
from workshop.tables import _results
from workshop.tables.factorisation import PARTS, ROOT, patterns

PROGRAM = Path(__file__).with_suffix(".cpp")
LIBRARIES = {"UMFPACK": ("umfpack.h", "umfpack"), "CHOLMOD": ("cholmod.h", "cholmod")}
INCLUDES = ("/usr/include/eigen3", "/usr/include/suitesparse")
OURS = "ours"
ACCURATE = 1e-8  # error of a solve; a larger one means a wrong factorisation


def compiled(target: Path, source: Path, more: list[str]) -> bool:
    """Whether a source could be compiled and linked."""
    flags = ["-std=c++20", "-O3", "-DNDEBUG", "-DFCLIB_METIS", "-pthread", f"-I{ROOT / 'core'}"]
    flags += [f"-I{folder}" for folder in INCLUDES]
    done = subprocess.run(["c++", *flags, "-o", target, source, *more], capture_output=True)
    return done.returncode == 0


def built(folder: Path) -> Path:
    """The program that times, with those libraries that are installed."""
    trial, program = folder / "trial.cpp", folder / "against_other_lu"
    words: list[str] = []
    for name, (header, library) in LIBRARIES.items():
        trial.write_text(f"#include <{header}>\nint main() {{}}\n")
        if compiled(folder / "trial", trial, [f"-l{library}"]):
            words += [f"-DWITH_{name}", f"-l{library}"]
    sources = [str(ROOT / "core" / "linalg" / f"{name}.cpp") for name in PARTS]
    if not compiled(program, PROGRAM, [*sources, *words, "-lmetis"]):
        raise SystemExit(f"{PROGRAM}: cannot be compiled: it needs a C++ compiler, Eigen and METIS")
    return program


def timed(program: Path, d: int, links: Any) -> dict[str, tuple[float, float]]:
    """CPU times [s] of the plan and of a factorisation, by library."""
    pattern = sp.csc_array(links + sp.eye_array(links.shape[0]))
    pattern.sort_indices()
    text = " ".join(map(str, [d, pattern.shape[0], pattern.nnz, *pattern.indptr, *pattern.indices]))
    # the libraries' dense algebra has threads of its own
    env = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [program], input=text, capture_output=True, text=True, check=True, env=env
    )
    found = {}
    for line in done.stdout.splitlines():
        name, plan, factorisation, error = line.split()
        if not float(error) < ACCURATE:
            raise SystemExit(f"{name}: the solve has an error of {error}")
        found[name] = float(plan), float(factorisation)
    return found


def main() -> None:
    """A row for each problem and system."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--kind", nargs="+", default=["Packing", "Wall"])
    parser.add_argument("--contacts", type=int, nargs="+", default=[300, 1000, 3000])
    _results.add_option(parser)
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        program = built(Path(folder))
        for kind in arguments.kind:
            for contacts in arguments.contacts:
                family: Any = scenes.assemblies()[kind]()
                problem = family.of_size(contacts, 0.0, 0)
                for system, (d, links) in patterns(problem).items():
                    found = timed(program, d, links)
                    plan, least = found.pop(OURS)
                    row = {
                        "problem": kind,
                        "contacts": problem.nc,
                        "system on": system,
                        "our plan [ms]": 1e3 * plan,
                        "our factorisation [ms]": 1e3 * least,
                    }
                    for name, (_, other) in sorted(found.items()):
                        row[f"{name} / ours"] = other / least
                    rows.append(row)
                    print(row, flush=True)
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="Factorisations by other libraries, beside ours",
            note="CPU times of one thread, of a factorisation without its plan; CHOLMOD has a"
            " symmetric matrix of the same pattern, which is half the work",
        )


if __name__ == "__main__":
    main()
