"""``fclib check``: judges the solutions stored in files."""

from __future__ import annotations

from typing import Annotated, Any

import typer

import fclib
from fclib.cli._files import read_owner
from fclib.cli._output import Files, Json, Report, Tolerance, each_file, make_table, out

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


def rows_of(problem: fclib.Problem, solution: fclib.Solution) -> list[dict[str, Any]]:
    """The contacts of a solution."""
    from fclib import analysis

    table = analysis.contacts(problem, solution)
    names = table.dtype.names or ()
    return [dict(zip(names, row.tolist(), strict=True)) for row in table]


def command(
    files: Files,
    tol: Tolerance = 1e-8,
    contacts: Annotated[
        bool, typer.Option("--contacts", help="Show each contact too: status, r, u, error.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Judge the stored solutions from the data alone.

    Of several problems in a file, it is the global one's. The last columns count the contacts that
    are open, stick and slide.
    """
    report = Report(as_json, hidden=("n", "formulation", "scaled_natural", "says"))
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
        record |= {name: getattr(merit, name) for name in PARTS}
        # what the file says of it is shown, and not believed
        if told := fclib.read_attributes(path, "solution"):
            record["says"] = told
        rows = rows_of(problem, solution) if contacts else []
        if as_json and contacts:
            record["contacts"] = rows
        elif rows:
            out.print(make_table(rows, title=path.name))
        report.add(record, good)
    report.finish()
