"""Simulate a scene into a trajectory. Only this makes new problems.

Each step is solved as precisely as the plan says, to go on to the next one. A state is stored if
the problem assembled from it has a contact. It is the state at the start of the step, relaxed if
bodies are too deep in each other, and rounded. That problem, and no other, belongs to the family.
The simulation itself goes on from the unrounded state that it reached.
"""

from __future__ import annotations

import io
import json
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fclib import _core, _digest, scenes
from fclib._files import write_bytes
from fclib.collections import trajectory
from fclib.collections.plan import Plan

if TYPE_CHECKING:
    from fclib.simulate import State

CHECKPOINT = 5.0  # seconds between two checkpoints

Progress = Callable[[str, int, int], None]  # name, problems looked at, their number


@dataclass
class Recorded:
    """The states kept, and the number of problems looked at."""

    looked: int = 0
    # steps of the simulation that were not solved
    unsolved: list[int] = field(default_factory=list)
    number: list[int] = field(default_factory=list)
    step: list[int] = field(default_factory=list)
    position: list[Any] = field(default_factory=list)
    velocity: list[Any] = field(default_factory=list)
    digest: list[str] = field(default_factory=list)
    structure: list[str] = field(default_factory=list)
    sketch: list[Any] = field(default_factory=list)
    guess: list[Any] = field(default_factory=list)  # None: not known

    def add(self, step: int, position: Any, velocity: Any, problem: Any, guess: Any) -> None:
        """Keep a state as the problem of number `looked`."""
        self.number.append(self.looked)
        self.step.append(step)
        self.position.append(position)
        self.velocity.append(velocity)
        self.digest.append(_digest.digest(problem))
        self.structure.append(_digest.structure(problem))
        self.sketch.append(_digest.sketch(problem))
        self.guess.append(guess)


def record(plan: Plan, target: Path, checkpoint: Path, report: Progress | None = None) -> None:
    """Simulate the scene of a plan, and write its trajectory; go on if a kill interrupted it.

    Args:
        plan: the scene, the number of problems, and the settings of the simulation.
        target: the file to write. It must not exist.
        checkpoint: a file to go on from; removed at the end.
        report: called with the plan's name, the problems looked at and their number.

    If the simulation cannot go on, and the plan gives a number of steps, the plan ends: the states
    before are stored, and `stopped` in the trajectory's origin says why. If the plan gives a
    number of problems, it fails.

    Raises:
        TypeError: the family is assembled directly, and so has no states.
        FileExistsError, OSError: the file exists already, or cannot be written.
        ValueError, FloatingPointError, MemoryError, ImportError: as `fclib.simulate.simulate`
            raises them.
    """
    if isinstance(plan.scene, scenes.Assembled):
        raise TypeError(f"{plan.name} is assembled directly: there is nothing to simulate")
    if target.exists():
        raise FileExistsError(f"{target}: is there already, and a trajectory is never rewritten")
    from fclib.simulate import (
        StoppedError,
        carried_to,
        control_of,
        model_of,
        problem_at,
        relaxed,
        scheme_of,
        simulate,
    )

    way = plan.simulation
    # a second model assembles the states, as later from the file
    model = model_of(plan.scene)
    scheme = scheme_of(model, way.stabilization)
    exponent = trajectory.exponent_of(model)
    kept, start = read_checkpoint(checkpoint)
    # a scene without any contact would go on for ever
    most = plan.steps if plan.steps is not None else max(20 * plan.total, 5000)
    # a step that starts at the end does not count, whatever the last digits of its time
    first = math.ceil(plan.scene.begin / scheme.h - 1e-6)
    done = start.index if start is not None else 0
    last = time.monotonic()
    march: Iterator[At]
    if way.states:
        march = logged_ones(model, Path(way.states), most, done)
    else:
        march = (
            At(step.index, step.start, step.result.converged)
            for step in simulate(
                plan.scene,
                most - done,
                solver=way.solver,
                tol=way.tol,
                stabilization=way.stabilization,
                start=start,
                control=control_of(way.control) if way.control else None,
                unsolved=way.unsolved,
                **way.options,
            )
        )
    stopped = ""
    while True:
        try:
            step = next(march, None)
        except StoppedError as error:
            if plan.problems is not None or not kept.number:
                raise
            stopped = str(error)
            break
        if step is None:
            break
        if time.monotonic() - last > CHECKPOINT:
            write_checkpoint(checkpoint, kept, step.start)
            last = time.monotonic()
        if not step.solved:
            kept.unsolved.append(step.index)
        if step.index < first:
            continue
        position, velocity = step.start.position, step.start.velocity
        if way.deepest is not None:
            position = relaxed(model, scheme, position, velocity, way.deepest)
        position = trajectory.rounded(position, exponent)
        velocity = trajectory.rounded(velocity, exponent)
        part = problem_at(model, scheme, position, velocity)
        problem = part.problem
        if problem.nc:
            if plan.chosen is None or kept.looked in plan.chosen:
                # states of a file do not say which impulses were before them
                guess = None if way.states else carried_to(model, step.start, part.contacts)
                kept.add(step.index, position, velocity, problem, guess)
            kept.looked += 1
            if report is not None:
                report(plan.name, kept.looked, plan.total)
            if kept.looked == plan.problems:
                break

    count = len(kept.number)
    trajectory.write(
        target,
        trajectory.Trajectory(
            scene=plan.scene,
            origin={
                "collection": plan.collection,
                "version": plan.version,
                "settings": {"fclib": _core.version, **way.record()},
                **({"unsolved": kept.unsolved} if kept.unsolved else {}),
                **({"stopped": stopped} if stopped else {}),
            },
            exponent=exponent,
            number=np.array(kept.number, dtype=np.int64),
            step=np.array(kept.step, dtype=np.int64),
            # the whole state, with controls
            position=np.reshape(kept.position, (count, -1) if count else (0, len(model.position))),
            velocity=np.reshape(kept.velocity, (count, len(model.velocity))),
            digest=tuple(kept.digest),
            structure=tuple(kept.structure),
            sketch=np.reshape(kept.sketch, (count, len(_digest.FIELDS), 2)),
            # of all steps, the one before gives it
            guess=tuple(kept.guess) if plan.chosen is not None else (),
        ),
    )
    checkpoint.unlink(missing_ok=True)


@dataclass(frozen=True)
class At:
    """The start of a step."""

    index: int
    start: State
    solved: bool


def logged_ones(model: Any, path: Path, most: int, done: int) -> Iterator[At]:
    """The states of a file after the first `done` ones; nothing is solved."""
    from fclib.simulate import State, logged

    none = np.zeros((0, 2), dtype=np.int64), np.zeros((0, 3, 3)), np.zeros((0, 3))
    states = zip(*logged(path, model), strict=True)
    for index, (position, velocity) in enumerate(states):
        if done <= index < most:
            yield At(index, State(index, position, velocity, *none), solved=True)


def write_checkpoint(path: Path, kept: Recorded, start: State) -> None:
    """Store a checkpoint: the start of a step, and the states kept before it."""
    known = {name: getattr(kept, name) for name in ("looked", "unsolved", "number", "step")}
    known |= {name: getattr(kept, name) for name in ("digest", "structure")}
    arrays: dict[str, Any] = {
        name: np.array(getattr(kept, name)) for name in ("position", "velocity", "sketch")
    }
    arrays |= {f"start_{f.name}": getattr(start, f.name) for f in fields(start)}
    # one after the other: they are of different lengths
    arrays["guesses"] = np.array([-1 if one is None else len(one) for one in kept.guess], int)
    arrays["guess"] = np.concatenate([np.zeros(0), *(one for one in kept.guess if one is not None)])
    content = io.BytesIO()
    np.savez(content, known=json.dumps(known), **arrays)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, content.getvalue())


def read_checkpoint(path: Path) -> tuple[Recorded, State | None]:
    """The states kept, and the step to go on from; empty and None at the scene's start."""
    if not path.is_file():
        return Recorded(), None
    from fclib.simulate import State

    with np.load(path) as arrays:
        values = {name: arrays[name] for name in arrays.files}
    kept = Recorded(**json.loads(str(values.pop("known"))))
    for name in ("position", "velocity", "sketch"):
        setattr(kept, name, list(values.pop(name)))
    counts, guess = values.pop("guesses"), values.pop("guess")
    ends = np.cumsum(np.maximum(counts, 0))
    kept.guess = [
        None if n < 0 else guess[end - n : end]
        for n, end in zip(counts.tolist(), ends.tolist(), strict=True)
    ]
    state = {name.removeprefix("start_"): value for name, value in values.items()}
    return kept, State(**(state | {"index": int(state["index"])}))
