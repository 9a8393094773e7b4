"""PyBullet: a step of its rigid bodies. The engine has no way to stop within a step, so the adapter
takes the step itself: `stepSimulation` is part of it.

Bullet keeps the contacts of a step as they were at its start, with the forces that it found.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Sequence
from typing import Any

import numpy as np

from fclib import _core
from fclib.recorders._assemble import Contacts, assemble
from fclib.recorders._recorded import EXACT, Recorded, SetupError, checked


def pybullet(client: int, bodies: Sequence[int] | None = None, h: float | None = None) -> Recorded:
    """Take one step, and return its problem.

    Args:
        client: result of `pybullet.connect`.
        bodies: the bodies that move; by default all with a mass.
        h: time step [s], the engine's own.

    Raises:
        ImportError: pybullet is not installed.
        ValueError: h is another one, or a step has parts: substeps, joints, constraints, bodies
            that move and are not among `bodies`, or contacts that resist rolling or spin.
    """
    return record(importlib.import_module("pybullet"), client, bodies, h)


def record(
    p: Any, client: int, bodies: Sequence[int] | None, h: float | None, step: Any = None
) -> Recorded:
    """As `pybullet`, for the module and its stepping function."""
    options = {"physicsClientId": client}
    if bodies is None:
        every = [p.getBodyUniqueId(i, **options) for i in range(p.getNumBodies(**options))]
        bodies = [body for body in every if p.getDynamicsInfo(body, -1, **options)[0] > 0]
    engine = p.getPhysicsEngineParameters(**options)
    if h is not None and h != engine["fixedTimeStep"]:
        raise SetupError(f"the engine's step is {engine['fixedTimeStep']:g} s, not {h:g}")
    h = float(engine["fixedTimeStep"])
    if engine["numSubSteps"] > 1:
        raise SetupError("a step of several substeps, of which Bullet tells the last contacts only")
    gravity = np.array([engine[f"gravityAcceleration{axis}"] for axis in "XYZ"])
    for i in range(p.getNumConstraints(**options)):
        known = p.getConstraintInfo(p.getConstraintUniqueId(i, **options), **options)
        if known[0] in bodies or known[2] in bodies:
            raise ValueError(f"constraint {i}: bodies without constraints are recorded")
    n = 6 * len(bodies)
    place = {body: 6 * i for i, body in enumerate(bodies)}
    M, v0, v_free = np.zeros((n, n)), np.zeros(n), np.zeros(n)
    centre: dict[int, Any] = {}
    for body, i in place.items():
        if p.getNumJoints(body, **options):
            raise SetupError(f"body {body}: has joints, and bodies without joints are recorded")
        known = p.getDynamicsInfo(body, -1, **options)
        inertial = p.getBasePositionAndOrientation(body, **options)
        # PyBullet gives the frame of the inertia
        centre[body] = np.array(inertial[0])
        turn = np.reshape(p.getMatrixFromQuaternion(inertial[1]), (3, 3))
        inertia = turn @ np.diag(known[2]) @ turn.T
        M[i : i + 3, i : i + 3] = known[0] * np.eye(3)
        M[i + 3 : i + 6, i + 3 : i + 6] = inertia
        linear, angular = (np.array(part) for part in p.getBaseVelocity(body, **options))
        v0[i : i + 3], v0[i + 3 : i + 6] = linear, angular
        gyroscopic = np.linalg.solve(inertia, np.cross(angular, inertia @ angular))
        v_free[i : i + 3] = linear + h * gravity
        v_free[i + 3 : i + 6] = angular - h * gyroscopic
    (step or p.stepSimulation)(**options)

    rows, mu, points, frames, pairs, gaps, reactions = [], [], [], [], [], [], []
    for contact in p.getContactPoints(**options):
        a, b = contact[1], contact[2]
        if a not in place and b not in place:
            continue
        normal, first, second = (np.array(contact[k]) for k in (7, 11, 13))
        # Bullet's own directions of friction; N x T1 if it gives none
        if not first.any():
            first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
            first /= np.linalg.norm(first)
        if not second.any():
            second = np.cross(normal, first)
        frame = np.stack((normal, first, second))
        J = np.zeros((3, n))
        for body, point, sign in ((a, contact[5], 1.0), (b, contact[6], -1.0)):
            if body in place:
                i = place[body]
                arm = np.array(point) - centre[body]
                J[:, i : i + 3] += sign * frame
                J[:, i + 3 : i + 6] += sign * np.cross(arm, frame)
        rows.append(J)
        own = [
            p.getDynamicsInfo(body, link, **options)
            for body, link in ((a, contact[3]), (b, contact[4]))
        ]
        for body, known in zip((a, b), own, strict=True):
            if body not in place and (known[0] > 0 or moves(p, body, options)):
                raise ValueError(f"body {body}: moves, and is not among the recorded ones")
            if known[6] > 0 or known[7] > 0:
                raise ValueError(f"body {body}: resists rolling or spin, which is not recorded")
        mu.append(own[0][1] * own[1][1])
        points.append(0.5 * (np.array(contact[5]) + np.array(contact[6])))
        frames.append(frame)
        pairs.append((b, a))
        gaps.append(contact[8])
        reactions.append(h * np.array([contact[9], contact[10], contact[12]]))
    nc = len(rows)
    w = np.zeros((nc, 3))
    w[:, 0] = np.maximum(gaps, 0) / h
    contacts = Contacts(
        jacobian=np.reshape(rows, (3 * nc, n)),
        mu=mu,
        w=w.ravel(),
        point=np.reshape(points, (nc, 3)),
        frame=np.reshape(frames, (nc, 3, 3)),
        bodies=np.reshape(pairs, (nc, 2)).astype(np.int64),
        gap=np.array(gaps, dtype=float),
    )
    velocity = np.concatenate(
        [np.concatenate(p.getBaseVelocity(body, **options)) for body in bodies] or [np.zeros(0)]
    )
    recorded = Recorded(
        assembled=assemble(M, v_free, h, contacts),
        engine="PyBullet",
        version=importlib.metadata.version("pybullet"),
        licence="zlib",
        law="Coulomb, sequential impulses with penetrations corrected by velocities (ERP)",
        time=0.0,
        h=h,
        fields={
            "M": "exact",
            "f": "reconstructed",
            "H": "exact",
            "w": "reconstructed",
            "mu": "exact",
        },
        guess=_core.Solution(r=np.ravel(reactions)) if nc else None,
        velocity=velocity,
        contacts=contacts,
        notes=(
            "w is gap / h if a contact is open, and 0 if it is closed: no penetration is"
            " corrected. Damping of velocities and applied forces, which Bullet does not tell, are"
            " left out.",
        ),
    )
    return checked(recorded, EXACT[8])


def moves(p: Any, body: int, options: dict[str, Any]) -> bool:
    """Whether a body has joints that are not fixed."""
    count = p.getNumJoints(body, **options)
    return any(p.getJointInfo(body, i, **options)[2] != p.JOINT_FIXED for i in range(count))
