"""How difficult candidates are: their table, their files, and the campaigns over them.

    DIR/candidates.csv        a row for each candidate (select.py)
    DIR/costs.csv             CPU of each family: its simulation, and its rows
    DIR/problems/FAMILY/      a file for each candidate that is measured
    DIR/difficult/FAMILY/     links to those that are run under the longer limit
    DIR/difficulty.sqlite, DIR/difficulty-long.sqlite     the stores of both campaigns

Each part goes on after a kill.
"""

from __future__ import annotations

import csv
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from fclib import _core, _digest
from fclib.bench import Campaign, Store
from fclib.collections import ratings
from workshop.sets import candidates, select
from workshop.tables._results import FOLDER

TABLE: Final = "candidates.csv"
COSTS: Final = "costs.csv"
KNOWN_COSTS: Final = FOLDER / "candidates-cost.csv"  # of an earlier time
# the campaign under each limit, and the folder of its problems
CAMPAIGNS: Final = {
    select.SHORT: ("difficulty", "problems"),
    select.LONG: ("difficulty-long", "difficult"),
}
VARIABLE: Final = "FCLIB_CANDIDATES"  # environment variable: DIR, for the campaigns

# what may go wrong with the data of a family, or with files
FAULTS: Final = (ImportError, OSError, ValueError, FloatingPointError, MemoryError, _core.Error)


def store_of(folder: Path, limit: float) -> Path:
    """The store of the campaign under a limit."""
    return folder / f"{CAMPAIGNS[limit][0]}.sqlite"


def cpu() -> float:
    """CPU time of this process and of those that it waited for [s]."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


# ---- the table


def known_costs(folder: Path) -> dict[str, float]:
    """CPU [s] that each family took, here or at an earlier time."""
    found: dict[str, float] = {}
    for path in (KNOWN_COSTS, folder / COSTS):
        if path.is_file():
            with path.open(newline="", encoding="utf-8") as file:
                found |= {row["family"]: float(row["CPU [s]"]) for row in csv.DictReader(file)}
    found.pop("all", None)
    return found


def estimate(folder: Path, names: Sequence[str]) -> str:
    """What the table needs, in words."""
    table = folder / TABLE
    done = {select.folder_of(row) for row in select.read_table(table)} if table.is_file() else set()
    todo = [name for name in names if name not in done]
    known = known_costs(folder)
    hours = sum(known.get(name, 0.0) for name in todo) / 3600
    new = [name for name in todo if name not in known]
    steps = {name: candidates.steps_to_simulate(name) for name in new}
    simulated = [f"{name} ({count})" for name, count in steps.items() if count]
    words = f"{len(todo)} of {len(names)} families are to be described"
    if len(todo) > len(new):
        words += f": {hours:.2g} h of CPU for {len(todo) - len(new)} of them, as at an earlier time"
    if simulated:
        words += f"; of unknown cost are simulations, with their steps: {', '.join(simulated)}"
    return words


def describe(
    folder: Path, names: Sequence[str], progress: select.Progress | None = None
) -> tuple[list[dict[str, Any]], dict[str, str]]:
    """The rows of families, and why others have none. The table is written after each family.

    A family whose rows the table has is left as it is. One that fails does not stop the others.
    """
    table = folder / TABLE
    rows = select.read_table(table) if table.is_file() else []
    costs = known_costs(folder)
    failed: dict[str, str] = {}
    for name in names:
        start = cpu()
        own = [row for row in rows if select.folder_of(row) == name]
        try:
            found = candidates.candidates_of(name, folder, progress=progress)
            if own and select.describes(own, found):
                continue
            own = select.described(found, progress)
        except FAULTS as error:
            failed[name] = str(error)
            own = []
        rows = [row for row in rows if select.folder_of(row) != name] + own
        select.write_table(table, rows)
        costs[name] = cpu() - start
        write_costs(folder / COSTS, costs)
    return [row for row in select.read_table(table) if select.folder_of(row) in names], failed


def write_costs(path: Path, costs: Mapping[str, float]) -> None:
    """Write the CPU of each family."""
    lines = [f"{name},{value:.1f}\n" for name, value in sorted(costs.items())]
    path.write_text("family,CPU [s]\n" + "".join(lines), encoding="utf-8")


def write_problems(
    folder: Path, rows: Sequence[select.Row], rule: select.Rule
) -> tuple[int, dict[str, str]]:
    """Write a file for each candidate that is to be run; remove those that are not measured.

    A candidate whose runs the stores have needs none, so published runs need not be made again.

    Returns:
        The number of measured candidates, and why a family or a problem cannot be written.
    """
    measures = {
        path_of(folder, row): row
        for row, words in zip(rows, select.not_measured(rows, rule), strict=True)
        if not words
    }
    for path in (folder / "problems").glob("*/*.hdf5"):
        if path not in measures:
            path.unlink()
    longer = {path_of(folder, rows[k]) for k in select.for_longer(rows, rule)}
    failed: dict[str, str] = {}
    sources: dict[str, candidates.Candidates] = {}
    for path, row in measures.items():
        name = select.folder_of(row)
        limits = [select.SHORT] + [select.LONG] * (path in longer)
        done = all(select.share_solved(row, limit) is not None for limit in limits)
        if done or path.is_file() or name in failed:
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        whose = name
        try:
            if name not in sources:
                sources = {name: candidates.candidates_of(name, folder)}  # one in memory
            whose = str(row["problem"])
            problem = sources[name].problem(int(row["number"]))
            if _digest.digest(problem) != row["digest"]:
                raise ValueError("its data are not those of the table")
            _core.write(path, problem)
        except FAULTS as error:
            failed[whose] = str(error)
    return len(measures), failed


def path_of(folder: Path, row: select.Row) -> Path:
    """The file of a candidate. The digest tells it from one of an earlier scene."""
    name = f"{int(row['number']):04d}-{row['digest'][:8]}.hdf5"
    return folder / "problems" / str(row["label"]) / name


# ---- the campaigns


def needed(folder: Path, limit: float, files: int) -> str:
    """The CPU that a campaign needs, in words: a bound, and what its runs so far suggest."""
    name, _ = CAMPAIGNS[limit]
    campaign = Campaign.read(name)
    runs = files * len(campaign.solvers) * campaign.repeats
    words = f"{name}: {runs} runs on {files} problems, at most {runs * limit / 3600:.3g} h of CPU"
    path = store_of(folder, limit)
    if not path.is_file():
        return words
    with Store(path, create=False) as store:
        spent = [run["total_cpu_s"] or 0.0 for run in store.results(start="cold")]
    if not spent:
        return words
    left = max(0, runs - len(spent)) * sum(spent) / len(spent) / 3600
    return f"{words}; {len(spent)} are done, about {left:.3g} h of CPU are left at their mean"


def run(folder: Path, limit: float, jobs: int) -> None:
    """Run a campaign on its files, or go on with it. CalledProcessError if it could not."""
    name, _ = CAMPAIGNS[limit]
    fclib = str(Path(sys.executable).with_name("fclib"))
    command = [fclib, "bench", name, "--store", str(store_of(folder, limit)), "-j", str(jobs)]
    done = subprocess.run(command, env={**os.environ, VARIABLE: str(folder.resolve())})
    # runs that failed are what is measured; a campaign that could not be done is an error
    if done.returncode not in (0, 1) or not store_of(folder, limit).is_file():
        raise subprocess.CalledProcessError(done.returncode, command)


def measured(folder: Path) -> list[dict[str, Any]]:
    """The rows of the table, with what the stores have."""
    rows = select.read_table(folder / TABLE)
    stores = {limit: store_of(folder, limit) for limit in CAMPAIGNS}
    there = {k: path for k, path in stores.items() if path.is_file()}
    return select.measured(rows, there, [run for run in ratings.runs() if run.limit is None])


def link_difficult(folder: Path, rule: select.Rule) -> int:
    """Link the problems that are run under the longer limit. Return their number."""
    links = folder / "difficult"
    shutil.rmtree(links, ignore_errors=True)
    rows = measured(folder)
    paths = [path_of(folder, rows[k]) for k in select.for_longer(rows, rule)]
    paths = [path for path in paths if path.is_file()]
    for path in paths:
        link = links / path.parent.name / path.name
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(path.resolve())
    return len(paths)
