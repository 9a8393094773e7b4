"""A run at a larger tolerance, read off the history of the run at a smaller one.

A solver that is asked for 1e-8 passes 1e-4 on its way. Its history says when. The errors of a
history are those of the reduced problem, so the merit that judges the run may be larger. By how
much it was larger at the end is known, and an error of the history counts as so many times larger.
So a time that is read off is late rather than early.

Only runs of built-in solvers are read off: nobody else's solver is believed what it reports.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from fclib._solve import MERITS, MeritKind
from fclib._verdicts import is_solved
from fclib.bench.job import Record
from fclib.bench.profiles import least_errors

MEASURED: Final = "history"  # what the column `measured` says of such a run


def read_off(
    run: Mapping[str, Any],
    history: Sequence[tuple[int, float, float, str]],
    tol: float,
    machine: Mapping[str, Any] | None,
) -> Record | None:
    """The run that would have ended at a larger tolerance; None if it must be run.

    Args:
        run: the run at the smaller tolerance, in the columns of the table `runs`.
        history: its reports.
        tol: the larger tolerance.
        machine: the facts of its machine.
    """
    if run["status"] == "infeasible":
        return None  # a proof ended it; an iterate before it is no solution
    cpu_s, judged = run["cpu_s"], error_by(run, run["merit"])
    times, errors = least_errors(history, cpu_s)
    if not times.size or cpu_s is None or judged is None:
        return None  # it was killed, or solved before the first report
    same: dict[str, Any] = {
        **{name: run[name] for name in ("setup_s", "stages", "load", "started")},
        "memory": run["memory_mb"],
        "measured": MEASURED,
        "warm": bool(run["warm"]),
        "pinned": bool(run["pinned"]),
        "machine": machine,
        "frequency": run["frequency_mhz"],
    }
    larger = max(1.0, judged / max(float(errors[-1]), np.finfo(float).tiny))
    within = np.flatnonzero(larger * errors <= tol)
    merits = {name: run[name] for name in MERITS if run.get(name) is not None}
    if not within.size and not is_solved(run["status"]):
        return Record(
            run["status"],
            iterations=run["iterations"],
            cpu_s=cpu_s,
            total_cpu_s=run["total_cpu_s"],
            wall_s=run["wall_s"],
            merits=merits,
            **same,
        )
    place = int(within[0]) if within.size else len(errors) - 1
    saved = 1.0 - float(times[place]) / max(cpu_s, np.finfo(float).tiny)
    error = min(tol, larger * float(errors[place]))
    return Record(
        "converged",
        iterations=int(history[place][0]),
        cpu_s=float(times[place]),
        # what the solver did not need is left out of the other times too
        total_cpu_s=less(run["total_cpu_s"], saved * cpu_s),
        wall_s=less(run["wall_s"], saved * cpu_s),
        merits={"error": error, "natural": error},
        **same,
    )


def error_by(run: Mapping[str, Any], merit: MeritKind) -> float | None:
    """The error that the tolerance of a run bounds."""
    error: float | None = run["error" if merit == "both" else "natural"]
    return error if error is not None and np.isfinite(error) else None


def less(seconds: float | None, saved: float) -> float | None:
    """A time without what was saved; None stays None."""
    return None if seconds is None else max(0.0, seconds - saved)
