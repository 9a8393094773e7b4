"""What compression costs a client that writes each step: CPU time over that of writing plain.

    python -m workshop.tables.write_compression [FILE...] [--entries 3200000 100000]
        [--repeats 5] [--results NAME]

Local problems with a W of random numbers, of numbers that come again and of equal blocks, and the
local problems in the files, are written by the C library at each level: the least CPU time of the
repeats, which take the levels by turns, over that of level 0, and the bytes over those of level 0.
Builds our C library first, if --library names none.
"""

from __future__ import annotations

import argparse
import ctypes
import tempfile
import time
from pathlib import Path

import numpy as np
import scipy.sparse as sp

import fclib
from workshop.tables import _results
from workshop.tables._c_library import c_library

LEVELS = {"plain": 0, "1": 1, "3": 3, "6": 6}


def made(entries: int) -> dict[str, fclib.LocalProblem]:
    """Problems of about so many entries in W, a quarter full."""
    m = 3 * int(np.sqrt(4 * entries) / 3)
    rng = np.random.default_rng(1)
    pattern = sp.random_array((m, m), density=entries / m**2, format="csc", rng=rng)
    again, ones = pattern.copy(), np.ones((m // 12 * 3, m // 12 * 3))
    blocks = sp.csc_array(sp.kron(ones, np.eye(4)))
    again.data = np.round(again.data, 2)
    width = max(1, entries // m)
    band = sp.csc_array(sp.diags_array([1.0] * width, offsets=range(width), shape=(m, m)))
    matrices = {"random": pattern, "two digits": again, "pattern": blocks, "band": band}
    return {
        name: fclib.LocalProblem(
            spacedim=3, W=W, q=rng.standard_normal(W.shape[0]), mu=np.full(W.shape[0] // 3, 0.5)
        )
        for name, W in matrices.items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--entries", type=int, nargs="+", default=[3_200_000])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--library", type=Path)
    _results.add_option(parser)
    given = parser.parse_args()
    library = ctypes.CDLL(str(given.library or c_library()))
    library.fclib_read_local.restype = ctypes.c_void_p
    library.fclib_write_local.argtypes = [ctypes.c_void_p, ctypes.c_char_p]
    rows: list[dict[str, str]] = []
    print(f"{'':24}  entries" + "".join(f"  {name:>13}" for name in LEVELS))
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "source.hdf5", Path(folder) / "target.hdf5"
        problems: list[tuple[str, fclib.LocalProblem | Path]] = [
            own for entries in given.entries for own in made(entries).items()
        ]
        problems += [(path.name, path) for path in given.files]
        for name, problem in problems:
            if isinstance(problem, Path):
                path = problem
            else:
                fclib.write(source, problem, compression=0)
                path = source
            there = library.fclib_read_local(str(path).encode())
            if there is None:
                raise SystemExit(f"{path}: cannot be read")
            times = {level: float("inf") for level in LEVELS}
            sizes = {}
            for _ in range(given.repeats):
                for level, number in LEVELS.items():
                    target.unlink(missing_ok=True)
                    library.fclib_set_compression(number)
                    start = time.process_time()
                    if library.fclib_write_local(there, str(target).encode()) != 1:
                        raise SystemExit(f"{target}: cannot be written")
                    times[level] = min(times[level], time.process_time() - start)
                    sizes[level] = target.stat().st_size
            matrix = fclib.read(path, "local")
            assert isinstance(matrix, fclib.LocalProblem)
            count = (
                int(np.count_nonzero(matrix.W))
                if isinstance(matrix.W, np.ndarray)
                else (matrix.W.nnz)
            )
            cells = {
                level: f"{times[level] / times['plain']:.1f} ({sizes[level] / sizes['plain']:.1%})"
                for level in LEVELS
            }
            rows.append({"W": name, "entries": f"{count:,}", **cells})
            print(f"{name:24}  {count:7}" + "".join(f"  {cell:>13}" for cell in cells.values()))
    if given.results:
        _results.store(
            given.results,
            rows,
            title="CPU time over that of writing plain, and the bytes over those",
            note=f"The least of {given.repeats} repeats.",
        )


if __name__ == "__main__":
    main()
