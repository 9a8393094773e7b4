"""Profiles as pictures, for the page of a paper."""

from __future__ import annotations

import re
import shutil
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from fclib._files import replace_file
from fclib.bench import profiles
from fclib.bench.comparison import METRICS, Array, Costs, Weigh

# colours that those tell apart who see few (Okabe & Ito 2008); strokes and marks for print in grey
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
STROKES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (6, 1.5, 1, 1.5)))
MARKERS = "osDPX^v*hp"
MARKS = 8  # of a curve
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
WIDTHS = {1: 84, 2: 174}  # [mm] of one and of two columns of a journal, as Springer has them
KINDS_OF_FONTS = ("sans-serif", "serif", "monospace")
ESCAPES = str.maketrans(
    {character: f"\\{character}" for character in "&%$#_{}"}
    | {"\\": r"\textbackslash{}", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}"}
    | {"<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}"}
)
TEX = ("lualatex", "xelatex", "pdflatex")  # any of them measures the texts of PGF
ENDS = 1e4  # largest ratio that is shown
SHARES = {"instances": "instances", "families": "instances, by family,"}


def stroke(number: int) -> dict[str, Any]:
    """How the curve of a solver is drawn; the pages of the site draw it alike."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "linestyle": STROKES[number % len(STROKES)],
        "marker": MARKERS[number % len(MARKERS)],
        "markersize": 4,
    }


def steps(axes: Any, x: Array, y: Array, number: int, name: str) -> None:
    """A curve of steps, with a few marks: evenly over the axis, and not above those of others."""
    even = np.linspace(0.0, 1.0, MARKS) + (number % 4) / (4 * MARKS)
    places = np.searchsorted(x, x[0] * (x[-1] / x[0]) ** even, side="right") - 1
    marks = np.unique(places).tolist()
    axes.step(x, y, where="post", label=label(name), markevery=marks, **stroke(number))


def label(text: str) -> str:
    """A name as Matplotlib shows it: it takes $ for mathematics, and hides a leading _."""
    text = text.replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text


def latex_text(text: str) -> str:
    """A text as LaTeX prints it."""
    return text.translate(ESCAPES)


def wrapped(caption: str, width: int = 110) -> str:
    """A caption broken into lines between its parts; only a very long part is broken inside."""
    parts = [part.replace(" ", "\0") for part in caption.split("; ")]
    whole = "; ".join(part if len(part) < width else part.replace("\0", " ") for part in parts)
    return "\n".join(textwrap.wrap(whole, width)).replace("\0", " ")


def require_formats(formats: Iterable[str]) -> None:
    """ValueError for a format that Matplotlib does not write."""
    from matplotlib.backend_bases import FigureCanvasBase

    known = FigureCanvasBase.get_supported_filetypes()
    for one in formats:
        if one not in known:
            raise ValueError(f"{one!r} is no format of pictures; there is: {', '.join(known)}")


@contextmanager
def figure(folder: Path, name: str, formats: Sequence[str], caption: str = "") -> Iterator[Any]:
    """Axes to draw in. The figure is then written to the folder in each format, and closed.

    The caption stands below, in as many lines as it needs.
    """
    with opened(STYLE, SIZE, formats) as (drawn, axes):
        yield axes
        if caption:
            drawn.supxlabel(label(wrapped(caption)), fontsize=5.5)
        folder.mkdir(parents=True, exist_ok=True)
        for kind in formats:
            save(drawn, folder / f"{name}.{kind}")


@contextmanager
def of_paper(path: Path, columns: int, font: str, height: float = 0.62) -> Iterator[Any]:
    """Axes of a figure of one or two columns of a journal, with the legend below; then it is saved.

    Args:
        path: where it is saved; the ending is the format.
        columns: 1 or 2.
        font: the name of a font or of a kind of fonts, such as "serif".
        height: of the figure without the legend, over the width of one column.

    Raises:
        ValueError: the format, or the font, is not known here.
    """
    width = WIDTHS[columns] / 25.4
    with opened(STYLE | fonts_of(font), (width, 1.0), [path.suffix[1:]]) as (drawn, axes):
        yield axes
        # what weighs the same is in the caption
        axes.set_ylabel(re.sub(" of .* solved", " solved", axes.get_ylabel()))
        handles, names = axes.get_legend_handles_labels()
        if path.suffix == ".pgf":
            # Matplotlib takes a backslash before $ away, from a text without formulas
            names = [latex_text(name.replace(r"\$", "$")).replace(r"\$", r"\\$") for name in names]
        room = 18 * width  # characters of a legend in a line
        across = max(1, min(len(names), int(room / (7 + max(map(len, names), default=1)))))
        lines = -(-len(names) // across)
        drawn.set_size_inches(width, height * WIDTHS[1] / 25.4 + 0.14 * lines)
        drawn.legend(handles, names, loc="outside lower center", ncols=across, handlelength=2.8)
        save(drawn, path)


def fonts_of(font: str) -> dict[str, Any]:
    """Settings for a font, or for a kind of fonts. Raises ValueError if there is no such font."""
    from matplotlib import font_manager

    if font not in KINDS_OF_FONTS:
        try:
            font_manager.findfont(font, fallback_to_default=False)
        except ValueError:
            raise ValueError(
                f"there is no font {font!r}; say {', '.join(KINDS_OF_FONTS)}, or the name of one"
            ) from None
    return {
        "font.family": font,
        "mathtext.fontset": "dejavuserif" if font == "serif" else "dejavusans",
    }


@contextmanager
def opened(
    style: Mapping[str, Any], size: tuple[float, float], formats: Sequence[str]
) -> Iterator[tuple[Any, Any]]:
    """A figure and its axes, which is closed in the end.

    Raises:
        ValueError: PGF is asked for, and there is no TeX, which measures its texts.
    """
    import matplotlib

    matplotlib.use("Agg", force=False)
    import matplotlib.pyplot as plt

    settings: Any = {**style}
    if "pgf" in formats:
        found = next(filter(shutil.which, TEX), None)
        if found is None:
            raise ValueError(f"PGF needs one of {', '.join(TEX)}; PDF and SVG need no TeX")
        settings |= {"pgf.texsystem": found, "pgf.rcfonts": False}
    with plt.rc_context(settings):
        drawn, axes = plt.subplots(figsize=size, layout="constrained")
        try:
            yield drawn, axes
        finally:
            plt.close(drawn)


def save(drawn: Any, path: Path) -> None:
    """Write a figure, whole or not at all; the same data give the same file."""
    kind = path.suffix[1:]
    stamp = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind)
    try:
        replace_file(path, lambda beside: drawn.savefig(beside, format=kind, metadata=stamp))
    except Exception as error:
        if kind != "pgf":
            raise
        # a TeX without some of its packages
        reason = str(error).strip().splitlines()[0]
        raise ValueError(f"PGF: TeX fails: {reason}; PDF and SVG need no TeX") from None
    drawn.set_layout_engine("none")  # the layout is fixed: saves two thirds of the time


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
    """Dolan & More's profiles with their 95 % bands."""
    with figure(folder, f"performance-{costs.metric}{ending}", formats, caption) as axes:
        draw_performance(axes, costs, weigh, banded=True)
        _legend(axes)


def draw_performance(axes: Any, costs: Costs, weigh: Weigh, *, banded: bool) -> None:
    """Dolan & More's profiles, the ratio on a logarithmic axis."""
    quotients = profiles.ratios(costs.values)
    finite = quotients[np.isfinite(quotients)]
    end = min(ENDS, 1.3 * float(finite.max(initial=2.0)))
    taus = np.unique(np.concatenate([[1.0, end], finite[finite <= end]]))
    spaced = np.geomspace(1, end, 200)
    weights = costs.weights(weigh)
    curves = profiles.share_within(quotients, taus, weights)
    order = _order(costs, profiles.share_within(quotients, spaced, weights))
    for rank, k in enumerate(order):
        steps(axes, taus, curves[k], rank, costs.legend(k))
    if banded:
        low, high = profiles.bands(costs, quotients, spaced, weigh)
        for rank, k in enumerate(order):
            colour = stroke(rank)["color"]
            axes.fill_between(
                spaced, low[k], high[k], step="post", alpha=0.1, color=colour, linewidth=0
            )
    axes.set_xscale("log")
    axes.set_xlim(1.0, end)
    axes.set_ylim(0.0, 1.02)
    axes.set_xlabel(rf"$\tau$: {METRICS[costs.metric][0].split(' [')[0]} over that of the best")
    axes.set_ylabel(rf"share of {SHARES[weigh]} solved within $\tau$")


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
    if not shown.solved.any():
        return
    name = f"data-{costs.metric}" + ("-per-contact" if per_contact else "") + ending
    with figure(folder, name, formats, caption) as axes:
        draw_data(axes, shown, weigh, " per contact" if per_contact else "")
        _legend(axes)


def draw_data(axes: Any, costs: Costs, weigh: Weigh, per: str = "") -> None:
    """The share solved within a cost, on a logarithmic axis; some instance is solved."""
    finite = costs.values[costs.solved]
    ends = 0.8 * float(finite.min()), 1.2 * float(finite.max())
    bounds = np.unique(np.concatenate([ends, finite]))
    weights = costs.weights(weigh)
    curves = profiles.share_within(costs.values, bounds, weights)
    grid = profiles.share_within(costs.values, np.geomspace(*ends, 200), weights)
    for rank, k in enumerate(_order(costs, grid)):
        steps(axes, bounds, curves[k], rank, costs.legend(k))
    axes.set_xscale("log")
    axes.set_xlim(*ends)
    axes.set_ylim(0.0, 1.02)
    axes.set_xlabel(METRICS[costs.metric][0] + per)
    axes.set_ylabel(f"share of {SHARES[weigh]} solved")


def work_precision(
    points: Sequence[Mapping[str, Any]],
    metric: str,
    folder: Path,
    formats: Sequence[str],
    caption: str = "",
) -> None:
    """The mean cost at each tolerance."""
    with figure(folder, f"work-precision-{metric}", formats, caption) as axes:
        draw_work_precision(axes, points, metric)
        _legend(axes)


def draw_work_precision(axes: Any, points: Sequence[Mapping[str, Any]], metric: str) -> None:
    """The mean cost at each tolerance; a mark is hollow if not all problems were solved."""
    solvers = list(dict.fromkeys(point["solver"] for point in points))
    least = {s: min(p["mean"] for p in points if p["solver"] == s) for s in solvers}
    for rank, solver in enumerate(sorted(solvers, key=lambda s: least[s])):
        own = [point for point in points if point["solver"] == solver]
        style = stroke(rank)
        x, y = [p["mean"] for p in own], [p["tol"] for p in own]
        fills = [style["color"] if p["solved"] == p["of"] else "white" for p in own]
        counts = ", ".join(dict.fromkeys(f"{p['solved']} of {p['of']}" for p in own))
        axes.plot(x, y, **style, label=label(f"{solver} {counts}"))
        axes.scatter(
            x,
            y,
            s=16,
            c=fills,
            marker=style["marker"],
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
    axes.set_ylabel("tolerance")


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
            steps(axes, times, curve, rank, legend.get(solver, solver))
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
            steps(axes, bounds, curves[solver], rank, legend.get(solver, solver))
        axes.set_xscale("log")
        axes.set_xlim(*ends)
        axes.set_ylim(0.0, 1.02)
        axes.set_xlabel("CPU time [s]")
        axes.set_ylabel("share of runs and errors reached")
        _legend(axes)
