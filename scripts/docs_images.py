"""The pictures of families in docs/images, from stored states.

    python scripts/docs_images.py [NAME...] [--out docs/images]

Each shows a stored state of a family, some with the contact forces of its solution. It needs OpenGL
(see `fclib.simulate.render`). `fclib report` and a browser make those of the report, by hand.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import fclib
from fclib import scenes, simulate
from fclib.collections import known, trajectory

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Shot:
    """What a picture shows."""

    family: str  # of the set standard
    number: int  # of its stored states, in turn; -1 is the last one
    size: tuple[int, int]  # width and height [pixels]
    forces: bool = False


SHOTS = {
    "cubes-h8": Shot("CubesH8", -1, (480, 600), forces=True),
    "low-wall": Shot("LowWall", -1, (660, 400)),
    "low-wall-fem": Shot("LowWallFEM", -1, (840, 360), forces=True),
    "closed-chains": Shot("ClosedChains", -1, (480, 640)),
}


def shoot(shot: Shot, path: Path) -> None:
    """Write a picture; the scene's own view and focus are those of its class now."""
    plan = known.plan_of(f"standard/{shot.family}")
    if plan.trajectory is None:
        raise ValueError(f"{shot.family} has no stored states")
    states = trajectory.read(plan.trajectory)
    family: Any = scenes.get(shot.family)
    seen = family().scene(states.scene.seed)
    model = simulate.model_of(replace(states.scene, view=seen.view, focus=seen.focus))
    place = range(len(states.number))[shot.number]
    part = states.problem(place)
    if not shot.forces:
        model.set_state(states.position[place], states.velocity[place])
        simulate.render(model, path, size=shot.size)
        return
    step = simulate.Step(
        index=int(states.step[place]),
        time=0.0,
        problem=part.problem,
        result=fclib.solve(part.problem, tol=1e-8),
        velocity=np.asarray(states.velocity[place]),
        dofs=part.dofs,
        contacts=part.contacts,
        position=np.asarray(states.position[place]),
        start=simulate.State(
            index=int(states.step[place]),
            position=np.asarray(states.position[place]),
            velocity=np.asarray(states.velocity[place]),
            pair=np.zeros((0, 2), dtype=np.int64),
            frame=np.zeros((0, 3, 3)),
            r=np.zeros((0, 3)),
        ),
        model=model,
    )
    simulate.render(step, path, size=shot.size)


def main() -> None:
    """Make all pictures, or some."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(SHOTS))
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images")
    options = parser.parse_args()
    for name in options.names or SHOTS:
        if name not in SHOTS:
            parser.error(f"there is no picture {name}; there are {', '.join(SHOTS)}")
        shoot(SHOTS[name], options.out / f"{name}.png")


if __name__ == "__main__":
    main()
