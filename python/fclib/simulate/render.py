"""A picture of a state, with the contact forces as arrows, if a renderer is available.

MuJoCo draws offscreen through OpenGL: EGL (a GPU, or Mesa in software) or OSMesa. A separate
process finds out once which of them works. So a missing library, a driver that crashes and an
environment variable read at import do no harm here.

On Debian and Ubuntu libosmesa6 suffices; for EGL, libegl1, libopengl0 and libgl1-mesa-dri.
"""

from __future__ import annotations

import functools
import importlib
import math
import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from fclib._files import write_bytes
from fclib.simulate._mujoco import mujoco
from fclib.simulate.deformable import DeformableModel
from fclib.simulate.mujoco_model import MujocoModel

if TYPE_CHECKING:
    from fclib.simulate.moreau_jean import Vector
    from fclib.simulate.simulation import Model, Step

BACKENDS: Final = ("egl", "osmesa")
PROBE_LIMIT: Final = 60.0  # longest wait for a backend's answer [s]
SUPERSAMPLING: Final = 2  # pixels drawn for each pixel kept, along each axis
UPRIGHT: Final = (960, 1280)  # [pixels]
LYING: Final = (1280, 800)
FIELD_OF_VIEW: Final = 30.0  # vertical angle [deg]; narrow, so that a tower does not seem to lean
VIEW: Final = (125.0, -14.0)  # azimuth and elevation [deg]
VIEW_OF_PLANE: Final = (90.0, -2.0)  # x to the right
FILL: Final = 0.86  # share of the picture that the scene fills
OPACITY: Final = 0.35  # opacity of bodies if forces are drawn inside them
ARROW: Final = np.array([0.82, 0.12, 0.10, 1.0], dtype=np.float32)
ARROW_LENGTH: Final = 1.2  # length for the largest force, in radii of the mean geometry
ARROW_WIDTH: Final = 0.05  # width for the largest force, in the same radii
# limits of both, in distances to the nearest other contact: arrows of a mesh would hide each other
CROWDED_LENGTH: Final = 3.0
CROWDED_WIDTH: Final = 0.08
FAINT: Final = 1e-2  # forces below this share of the largest are not drawn

_PROBE = """
import sys, mujoco
from importlib import import_module
context = import_module("mujoco." + sys.argv[1]).GLContext(16, 16)
context.make_current()
model = mujoco.MjModel.from_xml_string("<mujoco/>")
mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value).free()
context.free()
"""


class NoRenderer(RuntimeError):  # noqa: N818
    """Neither EGL nor OSMesa works here."""


def render(source: Model | Step, path: str | Path, *, size: tuple[int, int] | None = None) -> None:
    """Write a PNG of a step, or of the present state of a model, whole or not at all.

    source     a step is drawn in its state at the start, with the reactions of its solution;
               a model is drawn in its present state, without reactions
    size       width and height in pixels; by default UPRIGHT or LYING, as the scene is

    NoRenderer, in one line, if no OpenGL works; OSError if the file cannot be written.
    """
    if isinstance(source, (MujocoModel, DeformableModel)):
        model, position, contacts = source, source.position, None
        forces = np.zeros((0, 3))
    else:
        model, position, contacts = source.model, source.position, source.contacts
        # an impulse over a step is a mean force
        forces = contacts.forces(source.result.solution.r) / model.time_step

    m, d = model.drawing(position)
    mujoco.mj_kinematics(m, d)
    mujoco.mj_comPos(m, d)
    mujoco.mj_camlight(m, d)
    if m.ntendon:
        mujoco.mj_tendon(m, d)

    moving = np.flatnonzero(m.body_weldid[m.geom_bodyid] != 0)
    if len(forces):
        m.geom_rgba[moving, 3] *= OPACITY
        m.mat_rgba[np.unique(m.geom_matid[moving][m.geom_matid[moving] >= 0]), 3] *= OPACITY

    points = corners(m, d, moving)
    focus = model.scene.focus
    if focus is not None:
        points = np.array(focus[:3]) + focus[3] * np.array(
            [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
        )
    view = model.scene.view or (VIEW_OF_PLANE if model.scene.planar else VIEW)
    if size is None:
        extent = np.ptp(points @ axes_of(view).T, axis=0)
        size = LYING if extent[0] > extent[1] else UPRIGHT
    width, height = (SUPERSAMPLING * pixels for pixels in size)
    m.vis.global_.offwidth, m.vis.global_.offheight = width, height
    # they take most time in software, and edges are smooth without them
    m.vis.quality.offsamples = 0
    m.vis.global_.fovy = FIELD_OF_VIEW

    light_up(m, d, points)
    scene = mujoco.MjvScene(m, maxgeom=m.ngeom + m.nsite + m.ntendon * 100 + len(forces) + 1000)
    camera = framing_camera(points, width / height, view)
    mujoco.mjv_updateScene(
        m, d, mujoco.MjvOption(), None, camera, mujoco.mjtCatBit.mjCAT_ALL.value, scene
    )
    scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = 1
    if contacts is not None and len(forces):
        radii = m.geom_rbound[moving]
        draw_arrows(scene, contacts.point, forces, float(radii.mean()) if radii.size else 1.0)

    pixels = draw(m, scene, width, height)
    write_bytes(Path(path), png(average(pixels, SUPERSAMPLING)))


@functools.cache
def backend() -> str:
    """The first of EGL and OSMesa that works, or the one in MUJOCO_GL. Raises NoRenderer."""
    named = os.environ.get("MUJOCO_GL", "").lower().strip()
    candidates = (named,) if named in BACKENDS else BACKENDS
    for candidate in candidates:
        environment = {**os.environ, "MUJOCO_GL": candidate}
        environment.pop("PYOPENGL_PLATFORM", None)
        command = [sys.executable, "-c", _PROBE, candidate]
        try:
            probe = subprocess.run(
                command, env=environment, capture_output=True, timeout=PROBE_LIMIT, check=False
            )
        except subprocess.TimeoutExpired:
            continue
        if probe.returncode == 0:
            return candidate
    raise NoRenderer(
        f"no picture: OpenGL does not work offscreen here (tried {' and '.join(candidates)});"
        " on Debian or Ubuntu, install libosmesa6"
    )


def draw(m: Any, scene: Any, width: int, height: int) -> npt.NDArray[np.uint8]:
    """The pixels (height x width x 3) of a MuJoCo scene."""
    name = backend()
    # the binding reads this once, on its first import
    os.environ["PYOPENGL_PLATFORM"] = name
    context = importlib.import_module(f"mujoco.{name}").GLContext(width, height)
    try:
        context.make_current()
        target = mujoco.MjrContext(m, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        try:
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, target)
            view = mujoco.MjrRect(0, 0, width, height)
            mujoco.mjr_render(view, scene, target)
            pixels = np.empty((height, width, 3), dtype=np.uint8)
            mujoco.mjr_readPixels(pixels, None, view, target)
        finally:
            target.free()
    finally:
        context.free()
    # OpenGL begins at the bottom
    return pixels[::-1]


def corners(m: Any, d: Any, geoms: npt.NDArray[np.intp]) -> Vector:
    """The corners (8 ngeom x 3) of boxes of the geometries named, or of all, in the world."""
    if not geoms.size:
        geoms = np.flatnonzero(m.geom_rbound > 0)
    if not geoms.size:
        return np.zeros((1, 3))
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    centre, half = m.geom_aabb[geoms, :3], m.geom_aabb[geoms, 3:]
    local = centre[:, None, :] + signs * half[:, None, :]
    rotation = d.geom_xmat[geoms].reshape(-1, 3, 3)
    world: Vector = d.geom_xpos[geoms, None, :] + np.einsum("gij,gcj->gci", rotation, local)
    return world.reshape(-1, 3)


def light_up(m: Any, d: Any, points: Vector) -> None:
    """Centre light, shadow and haze on the points (k x 3).

    A directional light casts its shadow from its position, over the length of the extent.
    """
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    radius = max(float(np.linalg.norm(points - middle, axis=1).max()), 1e-3)
    m.stat.center[:], m.stat.extent = middle, 2.0 * radius
    directional = m.light_type == mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    d.light_xpos[directional] = middle - 2.0 * radius * d.light_xdir[directional]


def axes_of(view: tuple[float, float]) -> Vector:
    """The right, up and ahead directions of a picture (rows, 3 x 3); view in degrees."""
    azimuth, elevation = np.deg2rad(view)
    ahead = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
    return np.stack([right, np.cross(right, ahead), ahead])


def framing_camera(points: Vector, aspect: float, view: tuple[float, float]) -> Any:
    """A free camera that sees all the points (k x 3) at the least distance; view in degrees."""
    axes = axes_of(view)

    # look at the middle of the visible part, not of the whole
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    seen = (points - middle) @ axes.T
    shift = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    middle = middle + shift @ axes
    seen = np.abs(seen - shift) * [1, 1, 0] + (seen - shift) * [0, 0, 1]

    slope = FILL * np.tan(0.5 * np.deg2rad(FIELD_OF_VIEW))
    distance = np.maximum(seen[:, 0] / (slope * aspect), seen[:, 1] / slope) - seen[:, 2]

    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat[:] = middle
    camera.distance = max(float(distance.max()), 1e-3)
    camera.azimuth, camera.elevation = view
    return camera


def draw_arrows(scene: Any, points: Vector, forces: Vector, radius: float) -> None:
    """Add an arrow for each force (nc x 3) at its point (nc x 3), on the pair's second body."""
    sizes = np.linalg.norm(forces, axis=1)
    largest = sizes.max(initial=0.0)
    if largest == 0:
        return
    apart = spacing(points)
    lengths = min(ARROW_LENGTH * radius, CROWDED_LENGTH * apart) * sizes / largest
    # a small arrow in proportion would be too thin to see
    widths = min(ARROW_WIDTH * radius, CROWDED_WIDTH * apart) * np.sqrt(sizes / largest)
    for i in np.flatnonzero(sizes > FAINT * largest):
        if scene.ngeom >= scene.maxgeom:
            return
        arrow = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(
            arrow, mujoco.mjtGeom.mjGEOM_ARROW, np.zeros(3), np.zeros(3), np.zeros(9), ARROW
        )
        tip = points[i] + forces[i] / sizes[i] * lengths[i]
        mujoco.mjv_connector(arrow, mujoco.mjtGeom.mjGEOM_ARROW, widths[i], points[i], tip)
        arrow.size[2] *= 2  # MuJoCo draws an arrow half as long as its connector
        # bright, even behind a wall or in the shade
        arrow.emission = 0.4
        arrow.category = mujoco.mjtCatBit.mjCAT_DECOR
        scene.ngeom += 1


def spacing(points: Vector) -> float:
    """The median distance of a point (k x 3) to its nearest other; infinite if all are equal."""
    from scipy.spatial import cKDTree  # the import takes a while

    different = np.unique(points, axis=0)
    if len(different) < 2:
        return math.inf
    nearest, _ = cKDTree(different).query(different, k=2)
    return float(np.median(nearest[:, 1]))


def average(pixels: npt.NDArray[np.uint8], factor: int) -> npt.NDArray[np.uint8]:
    """The picture (h x w x 3) made smaller by a factor: the mean of each square of pixels."""
    sums = np.zeros((pixels.shape[0] // factor, pixels.shape[1] // factor, 3), dtype=np.uint16)
    for row in range(factor):
        for column in range(factor):
            sums += pixels[row::factor, column::factor]
    mean: npt.NDArray[np.uint8] = np.rint(sums / np.float32(factor**2)).astype(np.uint8)
    return mean


def png(pixels: npt.NDArray[np.uint8]) -> bytes:
    """The bytes of a PNG file, RGB, 8 bits (ISO/IEC 15948)."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        body = kind + content
        return struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))

    height, width, _ = pixels.shape
    # every line begins with its filter: 0, none
    lines = np.zeros((height, 1 + 3 * width), dtype=np.uint8)
    lines[:, 1:] = pixels.reshape(height, -1)
    return b"".join(
        (
            b"\x89PNG\r\n\x1a\n",
            chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
            chunk(b"IDAT", zlib.compress(lines.tobytes(), 6)),
            chunk(b"IEND", b""),
        )
    )
