"""Drake: the discrete step of a MultibodyPlant whose contacts are points.

The plant needs a time step, and `SetUseSampledOutputPorts(False)` before `Finalize`, so that its
output is that of the step which begins at the context. The law "hard" is Coulomb's on the plant's
contacts; "sap" is what Drake's solver minimises: compliant, dissipative and associated,

    u = H^T v + w + R r,  w_N = -depth / (h + tau),  u in K*
    k = kA kB / (kA + kB),  tau = tauA + tauB,  beta = 1, sigma = 1e-3
    R_N = max(beta^2 W / (4 pi^2), 1 / (h k (h + tau))),  R_T = sigma W,  W = ||W_cc|| / 3

The forces of actuators are those that Drake applies: within their limits, those of controllers
with gains too. Constraints and locked joints are not recorded.

Castro, Permenter & Han, "An unconstrained convex formulation of compliant contact" (2023).
"""

from __future__ import annotations

import importlib
import importlib.metadata
from typing import Any, Final, Literal

import numpy as np

from fclib import _core
from fclib.recorders._assemble import Contacts, Limits, assemble
from fclib.recorders._recorded import Recorded, SetupError, checked

BETA, SIGMA = 1.0, 1e-3  # SAP's parameters of near rigid contacts, and of stiction
SOLVED: Final = 1e-4  # relative error of velocities that SAP's tolerance explains


def drake(plant: Any, context: Any, law: Literal["hard", "sap"] = "hard") -> Recorded:
    """The problem of the step that begins at a context of the plant.

    Args:
        plant: a finalized MultibodyPlant, of doubles, with a time step.
        context: context of the plant, inside that of its diagram.
        law: "hard" is Coulomb's; "sap" is W + R with the associated cone, Drake's own problem.

    Raises:
        ImportError: Drake is not installed.
        ValueError: the plant is continuous, has sampled output, constraints, locked joints or
            contacts that are no points; for "sap", a geometry has no stiffness, or a joint is at
            its limit.
    """
    drakes: Any = importlib.import_module("pydrake.all")
    h = plant.time_step()
    if not h > 0:
        raise SetupError("the plant is continuous: it has no discrete steps")
    refuse(plant, context)
    n = plant.num_velocities()
    world = plant.world_frame()
    v0 = np.array(plant.GetVelocities(context))
    M = plant.CalcMassMatrix(context)
    forces = drakes.MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    port = plant.get_applied_spatial_force_input_port()
    for one in port.Eval(context) if port.HasValue(context) else ():
        body = plant.get_body(one.body_index)
        arm = body.EvalPoseInWorld(context).rotation().matrix() @ one.p_BoBq_B
        body.AddInForce(context, arm, one.F_Bq_W, world, forces)
    tau = plant.CalcGeneralizedForces(context, forces)
    if plant.num_actuated_dofs():
        net = plant.get_net_actuation_output_port().Eval(context)
        tau = tau + plant.MakeActuationMatrix() @ net
    port = plant.get_applied_generalized_force_input_port()
    if port.HasValue(context):
        tau = tau + port.Eval(context)
    damping = np.zeros(n)
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        where = slice(joint.velocity_start(), joint.velocity_start() + joint.num_velocities())
        damping[where] = joint.GetDampingVector(context)
    # force elements also have the damping of joints, which the step treats implicitly
    tau = tau + damping * v0 - plant.CalcBiasTerm(context)
    A = M + h * np.diag(damping)
    v_free = np.linalg.solve(A, M @ v0 + h * tau)

    query = plant.get_geometry_query_input_port().Eval(context)
    inspector = query.inspector()
    pairs = query.ComputePointPairPenetration()
    results = plant.get_contact_results_output_port().Eval(context)
    others = results.num_hydroelastic_contacts() + results.num_deformable_contacts()
    if others or results.num_point_pair_contacts() != len(pairs):
        raise ValueError(
            "contacts of surfaces are not recorded: set the plant's contact model to kPoint"
        )
    rows, mu, points, frames, bodies, w, material = [], [], [], [], [], [], []
    for pair in pairs:
        sides = [
            plant.GetBodyFromFrameId(inspector.GetFrameId(identifier))
            for identifier in (pair.id_A, pair.id_B)
        ]
        known = [_material(inspector, identifier) for identifier in (pair.id_A, pair.id_B)]
        (a, ka, ta), (b, kb, tb) = known
        share = 0.5 if not (ka and kb) else ka / (ka + kb)
        point = share * pair.p_WCa + (1 - share) * pair.p_WCb
        normal = np.array(pair.nhat_BA_W)
        # any two tangents will do: take those from the axis that is least along N
        first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
        first /= np.linalg.norm(first)
        frame = np.stack((normal, first, np.cross(normal, first)))
        J = np.zeros((3, n))
        for body, sign in zip(sides, (1.0, -1.0), strict=True):
            local = body.EvalPoseInWorld(context).inverse() @ point
            J += sign * (
                frame
                @ plant.CalcJacobianTranslationalVelocity(
                    context, drakes.JacobianWrtVariable.kV, body.body_frame(), local, world, world
                )
            )
        rows.append(J)
        mu.append(2 * a * b / (a + b) if a + b else 0.0)
        points.append(point)
        frames.append(frame)
        # N points from B to A
        bodies.append((int(sides[1].index()), int(sides[0].index())))
        material.append((ka * kb / (ka + kb) if ka and kb else 0.0, ta + tb))
        w.append(-pair.depth)
    nc = len(rows)
    J = np.reshape(rows, (3 * nc, n))
    speeds = np.zeros(3 * nc)
    compliance = None
    if law == "sap" and nc:
        stiffness, dissipation = np.array(material).T
        if not (stiffness > 0).all():
            raise ValueError(
                'law "sap" needs point_contact_stiffness of every geometry in contact'
                " (AddContactMaterial of its ProximityProperties)"
            )
        speeds[0::3] = np.array(w) / (h + dissipation)
        Delassus = J @ np.linalg.solve(A, J.T)
        compliance = np.zeros(3 * nc)
        for c in range(nc):
            block = slice(3 * c, 3 * c + 3)
            size = np.linalg.norm(Delassus[block, block]) / 3
            stiff = 1 / (h * stiffness[c] * (h + dissipation[c]))
            compliance[3 * c] = max(BETA**2 * size / (4 * np.pi**2), stiff)
            compliance[3 * c + 1 : 3 * c + 3] = SIGMA * size
    contacts = Contacts(
        jacobian=J,
        mu=mu,
        w=speeds,
        point=np.reshape(points, (nc, 3)),
        frame=np.reshape(frames, (nc, 3, 3)),
        bodies=np.reshape(bodies, (nc, 2)).astype(np.int64),
        gap=-np.array([pair.depth for pair in pairs]),
    )
    limits = _limits(plant, context, v0, h)
    if limits is not None and law == "sap":
        raise ValueError('a joint is at its limit, which is recorded by the law "hard" only')
    count = 0 if limits is None else len(np.asarray(limits.w))
    guess = _reaction(results, contacts, pairs, h, count)
    recorded = Recorded(
        assembled=assemble(A, v_free, h, contacts, limits=limits, compliance=compliance),
        engine="Drake",
        version=importlib.metadata.version("drake"),
        licence="BSD-3-Clause",
        law=(
            "SAP: compliant, associated (u in K*, no shift)"
            if law == "sap"
            else "SAP's contacts by Coulomb's law, rigid"
        ),
        time=context.get_time(),
        h=h,
        fields={
            "M": "exact",
            "f": "exact",
            "H": "exact",
            "w": "exact" if law == "sap" else "reconstructed",
            "mu": "exact",
        },
        guess=guess,
        velocity=_velocity_after(plant, context),
        contacts=contacts,
        more={"associated": law == "sap"},
    )
    # the reaction of a limit is not told
    return recorded if limits is not None else checked(recorded, SOLVED)


def refuse(plant: Any, context: Any) -> None:
    """Raise SetupError or ValueError if a step has what is not recorded."""
    if plant.has_sampled_output_ports():
        raise SetupError(
            "the plant's output is that of the last step: call SetUseSampledOutputPorts(False)"
            " before Finalize"
        )
    if any(plant.GetConstraintActiveStatus(context, one) for one in plant.GetConstraintIds()):
        raise SetupError("the plant has constraints, and only joints are recorded")
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        if joint.is_locked(context):
            raise ValueError(f"joint {joint.name()} is locked, which is not recorded")


def _material(inspector: Any, identifier: Any) -> tuple[float, float, float]:
    """Dynamic friction, stiffness (0: not given) and relaxation time of a geometry."""
    properties = inspector.GetProximityProperties(identifier)

    def known(name: str, default: float) -> float:
        if not properties.HasProperty("material", name):
            return default
        return float(properties.GetProperty("material", name))

    friction = 0.0
    if properties.HasProperty("material", "coulomb_friction"):
        friction = properties.GetProperty("material", "coulomb_friction").dynamic_friction()
    return friction, known("point_contact_stiffness", 0.0), known("relaxation_time", 0.1)


def _limits(plant: Any, context: Any, v0: Any, h: float) -> Limits | None:
    """Limits of joints with one coordinate that a step at the present velocity would exceed."""
    q = plant.GetPositions(context)
    rows, w = [], []
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        if joint.num_velocities() != 1 or joint.num_positions() != 1:
            continue
        i, k = joint.velocity_start(), joint.position_start()
        for sign, bound in (
            (1.0, joint.position_lower_limits()[0]),
            (-1.0, joint.position_upper_limits()[0]),
        ):
            gap = sign * (q[k] - bound)
            if np.isfinite(bound) and gap + 0.5 * h * sign * v0[i] <= 0:
                row = np.zeros(len(v0))
                row[i] = sign
                rows.append(row)
                w.append(0.0)
    return Limits(jacobian=np.array(rows), w=w) if rows else None


def _reaction(
    results: Any, contacts: Contacts, pairs: Any, h: float, limits: int
) -> _core.Solution | None:
    """Drake's own impulses, in the order of the problem's contacts."""
    assert contacts.frame is not None
    r = np.zeros((len(contacts) + limits, 3))
    place = {(int(p.id_A.get_value()), int(p.id_B.get_value()), i): i for i, p in enumerate(pairs)}
    known: dict[tuple[int, int], list[int]] = {}
    for a, b, i in place:
        known.setdefault((a, b), []).append(i)
    for k in range(results.num_point_pair_contacts()):
        info = results.point_pair_contact_info(k)
        pair = info.point_pair()
        candidates = known.get((int(pair.id_A.get_value()), int(pair.id_B.get_value())))
        if candidates:
            i = candidates.pop(0)
            r[i] = -h * contacts.frame[i] @ info.contact_force()
    return _core.Solution(r=r.ravel()) if r.size else None


def _velocity_after(plant: Any, context: Any) -> Any:
    """V (n) after Drake's own step."""
    updates = plant.AllocateDiscreteVariables()
    plant.CalcForcedDiscreteVariableUpdate(context, updates)
    state = updates.value(0) if hasattr(updates, "value") else updates.get_vector(0).value()
    return np.array(state[plant.num_positions() :])
