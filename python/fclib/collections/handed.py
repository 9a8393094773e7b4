"""States that another engine handed over: their problems are made without it.

For each state the engine told the poses and velocities of its free rigid bodies, and its contacts:
bodies, point, normal, gap. The equations are those of Moreau and Jean's scheme in the form of
Newton and Euler, with the spins in the bodies' own axes, of the bodies that contacts move:

    M v = H r + f,  u = H^T v
    M = [m 1, I + h theta ([omega] I - [I omega])]  of each body, with the gyroscopic derivative
    f = M v0 + h (m g, -omega x I omega)

Both bodies of a contact have their lever at its one point, as in the engine. Restitution is 0. The
tangents T1 and T2 follow from N alone.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from fclib import _core
from fclib._geometry import KINDS, Bodies, Contacts, rotations
from fclib.scenes import Scene
from fclib.scenes.shared import mjcf

if TYPE_CHECKING:
    import scipy.sparse as sp  # the import takes a while, and a campaign does not need it

Vector = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

POSE: Final = 7  # place and quaternion w, x, y, z of a body
TWIST: Final = 6  # velocity, then the spin in its own axes
# component of N along an axis that is far from it: one is always below 0.58, and few normals are
# so near to this bound that rounding decides
FAR: Final = 0.6


@dataclass(frozen=True, kw_only=True)
class Solid:
    """A rigid body with one shape; without mass it is fixed."""

    name: str
    kind: str  # of the shape, one of `_geometry.KINDS`
    size: tuple[float, ...]  # of the shape, as in /bodies of a file [m]
    shape_turn: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)  # of the shape in the body
    mass: float = 0.0  # [kg]
    inertia: tuple[float, ...] = (0.0, 0.0, 0.0)  # about its own axes [kg m^2]
    # at the start; a fixed one stays there
    place: tuple[float, ...] = (0.0, 0.0, 0.0)
    turn: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Handed:
    """What K states have besides poses and velocities: the bodies, and the contacts of each."""

    solids: tuple[Solid, ...]
    mu: float
    theta: float
    gravity: float  # downwards [m/s^2]
    count: Integers  # (K) contacts of each state; the arrays below have them one after another
    body: Integers  # (C x 2) numbers of solids; the normal points to the second
    feature: Integers  # (C) the engine's name of the contact, the same in all steps
    point: Vector  # (C x 3) [m]
    normal: Vector  # (C x 3)
    gap: Vector  # (C) [m]

    @property
    def free(self) -> Integers:
        """The solids that move, in the order of the states."""
        return np.flatnonzero([solid.mass > 0 for solid in self.solids])

    def rows(self, place: int) -> slice:
        """The contacts of a state."""
        end = int(self.count[: place + 1].sum())
        return slice(end - int(self.count[place]), end)

    def taken(self, places: list[int]) -> Handed:
        """The same of some of the states."""
        rows = [np.arange(self.count.size)[:0]]
        rows += [np.arange(*self.rows(place).indices(len(self.gap))) for place in places]
        kept = np.concatenate(rows)
        arrays = {name: getattr(self, name)[kept] for name in CONTACTS}
        known = {name: getattr(self, name) for name in ("solids", "mu", "theta", "gravity")}
        return Handed(**known, **arrays, count=self.count[places])

    def head(self) -> dict[str, Any]:
        """All but the arrays, in JSON's types."""
        solids = [asdict(solid) for solid in self.solids]
        return {"solids": solids, "mu": self.mu, "theta": self.theta, "gravity": self.gravity}

    def problem(
        self, place: int, position: Vector, velocity: Vector, h: float, info: _core.ProblemInfo
    ) -> Any:
        """The problem of a state, with its contacts and bodies.

        Args:
            place: of the state.
            position: (7 nb) poses of the free solids.
            velocity: (6 nb) their velocities.
            h: time step [s].
            info: of the problem.
        """
        rows = self.rows(place)
        body, point = self.body[rows], self.point[rows]
        frame = frames(self.normal[rows])
        pose, twist = position.reshape(-1, POSE), velocity.reshape(-1, TWIST)
        turn = pose[:, 3:] / np.linalg.norm(pose[:, 3:], axis=1, keepdims=True)
        # the number of a solid among those that contacts move; -1: it is fixed, or free of contacts
        number = np.full(len(self.solids), -1)
        moved = np.intersect1d(self.free, body)
        number[moved] = np.arange(len(moved))
        state = np.searchsorted(self.free, moved)
        turns = rotations(turn[state])
        H = levers(number[body], point, frame, pose[state, :3], turns)
        M, f = self.inertia_of(moved, twist[state], h)
        problem = _core.GlobalProblem(
            spacedim=3,
            M=M,
            H=H,
            f=f,
            w=np.zeros(3 * len(body)),
            mu=np.full(len(body), self.mu),
            info=info,
            contacts=Contacts(
                body=body.astype(np.int32),
                shape=body.astype(np.int32),
                feature=self.feature[rows].astype(np.int32),
                point=point,
                normal=frame[:, 0],
                tangent=frame[:, 1],
                gap=self.gap[rows],
            ),
        )
        bodies = self.bodies(pose[:, :3], turn)
        return problem.replace(bodies=bodies.started(twist[state].ravel(), problem))

    def inertia_of(self, moved: Integers, twist: Vector, h: float) -> tuple[Any, Vector]:
        """M and f of some solids with their velocities."""
        n = len(moved)
        mass = np.array([self.solids[i].mass for i in moved])
        own = np.array([self.solids[i].inertia for i in moved]).reshape(n, 3)
        omega = twist[:, 3:]
        blocks = np.zeros((n, TWIST, TWIST))
        axes = np.arange(3)
        blocks[:, axes, axes] = mass[:, None]
        spin = own[:, None] * np.eye(3) + h * self.theta * (
            crossing(omega) * own[:, None] - crossing(own * omega)
        )
        blocks[:, 3:, 3:] = spin
        pushed = np.einsum("bij,bj->bi", blocks, twist)
        pushed[:, 2] -= h * mass * self.gravity
        pushed[:, 3:] -= h * np.cross(omega, own * omega)
        rows = np.broadcast_to(np.arange(TWIST * n).reshape(n, TWIST, 1), blocks.shape)
        columns = np.broadcast_to(np.arange(TWIST * n).reshape(n, 1, TWIST), blocks.shape)
        there = blocks != 0
        entries = blocks[there], (rows[there], columns[there])
        return columns_of(entries, (TWIST * n, TWIST * n)), pushed.ravel()

    def bodies(self, place: Vector, turn: Vector) -> Bodies:
        """All solids, in the poses of a state."""
        count = len(self.solids)
        places = np.array([solid.place for solid in self.solids])
        turns = np.array([solid.turn for solid in self.solids])
        places[self.free], turns[self.free] = place, turn
        size = np.zeros((count, 3))
        for i, solid in enumerate(self.solids):
            size[i, : len(solid.size)] = solid.size
        return Bodies(
            name="\n".join(solid.name for solid in self.solids),
            moves=np.array([solid.mass > 0 for solid in self.solids], np.int32),
            place=places,
            turn=turns,
            shape_body=np.arange(count, dtype=np.int32),
            shape_kind=np.array([KINDS.index(s.kind) for s in self.solids], np.int32),
            shape_size=size,
            shape_place=np.zeros((count, 3)),
            shape_turn=np.array([solid.shape_turn for solid in self.solids]),
            shape_mesh=np.full(count, -1, np.int32),
            mass=np.array([solid.mass for solid in self.solids]),
            inertia=np.array([solid.inertia for solid in self.solids]),
            center=np.zeros((count, 3)),
            axes=np.tile([1.0, 0, 0, 0], (count, 1)),
        )


def info_of(scene: Scene, origin: Mapping[str, Any], number: int, step: int) -> _core.ProblemInfo:
    """The info of a problem; the last line of its description is JSON and tells its origin."""
    h = scene.time_step
    known = {
        "generator": "fclib.collections.handed",
        "fclib": _core.version,
        "scene": scene.name,
        "parameters": dict(scene.parameters),
        "seed": scene.seed,
        **{name: value for name, value in origin.items() if name != "settings"},
        **origin["settings"],
        "time_step": h,
        "theta": scene.theta,
        "restitution": scene.restitution,
        "number": number,
        "step": step,
        "time": step * (h or 0.0),
        "units": {"length": "m", "mass": "kg", "time": "s"},
    }
    words = [
        scene.description,
        f"Field of application: {scene.application}.",
        f"Friction: {scene.friction}.",
        f"Authors of the scene: {scene.authors}.",
        json.dumps(known, default=str),
    ]
    return _core.ProblemInfo(
        title=f"{scene.title}, step {step}",
        description="\n".join(words),
        math_info=(
            f"Moreau-Jean step of Newton-Euler equations, theta = {scene.theta:g}, h = {h:g} s;"
            f" Newton impact e = {scene.restitution:g}; Coulomb friction; M v = H r + f, u = H^T v;"
            " M has the derivative of gyroscopic terms; v in m/s and, in the bodies' own axes,"
            " rad/s, r in N s, components N, T1, T2"
        ),
    )


def drawing(handed: Handed, scene: Scene, position: Vector) -> str:
    """The MJCF text of a picture of a state."""
    poses = position.reshape(-1, POSE)
    moving = iter(zip(poses[:, :3], poses[:, 3:], strict=True))
    bodies = []
    for i, solid in enumerate(handed.solids):
        place, turn = next(moving) if solid.mass else (solid.place, solid.turn)
        if not solid.mass and solid.place[2] <= 0:
            continue  # the ground: the floor of the picture
        look = mjcf.shade(i, len(handed.solids)) if solid.mass else "0.6 0.6 0.6 0.2"
        # only what moves is in the middle of the picture
        joint = '<freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        bodies.append(
            f'<body pos="{mjcf.numbers(*place)}" quat="{mjcf.numbers(*turn)}">'
            f'{joint if solid.mass else ""}<geom type="{solid.kind}"'
            f' size="{mjcf.numbers(*solid.size)}" quat="{mjcf.numbers(*solid.shape_turn)}"'
            f' material="solid" rgba="{look}"/></body>'
        )
    return mjcf.document(
        scene.name,
        bodies=bodies,
        time_step=1.0,
        gravity=handed.gravity,
        floor_mu=handed.mu,
        tile=2 * max(max(solid.size) for solid in handed.solids if solid.mass),
    )


CONTACTS: Final = ("body", "feature", "point", "normal", "gap")  # arrays with a row a contact


def of(head: Mapping[str, Any], **arrays: Any) -> Handed:
    """From the description that `Handed.head` gave, and the arrays."""
    solids = []
    for solid in head["solids"]:
        own: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in solid.items()}
        solids.append(Solid(**own))
    known = {name: head[name] for name in ("mu", "theta", "gravity")}
    return Handed(solids=tuple(solids), **known, **arrays)


def frames(normal: Vector) -> Vector:
    """(nc x 3 x 3) rows N, T1, T2; T1 is at right angles to the first axis that is far from N."""
    N = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    away = np.eye(3)[(np.abs(N) < FAR).argmax(axis=1)]
    T1 = np.cross(N, away)
    T1 /= np.linalg.norm(T1, axis=1, keepdims=True)
    return np.stack((N, T1, np.cross(N, T1)), axis=1)


def crossing(vectors: Vector) -> Vector:
    """(k x 3 x 3) the matrices of the products a x ..."""
    x, y, z = vectors.T
    o = np.zeros_like(x)
    rows = ((o, -z, y), (z, o, -x), (-y, x, o))
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def levers(
    number: Integers, point: Vector, frame: Vector, place: Vector, turn: Vector
) -> sp.csc_array:
    """H (6 nb x 3 nc): u is the velocity of the second body at the point, less the first's.

    Args:
        number: (nc x 2) the bodies; -1: one that does not move.
        point: (nc x 3) of the contacts.
        frame: (nc x 3 x 3) rows N, T1, T2.
        place: (nb x 3) of the bodies.
        turn: (nb x 3 x 3) their rotations.
    """
    nc = len(number)
    rows, columns, values = [], [], []
    for side, sign in ((1, 1.0), (0, -1.0)):
        which = np.flatnonzero(number[:, side] >= 0)
        own = number[which, side]
        force = sign * frame[which].transpose(0, 2, 1)  # columns N, T1, T2 in the world
        arm = point[which] - place[own]
        moment = np.einsum("cji,cjk->cik", turn[own], crossing(arm) @ force)
        blocks = np.concatenate((force, moment), axis=1)
        shape = blocks.shape
        i = TWIST * own[:, None, None] + np.arange(TWIST)[:, None]
        j = 3 * which[:, None, None] + np.arange(3)
        rows.append(np.broadcast_to(i, shape).ravel())
        columns.append(np.broadcast_to(j, shape).ravel())
        values.append(blocks.ravel())
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    H = columns_of(entries, (TWIST * len(place), 3 * nc))
    H.eliminate_zeros()
    return H


def columns_of(entries: Any, shape: tuple[int, int]) -> sp.csc_array:
    """The sparse matrix of values and their (rows, columns)."""
    import scipy.sparse as sp

    return sp.csc_array(entries, shape=shape)
