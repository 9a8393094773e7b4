"""Elements H8 of any shape: mass and stiffness of small strains, by 2 x 2 x 2 Gauss points.

The nodes of an element are the ring of its lower face, then that of its upper face.

O. C. Zienkiewicz, R. L. Taylor, J. Z. Zhu, The Finite Element Method: Its Basis and Fundamentals,
  Butterworth-Heinemann, 6th edition, 2005, chapters 5 and 6.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib.simulate.arrays import Sparse, Vector

Indices = npt.NDArray[np.int64]

CORNERS: Final = np.array(
    [
        *[(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1)],
        *[(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)],
    ]
)
# the faces of an element, in rings about their outward normals
FACES: Final = np.array(
    [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
)
GAUSS: Final = CORNERS / np.sqrt(3.0)


def matrices(
    nodes: Vector, elements: Indices, young: float, poisson: float, density: float, *, lumped: bool
) -> tuple[Sparse, Sparse]:
    """Mass and stiffness (3 k x 3 k) of a mesh of k nodes and of elements (e x 8).

    Args:
        nodes: (k x 3) [m].
        elements: (e x 8).
        young: [Pa].
        poisson: Poisson's ratio.
        density: [kg/m^3].
        lumped: whether the mass is diagonal, with the sums of its rows.

    Raises:
        ValueError: an element is turned inside out.
    """
    x = nodes[elements]
    count = len(elements)
    lame = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    shear = 0.5 * young / (1 + poisson)
    elasticity = np.zeros((6, 6))
    elasticity[:3, :3] = lame
    elasticity += np.diag([2 * shear] * 3 + [shear] * 3)
    mass = np.zeros((count, 8, 8))
    stiffness = np.zeros((count, 24, 24))
    for point in GAUSS:
        factor = 1 + point * CORNERS
        shape = factor.prod(axis=1) / 8
        along = np.stack(
            [CORNERS[:, i] * factor[:, (i + 1) % 3] * factor[:, (i + 2) % 3] / 8 for i in range(3)]
        )
        jacobian = np.einsum("ia,eaj->eij", along, x)
        size = np.linalg.det(jacobian)
        if not (size > 0).all():
            raise ValueError(f"element {int(np.argmin(size)) + 1} is turned inside out, or flat")
        slope = np.linalg.solve(jacobian, np.broadcast_to(along, (count, 3, 8)))
        strain = np.zeros((count, 6, 8, 3))
        for i in range(3):
            strain[:, i, :, i] = slope[:, i]
        for row, (i, j) in enumerate(((1, 2), (2, 0), (0, 1)), 3):
            strain[:, row, :, i], strain[:, row, :, j] = slope[:, j], slope[:, i]
        rows = strain.reshape(count, 6, 24)
        stiffness += size[:, None, None] * (rows.transpose(0, 2, 1) @ elasticity @ rows)
        mass += density * size[:, None, None] * np.outer(shape, shape)
    if lumped:
        mass = mass.sum(axis=2)[:, :, None] * np.eye(8)
    return (
        assembled(nodes, elements, np.einsum("eab,ij->eaibj", mass, np.eye(3))),
        assembled(nodes, elements, stiffness),
    )


def assembled(nodes: Vector, elements: Indices, own: Vector) -> Sparse:
    """The matrix of a mesh from those of its elements (e x 24 x 24); symmetric to the last bit."""
    dofs = (3 * elements[:, :, None] + np.arange(3)).reshape(-1, 24)
    rows, columns = np.repeat(dofs, 24, axis=1).ravel(), np.tile(dofs, (1, 24)).ravel()
    size = 3 * len(nodes)
    matrix = sp.csc_array((own.reshape(-1), (rows, columns)), shape=(size, size))
    matrix = sp.csc_array(0.5 * (matrix + matrix.T))
    matrix.eliminate_zeros()
    return matrix


def surface(elements: Indices) -> Indices:
    """The quads (q x 4) of one element only, in rings about their outward normals."""
    quads = elements[:, FACES].reshape(-1, 4)
    _, first, counts = np.unique(
        np.sort(quads, axis=1), axis=0, return_index=True, return_counts=True
    )
    found: Indices = quads[np.sort(first[counts == 1])]
    return found
