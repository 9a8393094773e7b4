"""What a build costs: CPU seconds of every object, and what touching a file compiles again.

.venv/bin/python scripts/build_cost.py                    a fresh build in a scratch folder
.venv/bin/python scripts/build_cost.py --csv before.csv   and kept
.venv/bin/python scripts/build_cost.py --against before.csv

The compiler runs under this script, which asks the kernel what each run took, without ccache. What
a header costs is the sum over the objects that include it, as ninja's log of dependencies has them.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
WHOLE = "whole build"
LINKING = "linking"
# a goal, the folders it is about, the most that touching one of their files may cost [s]
GOALS = (
    ("touching a method", ("core/methods/",), 40.0),
    ("touching a solver", ("core/solvers/",), 15.0),
)
GOAL_OF_THE_WHOLE = 240.0  # [s]


@dataclass(frozen=True)
class Cost:
    """What a build, an object, or touching a file costs."""

    kind: str  # total, object, touch
    name: str  # an object, or a file, from the root of the repository
    seconds: float  # of CPU time
    objects: int  # compiled


# ---- measuring: this script before the compiler


def record(folder: Path, command: Sequence[str]) -> int:
    """Run a compiler or linker, and leave in a folder what it took."""
    status = subprocess.call(command)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    output = command[command.index("-o") + 1] if "-o" in command else ""
    if status == 0 and output:
        entry = {"output": output, "seconds": used.ru_utime + used.ru_stime}
        entry["kind"] = "object" if "-c" in command else "link"
        handle, _ = tempfile.mkstemp(suffix=".json", dir=folder)
        with os.fdopen(handle, "w") as file:
            json.dump(entry, file)
    return status


def build(folder: Path, jobs: int, tests: bool) -> None:
    """Configure and build all in a folder, under `record`."""
    records = folder / "records"
    if folder.exists() and not records.is_dir() and any(folder.iterdir()):
        sys.exit(f"{folder} is no folder of an earlier measurement, and is not emptied")
    shutil.rmtree(folder, ignore_errors=True)
    records.mkdir(parents=True)
    launcher = ";".join([sys.executable, "-S", "-E", __file__, "--record", str(records), "--"])
    nanobind = subprocess.run(
        [sys.executable, "-m", "nanobind", "--cmake_dir"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    configure = [
        *("cmake", "-S", str(ROOT), "-B", str(folder), "-G", "Ninja"),
        "-DCMAKE_BUILD_TYPE=Release",
        f"-DCMAKE_CXX_COMPILER_LAUNCHER={launcher}",
        f"-DCMAKE_CXX_LINKER_LAUNCHER={launcher}",
        f"-DPython_EXECUTABLE={sys.executable}",
        f"-Dnanobind_DIR={nanobind}",
        "-DFCLIB_C=OFF",  # as in make setup
        f"-DFCLIB_TESTS={'ON' if tests else 'OFF'}",
    ]
    subprocess.run(configure, check=True, stdout=subprocess.DEVNULL)
    targets = ["all", *(["fclib_tests"] if tests else [])]
    subprocess.run(
        ["cmake", "--build", str(folder), "--parallel", str(jobs), "--target", *targets], check=True
    )


# ---- what was measured


def recorded(records: Path) -> tuple[dict[str, float], float]:
    """CPU seconds of each object, by its path in the build folder; and of linking."""
    objects: dict[str, float] = {}
    linking = 0.0
    for path in records.glob("*.json"):
        entry = json.loads(path.read_text())
        if entry["kind"] == "link":
            linking += entry["seconds"]
        else:
            objects[entry["output"]] = entry["seconds"]
    return objects, linking


def dependencies(text: str) -> dict[str, list[str]]:
    """The files each object was made of, from what `ninja -t deps` prints."""
    found: dict[str, list[str]] = {}
    current: list[str] = []
    for line in text.splitlines():
        if line.startswith("    "):
            current.append(line.strip())
        elif head := re.match(r"(\S+): #deps \d+,.*\(VALID\)", line):
            current = found.setdefault(head[1], [])
        else:
            current = []  # a stale entry, or the empty line between two
    return found


def touching(
    objects: Mapping[str, float], includes: Mapping[str, Iterable[str]], folder: Path, root: Path
) -> list[Cost]:
    """What touching each file of the repository costs, the dearest first."""
    seconds: dict[str, float] = defaultdict(float)
    count: dict[str, int] = defaultdict(int)
    for name, files in includes.items():
        for file in {(folder / one).resolve() for one in files}:
            if name not in objects or not file.is_relative_to(root):
                continue
            if file.is_relative_to(folder.resolve()) or ".venv" in file.relative_to(root).parts:
                continue
            seconds[str(file.relative_to(root))] += objects[name]
            count[str(file.relative_to(root))] += 1
    costs = [Cost("touch", name, seconds[name], count[name]) for name in seconds]
    return sorted(costs, key=lambda one: -one.seconds)


def duplicate_share(listings: Iterable[str]) -> tuple[int, int]:
    """Bytes of object text that another object has too, and all, from what `nm -S` prints."""
    total = duplicate = 0
    seen: set[str] = set()
    for listing in listings:
        for line in listing.splitlines():
            parts = line.split(maxsplit=3)
            if len(parts) != 4 or parts[2] not in "TtWw":
                continue
            size = int(parts[1], 16)
            total += size
            if parts[2] in "Ww":
                duplicate += size if parts[3] in seen else 0
                seen.add(parts[3])
    return duplicate, total


def text_of(folder: Path, objects: Iterable[str]) -> list[str]:
    """What `nm -S` prints of each object; nothing if there is no nm that knows sizes."""
    if shutil.which("nm") is None or sys.platform == "darwin":
        return []
    command = ["nm", "-S", "--defined-only"]
    return [
        subprocess.run([*command, folder / name], capture_output=True, text=True, check=True).stdout
        for name in objects
        if name.endswith(".o")  # and no precompiled header
    ]


def measured(folder: Path) -> tuple[list[Cost], tuple[int, int]]:
    """The costs of what was built in a folder; duplicate and all bytes of object text."""
    objects, linking = recorded(folder / "records")
    if not objects:
        sys.exit(f"{folder} has no records of a build; without --reuse they are made")
    printed = subprocess.run(
        ["ninja", "-C", str(folder), "-t", "deps"], capture_output=True, text=True, check=True
    ).stdout
    costs = [
        Cost("total", WHOLE, sum(objects.values()) + linking, len(objects)),
        Cost("total", LINKING, linking, 0),
    ]
    costs += [
        Cost("object", name, seconds, 1)
        for name, seconds in sorted(objects.items(), key=lambda pair: -pair[1])
    ]
    costs += touching(objects, dependencies(printed), folder, ROOT)
    return costs, duplicate_share(text_of(folder, objects))


# ---- tables


def write_csv(path: Path, costs: Sequence[Cost]) -> None:
    """Keep costs in a file."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["kind", "name", "seconds", "objects"])
        for one in costs:
            writer.writerow([one.kind, one.name, f"{one.seconds:.2f}", one.objects])


def read_csv(path: Path) -> list[Cost]:
    """The costs that a file keeps."""
    with path.open(newline="") as file:
        return [
            Cost(row["kind"], row["name"], float(row["seconds"]), int(row["objects"]))
            for row in csv.DictReader(file)
        ]


def worst(costs: Iterable[Cost], folders: Sequence[str], suffix: str = "") -> Cost | None:
    """The dearest file to touch in some folders."""
    found = [
        one
        for one in costs
        if one.kind == "touch" and one.name.startswith(tuple(folders)) and one.name.endswith(suffix)
    ]
    return max(found, key=lambda one: one.seconds, default=None)


def table(costs: Sequence[Cost], before: Sequence[Cost], rows: int) -> list[str]:
    """The lines to print."""
    known = {(one.kind, one.name): one.seconds for one in before}

    def line(one: Cost, name: str = "") -> str:
        old = known.get((one.kind, one.name))
        was = "" if not before else "      new" if old is None else f"{old:9.1f}"
        return f"{was}{one.seconds:9.1f} {one.objects:4}  {name or one.name}"

    totals = [one for one in costs if one.kind == "total"]
    objects = [one for one in costs if one.kind == "object"]
    headers = [
        one
        for one in costs
        if one.kind == "touch" and one.name.startswith("core/") and one.name.endswith(".hpp")
    ]
    columns = f"{'   before' if before else ''}    CPU s objs"
    lines = [columns, *(line(one) for one in totals)]
    lines += ["", f"the {rows} dearest objects", *(line(one) for one in objects[:rows])]
    lines += ["", f"touching a header of core/: the {rows} dearest of {len(headers)}"]
    lines += [line(one) for one in headers[:rows]]
    folders = sorted({str(Path(one.name).parent) for one in headers})
    lines += ["", "the dearest header of each folder"]
    for folder in folders:
        if (dearest := worst(headers, [f"{folder}/"])) is not None:
            lines.append(line(dearest))
    return lines


def goals(costs: Sequence[Cost]) -> list[str]:
    """Each goal, what was measured, and whether it is reached."""
    whole = next(one for one in costs if one.name == WHOLE)
    found: list[tuple[str, float, float, str]] = [(WHOLE, whole.seconds, GOAL_OF_THE_WHOLE, "")]
    for name, folders, limit in GOALS:
        if (dearest := worst(costs, folders)) is not None:
            found.append((name, dearest.seconds, limit, f"  {dearest.name}"))
    return [
        f"{name}: {seconds:.1f} s, goal {limit:.0f} s: "
        f"{'reached' if seconds <= limit else 'NOT reached'}{which}"
        for name, seconds, limit, which in found
    ]


def main() -> None:
    """Build, or look at what was built, and print."""
    if sys.argv[1:2] == ["--record"]:
        sys.exit(record(Path(sys.argv[2]), sys.argv[4:]))
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--build-dir", type=Path, help="the folder to build in, which is emptied")
    parser.add_argument("--reuse", action="store_true", help="take what --build-dir has")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="at the same time")
    parser.add_argument("--tests", action="store_true", help="compile the C++ tests too")
    parser.add_argument("--rows", type=int, default=20, help="of a table")
    parser.add_argument("--csv", type=Path, help="write all costs into this file")
    parser.add_argument("--against", type=Path, help="a file of --csv to compare with")
    asked = parser.parse_args()
    if asked.reuse and asked.build_dir is None:
        parser.error("--reuse needs --build-dir")
    before = read_csv(asked.against) if asked.against else []

    with tempfile.TemporaryDirectory(prefix="fclib-build-cost-") as scratch:
        folder = (asked.build_dir or Path(scratch) / "build").resolve()
        if not asked.reuse:
            try:
                build(folder, asked.jobs, asked.tests)
            except subprocess.CalledProcessError as failure:
                sys.exit(f"failed: {shlex.join(map(str, failure.cmd))}")
        costs, (duplicate, total) = measured(folder)
    if asked.csv:
        write_csv(asked.csv, costs)
    print("\n".join(table(costs, before, asked.rows)))
    if total:
        share = duplicate / total
        print(f"\nobject text: {total / 1e6:.1f} MB, {share:.0%} of it in another object too")
    print("", *goals(costs), sep="\n")


if __name__ == "__main__":
    main()
