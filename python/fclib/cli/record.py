"""``fclib record``: steps of another simulator's script become problems."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fclib._words import counted
from fclib.cli._output import err, fail, out


def command(
    engine: Annotated[
        str,
        typer.Argument(
            help="drake, genesis, lmgc90, mujoco, mujoco_warp, newton, pybullet or siconos,"
            " installed.",
            show_default=False,
        ),
    ],
    script: Annotated[
        Path,
        typer.Argument(
            help="A Python script; of LMGC90 also the folder of a deck, DATBOX.", show_default=False
        ),
    ],
    arguments: Annotated[
        list[str] | None, typer.Argument(help="Arguments of the script.", show_default=False)
    ] = None,
    target: Annotated[
        Path,
        typer.Option(
            "--out", help="Folder of the problems; a name that ends in .h5 or .hdf5: one sequence."
        ),
    ] = Path("recorded"),
    every: Annotated[int, typer.Option(help="Keep one step in so many.", min=1)] = 1,
    steps: Annotated[
        int | None, typer.Option(help="Steps of a deck; 100 by default.", min=1)
    ] = None,
    time_step: Annotated[
        float | None, typer.Option(help="Step of a deck [s]; 1e-3 by default.", min=1e-12)
    ] = None,
    theta: Annotated[
        float | None, typer.Option(help="Theta of a deck; 0.5 by default.", min=0.5, max=1.0)
    ] = None,
) -> None:
    """Store the problems of the steps of another simulator.

    The script runs as it is. Each step that is kept and has contacts becomes an FCLIB file, with
    the engine's own reaction as a guess; or all go into one file, a sequence. If a step cannot be
    recorded, it is left out, and the command says why. A deck of LMGC90 does not say its steps:
    they are given here.
    """
    from fclib import recorders

    given = {"steps": steps, "time_step": time_step, "theta": theta}
    try:
        recording = recorders.record_script(
            engine,
            script,
            target,
            every=every,
            arguments=arguments or (),
            **{name: value for name, value in given.items() if value is not None},
        )
    except (ImportError, OSError, ValueError) as error:
        fail(str(error))
    out.print(
        f"{recording.written} of {counted(recording.seen, 'step')}, in {target}", highlight=False
    )
    if recording.without:
        err.print(f"{script}: {recording.without}", highlight=False)
    elif not recording.written:
        err.print(f"{script}: {recording.nothing(engine)}", highlight=False)
