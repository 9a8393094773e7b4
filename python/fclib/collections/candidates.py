"""Candidates: states of all families, of which the set `standard` is chosen.

Of each family some steps are kept, at equal distances among its problems. Where the states of a
family are stored, they are taken from there, and so are those of `COSTLY` families, which a list
has; else it is simulated, as `SIMULATION` says, into

    FOLDER/SET/FAMILY-KEY.trajectory

KEY is a hash of the scene and of how it was simulated: a family that has changed is simulated
anew, another one is not.
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
from fclib.collections import known, trajectory
from fclib.collections.plan import Plan, Simulation, families
from fclib.collections.record import record

SIMULATION = Simulation(tol=1e-10)  # of each step; to 1e-12 thirty of LowWall take hours
KEPT = 48  # problems of a family, at most
# families whose simulation takes minutes, and the list and version that has some of their states
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
    """The candidates of families, all by default; simulated into the folder where they are not.

    Goes on after a kill. Raises as `record` and `known.plan_of`.
    """
    for name, family in families().items():
        if names and name not in names:
            continue
        collection, version = COSTLY.get(name, (family.collection, None))
        plan = known.plan_of(f"{collection}/{name}", version=version)
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
    """The candidates of a plan whose states are there, or which needs none."""
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
    """Of a scene as it is, of what is kept and of how it is simulated."""
    assert isinstance(plan.scene, scenes.Scene)
    said = [trajectory.record(plan.scene), plan.simulation.record(), plan.chosen]
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()[:12]
