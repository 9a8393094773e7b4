"""From a scene of Siconos' mechanics, the HDF5 file of its `mechanics_run`, to MJCF.

    /data/ref/SHAPE             `type` primitive (`primitive` names it; its numbers), convex
                                (points) or vtp (the text of a .vtp file, `scale`)
    /data/input/BODY            place, orientation, velocity (spin in the body's own axes), mass and
                                inertia about its centre of mass; without mass it is fixed
    /data/input/BODY/CONTACTOR  shape_name, group, translation and orientation in the body
    /data/nslaws/LAW            NewtonImpactFrictionNSL: mu, e, and its two groups

Only groups with a law between them touch. The file may have steps that Siconos has simulated; the
scene begins at its start.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from xml.sax.saxutils import quoteattr

import numpy as np
import numpy.typing as npt

from fclib.scenes.shared import mjcf, siconos_input

Vector = npt.NDArray[np.float64]

SIGNATURE: Final = b"\x89HDF\r\n\x1a\n"
LAW: Final = "NewtonImpactFrictionNSL"
# what a scene may have besides, and no problem here holds
FURTHER: Final = {
    "joints": "a joint",
    "boundary_conditions": "a boundary condition",
    "external_functions": "an external function",
    "permanent_interactions": "a permanent interaction",
}
# numbers of each primitive; a plane has none, its normal is its third axis
PRIMITIVES: Final = {**siconos_input.PRIMITIVES, "Plane": 0}
GROUPS: Final = 31  # bits of MuJoCo's masks of collision


@dataclass(frozen=True)
class Read:
    """A scene of Siconos: its MJCF text, and what else it says."""

    xml: str
    restitution: float


@dataclass(frozen=True)
class Shape:
    """A shape, as a geometry of MJCF."""

    attributes: str
    mesh: str = ""  # the element that the geometry needs
    centred: bool = True  # whether its centre of mass is known to be at its origin


def is_one(path: Path) -> bool:
    """Whether a file is one of HDF5, hence no text. OSError."""
    with path.open("rb") as file:
        return file.read(len(SIGNATURE)) == SIGNATURE


def read(path: Path, time_step: float, gravity: float) -> Read:
    """The scene of a file.

    Args:
        path: of the file.
        time_step: which the file does not have [s].
        gravity: likewise, downwards [m/s^2].

    Raises:
        ImportError: h5py is missing.
        OSError: the file cannot be read.
        ValueError: something in it is wrong or is not taken; it names the file and the object.
    """
    try:
        import h5py
    except ImportError as error:
        raise ImportError(
            f"{path}: h5py reads a scene of Siconos, and is missing: pip install 'fclib[simulate]'"
        ) from error
    with h5py.File(path, "r") as file:
        data = file.get("data")
        if not isinstance(data, h5py.Group) or not {"ref", "input", "nslaws"} <= set(data):
            raise ValueError(
                f"{path}: has no /data/ref, /data/input and /data/nslaws, hence is no scene of"
                " Siconos' mechanics"
            )
        if int(file.attrs.get("dimension", 3)) != 3:
            raise ValueError(f"{path}: is a scene in the plane, and only those in space are taken")
        for name, word in FURTHER.items():
            if len(data.get(name, ())):
                raise ValueError(
                    f"{path}, /data/{name}/{next(iter(data[name]))}: is {word}, which is not taken"
                )
        laws, mu, restitution = laws_of(data["nslaws"], str(path))
        masks = masks_of(laws, path)
        shapes = {
            name: shape_of(shape, f"{path}, /data/ref/{name}", f"shape{k}")
            for k, (name, shape) in enumerate(data["ref"].items())
        }
        bodies, velocity = [], []
        # in the order in which they were added
        order = sorted(data["input"].items(), key=lambda one: int(one[1].attrs["id"]))
        for name, body in order:
            where = f"{path}, /data/input/{name}"
            text, speeds = body_of(body, name, shapes, masks, mu, where)
            bodies.append(text)
            velocity += speeds
    if not velocity:
        raise ValueError(f"{path}: no body moves")
    meshes = [shape.mesh for shape in shapes.values() if shape.mesh]
    return Read(
        '<mujoco model="scene"><compiler angle="radian" alignfree="false"/>'
        f'<option timestep="{time_step!r}" gravity="0 0 {-gravity!r}" cone="elliptic"'
        ' jacobian="sparse"/><size memory="256M"/>\n'
        f"<asset>\n{mjcf.indent(meshes)}\n</asset>\n"
        f"<worldbody>\n{mjcf.indent(bodies)}\n</worldbody>\n"
        f'<keyframe><key name="start" qvel="{mjcf.numbers(*velocity)}"/></keyframe>\n</mujoco>\n',
        restitution,
    )


def laws_of(laws: Any, where: str) -> tuple[list[tuple[int, int]], float, float]:
    """The pairs of groups that touch, with the one friction and restitution of all."""
    pairs = []
    values: dict[tuple[float, float], str] = {}
    for name, law in laws.items():
        kind = text_of(law.attrs["type"])
        if kind != LAW:
            raise ValueError(f"{where}, /data/nslaws/{name}: is a {kind}; only {LAW} is taken")
        pairs.append((int(law.attrs["gid1"]), int(law.attrs["gid2"])))
        values.setdefault((float(law.attrs["mu"]), float(law.attrs["e"])), name)
    if not values:
        raise ValueError(f"{where}: has no law of contact in /data/nslaws")
    if len(values) > 1:
        raise ValueError(
            f"{where}: the laws {' and '.join(list(values.values())[:2])} differ in mu or e, and a"
            " scene here has one of each"
        )
    ((mu, restitution),) = values
    if not (0 <= mu < math.inf and 0 <= restitution <= 1):
        raise ValueError(
            f"{where}, /data/nslaws/{values[mu, restitution]}: mu = {mu:g} or e ="
            f" {restitution:g} is out of range"
        )
    return pairs, mu, restitution


def masks_of(pairs: list[tuple[int, int]], path: Path) -> dict[int, tuple[int, int]]:
    """Each group's own bit, and the bits of those that it touches."""
    groups = sorted({group for pair in pairs for group in pair})
    if len(groups) > GROUPS:
        raise ValueError(f"{path}: has {len(groups)} groups of collision, and {GROUPS} are taken")
    bit = {group: 1 << k for k, group in enumerate(groups)}
    touched = dict.fromkeys(groups, 0)
    for one, other in pairs:
        touched[one] |= bit[other]
        touched[other] |= bit[one]
    return {group: (bit[group], touched[group]) for group in groups}


def shape_of(shape: Any, where: str, name: str) -> Shape:
    """A shape of the file; a mesh of MJCF gets the name."""
    mesh = f'type="mesh" mesh="{name}"'
    kind = text_of(shape.attrs.get("type", "primitive"))
    if kind == "convex":
        points = np.array(shape[()], dtype=float)
        if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
            raise ValueError(f"{where}: its points are no rows of three finite numbers")
        return Shape(mesh, hull(points, name, where), centred=False)
    if kind == "vtp":
        text = shape[0]
        points = siconos_input.points_in(text if isinstance(text, bytes) else text.encode(), where)
        points = points * float(shape.attrs.get("scale", 1.0))
        return Shape(mesh, siconos_input.convex_mesh(points, where, name), centred=False)
    if kind != "primitive":
        raise ValueError(f"{where}: a shape of type {kind} is not taken")
    primitive = text_of(shape.attrs["primitive"])
    sizes = np.array(shape[()], dtype=float).ravel().tolist()
    if primitive not in PRIMITIVES:
        raise ValueError(f"{where}: the primitive {primitive} is not taken")
    if primitive == "Plane":
        return Shape('type="plane" size="0 0 1"')
    text, _, needed = siconos_input.primitive_of(primitive, sizes, where, name).partition("\n")
    return Shape(text, needed)


def hull(points: Vector, name: str, where: str) -> str:
    """The mesh of the convex hull of points."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        corners = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        raise ValueError(f"{where}: its points have no volume") from None
    vertices = "  ".join(mjcf.numbers(*corner) for corner in corners)
    return f'<mesh name="{name}" vertex="{vertices}"/>'


def body_of(
    body: Any,
    name: str,
    shapes: Mapping[str, Shape],
    masks: Mapping[int, tuple[int, int]],
    mu: float,
    where: str,
) -> tuple[str, list[float]]:
    """The element of a body, and its velocity; none if it is fixed."""
    mass = float(body.attrs.get("mass", 0.0))
    moves = mass > 0
    born, dies = (body.attrs.get(word) for word in ("time_of_birth", "time_of_death"))
    if (born is not None and float(born) > 0) or dies is not None:
        raise ValueError(f"{where}: comes or goes during the simulation, which is not taken")
    if "fext" in body.attrs and np.any(body.attrs["fext"]):
        raise ValueError(f"{where}: has an external force of its own, which is not taken")
    place = numbers(body.attrs["translation"], 3, f"{where}, translation")
    turn = numbers(body.attrs["orientation"], 4, f"{where}, orientation")
    centre = numbers(body.attrs.get("center_of_mass", (0, 0, 0)), 3, f"{where}, center_of_mass")
    inertia = body.attrs.get("inertia")
    if not len(body):
        raise ValueError(f"{where}: has no contactor")
    elements = []
    if moves and inertia is not None:
        elements.append(inertial(np.array(inertia, dtype=float), mass, where))
    for label, contactor in body.items():
        own = f"{where}/{label}"
        shape = text_of(contactor.attrs["shape_name"])
        if shape not in shapes:
            raise ValueError(f"{own}: asks for the shape {shape}, which /data/ref lacks")
        group = int(contactor.attrs.get("group", 0))
        kind, touched = masks.get(group, (0, 0))
        at = numbers(contactor.attrs["translation"], 3, f"{own}, translation") - centre
        turned = numbers(contactor.attrs["orientation"], 4, f"{own}, orientation")
        text = shapes[shape].attributes
        if moves and inertia is None and not (shapes[shape].centred and not at.any()):
            raise ValueError(
                f"{where}: has no inertia, and {label} is no primitive about its centre of mass"
            )
        if moves and 'type="plane"' in text:
            raise ValueError(f"{own}: a plane cannot move")
        if " quat=" in text:  # the axis of Bullet's shape is y
            turned = product(turned, np.array(siconos_input.ALONG_Y))
            text = text[: text.index(" quat=")]
        # without an inertia the first shape has all mass, as in Siconos
        weight = f' mass="{0.0 if inertia is not None or len(elements) else mass!r}"'
        elements.append(
            f'<geom {text} pos="{mjcf.numbers(*at)}" quat="{mjcf.numbers(*turned)}"'
            f'{weight if moves else ""} friction="{mu!r}" condim="3" contype="{kind}"'
            f' conaffinity="{touched}"/>'
        )
    text = (
        f'<body name={quoteattr(name)} pos="{mjcf.numbers(*place)}"'
        f' quat="{mjcf.numbers(*turn)}">{"<freejoint/>" if moves else ""}{"".join(elements)}</body>'
    )
    speeds = numbers(body.attrs.get("velocity", (0,) * 6), 6, f"{where}, velocity")
    return text, speeds.tolist() if moves else []


def inertial(inertia: Vector, mass: float, where: str) -> str:
    """The element of an inertia about the centre of mass, in the body's own axes."""
    full = np.diag(inertia) if inertia.shape == (3,) else inertia
    if full.shape != (3, 3) or not np.allclose(full, full.T, rtol=1e-12, atol=0):
        raise ValueError(f"{where}: its inertia is neither three numbers nor a symmetric matrix")
    if not np.linalg.eigvalsh(full).min() > 0:
        raise ValueError(f"{where}: its inertia is not positive definite")
    rows = full[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return f'<inertial pos="0 0 0" mass="{mass!r}" fullinertia="{mjcf.numbers(*rows)}"/>'


def product(a: Vector, b: Vector) -> Vector:
    """The quaternion of the rotation b, then a."""
    w, x = a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.array([w, *x])


def numbers(values: Any, count: int, where: str) -> Vector:
    """So many finite numbers; of four, a quaternion, not all 0."""
    found = np.array(values, dtype=float).ravel()
    if found.shape != (count,) or not np.isfinite(found).all():
        raise ValueError(f"{where}: is not {count} finite numbers")
    if count == 4 and not np.linalg.norm(found) > 0:
        raise ValueError(f"{where}: its quaternion is 0")
    return found


def text_of(value: Any) -> str:
    """A string of the file."""
    return value.decode() if isinstance(value, bytes) else str(value)
