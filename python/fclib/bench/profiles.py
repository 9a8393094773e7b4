"""Profiles, means and ratios of the runs of a store. This module knows no problem.

What an instance is, what solved means and which instances count are defined in `comparison.py`.
Runs that started from nothing (cold) and from the solution of a step before (warm) are never in one
profile; `along` compares the two. Sources:

- performance profiles: Dolan & More, "Benchmarking optimization software with performance
  profiles" (2002): rho_s(tau) is the share of instances that s solves within tau times the cost of
  the best solver on each.
- data profiles: More & Wild, "Benchmarking derivative-free optimization algorithms" (2009): the
  share of instances that are solved within a cost, or within a cost per contact.
- shifted geometric means, exp(mean(log(t + s))) - s: Mittelmann's benchmarks; failures are charged
  a multiple of the limit.
- runtimes to fixed targets: Hansen et al., "COCO: a platform for comparing continuous optimizers"
  (2021): the share of pairs (instance, error) in which the run reached the error within a time,
  from the histories of all runs, also of those that failed.
- success at an accuracy: qpbenchmark (Caron et al.): the error reached decides, whatever the solver
  said.
- intervals: the bootstrap draws problems, each with all its runs (Efron & Tibshirani 1993);
  if families weigh the same, it draws families, and problems in each.
"""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib._solve import MeritKind
from fclib._verdicts import UNSUITABLE, is_solved
from fclib._words import counted
from fclib.bench.comparison import (
    METRICS,
    TIMES,
    WEIGH,
    Array,
    Costs,
    Instance,
    ProfileError,
    Weigh,
    costs,
    gather,
    in_order,
    kept,
    least,
    names_of,
    numbers_in,
    one_limit,
    pair_forms,
    runs_of,
    set_of,
    solved_in,
    table_of,
    words_in,
)
from fclib.bench.job import ORDERLY
from fclib.bench.store import Store
from fclib.bench.table import Table, Words, object_in

__all__ = [
    "METRICS",
    "TIMES",
    "WEIGH",
    "Costs",
    "Instance",
    "ProfileError",
    "Weigh",
    "costs",
    "gather",
    "least",
    "names_of",
]

Start: TypeAlias = Literal["cold", "warm"]
PENALTY = 10.0  # a failure counts in a mean as so many times the limit
SHIFT = 1e-3  # [s] of the shifted geometric mean
RESAMPLES = 2000
BANDS = 400  # number of draws for the bands of curves
CHUNK = 100  # draws at once: 40 MB for 50,000 problems
LAST = 3  # drift is measured in the last third of a sequence
SPREAD = 0.2  # a figure is marked if its repeats spread more than this, relative to the least
MARK, LOADED = "~", "^"  # marks of such a figure, and of one with runs under load
ACCURACIES = (1e-2, 1e-4, 1e-6, 1e-8)
VIRTUAL_BEST = "virtual best"
# no table, figure or page needs these columns of a store; they take a third of the memory
UNREAD = frozenset(
    (
        *("natural", "scaled_natural", "dynamics", "bilateral", "kinematics", "cone", "dual_cone"),
        *("complementarity", "open", "stick", "slide", "said_cpu_s", "setup_s", "measured"),
        *("warm", "pinned", "machine", "frequency_mhz", "solved"),
    )
)
JUDGED = {
    "both": "the tolerance bounds both natural maps",
    "natural": "the tolerance bounds the natural map of the literature alone",
}
WEIGHED = {"families": "each family weighs the same", "instances": "each instance weighs the same"}


def load(
    store: str | Path,
    *,
    campaign: str | None = None,
    sets: Sequence[str] = (),
    families: Sequence[str] = (),
    solvers: Sequence[str] = (),
    tolerances: Sequence[float] = (),
    machine: str | None = None,
    merit: MeritKind | None = None,
    start: Start | None = "cold",
    more: Sequence[str] = (),
    digests: Collection[str] | None = None,
) -> Table:
    """The runs of a store for a profile.

    Args:
        store: file of the store.
        campaign: only its runs.
        sets: only problems of these, by the folders of their files: SET/FAMILY/NUMBER-FORM.hdf5.
        families: only problems of these.
        solvers: only these, by their labels, in this order.
        tolerances: only these.
        machine: only runs on the machine of this node name.
        merit: only runs whose tolerance bounds this merit.
        start: "cold": only runs that started from nothing. "warm": only the steps of sequences,
            without the first steps, which had no step before them. None: both, which no profile
            takes.
        more: further columns of long texts, for example "message".
        digests: only problems with these data. None: all.

    Raises:
        StoreError: the file is not a store.
        ProfileError: no run is left, or they are of several machines or merits.
    """
    with Store(store, create=False) as opened:
        runs = read(opened, more)
    if not len(runs):
        raise ProfileError(f"{store}: there are no runs")
    later = numbers_in(runs, "step", 0.0) > 0
    runs = kept(runs, words_in(runs, "start").is_in(["cold"]) | later)
    runs = _name_machines(runs)
    if digests is not None:
        own = words_in(runs, "hash").is_in(digests)
        if not own.any():
            raise ProfileError(f"{store}: there are no runs of these problems")
        runs = kept(runs, own)
    wanted: list[tuple[str, Sequence[Any]]] = [
        ("campaign", [campaign] if campaign else ()),
        ("set", sets),
        ("family", families),
        ("solver", solvers),
        ("tol", tolerances),
        ("node", [machine] if machine else ()),
        ("merit", [merit] if merit else ()),
        ("start", [start] if start else ()),
    ]
    for column, values in wanted:
        if values:
            own = runs[column]
            fits = own.is_in(values) if isinstance(own, Words) else np.isin(own, values)
            if not fits.any():
                there = own.present() if isinstance(own, Words) else np.unique(own).tolist()
                raise ProfileError(
                    f"{store}: no run with {column} {', '.join(map(str, values))};"
                    f" there is: {', '.join(sorted(str(one or '?') for one in there))}"
                )
            runs = kept(runs, fits)
    nodes = sorted({name or "?" for name in words_in(runs, "node").present()})
    if len(nodes) > 1:
        raise ProfileError(
            f"{store}: times of several machines do not compare; choose one: {', '.join(nodes)}"
        )
    if len(words_in(runs, "merit").present()) > 1:
        raise ProfileError(
            f"{store}: the tolerance of some runs bounds both natural maps, of others that of the"
            " literature alone, which does not compare; choose one by merit: both, natural"
        )
    runs = one_limit(runs)
    # by the labels of the store, in the order asked for
    order = {name: k for k, name in enumerate(solvers)}
    solver = words_in(runs, "solver")
    rank = np.array([order.get(str(name), len(order)) for name in solver.values], int)
    if order:
        runs = runs.where(np.argsort(rank[solver.codes], kind="stable"))
    return _name_solvers(runs)


def read(store: Store, more: Sequence[str] = ()) -> Table:
    """All runs of a store, with their `set`; `same_as` is the global form of each local form."""
    runs = store.table(more=("path", *more))
    runs = Table({name: runs[name] for name in runs.names if name not in UNREAD})
    if not len(runs):
        return runs
    runs = runs.with_columns(set=words_in(runs, "path").map(set_of))
    _, first = runs.numbers("hash")
    pairs = pair_forms(iter(runs.where(first)))
    declared = words_in(runs, "same_as")
    own = words_in(runs, "hash").map(lambda digest: pairs.get(str(digest)))
    if not pairs or any(declared.values):
        return runs  # the campaign already said which forms belong together
    return runs.with_columns(same_as=own)


def _name_machines(runs: Table) -> Table:
    """Rename machines of the same name that have different processors."""
    number, first = runs.numbers("node", "cpu", "cores")
    kinds = list(runs.where(first))
    several = Counter(kind["node"] or "" for kind in kinds)
    names = [
        f"{kind['node']} ({kind['cores']} x {kind['cpu']})"
        if several[kind["node"] or ""] > 1
        else kind["node"]
        for kind in kinds
    ]
    own = Words.of_texts(names)
    return runs.with_columns(node=Words(own.values, own.codes[number]))


def _name_solvers(runs: Table) -> Table:
    """Relabel solvers of the same label that ran with different settings."""

    def facts_of(row: Mapping[str, Any]) -> dict[str, str]:
        options = object_in(row["options"])
        return {
            "version": row["version"] or "?",
            "options": " ".join(f"{k}={v}" for k, v in options.items()) or "no options",
            "threads": f"{row['threads']} threads",
            "memory": f"{row['memory_limit']:g} MB" if row["memory_limit"] else "",
        }

    number, first = runs.numbers("solver", "version", "options", "threads", "memory_limit")
    kinds = list(runs.where(first))
    ways: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for row in kinds:
        for name, value in facts_of(row).items():
            ways[row["solver"]][name].add(value)
    names = []
    for row in kinds:
        own = ways[row["solver"]]
        differing = [value for name, value in facts_of(row).items() if len(own[name]) > 1]
        names.append(f"{row['solver']} ({', '.join(differing)})" if differing else row["solver"])
    found = Words.of_texts(names)
    return runs.with_columns(solver=Words(found.values, found.codes[number]))


# ---- profiles


def ratios(values: Array) -> Array:
    """r_ps = t_ps / min_s t_ps (instances, solvers); inf if s fails, nan if it has no cost."""
    best = least(values)[:, None]
    with np.errstate(invalid="ignore"):
        found = np.where(np.isfinite(values), values / best, np.inf)
    return np.asarray(np.where(np.isnan(values), np.nan, found))


def share_within(values: Array, bounds: Array, weights: Array | None = None) -> Array:
    """The share of instances whose value is at most each bound (solvers, bounds).

    Args:
        values: (instances, solvers); for each solver, only the instances count that have a value.
        bounds: in growing order.
        weights: (instances, solvers), as `Costs.weights` gives them; by default all equal.
    """
    if weights is None:
        count = np.maximum(1, (~np.isnan(values)).sum(axis=0))[:, None]
        found = [np.searchsorted(np.sort(column), bounds, side="right") for column in values.T]
        return np.asarray(np.array(found).reshape(values.shape[1], len(bounds)) / count)
    shares = np.zeros((values.shape[1], len(bounds)))
    for k, (own, weight) in enumerate(zip(values.T, weights.T, strict=True)):
        order = np.argsort(own, kind="stable")
        sums = np.append(0.0, np.cumsum(weight[order]))
        shares[k] = sums[np.searchsorted(own[order], bounds, side="right")]
    return shares


def performance_profile(values: Array, taus: Array, weights: Array | None = None) -> Array:
    """rho_s(tau) (solvers, taus) of costs (instances, solvers), by Dolan & More (2002)."""
    return share_within(ratios(values), taus, weights)


def bands(
    costs: Costs, values: Array, bounds: Array, weigh: Weigh = "instances", seed: int = 0
) -> tuple[Array, Array]:
    """The ends of 95 % intervals of `share_within`, by drawing problems `BANDS` times.

    Args:
        costs: the costs that the values belong to.
        values: (instances, solvers) of the curves: costs or ratios.
        bounds: (k) the bounds, in growing order.
        weigh: which unit weighs the same, as in `Costs.weights`.
        seed: of the bootstrap.
    """
    problems, groups = _problems(costs, np.arange(len(costs.instances)), weigh)
    drawn = np.concatenate(list(_draws(groups, BANDS, seed)))
    weights = costs.weights(weigh)
    low, high = np.zeros((2, len(costs.solvers), len(bounds)))
    for k, own in enumerate(values.T):
        # first the weight of each problem's instances up to each bound, then that of the draws
        there = ~np.isnan(own)
        step = np.searchsorted(bounds, own[there], side="left")
        sums = np.zeros((drawn.shape[1], len(bounds) + 1))
        np.add.at(sums, (problems[there], step), weights[there, k])
        counted = drawn @ sums
        total = np.maximum(counted.sum(axis=1, keepdims=True), np.finfo(float).tiny)
        shares = np.cumsum(counted[:, :-1], axis=1) / total
        low[k], high[k] = np.quantile(shares, [0.025, 0.975], axis=0)
    return low, high


def _problems(
    costs: Costs, places: npt.NDArray[np.int64], weigh: Weigh
) -> tuple[npt.NDArray[np.int64], list[list[int]]]:
    """The problem's number of each of some instances; and the problems, to be drawn by group.

    If families weigh the same, a group is a family; else all problems are one group.
    """
    known: dict[str, int] = {}
    groups: dict[str, list[int]] = defaultdict(list)
    numbers = np.zeros(len(places), np.int64)
    for k, place in enumerate(places.tolist()):
        one = costs.instances[place]
        if one.hash not in known:
            known[one.hash] = len(known)
            groups[one.family if weigh == "families" else ""].append(known[one.hash])
        numbers[k] = known[one.hash]
    return numbers, list(groups.values())


def _draws(groups: Sequence[Sequence[int]], count: int, seed: int) -> Iterator[Array]:
    """(some, problems) how often each bootstrap draw takes each problem.

    Groups are drawn, and from each group as many problems as it has.
    """
    random = np.random.Generator(np.random.PCG64([seed, len(groups)]))
    size = sum(map(len, groups))
    for first in range(0, count, CHUNK):
        some = min(CHUNK, count - first)
        drawn = [np.array(own)[random.integers(0, len(own), (some, len(own)))] for own in groups]
        cells = np.concatenate(drawn, axis=1) + size * np.arange(some)[:, None]
        counts = np.bincount(cells.ravel(), minlength=some * size).reshape(some, size)
        shares = np.full(len(groups), 1 / len(groups))
        often = random.multinomial(len(groups), shares, some)
        for k, own in enumerate(groups):
            counts[:, own] *= often[:, [k]]
        yield counts.astype(float)


# ---- means


def shifted_geometric_mean(
    values: Array,
    charges: Array,
    penalty: float = PENALTY,
    shift: float = SHIFT,
    weights: Array | None = None,
) -> Array:
    """(solvers) of costs (instances, solvers); a failure costs penalty times its charge.

    For each solver, only the instances count that have a cost; nan if there are none. `weights`
    (instances, solvers) are those of `Costs.weights`; without them all weigh the same.
    """
    whole = np.where(np.isinf(values), penalty * charges[:, None], values)
    there = ~np.isnan(values)
    if weights is None:
        weights = there / np.maximum(1, there.sum(axis=0))
    logs = np.where(there, np.log1p(np.where(there, whole, 0.0) / shift), 0.0)
    means = np.expm1((weights * logs).sum(axis=0)) * shift
    return np.asarray(np.where(there.any(axis=0), means, np.nan))


@dataclass(frozen=True)
class Pair:
    """Two solvers on the instances that both solve, at one tolerance."""

    tol: float
    first: str
    second: str
    both: int
    only_first: int
    only_second: int
    ratio: float  # geometric mean of t_first / t_second, nan if there is none
    low: float  # 95 % interval of it, by bootstrap over the problems
    high: float


def pairs(
    costs: Costs, against: str | None = None, seed: int = 0, weigh: Weigh = "instances"
) -> list[Pair]:
    """The ratio of every two solvers at each tolerance, or of each solver to a given one.

    Args:
        costs: of all solvers.
        against: the given solver, the second of each pair; None: every two.
        seed: of the bootstrap, which draws the problems `RESAMPLES` times.
        weigh: which unit weighs the same, as in `Costs.weights`.
    """
    names = costs.solvers
    chosen = [
        (a, b)
        for a in range(len(names))
        for b in range(len(names))
        if (a < b if against is None else names[a] != against == names[b])
    ]
    parts = [costs.at(tol) for tol in costs.tolerances]
    return [pair for part in parts for pair in _pairs(part, chosen, seed, weigh)]


def _pairs(costs: Costs, chosen: Sequence[tuple[int, int]], seed: int, weigh: Weigh) -> list[Pair]:
    """The same at one tolerance. All pairs share the draws, which saves time."""
    (tol,) = costs.tolerances
    some = np.flatnonzero(costs.solved.any(axis=1))
    if not len(some):
        some = np.arange(len(costs.instances))
    numbers, groups = _problems(costs, some, weigh)
    size = sum(map(len, groups))
    # for each problem and pair: the weight of its instances, and their weighted logarithms
    sums, sizes = np.zeros((2, size, len(chosen)))
    ratios = np.full(len(chosen), math.nan)
    for k, (a, b) in enumerate(chosen):
        both = costs.solved[:, a] & costs.solved[:, b]
        part = Costs(costs.instances, ("",), np.where(both, 1.0, np.nan)[:, None], costs.metric)
        weights = part.weights(weigh)[:, 0]
        own = np.zeros(len(both))
        own[both] = weights[both] * np.log(costs.values[both, a] / costs.values[both, b])
        sums[:, k] = np.bincount(numbers, own[some], size)
        sizes[:, k] = np.bincount(numbers, weights[some], size)
        if both.any():
            ratios[k] = math.exp(own.sum())
    means = []
    for drawn in _draws(groups, RESAMPLES, seed):
        total = drawn @ sizes
        # a draw without any of their problems does not count
        with np.errstate(invalid="ignore", divide="ignore"):
            means.append(np.where(total > 0, (drawn @ sums) / total, np.nan))
    ends = np.full((2, len(chosen)), math.nan)
    known = np.flatnonzero(~np.isnan(ratios))
    if len(known):
        ends[:, known] = np.nanquantile(np.concatenate(means)[:, known], [0.025, 0.975], axis=0)
    found = []
    for k, (a, b) in enumerate(chosen):
        good, failed = costs.solved[:, [a, b]], np.isinf(costs.values[:, [a, b]])
        counts = (
            int((good[:, 0] & good[:, 1]).sum()),
            int((good[:, 0] & failed[:, 1]).sum()),
            int((good[:, 1] & failed[:, 0]).sum()),
        )
        low, high = np.exp(ends[:, k]).tolist()
        names = costs.solvers[a], costs.solvers[b]
        found.append(Pair(tol, *names, *counts, float(ratios[k]), low, high))
    return found


# ---- tables


def summary(
    costs: Costs, penalty: float = PENALTY, shift: float = SHIFT, weigh: Weigh = "instances"
) -> list[dict[str, Any]]:
    """One row for each tolerance and solver: the virtual best first, then by solved and mean.

    Args:
        costs: of all tolerances; each figure is of one tolerance.
        penalty: a failure is charged so many times the limit.
        shift: of the geometric mean.
        weigh: which unit weighs the same in the share solved and in the mean.
    """
    parts = [costs.at(tol) for tol in costs.tolerances]
    return [row for part in parts for row in _summary(part, penalty, shift, weigh)]


def _summary(costs: Costs, penalty: float, shift: float, weigh: Weigh) -> list[dict[str, Any]]:
    (tol,) = costs.tolerances
    best = costs.best
    whole = Costs(
        costs.instances,
        (VIRTUAL_BEST, *costs.solvers),
        np.column_stack([best, costs.values]),
        costs.metric,
    )
    values, weights = whole.values, whole.weights(weigh)
    means = shifted_geometric_mean(values, costs.charges, penalty, shift, weights)
    # the virtual best, on the instances of each solver
    beside = np.where(whole.there, best[:, None], np.nan)
    least_means = shifted_geometric_mean(beside, costs.charges, penalty, shift, weights)
    quotients = ratios(values)
    shares = (weights * whole.solved).sum(axis=0)
    rows: list[dict[str, Any]] = []
    for k, name in enumerate(whole.solvers):
        solved = whole.solved[:, k]
        own = quotients[solved, k]
        rows.append(
            {
                "tol": tol,
                "solver": name,
                "solved": int(solved.sum()),
                "of": int(whole.there[:, k].sum()),
                "share": float(shares[k]),
                "unsuitable": _count(costs.unsuitable, k - 1),
                "fastest": int((own == 1).sum()) if k else int(solved.sum()),
                "mean": float(means[k]),
                "to best": float(means[k] / least_means[k]) if least_means[k] > 0 else math.nan,
                "median ratio": float(np.median(own)) if own.size else None,
                "worst ratio": float(own.max()) if own.size else None,
                "spread": _median(costs.spread, k - 1),
                "copies": _median(costs.copies, k - 1),
            }
        )
    return [rows[0], *sorted(rows[1:], key=lambda row: (-row["share"], row["mean"]))]


def _count(marks: npt.NDArray[np.bool_] | None, k: int) -> int:
    return 0 if marks is None or k < 0 else int(marks[:, k].sum())


def _median(spread: Array | None, k: int) -> float | None:
    """The median spread of a solver's repeats or copies, if there are any."""
    if spread is None or k < 0:
        return None
    own = spread[np.isfinite(spread[:, k]), k]
    return float(np.median(own)) if own.size else None


def left_out(every: Costs, chosen: Costs) -> list[dict[str, Any]]:
    """A row for each tolerance and solver left out: how many of its runs it solves."""
    rows = []
    for tol in every.tolerances:
        part = every.at(tol)
        there = {one.key for one in chosen.at(tol).instances}
        in_common = np.array([one.key in there for one in part.instances], bool)
        for k, name in enumerate(part.solvers):
            solved, of = part.counts()[k]
            if name not in chosen.solvers and of:
                common = int((part.there[:, k] & in_common).sum())
                refused = _count(part.unsuitable, k)
                rows.append(
                    {
                        "tol": tol,
                        "solver": name,
                        "solved": solved,
                        "of": of,
                        "unsuitable": refused,
                        "in the common set": common,
                    }
                )
    return rows


def shifts(
    costs: Costs, penalty: float = PENALTY, shift: float = SHIFT, weigh: Weigh = "instances"
) -> list[dict[str, Any]]:
    """A row for each tolerance and solver: its mean over the virtual best's, for several shifts."""
    tables = {
        f"shift {s:g}": {
            (row["tol"], row["solver"]): row["to best"] for row in summary(costs, penalty, s, weigh)
        }
        for s in (shift / 10, shift, 10 * shift)
    }
    order = [(row["tol"], row["solver"]) for row in summary(costs, penalty, shift, weigh)]
    return [
        {"tol": tol, "solver": name, **{title: own[tol, name] for title, own in tables.items()}}
        for tol, name in order
        if name != VIRTUAL_BEST
    ]


def accuracies(
    rows: Iterable[Mapping[str, Any]], costs: Costs, weigh: Weigh = "instances"
) -> list[dict[str, Any]]:
    """A row for each tolerance and solver: the share of instances that reached each error in time.

    The recomputed error decides, whatever the solver said; repeats share the weight of their
    instance.

    Args:
        rows: the runs behind the costs; more are allowed.
        costs: they say which instances count for which solver.
        weigh: which unit weighs the same, as in `Costs.weights`.
    """
    runs = runs_of(rows, costs)
    place, column = costs.cells_of(runs)
    weights = costs.weights(weigh)
    tols = np.array([one.tol for one in costs.instances])
    # the weights of each solver at one tolerance sum to 1
    for tol in np.unique(tols):
        part = costs.at(float(tol))
        weights[tols == tol] = part.weights(weigh)
    cell = place * len(costs.solvers) + column
    count = np.bincount(cell, minlength=costs.values.size)
    own = weights[place, column] / count[cell]
    error = numbers_in(runs, "error")
    fit = words_in(runs, "status").is_in((*ORDERLY, "inaccurate"))
    fit &= numbers_in(runs, "cpu_s", 0.0) <= numbers_in(runs, "time_limit")
    found: list[dict[str, Any]] = []
    for tol in costs.tolerances:
        for k, solver in enumerate(costs.solvers):
            mine = (column == k) & (tols[place] == tol)
            if not mine.any():
                continue
            entry: dict[str, Any] = {"solver": solver, "tol": tol, "runs": int(mine.sum())}
            for bound in ACCURACIES:
                with np.errstate(invalid="ignore"):
                    reached = mine & fit & (error <= bound)
                entry[f"error <= {bound:g}"] = float(own[reached].sum())
            found.append(entry)
    return found


def failures(rows: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """A row for each tolerance and solver: how many of all its runs ended in each status."""
    runs = table_of(rows)
    tols = numbers_in(runs, "tol")
    solver, status = words_in(runs, "solver"), words_in(runs, "status")
    statuses = np.bincount(status.codes, minlength=len(status.values)).tolist()
    first = {name: k for k, name in enumerate(in_order(status))}
    codes = {name: k for k, name in enumerate(status.values)}
    order = sorted(first, key=lambda name: (-statuses[codes[name]], first[name]))
    found = []
    for tol in sorted({*tols.tolist()}, reverse=True):
        for name in in_order(solver):
            mine = (solver == name) & (tols == tol)
            if mine.any():
                count = np.bincount(status.codes[mine], minlength=len(status.values)).tolist()
                own = {status: count[codes[status]] for status in order}
                found.append({"tol": tol, "solver": name, **own})
    return found


def families(
    costs: Costs, published: Mapping[tuple[str, float], float] = MappingProxyType({})
) -> list[dict[str, Any]]:
    """A row for each family and tolerance: the fastest solver of each problem, as in papers.

    Args:
        costs: of all families.
        published: the paper's means, by family and tolerance.
    """
    groups: dict[tuple[str, float, float], list[int]] = defaultdict(list)
    for k, instance in enumerate(costs.instances):
        groups[instance.family, instance.tol, instance.limit].append(k)
    rows = []
    for (family, tol, limit), numbers in sorted(groups.items()):
        part = costs.on_instances(numbers)
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
    rows: Iterable[Mapping[str, Any]],
    costs: Costs,
    penalty: float = PENALTY,
    shift: float = SHIFT,
    weigh: Weigh = "instances",
) -> list[dict[str, Any]]:
    """A row for each solver and tolerance: the cost of that accuracy.

    `error` is the geometric mean of the recomputed errors of the runs that were solved.

    Args:
        rows: the runs behind the costs; more are allowed.
        costs: of all tolerances.
        penalty: a failure is charged so many times the limit.
        shift: of the geometric mean.
        weigh: which unit weighs the same, as in `Costs.weights`.
    """
    runs = runs_of(rows, costs)
    solver, tols = words_in(runs, "solver"), numbers_in(runs, "tol")
    with np.errstate(invalid="ignore"):
        logs = np.log(np.maximum(numbers_in(runs, "error"), 1e-17))
    good = solved_in(runs) & np.isfinite(logs)
    found = []
    for tol in costs.tolerances:
        part = costs.at(tol)
        weights = part.weights(weigh)
        means = shifted_geometric_mean(part.values, part.charges, penalty, shift, weights)
        for k, name in enumerate(part.solvers):
            errors = logs[good & (tols == tol) & (solver == name)]
            solved, of = part.counts()[k]
            if of:
                found.append(
                    {
                        "solver": name,
                        "tol": tol,
                        "mean": float(means[k]),
                        "error": float(np.exp(errors.mean())) if errors.size else None,
                        "solved": solved,
                        "of": of,
                    }
                )
    return found


# ---- along sequences


def along(
    store: str | Path, rows: Iterable[Mapping[str, Any]], campaign: str | None = None
) -> list[dict[str, Any]]:
    """A row for each sequence, tolerance and solver: its warm runs against its cold ones.

    Only steps count that were run in both ways with the same settings. A failed run counts with the
    time it took. `drift` is the largest difference of the two velocities u at the contacts, over
    the largest velocity, in the last third of the steps that both solved. The problems are given,
    so an error of one step reaches the next one only by the guess.

    Args:
        store: the file of the rows.
        rows: rows of `load` with start=None.
        campaign: only its warm runs; its cold runs may be of an earlier campaign.
    """

    def same(row: Mapping[str, Any]) -> tuple[Any, ...]:
        names = ("hash", "solver", "tol", "merit", "repeat", "time_limit", "wall_limit")
        return tuple(row[name] for name in names)

    # steps with cold runs alone are left out here
    every = table_of(rows)
    hashes, warm = words_in(every, "hash"), words_in(every, "start").is_in(["warm"])
    every = kept(every, hashes.is_in(in_order(words_in(every.where(warm), "hash"))))
    rows = list(every)
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
            cpu = np.array([[_cpu_of(row) for row in pair] for pair in pairs]).sum(axis=0)
            counts = np.array([[row["iterations"] or 0 for row in pair] for pair in pairs])
            solved = np.array([[is_solved(row["status"]) for row in pair] for pair in pairs])
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
                    "cold CPU / warm CPU": float(cpu[1] / max(cpu[0], 1e-9)),
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


def _cpu_of(row: Mapping[str, Any]) -> float:
    """CPU time in seconds: the solver's own, or the whole run's if the former is not known."""
    return float(row["cpu_s"] if row["cpu_s"] is not None else row["total_cpu_s"] or 0.0)


def _apart(one: Mapping[str, Array], other: Mapping[str, Array]) -> float | None:
    """The distance of two velocities over the size of the second; None if one is missing."""
    if "u" not in one or "u" not in other or one["u"].shape != other["u"].shape:
        return None
    size = float(np.abs(other["u"]).max(initial=1e-300))
    return float(np.abs(one["u"] - other["u"]).max(initial=0.0)) / size


# ---- from histories


def curves(
    store: str | Path, rows: Iterable[Mapping[str, Any]]
) -> dict[str, list[tuple[Array, Array]]]:
    """For each solver and run: the times [s], and the least error up to each of them.

    The times are CPU times: the history's times, which are of the wall clock, in proportion. A run
    without a history, for example one that was killed, has reached nothing. If no run has a
    history, the result is empty.
    """
    runs = table_of(rows)
    runs = runs.where(~words_in(runs, "status").is_in((UNSUITABLE,)))
    names = words_in(runs, "solver").tolist()
    numbers, times_of_runs = (
        numbers_in(runs, "run").astype(int).tolist(),
        numbers_in(runs, "cpu_s").tolist(),
    )
    found: dict[str, list[tuple[Array, Array]]] = defaultdict(list)
    some = False
    with Store(store, create=False) as opened:
        for solver, run, cpu_s in zip(names, numbers, times_of_runs, strict=True):
            history = opened.history(run)
            times, errors = least_errors(history, None if math.isnan(cpu_s) else cpu_s)
            some = some or bool(times.size)
            found[str(solver)].append((times, errors))
    return dict(found) if some else {}


def least_errors(
    history: Sequence[tuple[int, float, float, str]], cpu_s: float | None
) -> tuple[Array, Array]:
    """The times [s] of CPU of the reports of a run, and the least error up to each of them."""
    times = np.array([time for _, _, time, _ in history], dtype=float)
    errors = np.array([error for _, error, _, _ in history], dtype=float)
    if times.size and cpu_s is not None and times[-1] > 0:
        times *= cpu_s / times[-1]
    return times, np.minimum.accumulate(errors)


def convergence(
    store: str | Path, rows: Iterable[Mapping[str, Any]], times: Array
) -> dict[str, Array]:
    """For each solver: the least error reached by a time, as the median over all runs.

    Args:
        store: the file of the rows.
        rows: rows of `load`, at one tolerance.
        times: (k) CPU times in seconds, growing.

    Returns:
        For each solver an array (k). It is inf before half of its runs have reported. If the number
        of runs is even, the larger of the two errors in the middle counts. If no run has a history,
        the result is empty.

    Raises:
        ProfileError: the runs are at several tolerances, so that they end at different errors.
    """
    rows = table_of(rows)
    if len(np.unique(numbers_in(rows, "tol"))) > 1:
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
    """The target errors of runtimes: powers of ten from 0.1 down, the tolerance last."""
    last = math.floor(math.log10(tol) + 1e-9)
    return np.array([*(10.0**k for k in range(-1, last, -1)), tol])


def runtimes(store: str | Path, rows: Iterable[Mapping[str, Any]], tol: float) -> dict[str, Array]:
    """For each solver: CPU times [s] of its runs to each of `targets`; inf if not reached.

    Args:
        store: the file of the rows.
        rows: rows of `load`.
        tol: only runs at this tolerance.
    """
    wanted = targets(tol)
    found = {}
    runs = table_of(rows)
    for solver, own in curves(store, runs.where(numbers_in(runs, "tol") == tol)).items():
        times = np.full((len(own), len(wanted)), np.inf)
        for k, (moments, errors) in enumerate(own):
            # the errors fall, so take the first that is small enough
            first = np.searchsorted(-errors, -wanted, side="left")
            reached = first < len(errors)
            times[k, reached] = moments[first[reached]]
        found[solver] = times.ravel()
    return found


# ---- the caption of a figure


def caption(
    costs: Costs,
    rows: Iterable[Mapping[str, Any]],
    weigh: Weigh = "instances",
    own_set: bool = False,
) -> str:
    """One line: the number and set of instances, tolerances, limits, machine, date and version."""

    def span(values: Iterable[float]) -> str:
        known = sorted(set(values))
        return f"{known[0]:g}" if len(known) == 1 else f"{known[0]:g} to {known[-1]:g}"

    def first_word(name: str) -> str:
        return str(next((word for word in in_order(words_in(runs, name)) if word), ""))

    runs = table_of(rows)
    failed = int(np.isinf(costs.values).sum())
    count = int(costs.there.sum())
    started = numbers_in(runs, "started", 0.0)
    some = started[started > 0]
    ends = (float(some.min()), float(some.max())) if some.size else ()
    days = sorted({time.strftime("%Y-%m-%d", time.gmtime(t)) for t in ends})
    # version of the core only; modules and programs have their own digests
    own = runs.where(words_in(runs, "origin") == "fclib")
    named = {str(word or "").partition("-")[0] for word in in_order(words_in(own, "version"))}
    versions = sorted(named - {""})
    families = len({one.family for one in costs.instances})
    words = [
        f"{counted(len(costs.instances), 'instance')} of {counted(families, 'family', 'families')}",
        "for each solver those that it has run and takes"
        if own_set
        else f"which all {len(costs.solvers)} solvers have run and take"
        if len(costs.solvers) > 1
        else "which it has run and takes",
        WEIGHED[weigh],
        f"tolerance {', '.join(f'{tol:g}' for tol in costs.tolerances)}",
        f"limit {span(one.limit for one in costs.instances)} s of CPU",
        f"{failed} of {counted(count, 'run')} failed",
    ]
    if words_in(runs, "start").is_in(["warm"]).any():
        words.insert(1, "warm: each step from a solution of one before it")
    if costs.left_out:
        words.append(
            f"{counted(costs.left_out, 'instance')} left out, which not all have run or take"
        )
    if costs.of_other_forms:
        words.append(
            f"{counted(costs.of_other_forms, 'run')} of the other form of a problem left out"
        )
    # published runs name the machine by its processor
    words.append(", ".join(dict.fromkeys(filter(None, map(first_word, ("node", "cpu"))))))
    words += [days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"] if days else []
    words += [f"fclib {', '.join(versions)}"] if versions else []
    return "; ".join(filter(None, words))


def loaded(rows: Iterable[Mapping[str, Any]]) -> dict[str, int]:
    """How many runs of each solver began while the load was above the number of cores."""
    runs = table_of(rows)
    load, cores = numbers_in(runs, "load", 0.0), numbers_in(runs, "cores", 0.0)
    solver = words_in(runs.where((load > cores) & (cores > 0)), "solver")
    counts = np.bincount(solver.codes, minlength=len(solver.values)).tolist()
    return {name: n for name, n in zip(solver.values, counts, strict=True) if n}
