"""From plans to files: each family is made in a process, and its problems are stored.

    OUT/SET/FAMILY/0100-global.hdf5     problem and solution
                   0100-local.hdf5
                   states.trajectory    if the states were simulated for this build
                   catalog.parquet      of the family; it exists once the family is finished
                   .state/              until then: the place to go on from
    OUT/catalog.parquet                 of all problems that are finished

Each problem is assembled from one state of a trajectory. Its reference solution is found from a
zero start, and no other problem depends on it (references.py). A build that was killed goes on from
its last checkpoint, and ends with the same files.
"""

from __future__ import annotations

import heapq
import json
import multiprocessing
import os
import shutil
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import dataclass, field, replace
from multiprocessing import connection
from pathlib import Path
from queue import Empty
from typing import TYPE_CHECKING, Any

import numpy as np

from fclib import _core, _digest, _laws, _solve, scenes
from fclib._files import write_text
from fclib._judge import TOLERANCE, trivial
from fclib._origin import origin_of
from fclib._words import counted
from fclib.collections import catalog, ratings, references, trajectory
from fclib.collections.catalog import STATE
from fclib.collections.plan import HARD_SWEEPS, HARD_TOLERANCE, Plan, rights_of, stamped
from fclib.collections.record import record
from fclib.collections.references import Found, guess_of

if TYPE_CHECKING:
    from fclib.analysis import Enumeration

COMPRESSION = 1  # level 1: 2 % more bytes than level 6 in two thirds of the time
# all combinations of contact states are tried up to this number: three planar contacts have 64; v
# and lambda of two bodies are eliminated in rational arithmetic
SMALL_PLANAR, SMALL_UNKNOWNS = 3, 12
CHECKPOINT = 5.0  # seconds between two checkpoints
LISTING = 0.05  # share of a build's time that may go into the catalogue of all
# attribute of `info` in a file of a simulated problem without a guess: the reason
GUESS, NO_GUESS = "guess", "none: the states do not have the step before, nor what it carried over"
TOLD = 0.1  # seconds between two messages of progress

Progress = Callable[[str, int, int], None]  # SET/FAMILY, problems looked at, their number


class BuildError(Exception):
    """The folder was built by another plan than the one asked for."""


def build(
    plans: Sequence[Plan],
    out: str | Path,
    *,
    jobs: int = 1,
    progress: Progress | None = None,
    pictures: bool = True,
) -> Any:
    """Build the problems of plans into a folder. Return its catalogue (pyarrow.Table).

    A finished family is left as it is; an interrupted one goes on.

    Args:
        plans: one for each scene.
        out: the folder; made if it is missing.
        jobs: number of processes; each scene is built in one process.
        progress: called with the plan's name, the problems done and their number.
        pictures: also draw each scene's last state and its distribution of contacts.

    Raises:
        BuildError: a folder holds the same scene, built by another plan.
        OSError, fclib.FileError: a file cannot be written.
        ImportError: MuJoCo or pyarrow is missing.
    """
    catalog.arrow()
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    todo = [plan for plan in plans if not is_finished(plan, out)]
    report = progress or (lambda name, done, total: None)
    todo = [joined(plan, out) for plan in todo]
    for plan in plans:
        if plan.name not in {one.name for one in todo}:
            report(plan.name, plan.total, plan.total)
    if jobs <= 1 or len(todo) <= 1:
        for plan in todo:
            finish(plan, out, build_scene(plan, out, report, pictures))
    else:
        build_in_processes(todo, out, jobs, report, pictures)
    return catalog.gather(out)


def build_in_processes(
    plans: Sequence[Plan], out: Path, jobs: int, report: Progress, pictures: bool
) -> None:
    """Build each plan in a process of a pool; one that fails leaves the others."""
    context = multiprocessing.get_context("spawn")
    messages = context.Queue()
    failed: BaseException | None = None
    with ProcessPoolExecutor(
        jobs, mp_context=context, initializer=begin_in_pool, initargs=(messages,)
    ) as pool:
        # long builds first
        ordered = sorted(plans, key=lambda plan: -plan.total)
        plan_of = {pool.submit(build_and_tell, plan, out, pictures): plan for plan in ordered}
        waiting = set(plan_of)
        while waiting:
            done, waiting = wait(waiting, timeout=0.2, return_when=FIRST_COMPLETED)
            try:
                while True:
                    report(*messages.get_nowait())
            except Empty:
                pass
            for future in done:
                error = future.exception()
                if error is None:
                    finish(plan_of[future], out, future.result())
                failed = failed or error
    if failed is not None:
        raise failed


_messages: Any = None  # in a process of the pool: the queue for progress


def begin_in_pool(messages: Any) -> None:
    """Start a process of the pool: it sends its progress here, and ends with the build."""
    global _messages
    _messages = messages
    messages.cancel_join_thread()  # unread messages must not keep the process alive
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        # if the build is killed, nobody takes the results
        connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def build_and_tell(plan: Plan, out: Path, pictures: bool) -> list[dict[str, Any]]:
    """Build in a process of the pool; progress goes back as messages, a few each second."""
    last = 0.0

    def tell(name: str, done: int, total: int) -> None:
        nonlocal last
        now = time.monotonic()
        if done == total or now - last > TOLD:
            last = now
            _messages.put((name, done, total))

    return build_scene(plan, out, tell, pictures)


def is_finished(plan: Plan, out: Path) -> bool:
    """Whether the scene is built. BuildError if another plan built it."""
    folder = out / plan.name
    part, state = folder / catalog.FILE, folder / STATE
    if part.is_file():
        found = catalog.read_catalog(part).schema.metadata.get(catalog.FINGERPRINT, b"").decode()
    elif (state / "plan.json").is_file() and (
        (folder / trajectory.OWN).is_file() or len(list(state.iterdir())) > 1
    ):
        found = (state / "plan.json").read_text(encoding="utf-8")
    else:
        return False
    if found != plan.fingerprint() and not (part.is_file() and is_more(found, plan)):
        raise BuildError(
            f"{folder}: was built with other settings ({difference(found, plan.fingerprint())});"
            " remove it, or choose another folder"
        )
    return part.is_file() and set(plan.numbers().tolist()) <= numbers_in(found, plan)


def is_more(found: str, plan: Plan) -> bool:
    """Whether this plan built a folder, whichever problems were chosen."""
    old, new = (json.loads(text) for text in (found, plan.fingerprint()))
    for one in (old, new):
        if one.pop("count") is not None:
            return False
        one.pop("chosen")
    return bool(old == new)


def numbers_in(found: str, plan: Plan) -> set[int]:
    """The numbers of the problems that a folder was built with."""
    chosen = json.loads(found)["chosen"]
    return set(range(plan.total)) if chosen is None else set(chosen)


def joined(plan: Plan, out: Path) -> Plan:
    """The plan, extended by the problems that the folder already has; they are made again."""
    part = out / plan.name / catalog.FILE
    if plan.chosen is None or not part.is_file():
        part.unlink(missing_ok=True)
        return plan
    found = catalog.read_catalog(part).schema.metadata.get(catalog.FINGERPRINT, b"{}").decode()
    part.unlink()
    return replace(plan, chosen=tuple(sorted({*plan.chosen, *numbers_in(found, plan)})))


def difference(found: str, asked: str) -> str:
    """The first settings that differ, in words."""
    try:
        old, new = json.loads(found), json.loads(asked)
    except json.JSONDecodeError:
        return "which cannot be read"
    old, new = ({**plan.pop("parameters"), **plan} for plan in (old, new))
    keys = [key for key in {**new, **old} if old.get(key) != new.get(key)]
    return ", ".join(f"{key}: {old.get(key)}, now {new.get(key)}" for key in keys[:3])


@dataclass
class Kept:
    """The rows of the problems kept, and the number of problems looked at."""

    plan: Plan
    looked: int = 0
    rows: dict[int, dict[str, Any]] = field(default_factory=dict)  # by number
    listed: float = 0.0  # time of the last writing of the catalogue of all, and its duration [s]
    listing: float = 0.0

    def wants(self, number: int) -> bool:
        """Whether the rule takes this number; the rule `hard` looks at every problem."""
        return self.plan.select == "hard" or number in self._numbers

    def add(self, row: dict[str, Any]) -> list[dict[str, Any]]:
        """Keep a problem, and return those that it replaces."""
        self.rows[row["number"]] = row
        if self.plan.select != "hard" or self.plan.count is None:
            return []
        cost = {number: (-row["nsgs_sweeps"], number) for number, row in self.rows.items()}
        kept = heapq.nsmallest(self.plan.count, self.rows, key=cost.__getitem__)
        return [self.rows.pop(number) for number in set(self.rows) - set(kept)]

    def __post_init__(self) -> None:
        self._numbers = set(self.plan.numbers().tolist())


@dataclass(frozen=True)
class Item:
    """A problem of a plan, before it is stored."""

    problem: Any
    step: int  # of the simulation, or the problem's number
    time: float | None = None  # at the start of the step [s]
    bodies: int | None = None
    left_out: tuple[str, ...] = ()


def states_of(plan: Plan, folder: Path, report: Progress) -> trajectory.Trajectory | None:
    """The trajectory of a plan. If there is none, it is simulated, and `report` is told so.

    None for a family that is assembled directly.
    """
    if isinstance(plan.scene, scenes.Assembled):
        return None
    path = plan.trajectory or folder / trajectory.OWN
    if plan.trajectory is None and not path.is_file():

        def tell(name: str, done: int, total: int) -> None:
            report(f"{name}, simulated", done, total)

        record(plan, path, folder / STATE / "simulation.npz", tell)
    states = trajectory.read(path)
    if plan.problems is not None and plan.steps is None:
        last = int(states.number.max(initial=-1))
        if last + 1 < plan.problems:
            has = counted(last + 1, "problem")
            raise BuildError(f"{path}: has {has}, and {plan.problems} are asked for")
    # a local file may refer to others beside it
    return replace(states, scene=replace(states.scene, path=plan.scene.path))


def item_of(plan: Plan, states: trajectory.Trajectory | None, number: int) -> Item:
    """A problem by its number: assembled from its state, or directly; nothing is solved."""
    if states is None:
        assert isinstance(plan.scene, scenes.Assembled)
        return Item(plan.scene.problem(number), number)
    place = states.index(number)
    part = states.problem(place)
    return Item(
        part.problem,
        int(states.step[place]),
        states.time(place),
        states.moved(part),
        states.left_out,
    )


def build_scene(
    plan: Plan, out: Path, report: Progress, pictures: bool = False
) -> list[dict[str, Any]]:
    """Make the problems of a plan and store them; an interrupted build goes on.

    Return their rows of the catalogue.
    """
    folder = out / plan.name
    state_folder = folder / STATE
    state_folder.mkdir(parents=True, exist_ok=True)
    write_text(state_folder / "plan.json", plan.fingerprint())
    states = states_of(plan, folder, report)
    kept = Kept(plan)
    read_checkpoint(state_folder, kept)

    before: Before | None = None
    last = time.monotonic()
    numbers = range(plan.total) if states is None else states.number.tolist()
    try:
        for number in numbers:
            if number < kept.looked or number >= plan.total:
                continue
            if time.monotonic() - last > CHECKPOINT:
                write_checkpoint(state_folder, kept, out)
                last = time.monotonic()
            kept.looked = number
            if kept.wants(number):
                item = item_of(plan, states, number)
                if before is None and number and plan.references:
                    before = stored_before(plan, kept, out)
                guess = guess_for(plan, states, item, before)
                before = store(plan, kept, item, guess, out)
            kept.looked += 1
            report(plan.name, kept.looked, plan.total)
    except BaseException:  # Control-C too
        write_checkpoint(state_folder, kept, out, last=True)
        raise

    if pictures:
        from fclib.collections import figures

        if states is not None:
            figures.draw_states(states, folder)
        figures.draw_distribution(list(kept.rows.values()), folder, plan.scene.title)
    _core.sync_files(folder)
    return list(kept.rows.values())


def finish(plan: Plan, out: Path, rows: list[dict[str, Any]]) -> None:
    """Write the plan's part of the catalogue, which says that it is built; then the whole one."""
    folder = out / plan.name
    fingerprint = {catalog.FINGERPRINT: plan.fingerprint().encode()}
    catalog.write_catalog(folder / catalog.FILE, rows, fingerprint)
    shutil.rmtree(folder / STATE)
    catalog.gather(out)


def reference(plan: Plan, problem: Any) -> Found | None:
    """The reference solution, which follows from the problem alone; None: not asked for."""
    if not plan.references:
        return None
    found = references.find(problem, plan.solver, plan.tol, **plan.options)
    # somebody may know a better solution of an open problem
    if not found.ok and not found.refuted:
        stored = ratings.stored_solution(_digest.digest(problem))
        if stored is not None:
            solution, finder = stored
            other = references.given(problem, solution, finder["by"], finder["date"])
            other = references.finished(problem, other)
            found = other if other.error < found.error else found
    return references.certified(problem, found) if plan.certify and found.ok else found


@dataclass(frozen=True)
class Before:
    """A problem, and its solution or the best iterate."""

    number: int
    problem: Any
    solution: _core.Solution


def stored_before(plan: Plan, kept: Kept, out: Path) -> Before | None:
    """The same from its file, if a build goes on."""
    row = kept.rows.get(max((n for n in kept.rows if n < kept.looked), default=-1))
    if row is None:
        return None
    path = out / str(row["global_file"] or row["local_file"])
    solution = _core.read_solution(path)
    return None if solution is None else Before(row["number"], _core.read(path), solution)


def guess_for(
    plan: Plan, states: trajectory.Trajectory | None, item: Item, before: Before | None
) -> _core.Solution | None:
    """What the simulation carried over from the step before; None if that is not known.

    It follows from the states alone, whichever problems are built: the reactions of the same
    contacts in the reference of the step before, which is found for this if it is not built; zeros
    if that step had no contact; or those that are stored with the states. For a step of another
    engine they are the reactions of that engine.
    """
    reaction = getattr(getattr(plan.scene, "family", None), "reaction", None)
    if reaction is not None:
        known: _core.Solution = reaction(item.step)
        return known
    if states is None:
        return None
    problem, place = item.problem, int(np.searchsorted(states.step, item.step))
    multipliers = np.zeros(problem.p) if problem.p else None
    stored = states.guess[place] if states.guess else None
    if stored is not None and len(stored) == problem.spacedim * problem.nc:
        return _core.Solution(r=stored, l=multipliers)
    number = int(states.number[place])
    follows = place > 0 and int(states.number[place - 1]) == number - 1
    if follows and int(states.step[place - 1]) == item.step - 1:
        if before is None or before.number != number - 1:
            before = solved_before(plan, states, number - 1)
        return guess_of(before.problem, before.solution, problem) if before is not None else None
    if follows or (number == 0 and (item.step == 0 or not states.scene.begin)):
        return _core.Solution(r=np.zeros(problem.spacedim * problem.nc), l=multipliers)
    return None


def solved_before(plan: Plan, states: trajectory.Trajectory, number: int) -> Before | None:
    """The reference of a problem that is not built, or its best iterate."""
    item = item_of(plan, states, number)
    found = solutions_of(plan, item.problem)[0]
    if found is None or found.refuted:
        return None
    return Before(number, item.problem, found.solution)


def solutions_of(
    plan: Plan, problem: Any
) -> tuple[Found | None, list[_core.Solution], Enumeration | None]:
    """The reference solution, all known ones if there are several, and the states of contacts."""
    found, states = reference(plan, problem), states_of_contacts(plan, problem)
    several, by = isolated_of(states), "enumeration"
    if found is not None:
        if not several and (more := references.others(problem, found)):
            several, by = [_core.Solution(r=found.solution.r, l=found.solution.l), *more], "nsn-ac"
        found = references.best_first(found, problem, several, by)
    return found, several, states


def store(
    plan: Plan, kept: Kept, item: Item, guess: _core.Solution | None, out: Path
) -> Before | None:
    """Write a problem's files, remove those of problems that it replaces, and return it."""
    is_global = item.problem.kind.startswith("global")
    simulated = not isinstance(plan.scene, scenes.Assembled)
    local = item.problem.condense() if is_global else item.problem
    sweeps = None
    if plan.select == "hard":
        trial = _solve.solve(local, "nsgs", tol=HARD_TOLERANCE, max_iterations=HARD_SWEEPS)
        sweeps = trial.iterations
    row = describe(plan, kept.looked, item)
    row |= {"nnz_W": nnz(local.W), "nsgs_sweeps": sweeps, "trivial": trivial(local)}
    found, several, states = solutions_of(plan, item.problem)
    if found is not None:
        row |= found.row | {"tol": plan.tol}
    words, known = known_of(plan, item.problem, local, found, states, row)
    info = stamped(item.problem.info, plan, kept.looked, words)
    for form in plan.forms if is_global else ("local",):
        path = Path(plan.name) / f"{kept.looked:04d}-{form}.hdf5"
        problem = item.problem if form == "global" else local
        mine = found
        if found is not None and is_global and form == "local":
            mine = references.carried(found, local)
        with_info = problem.replace(
            info=info,
            matrix_info={
                name: info
                for name, info in (known | dict(problem.matrix_info)).items()
                if getattr(problem, name, None) is not None
            },
        )
        own = [] if guess is None else [_core.Solution(r=guess.r, l=guess.l)]
        references.write(
            out / path, with_info, mine, own, several, compression=COMPRESSION, sync=False
        )
        if guess is None and simulated:
            _core.write_attributes(out / path, "info", {GUESS: NO_GUESS})
        row |= {f"{form}_file": path.as_posix(), f"{form}_sha256": catalog.sha256(out / path)}
    for gone in kept.add(row):
        for file, _ in catalog.files_of({**dict.fromkeys(catalog.FILES), **gone}):
            (out / file).unlink(missing_ok=True)
    if found is None or found.refuted:
        return None
    return Before(row["number"], item.problem, found.solution)


def known_of(
    plan: Plan,
    problem: Any,
    local: Any,
    found: Found | None,
    states: Enumeration | None,
    row: dict[str, Any],
) -> tuple[str, dict[str, _core.MatrixInfo]]:
    """MATH_INFO and MATRIX_INFO of a problem; the known facts also go into its row.

    With references, the cheap facts; with Plan.analyze, all; without both, none.
    """
    if not plan.analyze and not plan.references:
        return "", {}
    from fclib import analysis  # the import takes a while

    if plan.analyze:
        whole = analysis.analyze(problem, tol=TOLERANCE)
        row |= {name: whole.record.get(name) for name in catalog.ANALYSIS}
        return whole.words, whole.matrix_info
    brief = analysis.brief(
        problem,
        local,
        found.solution if found is not None and found.ok else None,
        refuted=found is not None and found.refuted,
        states=states,
    )
    row |= {name: brief.record.get(name) for name in catalog.ANALYSIS}
    return brief.words, brief.matrix_info


def states_of_contacts(plan: Plan, problem: Any) -> Enumeration | None:
    """All solutions by contact states, for a family with several, or for a few contacts."""
    family = getattr(plan.scene, "family", None)
    if not plan.references or not (getattr(family, "several", False) or is_small(problem)):
        return None
    from fclib import analysis

    return analysis.enumerate_solutions(problem)


def is_small(problem: Any) -> bool:
    """Whether trying all contact states is cheaper than the solve: a tenth of a second."""
    most = SMALL_PLANAR if problem.spacedim == 2 else 1
    return bool(problem.nc <= most and problem.n + problem.p <= SMALL_UNKNOWNS)


def isolated_of(states: Enumeration | None) -> list[_core.Solution]:
    """All isolated solutions."""
    isolated = states.isolated if states is not None else ()
    return [_core.Solution(r=one.solution.r, l=one.solution.l) for one in isolated]


def describe(plan: Plan, number: int, item: Item) -> dict[str, Any]:
    """The row of a problem, without its solution and its files."""
    facts = facts_of(item.problem)
    return {
        "id": f"{plan.name}/{number:04d}",
        "collection": plan.collection,
        "version": plan.version,
        "family": plan.family,
        "number": number,
        "step": item.step,
        "time": item.time,
        "seed": plan.scene.seed,
        **facts,
        "bodies": item.bodies,
        **dict.fromkeys(
            ("open", "stick", "slide", "solver", "status", "tol", "error", "has_solution")
        ),
        "rating": ratings.class_of(plan.collection, facts["digest"]),
        "left_out": "; ".join(item.left_out) or None,
        **rights_of(plan),
    }


def facts_of(problem: Any) -> dict[str, Any]:
    """The columns of a row on a problem's data, whatever its origin."""
    mu = np.asarray(problem.mu)
    law = _laws.law_of(problem.kind)
    return {
        "title": problem.info.title,
        "formulation": problem.formulation,
        "law": law or ("Coulomb" if mu.any() else "none"),
        "spacedim": problem.spacedim,
        "n": problem.n,
        "p": problem.p,
        "nc": problem.nc,
        "density": problem.spacedim * problem.nc / problem.n if problem.n else None,
        "mu_min": float(mu.min()) if mu.size else None,
        "mu_max": float(mu.max()) if mu.size else None,
        "nnz_M": nnz(problem.M) if problem.n else None,
        "nnz_H": nnz(problem.H) if problem.n else None,
        "digest": _digest.digest(problem),
        **made_by(origin_of(problem.info)),
    }


def made_by(origin: Mapping[str, Any]) -> dict[str, Any]:
    """The columns of a row on the time step and the programs, from the origin of a problem."""

    def number(name: str) -> float | None:
        value = origin.get(name)
        return float(value) if isinstance(value, (int, float)) else None

    # a file of somebody else's may hold anything
    theta, law = number("theta"), str(origin.get("law", ""))
    own = origin.get("engine")
    engine = own if isinstance(own, dict) else {"name": own, "version": origin.get("version")}
    versions = {name: origin.get(name) for name in ("fclib", "mujoco", "scikit-fem")}
    versions |= {str(engine.get("name")): engine.get("version") if engine.get("name") else None}
    programs = [f"{name} {version}" for name, version in versions.items() if version]
    return {
        "h": number("time_step"),
        "theta": theta,
        "restitution": number("restitution"),
        "scheme": (law or None) if theta is None else f"Moreau-Jean, {law}",
        "engine": ", ".join(programs) or None,
        "elastic": "scikit-fem" in origin if origin.get("generator") == "fclib.simulate" else None,
    }


def nnz(matrix: Any) -> int:
    """The number of entries of a sparse or dense matrix."""
    return int(getattr(matrix, "nnz", np.size(matrix)))


def write_checkpoint(folder: Path, kept: Kept, out: Path, *, last: bool = False) -> None:
    """Store a checkpoint: the problems looked at, and those kept.

    From then on the catalogue has them too. The catalogue of a large collection is written less
    often, but always at the end.
    """
    _core.sync_files(folder)
    known = json.dumps({"looked": kept.looked, "rows": list(kept.rows.values())})
    write_text(folder / catalog.KEPT, known)
    start = time.monotonic()
    if last or LISTING * (start - kept.listed) >= kept.listing:
        catalog.gather(out)
        kept.listed = time.monotonic()
        kept.listing = kept.listed - start


def read_checkpoint(folder: Path, kept: Kept) -> None:
    """Read the checkpoint, if there is one."""
    path = folder / catalog.KEPT
    if path.is_file():
        known = json.loads(path.read_text(encoding="utf-8"))
        kept.looked = known["looked"]
        kept.rows = {row["number"]: row for row in known["rows"]}
