"""Figures of problems, results and campaigns in a notebook: what `view`, `plot` and `profile` show.

`problem.view()`, `result.plot()` and `fclib.profile(store)` come from here. They need the packages
of `fclib[report]`.
"""

from __future__ import annotations

import base64
import gzip
import html
import importlib
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fclib._files import write_text
from fclib._words import counted
from fclib.bench import comparison, profiles
from fclib.bench.plots import COLOURS
from fclib.report import view as views
from fclib.report.error import ReportError

HEIGHT = 640  # [px] of a view
# a page that writes the packed one in its place
UNPACK = """<!doctype html><meta charset="utf-8"><script>
(async () => {
  const packed = Uint8Array.from(atob("PACKED"), (byte) => byte.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const page = await new Response(stream).text();
  document.open();
  document.write(page);
  document.close();
})();
</script>"""
REMEDY = 'pip install "fclib[report]"'


@dataclass(frozen=True)
class View:
    """The page of a problem: contacts and bodies in space, to turn and to zoom."""

    page: str  # HTML that needs no other file

    def _repr_html_(self) -> str:
        # a notebook keeps each view, and most of it are libraries: a third is left
        packed = base64.b64encode(gzip.compress(self.page.encode(), mtime=0)).decode()
        return (
            f'<iframe srcdoc="{html.escape(UNPACK.replace("PACKED", packed))}" width="100%"'
            f' height="{HEIGHT}" style="border: 0" sandbox="allow-scripts"></iframe>'
        )

    def save(self, path: str | Path) -> None:
        """Write the page. OSError."""
        write_text(Path(path), self.page)


def view(problem: Any, solution: Any = None) -> View:
    """The picture of a problem, with the reactions of a solution if one is given.

    Args:
        problem: in any formulation.
        solution: a Solution or a Result; without it there are no reactions.

    Raises:
        ImportError: a library of `fclib[report]` is missing.
    """
    if hasattr(solution, "solution"):
        solution = solution.solution
    with tempfile.TemporaryDirectory(prefix="fclib-view-") as folder:
        path = Path(folder) / "view.html"
        try:
            views.write_view(views.view_of(problem, solution), path, problem.info.title)
        except ReportError as error:
            raise ImportError(f"{error}; {REMEDY}") from None
        return View(path.read_text(encoding="utf-8"))


def plot(result: Any) -> Any:
    """How the error of a solve fell: a figure of Plotly, over iterations and over time.

    Args:
        result: of `fclib.solve(..., history=True)`.

    Raises:
        ValueError: the result has no history.
        ImportError: plotly is missing.
    """
    if result.history is None or not len(result.history):
        raise ValueError("the result has no history: fclib.solve(problem, history=True)")
    subplots = plotly("plotly.subplots")
    history = np.column_stack([result.history[name] for name in ("iteration", "error", "time")])
    stages = result.history["stage"].tolist()
    figure = subplots.make_subplots(cols=2, shared_yaxes=True)
    names = list(dict.fromkeys(stages))
    for column, (place, title) in enumerate(((0, "iterations"), (2, "time [s]")), start=1):
        for k, name in enumerate(names):
            mine = np.array([stage == name for stage in stages])
            figure.add_scatter(
                x=history[mine, place],
                y=history[mine, 1],
                mode="lines+markers",
                name=name or result.solver,
                legendgroup=name,
                showlegend=column == 1,
                line={"color": COLOURS[k % len(COLOURS)]},
                row=1,
                col=column,
            )
        figure.update_xaxes(title=title, col=column)
    figure.update_yaxes(type="log", exponentformat="power", title="error", col=1)
    figure.update_yaxes(type="log", exponentformat="power", col=2)
    title = f"{result.solver}: {result.status}, error {result.error:.1e}"
    return figure.update_layout(title=title, template="plotly_white", height=400)


def profile(
    store: str | Path,
    *,
    tol: float | None = None,
    solvers: Sequence[str] = (),
    metric: str = "cpu_s",
    own_set: bool = False,
    weigh: comparison.Weigh = "families",
) -> Any:
    """The performance profile of a store: a figure of Plotly.

    Args:
        store: of `fclib bench`.
        tol: the tolerance; by default the smallest of the store.
        solvers: only these, by their labels.
        metric: one of `fclib.bench.profiles.METRICS`.
        own_set: count each solver on the instances that it has run and takes.
        weigh: what weighs the same, "families" or "instances".

    Raises:
        ValueError: there is no such store, or nothing in it to compare.
        ImportError: plotly is missing.
    """
    objects = plotly("plotly.graph_objects")
    tolerances = [] if tol is None else [tol]
    rows = profiles.load(store, solvers=solvers, tolerances=tolerances)
    costs = comparison.compared(profiles.gather(rows, metric), solvers or None, own_set)
    chosen = min(costs.tolerances) if tol is None else tol
    part = costs.at(chosen)
    ratios = profiles.ratios(part.values)
    finite = ratios[np.isfinite(ratios)]
    taus = np.unique(np.concatenate((finite, [1.0, 2.0 * finite.max(initial=1.0)])))
    shares = profiles.performance_profile(part.values, taus, part.weights(weigh))
    figure = objects.Figure()
    order = np.argsort(-shares.mean(axis=1), kind="stable")
    for k, own in enumerate(order.tolist()):
        line = {"shape": "hv", "color": COLOURS[k % len(COLOURS)]}
        figure.add_scatter(x=taus, y=shares[own], mode="lines", name=part.legend(own), line=line)
    words = comparison.METRICS[metric][0]
    figure.update_xaxes(type="log", title=f"at most so many times the best ({words})")
    figure.update_yaxes(range=[0, 1.01], tickformat=".0%", title="share of the instances")
    title = f"Tolerance {chosen:g}, {counted(len(part.instances), 'instance')}"
    return figure.update_layout(title=title, template="plotly_white", height=450)


def plotly(module: str) -> Any:
    """A module of plotly. ImportError says what to install."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(f"{error}; {REMEDY}") from None
