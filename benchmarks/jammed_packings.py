"""The packings of the family Jammed: compiles jammed.cpp, runs it for each size, and stores them.

    .venv/bin/python benchmarks/jammed_packings.py OUT/jammed.npz

Minutes of CPU. The file goes to `python/fclib/scenes/`. Another compiler gives other last digits,
and in the end other packings: problems are made from the stored ones.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from fclib.scenes.jammed import OVERLAPS, SIZES

SOURCE = Path(__file__).with_name("jammed.cpp")
COMPILE = ("c++", "-O2", "-std=c++20", "-ffp-contract=off", "-o")


def main() -> None:
    """Write the file: of each size the largest radius, places and radii."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    arrays: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "jammed"
        subprocess.run([*COMPILE, str(program), str(SOURCE)], check=True)
        for count, overlap in zip(SIZES, OVERLAPS, strict=True):
            run = [str(program), str(count), str(arguments.seed), str(overlap)]
            first, *rows = subprocess.run(run, check=True, stdout=subprocess.PIPE).stdout.split(
                b"\n"
            )
            table = np.array([row.split() for row in rows if row], dtype=np.int64)
            arrays[f"largest{count}"] = np.array(float(first))
            arrays[f"places{count}"] = table[:, :3]
            arrays[f"radii{count}"] = table[:, 3].astype(np.int16)
    np.savez_compressed(arguments.out, **arrays)


if __name__ == "__main__":
    main()
