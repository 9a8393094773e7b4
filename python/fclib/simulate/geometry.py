"""The tables /contacts and /bodies of a simulated problem, for its file.

    contacts, bodies = geometry_of(model, part.contacts)    right after `problem_at`

The identity of a contact follows from the state alone, like the problem: from its two shapes and
its feature. For rigid bodies the feature is the contact's place on the two shapes, each axis of a
shape's box being divided into three parts. For elastic bodies it is the node. A shape that is round
about an axis is divided along that axis only, and a sphere not at all, because they may roll.

Shapes are those that collide, and primitives that are only seen. A mesh is given by its convex
hull, because that is what collides.
"""

from __future__ import annotations

from typing import Any, Final
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from fclib import _core
from fclib._geometry import KINDS, Bodies, Contacts
from fclib.simulate import moreau_jean
from fclib.simulate._mujoco import mujoco
from fclib.simulate.deformable import DeformableModel
from fclib.simulate.mujoco_model import MujocoModel
from fclib.simulate.rounding import ELASTIC, RIGID

Integers = npt.NDArray[np.int32]
Vector = npt.NDArray[np.float64]

PARTS: Final = 3  # parts of an axis of a shape
LIMITS: Final = 16  # more than MuJoCo has kinds of constraints
ROUNDED: Final = 2.0**RIGID  # quantum of stored values [m], as for states
DISPLACED: Final = 2.0**ELASTIC  # the same for displacements
KIND_OF: Final = {
    int(mujoco.mjtGeom.mjGEOM_PLANE): KINDS.index("plane"),
    int(mujoco.mjtGeom.mjGEOM_SPHERE): KINDS.index("sphere"),
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): KINDS.index("capsule"),
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): KINDS.index("ellipsoid"),
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): KINDS.index("cylinder"),
    int(mujoco.mjtGeom.mjGEOM_BOX): KINDS.index("box"),
    int(mujoco.mjtGeom.mjGEOM_MESH): KINDS.index("mesh"),
    int(mujoco.mjtGeom.mjGEOM_HFIELD): KINDS.index("mesh"),
}
# axes of a shape along which places of contacts are told apart
AXES: Final = {"capsule": (2,), "cylinder": (2,), "box": (0, 1, 2), "mesh": (0, 1, 2)}
UPRIGHT: Final = (1.0, 0.0, 0.0, 0.0)  # quaternion of the identity


def geometry_of(
    model: MujocoModel | DeformableModel, contacts: moreau_jean.Contacts
) -> tuple[Contacts, Bodies]:
    """The tables of a model's problem; the model must be in the state of the problem."""
    if isinstance(model, DeformableModel):
        return elastic(model, contacts)
    return rigid(model, contacts)


def rounded(values: Any, quantum: float = ROUNDED) -> Vector:
    """Multiples of a quantum: a nanometre is enough for a picture, and halves the size."""
    numbers: Vector = np.rint(np.asarray(values, dtype=float) / quantum) * quantum
    return numbers + 0.0  # no -0


def table_of(
    contacts: moreau_jean.Contacts, body: Any, shape: Any, feature: npt.NDArray[Any]
) -> Contacts:
    """The table of contacts, from the arrays of their names (nc x 2), (nc x 2), (nc)."""
    return Contacts(
        body=np.asarray(body, np.int32),
        shape=np.asarray(shape, np.int32),
        feature=feature.astype(np.int32),
        point=rounded(contacts.point),
        normal=rounded(contacts.frame[:, 0]),
        tangent=rounded(contacts.frame[:, 1]),
        gap=rounded(contacts.gap),
    )


# ---- rigid bodies


def rigid(model: MujocoModel, contacts: moreau_jean.Contacts) -> tuple[Contacts, Bodies]:
    """The tables of an MJCF scene."""
    m, d = model.model, model.data
    static = shapes_of(model)
    bodies = Bodies(
        **static.columns,
        place=rounded(d.xpos[static.bodies]),
        turn=rounded(d.xquat[static.bodies]),
        mass=m.body_mass[static.bodies],
        inertia=m.body_inertia[static.bodies],
        center=m.body_ipos[static.bodies],
        axes=m.body_iquat[static.bodies],
    )
    limit = contacts.pair[:, 0] < 0
    geom = np.where(limit[:, None], 0, contacts.pair)
    shape, body = np.full(geom.shape, -1), np.zeros(geom.shape, np.int64)
    shape[~limit] = static.shape_of[geom[~limit]]
    body[~limit] = static.body_of[m.geom_bodyid[geom[~limit]]]
    # a joint's limit or dry friction has the joint's body and its parent; a tendon's has the world
    kind = -1 - contacts.pair[:, 0]
    number = contacts.pair[:, 1]
    types = mujoco.mjtConstraint
    for which, bodies_of in (
        (types.mjCNSTR_LIMIT_JOINT, m.jnt_bodyid),
        (types.mjCNSTR_FRICTION_DOF, m.dof_bodyid),
    ):
        joint = limit & (kind == int(which))
        own = bodies_of[number[joint]]
        body[joint] = static.body_of[np.column_stack((m.body_parentid[own], own))]
    feature = features(model, contacts, geom)
    # a joint may have two limits at once, the lower and the upper one
    again = repeated(contacts.pair[limit])
    feature[limit] = LIMITS * (2 * number[limit] + again) + kind[limit]
    return table_of(contacts, body, shape, feature), bodies


def repeated(pair: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The number of each row (k x 2) among equal rows, from 0."""
    seen: dict[tuple[int, ...], int] = {}
    found = np.zeros(len(pair), np.int64)
    for i, row in enumerate(pair.tolist()):
        found[i] = seen.get(tuple(row), 0)
        seen[tuple(row)] = int(found[i]) + 1
    return found


def features(
    model: MujocoModel, contacts: moreau_jean.Contacts, geom: npt.NDArray[np.int64]
) -> npt.NDArray[np.int64]:
    """A number (nc) for each contact's place on its two shapes (nc x 2); unique in a pair."""
    count = len(contacts)
    if not model.model.ngeom:
        # only limits and dry friction
        return np.zeros(count, np.int64)
    # both sides at once: first the first shapes, then the second ones
    which = geom.T.ravel()
    local = on_shapes(model, contacts.point, geom).swapaxes(0, 1).reshape(-1, 3)
    box = model.model.geom_aabb[which]
    # a place beyond a third of the half width belongs to an end
    place = (local - box[:, :3]) / np.maximum(box[:, 3:], 1e-300)
    third = (place > 1 / PARTS) * 2 + (np.abs(place) <= 1 / PARTS)
    part = np.where(shapes_of(model).divided[which], third, 1)
    digits = part[:, 0] + PARTS * part[:, 1] + PARTS**2 * part[:, 2]
    code: npt.NDArray[np.int64] = PARTS**3 * digits[:count] + digits[count:]
    local = local[count:]
    # several in one part are numbered in the order of their places on the second shape
    order = np.lexsort((*np.round(local, 6).T, code, geom[:, 1], geom[:, 0]))
    key = np.column_stack((geom, code))[order]
    number = np.zeros(count, np.int64)
    number[order] = repeated_in_order(key)
    return code + PARTS**6 * number


def on_shapes(model: MujocoModel, point: Vector, geom: npt.NDArray[np.int64]) -> Vector:
    """Points (nc x 3) of contacts in the frames of their two shapes (nc x 2 x 3) [m].

    It is 0 if the first shape is negative, as that of a limit.
    """
    d = model.data
    places: Vector = _core.places_on_shapes(
        point, geom, d.geom_xpos, d.geom_xmat, *(model.scene.period or (0.0, 0.0))
    )
    return places


def places_of(model: MujocoModel | DeformableModel, contacts: moreau_jean.Contacts) -> Vector:
    """The places of contacts on their two shapes (nc x 2 x 3) [m]; call it after the assembly.

    It is 0 for limits, and for elastic bodies: there the nodes tell contacts apart.
    """
    if isinstance(model, MujocoModel):
        return on_shapes(model, contacts.point, contacts.pair)
    return np.zeros((len(contacts), 2, 3))


def repeated_in_order(rows: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The same, if equal rows stand together."""
    if not len(rows):
        return np.zeros(0, np.int64)
    new = np.append(True, (rows[1:] != rows[:-1]).any(axis=1))
    start = np.flatnonzero(new)
    count: npt.NDArray[np.int64] = np.arange(len(rows)) - start[new.cumsum() - 1]
    return count


class Shapes:
    """The parts of a compiled model that do not change with its state."""

    def __init__(self, model: MujocoModel) -> None:
        m = model.model
        ghosts = m.body_mocapid >= 0 if model.scene.period is not None else np.zeros(m.nbody, bool)
        self.bodies = np.flatnonzero(~ghosts)  # (nb) MuJoCo's numbers
        self.body_of = np.full(m.nbody, -1)
        self.body_of[self.bodies] = np.arange(len(self.bodies))
        collides = (m.geom_contype != 0) | (m.geom_conaffinity != 0)
        collides[np.concatenate((m.pair_geom1, m.pair_geom2)).astype(int)] = True
        kind = np.array([KIND_OF.get(int(t), -1) for t in m.geom_type])
        seen = (kind >= 0) & (collides | (kind != KINDS.index("mesh")))
        geoms = np.flatnonzero(seen & ~ghosts[m.geom_bodyid])
        self.shape_of = np.full(m.ngeom, -1)
        self.shape_of[geoms] = np.arange(len(geoms))
        self.divided = np.zeros((m.ngeom, 3), dtype=bool)
        for name, axes in AXES.items():
            for axis in axes:
                self.divided[kind == KINDS.index(name), axis] = True

        meshes: dict[tuple[int, int], int] = {}  # by kind and number of a mesh or field
        vertices: list[Vector] = [np.zeros((0, 3))]
        faces: list[npt.NDArray[np.int64]] = [np.zeros((0, 4), np.int64)]
        own = np.full(len(geoms), -1)
        for i, geom in enumerate(geoms.tolist()):
            if kind[geom] == KINDS.index("mesh"):
                key = (int(m.geom_type[geom]), int(m.geom_dataid[geom]))
                if key not in meshes:
                    field = key[0] == int(mujoco.mjtGeom.mjGEOM_HFIELD)
                    vertex, face = field_of(m, key[1]) if field else hull_of(m, key[1])
                    vertices.append(rounded(vertex))
                    faces.append(face)
                    meshes[key] = len(meshes)
                own[i] = meshes[key]
        size = m.geom_size[geoms].copy()
        size[own >= 0] = 0
        moves = (m.body_weldid != 0) & (m.body_dofnum[m.body_weldid] > 0)
        # a body that hangs on a moving body moves too
        for body in range(1, m.nbody):
            moves[body] |= moves[m.body_parentid[body]]
        first = np.array([[len(v), len(f)] for v, f in zip(vertices, faces, strict=True)])
        self.columns: dict[str, Any] = {
            "name": "\n".join(
                (m.body(i).name or f"body {i}").replace("\n", " ") for i in self.bodies.tolist()
            ),
            "moves": moves[self.bodies].astype(np.int32),
            "shape_body": self.body_of[m.geom_bodyid[geoms]].astype(np.int32),
            "shape_kind": kind[geoms].astype(np.int32),
            "shape_size": rounded(size),
            "shape_place": rounded(m.geom_pos[geoms]),
            "shape_turn": rounded(m.geom_quat[geoms]),
            "shape_mesh": own.astype(np.int32),
        }
        if meshes:
            self.columns |= {
                "mesh_first": first.cumsum(axis=0).astype(np.int32),
                "vertex": np.concatenate(vertices),
                "face": np.concatenate(faces).astype(np.int32),
            }
        if model.scene.planar:
            self.columns["planar"] = np.ones(1, np.int32)
        if model.scene.period is not None:
            self.columns["period"] = np.array(model.scene.period, dtype=float)


_known: WeakKeyDictionary[MujocoModel, Shapes] = WeakKeyDictionary()


def shapes_of(model: MujocoModel) -> Shapes:
    """The shapes of a model, found once."""
    if model not in _known:
        _known[model] = Shapes(model)
    return _known[model]


def hull_of(m: Any, mesh: int) -> tuple[Vector, npt.NDArray[np.int64]]:
    """Vertices and faces of a mesh's convex hull, or of the mesh if MuJoCo made none."""
    vertex = m.mesh_vert[m.mesh_vertadr[mesh] :][: m.mesh_vertnum[mesh]]
    if m.mesh_graphadr[mesh] < 0:
        face = m.mesh_face[m.mesh_faceadr[mesh] :][: m.mesh_facenum[mesh]]
    else:
        graph = m.mesh_graph[m.mesh_graphadr[mesh] :]
        nvert, nface = int(graph[0]), int(graph[1])
        own = graph[2 + nvert : 2 + 2 * nvert]
        face = graph[2 + 3 * nvert + 3 * nface :][: 3 * nface].reshape(-1, 3)
        new = np.zeros(int(own.max(initial=0)) + 1, np.int64)
        new[own] = np.arange(nvert)
        vertex, face = vertex[own], new[face]
    return vertex.astype(float), np.column_stack((face, np.full(len(face), -1))).astype(np.int64)


def field_of(m: Any, field: int) -> tuple[Vector, npt.NDArray[np.int64]]:
    """Vertices and faces of the surface of a height field."""
    rows, columns = int(m.hfield_nrow[field]), int(m.hfield_ncol[field])
    a, b, height, _ = m.hfield_size[field]
    y, x = np.meshgrid(np.linspace(-b, b, rows), np.linspace(-a, a, columns), indexing="ij")
    z = m.hfield_data[m.hfield_adr[field] :][: rows * columns].reshape(rows, columns) * height
    number = np.arange(rows * columns).reshape(rows, columns)
    corners = (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1])
    return (
        np.column_stack((x.ravel(), y.ravel(), z.ravel())),
        np.column_stack([corner.ravel() for corner in corners]),
    )


# ---- elastic bodies


def elastic(model: DeformableModel, contacts: moreau_jean.Contacts) -> tuple[Contacts, Bodies]:
    """The tables of elastic blocks: body 0 is the ground, block b is body 1 + b."""
    count, floor = len(model.meshes), model.solids.floor
    displaced = model.places()
    vertices, moved, faces = [], [], []
    for mesh in model.meshes:
        quads = np.concatenate(list(mesh.quads.values()))
        nodes, local = np.unique(quads, return_inverse=True)
        vertices.append(displaced[nodes])
        moved.append(displaced[nodes] - model.reference[nodes])
        faces.append(local.reshape(-1, 4))
    first = np.array([[0, 0], *[[len(v), len(f)] for v, f in zip(vertices, faces, strict=True)]])
    # first the floor's shape, if there is one
    shapes = int(floor) + count
    kind = np.full(shapes, KINDS.index("mesh"))
    kind[: int(floor)] = KINDS.index("plane")
    bodies = Bodies(
        name="\n".join(["ground", *(f"block {i}" for i in range(count))]),
        moves=np.array([0] + [1] * count, np.int32),
        place=np.zeros((1 + count, 3)),
        turn=np.tile(UPRIGHT, (1 + count, 1)),
        shape_body=np.arange(1 - int(floor), 1 + count, dtype=np.int32),
        shape_kind=kind.astype(np.int32),
        shape_size=np.zeros((shapes, 3)),
        shape_place=np.zeros((shapes, 3)),
        shape_turn=np.tile(UPRIGHT, (shapes, 1)),
        shape_mesh=np.arange(-int(floor), count, dtype=np.int32),
        mesh_first=first.cumsum(axis=0).astype(np.int32),
        vertex=rounded(np.concatenate(vertices)),
        displacement=rounded(np.concatenate(moved), DISPLACED),
        face=np.concatenate(faces).astype(np.int32),
    )
    slave = contacts.pair[:, 1]
    body = np.column_stack((contacts.pair[:, 0], 1 + model.body[slave]))
    return table_of(contacts, body, body - 1 + int(floor), slave), bodies
