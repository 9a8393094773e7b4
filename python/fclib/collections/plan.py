"""Which families are built, and which of their problems are kept."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

import fclib
from fclib import scenes

Form = Literal["global", "local", "both"]
Selection = Literal["every", "hard"]

# a problem's cost to NSGS, where the hard ones are selected
HARD_TOLERANCE = 1e-6
HARD_SWEEPS = 2000


def sets() -> dict[str, list[str]]:
    """The families of each set, by name."""
    found: dict[str, list[str]] = {}
    for name, family in scenes.families().items():
        found.setdefault(family.collection, []).append(name)
    return dict(sorted(found.items()))


def family_names(names: list[str]) -> list[str]:
    """Names of sets and families as families, each once. KeyError for a name that is neither."""
    known = sets()
    found: dict[str, None] = {}
    for name in names:
        if name in known:
            found.update(dict.fromkeys(known[name]))
        elif name in scenes.families():
            found[name] = None
        else:
            families = ", ".join(scenes.families())
            raise KeyError(
                f"no set and no family is called {name!r}; sets: {', '.join(known)};"
                f" families: {families}"
            )
    return list(found)


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is built of one scene.

    With `count` below the number of problems, the rule of selection is

    every   problems at equal distances, the first and the last among them
    hard    those that take NSGS most sweeps to 1e-6 (2000 at most), the earlier one of two equals
    """

    scene: scenes.Scene
    collection: str  # the set
    problems: int | None  # steps with contact that are looked at; None: as many as `steps` give
    steps: int | None = None  # at most; None: as many as `problems` need
    form: Form = "both"
    count: int | None = None  # problems kept; None: all
    select: Selection = "every"
    analyze: bool = False  # also figures of `fclib.analysis.analyze`; a second a problem, or more
    solver: str = "auto"
    tol: float = 1e-8
    options: dict[str, Any] = field(default_factory=dict)  # of `fclib.simulate.simulate`

    @classmethod
    def of_family(cls, name: str, seed: int = 0, **settings: Any) -> Plan:
        """The plan of a family's default scene."""
        family = scenes.get(name)
        scene = family().scene(seed)
        return cls(scene=scene, collection=family.collection, problems=family.problems, **settings)

    def __post_init__(self) -> None:
        if self.count is not None and self.count < 1:
            raise ValueError(f"the count of problems must be at least 1, not {self.count}")
        if self.problems is None and self.steps is None:
            raise ValueError("a plan needs a number of problems or of steps")

    @property
    def name(self) -> str:
        """SET/SCENE, also the folder."""
        return f"{self.collection}/{self.scene.name}"

    @property
    def total(self) -> int:
        """Problems that are looked at, at most."""
        return min(n for n in (self.problems, self.steps) if n is not None)

    @property
    def forms(self) -> tuple[str, ...]:
        """The forms that are written."""
        return ("global", "local") if self.form == "both" else (self.form,)

    def numbers(self) -> npt.NDArray[np.int64]:
        """The numbers kept by the rule `every`."""
        count = self.total if self.count is None else min(self.count, self.total)
        numbers = np.rint(np.linspace(0, self.total - 1, count)).astype(np.int64)
        return np.unique(numbers)

    def fingerprint(self) -> str:
        """All that decides what is built, as JSON."""
        # the file names the version, hence the numbers, of what simulates
        from fclib.simulate import _mujoco

        return json.dumps(
            {
                "fclib": fclib.__version__,
                "mujoco": _mujoco.VERSION,
                "scene": self.scene.name,
                "parameters": dict(self.scene.parameters),
                "seed": self.scene.seed,
                "restitution": self.scene.restitution,
                "law": self.scene.law,
                "time_step": self.scene.time_step,
                "ignore": list(self.scene.ignore),
                "planar": self.scene.planar,
                "problems": self.problems,
                "steps": self.steps,
                "form": self.form,
                "count": self.count,
                "select": self.select,
                "analyze": self.analyze,
                "solver": self.solver,
                "tol": self.tol,
                "options": self.options,
            },
            sort_keys=True,
        )
