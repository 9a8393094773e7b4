"""Candidates: states of all families, from which the set `standard` is chosen.

Some steps of each family are kept, at equal distances among its problems. If the states of a family
are stored, they are taken from there. The states of `COSTLY` families are taken from a list. Any
other family is simulated, as `SIMULATION` says, into

    FOLDER/SET/FAMILY-KEY.trajectory

KEY is a hash of the scene and of the settings of its simulation. So a family is simulated anew only
if it has changed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fclib import scenes
from fclib.collections import set_index, trajectory
from fclib.collections.plan import Plan, Simulation, families
from fclib.collections.record import record

# tolerance of each step; with 1e-12 thirty steps of LowWall take hours
SIMULATION = Simulation(tol=1e-10)
KEPT = 48  # largest number of problems of a family
# families whose simulation takes minutes, with the list and version that has some of their states
COSTLY = dict.fromkeys(("Chute1000", "Chute4000", "SpheresBox"), ("hard", "6"))

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Candidates:
    """Some problems of one family."""

    plan: Plan
    numbers: tuple[int, ...]
    states: trajectory.Trajectory | None  # None for a family that is assembled directly

    def problems(self) -> Iterator[tuple[int, Any]]:
        """Each problem with its number; nothing is solved."""
        for number in self.numbers:
            yield number, self.problem(number)

    def problem(self, number: int) -> Any:
        """One of them, by its number."""
        if self.states is not None:
            return self.states.problem(self.states.index(number)).problem
        assert isinstance(self.plan.scene, scenes.Assembled)
        return self.plan.scene.problem(number)


def candidates(
    folder: Path, names: Sequence[str] = (), kept: int = KEPT, progress: Progress | None = None
) -> Iterator[Candidates]:
    """The candidates of families, all by default; simulated into the folder if needed.

    It goes on after a kill. It raises as `record` and `known.plan_of` do.
    """
    for name, family in families().items():
        if names and name not in names:
            continue
        collection, version = COSTLY.get(name, (family.collection, None))
        plan = set_index.plan_of(f"{collection}/{name}", version=version)
        if isinstance(plan.scene, scenes.Assembled) or plan.trajectory is not None:
            yield drawn(plan, kept)
            continue
        numbers = spread(plan.total, kept)
        plan = replace(plan, version="", chosen=numbers, simulation=SIMULATION)
        path = folder / f"{plan.name}-{key(plan)}{trajectory.SUFFIX}"
        if not path.is_file():
            record(plan, path, path.with_name(f".{path.stem}.npz"), progress)
        yield drawn(replace(plan, trajectory=path), kept)


def drawn(plan: Plan, kept: int) -> Candidates:
    """The candidates of a plan whose states are stored, or which needs none."""
    if plan.trajectory is None:
        return Candidates(plan, spread(plan.total, kept), None)
    states = trajectory.read(plan.trajectory)
    places = spread(len(states), kept)
    return Candidates(plan, tuple(states.number[list(places)].tolist()), states)


def spread(total: int, kept: int) -> tuple[int, ...]:
    """Some of 0, 1, ..., total - 1 at equal distances."""
    places = np.linspace(0, total - 1, min(kept, total)).round().astype(int)
    return tuple(dict.fromkeys(places.tolist()))


def key(plan: Plan) -> str:
    """The hash of a scene as it is, of the steps kept and of the settings of the simulation."""
    assert isinstance(plan.scene, scenes.Scene)
    values = [trajectory.record(plan.scene), plan.simulation.record(), plan.chosen]
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:12]
