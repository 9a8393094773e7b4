"""The drawings of each problem on the site: its view, its thumbnail, and the steps of its sequence.

    data/views/12.js               patterns, spectrum, bodies and contacts of row 12
    thumbs/12.webp                 its bodies, or its matrix if the file has none
    data/sequences/SET/FAMILY.js   poses of the bodies, step after step

Each file is read once. Large data are compressed: a browser unpacks them without a library.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import os
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from fclib import _core
from fclib.report import picture
from fclib.report.solids import Array, Solids, solids_of
from fclib.report.view import as_json, view_of

PACKED = 4000  # data with more characters are compressed
STEPS = 120  # largest number of steps of a sequence
POSES = 24_000  # largest number of poses of a sequence, over all of its steps
FEWEST = 3  # least number of steps of a sequence
CONDENSED = 200  # largest number of contacts for which W is made for a small picture
MANY = 200  # with more problems, several processes share the work


@dataclass(frozen=True)
class Task:
    """A problem to draw."""

    place: int  # row of the catalogue
    file: Path
    view: bool  # whether it gets a page with its view, or only a thumbnail
    picture: Path | None  # file of a large picture


@dataclass(frozen=True)
class Drawing:
    """The result of drawing a problem."""

    place: int
    view: bool = False
    thumb: bool = False
    bytes: int = 0
    scene: str = ""  # a digest of the shapes: equal for the steps of one scene
    shapes: tuple[int, ...] = ()  # the shapes that move
    poses: Array | None = None  # (shapes, 7) place and rotation of each


def put(folder: Path, name: str, value: Any) -> int:
    """Write a data file of a site, and return its size."""
    path = folder / "data" / f"{name}.js"
    path.parent.mkdir(parents=True, exist_ok=True)
    text = as_json(value)
    if len(text) > PACKED:
        content = base64.b64encode(
            gzip.compress(text.encode(errors="replace"), 9, mtime=0)
        ).decode()
        text = f'Fclib.putPacked({as_json(name)},"{content}");\n'
    else:
        text = f"Fclib.put({as_json(name)},{text});\n"
    path.write_text(text, encoding="utf-8", errors="replace")
    return len(text)


def draw(folder: Path, task: Task) -> Drawing:
    """Draw a problem into a site's folder; nothing if its file cannot be read."""
    try:
        problem: Any = _core.read(task.file)
        solution = (
            _core.read_solution(task.file) if "solution" in _core.contents(task.file) else None
        )
        record = view_of(problem, solution) if task.view or task.picture else None
    except _core.Error:
        return Drawing(task.place)  # the file is gone or damaged; its runs stay
    size = put(folder, f"views/{task.place}", record) if record is not None and task.view else 0
    bodies, contacts = problem.bodies, problem.contacts
    thumb = folder / "thumbs" / f"{task.place}.webp"
    thumb.parent.mkdir(exist_ok=True)
    if bodies is None or contacts is None or not len(bodies.shape_kind):
        picture.draw_matrix(matrix_of(problem), thumb)
        return Drawing(task.place, task.view, thumb=True, bytes=size + thumb.stat().st_size)
    solids = solids_of(bodies, contacts)
    picture.draw(solids, thumb, near=contacts.point[(contacts.shape >= 0).all(axis=1)])
    if task.picture is not None and record is not None:
        task.picture.parent.mkdir(parents=True, exist_ok=True)
        points, forces = record["network"]["points"], record.get("forces")
        picture.draw(
            solids,
            task.picture,
            picture.LARGE,
            np.array(points, float),
            None if forces is None else np.array(forces, float),
            record.get("status", ""),
        )
    moving = np.flatnonzero(solids.moves[solids.body] == 1)
    poses = np.hstack([solids.place, solids.turn])[moving]
    return Drawing(
        task.place,
        task.view,
        thumb=True,
        bytes=size + thumb.stat().st_size,
        scene=scene_of(solids),
        shapes=tuple(moving.tolist()),
        # a pose does not describe an elastic body
        poses=None if solids.strain else poses.astype(np.float32),
    )


def matrix_of(problem: Any) -> Any:
    """The matrix drawn for a problem without bodies: W, or H if W would take long."""
    if not hasattr(problem, "H"):
        return problem.W
    return problem.condense().W if problem.nc <= CONDENSED else problem.H


def scene_of(solids: Solids) -> str:
    """A digest of the common data of the steps of one scene: bodies, shapes and their sizes."""
    digest = hashlib.sha256("\n".join(solids.names).encode())
    moving = solids.moves[solids.body] == 1
    # the drawn size of a plane differs from step to step
    for values in (solids.body, solids.kind, np.round(solids.scale[moving], 6)):
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()[:16]


def draw_all(folder: Path, tasks: Sequence[Task], jobs: int | None = None) -> Iterator[Drawing]:
    """Draw problems, in order; in several processes if there are many."""
    work: Callable[[Task], Drawing] = partial(draw, folder)
    jobs = jobs or len(os.sched_getaffinity(0))
    if jobs == 1 or len(tasks) < MANY:
        yield from map(work, tasks)
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(work, tasks, chunksize=8)


def sequences(
    folder: Path, drawn: Sequence[Drawing], rows: Sequence[dict[str, Any]]
) -> tuple[dict[tuple[str, str], list[int]], int]:
    """Write the steps of each family of one scene. Return their numbers and the bytes.

    Args:
        folder: folder of the site.
        drawn: the problems.
        rows: the catalogue.
    """
    groups: dict[tuple[str, str, str], list[Drawing]] = defaultdict(list)
    for one in drawn:
        row = rows[one.place]
        if one.poses is not None and len(one.poses) and row.get("number") is not None:
            groups[row.get("collection") or "", row["family"], one.scene].append(one)
    found: dict[tuple[str, str], list[int]] = {}
    size = 0
    for (collection, family, _), own in sorted(groups.items(), key=lambda item: -len(item[1])):
        if len(own) < FEWEST or (collection, family) in found:
            continue
        own.sort(key=lambda one: rows[one.place]["number"])
        most = max(FEWEST, min(STEPS, POSES // len(own[0].shapes)))
        if len(own) > most:
            own = [
                own[k] for k in np.unique(np.linspace(0, len(own) - 1, most).round().astype(int))
            ]
        poses = np.stack([one.poses for one in own if one.poses is not None]).astype(float)
        places = poses[:, :, :3].reshape(-1, 3)
        reach = np.array([places.min(axis=0), places.max(axis=0)])
        decimals = max(
            0, 4 - int(np.floor(np.log10(max(1e-12, float(np.ptp(reach, axis=0).max())))))
        )
        numbers = [int(rows[one.place]["number"]) for one in own]
        record = {
            "numbers": numbers,
            "at": {shape: k for k, shape in enumerate(own[0].shapes)},
            "place": (np.round(poses[:, :, :3], decimals) + 0.0).tolist(),
            "turn": (np.round(poses[:, :, 3:], 4) + 0.0).tolist(),
            "reach": (np.round(reach, decimals) + 0.0).tolist(),
        }
        size += put(folder, f"sequences/{collection}/{family}", record)
        found[collection, family] = numbers
    return found, size
