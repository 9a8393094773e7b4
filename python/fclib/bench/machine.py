"""The machine of a run: what stays, and what changes from one second to the next."""

from __future__ import annotations

import contextlib
import fcntl
import functools
import importlib.metadata
import json
import os
import platform
import tempfile
import time
from pathlib import Path
from typing import Any

from fclib.bench.generated import cache_folder

CPUINFO = Path("/proc/cpuinfo")
SCALING = Path("/sys/devices/system/cpu/cpu0/cpufreq")


def _cpuinfo(key: str) -> str:
    try:
        with CPUINFO.open() as lines:
            for line in lines:
                name, _, value = line.partition(":")
                if name.strip() == key:
                    return value.strip()
    except OSError:
        pass
    return ""


def _first_line(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:
        return ""


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return ""


def calibration_file() -> Path:
    """The file in the user's cache with the calibration of this machine; it may be missing."""
    own = f"{platform.node()}-{_cpuinfo('model name')}-{os.cpu_count()}"
    name = "".join(c if c.isalnum() else "-" for c in own)
    return cache_folder() / f"calibration-{name}.json"


def _calibration() -> dict[str, Any]:
    """The calibration of this machine, as a fact of it; empty if there is none."""
    try:
        return {"calibration": json.loads(calibration_file().read_text(encoding="utf-8"))}
    except (OSError, ValueError):
        return {}


@functools.cache
def facts() -> dict[str, Any]:
    """The facts of this machine and its software that a store keeps, in JSON's types."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return {
        "node": platform.node(),
        "cpu": _cpuinfo("model name") or platform.processor() or platform.machine(),
        "architecture": platform.machine(),
        "cores": os.cpu_count(),
        "usable_cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None,
        "memory_gb": round(memory / 1e9, 1),
        "governor": _first_line(SCALING / "scaling_governor"),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "fclib": _version("fclib"),
        "numpy": _version("numpy"),
        "scipy": _version("scipy"),
        **_calibration(),
    }


_sampled: tuple[float, float | None] = (-1.0, None)


def frequency() -> float | None:
    """The frequency of the first core in MHz, at most a second old; None if it is unknown."""
    global _sampled
    now = time.monotonic()
    if _sampled[0] < 0 or now - _sampled[0] > 1:
        text = _first_line(SCALING / "scaling_cur_freq")
        try:
            value = float(text) / 1000 if text else float(_cpuinfo("cpu MHz"))
        except ValueError:
            value = None
        _sampled = (now, value)
    return _sampled[1]


def reserve(count: int) -> tuple[set[int], list[int]]:
    """Reserve so many cores that no other campaign of this user has. Return them with their locks.

    None if fewer are free, if the system does not allow the choice, or if the folder of the locks
    is not this user's.
    """
    held: dict[int, int] = {}
    try:
        folder = folder_of_locks()
        try:
            for core in sorted(os.sched_getaffinity(0)):
                if len(held) == count:
                    break
                how = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
                lock = os.open(str(core), how, 0o600, dir_fd=folder)
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except OSError:
                    os.close(lock)
                else:
                    held[core] = lock
        finally:
            os.close(folder)
    except (OSError, AttributeError):
        pass
    if len(held) < count or not count:
        for lock in held.values():
            os.close(lock)
        return set(), []
    return set(held), list(held.values())


def folder_of_locks() -> int:
    """Open the folder of the locks of cores; make it if it is missing.

    Raises:
        OSError: it is a link, another user's, or one that others may write to.
    """
    path = Path(tempfile.gettempdir()) / f"fclib-cores-{os.getuid()}"
    with contextlib.suppress(FileExistsError):
        path.mkdir(0o700)
    folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    facts = os.fstat(folder)
    if facts.st_uid != os.getuid() or facts.st_mode & 0o022:
        os.close(folder)
        raise PermissionError(f"{path}: is not a folder that this user alone may write to")
    return folder
