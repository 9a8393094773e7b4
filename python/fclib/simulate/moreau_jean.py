"""Moreau-Jean time stepping of a mechanical system with contact, Coulomb friction and impacts.

One step of length h, with springs and dampers linearised and taken at theta, and other forces as
the model gives them:

    M (v' - v) = h F(q_t, v_t) + H r + G lambda     dynamics, r and lambda impulses
    u = H^T v' + w                                  local velocities, N, T1, T2 for each contact
    G^T v' + b = 0                                  bilateral constraints
    K* contains u^, u^ . r = 0, r in K              Coulomb's law on the active contacts
    q' = q (+) h v_t                                on the manifold of configurations

with v_t = (1 - theta) v + theta v' and q_t = q (+) theta h v_t, which is the problem GM3DFC (G3DFC
without bilateral constraints) with the matrix M + h theta C + h^2 theta^2 K and
f = (M + h theta C - h^2 theta (1 - theta) K) v + h F(q, v), since F(q_t, v_t) = F(q, v) -
theta C (v' - v) - theta h K v_t. By default theta = 1; theta = 1/2 keeps the energy of springs.

    q, v    configuration and velocity at t; v' the velocity at t + h
    gap     g, signed distance at a contact [m], < 0 if bodies penetrate
    u_N^-   normal velocity before the step, (H^T v)_N; > 0 separates

Two unilateral laws:

velocity (default)  a contact is active if g + h/2 u_N^- <= a, with Newton's law of impact
                    u_N' + e u_N^- >= 0, that is w_N = e u_N^-, w_T = 0. Restitution is exact. A
                    penetration (of order h u_N at an impact) is kept, and not amplified.
                    a [m] is the allowance of a contact (`allowances`). It is the change of the gap
                    if each coordinate is off by the rounding of stored states, and by a small share
                    of its free motion in a step. With a = 0 a body at rest falls if the last digit
                    of a gap is positive. If two geometries touch in one point in this sense, their
                    other points are active too if g + h/2 u_N^- is at most the activation [m], 0 by
                    default. Of points in a line, within the allowance, only the ends are taken: if
                    edges lie on each other, the number and place of other points depend on
                    rounding. Of many points in a plane, as of a box on a terrain, only the corners
                    are taken.
gap                 every contact within reach is active, with g_m + h u_N' >= 0, that is
                    w_N = g_m / h, g_m = g + (1 - theta) h u_N^- the gap in the middle of the
                    step. If g_m < 0, only a share of it, the stabilization, is undone in a
                    step: undoing all of it would throw the bodies apart. Inelastic: no e.

A bilateral constraint with violation c is corrected by the same share: b = stabilization c / h.

With rolling friction a contact has five components, N, T1, T2, R1, R2: the last two are the
relative angular velocity about T1 and T2 [rad/s], and the rolling moment, ||r_R|| <= mu_r r_N.
With spin friction it has four, N, T1, T2, S, or six if it resists rolling too: S is the relative
angular velocity about N, and its moment. With four, sliding and spin share one limit, an ellipsoid.

Dry friction in a joint, a force of at most F against its velocity s^T v, is also a contact
(docs/mathematics.md): an auxiliary degree of freedom z of mass a, pressed by F, is its normal
velocity, the joint's velocity its tangential one, and mu = 1,

    a z = r_N - h F,  u_N = z,  u_T1 = s^T v,  u_T2 = 0

so that z = 0 and r_N = h F at every solution.

In the plane a contact has two components, N and T, and with rolling friction a third one, R, about
the normal of the plane.

Shapes that have interactions (fclib.scenes.shared.interaction) meet by the law of gaps, each pair
by its own: contacts count up to its alert distance.

Velocities that are given are no unknowns: with v = (v_1, v_2) and v_2' known, f_1 becomes
f_1 - M_12 v_2', and w becomes w + H_2^T v_2'.

A problem holds the bodies that the contacts move. A body that no chain of contacts, bilateral
constraints and inertia links to a contact moves freely, M v' = M v + h F + G lambda. With
`all_bodies` the problem holds these bodies too.

J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, in Nonsmooth
  Mechanics and Applications, CISM 302, Springer, 1988.
M. Jean, The non-smooth contact dynamics method, Computer Methods in Applied Mechanics and
  Engineering 177, 1999, 235-257.
V. Acary, B. Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, Springer, 2008,
  chapter 10.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib import _core, _geometry, _laws, _solve
from fclib.scenes import Law
from fclib.scenes.shared.interaction import Interaction
from fclib.simulate.arrays import (
    Sparse,
    Vector,
    added,
    by_columns,
    columns_of,
    lengths_of,
    submatrix,
    times,
    transposed_times,
)

__all__ = ["Sparse", "Vector"]

LONGEST = 1e9  # longest step [s]: terms in h^2 stay finite
# workshop/tables/held_bodies.py chose these, docs/results/held-bodies.csv has its results
ROUNDINGS = 4.0  # a closed gap may be off by so many roundings of each stored coordinate
FACE = 16  # points of a pair that may all be corners; if there are more, the corners are found
MOTION = 1e-3  # and by this share of each coordinate's free motion in a step


@dataclass(frozen=True)
class Contacts:
    """The geometry of nc contacts, in the order of the problem's blocks."""

    # (nc x 2) the two geometries, N points from the first to the other; or < 0 for a limit, see
    # source
    pair: npt.NDArray[np.int64]
    point: Vector  # (nc x 3) in the world [m], midway between the two
    frame: Vector  # (nc x 3 x 3) rows N, T1, T2, in the plane N, T, y, in the world; 0 for a limit
    gap: Vector  # (nc) signed distance [m]; of a joint's limit, also [rad]
    mu: Vector  # (nc) coefficient of friction
    mu_r: Vector | None = None  # (nc) coefficient of rolling friction [m]; None: no rolling
    planar: bool = False  # d = 2, 3 with rolling
    interaction: npt.NDArray[np.int64] | None = None  # (nc) its number in the scene; None: no such
    mu_s: Vector | None = None  # (nc) coefficient of spin friction [m]; None: no spin

    def __len__(self) -> int:
        return len(self.gap)

    def __getitem__(self, which: npt.NDArray[Any]) -> Contacts:
        return Contacts(
            self.pair.take(which, axis=0),
            self.point.take(which, axis=0),
            self.frame.take(which, axis=0),
            self.gap.take(which),
            self.mu.take(which),
            None if self.mu_r is None else self.mu_r.take(which),
            self.planar,
            None if self.interaction is None else self.interaction.take(which),
            None if self.mu_s is None else self.mu_s.take(which),
        )

    @property
    def dimension(self) -> int:
        """Components d of a contact: 3, or 2 in the plane; with rolling friction 5, or 3.

        With spin friction 4, or 6 with both.
        """
        rolling, spin = self.mu_r is not None, self.mu_s is not None
        return components(self.planar, rolling=rolling, spin=spin)

    @property
    def parts(self) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
        """The components of a contact for force and moment, and their rows of the frame."""
        force, d = 2 if self.planar else 3, self.dimension
        axis = _geometry.first_axis(self.planar, d)
        return (
            (slice(0, force), slice(0, force)),
            (slice(force, d), slice(axis, axis + d - force)),
        )

    def forces(self, r: Vector) -> Vector:
        """The forces of reactions r (d nc), in the world (nc x 3)."""
        which, axes = self.parts[0]
        local = np.reshape(r, (-1, self.dimension))[:, which]
        world: Vector = np.einsum("cij,ci->cj", self.frame[:, axes], local)
        return world


def components(planar: bool, *, rolling: bool, spin: bool = False) -> int:
    """Number d of components of a contact."""
    if planar:
        return 3 if rolling else 2
    return 3 + (2 if rolling else 0) + (1 if spin else 0)


@dataclass(frozen=True)
class DryFriction:
    """Dry friction in k joints and tendons: a force against the velocity, at most the bound."""

    gradient: Sparse  # (n x k) of the joints: their velocities are gradient^T v; no column is empty
    bound: Vector  # (k) F [N], [N m]
    mass: Vector  # (k) a of the auxiliary degrees of freedom, of the size of the joint's inertia
    pair: npt.NDArray[np.int64]  # (k x 2) < 0, as for a limit: the joint or tendon

    # the part that each step adds to a problem: for each joint an auxiliary degree of freedom and a
    # contact, with N the auxiliary velocity and T1 the joint's

    @cached_property
    def contacts(self) -> Contacts:
        """The contacts (k)."""
        k = len(self.bound)
        return Contacts(self.pair, np.zeros((k, 3)), np.zeros((k, 3, 3)), np.zeros(k), np.ones(k))

    @cached_property
    def first(self) -> npt.NDArray[np.intp]:
        """A degree of freedom (k) on which each acts."""
        first: npt.NDArray[np.intp] = self.gradient.indices[self.gradient.indptr[:-1]]
        return first

    @cached_property
    def places(self) -> npt.NDArray[np.int32]:
        """The auxiliary degrees of freedom (k)."""
        n, k = self.gradient.shape
        return np.arange(n, n + k, dtype=np.int32)

    @cached_property
    def ends(self) -> npt.NDArray[np.int32]:
        """The number of entries up to the end of each column N and of each column T1 (k x 2)."""
        lengths = lengths_of(self.gradient.indptr)
        both = np.column_stack((np.ones_like(lengths), lengths))
        return both.cumsum(dtype=np.int32).reshape(both.shape)

    @cached_property
    def rows(self) -> npt.NDArray[np.int32]:
        """The rows of the entries in the columns N and T1 of each."""
        return np.insert(self.gradient.indices, self.gradient.indptr[:-1], self.places)

    @cached_property
    def values(self) -> Vector:
        """The entries in the columns N and T1 of each."""
        return np.insert(self.gradient.data, self.gradient.indptr[:-1], 1.0)


@dataclass(frozen=True)
class System:
    """The equations of motion at one configuration, and the contacts within reach."""

    M: Sparse  # (n x n) mass matrix
    force: Vector  # (n) F(q, v): all forces except the reactions, with gyroscopic terms
    C: Sparse  # (n x n) damping, -dF/dv of the dampers; also of gyroscopic terms if asked for
    K: Sparse  # (n x n) stiffness, -dF/dq of the springs
    H: Sparse  # (n x d nc) contact directions, d = 2, 3 or 5
    contacts: Contacts  # nc
    G: Sparse  # (n x p) gradients of the bilateral constraints, d violation / dt = G^T v
    violation: Vector  # (p) violation of the bilateral constraints
    tree: npt.NDArray[np.int64]  # (n) the body, or tree of bodies, of each degree of freedom
    dry: DryFriction | None = None
    rounding: float = 0.0  # rounding of each coordinate of a stored state [m], [rad]
    shape_rounding: Vector | None = None  # rounding of each geometry's surface [m]; None: exact
    driven: Driven | None = None


@dataclass(frozen=True)
class Driven:
    """Degrees of freedom whose velocity at the end of the step is given."""

    dof: npt.NDArray[np.int64]  # (k)
    velocity: Vector  # (k)


class ContactModel(Protocol):
    """A mechanical system with contacts: all that the time stepper needs of it."""

    @property
    def position(self) -> Vector:
        """Configuration q (nq), a copy; nq > n if there are rotations."""
        ...

    @property
    def velocity(self) -> Vector:
        """Velocity v (n), a copy."""
        ...

    def assemble(self, h: float, *, shared_speed: bool) -> System:
        """The system at (q, v), with every contact that may close within h.

        Each body is assumed to move at its own speed, or with `shared_speed` at the fastest body's
        speed, since impacts pass speed on.
        """
        ...

    def integrate(self, h: float, v: Vector, theta: float = 1.0) -> None:
        """Take v as the velocity, moving by h v_t, v_t = (1 - theta) of the old + theta v."""
        ...


@dataclass(frozen=True, kw_only=True)
class MoreauJean:
    """The scheme: from a system and a velocity to the problem of one step."""

    h: float  # time step [s]
    restitution: float = 0.0  # e of Newton's law, in [0, 1]
    law: Law = "velocity"
    stabilization: float = 0.2  # share of a penetration or of a violation undone in a step
    theta: float = 1.0  # 1 is implicit Euler, 1/2 the midpoint
    # [m], velocity law: if a pair touches, its points within this are active
    activation: float = 0.0
    allowance: bool = True  # velocity law: whether gaps within `allowances` count as closed
    all_bodies: bool = False  # whether problems also hold bodies that nothing touches
    # gap law: the law of each contact that has an interaction, in place of stabilization
    interactions: tuple[Interaction, ...] = ()

    def __post_init__(self) -> None:
        if not 0 < self.h <= LONGEST:
            raise ValueError(
                f"the time step must be positive, and {LONGEST:g} s at most, not {self.h}"
            )
        if not 0 <= self.restitution <= 1:
            raise ValueError(f"restitution must be in [0, 1], not {self.restitution}")
        if not 0 <= self.stabilization <= 1:
            raise ValueError(f"stabilization must be in [0, 1], not {self.stabilization}")
        if not 0.5 <= self.theta <= 1:
            raise ValueError(f"theta must be in [1/2, 1], not {self.theta}")
        if not self.activation >= 0:
            raise ValueError(f"the activation must be >= 0 [m], not {self.activation}")
        if self.law not in ("velocity", "gap"):
            raise ValueError(f'the law must be "velocity" or "gap", not {self.law!r}')
        if self.law == "gap" and self.restitution:
            raise ValueError("the gap law is inelastic: restitution needs the velocity law")
        if self.law != "gap" and self.interactions:
            raise ValueError('interactions have laws of gaps: the law must be "gap"')

    def assemble(self, model: ContactModel) -> System:
        """The model's system, with the contacts that this law needs."""
        return model.assemble(self.h, shared_speed=self.law == "gap" and not self.interactions)

    def problem(
        self, system: System, v: Vector, info: _core.ProblemInfo | None = None
    ) -> StepProblem:
        """The problem of the step from velocity v (n): the active contacts and bodies they move."""
        h = self.h
        contacts, H = system.contacts, system.H
        d = contacts.dimension
        if self.law == "velocity":
            before = transposed_times(H, v)[0::d]
            middle = contacts.gap + 0.5 * h * before
            closed = allowances(system, h, v) if self.allowance else np.zeros(len(middle))
            active = closing(contacts.pair, middle, closed, self.activation)
            if len(active) < len(contacts):
                contacts = contacts[active]
            if self.allowance:
                outer = ends(contacts, closed[active])
                if len(outer) < len(active):
                    active, contacts = active[outer], contacts[outer]
            if len(active) < len(middle):
                H, before = submatrix(H, block_columns(active, d)), before[active]
            w_n = self.restitution * before
        else:
            middle = contacts.gap
            if self.theta < 1:
                middle = middle + (1 - self.theta) * h * transposed_times(H, v)[0::d]
            undone: Vector | float = self.stabilization
            if contacts.interaction is not None:
                active, undone = self.seen(contacts.interaction, middle)
                contacts, H = contacts[active], submatrix(H, block_columns(active, d))
                middle = middle[active]
            share = np.where(middle > 0, 1.0, undone)
            w_n = share * middle / h

        w = np.zeros(d * len(contacts))
        w[0::d] = w_n
        implicit = self.theta * h
        M = added(system.M, implicit, system.C)
        f = times(M, v) + h * system.force
        if self.theta < 1:
            f -= implicit * (h - implicit) * times(system.K, v)
        M = added(M, implicit**2, system.K)
        b = self.stabilization / h * system.violation
        tree, G = system.tree, system.G
        if system.dry is not None:
            M, H, G, f, w, contacts, tree = with_dry_friction(
                system.dry, h, M, H, G, f, w, contacts, tree
            )

        given = system.driven
        if given is not None:
            # their velocities are known: they go to the right sides, and leave the unknowns
            moved = np.zeros(len(f))
            moved[given.dof] = given.velocity
            f, w, b = (
                f - times(M, moved),
                w + transposed_times(H, moved),
                b + transposed_times(G, moved),
            )
            kept = np.setdiff1d(np.arange(len(f)), given.dof)
            # contacts that move nothing else are none
            new = np.full(len(f), -1, dtype=np.int32)
            new[kept] = np.arange(len(kept), dtype=np.int32)
            M, H, G = (rows_of(matrix, new) for matrix in (submatrix(M, kept), H, G))
            f, tree = f[kept], tree[kept]
            touching = np.flatnonzero(lengths_of(H.indptr).reshape(-1, d).any(axis=1))
            if len(touching) < len(contacts):
                columns = block_columns(touching, d)
                contacts, H, w = contacts[touching], submatrix(H, columns), w[columns]
        if self.all_bodies:
            inside, rows = np.arange(len(f)), np.arange(len(b))
        else:
            inside, rows = linked(tree, M, H, G)
        whole = len(inside) == len(f) and len(rows) == len(b)
        # all auxiliary degrees of freedom have contacts
        count = len(f) if given is not None else len(v)
        apart = rows[:0] if whole else np.setdiff1d(np.arange(count), inside)
        if not whole:
            place = np.full(len(f), -1, dtype=np.int32)
            place[inside] = np.arange(len(inside), dtype=np.int32)
            all_M, all_G = M, G
            # nothing couples the bodies inside the problem to those outside
            M, G = submatrix(M, inside, place), submatrix(G, rows, place)
            H = submatrix(H, np.arange(H.shape[1]), place)
        fields: dict[str, Any] = {
            "M": M,
            "H": H,
            "G": G if rows.size else None,
            "f": f if whole else f[inside],
            "w": w,
            "mu": contacts.mu,
            "b": b[rows] if rows.size else None,
            "spacedim": d,
            "info": info or _core.ProblemInfo(),
        }
        problem: _laws.Global
        if contacts.mu_s is not None:
            # sliding and spin share their limit; with rolling each has its own
            coupled = int(contacts.mu_r is None)
            problem = _core.GlobalSpinProblem(
                **fields, mu_s=contacts.mu_s, mu_r=contacts.mu_r, coupled=coupled
            )
        elif contacts.mu_r is None:
            problem = _core.GlobalProblem(**fields)
        else:
            problem = _core.GlobalRollingProblem(**fields, mu_r=contacts.mu_r)

        number = np.arange(len(v)) if given is None else kept[kept < len(v)]

        def free() -> Vector:
            velocity = np.zeros_like(v)
            if given is not None:
                velocity[given.dof] = given.velocity
            if apart.size:
                others = np.setdiff1d(np.arange(len(b)), rows)
                velocity[number[apart]] = free_velocity(
                    all_M[apart][:, apart], all_G[apart][:, others], f[apart], b[others]
                )
            return velocity

        return StepProblem(problem, contacts, number[inside[inside < len(number)]], free)

    def seen(
        self, interaction: npt.NDArray[np.int64], middle: Vector
    ) -> tuple[npt.NDArray[np.intp], Vector]:
        """The contacts that their interactions (nc) take, by their gaps in the middle (nc) [m].

        Also the shares of their penetrations that are undone in the step.
        """
        alert = np.array([one.alert for one in self.interactions])
        stays_open = np.array([one.law == "VEL_SGR_CLB" for one in self.interactions], dtype=bool)
        undone = np.array([one.law == "GAP_SGR_CLB" for one in self.interactions], dtype=float)
        taken = (middle <= alert[interaction]) & ~(stays_open[interaction] & (middle > 0))
        active = np.flatnonzero(taken)
        return active, undone[interaction[active]]


@dataclass(frozen=True)
class StepProblem:
    """The problem of one step, and the part that it leaves out."""

    problem: _laws.Global
    contacts: Contacts  # nc, the active ones
    # (n') degrees of freedom of the system that the problem has; its auxiliary ones follow
    dofs: npt.NDArray[np.int64]
    # (n) velocity of the others after the step, 0 at `dofs`; a call solves for it
    free: Callable[[], Vector]

    def after(self, v: Vector | None) -> Vector:
        """The velocity (n) of the whole system after the step, from that of the problem."""
        velocity = self.free()
        if v is not None:
            velocity[self.dofs] = v[: len(self.dofs)]
        return velocity


def with_dry_friction(
    dry: DryFriction,
    h: float,
    M: Sparse,
    H: Sparse,
    G: Sparse,
    f: Vector,
    w: Vector,
    contacts: Contacts,
    tree: npt.NDArray[np.int64],
) -> tuple[Sparse, Sparse, Sparse, Vector, Vector, Contacts, npt.NDArray[np.int64]]:
    """The problem's data with an auxiliary degree of freedom and a contact for each friction."""
    n, d = len(f), contacts.dimension
    k, own = len(dry.bound), dry.contacts
    starts = np.empty((k, d), dtype=np.int32)
    # N and T1; later columns have no entries
    starts[:, :1], starts[:, 1:] = dry.ends[:, :1], dry.ends[:, 1:]
    starts += H.indptr[-1]
    return (
        by_columns(
            np.concatenate((M.data, dry.mass)),
            np.concatenate((M.indices, dry.places)),
            np.concatenate((M.indptr, dry.places + (M.indptr[-1] + 1 - n))),
            (n + k, n + k),
        ),
        by_columns(
            np.concatenate((H.data, dry.values)),
            np.concatenate((H.indices, dry.rows)),
            np.concatenate((H.indptr, starts.ravel())),
            (n + k, H.shape[1] + d * k),
        ),
        by_columns(G.data, G.indices, G.indptr, (n + k, G.shape[1])),
        np.concatenate((f, -h * dry.bound)),
        np.concatenate((w, np.zeros(d * k))),
        Contacts(
            np.concatenate((contacts.pair, own.pair)),
            np.concatenate((contacts.point, own.point)),
            np.concatenate((contacts.frame, own.frame)),
            np.concatenate((contacts.gap, own.gap)),
            np.concatenate((contacts.mu, own.mu)),
            None if contacts.mu_r is None else np.concatenate((contacts.mu_r, np.zeros(k))),
            contacts.planar,
            mu_s=None if contacts.mu_s is None else np.concatenate((contacts.mu_s, np.zeros(k))),
        ),
        np.concatenate((tree, tree.take(dry.first))),
    )


def allowances(system: System, h: float, v: Vector) -> Vector:
    """The gaps (nc) [m] that count as closed: what rounding and solvers may make of gaps of 0.

    Coordinate i is assumed to be off by ROUNDINGS of a stored state, and by the share MOTION of its
    free motion in a step, h (|v_i| + h |F_i| / M_ii). Errors of solvers are also a share of that. A
    surface is off by ROUNDINGS of its own.
    """
    M, H = system.M, system.H
    own = M.indices == columns_of(M)
    free = np.abs(v) + h * np.abs(system.force) / M.data[own]
    off = ROUNDINGS * system.rounding + MOTION * h * free
    sizes = by_columns(np.abs(H.data), H.indices, H.indptr, H.shape)
    found = transposed_times(sizes, off)[0 :: system.contacts.dimension]
    if system.shape_rounding is not None:
        pair = system.contacts.pair
        shapes = np.flatnonzero(pair[:, 0] >= 0)
        found[shapes] += ROUNDINGS * system.shape_rounding[pair[shapes]].sum(axis=1)
    return found


def closing(
    pair: npt.NDArray[np.int64], middle: Vector, closed: Vector, activation: float
) -> npt.NDArray[np.intp]:
    """Which contacts are active, by their gaps in the middle of the step (nc) [m].

    A contact is active if its gap is `closed` (nc) or less. In a pair (nc x 2) with such a contact,
    contacts are also active if they are open by at most the activation.
    """
    touches = middle <= closed
    if activation > 0:
        _, which = np.unique(pair, axis=0, return_inverse=True)
        which = which.reshape(-1)
        pairs = np.zeros(len(middle), dtype=bool)
        pairs[which[touches]] = True
        touches |= pairs[which] & (middle <= activation)
    return np.flatnonzero(touches)


def keys(pair: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """A number for each pair (nc x 2), equal for equal pairs: faster to compare than rows."""
    return (pair[:, 0] << 32) + pair[:, 1]


def ends(contacts: Contacts, off: Vector) -> npt.NDArray[np.intp]:
    """Which contacts are not between others of their pair, within `off` (nc) [m].

    Reactions at the others can replace a reaction between them. Between two contacts counts in any
    pair. In a pair with many points, inside of those in the same plane counts too.
    """
    key = keys(contacts.pair)
    order = key.argsort(kind="stable")
    key = key.take(order)
    starts = np.concatenate(([True], key[1:] != key[:-1], [True])).nonzero()[0]
    counts = lengths_of(starts)
    kept = np.ones(len(key), dtype=bool)
    for count in set(counts[counts > 2].tolist()):
        own = order[starts[:-1][counts == count][:, None] + np.arange(count)]
        own = own[contacts.pair[own[:, 0], 0] >= 0]
        if count <= FACE:
            kept[own] = not_between(contacts.point[own], off[own])
            continue
        kept[own] = False
        for one in own:
            for part in corners(contacts.point[one], contacts.frame[one, 0], off[one].max()):
                which = one[part]
                kept[which] = not_between(contacts.point[which[None]], off[which[None]])[0]
    return kept.nonzero()[0]


def not_between(x: Vector, off: Vector) -> npt.NDArray[np.bool_]:
    """Which of k points (g x k x 3) are not on a line between two others, within off (g x k)."""
    count = x.shape[1]
    there = np.ones(off.shape, dtype=bool)
    first, second = np.triu_indices(count, 1)
    along = x[:, second] - x[:, first]
    squares = np.maximum((along * along).sum(axis=2), np.finfo(float).tiny)
    for i in range(count):
        arm = x[:, i, None] - x[:, first]
        share = np.clip((arm * along).sum(axis=2) / squares, 0, 1)
        far = np.linalg.norm(arm - share[:, :, None] * along, axis=2)
        others = there[:, first] & there[:, second] & (first != i) & (second != i)
        there[:, i] = ~(others & (far <= off[:, i, None])).any(axis=1)
    return there


def corners(x: Vector, normal: Vector, off: float) -> list[npt.NDArray[np.intp]]:
    """The convex hulls of points (k x 3) of one normal (k x 3) and one plane, within off [m]."""
    from scipy.spatial import ConvexHull  # the import takes a while

    size = max(float(np.ptp(x, axis=0).max()), np.finfo(float).tiny)
    turned = np.rint(normal * size / off)  # a finer turn moves no point further than `off`
    height = np.rint((x * normal).sum(axis=1) / off)
    _, group = np.unique(np.column_stack((turned, height)), axis=0, return_inverse=True)
    found = []
    for one in range(int(group.max(initial=-1)) + 1):
        own = np.flatnonzero(group.reshape(-1) == one)
        arm = x[own] - x[own].mean(axis=0)
        _, _, axes = np.linalg.svd(arm, full_matrices=False)
        flat = arm @ axes[:2].T
        if len(own) > 2 and np.ptp(flat[:, 1]) > off:
            own = own[ConvexHull(flat).vertices]
        elif len(own) > 2:
            own = own[[flat[:, 0].argmin(), flat[:, 0].argmax()]]
        found.append(own)
    return found


def linked(
    tree: npt.NDArray[np.int64], M: Sparse, H: Sparse, G: Sparse
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """The degrees of freedom linked to a contact, and the bilateral rows among them.

    Trees of bodies are kept whole, whatever part of them a contact moves. Without a contact,
    everything is kept: such a problem says that nothing touches.
    """
    n, p, trees = H.shape[0], G.shape[1], tree.max(initial=-1) + 1
    if not H.shape[1]:
        return np.arange(n), np.arange(p)
    # mark trees with contacts; inertia and bilateral rows pass the mark on
    touched = np.zeros(trees, dtype=bool)
    touched[tree[H.indices]] = True
    if not p and touched.all():
        return np.arange(n), np.arange(0)
    first, second = tree[M.indices], tree[columns_of(M)]
    between = np.flatnonzero(first != second)
    first, second = first[between], second[between]
    of_row, row = tree[G.indices], columns_of(G)
    reached = np.zeros(p, dtype=bool)
    while True:
        before = touched.sum()
        touched[first[touched[second]]] = True
        touched[second[touched[first]]] = True
        reached[row[touched[of_row]]] = True
        touched[of_row[reached[row]]] = True
        if touched.sum() == before:
            return np.flatnonzero(touched[tree]), np.flatnonzero(reached)


def free_velocity(M: Sparse, G: Sparse, f: Vector, b: Vector) -> Vector:
    """Solve M v = f + G lambda, G^T v + b = 0 for v (n)."""
    if not len(b):
        v: Vector = sp.linalg.spsolve(sp.csc_array(M), f)
        return np.atleast_1d(v)
    alone = _core.GlobalProblem(
        M=M, H=sp.csc_array((len(f), 0)), G=G, f=f, w=[], mu=[], b=b, spacedim=3
    )
    return np.asarray(_solve.solve(alone).solution.v)


def rows_of(matrix: Sparse, new: npt.NDArray[np.int32]) -> Sparse:
    """The rows of a matrix that have a new number (-1: they are left out)."""
    entry = new.take(matrix.indices)
    kept = entry >= 0
    starts = np.concatenate(([0], np.cumsum(kept)))[matrix.indptr].astype(np.int32)
    shape = (int((new >= 0).sum()), matrix.shape[1])
    return by_columns(matrix.data[kept], entry[kept], starts, shape)


def block_columns(blocks: npt.NDArray[np.intp], d: int) -> npt.NDArray[np.intp]:
    """The columns (d nc) of the given contacts (nc)."""
    columns: npt.NDArray[np.intp] = (d * blocks[:, None] + np.arange(d)).ravel()
    return columns
