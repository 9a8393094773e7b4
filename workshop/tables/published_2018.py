"""The comparison of 2018 beside ours: its curves, its means, and what the distances point to.

    python -m workshop.tables.published_2018 CURVES.csv

It runs nothing. It reads the parts of the campaign faf2018 in results/, and writes
docs/results/published-2018*.csv, docs/images/published-2018-*.png and docs/published-2018.md,
which quotes them. CURVES.csv has the curves of Acary, Bremond & Huber, "On solving contact problems
with Coulomb friction: formulations and numerical comparisons" (2018), as they were read from its
figures: set, tolerance, limit_s, solver, tau, share.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from fclib import results
from fclib.bench import campaign, plots, profiles
from fclib.bench.comparison import Array, Costs
from workshop.tables import _results, published
from workshop.tables.campaign import family_rows
from workshop.tables.published import Row, Set, image, prose, table

Curve: TypeAlias = list[tuple[float, float]]  # the steps (tau, share)
Curves: TypeAlias = Mapping[str, Curve]  # by solver

NAME: Final = "faf2018"  # of the campaign and of its parts
CAMPAIGN: Final = _results.ROOT / "campaigns" / f"{NAME}.toml"
PAGE: Final = _results.ROOT / "docs" / "published-2018.md"
# families as the campaign calls them, and as the curves of the paper do
SETS: Final = {"Aqueduct_PR": "AqueducPR", "BoxesStack": "BoxesStack1"}
# solvers of the paper, and Siconos' own implementation of the same method
OWN: Final = {
    "NSGS-AC": "siconos:nsgs",
    "NSGS-FP-VI-UPK tol 1e-14": "siconos:nsgs-projection",
    "EG-VI-UPK": "siconos:vi-eg",
    "NSN-AC": "siconos:nsn-ac",
    "PPA-NSN-AC-GP adaptive": "siconos:prox",
    "TRESCA-NSGS-FP-VI-UPK": "siconos:tfp",
    "ACLM-NSGS-FP-VI": "siconos:aclmfp",
}
BAND: Final = 1.36  # of Kolmogorov & Smirnov's 95 % band, times 1 / sqrt(n)
WIDE: Final = 0.5  # a wider band tells nothing
CHANCE, CODE, PROBLEMS, BOTH = "chance", "the implementation", "the problems", "both"
FEW, OPEN = "too few problems", "not told apart"

HEAD: Final = [
    "# The comparison of 2018, anew",
    "",
    "<!-- made by: python -m workshop.tables.published_2018 -->",
    "",
    *prose(
        "V. Acary, M. Bremond and O. Huber compared solvers of Siconos on problems of "
        "FCLIB (*On solving contact problems with Coulomb friction: formulations and numerical "
        "comparisons*, 2018). Here our solvers of the same methods, and Siconos' own, run on "
        "[families in the same regimes](family-groups.md#beside-the-published-sets). The problems "
        "of the paper are not to be had, so ours are other ones, and the machine is another one. A "
        "run has less time here than in the paper. That changes the end of a curve if the "
        "fastest solver takes long."
    ),
    *prose(
        "The command makes this page from the [published runs](published-runs.md) of [the campaign "
        "faf2018](bench.md#the-campaign-of-the-published-comparison). No figure on it is typed. "
        "The curves of the paper were read from its figures, and are quoted here. They end at the "
        "ratio that its figures end at."
    ),
]
DISTANCES: Final = (
    "The distance is the largest vertical one of the two curves of a solver, ours and that of the "
    "paper. Chance alone gives distances up to the band of Kolmogorov and Smirnov (95 %), which "
    "shrinks with the number of our problems. The band takes the curve of the paper as exact. A "
    "larger distance points to a difference. Siconos' own solver has run on our problems too, with "
    "its default options. If its curve is within the band of the paper's curve, the difference is "
    f"in {CODE}. If it is within the band of ours instead, the difference is in {PROBLEMS} (or in "
    "the machine): the program of the paper differs from the paper as ours does. If it is within "
    f"neither, it may be {BOTH}. If that solver has not run on enough of our problems, they are "
    f"{OPEN}. If our band is wider than half the height of a figure, there are {FEW}."
)


def main() -> None:
    """Write the tables, the pictures and the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("curves", type=Path, help="the curves of the paper")
    parser.add_argument("--parts", type=Path, help="folder of the parts")
    own = parser.parse_args()
    folder = own.parts or results.folder()
    parts = [part for part in (results.shards(folder) if folder else ()) if part.name == NAME]
    one = published.set_of(NAME, parts)
    if one is None:
        raise SystemExit(f"no runs of the campaign {NAME} are published here")
    PAGE.write_text("\n".join([*HEAD, *page(one, own.curves)]).rstrip() + "\n", encoding="utf-8")
    print(PAGE)


def curves_of(path: Path) -> dict[tuple[str, float], dict[str, Curve]]:
    """The curves of the paper, by set and tolerance, then by solver."""
    found: dict[tuple[str, float], dict[str, Curve]] = defaultdict(lambda: defaultdict(list))
    with path.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            key = row["set"], float(row["tolerance"])
            found[key][row["solver"]].append((float(row["tau"]), float(row["share"])))
    return found


def page(one: Set, path: Path) -> list[str]:
    """What was run, the means, the distances and the pictures."""
    means = campaign.means_quoted(CAMPAIGN.read_text(encoding="utf-8"))
    rows: list[Row] = []
    pictures: list[str] = []
    for (name, tol), theirs in sorted(curves_of(path).items()):
        costs = of_set(one, name, tol)
        labels = [solver for solver in theirs if solver in costs.solvers]
        ours = complete(costs, labels)
        if len(labels) < 2 or not ours.instances:
            continue
        taus = np.unique([tau for curve in theirs.values() for tau, _ in curve])
        shares = profiles.performance_profile(ours.values, taus)
        told = {"set": name, "tolerance": _results.power(tol), "our problems": len(ours.instances)}
        rows += [
            {**told, "solver": solver, **distance(costs, labels, solver, theirs[solver], taus)}
            for solver in labels
        ]
        picture = f"published-2018-{name}-{_results.power(tol)}"
        title = f"{name} to {_results.power(tol)}"
        published.draw(picture, beside(title, labels, taus, shares, theirs))
        pictures += image(picture, f"{title}: the curves of the paper, and ours")
    return [
        "## What was run?",
        "",
        *table("published-2018-runs", [published.part_row(one.name, one.parts)],
               "The runs of the campaign", published.caption_of(one) + "."),
        "## How long does the fastest solver take?",
        "",
        *prose(
            "The mean over the problems of a set, of the time of the solver that is the fastest on "
            "the problem, beside the mean that the paper publishes. All solvers that have run "
            "count, so problems may have other numbers of solvers."
        ),
        *table("published-2018-means", family_rows(one.every, means),
               "The fastest solver of each problem, and the mean of the paper", ""),
        "## How far are the curves from those of the paper?",
        "",
        *prose(DISTANCES),
        *table("published-2018-reasons", reasons(rows), "What the distances point to", ""),
        *table("published-2018", rows, "The distance of each pair of curves",
               "`at` is the ratio to the best at which the distance is largest."),
        "## The curves",
        "",
        *pictures,
    ]  # fmt: skip


def of_set(one: Set, name: str, tol: float) -> Costs:
    """The costs on the problems that stand for a set of the paper."""
    family = next((ours for ours, known in SETS.items() if known == name), name)
    costs = one.every.at(tol)
    own = [k for k, instance in enumerate(costs.instances) if instance.family == family]
    return costs.on_instances(own)


def complete(costs: Costs, solvers: Sequence[str]) -> Costs:
    """The costs of some solvers on the problems that all of them have run."""
    part = costs.chosen(list(solvers))
    return part.on_instances(np.flatnonzero(part.there.all(axis=1)).tolist())


def share_at(curve: Curve, taus: Array) -> Array:
    """The shares of a step curve at some ratios."""
    steps = np.array(sorted(curve))
    place = np.searchsorted(steps[:, 0], taus, side="right") - 1
    return np.asarray(np.where(place >= 0, steps[np.maximum(place, 0), 1], 0.0))


def band(costs: Costs) -> float:
    """How far from each other chance alone puts a curve and what it is drawn from."""
    return BAND / math.sqrt(len(costs.instances))


def distance(
    costs: Costs, labels: Sequence[str], solver: str, theirs: Curve, taus: Array
) -> dict[str, str]:
    """How far our curve of a solver is from the paper's, and what that points to."""
    ours = complete(costs, labels)
    place = list(labels).index(solver)
    wanted = share_at(theirs, taus)
    apart = np.abs(profiles.performance_profile(ours.values, taus)[place] - wanted)
    row = {
        "largest distance": f"{apart.max():.2f}",
        "at": f"{taus[apart.argmax()]:.3g}",
        "chance alone, up to": f"{band(ours):.2f}",
        "Siconos to the paper": "",
        "Siconos to ours": "",
        "points to": OPEN,
    }
    if band(ours) > WIDE:
        row["points to"] = FEW
    elif apart.max() <= band(ours):
        row["points to"] = CHANCE
    other = OWN.get(solver, "")
    both = complete(costs, [*labels, other]) if other in costs.solvers else None
    if both is None or not both.instances or band(both) > WIDE:
        return row
    replaced = [other if label == solver else label for label in labels]
    siconos, mine = (
        profiles.performance_profile(both.chosen(names).values, taus)[place]
        for names in (replaced, list(labels))
    )
    to_paper = float(np.abs(siconos - wanted).max())
    to_ours = float(np.abs(siconos - mine).max())
    row["Siconos to the paper"] = f"{to_paper:.2f}"
    row["Siconos to ours"] = f"{to_ours:.2f}"
    if row["points to"] == OPEN:
        near = band(both)
        row["points to"] = CODE if to_paper <= near else PROBLEMS if to_ours <= near else BOTH
    return row


def reasons(rows: Sequence[Row]) -> list[Row]:
    """How many pairs of curves point to what."""
    groups: dict[str, list[float]] = defaultdict(list)
    for row in rows:
        groups[row["points to"]].append(float(row["largest distance"]))
    return [
        {
            "points to": reason,
            "pairs of curves": len(groups[reason]),
            "largest distance in the median": float(np.median(groups[reason])),
        }
        for reason in (CHANCE, CODE, PROBLEMS, BOTH, OPEN, FEW)
        if groups[reason]
    ]


def beside(
    title: str, labels: Sequence[str], taus: Array, ours: Array, theirs: Curves
) -> Callable[[Path], None]:
    """What draws the paper's curves and ours, in two fields with one legend."""

    def drawing(folder: Path) -> None:
        import matplotlib.pyplot as plt

        with plt.rc_context(plots.STYLE):
            drawn, fields = plt.subplots(1, 2, figsize=(8, 3.2), sharey=True, layout="constrained")
            for k, label in enumerate(labels):
                plots.steps(fields[0], taus, share_at(theirs[label], taus), k, label)
                plots.steps(fields[1], taus, ours[k], k, label)
            for field, words in zip(fields, (f"{title}: the paper", "ours"), strict=True):
                field.set(xscale="log", xlabel="ratio to the best", title=words, ylim=(0, 1.02))
            fields[0].set_ylabel("share of problems")
            drawn.legend(*fields[1].get_legend_handles_labels(), loc="outside right center")
            drawn.savefig(folder / "curves.png", dpi=150)
            plt.close(drawn)

    return drawing


if __name__ == "__main__":
    main()
