"""The library by old and new compilers and for other processors: builds, and tests that pass.

    python -m workshop.tables.compilers [NAME...] [--folder build/compilers] [--jobs 2]
        [--sysroots FOLDER] [--optimize=-O1] [--results NAME]

Each NAME (gcc-11, clang-14, aarch64, ...; without one, all whose compiler is installed) is built:
the core, the C library and the C++ tests; for this processor the extension for Python too, if this
Python has nanobind. A warning is an error. Then ctest runs all tests. cmake/NAME.cmake says what
the build for another processor needs; --sysroots has its libraries in FOLDER/NAME, if they are not
installed in the system.

What a build shows is kept in the folder. So a chroot that sees the same sources, and has other
compilers, adds to it by its own python3. --results makes the table of all that is kept of these
sources.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import platform
import re
import shlex
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("core", "include", "bindings", "tests/core", "tests/fuzz", "tests/capi", "cmake")
VERSION = re.compile(r"\d+\.\d+\.\d+")


@dataclass(frozen=True)
class Target:
    """A compiler of C++, and the preset of CMake that it is used with."""

    cxx: str
    preset: str = "release"
    c: str = ""  # that of the preset, if it is empty

    @property
    def native(self) -> bool:
        """Whether it is for this processor."""
        return self.preset == "release"


TARGETS = {f"gcc-{k}": Target(f"g++-{k}", c=f"gcc-{k}") for k in range(11, 16)}
TARGETS |= {f"clang-{k}": Target(f"clang++-{k}", c=f"clang-{k}") for k in range(14, 22)}
TARGETS["aarch64"] = Target("aarch64-linux-gnu-g++", "aarch64")
TARGETS["i386"] = Target("g++", "i386")


def run(*command: str | Path) -> tuple[int, str]:
    """The status of a command, and all that it printed."""
    done = subprocess.run(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    return done.returncode, done.stdout


def must(*command: str | Path) -> str:
    """What a command prints. If it fails, this script ends with the last of that."""
    status, text = run(*command)
    if status != 0:
        sys.exit(f"{text[-20000:]}\n{shlex.join(map(str, command))} ended with {status}")
    return text


def digest() -> str:
    """What all these builds are made of."""
    found = hashlib.sha256()
    files = [ROOT / "CMakeLists.txt", ROOT / "CMakePresets.json"]
    for folder in SOURCES:
        files += sorted(path for path in (ROOT / folder).rglob("*") if path.is_file())
    for path in files:
        if "__pycache__" not in path.parts:
            found.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    return found.hexdigest()


def configure(name: str, target: Target, given: argparse.Namespace) -> list[str | Path]:
    """The command that configures a build."""
    command: list[str | Path] = ["cmake", "--preset", target.preset, "-B", given.folder / name]
    command += ["-DCMAKE_COMPILE_WARNING_AS_ERROR=ON", "-DFCLIB_CCACHE=OFF"]
    if target.native:
        command += [f"-DCMAKE_C_COMPILER={target.c}", f"-DCMAKE_CXX_COMPILER={target.cxx}"]
    elif given.sysroots:
        command.append(f"-DFCLIB_SYSROOT={(given.sysroots / name).resolve()}")
    if given.optimize:
        command.append(f"-DCMAKE_CXX_FLAGS_RELEASE={given.optimize} -DNDEBUG")
    if with_python(target):
        command += ["-DFCLIB_PYTHON=ON", f"-DPython_EXECUTABLE={sys.executable}"]
    return command


def with_python(target: Target) -> bool:
    """Whether the extension for Python is built."""
    return target.native and importlib.util.find_spec("nanobind") is not None


def build(name: str, target: Target, given: argparse.Namespace) -> dict[str, str | int]:
    """Build one target, run its tests, and return the row of the table."""
    folder = given.folder / name
    must(*configure(name, target, given))
    goals = ["fclib_tests", "fclib", *(["_core"] if with_python(target) else [])]
    must("cmake", "--build", folder, "-j", str(given.jobs), "--target", *goals, "--", "-k", "0")
    report = folder / "tests.xml"
    _, tested = run("ctest", "--test-dir", folder, "-j", str(given.jobs), "--output-on-failure",
                    "--output-junit", report)  # fmt: skip
    if not report.is_file():
        sys.exit(f"{tested[-4000:]}\nctest of {name} has left no report")
    counts = ElementTree.parse(report).getroot().attrib
    tests, failed = int(counts["tests"]), int(counts["failures"])
    skipped = int(counts["skipped"]) + int(counts["disabled"])
    if failed:
        print(tested[-8000:])
    family = "clang" if "clang" in target.cxx else "GCC"
    found = VERSION.search(must(target.cxx, "--version").partition("\n")[0])
    return {
        "compiler": f"{family} {found[0] if found else ''}".strip(),
        "for": platform.machine() if target.native else name,
        "built": "library, tests" + (", Python extension" if with_python(target) else ""),
        "tests": tests,
        "passed": tests - failed - skipped,
        "skipped": skipped,
        "failed": failed,
    }


def main() -> None:
    """Build what is asked for, print its rows, and make the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", metavar="NAME", nargs="*", help=" ".join(TARGETS))
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "compilers")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--sysroots", type=Path, help="libraries for other processors")
    parser.add_argument("--optimize", default="", help="instead of the flags of the preset")
    parser.add_argument("--results", metavar="NAME", help="store docs/results/NAME.csv")
    given = parser.parse_args()
    given.folder = given.folder.resolve()
    if unknown := [name for name in given.names if name not in TARGETS]:
        parser.error(f"no build is called {', '.join(unknown)}; there are {', '.join(TARGETS)}")
    here = [name for name, target in TARGETS.items() if shutil.which(target.cxx)]
    if missing := [name for name in given.names if name not in here]:
        parser.error(f"there is no {', '.join(TARGETS[name].cxx for name in missing)}")
    given.folder.mkdir(parents=True, exist_ok=True)
    sources = digest()
    for name in given.names or here:
        row = build(name, TARGETS[name], given)
        print(json.dumps(row), flush=True)
        kept = {"sources": sources, "flags": given.optimize, "row": row}
        (given.folder / f"{name}.json").write_text(json.dumps(kept), encoding="utf-8")
    if given.results:
        store(given.results, given.folder, sources)


def store(results: str, folder: Path, sources: str) -> None:
    """Make the table of all rows that are kept of these sources."""
    from workshop.tables import _results  # it imports fclib, which a chroot need not have

    found = [folder / f"{name}.json" for name in TARGETS]
    kept = [json.loads(path.read_text(encoding="utf-8")) for path in found if path.is_file()]
    kept = [each for each in kept if each["sources"] == sources]
    others = [
        f"{each['row']['compiler']} for {each['row']['for']} with {each['flags']}"
        for each in kept
        if each["flags"]
    ]
    flags = ["the flags of the preset", *others]
    _results.store(
        results,
        [each["row"] for each in kept],
        title="The library by other compilers and for other processors",
        note=f"Compiled with {', '.join(flags)}; no compiler warned. A test is "
        "skipped if it needs what the build does not have.",
    )


if __name__ == "__main__":
    main()
