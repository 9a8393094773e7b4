"""The process over a worker: it hands it a job, watches it, kills it, and judges its answer.

``serve(FD, FOLDER)`` serves jobs from a socket until that is closed. The supervisor never runs a
solver: that is done by the worker that it forks, and renews after every failure and whenever it is
not as it was: another process is left, or a thread, or code of the user's has been in it. The
solution comes back as numbers, and the supervisor recomputes every merit from its own copy of the
problem, so that nothing a solver does in its process changes the verdict. What a run took is what
the kernel counted between two words of the worker (meter.py); what the solver says of its time must
fit in there.

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
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from fclib import _core
from fclib._solve import MERITS
from fclib.bench import machine, processes
from fclib.bench.job import KEPT, ORDERLY, STATUSES, Record
from fclib.bench.meter import Meter
from fclib.bench.worker import (
    CERTIFICATE,
    GO,
    HISTORY,
    VECTORS,
    Problems,
    built_in,
    of_signal,
    one_line,
    send,
    serve,
)
from fclib.external import adapters, command

READY_LIMIT = 600.0  # [s] to read the problem and the modules, or to send the solution
WARM_LIMIT = 5.0  # [s] for the first call of a solver, at most
PAUSES = (0.005, 0.05)  # [s] the first and the longest pause between two looks at a run
GRACE = 0.5  # [s] beyond the limit, for a solver that keeps it itself to return
LIMIT_CPU_AFTER = 1.0  # [s] of CPU after which the kernel has the limit too: Watch.limit_cpu
LONGEST = 1 << 26  # [bytes] of a message that is no array
OUTPUT = 1e9  # [bytes] that a run may write into one file, where its memory is not more
# what a solver says of its time may differ from what the kernel says by so much
SLACK, SHARE = 0.02, 0.02  # [s], [1]
UNSEEN = 0.1  # [1] of the CPU time that a thread's clock may miss before the kernel's counts


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


class Supervisor:
    """A worker, and the problems that its answers are judged by."""

    def __init__(self, campaign: Connection, folder: str) -> None:
        self.campaign = campaign
        self.folder = folder  # for the temporary files of the worker
        self.problems = Problems()
        self.cores: set[int] = set()  # that the worker has for itself
        self.link: socket.socket | None = None  # to the worker
        self.meter: Meter | None = None
        self.stderr = -1  # the standard error of the worker
        self.stderr_tail = b""
        self.cpu_limited = False  # whether the worker has a limit of CPU time

    def start(self) -> socket.socket:
        """The link to the worker, which is forked where there is none."""
        if self.link is not None:
            return self.link
        ours, theirs = socket.socketpair()
        reading, writing = os.pipe()
        self.meter = meter = Meter()
        pid = os.fork()
        if pid == 0:
            try:
                meter.enter()
                for unused in (ours, self.campaign):
                    unused.close()
                os.close(reading)
                nothing = os.open(os.devnull, os.O_RDWR)
                for number, to in enumerate((nothing, nothing, writing)):
                    os.dup2(to, number)
                os.setpgid(0, 0)
                if self.cores:
                    os.sched_setaffinity(0, self.cores)
                serve(theirs, self.problems, self.folder)
            except BaseException as error:
                os.write(2, f"{type(error).__name__}: {error}\n".encode())
            finally:
                os._exit(1)
        theirs.close()
        os.close(writing)
        meter.watch(pid)
        self.stderr, self.stderr_tail = reading, b""
        self.link = ours
        return ours

    def stop(self) -> int | None:
        """Kill the worker and all that it has started; its exit status where it has one."""
        if self.link is None or self.meter is None:
            return None
        status = self.meter.kill()
        while select.select([self.stderr], [], [], 0)[0] and self.listen():
            pass
        self.link.close()
        os.close(self.stderr)
        self.link, self.meter, self.cpu_limited = None, None, False
        self.clear()
        return status

    def clear(self) -> None:
        """Remove the temporary files of a run."""
        with contextlib.suppress(OSError):
            for path in Path(self.folder).iterdir():
                if path.is_dir() and not path.is_symlink():
                    shutil.rmtree(path, ignore_errors=True)
                else:
                    path.unlink(missing_ok=True)

    def clean(self, order: dict[str, Any]) -> bool:
        """Whether nothing of a run is left in the worker, which may serve another."""
        if self.link is None or self.meter is None or self.cpu_limited:
            return False
        name = order["solver"]
        ours = name in built_in()
        if not (ours or any(name.startswith(one.PREFIX) for one in adapters())):
            return False  # code of a user's was in the process: who knows what it has changed
        if select.select([self.link], [], [], 0)[0]:
            return False
        if processes.threads(self.meter.pid) > 1 and not (ours and order["threads"] > 1):
            return False
        return self.meter.members() == [self.meter.pid]

    def listen(self) -> bool:
        """Take what the worker says on its standard error, whose end is kept; False at the last."""
        text = os.read(self.stderr, 1 << 16)
        self.stderr_tail = (self.stderr_tail + text)[-2000:]
        return bool(text)

    def last_line(self) -> str:
        """The last line of the worker's standard error."""
        lines = self.stderr_tail.decode(errors="replace").strip().splitlines()
        return f": {lines[-1][:300]}" if lines else ""

    def receive(self, watch: Watch, longest: int = LONGEST) -> bytes:
        """The next message of the worker, which is watched meanwhile.

        Raises:
            WorkerEnded: there will be none.
            CampaignGone: the campaign is over.
        """
        assert self.link is not None
        link, pause = self.link, PAUSES[0]
        sources: list[Any] = [link, self.campaign, self.stderr]
        got, size = bytearray(), 8
        whole = False  # whether the length has been read
        while True:
            ready = select.select(sources, [], [], pause)[0]
            if self.campaign in ready:  # nothing is sent while a job is being done
                raise CampaignGone
            if self.stderr in ready and not self.listen():
                sources.remove(self.stderr)
            if link in ready:
                try:
                    part = link.recv(min(size - len(got), 1 << 22))
                except OSError:
                    part = b""
                if not part:
                    raise self.ended()
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
            said = json.loads(self.receive(watch))
            if said.pop("nonce") == order["nonce"]:
                return dict(said)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            pass
        raise WorkerEnded("garbage", "the worker sent what is no answer to its order")

    def ended(self) -> WorkerEnded:
        """Why a worker that has closed its link has ended."""
        assert self.meter is not None
        end = time.monotonic() + 1.0
        leave = os.WEXITED | os.WNOHANG | os.WNOWAIT
        while os.waitid(os.P_PID, self.meter.pid, leave) is None:
            if time.monotonic() > end:
                return WorkerEnded("garbage", "the worker closed its link, and went on")
            time.sleep(1e-3)
        how = self.stop()
        assert how is not None
        if os.WIFSIGNALED(how):
            number = os.WTERMSIG(how)
            name = signal.Signals(number).name
            return WorkerEnded(of_signal(number), f"ended by {name}{self.last_line()}")
        return WorkerEnded("error", f"exit status {os.WEXITSTATUS(how)}{self.last_line()}")

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
        vectors: dict[str, Any] = {}
        try:
            vectors = self.ask(order | {"warm": True}, record)
        except WorkerEnded as end:
            self.stop()
            record.status, record.message = end.status, str(end)
        except OSError as error:  # no process, no room, no file
            self.stop()
            record.status, record.message = "lost", one_line(error)
        if vectors:
            self.judge(order, record, vectors)
        if order["keep"] and record.status == "converged":
            known = {name: vectors[name] for name in KEPT if name in vectors}
            record.solution = {name: value.tobytes() for name, value in known.items()}
        if record.status in ORDERLY and self.clean(order):
            self.clear()
        else:
            self.stop()
        return record

    def ask(self, order: dict[str, Any], record: Record) -> dict[str, Any]:
        """Have the worker do a job: what it says goes into the record, its solution is returned.

        Raises:
            WorkerEnded: it has ended, or was to be ended; what is known of it is in the record.
        """
        link = self.start()
        meter = self.meter
        assert meter is not None
        record.measured = meter.how
        self.stderr_tail = b""
        order["nonce"] = os.urandom(8).hex()
        limits = order["limits"]
        try:
            send(link, json.dumps(order).encode())
        except OSError:
            raise self.ended() from None
        said = self.said(order, Watch(meter))
        if said.get("word") == "warming":
            wall, cpu = (min(WARM_LIMIT, limits[name]) for name in ("wall", "time"))
            try:
                said = self.said(order, Watch(meter, wall, cpu, limits["memory"]))
            except WorkerEnded:
                # the solver may do better on the problem that it is asked for
                self.stop()
                return self.ask(order | {"warm": False}, record)
        if said.get("word") == "ready":
            self.limit(meter, limits["memory"])
            watch = Watch(meter, limits["wall"], limits["time"], limits["memory"])
            try:
                send(link, GO)
                word = self.said(order, watch)
                watch.stop()
                if word != {"word": "done"}:
                    raise WorkerEnded("garbage", "the worker sent what is no answer to its order")
            except OSError:
                raise self.ended() from None
            finally:
                record.wall_s, record.total_cpu_s = watch.wall, watch.cpu
                record.memory = watch.memory - watch.memory_before
                self.cpu_limited = watch.cpu_limited
            self.limit(meter, math.inf)
            try:
                send(link, GO)
            except OSError:
                raise self.ended() from None
            said = self.said(order, Watch(meter))
            names = take(said, record)
            check_times(order["solver"], record, said.get("reported") is True, watch)
        else:
            names = take(said, record)
        room = int(max(limits["memory"], 100.0) * 1e6) if limits["memory"] < 1e9 else 1 << 40
        return {name: numbers(self.receive(Watch(meter), room)) for name in names}

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

    def judge(self, order: dict[str, Any], record: Record, vectors: dict[str, Any]) -> None:
        """Recompute every merit, and let it decide."""
        proof = [vectors.pop(name, None) for name in CERTIFICATE]
        if record.status in ("lied", "garbage"):
            return
        try:
            problem = self.problems.get(order)
            merit = _core.merit(problem, _core.Solution(**vectors))
        except (_core.FileError, OSError, MemoryError) as error:
            record.status, record.message = "unreadable", one_line(error)
            return
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
            status in STATUSES
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
    record.warm, record.guessed = (said.get(name) is True for name in ("warm", "guessed"))
    record.iterations = iterations
    record.cpu_s, record.setup_s = (None if t is None else float(t) for t in times)
    return list(names)


def check_times(solver: str, record: Record, reported: bool, watch: Watch) -> None:
    """Hold what a solver says of its time and iterations against what the kernel has seen.

    More than that, or less than nothing, is a lie. The clock of the driver is that of the thread
    that calls the solver: where the kernel has seen clearly more, in other threads or processes, it
    is that which counts. A program that says itself what its solve took, and an adapter of another
    package, may leave out their start.
    """
    said, setup, seen = record.cpu_s, record.setup_s or 0.0, watch.cpu
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
    elif any(solver.startswith(one.PREFIX) for one in adapters()):
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


def main(link: int, folder: str, cores: int) -> None:
    """Serve the campaign at the other end of a socket.

    Args:
        link: the socket.
        folder: for temporary files of the worker.
        cores: how many the worker is to have for itself, where they are free.
    """
    campaign = Connection(link)
    processes.adopt_orphans()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    supervisor = Supervisor(campaign, folder)
    supervisor.cores, held = machine.reserve(cores)
    try:
        while True:
            order = campaign.recv()
            campaign.send(supervisor.do(order))
    except (EOFError, OSError, CampaignGone):
        pass
    finally:
        supervisor.stop()
        for lock in held:
            os.close(lock)
