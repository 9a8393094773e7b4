"""The states of the family ElasticPunch: each step of its path is solved, and its slip is stored.

    python -m workshop.sets.elastic_punch OUT/elastic_punch.npz

The file goes to `python/fclib/scenes/`. A state is the displacement of the lower face along x and
y, rounded to QUANTUM; the next step begins from the rounded one, as its problem does.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

import fclib
from fclib.scenes.elastic_punch import KINDS_OF_FACE, QUANTUM, STEPS, ElasticPunch

TOLERANCE = 1e-10


def path_of(kind: str, bricks: int) -> list[np.ndarray]:
    """The displacements at the end of each step, in quanta."""
    family = ElasticPunch()
    slipped = np.zeros(((bricks + 1) ** 2, 2))
    found = []
    for step in range(STEPS):
        problem: Any = family.of_step(kind, bricks, step, slipped)
        result = fclib.solve(problem, tol=TOLERANCE)
        if not result.converged:
            raise SystemExit(f"{kind}, {bricks} bricks, step {step}: {result.message}")
        ends = np.reshape(problem.H.T @ result.solution.v, (-1, 3))[:, 1:]
        quanta = np.rint(ends / QUANTUM).astype(np.int64)
        found.append(quanta)
        slipped = np.asarray(QUANTUM * quanta)
        print(kind, bricks, step, result.iterations, f"{result.error:.1e}", flush=True)
    return found


def main() -> None:
    """Write the file."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path)
    out = parser.parse_args().out
    arrays: dict[str, Any] = {
        f"slipped{face}": np.stack(path_of(*kind)) for face, kind in enumerate(KINDS_OF_FACE)
    }
    np.savez_compressed(out, **arrays)


if __name__ == "__main__":
    main()
