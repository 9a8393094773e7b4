"""All solvers by their names: those of the core, users' own, and those of other packages.

A user's solver is a function with the decorator ``solver``. It is found once its module is
imported, or at any time if an installed package names it in the entry point group
``fclib.solvers``; ``fclib.external`` is such an entry point itself. The driver of the core runs it
like any other: conversions, limits, history and the judgement are the same.
"""

from __future__ import annotations

import functools
import inspect
import math
import shlex
import types
import typing
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from fclib import _core, _entry_points, _laws
from fclib._suggest import nearest

GROUP = "fclib.solvers"
SolverError = _core.SolverError
Function = TypeVar("Function", bound=Callable[..., Any])
RESERVED = {
    "problem",
    "solver",
    "tol",
    "max_iterations",
    "time_limit",
    "guess",
    "callback",
    "history",
    "merit",
}
REAL = "expected real numbers"
OPTION_TYPES = {bool: "bool", int: "int", float: "float"}


@dataclass(frozen=True)
class Option:
    """The description of a solver's option: ``Annotated[float, Option("step", unit="1")]``.

    Args:
        doc: its meaning.
        unit: 1 if it has none.
        lowest: values below are refused.
        highest: values above are refused.
    """

    doc: str = ""
    unit: str = "1"
    lowest: float = -math.inf
    highest: float = math.inf


class Provider(Protocol):
    """An entry point that offers many solvers, instead of a decorated function or its module."""

    def solvers(self) -> Sequence[_core.SolverInfo]:
        """The solvers that can be used."""

    def find(self, name: str) -> _core.SolverInfo | None:
        """The solver of this name, if it is one of the provider's; also unlisted ones."""


_registered: dict[str, _core.SolverInfo] = {}


def solver(
    name: str,
    *,
    family: str = "user",
    title: str = "",
    citation: str = "",
    dimensions: Iterable[int] = (2, 3),
    rolling_dimensions: Iterable[int] = (),
    max_iterations: int = 1_000_000,
) -> Callable[[Function], Function]:
    """Make a solver of a function, for ``fclib.solve``, the command line and the bench.

    The function is called as ``function(problem, r, monitor, **options)``. The problem is a
    ``LocalProblem`` (or a ``LocalRollingProblem``) without bilateral constraints, whatever the
    user's is; r the starting point, its own copy. It calls ``monitor.stop(r)`` in every iteration,
    which is true once it is time to stop. It returns r, or None if it has changed r in place.

    The options are its keyword-only parameters, of type bool, int, float or ``Literal`` of texts,
    with a default; ``Annotated[float, fclib.Option(...)]`` gives meaning, unit and bounds.

    Args:
        name: its name for callers.
        family: family of algorithms.
        title: if empty, the first line of the function's docstring.
        citation: the source of the algorithm.
        dimensions: the spacedims it takes, of 2 and 3.
        rolling_dimensions: the spacedims of rolling problems it takes, of 3 and 5.
        max_iterations: limit if the caller sets none.

    Raises:
        OptionError: the name is that of a solver of the core.
        TypeError: the function does not have such parameters, or there is no name.
    """
    if not isinstance(name, str) or not name.strip():
        raise TypeError(f"{name!r} is no name of a solver")

    def decorate(function: Function) -> Function:
        register(
            make_solver(
                function,
                name=name,
                family=family,
                title=title or (inspect.getdoc(function) or name).splitlines()[0],
                citation=citation,
                origin=(function.__module__ or "").partition(".")[0],
                dimensions=tuple(dimensions),
                rolling_dimensions=tuple(rolling_dimensions),
                max_iterations=max_iterations,
            )
        )
        return function

    return decorate


def dimensions_of(info: _core.SolverInfo, kind: str) -> list[int]:
    """The spacedims that a solver takes of problems of a kind."""
    return dimensions_by_law(info)[_laws.law_of(kind)]


def dimensions_by_law(info: _core.SolverInfo) -> dict[str, list[int]]:
    """The spacedims that a solver takes, by the law of the contacts."""
    return {"": info.dimensions, "rolling": info.rolling_dimensions, "spin": info.spin_dimensions}


def make_solver(
    function: Callable[..., Any],
    *,
    name: str,
    family: str,
    title: str,
    citation: str,
    origin: str,
    dimensions: Sequence[int],
    rolling_dimensions: Sequence[int],
    max_iterations: int,
) -> _core.SolverInfo:
    """The entry of a function; this does not register it."""

    @functools.wraps(function)
    def guarded(
        problem: _core.LocalProblem | _core.LocalRollingProblem,
        r: npt.NDArray[np.float64],
        monitor: _core.Monitor,
        options: dict[str, Any],
    ) -> npt.NDArray[np.float64]:
        try:
            answer = function(problem, r, monitor, **options)
            result = _reactions_of(r if answer is None else answer)
        except (Exception, SystemExit) as error:
            # errors of the caller's callback are not the solver's, nor is a refusal
            if error is monitor.failure or isinstance(error, (_core.UnsuitableError, SolverError)):
                raise
            raise SolverError(f"solver {name}: {type(error).__name__}: {error}") from error
        if result.shape != (problem.m,):
            raise SolverError(
                f"solver {name}: returned an array of shape {result.shape}, "
                f"expected r of shape ({problem.m},)"
            )
        return result

    return _core.python_solver(
        name=name,
        family=family,
        title=title,
        citation=citation,
        origin=origin,
        dimensions=list(dimensions),
        rolling_dimensions=list(rolling_dimensions),
        options=_options_of(function),
        max_iterations=max_iterations,
        function=guarded,
    )


def _reactions_of(answer: Any) -> npt.NDArray[np.float64]:
    """What a function returned, as numbers: no part of it is dropped."""
    try:
        array = np.asarray(answer)
    except (TypeError, ValueError) as error:
        raise TypeError(f"returned what is no array ({error}), {REAL}") from error
    if np.ma.is_masked(answer) or array.dtype.kind not in "fiub":
        kind = "a masked array" if np.ma.is_masked(answer) else f"an array of {array.dtype}"
        raise TypeError(f"returned {kind}, {REAL}")
    return array.astype(np.float64, copy=False)


def _options_of(function: Callable[..., Any]) -> list[_core.OptionInfo]:
    """The keyword-only parameters of a function."""
    parameters = inspect.signature(function).parameters.values()
    keywords = [p for p in parameters if p.kind is inspect.Parameter.KEYWORD_ONLY]
    if len(parameters) - len(keywords) != 3:
        raise TypeError(
            f"{function.__qualname__}: a solver is a function (problem, r, monitor, *, options)"
        )
    annotations = {p.name: p.annotation for p in keywords if p.annotation is not p.empty}
    hints = typing.get_type_hints(
        types.SimpleNamespace(__annotations__=annotations),
        globalns=getattr(function, "__globals__", {}),
        include_extras=True,
    )
    infos = []
    for parameter in keywords:
        where = f"{function.__qualname__}: option {parameter.name}"
        if parameter.name in RESERVED:
            raise TypeError(f"{where}: is a name that fclib.solve has itself")
        if parameter.default is inspect.Parameter.empty:
            raise TypeError(f"{where}: has no default")
        hint = hints.get(parameter.name, type(parameter.default))
        described = [x for x in getattr(hint, "__metadata__", ()) if isinstance(x, Option)]
        about = described[0] if described else Option()
        hint = hint.__origin__ if hasattr(hint, "__metadata__") else hint
        choices = [
            str(x) for x in typing.get_args(hint) if typing.get_origin(hint) is typing.Literal
        ]
        if not choices and hint not in OPTION_TYPES:
            raise TypeError(f"{where}: is neither bool, int, float nor Literal of texts")
        type_name = "choice" if choices else OPTION_TYPES[hint]
        _check_default(where, type_name, parameter.default, choices, about)
        infos.append(
            _core.OptionInfo(
                name=parameter.name,
                type=type_name,
                default=float(parameter.default) if type_name == "float" else parameter.default,
                unit=about.unit if type_name in ("int", "float") else "",
                doc=about.doc,
                choices=choices,
                lowest=about.lowest,
                highest=about.highest,
            )
        )
    return infos


def _check_default(
    where: str, type_name: str, default: Any, choices: Sequence[str], about: Option
) -> None:
    """What a user would be told of at the first solve, and could not mend, is told here."""
    if type_name == "choice":
        if default not in choices:
            raise TypeError(f"{where}: its default {default!r} is none of {', '.join(choices)}")
    elif isinstance(default, str) or not isinstance(default, (bool, int, float, np.number)):
        raise TypeError(f"{where}: its default {default!r} is no {type_name}")
    elif type_name != "bool" and not about.lowest <= default <= about.highest:
        raise TypeError(
            f"{where}: its default {default!r} is not between {about.lowest:g} and "
            f"{about.highest:g}"
        )


def register(info: _core.SolverInfo) -> None:
    """Put a solver beside those of the core, in place of a user's solver of the same name."""
    if any(info.name == built_in.name for built_in in _core.solvers()):
        raise _core.OptionError(f"solver '{info.name}': there is one of this name in fclib")
    _registered[info.name] = info


@functools.cache
def _providers() -> tuple[Provider, ...]:
    """Load the entry points, once. One that cannot be loaded is reported, and left out."""
    return tuple(
        found
        for _, found in _entry_points.loaded(GROUP)
        if hasattr(found, "find") and hasattr(found, "solvers")
    )


def solvers() -> list[_core.SolverInfo]:
    """All solvers that can be used, by name: those of fclib, registered and external ones."""
    found = {info.name: info for info in _core.solvers()}
    for provider in _providers():
        found |= {info.name: info for info in provider.solvers()}
    found |= _registered
    return [found[name] for name in sorted(found)]


_of_the_core: dict[str, _core.SolverInfo] = {}  # once one was asked for


def find_solver(name: str) -> _core.SolverInfo:
    """The solver of this name: of fclib, registered, or external.

    Raises:
        OptionError: there is none; the message has the known names, or the missing package.
    """
    own = _of_the_core.get(name)
    if own is not None:
        return own
    if not isinstance(name, str):
        raise _core.OptionError(f"solver: {name!r} is not a name, such as 'auto' or 'nsgs'")
    if not _of_the_core:
        _of_the_core.update({info.name: info for info in _core.solvers()})
        return find_solver(name)
    if name in _registered:
        return _registered[name]
    for provider in _providers():
        found = provider.find(name)
        if found is not None:
            return found
    if name in _registered:  # an entry point registered it
        return _registered[name]
    known = [info.name for info in solvers()]
    raise _core.OptionError(
        f"solver '{name}': unknown; the nearest are {nearest(name.partition(' ')[0], known)};"
        " `fclib solvers` lists all"
    )


def parse_solver(text: str) -> tuple[str, dict[str, str]]:
    """The name and the options of "nsgs relaxation=1.2"; all after "cmd:" is one name.

    So is the name of a registered solver, or the path of a plugin, that has spaces.

    Raises:
        OptionError: an option is not of the form name=value.
    """
    plugin = text.startswith("plugin:") and Path(text.removeprefix("plugin:")).is_file()
    if text.startswith("cmd:") or text in _registered or plugin:
        return text, {}
    try:
        name, *pairs = shlex.split(text) or [""]
    except ValueError as error:
        raise _core.OptionError(f"solver {text!r}: {error}") from None
    options = {}
    for pair in pairs:
        key, _, value = pair.partition("=")
        if not (key and value):
            raise _core.OptionError(f"solver {text!r}: '{pair}' is not of the form name=value")
        options[key] = value
    return name, options
