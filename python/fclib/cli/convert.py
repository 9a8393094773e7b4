"""``fclib convert``: other formats, formulations and storages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import fclib
from fclib import _laws, _sequence
from fclib._files import is_open_or_device
from fclib.cli._files import contents_of
from fclib.cli._output import Json, Report, each_file, err, usage_error


class Format(str, Enum):
    """The format of an output file."""

    hdf5 = "hdf5"
    siconos = "siconos"


class Form(str, Enum):
    """The formulation of the result."""

    local = "local"
    plain = "plain"


class Storage(str, Enum):
    """The storage of matrices in the result."""

    csr = "csr"
    csc = "csc"
    triplet = "triplet"
    dense = "dense"


EXTENSIONS = {".hdf5": Format.hdf5, ".h5": Format.hdf5, ".dat": Format.siconos}
EXTENSION_OF = {Format.hdf5: ".hdf5", Format.siconos: ".dat"}
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True)
class Request:
    """The changes for every file; None leaves a thing as it is."""

    form: Form | None
    storage: Storage | None
    kind: str | None
    force: bool
    folder: Path | None  # made if needed


def format_of(path: Path) -> Format:
    """The format of a file that is there: its first bytes decide, or else its name."""
    file = _sequence.place_of(path)[0]
    try:
        # to open a pipe waits for ever
        if file.is_file():
            with file.open("rb") as stream:
                if stream.read(len(HDF5_SIGNATURE)) == HDF5_SIGNATURE:
                    return Format.hdf5
    except OSError:
        pass  # reading it will report the fault
    return EXTENSIONS.get(path.suffix.lower(), Format.siconos)


@dataclass(frozen=True)
class Stored:
    """A problem, and the data stored with it."""

    problem: fclib.Problem
    solution: fclib.Solution | None = None
    guesses: tuple[fclib.Solution, ...] = ()

    @property
    def extras(self) -> dict[str, tuple[bool, str]]:
        """The names of data for which a format may have no place, and whether they exist."""
        return {
            "solution": (self.solution is not None, "the solution"),
            "guesses": (bool(self.guesses), "the guesses"),
            "matrix_info": (bool(self.problem.matrix_info), "what is known of the matrices"),
        }


def read(path: Path, kind: str | None) -> Stored:
    """The problem of a file in any format, and the data stored with it.

    Raises:
        fclib.Error: the file cannot be read, or the problem is not valid.
    """
    if format_of(path) is Format.siconos:
        return Stored(fclib.read_siconos(path, kind))
    problem = fclib.read(path, kind)
    if problem.kind != contents_of(path).owner:
        return Stored(problem)
    return Stored(problem, fclib.read_solution(path), tuple(fclib.read_guesses(path)))


def is_global(problem: fclib.Problem) -> bool:
    """Whether the problem has the dynamics of the bodies."""
    return isinstance(problem, _laws.Global)


def in_form(stored: Stored, form: Form | None) -> Stored:
    """The problem in another form, with its solution and guesses as far as they still hold.

    Raises:
        fclib.UnsuitableError: M is singular, or bilateral constraints contradict each other.
    """
    problem = stored.problem
    if form is not None and isinstance(problem, _laws.Global):
        problem = problem.condense()
    if form is Form.plain and problem.p and isinstance(problem, _laws.Local):
        problem = problem.eliminate()
    if problem is stored.problem:
        return stored

    def taken(solution: fclib.Solution) -> fclib.Solution:
        # r, and lambda if it is kept, are the same; all that follows from them is computed again
        return fclib.Solution(r=solution.r, l=solution.l if problem.p else None)

    solution = stored.solution
    return Stored(
        problem, solution and taken(solution), tuple(taken(guess) for guess in stored.guesses)
    )


def stored_as(problem: fclib.Problem, output: Format, asked: Storage | None) -> str:
    """The storage of a problem's matrices in a file: that of W, or of M."""
    if isinstance(problem, _laws.Local):
        matrix = problem.W
    elif output is Format.hdf5:
        return Storage.triplet.value
    else:
        matrix = problem.M
    if isinstance(matrix, np.ndarray):
        rows = output is Format.hdf5 and asked is not Storage.dense
        return Storage.csr.value if rows else Storage.dense.value
    name = str(matrix.format).replace("coo", Storage.triplet.value)
    if output is Format.siconos and name == Storage.csr.value and problem.m:
        return Storage.csc.value if is_global(problem) else "blocks"
    return name


def convert(source: Path, target: Path, output: Format, request: Request) -> dict[str, Any]:
    """Convert one file, and return its record.

    Raises:
        fclib.Error: a file or its problem is faulty, or the conversion is impossible.
    """
    if is_open_or_device(target):
        raise fclib.FileError(f"{target}: is a device or a pipe; name a file to be written")
    if target.exists() and not request.force:
        raise fclib.FileError(f"{target}: is there already; --force replaces it")
    given = read(source, request.kind)
    result = in_form(given, request.form)
    problem = result.problem
    if request.storage is not None:
        problem = problem.with_storage(request.storage.value)
        stored = stored_as(problem, output, request.storage).replace("blocks", Storage.csr.value)
        if stored != request.storage.value:
            file = "an FCLIB file" if output is Format.hdf5 else "a text of Siconos"
            raise fclib.UnsuitableError(
                f"{source}: FCLIB writes the matrices of a {problem.kind} problem as {stored} in "
                f"{file}, not {request.storage.value}"
            )
    if request.folder is not None:  # only now: what cannot be read leaves no folder
        request.folder.mkdir(parents=True, exist_ok=True)
    if output is Format.hdf5:
        dense = request.storage is Storage.dense
        fclib.write(target, problem, result.solution, result.guesses, dense=dense)
        kept = {name for name, (there, _) in result.extras.items() if there}
    else:
        fclib.write_siconos(target, problem)
        kept = set()
        lost = [what for there, what in result.extras.values() if there]
        if lost:
            say_lost(source, lost)
    return {
        "problem": str(source),
        "formulation": given.problem.formulation,
        "n": given.problem.n,
        "nc": given.problem.nc,
        "output": str(target),
        "format": output.value,
        "becomes": problem.formulation,
        "storage": stored_as(problem, output, request.storage),
        **{
            name: ("kept" if name in kept else "dropped") if there else None
            for name, (there, _) in given.extras.items()
        },
    }


def say_lost(source: Path, lost: Sequence[str]) -> None:
    """Warn of data that a text of Siconos cannot hold."""
    what = " and ".join(filter(None, [", ".join(lost[:-1]), lost[-1]]))
    verb, rest = ("is", "it") if lost == ["the solution"] else ("are", "them")
    note = f"fclib: {source}: {what} {verb} left out, Siconos' text has no place for {rest}"
    err.print(note, highlight=False)


def targets_of(
    files: Sequence[Path], out_dir: Path | None, output: Format | None
) -> tuple[list[Path], list[Path], Format]:
    """The inputs, the output of each, and the format of these.

    Raises:
        ValueError: the arguments do not say what to write.
    """
    if out_dir is not None:
        output = output or Format.hdf5
        files = [path for file in files for path in _sequence.steps_or_file(file)]
        targets = [out_dir / (_sequence.name_of(path) + EXTENSION_OF[output]) for path in files]
        for target in targets:
            if targets.count(target) > 1:
                raise ValueError(f"several inputs would be written to {target}")
        return list(files), targets, output
    if len(files) != 2:
        raise ValueError("give an input and an output, or inputs and --out FOLDER")
    source, target = files
    if (steps := _sequence.steps_or_file(source)) != [source]:
        raise ValueError(
            f"{source} is a sequence of {len(steps)} steps: name one of them, as {source}#0, or a"
            " folder for all by --out"
        )
    if target.is_dir():
        raise ValueError(f"{target} is a folder, give it with --out")
    output = output or EXTENSIONS.get(target.suffix.lower())
    if output is None:
        known = ", ".join(EXTENSIONS)
        raise ValueError(f"{target} ends with none of {known}: give its --format")
    return [source], [target], output


def command(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="An input and an output; with --out, inputs alone.",
            metavar="INPUT OUTPUT | INPUT...",
            show_default=False,
        ),
    ],
    out_dir: Annotated[
        Path | None, typer.Option("--out", help="Folder for the output of each input.")
    ] = None,
    form: Annotated[
        Form | None,
        typer.Option(
            help="local: condense to the contacts; plain: eliminate bilateral constraints too."
        ),
    ] = None,
    storage: Annotated[
        Storage | None, typer.Option(help="Storage of all matrices; by default that of the input.")
    ] = None,
    output: Annotated[
        Format | None,
        typer.Option(
            "--format", help="Format of the output; by default what its name says, hdf5 with --out."
        ),
    ] = None,
    kind: Annotated[
        str | None,
        typer.Option(
            help="local, global, local_rolling, global_rolling, local_spin or global_spin: which "
            "problem of a file that holds several, or what a text holds if its sizes should "
            "not decide."
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace what is there already.")] = False,
    as_json: Json = False,
) -> None:
    """Convert files to other formulations, storages, Siconos' texts.

    The format of an input follows from its content. A step of a sequence, run.h5#17, becomes a file
    of its own; with --out, all steps do. Solutions, guesses and what is known of the
    matrices are kept if they hold for the new problem. Siconos' texts cannot hold them, nor
    bilateral constraints, nor titles.
    """
    try:
        sources, targets, chosen = targets_of(files, out_dir, output)
    except ValueError as error:
        usage_error(error)
    request = Request(form, storage, kind, force, out_dir)
    report = Report(as_json, hidden=("n", "format", "matrix_info"))
    if out_dir is not None and out_dir.exists() and not out_dir.is_dir():
        report.error(out_dir, fclib.Error(f"{out_dir}: cannot be written: it is no folder"))
        report.finish()
    target_of = dict(zip(sources, targets, strict=True))
    for source in each_file(sources, "converting"):
        target = target_of[source]
        try:
            record = convert(source, target, chosen, request)
        except fclib.Error as error:
            named = str(error).startswith((f"{source}: ", f"{target}: "))
            report.error(source, error if named else fclib.Error(f"{source}: {error}"))
        except OSError as error:
            report.error(source, fclib.Error(f"{target}: cannot be written: {error.strerror}"))
        except MemoryError:
            report.error(source, fclib.Error(f"{source}: there is not enough memory"))
        else:
            report.add(record)
    report.finish()
