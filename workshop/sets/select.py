"""The sets `standard`, `hard` and `open`: chosen by what solvers do on candidates.

In the manner of MIPLIB 2017 (Gleixner et al., "MIPLIB 2017: data-driven compilation of the 6th
mixed-integer programming library", 2021). The choice follows from a table with a row for each
candidate: features of its data, and the cost of each solver under two limits. So anybody repeats it
without the problems and without a run, and equal tables give equal choices.

1. A candidate is left out if it has the same data as an earlier one, if it is nearly the same in
   the space of features (`features.NEAR`), if it is trivial (r = 0 is a solution, or `nsgs` takes
   at most SWEEPS sweeps), or if it is too large. Of what stays, MEASURED of a family are measured:
   those that are farthest apart. If many of these may be hard, FURTHER ones are measured; they are
   for `hard` and `open` alone.
2. `standard`: the candidates that stay are clustered. An integer program takes problems of as many
   clusters as it can, within the bounds of `Rule`. If a lower bound cannot be met together with the
   others, as little as possible is lacking, and it is told. Among equal choices it takes problems
   nearest to the middles of their clusters.
3. `hard`: of what `standard` leaves, at most half of the solvers solve it within the longer limit,
   or none does and somebody else has. Those that the smallest share solves come first, then the
   slowest.
4. `open`: nobody has solved it, or proved that it has no solution.
"""

from __future__ import annotations

import csv
import io
import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from fclib import _digest, _solve
from fclib._files import write_text
from fclib._judge import TOLERANCE, trivial
from fclib.collections import catalog, ratings, trajectory
from fclib.collections.build import facts_of, guess_for, item_of
from fclib.collections.set_index import Choice
from workshop.sets import features
from workshop.sets.candidates import Candidates

Progress = Callable[[str, int, int], None]
Row = Mapping[str, Any]

CONTACTS: Final = 200_000  # largest number in a candidate; 10 s of CPU are ten products with W
ENTRIES: Final = 5_000_000  # largest number of entries of its M
SWEEPS: Final = 20  # a problem that nsgs solves with no more sweeps is trivial
# Largest number of problems of a family that are measured. Sets take at most six. Each costs up to
# 160 s: a run of 10 s by eight solvers, and one of its copy by those that solve it.
MEASURED: Final = 8
FURTHER: Final = 8  # and so many more of a family that has hard ones
SHORT, LONG = 10.0, 60.0  # [s] of CPU a run, the two limits
TEXTS: Final = (
    *("problem", "label", "scene", "digest", "law", "left_out", "best_by", "proof", "set", "why"),
)
SETS: Final = ("standard", "hard", "open")
# number of contacts from which a class of sizes begins, and its least and largest share
SIZES: Final = (
    (1, 0.1, 0.2),
    (11, 0.2, 0.3),
    (101, 0.25, 0.4),
    (1_001, 0.1, 0.25),
    (10_001, 0.02, 0.1),
)
# law of friction, whether bodies move in a plane, and the least and the largest share
LAWS: Final = (
    ("Coulomb", False, 0.5, 0.8),
    ("Coulomb", True, 0.05, 0.15),
    ("rolling", False, 0.08, 0.2),
    ("rolling", True, 0.02, 0.1),
    ("none", False, 0.0, 0.02),
    ("none", True, 0.0, 0.02),
)


@dataclass(frozen=True)
class Rule:
    """The numbers of problems to choose, by kind."""

    standard: int = 240
    hard: int = 100
    most: int = 6  # largest number of a family in a set
    clusters: int = 160
    per_cluster: int = 3  # largest number of a cluster
    few: float = 0.25  # a problem is difficult if a smaller share of the solvers solves it
    difficult: int = 30  # least number of such problems in standard
    difficult_share: float = 0.25  # and their largest share: the others are for `hard`
    hard_share: float = 0.5  # a problem is hard if at most this share of the solvers solves it
    further_share: float = 0.25  # least share of a family's measured ones that may be hard
    quick: float = 0.01  # [s] a problem is quick if all solvers solve it within this time
    quick_share: float = 0.1  # largest share of them
    balance: float = 0.1  # each solver but the best and the worst solves and fails so many

    def record(self) -> dict[str, Any]:
        """The rule in JSON's types, with the constants of this file."""
        return asdict(self) | {
            "sizes": [list(size) for size in SIZES],
            "laws": [list(law) for law in LAWS],
            "sweeps": SWEEPS,
            "near": features.NEAR,
            "limits": [SHORT, LONG],
            "tol": TOLERANCE,
        }


# ---- the table of candidates


def described(found: Candidates, progress: Progress | None = None) -> list[dict[str, Any]]:
    """A row for each candidate of a family: its features, or why it is left out by itself."""
    rows = []
    for done, number in enumerate(found.numbers, 1):
        problem = found.problem(number)
        facts = facts_of(problem)
        row: dict[str, Any] = {
            "problem": f"{found.plan.name}/{number:04d}",
            "label": found.label,
            "scene": found.plan.scene.name,
            "number": number,
            "digest": _digest.digest(problem),
            "law": facts["law"],
            "nc": problem.nc,
        }
        entries = int(getattr(getattr(problem, "M", None), "nnz", 0))
        if problem.nc > CONTACTS or entries > ENTRIES:
            words = f"too large: {problem.nc} contacts, {entries} entries of M"
            rows.append(row | {"left_out": words})
        else:
            matrix = features.Matrix(problem)
            row |= features.structure(matrix, found.plan.scene)
            rows.append(row | {"left_out": why_trivial(matrix.local)})
        if progress is not None:
            progress(found.plan.name, done, len(found.numbers))
    return rows


def why_trivial(local: Any) -> str:
    """Why a problem tells no solver from another; empty if it may."""
    if (words := trivial(local)) is not None:
        return f"trivial: {words}"
    result = _solve.solve(local, "nsgs", TOLERANCE, max_iterations=SWEEPS)
    return f"trivial: nsgs solves it, sweeps: {result.iterations}" if result.converged else ""


def write_table(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as a table, numbers with six digits: further digits differ by machine."""
    text = io.StringIO()
    rows = sorted(rows, key=lambda row: str(row["problem"]))
    names = list(dict.fromkeys(key for row in rows for key in row))
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow(
            {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items() if v is not None}
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text.getvalue())


def read_table(path: Path) -> list[dict[str, Any]]:
    """Read a table that `write_table` has written. Raises OSError, ValueError."""
    with path.open(newline="", encoding="utf-8") as file:
        return [
            {
                key: (value or "") if key in TEXTS else float(value) if value else None
                for key, value in row.items()
            }
            | {"number": int(row["number"])}
            for row in csv.DictReader(file)
        ]


def describes(rows: Sequence[Row], found: Candidates) -> bool:
    """Whether rows of a table are those of a family's present candidates."""
    if [int(row["number"]) for row in rows] != list(found.numbers):
        return False
    ends = {0, len(rows) - 1}
    return all(
        _digest.digest(found.problem(int(rows[k]["number"]))) == rows[k]["digest"] for k in ends
    )


def not_measured(rows: Sequence[Row], rule: Rule | None = None) -> list[str]:
    """Why each candidate is not measured; empty for those that are.

    With a rule, further ones are measured of the families that have hard ones.
    """
    data = left_out(rows)
    found = farthest_of(rows, data, {})
    if rule is None:
        return found
    tried: Counter[str] = Counter()
    hard: Counter[str] = Counter()
    for row, words in zip(rows, found, strict=True):
        if not words and share_solved(row, SHORT) is not None:
            tried[row["scene"]] += 1
            hard[row["scene"]] += may_be_hard(row, rule)
    many = [scene for scene in tried if hard[scene] >= max(1, rule.further_share * tried[scene])]
    return farthest_of(rows, data, dict.fromkeys(many, MEASURED + FURTHER))


def farthest_of(rows: Sequence[Row], data: Sequence[str], most: Mapping[str, int]) -> list[str]:
    """Why each candidate is left out, if of each family those farthest apart are taken.

    Args:
        rows: the candidates.
        data: why each is left out by its data.
        most: how many of a family are taken, if not MEASURED.
    """
    found = list(data)
    own: dict[str, list[int]] = defaultdict(list)
    for k, words in enumerate(found):
        if not words:
            own[rows[k]["scene"]].append(k)
    place = features.points(rows)
    for scene, places in own.items():
        count = most.get(scene, MEASURED)
        inside = {places[k] for k in features.farthest(place[places], count)}
        for k in places:
            if k not in inside:
                found[k] = f"not measured: of {scene}, {count} others are farther apart"
    return found


def left_out(rows: Sequence[Row]) -> list[str]:
    """Why each candidate is left out by its data; empty for those that stay."""
    found = [str(row.get("left_out") or "") for row in rows]
    first: dict[str, str] = {}
    for k, row in enumerate(rows):
        original = first.setdefault(row["digest"], row["problem"])
        if original != row["problem"]:
            found[k] = f"the same data as {original}"
    places = [k for k, words in enumerate(found) if not words]
    for k, near in zip(places, features.nearly_same([rows[k] for k in places]), strict=True):
        if near is not None:
            found[k] = f"nearly the same as {rows[places[near]]['problem']}"
    return found


# ---- what solvers did


def column(solver: str, limit: float) -> str:
    """The column of a solver's cost under a limit: CPU time [s], inf if it failed."""
    return f"{solver} {limit:g} s"


def costs_of(row: Row, limit: float) -> dict[str, float]:
    """The cost of each solver that has run a problem and takes it, by solver."""
    ending = f" {limit:g} s"
    return {
        name.removesuffix(ending): value
        for name, value in row.items()
        if name.endswith(ending) and value is not None and not math.isnan(value)
    }


def machines_of(path: Path) -> list[str]:
    """The names of the machines that the runs of a store were made on."""
    from fclib.bench import Store

    with Store(path, create=False) as store:
        return sorted({str(run["node"]) for run in store.results(start="cold")})


def measured(
    rows: Sequence[Row], stores: Mapping[float, Path], accepted: Iterable[ratings.Run] = ()
) -> list[dict[str, Any]]:
    """Rows with the costs of all solvers, and the least error known, from stores.

    A solver has solved a problem only if it also solves the renumbered copy, and its cost is the
    larger of both: of two, the median of `fclib.bench.comparison` would be the luckier one. Runs on
    several machines each have the times of their own: hardly any limit is so near that it matters.

    Args:
        rows: of the candidates.
        stores: the store of the campaign under each limit.
        accepted: what came from elsewhere: solutions, and proofs that there is none.

    Raises:
        StoreError, ProfileError: a store cannot be read, or its runs do not compare.
    """
    from fclib.bench import comparison, profiles

    costs: dict[str, dict[str, float]] = defaultdict(dict)
    best: dict[str, tuple[float, str]] = {}
    names: dict[str, None] = {}
    for limit, path, machine in [(k, v, m) for k, v in stores.items() for m in machines_of(v)]:
        runs = profiles.load(path, tolerances=[TOLERANCE], merit="both", machine=machine)
        runs = runs.where(comparison.numbers_in(runs, "time_limit") == limit)
        copies = comparison.numbers_in(runs, "copy", 0.0)
        for copy in np.unique(copies):
            found = comparison.gather(runs.where(copies == copy))
            for instance, values in zip(found.instances, found.values.tolist(), strict=True):
                own = costs[instance.hash]
                for solver, value in zip(found.solvers, values, strict=True):
                    name = column(solver, limit)
                    names[name] = None
                    if not math.isnan(value):
                        own[name] = max(value, own.get(name, 0.0))
        for run in runs:
            error = run["error"]
            if error is not None and error < best.get(run["hash"], (math.inf, ""))[0]:
                best[run["hash"]] = error, f"{run['solver']}, {limit:g} s"
    proofs: dict[str, str] = {}
    taken: dict[str, tuple[float, str]] = {}
    for one in accepted:
        if one.status == catalog.PROVEN:
            proofs[one.digest] = one.solver
        elif one.error is not None:
            taken[one.digest] = one.error, one.solver
    made = []
    for row in rows:
        short = row["digest"][: ratings.DIGITS]
        none = math.inf, ""
        error, by = min(best.get(row["digest"], none), taken.get(short, none))
        proof = proofs.get(short, "")
        known = {name: costs[row["digest"]].get(name) for name in names}
        made.append(
            {**row, **known, "best_error": error if by else None, "best_by": by, "proof": proof}
        )
    return made


def share_solved(row: Row, limit: float) -> float | None:
    """The share of the solvers that take a problem which solve it; None if it was not run."""
    values = costs_of(row, limit).values()
    return sum(map(math.isfinite, values)) / len(values) if values else None


def is_difficult(row: Row, rule: Rule) -> bool:
    """Whether few solvers solve it within the shorter limit."""
    share = share_solved(row, SHORT)
    return share is not None and share < rule.few


def is_open(row: Row) -> bool:
    """Whether nobody has solved it, or proved that it has no solution."""
    error = row.get("best_error")
    solved = share_solved(row, SHORT) or share_solved(row, LONG)
    return not (solved or row.get("proof") or (error is not None and error <= TOLERANCE))


# ---- the choice


@dataclass
class Chosen:
    """A choice: the set of each row, why, and what the bounds lack."""

    set: list[str]  # of each row; empty: of none
    why: list[str]
    lacking: list[str] = field(default_factory=list)  # in words

    def of(self, name: str) -> list[int]:
        """The rows of a set."""
        return [k for k, own in enumerate(self.set) if own == name]


def choose(rows: Sequence[Row], rule: Rule) -> Chosen:
    """The sets `standard`, `hard` and `open` from a table of measured candidates."""
    first = not_measured(rows)
    why = not_measured(rows, rule)
    chosen = Chosen([""] * len(rows), why)
    for k, row in enumerate(rows):
        if why[k]:
            continue
        if share_solved(row, SHORT) is None:
            why[k] = f"not run with a limit of {SHORT:g} s"
        elif is_difficult(row, rule) and share_solved(row, LONG) is None:
            why[k] = f"difficult, and not run with a limit of {LONG:g} s"
    stay = [k for k, words in enumerate(why) if not words]
    closed = [k for k in stay if not is_open(rows[k])]
    # what only a proof solves tells no solver from another
    told = [k for k in closed if not first[k] and not rows[k].get("proof")]
    for k in stay:
        if first[k]:
            why[k] = f"for hard and open alone: {words_of(rows[k])}"
    for k in standard(rows, told, rule, chosen):
        chosen.set[k] = "standard"
    left = [k for k in closed if not chosen.set[k] and may_be_hard(rows[k], rule)]
    for k in left:
        if share_solved(rows[k], LONG) is None:
            why[k] += f"; not run with a limit of {LONG:g} s"
    take(rows, [k for k in left if is_hard(rows[k], rule)], "hard", rule.hard, rule, chosen)
    take(rows, [k for k in stay if is_open(rows[k])], "open", None, rule, chosen)
    if (lost := rule.hard - len(chosen.of("hard"))) > 0:
        chosen.lacking.append(f"hard: {lost} of {rule.hard} problems")
    return chosen


def may_be_hard(row: Row, rule: Rule) -> bool:
    """Whether few enough solve it within the shorter limit; then it is run under the longer."""
    share = share_solved(row, SHORT)
    return share is not None and share <= rule.hard_share


def is_hard(row: Row, rule: Rule) -> bool:
    """Whether few enough solve it within the longer limit."""
    share = share_solved(row, LONG)
    return share is not None and share <= rule.hard_share


def for_longer(rows: Sequence[Row], rule: Rule) -> list[int]:
    """The rows that are run under the longer limit.

    First those that few solve: it says which are open. `standard` follows from that; then also
    those that it leaves and that may be hard.
    """
    first = [k for k, row in enumerate(rows) if is_difficult(row, rule)]
    if not first or any(share_solved(rows[k], LONG) is None for k in first):
        return first
    chosen = choose(rows, rule)
    left = [
        k
        for k, row in enumerate(rows)
        if not chosen.set[k] and not is_difficult(row, rule) and may_be_hard(row, rule)
    ]
    return sorted(first + left)


def take(
    rows: Sequence[Row],
    places: Iterable[int],
    name: str,
    count: int | None,
    rule: Rule,
    chosen: Chosen,
) -> None:
    """Take the hardest of some rows into a set: at most `most` of a family, `count` in all."""

    def rank(k: int) -> tuple[float, float, str]:
        times = [value for value in costs_of(rows[k], LONG).values() if math.isfinite(value)]
        return share_solved(rows[k], LONG) or 0.0, -min(times, default=math.inf), rows[k]["problem"]

    taken: Counter[str] = Counter()
    for k in sorted(places, key=rank):
        scene = rows[k]["scene"]
        if taken[scene] == rule.most:
            chosen.why[k] = f"{name} has {rule.most} of {scene} already, which are harder"
        elif count is not None and taken.total() == count:
            chosen.why[k] = f"{name} has {count} problems already, which are harder"
        else:
            taken[scene] += 1
            chosen.set[k] = name
            chosen.why[k] = words_of(rows[k])


def words_of(row: Row) -> str:
    """What solvers did on a problem."""
    words = []
    for limit in (SHORT, LONG):
        if values := costs_of(row, limit).values():
            solved = sum(map(math.isfinite, values))
            words.append(f"{solved} of {len(values)} solvers in {limit:g} s")
    if row.get("proof"):
        words.append(f"proved to have no solution: {row['proof']}")
    if is_open(row) and row.get("best_error") is not None:
        words.append(f"the best error known is {row['best_error']:.1e}, by {row['best_by']}")
    return "; ".join(words)


@dataclass(frozen=True)
class Bound:
    """The least and the largest number of chosen rows of a kind; what is lacking costs."""

    name: str
    own: npt.NDArray[Any]  # how much each row counts
    least: float
    most: float


def standard(rows: Sequence[Row], places: Sequence[int], rule: Rule, chosen: Chosen) -> list[int]:
    """The rows of the set `standard`; the reasons and what is lacking are added to the choice.

    Raises:
        ValueError: the integer program has no solution.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp

    if not places:
        raise ValueError("there is no candidate that was measured, and is neither trivial nor open")
    some = [rows[k] for k in places]
    count = len(some)
    point = features.points(some)
    cluster = clusters(point, rule.clusters)
    groups = int(cluster.max()) + 1
    middle = np.array([point[cluster == k].mean(axis=0) for k in range(groups)])
    distance = np.linalg.norm(point - middle[cluster], axis=1)
    scene = np.array([str(row["scene"]) for row in some])
    easy = np.array([share_solved(row, SHORT) == 1 for row in some])
    kinds = bounds_of(some, rule)

    # unknowns: whether a row is taken, whether its cluster is met, and what each bound lacks
    columns = count + groups + len(kinds)
    total = np.zeros(columns)
    total[:count] = 1
    member = cluster[None, :] == np.arange(groups)[:, None]
    lacks = np.zeros((groups, len(kinds)))
    constraints = [
        LinearConstraint(total, ub=rule.standard),
        LinearConstraint(np.hstack([member, -np.eye(groups), lacks]), lb=0),
        LinearConstraint(
            np.hstack([member, np.zeros((groups, groups)), lacks]), ub=rule.per_cluster
        ),
    ]
    for name in np.unique(scene):
        own = np.zeros(columns)
        own[:count] = scene == name
        constraints.append(LinearConstraint(own, ub=rule.most))
        # of a family of which all solvers solve all, none is taken
        telling = np.zeros(columns)
        telling[:count] = -((scene == name) & ~easy).astype(float)
        for k in np.flatnonzero((scene == name) & easy):
            least = telling.copy()
            least[k] = 1
            constraints.append(LinearConstraint(least, ub=0))
    for place, bound in enumerate(kinds):
        own = np.zeros(columns)
        own[:count] = bound.own
        if math.isfinite(bound.most):
            constraints.append(LinearConstraint(own.copy(), ub=bound.most))
        if math.isfinite(bound.least):
            own[count + groups + place] = 1
            constraints.append(LinearConstraint(own, lb=bound.least))
    # what is lacking costs as much as a cluster that is not met; both cost more than any distance
    cost = np.concatenate([distance / (1 + distance.sum()), -np.ones(groups), np.ones(len(kinds))])
    upper = np.concatenate([np.ones(count + groups), np.full(len(kinds), np.inf)])
    whole = np.concatenate([np.ones(count + groups), np.zeros(len(kinds))])
    solved = milp(cost, constraints=constraints, integrality=whole, bounds=Bounds(0, upper))
    if solved.x is None:
        raise ValueError(f"no choice is within the bounds: {solved.message}")
    taken = np.flatnonzero(solved.x[:count] > 0.5).astype(np.int64)
    for bound, lost in zip(kinds, solved.x[count + groups :], strict=True):
        if lost > 1e-6:
            of = f" of {bound.least:.3g}" if bound.least else ""
            chosen.lacking.append(f"standard: {lost:.3g}{of}, {bound.name}")
    tell(some, places, cluster, taken, rule, chosen)
    return [places[k] for k in taken.tolist()]


def bounds_of(some: Sequence[Row], rule: Rule) -> list[Bound]:
    """The bounds on the kinds of problems in `standard`."""
    total = rule.standard
    contacts = np.array([float(row["nc"]) for row in some])
    found = [Bound("problems in all", np.ones(len(some)), total, np.inf)]
    edges = [least for least, *_ in SIZES] + [math.inf]
    for k, (least, low, high) in enumerate(SIZES):
        own = (contacts >= least) & (contacts < edges[k + 1])
        words = f"{least} to {edges[k + 1] - 1:g} contacts" if k + 1 < len(SIZES) else "above"
        found.append(Bound(words, own, round(low * total), round(high * total)))
    for law, planar, low, high in LAWS:
        own = np.array([(row["law"], bool(row["planar"])) == (law, planar) for row in some])
        words = f"law {law}{', in a plane' if planar else ''}"
        found.append(Bound(words, own, round(low * total), round(high * total)))
    quick = np.array(
        [max(costs_of(row, SHORT).values(), default=math.inf) <= rule.quick for row in some]
    )
    most = math.floor(rule.quick_share * total)
    found.append(Bound("that all solve at once", quick, -np.inf, most))
    few = np.array([is_difficult(row, rule) for row in some])
    most = max(rule.difficult, math.floor(rule.difficult_share * total))
    found.append(Bound("that few solve", few, rule.difficult, most))
    return found + balance_of(some, rule)


def balance_of(some: Sequence[Row], rule: Rule) -> list[Bound]:
    """Each solver but the best and the worst solves and fails a share of what it takes."""
    names = dict.fromkeys(name for row in some for name in costs_of(row, SHORT))
    takes, solves = {}, {}
    for name in names:
        values = [costs_of(row, SHORT).get(name, math.nan) for row in some]
        takes[name] = np.array([not math.isnan(value) for value in values], float)
        solves[name] = np.array([math.isfinite(value) for value in values], float)
    order = sorted(names, key=lambda name: (solves[name].sum() / takes[name].sum(), name))
    found = []
    for name in order[1:-1]:
        # a difference that is not negative, as a sum over rows
        few = solves[name] - rule.balance * takes[name]
        many = (1 - rule.balance) * takes[name] - solves[name]
        found += [
            Bound(f"too few that {name} solves", few, 0, np.inf),
            Bound(f"too many that {name} solves", many, 0, np.inf),
        ]
    return found


def tell(
    some: Sequence[Row],
    places: Sequence[int],
    cluster: npt.NDArray[np.int64],
    taken: npt.NDArray[np.int64],
    rule: Rule,
    chosen: Chosen,
) -> None:
    """The reason why each row is in `standard`, or is not."""
    families = Counter(some[k]["scene"] for k in taken)
    telling = Counter(row["scene"] for row in some if share_solved(row, SHORT) != 1)
    groups = Counter(cluster[taken].tolist())
    inside = set(taken.tolist())
    for k, row in enumerate(some):
        own, scene = int(cluster[k]), row["scene"]
        if k in inside:
            chosen.why[places[k]] = f"{words_of(row)}; cluster {own}"
        elif not telling[scene]:
            chosen.why[places[k]] = f"all solvers solve all of {scene}"
        elif families[scene] == rule.most:
            chosen.why[places[k]] = f"standard has {rule.most} of {scene} already"
        elif groups[own] == rule.per_cluster:
            chosen.why[places[k]] = f"standard has {rule.per_cluster} of cluster {own} already"
        elif groups[own]:
            chosen.why[places[k]] = f"standard has another one of cluster {own}"
        else:
            chosen.why[places[k]] = "the bounds of standard on kinds leave no room"


def clusters(place: features.Array, most: int) -> npt.NDArray[np.int64]:
    """The cluster of each point, 0, 1, ...; by Ward's method, which widens clusters least."""
    from scipy.cluster.hierarchy import fcluster, linkage

    if len(place) == 1:
        return np.zeros(1, dtype=np.int64)
    return np.asarray(fcluster(linkage(place, "ward"), most, "maxclust") - 1, dtype=np.int64)


def counts_of(chosen: Chosen) -> list[dict[str, Any]]:
    """How many candidates there are, and what became of them."""
    kinds = ("the same data", "nearly the same", "trivial", "too large", "not measured")
    outcome: Counter[str] = Counter()
    for name, words in zip(chosen.set, chosen.why, strict=True):
        outcome[name or next((kind for kind in kinds if words.startswith(kind)), "others")] += 1
    return [{"candidates": "all", "problems": len(chosen.set)}] + [
        {"candidates": name, "problems": outcome[name]} for name in (*kinds, *SETS, "others")
    ]


# ---- how a choice is stored


def choices_of(sources: Mapping[str, Candidates], rows: Sequence[Row]) -> list[Choice]:
    """Rows of the table in the format of a list, in order.

    Args:
        sources: the candidates of each SET/FAMILY.
        rows: the rows that were chosen.
    """
    chosen = []
    for row in rows:
        found, number = sources[folder_of(row)], int(row["number"])
        scene = found.plan.scene
        step, digest = number, row["digest"]
        if found.states is not None:
            place = found.states.index(number)
            # on another machine the problem may differ from the published one by rounding
            step, digest = int(found.states.step[place]), found.states.digest[place]
        label = str(row["label"])
        other = "" if label == scene.name else scene.name
        parameters = dict(scene.parameters)
        chosen.append(Choice(label, parameters, scene.seed or 0, number, step, digest, other))
    return sorted(chosen, key=lambda choice: (choice.family, choice.number))


def folder_of(row: Row) -> str:
    """SET/FAMILY of a row."""
    return str(row["problem"]).rpartition("/")[0]


def publish(
    sources: Mapping[str, Candidates],
    choices: Sequence[Choice],
    name: str,
    version: str,
    folder: Path,
) -> list[Path]:
    """Store the states of chosen problems as those of a set.

    States that a file of the folder has already are stored in that file only. A family whose
    problems are stored already, in any version, is left as it is. Raises OSError.
    """
    written = []
    for found in sources.values():
        own = {choice.number: choice.digest for choice in choices if choice.family == found.label}
        if found.states is None or not own:
            continue
        there = sorted((folder / name).glob(f"{found.label}-*{trajectory.SUFFIX}"))
        if any(trajectory.read_digests(path) == own for path in there):
            continue
        target = folder / name / f"{found.label}-{version}{trajectory.SUFFIX}"
        if target.is_file():
            raise FileExistsError(
                f"{target}: has other problems; choose a further version (--version)"
            )
        part = trajectory.part(found.states, own, name, version)
        guessed = replace(part, guess=guesses_of(found, sorted(own)))
        file = found.plan.trajectory
        shared = file is not None and file.is_relative_to(folder)
        source = file.relative_to(folder).as_posix() if file is not None and shared else ""
        trajectory.write(target, guessed, source)
        written.append(target)
    return written


def guesses_of(found: Candidates, numbers: Sequence[int]) -> tuple[Any, ...]:
    """The guess of each problem whose step before is not among them; a build makes the others."""
    assert found.states is not None
    guesses: list[Any] = []
    for number in numbers:
        guess = None
        if number - 1 not in numbers:
            item = item_of(found.plan, found.states, number)
            guess = guess_for(found.plan, found.states, item, None)
        guesses.append(None if guess is None else guess.r)
    return tuple(guesses)
