"""The tables of docs/analysis.md: what problems are, and how far they are solved.

    python -m workshop.tables.analysis_table FILE... [--time-limit 60] [--results NAME]
    python -m workshop.tables.analysis_table FILE... --self-stress [--results NAME]

Stores NAME (a row for each problem) and NAME-counts (how many problems have which verdict). With
--self-stress: NAME alone, what the self-stress proves; files that differ in what stands after the
last dash of their names, the seed, share a row.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import fclib
from fclib import analysis
from workshop.tables import _results


def row_of(path: Path, time_limit: float) -> dict[str, Any]:
    """Analysis and reference of one problem."""
    problem = fclib.read(path)
    start = time.process_time()
    found = analysis.analyze(problem, time_limit=time_limit)
    analysed = time.process_time()
    solved = analysis.reference(problem, time_limit=time_limit)
    second = solved.second
    w = found.spectra["W"]
    return {
        "problem": f"{path.parent.name}/{path.stem}",
        "nc": problem.nc,
        "m": problem.m,
        "rank W": w.rank,
        "cond W": f"{w.conditioning:.0e}",
        "asym W": f"{found.asymmetry['W']:.0e}",
        "W is": found.definiteness.word.replace("positive ", ""),
        "existence": found.existence.verdict,
        "velocity": found.uniqueness.verdict,
        "error": f"{solved.error:.0e}",
        "second": f"{second.solver}, {second.start}" if second else "-",
        "differs": f"{second.difference:.0e}" if second else "-",
        "reaction": solved.reaction,
        "other velocities": len(solved.others),
        "certified": "yes" if solved.certified else f"no: {solved.reason}",
        "analysis [s]": analysed - start,
        "reference [s]": time.process_time() - analysed,
    }


def counts(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """How many problems have which verdict."""
    found = [{"verdict": "problems", "of them": len(rows)}]
    for key in ("existence", "W is", "velocity", "reaction"):
        counted = Counter(row[key] for row in rows)
        found += [{"verdict": f"{key}: {word}", "of them": n} for word, n in counted.items()]
    found += [
        {"verdict": name, "of them": sum(holds(row) for row in rows)}
        for name, holds in (
            ("reference of an error up to 1e-12", lambda row: float(row["error"]) <= 1e-12),
            ("certified reference", lambda row: row["certified"] == "yes"),
            ("other velocities were met", lambda row: row["other velocities"] > 0),
        )
    ]
    return found


def self_stresses(files: list[Path], time_limit: float) -> list[dict[str, Any]]:
    """What the self-stress proves of problems of each kind and size."""
    kinds: dict[str, list[tuple[int, str, float]]] = defaultdict(list)
    for path in files:
        problem = fclib.read(path)
        start = time.process_time()
        found = analysis.analyze(problem, time_limit=time_limit).self_stress.verdict
        kinds[path.stem.rpartition("-")[0]].append((problem.nc, found, time.process_time() - start))
    rows = []
    for kind, own in kinds.items():
        sizes, verdicts, times = zip(*own, strict=True)
        verdict = ", ".join(f"{n} {word}" for word, n in sorted(Counter(verdicts).items()))
        rows.append(
            {
                "kind": kind,
                "contacts": " to ".join(map(str, dict.fromkeys((min(sizes), max(sizes))))),
                "problems": len(own),
                "self-stress": verdict,
                "median CPU of the analysis [s]": statistics.median(times),
            }
        )
    return rows


def main() -> None:
    """Print a line for each problem, and store the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--time-limit", type=float, default=60.0, help="[s] of each solve")
    parser.add_argument("--self-stress", action="store_true", help="only what it proves")
    _results.add_option(parser)
    arguments = parser.parse_args()
    if arguments.self_stress:
        proofs = self_stresses(arguments.files, arguments.time_limit)
        print(_results.table(list(proofs[0]), proofs))
        if arguments.results:
            note = '"Solvable" is proven; seconds are of CPU.'
            title = "Problems and their self-stress"
            _results.store(arguments.results, proofs, title=title, note=note)
        return
    rows = []
    for path in arguments.files:
        rows.append(row_of(path, arguments.time_limit))
        print(", ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
    found = counts(rows)
    for line in found:
        print(f"{line['verdict']}: {line['of them']}")
    if arguments.results:
        note = f"At most {arguments.time_limit:g} s of wall-clock time a solve; seconds are of CPU."
        _results.store(arguments.results, rows, title="What the problems are", note=note)
        _results.store(f"{arguments.results}-counts", found, title="Problems by verdict", note=note)


if __name__ == "__main__":
    main()
