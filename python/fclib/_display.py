"""The display of problems, solutions, merits and results in notebooks: a small table."""

from __future__ import annotations

import html as escape
from typing import Any

import numpy as np

from fclib import _core

MATRICES = ("M", "H", "G", "W", "V", "R")


def html(shown: Any) -> str:
    """An object of the core as a table with its name above."""
    kind = type(shown).__name__
    if isinstance(shown, _core.Result):
        rows = result_rows(shown)
    elif isinstance(shown, _core.Merit):
        rows = merit_rows(shown)
    elif isinstance(shown, _core.Solution):
        rows = solution_rows(shown)
    else:
        rows = problem_rows(shown)
    cells = "".join(
        f'<tr><th style="text-align:left">{escape.escape(name)}</th>'
        f'<td style="text-align:left">{escape.escape(value)}</td></tr>'
        for name, value in rows
    )
    return f"<table><caption>fclib.{kind}</caption>{cells}</table>"


def problem_rows(problem: Any) -> list[tuple[str, str]]:
    """Formulation, sizes, and the entries of each matrix."""
    rows = [("formulation", problem.formulation), ("contacts", str(problem.nc))]
    if problem.info.title:
        rows.insert(0, ("title", problem.info.title))
    if problem.n:
        rows.append(("degrees of freedom", str(problem.n)))
    if problem.p:
        rows.append(("bilateral constraints", str(problem.p)))
    if problem.nc:
        low, high = problem.mu.min(), problem.mu.max()
        rows.append(("mu", f"{low:g}" if low == high else f"{low:g} to {high:g}"))
    for name in MATRICES:
        matrix = getattr(problem, name, None)
        if matrix is None:
            continue
        shape = f"{matrix.shape[0]} x {matrix.shape[1]}"
        entries = (
            "dense" if isinstance(matrix, np.ndarray) else f"{matrix.format}, {matrix.nnz} entries"
        )
        rows.append((name, f"{shape}, {entries}"))
    return rows


def solution_rows(solution: _core.Solution) -> list[tuple[str, str]]:
    """Size and norm of each vector."""
    vectors = {name: getattr(solution, name) for name in ("v", "u", "r", "l")}
    return [
        (name, f"({len(values)},), norm {np.linalg.norm(values):.3g}")
        for name, values in vectors.items()
        if values is not None
    ]


def merit_rows(merit: _core.Merit) -> list[tuple[str, str]]:
    """The error and its parts, the contacts by their status."""
    parts = ("error", "natural", "scaled_natural", "dynamics", "bilateral", "kinematics")
    rows = [(name, f"{getattr(merit, name):.2e}") for name in parts]
    return [*rows, *((name, str(getattr(merit, name))) for name in ("open", "stick", "slide"))]


def result_rows(result: _core.Result) -> list[tuple[str, str]]:
    """The status, the error and the cost of a result."""
    rows = [
        ("solver", result.solver),
        ("status", result.status),
        ("error", f"{result.error:.2e}"),
        ("iterations", str(result.iterations)),
        ("CPU time", f"{result.cpu_s:.2e} s, and {result.setup_s:.2e} s around it"),
    ]
    if result.message:
        rows.append(("message", result.message))
    if result.stages:
        rows.append(("stages", ", ".join(stage.name for stage in result.stages)))
    return rows
