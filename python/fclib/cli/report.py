"""``fclib report``: a site to browse from stores and a catalogue, or the figures of a paper."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

import fclib
from fclib._words import counted
from fclib.cli._output import MeritKind, err, fail, out
from fclib.cli._profile import With, joined, merit_of


@contextmanager
def bars() -> Iterator[Callable[[str, int, int], None]]:
    """A bar for each part of the work on the standard error, if that is a terminal."""
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as shown:
        tasks = {}

        def show(what: str, done: int, total: int) -> None:
            if what not in tasks:
                tasks[what] = shown.add_task(what, total=total)
            shown.update(tasks[what], completed=done)

        yield show


def command(
    stores: Annotated[
        list[Path] | None, typer.Argument(help="Stores of `fclib bench`.", show_default=False)
    ] = None,
    catalogue: Annotated[
        Path | None,
        typer.Option("--catalog", help="Folder of a collection; tiny: the set in the package."),
    ] = None,
    beside: With = None,
    folder: Annotated[
        Path, typer.Option("--out", help="Folder of the site, or of the figures.")
    ] = (Path("site")),
    pdf: Annotated[
        bool, typer.Option("--pdf", help="Figures (PDF) and tables (LaTeX) for a paper instead.")
    ] = False,
    machine: Annotated[str | None, typer.Option(help="Only the runs of this node.")] = None,
    campaign: Annotated[str | None, typer.Option(help="Only the runs of this campaign.")] = None,
    merit: Annotated[
        MeritKind | None, typer.Option(help="Only the runs whose tolerance bounds this.")
    ] = None,
    views: Annotated[
        int | None,
        typer.Option(
            help="How many problems have a picture to turn, those with runs first; by default all.",
            min=0,
        ),
    ] = None,
    with_files: Annotated[
        bool,
        typer.Option(
            "--with-files", help="Put the problems into the site too, with solutions and pictures."
        ),
    ] = False,
    files_at: Annotated[
        str, typer.Option(help="Address where the collection's folder is served, for links to it.")
    ] = "",
    docs: Annotated[
        str, typer.Option(help="Address where the documentation is served, for links to it.")
    ] = "",
    module: Annotated[
        Path | None,
        typer.Option("--browser", help="Folder of `make wasm`, for pages that check and solve."),
    ] = None,
    serve: Annotated[
        bool,
        typer.Option("--serve", help="Then serve the site to this machine alone, until Ctrl-C."),
    ] = False,
    jobs: Annotated[
        int | None, typer.Option(help="Processes that draw; by default one a core.", min=1)
    ] = None,
    title: Annotated[str, typer.Option(help="Title of the site.")] = "",
) -> None:
    """Make a site to browse from stores and a catalogue.

    Open its index.html. Only pages that check and solve problems (--with-files) need a server:
    --serve. Without stores and catalogue, --serve serves a site that is there already.
    """
    if serve and pdf:
        raise typer.BadParameter("--serve serves a site, and --pdf makes none")
    alone = serve and not (stores or beside or catalogue)
    if not (stores or beside or alone) and (pdf or catalogue is None):
        raise typer.BadParameter("name stores, a catalogue by --catalog, or both")
    if beside and len(stores or ()) > 1:
        raise typer.BadParameter(
            "--with goes with one store: fclib bench merge makes one of several"
        )
    try:
        from fclib import report
        from fclib.collections import CatalogError, set_index
    except ImportError as error:
        fail(f'{error}; pip install "fclib[report]"')
    try:
        if alone:
            _serve(folder)
            return
        with ExitStack() as stack:
            campaigns = None
            note = ""
            if beside:
                own = stores[0] if stores else None
                whole, note = stack.enter_context(joined(own, beside, machine, as_measured=False))
                if own is None and (judged := merit_of(whole, merit.value if merit else None)):
                    merit = MeritKind(judged)
                stores = [whole]
            if stores:
                campaigns = stack.enter_context(
                    report.Campaigns(
                        stores, machine, campaign, merit.value if merit else None, note
                    )
                )
            if str(catalogue) in set_index.SHIPPED:
                catalogue = set_index.DATA
            if pdf:
                assert campaigns is not None
                for path in report.write_paper(campaigns, folder):
                    out.print(str(path), highlight=False)
                return
            show = stack.enter_context(bars())
            counts = report.build_site(
                campaigns,
                folder,
                catalogue,
                views=views,
                title=title,
                with_files=with_files,
                files_at=files_at,
                docs=docs,
                module=module,
                jobs=jobs,
                progress=show,
            )
        told = counted(counts["problems"], "problem")
        if counts["copies"]:
            told += f" and {counted(counts['copies'], 'copy', 'copies')}"
        out.print(
            f"{told}, {counted(counts['runs'], 'run')}, {counted(counts['views'], 'view')},"
            f" {counts['bytes'] / 1e6:.1f} MB of data: {folder / 'index.html'}",
            highlight=False,
        )
        if with_files and not counts["module"]:
            out.print(
                "The pages do not check and solve problems: there is no module for browsers"
                " (make wasm, --browser DIR).",
                highlight=False,
            )
        if serve:
            _serve(folder)
    except ImportError as error:
        fail(f'{error}; pip install "fclib[report]"')
    except (fclib.Error, CatalogError) as error:
        fail(str(error))


def _serve(folder: Path) -> None:
    from fclib import report

    report.serve(folder, lambda address: out.print(f"{address} (Ctrl-C ends it)", highlight=False))
