"""The figures of families that are published, and of ours: what can be compared, and how.

    python -m workshop.sets.collection_table --exclusions [--results NAME]
    python -m workshop.sets.collection_table --growth rt444/BoxesStack [--results NAME]

Sizes and density, contact components for a degree of freedom, are those of the catalogues. The rank
ratio (contact components over the rank of W) and the conditioning of W (its largest singular value
over the smallest that is not zero) are those of fclib.analysis, for a sample of each family, evenly
spread, of the problems that have at most LIMIT contact components; docs/analysis.md has methods and
thresholds.

`within` says whether ours has the published range: both ends of each figure are met to 10 %
(conditioning: of its logarithm). Else it names what is not, with the share by which the worse end
is off. workshop/tables/published_beside_ours.py makes the table of both.

--exclusions prints the ends that no problem can have within the published ranges of the other
figures, to the same tenth: density is three components of a contact over the degrees of freedom.

--growth prints, of the stored states of families those that have a quarter more degrees of freedom
than the one before: how the conditioning grows with the size, how many pairs of bodies touch for
each body (of six degrees of freedom), and in how many contacts.

published_sets.csv has the figures of the published sets: V. Acary, M. Bremond, O. Huber, On solving
contact problems with Coulomb friction: formulations and numerical comparisons, 2018, table
"Description of the test sets of FCLib library (v1.0)".
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import fclib
from fclib.analysis._brief import spectrum_of_W
from fclib.analysis._data import Data, asymmetry
from fclib.analysis._spectrum import spectrum
from fclib.collections import published as stored
from fclib.collections import set_index as versions
from fclib.collections import trajectory
from workshop.tables import _results

PUBLISHED = Path(__file__).with_name("published_sets.csv")
HEAD = (
    *("set", "mu", "problems", "dof", "contacts", "density", "rank ratio", "conditioning"),
    "within",
)
COUNTED = ("dof", "contacts", "density")
COMPARED = (*COUNTED, "rank_ratio", "conditioning")
CLOSE = 0.1


def span(values: Iterable[Any]) -> str:
    """From the least to the largest, as short as they differ."""
    known = sorted(float(value) for value in values if value is not None and np.isfinite(value))
    if not known:
        return ""
    texts = [f"{value:.3g}" if value < 1000 else f"{value:.5g}" for value in (known[0], known[-1])]
    texts = [
        f"{v:.1e}".replace("e+0", "e").replace("e+", "e") if v >= 1e5 else t
        for v, t in zip((known[0], known[-1]), texts, strict=True)
    ]
    return texts[0] if texts[0] == texts[1] else " to ".join(texts)


def figures(problem: Any) -> tuple[float, float]:
    """Rank ratio and conditioning of W, as `fclib.analysis` finds them; NaN if it does not."""
    data = Data.of_problem(problem)
    found = spectrum_of_W(data, asymmetry(data.W))
    if found is None and data.reduced is not None:
        found = spectrum(data.reduced.W, rounding=data.reduced.rounding)
    if found is None or found.doubtful or not found.rank:
        return np.nan, np.nan
    return problem.m / found.rank, found.conditioning


def spectra(folder: Path, rows: Sequence[dict[str, Any]], sample: int, limit: int) -> list[Any]:
    """Rank ratio and conditioning of W of a sample of a family's problems."""
    small = [row for row in rows if row["spacedim"] * row["nc"] <= limit]
    found = []
    for place in np.unique(np.linspace(0, len(small) - 1, min(sample, len(small))).round()):
        row = small[int(place)]
        path = row["local_file"] or row["global_file"]
        found.append(figures(fclib.read(folder / path)))
    return [pair for pair in found if np.isfinite(pair).all()]


def off(published: str, values: Sequence[float], *, logarithm: bool) -> float:
    """By how much of them the ends of ours differ from the published ones; 0 if none are."""
    known = [float(value) for value in values if value is not None and np.isfinite(value)]
    if not published or not known:
        return 0.0
    low, _, high = published.partition(" to ")
    pairs = ((float(low), min(known)), (float(high or low), max(known)))
    if logarithm:
        pairs = tuple((np.log10(theirs), np.log10(ours)) for theirs, ours in pairs)  # type: ignore[assignment]
    least = 1.0 if logarithm else 1e-9
    return max(abs(ours - theirs) / max(abs(theirs), least) for theirs, ours in pairs)


def within(row: dict[str, str], rows: Sequence[dict[str, Any]], figures: Sequence[Any]) -> str:
    """Of a published set and ours: yes, or what is off and by how much."""
    ours = {
        "dof": [row["n"] or None for row in rows],
        "contacts": [row["nc"] for row in rows],
        "density": [row["density"] for row in rows],
        "rank_ratio": [ratio for ratio, _ in figures],
        "conditioning": [conditioning for _, conditioning in figures],
    }
    if figures:  # the rank is at most the number of degrees of freedom
        ours["rank_ratio"].append(max(1.0, *(row["density"] or 1.0 for row in rows)))
    shares = {
        name: off(row[name], ours[name], logarithm=name == "conditioning") for name in COMPARED
    }
    words = [f"{name.replace('_', ' ')} {s:.0%}" for name, s in shares.items() if s > CLOSE]
    return ", ".join(words) or "yes"


def exclusions(published: dict[str, str]) -> Iterator[dict[str, str]]:
    """The ends of a set's ranges that its other ranges exclude, to a tenth.

    Each with the nearest that the others leave, and with what the others are at that end.
    """
    if not all(published[name] for name in COUNTED):
        return
    ends, wide = {}, {}
    for name in COUNTED:
        low, _, high = published[name].partition(" to ")
        ends[name] = float(low), float(high or low)
        wide[name] = (1 - CLOSE) * ends[name][0], (1 + CLOSE) * ends[name][1]
    for name in COUNTED:
        for word, end in zip(("least", "most"), ends[name], strict=True):
            nearest = between(end, possible(name, wide))
            if abs(nearest - end) <= CLOSE * end:
                continue
            row = {"set": published["set"], "end": f"{word} {name}", "published": f"{end:g}"}
            row["nearest"] = f"{nearest:.3g}"
            there = wide | {name: ((1 - CLOSE) * end, (1 + CLOSE) * end)}
            for other in COUNTED:
                least, most = possible(other, there)
                row[f"or {other}"] = ""
                if other != name:
                    below = most < ends[other][0]
                    row[f"or {other}"] = f"at most {most:.3g}" if below else f"at least {least:.3g}"
            yield row


def possible(name: str, wide: dict[str, tuple[float, float]]) -> tuple[float, float]:
    """The least and the largest of a figure of those whose two others are within bounds."""
    (n, most_n), (nc, most_nc), (density, most_density) = (wide[other] for other in COUNTED)
    n, most_n, nc, most_nc = math.ceil(n), math.floor(most_n), math.ceil(nc), math.floor(most_nc)
    if name == "density":
        return 3 * nc / most_n, 3 * most_nc / n
    if name == "contacts":
        return math.ceil(density * n / 3), math.floor(most_density * most_n / 3)
    return math.ceil(3 * nc / most_density), math.floor(3 * most_nc / density)


def between(value: float, bounds: tuple[float, float]) -> float:
    """The value within bounds that is nearest to another."""
    return min(max(value, bounds[0]), bounds[1])


def growth(name: str, limit: int) -> Iterator[dict[str, str]]:
    """Problems of SET/FAMILY of growing size, and the last of all; all that have a spectrum."""
    path = stored.path_of(name, versions.version_of(name))
    if path is None:
        raise SystemExit(f"{name}: no states are stored")
    states = trajectory.read(path)
    least = 0.0
    for k in range(len(states)):
        problem = states.problem(k).problem
        last = k == len(states) - 1
        if not (problem.n >= least or last) or problem.m > limit:
            continue
        least = 1.25 * problem.n
        ratio, conditioning = figures(problem)
        yield {
            "set": name,
            "dof": str(problem.n),
            "contacts": str(problem.nc),
            "density": f"{problem.m / problem.n:.3g}",
            "rank ratio": f"{ratio:.3g}",
            "conditioning": span([conditioning]),
            **touching(problem),
        }


def touching(problem: Any) -> dict[str, str]:
    """How many pairs of bodies touch for each body that moves, and in how many contacts each."""
    pairs = {tuple(sorted(pair)) for pair in np.asarray(problem.contacts.body).tolist()}
    return {
        "pairs of a body": f"{6 * len(pairs) / problem.n:.3g}",
        "contacts of a pair": f"{problem.nc / len(pairs):.3g}",
    }


def line(
    name: str, rows: Sequence[dict[str, Any]], figures: Sequence[Any], verdict: str = ""
) -> dict[str, str]:
    """The row of a family of ours."""
    cells = [
        name,
        span(row[key] for row in rows for key in ("mu_min", "mu_max")),
        str(len(rows)),
        span(row["n"] or None for row in rows),
        span(row["nc"] for row in rows),
        span(row["density"] for row in rows),
        span(ratio for ratio, _ in figures),
        span(conditioning for _, conditioning in figures),
        verdict,
    ]
    return dict(zip(HEAD, cells, strict=True))


def main() -> None:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--limit", type=int, default=3000, help="contact components")
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--exclusions", action="store_true", help="of the published ranges")
    which.add_argument("--growth", nargs="+", metavar="FAMILY", help="of stored families")
    _results.add_option(parser)
    arguments = parser.parse_args()
    table: list[dict[str, str]] = []

    def show(row: dict[str, str]) -> None:
        if not table:
            print("| " + " | ".join(row) + " |")
            print("|" + "---|" * len(row))
        table.append(row)
        print("| " + " | ".join(row.values()) + " |", flush=True)

    if arguments.growth:
        for name in arguments.growth:
            for found in growth(name, arguments.limit):
                show(found)
        if arguments.results:
            _results.store(
                arguments.results,
                table,
                title="How W changes with the size",
                note="Of the stored states, each at least a quarter larger than the one before.",
            )
        return
    with PUBLISHED.open(newline="") as file:
        theirs = list(csv.DictReader(file))
    for row in theirs:
        for found in exclusions(row):
            show(found)
    if arguments.results:
        _results.store(
            arguments.results,
            table,
            title="Ends of published ranges that the other ranges of the set exclude",
            note="All to a tenth, as in the comparison.",
        )


if __name__ == "__main__":
    main()
