"""The process over a worker: it hands it a job, watches it, kills it, and judges its answer.

`main` serves jobs from a socket until that is closed. The supervisor never runs a solver: that is
done by a worker. One worker serves the built-in solvers. It is renewed after every failure, and if
it is not as it was: a process or a thread is left, or its signals, limits, cores or arithmetic
have changed. Each run of any other solver has a worker of its own, which is apart if the system
allows it (template.py). The supervisor reads the problem, and hands its numbers over once the
solver is loaded and warm. The solution comes back as numbers, and the supervisor recomputes every
merit from its own copy of the problem, so that nothing a solver does in its process changes the
verdict. What a run took is what the kernel counted while the worker had the problem (meter.py);
what the solver says of its time must fit in there.

A run is killed with all processes that descend from it, in whatever group or session they are: what
loses its parent becomes a child of the supervisor.
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

READY_LIMIT = 600.0  # [s] to load the solver, to take the problem, or to send the solution
LOAD_LIMIT = 60.0  # [s] of CPU to load a solver, at most; PyTorch takes 5
WARM_LIMIT = 5.0  # [s] for the first call of a solver, at most
PAUSES = (0.005, 0.05)  # [s] the first and the longest pause between two looks at a run
GRACE = 0.5  # [s] beyond the limit, for a solver that keeps it itself to return
LIMIT_CPU_AFTER = 1.0  # [s] of CPU after which the kernel has the limit too: Watch.limit_cpu
LONGEST = 1 << 26  # [bytes] of a message that is no array
OUTPUT = 1e9  # [bytes] that a run may write into one file, where its memory is not more
# what a solver says of its time may differ from what the kernel says by so much
SLACK, SHARE = 0.02, 0.02  # [s], [1]
# taking a problem over may cost so many times what handing it over does, beyond SLACK: both copy
# its arrays, and the pages of the new process are fresh
TAKING = 5.0
ROOM = 1 << 20  # [bytes] free on a disk that is not full
UNSEEN = 0.1  # [1] of the CPU time that a thread's clock may miss before the kernel's counts


# of an order, what the worker is told before it gets the problem
TOLD = (
    *("solver", "options", "modules", "tol", "merit", "limits", "history"),
    *("kind", "spacedim", "warm", "nonce"),
)
# what a worker may say: that it was kept from its work by something outside, nobody believes it
SAID = frozenset(STATUSES) - {*SURROUNDINGS, "lied"} | {"no_space", "killed"}


def carry(known: dict[str, Any], before: Any, problem: Any) -> _core.Solution | None:
    """The guess of an order: what is known of a problem before, contact by contact."""
    from fclib.collections.guesses import guess_of  # which few runs need

    multipliers = None if known["l"] is None else np.array(known["l"], float)
    return guess_of(before, _core.Solution(r=np.array(known["r"], float), l=multipliers), problem)


def copied(problem: Any, number: int) -> Any:
    """A renumbered copy of a problem."""
    from fclib.bench.copies import Copy  # which few runs need

    return Copy(problem, number)


class CampaignGone(Exception):  # noqa: N818 (no error)
    """The campaign has ended."""


class WorkerEnded(Exception):  # noqa: N818 (no error of ours)
    """The worker has: on its own, or because it overran."""

    def __init__(self, status: str, message: str) -> None:
        super().__init__(message)
        self.status = status


class Watch:
    """What a worker may take from now on, and what it takes."""

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
        self.own = 0.0  # [s] of CPU of the worker alone
        self.cpu_limited = False
        self.start = time.monotonic()
        self.end: float | None = None

    @property
    def wall(self) -> float:
        """[s] since the start."""
        return (self.end or time.monotonic()) - self.start

    def check(self) -> None:
        """Look at the worker and what it has started.

        Raises:
            WorkerEnded: it has overrun.
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
        """The worker says that it is done, and waits."""
        self.end = time.monotonic()
        self.cpu = max(self.cpu, self.meter.cpu() - self.cpu_before)
        self.own = processes.cpu_clock(self.meter.pid) - self.own_before
        # between two looks: what the worker itself has grown by
        grown = processes.peak_memory(self.meter.pid) - self.resident_before
        self.memory = max(self.memory, self.meter.memory(), self.memory_before + grown)

    def limit_cpu(self, seconds: int) -> None:
        """Set RLIMIT_CPU of each process, for the case that this one is held up.

        Not before a run has become a long one, and its worker does not serve another: where there
        is such a limit, Linux counts the CPU time of a process in ticks of some milliseconds, even
        after it is lifted, and those who measure short solves by it would read 0.
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
    belongings: tuple[Any, ...]  # what it had at first
    tail: bytes = b""  # of what it has said on its standard error
    cpu_limited: bool = False  # whether it has a limit of CPU time
    unchanged: bool = False  # whether it says that it is as it was


class Supervisor:
    """A worker, and the problems that its answers are judged by."""

    def __init__(self, campaign: Connection, alive: int, folder: str, mark: str) -> None:
        self.campaign = campaign
        self.folder = folder  # for the temporary files of the workers
        own_end = socket.socket(fileno=os.dup(campaign.fileno()))
        self.template = Template(own_end, alive, mark, serve)
        own_end.close()
        self.ours = {self.template.pid}  # children that are no part of a run
        self.problems = Problems()
        self.cores: set[int] = set()  # that the worker has for itself
        self.worker: Worker | None = None  # that does the run
        self.kept: Worker | None = None  # that serves the built-in solvers, while another one runs

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
        """Kill the worker and all that it has started; its exit status where it has one."""
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
        """Kill all workers, and let the template go."""
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
        """Whether the worker is there, alone, and has what it had at first."""
        worker = self.worker
        if worker is None or worker.cpu_limited or not worker.unchanged:
            return False
        if select.select([worker.link], [], [], 0)[0]:
            return False
        pid = worker.meter.pid
        return worker.meter.members() == [pid] and processes.belongings(pid) == worker.belongings

    def clean(self, order: dict[str, Any]) -> bool:
        """Whether nothing of a run is left in the worker, which may serve another."""
        if self.worker is None or order["solver"] not in built_in():
            return False  # code of others was in the process: who knows what it has changed
        if processes.threads(self.worker.meter.pid) > 1 and order["threads"] == 1:
            return False
        return self.as_it_was()

    def listen(self, worker: Worker) -> bool:
        """Take what a worker says on its standard error, whose end is kept; False at the last."""
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
        whole = False  # whether the length has been read
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

    def said(self, order: dict[str, Any], watch: Watch) -> dict[str, Any]:
        """The next word of the worker on this order.

        Raises:
            WorkerEnded: there will be none, or it is on no order of ours.
        """
        try:
            said = json.loads(self.receive(order, watch))
            if said.pop("nonce") == order["nonce"]:
                return dict(said)
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
            return WorkerEnded("error", f"exit status {os.WEXITSTATUS(how)}{last}")
        number = os.WTERMSIG(how)
        name = signal.Signals(number).name
        outside = True
        if foreign(solver):
            # in its namespace nobody but those outside can send this one, and nobody any other
            outside = worker.apart and number == signal.SIGKILL and not limited
            if number == signal.SIGKILL and not outside:
                last = f", and the kernel does not say who sent it{last}"
        return WorkerEnded(of_signal(number, outside), f"ended by {name}{last}")

    def do(self, order: dict[str, Any]) -> Record:
        """Do a job."""
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
        """The problem of an order, and the guess that it starts from.

        Raises:
            fclib.Error: it cannot be read, or is another one than it was.
        """
        guess = None
        if known := order["guess"]:
            guess = carry(known, self.problems.get(known), self.problems.get(order))
        return self.problems.get(order), guess

    def ask(
        self, order: dict[str, Any], problem: Any, guess: Any, record: Record
    ) -> dict[str, Any]:
        """Have the worker do a job: what it says goes into the record, its solution is returned.

        Raises:
            WorkerEnded: it has ended, or was to be ended; what is known of it is in the record.
        """
        worker = self.start(order["solver"])
        meter = worker.meter
        record.measured = meter.how
        record.guessed = guess is not None
        worker.tail = b""
        order["nonce"] = os.urandom(8).hex()
        limits = order["limits"]
        self.tell(order, json.dumps({name: order[name] for name in TOLD}).encode())
        said = self.said(order, Watch(meter, cpu=LOAD_LIMIT))
        if said.get("word") == "warming":
            wall, cpu = (min(WARM_LIMIT, limits[name]) for name in ("wall", "time"))
            try:
                said = self.said(order, Watch(meter, wall, cpu, limits["memory"]))
            except WorkerEnded:
                # the solver may do better on the problem that it is asked for
                self.stop()
                return self.ask(order | {"warm": False}, problem, guess, record)
        if said.get("word") != "ready":
            return self.arrays(order, take(said, record))
        if not worker.belongings and order["solver"] in built_in():
            worker.belongings = processes.belongings(meter.pid)
        took, early = self.hand(order, problem, guess)
        self.limit(meter, limits["memory"])
        watch = Watch(meter, limits["wall"], limits["time"] - early, limits["memory"])
        try:
            self.tell(order, GO)
            word = self.said(order, watch)
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
        said = self.said(order, after)
        worker.unchanged = said.get("unchanged") is True
        names = take(said, record)
        vectors = self.arrays(order, names)
        after.stop()
        # one that says too early that it is done gains nothing
        outside = early + max(0.0, after.cpu - SLACK - TAKING * took)
        record.total_cpu_s = watch.cpu + outside
        check_times(order["solver"], record, said.get("reported") is True, watch, outside)
        return vectors

    def hand(self, order: dict[str, Any], problem: Any, guess: Any) -> tuple[float, float]:
        """Hand the problem over.

        Returns:
            [s] of CPU that this took here, and that the worker took meanwhile for something else.
        """
        assert self.worker is not None
        meter = self.worker.meter
        before = time.thread_time()
        message = handed(problem, guess)
        took = time.thread_time() - before
        watch = Watch(meter, cpu=order["limits"]["time"])
        self.tell(order, message)
        del message
        word = self.said(order, watch)
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
        """A limit of the kernel on the address space, at twice the memory that a run is killed at.

        It is that of the worker and of what it has left from earlier runs, as the interpreter of
        another package's solver; what it starts later inherits it.
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
        """Recompute every merit, and let it decide."""
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
        WorkerEnded: it is none.
    """
    if len(message) % 8:
        raise WorkerEnded("garbage", "the worker sent what is no array")
    return np.frombuffer(message)


def take(said: dict[str, Any], record: Record) -> list[str]:
    """Put what a worker says into the record, where it can be so; the names of arrays that follow.

    Raises:
        WorkerEnded: it cannot.
    """
    number = (int, float)
    try:
        status, names = said["status"], said.get("vectors", [])
        message = str(said["message"]).encode(errors="replace").decode()[:500]
        iterations, stages = said.get("iterations"), said.get("stages")
        times = [said.get(name) for name in ("cpu_s", "setup_s")]
        history = said.get("history")
        right = (
            status in SAID
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
    record.warm = said.get("warm") is True
    record.iterations = iterations
    record.cpu_s, record.setup_s = (None if t is None else float(t) for t in times)
    return list(names)


def check_times(solver: str, record: Record, reported: bool, watch: Watch, outside: float) -> None:
    """Hold what a solver says of its time and iterations against what the kernel has seen.

    More than that, or less than nothing, is a lie. The clock of the driver is that of the thread
    that calls the solver: where the kernel has seen clearly more, in other threads or processes, it
    is that which counts. A program that says itself what its solve took, and an adapter of another
    package, may leave out their start.

    Args:
        solver: its name.
        record: gets the time that counts.
        reported: whether a program has said itself what its solve took.
        watch: of the run.
        outside: [s] of CPU that the worker took with the problem in its hands, but not between
            `go` and `done`; it counts too.
    """
    said, setup, seen = record.cpu_s, record.setup_s or 0.0, watch.cpu + outside
    record.said_cpu_s = said
    if said is None:
        return
    most = seen + SLACK + SHARE * seen
    whole = 0 <= (record.iterations or 0) < 1 << 62
    if not (0 <= said <= most and 0 <= setup + said <= most + SLACK and whole):
        record.status = "lied"
        record.message = (
            f"says that it took {said:g} s and {record.iterations} iterations;"
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
    if own - said > SLACK + UNSEEN * seen:
        record.cpu_s = own


def prove(problem: Any, record: Record, y: Any, z: Any) -> None:
    """Check the proof that there is no solution, and keep it."""
    from fclib import analysis  # which few runs need

    try:
        if y is None:
            raise analysis.CertificateError("there is no certificate")
        proof = analysis.check_arrays(problem, y, z)
    except analysis.CertificateError as error:
        record.status = "inaccurate"
        record.message = f"said that there is no solution, and proved nothing: {one_line(error)}"
        return
    record.certificate = json.dumps(proof.record(problem))
    record.message = f"proven, on {proof.contacts} of {problem.nc} contacts"
    if not proof.exact:
        record.message += f", for reactions up to {proof.bound:.1e}"


def main(link: int, alive: int, folder: str, mark: str, cores: int) -> None:
    """Serve the campaign at the other end of a socket.

    Args:
        link: the socket.
        alive: the end of a pipe whose other end the campaign alone has.
        folder: for temporary files of the worker.
        mark: in the environment of this process.
        cores: how many the worker is to have for itself, where they are free.
    """
    campaign = Connection(link)
    processes.adopt_orphans()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    supervisor = Supervisor(campaign, alive, folder, mark)
    os.close(alive)
    supervisor.cores, held = machine.reserve(cores)
    try:
        while True:
            order = campaign.recv()
            campaign.send(supervisor.do(order))
    except (EOFError, OSError, CampaignGone, TemplateGone):
        pass  # the campaign starts another one, if it is there
    finally:
        supervisor.end()
        for lock in held:
            os.close(lock)
