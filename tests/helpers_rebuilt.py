"""Turns and directions of contacts by NumPy, from the tables of a file."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp


def rotations(turn: Any) -> Any:
    """The rotations of unit quaternions w, x, y, z: (k x 4) to (k x 3 x 3)."""
    w, x, y, z = turn.T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def directions(problem: Any, which: Any) -> Any:
    """H of some bodies: u is the velocity of the second body at the point, less the first's.

    Rolling has two more rows: the spins about both tangents, as a velocity is their product with
    the normal or not.
    """
    contacts, bodies = problem.contacts, problem.bodies
    d = problem.m // problem.nc
    place = np.full(len(bodies.moves), -1)
    place[which] = np.arange(len(which))
    frame = np.stack(
        (contacts.normal, contacts.tangent, np.cross(contacts.normal, contacts.tangent)), axis=1
    )
    rows, columns, values = [], [], []
    for side, sign in ((0, -1.0), (1, 1.0)):
        own = contacts.body[:, side]
        there = np.flatnonzero((own >= 0) & (place[own] >= 0))
        own = own[there]
        arm = contacts.point[there] - bodies.place[own]
        if bodies.period.size:
            arm[:, :2] -= bodies.period * np.rint(arm[:, :2] / bodies.period)
        turn = rotations(bodies.turn[own])
        blocks = np.zeros((len(there), 6, d))
        blocks[:, :3, :3] = frame[there].transpose(0, 2, 1)
        blocks[:, 3:, :3] = (np.cross(arm[:, None], frame[there]) @ turn).transpose(0, 2, 1)
        if d == 5:
            blocks[:, 3:, 3:] = (frame[there, 1:] @ turn).transpose(0, 2, 1)
        i = 6 * place[own][:, None, None] + np.arange(6)[:, None]
        j = d * there[:, None, None] + np.arange(d)
        rows.append(np.broadcast_to(i, blocks.shape).ravel())
        columns.append(np.broadcast_to(j, blocks.shape).ravel())
        values.append(sign * blocks.ravel())
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return sp.csc_array(entries, shape=(6 * len(which), problem.m))
