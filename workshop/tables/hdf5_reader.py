"""The reader of HDF5 for pages beside h5wasm alone: sizes, speed, and what each refuses.

    python -m workshop.tables.hdf5_reader FILE... --results hdf5-reader

The reader for pages takes its numbers from h5wasm and adds the rules of FCLIB files. npm installs
h5wasm into a temporary folder. Each file is read whole by both; the time is the least of ten, with
bytes in memory, without the validation, which is the core's. Which odd files (tests/odd_files.py)
are to be refused the native reader says; those that its validation refuses are left out.
"""

from __future__ import annotations

import argparse
import gzip
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import fclib
from workshop.tables import _results

sys.path.insert(0, str(_results.ROOT / "tests"))

import odd_files

TIMES = 10  # the least of so many readings; V8 compiles what runs often
BROWSER = _results.ROOT / "browser"
OWN = ("fclib.js", "fclib-hdf5.js", "fclib-layout.js", "package.json")
LIBRARY = ("hdf5_hl.js", "hdf5_util.js")
READERS = {"h5wasm": LIBRARY, "fclib": (*LIBRARY, "fclib-hdf5.js", "fclib-layout.js")}


def install(folder: Path) -> None:
    """The reader of pages and h5wasm, as `make wasm` takes them."""
    for name in ("package.json", "package-lock.json"):
        shutil.copy(BROWSER / "hdf5" / name, folder)
    command = ["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error"]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    for name in LIBRARY:
        shutil.copy(folder / "node_modules" / "h5wasm" / "dist" / "esm" / name, folder)
    for name in OWN:
        shutil.copy(BROWSER / name, folder)


class Node:
    """Both readers in one process."""

    def __init__(self, folder: Path) -> None:
        script = Path(__file__).with_suffix(".mjs")
        self.process = subprocess.Popen(
            ["node", script, folder], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def read(self, reader: str, path: Path, times: int = 1) -> dict[str, Any]:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        question = {"reader": reader, "path": str(path), "times": times}
        self.process.stdin.write(json.dumps(question) + "\n")
        self.process.stdin.flush()
        answer: dict[str, Any] = json.loads(self.process.stdout.readline())
        return answer

    def close(self) -> None:
        self.process.communicate()


def odd(folder: Path) -> tuple[list[Path], list[Path]]:
    """The odd files that are good natively, and those that are not."""
    good, bad = [], []
    for one in odd_files.make(folder):
        try:
            fclib.read(one.path)
            good.append(one.path)
        except fclib.FileError:
            bad.append(one.path)
        except fclib.ProblemError:
            continue  # validation, which is not compared
    return good, bad


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    _results.add_option(parser)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        install(folder)
        (folder / "odd").mkdir()
        good, bad = odd(folder / "odd")
        node = Node(folder)
        rows = []
        for reader, names in READERS.items():
            size = sum(len(gzip.compress((folder / name).read_bytes(), 9)) for name in names)
            row: dict[str, Any] = {"reader": reader, "size, gzip [kB]": size / 1e3}
            for path in args.files:
                row[f"{path.stem} [ms]"] = node.read(reader, path, TIMES)["ms"]
            row[f"good odd files read, of {len(good)}"] = sum(
                node.read(reader, path)["read"] for path in good
            )
            row[f"bad odd files refused, of {len(bad)}"] = sum(
                not node.read(reader, path)["read"] for path in bad
            )
            rows.append(row)
        node.close()
    for row in rows:
        print(row)
    if args.results:
        note = (
            f"least of {TIMES} readings in Node, bytes in memory, without the validation. Good and "
            "bad is what the native reader reads and refuses of tests/odd_files.py; what only "
            "the validation refuses is left out. h5wasm alone gives arrays, without looking at "
            "what FCLIB files must have."
        )
        title = "The reader of pages, and h5wasm alone"
        _results.store(args.results, rows, title=title, note=note)


if __name__ == "__main__":
    main()
