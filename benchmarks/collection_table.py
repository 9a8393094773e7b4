"""The families of a built collection beside the published sets, as a table.

    .venv/bin/python benchmarks/collection_table.py FOLDER... [--sample 8] [--limit 3000]
        [--results NAME]

Sizes and density, contact components for a degree of freedom, are those of the catalogues. The rank
ratio (contact components over the rank of W) and the conditioning of W (its largest singular value
over the smallest that is not zero) are computed by fclib.analysis for a sample of each family,
evenly spread, of the problems that have at most LIMIT contact components; docs/analysis.md has
methods and thresholds.

The last column says whether ours has the published range: both ends of each figure are met to 10 %
(conditioning: of its logarithm). Else it names what is not, with the share by which the worse end
is off.

published_sets.csv has the figures of the published sets: V. Acary, M. Bremond, O. Huber, On solving
contact problems with Coulomb friction: formulations and numerical comparisons, 2018, table
"Description of the test sets of FCLib library (v1.0)".
"""

from __future__ import annotations

import argparse
import csv
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import _results
import numpy as np

import fclib
from fclib import collections
from fclib.analysis import analyze

PUBLISHED = Path(__file__).with_name("published_sets.csv")
HEAD = (
    *("set", "mu", "problems", "dof", "contacts", "density", "rank ratio", "conditioning"),
    "within",
)
COMPARED = ("dof", "contacts", "density", "rank_ratio", "conditioning")
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


def spectra(folder: Path, rows: Sequence[dict[str, Any]], sample: int, limit: int) -> list[Any]:
    """Rank ratio and conditioning of W of a sample of a family's problems."""
    small = [row for row in rows if row["spacedim"] * row["nc"] <= limit]
    found = []
    for place in np.unique(np.linspace(0, len(small) - 1, min(sample, len(small))).round()):
        row = small[int(place)]
        # the spectrum of a large M, which is not asked for, would take minutes
        large = row["nnz_M"] and row["nnz_M"] > 1_000_000
        local = row["local_file"] and large
        if large and not local:
            continue
        path = row["local_file"] if local else row["global_file"] or row["local_file"]
        problem = fclib.read(folder / path)
        record = analyze(problem).record
        if record["rank_W"]:
            components = row["spacedim"] * row["nc"]
            found.append((components / record["rank_W"], record["conditioning_W"]))
    return found


def off(published: str, values: Sequence[float], *, logarithm: bool) -> float:
    """By how much of them the ends of ours differ from the published ones; 0 where none are."""
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
    """Print the table: each published set, then ours beside it; then those that stand alone."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--sample", type=int, default=8)
    parser.add_argument("--limit", type=int, default=3000)
    _results.add_option(parser)
    arguments = parser.parse_args()
    families: dict[str, list[dict[str, Any]]] = defaultdict(list)
    where: dict[str, Path] = {}
    for folder in arguments.folders:
        for row in collections.read_catalog(folder).to_pylist():
            name = f"{row['collection']}/{row['family']}"
            if where.setdefault(name, folder) == folder:
                families[name].append(row)
    table: list[dict[str, str]] = []

    def show(row: dict[str, str]) -> None:
        table.append(row)
        print("| " + " | ".join(row.values()) + " |", flush=True)

    def ours(name: str, published: dict[str, str] | None = None) -> None:
        rows = families.pop(name)
        figures = spectra(where[name], rows, arguments.sample, arguments.limit)
        show(line(name, rows, figures, within(published, rows, figures) if published else ""))

    print("| " + " | ".join(HEAD) + " |")
    print("|" + "---|" * len(HEAD), flush=True)
    with PUBLISHED.open(newline="") as file:
        for row in csv.DictReader(file):
            beside = row.pop("ours")
            cells = [f"*{row['set']}*", *list(row.values())[1:], ""]
            show(dict(zip(HEAD, cells, strict=True)))
            if beside in families:
                ours(beside, row)
    for name in sorted(families):
        ours(name)
    if arguments.results:
        _results.store(
            arguments.results,
            table,
            title="Published sets (in italics) and ours",
            note=f"Rank ratio and conditioning are of {arguments.sample} problems of a family, of"
            f" at most {arguments.limit} contact components.",
        )


if __name__ == "__main__":
    main()
