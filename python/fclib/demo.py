"""The main job, end to end: simulate a scene, store its problems, solve them, judge the solutions.

scene -> simulate -> FCLIB files -> read -> solve -> merit -> table, CSV, picture
the campaign `quick` -> runs in limited processes -> store -> profile
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fclib
from fclib import bench
from fclib._files import write_csv

# solvers with their options
CONFIGURATIONS: tuple[tuple[str, dict[str, Any]], ...] = (("auto", {}), ("nsgs", {}))
CAMPAIGN = "quick"


@dataclass(frozen=True)
class Stored:
    """The two files of a step."""

    global_path: Path
    local_path: Path


def simulate(folder: Path, boxes: int, steps: int, picture: Path | None) -> Iterator[Stored]:
    """Drop a stack of boxes, and store the global and the local form of every step.

    The global file holds the solution that gave the next state. After the last step the scene is
    drawn to `picture`, if that is not None.

    Raises:
        ImportError: MuJoCo is missing in the pinned version.
        fclib.simulate.NoRenderer: all is stored, but nothing can draw the picture.
        fclib.FileError: a file cannot be written.
    """
    from fclib import scenes
    from fclib import simulate as simulation

    folder.mkdir(parents=True, exist_ok=True)
    scene = scenes.get("BoxesStack")(boxes=boxes, gap=0.01, time_step=5e-3).scene(seed=0)
    step = None
    for step in simulation.simulate(scene, steps):
        stored = Stored(
            folder / f"stack-{step.index:03d}-global.hdf5",
            folder / f"stack-{step.index:03d}-local.hdf5",
        )
        fclib.write(stored.global_path, step.problem, step.result.solution)
        fclib.write(stored.local_path, step.problem.condense())
        yield stored
    if step is not None and picture is not None:
        simulation.render(step, picture)


def solve(path: Path, tol: float) -> list[bench.Run]:
    """Solve the problem of a file in each configuration, and store the most accurate solution."""
    problem = fclib.read(path)
    runs = [
        bench.run(path.stem, problem, solver, tol, options=options)
        for solver, options in CONFIGURATIONS
    ]
    best = min(runs, key=lambda run: run.error)
    fclib.write_solution(path, best.result.solution)
    return runs


def campaign(store: Path, jobs: int, show: Callable[[bench.Progress], None]) -> bench.Progress:
    """Run the campaign `quick`, or what is left of it.

    Raises:
        fclib.Error: as `fclib.bench.run_campaign` does.
    """
    return bench.run_campaign(bench.Campaign.read(CAMPAIGN), store, jobs=jobs, show=show)


def write_runs(path: Path, runs: Sequence[bench.Run]) -> None:
    """All runs, one row each."""
    write_csv(path, bench.COLUMNS, ([run.record[name] for name in bench.COLUMNS] for run in runs))
