"""Small worlds of boxes for the tables of batches: their masses, and where their contacts are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
STEP = 1e-3  # [s]
GRAVITY = 9.81  # [m/s^2]
CORNERS = [(x, y) for x in (0, 1) for y in (0, 1)]


@dataclass(frozen=True)
class World:
    """Bodies and contacts. `H` (6 bodies, 3 contacts) and the diagonal of M^-1 (6 bodies)."""

    H: Floats
    inverse_mass: Floats


def sphere(rng: np.random.Generator) -> World:
    """A sphere on the ground: one contact."""
    radius, mass = 0.1, np.exp(rng.uniform(-1, 1))
    inverse = np.concatenate([np.full(3, 1 / mass), np.full(3, 1 / (0.4 * mass * radius**2))])
    return World(_arm(np.array([0, 0, -radius])).T, inverse)


def corner(rng: np.random.Generator) -> World:
    """A box that stands on a corner: one contact, and each component of u depends on all of r."""
    half = np.array([0.1, 0.12, 0.08]) * np.exp(0.4 * rng.normal(size=3))
    center = np.zeros(3)
    sides = rng.choice([-1.0, 1.0], size=2)
    point = np.array([*(sides * half[:2]), -half[2]])
    return _world([(center, half, np.exp(rng.uniform(-1, 1)))], [(-1, 0, point)])


def linked(rng: np.random.Generator) -> World:
    """A contact of a mechanism: light in some directions, heavy in others, and all are coupled."""
    return World(rng.normal(size=(6, 3)), np.exp(3 * rng.normal(size=6)))


def tower(rng: np.random.Generator, boxes: int) -> World:
    """Boxes on each other, four contacts under each."""
    places, contacts = [], []
    height, below = 0.0, None
    for k in range(boxes):
        half = np.array([0.1, 0.12, 0.08]) * np.exp(0.2 * rng.normal(size=3))
        center = np.append(0.02 * rng.normal(size=2), height + half[2])
        low, high = center[:2] - half[:2], center[:2] + half[:2]
        sides = (low, high)
        if below is not None:
            sides = (np.maximum(low, below[0]), np.minimum(high, below[1]))
        contacts += [(k - 1, k, np.array([sides[x][0], sides[y][1], height])) for x, y in CORNERS]
        places.append((center, half, np.exp(rng.uniform(np.log(0.3), np.log(3)))))
        below, height = (low, high), height + 2 * half[2]
    return _world(places, contacts)


def wall(rng: np.random.Generator, rows: Sequence[int]) -> World:
    """Bricks in rows, each shifted by half a brick, four contacts between two bricks."""
    length, depth, half_height = np.array([0.2, 0.1, 0.06]) * np.exp(0.1 * rng.normal(size=3))
    half = np.array([0.49 * length, depth, half_height])
    places, contacts = [], []
    starts = np.concatenate([[0], np.cumsum(rows)])
    for j, bricks in enumerate(rows):
        for i in range(bricks):
            x = (i + 0.5 * j) * length
            places.append(
                (
                    np.array([x, 0, (2 * j + 1) * half_height]),
                    half,
                    np.exp(rng.uniform(np.log(0.5), np.log(2))),
                )
            )
            me = int(starts[j] + i)
            under = [(-1, x)]
            if j > 0:
                under = [(int(starts[j - 1] + k), (k + 0.5 * (j - 1)) * length) for k in (i, i + 1)]
            for other, at in under:
                sides = (max(x, at) - half[0], min(x, at) + half[0])
                contacts += [
                    (other, me, np.array([sides[a], (2 * b - 1) * depth, 2 * j * half_height]))
                    for a, b in CORNERS
                ]
    return _world(places, contacts)


def apart(worlds: Sequence[World]) -> World:
    """Worlds that do not touch each other, as one."""
    rows = sum(len(world.inverse_mass) for world in worlds)
    columns = sum(world.H.shape[1] for world in worlds)
    H = np.zeros((rows, columns))
    row = column = 0
    for world in worlds:
        n, m = world.H.shape
        H[row : row + n, column : column + m] = world.H
        row, column = row + n, column + m
    return World(H, np.concatenate([world.inverse_mass for world in worlds]))


# contacts, how they hang together, how a world is made
SCENES = {
    "1": sphere,
    "1 at a corner": corner,
    "1 of a mechanism": linked,
    "4": lambda rng: tower(rng, 1),
    "8": lambda rng: tower(rng, 2),
    "16": lambda rng: tower(rng, 4),
    "32": lambda rng: wall(rng, (4, 2)),
    "64": lambda rng: wall(rng, (4, 3, 2, 1)),
    "64 in 8 islands": lambda rng: apart([tower(rng, 2) for _ in range(8)]),
}


def problems(
    name: str, count: int, seed: int, at_rest: bool
) -> tuple[Floats, Floats, Floats, list[World]]:
    """W, q, mu of such worlds at random velocities or at rest under gravity, and the worlds."""
    rng = np.random.default_rng(seed)
    worlds, W, q = [], [], []
    for _ in range(count):
        world: World = SCENES[name](rng)  # type: ignore[no-untyped-call]
        scaled = world.inverse_mass[:, None] * world.H
        product = world.H.T @ scaled
        W.append((product + product.T) / 2)
        fall = np.zeros(len(world.inverse_mass))
        fall[2::6] = -GRAVITY * STEP
        if not at_rest:
            fall += 0.3 * rng.normal(size=len(fall))
            fall[2::6] -= 0.2
        q.append(world.H.T @ fall)
        worlds.append(world)
    mu = rng.uniform(0.2, 0.8, size=(count, W[0].shape[0] // 3))
    return np.array(W), np.array(q), mu, worlds


def _arm(arm: Floats) -> Floats:
    """Velocity of a point at `arm` from the body's centre: normal z, tangents x, y."""
    rows = np.zeros((3, 6))
    for k, axis in enumerate(np.eye(3)[[2, 0, 1]]):
        rows[k, :3], rows[k, 3:] = axis, np.cross(arm, axis)
    return rows


def _world(
    places: Sequence[tuple[Floats, Floats, float]], contacts: Sequence[tuple[int, int, Floats]]
) -> World:
    H = np.zeros((6 * len(places), 3 * len(contacts)))
    inverse = np.empty(6 * len(places))
    for k, (_, half, mass) in enumerate(places):
        inverse[6 * k : 6 * k + 3] = 1 / mass
        squares = half**2
        inverse[6 * k + 3 : 6 * k + 6] = 3 / (mass * (squares.sum() - squares))
    for c, (below, above, point) in enumerate(contacts):
        for body, sign in ((above, 1), (below, -1)):
            if body >= 0:
                H[6 * body : 6 * body + 6, 3 * c : 3 * c + 3] += (
                    sign * _arm(point - places[body][0]).T
                )
    return World(H, inverse)
