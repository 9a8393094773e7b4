"""The page of the command line, from the commands."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

import typer

from fclib.cli import app


def pages() -> Iterator[tuple[str, str]]:
    """One page."""
    lines = [
        "# The command line",
        "",
        "Results go to the standard output: as a table, or with `--json` as one JSON object a "
        "line. Errors and progress go to the standard error. The exit status is 0 only if all went "
        "well. It is 1 if something failed, and 2 for a usage error. `fclib COMMAND --help` says "
        "the same as this page.",
        "",
    ]
    command: Any = typer.main.get_command(app)
    lines += described(command, "fclib")
    yield "command-line.md", "\n".join(lines) + "\n"


def described(command: Any, path: str) -> list[str]:
    """A command with its arguments and options, and those below it."""
    lines = []
    if path != "fclib":
        lines += [f"## {path}", "", inspect.cleandoc(command.help or ""), ""]
        shown = [item for item in command.params if not getattr(item, "hidden", False)]
        if shown:
            lines += ["| option | default | meaning |", "|---|---|---|"]
            lines += [row(item) for item in shown]
            lines.append("")
    for name, inner in getattr(command, "commands", {}).items():
        if not inner.hidden:
            lines += described(inner, f"{path} {name}")
    return lines


def row(item: Any) -> str:
    """An argument or an option."""
    option = item.param_type_name == "option"
    names = ", ".join(f"`{name}`" for name in (item.opts if option else [item.name.upper()]))
    names += "".join(f", `{name}`" for name in item.secondary_opts)
    default = item.default
    plain = isinstance(default, (str, int, float)) and not isinstance(default, bool)
    help_text = (getattr(item, "help", None) or "").replace("|", r"\|")
    return f"| {names} | {default if plain else ''} | {help_text} |"
