"""One solve after another, from what contacts had before, in memory that is kept."""

import copy
import pickle
import re
import shutil
import signal
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from capi_library import ROOT, compile_program
from helpers import planted_global, planted_local, planted_rolling, ran


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


def dense(nc: int) -> fclib.LocalProblem:
    """Bodies with fewer coordinates than W has rows, all of them coupled."""
    rng = np.random.default_rng(0)
    H = rng.normal(size=(nc, 3 * nc))
    return fclib.LocalProblem(W=H.T @ H, q=rng.normal(size=3 * nc), mu=rng.uniform(0.3, 1.5, nc))


def test_a_limit_of_time_holds_before_auto_and_in_it() -> None:
    """The method of small problems alone took tens of times as long."""
    problem = dense(290)
    workspace = fclib.Workspace(time_limit=0.05)
    result = workspace.solve(problem)
    assert result.status == "time_limit"
    assert result.time < 10
    assert result.error == pytest.approx(fclib.merit(problem, result.solution).error, rel=1e-6)
    workspace.time_limit = None
    assert workspace.solve(planted_local(nc=4, seed=0).problem).converged
    with pytest.raises(fclib.OptionError, match="time_limit: -1"):
        workspace.time_limit = -1


@pytest.mark.parametrize("nc", [290, 420])  # by the method of small problems, and by auto
def test_a_solve_can_be_interrupted(nc: int) -> None:
    class StopError(Exception):
        pass

    def stop(*_: Any) -> None:
        raise StopError

    workspace = fclib.Workspace(time_limit=60)
    before = signal.signal(signal.SIGALRM, stop)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(StopError):
            workspace.solve(dense(nc))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert workspace.solve(planted_local(nc=4, seed=0).problem).converged


def test_what_auto_found_is_there_with_its_proof() -> None:
    problem = fclib.LocalProblem(
        W=np.zeros((6, 6)), q=[-1, 0.1, 0, -1, 0, 0.1], mu=[0.5, 0.5]
    )  # fmt: skip
    result = fclib.Workspace().solve(problem)
    assert result.status == "infeasible"
    assert result.certificate is not None
    assert [stage.name for stage in result.stages]
    assert result.solver == "auto"


def test_without_names_it_starts_from_the_last_problem_of_as_many_contacts() -> None:
    problem = planted_local(nc=20, seed=3).problem
    workspace = fclib.Workspace()
    workspace.solve(problem, np.arange(20))
    assert workspace.solve(problem).iterations <= 2


def test_a_copy_has_the_settings_and_no_memory() -> None:
    class Own(fclib.Workspace):
        pass

    assert type(copy.copy(Own())) is Own
    workspace = fclib.Workspace(1e-6, time_limit=3)
    problem = planted_local(nc=20, seed=3).problem
    cold = workspace.solve(problem).iterations
    for other in (copy.copy(workspace), copy.deepcopy(workspace), pickle.loads(
        pickle.dumps(workspace)
    )):  # fmt: skip
        assert (other.tol, other.time_limit) == (1e-6, 3)
        assert other.solve(problem).iterations == cold


def test_a_solve_before_another_has_ended_is_refused() -> None:
    """Each answer is one of its own problem. A handler of a signal comes for certain."""
    workspace = fclib.Workspace(time_limit=1.0)
    small = planted_local(nc=4, seed=0).problem
    said = []

    def handler(*_: Any) -> None:
        with pytest.raises(fclib.ProblemError) as error:
            workspace.solve(small)
        said.append(str(error.value))
        with pytest.raises(fclib.ProblemError) as error:
            workspace.forget()
        said.append(str(error.value))

    before = signal.signal(signal.SIGALRM, handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1, 0.1)
        workspace.solve(dense(290))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert set(said) == {"workspace: is in use: another solve has not ended"}
    assert workspace.solve(small).converged


def test_threads_do_not_share_a_solve() -> None:
    workspace = fclib.Workspace()
    problems = [planted_local(nc=nc, seed=nc).problem for nc in (2, 7, 24, 40)]
    problems += [planted_rolling(3, 1)[0]]
    wrong, refused = [], []

    def work(problem: Any) -> None:
        for _ in range(100):
            try:
                result = workspace.solve(problem)
            except fclib.ProblemError as error:
                refused.append(str(error))
                continue
            if result.converged and not fclib.merit(problem, result.solution).error <= 1e-8:
                wrong.append(result)

    threads = [threading.Thread(target=work, args=(problem,)) for problem in problems]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
    assert set(refused) <= {"workspace: is in use: another solve has not ended"}


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
