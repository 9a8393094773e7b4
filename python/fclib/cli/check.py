"""``fclib check``: judges the solutions stored in files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

import fclib
from fclib import _laws
from fclib._judge import MARK, TOLERANCE, judge
from fclib._solve import MERITS
from fclib.cli._files import read_owner
from fclib.cli._output import (
    Files,
    Json,
    Merit,
    MeritKind,
    Report,
    Rows,
    Tolerance,
    each_file,
    err,
    out,
)

PARTS = MERITS[1:]  # parts of the error


def rows_of(problem: fclib.Problem, solution: fclib.Solution) -> list[dict[str, Any]]:
    """The contacts of a solution."""
    from fclib import analysis

    table = analysis.contacts(problem, solution)
    names = table.dtype.names or ()
    rows = [dict(zip(names, row.tolist(), strict=True)) for row in table]
    if problem.contacts is None or problem.bodies is None:
        return rows
    bodies = problem.bodies.name.split("\n")
    pairs = ([bodies[k] if k >= 0 else "" for k in pair] for pair in problem.contacts.body.tolist())
    return [
        {"contact": row["contact"], "first": first, "second": second, **row}
        for row, (first, second) in zip(rows, pairs, strict=True)
    ]


def told_of(mismatch: dict[str, Any]) -> str:
    """The stored number that disagrees with the rest of the solution: name, place, difference."""
    name = f"{mismatch['part']}[{mismatch['index']}] = {mismatch['stored']:.6g}"
    size = f"{abs(mismatch['difference']):.2g}"
    if mismatch["part"] == "l":
        return f"{name}: its joint is left with a velocity of {size}"
    source = "r" if mismatch["part"] == "v" else "the solution"
    value = mismatch["stored"] - mismatch["difference"]
    return f"{name} is wrong by {size}: from {source} follows {value:.6g}"


def consistent_of(problem: fclib.Problem) -> str:
    """The reason why other joints are judged than those of the file; empty if none are."""
    if isinstance(problem, _laws.Global):
        found = problem.consistent()
        return found[1] if found is not None else ""
    return ""


def check_certificate(report: Report, path: Path, certificate: Path) -> None:
    """Judge a proof that the problem of a file has no solution."""
    from fclib import analysis

    try:
        problem = read_owner(path)
        y, z, digest = analysis.read_certificate(certificate)
        try:
            proof = analysis.check(problem, y, z)
        except analysis.CertificateError as error:
            other = ""
            if digest is not None and digest != fclib.digest(problem):
                other = ", which is of another problem"
            raise fclib.FileError(
                f"{path}: {certificate}{other}: it proves nothing: {error}"
            ) from None
    except fclib.Error as error:
        report.error(path, error)
        return
    record = {
        "problem": str(path),
        "formulation": problem.formulation,
        "nc": problem.nc,
        "status": "no solution",
        "contacts": sorted(proof.exact_y),
        "exact": proof.exact,
        "gain": proof.gain,
        "distance": proof.distance,
        "bound": proof.bound,
    }
    report.add(record)


def command(
    files: Files,
    tol: Tolerance = TOLERANCE,
    merit: Merit = MeritKind.both,
    contacts: Annotated[
        bool, typer.Option("--contacts", help="Show each contact too: bodies, status, r, u, error.")
    ] = False,
    certificate: Annotated[
        Path | None,
        typer.Option(
            help="Check this proof that there is no solution instead: JSON, as `fclib solve "
            "--json` and `fclib analyze --json` print it."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Judge the stored solutions from the data alone.

    A line says if the data suggest that the normal is not the first component of a contact. If a
    file has several problems, the global one is taken. The last columns count the contacts
    that are open, stick and slide.
    """
    from fclib import analysis  # the import takes a while

    report = Report(as_json, hidden=("n", "formulation", "says", "mismatches", "joints"))
    for path in each_file(files, "checking"):
        if certificate is not None:
            check_certificate(report, path, certificate)
            continue
        try:
            problem = read_owner(path)
            solution = fclib.read_solution(path)
            if solution is None and (mark := fclib.read_attributes(path, "info").get(MARK)):
                report.add(
                    {
                        "problem": str(path),
                        "formulation": problem.formulation,
                        "n": problem.n,
                        "nc": problem.nc,
                        "status": "no solution",
                        "error": None,
                        **dict.fromkeys(PARTS),
                        "mismatches": [],
                        "says": {MARK: mark},
                    }
                )
                err.print(f"{path.name}: {mark}", highlight=False)
                continue
            if solution is None:
                raise fclib.FileError(f"{path}: /solution: there is no solution to check")
            try:
                judgement = judge(problem, solution, tol, merit.value)
                found = fclib.contact_merits(problem, solution)["mismatches"]
            except fclib.Error as error:
                raise fclib.FileError(f"{path}: {error}") from None
        except fclib.Error as error:
            report.error(path, error)
            continue
        mismatches = [one for one in found if not one["error"] <= tol]
        record: dict[str, Any] = {
            "problem": str(path),
            "formulation": problem.formulation,
            "n": problem.n,
            "nc": problem.nc,
            "status": "ok" if judgement.ok else "wrong",
            "error": judgement.error,
        }
        if merit is MeritKind.natural:
            record["merit"] = merit.value  # the scaled map was left out on request
        record |= {name: getattr(judgement.merit, name) for name in PARTS}
        record["mismatches"] = mismatches
        if agreed := consistent_of(problem):
            record["joints"] = agreed
            err.print(f"{path.name}: {agreed}", highlight=False)
        for one in mismatches:
            err.print(f"{path.name}: {told_of(one)}", highlight=False)
        for line in analysis.conventions(problem):
            err.print(f"{path.name}: {line}", highlight=False)
        # the claim of the file is shown, but not trusted
        if told := fclib.read_attributes(path, "solution"):
            record["says"] = told
        rows = rows_of(problem, solution) if contacts else []
        if as_json and contacts:
            record["contacts"] = rows
        elif rows:
            out.print(Rows(rows, title=path.name))
        report.add(record, judgement.ok)
    report.finish("" if certificate is not None else f"the tolerance is {tol:g} (--tol)")
