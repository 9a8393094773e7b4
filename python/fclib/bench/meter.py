"""The time and memory of a run, as the kernel counts them: by a control group, or by process.

A control group (cgroup v2) counts the CPU time of all processes that were ever in it, and none
leaves it by forking. If the system allows it, the group is made below that of the supervisor. If it
has the memory controller, it also counts the memory, each page once. Without a group, the
supervisor adopts each process that loses its parent. So all processes of a run are its descendants,
and their CPU times are added. Memory is then the resident size of one process, or the proportional
size (PSS) of several.
"""

from __future__ import annotations

import contextlib
import functools
import os
import resource
import time
from collections.abc import Set
from pathlib import Path

from fclib import _marked
from fclib.bench import processes

PREFIX = "fclib-bench-"
SHARE = 0.05  # largest share of the time spent on reading proportional sizes
NUMBER = iter(range(1 << 62))


@functools.cache
def home() -> Path | None:
    """The cgroup v2 of this process, if this process may make groups below it.

    None if FCLIB_CGROUP is 0.
    """
    if os.environ.get("FCLIB_CGROUP") == "0":
        return None
    try:
        lines = Path("/proc/self/cgroup").read_text().splitlines()
        own = next(line[3:] for line in lines if line.startswith("0::"))
        mounts = Path("/proc/self/mountinfo").read_text().splitlines()
    except (OSError, StopIteration):
        return None
    for mount in mounts:
        fields, _, kind = mount.partition(" - ")
        if kind.startswith("cgroup2 "):
            root, point = fields.split()[3:5]
            path = Path(point) / os.path.relpath(own, root)
            trial = path / f"{PREFIX}{os.getpid()}-{next(NUMBER)}"
            try:
                trial.mkdir()
                there = (trial / "cpu.stat").exists() and (trial / "cgroup.kill").exists()
                trial.rmdir()
            except OSError:
                continue
            if there:
                return path
    return None


class Meter:
    """Measures a worker and all that it starts; the supervisor makes it before it forks."""

    def __init__(self, foreign: bool = False, ours: Set[int] = frozenset()) -> None:
        """Make a meter.

        Args:
            foreign: whether the worker's code may try to leave its control group.
            ours: children of the supervisor that are no part of the run.
        """
        self.pid = 0
        self.foreign = foreign
        self.ours = ours
        self.group: Path | None = None
        if (above := home()) is not None:
            group = above / f"{PREFIX}{os.getpid()}-{next(NUMBER)}"
            with contextlib.suppress(OSError):
                group.mkdir()
                self.group = group
        self.by_group = self.group is not None and (self.group / "memory.stat").exists()
        # [s] of descendants that had ended before
        self._ended = self._own_ended()
        self._offset = 0.0  # [MB] resident size that the proportional one does not count
        self._next = 0.0  # time at which the proportional size may be read again
        self._last = 0.0

    @property
    def how(self) -> str:
        """The way of measuring, as a store names it."""
        if self.group is None:
            return "processes"
        return "cgroup" if self.by_group else "cgroup, PSS"

    def watch(self, pid: int) -> None:
        """Begin to measure a child that has entered the group."""
        self.pid = pid

    def members(self) -> list[int]:
        """The worker and all processes that it started, without those that have ended."""
        found = {self.pid}
        if self.group is not None:
            with contextlib.suppress(OSError):
                found |= set(map(int, (self.group / "cgroup.procs").read_text().split()))
        if self.group is None or self.foreign:
            for child in self.others():
                found |= set(processes.tree(child))
        return [pid for pid in found if processes.state(pid) not in ("", "Z", "X")]

    def cpu(self) -> float:
        """CPU time in seconds of the worker and of all processes it ever started.

        For foreign code it is the larger of two counts: the control group also counts processes
        that have ended, and the sum over the processes also counts those that have left the group.
        """
        by_group = None
        if self.group is not None:
            with contextlib.suppress(OSError, ValueError, IndexError):
                text = (self.group / "cpu.stat").read_text()
                by_group = int(text.split(maxsplit=2)[1]) * 1e-6
                if not self.foreign:
                    return by_group
        total = self._own_ended() - self._ended
        for child in self.others():
            for member in processes.tree(child):
                total += processes.cpu_clock(member) + processes.cpu_of_ended(member)
        return total if by_group is None else max(by_group, total)

    def others(self) -> list[int]:
        """The children of the supervisor that are part of the run."""
        return [child for child in processes.children(os.getpid()) if child not in self.ours]

    def memory(self) -> float:
        """Memory in MB, each page counted once."""
        if self.by_group:
            assert self.group is not None
            with contextlib.suppress(OSError, ValueError, KeyError):
                return of_group((self.group / "memory.stat").read_text())
        members = self.members()
        unnamed = processes.unnamed(members) if self.foreign else 0.0
        if len(members) <= 1:
            return processes.resident(self.pid) + unnamed
        now = time.monotonic()
        if now >= self._next:
            self._last = self._proportional(members) + self._offset + unnamed
            self._next = now + (time.monotonic() - now) / SHARE
        return self._last

    def _proportional(self, members: list[int]) -> float:
        """Memory in MB of some processes and of this one, from which they were forked."""
        return sum(map(processes.proportional, [os.getpid(), *members]))

    @staticmethod
    def _own_ended() -> float:
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        return ended.ru_utime + ended.ru_stime

    def kill(self) -> int | None:
        """End all processes of the run, and wait. Return the exit status of the worker."""
        if self.group is not None:
            with contextlib.suppress(OSError):
                (self.group / "cgroup.kill").write_text("1")
        status = processes.kill_all(self.pid, self.ours)
        if self.group is not None:
            remove(self.group)
        return status


def of_group(stat: str) -> float:
    """Memory in MB of a control group (memory.stat), without cached files."""
    sizes = {name: int(size) for name, size in map(str.split, stat.splitlines())}
    return (sizes["anon"] + max(sizes["shmem"], sizes["file_mapped"])) / 1e6


def remove(group: Path) -> None:
    """End the processes left in a control group, and remove the group."""
    for _ in range(200):
        try:
            group.rmdir()
        except FileNotFoundError:
            return
        except OSError:
            with contextlib.suppress(OSError):
                (group / "cgroup.kill").write_text("1")
            time.sleep(5e-3)
        else:
            return


def enter(group: str) -> None:
    """Have the calling process measured by a control group, if there is one."""
    if group:
        Path(group, "cgroup.procs").write_text("0")


def sweep(supervisor: int, mark: str) -> None:
    """End a supervisor and the processes that it left, and remove its control groups.

    Args:
        supervisor: its process number; it may be stopped, or have ended.
        mark: a text in the environment of all processes that it started.
    """
    own = os.getpid()
    _marked.kill([pid for pid in _marked.marked(mark) if pid != own])
    if (above := home()) is not None:
        for group in above.glob(f"{PREFIX}{supervisor}-*"):
            remove(group)
