"""The table of docs/analysis.md: what problems are, and how far they are solved.

python benchmarks/analysis_table.py FILE... [--time-limit 10] [--csv OUT]
"""

from __future__ import annotations

import argparse
import csv
import time
from collections import Counter
from pathlib import Path
from typing import Any

import fclib
from fclib import analysis


def row_of(path: Path, time_limit: float) -> dict[str, Any]:
    """Analysis and reference of one problem."""
    problem = fclib.read(path)
    start = time.perf_counter()
    found = analysis.analyze(problem, time_limit=time_limit)
    analysed = time.perf_counter()
    solved = analysis.reference(problem, time_limit=time_limit)
    end = time.perf_counter()
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
        "unique": found.uniqueness.verdict,
        "error": f"{solved.error:.0e}",
        "second": f"{second.solver}, {second.start}" if second else "-",
        "differs": f"{second.difference:.0e}" if second else "-",
        "reaction": solved.reaction,
        "others": len(solved.others),
        "certified": "yes" if solved.certified else f"no: {solved.reason}",
        "analysis [s]": f"{analysed - start:.2f}",
        "reference [s]": f"{end - analysed:.2f}",
    }


def main() -> None:
    """Prints Markdown."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--time-limit", type=float, default=10.0, help="[s] of each run")
    parser.add_argument("--csv", type=Path)
    arguments = parser.parse_args()
    rows = []
    for path in arguments.files:
        rows.append(row_of(path, arguments.time_limit))
        if len(rows) == 1:
            print("| " + " | ".join(rows[0]) + " |")
            print("|" + "---|" * len(rows[0]))
        print("| " + " | ".join(str(value) for value in rows[-1].values()) + " |", flush=True)
    print()
    for key in ("existence", "certified", "reaction"):
        print(f"{key}: {dict(Counter(row[key] for row in rows))}")
    if arguments.csv:
        with arguments.csv.open("w", newline="") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
