"""The tables and pictures of a store, which ``fclib profile`` and ``fclib demo`` print."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from fclib._files import write_csv
from fclib.bench import MeritKind, comparison, profiles
from fclib.bench.campaign import published_means
from fclib.bench.store import Store
from fclib.bench.table import Table
from fclib.cli._output import Report, Rows, err, out

PUBLISHED = "published"  # a word of --with
TAUS = (1.0, 1.5, 2.0, 5.0, 10.0, 100.0)
# columns of the summary that are shown only if one of them has a value
RARE = ("unsuitable", "spread", "copies")


With = Annotated[
    list[str] | None,
    typer.Option(
        "--with", help='Published runs beside these: "published", or files of `fclib results`.'
    ),
]
AsMeasured = Annotated[
    bool,
    typer.Option("--as-measured", help="Leave the times of --with as they are on their machine."),
]


@contextmanager
def joined(
    store: Path | None,
    beside: Sequence[str],
    machine: str | None,
    as_measured: bool,
    sets: Sequence[str] = (),
) -> Iterator[tuple[Path, str]]:
    """The store with published runs beside its own, and a note on them.

    Without a store: the published runs alone, all or those of some sets.
    """
    from fclib import results

    parts = parts_of(beside)
    digests: set[str] | None = None
    if sets and store is None:
        parts, digests = results.of_sets(parts, sets)
    scaled = "" if not as_measured else ", as they were measured on their machine"
    with (
        results.beside(store, parts, machine, scale=not as_measured)
        if store is not None
        else results.alone(parts, digests)
    ) as found_beside:
        yield found_beside.path, f"{found_beside}{scaled}"


def merit_of(store: Path, merit: MeritKind | None) -> MeritKind | None:
    """The merit by which published runs are compared: both maps, if some bound one alone."""
    if merit is not None:
        return merit
    with Store(store, create=False) as opened:
        there = {row["merit"] for row in opened.table()}
    return "both" if len(there) > 1 else None


def ready_for(beside: Sequence[str]) -> None:
    """Whether runs that are made here now can be put beside published ones: asked before them.

    Raises:
        ShardError: a part is missing or damaged.
        BesideError: this machine was not calibrated.
    """
    from fclib import results
    from fclib.bench import machine
    from fclib.bench.calibration import calibration_in
    from fclib.results.beside import REMEDY
    from fclib.results.shards import look

    parts = [look(path) for path in parts_of(beside)]
    here = machine.facts()
    others = {name for part in parts for name in part.machines}
    if others != {here.get("node")} and calibration_in(here) is None:
        raise results.BesideError(f"this machine was not calibrated: {REMEDY}")


def parts_of(beside: Sequence[str]) -> list[Path]:
    """The files that --with names. ShardError if no runs are published here."""
    from fclib import results

    parts: list[Path] = []
    for name in beside:
        if name != PUBLISHED:
            parts.append(Path(name))
            continue
        where = results.folder()
        found = sorted(where.glob("*.parquet")) if where is not None else []
        if not found:
            raise results.ShardError("no runs are published here: pip install fclib-results")
        parts += found
    return parts


def print_profile(
    store: Path,
    folder: Path | None,
    *,
    note: str = "",
    metric: str = "cpu_s",
    solvers: Sequence[str] = (),
    sets: Sequence[str] = (),
    families: Sequence[str] = (),
    tolerances: Sequence[float] = (),
    campaign: str | None = None,
    machine: str | None = None,
    merit: MeritKind | None = None,
    start: profiles.Start = "cold",
    penalty: float = profiles.PENALTY,
    shift: float = profiles.SHIFT,
    count_unsuitable: bool = False,
    own_set: bool = False,
    both_forms: bool = False,
    weigh: profiles.Weigh = "families",
    formats: Sequence[str] = ("pdf", "svg", "png"),
    as_json: bool = False,
    quiet: bool = False,
) -> None:
    """Print the tables of a store, and draw its pictures if a folder is given."""
    chosen: dict[str, Any] = {
        "sets": sets,
        "families": families,
        "solvers": solvers,
        "tolerances": tolerances,
        "machine": machine,
        "merit": merit,
    }
    rows = profiles.load(store, campaign=campaign, start=start, **chosen)
    every = profiles.gather(rows, metric, count_unsuitable, both_forms)
    costs = comparison.compared(every, solvers or None, own_set)
    compared = comparison.runs_of(rows, costs)
    published = published_means(store) if start == "cold" else {}
    both: Table | None = None
    with Store(store, create=False) as opened:
        warm = opened.has_sequences()
        faults = [
            fault for fault in opened.faults() if not campaign or fault["campaign"] == campaign
        ]
    if warm:
        same = {"machine": rows.row(0)["node"], "merit": rows.row(0)["merit"]}
        both = profiles.load(store, start=None, **chosen | same)
    tables: dict[str, list[dict[str, Any]]] = {
        "summary": profiles.summary(costs, penalty, shift, weigh),
        "left out": profiles.left_out(every, costs),
        "profile": shares_within(costs, weigh),
        "statuses": profiles.failures(rows),
        "families": profiles.families(costs, published),
        "pairs": [dataclasses.asdict(pair) for pair in profiles.pairs(costs, weigh=weigh)],
        "shifts": (
            profiles.shifts(costs, penalty, shift, weigh) if metric in profiles.TIMES else []
        ),
        "accuracies": profiles.accuracies(compared, costs, weigh),
        "work-precision": profiles.work_precision(compared, costs, penalty, shift, weigh),
        "along": [] if both is None else profiles.along(store, both, campaign),
        "not run": profiles.failures(faults),
    }
    notes = Notes(rows, compared, penalty, shift, weigh, own_set, note)
    if not quiet and as_json:
        report = Report(True)
        for table, records in tables.items():
            for record in records:
                report.add({"table": table, **record})
    elif not quiet:
        show(tables, costs, notes)
    if folder is not None:
        draw(tables, costs, store, folder, formats, notes)
        err.print(f"Pictures and tables: {folder}", highlight=False)


@dataclasses.dataclass(frozen=True)
class Notes:
    """The notes of tables and pictures on their runs."""

    rows: Table  # all runs asked for
    compared: Table  # the runs that count
    penalty: float
    shift: float
    weigh: profiles.Weigh
    own_set: bool
    note: str  # on published runs

    def caption(self, costs: profiles.Costs) -> str:
        """Make them from costs at one tolerance or at several."""
        tols = comparison.numbers_in(self.rows, "tol")
        own = self.rows.where(np.isin(tols, costs.tolerances))
        words = profiles.caption(costs, own, self.weigh, self.own_set)
        return f"{words}; {self.note}" if self.note else words


def show(tables: dict[str, list[dict[str, Any]]], costs: profiles.Costs, notes: Notes) -> None:
    """The tables for readers, grouped by tolerance."""
    words = profiles.METRICS[costs.metric][0]
    judged = profiles.JUDGED[notes.rows.row(0)["merit"]]
    busy = profiles.loaded(notes.rows)
    titles = {
        "profile": "Performance profile: the share solved within a multiple of the best",
        "shifts": "Means over that of the best, by the shift of the mean",
        "families": "The fastest solver of each problem, by family",
    }
    for tol in costs.tolerances:
        part = costs.at(tol)
        here = f"Tolerance {tol:g}"
        out.print(
            f"{here}. {words}: {notes.caption(part)}; shifted geometric means, shift"
            f" {notes.shift:g}, failures as {notes.penalty:g} x the limit; {judged}",
            highlight=False,
        )
        out.print()
        own = [row for row in tables["summary"] if row["tol"] == tol]
        out.print(Rows(shown_summary(own, busy), here))
        if any(is_unsteady(row) for row in own):
            out.print(
                f"{profiles.MARK}: repeats differ by more than {100 * profiles.SPREAD:.0f} %"
                " in the median",
                highlight=False,
            )
        if busy:
            out.print(
                f"{profiles.LOADED}: {sum(busy.values())} of {len(notes.rows)} runs were begun"
                " while the load was above the number of cores: their times may be longer than on"
                " a quiet machine",
                highlight=False,
            )
        for name, title in titles.items():
            if found := at(tables[name], tol):
                out.print()
                out.print(Rows(found, f"{title}; {here.lower()}"))
        show_pairs(tables["pairs"], own[1]["solver"], tol)
        out.print()
    show_left_out(tables["left out"], costs)
    titles = {
        "statuses": "How all the runs ended",
        "along": "Along sequences: from a solution of a step before (warm), or from nothing (cold)",
        "not run": "Not run, for causes outside of the solvers",
    }
    for name, title in titles.items():
        if tables[name]:
            out.print(Rows(tables[name], title))
            out.print()


def at(rows: Sequence[dict[str, Any]], tol: float) -> list[dict[str, Any]]:
    """The rows at a tolerance, without it."""
    return [
        {name: value for name, value in row.items() if name != "tol"}
        for row in rows
        if row["tol"] == tol
    ]


def is_unsteady(row: dict[str, Any]) -> bool:
    """Whether the repeats of a solver differ by much."""
    return row["spread"] is not None and row["spread"] > profiles.SPREAD


def shown_summary(rows: Sequence[dict[str, Any]], busy: dict[str, int]) -> list[dict[str, Any]]:
    """The summary at one tolerance, with marks; columns without values are left out."""
    silent = {name for name in RARE if not any(row[name] for row in rows)}
    found = []
    for row in rows:
        marks = (profiles.MARK if is_unsteady(row) else "") + (
            profiles.LOADED if busy.get(row["solver"]) else ""
        )
        own = row | {
            "share": f"{100 * row['share']:.1f} %",
            "mean": f"{row['mean']:.3g} {marks}".rstrip(),
        }
        found.append({name: own[name] for name in own if name not in silent and name != "tol"})
    return found


def show_pairs(pairs: Sequence[dict[str, Any]], best: str, tol: float) -> None:
    """Each solver beside the best one, at a tolerance."""
    records = []
    for pair in pairs:
        if pair["tol"] != tol or best not in (pair["first"], pair["second"]) or not pair["both"]:
            continue
        turned = pair["first"] == best
        other = pair["second" if turned else "first"]
        ratio, low, high = pair["ratio"], pair["low"], pair["high"]
        ratio, low, high = (1 / ratio, 1 / high, 1 / low) if turned else (ratio, low, high)
        only, theirs = pair["only_first"], pair["only_second"]
        only, theirs = (theirs, only) if turned else (only, theirs)
        records.append(
            {
                "solver": other,
                "ratio": ratio,
                "95 % interval": f"{low:.3g} to {high:.3g}",
                "both solve": pair["both"],
                "only it": only,
                f"only {best}": theirs,
            }
        )
    if records:
        out.print()
        title = f"Geometric means of ratios to {best}, of what both solve; tolerance {tol:g}"
        out.print(Rows(records, title))


def show_left_out(rows: Sequence[dict[str, Any]], costs: profiles.Costs) -> None:
    """The solvers that are not compared, and how to compare them."""
    if not rows:
        return
    title = (
        f"Not compared: the common set would lose more than {100 * comparison.COMMON:.0f} % of"
        " the instances"
    )
    out.print(Rows(rows, title))
    names = [*costs.solvers, *dict.fromkeys(row["solver"] for row in rows)]
    words = " ".join(f'--solver "{name}"' if " " in name else f"--solver {name}" for name in names)
    out.print(f"All on their common set: {words}; each on its own set: --own-set", highlight=False)
    out.print()


def draw(
    tables: dict[str, list[dict[str, Any]]],
    costs: profiles.Costs,
    store: Path,
    folder: Path,
    formats: Sequence[str],
    notes: Notes,
) -> None:
    """Pictures and CSV files into a folder."""
    from fclib.bench import plots

    folder.mkdir(parents=True, exist_ok=True)
    for table, records in tables.items():
        if table != "profile":
            write_rows(folder / f"{table.replace(' ', '-')}.csv", records)
    several = len(costs.tolerances) > 1
    tols = comparison.numbers_in(notes.compared, "tol")
    for tol in costs.tolerances:
        part, own = costs.at(tol), notes.compared.where(tols == tol)
        words, ending = notes.caption(part), f"-{tol:g}" if several else ""
        name = f"{costs.metric}{ending}"
        steps = curve_rows(part, profiles.ratios(part.values), "tau", notes.weigh)
        write_rows(folder / f"performance-{name}.csv", steps)
        steps = curve_rows(part, part.values, costs.metric, notes.weigh)
        write_rows(folder / f"data-{name}.csv", steps)
        plots.performance(part, folder, formats, words, ending, weigh=notes.weigh)
        for per_contact in (False, True):
            plots.data(
                part,
                folder,
                formats,
                per_contact=per_contact,
                caption=words,
                ending=ending,
                weigh=notes.weigh,
            )
        longest = float(np.nanmax(comparison.numbers_in(own, "cpu_s"), initial=0.0))
        times = np.geomspace(1e-5, max(longest, 1e-4), 300)
        legend = dict(zip(part.solvers, map(part.legend, range(len(part.solvers))), strict=True))
        if curves := profiles.convergence(store, own, times):
            plots.convergence(curves, times, folder, formats, words, ending, legend)
            reached = profiles.runtimes(store, own, tol)
            plots.runtimes(reached, folder, formats, words, ending, legend)
    if several:
        words = notes.caption(costs)
        plots.work_precision(tables["work-precision"], costs.metric, folder, formats, words)


def write_rows(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write a table, if it has rows."""
    if rows:
        write_csv(path, list(rows[0]), (row.values() for row in rows))


def curve_rows(
    costs: profiles.Costs, values: comparison.Array, name: str, weigh: profiles.Weigh
) -> list[dict[str, Any]]:
    """The steps of curves as a table: the bound, then a column for each solver."""
    finite = np.unique(values[np.isfinite(values)])
    shares = profiles.share_within(values, finite, costs.weights(weigh))
    return [
        {name: float(bound), **dict(zip(costs.solvers, shares[:, k].tolist(), strict=True))}
        for k, bound in enumerate(finite)
    ]


def shares_within(costs: profiles.Costs, weigh: profiles.Weigh) -> list[dict[str, Any]]:
    """The performance profile at a few ratios, in percent, at each tolerance."""
    found = []
    names = [f"<= {tau:g}x" for tau in TAUS] + ["solved"]
    for tol in costs.tolerances:
        part = costs.at(tol)
        taus = np.array([*TAUS, np.finfo(float).max])
        shares = profiles.performance_profile(part.values, taus, part.weights(weigh))
        rows = [
            {
                "tol": tol,
                "solver": solver,
                **{n: f"{100 * s:.0f} %" for n, s in zip(names, own, strict=True)},
            }
            for solver, own in zip(part.solvers, shares.tolist(), strict=True)
        ]
        means = dict(zip(part.solvers, shares.mean(axis=1), strict=True))
        found += sorted(rows, key=lambda row, means=means: -means[row["solver"]])  # type: ignore[misc]
    return found
