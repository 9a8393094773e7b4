"""The C library that the tests of the C interface use, and C programs that are linked to it."""

import functools
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
HEADERS = ROOT / "include"
CAPI = ROOT / "tests" / "capi"
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wno-sign-conversion", "-Werror")


@functools.cache
def library_folder() -> Path:
    """The folder of libfclib.so.0: $FCLIB_BUILD, or that of the build, or made for this session."""
    if named := os.environ.get("FCLIB_BUILD"):
        folder = Path(named).resolve()
        assert (folder / "libfclib.so.0").exists(), f"FCLIB_BUILD names {folder}, without a library"
        return folder
    cmake = shutil.which("cmake")
    if cmake is None:
        pytest.skip("there is no cmake to build the C library, and no FCLIB_BUILD that names it")
    folder = ROOT / "build"
    if not (folder / "CMakeCache.txt").is_file():
        folder = Path(tempfile.mkdtemp(prefix="fclib-capi-"))
        configure = [cmake, "-S", str(ROOT), "-B", str(folder), "-DFCLIB_PYTHON=OFF"]
        subprocess.run(configure, check=True, stdout=subprocess.DEVNULL)
    build = [cmake, "--build", str(folder), "--target", "fclib"]
    subprocess.run(build, check=True, stdout=subprocess.DEVNULL)
    return folder


def compiler() -> str:
    """The C compiler."""
    found = shutil.which("cc") or shutil.which("gcc")
    if found is None:
        pytest.skip("there is no C compiler")
    return found


def compile_program(source: Path, program: Path, *flags: str, folder: Path | None = None) -> Path:
    """Link a program to our library, or against what the flags name where there is a folder."""
    if folder is None:
        folder = library_folder()
        flags = (f"-I{HEADERS}", f"-Wl,-rpath,{folder}", *flags)
    libraries = [f"-L{folder}", "-lfclib", "-lm", "-lpthread"]
    command = [compiler(), "-std=gnu11", "-g", *WARNINGS, str(source), "-o", str(program)]
    subprocess.run([*command, *flags, *libraries], check=True)
    return program
