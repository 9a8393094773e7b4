"""Siconos: the fc3d, fc2d and rolling solvers of its numerics, in an interpreter of its own.

Acary, Bremond & Huber, "On solving contact problems with Coulomb friction: formulations and
numerical comparisons" (2018). Siconos is no package of PyPI; Debian has it as ``python3-siconos``,
for /usr/bin/python3. Another interpreter is named by the environment variable
``FCLIB_SICONOS_PYTHON``.

One worker process serves all solves, is killed at the time limit and started anew. W is passed in
3 x 3 blocks, the storage that Siconos uses itself; dense to the planar solvers, and by columns to
those of rolling problems, which take no blocks. The time is the CPU time of its driver alone, with
one thread.

Siconos' tolerance is relative to max(||q||, ||r||, ||u||). If the error relative to ||q|| ends
above the tolerance, it runs again from the same point with its tolerance scaled to mean the same,
and time and iterations are those of that run.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import json
import os
import select
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import numpy as np

from fclib import _core, _registry
from fclib._registry import Option, make_solver
from fclib.external._words import RELAXATION

PREFIX = "siconos:"
SOLVERS = "siconos:nsgs and others"
VARIABLE = "FCLIB_SICONOS_PYTHON"
DEFAULT = "/usr/bin/python3"
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
START_LIMIT = 60.0  # [s]
BIG = 10**6
# stored by rows, written in blocks
STORAGES = {"fc2d": "dense", "fc3d": "csr", "rolling_fc3d": "csc"}
Local: TypeAlias = _core.LocalProblem | _core.LocalRollingProblem
Calls: TypeAlias = Annotated[
    int,
    Option(
        "The number of calls that are timed; fewer if they are long. The least time counts.",
        unit="calls",
        lowest=1,
        highest=1000,
    ),
]
HUBER = "Acary, Bremond & Huber 2018"
# families, as those of fclib
SPLIT = "splitting"
NEWTON = "newton"
CONVEX = "optimisation"
VI = "variational inequality"

# name: family, solver of Siconos, title, citation, iterations if the caller sets none
Rows: TypeAlias = dict[str, tuple[str, str, str, str, int]]
FC3D: Rows = {
    "nsgs": (SPLIT, "NSGS", "Nonsmooth Gauss-Seidel", "Jean & Moreau 1992", BIG),
    "nsgs-quartic": (SPLIT, "NSGS", "Nonsmooth Gauss-Seidel, exact", "Bonnefon & Daviet 2011", BIG),
    "nsgs-projection": (
        SPLIT,
        "NSGS",
        "Nonsmooth Gauss-Seidel, projections",
        "Jean & Moreau 1992",
        BIG,
    ),
    "nsn-ac": (NEWTON, "NSN_AC", "Nonsmooth Newton, Alart-Curnier", "Alart & Curnier 1991", 10_000),
    "nsn-fb": (
        NEWTON,
        "NSN_FB",
        "Nonsmooth Newton, Fischer-Burmeister",
        "Fukushima et al. 2002",
        10_000,
    ),
    "nsn-nm": (NEWTON, "NSN_NM", "Nonsmooth Newton, natural map", HUBER, 10_000),
    "prox": ("proximal point", "PROX", "Proximal point over nonsmooth Newton", HUBER, 100_000),
    "tfp": (CONVEX, "TFP", "Tresca fixed point", "Haslinger 1983", 100_000),
    "pfp": (CONVEX, "PFP", "Panagiotopoulos fixed point", "Panagiotopoulos 1975", 100_000),
    "aclmfp": (CONVEX, "ACLMFP", "Fixed point of convex problems", "Acary et al. 2011", 100_000),
    "admm": (CONVEX, "ADMM", "ADMM", "Acary, Armand & Nguyen 2022", 10 * BIG),
    "soclcp": ("relaxation", "SOCLCP", f"Convex relaxation: {RELAXATION}", HUBER, BIG),
    "dsfp": (VI, "DSFP", "De Saxce fixed point", "De Saxce & Feng 1998", 10 * BIG),
    "hp": (VI, "HP", "Hyperplane projection", HUBER, 10 * BIG),
    "vi-eg": (VI, "VI_EG", "Extragradient, for any inequality", "Khobotov 1987", 10 * BIG),
    "vi-fp": (VI, "VI_FPP", "Fixed point, for any inequality", HUBER, 10 * BIG),
    "fp": (VI, "FPP", "Fixed point and projection", HUBER, 10 * BIG),
    "eg": (VI, "EG", "Extragradient", HUBER, 10 * BIG),
}
FC2D: Rows = {
    "2d-nsgs": (SPLIT, "NSGS", "Planar nonsmooth Gauss-Seidel", "Jean & Moreau 1992", BIG),
    "2d-cpg": (CONVEX, "CPG", "Planar conjugate projected gradient", "Renouf & Alart 2005", BIG),
}
# its solver of one contact, if that is not the default
ONE_CONTACT = {
    "nsgs-quartic": "FRICTION_3D_ONECONTACT_QUARTIC",
    "nsgs-projection": "FRICTION_3D_ONECONTACT_ProjectionOnConeWithLocalIteration",
}


def python() -> str:
    """The interpreter that has Siconos."""
    return os.environ.get(VARIABLE) or DEFAULT


@functools.cache
def _probe(interpreter: str) -> str:
    code = "import sys, importlib.util as u; sys.exit(u.find_spec('siconos') is None)"
    try:
        run = subprocess.run(
            [interpreter, "-c", code], capture_output=True, timeout=30, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"{interpreter}: {error}; {VARIABLE} names the interpreter that has siconos"
    if run.returncode != 0:
        return (
            f"{interpreter} has no siconos: apt install python3-siconos, "
            f"or name the interpreter that has it by {VARIABLE}"
        )
    return ""


def missing() -> str:
    """The package to install."""
    return _probe(python())


@functools.cache
def version() -> str:
    """As its interpreter says, with that interpreter; Debian's 4.4.0 calls itself 4.5.0."""
    code = "import siconos; print(siconos.version)"
    run = subprocess.run(
        [python(), "-c", code], capture_output=True, text=True, timeout=30, check=False
    )
    told = run.stdout.strip() if run.returncode == 0 else ""
    return f"{told} in {python()}".lstrip()


@functools.cache
def solvers() -> Sequence[_core.SolverInfo]:
    """The entries."""
    return (
        *(_entry(n, "fc3d", "FRICTION_3D", *row) for n, row in FC3D.items()),
        *(_entry(n, "fc2d", "FRICTION_2D", *row) for n, row in FC2D.items()),
        _entry(
            "rolling-nsgs",
            "rolling_fc3d",
            "ROLLING_FRICTION_3D",
            SPLIT,
            "NSGS",
            "Nonsmooth Gauss-Seidel with rolling friction",
            "Acary & Bourrier 2021",
            BIG,
        ),
    )


def _entry(
    name: str,
    kind: str,
    prefix: str,
    family: str,
    identifier: str,
    title: str,
    citation: str,
    iterations: int,
) -> _core.SolverInfo:
    def function(problem: Local, r: Any, monitor: _core.Monitor, *, calls: Calls = 1) -> Any:
        name = f"SICONOS_{prefix}_{identifier}"
        return _solve(kind, name, one_contact, calls, problem, r, monitor)

    one_contact = f"SICONOS_{ONE_CONTACT[name]}" if name in ONE_CONTACT else ""
    rolling = kind.startswith("rolling")
    return make_solver(
        function,
        name=PREFIX + name,
        family=family,
        title=title,
        citation=citation if citation == HUBER else f"{citation}; {HUBER}",
        origin="siconos",
        dimensions=() if rolling else (2 if kind == "fc2d" else 3,),
        rolling_dimensions=(5,) if rolling else (),
        max_iterations=iterations,
    )


def _solve(
    kind: str,
    identifier: str,
    one_contact: str,
    calls: int,
    problem: Local,
    r: Any,
    monitor: _core.Monitor,
) -> Any:
    """One solve, or two if the tolerances differ in meaning."""
    if monitor.stop(r) or problem.nc == 0:
        return r
    with tempfile.TemporaryDirectory(prefix="fclib-") as folder:
        path = Path(folder) / "problem.dat"
        _core.write_siconos(path, problem.with_storage(STORAGES[kind]))
        order = {
            "path": str(path),
            "kind": kind,
            "solver": identifier,
            "one_contact": one_contact,
            "max_iterations": min(monitor.max_iterations, 2**31 - 1),
            "tolerance": monitor.tolerance,
            "r": r.tolist(),
            "calls": calls,
        }
        reply = _worker.ask(order, monitor.time_left)
        if reply["info"] == 0 and monitor.error(reply["r"]) > monitor.tolerance:
            size = [float(np.linalg.norm(reply[name])) for name in ("r", "u")]
            matched = 0.99 * monitor.tolerance * monitor.scale / max(monitor.scale, *size)
            if np.isfinite(matched):
                reply = _worker.ask(order | {"tolerance": matched}, monitor.time_left)
    monitor.cpu_s = reply["cpu_s"]
    if reply["info"] is None:
        monitor.status = "time_limit"
        return r
    iterations = max(1, min(reply["iterations"], monitor.max_iterations))
    if not monitor.stop(reply["r"], iterations) and reply["info"] != 0:
        monitor.status = "iteration_limit" if iterations >= monitor.max_iterations else "stalled"
    return reply["r"]


def _cpu_time(pid: int) -> float:
    """CPU time [s] of a process; the number of its clock is computed as in Linux."""
    try:
        return time.clock_gettime((~pid << 3) | 2)
    except OSError:
        return 0.0


class Worker:
    """The process that runs Siconos; it is started when it is needed."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[bytes] | None = None
        self.started = ("", 0)  # the interpreter, and the process that started it
        self.lock = threading.Lock()

    def ask(self, order: dict[str, Any], time_left: float) -> dict[str, Any]:
        """The answer to an order; its info is None at the time limit, which ends the process.

        Raises:
            SolverError: Siconos raised or ended.
        """
        with self.lock:
            try:
                line = self._exchange(json.dumps(order).encode(), time_left)
            except BaseException:
                self.end()
                raise
        reply: dict[str, Any] = json.loads(line)
        if "failure" in reply:
            raise _registry.SolverError(f"siconos: {order['solver']}: {reply['failure']}")
        return reply

    def _exchange(self, order: bytes, time_left: float) -> bytes:
        process = self._running()
        assert process.stdin is not None
        start = _cpu_time(process.pid)
        with contextlib.suppress(BrokenPipeError):  # it has ended; reading finds out
            process.stdin.write(order + b"\n")
            process.stdin.flush()
        line = self._read_line(time_left)
        if line is None:
            cpu = _cpu_time(process.pid) - start
            self.end()
            return json.dumps({"info": None, "cpu_s": cpu}).encode()
        return line

    def _read_line(self, time_left: float) -> bytes | None:
        """A line of the process, or None if there is none in time."""
        assert self.process is not None
        assert self.process.stdout is not None
        end = time.monotonic() + time_left
        line = b""
        while not line.endswith(b"\n"):
            left = end - time.monotonic()
            if left <= 0:
                return None
            # wake up now and then, so that Ctrl-C is noticed
            if not select.select([self.process.stdout], [], [], min(left, 0.5))[0]:
                continue
            chunk = os.read(self.process.stdout.fileno(), 1 << 20)
            if not chunk:
                code = self.process.wait()
                name = f"signal {-code}" if code < 0 else f"exit status {code}"
                raise _registry.SolverError(f"siconos: its process ended with {name}")
            line += chunk
        return line

    def _running(self) -> subprocess.Popen[bytes]:
        """The process, started anew if it has ended or another is wanted."""
        wanted = (python(), os.getpid())  # a forked process needs one of its own
        if self.process is not None and (self.process.poll() is not None or self.started != wanted):
            self.end()
        if self.process is None:
            self.started = wanted
            self.process = subprocess.Popen(
                [wanted[0], str(Path(__file__).with_name("_siconos_worker.py"))],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env=os.environ | dict.fromkeys(THREADS, "1"),
                start_new_session=True,
            )
            if self._read_line(START_LIMIT) is None:
                raise _registry.SolverError(
                    f"siconos: {wanted[0]} does not start in {START_LIMIT} s"
                )
        return self.process

    def end(self) -> None:
        """Kill the process."""
        process, self.process = self.process, None
        if process is None or self.started[1] != os.getpid():
            return
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(BrokenPipeError):
                    pipe.close()


_worker = Worker()
atexit.register(_worker.end)
