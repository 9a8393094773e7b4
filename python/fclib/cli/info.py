"""``fclib info``: the content of files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import fclib
from fclib import _symmetry
from fclib.cli._files import Contents, contents_of
from fclib.cli._output import Files, Json, Report, each_file, warn_of

MATRICES = ("M", "H", "G", "W", "V", "R")
MATRIX_INFO = ("comment", "conditioning", "determinant", "rank")


def describe(path: Path, problem: fclib.Problem, contents: Contents) -> dict[str, Any]:
    """The record of one problem of a file.

    Raises:
        fclib.Error: the file cannot be read.
    """
    own = problem.kind == contents.owner
    stored = {name: getattr(problem, name, None) for name in MATRICES}
    nnz = {name: int(getattr(a, "nnz", a.size)) for name, a in stored.items() if a is not None}
    return {
        "problem": str(path),
        "formulation": problem.formulation,
        "spacedim": problem.spacedim,
        "n": problem.n,
        "m": problem.m,
        "p": problem.p,
        "nc": problem.nc,
        "nnz": sum(nnz.values()),
        "nnz_of": nnz,
        "mu_min": float(problem.mu.min()) if problem.nc else None,
        "mu_max": float(problem.mu.max()) if problem.nc else None,
        "solution": own and contents.solution,
        "guesses": len(fclib.read_guesses(path)) if own and contents.guesses else 0,
        "solutions": len(fclib.read_solutions(path)) if own and contents.solutions else 0,
        "asymmetry": _symmetry.asymmetries(problem),
        "matrix_info": {
            name: {key: getattr(info, key) for key in MATRIX_INFO}
            for name, info in problem.matrix_info.items()
        },
        "title": problem.info.title,
        "description": problem.info.description,
        "math_info": problem.info.math_info,
    }


def command(files: Files, as_json: Json = False) -> None:
    """Print the formulation, sizes and friction of problems.

    Also print what else the files hold: solutions, guesses, titles, and what is known of the
    matrices. Lines on the standard error say what cannot be read beside the problems, and which
    matrices are not symmetric.
    """
    hidden = ("nnz_of", "description", "math_info", "spacedim", "m", "asymmetry", "left_out")
    report = Report(as_json, hidden=hidden)
    for path in each_file(files, "reading"):
        try:
            contents = contents_of(path)
            # None: reading will report the fault
            problems = [fclib.read(path, kind) for kind in contents.kinds or (None,)]
            left_out = fclib.left_out(path)
            for line in left_out:
                warn_of(path, f"{line}: left out")
            for problem in problems:
                report.add(describe(path, problem, contents) | {"left_out": left_out})
                for line in _symmetry.not_symmetric(problem):
                    warn_of(path, line)
        except fclib.Error as error:
            report.error(path, error)
    if not any(record["matrix_info"] for record in report.records):
        report.hidden += ("matrix_info",)
    report.finish()
