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
from fclib.cli._output import Json, Report, each_file, err, usage_error


class Format(str, Enum):
    """What a file is written in."""

    hdf5 = "hdf5"
    siconos = "siconos"


class Form(str, Enum):
    """What a problem is brought to."""

    local = "local"
    plain = "plain"


class Storage(str, Enum):
    """What matrices are brought to."""

    csr = "csr"
    csc = "csc"
    triplet = "triplet"
    dense = "dense"


EXTENSIONS = {".hdf5": Format.hdf5, ".h5": Format.hdf5, ".dat": Format.siconos}
EXTENSION_OF = {Format.hdf5: ".hdf5", Format.siconos: ".dat"}
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True)
class Request:
    """What is asked of every file; None leaves things as they are."""

    form: Form | None
    storage: Storage | None
    kind: str | None
    force: bool


def format_of(path: Path) -> Format:
    """The format of a file that is there: its first bytes tell, or else its name."""
    try:
        with path.open("rb") as file:
            if file.read(len(HDF5_SIGNATURE)) == HDF5_SIGNATURE:
                return Format.hdf5
    except OSError:
        pass  # reading it says what is wrong
    return EXTENSIONS.get(path.suffix.lower(), Format.siconos)


def read(path: Path, kind: str | None) -> tuple[fclib.Problem, fclib.Solution | None]:
    """The problem of a file in any format, and the solution that is stored with it.

    Raises:
        fclib.Error: the file cannot be read, or the problem is not valid.
    """
    if format_of(path) is Format.siconos:
        return fclib.read_siconos(path, kind), None
    problem = fclib.read(path, kind)
    solution = fclib.read_solution(path)
    kinds = [name for name in fclib.contents(path) if name.startswith(("local", "global"))]
    # beside other problems, a solution is that of the global one
    owned = len(kinds) < 2 or is_global(problem)
    return problem, solution if owned else None


def is_global(problem: fclib.Problem) -> bool:
    """Whether the problem has the dynamics of the bodies."""
    return isinstance(problem, (fclib.GlobalProblem, fclib.GlobalRollingProblem))


def in_form(
    problem: fclib.Problem, solution: fclib.Solution | None, form: Form | None
) -> tuple[fclib.Problem, fclib.Solution | None]:
    """The problem in another form, with what its solution still means there.

    Raises:
        fclib.UnsuitableError: M or R is singular.
    """
    before = problem
    if form is not None and isinstance(problem, (fclib.GlobalProblem, fclib.GlobalRollingProblem)):
        problem = problem.condense()
    if (
        form is Form.plain
        and problem.p
        and isinstance(problem, (fclib.LocalProblem, fclib.LocalRollingProblem))
    ):
        problem = problem.eliminate()
    if solution is not None and problem is not before:
        # r, and lambda where it is left, are the same; what follows from them is computed again
        solution = fclib.Solution(r=solution.r, l=solution.l if problem.p else None)
    return problem, solution


def stored_as(problem: fclib.Problem, output: Format) -> str:
    """How the matrices of a problem stand in a file: those of W, or of M."""
    if isinstance(problem, (fclib.LocalProblem, fclib.LocalRollingProblem)):
        matrix = problem.W
    elif output is Format.hdf5:
        return Storage.triplet.value
    else:
        matrix = problem.M
    if isinstance(matrix, np.ndarray):
        return Storage.dense.value
    name = str(matrix.format).replace("coo", Storage.triplet.value)
    if output is Format.siconos and name == Storage.csr.value and problem.m:
        return Storage.csc.value if is_global(problem) else "blocks"
    return name


def convert(source: Path, target: Path, output: Format, request: Request) -> dict[str, Any]:
    """Convert one file, and return its record.

    Raises:
        fclib.Error: something is wrong with a file or its problem, or cannot be done.
    """
    if target.exists() and not request.force:
        raise fclib.FileError(f"{target}: is there already; --force replaces it")
    given, solution = read(source, request.kind)
    problem, solution = in_form(given, solution, request.form)
    if request.storage is not None:
        problem = problem.with_storage(request.storage.value)
        stored = stored_as(problem, output).replace("blocks", Storage.csr.value)
        if stored != request.storage.value:
            file = "an FCLIB file" if output is Format.hdf5 else "a text of Siconos"
            raise fclib.UnsuitableError(
                f"{source}: the matrices of a {problem.kind} problem are {stored} in {file}, "
                f"not {request.storage.value}"
            )
    kept = None if solution is None else output is Format.hdf5
    if output is Format.hdf5:
        fclib.write(target, problem, solution)
    else:
        fclib.write_siconos(target, problem)
    return {
        "problem": str(source),
        "formulation": given.formulation,
        "n": given.n,
        "nc": given.nc,
        "output": str(target),
        "format": output.value,
        "becomes": problem.formulation,
        "storage": stored_as(problem, output),
        "solution": None if kept is None else "kept" if kept else "dropped",
    }


def targets_of(
    files: Sequence[Path], out_dir: Path | None, output: Format | None
) -> tuple[list[Path], list[Path], Format]:
    """The inputs, the output of each, and the format of these.

    Raises:
        ValueError: the arguments do not say what to write.
    """
    if out_dir is not None:
        output = output or Format.hdf5
        targets = [out_dir / (path.stem + EXTENSION_OF[output]) for path in files]
        for target in targets:
            if targets.count(target) > 1:
                raise ValueError(f"several inputs would be written to {target}")
        return list(files), targets, output
    if len(files) != 2:
        raise ValueError("give an input and an output, or inputs and --out FOLDER")
    source, target = files
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
            help="An input and an output, or inputs alone where --out is given.",
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
        Storage | None, typer.Option(help="Storage of all matrices, that of the input by default.")
    ] = None,
    output: Annotated[
        Format | None,
        typer.Option(
            "--format",
            help="Format of the output; by default what its name says, hdf5 with --out.",
        ),
    ] = None,
    kind: Annotated[
        str | None,
        typer.Option(
            help="local, global, local_rolling or global_rolling: which problem of a file that "
            "holds several, or what a text holds where its sizes should not decide."
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace what is there already.")] = False,
    as_json: Json = False,
) -> None:
    """Convert between FCLIB files and Siconos' texts (.dat), formulations and storages.

    What an input is in, its content says. Siconos' texts have no place for bilateral constraints,
    solutions and titles.
    """
    try:
        sources, targets, chosen = targets_of(files, out_dir, output)
    except ValueError as error:
        usage_error(error)
    request = Request(form, storage, kind, force)
    report = Report(as_json, hidden=("n", "format"))
    target_of = dict(zip(sources, targets, strict=True))
    for source in each_file(sources, "converting"):
        target = target_of[source]
        try:
            if out_dir is not None:
                out_dir.mkdir(parents=True, exist_ok=True)
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
            if record["solution"] == "dropped":
                note = (
                    f"fclib: {source}: the solution is left out, Siconos' text has no place for it"
                )
                err.print(note, markup=False, highlight=False)
    report.finish()
