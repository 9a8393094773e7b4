"""``fclib bench``: campaigns of thousands of runs, their state, and their stores."""

from __future__ import annotations

import json
import os
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.text import Text
from typer.core import TyperGroup

import fclib
from fclib import bench
from fclib._regular import resolved
from fclib._verdicts import is_solved
from fclib._words import counted
from fclib.bench import machine
from fclib.bench.campaign import SET
from fclib.bench.runner import RETRIES
from fclib.bench.store import Status
from fclib.cli._files import keep_input
from fclib.cli._output import (
    Json,
    Report,
    Rows,
    err,
    fail,
    interrupted,
    load_modules,
    out,
    parse_options,
    progress_bar,
    usage_error,
    words_of,
)
from fclib.cli._profile import With, joined, print_profile, ready_for
from fclib.cli._progress import duration, live
from fclib.collections import library

SILENT = 30.0  # [s] a campaign elsewhere without a sign of life for so long counts as ended


class WithDefault(TyperGroup):
    """A group of commands in which `run` need not be written: ``fclib bench CAMPAIGN``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put `run` before arguments that are neither a command nor a request for help."""
        if args and args[0] not in self.commands and args[0] not in ("-h", "--help"):
            args = ["run", *args]
        return super().parse_args(ctx, args)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """The commands, and below them the options of `run`, the default command."""
        super().format_help(ctx, formatter)
        run = self.commands["run"]
        run.format_help(run.context_class(run, info_name="run", parent=ctx), formatter)


app = typer.Typer(
    cls=WithDefault,
    no_args_is_help=True,
    help="Run campaigns: problems x solvers x tolerances, within limits.\n\n"
    "CAMPAIGN is a TOML file, or the name of a published one; the word run may be left out.",
)


@app.command("run")
def run(
    campaign: Annotated[
        str | None, typer.Argument(help="A TOML file, or a published campaign.", show_default=False)
    ] = None,
    store: Annotated[
        Path | None, typer.Option(help="Store that the runs go into.  [default: NAME.sqlite]")
    ] = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", help="Runs at once.", min=1)] = 1,
    problems: Annotated[
        list[str] | None, typer.Option("--problems", help="Files, folders, globs; set:NAME.")
    ] = None,
    solver: Annotated[
        list[str] | None,
        typer.Option(
            help='A solver: "nsgs relaxation=1.2"; or a file of Python, for all solvers in it.'
            " Besides those of a campaign."
        ),
    ] = None,
    tol: Annotated[list[float] | None, typer.Option(help="Tolerances.")] = None,
    time_limit: Annotated[
        float | None, typer.Option(help="Limit of CPU time of a run [s].", min=0.001)
    ] = None,
    wall_limit: Annotated[
        float | None, typer.Option(help="Limit of wall clock of a run [s].", min=0.001)
    ] = None,
    memory: Annotated[
        float | None, typer.Option(help="Limit of memory of a run [MB].", min=0.0)
    ] = None,
    repeats: Annotated[int | None, typer.Option(help="How often each run is done.", min=1)] = None,
    sample: Annotated[
        int | None, typer.Option(help="How many problems of each group are taken.", min=1)
    ] = None,
    history: Annotated[
        bool, typer.Option("--history", help="Store how the error falls in each run.")
    ] = False,
    module: Annotated[
        list[str] | None, typer.Option(help="A file of Python with solvers of your own.")
    ] = None,
    budget: Annotated[
        str | None, typer.Option(help='For all runs together: "90min", "2h".')
    ] = None,
    retry: Annotated[
        list[str] | None, typer.Option(help="Repeat the runs that ended with this status.")
    ] = None,
    retries: Annotated[
        int,
        typer.Option(
            help="How often a run is tried again that failed for a reason outside the solver.",
            min=0,
        ),
    ] = RETRIES,
    beside: With = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Run on the Dask cluster of this address.")
    ] = None,
    slurm: Annotated[
        list[str] | None,
        typer.Option(help='Run on Slurm: "workers=8 queue=short cores=16 memory=64GB ...".'),
    ] = None,
    send: Annotated[
        bool,
        typer.Option("--send", help="Send the problems to the workers, which share no folder."),
    ] = False,
    calibrate: Annotated[
        bool,
        typer.Option(
            "--calibrate",
            help="Time a fixed set of solves on this machine, for a minute. Stores say it from then"
            " on, and published runs of other machines can be put beside yours.",
        ),
    ] = False,
    status: Annotated[
        Path | None, typer.Option(help="Show how far the campaigns of a store are.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Run a campaign, or go on if it was interrupted."""
    if status is not None:
        show_status(status, as_json)
        return
    if calibrate:
        calibrate_here(as_json)
        return
    if beside:
        if not solver:
            raise typer.BadParameter("--with takes the runs of a campaign's solvers: name --solver")
        try:
            ready_for(beside)
        except (ImportError, OSError, fclib.Error) as error:
            fail(str(error))
    solver, module = with_files(solver or [], module or [])
    flags: dict[str, Any] = {
        "tolerances": tol,
        "time_limit": time_limit,
        "wall_limit": wall_limit,
        "memory": memory,
        "repeats": repeats,
        "history": history or None,
        "budget": budget,
        "modules": module and [str(resolved(path)) for path in module],
    }
    flags = {name: value for name, value in flags.items() if value not in (None, [])}
    try:
        if campaign is not None:
            if problems:
                raise bench.CampaignError("a campaign names its own problems")
            # the folder in which published campaigns find their problems
            os.environ.setdefault(library.FOLDER, str(library.default_folder()))
            # with published runs, those of the campaign's own solvers need not be made
            own = {"solvers": list(solver)} if beside else {}
            added = () if beside else solver
            chosen = bench.Campaign.read(campaign, {**flags, **own}, sample, added)
        else:
            if not problems or not solver:
                raise bench.CampaignError("name a campaign, or give --problems and --solver")
            groups = group_problems(problems, sample)
            chosen = bench.Campaign.of(
                {"name": "bench", "solvers": list(solver), "problems": groups, **flags}
            )
        for name in retry or ():
            if name not in bench.STATUSES:
                raise bench.CampaignError(
                    f"--retry {name}: is no status; there is: {', '.join(bench.STATUSES)}"
                )
    except bench.CampaignError as error:
        usage_error(error)

    def tell(word: str) -> None:
        err.print(word, highlight=False)

    for word in chosen.missing:
        tell(f"left out: {word}")

    path = store or Path(f"{chosen.name}.sqlite")
    try:
        with ExitStack() as stack:
            runner = None
            if scheduler or slurm:
                try:
                    from fclib.bench import cluster

                    runner = stack.enter_context(
                        cluster.on_slurm(parse_options(" ".join(slurm).split()), send)
                        if slurm
                        else cluster.on_scheduler(scheduler or "", send)
                    )
                except ImportError as error:
                    fail(f'{error}; pip install "fclib[bench]"')
            show = stack.enter_context(live(chosen.name, as_json))
            progress = bench.run_campaign(
                chosen,
                path,
                jobs=jobs,
                runner=runner,
                retries=retries,
                retry=retry or (),
                show=show,
                tell=tell,
            )
    except KeyboardInterrupt:
        goes_on = f"; the same command goes on with {path}" if path.exists() else ""
        interrupted(f"interrupted{goes_on}")
    except ImportError as error:
        fail(str(error))
    record = {
        "campaign": chosen.name,
        "store": str(path),
        "planned": progress.planned,
        "there before": progress.skipped,
        "solved": progress.solved,
        **{name: n for name, n in progress.statuses.most_common() if name != "converged"},
    }
    if progress.not_run:
        record["not run"] = progress.not_run.total()
    if progress.left_over:
        record["beyond the budget"] = progress.left_over
    report = Report(as_json)
    report.add(record)
    if not as_json:
        out.print(Rows([record]))
        if not beside:
            out.print(f"fclib profile {path}", highlight=False)
    if progress.not_run:
        causes = ", ".join(f"{n} {name}" for name, n in progress.not_run.most_common())
        tell(
            f"not run, for causes outside of the solvers: {causes}; the last one was"
            f" {progress.reason}. The same command tries them again"
        )
    if progress.stopped:
        fail(progress.stopped)
    if beside:
        try:
            with joined(path, beside, None, as_measured=False) as (whole, note):
                print_profile(whole, None, note=note, own_set=True, as_json=as_json)
        except (ImportError, ValueError) as error:
            fail(str(error))


def with_files(solvers: list[str], modules: list[str]) -> tuple[list[str], list[str]]:
    """The solvers, with those of a file in place of its name; and the files to be imported."""
    found: list[str] = []
    for text in solvers:
        if not (text.endswith(".py") and Path(text).is_file()):
            found.append(text)
            continue
        path = Path(text).resolve()
        load_modules([path])
        own = [info.name for info in fclib.solvers() if info.origin == path.stem]
        if not own:
            raise typer.BadParameter(f"{text}: has no solver (@fclib.solver)")
        found += own
        modules = [*modules, str(path)]
    return found, modules


def group_problems(problems: list[str], sample: int | None) -> list[dict[str, Any]]:
    """The groups of problems of --problems: all files in one group, and a group for each set."""
    sets = [name for name in problems if name.startswith(SET)]
    files = [name for name in problems if not name.startswith(SET)]
    groups: list[dict[str, Any]] = [{"set": name} for name in sets]
    groups += [{"files": files}] if files else []
    return [group | ({"sample": sample} if sample else {}) for group in groups]


def is_alive(status: Status) -> bool:
    """Whether the process of a campaign is alive; during a long run it may be silent."""
    if status.node == machine.facts()["node"]:
        return Path(f"/proc/{status.pid}").exists()
    return time.time() - status.seen < SILENT


def describe(status: Status) -> dict[str, Any]:
    """The record of a campaign."""
    running = status.ended is None and is_alive(status)
    finished = status.ended is not None and status.done >= status.planned
    state = "running" if running else "finished" if finished else "interrupted"
    left = (status.planned - status.done) / status.rate if running and status.rate > 0 else None
    return {
        "campaign": status.name,
        "state": state,
        "runs": f"{status.done} of {status.planned}",
        "solved": status.solved,
        "others": {name: n for name, n in status.statuses.items() if not is_solved(name)},
        "rate": round(status.rate, 2),
        "left": duration(left) if left is not None else "-",
        "started": time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(status.started)),
        "on": status.node,
    }


def calibrate_here(as_json: bool) -> None:
    """Calibrate this machine, and print the times."""
    from fclib.bench import calibration

    count = len(calibration.SIZES) * len(calibration.SOLVERS)
    with progress_bar(count) as show:
        found = calibration.calibrate(show=show)
    try:
        path = calibration.save(found)
    except OSError as error:
        fail(words_of(error))
    if as_json:
        typer.echo(json.dumps(found.record()))
        return
    rows = [{"solve": name, "CPU [s]": value} for name, value in found.seconds.items()]
    out.print(Rows(rows))
    err.print(
        f"{path}; the load was {found.load:.2g}, and the repeats differ by {found.spread:.1%}"
        " (quartiles, median of the solves)",
        highlight=False,
    )


def show_status(path: Path, as_json: bool) -> None:
    """The campaigns of a store."""
    with bench.Store(path, create=False) as opened:
        records = [describe(status) for status in opened.status()]
    if as_json:
        report = Report(True)
        for record in records:
            report.add(record)
        return
    if not records:
        out.print(f"{path}: no campaign has written here")
        return
    for record in records:
        others = ", ".join(f"{n} {name}" for name, n in record["others"].items())
        record["others"] = Text(others or "-")
    out.print(Rows(records))


@app.command("merge")
def merge(
    store: Annotated[Path, typer.Argument(help="The store that takes them; made if needed.")],
    others: Annotated[list[Path], typer.Argument(help="Stores, of other machines too.")],
) -> None:
    """Put the runs of several stores into one."""
    with bench.Store(store) as opened:
        added = opened.merge(others)
        total = len(opened.keys())
    out.print(f"{store}: {added} new runs, {total} different ones in all", highlight=False)


@app.command("export")
def export(
    store: Annotated[Path, typer.Argument(help="A store.")],
    table: Annotated[Path, typer.Argument(help="A file that ends in .csv or .parquet.")],
) -> None:
    """Write all runs of a store as a table."""
    keep_input(table, store)
    try:
        with bench.Store(store, create=False) as opened:
            count = opened.export(table)
    except ImportError as error:
        fail(f'{error}; pip install "fclib[bench]"')
    except fclib.Error as error:
        fail(str(error))
    out.print(f"{table}: {counted(count, 'run')}", highlight=False)
