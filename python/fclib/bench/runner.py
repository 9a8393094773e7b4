"""Runs a campaign: what is not in the store yet is run, and stored as it comes."""

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
from fclib._verdicts import SOLVED
from fclib.bench import machine, pool, processes
from fclib.bench.campaign import Campaign
from fclib.bench.job import Guess, Job, Record, Runner
from fclib.bench.store import Store
from fclib.bench.table import Table

BEAT = 2.0  # [s] between two signs of life in the store
RETRIES = 2  # of a run that something from outside has spoilt
PAUSES = (0.5, 5.0)  # [s] before the first and before each other of them
TOO_MANY = 0.1  # share of the runs that cannot be done, at which a campaign stops


@dataclass
class Progress:
    """How far a campaign is."""

    planned: int
    skipped: int  # were in the store before
    statuses: Counter[str] = field(default_factory=Counter)  # of the runs done now
    not_run: Counter[str] = field(default_factory=Counter)  # by what kept them from it
    reason: str = ""  # of the last of them
    left_over: int = 0  # for which the budget does not suffice
    stopped: str = ""  # why it has ended before its end
    spent: float = 0.0  # [s] of its budget
    start: float = field(default_factory=time.monotonic)
    last: Job | None = None

    @property
    def done(self) -> int:
        """Runs that are in the store."""
        return self.skipped + sum(self.statuses.values())

    @property
    def solved(self) -> int:
        """Of those done now."""
        return sum(self.statuses[name] for name in SOLVED)

    @property
    def rate(self) -> float:
        """Runs a second."""
        return sum(self.statuses.values()) / max(1e-9, time.monotonic() - self.start)


class Queue(Iterator[Job]):
    """The jobs that are to be done, each until it is done or was tried often enough.

    It may have another job after it had none: when one comes back, or when the step of a sequence
    is done that one waits for.
    """

    def __init__(
        self,
        jobs: Sequence[Job],
        begin: Callable[[Job], Job | None],
        retries: int,
        left: Callable[[Job, Record | None], None] = lambda *_: None,
    ) -> None:
        self.jobs = deque(jobs)
        self.begin = begin  # a job as it is to be done; None where it is not, any more
        self.retries = retries
        self.left = left  # is told of each that is not done, because the step before it was not
        self.open = {job.key for job in jobs}  # not settled yet
        self.held: dict[str, list[Job]] = defaultdict(list)  # by the run that they wait for
        self.gone: dict[str, Record | None] = {}  # not done, and why; None: the budget is spent
        self.again: deque[tuple[float, Job]] = deque()  # with the time before which it is not tried
        self.attempts: Counter[str] = Counter()
        self.many = max(1.0, TOO_MANY * len(jobs))
        self.failed = 0

    def __next__(self) -> Job:
        """The next one; those that come back after all others, but not if they are too many."""
        while self.jobs and not (self.again and self.troubled):
            job = self.jobs.popleft()
            after = job.along.after if job.along else ""
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
        """Whether so many cannot be done that it is no use to begin others."""
        return self.failed + len(self.again) >= self.many

    def give_back(self, job: Job) -> bool:
        """Take a job that was not done for another time; False where it was tried enough."""
        self.attempts[job.key] += 1
        count = self.attempts[job.key]
        if count > self.retries:
            self.failed += 1
            return False
        self.again.append((time.monotonic() + PAUSES[min(count, len(PAUSES)) - 1], job))
        return True

    def settle(self, job: Job) -> None:
        """A job is done: what waits for it comes next."""
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
        """Note that a job is not done; which jobs wait for it."""
        self.open.discard(job.key)
        self.gone[job.key] = record
        return self.held.pop(job.key, [])

    def stop(self) -> None:
        """Have no more jobs."""
        self.jobs.clear()
        self.again.clear()


def cost(record: Record) -> float:
    """[s] of a budget that a run takes: of CPU, or of waiting where that ended it."""
    waited = record.status == "wall_limit"
    return (record.wall_s if waited else record.total_cpu_s) or 0.0


def spent(runs: Table, keys: Collection[str]) -> float:
    """[s] of a budget that the runs of some keys have taken."""
    waited = runs["status"] == "wall_limit"
    costs = np.where(waited, runs["wall_s"], runs["total_cpu_s"])
    return float(np.nansum(costs[runs["key"].is_in(keys)]))


def with_guess(job: Job, by_key: Mapping[str, Job], store: Store) -> Job:
    """A run of a sequence with the last solution that the solver found before; others as they are.

    Args:
        job: any.
        by_key: the runs of its sequence.
        store: with the solutions, so that a campaign that goes on has the same guess.
    """
    along = job.along
    while along and along.after:
        before = by_key[along.after]
        assert before.along is not None
        if found := store.solution_of(along.after):
            return replace(job, guess=Guess(before.problem, before.along.step, *found))
        along = before.along
    return job


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
        store: an SQLite file, made where there is none.
        jobs: runs at once, on this machine.
        runner: runs the jobs elsewhere instead, as `fclib.bench.cluster.runner` does.
        retries: how often a run is tried again that something from outside has spoilt.
        retry: statuses; runs of the campaign that ended so are done again.
        tell: is called with what is left out of the campaign, and why, and with warnings.
        show: is called at the start, and after each run.

    Raises:
        StoreError: the file is no store.
        fclib.Error: a problem cannot be found, made or read.
    """
    if not processes.supported():
        raise _core.Error("fclib bench needs Linux: its limits are kept by way of /proc")
    Path(store).parent.mkdir(parents=True, exist_ok=True)
    new = not Path(store).exists()
    with Store(store) as opened:
        runs = opened.mended()
        try:
            plan = campaign.plan_by_key(opened, tell)
        except (_core.Error, ImportError):
            if new:
                opened.discard()
            raise
        if retry and opened.forget(plan, retry):
            runs = opened.mended()
        there = set(runs["key"].values)
        left = [job for key, job in plan.items() if key not in there]
        progress = Progress(planned=len(plan), skipped=len(plan) - len(left))
        progress.spent = spent(runs, plan)
        node = machine.facts()["node"]
        number = opened.begin(campaign.name, campaign.text, len(plan), progress.skipped, node)
        show(progress)
        if runner is None:
            warn_of_load(jobs * campaign.threads, tell)
            warn_of_locks(tell)

        by_key = {key: job for key, job in plan.items() if job.along}

        def begin(job: Job) -> Job | None:
            """A job, unless another campaign has done it meanwhile, or it cannot be paid for."""
            if opened.has(job.key):
                progress.skipped += 1
                queue.settle(job)
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
                                    f"stopped: {queue.failed} of {len(left)} runs could not be"
                                    f" done, the last one was {progress.reason}"
                                )
                                queue.stop()
                                break
                    else:
                        if opened.add(job, record, number):
                            progress.statuses[record.status] += 1
                        else:
                            progress.skipped += 1
                        queue.settle(job)
                    show(progress)
                    if time.monotonic() - beat > BEAT:
                        opened.alive(number)
                        beat = time.monotonic()
        finally:
            # also where it is interrupted, so that nobody waits for it
            opened.alive(number, ended=True)
        return progress


def warn_of_load(busy: int, tell: Callable[[str], None]) -> None:
    """Say so where runs would share cores, with each other or with other work."""
    cores, load = machine.facts()["usable_cores"] or os.cpu_count() or 1, os.getloadavg()[0]
    if busy > cores:
        tell(f"{busy} threads at once on {cores} cores: their times do not compare")
    elif load + busy > cores + 0.5:
        tell(
            f"the machine has other work, load {load:.1f} on {cores} cores: times may be longer"
            " than they would be, and are marked where the load was above the number of cores"
        )


def warn_of_locks(tell: Callable[[str], None]) -> None:
    """Say so if no run gets cores for itself, because others could hold their locks."""
    try:
        os.close(machine.folder_of_locks())
    except OSError as error:
        tell(f"runs share their cores with other campaigns: {error}; remove it")
