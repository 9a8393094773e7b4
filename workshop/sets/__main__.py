"""The lists of chosen problems, made anew: `.venv/bin/python -m workshop.sets COMMAND`."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

import fclib
from fclib import collections
from fclib.cli._output import Rows, err, fail, out
from fclib.cli._progress import many_bars
from fclib.collections import published, ratings
from workshop.sets import candidates, choose, difficulty, select, sequences
from workshop.tables import _results

app = typer.Typer(
    help="Make the lists of chosen problems: the sets standard, hard, open, sequences and tiny,"
    " the family LocalProblems.",
    no_args_is_help=True,
)

Folder = Annotated[Path, typer.Argument(help="Folder of the candidates and their runs.")]
List = Annotated[Path, typer.Option("--out", help="The list that is written, JSON.")]
Lists = Annotated[Path, typer.Option("--out", help="Folder that the lists are written into.")]
States = Annotated[
    Path | None,
    typer.Option(help="Folder that the chosen states are written into; else that of the package."),
]
Version = Annotated[str, typer.Option(help="Version of the lists: a number, higher than before.")]
Estimate = Annotated[bool, typer.Option("--estimate", help="Say the CPU it needs, and end.")]
PerFamily = Annotated[int, typer.Option(help="Problems of a family, at most.", min=1)]


@app.command("candidates")
def find_candidates(
    folder: Folder,
    names: Annotated[
        list[str] | None, typer.Option("--family", help="Only these SET/FAMILY.")
    ] = None,
    estimate: Estimate = False,
    results: Annotated[
        str | None, typer.Option(help="Store the CPU of each family as docs/results/NAME.csv.")
    ] = None,
) -> None:
    """Describe candidates of all families, and write a file for each that is measured.

    Families without stored states are simulated. It goes on after a kill. Families that changed, or
    are new, are described anew.
    """
    own = names or candidates.folders()
    if lost := sorted(set(own) - set(candidates.folders())):
        fail(f"{', '.join(lost)}: there is no such SET/FAMILY from which candidates come")
    out.print(difficulty.estimate(folder, own), highlight=False)
    if estimate:
        return
    try:
        with many_bars() as bars:
            _, failed = difficulty.describe(folder, own, bars)
        rows = difficulty.measured(folder)
        count, unwritten = difficulty.write_problems(folder, rows, select.Rule())
    except difficulty.FAULTS as error:
        fail(str(error))
    words = f"{count} of {len(rows)} candidates are measured:  {folder / 'problems'}"
    out.print(words, highlight=False)
    for name, reason in failed.items():
        err.print(f"{name}: has no candidates: {reason}", style="red", highlight=False)
    tell_lost(unwritten)
    if results:
        costs = difficulty.known_costs(folder)
        table = [{"family": name, "CPU [s]": f"{costs[name]:.1f}"} for name in sorted(own)]
        _results.store(
            results,
            [*table, {"family": "all", "CPU [s]": f"{sum(costs[name] for name in own):.0f}"}],
            title="What the candidates of the sets cost",
            note="Simulation of families without stored states, and features.",
        )
    raise typer.Exit(int(bool(failed or unwritten)))


def tell_lost(lost: Mapping[str, str]) -> None:
    """Say which candidates have no file, and why."""
    for name, reason in lost.items():
        err.print(f"{name}: cannot be written: {reason}", style="red", highlight=False)


@app.command()
def measure(
    folder: Folder,
    jobs: Annotated[int, typer.Option("--jobs", "-j", help="Runs at once.", min=1)] = 1,
    estimate: Estimate = False,
) -> None:
    """Measure what solvers do on the candidates: campaigns difficulty and difficulty-long.

    Further candidates of families that have hard ones are written, and measured too. It goes on
    after a kill.
    """
    rule = select.Rule()
    files = len(list((folder / "problems").glob("*/*.hdf5")))
    if not files:
        fail(f"{folder}: has no problems; python -m workshop.sets candidates {folder} makes them")
    out.print(difficulty.needed(folder, select.SHORT, files), highlight=False)
    if estimate:
        runs = len(list((folder / "difficult").glob("*/*.hdf5"))) or files
        out.print(difficulty.needed(folder, select.LONG, runs), highlight=False)
        return
    try:
        difficulty.run(folder, select.SHORT, jobs)
        _, lost = difficulty.write_problems(folder, difficulty.measured(folder), rule)
        tell_lost(lost)
        count = len(list((folder / "problems").glob("*/*.hdf5")))
        if count > files:
            out.print(difficulty.needed(folder, select.SHORT, count), highlight=False)
            difficulty.run(folder, select.SHORT, jobs)
        # first the difficult ones: `standard` follows from them, and `hard` from what it leaves
        for _ in range(2):
            count = difficulty.link_difficult(folder, rule)
            out.print(difficulty.needed(folder, select.LONG, count), highlight=False)
            if count:
                difficulty.run(folder, select.LONG, jobs)
    except (subprocess.CalledProcessError, *difficulty.FAULTS) as error:
        fail(str(error))


@app.command("choose")
def choose_sets(
    folder: Folder,
    target: Lists,
    version: Version,
    states: States = None,
    results: Annotated[
        str | None, typer.Option(help="Store the counts as docs/results/NAME.csv.")
    ] = None,
) -> None:
    """Choose the sets standard, hard and open, and say of each candidate why.

    The lists, the states of their problems and the table choice-VERSION.csv are written. The lists
    follow from that table alone. Nothing that is there is rewritten: other problems need a further
    version.
    """
    rule = select.Rule()
    target.mkdir(parents=True, exist_ok=True)
    package = states.parent if states is not None else published.IN_PLACE
    table = package / ratings.FOLDER / f"choice-{version}.csv"
    try:
        measured = difficulty.measured(folder)
        select.write_table(folder / "measured.csv", measured)
        # by the stored digits, so that everybody with the table gets the same choice
        rows = select.read_table(folder / "measured.csv")
        chosen = select.choose(rows, rule)
        told = [
            {**row, "set": name, "why": why}
            for row, name, why in zip(rows, chosen.set, chosen.why, strict=True)
        ]
        if table.is_file() and select.read_table(table) != told:
            fail(f"{table}: is another choice; a newer one is a further version (--version)")
        taken = [rows[k] for name in select.SETS for k in chosen.of(name)]
        sources = {
            own: candidates.candidates_of(own, folder)
            for own in dict.fromkeys(map(select.folder_of, taken))
        }
        choose.archive(target, select.SETS, version)
        for name in select.SETS:
            choices = select.choices_of(sources, [rows[k] for k in chosen.of(name)])
            choose.write_list(
                target / f"{name}.json", choices, rule.record() | {"version": version}
            )
            select.publish(sources, choices, name, version, states or package / published.FOLDER)
        select.write_table(table, told)
    except difficulty.FAULTS as error:
        fail(str(error))
    counts = select.counts_of(chosen)
    out.print(Rows(counts))
    for line in chosen.lacking:
        out.print(f"lacking: {line}", highlight=False)
    out.print(f"{table}\nSay version {version} of these sets in fclib.collections.set_index.SETS")
    if results:
        _results.store(
            results,
            counts,
            title="The candidates of the sets, and what became of them",
            note="; ".join(chosen.lacking) or "All bounds of the rule hold.",
        )


@app.command("sequences")
def choose_sequences(
    folder: Folder,
    target: Lists,
    version: Version,
    states: States = None,
    names: Annotated[
        list[str] | None, typer.Option("--family", help="Only these SET/FAMILY.")
    ] = None,
) -> None:
    """Choose the simulations of the set sequences; those without stored states are simulated.

    It goes on after a kill.
    """
    rule = sequences.Rule()
    target.mkdir(parents=True, exist_ok=True)
    try:
        choices = []
        with many_bars() as bars:
            rows = sequences.describe(names or candidates.folders(), rule, folder, bars)
            chosen = sequences.choose(rows, rule)
            for own, numbers in chosen:
                found = sequences.states_of(own, numbers, folder / "sequences", bars)
                mine = sequences.choices_of(found)
                choices += mine
                select.publish(
                    {own: found},
                    mine,
                    "sequences",
                    version,
                    states or published.IN_PLACE / published.FOLDER,
                )
        choose.archive(target, ["sequences"], version)
        choose.write_list(target / "sequences.json", choices, rule.record() | {"version": version})
    except difficulty.FAULTS as error:
        fail(str(error))
    for own, numbers in chosen:
        out.print(f"{own} {numbers[0]} to {numbers[-1]}", highlight=False)
    if len(chosen) < rule.count:
        out.print(f"lacking: {rule.count - len(chosen)} of {rule.count} simulations")


@app.command("local")
def choose_local(
    folder: Annotated[Path, typer.Argument(help="Folder of a collection.")],
    target: List,
    sample: Annotated[int, typer.Option(help="Problems of a family that are looked at.")] = 200,
    per_family: PerFamily = 4,
    spins: Annotated[int, typer.Option(help="Spinning bodies that are drawn.", min=0)] = 2000,
    asymmetric: Annotated[
        int, typer.Option(help="How many asymmetric ones are taken.", min=0)
    ] = 16,
) -> None:
    """Choose the contacts that one-contact solvers find hardest."""
    try:
        with many_bars() as bars:
            found = choose.local(
                folder,
                sample=sample,
                per_family=per_family,
                spins=spins,
                asymmetric=asymmetric,
                progress=bars,
            )
    except (collections.CatalogError, ImportError, fclib.Error) as error:
        fail(str(error))
    rule = {
        "sample": sample,
        "per_family": per_family,
        "spins": spins,
        "asymmetric": asymmetric,
        "sweeps": choose.SWEEPS,
        "tol": choose.LOCAL_TOLERANCE,
    }
    choose.write_local(target, found, rule)
    tell_chosen([contact.origin for contact in found], target)


@app.command("tiny")
def choose_tiny(target: List) -> None:
    """Simulate one problem of each kind, and list them."""
    try:
        chosen = choose.tiny()
    except (ImportError, ValueError, FloatingPointError) as error:
        fail(str(error))
    choose.write_list(target, chosen, {"kinds": len(chosen)})
    tell_chosen([f"{choice.family}/{choice.number:04d}" for choice in chosen], target)


def tell_chosen(names: list[str], target: Path) -> None:
    """Print the problems taken."""
    for name in names:
        out.print(name, highlight=False)
    out.print(f"{len(names)} problems:  {target}")


if __name__ == "__main__":
    app(prog_name="python -m workshop.sets")
