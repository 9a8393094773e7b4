"""A series of solves, as in a simulation."""

from __future__ import annotations

import math
import threading
from typing import Any

import numpy as np
import numpy.typing as npt

from fclib import _core
from fclib._solve import Problem, check_limits, check_problem, name_wrong_type, solve


class Workspace:
    """The state that a simulation keeps between solves: memory, and reactions of contacts.

    Local problems of Coulomb's law are solved without allocating memory, once the workspace has
    seen the largest of them. Problems of other formulations are solved by ``fclib.solve``, from the
    same guesses. A workspace is for one thread. A copy has the settings, and no memory.

    >>> workspace = fclib.Workspace(tol=1e-8)
    >>> result = workspace.solve(problem, contacts=names)

    Args:
        tol: bound on Merit.error.
        time_limit: [s] of wall-clock time for each solve.
    """

    def __init__(self, tol: float = 1e-8, *, time_limit: float | None = None) -> None:
        check_limits(tol, time_limit)
        self.tol = tol
        self._time_limit = time_limit
        self._core = _core.Workspace()
        self._lock = threading.Lock()

    @property
    def time_limit(self) -> float | None:
        """[s] of wall-clock time for each solve."""
        return self._time_limit

    @time_limit.setter
    def time_limit(self, value: float | None) -> None:
        check_limits(0, value)
        self._time_limit = value

    def __reduce__(self) -> tuple[Any, ...]:
        return _another, (type(self), self.tol, self.time_limit)

    def solve(self, problem: Problem, contacts: npt.ArrayLike | None = None) -> _core.Result:
        """Solve a problem, starting from the last reactions of its contacts.

        Args:
            problem: of any formulation.
            contacts: (nc,) whole numbers, names that contacts keep from one problem to the next.
                Without them a problem of as many contacts starts from the last one's reactions.

        Returns:
            As ``fclib.solve`` does; ``Result.solver`` is "workspace" if nothing else was needed.

        Raises:
            ProblemError: the data of the problem is not valid, there are not nc names, or another
                solve has not ended, as in another thread.
        """
        check_problem(problem)
        self._begin()
        try:
            return self._solve(problem, contacts)
        finally:
            self._lock.release()

    def _begin(self) -> None:
        """Take the lock. A solve lets go of the GIL, and handlers of signals may come in it."""
        if not self._lock.acquire(blocking=False):
            raise _core.ProblemError("workspace: is in use: another solve has not ended")

    def _solve(self, problem: Problem, contacts: npt.ArrayLike | None) -> _core.Result:
        names = None if contacts is None else _names(contacts, problem.nc)
        limit = math.inf if self.time_limit is None else self.time_limit
        if type(problem) is _core.LocalProblem and problem.p == 0:
            try:
                return self._core.solve(problem, names, self.tol, limit)
            except TypeError:
                name_wrong_type(tol=self.tol, time_limit=self.time_limit)
                raise
        r = np.zeros(problem.m)
        self._core.guess(problem.spacedim, names, r)
        guess = _core.Solution(r=r) if r.any() else None
        result = solve(problem, tol=self.tol, time_limit=self.time_limit, guess=guess)
        self._core.keep(problem.spacedim, names, result.solution.r)
        return result

    def forget(self) -> None:
        """Start from zero again; the memory stays. ProblemError if a solve has not ended."""
        self._begin()
        try:
            self._core.forget()
        finally:
            self._lock.release()

    def __repr__(self) -> str:
        return f"<Workspace: tol = {self.tol:g}>"


def _another(kind: type[Workspace], tol: float, time_limit: float | None) -> Workspace:
    return kind(tol, time_limit=time_limit)


def _names(contacts: npt.ArrayLike, nc: int) -> Any:
    try:
        names = np.asarray(contacts)
    except ValueError:
        raise _core.ProblemError(f"contacts: is not a list of nc = {nc} whole numbers") from None
    if names.shape != (nc,) or (names.dtype.kind not in "iu" and nc > 0):
        raise _core.ProblemError(
            f"contacts: expected nc = {nc} whole numbers, not {names.dtype} {names.shape}"
        )
    if names.dtype.kind == "u" and (names > np.iinfo(np.int64).max).any():
        raise _core.ProblemError("contacts: a name does not fit 64 bits with a sign")
    return np.ascontiguousarray(names, dtype=np.int64)
