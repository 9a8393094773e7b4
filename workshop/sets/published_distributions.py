"""Contacts, degrees of freedom and sweeps of a built collection beside the published files.

    .venv/bin/python -m workshop.sets.published_distributions FOLDER... --files FILES.csv
        [--sample 40] [--most 200000] [--seconds 20] [--pictures OUT] [--results NAME]
    .venv/bin/python -m workshop.sets.published_distributions FOLDER... --report OUT

FILES.csv lists the files of the published library: set, file, nsgs_sweeps, dof, contacts, as their
names tell these; it is no part of this project. The table has the quantiles of each, and of ours
under it. Contacts and dof are those of all problems of a catalogue. Sweeps are those of our nsgs to
TOLERANCE on a sample of a family, evenly spread; one that ends at MOST sweeps, or after SECONDS,
counts with the sweeps that it took.

--pictures draws each published distribution with ours, as shares of problems that have at most so
many. --report draws the figures 2 to 5 of RT-0444 from ours: contacts, degrees of freedom and their
ratio of Chain, Capsules, BoxesStack and KaplasTower.
"""

from __future__ import annotations

import argparse
import csv
import importlib
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

import fclib
from fclib import collections
from fclib.collections.figures import draw_distribution
from workshop.tables import _results

# set of the published files: ours
BESIDE: Final = {
    "Local/siconos/Chain": "rt444/Chain",
    "Local/siconos/Capsules": "rt444/Capsules",
    "Local/siconos/BoxesStack": "rt444/BoxesStack",
    "Local/siconos/KaplasTower": "rt444/KaplasTower",
    "Local/siconos/Chute_1000": "rr9118/Chute1000",
    "Local/siconos/Chute_4000": "rr9118/Chute4000",
    "Local/LMGC90/100_PR_PerioBox": "rr9118/PeriodicBox",
    "Local/LMGC90/945_SP_Box_PL": "rr9118/SpheresBox",
    "Local/LMGC90/Aqueduct_PR": "rr9118/Aqueduct",
    "Local/LMGC90/Bridge_PR": "rr9118/Bridge",
    "Local/LMGC90/Cubes_H8": "rr9118/CubesH8",
    "Local/LMGC90/LowWall_FEM": "rr9118/LowWallFEM",
    "Global/LMGC90/cubes_H8": "rr9118/CubesH8x2",
    "Global/siconos/BoxStacks": "rt444/BoxesStack",
    "Global/siconos/Capsules": "rt444/Capsules",
    "Global/siconos/KaplasTower": "rt444/KaplasTower",
    "Global/siconos/Chute": "granular/Chute",
    "Global/siconos/PrimitiveSoup": "granular/PrimitiveSoup",
    "Global/siconos/Spheres": "granular/Spheres",
    "RollingGlobal/siconos/Chute": "rolling/RollingChute",
    "RollingGlobal/siconos/PrimitiveSoup": "rolling/RollingSoup",
    "RollingGlobal/siconos/SpheresPile": "rolling/RollingSpheres",
}
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


def published(path: Path) -> dict[str, dict[str, list[float]]]:
    """What is known of the files of each set, by measure. ValueError: a column is missing."""
    found: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    with path.open(newline="", encoding="utf-8") as file:
        rows = csv.DictReader(file)
        missing = {"set", *MEASURES} - set(rows.fieldnames or ())
        if missing:
            raise ValueError(f"{path}: has no column {min(missing)}")
        for row in rows:
            for name in MEASURES:
                if row[name]:
                    found[row["set"]][name].append(float(row[name]))
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


def draw(path: Path, title: str, both: Sequence[tuple[str, Sequence[float]]], label: str) -> None:
    """The shares of problems that have at most so many."""
    figures = importlib.import_module("matplotlib.figure")
    figure = figures.Figure(figsize=(4.5, 2.8), layout="constrained")
    axis = figure.subplots()
    for (name, values), color in zip(both, ("#b3541e", "#3b6ea5"), strict=True):
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


def main() -> None:
    """Print the table, or draw the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folders", type=Path, nargs="+", help="built collections")
    parser.add_argument("--files", type=Path, help="list of the published files")
    parser.add_argument("--sample", type=int, default=40, help="problems of a family, for sweeps")
    parser.add_argument("--most", type=int, default=200_000, help="sweeps of a solve")
    parser.add_argument("--seconds", type=float, default=20.0, help="limit of a solve")
    parser.add_argument("--pictures", type=Path, help="folder for pictures of both")
    parser.add_argument("--report", type=Path, help="folder for the figures of RT-0444")
    _results.add_option(parser)
    own = parser.parse_args()
    ours = families(own.folders)
    if own.report:
        report(ours, own.report)
        return
    if not own.files:
        parser.error("name the list of the published files (--files), or --report")
    table: list[dict[str, Any]] = []
    swept: dict[str, list[float]] = {}
    theirs = published(own.files)
    for name in sorted(theirs):
        beside = BESIDE.get(name, "")
        for measure, values in theirs[name].items():
            table.append(line(f"*{name}*", measure, values))
            if beside not in ours:
                continue
            folder, rows = ours[beside]
            column, label = MEASURES[measure]
            if column:
                mine = [row[column] for row in rows]
            else:
                if beside not in swept:
                    swept[beside] = [
                        sweeps_of(folder / (row["local_file"] or row["global_file"]), own.most,
                                  own.seconds)
                        for row in sample_of(rows, own.sample)
                    ]  # fmt: skip
                mine = swept[beside]
            table.append(line(beside, measure, mine))
            if own.pictures:
                own.pictures.mkdir(parents=True, exist_ok=True)
                target = own.pictures / f"{name.replace('/', '-')}-{label}.png"
                draw(target, name, [("published", values), (beside, mine)], label)
    if not table:
        raise SystemExit(f"{own.files}: lists no file")
    print("| " + " | ".join(table[0]) + " |")
    print("|" + "---|" * len(table[0]))
    for row in table:
        print("| " + " | ".join(map(str, row.values())) + " |")
    if own.results:
        _results.store(
            own.results,
            table,
            title="Distributions of the published files (in italics) and ours",
            note="Sizes of published files, and the sweeps that nsgs took on them, are those in"
            f" their names. Ours: nsgs to {_results.power(TOLERANCE)} on at most {own.sample}"
            f" problems of a family, at most {own.most} sweeps or {own.seconds:g} s each.",
        )


if __name__ == "__main__":
    main()
