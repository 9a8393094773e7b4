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

from typing import Any

import numpy as np

from fclib import _core
from fclib.simulate._mujoco import mujoco
from fclib.simulate.arrays import Sparse, Vector, matrix_of


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
        bounds = m.actuator_forcerange[owner]
        # (k) limits of each output
        self.low = np.where(limited, bounds[:, 0], -np.inf)
        self.high = np.where(limited, bounds[:, 1], np.inf)
        pulls = m.actuator_trntype[owner] == mujoco.mjtTrn.mjTRN_TENDON
        tendon = np.where(pulls, m.actuator_trnid[owner, 0], -1)
        # the outputs that pull a tendon, and the limits of their sum
        self.tendons = [
            (np.flatnonzero(tendon == t).astype(np.int64), *m.tendon_actfrcrange[t].tolist())
            for t in np.flatnonzero(m.tendon_actfrclimited)
        ]
        # springs of hinges and slides; those of balls and free bodies turn with the frame
        plain = np.isin(m.jnt_type, (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE))
        joints = np.flatnonzero(plain & m.jnt_actfrclimited.astype(bool))
        # (n) limits of all actuators in a joint
        self.joint_low, self.joint_high = np.full(m.nv, -np.inf), np.full(m.nv, np.inf)
        self.joint_low[m.jnt_dofadr[joints]] = m.jnt_actfrcrange[joints, 0]
        self.joint_high[m.jnt_dofadr[joints]] = m.jnt_actfrcrange[joints, 1]
        # (n) of the joints themselves
        self.springs, self.dampers = np.zeros(m.nv), np.zeros(m.nv)
        if not m.opt.disableflags & bits.mjDSBL_SPRING:
            self.springs[m.jnt_dofadr[plain]] = m.jnt_stiffness[plain]
        if not m.opt.disableflags & bits.mjDSBL_DAMPER:
            self.dampers[:] = m.dof_damping
        feeds = bool((self.stiffness + self.damping).any())
        limits = limited.any() or any(len(own) for own, *_ in self.tendons) or joints.size
        self.limited = bool(feeds and count and limits)
        if self.limited:
            m.actuator_forcelimited[:] = 0
            m.tendon_actfrclimited[:] = 0
            m.jnt_actfrclimited[joints] = 0

    @property
    def feed_back(self) -> bool:
        """Whether any actuator has a stiffness or a damping; these change with the moments."""
        return bool((self.stiffness + self.damping).any())

    def linear(self, d: Any) -> tuple[Sparse, Sparse]:
        """Damping and stiffness (n x n) of joints and servos, if none is at a limit.

        Both symmetric and positive semidefinite. Parts that the scene disables are left out.
        """
        C, K = _core.servo_matrices(self, d)
        return self._matrices(C, K)

    def within_limits(
        self, d: Any, h: float, M: Sparse, other: Vector
    ) -> tuple[Vector, tuple[Sparse, Sparse]]:
        """The force (n) of all actuators in a step, damping and stiffness without those at a limit.

        h       of the step [s]
        other   (n) all other forces
        """
        force, C, K = _core.servo_forces(self, d, h, M, other)
        return force, self._matrices(C, K)

    def _matrices(self, C: Any, K: Any) -> tuple[Sparse, Sparse]:
        n = len(self.springs)
        return matrix_of(C, (n, n)), matrix_of(K, (n, n))
