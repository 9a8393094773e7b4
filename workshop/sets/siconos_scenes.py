"""Problems of another simulator: scenes simulated by Siconos and Bullet, written as FCLIB files.

    python -m workshop.sets.siconos_scenes OUT [--scenes boxes-80-0.5 wall-8-0.6 ...]
        [--steps 400] [--every 25]

A scene is KIND-BODIES-MU; the kinds are in _siconos_simulation.py, whose steps fclib.recorders
records. Contacts, time stepping and the slightly asymmetric W are theirs: nothing of it is ours.
The problems are for `fclib bench`.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from fclib import recorders
from fclib.external import siconos

SIMULATION = Path(__file__).with_name("_siconos_simulation.py")
SCENES = (
    "rocks-60-1.0",
    "rocks-150-0.5",
    "boxes-80-0.5",
    "boxes-80-1.2",
    "spheres-160-0.5",
    "capsules-80-0.9",
    "towers-10-0.4",
    "wall-8-0.6",
)
KINDS = sorted({scene.split("-")[0] for scene in SCENES})
SCENE = re.compile(rf"({'|'.join(KINDS)})-\d+-\d*\.?\d+")


def simulate(scene: str, steps: int, every: int, out: Path) -> int:
    """Write the problems of a scene. Their number."""
    arguments = [*scene.split("-"), str(steps)]
    written = 0
    for recorded in recorders.siconos(SIMULATION, arguments=arguments, every=every):
        step = round(recorded.time / recorded.h)
        if step:  # at the start nothing has moved yet
            recorded.write(out / f"{scene}-{step:05d}.hdf5")
            written += 1
    return written


def main() -> None:
    """Simulate scene by scene."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("out", type=Path)
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), help="KIND-BODIES-MU")
    parser.add_argument("--steps", type=int, default=400, help="of 5 ms")
    parser.add_argument("--every", type=int, default=25, help="write one step in so many")
    arguments = parser.parse_args()
    if word := siconos.missing():
        sys.exit(word)
    for scene in arguments.scenes:
        if not SCENE.fullmatch(scene):
            parser.error(f"{scene}: a scene is KIND-BODIES-MU, KIND one of {', '.join(KINDS)}")
    arguments.out.mkdir(parents=True, exist_ok=True)
    for scene in arguments.scenes:
        count = simulate(scene, arguments.steps, arguments.every, arguments.out)
        print(f"{scene}: {count} problems", flush=True)


if __name__ == "__main__":
    main()
