"""Newton: a step of its Kamino solver, in one of its worlds, recorded after the step.

Kamino's rows are joints (first those with armature, damping or drives, which yield), dry friction
of joints, limits, contacts; the rows of a contact are T1, T2, N. The unknowns are twists of bodies
at their centres of mass, in the world. `v_f` and the bounds are scaled by P, as its solver needs
them:

    v_f = P (J u_f + w),  w = v_b + e J v,  bound = impulse / P

A row that yields, J v + v_b + lambda / m = 0, is a mass m that moves with it: M + J^T m J. Data are
of single precision. They are private to the solver, so only one version of Newton is read.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from fclib import _core
from fclib.recorders import _recorded
from fclib.recorders._assemble import (
    RANK_SINGLE,
    Contacts,
    DryFriction,
    Joints,
    Limits,
    Vector,
    assemble,
)
from fclib.recorders._recorded import Recorded, SetupError

VERSION: Final = "1.8"  # the version whose private data are known
PRECISION: Final = 2.0**-24  # half the last digit of single precision


@dataclass(frozen=True, kw_only=True)
class Step:
    """Kamino's data of one world's step: n velocities of bodies that move, d rows, nc contacts.

    Rows: `yielding` and `rigid` of joints, `dry`, `limits`, 3 nc of contacts.
    """

    time: float  # at the start [s]
    h: float  # [s]
    M: Vector  # (n x n)
    v_free: Vector  # (n)
    velocity: Vector  # (n) after the step
    J: Vector  # (d x n)
    w: Vector  # (d) [m/s] the laws hold for J v + w
    reaction: Vector  # (d) [N s]
    yielding: int
    rigid: int
    dry: int
    limits: int
    inverse_mass: Vector  # (yielding) [1/kg]
    bound: Vector  # (dry) [N s]
    mu: Vector  # (nc)
    compliance: Vector | None = None  # (d) of limits and contacts; None: hard
    point: Vector | None = None  # (nc x 3) [m]
    frame: Vector | None = None  # (nc x 3 x 3) rows N, T1, T2
    bodies: Any = None  # (nc x 2)
    gap: Vector | None = None  # (nc) [m]


def newton(solver: Any, world: int = 0) -> Recorded:
    """The problem of a solver's last step.

    Args:
        solver: newton.solvers.SolverKamino, after `step`.
        world: one of its worlds.

    Raises:
        ImportError: Newton is not installed, or its version is another.
        TypeError: the solver is not Kamino's.
        ValueError: there is no such world; the solver has no dual problem ("lox"), is captured in
            a CUDA graph, or has drives with limits of effort, which are not recorded.
    """
    version = pinned()
    kamino = getattr(solver, "_solver_kamino", None)
    if kamino is None:
        raise TypeError(f"a SolverKamino of Newton is recorded, not a {type(solver).__name__}")
    return recorded(read(kamino, solver._contacts_kamino, world), version)


def pinned() -> str:
    """Newton's version. ImportError if it is not the one whose data are known."""
    return _recorded.pinned("newton", "newton", VERSION)


def recorded(step: Step, version: str) -> Recorded:
    """The problem of a step."""
    ends = np.cumsum((step.yielding, step.rigid, step.dry, step.limits))
    parts = list(zip(np.split(step.J, ends), np.split(step.w, ends), strict=True))
    reactions = np.split(step.reaction, ends)
    (J, w), rigid, (dry, _), limits, contact = parts
    masses = 1 / step.inverse_mass
    M = step.M + J.T @ (masses[:, None] * J)
    f = step.M @ step.v_free - J.T @ (masses * w)
    compliance = None
    if step.compliance is not None:
        soft = np.split(step.compliance, ends)
        if soft[3].any():
            raise SetupError("limits of joints that yield are not recorded: limit_compliance")
        compliance = soft[4]
    contacts = Contacts(
        jacobian=contact[0],
        mu=step.mu,
        w=contact[1],
        order="TTN",
        point=step.point,
        frame=step.frame,
        bodies=step.bodies,
        gap=step.gap,
    )
    assembled = assemble(
        M,
        np.linalg.solve(M, f),
        step.h,
        contacts,
        Joints(jacobian=rigid[0], b=rigid[1], rank=RANK_SINGLE) if step.rigid else None,
        Limits(jacobian=limits[0], w=limits[1]) if step.limits else None,
        DryFriction(jacobian=dry, bound=step.bound / step.h) if step.dry else None,
        compliance if compliance is not None and compliance.any() else None,
    )
    r = np.zeros((assembled.problem.nc, 3))
    nc = len(contacts)
    r[:nc] = reactions[4].reshape(-1, 3)[:, [2, 0, 1]]
    r[nc : nc + step.limits, 0] = reactions[3]
    # the bound presses dry friction
    r[nc + step.limits :, 0], r[nc + step.limits :, 1] = step.bound, reactions[2]
    multipliers = None
    if assembled.problem.p:
        # multipliers of the kept rows that have the effect of all
        kept = np.setdiff1d(np.arange(step.rigid), assembled.redundant)
        whole = rigid[0].T @ reactions[1]
        multipliers = np.linalg.lstsq(rigid[0][kept].T, whole, rcond=None)[0]
    return Recorded(
        assembled=assembled,
        engine="Newton",
        version=version,
        licence="Apache-2.0",
        law="Coulomb, hard, with Newton's impact and penetrations corrected by velocities (Kamino)",
        time=step.time,
        h=step.h,
        fields=dict.fromkeys(("M", "f", "H", "w", "mu", "G", "b"), "exact"),
        guess=_core.Solution(r=r.ravel(), l=multipliers),
        velocity=step.velocity,
        contacts=contacts,
        notes=("The data are of single precision.",),
        more={"violated": assembled.violated, "precision": PRECISION},
    )


def read(kamino: Any, containers: Any, world: int) -> Step:
    """The data of a step in Kamino's solver and its contacts."""
    model, data, dual = kamino._model, kamino._data, kamino.problem_fd
    if model.device.is_capturing:
        raise SetupError("the step is captured in a CUDA graph: record it without wp.ScopedCapture")
    if dual is None or kamino.config.dynamics_solver == "lox":
        raise SetupError('the solver "lox" has no dual problem: "padmm" and "dvi" are recorded')
    if not 0 <= world < model.size.num_worlds:
        raise ValueError(f"there is no world {world}: the model has {model.size.num_worlds}")
    info, problem = model.info, dual.data

    def number(array: Any) -> int:
        return int(array.numpy()[world])

    if number(info.num_joint_effort_cts):
        raise SetupError("drives of joints with a limit of effort are not recorded: effort_limit")
    first, last = info.bodies_offset.numpy()[world : world + 2]
    yielding, joints = number(info.num_joint_dynamic_cts), number(problem.njc)
    dry, limits, nc = number(problem.nbc), number(problem.nl), number(problem.nc)
    d, n = joints + dry + limits + 3 * nc, 6 * (last - first)

    def part(array: Any, start: Any, size: int) -> Vector:
        begin = number(start)
        return np.asarray(array.numpy()[begin : begin + size], dtype=float)

    def twists(array: Any) -> Vector:
        return np.asarray(array.numpy()[first:last], dtype=float).ravel()

    J = jacobian(kamino._jacobians, world, d, n)
    P, scaled, w, e = (
        part(array, problem.vio, d) for array in (problem.P, problem.v_f, problem.v_b, problem.v_i)
    )
    u_free = twists(problem.u_f)
    # bodies without inverse mass have a prescribed motion
    moves = np.repeat(model.bodies.inv_m_i.numpy()[first:last] > 0, 6)
    w = w + J[:, ~moves] @ u_free[~moves]
    # impacts: Kamino keeps only their sum
    w = np.where(e != 0, scaled / P - J[:, moves] @ u_free[moves], w)
    M = np.zeros((n, n))
    mass = np.asarray(model.bodies.m_i.numpy()[first:last], dtype=float)
    inertia = np.asarray(data.bodies.I_i.numpy()[first:last], dtype=float)
    for i, k in enumerate(range(0, n, 6)):
        M[k : k + 3, k : k + 3] = mass[i] * np.eye(3)
        M[k + 3 : k + 6, k + 3 : k + 6] = 0.5 * (inertia[i] + inertia[i].T)
    h = float(model.time.dt.numpy()[world])
    return Step(
        time=float(data.time.time.numpy()[world]) - h,
        h=h,
        M=M[np.ix_(moves, moves)],
        v_free=u_free[moves],
        velocity=twists(data.bodies.u_i)[moves],
        J=J[:, moves],
        w=w,
        reaction=part(kamino.solver_fd.data.solution.lambdas, problem.vio, d),
        yielding=yielding,
        rigid=joints - yielding,
        dry=dry,
        limits=limits,
        inverse_mass=part(data.joints.inv_m_j, info.joint_dynamic_cts_offset, yielding),
        bound=part(problem.bound_upper, problem.bcio, dry) * P[joints : joints + dry],
        mu=part(problem.mu, problem.cio, nc),
        compliance=None if problem.compliance is None else part(problem.compliance, problem.vio, d),
        **places(containers, world, nc),
    )


def jacobian(jacobians: Any, world: int, d: int, n: int) -> Vector:
    """J (d x n) of a world, kept as an array or as rows of blocks."""
    if hasattr(jacobians, "data"):
        start = int(jacobians.data.J_cts_offsets.numpy()[world])
        flat = jacobians.data.J_cts_data.numpy()[start : start + d * n]
        return np.asarray(flat, dtype=float).reshape(d, n)
    blocks = jacobians._J_cts.bsm
    start = int(blocks.nzb_start.numpy()[world])
    of_world = slice(start, start + int(blocks.num_nzb.numpy()[world]))
    J = np.zeros((d, n))
    places = blocks.nzb_coords.numpy()[of_world]
    for (row, column), block in zip(places, blocks.nzb_values.numpy()[of_world], strict=True):
        J[row, column : column + 6] += block
    return J


def places(containers: Any, world: int, nc: int) -> dict[str, Any]:
    """Points, frames and bodies of a world's contacts, in the order of their rows."""
    if containers is None or not nc:
        return {}
    known = containers.data
    number = known.cid.numpy()
    active = np.arange(min(int(known.model_active_contacts.numpy()[0]), len(number)))
    own = active[known.wid.numpy()[active] == world]
    own = own[np.argsort(number[own])]
    points = (known.position_A.numpy()[own], known.position_B.numpy()[own])
    x, y, z, s = np.asarray(known.frame.numpy()[own], dtype=float).T
    # columns T1, T2, N of the quaternion's matrix
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * s), 2 * (x * z + y * s)],
            [2 * (x * y + z * s), 1 - 2 * (x * x + z * z), 2 * (y * z - x * s)],
            [2 * (x * z - y * s), 2 * (y * z + x * s), 1 - 2 * (x * x + y * y)],
        ]
    )
    return {
        "point": 0.5 * np.asarray(points[0] + points[1], dtype=float),
        "frame": turn.transpose(2, 1, 0)[:, [2, 0, 1]],
        "bodies": known.bid_AB.numpy()[own].astype(np.int64),
        "gap": np.asarray(known.gapfunc.numpy()[own][:, 3], dtype=float),
    }
