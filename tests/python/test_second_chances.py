"""What a solve falls back on: corrections, a second start, the best of what there was.

Each of these was taken out of the code once, and a test here failed.
"""

from __future__ import annotations

import itertools
import pickle
import sys
import time
from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import pytest

import fclib
from fclib import _core
from fclib.scenes.packing import Packing
from helpers import auto_chain, converged, local_problem, planted_global, planted_local, ran

Array: TypeAlias = npt.NDArray[np.float64]

ANSWERS: list[Array] = []  # of the solver below, one a call
ITERATIONS = 3  # that it reports in each call
ASKED: list[float] = []  # tolerances
GIVEN: list[Array] = []  # q


@fclib.solver("t-answers")
def answers(problem: fclib.LocalProblem, r: Array, monitor: fclib.Monitor) -> Array:
    """Says that it is done, with the answers given; the last one again and again."""
    ASKED.append(monitor.tolerance)
    GIVEN.append(np.array(problem.q))
    for _ in range(ITERATIONS):
        if monitor.stop(r):
            break
    return ANSWERS.pop(0) if len(ANSWERS) > 1 else ANSWERS[0]


@pytest.fixture
def case() -> Iterator[tuple[fclib.LocalProblem, Array]]:
    """A problem and its reactions."""
    planted = planted_local(3, nc=5)
    assert isinstance(planted.problem, fclib.LocalProblem)
    assert planted.solution.r is not None
    yield planted.problem, planted.solution.r
    ANSWERS.clear()


def off_by(r: Array, sizes: Sequence[float]) -> list[Array]:
    """Reactions with errors of about these sizes."""
    noise = np.random.default_rng(0).standard_normal(r.size)
    return [r + size * noise for size in sizes]


class Ticks:
    """A clock that goes on by a second whenever it is looked at."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self) -> float:
        self.count += 1
        return float(self.count)


# ---- corrections: a solver that is done too early is sent back to work


def test_the_best_of_the_corrections_is_returned(case: tuple[fclib.LocalProblem, Array]) -> None:
    problem, r = case
    ANSWERS[:] = off_by(r, [1e-3, 1e-5, 1e-2, 1e-1])
    best = ANSWERS[1]
    result = fclib.solve(problem, "t-answers")
    assert result.status == "inaccurate"
    np.testing.assert_array_equal(result.solution.r, best)
    assert result.error == fclib.merit(problem, best).error


def test_a_correction_may_solve(case: tuple[fclib.LocalProblem, Array]) -> None:
    problem, r = case
    ANSWERS[:] = off_by(r, [1e-3, 1e-5, 1e-12])
    assert fclib.solve(problem, "t-answers").converged


def test_the_callback_is_told_what_the_history_says(case: tuple[fclib.LocalProblem, Array]) -> None:
    problem, r = case
    ANSWERS[:] = off_by(r, [1e-3, 1e-4, 1e-12])
    told: list[tuple[int, float, float, str]] = []
    entry = fclib.find_solver("t-answers")
    result = _core.solve(
        problem, entry, 1e-8, 0, 1e9, {}, None, lambda *row: told.append(row), True, False,
        clock=Ticks(),
    )  # fmt: skip
    assert result.converged
    history = result.history
    assert history is not None
    rows = zip(history["iteration"], history["error"], history["time"], strict=True)
    reports = list(rows)
    assert reports[: len(told)] == [row[:3] for row in told]
    assert [error for _, error, _ in reports[len(told) :]] == [result.error]
    # three calls, whose iterations are counted on, and whose times too
    iterations = [iteration for iteration, *_ in told]
    assert iterations == sorted(iterations)
    assert iterations[-1] == result.iterations == 3 * (ITERATIONS - 1)
    times = [time for _, _, time, _ in told]
    assert times[0] > 0
    assert all(later > earlier for earlier, later in itertools.pairwise(times))


def test_the_limit_of_iterations_holds_for_corrections_too(
    case: tuple[fclib.LocalProblem, Array],
) -> None:
    problem, r = case
    for limit in (2, 3, 4, 5):  # each call would make two
        ANSWERS[:] = off_by(r, [1e-3, 1e-4, 1e-5])
        result = fclib.solve(problem, "t-answers", max_iterations=limit)
        assert result.status == "iteration_limit"
        assert result.iterations == limit


def test_time_is_counted_over_all_corrections(case: tuple[fclib.LocalProblem, Array]) -> None:
    problem, r = case
    ANSWERS[:] = off_by(r, [1e-3, 1e-4, 1e-12])
    entry = fclib.find_solver("t-answers")
    whole = Ticks()
    assert _core.solve(
        problem, entry, 1e-8, 0, 1e9, {}, None, None, False, False, clock=whole
    ).converged
    limit = whole.count / 2
    ANSWERS[:] = off_by(r, [1e-3, 1e-4, 1e-12])
    result = _core.solve(
        problem, entry, 1e-8, 0, limit, {}, None, None, False, False, clock=Ticks()
    )
    assert result.status == "time_limit"


def test_each_correction_asks_for_more(case: tuple[fclib.LocalProblem, Array]) -> None:
    problem, r = case
    ANSWERS[:] = off_by(r, [1e-3, 1e-5, 1e-6, 1e-12])
    ASKED.clear()
    assert fclib.solve(problem, "t-answers", tol=1e-8).converged
    assert ASKED[0] == 1e-8
    assert all(later < earlier for earlier, later in itertools.pairwise(ASKED))


def test_what_a_conversion_has_lost_is_given_to_the_solver() -> None:
    """Q of the solver becomes what gives the velocity of the problem as it was given."""
    case = planted_global(4, nc=4, p=2)
    r = np.asarray(case.solution.r)
    off = off_by(r, [1e-3])[0]
    ANSWERS[:] = [off, off, r]
    GIVEN.clear()
    assert fclib.solve(case.problem, "t-answers", tol=1e-11).converged
    first, second = GIVEN[0], GIVEN[1]
    problem: Any = case.problem
    exact = problem.condense().eliminate()
    assert np.linalg.norm(second - first) > 0
    # the velocity of a joint problem, to the last digits: what was lost is rounding alone
    assert np.linalg.norm(second - first) < 1e-10 * np.linalg.norm(exact.q)


# ---- what fails as the time ends


@fclib.solver("t-word")
def says(problem: fclib.LocalProblem, r: Array, monitor: fclib.Monitor) -> Array:
    """Gives a wrong answer and the word WORD, after it has looked at the clock for long."""
    while monitor.time_left > -1 and np.isfinite(monitor.time_left):
        pass
    monitor.status = WORD[0]
    return 1e6 + r


WORD = ["stalled"]


@pytest.mark.parametrize("word", ["stalled", "diverged"])
def test_what_fails_as_the_time_is_over_is_a_time_limit(
    case: tuple[fclib.LocalProblem, Array], word: str
) -> None:
    WORD[0] = word
    assert fclib.solve(case[0], "t-word").status == word
    entry = fclib.find_solver("t-word")
    result = _core.solve(case[0], entry, 1e-8, 0, 20.0, {}, None, None, False, False, clock=Ticks())
    assert result.status == "time_limit"


# ---- the last resort is what costs nothing


def test_a_solve_is_no_worse_than_no_reactions(case: tuple[fclib.LocalProblem, Array]) -> None:
    problem, r = case
    ANSWERS[:] = [1e6 * r]
    result = fclib.solve(problem, "t-answers")
    assert not result.solution.r.any()
    assert result.error == fclib.merit(problem, np.zeros(r.size)).error


def test_a_solve_is_no_worse_than_its_guess(case: tuple[fclib.LocalProblem, Array]) -> None:
    problem, r = case
    (guess,) = off_by(r, [1e-5])
    ANSWERS[:] = [1e6 * r]
    result = fclib.solve(problem, "t-answers", guess=guess)
    np.testing.assert_array_equal(result.solution.r, guess)
    assert result.error == fclib.merit(problem, guess).error
    # which may be all that is asked for
    ANSWERS[:] = [1e6 * r]
    assert fclib.solve(problem, "t-answers", tol=1e-3, guess=guess).converged


def test_what_is_returned_before_the_solver_starts_is_no_worse_than_nothing() -> None:
    case = planted_global(3, p=2)
    guess = fclib.Solution(r=1e6 * np.ones(case.problem.m))
    entry = fclib.find_solver("auto")
    judged = 0
    for limit in np.arange(0.5, 12.5):
        result = _core.solve(
            case.problem, entry, 1e-15, 0, limit, {}, guess, None, False, False, clock=Ticks()
        )
        if result.status == "time_limit" and result.iterations == 0 and np.isfinite(result.error):
            judged += 1
            assert not np.array_equal(result.solution.r, guess.r)
    assert judged > 0


def test_where_the_velocity_is_rounding_no_solver_is_asked() -> None:
    M, H = np.diag([3.0, 7, 11]), np.array([[0.1, 0.7, 0], [0.3, 0, 0.9], [0, 0.2, 0.6]])
    f = np.array([1.0, 2, 3])
    w = -(H.T @ (f / np.diag(M)))  # up to rounding
    ANSWERS[:] = [np.ones(3)]
    GIVEN.clear()
    result = converged(
        fclib.GlobalProblem(spacedim=3, M=M, H=H, f=f, w=w, mu=[0.5]), "t-answers", history=True
    )
    assert not GIVEN
    assert not result.solution.r.any()
    assert result.history is not None
    assert len(result.history) == 0


# ---- the chain of `auto` once more, from r = 0

NEWTON = ["newton : semismooth_newton from=best sweeps=0 limit=8"]


def test_a_chain_that_fails_from_a_guess_starts_again_from_nothing() -> None:
    again = 0
    for seed in range(20):
        problem: Any = planted_local(seed, nc=5).problem
        guess = 1e3 * np.random.default_rng(seed).standard_normal(problem.m)
        cold = fclib.solve(problem, chain=NEWTON)
        warm = fclib.solve(problem, chain=NEWTON, guess=guess)
        assert cold.converged
        assert warm.converged
        again += warm.stages[0].calls == 2
    assert again > 5


def test_the_better_of_both_starts_is_kept() -> None:
    problem: Any = planted_local(3, nc=5).problem
    chain = ["sweeps : gauss_seidel limit=3"]
    r = fclib.solve(problem, tol=1e-12).solution.r
    (guess,) = off_by(r, [1e-5])
    cold = fclib.solve(problem, chain=chain, tol=1e-12)
    warm = fclib.solve(problem, chain=chain, tol=1e-12, guess=guess)
    assert warm.stages[0].calls == 2
    assert warm.error < 0.9 * fclib.merit(problem, guess).error < cold.error


def test_a_stage_says_how_long_it_took() -> None:
    result = fclib.solve(planted_local(3, nc=30).problem, tol=1e-12)
    assert result.stages
    assert all(stage.time > 0 for stage in result.stages)
    assert all(stage.cpu_s > 0 for stage in result.stages)
    assert sum(stage.time for stage in result.stages) <= result.time
    assert sum(stage.cpu_s for stage in result.stages) <= 1.01 * result.cpu_s + 1e-4


def test_waiting_takes_time_and_no_cpu_time() -> None:
    problem = planted_local(3, nc=30).problem
    result = fclib.solve(problem, tol=1e-12, callback=lambda *_: time.sleep(0.01))
    assert result.time > 2 * result.cpu_s
    longest = max(result.stages, key=lambda stage: stage.time)
    assert longest.time > 2 * longest.cpu_s
    again = pickle.loads(pickle.dumps(result))
    assert (again.time, again.cpu_s) == (result.time, result.cpu_s)
    assert [stage.cpu_s for stage in again.stages] == [stage.cpu_s for stage in result.stages]
    plain = fclib.solve(problem, "nsgs", 1e-12)
    assert 0 < plain.cpu_s <= 1.01 * plain.time + 1e-4


def test_a_stage_counts_the_time_of_all_threads() -> None:
    problem: Any = Packing().of_size(2500, 0.0, 0)
    result = fclib.solve(problem, threads=2, chain="a : proximal_point limit=100")
    (stage,) = result.stages
    assert stage.factorisations > 0
    assert 0.9 * result.cpu_s < stage.cpu_s <= 1.01 * result.cpu_s


def test_reading_a_chain_is_not_the_solve() -> None:
    problem = local_problem(np.eye(3), [-1, 2, 0], [0.5])
    runs = [fclib.solve(problem, chain=auto_chain()) for _ in range(20)]
    assert min(run.cpu_s for run in runs) < 0.2 * min(run.setup_s for run in runs)


def test_the_first_solve_of_a_process_reads_no_table() -> None:
    """Its CPU time is less than that of reading the table, of which later solves have none."""
    code = """
import fclib, numpy as np
problem = fclib.LocalProblem(spacedim=3, W=np.eye(3), q=[-1.0, 2.0, 0.0], mu=[0.5])
first = fclib.solve(problem)
(text,) = (o.default for o in fclib.find_solver("auto").options if o.name == "chain")
print(first.cpu_s, fclib.solve(problem, chain=text).setup_s)
"""
    told = [ran(sys.executable, "-c", code) for _ in range(5)]
    first, reading = np.array([run.stdout.split() for run in told], dtype=float).min(axis=0)
    assert first < 0.5 * reading


def test_a_guess_that_overflows_is_left_out() -> None:
    problem = local_problem(np.eye(3), [-1, 2, 0], [0.5])
    result = converged(problem, guess=np.full(3, 1e300))
    assert all(stage.calls == 1 for stage in result.stages)


# ---- the best iterate, not the last one

SOLVERS = [
    one.name for one in fclib.solvers() if one.origin == "fclib" and one.name != "associated"
]


@pytest.mark.parametrize("solver", SOLVERS)
def test_what_ends_early_is_the_best_iterate_that_was_told(solver: str) -> None:
    rose = 0
    for seed, mu in itertools.product(range(4), (0.5, 5.0)):
        problem = planted_local(seed, nc=8, mu=mu).problem
        for limit in (3, 10, 30, 100):
            result = fclib.solve(problem, solver, 1e-13, max_iterations=limit, history=True)
            assert result.history is not None
            errors = np.asarray(result.history["error"])
            assert not errors.size or errors[-1] == result.error
            if errors.size > 1:  # the last one is of the result, those before it of iterates
                errors = errors[:-1]
            rose += bool(errors.size and errors[-1] > 1.1 * errors.min())
            # the solver's own errors are of the same problem, up to rounding
            assert result.error <= errors.min(initial=np.inf) * (1 + 1e-6) + 1e-12
    if solver in RISING:
        assert rose > 0  # else the test says nothing


RISING = ("apgd", "homotopy", "panagiotopoulos", "tresca")
