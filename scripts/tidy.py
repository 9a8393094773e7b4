"""clang-tidy over the C++ sources, or those that are named, as the build in a folder compiles them.

.venv/bin/python scripts/tidy.py build [core/merit/merit.cpp ...]
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TOOL = Path(sys.executable).with_name("clang-tidy")


def check(build: Path, source: Path) -> str:
    """What clang-tidy finds in a file; empty if there is nothing."""
    command = [str(TOOL), "-p", str(build), "--quiet", str(source)]
    done = subprocess.run(command, capture_output=True, text=True)
    return done.stdout + done.stderr if done.returncode else ""


def main() -> None:
    """Check them all, and exit with 1 if there is a finding."""
    if len(sys.argv) < 2:
        sys.exit(f"usage: {sys.argv[0]} BUILD [FILE...]")
    build = Path(sys.argv[1]).resolve()
    compiled = json.loads((build / "compile_commands.json").read_text())
    named = [Path(name).resolve() for name in sys.argv[2:]]
    sources = sorted({Path(entry["file"]).resolve() for entry in compiled})
    sources = [
        source
        for source in sources
        if source.suffix == ".cpp"
        and source.is_relative_to(ROOT)
        and not source.is_relative_to(build)
        and source.relative_to(ROOT).parts[0] in ("core", "bindings")
        and (not named or source in named)
    ]
    if not sources:
        sys.exit(
            f"{build}/compile_commands.json: has none of these sources; build first: make setup"
        )
    wrong = 0
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        for source, findings in zip(
            sources, pool.map(lambda one: check(build, one), sources), strict=True
        ):
            wrong += bool(findings)
            print(f"{source.relative_to(ROOT)}{': ' if findings else ''}{findings}", flush=True)
    sys.exit(f"{wrong} of {len(sources)} files have findings" if wrong else 0)


if __name__ == "__main__":
    main()
