"""Every built-in solver beside Siconos' solver of the same family, in one run on one machine.

    python -m workshop.tables.families FILE... [--tol 1e-4 1e-8] [--limit 60]
        [--only nsgs admm ...] [--csv RUNS] [--results NAME]

Problems, times and tolerances are as in against_siconos.py. The table has, for each pair and each
tolerance: the problems solved; on how many a solver is the fastest of all, ours and theirs; the
shifted geometric mean of the CPU times, a failure counted as ten times the limit; and the median
ratio of the CPU times on the problems that both solve.

The relaxations are left out: they solve another problem than Coulomb's law. A solver that did not
reach one tolerance is not asked for a tighter one. --csv appends a line a run, and skips the runs
it has: a run of hours may be cut short, and the table is then made of the file. --results stores
the table of each tolerance as NAME-TOLERANCE.
"""

from __future__ import annotations

import argparse
import csv
import math
import statistics
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import fclib
from workshop.tables import _results
from workshop.tables.against_siconos import Run, measure, read, require_siconos

SHIFT = 1e-3  # [s] of the geometric mean: shorter solves hardly count
CHARGE = 10.0  # limits, for a failure


@dataclass(frozen=True)
class Pair:
    """A solver of fclib with options, and the one of Siconos beside it, if there is one."""

    solver: str
    siconos: str = ""
    options: str = ""  # name=value

    @property
    def ours(self) -> str:
        """As it is shown."""
        return f"{self.solver} {self.options}".strip()

    @property
    def theirs(self) -> str:
        """The solver's name, or nothing."""
        return f"siconos:{self.siconos}" if self.siconos else ""


PAIRS = (
    Pair("nsgs", "nsgs"),
    Pair("nsgs", "nsgs-quartic"),
    Pair("nsgs", "nsgs-projection", "local_solver=projection"),
    Pair("psor", "nsgs"),
    Pair("fp-ds", "dsfp"),
    Pair("fp-vi-upk", "vi-fp"),
    Pair("fp-vi-upts", "vi-fp"),
    Pair("fp-eg-upk", "vi-eg"),
    Pair("fp-eg-upts", "vi-eg"),
    Pair("hyperplane", "hp"),
    Pair("nsn-ac", "nsn-ac"),
    Pair("nsn-jm", "nsn-ac"),
    Pair("nsn-nm", "nsn-nm"),
    Pair("nsn-fb", "nsn-fb"),
    Pair("ppa-nsn", "prox"),
    Pair("ppa-nsgs", "prox"),
    Pair("panagiotopoulos", "pfp"),
    Pair("tresca", "tfp"),
    Pair("aclm", "aclmfp"),
    Pair("admm", "admm"),
    Pair("apgd"),
    Pair("bb"),
    Pair("nsip"),
    Pair("homotopy"),
    Pair("auto"),
)

# problem, solver as it is shown, tolerance
Key: TypeAlias = tuple[str, str, float]
FIELDS = ("problem", "nc", "name", "tol", "limit", "solved", "cpu_s", "iterations", "error")


def without_pair() -> list[str]:
    """The built-in solvers that the table forgets."""
    listed = {pair.solver for pair in PAIRS}
    built_in = [info for info in fclib.solvers() if info.origin == "fclib"]
    return [i.name for i in built_in if i.family != "relaxation" and i.name not in listed]


def names(pairs: Iterable[Pair]) -> dict[str, tuple[str, dict[str, str]]]:
    """The solvers of the pairs as they are shown, each once, with their options."""
    found: dict[str, tuple[str, dict[str, str]]] = {}
    for pair in pairs:
        options = dict(option.split("=") for option in pair.options.split())
        found[pair.ours] = pair.solver, options
        if pair.theirs:
            found[pair.theirs] = pair.theirs, {}
    return found


def load(path: Path | None) -> dict[Key, Run]:
    """The runs of a file."""
    if path is None or not path.exists():
        return {}
    with path.open(newline="") as file:
        return {
            (row["problem"], row["name"], float(row["tol"])): Run(
                row["name"],
                row["solved"] == "True",
                float(row["cpu_s"]),
                int(row["iterations"]),
                float(row["error"]),
            )
            for row in csv.DictReader(file)
        }


def run_all(
    files: Sequence[Path],
    pairs: Sequence[Pair],
    tolerances: Sequence[float],
    limit: float,
    known: dict[Key, Run],
) -> Iterator[dict[str, object]]:
    """All runs that are not known, which they are afterwards; problem by problem, loosest first."""
    for path in files:
        problem = read(path)
        for tol in sorted(tolerances, reverse=True):
            for name, (solver, options) in names(pairs).items():
                key = path.stem, name, tol
                if key in known:
                    continue
                looser = [known[path.stem, name, t] for t in tolerances if t > tol]
                failed = next((run for run in looser if not run.solved), None)
                run = failed or measure(problem, solver, tol, limit, **options)
                known[key] = run
                yield {
                    "problem": path.stem,
                    "nc": problem.nc,
                    "name": name,
                    "tol": tol,
                    "limit": limit,
                    "solved": run.solved,
                    "cpu_s": run.cpu_s,
                    "iterations": run.iterations,
                    "error": run.error,
                }


def shifted_mean(runs: Iterable[Run], limit: float) -> float:
    """[s] the geometric mean of t + SHIFT, less SHIFT."""
    times = [run.cpu_s if run.solved else CHARGE * limit for run in runs]
    return math.exp(statistics.fmean(math.log(t + SHIFT) for t in times)) - SHIFT


def table(
    files: Sequence[Path], pairs: Sequence[Pair], tol: float, limit: float, known: dict[Key, Run]
) -> list[dict[str, str]]:
    """The table of one tolerance."""
    shown = names(pairs)
    runs = {name: [known[path.stem, name, tol] for path in files] for name in shown}
    fastest: dict[str, int] = defaultdict(int)
    for k in range(len(files)):
        solved = [name for name in runs if runs[name][k].solved]
        if solved:
            fastest[min(solved, key=lambda name: runs[name][k].cpu_s)] += 1
    rows = []
    for pair in pairs:
        sides = [pair.ours, *([pair.theirs] if pair.theirs else [])]
        ratio = ""
        if pair.theirs:
            both = zip(runs[pair.ours], runs[pair.theirs], strict=True)
            ratios = [a.cpu_s / b.cpu_s for a, b in both if a.solved and b.solved]
            ratio = f"{statistics.median(ratios):.3f} ({len(ratios)})" if ratios else "(0)"
        means = [f"{1e3 * shifted_mean(runs[s], limit):.3g}" for s in sides]
        rows.append(
            {
                "ours": pair.ours,
                "Siconos'": pair.siconos or "none",
                "solved": " : ".join(str(sum(run.solved for run in runs[s])) for s in sides),
                "fastest on": " : ".join(str(fastest[s]) for s in sides),
                "shifted mean [ms]": " : ".join(means),
                "median CPU ratio (of)": ratio,
            }
        )
    return rows


def main() -> None:
    """Run what is to be run, and print a table a tolerance."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--tol", nargs="+", type=float, default=[1e-4, 1e-8])
    parser.add_argument("--limit", type=float, default=60.0, help="[s] for each solve")
    parser.add_argument("--only", nargs="+", choices=sorted({pair.solver for pair in PAIRS}))
    parser.add_argument("--csv", type=Path, help="append the runs there, and skip those it has")
    _results.add_option(parser)
    arguments = parser.parse_args()
    require_siconos()
    if forgotten := without_pair():
        parser.error(f"the pairs have no {', '.join(forgotten)}")
    pairs = [p for p in PAIRS if arguments.only is None or p.solver in arguments.only]
    known = load(arguments.csv)
    rows = run_all(arguments.files, pairs, arguments.tol, arguments.limit, known)
    if arguments.csv:
        new = not arguments.csv.exists()
        with arguments.csv.open("a", newline="") as file:
            writer = csv.DictWriter(file, FIELDS)
            if new:
                writer.writeheader()
            for row in rows:
                writer.writerow(row)
                file.flush()
    else:
        for _ in rows:
            pass
    for tol in sorted(arguments.tol, reverse=True):
        found = table(arguments.files, pairs, tol, arguments.limit, known)
        print(f"\n{len(arguments.files)} problems at {tol:g}, {arguments.limit:g} s each\n")
        print(f"| {' | '.join(found[0])} |\n{'|---' * len(found[0])}|")
        for line in found:
            print(f"| {' | '.join(line.values())} |")
        if arguments.results:
            _results.store(
                f"{arguments.results}-{_results.power(tol)}",
                found,
                title="Solvers beside those of Siconos of the same family",
                note=f"{len(arguments.files)} problems to {_results.power(tol)}, at most "
                f"{arguments.limit:g} s of wall-clock time a solve.",
            )


if __name__ == "__main__":
    main()
