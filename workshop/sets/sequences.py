"""The set `sequences`: simulations of many steps, for solvers that start from the step before.

Of each simulation the consecutive problems in its middle are taken, if enough of the candidates
among them differ and are not trivial: a stack at rest is the same problem again and again. Of these
simulations those are chosen that are farthest apart in the space of features (each is the mean of
its candidates), at most one of a scene. The first is the one nearest to the middle of all.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fclib import scenes
from fclib.collections import set_index, trajectory
from fclib.collections.set_index import Choice
from workshop.sets import candidates, features, select


@dataclass(frozen=True)
class Rule:
    """What a sequence is, and how many there are."""

    count: int = 12
    steps: int = 100
    telling: float = 0.5  # least share of the candidates among its steps that stay
    least: int = 3  # least number of them

    def record(self) -> dict[str, Any]:
        """In JSON's types."""
        return {**vars(self), "near": features.NEAR, "sweeps": select.SWEEPS}


def window(folder: str, steps: int) -> range | None:
    """The numbers of the consecutive problems in the middle of SET/FAMILY; None if it has fewer."""
    plan = set_index.plan_of(folder)
    if isinstance(plan.scene, scenes.Assembled):
        return None
    there = plan.numbers()
    first = (len(there) - steps) // 2
    if first < 0 or there[first + steps - 1] - there[first] != steps - 1:
        return None
    numbers = range(int(there[first]), int(there[first]) + steps)
    if plan.trajectory is not None:  # which may have some of the steps
        states = trajectory.read(plan.trajectory)
        taken = [states.step[states.index(number)] for number in numbers]
        if np.any(np.diff(taken) != 1):
            return None
    return numbers


def choose(rows: Sequence[select.Row], rule: Rule) -> list[tuple[str, range]]:
    """The folders SET/FAMILY that are chosen, and the numbers of their problems."""
    out = select.left_out(rows)
    point = features.points(rows)
    own: dict[str, list[int]] = defaultdict(list)
    for k, row in enumerate(rows):
        own[select.folder_of(row)].append(k)
    found: dict[str, tuple[range, Any]] = {}
    for folder, places in own.items():
        numbers = window(folder, rule.steps)
        if numbers is None:
            continue
        inside = [k for k in places if int(rows[k]["number"]) in numbers]
        telling = [k for k in inside if not out[k]]
        if len(telling) >= max(rule.least, rule.telling * len(inside)):
            found[folder] = numbers, point[telling].mean(axis=0)
    if not found:
        return []
    names = sorted(found)
    place = np.array([found[name][1] for name in names])
    scene = [rows[own[name][0]]["scene"] for name in names]
    distance = np.linalg.norm(place - place.mean(axis=0), axis=1)
    chosen = [int(distance.argmin())]
    while len(chosen) < rule.count:
        taken = {scene[k] for k in chosen}
        apart = np.linalg.norm(place[:, None] - place[None, chosen], axis=2).min(axis=1)
        apart[[name in taken for name in scene]] = -1
        if apart.max() < 0:
            break
        chosen.append(int(apart.argmax()))
    return [(names[k], found[names[k]][0]) for k in sorted(chosen)]


def states_of(
    folder: str, numbers: range, where: Path, progress: candidates.Progress | None = None
) -> candidates.Candidates:
    """The states of a sequence; those of a family without stored states are simulated."""
    plan = set_index.plan_of(folder)
    if plan.trajectory is None:
        own = replace(
            plan,
            version="",
            problems=numbers[-1] + 1,
            chosen=tuple(numbers),
            simulation=candidates.SIMULATION,
        )
        plan = replace(plan, trajectory=candidates.simulated(own, where, progress))
    assert plan.trajectory is not None
    return candidates.Candidates(plan, tuple(numbers), trajectory.read(plan.trajectory))


def choices_of(found: candidates.Candidates) -> list[Choice]:
    """The problems of a sequence in the format of a list."""
    assert found.states is not None
    rows = [
        {
            "problem": f"{found.plan.name}/{number:04d}",
            "label": found.label,
            "number": number,
            "digest": found.states.digest[found.states.index(number)],
        }
        for number in found.numbers
    ]
    return select.choices_of({found.plan.name: found}, rows)
