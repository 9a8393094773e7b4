"""How many problems `auto` solves to a tight tolerance, and what ends it on the others.

    .venv/bin/fclib collection build standard --out OUT --form global --no-references --no-pictures
    python -m workshop.tables.accurate OUT [--tol 1e-12] [--limit 5] [--skip 3]
        [--only rolling] [--results accurate]

OUT has problems of stored states, which never change: the sample is the same for everybody. Of a
kind (the family's set): problems solved to --tol by both merits within --limit s of CPU time;
those proven to have no solution; of the others those whose error is not larger than what the last
digit of the reactions changes, which the message must say; and the rest. "last stages" are those
that ended the solves. CPU times are those of the solver and the conversions. --skip leaves out all
but each so-manieth file.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import fclib
from fclib import scenes
from workshop.tables import _results

COARSE = "doubles are too coarse"  # how the message begins where rounding ends a solve


def last_stage(result: fclib.Result) -> str:
    """The one that solved, or that the solve ended in."""
    solved = [stage.name for stage in result.stages if stage.solved]
    tried = [stage.name for stage in result.stages]
    return (solved or tried or ["none"])[-1]


def solved(path: Path, tol: float, limit: float) -> dict[str, Any]:
    """What became of a problem."""
    problem = fclib.read(path)
    end = time.process_time() + limit
    result = fclib.solve(
        problem,
        "auto",
        tol,
        time_limit=10 * limit,  # of CPU time is enough on a busy machine
        callback=lambda *_: time.process_time() < end,
    )
    coarse = result.message.startswith(COARSE)
    if result.converged or result.status == "infeasible":
        how = result.status
    else:
        how = "rounding" if coarse else "rest"
    return {
        "how": how,
        "cpu": result.cpu_s + result.setup_s,
        "stage": last_stage(result),
        "error": result.error,
        "told": f"{result.status} at {result.error:.1e}; {result.message}",
    }


def row(kind: str, runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Of the table."""
    how = Counter(run["how"] for run in runs)
    stages = Counter(run["stage"] for run in runs if run["how"] == "converged")
    spent: Counter[str] = Counter()
    for run in runs:
        spent[run["stage"]] += run["cpu"]
    total = sum(spent.values())
    return {
        "kind": kind,
        "problems": len(runs),
        "solved": how["converged"],
        "no solution": how["infeasible"],
        "ended by rounding": how["rounding"],
        "others": how["rest"],
        "median CPU [ms]": 1e3 * statistics.median(run["cpu"] for run in runs),
        "largest CPU [s]": max(run["cpu"] for run in runs),
        "last stages": ", ".join(
            f"{name} {count} ({100 * spent[name] / total:.0f} % of CPU)"
            for name, count in stages.most_common()
        ),
    }


def main() -> None:
    """A row for each kind, and a line for each problem that is not solved."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--tol", type=float, default=1e-12)
    parser.add_argument("--limit", type=float, default=5, help="[s] of CPU time of a solve")
    parser.add_argument("--skip", type=int, default=1)
    parser.add_argument("--only", nargs="+", help="these kinds")
    _results.add_option(parser)
    arguments = parser.parse_args()
    families = scenes.families() | scenes.assemblies()
    kinds: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for path in sorted(arguments.folder.rglob("*.hdf5"))[:: arguments.skip]:
        kind = families[path.parent.name].collection
        if arguments.only and kind not in arguments.only:
            continue
        run = solved(path, arguments.tol, arguments.limit)
        kinds[kind].append(run)
        if run["how"] != "converged":
            name = path.relative_to(arguments.folder).with_suffix("")
            print(f"{name}: {run['told']}; {run['cpu']:.1f} s", flush=True)
    rows = [row(kind, runs) for kind, runs in sorted(kinds.items())]
    if not rows:
        raise SystemExit(f"{arguments.folder}: there is no file of these kinds")
    if len(rows) > 1:
        every = [run for runs in kinds.values() for run in runs]
        rows.append({**row("all", every), "last stages": ""})
    for one in rows:
        print(*one.values(), sep="  ")
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title=f"Problems solved to {_results.power(arguments.tol)}, and what ends the others",
            note=f"within {arguments.limit:g} s of CPU time a problem",
        )


if __name__ == "__main__":
    main()
