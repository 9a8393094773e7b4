"""``fclib collection``: families of problems, built, checked, published and fetched."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

import fclib
from fclib import collections
from fclib.cli._output import Json, Report, err, fail, make_table, out, progress_bar, usage_error
from fclib.collections import choose
from fclib.collections.archives import FetchError
from fclib.collections.build import BuildError
from fclib.collections.known import KNOWN, choices, differing

app = typer.Typer(
    help="Families of problems: list, build, verify, publish, fetch.", no_args_is_help=True
)
choose_app = typer.Typer(
    help="Make the lists of chosen problems: the sets hard and tiny, the family LocalProblems.",
    no_args_is_help=True,
)
app.add_typer(choose_app, name="choose")


class Form(str, Enum):
    """The forms of a problem that are written."""

    GLOBAL = "global"
    LOCAL = "local"
    BOTH = "both"


class Select(str, Enum):
    """Which problems are kept, where not all are."""

    EVERY = "every"
    HARD = "hard"


Names = Annotated[list[str], typer.Argument(help="Sets or families, see fclib collection list.")]
Folder = Annotated[Path, typer.Argument(help="Folder of a collection.")]
Count = Annotated[
    int | None, typer.Option(help="Problems kept of each family; all by default.", min=1)
]
Jobs = Annotated[int | None, typer.Option(help="Processes; by default one a core.", min=1)]
FormOption = Annotated[Form, typer.Option(help="Forms that are written.")]
SelectOption = Annotated[
    Select, typer.Option(help="With --count: evenly, or those that cost NSGS most.")
]
Analyze = Annotated[
    bool, typer.Option("--analyze", help="Also ranks, conditioning, existence; slow.")
]
Pictures = Annotated[bool, typer.Option(help="Draw each scene and its distribution.")]


@contextmanager
def many_bars() -> Iterator[Callable[[str, int, int], None]]:
    """A bar for each family on the standard error, where that is a terminal."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=err, disable=not err.is_terminal) as bars:
        tasks: dict[str, Any] = {}

        def show(name: str, done: int, total: int) -> None:
            if name not in tasks:
                tasks[name] = bars.add_task(name, total=total)
            bars.update(tasks[name], completed=done, total=total)

        yield show


@app.command("list")
def list_families(
    of_sets: Annotated[bool, typer.Option("--sets", help="The sets instead.")] = False,
    as_json: Json = False,
) -> None:
    """The families, with their sets and numbers of problems; or the sets, with their versions."""
    report = Report(as_json)
    if of_sets:
        for name, folders in collections.sets().items():
            chosen = len(choices(name))
            known = collections.families()
            total = sum(known[folder.partition("/")[2]].problems for folder in folders)
            report.add(
                {
                    "set": name,
                    "version": collections.version(name),
                    "families": len(folders),
                    "problems": chosen or total,
                    "what": KNOWN[name][1] if name in KNOWN else "",
                }
            )
        if not as_json:
            out.print(make_table(report.records))
        return
    for name, family in collections.families().items():
        report.add(
            {
                "family": name,
                "set": family.collection,
                "problems": family.problems,
                "title": family.title,
                "application": family.application,
            }
        )
    if not as_json:
        out.print(make_table(report.records))


@app.command()
def show(
    name: Annotated[str, typer.Argument(help="A family, or a set.")],
    folder: Annotated[
        Path | None, typer.Option("--in", help="A folder where it was built, for its ranges.")
    ] = None,
    as_json: Json = False,
) -> None:
    """A family: what it is, its parameters, and what a build gave; or what a set has."""
    if name in collections.sets():
        show_set(name, as_json)
        return
    if name not in collections.families():
        try:
            collections.folders([name])
        except KeyError as error:
            usage_error(ValueError(error.args[0]))
    family = collections.families()[name.rpartition("/")[2]]
    record: dict[str, Any] = {
        "family": name,
        "set": family.collection,
        "problems": family.problems,
        "title": family.title,
        "description": family.description,
        "application": family.application,
        "friction": family.friction,
        "authors": family.authors,
    }
    parameters = [
        {
            "parameter": item.name,
            "default": item.default,
            "unit": item.metadata["unit"],
            "meaning": item.metadata["doc"],
        }
        for item in dataclasses.fields(family)
    ]
    ranges = None
    if folder is not None:
        try:
            rows = collections.read_catalog(folder).to_pylist()
        except (collections.CatalogError, ImportError) as error:
            fail(str(error))
        ranges = [row for row in ranges_of(rows) if row["family"] == name]
        if not ranges:
            fail(f"{folder}: holds no problem of {name}")
    if as_json:
        Report(True).add(
            record | {"parameters": parameters} | ({"built": ranges[0]} if ranges else {})
        )
        return
    for key, value in record.items():
        out.print(f"{key:12}{value}", highlight=False)
    if parameters:
        out.print()
        out.print(make_table(parameters))
    if ranges:
        out.print()
        out.print(make_table(ranges))


def show_set(name: str, as_json: bool) -> None:
    """The version of a set and its families; of a list, its problems."""
    report = Report(as_json)
    chosen = choices(name)
    for folder in collections.sets()[name]:
        family = folder.partition("/")[2]
        numbers = sorted(choice.number for choice in chosen if choice.family == family)
        count = len(numbers) if chosen else collections.families()[family].problems
        record: dict[str, Any] = {
            "folder": folder,
            "version": collections.version(name),
            "problems": count,
        }
        if chosen:
            record["numbers"] = ", ".join(map(str, numbers))
        report.add(record)
    if not as_json:
        out.print(make_table(report.records))


def ranges_of(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """A row for each family of a catalogue: how many problems, and from where to where."""
    found = []
    for name, family in dict.fromkeys((row["collection"], row["family"]) for row in rows):
        own = [row for row in rows if (row["collection"], row["family"]) == (name, family)]

        def span(key: str, own: list[dict[str, Any]] = own) -> str:
            values = [row[key] for row in own if row[key] is not None]
            return f"{min(values):.4g} to {max(values):.4g}" if values else ""

        found.append(
            {
                "family": family,
                "set": name,
                "version": own[0]["version"] or "",
                "problems": len(own),
                "solved": sum(row["status"] == "converged" for row in own),
                "dof": span("n"),
                "contacts": span("nc"),
                "density": span("density"),
                "mu": span("mu_max"),
                "largest error": max(row["error"] for row in own),
            }
        )
    return found


@app.command()
def build(
    names: Annotated[
        list[str] | None, typer.Argument(help="Sets or families, see fclib collection list.")
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="All families of the set rt444.")] = False,
    folder: Annotated[Path, typer.Option("--out", help="Folder of the collection.")] = Path(
        "collection"
    ),
    count: Count = None,
    select: SelectOption = Select.EVERY,
    form: FormOption = Form.BOTH,
    analyze: Analyze = False,
    jobs: Jobs = None,
    seed: Annotated[int, typer.Option(help="Seed of the scenes.", min=0)] = 0,
    pictures: Pictures = True,
    as_json: Json = False,
) -> None:
    """Simulate families and store their problems, solutions and catalogue; goes on after a kill."""
    if every == bool(names):
        raise typer.BadParameter("name sets or families, or say --all")
    try:
        folders = collections.folders(names or ["rt444"])
    except KeyError as error:
        usage_error(ValueError(error.args[0]))
    try:
        plans = [
            collections.plan_of(
                own, seed, form=form.value, count=count, select=select.value, analyze=analyze
            )
            for own in folders
        ]
    except ValueError as error:
        usage_error(error)
    run(plans, folder, jobs, pictures, as_json)


def run(
    plans: list[collections.Plan], folder: Path, jobs: int | None, pictures: bool, as_json: bool
) -> None:
    """Build plans, and print what came of them; exit status 1 where a problem was not solved."""
    try:
        with many_bars() as bars:
            table = collections.build(
                plans,
                folder,
                jobs=jobs or len(os.sched_getaffinity(0)),
                progress=bars,
                pictures=pictures,
            )
    except (BuildError, ImportError, FloatingPointError, ValueError, MemoryError) as error:
        fail(str(error))
    mine = {plan.name for plan in plans}
    rows = [row for row in table.to_pylist() if f"{row['collection']}/{row['family']}" in mine]
    report = Report(as_json)
    for row in ranges_of(rows):
        report.add(row, row["solved"] == row["problems"])
    if not as_json:
        if report.records:
            out.print(make_table(report.records))
        else:
            out.print("Nothing touches in any step: no problem was stored.")
        unsolved = [row for row in rows if row["status"] != "converged"]
        if unsolved:
            worst = max(unsolved, key=lambda row: float(row["error"]))
            out.print(
                f"{len(unsolved)} problems were not solved to {worst['tol']:g}; the worst is"
                f" {worst['id']}, error {worst['error']:.1e}. A simulation went on from there."
            )
        for name in dict.fromkeys(plan.collection for plan in plans if plan.chosen):
            own = [row for row in rows if row["collection"] == name]
            built = {row["family"] for row in own}
            other = [id for id in differing(name, own) if id.split("/")[1] in built]
            out.print(
                f"{len(own) - len(other)} of {len(own)} problems of the set {name} have the data"
                " that its list says"
                + (f"; not {', '.join(other[:3])}: another machine?" if other else "")
            )
        out.print(f"The catalogue:  {folder / 'catalog.parquet'}")
    raise typer.Exit(int(report.failed))


@app.command()
def verify(folder: Folder, as_json: Json = False) -> None:
    """Hash all files again, and judge their solutions from the data alone."""
    report = Report(as_json)
    try:
        rows = collections.read_catalog(folder).to_pylist()
        files = sum(len(collections.catalog.files_of(row)) for row in rows)
        with progress_bar(files) as bar:
            for verdict in collections.verify(folder, bar):
                if not verdict.ok:
                    err.print(f"fclib: {verdict.message}", style="red")
                if not verdict.ok or as_json:
                    report.add(
                        {
                            "problem": verdict.path,
                            "status": verdict.status,
                            "error": verdict.error,
                        },
                        verdict.ok,
                    )
    except (collections.CatalogError, ImportError) as error:
        fail(str(error))
    if not as_json:
        if report.records:
            out.print(make_table(report.records))
        bad = len(report.records)
        out.print(
            f"{files} files, {files - bad} as the catalogue says" + (f", {bad} not" if bad else "")
        )
    raise typer.Exit(int(report.failed))


@app.command()
def publish(
    folder: Folder,
    site: Annotated[Path, typer.Option("--out", help="Folder that a web server serves.")],
    as_json: Json = False,
) -> None:
    """Make an archive of each family, and the registry of their SHA-256."""
    try:
        files = collections.publish(folder, site)
    except (collections.CatalogError, FetchError, ImportError) as error:
        fail(str(error))
    report = Report(as_json)
    for path in files:
        report.add({"file": path.name, "bytes": path.stat().st_size})
    if not as_json:
        out.print(make_table(report.records))
        out.print(f"Serve {site}, then: fclib collection get NAME --from URL")


@app.command()
def get(
    names: Names,
    url: Annotated[str, typer.Option("--from", help="Where registry.txt lies.")],
    folder: Annotated[Path, typer.Option("--out", help="Folder of the collection.")] = Path(
        "collection"
    ),
) -> None:
    """Fetch published families, check them and unpack them; goes on where it broke off."""
    try:
        with many_bars() as bars:
            fetched = collections.get(names, url, folder, bars)
    except KeyError as error:
        usage_error(ValueError(error.args[0]))
    except (FetchError, collections.CatalogError, ImportError) as error:
        fail(str(error))
    rows = collections.read_catalog(folder).to_pylist()
    own = [row for row in rows if f"{row['collection']}/{row['family']}" in fetched]
    out.print(make_table(ranges_of(own)))


List = Annotated[Path, typer.Option("--out", help="The list that is written, JSON.")]
PerFamily = Annotated[int, typer.Option(help="Problems of a family, at most.", min=1)]


@choose_app.command("hard")
def choose_hard(
    stores: Annotated[list[Path], typer.Argument(help="Stores of fclib bench.")],
    folder: Annotated[Path, typer.Option("--in", help="The collection that they are of.")],
    target: List,
    tol: Annotated[float, typer.Option(help="Tolerance of the runs that count.")] = 1e-8,
    share: Annotated[
        float, typer.Option(help="Of the solvers that must have failed.", min=0.0, max=1.0)
    ] = 0.5,
    per_family: PerFamily = 5,
) -> None:
    """What most solvers fail on, from campaigns over the global files of a collection."""
    from fclib.bench import Store

    runs = []
    try:
        for path in stores:
            with Store(path, create=False) as store:
                runs += store.results()
        chosen = choose.hard(runs, folder, tol=tol, share=share, per_family=per_family)
    except (fclib.Error, collections.CatalogError, ImportError, ValueError) as error:
        fail(str(error))
    solvers = sorted({run["solver"] for run in runs if run["tol"] == tol})
    limits = sorted({run["time_limit"] for run in runs if run["tol"] == tol})
    rule = {"tol": tol, "share": share, "per_family": per_family}
    choose.write_list(target, chosen, rule | {"solvers": solvers, "time_limits": limits})
    tell_chosen([f"{choice.family}/{choice.number:04d}" for choice in chosen], target)


@choose_app.command("local")
def choose_local(
    folder: Folder,
    target: List,
    sample: Annotated[int, typer.Option(help="Problems of a family that are looked at.")] = 200,
    per_family: PerFamily = 4,
    spins: Annotated[int, typer.Option(help="Spinning bodies that are drawn.", min=0)] = 2000,
    asymmetric: Annotated[int, typer.Option(help="Of them, those that are taken.", min=0)] = 16,
) -> None:
    """The contacts that one-contact solvers find hardest, from the local files of a collection."""
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


@choose_app.command("tiny")
def choose_tiny(target: List) -> None:
    """One problem of each kind: simulated anew, with the digests of its data."""
    try:
        chosen = choose.tiny()
    except (ImportError, ValueError, FloatingPointError) as error:
        fail(str(error))
    choose.write_list(target, chosen, {"kinds": len(chosen)})
    tell_chosen([f"{choice.family}/{choice.number:04d}" for choice in chosen], target)


def tell_chosen(names: list[str], target: Path) -> None:
    """Say what was taken."""
    for name in names:
        out.print(name, highlight=False)
    out.print(f"{len(names)} problems:  {target}")
