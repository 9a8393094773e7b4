"""The stored steps of the set `simulators`: a pile of boxes that comes down, in each engine.

    PYTHON -m workshop.sets.record_simulators OUT [--engine Drake ...]

PYTHON has fclib, Drake, Newton and PyBullet; Siconos has an interpreter of its own
(fclib.external.siconos). OUT gets a file for each engine; they go to
`python/fclib/scenes/recorded/`. Another version of an engine, or another machine, makes other
steps: problems are made from the stored ones.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

import fclib
from fclib import recorders
from fclib.recorders._siconos import steps as steps_of_siconos
from fclib.scenes.shared import recorded
from workshop.tables import recorded_steps
from workshop.tables.recorded_steps import BOXES, SICONOS, SIZE

LEAN: Final = 0.06  # [m] so far that the pile comes down
KEPT: Final = 16  # steps of each engine


def drakes() -> Iterator[tuple[Any, Any, Any]]:
    """Recorded steps, and places and turns of the boxes at their starts."""
    plant, simulator = recorded_steps.drake_pile(LEAN)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    boxes = [plant.GetBodyByName(f"box{i}") for i in range(BOXES)]
    while True:
        poses = [plant.EvalBodyPoseInWorld(context, box) for box in boxes]
        places = np.array([pose.translation() for pose in poses])
        turns = np.array([pose.rotation().ToQuaternion().wxyz() for pose in poses])
        yield recorders.drake(plant, context), places, turns
        simulator.AdvanceTo(context.get_time() + plant.time_step())


def bullets() -> Iterator[tuple[Any, Any, Any]]:
    """The same of PyBullet."""
    bullet, client, boxes = recorded_steps.bullet_pile(LEAN)
    for body in (0, *boxes):
        # coefficients multiply
        bullet.changeDynamics(body, -1, lateralFriction=np.sqrt(0.5))
    while True:
        poses = [bullet.getBasePositionAndOrientation(box) for box in boxes]
        places, turns = (np.array([pose[k] for pose in poses]) for k in (0, 1))
        yield recorders.pybullet(client), places, turns[:, [3, 0, 1, 2]]


def newtons() -> Iterator[tuple[Any, Any, Any]]:
    """The same of Newton."""
    solver, states = recorded_steps.newton_pile(LEAN)
    while True:
        poses = states[0].body_q.numpy().astype(float)
        solver.step(*states, None, None, 2e-3)
        states.reverse()
        yield recorders.newton(solver), poses[:, :3], poses[:, [6, 3, 4, 5]]


def siconoses() -> Iterator[tuple[Any, Any, Any]]:
    """The same of Siconos, which tells only matrices: without places and turns."""
    steps = 1 + KEPT * ENGINES["Siconos"].every
    arguments = recorded_steps.siconos_pile(steps, LEAN)
    for one in steps_of_siconos(SICONOS, arguments, 1):
        yield one, None, None


@dataclass(frozen=True)
class Engine:
    """An engine's steps, and how what it tells is to be read."""

    steps: Callable[[], Iterator[tuple[Any, Any, Any]]]
    first: int  # its number of the first box
    every: int  # steps from one that is kept to the next, about
    unknowns: str = "velocity of each box, then its spin"


ENGINES: Final = {
    "Drake": Engine(drakes, 1, 24, "spin of each box, then its velocity"),
    "Newton": Engine(newtons, 0, 30),
    "PyBullet": Engine(bullets, 1, 18),
    "Siconos": Engine(siconoses, 1, 21, "velocity of each box, then its spin in its own frame"),
}


def record(name: str, out: Path) -> None:
    """Write the file of an engine."""
    engine = ENGINES[name]
    kept: list[recorded.Step] = []
    about: dict[str, Any] = {}
    due = engine.every
    for number, (one, places, turns) in enumerate(engine.steps()):
        # if nothing touches, the next step that has contacts
        if number >= due and one is not None and one.assembled.problem.nc:
            due += engine.every
            kept.append(step_of(one, number, places, turns, engine.first))
            about = {
                "engine": {"name": one.engine, "version": one.version, "licence": one.licence},
                "law": one.law,
                "notes": " ".join(one.notes),
                "unknowns": engine.unknowns,
                "fields": dict(one.fields),
            }
            problem = one.assembled.problem
            print(f"{name} {number}: {problem.nc} contacts, velocity off {one.mismatch:.0e} m/s")
        if len(kept) == KEPT:
            break
    path = out / f"{name}Boxes.npz"
    made = recorded.File(about, np.full((BOXES, 3), SIZE), tuple(kept))
    digests = [fclib.digest(recorded.problem_of(made, number)) for number in range(KEPT)]
    recorded.write(path, replace(made, digests=tuple(digests)))
    print(f"{path}: {path.stat().st_size} bytes")


def step_of(one: Any, number: int, places: Any, turns: Any, first: int) -> recorded.Step:
    """A recorded step as it is stored; the ground becomes 0, the boxes 1, 2, ..."""
    problem, contacts = one.assembled.problem, one.contacts
    geometry = {}
    if places is not None:
        geometry = {
            "body": np.maximum(np.asarray(contacts.bodies) - first + 1, 0).astype(np.int32),
            "point": contacts.point,
            "normal": contacts.frame[:, 0],
            "tangent": contacts.frame[:, 1],
            "gap": contacts.gap,
            "place": places,
            "turn": turns,
        }
    return recorded.Step(
        # PyBullet does not tell the time
        time=np.array([number * one.h]),
        step=np.array([one.h]),
        M=problem.M,
        H=problem.H,
        f=problem.f,
        w=problem.w,
        mu=problem.mu,
        reaction=one.guess.r,
        velocity=np.asarray(one.velocity, dtype=float),
        **geometry,
    )


def main() -> None:
    """Write the files."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--engine", action="append", choices=list(ENGINES))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name in arguments.engine or ENGINES:
        record(name, arguments.out)


if __name__ == "__main__":
    main()
