"""A page for each family of solvers, from the registry and from the opening of their files."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import fclib
from fclib import external
from fclib.cli.solvers import default_of, domain_of

# a lower number comes first
ORDER = [
    "chain",
    "splitting",
    "newton",
    "interior point",
    "proximal point",
    "optimisation",
    "variational inequality",
    "relaxation",
]


def pages(root: Path, report: str = "") -> Iterator[tuple[str, str]]:
    """The index and the families; `report` is the address of a report, for links to it."""
    notes = opening_comments(root / "core" / "solvers")
    families: dict[str, list[fclib.SolverInfo]] = defaultdict(list)
    for solver in fclib.solvers():
        families[solver.family].append(solver)
    order = sorted(families, key=lambda name: (ORDER.index(name) if name in ORDER else 99, name))
    yield "solvers/index.md", index({name: families[name] for name in order})
    for name in order:
        yield f"solvers/{file_of(name)}", page(name, families[name], notes, report)


def file_of(family: str) -> str:
    """The page of a family."""
    return f"{family.replace(' ', '-')}.md"


def anchor_of(solver: fclib.SolverInfo) -> str:
    """The anchor of a solver on its page."""
    return "solver-" + re.sub(r"\W+", "-", solver.name)


def opening_comments(folder: Path) -> dict[str, str]:
    """The comment on top of the file of each solver, by its name."""
    found = {}
    for path in sorted(folder.glob("*.cpp")):
        text = path.read_text(encoding="utf-8")
        # the first text in the entry of the registry is the name
        name = re.search(r'const Solver& solver\(\).*?"([^"]+)"', text, re.DOTALL)
        if name is None:
            raise ValueError(f"{path}: has no solver")
        lines = []
        for line in text.splitlines():
            if not line.startswith("//"):
                break
            lines.append(line.removeprefix("//").removeprefix(" "))
        found[name[1]] = "\n".join(lines)
    return found


def takes(solver: fclib.SolverInfo) -> str:
    """The problems that a solver takes."""
    plain = [f"{d}D" for d in solver.dimensions]
    rolling = [f"rolling {d}" for d in solver.rolling_dimensions]
    return ", ".join([*plain, *rolling, *(f"spin {d}" for d in solver.spin_dimensions)])


def index(families: dict[str, list[fclib.SolverInfo]]) -> str:
    """All of them in tables."""
    lines = [
        "# The solvers, by family",
        "",
        "From the registry: `fclib solvers` prints the same. Built-in solvers take every "
        "formulation: global problems are condensed and bilateral constraints eliminated before, "
        "and taken back after ([mathematics](../mathematics.md#conversions)). "
        "[Which solver](../choosing.md) to take follows from measurements.",
        "",
        "| family | solver | takes | what |",
        "|---|---|---|---|",
    ]
    for family, members in families.items():
        for solver in members:
            link = f"[`{solver.name}`](#{anchor_of(solver)})"
            lines.append(f"| {family} | {link} | {takes(solver)} | {solver.title} |")
    absent = external.absent()
    if absent:
        lines += ["", "Not installed where this page was made:", ""]
        lines += [f"- {entry.solvers}: {entry.missing}" for entry in absent]
    return "\n".join(lines) + "\n"


def page(family: str, members: list[fclib.SolverInfo], notes: dict[str, str], report: str) -> str:
    """The solvers of a family in full, the built-in ones first."""
    lines = [f"# {family.capitalize()}", ""]
    for solver in sorted(members, key=lambda s: (s.origin != "fclib", s.name)):
        lines += [f"({anchor_of(solver)})=", f"## {solver.name}", "", f"{solver.title}.", ""]
        if solver.name in notes:
            lines += ["```text", notes[solver.name], "```", ""]
        lines += ["| | |", "|---|---|", f"| from | {solver.origin} |"]
        if solver.citation:
            lines.append(f"| published | {solver.citation} |")
        if report:
            own = f"{report}/index.html#/solver/{solver.name}"
            lines.append(f"| measured | [its runs in the report]({own}) |")
        lines += [f"| takes | {takes(solver)} |", f"| iterations | {solver.max_iterations:,} |", ""]
        if not solver.options:
            continue
        lines += ["| option | default | values | meaning |", "|---|---|---|---|"]
        for option in solver.options:
            default = "below" if option.type == "text" else default_of(option)
            lines.append(
                f"| `{option.name}` | {default} | {cell(domain_of(option))} | {cell(option.doc)} |"
            )
        lines.append("")
        for option in solver.options:
            if option.type == "text":
                lines += [f"`{option.name}`:", "", "```text", default_of(option).strip(), "```", ""]
    return "\n".join(lines)


def cell(text: str) -> str:
    """Text that a table holds."""
    return text.replace("|", r"\|").replace("*", r"\*")
