"""MuJoCo's model of an MJCF scene; unsupported features are left out and named.

Keyframes called gait... hold controls at their times, with linear interpolation between them. The
last keyframe's controls are the first one's, and the cycle repeats.

A planar scene moves in a plane y = const: slides along x and z, hinges about y (`plane.py`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np

from fclib.scenes import Scene
from fclib.scenes.shared.condim import collides
from fclib.scenes.shared.family import with_prefixes
from fclib.simulate._mujoco import mujoco
from fclib.simulate.moreau_jean import Vector
from fclib.simulate.periodic import PeriodicCell, add_ghosts
from fclib.simulate.plane import NORMAL

MEMORY: Final = 256 * 2**20  # arena for contacts [bytes]; MuJoCo's own default grows to GBs
FLAT: Final = 1e-9  # sine of the angle of a joint's axis to the plane

KEYFRAMES: Final = ("start", "home", "stand")  # start of a scene: the first of these that exists
# actuators with a state that MuJoCo advances by a rate known here
DYNAMICS: Final = tuple(
    int(getattr(mujoco.mjtDyn, f"mjDYN_{name}"))
    for name in ("NONE", "INTEGRATOR", "FILTER", "FILTEREXACT", "MUSCLE")
)

# features that a scene may leave out on purpose, with MuJoCo's flag for it, if any
IGNORABLE: Final = {
    "limits": mujoco.mjtDisableBit.mjDSBL_LIMIT,
    "frictionloss": mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS,
    "torsion": None,  # spin friction of condim 4 and 6: taken as condim 3, and as rolling alone
    "anisotropy": None,  # two coefficients: their geometric mean
    "activation": None,  # actuators with a state: it stays as it is at the start
}
# data of a model that must be finite: of geometries, bodies, joints, degrees of freedom
NUMBERS: Final = {
    "geom": ("friction", "size", "pos", "quat", "margin", "gap"),
    "body": ("mass", "inertia", "pos", "quat", "ipos", "iquat"),
    "jnt": ("stiffness", "range", "pos", "axis"),
    "dof": ("damping", "armature", "frictionloss"),
}


class UnsupportedSceneError(ValueError):
    """The scene holds something that these problems cannot represent yet."""


def compile_scene(scene: Scene) -> tuple[Any, tuple[str, ...]]:
    """The MjModel of a scene, with the options that problems need. ValueError for bad MJCF.

    Also the messages of MuJoCo's compiler on parts that it drops or replaces.
    """
    unknown = set(scene.ignore) - set(IGNORABLE)
    if unknown:
        raise ValueError(
            f"{scene.name}: cannot ignore {', '.join(sorted(unknown))};"
            f" only {', '.join(sorted(IGNORABLE))}"
        )
    with warnings_of() as lines:
        m = compiled(scene)
    refuse_no_numbers(scene, m)

    m.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    m.opt.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    enable = mujoco.mjtEnableBit
    dropped = [f"MuJoCo's compiler: {line}" for line in lines]
    if m.opt.enableflags & enable.mjENBL_OVERRIDE:
        dropped.append("override (each contact keeps its own friction, margin, solref and solimp)")
    # these are for MuJoCo's own step only, and "override" changes margins, distances and friction
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
    return m, tuple(dict.fromkeys(dropped))


def compiled(scene: Scene) -> Any:
    """The MjModel of a scene from its text. ValueError for bad MJCF."""
    try:
        if scene.path is not None and scene.path.read_text(encoding="utf-8") == scene.xml:
            spec = mujoco.MjSpec.from_file(str(scene.path))
        else:
            included = {name: text.encode() for name, text in scene.includes.items()}
            spec = mujoco.MjSpec.from_string(scene.xml, include=included or None)
            if scene.path is not None:
                # the text has changed, but meshes lie beside the file
                spec.modelfiledir = str(scene.path.resolve().parent)
        if scene.period is not None:
            # six degrees of freedom a body: all are free
            add_ghosts(spec, frozenset(d.dof // 6 for d in scene.drives if d.velocity))
        if spec.memory < 0:
            spec.memory = MEMORY
        if scene.ground is not None:
            add_ground(scene, spec)
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise ValueError(f"{scene.name}: MuJoCo refuses the MJCF: {reason}") from error


@contextmanager
def warnings_of() -> Iterator[list[str]]:
    """MuJoCo's warnings inside the block, one line each."""
    lines: list[str] = []
    usual = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: lines.append(" ".join(text.split())))
    try:
        yield lines
    finally:
        mujoco.set_mju_user_warning(usual)


def add_ground(scene: Scene, spec: Any) -> None:
    """Add a plane below all geometries at the start; it sets the friction of its contacts."""
    m = spec.copy().compile()
    d = mujoco.MjData(m)
    keyframe = keyframe_of(scene, m)
    if keyframe:
        mujoco.mj_resetDataKeyframe(m, d, m.key(keyframe).id)
    mujoco.mj_kinematics(m, d)
    collide = np.flatnonzero(m.geom_contype | m.geom_conaffinity).tolist()
    lowest = [bottom(m, d, g) for g in collide]
    spec.worldbody.add_geom(
        name="ground" if all(m.geom(g).name != "ground" for g in range(m.ngeom)) else "",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        pos=[0, 0, min(lowest, default=0.0)],
        size=[0, 0, 1],
        friction=[scene.ground, 0, 0],
        priority=1 + int(m.geom_priority.max(initial=0)),
    )


def bottom(m: Any, d: Any, geom: int) -> float:
    """The lowest z of a geometry [m]; for a round one that of its box, for a plane its position."""
    turn, place = d.geom_xmat[geom].reshape(3, 3), d.geom_xpos[geom]
    size, kind = m.geom_size[geom], mujoco.mjtGeom(m.geom_type[geom])
    up = turn[2]
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return float(place[2] - size[0])
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return float(place[2] - size[0] - abs(up[2]) * size[1])
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return float(place[2] - np.hypot(up[0], up[1]) * size[0] - abs(up[2]) * size[1])
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return float(place[2] - np.linalg.norm(up * size))
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        return float(place[2])
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = m.geom_dataid[geom]
        vertices = m.mesh_vert[m.mesh_vertadr[mesh] :][: m.mesh_vertnum[mesh]]
        return float(place[2] + (vertices @ up).min())
    middle, half = m.geom_aabb[geom].reshape(2, 3)
    return float(place[2] + up @ middle - np.abs(up) @ half)


def refuse_no_numbers(scene: Scene, m: Any) -> None:
    """Raise ValueError if data of a model are not finite: MuJoCo accepts them."""
    for names in (NUMBERS, numbers_of(m)):  # what others follow from comes first
        for kind, own in names.items():
            for name in own:
                values = np.asarray(getattr(m, f"{kind}_{name}"), dtype=float)
                if np.isfinite(values).all():
                    continue
                values = values.reshape(len(values), -1)
                bad = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
                refuse(scene, m, kind, bad, name, values[bad])
    for name in ("wind", "density", "viscosity"):
        if not np.isfinite(getattr(m.opt, name)).all():
            raise ValueError(f"{scene.name}: option: its {name} is not finite")


def numbers_of(m: Any) -> dict[str, list[str]]:
    """All arrays of numbers that a model has of its elements, by the kind of element."""
    return {
        kind: [
            name.removeprefix(f"{kind}_")
            for name in dir(m)
            if name.startswith(f"{kind}_") and getattr(m, name).dtype.kind == "f"
        ]
        for kind in (*NUMBERS, "tendon", "actuator", "eq", "pair", "key")
    }


def refuse(scene: Scene, m: Any, kind: str, i: int, name: str, values: Vector) -> None:
    """Raise ValueError if a value is not finite."""
    word = {"jnt": "joint", "dof": "joint", "eq": "equality", "key": "keyframe"}.get(kind, kind)
    number = int(m.dof_jntid[i]) if kind == "dof" else i
    own = getattr(m, {"dof": "jnt"}.get(kind, kind))(number).name
    raise ValueError(
        f"{scene.name}: {word} {own or number}: its {name} is not finite"
        f" ({' '.join(f'{value:g}' for value in values)})"
    )


def cannot_touch(m: Any) -> str:
    """The reason why nothing in a model can touch, in words; empty if something can."""
    if m.npair:
        return ""
    kinds = np.column_stack(
        (
            m.body_weldid[m.geom_bodyid],
            m.body_weldid[m.body_parentid[m.body_weldid[m.geom_bodyid]]],
            m.geom_contype,
            m.geom_conaffinity,
        )
    )
    weld, parent, kind, affinity = np.unique(kinds, axis=0).T
    filters = not m.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    for i in range(len(weld)):
        other = (kind[i] & affinity) | (kind & affinity[i])
        meets = (other != 0) & (weld != weld[i])
        if filters:
            meets &= ~((weld == parent[i]) & (weld != 0)) & ~((parent == weld[i]) & (weld[i] != 0))
        if meets.any():
            return ""
    rest = [
        word
        for word, there in (
            ("limits", m.jnt_limited.any() or m.tendon_limited.any()),
            ("dry friction", m.dof_frictionloss.any() or m.tendon_frictionloss.any()),
        )
        if there
    ]
    if rest:
        return f"no two shapes can touch: all contacts are of {' and '.join(rest)}"
    return "nothing can touch: no two shapes that collide, no limits, no dry friction"


def periodic_cell(scene: Scene, m: Any) -> PeriodicCell:
    """The cell of a scene that has a period. ValueError if a body is too large for it."""
    try:
        return PeriodicCell(m, scene.period or (0.0, 0.0))
    except ValueError as error:
        raise ValueError(f"{scene.name}: {error}") from None


def left_out(scene: Scene, m: Any) -> tuple[str, ...]:
    """The unsupported features of a scene, one line each, without those it ignores on purpose."""
    lost = []
    touching = collides(m)
    differs = (m.pair_dim > 1) & (m.pair_friction[:, 0] != m.pair_friction[:, 1])
    differs |= (m.pair_dim == 6) & (m.pair_friction[:, 3] != m.pair_friction[:, 4])
    if differs.any() and "anisotropy" not in scene.ignore:
        lost.append("anisotropic friction (the mean of two coefficients)")
    free = without_range(scene, m)
    if free and "limits" not in scene.ignore:
        lost.append(
            f"limits of {', '.join(free)} (the lower is not below the upper: none is there)"
        )
    if softened(m, touching):
        lost.append("solref and solimp (contacts, limits and equalities are rigid)")
    if softened_friction(m):
        lost.append("solref and solimp of dry friction (a joint or a contact sticks without creep)")
    if m.nplastic:
        lost.append("springs that yield (they stay elastic)")
    # a family explains its own parameter
    if widened(m, touching) and "margin" not in scene.parameters:
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


def without_range(scene: Scene, m: Any) -> list[str]:
    """The joints that have limits which MuJoCo drops, since the lower is not below the upper."""
    if "<robot" not in scene.xml:
        low, high = m.jnt_range.T
        dropped = ~m.jnt_limited.astype(bool) & m.jnt_range.any(axis=1) & ~(low < high)
        return [m.joint(int(joint)).name or str(joint) for joint in np.flatnonzero(dropped)]
    try:
        robot = ElementTree.fromstring(with_prefixes(scene.xml).encode())
    except ElementTree.ParseError:  # MuJoCo reads more than XML
        return []
    found = []
    for joint in robot.iter("joint"):
        limit = joint.find("limit")
        if joint.get("type") not in ("revolute", "prismatic") or limit is None:
            continue
        # by the standard of URDF a bound that is not there is 0
        if not float(limit.get("lower", "0")) < float(limit.get("upper", "0")):
            found.append(joint.get("name", ""))
    return found


# solref and solimp, MuJoCo's defaults
USUAL: Final = (0.02, 1, 0.9, 0.95, 0.001, 0.5, 2)


def softened(m: Any, touching: Any) -> bool:
    """Whether a model sets other compliances than MuJoCo's defaults."""
    limited, tied = m.jnt_limited.astype(bool), m.eq_active0.astype(bool)
    rows = (
        np.hstack((m.geom_solref, m.geom_solimp))[touching],
        np.hstack((m.pair_solref, m.pair_solimp)),
        np.hstack((m.jnt_solref, m.jnt_solimp))[limited],
        np.hstack((m.tendon_solref_lim, m.tendon_solimp_lim))[m.tendon_limited.astype(bool)],
        np.hstack((m.eq_solref, m.eq_solimp))[tied],
    )
    return any(bool((own != USUAL).any()) for own in rows)


def softened_friction(m: Any) -> bool:
    """Whether a model sets other compliances of dry friction than those of its other rows."""
    if m.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS:
        rows: tuple[Any, ...] = ()
    else:
        rows = (
            np.hstack((m.dof_solref, m.dof_solimp))[m.dof_frictionloss > 0],
            np.hstack((m.tendon_solref_fri, m.tendon_solimp_fri))[m.tendon_frictionloss > 0],
        )
    # zeros: as the normal component
    return any(bool((own != USUAL).any()) for own in rows) or bool(m.pair_solreffriction.any())


def widened(m: Any, touching: Any) -> bool:
    """Whether MuJoCo would hold bodies apart, or stop joints, before they touch or reach limits."""
    limited, tight = m.jnt_limited.astype(bool), m.tendon_limited.astype(bool)
    return bool(
        (m.geom_margin > m.geom_gap)[touching].any()
        or (m.pair_margin > m.pair_gap).any()
        or m.jnt_margin[limited].any()
        or m.tendon_margin[tight].any()
    )


def refuse_unknown(scene: Scene, lost: tuple[str, ...]) -> None:
    """Raise UnsupportedSceneError, naming all features that would be left out."""
    if lost:
        raise UnsupportedSceneError(f"{scene.name}: not supported: {'; '.join(lost)}")


def refuse_limits(scene: Scene, m: Any) -> None:
    """Raise UnsupportedSceneError if a scene with interactions has limits: these have no kinds."""
    if m.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_LIMIT:
        return
    for word, limited in (("joint", m.jnt_limited), ("tendon", m.tendon_limited)):
        for i in np.flatnonzero(limited):
            name = getattr(m, word)(int(i)).name or i
            raise UnsupportedSceneError(
                f"{scene.name}: {word} {name} has limits, for which no law is known beside"
                ' interactions of shapes; ignore "limits"'
            )


def keyframe_of(scene: Scene, m: Any) -> str:
    """The keyframe at which a scene starts: the named one, or one of a usual name; empty: none.

    ValueError if it names a missing one.
    """
    names = [m.key(i).name for i in range(m.nkey)]
    if scene.keyframe is not None:
        if scene.keyframe not in names:
            known = ", ".join(name for name in names if name) or "none"
            raise ValueError(f"{scene.name}: has no keyframe {scene.keyframe!r}; it has: {known}")
        return scene.keyframe
    return next((name for name in KEYFRAMES if name in names), "")


def refuse_out_of_plane(scene: Scene, m: Any, d: Any) -> None:
    """Raise UnsupportedSceneError if a joint of a planar scene leaves the plane x, z."""
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
    """Periodic controls: those of the keyframes gait..., one after the other."""

    times: Vector  # (k) from 0, increasing; the last one is the period [s]
    values: Vector  # (k x nu) controls

    @classmethod
    def of_scene(cls, scene: Scene, m: Any) -> Gait | None:
        """The gait of a model; None if it has none. ValueError if it is not a cycle."""
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
        """The controls (nu) at a time [s]."""
        time = time % self.times[-1]
        after = min(int(np.searchsorted(self.times, time, side="right")), len(self.times) - 1)
        start, end = self.times[after - 1], self.times[after]
        share = (time - start) / (end - start)
        controls: Vector = (1 - share) * self.values[after - 1] + share * self.values[after]
        return controls
