"""The sets: their permanent names, their versions and their problems.

Every family names its set; its problems are SET/FAMILY/NUMBER. Two kinds of sets consist of
problems of others:

extended      all families that are newer than RT-0444
standard, hard, open, sequences, tiny, rr9118, fclib2024     chosen problems, in folders of their
              own; data/ has the lists

A set gets a new version if a problem changes, comes or goes. If the trajectory of a version is
stored, its problems never change (`published.py`). A list that was replaced stays in data/older.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fclib import scenes
from fclib._suggest import suggestion
from fclib.collections import published, trajectory
from fclib.collections.plan import Plan, evenly, families, source

DATA = Path(__file__).with_name("data")  # lists, and the shipped problems
OLDER = "older"  # folder of lists that newer ones have replaced, NAME-VERSION.json
SHIPPED = ("tiny",)  # sets whose problems need no build

# name, version, description; a set that a family names and that is missing here has version 1
SETS: dict[str, tuple[str, str]] = {
    "rt444": ("1", "the four families of RT-0444; three of the scenes in Siconos"),
    "granular": ("1", "grains that fall, flow and are pressed"),
    "rolling": ("1", "grains with rolling friction"),
    "masonry": ("1", "blocks laid without mortar"),
    "deformable": ("1", "elastic bodies, meshes of finite elements"),
    "mixed": ("1", "mechanisms and robots, with bilateral constraints"),
    "planar": ("1", "bodies in a plane"),
    "local": ("1", "problems of one contact"),
    "impacts": ("1", "bodies that strike and bounce, restitution 0 to 1"),
    "existence": ("1", "without a solution, or with several, and known to be so"),
    "spin": ("1", "contacts that resist spin: grasping, turning, screws"),
    "dynamics": ("1", "silo, rope, spinning bodies, friction that differs by contact"),
    "robots": ("1", "a gripper that lifts, an arm that pushes a pile"),
    "machines": ("1", "gears, a hand, a rover on rubble, a net of rings, a shear box"),
    "quasistatic": ("1", "without inertia: M is a stiffness, of rubber, or of soil that yields"),
    "laws": ("1", "cohesion, compliance, friction by ellipses, as Coulomb's problem"),
    "assembly": ("1", "pins in holes, a cable around a drum"),
    "flows": ("1", "a granular flow of up to 100,000 contacts"),
    "simulators": ("1", "steps of Drake, Newton, PyBullet and Siconos, as these handed them over"),
    "decks": ("1", "the scenes of LMGC90's authors, by their decks"),
    "rr9118": ("1", "families in the regimes of the sets published with RR-9118"),
    "fclib2024": ("1", "families in the sizes of the library's sets of 2024"),
    "ladder": ("1", "one problem in growing sizes and in worse and worse conditioning"),
    "extended": ("1", "all families that came after RT-0444"),
    "standard": ("1", "problems of all families, few of a kind, to benchmark with"),
    "hard": ("1", "problems that at most half of the solvers solve; none is in standard"),
    "open": ("1", "problems that nobody has solved yet"),
    "sequences": ("1", "simulations of 100 steps, to start from the step before"),
    "tiny": ("1", "one problem of each kind; comes with the package"),
}
EXTENDED = (
    *("granular", "rolling", "masonry", "deformable", "mixed", "planar", "local"),
    *("impacts", "existence", "dynamics", "robots", "machines", "simulators", "decks", "rr9118"),
    *("fclib2024", "spin", "quasistatic", "laws", "assembly", "flows"),
)


@dataclass(frozen=True)
class Choice:
    """A problem of a family, with all values that determine it."""

    family: str
    parameters: Mapping[str, Any]
    seed: int
    number: int  # its place among the steps with contact
    step: int  # step of the simulation
    digest: str  # `fclib.digest`; empty if not known yet
    scene: str = ""  # the scene's own name, if the list calls the family otherwise

    @classmethod
    def read(cls, path: Path) -> tuple[Choice, ...]:
        """The choices of a list. Raises FileNotFoundError, ValueError."""
        rows = json.loads(path.read_text(encoding="utf-8"))["problems"]
        return tuple(cls(**row) for row in rows)


@functools.cache
def choices(name: str) -> tuple[Choice, ...]:
    """The problems of a set that is a list; empty for any other set."""
    path = DATA / f"{name}.json"
    return Choice.read(path) if path.is_file() else ()


def listed(name: str, version_: str) -> list[Choice]:
    """The problems of a list in one of its versions; empty if the list does not know them."""
    if version_ == version(name):
        return list(choices(name))
    path = DATA / OLDER / f"{name}-{version_}.json"
    return list(Choice.read(path)) if path in older_lists(name) else []


def older_lists(name: str) -> list[Path]:
    """The files of the lists that a set had in earlier versions, by another rule."""
    found = (DATA / OLDER).glob(f"{name}-*.json")
    return sorted(path for path in found if path.stem.rpartition("-")[2].isdecimal())


def kind_of(folder: str) -> str:
    """The family of the scene of SET/FAMILY; a list may call it by another name."""
    name, _, family = folder.rpartition("/")
    return next((c.scene for c in choices(name) if c.family == family and c.scene), family)


def version(name: str) -> str:
    """The present version of a set."""
    return SETS[name][0] if name in SETS else "1"


def version_of(folder: str) -> str:
    """The newest stored version of SET/FAMILY; if none is stored, that of the set."""
    stored = published.versions(folder)
    return stored[-1] if stored else version(folder.split("/")[0])


def stored_version(folder: str, wanted: str | None) -> str:
    """The version of SET/FAMILY in a version of its set; the present one has the newest."""
    name, family = folder.split("/")
    if wanted is None or wanted == version(name):
        return version_of(folder)
    if any(choice.family == family for choice in listed(name, wanted)):
        # the newest version of that time
        there = [one for one in published.versions(folder) if int(one) <= int(wanted)]
        return there[-1] if there else wanted
    return wanted


def problems_of(folder: str) -> int:
    """The number of problems of SET/FAMILY: chosen or stored ones, or as its family says."""
    name, _, family = folder.partition("/")
    chosen = sum(choice.family == family for choice in choices(name))
    stored = published.digests(folder, version_of(folder))
    return chosen or len(stored) or families()[family].problems


def digests_of(folder: str) -> dict[int, str]:
    """The digests of SET/FAMILY that are stored, by number; empty if it must be simulated."""
    name, _, family = folder.partition("/")
    stored = published.digests(folder, version_of(folder))
    chosen = {c.number: c.digest for c in choices(name) if c.family == family}
    if chosen:
        return {number: stored.get(number, digest) for number, digest in chosen.items()}
    whole = getattr(families().get(family), "digests", None)
    return stored or (dict(enumerate(whole())) if whole is not None else {})


def distinct_of(wanted: Sequence[str]) -> int | None:
    """The number of different problems in folders SET/FAMILY; None if it is not known.

    It is not known of families that must be simulated or assembled.
    """
    found: set[str] = set()
    for folder in wanted:
        own = digests_of(folder)
        if len(own) < problems_of(folder) or not all(own.values()):
            return None
        found.update(own.values())
    return len(found)


def sets() -> dict[str, list[str]]:
    """The folders SET/FAMILY of each set, by its name."""
    found: dict[str, list[str]] = {}
    for name, family in families().items():
        found.setdefault(family.collection, []).append(f"{family.collection}/{name}")
    found["extended"] = [folder for name in EXTENDED for folder in found.get(name, [])]
    for path in sorted(DATA.glob("*.json")):
        names = dict.fromkeys(choice.family for choice in choices(path.stem))
        listed = [f"{path.stem}/{name}" for name in names]
        found[path.stem] = [*listed, *found.get(path.stem, [])]
    return dict(sorted(found.items()))


def folders(names: Sequence[str], version: str | None = None) -> list[str]:
    """The folders SET/FAMILY of names of sets, of families, or of families in a set; each once.

    Args:
        names: names of these kinds.
        version: version of a list: its families with states then, which may differ from those now.

    Raises:
        KeyError: a name is of none of these kinds.
    """
    known = sets()
    every = {folder for own in known.values() for folder in own}
    found: dict[str, None] = {}
    for name in names:
        older = version is not None and version != SETS.get(name, ("", ""))[0]
        if version is not None and name in known and older and choices(name):
            had = [f"{name}/{choice.family}" for choice in listed(name, version)]
            stored = [own for own in published.folders(name) if version in published.versions(own)]
            found.update(dict.fromkeys(had or stored or known[name]))
        elif name in known:
            found.update(dict.fromkeys(known[name]))
        elif name in every or (version is not None and version in published.versions(name)):
            found[name] = None
        elif name in families():
            found[f"{families()[name].collection}/{name}"] = None
        elif name.partition("/")[0] in known:
            own = name.partition("/")[0]
            has = [folder.partition("/")[2] for folder in known[own]]
            family = name.partition("/")[2]
            raise KeyError(
                f"the set {own} has no family {family!r}; {suggestion(family, has)}"
                f"it has {', '.join(has)}"
            )
        else:
            raise KeyError(
                f"no set and no family is called {name!r}; "
                f"{suggestion(name, [*known, *families()])}"
                f"sets: {', '.join(known)}; families: {', '.join(families())}"
            )
    return list(found)


def numbered(names: Sequence[str], version: str | None = None) -> dict[str, tuple[int, ...]]:
    """The folders SET/FAMILY of names, each with the problems named; empty means all.

    Args:
        names: names for `folders`, and names of single problems: SET/FAMILY/NUMBER or
            FAMILY/NUMBER.
        version: as for `folders`.

    Raises:
        KeyError: a name is of none of these kinds.
    """
    found: dict[str, set[int] | None] = {}
    for name in names:
        own, _, number = name.rpartition("/")
        if own and number.isdecimal():
            (folder,) = folders([own], version) if own not in sets() else ("",)
            if not folder:
                raise KeyError(f"{name}: a problem is named SET/FAMILY/NUMBER")
            wanted = found.setdefault(folder, set())
            if wanted is not None:
                wanted.add(int(number))
        else:
            found |= dict.fromkeys(folders([name], version))
    return {folder: tuple(sorted(wanted or ())) for folder, wanted in found.items()}


def plan_of(folder: str, seed: int = 0, version: str | None = None, **settings: Any) -> Plan:
    """The plan of a folder SET/FAMILY of `folders`; problems of a list keep their own seeds.

    If a trajectory of this version and seed is stored, the problems are built from its states: they
    no longer depend on the family's file. Otherwise they are simulated.

    Args:
        folder: SET/FAMILY.
        seed: random seed of the scene.
        version: a stored one, or the present one of the set; by default the newest.
        settings: settings of the plan.

    Raises:
        VersionError: the version is not stored here.
        ValueError: settings that the plan does not take, or a list that contradicts itself.
        OSError, TrajectoryError: the stored trajectory cannot be read.
    """
    wanted, family = stored_version(folder, version), folder.partition("/")[2]
    stored = published.path_of(folder, wanted)
    had = any(choice.family == family for choice in listed(folder.split("/")[0], wanted))
    unchanged = family in scenes.assemblies() and (had or wanted == version_of(folder))
    if version is not None and stored is None and not unchanged:
        there = ", ".join(published.versions(folder)) or "none"
        raise published.VersionError(
            f"{folder}: version {version} is not stored here (stored: {there}); a release of"
            " fclib-collection that has it builds it"
        )
    frozen = trajectory.read_origin(stored)[0] if stored is not None else None
    plan = _plan(folder, seed, frozen, **{"version": wanted, **settings})
    if stored is None or frozen is None:
        return plan
    now = any(choice.family == family for choice in choices(plan.collection))
    if choices(plan.collection) and (wanted != version_of(folder) or not now):
        # the list had other problems then
        numbers = tuple(published.digests(folder, wanted))
        own: dict[str, Any] = {"chosen": numbers, "problems": numbers[-1] + 1}
        return replace(plan, scene=frozen, trajectory=stored, **own)
    if frozen.seed == plan.scene.seed:
        return stored_part(replace(plan, scene=frozen, trajectory=stored))
    return plan


def stored_part(plan: Plan) -> Plan:
    """The plan for only the problems in its trajectory, if the trajectory has only some."""
    if plan.chosen is not None or plan.trajectory is None:
        return plan
    there = [n for n in trajectory.read_digests(plan.trajectory) if n < plan.total]
    # all are there, or the scene ended too early; then the build says so
    if not there or len(there) == there[-1] + 1:
        return plan
    kept = tuple(there[place] for place in evenly(len(there), plan.count))
    return replace(plan, chosen=kept, problems=kept[-1] + 1, count=None)


def fresh_plan(folder: str, seed: int = 0, **settings: Any) -> Plan:
    """The plan of a folder SET/FAMILY from its family's present file, whatever is stored.

    Raises:
        ValueError: as `plan_of` raises it.
    """
    return _plan(folder, seed, None, **settings)


def _plan(folder: str, seed: int, frozen: scenes.Scene | None, **settings: Any) -> Plan:
    """The plan of a folder; problems of a list keep their seed, and the scene that was stored.

    The present file of a family need not take the parameters of that scene.
    """
    name, family = folder.split("/")
    settings = {"collection": name, "version": version_of(folder), **settings}
    had = listed(name, settings["version"]) or choices(name)
    own = [choice for choice in had if choice.family == family]
    if not own:
        return Plan.of_family(family, seed, **settings)
    first = own[0]
    if any((c.parameters, c.seed) != (first.parameters, first.seed) for c in own):
        raise ValueError(f"{folder}: the list {name}.json has two scenes of one name")
    numbers = tuple(sorted({choice.number for choice in own}))
    settings = {"chosen": numbers, "problems": numbers[-1] + 1, "label": family, **settings}
    if frozen is not None and frozen.seed == first.seed:
        return Plan(scene=frozen, **settings)
    return Plan(scene=source(first.scene or family, dict(first.parameters), first.seed), **settings)


def from_folder(plan: Plan, folder: str | Path) -> Plan:
    """A plan whose states come from a folder's trajectory: the only one of its family there.

    A family that is assembled directly remains as it is.

    Raises:
        FileNotFoundError: the folder has none, or several versions.
        OSError, TrajectoryError: it cannot be read.
    """
    if isinstance(plan.scene, scenes.Assembled):
        return plan
    found = sorted(Path(folder).glob(f"{plan.name}-*{trajectory.SUFFIX}"))
    if len(found) != 1:
        words = ", ".join(path.name for path in found) or "none"
        raise FileNotFoundError(f"{folder}: needs one trajectory of {plan.name}, and has {words}")
    scene, origin = trajectory.read_origin(found[0])
    return stored_part(replace(plan, scene=scene, version=origin["version"], trajectory=found[0]))


def origin_of(row: Mapping[str, Any]) -> str:
    """The origin of a row of a catalogue: "published", "differs" from the published, or "yours".

    A problem is published if a trajectory or list of its version that has it is stored here.
    """
    known = published_digest(row)
    if known is None:
        return "yours"
    return "published" if known == row["digest"] else "differs"


def published_digest(row: Mapping[str, Any]) -> str | None:
    """The digest published under a row's name, version and seed; None if there is none."""
    folder, number = f"{row['collection']}/{row['family']}", row["number"]
    family = families().get(row["family"])
    if (
        family is not None
        and row["family"] in scenes.own()
        and hasattr(family, "digests")
        and (row["collection"], row["version"]) == (family.collection, version(family.collection))
    ):
        # the family is stored whole
        return dict(enumerate(family.digests())).get(number)
    if row["version"] in published.versions(folder):
        if published.seed(folder, row["version"]) != row["seed"]:
            return None
        return published.digests(folder, row["version"]).get(number)
    own = listed(row["collection"], row["version"])
    found = [c.digest for c in own if (c.family, c.number) == (row["family"], number)]
    return found[0] or None if found else None
