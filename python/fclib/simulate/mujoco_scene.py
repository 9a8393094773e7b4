"""MuJoCo's model of an MJCF scene, and what of it no problem can hold: it is left out, and said.

Keyframes called gait... hold controls at their times: straight between them, the last one's are the
first one's again, and so on.

A planar scene moves in a plane y = const: slides along x and z, hinges about y (`plane.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from fclib.scenes import Scene
from fclib.simulate._mujoco import mujoco
from fclib.simulate.moreau_jean import Vector
from fclib.simulate.periodic import PeriodicCell, add_ghosts
from fclib.simulate.plane import NORMAL

MEMORY: Final = 256 * 2**20  # arena for contacts [bytes]; MuJoCo's own default grows to GBs
FLAT: Final = 1e-9  # sine of the angle of a joint's axis to the plane

KEYFRAMES: Final = ("start", "home", "stand")  # where a scene starts, the first that is there
# actuators whose state MuJoCo advances by its rate, which is known here
DYNAMICS: Final = tuple(
    int(getattr(mujoco.mjtDyn, f"mjDYN_{name}"))
    for name in ("NONE", "INTEGRATOR", "FILTER", "FILTEREXACT", "MUSCLE")
)

# features that a scene leaves out knowingly, and the flag of MuJoCo that does so, if any
IGNORABLE: Final = {
    "limits": mujoco.mjtDisableBit.mjDSBL_LIMIT,
    "frictionloss": mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS,
    "torsion": None,  # spin friction of condim 4: taken as condim 3
    "anisotropy": None,  # two coefficients: their geometric mean
    "activation": None,  # actuators with a state: it stays as it is at the start
}


class UnsupportedSceneError(ValueError):
    """The scene holds something that these problems cannot represent yet."""


def compile_scene(scene: Scene) -> Any:
    """The MjModel of a scene, with the options that problems need. ValueError for bad MJCF."""
    unknown = set(scene.ignore) - set(IGNORABLE)
    if unknown:
        raise ValueError(
            f"{scene.name}: cannot ignore {', '.join(sorted(unknown))};"
            f" only {', '.join(sorted(IGNORABLE))}"
        )
    try:
        if scene.path is not None:
            spec = mujoco.MjSpec.from_file(str(scene.path))
        else:
            included = {name: text.encode() for name, text in scene.includes.items()}
            spec = mujoco.MjSpec.from_string(scene.xml, include=included or None)
        if scene.period is not None:
            add_ghosts(spec)
        if spec.memory < 0:
            spec.memory = MEMORY
        m = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise ValueError(f"{scene.name}: MuJoCo refuses the MJCF: {reason}") from error

    m.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    m.opt.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    # these serve MuJoCo's own step, and override fakes margins, distances and friction
    enable = mujoco.mjtEnableBit
    for flag in (
        enable.mjENBL_OVERRIDE,
        enable.mjENBL_SLEEP,
        enable.mjENBL_IPC,
        enable.mjENBL_SPECULATIVE,
    ):
        m.opt.enableflags &= ~int(flag)
    for feature in scene.ignore:
        flag = IGNORABLE[feature]
        if flag is not None:
            m.opt.disableflags |= int(flag)
    return m


def periodic_cell(scene: Scene, m: Any) -> PeriodicCell:
    """The cell of a scene that has a period. ValueError where a body is too large for it."""
    try:
        return PeriodicCell(m, scene.period or (0.0, 0.0))
    except ValueError as error:
        raise ValueError(f"{scene.name}: {error}") from None


def has_condim(m: Any, condim: int) -> bool:
    """Whether a contact of the model may have so many components."""
    collides = (m.geom_contype != 0) | (m.geom_conaffinity != 0)
    return bool(condim in m.geom_condim[collides] or condim in m.pair_dim)


def left_out(scene: Scene, m: Any) -> tuple[str, ...]:
    """What the scene asks and no problem holds, a line each; not what it ignores knowingly."""
    lost = []
    collides = (m.geom_contype != 0) | (m.geom_conaffinity != 0)
    spins = (m.geom_condim >= 4) & collides & (m.geom_friction[:, 1] > 0)
    of_pairs = (m.pair_dim >= 4) & (m.pair_friction[:, 2] > 0)
    if (spins.any() or of_pairs.any()) and "torsion" not in scene.ignore:
        lost.append("torsional friction (condim 4 and 6)")
    differs = (m.pair_dim > 1) & (m.pair_friction[:, 0] != m.pair_friction[:, 1])
    differs |= (m.pair_dim == 6) & (m.pair_friction[:, 3] != m.pair_friction[:, 4])
    if differs.any() and "anisotropy" not in scene.ignore:
        lost.append("anisotropic friction (the mean of two coefficients)")
    if softened(m, collides):
        lost.append("solref and solimp (contacts, limits and equalities are rigid)")
    # a family whose parameter it is says itself what it is for
    if widened(m, collides) and "margin" not in scene.parameters:
        lost.append("margins (bodies touch where their surfaces do, limits act where they are)")
    if m.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        lost.append("the integrator RK4 (Moreau and Jean's scheme)")
    if not np.isin(m.actuator_dyntype, DYNAMICS).all() and "activation" not in scene.ignore:
        lost.append("states of actuators other than filters and muscles (they stay as they are)")
    if (m.actuator_delay > 0).any():
        lost.append("delays of actuators (controls act at once)")
    if m.nflex:
        lost.append("contacts of deformable bodies (flex)")
    if m.flg_surfacevel:
        lost.append("velocities of surfaces (surfacevel)")
    if m.flg_adhesion:
        lost.append("adhesion")
    if m.nplugin:
        lost.append("plugins")
    return tuple(lost)


def softened(m: Any, collides: Any) -> bool:
    """Whether a model asks for other compliances than MuJoCo's own."""
    limited, tied = m.jnt_limited.astype(bool), m.eq_active0.astype(bool)
    rows = (
        np.hstack((m.geom_solref, m.geom_solimp))[collides],
        np.hstack((m.pair_solref, m.pair_solimp)),
        np.hstack((m.jnt_solref, m.jnt_solimp))[limited],
        np.hstack((m.tendon_solref_lim, m.tendon_solimp_lim))[m.tendon_limited.astype(bool)],
        np.hstack((m.eq_solref, m.eq_solimp))[tied],
    )
    usual = (0.02, 1, 0.9, 0.95, 0.001, 0.5, 2)
    return any(bool((own != usual).any()) for own in rows)


def widened(m: Any, collides: Any) -> bool:
    """Whether MuJoCo would hold bodies apart, or stop joints, before they touch or reach limits."""
    limited, tight = m.jnt_limited.astype(bool), m.tendon_limited.astype(bool)
    return bool(
        (m.geom_margin > m.geom_gap)[collides].any()
        or (m.pair_margin > m.pair_gap).any()
        or m.jnt_margin[limited].any()
        or m.tendon_margin[tight].any()
    )


def refuse_unknown(scene: Scene, lost: tuple[str, ...]) -> None:
    """UnsupportedSceneError that names all that would be left out."""
    if lost:
        raise UnsupportedSceneError(f"{scene.name}: not supported: {'; '.join(lost)}")


def keyframe_of(scene: Scene, m: Any) -> str:
    """The keyframe where a scene starts: the one it names, or one of a usual name; empty: none.

    ValueError where it names one that is not there.
    """
    names = [m.key(i).name for i in range(m.nkey)]
    if scene.keyframe is not None:
        if scene.keyframe not in names:
            known = ", ".join(name for name in names if name) or "none"
            raise ValueError(f"{scene.name}: has no keyframe {scene.keyframe!r}; it has: {known}")
        return scene.keyframe
    return next((name for name in KEYFRAMES if name in names), "")


def refuse_out_of_plane(scene: Scene, m: Any, d: Any) -> None:
    """UnsupportedSceneError where a joint of a planar scene leaves the plane x, z."""
    mujoco.mj_kinematics(m, d)
    slide, hinge = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)
    along = np.abs(d.xaxis @ NORMAL)
    kept = ((m.jnt_type == slide) & (along < FLAT)) | ((m.jnt_type == hinge) & (along > 1 - FLAT))
    for joint in np.flatnonzero(~kept):
        body = m.body(m.jnt_bodyid[joint]).name
        raise UnsupportedSceneError(
            f"{scene.name}: joint {joint} (body {body!r}) leaves the plane x, z of a planar scene;"
            " its joints are slides along x and z and hinges about y"
        )


@dataclass(frozen=True)
class Gait:
    """Controls that change with time and come back: those of the keyframes gait..., in turn."""

    times: Vector  # (k) from 0, increasing; the last one is the period [s]
    values: Vector  # (k x nu) controls

    @classmethod
    def of(cls, scene: Scene, m: Any) -> Gait | None:
        """The gait of a model, None where it has none. ValueError where it makes no cycle."""
        keys = [m.key(i) for i in range(m.nkey) if m.key(i).name.startswith("gait")]
        if not keys:
            return None
        times = np.array([key.time[0] for key in keys])
        values = np.array([key.ctrl for key in keys])
        if len(keys) < 2 or times[0] != 0 or not (np.diff(times) > 0).all():
            raise ValueError(
                f"{scene.name}: the keyframes gait... must be two or more, their times from 0 and"
                f" increasing, not {times.tolist()}"
            )
        if (values[0] != values[-1]).any():
            raise ValueError(
                f"{scene.name}: the controls of the keyframes {keys[0].name!r} and"
                f" {keys[-1].name!r}, the first and the last, differ: the gait would jump"
            )
        return cls(times, values)

    def controls(self, time: float) -> Vector:
        """At a time [s] (nu)."""
        time = time % self.times[-1]
        after = min(int(np.searchsorted(self.times, time, side="right")), len(self.times) - 1)
        start, end = self.times[after - 1], self.times[after]
        share = (time - start) / (end - start)
        controls: Vector = (1 - share) * self.values[after - 1] + share * self.values[after]
        return controls
