"""The packings of the family Jammed: compiles jammed.cpp, runs it for each size, and stores them.

    python -m workshop.sets.jammed_packings OUT/jammed.npz
    python -m workshop.sets.jammed_packings --table [--results jammed]

With --table, nothing is made: of each stored packing the contacts, the proof and its margins. The
margin is w^T y for the reactions y of the proof, whose largest is 1: what is below 0 has no
solution.

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

from fclib.scenes.jammed import OVERLAPS, RELEASED, SIZES, Jammed
from workshop.tables import _results

SOURCE = Path(__file__).with_name("jammed.cpp")
COMPILE = ("c++", "-O2", "-std=c++20", "-ffp-contract=off", "-o")


def row(count: int) -> dict[str, Any]:
    """Of a stored packing."""
    family = Jammed()
    problem = family.of_size(count, 0.0)
    y = family.proof(problem, count)
    margins = {
        f"margin, {released:g} released": float(np.asarray(family.of_size(count, released).w) @ y)
        for released in RELEASED
    }
    return {
        "spheres": count,
        "contacts": problem.nc,
        "pressing": np.count_nonzero(y),
        "largest of H y": float(np.abs(problem.H @ y).max()),
        **margins,
    }


def main() -> None:
    """Write the file: of each size the largest radius, places and radii."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path, nargs="?")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--table", action="store_true", help="of the stored packings")
    _results.add_option(parser)
    arguments = parser.parse_args()
    if arguments.table:
        proofs = [row(count) for count in SIZES]
        for one in proofs:
            print(*one.values(), sep="  ")
        if arguments.results:
            _results.store(
                arguments.results,
                proofs,
                title="Jammed packings: contacts, proofs and margins",
                note="Pressing are the contacts that overlap. The margin is w^T y, with and without"
                " the growth that is taken back; below 0 there is no solution.",
            )
        return
    if arguments.out is None:
        parser.error("OUT is missing")
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
