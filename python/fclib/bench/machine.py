"""The machine of a run: what stays, and what changes from one second to the next."""

from __future__ import annotations

import functools
import importlib.metadata
import os
import platform
import time
from pathlib import Path
from typing import Any

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


@functools.cache
def facts() -> dict[str, Any]:
    """What is worth knowing of this machine and its software, in JSON's types."""
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
    }


_sampled: tuple[float, float | None] = (-1.0, None)


def frequency() -> float | None:
    """[MHz] of the first core, at most a second old; None where the system does not say."""
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
