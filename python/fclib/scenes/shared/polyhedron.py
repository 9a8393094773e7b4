"""Volume, centre of mass and inertia of polyhedra given by triangles."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

FLAT = 1e-12  # products of inertia this small, relative to the largest moment, are rounding


@dataclass(frozen=True)
class Moments:
    """What a body of density 1 is."""

    volume: float  # [m^3]
    centre: Vector  # (3) [m]
    inertia: Vector  # (3 x 3) about the centre [m^5]

    def principal(self) -> tuple[Vector, Vector]:
        """Moments (3) and axes (3 x 3, as columns, right-handed) of the inertia."""
        size = float(np.abs(self.inertia).max())
        if np.abs(self.inertia - np.diag(np.diag(self.inertia))).max() <= FLAT * size:
            return np.diag(self.inertia).copy(), np.eye(3)
        moments, axes = np.linalg.eigh(self.inertia)
        if np.linalg.det(axes) < 0:
            axes[:, 2] *= -1
        return moments, axes


def ball(radius: float) -> Moments:
    """A ball about the origin."""
    volume = 4 / 3 * math.pi * float(radius) ** 3
    return Moments(volume, np.zeros(3), 0.4 * volume * radius**2 * np.eye(3))


def box(half: Vector) -> Moments:
    """A box about the origin, with these half edges (3)."""
    half = np.asarray(half, dtype=float)
    volume = float(8 * half.prod())
    squares = half**2
    return Moments(volume, np.zeros(3), np.diag(volume / 3 * (squares.sum() - squares)))


def box_surface(half: Vector) -> tuple[Vector, Integers]:
    """The vertices (8 x 3) and triangles (12 x 3) of a box."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
    faces += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    return corners, np.array(faces, np.int64)


def oriented(vertices: Vector, faces: Integers) -> Integers:
    """The triangles of a closed surface, all outwards. ValueError if it is not closed."""
    # vertices in one place are one
    _, same = np.unique(vertices, axis=0, return_inverse=True)
    merged = same.reshape(-1)[faces]
    own = [face for face in merged.tolist() if len(set(face)) == 3]
    edges: dict[tuple[int, int], list[int]] = {}
    for i, face in enumerate(own):
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            edges.setdefault((min(a, b), max(a, b)), []).append(i)
    if not own or any(len(found) != 2 for found in edges.values()):
        raise ValueError("its triangles do not close a surface")
    turned: dict[int, bool] = {}
    for seed in range(len(own)):
        stack = [] if seed in turned else [seed]
        turned.setdefault(seed, False)
        while stack:
            i = stack.pop()
            face = own[i][::-1] if turned[i] else own[i]
            for a, b in zip(face, face[1:] + face[:1], strict=True):
                first, second = edges[min(a, b), max(a, b)]
                j = second if first == i else first
                other = own[j]
                along = (a, b) in zip(other, other[1:] + other[:1], strict=True)
                if j not in turned:
                    turned[j] = along
                    stack.append(j)
                elif turned[j] != along:
                    raise ValueError("its triangles have no inside and outside")
    # back to one vertex of each place
    representative = np.zeros(int(same.max()) + 1, np.int64)
    representative[same.reshape(-1)] = np.arange(len(vertices))
    found = [face[::-1] if turned[i] else face for i, face in enumerate(own)]
    array = representative[np.array(found, np.int64)]
    if signed_volume(vertices, array) < 0:
        array = array[:, ::-1]
    return array


def signed_volume(vertices: Vector, faces: Integers) -> float:
    """The volume inside of triangles (f x 3) that look outwards."""
    a, b, c = (vertices[faces[:, k]] - vertices.mean(axis=0) for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def moments(vertices: Vector, faces: Integers) -> Moments:
    """The moments of a solid whose triangles (f x 3) look outwards: a sum over tetrahedra."""
    origin = vertices.mean(axis=0)
    corners = vertices[faces] - origin  # (f x 3 x 3)
    volumes = (corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])).sum(axis=1) / 6
    volume = float(volumes.sum())
    # the fourth corner of each tetrahedron is the origin
    sums = corners.sum(axis=1)
    centre = (volumes[:, None] * sums).sum(axis=0) / (4 * volume)
    products = np.einsum("fki,fkj->fij", corners, corners) + np.einsum("fi,fj->fij", sums, sums)
    second = (volumes[:, None, None] * products).sum(axis=0) / 20
    second -= volume * np.outer(centre, centre)
    return Moments(volume, origin + centre, np.trace(second) * np.eye(3) - second)


def hull(vertices: Vector) -> tuple[Vector, Integers]:
    """The convex hull: its vertices (k x 3), and triangles outwards. ValueError if it is flat."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        found = ConvexHull(vertices)
    except QhullError:
        raise ValueError("its vertices lie in a plane") from None
    own, local = np.unique(found.simplices, return_inverse=True)
    corners = vertices[own]
    return corners, oriented(corners, local.reshape(-1, 3).astype(np.int64))
