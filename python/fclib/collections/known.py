"""The sets: names that last, versions, and what is in each.

Every family has the set that it names; its problems are SET/FAMILY/NUMBER. Two kinds are made of
others:

extended      all the families that came after RT-0444
hard, tiny    chosen problems, in folders of their own; `hard.json` and `tiny.json` list them

A version changes when a problem of the set does, or when one comes or goes.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fclib.collections.plan import Plan, families, source

DATA = Path(__file__).with_name("data")  # lists, and the shipped problems
SHIPPED = ("tiny",)  # whose problems are there without a build

# name, version, what it is; a set that a family names and that is not here has version 1
KNOWN: dict[str, tuple[str, str]] = {
    "rt444": ("4", "the four families of RT-0444"),
    "granular": ("5", "grains that fall, flow and are pressed"),
    "rolling": ("4", "grains with rolling friction"),
    "masonry": ("4", "blocks laid without mortar"),
    "deformable": ("1", "elastic bodies, meshes of finite elements"),
    "mixed": ("5", "mechanisms and robots, with bilateral constraints"),
    "planar": ("4", "bodies in a plane"),
    "local": ("2", "problems of one contact"),
    "ladder": ("1", "one problem in growing sizes and in worse and worse conditioning"),
    "extended": ("5", "all families that came after RT-0444"),
    "hard": ("5", "what most solvers fail on; chosen by the bench"),
    "tiny": ("4", "one problem of each kind; comes with the package"),
}
EXTENDED = ("granular", "rolling", "masonry", "deformable", "mixed", "planar", "local")


@dataclass(frozen=True)
class Choice:
    """A problem of a family, by all that decides it."""

    family: str
    parameters: Mapping[str, Any]
    seed: int
    number: int  # among the steps with contact
    step: int  # of the simulation
    digest: str  # `fclib.digest`; empty where it is not known yet

    @classmethod
    def read(cls, path: Path) -> tuple[Choice, ...]:
        """The choices of a list. FileNotFoundError, ValueError."""
        rows = json.loads(path.read_text(encoding="utf-8"))["problems"]
        return tuple(cls(**row) for row in rows)


@functools.cache
def choices(name: str) -> tuple[Choice, ...]:
    """The problems of a set that is a list; none for another."""
    path = DATA / f"{name}.json"
    return Choice.read(path) if path.is_file() else ()


def version(name: str) -> str:
    """Of a set."""
    return KNOWN[name][0] if name in KNOWN else "1"


def sets() -> dict[str, list[str]]:
    """The folders SET/FAMILY of each set, by its name."""
    found: dict[str, list[str]] = {}
    for name, family in families().items():
        found.setdefault(family.collection, []).append(f"{family.collection}/{name}")
    found["extended"] = [folder for name in EXTENDED for folder in found.get(name, [])]
    for path in sorted(DATA.glob("*.json")):
        names = dict.fromkeys(choice.family for choice in choices(path.stem))
        found[path.stem] = [f"{path.stem}/{name}" for name in names]
    return dict(sorted(found.items()))


def folders(names: Sequence[str]) -> list[str]:
    """Names of sets, of families and of families in a set as folders SET/FAMILY, each once.

    Raises:
        KeyError: a name is none of these.
    """
    known = sets()
    every = {folder for own in known.values() for folder in own}
    found: dict[str, None] = {}
    for name in names:
        if name in known:
            found.update(dict.fromkeys(known[name]))
        elif name in every:
            found[name] = None
        elif name in families():
            found[f"{families()[name].collection}/{name}"] = None
        else:
            raise KeyError(
                f"no set and no family is called {name!r}; sets: {', '.join(known)};"
                f" families: {', '.join(families())}"
            )
    return list(found)


def plan_of(folder: str, seed: int = 0, **settings: Any) -> Plan:
    """The plan of a folder SET/FAMILY of `folders`; those of a list keep their own seeds.

    Raises:
        ValueError: settings that the plan does not take, or a list that contradicts itself.
    """
    name, family = folder.split("/")
    own = [choice for choice in choices(name) if choice.family == family]
    settings = {"collection": name, "version": version(name)} | settings
    if not own:
        return Plan.of_family(family, seed, **settings)
    first = own[0]
    if any((c.parameters, c.seed) != (first.parameters, first.seed) for c in own):
        raise ValueError(f"{folder}: the list {name}.json has two scenes of one name")
    numbers = tuple(sorted({choice.number for choice in own}))
    return Plan(
        scene=source(family, dict(first.parameters), first.seed),
        problems=numbers[-1] + 1,
        chosen=numbers,
        **settings,
    )


def differing(name: str, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The problems of a set's list, by name, whose rows of a catalogue hold other data."""
    found = {(row["family"], row["number"]): row["digest"] for row in rows}
    return [
        f"{name}/{choice.family}/{choice.number:04d}"
        for choice in choices(name)
        if choice.digest != found.get((choice.family, choice.number))
    ]
