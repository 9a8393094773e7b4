"""A page on how far simulators are from Coulomb's law, side by side."""

from __future__ import annotations

import html
import importlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fclib._files import write_text
from fclib.bench.plots import COLOURS
from fclib.recorders import CRITERIA, Judgement, summary

SMALLEST = 1e-12  # the figures show what is smaller as this; a logarithmic axis has no 0
PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 0 auto; padding: 1rem; }}
table {{ border-collapse: collapse; }}
th, td {{ padding: .25rem .75rem; text-align: right; border-bottom: 1px solid #ccc; }}
th:first-child, td:first-child {{ text-align: left; }}
div.wide {{ overflow-x: auto; }}
</style>
<h1>{title}</h1>
<p>Each step of a simulator is a contact problem. Its reaction is judged by Coulomb's law, and
<code>auto</code> solves the same problem. 0 is a solution of the law. V is the largest velocity
that a contact of the step would have without reactions. The figures show what is below {smallest}
as {smallest}.</p>
<div class="wide">{table}</div>
{figures}
<p>The criteria are those of Le Lidec, Jallet, Montaut, Laptev, Schmid and Carpentier,
<cite>Contact models in robotics: a comparative analysis</cite>, IEEE Transactions on Robotics,
2024.</p>
"""


def write_judged(runs: Mapping[str, Sequence[Judgement]], path: Path) -> None:
    """Write the page of the runs, by their names; it needs no other file.

    Raises:
        ImportError: plotly is not installed.
        OSError: the page cannot be written.
    """
    figures = [figure_of(runs, name) for name in CRITERIA]
    title = "How near to Coulomb's law? " + ", ".join(runs)
    page = PAGE.format(
        title=html.escape(title),
        smallest=SMALLEST,
        table=table_of({name: summary(steps) for name, steps in runs.items()}),
        figures="\n".join(
            f"<h2>{name}</h2><p>{html.escape(meaning)}.</p>{drawn(figure, first=k == 0)}"
            for k, ((name, meaning), figure) in enumerate(
                zip(CRITERIA.items(), figures, strict=True)
            )
        ),
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, page)


def table_of(rows: Mapping[str, Mapping[str, Any]]) -> str:
    """The runs as a table, a column each."""
    names = list(next(iter(rows.values())))
    head = "".join(f"<th>{html.escape(name)}</th>" for name in rows)
    body = "".join(
        f"<tr><td>{html.escape(name)}</td>"
        + "".join(f"<td>{html.escape(shown(row[name]))}</td>" for row in rows.values())
        + "</tr>"
        for name in names
    )
    return f"<table><tr><th></th>{head}</tr>{body}</table>"


def shown(value: Any) -> str:
    """A cell."""
    return f"{value:.2g}" if isinstance(value, float) else str(value)


def figure_of(runs: Mapping[str, Sequence[Judgement]], name: str) -> Any:
    """A criterion of each run: along the time, and the share of steps below a value."""
    subplots: Any = importlib.import_module("plotly.subplots")
    figure = subplots.make_subplots(cols=2, column_titles=["at each step", "share of the steps"])
    for k, (label, steps) in enumerate(runs.items()):
        values = np.maximum([getattr(step, name) for step in steps], SMALLEST)
        line = {"color": COLOURS[k % len(COLOURS)]}
        own: dict[str, Any] = {"name": label, "legendgroup": label, "line": line}
        moments = [step.time for step in steps]
        figure.add_scatter(x=moments, y=values, mode="lines", row=1, col=1, **own)
        share = np.arange(1, len(values) + 1) / len(values)
        own |= {"line": {**line, "shape": "hv"}, "showlegend": False}
        figure.add_scatter(x=np.sort(values), y=share, mode="lines", row=1, col=2, **own)
    most = max(getattr(step, name) for steps in runs.values() for step in steps)
    ends = [np.log10(SMALLEST), max(0.0, np.log10(max(most, SMALLEST))) + 0.5]
    figure.update_yaxes(type="log", exponentformat="power", range=ends, col=1)
    figure.update_xaxes(title="time [s]", col=1)
    figure.update_xaxes(
        type="log", exponentformat="power", range=ends, title=f"{name} at most", col=2
    )
    figure.update_yaxes(range=[0, 1], tickformat=".0%", col=2)
    return figure.update_layout(height=340, margin={"t": 40, "b": 50}, template="plotly_white")


def drawn(figure: Any, *, first: bool) -> str:
    """The figure in HTML; the first one brings the script."""
    return str(
        figure.to_html(full_html=False, include_plotlyjs=first, config={"displaylogo": False})
    )
