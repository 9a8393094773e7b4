"""Elastic bodies by finite elements, in contact with each other and with a rigid floor.

They are blocks, of equal elements, or meshes of hexahedra of any shape (`hexahedra.py`), which
touch by the interactions of their scene: nodes of one surface and faces of another.

Hexahedra with 8 nodes, linear isotropic elasticity, consistent mass:

    M a + C v + K u = f(t) + H r        u displacements of the nodes, C = damping K (Kelvin-Voigt)

The degrees of freedom of the system are the velocities of the nodes [m/s], 3 a node, body after
body; its configuration q is (u, t), so that loads may change with time. M is consistent, hence not
diagonal, M + h theta C + h^2 theta^2 K constant, and H^T M^-1 H has full rank.

Strains and rotations are assumed small: K belongs to the first position of a block, while contacts
follow the nodes. This is right if blocks are pressed, sheared and pushed a little, and wrong if one
tips over. Blocks may slide and fall as far as they like.

Contacts are between a node of one surface, the slave, and a face of another, the master. The node
is projected onto the bilinear face, x = sum_j N_j(xi, eta) x_j, N is the face's outward normal
there, and u = v_slave - sum_j N_j v_j in the frame N, T1, T2. The nodes of the later of two blocks
are slaves of the earlier block's faces. The nodes of a master face may enter the later block
between its nodes. At an edge the horizontal face takes the node: if all nodes of a block had
contacts with its neighbour and with the support of both, W would lose its full rank.

A contact's pair is the master, 0 for the floor and 1 + b for block b, and the slave's node.

P. Wriggers, Computational Contact Mechanics, Springer, 2nd edition, 2006, sections 6.3 and 9.2.
O. C. Zienkiewicz, R. L. Taylor, J. Z. Zhu, The Finite Element Method: Its Basis and Fundamentals,
  Butterworth-Heinemann, 6th edition, 2005, chapter 6.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib.scenes import Scene
from fclib.scenes.shared import mjcf
from fclib.scenes.shared.solids import Block, HexMesh, Load, Solids
from fclib.simulate import _skfem, hexahedra
from fclib.simulate._mujoco import mujoco
from fclib.simulate.drives import Drives
from fclib.simulate.moreau_jean import Contacts, Sparse, System, Vector
from fclib.simulate.rounding import ELASTIC

Indices = npt.NDArray[np.int64]

SURFACE: Final = "surface"
FACES: Final = ("x-", "x+", "y-", "y+", "z-", "z+")
OPPOSED: Final = -0.9  # scalar product of the normals of two faces that count as facing each other
OUTSIDE: Final = 1e-3  # distance beyond its edges at which a face is still touched, in half widths
PROJECTIONS: Final = 8  # Gauss-Newton steps of a projection; the first is exact on a parallelogram
# in edges of the smallest element: gaps that always count as contact, and the deepest gap
SKIN: Final = 1e-3
DEPTH: Final = 0.1
ROUNDING: Final = 1e-12  # a shape function this small is 0
# integrals of N_i N_j over a rectangle of area 36, with its nodes in a ring
FACE_MASS: Final = np.array([[4, 2, 1, 2], [2, 4, 2, 1], [1, 2, 4, 2], [2, 1, 2, 4]]) / 36.0
_CORNERS: Final = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])


@dataclass(frozen=True)
class Mesh:
    """A block's mesh at its first position; nodes are numbered in the whole system."""

    x: Vector  # (k x 3) nodes [m]
    elements: Indices  # (8 x elements) nodes
    # for each face: (quads x 4) nodes, in a ring about the outward normal; of a mesh of any shape
    # SURFACE is its one face, without a normal
    quads: dict[str, Indices]
    normals: dict[str, Vector]  # for each face: (3)


class DeformableModel:
    """A `ContactModel` made of the elastic blocks of a scene."""

    def __init__(self, scene: Scene) -> None:
        """ImportError without scikit-fem, ValueError if the scene has no blocks or no step.

        Meshes need no scikit-fem.
        """
        if scene.solids is None or not (scene.solids.blocks or scene.solids.meshes):
            raise ValueError(f"{scene.name}: has no elastic blocks")
        if scene.time_step is None:
            raise ValueError(f"{scene.name}: a deformable scene needs a time step")
        skfem = _skfem.load() if scene.solids.blocks else None
        self.scene, self.solids = scene, scene.solids
        self.left_out = scene.left_out
        self.time_step = float(scene.time_step)

        M, K, self.meshes = [], [], []
        first = 0
        for block in self.solids.blocks:
            mesh = mesh_of(skfem, block, first)
            mass, stiffness = element_matrices(
                block.size, block.elements, block.young, block.poisson, block.density
            )
            turn = np.kron(np.eye(8), rotation(block.yaw))
            M.append(assembled(mesh, first, mass))
            K.append(assembled(mesh, first, turn @ stiffness @ turn.T))
            self.meshes.append(mesh)
            first += len(mesh.x)
        for i, own in enumerate(self.solids.meshes):
            try:
                mass, stiffness = hexahedra.matrices(
                    np.array(own.nodes),
                    np.array(own.elements),
                    own.young,
                    own.poisson,
                    own.density,
                    lumped=own.lumped,
                )
            except ValueError as error:
                raise ValueError(f"{scene.name}: mesh {i + 1}: {error}") from None
            M.append(mass)
            K.append(stiffness)
            elements = first + np.array(own.elements, np.int64)
            quads = {SURFACE: hexahedra.surface(elements)}
            self.meshes.append(Mesh(np.array(own.nodes), elements.T, quads, {}))
            first += len(own.nodes)
        self.reference = np.concatenate([mesh.x for mesh in self.meshes])  # (nodes x 3) [m]
        sizes = [len(mesh.x) for mesh in self.meshes]
        self.body = np.repeat(np.arange(len(sizes)), sizes)  # (nodes) the block of each

        self.M = sp.csc_array(sp.block_diag(M, format="csc"))
        self.K = sp.csc_array(sp.block_diag(K, format="csc"))
        for bed in self.solids.beds:
            springs = bed.stiffness * face_mass(self.reference, self.meshes[bed.block], bed.face)
            self.K = sp.csc_array(self.K + sp.kron(springs, np.eye(3)))
        self.C = sp.csc_array(self.solids.damping * self.K)
        self.C.eliminate_zeros()
        n = 3 * first
        self.weight = self.M @ np.tile((0.0, 0.0, -self.solids.gravity), first)  # (n) [N]
        self._loads = [(load, load_mass(self, load)) for load in self.solids.loads]
        self._floor = floor_nodes(self.meshes, self.solids)
        edges = [np.divide(block.size, block.elements).min() for block in self.solids.blocks]
        self._time = 0.0
        self._drives = Drives.of(scene.name, scene.drives, n)
        if self.solids.meshes:
            self._candidates = meeting(scene)
            edges = [smallest_edge(mesh) for mesh in self.meshes]
            self._u = starts(self.solids.meshes, "displacement")
            self._v = starts(self.solids.meshes, "velocity")
        else:
            self._candidates = candidates(self.meshes, self.solids.reach)
            self._u = np.zeros(n)
            velocities = [block.velocity for block in self.solids.blocks]
            self._v = np.repeat(velocities, sizes, axis=0).ravel()
        self._edge = float(min(edges))
        if self._drives:
            self._drives.begin(self._v, 0.0)

    @property
    def position(self) -> Vector:
        """Configuration q (n + 1): displacements of the nodes [m] and the time [s], a copy."""
        return np.append(self._u, self._time)

    @property
    def velocity(self) -> Vector:
        """Velocity v (n) of the nodes [m/s], a copy."""
        return self._v.copy()

    @property
    def trees(self) -> Indices:
        """The block of each degree of freedom (n)."""
        return np.repeat(self.body, 3)

    @property
    def smallest_size(self) -> float | None:
        """None: displacements are small compared to any body."""
        return None

    def places(self, position: Vector | None = None) -> Vector:
        """The places of the nodes (nodes x 3) [m], in a configuration or now."""
        u = self._u if position is None else position[:-1]
        x: Vector = self.reference + u.reshape(-1, 3)
        return x

    def set_state(self, position: Vector, velocity: Vector) -> None:
        """Take a configuration q (n + 1) and a velocity v (n)."""
        self._u, self._time = np.array(position[:-1]), float(position[-1])
        self._v = np.array(velocity)

    def integrate(self, h: float, v: Vector, theta: float = 1.0) -> None:
        """Take v (n) as the velocity, moving by h v_t, v_t = (1 - theta) of the old + theta v."""
        self._u = self._u + h * ((1 - theta) * self._v + theta * v)
        self._v, self._time = np.array(v), self._time + h

    def assemble(self, h: float, *, shared_speed: bool = False) -> System:
        """The system at (q, v), loads in the middle of the step, contacts that may close within h.

        Nodes always share their speed: an impact on one moves the next.
        """
        u, v = self._u, self._v
        force = self.weight + self.loads(self._time + 0.5 * h) - self.K @ u - self.C @ v
        speed = float(np.linalg.norm(v.reshape(-1, 3), axis=1).max(initial=0.0))
        reach = max(2 * h * speed + h**2 * self.solids.gravity, SKIN * self._edge)
        reach += self.scene.activation
        if self.scene.interactions:
            reach += self.solids.reach
        driven = None
        if self._drives:
            force += self._drives.force(self._time, h, self.scene.theta)
            driven = self._drives.driven(self._time + h)
        H, contacts = self.contacts(reach)
        n = len(v)
        nothing = sp.csc_array((n, 0))
        return System(
            self.M,
            force,
            self.C,
            self.K,
            H,
            contacts,
            nothing,
            np.zeros(0),
            self.trees,
            rounding=2.0**ELASTIC,
            driven=driven,
        )

    def loads(self, time: float) -> Vector:
        """Forces of the loads (n) at a time [N]."""
        force = np.zeros((len(self.reference), 3))
        for load, mass in self._loads:
            share = load.share(time)
            if share:
                shape = share * wave(load, self.reference[:, 0], time)
                force += (mass @ shape)[:, None] * np.array(load.traction)
        return force.ravel()

    def contacts(self, reach: float) -> tuple[Sparse, Contacts]:
        """H (n x 3 nc) and the contacts nearer than `reach` [m], those with the floor first."""
        x = self.places()
        low = self._floor[x[self._floor, 2] <= reach]
        slave, quad = self._candidates.slave, self._candidates.quad
        middle = x[quad].mean(axis=1)
        radius = np.linalg.norm(x[quad] - middle[:, None], axis=2).max(axis=1, initial=0.0)
        near = np.linalg.norm(x[slave] - middle, axis=1) <= 1.1 * radius + max(
            reach, DEPTH * self._edge
        )
        slave, quad = slave[near], quad[near]
        shape, normal, outside = project(x[slave], x[quad])
        touched = x[slave] - np.einsum("cj,cji->ci", shape, x[quad])
        gap = np.einsum("ci,ci->c", normal, touched)
        kept = np.flatnonzero((outside <= OUTSIDE) & (gap <= reach) & (gap >= -DEPTH * self._edge))
        # among the faces of a block, take the one with the node deepest inside; of equals the first
        order = np.lexsort((np.maximum(outside[kept], 0.0), self.body[quad[kept, 0]], slave[kept]))
        kept = kept[order]
        key = np.column_stack((slave[kept], self.body[quad[kept, 0]]))
        first = np.ones(len(kept), dtype=bool)
        first[1:] = (key[1:] != key[:-1]).any(axis=1)
        kept = kept[first]

        up = np.tile((0.0, 0.0, 1.0), (len(low), 1))
        frame = frames(np.concatenate((up, normal[kept])))
        slaves = np.concatenate((low, slave[kept]))
        masters = np.concatenate((np.zeros(len(low), np.int64), 1 + self.body[quad[kept, 0]]))
        gaps = np.concatenate((x[low, 2], gap[kept]))
        mu, interaction = np.full(len(slaves), self.solids.mu), None
        if self._candidates.interaction is not None:
            interaction = self._candidates.interaction[near][kept]
            mu = np.array([one.mu for one in self.scene.interactions])[interaction]
        contacts = Contacts(
            pair=np.column_stack((masters, slaves)),
            point=x[slaves] - 0.5 * gaps[:, None] * frame[:, 0],
            frame=frame,
            gap=gaps,
            mu=mu,
            interaction=interaction,
        )
        # the slave moves against the floor, or against the mean of its master's nodes
        nodes = np.column_stack((slaves, np.zeros((len(slaves), 4), np.int64)))
        nodes[len(low) :, 1:] = quad[kept]
        weights = np.zeros((len(slaves), 5))
        weights[:, 0] = 1.0
        weights[len(low) :, 1:] = -shape[kept]
        return columns(nodes, weights, frame, len(self._v)), contacts

    def energy(self) -> float:
        """Kinetic, elastic and potential energy [J] at (q, v), without that of the loads."""
        u, v = self._u, self._v
        return float(0.5 * v @ (self.M @ v) + 0.5 * u @ (self.K @ u) - self.weight @ u)

    def drawing(self, position: Vector) -> tuple[Any, Any]:
        """An MjModel and an MjData of the deformed blocks, with their elements outlined."""
        m = mujoco.MjModel.from_xml_string(picture(self, self.places(position)))
        return m, mujoco.MjData(m)


# ---- elements


def rotation(yaw: float) -> Vector:
    """The rotation (3 x 3) about the vertical; exact if the angle is 0."""
    c, s = (np.cos(yaw), np.sin(yaw)) if yaw else (1.0, 0.0)
    return np.array([(c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)])


def mesh_of(skfem: Any, block: Block, first: int) -> Mesh:
    """A block's mesh, its nodes numbered from `first`."""
    half = 0.5 * np.array(block.size)
    grid = [np.linspace(-a, a, e + 1) for a, e in zip(half, block.elements, strict=True)]
    mesh = skfem.MeshHex.init_tensor(*grid)
    x: Vector = np.ascontiguousarray(mesh.p.T)
    turn = rotation(block.yaw)
    facets = mesh.facets[:, mesh.boundary_facets()].T
    quads, normals = {}, {}
    for number, face in enumerate(FACES):
        axis, sign = number // 2, 2 * (number % 2) - 1
        own = facets[(x[facets, axis] == sign * half[axis]).all(axis=1)]
        # about the outward normal
        b, c = [(1, 2), (2, 0), (0, 1)][axis][::sign]
        out = x[own] - x[own].mean(axis=1, keepdims=True)
        ring = np.argsort(np.arctan2(out[:, :, c], out[:, :, b]), axis=1)
        quads[face] = first + np.take_along_axis(own, ring, axis=1).astype(np.int64)
        normals[face] = sign * turn[:, axis]
    return Mesh(
        x @ turn.T + np.array(block.centre), first + mesh.t.astype(np.int64), quads, normals
    )


@functools.lru_cache(maxsize=256)
def element_matrices(
    size: tuple[float, float, float],
    elements: tuple[int, int, int],
    young: float,
    poisson: float,
    density: float,
) -> tuple[Vector, Vector]:
    """Consistent mass and stiffness (24 x 24) of an element; all elements of a block are equal.

    Do not change them: models share them, because scikit-fem takes longer than all the rest.
    """
    skfem = _skfem.load()
    elasticity = importlib.import_module("skfem.models.elasticity")
    edges = np.divide(size, elements)
    one = skfem.MeshHex.init_tensor(*[np.array([0.0, edge]) for edge in edges])
    basis = skfem.Basis(one, skfem.ElementVector(skfem.ElementHex1()))
    stress = elasticity.linear_elasticity(*elasticity.lame_parameters(young, poisson))
    inertia = skfem.BilinearForm(lambda u, v, _: density * (u * v).sum(axis=0))
    order = basis.nodal_dofs[:, one.t[:, 0]].T.ravel()
    mass, stiffness = (form.assemble(basis).toarray() for form in (inertia, stress))
    return mass[np.ix_(order, order)], stiffness[np.ix_(order, order)]


def assembled(mesh: Mesh, first: int, element: Vector) -> Sparse:
    """The matrix of a block (3 k x 3 k) from that of one element; symmetric to the last bit."""
    dofs = (3 * (mesh.elements.T[:, :, None] - first) + np.arange(3)).reshape(-1, 24)
    rows = np.repeat(dofs, 24, axis=1).ravel()
    entries = np.tile(element.ravel(), len(dofs))
    size = 3 * len(mesh.x)
    matrix = sp.csc_array((entries, (rows, np.tile(dofs, (1, 24)).ravel())), shape=(size, size))
    return sp.csc_array(0.5 * (matrix + matrix.T))


def face_mass(x: Vector, mesh: Mesh, face: str) -> Sparse:
    """The integral of N_i N_j over a block's face (nodes x nodes) [m^2], for all nodes."""
    quads = mesh.quads[face]
    corners = x[quads]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]), axis=1
    )
    entries = areas[:, None, None] * FACE_MASS
    rows, cols = np.repeat(quads, 4, axis=1), np.tile(quads, (1, 4))
    return sp.csr_array((entries.ravel(), (rows.ravel(), cols.ravel())), shape=(len(x), len(x)))


def load_mass(model: DeformableModel, load: Load) -> Sparse:
    """The matrix from tractions at the nodes to their forces (nodes x nodes) [m^2]."""
    x, meshes = model.reference, model.meshes
    return sum(
        (face_mass(x, meshes[block], load.face) for block in load.blocks),
        sp.csr_array((len(x), len(x))),
    )


def wave(load: Load, x: Vector, time: float) -> Vector:
    """The share of a load's traction at places x (k) along x [m]: 1, or its moving wave."""
    if load.width is None:
        return np.ones_like(x)
    phase = (x - load.start - load.speed * time) / load.width
    shape: Vector = np.where(np.abs(phase) < 0.5, np.cos(np.pi * phase) ** 2, 0.0)
    return shape


# ---- contacts


@dataclass(frozen=True)
class Candidates:
    """Nodes, each with a face of another block that it may touch."""

    slave: Indices  # (k)
    quad: Indices  # (k x 4)
    interaction: Indices | None = None  # (k) its number in the scene; None: no such


def slaves_of(mesh: Mesh, face: str) -> Indices:
    """The nodes of a face that make contacts; nodes at an edge belong to the horizontal face."""
    nodes = np.unique(mesh.quads[face])
    if face[0] != "z":
        nodes = np.setdiff1d(nodes, np.concatenate((mesh.quads["z-"], mesh.quads["z+"])))
    return nodes


def floor_nodes(meshes: list[Mesh], solids: Solids) -> Indices:
    """The nodes that may touch the floor: those of the lower faces."""
    if not solids.floor:
        return np.zeros(0, np.int64)
    return np.concatenate([slaves_of(mesh, "z-") for mesh in meshes])


def candidates(meshes: list[Mesh], reach: float) -> Candidates:
    """All nodes of a face with all quads of the faces opposite to it, nearer than `reach` [m]."""
    found = list(_candidates(meshes, reach))
    slave = [np.repeat(nodes, len(quads)) for nodes, quads in found]
    quad = [np.tile(quads, (len(nodes), 1)) for nodes, quads in found]
    return Candidates(
        np.concatenate([np.zeros(0, np.int64), *slave]),
        np.concatenate([np.zeros((0, 4), np.int64), *quad]),
    )


def _candidates(meshes: list[Mesh], reach: float) -> Iterator[tuple[Indices, Indices]]:
    every = np.concatenate([mesh.x for mesh in meshes])
    low = np.array([mesh.x.min(axis=0) for mesh in meshes]) - 0.5 * reach
    high = np.array([mesh.x.max(axis=0) for mesh in meshes]) + 0.5 * reach
    for later, mesh in enumerate(meshes):
        near = ((low[:later] <= high[later]) & (low[later] <= high[:later])).all(axis=1)
        for earlier in np.flatnonzero(near):
            other = meshes[earlier]
            for one in FACES:
                for two in FACES:
                    normal = other.normals[two]
                    if normal @ mesh.normals[one] > OPPOSED:
                        continue
                    nodes, quads = slaves_of(mesh, one), other.quads[two]
                    away = (every[nodes].mean(axis=0) - every[quads[0, 0]]) @ normal
                    if nodes.size and abs(away) <= reach:
                        yield nodes, quads


def meeting(scene: Scene) -> Candidates:
    """The nodes of all candidates with the quads that they see, on other meshes."""
    assert scene.solids is not None
    kinds = {frozenset(one.kinds): i for i, one in enumerate(scene.interactions)}
    surfaces = []
    first = 0
    for body, mesh in enumerate(scene.solids.meshes):
        surfaces += [(body, s, first + np.array(s.quads, np.int64)) for s in mesh.surfaces]
        first += len(mesh.nodes)
    slave: list[Indices] = [np.zeros(0, np.int64)]
    quad: list[Indices] = [np.zeros((0, 4), np.int64)]
    interaction: list[Indices] = [np.zeros(0, np.int64)]
    for body, own, candidate in surfaces:
        for other, touched, quads in surfaces:
            number = kinds.get(frozenset((own.kind, touched.kind)))
            if number is None or body == other or not own.candidate or touched.candidate:
                continue
            nodes = np.unique(candidate)
            slave.append(np.repeat(nodes, len(quads)))
            quad.append(np.tile(quads, (len(nodes), 1)))
            interaction.append(np.full(len(nodes) * len(quads), number))
    return Candidates(np.concatenate(slave), np.concatenate(quad), np.concatenate(interaction))


def smallest_edge(mesh: Mesh) -> float:
    """The shortest edge of a mesh's surface [m]; its nodes are numbered in the whole system."""
    quads = mesh.quads[SURFACE]
    corners = mesh.x[quads - mesh.elements.min()]
    edges = corners - np.roll(corners, 1, axis=1)
    return float(np.linalg.norm(edges, axis=2).min())


def starts(meshes: tuple[HexMesh, ...], name: str) -> Vector:
    """Displacements or velocities of all nodes at the start (n)."""
    found = [
        np.array(getattr(mesh, name)) if getattr(mesh, name) else np.zeros((len(mesh.nodes), 3))
        for mesh in meshes
    ]
    return np.concatenate(found).ravel()


def project(points: Vector, corners: Vector) -> tuple[Vector, Vector, Vector]:
    """The nearest points of bilinear quads (k x 4 x 3) to points (k x 3).

    Returns:
        The shape functions there (k x 4), the unit normals (k x 3), and the distance of the
        projection outside of the quad, in its half widths (k); <= 0 is inside.
    """
    local = np.zeros((len(points), 2))
    for _ in range(PROJECTIONS):
        shape, along = shapes(local)
        tangents = np.einsum("cja,cji->cai", along, corners)
        rest = points - np.einsum("cj,cji->ci", shape, corners)
        metric = np.einsum("cai,cbi->cab", tangents, tangents)
        local = local + np.linalg.solve(metric, np.einsum("cai,ci->ca", tangents, rest)[..., None])[
            ..., 0
        ].clip(-2, 2)
        # a diverged projection is far outside, and stays there
        local = local.clip(-3, 3)
    outside = np.abs(local).max(axis=1, initial=0.0) - 1
    shape, along = shapes(local.clip(-1, 1))
    tangents = np.einsum("cja,cji->cai", along, corners)
    normal = np.cross(tangents[:, 0], tangents[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return shape, normal, outside


def shapes(local: Vector) -> tuple[Vector, Vector]:
    """Shape functions of a quad (k x 4) and their derivatives (k x 4 x 2) at (xi, eta) (k x 2)."""
    factor = 1 + local[:, None, :] * _CORNERS  # (k x 4 x 2)
    shape = 0.25 * factor[:, :, 0] * factor[:, :, 1]
    along = 0.25 * _CORNERS * factor[:, :, ::-1]
    shape[np.abs(shape) < ROUNDING] = 0.0
    return shape, along


def frames(normal: Vector) -> Vector:
    """Frames (k x 3 x 3), rows N, T1, T2, of unit normals (k x 3); T1 as near to x as can be."""
    axis = np.where(np.abs(normal[:, :1]) < 0.9, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    first = axis - np.einsum("ci,ci->c", axis, normal)[:, None] * normal
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack((normal, first, np.cross(normal, first)), axis=1)


def columns(nodes: Indices, weights: Vector, frame: Vector, n: int) -> Sparse:
    """H (n x 3 nc): from the nodes (nc x k) of contacts, their weights (nc x k) and frames."""
    nc = len(nodes)
    entries = weights[:, :, None, None] * frame.transpose(0, 2, 1)[:, None]  # nc, k, dof, column
    rows = np.broadcast_to(3 * nodes[:, :, None, None] + np.arange(3)[:, None], entries.shape)
    cols = np.broadcast_to(3 * np.arange(nc)[:, None, None, None] + np.arange(3), entries.shape)
    H = sp.csc_array((entries.ravel(), (rows.ravel(), cols.ravel())), shape=(n, 3 * nc))
    H.eliminate_zeros()
    return H


# ---- pictures


def picture(model: DeformableModel, x: Vector) -> str:
    """MJCF that draws the blocks with their nodes at x (nodes x 3): each quad outlined."""
    count = len(model.meshes)
    assets, bodies = [], []
    for i, mesh in enumerate(model.meshes):
        quads = np.concatenate(list(mesh.quads.values()))
        corner = 4 * np.arange(len(quads))[:, None]
        triangles = (corner + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
        sheet = np.tile([(0, 0), (1, 0), (1, 1), (0, 1)], (len(quads), 1))
        colour = " ".join(mjcf.shade(i, count).split()[:3])
        assets += [
            f'<texture name="t{i}" type="2d" builtin="flat" mark="edge" rgb1="{colour}"'
            ' markrgb="0.2 0.24 0.3" width="64" height="64"/>',
            f'<material name="m{i}" texture="t{i}" specular="0.2" shininess="0.3"/>',
            f'<mesh name="b{i}" inertia="shell" vertex="{mjcf.numbers(*x[quads].ravel())}"'
            f' texcoord="{mjcf.numbers(*sheet.ravel())}"'
            f' face="{" ".join(map(str, triangles.ravel().tolist()))}"/>',
        ]
        bodies.append(
            f'<body><freejoint/><geom type="mesh" mesh="b{i}" material="m{i}" mass="1"/></body>'
        )
    extent = float(np.ptp(x, axis=0).max())
    return mjcf.document(
        model.scene.name,
        bodies=bodies,
        assets=assets,
        time_step=model.time_step,
        gravity=model.solids.gravity,
        floor_mu=model.solids.mu,
        floor_z=0.0 if model.solids.floor else float(x[:, 2].min()),
        tile=0.25 * extent,
    )
