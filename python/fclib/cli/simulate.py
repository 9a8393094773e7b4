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
from fclib.cli._output import Json, err, fail, words_of
from fclib.collections.plan import ON_DEMAND


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
    keyframe: Annotated[
        str | None,
        typer.Option(help="Keyframe to start from; by default start, home or stand, if any."),
    ] = None,
    ctrl: Annotated[
        Path | None,
        typer.Option(help="Controls, one step a row: a .csv or .npy file. The last row goes on."),
    ] = None,
    policy: Annotated[
        str | None,
        typer.Option(
            help="MODULE:FUNCTION, called each step with the time [s] and the state"
            " (its position, velocity); returns the controls."
        ),
    ] = None,
    strict: Annotated[
        bool,
        typer.Option("--strict", help="Refuse a scene that asks for what no problem can hold."),
    ] = False,
    package: Annotated[
        list[str] | None,
        typer.Option(help="NAME=DIR of package://NAME/... in a URDF file; can be repeated."),
    ] = None,
    ignore: Annotated[
        list[str] | None,
        typer.Option(help="Leave out a feature knowingly: limits, frictionloss, ..."),
    ] = None,
    form: FormOption = Form.BOTH,
    count: Count = None,
    select: SelectOption = Select.EVERY,
    analyze: Analyze = False,
    pictures: Pictures = True,
    as_json: Json = False,
) -> None:
    """Simulate an MJCF file, and store the problem of each step.

    The scene may also be a URDF file. What no problem can hold is left out. The command prints a
    line about each such thing; the catalogue and the description of each file have it too.

    The scheme is that of Moreau and Jean. The solutions are stored too. Steps without contact give
    no problem. What is stored is a collection, which fclib collection verify and publish take.
    """
    if law not in ("velocity", "gap"):
        raise typer.BadParameter(f'the law is "velocity" or "gap", not {law!r}')
    if ctrl is not None and policy is not None:
        raise typer.BadParameter("the controls are those of --ctrl or of --policy, not of both")
    pairs = [entry.partition("=") for entry in package or []]
    for name, equals, place in pairs:
        if not (name and equals and place):
            raise typer.BadParameter("--package takes NAME=DIR")
    try:
        from fclib.simulate import MujocoModel, control_of
    except ImportError as error:
        fail(str(error))
    try:
        loaded = scenes.Scene.from_file(
            scene,
            time_step=time_step,
            restitution=restitution,
            law=law,  # type: ignore[arg-type]
            planar=planar,
            keyframe=keyframe,
            packages={name: place for name, _, place in pairs},
            ignore=tuple(ignore or ()),
        )
        model = MujocoModel(loaded, strict=strict)
        control = str(ctrl) if ctrl is not None else policy or ""
        if control:
            control_of(control)
        plan = collections.Plan(
            scene=loaded,
            collection="scenes",
            problems=None,
            steps=steps,
            form=form.value,
            count=count,
            select=select.value,
            analyze=analyze,
            simulation=collections.Simulation(tol=ON_DEMAND, control=control, deepest=None),
        )
    except UnicodeDecodeError:
        fail(f"{scene}: is no text, hence no MJCF file")
    except (OSError, ValueError) as error:
        fail(words_of(error))
    for line in model.left_out:
        err.print(f"Left out: {line}", highlight=False)
    if model.keyframe:
        err.print(f"From the keyframe {model.keyframe!r}", highlight=False)
    err.print(f"Simulating {loaded.name}, {steps} steps ...", highlight=False)
    build_plans([plan], folder, 1, pictures, as_json)
