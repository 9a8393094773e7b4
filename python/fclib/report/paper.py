"""Figures and tables for a paper: vector graphics by Matplotlib, tables for LaTeX."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fclib._files import write_text
from fclib.bench import plots, profiles
from fclib.bench.comparison import compared
from fclib.bench.plots import latex_text
from fclib.report.runs import WEIGH, Campaigns

FORMATS = ("pdf",)
HEADS = {
    "solver": "solver",
    "solved": "solved",
    "of": "of",
    "fastest": "fastest",
    "mean": "mean [s]",
    "to best": "to best",
    "median ratio": "median",
    "worst ratio": "worst",
}


def write_paper(campaigns: Campaigns, folder: Path, metric: str = "cpu_s") -> list[Path]:
    """Write profiles as PDF and the tables as LaTeX, in a folder for each tolerance.

    Raises:
        ImportError: Matplotlib is not there.
        ProfileError: there is no such metric.
    """
    written: set[Path] = set()
    whole = compared(profiles.gather(campaigns.rows, metric))
    for tol in whole.tolerances:
        costs = whole.at(tol)
        own = folder / f"tol-{tol:g}"
        own.mkdir(parents=True, exist_ok=True)
        words = campaigns.caption(costs, campaigns.at(tol))
        plots.performance(costs, own, FORMATS, words, weigh=WEIGH)
        plots.data(costs, own, FORMATS, per_contact=False, caption=words, weigh=WEIGH)
        plots.data(costs, own, FORMATS, per_contact=True, caption=words, weigh=WEIGH)
        write_text(own / "summary.tex", latex(_shown(profiles.summary(costs, weigh=WEIGH))))
        write_text(own / "families.tex", latex(_shown(profiles.families(costs))))
        write_text(own / "statuses.tex", latex(_shown(profiles.failures(campaigns.at(tol)))))
        written |= set(own.iterdir())
    if len(whole.tolerances) > 1:
        points = profiles.work_precision(campaigns.rows, whole, weigh=WEIGH)
        words = campaigns.caption(whole, campaigns.rows)
        plots.work_precision(points, metric, folder, FORMATS, words)
        written.add(folder / f"work-precision-{metric}.pdf")
    return sorted(written)


def _shown(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows without the tolerance, which is in the folder's name."""
    return [{key: value for key, value in row.items() if key != "tol"} for row in rows]


def latex(rows: Sequence[Mapping[str, Any]]) -> str:
    """A tabular of booktabs, one column for each key."""
    keys = list(rows[0])
    numeric = [isinstance(rows[0][key], (int, float)) for key in keys]
    lines = [
        rf"\begin{{tabular}}{{{''.join('r' if right else 'l' for right in numeric)}}}",
        r"\toprule",
        " & ".join(latex_text(HEADS.get(key, key)) for key in keys) + r" \\",
        r"\midrule",
        *(" & ".join(_cell(row[key]) for key in keys) + r" \\" for row in rows),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(lines) + "\n"


def _cell(value: Any) -> str:
    if value is None:
        return "--"
    if isinstance(value, float):
        text = f"{value:.3g}"
        mantissa, e, exponent = text.partition("e")
        return rf"${mantissa}\cdot 10^{{{int(exponent)}}}$" if e else text
    return latex_text(str(value))
