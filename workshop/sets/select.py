"""The set `standard`: problems of all families, few of a kind, chosen by features.

In the manner of MIPLIB 2017 (Gleixner et al., "MIPLIB 2017: data-driven compilation of the 6th
mixed-integer programming library", 2021): features describe the candidates, those of their data and
those of the behaviour of solvers (`features.py`). The candidates are clustered, and an integer
program chooses. It takes problems of as many clusters as it can, few of each, within bounds for
each family and for each class of sizes. Among equal choices it takes problems nearest to the
middles of their clusters. If a lower bound cannot be met together with the others, as few problems
as possible are lacking.

The table of features of all candidates is stored: the choice follows from it alone, without the
problems.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from fclib import _digest, scenes
from fclib.collections import catalog, set_index, trajectory
from fclib.collections.set_index import Choice
from workshop.sets import features
from workshop.sets.candidates import Candidates

Progress = Callable[[str, int, int], None]

# number of contacts from which a class of sizes begins, and the class's share of the set
SIZES: Final = (
    (1, 0.1, 0.25),
    (10, 0.15, 0.3),
    (50, 0.15, 0.3),
    (200, 0.15, 0.3),
    (1000, 0.1, 0.15),
)
CONTACTS: Final = 20_000  # largest number in a candidate
ENTRIES: Final = 1_000_000  # largest number of entries of its M
IDENTITY: Final = ("family", "number", "digest", "nearly_equal")


@dataclass(frozen=True)
class Rule:
    """The numbers of problems to choose, by kind."""

    problems: int = 240
    clusters: int = 160
    per_cluster: int = 3  # largest number from a cluster
    least: int = 3  # least number from a family, if it has so many
    most: int = 10

    def record(self) -> dict[str, Any]:
        """The rule in JSON's types, with the constants of this file."""
        return {
            "problems": self.problems,
            "clusters": self.clusters,
            "per_cluster": self.per_cluster,
            "per_family": [self.least, self.most],
            "sizes": [list(size) for size in SIZES],
            "near": features.NEAR,
            "solvers": dict(features.SOLVERS),
            "tol": features.TOLERANCE,
        }


# ---- the table of candidates


def described(found: Candidates, progress: Progress | None = None) -> list[dict[str, Any]]:
    """A row of features for each candidate of a family; near copies are left out."""
    name = found.plan.scene.name

    def matrices() -> Iterable[tuple[int, features.Matrix]]:
        for number, problem in found.problems():
            if problem.nc <= CONTACTS and getattr(getattr(problem, "M", None), "nnz", 0) <= ENTRIES:
                yield number, features.Matrix(problem)

    kept = features.thinned(matrices())
    left_out = len(found.numbers) - len(kept)
    rows = []
    for done, (number, matrix) in enumerate(kept):
        if progress is not None:
            progress(name, done + 1, len(kept))
        rows.append(
            {
                "family": name,
                "number": number,
                "digest": _digest.digest(matrix.problem),
                "nearly_equal": left_out,
            }
            | features.structure(matrix, found.plan.scene)
            | features.behaviour(matrix)
        )
    return rows


def write_table(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows as a table, numbers with six digits: further digits differ by machine."""
    text = io.StringIO()
    names = list(dict.fromkeys(key for row in rows for key in row))
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    for row in sorted(rows, key=lambda row: (row["family"], row["number"])):
        writer.writerow(
            {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items() if v is not None}
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    catalog.replace_file(path, lambda beside: beside.write_text(text.getvalue(), encoding="utf-8"))


def read_table(path: Path) -> list[dict[str, Any]]:
    """Read a table that `write_table` has written. Raises OSError, ValueError."""
    with path.open(newline="", encoding="utf-8") as file:
        return [
            {
                key: value if key in ("family", "digest") else float(value) if value else None
                for key, value in row.items()
            }
            | {"number": int(row["number"])}
            for row in csv.DictReader(file)
        ]


def describes(rows: Sequence[Mapping[str, Any]], found: Candidates) -> bool:
    """Whether rows of a table belong to a family's present candidates."""
    if not rows:
        return False
    for row in rows[:: max(1, len(rows) - 1)]:
        number = int(row["number"])
        if number not in found.numbers:
            return False
        if _digest.digest(found.problem(number)) != row["digest"]:
            return False
    return True


# ---- the choice


def choose(
    rows: Sequence[Mapping[str, Any]], rule: Rule, kept: Collection[tuple[str, int]] = ()
) -> list[int]:
    """The rows that are chosen, in order.

    Args:
        rows: rows of the table.
        rule: the numbers of problems, by kind.
        kept: (family, number) that are taken; no others of their families are.

    Raises:
        ValueError: no choice is within the bounds.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp

    everything = [dict(row) for row in rows]
    place = features.points(everything)
    cluster = clusters(place, rule.clusters)
    count, groups = len(rows), int(cluster.max()) + 1
    middle = np.array([place[cluster == k].mean(axis=0) for k in range(groups)])
    distance = np.linalg.norm(place - middle[cluster], axis=1)

    family = np.array([str(row["family"]) for row in everything])
    contacts = np.array([float(row["nc"]) for row in everything])
    held = np.array([(str(row["family"]), int(row["number"])) in kept for row in everything])
    # rows that are decided already
    decided = held | np.isin(family, [name for name, _ in kept])
    # for each bound: the rows that count, the least and the largest number
    kinds = [(family == name, rule.least, rule.most) for name in np.unique(family)]
    edges = [least for least, *_ in SIZES] + [np.inf]
    for k, (least, low, high) in enumerate(SIZES):
        own = (contacts >= least) & (contacts < edges[k + 1])
        kinds.append((own, round(low * rule.problems), round(high * rule.problems)))

    # unknowns: whether a row is taken, whether its cluster is met, and how many of a kind are
    # lacking
    columns = count + groups + len(kinds)
    member = cluster[None, :] == np.arange(groups)[:, None]

    def total(own: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
        """The number of rows taken from some."""
        return np.concatenate([own, np.zeros(columns - count)]).astype(float)

    met = np.hstack([member, -np.eye(groups), np.zeros((groups, len(kinds)))])
    constraints = [
        LinearConstraint(total(np.ones(count)), rule.problems, rule.problems),
        LinearConstraint(met, lb=0),
    ]
    for own in member:
        constraints.append(LinearConstraint(total(own), 0, max(rule.per_cluster, held[own].sum())))
    for k, (own, wanted, most) in enumerate(kinds):
        lacking = total(own)
        constraints.append(LinearConstraint(lacking.copy(), 0, max(most, held[own].sum())))
        lacking[count + groups + k] = 1
        constraints.append(LinearConstraint(lacking, lb=min(wanted, own.sum())))
    # a lacking problem costs as much as a cluster that is not met; both cost more than any distance
    cost = np.concatenate([distance / (1 + distance.sum()), -np.ones(groups), np.ones(len(kinds))])
    solved = milp(
        cost,
        constraints=constraints,
        integrality=np.ones(columns),
        bounds=Bounds(
            np.concatenate([held, np.zeros(columns - count)]),
            np.concatenate([held | ~decided, np.ones(groups), np.full(len(kinds), np.inf)]),
        ),
    )
    if solved.x is None:
        raise ValueError(f"no choice of {rule.problems} problems is within the bounds: {rule}")
    return [int(k) for k in np.flatnonzero(solved.x[:count] > 0.5)]


def clusters(place: features.Array, most: int) -> npt.NDArray[np.int64]:
    """The cluster of each point, 0, 1, ...; by Ward's method, which widens clusters least."""
    from scipy.cluster.hierarchy import fcluster, linkage

    if len(place) == 1:
        return np.zeros(1, dtype=np.int64)
    return np.asarray(fcluster(linkage(place, "ward"), most, "maxclust") - 1, dtype=np.int64)


# ---- how a choice is stored


def choices_of(
    sources: Mapping[str, Candidates], rows: Sequence[Mapping[str, Any]]
) -> list[Choice]:
    """Rows of the table in the format of a list."""
    chosen = []
    for row in rows:
        found, number = sources[row["family"]], int(row["number"])
        scene = found.plan.scene
        step = number
        if found.states is not None:
            step = int(found.states.step[found.states.index(number)])
        parameters = dict(scene.parameters)
        chosen.append(Choice(scene.name, parameters, scene.seed or 0, number, step, row["digest"]))
    return chosen


def sources_of(folder: Path, names: Collection[str]) -> dict[str, Candidates]:
    """The origin of the problems of a built folder: the stored states of each family.

    Raises:
        CatalogError: the folder has no catalogue.
        VersionError: the states of a family are not stored here.
        OSError, TrajectoryError: the states cannot be read.
    """
    found = {}
    for row in catalog.read_catalog(folder).to_pylist():
        name = row["family"]
        if name not in names or name in found:
            continue
        own = f"{row['collection']}/{name}"
        assembled = name in scenes.assemblies()
        plan = set_index.plan_of(own, version=None if assembled else row["version"])
        states = None if plan.trajectory is None else trajectory.read(plan.trajectory)
        numbers = plan.numbers().tolist()
        found[name] = Candidates(plan, tuple(numbers), states)
    return found


def publish(
    sources: Mapping[str, Candidates],
    choices: Sequence[Choice],
    name: str,
    version: str,
    folder: Path,
) -> list[Path]:
    """Store the states of chosen problems as those of a set.

    A family whose problems are stored already, in any version, is left as it is. Raises OSError.
    """
    written = []
    for family, found in sources.items():
        own = {choice.number: choice.digest for choice in choices if choice.family == family}
        if found.states is None or not own:
            continue
        there = sorted((folder / name).glob(f"{family}-*{trajectory.SUFFIX}"))
        if any(trajectory.read_digests(path) == own for path in there):
            continue
        target = folder / name / f"{family}-{version}{trajectory.SUFFIX}"
        trajectory.write(target, trajectory.part(found.states, own, name, version))
        written.append(target)
    return written
