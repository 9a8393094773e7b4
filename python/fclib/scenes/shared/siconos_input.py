"""From Siconos' old input files to MJCF: input.dat, ref.txt beside it, and the .vtp shapes.

A line of ref.txt is a shape, numbered from 0: the path of a .vtp file, relative to ref.txt, or

    Sphere RADIUS   Capsule RADIUS LENGTH   Cylinder RADIUS LENGTH   Box X Y Z

with edges and lengths in full, and the axis of a capsule and a cylinder along y, as Bullet has it.
A line of input.dat is a body: shape, group, mass, place (3), quaternion w, x, y, z, velocity (3)
and spin in the body's own axes (3). A body of a negative group is fixed. A body is homogeneous. A
.vtp shape must be convex, with its centre of mass at its origin, where Siconos puts it.
"""

from __future__ import annotations

import base64
import itertools
import math
import zlib
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from fclib._regular import regular
from fclib.scenes.shared import mjcf

Vector = npt.NDArray[np.float64]

SUFFIX: Final = ".dat"
GRAVITY: Final = 9.80665  # [m/s^2] Siconos' own
SHAPES: Final = "ref.txt"
BODY: Final = 16  # numbers of a line of input.dat
PRIMITIVES: Final = {"Sphere": 1, "Capsule": 2, "Cylinder": 2, "Box": 3}  # numbers of each
TYPES: Final = {"Float32": "<f4", "Float64": "<f8", "UInt32": "<u4", "UInt64": "<u8"}
# of the size of a shape: what single precision leaves of a vertex, or of a centre of mass
ROUNDING: Final = 1e-5
ALONG_Y: Final = (math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0)  # MJCF's shapes lie along z


def mjcf_of(path: Path, mu: float, time_step: float, gravity: float) -> str:
    """The MJCF text of the scene of an input.dat.

    Args:
        path: of input.dat.
        mu: coefficient of friction, which the file does not have.
        time_step: likewise [s].
        gravity: likewise, downwards [m/s^2].

    Raises:
        OSError: a file cannot be read.
        ValueError: something in it is wrong or is not taken; it names the file and the line.
    """
    shapes = shapes_of(path.with_name(SHAPES))
    bodies: list[str] = []
    velocity: list[float] = []
    used: dict[int, str] = {}
    for number, words in lines(path):
        where = f"{path}, line {number}"
        values = numbers_of(words, where)
        if len(values) != BODY:
            raise ValueError(f"{where}: has {len(values)} numbers, and a body has {BODY}")
        shape, group, mass = int(values[0]), int(values[1]), values[2]
        if not 0 <= shape < len(shapes):
            raise ValueError(
                f"{where}: asks for shape {shape}; {SHAPES} has {len(shapes)}, from 0 on"
            )
        if not np.linalg.norm(values[6:10]) > 0:
            raise ValueError(f"{where}: its quaternion is 0")
        fixed = group < 0
        if not fixed and not mass > 0:
            raise ValueError(f"{where}: a body that moves needs a positive mass, not {mass:g}")
        if shape not in used:
            used[shape] = shape_of(path.with_name(SHAPES), *shapes[shape], f"shape{shape}")
        geom = used[shape].partition("\n")[0]
        weight = "" if fixed else f' mass="{mass!r}"'
        bodies.append(
            f'<body name="body{len(bodies)}" pos="{mjcf.numbers(*values[3:6])}"'
            f' quat="{mjcf.numbers(*values[6:10])}">{"" if fixed else "<freejoint/>"}'
            f'<geom {geom}{weight} friction="{mu!r}" condim="3"/></body>'
        )
        if not fixed:
            velocity += values[10:]
    if not velocity:
        raise ValueError(f"{path}: no body moves")
    meshes = [text.partition("\n")[2] for text in used.values()]
    return (
        '<mujoco model="input"><compiler angle="radian" alignfree="false"/>'
        f'<option timestep="{time_step!r}" gravity="0 0 {-gravity!r}" cone="elliptic"'
        ' jacobian="sparse"/><size memory="256M"/>\n'
        f"<asset>\n{mjcf.indent(mesh for mesh in meshes if mesh)}\n</asset>\n"
        f"<worldbody>\n{mjcf.indent(bodies)}\n</worldbody>\n"
        f'<keyframe><key name="start" qvel="{mjcf.numbers(*velocity)}"/></keyframe>\n</mujoco>\n'
    )


def files_of(path: Path) -> list[Path]:
    """The files to which an input.dat refers, as far as they are there. As `mjcf_of` raises."""
    reference = path.with_name(SHAPES)
    named = [reference.parent / words[0] for _, words in shapes_of(reference)]
    return [reference, *(file for file in named if file.is_file())]


def lines(path: Path) -> list[tuple[int, list[str]]]:
    """The lines of a file that are not empty, with their numbers from 1 on, in words."""
    text = path.read_text(encoding="utf-8").splitlines()
    return [(number, line.split()) for number, line in enumerate(text, 1) if line.strip()]


def numbers_of(words: list[str], where: str) -> list[float]:
    """Words as finite numbers. ValueError."""
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    if not np.isfinite(values).all():
        raise ValueError(f"{where}: has a number that is not finite")
    return values


def shapes_of(path: Path) -> list[tuple[int, list[str]]]:
    """The lines of ref.txt."""
    found = lines(path)
    if not found:
        raise ValueError(f"{path}: has no shape")
    return found


def shape_of(path: Path, number: int, words: list[str], name: str) -> str:
    """The attributes of a geometry; on a second line the mesh that it needs."""
    where = f"{path}, line {number}"
    kind = words[0]
    if kind.endswith(".vtp"):
        return f'type="mesh" mesh="{name}"\n{mesh_of(path.parent / kind, where, name)}'
    if kind not in PRIMITIVES:
        raise ValueError(
            f"{where}: the shape {kind!r} is not taken; it may be a .vtp file or"
            f" {', '.join(PRIMITIVES)}"
        )
    return primitive_of(kind, numbers_of(words[1:], where), where, name)


def primitive_of(kind: str, sizes: list[float], where: str, name: str) -> str:
    """The attributes of one of the PRIMITIVES; on a second line the mesh that it needs."""
    if len(sizes) != PRIMITIVES[kind] or not min(sizes) > 0:
        raise ValueError(f"{where}: {kind} has {PRIMITIVES[kind]} positive numbers")
    if kind == "Sphere":
        return f'type="sphere" size="{sizes[0]!r}"'
    if kind == "Box":
        return f'type="mesh" mesh="{name}"\n{mjcf.block_mesh(name, *sizes)}'
    size = mjcf.numbers(sizes[0], 0.5 * sizes[1])
    return f'type="{kind.lower()}" size="{size}" quat="{mjcf.numbers(*ALONG_Y)}"'


def mesh_of(path: Path, where: str, name: str) -> str:
    """A convex shape of a .vtp file, with its centre of mass at its origin."""
    if not path.is_file():
        raise ValueError(f"{where}: the shape {path} is not there")
    points = points_of(path)
    text = convex_mesh(points, f"{where}: {path}", name)
    size = float(np.abs(points).max())
    centre = centre_of(points)
    if np.abs(centre).max() > ROUNDING * size:
        raise ValueError(
            f"{where}: the centre of mass of {path} is {np.linalg.norm(centre):g} m from its"
            " origin, where Siconos puts it"
        )
    return text


def convex_mesh(points: Vector, what: str, name: str) -> str:
    """The mesh of the points of a convex shape. ValueError: it is not convex, or has no volume."""
    from scipy.spatial import ConvexHull, QhullError

    points = np.unique(points, axis=0)
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        raise ValueError(f"{what} has no volume") from None
    depth = -(hull.equations[:, :3] @ points.T + hull.equations[:, 3:]).max(axis=0)
    if depth.max() > ROUNDING * float(np.abs(points).max()):
        raise ValueError(f"{what} is not convex: a vertex lies {depth.max():g} m inside its hull")
    corners = "  ".join(mjcf.numbers(*point) for point in points)
    return f'<mesh name="{name}" vertex="{corners}"/>'


def centre_of(points: Vector) -> Vector:
    """The centre of mass of the hull of points."""
    from scipy.spatial import ConvexHull

    inside = points.mean(axis=0)
    edges = points[ConvexHull(points).simplices] - inside
    volumes = np.abs(np.linalg.det(edges))
    centre: Vector = inside + volumes @ edges.sum(axis=1) / 4 / volumes.sum()
    return centre


def points_of(path: Path) -> Vector:
    """(k x 3) the points of a .vtp file. OSError, ValueError."""
    return points_in(regular(path).read_bytes(), str(path))


def points_in(text: bytes, what: str) -> Vector:
    """(k x 3) the points in VTK's XML: as text, or binary, compressed by zlib or not."""
    try:
        root = ElementTree.fromstring(text)
        array = root.find("PolyData/Piece/Points/DataArray")
        if array is None:
            raise ValueError("it has no points")
        if array.get("format") == "ascii":
            values = np.array((array.text or "").split(), dtype=float)
        else:
            appended = root.find("AppendedData")
            coded = (array.text or "").strip()
            if array.get("format") == "appended":
                if appended is None or appended.get("encoding") != "base64":
                    raise ValueError("its data are not in base64")
                start = int(array.get("offset", "0"))
                coded = (appended.text or "").strip().removeprefix("_")[start:]
            header = TYPES[root.get("header_type", "UInt32")]
            data = decoded(coded, header, "compressor" in root.attrib)
            values = np.frombuffer(data, TYPES[array.get("type", "")]).astype(float)
        points: Vector = values.reshape(-1, 3)
    except (ElementTree.ParseError, KeyError, ValueError, zlib.error) as error:
        raise ValueError(f"{what}: is no .vtp file that is read here: {error}") from None
    if not np.isfinite(points).all():
        raise ValueError(f"{what}: has a point that is not finite")
    return points


def decoded(text: str, header: str, compressed: bool) -> bytes:
    """The bytes of an array in base64; its header says how long it is, or its blocks."""
    width = np.dtype(header).itemsize

    def words(count: int) -> Any:
        length = 4 * math.ceil(count * width / 3)
        return np.frombuffer(base64.b64decode(text[:length])[: count * width], header).tolist()

    if not compressed:
        (size,) = words(1)
        # the header and the data are one piece
        return base64.b64decode(text[: 4 * math.ceil((width + size) / 3)])[width : width + size]
    count = words(1)[0]
    sizes = words(3 + count)[3:]
    first = 4 * math.ceil((3 + count) * width / 3)
    packed = base64.b64decode(text[first : first + 4 * math.ceil(sum(sizes) / 3)])
    ends = np.cumsum([0, *sizes]).tolist()
    return b"".join(zlib.decompress(packed[a:b]) for a, b in itertools.pairwise(ends))
