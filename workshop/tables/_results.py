"""Tables that pages quote: docs/results/NAME.csv, and beside each what made it, NAME.json.

A script that measures takes `--results NAME` (`add_option`) and calls `store`.
scripts/site/results.py puts the tables into the pages; no figure is typed there.
"""

from __future__ import annotations

import argparse
import csv
import datetime
import json
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import fclib

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "results"


def add_option(parser: argparse.ArgumentParser) -> None:
    """Add `--results NAME` to a script."""
    parser.add_argument(
        "--results",
        metavar="NAME",
        help="store the table as docs/results/NAME.csv, and what made it as NAME.json",
    )


def store(
    name: str, rows: Sequence[Mapping[str, Any]], *, title: str, note: str = "", command: str = ""
) -> Path:
    """Write a table and its provenance; the path of the table.

    Rows have the same keys, the columns' titles with units. `note` says what a reader must know to
    judge the figures: limits, tolerance, what was left out. `command` is what was called, if it is
    not this process.
    """
    if not rows:
        raise ValueError(f"the table {name} has no row")
    columns = list(rows[0])
    for k, row in enumerate(rows):
        if list(row) != columns:
            raise ValueError(
                f"the table {name}: row {k} has the columns {list(row)}, not {columns}"
            )
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = FOLDER / f"{name}.csv"
    about = {
        "title": title,
        "command": command or called(),
        "version": fclib.__version__,
        "commit": commit(),
        "date": datetime.datetime.now(datetime.timezone.utc).date().isoformat(),
        "machine": f"{machine()}, load {os.getloadavg()[0]:.0f}",
        "note": note,
    }
    for target, text in (
        (path, table(columns, rows)),
        (path.with_suffix(".json"), json.dumps(about, indent=2) + "\n"),
    ):
        part = target.with_name(target.name + ".part")
        part.write_text(text, encoding="utf-8")
        part.replace(target)
    return path


def table(columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> str:
    """The rows as CSV; numbers with all that is measured of them, three digits or four."""
    lines: list[str] = []

    class Lines:
        def write(self, text: str) -> None:
            lines.append(text)

    writer = csv.DictWriter(Lines(), columns, lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({key: f"{v:.4g}" if isinstance(v, float) else v for key, v in row.items()})
    return "".join(lines)


def called() -> str:
    """The command of this process, from the root of the repository."""
    script = Path(sys.argv[0]).resolve()
    name = script.relative_to(ROOT).as_posix() if script.is_relative_to(ROOT) else script.name
    if name.startswith("workshop/"):
        name = f"-m {name.removesuffix('.py').replace('/', '.')}"
    words = [word if len(word) < 200 else "..." for word in sys.argv[1:]]
    return f".venv/bin/python {name} {shlex.join(short(words))}".rstrip()


def short(words: Sequence[str]) -> list[str]:
    """Arguments without the machine's folders, and a run of files as one FILE...."""
    found: list[str] = []
    for word in words:
        name = Path(word).name if Path(word).is_absolute() else word
        if name.endswith((".hdf5", ".h5", ".dat")):
            name = "FILE..."
        if not (name == "FILE..." and found and found[-1] == name):
            found.append(name)
    return found


def power(tolerance: float) -> str:
    """A tolerance as it is written on pages and in names of tables: 1e-8."""
    return re.sub(r"e-0?", "e-", f"{tolerance:.0e}")


def commit() -> str:
    """The commit of the working tree, with a + if it has changes."""
    git = ["git", "-C", str(ROOT)]
    if shutil.which("git") is None:
        return "unknown"
    done = subprocess.run([*git, "rev-parse", "--short=10", "HEAD"], capture_output=True, text=True)
    if done.returncode != 0:
        return "unknown"
    changed = subprocess.run([*git, "status", "--porcelain", "core", "python", "workshop"],
                             capture_output=True, text=True).stdout  # fmt: skip
    return done.stdout.strip() + ("+" if changed else "")


def machine() -> str:
    """The processor, and how many cores this process may use."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                model = line.partition(":")[2].strip()
                break
    return f"{model}, {len(os.sched_getaffinity(0))} cores"
