"""Published runs beside those of a store, with times on the scale of its machine."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

from fclib import _core
from fclib._words import counted
from fclib.bench.calibration import Calibration, Ratio, calibration_in, ratio_of
from fclib.bench.store import Store
from fclib.results.shards import Shard, ShardError, look, rows_of

NONE = (math.inf, math.inf)  # the limits of a kind of runs that a store lacks
TIMES = ("cpu_s", "said_cpu_s", "setup_s", "total_cpu_s", "wall_s")
REMEDY = "calibrate this machine with `fclib bench --calibrate`, before the campaign"


class BesideError(_core.Error, ValueError):
    """Published runs cannot be put beside a store."""


@dataclass(frozen=True)
class Joined:
    """A store with published runs beside its own."""

    path: Path  # of the store
    runs: int  # published ones
    ratios: Mapping[str, Ratio]  # factor of the times of each published machine
    lowered: int = 0  # runs of the store that count under the smaller limit of published ones
    short: Mapping[str, float] = field(default_factory=dict)
    """The largest limit [s] of each solver of which a run was left out for its smaller limit."""

    def __str__(self) -> str:
        words = [f"times of {node} x {ratio}" for node, ratio in self.ratios.items()]
        text = f"{self.runs} published runs; {'; '.join(words) or 'times as measured'}"
        if self.lowered:
            text += f"; {counted(self.lowered, 'own run')} under the smaller limit of these"
        return text


@contextmanager
def beside(
    mine: Path, parts: Iterable[Path], machine: str | None = None, *, scale: bool = True
) -> Iterator[Joined]:
    """A temporary store with the runs of a store, and the published ones of the same problems.

    The published runs of a problem at a tolerance are taken if the store has such a run. All count
    under one limit: that of the store, or that of most published solvers if it is smaller. A run
    that takes longer has failed, and a published one with a smaller limit is left out. A time on
    another machine becomes the time on this one: it is multiplied by the ratio of the two
    calibrations. `replaced` versions are left out, and
    so are the published runs of what the store has run itself.

    Args:
        mine: the store.
        parts: files of published runs.
        machine: the node whose runs of the store count; it may be left out if there is one.
        scale: whether times are multiplied. Without it they are as they were measured.

    Raises:
        BesideError: a machine was not calibrated, there are several, or there is nothing to take.
        ShardError: a part cannot be read.
    """
    with TemporaryDirectory(prefix="fclib-results-") as temporary:
        path = Path(temporary) / mine.name
        with Store(path) as joined:
            joined.merge([mine])
            own = joined.machines()
            limits, node, facts = _wanted(joined, own, machine, mine)
            here = calibration_in(facts)
            ratios: dict[str, Ratio] = {}
            taken = 0
            looked = [look(part) for part in parts]
            machines = Machines(looked)

            theirs = usual_limits(row for row in keys_of(looked) if kind_of(row) in limits)
            lower = {
                kind: (theirs[kind], wall)
                for kind, (limit, wall) in limits.items()
                if theirs.get(kind, math.inf) < limit
            }
            limits |= lower
            lowered = joined.lower_limits(
                {
                    row["run"]: lower[kind_of(row)][0]
                    for row in joined.table()
                    if row["node"] == node and row["time_limit"] > limits[kind_of(row)][0]
                    and kind_of(row) in lower
                }
            )  # fmt: skip

            mine_too = {
                (kind_of(row), version_of(row)) for row in joined.table() if row["node"] == node
            }

            def counts(row: Mapping[str, Any]) -> bool:
                long = row["time_limit"] >= limits.get(kind_of(row), NONE)[0]
                return bool(long) and (kind_of(row), version_of(row)) not in mine_too

            # all of them are compared under one limit
            older = replaced(
                row | {"time_limit": limits[kind_of(row)][0]}
                for row in keys_of(looked)
                if counts(row)
            )
            for part in looked:
                own_ratios = machines.ratios(part, here) if scale else {}
                ratios |= {machines.name(part, name): found for name, found in own_ratios.items()}
                rows = (
                    _scaled(row, own_ratios.get(row["node"]), node, limits[kind_of(row)])
                    for row in rows_of(part.path)
                    if counts(row) and version_of(row) not in older
                )
                taken += joined.add_rows(rows, {node: facts})
        if not taken:
            raise BesideError(
                f"{mine}: there is no published run of its problems at its tolerances, by its merit"
                " and number of threads, that it does not have itself"
            )
        yield Joined(path, taken, {k: v for k, v in ratios.items() if v.mean != 1}, lowered)


@contextmanager
def alone(parts: Iterable[Path], digests: Container[str] | None = None) -> Iterator[Joined]:
    """A temporary store with published runs alone, their times on the scale of one machine.

    This machine is the one with most runs, and its name is that of the first of the parts on ties.
    The runs of a problem to a tolerance count under the limit that most solvers had (on ties the
    larger): one that takes longer has failed, and one with a smaller limit is left out.
    `replaced` versions are left out. `digests` names the problems; without it they are all taken.

    Raises:
        BesideError: there are several machines, and one of them was not calibrated.
        ShardError: a part cannot be read, or there is none.
    """
    found = [look(part) for part in parts]
    if not any(one.runs for one in found):
        raise ShardError("no runs are published here: pip install fclib-results")
    machines = Machines(found)
    part, node = machines.most()
    facts = part.machines[node]
    ratios = {
        one.path: machines.ratios(one, calibration_in(facts), same=machines.kind(part, node))
        for one in found
    }

    def counts_here(row: Mapping[str, Any]) -> bool:
        return digests is None or row["hash"] in digests

    limits = usual_limits(filter(counts_here, keys_of(found)))
    walls: dict[tuple[Any, ...], float] = defaultdict(float)
    short: dict[str, float] = defaultdict(float)

    def fits(row: Mapping[str, Any]) -> bool:
        return counts_here(row) and row["time_limit"] >= limits[kind_of(row)]

    for row in filter(counts_here, keys_of(found)):
        if fits(row):
            walls[kind_of(row)] = max(walls[kind_of(row)], row["wall_limit"] or 0.0)
        else:
            short[row["solver"]] = max(short[row["solver"]], row["time_limit"])
    older = replaced(
        row | {"time_limit": limits[kind_of(row)]} for row in keys_of(found) if fits(row)
    )
    with TemporaryDirectory(prefix="fclib-results-") as temporary:
        path = Path(temporary) / "published.sqlite"
        with Store(path) as joined:
            rows = (
                _scaled(
                    row,
                    ratios[one.path].get(row["node"]),
                    node,
                    (limits[kind_of(row)], walls[kind_of(row)]),
                )
                for one in found
                for row in rows_of(one.path)
                if fits(row) and version_of(row) not in older
            )
            taken = joined.add_rows(rows, {node: facts})
        named = {
            machines.name(one, name): ratio
            for one in found
            for name, ratio in ratios[one.path].items()
        }
        yield Joined(path, taken, named, short=short)


Kind: TypeAlias = tuple[str, Calibration | None]


class Machines:
    """The machines of some parts. Two of the same name are two if their calibrations differ.

    A machine that is published by the name of its processor may be another one in each part.
    """

    def __init__(self, parts: Sequence[Shard]) -> None:
        self._parts = parts
        self._kinds: list[Kind] = []
        for part in parts:
            for name, facts in part.machines.items():
                kind = name, calibration_in(facts)
                if kind not in self._kinds:
                    self._kinds.append(kind)

    def kind(self, part: Shard, node: str) -> Kind:
        """What makes it another machine."""
        return node, calibration_in(part.machines[node])

    def name(self, part: Shard, node: str) -> str:
        """Its name, with a number if there are several of this name."""
        same = [one for one in self._kinds if one[0] == node]
        return node if len(same) == 1 else f"{node} ({same.index(self.kind(part, node)) + 1})"

    def most(self) -> tuple[Shard, str]:
        """The machine that has most runs: a part that has it, and its node there."""
        counts: Counter[int] = Counter()
        where: dict[int, tuple[Shard, str]] = {}
        for part in self._parts:
            for node, runs in Counter(row["node"] for row in rows_of(part.path, ("node",))).items():
                number = self._kinds.index(self.kind(part, node))
                counts[number] += runs
                where.setdefault(number, (part, node))
        ((most, _),) = counts.most_common(1)
        return where[most]

    def ratios(
        self, part: Shard, here: Calibration | None, same: Kind | None = None
    ) -> dict[str, Ratio]:
        """The factor of the times of each machine of a part, but for the machine `same`."""
        others = {
            name: facts for name, facts in part.machines.items() if self.kind(part, name) != same
        }
        return _ratios(here, others, part.path)


KIND = ("hash", "tol", "merit", "start", "sequence", "step", "threads")
SOLVER = ("solver", "options")
VERSION = (*SOLVER, "version", "memory_limit")


def kind_of(row: Mapping[str, Any]) -> tuple[Any, ...]:
    """What two runs have in common that may be compared."""
    return tuple(row[name] for name in KIND)


def version_of(row: Mapping[str, Any]) -> tuple[Any, ...]:
    """The solver of a run, its options, its version and its limit of memory."""
    return tuple(row[name] for name in VERSION)


def usual_limits(rows: Iterable[Mapping[str, Any]]) -> dict[tuple[Any, ...], float]:
    """The limit of CPU time [s] of each kind of runs: that of most solvers, on ties the larger."""
    solvers: dict[tuple[Any, ...], dict[float, set[str]]] = defaultdict(lambda: defaultdict(set))
    for row in rows:
        solvers[kind_of(row)][row["time_limit"]].add(row["solver"])
    return {
        kind: max(found, key=lambda limit: (len(found[limit]), limit))
        for kind, found in solvers.items()
    }


def replaced(rows: Iterable[Mapping[str, Any]]) -> set[tuple[Any, ...]]:
    """The versions of solvers that a comparison leaves out, as `version_of` names them.

    Another version of the solver, with the same options, has run the same problems to the same
    tolerances, under no smaller limits of time. It is later, or it has run more.
    """
    limits: dict[tuple[Any, ...], dict[tuple[Any, ...], float]] = defaultdict(dict)
    last: dict[tuple[Any, ...], float] = defaultdict(float)
    for row in rows:
        own, kind = limits[version_of(row)], kind_of(row)
        own[kind] = max(row["time_limit"], own.get(kind, 0.0))
        last[version_of(row)] = max(row["started"] or 0.0, last[version_of(row)])
    return {
        one
        for one, theirs in limits.items()
        if any(
            other[: len(SOLVER)] == one[: len(SOLVER)]
            and (len(own), last[other]) > (len(theirs), last[one])
            and all(own.get(kind, 0.0) >= limit for kind, limit in theirs.items())
            for other, own in limits.items()
        )
    }


def keys_of(parts: Iterable[Shard]) -> Iterator[dict[str, Any]]:
    """What `replaced` reads of the runs of parts."""
    names = (*KIND, *VERSION, "time_limit", "wall_limit", "started")
    return (row for part in parts for row in rows_of(part.path, names))


def _wanted(
    store: Store, machines: Mapping[str, Mapping[str, Any]], machine: str | None, mine: Path
) -> tuple[dict[tuple[Any, ...], tuple[float, float]], str, Mapping[str, Any]]:
    """The limits of the runs of a machine by their kinds, its node, and its facts."""
    runs = list(store.table())
    nodes = sorted({str(row["node"]) for row in runs})
    node = machine or (nodes[0] if len(nodes) == 1 else "")
    if not nodes:
        raise BesideError(f"{mine}: has no run")
    if node not in nodes:
        what = f"has no run of {node}" if machine else "has runs of several machines"
        raise BesideError(f"{mine}: {what}; choose one by --machine: {', '.join(nodes)}")
    own = [row for row in runs if row["node"] == node]
    known = [machines[row["machine"]] for row in own]
    # a machine that was calibrated later is the same machine
    facts = next((one for one in reversed(known) if calibration_in(one)), known[0])
    limits: dict[tuple[Any, ...], tuple[float, float]] = {}
    for row in own:  # the largest, as in a comparison
        found = row["time_limit"], row["wall_limit"]
        limits[kind_of(row)] = max(found, limits.get(kind_of(row), found))
    return limits, node, facts


def _ratios(
    here: Calibration | None, machines: Mapping[str, Mapping[str, Any]], part: Path
) -> dict[str, Ratio]:
    """The factor of the times of each machine of a part."""
    found = {}
    for name, theirs in machines.items():
        other = calibration_in(theirs)
        if here is None:
            raise BesideError(f"the machine of the runs was not calibrated: {REMEDY}")
        if other is None:
            raise ShardError(f"{part}: the machine {name} was not calibrated")
        try:
            found[name] = ratio_of(here, other)
        except ValueError as error:
            raise BesideError(f"{part}: {error}; {REMEDY}") from None
    return found


def _scaled(
    row: Mapping[str, Any], ratio: Ratio | None, node: str, limits: tuple[float, float]
) -> dict[str, Any]:
    """A published run as one of this machine, under limits of CPU time and of the clock [s]."""
    factor = 1.0 if ratio is None else ratio.mean
    times = {name: None if row[name] is None else factor * row[name] for name in TIMES}
    here = {**row, **times, "node": node, "time_limit": limits[0], "wall_limit": limits[1]}
    if row["solved"] and (here["cpu_s"] or 0.0) > limits[0]:
        return here | {"status": "time_limit", "solved": 0}
    return here
