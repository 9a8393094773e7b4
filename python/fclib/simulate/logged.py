"""States from a file, recorded on a real robot or by another simulator."""

from __future__ import annotations

import csv
import re
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import Any, Final

import numpy as np

from fclib._regular import regular
from fclib.simulate.arrays import Vector
from fclib.simulate.mujoco_model import MujocoModel

NEEDED: Final = ("qpos", "qvel")


def logged(path: Path, model: MujocoModel) -> tuple[Vector, Vector]:
    """The states of a file, in the form of a model's `position` (K x nq) and `velocity` (K x n).

    An .npz file has arrays qpos (K x nq), qvel (K x nv) and, if the forces depend on them, ctrl
    (K x nu), act (K x na) and time (K), as in MuJoCo's MjData. A .csv file has them in columns with
    the names qpos0, qpos1, ..., qvel0, ..., time in its first line; other columns are not read.

    Raises:
        OSError: the file cannot be read.
        ValueError: its arrays do not fit the model, or are not finite.
    """
    m = model.model
    if model.has_gait:
        raise ValueError(
            f"{path}: {model.scene.name} takes no states, its gait depends on the time"
        )
    sizes = {"qpos": m.nq, "qvel": m.nv, "act": m.na, "ctrl": m.nu}
    needed: tuple[str, ...] = NEEDED
    if model.timed:
        sizes["time"] = 1
        needed = (*NEEDED, "time")
    known = of_columns(path, sizes) if path.suffix == ".csv" else of_arrays(path, sizes)
    missing = [name for name in needed if name not in known]
    if missing:
        why = f", on which the drives of {model.scene.name} depend" if missing == ["time"] else ""
        there = ", ".join(known) or "nothing"
        raise ValueError(f"{path}: has no {missing[0]}{why} (it has {there})")
    rows = len(known["qpos"])
    if not rows:
        raise ValueError(f"{path}: has no state")
    for name, values in known.items():
        if values.shape != (rows, sizes[name]):
            raise ValueError(
                f"{path}: {name} has the shape {values.shape}, and {model.scene.name} needs"
                f" ({rows}, {sizes[name]})"
            )
        bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if bad.size:
            raise ValueError(f"{path}: {name}, row {bad[0]}: is not finite")
    # what the file lacks is as at the start
    parts = [known["qpos"], known.get("act", np.tile(model.data.act, (rows, 1)))]
    if model.timed:
        parts.append(known["time"])
    if m.nu:
        parts.append(known.get("ctrl", np.tile(model.data.ctrl, (rows, 1))))
    return np.hstack(parts), known["qvel"]


def of_arrays(path: Path, wanted: Collection[str]) -> dict[str, Vector]:
    """The arrays of an .npz file. Raises OSError, ValueError."""
    try:
        with np.load(regular(path), allow_pickle=False) as arrays:
            found = {
                name: np.atleast_2d(np.asarray(arrays[name], dtype=float))
                for name in wanted
                if name in arrays
            }
    except (ValueError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: is no .npz file of states: {error}") from None
    if "time" in found:
        # one number a state
        found["time"] = found["time"].reshape(-1, 1)
    return found


def of_columns(path: Path, wanted: Collection[str]) -> dict[str, Vector]:
    """The columns of a .csv file. Raises OSError, ValueError."""
    with regular(path).open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    names = [name.strip() for name in rows[0]] if rows else []
    found: dict[str, list[tuple[int, int]]] = {}
    for column, name in enumerate(names):
        match = re.fullmatch(rf"({'|'.join(wanted)})[_\[]?(\d+)\]?", name)
        if match:
            found.setdefault(match[1], []).append((int(match[2]), column))
        elif name == "time" and name in wanted:
            found.setdefault(name, []).append((0, column))
    known: dict[str, Any] = {}
    for name, places in found.items():
        places.sort()
        numbers = [number for number, _ in places]
        if numbers != list(range(len(numbers))):
            raise ValueError(f"{path}: its columns of {name} are {numbers}, not 0, 1, ...")
        known[name] = np.zeros((len(rows) - 1, len(places)))
        for i, row in enumerate(rows[1:]):
            try:
                known[name][i] = [float(row[column]) for _, column in places]
            except (ValueError, IndexError):
                raise ValueError(f"{path}: line {i + 2}: {name} is not a row of numbers") from None
    return known
