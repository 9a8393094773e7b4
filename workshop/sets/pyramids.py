"""Pyramids of boxes whose masses differ, as files: the problems of campaigns/pyramids.toml.

    python -m workshop.sets.pyramids OUT [--ratios 1 1e2 1e4 1e6 1e8] [--count 40]

Boxes of 1 m lie on one another and side by side, with four contacts on each face, so that there are
more reactions than velocities. Half of the pyramids have two masses, 1 kg and the ratio, the others
masses from 1 kg to the ratio. One box has a velocity of its own. All problems are solvable, because
all boxes could be lifted. The folder of a problem is the ratio of the heaviest to the lightest box.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

import fclib

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


def main() -> None:
    """Write the files OUT/RATIO/SEED.hdf5."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--ratios", type=float, nargs="+", default=[1, 1e2, 1e4, 1e6, 1e8])
    parser.add_argument("--count", type=int, default=40)
    arguments = parser.parse_args()
    for ratio in arguments.ratios:
        folder = arguments.out / f"{ratio:g}"
        folder.mkdir(parents=True, exist_ok=True)
        for seed in range(arguments.count):
            fclib.write(folder / f"{seed:03d}.hdf5", pyramid(seed, ratio))


if __name__ == "__main__":
    main()
