"""The states of the family GranularFlow: compiles granular_flow.cpp, runs each size, stores them.

    python -m workshop.sets.granular_flow OUT/GranularFlow.npz [--runs DIR]

Minutes of CPU. The file goes to `collection/fclib_collection/states/`. With --runs the outputs of
the program are kept in DIR as SIZE.txt, and those that are there are taken. Another compiler gives
other last digits, and in the end other states: problems are made from the stored ones.

Places are stored to 2^-14 of a diameter, velocities to 2^-8 and spins to 2^-6 of what gravity gives
in a diameter: the grains of a flow differ by more from their own simulation with one more sweep.
Spheres are sorted by their places at the opening, so that neighbours follow each other.
"""

from __future__ import annotations

import argparse
import io
import json
import subprocess
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

import fclib
from fclib.scenes import granular_flow
from fclib.scenes.granular_flow import PLACE, RADIUS, SIZES, SPIN, STATES, VELOCITY

SOURCE = Path(__file__).with_suffix(".cpp")
COMPILE = ("c++", "-O2", "-std=c++20", "-ffp-contract=off", "-o")
EPOCH = (1980, 1, 1, 0, 0, 0)  # so that equal states make equal files


def arrays_of(size: int, text: str) -> dict[str, Any]:
    """What is stored of an output of the program."""
    lines = text.splitlines()
    count, wide, step = lines[0].split()
    n = int(count)
    radii = np.array(lines[1 : n + 1], dtype=float)
    rest = lines[n + 1 :]
    times = [float(line) for line in rest[:: n + 1]]
    if len(times) != STATES:
        raise ValueError(f"size {size}: {len(times)} states, not {STATES}")
    found: dict[str, Any] = {
        f"head{size}": np.array([float(wide), float(step)]),
        f"time{size}": np.array(times),
    }
    order = np.zeros(0, dtype=np.int64)
    for k in range(STATES):
        rows = rest[k * (n + 1) + 1 : (k + 1) * (n + 1)]
        table = np.array([row.split() for row in rows], dtype=float)
        if k == 0:
            order = np.lexsort(np.floor(table[:, :3]).T)
            found[f"radii{size}"] = packed(2 * radii[order][None], RADIUS)
        for name, unit, columns in (
            ("place", PLACE, slice(0, 3)),
            ("velocity", VELOCITY, slice(3, 6)),
            ("spin", SPIN, slice(6, 9)),
        ):
            found[f"{name}{size}_{k}"] = packed(table[order, columns].T, unit)
    return found


def packed(values: Any, unit: float) -> Any:
    """The nearest multiples of a unit, by bytes."""
    return granular_flow.planes_of(np.rint(values / unit).astype(np.int64))


def write(path: Path, arrays: dict[str, Any]) -> None:
    """An .npz that LZMA has compressed: a third smaller than NumPy's own."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_LZMA) as archive:
        for name, values in arrays.items():
            data = io.BytesIO()
            np.save(data, values)
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=EPOCH)
            entry.compress_type = zipfile.ZIP_LZMA
            archive.writestr(entry, data.getvalue())


def main() -> None:
    """Write the file, and the digests of its problems into it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--runs", type=Path)
    arguments = parser.parse_args()
    arrays: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        runs = arguments.runs or Path(folder)
        program = Path(folder) / "flow"
        subprocess.run([*COMPILE, str(program), str(SOURCE)], check=True)
        for size, edges in enumerate(SIZES):
            kept = runs / f"{size}.txt"
            if not kept.is_file():
                run = [str(program), *map(str, edges), str(size + 1), str(STATES)]
                kept.write_bytes(subprocess.run(run, check=True, stdout=subprocess.PIPE).stdout)
            arrays |= arrays_of(size, kept.read_text(encoding="ascii"))
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    write(arguments.out, arrays)
    granular_flow.path = lambda: arguments.out
    family = granular_flow.GranularFlow()
    digests = [fclib.digest(family.problem(k)) for k in range(family.problems)]
    write(arguments.out, {**arrays, "digests": np.array(json.dumps(digests))})


if __name__ == "__main__":
    main()
