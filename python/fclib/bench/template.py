"""The process that workers are forked from: it has imported their modules, and run nothing else.

A supervisor forks it before it reads a problem. So a new worker has no problem, path or solution in
its memory, and costs milliseconds. The template lives as long as its supervisor and the campaign.
Once one of them is gone, it ends the processes left of both, and then itself.

    supervisor: a request, with the worker's socket and its standard error
    template: the worker's number, and whether it is apart

A worker that is *apart* is the first process of its own namespace of processes (pid_namespaces(7)).
There the kernel drops every signal that the run sends to its first process, SIGKILL too. So a
signal that ends it came from outside. No process of the run sees processes outside, or outlives it.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import importlib
import json
import os
import select
import signal
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fclib import _entry_points, _marked, _registry, external
from fclib.bench import meter, processes

# constants of clone(2) and mount(2)
NEW_MOUNTS, NEW_IPC, NEW_USER, NEW_PIDS = 0x00020000, 0x08000000, 0x10000000, 0x20000000
PRIVATE = 0x00040000 | 0x00004000  # MS_PRIVATE, and all mounts below
NO_PROGRAMS = 0x2 | 0x4  # MS_NOSUID, MS_NODEV

PATIENCE = 5.0  # [s] time for a supervisor to end after its campaign

Serve = Callable[[socket.socket, dict[str, Any]], None]


class TemplateGone(Exception):  # noqa: N818 (of the surroundings)
    """The template has ended or is not as it was, and nothing more can be started."""


class Template:
    """The supervisor's side of the template."""

    def __init__(self, campaign: socket.socket, lifeline: int, mark: str, serve: Serve) -> None:
        """Fork the template.

        Args:
            campaign: the supervisor's socket, the template closes it.
            lifeline: the end of a pipe; only the campaign has its other end.
            mark: a text in the environment of all that the supervisor starts.
            serve: the function that a worker runs.
        """
        self.link, theirs = socket.socketpair()
        supervisor = os.getpid()
        self.pid = os.fork()
        if self.pid == 0:
            try:
                self.link.close()
                campaign.close()
                _run(theirs, lifeline, supervisor, mark, serve)
            finally:
                os._exit(1)
        theirs.close()
        self.belongings: tuple[Any, ...] = ()  # its state at first

    def fork(self, request: dict[str, Any], worker: int, errors: int) -> tuple[int, bool]:
        """A new worker: its number, and whether it is apart.

        Args:
            request: `apart` says whether it should be apart; the rest is for `serve`.
            worker: its socket.
            errors: its standard error.

        Raises:
            TemplateGone: the template has ended, or its state has changed.
            OSError: no process can be started.
        """
        has = processes.belongings(self.pid)
        self.belongings = self.belongings or has
        if has != self.belongings:
            raise TemplateGone("the process that starts workers is not as it was")
        try:
            socket.send_fds(self.link, [json.dumps(request).encode()], [worker, errors])
            reply = json.loads(self.link.recv(1000))
        except (OSError, ValueError):
            raise TemplateGone("the process that starts workers has ended") from None
        if reply["pid"] == 0:
            raise OSError(reply["message"])
        return int(reply["pid"]), bool(reply["apart"])

    def end(self) -> None:
        """Dismiss the template."""
        self.link.close()
        _marked.kill([self.pid])
        with contextlib.suppress(ChildProcessError):
            os.waitpid(self.pid, 0)


def _run(link: socket.socket, lifeline: int, supervisor: int, mark: str, serve: Serve) -> None:
    """Fork workers, until the supervisor or the campaign is gone."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    # imports that each worker would need: to unpickle matrices, and to find solvers
    importlib.import_module("scipy.sparse")
    _entry_points.listed(_registry.GROUP)
    external.adapters()
    gc.collect()
    gc.freeze()  # workers do not scan existing objects, so their pages are not copied
    possible = _fork_apart_once()
    looked = select.poll()
    looked.register(link, select.POLLIN)
    looked.register(lifeline, 0)  # poll always reports a closed other end
    while True:
        if lifeline in dict(looked.poll()):
            # a supervisor that is not stopped ends by itself, and this process with it
            time.sleep(PATIENCE)
            break
        message, handles, _, _ = socket.recv_fds(link, 1 << 16, 2)
        if not message:
            break
        request = json.loads(message)
        request["apart"] = request["apart"] and possible
        try:
            pid, apart = _fork(request, handles[0], handles[1], serve)
            reply: dict[str, Any] = {"pid": pid, "apart": apart}
        except OSError as error:
            reply = {"pid": 0, "message": str(error)}
        for handle in handles:
            os.close(handle)
        link.send(json.dumps(reply).encode())
    meter.sweep(supervisor, mark)
    os._exit(0)


def _fork(request: dict[str, Any], worker: int, errors: int, serve: Serve) -> tuple[int, bool]:
    """Fork a process that forks the worker and ends, so that the supervisor adopts the worker."""
    reading, writing = os.pipe()
    between = os.fork()
    if between == 0:
        try:
            if request["apart"]:
                _unshare()
            pid = os.fork()
            if pid == 0:
                _begin(request, worker, errors, serve)
            os.write(writing, f"{pid} {int(request['apart'])}".encode())
        except OSError as error:
            os.write(writing, f"0 {error}".encode())
        finally:
            os._exit(0)
    os.close(writing)
    os.waitpid(between, 0)
    reply = os.read(reading, 1000).decode().partition(" ")
    os.close(reading)
    if not reply[0] or reply[0] == "0":
        raise OSError(reply[2] or "a worker could not be started")
    return int(reply[0]), reply[2] == "1"


def _begin(request: dict[str, Any], worker: int, errors: int, serve: Serve) -> None:
    """Be a worker, with nothing open but its socket and its standard streams."""
    try:
        meter.enter(request["group"])
        nothing = os.open(os.devnull, os.O_RDWR)
        for number, to in enumerate((nothing, nothing, errors)):
            os.dup2(to, number)
        os.dup2(worker, 3)
        os.set_inheritable(3, False)
        os.closerange(4, max(map(int, os.listdir("/proc/self/fd"))) + 1)  # noqa: PTH208
        for number in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)
        os.setsid()
        if request["apart"]:
            _mount_own()
            _let_abort()
        if request["cores"]:
            os.sched_setaffinity(0, request["cores"])
        serve(socket.socket(fileno=3), request)
    except BaseException as error:
        os.write(2, f"{type(error).__name__}: {error}\n".encode())
    finally:
        os._exit(1)


def _unshare() -> None:
    """Make the next child the first process of its own namespaces.

    Root needs no namespace of users. Other users get one that keeps their identity.

    Raises:
        OSError: the system does not let us.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    user, group = os.getuid(), os.getgid()
    if libc.unshare(NEW_PIDS | NEW_MOUNTS | NEW_IPC | (NEW_USER if user else 0)):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    if user:
        Path("/proc/self/setgroups").write_text("deny")
        Path("/proc/self/uid_map").write_text(f"{user} {user} 1")
        Path("/proc/self/gid_map").write_text(f"{group} {group} 1")


def _fork_apart_once() -> bool:
    """Whether the system lets a worker be apart, found by trying; False if FCLIB_APART is 0."""
    if os.environ.get("FCLIB_APART") == "0":
        return False
    trial = os.fork()
    if trial == 0:
        try:
            _unshare()
            child = os.fork()
            os._exit(0 if child == 0 else os.waitpid(child, 0)[1])
        except BaseException:
            os._exit(1)
    return os.waitpid(trial, 0)[1] == 0


def _let_abort() -> None:
    """Have abort(3) end this process with the exit status `signal.SIGABRT`.

    The first process of a namespace ignores signals of its own, so that abort ends it by another
    one, SIGSEGV.
    """
    libc = ctypes.CDLL(None)
    libc.signal.argtypes = (ctypes.c_int, ctypes.c_void_p)
    libc.signal(signal.SIGABRT, ctypes.cast(libc._exit, ctypes.c_void_p))


def _mount_own() -> None:
    """Make /proc show only processes of this namespace, and /dev/shm empty, if allowed."""
    libc = ctypes.CDLL(None)
    libc.mount(b"none", b"/", None, PRIVATE, None)
    libc.mount(b"proc", b"/proc", b"proc", NO_PROGRAMS, None)
    libc.mount(b"fclib", b"/dev/shm", b"tmpfs", NO_PROGRAMS, None)
