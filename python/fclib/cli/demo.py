"""``fclib demo``: the main job, end to end."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any

import typer

from fclib import bench, demo
from fclib._words import counted
from fclib.cli._output import Json, Report, Rows, Tolerance, each_file, err, fail, out, progress_bar
from fclib.cli._profile import print_profile
from fclib.cli._progress import live

TABLE_ROWS = 24  # largest number of rows; the CSV has all


def summarize(runs: list[bench.Run]) -> list[dict[str, Any]]:
    """A row for each solver: the problems solved, and the cost."""
    rows = []
    for solver in dict.fromkeys(run.solver for run in runs):
        own = [run for run in runs if run.solver == solver]
        rows.append(
            {
                "solver": solver,
                "problems": len(own),
                "solved": sum(run.status == "converged" for run in own),
                "iterations": sum(run.iterations for run in own),
                "cpu_s": sum(run.cpu_s for run in own),
                "largest error": max(run.error for run in own),
            }
        )
    return rows


def compare(folder: Path, as_json: bool) -> None:
    """The campaign `quick` and its profile, whose tables are left out with --json."""
    store = folder / f"{demo.CAMPAIGN}.sqlite"
    say = err if as_json else out
    say.print(f"\nThe campaign {demo.CAMPAIGN}: solvers beside each other, within hard limits ...")
    with live(demo.CAMPAIGN, as_json) as show:
        demo.campaign(store, min(2, os.cpu_count() or 1), show)
    try:
        print_profile(store, folder / "profile", as_json=as_json, quiet=as_json)
    except ImportError as error:
        say.print(f'No pictures: {error}; pip install "fclib[bench]"', highlight=False)
    say.print(f"The runs:      {store}  (fclib bench --status {store})", highlight=False)


def command(
    out_dir: Annotated[Path, typer.Option("--out", help="Folder of what is made.")] = Path("demo"),
    boxes: Annotated[int, typer.Option(help="Boxes of the stack.", min=1)] = 6,
    steps: Annotated[int, typer.Option(help="Steps of the simulation.", min=1)] = 50,
    tol: Tolerance = 1e-8,
    campaign: Annotated[
        bool, typer.Option(help="End with the campaign `quick` and its profile.")
    ] = True,
    as_json: Json = False,
) -> None:
    """Simulate a falling stack, solve its problems, compare solvers.

    The problems are stored, and the solutions judged.
    """
    try:
        from fclib.simulate import NoRenderer
    except ImportError as error:
        fail(str(error))

    say = err if as_json else out
    say.print(
        f"Simulating {counted(boxes, 'falling box', 'falling boxes')}, {counted(steps, 'step')} ..."
    )
    paths: list[Path] = []
    picture: Path | None = out_dir / "stack.png"
    with progress_bar(steps) as show:
        show("simulating")
        try:
            for stored in demo.simulate(out_dir, boxes, steps, picture):
                paths += [stored.global_path, stored.local_path]
                show("simulating" if len(paths) < 2 * steps else "drawing")
        except NoRenderer as error:
            picture = None
            say.print(f"No picture: {error}")

    say.print(f"Solving {len(paths)} problems, each in {len(demo.CONFIGURATIONS)} ways ...")
    runs: list[bench.Run] = []
    for path in each_file(paths, "solving"):
        runs += demo.solve(path, tol)
    table = out_dir / "runs.csv"
    demo.write_runs(table, runs)

    report = Report(as_json)
    for run in runs:
        report.add(run.record, run.status == "converged")
    if not as_json:
        # whole steps, from the first contact to the last one, evenly thinned
        touching = [run for run in runs if run.nc > 0]
        group = 2 * len(demo.CONFIGURATIONS)
        stride = max(1, -(-len(touching) // TABLE_ROWS))
        starts = list(range(0, len(touching), group))
        shown = [run for k in starts[::-1][::stride][::-1] for run in touching[k : k + group]]
        out.print()
        out.print(Rows([run.record for run in shown or runs[:TABLE_ROWS]]))
        out.print()
        out.print(Rows(summarize(runs)))
        out.print()
        out.print(f"All {len(runs)} runs:  {table}")
        out.print(f"The problems:  {out_dir}/stack-*.hdf5  (try: fclib check {paths[-1]})")
        if picture is not None:
            out.print(f"The picture:   {picture}")
    if campaign:
        compare(out_dir, as_json)
    raise typer.Exit(int(report.failed))
