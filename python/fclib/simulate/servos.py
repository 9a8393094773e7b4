"""Actuators with feedback of their own length and speed, and the limits of their forces.

A servo's force is linear in q and v, and taken at the end of the step. So it acts as a spring and a
damper. If it reaches a limit (`forcerange` of the actuator, `actuatorfrcrange` of a joint or of a
tendon) it is a constant force, without stiffness and damping:

    f = clip(f_0 - kp (l' - l) - kv (l'_t - l_t))     l, l_t   length and speed, l', l'_t at the end

The motion without contacts decides which servos are at a limit at the end of the step. The step is
computed with those at a limit at the start, which gives a new set, and so on. A servo that presses
against an obstacle stays at its limit: the constant force does not lead near the end of its range.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import scipy.linalg as la
import scipy.sparse as sp

from fclib.simulate._mujoco import mujoco
from fclib.simulate.arrays import Sparse, Vector, added, diagonal, summed

Mask = npt.NDArray[np.bool_]

# largest number of steps without contacts: each changes the set of servos at a limit. One or two
# suffice, except if servos act on each other
PASSES: Final = 8
FEW: Final = 200  # up to so many degrees of freedom a full matrix is faster


@dataclass(frozen=True)
class Held:
    """The actuators at a limit, and the resulting forces."""

    outputs: Mask  # (k) the outputs of actuators
    dofs: Mask  # (n) joints
    force: Vector  # (k) of the outputs, within their limits
    joint: Vector  # (n) of the joints, within theirs

    def after(self, before: Held) -> Held:
        """The same, but actuators that were at the opposite limit before are now at none."""
        crossed = before.outputs & (np.sign(self.force) != np.sign(before.force))
        passed = before.dofs & (np.sign(self.joint) != np.sign(before.joint))
        return replace(self, outputs=self.outputs & ~crossed, dofs=self.dofs & ~passed)

    def same(self, other: Held) -> bool:
        """Whether the same ones are at the same limits."""
        return all(
            np.array_equal(here, there)
            and np.array_equal(np.sign(mine[here]), np.sign(theirs[there]))
            for here, there, mine, theirs in (
                (self.outputs, other.outputs, self.force, other.force),
                (self.dofs, other.dofs, self.joint, other.joint),
            )
        )


class Servos:
    """The actuators of a model."""

    def __init__(self, m: Any) -> None:
        """Limits of actuators with feedback are moved here from the model, which then has none."""
        self.model = m
        # the actuator of each output
        owner = np.repeat(np.arange(len(m.actuator_outnum)), m.actuator_outnum)
        bits = mujoco.mjtDisableBit
        affine = m.actuator_biastype[owner] == mujoco.mjtBias.mjBIAS_AFFINE
        group = m.actuator_group[owner]  # those from 0 to 30 can be disabled
        off = (m.opt.disableactuator >> np.clip(group, 0, 30)) & 1
        affine &= (off == 0) | (group < 0) | (group > 30)
        if m.opt.disableflags & bits.mjDSBL_ACTUATION:
            affine[:] = False
        # the bias of an actuator is p0 + p1 length + p2 velocity; positive feedback stays explicit
        bias = m.actuator_biasprm[owner]
        self.stiffness = np.where(affine, np.maximum(-bias[:, 1], 0), 0.0)  # (k) kp
        self.damping = np.where(affine, np.maximum(-bias[:, 2], 0), 0.0)  # (k) kv

        count = len(owner)
        limited = m.actuator_forcelimited[owner].astype(bool)
        self._range = np.where(limited[:, None], m.actuator_forcerange[owner], (-np.inf, np.inf))
        pulls = m.actuator_trntype[owner] == mujoco.mjtTrn.mjTRN_TENDON
        self._tendon = np.where(pulls, m.actuator_trnid[owner, 0], -1)
        limited_tendon = m.tendon_actfrclimited.astype(bool)
        self._tendons = [
            (np.flatnonzero(self._tendon == t), m.tendon_actfrcrange[t].copy())
            for t in np.flatnonzero(limited_tendon)
        ]
        plain = np.isin(m.jnt_type, (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE))
        joints = np.flatnonzero(plain & m.jnt_actfrclimited.astype(bool))
        self._joint_range = np.tile((-np.inf, np.inf), (m.nv, 1))
        self._joint_range[m.jnt_dofadr[joints]] = m.jnt_actfrcrange[joints]
        feeds = bool((self.stiffness + self.damping).any())
        limits = limited.any() or any(len(own) for own, _ in self._tendons) or joints.size
        self.limited = bool(feeds and count and limits)
        if self.limited:
            m.actuator_forcelimited[:] = 0
            m.tendon_actfrclimited[:] = 0
            m.jnt_actfrclimited[joints] = 0

    @property
    def feed_back(self) -> bool:
        """Whether any actuator has a stiffness or a damping; these change with the moments."""
        return bool((self.stiffness + self.damping).any())

    def linear(self, d: Any, held: Held | None = None) -> tuple[Sparse, Sparse]:
        """Damping and stiffness (n x n) of joints, and of servos at no limit.

        Both symmetric and positive semidefinite. Parts that the scene disables are left out.
        """
        m, bits = self.model, mujoco.mjtDisableBit
        disabled = m.opt.disableflags
        # springs of hinges and slides; those of balls and free bodies turn with the frame
        plain = np.isin(m.jnt_type, (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE))
        springs = np.zeros(m.nv)
        springs[m.jnt_dofadr[plain]] = m.jnt_stiffness[plain]
        damping = m.dof_damping
        if disabled & bits.mjDSBL_SPRING:
            springs[:] = 0
        if disabled & bits.mjDSBL_DAMPER:
            damping = np.zeros(m.nv)
        return (
            self._with_servos(d, damping, self.damping, held),
            self._with_servos(d, springs, self.stiffness, held),
        )

    def _with_servos(self, d: Any, own: Vector, gain: Vector, held: Held | None) -> Sparse:
        """A diagonal (n), plus the outer products of the rows of moments times their gains (k)."""
        n = len(own)
        acting = np.flatnonzero(gain if held is None else gain * ~held.outputs)
        places, values = [], []
        for k in acting.tolist():
            columns, moment = moments(d, k)
            if held is not None:
                moves = ~held.dofs[columns]
                columns, moment = columns[moves], moment[moves]
            places.append((columns[:, None] * n + columns).ravel())
            values.append((moment[:, None] * (moment * gain[k])).ravel())
        if not places:
            return diagonal(own)
        products = summed(np.concatenate(values), np.concatenate(places), (n, n))
        return added(diagonal(own), 1.0, products)

    def within_limits(self, d: Any, h: float, M: Sparse, other: Vector) -> tuple[Vector, Held]:
        """The force (n) of all actuators in a step, and those of them at a limit.

        h       of the step [s]
        other   (n) all other forces
        """
        moment = moment_matrix(d, self.model.nv)
        raw, v = d.actuator_force.copy(), d.qvel
        # actuators that compensate gravity
        rest = d.qfrc_actuator - moment.T @ raw
        held = self._clipped(raw, moment, rest)
        for _ in range(PASSES):
            force = self._force(raw, held, moment, rest)
            C, K = self.linear(d, held)
            A = added(added(M, h, C), h * h, K)
            after = v + solved(A, h * (other + force - h * (K @ v)))
            reached = raw - self.stiffness * (moment @ (h * after))
            reached -= self.damping * (moment @ (after - v))
            found = self._clipped(reached, moment, rest).after(held)
            if found.same(held):
                break
            held = found
        return self._force(raw, held, moment, rest), held

    def _clipped(self, raw: Vector, moment: Any, rest: Vector) -> Held:
        """Forces (k) within their limits: of tendons, then actuators, then joints."""
        force, outputs = raw.copy(), np.zeros(len(raw), dtype=bool)
        for own, (low, high) in self._tendons:
            total = force[own].sum()
            if total <= low or total >= high:
                bound = low if total <= low else high
                force[own] *= bound / total if total else 0.0
                outputs[own] = True
        low, high = self._range.T
        outputs |= (force <= low) | (force >= high)
        force = np.clip(force, low, high)
        joint = moment.T @ force + rest
        low, high = self._joint_range.T
        return Held(outputs, (joint <= low) | (joint >= high), force, np.clip(joint, low, high))

    def _force(self, raw: Vector, held: Held, moment: Any, rest: Vector) -> Vector:
        """The force (n) at the start of the step; actuators at a limit have that limit."""
        force = moment.T @ np.where(held.outputs, held.force, raw) + rest
        return np.where(held.dofs, held.joint, force)


def moments(d: Any, k: int) -> tuple[npt.NDArray[np.int64], Vector]:
    """The entries of the row of moments of an output: degrees of freedom, and values."""
    row = slice(d.moment_rowadr[k], d.moment_rowadr[k] + d.moment_rownnz[k])
    return d.moment_colind[row].astype(np.int64), d.actuator_moment[row]


def moment_matrix(d: Any, n: int) -> Any:
    """The moments of all outputs (k x n)."""
    own = [moments(d, k) for k in range(len(d.moment_rownnz))]
    matrix = np.zeros((len(own), n))
    for row, (columns, values) in zip(matrix, own, strict=True):
        row[columns] = values
    return matrix


def solved(A: Sparse, b: Vector) -> Vector:
    """A^-1 b for a symmetric positive definite matrix A."""
    x: Any
    if A.shape[0] <= FEW:
        x = la.solve(A.toarray(), b, assume_a="pos", check_finite=False)
    else:
        x = sp.linalg.spsolve(sp.csc_array(A), b)
    found: Vector = np.atleast_1d(x)
    return found
