"""FCLIB: discrete frictional contact problems, and a test bench for algorithms.

>>> import fclib
>>> problem = fclib.read("stack.hdf5")
>>> result = fclib.solve(problem, tol=1e-8)
>>> fclib.merit(problem, result.solution).error
"""

import importlib
import typing

from fclib._batch import BatchResult, solve_batch
from fclib._batch_derivatives import BatchGradient, BatchTangent, jvp_batch, vjp_batch
from fclib._batch_global import solve_batch_global
from fclib._core import (
    ChainMethod,
    Error,
    FileError,
    GlobalProblem,
    GlobalRollingProblem,
    GlobalSpinProblem,
    Islands,
    LocalProblem,
    LocalRollingProblem,
    LocalSpinProblem,
    MatrixInfo,
    Merit,
    Monitor,
    OptionError,
    OptionInfo,
    ProblemError,
    ProblemInfo,
    Result,
    SequenceWriter,
    Solution,
    SolverInfo,
    UnsuitableError,
    chain_methods,
    component_order,
    contact_merits,
    contents,
    left_out,
    merge,
    merit,
    merit_1,
    read,
    read_attributes,
    read_guesses,
    read_siconos,
    read_solution,
    read_solutions,
    step_path,
    steps,
    sync_files,
    write,
    write_attributes,
    write_guesses,
    write_siconos,
    write_solution,
    write_solutions,
)
from fclib._core import version as __version__
from fclib._derivatives import Gradient, Tangent, jvp, vjp
from fclib._device import DeviceBatchResult
from fclib._digest import digest
from fclib._geometry import Bodies, Contacts
from fclib._registry import Option, SolverError, find_solver, solver, solvers
from fclib._sequence import Sequence
from fclib._solve import Problem, solve
from fclib._workspace import Workspace

if typing.TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from fclib.collections import Collection, Step


def collection(name: str = "rt444", folder: "str | Path | None" = None) -> "Collection":
    """The problems of a set or a family, as a lazy sequence; each is built on demand.

    Args:
        name: a set or a family, as ``fclib collection list`` prints them.
        folder: folder of the problems; by default the user's cache, or the folder in
            FCLIB_COLLECTION.

    Raises:
        KeyError: there is no such set or family.
    """
    from fclib.collections import Collection

    return Collection(name, folder)


def load(
    name: str,
    form: str | None = None,
    folder: "str | Path | None" = None,
    *,
    step: int | None = None,
) -> Problem:
    """One problem of the collection, for example ``fclib.load("rt444/KaplasTower/0100")``.

    With a step, it is that of a sequence: ``fclib.load("run.h5", step=17)``.

    It is read from the user's folder; a missing family is built, in about a minute, or fetched from
    FCLIB_COLLECTION_URL. Those of the set ``tiny`` come with the package.

    Args:
        name: SET/FAMILY/NUMBER.
        form: "global" or "local"; by default the global one of a problem that has both.
        folder: as in ``collection``.
        step: the number of a step; ``name`` is the file of a sequence then.

    Raises:
        KeyError: there is no such problem.
        ValueError: the form is neither.
        FileError: the sequence cannot be read.
        IndexError: it has no such step.
    """
    if step is not None:
        return Sequence(name)[step]
    from fclib import collections

    return collections.load(name, form, folder)


def sequence(
    name: str, folder: "str | Path | None" = None, form: str | None = None
) -> "Iterator[Step]":
    """The problems of a family in the order of their steps, each with a guess from the one before.

    >>> for step in fclib.sequence("rt444/KaplasTower"):
    ...     result = fclib.solve(step.problem, guess=step.guess())

    Args:
        name: a family, as ``fclib collection list`` prints them, or the file of a sequence.
        folder: as in ``collection``.
        form: "global" or "local"; by default the global one of problems that have both.

    Raises:
        KeyError: there is no such family.
        FileError: the file cannot be read.
        ValueError: the name is a set of several families.
    """
    from fclib import collections

    return collections.sequence(name, folder, form)


def profile(store: "str | Path", **options: typing.Any) -> typing.Any:
    """The performance profile of a store of ``fclib bench``, as a figure for a notebook.

    Args:
        store: the file.
        options: tol, solvers, metric, own_set, weigh, as ``fclib.notebook.profile`` has them.

    Raises:
        ValueError: there is no such store, or nothing in it to compare.
        ImportError: Plotly is missing.
    """
    return importlib.import_module("fclib.notebook").profile(store, **options)


__all__ = [
    "BatchGradient",
    "BatchResult",
    "BatchTangent",
    "Bodies",
    "ChainMethod",
    "Contacts",
    "DeviceBatchResult",
    "Error",
    "FileError",
    "GlobalProblem",
    "GlobalRollingProblem",
    "GlobalSpinProblem",
    "Gradient",
    "Islands",
    "LocalProblem",
    "LocalRollingProblem",
    "LocalSpinProblem",
    "MatrixInfo",
    "Merit",
    "Monitor",
    "Option",
    "OptionError",
    "OptionInfo",
    "Problem",
    "ProblemError",
    "ProblemInfo",
    "Result",
    "Sequence",
    "SequenceWriter",
    "Solution",
    "SolverError",
    "SolverInfo",
    "Tangent",
    "UnsuitableError",
    "Workspace",
    "__version__",
    "chain_methods",
    "collection",
    "component_order",
    "contact_merits",
    "contents",
    "digest",
    "find_solver",
    "jvp",
    "jvp_batch",
    "left_out",
    "load",
    "merge",
    "merit",
    "merit_1",
    "profile",
    "read",
    "read_attributes",
    "read_guesses",
    "read_siconos",
    "read_solution",
    "read_solutions",
    "sequence",
    "solve",
    "solve_batch",
    "solve_batch_global",
    "solver",
    "solvers",
    "step_path",
    "steps",
    "sync_files",
    "vjp",
    "vjp_batch",
    "write",
    "write_attributes",
    "write_guesses",
    "write_siconos",
    "write_solution",
    "write_solutions",
]

# messages and tracebacks show the names that users import
for _error in (Error, FileError, OptionError, ProblemError, SolverError, UnsuitableError):
    _error.__module__ = __name__
del _error
