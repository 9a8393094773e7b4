"""Which families are built, and which of their problems are kept; their license and citation."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib import _core, scenes
from fclib._judge import TOLERANCE

Form = Literal["global", "local", "both"]
Selection = Literal["every", "hard"]
Source: TypeAlias = scenes.Scene | scenes.Assembled

# tolerance of the steps of a build without a trajectory: 1e-12 takes three times as long for thirty
# steps of LowWall
ON_DEMAND = 1e-8
# limits for a problem's cost to NSGS, if the hard ones are selected
HARD_TOLERANCE = 1e-6
HARD_SWEEPS = 2000
# largest penetration in a stored state, relative to the smallest body's diameter
DEEPEST = 0.02
LICENSE = "CC-BY-4.0"  # license of the data; the software has another
CITATION = (
    "V. Acary, M. Bremond, T. Koziara, F. Perignon, FCLIB: a collection of discrete 3D Frictional"
    " Contact problems, Inria RT-0444, 2014; set {set}, version {version}"
)


def families() -> dict[str, type[scenes.Described]]:
    """All families, of scenes and of problems assembled directly, by name."""
    return dict(sorted({**scenes.families(), **scenes.assemblies()}.items()))


def source(name: str, parameters: dict[str, Any] | None = None, seed: int = 0) -> Source:
    """The source of a family's problems: a scene, or the family itself.

    Raises:
        KeyError: there is no such family.
        TypeError, ValueError: it does not take the parameters.
    """
    if name in scenes.assemblies():
        return scenes.Assembled(family=scenes.assemblies()[name](**(parameters or {})), seed=seed)
    return scenes.get(name)(**(parameters or {})).scene(seed)


@dataclass(frozen=True, kw_only=True)
class Simulation:
    """The settings of a simulation into a trajectory; by default those for publishing."""

    solver: str = "auto"
    tol: float = 1e-12  # tolerance of each step
    stabilization: float = 0.2  # see `fclib.simulate.simulate`
    options: dict[str, Any] = field(default_factory=dict)  # its further options
    # a state with a deeper penetration is relaxed before it is stored; None: never
    deepest: float | None = DEEPEST
    # reaction to a step that is not solved, see `fclib.simulate.simulate`
    unsolved: Literal["best", "stop"] = "best"
    states: str = ""  # FILE.npz or FILE.csv of `fclib.simulate.logged`, instead of a simulation
    control: str = ""  # FILE.csv, FILE.npy or MODULE:FUNCTION of `fclib.simulate.control_of`

    def record(self) -> dict[str, Any]:
        """In JSON's types; for a file of controls also its SHA-256."""
        known = asdict(self)
        if self.deepest is None:
            del known["deepest"]
        if self.unsolved == "best":
            del known["unsolved"]
        for name in ("control", "states"):
            if not known[name]:
                del known[name]
            elif Path(known[name]).is_file():
                content = Path(known[name]).read_bytes()
                known[f"{name}_sha256"] = hashlib.sha256(content).hexdigest()
        return known


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The problems to build from one scene, or from a family that is assembled directly.

    The problems of a scene are assembled from a trajectory: a stored one, or a new one that is
    simulated first. Solver, tolerance and options are for the reference solutions; no problem
    depends on them.

    If `count` is less than the number of problems, the rule of selection is

    every   problems at equal distances, the first and the last among them
    hard    those that take NSGS most sweeps to 1e-6 (2000 at most), the earlier one of two equals

    A plan that names `chosen` numbers takes those.
    """

    scene: Source
    collection: str  # the set
    # the family's name in the set, if the set has another family of the scene's name
    label: str = ""
    version: str = ""  # of the set
    problems: int | None  # number of steps with contact to look at; None: all of the `steps`
    steps: int | None = None  # largest number of steps; None: as many as `problems` need
    form: Form = "both"
    count: int | None = None  # number of problems kept; None: all
    select: Selection = "every"
    chosen: tuple[int, ...] | None = None  # numbers of the problems to keep, in order
    # also store the results of `fclib.analysis.analyze`; a second or more for each problem
    analyze: bool = False
    trajectory: Path | None = None  # of the scene; None: it is simulated
    # its settings
    simulation: Simulation = field(default_factory=lambda: Simulation(tol=ON_DEMAND))
    references: bool = True  # whether solutions are found and stored
    # confirm each by a second, unrelated algorithm; some seconds for each problem
    certify: bool = False
    solver: str = "auto"
    tol: float = TOLERANCE  # tolerance of the solver; references.py goes on from there
    options: dict[str, Any] = field(default_factory=dict)  # options of `fclib.solve`

    @classmethod
    def of_family(cls, name: str, seed: int = 0, **settings: Any) -> Plan:
        """The plan of a family with its default parameters, in the set that it belongs to."""
        family = families()[name] if name in families() else scenes.get(name)
        own: dict[str, Any] = {"collection": family.collection, "problems": family.problems}
        return cls(scene=source(name, seed=seed), **own | settings)

    def __post_init__(self) -> None:
        if self.count is not None and self.count < 1:
            raise ValueError(f"the count of problems must be at least 1, not {self.count}")
        if not 0 <= self.tol <= TOLERANCE:
            raise ValueError(
                f"reference solutions are asked for at most {TOLERANCE:g}, which fclib check"
                f" bounds, not {self.tol:g}"
            )
        if self.certify and not self.references:
            raise ValueError("there is nothing to certify without reference solutions")
        if self.problems is None and self.steps is None:
            raise ValueError("a plan needs a number of problems or of steps")
        if self.chosen is not None and (self.count is not None or self.select != "every"):
            raise ValueError(
                f"these problems of {self.collection} are named, or chosen by a list already:"
                " no count and no selection applies to them"
            )

    @property
    def name(self) -> str:
        """SET/FAMILY; it is also the folder."""
        return f"{self.collection}/{self.family}"

    @property
    def family(self) -> str:
        """The family's name in the set."""
        return self.label or self.scene.name

    @property
    def total(self) -> int:
        """The largest number of problems to look at."""
        return min(n for n in (self.problems, self.steps) if n is not None)

    @property
    def forms(self) -> tuple[str, ...]:
        """The forms written for a problem that has both."""
        return ("global", "local") if self.form == "both" else (self.form,)

    def numbers(self) -> npt.NDArray[np.int64]:
        """The numbers that the rule `every` keeps, or those chosen."""
        if self.chosen is not None:
            return np.array(self.chosen, dtype=np.int64)
        return evenly(self.total, self.count)

    def only(self, numbers: Sequence[int]) -> Plan:
        """The plan for only some of its problems. ValueError if it lacks one of them."""
        own = np.arange(self.total) if self.chosen is None else np.array(self.chosen)
        missing = sorted(set(numbers) - set(own.tolist()))
        if missing:
            there = f"{own[0]} to {own[-1]}" if self.chosen is None else ", ".join(map(str, own))
            raise ValueError(f"{self.name}: has no problem {missing[0]}; its numbers are {there}")
        return replace(self, chosen=tuple(sorted(numbers)), count=None, select="every")

    def fingerprint(self) -> str:
        """All settings that decide the built problems, as JSON."""
        return json.dumps(
            {
                "fclib": _core.version,
                "version": self.version,
                **origin(self.scene),
                **self._states(),
                "problems": self.problems,
                "steps": self.steps,
                "form": self.form,
                "count": self.count,
                "select": self.select,
                "chosen": self.chosen,
                "analyze": self.analyze,
                "references": self.references,
                **({"certify": True} if self.certify else {}),
                "solver": self.solver,
                "tol": self.tol,
                "options": self.options,
            },
            sort_keys=True,
        )

    def _states(self) -> dict[str, Any]:
        """The origin of the states: a file, by its content, or a simulation."""
        if isinstance(self.scene, scenes.Assembled):
            return {}
        if self.trajectory is None:
            return {"simulation": self.simulation.record()}
        return {"trajectory": hashlib.sha256(self.trajectory.read_bytes()).hexdigest()}


def evenly(total: int, count: int | None) -> npt.NDArray[np.int64]:
    """`count` of the numbers 0, ..., total - 1 at equal distances, with the first and the last."""
    count = total if count is None else min(count, total)
    return np.unique(np.rint(np.linspace(0, total - 1, count)).astype(np.int64))


def origin(scene: Source) -> dict[str, Any]:
    """The values that decide a source's problems, in JSON's types."""
    known = {
        "scene": scene.name,
        **scenes.identity_of(scene.name),
        "parameters": dict(scene.parameters),
        "seed": scene.seed,
    }
    if isinstance(scene, scenes.Assembled):
        return known
    if scene.xml or scene.solids is not None:
        # the version of the simulator decides the numbers
        from fclib.simulate import engine

        known |= engine(scene)
    return known | {
        **({"keyframe": scene.keyframe} if scene.keyframe else {}),
        "restitution": scene.restitution,
        "law": scene.law,
        "activation": scene.activation,
        **({"allowance": True} if scene.allowance else {}),
        **({} if scene.ground is None else {"ground": scene.ground}),
        "begin": scene.begin,
        "theta": scene.theta,
        **({"gyroscopic": True} if scene.gyroscopic else {}),
        **({"all_bodies": True} if scene.all_bodies else {}),
        "time_step": scene.time_step,
        "ignore": list(scene.ignore),
        "planar": scene.planar,
    }


@functools.cache
def is_ours(scene: str) -> bool:
    """Whether a scene has the name of a family of fclib's own."""
    return scene in scenes.own()


def rights_of(plan: Plan) -> dict[str, str | None]:
    """License and citation of a plan's problems; both are empty for a scene that is not ours."""
    if not is_ours(plan.scene.name):
        return {"license": None, "citation": None}
    citation = CITATION.format(set=plan.collection, version=plan.version)
    return {"license": LICENSE, "citation": citation}


def stamped(info: _core.ProblemInfo, plan: Plan, number: int, facts: str = "") -> _core.ProblemInfo:
    """The info; the JSON at the end of its description has these facts and the problem's name.

    The facts on existence and uniqueness come after those that the family states.
    """
    if facts:
        stated = info.math_info.rstrip(". ")
        info = info.replace(math_info=f"{stated}. {facts}" if stated else facts)
    *words, last = info.description.split("\n")
    try:
        told: Any = json.loads(last)
    except ValueError:
        return info
    own = {name: value for name, value in rights_of(plan).items() if value is not None}
    known = {"collection": plan.collection, "version": plan.version, "number": number}
    text = "\n".join([*words, json.dumps(told | known | own)])
    return info.replace(description=text)
