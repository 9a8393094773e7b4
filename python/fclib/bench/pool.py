"""Jobs on this machine: several supervisors work at once, each in its own process.

A supervisor is kept apart from the user's settings: it starts in Python's isolated mode, with the
path of this process without the current folder. If it is killed, stopped or silent, it is replaced,
and its job is `lost`; `fclib.bench.runner` tries that job again.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import math
import os
import shutil
import signal
import site
import socket
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator
from multiprocessing.connection import Connection, wait
from pathlib import Path

import fclib._core as _core
from fclib import _marked
from fclib.bench import meter, processes
from fclib.bench.job import Job, Record
from fclib.bench.supervisor import READY_LIMIT, WARM_LIMIT

THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "RAYON_NUM_THREADS",
)
LOOK = 0.5  # [s] between two looks at supervisors that are silent
STOPPED = 1.0  # [s] that a supervisor may be stopped, for example by SIGSTOP
MARK = "FCLIB_BENCH_RUN"  # in the environment of all that a supervisor starts
PREFIX = "fclib-bench-"  # prefix of folders for temporary files
MARK_OF_OURS = "mark"  # file that marks such a folder as ours
FILES = "files"
START = """
import json, site, sys
path, user, link, lifeline, folder, mark, cores = json.loads(sys.argv[1])
sys.path[:] = path
if user:
    site.addsitedir(user)
from fclib.bench.supervisor import main
main(link, lifeline, folder, mark, cores)
"""


def search_path() -> list[str]:
    """A supervisor's path of modules: that of this process, without the current folder."""
    here = Path.cwd()
    found = [
        path
        for entry in sys.path
        if entry and (path := os.path.abspath(entry)) and Path(path) != here  # noqa: PTH100
    ]
    own = str(Path(_core.__file__).resolve().parent.parent)
    package = str(Path(__file__).resolve().parents[2])
    # if fclib itself is in the current folder, it comes after all others
    return [*found, *(path for path in dict.fromkeys((package, own)) if path not in found)]


def temporary_folder() -> tuple[Path, int]:
    """A new folder below the one for temporary files, and the lock that says that it is in use.

    Folders that killed campaigns have left are removed: those with our mark whose lock nobody holds
    any more.
    """
    above = Path(tempfile.gettempdir())
    for old in above.glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError):
            remove_left(old)
    folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=above))
    lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    fcntl.flock(lock, fcntl.LOCK_SH)
    (folder / MARK_OF_OURS).write_bytes(words_of(folder))
    return folder, lock


def words_of(folder: Path) -> bytes:
    """The text of a folder's mark. It tells the folder from a copy, which is not ours."""
    facts = folder.lstat()
    return f"fclib bench: made by a campaign, {facts.st_dev} {facts.st_ino}\n".encode()


def remove_left(folder: Path) -> None:
    """Remove a folder that `temporary_folder` has made, if nobody uses it.

    Raises:
        OSError: it is used, or has no mark of ours.
    """
    lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        how = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK
        with os.fdopen(os.open(MARK_OF_OURS, how, dir_fd=lock), "rb") as mark:
            owners = {os.fstat(lock).st_uid, os.fstat(mark.fileno()).st_uid}
            if owners == {os.getuid()} and mark.read(1000) == words_of(folder):
                shutil.rmtree(folder, ignore_errors=True)
    finally:
        os.close(lock)


class SupervisorClient:
    """The campaign's side of a supervisor, which is started once it is needed."""

    def __init__(self, threads: int, pin: bool = True) -> None:
        self.threads = threads
        self.pin = pin
        self.process: subprocess.Popen[bytes] | None = None
        self.link: Connection | None = None
        self.job: Job | None = None
        self.patience = math.inf  # time [s] of the monotonic clock until which an answer is awaited
        self.stopped: float | None = None  # time since which it is stopped
        self.mark = ""
        self.folder, self.lock = "", -1
        self.lifeline = -1  # the end of a pipe, open as long as this process lives

    def give(self, job: Job) -> None:
        """Send a job."""
        self.job = job
        if self.link is None or self.threads != job.threads:
            self.end()
            self.threads = job.threads
            self._start()
        assert self.link is not None
        # without an answer by then it hangs. Up to three phases wait for the worker to read or send
        most = 4 * READY_LIMIT + WARM_LIMIT + 2 * job.limits.wall
        self.patience, self.stopped = time.monotonic() + most, None
        with contextlib.suppress(OSError):  # it has ended; `collect` finds out
            self.link.send(job.order())

    def _start(self) -> None:
        above, self.lock = temporary_folder()
        self.folder = str(above / FILES)
        Path(self.folder).mkdir()
        self.mark = uuid.uuid4().hex
        ours, theirs = socket.socketpair()
        lifeline, self.lifeline = os.pipe()
        user = site.getusersitepackages() if site.ENABLE_USER_SITE else ""
        cores = self.threads if self.pin else 0
        mark = f"{MARK}={self.mark}"
        words = [search_path(), user, theirs.fileno(), lifeline, self.folder, mark, cores]
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-I", "-c", START, json.dumps(words)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=[theirs.fileno(), lifeline],
                env=os.environ | dict.fromkeys(THREADS, str(self.threads)) | {MARK: self.mark},
                start_new_session=True,  # Ctrl-C must not reach it
            )
        os.close(lifeline)
        self.link = Connection(ours.detach())

    def collect(self) -> tuple[Job, Record]:
        """The record of the job; `lost` if the supervisor is gone."""
        assert self.job is not None
        assert self.link is not None
        try:
            record: Record = self.link.recv()
        except (EOFError, OSError):
            code = self.end()
            how = f"by {signal.Signals(-code).name}" if code < 0 else f"with exit status {code}"
            record = Record("lost", f"its supervisor ended {how}", started=time.time())
        job, self.job = self.job, None
        return job, record

    def hangs(self) -> bool:
        """Whether the supervisor is stopped, or silent for too long; if so, it is killed."""
        if self.process is None:
            return False
        now = time.monotonic()
        if processes.state(self.process.pid) not in ("T", "t"):
            self.stopped = None
        elif self.stopped is None:
            self.stopped = now
        if now > self.patience or (self.stopped is not None and now - self.stopped > STOPPED):
            self.kill()
            return True
        return False

    def do(self, job: Job) -> Record:
        """Send a job, and wait for its record."""
        self.give(job)
        assert self.link is not None
        while not wait([self.link], LOOK):
            self.hangs()
        return self.collect()[1]

    def kill(self) -> None:
        """End the supervisor and all processes that it started."""
        if self.process is not None:
            _marked.kill(processes.tree(self.process.pid)[::-1])

    def end(self) -> int:
        """Dismiss the supervisor, which kills its run. Return its exit status."""
        code = 0
        if self.link is not None:
            self.link.close()
            self.link = None
        if self.process is not None:
            try:
                self.process.wait(10)
            except subprocess.TimeoutExpired:
                self.kill()
                self.process.wait()
            code = self.process.returncode
            if code:  # it had no time to clean up
                meter.sweep(self.process.pid, f"{MARK}={self.mark}")
            self.process = None
        if self.folder:
            shutil.rmtree(Path(self.folder).parent, ignore_errors=True)
            os.close(self.lock)
            os.close(self.lifeline)
            self.folder = ""
        return code


def run(jobs: Iterator[Job], processes: int) -> Iterator[tuple[Job, Record]]:
    """Do the jobs, several at once; yield each with its record once it is done.

    If the iteration is given up, the running jobs are killed.

    Args:
        jobs: asked for more after each result, even if it was empty before.
        processes: number of supervisors.
    """
    idle = [SupervisorClient(0) for _ in range(processes)]
    everyone = list(idle)
    busy: dict[Connection, SupervisorClient] = {}

    def feed() -> None:
        while idle and (job := next(jobs, None)) is not None:
            supervisor = idle.pop()
            supervisor.give(job)
            assert supervisor.link is not None
            busy[supervisor.link] = supervisor

    looked = time.monotonic()
    try:
        feed()
        while busy:
            ready = wait(list(busy), LOOK)
            if time.monotonic() - looked > LOOK:
                looked = time.monotonic()
                for supervisor in busy.values():
                    supervisor.hangs()
            for link in ready:
                assert isinstance(link, Connection)
                supervisor = busy.pop(link)
                taken = supervisor.collect()
                idle.append(supervisor)
                if taken[1].ran:
                    feed()  # so that the worker need not wait until the record is used
                yield taken
                feed()
    finally:
        for supervisor in everyone:
            if supervisor.link is not None:
                supervisor.link.close()
                supervisor.link = None
        for supervisor in everyone:
            supervisor.end()
