"""The stored states of rt444: the authors' scenes in Siconos, and which of their steps are kept.

    .venv/bin/python -m workshop.sets.rt444_states simulate BoxesStack --states DIR [--every 1]
    .venv/bin/python -m workshop.sets.rt444_states judge BoxesStack --states DIR
    .venv/bin/python -m workshop.sets.rt444_states choose BoxesStack --states DIR --out TR
    .venv/bin/python -m workshop.sets.rt444_states status --states DIR

`_rt444_scenes.py` has the scenes. Each command can be killed, and goes on where it was.

simulate    Siconos with Bullet, by fclib's recorder: each EVERY-th step as a file of DIR/SCENE. Its
            steps are solved here
judge       DIR/SCENE-sweeps.csv: the sweeps of our nsgs to 1e-8, up to MOST, on each EVERY-th step
            that does not nearly equal one before (the same contacts, and W within NEAR of its
            largest entry)
choose      of these the steps on which nsgs takes more than LEAST sweeps, as the authors' rule is:
            as many as the report has, evenly spread from a place that the seed draws

A step whose poses, velocities and contacts do not give Siconos' own W is left out, and one whose
bodies are deep in each other. Spheres is only simulated; it is no scene of the report.
"""

from __future__ import annotations

import argparse
import csv
import io
import math
import os
import signal
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from multiprocessing import Pipe
from pathlib import Path
from typing import Any, Final

import numpy as np
import scipy.sparse as sp

import fclib
from fclib import _digest
from fclib._geometry import rotations
from fclib.collections import handed, trajectory
from fclib.external import siconos
from fclib.recorders import _siconos
from fclib.scenes import Scene as Described
from fclib.simulate.rounding import exponent_of
from workshop.sets._rt444_scenes import SCENES, Body, Scene

RUN: Final = "run-"  # the folders of the steps that one command recorded
SCRIPT: Final = Path(__file__).with_name("_siconos_rt444.py")
PROBLEMS: Final = {"BoxesStack": 1514, "Capsules": 1705, "KaplasTower": 201}  # of the report
LEAST: Final = 80  # sweeps: a step that takes more may be kept
TOLERANCE: Final = 1e-8
DRIVEN: Final = 2.0  # limit of a step of a simulation [s]; its best iterate is taken
MOST: Final = LEAST + 1  # sweeps of the judgement: enough to choose
NEAR: Final = 1e-6
SEED: Final = 0
GRAVITY: Final = 9.80665  # [m/s^2] Siconos' own
# W that follows from the states, before they are rounded, against Siconos' own: the normal
# components, relative to the largest entry
EXACT: Final = 1e-8
# penetration, of the smallest edge: Bullet tells deeper ones of a few contacts, and Siconos leaves
# bodies in each other
DEEPEST: Final = 0.2
AUTHORS: Final = "V. Acary, M. Bremond, T. Koziara, F. Perignon"
CHOSEN: Final = (
    "inertias of homogeneous bodies; boxes as Bullet's primitives; the distance from which Bullet"
    " looks for contacts; one iteration of Newton's a step, by fclib's auto to 1e-8; tangents"
)
# as the families here call them
SIZES: Final[dict[str, dict[str, Any]]] = {
    "BoxesStack": {"boxes": 50, "size": 2.0},
    "KaplasTower": {
        **{"levels": 11, "planks": 12, "length": 11.74, "width": 2.348, "thickness": 0.78267}
    },
    "Capsules": {"capsules": 100, "length": 5.0, "radius": 1.0},
}
WORDS: Final = {
    "BoxesStack": (
        "Stack of boxes",
        "50 cubes that start above each other and drop one upon another, under gravity.",
        "multibody systems, masonry",
    ),
    "KaplasTower": (
        "Tower of kaplas",
        "Rings of wooden planks on edge that drop one upon another, under gravity.",
        "masonry, multibody systems",
    ),
    "Capsules": (
        "Capsules in a box",
        "Capsules that start above each other and drop into an open box, under gravity.",
        "granular matter",
    ),
}


# ---- simulation


def simulate(name: str, folder: Path, every: int, end: float) -> None:
    """Go on from the last recorded step, up to the end [s]."""
    if word := siconos.missing():
        sys.exit(word)
    before = files(folder)
    runs = [int(path.name.removeprefix(RUN)) for path in folder.glob(f"{RUN}*")]
    run = folder / f"{RUN}{max(runs, default=-1) + 1}"
    run.mkdir(parents=True)
    start = [str(before[max(before)].resolve())] if before else []
    command = [siconos.python(), str(_siconos.STEPS), str(run), str(every), str(SCRIPT)]
    # so that Siconos ends with this command
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    here, there = Pipe()
    environment = os.environ | dict.fromkeys(siconos.THREADS, "1")
    environment["FCLIB_SOLVES"] = str(there.fileno())
    with subprocess.Popen(
        [*command, name, str(end), *start],
        stdout=subprocess.DEVNULL,
        env=environment,
        pass_fds=[there.fileno()],
    ) as process:
        there.close()
        try:
            solves(here)
        except BaseException:
            process.kill()
            raise
    if process.returncode:
        sys.exit(
            f"{name}: Siconos ended with status {process.returncode}; the same command goes on"
        )


def solves(connection: Any) -> None:
    """Answer Siconos' problems with reactions, until it ends."""
    while True:
        try:
            told = np.load(io.BytesIO(connection.recv_bytes()))
        except EOFError:
            return
        m = told["q"].size
        W = sp.csc_array((told["data"], told["indices"], told["indptr"]), shape=(m, m))
        problem = fclib.LocalProblem(spacedim=3, W=W, q=told["q"], mu=told["mu"])
        found = fclib.solve(problem, tol=TOLERANCE, time_limit=DRIVEN)
        connection.send_bytes(np.ascontiguousarray(found.solution.r).tobytes())


def files(folder: Path) -> dict[int, Path]:
    """The recorded steps by their numbers; of a step that was simulated twice the last."""
    found: dict[int, Path] = {}
    for run in sorted(folder.glob(f"{RUN}*"), key=lambda path: int(path.name.removeprefix(RUN))):
        paths = sorted(run.glob("*.npz"))
        if paths and not whole(paths[-1]):  # a kill interrupted it
            paths.pop()
        if not paths:
            continue
        step = _siconos.told(paths[0])
        # files count the steps of their run
        before = round(step.start / step.h) - int(paths[0].stem)
        own = {before + int(path.stem): path for path in paths}
        # what was simulated after the state from which this run went on
        found = {number: path for number, path in found.items() if number < min(own)} | own
    return found


def whole(path: Path) -> bool:
    try:
        _siconos.told(path)
    except (OSError, EOFError, ValueError, zipfile.BadZipFile):
        return False
    return True


# ---- problems


@dataclass(frozen=True)
class State:
    """A recorded step, with its contacts by numbers of solids."""

    number: int  # step of the simulation
    told: Any
    body: Any

    @classmethod
    def read(cls, number: int, path: Path, bodies: list[Body]) -> State:
        told = _siconos.told(path)
        free = np.array([i for i, body in enumerate(bodies) if body.mass])
        fixed = [i for i, body in enumerate(bodies) if not body.mass]
        own = np.where(told.body < 0, -1, free[told.body])
        for c in np.flatnonzero(own[:, 0] < 0):
            away = [distance(bodies[i], told.point[c]) for i in fixed]
            own[c, 0] = fixed[int(np.argmin(away))]
        return cls(number, told, own)


def distance(body: Body, point: Any) -> float:
    """How far a point is from a fixed box."""
    turn = rotations(np.array([body.turn]))[0]
    beyond = np.abs(turn.T @ (point - np.array(body.place))) - np.array(body.sizes) / 2
    return float(np.linalg.norm(np.maximum(beyond, 0)) + min(beyond.max(), 0.0))


def solid(body: Body) -> handed.Solid:
    """A body as it is stored."""
    along_y = (math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0)  # from z
    size = tuple(0.5 * edge for edge in body.sizes)
    if body.kind == "capsule":
        size = (body.sizes[0], 0.5 * body.sizes[1])
    return handed.Solid(
        name=body.name,
        kind=body.kind,
        size=size,
        mass=body.mass,
        inertia=body.inertia if body.mass else (0.0, 0.0, 0.0),
        place=body.place,
        turn=body.turn,
        **({"shape_turn": along_y} if body.kind == "capsule" else {}),
    )


def stored(states: list[State], scene: Scene, exponent: int | None) -> Any:
    """Poses, velocities and contacts of states, rounded if there is an exponent."""

    def rounded(values: Any) -> Any:
        return values if exponent is None else trajectory.rounded(values, exponent)

    contacts = handed.Handed(
        solids=tuple(solid(body) for body in scene.bodies()),
        mu=scene.mu,
        theta=scene.theta,
        gravity=GRAVITY,
        count=np.array([len(state.body) for state in states]),
        body=np.concatenate([state.body for state in states]),
        feature=np.concatenate([state.told.feature for state in states]),
        point=rounded(np.concatenate([state.told.point for state in states])),
        normal=rounded(np.concatenate([state.told.normal for state in states])),
        gap=rounded(np.concatenate([state.told.gap for state in states])),
    )
    position = rounded(np.stack([state.told.position.ravel() for state in states]))
    velocity = rounded(np.stack([state.told.velocity.ravel() for state in states]))
    return position, velocity, contacts


def problem_of(state: State, scene: Scene, exponent: int | None = None) -> Any:
    """The problem of a step."""
    position, velocity, contacts = stored([state], scene, exponent)
    info = fclib.ProblemInfo()
    return contacts.problem(0, position[0], velocity[0], scene.step, info)


def exponent_for(scene: Scene) -> int:
    """The quantum of the stored states."""
    return exponent_of(0.5 * thinnest(scene))


def thinnest(scene: Scene) -> float:
    """The smallest diameter or edge of a body that moves."""
    return 2 * min(min(solid(body).size) for body in scene.bodies() if body.mass)


def apart(state: State, problem: Any) -> tuple[float, float]:
    """How far W and q of a step's problem are from Siconos' own.

    Of their normal components, relative to the largest entry. Siconos' q has, to a share 1 - theta,
    the gyroscopic moments of the step before.
    """
    local = problem.condense()
    n = slice(0, None, 3)
    W, own = local.W.toarray()[n, n], state.told.W.toarray()[n, n]
    w = float(np.abs(W - own).max() / np.abs(own).max())
    q = float(np.abs(local.q[n] - state.told.q[n]).max() / np.abs(state.told.q).max())
    return w, q


# ---- choice


def judged(folder: Path) -> dict[int, int]:
    """The sweeps of the steps that were judged."""
    path = sweeps_of(folder)
    if not path.is_file():
        return {}
    with path.open(newline="") as file:
        return {int(row["step"]): int(row["sweeps"]) for row in csv.DictReader(file)}


def sweeps_of(folder: Path) -> Path:
    """The table of a scene's steps and their sweeps."""
    return folder / "sweeps.csv"


def distinct(name: str, folder: Path, every: int) -> Iterator[State]:
    """One recorded step in so many, but for those that nearly equal another."""
    bodies = SCENES[name].bodies()
    kept: dict[bytes, list[tuple[Any, Any]]] = {}
    for number, path in list(files(folder).items())[::every]:
        state = State.read(number, path, bodies)
        # contacts in the order of their bodies and places: another step may list them otherwise
        order = np.lexsort((*state.told.point.T, *state.body.T))
        places = (3 * order[:, None] + np.arange(3)).ravel()
        W = sp.csr_array(state.told.W)[places][:, places]
        W.sort_indices()
        own = W.diagonal()
        others = kept.setdefault(state.body[order].tobytes(), [])
        if any(
            np.abs(own - diagonal).max() <= NEAR * own.max() and near(W, other)
            for diagonal, other in reversed(others)
        ):
            continue
        others.append((own, W))
        yield state


def near(W: Any, other: Any) -> bool:
    """Whether two matrices of the same contacts are nearly equal."""
    return bool(abs(W - other).max() <= NEAR * abs(other).max())


def judge(name: str, folder: Path, every: int, most: int) -> None:
    """Append the sweeps of each distinct step that is not judged yet."""
    scene, known = SCENES[name], judged(folder)
    path = sweeps_of(folder)
    if not known:
        path.write_text("step,contacts,dof,sweeps\n", encoding="utf-8")
    for state in distinct(name, folder, every):
        if state.number in known:
            continue
        problem = problem_of(state, scene)
        deep = -float(problem.contacts.gap.min()) > DEEPEST * thinnest(scene)
        if deep or not apart(state, problem)[0] <= EXACT:
            continue
        found = fclib.solve(
            problem.condense(), "nsgs", tol=TOLERANCE, max_iterations=most, time_limit=math.inf
        )
        with path.open("a", encoding="utf-8") as file:
            file.write(f"{state.number},{problem.nc},{problem.n},{found.iterations}\n")


def candidates(name: str, folder: Path) -> list[int]:
    """The steps that nsgs takes more than LEAST sweeps for, in their order."""
    return sorted(step for step, count in judged(folder).items() if count > LEAST)


def spread(found: list[Any], count: int, seed: int) -> list[Any]:
    """So many at equal distances, from a place that the seed draws."""
    distance = len(found) / count
    first = np.random.default_rng(seed).uniform(0, distance)
    return [found[int(first + k * distance)] for k in range(count)]


def choose(name: str, folder: Path, out: Path, version: str, count: int) -> Path:
    """Write the trajectory of the chosen steps."""
    scene = SCENES[name]
    found = candidates(name, folder)
    if len(found) < count:
        raise SystemExit(
            f"{name}: {len(found)} different steps take nsgs more than {LEAST} sweeps, and"
            f" {count} are asked for: simulate more of it, or each step (--every 1), and judge them"
        )
    recorded = files(folder)
    states = [
        State.read(number, recorded[number], scene.bodies())
        for number in spread(found, count, SEED)
    ]
    worst = np.max([apart(state, problem_of(state, scene)) for state in states], axis=0)
    exponent = exponent_for(scene)
    position, velocity, contacts = stored(states, scene, exponent)
    title, description, application = WORDS[name]
    described = Described(
        name=name,
        time_step=scene.step,
        theta=scene.theta,
        gyroscopic=True,
        seed=SEED,
        title=title,
        description=description,
        application=application,
        authors=AUTHORS,
        friction="Coulomb, the same coefficient everywhere",
        parameters={**SIZES[name], "mu": scene.mu, "end": scene.end},
    )
    made = trajectory.Trajectory(
        scene=described,
        origin={
            "collection": "rt444",
            "version": version,
            "engine": {
                "name": "Siconos, with Bullet",
                "version": siconos.version().partition(" in ")[0],
            },
            "script": f"FrictionalContactLibrary/fclib-scripts, {scene.script}",
            "chosen here": CHOSEN,
            "settings": {
                "fclib": fclib.__version__,
                "kept": f"nsgs to {TOLERANCE:g} takes more than {LEAST} sweeps; evenly spread",
                "W_from_engine": float(worst[0]),
                "q_from_engine": float(worst[1]),
            },
        },
        exponent=exponent,
        number=np.arange(count),
        step=np.array([state.number for state in states]),
        position=position,
        velocity=velocity,
        handed=contacts,
    )
    problems = [made.problem(k).problem for k in range(count)]
    digests = tuple(_digest.digest(problem) for problem in problems)
    if len(set(digests)) < count:
        raise SystemExit(f"{name}: two of the chosen problems are equal")
    made = replace(
        made,
        digest=digests,
        structure=tuple(_digest.structure(problem) for problem in problems),
        sketch=np.stack([_digest.sketch(problem) for problem in problems]),
    )
    path = out / f"rt444/{name}-{version}{trajectory.SUFFIX}"
    trajectory.write(path, made)
    print(
        f"{path}: {count} of {len(found)} steps, {path.stat().st_size} bytes;"
        f" W differs from Siconos' by {worst[0]:.1e}, q by {worst[1]:.1e}"
    )
    return path


def status(states: Path) -> None:
    """How far each scene is."""
    for name in PROBLEMS:
        scene, folder = SCENES[name], states / name
        found = files(folder)
        print(
            f"{name}: {max(found, default=0) * scene.step:.2f} of {scene.end:g} s,"
            f" {len(found)} steps recorded, {len(judged(folder))} different ones judged,"
            f" {len(candidates(name, folder))} of them take more than {LEAST} sweeps;"
            f" wanted {PROBLEMS[name]}"
        )


def main() -> None:
    """One command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("command", choices=("simulate", "judge", "choose", "status"))
    parser.add_argument("scene", nargs="?", choices=list(SCENES))
    parser.add_argument("--states", type=Path, required=True, help="folder of recorded steps")
    parser.add_argument("--every", type=int, default=1, help="one step in so many")
    parser.add_argument("--end", type=float, help="of a simulation [s]; by default the scene's")
    parser.add_argument("--most", type=int, default=MOST, help="sweeps of a judgement")
    parser.add_argument("--out", type=Path, help="folder of trajectories")
    parser.add_argument("--version", default="1")
    parser.add_argument("--count", type=int, help="problems; by default as in the report")
    own = parser.parse_args()
    if own.command == "status":
        return status(own.states)
    if own.scene is None or (own.command == "choose" and own.out is None):
        parser.error("name a scene, and a folder for choose (--out)")
    if own.command != "simulate" and own.scene not in PROBLEMS:
        parser.error(f"{own.scene} is only simulated: it is no scene of the report")
    folder = own.states / own.scene
    if own.command == "simulate":
        simulate(own.scene, folder, own.every, own.end or SCENES[own.scene].end)
    elif own.command == "judge":
        judge(own.scene, folder, own.every, own.most)
    else:
        choose(own.scene, folder, own.out, own.version, own.count or PROBLEMS[own.scene])
    return None


if __name__ == "__main__":
    main()
