"""Contacts of bodies that move in a plane: components in the plane, and each point once.

The plane is x, z. A contact in space whose normal lies in it, with the frame N, T1, T2, becomes one
with the frame N, T, y: T = y x N. Of rolling friction only R, about y, remains. The columns of T
and R are those of T1, T2 and R1, R2, turned.

Bodies have a thickness to collide with, so that an edge in the plane touches along a line, and
gives two points of equal x and z: they are one contact.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib.simulate.moreau_jean import Contacts, Sparse, Vector, block_columns

NORMAL: Final = np.array([0.0, 1.0, 0.0])  # of the plane
SLANT: Final = 1e-6  # sine of the angle of a contact's normal to the plane: largest value
SAME: Final = 1e-6  # largest distance of two points that count as one, in sizes of a body


def in_plane(H: Sparse, contacts: Contacts, sizes: Vector) -> tuple[Sparse, Contacts]:
    """The contacts and their columns in the plane.

    Args:
        H: (n x 3 nc), with rolling friction (n x 5 nc); nothing spins in the plane.
        contacts: nc, in space.
        sizes: (nc) of the larger body of each contact [m].

    Raises:
        ValueError: a normal leaves the plane.
    """
    normal = contacts.frame[:, 0]
    slanted = np.flatnonzero(np.abs(normal @ NORMAL) > SLANT)
    if slanted.size:
        pair = contacts.pair[slanted[0]].tolist()
        raise ValueError(
            f"the contact of the geometries {pair[0]} and {pair[1]} has the normal"
            f" {normal[slanted[0]]}, out of the plane x, z of a planar scene"
        )
    kept = once(contacts, sizes)
    H, contacts = H[:, block_columns(kept, contacts.dimension)], contacts[kept]

    tangent = np.cross(NORMAL, contacts.frame[:, 0])
    # components of T along T1 and T2; y is a quarter of a turn further
    along = np.einsum("cij,cj->ci", contacts.frame[:, 1:], tangent)
    nc, full = len(contacts), contacts.dimension
    d = 2 if contacts.mu_r is None else 3
    blocks = np.zeros((nc, full, d))
    blocks[:, 0, 0] = 1.0
    blocks[:, 1:3, 1] = along
    if contacts.mu_r is not None:
        blocks[:, 3, 2], blocks[:, 4, 2] = -along[:, 1], along[:, 0]
    turned = sp.bsr_array(
        (blocks, np.arange(nc), np.arange(nc + 1)), shape=(full * nc, d * nc)
    ).tocsc()
    H = sp.csc_array(H @ turned)
    H.eliminate_zeros()

    frame = np.stack((contacts.frame[:, 0], tangent, np.zeros_like(tangent)), axis=1)
    # a limit has no frame
    frame[np.any(tangent != 0, axis=1), 2] = NORMAL
    return H, Contacts(
        contacts.pair, contacts.point, frame, contacts.gap, contacts.mu, contacts.mu_r, planar=True
    )


def once(contacts: Contacts, sizes: Vector) -> npt.NDArray[np.int64]:
    """Which contacts remain if a pair keeps only the first contact of each place in the plane."""
    kept: list[int] = []
    of_pair: dict[tuple[int, int], list[int]] = {}
    places = contacts.point[:, [0, 2]]
    for i, (first, second) in enumerate(contacts.pair.tolist()):
        known = of_pair.setdefault((first, second), [])
        apart = np.linalg.norm(places[known] - places[i], axis=1)
        if first < 0 or not known or apart.min() > SAME * sizes[i]:
            known.append(i)
            kept.append(i)
    return np.array(kept, dtype=np.int64)
