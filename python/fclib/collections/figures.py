"""Pictures of a family: its scene, and how contacts and degrees of freedom are distributed."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fclib.collections.handed import drawing

if TYPE_CHECKING:
    from fclib.collections.trajectory import Trajectory
    from fclib.simulate import Model

BINS = 40
# column, label
MEASURES = (
    ("nc", "contacts"),
    ("n", "degrees of freedom"),
    ("density", "contact components for a degree of freedom"),
)


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
        figure = figure_module.Figure(figsize=(9, 2.6), layout="constrained")
        axes = figure.subplots(1, len(MEASURES), sharey=True)
        for axis, (column, label) in zip(axes, MEASURES, strict=True):
            # a local problem has no density
            values = [row[column] for row in rows if row[column] is not None]
            axis.hist(values, bins=BINS, color="#3b6ea5", linewidth=0)
            axis.set_xlabel(label)
            axis.spines[["top", "right"]].set_visible(False)
        axes[0].set_ylabel("problems")
        figure.suptitle(f"{title}: {len(rows)} problems", fontsize=10)
        for suffix, metadata in ((".png", {"Software": None}), (".svg", {"Date": None})):
            figure.savefig(folder / f"distribution{suffix}", dpi=160, metadata=metadata)
            figure.set_layout_engine("none")  # fixes the place of the axes
