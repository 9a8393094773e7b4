"""The class of problems: easy, hard or open, by published runs and known solutions.

The runs are those of the package `fclib-results` (`fclib.results`): cold, to TOLERANCE by both
merits. What came from elsewhere for open problems lies in the package `fclib-collection`, beside
the trajectories:

    results/solutions/DIGEST.npz     the best solution: r and l, with finder, error and date
    results/solutions/DIGEST.json    a proof that there is none (`analysis.Certificate`), likewise

The digest of its data identifies a problem, whatever its name and however many sets have it. Only
runs with the newest version of each solver have a vote, at one limit of CPU time: of the limits at
which the problem was run, the one that most published runs have. Of runs on renumbered copies the
median counts, of two the better one, as in `fclib.bench.comparison`.

easy    more than half of the solvers that take such problems solved it
hard    at most half of them solved it
open    no run and no accepted solution has an error within TOLERANCE, and neither a run nor an
        accepted proof shows that there is no solution

`fclib._verdicts` defines "solved", and the class by the number of solvers.

Runs at another limit have no vote, but a problem that they solved is not open.
"""

from __future__ import annotations

import functools
import io
import json
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, Final

import numpy as np

from fclib import _core, _digest, _stored, scenes
from fclib._files import write_bytes, write_text
from fclib._verdicts import UNSUITABLE, is_solved, rating
from fclib.collections import catalog, published, references, set_index, trajectory

TOLERANCE: Final = 1e-8
DIGITS: Final = 16  # digits of a digest that name a solution
TAKEN: Final = "taken"  # the status of a solution that came from elsewhere
BETTER: Final = 0.9  # a new solution must reach so many times the best error known
FOLDER: Final = "results"
FIRST: Final = "standard"  # the set of most runs


class RatingError(ValueError):
    """A solution is refused, with the reason; or results cannot be stored."""


@dataclass(frozen=True)
class Run:
    """A published run, or an accepted solution."""

    digest: str  # the first DIGITS of the digest of its problem's data
    solver: str  # or the finder of the solution, and the way
    version: str  # version of the solver; empty for a solution
    limit: float | None  # [s] of CPU time
    status: str  # status of the bench, or TAKEN
    # largest of the merits that the tolerance bounds; None: there is no solution
    error: float | None
    cpu: float | None  # [s]
    date: str
    started: float = 0.0  # [s] since 1970

    @property
    def solved(self) -> bool:
        """Whether its solver found the answer in time."""
        return is_solved(self.status)

    @property
    def settles(self) -> bool:
        """Whether it is solved, or found too late or elsewhere with an error within TOLERANCE."""
        return self.solved or (self.error is not None and self.error <= TOLERANCE)


@dataclass(frozen=True)
class RatedProblem:
    """A problem, and the known facts of its difficulty."""

    id: str
    digest: str
    rating: str  # easy, hard or open; empty if it was not run
    solved: int  # number of solvers that solved it
    voters: int  # number of solvers with a vote
    limit: float | None  # [s] CPU time limit of these; None if none was run
    best: Run | None  # the run with the least error
    solution: Path | None  # file of the best solution


@dataclass(frozen=True)
class Basis:
    """The basis of the classes of a set."""

    limits: tuple[float, ...]  # [s] of CPU time, the limits of its problems
    solvers: tuple[str, ...]  # solvers with a vote
    versions: tuple[str, ...]
    dates: tuple[str, str]  # first and last day of the runs

    def __str__(self) -> str:
        """The basis in one sentence."""
        return (
            f"to {TOLERANCE:g} within {' or '.join(f'{limit:g}' for limit in self.limits)} s of CPU"
            f" a run, by {len(self.solvers)} solvers"
            f" ({', '.join(self.solvers)}; version {', '.join(self.versions)}),"
            f" {' to '.join(dict.fromkeys(self.dates))}"
        )


# ---- the runs


def folder() -> Path:
    """The folder of results. RatingError if the package of trajectories is missing."""
    root = published.root()
    if root is None:
        raise RatingError("no results are stored here: they come with the package fclib-collection")
    return root.parent / FOLDER


def runs() -> tuple[Run, ...]:
    """All runs that are published here, and all that was accepted.

    Raises:
        RatingError: pyarrow is missing, or a file is damaged.
        OSError: a file cannot be read.
    """
    where = _stored.published_runs()
    parts = sorted(where.glob("*.parquet")) if where is not None else []
    found = _runs_of(tuple(parts))
    if published.root() is None:
        return found
    accepted = sorted((folder() / "solutions").glob("*.*"))
    return found + tuple(_run_of(path) for path in accepted if path.suffix in (".npz", ".json"))


# of a part of the published runs
COLUMNS: Final = ("hash", "solver", "version", "time_limit", "status", "error", "cpu_s", "started")
COUNTED: Final = {"tol": TOLERANCE, "merit": "both", "start": "cold"}


@functools.lru_cache(maxsize=2)
def _runs_of(parts: tuple[Path, ...]) -> tuple[Run, ...]:
    """The runs of parts; those that differ by their copy or repeat alone are one."""
    found: dict[tuple[Any, ...], list[Run]] = defaultdict(list)
    for row in (row for path in parts for row in _rows_of(path)):
        error = row["error"]
        run = Run(
            digest=row["hash"][:DIGITS],
            solver=row["solver"],
            version=row["version"],
            limit=row["time_limit"],
            status=row["status"],
            error=None if error is None or not np.isfinite(error) else error,
            cpu=row["cpu_s"],
            date=datetime.fromtimestamp(row["started"], timezone.utc).date().isoformat(),
            started=row["started"],
        )
        found[run.digest, run.solver, run.version, run.limit].append(run)
    return tuple(map(_median, found.values()))


def _rows_of(path: Path) -> list[dict[str, Any]]:
    """The rows of a part that count."""
    try:
        pa = catalog.arrow()
        # a filter of pyarrow's would import pandas, in each process of a build
        table = pa.parquet.ParquetFile(path).read([*COLUMNS, *COUNTED])
        rows: list[dict[str, Any]] = table.select([*COLUMNS, *COUNTED]).to_pylist()
    except ImportError as missing:
        raise RatingError(str(missing)) from None
    except (pa.ArrowException, KeyError) as wrong:
        reason = str(wrong).splitlines()[0]
        raise RatingError(f"{path}: cannot be read as published runs: {reason}") from None
    return [row for row in rows if all(row[name] == value for name, value in COUNTED.items())]


def _median(same: list[Run]) -> Run:
    """Of runs that differ by their copy alone the median, with the least error of all."""
    same.sort(key=lambda run: (not run.solved, run.cpu or 0.0))
    errors = [run.error for run in same if run.error is not None]
    return replace(same[(len(same) - 1) // 2], error=min(errors, default=None))


def _run_of(path: Path) -> Run:
    """An accepted solution, or a proof that there is none, as a run without a limit."""
    try:
        if path.suffix == ".json":
            proof = json.loads(path.read_text(encoding="utf-8"))
            return Run(path.stem, proof["by"], "", None, catalog.PROVEN, None, None, proof["date"])
        with np.load(path) as arrays:
            finder = json.loads(str(arrays["origin"]))
        error, date = float(finder["error"]), finder["date"]
        if not np.isfinite(error):
            raise ValueError(f"its error is {error}")
        return Run(path.stem, finder["by"], "", None, TAKEN, error, None, date)
    except (KeyError, TypeError, ValueError) as wrong:
        raise RatingError(f"{path}: is no solution and no proof: {wrong}") from None


# ---- the classes


def members(name: str) -> dict[str, str]:
    """The digests of the problems of a set, by their names.

    They come from a list, from stored states, or from problems that are assembled here, in seconds.
    A family that must be simulated has none.
    """
    found = {f"{name}/{c.family}/{c.number:04d}": c.digest for c in set_index.choices(name)}
    listed = {own.rpartition("/")[0] for own in found}
    for own in set_index.folders([name]):
        if own not in listed:
            found |= {f"{own}/{number:04d}": digest for number, digest in digests(own).items()}
    return found


def digests(own: str) -> dict[int, str]:
    """The digests of the problems of SET/FAMILY, by their numbers."""
    stored = published.digests(own, set_index.version_of(own))
    scene = None if stored else set_index.plan_of(own).scene
    if not isinstance(scene, scenes.Assembled):
        return stored
    return _assembled(scene)


@functools.cache
def _assembled(scene: scenes.Assembled) -> dict[int, str]:
    """The digests of a family's problems, which are made here unless the family has them."""
    if hasattr(scene.family, "digests"):
        return dict(enumerate(scene.family.digests()))
    return {n: _digest.digest(scene.problem(n)) for n in range(scene.family.problems)}


def ratings_of(name: str) -> tuple[list[RatedProblem], Basis | None]:
    """The class of each problem of a set, and its basis; None if nothing was run.

    Raises:
        KeyError: there is no such set.
        RatingError, OSError: results cannot be read.
    """
    known = by_digest()
    rows = []
    voting: list[Run] = []
    for name_, digest in members(name).items():
        mine = known[0].get(digest[:DIGITS], [])
        voters = voters_of(mine, known[1])
        voting += voters
        rows.append(rating_of(name_, digest, mine, voters))
    if not voting:
        return rows, None
    dates = sorted(run.date for run in voting)
    return rows, Basis(
        tuple(sorted({run.limit for run in voting if run.limit is not None})),
        tuple(sorted({run.solver for run in voting})),
        # without the hash of a solver's code
        tuple(sorted({run.version.partition("-")[0] for run in voting if run.version})),
        (dates[0], dates[-1]),
    )


def class_of(name: str, digest: str) -> str | None:
    """The class of a problem of a set by its digest; None if it was not run, or for other sets."""
    try:
        if name not in set_index.sets():
            return None
        stored, limits = _by_digest()
        mine = stored.get(digest[:DIGITS], [])
        return rating_of(name, digest, mine, voters_of(mine, limits)).rating or None
    except RatingError:
        return None


def by_digest() -> tuple[dict[str, list[Run]], Counter[float | None]]:
    """The runs of each problem, and how many of all runs have a limit."""
    stored: dict[str, list[Run]] = defaultdict(list)
    for run in runs():
        stored[run.digest].append(run)
    return stored, Counter(run.limit for own in stored.values() for run in own)


# what a build asks for each problem
_by_digest = functools.lru_cache(by_digest)


def voters_of(mine: Sequence[Run], common: Mapping[float | None, int]) -> list[Run]:
    """The runs of a problem that have a vote: of the commonest of its limits, one a solver."""
    limits = {run.limit for run in mine if run.limit is not None}
    limit = max(limits, key=lambda value: (common[value], -value), default=None)
    # the last version of a solver has the vote
    last = {run.solver: run for run in sorted(mine, key=when) if run.limit == limit}
    # an accepted solution has no limit and no vote
    return [run for run in last.values() if run.limit and run.status != UNSUITABLE]


def when(run: Run) -> float:
    """The order of runs: the later one counts."""
    return run.started


def rating_of(name: str, digest: str, mine: Sequence[Run], voters: Sequence[Run]) -> RatedProblem:
    """The class of one problem, and its facts."""
    solved = sum(run.solved for run in voters)
    judged = [run for run in mine if run.error is not None]
    best = min(judged, key=lambda run: run.error or 0.0, default=None)
    found = rating(solved, len(voters))
    if found == "open" and any(run.settles for run in mine):
        found = "hard"  # solved at another limit, or by somebody else
        proof = next((run for run in mine if run.status == catalog.PROVEN), None)
        best = proof or best
    path = solution_path(digest)
    limit = voters[0].limit if voters else None
    return RatedProblem(
        name, digest, found, solved, len(voters), limit, best, path if path.is_file() else None
    )


# ---- solutions


def solution_path(digest: str) -> Path:
    """The file of the best solution of a problem, if it is stored."""
    return folder() / "solutions" / f"{digest[:DIGITS]}.npz"


def problem_of(name: str) -> Any:
    """The problem SET/FAMILY/NUMBER of a set with stored states, or assembled directly."""
    own, _, number = name.rpartition("/")
    plan = set_index.plan_of(own)
    if isinstance(plan.scene, scenes.Assembled):
        return plan.scene.problem(int(number))
    if plan.trajectory is None:
        raise RatingError(f"{own}: its states are not stored")
    states = trajectory.read(plan.trajectory)
    return states.problem(states.index(int(number))).problem


def known_solution(name: str) -> tuple[Any, _core.Solution, dict[str, Any]]:
    """An open problem, the best solution known, and its finder. RatingError if there is none."""
    digest = members(name.split("/")[0]).get(name)
    if digest is None:
        raise RatingError(f"{name}: there is no such problem")
    stored = stored_solution(digest)
    if stored is None:
        raise RatingError(f"{name}: no solution of it is stored")
    return problem_of(name), *stored


def stored_solution(digest: str) -> tuple[_core.Solution, dict[str, Any]] | None:
    """The best solution known of an open problem, and who found it, if one is stored here."""
    if published.root() is None or not (path := solution_path(digest)).is_file():
        return None
    with np.load(path) as arrays:
        finder: dict[str, Any] = json.loads(str(arrays["origin"]))
        multipliers = arrays["l"] if "l" in arrays.files else None
        return solution_of(arrays["r"], multipliers), finder


def solution_of(r: Any, multipliers: Any) -> _core.Solution:
    """A solution from reactions, and from multipliers of bilateral constraints if there are any."""
    return _core.Solution(r=r) if multipliers is None else _core.Solution(r=r, l=multipliers)


def accept_solution(path: Path, by: str, name: str | None = None) -> tuple[str, float, float]:
    """Verify the solution of an open problem that a file holds, and keep it if it is better.

    It is judged on the collection's own problem, assembled from its state. Of the file's problem
    only the digest is used.

    Args:
        path: an FCLIB file with a problem, in its global or local form, and a solution.
        by: the finder, and the way.
        name: SET/FAMILY/NUMBER; by default it is found by the digest of the file's problem.

    Returns:
        The name, the error, and the best error known before.

    Raises:
        RatingError: the problem is not open, or the solution is not better.
        fclib.Error, OSError: the file cannot be read, or the results not written.
    """
    problem, solution = _core.read(path), _core.read_solution(path)
    if solution is None:
        raise RatingError(f"{path}: holds no solution")
    row = _open_one(name or recognised(path, problem))
    name = row.id
    own = problem_of(name)
    if solution.r.size != own.spacedim * own.nc:
        raise RatingError(
            f"{path}: r has {solution.r.size} entries, and {name} has {own.spacedim * own.nc}"
        )
    error = float(_core.merit(own, solution_of(solution.r, solution.l)).error)
    best = row.best.error if row.best is not None and row.best.error is not None else np.inf
    if not error < BETTER * best:
        raise RatingError(
            f"{name}: the error of this solution is {error:.3g}, and {best:.3g} is known"
            + (f" by {row.best.solver}" if row.best is not None else "")
        )
    store_solution(
        own, row.digest, solution, {"by": by, "error": error, "date": references.today()}
    )
    return name, error, best


def accept_proof(path: Path, by: str, name: str | None = None) -> str:
    """Check a proof that an open problem has no solution, and keep it. Return the problem's name.

    It is checked in exact arithmetic on the collection's own problem.

    Args:
        path: what `fclib analyze --json` prints, or the `record` of an `analysis.Certificate`.
        by: the finder, and the way.
        name: SET/FAMILY/NUMBER; by default it is found by the digest that the file has.

    Raises:
        RatingError: the problem is not open, or none of a list; the proof is not exact.
        fclib.Error: the file cannot be read, or proves nothing.
    """
    from fclib import analysis  # which other commands do without

    y, z, digest = analysis.read_certificate(path)
    if name is None and digest is None:
        raise RatingError(f"{path}: has no digest of a problem: name the problem")
    row = _open_one(name or _listed(path, lambda row: row.digest == digest))
    own = problem_of(row.id)
    proof = analysis.check(own, y, z)
    if not proof.exact:
        raise RatingError(
            f"{path}: proves it up to reactions of {proof.bound:.1e}, and exact proofs are taken"
        )
    text = (
        json.dumps(proof.record(own) | {"by": by, "date": references.today()}, sort_keys=True)
        + "\n"
    )
    target = solution_path(row.digest).with_suffix(".json")
    target.parent.mkdir(parents=True, exist_ok=True)
    write_text(target, text)
    return row.id


def _open_one(name: str) -> RatedProblem:
    """An open problem by its name. RatingError if it is not open."""
    row = next((row for row in ratings_of(name.split("/")[0])[0] if row.id == name), None)
    if row is None:
        raise RatingError(f"{name}: there is no such problem")
    if row.rating != "open":
        words = f"is {row.rating}" if row.rating else "was not run"
        raise RatingError(f"{name}: {words}, and solutions are taken of open problems")
    return row


def store_solution(
    problem: Any, digest: str, solution: _core.Solution, finder: Mapping[str, Any]
) -> None:
    """Write r and l of the best solution of a problem."""
    arrays: dict[str, Any] = {"r": solution.r} | ({"l": solution.l} if problem.p else {})
    content = io.BytesIO()
    np.savez_compressed(content, origin=json.dumps(dict(finder), sort_keys=True), **arrays)
    path = solution_path(digest)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, content.getvalue())


def recognised(path: Path, problem: Any) -> str:
    """The name of a file's problem in a list, by its digest. RatingError if it has none."""
    own = _digest.digest(problem)
    return _listed(
        path,
        lambda row: (
            row.digest == own or (row.rating == "open" and condenses_to(row.id, problem, own))
        ),
    )


def _listed(path: Path, is_own: Callable[[RatedProblem], bool]) -> str:
    """The name of the first problem of a list that is a file's own. RatingError if none is."""
    lists = [name for name in set_index.sets() if set_index.choices(name)]
    # first the set for which classes are made
    for name in sorted(lists, key=lambda name: name != FIRST):
        for row in ratings_of(name)[0]:
            if is_own(row):
                return row.id
    raise RatingError(
        f"{path}: its problem is none of {', '.join(lists)}; name it, if it differs from one by the"
        " rounding of another machine"
    )


def condenses_to(name: str, local: Any, digest: str) -> bool:
    """Whether a local problem is the local form of a problem of the collection."""
    if not local.kind.startswith("local"):
        return False
    own = problem_of(name)
    if not own.kind.startswith("global") or (own.nc, own.p) != (local.nc, local.p):
        return False
    return _digest.digest(own.condense()) == digest
