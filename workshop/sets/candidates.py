"""Candidates: some problems of every family, from which the sets are chosen.

Of each folder SET/FAMILY some problems are kept, at equal distances. If its states are stored, they
are taken from there, also those of other engines and of robots. A family without stored states is
simulated, as `SIMULATION` says, into

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
from typing import Any, Final

import numpy as np

from fclib import scenes
from fclib.collections import set_index, trajectory
from fclib.collections.plan import Plan, Simulation, families
from fclib.collections.record import record

# tolerance of each step; with 1e-12 thirty steps of LowWall take hours
SIMULATION: Final = Simulation(tol=1e-10)
# Largest number of problems of a family. Of 48 at equal distances, half are nearly the same as
# another one; a set takes at most six.
KEPT: Final = 24
# sets that are choices themselves
CHOSEN: Final = ("standard", "hard", "open", "sequences", "tiny", "extended")
# folders whose simulation takes hours; rr9118 has stored states of the same families
COSTLY: Final = (
    *("granular/Chute1000", "granular/Chute4000", "granular/SpheresBox"),
    "deformable/CubesH8x20",
)

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Candidates:
    """Some problems of one family."""

    plan: Plan
    numbers: tuple[int, ...]
    states: trajectory.Trajectory | None  # None for a family that is assembled directly

    @property
    def label(self) -> str:
        """The family's name in a list: a list has one of each name."""
        return label_of(self.plan.name)

    def problem(self, number: int) -> Any:
        """One of them, by its number."""
        if self.states is not None:
            return self.states.problem(self.states.index(number)).problem
        assert isinstance(self.plan.scene, scenes.Assembled)
        return self.plan.scene.problem(number)


def folders() -> list[str]:
    """The folders SET/FAMILY that candidates come from, in order."""
    found = {own for name, every in set_index.sets().items() if name not in CHOSEN for own in every}
    return sorted(found - set(COSTLY))


def label_of(folder: str) -> str:
    """FAMILY, or FAMILY_SET if a family of this name belongs to another set."""
    name, _, family = folder.partition("/")
    own = families().get(family)
    return family if own is None or own.collection == name else f"{family}_{name}"


def steps_to_simulate(folder: str) -> int:
    """The number of problems that must be simulated for a folder's candidates."""
    plan = set_index.plan_of(folder)
    directly = isinstance(plan.scene, scenes.Assembled) or plan.trajectory is not None
    return 0 if directly else plan.total


def candidates_of(
    own: str, folder: Path, kept: int = KEPT, progress: Progress | None = None
) -> Candidates:
    """The candidates of SET/FAMILY; simulated into a folder if needed.

    It goes on after a kill. It raises as `record` and `set_index.plan_of` do.
    """
    plan = set_index.plan_of(own)
    if isinstance(plan.scene, scenes.Assembled) or plan.trajectory is not None:
        return drawn(plan, kept)
    plan = replace(plan, version="", chosen=spread(range(plan.total), kept), simulation=SIMULATION)
    return drawn(replace(plan, trajectory=simulated(plan, folder, progress)), kept)


def simulated(plan: Plan, folder: Path, progress: Progress | None = None) -> Path:
    """The trajectory of a plan in a folder; made if it is missing."""
    path = folder / f"{plan.name}-{key(plan)}{trajectory.SUFFIX}"
    if not path.is_file():
        record(plan, path, path.with_name(f".{path.stem}.npz"), progress)
    return path


def drawn(plan: Plan, kept: int) -> Candidates:
    """The candidates of a plan whose states are stored, or which needs none."""
    if plan.trajectory is None:
        return Candidates(plan, spread(plan.numbers().tolist(), kept), None)
    states = trajectory.read(plan.trajectory)
    return Candidates(plan, spread(states.number.tolist(), kept), states)


def spread(numbers: Sequence[int], kept: int) -> tuple[int, ...]:
    """Some of the numbers, at equal distances, the first and the last among them."""
    places = np.linspace(0, len(numbers) - 1, min(kept, len(numbers))).round().astype(int)
    return tuple(numbers[place] for place in dict.fromkeys(places.tolist()))


def every(
    folder: Path, names: Sequence[str] = (), kept: int = KEPT, progress: Progress | None = None
) -> Iterator[Candidates]:
    """The candidates of folders SET/FAMILY, one after the other; of all by default."""
    for own in names or folders():
        yield candidates_of(own, folder, kept, progress)


def key(plan: Plan) -> str:
    """The hash of a scene as it is, of the steps kept and of the settings of the simulation."""
    assert isinstance(plan.scene, scenes.Scene)
    values = [trajectory.record(plan.scene), plan.simulation.record(), plan.chosen]
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:12]
