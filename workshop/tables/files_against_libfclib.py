"""Files of ours beside those of libfclib 3.1: how large, and how long a read and a write take.

    python -m workshop.tables.files_against_libfclib FILE... [--limit 1.5] [--csv OUT]
        [--results NAME]

Each problem (with its solution and guesses) is written by both libraries, and each library reads
both files: the same numbers, bit by bit, or the run fails. 3.1 never
compresses, ours does at level 6. Times are CPU times of a read, and of a write of a new file,
through the C interface with the file in the system's cache, the least of many that the libraries
take by turns in one process. The last line says what our bytes are, and what LZMA, which HDF5 has
no filter for, would make of the numbers. Needs h5py, a C compiler, our C library (--ours, by
default that of build/, built first) and that of 3.1 (--theirs, by default the system's, Debian's
libfclib0).
"""

from __future__ import annotations

import argparse
import csv
import ctypes
import lzma
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

from workshop.tables import _results
from workshop.tables._c_library import c_library

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(__file__).with_suffix(".c")
UNKNOWN_TO_3_1 = 3  # exit status: a kind of problem that 3.1 has no layout for
COLUMNS = (
    "bytes_3_1",
    "bytes_ours",
    "size_ratio",
    "read_3_1_ms",
    "ours_own",
    "ours_of_3_1",
    "ours_same",
    "write_plain",
    "write_packed",
    "entries",
    "indices",
    "entries_lzma",
    "indices_lzma",
)
# for numbers of 8 bytes
LZMA = [{"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME, "lc": 0, "lp": 3, "pb": 3}]


def system_library() -> Path | None:
    """The libfclib.so.0 of the system, if it is not ours."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    found = subprocess.run(
        [compiler, "-print-file-name=libfclib.so.0"], capture_output=True, text=True
    )
    path = Path(found.stdout.strip())
    if not path.is_absolute():
        return None
    # 3.1 has no such function
    return None if hasattr(ctypes.CDLL(str(path)), "fclib_last_error") else path


def parts(path: Path) -> dict[str, float]:
    """The bytes of an FCLIB file that are entries and indices, as they are and packed by LZMA."""
    found = dict.fromkeys(COLUMNS[-4:], 0.0)

    def add(_: str, data: h5py.Group | h5py.Dataset) -> None:
        if not isinstance(data, h5py.Dataset) or data.dtype.kind not in "if":
            return
        name = "entries" if data.dtype.kind == "f" else "indices"
        values = data[()]
        stored = data.id.get_storage_size()
        shuffled = np.atleast_1d(values).view(np.uint8).reshape(-1, values.itemsize).T
        packed = [
            len(lzma.compress(each.tobytes(), lzma.FORMAT_RAW, filters=LZMA))
            for each in (values, shuffled)
        ]
        found[name] += stored
        found[f"{name}_lzma"] += min(stored, *packed)

    with h5py.File(path) as file:
        file.visititems(add)
    return found


def figures(
    program: Path, libraries: list[Path], path: Path, folder: Path, limit: float
) -> dict[str, float] | str:
    """What is measured of a file, or why it is not."""
    theirs, ours = folder / "theirs.hdf5", folder / "ours.hdf5"
    copied = subprocess.run(
        [program, "copy", *libraries, path, theirs, ours],
        capture_output=True,
        text=True,
        env=os.environ | {"FCLIB_COMPRESSION": "6"},  # as of an archive
    )
    if copied.returncode == UNKNOWN_TO_3_1:
        return "3.1 does not know this kind of problem"
    if copied.returncode:
        return "cannot be copied: " + copied.stderr.strip()
    timed = subprocess.run(
        [program, "time", *libraries, theirs, ours, str(limit)], capture_output=True, text=True
    )
    if timed.returncode:
        sys.exit(f"{path}: {timed.stderr.strip()}")
    own, ours_own, ours_of_theirs, theirs_of_ours = map(float, timed.stdout.split())
    written = subprocess.run(
        [program, "write", *libraries, path, folder / "written.hdf5", str(limit)],
        capture_output=True,
        text=True,
    )
    if written.returncode:
        sys.exit(f"{path}: {written.stderr.strip()}")
    write, write_plain, write_packed = map(float, written.stdout.split())
    sizes = theirs.stat().st_size, ours.stat().st_size
    return {
        "bytes_3_1": sizes[0],
        "bytes_ours": sizes[1],
        "size_ratio": sizes[1] / sizes[0],
        "read_3_1_ms": 1e3 * own,
        "ours_own": ours_own / own,
        "ours_of_3_1": ours_of_theirs / own,
        "ours_same": ours_own / theirs_of_ours,
        "write_plain": write_plain / write,
        "write_packed": write_packed / write,
        **parts(ours),
    }


def line(name: str, row: dict[str, float]) -> str:
    return (
        f"{name[:44]:44} {row['bytes_3_1']:9.0f} {row['bytes_ours']:9.0f} "
        f"{row['size_ratio']:6.1%} {row['read_3_1_ms']:8.3f} {row['ours_of_3_1']:8.2f} "
        f"{row['ours_same']:8.2f} {row['ours_own']:8.2f} "
        f"{row['write_plain']:8.2f} {row['write_packed']:8.2f}"
    )


def summary(rows: dict[str, dict[str, float]]) -> list[dict[str, str]]:
    """Medians and ranges of the ratios."""
    shown = {
        "size_ratio": "bytes of a file",
        "ours_of_3_1": "CPU time of a read, both libraries the file of 3.1",
        "ours_same": "CPU time of a read, both libraries our file",
        "ours_own": "CPU time of a read, each its own file",
        "write_plain": "CPU time of a write, neither compresses: the default",
        "write_packed": "CPU time of a write, ours at level 6",
    }
    found = []
    for name, title in shown.items():
        values = [row[name] for row in rows.values()]
        found.append(
            {
                "ours : 3.1": title,
                "median": f"{statistics.median(values):.2f}",
                "range": f"{min(values):.2f} to {max(values):.2f}",
            }
        )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--ours", type=Path)
    parser.add_argument("--theirs", type=Path, default=None)
    parser.add_argument("--limit", type=float, default=1.5, help="CPU time on a file [s]")
    parser.add_argument("--csv", type=Path)
    _results.add_option(parser)
    options = parser.parse_args()

    theirs = options.theirs or system_library()
    if theirs is None:
        print("skipped: libfclib 3.1 or a C compiler is not installed")
        return
    ours = options.ours or c_library()

    rows: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        program = folder / "program"
        subprocess.run(
            ["cc", "-O1", f"-I{ROOT / 'include'}", "-o", program, PROGRAM, "-ldl"], check=True
        )
        print(
            f"{'':44} {'bytes':>9} {'bytes':>9} {'':>6} {'ms':>8}  "
            "CPU time, ours : 3.1, of a read and of a write\n"
            f"{'':44} {'3.1':>9} {'ours':>9} {'ratio':>6} {'3.1':>8} "
            f"{'its file':>8} {'our file':>8} {'each own':>8} {'plain':>8} {'packed':>8}"
        )
        for path in options.files:
            found = figures(program, [theirs, ours], path, folder, options.limit)
            if isinstance(found, str):
                print(f"{path.name[:44]:44} {found}")
                continue
            rows[path.name] = found
            print(line(path.name, found), flush=True)
    if not rows:
        return

    def times_of(name: str) -> list[float]:
        return [row[name] for row in rows.values()]

    medians = {name: statistics.median(times_of(name)) for name in COLUMNS}
    print(line("median", medians))
    total = sum(times_of("bytes_ours")), sum(times_of("bytes_3_1"))
    print(f"total of {len(rows)} files: {total[0]:.0f} of {total[1]:.0f} bytes, ", end="")
    print(f"{total[0] / total[1]:.1%}")
    share = {name: sum(times_of(name)) / total[1] for name in COLUMNS[-4:]}
    rest = total[0] / total[1] - share["entries"] - share["indices"]
    print(f"of it headers and texts {rest:.1%}", end="")
    for name in ("entries", "indices"):
        print(f", {name} {share[name]:.1%} (by LZMA {share[f'{name}_lzma']:.1%})", end="")
    print()
    if options.results:
        _results.store(
            options.results,
            [
                *summary(rows),
                {
                    "ours : 3.1": "bytes of all files",
                    "median": f"{total[0] / total[1]:.2f}",
                    "range": "",
                },
            ],
            title="Our files beside those of libfclib 3.1",
            note=f"{len(rows)} files of {min(times_of('bytes_3_1')) / 1e3:.0f} kB to "
            f"{max(times_of('bytes_3_1')) / 1e6:.1f} MB.",
        )
    if options.csv:
        with options.csv.open("w", newline="") as stream:
            writer = csv.writer(stream)
            writer.writerow(["file", *COLUMNS])
            writer.writerows([name, *row.values()] for name, row in rows.items())


if __name__ == "__main__":
    main()
