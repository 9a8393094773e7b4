"""Processes as Linux shows them: parents and children, time and memory."""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import signal
import time
from collections.abc import Set
from pathlib import Path
from typing import Any

from fclib import _marked

TICKS = os.sysconf("SC_CLK_TCK")
PAGE = os.sysconf("SC_PAGE_SIZE")
PROC = Path("/proc")
SET_PDEATHSIG, SET_CHILD_SUBREAPER = 1, 36


def supported() -> bool:
    """Whether this system shows the facts that the limits need."""
    return (PROC / "self" / "stat").exists()


def _prctl(option: int, value: int) -> None:
    ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def die_with_parent() -> None:
    """Ask the kernel to kill this process once its parent ends, however the parent ends."""
    _prctl(SET_PDEATHSIG, signal.SIGKILL)


def adopt_orphans() -> None:
    """Adopt processes whose parent has ended: they become children of this process, not of init."""
    _prctl(SET_CHILD_SUBREAPER, 1)


def _stat(pid: int) -> list[str] | None:
    """The fields of /proc/PID/stat after the name, from the state (field 3) on."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return None
    return text[text.rindex(")") + 2 :].split()


def children(pid: int) -> list[int]:
    """The children of a process that have not ended, or were not waited for."""
    found: list[int] = []
    try:
        tasks = os.listdir(f"/proc/{pid}/task")  # noqa: PTH208 (half the time)
        for task in tasks:
            text = Path(f"/proc/{pid}/task/{task}/children").read_text()
            found += map(int, text.split())
    except (FileNotFoundError, ProcessLookupError):
        if not Path(f"/proc/{pid}").exists() or _lists_children():
            return found
        for entry in PROC.iterdir():  # this kernel has no such list
            fields = _stat(int(entry.name)) if entry.name.isdigit() else None
            if fields and int(fields[1]) == pid:
                found.append(int(entry.name))
    return found


def _lists_children() -> bool:
    me = os.getpid()
    return Path(f"/proc/{me}/task/{me}/children").exists()


def tree(pid: int) -> list[int]:
    """A process and all that descend from it."""
    found = [pid]
    for known in found:
        found += children(known)
    return found


def cpu_clock(pid: int) -> float:
    """CPU time in seconds of a process, in all its threads, ended ones too; 0 if it is gone.

    The clock of another process, as clock_getcpuclockid(3) makes it; to the nanosecond.
    """
    try:
        return time.clock_gettime((~pid << 3) | 2)
    except OSError:
        return 0.0


def cpu_of_ended(pid: int) -> float:
    """CPU time in seconds of the children that a process has waited for, in ticks of 10 ms."""
    fields = _stat(pid)
    return sum(map(int, fields[13:15])) / TICKS if fields else 0.0


def resident(pid: int) -> float:
    """Resident size in MB, with the pages that it shares with others; 0 if it has ended."""
    fields = _stat(pid)
    return int(fields[21]) * PAGE / 1e6 if fields else 0.0


def proportional(pid: int) -> float:
    """Proportional size (PSS) in MB: each page is divided among the processes that have it."""
    try:
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return int(line.split()[1]) * 1024 / 1e6
    except OSError:
        return 0.0
    return resident(pid)


def unnamed(pids: list[int]) -> float:
    """Size in MB of files in memory without a name that processes have open (memfd_create(2)).

    Their mapped parts also count in the resident size.
    """
    found: dict[tuple[int, int], int] = {}
    for pid in pids:
        folder = f"/proc/{pid}/fd"
        with contextlib.suppress(OSError):
            for number in os.listdir(folder):  # noqa: PTH208 (half the time)
                with contextlib.suppress(OSError):
                    path = f"{folder}/{number}"
                    if os.readlink(path).startswith("/memfd:"):  # noqa: PTH115
                        facts = os.stat(path)  # noqa: PTH116
                        found[facts.st_dev, facts.st_ino] = facts.st_blocks * 512
    return sum(found.values()) / 1e6


def peak_memory(pid: int) -> float:
    """The largest resident size in MB of a process since `forget_peak`."""
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e6
    return 0.0


def belongings(pid: int) -> tuple[Any, ...]:
    """The state of a process that others can see: signals, limits, cores, timers."""
    found: list[Any] = []
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith(("SigBlk:", "SigIgn:", "SigCgt:")):
                found.append(line)
        found.append(Path(f"/proc/{pid}/limits").read_text())
        found.append(os.sched_getaffinity(pid))
        found.append((os.getpriority(os.PRIO_PROCESS, pid), os.sched_getscheduler(pid)))
        found.append(os.readlink(f"/proc/{pid}/cwd"))  # noqa: PTH115
    with contextlib.suppress(OSError):  # this kernel has no such list
        found.append(Path(f"/proc/{pid}/timers").read_text())
    return tuple(found)


def environment() -> tuple[Any, ...]:
    """The state of this process that only it can see: arithmetic, alarms, variables."""
    library = ctypes.CDLL(None)
    timers = (signal.ITIMER_REAL, signal.ITIMER_VIRTUAL, signal.ITIMER_PROF)
    rounding = library.fegetround() if hasattr(library, "fegetround") else None
    traps = library.fegetexcept() if hasattr(library, "fegetexcept") else None
    least = float.fromhex("0x1p-1022")
    return (
        rounding,
        traps,
        least * 0.5 > 0.0,  # numbers as small as this are not rounded to 0
        [signal.getitimer(timer)[0] > 0 for timer in timers],
        dict(os.environ),
        os.umask(os.umask(0o077)),
    )


def forget_peak(pid: int) -> None:
    """Restart the count of `peak_memory`."""
    with contextlib.suppress(OSError):
        Path(f"/proc/{pid}/clear_refs").write_text("5")


def threads(pid: int) -> int:
    """How many threads a process has."""
    fields = _stat(pid)
    return int(fields[17]) if fields else 0


def state(pid: int) -> str:
    """One letter of proc(5): R, S, D, Z, T: it is stopped; empty if there is none."""
    fields = _stat(pid)
    return fields[0] if fields else ""


def address_space(pid: int) -> int:
    """The size of a process in bytes; 0 if it has ended."""
    fields = _stat(pid)
    return int(fields[20]) if fields else 0


def lower(pid: int, kind: int, value: int) -> None:
    """Set the soft limit of a process, as far as its hard limit allows."""
    with contextlib.suppress(OSError):  # it has ended
        hard = resource.prlimit(pid, kind)[1]
        unlimited = resource.RLIM_INFINITY
        values = [limit for limit in (value, hard) if limit != unlimited]
        resource.prlimit(pid, kind, (min(values, default=unlimited), hard))


def has_hard_limit(pid: int, kind: int) -> bool:
    """Whether a process has a limit that it cannot lift; the process may have ended."""
    with contextlib.suppress(OSError):
        hard, own = (resource.prlimit(number, kind)[1] for number in (pid, 0))
        return hard != own
    return False


def release_memory() -> None:
    """Give freed memory back to the system, so that the next run does not get it."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def kill_all(pid: int, ours: Set[int] = frozenset(), patience: float = 5.0) -> int | None:
    """Kill a child and all its descendants, and wait for them; this process must adopt orphans.

    Args:
        pid: the child.
        ours: other children of this process, which are left alone.
        patience: longest wait [s].

    Returns:
        The exit status of the child as ``os.waitpid`` has it; None if it cannot be had.
    """
    status: int | None = None
    end = time.monotonic() + patience
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGSTOP)  # it can start nothing more that would be missed
    targets = tree(pid)
    while True:
        _marked.kill(targets)
        left = [child for child in children(os.getpid()) if child not in ours]
        if not left:
            return status
        waited = False
        for child in left:
            ended, how = os.waitpid(child, os.WNOHANG)
            waited = waited or ended != 0
            if ended == pid:
                status = how
        if not waited:
            if time.monotonic() > end:
                return status
            time.sleep(1e-3)
        # this process has adopted the orphans by now
        targets = [member for child in left for member in tree(child)]
