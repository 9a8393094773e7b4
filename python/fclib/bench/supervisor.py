"""The process over a worker: it hands it a job, watches it, kills it, and judges its answer.

``python -m fclib.bench.supervisor FD`` serves jobs from a socket until that is closed. The
supervisor never runs a solver: that is done by the worker that it forks, and renews after every
failure. The solution comes back as numbers, and the supervisor recomputes every merit from its own
copy of the problem, so that nothing a solver does in its process changes the verdict.

A run is killed with all processes that descend from it, in whatever group or session they are: what
loses its parent becomes a child of the supervisor.
"""

from __future__ import annotations

import json
import math
import os
import resource
import select
import signal
import socket
import sys
import time
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from fclib import _core
from fclib.bench import machine, processes
from fclib.bench.job import MERITS, ORDERLY, Record
from fclib.bench.worker import CERTIFICATE, Problems, of_signal, one_line, send, serve

READY_LIMIT = 600.0  # [s] to read the problem and the modules, or to send the solution
PAUSES = (0.005, 0.05)  # [s] the first and the longest pause between two looks at a run
GRACE = 0.5  # [s] beyond the limit, for a solver that keeps it itself to return
LIMIT_CPU_AFTER = 1.0  # [s] of CPU after which the kernel has the limit too: Watch.limit_cpu
LONGEST = 1 << 40  # [bytes] of a message


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
        self, pid: int, wall: float = READY_LIMIT, cpu: float = math.inf, memory: float = math.inf
    ) -> None:
        self.pid = pid
        self.limits = wall, cpu, memory
        self.start = time.monotonic()
        self.cpu_before, self.memory_before = processes.usage(pid)
        self.cpu, self.memory = 0.0, self.memory_before
        self.cpu_limited = False

    @property
    def wall(self) -> float:
        """[s] since the start."""
        return time.monotonic() - self.start

    def check(self) -> None:
        """Look at the worker and what it has started.

        Raises:
            WorkerEnded: it has overrun.
        """
        cpu, memory = processes.usage(self.pid)
        self.cpu = max(self.cpu, cpu - self.cpu_before)
        self.memory = max(self.memory, memory)
        most_wall, most_cpu, most_memory = self.limits
        if self.cpu > LIMIT_CPU_AFTER and not self.cpu_limited and math.isfinite(most_cpu):
            self.limit_cpu(math.ceil(most_cpu - self.cpu + GRACE) + 1)
        if self.memory - self.memory_before > most_memory:
            raise WorkerEnded("memory", f"killed above {most_memory:g} MB")
        if self.cpu > most_cpu + GRACE:
            raise WorkerEnded("cpu_limit", f"killed after {self.cpu:.1f} s of CPU time")
        if self.wall > most_wall + GRACE:
            raise WorkerEnded("wall_limit", f"killed after {self.wall:.1f} s")

    def limit_cpu(self, seconds: int) -> None:
        """Set RLIMIT_CPU of each process, for the case that this one is held up.

        Not before a run has become a long one, and its worker does not serve another: where there
        is such a limit, Linux counts the CPU time of a process in ticks of some milliseconds, even
        after it is lifted, and those who measure short solves by it would read 0.
        """
        self.cpu_limited = True
        for pid in processes.tree(self.pid):
            used = math.ceil(processes.own_cpu(pid))
            processes.lower(pid, resource.RLIMIT_CPU, used + max(1, seconds))


class Supervisor:
    """A worker, and the problems that its answers are judged by."""

    def __init__(self, campaign: Connection) -> None:
        self.campaign = campaign
        self.problems = Problems()
        self.pid = 0
        self.link: socket.socket | None = None  # to the worker
        self.stderr = -1  # the standard error of the worker
        self.stderr_tail = b""
        self.cpu_limited = False  # whether the worker has a limit of CPU time

    def start(self) -> socket.socket:
        """The link to the worker, which is forked where there is none."""
        if self.link is not None:
            return self.link
        ours, theirs = socket.socketpair()
        reading, writing = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            try:
                for unused in (ours, self.campaign):
                    unused.close()
                os.close(reading)
                nothing = os.open(os.devnull, os.O_RDWR)
                for number, to in enumerate((nothing, nothing, writing)):
                    os.dup2(to, number)
                os.setpgid(0, 0)
                serve(theirs, self.problems)
            except BaseException as error:
                os.write(2, f"{type(error).__name__}: {error}\n".encode())
            finally:
                os._exit(1)
        theirs.close()
        os.close(writing)
        self.stderr, self.stderr_tail = reading, b""
        self.link = ours
        return ours

    def stop(self) -> int | None:
        """Kill the worker and all that it has started; its exit status where it has one."""
        if self.link is None:
            return None
        status = processes.kill_all(self.pid)
        while select.select([self.stderr], [], [], 0)[0] and self.listen():
            pass
        self.link.close()
        os.close(self.stderr)
        self.link, self.pid, self.cpu_limited = None, 0, False
        return status

    def listen(self) -> bool:
        """Take what the worker says on its standard error, whose end is kept; False at the last."""
        text = os.read(self.stderr, 1 << 16)
        self.stderr_tail = (self.stderr_tail + text)[-2000:]
        return bool(text)

    def last_line(self) -> str:
        """The last line of the worker's standard error."""
        lines = self.stderr_tail.decode(errors="replace").strip().splitlines()
        return f": {lines[-1][:300]}" if lines else ""

    def receive(self, watch: Watch) -> bytes:
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
                    if size > LONGEST:
                        raise WorkerEnded("garbage", "the worker sent no answer")
                if len(got) == size and whole:
                    return bytes(got)
            if link not in ready or not whole:
                watch.check()
                pause = min(1.5 * pause, PAUSES[1])

    def ended(self) -> WorkerEnded:
        """Why a worker that has closed its link has ended."""
        end = time.monotonic() + 1.0
        leave = os.WEXITED | os.WNOHANG | os.WNOWAIT
        while os.waitid(os.P_PID, self.pid, leave) is None:
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
        )
        try:
            vectors = self.ask(order, record)
        except WorkerEnded as end:
            self.stop()
            record.status, record.message = end.status, str(end)
            return record
        if vectors:
            self.judge(order, record, vectors)
        if record.status in ORDERLY and not self.cpu_limited:
            processes.kill_orphans(but=self.pid)
        else:
            self.stop()
        return record

    def ask(self, order: dict[str, Any], record: Record) -> dict[str, Any]:
        """Have the worker do a job: what it says goes into the record, its solution is returned.

        Raises:
            WorkerEnded: it has ended, or was to be ended; what is known of it is in the record.
        """
        link = self.start()
        self.stderr_tail = b""
        try:
            send(link, json.dumps(order).encode())
        except OSError:
            raise self.ended() from None
        reply = self.receive(Watch(self.pid))
        if reply == b"started":
            limits = order["limits"]
            watch = Watch(self.pid, limits["wall"], limits["time"], limits["memory"])
            try:
                reply = self.receive(watch)
            finally:
                record.wall_s, record.total_cpu_s = watch.wall, watch.cpu
                record.memory = watch.memory - watch.memory_before
                self.cpu_limited = watch.cpu_limited
        said = json.loads(reply)
        known = [one for one in (said.get("memory"), record.memory) if one is not None]
        said["memory"] = max(known, default=None)
        names = said.pop("vectors", [])
        for name, value in said.items():
            setattr(record, name, value)
        return {name: np.frombuffer(self.receive(Watch(self.pid))) for name in names}

    def judge(self, order: dict[str, Any], record: Record, vectors: dict[str, Any]) -> None:
        """Recompute every merit, and let it decide."""
        proof = [vectors.pop(name, None) for name in CERTIFICATE]
        try:
            problem = self.problems.get(order)
            merit = _core.merit(problem, _core.Solution(**vectors))
        except _core.FileError as error:
            record.status, record.message = "unreadable", one_line(error)
            return
        except (_core.Error, TypeError, ValueError) as error:
            record.status, record.message = "garbage", one_line(error)
            return
        record.merits = {name: float(getattr(merit, name)) for name in MERITS}
        if record.status == "infeasible":
            prove(problem, record, *proof)
        if record.status != "converged":
            return
        limits = order["limits"]
        if not merit.error_by(order["merit"]) <= order["tol"]:
            record.status = "inaccurate"
        elif (record.cpu_s or 0.0) > limits["time"] or (record.wall_s or 0.0) > limits["wall"]:
            record.status, record.message = "time_limit", "solved, but too late"


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


def main() -> None:
    """Serve the campaign at the other end of a socket."""
    campaign = Connection(int(sys.argv[1]))
    processes.adopt_orphans()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    supervisor = Supervisor(campaign)
    try:
        while True:
            order = campaign.recv()
            campaign.send(supervisor.do(order))
    except (EOFError, OSError, CampaignGone):
        pass
    finally:
        supervisor.stop()


if __name__ == "__main__":
    main()
