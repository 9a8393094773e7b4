"""Meshes of hexahedra by NumPy: masses, stiffness, and the point of a face below a node."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import scipy.optimize


def masses(scene: Any) -> Any:
    """An eighth of each element's mass to each of its nodes (n)."""
    found = []
    for mesh in scene.solids.meshes:
        x = np.array(mesh.nodes)
        own = np.zeros(len(x))
        for element in mesh.elements:
            edges = np.ptp(x[list(element)], axis=0)
            own[list(element)] += mesh.density * edges.prod() / 8
        found.append(np.repeat(own, 3))
    return np.concatenate(found)


def stiffness(scene: Any) -> Any:
    """K (n x n) of elements that are boxes: linear elasticity, two Gauss points a direction."""
    nodes = sum(len(mesh.nodes) for mesh in scene.solids.meshes)
    K = np.zeros((3 * nodes, 3 * nodes))
    first = 0
    for mesh in scene.solids.meshes:
        x = np.array(mesh.nodes)
        G = mesh.young / (2 * (1 + mesh.poisson))
        D = np.diag([2 * G] * 3 + [G] * 3)
        D[:3, :3] += 2 * G * mesh.poisson / (1 - 2 * mesh.poisson)
        for element in mesh.elements:
            corners = x[list(element)]
            edges = np.ptp(corners, axis=0)
            side = np.sign(corners - corners.mean(axis=0))
            own = np.zeros((24, 24))
            for point in itertools.product((-1 / np.sqrt(3), 1 / np.sqrt(3)), repeat=3):
                factor = 1 + side * np.array(point)
                B = np.zeros((6, 8, 3))
                for d in range(3):
                    others = [k for k in range(3) if k != d]
                    slope = side[:, d] * factor[:, others].prod(axis=1) / (4 * edges[d])
                    B[d, :, d] = slope
                    for k in others:  # of the strains xy, yz, zx
                        B[3 + (d if k == (d + 1) % 3 else k), :, k] += slope
                strain = B.reshape(6, 24)
                own += strain.T @ D @ strain * edges.prod() / 8
            where = (3 * (first + np.array(element))[:, None] + np.arange(3)).ravel()
            K[np.ix_(where, where)] += own
        first += len(x)
    return K


def foot(point: Any, corners: Any) -> tuple[Any, Any, float]:
    """The weights (4) of a bilinear face's corners below a point or at the edge, and the gap.

    Also the largest local coordinate below the point: more than 1 is beyond the edge.
    """

    def shape(a: float, b: float) -> Any:
        return (
            np.array([(1 - a) * (1 - b), (1 + a) * (1 - b), (1 + a) * (1 + b), (1 - a) * (1 + b)])
            / 4
        )

    def normal(a: float, b: float) -> Any:
        along = np.array([b - 1, 1 - b, 1 + b, -1 - b]) / 4 @ corners
        across = np.array([a - 1, -1 - a, 1 + a, 1 - a]) / 4 @ corners
        out = np.cross(along, across)
        return out / np.linalg.norm(out)

    def off(x: Any) -> Any:
        return shape(x[0], x[1]) @ corners + x[2] * normal(x[0], x[1]) - point

    found = scipy.optimize.root(off, np.zeros(3), tol=1e-13)
    outside = np.abs(found.x[:2]).max()
    a, b = found.x[:2].clip(-1, 1)
    gap = normal(a, b) @ (point - shape(a, b) @ corners)
    return shape(a, b), gap, outside


def directions_and_gaps(scene: Any, x: Any, contacts: Any, near: float) -> tuple[Any, Any]:
    """H (n x m) and the gaps (nc) of nodes at faces, from the places of all nodes.

    Args:
        scene: its meshes have the faces.
        x: (nodes x 3) the places.
        contacts: pair: the mesh of the face, counted from 1, and the node; frame.
        near: a face that is farther off is another one's [m].
    """
    meshes = scene.solids.meshes
    first = np.concatenate(([0], np.cumsum([len(mesh.nodes) for mesh in meshes])))
    H = np.zeros((x.size, 3 * len(contacts.pair)))
    gaps = []
    for c, (master, slave) in enumerate(contacts.pair.tolist()):
        best = None
        for surface in meshes[master - 1].surfaces:
            if surface.candidate:
                continue
            for quad in surface.quads:
                nodes = first[master - 1] + np.array(quad)
                corners = x[nodes]
                away = np.abs(x[slave] - corners.mean(axis=0)).max()
                if away > np.ptp(corners, axis=0).max() + near:
                    continue
                weights, gap, outside = foot(x[slave], corners)
                if abs(gap) < near and (best is None or outside < best[0] - 1e-9):
                    best = (outside, nodes, weights, gap)
        assert best is not None
        outside, nodes, weights, gap = best
        assert outside < 1 + 1e-3
        for node, share in ((slave, 1.0), *zip(nodes, -weights, strict=True)):
            H[3 * node : 3 * node + 3, 3 * c : 3 * c + 3] += share * contacts.frame[c].T
        gaps.append(gap)
    return H, np.array(gaps)
