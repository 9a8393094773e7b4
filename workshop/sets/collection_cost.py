"""What building the collection costs: CPU time and the peak of memory of each family.

    python -m workshop.sets.collection_cost OUT [NAME...] [--form both] [--with-references]
        [--limit 900] [--results build-cost]

NAMES are sets or families; by default all that have stored states, and those that are assembled,
but the ladder. Each family is built by a process of its own, `fclib collection build` with --jobs 1
and without pictures. Time and memory are those that the kernel tells of that process and of all
that it waited for; memory is the largest of one process. A family that OUT has is not built again:
it has no row. One that runs into --limit has what it took until then, and says so.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from fclib import scenes
from fclib.collections import published, set_index
from workshop.tables import _results

SETS = ("rt444", "rr9118", "impacts", "existence", "dynamics", "robots", "machines", "simulators")
LISTS = ("local", "standard", "hard", "tiny")


def has_states(folder: str) -> bool:
    """Whether a build of SET/FAMILY simulates nothing."""
    assembled = folder.partition("/")[2] in scenes.assemblies()
    return assembled or bool(published.versions(folder))


def built(folder: str, out: Path, options: list[str], limit: float) -> dict[str, Any]:
    """Build a family: its row."""
    fclib = str(Path(sys.executable).with_name("fclib"))
    command = [fclib, "collection", "build", folder, "--out", str(out), "--jobs", "1", *options]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    end = time.monotonic() + limit
    pid = 0
    while not pid:
        pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        if not pid and time.monotonic() > end:
            process.kill()
            pid, status, usage = os.wait4(process.pid, 0)
        elif not pid:
            time.sleep(0.05)
    process.returncode = code = os.waitstatus_to_exitcode(status)
    return {
        "family": folder,
        "problems": set_index.problems_of(folder),
        "CPU [s]": f"{usage.ru_utime + usage.ru_stime:.1f}",
        "memory [GB]": f"{usage.ru_maxrss * 1024 / 1e9:.2f}",
        "ends": {0: "built", -9: f"stopped after {limit:g} s"}.get(code, f"exit status {code}"),
    }


def main() -> None:
    """A row for each family, and their sum."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("names", nargs="*", default=[*SETS, *LISTS])
    parser.add_argument("--form", default="both")
    parser.add_argument("--with-references", action="store_true")
    parser.add_argument("--limit", type=float, default=900, help="[s] of the clock, of a family")
    _results.add_option(parser)
    arguments = parser.parse_args()
    options = ["--form", arguments.form, "--no-pictures"]
    if not arguments.with_references:
        options.append("--no-references")
    rows = []
    for folder in filter(has_states, set_index.folders(arguments.names)):
        if (arguments.out / folder).exists():
            continue
        rows.append(built(folder, arguments.out, options, arguments.limit))
        print(*rows[-1].values(), sep="  ", flush=True)
    rows.append(
        {
            "family": "all",
            "problems": sum(row["problems"] for row in rows),
            "CPU [s]": f"{sum(float(row['CPU [s]']) for row in rows):.0f}",
            "memory [GB]": max((row["memory [GB]"] for row in rows), default=""),
            "ends": f"{sum(row['ends'] == 'built' for row in rows)} of {len(rows)} built",
        }
    )
    print(*rows[-1].values(), sep="  ")
    if arguments.results:
        words = "with" if arguments.with_references else "without"
        _results.store(
            arguments.results,
            rows,
            title="What building the collection costs",
            note=f"Form {arguments.form}, {words} reference solutions, without pictures, one"
            " process; memory is the peak of one process.",
        )


if __name__ == "__main__":
    main()
