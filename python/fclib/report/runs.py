"""The runs of stores, as the pages of the site need them; all sums are by `bench.profiles`."""

from __future__ import annotations

import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from fclib.bench import STATUSES as STATUSES
from fclib.bench import MeritKind, Store, profiles
from fclib.bench.profiles import METRICS, Costs, Instance
from fclib.bench.table import object_in
from fclib.report.error import ReportError
from fclib.report.view import rounded

DIGITS = 6  # of costs on the site
LEFT_OUT = 0.1  # share of instances that may be left out for solvers that have not run them
EXTREMES = 8  # problems on which a solver is best, and worst
REPORTS = 80  # points of a convergence curve
BANDED = 20_000  # costs up to which the curves of a headline have bands
TAUS = 160  # points of a headline's curve
CODES = "0123456789abcdefghijklmnopqrstuvwxyz"  # of statuses; "." where nothing was run
NOT_RUN = "."


@dataclass(frozen=True)
class Bench:
    """What was run at one tolerance: a row an instance, a column a solver."""

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
    ) -> None:
        """Read them.

        Args:
            stores: files of `fclib bench`.
            machine: only the runs of this node.
            campaign: only the runs of this campaign.
            merit: only the runs whose tolerance bounds this.

        Raises:
            StoreError: a file is no store.
            ProfileError: no run is left, or they are of several machines or merits.
        """
        self._folder = tempfile.TemporaryDirectory(prefix="fclib-report-")
        try:
            self.store = self._merged(stores)
            # from nothing; runs that start from a step before are in `along` alone
            self.rows = profiles.load(self.store, machine=machine, campaign=campaign, merit=merit)
            node, judged = self.rows[0]["node"], self.rows[0]["merit"]
            both = profiles.load(self.store, machine=node, merit=judged, start=None)
            self.along = profiles.along(self.store, both, campaign)
        except BaseException:
            self._folder.cleanup()
            raise
        self.rows = [row for row in self.rows if row["status"] != "unreadable"]
        if not self.rows:
            self._folder.cleanup()
            raise ReportError("no problem of these runs could be read")
        # the most run first, then by name
        counts = Counter(row["solver"] for row in self.rows)
        self.solvers = sorted(counts, key=lambda name: (-counts[name], name))
        self.tolerances = sorted({row["tol"] for row in self.rows}, reverse=True)
        self.families = sorted({row["family"] for row in self.rows})

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

    def at(self, tol: float) -> list[dict[str, Any]]:
        """The runs at a tolerance."""
        return [row for row in self.rows if row["tol"] == tol]

    def problems(self) -> dict[str, dict[str, Any]]:
        """What the stores know of each problem that was run, by its hash."""
        with Store(self.store, create=False) as store:
            paths = dict(store.db.execute("SELECT hash, path FROM problems"))
        found: dict[str, dict[str, Any]] = {}
        for row in self.rows:
            if row["hash"] not in found:
                keys = ("problem", "family", "formulation", "spacedim", "n", "p", "nc", "nnz")
                facts = {key: row[key] for key in keys}
                found[row["hash"]] = facts | {"title": row["title"], "path": paths[row["hash"]]}
        return found

    def overview(self) -> dict[str, Any]:
        """What was run, where, and by whom it was asked for."""
        with Store(self.store, create=False) as store:
            campaigns = [
                {"name": s.name, "planned": s.planned, "done": s.done, "ended": s.ended is not None}
                for s in store.status()
            ]
        first = self.rows[0]
        return {
            "runs": len(self.rows),
            "along": self.along,
            "solved": sum(bool(row["solved"]) for row in self.rows),
            "problems": len({row["hash"] for row in self.rows}),
            "node": first["node"],
            "cpu": first["cpu"],
            "campaigns": campaigns,
            "statuses": {
                name: {"count": count, "meaning": STATUSES.get(name, "")}
                for name, count in Counter(row["status"] for row in self.rows).most_common()
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
        return Bench(tol, found.instances, costs, self._statuses(rows, found.instances))

    def _statuses(
        self, rows: Sequence[Mapping[str, Any]], instances: Sequence[Instance]
    ) -> tuple[str, ...]:
        places = {(i.hash, i.limit): k for k, i in enumerate(instances)}
        code = dict(zip(STATUSES, CODES, strict=False))
        seen: dict[str, list[str]] = {name: [""] * len(instances) for name in self.solvers}
        for row in rows:
            seen[row["solver"]][places[row["hash"], row["time_limit"]]] += code[row["status"]]
        # of several repeats the most frequent
        return tuple(
            "".join(
                Counter(own).most_common(1)[0][0] if len(own) > 1 else own or NOT_RUN
                for own in seen[name]
            )
            for name in self.solvers
        )

    def fair(self, tol: float, metric: str = "cpu_s") -> Costs | None:
        """The costs of solvers that have run nearly the same instances; None where there are none.

        Solvers that have run the fewest are left out, until at most `LEFT_OUT` of the instances
        are left out for the others.
        """
        every = profiles.gather(self.at(tol), metric)
        counts = dict(zip(every.solvers, (~np.isnan(every.values)).sum(axis=0), strict=True))
        names = sorted((n for n in self.solvers if n in counts), key=lambda name: -counts[name])
        while names:
            found = every.shared(names)
            count = len(found.instances)
            if count and found.left_out <= LEFT_OUT * (found.left_out + count):
                return found
            names.pop()
        return None

    def headline(self, tol: float, places: Mapping[str, int]) -> dict[str, Any] | None:
        """Curves, tables and extremes at a tolerance.

        Args:
            tol: the tolerance.
            places: the number of each problem on the site, by its hash.
        """
        costs = self.fair(tol)
        if costs is None:
            return None
        quotients = profiles.ratios(costs.values)
        finite = quotients[np.isfinite(quotients)]
        end = min(1e4, 1.2 * float(finite.max(initial=2.0)))
        taus = np.geomspace(1.0, end, TAUS)
        groups: dict[str, list[int]] = defaultdict(list)
        for k, instance in enumerate(costs.instances):
            groups[instance.family].append(k)
        tables = {"": profiles.summary(costs)}
        tables |= {family: profiles.summary(costs.of(own)) for family, own in groups.items()}
        found: dict[str, Any] = {}
        if costs.values.size <= BANDED:
            ends = profiles.bands(costs, lambda own: profiles.performance_profile(own, taus))
            found["bands"] = rounded(list(ends), 4)
        return found | {
            "instances": len(costs.instances),
            "limits": sorted({rounded(instance.limit) for instance in costs.instances}),
            "left_out": costs.left_out,
            "solvers": list(costs.solvers),
            "taus": rounded(taus, DIGITS),
            "curves": rounded(profiles.performance_profile(costs.values, taus), DIGITS),
            "tables": rounded(tables, DIGITS),
            "extremes": _extremes(costs, places),
        }

    # ---- one problem

    def by_problem(self) -> Iterator[tuple[str, list[dict[str, Any]]]]:
        """The runs of each problem, its hash first, with their convergence where it was stored."""
        groups: dict[str, list[dict[str, Any]]] = defaultdict(list)
        for row in self.rows:
            groups[row["hash"]].append(row)
        with Store(self.store, create=False) as store:
            reported = {run for (run,) in store.db.execute("SELECT DISTINCT run FROM history")}
            for digest, rows in groups.items():
                yield digest, [self._run(row, store, reported) for row in rows]

    def _run(self, row: Mapping[str, Any], store: Store, reported: set[int]) -> dict[str, Any]:
        keys = ("solver", "tol", "status", "message", "iterations", "error")
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
    """A certificate for a page: what a solver found are doubles, and they keep all their digits."""
    numbers = {
        name: {key: float(Fraction(value)) for key, value in record[name].items()} for name in "yz"
    }
    return {**numbers, "gain": record["gain"], "bound": record["bound"]}


def _thinned(
    history: Sequence[tuple[int, float, float, str]], cpu_s: float | None
) -> list[list[float]]:
    """Iteration, error and time of some reports, evenly on a logarithmic axis, the last too.

    The time [s] is of CPU, as that of the tables: of the wall clock in proportion.
    """
    count = len(history)
    last = history[-1][2]
    scale = cpu_s / last if cpu_s is not None and last > 0 else 1.0
    chosen = list(range(count))
    if count > REPORTS:
        spread = np.geomspace(1, count, REPORTS).round().astype(int) - 1
        chosen = sorted({*spread.tolist(), count - 1})
    return [[history[k][0], history[k][1], scale * history[k][2]] for k in chosen]


def _extremes(costs: Costs, places: Mapping[str, int]) -> dict[str, Any]:
    """For each solver the problems that it is best and worst on, beside the best of the others."""
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
            # problem, own cost, that of the best of the others, which that is
            other = names[rival[i]] if names and np.isfinite(best[i]) else None
            return [places[costs.instances[i].hash], own[i], best[i], other]

        known = np.flatnonzero(~np.isnan(ratio))
        order = known[np.argsort(ratio[known], kind="stable")]
        won = [i for i in order if ratio[i] <= 1][:EXTREMES]
        # failures first, those that were the easiest for another before
        lost = sorted((i for i in order if ratio[i] > 1), key=lambda i: (-ratio[i], best[i]))
        found[name] = rounded(
            {
                "best": [entry(i) for i in won],
                "worst": [entry(i) for i in lost[:EXTREMES]],
            },
            DIGITS,
        )
    return found
