"""A wall of a million contacts: assembled, written, read in pieces, judged.

    python -m workshop.tables.million_contacts FOLDER [--contacts 1000000] [--piece 1000000]
        [--results million-contacts]

The wall is in running bond, at rest (`fclib.scenes`, family Wall), in its global form: M, H, f, w
and mu in one HDF5 file, whose datasets are chunked. It is read again whole, and once more with h5py
by pieces of so many entries, as who has not the memory would; both give the same H^T v. What is
judged is a given r: each block's own weight on its lower contacts.

Prints for each act its wall time, CPU time and the peak of memory until then.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

import fclib
from fclib.scenes.shared import assembly
from workshop.tables import _results

ROWS: list[dict[str, str]] = []


def timed(what: str, act: Callable[[], Any]) -> Any:
    """Do it, say what it took, and keep it as a row."""
    wall, cpu = time.perf_counter(), time.process_time()
    result = act()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    print(
        f"{what:28} {time.perf_counter() - wall:7.1f} s wall {time.process_time() - cpu:7.1f} s CPU"
        f" {peak:6.2f} GB",
        flush=True,
    )
    seconds = f"{time.process_time() - cpu:.1f}"
    ROWS.append({"act": what, "CPU [s]": seconds, "memory until then [GB]": f"{peak:.2f}"})
    return result


def pieces(path: Path, v: Any, size: int) -> float:
    """The largest normal velocity H^T v, H read by so many entries at a time."""
    with h5py.File(path) as file:
        H = file["fclib_global/H"]
        n = H["n"][()].item()
        u = np.zeros(n)
        nnz = H["nzmax"][()].item()
        for start in range(0, nnz, size):
            part = slice(start, min(start + size, nnz))
            # a triplet: i has the rows, p the columns
            np.add.at(u, H["p"][part], H["x"][part] * v[H["i"][part]])
    return float(np.abs(u).max())


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--contacts", type=int, default=1_000_000)
    parser.add_argument("--piece", type=int, default=1_000_000)
    _results.add_option(parser)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    path = arguments.folder / f"wall-{arguments.contacts}.hdf5"
    bodies = timed("placed", lambda: assembly.running_bond(arguments.contacts, 0))
    problem = timed("assembled", lambda: bodies.problem(0.6, "wall"))
    print(f"{problem.n} dof, {problem.nc} contacts", flush=True)
    r = np.zeros(3 * problem.nc)
    r[0::3] = np.bincount(bodies.second, minlength=len(bodies.masses))[bodies.second]
    r[0::3] = bodies.masses[bodies.second] * assembly.GRAVITY * assembly.STEP / r[0::3]
    path.unlink(missing_ok=True)
    timed("written", lambda: fclib.write(path, problem))
    size = f"{path.stat().st_size / 1e6:.0f} MB"
    print(size, flush=True)
    del problem
    problem = timed("read", lambda: fclib.read(path))
    v = np.ones(problem.n)
    worst = timed("read in pieces", lambda: pieces(path, v, arguments.piece))
    whole = float(np.abs(problem.H.T @ v).max())
    print(f"largest velocity {worst:.6g}, from the whole {whole:.6g}", flush=True)
    merit = timed("judged", lambda: fclib.merit(problem, fclib.Solution(r=r)))
    error = f"{merit.error_by('natural'):.3g}"
    print(f"natural error {error}", flush=True)
    if arguments.results:
        _results.store(
            arguments.results,
            ROWS,
            title="A wall of a million contacts",
            note=f"{problem.nc} contacts, {problem.n} degrees of freedom, a file of {size}, pieces"
            f" of {arguments.piece} entries. Of the reactions that are judged, each block's own"
            f" weight, the natural error is {error}.",
        )


if __name__ == "__main__":
    main()
