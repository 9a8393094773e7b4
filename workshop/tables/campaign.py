"""Run a campaign of campaigns/ within a budget, and store the tables of it that pages quote.

    python -m workshop.tables.campaign rt444 --budget 10min --time-limit 1
    python -m workshop.tables.campaign rt444 --from-store       # runs nothing
    python -m workshop.tables.campaign walls --table runs --results walls

The store is build/campaigns/NAME.sqlite; the same command goes on with it. A budget bounds the time
of the runs, and each run ends at --time-limit; what that leaves out is said in the note of the
tables. `make campaigns` packs stores and tables. --table says which tables are made:

solvers    the solvers as `fclib profile` compares them (RESULTS), and the fastest solver of each
           problem, by family (RESULTS-families)
solved     who solves what: by family and solver (RESULTS-solved)
pairs      each solver beside that of Siconos of the same family, at each tolerance (RESULTS-TOL)
hindsight  `auto` beside the fastest solver of Siconos on each problem, at the last tolerance
ends       by family (or set) and solver: how many are solved, and what ends the others
runs       each run: time, memory, and how the time grows with the contacts
along      sequences: the solution of the step before as a guess, against none
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib import bench, scenes
from fclib._verdicts import is_solved
from fclib.bench import campaign, comparison, profiles, runner
from fclib.bench.table import Table as Runs
from workshop.tables import _results

Row: TypeAlias = dict[str, Any]
Times: TypeAlias = npt.NDArray[np.float64]

STORES = _results.ROOT / "build" / "campaigns"
WEIGH: profiles.Weigh = "families"  # so that a large family decides no figure
COARSE = "doubles are too coarse"  # how the message begins if rounding ends a solve
LARGE = 100  # contacts from which on the time is that of the solver, not that of the call
SHORT = 50e-6  # [s] below this the call is much of the time
SICONOS = "siconos:"
HINDSIGHT = "`auto` beside the fastest solver of Siconos, picked in hindsight"
# each solver, with its options, and the one of Siconos beside it; "" if there is none
PAIRS = (
    ("nsgs", "nsgs"),
    ("nsgs", "nsgs-quartic"),
    ("nsgs local_solver=projection", "nsgs-projection"),
    ("psor", "nsgs"),
    ("fp-ds", "dsfp"),
    ("fp-vi-upk", "vi-fp"),
    ("fp-vi-upts", "vi-fp"),
    ("fp-eg-upk", "vi-eg"),
    ("fp-eg-upts", "vi-eg"),
    ("hyperplane", "hp"),
    ("nsn-ac", "nsn-ac"),
    ("nsn-jm", "nsn-ac"),
    ("nsn-nm", "nsn-nm"),
    ("nsn-fb", "nsn-fb"),
    ("ppa-nsn", "prox"),
    ("ppa-nsgs", "prox"),
    ("panagiotopoulos", "pfp"),
    ("tresca", "tfp"),
    ("aclm", "aclmfp"),
    ("admm", "admm"),
    ("apgd", ""),
    ("bb", ""),
    ("nsip", ""),
    ("homotopy", ""),
    ("auto", ""),
)


def main() -> None:
    """Run it, and write the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("name", help="a campaign of campaigns/")
    parser.add_argument("--budget", default="10min")
    parser.add_argument("--time-limit", help="[s] of CPU a run, instead of the campaign's own")
    parser.add_argument("--wall-limit", help="[s] of the clock a run, on a machine that is shared")
    parser.add_argument("--sample", help="so many problems of each group")
    parser.add_argument("--repeats", help="instead of the campaign's own")
    parser.add_argument("--jobs", default="1")
    parser.add_argument("--from-store", action="store_true", help="run nothing")
    parser.add_argument("--table", choices=[*TABLES], default="solvers")
    parser.add_argument("--by-set", action="store_true", help="ends: by set in place of family")
    parser.add_argument("--columns", nargs="+", help="solved, ends: only these")
    _results.add_option(parser)
    arguments = parser.parse_args()
    store = STORES / f"{arguments.name}.sqlite"
    if not arguments.from_store:
        STORES.mkdir(parents=True, exist_ok=True)
        command = [str(Path(sys.executable).with_name("fclib")), "bench", arguments.name]
        command += ["--store", str(store), "--budget", arguments.budget, "-j", arguments.jobs]
        for option in ("time_limit", "wall_limit", "sample", "repeats"):
            if (value := getattr(arguments, option)) is not None:
                command += [f"--{option.replace('_', '-')}", value]
        if code := subprocess.run(command).returncode:
            raise SystemExit(code)
    for table in TABLES[arguments.table](store, arguments):
        name = f"{arguments.results or f'campaign-{arguments.name}'}{table.ending}"
        title = table.title.format(name=arguments.name)
        _results.store(name, table.rows, title=title, note=table.note)
        print(_results.table(list(table.rows[0]), table.rows))


@dataclass(frozen=True)
class Table:
    """A table of docs/results/."""

    rows: list[Row]
    title: str  # {name} is that of the campaign
    note: str
    ending: str = ""  # of its name


def solved(store: Path, asked: argparse.Namespace) -> list[Table]:
    """How many problems of each family each solver solves, and which ones not all of them do.

    Each solver has its own set here: the problems that it has run and takes.
    """
    rows = profiles.load(store)
    whole = comparison.compared(profiles.gather(rows), own_set=True)
    titles = comparison.names_of(whole.instances)
    order = sorted(range(len(whole.solvers)), key=lambda k: whole.solvers[k])
    table = []
    for family in sorted({one.family for one in whole.instances}):
        places = [k for k, one in enumerate(whole.instances) if one.family == family]
        part = whole.on_instances(places)
        sizes = [one.nc for one in part.instances]
        ends = dict.fromkeys((min(sizes), max(sizes)))
        cells: dict[str, Any] = {"family": family, "contacts": " to ".join(map(str, ends))}
        counts = part.counts()
        for k in order:
            solved, of = counts[k]
            cells[short(whole.solvers[k])] = f"{solved} of {of}" if of else "takes none"
        missed = []
        for place, own in zip(places, part.values, strict=True):
            names = [short(whole.solvers[k]) for k in order if np.isinf(own[k])]
            if names:
                missed.append(f"{titles[place]}: {', '.join(names)}")
        cells["not solved"] = "; ".join(sorted(missed))
        table.append(cells)
    note = profiles.caption(whole, rows, "instances", own_set=True) + "."
    return [Table(some(table, asked.columns), "Campaign {name}: who solves what", note, "-solved")]


def some(table: list[Row], columns: Sequence[str] | None) -> list[Row]:
    """Some columns of a table; all if none are asked for. SystemExit if it lacks one."""
    if unknown := [name for name in columns or () if name not in table[0]]:
        raise SystemExit(f"no column {unknown[0]!r}; there is: {', '.join(table[0])}")
    return [{name: row[name] for name in columns} for row in table] if columns else table


def short(solver: str) -> str:
    """The label of a solver, without its version."""
    return solver.partition(" (")[0]


def compared(store: Path, _: argparse.Namespace) -> list[Table]:
    """The tables of a store: on the common set; each family weighs the same."""
    rows = profiles.load(store)
    every = profiles.gather(rows)
    whole = comparison.compared(every)
    with bench.Store(store, create=False) as opened:
        first = opened.status()[0]
        runs = opened.table(more=("key",))
    spent = runner.budget_used(runs, set(runs["key"].values))
    note = (
        f"{profiles.caption(whole, rows, WEIGH)}. {first.done} of the campaign's {first.planned}"
        f" runs, in {spent / 60:.0f} min of runs."
    )
    for row in profiles.left_out(every, whole):
        note += (
            f" Not compared: {short(row['solver'])}, which solves {row['solved']} of the"
            f" {row['of']} that it has run to {_results.power(row['tol'])}."
        )
    if busy := sum(profiles.loaded(rows).values()):
        note += f" {busy} of {len(rows)} runs were begun under a load above the number of cores."
    solvers: list[dict[str, Any]] = []
    for tol in whole.tolerances:
        costs = whole.at(tol)
        bounds = np.array([2.0, 10.0])
        within = profiles.performance_profile(costs.values, bounds, costs.weights(WEIGH))
        shares = dict(zip(costs.solvers, within.tolist(), strict=True))
        for row in profiles.summary(costs, weigh=WEIGH):
            two, ten = shares.get(row["solver"], (1.0, 1.0))
            solvers.append(
                {
                    "tolerance": _results.power(tol),
                    "solver": short(row["solver"]),
                    "solved": f"{row['solved']} of {row['of']}",
                    "share": f"{100 * row['share']:.0f} %",
                    "fastest": row["fastest"],
                    "mean [s]": row["mean"],
                    "to best": row["to best"],
                    "within 2x": f"{100 * two:.0f} %",
                    "within 10x": f"{100 * ten:.0f} %",
                }
            )
    families = family_rows(whole, campaign.published_means(store))
    return [
        Table(solvers, "Campaign {name}: the solvers", note),
        Table(families, "Campaign {name}: the fastest solver of each problem", note, "-families"),
    ]


def family_rows(costs: profiles.Costs, published: Mapping[tuple[str, float], float]) -> list[Row]:
    """The fastest solver of each problem, by family and tolerance, beside published means."""
    return [
        {
            "family": row["family"],
            "problems": row["problems"],
            "contacts": row["contacts"],
            "tolerance": _results.power(row["tol"]),
            "mean of the fastest [s]": row["mean of fastest"],
            **({"published [s]": row["published"] or ""} if "published" in row else {}),
            "unsolved": row["unsolved"],
            "most often the fastest": short(row["most often fastest"]),
        }
        for row in profiles.families(costs, published)
    ]


# ---- beside Siconos


def costs_of(store: Path) -> tuple[profiles.Costs, Runs]:
    """The costs on the common set, the solvers without their versions; and the runs."""
    rows = profiles.load(store)
    whole = comparison.compared(profiles.gather(rows))
    return replace(whole, solvers=tuple(map(short, whole.solvers))), rows


def pairs(store: Path, _: argparse.Namespace) -> list[Table]:
    """Each solver beside that of Siconos of the same family."""
    whole, rows = costs_of(store)
    listed = {ours for ours, _ in PAIRS}
    own = [name for name in whole.solvers if not name.startswith(SICONOS)]
    if forgotten := [name for name in own if name not in listed]:
        raise SystemExit(f"PAIRS has no {', '.join(forgotten)}")
    tables = []
    for tol in whole.tolerances:
        part = whole.at(tol)
        places = {name: k for k, name in enumerate(part.solvers)}
        summary = {row["solver"]: row for row in profiles.summary(part)}
        table = []
        for ours, name in PAIRS:
            theirs = SICONOS + name if name else ""
            if ours not in places or (theirs and theirs not in places):
                continue  # it was not run
            sides = [ours, theirs] if theirs else [ours]
            ratio = ""
            if theirs:
                both = part.values[:, [places[side] for side in sides]]
                both = both[np.isfinite(both).all(axis=1)]
                middle = f"{np.median(both[:, 0] / both[:, 1]):.3f} " if len(both) else ""
                ratio = f"{middle}({len(both)})"
            table.append(
                {
                    "ours": ours,
                    "Siconos'": name or "none",
                    "solved": " : ".join(str(summary[side]["solved"]) for side in sides),
                    "fastest on": " : ".join(str(summary[side]["fastest"]) for side in sides),
                    "shifted mean [ms]": " : ".join(
                        f"{1e3 * summary[side]['mean']:.3g}" for side in sides
                    ),
                    "median CPU ratio (of)": ratio,
                }
            )
        title = "Solvers beside those of Siconos of the same family"
        note = f"{profiles.caption(part, rows)}."
        tables.append(Table(table, title, note, f"-{_results.power(tol)}"))
    return tables


def hindsight_figures(ours: Times, best: Times, contacts: npt.NDArray[np.int64]) -> list[Row]:
    """Figures of the CPU times [s] of `auto` and of the best of others; inf is not solved."""
    both = np.isfinite(ours) & np.isfinite(best)
    ratios = ours[both] / best[both]
    large = ratios[contacts[both] >= LARGE]
    long = ratios[best[both] >= SHORT]
    found: list[tuple[str, Any]] = [
        ("problems", len(ours)),
        ("solved by auto", int(np.isfinite(ours).sum())),
        ("solved by one of Siconos", int(np.isfinite(best).sum())),
        ("solved by both", len(ratios)),
        ("solved by auto alone", int((np.isfinite(ours) & ~both).sum())),
        ("solved by one of Siconos alone", int((np.isfinite(best) & ~both).sum())),
    ]
    if len(ratios):
        found += [
            ("geometric mean of CPU ratios", statistics.geometric_mean(ratios)),
            ("median CPU ratio", statistics.median(ratios)),
            ("worst CPU ratio", max(ratios)),
        ]
    found.append((f"solved by both, those of Siconos in {1e6 * SHORT:g} us or more", len(long)))
    if len(long):
        found.append(("geometric mean of these", statistics.geometric_mean(long)))
    found.append((f"solved by both from {LARGE} contacts on", len(large)))
    if len(large):
        mean = statistics.geometric_mean(large)
        found.append((f"geometric mean from {LARGE} contacts on", mean))
    return [
        {"figure": name, "value": f"{value:.3f}" if isinstance(value, float) else value}
        for name, value in found
    ]


def hindsight(store: Path, _: argparse.Namespace) -> list[Table]:
    """`auto` beside the fastest solver of Siconos, picked after the runs for each problem."""
    whole, rows = costs_of(store)
    part = whole.at(whole.tolerances[-1])
    table = beside_siconos(part)
    if not table:
        raise SystemExit(f"{store}: has no runs of auto, or none of Siconos")
    return [Table(table, HINDSIGHT, f"{profiles.caption(part, rows)}.")]


def beside_siconos(costs: profiles.Costs) -> list[Row]:
    """The figures of `auto` and of the fastest solver of Siconos; none if one has not run.

    On the problems that `auto` and some solver of Siconos take.
    """
    names = [short(name) for name in costs.solvers]
    theirs = [k for k, name in enumerate(names) if name.startswith(SICONOS)]
    if "auto" not in names or not theirs:
        return []
    own = names.index("auto")
    taken = costs.there[:, own] & costs.there[:, theirs].any(axis=1)
    part = costs.on_instances(np.flatnonzero(taken).tolist())
    contacts = np.array([one.nc for one in part.instances])
    return hindsight_figures(
        part.values[:, own], comparison.least(part.values[:, theirs]), contacts
    )


# ---- what ends the runs


def ends(store: Path, asked: argparse.Namespace) -> list[Table]:
    """By family or set and solver: what is solved, and what ends the others."""
    rows = profiles.load(store, more=("message", "stages"))
    kinds = scenes.families() | scenes.assemblies()
    groups: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        kind = kinds[row["family"]].collection if asked.by_set else row["family"]
        groups[kind, short(row["solver"])].append(row)
    several = len(groups) > len({solver for _, solver in groups})
    table = [ending(*key, own) for key, own in sorted(groups.items())]
    if several and asked.by_set:
        for solver in sorted({solver for _, solver in groups}):
            every = [row for (_, one), own in groups.items() if one == solver for row in own]
            table.append({**ending("all", solver, every), "last stages": ""})
    if not asked.by_set:
        table = [{("family" if k == "set" else k): v for k, v in row.items()} for row in table]
    table = some(table, asked.columns)
    note = f"{profiles.caption(profiles.gather(rows), rows, 'instances', own_set=True)}."
    return [Table(table, "Campaign {name}: what is solved, and what ends the others", note)]


def ending(kind: str, solver: str, runs: Sequence[Row]) -> Row:
    """A row of `ends`."""

    def how(row: Row) -> str:
        if is_solved(row["status"]):
            return str(row["status"])
        return "rounding" if (row["message"] or "").startswith(COARSE) else "rest"

    count = Counter(how(row) for row in runs)
    solved = [row for row in runs if is_solved(row["status"])]
    missed = [row["error"] for row in runs if not is_solved(row["status"]) and row["error"]]
    contacts = dict.fromkeys((min(row["nc"] for row in runs), max(row["nc"] for row in runs)))
    limits = dict.fromkeys(sorted(row["time_limit"] for row in runs))
    spent = [row["total_cpu_s"] for row in runs]
    stages: Counter[str] = Counter()
    times: Counter[str] = Counter()
    for row in runs:
        name = last_stage(row)
        stages[name] += row["status"] == "converged"
        times[name] += row["total_cpu_s"]
    return {
        "set": kind,
        "solver": solver,
        "contacts": " to ".join(map(str, contacts)),
        "limit [s]": " to ".join(f"{limit:g}" for limit in limits),
        "problems": len(runs),
        "solved": count["converged"],
        "no solution": count["infeasible"],
        "ended by rounding": count["rounding"],
        "others": count["rest"],
        "errors of those": f"{min(missed):.0e} to {max(missed):.0e}" if missed else "",
        "median iterations": round(statistics.median(r["iterations"] for r in solved))
        if solved
        else "",
        "median CPU of the solved [s]": statistics.median(row["total_cpu_s"] for row in solved)
        if solved
        else "",
        "median CPU [s]": statistics.median(spent),
        "largest CPU [s]": max(spent),
        "CPU of all [s]": math.fsum(spent),
        "last stages": ", ".join(
            f"{name} {n} ({100 * times[name] / max(times.total(), 1e-9):.0f} % of CPU)"
            for name, n in stages.most_common()
            if n and name
        ),
    }


def last_stage(row: Row) -> str:
    """The stage of a chain that solved, or that the solve ended in; "" of another solver."""
    if row["solver_family"] != "chain":
        return ""
    tried: list[Row] = json.loads(row["stages"]) if row["stages"] else []
    solved = [stage for stage in tried if stage["solved"]]
    return str((solved or tried or [{"name": "none"}])[-1]["name"])


def runs(store: Path, _: argparse.Namespace) -> list[Table]:
    """Each run, by size; the exponent is that of the CPU time, if the size before is solved too."""
    rows = profiles.load(store, more=("stages",))
    table: list[Row] = []
    before: dict[tuple[str, str], Row] = {}
    order = ("family", "nc", "solver", "tol")
    for row in sorted(rows, key=lambda row: tuple(row[name] for name in order)):
        solver = short(row["solver"])
        last = before.get((row["family"], solver))
        exponent: float | str = ""
        both = last is not None and is_solved(row["status"]) and is_solved(last["status"])
        if both and last is not None and row["nc"] > last["nc"]:
            times = math.log(row["total_cpu_s"] / last["total_cpu_s"])
            exponent = times / math.log(row["nc"] / last["nc"])
        stages = json.loads(row["stages"]) if row["stages"] else []
        table.append(
            {
                "family": row["family"],
                "contacts": row["nc"],
                "solver": solver,
                "ends": row["status"],
                "error": row["error"] if row["error"] is not None else "",
                "CPU [s]": row["total_cpu_s"],
                "wall clock [s]": row["wall_s"],
                "factorisations": sum(stage["factorisations"] for stage in stages),
                "memory [GB]": row["memory_mb"] / 1e3,
                "load": row["load"],
                "exponent": exponent,
            }
        )
        before[row["family"], solver] = row
    note = f"{profiles.caption(profiles.gather(rows), rows, own_set=True)}; load is that of the"
    note += " machine as the solve began."
    return [Table(table, "Campaign {name}: each run", note)]


def along(store: Path, _: argparse.Namespace) -> list[Table]:
    """Sequences: warm against cold runs."""
    rows = profiles.load(store, start=None)
    table = [
        {
            "family": row["sequence"].partition(",")[0].rpartition("/")[2],
            "solver": row["solver"],
            "cold CPU / warm CPU": f"{row['cold CPU / warm CPU']:.2f}",
            "iterations warm": row["iterations warm"],
            "cold": row["iterations cold"],
            "solved warm": row["solved warm"],
            "solved cold": row["solved cold"],
            "of": row["of"],
            "drift of u": "-" if row["drift"] is None else f"{row['drift']:.0e}",
        }
        for row in profiles.along(store, rows)
    ]
    load, limit = max(row["load"] for row in rows), max(row["time_limit"] for row in rows)
    tols = ", ".join(f"{tol:g}" for tol in sorted({row["tol"] for row in rows}))
    note = (
        f"tolerance {tols}, {limit:g} s of CPU a solve, steps that follow each other; load up to "
        f"{load:.1f}"
    )
    return [Table(table, "Warm against cold along sequences", note)]


TABLES = {
    "solvers": compared,
    "solved": solved,
    "pairs": pairs,
    "hindsight": hindsight,
    "ends": ends,
    "runs": runs,
    "along": along,
}


if __name__ == "__main__":
    main()
