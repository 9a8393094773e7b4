"""``fclib view``: one problem in the browser, its network of contacts in space."""

from __future__ import annotations

import tempfile
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

import fclib
from fclib.cli._files import contents_of
from fclib.cli._output import err, fail, out


def command(
    file: Annotated[Path, typer.Argument(help="An FCLIB file.", show_default=False)],
    kind: Annotated[
        str | None, typer.Option(help="Which of its problems: local, global, ...")
    ] = None,
    target: Annotated[
        Path | None, typer.Option("--out", help="Write the page here, and open nothing.")
    ] = None,
) -> None:
    """Show the network of contacts of a problem in the browser.

    Bodies, contact points, normals and reactions, to turn and to zoom.
    """
    from fclib.report import view

    try:
        contents = contents_of(file)
        kind = kind or contents.owner
        problem = fclib.read(file, kind)
        # a stored solution is of one of the file's problems
        own = contents.solution and kind == contents.owner
        record = view.view_of(problem, fclib.read_solution(file) if own else None)
        path = target
        if path is None:
            path = Path(tempfile.mkdtemp(prefix="fclib-view-")) / f"{file.stem}.html"
        view.write_view(record, path, title=file.name)
    except fclib.Error as error:
        fail(str(error))
    out.print(str(path), highlight=False)
    if target is None and not webbrowser.open(path.resolve().as_uri()):
        err.print("There is no browser here; open the page in one.", highlight=False)
