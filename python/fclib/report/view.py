"""One problem as pictures: its network of contacts with the reactions, and its pattern."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.spatial import ConvexHull, QhullError

from fclib import _core, _laws
from fclib._files import write_bytes
from fclib.report.libraries import libraries
from fclib.report.network import Network, network_of
from fclib.report.solids import record_of, solids_of

ASSETS = Path(__file__).with_name("assets")
DIGITS = 5  # significant digits of positions and reactions in a picture
CELLS = 128  # cells of a pattern, along its longer side
# largest number of contacts of a global problem for which W is made, for its pattern
CONDENSED = 2000
SPECTRUM = 750  # largest number of rows of W for its eigenvalues
SCRIPTS = ("table.js", "plot.js", "scene.js")
PANEL = ("live.js", "whatif.js", "compute.js")  # the scripts that check and solve
STATUS = ("open", "stick", "slide")
END = re.compile("</script", re.IGNORECASE)


def rounded(values: Any, digits: int = DIGITS) -> Any:
    """Nested lists of numbers with so many significant digits; None if not finite."""
    if isinstance(values, float):
        if not math.isfinite(values):
            return None
        short = float(f"{values:.{digits}g}")
        return int(short) if short.is_integer() and abs(short) < 1e15 else short
    if values is None or isinstance(values, (str, int)):
        return values
    if isinstance(values, np.ndarray):
        values = values.tolist()
    if isinstance(values, (list, tuple)):
        return [rounded(value, digits) for value in values]
    if isinstance(values, Mapping):
        return {key: rounded(value, digits) for key, value in values.items()}
    return values


def as_json(value: Any) -> str:
    """Compact JSON that may stand in a script: no `<`, and no number that JSON does not have."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def view_of(problem: Any, solution: Any = None) -> dict[str, Any]:
    """The data for the picture of a problem, in JSON's types.

    Args:
        problem: in any formulation.
        solution: its solution; without one there are no reactions.
    """
    record: dict[str, Any] = {
        "title": problem.info.title,
        "description": problem.info.description,
        "math_info": problem.info.math_info,
        "formulation": problem.formulation,
        "spacedim": problem.spacedim,
        "n": problem.n,
        "nc": problem.nc,
        "p": problem.p,
        "mu": rounded(np.asarray(problem.mu)),
    }
    if not problem.nc:
        return record | {"patterns": patterns_of(problem, None)}
    W = None
    if not hasattr(problem, "H"):
        W = problem.W
    elif problem.nc <= CONDENSED:
        W = problem.condense().W
    record["patterns"] = patterns_of(problem, W)
    if W is not None:
        record |= spectrum_of(W)
    network = network_of(problem)
    record["network"] = {
        "source": network.source,
        "note": network.note,
        "bodies": rounded(network.bodies) if network.source != "file" else [],
        "points": rounded(network.points, 7 if network.source == "file" else DIGITS),
        "pairs": network.pairs.tolist(),
    }
    if network.source == "file":
        record["solids"] = record_of(solids_of(problem.bodies, problem.contacts))
    elif network.source == "H":
        record["network"]["faces"] = hulls_of(network)
    if network.limits is not None and network.limits.size:
        record["network"]["limits"] = network.limits.tolist()
    if network.cell is not None:
        record["network"]["cell"] = rounded(network.cell)
    if network.shifts is not None:
        crossing = np.flatnonzero(network.shifts.any(axis=1))
        record["network"]["crossing"] = crossing.tolist()
        record["network"]["images"] = rounded((network.points - network.shifts)[crossing])
    if network.frames is not None:
        record["network"]["normals"] = rounded(network.frames[:, :, 0])
        if network.source == "H":
            # a page turns its own reactions into forces; for a file, its contacts give the forces
            record["network"]["tangents"] = rounded(network.frames[:, :, 1])
    if solution is not None:
        record.update(_solved(problem, solution, network))
    return record


def hulls_of(network: Network) -> list[list[int]]:
    """Triangles of the hulls of each body's centre and contact points.

    Returns:
        (triangles, 3) numbers of corners: first the bodies' centres, then the contact points, then
        for contacts that have one, the image at the second body.
    """
    count = len(network.bodies)
    corners = np.concatenate([network.bodies, network.points])
    # (contacts, 2) the corner of each contact at each of its bodies
    ends = np.repeat(count + np.arange(len(network.points))[:, None], 2, axis=1)
    if network.shifts is not None:
        crossing = np.flatnonzero(network.shifts.any(axis=1))
        ends[crossing, 1] = len(corners) + np.arange(crossing.size)
        corners = np.concatenate([corners, (network.points - network.shifts)[crossing]])
    found: list[list[int]] = []
    for body in range(count) if network.source == "H" else ():
        chosen = np.concatenate([[body], ends[network.pairs == body]])
        if chosen.size == 3:
            found.append(chosen.tolist())
        if chosen.size < 4:
            continue
        try:
            # joggled, since contact points are often in one plane
            hull = ConvexHull(corners[chosen], qhull_options="QJ Pp")
        except QhullError:
            continue  # all at one place: the lines from the centre show them
        found += chosen[hull.simplices].tolist()
    return found


def _solved(problem: Any, solution: Any, network: Network) -> dict[str, Any]:
    d, nc = problem.spacedim, problem.nc
    r = np.asarray(solution.r).reshape(nc, d)
    force = r[:, : _laws.of_force(problem.kind, d)]
    each = _core.contact_merits(problem, solution)
    found: dict[str, Any] = {
        "reactions": rounded(force),
        "status": "".join(str(STATUS.index(name)) for name in each["status"]),
    }
    if network.frames is not None:
        inside = network.frames[:, :, : force.shape[1]]
        found["forces"] = rounded(np.einsum("kij,kj->ki", inside, force))
    merit = _core.merit(problem, solution)
    figures = {name: getattr(merit, name) for name in dir(merit) if not name.startswith("_")}
    found["merit"] = rounded(
        {name: float(value) for name, value in figures.items() if not callable(value)}, 6
    )
    return found


# ---- patterns


def spectrum_of(W: Any) -> dict[str, Any]:
    """The eigenvalues of W, the largest first, without those that are only rounding.

    The bound of rounding is that of NumPy's matrix_rank, max(shape) eps sigma_1.
    """
    size = W.shape[0]
    if size > SPECTRUM:
        return {}
    values = np.linalg.eigvalsh(W.toarray() if sp.issparse(W) else np.asarray(W))[::-1]
    threshold = size * np.finfo(float).eps * np.abs(values).max()
    kept = values[values > threshold]
    return {
        "spectrum": {
            "values": rounded(kept, 4),
            "size": size,
            "rank": int(kept.size),
            "conditioning": rounded(float(kept[0] / kept[-1])) if kept.size else None,
        }
    }


def patterns_of(problem: Any, W: Any) -> list[dict[str, Any]]:
    """For each matrix: its shape, its entries, and their number in each cell of a coarse grid.

    Args:
        problem: in any formulation.
        W: W of the problem itself, or of its condensed form; None: left out.
    """
    found = []
    for name in ("W", "M", "H", "G", "V", "R"):
        matrix = W if name == "W" else getattr(problem, name, None)
        if matrix is None or 0 in matrix.shape:
            continue
        entries = sp.coo_array(matrix if sp.issparse(matrix) else np.asarray(matrix))
        keep = entries.data != 0
        cell = max(1, math.ceil(max(matrix.shape) / CELLS))
        cells, counts = np.unique(
            np.column_stack([entries.row[keep] // cell, entries.col[keep] // cell]),
            axis=0,
            return_counts=True,
        )
        info = problem.matrix_info.get(name)
        known = {key: getattr(info, key, None) for key in ("rank", "conditioning", "determinant")}
        found.append(
            {
                **{key: rounded(value) for key, value in known.items() if value},
                "name": name,
                "shape": list(matrix.shape),
                "nnz": int(keep.sum()),
                "cell": cell,
                "rows": cells[:, 0].tolist(),
                "columns": cells[:, 1].tolist(),
                "counts": counts.tolist(),
            }
        )
    return found


# ---- one page


def asset(name: str) -> str:
    """The text of a file of the site."""
    return (ASSETS / name).read_text(encoding="utf-8")


def write_view(
    record: Mapping[str, Any], path: Path, title: str = "", compute: Mapping[str, Any] | None = None
) -> None:
    """Write a page that holds all it needs; the file is whole, or stays the old one.

    Args:
        record: result of `view_of`.
        path: of the page.
        title: name of the problem's file.
        compute: result of `serving.served` for the file and the module, for a panel that checks and
            solves the problem.

    Raises:
        ReportError: a library is not installed.
    """
    styles: list[str] = []
    scripts = [asset("core.js")]
    known = []
    for library in libraries():
        known.append(library.record | {"text": library.notices})
        for name, text in library.files.items():
            (scripts if name.endswith(".js") else styles).append(text)
    chosen = (*SCRIPTS, *(PANEL if compute else ()), "view.js")
    scripts += [asset(name) for name in chosen]
    known += (compute or {}).get("libraries", [])
    shown = dict(record, file=title, libraries=known, compute=compute)
    scripts.append(f"Fclib.view({as_json(shown)});")
    # "</script" inside a string would end the script element
    elements = ["<script>\n" + END.sub(r"<\\/script", text) + "\n</script>" for text in scripts]
    page = asset("view.html")
    for mark, text in {
        "/*STYLE*/": "\n".join([*styles, asset("style.css")]),
        "/*SCRIPTS*/": "\n".join(elements),
    }.items():
        page = page.replace(mark, text)
    # the name of a file may not be valid text
    write_bytes(path, page.encode(errors="replace"))
