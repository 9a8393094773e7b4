"""A problem's bodies as a small picture: from above at an angle, or a plane from the front.

Triangles are painted from the far ones to the near ones, by Pillow. What is fixed is painted first,
its inside only, so that a box shows what is in it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from fclib.report.solids import PLANE, Array, Solids, unit

FINE = 3  # pixels that are painted for one that is kept, along each side
THUMB, LARGE = (200, 150), (960, 720)
TURN, TILT = 0.6, 0.3  # [rad] of the eye about z, above the ground
MARGIN = 1.12
# by body in turn; what is fixed; by status open, stick, slide; as in style.css
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
) -> None:
    """Write a picture with a transparent ground, in the format of the path's suffix.

    Args:
        solids: the bodies.
        path: of the picture.
        size: its width and height in pixels.
        points: (k, 3) of contacts.
        forces: (k, 3) at these, drawn as arrows.
        statuses: of these, digits of open, stick, slide.

    Raises:
        ImportError: Pillow is not there.
    """
    from PIL import Image, ImageDraw

    axes = eye(solids)
    vertices, triangles, tint, fixed, flat = triangles_in(solids)
    seen = vertices @ axes.T  # to the right, up, towards the eye
    move = vertices[np.unique(triangles[~fixed])] if (~fixed).any() else vertices
    shown = np.concatenate([move] + ([points] if points is not None and len(points) else []))
    low, high = (shown @ axes.T).min(axis=0), (shown @ axes.T).max(axis=0)
    wide, tall = size[0] * FINE, size[1] * FINE
    span = np.maximum(high - low, 1e-9 * (1 + np.abs(high)))[:2] * MARGIN
    scale = float(min(wide / span[0], tall / span[1]))
    middle = 0.5 * (low + high)[:2]

    def pixels(x: Array) -> Array:
        at = (x[..., :2] - middle) * scale
        return np.asarray(np.stack([wide / 2 + at[..., 0], tall / 2 - at[..., 1]], axis=-1))

    picture = Image.new("RGBA", (wide, tall), (255, 255, 255, 0))
    pen = ImageDraw.Draw(picture)
    corners = seen[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals /= np.maximum(lengths, 1e-300)[:, None]
    front = normals[:, 2] > 0
    # of what moves the outside, of what is fixed the inside, of a plane what is above
    kept = np.where(fixed, np.where(flat, front, ~front), front) & (lengths > 0)
    light = axes @ LIGHT
    shade = 0.62 + 0.38 * np.clip(np.where(fixed & ~flat, -1.0, 1.0) * (normals @ light), -0.3, 1)
    depth = np.where(fixed, -1e30, 0.0) + corners[:, :, 2].mean(axis=1)
    flattened = pixels(corners)
    for k in np.flatnonzero(kept)[np.argsort(depth[kept], kind="stable")].tolist():
        colour = FIXED if fixed[k] else TINTS[tint[k] % len(TINTS)]
        own = tuple(int(min(255.0, c * shade[k])) for c in colour)
        pen.polygon(flattened[k].ravel().tolist(), fill=(*own, 70 if fixed[k] else 255))
    if points is not None and len(points):
        at = pixels(points @ axes.T)
        dot = max(1.5 * FINE, 0.004 * wide)
        for k, (x, y) in enumerate(at.tolist()):
            own = STATUSES[int(statuses[k])] if statuses else STATUSES[0]
            pen.ellipse((x - dot, y - dot, x + dot, y + dot), fill=(*own, 255))
        if forces is not None:
            # on the body that each lifts, as on the pages
            lifted = forces * np.where(forces[:, 2:] < 0, -1.0, 1.0)
            arrows(pen, at, lifted @ axes.T, 0.12 * min(wide, tall), statuses)
    picture.resize(size, Image.Resampling.LANCZOS).save(path, **saving(path))


def saving(path: Path) -> dict[str, Any]:
    """How a format is written: a small file, the same each time."""
    return {"quality": 70, "method": 4} if path.suffix == ".webp" else {"optimize": True}


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
    right = np.array([np.cos(turn), np.sin(turn), 0.0])
    back = np.array([np.sin(turn) * np.cos(tilt), -np.cos(turn) * np.cos(tilt), np.sin(tilt)])
    return np.array([right, np.cross(back, right), back])


def triangles_in(solids: Solids) -> tuple[Array, Any, Any, Any, Any]:
    """Vertices (v, 3), triangles (t, 3); of each its body, whether it is fixed, and a plane."""
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
