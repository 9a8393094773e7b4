"""Pinocchio: a model with collision geometries at a configuration. It steps nothing by itself, so
the step is that of the caller: v_free = v + h a, a by its articulated-body algorithm.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from typing import Any

import numpy as np
import numpy.typing as npt

from fclib.recorders._assemble import Contacts, Limits, assemble
from fclib.recorders._recorded import Recorded


def pinocchio(
    model: Any,
    geometry: Any,
    q: npt.ArrayLike,
    v: npt.ArrayLike,
    tau: npt.ArrayLike | None = None,
    *,
    h: float,
    mu: float = 0.5,
    margin: float = 0.0,
) -> Recorded:
    """The problem of a step from (q, v).

    Args:
        model: pinocchio.Model.
        geometry: pinocchio.GeometryModel, with its collision pairs.
        q: configuration.
        v: velocity (n).
        tau: forces of the actuators (n); None: 0.
        h: time step [s].
        mu: coefficient of friction: Pinocchio's geometries have none.
        margin: pairs closer than this may touch within the step [m].

    Raises:
        ImportError: pinocchio is not installed.
    """
    pin = importlib.import_module("pinocchio")
    n = model.nv
    q, v = np.asarray(q, dtype=float), np.asarray(v, dtype=float)
    tau = np.zeros(n) if tau is None else np.asarray(tau, dtype=float)
    data, geometries = model.createData(), geometry.createData()
    # unless contacts are asked for, normals are NaN
    for request in geometries.collisionRequests:
        request.enable_contact = True
        request.security_margin = margin
        request.num_max_contacts = 8
    M = pin.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    v_free = v + h * pin.aba(model, data, q, v, tau)
    pin.computeJointJacobians(model, data, q)
    pin.updateGeometryPlacements(model, data, geometry, geometries)
    pin.computeCollisions(geometry, geometries, False)
    rows, points, frames, pairs, gaps = [], [], [], [], []
    for k, pair in enumerate(geometry.collisionPairs):
        result = geometries.collisionResults[k]
        joints = [geometry.geometryObjects[i].parentJoint for i in (pair.first, pair.second)]
        for i in range(result.numContacts()):
            contact = result.getContact(i)
            normal = np.array(contact.normal)
            if not np.isfinite(normal).all():
                raise ValueError("a normal is not finite: coal found none for this pair")
            first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
            first /= np.linalg.norm(first)
            frame = np.stack((normal, first, np.cross(normal, first)))
            point = np.array(contact.pos)
            rows.append(
                frame
                @ (
                    _jacobian(pin, model, data, joints[1], point)
                    - _jacobian(pin, model, data, joints[0], point)
                )
            )
            points.append(point)
            frames.append(frame)
            pairs.append(joints)
            # coal's depth is a signed distance
            gaps.append(contact.penetration_depth)
    nc = len(rows)
    approach = np.zeros((nc, 3))
    approach[:, 0] = np.maximum(gaps, 0) / h
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    own, w = [], []
    for joint in model.joints:
        if joint.nv != 1 or joint.nq != 1:
            continue
        for sign, bound in ((1.0, low[joint.idx_q]), (-1.0, high[joint.idx_q])):
            gap = sign * (q[joint.idx_q] - bound)
            if np.isfinite(bound) and gap + 0.5 * h * sign * v[joint.idx_v] <= 0:
                row = np.zeros(n)
                row[joint.idx_v] = sign
                own.append(row)
                w.append(0.0)
    contacts = Contacts(
        jacobian=np.reshape(rows, (3 * nc, n)),
        mu=np.full(nc, mu),
        w=approach.ravel(),
        point=np.reshape(points, (nc, 3)),
        frame=np.reshape(frames, (nc, 3, 3)),
        bodies=np.reshape(pairs, (nc, 2)).astype(np.int64),
        gap=np.array(gaps, dtype=float),
    )
    limits = Limits(jacobian=np.array(own), w=w) if own else None
    return Recorded(
        assembled=assemble(M, v_free, h, contacts, limits=limits),
        engine="Pinocchio",
        version=importlib.metadata.version("pin"),
        licence="BSD-2-Clause",
        law="Coulomb, rigid",
        time=0.0,
        h=h,
        fields={
            "M": "exact",
            "f": "exact",
            "H": "exact",
            "w": "reconstructed",
            "mu": "reconstructed",
        },
        contacts=contacts,
    )


def _jacobian(pin: Any, model: Any, data: Any, joint: int, point: Any) -> Any:
    """The Jacobian of a point that moves with a joint's body (3 x n), in the world."""
    J = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    if joint == 0:
        return np.zeros((3, model.nv))
    arm = point - data.oMi[joint].translation
    return J[:3] - pin.skew(arm) @ J[3:]
