"""``fclib analyze``: the analysis of problems, and whether they have a solution."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

import fclib
from fclib.cli._files import read_owner
from fclib.cli._output import Files, Json, Report, Tolerance, each_file, err, fail

COLUMNS = (
    "problem",
    "formulation",
    "nc",
    "islands",
    "rank_W",
    "conditioning_W",
    "asymmetry_W",
    "hyperstaticity",
    "definiteness",
    "slater",
    "existence",
    "self_stress",
    "uniqueness",
    "seconds",
)
REFERENCE = (
    "reference_certified",
    "reference_error",
    "reference_second",
    "reference_difference",
    "reference_reaction",
)


def store(path: Path, found: Any) -> None:
    """Put an analysis into the file of its problem: MATRIX_INFO, MATH_INFO, attributes of info.

    Raises:
        fclib.FileError: the file cannot be written.
    """
    problem, info = found.problem, found.problem.info
    solution, guesses = fclib.read_solution(path), fclib.read_guesses(path)
    groups = ["solution", *(f"guesses/{k}" for k in range(1, len(guesses) + 1))]
    told = {group: fclib.read_attributes(path, group) for group in groups}
    kept = fclib.read_attributes(path, "info")
    fclib.write(
        path,
        problem.replace(
            info=fclib.ProblemInfo(
                title=info.title, description=info.description, math_info=found.words
            ),
            matrix_info=found.matrix_info,
        ),
        solution,
        guesses,
        mode="replace",
    )
    values = {key: _attribute(value) for key, value in found.record.items() if value is not None}
    fclib.write_attributes(path, "info", {**kept, **values})
    for group, attributes in told.items():
        if attributes:
            fclib.write_attributes(path, group, attributes)


def _attribute(value: Any) -> float | str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        return float(value)
    return str(value)


def command(
    files: Files,
    write: Annotated[
        bool,
        typer.Option(
            "--write",
            help="Store what was found in the files: MATRIX_INFO, MATH_INFO, attributes of info.",
        ),
    ] = False,
    solve: Annotated[
        bool,
        typer.Option(
            "--reference",
            help="Compute reference solutions, to 1e-12 by two algorithms; --write stores them.",
        ),
    ] = False,
    tol: Tolerance = 1e-8,
    time_limit: Annotated[
        float, typer.Option(help="Limit of each solver and conic program [s].", min=0.001)
    ] = 20.0,
    as_json: Json = False,
) -> None:
    """Find ranks, units, existence with its proof, and uniqueness.

    A solution is sought too, for 2 s at most if Slater's condition proves that there is one.
    If a file has several problems, the global one is taken. The exit status is 1 if a problem
    cannot be analysed, or a reference solution cannot be certified.
    """
    from fclib import analysis

    report = Report(as_json)
    words = []
    for path in each_file(files, "analysing"):
        start = time.perf_counter()
        good = True
        try:
            problem = read_owner(path)
            found = analysis.analyze(problem, tol=tol, time_limit=time_limit)
            record = {"problem": str(path), **found.record}
            if solve:
                solved = analysis.reference(problem, time_limit=time_limit)
                own = solved.record
                # both may have the same name
                record |= {f"reference_{key}": own[key] for key in own if key not in record}
                good = solved.certified
            if write:
                store(path, found)
                if solve and solved.solution is not None:
                    fclib.write_solution(path, solved.solution)
                    fclib.write_attributes(path, "solution", solved.attributes)
        except ImportError as error:
            fail(str(error))
        except fclib.Error as error:
            named = str(error).startswith(str(path))
            report.error(path, error if named else fclib.Error(f"{path}: {error}"))
            continue
        record["seconds"] = time.perf_counter() - start
        if found.certificate is not None:
            record["certificate"] = found.certificate.record(problem)
        shown = COLUMNS + tuple(key for key in record if key in REFERENCE)
        report.add(record if as_json else {key: record[key] for key in shown}, good)
        for line in [
            *found.units.trouble,
            *analysis.conventions(problem),
            *([] if good else [record["reference_reason"]]),
        ]:
            words.append(f"{path.name}: {line}")
        if found.existence.verdict in (analysis.PROVEN_NOT, analysis.UNDECIDED):
            words.append(f"{path.name}: {found.existence.reason}")
        if found.uniqueness.verdict == "not unique":
            words.append(f"{path.name}: {found.uniqueness.reason}")
    for line in words:
        err.print(line, highlight=False)
    report.finish()
