"""The lists of chosen problems, made anew: `.venv/bin/python -m workshop.sets COMMAND`."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

import fclib
from fclib import collections
from fclib.bench import Store
from fclib.cli._output import fail, out, usage_error
from fclib.cli._progress import many_bars
from fclib.collections import set_index
from workshop.sets import choose, select
from workshop.sets.candidates import candidates

app = typer.Typer(
    help="Make the lists of chosen problems: the sets standard, hard and tiny, the family"
    " LocalProblems.",
    no_args_is_help=True,
)

List = Annotated[Path, typer.Option("--out", help="The list that is written, JSON.")]
States = Annotated[
    Path | None, typer.Option(help="Folder that the chosen states are written into.")
]
Version = Annotated[str, typer.Option(help="Version of the states that are written.")]
PerFamily = Annotated[int, typer.Option(help="Problems of a family, at most.", min=1)]


@app.command("hard")
def choose_hard(
    target: List,
    stores: Annotated[list[Path] | None, typer.Argument(help="Stores of fclib bench.")] = None,
    folder: Annotated[
        Path | None, typer.Option("--in", help="The collection that they are of.")
    ] = None,
    kept: Annotated[
        Path | None,
        typer.Option("--keep", help="A list that stays; those of --set come to it."),
    ] = None,
    sets: Annotated[
        list[str] | None,
        typer.Option("--set", help="A set: what the stored runs class hard or open in it."),
    ] = None,
    tol: Annotated[float, typer.Option(help="Tolerance of the runs that count.")] = 1e-8,
    share: Annotated[
        float, typer.Option(help="Share of the solvers that must have failed.", min=0.0, max=1.0)
    ] = 0.5,
    per_family: PerFamily = 5,
    states: States = None,
    version: Version = "1",
) -> None:
    """Choose the problems that most solvers fail on, from campaigns.

    From stores over a built collection; or a list with the problems of further sets that are hard
    or open by the runs that `fclib collection status` tells of.
    """
    if kept is not None and sets and not stores:
        if not version.isdecimal() or int(version) < 2:
            usage_error(ValueError("--version: give that of the list that is made, 2 or more"))
        grow(kept, sets, target, per_family, states, version)
        return
    if not stores or folder is None or kept is not None or sets:
        usage_error(ValueError("give stores and --in, or --keep and --set"))
    runs = []
    try:
        for path in stores:
            with Store(path, create=False) as store:
                runs += store.results(start="cold")
        chosen = choose.hard(runs, folder, tol=tol, share=share, per_family=per_family)
    except (fclib.Error, collections.CatalogError, ImportError, ValueError) as error:
        fail(str(error))
    solvers = sorted({run["solver"] for run in runs if run["tol"] == tol})
    limits = sorted({run["time_limit"] for run in runs if run["tol"] == tol})
    rule = {"tol": tol, "share": share, "per_family": per_family}
    choose.write_list(target, chosen, rule | {"solvers": solvers, "time_limits": limits})
    if states is not None:
        try:
            sources = select.sources_of(folder, {choice.family for choice in chosen})
            select.publish(sources, chosen, "hard", version, states)
        except (OSError, ValueError, KeyError) as error:
            fail(str(error))
    tell_chosen([f"{choice.family}/{choice.number:04d}" for choice in chosen], target)


def grow(
    kept: Path, sets: list[str], target: Path, per_family: int, states: Path | None, version: str
) -> None:
    """Write a list that has the hard and open problems of further sets too."""
    try:
        rule = json.loads(kept.read_text(encoding="utf-8"))["rule"]
        chosen, sources = choose.grown(set_index.Choice.read(kept), sets, version, per_family)
        rule["grown"] = {"sets": sets, "per_family": per_family}
        choose.write_list(target, chosen, rule)
        if states is not None:
            select.publish(sources, chosen, "hard", version, states)
    except KeyError as error:
        fail(str(error.args[0]))
    except (ImportError, OSError, ValueError) as error:
        fail(str(error))
    tell_chosen([f"{choice.family}/{choice.number:04d}" for choice in chosen], target)


@app.command("standard")
def choose_standard(
    folder: Annotated[
        Path, typer.Option("--candidates", help="Folder of candidates; simulated what it lacks.")
    ],
    target: List,
    table: Annotated[Path, typer.Option(help="Features of all candidates, CSV.")],
    states: States = None,
    version: Version = "1",
    kept: Annotated[
        Path | None,
        typer.Option("--keep", help="A list that stays; problems of other families come to it."),
    ] = None,
    problems: Annotated[int, typer.Option(help="That are chosen.", min=1)] = select.Rule.problems,
    clusters: Annotated[
        int, typer.Option(help="Number of clusters of like problems.", min=1)
    ] = select.Rule.clusters,
) -> None:
    """Choose few problems of each kind, from all families.

    It goes on after a kill. Families that changed, or are new, are simulated. Features of other
    families are read from the table, if there is one. A problem of a list that is kept stays as it
    is, even if its family has changed.
    """
    rule = select.Rule(problems=problems, clusters=clusters)
    held = set_index.Choice.read(kept) if kept is not None else ()
    try:
        rows = select.read_table(table) if table.is_file() else []
        sources = {}
        names = set(collections.families()) - {choice.family for choice in held}
        if not names:
            fail(f"{kept}: has problems of all families, there is nothing to add")
        with many_bars() as bars:
            for found in candidates(folder, sorted(names), progress=bars):
                name = found.plan.scene.name
                sources[name] = found
                own = [row for row in rows if row["family"] == name]
                if not select.describes(own, found):
                    rows = [row for row in rows if row["family"] != name]
                    rows += select.described(found, bars)
                    select.write_table(table, rows)
        # by the stored digits, so that everybody with the table gets the same choice
        rows = select.read_table(table)
        fixed = sorted({(choice.family, choice.number) for choice in held})
        chosen = [rows[k] for k in select.choose(rows, rule, fixed)]
        new = [row for row in chosen if row["family"] in names]
        choices = [*held, *select.choices_of(sources, new)]
        choices.sort(key=lambda choice: (choice.family, choice.number))
        choose.write_list(target, choices, rule.record() | {"kept": fixed})
        if states is not None:
            select.publish(sources, choices, "standard", version, states)
    except (ImportError, OSError, ValueError, FloatingPointError, MemoryError) as error:
        fail(str(error))
    counts = Counter(choice.family for choice in choices)
    for name, count in counts.items():
        out.print(f"{name} {count}", highlight=False)
    out.print(f"{len(choices)} problems of {len(rows)} candidates:  {target}")


@app.command("local")
def choose_local(
    folder: Annotated[Path, typer.Argument(help="Folder of a collection.")],
    target: List,
    sample: Annotated[int, typer.Option(help="Problems of a family that are looked at.")] = 200,
    per_family: PerFamily = 4,
    spins: Annotated[int, typer.Option(help="Spinning bodies that are drawn.", min=0)] = 2000,
    asymmetric: Annotated[
        int, typer.Option(help="How many asymmetric ones are taken.", min=0)
    ] = 16,
) -> None:
    """Choose the contacts that one-contact solvers find hardest."""
    try:
        with many_bars() as bars:
            found = choose.local(
                folder,
                sample=sample,
                per_family=per_family,
                spins=spins,
                asymmetric=asymmetric,
                progress=bars,
            )
    except (collections.CatalogError, ImportError, fclib.Error) as error:
        fail(str(error))
    rule = {
        "sample": sample,
        "per_family": per_family,
        "spins": spins,
        "asymmetric": asymmetric,
        "sweeps": choose.SWEEPS,
        "tol": choose.LOCAL_TOLERANCE,
    }
    choose.write_local(target, found, rule)
    tell_chosen([contact.origin for contact in found], target)


@app.command("tiny")
def choose_tiny(target: List) -> None:
    """Simulate one problem of each kind, and list them."""
    try:
        chosen = choose.tiny()
    except (ImportError, ValueError, FloatingPointError) as error:
        fail(str(error))
    choose.write_list(target, chosen, {"kinds": len(chosen)})
    tell_chosen([f"{choice.family}/{choice.number:04d}" for choice in chosen], target)


def tell_chosen(names: list[str], target: Path) -> None:
    """Print the problems taken."""
    for name in names:
        out.print(name, highlight=False)
    out.print(f"{len(names)} problems:  {target}")


if __name__ == "__main__":
    app(prog_name="python -m workshop.sets")
