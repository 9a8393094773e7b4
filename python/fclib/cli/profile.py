"""``fclib profile``: profiles of the runs of a store."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer

from fclib.bench import profiles
from fclib.cli._output import Json, MeritKind, fail, out
from fclib.cli._profile import AsMeasured, With, joined, merit_of, print_profile

Metric = Enum("Metric", {name: name for name in profiles.METRICS}, type=str)  # type: ignore[misc]
CPU_TIME = Metric("cpu_s")


class Start(str, Enum):
    """The start of runs: from nothing, or from the solution of a step before."""

    cold = "cold"
    warm = "warm"


class Weigh(str, Enum):
    """The unit of equal weight in shares and means: each family, or each instance."""

    families = "families"
    instances = "instances"


class Curve(str, Enum):
    """What a figure for a paper shows."""

    performance = "performance"
    data = "data"
    contact = "contact"
    accuracy = "accuracy"


class Forms(str, Enum):
    """For a problem with a global and a local form: the form that a solver takes, or both."""

    one = "one"
    both = "both"


def command(
    store: Annotated[
        Path | None,
        typer.Argument(help="A store of `fclib bench`; it may be left out if --with is given."),
    ] = None,
    metric: Annotated[Metric, typer.Option(help="What is compared.")] = CPU_TIME,
    solver: Annotated[list[str] | None, typer.Option(help="Only these, by their labels.")] = None,
    of_set: Annotated[
        list[str] | None, typer.Option("--set", help="Only the problems of these sets.")
    ] = None,
    family: Annotated[list[str] | None, typer.Option(help="Only these families.")] = None,
    tol: Annotated[list[float] | None, typer.Option(help="Only these tolerances.")] = None,
    campaign: Annotated[str | None, typer.Option(help="Only the runs of this campaign.")] = None,
    machine: Annotated[str | None, typer.Option(help="Only the runs of this node.")] = None,
    merit: Annotated[
        MeritKind | None, typer.Option(help="Only the runs whose tolerance bounds this.")
    ] = None,
    start: Annotated[
        Start, typer.Option(help="Runs from nothing, or those along sequences.")
    ] = Start.cold,
    penalty: Annotated[
        float, typer.Option(help="A failure counts as so many times the limit.", min=1.0)
    ] = profiles.PENALTY,
    shift: Annotated[
        float,
        typer.Option(help="Shift of the geometric means, in the unit of the metric.", min=1e-12),
    ] = profiles.SHIFT,
    count_unsuitable: Annotated[
        bool,
        typer.Option(
            "--count-unsuitable", help="Count a problem that a solver does not take as a failure."
        ),
    ] = False,
    own_set: Annotated[
        bool,
        typer.Option(
            "--own-set",
            help="Count each solver on the instances that it has run and takes, instead of on those"
            " that all have.",
        ),
    ] = False,
    weigh: Annotated[
        Weigh, typer.Option(help="What weighs the same in shares and means.")
    ] = Weigh.families,
    forms: Annotated[
        Forms, typer.Option(help="Of a problem in two forms: one counts, or both.")
    ] = Forms.one,
    out_dir: Annotated[
        Path | None, typer.Option("--out", help="Folder for pictures and CSV.")
    ] = None,
    formats: Annotated[
        str, typer.Option("--format", help="Formats of the pictures.")
    ] = "pdf,svg,png",
    figure: Annotated[
        Path | None,
        typer.Option(
            help="One figure for a paper instead (.pdf, .svg, .pgf), with caption and citations."
        ),
    ] = None,
    curve: Annotated[
        Curve,
        typer.Option(
            help="What the figure shows: performance profiles, data profiles, these per contact, or"
            " the cost of an accuracy."
        ),
    ] = Curve.performance,
    columns: Annotated[
        int, typer.Option(help="The figure is as wide as one or two columns.", min=1, max=2)
    ] = 1,
    font: Annotated[
        str, typer.Option(help="Font of the figure: serif, sans-serif, or the name of one.")
    ] = "sans-serif",
    beside: With = None,
    as_measured: AsMeasured = False,
    as_json: Json = False,
) -> None:
    """Compare the solvers of a store.

    Prints tables. With --out it draws pictures too. With --figure it draws one for a paper.
    """
    if figure and (out_dir or as_json):
        raise typer.BadParameter(
            "--figure makes one figure, and no tables: leave out --out, --json"
        )
    runs: AbstractContextManager[tuple[Path, str]]
    if beside:
        if campaign or (of_set and store is not None):
            raise typer.BadParameter(
                "published runs are of no campaign, and have a set only without a store: leave out"
                f" {'--campaign' if campaign else '--set'}, or --with"
            )
        runs = joined(store, beside, machine, as_measured, of_set or ())
        of_set = None
    elif store is not None:
        runs = nullcontext((store, ""))
    else:
        raise typer.BadParameter("name a store, or published runs by --with")
    chosen: dict[str, Any] = {
        "sets": of_set or (),
        "families": family or (),
        "solvers": solver or (),
        "tolerances": tol or (),
        "campaign": campaign,
        "machine": machine,
        "merit": merit.value if merit else None,
        "start": start.value,
        "metric": metric.value,
        "penalty": penalty,
        "shift": shift,
        "count_unsuitable": count_unsuitable,
        "own_set": own_set,
        "both_forms": forms is Forms.both,
        "weigh": weigh.value,
    }
    try:
        if out_dir is not None:
            from fclib.bench import plots

            plots.require_formats(formats.split(","))
        with runs as (whole, note):
            if beside and store is None:
                chosen["merit"] = merit_of(whole, chosen["merit"])
            if figure:
                from fclib.report import write_figure

                drawn: dict[str, Any] = {"curve": curve.value, "columns": columns, "font": font}
                for path in write_figure(whole, figure, note=note, **drawn, **chosen):
                    out.print(str(path), highlight=False)
                return
            print_profile(
                whole, out_dir, note=note, formats=formats.split(","), as_json=as_json, **chosen
            )
    except ImportError as error:
        fail(f'{error}; pip install "fclib[bench]"')
    except ValueError as error:  # a format that Matplotlib does not know, and what fclib raises
        fail(str(error))
