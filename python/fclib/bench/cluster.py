"""Jobs on a Dask cluster: the same campaign on many machines.

A task of Dask is one job. In the worker of Dask a supervisor does it, as on one machine, so that no
solver harms the worker. If a worker of Dask dies, the scheduler gives its tasks to others. The
records come back to the one process that writes the store.

If all machines share a folder, they read the problems from where the campaign found them. Otherwise
the problems are sent: each worker gets the bytes of a file once, and keeps it in its cache folder.
"""

from __future__ import annotations

import asyncio
import dataclasses
import importlib
import logging
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from fclib import _core, _sequence
from fclib.bench import generated
from fclib.bench.job import Job, ProblemFacts, Record, Runner
from fclib.bench.pool import SupervisorClient

AHEAD = 3  # jobs for each thread of the cluster that are sent ahead
PATIENCE = 20.0  # [s] for a scheduler to answer
LOOK = 5.0  # [s] between two looks at the jobs of Slurm
USELESS = 3  # give up after so many jobs of Slurm in a row end before a worker joins
# states of jobs that work or may still work
QUEUED = "PENDING,CONFIGURING,RUNNING,SUSPENDED,RESIZING,REQUEUED"
RETRIES = 5  # how often a job is repeated if its worker of Dask dies

# ---- in the workers of Dask

_idle: list[SupervisorClient] = []  # one supervisor for each thread that has been at work
_lock = threading.Lock()


def do(job: Job, data: bytes | None = None, before: bytes | None = None) -> Record:
    """Do a job in this worker.

    Args:
        job: as it was planned.
        data: the bytes of its problem's file, if the file is not on a shared folder.
        before: the same for the problem of its guess.
    """
    if data is not None:
        job = dataclasses.replace(job, problem=_moved(job.problem, data))
    if before is not None and job.guess is not None:
        moved = _moved(job.guess.problem, before)
        job = dataclasses.replace(job, guess=dataclasses.replace(job.guess, problem=moved))
    with _lock:
        supervisor = _idle.pop() if _idle else SupervisorClient(job.threads, pin=False)
    try:
        return supervisor.do(job)
    finally:
        with _lock:
            _idle.append(supervisor)


def _moved(problem: ProblemFacts, data: bytes) -> ProblemFacts:
    """The problem; its file is now in the cache folder."""
    return dataclasses.replace(problem, path=str(_kept(problem.hash, data)))


def _kept(name: str, data: bytes) -> Path:
    """The file in the cache folder that holds these bytes."""
    folder = generated.cache_folder() / "sent"
    path = folder / f"{name}.hdf5"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        handle, part = tempfile.mkstemp(dir=folder, prefix=f".{name}-")
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        Path(part).replace(path)
    return path


# ---- in the campaign


def say(word: str) -> None:
    """Tell the user, who waits for a cluster, something."""
    print(word, file=sys.stderr, flush=True)


def runner(
    client: Any,
    send: bool = False,
    tell: Callable[[str], None] = say,
    look: Callable[[bool], None] = lambda _: None,
) -> Runner:
    """What `run_campaign` needs to run its jobs on a cluster.

    Args:
        client: a ``distributed.Client``.
        send: whether the problems are sent, because the machines share no folder.
        tell: called if no worker is there to do the jobs.
        look: called every `LOOK` seconds; its argument says whether a run was done since the last
            call. It raises if waiting is of no use.
    """

    def run(jobs: Iterator[Job]) -> Iterator[tuple[Job, Record]]:
        from distributed.comm.core import CommClosedError
        from distributed.scheduler import KilledWorker

        waiting: dict[Any, Job] = {}
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        sent: dict[str, Any] = {}
        number, looked = 0, time.monotonic()
        waits, progress = False, False  # for a worker; a run was done since the last look
        gone = False  # the scheduler
        address = client.scheduler.address

        def file_of(problem: ProblemFacts | None) -> Any:
            if problem is None or not send:
                return None
            if problem.hash not in sent:
                data = _sequence.content(Path(problem.path))
                sent[problem.hash] = client.scatter(data, hash=False)
            return sent[problem.hash]

        def submit() -> bool:
            nonlocal number
            job = next(jobs, None)
            if job is None:
                return False
            before = job.guess.problem if job.guess else None
            files = file_of(job.problem), file_of(before)
            number += 1
            name = f"fclib-{job.key}-{number}"
            future = client.submit(do, job, *files, key=name, pure=False, retries=RETRIES)
            waiting[future] = job
            future.add_done_callback(done.put)
            return True

        def capacity() -> int:
            return AHEAD * max(1, sum(map(int, client.nthreads().values())))

        def result(future: Any) -> Record | None:
            """The record; None if it was lost with its worker. Then the job is done again."""
            try:
                record: Record = future.result(timeout=LOOK)
            except KilledWorker as error:
                return Record("lost", f"the workers of Dask that tried it died: {error}")
            except (TimeoutError, asyncio.TimeoutError):  # Python 3.10 has two
                future.add_done_callback(done.put)
                return None
            return record

        def wait_aloud() -> None:
            nonlocal waits
            none = not client.nthreads()
            if none and not waits:
                tell(f"waiting: {address} has no worker; dask worker {address} starts one")
            waits = none

        try:
            wait_aloud()
            while True:
                # workers may come and go
                while len(waiting) < capacity() and submit():
                    pass
                if not waiting:
                    return
                if time.monotonic() - looked > LOOK:
                    look(progress)
                    wait_aloud()
                    looked, progress = time.monotonic(), False
                try:
                    future = done.get(timeout=LOOK)
                except queue.Empty:
                    continue
                record = result(future)
                if record is None:
                    continue
                job = waiting.pop(future)
                future.release()
                progress = True
                yield job, record
        except (CancelledError, OSError, TimeoutError, RuntimeError) as error:
            # if the scheduler is gone, so are all its tasks; its client may not know it yet
            gone = client.status != "running" or isinstance(error, CommClosedError)
            if isinstance(error, _core.Error) or not gone:
                raise
            raise _core.Error(
                f"{address}: the Dask scheduler has ended or does not answer; the runs that were"
                " done are stored, and the same command does the others"
            ) from None
        finally:
            if not gone and client.status == "running":
                client.cancel(list(waiting))

    return run


@contextmanager
def quiet() -> Iterator[None]:
    """Silence the messages of Dask that this module gives in one line."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    levels = {logger: logger.level for logger in map(logging.getLogger, names)}
    for logger in levels:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in levels.items():
            logger.setLevel(level)


@contextmanager
def on_scheduler(address: str, send: bool = False) -> Iterator[Runner]:
    """The cluster of a Dask scheduler, which `dask scheduler` has started.

    Raises:
        fclib.Error: it does not answer.
    """
    from distributed import Client

    try:
        client = Client(address, timeout=PATIENCE)
    except (OSError, TimeoutError, ValueError) as error:
        raise _core.Error(f"{address}: no Dask scheduler answers: {error}") from None
    with quiet(), client:
        yield runner(client, send)


def slurm_cluster(options: Mapping[str, str]) -> tuple[Any, int]:
    """A cluster of Slurm jobs, none submitted yet, and the number of workers wanted.

    Args:
        options: ``workers`` (number of processes of Dask in all), and the options of
            ``dask_jobqueue.SLURMCluster``: ``queue``, ``account``, ``cores`` and ``processes`` of a
            job, ``memory``, ``walltime``. If a job has no number of processes, it has one for each
            core. Other options go to sbatch: ``constraint=cascade`` as ``--constraint=cascade``.

    Raises:
        fclib.OptionError: a value that must be a number is not one.
    """
    # its import catches Ctrl-C, and would end the campaign without a message
    handler = signal.getsignal(signal.SIGINT)
    SLURMCluster = importlib.import_module("dask_jobqueue").SLURMCluster
    signal.signal(signal.SIGINT, handler)

    given = dict(options)
    try:
        workers = int(given.pop("workers", "1"))
        cores = int(given.pop("cores", "1"))
        processes = int(given.pop("processes", cores))
    except ValueError as error:
        raise _core.OptionError(
            f"slurm: workers, cores and processes are numbers: {error}"
        ) from None
    known = {name: given.pop(name) for name in ("queue", "account", "walltime") if name in given}
    threads = (f"export {name}=1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"))
    cluster = SLURMCluster(
        cores=cores,
        processes=processes,
        memory=given.pop("memory", "4GB"),
        job_extra_directives=[f"--{name}={value}" for name, value in given.items()],
        job_script_prologue=list(threads),
        **known,
    )
    return cluster, workers


def _ask_sbatch(script: str) -> None:
    """Ask whether Slurm would take the job; nobody would see a later refusal."""
    with tempfile.NamedTemporaryFile("w", prefix="fclib-", suffix=".sh") as file:
        file.write(script)
        file.flush()
        command = ["sbatch", "--test-only", file.name]
        try:
            asked = subprocess.run(command, capture_output=True, text=True, check=False)
        except OSError as error:
            raise _core.Error(
                f"slurm: sbatch: {error.strerror}; --slurm needs a machine that submits to Slurm"
            ) from None
    if asked.returncode:
        words = " ".join(asked.stderr.replace("sbatch: ", "").replace("error: ", "").split())
        raise _core.Error(f"slurm: sbatch refuses the job: {words}")


class Keeper:
    """Keeps the number of Slurm jobs at what is wanted, however they end.

    A job may be cancelled, preempted or reach its walltime, before a worker has joined from it or
    after several have. So Slurm is asked, and not the scheduler of Dask.
    """

    def __init__(self, cluster: Any, workers: int, tell: Callable[[str], None] = say) -> None:
        self.cluster = cluster
        self.workers = workers
        self.tell = tell
        self.useless = 0  # jobs that ended in a row while no run was done

    def look(self, progress: bool) -> None:
        """Submit a new job for each that has ended.

        Args:
            progress: whether a run was done since the last look.

        Raises:
            fclib.Error: several jobs in a row end before a worker joins.
        """
        there = queued()
        if there is None:
            return  # Slurm does not answer now, but may later
        known = self.cluster.workers.items()
        gone = {name: job.job_id for name, job in known if job.job_id and job.job_id not in there}
        if progress or self.cluster.scheduler_info["workers"]:
            self.useless = 0
        else:
            self.useless += len(gone)
        if gone and self.useless >= USELESS:
            raise _core.Error(
                f"slurm: {self.useless} jobs ended before a worker has joined; the last one,"
                f" {next(iter(gone.values()))}, may say why in slurm-*.out"
            )
        if gone:
            self.tell(f"slurm: job {', '.join(gone.values())} has ended; another is submitted")
            self.cluster.sync(self.forget, list(gone))
        if gone or set(self.cluster.worker_spec) - set(self.cluster.workers):
            self.cluster.scale(self.workers)

    async def forget(self, names: list[str]) -> None:
        """Make the cluster forget jobs; this runs in its own loop."""
        for name in names:
            self.cluster.worker_spec.pop(name, None)
            self.cluster.workers.pop(name, None)


def queued() -> set[str] | None:
    """The jobs of this user that work or will work; None if Slurm does not answer."""
    command = ["squeue", "--noheader", f"--user={os.getuid()}", f"--states={QUEUED}"]
    try:
        asked = subprocess.run(
            [*command, "--format=%i"], capture_output=True, text=True, timeout=PATIENCE, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return set(asked.stdout.split()) if asked.returncode == 0 else None


@contextmanager
def on_slurm(
    options: Mapping[str, str], send: bool = False, tell: Callable[[str], None] = say
) -> Iterator[Runner]:
    """A cluster of Slurm jobs, submitted for this campaign.

    Raises:
        fclib.Error: Slurm is not here, or refuses the jobs.
    """
    from distributed import Client

    cluster, workers = slurm_cluster(options)
    try:
        _ask_sbatch(cluster.job_script())
        cluster.scale(workers)
        keeper = Keeper(cluster, workers, tell)
        with quiet(), Client(cluster) as client:
            yield runner(client, send, tell, keeper.look)
    except _core.Error:
        raise
    except (OSError, RuntimeError) as error:
        raise _core.Error(f"slurm: {error}") from error
    finally:
        with suppress(Exception):
            cluster.close()
