"""Meshes of hexahedra by NumPy: masses, stiffness, and the point of a face below a node."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.optimize
import scipy.sparse as sp

from fclib.scenes.shared.solids import Block, HexMesh


@dataclass(frozen=True)
class Body:
    """A mesh of boxes."""

    of: Block | HexMesh  # has Young's modulus, Poisson's ratio and the density
    nodes: Any  # (k x 3) [m]
    elements: Any  # (elements x 8) nodes
    faces: Any  # (faces x 4) nodes, that others touch
    turn: Any  # (3 x 3) from the axes of the elements to those of the world
    lumped: bool = False


def bodies_of(model: Any) -> list[Body]:
    """The bodies of a model; of a block, the upper face is touched."""
    found, first = [], 0
    for block, own in zip(model.solids.blocks, model.meshes, strict=False):
        c, s = np.cos(block.yaw), np.sin(block.yaw)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        quads = own.quads["z+"] - first
        found.append(Body(block, np.array(own.x), own.elements.T - first, quads, turn))
        first += len(own.x)
    for mesh in model.solids.meshes:
        touched = [surface.quads for surface in mesh.surfaces if not surface.candidate]
        faces = np.array([quad for quads in touched for quad in quads]).reshape(-1, 4)
        elements = np.array(mesh.elements)
        found.append(Body(mesh, np.array(mesh.nodes), elements, faces, np.eye(3), mesh.lumped))
    return found


def corners_of(body: Body) -> Iterator[tuple[Any, Any, Any]]:
    """The nodes of each element, its edges (3), and on which side each node is (8 x 3)."""
    for element in body.elements:
        corners = body.nodes[element] @ body.turn
        yield element, np.ptp(corners, axis=0), np.sign(corners - corners.mean(axis=0))


def gathered(bodies: Sequence[Body], own: Callable[[Body, Any, Any], Any]) -> Any:
    """The sum of the elements' matrices (n x n), which are in their own axes."""
    rows, columns, values, first = [], [], [], 0
    for body in bodies:
        turn = np.kron(np.eye(8), body.turn)
        for element, edges, side in corners_of(body):
            where = (3 * (first + element)[:, None] + np.arange(3)).ravel()
            rows.append(np.repeat(where, 24))
            columns.append(np.tile(where, 24))
            values.append((turn @ own(body, edges, side) @ turn.T).ravel())
        first += len(body.nodes)
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return sp.csr_array(sp.coo_array(entries, shape=(3 * first, 3 * first)))


def masses(bodies: Sequence[Body]) -> Any:
    """M (n x n). If it is lumped, an eighth of each element's mass is at each of its nodes."""

    def own(body: Body, edges: Any, side: Any) -> Any:
        weight = body.of.density * edges.prod()
        if body.lumped:
            return weight / 8 * np.eye(24)
        # the integral of a product of two shape functions of a box, direction by direction
        return np.kron(weight * ((1 + side[:, None] * side / 3) / 4).prod(axis=2), np.eye(3))

    return gathered(bodies, own)


def stiffness(bodies: Sequence[Body]) -> Any:
    """K (n x n): linear elasticity, two Gauss points a direction."""

    def own(body: Body, edges: Any, side: Any) -> Any:
        G = body.of.young / (2 * (1 + body.of.poisson))
        D = np.diag([2 * G] * 3 + [G] * 3)
        D[:3, :3] += 2 * G * body.of.poisson / (1 - 2 * body.of.poisson)
        total = np.zeros((24, 24))
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
            total += strain.T @ D @ strain * edges.prod() / 8
        return total

    return gathered(bodies, own)


def face_masses(body: Body, axis: int, upper: bool) -> Any:
    """The integrals (k x k) of products of shape functions over a side of a block."""
    x = body.nodes @ body.turn
    end = x[:, axis].max() if upper else x[:, axis].min()
    found = np.zeros((len(x), len(x)))
    for element, edges, side in corners_of(body):
        there = np.abs(x[element, axis] - end) < 1e-6 * edges[axis]
        if there.any():
            others = [k for k in range(3) if k != axis]
            own = side[there][:, others]
            products = ((1 + own[:, None] * own / 3) / 4).prod(axis=2)
            found[np.ix_(element[there], element[there])] += edges[others].prod() * products
    return found


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


def directions_and_gaps(
    bodies: Sequence[Body], x: Any, contacts: Any, near: float
) -> tuple[Any, Any]:
    """H (n x m) and the gaps (nc) of nodes at faces, from the places of all nodes.

    Args:
        bodies: they have the faces.
        x: (nodes x 3) the places.
        contacts: pair: the mesh of the face, counted from 1, and the node; frame.
        near: a face that is farther off is another one's [m].
    """
    first = np.concatenate(([0], np.cumsum([len(body.nodes) for body in bodies])))
    H = sp.lil_array((x.size, 3 * len(contacts.pair)))
    gaps = []
    for c, (master, slave) in enumerate(contacts.pair.tolist()):
        best = None
        faces = first[master - 1] + bodies[master - 1].faces
        away = np.abs(x[slave] - x[faces].mean(axis=1)).max(axis=1)
        for nodes in faces[away <= np.ptp(x[faces], axis=1).max(axis=1) + near]:
            weights, gap, outside = foot(x[slave], x[nodes])
            # a node may be below two faces: either is right, and the gap says which was taken
            order = max(outside, 1.0), abs(gap - contacts.gap[c])
            if abs(gap) < near and (best is None or order < best[0]):
                best = (order, nodes, weights, gap)
        assert best is not None
        (outside, _), nodes, weights, gap = best
        assert outside < 1 + 1e-3
        for node, share in ((slave, 1.0), *zip(nodes, -weights, strict=True)):
            H[3 * node : 3 * node + 3, 3 * c : 3 * c + 3] += share * contacts.frame[c].T
        gaps.append(gap)
    return sp.csr_array(H), np.array(gaps)
