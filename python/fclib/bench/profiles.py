"""What the runs of a store say: profiles, means, ratios. Knows rows and numbers, no problem.

An instance is a problem at a tolerance. The cost of a solver on an instance is infinite where it
failed, and the median of its repeats. Sources:

- performance profiles: Dolan & More, "Benchmarking optimization software with performance
  profiles" (2002): rho_s(tau) is the share of instances that s solves within tau times the cost of
  the best solver on each.
- data profiles: More & Wild, "Benchmarking derivative-free optimization algorithms" (2009): the
  share of instances solved within a cost, here by contact if wanted.
- shifted geometric means, exp(mean(log(t + s))) - s: Mittelmann's benchmarks; failures are charged
  a multiple of the limit.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib import _core
from fclib._solve import MeritKind
from fclib.bench.store import Store

Array: TypeAlias = npt.NDArray[np.float64]
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
    limit: float  # [s]


@dataclass(frozen=True)
class Costs:
    """The cost of each solver on each instance that all of them have run."""

    instances: tuple[Instance, ...]
    solvers: tuple[str, ...]
    values: Array  # (instances, solvers), inf where it failed; of `gather` nan where it did not run
    metric: str
    left_out: int = 0  # instances that some solver has not run

    @property
    def solved(self) -> npt.NDArray[np.bool_]:
        """(instances, solvers)."""
        return np.isfinite(self.values)

    @property
    def best(self) -> Array:
        """(instances) of the virtual best solver; inf where none solves it."""
        return np.asarray(self.values.min(axis=1))

    @property
    def charges(self) -> Array:
        """(instances) what a failure is charged before the penalty.

        For a time it is the limit of the run; for another metric the largest cost of a solver that
        solves the instance, or any instance where none does.
        """
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
        chosen = tuple(i for i, keep in zip(self.instances, there, strict=True) if keep)
        return replace(self, instances=chosen, values=self.values[there] / contacts[there, None])

    def shared(self, solvers: Sequence[str] | None = None) -> Costs:
        """Of some solvers, all by default, on the instances that all of these have run."""
        names = self.solvers if solvers is None else tuple(solvers)
        values = self.values[:, [self.solvers.index(name) for name in names]]
        ran = ~np.isnan(values)
        kept = np.flatnonzero(ran.all(axis=1))
        return replace(
            self,
            instances=tuple(self.instances[k] for k in kept),
            solvers=names,
            values=values[kept],
            left_out=int(ran.any(axis=1).sum()) - kept.size,
        )

    def of(self, chosen: Iterable[int]) -> Costs:
        """Some of the instances."""
        numbers = list(chosen)
        return replace(
            self, instances=tuple(self.instances[k] for k in numbers), values=self.values[numbers]
        )


def load(
    store: str | Path,
    *,
    campaign: str | None = None,
    families: Sequence[str] = (),
    solvers: Sequence[str] = (),
    tolerances: Sequence[float] = (),
    machine: str | None = None,
    merit: MeritKind | None = None,
) -> list[dict[str, Any]]:
    """The rows of a store that a profile is of.

    Args:
        store: the file.
        campaign: only its runs.
        families: only their problems.
        solvers: only these, by their labels, in this order.
        tolerances: only these.
        machine: its node's name.
        merit: only runs whose tolerance bounds this.

    Raises:
        StoreError: the file is no store.
        ProfileError: no run is left, or they are of several machines or merits.
    """
    with Store(store, create=False) as opened:
        rows = opened.results()
    wanted: list[tuple[str, Sequence[Any]]] = [
        ("campaign", [campaign] if campaign else ()),
        ("family", families),
        ("solver", solvers),
        ("tol", tolerances),
        ("node", [machine] if machine else ()),
        ("merit", [merit] if merit else ()),
    ]
    for column, values in wanted:
        if values:
            known = sorted({str(row[column]) for row in rows})
            rows = [row for row in rows if row[column] in values]
            if not rows:
                raise ProfileError(
                    f"{store}: no run with {column} {', '.join(map(str, values))};"
                    f" there is: {', '.join(known)}"
                )
    if not rows:
        raise ProfileError(f"{store}: there are no runs")
    nodes = sorted({row["node"] or "?" for row in rows})
    if len(nodes) > 1:
        raise ProfileError(
            f"{store}: times of several machines do not compare; choose one: {', '.join(nodes)}"
        )
    if len({row["merit"] for row in rows}) > 1:
        raise ProfileError(
            f"{store}: the tolerance of some runs bounds both natural maps, of others that of the"
            " literature alone, which does not compare; choose one by merit: both, natural"
        )
    versions: dict[str, set[tuple[str, str]]] = defaultdict(set)
    for row in rows:
        versions[row["solver"]].add((row["version"], row["options"]))
    for row in rows:
        if len(versions[row["solver"]]) > 1:
            row["solver"] = f"{row['solver']} ({row['version']})"
    order = {name: k for k, name in enumerate(solvers)}
    return sorted(rows, key=lambda row: order.get(row["solver"], len(order)))


JUDGED = {
    "both": "the tolerance bounds both natural maps",
    "natural": "the tolerance bounds the natural map of the literature alone",
}


def costs(rows: Sequence[Mapping[str, Any]], metric: str = "cpu_s") -> Costs:
    """The costs of the solvers of some rows; runs that the solver does not take count as failures.

    Raises:
        ProfileError: the metric is unknown, or no instance was run by all solvers.
    """
    found = gather(rows, metric).shared()
    if not found.instances:
        raise ProfileError("there is no problem that all of these solvers have run")
    return found


def gather(rows: Iterable[Mapping[str, Any]], metric: str = "cpu_s") -> Costs:
    """As `costs`, of all instances that one of the solvers has run; nan where another has not.

    Raises:
        ProfileError: the metric is unknown.
    """
    if metric not in METRICS:
        raise ProfileError(f"there is no metric {metric}; there is: {', '.join(METRICS)}")
    floor = METRICS[metric][1]
    instances: dict[tuple[str, float, float], Instance] = {}
    numbers: dict[tuple[str, float, float], int] = {}
    solvers: dict[str, int] = {}
    lines, columns, spent = [], [], []
    for row in rows:
        column = solvers.setdefault(row["solver"], len(solvers))
        if row["status"] == "unreadable":
            continue
        key = row["hash"], row["tol"], row["time_limit"]
        if key not in instances:
            numbers[key] = len(instances)
            instances[key] = Instance(
                hash=row["hash"],
                problem=row["problem"],
                family=row["family"],
                nc=row["nc"],
                tol=row["tol"],
                limit=row["time_limit"],
            )
        value = row[metric]
        lines.append(numbers[key])
        columns.append(column)
        good = row["solved"] and value is not None
        spent.append(max(float(value), floor) if good else math.inf)
    found = np.full((len(instances), len(solvers)), np.nan)
    if spent:
        # the repeats of a run beside each other, the quickest first
        values, cells = np.array(spent), np.array(lines) * len(solvers) + np.array(columns)
        order = np.lexsort((values, cells))
        cells, first, count = np.unique(cells[order], return_index=True, return_counts=True)
        # the median; of an even number with a failure in the middle, the failure
        low, high = values[order[first + (count - 1) // 2]], values[order[first + count // 2]]
        found.flat[cells] = (low + high) / 2
    ordered = sorted(instances.values(), key=lambda i: (i.family, i.problem, -i.tol, i.limit))
    rank = [numbers[i.hash, i.tol, i.limit] for i in ordered]
    return Costs(tuple(ordered), tuple(solvers), found[rank], metric)


# ---- profiles


def ratios(values: Array) -> Array:
    """r_ps = t_ps / min_s t_ps (instances, solvers); inf where s fails."""
    best = values.min(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(np.isfinite(values), values / best, np.inf))


def share_within(values: Array, bounds: Array) -> Array:
    """The share of instances whose value is at most each bound (solvers, bounds)."""
    count = max(1, values.shape[0])
    found = [np.searchsorted(np.sort(column), bounds, side="right") for column in values.T]
    return np.asarray(np.array(found).reshape(values.shape[1], len(bounds)) / count)


def performance_profile(values: Array, taus: Array) -> Array:
    """rho_s(tau) (solvers, taus) of costs (instances, solvers), by Dolan & More (2002)."""
    return share_within(ratios(values), taus)


# ---- means


def shifted_geometric_mean(
    values: Array, charges: Array, penalty: float = PENALTY, shift: float = SHIFT
) -> Array:
    """(solvers) of costs (instances, solvers); a failure counts as penalty times its charge."""
    whole = np.where(np.isfinite(values), values, penalty * charges[:, None])
    return np.asarray(np.expm1(np.log1p(whole / shift).mean(axis=0)) * shift)


@dataclass(frozen=True)
class Pair:
    """Two solvers on the instances that both solve."""

    first: str
    second: str
    both: int
    only_first: int
    only_second: int
    ratio: float  # geometric mean of t_first / t_second, nan where there is none
    low: float  # 95 % interval of it, by bootstrap over the instances
    high: float


def pairs(costs: Costs, against: str | None = None, seed: int = 0) -> list[Pair]:
    """Each two of the solvers, or each of the others and one.

    Args:
        costs: of all.
        against: the one, as the second of each pair.
        seed: of the bootstrap, which draws the instances `RESAMPLES` times.
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
            drawn = random.integers(0, logs.size, (RESAMPLES, logs.size))
            ratio = float(np.exp(logs.mean()))
            low, high = np.exp(np.quantile(logs[drawn].mean(axis=1), [0.025, 0.975])).tolist()
        only_a, only_b = int((good_a & ~good_b).sum()), int((good_b & ~good_a).sum())
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
        solved = np.isfinite(values[:, k])
        own = quotients[solved, k]
        rows.append(
            {
                "solver": name,
                "solved": int(solved.sum()),
                "of": len(solved),
                "fastest": int((own == 1).sum()) if k else int(solved.sum()),
                "mean": float(means[k]),
                "to best": float(means[k] / means[0]) if means[0] > 0 else math.nan,
                "median ratio": float(np.median(own)) if own.size else None,
                "worst ratio": float(own.max()) if own.size else None,
            }
        )
    return [rows[0], *sorted(rows[1:], key=lambda row: (-row["solved"], row["mean"]))]


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
        wins = Counter(part.solvers[k] for k in part.values.argmin(axis=1)[np.isfinite(part.best)])
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
) -> list[dict[str, Any]]:
    """A row a solver and tolerance: what the accuracy costs, over problems that all have run.

    `error` is the geometric mean of the recomputed errors of the runs that were solved.
    """
    found = []
    for tol in sorted({row["tol"] for row in rows}, reverse=True):
        own = [row for row in rows if row["tol"] == tol]
        try:
            part = costs(own, metric)
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
                    "of": len(part.instances),
                }
            )
    return found


def convergence(
    store: str | Path, rows: Sequence[Mapping[str, Any]], times: Array
) -> dict[str, Array]:
    """The least error reached by a time, its median over the runs with a history, by solver.

    Args:
        store: the file that the rows are of.
        rows: as `load` gives them.
        times: (k) [s], growing.

    Returns:
        For each solver with histories an array (k), inf before half of its runs have reported.
    """
    curves: dict[str, list[Array]] = defaultdict(list)
    with Store(store, create=False) as opened:
        for row in rows:
            history = opened.history(row["run"])
            if not history:
                continue
            errors = np.minimum.accumulate([error for _, error, _, _ in history])
            at = np.searchsorted([time for _, _, time, _ in history], times, side="right") - 1
            curves[row["solver"]].append(np.where(at >= 0, errors[np.maximum(at, 0)], np.inf))
    return {solver: np.median(np.array(own), axis=0) for solver, own in curves.items()}
