"""Genesis: a step of its rigid solver, of one of its worlds.

The data of a step are private in Genesis: `RigidSolver` keeps the rows of its constraints, their
forces and the mass matrix until the next step. The rows are those of equalities, of dry friction,
of contacts, then of limits. A contact has the rows N, T1, T2, then those of spin and rolling
friction; with pyramids it has N + mu T and N - mu T for each tangent T.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from fclib.recorders import _recorded
from fclib.recorders._assemble import (
    RANK,
    RANK_SINGLE,
    Contacts,
    DryFriction,
    Joints,
    Limits,
    Vector,
    assemble,
    reaction_of,
)
from fclib.recorders._recorded import EXACT, Recorded, SetupError, checked

VERSION: Final = "1.4"  # whose private data are known
LICENCE: Final = "Apache-2.0"
SINGLE: Final = 4  # bytes of a number in single precision
LAWS: Final = {
    "signorini": "Coulomb friction on soft contacts, by successive convex problems",
    "convex": "soft contacts, by convex optimisation",
}


def genesis(scene: Any, world: int = 0) -> Recorded:
    """Take one step of all worlds, and return the problem of one: of its last substep.

    Args:
        scene: genesis.Scene, built.
        world: one of its worlds.

    Raises:
        ImportError: Genesis is not installed, or has another version.
        ValueError: there is no such world; the scene has an integrator, a coupler or contacts that
            are not recorded, or bodies that sleep.
    """
    version = pinned()
    solver = scene.rigid_solver
    taken: list[Recorded] = []
    original = solver.substep

    def substep(f: int) -> None:
        taken.append(record(solver, world, version, lambda: original(f)))

    solver.substep = substep
    try:
        scene.step()
    finally:
        solver.substep = original
    if not taken:
        raise SetupError("the scene takes no step of rigid bodies")
    return taken[-1]


def pinned() -> str:
    """The version of Genesis. ImportError if it is not the one whose data are known."""
    return _recorded.pinned("genesis", "genesis-world", VERSION)


@dataclass(frozen=True, kw_only=True)
class World:
    """What the rigid solver keeps of a step of one world."""

    M: Vector  # (n x n) with the implicit damping
    smooth: Vector  # (n) acceleration without constraints
    velocity: Vector  # (n) at the end
    J: Vector  # (rows x n)
    force: Vector  # (rows)
    strength: Vector  # (rows) bounds of dry friction, coefficients of friction of a cone
    ends: tuple[int, int, int]  # of the rows of equalities, dry friction and contacts
    rows: int  # of a contact
    link: Any  # (nc x 2)
    point: Vector  # (nc x 3)
    normal: Vector  # (nc x 3), from the second link to the first
    gap: Vector  # (nc)
    mu: Vector  # (nc)
    mu_s: Vector | None  # (nc)
    mu_r: Vector | None  # (nc)
    precision: int  # bytes of a number


def record(solver: Any, world: int, version: str, step: Callable[[], None]) -> Recorded:
    """The problem of a step of a rigid solver, which `step` takes."""
    check(solver, world)
    config = solver.rigid_config
    before = numbers(solver.dyn_state.dofs.vel, world)
    time = float(solver.sim.cur_t)
    step()
    found = read(solver, world)
    h = float(solver.substep_dt)
    elliptic = bool(config.enable_elliptic_friction)
    contacts, reaction = contacts_of(found, elliptic, h)
    equality, dry, contact = found.ends
    joints = found.J[:equality]
    rank = RANK_SINGLE if found.precision == SINGLE else RANK
    bound = found.strength[equality:dry]
    assembled = assemble(
        found.M,
        before + h * found.smooth,
        h,
        contacts,
        Joints(jacobian=joints, rank=rank) if equality else None,
        Limits(jacobian=found.J[contact:]) if len(found.J) > contact else None,
        DryFriction(jacobian=found.J[equality:dry], bound=bound) if dry > equality else None,
    )
    force = h * found.force
    law = "signorini" if config.enable_signorini_contact else "convex"
    cone = "elliptic" if elliptic else "pyramidal"
    recorded = Recorded(
        assembled=assembled,
        engine="Genesis",
        version=version,
        licence=LICENCE,
        law=f"{LAWS[law]}, with {cone} friction cones",
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
            assembled,
            reaction,
            force[contact:],
            (force[equality:dry], h * bound),
            (joints, force[:equality]),
        ),
        velocity=found.velocity,
        contacts=contacts,
        notes=(
            "w is gap / h if a contact is open, and 0 if it is closed: no penetration is"
            " corrected. Joints are rigid.",
            f"The data are of {'single' if found.precision == SINGLE else 'double'} precision.",
        ),
        more={"world": world, "body_names": [str(link.name) for link in solver.links]},
    )
    return checked(recorded, EXACT[found.precision])


def check(solver: Any, world: int) -> None:
    """Raise if steps of the solver are not recorded, or there is no such world."""
    worlds = int(solver.constraint_solver.constraint_state.n_constraints.shape[0])
    if not 0 <= world < worlds:
        raise ValueError(f"there is no world {world}: there are {worlds}")
    config = solver.rigid_config
    gs = importlib.import_module("genesis")
    if config.integrator != gs.integrator.approximate_implicitfast:
        raise SetupError(
            f"the integrator {gs.integrator(config.integrator).name} of Genesis is not recorded:"
            " use gs.integrator.approximate_implicitfast"
        )
    coupler = type(solver.sim.coupler).__name__
    if coupler in ("SAPCoupler", "IPCCoupler"):
        raise SetupError(f"{coupler} finds the forces itself, and its problem is not recorded")
    if solver.rigid_config.use_hibernation:
        raise SetupError(
            "bodies that sleep are not recorded, since no equation holds for them:"
            " use RigidOptions(use_hibernation=False)"
        )
    if not config.enable_elliptic_friction and config.enable_torsional_friction:
        raise SetupError(
            "pyramids with torsional friction are not recorded:"
            " use RigidOptions(friction_cone=gs.friction_cone.elliptic)"
        )


def numbers(tensor: Any, world: int) -> Vector:
    """The part of one world, whose place is the last axis, in double precision."""
    return np.asarray(tensor.to_numpy()[..., world], dtype=float)


def read(solver: Any, world: int) -> World:
    """What the solver keeps of its last step."""
    config, dofs = solver.rigid_config, solver.dyn_state.dofs
    rows = solver.constraint_solver.constraint_state
    state = solver.collider.collider_state
    count, equality, dry, nc = (
        int(tensor.to_numpy()[world])
        for tensor in (
            rows.n_constraints,
            rows.n_constraints_equality,
            rows.n_constraints_frictionloss,
            state.n_contacts,
        )
    )
    data, order = state.contact_data, state.contact_sort_idx.to_numpy()[:nc, world]
    each = int(config.rows_per_contact)

    def of_contacts(tensor: Any) -> Any:
        return tensor.to_numpy()[order, world]

    def friction(tensor: Any, there: bool) -> Any:
        return np.asarray(of_contacts(tensor), dtype=float) if there else None

    lower = np.tril(numbers(solver.rigid_info.mass_mat, world))
    return World(
        M=lower + np.tril(lower, -1).T,
        smooth=numbers(dofs.acc_smooth, world),
        velocity=numbers(dofs.vel, world),
        J=numbers(rows.jac, world)[:count],
        force=numbers(rows.efc_force, world)[:count],
        strength=numbers(rows.efc_frictionloss, world)[:count],
        ends=(equality, equality + dry, equality + dry + each * nc),
        rows=each,
        link=np.stack([of_contacts(data.link_a), of_contacts(data.link_b)], axis=1),
        point=np.asarray(data.pos.to_numpy()[order, world], dtype=float),
        normal=np.asarray(data.normal.to_numpy()[order, world], dtype=float),
        gap=-np.asarray(of_contacts(data.penetration), dtype=float),
        mu=np.asarray(of_contacts(data.friction), dtype=float),
        mu_s=friction(data.friction_torsional, config.enable_torsional_friction),
        mu_r=friction(data.friction_rolling, config.enable_rolling_friction),
        precision=int(dofs.vel.to_numpy().dtype.itemsize),
    )


def contacts_of(found: World, elliptic: bool, h: float) -> tuple[Contacts, Vector]:
    """The contacts, and their impulses (nc x d) [N s] and [N m s]."""
    nc, n = len(found.mu), found.M.shape[0]
    own = slice(found.ends[1], found.ends[2])
    J, force = found.J[own].reshape(nc, found.rows, n), found.force[own].reshape(nc, found.rows)
    if elliptic:
        # Genesis has T1, T2 of a frame that is left-handed with N
        order = [0, 2, 1]
        order += [3] if found.mu_s is not None else []
        order += [5, 4] if found.mu_r is not None else []
        J, force = J[:, order], force[:, order]
    else:
        if not (found.mu > 0).all():
            raise ValueError(
                f"contact {int(np.argmin(found.mu))}: a pyramid without friction has no tangents:"
                " use RigidOptions(friction_cone=gs.friction_cone.elliptic)"
            )
        mu = found.mu[:, None]
        tangents = [(J[:, k + 1] - J[:, k]) / (2 * mu) for k in (2, 0)]
        J = np.stack([J.mean(axis=1), *tangents], axis=1)
        force = np.stack(
            [force.sum(axis=1), *(found.mu * (force[:, k + 1] - force[:, k]) for k in (2, 0))],
            axis=1,
        )
    d = J.shape[1]
    w = np.zeros((nc, d))
    w[:, 0] = np.maximum(found.gap, 0) / h
    frame = frames(found.normal)
    contacts = Contacts(
        jacobian=J.reshape(d * nc, n),
        mu=found.mu,
        mu_s=found.mu_s,
        mu_r=found.mu_r,
        w=w.ravel(),
        point=found.point,
        frame=frame,
        bodies=found.link.astype(np.int64),
        gap=found.gap,
    )
    return contacts, h * force


def frames(normal: Vector) -> Vector:
    """The frames (nc x 3 x 3) of contacts: -normal, then the tangents of Genesis, second first."""
    found = np.zeros((len(normal), 3, 3))
    for frame, a in zip(found, normal, strict=True):
        axis = 1 if abs(a[1]) < 0.5 else 2
        b = np.eye(3)[axis] - a[axis] * a
        b /= np.linalg.norm(b)
        frame[:] = -a, b, np.cross(b, a)
    return found
