"""How two machines compare: the CPU times of a fixed set of solves on each of them.

A pair of machines has a ratio for each solve. The ratio of times of the two machines is the
geometric mean of these. Solvers differ: another one may gain more from the faster machine. So the
interval is that in which the ratio of a further solve lies, by Student's t of the logarithms.

The solves are by methods without a factorisation. Factorising methods became several times as fast
from one version to the next, so their times compare versions too, and not machines alone.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from fclib import _solve
from fclib._files import write_text
from fclib.bench import generated, machine

VERSION: Final = 2  # another set of solves gets another number
SECONDS: Final = 60.0  # of CPU, for all solves together
LEVEL: Final = 0.95  # of the interval
TOLERANCE: Final = 1e-6
# small ones that stay in the caches, and larger ones that do not; families that do different work
SIZES: Final = (3, 30, 300, 1000)  # contacts
SOLVERS: Final = ("nsgs", "apgd")
FORMER: Final = ("nsn-ac", "nsip")  # earlier calibrations have them; they no longer count
LEAST, MOST = 1e-8, 1e4  # [s] bounds of the time of a solve of it, on any machine


@dataclass(frozen=True)
class Calibration:
    """The times of a machine."""

    version: int
    date: str
    load: float  # of the machine, when it began
    seconds: Mapping[str, float]  # [s] of CPU of each solve, the median of its repeats
    spread: float  # median over the solves of the quartiles' distance, relative to the median

    def record(self) -> dict[str, Any]:
        """The calibration in JSON's types."""
        return asdict(self) | {"seconds": dict(self.seconds)}


@dataclass(frozen=True)
class Ratio:
    """Times of a machine over those of another, with the interval of those of a single solver."""

    mean: float
    low: float  # ends of the interval of LEVEL
    high: float

    def __str__(self) -> str:
        return f"{self.mean:.3g} ({self.low:.3g} to {self.high:.3g})"


def calibrate(
    seconds: float = SECONDS, show: Callable[[str], None] = lambda _: None
) -> Calibration:
    """Run the solves, for so many seconds of CPU, and return their times.

    Args:
        seconds: of CPU, for all of them.
        show: called with the name of each solve.
    """
    date, load = time.strftime("%Y-%m-%d"), os.getloadavg()[0]
    problems = {size: generated.plant(size, 3, 1) for size in SIZES}
    share = seconds / (len(SIZES) * len(SOLVERS))
    found, spreads = {}, []
    for solver in SOLVERS:
        for size in SIZES:
            name = f"{solver}, {size} contacts"
            show(name)
            times = times_of(problems[size], solver, share)
            low, middle, high = np.quantile(times, (0.25, 0.5, 0.75))
            found[name] = float(middle)
            spreads.append((high - low) / middle)
    return Calibration(VERSION, date, load, found, float(np.median(spreads)))


def times_of(problem: Any, solver: str, seconds: float) -> list[float]:
    """The CPU times [s] of a solve that is repeated; the first one warms up and does not count."""
    _solve.solve(problem, solver, TOLERANCE)
    times: list[float] = []
    start = time.process_time()
    while len(times) < 3 or time.process_time() - start < seconds:
        times.append(_solve.solve(problem, solver, TOLERANCE).cpu_s)
    return times


def ratio_of(mine: Calibration, theirs: Calibration) -> Ratio:
    """The factor from their times to mine.

    Raises:
        ValueError: the calibrations are of different versions.
    """
    if mine.version != theirs.version or mine.seconds.keys() != theirs.seconds.keys():
        raise ValueError(
            f"calibrations of version {mine.version} and {theirs.version} do not compare"
            if mine.version != theirs.version
            else "calibrations of different solves do not compare"
        )
    from scipy import stats

    names = list(mine.seconds)
    logs = np.log([mine.seconds[name] / theirs.seconds[name] for name in names])
    mean, count = float(logs.mean()), len(logs)
    half = stats.t.ppf(0.5 + LEVEL / 2, count - 1) * logs.std(ddof=1) * np.sqrt(1 + 1 / count)
    return Ratio(*(float(np.exp(mean + sign * half)) for sign in (0, -1, 1)))


def save(found: Calibration) -> Path:
    """Keep the calibration of this machine: stores say it from now on. OSError."""
    file = machine.calibration_file()
    file.parent.mkdir(parents=True, exist_ok=True)
    write_text(file, json.dumps(found.record()))
    machine.facts.cache_clear()
    return file


def calibration_in(facts: Mapping[str, Any]) -> Calibration | None:
    """The calibration that the facts of a machine have; None if it was not calibrated."""
    try:
        known = facts["calibration"]
        seconds = {
            str(name): float(value)
            for name, value in known["seconds"].items()
            if not str(name).startswith(FORMER)
        }
        if not seconds or not all(LEAST < value < MOST for value in seconds.values()):
            return None
        return Calibration(
            int(known["version"]),
            str(known["date"]),
            float(known["load"]),
            seconds,
            float(known["spread"]),
        )
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError):
        return None
