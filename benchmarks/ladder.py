"""Problems of any size, made from geometry alone: walls of blocks and packings of spheres.

    .venv/bin/python benchmarks/ladder.py OUT [--contacts 10 100 1000 10000] [--kind wall packing]
        [--push 0 1] [--seed 0]

Each is a global problem (G3DFC) of one time step from rest: gravity, a floor, for packings four
side walls, and with --push a horizontal impulse on one block or on one side of the packing, PUSH
times the weight of all bodies. A wall is hyperstatic: four contacts for each pair of faces.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

import fclib

GRAVITY = 9.81  # [m/s2]
STEP = 5e-3  # [s]


def contact_rows(
    normals: np.ndarray, points: np.ndarray, centres: np.ndarray, bodies: np.ndarray, sign: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Entries of H^T (rows, columns, values) for one side of the contacts; the ground is < 0."""
    nc = len(normals)
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0, 0]], [[0, 1.0, 0]])
    t1 = np.cross(normals, helper)
    t1 /= np.linalg.norm(t1, axis=1, keepdims=True)
    frames = np.stack([normals, t1, np.cross(normals, t1)], axis=1)  # (nc, 3, 3), by rows
    moving = np.flatnonzero(bodies >= 0)
    arms = points[moving] - centres[bodies[moving]]
    directions = frames[moving]
    moments = np.cross(arms[:, None, :], directions)
    values = sign * np.concatenate([directions, moments], axis=2)  # (., 3, 6)
    rows = np.broadcast_to(
        (3 * np.arange(nc)[moving])[:, None, None] + np.arange(3)[:, None], values.shape
    )
    columns = np.broadcast_to(6 * bodies[moving][:, None, None] + np.arange(6), values.shape)
    return rows.ravel(), columns.ravel(), values.ravel()


def problem_of(
    masses: np.ndarray,
    inertias: np.ndarray,
    centres: np.ndarray,
    contacts: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    impulses: np.ndarray,
    mu: float,
    title: str,
) -> fclib.GlobalProblem:
    """From masses, principal inertias (n, 3) and contacts (body a, body b, normal, point)."""
    first, second, normals, points = contacts
    count = len(masses)
    parts = [
        contact_rows(normals, points, centres, second, 1.0),
        contact_rows(normals, points, centres, first, -1.0),
    ]
    rows, columns, values = (np.concatenate([part[k] for part in parts]) for k in range(3))
    nc = len(normals)
    transposed = sp.csr_array((values, (rows, columns)), shape=(3 * nc, 6 * count))
    transposed.data[np.abs(transposed.data) < 1e-15] = 0
    transposed.eliminate_zeros()
    diagonal = np.concatenate([np.repeat(masses[:, None], 3, axis=1), inertias], axis=1).ravel()
    f = np.zeros((count, 6))
    f[:, 2] = -masses * GRAVITY * STEP
    f[:, :3] += impulses
    return fclib.GlobalProblem(
        M=sp.diags_array(diagonal).tocsc(),
        H=transposed.T.tocsc(),
        f=f.ravel(),
        w=np.zeros(3 * nc),
        mu=np.full(nc, mu),
        spacedim=3,
        info=fclib.ProblemInfo(title=title),
    )


def wall(contacts: int, push: float = 0.0, mu: float = 0.6, seed: int = 0) -> fclib.GlobalProblem:
    """A running-bond wall of 2 x 1 x 1 m blocks of 1000 kg, about twice as long as high."""
    rng = np.random.default_rng(seed)
    high = max(1, round(np.sqrt(contacts / 16)))
    long = max(1, round(contacts / (8 * high)))
    x, z = np.meshgrid(np.arange(long), np.arange(high))
    centres = np.stack([2.0 * x + (z % 2), np.zeros(x.shape), z + 0.5], axis=-1).reshape(-1, 3)
    ids = np.arange(centres.shape[0]).reshape(x.shape)
    first, second, points = [], [], []
    corners = [(sx, sy) for sx in (0, 1) for sy in (-0.5, 0.5)]
    for row in range(high):
        for column in range(long):
            upper = ids[row, column]
            left = 2.0 * column + (row % 2) - 1
            if row == 0:
                spans = [(-1, left, left + 2)]
            else:
                shift = -1 if row % 2 == 0 else 0
                halves = [(column + shift, left), (column + shift + 1, left + 1)]
                spans = [(ids[row - 1, c], a, a + 1) for c, a in halves if 0 <= c < long]
            for lower, a, b in spans:
                for sx, sy in corners:
                    first.append(lower)
                    second.append(upper)
                    points.append([a if sx == 0 else b, sy, float(row)])
    nc = len(first)
    normals = np.tile([0.0, 0.0, 1.0], (nc, 1))
    masses = np.full(len(centres), 1000.0) * rng.uniform(0.95, 1.05, len(centres))
    inertias = masses[:, None] / 12 * np.array([[2.0, 5.0, 5.0]])
    impulses = np.zeros((len(centres), 3))
    impulses[ids[-1, 0], 0] = push * masses.sum() * GRAVITY * STEP
    return problem_of(
        masses,
        inertias,
        centres,
        (np.array(first), np.array(second), normals, np.array(points)),
        impulses,
        mu,
        f"wall of {len(centres)} blocks, push {push:g}",
    )


def packing(
    contacts: int, push: float = 0.0, mu: float = 0.5, seed: int = 0
) -> fclib.GlobalProblem:
    """Spheres of about 1 cm on a shaken lattice, in a box without a lid."""
    rng = np.random.default_rng(seed)
    side = max(1, round((contacts / 3.3) ** (1 / 3)))
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    spacing = 0.02
    centres = spacing * (grid + 0.5 + 0.08 * rng.standard_normal(grid.shape))
    pairs = cKDTree(centres).query_pairs(1.12 * spacing, output_type="ndarray")
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))] if len(pairs) else np.zeros((0, 2), int)
    difference = centres[pairs[:, 1]] - centres[pairs[:, 0]]
    normals = [difference / np.linalg.norm(difference, axis=1, keepdims=True)]
    points = [0.5 * (centres[pairs[:, 1]] + centres[pairs[:, 0]])]
    first, second = [pairs[:, 0]], [pairs[:, 1]]
    sides = [(2, 0, 1.0)] + [
        (axis, end, 1.0 if end == 0 else -1.0) for axis in (0, 1) for end in (0, 1)
    ]
    for axis, end, sign in sides:
        touching = np.flatnonzero(grid[:, axis] == (0 if end == 0 else side - 1))
        normal = np.zeros(3)
        normal[axis] = sign
        normals.append(np.tile(normal, (len(touching), 1)))
        points.append(centres[touching] - 0.5 * spacing * normal)
        first.append(np.full(len(touching), -1))
        second.append(touching)
    radius = 0.5 * spacing * rng.uniform(0.8, 1.0, len(centres))
    masses = 2500 * 4 / 3 * np.pi * radius**3
    inertias = np.repeat((0.4 * masses * radius**2)[:, None], 3, axis=1)
    impulses = np.zeros((len(centres), 3))
    pushed = np.flatnonzero(grid[:, 0] == side - 1)
    impulses[pushed, 0] = -push * masses.sum() * GRAVITY * STEP / len(pushed)
    return problem_of(
        masses,
        inertias,
        centres,
        (
            np.concatenate(first),
            np.concatenate(second),
            np.concatenate(normals),
            np.concatenate(points),
        ),
        impulses,
        mu,
        f"packing of {len(centres)} spheres, push {push:g}",
    )


KINDS = {"wall": wall, "packing": packing}


def main() -> None:
    """Write the files OUT/KIND-push-contacts.hdf5."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--contacts", type=int, nargs="+", default=[10, 100, 1000, 10000])
    parser.add_argument("--kind", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--push", type=float, nargs="+", default=[0.0, 1.0])
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for kind in arguments.kind:
        for push in arguments.push:
            for contacts in arguments.contacts:
                problem = KINDS[kind](contacts, push, seed=arguments.seed)
                path = arguments.out / f"{kind}-push{push:g}-{contacts}.hdf5"
                fclib.write(path, problem)
                print(f"{path}: {problem.nc} contacts, {problem.n // 6} bodies")


if __name__ == "__main__":
    main()
