"""``fclib judge``: how far the steps of a simulator are from Coulomb's law."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

import fclib
from fclib._files import write_csv
from fclib._sequence import SUFFIXES, steps_or_file
from fclib.cli._files import keep_input
from fclib.cli._output import Json, Report, Rows, fail, out, progress_bar, usage_error, words_of


def command(
    what: Annotated[
        list[str],
        typer.Argument(
            help="An engine and its script with arguments, as fclib record takes them; or folders"
            " of recorded steps, one for each simulator.",
            show_default=False,
        ),
    ],
    page: Annotated[
        Path | None, typer.Option("--out", help="Write a page with figures here.")
    ] = None,
    table: Annotated[
        Path | None, typer.Option("--csv", help="Write a row for each step here.")
    ] = None,
    every: Annotated[int, typer.Option(help="Judge one step in so many.", min=1)] = 1,
    as_json: Json = False,
) -> None:
    """Judge a whole run of a simulator by Coulomb's law.

    Each step with contacts is a problem. The reaction of the simulator is judged by it: Signorini's
    condition, the cone, maximal dissipation and energy. Each criterion is relative to the step, and
    0 for a solution. `auto` solves the same problems.
    """
    from fclib import recorders

    # what follows a script is for the script
    read = what[1:2] if what[0] in recorders.ENGINES else what
    for output in (page, table):
        keep_input(output, *map(Path, read))
    engines = ", ".join(recorders.ENGINES)
    if len(what) > 1 and what[0] not in recorders.ENGINES and not Path(what[0]).exists():
        usage_error(ValueError(f"{what[0]}: is neither a folder nor an engine: {engines}"))
    if what[0] in recorders.ENGINES:
        if len(what) < 2:
            usage_error(ValueError(f"{what[0]}: name a script: fclib judge {what[0]} SCRIPT"))
        with tempfile.TemporaryDirectory(prefix="fclib-judge-") as temporary:
            file = Path(temporary) / "steps.h5"
            record_apart(what[0], what[1:], file, every)
            runs = judged({Path(what[1]).stem: file}, 1)
    else:
        runs = judged({one.rstrip("/"): Path(one) for one in what}, every)
    report = Report(as_json)
    rows = []
    for name, steps in runs.items():
        rows.append({"run": name, **recorders.summary(steps)})
        for step in steps if as_json else ():
            report.add({"run": name, **asdict(step)})
    try:
        if table is not None:
            write_table(runs, table)
        if page is not None:
            from fclib.report.judged import write_judged

            write_judged(runs, page)
    except ImportError as error:
        fail(f"{error}; install it with: pip install 'fclib[report]'")
    except OSError as error:
        fail(words_of(error))
    if as_json:
        return
    columns = [name for name in rows[0] if name != "run"]
    turned: list[dict[str, Any]] = [
        {"": name, **{row["run"]: row[name] for row in rows}} for name in columns
    ]
    out.print(Rows(turned))
    out.print()
    for name, meaning in recorders.CRITERIA.items():
        out.print(f"{name:12}{meaning}", highlight=False)


def record_apart(engine: str, script: Sequence[str], file: Path, every: int) -> None:
    """Record a script in a process of its own, which it may end; the command ends if it fails."""
    command = [sys.executable, "-m", "fclib", "record", engine, "--out", str(file)]
    command += ["--every", str(every), "--", *script]
    # what the script prints is no result of this command
    status = subprocess.run(command, stdout=2, check=False).returncode
    if status:
        fail(f"{script[0]}: ended with status {status}; what it said is above")
    if not file.exists():
        fail(f"{script[0]}: no step was recorded; the reason is above")


def judged(folders: dict[str, Path], every: int) -> dict[str, Sequence[Any]]:
    """One step in so many of each folder, judged; the command ends if there are none."""
    from fclib import recorders

    runs: dict[str, Sequence[Any]] = {}
    for name, folder in folders.items():
        if not name or not (folder.exists() or "#" in name):
            known = ", ".join(recorders.ENGINES)
            fail(f"{name!r}: is neither a folder, a file nor an engine; there is: {known}")
        found = sorted(one for one in folder.glob("*") if one.suffix in SUFFIXES)
        files = [
            step for one in found or [folder] if not one.is_dir() for step in steps_or_file(one)
        ]
        files = files[::every]
        if not files:
            fail(f"{name}: there is no step with contacts")
        steps = []
        try:
            with progress_bar(len(files)) as show:
                for file, step in zip(files, recorders.judge(files), strict=True):
                    show(file.name)
                    steps.append(step)
        except (fclib.Error, ValueError) as error:
            fail(str(error))
        runs[name] = steps
    return runs


def write_table(runs: dict[str, Sequence[Any]], path: Path) -> None:
    """Write a row for each step."""
    columns = ["run", *asdict(next(iter(runs.values()))[0])]
    rows = ((name, *asdict(step).values()) for name, steps in runs.items() for step in steps)
    write_csv(path, columns, rows)
