"""The stored states of the set `rr9118`: the families in the regimes of the published sets.

    .venv/bin/python benchmarks/regimes.py OUT [FAMILY...]

Each scene is simulated by nonsmooth Gauss-Seidel to 1e-3, as packings of thousands of contacts cost
minutes a step where more is asked: a stored state is what a step begins from, and how it came about
is no part of its problem. Or its states are those of a stored trajectory, under another law. Of the
steps whose contacts are as many as published (published_sets.csv), some are kept, evenly spread by
their number of contacts.

States in which a body is more than DEEPEST in another are left out.

With the name ChuteLocalProblems it writes OUT/chute_local_problems.json from the stored states.

Writes OUT/rr9118/FAMILY-1.trajectory and OUT/rr9118.json, the list of what was chosen, which go to
`collection/` and to `python/fclib/collections/data/`. Half an hour of CPU.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

import fclib
from fclib import _digest, scenes
from fclib.collections import known, published, trajectory
from fclib.collections.known import Choice
from fclib.collections.plan import Simulation
from fclib.simulate import Contacts, Model, model_of, problem_at, scheme_of, simulate

DEEPEST = 0.02  # penetration of a state that is kept, of the smallest body's diameter
SET, VERSION = "rr9118", "1"
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
    conditioning: bool = False  # whether it chooses too


STEEL = {"young": 2e11, "density": 7800.0, "time_step": 0.0125}
CHUTE = {"hexahedra": True, "gaps": True, "spheres": 0.0, "slope": 0.6}
REGIMES: dict[str, Regime] = {
    "Chute1000": Regime(
        "Chute_1000",
        CHUTE | {"layers": 8, "time_step": 2e-3, "grains": 930},
        keep=24,
        steps=440,
    ),
    "Chute4000": Regime(
        "Chute_4000",
        CHUTE | {"layers": 14, "across": 14, "time_step": 1e-3, "grains": 3340},
        keep=6,
        steps=800,
    ),
    "Aqueduct": Regime(
        "Aqueduct_PR",
        {"bond": True, "voussoirs": 8, "settlement": 0.05},
        keep=10,
        steps=14,
        way=Simulation(solver="auto", tol=1e-4, options={"time_limit": 20.0}),
    ),
    "SpheresBox": Regime(
        "945_SP_Box_PL",
        {"margin": 0.4, "load": 5.0, "offset": 0.2, "time_step": 0.01},
        keep=12,
        steps=140,
    ),
    "PeriodicBox": Regime(
        "100_PR_Periobox",
        {"hexahedra": True, "spread": 0.1, "margin": 0.6, "radius": 3.7, "time_step": 4e-3},
        keep=20,
        steps=440,
    ),
    "Capsules": Regime(
        "Capsules",
        {"gaps": True, "activation": 0.0, "margin": 0.04, "gyroscopic": True},
        keep=40,
        states="rt444/Capsules",
    ),
    "Bridge": Regime(
        "Bridge_PR",
        {"load": 0.0, "slabs": 3, "spread": 1.0},
        keep=12,
        steps=180,
        way=EXACT,
        conditioning=True,
    ),
    "Chain": Regime("Chain", {}, keep=60, states="rt444/Chain", conditioning=True),
    "CubesH8": Regime(
        "Cubes_H8_5",
        STEEL | {"push": 8e4, "pressure": 1e4, "rise": 0.05, "bed": 1e11},
        keep=12,
        steps=36,
        way=EXACT,
    ),
    "CubesH8x20": Regime("Cubes_H8_20", STEEL | {"upper": 1.0}, keep=1, steps=1, way=EXACT),
}


@dataclass(frozen=True)
class Row:
    """A step: where it begins, and its size."""

    number: int  # among those with contact
    step: int
    position: Any
    velocity: Any
    n: int
    nc: int
    depth: float  # largest penetration, of the smallest body's diameter
    conditioning: float  # of W; NaN where nobody asks


def depth(contacts: Contacts, model: Model) -> float:
    """The largest penetration, of the diameter of the smallest body; elastic ones have no size."""
    size = model.smallest_size
    return -float(contacts.gap.min(initial=0.0)) / (2 * size) if size else 0.0


def conditioning_of(problem: Any) -> float:
    """Of W, dense: its largest singular value over the smallest that is not zero."""
    W = problem.H.T @ splu(sp.csc_array(problem.M)).solve(problem.H.toarray())
    values = np.linalg.svd(W, compute_uv=False)
    return float(values[0] / values[values > 1e-12 * values[0]][-1])


def rows(name: str, regime: Regime, scene: scenes.Scene) -> Iterator[Row]:
    """The steps of a regime that have a contact; of a simulation, as it goes."""
    if regime.states:
        path = published.path_of(regime.states, published.versions(regime.states)[-1])
        assert path is not None
        stored = trajectory.read(path)
        model = model_of(scene)
        scheme = scheme_of(model)
        for k in range(len(stored)):
            part = problem_at(model, scheme, stored.position[k], stored.velocity[k])
            problem = part.problem
            yield Row(
                int(stored.number[k]),
                int(stored.step[k]),
                stored.position[k],
                stored.velocity[k],
                problem.n,
                problem.nc,
                depth(part.contacts, model),
                conditioning_of(problem) if regime.conditioning else np.nan,
            )
        return
    number, start = 0, time.process_time()
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
            yield Row(
                number,
                step.index,
                step.start.position,
                step.start.velocity,
                step.problem.n,
                step.problem.nc,
                depth(step.contacts, step.model),
                conditioning_of(step.problem) if regime.conditioning else np.nan,
            )
            number += 1


def chosen(found: list[Row], regime: Regime) -> list[Row]:
    """Those of as many contacts as published, evenly spread by that number.

    Where the conditioning chooses too: of those that are conditioned as published, half are spread
    by the logarithm of their conditioning.
    """
    with PUBLISHED.open(newline="") as file:
        row = next(row for row in csv.DictReader(file) if row["set"] == regime.published)

    def bounds(name: str) -> tuple[float, float]:
        low, _, high = row[name].partition(" to ")
        return float(low), float(high or low)

    low, high = bounds("contacts")
    inside = [r for r in found if low <= r.nc <= high and r.depth <= DEEPEST]
    measures: list[Callable[[Row], float]] = [lambda r: float(r.nc)]
    if regime.conditioning:
        # to 10 % of the exponent, as the table compares
        low, high = bounds("conditioning")
        low, high = low**0.9, high**1.1
        inside = [r for r in inside if low <= r.conditioning <= high]
        measures.append(lambda r: math.log(r.conditioning))
    kept: dict[int, Row] = {}
    for measure in measures if inside else ():
        values = [measure(r) for r in inside]
        for wanted in np.linspace(min(values), max(values), regime.keep // len(measures)):
            place = int(np.argmin(np.abs(np.array(values) - wanted)))
            kept[inside[place].number] = inside[place]
    return [kept[number] for number in sorted(kept)]


def make(name: str, regime: Regime, out: Path) -> list[Choice]:
    """Write the trajectory of a regime; the problems that were chosen."""
    family = scenes.get(name)(**regime.parameters)
    scene = family.scene(0)
    kept = chosen(list(rows(name, regime, scene)), regime)
    model = model_of(scene)
    scheme = scheme_of(model)
    exponent = trajectory.exponent_of(model)
    problems = []
    positions = [trajectory.rounded(row.position, exponent) for row in kept]
    velocities = [trajectory.rounded(row.velocity, exponent) for row in kept]
    for q, v in zip(positions, velocities, strict=True):
        problems.append(problem_at(model, scheme, q, v).problem)
    settings: dict[str, Any] = {"fclib": fclib.__version__, **regime.way.record()}
    if regime.states:
        path = published.path_of(regime.states, published.versions(regime.states)[-1])
        assert path is not None
        origin = trajectory.read(path).origin
        settings = dict(origin["settings"]) | {"states": f"{regime.states}, {origin['version']}"}
    trajectory.write(
        out / published.file_name(f"{SET}/{name}", VERSION),
        trajectory.Trajectory(
            scene=scene,
            origin={"collection": SET, "version": VERSION, "settings": settings},
            exponent=exponent,
            number=np.array([row.number for row in kept]),
            step=np.array([row.step for row in kept]),
            position=np.array(positions),
            velocity=np.array(velocities),
            digest=tuple(_digest.digest(problem) for problem in problems),
            structure=tuple(_digest.structure(problem) for problem in problems),
            sketch=np.array([_digest.sketch(problem) for problem in problems]),
        ),
    )
    return [
        Choice(name, regime.parameters, 0, row.number, row.step, _digest.digest(problem))
        for row, problem in zip(kept, problems, strict=True)
    ]


def one_contacts(out: Path) -> None:
    """Write the problems of one contact of the chute, the others' reactions being a solution's.

    At equal distances, of the contacts that carry a reaction and whose W is conditioned as
    published.
    """
    path = published.path_of(f"{SET}/Chute1000", VERSION)
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
            if np.linalg.cond(W) <= 4.66:
                q = u[c] - W @ r[c]
                found.append((f"rr9118/Chute1000/{states.number[place]:04d}, contact {c}", W, q))
    chosen = np.unique(np.linspace(0, len(found) - 1, 834).round().astype(int))
    lines = ",\n".join(
        json.dumps(
            {
                **{"spacedim": 3, "mu": 1.0, "mu_r": None, "origin": found[k][0]},
                **{"W": found[k][1].tolist(), "q": found[k][2].tolist()},
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
    target = arguments.out / f"{SET}.json"
    arguments.out.mkdir(parents=True, exist_ok=True)
    if arguments.families == ["ChuteLocalProblems"]:
        one_contacts(arguments.out)
        return
    for name in arguments.families or REGIMES:
        own = make(name, REGIMES[name], arguments.out)
        before = known.Choice.read(target) if target.is_file() else ()
        listed = [choice for choice in before if choice.family != name] + own
        listed.sort(key=lambda choice: (choice.family, choice.number))
        lines = ",\n".join(" " + json.dumps(asdict(choice), sort_keys=True) for choice in listed)
        target.write_text(f'{{"problems": [\n{lines}\n]}}\n', encoding="utf-8")
        print(f"{name}: {len(own)} problems", flush=True)


if __name__ == "__main__":
    main()
