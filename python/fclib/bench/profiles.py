"""What the runs of a store say: profiles, means, ratios. Knows rows and numbers, no problem.

An instance is a problem at a tolerance, under one limit. The cost of a solver on an instance is
infinite where it failed, and the least of its repeats, where at least half of them solved it; their
spread is kept. Where the solver does not take such problems there is no cost, and the instance does
not count for it. What was not run for a cause from outside is not there. Runs that
started from nothing (cold) and from the solution of a step before (warm) are never in one profile;
`along` puts them beside each other. Sources:

- performance profiles: Dolan & More, "Benchmarking optimization software with performance
  profiles" (2002): rho_s(tau) is the share of instances that s solves within tau times the cost of
  the best solver on each.
- data profiles: More & Wild, "Benchmarking derivative-free optimization algorithms" (2009): the
  share of instances solved within a cost, here by contact if wanted.
- shifted geometric means, exp(mean(log(t + s))) - s: Mittelmann's benchmarks; failures are charged
  a multiple of the limit.
- runtimes to fixed targets: Hansen et al., "COCO: a platform for comparing continuous optimizers"
  (2021): the share of pairs of an instance and an error that were reached within a time, from the
  histories of all runs, also of those that failed.
- success at an accuracy: qpbenchmark (Caron et al.): the error that was reached decides, whatever
  the solver said.
- intervals: the bootstrap draws problems, with all that was run on each (Efron & Tibshirani 1993).
"""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib import _core
from fclib._solve import MeritKind
from fclib.bench.job import ORDERLY, SURROUNDINGS
from fclib.bench.store import Store
from fclib.bench.table import Table, Words, object_in

Array: TypeAlias = npt.NDArray[np.float64]
Start: TypeAlias = Literal["cold", "warm"]
# of an instance: the problem's hash, tolerance, sequence and step
Key: TypeAlias = tuple[str, float, str, int]
INSTANCE = ("hash", "tol", "sequence", "step")
# what a run may cost, and the least that is told from nothing
METRICS: Mapping[str, tuple[str, float]] = {
    "cpu_s": ("CPU time [s]", 1e-6),
    "total_cpu_s": ("CPU time of the whole run [s]", 1e-6),
    "wall_s": ("wall clock [s]", 1e-6),
    "iterations": ("iterations", 1.0),
    "memory_mb": ("memory [MB]", 1.0),
}
TIMES = ("cpu_s", "total_cpu_s", "wall_s")
PENALTY = 10.0  # times the limit, for a failure in a mean
SHIFT = 1e-3  # [s]
RESAMPLES = 2000
BANDS = 400  # the same for the bands of curves
LAST = 3  # drift is that of the last third of a sequence
SPREAD = 0.2  # of repeats, relative to the least, from which on a figure is marked
MARK, LOADED = "~", "^"  # of such a figure, and of one with runs under load
ACCURACIES = (1e-2, 1e-4, 1e-6, 1e-8)
VIRTUAL_BEST = "virtual best"


class ProfileError(_core.Error, ValueError):
    """There is nothing to be compared."""


@dataclass(frozen=True)
class Instance:
    """A problem at a tolerance."""

    hash: str
    problem: str
    family: str
    nc: int
    tol: float
    limit: float  # [s] of CPU
    wall_limit: float = math.inf  # [s]


@dataclass(frozen=True)
class Costs:
    """The cost of each solver on each instance that all of them have run."""

    instances: tuple[Instance, ...]
    solvers: tuple[str, ...]
    values: Array  # (instances, solvers), inf where it failed, nan where it has none
    metric: str
    left_out: int = 0  # instances that some solver has not run
    spread: Array | None = None  # of the repeats, relative to the least; nan where there is one
    unsuitable: npt.NDArray[np.bool_] | None = None  # where the solver does not take such problems

    @property
    def solved(self) -> npt.NDArray[np.bool_]:
        """(instances, solvers)."""
        return np.isfinite(self.values)

    @property
    def best(self) -> Array:
        """(instances) of the virtual best solver; inf where none solves it."""
        return least(self.values)

    @property
    def charges(self) -> Array:
        """(instances) what a failure is charged before the penalty.

        For a time it is the limit of the run; for another metric the largest cost of a solver that
        solves the instance, or any instance where none does.
        """
        if self.metric == "wall_s":
            limits = [(one.wall_limit, one.limit) for one in self.instances]
            return np.array([wall if math.isfinite(wall) else cpu for wall, cpu in limits])
        if self.metric in TIMES:
            return np.array([instance.limit for instance in self.instances])
        finite = np.where(self.solved, self.values, -np.inf)
        overall = float(finite.max(initial=1.0))
        largest = finite.max(axis=1, initial=-np.inf)
        return np.asarray(np.where(self.solved.any(axis=1), largest, overall))

    def per_contact(self) -> Costs:
        """The costs over the number of contacts; instances without any are left out."""
        contacts = np.array([instance.nc for instance in self.instances])
        there = contacts > 0
        part = self.of(np.flatnonzero(there))
        return replace(part, values=part.values / contacts[there, None])

    def shared(self, solvers: Sequence[str] | None = None) -> Costs:
        """Of some solvers, all by default, on the instances that all of these have run."""
        names = self.solvers if solvers is None else tuple(solvers)
        columns = [self.solvers.index(name) for name in names]
        part = replace(
            self,
            solvers=names,
            values=self.values[:, columns],
            spread=None if self.spread is None else self.spread[:, columns],
            unsuitable=None if self.unsuitable is None else self.unsuitable[:, columns],
        )
        has = ~np.isnan(part.values)
        ran = has if part.unsuitable is None else has | part.unsuitable
        kept = np.flatnonzero(ran.all(axis=1) & has.any(axis=1))
        return replace(part.of(kept), left_out=int(has.any(axis=1).sum()) - kept.size)

    def of(self, chosen: Iterable[int]) -> Costs:
        """Some of the instances."""
        numbers = list(chosen)
        return replace(
            self,
            instances=tuple(self.instances[k] for k in numbers),
            values=self.values[numbers],
            spread=None if self.spread is None else self.spread[numbers],
            unsuitable=None if self.unsuitable is None else self.unsuitable[numbers],
        )

    def at(self, tol: float) -> Costs:
        """Those at a tolerance."""
        return self.of(k for k, one in enumerate(self.instances) if one.tol == tol)

    @property
    def tolerances(self) -> list[float]:
        """The largest first."""
        return sorted({instance.tol for instance in self.instances}, reverse=True)


def load(
    store: str | Path,
    *,
    campaign: str | None = None,
    families: Sequence[str] = (),
    solvers: Sequence[str] = (),
    tolerances: Sequence[float] = (),
    machine: str | None = None,
    merit: MeritKind | None = None,
    start: Start | None = "cold",
) -> Table:
    """The rows of a store that a profile is of.

    Args:
        store: the file.
        campaign: only its runs.
        families: only their problems.
        solvers: only these, by their labels, in this order.
        tolerances: only these.
        machine: its node's name.
        merit: only runs whose tolerance bounds this.
        start: only runs that started from nothing, or, "warm", the steps of sequences but the first
            ones, which had no step before them; None for both, which no profile takes.

    Raises:
        StoreError: the file is no store.
        ProfileError: no run is left, or they are of several machines or merits.
    """
    with Store(store, create=False) as opened:
        rows = opened.table(more=("message",))
    if not len(rows):
        raise ProfileError(f"{store}: there are no runs")
    rows = rows.where((rows["start"] == "cold") | (rows["step"] > 0))
    rows = rows.with_columns(node=_named_machines(rows))
    wanted: list[tuple[str, Sequence[Any]]] = [
        ("campaign", [campaign] if campaign else ()),
        ("family", families),
        ("solver", solvers),
        ("tol", tolerances),
        ("node", [machine] if machine else ()),
        ("merit", [merit] if merit else ()),
        ("start", [start] if start else ()),
    ]
    for column, values in wanted:
        if values:
            own = rows[column]
            kept = own.is_in(values) if isinstance(own, Words) else np.isin(own, values)
            if not kept.any():
                there = own.present() if isinstance(own, Words) else np.unique(own).tolist()
                raise ProfileError(
                    f"{store}: no run with {column} {', '.join(map(str, values))};"
                    f" there is: {', '.join(sorted(map(str, there)))}"
                )
            rows = rows.where(kept)
    nodes = [node or "?" for node in rows["node"].present()]
    if len(nodes) > 1:
        raise ProfileError(
            f"{store}: times of several machines do not compare; choose one: {', '.join(nodes)}"
        )
    if len(rows["merit"].present()) > 1:
        raise ProfileError(
            f"{store}: the tolerance of some runs bounds both natural maps, of others that of the"
            " literature alone, which does not compare; choose one by merit: both, natural"
        )
    rows = one_limit(rows)
    # by the labels of the store, in the order that was asked for
    order = {name: k for k, name in enumerate(solvers)}
    rank = np.array([order.get(name, len(order)) for name in rows["solver"].values])
    rows = rows.where(np.argsort(rank[rows["solver"].codes], kind="stable"))
    return rows.with_columns(solver=_named_solvers(rows))


def _named_machines(rows: Table) -> Words:
    """The nodes of rows; machines of one name have different ones if their processors differ."""
    numbers, first = rows.numbers("node", "cpu", "cores")
    kinds = [rows.row(k) for k in first]
    count = Counter(kind["node"] for kind in kinds)
    names = Words.of(
        f"{kind['node']} ({kind['cores']} x {kind['cpu']})"
        if count[kind["node"]] > 1
        else kind["node"]
        for kind in kinds
    )
    return names[numbers]


def _named_solvers(rows: Table) -> Words:
    """The labels of rows; solvers of one label have different ones if they ran differently."""

    def of(row: Mapping[str, Any]) -> dict[str, str]:
        options = object_in(row["options"])
        return {
            "version": row["version"] or "?",
            "options": " ".join(f"{k}={v}" for k, v in options.items()) or "no options",
            "threads": f"{row['threads']} threads",
            "memory": f"{row['memory_limit']:g} MB" if row["memory_limit"] else "",
        }

    numbers, first = rows.numbers("solver", "options", "version", "threads", "memory_limit")
    kinds = [rows.row(k) for k in first]
    ways: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for row in kinds:
        for name, value in of(row).items():
            ways[row["solver"]][name].add(value)

    def named(row: Mapping[str, Any]) -> str:
        own = ways[row["solver"]]
        differing = [value for name, value in of(row).items() if len(own[name]) > 1]
        return f"{row['solver']} ({', '.join(differing)})" if differing else str(row["solver"])

    return Words.of(map(named, kinds))[numbers]


def table_of(rows: Iterable[Mapping[str, Any]]) -> Table:
    """Runs in columns, which they may be already."""
    if isinstance(rows, Table):
        return rows
    known = list(rows)
    names = dict.fromkeys(name for row in known for name in (*row, *INSTANCE, "wall_limit"))
    return Table.of([{name: row.get(name) for name in names} for row in known])


def one_limit(rows: Table) -> Table:
    """Of each problem at a tolerance the runs under one limit: that of the most solvers.

    Of several such the largest: where a limit was raised, the runs before do not count.
    """
    limits = rows.with_columns(
        time_limit=np.nan_to_num(rows["time_limit"]), wall_limit=np.nan_to_num(rows["wall_limit"])
    )
    instance, _ = rows.numbers(*INSTANCE)
    group, first = limits.with_columns(instance=instance).numbers(
        "instance", "time_limit", "wall_limit"
    )
    if len(first) == instance.max(initial=-1) + 1:
        return rows  # one limit everywhere
    pairs = limits.with_columns(group=group).numbers("group", "solver")[1]
    solvers = np.bincount(group[pairs], minlength=len(first))
    own = limits.where(first)
    # the best group of each instance comes last
    order = np.lexsort((own["wall_limit"], own["time_limit"], solvers, instance[first]))
    chosen = np.zeros(len(first), dtype=bool)
    last = np.append(np.diff(instance[first][order]) > 0, True)
    chosen[order[last]] = True
    return rows.where(chosen[group])


def instance_of(row: Mapping[str, Any]) -> Key:
    """What rows of one instance share; at rest, several steps of a sequence are one problem."""
    return row["hash"], row["tol"], row.get("sequence") or "", row.get("step") or 0


JUDGED = {
    "both": "the tolerance bounds both natural maps",
    "natural": "the tolerance bounds the natural map of the literature alone",
}


def costs(
    rows: Sequence[Mapping[str, Any]], metric: str = "cpu_s", count_unsuitable: bool = False
) -> Costs:
    """The costs of the solvers of some rows, on what all of them have run or do not take.

    Args:
        rows: as `load` gives them.
        metric: one of `METRICS`.
        count_unsuitable: whether a problem that a solver does not take is a failure of it.

    Raises:
        ProfileError: the metric is unknown, or no instance was run by all solvers.
    """
    found = gather(rows, metric, count_unsuitable).shared()
    if not found.instances:
        raise ProfileError("there is no problem that all of these solvers have run")
    return found


def gather(
    rows: Iterable[Mapping[str, Any]], metric: str = "cpu_s", count_unsuitable: bool = False
) -> Costs:
    """As `costs`, of all instances that one of the solvers has run; nan where another has not.

    Raises:
        ProfileError: the metric is unknown.
    """
    if metric not in METRICS:
        raise ProfileError(f"there is no metric {metric}; there is: {', '.join(METRICS)}")
    floor = METRICS[metric][1]
    instances: dict[Key, Instance] = {}
    numbers: dict[Key, int] = {}
    solvers: dict[str, int] = {}
    lines, columns, spent, refused = [], [], [], []
    for row in one_limit(table_of(rows)):
        column = solvers.setdefault(row["solver"], len(solvers))
        if row["status"] in SURROUNDINGS:
            continue
        key = instance_of(row)
        if key not in instances:
            numbers[key] = len(instances)
            instances[key] = Instance(
                hash=row["hash"],
                problem=row["problem"],
                family=row["family"],
                nc=row["nc"],
                tol=row["tol"],
                limit=row["time_limit"],
                wall_limit=row.get("wall_limit") or math.inf,
            )
        if row["status"] == "unsuitable" and not count_unsuitable:
            refused.append((numbers[key], column))
            continue
        value = row[metric]
        lines.append(numbers[key])
        columns.append(column)
        good = row["solved"] and value is not None
        spent.append(max(float(value), floor) if good else math.inf)
    shape = len(instances), len(solvers)
    found, spread = np.full(shape, np.nan), np.full(shape, np.nan)
    unsuitable = np.zeros(shape, dtype=bool)
    if spent:
        # the repeats of a run beside each other, the quickest first
        values, cells = np.array(spent), np.array(lines) * len(solvers) + np.array(columns)
        order = np.lexsort((values, cells))
        cells, first, count = np.unique(cells[order], return_index=True, return_counts=True)
        solved = np.add.reduceat(np.isfinite(values[order]), first)
        quickest = values[order[first]]
        found.flat[cells] = np.where(2 * solved >= count, quickest, np.inf)
        slowest = values[order[first + np.maximum(solved, 1) - 1]]
        with np.errstate(invalid="ignore"):
            own = np.where((solved > 1) & np.isfinite(quickest), slowest / quickest - 1, np.nan)
        spread.flat[cells] = own
    for place in refused:
        unsuitable[place] = bool(np.isnan(found[place]))
    ordered = sorted(
        instances, key=lambda k: (instances[k].family, instances[k].problem, -k[1], k[2:])
    )
    rank = [numbers[key] for key in ordered]
    return Costs(
        tuple(instances[key] for key in ordered),
        tuple(solvers),
        found[rank],
        metric,
        spread=spread[rank],
        unsuitable=unsuitable[rank],
    )


# ---- profiles


def least(values: Array) -> Array:
    """(instances) the least cost of each; inf where no solver has one."""
    return np.asarray(np.where(np.isnan(values), np.inf, values).min(axis=1, initial=np.inf))


def ratios(values: Array) -> Array:
    """r_ps = t_ps / min_s t_ps (instances, solvers); inf where s fails, nan where it has none."""
    best = least(values)[:, None]
    with np.errstate(invalid="ignore"):
        found = np.where(np.isfinite(values), values / best, np.inf)
    return np.asarray(np.where(np.isnan(values), np.nan, found))


def share_within(values: Array, bounds: Array) -> Array:
    """The share of instances whose value is at most each bound (solvers, bounds).

    Of a solver those instances count for which it has a value.
    """
    count = np.maximum(1, (~np.isnan(values)).sum(axis=0))[:, None]
    found = [np.searchsorted(np.sort(column), bounds, side="right") for column in values.T]
    return np.asarray(np.array(found).reshape(values.shape[1], len(bounds)) / count)


def performance_profile(values: Array, taus: Array) -> Array:
    """rho_s(tau) (solvers, taus) of costs (instances, solvers), by Dolan & More (2002)."""
    return share_within(ratios(values), taus)


def bands(costs: Costs, curve: Any, seed: int = 0) -> tuple[Array, Array]:
    """The ends of 95 % intervals of curves (solvers, bounds), by drawing problems `BANDS` times.

    Args:
        costs: what the curves are of.
        curve: makes them of values (instances, solvers).
        seed: of the bootstrap.
    """
    own = _by_problem([instance.hash for instance in costs.instances])
    random = np.random.Generator(np.random.PCG64([seed, len(own)]))
    drawn = []
    for _ in range(BANDS):
        chosen = np.concatenate([own[k] for k in random.integers(0, len(own), len(own))])
        drawn.append(curve(costs.values[chosen]))
    low, high = np.quantile(np.array(drawn), [0.025, 0.975], axis=0)
    return np.asarray(low), np.asarray(high)


def _by_problem(hashes: Sequence[str]) -> list[npt.NDArray[np.int64]]:
    """The places of each problem."""
    found: dict[str, list[int]] = defaultdict(list)
    for k, digest in enumerate(hashes):
        found[digest].append(k)
    return [np.array(own) for own in found.values()]


# ---- means


def shifted_geometric_mean(
    values: Array, charges: Array, penalty: float = PENALTY, shift: float = SHIFT
) -> Array:
    """(solvers) of costs (instances, solvers); a failure counts as penalty times its charge.

    Of a solver those instances count for which it has a cost; nan where there is none.
    """
    whole = np.where(np.isinf(values), penalty * charges[:, None], values)
    there = ~np.isnan(values)
    logs = np.where(there, np.log1p(np.where(there, whole, 0.0) / shift), 0.0).sum(axis=0)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.expm1(logs / there.sum(axis=0)) * shift)


@dataclass(frozen=True)
class Pair:
    """Two solvers on the instances that both solve."""

    first: str
    second: str
    both: int
    only_first: int
    only_second: int
    ratio: float  # geometric mean of t_first / t_second, nan where there is none
    low: float  # 95 % interval of it, by bootstrap over the problems
    high: float


def pairs(costs: Costs, against: str | None = None, seed: int = 0) -> list[Pair]:
    """Each two of the solvers, or each of the others and one.

    Args:
        costs: of all.
        against: the one, as the second of each pair.
        seed: of the bootstrap, which draws the problems `RESAMPLES` times.
    """
    names = costs.solvers
    chosen = [
        (a, b)
        for a in range(len(names))
        for b in range(len(names))
        if (a < b if against is None else names[a] != against == names[b])
    ]
    found = []
    for a, b in chosen:
        good_a, good_b = costs.solved[:, a], costs.solved[:, b]
        both = good_a & good_b
        logs = np.log(costs.values[both, a] / costs.values[both, b])
        ratio = low = high = math.nan
        if logs.size:
            random = np.random.Generator(np.random.PCG64([seed, a, b]))
            own = _by_problem([costs.instances[k].hash for k in np.flatnonzero(both)])
            sums = np.array([logs[part].sum() for part in own])
            sizes = np.array([len(part) for part in own])
            drawn = random.integers(0, len(own), (RESAMPLES, len(own)))
            ratio = float(np.exp(logs.mean()))
            means = sums[drawn].sum(axis=1) / sizes[drawn].sum(axis=1)
            low, high = np.exp(np.quantile(means, [0.025, 0.975])).tolist()
        failed_a, failed_b = np.isinf(costs.values[:, a]), np.isinf(costs.values[:, b])
        only_a, only_b = int((good_a & failed_b).sum()), int((good_b & failed_a).sum())
        found.append(Pair(names[a], names[b], int(both.sum()), only_a, only_b, ratio, low, high))
    return found


# ---- tables


def summary(costs: Costs, penalty: float = PENALTY, shift: float = SHIFT) -> list[dict[str, Any]]:
    """A row a solver, the virtual best first, then by what they solve and their means."""
    best = costs.best
    values = np.column_stack([best, costs.values])
    means = shifted_geometric_mean(values, costs.charges, penalty, shift)
    quotients = ratios(values)
    rows: list[dict[str, Any]] = []
    for k, name in enumerate((VIRTUAL_BEST, *costs.solvers)):
        there = ~np.isnan(values[:, k])
        solved = np.isfinite(values[:, k])
        own = quotients[solved, k]
        # of the best on the same instances
        (least_mean,) = shifted_geometric_mean(
            best[there, None], costs.charges[there], penalty, shift
        )
        rows.append(
            {
                "solver": name,
                "solved": int(solved.sum()),
                "of": int(there.sum()),
                "unsuitable": _count(costs.unsuitable, k - 1),
                "fastest": int((own == 1).sum()) if k else int(solved.sum()),
                "mean": float(means[k]),
                "to best": float(means[k] / least_mean) if least_mean > 0 else math.nan,
                "median ratio": float(np.median(own)) if own.size else None,
                "worst ratio": float(own.max()) if own.size else None,
                "spread": _median(costs.spread, k - 1),
            }
        )
    return [rows[0], *sorted(rows[1:], key=lambda row: (-row["solved"], row["mean"]))]


def _count(marks: npt.NDArray[np.bool_] | None, k: int) -> int:
    return 0 if marks is None or k < 0 else int(marks[:, k].sum())


def _median(spread: Array | None, k: int) -> float | None:
    """The median spread of the repeats of a solver, where there are any."""
    if spread is None or k < 0:
        return None
    own = spread[np.isfinite(spread[:, k]), k]
    return float(np.median(own)) if own.size else None


def shifts(costs: Costs, penalty: float = PENALTY, shift: float = SHIFT) -> list[dict[str, Any]]:
    """A row a solver: its mean over that of the virtual best, for other shifts too."""
    tables = {
        f"shift {s:g}": {row["solver"]: row["to best"] for row in summary(costs, penalty, s)}
        for s in (shift / 10, shift, 10 * shift)
    }
    order = [row["solver"] for row in summary(costs, penalty, shift)[1:]]
    return [
        {"solver": name, **{title: own[name] for title, own in tables.items()}} for name in order
    ]


def accuracies(rows: Sequence[Mapping[str, Any]], tol: float) -> list[dict[str, Any]]:
    """A row a solver: the share of its runs at a tolerance that reached an error, within limits.

    The recomputed error decides, whatever the solver said.
    """
    found = []
    for solver in dict.fromkeys(row["solver"] for row in rows):
        own = [
            row
            for row in rows
            if row["solver"] == solver and row["tol"] == tol and row["status"] != "unsuitable"
        ]
        if not own:
            continue
        entry: dict[str, Any] = {"solver": solver, "tol": tol, "runs": len(own)}
        for bound in ACCURACIES:
            reached = [
                row["error"] is not None
                and row["error"] <= bound
                and row["status"] in (*ORDERLY, "inaccurate")
                and (row["cpu_s"] or 0.0) <= row["time_limit"]
                for row in own
            ]
            entry[f"error <= {bound:g}"] = sum(reached) / len(own)
        found.append(entry)
    return found


def failures(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """A row a solver: how many of its runs ended in which status."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for row in rows:
        counts[row["solver"]][row["status"]] += 1
    statuses = [name for name, _ in Counter(row["status"] for row in rows).most_common()]
    return [
        {"solver": solver, **{status: own[status] for status in statuses}}
        for solver, own in counts.items()
    ]


def families(
    costs: Costs, published: Mapping[tuple[str, float], float] = MappingProxyType({})
) -> list[dict[str, Any]]:
    """A row a family and tolerance: the fastest solver of each problem, as in a paper's table.

    Args:
        costs: of all families.
        published: the paper's means, by family and tolerance.
    """
    groups: dict[tuple[str, float, float], list[int]] = defaultdict(list)
    for k, instance in enumerate(costs.instances):
        groups[instance.family, instance.tol, instance.limit].append(k)
    rows = []
    for (family, tol, limit), numbers in sorted(groups.items()):
        part = costs.of(numbers)
        best = part.best[np.isfinite(part.best)]
        quickest = np.where(np.isnan(part.values), np.inf, part.values).argmin(axis=1)
        wins = Counter(part.solvers[k] for k in quickest[np.isfinite(part.best)])
        contacts = [instance.nc for instance in part.instances]
        rows.append(
            {
                "family": family,
                "problems": len(numbers),
                "contacts": f"{min(contacts)}-{max(contacts)}",
                "tol": tol,
                "limit": limit,
                "mean of fastest": float(best.mean()) if best.size else None,
                **({"published": published.get((family, tol))} if published else {}),
                "std": float(best.std()) if best.size else None,
                "unsolved": len(numbers) - best.size,
                "most often fastest": wins.most_common(1)[0][0] if wins else "-",
            }
        )
    return rows


def work_precision(
    rows: Sequence[Mapping[str, Any]],
    metric: str = "cpu_s",
    penalty: float = PENALTY,
    shift: float = SHIFT,
    count_unsuitable: bool = False,
) -> list[dict[str, Any]]:
    """A row a solver and tolerance: what the accuracy costs, over problems that all have run.

    `error` is the geometric mean of the recomputed errors of the runs that were solved.
    """
    found = []
    for tol in sorted({row["tol"] for row in rows}, reverse=True):
        own = [row for row in rows if row["tol"] == tol]
        try:
            part = costs(own, metric, count_unsuitable)
        except ProfileError:
            continue
        means = shifted_geometric_mean(part.values, part.charges, penalty, shift)
        for k, solver in enumerate(part.solvers):
            errors = [
                max(row["error"], 1e-17) for row in own if row["solver"] == solver and row["solved"]
            ]
            found.append(
                {
                    "solver": solver,
                    "tol": tol,
                    "mean": float(means[k]),
                    "error": float(np.exp(np.log(errors).mean())) if errors else None,
                    "solved": int(part.solved[:, k].sum()),
                    "of": int((~np.isnan(part.values[:, k])).sum()),
                }
            )
    return found


# ---- along sequences


def along(
    store: str | Path, rows: Sequence[Mapping[str, Any]], campaign: str | None = None
) -> list[dict[str, Any]]:
    """A row a sequence, tolerance and solver: its warm runs against its cold ones.

    The steps count that were run in both ways, with the same settings. What failed counts with what
    it took. `drift` is the largest difference of the two velocities u at the contacts, over the
    largest velocity, in the last third of the steps that both solved; as problems are given, an
    error of one step reaches the next one by the guess alone.

    Args:
        store: the file that the rows are of.
        rows: as `load` gives them with start=None.
        campaign: only its warm runs; the cold ones beside them may be of an earlier campaign.
    """

    def same(row: Mapping[str, Any]) -> tuple[Any, ...]:
        names = ("hash", "solver", "tol", "merit", "repeat", "time_limit", "wall_limit")
        return tuple(row[name] for name in names)

    cold = {same(row): row for row in rows if row["start"] == "cold"}
    chains: dict[tuple[str, float, str], list[tuple[Any, Any]]] = defaultdict(list)
    for row in sorted(rows, key=lambda row: (row["step"] or 0, row["repeat"])):
        if row["start"] != "warm" or (campaign and row["campaign"] != campaign):
            continue
        if same(row) in cold:
            chains[row["sequence"], -row["tol"], row["solver"]].append((row, cold[same(row)]))
    if not chains:
        return []
    found = []
    with Store(store, create=False) as opened:
        for (sequence, tol, solver), pairs in sorted(chains.items()):
            spent = np.array([[_spent(row) for row in pair] for pair in pairs]).sum(axis=0)
            counts = np.array([[row["iterations"] or 0 for row in pair] for pair in pairs])
            solved = np.array([[row["solved"] for row in pair] for pair in pairs])
            apart = [
                gap
                for one, other in pairs
                if (gap := _apart(opened.solution(one["run"]), opened.solution(other["run"])))
                is not None
            ]
            last = apart[-max(1, len(apart) // LAST) :]
            found.append(
                {
                    "sequence": sequence,
                    "tol": -tol,
                    "solver": solver,
                    "cold CPU / warm CPU": float(spent[1] / max(spent[0], 1e-9)),
                    "iterations warm": int(counts[:, 0].sum()),
                    "iterations cold": int(counts[:, 1].sum()),
                    "solved warm": int(solved[:, 0].sum()),
                    "solved cold": int(solved[:, 1].sum()),
                    "of": len(pairs),
                    "without a guess": sum(one["guess"] is None for one, _ in pairs),
                    "drift": max(last, default=None),
                }
            )
    return found


def _spent(row: Mapping[str, Any]) -> float:
    """[s] of CPU; the whole run's where the solver's own is not known."""
    return float(row["cpu_s"] if row["cpu_s"] is not None else row["total_cpu_s"] or 0.0)


def _apart(one: Mapping[str, Array], other: Mapping[str, Array]) -> float | None:
    """How far two velocities are from each other, over the size of the second; None without."""
    if "u" not in one or "u" not in other or one["u"].shape != other["u"].shape:
        return None
    size = float(np.abs(other["u"]).max(initial=1e-300))
    return float(np.abs(one["u"] - other["u"]).max(initial=0.0)) / size


# ---- from histories


def curves(
    store: str | Path, rows: Sequence[Mapping[str, Any]]
) -> dict[str, list[tuple[Array, Array]]]:
    """For each run of each solver the times [s] and the least errors until then.

    The times are of CPU: those of the history, which are of the wall clock, in proportion. A run
    that left no history, as one that was killed, has reached nothing. Empty where no run has one.
    """
    found: dict[str, list[tuple[Array, Array]]] = defaultdict(list)
    some = False
    with Store(store, create=False) as opened:
        for row in rows:
            if row["status"] == "unsuitable":
                continue
            history = opened.history(row["run"])
            times = np.array([time for _, _, time, _ in history], dtype=float)
            errors = np.array([error for _, error, _, _ in history], dtype=float)
            if times.size:
                some = True
                if row["cpu_s"] is not None and times[-1] > 0:
                    times *= row["cpu_s"] / times[-1]
                errors = np.minimum.accumulate(errors)
            found[row["solver"]].append((times, errors))
    return dict(found) if some else {}


def convergence(
    store: str | Path, rows: Sequence[Mapping[str, Any]], times: Array
) -> dict[str, Array]:
    """The least error reached by a time, its median over all runs, by solver.

    Args:
        store: the file that the rows are of.
        rows: as `load` gives them, at one tolerance.
        times: (k) [s] of CPU, growing.

    Returns:
        For each solver an array (k), inf before half of its runs have reported; of an even number
        of runs the larger error in the middle. Empty where no run has a history.

    Raises:
        ProfileError: the runs are at several tolerances: they end at different errors.
    """
    if len({row["tol"] for row in rows}) > 1:
        raise ProfileError("convergence is of runs at one tolerance")
    found = {}
    for solver, own in curves(store, rows).items():
        reached = np.full((len(own), len(times)), np.inf)
        for k, (moments, errors) in enumerate(own):
            if moments.size:
                at = np.searchsorted(moments, times, side="right") - 1
                reached[k] = np.where(at >= 0, errors[np.maximum(at, 0)], np.inf)
        found[solver] = np.sort(reached, axis=0)[len(own) // 2]
    return found


def targets(tol: float) -> Array:
    """The errors that runtimes are to: powers of ten from 0.1 on, the tolerance last."""
    last = math.floor(math.log10(tol) + 1e-9)
    return np.array([*(10.0**k for k in range(-1, last, -1)), tol])


def runtimes(store: str | Path, rows: Sequence[Mapping[str, Any]], tol: float) -> dict[str, Array]:
    """For each solver the times [s] of CPU to the `targets` of all its runs; inf where not reached.

    Args:
        store: the file that the rows are of.
        rows: as `load` gives them.
        tol: only runs at this tolerance.
    """
    wanted = targets(tol)
    found = {}
    for solver, own in curves(store, [row for row in rows if row["tol"] == tol]).items():
        times = np.full((len(own), len(wanted)), np.inf)
        for k, (moments, errors) in enumerate(own):
            # the errors fall: the first that is small enough
            first = np.searchsorted(-errors, -wanted, side="left")
            reached = first < len(errors)
            times[k, reached] = moments[first[reached]]
        found[solver] = times.ravel()
    return found


# ---- what a figure says of itself


def caption(costs: Costs, rows: Sequence[Mapping[str, Any]]) -> str:
    """Instances, tolerances, limits, failures, machine, date and version, in one line."""

    def span(values: Iterable[float]) -> str:
        known = sorted(set(values))
        return f"{known[0]:g}" if len(known) == 1 else f"{known[0]:g} to {known[-1]:g}"

    first = rows[0]
    failed = int(np.isinf(costs.values).sum())
    count = int((~np.isnan(costs.values)).sum())
    started = [row["started"] for row in rows if row.get("started")]
    days = sorted({time.strftime("%Y-%m-%d", time.gmtime(t)) for t in started})
    # of the core; modules and programs have digests of their own
    versions = sorted({str(row.get("version") or "").partition("-")[0] for row in rows
                       if row.get("origin") == "fclib"})  # fmt: skip
    words = [
        f"{len(costs.instances)} instances",
        f"tolerance {', '.join(f'{tol:g}' for tol in costs.tolerances)}",
        f"limit {span(one.limit for one in costs.instances)} s of CPU",
        f"{failed} of {count} runs failed",
    ]
    if any(row.get("start") == "warm" for row in rows):
        words.insert(1, "warm: each step from a solution of one before it")
    if refused := int(costs.unsuitable.sum()) if costs.unsuitable is not None else 0:
        words.append(f"{refused} left out as unsuitable")
    words += [f"{first.get('cpu') or '?'} ({first.get('node') or '?'})"]
    words += [days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"] if days else []
    words += [f"fclib {', '.join(versions)}"] if versions else []
    return "; ".join(words)


def loaded(rows: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    """How many runs of each solver were begun while the load was above the number of cores."""
    found = Counter(
        row["solver"]
        for row in rows
        if row.get("load") and row.get("cores") and row["load"] > row["cores"]
    )
    return dict(found)
