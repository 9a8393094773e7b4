"""The process that solves: it has limits, is watched and is never trusted.

It is forked from a template (template.py), and talks to its supervisor over a socket, in JSON and
in the bytes of arrays:

    supervisor: an order   the solver and its options, but not the problem
    worker: warming        it calls a new solver on a small problem first
    worker: ready          the solver is loaded
    supervisor: a problem  its numbers and a guess, pickled, without title, path and solution
    worker: taken          it has received them
    supervisor: go         it has read the clocks, and set the limits
    worker: done           the solver has returned, or raised
    supervisor: go         it has read the clocks
    worker: an answer      the solver's result; the supervisor judges it

Each message of the worker carries the number of the order, which is random.
"""

from __future__ import annotations

import errno
import functools
import json
import os
import pickle
import re
import resource
import signal
import tempfile
from collections import OrderedDict
from socket import MSG_PEEK, MSG_WAITALL, socket
from typing import Any

import numpy as np
import numpy.typing as npt

from fclib import _core, _digest, _registry, _solve, external
from fclib.bench import processes, warm_up
from fclib.bench.modules import load_modules
from fclib.external import command, plugin

CACHE = 256e6  # [bytes] size of the problems that a process keeps
VECTORS = ("v", "u", "r", "l")
CERTIFICATE = ("certificate_y", "certificate_z")
STAGE = ("name", "calls", "solved", "iterations", "factorisations", "cpu_s", "time")
PARTS = ("data", "indices", "indptr", "row", "col")  # of a sparse matrix
HISTORY = 500  # number of reports kept of a run, with the first and the last

FULL = (errno.ENOSPC, errno.EDQUOT, errno.ENFILE)
NO_SPACE = (*map(os.strerror, FULL), "No usable temporary directory")
GO = b"go"
# statuses that solvers outside of the core report by fclib.SolverError
BY_SIGNAL = re.compile(r"(?:was ended by signal|ended with signal) (\d+)")
NOTHING = ("made no output", "wrote no /solution")
GARBAGE = ("its output", "its solution has", "returned an array of shape", _registry.REAL)


def bytes_of(problem: _solve.Problem) -> int:
    """The bytes of a problem's numbers and indices, without its geometry."""
    found = 0
    for value in problem.__getstate__().values():
        parts = [value] if isinstance(value, np.ndarray) else [getattr(value, a, 0) for a in PARTS]
        found += sum(part.nbytes for part in parts if isinstance(part, np.ndarray))
    return found


class Problems:
    """The problems read last, as many as fit into CACHE bytes."""

    def __init__(self) -> None:
        self.kept: OrderedDict[tuple[str, str], tuple[_solve.Problem, int]] = OrderedDict()

    def get(self, order: dict[str, Any]) -> _solve.Problem:
        """The problem of an order.

        Raises:
            fclib.Error: it cannot be read, or has changed.
        """
        key = (order["path"], order["hash"])
        if key not in self.kept:
            problem = _core.read(order["path"], order["kind"])
            if _digest.digest(problem) != order["hash"]:
                raise _core.FileError(
                    f"{order['path']}: has changed since the campaign looked at it; start it again"
                )
            self.kept[key] = problem, bytes_of(problem)
        self.kept.move_to_end(key)
        while len(self.kept) > 1 and sum(size for _, size in self.kept.values()) > CACHE:
            self.kept.popitem(last=False)
        return self.kept[key][0]


def send(link: socket, message: bytes) -> None:
    """Send a message: first its length (8 bytes), then the message itself."""
    link.sendall(len(message).to_bytes(8, "little") + message)


def receive(link: socket) -> bytes:
    """The next message; EOFError if there is none."""

    def exactly(size: int) -> bytes:
        got = link.recv(size, MSG_WAITALL)
        if len(got) < size:
            raise EOFError
        return got

    return exactly(int.from_bytes(exactly(8), "little"))


def handed(problem: _solve.Problem, guess: _core.Solution | None) -> bytes:
    """A problem as the worker gets it: without anything that identifies it."""
    values = problem.__getstate__()
    values["info"] = _core.ProblemInfo()
    return pickle.dumps((type(problem), values, guess), pickle.HIGHEST_PROTOCOL)


def taken(message: bytes) -> tuple[_solve.Problem, _core.Solution | None]:
    """The problem of a message that `handed` made."""
    kind, values, guess = pickle.loads(message)
    problem = kind.__new__(kind)
    problem.__setstate__(values)
    return problem, guess


def serve(supervisor: socket, request: dict[str, Any]) -> None:
    """Do the orders that come, until the supervisor is gone.

    Args:
        supervisor: the link to it.
        request: the request to the template; `folder` is for temporary files.
    """
    supervisor.recv(1, MSG_PEEK)  # once an order is there, the supervisor is the parent
    processes.die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the campaign's
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.environ["TMPDIR"] = tempfile.tempdir = request["folder"]
    begun = processes.environment()
    warm: set[str] = set()  # solvers already called
    while True:
        try:
            order = json.loads(receive(supervisor))
            reply, arrays = answer(order, supervisor, warm)
            reply |= {"nonce": order["nonce"], "unchanged": processes.environment() == begun}
            send(supervisor, json.dumps(reply).encode())  # Python's JSON has nan and inf
            for array in arrays:
                send(supervisor, array.tobytes())
        except (EOFError, OSError):
            os._exit(0)


def answer(
    order: dict[str, Any], supervisor: socket, warm: set[str]
) -> tuple[dict[str, Any], list[npt.NDArray[np.float64]]]:
    """Run the solver of an order. Return the answer, and the vectors of the solution."""

    def say(word: str) -> None:
        send(supervisor, json.dumps({"nonce": order["nonce"], "word": word}).encode())

    def wait() -> None:
        if receive(supervisor) != GO:
            raise EOFError

    name = order["solver"]
    try:
        find(name, order["modules"]).check_options(order["options"])
    except _core.Error as error:
        return {"status": "error", "message": one_line(error)}, []
    if order["warm"] and name not in warm and not name.startswith(command.PREFIX):
        say("warming")
        warm_up.call(order["kind"], order["spacedim"], name, order["options"])
        warm.add(name)
    say("ready")
    try:
        problem, guess = taken(receive(supervisor))
    except MemoryError as error:
        return {"status": "memory", "message": one_line(error)}, []
    processes.release_memory()
    command.reported = False
    say("taken")
    wait()
    result: _core.Result | None = None
    try:
        result = _solve.solve(
            problem,
            name,
            order["tol"],
            time_limit=order["limits"]["wall"],
            history=order["history"],
            merit=order["merit"],
            guess=guess,
            **order["options"],
        )
        status, message = result.status, result.message
    except Exception as error:
        status, message = classify(error, foreign(name)), one_line(error)
    say("done")
    wait()
    reply: dict[str, Any] = {
        "status": status,
        "message": message,
        "warm": name in warm,
        "guessed": guess is not None,
        "reported": command.reported,
    }
    arrays: list[npt.NDArray[np.float64]] = []
    if result is not None:
        solution = result.solution
        # the driver puts zeros for values that are not finite
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


def find(name: str, modules: list[str]) -> _core.SolverInfo:
    """The solver of an order; from then on `fclib.solve` knows its name.

    Raises:
        fclib.Error: there is none, or a module cannot be imported.
    """
    if name in built_in():
        return _registry.find_solver(name)
    if (info := external.find(name)) is not None:
        _registry.register(info)  # so that no package is searched for it
        return info
    load_modules(modules)
    return _registry.find_solver(name)


@functools.cache
def built_in() -> frozenset[str]:
    """The solvers of the core, modules cannot take their names."""
    return frozenset(solver.name for solver in _core.solvers())


def adapted(name: str) -> bool:
    """Whether a solver belongs to a package for which FCLIB has an adapter."""
    own = (command.PREFIX, plugin.PREFIX)
    return any(name.startswith(x.PREFIX) for x in external.adapters() if x.PREFIX not in own)


def foreign(name: str) -> bool:
    """Whether a solver's code is somebody else's: a plug-in, a program, a function in Python."""
    return name not in built_in() and not adapted(name)


def classify(error: Exception, foreign: bool) -> str:
    """The status of a run that ended with an exception.

    Args:
        error: what was raised.
        foreign: whether foreign code raised it; that excuses nothing.
    """
    if isinstance(error, _core.UnsuitableError):
        return "error" if foreign else "unsuitable"
    causes: list[BaseException] = [error]
    while (cause := causes[-1].__cause__) is not None:
        causes.append(cause)
    if any(isinstance(cause, MemoryError) for cause in causes):
        return "memory"
    text = str(error)
    if any(isinstance(cause, OSError) and cause.errno in FULL for cause in causes) or any(
        words in text for words in NO_SPACE
    ):
        return "no_space"
    if found := BY_SIGNAL.search(text):
        return of_signal(int(found[1]), outside=not foreign)
    if any(words in text for words in NOTHING):
        return "nothing"
    if isinstance(error, _registry.SolverError) and any(words in text for words in GARBAGE):
        return "garbage"
    return "error"


def of_signal(number: int, outside: bool) -> str:
    """The status of a process ended by a signal that the supervisor did not send.

    Args:
        number: the signal's number.
        outside: whether such a signal can only have come from outside of the run.
    """
    if number == signal.SIGXCPU:
        return "cpu_limit"
    deadly = number in (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP)
    return "killed" if deadly and outside else "crashed"


def one_line(error: BaseException) -> str:
    """The message of an exception."""
    text = " ".join(str(error).encode(errors="replace").decode().split())
    known = isinstance(error, (_core.Error, OSError))
    return (text if known and text else f"{type(error).__name__}: {text}")[:500]


def thinned(history: npt.NDArray[np.void]) -> list[tuple[int, float, float, str]]:
    """The history; a long one is thinned evenly over the logarithm of the iteration."""
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
