"""The tables and pictures of a store, which ``fclib profile`` and ``fclib demo`` print."""

from __future__ import annotations

import csv
import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fclib.bench import MeritKind, profiles
from fclib.bench.campaign import published_means
from fclib.bench.store import Store
from fclib.bench.table import Table
from fclib.cli._output import Report, Rows, err, out

TAUS = (1.0, 1.5, 2.0, 5.0, 10.0, 100.0)


def print_profile(
    store: Path,
    folder: Path | None,
    *,
    metric: str = "cpu_s",
    solver: Sequence[str] = (),
    family: Sequence[str] = (),
    tol: Sequence[float] = (),
    campaign: str | None = None,
    machine: str | None = None,
    merit: MeritKind | None = None,
    start: profiles.Start = "cold",
    penalty: float = profiles.PENALTY,
    shift: float = profiles.SHIFT,
    count_unsuitable: bool = False,
    formats: Sequence[str] = ("pdf", "svg", "png"),
    as_json: bool = False,
    quiet: bool = False,
) -> None:
    """Print the tables of a store, and draw its pictures where a folder is given."""
    chosen: dict[str, Any] = {
        "families": family,
        "solvers": solver,
        "tolerances": tol,
        "machine": machine,
        "merit": merit,
    }
    rows = profiles.load(store, campaign=campaign, start=start, **chosen)
    costs = profiles.costs(rows, metric, count_unsuitable)
    published = published_means(store) if start == "cold" else {}
    both = Table({})
    with Store(store, create=False) as opened:
        if opened.has_sequences():
            same = {"machine": rows["node"][0], "merit": rows["merit"][0]}
            both = profiles.load(store, start=None, **chosen | same)
        faults = [
            fault for fault in opened.faults() if not campaign or fault["campaign"] == campaign
        ]
    tables: dict[str, list[dict[str, Any]]] = {
        "summary": profiles.summary(costs, penalty, shift),
        "profile": shares_within(costs),
        "statuses": profiles.failures(rows),
        "families": profiles.families(costs, published),
        "pairs": [dataclasses.asdict(pair) for pair in profiles.pairs(costs)],
        "shifts": profiles.shifts(costs, penalty, shift) if metric in profiles.TIMES else [],
        "accuracies": [
            entry for each in costs.tolerances for entry in profiles.accuracies(rows, each)
        ],
        "work-precision": profiles.work_precision(rows, metric, penalty, shift, count_unsuitable),
        "along": profiles.along(store, both, campaign),
        "not run": profiles.failures(faults),
    }
    if not quiet and as_json:
        report = Report(True)
        for table, records in tables.items():
            for record in records:
                report.add({"table": table, **record})
    elif not quiet:
        show(tables, costs, rows, penalty, shift)
    if folder is not None:
        draw(tables, costs, rows, store, folder, formats)
        err.print(f"Pictures and tables: {folder}", highlight=False)


def show(
    tables: dict[str, list[dict[str, Any]]],
    costs: profiles.Costs,
    rows: Table,
    penalty: float,
    shift: float,
) -> None:
    """The tables, for people."""
    words = profiles.METRICS[costs.metric][0]
    judged = profiles.JUDGED[rows["merit"][0]]
    out.print(
        f"{words}: {profiles.caption(costs, rows)}; shifted geometric means, shift {shift:g},"
        f" failures as {penalty:g} x the limit; {judged}",
        highlight=False,
    )
    if costs.left_out:
        out.print(f"{costs.left_out} left out, which not all solvers have run", highlight=False)
    busy = profiles.loaded(rows)
    marked, unsteady = [], False
    for row in tables["summary"]:
        wide = row["spread"] is not None and row["spread"] > profiles.SPREAD
        unsteady = unsteady or wide
        of = f"{row['mean']:.3g}"
        marks = (profiles.MARK if wide else "") + (
            profiles.LOADED if busy.get(row["solver"]) else ""
        )
        marked.append(row | {"mean": f"{of} {marks}".rstrip()})
    if all(row["spread"] is None for row in marked):
        marked = [{name: row[name] for name in row if name != "spread"} for row in marked]
    if not any(row["unsuitable"] for row in marked):
        marked = [{name: row[name] for name in row if name != "unsuitable"} for row in marked]
    titles = {
        "summary": None,
        "profile": "Performance profile: solved within a multiple of the best",
        "statuses": "How the runs ended",
        "not run": "Not run, for causes outside of the solvers",
        "along": "Along sequences: from a solution of a step before (warm), or from nothing (cold)",
        "shifts": "Means over that of the best, by the shift of the mean",
        "families": "The fastest solver of each problem, by family",
    }
    for name, title in titles.items():
        shown_rows = marked if name == "summary" else tables[name]
        if shown_rows:
            out.print()
            out.print(Rows(shown_rows, title))
        if name == "summary" and unsteady:
            out.print(
                f"{profiles.MARK}: repeats differ by more than {100 * profiles.SPREAD:.0f} %"
                " in the median",
                highlight=False,
            )
        if name == "summary" and busy:
            out.print(
                f"{profiles.LOADED}: {sum(busy.values())} of {len(rows)} runs were begun while the"
                " load was above the number of cores: their times may be longer than on a quiet"
                " machine",
                highlight=False,
            )
    best = tables["summary"][1]["solver"]
    shown = [pair for pair in profiles.pairs(costs, against=best) if pair.both]
    if shown:
        out.print()
        records = [
            {
                "solver": pair.first,
                "ratio": pair.ratio,
                "95 % interval": f"{pair.low:.3g} to {pair.high:.3g}",
                "both solve": pair.both,
                "only it": pair.only_first,
                f"only {best}": pair.only_second,
            }
            for pair in shown
        ]
        out.print(Rows(records, f"Geometric means of ratios to {best}, where both solve"))


def draw(
    tables: dict[str, list[dict[str, Any]]],
    costs: profiles.Costs,
    rows: Table,
    store: Path,
    folder: Path,
    formats: Sequence[str],
) -> None:
    """Pictures and CSV files into a folder."""
    from fclib.bench import plots

    folder.mkdir(parents=True, exist_ok=True)
    for table, records in tables.items():
        if table != "profile":
            write_csv(folder / f"{table.replace(' ', '-')}.csv", records)
    several = len(costs.tolerances) > 1
    for tol in costs.tolerances:
        part, own = costs.at(tol), rows.where(rows["tol"] == tol)
        words, ending = profiles.caption(part, own), f"-{tol:g}" if several else ""
        name = f"{costs.metric}{ending}"
        steps = curve_rows(part, profiles.ratios(part.values), "tau")
        write_csv(folder / f"performance-{name}.csv", steps)
        write_csv(folder / f"data-{name}.csv", curve_rows(part, part.values, costs.metric))
        plots.performance(part, folder, formats, words, ending)
        for per_contact in (False, True):
            plots.data(part, folder, formats, per_contact=per_contact, caption=words, ending=ending)
        longest = float(np.nan_to_num(own["cpu_s"]).max(initial=0.0))
        times = np.geomspace(1e-5, max(longest, 1e-4), 300)
        if curves := profiles.convergence(store, own, times):
            plots.convergence(curves, times, folder, formats, words, ending)
            reached = profiles.runtimes(store, own, tol)
            plots.runtimes(reached, folder, formats, words, ending)
    if several:
        words = profiles.caption(costs, rows)
        plots.work_precision(tables["work-precision"], costs.metric, folder, formats, words)


def write_csv(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """A table, whole or not at all."""
    if not rows:
        return
    part = path.with_name(f".{path.name}.part")
    with part.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    part.replace(path)


def curve_rows(costs: profiles.Costs, values: profiles.Array, name: str) -> list[dict[str, Any]]:
    """The steps of curves as a table: the bound, then a column a solver."""
    finite = np.unique(values[np.isfinite(values)])
    shares = profiles.share_within(values, finite)
    return [
        {name: float(bound), **dict(zip(costs.solvers, shares[:, k].tolist(), strict=True))}
        for k, bound in enumerate(finite)
    ]


def shares_within(costs: profiles.Costs) -> list[dict[str, Any]]:
    """The performance profile at a few ratios, in percent."""
    shares = profiles.performance_profile(costs.values, np.array([*TAUS, np.finfo(float).max]))
    names = [f"<= {tau:g}x" for tau in TAUS] + ["solved"]
    rows = [
        {"solver": solver, **{n: f"{100 * s:.0f} %" for n, s in zip(names, own, strict=True)}}
        for solver, own in zip(costs.solvers, shares.tolist(), strict=True)
    ]
    means = dict(zip(costs.solvers, shares.mean(axis=1), strict=True))
    return sorted(rows, key=lambda row: -means[row["solver"]])
