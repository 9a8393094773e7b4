"""Runs a campaign: what is not in the store yet is run, and stored as it comes."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fclib import _core
from fclib.bench import machine, pool, processes
from fclib.bench.campaign import Campaign
from fclib.bench.job import Job, Runner
from fclib.bench.store import Store

BEAT = 2.0  # [s] between two signs of life in the store


@dataclass
class Progress:
    """How far a campaign is."""

    planned: int
    skipped: int  # were in the store before
    statuses: Counter[str] = field(default_factory=Counter)  # of the runs done now
    start: float = field(default_factory=time.monotonic)
    last: Job | None = None

    @property
    def done(self) -> int:
        """Runs that are in the store."""
        return self.skipped + sum(self.statuses.values())

    @property
    def solved(self) -> int:
        """Of those done now."""
        return self.statuses["converged"]

    @property
    def rate(self) -> float:
        """Runs a second."""
        return sum(self.statuses.values()) / max(1e-9, time.monotonic() - self.start)


def run_campaign(
    campaign: Campaign,
    store: str | Path,
    *,
    jobs: int = 1,
    runner: Runner | None = None,
    tell: Callable[[str], None] = lambda _: None,
    show: Callable[[Progress], Any] = lambda _: None,
) -> Progress:
    """Run a campaign, or what is left of it.

    Args:
        campaign: what to run.
        store: an SQLite file, made where there is none.
        jobs: runs at once, on this machine.
        runner: runs the jobs elsewhere instead, as `fclib.bench.cluster.runner` does.
        tell: is called with what is left out of the campaign, and why.
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
        try:
            plan = campaign.plan(opened, tell)
        except (_core.Error, ImportError):
            if new:
                opened.discard()
            raise
        there = opened.keys()
        left = [job for job in plan if job.key not in there]
        progress = Progress(planned=len(plan), skipped=len(plan) - len(left))
        node = machine.facts()["node"]
        number = opened.begin(campaign.name, campaign.text, len(plan), progress.skipped, node)
        show(progress)

        def fresh() -> Iterator[Job]:
            """Those that no other campaign has done meanwhile."""
            for job in left:
                if opened.has(job.key):
                    progress.skipped += 1
                else:
                    yield job

        beat = time.monotonic()
        run = runner or (lambda waiting: pool.run(waiting, jobs))
        try:
            with closing(run(fresh())) as done:  # type: ignore[type-var]
                for job, record in done:
                    if opened.add(job, record, number):
                        progress.statuses[record.status] += 1
                    else:
                        progress.skipped += 1
                    progress.last = job
                    show(progress)
                    if time.monotonic() - beat > BEAT:
                        opened.alive(number)
                        beat = time.monotonic()
        finally:
            # also where it is interrupted, so that nobody waits for it
            opened.alive(number, ended=True)
        return progress
