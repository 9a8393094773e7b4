"""The command line: ``fclib COMMAND``, one module for each command; none imports another's.

All of them keep the same rules. Results go to the standard output, as a table or with ``--json`` as
one object a line; errors and progress go to the standard error. The exit status is 0 only if all
went well, 1 if not, 2 for a usage error.

What commands share:

_output.py     tables, JSON lines, errors, a bar, options that many have
_progress.py   bars for what takes long: a build, a campaign
_files.py      files that hold several things
_build.py      the build of `collection` and `simulate`
_profile.py    the profile of `profile` and `demo`

`choose.py` has the commands of ``fclib collection choose``, which `collection.py` takes in.
"""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperGroup

import fclib
from fclib.cli import (
    analyze,
    bench,
    check,
    collection,
    convert,
    demo,
    doctor,
    info,
    profile,
    record,
    report,
    simulate,
    solve,
    solvers,
    view,
)
from fclib.cli._output import fail, print_version


class Commands(TyperGroup):
    """The commands, with a help that fits a screen: what shells ask for is left out of it."""

    def get_params(self, ctx: Any) -> list[Any]:
        """The options, those of completion hidden."""
        params: list[Any] = super().get_params(ctx)
        for param in params:
            if param.name in ("install_completion", "show_completion"):
                param.hidden = True
        return params


app = typer.Typer(
    name="fclib",
    cls=Commands,
    help="Frictional contact problems, and a test bench for the solvers of them.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help, in which a command is a line, and all of them a screen
    context_settings={"help_option_names": ["-h", "--help"]},
)
for module in (
    info,
    check,
    solve,
    convert,
    analyze,
    solvers,
    simulate,
    record,
    demo,
    profile,
    report,
    view,
    doctor,
):
    app.command(module.__name__.rpartition(".")[2])(module.command)
app.add_typer(collection.app, name="collection")
app.add_typer(bench.app, name="bench")
app.callback(invoke_without_command=True)(print_version)


def main() -> None:
    """Entry point of the ``fclib`` script. What no command deals with is one line all the same."""
    try:
        app()
    except fclib.Error as error:
        fail(str(error))
    except OSError as error:
        fail(f"{error.filename}: {error.strerror}" if error.filename else str(error))
