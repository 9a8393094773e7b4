"""What the commands share: tables and JSON lines, errors, progress, options."""

from __future__ import annotations

import json
import math
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

import fclib
from fclib import _registry, _sequence
from fclib._regular import regular


def plain(text: str) -> str:
    """A text without control characters: texts of files, stores and solvers are not trusted."""
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() or one in "\n\t" else " " for one in text)


class _Plain(Console):
    """A console on which no text controls the terminal. Only the console makes colours."""

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """The parts of what is printed."""
        for part in super().render(renderable, options):
            yield part if part.control else part._replace(text=plain(part.text))


# text is printed as it is: the brackets of a unit or a path are not markup
out = _Plain(markup=False, emoji=False)
if not out.is_terminal:
    # nothing is folded in a file or a pipe
    out = _Plain(width=240, markup=False, emoji=False)
err = _Plain(stderr=True, soft_wrap=True, markup=False, emoji=False)


class MeritKind(str, Enum):
    """What a tolerance bounds; StrEnum would need Python 3.11."""

    both = "both"
    natural = "natural"

    __str__ = str.__str__


WRAPPED = (
    "problem",
    "title",
    "meaning",
    "what",
    "matrix_info",
)  # columns that may be folded to fit the terminal
FOLDED = 24  # least width in characters of such a column, if its entries are as long
GAP = 2  # between columns

Files = Annotated[list[Path], typer.Argument(help="FCLIB files.", show_default=False)]
Json = Annotated[bool, typer.Option("--json", help="One JSON object a line.")]


def finite_tolerance(value: float) -> float:
    """A tolerance as it is given; a usage error if it is infinite."""
    if not math.isfinite(value):
        raise typer.BadParameter("with an infinite bound, anything would be a solution")
    return value


Tolerance = Annotated[
    float, typer.Option("--tol", help="Bound on the error.", min=0.0, callback=finite_tolerance)
]
Modules = Annotated[
    list[Path] | None, typer.Option("--module", help="A file of Python with solvers of your own.")
]
Merit = Annotated[
    MeritKind,
    typer.Option(
        "--merit",
        help="What the tolerance bounds: both the natural map and the scaled one, which is the same"
        " in any units, or the natural one alone, as in the literature.",
    ),
]


def print_version(
    ctx: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Print the version if it is asked for."""
    if version:
        out.print(f"fclib {fclib.__version__}", highlight=False)
        raise typer.Exit
    if ctx.invoked_subcommand is None:
        raise typer.BadParameter("a command is missing, see fclib --help")


def fail(message: str) -> NoReturn:
    """End the process with one line on the standard error and exit status 1."""
    err.print(f"fclib: {message}", style="red", highlight=False)
    raise SystemExit(1)


def warn_of(path: Path, message: str) -> None:
    """One line on the standard error about a file; the command goes on."""
    err.print(f"fclib: {path}: {message}", style="yellow", highlight=False)


def interrupted(message: str = "interrupted") -> NoReturn:
    """End the process as Ctrl-C does: one line on the standard error and exit status 130."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second Ctrl-C has nothing left to end
    err.print(f"fclib: {message}", style="red", highlight=False)
    signal.signal(signal.SIGINT, before)  # a program may have called this, and goes on
    raise SystemExit(130)


def warn(message: Warning | str, *_: Any, **__: Any) -> None:
    """Say a warning in one line on the standard error, without its place in the code."""
    err.print(f"fclib: {message}", style="yellow", highlight=False)


def words_of(error: Exception) -> str:
    """The file and the reason of a system error, without its number."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error)


def usage_error(error: Exception) -> NoReturn:
    """End the command with the message and exit status 2."""
    raise typer.BadParameter(plain(str(error))) from None


def load_modules(paths: Sequence[Path] | None) -> None:
    """Import files with solvers of the user's own; a usage error if that fails."""
    for path in paths or ():
        if not path.is_file():
            raise typer.BadParameter(f"{path}: there is no such file")
    try:
        from fclib.bench import modules  # takes a while

        modules.load_modules([str(path.resolve()) for path in paths or ()])
    except fclib.SolverError as error:
        usage_error(error)


def parse_solver(text: str, pairs: Sequence[str] = ()) -> tuple[str, dict[str, str]]:
    """A solver, checked, and its options: those of its text, as "nsgs relaxation=1.2", and others.

    A solver or an option that is unknown is a usage error.
    """
    try:
        name, own = _registry.parse_solver(text)
        options = own | parse_options(pairs)
        fclib.find_solver(name).check_options(options)
    except fclib.OptionError as error:
        usage_error(error)
    return name, options


def parse_options(pairs: Sequence[str]) -> dict[str, str]:
    """``["relaxation=1.2"]`` as a dictionary; anything else is a usage error.

    ``name=@FILE`` is the text of a file.
    """
    options: dict[str, str] = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not (name and equals and value):
            raise typer.BadParameter(f"'{pair}' is not of the form name=value")
        options[name] = value
        if value.startswith("@"):
            try:
                options[name] = regular(value[1:]).read_text(encoding="utf-8")
            except (OSError, UnicodeDecodeError) as error:
                raise typer.BadParameter(f"'{pair}': {words_of(error)}") from error
    return options


@contextmanager
def progress_bar(total: int) -> Iterator[Callable[[str], None]]:
    """A bar on the standard error, if that is a terminal.

    It yields a function that names the next item, and counts the former as done.
    """
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as progress:
        task = progress.add_task("", total=total)
        done = -1

        def show(what: str) -> None:
            nonlocal done
            done += 1
            progress.update(task, description=what, completed=done)

        yield show


def format_value(value: object) -> str:
    """A cell of a table."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, dict):
        parts = (f"{key}: {format_known(known)}" for key, known in value.items())
        return "; ".join(parts) or "-"
    if isinstance(value, float):
        return f"{value:.1e}" if value and not 1e-2 <= abs(value) < 1e4 else f"{value:.4g}"
    return plain(str(value))


def format_known(values: dict[str, object]) -> str:
    """The known facts on one thing in a cell; missing ones are left out."""
    return ", ".join(f"{key} {format_value(value)}" for key, value in values.items() if value)


@dataclass(frozen=True)
class Rows:
    """A table with a column for each key; statuses and verdicts in colour.

    If the terminal is too narrow for all columns, they are printed in several parts, each with
    the first column: no number is cut.
    """

    records: Sequence[dict[str, Any]]
    title: str | None = None

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Any]:
        for k, keys in enumerate(self.parts(options.max_width)):
            if k:
                yield ""
            yield self.table(keys, None if k else self.title)

    def parts(self, width: int) -> Iterator[list[str]]:
        """The columns of each part."""
        first, *others = self.records[0]
        part, used = [first], self.least(first)
        for key in others:
            if len(part) > 1 and used + GAP + self.least(key) > width:
                yield part
                part, used = [first], self.least(first)
            part.append(key)
            used += GAP + self.least(key)
        yield part

    def least(self, key: str) -> int:
        """The width that a column needs."""
        texts = [key, *(format_value(record[key]) for record in self.records)]
        width = max(cell_len(line) for text in texts for line in text.splitlines() or [""])
        return min(width, FOLDED) if key in WRAPPED else width

    def table(self, keys: list[str], title: str | None) -> Table:
        """One part."""
        table = Table(
            title=title, title_justify="left", box=None, header_style="bold", pad_edge=False
        )
        for key in keys:
            first = self.records[0][key]
            numeric = isinstance(first, (int, float)) and not isinstance(first, bool)
            table.add_column(
                key,
                justify="right" if numeric else "left",
                no_wrap=key not in WRAPPED,
                overflow="fold",
                min_width=self.least(key),
            )
        for record in self.records:
            cells = [Text(format_value(record[key])) for key in keys]
            for key, cell in zip(keys, cells, strict=True):
                if key == "status":
                    cell.stylize("green" if cell.plain in ("converged", "ok") else "red")
            table.add_row(*cells)
        return table


def finite(value: Any) -> Any:
    """The value with None for each number that is not finite, because JSON has none."""
    if isinstance(value, dict):
        return {key: finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@dataclass
class Report:
    """Gathers the records of a command, prints them, and knows the exit status."""

    as_json: bool
    hidden: tuple[str, ...] = ()  # columns of the JSON that the table leaves out
    records: list[dict[str, Any]] = field(default_factory=list)
    failed: bool = False

    def add(self, record: dict[str, Any], good: bool = True) -> None:
        """Take a record; with --json print it at once."""
        self.failed = self.failed or not good
        self.records.append(record)
        if self.as_json:
            typer.echo(json.dumps(finite(record)))

    def error(self, path: Path, error: Exception) -> None:
        """Report a file that failed; the others go on."""
        self.failed = True
        if self.as_json:
            typer.echo(json.dumps({"problem": str(path), "message": str(error)}))
        err.print(f"fclib: {error}", style="red", highlight=False)

    def finish(self, words: str = "") -> NoReturn:
        """Print the table and a line below it, and exit with the status."""
        if self.records and not self.as_json:
            paths = [record["problem"] for record in self.records]
            names = [Path(path).name for path in paths]
            # the folder is left out if the name is enough
            shortest = names if len(set(names)) == len(set(paths)) else paths
            out.print(
                Rows(
                    [
                        {key: value for key, value in record.items() if key not in self.hidden}
                        | {"problem": name}
                        for record, name in zip(self.records, shortest, strict=True)
                    ]
                )
            )
            if words:
                out.print(words, highlight=False)
        raise typer.Exit(int(self.failed))


def each_file(files: Iterable[Path], what: str) -> Iterator[Path]:
    """Go through the files, and the steps of sequences, with progress."""
    paths = [path for file in files for path in _sequence.steps_or_file(file)]
    with progress_bar(len(paths)) as show:
        for path in paths:
            show(f"{what} {path.name}")
            yield path
