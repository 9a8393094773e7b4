"""Jobs on this machine: several supervisors at once, each a process of its own."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from multiprocessing.connection import Connection, wait

from fclib.bench.job import Job, Record

THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "RAYON_NUM_THREADS",
)
ATTEMPTS = 3  # at a job whose supervisor is killed from outside


class SupervisorClient:
    """The other end of a supervisor, which is started when it is needed."""

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self.process: subprocess.Popen[bytes] | None = None
        self.link: Connection | None = None
        self.job: Job | None = None
        self.attempts = 0

    def give(self, job: Job) -> None:
        """Have a job done."""
        self.job, self.attempts = job, self.attempts + 1
        if self.link is None or self.threads != job.threads:
            self.end()
            self.threads = job.threads
            self._start()
        assert self.link is not None
        with contextlib.suppress(OSError):  # it has ended, which taking finds out
            self.link.send(job.order())

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "fclib.bench.supervisor", str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                env=os.environ | dict.fromkeys(THREADS, str(self.threads)),
                start_new_session=True,  # Ctrl-C is not for it
            )
        self.link = Connection(ours.detach())

    def take(self) -> tuple[Job, Record] | None:
        """What came of the job; None where the supervisor is gone, and the job given anew."""
        assert self.job is not None
        assert self.link is not None
        try:
            record: Record = self.link.recv()
        except (EOFError, OSError):
            self.end()
            if self.attempts < ATTEMPTS:
                self.give(self.job)
                return None
            record = Record("killed", "its supervisor was killed, as often as it was tried")
        job, self.job, self.attempts = self.job, None, 0
        return job, record

    def do(self, job: Job) -> Record:
        """Have a job done, and wait for it."""
        self.give(job)
        while (taken := self.take()) is None:
            pass
        return taken[1]

    def end(self) -> None:
        """Let the supervisor go, which kills what it runs."""
        if self.link is not None:
            self.link.close()
            self.link = None
        if self.process is not None:
            try:
                self.process.wait(10)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
            self.process = None


def run(jobs: Iterator[Job], processes: int) -> Iterator[tuple[Job, Record]]:
    """Do the jobs, so many at once; yields each with its record as it is done.

    Where the iteration is given up, what is running is killed.
    """
    supervisors = [SupervisorClient(0) for _ in range(processes)]
    busy: dict[Connection, SupervisorClient] = {}

    def next_one(supervisor: SupervisorClient) -> None:
        job = next(jobs, None)
        if job is not None:
            supervisor.give(job)
            assert supervisor.link is not None
            busy[supervisor.link] = supervisor

    try:
        for supervisor in supervisors:
            next_one(supervisor)
        while busy:
            for link in wait(list(busy)):
                assert isinstance(link, Connection)
                supervisor = busy.pop(link)
                taken = supervisor.take()
                if taken is None:
                    assert supervisor.link is not None
                    busy[supervisor.link] = supervisor
                    continue
                next_one(supervisor)  # the worker need not wait for what becomes of the record
                yield taken
    finally:
        for supervisor in supervisors:
            if supervisor.link is not None:
                supervisor.link.close()
                supervisor.link = None
        for supervisor in supervisors:
            supervisor.end()
