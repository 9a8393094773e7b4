"""Before the tests: the extension of a development install is built from what was just edited."""

import fcntl
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
BUILD = ROOT / "build"


def settings(cache: Path) -> dict[str, str]:
    """What CMake was told, from its CMakeCache.txt."""
    return dict(re.findall(r"^([\w.-]+):\w+=(.*)$", cache.read_text(), re.MULTILINE))


def is_development_build(build: Path) -> bool:
    """Whether a folder builds the extension that this Python imports from the sources."""
    cache = build / "CMakeCache.txt"
    if not cache.is_file():
        return False
    told = settings(cache)
    inplace = told.get("SKBUILD_STATE") == "editable" or told.get("FCLIB_INPLACE") == "ON"
    # the Python of another environment has a build of its own
    return inplace and Path(told.get("Python_EXECUTABLE", "")).parent == Path(sys.executable).parent


def rebuild(build: Path = BUILD) -> None:
    """Build, in the one process that starts the tests; a build that fails ends the session."""
    if not is_development_build(build):
        return
    with (build / "tests.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # two sessions that start at once
        done = subprocess.run(
            ["cmake", "--build", str(build), "--target", "fclib_inplace"],
            capture_output=True,
            text=True,
        )
    if done.returncode != 0:
        pytest.exit(f"{build} does not build:\n{done.stdout}{done.stderr}", returncode=2)
