"""``fclib collection``: families of problems, simulated, built, checked, published and fetched."""

from __future__ import annotations

import dataclasses
import re
from collections import Counter
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer

import fclib
from fclib import collections
from fclib._judge import TOLERANCE
from fclib._regular import reason_of, regular, resolved
from fclib._verdicts import CLASSES
from fclib._words import counted
from fclib.cli._build import (
    Analyze,
    Count,
    Form,
    FormOption,
    Pictures,
    Select,
    SelectOption,
    build_plans,
    ranges_of,
    simulated,
)
from fclib.cli._output import (
    Json,
    Report,
    Rows,
    err,
    fail,
    finite_tolerance,
    out,
    progress_bar,
    usage_error,
    words_of,
)
from fclib.cli._progress import many_bars
from fclib.collections import catalog, library, ratings, references
from fclib.collections.archives import FetchError
from fclib.collections.plan import evenly
from fclib.collections.set_index import SETS, choices, distinct_of, kind_of, problems_of
from fclib.collections.verify import LACKING

app = typer.Typer(
    help="Families of problems: list, build, verify, publish, get.", no_args_is_help=True
)

MOST_COPIES = 10  # largest number of copies named; the catalogue has all

Rating = Enum("Rating", {name: name for name in CLASSES}, type=str)  # type: ignore[misc]
Names = Annotated[list[str], typer.Argument(help="Sets or families, see fclib collection list.")]
Folder = Annotated[Path, typer.Argument(help="Folder of a collection.")]
Jobs = Annotated[int | None, typer.Option(help="Processes; by default one a core.", min=1)]


ListFile = Annotated[
    Path | None,
    typer.Option("--list", help="File of names, a line each, as the report's catalogue saves it."),
]


def named(names: list[str] | None, path: Path | None) -> list[str]:
    """The names given, and those of a list."""
    found = list(names or [])
    if path is not None:
        try:
            lines = regular(path).read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeError) as error:
            fail(f"{path}: cannot be read as a list of names: {reason_of(error)}")
        found += [line.strip() for line in lines if line.strip() and line.strip()[0] != "#"]
        if not found:
            fail(f"{path}: names nothing")
    return found


@app.command("list")
def list_families(
    of_sets: Annotated[bool, typer.Option("--sets", help="The sets instead.")] = False,
    as_json: Json = False,
) -> None:
    """List the families with their numbers of problems, or the sets.

    Distinct problems have different data. The column is empty if that is not known without a
    simulation.
    """
    report = Report(as_json)
    if of_sets:
        for name, folders in collections.sets().items():
            report.add(
                {
                    "set": name,
                    "version": collections.version(name),
                    "families": len(folders),
                    "problems": sum(map(problems_of, folders)),
                    "distinct": distinct_of(folders),
                    "what": SETS[name][1] if name in SETS else "",
                }
            )
        if not as_json:
            out.print(Rows(report.records))
        return
    for name, family in collections.families().items():
        report.add(
            {
                "family": name,
                "set": family.collection,
                "problems": problems_of(f"{family.collection}/{name}"),
                "distinct": distinct_of([f"{family.collection}/{name}"]),
                "title": family.title,
                "application": family.application,
            }
        )
    if not as_json:
        out.print(Rows(report.records))


@app.command()
def show(
    name: Annotated[str, typer.Argument(help="A family, or a set.")],
    folder: Annotated[
        Path | None, typer.Option("--in", help="A folder where it was built, for its ranges.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Show a family with its parameters, or what a set has."""
    if name in collections.sets():
        show_set(name, as_json)
        return
    if name not in collections.families():
        try:
            collections.folders([name])
        except KeyError as error:
            usage_error(ValueError(error.args[0]))
    kind = kind_of(name)
    family = collections.families()[kind]
    record: dict[str, Any] = {
        "family": name,
        "set": family.collection,
        "problems": problems_of(f"{family.collection}/{kind}"),
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
        out.print(Rows(parameters))
    if ranges:
        out.print()
        out.print(Rows(ranges))


def show_set(name: str, as_json: bool) -> None:
    """The version of a set and its families; of a list, its problems."""
    report = Report(as_json)
    chosen = choices(name)
    for folder in collections.sets()[name]:
        family = folder.partition("/")[2]
        numbers = sorted(choice.number for choice in chosen if choice.family == family)
        record: dict[str, Any] = {
            "folder": folder,
            "version": collections.version(name),
            "problems": problems_of(folder),
            "distinct": distinct_of([folder]),
        }
        if numbers:
            record["numbers"] = ", ".join(map(str, numbers))
        report.add(record)
    if not as_json:
        out.print(Rows(report.records))


@app.command()
def build(
    names: Annotated[
        list[str] | None, typer.Argument(help="Sets, families, or problems: SET/FAMILY/NUMBER.")
    ] = None,
    listed: ListFile = None,
    folder: Annotated[Path, typer.Option("--out", help="Folder of the collection.")] = Path(
        "collection"
    ),
    count: Count = None,
    select: SelectOption = Select.EVERY,
    form: FormOption = Form.BOTH,
    analyze: Analyze = False,
    jobs: Jobs = None,
    seed: Annotated[int, typer.Option(help="Seed of the scenes.", min=0)] = 0,
    version: Annotated[
        str | None, typer.Option(help="A stored version; by default the newest.")
    ] = None,
    source: Annotated[
        Path | None,
        typer.Option("--from", help="Folder of trajectories, as fclib collection simulate writes."),
    ] = None,
    simulate: Annotated[
        bool,
        typer.Option(help="Simulate families without stored states; otherwise that is an error."),
    ] = True,
    references: Annotated[bool, typer.Option(help="Find and store reference solutions.")] = True,
    tol: Annotated[
        float,
        typer.Option(
            help="Error that the solver of these is asked for; they are finished to 1e-12 then.",
            min=0.0,
            max=TOLERANCE,
        ),
    ] = collections.Plan.tol,
    certify: Annotated[
        bool,
        typer.Option(
            "--certify", help="Confirm each solution by a second, unrelated algorithm: seconds."
        ),
    ] = False,
    pictures: Pictures = True,
    as_json: Json = False,
) -> None:
    """Build the problems of families from their stored states.

    Problems, reference solutions and catalogue are stored. After a kill, the same command goes on.
    Families without stored states are simulated first.
    """
    names = named(names, listed)
    if not names:
        raise typer.BadParameter("name sets, families or problems")
    try:
        folders = collections.numbered(names, version)
    except KeyError as error:
        usage_error(ValueError(error.args[0]))
    try:
        plans = [
            collections.plan_of(
                own,
                seed,
                version,
                form=form.value,
                count=count,
                select=select.value,
                analyze=analyze,
                references=references,
                certify=certify,
                tol=tol,
            )
            for own in folders
        ]
        plans = [
            plan.only(numbers) if numbers else plan
            for plan, numbers in zip(plans, folders.values(), strict=True)
        ]
        if source is not None:
            plans = [collections.from_folder(plan, source) for plan in plans]
    except collections.VersionError as error:
        fail(str(error))
    except (collections.TrajectoryError, FileNotFoundError) as error:
        fail(str(error))
    except ValueError as error:
        usage_error(error)
    missing = [plan.name for plan in plans if simulated(plan) and plan.trajectory is None]
    if missing and not simulate:
        fail(f"no trajectory is stored of {', '.join(missing)}: --simulate makes one")
    build_plans(plans, folder, jobs, pictures, as_json)


@app.command()
def simulate(
    names: Names,
    folder: Annotated[Path, typer.Option("--out", help="Folder of trajectories.")] = Path(
        "trajectories"
    ),
    version: Annotated[
        str,
        typer.Option(help="Name of the version; a published one is a number, higher than before."),
    ] = "own",
    solver: Annotated[str, typer.Option(help="Solver of each step.")] = "auto",
    tol: Annotated[
        float,
        typer.Option(help="Bound on the error of each step.", min=0.0, callback=finite_tolerance),
    ] = 1e-12,
    seed: Annotated[int, typer.Option(help="Seed of the scenes.", min=0)] = 0,
    count: Annotated[
        int | None,
        typer.Option(help="States kept of a family, at equal distances; else all.", min=2),
    ] = None,
    as_json: Json = False,
) -> None:
    """Simulate new states of families, for build --from.

    After a kill, the same command goes on. A file SET/FAMILY-VERSION.trajectory is never rewritten:
    other states need another version.
    """
    report = Report(as_json)
    try:
        plans = [
            replace(
                collections.fresh_plan(own, seed),
                version=version,
                simulation=collections.Simulation(solver=solver, tol=tol),
            )
            for own in collections.folders(names)
        ]
        plans = [thinned(plan, count) for plan in plans if simulated(plan)]
        if not plans:
            fail(f"{', '.join(names)}: assembled directly, there is nothing to simulate")
        with many_bars() as bars:
            for plan in plans:
                target = folder / collections.file_name(plan.name, version)
                state = target.with_name(f".{target.name}.npz")
                collections.record(plan, target, state, bars)
                states = collections.read_trajectory(target)
                report.add(
                    {
                        "family": plan.name,
                        "version": version,
                        "problems": len(states),
                        "states": states.position.shape[1] + states.velocity.shape[1],
                        "bytes": target.stat().st_size,
                        "file": str(target),
                    }
                )
    except KeyError as error:
        usage_error(ValueError(error.args[0]))
    except (ImportError, OSError, ValueError, FloatingPointError, MemoryError) as error:
        fail(words_of(error))
    if not as_json:
        out.print(Rows(report.records))
        out.print(f"fclib collection build {' '.join(names)} --from {folder} takes them")


def thinned(plan: collections.Plan, count: int | None) -> collections.Plan:
    """The plan, restricted to so many of its problems."""
    if count is None:
        return plan
    numbers = plan.numbers()
    kept = numbers[evenly(len(numbers), count)]
    return replace(plan, chosen=tuple(kept.tolist()))


@app.command()
def verify(folder: Folder, as_json: Json = False) -> None:
    """Check all files, their solutions, and what is published.

    All files are hashed again. All solutions are judged again, from the data alone and as fclib
    check does. What the catalogue lacks is named: families whose build was cut, and files that no
    row has. A problem whose
    data differ from the published ones is named, with the relative difference of each matrix. A
    small difference is rounding on another machine. A larger one is another problem.
    """
    report = Report(as_json)
    origins: Counter[str] = Counter()
    bad = lacking = 0
    try:
        rows = collections.read_catalog(folder).to_pylist()
        files = sum(len(catalog.files_of(row)) for row in rows)
        with progress_bar(files) as bar:
            for verdict in collections.verify(folder, bar):
                origins[verdict.origin] += 1
                lacking += verdict.status in LACKING
                if not verdict.ok:
                    err.print(f"fclib: {verdict.message}", style="red")
                if not verdict.ok or verdict.differences or as_json:
                    apart = {name: f"{value:.1e}" for name, value in verdict.differences.items()}
                    record: dict[str, Any] = {
                        "problem": verdict.path,
                        "status": verdict.status,
                        "error": verdict.error,
                        "data": verdict.origin,
                        "differences": ", ".join(f"{name} {size}" for name, size in apart.items()),
                    }
                    report.add(record, verdict.ok)
                    bad += not verdict.ok and verdict.status not in LACKING
    except (collections.CatalogError, ImportError) as error:
        fail(str(error))
    if not as_json:
        if report.records:
            out.print(Rows(report.records))
        out.print(
            f"{counted(files, 'file')}, {files - bad} as the catalogue says"
            + (f", {bad} not" if bad else "")
        )
        if lacking:
            lost = counted(lacking, "file or family is", "files or families are")
            out.print(f"{lost} not in the catalogue, or not whole")
        proven = sum(map(catalog.is_proven, rows))
        unsolved = sum(row["has_solution"] is False for row in rows) - proven
        if proven:
            told = counted(proven, "problem is proven", "problems are proven")
            out.print(f"{told} to have no solution: the files say so")
        if unsolved:
            told = counted(unsolved, "problem has", "problems have")
            out.print(f"{told} no known solution: the files say so")
        phrases = {
            "published": ("has", "have", "the data of the published version"),
            "differs": ("differs", "differ", "from the published version"),
            "yours": ("is yours", "are yours", "and in no published trajectory or list"),
        }
        for origin, (one, many, words) in phrases.items():
            if origins[origin]:
                told = counted(origins[origin], f"problem {one}", f"problems {many}")
                out.print(f"{told} {words}")
    raise typer.Exit(int(report.failed))


FOUND = ("id", "nc", "n", "mu_max", "law", "formulation", "rating", "trivial", "same_as")


@app.command()
def find(
    condition: Annotated[str, typer.Argument(help='As "nc > 1000 and mu < 0.5".')],
    folder: Annotated[
        Path | None,
        typer.Option("--in", help="Folder of a collection; by default that of built problems."),
    ] = None,
    files: Annotated[
        bool,
        typer.Option("--files", help="Print a path a line: of the global form if there is one."),
    ] = False,
    as_json: Json = False,
) -> None:
    """Find the problems of a collection by the columns of its catalogue.

    A condition compares columns, numbers and texts, with and, or, not and brackets. A comparison
    with a missing value is not true. "same_as is None" leaves out the copies, and "trivial is None"
    what r = 0 solves.
    """
    folder = folder or library.default_folder()
    report = Report(as_json)
    try:
        table = collections.read_catalog(folder)
        rows = catalog.where(table, condition).to_pylist()
    except catalog.ConditionError as error:
        usage_error(error)
    except (collections.CatalogError, ImportError) as error:
        fail(str(error))
    root = folder if folder.is_dir() else folder.parent
    for row in rows:
        if as_json:
            report.add(row)
        elif files:
            out.print(
                root / (row["global_file"] or row["local_file"]), soft_wrap=True, highlight=False
            )
        else:
            report.add({name: row[name] for name in FOUND})
    if not (as_json or files):
        if rows:
            out.print(Rows(report.records))
        told = f"{len(rows)} of {counted(table.num_rows, 'problem')}"
        if (different := catalog.distinct(rows)) < len(rows):
            told += f", {different} of them distinct"
        out.print(told)


@app.command()
def status(
    name: Annotated[
        str, typer.Argument(help="A set, or a problem SET/FAMILY/NUMBER.")
    ] = ratings.FIRST,
    only: Annotated[
        Rating | None, typer.Option("--class", help="Each problem of one class.")
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="Each problem.")] = False,
    target: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Write the problem with the best solution known, or iterate, as a guess."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Show which problems are easy, hard or open.

    The classes follow from the published runs (fclib results), which the first line names. Of open
    problems the command shows the best error known, and who found it.
    """
    try:
        if name.count("/") == 2:
            tell_problem(name, target, as_json)
            return
        if target is not None:
            usage_error(ValueError("--out takes one problem: SET/FAMILY/NUMBER"))
        rows, basis = ratings.ratings_of(name)
    except KeyError as error:
        usage_error(ValueError(error.args[0]))
    except (ratings.RatingError, fclib.Error, OSError) as error:
        fail(str(error))
    report = Report(as_json)
    wanted = [row for row in rows if only is None or row.rating == only.value]
    if as_json:
        for row in wanted:
            report.add(record_of(row))
        return
    if basis is None:
        fail(
            f"{name}: no published run is of its {counted(len(rows), 'problem')}; the package"
            " fclib-results has the runs, and fclib results pack adds those of a store"
        )
    out.print(f"Classes {basis}", highlight=False)
    if only is not None or every:
        if wanted:
            out.print(Rows([record_of(row) for row in wanted]))
        else:
            of = counted(len(rows), "problem")
            out.print(f"None of {of} of {name} is {only.value if only else ''}")
        return
    families: dict[str, Counter[str]] = {}
    limits: dict[str, set[float]] = {}
    for row in rows:
        if row.limit is not None:
            limits.setdefault(row.id.split("/")[1], set()).add(row.limit)
        families.setdefault(row.id.split("/")[1], Counter())[row.rating or "not run"] += 1
    families["all"] = sum(families.values(), Counter())
    columns = [*CLASSES, *(["not run"] if families["all"]["not run"] else [])]
    out.print(
        Rows(
            [
                {
                    "family": family,
                    "CPU a run [s]": " or ".join(f"{t:g}" for t in sorted(limits.get(family, ()))),
                    **{column: counts[column] for column in columns},
                }
                for family, counts in families.items()
            ]
        )
    )
    open_ones = [row for row in rows if row.rating == "open"]
    if open_ones:
        out.print()
        out.print(Rows([record_of(row) for row in open_ones], title="Open"))
    if known_ones := [row for row in open_ones if row.solution is not None]:
        out.print(
            f"fclib collection status {known_ones[0].id} --out FILE writes what is known of one"
        )


def record_of(row: ratings.RatedProblem) -> dict[str, Any]:
    """A problem and its class, for a table."""
    best = row.best
    return {
        "problem": row.id,
        "class": row.rating or "not run",
        "solved": f"{row.solved} of {row.voters}",
        "limit": row.limit,
        "best error": best.error if best is not None else None,
        "by": best.solver if best is not None else "",
        "version": best.version if best is not None else "",
        "date": best.date if best is not None else "",
        "solution": row.solution.name if row.solution is not None else "",
    }


def tell_problem(name: str, target: Path | None, as_json: bool) -> None:
    """Show the class of one problem; write it with the best known solution."""
    rows, _ = ratings.ratings_of(name.split("/")[0])
    found = [row for row in rows if row.id == name]
    if not found:
        fail(
            f"{name}: there is no such problem; fclib collection status names those that there are"
        )
    if target is not None:
        problem, solution, finder = ratings.known_solution(name)
        best = references.given(problem, solution, finder["by"], finder["date"])
        references.write(target, problem, best)
        err.print(f"error {best.error:.3g}, by {finder['by']}, {finder['date']}", highlight=False)
    report = Report(as_json)
    report.add(record_of(found[0]))
    if not as_json:
        out.print(Rows(report.records))


@app.command("take")
def accept(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="FCLIB files with problem and solution; .json: proofs of fclib analyze."
        ),
    ],
    by: Annotated[str, typer.Option(help="Who found it, and how: a name, a solver, its version.")],
    name: Annotated[
        str | None,
        typer.Option("--problem", help="SET/FAMILY/NUMBER; by default by the digest of its data."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Take in a better solution of an open problem, or a proof that it has none.

    Both are judged on the collection's own problem. A solution must be better than the best one
    known. A proof (fclib analyze FILE --json > proof.json) must be exact. What is taken is stored
    in the package of stored states: commit it.
    """
    report = Report(as_json)
    for path in files:
        try:
            error: float | None
            before: float | None
            if path.suffix == ".json":
                taken, error, before = ratings.accept_proof(path, by, name), None, None
            else:
                taken, error, before = ratings.accept_solution(path, by, name)
        except (ratings.RatingError, fclib.Error, OSError, KeyError) as reason:
            words = str(reason.args[0]) if isinstance(reason, KeyError) else str(reason)
            err.print(f"fclib: {words}", style="red", highlight=False)
            report.add({"problem": str(path), "taken": False, "error": None, "before": None}, False)
            continue
        report.add({"problem": taken, "taken": True, "error": error, "before": before})
    if not as_json:
        out.print(Rows(report.records))
    raise typer.Exit(int(report.failed))


@app.command()
def add(
    source: Annotated[Path, typer.Argument(metavar="DIR", help="Folder with FCLIB files.")],
    name: Annotated[
        str | None,
        typer.Option(help="Name of the set; by default that of the folder.", show_default=False),
    ] = None,
    folder: Annotated[Path, typer.Option("--out", help="Folder of the collection.")] = Path(
        "collection"
    ),
    references: Annotated[bool, typer.Option(help="Find and store reference solutions.")] = True,
    tol: Annotated[
        float, typer.Option(help="Error that the solver is asked for.", min=0.0, max=TOLERANCE)
    ] = TOLERANCE,
    time_limit: Annotated[
        float, typer.Option(help="Time limit of each solve [s].", min=0.001)
    ] = 20.0,
    license_: Annotated[
        str | None, typer.Option("--license", help="Licence of the data, for the catalogue.")
    ] = None,
    citation: Annotated[
        str | None, typer.Option(help="How to name the data, for the catalogue.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Make a set of your own FCLIB files.

    The files are copied, and never changed. Each folder becomes a family. A solution in a file
    stays if it is one: its error by both natural maps is at most 1e-8. What is no solution goes to
    the guesses of the copy, unless a better one is found. Files with equal problems are named. A
    file without a valid problem is named and left out, and the exit status is 1.
    """
    rules = collections.Rules(
        references=references, tol=tol, time_limit=time_limit, license=license_, citation=citation
    )
    mine = collections.plain(name or resolved(source).name)
    try:
        with many_bars() as bars:
            refused = collections.add(source, folder, mine, rules, bars)
        table = collections.read_catalog(folder).to_pylist()
    except ValueError as error:
        usage_error(error)
    except (collections.CatalogError, ImportError, OSError) as error:
        fail(str(error))
    report = Report(as_json)
    rows = [row for row in table if row["collection"] == mine]
    for row in ranges_of(rows):
        report.add(row)
    for refusal in refused:
        report.error(refusal.path, fclib.Error(refusal.reason))
    if not as_json and rows:
        out.print(Rows(report.records))
        unsolved = [
            row for row in rows if row["has_solution"] is False and not catalog.is_proven(row)
        ]
        if unsolved:
            names = ", ".join(f"{row['id']} ({row['error']:.1e})" for row in unsolved[:3])
            out.print(f"{len(unsolved)} have no known solution: {names}", highlight=False)
        copies = [row for row in rows if row["same_as"] is not None]
        for row in copies[:MOST_COPIES]:
            out.print(f"{row['source']}: the same problem as {row['same_as']}", highlight=False)
        if len(copies) > MOST_COPIES:
            out.print(f"... {len(copies)} copies in all; the catalogue's column same_as has them")
        out.print(f"FCLIB_COLLECTION={folder} makes set:{mine} known to fclib bench, and to load")
    raise typer.Exit(int(report.failed))


@app.command()
def publish(
    folder: Folder,
    site: Annotated[Path, typer.Option("--out", help="Folder that a web server serves.")],
    as_json: Json = False,
) -> None:
    """Make an archive of each family, and their checksums.

    What the catalogue lacks is named and left out: families whose build was cut, and files that no
    row has. The exit status is then 1.
    """
    try:
        lacking = [
            *(f"{name}: its build was cut" for name in catalog.unfinished(folder)),
            *(
                f"{path}: is not in the catalogue"
                for path in catalog.lacking(folder, collections.read_catalog(folder).to_pylist())
            ),
        ]
        files = collections.publish(folder, site)
    except (collections.CatalogError, FetchError, ImportError) as error:
        fail(str(error))
    report = Report(as_json)
    for path in files:
        report.add({"file": path.name, "bytes": path.stat().st_size})
    if not as_json:
        out.print(Rows(report.records))
        out.print(f"Serve {site}, then: fclib collection get NAME --from URL")
    for line in lacking:
        err.print(f"fclib: {folder / line}; left out", style="red", highlight=False)
    raise typer.Exit(int(bool(lacking)))


@app.command()
def get(
    url: Annotated[
        str, typer.Option("--from", help="Where registry.txt lies: an address or a folder.")
    ],
    names: Annotated[
        list[str] | None, typer.Argument(help="Sets or families; of a problem its family comes.")
    ] = None,
    listed: ListFile = None,
    folder: Annotated[Path, typer.Option("--out", help="Folder of the collection.")] = Path(
        "collection"
    ),
) -> None:
    """Fetch published families, check them and unpack them."""
    # an archive holds a family
    names = list(dict.fromkeys(re.sub(r"/[0-9]+$", "", name) for name in named(names, listed)))
    if not names:
        raise typer.BadParameter("name sets or families, or a --list of problems")
    try:
        with many_bars() as bars:
            fetched = collections.get(names, url, folder, bars)
    except KeyError as error:
        usage_error(ValueError(error.args[0]))
    except (FetchError, collections.CatalogError, ImportError) as error:
        fail(str(error))
    rows = collections.read_catalog(folder).to_pylist()
    own = [row for row in rows if f"{row['collection']}/{row['family']}" in fetched]
    out.print(Rows(ranges_of(own)))
