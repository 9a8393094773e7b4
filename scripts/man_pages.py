"""Write the man pages of the command line into a folder, one a command, from its own help.

.venv/bin/python scripts/man_pages.py man    then: man man/fclib.1
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any

import typer

import fclib
from fclib.cli import app

ROOT = "fclib"
STATUS = "0 if all went well, 1 if not, 2 for a wrong usage."
COMPLETION = (
    "fclib --install-completion sets up the completion of commands and options for the shell that "
    "it is run in: bash, zsh, fish or PowerShell."
)


def escape(text: str) -> str:
    """Text as troff takes it."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    # a line must not begin with a request
    return re.sub(r"^([.'])", r"\\&\1", text, flags=re.MULTILINE)


def paragraphs(text: str) -> Iterator[str]:
    """The paragraphs of a docstring, each as lines of troff."""
    for number, paragraph in enumerate(re.split(r"\n\s*\n", text.strip())):
        if number:
            yield ".PP"
        yield escape(re.sub(r"\s+", " ", paragraph))


def names_of(param: Any) -> str:
    """An option or an argument as it is typed."""
    if param.param_type_name == "argument":
        name = str(param.name).upper()
        name += "..." if param.nargs == -1 or param.multiple else ""
        return name if param.required else f"[{name}]"
    flags = ", ".join([*param.opts, *param.secondary_opts])
    if param.is_flag:
        return flags
    if isinstance(param.default, Enum):
        return f"{flags} {'|'.join(str(one.value) for one in type(param.default))}"
    return f"{flags} {param.name.upper().replace('_', '-')}"


def help_of(param: Any) -> str:
    """What is said of an option, with its default."""
    text = getattr(param, "help", None) or ""
    default = param.default
    if getattr(param, "show_default", True) and not getattr(param, "is_flag", False):
        default = getattr(default, "value", default)
        if isinstance(default, (str, int, float, Path)) and not isinstance(default, bool):
            text = f"{text.rstrip('.')}; by default {default}."
    return text.strip()


def described(params: list[Any]) -> Iterator[str]:
    """A list of options or arguments."""
    for param in params:
        yield ".TP"
        yield f"\\fB{escape(names_of(param))}\\fR"
        yield escape(help_of(param)) or "."


def page(path: tuple[str, ...], command: Any) -> str:
    """One page, of a command or of a group of commands."""
    name = "-".join(path)
    text = command.help or ""
    brief = re.sub(r"\s+", " ", text.strip().split("\n\n")[0]).rstrip(".")
    shown = [param for param in command.params if not getattr(param, "hidden", False)]
    arguments = [param for param in shown if param.param_type_name == "argument"]
    options = [param for param in shown if param.param_type_name == "option"]
    children = getattr(command, "commands", {})

    usage = [*path, "[OPTIONS]", *(["COMMAND", "..."] if children else map(names_of, arguments))]
    lines = [
        f'.TH "{name.upper()}" 1 "" "fclib {fclib.__version__}" "FCLIB"',
        ".SH NAME",
        f"{escape(name)} \\- {escape(brief)}",
        ".SH SYNOPSIS",
        f"\\fB{escape(' '.join(path))}\\fR {escape(' '.join(usage[len(path) :]))}",
        ".SH DESCRIPTION",
        *paragraphs(text),
    ]
    if arguments:
        lines += [".SH ARGUMENTS", *described(arguments)]
    if children:
        lines.append(".SH COMMANDS")
        for child, inner in children.items():
            first = re.sub(r"\s+", " ", (inner.help or "").strip().split("\n\n")[0])
            lines += [".TP", f"\\fB{escape('-'.join((*path, child)))}\\fR(1)", escape(first)]
    lines += [".SH OPTIONS", *described(options)]
    lines += [".TP", "\\fB\\-h, \\-\\-help\\fR", "Print the help."]
    if path == (ROOT,):
        lines += [".SH COMPLETION", escape(COMPLETION)]
    lines += [".SH EXIT STATUS", STATUS]
    above = "-".join(path[:-1])
    if above:
        lines += [".SH SEE ALSO", f"\\fB{escape(above)}\\fR(1)"]
    return "\n".join(lines) + "\n"


def pages(path: tuple[str, ...], command: Any) -> Iterator[tuple[str, str]]:
    """The names of the files and the pages, of a command and of all below it."""
    yield "-".join(path) + ".1", page(path, command)
    for name, child in getattr(command, "commands", {}).items():
        yield from pages((*path, name), child)


def main() -> None:
    """Write them all."""
    if len(sys.argv) != 2:
        sys.exit(f"usage: {sys.argv[0]} FOLDER")
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    written = dict(pages((ROOT,), typer.main.get_command(app)))
    for name, text in written.items():
        (folder / name).write_text(text)
    for old in {path.name for path in folder.glob("*.1")} - set(written):
        (folder / old).unlink()
    print(f"{folder}: {len(written)} man pages")


if __name__ == "__main__":
    main()
