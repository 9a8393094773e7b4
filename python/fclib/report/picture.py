"""A problem's bodies as a small picture: from above at an angle, or a plane from the front.

Triangles are painted from the far ones to the near ones, by Pillow. Fixed bodies are painted first,
and only their insides, so that a box shows its content. A long thin scene, a stack or a chain, is
painted twice: whole in a strip, and a part of it large. A problem without bodies is drawn as its
matrix.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from fclib._files import replace_file
from fclib.report.solids import PLANE, Array, Solids, unit

FINE = 3  # pixels painted for each pixel kept, along each side
THUMB, LARGE = (200, 150), (960, 720)
TURN, TILT = 0.6, 0.3  # [rad] of the eye about z, above the ground
LONG = 1.5  # length over width and height from which a scene along y counts as long
MARGIN = 1.12
THIN = 0.15  # thickness over length of a scene, below which a part of it is shown large
FEW = 3  # least number of moving bodies of such a scene
STRIP = 0.2  # share of the picture for the whole scene
PATCH = 10  # largest size in pixels of a triangle that is painted whole
CUTS = 24  # largest number of cuts of a triangle
CELLS = 50  # number of cells of a matrix along a side
# colours of bodies in turn; of fixed bodies; by status open, stick, slide; as in style.css
TINTS = ((91, 143, 201), (217, 150, 82), (106, 176, 140), (186, 128, 176), (201, 178, 84))
FIXED = (150, 160, 170)
STATUSES = ((136, 149, 162), (31, 122, 71), (196, 78, 0))
LIGHT = np.array([0.35, -0.5, 0.79])


def draw(
    solids: Solids,
    path: Path,
    size: tuple[int, int] = THUMB,
    points: Array | None = None,
    forces: Array | None = None,
    statuses: str = "",
    near: Array | None = None,
) -> None:
    """Write a picture with a transparent ground, in the format of the path's suffix.

    Args:
        solids: the bodies.
        path: path of the picture.
        size: its width and height in pixels.
        points: (k, 3) points of contacts.
        forces: (k, 3) at these, drawn as arrows.
        statuses: statuses of these, as digits for open, stick, slide.
        near: (k, 3) places; one of them is the middle of a part that is shown large.

    Raises:
        ImportError: Pillow is not there.
    """
    from PIL import Image, ImageDraw

    axes = eye(solids)
    meshes = triangles_in(solids)
    vertices, triangles, _, fixed, _ = meshes
    moving = vertices[np.unique(triangles[~fixed])] if (~fixed).any() else vertices
    there = points if points is not None and len(points) else np.zeros((0, 3))
    shown = np.concatenate([moving, there]) @ axes.T
    whole = (shown.min(axis=0)[:2], shown.max(axis=0)[:2])
    wide, tall = size[0] * FINE, size[1] * FINE

    def paint(window: tuple[Array, Array], wide: int, tall: int, edge: int = 0) -> tuple[Any, Any]:
        """A picture of the part between two corners, and the map from places to its pixels."""
        low, high = window
        scale, middle = scale_of(window, wide, tall), 0.5 * (low + high)

        def pixels(x: Array) -> Array:
            at = (x[..., :2] - middle) * scale
            return np.asarray(np.stack([wide / 2 + at[..., 0], tall / 2 - at[..., 1]], axis=-1))

        picture = Image.new("RGBA", (wide, tall), (255, 255, 255, 0))
        pen = ImageDraw.Draw(picture)
        solid(pen, meshes, axes, pixels, (wide, tall), edge)
        marks(pen, pixels(there @ axes.T), 0.12 * min(wide, tall), forces, statuses, axes)
        return picture, pixels

    part = closeup(solids, whole, near if near is not None else there, axes, wide / tall)
    if part is None:
        picture, _ = paint(whole, wide, tall)
    else:
        upright = np.argmax(whole[1] - whole[0]) == 1
        strip = (round(STRIP * wide), tall) if upright else (wide, round(STRIP * tall))
        rest = (wide - strip[0], tall) if upright else (wide, tall - strip[1])
        picture = Image.new("RGBA", (wide, tall), (255, 255, 255, 0))
        small, pixels = paint(whole, *strip, 2 * FINE)  # otherwise it is thinner than a pixel
        low, high = np.sort(pixels(np.array(part)), axis=0)
        frame = [*(low - 2 * FINE).tolist(), *(high + 2 * FINE).tolist()]
        ImageDraw.Draw(small).rectangle(frame, outline=(*STATUSES[0], 255), width=FINE)
        picture.paste(small, (0, 0))
        large, _ = paint(part, *rest)
        picture.paste(large, (strip[0], 0) if upright else (0, strip[1]))
    save(picture.resize(size, Image.Resampling.LANCZOS), path)


def scale_of(window: tuple[Array, Array], wide: int, tall: int) -> float:
    """Pixels of a unit of length, if all between two corners must be visible."""
    low, high = window
    span = np.maximum(high - low, 1e-9 * (1 + np.abs(high))) * MARGIN
    return float(min(wide / span[0], tall / span[1]))


def closeup(
    solids: Solids, whole: tuple[Array, Array], near: Array, axes: Array, aspect: float
) -> tuple[Array, Array] | None:
    """Corners of the part of a long thin scene that is shown large; None for other scenes."""
    span = whole[1] - whole[0]
    along = int(np.argmax(span))
    across = 1 - along
    moving = np.flatnonzero(solids.moves[solids.body] == 1).tolist()
    if span[across] > THIN * span[along] or len(set(solids.body[moving].tolist())) < FEW:
        return None
    middle = 0.5 * (whole[0] + whole[1])
    if len(near):
        seen = near @ axes[:2].T
        middle[along] = seen[np.argmin(np.abs(seen[:, along] - middle[along])), along]
    # twice as wide as the scene is thick, and as tall as the picture has room for
    half = np.full(2, span[across])
    half[along] = span[across] * (1 / aspect if along else aspect)
    return middle - half, middle + half


def solid(
    pen: Any, meshes: Any, axes: Array, pixels: Any, size: tuple[int, int], edge: int
) -> None:
    """Paint triangles, the far ones first; large ones in parts, since each has one depth."""
    vertices, triangles, tint, fixed, flat = meshes
    corners = (vertices @ axes.T)[triangles]  # to the right, up, towards the eye
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals /= np.maximum(lengths, 1e-300)[:, None]
    front = normals[:, 2] > 0
    # of moving bodies the outside, of fixed ones the inside, of a plane its upper side
    kept = np.where(fixed, np.where(flat, front, ~front), front) & (lengths > 0)
    light = axes @ LIGHT
    shade = 0.62 + 0.38 * np.clip(np.where(fixed & ~flat, -1.0, 1.0) * (normals @ light), -0.3, 1)
    parts, of = halved(corners[kept], pixels, ~fixed[kept], size)
    of = np.flatnonzero(kept)[of]
    depth = np.where(fixed[of], -1e30, 0.0) + parts[:, :, 2].mean(axis=1)
    order = np.argsort(depth, kind="stable")
    outlines = pixels(parts[order]).reshape(-1, 6).tolist()
    for k, outline in zip(of[order].tolist(), outlines, strict=True):
        colour = FIXED if fixed[k] else TINTS[tint[k] % len(TINTS)]
        own = tuple(int(min(255.0, c * shade[k])) for c in colour)
        own = (*own, 70 if fixed[k] else 255)
        pen.polygon(outline, fill=own, outline=own if edge else None, width=edge)


def halved(corners: Array, pixels: Any, chosen: Any, size: tuple[int, int]) -> tuple[Array, Any]:
    """Triangles (t, 3, 3), those chosen cut across their longest edges until these are short.

    It also returns the original triangle of each. Parts outside the picture are left out.
    """
    of = np.arange(len(corners))
    done, origins = [corners[~chosen]], [of[~chosen]]
    left, own = corners[chosen], of[chosen]
    for _ in range(CUTS):
        flat = pixels(left)
        inside = ((flat.max(axis=1) >= 0) & (flat.min(axis=1) <= size)).all(axis=1)
        left, own, flat = left[inside], own[inside], flat[inside]
        edges = np.linalg.norm(np.roll(flat, -1, axis=1) - flat, axis=2)
        large = edges.max(axis=1) > PATCH * FINE
        done.append(left[~large])
        origins.append(own[~large])
        left, own = left[large], own[large]
        if not len(left):
            break
        turned = (edges[large].argmax(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(left, turned[..., None], axis=1), 1, 0)
        half = 0.5 * (a + b)
        left = np.concatenate([np.stack([a, half, c], axis=1), np.stack([half, b, c], axis=1)])
        own = np.concatenate([own, own])
    return np.concatenate([*done, left]), np.concatenate([*origins, own])


def marks(
    pen: Any, at: Array, longest: float, forces: Array | None, statuses: str, axes: Array
) -> None:
    """Dots at contacts, and the forces there as arrows."""
    dot = max(1.5 * FINE, longest / 30)
    for k, (x, y) in enumerate(at.tolist()):
        own = STATUSES[int(statuses[k])] if statuses else STATUSES[0]
        pen.ellipse((x - dot, y - dot, x + dot, y + dot), fill=(*own, 255))
    if forces is not None:
        # draw each on the body that it lifts, as on the pages
        lifted = forces * np.where(forces[:, 2:] < 0, -1.0, 1.0)
        arrows(pen, at, lifted @ axes.T, longest, statuses)


def draw_matrix(matrix: Any, path: Path, size: tuple[int, int] = THUMB) -> None:
    """Write a picture of a matrix: a colour for each sign, darker for larger entries.

    In a large matrix a cell shows the largest of several entries.
    """
    from PIL import Image

    entries = sp.coo_matrix(matrix)
    rows, columns = entries.shape
    step = max(1, -(-max(rows, columns) // CELLS))
    grid = np.zeros((-(-rows // step), -(-columns // step)))
    order = np.argsort(np.abs(entries.data), kind="stable")
    grid[entries.row[order] // step, entries.col[order] // step] = entries.data[order]
    most = np.abs(grid).max(initial=0.0) or 1.0
    # from a millionth of the largest entry to the largest
    weight = 1.0 + np.log10(np.maximum(np.abs(grid) / most, 1e-6)) / 6.0
    tint = np.where((grid > 0)[..., None], TINTS[0], TINTS[1])
    cells = 255 - (255 - tint) * (0.3 + 0.7 * weight)[..., None]
    alpha = np.where(grid == 0, 0, 255)[..., None]
    image = Image.fromarray(np.concatenate([cells, alpha], axis=-1).astype(np.uint8), "RGBA")
    side = 0.9 * min(size[0] / grid.shape[1], size[1] / grid.shape[0])
    shape = [max(1, round(n * side)) for n in grid.shape[::-1]]
    picture = Image.new("RGBA", size, (255, 255, 255, 0))
    at = ((size[0] - shape[0]) // 2, (size[1] - shape[1]) // 2)
    picture.paste(image.resize((shape[0], shape[1]), Image.Resampling.BOX), at)
    save(picture, path)


def save(picture: Any, path: Path) -> None:
    """Write an image, whole or not at all: a small file, the same each time."""
    small = {"quality": 70, "method": 4} if path.suffix == ".webp" else {"optimize": True}
    replace_file(path, lambda beside: picture.save(beside, path.suffix[1:], **small))


def arrows(pen: Any, at: Array, forces: Array, longest: float, statuses: str) -> None:
    """Arrows with heads, the largest force the longest."""
    most = float(np.linalg.norm(forces, axis=1).max(initial=0.0))
    if most == 0.0:
        return
    along = forces[:, :2] * (1.0, -1.0) * (longest / most)
    for k, ((x, y), (u, v)) in enumerate(zip(at.tolist(), along.tolist(), strict=True)):
        colour = STATUSES[int(statuses[k])] if statuses else STATUSES[0]
        length = float(np.hypot(u, v))
        if length < FINE:
            continue
        head = min(0.35 * length, 5.0 * FINE)
        a, b = u / length, v / length
        pen.line((x, y, x + u - a * head, y + v - b * head), fill=(*colour, 255), width=FINE + 1)
        base = (x + u - a * head, y + v - b * head)
        side = (-b * head * 0.45, a * head * 0.45)
        ends = (base[0] + side[0], base[1] + side[1], base[0] - side[0], base[1] - side[1])
        pen.polygon((x + u, y + v, *ends), fill=(*colour, 255))


def eye(solids: Solids) -> Array:
    """Rows: the directions in the world that point right, up and to the eye."""
    turn, tilt = (0.0, 0.0) if solids.planar else (TURN, TILT)
    moving = np.flatnonzero(solids.moves[solids.body] == 1).tolist()
    if moving and not solids.planar:
        x, y, z = np.ptp(np.concatenate([solids.world(k) for k in moving]), axis=0)
        if y > LONG * max(x, z):
            turn -= np.pi / 2  # a scene that is long along y lies across the picture
    right = np.array([np.cos(turn), np.sin(turn), 0.0])
    back = np.array([np.sin(turn) * np.cos(tilt), -np.cos(turn) * np.cos(tilt), np.sin(tilt)])
    return np.array([right, np.cross(back, right), back])


def triangles_in(solids: Solids) -> tuple[Array, Any, Any, Any, Any]:
    """Vertices (v, 3), triangles (t, 3); of each its body, and whether it is fixed or a plane."""
    vertices, triangles, tint, fixed, flat = [], [], [], [], []
    count = 0
    plane = unit(PLANE, 2, 4)[0]
    for shape, body in enumerate(solids.body.tolist()):
        own, faces = solids.meshes[solids.kind[shape]]
        vertices.append(solids.world(shape))
        triangles.append(faces + count)
        count += len(own)
        tint += [body] * len(faces)
        fixed += [not solids.moves[body]] * len(faces)
        flat += [own.shape == plane.shape and bool((own == plane).all())] * len(faces)
    return (
        np.concatenate(vertices),
        np.concatenate(triangles),
        np.array(tint),
        np.array(fixed, bool),
        np.array(flat, bool),
    )
