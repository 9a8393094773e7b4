"""The runs of stores, as the pages of the site need them; all sums are by `bench.profiles`."""

from __future__ import annotations

import functools
import math
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from fclib._verdicts import UNSUITABLE
from fclib.bench import STATUSES as STATUSES
from fclib.bench import MeritKind, Store, profiles
from fclib.bench.comparison import (
    METRICS,
    Costs,
    Instance,
    compared,
    count_by_status,
    numbers_in,
    runs_of,
    solved_in,
    words_in,
)
from fclib.bench.table import Table, object_in
from fclib.report.error import ReportError
from fclib.report.view import rounded

DIGITS = 6  # significant digits of costs on the site
WEIGH: profiles.Weigh = "families"  # so that a large family decides no figure of a site
EXTREMES = 8  # number of problems shown as a solver's best, and worst
REPORTS = 80  # points of a convergence curve
BANDED = 20_000  # with more costs the curves of a headline have no bands
TAUS = 160  # points of a headline's curve
CODES = "0123456789abcdefghijklmnopqrstuvwxyz"  # of statuses; "." if nothing was run
NOT_RUN = "."


@dataclass(frozen=True)
class Bench:
    """The runs at one tolerance: a row for each instance, a column for each solver."""

    tol: float
    instances: tuple[Instance, ...]
    costs: Mapping[str, list[list[float | None]]]  # metric -> solver -> instance; None: failed
    statuses: tuple[str, ...]  # for each solver a code for each instance


class Campaigns:
    """The runs of one or several stores on one machine; ``with Campaigns(paths) as campaigns``."""

    def __init__(
        self,
        stores: Sequence[str | Path],
        machine: str | None = None,
        campaign: str | None = None,
        merit: MeritKind | None = None,
        note: str = "",
    ) -> None:
        """Read them.

        Args:
            stores: files of `fclib bench`.
            machine: only the runs of this node.
            campaign: only the runs of this campaign.
            merit: only the runs whose tolerance bounds this merit.
            note: on published runs among them, for the captions.

        Raises:
            StoreError: a file is not a store.
            ProfileError: no run is left, or they are of several machines or merits.
        """
        self.note = note
        self._folder = tempfile.TemporaryDirectory(prefix="fclib-report-")
        try:
            self.store = self._merged(stores)
            # cold runs; runs that start from a step before are only in `along`
            self.rows = profiles.load(
                self.store, machine=machine, campaign=campaign, merit=merit, more=("message",)
            )
            first = self.rows.row(0)
            node, judged = first["node"], first["merit"]
            both = profiles.load(self.store, machine=node, merit=judged, start=None)
            self.along = profiles.along(self.store, both, campaign)
        except BaseException:
            self._folder.cleanup()
            raise
        self.rows = self.rows.where(~words_in(self.rows, "status").is_in(["unreadable"]))
        if not len(self.rows):
            self._folder.cleanup()
            raise ReportError("no problem of these runs could be read")
        # the compared costs of all figures and tables, as in fclib profile
        self.every = profiles.gather(self.rows)
        self.costs = compared(self.every)
        # the most run first, then by name
        counts = Counter(words_in(self.rows, "solver").tolist())
        self.solvers = sorted(map(str, counts), key=lambda name: (-counts[name], name))
        self.tolerances = sorted({*numbers_in(self.rows, "tol").tolist()}, reverse=True)
        self.families = [str(name) for name in words_in(self.rows, "family").present()]

    def _merged(self, stores: Sequence[str | Path]) -> Path:
        if len(stores) == 1:
            return Path(stores[0])
        path = Path(self._folder.name) / "merged.sqlite"
        with Store(path) as merged:
            merged.merge(stores)
        return path

    def __enter__(self) -> Campaigns:
        return self

    def __exit__(self, *_: object) -> None:
        self._folder.cleanup()

    def at(self, tol: float) -> Table:
        """The runs at a tolerance."""
        return self.rows.where(numbers_in(self.rows, "tol") == tol)

    def problems(self) -> dict[str, dict[str, Any]]:
        """The facts in the stores on each problem run, by its hash; its main form first."""
        _, first = self.rows.numbers("hash")
        names = ("hash", "problem", "family", "formulation", "spacedim", "n", "p", "nc", "nnz")
        found = {}
        for row in self.rows.where(first):
            facts = {key: row[key] for key in (*names[1:], "title", "path")}
            found[row["hash"]] = facts | {"same_as": row.get("same_as")}
        return dict(sorted(found.items(), key=lambda item: bool(item[1]["same_as"])))

    def overview(self) -> dict[str, Any]:
        """The campaigns, the machine and the versions of the runs."""
        with Store(self.store, create=False) as store:
            campaigns = [
                {"name": s.name, "planned": s.planned, "done": s.done, "ended": s.ended is not None}
                for s in store.status()
            ]
        first = self.rows.row(0)
        solved, count = int(solved_in(self.rows).sum()), len(self.rows)
        statuses = count_by_status(self.rows)
        return {
            "runs": count,
            "along": self.along,
            "solved": solved,
            "share": solved / count,
            "problems": len({instance.hash for instance in self.every.instances}),
            "node": first["node"],
            "cpu": first["cpu"],
            "campaigns": campaigns,
            "statuses": {
                name: {"count": n, "share": n / count, "meaning": STATUSES.get(name, "")}
                for name, n in statuses.most_common()
            },
        }

    # ---- one tolerance

    def bench(self, tol: float) -> Bench:
        """All costs at a tolerance."""
        rows = self.at(tol)
        costs: dict[str, list[list[float | None]]] = {}
        for metric in METRICS:
            found = profiles.gather(rows, metric)
            columns = dict(zip(found.solvers, found.values.T, strict=True))
            none = np.full(len(found.instances), np.nan)
            costs[metric] = rounded([columns.get(name, none) for name in self.solvers], DIGITS)
        return Bench(tol, found.instances, costs, self._statuses(rows, found))

    def _statuses(self, rows: Table, found: Costs) -> tuple[str, ...]:
        """The most frequent status of the repeats in each cell; "unsuitable" if it is not taken."""
        code = dict(zip(STATUSES, CODES, strict=False))
        cells = np.full(found.values.shape, NOT_RUN, dtype="<U1")
        own = found.own()
        runs = runs_of(rows, own)
        place, column = found.cells_of(runs)
        words = words_in(runs, "status")
        seen = (place * len(found.solvers) + column) * len(words.values) + words.codes
        pairs, count = np.unique(seen, return_counts=True)
        # the most frequent status comes last, and stays
        for pair in pairs[np.argsort(count, kind="stable")].tolist():
            cell, status = divmod(pair, len(words.values))
            cells.flat[cell] = code[words.values[status]]
        assert found.unsuitable is not None
        cells[found.unsuitable] = code[UNSUITABLE]
        columns = dict(zip(found.solvers, cells.T, strict=True))
        none = np.full(len(found.instances), NOT_RUN)
        return tuple("".join(columns.get(name, none)) for name in self.solvers)

    def caption(self, costs: Costs, runs: Table) -> str:
        """What a figure of some runs shows."""
        words = profiles.caption(costs, runs, WEIGH)
        return f"{words}; {self.note}" if self.note else words

    def headline(self, tol: float, places: Mapping[str, int]) -> dict[str, Any] | None:
        """Curves, tables and extremes at a tolerance.

        Args:
            tol: the tolerance.
            places: the number of each problem on the site, by its hash.
        """
        costs = self.costs.at(tol)
        if not costs.instances:
            return None
        quotients = profiles.ratios(costs.values)
        finite = quotients[np.isfinite(quotients)]
        end = min(1e4, 1.2 * float(finite.max(initial=2.0)))
        taus = np.geomspace(1.0, end, TAUS)
        groups: dict[str, list[int]] = defaultdict(list)
        for k, instance in enumerate(costs.instances):
            groups[instance.family].append(k)
        tables = {"": profiles.summary(costs, weigh=WEIGH)}
        tables |= {
            family: profiles.summary(costs.on_instances(own), weigh=WEIGH)
            for family, own in groups.items()
        }
        found: dict[str, Any] = {}
        if costs.values.size <= BANDED:
            found["bands"] = rounded(list(profiles.bands(costs, quotients, taus, WEIGH)), 4)
        curves = profiles.share_within(quotients, taus, costs.weights(WEIGH))
        return found | {
            "instances": len(costs.instances),
            "caption": self.caption(costs, self.at(tol)),
            "not_compared": profiles.left_out(self.every.at(tol), costs),
            "solvers": list(costs.solvers),
            "legend": [costs.legend(k) for k in range(len(costs.solvers))],
            "order": np.argsort(-curves.mean(axis=1), kind="stable").tolist(),
            "taus": rounded(taus, DIGITS),
            "curves": rounded(curves, DIGITS),
            "tables": rounded(tables, DIGITS),
            "extremes": _extremes(costs, places),
        }

    # ---- one problem

    @functools.cached_property
    def least_errors(self) -> dict[str, tuple[float, str]]:
        """Of each problem the least error of a run at the smallest tolerance, and its solver."""
        found: dict[str, tuple[float, str]] = {}
        for row in self.at(self.tolerances[-1]):
            error = row["error"]
            if error is not None and error < found.get(row["hash"], (math.inf, ""))[0]:
                found[row["hash"]] = (error, row["solver"])
        return found

    def by_problem(self) -> Iterator[tuple[str, list[dict[str, Any]]]]:
        """The runs of each problem, its hash first, with their convergence if it was stored."""
        groups: dict[str, list[dict[str, Any]]] = defaultdict(list)
        for row in self.rows:
            groups[row["hash"]].append(row)
        with Store(self.store, create=False) as store:
            reported = {run for (run,) in store.db.execute("SELECT DISTINCT run FROM history")}
            for digest, rows in groups.items():
                yield digest, [self._run(row, store, reported) for row in rows]

    def _run(self, row: Mapping[str, Any], store: Store, reported: set[int]) -> dict[str, Any]:
        keys = ("solver", "tol", "repeat", "status", "message", "iterations", "error")
        found = {key: row[key] for key in (*keys, "cpu_s", "wall_s", "memory_mb", "time_limit")}
        found["form"] = row["formulation"]
        if row["run"] in reported:
            found["history"] = _thinned(store.history(row["run"]), row["cpu_s"])
        found = dict(rounded(found, DIGITS))
        stored = object_in(store.certificate(row["run"]))
        if {"y", "z", "gain", "bound"} <= stored.keys():
            found["certificate"] = _proof(stored)
        return found


def _proof(record: Mapping[str, Any]) -> dict[str, Any]:
    """A certificate for a page: a solver's result is in doubles, and these keep all digits."""
    numbers = {
        name: {key: float(Fraction(value)) for key, value in record[name].items()} for name in "yz"
    }
    return {**numbers, "gain": record["gain"], "bound": record["bound"]}


def _thinned(
    history: Sequence[tuple[int, float, float, str]], cpu_s: float | None
) -> list[list[float]]:
    """Iteration, least error so far and time of some reports, evenly on a logarithmic axis.

    The last report is included. The time [s] is CPU time, as in the tables.
    """
    times, errors = profiles.least_errors(history, cpu_s)
    count = len(history)
    chosen = list(range(count))
    if count > REPORTS:
        spread = np.geomspace(1, count, REPORTS).round().astype(int) - 1
        chosen = sorted({*spread.tolist(), count - 1})
    return [[history[k][0], float(errors[k]), float(times[k])] for k in chosen]


def _extremes(costs: Costs, places: Mapping[str, int]) -> dict[str, Any]:
    """For each solver: its best and worst problems, with the best of the other solvers."""
    found = {}
    count = len(costs.solvers)
    for k, name in enumerate(costs.solvers):
        own = costs.values[:, k]
        if count > 1:
            others = costs.values[:, [j for j in range(count) if j != k]]
            others = np.where(np.isnan(others), np.inf, others)
            rival, best = others.argmin(axis=1), others.min(axis=1)
        else:
            rival, best = np.zeros(len(own), int), np.full(len(own), np.inf)
        with np.errstate(invalid="ignore"):
            ratio = np.where(np.isinf(own), np.where(np.isinf(best), np.nan, np.inf), own / best)
        names = [other for other in costs.solvers if other != name]

        def entry(
            i: int, own: Any = own, best: Any = best, rival: Any = rival, names: Any = names
        ) -> list[Any]:
            # problem, own cost, cost of the best other solver, name of that solver
            other = names[rival[i]] if names and np.isfinite(best[i]) else None
            return [places[costs.instances[i].hash], own[i], best[i], other]

        known = np.flatnonzero(~np.isnan(ratio))
        order = known[np.argsort(ratio[known], kind="stable")]
        won = [i for i in order if ratio[i] <= 1][:EXTREMES]
        # failures first, and among them those that were easiest for another solver
        lost = sorted((i for i in order if ratio[i] > 1), key=lambda i: (-ratio[i], best[i]))
        found[name] = rounded(
            {"best": [entry(i) for i in won], "worst": [entry(i) for i in lost[:EXTREMES]]}, DIGITS
        )
    return found
