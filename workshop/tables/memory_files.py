"""What it costs to save a problem: the driver of core/io/hdf5/memory_file.cpp, and HDF5's own.

    python -m workshop.tables.memory_files [--contacts 300 1000 2000] [--seconds 1]
        [--folder FOLDER] [--results NAME]

A file is put together in memory before it is written, so that no half of one is left behind. Our
driver refers to the arrays of the caller. HDF5's own (H5FD_CORE) copies them into the memory of the
file, from which H5Fget_file_image copies them again; it can also hand that memory over when the
file is closed. Each way saves the same local problem, uncompressed: a W of which every entry is
there, by columns. CPU time is the least of the writes within --seconds, and memory is by how much
the peak of the process grows. Needs Linux, a C compiler and HDF5 (pkg-config hdf5).
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from pathlib import Path

from workshop.tables import _results
from workshop.tables._c_library import c_library

PROGRAM = Path(__file__).with_suffix(".c")
HEADERS = PROGRAM.parents[2] / "include"
WAYS = {
    "fclib": "ours",
    "core-kept": "H5FD_CORE, its memory taken",
    "core": "H5FD_CORE, H5Fget_file_image",
}


def built(folder: Path) -> Path:
    """The program that measures."""
    library = c_library()
    hdf5 = subprocess.run(
        ["pkg-config", "--cflags", "--libs", "hdf5"], capture_output=True, text=True, check=True
    ).stdout.split()
    program = folder / "memory_files"
    subprocess.run(
        ["cc", "-std=c11", "-O2", f"-I{HEADERS}", "-o", program, PROGRAM, library,
         f"-Wl,-rpath,{library.parent}", *hdf5],
        check=True,
    )  # fmt: skip
    return program


def main() -> None:
    """A row for each size and way."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--contacts", type=int, nargs="+", default=[300, 1000, 2000])
    parser.add_argument("--seconds", type=float, default=1.0, help="of CPU, at least, for each row")
    parser.add_argument("--folder", type=Path, help="on the file system to write to")
    _results.add_option(parser)
    given = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory(dir=given.folder) as name:
        folder = Path(name)
        program = built(folder)
        for contacts in given.contacts:
            for way, title in WAYS.items():
                target = folder / "saved.hdf5"
                done = subprocess.run(
                    [program, way, str(3 * contacts), str(given.seconds), target],
                    capture_output=True,
                    text=True,
                    check=True,
                    env=os.environ | {"FCLIB_COMPRESSION": "0"},
                )
                seconds, memory = map(float, done.stdout.split())
                row = {
                    "contacts": contacts,
                    "file [MB]": target.stat().st_size / 1e6,
                    "driver": title,
                    "CPU time of a write [ms]": 1e3 * seconds,
                    "memory [MB]": memory / 1e6,
                }
                rows.append(row)
                print("  ".join(f"{v:.4g}" if isinstance(v, float) else str(v)
                                for v in row.values()), flush=True)  # fmt: skip
    if given.results:
        _results.store(
            given.results,
            rows,
            title="Saving a problem by our driver of HDF5, and by HDF5's own",
            note="Local problems whose W has every entry, uncompressed. The time is the least of "
            f"{given.seconds:g} s of writes. Memory is that beside the problem. Ours writes all of "
            "an FCLIB file, the others its large arrays alone.",
        )


if __name__ == "__main__":
    main()
