"""Pieces of MJCF text that the families share: physics options, light, sky, floor, cubes.

The format is MuJoCo's: https://mujoco.readthedocs.io/en/stable/XMLreference.html
Numbers are written with `repr`, so that text and float are the same to the last bit.
"""

from __future__ import annotations

import colorsys
import math
from collections.abc import Iterable, Mapping
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

# the looks do not act on the mechanics; angles in radians everywhere
_FLOOR = """\
    <geom name="floor" type="plane" size="0 0 1" pos="0 0 {floor_z!r}" material="floor"
          condim="{condim}" friction="{floor_mu!r} 0 {floor_mu_r!r}"/>
"""
_DOCUMENT = """\
<mujoco model="{name}">
  <compiler angle="radian" alignfree="true"/>
  <option timestep="{time_step!r}" gravity="0 0 {gravity!r}" cone="elliptic" jacobian="sparse"/>
  <size memory="256M"/>
  <visual>
    <headlight ambient="0.46 0.46 0.48" diffuse="0.2 0.2 0.2" specular="0.05 0.05 0.05"/>
    <quality shadowsize="4096" offsamples="8"/>
    <map fogstart="4" fogend="12" haze="0.3"/>
    <rgba haze="0.93 0.95 0.97 1" fog="0.93 0.95 0.97 1"/>
  </visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1="0.93 0.95 0.97"
             rgb2="0.55 0.68 0.82" width="512" height="512"/>
    <texture name="checker" type="2d" builtin="checker" rgb1="0.84 0.85 0.86"
             rgb2="0.77 0.79 0.81" width="512" height="512"/>
    <material name="floor" texture="checker" texuniform="true" texrepeat="{tiles!r} {tiles!r}"
              reflectance="0" specular="0.1" shininess="0.1"/>
    <material name="solid" specular="0.25" shininess="0.35"/>
{assets}
  </asset>
  <worldbody>
    <light type="directional" pos="0 0 0" dir="-0.72 0.22 -0.85"
           diffuse="0.56 0.55 0.52" specular="0.15 0.15 0.15" castshadow="true"/>
{floor}{bodies}
  </worldbody>
{rest}
</mujoco>
"""


def document(
    name: str,
    *,
    bodies: Iterable[str],
    assets: Iterable[str] = (),
    time_step: float,
    gravity: float,
    floor_mu: float,
    tile: float,
    floor_z: float = 0.0,
    condim: int = 3,
    floor_mu_r: float = 0.0,
    rest: Iterable[str] = (),
    velocity: Iterable[float] | None = None,
    multiccd: bool = True,
    floor: bool = True,
) -> str:
    """An MJCF document: the bodies above a horizontal floor, or without one.

    time_step in s, gravity (downwards) in m/s^2, floor_mu without unit, floor_mu_r in m, floor_z
    the floor's height in m; tile is the edge of the floor's squares in m; velocity at the start
    (n); rest: further elements, as equality constraints. MuJoCo takes for a contact the larger
    friction of its two geometries.

    multiccd: if faces of meshes or of cylinders meet, there are several points. Near contact,
    MuJoCo 4.0.0 then gives false distances for cylinders and capsules with each other, with boxes
    and with meshes. A scene with such pairs must switch it off.
    """
    elements = list(rest)
    if not multiccd:
        elements.append('<option><flag multiccd="disable"/></option>')
    if velocity is not None:
        elements.append(f'<keyframe><key name="start" qvel="{numbers(*velocity)}"/></keyframe>')
    return _DOCUMENT.format(
        name=name,
        time_step=time_step,
        gravity=-gravity,
        # two squares a texture
        tiles=0.5 / tile,
        assets=indent(assets),
        bodies=indent(bodies),
        floor=_FLOOR.format(
            floor_mu=floor_mu, floor_z=floor_z, condim=condim, floor_mu_r=floor_mu_r
        )
        if floor
        else "",
        rest=indent(elements),
    )


def margins(margin: float) -> list[str]:
    """By the law of gaps, two geometries are in contact up to this gap [m]."""
    # those of two geometries add up
    return [f'<default><geom margin="{0.5 * margin!r}"/></default>'] if margin else []


def indent(elements: Iterable[str]) -> str:
    return "\n".join("    " + element for element in elements)


def numbers(*values: float) -> str:
    """An MJCF list of numbers, exact."""
    return " ".join(repr(float(value)) for value in values)


def block_mesh(name: str, length: float, width: float, height: float) -> str:
    """A block as a mesh: faces touch in the corners of their overlap, 4 for a block on a plane.

    The box primitive gives up to 8 points for the same pair.
    """
    a, b, c = 0.5 * length, 0.5 * width, 0.5 * height
    corners = [numbers(x, y, z) for x in (-a, a) for y in (-b, b) for z in (-c, c)]
    return f'<mesh name="{name}" vertex="{"  ".join(corners)}"/>'


def polyhedra(random: np.random.Generator, count: int) -> npt.NDArray[np.float64]:
    """The corners (count x 8 x 3) of random convex polyhedra, on the unit sphere.

    One corner in each octant, away from its edges: none is flat, none a needle.
    """
    octants = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = octants * random.uniform(0.4, 1.0, size=(count, 8, 3))
    unit: npt.NDArray[np.float64] = corners / np.linalg.norm(corners, axis=2, keepdims=True)
    return unit


def hexahedra(random: np.random.Generator, count: int) -> npt.NDArray[np.float64]:
    """The corners (count x 8 x 3) of random convex hexahedra, the farthest one on the unit sphere.

    Their six faces are flat quadrilaterals: two that meet touch in several points.
    """
    found = np.empty((count, 8, 3))
    octants = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    for k in range(count):
        # planes n . x = d, opposite ones nearly parallel
        normals = np.stack([-np.eye(3), np.eye(3)]) + 0.2 * random.uniform(-1, 1, size=(2, 3, 3))
        offsets = random.uniform(0.6, 1.0, size=(2, 3))
        for i, octant in enumerate(octants):
            which = (octant, np.arange(3))
            found[k, i] = np.linalg.solve(normals[which], offsets[which])
        found[k] -= found[k].mean(axis=0)
        found[k] /= np.linalg.norm(found[k], axis=1).max()
    return found


def on_a_face(corners: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The corners of `hexahedra` (count x 8 x 3), turned so that a flat face looks down."""
    turned = np.empty_like(corners)
    for k, shape in enumerate(corners):
        # the first face along z: corners 0, 2, 4, 6
        a, b = shape[4] - shape[0], shape[2] - shape[0]
        up = np.cross(a, b)
        up *= np.sign(up[2]) / np.linalg.norm(up)
        x = a / np.linalg.norm(a)
        turned[k] = shape @ np.stack((x, np.cross(up, x), up)).T
    return turned


def polyhedron_mesh(name: str, corners: npt.NDArray[np.float64]) -> str:
    """The convex hull of corners (k x 3) [m], with the origin of the coordinates."""
    return f'<mesh name="{name}" vertex="{"  ".join(numbers(*corner) for corner in corners)}"/>'


def sphere(
    index: int, count: int, place: Iterable[float], radius: float, density: float, friction: str
) -> str:
    """Free sphere `index` of `count`: place and radius in m, density in kg/m^3, a `surface`."""
    shape = f'type="sphere" size="{radius!r}" density="{density!r}"'
    return grain(f"sphere{index}", place, shape, friction, shade(index, count))


def rotations(random: np.random.Generator, count: int) -> npt.NDArray[np.float64]:
    """Unit quaternions (count x 4), uniform over all rotations."""
    draws = random.standard_normal(size=(count, 4))
    unit: npt.NDArray[np.float64] = draws / np.linalg.norm(draws, axis=1, keepdims=True)
    return unit


def surface(mu: float, mu_r: float | None = None, mu_s: float | None = None) -> str:
    """The attributes of a geometry's friction; with mu_r [m] its contacts roll, d = 5.

    With mu_s [m] alone they resist spin, d = 4.
    """
    if mu_s is not None:
        return f'friction="{mu!r} {mu_s!r} 0" condim="4"'
    if mu_r is None:
        return f'friction="{mu!r}" condim="3"'
    return f'friction="{mu!r} 0 {mu_r!r}" condim="6"'


def driven(loops: Iterable[str], motors: Iterable[str], controls: str) -> list[str]:
    """What closes and drives linkages: equalities, actuators, and their controls at the start."""
    return [
        "<equality>",
        *loops,
        "</equality>",
        "<actuator>",
        *motors,
        "</actuator>",
        f'<keyframe><key name="start" ctrl="{controls}"/></keyframe>',
    ]


def grain(
    name: str,
    place: Iterable[float],
    shape: str,
    friction: str,
    colour: str,
    rotation: Iterable[float] = (1, 0, 0, 0),
) -> str:
    """A free body of one geometry: type, sizes and mass in `shape`, the rest from `surface`."""
    return (
        f'<body name="{name}" pos="{numbers(*place)}" quat="{numbers(*rotation)}"><freejoint/>'
        f'<geom {shape} {friction} material="solid" rgba="{colour}"/></body>'
    )


def shade(index: int, count: int) -> str:
    """The colour of body `index` of `count`: from blue to sand, every second one lighter."""
    t = index / max(count - 1, 1)
    hue = 0.58 - 0.47 * t
    lightness = 0.52 + 0.08 * (index % 2)
    red, green, blue = colorsys.hls_to_rgb(hue, lightness, 0.45)
    return f"{red:.3f} {green:.3f} {blue:.3f} 1"


def walls(
    reach: float | tuple[float, float], height: float, mu: float, condim: int = 3
) -> list[str]:
    """Four walls without end, at x = +-reach and y = +-reach [m], drawn as a frame of some height.

    Two reaches are those along x and along y. A plane hides what is behind it, so the walls
    themselves are not drawn.
    """
    half = np.broadcast_to(reach, 2)
    elements = [
        f'<geom name="wall{side}" type="plane" size="0 0 1" pos="{numbers(*place)}"'
        f' zaxis="{numbers(*(-np.sign(place)))}" condim="{condim}" friction="{mu!r}"'
        ' rgba="0 0 0 0"/>'
        for side, place in enumerate(
            np.array([*half, 0]) * np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
        )
    ]
    return elements + posts(reach, height)


def posts(reach: float | tuple[float, float], height: float) -> list[str]:
    """A frame around x = +-reach, y = +-reach [m], drawn and touched by nothing."""
    half = np.broadcast_to(reach, 2)
    elements = []
    ring = np.array([*half, 0]) * np.array([(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0)])
    top = np.array([0, 0, height])
    for i, corner in enumerate(ring):
        following = ring[(i + 1) % 4]
        for start, end in ((corner, corner + top), (corner + top, following + top)):
            elements.append(bar(start, end, 0.01 * float(half.max())))
    return elements


# of a body that moves in the plane x, z: n = 3, M diagonal
IN_PLANE = (
    '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint axis="0 1 0"/>'
)


def disc(name: str, place: tuple[float, float], radius: float, density: float, look: str) -> str:
    """A disc in the plane x, z: mass density pi r^2, inertia m r^2 / 2. It collides as a sphere.

    place: x, z [m]; density in kg/m^2; look: further attributes of its geometry, as its friction.
    """
    mass = density * math.pi * radius**2
    inertia = 0.5 * mass * radius**2
    return (
        f'<body name="{name}" pos="{numbers(place[0], 0, place[1])}">{IN_PLANE}'
        f'<inertial pos="0 0 0" mass="{mass!r}" diaginertia="{numbers(*[inertia] * 3)}"/>'
        f'<geom type="sphere" size="{radius!r}" material="solid" {look}/></body>'
    )


def block(name: str, place: tuple[float, float], mesh: str, mass: float, look: str) -> str:
    """A block in the plane x, z, in the shape of a mesh (`block_mesh`); as `disc`."""
    return (
        f'<body name="{name}" pos="{numbers(place[0], 0, place[1])}">{IN_PLANE}'
        f'<geom type="mesh" mesh="{mesh}" mass="{mass!r}" material="solid" {look}/></body>'
    )


def lines(walls: Iterable[tuple[tuple[float, float], tuple[float, float]]], look: str) -> list[str]:
    """Straight walls without end in the plane x, z, each drawn as a bar between two points [m].

    Bodies are to the left of the way from the first point to the second. A plane hides what is
    behind it, so it is not drawn itself.
    """
    elements = []
    for i, ((x, z), (x2, z2)) in enumerate(walls):
        length = math.hypot(x2 - x, z2 - z)
        elements.append(
            f'<geom name="line{i}" type="plane" size="0 0 1" pos="{numbers(x, 0, z)}"'
            f' zaxis="{numbers(z - z2, 0, x2 - x)}" rgba="0 0 0 0" {look}/>'
        )
        elements.append(
            f'<geom type="capsule" size="{0.01 * length!r}" contype="0" conaffinity="0" mass="0"'
            f' fromto="{numbers(x, 0, z, x2, 0, z2)}" rgba="0.45 0.47 0.5 1"/>'
        )
    return elements


def uneven_ground(
    random: np.random.Generator,
    height: float,
    edge: float,
    along: tuple[float, float],
    across: float,
    mu: float,
) -> list[str]:
    """Fixed square blocks of drawn heights, up to `height` [m], edge by edge.

    They cover along[0] < x < along[1] and |y| < across [m].
    """
    columns = math.ceil((along[1] - along[0]) / edge)
    rows = math.ceil(2 * across / edge)
    heights = height * random.uniform(size=(columns, rows))
    elements = []
    for i in range(columns):
        for j in range(rows):
            top = float(heights[i, j])
            # deep enough to have a flat top only
            place = (along[0] + (i + 0.5) * edge, (j + 0.5 - 0.5 * rows) * edge, top - 0.5 * edge)
            tone = 0.5 + 0.2 * top / max(height, 1e-12)
            elements.append(
                f'<geom type="box" size="{numbers(0.5 * edge, 0.5 * edge, 0.5 * edge)}"'
                f' pos="{numbers(*place)}" condim="3" friction="{mu!r}" material="solid"'
                f' rgba="{tone:.3f} {tone:.3f} {0.95 * tone:.3f} 1"/>'
            )
    return elements


def bar(start: Iterable[float], end: Iterable[float], radius: float) -> str:
    """A rod from one point to another [m], drawn and touched by nothing."""
    return (
        f'<geom type="capsule" size="{radius!r}" contype="0" conaffinity="0" mass="0"'
        f' fromto="{numbers(*start, *end)}" rgba="0.45 0.47 0.5 1"/>'
    )


def check(
    family: object,
    *,
    positive: Iterable[str] = (),
    non_negative: Iterable[str] = (),
    at_least: Mapping[str, float] = MappingProxyType({}),
) -> None:
    """Raise ValueError if a parameter of a family is out of its range."""
    bounds = [(name, ">", 0.0) for name in positive] + [(name, ">=", 0.0) for name in non_negative]
    bounds += [(name, ">=", bound) for name, bound in at_least.items()]
    for name, relation, bound in bounds:
        value = getattr(family, name)
        if not (value > bound if relation == ">" else value >= bound) or not math.isfinite(value):
            raise ValueError(
                f"{type(family).__name__}: {name} must be {relation} {bound:g}, not {value}"
            )
