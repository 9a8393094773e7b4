"""``fclib view``: one problem in the browser, its network of contacts in space."""

from __future__ import annotations

import tempfile
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

import fclib
from fclib import _sequence
from fclib._files import is_open_or_device
from fclib.cli._files import contents_of, keep_input
from fclib.cli._output import err, fail, out


def command(
    file: Annotated[
        Path, typer.Argument(help="An FCLIB file, or a step: run.h5#17.", show_default=False)
    ],
    kind: Annotated[
        str | None, typer.Option(help="Which of its problems: local, global, ...")
    ] = None,
    target: Annotated[
        Path | None, typer.Option("--out", help="Write the page here, and open nothing.")
    ] = None,
    serve: Annotated[
        bool, typer.Option("--serve", help="Serve the page to this machine alone, until Ctrl-C.")
    ] = False,
    module: Annotated[
        Path | None,
        typer.Option("--browser", help="Folder of `make wasm`, for a page that checks and solves."),
    ] = None,
) -> None:
    """Show the network of contacts of a problem in the browser.

    The page shows bodies, contact points, normals and reactions, to turn and to zoom. With --serve
    it also checks the stored solution, solves the problem and changes it.
    """
    if serve and target is not None:
        raise typer.BadParameter("--serve serves the page, and --out writes it")
    keep_input(target, file)
    from fclib.report import ReportError, browser, serving, view

    try:
        built = browser.find(module)
        if serve and built is None:
            raise ReportError("there is no module for browsers (make wasm, --browser DIR)")
        if _sequence.place_of(file)[1] is not None:
            # the page refers to a file of one problem
            step = Path(tempfile.mkdtemp(prefix="fclib-view-")) / f"{_sequence.name_of(file)}.hdf5"
            _sequence.copy(file, step)
            file = step
        contents = contents_of(file)
        kind = kind or contents.owner
        problem = fclib.read(file, kind)
        # a stored solution is of one of the file's problems
        own = contents.solution and kind == contents.owner
        record = view.view_of(problem, fclib.read_solution(file) if own else None)
        panel = serving.panel_of(file, problem.kind, own, built) if built else None
        if serve:
            assert panel is not None
            assert built is not None
            serving.serve_view(record, panel, file, built, _opened)
            return
        path = target
        if path is None:
            path = Path(tempfile.mkdtemp(prefix="fclib-view-")) / f"{file.stem}.html"
        view.write_view(record, path, file.name, panel)
    except fclib.Error as error:
        fail(str(error))
    if not is_open_or_device(path):
        out.print(str(path), highlight=False)
    if target is None and not webbrowser.open(path.resolve().as_uri()):
        err.print("There is no browser here; open the page in one.", highlight=False)


def _opened(address: str) -> None:
    out.print(f"{address} (Ctrl-C ends it)", highlight=False)
    webbrowser.open(address)
