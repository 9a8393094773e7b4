"""Lines to copy from the page of a problem: they get it and solve it, from a shell, Python and C.

`{path}`, `{id}` and `{family}` stand for the values of the problem.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

BUILD = "fclib collection build {id} --out collection\n"
SHELL = "fclib solve --tol 1e-8 {path}\nfclib view {path}"
PYTHON = """\
import fclib

problem = fclib.%s
result = fclib.solve(problem, tol=1e-8)
print(result.status, fclib.merit(problem, result.solution).error)"""
C = """\
#include <fclib.h>
#include <stdlib.h>

int main(void)
{{
    struct fclib_{kind}* problem = fclib_read_{kind}("{{path}}");
    if (!problem) return 1;
{arrays}
    struct fclib_solution solution = {{{members}}};
    struct fclib_solve_options options = {{0}};
    options.tolerance = 1e-8;
    struct fclib_solve_result result;
    if (!fclib_solve_{kind}(problem, "auto", &options, &solution, &result)) return 1;
    return result.status == FCLIB_CONVERGED ? 0 : 1;
}}"""

H5PY = Path(__file__).with_name("assets") / "h5py.txt"


def recipes(formulations: Iterable[str]) -> dict[str, dict[str, str]]:
    """The lines by formulation (RT-0444's abbreviations): `shell`, `python`, `c`, `h5py`.

    `build` and `load` replace the first lines if the problem is of a collection.
    """
    return {
        name: {
            "build": BUILD + SHELL,
            "shell": SHELL,
            "load": PYTHON % 'load("{id}")',
            "python": PYTHON % 'read("{path}")',
            "c": _c(name),
            "h5py": H5PY.read_text(encoding="utf-8").strip().replace("{kind}", _kind(name)),
        }
        for name in formulations
    }


def _kind(formulation: str) -> str:
    """The kind of a problem, which is the name of its group in a file."""
    whole = "global" if formulation.startswith("G") else "local"
    law = formulation.removeprefix("G")
    return whole + ("_spin" if law.startswith("S") else "_rolling" if law.startswith("R") else "")


def _c(formulation: str) -> str:
    whole = formulation.startswith("G")
    mixed = "M" in formulation
    kind = _kind(formulation)
    size = "problem->H->n" if whole else "problem->W->m"
    sizes = {"v": "problem->M->n" if whole else "", "u": size, "r": size, "l": ""}
    if mixed:
        sizes["l"] = "problem->G->n" if whole else "problem->R->m"
    arrays = [
        f"    double* {name} = calloc({count}, sizeof *{name});"
        for name, count in sizes.items()
        if count
    ]
    members = ", ".join(name if count else "NULL" for name, count in sizes.items())
    return C.format(kind=kind, arrays="\n".join(arrays), members=members)
