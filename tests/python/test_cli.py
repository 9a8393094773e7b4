"""The commands: what they print, what they write, and their exit status."""

import io
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from rich.console import Console
from typer.testing import CliRunner

import fclib
from ball_judge import judge
from fclib import cli
from fclib.cli._output import Rows
from helpers import dense, planted_global, planted_local, ran
from helpers_cli import run

SOLVE_KEYS = [
    "problem",
    "formulation",
    "n",
    "nc",
    "solver",
    "status",
    "iterations",
    "cpu_s",
    "error",
    "natural",
    "scaled_natural",
    "stages",
]


def start(
    *arguments: object, module: bool = True, env: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """A command as a shell starts it."""
    script = Path(sys.executable).with_name("fclib")
    program = [sys.executable, "-m", "fclib"] if module else [str(script)]
    command = [*program, *map(str, arguments)]
    return ran(*command, code=None, env=env)


def records(result: subprocess.CompletedProcess[str]) -> list[dict[str, Any]]:
    return [json.loads(line) for line in result.stdout.splitlines()]


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """Four good files of all formulations, with their exact solutions."""
    cases = {
        "local": planted_local(1, nc=5),
        "mixed": planted_local(2, d=2, nc=4, p=2),
        "global": planted_global(3, nc=3),
        "global-mixed": planted_global(4, nc=3, p=2),
    }
    paths = []
    for name, case in cases.items():
        paths.append(tmp_path / f"{name}.hdf5")
        fclib.write(paths[-1], case.problem, case.solution)
    return paths


@pytest.fixture
def bad(tmp_path: Path) -> Path:
    path = tmp_path / "bad.hdf5"
    path.write_text("no problem")
    return path


# ---- info


def test_info_prints_the_sizes(files: list[Path]) -> None:
    result = run("info", "--json", *files)
    assert result.stderr == ""
    for record, path in zip(records(result), files, strict=True):
        problem = fclib.read(path)
        assert record["problem"] == str(path)
        assert record["solution"] is True
        for name in ("formulation", "spacedim", "n", "m", "p", "nc"):
            assert record[name] == getattr(problem, name), name
        assert record["mu_min"] == problem.mu.min()
        assert record["mu_max"] == problem.mu.max()


def test_info_as_a_table_names_every_file_on_one_line(files: list[Path]) -> None:
    result = run("info", *files)
    lines = result.stdout.splitlines()
    for path, formulation in zip(files, ["3DFC", "M2DFC", "G3DFC", "GM3DFC"], strict=True):
        assert sum(path.name in line.split() and formulation in line.split() for line in lines) == 1


@pytest.fixture
def both(tmp_path: Path) -> Path:
    """A file of two problems, with a solution and two guesses of the global one."""
    path = tmp_path / "both.hdf5"
    local, whole = planted_local(1), planted_global(1)
    fclib.write(path, local.problem)
    fclib.write(path, whole.problem, whole.solution, [whole.solution] * 2, mode="add")
    return path


def test_info_shows_each_problem_of_a_file(both: Path) -> None:
    result = run("info", "--json", both)
    whole, local = records(result)
    assert (whole["formulation"], whole["solution"], whole["guesses"]) == ("G3DFC", True, 2)
    assert (local["formulation"], local["solution"], local["guesses"]) == ("3DFC", False, 0)


def test_info_counts_the_known_solutions(both: Path) -> None:
    assert [row["solutions"] for row in records(run("info", "--json", both))] == [0, 0]
    fclib.write_solutions(both, [planted_global(1).solution] * 3)
    assert [row["solutions"] for row in records(run("info", "--json", both))] == [3, 0]
    assert fclib.contents(both) == ["global", "local", "solution", "guesses", "solutions"]


def test_info_shows_what_is_known_of_a_matrix(tmp_path: Path) -> None:
    path, problem = tmp_path / "known.hdf5", planted_local(1).problem
    fclib.write(path, problem)
    assert "matrix_info" not in run("info", path).stdout
    known = fclib.MatrixInfo(comment="of [full] rank", conditioning=np.inf, rank=18)
    fclib.write(path, problem.replace(matrix_info={"W": known}))
    (record,) = records(run("info", "--json", path))
    assert record["matrix_info"] == {
        "W": {"comment": "of [full] rank", "conditioning": None, "determinant": 0, "rank": 18}
    }
    assert "W: comment of [full] rank, conditioning inf, rank 18" in run("info", path).stdout


def test_solve_and_check_take_the_problem_that_a_solution_belongs_to(both: Path) -> None:
    (record,) = records(run("check", "--json", both))
    assert (record["formulation"], record["status"]) == ("G3DFC", "ok")
    (record,) = records(run("solve", "--json", "--write", both))
    assert (record["formulation"], record["status"]) == ("G3DFC", "converged")
    run("check", both)
    assert fclib.contents(both) == ["global", "local", "solution", "guesses"]


def test_solve_takes_the_problem_that_is_asked_for(both: Path) -> None:
    for kind, formulation in (("local", "3DFC"), ("global", "G3DFC")):
        (record,) = records(run("solve", "--kind", kind, both, "--json"))
        assert record["formulation"] == formulation
    missing = run("solve", "--kind", "global_rolling", both, code=1)
    assert missing.stderr.count("\n") == 1
    run("solve", "--kind", "local", "--write", both, code=2)


def test_info_of_a_problem_without_contacts_is_json(tmp_path: Path) -> None:
    path = tmp_path / "empty.hdf5"
    fclib.write(path, planted_global(1, nc=0).problem)
    (record,) = records(run("info", "--json", path))
    assert record["nc"] == 0
    assert record["mu_min"] is None
    run("info", path)


# ---- solve


def test_solve_prints_exactly_the_agreed_keys(files: list[Path]) -> None:
    result = run("solve", "--json", *files)
    assert result.stderr == ""
    found = records(result)
    assert [record["problem"] for record in found] == [str(path) for path in files]
    for record, path in zip(found, files, strict=True):
        assert list(record) == SOLVE_KEYS
        problem = fclib.read(path)
        for name in ("formulation", "n", "nc"):
            assert record[name] == getattr(problem, name)
        assert record["solver"] == "auto"
        assert record["status"] == "converged"
        assert record["error"] <= 1e-8
        assert record["cpu_s"] >= 0
        assert isinstance(record["iterations"], int)


def test_solve_keeps_its_tolerance_and_its_options(files: list[Path]) -> None:
    options = ["--option", "relaxation=1.2", "--option", "shuffle=once", "--tol", "1e-4"]
    result = run("solve", "--json", "--solver", "nsgs", *options, *files)
    tight = records(run("solve", "--json", "--tol", "1e-12", *files))
    for record, other in zip(records(result), tight, strict=True):
        assert record["solver"] == "nsgs relaxation=1.2 shuffle=once"
        assert other["error"] <= 1e-12 < record["error"] <= 1e-4


def test_solve_writes_what_it_found(files: list[Path]) -> None:
    for path in files:
        problem = fclib.read(path)
        nothing = fclib.Solution(
            r=np.zeros(problem.m), l=np.zeros(problem.p) if problem.p else None
        )
        fclib.write(path, problem, nothing)
    run("check", *files, code=1)
    run("solve", *files)
    run("check", *files, code=1)
    run("solve", "--write", *files)
    run("check", *files)
    for path in files:
        solution = fclib.read_solution(path)
        assert solution is not None
        assert judge(fclib.read(path), solution).error <= 1e-8


def endless(path: Path) -> Path:
    W = np.kron([[1, -1], [-1, 1]], np.eye(3))
    fclib.write(path, fclib.LocalProblem(W=W, q=[-1, 0, 0] * 2, mu=[0.5] * 2))
    return path


def test_what_is_not_solved_fails_and_is_not_written(tmp_path: Path, files: list[Path]) -> None:
    path = endless(tmp_path / "endless.hdf5")
    result = run("solve", "--write", "--json", "--time-limit", "2", path, *files, code=1)
    found = records(result)
    assert found[0]["status"] == "infeasible"
    assert found[0]["error"] > 0.1
    assert [record["status"] for record in found[1:]] == ["converged"] * len(files)
    assert fclib.read_solution(path) is None


# ---- check


def test_check_judges_stored_solutions(files: list[Path]) -> None:
    result = run("check", "--json", *files)
    for record, path in zip(records(result), files, strict=True):
        solution = fclib.read_solution(path)
        assert solution is not None
        merit = fclib.merit(fclib.read(path), solution)
        assert record["error"] == merit.error < 1e-13
        for name in ("natural", "dynamics", "bilateral", "cone", "open", "stick", "slide"):
            assert record[name] == getattr(merit, name), name


def test_check_finds_the_wrong_one(files: list[Path]) -> None:
    solution = fclib.read_solution(files[0])
    assert solution is not None
    fclib.write_solution(files[0], fclib.Solution(r=solution.r + 1e-5))
    result = run("check", "--json", *files, code=1)
    assert [record["error"] <= 1e-8 for record in records(result)] == [False, True, True, True]
    run("check", "--tol", "1e-3", *files)


def test_check_prints_its_tolerance(files: list[Path]) -> None:
    assert "the tolerance is 1e-08 (--tol)" in run("check", files[0]).stdout
    assert "the tolerance is 0.001 (--tol)" in run("check", files[0], "--tol", "1e-3").stdout
    assert "tolerance" not in run("check", files[0], "--json").stdout


def test_solve_takes_a_solver_with_its_options(files: list[Path]) -> None:
    (said,) = records(run("solve", "--json", "--solver", "nsgs relaxation=1.2", files[0]))
    assert said["solver"] == "nsgs relaxation=1.2"
    both = ("--solver", "nsgs relaxation=1.2", "--option", "relaxation=0.9")
    (said,) = records(run("solve", "--json", *both, files[0]))
    assert said["solver"] == "nsgs relaxation=0.9"
    for text, word in (
        ("nsgss", "the nearest are nsgs, "),
        ("nsgs relaxation", "not of the form name=value"),
        ("nsgs relaxatio=1", "relaxatio"),
        ("", "unknown"),
    ):
        done = run("solve", "--solver", text, files[0], code=2)
        assert word in done.stderr


def test_solve_says_what_to_do_next(tmp_path: Path, files: list[Path]) -> None:
    """A line for each status, not for each file; none after success."""
    done = run("solve", "--solver", "associated", *files, code=1)
    assert done.stdout.count("inaccurate") > 1
    assert done.stderr.count("try the solver auto") == 1
    none = fclib.LocalProblem(
        spacedim=2, W=np.zeros((2, 2)), q=np.array([-1.0, 0.0]), mu=np.array([0.5])
    )
    fclib.write(tmp_path / "none.hdf5", none)
    done = run("solve", tmp_path / "none.hdf5", code=1)
    assert "infeasible: there is no solution" in done.stderr
    assert run("solve", files[0]).stderr == ""


def test_check_without_a_solution_fails(tmp_path: Path) -> None:
    path = tmp_path / "unsolved.hdf5"
    fclib.write(path, planted_local(1).problem)
    result = run("check", path, code=1)
    assert result.stderr.startswith(f"fclib: {path}: /solution")
    assert len(result.stderr.splitlines()) == 1


# ---- solvers


def test_solvers_lists_them_with_their_options() -> None:
    result = run("solvers", "--json")
    told = [record for record in records(result) if "solver" in record]
    # those that tests have registered are not there
    names = {record["solver"] for record in told}
    assert names >= {solver.name for solver in fclib.solvers() if solver.origin == "fclib"}
    for record in told:
        solver = fclib.find_solver(record["solver"])
        for name in ("origin", "family", "title", "citation", "dimensions"):
            assert record[name] == getattr(solver, name)
        assert record["solver"] == solver.name
        for shown, option in zip(record["options"], solver.options, strict=True):
            assert shown["option"] == option.name
            assert shown["default"] == option.default
            assert shown["meaning"] == option.doc
            assert shown["unit"] == option.unit
    table = run("solvers")
    for name in names:
        solver = fclib.find_solver(name)
        for text in (solver.name, solver.family, solver.title):
            assert text in table.stdout


def test_solvers_shows_one_in_full() -> None:
    names = [solver.name for solver in fclib.solvers() if solver.origin == "fclib"]
    result = run("solvers", *names)
    for name in names:
        solver = fclib.find_solver(name)
        for text in (name, solver.citation, *(option.name for option in solver.options)):
            assert text in result.stdout
    (record,) = records(run("solvers", names[0], "--json"))
    assert record["solver"] == names[0]


def test_solvers_tells_the_words_of_a_chain() -> None:
    methods = fclib.chain_methods()
    told = run("solvers", "--chain").stdout
    shown = records(run("solvers", "--chain", "--json"))
    assert [record["method"] for record in shown] == [method.name or None for method in methods]
    for method, record in zip(methods, shown, strict=True):
        for rule, described in zip(method.rules, record["rules"], strict=True):
            assert described["default"] == rule.default
            assert f"{rule.name} = " in told


def test_solvers_names_what_is_absent() -> None:
    nowhere = os.environ | {"FCLIB_SICONOS_PYTHON": "/nowhere/python"}
    table = start("solvers", env=nowhere)
    assert table.returncode == 0
    assert "Not here: siconos:" in table.stdout
    assert "FCLIB_SICONOS_PYTHON" in table.stdout


# ---- errors and usage


@pytest.mark.parametrize("command", ["info", "solve", "check"])
def test_a_bad_file_does_not_stop_the_others(command: str, files: list[Path], bad: Path) -> None:
    missing = bad.with_name("missing.hdf5")
    result = run(command, "--json", files[0], bad, files[1], missing, files[2], code=1)
    lines = result.stderr.splitlines()
    assert len(lines) == 2
    assert str(bad) in lines[0]
    assert str(missing) in lines[1]
    good = [record for record in records(result) if "formulation" in record]
    assert [record["problem"] for record in good] == [str(path) for path in files[:3]]
    told = [record for record in records(result) if "formulation" not in record]
    assert [record["problem"] for record in told] == [str(bad), str(missing)]


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["unknown"],
        ["info"],
        ["solve"],
        ["check"],
        ["info", "--unknown", "FILE"],
        ["solve", "--tol", "small", "FILE"],
        ["solve", "--tol", "-1", "FILE"],
        ["solve", "--tol", "nan", "FILE"],
        ["solve", "--time-limit", "soon", "FILE"],
        ["solve", "--time-limit", "-1", "FILE"],
        ["solve", "--solver", "unknown", "FILE"],
        ["solve", "--solver", "unknown", "MISSING"],
        ["solve", "--option", "relaxation", "FILE"],
        ["solve", "--option", "=1", "FILE"],
        ["solve", "--option", "relaxation=", "FILE"],
        ["solve", "--option", "unknown=1", "FILE"],
        ["solve", "--option", "unknown=1", "MISSING"],
        ["solve", "--option", "relaxation=fast", "FILE"],
        ["solve", "--option", "relaxation=5", "FILE"],
        ["solve", "--option", "tol=1", "FILE"],
        ["solve", "--option", "problem=1", "FILE"],
        ["solve", "--option", "guess=1", "FILE"],
        ["solve", "--option", "max_iterations=many", "FILE"],
        ["solvers", "unknown"],
    ],
    ids=" ".join,
)
def test_a_usage_error_is_2_and_no_traceback(arguments: list[str], files: list[Path]) -> None:
    stand_ins = {"FILE": str(files[0]), "MISSING": str(files[0].with_name("missing.hdf5"))}
    result = run(*(stand_ins.get(argument, argument) for argument in arguments), code=2)
    assert "Traceback" not in result.stderr


def test_version_and_help() -> None:
    for module in (True, False):
        result = start("--version", module=module)
        assert result.returncode == 0
        assert result.stdout == f"fclib {fclib.__version__}\n"
    for command in ([], ["info"], ["solve"], ["check"], ["convert"], ["solvers"], ["demo"]):
        for flag in ("--help", "-h"):
            result = run(*command, flag)
            assert "Usage" in result.stdout


def test_a_command_imports_what_it_needs_alone(files: list[Path]) -> None:
    """What `fclib info` does not use would take most of the time that it runs."""
    code = (
        "import sys; from fclib.cli import app; app(sys.argv[1:], standalone_mode=False);"
        "print(*sys.modules, file=sys.stderr)"
    )
    for arguments, absent in (
        (["info", str(files[0])], ["mujoco", "fclib.bench", "fclib.collections"]),
        (["--help"], ["scipy.linalg", "mujoco", "pyarrow", "matplotlib", "fclib.analysis"]),
        (["bench", "--help"], ["scipy", "mujoco", "pyarrow", "fclib.analysis"]),
        (["collection", "list"], ["scipy.spatial", "mujoco", "fclib.analysis"]),
    ):
        done = ran(sys.executable, "-c", code, *arguments)
        loaded = done.stderr.split()
        assert "fclib.cli" in loaded
        assert not set(absent) & set(loaded)


def every_command(path: tuple[str, ...] = (), command: Any = None) -> Iterator[Any]:
    """All commands and groups: the words that call it, and what Typer knows of it."""
    command = command or typer.main.get_command(cli.app)
    yield pytest.param(path, command, id=" ".join(("fclib", *path)))
    for name, inner in getattr(command, "commands", {}).items():
        yield from every_command((*path, name), inner)


@pytest.mark.parametrize(("path", "command"), list(every_command()))
def test_the_help_says_every_word_that_was_written(path: tuple[str, ...], command: Any) -> None:
    """Units in brackets among them, which some would take for markup."""
    shown = CliRunner().invoke(cli.app, [*path, "--help"], env={"COLUMNS": "80"})
    assert shown.exit_code == 0
    assert "\\" not in shown.stdout
    text = " ".join(shown.stdout.split())
    params = [
        param
        for param in command.get_params(typer.Context(command))
        if not getattr(param, "hidden", False)
    ]
    written = [command.help, *(getattr(param, "help", None) for param in params)]
    for words in filter(None, written):
        assert " ".join(words.split()) in text


def test_brackets_and_colons_of_a_path_are_printed_as_they_are(tmp_path: Path) -> None:
    case = planted_local(1, nc=2)
    names = ("[s].hdf5", "[bold]a.hdf5", ":bug:.hdf5")
    for name in names:
        fclib.write(tmp_path / name, case.problem, case.solution)
    shown = run("check", "--contacts", *(tmp_path / name for name in names)).stdout.splitlines()
    titles = [line.strip() for line in shown if len(line.split()) == 1]
    assert titles == list(names)
    assert [line.split()[0] for line in shown[-4:-1]] == list(names)
    absent = [tmp_path / f"no{name}" for name in names]
    errors = run("info", *absent, code=1).stderr.splitlines()
    assert all(f"no{name}: " in line for name, line in zip(names, errors, strict=True))


def test_what_a_file_says_does_not_steer_the_terminal(tmp_path: Path) -> None:
    problem = planted_local(1, nc=2).problem
    assert isinstance(problem, fclib.LocalProblem)
    problem = fclib.LocalProblem(
        W=problem.W,
        q=problem.q,
        mu=problem.mu,
        info=fclib.ProblemInfo(title="a\x1b[31mb\x07\u202ec"),
    )
    fclib.write(tmp_path / "title.hdf5", problem)
    assert "a [31mb  c" in run("info", tmp_path / "title.hdf5").stdout


def test_an_error_of_the_system_is_said_without_its_number(tmp_path: Path) -> None:
    missing = tmp_path / "none.xml"
    expected = f"fclib: {missing}: No such file or directory\n"
    assert run("simulate", missing, "--out", tmp_path / "out", code=1).stderr == expected


class NoEndError(BaseException):
    """A command that waits for ever: no handler of an OSError may take it."""


@pytest.fixture
def half_a_minute() -> Iterator[None]:
    def end(*_: object) -> None:
        raise NoEndError

    before = signal.signal(signal.SIGALRM, end)
    signal.alarm(30)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize(
    "words",
    [
        ("simulate", "PIPE"),
        ("simulate", "/dev/full"),
        ("simulate", "SCENE", "--ctrl", "PIPE"),
        ("simulate", "SCENE", "--states", "PIPE"),
        ("bench", "PIPE"),
        ("check", "PROBLEM", "--certificate", "PIPE"),
        ("solve", "PROBLEM", "--option", "law=@PIPE"),
        ("info", "PIPE"),
        ("convert", "PIPE", "new.hdf5"),
        ("record", "mujoco", "PIPE"),
        ("bench", "--problems", "PROBLEM", "--solver", "nsgs", "--module", "MODULE"),
        ("bench", "--problems", "PROBLEM", "--solver", "nsgs", "--tol", "1e-4", "--store", "PIPE"),
        ("results", "unpack", "PIPE"),
        ("results", "verify", "PIPE"),
        ("results", "verify", "PART"),
        ("profile", "--with", "PIPE"),
        ("collection", "verify", "PIPE"),
        ("collection", "find", "nc > 0", "--in", "PIPE"),
        ("view", "PROBLEM", "--out", "PIPE"),
    ],
)
def test_what_may_have_no_end_is_no_file(
    words: tuple[str, ...], tmp_path: Path, files: list[Path], half_a_minute: None
) -> None:
    pipe, scene = tmp_path / "pipe.csv", tmp_path / "scene.xml"
    part, module = tmp_path / "part-0123456789abcdef.parquet", tmp_path / "endless.py"
    for path in (pipe, part, module):
        os.mkfifo(path)
    scene.write_text(
        "<mujoco><worldbody><geom type='plane' size='1 1 1'/><body pos='0 0 .1'><freejoint/>"
        "<geom size='.1'/></body></worldbody></mujoco>"
    )
    names = {"PIPE": pipe, "PART": part, "MODULE": module, "SCENE": scene, "PROBLEM": files[0]}
    filled = (re.sub("[A-Z]{4,}", lambda name: str(names[name[0]]), word) for word in words)
    done = run(*filled, code=None)
    assert done.returncode in (1, 2), done.stdout
    said = " ".join(done.stderr.split())
    assert re.search("no(t a)? regular file|there is no such script|nothing reads", said)


def test_what_reads_a_pipe_gets_what_a_command_writes(
    tmp_path: Path, files: list[Path], half_a_minute: None
) -> None:
    pipe, page = tmp_path / "pipe", tmp_path / "page.html"
    os.mkfifo(pipe)
    with page.open("wb") as stream, subprocess.Popen(["cat", pipe], stdout=stream) as reader:
        for _ in range(100):  # until it has opened the pipe
            done = run("view", files[0], "--out", pipe, code=None)
            if "nothing reads" not in done.stderr:
                break
        assert done.returncode == 0, done.stderr
        assert reader.wait(30) == 0
    assert page.read_text(encoding="utf-8").rstrip().endswith("</html>")


@pytest.mark.parametrize(
    "words",
    [
        ("bench", "--problems", "FOLDER", "--solver", "nsgs", "--tol", "1e-4", "--store", "OUT"),
        ("bench", "--problems", "PROBLEM", "--solver", "nsgs", "--module", "LOOP"),
        ("collection", "add", "LOOP", "--out", "OUT"),
        ("collection", "add", "FOLDER", "--out", "LOOP"),
        ("report", "--catalog", "tiny", "--out", "LOOP"),
    ],
)
def test_a_link_to_itself_is_one_line(
    words: tuple[str, ...], tmp_path: Path, files: list[Path]
) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    loop = folder / "loop.h5"
    loop.symlink_to(loop)
    names = {"LOOP": loop, "FOLDER": folder, "PROBLEM": files[0], "OUT": tmp_path / "out"}
    filled = (re.sub("[A-Z]{3,}", lambda name: str(names[name[0]]), word) for word in words)
    done = run(*filled, code=None)
    assert done.returncode in (1, 2)
    assert str(folder) in "".join(done.stderr.split("\n"))
    assert "loop.h5-" not in done.stderr  # a folder that only the command knows
    assert list(folder.iterdir()) == [loop]


def test_what_cannot_be_converted_leaves_no_folder(tmp_path: Path) -> None:
    run("convert", tmp_path / "none.h5", "--out", tmp_path / "out", code=1)
    assert list(tmp_path.iterdir()) == []


def test_an_output_folder_that_is_a_file_is_named(files: list[Path]) -> None:
    done = run("convert", files[0], "--out", files[1], code=1)
    assert done.stderr == f"fclib: {files[1]}: cannot be written: it is no folder\n"


def test_a_part_that_cannot_be_read_is_named_once(tmp_path: Path) -> None:
    empty = tmp_path / "empty.parquet"
    empty.touch()
    done = run("results", "verify", empty, code=1)
    assert done.stderr.count(str(empty)) == 1


def test_standard_output_gets_a_page_and_no_name(files: list[Path], tmp_path: Path) -> None:
    """Whether it is a pipe or a file."""
    done = start("view", files[0], "--out", "/dev/stdout")
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("</html>\n")
    page = tmp_path / "page.html"
    with page.open("w") as out:
        command = [sys.executable, "-m", "fclib", "view", str(files[0]), "--out", "/dev/stdout"]
        subprocess.run(command, stdout=out, check=True)
    assert page.read_text().endswith("</html>\n")
    assert Path("/dev/stdout").is_symlink()


@pytest.mark.parametrize("kind", ["hdf5", "siconos"])
def test_a_file_is_not_converted_onto_a_device(files: list[Path], kind: str) -> None:
    for more in ([], ["--force"]):
        done = start("convert", files[0], "/dev/stdout", "--format", kind, *more)
        assert done.returncode == 1
        assert not done.stdout
        assert (
            done.stderr == "fclib: /dev/stdout: is a device or a pipe; name a file to be written\n"
        )


def test_there_is_no_progress_bar_in_a_pipe(files: list[Path]) -> None:
    for command in ("info", "solve", "check"):
        result = start(command, *files)
        assert result.stderr == ""
        assert "\x1b" not in result.stdout


def test_a_closed_pipe_is_no_traceback(files: list[Path]) -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "fclib", "info", "--json", *map(str, files * 2000)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert "Traceback" not in process.stderr.read()


# ---- tables


def shown(rows: Rows, width: int) -> list[str]:
    console = Console(width=width, file=io.StringIO())
    console.print(rows)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    return [line.rstrip() for line in text.splitlines()]


def test_a_table_that_is_too_wide_is_printed_in_parts() -> None:
    rows = Rows(
        [
            {"problem": "tower.hdf5", "nc": 144, "status": "ok", "error": 8.9e-9, "slide": 0},
            {"problem": "b.hdf5", "nc": 2, "status": "wrong", "error": 0.01317, "slide": 3},
        ],
        title="Judged",
    )
    assert shown(rows, 80) == [
        "Judged",
        "problem      nc  status    error  slide",
        "tower.hdf5  144  ok      8.9e-09      0",
        "b.hdf5        2  wrong   0.01317      3",
    ]
    # no number loses a digit, and each part names its rows
    assert shown(rows, 30) == [
        "Judged",
        "problem      nc  status",
        "tower.hdf5  144  ok",
        "b.hdf5        2  wrong",
        "",
        "problem       error  slide",
        "tower.hdf5  8.9e-09      0",
        "b.hdf5      0.01317      3",
    ]


def test_a_long_text_of_a_table_is_folded() -> None:
    rows = Rows([{"set": "rt444", "what": "the four families of the report RT-0444", "v": 5}])
    lines = shown(rows, 40)
    assert lines[0].split() == ["set", "what", "v"]
    assert all(len(line) <= 40 for line in lines)
    assert (
        " ".join(" ".join(lines[1:]).split()) == "rt444 the four families of the 5 report RT-0444"
    )


# ---- conventions


def permuted(problem: fclib.LocalProblem, order: list[int]) -> fclib.LocalProblem:
    """The same with the components of each contact in another order."""
    rows = np.arange(3 * problem.nc).reshape(-1, 3)[:, order].ravel()
    W = dense(problem.W)[np.ix_(rows, rows)]
    return fclib.LocalProblem(W=W, q=np.array(problem.q)[rows], mu=problem.mu)


def resting(shape: str, pulled: float) -> Any:
    """The problem of bodies that lie on a plane, or that one pulls along."""
    pytest.importorskip("mujoco")
    from fclib.scenes import Scene
    from fclib.simulate import simulate

    bodies = "".join(
        f'<body pos="{k} 0 0.1"><freejoint/><geom {shape} mass="1"/></body>' for k in range(3)
    )
    speeds = " ".join(f"{pulled} 0 0 0 0 0" for _ in range(3))
    places = " ".join(f"{k} 0 0.1 1 0 0 0" for k in range(3))
    xml = (
        f'<mujoco><worldbody><geom type="plane" size="9 9 1"/>{bodies}</worldbody><keyframe>'
        f'<key name="start" qpos="{places}" qvel="{speeds}"/></keyframe></mujoco>'
    )
    (step,) = simulate(Scene(name="rest", xml=xml), 1)
    return step.problem.replace(contacts=None, bodies=None).condense()


@pytest.mark.parametrize("pulled", [0.0, -1.0, 1.0])
@pytest.mark.parametrize("shape", ['type="box" size=".2 .1 .1"', 'size=".1"'])
def test_a_normal_that_is_not_first_is_asked_for(shape: str, pulled: float, tmp_path: Path) -> None:
    problem = resting(shape, pulled)
    files = {}
    for name, order in {"right": [0, 1, 2], "wrong": [1, 2, 0]}.items():
        other = permuted(problem, order)
        files[name] = tmp_path / f"{name}.hdf5"
        fclib.write(files[name], other, fclib.solve(other).solution)
    assert "is the normal first?" not in run("check", files["right"]).stderr
    assert "is the normal first?" not in run("analyze", files["right"]).stderr
    if pulled < 0 and "box" in shape:
        return  # what seems to be the normal closes
    assert "wrong.hdf5: " in run("check", files["wrong"]).stderr
    for command in ("check", "analyze"):
        assert "is the normal first?" in run(command, files["wrong"]).stderr


def test_contacts_are_shown_with_the_names_of_their_bodies(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    xml = tmp_path / "ball.xml"
    xml.write_text(
        '<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="ball" pos="0 0 0.1">'
        '<freejoint/><geom size="0.1"/></body></worldbody></mujoco>',
        encoding="utf-8",
    )
    out = tmp_path / "out"
    run("simulate", xml, "--steps", 1, "--out", out, "--no-pictures")
    (file,) = out.rglob("*-global.hdf5")
    shown = run("check", "--contacts", file).stdout
    assert {"first", "second", "world", "ball"} <= set(shown.split())
    (record,) = records(run("check", "--contacts", "--json", file))
    assert (record["contacts"][0]["first"], record["contacts"][0]["second"]) == ("world", "ball")


# ---- solvers of one's own, campaigns


OWN = """
import fclib

@fclib.solver("my-nothing", family="splitting")
def solve(problem, r, monitor):
    \"\"\"Returns the starting point.\"\"\"
"""


def test_solvers_of_ones_own_are_taken_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "my_nothing_file.py").write_text(OWN)
    problem = fclib.LocalProblem(W=np.eye(3), q=-np.ones(3), mu=np.full(1, 0.5))
    fclib.write(tmp_path / "one.hdf5", problem)
    file, module = tmp_path / "one.hdf5", tmp_path / "my_nothing_file.py"
    arguments = ["solve", file, "--solver", "my-nothing", "--module", module, "--json"]
    solved = run(*arguments, code=1)
    assert json.loads(solved.stdout)["solver"] == "my-nothing"
    shown = run("solvers", "my-nothing", "--module", module)
    assert "Returns the starting point." in shown.stdout
    for command in (["solve", file], ["solvers"]):
        absent = run(*command, "--module", tmp_path / "absent.py", code=2)
        assert "absent.py: there is no such file" in absent.stderr


def test_an_infinite_tolerance_is_refused(files: list[Path]) -> None:
    for command in ("solve", "check", "analyze"):
        refused = run(command, files[0], "--tol", "inf", code=2)
        assert "--tol" in refused.stderr
        assert not refused.stdout


def test_a_name_that_the_output_cannot_encode_is_no_error(tmp_path: Path) -> None:
    problem = fclib.LocalProblem(W=np.eye(3), q=-np.ones(3), mu=np.full(1, 0.5))
    fclib.write(tmp_path / "caf\u00e9.hdf5", problem)
    command = (sys.executable, "-m", "fclib", "info", "caf\u00e9.hdf5")
    shown = ran(*command, cwd=tmp_path, env=os.environ | {"PYTHONIOENCODING": "ascii"})
    assert "caf\\xe9.hdf5" in shown.stdout
    assert not shown.stderr


def test_a_view_in_place_of_a_folder_leaves_nothing_behind(
    files: list[Path], tmp_path: Path
) -> None:
    folder = tmp_path / "page"
    folder.mkdir()
    before = sorted(tmp_path.iterdir())
    refused = run("view", files[0], "--out", folder, code=1)
    assert f"{folder}: Is a directory" in refused.stderr
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("option", [("view", "--out"), ("judge", "--out"), ("judge", "--csv")])
def test_no_command_writes_over_what_it_reads(option: tuple[str, str], files: list[Path]) -> None:
    command, name = option
    before = files[0].read_bytes()
    for what in (files[0], files[0].parent):
        if command == "view" and what.is_dir():
            continue
        refused = run(command, what, name, files[0], code=1)
        assert "is what is read, and would be replaced" in refused.stderr
        assert files[0].read_bytes() == before


def test_judge_writes_its_own_page_and_table_again(files: list[Path], tmp_path: Path) -> None:
    folder = tmp_path / "steps"
    folder.mkdir()
    problem = fclib.read(files[0])
    fclib.write(folder / "0.hdf5", problem, guesses=[fclib.solve(problem).solution])
    for _ in range(2):
        run("judge", folder, "--csv", folder / "table.csv")
    # what follows a script is for the script
    refused = run("judge", "mujoco", tmp_path / "none.py", "x" * 300, "--csv", __file__, code=1)
    assert "is what is read" not in refused.stderr


def test_the_help_of_campaigns_shows_their_options() -> None:
    shown = run("bench", "--help").stdout
    for word in ("merge", "export", "--problems", "--solver", "--time-limit", "--module"):
        assert word in shown


def test_a_pipe_is_told_how_far_a_build_is(monkeypatch: pytest.MonkeyPatch) -> None:
    from fclib.cli import _progress

    monkeypatch.setattr(_progress, "PAUSE", 0.0)
    with redirect_stderr(StringIO()) as told, _progress.many_bars() as show:
        show("set/Family", 1, 3)
        show("set/Family", 2, 3)
    assert told.getvalue() == "set/Family: 1 of 3\nset/Family: 2 of 3\n"
