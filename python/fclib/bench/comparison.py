"""What is compared: what an instance is, what solved means, and which set of instances counts.

The command line, the figures, the site, the tables of the pages and the classes of problems all
take these meanings from here. This module knows runs and numbers, but no problem.

- **Instance**: a problem at a tolerance, under one limit; in a sequence, one step. A problem is
  known by the digest of its data, never by its name. Its global and its local form are one problem,
  and so are its renumbered copies.
- **Solved**: the recomputed error is at most the tolerance, or the bench has checked the proof that
  there is no solution; both within the limits (`SOLVED`).
- **Cost** of a solver on an instance: infinite if the solver failed. If at least half of its
  repeats solved the instance, it is the least of them; for renumbered copies it is the median. If a
  problem has two forms, the global one counts, unless the solver takes only the local one. A run
  that did not happen for a cause from outside has no cost.
- **Compared set**: the instances that all of the solvers have run and take, the *common* set; or,
  if that is asked for, for each solver those that it has run and takes, its *own* set.
- **Weights**: all instances weigh the same; or all families do, so that no large family decides a
  mean.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from types import MappingProxyType
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib import _core
from fclib._verdicts import SOLVED, UNSUITABLE
from fclib.bench.job import SURROUNDINGS
from fclib.bench.problems import FORM
from fclib.bench.table import Table, Words

Array: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]
Mask: TypeAlias = npt.NDArray[np.bool_]
Weigh: TypeAlias = Literal["families", "instances"]
# key of an instance: the problem's hash, tolerance, sequence and step
Key: TypeAlias = tuple[str, float, str, int]

WEIGH: tuple[Weigh, ...] = ("families", "instances")
# each measure of cost, with the smallest value that differs from zero
METRICS: Mapping[str, tuple[str, float]] = MappingProxyType(
    {
        "cpu_s": ("CPU time [s]", 1e-6),
        "total_cpu_s": ("CPU time of the whole run [s]", 1e-6),
        "wall_s": ("wall clock [s]", 1e-6),
        "iterations": ("iterations", 1.0),
        "memory_mb": ("memory [MB]", 1.0),
    }
)
TIMES = ("cpu_s", "total_cpu_s", "wall_s")
# the common set keeps at least this share of the instances: a solver that has run few would
# make it small for all others, and is compared only if it is asked for
COMMON = 0.5


class ProfileError(_core.Error, ValueError):
    """There is nothing to compare."""


# ---- columns, also of tables that lack some of them


def table_of(rows: Iterable[Mapping[str, Any]]) -> Table:
    """Runs as a table of columns; a table stays as it is. A missing value is None."""
    if isinstance(rows, Table):
        return rows
    known = list(rows)
    names = dict.fromkeys(name for row in known for name in row)
    return Table.of_rows([{name: row.get(name) for name in names} for row in known])


def words_in(runs: Table, name: str) -> Words:
    """A column of texts; None in each row if there is no such column."""
    if name not in runs:
        return Words.of_texts([None] * len(runs))
    own = runs[name]
    if isinstance(own, Words):
        return own
    return Words.of_texts(None if value != value else str(value) for value in own.tolist())


def numbers_in(runs: Table, name: str, missing: float = math.nan) -> Array:
    """A column of numbers; `missing` if there is none."""
    if name not in runs:
        return np.full(len(runs), missing)
    own = runs[name]
    if isinstance(own, Words):  # a column of texts that is all None
        return np.full(len(runs), missing)
    values = own.astype(float)
    return np.asarray(
        values if math.isnan(missing) else np.where(np.isnan(values), missing, values)
    )


def kept(runs: Table, mask: Mask) -> Table:
    """Some of the runs; all of them are not copied."""
    return runs if mask.all() else runs.where(mask)


def in_order(words: Words) -> list[Any]:
    """The texts that occur, in the order of their first appearance."""
    _, first = np.unique(words.codes, return_index=True)
    return [words.values[words.codes[place]] for place in np.sort(first)]


def solved_in(runs: Table) -> Mask:
    """Whether each run is solved. A store's column `solved` may be outdated."""
    return words_in(runs, "status").is_in(SOLVED)


# ---- instances


@dataclass(frozen=True)
class Instance:
    """A problem at a tolerance; in a sequence, one step."""

    hash: str
    problem: str
    family: str
    nc: int
    tol: float
    limit: float  # [s] of CPU
    wall_limit: float = math.inf  # [s]
    sequence: str = ""
    step: int = 0
    forms: tuple[str, ...] = ()  # the hashes of its forms that were run, the main one first

    @property
    def key(self) -> Key:
        """Two instances with the same key are the same."""
        return self.hash, self.tol, self.sequence, self.step


def pair_forms(problems: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """The hash of the global form, by the hash of each local form of the same problem.

    Two forms of a problem lie in one folder SET/FAMILY, as NUMBER-global and NUMBER-local, and
    agree in family, contacts, components and constraints. If several problems were at one place,
    for example because a family was made anew, none is paired: which belong together is unknown.

    Args:
        problems: with hash, path, family, nc, p, spacedim and formulation.
    """
    places: dict[tuple[Any, ...], dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for one in problems:
        path = PurePath(one["path"] or "")
        found = FORM.fullmatch(path.stem)
        if found:
            facts = (one[name] for name in ("family", "nc", "p", "spacedim"))
            law = str(one["formulation"]).removeprefix("G")
            place = (*path.parts[-3:-1], found[1], law, *facts)
            places[place][found[2]].add(one["hash"])
    pairs = {}
    for own in places.values():
        if len(own["global"]) == len(own["local"]) == 1:
            pairs[next(iter(own["local"]))] = next(iter(own["global"]))
    return pairs


def set_of(path: str | None) -> str | None:
    """The set of a problem by its file, SET/FAMILY/NUMBER-FORM.hdf5; None for any other file."""
    own = PurePath(path or "")
    return own.parts[-3] if FORM.fullmatch(own.stem) and len(own.parts) > 2 else None


def keys_of(runs: Table, both_forms: bool = False) -> tuple[Integers, list[Key]]:
    """The number of the instance of each run, and the instances."""
    hashes, same, sequences = (words_in(runs, name) for name in ("hash", "same_as", "sequence"))
    known: dict[str, int] = {}
    own = np.array([known.setdefault(value, len(known)) for value in hashes.values], np.int64)
    base = own[hashes.codes]
    if not both_forms:
        other = [known.setdefault(value, len(known)) if value else -1 for value in same.values]
        instead = np.array(other, np.int64)[same.codes]
        base = np.where(instead >= 0, instead, base)
    chains: dict[str, int] = {}
    chain = np.array([chains.setdefault(x or "", len(chains)) for x in sequences.values], np.int64)
    tols, tol = np.unique(numbers_in(runs, "tol"), return_inverse=True)
    steps, step = np.unique(numbers_in(runs, "step", 0.0), return_inverse=True)
    code = ((base * len(tols) + tol) * max(1, len(chains)) + chain[sequences.codes]) * len(
        steps
    ) + step
    _, first, inverse = np.unique(code, return_index=True, return_inverse=True)
    names, words = list(known), list(chains)
    keys = [
        (names[base[k]], float(tols[tol[k]]), words[chain[sequences.codes[k]]], int(steps[step[k]]))
        for k in first.tolist()
    ]
    return inverse.astype(np.int64), keys


def one_limit(rows: Iterable[Mapping[str, Any]], both_forms: bool = False) -> Table:
    """For each instance, the runs under one limit: the limit that most solvers ran under.

    If several limits have as many, the largest counts. So if a limit was raised, the runs before
    do not count.
    """
    runs = table_of(rows)
    if not len(runs):
        return runs
    place, keys = keys_of(runs, both_forms)
    limits = np.column_stack(
        [numbers_in(runs, "time_limit", 0.0), numbers_in(runs, "wall_limit", 0.0)]
    )
    # in growing order
    kinds, limit = np.unique(limits, axis=0, return_inverse=True)
    if len(kinds) == 1:
        return runs
    pair = place * len(kinds) + limit.ravel()
    solver = words_in(runs, "solver")
    each = np.unique(pair * len(solver.values) + solver.codes) // len(solver.values)
    pairs, count = np.unique(each, return_counts=True)
    order = np.lexsort((pairs % len(kinds), count, pairs // len(kinds)))
    chosen = np.zeros(len(keys), np.int64)
    chosen[pairs[order] // len(kinds)] = pairs[order]  # the last one of each instance stays
    return kept(runs, pair == chosen[place])


# ---- costs


@dataclass(frozen=True)
class Costs:
    """The cost of each solver on each instance."""

    instances: tuple[Instance, ...]
    solvers: tuple[str, ...]
    values: Array  # (instances, solvers), inf: the solver failed, nan: it has no cost
    metric: str
    # for each tolerance, the instances that some solver has not run or does not take
    left: Mapping[float, int] = field(default_factory=dict)
    spread: Array | None = None  # spread of the repeats, relative to the least; nan if there is one
    unsuitable: Mask | None = None  # True: the solver does not take such problems
    copies: Array | None = None  # spread over renumbered copies; nan if there is one
    forms: Integers | None = None  # which form of the instance counts
    # for each tolerance, the runs that do not count: they are of the other form of a problem
    other: Mapping[float, int] = field(default_factory=dict)
    both_forms: bool = False  # whether the two forms of a problem count as two problems

    @property
    def left_out(self) -> int:
        """Instances that are not in the common set."""
        return sum(self.left.values())

    @property
    def of_other_forms(self) -> int:
        """Runs that do not count, because they are of the other form of a problem."""
        return sum(self.other.values())

    @property
    def solved(self) -> Mask:
        """(instances, solvers)."""
        return np.isfinite(self.values)

    @property
    def there(self) -> Mask:
        """(instances, solvers) True if the solver takes the instance and has run it."""
        return ~np.isnan(self.values)

    @property
    def best(self) -> Array:
        """(instances) of the virtual best solver; inf if none solves it."""
        return least(self.values)

    @property
    def charges(self) -> Array:
        """(instances) the charge for a failure, before the penalty.

        For a time it is the limit of the run. For another metric it is the largest cost among the
        solvers that solve the instance; if none does, the largest cost on any instance.
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

    def weights(self, weigh: Weigh = "instances") -> Array:
        """(instances, solvers) the weight of each instance; the weights of each solver sum to 1.

        If families weigh the same, each of them has the same sum. A solver without an instance has
        no weights, only zeros.
        """
        there = self.there.astype(float)
        if weigh == "families":
            names = {
                name: k for k, name in enumerate(dict.fromkeys(i.family for i in self.instances))
            }
            family = np.array([names[one.family] for one in self.instances], int)
            sizes = np.zeros((len(names), len(self.solvers)))
            np.add.at(sizes, family, there)
            there = there / np.maximum(sizes, 1.0)[family]
        return np.asarray(there / np.maximum(there.sum(axis=0), np.finfo(float).tiny))

    def per_contact(self) -> Costs:
        """The costs over the number of contacts; instances without any are left out."""
        contacts = np.array([instance.nc for instance in self.instances])
        there = contacts > 0
        part = self.on_instances(np.flatnonzero(there))
        return replace(part, values=part.values / contacts[there, None])

    def shared(self, solvers: Sequence[str] | None = None) -> Costs:
        """The costs of some solvers on the instances that all of them take and have run."""
        part = self.chosen(self.solvers if solvers is None else solvers)
        kept = np.flatnonzero(part.there.all(axis=1))
        lost = part.there.any(axis=1) & ~part.there.all(axis=1)
        left = Counter(part.instances[k].tol for k in np.flatnonzero(lost))
        return replace(part.on_instances(kept), left=dict(left))

    def own(self, solvers: Sequence[str] | None = None) -> Costs:
        """The costs of some solvers, each on the instances that it has run and takes."""
        part = self.chosen(self.solvers if solvers is None else solvers)
        return part.on_instances(np.flatnonzero(part.there.any(axis=1)))

    def widest(self) -> tuple[str, ...]:
        """The solvers whose common set has at least the share `COMMON` of their instances.

        This must hold at each tolerance. The solver with the fewest instances is left out first; at
        least two stay.
        """
        count = self.there.sum(axis=0)
        ranked = sorted(zip((-count).tolist(), self.solvers, strict=True))
        names = [name for _, name in ranked]
        if len(names) and not count.any():
            return self.solvers
        names = [name for name in names if count[self.solvers.index(name)]]
        while len(names) > 2 and not self._is_wide(names):
            names.pop()
        return tuple(name for name in self.solvers if name in names)

    def _is_wide(self, names: Sequence[str]) -> bool:
        part = self.chosen(names)
        tols = np.array([one.tol for one in part.instances])
        return all(
            here.all(axis=1).sum() >= COMMON * here.any(axis=1).sum()
            for here in (part.there[tols == tol] for tol in np.unique(tols))
        )

    def chosen(self, solvers: Sequence[str]) -> Costs:
        """The costs of some solvers, on all instances."""
        columns = [self.solvers.index(name) for name in solvers]

        def part_of(own: Any) -> Any:
            return None if own is None else own[:, columns]

        return replace(
            self,
            solvers=tuple(solvers),
            values=self.values[:, columns],
            spread=part_of(self.spread),
            unsuitable=part_of(self.unsuitable),
            copies=part_of(self.copies),
            forms=part_of(self.forms),
        )

    def on_instances(self, chosen: Iterable[int]) -> Costs:
        """The costs on some of the instances."""
        numbers = list(chosen)

        def part_of(own: Any) -> Any:
            return None if own is None else own[numbers]

        return replace(
            self,
            instances=tuple(self.instances[k] for k in numbers),
            values=self.values[numbers],
            spread=part_of(self.spread),
            unsuitable=part_of(self.unsuitable),
            copies=part_of(self.copies),
            forms=part_of(self.forms),
        )

    def at(self, tol: float) -> Costs:
        """The costs at one tolerance."""
        part = self.on_instances(k for k, one in enumerate(self.instances) if one.tol == tol)
        left = {t: n for t, n in self.left.items() if t == tol}
        return replace(part, left=left, other={t: n for t, n in self.other.items() if t == tol})

    @property
    def tolerances(self) -> list[float]:
        """The tolerances, the largest first."""
        return sorted({instance.tol for instance in self.instances}, reverse=True)

    def cells_of(self, runs: Table) -> tuple[Integers, Integers]:
        """The number of the instance and of the solver of each run; -1 if the run has none here."""
        place, keys = keys_of(runs, self.both_forms)
        numbers = {one.key: k for k, one in enumerate(self.instances)}
        instance = np.array([numbers.get(key, -1) for key in keys], np.int64)
        solver = words_in(runs, "solver")
        names = {name: k for k, name in enumerate(self.solvers)}
        own = np.array([names.get(name, -1) for name in solver.values], np.int64)
        return instance[place], own[solver.codes]

    def counts(self) -> list[tuple[int, int]]:
        """The number of instances that each solver solves, and of those that it has."""
        pairs = zip(self.solved.sum(axis=0), self.there.sum(axis=0), strict=True)
        return [(int(solved), int(of)) for solved, of in pairs]

    def legend(self, k: int) -> str:
        """A solver with what it solves: "apgd 170 of 194"."""
        solved, of = self.counts()[k]
        return f"{self.solvers[k]} {solved} of {of}"


def least(values: Array) -> Array:
    """(instances) the least cost of each; inf if no solver has one."""
    return np.asarray(np.where(np.isnan(values), np.inf, values).min(axis=1, initial=np.inf))


def gather(
    rows: Iterable[Mapping[str, Any]],
    metric: str = "cpu_s",
    count_unsuitable: bool = False,
    both_forms: bool = False,
) -> Costs:
    """The costs of all solvers on all instances that any has run; nan if a solver has not.

    Args:
        rows: runs, of one machine and one merit.
        metric: one of `METRICS`.
        count_unsuitable: whether a problem that a solver does not take is a failure of it.
        both_forms: whether the two forms of a problem are two problems.

    Raises:
        ProfileError: the metric is unknown.
    """
    if metric not in METRICS:
        raise ProfileError(f"there is no metric {metric}; there is: {', '.join(METRICS)}")
    runs = one_limit(rows, both_forms)
    names = in_order(words_in(runs, "solver"))
    solver = words_in(runs, "solver")
    numbers = {name: k for k, name in enumerate(names)}
    column_of = np.array([numbers.get(name, -1) for name in solver.values], np.int64)
    runs = kept(runs, ~words_in(runs, "status").is_in(SURROUNDINGS))
    if not len(runs):
        none = np.zeros((0, len(names)))
        return Costs((), tuple(names), none, metric)
    place, keys = keys_of(runs, both_forms)
    instances, form = described(runs, place, keys)
    order = sorted(
        range(len(keys)),
        key=lambda k: (
            *(instances[k].family, instances[k].problem, -instances[k].tol),
            *(instances[k].sequence, instances[k].step, instances[k].hash),
        ),
    )
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    instances = [instances[k] for k in order]
    shape = len(instances), len(names)
    cell = rank[place] * len(names) + column_of[words_in(runs, "solver").codes]

    refused = np.zeros(len(runs), bool)
    if not count_unsuitable:
        refused = words_in(runs, "status").is_in((UNSUITABLE,))
    value = numbers_in(runs, metric)
    good = solved_in(runs) & ~np.isnan(value)
    costs_of_runs = np.where(good, np.maximum(value, METRICS[metric][1]), np.inf)
    found = _cells(
        cell[~refused],
        form[~refused],
        numbers_in(runs, "copy", 0.0)[~refused],
        costs_of_runs[~refused],
    )
    values, spread, copies = (np.full(shape, np.nan) for _ in range(3))
    forms = np.zeros(shape, np.int64)
    values.flat[found.cells], spread.flat[found.cells] = found.cost, found.spread
    copies.flat[found.cells], forms.flat[found.cells] = found.copies, found.form
    unsuitable = np.zeros(shape, bool)
    unsuitable.flat[cell[refused]] = True
    unsuitable &= np.isnan(values)
    tols = numbers_in(runs, "tol")[~refused]
    other = tols[form[~refused] != forms.flat[cell[~refused]]]
    return Costs(
        tuple(instances),
        tuple(names),
        values,
        metric,
        spread=spread,
        unsuitable=unsuitable,
        copies=copies,
        forms=forms,
        other=dict(Counter(other.tolist())),
        both_forms=both_forms,
    )


def described(runs: Table, place: Integers, keys: Sequence[Key]) -> tuple[list[Instance], Integers]:
    """The instances, and the form of its instance that each run has solved."""
    hashes = words_in(runs, "hash")
    pairs = np.unique(place * len(hashes.values) + hashes.codes)
    own: list[list[str]] = [[] for _ in keys]
    for pair in pairs.tolist():
        own[pair // len(hashes.values)].append(hashes.values[pair % len(hashes.values)])
    for k, (digest, *_) in enumerate(keys):
        own[k].sort(key=lambda form: (form != digest, form))
    numbers = np.zeros(len(pairs), np.int64)
    for k, pair in enumerate(pairs.tolist()):
        forms = own[pair // len(hashes.values)]
        numbers[k] = forms.index(hashes.values[pair % len(hashes.values)])
    code = place * len(hashes.values) + hashes.codes
    form = numbers[np.searchsorted(pairs, code)]
    # the facts of an instance are those of its main form
    order = np.lexsort((np.arange(len(runs)), form, place))
    first = order[np.searchsorted(place[order], np.arange(len(keys)))]
    names = ("problem", "family", "nc", "time_limit", "wall_limit")
    some = Table({name: runs[name] for name in names if name in runs}).where(first)
    instances = []
    for key, forms, row in zip(keys, own, some, strict=True):
        instances.append(
            Instance(
                hash=key[0],
                problem=row["problem"],
                family=row["family"],
                nc=row["nc"],
                tol=key[1],
                limit=row["time_limit"],
                wall_limit=row.get("wall_limit") or math.inf,
                sequence=key[2],
                step=key[3],
                forms=tuple(forms),
            )
        )
    return instances, form


@dataclass(frozen=True)
class _Cells:
    """The cost of each solver on each instance, from its runs."""

    cells: Integers
    cost: Array
    spread: Array
    copies: Array
    form: Integers


def _cells(cell: Integers, form: Integers, copy: Array, costs_of_runs: Array) -> _Cells:
    """Repeats give the cost of a copy, copies the cost of a form; one of the forms counts."""
    if not len(cell):
        none = np.zeros(0)
        return _Cells(cell, none, none, none, cell)
    # sort the repeats of a run side by side, the quickest first
    order = np.lexsort((costs_of_runs, copy, form, cell))
    cell, form, copy, costs_of_runs = cell[order], form[order], copy[order], costs_of_runs[order]
    first = _starts(cell, form, copy)
    count = np.diff(np.append(first, len(cell)))
    solved = np.add.reduceat(np.isfinite(costs_of_runs).astype(np.int64), first)
    quickest, slowest = costs_of_runs[first], costs_of_runs[first + np.maximum(solved, 1) - 1]
    cost = np.where(2 * solved >= count, quickest, np.inf)
    with np.errstate(invalid="ignore"):
        spread = np.where((solved > 1) & np.isfinite(quickest), slowest / quickest - 1, np.nan)
    cell, form = cell[first], form[first]
    # sort the copies of a form, the quickest first; of two in the middle the lower is the median
    order = np.lexsort((cost, form, cell))
    cell, form, cost, spread = cell[order], form[order], cost[order], spread[order]
    first = _starts(cell, form)
    count = np.diff(np.append(first, len(cell)))
    solved = np.add.reduceat(np.isfinite(cost).astype(np.int64), first)
    slowest = cost[first + np.maximum(solved, 1) - 1]
    with np.errstate(invalid="ignore"):
        copies = np.where(solved > 1, slowest / cost[first] - 1, np.nan)
    spread = np.fmax.reduceat(spread, first)
    cost, cell, form = cost[first + (count - 1) // 2], cell[first], form[first]
    # take the first form: the main one if it was run
    kept = _starts(cell)
    return _Cells(cell[kept], cost[kept], spread[kept], copies[kept], form[kept])


def _starts(*sorted_columns: npt.NDArray[Any]) -> Integers:
    """The place of the first row of each group of equal rows."""
    new = np.zeros(len(sorted_columns[0]), bool)
    new[0] = True
    for own in sorted_columns:
        new[1:] |= own[1:] != own[:-1]
    return np.flatnonzero(new)


def costs(
    rows: Iterable[Mapping[str, Any]],
    metric: str = "cpu_s",
    count_unsuitable: bool = False,
    *,
    own_set: bool = False,
    both_forms: bool = False,
) -> Costs:
    """The costs of the solvers of some rows, on the common set, or of each on its own.

    Args:
        rows: runs, of one machine and one merit.
        metric: one of `METRICS`.
        count_unsuitable: whether a problem that a solver does not take is a failure of it.
        own_set: whether each solver counts on what it has run and takes.
        both_forms: whether the two forms of a problem are two problems.

    Raises:
        ProfileError: the metric is unknown, or no instance was run and is taken by all solvers.
    """
    every = gather(rows, metric, count_unsuitable, both_forms)
    found = every.own() if own_set else every.shared()
    if not found.instances:
        raise ProfileError("there is no problem that all of these solvers have run and take")
    return found


def compared(every: Costs, solvers: Sequence[str] | None = None, own_set: bool = False) -> Costs:
    """The costs on the set that is compared: each table, figure and page begins with these.

    Args:
        every: the result of `gather`.
        solvers: the solvers asked for; None: the `widest` of all.
        own_set: whether each solver counts on what it has run and takes.

    Raises:
        ProfileError: no instance was run and is taken by all solvers.
    """
    if own_set:
        found = every.own(solvers)
    else:
        names = every.widest() if solvers is None else solvers
        found = every.shared([name for name in every.solvers if name in names])
    if not found.instances:
        raise ProfileError(
            "there is no problem that all of these solvers have run and take; name fewer by"
            " --solver, or compare each on its own set by --own-set"
        )
    return found


def runs_of(rows: Iterable[Mapping[str, Any]], chosen: Costs) -> Table:
    """The runs behind the costs: of these solvers, on these instances, in the form that counts."""
    runs = one_limit(rows, chosen.both_forms)
    fits = ~words_in(runs, "status").is_in((*SURROUNDINGS, UNSUITABLE))
    if not len(runs) or not chosen.instances:
        return runs.where(np.zeros(len(runs), bool))
    instance, solver = chosen.cells_of(runs)
    fits &= (instance >= 0) & (solver >= 0)
    fits[fits] = chosen.there[instance[fits], solver[fits]]
    if chosen.forms is not None:
        hashes = words_in(runs, "hash")
        codes = {value: k for k, value in enumerate(hashes.values)}
        which = np.full(chosen.values.shape, -1, np.int64)
        for k, one in enumerate(chosen.instances):
            table = np.array([codes.get(form, -1) for form in one.forms], np.int64)
            which[k] = table[chosen.forms[k]]
        fits[fits] = which[instance[fits], solver[fits]] == hashes.codes[fits]
    return kept(runs, fits)


def odds(solved: float, of: float) -> tuple[float, float]:
    """The ends of Wilson's 95 % interval of the chance to solve one more (Wilson 1927)."""
    z, share = 1.96, solved / of
    middle = (share + z * z / (2 * of)) / (1 + z * z / of)
    half = z * math.sqrt(share * (1 - share) / of + z * z / (4 * of * of)) / (1 + z * z / of)
    return max(0.0, middle - half), min(1.0, middle + half)


def names_of(instances: Sequence[Instance]) -> list[str]:
    """A name for each problem; if two share a name, the start of the digest is added."""
    own: dict[str, set[str]] = defaultdict(set)
    for one in instances:
        own[one.problem].add(one.hash)
    return [
        f"{one.problem} ({one.hash[:8]})" if len(own[one.problem]) > 1 else one.problem
        for one in instances
    ]


def count_by_status(runs: Table) -> Counter[str]:
    """How many runs ended with each status, the most frequent first."""
    words = words_in(runs, "status")
    counts = np.bincount(words.codes, minlength=len(words.values)).tolist()
    return Counter({word: n for word, n in zip(words.values, counts, strict=True) if n})
