"""The readable report of the published runs: its tables, its pictures and its page.

    python -m workshop.tables.published

It runs nothing. It reads the parts in results/ and writes docs/results/published-*.csv,
docs/images/published-*.png and docs/published-results.md, which quotes them. A set is the name of
its parts, or chosen from such runs. What nothing is published of is left out. The ranks and the
conditioning are those that `problem_facts.py` has stored.
"""

from __future__ import annotations

import argparse
import json
import math
import textwrap
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np

from fclib import results, scenes
from fclib._verdicts import is_solved
from fclib.bench import comparison, plots, profiles
from fclib.bench.calibration import Calibration, calibration_in
from fclib.bench.comparison import Array, Costs, odds, words_in
from fclib.bench.table import Table
from fclib.collections import set_index
from fclib.results.boards import CHOSEN_FROM, PART_OF, by_name, digests_of, sources
from workshop.tables import _results, problem_facts
from workshop.tables.campaign import HINDSIGHT, beside_siconos

Row: TypeAlias = dict[str, Any]

WEIGH: Final[profiles.Weigh] = "families"
DRAWN: Final = 10  # solvers in a picture
SHOWN: Final = 5  # families with failures that a row names
PAGE: Final = _results.ROOT / "docs" / "published-results.md"
IMAGES: Final = _results.ROOT / "docs" / "images"
LEAST_BESIDE: Final = 10  # problems that both solve: a mean of fewer says nothing of a set
SEQUENCES: Final = "sequences"  # the set whose runs are along sequences
CHOSEN: Final = CHOSEN_FROM.keys() - PART_OF.keys()
# what favours a solver: how the problems of a set were taken, or an older version
TAKEN: Final = {
    "candidates-long": "The sets `standard`, `hard` and `open` [were chosen]"
    "(collection.md#a-set-to-benchmark-with) by the runs of `candidates` and `candidates-long`. At "
    "most half of the solvers of `candidates` solve the problems of `candidates-long`. `auto` and "
    "the solvers of `matrix` had no part in the choice. A problem was taken if some of the other "
    "solvers fail on it. So the sets favour `auto` and the solvers of `matrix`. The figures show "
    "who solves what, and what nobody solves. They show less well by how much `auto` is better.",
    "hard": "The campaign `hard` was cut: on some of its problems all solvers have run, on the "
    "others those of `candidates-long` and a few more. So the figures compare those of "
    "`candidates-long`. The table of who solves what has all.",
    "matrix-peers": "`standard-peers` has the problems of `standard` that the solvers of other "
    "programs have run, with their default options, beside the runs of `candidates` and "
    "`matrix` on these. Short solves of Siconos were timed in ticks of the clock, which are some "
    "milliseconds long. So single times of this size are coarse.",
    "faf2018": "In `faf2018` the tolerance bounds the natural map alone, as in [the comparison of "
    "2018](published-2018.md). The largest problems have hardly run, and the solvers of Siconos on "
    "fewer problems than ours.",
    "rt444": "The campaign `rt444` was cut: its first problems have run, by all solvers, with a "
    "smaller limit than it asks for. Solvers that need long fail under it.",
    "sequences": "In all these runs on rolling friction, Gauss-Seidel solved a contact by ten "
    "projections. Now it uses Newton's method, which needs far fewer sweeps. So the runs of "
    "`nsgs`, `psor` and `ppa-nsgs` on rolling problems understate what these solvers do now.",
}
# facts of a problem whose effect is asked for: the column, and its words
EFFECTS: Final = {
    "nc": "contacts",
    "density": "contact components for a degree of freedom",
    "rank ratio": "rank of W over its size",
    "conditioning_W": "conditioning of W",
}

# what is asked of a fact and a family of methods: whether the time grows with the fact
ASKED: Final = {
    ("density", "splitting"): "sweeps take longer on dense problems",
    ("density", "proximal point"): "proximal points take longer on dense problems",
    ("conditioning_W", "splitting"): "sweeps take longer if W is conditioned worse",
    ("conditioning_W", "interior point"): "interior points take longer if W is conditioned worse",
}

BESIDE: Final = (
    "A ratio is the CPU time of `auto` over that of the solver of Siconos that is the fastest on "
    "the problem. Nobody knows before which one that is."
)
RATIO: Final = "cold CPU / warm CPU"
WARM: Final = (
    "Each step of the simulations in `sequences` is solved from nothing (cold), and from the "
    "solution that the same solver found for the step before (warm). The ratio is the CPU time of "
    "all steps, cold over warm: the larger, the more the guess is worth. A failed run counts with "
    "the time that it took. The mean is geometric, over the families. In most of these simulations "
    "bodies collide or roll, so the reactions change much from step to step. In `Gripper` they "
    "hardly do."
)


@dataclass(frozen=True)
class Set:
    """The published runs of a set."""

    name: str
    parts: Sequence[results.Shard]
    rows: Table  # cold runs
    every: Costs
    costs: Costs  # on the set that is compared
    caption: str  # on machines

    @property
    def tolerances(self) -> list[float]:
        """The tolerances, the largest first."""
        return self.costs.tolerances


def main() -> None:
    """Write the report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--parts", type=Path, help="folder of the parts")
    own = parser.parse_args()
    folder = own.parts or results.folder()
    parts = results.shards(folder) if folder else []
    if not parts:
        raise SystemExit("no runs are published here")
    groups = by_name(parts)
    facts = problem_facts.read()
    page: list[str] = []
    sets = []
    for name, shards in sources(groups).items():
        if name == SEQUENCES:
            with results.alone([shard.path for shard in shards]) as joined:
                rows = profiles.load(joined.path, start=None)
                page += warm(joined.path, rows)
        elif one := set_of(name, shards):
            sets.append(one)
    page = [*of_sets(sets, groups, facts), *(["## Warm or cold?", "", *page] if page else [])]
    PAGE.write_text("\n".join([*HEAD, *page]).rstrip() + "\n", encoding="utf-8")
    print(PAGE)


def set_of(name: str, shards: Sequence[results.Shard]) -> Set | None:
    """The runs of a set, gathered; None if there is none."""
    own = digests_of(name, shards)
    if not own:
        return None
    # only its problems, so that a solver has no version in its name if others had another one
    with results.alone([shard.path for shard in shards], own) as joined:
        rows = profiles.load(joined.path)
    every = profiles.gather(rows)
    return Set(name, shards, rows, every, comparison.compared(every), str(joined))


def prose(words: str) -> list[str]:
    """A paragraph of the page."""
    return [*textwrap.wrap(words, 118, break_on_hyphens=False), ""]


HEAD: Final = [
    "# What the published runs say",
    "",
    "<!-- made by: python -m workshop.tables.published -->",
    "",
    *prose(
        "One command makes this page from the [published runs](published-runs.md). No figure on it"
        " is typed. [The glossary](glossary.md) explains the words, and [what is"
        " measured](measurement.md) how runs are measured."
    ),
]


def of_sets(
    sets: Sequence[Set],
    groups: Mapping[str, Sequence[results.Shard]],
    facts: Mapping[str, problem_facts.Facts],
) -> Iterator[str]:
    """The parts of the page on sets."""
    yield from ("## What was run?", "")
    yield from prose(
        "`planned` is the number of runs that the last command of the campaign asked for. `runs` "
        "counts those of all its commands. So it is larger than `planned` if earlier commands "
        "asked for other problems or solvers. It is smaller if solvers failed, because the "
        "renumbered copies of such runs are left out. It is also smaller if the campaign was cut. "
        "The order of a campaign makes each first part of it balanced over the families. `load` is "
        "the load of the machine when a run began. If it is above the number of cores, times are "
        "longer than on a quiet machine."
    )
    yield from table("published-parts", [part_row(n, own) for n, own in groups.items()],
                     "Published runs", "")  # fmt: skip
    for name in groups:
        if name in TAKEN:
            yield from prose(TAKEN[name])
    noise = [row for one in sets for row in noise_rows(one)]
    if noise:
        yield from ("## How much is noise?", "")
        yield from prose(
            "Some runs are repeated at other times, on renumbered copies of the problem. The table "
            "shows by how much the slowest of them takes longer than the fastest."
        )
        yield from table("published-noise", noise, "The spread of repeats", "")
    yield from ("## Who solves how much, and how fast?", "")
    yield from table("published-solvers", [row for one in sets for row in solver_rows(one)],
                     "The solvers", "; ".join(caption_of(one) for one in sets) + ".")  # fmt: skip
    telling = [
        one for one in sets if np.isfinite(one.costs.values).any()
    ]  # `open` is solved by none
    for one in telling:
        yield from pictures(one)
    yield from ("## Who solves what?", "")
    yield from prose(
        "The tables count the problems of each family that a solver solves. Here a problem is "
        "solved only if its renumbered copy is solved too, as the rule of the sets asks. `1 of 3` "
        "says that the solver takes three of them, or has run three. A dash says that there is "
        "none."
    )
    for one in sets:
        for tol in one.tolerances:
            yield from table(f"published-matrix-{one.name}-{_results.power(tol)}",
                             matrix_rows(one, tol),
                             f"{one.name} to {_results.power(tol)}, by family", "")  # fmt: skip
    statuses = sorted({row["status"] for one in sets for row in one.rows if not row["copy"]})
    ends = [status for status in statuses if status != "unsuitable" and not is_solved(status)]
    failures = [row for one in sets for row in failure_rows(one, ends)]
    if failures:
        yield from ("## Who fails where, and why?", "")
        yield from table("published-failures", failures, "What ends the runs that fail",
                         "Each solver on the problems that it has run and takes.")  # fmt: skip
    told = BESIDE  # once
    for one in telling:
        own = one.every.at(one.tolerances[-1])
        if (rows := beside_siconos(own)) and both_solve(rows) >= LEAST_BESIDE:
            note = f"Each problem of {one.name} weighs the same; limit {own.instances[0].limit:g} s"
            yield from (f"## How does the default solver compare with Siconos on `{one.name}`?", "")
            yield from prose(told) if told else ()
            told = ""
            yield from table(
                f"published-{one.name}-siconos", rows, HINDSIGHT, f"{note}; {one.caption}."
            )
    yield from ("## Which family of methods for which kind of problem?", "")
    yield from table("published-kinds", [row for one in telling for row in kind_rows(one)],
                     "The best of each family of methods, by kind of problem",
                     "The best solver is the one that solves most, then the fastest.")  # fmt: skip
    found = {one.name: list(effects_of(one, facts)) for one in telling}
    effects = [effect_row(one, own) for one in telling for own in found[one.name]]
    if effects:
        yield from ("## What do size, density, rank and conditioning do?", "")
        yield from prose(
            "The problems of a set are halved at the median of a fact. `shift of the share` is "
            "the share of solved problems in the upper half, less that in the lower half. The CPU "
            "time of solved problems grows with a power of the fact: `exponent` is this power, "
            "with the interval of a bootstrap over problems. The power of the number of contacts "
            "is fitted together with that of any other fact. So the exponent of a fact is that "
            "among problems of one size. Its shift may still come from size, because large "
            "problems differ from small ones in all facts. The problems of a family are alike, and "
            "the interval does not know it: it is too small rather than too large. Rank and "
            "conditioning are left out if W is large, and the degrees of freedom if the problem is "
            "in local form."
        )
        yield from table(
            "published-effects", effects, "The effect of a fact on a family of methods", ""
        )
    yield from ("## What would the best of all be?", "")
    yield from table("published-best", [row for one in telling for row in best_rows(one)],
                     "The virtual best, and the best two and three solvers together",
                     "Chosen in hindsight: nobody knows it before.")  # fmt: skip
    yield from ("## What follows?", "")
    yield from ("<!-- figures: the level of the intervals, which is set -->", "")
    yield from prose(
        "A statement is carried by the data if its 95 % interval lies on one side of the bound."
    )
    statements = [row for one in telling for row in conclusions(one, found[one.name])]
    yield from table(
        "published-conclusions", statements, "Statements, and whether the data carry them", ""
    )


def caption_of(one: Set) -> str:
    """What the runs of a set are."""
    return f"{one.name}: {profiles.caption(one.costs, one.rows, WEIGH)}; {one.caption}"


def table(name: str, rows: Sequence[Row], title: str, note: str) -> list[str]:
    """Store a table, and the line of the page that quotes it; nothing if it has no row.

    A table that says what it said before is left, with the commit that made it.
    """
    if not rows:
        return []
    # sets have other families of methods, for example
    columns = list(dict.fromkeys(key for row in rows for key in row))
    whole = [{key: row.get(key, "") for key in columns} for row in rows]
    path = (_results.FOLDER / name).with_suffix(".csv")
    about = path.with_suffix(".json")
    known = json.loads(about.read_text(encoding="utf-8")) if about.is_file() else {}
    same = known.get("title") == title and known.get("note") == note and path.is_file()
    if not same or path.read_text(encoding="utf-8") != _results.table(columns, whole):
        _results.store(name, whole, title=title, note=note)
    return [f"[Table: {title}](results/{name}.csv)", ""]


# ---- what was run


def both_solve(rows: Sequence[Row]) -> int:
    """How many problems the table of `beside_siconos` compares."""
    return next(int(row["value"]) for row in rows if row["figure"] == "solved by both")


def part_row(name: str, parts: Sequence[results.Shard]) -> Row:
    """A row on the parts of a set."""
    names = ("hash", "solver", "cpu_s", "total_cpu_s", "load", "measured", "started", "node", "tol")
    rows = [row for part in parts for row in results.rows_of(part.path, names)]
    loads = np.array([row["load"] for row in rows if row["load"] is not None])
    days = sorted(
        time.strftime("%Y-%m-%d", time.gmtime(row["started"])) for row in rows if row["started"]
    )
    begun = [c for part in parts for c in part.campaigns]
    last = max(begun, key=lambda c: c["started"] or 0, default={"planned": 0})
    spent = math.fsum(row["total_cpu_s"] or 0.0 for row in rows if row["measured"] != "history")
    machines = dict.fromkeys(node for part in parts for node in part.machines)
    known: list[Calibration | None] = []  # machines of one name may be several
    for part in parts:
        found = [calibration_in(facts) for facts in part.machines.values()]
        known += [one for one in found if one not in known]
    return {
        "set": name,
        "runs": len(rows),
        "planned": int(last["planned"] or 0),
        "read off histories": sum(row["measured"] == "history" for row in rows),
        "problems": len({row["hash"] for row in rows}),
        "solvers": len({row["solver"] for row in rows}),
        "CPU [h]": spent / 3600,
        "median load": float(np.median(loads)) if loads.size else "",
        "largest load": float(loads.max()) if loads.size else "",
        "machine": ", ".join(machines),
        "spread of the calibration": ", ".join(f"{c.spread:.1%}" for c in known if c) or "none",
        "dates": " to ".join(dict.fromkeys((days[0], days[-1]))) if days else "",
    }


def noise_rows(one: Set) -> list[Row]:
    """By tolerance: the spread of copies, in the median and of nine in ten."""
    found = []
    for tol in one.every.tolerances:
        part = one.every.at(tol)
        assert part.copies is not None
        own = part.copies[np.isfinite(part.copies)]
        if own.size:
            medium, most = np.quantile(own, (0.5, 0.9))
            found.append(
                {
                    "set": one.name,
                    "tolerance": _results.power(tol),
                    "pairs of solver and problem": own.size,
                    "spread of half": f"{100 * medium:.0f} %",
                    "spread of nine in ten": f"{100 * most:.0f} %",
                }
            )
    return found


# ---- solvers


def solver_rows(one: Set) -> list[Row]:
    """The solvers of a set as they are compared."""
    found = []
    for tol in one.tolerances:
        for row in profiles.summary(one.costs.at(tol), weigh=WEIGH):
            low, high = odds(row["solved"], row["of"])
            found.append(
                {
                    "set": one.name,
                    "tolerance": _results.power(tol),
                    "solver": row["solver"].partition(" (")[0],
                    "solved": f"{row['solved']} of {row['of']}",
                    "95 % interval": f"{low:.2f} to {high:.2f}",
                    "fastest": row["fastest"],
                    "mean [s]": row["mean"],
                    "to best": row["to best"],
                }
            )
    return found


def matrix_rows(one: Set, tol: float) -> list[Row]:
    """By family: how many problems each solver solves, with their copies, of those it takes."""
    solved: dict[tuple[str, str], bool] = {}
    family: dict[str, str] = {}
    for row in one.rows:
        if row["tol"] == tol and row["status"] != "unsuitable":
            key = row["hash"], row["solver"].partition(" (")[0]
            solved[key] = solved.get(key, True) and is_solved(row["status"])
            whole, _ = PART_OF.get(one.name, (one.name, ""))
            family[row["hash"]] = set_index.kind_of(f"{whole}/{row['family']}")
    solvers = list(dict.fromkeys(solver for _, solver in solved))
    found = []
    for name in (*sorted(set(family.values())), ""):
        own = [digest for digest, of in family.items() if name in ("", of)]
        row = {"family": name or "all", "problems": len(own)}
        for solver in solvers:
            mine = [solved[digest, solver] for digest in own if (digest, solver) in solved]
            # a solver may take a part of them, or have run a part of them
            count: object = sum(mine)
            if len(mine) < len(own):
                count = f"{count} of {len(mine)}" if mine else "-"
            row[solver] = count
        found.append(row)
    return found


def drawn(one: Set, costs: Costs) -> list[str]:
    """The best solvers; those of other programs are half of them if the set is for these."""
    best = [row["solver"] for row in profiles.summary(costs, weigh=WEIGH)[1:]]
    if one.name in PART_OF:
        theirs = [name for name in best if ":" in name][: DRAWN // 2]
        best = [name for name in best if ":" not in name][: DRAWN - len(theirs)] + theirs
    return best[:DRAWN]


def pictures(one: Set) -> Iterator[str]:
    """Draw the profile of the best solvers at each tolerance, and the work-precision of a set."""
    for tol in one.tolerances:
        costs = one.costs.at(tol)
        part = costs.chosen(drawn(one, costs))
        name = f"published-{one.name}-{_results.power(tol)}"
        draw(name, profile_of(part))
        yield from image(name, f"{one.name} to {_results.power(tol)}: the best solvers")
    if len(one.tolerances) > 1:
        points = profiles.work_precision(one.rows, one.costs, weigh=WEIGH)
        chosen = drawn(one, one.costs.at(one.tolerances[-1]))
        own = [point for point in points if point["solver"] in chosen]
        name = f"published-{one.name}-work"
        draw(name, lambda out: plots.work_precision(own, "cpu_s", out, ["png"]))
        yield from image(name, f"{one.name}: the mean time of each tolerance")


def profile_of(costs: Costs) -> Callable[[Path], None]:
    """What draws the performance profile of some costs."""
    return lambda out: plots.performance(costs, out, ["png"], weigh=WEIGH)


def draw(name: str, drawing: Callable[[Path], None]) -> None:
    """A picture of the bench as docs/images/NAME.png, small enough for a page."""
    import tempfile

    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        drawing(Path(folder))
        (path,) = Path(folder).glob("*.png")
        with Image.open(path) as drawn:
            size = (900, round(900 * drawn.height / drawn.width))
            small = drawn.convert("RGB").resize(size).quantize(64)
            small.save(IMAGES / f"{name}.png", optimize=True)


def image(name: str, words: str) -> list[str]:
    """The lines of a page that show a picture."""
    return [
        "<!-- figures: the tolerance, which is set -->",
        f'<img src="images/{name}.png" width="700"',
        f'     alt="{words}">',
        "",
    ]


# ---- failures and kinds


def failure_rows(one: Set, statuses: Sequence[str]) -> list[Row]:
    """By tolerance and solver: what ended the runs that failed, and in which families most did."""
    ends: dict[tuple[float, str], Counter[str]] = defaultdict(Counter)
    failed: dict[tuple[float, str], Counter[str]] = defaultdict(Counter)
    for row in one.rows:
        if row["status"] == "unsuitable" or row["copy"]:
            continue
        own = -row["tol"], row["solver"].partition(" (")[0]
        if is_solved(row["status"]):
            ends[own]["solved"] += 1
        else:
            ends[own][row["status"]] += 1
            failed[own][row["family"]] += 1
    return [
        {
            "set": one.name,
            "tolerance": _results.power(-tol),
            "solver": solver,
            "solved": count["solved"],
            **{name: count[name] for name in statuses},
            "families with most failures": ", ".join(
                f"{family} {n}" for family, n in failed[tol, solver].most_common(SHOWN)
            ),
        }
        for (tol, solver), count in sorted(ends.items())
    ]


def methods_of(one: Set) -> dict[str, list[str]]:
    """The solvers of each family of methods."""
    own: dict[str, list[str]] = defaultdict(list)
    names, families = (words_in(one.rows, name).tolist() for name in ("solver", "solver_family"))
    known = dict(zip(names, families, strict=True))
    for solver in one.costs.solvers:
        own[known.get(solver) or "another"].append(solver)
    return dict(sorted(own.items()))


def kind_of(family: str) -> str:
    """The kind of the problems of a family: the set that it is of first."""
    known = scenes.families() | scenes.assemblies()
    # a list may call it otherwise
    listed = (set_index.kind_of(f"{name}/{family}") for name in CHOSEN)
    family = next((own for own in listed if own in known), family)
    return known[family].collection if family in known else family


def best_in(costs: Costs, solvers: Sequence[str]) -> tuple[str, Array]:
    """The solver that solves most, the fastest of these, and its costs."""
    part = costs.chosen(solvers)
    (best, *_) = profiles.summary(part, weigh=WEIGH)[1:]
    return best["solver"], part.values[:, part.solvers.index(best["solver"])]


def kind_rows(one: Set) -> list[Row]:
    """By kind and tolerance: the best solver of each family of methods."""
    found = []
    for tol in one.tolerances:
        costs = one.costs.at(tol)
        kinds: dict[str, list[int]] = defaultdict(list)
        for k, instance in enumerate(costs.instances):
            kinds[kind_of(instance.family)].append(k)
        for kind, places in sorted(kinds.items()):
            part = costs.on_instances(places)
            row = {
                "set": one.name,
                "tolerance": _results.power(tol),
                "kind": kind,
                "problems": len(places),
            }
            for method, solvers in methods_of(one).items():
                name, values = best_in(part, solvers)
                solved = int(np.isfinite(values).sum())
                both = np.isfinite(values) & np.isfinite(part.best)
                words = f"{name.partition(' (')[0]} {solved}"
                if solved:
                    ratio = np.exp(np.log(values[both] / part.best[both]).mean())
                    words += f", {ratio:.2g} x"
                row[method] = words
            found.append(row)
    return found


# ---- effects


@dataclass(frozen=True)
class Effect:
    """What a fact does to the best solver of a family of methods, to a tolerance."""

    tol: float
    fact: str
    method: str
    solver: str
    shift: float  # of the share of solved problems, from the lower half to the upper one
    exponent: float  # nan if too few problems are solved
    low: float
    high: float


def effects_of(one: Set, facts: Mapping[str, problem_facts.Facts]) -> Iterator[Effect]:
    """The effect of each fact on each family of methods, of facts that enough problems have."""
    for tol in one.tolerances:
        costs = one.costs.at(tol)
        sizes = np.array([float(instance.nc) for instance in costs.instances])
        for fact in EFFECTS:
            known = [
                instance.nc if fact == "nc" else facts.get(instance.hash, {}).get(fact)
                for instance in costs.instances
            ]
            values = np.array([math.nan if x is None else float(x) for x in known])
            there = np.flatnonzero(np.isfinite(values) & (values > 0))
            if len(there) < 8 or len(np.unique(values[there])) < 4:
                continue
            part = costs.on_instances(there.tolist())
            other = None if fact == "nc" else sizes[there]
            for method, solvers in methods_of(one).items():
                name, own = best_in(part, solvers)
                solver = name.partition(" (")[0]
                yield Effect(tol, fact, method, solver, *effect(values[there], own, other))


def effect_row(one: Set, found: Effect) -> Row:
    """A row of the table of effects."""
    known = math.isfinite(found.exponent)
    return {
        "set": one.name,
        "tolerance": _results.power(found.tol),
        "fact": EFFECTS[found.fact],
        "methods": found.method,
        "solver": found.solver,
        "shift of the share": f"{found.shift:+.2f}",
        "exponent": f"{found.exponent:.2f}" if known else "",
        "95 % interval": f"{found.low:.2f} to {found.high:.2f}" if known else "",
    }


def effect(
    values: Array, costs: Array, sizes: Array | None = None
) -> tuple[float, float, float, float]:
    """The shift of the share that is solved, and the exponent of the time, with its interval.

    With sizes, the exponent is that among problems of one size: their power is fitted too.
    """
    upper = values > np.median(values)
    solved = np.isfinite(costs)
    shift = float(solved[upper].mean() - solved[~upper].mean()) if upper.any() else 0.0
    x, y = np.log(values[solved]), np.log(costs[solved])
    columns = [x, np.ones(len(x))]
    if sizes is not None:
        columns.append(np.log(sizes[solved]))
    terms = np.column_stack(columns)
    if len(x) < 8 or np.linalg.matrix_rank(terms) < len(columns):
        return shift, math.nan, math.nan, math.nan
    rng = np.random.default_rng(0)
    slopes = []
    for _ in range(500):
        drawn = rng.integers(0, len(x), len(x))
        if np.linalg.matrix_rank(terms[drawn]) == len(columns):
            slopes.append(slope(terms[drawn], y[drawn]))
    low, high = np.quantile(slopes, (0.025, 0.975))
    return shift, slope(terms, y), float(low), float(high)


def slope(terms: Array, y: Array) -> float:
    """The factor of the first term, by least squares."""
    return float(np.linalg.lstsq(terms, y, rcond=None)[0][0])


# ---- the best of all


def best_rows(one: Set) -> list[Row]:
    """By tolerance: the virtual best, and the best one, two and three solvers."""
    found = []
    for tol in one.tolerances:
        costs = one.costs.at(tol)
        charges = profiles.PENALTY * costs.charges
        whole = np.where(np.isfinite(costs.values), costs.values, charges[:, None])
        chosen: list[int] = []
        for _ in range(min(3, len(costs.solvers))):  # greedily: the one that helps most
            means = [mean_of(whole[:, [*chosen, k]].min(axis=1)) for k in range(whole.shape[1])]
            chosen.append(int(np.argmin(means)))
            found.append(best_row(one, tol, costs, chosen))
        found.append(best_row(one, tol, costs, range(len(costs.solvers))))
    return found


def best_row(one: Set, tol: float, costs: Costs, chosen: Sequence[int]) -> Row:
    """What some solvers together do, if the fastest of them is known."""
    values = comparison.least(costs.values[:, list(chosen)])
    whole = np.where(np.isfinite(values), values, profiles.PENALTY * costs.charges)
    names = [costs.solvers[k].partition(" (")[0] for k in chosen]
    return {
        "set": one.name,
        "tolerance": _results.power(tol),
        "solvers": " + ".join(names) if len(names) <= 3 else f"all {len(names)}",
        "solved": f"{int(np.isfinite(values).sum())} of {len(values)}",
        "mean [s]": mean_of(whole),
    }


def mean_of(values: Array) -> float:
    """The shifted geometric mean."""
    return float(np.expm1(np.log1p(values / profiles.SHIFT).mean()) * profiles.SHIFT)


# ---- conclusions


def conclusions(one: Set, effects: Sequence[Effect]) -> list[Row]:
    """Statements on a set, each with an interval and a bound."""
    found = []
    for tol in one.tolerances:
        costs = one.costs.at(tol)
        count = len(costs.instances)
        quotients = profiles.ratios(costs.values)
        rows = profiles.summary(costs, weigh=WEIGH)[1:]
        place = costs.solvers.index(rows[0]["solver"])
        wins = (quotients == 1).sum(axis=0)
        most = int(wins.argmax())
        near = int((quotients[:, place] <= 2).sum())

        def say(
            statement: str, figure: float, low: float, high: float, bound: float, below: bool,
            tol: float = tol,
        ) -> None:  # fmt: skip
            carried = high < bound if below else low > bound
            found.append(
                {
                    "set": one.name,
                    "tolerance": _results.power(tol),
                    "statement": statement,
                    "figure": f"{figure:.3g}",
                    "95 % interval": f"{low:.3g} to {high:.3g}",
                    "bound": f"{'below' if below else 'above'} {bound:g}",
                    "carried": "yes" if carried else "no",
                }
            )

        name = costs.solvers[most].partition(" (")[0]
        say(f"no solver is the fastest on most problems (the most often fastest is {name}): share",
            wins[most] / count, *odds(int(wins[most]), count), 0.5, True)  # fmt: skip
        name = rows[0]["solver"].partition(" (")[0]
        say(f"no universal solver: the best one ({name}) is within twice the best: share",
            near / count, *odds(near, count), 0.95, True)  # fmt: skip
        say(f"the best solver ({name}) solves nearly all: share", rows[0]["solved"] / count,
            *odds(rows[0]["solved"], count), 0.95, False)  # fmt: skip
        for row in rows[1:2]:
            (pair,) = profiles.pairs(
                costs.chosen([row["solver"], rows[0]["solver"]]), rows[0]["solver"], weigh=WEIGH
            )
            if pair.both:
                second = row["solver"].partition(" (")[0]
                say(f"{second}, the next one, is slower than {name}: ratio of times",
                    pair.ratio, pair.low, pair.high, 1.0, False)  # fmt: skip
        methods = methods_of(one)
        if {"newton", "splitting"} <= methods.keys():
            first, _ = best_in(costs, methods["newton"])
            second, _ = best_in(costs, methods["splitting"])
            (pair,) = profiles.pairs(costs.chosen([first, second]), second, weigh=WEIGH)
            if pair.both:
                names = [one_of.partition(" (")[0] for one_of in (first, second)]
                words = f"Newton ({names[0]}) is faster than sweeps ({names[1]}): ratio of times"
                say(words,
                    pair.ratio, pair.low, pair.high, 1.0, True)  # fmt: skip
        for own in effects:
            if own.tol == tol and (own.fact, own.method) in ASKED and math.isfinite(own.exponent):
                say(f"{ASKED[own.fact, own.method]} ({own.solver}): exponent, at one size",
                    own.exponent, own.low, own.high, 0.0, False)  # fmt: skip
    return found


# ---- sequences


def warm(store: Path, rows: Table) -> Iterator[str]:
    """What a guess is worth: by solver, and by family and solver."""
    found: dict[str, dict[str, dict[str, Any]]] = defaultdict(dict)
    for row in profiles.along(store, rows):
        family = row["sequence"].partition(",")[0].rpartition("/")[2]
        found[row["solver"].partition(" (")[0]][family] = row
    means = {
        solver: math.exp(np.mean([math.log(row[RATIO]) for row in own.values()]))
        for solver, own in found.items()
    }
    order = sorted(means, key=lambda solver: -means[solver])
    yield from prose(WARM)
    yield from table(
        "published-warm",
        [warm_row(solver, found[solver], means[solver]) for solver in order],
        "What a guess is worth, by solver",
        "",
    )
    yield from table(
        "published-warm-families",
        [
            {
                "family": family,
                **{
                    solver: f"{found[solver][family][RATIO]:.2f}" if family in found[solver] else ""
                    for solver in order
                },
            }
            for family in sorted({family for own in found.values() for family in own})
        ],
        "Time from nothing over time from the step before",
        "",
    )


def warm_row(solver: str, own: Mapping[str, Mapping[str, Any]], mean: float) -> Row:
    """A row of the table by solver."""
    least = min(own, key=lambda family: own[family][RATIO])
    most = max(own, key=lambda family: own[family][RATIO])
    return {
        "solver": solver,
        "cold over warm, mean": f"{mean:.2f}",
        "least": f"{own[least][RATIO]:.2f} ({least})",
        "most": f"{own[most][RATIO]:.2f} ({most})",
        **{
            name: sum(row[name] for row in own.values())
            for name in ("solved warm", "solved cold", "of")
        },
    }


if __name__ == "__main__":
    main()
