"""The bodies of a file: shapes and poses from its groups /bodies and /contacts.

Each kind of shape is a mesh of size one. A shape scales it, and a capsule pulls its halves apart:

    vertex in the shape = (x sx, y sy, z sz + t s)      of the kind's vertex (x, y, z, t)
    vertex in the world = place + R(turn) vertex

so that a page draws a thousand grains by a thousand poses. A mesh of a file is a kind of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fclib._geometry import KINDS, Bodies, Contacts, rotations

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = range(len(KINDS))
ACCURACY = 1e-7  # precision of places, relative to the smallest body
# least number of round shapes: latitudes and longitudes of each
DETAIL = ((0, 10, 20), (100, 7, 12), (600, 5, 8), (3000, 3, 6))


@dataclass(frozen=True)
class Solids:
    """Shapes of bodies, and their places."""

    names: list[str]  # of the bodies
    moves: Indices  # (bodies)
    body: Indices  # (shapes)
    kind: Indices  # (shapes) a number of `meshes`
    scale: Array  # (shapes, 4) sx, sy, sz, t
    place: Array  # (shapes, 3) in the world
    turn: Array  # (shapes, 4) quaternions w, x, y, z
    meshes: list[tuple[Array, Indices]]  # vertices (k, 4), triangles (f, 3)
    strain: dict[int, Array]  # mesh -> distance (k) of each vertex from its place without stress
    centre: Array  # (bodies, 3) of their frames
    period: Array  # (2), or none
    planar: bool
    unit: str

    @property
    def size(self) -> float:
        """Half the extent of the smallest moving body."""
        reach = [self.reach(k) for k in np.flatnonzero(self.moves[self.body] == 1).tolist()]
        return min((x for x in reach if x > 0), default=1.0)

    def reach(self, shape: int) -> float:
        """Half the largest extent of a shape."""
        return float(0.5 * np.ptp(self.own(shape), axis=0).max(initial=0.0))

    def own(self, shape: int) -> Array:
        """Vertices (k, 3) in the shape."""
        vertices, _ = self.meshes[self.kind[shape]]
        sx, sy, sz, t = self.scale[shape]
        found = vertices[:, :3] * (sx, sy, sz)
        found[:, 2] += t * vertices[:, 3]
        return np.asarray(found)

    def world(self, shape: int) -> Array:
        """Vertices (k, 3) in the world."""
        turned = self.own(shape) @ rotations(self.turn[[shape]])[0].T
        return np.asarray(self.place[shape] + turned)


def solids_of(bodies: Bodies, contacts: Contacts | None) -> Solids:
    """Make them from the tables of a file; contacts decide the drawn size of an infinite plane."""
    place, _ = bodies.poses()
    turn = multiplied(bodies.turn[bodies.shape_body], bodies.shape_turn)
    kinds = np.asarray(bodies.shape_kind, dtype=np.int64)
    round_ones = int(np.isin(kinds, (SPHERE, CAPSULE, ELLIPSOID, CYLINDER)).sum())
    latitudes, longitudes = next(d[1:] for d in reversed(DETAIL) if round_ones >= d[0])
    meshes: list[tuple[Array, Indices]] = []
    strain: dict[int, Array] = {}
    known: dict[tuple[str, int], int] = {}
    kind = np.zeros(len(kinds), np.int64)
    scale = np.zeros((len(kinds), 4))
    span = extent(bodies, place, contacts)
    for k, own in enumerate(kinds.tolist()):
        key = ("mesh", int(bodies.shape_mesh[k])) if own == MESH else ("kind", own)
        if key not in known:
            known[key] = len(meshes)
            if own == MESH:
                found = bodies.mesh(k)
                assert found is not None
                vertices = np.column_stack([found[0], np.zeros(len(found[0]))])
                meshes.append((vertices, triangles_of(found[1])))
                if len(bodies.displacement):
                    first = int(bodies.mesh_first[key[1]][0])
                    moved = bodies.displacement[first : first + len(vertices)]
                    strain[known[key]] = np.linalg.norm(moved, axis=1)
            else:
                meshes.append(unit(own, latitudes, longitudes))
        kind[k] = known[key]
        a, b, c = bodies.shape_size[k].tolist()
        if own == PLANE:
            scale[k] = (a or span, b or span, 0.0, 0.0)
        elif own == SPHERE:
            scale[k] = (a, a, a, 0.0)
        elif own == CAPSULE:
            scale[k] = (a, a, a, b)
        elif own == CYLINDER:
            scale[k] = (a, a, b, 0.0)
        else:
            scale[k] = (a, b, c, 0.0) if own != MESH else (1.0, 1.0, 1.0, 0.0)
    return Solids(
        names=bodies.names,
        moves=np.asarray(bodies.moves, dtype=np.int64),
        body=np.asarray(bodies.shape_body, dtype=np.int64),
        kind=kind,
        scale=scale,
        place=place,
        turn=turn,
        meshes=meshes,
        strain={k: v for k, v in strain.items() if v.any()},
        centre=np.asarray(bodies.place),
        period=np.asarray(bodies.period),
        planar=bodies.is_planar,
        unit=bodies.unit or "m",
    )


def record_of(solids: Solids) -> dict[str, Any]:
    """The solids in JSON's types; places have a precision of 1e-7 of the smallest body."""
    decimals = math.ceil(-math.log10(ACCURACY * solids.size))

    def fixed(values: Array, digits: int = decimals) -> Any:
        # no -0, which is longer
        return (np.round(values, digits) + 0.0).tolist()

    found: dict[str, Any] = {
        "names": solids.names,
        "moves": solids.moves.tolist(),
        "body": solids.body.tolist(),
        "kind": solids.kind.tolist(),
        "scale": fixed(solids.scale),
        "place": fixed(solids.place),
        "turn": fixed(solids.turn, 9),
        "meshes": [[fixed(v, max(decimals, 6)), f.tolist()] for v, f in solids.meshes],
        "planar": solids.planar,
        "unit": solids.unit,
    }
    if solids.strain:
        own = max(float(v.max()) for v in solids.strain.values())
        digits = max(0, 3 - math.floor(math.log10(own)))
        found["strain"] = {str(k): fixed(v, digits) for k, v in solids.strain.items()}
    if len(solids.period):
        found["period"] = solids.period.tolist()
    return found


def extent(bodies: Bodies, place: Array, contacts: Contacts | None) -> float:
    """The drawn size of an infinite plane: beyond all moving bodies."""
    points = [place[np.isin(bodies.shape_body, np.flatnonzero(bodies.moves))]]
    if contacts is not None:
        points.append(contacts.point[(contacts.shape >= 0).all(axis=1)])
    every = np.concatenate(points)
    most = float(bodies.shape_size.max(initial=0.0)) if len(bodies.shape_size) else 0.0
    return 1.3 * (float(np.abs(every).max(initial=0.0)) + min(most, 1.0)) or 1.0


def multiplied(a: Array, b: Array) -> Array:
    """Products (k, 4) of quaternions w, x, y, z."""
    w, x, y, z = a.T
    p, q, r, s = b.T
    return np.column_stack(
        [
            w * p - x * q - y * r - z * s,
            w * q + x * p + y * s - z * r,
            w * r - x * s + y * p + z * q,
            w * s + x * r - y * q + z * p,
        ]
    )


def triangles_of(faces: Any) -> Indices:
    """Triangles (f, 3) of faces of three or four vertices, -1 last for three."""
    faces = np.asarray(faces, dtype=np.int64)
    four = faces[faces[:, 3] >= 0]
    return np.concatenate([faces[:, :3], four[:, [0, 2, 3]]])


def unit(kind: int, latitudes: int, longitudes: int) -> tuple[Array, Indices]:
    """The mesh of a kind, of size one; triangles about the outward normal."""
    if kind == PLANE:
        square = np.array([[-1.0, -1, 0, 0], [1, -1, 0, 0], [1, 1, 0, 0], [-1, 1, 0, 0]])
        return square, np.array([[0, 1, 2], [0, 2, 3]])
    if kind == BOX:
        corners = np.array([[x, y, z, 0.0] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        return corners, triangles_of(sides)
    if kind == CYLINDER:
        # rings: the bottom's middle, the edges, the top's middle
        rings = [(0.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
    else:
        half = latitudes // 2 + 1
        angles = np.linspace(0.0, np.pi / 2, half + 1)
        lower = [(math.sin(a), -math.cos(a), -1.0) for a in angles]
        upper = [(math.sin(a), math.cos(a), 1.0) for a in angles[::-1]]
        rings = lower + (upper if kind == CAPSULE else upper[1:])
    turns = 2 * np.pi * np.arange(longitudes) / longitudes
    vertices = [[r * math.cos(a), r * math.sin(a), z, t] for r, z, t in rings for a in turns]
    faces = []
    for i in range(len(rings) - 1):
        for j in range(longitudes):
            a, b = i * longitudes + j, i * longitudes + (j + 1) % longitudes
            faces.append((a, b, b + longitudes, a + longitudes))
    triangles = triangles_of(faces)
    return np.array(vertices), triangles
