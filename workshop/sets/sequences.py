"""The set `sequences`: simulations of many steps, for solvers that start from the step before.

Of each simulation the consecutive problems in its middle are taken, if enough of them differ and
are not trivial: a stack at rest is the same problem again and again. SAMPLE of them are looked at:
the candidates of the other sets are spread over the whole simulation, and few of them are in its
middle. Of these simulations those are chosen that are farthest apart in the space of features (each
is the mean of its sample), at most one of a scene. The first is the one nearest to the middle of
all.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from fclib import scenes
from fclib.collections import set_index, trajectory
from fclib.collections.set_index import Choice
from workshop.sets import candidates, features, select

SAMPLE: Final = 12  # problems of a sequence that are looked at, at equal distances
TABLE: Final = "sequences.csv"  # their rows, as in the table of candidates


@dataclass(frozen=True)
class Rule:
    """What a sequence is, and how many there are."""

    count: int = 12
    steps: int = 100
    telling: float = 0.5  # least share of the sample that differs and is not trivial

    def record(self) -> dict[str, Any]:
        """In JSON's types."""
        return {**vars(self), "sample": SAMPLE, "near": features.NEAR, "sweeps": select.SWEEPS}


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


def describe(
    names: Sequence[str], rule: Rule, where: Path, progress: candidates.Progress | None = None
) -> list[select.Row]:
    """The rows of the sequences of folders SET/FAMILY; those without stored states are simulated.

    The table in the folder is written after each. So it goes on after a kill. Families whose rows
    it has, and that have not changed, are left as they are.
    """
    table = where / TABLE
    rows: list[select.Row] = [*select.read_table(table)] if table.is_file() else []
    for own in names:
        numbers = window(own, rule.steps)
        if numbers is None:
            continue
        found = states_of(own, numbers, where / "sequences", progress)
        sample = replace(found, numbers=candidates.spread(numbers, SAMPLE))
        there = [row for row in rows if select.folder_of(row) == own]
        if not select.describes(there, sample):
            rows = [row for row in rows if select.folder_of(row) != own]
            rows += select.described(sample, progress)
            select.write_table(table, rows)
    # by the stored digits, as candidates are
    there = [*select.read_table(table)] if table.is_file() else []
    return [row for row in there if select.folder_of(row) in names]


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
        if telling and len(telling) >= rule.telling * len(inside):
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
