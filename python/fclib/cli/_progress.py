"""The progress of long work: the families of a build, the runs of a campaign."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeRemainingColumn,
)

from fclib import bench
from fclib.cli._output import err

PAUSE = 10.0  # [s] between two lines if there is no terminal


@contextmanager
def many_bars() -> Iterator[Callable[[str, int, int], None]]:
    """A bar for each family on a terminal, else a line every ten seconds on the standard error."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=err, disable=not err.is_terminal) as bars:
        tasks: dict[str, Any] = {}
        last_shown = time.monotonic()

        def show(name: str, done: int, total: int) -> None:
            nonlocal last_shown
            if not err.is_terminal and time.monotonic() - last_shown > PAUSE:
                last_shown = time.monotonic()
                err.print(f"{name}: {done} of {total}", highlight=False)
            if name not in tasks:
                tasks[name] = bars.add_task(name, total=total)
            bars.update(tasks[name], completed=done, total=total)

        yield show


@contextmanager
def live(name: str, quiet: bool) -> Iterator[Callable[[bench.Progress], None]]:
    """Show the progress of a campaign: a bar on a terminal, else a line every ten seconds."""
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[words]}", markup=False),
    )
    last_shown = time.monotonic()
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bar:
        task = bar.add_task(name, total=None, words="")

        def show(progress: bench.Progress) -> None:
            nonlocal last_shown
            done = sum(progress.statuses.values())
            left = (progress.planned - progress.done) / progress.rate if done else None
            words = f"{progress.solved} solved, {done - progress.solved} not"
            if left is not None:
                words += f", {progress.rate:.1f}/s, {duration(left)} left"
            bar.update(task, total=progress.planned, completed=progress.done, words=words)
            if not quiet and not err.is_terminal and time.monotonic() - last_shown > PAUSE:
                last_shown = time.monotonic()
                err.print(f"{name}: {progress.done} of {progress.planned}, {words}")

        yield show


def duration(seconds: float) -> str:
    """A time for readers: 0:12, 3:05:00."""
    whole = round(max(0.0, seconds))
    hours, rest = divmod(whole, 3600)
    return f"{hours}:{rest // 60:02}:{rest % 60:02}" if hours else f"{rest // 60}:{rest % 60:02}"
