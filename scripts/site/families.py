"""A page for each family of the collection, from its class."""

from __future__ import annotations

import dataclasses
import inspect
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fclib import scenes, simulate
from fclib.collections.plan import Plan, sets

SIZE = (720, 540)  # of a picture [pixels]


def pages(draws: bool) -> Iterator[tuple[str, str | bytes]]:
    """The pages, their index, and pictures where they are asked for and something can draw here."""
    known = scenes.families()
    rows = []
    for name, families in sets().items():
        rows += [(name, family, known[family]) for family in families]
    yield "families/index.md", index(rows)
    for name, family, kind in rows:
        picture = draw(kind) if draws else None
        if picture is not None:
            yield f"families/{family}.png", picture
        yield f"families/{family}.md", page(name, family, kind, picture is not None)


def index(rows: list[tuple[str, str, type[scenes.Family]]]) -> str:
    """The families in a table."""
    lines = [
        "# Families",
        "",
        "All families of scenes, from their classes in `python/fclib/scenes/`; "
        "[the collection](../collection.md) says how they are built, and "
        "[a family of your own](../families-of-your-own.md) how one is added.",
        "",
        "| set | family | problems | what |",
        "|---|---|---:|---|",
    ]
    lines += [
        f"| {name} | [{family}]({family}.md) | {kind.problems} | {kind.description} |"
        for name, family, kind in rows
    ]
    return "\n".join(lines) + "\n"


def page(name: str, family: str, kind: type[scenes.Family], drawn: bool) -> str:
    """One family: what it is, its parameters, what is built of it."""
    plan = Plan.of_family(family)
    lines = [f"# {family}", "", f"**{kind.title}.** {kind.description}", ""]
    if drawn:
        lines += [f"![The scene of {family} at its start]({family}.png){{width=480px}}", ""]
    lines += [inspect.getdoc(kind) or "", "", "| | |", "|---|---|"]
    lines += [
        f"| set | {name} |",
        f"| field of application | {kind.application} |",
        f"| friction | {kind.friction} |",
        f"| authors of the original | {kind.authors} |",
        f"| problems | the first {kind.problems} steps with contact, seed {plan.scene.seed} |",
        f"| forms | {', '.join(plan.forms)}; solved by `{plan.solver}` to {plan.tol:g} |",
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
        f"fclib collection build {family} --out collection",
        "```",
        "",
        "Other parameters, from Python:",
        "",
        "```python",
        "from fclib import scenes, simulate",
        "",
        f'scene = scenes.get("{family}")().scene(seed=0)  # parameters go into the first brackets',
        "problems = [step.problem for step in simulate.simulate(scene, steps=10)]",
        "```",
    ]
    return "\n".join(lines) + "\n"


def shown(value: object) -> str:
    """A default as a cell of a table."""
    return f"{value:g}" if isinstance(value, float) else f"{value}".replace("|", r"\|")


def draw(kind: type[scenes.Family]) -> bytes | None:
    """A PNG of the default scene at its start."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.png"
        try:
            simulate.render(simulate.MujocoModel(kind().scene(0)), path, size=SIZE)
        except simulate.NoRenderer:
            return None
        return path.read_bytes()
