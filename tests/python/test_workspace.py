"""One solve after another, from what contacts had before, in memory that is kept."""

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from capi_library import ROOT, compile_program
from helpers import planted_global, planted_local, ran


def test_the_same_again_takes_next_to_nothing() -> None:
    problem = planted_local(nc=20, seed=3).problem
    names = np.arange(100, 120)
    workspace = fclib.Workspace(tol=1e-8)
    first = workspace.solve(problem, names)
    assert first.converged
    assert first.solver == "workspace"
    assert fclib.merit(problem, first.solution).error == pytest.approx(first.error, rel=1e-9)
    assert workspace.solve(problem, names).iterations <= 2 < first.iterations
    workspace.forget()
    assert workspace.solve(problem, names).iterations == first.iterations


def test_other_formulations_start_from_the_names_too() -> None:
    problem = planted_global(nc=6, seed=1).problem
    workspace = fclib.Workspace()
    names = np.arange(6)
    first = workspace.solve(problem, names)
    again = workspace.solve(problem, names)
    assert first.converged
    assert again.converged
    assert again.iterations <= first.iterations
    assert again.solver == "auto"


def test_wrong_names_are_refused() -> None:
    problem = planted_local(nc=4, seed=0).problem
    workspace = fclib.Workspace()
    for wrong in ([1, 2], [0.5] * 4, "abcd"):
        with pytest.raises(fclib.ProblemError, match="contacts: expected nc = 4"):
            workspace.solve(problem, wrong)
    odd: list[Any] = [[[1], [2, 3], 4, 5], np.full(4, 2**63, dtype=np.uint64)]
    for names in odd:
        with pytest.raises(fclib.ProblemError, match="contacts: "):
            workspace.solve(problem, contacts=names)
    with pytest.raises(fclib.ProblemError, match="problem: a NoneType is none of"):
        workspace.solve(None)  # type: ignore[arg-type]
    with pytest.raises(fclib.OptionError, match="tol: 'small' is not a number"):
        fclib.Workspace(tol="small")  # type: ignore[arg-type]
    with pytest.raises(fclib.OptionError, match="tol: inf is not a finite number"):
        fclib.Workspace(tol=np.inf)
    workspace.tol = "small"  # type: ignore[assignment]
    with pytest.raises(fclib.OptionError, match="tol: 'small' is not a number"):
        workspace.solve(problem)
    with pytest.raises(fclib.OptionError):
        fclib.Workspace(tol=-1)


def test_from_c_nothing_is_allocated_step_by_step(tmp_path: Path) -> None:
    program = compile_program(ROOT / "tests/capi/workspace.c", tmp_path / "workspace", "-lm")
    ran(program, timeout=60)
    if shutil.which("valgrind") is None:
        pytest.skip("there is no valgrind to count calls of malloc")
    calls = []
    for steps in ("5", "300"):
        said = ran("valgrind", program, steps, timeout=120).stderr
        found = re.search(r"total heap usage: ([\d,]+) allocs", said)
        assert found
        calls.append(found[1])
    assert calls[0] == calls[1]
