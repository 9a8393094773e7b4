"""PyBullet: a step of its rigid bodies. The engine has no way to stop within a step, so the adapter
takes the step itself: `stepSimulation` is part of it.

Bullet keeps the contacts of a step as they were at its start, with the forces that it found. The
unknowns are, body by body, the velocity of the centre and the spin of its base if that moves, then
the rates of its joints. Velocities J of the centre and T of the spin of a link follow from those of
the link before it. m and I are its mass and inertia, g is gravity:

    M = sum of J^T m J + T^T I T
    M (v_free - v) / h = tau + sum of J^T m (g - a) - T^T (I alpha + omega x I omega)

a and alpha are the accelerations that a link has if no rate changes. tau is what joints are braked
by damping and driven by motors; Bullet tells after a step what the motors did.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from fclib import _core
from fclib.recorders._assemble import Contacts, Vector, assemble
from fclib.recorders._recorded import EXACT, Recorded, SetupError, checked

BASE: Final = -1  # Bullet's number of the base of a body, beside those of its links
REACHED: Final = 1e-6  # distance to a limit at which a joint is there [m], [rad]


def pybullet(client: int, bodies: Sequence[int] | None = None, h: float | None = None) -> Recorded:
    """Take one step, and return its problem.

    Args:
        client: result of `pybullet.connect`.
        bodies: the bodies that move; by default all with a mass or with joints.
        h: time step [s], the engine's own.

    Raises:
        ImportError: pybullet is not installed.
        ValueError: h is another one, or a step has parts: substeps, constraints, joints that are
            not revolute, prismatic or fixed, or that are at a limit, bodies that move and are not
            among `bodies`, or contacts that resist rolling or spin.
    """
    return record(importlib.import_module("pybullet"), client, bodies, h)


@dataclass(frozen=True, kw_only=True)
class Part:
    """The base of a body or a link, in the world; n velocities are unknown."""

    mass: float  # [kg]
    inertia: Vector  # (3 x 3) [kg m^2]
    centre: Vector  # (3) of the mass [m]
    move: Vector  # (3 x n) velocity of the centre
    turn: Vector  # (3 x n) spin
    spin: Vector  # (3) [rad/s]
    linear: Vector  # (3) acceleration of the centre if no unknown changes [m/s^2]
    angular: Vector  # (3) the same of the spin [rad/s^2]

    def moved(self, point: Vector) -> Vector:
        """(3 x n) the velocity of a point that moves with the part."""
        return self.move + np.cross(self.turn, point - self.centre, axisa=0).T

    def accelerated(self, point: Vector) -> Vector:
        """(3) the acceleration of the point if no unknown changes [m/s^2]."""
        arm = point - self.centre
        return (
            self.linear
            + np.cross(self.angular, arm)
            + np.cross(self.spin, np.cross(self.spin, arm))
        )


def record(
    p: Any, client: int, bodies: Sequence[int] | None, h: float | None, step: Any = None
) -> Recorded:
    """As `pybullet`, for the module and its stepping function."""
    options = {"physicsClientId": client}
    if bodies is None:
        every = [p.getBodyUniqueId(i, **options) for i in range(p.getNumBodies(**options))]
        bodies = [body for body in every if moves(p, body, options)]
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
    place, n = places_of(p, bodies, options)
    v0 = velocities(p, place, n, options)
    parts: dict[tuple[int, int], Part] = {}
    for body in bodies:
        parts |= parts_of(p, body, place, v0, options)
    M, force = np.zeros((n, n)), np.zeros(n)
    for part in parts.values():
        M += part.mass * part.move.T @ part.move + part.turn.T @ part.inertia @ part.turn
        torque = part.inertia @ part.angular + np.cross(part.spin, part.inertia @ part.spin)
        force += part.mass * part.move.T @ (gravity - part.linear) - part.turn.T @ torque
    (step or p.stepSimulation)(**options)

    rows, mu, points, frames, pairs, gaps, reactions = [], [], [], [], [], [], []
    for contact in p.getContactPoints(**options):
        a, b = contact[1], contact[2]
        if a not in bodies and b not in bodies:
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
        for body, link, point, sign in (
            (a, contact[3], contact[5], 1.0),
            (b, contact[4], contact[6], -1.0),
        ):
            if body in bodies:
                J += sign * frame @ parts[body, link].moved(np.array(point))
        rows.append(J)
        own = [
            p.getDynamicsInfo(body, link, **options)
            for body, link in ((a, contact[3]), (b, contact[4]))
        ]
        for body, known in zip((a, b), own, strict=True):
            if body not in bodies and moves(p, body, options):
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
    v_free = v0 + h * np.linalg.solve(M, force + driven(p, place, v0, options))
    joints = any(link != BASE for _, link in place)
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
        velocity=velocities(p, place, n, options),
        contacts=contacts,
        notes=(
            "w is gap / h if a contact is open, and 0 if it is closed: no penetration is"
            " corrected. Damping of velocities and applied forces, which Bullet does not tell, are"
            " left out.",
            *(("f has the forces that Bullet found for the motors of joints.",) if joints else ()),
        ),
    )
    return checked(recorded, EXACT[8])


def moves(p: Any, body: int, options: dict[str, Any]) -> bool:
    """Whether a body moves, or a part of it."""
    return bool(places_of(p, [body], options)[0])


def places_of(
    p: Any, bodies: Sequence[int], options: dict[str, Any]
) -> tuple[dict[tuple[int, int], int], int]:
    """The first unknown of each base and joint that moves, and the number of all unknowns."""
    place, n = {}, 0
    for body in bodies:
        if p.getDynamicsInfo(body, BASE, **options)[0] > 0:
            place[body, BASE] = n
            n += 6
        for joint in range(p.getNumJoints(body, **options)):
            if p.getJointInfo(body, joint, **options)[2] != p.JOINT_FIXED:
                place[body, joint] = n
                n += 1
    return place, n


def velocities(
    p: Any, place: dict[tuple[int, int], int], n: int, options: dict[str, Any]
) -> Vector:
    """(n) the present velocities."""
    v = np.zeros(n)
    for (body, joint), k in place.items():
        if joint == BASE:
            v[k : k + 6] = np.concatenate(p.getBaseVelocity(body, **options))
        else:
            v[k] = p.getJointState(body, joint, **options)[1]
    return v


def parts_of(
    p: Any, body: int, place: dict[tuple[int, int], int], v: Vector, options: dict[str, Any]
) -> dict[tuple[int, int], Part]:
    """The base and the links of a body.

    Raises:
        SetupError: a joint is not revolute, prismatic or fixed.
    """
    n, none = len(v), np.zeros(3)
    known = p.getDynamicsInfo(body, BASE, **options)
    # Bullet gives the frame of the inertia
    centre, attitude = p.getBasePositionAndOrientation(body, **options)
    move, turn = np.zeros((3, n)), np.zeros((3, n))
    if (body, BASE) in place:
        k = place[body, BASE]
        move[:, k : k + 3] = turn[:, k + 3 : k + 6] = np.eye(3)
    parts = {
        (body, BASE): Part(
            mass=known[0],
            inertia=inertia(p, known[2], attitude),
            centre=np.array(centre),
            move=move,
            turn=turn,
            spin=turn @ v,
            linear=none,
            angular=none,
        )
    }
    for joint in range(p.getNumJoints(body, **options)):
        told = p.getJointInfo(body, joint, **options)
        kind, before = told[2], parts[body, told[16]]
        known = p.getDynamicsInfo(body, joint, **options)
        state = p.getLinkState(body, joint, 0, True, **options)
        # a revolute joint turns the link about the origin of its frame
        pivot = np.array(state[4] if kind == p.JOINT_REVOLUTE else state[0])
        move, turn = before.moved(pivot), before.turn.copy()
        linear, angular = before.accelerated(pivot), before.angular
        if kind in (p.JOINT_REVOLUTE, p.JOINT_PRISMATIC):
            k = place[body, joint]
            # Bullet gives the axis in the frame of the inertia
            axis = np.reshape(p.getMatrixFromQuaternion(state[1]), (3, 3)) @ told[13]
            turned = np.cross(before.spin, axis * v[k])
            if kind == p.JOINT_REVOLUTE:
                turn[:, k] += axis
                angular = angular + turned
            else:
                move[:, k] += axis
                linear = linear + 2 * turned
        elif kind != p.JOINT_FIXED:
            name = told[1].decode()
            raise SetupError(
                f"body {body}: joint {name} is not revolute, prismatic or fixed, which are recorded"
            )
        held = Part(
            mass=known[0],
            inertia=inertia(p, known[2], state[1]),
            centre=pivot,
            move=move,
            turn=turn,
            spin=turn @ v,
            linear=linear,
            angular=angular,
        )
        centre = np.array(state[0])
        parts[body, joint] = replace(
            held, centre=centre, move=held.moved(centre), linear=held.accelerated(centre)
        )
    return parts


def inertia(p: Any, principal: Any, attitude: Any) -> Vector:
    """(3 x 3) the inertia in the world, of its diagonal in a frame and the frame's quaternion."""
    turn = np.reshape(p.getMatrixFromQuaternion(attitude), (3, 3))
    return np.asarray(turn @ np.diag(principal) @ turn.T)


def driven(
    p: Any, place: dict[tuple[int, int], int], v0: Vector, options: dict[str, Any]
) -> Vector:
    """(n) forces of motors and damping in the step that began with the velocities v0.

    Raises:
        ValueError: a joint is at its limit, of which Bullet does not tell the force.
    """
    force = np.zeros(len(v0))
    for (body, joint), k in place.items():
        if joint == BASE:
            continue
        told = p.getJointInfo(body, joint, **options)
        position, _, _, motor = p.getJointState(body, joint, **options)
        force[k] = motor - told[6] * v0[k]
        low, high = told[8:10]
        # Bullet has no limit if they are the other way round
        if low <= high and not low + REACHED < position < high - REACHED:
            raise ValueError(
                f"body {body}: joint {told[1].decode()} is at its limit, of which Bullet does not"
                " tell the force"
            )
    return force
