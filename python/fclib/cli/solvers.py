"""``fclib solvers``: the list of solvers, from the one place at which each is written."""

from __future__ import annotations

import inspect
import math
from typing import Annotated, Any

import typer
from rich.padding import Padding
from rich.text import Text

import fclib
from fclib import external
from fclib.cli._output import Json, Modules, Report, Rows, load_modules, out, usage_error

DEFAULT = inspect.signature(fclib.solve).parameters["solver"].default


def describe(option: fclib.OptionInfo) -> dict[str, Any]:
    """The record of an option."""
    return {
        "option": option.name,
        "type": " | ".join(option.choices) or option.type,
        "default": option.default,
        "unit": option.unit,
        "lowest": option.lowest,
        "highest": option.highest,
        "meaning": option.doc,
    }


def default_of(option: fclib.OptionInfo) -> str:
    """The default, in the form of the command line."""
    default = option.default
    return str(default).lower() if isinstance(default, bool) else f"{default}"


def domain_of(option: fclib.OptionInfo) -> str:
    """The values that an option takes: "float in [0.1, 1], unit 1/||W||"."""
    if option.choices:
        return "one of: " + " | ".join(option.choices)
    text = option.type
    ends = [option.lowest, option.highest]
    if any(map(math.isfinite, ends)):
        low, high = (f"{end:g}" if math.isfinite(end) else "..." for end in ends)
        text += f" in [{low}, {high}]"
    return text + (f", unit {option.unit}" if option.unit not in ("", "1") else "")


def taken(solver: fclib.SolverInfo) -> str:
    """The problems that a solver takes: "2D 3D rolling spin"."""
    plain = [f"{d}D" for d in solver.dimensions]
    laws = {"rolling": solver.rolling_dimensions, "spin": solver.spin_dimensions}
    return " ".join([*plain, *(law for law, taken in laws.items() if taken)])


def record_of(solver: fclib.SolverInfo) -> dict[str, Any]:
    """All facts on a solver."""
    return {
        "solver": solver.name,
        "origin": solver.origin,
        "family": solver.family,
        "title": solver.title,
        "citation": solver.citation,
        "dimensions": solver.dimensions,
        "rolling_dimensions": solver.rolling_dimensions,
        "spin_dimensions": solver.spin_dimensions,
        "max_iterations": solver.max_iterations,
        "options": [describe(option) for option in solver.options],
    }


def show_option(option: fclib.OptionInfo) -> None:
    """An option: its default, its values and what it means."""
    lines = default_of(option).strip().splitlines() or [""]
    value = "" if len(lines) > 1 else lines[0]
    out.print(Text.assemble("  ", (option.name, "bold"), f" = {value}"))
    for line in lines if len(lines) > 1 else []:
        out.print(Padding(Text(line), (0, 0, 0, 4), expand=False), soft_wrap=True)
    for line in (domain_of(option), option.doc):
        out.print(Padding(Text(line), (0, 0, 0, 6), expand=False))


def show_chain(report: Report) -> None:
    """The words of the option chain of `auto`."""
    for method in fclib.chain_methods():
        if report.as_json:
            rules = [describe(rule) for rule in method.rules]
            report.add({"method": method.name or None, "meaning": method.doc, "rules": rules})
            continue
        out.print(Text.assemble((method.name or "any stage", "bold"), f"  {method.doc}"))
        for rule in method.rules:
            show_option(rule)
        out.print()


def show(solver: fclib.SolverInfo) -> None:
    """Print all facts on a solver."""
    rolling = {3: "planar", 5: "spatial"}
    takes = [f"{d}D" for d in solver.dimensions]
    takes += [f"{rolling[d]} rolling" for d in solver.rolling_dimensions]
    takes += ["spin" if d == 4 else "spin and rolling" for d in solver.spin_dimensions]
    out.print(Text.assemble((solver.name, "bold"), f"  {solver.title}"))
    lines = {
        "family": solver.family,
        "from": solver.origin,
        "citation": solver.citation,
        "takes": f"{', '.join(takes)}; global and mixed problems are brought to the local form",
        "iterations": f"at most {solver.max_iterations:,} if no other limit is given",
    }
    for name, text in lines.items():
        if text:
            out.print(f"  {name:10}  {text}", highlight=False)
    for option in solver.options:
        show_option(option)
    if solver.options:
        first = solver.options[0]
        given = f"--option {first.name}={default_of(first)}"
        out.print(f"  as in: fclib solve --solver {solver.name} {given} FILE", highlight=False)
    else:
        out.print("  no options")
    out.print()


def command(
    names: Annotated[
        list[str] | None, typer.Argument(help="Show these in full.", show_default=False)
    ] = None,
    chain: Annotated[
        bool, typer.Option("--chain", help="Show what a stage of auto's option chain may say.")
    ] = False,
    module: Modules = None,
    as_json: Json = False,
) -> None:
    """List the solvers, or show some of them with their options."""
    load_modules(module)
    report = Report(as_json)
    if chain:
        show_chain(report)
        return
    try:
        chosen = [fclib.find_solver(name) for name in names] if names else fclib.solvers()
    except fclib.OptionError as error:
        usage_error(error)
    if as_json:
        for solver in chosen:
            report.add(record_of(solver))
        for absent in [] if names else external.absent():
            report.add({"absent": absent.solvers, "missing": absent.missing})
        return
    if names:
        for solver in chosen:
            show(solver)
        return
    # the default, the built-in ones by family, then those of others
    chosen.sort(key=lambda s: (s.name != DEFAULT, s.origin != "fclib", s.origin, s.family, s.name))
    rows = [
        {
            "solver": solver.name,
            "family": solver.family,
            "takes": taken(solver),
            "title": solver.title,
        }
        for solver in chosen
    ]
    out.print(Rows(rows))
    out.print("\nfclib solvers NAME... shows them with their options and citations.")
    out.print("Any program is one, too: cmd:PROGRAM {input} {output}", highlight=False)
    for absent in external.absent():
        out.print(f"Not here: {absent.solvers}: {absent.missing}", highlight=False)
