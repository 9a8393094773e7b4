"""``fclib results``: published runs, which lie in files that never change."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

import fclib
from fclib import bench, results
from fclib._words import counted
from fclib.bench.calibration import calibration_in
from fclib.cli._output import Json, Report, Rows, err, fail, out, words_of
from fclib.results import boards
from fclib.results.leaders import of_set

app = typer.Typer(help="Published runs: list, show, verify; submit your own.", no_args_is_help=True)

Where = Annotated[
    Path | None,
    typer.Option("--in", help="Folder of the parts; by default that of the published ones."),
]


def folder_of(where: Path | None) -> Path:
    """The folder of the parts; the command ends if there is none."""
    found = where or results.folder()
    if found is None:
        fail("no runs are published here: pip install fclib-results, or name a folder by --in")
    return found


def parts_of(where: Path | None) -> list[results.Shard]:
    """The parts; the command ends if one is damaged, or a folder is named that has none."""
    try:
        found = results.shards(folder_of(where))
    except (ImportError, fclib.Error) as error:
        fail(str(error))
    if where is not None and not found:
        fail(f"{where}: {'has no part, *.parquet' if where.is_dir() else 'is no folder of parts'}")
    return found


@app.command("list")
def list_parts(where: Where = None, as_json: Json = False) -> None:
    """List the parts, with their runs and machines."""
    report = Report(as_json)
    for one in parts_of(where):
        calibrated = [name for name, facts in one.machines.items() if calibration_in(facts)]
        report.add(
            {
                "part": one.path.name,
                "runs": one.runs,
                "campaigns": ", ".join(dict.fromkeys(str(c.get("name")) for c in one.campaigns)),
                "machines": ", ".join(one.machines),
                "calibrated": len(calibrated) == len(one.machines),
                "MB": one.path.stat().st_size / 1e6,
            }
        )
    if not as_json:
        out.print(Rows(report.records) if report.records else "no runs are published here")


@app.command()
def show(where: Where = None, as_json: Json = False) -> None:
    """Show what was run: the problems, runs and solved runs of each solver at each tolerance."""
    counts: dict[tuple[str, float], dict[str, Any]] = {}
    problems: dict[tuple[str, float], set[str]] = {}
    for part in parts_of(where):
        names = ("solver", "tol", "hash", "solved", "cpu_s")
        for row in results.rows_of(part.path, names):
            key = row["solver"], row["tol"]
            own = counts.setdefault(key, {"runs": 0, "solved": 0, "CPU [h]": 0.0})
            own["runs"] += 1
            own["solved"] += row["solved"]
            own["CPU [h]"] += (row["cpu_s"] or 0.0) / 3600
            problems.setdefault(key, set()).add(row["hash"])
    report = Report(as_json)
    for solver, tol in sorted(counts):
        key = solver, tol
        report.add({"solver": solver, "tol": tol, "problems": len(problems[key]), **counts[key]})
    if not as_json:
        out.print(Rows(report.records) if report.records else "no runs are published here")


@app.command()
def leaders(where: Where = None, as_json: Json = False) -> None:
    """Show the solvers of each set in their order, with version, machine and date."""
    report = Report(as_json)
    failed = False
    for name, parts in boards.sources(boards.by_name(parts_of(where))).items():
        try:
            for row in of_set(name, parts, tell):
                report.add(row)
        except (ImportError, fclib.Error) as error:
            failed = True
            tell(f"{name}: {error}", "red")
    if not as_json:
        out.print(Rows(report.records) if report.records else "no runs are published here")
    raise typer.Exit(int(failed))


def tell(words: str, style: str = "yellow") -> None:
    """A line on the standard error."""
    err.print(f"fclib: {words}", style=style, highlight=False, markup=False)


@app.command()
def verify(
    files: Annotated[
        list[Path] | None, typer.Argument(help="Parts; by default all of the folder.")
    ] = None,
    where: Where = None,
    problems: Annotated[
        list[Path] | None,
        typer.Option(help="Folder of a collection: the solutions of the parts are judged again."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Check the parts: their names against their contents, and each row against itself."""
    report = Report(as_json)
    paths = files or sorted(folder_of(where).glob("*.parquet"))
    if not paths:
        fail("there is no part to check")
    for folder in problems or ():
        if not folder.is_dir():
            fail(f"{folder}: is no folder")
    for path in paths:
        if not path.exists():
            fail(f"{path}: there is no such file")
        record: dict[str, Any] = {"part": str(path)}
        try:
            wrong = results.verify(path)
            if problems:
                verdicts = results.judged(path, problems)
                counts = Counter(row["status"] for row in verdicts)
                record |= {"solutions judged": counts["ok"] + counts["wrong"]}
                record |= {"without a problem": counts["no problem"]}
                wrong += [
                    f"{row['problem']} by {row['solver']} to {row['tol']:g}: {reason(row)}"
                    for row in verdicts
                    if row["status"] != "ok"
                ]
        except (ImportError, OSError, fclib.Error) as error:
            wrong = [str(error).removeprefix(f"{path}: ")]
        report.add({**record, "status": "wrong" if wrong else "ok"}, not wrong)
        for word in wrong[:10]:
            err.print(f"fclib: {path}: {word}", style="red", highlight=False)
        if len(wrong) > 10:
            err.print(f"fclib: {path}: {len(wrong) - 10} more", style="red")
    doubled = results.twice(paths) if not report.failed else []
    for word in doubled[:10]:
        tell(word, "red")
    if not as_json:
        out.print(Rows(report.records))
    raise typer.Exit(int(report.failed or bool(doubled)))


def reason(row: Mapping[str, Any]) -> str:
    """Why a solution of a part is not what it says."""
    if row["status"] == "no problem":
        return "no file of the folders has its problem, so it is not judged"
    if row["error"] is None:
        return f"is no solution of its problem: {row['why']}"
    said = "nothing" if row["said"] is None else f"{row['said']:.3g}"
    return f"the error is {row['error']:.3g}, and the part says {said}"


@app.command()
def pack(
    store: Annotated[Path, typer.Argument(help="A store of `fclib bench`.")],
    name: Annotated[str, typer.Option(help='Of the part, as "standard".')],
    where: Where = None,
    machine: Annotated[
        str, typer.Option(help="Name of the machine; by default the model of its processor.")
    ] = "",
) -> None:
    """Write the runs of a store that no part has yet as a new part.

    The host name, messages, and the texts of campaigns stay private: they may name paths.
    """
    try:
        with bench.Store(store, create=False) as opened:
            bare = [one for one in opened.machines().values() if calibration_in(one) is None]
            there = results.shards(folder_of(where))
            path = results.pack(opened, folder_of(where), name, machine, there)
    except (ImportError, fclib.Error) as error:
        fail(str(error))
    except OSError as error:
        fail(words_of(error))
    if bare:
        err.print(
            "Some runs were begun before this machine was calibrated (fclib bench --calibrate):"
            " their times cannot be put beside those of another machine",
            highlight=False,
        )
    out.print(str(path) if path else "there is no new run", highlight=False)


@app.command()
def unpack(
    store: Annotated[Path, typer.Argument(help="A store of `fclib bench`, made if there is none.")],
    names: Annotated[
        list[str] | None, typer.Option("--name", help='Parts of this name, as "standard".')
    ] = None,
    where: Where = None,
) -> None:
    """Put published runs into a store, so that `fclib bench --store` goes on with a campaign.

    It goes on even if they were made on another machine: no run whose solver is still the same is
    done again.
    """
    found = parts_of(where)
    chosen = [one for one in found if not names or one.name in names]
    if lost := sorted(set(names or ()) - {one.name for one in found}):
        fail(f"{', '.join(lost)}: there is no such part; fclib results list shows them")
    try:
        with bench.Store(store) as opened:
            count = results.unpack(chosen, opened)
    except (ImportError, fclib.Error) as error:
        fail(str(error))
    except OSError as error:
        fail(words_of(error))
    out.print(f"{store}: {counted(count, 'run is new', 'runs are new')}", highlight=False)


@app.command()
def submit(
    store: Annotated[Path, typer.Argument(help="A store of `fclib bench`.")],
    name: Annotated[str, typer.Option(help='Set of the runs, as "standard".')],
    where: Annotated[Path, typer.Option("--out", help="Folder of the file.")] = Path(),
    machine: Annotated[
        str, typer.Option(help="Name of the machine; by default the model of its processor.")
    ] = "",
) -> None:
    """Write all runs of a store as one file, with the solutions of a sample, to hand them in.

    `fclib results verify FILE --problems FOLDER` judges these solutions again. CONTRIBUTING.md says
    what happens then.
    """
    try:
        with bench.Store(store, create=False) as opened:
            own = {float(row["time_limit"]) for row in opened.table()}
            published = results.shards(found) if (found := results.folder()) else []
            usual = boards.usual_limit(name, published)
            path = results.submit(opened, where, name, machine, published)
    except (ImportError, fclib.Error) as error:
        fail(str(error))
    except OSError as error:
        fail(words_of(error))
    if own and usual > max(own):
        tell(
            f"the limit of these runs is {max(own):g} s. The leaderboard of {name} compares under"
            f" {usual:g} s, and leaves them out: run them with --time-limit {usual:g}"
        )
    out.print(str(path), highlight=False)
