"""A page for each family of the collection, from its class."""

from __future__ import annotations

import dataclasses
import inspect
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fclib import scenes, simulate
from fclib.collections import plan
from fclib.collections.references import TARGET
from fclib.collections.set_index import SETS, distinct_of

SIZE = (720, 540)  # of a picture [pixels]
Kind = type[scenes.Described]


def pages(draws: bool, report: str = "") -> Iterator[tuple[str, str | bytes]]:
    """The pages, their index, and pictures if they are asked for and something can draw here.

    `report` is the address of a report, for links to it.
    """
    known = plan.families()
    order = {name: place for place, name in enumerate(SETS)}
    by_set = sorted(known, key=lambda name: (order.get(known[name].collection, 99), name))
    drawn = set()
    for name in by_set:
        picture = draw(name) if draws else None
        if picture is not None:
            drawn.add(name)
            yield f"families/{name}.png", picture
        yield f"families/{name}.md", page(name, known[name], picture is not None, report)
    yield "families/index.md", index({name: known[name] for name in by_set}, drawn, report)


def index(families: dict[str, Kind], drawn: set[str], report: str) -> str:
    """The sets and the families, in tables, with a small picture if one is drawn."""
    lines = [
        "# Families",
        "",
        "All families, from their classes in `python/fclib/scenes/`. "
        "[The collection](../collection.md) says how they are built, and "
        "[a family of your own](../families-of-your-own.md) how one is added.",
        *browsed(report, "#/catalogue", "All problems in the report: filter, see, take, cite them"),
        "",
        "| set | version | what |",
        "|---|---|---|",
    ]
    lines += [f"| {name} | {version} | {what} |" for name, (version, what) in SETS.items()]
    lines += ["", "| | set | family | problems | distinct | what |", "|---|---|---|---:|---:|---|"]
    lines += [
        f"| {f'![{name}]({name}.png){{width=96px}}' if name in drawn else ''}"
        f" | {kind.collection} | [{name}]({name}.md) | {kind.problems}"
        f" | {distinct(name, kind) or ''} | {kind.description} |"
        for name, kind in families.items()
    ]
    return "\n".join(lines) + "\n"


def distinct(name: str, kind: Kind) -> int | None:
    """How many of its problems differ, if that is known without a simulation."""
    return distinct_of([f"{kind.collection}/{name}"])


def browsed(report: str, place: str, text: str) -> list[str]:
    """A paragraph that links to a place in the report, if one is served."""
    return ["", f"[{text}]({report}/index.html{place})", ""] if report else []


def page(name: str, kind: Kind, drawn: bool, report: str) -> str:
    """One family: what it is, its parameters, what is built of it."""
    planned = plan.Plan.of_family(name)
    simulated = name in scenes.families()
    lines = [f"# {name}", "", f"**{kind.title}.** {kind.description}", ""]
    if drawn:
        lines += [f"![The scene of {name} at its start]({name}.png){{width=480px}}", ""]
    lines += browsed(report, f"#/family/{name}", "Its problems and runs in the report")
    number = f"the first {kind.problems} steps with contact" if simulated else f"{kind.problems}"
    if different := distinct(name, kind):
        number += f", {different} of them distinct"
    lines += [inspect.getdoc(kind) or "", "", "| | |", "|---|---|"]
    lines += [
        f"| set | {kind.collection} |",
        f"| field of application | {kind.application} |",
        f"| friction | {kind.friction} |",
        f"| authors of the original | {kind.authors} |",
        f"| made by | {'simulation' if simulated else 'assembly, without a simulation'} |",
        f"| problems | {number}, seed {planned.scene.seed} |",
        f"| forms | {', '.join(planned.forms)} |",
        f"| solved by | `{planned.solver}`, and finished to {TARGET:g} |",
        "",
        "## Parameters",
        "",
        "| parameter | default | unit | meaning |",
        "|---|---|---|---|",
    ]
    fields: Any = kind
    lines += [
        f"| `{field.name}` | {shown(field.default)} | {field.metadata['unit']} "
        f"| {field.metadata['doc']} |"
        for field in dataclasses.fields(fields)
    ]
    lines += [
        "",
        "## To build it",
        "",
        "```sh",
        f"fclib collection build {name} --out collection",
        "```",
        "",
        "With other parameters, which go into the first brackets, from Python:",
        "",
        "```python",
        *(made_by_simulation(name) if simulated else made_by_assembly(name)),
        "```",
    ]
    return "\n".join(lines) + "\n"


def made_by_simulation(name: str) -> list[str]:
    """How problems of a scene are made."""
    return [
        "from fclib import scenes, simulate",
        "",
        f'scene = scenes.get("{name}")().scene(seed=0)',
        "problems = [step.problem for step in simulate.simulate(scene, steps=10)]",
    ]


def made_by_assembly(name: str) -> list[str]:
    """How a problem is assembled."""
    return [
        "from fclib import scenes",
        "",
        f'problem = scenes.assemblies()["{name}"]().problem(0, seed=0)',
    ]


def shown(value: object) -> str:
    """A default as a cell of a table."""
    return f"{value:g}" if isinstance(value, float) else f"{value}".replace("|", r"\|")


def draw(name: str) -> bytes | None:
    """A PNG of the default scene at its start; none of what has no scene."""
    if name not in scenes.families():
        return None
    model = simulate.model_of(scenes.get(name)().scene(0))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.png"
        try:
            simulate.render(model, path, size=SIZE)
        except simulate.NoRenderer:
            return None
        return path.read_bytes()
