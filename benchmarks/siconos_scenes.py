"""Problems of another simulator: scenes simulated by Siconos and Bullet, written as FCLIB files.

    .venv/bin/python benchmarks/siconos_scenes.py OUT [--scenes boxes-80-0.5 wall-8-0.6 ...]
        [--steps 400] [--every 25]

A scene is KIND-BODIES-MU; the kinds are in _siconos_simulation.py, which Siconos' own interpreter
runs (fclib.external.siconos). Contacts, time stepping and the slightly asymmetric W are theirs:
nothing of it is ours. The problems are for against_siconos.py and `fclib bench`.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import scipy.sparse

import fclib
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
    with tempfile.TemporaryDirectory() as folder:
        arguments = [*scene.split("-"), str(steps), str(every), folder]
        command = [siconos.python(), str(SIMULATION), *arguments]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"{scene}: {(done.stderr.strip() or done.stdout).splitlines()[-1]}")
        files = sorted(Path(folder).glob("*.npz"))
        for file in files:
            with np.load(file) as data:
                m = len(data["q"])
                w = scipy.sparse.csc_array(
                    (data["data"], data["indices"], data["indptr"]), shape=(m, m)
                )
                problem = fclib.LocalProblem(W=w, q=data["q"], mu=data["mu"], spacedim=3)
            fclib.write(out / f"{scene}-{file.stem}.hdf5", problem)
    return len(files)


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
