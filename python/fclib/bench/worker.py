"""The process that solves: it is limited, watched and never trusted.

It is forked by a supervisor, and talks to it over a socket, in JSON and in the bytes of arrays. It
reads the problem, sets its own limits, says that it starts, runs the solver, and sends what that
returned; the supervisor judges it.
"""

from __future__ import annotations

import json
import math
import os
import re
import resource
import signal
import time
from collections import OrderedDict
from pathlib import Path
from socket import MSG_WAITALL, socket
from typing import Any

import numpy as np
import numpy.typing as npt

from fclib import _core, _digest, _registry, _solve
from fclib.bench import processes
from fclib.bench.modules import load_modules

CACHE = 256e6  # [bytes] of problems that a process keeps
VECTORS = ("v", "u", "r", "l")
CERTIFICATE = ("certificate_y", "certificate_z")
STAGE = ("name", "calls", "solved", "iterations", "time")
HISTORY = 500  # reports that are kept of a run, the first and the last among them

# what solvers that are not of the core say through fclib.SolverError
BY_SIGNAL = re.compile(r"(?:was ended by signal|ended with signal) (\d+)")
NOTHING = ("made no output", "wrote no /solution")
GARBAGE = ("its output", "its solution has", "returned an array of shape")


class Problems:
    """The problems read last, while they are small enough together."""

    def __init__(self) -> None:
        self.kept: OrderedDict[tuple[str, str], tuple[_solve.Problem, int]] = OrderedDict()

    def get(self, order: dict[str, Any]) -> _solve.Problem:
        """The problem of an order.

        Raises:
            fclib.Error: it cannot be read, or is another one than it was.
        """
        key = (order["path"], order["hash"])
        if key not in self.kept:
            problem = _core.read(order["path"], order["kind"])
            if _digest.digest(problem) != order["hash"]:
                raise _core.FileError(
                    f"{order['path']}: has changed since the campaign looked at it; start it again"
                )
            self.kept[key] = problem, Path(order["path"]).stat().st_size
        self.kept.move_to_end(key)
        while len(self.kept) > 1 and sum(size for _, size in self.kept.values()) > CACHE:
            self.kept.popitem(last=False)
        return self.kept[key][0]


def send(link: socket, message: bytes) -> None:
    """Send a message: its length (8 bytes), and itself."""
    link.sendall(len(message).to_bytes(8, "little") + message)


def receive(link: socket) -> bytes:
    """The next message; EOFError where there is none."""

    def exactly(size: int) -> bytes:
        got = link.recv(size, MSG_WAITALL)
        if len(got) < size:
            raise EOFError
        return got

    return exactly(int.from_bytes(exactly(8), "little"))


def limit(order: dict[str, Any]) -> None:
    """A limit of the kernel on the address space, at twice the memory that the supervisor kills at.

    It is that of this process and of what it has left from earlier runs, as the interpreter of
    another package's solver; what it starts later inherits it.
    """
    memory = order["limits"]["memory"]
    if math.isfinite(memory):
        for pid in processes.tree(os.getpid()):
            size = processes.address_space(pid) + int(2 * memory * 1e6)
            processes.lower(pid, resource.RLIMIT_AS, size)


def unlimit() -> None:
    """Lift the limit between runs."""
    for pid in processes.tree(os.getpid()):
        processes.lower(pid, resource.RLIMIT_AS, resource.RLIM_INFINITY)


def serve(supervisor: socket, problems: Problems) -> None:
    """Do what comes, until the supervisor is gone."""
    processes.die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the campaign's
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    while True:
        try:
            order = json.loads(receive(supervisor))
        except (EOFError, OSError):
            os._exit(0)
        reply, arrays = answer(order, problems, supervisor)
        unlimit()
        send(supervisor, json.dumps(reply).encode())  # nan and inf are words of Python's JSON
        for array in arrays:
            send(supervisor, array.tobytes())


def answer(
    order: dict[str, Any], problems: Problems, supervisor: socket
) -> tuple[dict[str, Any], list[npt.NDArray[np.float64]]]:
    """Run the solver of an order: what is to be said of it, and the vectors of its solution."""
    try:
        problem = problems.get(order)
    except (_core.Error, OSError, MemoryError) as error:
        return {"status": "unreadable", "message": one_line(error)}, []
    try:
        load_modules(order["modules"])
        solver = _registry.find_solver(order["solver"])
        solver.check_options(order["options"])
    except _core.Error as error:
        return {"status": "error", "message": one_line(error)}, []

    processes.release_memory()
    processes.forget_peak()
    resident = processes.peak_memory()
    me = os.getpid()
    limit(order)
    send(supervisor, b"started")
    before = total_cpu(me)
    start = time.perf_counter()
    result: _core.Result | None = None
    try:
        result = _solve.solve(
            problem,
            order["solver"],
            order["tol"],
            time_limit=order["limits"]["wall"],
            history=order["history"],
            merit=order["merit"],
            **order["options"],
        )
        status, message = result.status, ""
    except Exception as error:
        status, message = classify(error), one_line(error)
    wall = time.perf_counter() - start
    unlimit()
    reply: dict[str, Any] = {
        "status": status,
        "message": message,
        "wall_s": wall,
        "total_cpu_s": total_cpu(me) - before,
        "memory": processes.peak_memory() - resident,
    }
    arrays: list[npt.NDArray[np.float64]] = []
    if result is not None:
        solution = result.solution
        # the driver puts zeros in the place of what is not finite
        if status == "diverged" and not solution.r.any():
            reply["status"] = "invalid"
        if status == "inaccurate" and not solution.r.any() and problem.nc:
            reply["status"] = "nothing"
        vectors = {name: getattr(solution, name) for name in VECTORS}
        vectors = {name: value for name, value in vectors.items() if value is not None}
        for name, value in zip(
            CERTIFICATE, (result.certificate, result.certificate_z), strict=True
        ):
            if value is not None:
                vectors[name] = value
        arrays = [np.ascontiguousarray(value, dtype=float) for value in vectors.values()]
        stages = [{name: getattr(stage, name) for name in STAGE} for stage in result.stages]
        reply |= {
            "vectors": list(vectors),
            "iterations": result.iterations,
            "cpu_s": result.cpu_s,
            "setup_s": result.setup_s,
            "stages": json.dumps(stages) if stages else None,
            "history": thinned(result.history) if result.history is not None else None,
        }
    return reply, arrays


def total_cpu(pid: int) -> float:
    """[s] of CPU that this process and its descendants have used, all threads."""
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    own = time.process_time() + ended.ru_utime + ended.ru_stime
    return own + processes.cpu_of_children(pid)


def classify(error: Exception) -> str:
    """The status of a run that ended with an exception."""
    if isinstance(error, _core.UnsuitableError):
        return "unsuitable"
    causes: list[BaseException] = [error]
    while (cause := causes[-1].__cause__) is not None:
        causes.append(cause)
    if any(isinstance(cause, MemoryError) for cause in causes):
        return "memory"
    text = str(error)
    if found := BY_SIGNAL.search(text):
        return of_signal(int(found[1]))
    if any(words in text for words in NOTHING):
        return "nothing"
    if isinstance(error, _registry.SolverError):
        if any(words in text for words in GARBAGE):
            return "garbage"
        # not the solver has raised, but the conversion of its answer into numbers
        trace = causes[-1].__traceback__
        if isinstance(causes[-1], (TypeError, ValueError)) and trace and not trace.tb_next:
            return "garbage"
    return "error"


def of_signal(number: int) -> str:
    """The status of a process that a signal has ended, where the supervisor has not sent it."""
    if number == signal.SIGXCPU:
        return "cpu_limit"
    return "killed" if number in (signal.SIGKILL, signal.SIGTERM) else "crashed"


def one_line(error: BaseException) -> str:
    """What an exception says."""
    text = " ".join(str(error).split())
    known = isinstance(error, (_core.Error, OSError))
    return (text if known and text else f"{type(error).__name__}: {text}")[:500]


def thinned(history: npt.NDArray[np.void]) -> list[tuple[int, float, float, str]]:
    """The history, of a long one those at evenly spaced logarithms of the iteration."""
    count = len(history)
    chosen = list(range(count))
    if count > HISTORY:
        spaced = np.geomspace(1, count, HISTORY).astype(int) - 1
        chosen = sorted({0, count - 1, *spaced.tolist()})
    return [
        (
            int(history["iteration"][k]),
            float(history["error"][k]),
            float(history["time"][k]),
            str(history["stage"][k]),
        )
        for k in chosen
    ]
