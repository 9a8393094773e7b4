"""The stored states of the set `rr9118`: the families in the regimes of the published sets.

    python -m workshop.sets.regimes OUT [FAMILY...]

Each scene is simulated by nonsmooth Gauss-Seidel to 1e-3, as packings of thousands of contacts cost
minutes a step if more is asked: a stored state is what a step begins from, and how it came about
is no part of its problem. Or its states are those of a stored trajectory, under another law. Of the
steps whose contacts are as many as published (published_sets.csv), some are kept, evenly spread by
their number of contacts. Where other figures choose too, a step has all of them as published, to a
tenth, as collection_table.py compares them; the steps are then spread by each figure in turn. A
regime that is as long as published is filled up to the published number by further steps, evenly
spread in time. A simulation made again is another one in its last digits, and in the end in all of
them. So a regime that grows keeps the states that are stored, and takes further steps beside them.
A regime that is in time has steps evenly spread in time. A state whose problem a chosen set has
stays, in the place of a step near to it.

States in which a body is deeper in another than its regime allows are left out.

With the name ChuteLocalProblems it writes OUT/chute_local_problems.json from the stored states.

Writes OUT/rr9118/FAMILY-VERSION.trajectory and OUT/rr9118.json, the list of what was chosen, which
go to `collection/` and to `python/fclib/collections/data/`. An hour of CPU.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.optimize import linear_sum_assignment
from scipy.spatial.transform import Rotation

import fclib
from fclib import _digest, scenes
from fclib.collections import published, set_index, trajectory
from fclib.collections.plan import Simulation, evenly
from fclib.collections.set_index import Choice
from fclib.simulate import Contacts, Model, model_of, problem_at, scheme_of, simulate
from fclib.simulate.rounding import PER_SIZE
from workshop.sets import collection_table

Vector: TypeAlias = npt.NDArray[np.float64]
States: TypeAlias = tuple[Vector, Vector]  # a position and a velocity
LIMIT = 1900  # contact components of a problem whose rank ratio and conditioning choose too
DEEPEST = 0.02  # [1] most regimes keep no state that is deeper
SET = "rr9118"  # of the problems of one contact
CHOSEN = ("standard", "hard", "open")  # sets of chosen problems, which do not change
PUBLISHED = Path(__file__).with_name("published_sets.csv")
WAY = Simulation(solver="nsgs", tol=1e-3, options={"max_iterations": 100})
EXACT = Simulation(solver="auto", tol=1e-8)


@dataclass(frozen=True)
class Regime:
    """A family in the regime of a published set."""

    published: str  # the set's name in published_sets.csv
    parameters: dict[str, Any]  # of the family
    keep: int  # problems
    steps: int = 0  # of the simulation
    way: Simulation = field(default_factory=lambda: WAY)
    states: str = ""  # SET/FAMILY of a stored trajectory whose states are taken, instead
    by: tuple[str, ...] = ()  # columns of published_sets.csv that choose beside the contacts
    fill: bool = False  # to as many problems as published
    grows: bool = False  # the states of the newest stored version stay, and others join them
    in_time: bool = False  # as many as published, evenly spread in time, whatever their contacts
    every: int = 1  # of so many steps one is looked at
    version: str = "1"  # of the trajectory
    collection: str = "rr9118"  # the set
    scene: str = ""  # the family of its scene, if the set calls it otherwise
    # penetration of a state that is kept, of the smallest body's diameter; some laws leave more
    deepest: float = DEEPEST
    spheres: bool = False  # all bodies are free spheres: `plainest` states of them


STEEL = {"young": 2e11, "density": 7800.0, "time_step": 0.0125}
CHUTE = {"hexahedra": True, "gaps": True, "spheres": 0.0, "slope": 0.6}
# the column of spheres of the library's sets of 2024; in mm; and with mm as the unit of length
COLUMN = {
    **{"spheres": 2000, "radius": 0.7, "spread": 0.0, "density": 0.696, "across": 10},
    **{"gap": 0.6, "lift": 4.0, "offset": 0.05, "width": 39.0, "all_bodies": True},
}
MILLIMETRES = COLUMN | {
    **{"radius": 9e-4, "gap": 2e-4, "lift": 4e-3, "offset": 5e-5, "width": 0.039},
    **{"density": 1000.0, "time_step": 5e-5},
}
SCALED = COLUMN | {
    **{"radius": 0.9, "gap": 0.2, "gravity": 9810.0, "density": 1e-6, "time_step": 5e-5}
}
REGIMES: dict[str, Regime] = {
    "Chute1000": Regime(
        "Chute_1000",
        CHUTE
        | {"layers": 8, "time_step": 1.5e-3, "grains": 930}
        | {"thinnest": 0.35, "tilt": 0.1, "margin": 0.01},
        keep=32,
        steps=440,
        by=("dof", "density", "rank_ratio"),
        fill=True,
        grows=True,
        version="3",
    ),
    "Chute4000": Regime(
        "Chute_4000",
        CHUTE | {"layers": 14, "across": 14, "time_step": 1e-3, "grains": 3340},
        keep=6,
        steps=800,
        fill=True,
        grows=True,
        version="2",
    ),
    "Aqueduct": Regime(
        "Aqueduct_PR",
        {"bond": True, "voussoirs": 8, "settlement": 0.05},
        keep=10,
        steps=40,
        fill=True,
        grows=True,
        version="2",
        way=Simulation(solver="auto", tol=1e-4, options={"time_limit": 20.0}),
    ),
    "SpheresBox": Regime(
        "945_SP_Box_PL",
        {"margin": 0.4, "load": 5.0, "offset": 0.2, "time_step": 0.01},
        keep=12,
        steps=140,
        fill=True,
        grows=True,
        version="2",
    ),
    "PeriodicBox": Regime(
        "100_PR_Periobox",
        {"hexahedra": True, "spread": 0.7, "margin": 0.65, "radius": 3.76, "time_step": 4e-3}
        | {"lift": 0.5, "all_bodies": True},
        keep=80,
        steps=1000,
        by=("density", "rank_ratio", "conditioning"),
        fill=True,
        every=5,  # W has up to 1700 rows
        version="4",
    ),
    "Capsules": Regime(
        "Capsules",
        {"gaps": True, "activation": 0.0, "margin": 0.04, "gyroscopic": True},
        keep=40,
        states="rr9118/Capsules",
        fill=True,
        version="2",
    ),
    "Bridge": Regime(
        "Bridge_PR",
        {"load": 0.0, "slabs": 3, "spread": 5.0, "activation": 5e-3, "all_bodies": True}
        | {"time_step": 1.5e-3},
        keep=60,
        steps=500,
        way=EXACT,
        by=("density", "rank_ratio", "conditioning"),
        fill=True,
        version="4",
    ),
    "Chain": Regime(
        "Chain",
        {"loose": 1, "begin": 0.0, "gap": 0.01, "rods_above": 2, "rods_below": 2, "offset": 0.02},
        keep=100,
        steps=1000,
        way=EXACT,
        by=("dof", "density", "rank_ratio", "conditioning"),
        fill=True,
        version="3",
    ),
    "KaplasTower": Regime(
        "KaplasTower", {"levels": 11}, keep=20, steps=240, way=EXACT, by=("dof",), fill=True
    ),
    "CubesH8": Regime(
        "Cubes_H8_5",
        STEEL | {"push": 7e4, "pressure": 1e4, "rise": 0.2, "bed": 1e11},
        keep=12,
        steps=100,
        way=EXACT,
        by=("density",),
        fill=True,
        version="2",
    ),
    "CubesH8x2": Regime(
        "Cubes_H8_2",
        STEEL
        | {"young": 8e7, "poisson": 0.499, "density": 1100.0, "yaw": 1.57}
        | {"push": 7e3, "pressure": 1e4, "rise": 0.05, "bed": 1e11},
        keep=60,
        steps=60,
        way=EXACT,
        by=("conditioning",),
        fill=True,
        version="3",
    ),
    "CubesH8x20": Regime("Cubes_H8_20", STEEL | {"upper": 1.0}, keep=1, steps=1, way=EXACT),
    "Spheres": Regime(
        "Spheres",
        COLUMN | {"time_step": 1e-3},
        keep=30,
        steps=8000,
        every=10,
        grows=True,
        spheres=True,
        collection="fclib2024",
        scene="SpheresInABox",
    ),
    "Spheres1mm": Regime(
        "Spheres_1mm",
        MILLIMETRES,
        keep=42,
        steps=5000,
        every=10,
        grows=True,
        spheres=True,
        collection="fclib2024",
        scene="SpheresInABox",
    ),
    "Spheres1mmScaled": Regime(
        "Spheres_1mm_scaled",
        SCALED,
        keep=38,
        steps=5000,
        every=10,
        grows=True,
        spheres=True,
        collection="fclib2024",
        scene="SpheresInABox",
    ),
    "SpheresInPlates": Regime(
        "945_SP_Box_PL",
        {},
        keep=60,
        steps=500,
        deepest=0.2,
        in_time=True,
        spheres=True,
        collection="decks",
    ),
    "PrimitiveSoup": Regime(
        "PrimitiveSoup",
        {"bodies": 1000, "width": 21.0, "time_step": 2e-3, "all_bodies": True},
        keep=50,
        steps=2000,
        every=5,
        collection="fclib2024",
    ),
    "Chute": Regime(
        "Chute (2024)",
        {"grains": 3023, "across": 12, "layers": 12, "spheres": 0.0, "gaps": True}
        | {"time_step": 2e-3},
        keep=54,
        steps=300,
        every=1,
        collection="fclib2024",
    ),
    "RollingChute": Regime(
        "Chute (rolling)",
        {"grains": 1344, "across": 9, "layers": 9, "spheres": 0.0, "gaps": True}
        | {"mu_r": 0.01, "time_step": 2e-3},
        keep=54,
        steps=250,
        every=1,
        collection="fclib2024",
    ),
    "RollingSoup": Regime(
        "PrimitiveSoup (rolling)",
        {"bodies": 1000, "width": 21.0, "time_step": 2e-3, "all_bodies": True},
        keep=50,
        steps=2000,
        every=5,
        collection="fclib2024",
    ),
    "SpheresPile": Regime(
        "SpheresPile (rolling)",
        {"spheres": 250, "mu_r": 0.03, "time_step": 2.5e-4},
        keep=188,
        steps=10000,
        every=10,
        way=Simulation(solver="auto", tol=1e-4, options={"time_limit": 5.0}),
        collection="fclib2024",
        scene="RollingSpheres",
    ),
}


@dataclass(frozen=True)
class Row:
    """A step: where it begins, and its size."""

    number: int  # among those with contact
    step: int
    position: Any
    velocity: Any
    dof: int
    contacts: int
    depth: float  # largest penetration, of the smallest body's diameter
    rank_ratio: float  # of W, as its conditioning; NaN if it is large, or nobody asks
    conditioning: float

    @property
    def density(self) -> float:
        """Contact components for each degree of freedom."""
        return 3 * self.contacts / self.dof


def depth(contacts: Contacts, model: Model) -> float:
    """The largest penetration, of the diameter of the smallest body; elastic ones have no size."""
    size = model.smallest_size
    return -float(contacts.gap.min(initial=0.0)) / (2 * size) if size else 0.0


def plainest(position: Vector, velocity: Vector, step: float, size: float) -> States:
    """The same state of free spheres in fewer digits: what their problem does not depend on goes.

    A sphere's orientation is none that anything sees, so its frame is the world's. Places are
    rounded to PER_SIZE of the size; velocities and spins so that their errors move no point of a
    sphere further in a step.

    Args:
        position: place [m] and quaternion of each sphere, (7 N).
        velocity: of each sphere in the world's frame [m/s], and in its own [rad/s], (6 N).
        step: the time step h [s].
        size: radius of the smallest sphere [m].
    """
    places, twists = position.reshape(-1, 7).copy(), velocity.reshape(-1, 6).copy()
    frames = Rotation.from_quat(places[:, [4, 5, 6, 3]])
    finest = PER_SIZE + math.floor(math.log2(size))
    moving = finest - math.ceil(math.log2(step))
    places[:, :3] = trajectory.rounded(places[:, :3], finest)
    places[:, 3:] = (1.0, 0.0, 0.0, 0.0)
    twists[:, :3] = trajectory.rounded(twists[:, :3], moving)
    spins = frames.apply(twists[:, 3:])
    twists[:, 3:] = trajectory.rounded(spins, moving - math.ceil(math.log2(size)))
    return places.ravel(), twists.ravel()


def newest(source: str) -> trajectory.Trajectory:
    """The newest stored trajectory of SET/FAMILY."""
    path = published.path_of(source, published.versions(source)[-1])
    assert path is not None
    return trajectory.read(path)


def rows(name: str, regime: Regime, scene: scenes.Scene) -> Iterator[Row]:
    """The steps of a regime that have a contact; of a simulation, as it goes.

    Their figures are those of the states as they are stored.
    """
    model = model_of(scene)
    scheme = scheme_of(model)
    exponent = trajectory.exponent_of(model)
    spectra = {"rank_ratio", "conditioning"} & set(regime.by)

    def row(number: int, step: int, position: Any, velocity: Any) -> Row:
        position, velocity = (trajectory.rounded(x, exponent) for x in (position, velocity))
        part = problem_at(model, scheme, position, velocity)
        ratio, conditioning = np.nan, np.nan
        if spectra and part.problem.m <= LIMIT:
            ratio, conditioning = collection_table.figures(part.problem)
        sizes = part.problem.n, part.problem.nc, depth(part.contacts, model)
        return Row(number, step, position, velocity, *sizes, ratio, conditioning)

    if regime.states:
        stored = newest(regime.states)
        for k in range(len(stored)):
            place = int(stored.number[k]), int(stored.step[k])
            yield row(*place, stored.position[k], stored.velocity[k])
        return
    number, start, size = 0, time.process_time(), model.smallest_size or 0.0
    first = int(np.ceil(scene.begin / (scene.time_step or 1.0) - 1e-6))
    way = regime.way
    for step in simulate(scene, regime.steps, solver=way.solver, tol=way.tol, **way.options):
        if step.index % 10 == 0:
            seconds = time.process_time() - start
            print(
                f"{name} step {step.index}: {step.problem.n} dof, {step.problem.nc} contacts,"
                f" lowest gap {step.contacts.gap.min(initial=0.0):.1e} m,"
                f" {step.result.status} {step.result.error:.1e}, {seconds:.0f} s",
                flush=True,
            )
        if step.index >= first and step.problem.nc:
            if number % regime.every == 0:
                state = step.start.position, step.start.velocity
                if regime.spheres:
                    state = plainest(*state, model.time_step, size)
                yield row(number, step.index, *state)
            number += 1


def chosen(found: list[Row], regime: Regime, there: int = 0) -> list[Row]:
    """Those of as many contacts as published, evenly spread by that number.

    Where other figures choose too, of those that have them as published, evenly spread by each.
    So many problems as `there` says are chosen already.
    """
    with PUBLISHED.open(newline="") as file:
        published = next(row for row in csv.DictReader(file) if row["set"] == regime.published)
    wanted = int(published["problems"]) - there
    if wanted <= 0:
        return []

    def bounds(name: str) -> tuple[float, float]:
        low, _, high = published[name].partition(" to ")
        return float(low), float(high or low)

    names = ("contacts", *regime.by)

    def measure(row: Row, name: str) -> float:
        value = float(getattr(row, name))
        return math.log(value) if name == "conditioning" else value

    inside = [row for row in found if row.depth <= regime.deepest]
    for name in names:
        low, high = bounds(name)
        if name == "conditioning":
            low, high = math.log(low), math.log(high)
        share = collection_table.CLOSE if regime.by else 0.0
        low, high = (1 - share) * low, (1 + share) * high
        # one that is not known is no reason to leave it out
        inside = [r for r in inside if not (measure(r, name) < low or measure(r, name) > high)]
    kept: set[int] = set()  # places
    for name in names if inside else ():
        values = np.array([measure(row, name) for row in inside])
        ends = np.nanmin(values), np.nanmax(values)
        for value in np.linspace(*ends, min(regime.keep, wanted) // len(names)):
            kept.add(int(np.nanargmin(np.abs(values - value))))
    others = [place for place in range(len(inside)) if place not in kept]
    missing = wanted - len(kept)
    if regime.fill and missing > 0 and others:
        kept.update(others[k] for k in evenly(len(others), missing))
    return [inside[place] for place in sorted(kept)]


def in_time(found: list[Row], stored: list[Row], stays: set[int], count: int) -> list[Row]:
    """So many steps, evenly spread, as they are stored if they are.

    Stored ones with the numbers `stays` are taken, each in the place of a step near to it.
    """
    known = {row.number: row for row in stored}
    places = [found[k] for k in evenly(len(found), count)]
    old = sorted(stays)
    apart = [[abs(number - row.number) for row in places] for number in old]
    for k, place in zip(*linear_sum_assignment(np.reshape(apart, (len(old), count))), strict=True):
        places[place] = known[old[k]]
    return sorted((known.get(row.number, row) for row in places), key=lambda row: row.number)


def in_sets(states: trajectory.Trajectory) -> set[int]:
    """The numbers of the states whose problems a chosen set has."""
    digests = {choice.digest for name in CHOSEN for choice in set_index.choices(name)}
    return {
        int(number)
        for number, digest in zip(states.number, states.digest, strict=True)
        if digest in digests
    }


def make(name: str, regime: Regime, out: Path) -> list[Choice]:
    """Write the trajectory of a regime; the problems that were chosen."""
    own, folder = regime.collection, f"{regime.collection}/{name}"
    family = scenes.get(regime.scene or name)(**regime.parameters)
    # a stored scene, as a scene made again may differ in its last digits
    known = newest(folder) if regime.grows or regime.in_time else None
    scene = known.scene if known else family.scene(0)
    found = list(rows(name, regime, scene))
    stays = list(rows(name, replace(regime, states=folder), scene)) if known else []
    if known and regime.in_time:
        kept = in_time(found, stays, in_sets(known), regime.keep)
    else:
        taken = {row.number for row in stays}
        found = [row for row in found if row.number not in taken]
        kept = sorted(stays + chosen(found, regime, len(stays)), key=lambda row: row.number)
    model = model_of(scene)
    scheme = scheme_of(model)
    exponent = trajectory.exponent_of(model)
    problems: list[Any] = [
        problem_at(model, scheme, row.position, row.velocity).problem for row in kept
    ]
    settings: dict[str, Any] = {"fclib": fclib.__version__, **regime.way.record()}
    if regime.states:
        origin = newest(regime.states).origin
        settings = dict(origin["settings"]) | {"states": f"{regime.states}, {origin['version']}"}
    trajectory.write(
        out / published.file_name(folder, regime.version),
        trajectory.Trajectory(
            scene=scene,
            origin={"collection": own, "version": regime.version, "settings": settings},
            exponent=exponent,
            number=np.array([row.number for row in kept]),
            step=np.array([row.step for row in kept]),
            position=np.array([row.position for row in kept]),
            velocity=np.array([row.velocity for row in kept]),
            digest=tuple(_digest.digest(problem) for problem in problems),
            structure=tuple(_digest.structure(problem) for problem in problems),
            sketch=np.array([_digest.sketch(problem) for problem in problems]),
        ),
    )
    return [
        Choice(
            *(name, regime.parameters, 0, row.number, row.step, _digest.digest(problem)),
            scene=regime.scene,
        )
        for row, problem in zip(kept, problems, strict=True)
    ]


def one_contacts(out: Path) -> None:
    """Write the problems of one contact of the chute, the others' reactions being a solution's.

    Of the contacts that carry a reaction and whose W is conditioned as published, at equal
    distances in the order of their conditioning.
    """
    path = published.path_of(f"{SET}/Chute1000", REGIMES["Chute1000"].version)
    assert path is not None
    states = trajectory.read(path)
    found = []
    for place in range(len(states)):
        problem: Any = states.problem(place).problem
        result = fclib.solve(problem, solver="nsgs", tol=1e-6, max_iterations=500, merit="natural")
        r = np.reshape(result.solution.r, (-1, 3))
        u = np.reshape(np.asarray(result.solution.u), (-1, 3))
        H = sp.csc_array(problem.H)
        weighted = sp.csc_array(sp.linalg.inv(sp.csc_array(problem.M)) @ H)
        for c in np.flatnonzero(r[:, 0] > 1e-3 * r[:, 0].max()):
            part = slice(3 * c, 3 * c + 3)
            W = (H[:, part].T @ weighted[:, part]).toarray()
            conditioning = np.linalg.cond(W)
            if conditioning <= 4.66:
                q = u[c] - W @ r[c]
                origin = f"rr9118/Chute1000/{states.number[place]:04d}, contact {c}"
                found.append((conditioning, origin, W, q))
    found.sort(key=lambda one: one[:2])
    chosen = np.unique(np.linspace(0, len(found) - 1, 834).round().astype(int))
    lines = ",\n".join(
        json.dumps(
            {
                **{"spacedim": 3, "mu": 1.0, "mu_r": None, "origin": found[k][1]},
                **{"W": found[k][2].tolist(), "q": found[k][3].tolist()},
            }
        )
        for k in chosen
    )
    text = f'{{"problems": [\n{lines}\n]}}\n'
    (out / "chute_local_problems.json").write_text(text, encoding="utf-8")
    print(f"{len(chosen)} of {len(found)} contacts")


def main() -> None:
    """Simulate, choose, write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("families", nargs="*", help="some of them; all by default")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    if arguments.families == ["ChuteLocalProblems"]:
        one_contacts(arguments.out)
        return
    for name in arguments.families or REGIMES:
        target = arguments.out / f"{REGIMES[name].collection}.json"
        own = make(name, REGIMES[name], arguments.out)
        before = set_index.Choice.read(target) if target.is_file() else ()
        listed = [choice for choice in before if choice.family != name] + own
        listed.sort(key=lambda choice: (choice.family, choice.number))
        rows = [{k: v for k, v in asdict(choice).items() if v != ""} for choice in listed]
        lines = ",\n".join(" " + json.dumps(row, sort_keys=True) for row in rows)
        target.write_text(f'{{"problems": [\n{lines}\n]}}\n', encoding="utf-8")
        print(f"{name}: {len(own)} problems", flush=True)


if __name__ == "__main__":
    main()
