"""MuJoCo as the source of kinematics, inertia, forces and collisions.

MuJoCo's rows of the constraint Jacobian are the columns of H and G: the three rows of a contact
are N, T1, T2 of its frame, N points from its first geometry to its second, and J v is the
velocity of the second relative to the first. A row of an equality is the rate of the violation
`efc_pos`. MuJoCo's own solver, its soft contacts and its integrator are not used.

A limit of a joint or a tendon is a contact without friction: its row is N, its tangents are zero,
and its pair is (-1 - kind, index); the same holds for dry friction. Contacts of condim 6 make
rolling problems. If a coefficient of torsion is not 0, they are problems of spin, with or without
rolling.

The configuration is q, then the states of actuators, which MuJoCo's own rates advance, then other
values on which forces depend: the time if the scene has a gait (`mujoco_scene.py`) or drives, and
the controls if they come from outside.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib import _core
from fclib.scenes import Scene
from fclib.scenes.shared.condim import has_condim, spins
from fclib.simulate._mujoco import mujoco
from fclib.simulate.arrays import (
    Sparse,
    Vector,
    lengths_of,
    matrix_of,
    pointers,
    submatrix,
    without_zeros,
)
from fclib.simulate.drives import Drives
from fclib.simulate.equalities import Equalities
from fclib.simulate.faces import complete_faces
from fclib.simulate.moreau_jean import ROUNDINGS, Contacts, DryFriction, System, block_columns
from fclib.simulate.mujoco_scene import (
    DYNAMICS,
    Gait,
    UnsupportedSceneError,
    cannot_touch,
    compile_scene,
    keyframe_of,
    left_out,
    periodic_cell,
    refuse_limits,
    refuse_out_of_plane,
    refuse_unknown,
)
from fclib.simulate.plane import in_plane
from fclib.simulate.rounding import exponent_of
from fclib.simulate.servos import Servos
from fclib.simulate.terrain import CrowdedPairError, complete

REACH: Final = 1e10  # limits count at any distance [rad] or [m]
LEAST_MU: Final = 1e-5  # least friction of a contact, mjMINMU: MuJoCo's own solver uses it for 0
# MuJoCo's numbers; its enumerations are slow
FRICTION_DOF, FRICTION_TENDON = (
    int(getattr(mujoco.mjtConstraint, f"mjCNSTR_{name}"))
    for name in ("FRICTION_DOF", "FRICTION_TENDON")
)
CONTACTS_FULL, ROWS_FULL, SINGULAR = (
    int(getattr(mujoco.mjtWarning, f"mjWARN_{name}"))
    for name in ("CONTACTFULL", "CNSTRFULL", "INERTIA")
)


class MujocoModel:
    """A `ContactModel` made of an MJCF scene."""

    def __init__(self, scene: Scene, *, strict: bool = False) -> None:
        """ValueError if the MJCF is wrong.

        Unsupported features are left out, and named in `left_out`. With `strict` they raise
        UnsupportedSceneError.
        """
        self.scene = scene
        self.model: Any
        self.model, dropped = compile_scene(scene)
        self.data: Any = mujoco.MjData(self.model)
        self._warned = self.data.warning.number  # a view
        self.left_out = (*scene.left_out, *left_out(scene, self.model), *dropped)
        self.untouchable = cannot_touch(self.model)  # the reason, in words
        if strict:
            refuse_unknown(scene, self.left_out)
        if scene.planar:
            refuse_out_of_plane(scene, self.model, self.data)

        m = self.model
        self._drives = Drives.of(scene.name, scene.drives, m.nv)
        if scene.interactions:
            refuse_limits(scene, m)
        self._meetings = Meetings.of(scene, m) if scene.interactions else None
        self._cell = None if scene.period is None else periodic_cell(scene, m)
        self._margin = m.geom_margin.copy()
        self._pair_margin = m.pair_margin.copy()
        self._gravity = float(np.linalg.norm(m.opt.gravity))
        # the speed of each geometry
        self._body = m.geom_bodyid.astype(np.intp)
        self._root = m.body_rootid[self._body].astype(np.intp)
        # geometries follow each other body by body
        self._owners = np.flatnonzero(m.body_geomnum)
        self._first = m.body_geomadr[self._owners].astype(np.intp)
        self._pattern = mass_pattern(m)
        self._ties = Equalities(m)
        self._rounding = 2.0 ** exponent_of(self.smallest_size)
        # vertices of meshes and heights of fields are floats of 32 bits
        single = np.isin(m.geom_type, (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_HFIELD))
        single_eps = float(np.finfo(np.float32).eps)
        shape_rounding = single_eps * np.where(single, m.geom_rbound, 0.0)
        self._shape_rounding = shape_rounding if single.any() else None
        # what a geometry's margin has beside its motion: half of the activation, ...
        self._slack = np.full(m.ngeom, 0.5 * scene.activation)
        if self._meetings:
            self._slack += self._meetings.alert
        if scene.allowance:
            # gaps that rounding opens, from the lengths that it turns
            self._slack += ROUNDINGS * (self._rounding * (1 + m.geom_rbound) + shape_rounding)
        self._flat = bool((m.geom_type == mujoco.mjtGeom.mjGEOM_MESH).any())
        self._trees: npt.NDArray[np.int64] = m.dof_treeid.astype(np.int64)
        self._servos = Servos(m)
        # these never change with the configuration if no actuator has feedback
        self._linear = None if self._servos.feed_back else self._servos.linear(self.data)
        # nor does that of joints alone
        self._dry: DryFriction | None = None
        self._rubbing_tendons = bool(m.tendon_frictionloss.any())
        self._frictionless = has_condim(m, 1)
        self.rolling = has_condim(m, 6)
        # nothing spins in the plane
        self.spin = spins(m) and not scene.planar and "torsion" not in scene.ignore
        # make every detected contact give rows
        m.geom_gap[:] = 0
        m.pair_gap[:] = 0
        m.jnt_margin[:] = REACH
        m.tendon_margin[:] = REACH
        # MuJoCo's own step keeps the earlier controls
        m.actuator_delay[:] = 0

        self._gait = Gait.of_scene(scene, m)
        self.controlled = False  # controls come from outside: they are part of the configuration
        self.keyframe = keyframe_of(scene, m)
        if self.keyframe:
            mujoco.mj_resetDataKeyframe(m, self.data, m.key(self.keyframe).id)
        start = (self.data.qpos, self.data.qvel, m.opt.gravity)
        if not all(np.isfinite(part).all() for part in start):
            raise ValueError(
                f"{scene.name}: a position, a velocity or gravity at the start is not finite"
            )
        if self._drives:
            if self._gait:
                raise ValueError(f"{scene.name}: has drives and a gait, of which one is known")
            self._drives.begin(self.data.qvel, 0.0)
        if m.na:
            # MuJoCo's data for the rates of actuators
            m.opt.timestep = self.time_step
        if self._cell:
            self._cell.wrap(m, self.data.qpos)

    @property
    def time_step(self) -> float:
        """Step h [s]: the scene's, or the MJCF file's if the scene names none."""
        return float(self.scene.time_step or self.model.opt.timestep)

    @property
    def position(self) -> Vector:
        """Configuration (q, states of actuators, time, controls), a copy."""
        d = self.data
        if not self.model.na and not self.timed and not self.controlled:
            own: Vector = d.qpos.copy()
            return own
        parts = [d.qpos, d.act]
        if self.timed:
            parts.append([d.time])
        if self.controlled:
            parts.append(d.ctrl)
        return np.concatenate(parts)

    @property
    def coordinates(self) -> int:
        """The number of entries of `position` of bodies; the later ones stay if bodies move."""
        return int(self.model.nq)

    @property
    def timed(self) -> bool:
        """Whether forces or velocities depend on the time."""
        return self._gait is not None or self._drives is not None

    @property
    def has_gait(self) -> bool:
        """Whether the scene itself gives its controls at each time."""
        return self._gait is not None

    @property
    def velocity(self) -> Vector:
        """Velocity v (n), a copy."""
        v: Vector = self.data.qvel.copy()
        return v

    @property
    def trees(self) -> npt.NDArray[np.int64]:
        """The body, or tree of bodies, of each degree of freedom (n)."""
        return self._trees

    @property
    def smallest_size(self) -> float | None:
        """The smallest radius of a moving geometry about its centre [m]; 1 if none moves."""
        m = self.model
        moving = (m.body_weldid[m.geom_bodyid] > 0) & (m.geom_rbound > 0)
        return float(m.geom_rbound[moving].min()) if moving.any() else 1.0

    def assemble(self, h: float, *, shared_speed: bool = False) -> System:
        """The system at (q, v), with every contact that may close within h.

        Raises MemoryError if MuJoCo's arena is too small, and UnsupportedSceneError if a contact of
        a planar scene leaves the plane.
        """
        m, d = self.model, self.data
        if self._cell:
            self._cell.place(m, d)
        mujoco.mj_kinematics(m, d)
        mujoco.mj_comPos(m, d)
        if m.ntendon:
            mujoco.mj_tendon(m, d)
        mujoco.mj_makeM(m, d)
        mujoco.mj_factorM(m, d)
        mujoco.mj_comVel(m, d)
        self._set_reach(h, shared_speed)
        mujoco.mj_collision(m, d)
        if m.nhfield:
            self._complete_terrain()
        if self.scene.allowance and self._flat:
            complete_faces(m, d)
        if self._frictionless:
            frictionless_to_frictional(d)
        mujoco.mj_makeConstraint(m, d)
        self._check_warnings()

        rows: Sparse | None = None
        if self._cell:
            rows = sp.csc_array(jacobian(m, d) + self._cell.rows(m, d).T)
        H, contacts = contact_columns(self, rows)
        if self.scene.planar:
            geometries = np.where(contacts.pair[:, :1] < 0, 0, contacts.pair)
            sizes = m.geom_rbound[geometries].max(axis=1)
            try:
                H, contacts = in_plane(H, contacts, sizes)
            except ValueError as error:
                raise UnsupportedSceneError(f"{self.scene.name}: {error}") from None
        if self._cell:
            # such a scene has no limits: all pairs are geometries
            contacts = replace(contacts, pair=self._cell.geometry[contacts.pair])
        if self._meetings:
            kept, contacts = self._meetings.taken(contacts)
            H = submatrix(H, block_columns(kept, contacts.dimension))
        G, violation = self._ties.columns(d)
        if self._gait:
            # at the end of the step, as its springs are
            d.ctrl[:] = self._gait.controls(d.time + h)
        M = self._pattern.fill(d.M)
        force, linear = self._force(h, M)
        driven = None
        if self._drives:
            force = force + self._drives.force(d.time, h, self.scene.theta)
            driven = self._drives.driven(d.time + h)
        C, K = linear or self._linear or self._servos.linear(d)
        if d.nf and (self._dry is None or self._rubbing_tendons):
            self._dry = dry_friction(m, d)
        if self.scene.gyroscopic:
            C = sp.csc_array(C + gyroscopic(m, d))
        return System(
            M,
            force,
            C,
            K,
            H,
            contacts,
            G,
            violation,
            self.trees,
            self._dry,
            self._rounding,
            self._shape_rounding,
            driven,
        )

    def equalities(self) -> tuple[list[str], Vector]:
        """Names (p) and rounding (p) [m, rad] of the columns of G at the last assembly.

        The rounding is the largest rounding error of each violation.
        """
        return self._ties.of_columns(self.data)

    def control(self, values: Any) -> None:
        """Set the controls (nu); they stay until they are set again.

        ValueError if their number is wrong, or one is not finite.
        """
        values = np.asarray(values, dtype=float)
        if values.shape != self.data.ctrl.shape:
            raise ValueError(
                f"{self.scene.name}: has {self.model.nu} controls, and those given have the shape"
                f" {values.shape}"
            )
        if not np.isfinite(values).all():
            raise ValueError(
                f"{self.scene.name}: controls must be finite, and those given are {values.tolist()}"
            )
        self.controlled = True
        self.data.ctrl[:] = values

    def set_state(self, position: Vector, velocity: Vector) -> None:
        """Take a configuration, as `position` gives it, and a velocity v (n)."""
        m, d = self.model, self.data
        own, act, rest = np.split(position, [m.nq, m.nq + m.na])
        d.qpos[:], d.act[:] = own, act
        if self.timed:
            d.time, rest = float(rest[0]), rest[1:]
        if rest.size:
            self.control(rest)
        d.qvel[:] = velocity
        if self._cell:
            self._cell.wrap(self.model, self.data.qpos)

    def integrate(self, h: float, v: Vector, theta: float = 1.0) -> None:
        """Take v (n) as the velocity, moving by h v_t, v_t = (1 - theta) of the old + theta v."""
        moved = v if theta == 1 else (1 - theta) * self.data.qvel + theta * v
        self.data.qvel[:] = v
        mujoco.mj_integratePos(self.model, self.data.qpos, moved, h)
        if self.model.na and "activation" not in self.scene.ignore:
            advance_actuators(self.model, self.data, h)
        self.data.time += h
        if self._cell:
            self._cell.wrap(self.model, self.data.qpos)

    def drawing(self, position: Vector) -> tuple[Any, Any]:
        """A copy of the MjModel, whose looks may change, and an MjData with the bodies in place."""
        m = copy.copy(self.model)
        d = mujoco.MjData(m)
        d.qpos[:] = position[: m.nq]
        return m, d

    def energy(self) -> float:
        """Kinetic plus potential energy [J] at (q, v)."""
        m, d = self.model, self.data
        mujoco.mj_fwdPosition(m, d)
        mujoco.mj_energyPos(m, d)
        mujoco.mj_energyVel(m, d)
        return float(d.energy.sum())

    def _set_reach(self, h: float, shared_speed: bool) -> None:
        """Detect contacts as far as the geometries may move within h; their margins add up."""
        m, d = self.model, self.data
        speed = _core.speeds_of(
            d.cvel, self._body, d.subtree_com, self._root, d.geom_xpos, m.geom_rbound
        )
        if shared_speed:
            speed[:] = speed.max(initial=0.0)
        if self._cell:
            speed = speed[self._cell.geometry]
        fall = h**2 * self._gravity
        reach = _core.set_margins(
            m, speed, h, fall, self._slack, self._margin, self._owners, self._first
        )
        if m.npair:
            pair = np.column_stack((m.pair_geom1, m.pair_geom2))
            m.pair_margin[:] = np.maximum(self._pair_margin, reach[pair].sum(axis=1))

    def _force(self, h: float, M: Sparse) -> tuple[Vector, tuple[Sparse, Sparse] | None]:
        """F (n): passive, actuator and applied forces minus the bias c(q, v).

        Also damping and stiffness, if servos may reach a limit within h.
        """
        m, d = self.model, self.data
        if m.nu:
            mujoco.mj_transmission(m, d)
        if m.nu or m.ntendon:
            # also sets the rates of tendons and actuators, which their damping needs
            mujoco.mj_fwdVelocity(m, d)
        else:
            mujoco.mj_passive(m, d)
            mujoco.mj_rne(m, d, 0, d.qfrc_bias)
        force, pushed = _core.other_forces(d)
        linear = None
        if m.nu:
            mujoco.mj_fwdActuation(m, d)
        if m.nu and not self._servos.limited:
            force += d.qfrc_actuator
        if pushed:
            for body in np.flatnonzero(d.xfrc_applied.any(axis=1)):
                push = d.xfrc_applied[body]
                mujoco.mj_applyFT(m, d, push[:3], push[3:], d.xipos[body], body, force)
        if self._servos.limited:
            own, linear = self._servos.within_limits(d, h, M, force)
            force += own
        return force, linear

    def _complete_terrain(self) -> None:
        try:
            complete(self.model, self.data)
        except CrowdedPairError as error:
            raise UnsupportedSceneError(f"{self.scene.name}: {error}") from None

    def _check_warnings(self) -> None:
        warned = self._warned
        if warned[CONTACTS_FULL] or warned[ROWS_FULL]:
            raise MemoryError(
                f"{self.scene.name}: MuJoCo's memory for contacts is full; raise"
                ' <size memory="..."/> in the MJCF'
            )
        if warned[SINGULAR]:
            fastest = np.abs(self.data.qvel).max(initial=0.0)
            raise ValueError(
                f"{self.scene.name}: the mass matrix is singular (the largest velocity is"
                f" {fastest:.3g}; the motion has diverged if that is huge)"
            )


@dataclass(frozen=True)
class Meetings:
    """Which geometries of a model meet, and by which interaction of its scene."""

    kind: npt.NDArray[np.int64]  # (ngeom) of each geometry, -1 for none
    number: npt.NDArray[np.int64]  # (kinds x kinds) of the interactions, -1 for none
    mu: Vector  # of each interaction
    alert: Vector  # (ngeom) half of the largest alert distance [m]

    @classmethod
    def of(cls, scene: Scene, m: Any) -> Meetings:
        """Those of a scene; the kind of a geometry is its first user value."""
        user = m.geom_user[:, 0] if m.nuser_geom else np.full(m.ngeom, -1.0)
        kinds = 1 + max(max(one.kinds) for one in scene.interactions)
        kind = np.where(user < kinds, user, -1).astype(np.int64)
        number = np.full((kinds, kinds), -1)
        alert = np.zeros(kinds)
        for i, one in enumerate(scene.interactions):
            first, second = one.kinds
            number[first, second] = number[second, first] = i
            alert[[first, second]] = np.maximum(alert[[first, second]], one.alert)
        mu = np.array([one.mu for one in scene.interactions])
        return cls(kind, number, mu, np.where(kind >= 0, 0.5 * alert[kind], 0.0))

    def taken(self, contacts: Contacts) -> tuple[npt.NDArray[np.intp], Contacts]:
        """The contacts that have an interaction, and these with its number and friction."""
        kinds = self.kind[contacts.pair]
        number = np.where(
            kinds.min(axis=1, initial=0) >= 0, self.number[kinds[:, 0], kinds[:, 1]], -1
        )
        kept = np.flatnonzero(number >= 0)
        number = number[kept]
        return kept, replace(contacts[kept], mu=self.mu[number], interaction=number)


def advance_actuators(m: Any, d: Any, h: float) -> None:
    """The states of actuators after h [s], from MuJoCo's rates at their start."""
    kinds = mujoco.mjtDyn
    for i in np.flatnonzero(np.isin(m.actuator_dyntype, DYNAMICS) & (m.actuator_actnum > 0)):
        # the state of a muscle or a filter is the last one of its states
        k = m.actuator_actadr[i] + m.actuator_actnum[i] - 1
        span = h
        if m.actuator_dyntype[i] == kinds.mjDYN_FILTEREXACT:
            tau = max(float(m.actuator_dynprm[i, 0]), 1e-15)
            span = tau * -np.expm1(-h / tau)
        d.act[k] += span * d.act_dot[k]
        if m.actuator_actlimited[i]:
            d.act[k] = np.clip(d.act[k], *m.actuator_actrange[i])


def dry_friction(m: Any, d: Any) -> DryFriction:
    """Dry friction of joints and tendons, from MuJoCo's rows."""
    rows = jacobian(m, d)
    kind = d.efc_type[: d.ne + d.nf]
    of_joints = kind == FRICTION_DOF
    which = np.flatnonzero(of_joints | (kind == FRICTION_TENDON))
    which = which[lengths_of(rows.indptr)[which] > 0]
    gradient = submatrix(rows, which)
    index = d.efc_id[which]
    joint = of_joints[which]
    inverse = np.zeros(len(which))
    inverse[joint] = m.dof_invweight0[index[joint]]
    if not joint.all():
        inverse[~joint] = m.tendon_invweight0[index[~joint]]
    return DryFriction(
        gradient=gradient,
        bound=d.efc_frictionloss[which].copy(),
        mass=1 / np.where(inverse > 0, inverse, 1.0),
        pair=np.column_stack((-1 - kind[which].astype(np.int64), index)),
    )


def gyroscopic(m: Any, d: Any) -> Sparse:
    """Gamma = dc/dv (n x n) of the bias c(q, v), not symmetric; by trees of bodies.

    c is quadratic in v, so that half the difference of c(v + e) and c(v - e) is exact. Trees do not
    act on each other, so one degree of freedom of each tree is moved at a time.
    """
    v, bias = d.qvel.copy(), np.zeros(m.nv)
    # place of each degree of freedom in its tree
    place = np.arange(m.nv) - m.tree_dofadr[m.dof_treeid]
    rows, columns, values = [], [], []
    for k in range(place.max(initial=-1) + 1):
        derivative = np.zeros(m.nv)
        for sign in (0.5, -0.5):
            d.qvel[:] = v + 2 * sign * (place == k)
            mujoco.mj_comVel(m, d)
            mujoco.mj_rne(m, d, 0, bias)
            derivative += sign * bias
        moved = np.flatnonzero(derivative)
        rows.append(moved)
        columns.append(m.tree_dofadr[m.dof_treeid[moved]] + k)
        values.append(derivative[moved])
    d.qvel[:] = v
    mujoco.mj_comVel(m, d)
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sp.csc_array(entries, shape=(m.nv, m.nv))


def frictionless_to_frictional(d: Any) -> None:
    """Give a contact of condim 1 its tangential rows, and mu = 0: the same law, K = {r_T = 0}."""
    frictionless = d.contact.dim == 1
    if frictionless.any():
        d.contact.dim[frictionless] = 3
        d.contact.friction[frictionless] = 0


@dataclass(frozen=True)
class MassPattern:
    """The places of the entries of MuJoCo's M, which keeps the lower triangle, by rows."""

    entries: npt.NDArray[np.int64]  # (nnz) of MuJoCo's M, with those of the upper triangle
    rows: npt.NDArray[np.int32]  # (nnz) by columns
    pointers: npt.NDArray[np.int32]  # (n + 1) of the columns

    def fill(self, values: Vector) -> Sparse:
        """M (n x n), by columns and without explicit zeros."""
        n = len(self.pointers) - 1
        arrays = _core.chosen_entries(values, self.entries, self.rows, self.pointers)
        return matrix_of(arrays, (n, n))


def mass_pattern(m: Any) -> MassPattern:
    """The pattern of a model's M, upper triangle included."""
    i = np.repeat(np.arange(m.nv), m.M_rownnz)
    j = m.M_colind
    upper = np.flatnonzero(i != j)
    rows, columns = np.append(i, j[upper]), np.append(j, i[upper])
    order = np.lexsort((rows, columns))
    return MassPattern(
        entries=np.append(np.arange(len(i)), upper)[order],
        rows=rows[order].astype(np.int32),
        pointers=pointers(np.bincount(columns, minlength=m.nv)),
    )


def jacobian(m: Any, d: Any) -> Sparse:
    """All of MuJoCo's constraint rows, as columns (n x nefc), without its explicit zeros."""
    starts = pointers(d.efc_J_rownnz)
    entries, shape = slice(starts[-1]), (m.nv, len(starts) - 1)
    return without_zeros(d.efc_J[entries], d.efc_J_colind[entries], starts, shape)


def contact_columns(source: MujocoModel, rows: Sparse | None) -> tuple[Sparse, Contacts]:
    """H (n x d nc) and the contacts that give rows: all except those between fixed bodies.

    The limits of joints and tendons come after the contacts. `rows` (n x nefc) are MuJoCo's rows,
    if others were added to them.
    """
    m, d = source.model, source.data
    if rows is None:
        lengths, columns, values = d.efc_J_rownnz, d.efc_J_colind, d.efc_J
    else:
        lengths = lengths_of(rows.indptr).astype(np.int32, copy=False)
        columns, values = rows.indices.astype(np.int32, copy=False), rows.data
    H, pair, point, frame, gap, mu, mu_r, mu_s = _core.contact_table(
        d, d.contact, lengths, columns, values, m.nv, source.spin, source.rolling, LEAST_MU
    )
    contacts = Contacts(pair, point, frame, gap, mu, mu_r, mu_s=mu_s)
    shape = (m.nv, contacts.dimension * len(contacts))
    return matrix_of(H, shape), contacts
