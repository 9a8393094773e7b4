"""What ``fclib collection build`` and ``fclib simulate`` share: their options, and the build."""

from __future__ import annotations

import os
import shutil
from collections import Counter
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer

from fclib import collections, scenes
from fclib._words import counted
from fclib.cli._output import Report, Rows, err, fail, out, words_of
from fclib.cli._progress import many_bars
from fclib.collections import catalog, trajectory
from fclib.collections.build import BuildError


class Form(str, Enum):
    """The forms of a problem that are written."""

    GLOBAL = "global"
    LOCAL = "local"
    BOTH = "both"


class Select(str, Enum):
    """The rule for the problems to keep, if not all are kept."""

    EVERY = "every"
    HARD = "hard"


Count = Annotated[
    int | None, typer.Option(help="Problems kept of each family; all by default.", min=1)
]
FormOption = Annotated[Form, typer.Option(help="Forms that are written.")]
SelectOption = Annotated[
    Select, typer.Option(help="With --count: evenly spread, or those that take nsgs most sweeps.")
]
Analyze = Annotated[
    bool,
    typer.Option("--analyze", help="Find ranks, conditioning and existence, whatever they cost."),
]
Pictures = Annotated[bool, typer.Option(help="Draw each scene and its distribution.")]


def build_plans(
    plans: list[collections.Plan],
    folder: Path,
    jobs: int | None,
    pictures: bool,
    as_json: bool,
    sequence: Path | None = None,
) -> None:
    """Build plans, and print the results; exit status 1 if a problem was not solved.

    With `sequence` the problems go from the folder into that file, and the folder is removed, also
    after an error. A build that is killed or interrupted leaves it, and goes on from it.
    """
    told = [plan.name for plan in plans if plan.trajectory is None and simulated(plan)]
    if told:
        err.print(
            f"{', '.join(told)}: no states of it are published. They come from this machine, so "
            "these problems are data of your own.",
            highlight=False,
        )
    try:
        with many_bars() as bars:
            table = collections.build(
                plans,
                folder,
                jobs=jobs or len(os.sched_getaffinity(0)),
                progress=bars,
                pictures=pictures,
            )
    except (BuildError, ImportError, FloatingPointError, ValueError, MemoryError, OSError) as error:
        if sequence is not None and not isinstance(error, BuildError):
            shutil.rmtree(folder, ignore_errors=True)
        fail(words_of(error))
    mine = {plan.name for plan in plans}
    rows = [row for row in table.to_pylist() if f"{row['collection']}/{row['family']}" in mine]
    report = Report(as_json)
    for row in ranges_of(rows):
        report.add(row, row["solved"] in ("", row["problems"]))
    steps = [line for plan in plans for line in steps_of(plan, folder)]
    for line in steps:
        err.print(line, style="red", highlight=False)
    report.failed |= bool(steps)
    if not as_json:
        if report.records:
            out.print(Rows(report.records))
        else:
            out.print("Nothing touches in any step: no problem was stored.")
        open_ones = [
            row for row in rows if row["has_solution"] is False and not catalog.is_proven(row)
        ]
        if open_ones:
            worst = max(open_ones, key=lambda row: float(row["error"]))
            out.print(
                f"{counted(len(open_ones), 'problem has', 'problems have')} no known solution; the"
                f" best iterate of each is a guess in its file. The worst is {worst['id']}, error"
                f" {worst['error']:.1e}."
            )
        other = [row["id"] for row in rows if collections.origin_of(row) == "differs"]
        if other:
            out.print(
                f"{counted(len(other), 'problem differs', 'problems differ')} from the published"
                f" ones, as {', '.join(other[:3])}: fclib collection verify {folder} says"
                " by how much"
            )
        brief = [plan for plan in plans if plan.references and not plan.analyze]
        if rows and brief:
            out.print(
                "The files say what is cheap to find out. --analyze finds the rest: self-stresses, "
                "and whether there is a solution if that is hard to tell."
            )
        if sequence is None:
            out.print(f"The catalogue:  {folder / 'catalog.parquet'}")
    if sequence is not None:
        try:
            collections.write_sequence(sequence, folder, rows)
        except OSError as error:
            fail(words_of(error))
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        if not as_json:
            out.print(f"The sequence:  {sequence}")
    raise typer.Exit(int(report.failed))


def simulated(plan: collections.Plan) -> bool:
    """Whether the problems of a plan come from a simulation."""
    return isinstance(plan.scene, scenes.Scene)


def steps_of(plan: collections.Plan, folder: Path) -> list[str]:
    """The faults in the simulation of a plan, if it was simulated here: one line each."""
    states = folder / plan.name / trajectory.OWN
    if plan.trajectory is not None or not simulated(plan) or not states.is_file():
        return []
    _, origin = trajectory.read_origin(states)
    lines = []
    if numbers := origin.get("unsolved"):
        lines.append(
            f"{plan.name}: {counted(len(numbers), 'step was', 'steps were')} not solved to"
            f" {plan.simulation.tol:g}, and the simulation went on with the best that was"
            f" found: {spans(numbers)}"
        )
    if word := origin.get("stopped"):
        lines.append(f"Stopped: {word}; the steps before are stored")
    return lines


def spans(numbers: list[int]) -> str:
    """Increasing numbers, consecutive ones together: 3, 5-9."""
    ends = [number for number in numbers if number + 1 not in set(numbers)]
    starts = [number for number in numbers if number - 1 not in set(numbers)]
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in zip(starts, ends, strict=True))


def ranges_of(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """A row for each family of a catalogue: the number of problems, the first and the last."""
    found = []
    for name, family in dict.fromkeys((row["collection"], row["family"]) for row in rows):
        own = [row for row in rows if (row["collection"], row["family"]) == (name, family)]
        origins = Counter(collections.origin_of(row) for row in own)
        tried = any(row["error"] is not None for row in own)
        # if a problem has no solution, the error of an iterate does not matter
        errors = [
            row["error"] for row in own if row["error"] is not None and not catalog.is_proven(row)
        ]

        def span(*keys: str, own: list[dict[str, Any]] = own) -> str:
            values = [row[key] for row in own for key in keys if row[key] is not None]
            return f"{min(values):.4g} to {max(values):.4g}" if values else ""

        found.append(
            {
                "family": family,
                "set": name,
                "version": own[0]["version"] or "",
                "data": ", ".join(
                    origin if count == len(own) else f"{count} {origin}"
                    for origin, count in sorted(origins.items())
                ),
                "problems": len(own),
                "distinct": catalog.distinct(own),
                "trivial": sum(row["trivial"] is not None for row in own),
                "solved": sum(map(catalog.is_answered, own)) if tried else "",
                "dof": span("n"),
                "contacts": span("nc"),
                "density": span("density"),
                "mu": span("mu_min", "mu_max"),
                "largest error": max(errors) if errors else "",
            }
        )
    return found
