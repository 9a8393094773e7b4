"""How long ways take a new user: minutes, commands and lines of code, from an empty folder.

    python -m workshop.tables.walks [--results walks]
    python -m workshop.tables.walks --wheels dist [--results walk-published]

A solver of one's own, to a figure for a paper: docs/tutorial-solver.md up to the figure. A robot in
MJCF, to its solutions: docs/tutorial-robot.md up to them. A simulator in C++, to the check of what
it wrote: examples/cpp/stack.cpp. Each file is saved and each command run as the page has it; what a
person reads and types is not in the time. FCLIB and its C library are installed before.

With --wheels it is another way: a solver of one's own beside the published runs, the last section
of docs/tutorial-solver.md. It begins with `pip install` in an empty environment, from the folder of
`make wheels collection-wheel results-wheel`.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from workshop.tables import _results

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from doc_blocks import blocks_of  # noqa: E402

# the last command of a page that belongs to the way, by its first words
PAGES = {
    "an own solver, to a figure (PDF)": ("tutorial-solver", "fclib profile mine.sqlite --figure"),
    "a robot (MJCF), to its solutions": ("tutorial-robot", "python look.py"),
}
PUBLISHED = "an own solver, beside the published runs"
PARTS = "fclib[bench,collection,simulate]"
COMPILED = "a simulator in C++, to a check"
SIMULATOR = ROOT / "examples" / "cpp" / "stack.cpp"
COMMANDS = (
    "c++ -std=c++20 stack.cpp -o stack $(pkg-config --cflags --libs fclib)",
    "./stack stack.hdf5",
    "fclib check stack.hdf5 --contacts",
)


def steps_of(page: str, last: str) -> Iterator[tuple[str, str]]:
    """What one saves (name, content) and runs ("", command), up to the last one."""
    for block in blocks_of(ROOT / "docs" / f"{page}.md"):
        if not block.runs:
            continue
        if block.file:
            yield block.file, block.code
            continue
        for line in block.commands():
            yield "", line
            if line.startswith(last):
                return
    raise ValueError(f"docs/{page}.md has no command {last!r}")


def steps_to_published() -> Iterator[tuple[str, str]]:
    """The solver of the tutorial, what is installed, and the commands of its last section."""
    yield "", f"pip install --quiet '{PARTS}' fclib-collection"
    for block in blocks_of(ROOT / "docs" / "tutorial-solver.md"):
        if block.file == "mine.py":
            yield block.file, block.code
        elif "--with published" in block.code:
            yield from (("", line) for line in block.commands())


def empty(folder: Path, wheels: Path) -> dict[str, str]:
    """The environment of a person who has Python, and a folder of wheels."""
    subprocess.run([sys.executable, "-m", "venv", str(folder / "venv")], check=True)
    kept = {name: os.environ[name] for name in ("LANG", "SSL_CERT_FILE") if name in os.environ}
    pip = {name: text for name, text in os.environ.items() if name.startswith("PIP_")}
    return {
        **kept,
        **pip,
        "HOME": str(folder),
        "PATH": f"{folder / 'venv' / 'bin'}:/usr/bin:/bin",
        "PIP_FIND_LINKS": str(wheels.resolve()),
    }


def walk(steps: list[tuple[str, str]], environment: dict[str, str]) -> dict[str, Any]:
    """Do it in an empty folder; each command must end with 0."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        for name, content in steps:
            if name:
                Path(folder, name).write_text(content, encoding="utf-8")
                continue
            done = subprocess.run(
                ["sh", "-c", content], cwd=folder, env=environment, capture_output=True, text=True
            )
            if done.returncode != 0:
                raise RuntimeError(f"{content}\n{done.stdout}{done.stderr}")
    print(done.stdout)
    seconds = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    busy = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {
        "files": sum(bool(name) for name, _ in steps),
        "lines in them": sum(len(text.splitlines()) for name, text in steps if name),
        "commands": sum(not name for name, _ in steps),
        "CPU [min]": busy / 60,
        "clock [min]": seconds / 60,
    }


def installed(prefix: Path) -> dict[str, str]:
    """The environment in which the C library is found."""
    subprocess.run(["cmake", "--build", str(ROOT / "build"), "--target", "fclib"], check=True)
    for part in ("library", "development"):
        command = ["cmake", "--install", str(ROOT / "build"), "--prefix", str(prefix)]
        subprocess.run([*command, "--component", part], check=True, stdout=subprocess.DEVNULL)
    (found,) = prefix.rglob("fclib.pc")
    return {"PKG_CONFIG_PATH": str(found.parent), "LD_LIBRARY_PATH": str(found.parent.parent)}


def main() -> None:
    """Walk them, and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wheels", type=Path, metavar="DIR", help="the way to the published runs")
    _results.add_option(parser)
    options = parser.parse_args()
    if options.wheels:
        with tempfile.TemporaryDirectory() as folder:
            own = {"way": PUBLISHED}
            own |= walk(list(steps_to_published()), empty(Path(folder), options.wheels))
        print(_results.table(list(own), [own]))
        if options.results:
            _results.store(
                options.results,
                [own],
                title="From an empty environment to a profile beside the published runs",
                note="The time of the commands, with what pip does; without reading and typing.",
            )
        return
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | installed(Path(folder) / "prefix")
        environment["PATH"] = f"{Path(sys.executable).parent}:{environment['PATH']}"
        environment["FCLIB_CACHE"] = str(Path(folder) / "cache")
        ways = {name: list(steps_of(*page)) for name, page in PAGES.items()}
        source = (SIMULATOR.name, SIMULATOR.read_text(encoding="utf-8"))
        ways[COMPILED] = [source, *(("", line) for line in COMMANDS)]
        for name, steps in ways.items():
            rows.append({"way": name, **walk(steps, environment)})
            print(_results.table(list(rows[0]), rows[-1:]))
    if options.results:
        _results.store(
            options.results,
            rows,
            title="Three ways of a new user, from an empty folder",
            note="The time of the commands, without reading and typing; FCLIB is installed before.",
        )


if __name__ == "__main__":
    main()
