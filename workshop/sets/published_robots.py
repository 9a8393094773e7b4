"""The default solver on the robots that installed Python packages ship as MJCF or URDF files.

    python -m workshop.sets.published_robots OUT [--package metaworld dm_control ...]
        [--model NAME ...] [--steps 100] [--tol 1e-8] [--limit 10] [--every 1] [--results NAME]

Each model is simulated by FCLIB (Moreau-Jean, the velocity law) from where its file puts it, with
random controls from a fixed seed, new in each step. Each problem with contacts or joints at their
limits is solved once more, from nothing and by both merits. A robot of a URDF file moves freely if
its root is not the world, and a plane lies below it. The files are read, not imported: a package
may be installed without what it needs (`pip install --no-deps`), also into a folder of its own that
PYTHONPATH names.

An unsolved problem is written to OUT and tried by other solvers, so that one sees whether it is
hard or whether what is left of it is rounding: ||q|| at most its rounding, or an error of that
size. What a problem cannot hold is left out, as `fclib simulate` does without a flag.
"""

from __future__ import annotations

import argparse
import re
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse.linalg as spl

import fclib
from fclib.scenes import Scene
from fclib.simulate import simulate
from workshop.tables import _results

# packages whose MJCF files are not robots of others
NOT_THESE = ("fclib", "mujoco", "mujoco_core", "mujoco_studio")
GROUND = 0.7  # friction of the plane below a robot of a URDF file, which names none
UNIT = 32 * np.finfo(float).eps  # of core/merit/equations.cpp: some roundings of each term


@dataclass(frozen=True)
class Robot:
    """A file that a package ships."""

    package: str
    path: Path
    name: str  # within the package


@dataclass
class Tally:
    """What became of the problems of a model."""

    statuses: Counter[str] = field(default_factory=Counter)
    seconds: float = 0.0  # of all solves from nothing
    slowest: float = 0.0
    trouble: str = ""  # why it was not simulated, or not to its end


def robots(packages: list[str] | None = None) -> Iterator[Robot]:
    """The models of installed packages, package by package; of these names if given."""
    wanted = None if packages is None else {_plain(name) for name in packages}
    seen: set[Path] = set()
    for distribution in sorted(metadata.distributions(), key=lambda d: _plain(d.name)):
        name = _plain(distribution.name)
        if name in NOT_THESE or (wanted is not None and name not in wanted):
            continue
        for file in sorted(distribution.files or []):
            path = Path(str(distribution.locate_file(file)))
            if file.suffix not in (".xml", ".urdf") or path in seen or not path.is_file():
                continue
            seen.add(path)
            text = path.read_text(encoding="utf-8", errors="replace")
            # not a part that others include
            whole = re.search(r"<mujoco[\s>]", text) and re.search("<worldbody|<include", text)
            if whole or file.suffix == ".urdf":
                yield Robot(name, path, "/".join(file.parts[1:]))


def _plain(name: str) -> str:
    """A package's name as all of its spellings."""
    return name.lower().replace("-", "_").replace(".", "_")


def scene_of(path: Path) -> Scene:
    """The scene of a model; raises as `Scene.from_file` does."""
    if path.suffix != ".urdf":
        return Scene.from_file(path)
    try:
        return Scene.from_file(path, ground=GROUND, floating=True)
    except ValueError:
        # its root is the world
        return Scene.from_file(path, ground=GROUND)


def problems(path: Path, steps: int, seed: int = 0, **options: Any) -> Iterator[Any]:
    """The problems of a model's steps, those with contacts; raises as `simulate` does."""
    scene = scene_of(path)
    rng = np.random.default_rng(seed)
    for step in simulate(scene, steps, **options):
        model, data = step.model.model, step.model.data  # type: ignore[union-attr]
        if model.nu:
            # the step's problem is made: these are the next one's
            limited = model.actuator_ctrllimited.astype(bool)
            low, high = model.actuator_ctrlrange.T
            data.ctrl[:] = rng.uniform(np.where(limited, low, -1.0), np.where(limited, high, 1.0))
        if step.problem.nc:
            yield step.problem


def free_velocity(problem: Any) -> tuple[float, float]:
    """||q|| [m/s] of a global problem, condensed, and what rounding leaves of it.

    As the merit has it (core/merit/equations.cpp): what M^-1 f and H^T v + w add up, and errors of
    the momentum's size with random signs.
    """
    M, H = problem.M, problem.H
    mass = spl.splu(M.tocsc())
    v = mass.solve(problem.f)
    q = H.T @ v + problem.w
    size = abs(M) @ abs(v) + abs(problem.f)
    if problem.p:
        G = problem.G
        stop = abs(G).T @ abs(v) + abs(problem.b)
        diagonal = np.array([g @ mass.solve(g) for g in G.T.toarray()])
        size += abs(G) @ (stop / np.where(diagonal > 0, diagonal, 1.0))
    rng = np.random.default_rng(0)
    signs = rng.choice((-1.0, 1.0), size=(4, problem.n))
    spread = np.sqrt(np.mean([(H.T @ mass.solve(size * s)) ** 2 for s in signs], axis=0))
    terms = abs(H).T @ abs(v) + abs(problem.w)
    return float(np.linalg.norm(q)), float(np.linalg.norm(UNIT * (terms + spread)))


def solve_all(robot: Robot, out: Path, arguments: argparse.Namespace) -> Tally:
    """Solve the problems of a model from nothing; what is left goes to `out`, and is shown."""
    tally = Tally()
    settings = {"tol": arguments.tol, "time_limit": arguments.limit}
    try:
        found = problems(robot.path, arguments.steps, **settings)
        for number, problem in enumerate(found):
            if number % arguments.every:
                continue
            start = time.perf_counter()
            result = fclib.solve(problem, "auto", **settings)
            took = time.perf_counter() - start
            tally.statuses[result.status] += 1
            tally.seconds += took
            tally.slowest = max(tally.slowest, took)
            if not result.converged:
                look_at(robot, problem, result, out, arguments)
    except (ValueError, ArithmeticError, MemoryError, OSError, fclib.Error) as error:
        tally.trouble = " ".join(str(error).split())
    return tally


def look_at(
    robot: Robot, problem: Any, result: Any, out: Path, arguments: argparse.Namespace
) -> None:
    """Store an unsolved problem, and show what is known of it."""
    step = problem.info.title.rsplit(" ", 1)[-1]
    stem = robot.name.removesuffix(".xml").replace("/", "-")
    path = out / f"{robot.package}-{stem}-{step}.hdf5"
    fclib.write(path, problem, solution=result.solution)
    q, rounding = free_velocity(problem)
    merit = fclib.merit(problem, result.solution)
    print(
        f"    {result.status}: nc {problem.nc}, p {problem.p}, ||q|| {q:.2g}, rounding"
        f" {rounding:.2g}, natural {merit.natural:.2g}, scaled {merit.scaled_natural:.2g},"
        f" dynamics {merit.dynamics:.2g}, bilateral {merit.bilateral:.2g}; {path}"
    )
    for name in arguments.others:
        try:
            other = fclib.solve(problem, name, tol=arguments.tol, time_limit=arguments.limit)
        except fclib.Error as error:
            print(f"        {name:10}{error}")
        else:
            print(f"        {name:10}{other.status:16}{other.error:.2g}", flush=True)


def main() -> None:
    """Print the table, a model a line, and a sum of each package."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path, help="folder of the unsolved problems")
    parser.add_argument("--package", nargs="+", help="by default all that have MJCF files")
    parser.add_argument("--model", nargs="+", help="models whose name has one of these")
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--every", type=int, default=1, help="solve one problem in so many")
    parser.add_argument("--tol", type=float, default=1e-8)
    parser.add_argument("--limit", type=float, default=10.0, help="[s] for each solve")
    parser.add_argument("--others", nargs="*", default=[], help="solvers that try what is left")
    _results.add_option(parser)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)

    print(
        f"{'problems':>9}{'solved':>8}{'proven':>8}{'stalled':>8}{'others':>8}{'max s':>8}  model"
    )
    sums: dict[str, Tally] = {}
    files: Counter[str] = Counter()
    models: Counter[str] = Counter()
    refused: Counter[str] = Counter()
    broken: Counter[str] = Counter()
    for robot in robots(arguments.package):
        if arguments.model and not any(part in robot.name for part in arguments.model):
            continue
        tally = solve_all(robot, arguments.out, arguments)
        total = sums.setdefault(robot.package, Tally())
        files[robot.package] += 1
        if not tally.statuses:
            refused[robot.package] += bool(tally.trouble)
        else:
            models[robot.package] += 1
            broken[robot.package] += bool(tally.trouble)
            total.statuses += tally.statuses
            total.slowest = max(total.slowest, tally.slowest)
        show(tally, f"{robot.package} {robot.name}")
    print()
    for package, total in sums.items():
        show(
            total, f"{package}: {models[package]} models with problems, {refused[package]} refused"
        )
    everything = Tally()
    for total in sums.values():
        everything.statuses += total.statuses
        everything.slowest = max(everything.slowest, total.slowest)
    show(everything, f"all: {sum(models.values())} models with problems")
    if arguments.results:
        rows = [
            {
                "package": package,
                "version": metadata.version(package),
                "files": files[package],
                "no model, or refused": refused[package],
                "models with problems": models[package],
                "ended before the last step": broken[package],
                "problems": sum(total.statuses.values()),
                "solved": total.statuses["converged"],
                "proven to have no solution": total.statuses["infeasible"],
                "slowest [s]": total.slowest,
            }
            for package, total in sums.items()
        ]
        _results.store(
            arguments.results,
            rows,
            title="Robots that Python packages ship",
            note=f"{arguments.steps} steps of each file, to {_results.power(arguments.tol)}, at"
            f" most {arguments.limit:g} s a problem; the slowest by the wall clock.",
        )


def show(tally: Tally, name: str) -> None:
    """One line of the table."""
    kinds = ("converged", "infeasible", "stalled")
    counts = [tally.statuses[kind] for kind in kinds]
    everything = sum(tally.statuses.values())
    columns = "".join(f"{count:8d}" for count in (*counts, everything - sum(counts)))
    trouble = f": {tally.trouble[:150]}" if tally.trouble else ""
    print(f"{everything:9d}{columns}{tally.slowest:8.2f}  {name}{trouble}", flush=True)


if __name__ == "__main__":
    main()
