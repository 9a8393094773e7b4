"""The corners where two flat faces meet; MuJoCo keeps at most four.

If edges lie on each other, as with equal stones, rounding makes points on the edges. MuJoCo may
then keep these instead of corners, and the stones lose their hold. So pairs with four points are
treated again: one face is cut by the other in the plane between them. Of the corners the scheme
takes those that are not between others.
"""

from __future__ import annotations

import copy
from typing import Any, Final

import numpy as np

from fclib.simulate._mujoco import mujoco
from fclib.simulate.arrays import Vector
from fclib.simulate.terrain import replace_contacts

KEPT: Final = 4  # points of two faces that MuJoCo keeps
SAME: Final = 1e-9  # largest difference of normals of one face
PARALLEL: Final = 1e-6  # 1 - cos of the angle between two faces that touch as a whole
MESH, BOX = (int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}")) for name in ("MESH", "BOX"))


def complete_faces(m: Any, d: Any) -> None:
    """To be called after `mj_collision`: add all corners of two faces if one is a mesh's."""
    contact = d.contact
    if len(contact.dist) < KEPT:
        return
    geom = contact.geom
    kinds = m.geom_type[geom]
    flat = np.flatnonzero(((kinds == MESH) | (kinds == BOX)).all(axis=1) & (geom >= 0).all(axis=1))
    if not flat.size:
        return
    pairs, start, counts = np.unique(geom[flat], axis=0, return_index=True, return_counts=True)
    full = counts == KEPT
    if not full.any():
        return
    pairs, own = pairs[full], flat[start[full][:, None] + np.arange(KEPT)]
    same = (geom[own] == pairs[:, None]).all(axis=(1, 2))
    same &= np.ptp(contact.frame[own][:, :, :3], axis=1).max(axis=1) <= SAME
    same &= (m.geom_type[pairs] == MESH).any(axis=1)
    found = {}
    for k in np.flatnonzero(same):
        one, other = (int(g) for g in pairs[k])
        made = corners_of(m, d, one, other, contact[int(own[k, 0])])
        if made:
            found[one, other] = made
    if found:
        replace_contacts(m, d, found)


def corners_of(m: Any, d: Any, one: int, other: int, contact: Any) -> list[Any]:
    """Contacts like a given one in the common corners of two faces; empty: there are no faces."""
    frame = contact.frame.reshape(3, 3)
    faces = [face_of(m, d, one, frame[0]), face_of(m, d, other, -frame[0])]
    if any(face is None for face in faces):
        return []
    # N, T1, T2 of the vertices
    first, second = (face @ frame.T for face in faces)
    found = []
    for corner in cut(first[:, 1:], second[:, 1:]):
        heights = [height(face, corner) for face in (first, second)]
        made = copy.copy(contact)
        made.dist = heights[1] - heights[0]
        made.pos[:] = frame.T @ np.append(0.5 * sum(heights), corner)
        if made.dist <= contact.includemargin:
            found.append(made)
    return found


def face_of(m: Any, d: Any, geom: int, normal: Vector) -> Vector | None:
    """The vertices (k x 3) of the face of a geometry along a normal, in a ring, in the world."""
    turn, place = d.geom_xmat[geom].reshape(3, 3), d.geom_xpos[geom]
    along = turn.T @ normal
    if m.geom_type[geom] == BOX:
        axis = int(np.abs(along).argmax())
        others = np.array([(axis + 1) % 3, (axis + 2) % 3])
        signs = np.zeros((4, 3))
        signs[:, axis] = np.sign(along[axis])
        signs[:, others] = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        local, best = signs * m.geom_size[geom], float(np.abs(along[axis]))
    else:
        mesh = int(m.geom_dataid[geom])
        faces = slice(m.mesh_polyadr[mesh], m.mesh_polyadr[mesh] + m.mesh_polynum[mesh])
        if faces.start < 0 or faces.start == faces.stop:
            return None
        dots = m.mesh_polynormal[faces] @ along
        which = faces.start + int(dots.argmax())
        vertices = m.mesh_polyvert[m.mesh_polyvertadr[which] :][: m.mesh_polyvertnum[which]]
        local = m.mesh_vert[m.mesh_vertadr[mesh] + vertices].astype(float)
        best = float(dots.max())
    if best < 1 - PARALLEL:
        return None
    ring: Vector = np.asarray(local @ turn.T + place)
    return ring


def height(face: Vector, corner: Vector) -> float:
    """N of the plane of a face (k x 3, in N, T1, T2) at a point in T1, T2."""
    middle = face.mean(axis=0)
    slope, *_ = np.linalg.lstsq(face[:, 1:] - middle[1:], face[:, 0] - middle[0], rcond=None)
    return float(middle[0] + slope @ (corner - middle[1:]))


def cut(polygon: Vector, other: Vector) -> Vector:
    """The corners of the intersection of two convex polygons (k x 2), in a ring."""
    if area(other) < 0:
        other = other[::-1]
    for start, end in zip(other, np.roll(other, -1, axis=0), strict=True):
        edge = end - start
        inside = edge[0] * (polygon[:, 1] - start[1]) - edge[1] * (polygon[:, 0] - start[0])
        kept: list[Vector] = []
        for k in range(len(polygon)):
            here, there = inside[k - 1], inside[k]
            if (here < 0) != (there < 0):
                share = here / (here - there)
                kept.append(polygon[k - 1] + share * (polygon[k] - polygon[k - 1]))
            if there >= 0:
                kept.append(polygon[k])
        if not kept:
            return np.zeros((0, 2))
        polygon = np.array(kept)
    return polygon


def area(polygon: Vector) -> float:
    """Signed area of a polygon (k x 2), > 0 if its corners go round to the left."""
    x, y = polygon.T
    return float(0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
