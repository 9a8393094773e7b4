"""The meaning of "solved" for campaigns, profiles, the site and the classes of problems."""

from __future__ import annotations

from typing import Final

# only these statuses count as solved: the error was recomputed, or the proof was checked
SOLVED: Final = ("converged", "infeasible")
UNSUITABLE: Final = "unsuitable"  # the solver does not take such problems
# what a user may do after a status, said by the command line and by pages
NEXT: Final = {
    "infeasible": "there is no solution, and the proof was checked; `fclib analyze` tells it",
    "stalled": "no solution was found; `fclib analyze` says whether one is known to exist. A larger"
    " tolerance or another solver may do",
    "diverged": "this solver does not solve the problem; try the solver auto",
    "iteration_limit": "the solver used all its iterations; try the solver auto, or a larger"
    " tolerance",
    "time_limit": "the time was too short; give a larger time limit or tolerance",
    "inaccurate": "the solver's own error is smaller than the true one; try the solver auto",
}
CLASSES: Final = ("easy", "hard", "open")


def is_solved(status: str | None) -> bool:
    """Whether a run with this status counts as solved.

    Its recomputed error is at most the tolerance, or the bench has checked its proof that there is
    no solution; both within the limits.
    """
    return status in SOLVED


def rating(solved: int, voters: int) -> str:
    """The class of a problem, by how many of the solvers that take it solve it; "" without any."""
    if not voters:
        return ""
    return "open" if not solved else "easy" if 2 * solved > voters else "hard"
