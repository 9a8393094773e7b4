"""Any program that reads an FCLIB file and writes a solution: ``cmd:PROGRAM {input} {output}``.

The words are those of a command line, without a shell. These placeholders are replaced:

    {input}           an FCLIB file with the local problem, without bilateral constraints, and with
    the starting point as a guess if there is one {output}          a file that does not exist yet
    {tol}             the tolerance on the relative natural-map error
    {time_limit}      [s] remaining wall-clock time, "inf" if there is no limit
    {max_iterations}  the caller's limit

The program ends with exit status 0, and leaves /solution in the output, an FCLIB file or a bare
one, or in the input if there is no {output}. At the time limit it is killed with all that it has
started. The time of the result is the CPU time of the program and of what it waited for, with its
start; its iterations are not known, and stated as 0. A program may say both itself, by the
attributes `cpu_s` [s] and `iterations` of its /solution. The answer is judged like any other; a
program that gets {tol} is run again with a smaller one if it stopped too early.
"""

from __future__ import annotations

import contextlib
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any, TypeAlias

from fclib import _core, _marked, _registry
from fclib._registry import make_solver

PREFIX = "cmd:"
MARK = "FCLIB_PROGRAM"  # in the environment of all that a program starts
SOLVERS = "cmd:PROGRAM {input} {output}"
Local: TypeAlias = _core.LocalProblem | _core.LocalRollingProblem
reported = False  # whether the last program reported the time of its solve
PLACES = ("input", "output", "tol", "time_limit", "max_iterations")


def missing() -> str:
    """Nothing is to be installed."""
    return "" if hasattr(os, "waitid") else "works on POSIX systems alone"


def version() -> str:
    """None: a program has no version."""
    return ""


def solvers() -> Sequence[_core.SolverInfo]:
    """None is listed: their names are commands."""
    return ()


def find(name: str) -> _core.SolverInfo:
    """The entry of a command.

    Raises:
        OptionError: the command has no {input}, or its program is not found.
    """
    try:
        words = shlex.split(name.removeprefix(PREFIX))
    except ValueError as error:
        raise _core.OptionError(f"solver '{name}': {error}") from None
    if not words or not any("{input}" in word for word in words):
        raise _core.OptionError(f"solver '{name}': is not of the form {SOLVERS}")
    if shutil.which(words[0]) is None:
        raise _core.OptionError(f"solver '{name}': there is no program {words[0]}")

    def function(problem: Local, r: Any, monitor: _core.Monitor) -> Any:
        return _solve(words, problem, r, monitor)

    return make_solver(
        function,
        name=name,
        family="program",
        title="A program that reads and writes FCLIB files",
        citation="",
        origin="cmd",
        dimensions=(2, 3),
        rolling_dimensions=(3, 5),
        max_iterations=2**31 - 1,
    )


def _solve(words: list[str], problem: Local, r: Any, monitor: _core.Monitor) -> Any:
    global reported
    if monitor.stop(r):
        return r
    with tempfile.TemporaryDirectory(prefix="fclib-") as folder:
        given, made = Path(folder) / "input.hdf5", Path(folder) / "output.hdf5"
        _core.write(given, problem, guesses=[_core.Solution(r=r)] if r.any() else [])
        values = (given, made, monitor.tolerance, monitor.time_left, monitor.max_iterations)
        command = [
            _filled(word, dict(zip(PLACES, map(str, values), strict=True))) for word in words
        ]
        monitor.cpu_s, in_time = run(command, monitor.time_left)
        if not in_time:
            monitor.status = "time_limit"
            return r
        writes = any("{output}" in word for word in words)
        solution = _solution(made if writes else given, words[0])
        told = _core.read_attributes(made if writes else given, "solution")
    if solution.r.shape != r.shape:
        raise _registry.SolverError(
            f"{words[0]}: its solution has r of length {solution.r.size}, expected {r.size}"
        )
    stop = monitor.stop(solution.r)
    monitor.iterations = int(_number(told, "iterations", words[0], 0) or 0)
    # the bench measures the time itself, and treats a negative time as a lie
    if (cpu_s := _number(told, "cpu_s", words[0], -(2**62))) is not None:
        monitor.cpu_s, reported = cpu_s, True
    if not stop and not any("{tol}" in word for word in words):
        monitor.status = "inaccurate"  # a second run would give the same
    return solution.r


def _number(told: Mapping[str, float | str], name: str, program: str, least: float) -> float | None:
    value = told.get(name)
    if value is None:
        return None
    if not (isinstance(value, (int, float)) and least <= value < 2**62):
        number = "number from 0 on" if least == 0 else "number"
        raise _registry.SolverError(f"{program}: its solution has {name} = {value!r}, no {number}")
    return float(value)


def _filled(word: str, values: dict[str, str]) -> str:
    for place, value in values.items():
        word = word.replace(f"{{{place}}}", value)
    return word


def _solution(path: Path, program: str) -> _core.Solution:
    if not path.exists():
        raise _registry.SolverError(f"{program}: ended well, but made no output")
    try:
        solution = _core.read_solution(path)
    except _core.Error as error:
        word = str(error).replace(str(path), "its output")
        raise _registry.SolverError(f"{program}: {word}") from error
    if solution is None:
        raise _registry.SolverError(f"{program}: ended well, but wrote no /solution")
    return solution


def run(command: list[str], time_limit: float) -> tuple[float, bool]:
    """Run a program to its end, or kill it at the limit with all that it has started.

    Returns:
        Its CPU time [s], and whether it ended in time.

    Raises:
        SolverError: it cannot be started, or ends with another status than 0.
    """
    mark = uuid.uuid4().hex
    # if the system allows it: the program ends with this process, however this one ends
    guard = shutil.which("setpriv")
    prefix = [guard, "--pdeathsig", "KILL", "--"] if guard and sys.platform == "linux" else []
    with tempfile.TemporaryFile() as words:
        try:
            process = subprocess.Popen(
                prefix + command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=words,
                start_new_session=True,
                env=os.environ | {MARK: mark},
            )
        except OSError as error:
            raise _registry.SolverError(f"{command[0]}: {error.strerror}") from error
        end = time.monotonic() + time_limit
        pause, in_time = 1e-3, True
        try:
            ended = os.WEXITED | os.WNOHANG | os.WNOWAIT
            while os.waitid(os.P_PID, process.pid, ended) is None:
                left = end - time.monotonic()
                if left <= 0:
                    in_time = False
                    break
                time.sleep(min(pause, left))
                pause = min(2 * pause, 0.02)
        finally:
            # the whole group, while the program's number is still its own
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)
            _marked.kill(_marked.marked(f"{MARK}={mark}"))  # what has left the group
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        cpu_s = usage.ru_utime + usage.ru_stime
        if in_time and process.returncode != 0:
            code = process.returncode
            how = f"was ended by signal {-code}" if code < 0 else f"ended with exit status {code}"
            raise _registry.SolverError(f"{command[0]}: {how}{_last_line(words)}")
    return cpu_s, in_time


def _last_line(words: IO[bytes]) -> str:
    """The last line of a program's standard error."""
    size = words.seek(0, os.SEEK_END)
    words.seek(max(0, size - 2000))
    lines = words.read().decode(errors="replace").strip().splitlines()
    return f": {lines[-1]}" if lines else ""
