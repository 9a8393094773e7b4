"""The C library that the tests of the C interface use, and C programs that are linked to it."""

import fcntl
import functools
import os
import shutil
import subprocess
import sys
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
    with (folder / "fclib-tests.lock").open("w") as lock:  # of tests that run side by side
        fcntl.flock(lock, fcntl.LOCK_EX)
        subprocess.run(build, check=True, stdout=subprocess.DEVNULL)
    return folder


def compiler(language: str) -> str:
    """The compiler of C or of C++."""
    names = {"C": ("cc", "gcc"), "C++": ("c++", "g++")}[language]
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None:
        pytest.skip(f"there is no {language} compiler")
    return found


def compile_fortran(source: Path, program: Path, *flags: str) -> Path:
    """Link a Fortran program to our library, its module compiled beside it."""
    compiler = shutil.which("gfortran")
    if compiler is None:
        pytest.skip("there is no Fortran compiler")
    folder = library_folder()
    module = folder / "generated" / "fclib.f90"
    if not module.is_file():
        pytest.skip("the build has no Fortran module")
    warnings = ["-std=f2018", "-Wall", "-Wextra", "-pedantic", "-Werror", "-Wno-compare-reals"]
    subprocess.run(
        [
            *(
                compiler,
                *warnings,
                "-g",
                "-fcheck=all",
                *flags,
                "-J",
                str(program.parent),
                str(module),
                str(source),
            ),
            *("-o", str(program), f"-L{folder}", "-lfclib", f"-Wl,-rpath,{folder}"),
        ],
        check=True,
    )
    return program


def compile_program(source: Path, program: Path, *flags: str, folder: Path | None = None) -> Path:
    """Link a program to our library, or against what the flags name where there is a folder."""
    if folder is None:
        folder = library_folder()
        flags = (f"-I{HEADERS}", f"-Wl,-rpath,{folder}", *flags)
    elif sys.platform == "linux":  # a library that was unpacked there has its own beside it
        flags = (*flags, f"-Wl,-rpath-link,{folder}")
    libraries = [f"-L{folder}", "-lfclib", "-lm", "-lpthread"]
    language, standard = ("C++", "-std=c++20") if source.suffix == ".cpp" else ("C", "-std=gnu11")
    command = [compiler(language), standard, "-g", *WARNINGS, str(source), "-o", str(program)]
    subprocess.run([*command, *flags, *libraries], check=True)
    return program
