"""Run all tests over a build that counts, and print which lines of C++ and Python none runs.

.venv/bin/python scripts/coverage_report.py build/coverage               make coverage calls it
.venv/bin/python scripts/coverage_report.py build/coverage --only-report the counts that are there
.venv/bin/python scripts/coverage_report.py build/coverage tests/contract   of Python, these only

It ends with an error if less than the asked part of the lines of a language is run.

Counters are not atomic, with which small loops take fifty times as long: threads may lose counts of
a line, and whether it was run at all is what is asked.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LEAST = 92.0  # [%] of lines, of each language

Lines = dict[str, dict[int, bool]]  # file, line: whether a test runs it


# ---- running the tests


def run(*command: object, **environment: str) -> None:
    """Run a command in the repository; a test that fails is none that ends this."""
    done = subprocess.run(list(map(str, command)), cwd=ROOT, env=os.environ | environment)
    if done.returncode != 0:
        print(f"== exit status {done.returncode} of {command[0]}: its counts may be too low")


def package_with_counts(build: Path) -> Path:
    """A folder for PYTHONPATH: the sources, by links, and the extension that counts beside them."""
    folder = build / "python"
    shutil.rmtree(folder, ignore_errors=True)
    source = ROOT / "python" / "fclib"
    for path in source.rglob("*"):
        inside = path.relative_to(source)
        if path.is_dir() or "__pycache__" in inside.parts or path.name.startswith("_core."):
            continue
        link = folder / "fclib" / inside
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(path)
    for path in [*build.glob("_core*.so"), build / "_core.pyi"]:
        (folder / "fclib" / path.name).symlink_to(path)
    return folder


def count(build: Path, tests: Sequence[str]) -> None:
    """Run the tests, whose counts stay in the build folder."""
    for old in [*build.rglob("*.gcda"), *build.glob("python-lines*")]:
        old.unlink()
    run(build / "fclib_tests", "--gtest_brief=1")
    data = {
        "PYTHONPATH": str(package_with_counts(build)),
        "FCLIB_BUILD": str(build),
        "PYTHONDONTWRITEBYTECODE": "",  # as make test does
        "COVERAGE_FILE": str(build / "python-lines"),
    }
    # on all cores, as make test does
    cores = ["-n", "auto", "--dist", "loadfile"]
    run(sys.executable, "-m", "coverage", "run", "-m", "pytest", *cores, *tests, **data)
    run(sys.executable, "-m", "coverage", "combine", "--quiet", **data)


# ---- what was counted


def lines_of_python(build: Path) -> Lines:
    """The counts of coverage.py."""
    out = build / "python-lines.json"
    environment = os.environ | {"COVERAGE_FILE": str(build / "python-lines")}
    command = [sys.executable, "-m", "coverage", "json", "--quiet", "-o", str(out)]
    subprocess.run(command, cwd=ROOT, env=environment, check=True)
    found: Lines = {}
    for name, entry in json.loads(out.read_text())["files"].items():
        lines = dict.fromkeys(entry["executed_lines"], True)
        lines |= dict.fromkeys(entry["missing_lines"], False)
        path = (ROOT / name).resolve()
        found[str(path.relative_to(ROOT) if path.is_relative_to(ROOT) else path)] = lines
    return found


def lines_of_cpp(build: Path) -> Lines:
    """The counts of gcov."""
    out = build / "cpp-lines.json"
    tool = Path(sys.executable).with_name("gcovr")
    # a target each: beside them is what CMake tried the compiler on, whose sources are gone
    targets = sorted((build / "CMakeFiles").glob("*.dir"))
    command = [tool, "--root", ROOT, "--object-directory", build, *targets, "--json", out]
    command += ["--filter", "core/", "--filter", "bindings/", "-j", str(os.cpu_count() or 1)]
    command += ["--merge-mode-functions", "separate", "--gcov-ignore-parse-errors", "all"]
    subprocess.run(list(map(str, command)), cwd=ROOT, check=True)
    return merged(json.loads(out.read_text())["files"])


def merged(files: Iterable[Mapping[str, object]]) -> Lines:
    """Lines of gcovr's files: one that any instance of a template runs is run."""
    found: Lines = {}
    for entry in files:
        lines = found.setdefault(str(entry["file"]), {})
        listed = entry["lines"]
        assert isinstance(listed, list)
        for line in listed:
            if not line.get("gcovr/noncode"):
                number = line["line_number"]
                lines[number] = lines.get(number, False) or line["count"] > 0
    return found


def spans(numbers: Iterable[int]) -> str:
    """Numbers as ranges: 3-5, 9."""
    found: list[list[int]] = []
    for number in sorted(numbers):
        if found and number == found[-1][1] + 1:
            found[-1][1] = number
        else:
            found.append([number, number])
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in found)


def percent(lines: Iterable[bool]) -> float:
    """The part that is run; of nothing, all."""
    listed = list(lines)
    return 100 * sum(listed) / len(listed) if listed else 100.0


def report(counted: Mapping[str, Lines], least: float) -> tuple[list[str], bool]:
    """What to print, and whether enough lines of each language are run."""
    summary, named, enough = [], [], True
    for language, files in counted.items():
        every = [hit for lines in files.values() for hit in lines.values()]
        part = percent(every)
        enough &= bool(every) and part >= least
        counts = f"{len(every)} lines in {len(files)} files"
        summary.append(f"{language:7} {part:5.1f} % of {counts}, least {least:g} %")
        for name, lines in sorted(files.items(), key=lambda pair: percent(pair[1].values())):
            if percent(lines.values()) < least:
                missed = spans(number for number, hit in lines.items() if not hit)
                named.append(f"{percent(lines.values()):5.1f} %  {name}: {missed}")
    if named:
        named = [f"files under {least:g} %, and their lines that no test runs:", *named, ""]
    return named + summary, enough


def main() -> None:
    """Count, report, and end with 1 if it is not enough."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("build", type=Path, help="the folder of cmake --preset coverage")
    parser.add_argument("--only-report", action="store_true", help="run no test")
    parser.add_argument("--least", type=float, default=LEAST, help="per cent of lines")
    parser.add_argument("tests", nargs="*", help="for pytest; all if none is named")
    asked = parser.parse_args()
    build = asked.build.resolve()
    if not asked.only_report:
        count(build, asked.tests)
    lines, enough = report(
        {"C++": lines_of_cpp(build), "Python": lines_of_python(build)}, asked.least
    )
    print("\n".join(lines))
    sys.exit(0 if enough else 1)


if __name__ == "__main__":
    main()
