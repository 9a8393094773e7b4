"""A part of the published runs: a file that is written once, and named by its content.

It is a Parquet file with a row for each run and the columns of a store's `results`, so that any
program reads it. Paths of the machine stay out of it. Its metadata have the facts of the machines,
with their calibrations, and the names of the campaigns. A part that somebody submits also has the
solutions of a sample: the columns of `VECTORS`, doubles in little endian.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import re
import time
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any, Final

import numpy as np

from fclib import _core
from fclib._files import write_bytes
from fclib._regular import reason_of, regular
from fclib._verdicts import is_solved
from fclib.bench.job import STATUSES
from fclib.bench.layout import CAMPAIGN, HISTORY, columns
from fclib.bench.store import LONG, Store
from fclib.bench.table import TEXTS, WHOLE
from fclib.collections.catalog import arrow, sha256

ABOUT: Final = b"fclib.results"  # key of the metadata
VERSION: Final = 1
DIGITS: Final = 16  # digits of the file's SHA-256 in its name
NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
# columns that each run has
NEEDED: Final = (
    *("key", "problem", "hash", "nc", "solver", "solver_name", "options", "version", "origin"),
    *("tol", "merit", "time_limit", "wall_limit", "threads", "repeat", "start", "started"),
    *("status", "solved", "node"),
)
MERITS: Final = ("both", "natural")
STARTS: Final = ("cold", "warm")
# these are finite and not negative, if a run has them
MEASURED: Final = (
    *("cpu_s", "said_cpu_s", "setup_s", "total_cpu_s", "wall_s"),
    *("error", "natural", "scaled_natural", "started"),
)
COARSE: Final = 1e-3  # [s] by which clocks may differ
AHEAD: Final = 86400.0  # [s] by which a clock may be ahead
# what makes two runs the same one, whatever their keys say
RUN: Final = (
    *("hash", "tol", "merit", "start", "sequence", "step", "threads", "repeat", "copy"),
    *(
        "solver",
        "options",
        "version",
        "time_limit",
        "wall_limit",
        "memory_limit",
        "node",
        "measured",
    ),
)
PART: Final = re.compile(rf"(.+)-([0-9a-f]{{{DIGITS}}})\.parquet")
LEFT: Final = ("run", "campaign", "machine", "message")  # mean nothing elsewhere, or name paths
REPORTS: Final = (
    32  # reports of a run that are published, evenly over the logarithm of their number
)
VECTORS: Final = ("r", "l")  # columns of a part with solutions: reactions, multipliers
SAMPLE: Final = 50  # solutions in a part at most, evenly spread
# what may name a person's machine
PRIVATE: Final = ("node", "system")


class ShardError(_core.Error, ValueError):
    """A file is no part of published runs, or is damaged."""


@dataclass(frozen=True)
class Shard:
    """A part, and what its metadata say."""

    path: Path
    name: str
    runs: int
    machines: Mapping[str, Mapping[str, Any]]  # facts by the name of the machine
    campaigns: Sequence[Mapping[str, Any]]

    @property
    def digest(self) -> str:
        """The digits of its content that its name has."""
        found = PART.fullmatch(self.path.name)
        return found[2] if found else ""


def shards(where: Path) -> list[Shard]:
    """The parts of a folder, by their names. ShardError if one is damaged; ImportError."""
    return [look(path) for path in sorted(where.glob("*.parquet"))]


def look(path: Path) -> Shard:
    """What the metadata of a part say.

    Raises:
        ShardError: it is no part.
        ImportError: pyarrow is missing.
    """
    pa = arrow()
    try:
        file = pa.parquet.ParquetFile(regular(path))
        _require_columns(path, file.schema_arrow)
        about = json.loads((file.schema_arrow.metadata or {})[ABOUT])
        found = PART.fullmatch(path.name)
        name = found[1] if found else path.stem
        if about["version"] != VERSION:
            raise ShardError(f"{path}: is of version {about['version']}, and {VERSION} is read")
        machines = {str(key): dict(value) for key, value in about["machines"].items()}
        campaigns = [dict(one) for one in about["campaigns"]]
        return Shard(path, name, file.metadata.num_rows, machines, campaigns)
    except (OSError, pa.ArrowException) as error:
        reason = reason_of(error)
        raise ShardError(f"{path}: cannot be read as published runs: {reason}") from None
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        if isinstance(error, ShardError):
            raise
        raise ShardError(f"{path}: is no part of published runs") from None


def types() -> dict[str, Any]:
    """The columns of a part and their types of Arrow, in their order."""
    pa = arrow()
    kinds = {"iteration": pa.int64(), "stage": pa.string()}
    report = pa.struct([(name, kinds.get(name, pa.float64())) for name in HISTORY])
    found = {
        name: pa.string() if name in TEXTS else pa.int64() if name in WHOLE else pa.float64()
        for name in columns()
        if name not in LEFT
    }
    return {**found, "kind": pa.string(), "history": pa.list_(report)}


def _require_columns(path: Path, schema: Any) -> None:
    """ShardError if a part lacks a column of results, or has it in another type."""
    for name, wanted in types().items():
        if name not in schema.names:
            raise ShardError(f"{path}: is no part of published runs, it has no column {name!r}")
        if schema.field(name).type != wanted:
            kind = schema.field(name).type
            raise ShardError(f"{path}: column {name!r}: is of type {kind}, and {wanted} is read")


def public_name(solver: str) -> str:
    """The name of a solver without the folders of a program or a plug-in."""
    scheme, colon, rest = solver.partition(":")
    if scheme not in ("cmd", "plugin") or not colon:
        return solver
    return f"{scheme}:{PurePath(rest.split()[0]).name if rest.split() else ''}"


def pack(
    store: Store,
    where: Path,
    name: str,
    machine: str = "",
    there: Iterable[Shard] = (),
    *,
    solutions: bool = False,
) -> Path | None:
    """Write the runs of a store that no part has yet as a new part.

    Args:
        store: its damaged rows are left out.
        where: folder of the parts.
        name: of the part, as "standard".
        machine: the name under which the machine is published; its host name stays private. By
            default the model of its processor.
        there: parts whose runs are not packed again.
        solutions: whether it has the solutions of a sample, as far as the store has them.

    Returns:
        The file; None if there is no new run.

    Raises:
        ShardError: the name is none, or the runs are of several machines.
        ImportError: pyarrow is missing.
    """
    if not NAME.fullmatch(name):
        raise ShardError(f"{name!r}: is no name of a part: use letters, digits, . _ -")
    pa = arrow()
    known = {
        (row["key"], row["node"]) for one in there for row in rows_of(one.path, ("key", "node"))
    }
    # what `unpack` has put there is published, under the name that its machine has in the store
    new = [row for row in store.table(more=LONG) if (row["key"], row["node"]) not in known]
    there_now = {row["machine"] for row in new}
    own = {key: facts for key, facts in store.machines().items() if key in there_now}
    nodes = sorted({str(facts.get("node")) for facts in own.values()})
    if machine and len(nodes) > 1:
        raise ShardError(
            f"{store.path}: has runs of {len(nodes)} machines, which need a name each: pack the"
            " store of each machine"
        )
    public = names_of(own, machine)
    kinds = store.kinds()
    rows = []
    kept = sampled(store) if solutions else set()
    for row in new:
        label = public[row["machine"]]
        if (row["key"], label) in known:
            continue
        vectors = store.solution(row["run"]) if row["run"] in kept else {}
        history = thinned(store.history(row["run"]))
        mine = {key: value for key, value in row.items() if key not in LEFT}
        rows.append(
            mine
            | {"solver_name": public_name(str(row["solver_name"]))}
            | {"node": label, "kind": kinds.get(row["hash"], ""), "history": history or None}
            | {name: vectors[name].astype("<f8").tobytes() for name in VECTORS if name in vectors}
        )
    if not rows:
        return None
    machines = {
        public[key]: {k: v for k, v in facts.items() if k not in PRIVATE}
        for key, facts in own.items()
    }
    campaigns = [
        {key: one[key] for key in CAMPAIGN if key not in ("pid", "node", "seen", "text")}
        for one in store.campaigns()
    ]
    about = {"version": VERSION, "machines": machines, "campaigns": campaigns}
    metadata = {ABOUT: json.dumps(about, sort_keys=True)}
    columns = types() | (dict.fromkeys(VECTORS, pa.binary()) if solutions else {})
    table = pa.Table.from_pylist(rows, schema=pa.schema(list(columns.items()), metadata=metadata))
    where.mkdir(parents=True, exist_ok=True)
    content = io.BytesIO()
    pa.parquet.write_table(table, content, compression="zstd")
    digest = hashlib.sha256(content.getbuffer()).hexdigest()
    path = where / f"{name}-{digest[:DIGITS]}.parquet"
    write_bytes(path, content.getvalue())
    return path


def names_of(machines: Mapping[str, Mapping[str, Any]], name: str = "") -> dict[str, str]:
    """The name under which each machine is published: the model of its processor.

    Further machines of one model have numbers. One that was calibrated later is the same machine.
    """
    if name:
        return dict.fromkeys(machines, name)
    nodes: dict[str, list[str]] = defaultdict(list)  # of each model
    for facts in machines.values():
        node, own = str(facts.get("node")), nodes[str(facts.get("cpu") or "?")]
        if node not in own:
            own.append(node)
    found = {}
    for key, facts in machines.items():
        model = str(facts.get("cpu") or "?")
        own = nodes[model]
        number = own.index(str(facts.get("node"))) + 1
        found[key] = model if number == 1 else f"{model} ({number})"
    return found


def unpack(parts: Iterable[Shard], store: Store) -> int:
    """Put the runs of parts into a store, so that a campaign goes on from there.

    The campaign does not repeat them, on whatever machine it runs. Their machines keep their names.

    Returns:
        The number of runs that the store did not have.

    Raises:
        ShardError: a part cannot be read.
    """
    return sum(store.add_rows(rows_of(one.path), one.machines) for one in parts)


def thinned(history: Sequence[Sequence[Any]]) -> list[dict[str, Any]]:
    """Some reports of a run, with the last one; numbers in single precision, which is smaller."""
    count = len(history)
    spaced = np.geomspace(1, max(1, count), REPORTS).round().astype(int) - 1
    chosen = range(count) if count <= REPORTS else sorted({0, count - 1, *spaced.tolist()})
    return [
        {
            name: float(np.float32(value)) if isinstance(value, float) else value
            for name, value in zip(HISTORY, history[k], strict=True)
        }
        for k in chosen
    ]


def sampled(store: Store) -> set[int]:
    """The numbers of some runs whose solutions are stored, evenly spread over the store."""
    there = store.with_solutions()
    count = min(SAMPLE, len(there))
    return {there[k * len(there) // count] for k in range(count)}


def rows_of(path: Path, chosen: Sequence[str] | None = None) -> Iterator[dict[str, Any]]:
    """The rows of a part, one after another. ShardError if one cannot be read."""
    pa = arrow()
    try:
        file = pa.parquet.ParquetFile(regular(path))
        for batch in file.iter_batches(columns=list(chosen) if chosen else None):
            yield from batch.to_pylist()
    except (OSError, pa.ArrowException) as error:
        reason = reason_of(error)
        raise ShardError(f"{path}: cannot be read as published runs: {reason}") from None


def verify(path: Path) -> list[str]:
    """What is wrong with a part: its name, its rows, and what they say; empty if nothing is.

    Raises:
        ShardError: it cannot be read at all.
    """
    own = look(path)
    found = PART.fullmatch(path.name)
    wrong = []
    if found is None:
        wrong.append("the name is not NAME-DIGEST.parquet")
    elif sha256(path)[:DIGITS] != found[2]:
        wrong.append(f"the content is {sha256(path)[:DIGITS]}, and the name says {found[2]}")
    if not own.runs:
        wrong.append("it has no run")
    keys: set[tuple[Any, ...]] = set()
    runs: set[tuple[Any, ...]] = set()
    said: dict[str, set[str]] = defaultdict(set)  # the verdicts on each problem
    for number, row in enumerate(rows_of(path)):
        where = f"row {number}"
        key, run = (row["key"], row["node"]), tuple(row[name] for name in RUN)
        if key in keys or run in runs:
            wrong.append(f"{where}: the run {key[0]} is there twice")
        keys.add(key)
        runs.add(run)
        if row["node"] not in own.machines:
            wrong.append(f"{where}: is of a machine that the metadata lack: {row['node']}")
        if is_solved(row["status"]):
            said[row["hash"]].add(row["status"])
        wrong += [f"{where}: {word}" for word in contradictions(row)]
    wrong += [
        f"problem {digest}: is solved by some runs, and by others proven to have no solution"
        for digest, statuses in said.items()
        if len(statuses) > 1
    ]
    unused = own.machines.keys() - {node for _, node in keys}
    return wrong + [f"the metadata have a machine of no run: {name}" for name in sorted(unused)]


def twice(paths: Iterable[Path]) -> list[str]:
    """The runs that several parts have: which of them counts would depend on the order of files."""
    first: dict[tuple[Any, ...], Path] = {}
    wrong = []
    for path in paths:
        # a processor is the name of a machine: another one has other times for the calibration
        calibrations = {
            node: json.dumps(facts.get("calibration"), sort_keys=True)
            for node, facts in look(path).machines.items()
        }
        for row in rows_of(path, ("key", *RUN)):
            run = *(row[name] for name in RUN), calibrations.get(row["node"])
            other = first.setdefault(run, path)
            if other != path:
                wrong.append(f"{path}: the run {row['key']} is in {other.name} too")
    return wrong


def error_of(row: Mapping[str, Any]) -> float | None:
    """The error of a run that its tolerance bounds."""
    error: float | None = row["error" if row["merit"] == "both" else "natural"]
    return error


def contradictions(row: Mapping[str, Any]) -> list[str]:
    """What is missing in a run, or contradicts itself."""
    wrong = [f"has no {name}" for name in NEEDED if row[name] is None]
    if wrong:
        return wrong
    error, tol, limit = error_of(row), row["tol"], row["time_limit"]
    known: Collection[Any]
    for name, known in (
        *(("merit", MERITS), ("start", STARTS), ("status", STATUSES), ("solved", (0, 1))),
    ):
        if row[name] not in known:
            wrong.append(f"{name} is {row[name]!r}, which is none of {', '.join(map(str, known))}")
    for name in ("tol", "time_limit", "wall_limit"):
        if not 0 < row[name] < math.inf:
            wrong.append(f"{name} is {row[name]}")
    for name in MEASURED:
        value = row[name]
        if value is not None and not (0 <= value < math.inf):
            wrong.append(f"{name} is {value}")
    if wrong:
        return wrong
    if row["status"] == "converged" and not (error is not None and error <= tol):
        wrong.append(f"is converged, and its error {error} is not within {tol}")
    solved = is_solved(row["status"])
    if bool(row["solved"]) != solved:
        wrong.append(f"has the status {row['status']}, and solved is {row['solved']}")
    cpu, whole = row["cpu_s"], row["total_cpu_s"]
    if solved and not (cpu is not None and cpu <= limit):
        wrong.append(f"is solved in {cpu} s, and its limit is {limit:g} s")
    if cpu is not None and whole is not None and cpu > whole + COARSE + COARSE * whole:
        wrong.append(f"cpu_s is {cpu}, and more than total_cpu_s, which is {whole}")
    if row["started"] > time.time() + AHEAD:
        wrong.append(f"was started at {row['started']:.0f} s since 1970, which is to come")
    if row["solver"] in _core.fingerprints() and row["solver_name"] != row["solver"]:
        wrong.append(f"calls {row['solver_name']} {row['solver']}, which is another solver")
    return wrong
