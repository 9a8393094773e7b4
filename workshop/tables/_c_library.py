"""The C library that is measured: that of this tree, built first."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

BUILD = Path(__file__).resolve().parents[2] / "build"


def c_library() -> Path:
    """build/libfclib.so.0, of the sources as they are.

    An old one would be measured in place of what was edited, and without one the linker takes that
    of the system.
    """
    if not (BUILD / "CMakeCache.txt").is_file():
        raise SystemExit(f"{BUILD} is no build: make setup")
    cmake = shutil.which("cmake")
    if cmake is None:
        raise SystemExit("there is no cmake to build the C library")
    build = [cmake, "--build", str(BUILD), "--target", "fclib"]
    done = subprocess.run(build, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"the C library cannot be built:\n{done.stdout}{done.stderr}")
    return BUILD / "libfclib.so.0"
