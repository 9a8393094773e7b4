"""Pictures of a family: its scene, and how contacts and degrees of freedom are distributed.

Contacts and degrees of freedom are whole numbers: their bins have whole widths about them, and the
axes have whole numbers only.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from fclib._files import replace_file
from fclib._words import counted
from fclib.collections.handed import drawing

if TYPE_CHECKING:
    from fclib.collections.trajectory import Trajectory
    from fclib.simulate import Model

BINS = 40  # largest number, as in RT-0444
# column, label
MEASURES = (
    ("nc", "contacts"),
    ("n", "degrees of freedom"),
    ("density", "contact components for a degree of freedom"),
)


def bins_of(values: Sequence[float]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """The edges of the bins of a histogram, and the number of values in each.

    Whole numbers get bins of a whole width, whose edges are between them. Equal values get one bin.
    """
    own = np.asarray(values, dtype=float)
    low, high = own.min(), own.max()
    if is_whole(values):
        width = max(1, np.ceil((high - low + 1) / BINS))
        edges = low - 0.5 + width * np.arange(np.ceil((high - low + 1) / width) + 1)
    elif low == high:
        half = 0.5 * (abs(low) or 1.0)
        edges = np.array([low - half, low + half])
    else:
        edges = np.linspace(low, high, min(BINS, np.unique(own).size) + 1)
    return edges, np.histogram(own, edges)[0]


def is_whole(values: Sequence[float]) -> bool:
    """Whether all are whole numbers."""
    return all(float(value).is_integer() for value in values)


def draw_states(states: Trajectory, folder: Path) -> Path | None:
    """Write scene.png, the state that was assembled last; None if nothing can draw here."""
    if states.handed is None:
        return draw_scene(states.model, folder)
    try:
        from fclib.simulate import model_of
    except ImportError:  # these states need no MuJoCo but for this picture
        return None
    xml = drawing(states.handed, states.scene, states.position[-1])
    return draw_scene(model_of(replace(states.scene, xml=xml)), folder)


def draw_scene(model: Model, folder: Path) -> Path | None:
    """Write scene.png, the state of a model; None if nothing can draw here."""
    from fclib.simulate import NoRenderer, render

    target = folder / "scene.png"
    try:
        render(model, target)
    except NoRenderer:
        return None
    return target


def draw_distribution(rows: Sequence[Mapping[str, Any]], folder: Path, title: str) -> None:
    """Write distribution.png and .svg: histograms as in RT-0444, one for each measure.

    Without Matplotlib nothing is drawn.
    """
    try:
        figure_module = importlib.import_module("matplotlib.figure")
        matplotlib = importlib.import_module("matplotlib")
    except ImportError:
        return
    # otherwise the identifiers of an SVG are random
    with matplotlib.rc_context({"svg.hashsalt": "fclib", "font.size": 9}):
        whole = importlib.import_module("matplotlib.ticker").MaxNLocator
        figure = figure_module.Figure(figsize=(9, 2.6), layout="constrained")
        axes = figure.subplots(1, len(MEASURES), sharey=True)
        for axis, (column, label) in zip(axes, MEASURES, strict=True):
            # a local problem has no density
            values = [row[column] for row in rows if row[column] is not None]
            axis.set_xlabel(label)
            if values:
                edges, counts = bins_of(values)
                axis.bar(edges[:-1], counts, np.diff(edges), align="edge", color="#3b6ea5")
                if is_whole(values):
                    axis.xaxis.set_major_locator(whole(nbins=5, integer=True))
            axis.spines[["top", "right"]].set_visible(False)
        axes[0].set_ylabel("problems")
        axes[0].yaxis.set_major_locator(whole(nbins=5, integer=True))
        figure.suptitle(f"{title}: {counted(len(rows), 'problem')}", fontsize=10)
        for suffix, metadata in ((".png", {"Software": None}), (".svg", {"Date": None})):
            save = partial(figure.savefig, format=suffix[1:], dpi=160, metadata=metadata)
            replace_file(folder / f"distribution{suffix}", save)
            figure.set_layout_engine("none")  # fixes the place of the axes
