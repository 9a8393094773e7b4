"""Bodies that are held or at rest: whether they stay, by what counts as a closed gap.

    python -m workshop.tables.held_bodies [--seconds 20] [--results held-bodies]

A rod that friction holds between two pads, a cube pressed to a wall, a stack of ten boxes, an arch
of 24 stones. Each is simulated with the allowances of fclib.simulate.moreau_jean, and for a tenth
of the time with others: none, the roundings of stored states alone, and a hundred times the share
of the motion.

    creep      the most that a coordinate moves after the first tenth
    changes    how often the number of contacts changes
    unsteady   the most that a reaction changes after the first tenth, of the largest one
    unsolved   steps
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from fclib import scenes
from fclib.scenes import Scene
from fclib.simulate import moreau_jean, simulate
from fclib.simulate.geometry import places_of
from fclib.simulate.simulation import same_contacts
from workshop.tables import _results

HEAD = '<mujoco><option timestep="0.002"/>'
ROD = f"""{HEAD}<default><geom friction="0.7"/></default><worldbody>
<body pos="-0.03 0 0.5"><joint type="slide" axis="1 0 0" damping="20" name="l"/>
  <geom type="box" size="0.02 0.03 0.03" mass="0.2"/></body>
<body pos="0.03 0 0.5"><joint type="slide" axis="-1 0 0" damping="20" name="r"/>
  <geom type="box" size="0.02 0.03 0.03" mass="0.2"/></body>
<body pos="0 0 0.5"><freejoint/>
  <geom type="capsule" size="0.004 0.02" euler="90 0 0" mass="0.045"/></body></worldbody>
<actuator><position joint="l" kp="1500"/><position joint="r" kp="1500"/></actuator>
<keyframe><key name="start" ctrl="0.01 0.01" qpos="0.006 0.006 0 0 0.5 1 0 0 0"/></keyframe>
</mujoco>"""
WALL = f"""{HEAD}<default><geom friction="0.7"/></default><worldbody>
<geom type="box" size="0.1 1 1" pos="-0.1 0 1"/>
<body pos="0.25 0 1"><joint type="slide" axis="1 0 0" name="push"/>
  <geom type="box" size="0.05 0.05 0.05" mass="0.5"/></body>
<body pos="0.1 0 1"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="1"/></body></worldbody>
<actuator><motor joint="push"/></actuator>
<keyframe><key name="start" ctrl="-40" qpos="0 0.1 0 1 1 0 0 0"/></keyframe></mujoco>"""
BOX = '<body pos="0 0 {}"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="1"/></body>'
STACK = (
    f'{HEAD}<worldbody><geom type="plane" size="1 1 0.1"/>'
    f"{''.join(BOX.format(0.1 + 0.2 * i) for i in range(10))}</worldbody></mujoco>"
)


def made() -> dict[str, Scene]:
    """The scenes."""
    arch = scenes.get("Arch")(spread=0.0, lap=0.0).scene()
    return {
        "rod between pads": Scene(name="rod", xml=ROD),
        "cube at a wall": Scene(name="wall", xml=WALL),
        "stack of ten": Scene(name="stack", xml=STACK),
        "arch": replace(arch, allowance=True),
    }


@contextmanager
def constants(roundings: float, motion: float) -> Iterator[None]:
    """Other constants meanwhile."""
    known = moreau_jean.ROUNDINGS, moreau_jean.MOTION
    moreau_jean.ROUNDINGS, moreau_jean.MOTION = roundings, motion
    try:
        yield
    finally:
        moreau_jean.ROUNDINGS, moreau_jean.MOTION = known


def run(scene: Scene, seconds: float) -> dict[str, Any]:
    """What is seen in so many seconds."""
    counts: list[int] = []
    creep = unsteady = 0.0
    unsolved = 0
    first: Any = None
    h = None
    for step in simulate(scene, 10**9):
        h = h or step.model.time_step
        counts.append(step.problem.nc)
        unsolved += not step.result.converged
        if step.time >= seconds:
            break
        if step.time < 0.1 * seconds:
            continue
        r = np.reshape(step.result.solution.r, (-1, step.contacts.dimension))
        pair, place = step.contacts.pair, places_of(step.model, step.contacts)
        first = first or (step.position, r, pair, place)
        creep = max(creep, float(np.abs(step.position - first[0]).max()))
        # MuJoCo changes the order of points
        source = same_contacts(first[2], first[3], pair, place)
        if len(r) == len(first[1]) and (source >= 0).all():
            unsteady = max(unsteady, float(np.abs(r - first[1][source]).max()))
        else:
            unsteady = float("inf")
    largest = max(float(np.abs(first[1]).max(initial=0.0)), 1e-300)
    return {
        "seconds": f"{seconds:g}",
        "contacts": f"{min(counts)} to {max(counts)}",
        "changes": int((np.diff(counts) != 0).sum()),
        "creep [m, rad]": f"{creep:.1e}",
        "unsteady": f"{unsteady / largest:.1e}",
        "unsolved": unsolved,
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seconds", type=float, default=20.0)
    _results.add_option(parser)
    arguments = parser.parse_args()
    chosen = moreau_jean.ROUNDINGS, moreau_jean.MOTION
    others = [(0.0, 0.0), (chosen[0], 0.0), (chosen[0], 100 * chosen[1])]
    rows = []
    for name, scene in made().items():
        for own in [chosen, *others]:
            with constants(*own):
                share = 1.0 if own == chosen else 0.1
                found = run(scene, share * arguments.seconds)
            rows.append({"scene": name, "roundings": own[0], "motion": own[1], **found})
            print(*rows[-1].values(), sep="  ", flush=True)
    if arguments.results:
        note = (
            "Roundings of a stored state and share of the free motion of a step that a closed gap"
            " may show. Creep, unsteady: the most that a coordinate moves, and that a reaction"
            " changes, of the largest one, after the first tenth of the time; inf: contacts change."
        )
        title = "Bodies that are held or at rest"
        print(_results.store(arguments.results, rows, title=title, note=note))


if __name__ == "__main__":
    main()
