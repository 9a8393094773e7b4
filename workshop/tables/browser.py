"""The module for browsers, run by Node, beside the native core: CPU time of auto, the same work.

    python -m workshop.tables.browser FILE... --results browser

On the problems of the family `tiny` of the package and on the files, `auto` is solved by both, one
after another: CPU seconds of the whole process a solve, conversions included, the least of ten
batches that take a tenth of a second at least, once Node has compiled the code. The second table,
NAME-work, compares the work of every solver on every formulation (tests/browser_work.py).
"""

from __future__ import annotations

import argparse
import gzip
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fclib
from workshop.tables import _results

sys.path.insert(0, str(_results.ROOT / "tests"))

import browser_module
import browser_work
import golden_work

BATCHES = 10  # V8 compiles what runs often anew, in threads whose time counts
LEAST = 0.1  # [s] of a batch


def per_solve(batch: Callable[[int], float]) -> float:
    """CPU seconds of one solve; batch(times) has those of so many."""
    times = 1
    while batch(times) < LEAST:
        times *= 2  # a first call takes many times as long as later ones
    return min(batch(times) / times for _ in range(BATCHES))


def native(problem: Any) -> float:
    def batch(times: int) -> float:
        start = time.process_time()
        for _ in range(times):
            fclib.solve(problem, "auto")
        return time.process_time() - start

    return per_solve(batch)


def in_node(module: browser_module.Module, problem: Any) -> float:
    def batch(times: int) -> float:
        return float(module("cpu", problem, {"solver": "auto"}, times))

    return per_solve(batch)


def cpu(module: browser_module.Module, files: list[Path]) -> list[dict[str, Any]]:
    rows = []
    for path in [*sorted(golden_work.TINY.glob("*/*.hdf5")), *files]:
        problem: Any = fclib.read(path)
        own = path.is_relative_to(golden_work.TINY)
        name = f"tiny: {path.parent.name}/{path.stem}" if own else path.stem
        here, there = native(problem), in_node(module, problem)
        result = fclib.solve(problem, "auto")
        rows.append(
            {
                "problem": name,
                "formulation": problem.formulation,
                "contacts": problem.nc,
                "status": result.status,
                "native [ms]": f"{1e3 * here:.3g}",
                "Node [ms]": f"{1e3 * there:.3g}",
                "ratio": f"{there / here:.2f}",
            }
        )
        print(" | ".join(str(value) for value in rows[-1].values()), flush=True)
    ratios = [float(row["ratio"]) for row in rows]
    for name, value in (
        ("geometric mean", statistics.geometric_mean(ratios)),
        ("largest", max(ratios)),
    ):
        rows.append(dict.fromkeys(rows[0], "") | {"problem": name, "ratio": f"{value:.2f}"})
        print(f"{name}: {value:.2f}")
    return rows


def work(module: browser_module.Module) -> list[dict[str, Any]]:
    found = list(browser_work.pairs(module))
    everywhere = {one.pair.solver for one in found} - {
        one.pair.solver for one in found if not one.bits
    }
    core = gzip.compress((browser_module.FOLDER / "fclib-core.wasm").read_bytes(), 9)
    rows = []
    for name, chosen in (
        ("all", found),
        (
            "solvers that have the same bits in all runs",
            [o for o in found if o.pair.solver in everywhere],
        ),
        ("the others", [o for o in found if o.pair.solver not in everywhere]),
    ):
        rows.append(
            {
                "runs": name,
                "solvers": len({one.pair.solver for one in chosen}),
                "number": len(chosen),
                "same iterations, stages, status, and error to 1e-12": sum(o.same for o in chosen),
                "same bits of r": sum(one.bits for one in chosen),
                "size of the core [MB]": f"{len(core) / 1e6:.2f}",
            }
        )
        print(rows[-1])
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="FCLIB files")
    _results.add_option(parser)
    arguments = parser.parse_args()
    if missing := browser_module.missing():
        print(missing, file=sys.stderr)
        return 1
    with browser_module.Module() as module:
        rows = cpu(module, arguments.files)
        compared = work(module)
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="CPU time of auto in Node, over the native one",
            note="CPU seconds of the process a solve, conversions included; tol = 1e-8.",
        )
        _results.store(
            f"{arguments.results}-work",
            compared,
            title="Runs in Node beside native ones",
            note="Every solver on every problem of tests/golden_work.py that it takes.",
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
