"""MuJoCo: a step of its own solver, by `mj_step`.

MuJoCo's contacts are soft. The problem is that of Coulomb's law at the same state, and the guess is
what MuJoCo's solver found.

The data of a step are those of its start. `mj_step` leaves them as they were, but for qpos, qvel
and time.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np

from fclib.recorders._assemble import (
    Contacts,
    DryFriction,
    Joints,
    Limits,
    Vector,
    assemble,
    reaction_of,
)
from fclib.recorders._recorded import EXACT, Recorded, SetupError, checked
from fclib.scenes.shared.condim import has_condim, spins

LICENCE = "Apache-2.0"


def mujoco(model: Any, data: Any) -> Recorded:
    """Take one step, and return its problem.

    Args:
        model: mujoco.MjModel, with the integrator Euler or implicitfast.
        data: mujoco.MjData; it is stepped.

    Raises:
        ImportError: mujoco is not installed.
        ValueError: the integrator is another one, or a contact is one of a flexible body.
    """
    module = importlib.import_module("mujoco")
    return record(module, model, data, module.mj_step)


def record(
    mj: Any, model: Any, data: Any, step: Callable[[Any, Any], None], exact: float = EXACT[8]
) -> Recorded:
    """As `mujoco`, for the module and its stepping function; `exact` is for `checked`."""
    known = {
        mj.mjtIntegrator.mjINT_EULER: "Euler",
        mj.mjtIntegrator.mjINT_IMPLICITFAST: "implicitfast",
    }
    integrator = model.opt.integrator
    if integrator not in known:
        raise SetupError(
            f"the integrator {mj.mjtIntegrator(integrator).name} is not recorded:"
            ' use <option integrator="implicitfast"/> or "Euler"'
        )
    sleep = getattr(mj.mjtEnableBit, "mjENBL_SLEEP", 0)
    if model.opt.enableflags & sleep:
        raise SetupError(
            "bodies that sleep are not recorded, since no equation holds for them:"
            ' use <flag sleep="disable"/>'
        )
    before, time = np.array(data.qvel), float(data.time)
    step(model, data)
    h, n = float(model.opt.timestep), int(model.nv)
    M = inertia(mj, model, data)
    if known[integrator] == "Euler":
        flags = mj.mjtDisableBit
        explicit = flags.mjDSBL_EULERDAMP | getattr(flags, "mjDSBL_DAMPER", 0)
        disabled = model.opt.disableflags & explicit
        M += h * np.diag(np.zeros(n) if disabled else model.dof_damping)
    else:
        M -= h * derivative(model, data)
        M = 0.5 * (M + M.T)

    kinds = mj.mjtConstraint
    kind, J = np.array(data.efc_type), rows_of(mj, model, data)
    force = h * np.array(data.efc_force)
    joints = kind == kinds.mjCNSTR_EQUALITY
    dry = np.isin(kind, (kinds.mjCNSTR_FRICTION_DOF, kinds.mjCNSTR_FRICTION_TENDON))
    limits = np.isin(kind, (kinds.mjCNSTR_LIMIT_JOINT, kinds.mjCNSTR_LIMIT_TENDON))
    bound = np.array(data.efc_frictionloss)[dry]
    contacts, reaction, twist, notes = contacts_of(mj, model, data, h)
    v_free = before + np.linalg.solve(M, h * data.qfrc_smooth + twist)
    assembled = assemble(
        M,
        v_free,
        h,
        contacts,
        Joints(jacobian=J[joints]) if joints.any() else None,
        Limits(jacobian=J[limits], w=np.maximum(data.efc_pos[limits], 0) / h)
        if limits.any()
        else None,
        DryFriction(jacobian=J[dry], bound=bound) if dry.any() else None,
    )
    cone = "elliptic" if model.opt.cone == mj.mjtCone.mjCONE_ELLIPTIC else "pyramidal"
    recorded = Recorded(
        assembled=assembled,
        engine="MuJoCo",
        version=str(mj.__version__),
        licence=LICENCE,
        law=f"soft contacts with {cone} friction cones, by convex optimisation",
        time=time,
        h=h,
        fields={
            "M": "exact",
            "f": "exact",
            "H": "exact",
            "w": "reconstructed",
            "mu": "exact",
            **(dict.fromkeys(("G", "b"), "reconstructed") if assembled.problem.p else {}),
        },
        guess=reaction_of(
            assembled, reaction, force[limits], (force[dry], h * bound), (J[joints], force[joints])
        ),
        velocity=np.array(data.qvel),
        contacts=contacts,
        notes=(
            "w is gap / h if a contact or limit is open, and 0 if it is closed: no"
            " penetration is corrected. Joints are rigid.",
            *notes,
        ),
        more={
            "integrator": known[integrator],
            "body_names": [model.body(i).name or f"body {i}" for i in range(model.nbody)],
        },
    )
    return checked(recorded, exact)


def inertia(mj: Any, model: Any, data: Any) -> Vector:
    """The mass matrix (n x n) of a step."""
    M = np.zeros((model.nv, model.nv))
    if hasattr(data, "qM"):  # before version 4
        mj.mj_fullM(model, M, data.qM)
    else:
        mj.mj_fullM(model, data, M)
    return M


def derivative(model: Any, data: Any) -> Vector:
    """The derivative (n x n) of the forces by the velocities, which the integrator has found."""
    D = np.zeros((model.nv, model.nv))
    for i in range(model.nv):
        own = slice(model.D_rowadr[i], model.D_rowadr[i] + model.D_rownnz[i])
        D[i, model.D_colind[own]] = data.qDeriv[own]
    return D


def rows_of(mj: Any, model: Any, data: Any) -> Vector:
    """The rows of the constraints (nefc x n) of MuJoCo's solver."""
    shape = (int(data.nefc), int(model.nv))
    if not mj.mj_isSparse(model):
        return np.reshape(data.efc_J, shape).copy()
    J = np.zeros(shape)
    for i in range(shape[0]):
        own = slice(data.efc_J_rowadr[i], data.efc_J_rowadr[i] + data.efc_J_rownnz[i])
        J[i, np.ravel(data.efc_J_colind)[own]] = np.ravel(data.efc_J)[own]
    return J


def contacts_of(
    mj: Any, model: Any, data: Any, h: float
) -> tuple[Contacts, Vector, Vector, list[str]]:
    """The contacts on which the solver worked, and what it found for them.

    Returns:
        contacts of d components, impulses (nc x d) [N s] and [N m s], the generalised impulse (n)
        of the moments that the problem lacks, and what is left out.
    """
    found = [data.contact[k] for k in range(data.ncon)]
    active = [k for k, one in enumerate(found) if one.exclude == 0]
    spin, rolling = spins(model), has_condim(model, 6)
    # the rows of MuJoCo that are kept: N, T1, T2, then spin, R1, R2
    kept = [0, 1, 2, *([3] if spin else []), *([4, 5] if rolling else [])]
    others = np.setdiff1d(np.arange(6), kept)
    rows, pairs, r = [], [], []
    twist = np.zeros(model.nv)
    friction, notes = np.zeros((len(active), 5)), set()
    for i, k in enumerate(active):
        one = found[k]
        geoms = np.array(one.geom)
        if (geoms < 0).any():
            raise ValueError(f"contact {k}: is one of a flexible body, which is not recorded")
        bodies = model.geom_bodyid[geoms]
        frame = np.reshape(one.frame, (3, 3))
        move, turn = np.zeros((2, 3, model.nv)), np.zeros((2, 3, model.nv))
        for moved, turned, body in zip(move, turn, bodies, strict=True):
            mj.mj_jac(model, data, moved, turned, one.pos, body)
        own = np.vstack((frame @ (move[1] - move[0]), frame @ (turn[1] - turn[0])))
        rows.append(own[kept])
        pairs.append(bodies)
        force = np.zeros(6)
        mj.mj_contactForce(model, data, k, force)
        r.append(h * force[kept])
        # MuJoCo has a least friction if a coefficient is 0
        twist += h * own[others].T @ force[others]
        # sliding has two coefficients, spin one, and rolling two
        known = one.dim - 1
        friction[i, :known] = np.array(one.friction)[:known]
        if any(friction[i, a] != friction[i, a + 1] for a in (0, 3) if a < known):
            notes.add("Friction differs along the tangents: the first coefficient is taken.")
        if np.any(getattr(one, "surfacevel", 0)):
            notes.add("Moving surfaces are left out.")
    nc, d = len(active), len(kept)
    gap = np.array([found[k].dist for k in active])
    w = np.zeros((nc, d))
    w[:, 0] = np.maximum(gap, 0) / h
    contacts = Contacts(
        jacobian=np.reshape(rows, (d * nc, model.nv)),
        mu=friction[:, 0],
        mu_s=friction[:, 2] if spin else None,
        mu_r=friction[:, 3] if rolling else None,
        w=w.ravel(),
        point=np.reshape([found[k].pos for k in active], (nc, 3)),
        frame=np.reshape([found[k].frame for k in active], (nc, 3, 3)),
        bodies=np.reshape(pairs, (nc, 2)).astype(np.int64),
        gap=gap,
    )
    return contacts, np.reshape(r, (nc, d)), twist, sorted(notes)
