"""``fclib check``: judges the solutions stored in files."""

from __future__ import annotations

from typing import Any

import fclib
from fclib.cli._files import read_owner
from fclib.cli._output import Files, Json, Report, Tolerance, each_file

PARTS = (
    "natural",
    "scaled_natural",
    "dynamics",
    "bilateral",
    "kinematics",
    "cone",
    "dual_cone",
    "complementarity",
    "open",
    "stick",
    "slide",
)


def command(files: Files, tol: Tolerance = 1e-8, as_json: Json = False) -> None:
    """Judge the stored solutions from the data alone, of several in a file the global one's."""
    report = Report(as_json, hidden=("n", "formulation", "scaled_natural"))
    for path in each_file(files, "checking"):
        try:
            problem = read_owner(path)
            solution = fclib.read_solution(path)
            if solution is None:
                raise fclib.FileError(f"{path}: /solution: there is no solution to check")
            try:
                merit = fclib.merit(problem, solution)
            except fclib.Error as error:
                raise fclib.FileError(f"{path}: {error}") from None
        except fclib.Error as error:
            report.error(path, error)
            continue
        good = merit.error <= tol
        record: dict[str, Any] = {
            "problem": str(path),
            "formulation": problem.formulation,
            "n": problem.n,
            "nc": problem.nc,
            "status": "ok" if good else "wrong",
            "error": merit.error,
        }
        report.add(record | {name: getattr(merit, name) for name in PARTS}, good)
    report.finish()
