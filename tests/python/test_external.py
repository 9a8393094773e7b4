"""Users' own solvers, programs and other packages behind the contract: what they may do wrong."""

import contextlib
import ctypes
import importlib.util
import os
import re
import resource
import shutil
import signal
import sqlite3
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pytest

import fclib
from capi_library import HEADERS, ROOT, compile_program, compiler
from fclib import bench, external
from fclib.bench import processes
from fclib.bench.fingerprint import version_of
from fclib.external import command, siconos
from helpers import converged, local_problem, planted_global, planted_local, planted_rolling, ran
from helpers_cli import run

DOCS = "docs/solvers-of-your-own.md"


def problem_of(nc: int = 4, d: int = 3) -> fclib.Problem:
    return planted_local(3, d=d, nc=nc).problem


def exact(d: int = 3) -> Any:
    return planted_local(3, d=d, nc=4).solution.r


# ---- users' own solvers


NO_WORK: list[str] = []  # what the next solver says


@fclib.solver("t-no-work", title="says what is no work")
def no_work(problem: fclib.LocalProblem, r: Any, monitor: fclib.Monitor) -> Any:
    name, _, value = NO_WORK[-1].partition("=")
    if name == "stop":
        monitor.stop(r, int(value))
    else:
        setattr(monitor, name, int(value) if name == "iterations" else float(value))
    return r


@pytest.mark.parametrize("said", ["iterations=-3", "stop=-1", "cpu_s=inf", "cpu_s=nan"])
def test_a_solver_cannot_claim_what_is_no_work(said: str) -> None:
    NO_WORK.append(said)
    name = "cpu_s" if said.startswith("cpu_s") else "iterations"
    with pytest.raises(fclib.SolverError, match=rf"{name}.*(negative|not finite)"):
        fclib.solve(problem_of(), "t-no-work")


@fclib.solver("t-liar", title="says it is done")
def liar(problem: fclib.LocalProblem, r: Any, monitor: fclib.Monitor) -> Any:
    return r + 1.0


@fclib.solver("t-nan")
def not_a_number(problem: fclib.LocalProblem, r: Any, monitor: fclib.Monitor) -> Any:
    r[0] = np.nan
    return r


@fclib.solver("t-raises")
def raises(problem: fclib.LocalProblem, r: Any, monitor: fclib.Monitor) -> Any:
    raise KeyError("no such thing")


@fclib.solver("t-shape")
def shape(problem: fclib.LocalProblem, r: Any, monitor: fclib.Monitor) -> Any:
    return r[:-1]


@fclib.solver("t-options", family="test", citation="nobody 2000", dimensions=(3,))
def options(
    problem: fclib.LocalProblem,
    r: Any,
    monitor: fclib.Monitor,
    *,
    step: Annotated[float, fclib.Option("how far", unit="kg", lowest=0.5, highest=2)] = 1,
    count: int = 3,
    fast: bool = False,
    kind: Literal["left", "right"] = "right",
) -> None:
    """Keeps what it was given.

    Not this.
    """
    seen.append((step, count, fast, kind))
    monitor.status = "stalled"


@fclib.solver("t-slow")
def slow(problem: fclib.LocalProblem, r: Any, monitor: fclib.Monitor) -> None:
    while not monitor.stop(r):
        time.sleep(0.002)


seen: list[tuple[Any, ...]] = []
kept: list[fclib.Monitor] = []


def test_a_liar_is_found_out() -> None:
    result = fclib.solve(problem_of(), "t-liar")
    assert result.status == "inaccurate"
    assert result.error == fclib.merit(problem_of(), result.solution).error > 1e-8


def test_what_is_no_number_has_diverged() -> None:
    result = fclib.solve(problem_of(), "t-nan")
    assert result.status == "diverged"
    assert np.isfinite(result.solution.r).all()


def test_an_exception_comes_with_the_name_of_the_solver() -> None:
    with pytest.raises(fclib.SolverError, match="t-raises: KeyError: 'no such thing'") as info:
        fclib.solve(problem_of(), "t-raises")
    assert isinstance(info.value.__cause__, KeyError)


def test_a_wrong_answer_is_said() -> None:
    with pytest.raises(fclib.SolverError, match=r"t-shape: returned an array of shape \(11,\)"):
        fclib.solve(problem_of(), "t-shape")


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (lambda r: r + 1j, "TypeError: returned an array of complex128"),
        (lambda r: np.ma.masked_less(r - 1, 0), "TypeError: returned a masked array"),
        (lambda r: [str(x) for x in r], "TypeError: returned an array of <U"),
        (lambda _: sys.exit(0), "SystemExit: 0"),
    ],
)
def test_nothing_of_an_answer_is_dropped(answer: Callable[[Any], Any], said: str) -> None:
    """And a solver that ends its process ends no other."""

    def give(problem: fclib.LocalProblem, r: Any, monitor: fclib.Monitor) -> Any:
        return answer(r)

    fclib.solver("t-dropped")(give)
    with pytest.raises(fclib.SolverError, match=f"t-dropped: {said}"):
        fclib.solve(problem_of(), "t-dropped")


@pytest.mark.parametrize("name", ["", " ", None, 7])
def test_a_solver_has_a_name(name: Any) -> None:
    with pytest.raises(TypeError, match="is no name of a solver"):
        fclib.solver(name)


def test_defaults_that_no_user_can_mend_are_refused_at_once() -> None:
    def own(p: Any, r: Any, monitor: Any, *, merit: float = 1.0) -> None: ...

    def far(
        p: Any, r: Any, monitor: Any, *, step: Annotated[float, fclib.Option(highest=1)] = 2.0
    ) -> None: ...

    def bounds(
        p: Any, r: Any, monitor: Any, *, step: Annotated[float, fclib.Option(lowest=np.nan)] = 2.0
    ) -> None: ...

    def kind(p: Any, r: Any, monitor: Any, *, kind: Literal["a", "b"] = "c") -> None: ...  # type: ignore[assignment]

    def text(p: Any, r: Any, monitor: Any, *, count: int = "3") -> None: ...  # type: ignore[assignment]

    refused: dict[Any, str] = {
        own: "option merit: is a name that fclib.solve has itself",
        far: "option step: its default 2.0 is not between -inf and 1",
        bounds: "option step: its default 2.0 is not between nan and inf",
        kind: "option kind: its default 'c' is none of a, b",
        text: "option count: its default '3' is no int",
    }
    for function, said in refused.items():
        with pytest.raises(TypeError, match=said):
            fclib.solver("t-refused")(function)


def test_what_a_callback_raises_is_not_the_solvers() -> None:
    def stop(*_: object) -> bool:
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        fclib.solve(problem_of(), "t-slow", callback=stop)


def test_limits_and_callbacks_reach_a_users_solver() -> None:
    assert fclib.solve(problem_of(), "t-slow", max_iterations=3).status == "iteration_limit"
    assert fclib.solve(problem_of(), "t-slow", time_limit=0.02).status == "time_limit"
    assert fclib.solve(problem_of(), "t-slow", callback=lambda *_: False).status == "interrupted"


def test_options_are_keyword_parameters() -> None:
    entry = fclib.find_solver("t-options")
    assert (entry.family, entry.title, entry.citation) == (
        "test",
        "Keeps what it was given.",
        "nobody 2000",
    )
    step, count, fast, kind = entry.options
    assert (step.type, step.default, step.unit, step.doc) == ("float", 1.0, "kg", "how far")
    assert (step.lowest, step.highest) == (0.5, 2)
    assert (count.type, fast.type, kind.type) == ("int", "bool", "choice")
    assert kind.choices == ["left", "right"]
    result = fclib.solve(problem_of(), "t-options", count="4", fast=True, kind="left")
    assert result.status == "stalled"
    assert seen[-1] == (1.0, 4, True, "left")
    assert isinstance(seen[-1][0], float)


@pytest.mark.parametrize(
    "wrong",
    [{"step": 3.0}, {"step": "far"}, {"count": 1.5}, {"fast": "no"}, {"kind": "up"}, {"tempo": 1}],
    ids=str,
)
def test_wrong_options_are_refused_by_name(wrong: dict[str, Any]) -> None:
    with pytest.raises(fclib.OptionError, match=next(iter(wrong))):
        fclib.solve(problem_of(), "t-options", **wrong)


def test_other_dimensions_are_refused() -> None:
    with pytest.raises(fclib.UnsuitableError, match="t-options"):
        fclib.solve(problem_of(d=2), "t-options")
    rolling = fclib.LocalRollingProblem(
        spacedim=5, W=np.eye(5), q=[-1.0, 0, 0, 0, 0], mu=[0.5], mu_r=[0.1]
    )
    with pytest.raises(fclib.UnsuitableError, match="t-options"):
        fclib.solve(rolling, "t-options")


def test_functions_that_are_no_solvers_are_refused() -> None:
    def few(problem: Any, r: Any) -> None: ...
    def without(problem: Any, r: Any, monitor: Any, *, step: float) -> None: ...
    def text(problem: Any, r: Any, monitor: Any, *, name: str = "") -> None: ...
    def taken(problem: Any, r: Any, monitor: Any, *, tol: float = 1.0) -> None: ...

    for function in (few, without, text, taken):
        with pytest.raises(TypeError, match=function.__name__):
            fclib.solver("t-wrong")(function)
    with pytest.raises(fclib.OptionError, match="auto"):
        fclib.solver("auto")(liar)


def test_a_solver_sees_the_reduced_problem_and_the_guess() -> None:
    told: dict[str, Any] = {}

    @fclib.solver("t-sees", rolling_dimensions=(3, 5))
    def sees(problem: fclib.LocalProblem, r: Any, monitor: fclib.Monitor) -> None:
        told.update(problem=problem, r=r.copy(), error=monitor.error(r), monitor=monitor)
        told.update(scale=monitor.scale)
        r[:] = 0
        monitor.status = "stalled"

    for case in (planted_local(1, nc=3), planted_global(2, d=2, nc=3, p=2)):
        result = fclib.solve(case.problem, "t-sees", tol=1e-5, guess=case.solution)
        reduced = case.problem
        if isinstance(reduced, fclib.GlobalProblem):
            reduced = reduced.condense()
        assert isinstance(reduced, fclib.LocalProblem)
        q = reduced.q
        reduced = reduced.eliminate() if reduced.p else reduced
        seen_problem = told["problem"]
        np.testing.assert_allclose(
            seen_problem.W.toarray(), reduced.with_storage("dense").W, atol=1e-12
        )
        np.testing.assert_allclose(seen_problem.q, reduced.q, atol=1e-12)
        np.testing.assert_array_equal(told["r"], case.solution.r)
        assert told["error"] < 1e-10
        assert told["scale"] == pytest.approx(float(np.linalg.norm(q)))
        # what it leaves is worse than the guess
        assert result.status == "converged"
        np.testing.assert_array_equal(result.solution.r, case.solution.r)
    with pytest.raises(RuntimeError, match="over"):
        told["monitor"].error(told["r"])
    rolling = fclib.LocalRollingProblem(
        spacedim=5, W=np.eye(5), q=[-1.0, 0, 0, 0, 0], mu=[0.5], mu_r=[0.1]
    )
    fclib.solve(rolling, "t-sees")
    assert isinstance(told["problem"], fclib.LocalRollingProblem)
    np.testing.assert_array_equal(told["problem"].mu_r, [0.1])


def test_large_problems_are_given_sparse() -> None:
    blocks = np.arange(1.0, 3 * 200 + 1)
    problem = fclib.LocalProblem(
        W=np.diag(blocks), q=np.tile([-1.0, 0.1, 0], 200), mu=np.full(200, 0.5)
    )
    nnz: list[int] = []

    @fclib.solver("t-sparse")
    def sparse(problem: fclib.LocalProblem, r: Any, monitor: fclib.Monitor) -> Any:
        W: Any = problem.W
        nnz.append(W.nnz)
        np.testing.assert_array_equal(W.diagonal(), blocks)
        return -problem.q / blocks

    assert fclib.solve(problem, "t-sparse").converged
    assert nnz == [3 * 3 * 200]


def test_own_solvers_are_listed_found_and_benched() -> None:
    names = [entry.name for entry in fclib.solvers()]
    assert "t-liar" in names
    assert names == sorted(names)
    assert fclib.find_solver("t-liar").title == "says it is done"
    run = bench.run("planted", problem_of(), "t-liar")
    assert (run.solver, run.status) == ("t-liar", "inaccurate")
    with pytest.raises(fclib.OptionError, match=r"unknown; the nearest are .*t-liar"):
        fclib.find_solver("t-lair")


# ---- history


@pytest.mark.parametrize("solver", ["nsgs", "auto", "t-slow"])
def test_the_history_is_what_a_callback_is_told(solver: str) -> None:
    told: list[tuple[int, float, str]] = []

    def callback(iteration: int, error: float, seconds: float, stage: str) -> None:
        told.append((iteration, error, stage))

    result = fclib.solve(problem_of(10), solver, callback=callback, history=True, max_iterations=30)
    history: Any = result.history
    assert history.dtype.names == ("iteration", "error", "time", "stage")
    rows = [(int(h["iteration"]), float(h["error"]), str(h["stage"])) for h in history]
    # if the merit of the result differs from the last report, it comes last
    assert rows[: len(told)] == told
    ends = (result.iterations, result.error, told[-1][2])
    assert rows[len(told) :] == ([ends] if told[-1][1] != result.error else [])
    assert (np.diff(history["time"]) >= 0).all()
    assert fclib.solve(problem_of(), solver, max_iterations=1).history is None


# ---- installed packages


def test_entry_points_are_found(tmp_path: Path) -> None:
    """A package that is installed in a folder of its own."""
    (tmp_path / "a_contact_package.py").write_text(
        textwrap.dedent(
            """
            import fclib

            @fclib.solver("packaged")
            def packaged(problem, r, monitor):
                '''Comes with a package.'''
                r[:] = -problem.q
            """
        )
    )
    for name, text in {
        "a_contact_package": "[fclib.solvers]\npackaged = a_contact_package:packaged\n",
        "a_broken_package": "[fclib.solvers]\nbroken = no_such_module\n",
    }.items():
        info = tmp_path / f"{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(text)
    script = textwrap.dedent(
        """
        import numpy as np, fclib
        problem = fclib.LocalProblem(W=np.eye(3), q=[-1, 0, 0], mu=[0.5])
        print(fclib.solve(problem, "packaged").status)
        entry = {s.name: s for s in fclib.solvers()}["packaged"]
        print(entry.origin, entry.title)
        """
    )
    run = ran(sys.executable, "-c", script, env=os.environ | {"PYTHONPATH": str(tmp_path)})
    assert run.stdout.splitlines() == ["converged", "a_contact_package Comes with a package."]
    assert "broken" in run.stderr  # is said, and stops nothing


# ---- the documentation


def test_the_documented_solver_is_the_example_and_runs(root: Path, tmp_path: Path) -> None:
    example = root / "examples" / "python" / "own_solver.py"
    text = (root / DOCS).read_text()
    (code,) = (part.partition("```")[0] for part in text.split("```python\n")[1:2])
    assert code in example.read_text()
    path = tmp_path / "problem.hdf5"
    fclib.write(path, problem_of())
    run = ran(sys.executable, example, path)
    assert "Result my-pgs: converged" in run.stdout
    assert "Result auto: converged" in run.stdout


# ---- programs


def program(tmp_path: Path, body: str) -> str:
    """The name of a solver that is a script."""
    script = tmp_path / "program.py"
    header = "import os, sys, time\nimport numpy as np\nimport fclib\n"
    script.write_text(header + textwrap.dedent(body))
    return f"cmd:{sys.executable} {script} {{input}} {{output}}"


def test_a_program_solves(tmp_path: Path) -> None:
    solver = program(
        tmp_path,
        """
        problem = fclib.read(sys.argv[1])
        assert problem.p == 0
        guesses = fclib.read_guesses(sys.argv[1])
        result = fclib.solve(problem, tol=1e-10, guess=guesses[0] if guesses else None)
        fclib.write(sys.argv[2], problem, result.solution)
        """,
    )
    for case in (planted_local(1, nc=3), planted_global(2, d=2, nc=3, p=2)):
        result = converged(case.problem, solver, tol=1e-8, history=True)
        assert result.solver == solver
        assert result.error <= 1e-8
        assert result.cpu_s > 0.01
        assert result.history is not None
    guess = fclib.Solution(r=exact() + 1e-3)
    assert fclib.solve(problem_of(), solver, guess=guess).converged


def test_a_program_may_write_into_its_input(tmp_path: Path) -> None:
    script = tmp_path / "program.py"
    script.write_text(
        "import sys, fclib\n"
        "problem = fclib.read(sys.argv[1])\n"
        "result = fclib.solve(problem, tol=float(sys.argv[2]))\n"
        "fclib.write_solution(sys.argv[1], result.solution)\n"
    )
    solver = f"cmd:{sys.executable} '{script}' {{input}} {{tol}}"
    assert fclib.solve(problem_of(), solver, 1e-6).converged
    path = tmp_path / "problem.hdf5"
    fclib.write(path, problem_of())
    done = run("solve", "--solver", solver, path)
    assert "converged" in done.stdout


def is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    return state != "Z"


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs Linux")
@pytest.mark.parametrize("ends", [False, True], ids=["at the limit", "before"])
def test_what_a_program_starts_in_a_session_of_its_own_is_killed(
    tmp_path: Path, ends: bool
) -> None:
    own = tmp_path / "own"
    program = tmp_path / "program.sh"
    last = "exit 1" if ends else "sleep 600"
    program.write_text(
        f"setsid sh -c 'echo $$ > {own}; sleep 600' </dev/null >/dev/null 2>&1 &\n"
        f"while ! [ -s {own} ]; do sleep 0.01; done\n{last}\n"
    )
    words = f"cmd:sh {program} {{input}} {{output}}"
    if ends:
        with pytest.raises(fclib.SolverError, match="exit status 1"):
            fclib.solve(problem_of(), words)
    else:
        assert fclib.solve(problem_of(), words, time_limit=2).status == "time_limit"
    pid = int(own.read_text())
    end = time.monotonic() + 30
    while Path(f"/proc/{pid}").exists() and processes.state(pid) not in ("", "Z"):
        assert time.monotonic() < end, "it goes on"
        time.sleep(0.01)


def test_a_program_that_takes_too_long_is_killed_with_its_children(tmp_path: Path) -> None:
    # a shell, which starts and says who its child is long before the limit
    script = tmp_path / "slow.sh"
    script.write_text(f"sleep 1000 &\necho $! > '{tmp_path / 'pid'}'\nsleep 1000\n")
    start = time.monotonic()
    result = fclib.solve(problem_of(), f"cmd:sh '{script}' {{input}}", time_limit=2)
    assert time.monotonic() - start < 500
    assert result.status == "time_limit"
    assert not result.solution.r.any()
    pid = int((tmp_path / "pid").read_text())
    end = time.monotonic() + 60
    while is_running(pid) and time.monotonic() < end:
        time.sleep(0.01)
    assert not is_running(pid)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("sys.exit('it is too hard')", "exit status 1: it is too hard"),
        ("sys.exit(3)", "exit status 3"),
        ("os.abort()", "signal 6"),
        ("", "made no output"),
        ("open(sys.argv[2], 'w').write('garbage')", "its output"),
        ("fclib.write(sys.argv[2], fclib.read(sys.argv[1]))", "wrote no /solution"),
        (
            """
            problem = fclib.LocalProblem(W=np.eye(3), q=[-1, 0, 0], mu=[0.5])
            fclib.write(sys.argv[2], problem, fclib.Solution(r=np.zeros(3)))
            """,
            "length 3, expected 12",
        ),
    ],
    ids=["fails", "status", "crashes", "nothing", "garbage", "no solution", "another size"],
)
def test_a_program_that_fails_is_said(tmp_path: Path, body: str, said: str) -> None:
    with pytest.raises(fclib.SolverError, match=said):
        fclib.solve(problem_of(), program(tmp_path, body), time_limit=20)


WRITE = """
problem = fclib.read(sys.argv[1])
fclib.write(sys.argv[2], problem, fclib.Solution(r=np.zeros(problem.m)))
"""


def test_a_program_that_lies_is_found_out(tmp_path: Path) -> None:
    result = fclib.solve(problem_of(), program(tmp_path, WRITE), time_limit=20)
    assert result.status == "inaccurate"


@pytest.mark.parametrize("said", ["iterations=-3", "cpu_s=np.inf", "cpu_s=np.nan"])
def test_a_program_cannot_claim_what_is_no_work(tmp_path: Path, said: str) -> None:
    pytest.importorskip("h5py")
    claim = f"h5py.File(sys.argv[2], 'a')['solution'].attrs.update({said})\n"
    body = "import h5py\n" + WRITE + claim
    with pytest.raises(fclib.SolverError, match=f"{said.partition('=')[0]} = .*no number"):
        fclib.solve(problem_of(), program(tmp_path, body), time_limit=20)


def test_a_program_that_writes_nan_has_diverged(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    assert h5py
    body = "import h5py\n" + WRITE + "h5py.File(sys.argv[2], 'a')['solution/r'][0] = np.nan\n"
    result = fclib.solve(problem_of(), program(tmp_path, body), time_limit=20)
    assert result.status == "diverged"


@pytest.mark.parametrize(
    "name", ["cmd:", "cmd:true", "cmd:no-such-program {input}", "cmd:'{input}"]
)
def test_commands_that_cannot_be_run_are_refused(name: str) -> None:
    with pytest.raises(fclib.OptionError, match="cmd:"):
        fclib.find_solver(name)


def test_ctrl_c_ends_a_program_too(tmp_path: Path) -> None:
    def interrupt() -> None:
        time.sleep(0.5)
        signal.raise_signal(signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        command.run(["sleep", "30"], 30.0)
    thread.join()


@pytest.mark.parametrize("d", [2, 3])
def test_the_program_in_c(root: Path, tmp_path: Path, d: int) -> None:
    solver = compile_program(root / "examples" / "c" / "pgs.c", tmp_path / "pgs", "-lm")
    for case in (planted_local(3, d=d, nc=5), planted_global(4, d=d, nc=3, p=2)):
        name = f"cmd:{solver} {{input}} {{tol}}"
        result = converged(case.problem, name, 1e-8, time_limit=20)
        converged(case.problem, name, 1e-8, guess=fclib.Solution(r=result.solution.r))


# ---- other packages


RELAXED = {entry.name for entry in external.solvers() if "relaxation" in entry.title}
# Siconos' own ways: these need far more iterations than the others, or lose digits, or fail
UNRELIABLE = {"siconos:nsgs-quartic", "siconos:hp", "siconos:dsfp", "siconos:eg", "siconos:fp"}


def of_each(chosen: Callable[[Any], bool]) -> list[Any]:
    """The names of the solvers that are installed and chosen."""
    names = [entry.name for entry in external.solvers() if chosen(entry)]
    reason = "no such solver of another package is installed"
    return names or [pytest.param("", marks=pytest.mark.skip(reason=reason))]


@pytest.mark.parametrize("name", of_each(lambda entry: True))
def test_external_solvers_solve_what_is_easy(name: str) -> None:
    entry = fclib.find_solver(name)
    for d in entry.dimensions:
        W = np.eye(d)
        for q in ([-1, 0.2, 0], [1, 2, 0]):  # sticks, leaves
            result = fclib.solve(local_problem(W, q[:d], [0.5]), name, 1e-6, time_limit=10)
            assert result.converged, (q, result)
        slides = fclib.solve(local_problem(W, [-1, 2, 0][:d], [0.5]), name, 1e-6, time_limit=2)
        if name in RELAXED:
            assert slides.status in {"inaccurate", "time_limit"}
            continue
        if name in UNRELIABLE:
            continue
        assert slides.converged
        for case in (planted_local(3, d=d, nc=10), planted_global(3, d=d, nc=5, p=2)):
            result = converged(case.problem, name, 1e-7, time_limit=20)
            assert result.error == fclib.merit(case.problem, result.solution).error
            assert result.cpu_s > 0
            guessed = fclib.solve(case.problem, name, 1e-5, guess=result.solution)
            assert (guessed.status, guessed.iterations) == ("converged", 0)


@pytest.mark.parametrize("name", of_each(lambda entry: bool(entry.rolling_dimensions)))
def test_external_solvers_solve_rolling_problems(name: str) -> None:
    entry = fclib.find_solver(name)
    for d in entry.rolling_dimensions:
        q = [-1.0, *[0.2] * (d - 1)]
        problem = fclib.LocalRollingProblem(
            spacedim=d, W=np.eye(2 * d), q=q * 2, mu=[0.8, 0.8], mu_r=[0.8, 0.8]
        )
        assert fclib.solve(problem, name, 1e-6, time_limit=10).converged


@pytest.mark.parametrize("name", of_each(lambda entry: entry.name not in RELAXED))
def test_external_solvers_are_honest_about_no_solution(name: str) -> None:
    entry = fclib.find_solver(name)
    for d in entry.dimensions:
        problem = local_problem(np.zeros((d, d)), [-1, 0.5, 0][:d], [0.5])
        try:
            result = fclib.solve(problem, name, 1e-8, max_iterations=50, time_limit=2)
        except fclib.SolverError as error:
            assert name.partition(":")[0] in str(error)  # noqa: PT017
        else:
            assert not result.converged
            assert np.isfinite(result.solution.r).all()


@pytest.mark.parametrize("package", ["clarabel", "scs"])
def test_conic_solvers_refuse_an_asymmetric_matrix(package: str) -> None:
    pytest.importorskip(package)
    with pytest.raises(fclib.UnsuitableError, match="asymmetric"):
        fclib.solve(planted_local(7, skew=1.0).problem, f"{package}:aclm")


@pytest.mark.parametrize("name", ["aclm", "relaxation"])
def test_scs_ends_quietly_on_an_indefinite_matrix(
    name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("scs")
    problem = local_problem(np.diag([1.0, -1, 2]), [-1, 0.5, 0], [0.5])
    assert fclib.solve(problem, f"scs:{name}", time_limit=10).status == "stalled"
    assert capfd.readouterr() == ("", "")


def test_what_other_threads_print_is_kept_while_scs_starts(
    capsys: pytest.CaptureFixture[str],
) -> None:
    scs = pytest.importorskip("fclib.external.scs")
    with contextlib.redirect_stdout(scs._Others(sys.stdout)):
        print("mine")
        thread = threading.Thread(target=print, args=("theirs",))
        thread.start()
        thread.join()
    assert capsys.readouterr().out == "theirs\n"


def test_what_is_absent_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FCLIB_SICONOS_PYTHON", "/nowhere/python")
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda n, *a: None if n == "scs" else find_spec(n, *a)
    )
    words = {absent.solvers: absent.missing for absent in external.absent()}
    assert "FCLIB_SICONOS_PYTHON" in words[siconos.SOLVERS]
    assert words["scs:aclm, scs:relaxation"] == "pip install scs"
    assert not any(entry.origin in ("siconos", "scs") for entry in fclib.solvers())
    with pytest.raises(fclib.OptionError, match="pip install scs"):
        fclib.find_solver("scs:aclm")


needs_siconos = pytest.mark.skipif(bool(siconos.missing()), reason=siconos.missing())


@needs_siconos
def test_the_worker_of_siconos_is_kept_and_is_killed_at_the_limit() -> None:
    def worker() -> int:
        assert siconos._worker.process is not None
        return siconos._worker.process.pid

    assert fclib.solve(problem_of(), "siconos:nsgs").converged
    first = worker()
    assert fclib.solve(problem_of(8), "siconos:nsgs").converged
    assert worker() == first
    endless = local_problem(
        np.kron([[1, -1], [-1, 1]], np.eye(3)), [-1, 0, 0, -1, 0, 0], [0.5, 0.5]
    )
    start = time.monotonic()
    result = fclib.solve(endless, "siconos:nsgs", time_limit=0.5, max_iterations=10**9)
    assert time.monotonic() - start < 300
    assert result.status == "time_limit"
    assert result.cpu_s > 0.01
    assert not is_running(first)
    assert fclib.solve(problem_of(), "siconos:nsgs").converged


@needs_siconos
def test_a_worker_that_dies_is_said_and_replaced() -> None:
    assert fclib.solve(problem_of(), "siconos:nsgs").converged
    assert siconos._worker.process is not None
    pid = siconos._worker.process.pid
    endless = local_problem(
        np.kron([[1, -1], [-1, 1]], np.eye(3)), [-1, 0, 0, -1, 0, 0], [0.5, 0.5]
    )
    timer = threading.Timer(0.3, os.kill, (pid, signal.SIGKILL))
    timer.start()
    with pytest.raises(fclib.SolverError, match="signal 9"):
        fclib.solve(endless, "siconos:nsgs", time_limit=10)
    assert fclib.solve(problem_of(), "siconos:nsgs").converged


@needs_siconos
def test_short_solves_of_siconos_are_timed_under_a_limit_of_cpu_time() -> None:
    """Under such a limit, as in a campaign, the clock of a process stands still between ticks."""
    assert fclib.solve(problem_of(), "siconos:nsgs").converged
    assert siconos._worker.process is not None
    resource.prlimit(siconos._worker.process.pid, resource.RLIMIT_CPU, (1000, 1000))
    for _ in range(20):
        assert 0 < fclib.solve(problem_of(), "siconos:nsgs").cpu_s < 0.1


@needs_siconos
def test_a_solve_of_siconos_is_timed_by_its_least_call() -> None:
    one = fclib.solve(problem_of(), "siconos:nsgs")
    many = fclib.solve(problem_of(), "siconos:nsgs", calls=20)
    assert many.iterations == one.iterations
    assert np.array_equal(many.solution.r, one.solution.r)
    assert many.cpu_s > 0
    with pytest.raises(fclib.OptionError, match="calls"):
        fclib.solve(problem_of(), "siconos:nsgs", calls=0)


@needs_siconos
def test_unknown_solvers_of_siconos_come_with_the_known_ones() -> None:
    with pytest.raises(fclib.OptionError, match="siconos:nsgs"):
        fclib.find_solver("siconos:magic")


# ---- shared objects


# r becomes what the options are, which is told by the merit alone
TELLS_OF_ITS_OPTIONS = """
#include <fclib_plugin.h>
#include <math.h>
#include <string.h>
static const char* const shapes[] = {"disc", "square", 0};
static const struct fclib_plugin_option options[] = {
    {"count", "int", "2", "1", "how many", 0, 1, 9},
    {"shape", "choice", "disc", "", "of what", shapes, 0, 0},
    {"loud", "bool", "false", "", "", 0, 0, 0},
    {"note", "text", "", "", "", 0, 0, 0},
    {0, 0, 0, 0, 0, 0, 0, 0}};
static const struct fclib_plugin_about about = {sizeof about, 0, "Tells", "nobody", options};
const struct fclib_plugin_about* fclib_plugin_describe(void) { return &about; }
int fclib_plugin_solve(const struct fclib_plugin_problem* p, double* r) {
  r[0] = p->number(p->context, "count");
  r[1] = p->number(p->context, "shape") + 10 * p->number(p->context, "loud");
  r[2] = (double)strlen(p->text(p->context, "note"));
  if (strcmp(p->text(p->context, "shape"), shapes[(int)p->number(p->context, "shape")])) return 1;
  if (!isnan(p->number(p->context, "none")) || p->text(p->context, "none")) return 2;
  if (!isnan(p->number(p->context, "note")) || p->text(p->context, "count")) return 3;
  return 0;
}
"""


@pytest.fixture(scope="module")
def shared_objects(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Plugins: the example, as C++ too, one that refuses, one cut short, and others."""
    folder = tmp_path_factory.mktemp("plugins")
    (folder / "pgs.cpp").write_text((ROOT / "examples/plugin/pgs.c").read_text())
    (folder / "refuse.c").write_text(
        "#include <fclib_plugin.h>\nint fclib_plugin_solve(const struct fclib_plugin_problem *p, "
        "double *r) {\n  (void)p, (void)r;\n  return 7;\n}\n"
    )
    (folder / "other.c").write_text("int other(void) { return 0; }\n")
    (folder / "told.c").write_text(TELLS_OF_ITS_OPTIONS)
    (folder / "wrong.c").write_text(TELLS_OF_ITS_OPTIONS.replace('"2"', '"two"'))
    (folder / "unsized.c").write_text(TELLS_OF_ITS_OPTIONS.replace("sizeof about", "0"))
    solve = 'extern "C" int fclib_plugin_solve(const fclib_plugin_problem* p, double* r)'
    for name, body in {
        "throws": 'throw std::runtime_error("no idea");',
        "throws-seven": "throw 7;",
        "null": "return p->stop(p->context, nullptr);",
    }.items():
        (folder / f"{name}.cpp").write_text(
            "#include <fclib_plugin.h>\n#include <stdexcept>\n"
            f"{solve} {{ (void)p, (void)r; {body} }}\n"
        )
    (folder / "told-nothing.cpp").write_text(
        f"#include <fclib_plugin.h>\n{solve} {{ (void)p, (void)r; return 0; }}\n"
        'extern "C" const fclib_plugin_about* fclib_plugin_describe() { throw 7; }\n'
    )
    for name, body in {
        "raises": 'throw std::runtime_error("no licence");',
        "leaves": "std::exit(0);",
        "aborts": 'std::fputs("no licence", stderr); std::abort();',
    }.items():
        (folder / f"{name}.cpp").write_text(
            "#include <fclib_plugin.h>\n#include <cstdio>\n#include <cstdlib>\n"
            "#include <stdexcept>\n"
            f"struct Global {{ Global() {{ {body} }} }};\nstatic Global made;\n"
            f"{solve} {{ (void)p, (void)r; return 0; }}\n"
        )
    (folder / "upwards.cpp").write_text(
        f"#include <fclib_plugin.h>\n#include <cfenv>\n{solve} {{\n"
        "  std::fesetround(FE_UPWARD);\n  r[0] = 1 + 1e-8;\n"
        "  p->stop(p->context, r);\n  return 0;\n}\n"
    )
    (folder / "latin.c").write_text(TELLS_OF_ITS_OPTIONS.replace('"Tells"', r'"Tells \xe9"'))
    thrown = (
        "throws",
        "throws-seven",
        "null",
        "told-nothing",
        "upwards",
        "raises",
        "leaves",
        "aborts",
    )
    sources = {name: folder / f"{name}.cpp" for name in thrown} | {
        "pgs": ROOT / "examples/plugin/pgs.c",
        "pgs-cpp": folder / "pgs.cpp",
        "refuse": folder / "refuse.c",
        "other": folder / "other.c",
        "told": folder / "told.c",
        "wrong": folder / "wrong.c",
        "unsized": folder / "unsized.c",
        "latin": folder / "latin.c",
    }
    for name, source in sources.items():
        tool = compiler("C++" if source.suffix == ".cpp" else "C")
        options = ["-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", f"-I{HEADERS}"]
        target = folder / f"lib{name}.so"
        subprocess.run([tool, *options, str(source), "-o", str(target), "-lm"], check=True)
    (folder / "libcut.so").write_bytes((folder / "libpgs.so").read_bytes()[:9000])
    return folder


@pytest.mark.parametrize("name", ["pgs", "pgs-cpp"])
def test_a_shared_object_solves(shared_objects: Path, name: str) -> None:
    for d in (2, 3):
        problem = planted_local(3, d=d, nc=5).problem
        seen: list[float] = []

        def hear(iteration: int, error: float, seconds: float, stage: str, to: Any = seen) -> None:
            to.append(error)

        result = converged(problem, f"plugin:{shared_objects}/lib{name}.so", callback=hear)
        assert fclib.merit(problem, result.solution).error <= 1e-8
        assert len(seen) == result.iterations + 1 > 1
    limited = fclib.solve(problem, f"plugin:{shared_objects}/lib{name}.so", tol=0, max_iterations=3)
    assert (limited.status, limited.iterations) == ("iteration_limit", 3)


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("raises", "loading it raises: no licence"),
        ("leaves", "ends the process that loads it .exit status 0"),
        ("aborts", "ends the process that loads it .SIGABRT.: no licence"),
        ("other", "has no function fclib_plugin_solve"),
    ],
)
def test_a_campaign_outlives_a_shared_object(shared_objects: Path, name: str, fault: str) -> None:
    """Code that runs when it is loaded may end the process."""
    plugin = f"plugin:{shared_objects}/lib{name}.so"
    plan = {"solvers": ["nsgs", plugin], "problems": [{"planted": {"count": 1, "contacts": 1}}]}
    with pytest.raises(bench.CampaignError, match=rf"lib{name}.so': {fault}"):
        bench.Campaign.of(plan)
    left = bench.Campaign.of({**plan, "solvers": ["nsgs", {"name": plugin, "optional": True}]})
    assert [solver.name for solver in left.solvers] == ["nsgs"]


def test_another_shared_object_is_another_version(shared_objects: Path, tmp_path: Path) -> None:
    """So that a campaign runs it again."""
    own = tmp_path / "libown.so"
    versions = []
    for source in ("libpgs.so", "libpgs.so", "libtold.so"):
        own.unlink(missing_ok=True)
        shutil.copy(shared_objects / source, own)
        versions.append(version_of(fclib.find_solver(f"plugin:{own}")))
    assert versions[0] == versions[1] != versions[2]
    assert all(versions)


def test_solvers_of_packages_have_the_versions_of_these() -> None:
    found = [solver for solver in external.solvers() if solver.origin != "fclib"]
    if not found:
        pytest.skip("there is no solver of another package")
    for solver in found:
        assert re.fullmatch(r"\d+(\.\d+)+\S*", version_of(solver)), solver


def test_a_shared_object_has_options(shared_objects: Path) -> None:
    name = f"plugin:{shared_objects}/libtold.so"
    info = fclib.find_solver(name)
    assert (info.title, info.citation, info.origin) == ("Tells", "nobody", "plugin")
    assert [(o.name, o.type, o.default) for o in info.options] == [
        ("count", "int", 2),
        ("shape", "choice", "disc"),
        ("loud", "bool", False),
        ("note", "text", ""),
    ]
    # whatever it returns is better than no reactions
    problem = fclib.LocalProblem(W=np.eye(3), q=[-100, 0, 0], mu=[0.5])

    def told(**options: Any) -> list[float]:
        return list(fclib.solve(problem, name, **options).solution.r)

    assert told() == [2, 0, 0]
    assert told(count=9, shape="square", loud=True, note="four") == [9, 11, 4]
    with pytest.raises(fclib.OptionError, match=r"10 is outside \[1, 9\]"):
        told(count=10)
    with pytest.raises(fclib.OptionError, match="unknown; this solver has: count, shape, loud, n"):
        told(size=1)
    with pytest.raises(fclib.UnsuitableError, match="does not take R2DFC"):
        fclib.solve(planted_rolling(3, 1)[0], name)
    assert fclib.find_solver(name) is fclib.find_solver(name)


@pytest.mark.parametrize("d", [3, 5])
def test_a_shared_object_solves_rolling_problems(shared_objects: Path, d: int) -> None:
    problem, _ = planted_rolling(d, 3, nc=4)
    name = f"plugin:{shared_objects}/libpgs.so"
    result = converged(problem, name, step=0.4)
    assert fclib.merit(problem, result.solution).error <= 1e-8
    assert fclib.solve(problem, name, step=0.2).iterations > result.iterations


def test_shared_objects_from_c(shared_objects: Path, tmp_path: Path) -> None:
    fclib.write(tmp_path / "a.hdf5", planted_local(3, nc=3).problem)
    program = compile_program(ROOT / "tests/capi/plugin.c", tmp_path / "plugin")
    done = ran(program, tmp_path / "a.hdf5", f"plugin:{shared_objects}/libpgs.so", timeout=60)
    assert done.stderr == ""


def test_shared_objects_that_are_wrong(shared_objects: Path) -> None:
    problem = planted_local(3, nc=2).problem
    for name, error in {
        "libnone.so": "no such file",
        "pgs.cpp": "cannot be loaded",
        "libcut.so": "the file is cut short",
        "libother.so": "has no function fclib_plugin_solve",
        "libwrong.so": "its default is wrong: option count: 'two' is not an integer",
        "libunsized.so": "fclib_plugin_describe returned no struct fclib_plugin_about with",
        "liblatin.so": "its title is not UTF-8",
    }.items():
        with pytest.raises(fclib.OptionError, match=error):
            fclib.solve(problem, f"plugin:{shared_objects}/{name}")
    with pytest.raises(fclib.SolverError, match="returned 7"):
        fclib.solve(problem, f"plugin:{shared_objects}/librefuse.so")

    def stop(*_: object) -> bool:
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        fclib.solve(problem, f"plugin:{shared_objects}/libpgs.so", callback=stop)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("throws", "libthrows.so: fclib_plugin_solve threw: no idea"),
        ("throws-seven", "fclib_plugin_solve threw: something that is no exception"),
        ("null", "no iterate"),
    ],
)
def test_what_a_shared_object_throws_is_said(shared_objects: Path, name: str, said: str) -> None:
    with pytest.raises(fclib.SolverError, match=said):
        fclib.solve(problem_of(), f"plugin:{shared_objects}/lib{name}.so")


def test_a_shared_object_whose_description_throws(shared_objects: Path) -> None:
    with pytest.raises(fclib.OptionError, match="fclib_plugin_describe threw"):
        fclib.find_solver(f"plugin:{shared_objects}/libtold-nothing.so")


def test_a_shared_object_leaves_the_arithmetic_as_it_was(shared_objects: Path) -> None:
    """Neither the judge of its iterates nor the caller rounds as it does."""
    name = f"plugin:{shared_objects}/libupwards.so"
    problem = fclib.LocalProblem(spacedim=2, W=np.eye(2), q=[-1, 0], mu=[0.5])
    mode = ctypes.CDLL(None).fegetround
    before = mode()
    heard = []

    def hear(_iteration: int, error: float, *_: object) -> None:
        heard.append((mode(), error))

    result = fclib.solve(problem, name, 1e-10, callback=hear)
    assert not result.converged
    assert {round_to for round_to, _ in heard} == {mode()} == {before}
    assert heard[0][1] == pytest.approx(1e-8)


def test_a_campaign_runs_a_shared_object(shared_objects: Path, tmp_path: Path) -> None:
    fclib.write(tmp_path / "a.hdf5", planted_local(3, nc=3).problem)
    words = ("-m", "fclib", "bench", "--problems", "a.hdf5", "--store", "store.db", "--solver")
    ran(sys.executable, *words, f"plugin:{shared_objects}/libpgs.so step=0.9", cwd=tmp_path)
    with sqlite3.connect(tmp_path / "store.db") as store:
        assert store.execute("select status from runs").fetchall() == [("converged",)]
