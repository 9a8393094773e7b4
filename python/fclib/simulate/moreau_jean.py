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

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib import _core, _geometry, _laws, _solve
from fclib.scenes import Law
from fclib.scenes.shared.interaction import Interaction
from fclib.simulate.arrays import Sparse, Vector, matrix_of, transposed_times

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

    def __getitem__(self, which: npt.NDArray[np.int64]) -> Contacts:
        return self.chosen(which)

    def chosen(
        self, which: npt.NDArray[np.int64] | None = None, others: Contacts | None = None
    ) -> Contacts:
        """Those of some numbers, or all, and others after them, which have no interactions."""
        mine = (self.pair, self.point, self.frame, self.gap, self.mu, self.mu_r, self.mu_s)
        theirs = None
        if others is not None:
            theirs = (
                others.pair,
                others.point,
                others.frame,
                others.gap,
                others.mu,
                others.mu_r,
                others.mu_s,
            )
        pair, point, frame, gap, mu, mu_r, mu_s = _core.rows_of(mine, which, theirs)
        interaction = None
        if self.interaction is not None and others is None:
            interaction = self.interaction if which is None else self.interaction[which]
        return Contacts(pair, point, frame, gap, mu, mu_r, self.planar, interaction, mu_s)

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

    @functools.cached_property
    def contacts(self) -> Contacts:
        """The contacts (k) that each step adds: N the auxiliary velocity, T1 the joint's."""
        k = len(self.bound)
        return Contacts(self.pair, np.zeros((k, 3)), np.zeros((k, 3, 3)), np.zeros(k), np.ones(k))


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
        active: npt.NDArray[Any] | None = None
        w_n: Vector
        if self.law == "velocity":
            active, w_n = self.touching(system, v)
        else:
            middle = contacts.gap
            if self.theta < 1:
                middle = middle + (1 - self.theta) * h * transposed_times(H, v)[0::d]
            undone: Vector | float = self.stabilization
            if contacts.interaction is not None:
                active, undone = self.seen(contacts.interaction, middle)
                middle = middle[active]
            share = np.where(middle > 0, 1.0, undone)
            w_n = share * middle / h
        if active is not None and len(active) == len(contacts):
            active = None
        dry = None if system.dry is None else system.dry.contacts
        if active is not None or dry is not None:
            contacts = contacts.chosen(active, dry)

        problem, dofs, touching, rest = _core.step_problem(
            d,
            h,
            self.theta,
            system.M,
            system.C,
            system.K,
            H,
            system.G,
            system.force,
            v,
            system.violation,
            self.stabilization / h,
            w_n,
            active,
            system.tree,
            system.dry,
            system.driven,
            self.all_bodies,
            contacts.mu,
            contacts.mu_r,
            contacts.mu_s,
            info or _core.ProblemInfo(),
        )
        if touching is not None:
            contacts = contacts[touching]
        if dofs is None:
            dofs = all_of(len(v))

        if rest is None and system.driven is None:
            return StepProblem(problem, contacts, dofs, None)

        def free() -> Vector:
            velocity = np.zeros_like(v)
            if system.driven is not None:
                velocity[system.driven.dof] = system.driven.velocity
            if rest is not None:
                M, G, f, b, others = rest
                n = len(f)
                velocity[others] = free_velocity(
                    matrix_of(M, (n, n)), matrix_of(G, (n, len(b))), f, b
                )
            return velocity

        return StepProblem(problem, contacts, dofs, free)

    def touching(self, system: System, v: Vector) -> tuple[npt.NDArray[np.int64], Vector]:
        """The active contacts by the velocity law, and their w_N = e u_N^-."""
        contacts, surface = system.contacts, system.shape_rounding
        active, w_n, crowded = _core.active_contacts(
            system.H,
            system.M,
            v,
            system.force,
            contacts.pair,
            contacts.point,
            contacts.gap,
            contacts.dimension,
            self.h,
            self.allowance,
            ROUNDINGS * system.rounding,
            MOTION,
            None if surface is None else ROUNDINGS * surface,
            self.activation,
            FACE,
            self.restitution,
        )
        if crowded:
            kept = np.ones(len(active), dtype=bool)
            for own, off in crowded:
                which = active[own]
                kept[own] = outer(contacts.point[which], contacts.frame[which, 0], off)
            active, w_n = active[kept], w_n[kept]
        return active, w_n

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
    # (n) velocity of the others after the step, 0 at `dofs`; a call solves for it. None: no others
    free: Callable[[], Vector] | None

    def after(self, v: Vector | None) -> Vector:
        """The velocity (n) of the whole system after the step, from that of the problem."""
        own = np.zeros(0) if v is None else v[: len(self.dofs)]
        if self.free is None:
            return own.copy()
        velocity = self.free()
        velocity[self.dofs] = own
        return velocity


def outer(x: Vector, normal: Vector, off: Vector) -> npt.NDArray[np.bool_]:
    """Which of many points (k x 3) of a pair are corners, within off (k) [m].

    In a pair with many points, inside of those in the same plane counts as between.
    """
    kept = np.zeros(len(x), dtype=bool)
    for which in corners(x, normal, off.max()):
        kept[which] = _core.not_between(x[which], off[which])
    return kept


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


def free_velocity(M: Sparse, G: Sparse, f: Vector, b: Vector) -> Vector:
    """Solve M v = f + G lambda, G^T v + b = 0 for v (n)."""
    if not len(b):
        return _core.solution_of(M, f)
    alone = _core.GlobalProblem(
        M=M, H=sp.csc_array((len(f), 0)), G=G, f=f, w=[], mu=[], b=b, spacedim=3
    )
    return np.asarray(_solve.solve(alone).solution.v)


@functools.lru_cache(maxsize=64)
def all_of(count: int) -> npt.NDArray[np.int64]:
    """The numbers from 0; not to be changed."""
    numbers = np.arange(count)
    numbers.flags.writeable = False
    return numbers


def block_columns(blocks: npt.NDArray[np.intp], d: int) -> npt.NDArray[np.intp]:
    """The columns (d nc) of the given contacts (nc)."""
    columns: npt.NDArray[np.intp] = (d * blocks[:, None] + np.arange(d)).ravel()
    return columns
