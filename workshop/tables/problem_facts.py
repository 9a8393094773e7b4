"""Facts of the problems that published runs are of: density, rank of W, conditioning of W.

    python -m workshop.tables.problem_facts FILE...         of the problems in files
    python -m workshop.tables.problem_facts --candidates    those that the choice of the sets knows

They are written to results/fclib_results/facts.csv, a row for each digest. A problem that no
published run is of is left out, and one that is there stays as it is. `published.py` reads them.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import fclib
from fclib import _digest, results
from fclib._files import write_text
from workshop.sets import features
from workshop.tables import _results

TABLE: Final = _results.ROOT / "results" / "fclib_results" / "facts.csv"
CHOICE: Final = _results.ROOT / "collection" / "fclib_collection" / "results" / "choice-1.csv"
COLUMNS: Final = ("problem", "density", "rank ratio", "conditioning_W")
MOST: Final = 3000  # rows of W above which its spectrum, which is dense work, is not found

Facts = Mapping[str, float | None]


def read(path: Path = TABLE) -> dict[str, dict[str, float | None]]:
    """The facts of each problem by its digest; nothing if there is no table."""
    if not path.is_file():
        return {}
    with path.open(newline="", encoding="utf-8") as file:
        return {
            row["problem"]: {k: float(row[k]) if row[k] else None for k in COLUMNS[1:]}
            for row in csv.DictReader(file)
        }


def write(facts: Mapping[str, Facts], path: Path = TABLE) -> None:
    """Write the table, sorted, numbers with six digits."""
    lines = [",".join(COLUMNS)]
    for digest, row in sorted(facts.items()):
        values = (row[k] for k in COLUMNS[1:])
        lines.append(",".join([digest, *("" if v is None else f"{v:.6g}" for v in values)]))
    write_text(path, "\n".join(lines) + "\n")


def facts_of(problem: Any) -> dict[str, float | None]:
    """The facts of a problem; None for what is not known, as the density of a local one."""
    rows = problem.nc * problem.spacedim
    rank, conditioning = features.spectrum_of(problem, rows, MOST)
    freedoms = getattr(problem, "n", 0)
    return {
        "density": rows / freedoms if freedoms else None,
        "rank ratio": rank / rows if rank and rows else None,
        "conditioning_W": conditioning or None,
    }


def of_candidates(path: Path = CHOICE) -> dict[str, dict[str, float | None]]:
    """The facts of the candidates of the sets."""

    def number(text: str) -> float | None:
        return float(text) if text else None

    found = {}
    with path.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            ratio = number(row["rank_ratio"])  # rows of W over its rank
            found[row["digest"]] = {
                "density": number(row["density"]),
                "rank ratio": 1 / ratio if ratio else None,
                "conditioning_W": number(row["conditioning"]),
            }
    return found


def published() -> set[str]:
    """The digests of all problems that published runs are of."""
    folder = results.folder()
    parts = results.shards(folder) if folder else []
    return {row["hash"] for part in parts for row in results.rows_of(part.path, ("hash",))}


def main(words: Iterable[str] | None = None) -> None:
    """Add the facts of problems to the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--candidates", action="store_true", help="those of the sets' choice")
    given = parser.parse_args(None if words is None else list(words))
    wanted, facts = published(), read()
    before = len(facts)
    if given.candidates:
        facts |= {k: row for k, row in of_candidates().items() if k in wanted and k not in facts}
    for path in given.files:
        problem = fclib.read(path)
        digest = _digest.digest(problem)
        if digest in wanted and digest not in facts:
            facts[digest] = facts_of(problem)
    write(facts)
    print(f"{TABLE}: {len(facts)} problems, {len(facts) - before} of them new")


if __name__ == "__main__":
    main()
