"""FCLIB: discrete frictional contact problems, and a test bench for the algorithms that solve them.

>>> import fclib
>>> problem = fclib.read("stack.hdf5")
>>> result = fclib.solve(problem, tol=1e-8)
>>> fclib.merit(problem, result.solution).error
"""

from fclib._core import (
    Error,
    FileError,
    GlobalProblem,
    GlobalRollingProblem,
    Islands,
    LocalProblem,
    LocalRollingProblem,
    MatrixInfo,
    Merit,
    Monitor,
    OptionError,
    OptionInfo,
    ProblemError,
    ProblemInfo,
    Result,
    Solution,
    SolverInfo,
    UnsuitableError,
    component_order,
    contents,
    merge,
    merit,
    read,
    read_guesses,
    read_siconos,
    read_solution,
    write,
    write_guesses,
    write_siconos,
    write_solution,
)
from fclib._core import version as __version__
from fclib._digest import digest
from fclib._registry import Option, SolverError, find_solver, solver, solvers
from fclib._solve import Problem, solve

__all__ = [
    "Error",
    "FileError",
    "GlobalProblem",
    "GlobalRollingProblem",
    "Islands",
    "LocalProblem",
    "LocalRollingProblem",
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
    "Solution",
    "SolverError",
    "SolverInfo",
    "UnsuitableError",
    "__version__",
    "component_order",
    "contents",
    "digest",
    "find_solver",
    "merge",
    "merit",
    "read",
    "read_guesses",
    "read_siconos",
    "read_solution",
    "solve",
    "solver",
    "solvers",
    "write",
    "write_guesses",
    "write_siconos",
    "write_solution",
]

# messages and tracebacks show the names that users import
for _error in (Error, FileError, OptionError, ProblemError, SolverError, UnsuitableError):
    _error.__module__ = __name__
del _error
