"""``fclib solve``: solves the problems in files."""

from __future__ import annotations

from typing import Annotated, Any

import typer

import fclib
from fclib import _symmetry, bench
from fclib._verdicts import NEXT
from fclib.cli._files import read_owner
from fclib.cli._output import (
    Files,
    Json,
    Merit,
    MeritKind,
    Modules,
    Report,
    Rows,
    Tolerance,
    each_file,
    err,
    load_modules,
    parse_solver,
    warn_of,
)

STAGE = ("name", "calls", "solved", "iterations", "factorisations", "cpu_s", "time")


class Trace:
    """Prints the iterations of a solve on the standard error, thinned for readers."""

    def __init__(self, name: str) -> None:
        self.next = 0.0
        self.stage = ""
        err.print(f"{name}\n{'iteration':>10}  {'error':>9}  {'time [s]':>9}  stage")

    def __call__(self, iteration: int, error: float, seconds: float, stage: str) -> None:
        """Print a line if the stage changes, or the iterations have grown by a tenth."""
        if stage == self.stage and iteration < self.next:
            return
        self.stage, self.next = stage, max(iteration + 1, 1.1 * iteration)
        line = f"{iteration:10}  {error:9.1e}  {seconds:9.2e}  {stage}"
        err.print(line, highlight=False)

    def finish(self, stages: list[dict[str, Any]]) -> None:
        """The stages: how often each was entered, and how often it solved."""
        if stages:
            err.print(Rows(stages))


def command(
    files: Files,
    solver: Annotated[
        str, typer.Option(help='A name of `fclib solvers`, as "nsgs" or "nsgs relaxation=1.2".')
    ] = "auto",
    tol: Tolerance = 1e-8,
    merit: Merit = MeritKind.both,
    time_limit: Annotated[
        float | None, typer.Option(help="Wall clock for each problem, in seconds.", min=0.001)
    ] = None,
    kind: Annotated[
        str | None, typer.Option(help="Which of several problems in a file: local, global, ...")
    ] = None,
    write: Annotated[
        bool, typer.Option("--write", help="Store solutions that converged in their files.")
    ] = False,
    option: Annotated[
        list[str] | None, typer.Option(help="An option of the solver, name=value, or name=@FILE.")
    ] = None,
    module: Modules = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Show the iterations and the stages.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Solve problems, and judge the solutions.

    If a file has several problems, the global one is taken.
    """
    if kind is not None and write:
        # the one solution of a file is that of its global problem
        raise typer.BadParameter("--write stores the solution of the main problem, not of a --kind")
    load_modules(module)
    solver, options = parse_solver(solver, option or [])
    report = Report(as_json, hidden=("stages", "certificate"))
    for path in each_file(files, "solving"):
        try:
            trace = Trace(path.name) if verbose else None
            problem = fclib.read(path, kind) if kind else read_owner(path)
            for line in _symmetry.not_symmetric(problem):
                warn_of(path, line)
            run = bench.run(
                str(path), problem, solver, tol, time_limit, options, trace, merit.value
            )
            stages = [{key: getattr(stage, key) for key in STAGE} for stage in run.result.stages]
            if trace is not None:
                trace.finish(stages)
            if write and run.status == "converged":
                fclib.write_solution(path, run.result.solution)
        except fclib.Error as error:
            named = str(error).startswith(str(path))
            report.error(path, error if named else fclib.Error(f"{path}: {error}"))
        else:
            record = run.record | {"stages": stages}
            if run.result.message:
                record["message"] = run.result.message
            if run.result.certificate is not None:
                from fclib import analysis  # its import takes a while

                proof = analysis.check_arrays(
                    problem, run.result.certificate, run.result.certificate_z
                )
                record["certificate"] = proof.record(problem)
            report.add(record, run.status == "converged")
    for status in {record["status"]: None for record in report.records if "status" in record}:
        if status in NEXT:
            err.print(f"{status}: {NEXT[status]}", highlight=False)
    report.finish()
