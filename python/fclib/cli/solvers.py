"""``fclib solvers``: what there is, from the one place where each solver is written."""

from __future__ import annotations

from typing import Any

import fclib
from fclib.cli._output import Json, Report, make_table, out


def describe(option: fclib.OptionInfo) -> dict[str, Any]:
    """The record of an option."""
    return {
        "option": option.name,
        "type": " | ".join(option.choices) or option.type,
        "default": option.default,
        "unit": option.unit,
        "meaning": option.doc,
    }


def command(as_json: Json = False) -> None:
    """List the solvers with their options."""
    report = Report(as_json)
    for solver in fclib.solvers():
        options = [describe(option) for option in solver.options]
        if as_json:
            report.add(
                {
                    "solver": solver.name,
                    "family": solver.family,
                    "title": solver.title,
                    "citation": solver.citation,
                    "dimensions": solver.dimensions,
                    "rolling_dimensions": solver.rolling_dimensions,
                    "options": options,
                }
            )
            continue
        takes = ", ".join(f"{d}D" for d in solver.dimensions)
        if solver.rolling_dimensions:
            takes += ", rolling"
        out.print(f"[bold]{solver.name}[/]  {solver.title} ({solver.family}; {takes})")
        out.print(f"  {solver.citation}\n", highlight=False)
        out.print(make_table(options))
