"""``fclib simulate``: a MuJoCo scene, or a deck of LMGC90, becomes a set of problems."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from fclib import collections, scenes
from fclib._sequence import SUFFIXES
from fclib._words import counted
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
from fclib.cli._output import Json, Merit, MeritKind, err, fail, words_of
from fclib.collections.plan import ON_DEMAND
from fclib.scenes.shared import deck, deck_scene


class Unsolved(str, Enum):
    """The reaction to a step that is not solved."""

    BEST = "best"
    STOP = "stop"


def command(
    scene: Annotated[
        Path,
        typer.Argument(
            help="An MJCF or URDF file, an input.dat or a mechanics HDF5 file of Siconos, or an"
            " LMGC90 deck (DATBOX).",
            show_default=False,
        ),
    ],
    steps: Annotated[int, typer.Option(help="Steps of the simulation.", min=1)] = 500,
    target: Annotated[
        Path,
        typer.Option(
            "--out", help="Folder of the problems; a name that ends in .h5 or .hdf5: one sequence."
        ),
    ] = Path("problems"),
    time_step: Annotated[
        float | None,
        typer.Option(help="Step [s]; by default the file's own. A deck has none.", min=1e-12),
    ] = None,
    theta: Annotated[
        float | None,
        typer.Option(
            help="Of the theta scheme; by default 1, for a deck 0.5.",
            min=0.5,
            max=1.0,
            show_default=False,
        ),
    ] = None,
    period: Annotated[
        tuple[float, float] | None,
        typer.Option(help="Of a deck: periods along x and y [m].", show_default=False),
    ] = None,
    restitution: Annotated[
        float, typer.Option(help="Newton's coefficient of restitution.", min=0.0, max=1.0)
    ] = 0.0,
    law: Annotated[
        str, typer.Option(help='Unilateral law: "velocity" (impacts) or "gap" (no penetration).')
    ] = "velocity",
    activation: Annotated[
        float,
        typer.Option(
            help="Of two shapes that touch, points with a gap below this are contacts too [m].",
            min=0.0,
        ),
    ] = 0.0,
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
    states: Annotated[
        Path | None,
        typer.Option(
            help="Take the states of a log instead: an .npz file of qpos, qvel, ctrl, act, or a"
            " .csv file with columns qpos0, ..., qvel0, ... Nothing is simulated."
        ),
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
    floating: Annotated[
        bool, typer.Option("--floating", help="The root of a URDF file moves, it is not welded.")
    ] = False,
    ground: Annotated[
        float | None,
        typer.Option(
            help="Add a plane of this friction, below all at the start.",
            metavar="MU",
            min=0.0,
            show_default=False,
        ),
    ] = None,
    friction: Annotated[
        float | None,
        typer.Option(
            help="Of an input.dat, which does not have it.",
            metavar="MU",
            min=0.0,
            show_default=False,
        ),
    ] = None,
    merit: Merit = MeritKind.both,
    unsolved: Annotated[
        Unsolved,
        typer.Option(help="After a step that is not solved: go on with the best found, or stop."),
    ] = Unsolved.BEST,
    form: FormOption = Form.BOTH,
    count: Count = None,
    select: SelectOption = Select.EVERY,
    analyze: Analyze = False,
    pictures: Pictures = True,
    as_json: Json = False,
) -> None:
    """Simulate a model or a deck, and store its problems.

    What no problem can hold is left out. The command prints a
    line about each such thing; the catalogue and the description of each file have it too.

    The scheme is that of Moreau and Jean. The solutions are stored too. Steps without contact give
    no problem. What is stored is a collection, which fclib collection verify and publish take, or a
    sequence: of the global form, or with --form local of the local one.

    A gap counts as closed if rounding or a small share of the motion explains it. A step is solved
    if both errors of its solution are at most the tolerance. A simulation stops if a step makes no
    sense, and says so; the steps before are stored. The exit status is then 1, as it is if a step
    was not solved.
    """
    sequence = target if target.suffix in SUFFIXES else None
    one_form = Form.GLOBAL if form is Form.BOTH else form
    if sequence is not None and sequence.exists():
        fail(f"{sequence}: is there already; name another file")
    if law not in ("velocity", "gap"):
        raise typer.BadParameter(f'the law is "velocity" or "gap", not {law!r}')
    if ctrl is not None and policy is not None:
        raise typer.BadParameter("the controls are those of --ctrl or of --policy, not of both")
    if states is not None and (ctrl is not None or policy is not None):
        raise typer.BadParameter("with --states the controls are the log's own, ctrl")
    pairs = [entry.partition("=") for entry in package or []]
    for name, equals, place in pairs:
        if not (name and equals and place):
            raise typer.BadParameter("--package takes NAME=DIR")
    only_files = {
        "--restitution": restitution,
        "--law": law != "velocity",
        "--activation": activation,
        "--planar": planar,
        "--keyframe": keyframe,
        "--ctrl": ctrl,
        "--policy": policy,
        "--states": states,
        "--package": package,
        "--ignore": ignore,
        "--floating": floating,
        "--ground": ground is not None,
        "--friction": friction is not None,
    }
    lmgc90 = None
    if scene.is_dir():
        try:
            lmgc90 = deck.read(scene)
        except (OSError, ValueError) as error:
            fail(words_of(error))
    is_deck = lmgc90 is not None
    for name, given in only_files.items():
        if is_deck and given:
            raise typer.BadParameter(f"{name} is not for decks: a deck says all but step and theta")
    if is_deck and time_step is None:
        raise typer.BadParameter("a deck does not say its step: --time-step")
    if period is not None and not is_deck:
        raise typer.BadParameter("--period is for decks of LMGC90")
    try:
        from fclib.simulate import ALLOWANCE, MujocoModel, control_of, logged, model_of
    except ImportError as error:
        fail(str(error))
    options = {} if merit is MeritKind.both else {"merit": merit.value}
    try:
        if lmgc90 is not None:
            assert time_step is not None
            loaded = deck_scene.scene_of(
                lmgc90, time_step=time_step, theta=0.5 if theta is None else theta, period=period
            )
        else:
            loaded = scenes.Scene.from_file(
                scene,
                time_step=time_step,
                restitution=restitution,
                law=law,  # type: ignore[arg-type]
                planar=planar,
                keyframe=keyframe,
                packages={name: place for name, _, place in pairs},
                ignore=tuple(ignore or ()),
                activation=activation,
                floating=floating,
                ground=ground,
                friction=friction,
            )
            if theta is not None:
                loaded = replace(loaded, theta=theta)
        model = model_of(loaded, strict=strict)
        control = str(ctrl) if ctrl is not None else policy or ""
        if control:
            control_of(control)
        if states is not None:
            assert isinstance(model, MujocoModel)
            steps = len(logged(states, model)[0])
        plan = collections.Plan(
            scene=loaded,
            collection="scenes",
            problems=None,
            steps=steps,
            form=form.value if sequence is None else one_form.value,
            count=count,
            select=select.value,
            analyze=analyze,
            simulation=collections.Simulation(
                tol=ON_DEMAND,
                control=control,
                states=str(states) if states is not None else "",
                deepest=None,
                unsolved=unsolved.value,
                options=options,
            ),
            options=options,
        )
    except UnicodeDecodeError:
        fail(f"{scene}: is no text, hence no MJCF file")
    except (ImportError, OSError, ValueError) as error:
        fail(words_of(error))
    for line in model.left_out:
        err.print(f"Left out: {line}", highlight=False)
    rigid = model if isinstance(model, MujocoModel) else None
    if rigid and rigid.untouchable:
        remedy = (
            " (the root of a URDF file is welded to the world, and there is no ground: --floating,"
            " --ground)"
            if "<robot" in loaded.xml and not floating and ground is None
            else ""
        )
        err.print(f"Note: {rigid.untouchable}{remedy}", highlight=False)
    if loaded.law == "velocity":
        err.print(f"Closed gaps: within {ALLOWANCE}{further(activation)}", highlight=False)
    if merit is MeritKind.natural:
        err.print(
            "Solved: by the error of the natural map alone; the scaled one is not looked at",
            highlight=False,
        )
    if rigid and rigid.keyframe and not is_deck:
        err.print(f"From the keyframe {rigid.keyframe!r}", highlight=False)
    doing = f"Simulating {loaded.name}" if states is None else f"{states}: {loaded.name}"
    err.print(f"{doing}, {counted(steps, 'step')} ...", highlight=False)
    if sequence is None:
        build_plans([plan], target, 1, pictures, as_json)
    else:
        build_plans([plan], parts_of(sequence), 1, False, as_json, sequence)


def parts_of(sequence: Path) -> Path:
    """The folder in which the problems of a sequence are made, and an interrupted build goes on."""
    return sequence.with_name(f".{sequence.name}.parts")


def further(activation: float) -> str:
    """The effect of an activation, in words."""
    return f", and {activation:g} m of further points" if activation else ""
