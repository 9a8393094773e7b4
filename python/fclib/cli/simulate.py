"""``fclib simulate``: a MuJoCo scene becomes a set of problems."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fclib import collections, scenes
from fclib.cli._build import (
    Analyze,
    Count,
    Form,
    FormOption,
    Pictures,
    Select,
    SelectOption,
    build_plans,
)
from fclib.cli._output import Json, err, fail


def command(
    scene: Annotated[Path, typer.Argument(help="An MJCF file.", show_default=False)],
    steps: Annotated[int, typer.Option(help="Steps of the simulation.", min=1)] = 500,
    folder: Annotated[Path, typer.Option("--out", help="Folder of the problems.")] = Path(
        "problems"
    ),
    time_step: Annotated[
        float | None, typer.Option(help="Step [s]; by default the file's own.", min=1e-12)
    ] = None,
    restitution: Annotated[
        float, typer.Option(help="Newton's coefficient of restitution.", min=0.0, max=1.0)
    ] = 0.0,
    law: Annotated[
        str, typer.Option(help='Unilateral law: "velocity" (impacts) or "gap" (no penetration).')
    ] = "velocity",
    planar: Annotated[
        bool,
        typer.Option("--planar", help="The scene moves in the plane x, z: contacts of N and T."),
    ] = False,
    ignore: Annotated[
        list[str] | None,
        typer.Option(help="Leave out a feature that no problem can hold; can be repeated."),
    ] = None,
    form: FormOption = Form.BOTH,
    count: Count = None,
    select: SelectOption = Select.EVERY,
    analyze: Analyze = False,
    pictures: Pictures = True,
    as_json: Json = False,
) -> None:
    """Simulate an MJCF file, and store the problem of each step.

    The scheme is that of Moreau and Jean; the solutions are stored too. Steps without contact give
    no problem. What is stored is a collection: fclib collection verify and publish take it.
    """
    if law not in ("velocity", "gap"):
        raise typer.BadParameter(f'the law is "velocity" or "gap", not {law!r}')
    try:
        from fclib.simulate import MujocoModel
    except ImportError as error:
        fail(str(error))
    try:
        loaded = scenes.Scene.from_file(
            scene,
            time_step=time_step,
            restitution=restitution,
            law=law,  # type: ignore[arg-type]
            planar=planar,
            ignore=tuple(ignore or ()),
        )
        MujocoModel(loaded)
        plan = collections.Plan(
            scene=loaded,
            collection="scenes",
            problems=None,
            steps=steps,
            form=form.value,
            count=count,
            select=select.value,
            analyze=analyze,
        )
    except UnicodeDecodeError:
        fail(f"{scene}: is no text, hence no MJCF file")
    except ValueError as error:
        fail(str(error))
    err.print(f"Simulating {loaded.name}, {steps} steps ...", highlight=False)
    build_plans([plan], folder, 1, pictures, as_json)
