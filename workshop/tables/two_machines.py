"""One campaign on two machines, or on one under two loads: the ratio of times.

    fclib bench --calibrate                       # on each machine
    fclib bench CAMPAIGN --store A.sqlite         # on one
    fclib bench CAMPAIGN --store B.sqlite         # on the other
    python -m workshop.tables.two_machines A.sqlite B.sqlite [--least 0.001] [--results NAME]

Of each solver: the geometric mean of its CPU times in B over those in A, on the problems that it
solves in both and that take LEAST [s] in both. The last column says whether the calibrations'
interval of this ratio holds it.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np

from fclib.bench import comparison, profiles
from fclib.bench.calibration import Calibration, Ratio, calibration_in, ratio_of
from fclib.bench.store import Store
from workshop.tables import _results

COLUMNS = ("solver", "problems", "times, B over A", "by calibration", "within")


def calibration_of(path: Path) -> Calibration:
    """The calibration of the machine of a store. SystemExit: it has none, or several machines."""
    with Store(path, create=False) as store:
        found = [calibration_in(facts) for facts in store.machines().values()]
    known = [one for one in found if one is not None]
    if len(known) != 1:
        raise SystemExit(f"{path}: has {len(known)} calibrations, where one is needed")
    return known[0]


def times_of(path: Path) -> dict[str, dict[Any, float]]:
    """The CPU time [s] of each solved instance, by solver."""
    costs = comparison.gather(profiles.load(path))
    return {
        solver: {
            (instance.hash, instance.tol): value
            for instance, value in zip(costs.instances, costs.values[:, k].tolist(), strict=True)
            if math.isfinite(value)
        }
        for k, solver in enumerate(costs.solvers)
    }


def rows_of(
    first: dict[str, dict[Any, float]],
    second: dict[str, dict[Any, float]],
    ratio: Ratio,
    least: float,
) -> list[dict[str, Any]]:
    """A row for each solver of both."""
    rows = []
    for solver in first:
        own, other = first[solver], second.get(solver, {})
        both = [key for key in own.keys() & other.keys() if min(own[key], other[key]) >= least]
        if not both:
            continue
        mean = float(np.exp(np.mean([np.log(other[key] / own[key]) for key in both])))
        within = "yes" if ratio.low <= mean <= ratio.high else "no"
        values = (solver, len(both), f"{mean:.3g}", str(ratio), within)
        rows.append(dict(zip(COLUMNS, values, strict=True)))
    return rows


def main() -> None:
    """Print the table, and store it if that is asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("stores", type=Path, nargs=2)
    parser.add_argument("--least", type=float, default=0.001, help="[s] of CPU, in both")
    parser.add_argument("--results", help="store the table as docs/results/NAME.csv")
    own = parser.parse_args()
    first, second = map(calibration_of, own.stores)
    times = [times_of(path) for path in own.stores]
    rows = rows_of(times[0], times[1], ratio_of(second, first), own.least)
    if not rows:
        raise SystemExit(f"no solver solves a problem in both that takes {own.least:g} s")
    for row in rows:
        print("  ".join(f"{value!s:>16}" for value in row.values()))
    if own.results:
        held = sum(row["within"] == "yes" for row in rows)
        _results.store(
            own.results,
            rows,
            title="CPU times of one campaign twice, and their ratio by the calibrations",
            note=f"The loads when the calibrations began: {first.load:.1f} and {second.load:.1f}."
            f" The interval holds the ratio of {held} of {len(rows)} solvers.",
        )


if __name__ == "__main__":
    main()
