"""Pyramids of boxes whose masses differ: how many each solver solves, and with what work.

    python -m workshop.tables.mass_ratios [--ratios 1 1e2 1e4 1e6 1e8] [--count 40]
        [--solvers auto nsip] [--results mass-ratios]

Boxes of 1 m lie on one another and side by side, with four contacts on each face, so that there are
more reactions than velocities. Half of the pyramids have two masses, 1 kg and the ratio, the others
masses from 1 kg to the ratio. One box has a velocity of its own. A row is a ratio and a solver; all
problems are solvable, because all boxes could be lifted. Not solved, but told, is where the message
names the digit at which rounding ends the solve.
"""

from __future__ import annotations

import argparse
import statistics
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

import fclib
from workshop.tables import _results

Array: TypeAlias = npt.NDArray[np.float64]

STEP = 1e-2  # [s]
GRAVITY = 9.81  # [m/s^2]
UP = 2  # the axis


def face(first: Array, second: Array | None) -> tuple[list[Array], Array]:
    """The corners of what two boxes share (the second is the ground: None), and its normal."""
    if second is None:
        second = first - [0, 0, 1]
    axis = int(np.argmax(np.isclose(np.abs(first - second), 1)))
    low, high = np.maximum(first, second) - 0.5, np.minimum(first, second) + 0.5
    x, y = (k for k in range(3) if k != axis)
    corners = []
    for a in (low[x], high[x]):
        for b in (low[y], high[y]):
            corner = (first + second) / 2
            corner[x], corner[y] = a, b
            corners.append(corner)
    return corners, np.eye(3)[axis] * np.sign(first[axis] - second[axis])


def rows(centres: list[Array], first: int, second: int | None) -> Array:
    """Of H^T, for the four contacts of a face."""
    corners, normal = face(centres[first], None if second is None else centres[second])
    axis = int(np.argmax(np.abs(normal)))
    frame = np.array([normal, *(np.eye(3)[k] for k in range(3) if k != axis)])
    result = np.zeros((12, 6 * len(centres)))
    for k, corner in enumerate(corners):
        for box, sign in ((first, 1.0), (second, -1.0)):
            if box is None:
                continue
            arm = np.cross(corner - centres[box], frame)  # of each direction
            result[3 * k : 3 * k + 3, 6 * box : 6 * box + 6] = sign * np.hstack([frame, arm])
    return result


def pyramid(seed: int, ratio: float) -> fclib.GlobalProblem:
    """Boxes of masses from 1 to ratio [kg]."""
    rng = np.random.default_rng([seed, 99])
    width = int(rng.integers(2, 5))
    centres = [
        np.array([i + layer / 2, 0, layer + 0.5])
        for layer in range(width)
        for i in range(width - layer)
    ]
    n = len(centres)
    heavy = rng.random(n)
    mass = np.where(heavy < 0.5, 1.0, ratio) if seed % 2 else ratio**heavy
    faces: list[tuple[int, int | None]] = [(a, None) for a in range(n) if centres[a][UP] < 1]
    for a in range(n):
        for b in range(a):
            apart = np.abs(centres[a] - centres[b])
            beside = apart[UP] == 0 and apart[0] == 1
            if beside or (apart[UP] == 1 and apart[0] < 1):
                faces.append((a, b))
    H = np.vstack([rows(centres, *pair) for pair in faces]).T
    M = np.outer(mass, [1, 1, 1, 1 / 6, 1 / 6, 1 / 6]).ravel()
    v = np.zeros((n, 6))
    v[rng.integers(n)] = rng.choice([0, 1, -1, 0.5], 6) * rng.choice([0.01, 1.0])
    v[:, UP] -= STEP * GRAVITY
    nc = H.shape[1] // 3
    mu = np.full(nc, rng.choice([0.1, 0.3, 0.6, 1.0]))
    return fclib.GlobalProblem(M=np.diag(M), H=H, f=M * v.ravel(), w=np.zeros(3 * nc), mu=mu)


def row(ratio: float, count: int, solver: str) -> dict[str, Any]:
    """Solve the pyramids of a ratio."""
    results = [fclib.solve(pyramid(seed, ratio), solver, time_limit=20) for seed in range(count)]
    solved = [result for result in results if result.converged]
    told = sum("digit" in (result.message or "") for result in results if not result.converged)
    worst = max((result.error for result in results if not result.converged), default=None)
    return {
        "heaviest over lightest": f"{ratio:g}",
        "solver": solver,
        "pyramids": count,
        "solved to 1e-8": len(solved),
        "not solved, but told": told,
        "largest error of the others": "" if worst is None else f"{worst:.0e}",
        "median iterations": round(statistics.median(r.iterations for r in solved))
        if solved
        else "",
        "CPU of all [s]": f"{sum(result.cpu_s for result in results):.3g}",
    }


def main() -> None:
    """Print a line for each ratio and solver."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--ratios", type=float, nargs="+", default=[1, 1e2, 1e4, 1e6, 1e8])
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--solvers", nargs="+", default=["auto", "nsip"])
    _results.add_option(parser)
    arguments = parser.parse_args()
    table = []
    for ratio in arguments.ratios:
        for solver in arguments.solvers:
            table.append(row(ratio, arguments.count, solver))
            print(", ".join(f"{key}: {value}" for key, value in table[-1].items()), flush=True)
    if arguments.results:
        _results.store(
            arguments.results,
            table,
            title="Pyramids of light and heavy boxes",
            note=f"Seeds 0 to {arguments.count - 1}, 20 s of wall-clock time a solve.",
        )


if __name__ == "__main__":
    main()
