"""Profiles as pictures, for the page of a paper."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from fclib.bench import profiles
from fclib.bench.comparison import METRICS, Array, Costs, Weigh

# told apart by those who see few colours, too: Okabe & Ito (2008), then other strokes
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
STROKES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (6, 1.5, 1, 1.5)))
MARKERS = "osD^v<>PX*hp"
STYLE: Any = {
    "font.family": "sans-serif",
    "font.size": 8,
    "axes.titlesize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "grid.linewidth": 0.3,
    "grid.color": "#d0d0d0",
    "legend.fontsize": 7,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "fclib",
    "savefig.dpi": 300,
}
SIZE = (5.6, 3.2)  # [inch]
ENDS = 1e4  # largest ratio that is shown
SHARES = {"instances": "instances", "families": "instances, by family,"}


def stroke(number: int) -> dict[str, Any]:
    """How the curve of a solver is drawn."""
    colour = COLOURS[number % len(COLOURS)]
    return {"color": colour, "linestyle": STROKES[number // len(COLOURS) % len(STROKES)]}


def label(text: str) -> str:
    """A name as Matplotlib shows it: it takes $ for mathematics, and hides a leading _."""
    text = text.replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text


def wrapped(caption: str, width: int = 110) -> str:
    """A caption broken into lines between its parts; only a very long part is broken inside."""
    parts = [part.replace(" ", "\0") for part in caption.split("; ")]
    whole = "; ".join(part if len(part) < width else part.replace("\0", " ") for part in parts)
    return "\n".join(textwrap.wrap(whole, width)).replace("\0", " ")


@contextmanager
def figure(folder: Path, name: str, formats: Sequence[str], caption: str = "") -> Iterator[Any]:
    """Axes to draw in. The figure is then written to the folder in each format, and closed.

    The caption stands below, in as many lines as it needs.
    """
    import matplotlib

    matplotlib.use("Agg", force=False)
    import matplotlib.pyplot as plt

    with plt.rc_context(STYLE):
        drawn, axes = plt.subplots(figsize=SIZE, layout="constrained")
        try:
            yield axes
            if caption:
                drawn.supxlabel(label(wrapped(caption)), fontsize=5.5)
            folder.mkdir(parents=True, exist_ok=True)
            for kind in formats:
                part = folder / f".{name}.part.{kind}"
                # so that the same data give the same file
                stamp = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind)
                drawn.savefig(part, metadata=stamp)
                drawn.set_layout_engine("none")  # the layout is fixed: saves two thirds of the time
                part.replace(folder / f"{name}.{kind}")
        finally:
            plt.close(drawn)


def _legend(axes: Any) -> None:
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=2.6, labelspacing=0.35)


def _order(costs: Costs, heights: Array) -> list[int]:
    """The solvers in the order of the legend, the highest curve first."""
    return sorted(range(len(costs.solvers)), key=lambda k: (-heights[k].mean(), k))


def performance(
    costs: Costs,
    folder: Path,
    formats: Sequence[str],
    caption: str = "",
    ending: str = "",
    weigh: Weigh = "instances",
) -> None:
    """Dolan & More's profiles, the ratio on a logarithmic axis, with their 95 % bands."""
    quotients = profiles.ratios(costs.values)
    finite = quotients[np.isfinite(quotients)]
    end = min(ENDS, 1.3 * float(finite.max(initial=2.0)))
    taus = np.unique(np.concatenate([[1.0, end], finite[finite <= end]]))
    spaced = np.geomspace(1, end, 200)
    weights = costs.weights(weigh)
    curves = profiles.share_within(quotients, taus, weights)
    grid = profiles.share_within(quotients, spaced, weights)
    low, high = profiles.bands(costs, quotients, spaced, weigh)
    with figure(folder, f"performance-{costs.metric}{ending}", formats, caption) as axes:
        for rank, k in enumerate(_order(costs, grid)):
            name, style = label(costs.legend(k)), stroke(rank)
            axes.step(taus, curves[k], where="post", label=name, **style)
            axes.fill_between(
                spaced, low[k], high[k], step="post", alpha=0.1, color=style["color"], linewidth=0
            )
        axes.set_xscale("log")
        axes.set_xlim(1.0, end)
        axes.set_ylim(0.0, 1.02)
        axes.set_xlabel(rf"$\tau$: {METRICS[costs.metric][0].split(' [')[0]} over that of the best")
        axes.set_ylabel(rf"share of {SHARES[weigh]} solved within $\tau$")
        _legend(axes)


def data(
    costs: Costs,
    folder: Path,
    formats: Sequence[str],
    *,
    per_contact: bool,
    caption: str = "",
    ending: str = "",
    weigh: Weigh = "instances",
) -> None:
    """The share solved within a cost, or within a cost per contact."""
    shown = costs.per_contact() if per_contact else costs
    finite = shown.values[np.isfinite(shown.values)]
    if not finite.size:
        return
    ends = 0.8 * float(finite.min()), 1.2 * float(finite.max())
    bounds = np.unique(np.concatenate([ends, finite]))
    weights = shown.weights(weigh)
    curves = profiles.share_within(shown.values, bounds, weights)
    grid = profiles.share_within(shown.values, np.geomspace(*ends, 200), weights)
    name = f"data-{costs.metric}" + ("-per-contact" if per_contact else "") + ending
    with figure(folder, name, formats, caption) as axes:
        for rank, k in enumerate(_order(shown, grid)):
            axes.step(bounds, curves[k], where="post", label=label(shown.legend(k)), **stroke(rank))
        axes.set_xscale("log")
        axes.set_xlim(*ends)
        axes.set_ylim(0.0, 1.02)
        axes.set_xlabel(METRICS[costs.metric][0] + (" per contact" if per_contact else ""))
        axes.set_ylabel(f"share of {SHARES[weigh]} solved")
        _legend(axes)


def work_precision(
    points: Sequence[Mapping[str, Any]],
    metric: str,
    folder: Path,
    formats: Sequence[str],
    caption: str = "",
) -> None:
    """The mean cost at each tolerance; a mark is hollow if not all problems were solved."""
    solvers = list(dict.fromkeys(point["solver"] for point in points))
    least = {s: min(p["mean"] for p in points if p["solver"] == s) for s in solvers}
    with figure(folder, f"work-precision-{metric}", formats, caption) as axes:
        for rank, solver in enumerate(sorted(solvers, key=lambda s: least[s])):
            own = [point for point in points if point["solver"] == solver]
            style = stroke(rank)
            marker = MARKERS[rank % len(MARKERS)]
            x, y = [p["mean"] for p in own], [p["tol"] for p in own]
            fills = [style["color"] if p["solved"] == p["of"] else "white" for p in own]
            counts = ", ".join(dict.fromkeys(f"{p['solved']} of {p['of']}" for p in own))
            name = label(f"{solver} {counts}")
            axes.plot(x, y, **style, label=name, marker=marker, markersize=4)
            axes.scatter(
                x,
                y,
                s=16,
                c=fills,
                marker=marker,
                edgecolors=style["color"],
                linewidths=0.9,
                zorder=3,
            )
        axes.set_xscale("log")
        axes.set_yscale("log")
        means = np.log10([point["mean"] for point in points])
        axes.set_xlim(10.0 ** np.floor(means.min()), 10.0 ** np.ceil(means.max()))
        axes.invert_yaxis()
        axes.set_xlabel(f"shifted geometric mean of {METRICS[metric][0]}, failures charged")
        axes.set_ylabel("tolerance on the relative error")
        _legend(axes)


def convergence(
    curves: Mapping[str, Array],
    times: Array,
    folder: Path,
    formats: Sequence[str],
    caption: str = "",
    ending: str = "",
    legend: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """The least error reached, over time, at one tolerance."""
    ends = {solver: float(curve[-1]) for solver, curve in curves.items()}
    with figure(folder, f"convergence{ending}", formats, caption) as axes:
        for rank, solver in enumerate(sorted(curves, key=lambda s: ends[s])):
            curve = np.where(np.isfinite(curves[solver]), curves[solver], np.nan)
            name = label(legend.get(solver, solver))
            axes.step(times, curve, where="post", label=name, **stroke(rank))
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("CPU time [s]")
        axes.set_ylabel("median of the least relative error")
        _legend(axes)


def runtimes(
    times: Mapping[str, Array],
    folder: Path,
    formats: Sequence[str],
    caption: str = "",
    ending: str = "",
    legend: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """The share of pairs (run, error) in which the run reached the error within a time."""
    finite = np.concatenate([own[np.isfinite(own) & (own > 0)] for own in times.values()])
    if not finite.size:
        return
    ends = 0.8 * float(finite.min()), 1.2 * float(finite.max())
    bounds = np.unique(np.concatenate([ends, finite]))
    curves = {name: profiles.share_within(own[:, None], bounds)[0] for name, own in times.items()}
    with figure(folder, f"runtimes{ending}", formats, caption) as axes:
        for rank, solver in enumerate(sorted(curves, key=lambda s: -curves[s].mean())):
            style = stroke(rank)
            name = label(legend.get(solver, solver))
            axes.step(bounds, curves[solver], where="post", label=name, **style)
        axes.set_xscale("log")
        axes.set_xlim(*ends)
        axes.set_ylim(0.0, 1.02)
        axes.set_xlabel("CPU time [s]")
        axes.set_ylabel("share of runs and errors reached")
        _legend(axes)
