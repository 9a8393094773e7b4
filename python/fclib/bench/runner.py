"""Runs a campaign: runs each job that the store lacks, and stores each record at once."""

from __future__ import annotations

import os
import time
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from fclib import _core
from fclib._verdicts import SOLVED, is_solved
from fclib._words import counted
from fclib.bench import machine, pool, processes
from fclib.bench.campaign import Campaign
from fclib.bench.job import Guess, Job, Record, Runner
from fclib.bench.reached import read_off
from fclib.bench.store import Store
from fclib.bench.table import Table

BEAT = 2.0  # [s] between two signs of life in the store
RETRIES = 2  # times that a run is tried again if something from outside spoilt it
PAUSES = (0.5, 5.0)  # [s] pause before the first retry, and before each later one
TOO_MANY = 0.1  # a campaign stops once this share of its runs cannot be done


@dataclass
class Progress:
    """The progress of a campaign."""

    planned: int
    skipped: int  # runs that were in the store before, or are not needed
    statuses: Counter[str] = field(default_factory=Counter)  # statuses of the runs done now
    not_run: Counter[str] = field(default_factory=Counter)  # causes that kept runs from being done
    reason: str = ""  # cause of the last run that was not done
    left_over: int = 0  # runs that the budget does not cover
    stopped: str = ""  # why it stopped early
    spent: float = 0.0  # [s] budget used
    start: float = field(default_factory=time.monotonic)
    last: Job | None = None

    @property
    def done(self) -> int:
        """Runs that are in the store."""
        return self.skipped + sum(self.statuses.values())

    @property
    def solved(self) -> int:
        """The runs done now."""
        return sum(self.statuses[name] for name in SOLVED)

    @property
    def rate(self) -> float:
        """Runs per second."""
        return sum(self.statuses.values()) / max(1e-9, time.monotonic() - self.start)


class Queue(Iterator[Job]):
    """The jobs to do. Each stays until it is done or was tried often enough.

    It may be empty and later have a job again: if a job comes back, or if a step of a sequence is
    done that a job waits for.
    """

    def __init__(
        self,
        jobs: Sequence[Job],
        begin: Callable[[Job], Job | None],
        retries: int,
        left: Callable[[Job, Record | None], None] = lambda *_: None,
    ) -> None:
        self.jobs = deque(jobs)
        self.begin = begin  # gives the job to run; None if it need not be run any more
        self.retries = retries
        # called with each job that is skipped because the step before it was not done
        self.left = left
        self.open = {job.key for job in jobs}  # jobs that are not finished yet
        self.held: dict[str, list[Job]] = defaultdict(list)  # jobs by the run that they wait for
        # jobs not done, with the cause; None: the budget is spent
        self.gone: dict[str, Record | None] = {}
        # each with the earliest time of its next try
        self.again: deque[tuple[float, Job]] = deque()
        self.attempts: Counter[str] = Counter()
        self.many = max(1.0, TOO_MANY * len(jobs))
        self.failed = 0

    def __next__(self) -> Job:
        """The next job. Jobs that came back are last, and are dropped if they are too many."""
        while self.jobs and not (self.again and self.troubled):
            job = self.jobs.popleft()
            after = job.after
            if after in self.gone:
                self.left(job, self.gone[after])
                self.leave(job, self.gone[after])
            elif after in self.open:
                self.held[after].append(job)
            elif (ready := self.begin(job)) is not None:
                return ready
        if not self.again:
            raise StopIteration
        moment, job = self.again.popleft()
        time.sleep(max(0.0, moment - time.monotonic()))
        return job

    @property
    def troubled(self) -> bool:
        """Whether so many jobs cannot be done that beginning others is of no use."""
        return self.failed + len(self.again) >= self.many

    def give_back(self, job: Job) -> bool:
        """Take back a job that was not done; False if it was tried often enough."""
        self.attempts[job.key] += 1
        count = self.attempts[job.key]
        if count > self.retries:
            self.failed += 1
            return False
        self.again.append((time.monotonic() + PAUSES[min(count, len(PAUSES)) - 1], job))
        return True

    def finish(self, job: Job) -> None:
        """A job is done: the jobs that wait for it come next."""
        self.open.discard(job.key)
        self.jobs.extendleft(self.held.pop(job.key, ()))

    def leave(self, job: Job, record: Record | None) -> None:
        """A job is not done, nor are the steps after it."""
        later = self.skip(job, record)
        while later:
            job = later.pop()
            self.left(job, record)
            later += self.skip(job, record)

    def skip(self, job: Job, record: Record | None) -> list[Job]:
        """Note that a job is not done; return the jobs that wait for it."""
        self.open.discard(job.key)
        self.gone[job.key] = record
        return self.held.pop(job.key, [])

    def stop(self) -> None:
        """Drop all jobs."""
        self.jobs.clear()
        self.again.clear()


def cost(record: Record) -> float:
    """Seconds of the budget that a run takes: CPU time, or wall time if that limit ended it."""
    waited = record.status == "wall_limit"
    return (record.wall_s if waited else record.total_cpu_s) or 0.0


def budget_used(runs: Table, keys: Collection[str]) -> float:
    """Seconds of the budget that the runs of some keys have taken."""
    waited = runs["status"] == "wall_limit"
    costs = np.where(waited, runs["wall_s"], runs["total_cpu_s"])
    return float(np.nansum(costs[runs["key"].is_in(keys)]))


def with_guess(job: Job, by_key: Mapping[str, Job], store: Store) -> Job:
    """A job of a sequence with the solver's last solution before it; other jobs stay as they are.

    Args:
        job: of any kind.
        by_key: the runs of its sequence.
        store: holds the solutions, so that a resumed campaign has the same guess.
    """
    along = job.along
    while along and along.after:
        before = by_key[along.after]
        assert before.along is not None
        if found := store.solution_of(along.after):
            return replace(job, guess=Guess(before.problem, before.along.step, *found))
        along = before.along
    return job


def read_off_from(store: Store, job: Job) -> Record | None:
    """The record of a job by the run at a smaller tolerance; None if it must be run."""
    run = store.run_of(job.off)
    if run is None:
        return None
    return read_off(run, store.history(run["id"]), job.tol, store.machine_of(run))


def is_needed(store: Store, job: Job) -> bool:
    """Whether a job must be done: a repeat may be of use only if the first run solved."""
    first = store.run_of(job.first) if job.first else None
    return not job.first or (first is not None and is_solved(first["status"]))


def run_campaign(
    campaign: Campaign,
    store: str | Path,
    *,
    jobs: int = 1,
    runner: Runner | None = None,
    retries: int = RETRIES,
    retry: Sequence[str] = (),
    tell: Callable[[str], None] = lambda _: None,
    show: Callable[[Progress], Any] = lambda _: None,
) -> Progress:
    """Run a campaign, or what is left of it.

    Args:
        campaign: what to run.
        store: an SQLite file, made if there is none.
        jobs: number of runs at once on this machine.
        runner: runs the jobs elsewhere instead, as `fclib.bench.cluster.runner` does.
        retries: how often a run is tried again if something from outside spoilt it.
        retry: runs of the campaign that ended in one of these statuses are done again.
        tell: called with each thing left out of the campaign and why, and with warnings.
        show: called at the start, and after each run.

    Raises:
        StoreError: the file is not a store.
        fclib.Error: a problem cannot be found, made or read.
    """
    if not processes.supported():
        raise _core.Error("fclib bench needs Linux: its limits are kept by way of /proc")
    Path(store).parent.mkdir(parents=True, exist_ok=True)
    with Store(store) as opened:
        runs = opened.mended()
        plan = campaign.plan_by_key(opened, tell)
        if retry and opened.forget(plan, retry):
            runs = opened.mended()
        there = set(runs["key"].values)
        left = [job for key, job in plan.items() if key not in there]
        progress = Progress(planned=len(plan), skipped=len(plan) - len(left))
        progress.spent = budget_used(runs, plan)
        node = machine.facts()["node"]
        number = opened.begin(campaign.name, campaign.text, len(plan), progress.skipped, node)
        show(progress)
        if runner is None:
            warn_of_load(jobs * campaign.threads, tell)
            warn_of_locks(tell)

        by_key = {key: job for key, job in plan.items() if job.along}

        def begin(job: Job) -> Job | None:
            """The job; None if it is done already, by another campaign or by the run it is read off
            from, if it is not needed, or if the budget is too small.
            """
            if opened.has(job.key) or not is_needed(opened, job):
                progress.skipped += 1
                queue.finish(job)
                return None
            if job.off and (record := read_off_from(opened, job)) is not None:
                opened.add(job, record, number)
                progress.statuses[record.status] += 1
                queue.finish(job)
                return None
            if campaign.budget is not None and progress.spent >= campaign.budget:
                progress.left_over += 1
                queue.leave(job, None)
                return None
            return with_guess(job, by_key, opened)

        def leave(job: Job, record: Record | None) -> None:
            """Note that a step is not done, because the one before it was not."""
            if record is None:
                progress.left_over += 1
                return
            progress.not_run[record.status] += 1
            message = f"a step before it was not run: {record.message}"
            opened.fault(job, replace(record, message=message), number)

        queue = Queue(left, begin, retries, leave)
        beat = time.monotonic()
        run = runner or (lambda waiting: pool.run(waiting, jobs))
        try:
            with closing(run(queue)) as done:  # type: ignore[type-var]
                for job, record in done:
                    progress.spent += cost(record)
                    progress.last = job
                    if not record.ran:
                        if not queue.give_back(job):
                            progress.not_run[record.status] += 1
                            progress.reason = f"{record.status}: {record.message}"
                            opened.fault(job, record, number)
                            queue.leave(job, record)
                            if queue.failed >= queue.many:
                                progress.stopped = (
                                    f"stopped: {queue.failed} of {counted(len(left), 'run')} could"
                                    f" not be done, the last one was {progress.reason}"
                                )
                                queue.stop()
                                break
                    else:
                        if opened.add(job, record, number):
                            progress.statuses[record.status] += 1
                        else:
                            progress.skipped += 1
                        queue.finish(job)
                    show(progress)
                    if time.monotonic() - beat > BEAT:
                        opened.alive(number, skipped=progress.skipped)
                        beat = time.monotonic()
        finally:
            # also after an interrupt, so that nobody waits for it
            opened.alive(number, ended=True, skipped=progress.skipped)
        return progress


def warn_of_load(busy: int, tell: Callable[[str], None]) -> None:
    """Warn if runs would share cores, with each other or with other work."""
    cores, load = machine.facts()["usable_cores"] or os.cpu_count() or 1, os.getloadavg()[0]
    if busy > cores:
        tell(f"{busy} threads at once on {cores} cores: their times do not compare")
    elif load + busy > cores + 0.5:
        tell(
            f"the machine has other work, load {load:.1f} on {cores} cores: times may be longer"
            " than they would be, and are marked if the load was above the number of cores"
        )


def warn_of_locks(tell: Callable[[str], None]) -> None:
    """Warn if no run gets cores for itself, because others could hold the locks."""
    try:
        os.close(machine.folder_of_locks())
    except OSError as error:
        tell(f"runs share their cores with other campaigns: {error}; remove it")
