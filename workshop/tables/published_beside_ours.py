"""Published sets beside ours: their figures, and whole distributions, by one command.

    .venv/bin/python -m workshop.tables.published_beside_ours FOLDER... [--files FILES.csv]
        [--sample 32] [--limit 1900] [--most 200000] [--seconds 20] [--pictures OUT]
        [--results NAME] [--only SET/FAMILY...]
    .venv/bin/python -m workshop.tables.published_beside_ours FOLDER... --report OUT

The first table has the ends of sizes, density, rank ratio and conditioning of each published set
(workshop/sets/published_sets.csv), and of ours under it; collection_table.py says how they are
found. The last column says whether ours has the published range.

FILES.csv lists the files of the published library: set, file, nsgs_sweeps, dof, contacts, as their
names tell these; it is no part of this project. With it there is a second table, of the quantiles
of contacts, dof and sweeps of each set, and of ours under it (NAME-distributions). Contacts and dof
are those of all problems of a catalogue. Sweeps are those of our nsgs to TOLERANCE on a sample of a
family, evenly spread; one that ends at MOST sweeps, or after SECONDS, counts with the sweeps that
it took. --pictures draws each published distribution with ours, as shares of problems that have at
most so many.

--only measures these families again; the other rows stay as they are stored.

--report draws the figures 2 to 5 of RT-0444 from ours: contacts, degrees of freedom and their ratio
of Chain, Capsules, BoxesStack and KaplasTower.
"""

from __future__ import annotations

import argparse
import csv
import functools
import importlib
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

import fclib
from fclib import collections
from fclib.collections.figures import draw_distribution
from workshop.sets import collection_table
from workshop.tables import _results

# figures 2 to 5 of RT-0444, in their order
REPORT: Final = ("Chain", "Capsules", "BoxesStack", "KaplasTower")
# column of the published files: ours, and its word
MEASURES: Final = {
    "contacts": ("nc", "contacts"),
    "dof": ("n", "dof"),
    "nsgs_sweeps": ("", "sweeps"),
}
QUANTILES: Final = (0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0)
TOLERANCE: Final = 1e-8


def sets() -> list[dict[str, str]]:
    """The published sets: their figures, names of ours beside each, how its files' names begin."""
    with collection_table.PUBLISHED.open(newline="") as file:
        return list(csv.DictReader(file))


def published(path: Path) -> dict[str, dict[str, list[float]]]:
    """What is known of the files of each set, by measure. ValueError: a column is missing.

    Files of no set that is known here are those of a set named as the list names it.
    """
    begins = {row["files"]: row["set"] for row in sets() if row["files"]}
    found: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    with path.open(newline="", encoding="utf-8") as file:
        rows = csv.DictReader(file)
        missing = {"set", "file", *MEASURES} - set(rows.fieldnames or ())
        if missing:
            raise ValueError(f"{path}: has no column {min(missing)}")
        for row in rows:
            own = f"{row['set']}/{row['file']}"
            name = next((begins[begin] for begin in begins if own.startswith(begin)), row["set"])
            for measure in MEASURES:
                if row[measure]:
                    found[name][measure].append(float(row[measure]))
    return found


def sweeps_of(path: Path, most: int, seconds: float) -> int:
    """The sweeps of our nsgs on the problem of a file."""
    problem: Any = fclib.read(path)
    if problem.kind.startswith("global"):
        problem = problem.condense()
    found = fclib.solve(problem, "nsgs", tol=TOLERANCE, max_iterations=most, time_limit=seconds)
    return int(found.iterations)


def sample_of(rows: Sequence[Any], count: int) -> list[Any]:
    """So many rows at equal distances, the first and the last among them."""
    places = np.unique(np.rint(np.linspace(0, len(rows) - 1, min(count, len(rows)))).astype(int))
    return [rows[place] for place in places.tolist()]


def line(name: str, measure: str, values: Sequence[float]) -> dict[str, Any]:
    """A row of the table."""
    found = np.quantile(values, QUANTILES, method="nearest")
    quantiles = {heading(q): f"{value:g}" for q, value in zip(QUANTILES, found, strict=True)}
    return {"set": name, "of": MEASURES[measure][1], "problems": len(values), **quantiles}


def heading(quantile: float) -> str:
    """The column of a quantile."""
    return {0.0: "least", 0.5: "median", 1.0: "largest"}.get(quantile, f"{quantile:.0%}")


def draw(path: Path, title: str, drawn: Sequence[tuple[str, Sequence[float]]], label: str) -> None:
    """The shares of problems that have at most so many."""
    figures = importlib.import_module("matplotlib.figure")
    figure = figures.Figure(figsize=(4.5, 2.8), layout="constrained")
    axis = figure.subplots()
    for (name, values), color in zip(drawn, ("#b3541e", "#3b6ea5", "#5b8c3e"), strict=False):
        ordered = np.sort(values)
        axis.step(ordered, np.arange(1, len(ordered) + 1) / len(ordered), where="post",
                  label=f"{name} ({len(ordered)})", color=color)  # fmt: skip
    if label == "sweeps":
        axis.set_xscale("log")
    axis.set_xlabel(label)
    axis.set_ylabel("share of problems")
    axis.set_ylim(0, 1.02)
    axis.set_title(title, fontsize=9)
    axis.legend(frameon=False, fontsize=8)
    axis.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=160, metadata={"Software": None})


def families(folders: Sequence[Path]) -> dict[str, tuple[Path, list[dict[str, Any]]]]:
    """The rows of each SET/FAMILY, and the folder of its files."""
    found: dict[str, tuple[Path, list[dict[str, Any]]]] = {}
    for folder in folders:
        for row in collections.read_catalog(folder).to_pylist():
            name = f"{row['collection']}/{row['family']}"
            if found.setdefault(name, (folder, []))[0] == folder:
                found[name][1].append(row)
    return found


def report(ours: dict[str, Any], out: Path) -> None:
    """The figures of RT-0444."""
    out.mkdir(parents=True, exist_ok=True)
    for number, name in enumerate(REPORT, 2):
        if f"rt444/{name}" not in ours:
            raise SystemExit(f"rt444/{name}: is not built; fclib collection build rt444 makes it")
        target = out / f"figure-{number}"
        target.mkdir(exist_ok=True)
        draw_distribution(ours[f"rt444/{name}"][1], target, f"Figure {number}: {name}")
        print(f"{target}: {name}")


def beside(ours: dict[str, Any], sample: int, limit: int) -> list[dict[str, str]]:
    """The rows of the sets, each with ours under it; families without a set come last."""
    table, left = [], dict(ours)
    # some of ours stand under several sets

    @functools.cache
    def spectra(name: str) -> list[Any]:
        folder, rows = ours[name]
        return collection_table.spectra(folder, rows, sample, limit)

    def row(name: str, published: dict[str, str] | None = None) -> dict[str, str]:
        rows, figures = ours[name][1], spectra(name)
        verdict = collection_table.within(published, rows, figures) if published else ""
        return collection_table.line(name, rows, figures, verdict)

    for theirs in sets():
        head = {**theirs, "rank ratio": theirs["rank_ratio"], "within": ""}
        shown = {name: head[name] for name in collection_table.HEAD}
        table.append(shown | {"set": f"*{theirs['set']}*"})
        for name in theirs["ours"].split():
            if name in ours:
                left.pop(name, None)
                table.append(row(name, theirs))
    return table + [row(name) for name in sorted(left)]


def distributions(theirs: Any, ours: dict[str, Any], own: Any) -> list[dict[str, Any]]:
    """The quantiles of each set, and of ours under them; pictures, if they are asked for."""
    table: list[dict[str, Any]] = []
    swept: dict[str, list[float]] = {}
    known = {row["set"]: row["ours"].split() for row in sets()}
    for name in sorted(theirs):
        for measure, values in theirs[name].items():
            table.append(line(f"*{name}*", measure, values))
            column, label = MEASURES[measure]
            drawn = [("published", values)]
            for family in known.get(name, ()):
                if family not in ours:
                    continue
                folder, rows = ours[family]
                if not column and family not in swept:
                    swept[family] = [
                        sweeps_of(folder / (row["local_file"] or row["global_file"]), own.most,
                                  own.seconds)
                        for row in sample_of(rows, own.sample)
                    ]  # fmt: skip
                mine = [row[column] for row in rows] if column else swept[family]
                table.append(line(family, measure, mine))
                drawn.append((family, mine))
            if own.pictures and len(drawn) > 1:
                own.pictures.mkdir(parents=True, exist_ok=True)
                target = own.pictures / f"{name.replace('/', '-')}-{label}.png"
                draw(target, name, drawn, label)
    return table


def keyed(table: Sequence[dict[str, Any]]) -> dict[tuple[str, str, str], dict[str, Any]]:
    """The rows by the published set that they stand under, their own set, and their measure."""
    found, head = {}, ""
    for row in table:
        if row["set"].startswith("*"):
            head = row["set"]
        found[head, row["set"], row.get("of", "")] = row
    return found


def renewed(name: str, table: Sequence[dict[str, Any]], only: Sequence[str]) -> list[Any]:
    """The stored table NAME, with the rows of some families from another one. SystemExit."""
    path = _results.FOLDER / f"{name}.csv"
    if not path.is_file():
        raise SystemExit(f"{path}: is not stored; without --only all of it is measured")
    with path.open(newline="", encoding="utf-8") as file:
        stored = keyed(list(csv.DictReader(file)))
    fresh = {key: row for key, row in keyed(table).items() if key[1] in only}
    if unknown := fresh.keys() - stored.keys():
        raise SystemExit(f"{path}: has no row of {min(unknown)[1]}; measure all, without --only")
    return list((stored | fresh).values())


def show(table: Sequence[dict[str, Any]]) -> None:
    """Print a table."""
    print("| " + " | ".join(table[0]) + " |")
    print("|" + "---|" * len(table[0]))
    for row in table:
        print("| " + " | ".join(map(str, row.values())) + " |", flush=True)


def main() -> None:
    """Print the tables, or draw the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folders", type=Path, nargs="+", help="built collections")
    parser.add_argument("--files", type=Path, help="list of the published files")
    parser.add_argument("--sample", type=int, default=32, help="problems of a family")
    parser.add_argument("--limit", type=int, default=1900, help="rows of a W whose rank is found")
    parser.add_argument("--most", type=int, default=200_000, help="sweeps of a solve")
    parser.add_argument("--seconds", type=float, default=20.0, help="limit of a solve")
    parser.add_argument("--pictures", type=Path, help="folder for pictures of both")
    parser.add_argument("--report", type=Path, help="folder for the figures of RT-0444")
    parser.add_argument("--only", nargs="+", metavar="SET/FAMILY", help="measure these again")
    _results.add_option(parser)
    own = parser.parse_args()
    ours = families(own.folders)
    again = ""
    if own.only:
        if missing := set(own.only) - ours.keys():
            parser.error(f"{min(missing)}: is in none of the folders")
        if not own.results:
            parser.error("--only renews a stored table: name it (--results)")
        ours = {name: ours[name] for name in own.only}
        again = f" Measured last: {', '.join(own.only)}."
    if own.report:
        report(ours, own.report)
        return
    theirs = published(own.files) if own.files else {}
    table = beside(ours, own.sample, own.limit)
    if own.only:
        table = renewed(own.results, table, own.only)
    show(table)
    if own.results:
        _results.store(
            own.results,
            table,
            title="Published sets (in italics) and ours",
            note=f"Rank ratio and conditioning are of at most {own.sample} problems of a"
            f" family, evenly spread, of at most {own.limit} contact components.{again}",
        )
    if not own.files:
        return
    if not theirs:
        raise SystemExit(f"{own.files}: lists no file")
    spread = distributions(theirs, ours, own)
    if own.only:
        spread = renewed(f"{own.results}-distributions", spread, own.only)
    show(spread)
    if own.results:
        _results.store(
            f"{own.results}-distributions",
            spread,
            title="Distributions of the published files (in italics) and ours",
            note="Sizes of published files, and the sweeps that nsgs took on them, are those in"
            f" their names. Ours: nsgs to {_results.power(TOLERANCE)} on at most {own.sample}"
            f" problems of a family, at most {own.most} sweeps or {own.seconds:g} s each.{again}",
        )


if __name__ == "__main__":
    main()
