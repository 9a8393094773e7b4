"""The command line: ``fclib COMMAND``, one module for each command; none imports another's.

All of them keep the same rules. Results go to the standard output, as a table or with ``--json`` as
one object for each line; errors and progress go to the standard error. The exit status is 0 only if
all went well, 1 if not, 2 for a usage error.

What commands share:

_output.py     tables, JSON lines, errors, a bar, common options
_progress.py   bars for long work: a build, a campaign
_files.py      files that hold several things
_build.py      the build of `collection` and `simulate`
_profile.py    the profile of `profile` and `demo`
"""

from __future__ import annotations

import importlib
import io
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import typer
from typer.core import TyperGroup

import fclib
from fclib.cli._output import fail, interrupted, print_version, warn, words_of

COMMANDS = (
    "info",
    "check",
    "solve",
    "convert",
    "analyze",
    "solvers",
    "simulate",
    "record",
    "judge",
    "demo",
    "profile",
    "results",
    "report",
    "view",
    "doctor",
    "collection",
    "bench",
)


class Imported(Mapping[str, Any]):
    """The commands by name, each imported on demand: most need little of fclib."""

    def __init__(self) -> None:
        self.known: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in COMMANDS:
            raise KeyError(name)
        if name not in self.known:
            module = importlib.import_module(f"fclib.cli.{name}")
            one = typer.Typer(rich_markup_mode=None)
            if hasattr(module, "app"):
                one.add_typer(module.app, name=name)
            else:
                one.command(name)(module.command)
            self.known[name] = typer.main.get_group(one).commands[name]
        return self.known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


class Commands(TyperGroup):
    """The commands, with a help that fits a screen."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands: Any = Imported()

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Import the command; from then on Ctrl-C unwinds it."""
        found = super().resolve_command(ctx, args)
        if ctx.obj is not None:
            ctx.obj()
        return found

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        with warnings.catch_warnings():
            warnings.showwarning = warn
            try:
                return super().invoke(ctx)
            except KeyboardInterrupt:
                interrupted()

    def get_params(self, ctx: Any) -> list[Any]:
        """The options, all hidden: the text of the help names those that matter."""
        params: list[Any] = super().get_params(ctx)
        for param in params:
            param.hidden = True
        return params


app = typer.Typer(
    name="fclib",
    cls=Commands,
    help="Frictional contact problems, and a test bench for their solvers. COMMAND --help"
    " shows the options of a command, --version the version.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help, in which a command is a line, and all of them a screen
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.callback(invoke_without_command=True)(print_version)


def main(imported: Callable[[], Any] | None = None) -> None:
    """Run a command. Any other error also becomes one line.

    Args:
        imported: called once all is imported, before the command begins.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            # what the terminal cannot show, as names of files, is no error
            stream.reconfigure(errors="backslashreplace")
    try:
        app(obj=imported)
    except fclib.Error as error:
        fail(str(error))
    except OSError as error:
        fail(words_of(error))
