"""``fclib record``: steps of another simulator's script become problems."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fclib.cli._output import err, fail, out


def command(
    engine: Annotated[
        str,
        typer.Argument(
            help="drake, mujoco, newton, pybullet or siconos, which must be installed.",
            show_default=False,
        ),
    ],
    script: Annotated[Path, typer.Argument(help="A Python script.", show_default=False)],
    arguments: Annotated[
        list[str] | None, typer.Argument(help="Arguments of the script.", show_default=False)
    ] = None,
    folder: Annotated[Path, typer.Option("--out", help="Folder of the problems.")] = Path(
        "recorded"
    ),
    every: Annotated[int, typer.Option(help="Keep one step in so many.", min=1)] = 1,
) -> None:
    """Store the problems of the steps of another simulator.

    The script runs as it is. Each step that is kept and has contacts becomes an FCLIB file, with
    the engine's own reaction as a guess.
    """
    from fclib import recorders

    try:
        recording = recorders.record_script(
            engine, script, folder, every=every, arguments=arguments or ()
        )
    except (ImportError, OSError, ValueError) as error:
        fail(str(error))
    out.print(f"{recording.written} of {recording.seen} steps, in {folder}", highlight=False)
    if not recording.written:
        err.print(
            f"No step of {engine} that was kept has a contact between points", highlight=False
        )
