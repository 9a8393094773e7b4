"""The installation of fclib: versions, tests of its parts, optional packages.

Every package is imported in its own process, so that a crash is only a finding. The list of the
optional ones is that of the extras in fclib's own metadata.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import os
import platform
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np

import fclib
from fclib import _core, external

State: TypeAlias = Literal["ok", "absent", "broken"]
LIMIT: Final = 120.0  # [s] of one import
# the purpose of an extra; extras for developers of fclib are not checked
PURPOSE: Final = {
    "simulate": "simulation, in the one version that gives the collection",
    "analysis": "existence and certified solutions",
    "collection": "catalogues, pictures, fetching",
    "bench": "campaigns on a cluster, profiles",
    "report": "the site, figures for a paper",
    "solvers": "solvers to compare with",
    "recorders": "simulators whose steps are recorded",
    "torch": "solving as a layer of PyTorch",
    "jax": "solving as a layer of JAX",
    "gpu": "many small problems on a GPU",
}
# packages whose module has another name
MODULE: Final = {
    "dask-jobqueue": "dask_jobqueue",
    "scikit-fem": "skfem",
    "drake": "pydrake",
    "pin": "pinocchio",
    "cupy-cuda12x": "cupy",
}


@dataclass(frozen=True)
class Finding:
    """The result of one check."""

    part: str  # core, packages, solvers, ...
    name: str
    state: State
    found: str = ""  # a version, or the thing found
    purpose: str = ""
    problem: str = ""  # the fault, if the state is broken
    remedy: str = ""  # the remedy, if the state is not ok


@dataclass(frozen=True)
class Requirement:
    """A line of fclib's metadata: a package, its accepted versions, its extras."""

    package: str
    versions: str  # ">=14"
    extras: tuple[str, ...]
    applies: bool  # whether it applies to this Python

    @property
    def words(self) -> str:
        """The requirement in pip's form."""
        return f'pip install "{self.package}{self.versions}"'

    def allows(self, version: str) -> bool:
        """Whether a version is accepted: one bound, == or >=."""
        known = re.fullmatch(r"(==|>=)([\d.]+)", self.versions)
        if known is None:
            return True
        if known[1] == "==":
            return version == known[2]
        found, least = (
            [int(number) for number in re.findall(r"\d+", text)[:3]] for text in (version, known[2])
        )
        return found >= least


def requirements() -> list[Requirement]:
    """The requirements in fclib's metadata, each package once."""
    merged: dict[str, Requirement] = {}
    for line in importlib.metadata.requires("fclib") or ():
        named = re.match(r"([\w.-]+)\s*([^;]*)", line)
        if named is None:
            continue
        extras = tuple(re.findall(r"extra == [\"']([\w-]+)[\"']", line))
        bound = re.search(r"python_version (<|>=) [\"']3\.(\d+)[\"']", line)
        newer = bound is None or sys.version_info >= (3, int(bound[2]))
        applies = bound is None or newer == (bound[1] == ">=")
        before = merged.get(named[1])
        merged[named[1]] = Requirement(
            named[1], named[2].strip(), (*(before.extras if before else ()), *extras), applies
        )
    return list(merged.values())


def run(code: str) -> tuple[str, str]:
    """The output of a line of Python in its own process, or the error."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=LIMIT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "", f"no answer in {LIMIT:.0f} s"
    if done.returncode < 0:
        return "", f"the process was ended by {signal.Signals(-done.returncode).name}"
    if done.returncode > 0:
        lines = done.stderr.strip().splitlines() or [f"exit status {done.returncode}"]
        return "", lines[-1]
    return done.stdout.strip(), ""


def check_package(requirement: Requirement) -> Finding:
    """Whether a package is there, in an accepted version, and can be imported."""
    name, extras = requirement.package, requirement.extras
    part = "solvers" if "solvers" in extras else "packages"
    purpose = next((PURPOSE[extra] for extra in extras if extra in PURPOSE), "")
    if not requirement.applies:
        return Finding(part, name, "absent", "", purpose, "", "use Python 3.11 or later")
    try:
        version = importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        if extras:
            return Finding(part, name, "absent", "", purpose, "", requirement.words)
        return Finding(part, name, "broken", "", purpose, "is not installed", requirement.words)
    if not requirement.allows(version):
        problem = f"is {version}, and fclib needs {requirement.versions.lstrip('=')}"
        return Finding(part, name, "broken", version, purpose, problem, requirement.words)
    _, problem = run(f"import {MODULE.get(name, name)}")
    if problem:
        remedy = requirement.words.replace("install", "install --force-reinstall")
        return Finding(part, name, "broken", version, purpose, problem, remedy)
    return Finding(part, name, "ok", version, purpose)


def check_core() -> Iterator[Finding]:
    """The package, its extension, and the libraries in it."""
    part, reinstall = "core", "build and install fclib anew"
    folder = str(Path(fclib.__file__).parent)
    installed = importlib.metadata.version("fclib")
    if installed == fclib.__version__:
        yield Finding(part, "fclib", "ok", installed, folder)
    else:
        problem = f"the package is {installed}, its extension {fclib.__version__}"
        yield Finding(part, "fclib", "broken", installed, folder, problem, reinstall)
    yield Finding(part, "Python", "ok", platform.python_version(), sys.executable)

    built = _core.build_info()
    origin = "inside the extension" if built["hdf5_bundled"] else "a library of the system"
    if built["hdf5"] == built["hdf5_compiled"]:
        yield Finding(part, "HDF5", "ok", built["hdf5"], origin)
    else:
        problem = f"{built['hdf5']} is loaded, and fclib was built with {built['hdf5_compiled']}"
        remedy = f"{reinstall}, or set LD_LIBRARY_PATH so that the latter comes first"
        yield Finding(part, "HDF5", "broken", built["hdf5"], origin, problem, remedy)
    yield Finding(part, "Eigen", "ok", built["eigen"])
    yield Finding(
        part,
        "METIS",
        "ok" if built["metis"] else "absent",
        "",
        "orders the factorisations of large systems",
        remedy="" if built["metis"] else "install libmetis-dev, and build fclib anew",
    )
    yield Finding(part, "compiler", "ok", built["compiler"])
    yield Finding(part, "judge", "ok", built["judge"], "the precision that errors are computed in")


def check_work() -> Finding:
    """A problem written, read, solved and judged."""
    name, purpose = "trial", "a problem written, read, solved and judged"
    # a unit mass that falls onto a plane and slides
    problem = fclib.LocalProblem(W=np.eye(3), q=np.array([-1.0, 2.0, 0.0]), mu=np.array([0.5]))
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "trial.hdf5"
            fclib.write(path, problem)
            again = fclib.read(path)
        error = fclib.merit(problem, fclib.solve(again, tol=1e-10).solution).error
    except (fclib.Error, OSError) as failure:
        remedy = "make room in the folder that TMPDIR names, or build fclib anew"
        return Finding("core", name, "broken", "", purpose, str(failure), remedy)
    if not error <= 1e-10:
        trouble = f"the error of the solution is {error:.1e}, expected at most 1e-10"
        return Finding("core", name, "broken", "", purpose, trouble, "build fclib anew")
    return Finding("core", name, "ok", "", purpose)


def check_adapter(adapter: external.Adapter, known: Sequence[str]) -> Finding | None:
    """Solvers of others that are not packages of the extras."""
    name = adapter.PREFIX.rstrip(":")
    if name in known or name in ("cmd", "plugin"):
        return None
    code = (
        "import json\n"
        "from fclib.external import adapters\n"
        f"adapter, = (a for a in adapters() if a.PREFIX == {adapter.PREFIX!r})\n"
        "missing = adapter.missing()\n"
        "print(json.dumps([missing, '' if missing else adapter.version()]))\n"
    )
    told, problem = run(code)
    missing, version = json.loads(told or '["", ""]')
    state: State = "broken" if problem else "absent" if missing else "ok"
    return Finding("solvers", name, state, version, adapter.SOLVERS, problem, missing)


def check_rendering() -> Finding:
    """Whether pictures of scenes can be drawn."""
    part, name, purpose = "pictures", "rendering", "pictures of scenes, offscreen"
    code = (
        "from fclib.simulate.render import NoRenderer, backend\n"
        "try:\n    print(backend())\n"
        "except NoRenderer:\n    pass\n"
    )
    found, problem = run(code)
    if "ImportError" in problem:
        # the line on MuJoCo says what to do
        return Finding(part, name, "absent", "", f"{purpose}; needs MuJoCo")
    if problem:
        return Finding(part, name, "broken", "", purpose, problem, "set MUJOCO_GL to osmesa")
    remedy = "" if found else "apt-get install libosmesa6"
    return Finding(part, name, "ok" if found else "absent", found, purpose, "", remedy)


def check_gpu() -> Finding:
    """Whether batches can be solved on a GPU: CuPy, whichever of its packages, and a device."""
    code = (
        "from fclib import _device\n"
        "missing = _device.missing()\n"
        "print(missing or 'ok ' + _device.name())\n"
    )
    told, problem = run(code)
    part, purpose = "gpu", "solve_batch with arrays on a GPU"
    if problem:
        return Finding(part, "GPU", "broken", "", purpose, problem, "pip install 'fclib[gpu]'")
    if told.startswith("ok "):
        return Finding(part, "GPU", "ok", told[3:], purpose)
    return Finding(part, "GPU", "absent", "", purpose, "", told)


def check_h5py() -> Finding | None:
    """Whether h5py, if it is installed, and fclib read each other's files in one process."""
    if importlib.util.find_spec("h5py") is None:
        return None
    code = (
        "import os, tempfile, h5py, numpy as np, fclib\n"
        "problem = fclib.LocalProblem(W=np.eye(3), q=np.ones(3), mu=np.ones(1))\n"
        "with tempfile.TemporaryDirectory() as folder:\n"
        "    path = os.path.join(folder, 'trial.hdf5')\n"
        "    fclib.write(path, problem)\n"
        "    with h5py.File(path, 'r+') as file:\n"
        "        file['fclib_local/vectors/q'][:] = 2.0\n"
        "    assert (fclib.read(path).q == 2.0).all(), 'what h5py wrote is not what fclib reads'\n"
        "print(h5py.__version__, 'with HDF5', h5py.version.hdf5_version)\n"
    )
    found, problem = run(code)
    purpose = "in one process with fclib"
    remedy = "pip install --force-reinstall h5py" if problem else ""
    return Finding(
        "packages", "h5py", "broken" if problem else "ok", found, purpose, problem, remedy
    )


def examine() -> list[Finding]:
    """All findings, by part."""
    packages = [one for one in requirements() if not one.extras or set(one.extras) & set(PURPOSE)]
    # a newer Python does not need the packages for an older one
    packages = [one for one in packages if one.applies or one.package == "mujoco"]
    known = [one.package for one in packages]
    asked: list[Callable[[], Finding | None]] = [
        check_work,
        *(partial(check_package, one) for one in packages),
        check_h5py,
        *(partial(check_adapter, adapter, known) for adapter in external.adapters()),
        check_gpu,
        check_rendering,
    ]
    with ThreadPoolExecutor(max_workers=min(4, os.cpu_count() or 1)) as pool:
        found = [*check_core(), *filter(None, pool.map(lambda ask: ask(), asked))]
    order = list(dict.fromkeys(finding.part for finding in found))
    return sorted(found, key=lambda finding: order.index(finding.part))
