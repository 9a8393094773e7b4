"""What building the collection costs: CPU time, size and memory of each family and set.

    python -m workshop.sets.collection_cost OUT [NAME...] [--form both] [--with-references]
        [--limit 900] [--results build-cost]

NAMES are sets or families; by default all that have stored states, and those that are assembled,
but the ladder. Each family is built by a process of its own, `fclib collection build` with --jobs 1
and without pictures. Time and memory are those that the kernel tells of that process and of all
that it waited for; memory is the largest of one process. The size is that of the problems' files. A
family that runs into --limit has what it took until then, and says so.

OUT/costs.csv has the rows that are finished: after a kill, the same command goes on. Then come the
sums of each set.
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from fclib import scenes
from fclib._files import write_text
from fclib.collections import published, set_index
from workshop.tables import _results

LEFT = ("extended", "ladder")  # of all families, and of any size
COSTS = "costs.csv"


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
    size = sum(path.stat().st_size for path in (out / folder).glob("*.hdf5"))
    return {
        "family": folder,
        "problems": set_index.problems_of(folder),
        "CPU [s]": f"{usage.ru_utime + usage.ru_stime:.1f}",
        "files [MB]": f"{size / 1e6:.1f}",
        "memory [GB]": f"{usage.ru_maxrss * 1024 / 1e9:.2f}",
        "ends": {0: "built", -9: f"stopped after {limit:g} s"}.get(code, f"exit status {code}"),
    }


def summed(name: str, rows: list[dict[str, Any]]) -> dict[str, Any]:
    """The sum of some families."""
    done = sum(row["ends"] == "built" for row in rows)
    return {
        "family": name,
        "problems": sum(int(row["problems"]) for row in rows),
        "CPU [s]": f"{sum(float(row['CPU [s]']) for row in rows):.0f}",
        "files [MB]": f"{sum(float(row['files [MB]']) for row in rows):.0f}",
        "memory [GB]": max((row["memory [GB]"] for row in rows), key=float, default=""),
        "ends": f"{done} of {len(rows)} built",
    }


def sums(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The sum of each set of several families, and of all."""
    sets: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        sets.setdefault(row["family"].partition("/")[0], []).append(row)
    found = [summed(name, own) for name, own in sets.items() if len(own) > 1]
    return [*found, summed("all", rows)]


def main() -> None:
    """A row for each family, each set, and all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path)
    every = [name for name in set_index.sets() if name not in LEFT]
    parser.add_argument("names", nargs="*", default=every)
    parser.add_argument("--form", default="both")
    parser.add_argument("--with-references", action="store_true")
    parser.add_argument("--limit", type=float, default=900, help="[s] of the clock, of a family")
    _results.add_option(parser)
    arguments = parser.parse_args()
    options = ["--form", arguments.form, "--no-pictures"]
    if not arguments.with_references:
        options.append("--no-references")
    arguments.out.mkdir(parents=True, exist_ok=True)
    table = arguments.out / COSTS
    rows: list[dict[str, Any]] = []
    if table.is_file():
        with table.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    done = {row["family"] for row in rows}
    for folder in filter(has_states, set_index.folders(arguments.names)):
        if folder in done:
            continue
        rows.append(built(folder, arguments.out, options, arguments.limit))
        text = _results.table(list(rows[0]), rows)
        write_text(table, text)
        print(*rows[-1].values(), sep="  ", flush=True)
    rows += sums(rows)
    print(*(row for row in rows if "/" not in row["family"]), sep="\n")
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
