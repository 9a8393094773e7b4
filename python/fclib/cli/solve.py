"""``fclib solve``: solves the problems in files."""

from __future__ import annotations

from typing import Annotated

import typer

import fclib
from fclib import bench
from fclib.cli._files import read_owner
from fclib.cli._output import (
    Files,
    Json,
    Report,
    Tolerance,
    each_file,
    parse_options,
    usage_error,
)


def command(
    files: Files,
    solver: Annotated[str, typer.Option(help="A name of `fclib solvers`.")] = "nsgs",
    tol: Tolerance = 1e-8,
    time_limit: Annotated[
        float | None, typer.Option(help="Wall clock for each problem, in seconds.", min=0.0)
    ] = None,
    write: Annotated[
        bool, typer.Option("--write", help="Store solutions that converged in their files.")
    ] = False,
    option: Annotated[
        list[str] | None, typer.Option(help="An option of the solver, name=value.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Solve problems, and judge the solutions; of several in a file the global one."""
    options = parse_options(option or [])
    try:
        fclib.find_solver(solver).check_options(options)
    except fclib.OptionError as error:
        usage_error(error)
    report = Report(as_json)
    for path in each_file(files, "solving"):
        try:
            run = bench.run(str(path), read_owner(path), solver, tol, time_limit, options)
            if write and run.status == "converged":
                fclib.write_solution(path, run.result.solution)
        except fclib.Error as error:
            named = str(error).startswith(str(path))
            report.error(path, error if named else fclib.Error(f"{path}: {error}"))
        else:
            report.add(run.record, run.status == "converged")
    report.finish()
