"""The one entry to every solver."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Mapping
from numbers import Integral, Real
from pathlib import Path
from types import NoneType
from typing import Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from fclib import _core, _laws
from fclib._registry import find_solver, parse_solver

Problem: TypeAlias = _laws.Problem
KINDS = get_args(Problem)

# the types accepted as a solution or a guess
Given: TypeAlias = _core.Solution | _core.Result | npt.ArrayLike
Callback: TypeAlias = Callable[[int, float, float, str], bool | np.bool_ | None]
MeritKind: TypeAlias = Literal["both", "natural"]
# the numbers of a Merit: its errors, and how many contacts are open, stick and slide
ERRORS = (
    "error",
    "natural",
    "scaled_natural",
    "dynamics",
    "bilateral",
    "kinematics",
    "cone",
    "dual_cone",
    "complementarity",
)
MERITS = (*ERRORS, "open", "stick", "slide")
Value: TypeAlias = bool | int | float | str | Path | list[str]


def solve(
    problem: Problem,
    solver: str = "auto",
    tol: float = 1e-8,
    *,
    max_iterations: int | None = None,
    time_limit: float | None = None,
    guess: Given | None = None,
    callback: Callback | None = None,
    history: bool = False,
    merit: MeritKind = "both",
    **options: Value,
) -> _core.Result:
    """Solve a frictional contact problem of any formulation.

    Args:
        problem: a local or a global problem, with or without bilateral constraints.
        solver: a name of ``fclib.solvers()``, also with options: ``"nsgs relaxation=1.2"``.
        tol: bound on ``Merit.error``.
        max_iterations: limit of the solver's iterations, None: its own default.
        time_limit: [s] limit of wall-clock time.
        guess: a starting point: reactions (m,), or a Solution or Result, whose ``r`` is used.
        callback: called as ``callback(iteration, error, seconds, stage)`` each time the solver
            evaluates its error; returning False stops it. ``stage`` is empty, except for solvers
            that chain others, for example ``auto``.
        history: whether ``Result.history`` keeps all calls of a callback. It ends with the error of
            the result.
        merit: what ``tol`` bounds: ``both`` the natural map and the scaled one, which is the same
            in any units, or ``natural`` alone, to compare with the literature.
        **options: the solver's own options, see ``fclib solvers``. A text may be given by the path
            of its file or as a list of its lines.

    Returns:
        The solution with its status: ``converged`` means that the merit, recomputed on the problem
        as given, is at most ``tol``.

    Raises:
        ProblemError: the data of the problem or of the guess is not valid.
        OptionError: unknown solver or option, or a value out of range.
        UnsuitableError: the problem cannot be brought to the form that the solver takes, or its
            bilateral constraints contradict each other by more than ``tol``.
        SolverError: a solver outside of fclib failed.
    """
    info, values = _chosen(solver, tol, max_iterations, time_limit, merit, options)
    return _run(
        problem,
        info,
        values,
        tol,
        max_iterations,
        time_limit,
        guess,
        callback,
        history,
        merit,
        None,
    )


def solve_with(
    solver: str,
    tol: float,
    *,
    max_iterations: int | None = None,
    time_limit: float | None = None,
    callback: Callback | None = None,
    history: bool = False,
    merit: MeritKind = "both",
    **options: Value,
) -> Callable[..., _core.Result]:
    """`solve` of many problems: a function of the problem, the guess and `still`.

    With `still`, and a guess: bodies that are slower, relative to their largest velocity without
    reactions, get the reactions at rest that are the nearest to the guess, if these solve the
    problem too.
    """
    info, values = _chosen(solver, tol, max_iterations, time_limit, merit, options)

    def run(
        problem: Problem, guess: Given | None = None, still: float | None = None
    ) -> _core.Result:
        return _run(
            problem,
            info,
            values,
            tol,
            max_iterations,
            time_limit,
            guess,
            callback,
            history,
            merit,
            still,
        )

    return run


def _chosen(
    solver: str,
    tol: float,
    max_iterations: int | None,
    time_limit: float | None,
    merit: str,
    options: dict[str, Value],
) -> tuple[_core.SolverInfo, dict[str, bool | int | float | str]]:
    """The solver and its options, once all limits are checked."""
    usual = max_iterations is None and time_limit is None and type(tol) is float
    if not (usual and 0 <= tol < math.inf):
        check_limits(tol, time_limit, max_iterations=max_iterations)
    if merit not in ("both", "natural"):
        raise _core.OptionError(f"merit: '{merit}' is neither both nor natural")
    if isinstance(solver, str) and " " in solver:
        solver, own = parse_solver(solver)
        options = {**own, **options}
    values = {name: _plain(name, value) for name, value in options.items()} if options else {}
    return find_solver(solver), values


def _run(
    problem: Problem,
    info: _core.SolverInfo,
    values: dict[str, bool | int | float | str],
    tol: float,
    max_iterations: int | None,
    time_limit: float | None,
    guess: Given | None,
    callback: Callback | None,
    history: bool,
    merit: str,
    still: float | None,
) -> _core.Result:
    try:
        return _core.solve(
            problem,
            info,
            tol,
            max_iterations or 0,
            math.inf if time_limit is None else time_limit,
            values,
            guess,
            callback,
            history,
            merit == "natural",
            None,
            still,
        )
    except TypeError:
        limits = {"tol": tol, "max_iterations": max_iterations, "time_limit": time_limit}
        name_wrong_type(problem=problem, **limits, history=history, callback=callback)
        raise  # the callback raised it


def check_limits(
    tol: float, time_limit: float | None, *, max_iterations: int | None = None, threads: int = 0
) -> None:
    """OptionError if one is out of range, or no number."""
    try:
        if not 0 <= tol < math.inf:
            raise _core.OptionError(f"tol: {tol} is not a finite number of 0 or more")
        if max_iterations is not None and max_iterations < 1:
            raise _core.OptionError(f"max_iterations: {max_iterations} is less than 1")
        if time_limit is not None and not time_limit > 0:
            raise _core.OptionError(f"time_limit: {time_limit} is not a positive number of seconds")
        if threads < 0:
            raise _core.OptionError(f"threads: {threads} is negative")
    except (TypeError, ValueError):
        limits = {"tol": tol, "max_iterations": max_iterations, "time_limit": time_limit}
        name_wrong_type(**limits, threads=threads)
        raise


def name_wrong_type(**given: object) -> None:
    """Say which argument is of a wrong type, if any, once something was: the core names none."""
    for name, value in given.items():
        if name == "problem":
            check_problem(value)
            continue
        fits, meant = _TYPES[name]
        if not fits(value):
            raise _core.OptionError(f"{name}: {value!r} is not {meant}")


def check_problem(problem: object) -> None:
    """ProblemError if it is none."""
    if not isinstance(problem, KINDS):
        known = ", ".join(kind.__name__ for kind in KINDS)
        raise _core.ProblemError(f"problem: a {type(problem).__name__} is none of {known}")


def _is_count(value: object, bits: int) -> bool:
    return isinstance(value, Integral) and abs(int(value)) < 2 ** (bits - 1)


# of each argument of solve and its like, whether a value may be one, and what is meant
_TYPES: dict[str, tuple[Callable[[object], bool], str]] = {
    "tol": (lambda value: isinstance(value, Real), "a number"),
    "max_iterations": (lambda value: value is None or _is_count(value, 64), "a 64-bit integer"),
    "time_limit": (lambda value: isinstance(value, (Real, NoneType)), "a number of seconds"),
    "threads": (lambda value: _is_count(value, 32), "a 32-bit integer"),
    "history": (lambda value: isinstance(value, bool), "True or False"),
    "callback": (lambda value: value is None or callable(value), "a function"),
}


def _plain(name: str, value: object) -> bool | int | float | str:
    """An option's value as a Python scalar; NumPy's scalars are taken too, lines and a file's."""
    if isinstance(value, Path):
        try:
            return value.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise _core.OptionError(f"option {name}: {value}: {error}") from error
    if isinstance(value, list) and all(isinstance(line, str) for line in value):
        return "\n".join(value)
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, (bool, float, str)):
        return value
    if isinstance(value, int) and -(2**63) <= value < 2**63:
        return value
    if isinstance(value, Mapping):
        raise _core.OptionError(
            f"option {name}: is a table; give each option by its name, as in relaxation=1.2, or a "
            f"table as **{name}"
        )
    shown = reprlib.repr(value)
    raise _core.OptionError(f"option {name}: {shown} is not a truth value, a number or a text")
