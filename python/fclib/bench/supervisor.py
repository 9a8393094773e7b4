"""The supervisor of a worker: it sends jobs, watches, kills if needed, and judges answers.

`main` takes jobs from a socket until that is closed. The supervisor itself never runs a solver; a
worker does. One worker runs all built-in solvers. It is replaced after every failure, and if its
state has changed: a process or thread is left, or its signals, limits, cores or arithmetic differ.
Any other solver gets a new worker for each run. If the system allows it, that worker is apart
(template.py).

The supervisor reads the problem. Once the solver is loaded and warm, the worker gets the numbers.
The solution comes back as numbers, and the supervisor recomputes every merit from its own copy of
the problem. So nothing that a solver does in its process can change the verdict. The kernel counts
the time of a run while the worker has the problem (meter.py). The time that the solver reports must
fit into that count.

A run is killed with all its descendants, whatever their group or session: a process that loses its
parent becomes a child of the supervisor.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import resource
import select
import shutil
import signal
import socket
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from fclib import _core
from fclib._solve import MERITS
from fclib._words import counted
from fclib.bench import machine, processes
from fclib.bench.job import KEPT, ORDERLY, STATUSES, SURROUNDINGS, Record
from fclib.bench.meter import Meter
from fclib.bench.template import Template, TemplateGone
from fclib.bench.worker import (
    CERTIFICATE,
    GO,
    HISTORY,
    VECTORS,
    Problems,
    adapted,
    built_in,
    foreign,
    handed,
    of_signal,
    one_line,
    send,
    serve,
)
from fclib.external import command

READY_LIMIT = 600.0  # [s] limit for loading the solver, taking the problem, or sending the solution
LOAD_LIMIT = 60.0  # [s] CPU time limit for loading a solver; PyTorch takes 5
WARM_LIMIT = 5.0  # [s] limit for the first call of a solver
PAUSES = (0.005, 0.05)  # [s] the first and the longest pause between two looks at a run
GRACE = 0.5  # [s] extra time in which a solver that keeps the limit itself may return
LIMIT_CPU_AFTER = 1.0  # [s] CPU time after which the kernel enforces the limit too: Watch.limit_cpu
LONGEST = 1 << 26  # [bytes] largest message that is not an array
# [bytes] a run may write so much into one file, or as much as its memory if that is more
OUTPUT = 1e9
# the time that a solver reports may differ from the kernel's count by so much
SLACK, SHARE = 0.02, 0.02  # [s], [1]
# receiving a problem may cost so many times the cost of sending it, beyond SLACK: both copy the
# arrays, and the pages of the new process are fresh
TAKING = 5.0
ROOM = 1 << 20  # [bytes] a disk with less free space counts as full
# [1] if a thread's clock misses more than this share of the CPU time, the kernel's count is used
UNSEEN = 0.1


# parts of an order that the worker gets before the problem
TOLD = (
    *("solver", "options", "modules", "tol", "merit", "limits", "history"),
    *("kind", "spacedim", "warm", "nonce"),
)
# statuses that a worker may report; it is not believed if it blames something outside
REPORTABLE = frozenset(STATUSES) - {*SURROUNDINGS, "lied"} | {"no_space", "killed"}


def carry(known: dict[str, Any], before: Any, problem: Any) -> _core.Solution | None:
    """The guess of an order, from the solution of an earlier problem, contact by contact."""
    from fclib.collections.references import guess_of  # few runs need it

    multipliers = None if known["l"] is None else np.array(known["l"], float)
    return guess_of(before, _core.Solution(r=np.array(known["r"], float), l=multipliers), problem)


def copied(problem: Any, number: int) -> Any:
    """A renumbered copy of a problem."""
    from fclib.bench.copies import Copy  # few runs need it

    return Copy(problem, number)


class CampaignGone(Exception):  # noqa: N818 (no error)
    """The campaign has ended."""


class WorkerEnded(Exception):  # noqa: N818 (no error of ours)
    """The worker has ended: by itself, or because it exceeded a limit."""

    def __init__(self, status: str, message: str) -> None:
        super().__init__(message)
        self.status = status


class Watch:
    """The limits of a worker from now on, and its use so far."""

    def __init__(
        self,
        meter: Meter,
        wall: float = READY_LIMIT,
        cpu: float = math.inf,
        memory: float = math.inf,
    ) -> None:
        self.meter = meter
        self.limits = wall, cpu, memory
        self.measured = min(cpu, memory) < math.inf
        self.cpu, self.memory = 0.0, 0.0
        if self.measured:
            processes.forget_peak(meter.pid)
            self.memory_before = self.memory = meter.memory()
            self.resident_before = processes.resident(meter.pid)
            self.own_before = processes.cpu_clock(meter.pid)
            self.cpu_before = meter.cpu()
        self.own = 0.0  # [s] CPU time of the worker alone
        self.cpu_limited = False
        self.start = time.monotonic()
        self.end: float | None = None

    @property
    def wall(self) -> float:
        """Seconds since the start."""
        return (self.end or time.monotonic()) - self.start

    def check(self) -> None:
        """Check the worker and all processes that it started.

        Raises:
            WorkerEnded: it has exceeded a limit.
        """
        most_wall, most_cpu, most_memory = self.limits
        if self.measured:
            self.cpu = max(self.cpu, self.meter.cpu() - self.cpu_before)
            self.memory = max(self.memory, self.meter.memory())
            if self.cpu > LIMIT_CPU_AFTER and not self.cpu_limited and math.isfinite(most_cpu):
                self.limit_cpu(math.ceil(most_cpu - self.cpu + GRACE) + 1)
            if self.memory - self.memory_before > most_memory:
                raise WorkerEnded("memory", f"killed above {most_memory:g} MB")
            if self.cpu > most_cpu + GRACE:
                raise WorkerEnded("cpu_limit", f"killed after {self.cpu:.1f} s of CPU time")
        if self.wall > most_wall + GRACE:
            raise WorkerEnded("wall_limit", f"killed after {self.wall:.1f} s")

    def stop(self) -> None:
        """Note that the worker says it is done, and waits."""
        self.end = time.monotonic()
        self.cpu = max(self.cpu, self.meter.cpu() - self.cpu_before)
        self.own = processes.cpu_clock(self.meter.pid) - self.own_before
        # the growth of the worker itself between two looks
        grown = processes.peak_memory(self.meter.pid) - self.resident_before
        self.memory = max(self.memory, self.meter.memory(), self.memory_before + grown)

    def limit_cpu(self, seconds: int) -> None:
        """Set RLIMIT_CPU of each process, in case this one is held up.

        This happens only once a run has become long, and not if its worker serves others. A process
        with such a limit has its CPU time counted in ticks of some milliseconds, even after the
        limit is lifted (Linux). Solvers that measure short solves by that count would read 0.
        """
        self.cpu_limited = True
        for pid in self.meter.members():
            used = math.ceil(processes.cpu_clock(pid))
            processes.lower(pid, resource.RLIMIT_CPU, used + max(1, seconds))


@dataclass
class Worker:
    """The supervisor's end of a worker."""

    link: socket.socket
    meter: Meter
    stderr: int  # its standard error
    apart: bool  # whether it is in a namespace of its own
    belongings: tuple[Any, ...]  # its state at first
    tail: bytes = b""  # end of its standard error
    cpu_limited: bool = False  # whether it has a CPU time limit
    unchanged: bool = False  # whether it says that its state is unchanged


class Supervisor:
    """A worker, and the problems that judge its answers."""

    def __init__(self, campaign: Connection, lifeline: int, folder: str, mark: str) -> None:
        self.campaign = campaign
        self.folder = folder  # for the temporary files of the workers
        own_end = socket.socket(fileno=os.dup(campaign.fileno()))
        self.template = Template(own_end, lifeline, mark, serve)
        own_end.close()
        self.ours = {self.template.pid}  # children that are not part of a run
        self.problems = Problems()
        self.cores: set[int] = set()  # cores that the worker has for itself
        self.worker: Worker | None = None  # the worker of the run
        # the worker of the built-in solvers, while another one runs
        self.kept: Worker | None = None

    def start(self, solver: str) -> Worker:
        """The worker for a solver: the one that serves the built-in ones, or a new one."""
        own = solver in built_in()
        if own and self.kept is not None:
            self.worker, self.kept = self.kept, None
            self.ours.discard(self.worker.meter.pid)
            if self.as_it_was():
                return self.worker
            self.stop()
        ours, theirs = socket.socketpair()
        reading, writing = os.pipe()
        meter = Meter(not own, self.ours)
        request = {
            "apart": not own,
            "group": str(meter.group or ""),
            "cores": sorted(self.cores),
            "folder": self.folder,
        }
        with theirs:
            pid, apart = self.template.fork(request, theirs.fileno(), writing)
        os.close(writing)
        meter.watch(pid)
        self.worker = Worker(ours, meter, reading, apart, ())
        return self.worker

    def stop(self) -> int | None:
        """Kill the worker and all that it started. Return its exit status, if it has one."""
        if self.worker is None:
            return None
        worker, self.worker = self.worker, None
        status = worker.meter.kill()
        while select.select([worker.stderr], [], [], 0)[0] and self.listen(worker):
            pass
        worker.link.close()
        os.close(worker.stderr)
        self.clear()
        return status

    def end(self) -> None:
        """Kill all workers, and dismiss the template."""
        self.stop()
        if self.kept is not None:
            self.ours.discard(self.kept.meter.pid)
            self.worker, self.kept = self.kept, None
            self.stop()
        self.template.end()

    def clear(self) -> None:
        """Remove the temporary files of a run."""
        with contextlib.suppress(OSError):
            for path in Path(self.folder).iterdir():
                if path.is_dir() and not path.is_symlink():
                    shutil.rmtree(path, ignore_errors=True)
                else:
                    path.unlink(missing_ok=True)

    def as_it_was(self) -> bool:
        """Whether the worker is alive, alone, and in its first state."""
        worker = self.worker
        if worker is None or worker.cpu_limited or not worker.unchanged:
            return False
        if select.select([worker.link], [], [], 0)[0]:
            return False
        pid = worker.meter.pid
        return worker.meter.members() == [pid] and processes.belongings(pid) == worker.belongings

    def clean(self, order: dict[str, Any]) -> bool:
        """Whether nothing of a run is left in the worker, so that it may serve another."""
        if self.worker is None or order["solver"] not in built_in():
            return False  # foreign code ran in the process, and may have changed anything
        if processes.threads(self.worker.meter.pid) > 1 and order["threads"] == 1:
            return False
        return self.as_it_was()

    def listen(self, worker: Worker) -> bool:
        """Read the worker's standard error, and keep its end; False once it is closed."""
        text = os.read(worker.stderr, 1 << 16)
        worker.tail = (worker.tail + text)[-2000:]
        return bool(text)

    def receive(self, order: dict[str, Any], watch: Watch, longest: int = LONGEST) -> bytes:
        """The next message of the worker, which is watched meanwhile.

        Raises:
            WorkerEnded: there will be none.
            CampaignGone: the campaign is over.
        """
        assert self.worker is not None
        worker, link, pause = self.worker, self.worker.link, PAUSES[0]
        sources: list[Any] = [link, self.campaign, worker.stderr]
        got, size = bytearray(), 8
        whole = False  # whether the message's length has been read
        while True:
            ready = select.select(sources, [], [], pause)[0]
            if self.campaign in ready:  # nothing is sent while a job is being done
                raise CampaignGone
            if worker.stderr in ready and not self.listen(worker):
                sources.remove(worker.stderr)
            if link in ready:
                try:
                    part = link.recv(min(size - len(got), 1 << 22))
                except OSError:
                    part = b""
                if not part:
                    raise self.ended(order["solver"])
                got += part
                if len(got) == size and not whole:
                    size, whole = int.from_bytes(got, "little"), True
                    got.clear()
                    if size > longest:
                        raise WorkerEnded("garbage", "the worker sent no answer")
                if len(got) == size and whole:
                    return bytes(got)
            if link not in ready or not whole:
                watch.check()
                pause = min(1.5 * pause, PAUSES[1])

    def reply(self, order: dict[str, Any], watch: Watch) -> dict[str, Any]:
        """The next message of the worker about this order.

        Raises:
            WorkerEnded: there will be none, or it is about another order.
        """
        try:
            reply = json.loads(self.receive(order, watch))
            if reply.pop("nonce") == order["nonce"]:
                return dict(reply)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            pass
        raise WorkerEnded("garbage", "the worker sent what is no answer to its order")

    def ended(self, solver: str) -> WorkerEnded:
        """Why a worker that has closed its link has ended."""
        assert self.worker is not None
        worker, pid = self.worker, self.worker.meter.pid
        end = time.monotonic() + 1.0
        leave = os.WEXITED | os.WNOHANG | os.WNOWAIT
        while os.waitid(os.P_PID, pid, leave) is None:
            if time.monotonic() > end:
                return WorkerEnded("garbage", "the worker closed its link, and went on")
            time.sleep(1e-3)
        limited = processes.has_hard_limit(pid, resource.RLIMIT_CPU)
        how = self.stop()
        assert how is not None
        lines = worker.tail.decode(errors="replace").strip().splitlines()
        last = f": {lines[-1][:300]}" if lines else ""
        if not os.WIFSIGNALED(how):
            if worker.apart and os.WEXITSTATUS(how) == signal.SIGABRT:
                return WorkerEnded("crashed", f"ended by SIGABRT{last}")
            return WorkerEnded("error", f"exit status {os.WEXITSTATUS(how)}{last}")
        number = os.WTERMSIG(how)
        name = signal.Signals(number).name
        outside = True
        if foreign(solver):
            # such a signal can only come from outside its namespace, and no other can come
            outside = worker.apart and number == signal.SIGKILL and not limited
            if number == signal.SIGKILL and not outside:
                last = f", and the kernel does not say who sent it{last}"
        return WorkerEnded(of_signal(number, outside), f"ended by {name}{last}")

    def do(self, order: dict[str, Any]) -> Record:
        """Do a job, and return its record."""
        record = Record(
            "error",
            started=time.time(),
            load=os.getloadavg()[0],
            frequency=machine.frequency(),
            machine=machine.facts(),
            pinned=bool(self.cores),
        )
        if not order["suits"]:
            record.status, record.message = "unsuitable", "does not take problems of this kind"
            return record
        try:
            problem, guess = self.prepare(order)
            copy = copied(problem, order["copy"]) if order["copy"] else None
        except (_core.Error, OSError, MemoryError) as error:
            record.status, record.message = "unreadable", one_line(error)
            return record
        vectors: dict[str, Any] = {}
        try:
            if copy is None:
                vectors = self.ask(order | {"warm": True}, problem, guess, record)
            else:
                vectors = copy.back(self.ask(order | {"warm": True}, copy.problem, None, record))
        except WorkerEnded as end:
            record.status, record.message = end.status, str(end)
            self.stop()
        except OSError as error:  # no process, no room, no file
            self.stop()
            record.status, record.message = "lost", one_line(error)
        if vectors:
            self.judge(order, problem, record, vectors)
        if order["keep"] and record.status == "converged":
            known = {name: vectors[name] for name in KEPT if name in vectors}
            record.solution = {name: value.tobytes() for name, value in known.items()}
        if record.status == "no_space" and self.has_room():
            record.status = "error"
            record.message += "; there is room on the disk"
        if record.status in ORDERLY and self.clean(order):
            assert self.worker is not None
            self.clear()
            self.ours.add(self.worker.meter.pid)
            self.worker, self.kept = None, self.worker
        else:
            self.stop()
        return record

    def has_room(self) -> bool:
        """Whether there is room for the temporary files of workers."""
        disk = os.statvfs(self.folder)
        return disk.f_bavail * disk.f_frsize > ROOM and disk.f_favail > 0

    def prepare(self, order: dict[str, Any]) -> tuple[Any, Any]:
        """The problem of an order, and the guess of its start.

        Raises:
            fclib.Error: it cannot be read, or has changed.
        """
        guess = None
        if known := order["guess"]:
            guess = carry(known, self.problems.get(known), self.problems.get(order))
        return self.problems.get(order), guess

    def ask(
        self, order: dict[str, Any], problem: Any, guess: Any, record: Record
    ) -> dict[str, Any]:
        """Have the worker do a job; its messages go into the record, its solution is returned.

        Raises:
            WorkerEnded: it has ended, or had to be ended; the known facts are in the record.
        """
        worker = self.start(order["solver"])
        meter = worker.meter
        record.measured = meter.how
        record.guessed = guess is not None
        worker.tail = b""
        order["nonce"] = os.urandom(8).hex()
        limits = order["limits"]
        self.tell(order, json.dumps({name: order[name] for name in TOLD}).encode())
        reply = self.reply(order, Watch(meter, cpu=LOAD_LIMIT))
        if reply.get("word") == "warming":
            wall, cpu = (min(WARM_LIMIT, limits[name]) for name in ("wall", "time"))
            try:
                reply = self.reply(order, Watch(meter, wall, cpu, limits["memory"]))
            except WorkerEnded:
                # the solver may do better on the real problem
                self.stop()
                return self.ask(order | {"warm": False}, problem, guess, record)
        if reply.get("word") != "ready":
            return self.arrays(order, accept_answer(reply, record))
        if not worker.belongings and order["solver"] in built_in():
            worker.belongings = processes.belongings(meter.pid)
        took, early = self.hand(order, problem, guess)
        self.limit(meter, limits["memory"])
        watch = Watch(meter, limits["wall"], limits["time"] - early, limits["memory"])
        try:
            self.tell(order, GO)
            word = self.reply(order, watch)
            watch.stop()
            if word != {"word": "done"}:
                raise WorkerEnded("garbage", "the worker sent what is no answer to its order")
        finally:
            record.wall_s, record.total_cpu_s = watch.wall, watch.cpu + early
            record.memory = watch.memory - watch.memory_before
            worker.cpu_limited = watch.cpu_limited
        self.limit(meter, math.inf)
        after = Watch(meter, cpu=limits["time"])
        self.tell(order, GO)
        reply = self.reply(order, after)
        worker.unchanged = reply.get("unchanged") is True
        names = accept_answer(reply, record)
        vectors = self.arrays(order, names)
        after.stop()
        # a worker that says "done" too early gains nothing
        outside = early + max(0.0, after.cpu - SLACK - TAKING * took)
        record.total_cpu_s = watch.cpu + outside
        check_times(order["solver"], record, reply.get("reported") is True, watch, outside)
        return vectors

    def hand(self, order: dict[str, Any], problem: Any, guess: Any) -> tuple[float, float]:
        """Send the problem to the worker.

        Returns:
            CPU times [s]: of this process for sending, and of the worker meanwhile for other work.
        """
        assert self.worker is not None
        meter = self.worker.meter
        before = time.thread_time()
        message = handed(problem, guess)
        took = time.thread_time() - before
        watch = Watch(meter, cpu=order["limits"]["time"])
        self.tell(order, message)
        del message
        word = self.reply(order, watch)
        watch.stop()
        if word != {"word": "taken"}:
            raise WorkerEnded("garbage", "the worker sent what is no answer to its order")
        return took, max(0.0, watch.cpu - SLACK - TAKING * took)

    def tell(self, order: dict[str, Any], message: bytes) -> None:
        """Send a message to the worker.

        Raises:
            WorkerEnded: it has ended.
        """
        assert self.worker is not None
        try:
            send(self.worker.link, message)
        except OSError:
            raise self.ended(order["solver"]) from None

    def arrays(self, order: dict[str, Any], names: list[str]) -> dict[str, Any]:
        """The arrays that follow an answer."""
        assert self.worker is not None
        meter, memory = self.worker.meter, order["limits"]["memory"]
        room = int(max(memory, 100.0) * 1e6) if memory < 1e9 else 1 << 40
        return {name: numbers(self.receive(order, Watch(meter), room)) for name in names}

    @staticmethod
    def limit(meter: Meter, memory: float) -> None:
        """Limit the address space by the kernel, to twice the memory at which a run is killed.

        The limit is set on the worker and on processes that earlier runs left, for example the
        interpreter of another package's solver. Processes that it starts later inherit the limit.
        """
        most = memory < 1e12
        for pid in meter.members():
            size = processes.address_space(pid) + int(2 * memory * 1e6) if most else -1
            processes.lower(pid, resource.RLIMIT_AS, size)
            output = int(max(memory * 1e6, OUTPUT)) if most else -1
            processes.lower(pid, resource.RLIMIT_FSIZE, output)

    def judge(
        self, order: dict[str, Any], problem: Any, record: Record, vectors: dict[str, Any]
    ) -> None:
        """Recompute every merit; they decide the status."""
        proof = [vectors.pop(name, None) for name in CERTIFICATE]
        if record.status in ("lied", "garbage"):
            return
        try:
            merit = _core.merit(problem, _core.Solution(**vectors))
        except (_core.Error, TypeError, ValueError) as error:
            record.status, record.message = "garbage", one_line(error)
            return
        record.merits = {name: float(getattr(merit, name)) for name in MERITS}
        if record.status == "infeasible":
            prove(problem, record, *proof)
        if not record.solved:
            return
        limits = order["limits"]
        if record.status == "converged" and not merit.error_by(order["merit"]) <= order["tol"]:
            record.status = "inaccurate"
        elif (record.cpu_s or 0.0) > limits["time"] or (record.wall_s or 0.0) > limits["wall"]:
            record.status, record.message = "time_limit", "solved, but too late"


def numbers(message: bytes) -> Any:
    """The array of a message.

    Raises:
        WorkerEnded: it is not such an array.
    """
    if len(message) % 8:
        raise WorkerEnded("garbage", "the worker sent what is no array")
    return np.frombuffer(message)


def accept_answer(reply: dict[str, Any], record: Record) -> list[str]:
    """Check a worker's answer and put it into the record. Return the names of arrays that follow.

    Raises:
        WorkerEnded: the answer is not possible.
    """
    number = (int, float)
    try:
        status, names = reply["status"], reply.get("vectors", [])
        message = str(reply["message"]).encode(errors="replace").decode()[:500]
        iterations, stages = reply.get("iterations"), reply.get("stages")
        times = [reply.get(name) for name in ("cpu_s", "setup_s")]
        history = reply.get("history")
        right = (
            status in REPORTABLE
            and set(names) <= {*VECTORS, *CERTIFICATE}
            and len(set(names)) == len(names)
            and (iterations is None or type(iterations) is int)
            and all(time is None or isinstance(time, number) for time in times)
            and (stages is None or isinstance(stages, str))
            and (history is None or len(history) <= HISTORY + 2)
        )
        if history is not None:
            record.history = [
                (int(k), float(error), float(time), str(stage)) for k, error, time, stage in history
            ]
    except (KeyError, TypeError, ValueError, OverflowError):
        right = False
    if not right:
        raise WorkerEnded("garbage", "the worker sent what is no answer")
    record.status, record.message, record.stages = status, message, stages
    record.warm = reply.get("warm") is True
    record.iterations = iterations
    record.cpu_s, record.setup_s = (None if t is None else float(t) for t in times)
    return list(names)


def check_times(solver: str, record: Record, reported: bool, watch: Watch, outside: float) -> None:
    """Compare the time and iterations that a solver reports with the kernel's count.

    A time above the kernel's count, or a negative one, is a lie. The driver's clock measures the
    thread that calls the solver. If the kernel has counted clearly more, in other threads or
    processes, the kernel's count is used. A program that reports the time of its solve, and an
    adapter of another package, may leave out their start.

    Args:
        solver: its name.
        record: receives the time that counts.
        reported: whether a program has reported the time of its solve.
        watch: the watch of the run.
        outside: CPU time [s] of the worker while it had the problem, but not between its messages
            `go` and `done`; it counts too.
    """
    claimed, setup, seen = record.cpu_s, record.setup_s or 0.0, watch.cpu + outside
    record.said_cpu_s = claimed
    if claimed is None:
        return
    most = seen + SLACK + SHARE * seen
    whole = 0 <= (record.iterations or 0) < 1 << 62
    if not (0 <= claimed <= most and 0 <= setup + claimed <= most + SLACK and whole):
        record.status = "lied"
        record.message = (
            f"says that it took {claimed:g} s and {record.iterations} iterations;"
            f" the kernel saw {seen:.3g} s of CPU time"
        )
        record.iterations = record.iterations if whole else None
        record.cpu_s = seen
        return
    if reported:
        return
    if solver.startswith(command.PREFIX):
        own = seen - watch.own
    elif adapted(solver):
        return
    else:
        own = seen - setup
    if own - claimed > SLACK + UNSEEN * seen:
        record.cpu_s = own


def prove(problem: Any, record: Record, y: Any, z: Any) -> None:
    """Check the proof that there is no solution, and keep it."""
    from fclib import analysis  # few runs need it

    try:
        if y is None:
            raise analysis.CertificateError("there is no certificate")
        proof = analysis.check_arrays(problem, y, z)
    except analysis.CertificateError as error:
        record.status = "inaccurate"
        record.message = f"said that there is no solution, and proved nothing: {one_line(error)}"
        return
    record.certificate = json.dumps(proof.record(problem))
    record.message = f"proven, on {proof.contacts} of {counted(problem.nc, 'contact')}"
    if not proof.exact:
        record.message += f", for reactions up to {proof.bound:.1e}"


def main(link: int, lifeline: int, folder: str, mark: str, cores: int) -> None:
    """Do the jobs of the campaign at the other end of a socket.

    Args:
        link: this end of the socket.
        lifeline: the end of a pipe; only the campaign has its other end.
        folder: for temporary files of the worker.
        mark: a text in the environment of this process.
        cores: number of cores that the worker gets for itself, if they are free.
    """
    campaign = Connection(link)
    processes.adopt_orphans()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    supervisor = Supervisor(campaign, lifeline, folder, mark)
    os.close(lifeline)
    supervisor.cores, held = machine.reserve(cores)
    try:
        while True:
            order = campaign.recv()
            campaign.send(supervisor.do(order))
    except (EOFError, OSError, CampaignGone, TemplateGone):
        pass  # a campaign that still exists starts another supervisor
    finally:
        supervisor.end()
        for lock in held:
            os.close(lock)
