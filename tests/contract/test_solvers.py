"""What every solver of the registry must keep, on every formulation it claims. None is named here.

Users' own solvers are held to it by the one of the documentation. External solvers, which keep
their own ways, are in tests/python/test_external.py.
"""

from __future__ import annotations

import functools
import inspect
import runpy
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from ball_judge import judge
from helpers import dense, planted_global, planted_local

OWN = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "python" / "own_solver.py"))
SOLVERS = {
    solver.name: solver for solver in fclib.solvers() if solver.origin in ("fclib", OWN["__name__"])
}
# those that say of themselves that they solve another problem than Coulomb's law
RELAXATIONS = {name for name, solver in SOLVERS.items() if solver.family == "relaxation"}
STATUSES = {
    "converged",
    "iteration_limit",
    "time_limit",
    "diverged",
    "inaccurate",
    "interrupted",
    "stalled",
    "infeasible",
}
EXACT = 1e-12


# ---- the formulations, and problems of each


@dataclass(frozen=True)
class Form:
    """A kind of contact: its components are N, T.., and R.. of one that rolls."""

    name: str
    d: int
    rolling: bool = False

    def contact(self, normal: float, tangential: float = 0.0) -> list[float]:
        """A vector of one contact, rolling as much as sliding, in the first of the directions."""
        result = [normal, tangential, *[0.0] * (self.d - 2)]
        if self.rolling:
            result[1 + (self.d - 1) // 2] = tangential
        return result

    def local(self, W: Any, q: Any, mu: Any) -> Any:
        """A local problem; rolling friction is a tenth of the other."""
        mu = np.asarray(mu, dtype=float)
        if self.rolling:
            return fclib.LocalRollingProblem(
                spacedim=self.d, W=np.asarray(W, float), q=q, mu=mu, mu_r=mu / 10
            )
        return fclib.LocalProblem(spacedim=self.d, W=np.asarray(W, float), q=q, mu=mu)

    def planted(self, seed: int, **what: Any) -> Any:
        return planted_local(seed, d=self.d, rolling=self.rolling, **what).problem

    def planted_global(self, seed: int, **what: Any) -> Any:
        return planted_global(seed, d=self.d, rolling=self.rolling, **what).problem


FORMS = (
    Form("planar", 2),
    Form("spatial", 3),
    Form("planar rolling", 3, rolling=True),
    Form("spatial rolling", 5, rolling=True),
)


def forms(solver: str) -> list[Form]:
    """Those that a solver claims."""
    entry = SOLVERS[solver]
    return [
        form
        for form in FORMS
        if form.d in (entry.rolling_dimensions if form.rolling else entry.dimensions)
    ]


@contextmanager
def about(*names: object) -> Iterator[None]:
    """Says in which of the cases of a loop an assertion failed."""
    try:
        yield
    except AssertionError as error:
        raise AssertionError(f"{', '.join(map(str, names))}: {error}") from error


def in_units(mass: float, speed: float) -> Callable[[Form], Any]:
    def make(form: Form) -> Any:
        problem = form.planted(3)
        return problem.replace(W=problem.W / mass, q=problem.q * speed)

    return make


def with_zero_block(form: Form) -> Any:
    problem, d = form.planted(4, nc=3), form.d
    W = np.zeros((4 * d, 4 * d))
    W[d:, d:] = dense(problem.W)
    return form.local(W, [*form.contact(1.0, 0.3), *problem.q], [0.5, *problem.mu])


def stretched(form: Form) -> Any:
    """Masses from 1e-6 to 1e6 in one problem."""
    problem = form.planted(5)
    scale = np.repeat(10.0 ** np.linspace(-3, 3, problem.nc), form.d)
    return problem.replace(W=scale[:, None] * dense(problem.W) * scale, q=problem.q * scale)


def one_contact(normal: float, tangential: float) -> Callable[[Form], Any]:
    return lambda form: form.local(np.eye(form.d), form.contact(normal, tangential), [0.5])


def no_friction(form: Form) -> Any:
    return form.planted(5, mu=0.0)


# problems that every solver should solve, and problems on which it need only be honest
SOLVABLE: dict[str, Callable[[Form], Any]] = {
    "sticks": one_contact(-1, 0.04),
    "slides": one_contact(-1, 2),
    "leaves": one_contact(1, 2),
    "leaves without friction": lambda form: form.local(
        np.eye(2 * form.d), form.contact(1) * 2, [0.0, 0.5]
    ),
    "one contact": lambda form: form.planted(1, nc=1),
    "two contacts": lambda form: form.planted(2, nc=2),
    "ten contacts": lambda form: form.planted(3, nc=10),
    "no contact": lambda form: form.local(np.zeros((0, 0)), [], []),
    "no friction": no_friction,
    "global": lambda form: form.planted_global(6),
    "mixed": lambda form: form.planted(7, p=3),
    "global mixed": lambda form: form.planted_global(8, p=3),
    "global without contact": lambda form: form.planted_global(9, nc=0),
    # the law and the error are homogeneous: q, u and r are multiplied together
    "fast": in_units(1, 1e12),
    "slow": in_units(1, 1e-12),
}
OTHERS: dict[str, Callable[[Form], Any]] = {
    "much friction": lambda form: form.planted(6, mu=1e3),
    "mixed friction": lambda form: form.local(
        np.eye(3 * form.d), form.contact(-1, 0.5) * 3, [0, 0.5, 1e3]
    ),
    "asymmetric": lambda form: form.planted(7, skew=1.0),
    "a zero block": with_zero_block,
    "limits of joints": lambda form: form.local(
        np.kron([[2, 1], [1, 2]], np.diag(form.contact(1))),
        [*form.contact(-1), *form.contact(2)],
        [0.0, 0.0],
    ),
    "all zero": lambda form: form.local(
        np.zeros((2 * form.d, 2 * form.d)), np.zeros(2 * form.d), [0.5, 0.5]
    ),
    "zero q": lambda form: form.local(np.eye(2 * form.d), np.zeros(2 * form.d), [0.5, 0.5]),
    # the same contact four times: W is singular, and r is not unique
    "redundant": lambda form: form.local(
        np.kron(np.ones((4, 4)), np.eye(form.d)), form.contact(-1, 0.2) * 4, [0.4] * 4
    ),
    "stretched": stretched,
    "heavy": in_units(1e12, 1),
    "light": in_units(1e-12, 1),
    "heavy and slow": in_units(1e9, 1e-9),
    "penetrates": lambda form: form.local(np.zeros((form.d, form.d)), form.contact(-1), [0.5]),
    "without a solution": lambda form: form.local(
        np.zeros((form.d, form.d)), form.contact(-1, 0.5), [0.5]
    ),
    "pushed apart": lambda form: form.local(
        np.kron([[1, -1], [-1, 1]], np.eye(form.d)), form.contact(-1) * 2, [0.5, 0.5]
    ),
}
PROBLEMS = SOLVABLE | OTHERS


@functools.cache
def problem_of(name: str, form: Form) -> Any:
    return PROBLEMS[name](form)


def assert_honest(problem: Any, result: fclib.Result, tol: float) -> None:
    """The result is whole, and says of itself what the equations say of it."""
    assert result.status in STATUSES
    solution = result.solution
    sizes = {"v": problem.n, "u": problem.m, "r": problem.m, "l": problem.p}
    for name, size in sizes.items():
        values = getattr(solution, name)
        if name == "r" or size > 0:
            assert values is not None, name
            assert values.shape == (size,), name
            assert np.isfinite(values).all(), name
        else:
            assert values is None, name
    error = fclib.merit(problem, solution).error
    assert result.error == error
    # the judge rounds as the numbers that it adds do
    impulses = float(np.linalg.norm(solution.r))
    q = float(np.linalg.norm(problem.q if hasattr(problem, "q") else problem.w))
    # ... and for a cone of two limits takes the difference of two such numbers
    most = 1.0 if hasattr(problem, "mu_r") else 1e-2
    rounding = min(most, EXACT * max(1.0, impulses / (q or 1.0)))
    assert error == pytest.approx(float(judge(problem, solution).error), rel=1e-9, abs=rounding)
    assert (result.status == "converged") == (error <= tol)
    assert result.converged == (result.status == "converged")
    assert result.iterations >= 0
    assert result.cpu_s >= 0
    assert result.setup_s >= 0


# ---- the contract


# all solvers of a problem in turn: the judge keeps what it knows of the last ones
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("problem", PROBLEMS)
def test_every_run_is_honest(solver: str, problem: str) -> None:
    """Solves what is easy, gives the same bits again, keeps its limits, tells what it reached."""
    easy = problem in SOLVABLE
    for form in forms(solver):
        data = problem_of(problem, form)

        def run(tol: float, limit: int | None, data: Any = data) -> fclib.Result:
            return fclib.solve(data, solver, tol, max_iterations=limit, time_limit=20)

        with about(form):
            first, second = (run(1e-6, None if easy else 300) for _ in range(2))
            assert first.solver == solver
            assert_honest(data, first, 1e-6)
            assert first.converged or not easy or solver in RELAXATIONS
            assert first.iterations == second.iterations
            np.testing.assert_array_equal(first.solution.r, second.solution.r)
            for tol, limit in ((1e-14, 1), (1e-14, 5), (1e-15, 300)):
                result = run(tol, limit)
                assert result.iterations <= limit
                assert_honest(data, result, tol)


@pytest.mark.parametrize("solver", SOLVERS)
def test_keeps_the_time_limit(solver: str) -> None:
    for form in forms(solver):
        data = problem_of("pushed apart", form)
        result = fclib.solve(data, solver, 1e-8, max_iterations=10**12, time_limit=0.01)
        with about(form):
            ended = {"time_limit", "diverged", "stalled", "infeasible"}
            assert result.status in ended or solver in RELAXATIONS
            assert_honest(data, result, 1e-8)


@pytest.mark.parametrize("solver", SOLVERS)
def test_stops_when_asked(solver: str) -> None:
    for form in forms(solver):
        data = problem_of("ten contacts", form)
        result = fclib.solve(data, solver, 1e-12, callback=lambda *_: False)
        with about(form):
            assert result.status == "interrupted"
            assert_honest(data, result, 1e-12)


@pytest.mark.parametrize("solver", SOLVERS)
def test_starts_from_the_guess(solver: str) -> None:
    for form in forms(solver):
        for make in (planted_local, planted_global):
            case = make(1, d=form.d, p=2, rolling=form.rolling)
            result = fclib.solve(case.problem, solver, 1e-10, guess=case.solution)
            with about(form, make.__name__):
                assert result.status == "converged"
                assert result.iterations <= 1


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("solver", SOLVERS)
def test_refuses_a_guess_that_is_not_finite(solver: str, value: float) -> None:
    for form in forms(solver):
        problem = problem_of("ten contacts", form)
        r = np.zeros(problem.m)
        r[-1] = value
        with pytest.raises(fclib.ProblemError, match="guess r"):
            fclib.solve(problem, solver, guess=fclib.Solution(r=r))


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_history_is_what_the_callback_was_told_and_the_result(solver: str) -> None:
    for form in forms(solver):
        problem = problem_of("ten contacts", form)
        told: list[tuple[int, float]] = []

        def callback(iteration: int, error: float, *_: object, told: Any = told) -> None:
            told.append((iteration, error))

        result = fclib.solve(problem, solver, 1e-6, history=True, callback=callback)
        with about(form):
            assert result.history is not None
            history = [(row["iteration"], row["error"]) for row in result.history]
            # then the result, whose error is that of the problem as given
            assert history[: len(told)] == told
            assert history[len(told) :] in ([], [(result.iterations, result.error)])
            assert history[-1][1] == result.error
            assert told
            iterations = [iteration for iteration, _ in told]
            assert iterations == sorted(iterations)
            assert 0 <= iterations[0] <= iterations[-1] <= result.iterations
            times = list(result.history["time"])
            assert times == sorted(times)
            if result.converged:
                # the solver's own last error is the judge's, but for rounding
                assert told[-1][1] <= 1e-6
            assert fclib.solve(problem, solver, 1e-6).history is None


@pytest.mark.parametrize(
    "solver", [n for n in SOLVERS if any(o.name == "seed" for o in SOLVERS[n].options)]
)
def test_a_seed_is_a_path(solver: str) -> None:
    choices: dict[str, Any] = {
        option.name: option.choices[-1] for option in SOLVERS[solver].options if option.choices
    }
    shuffled = {name: value for name, value in choices.items() if name == "shuffle"}
    for form in forms(solver):
        problem = problem_of("ten contacts", form)
        results = [
            fclib.solve(problem, solver, 1e-15, max_iterations=3, seed=seed, **shuffled)
            for seed in (1, 1, 2)
        ]
        first, same, other = (result.solution.r for result in results)
        np.testing.assert_array_equal(first, same)
        assert not np.array_equal(first, other)


@pytest.mark.parametrize("solver", SOLVERS)
def test_leaves_its_problem_and_its_guess_alone(solver: str) -> None:
    for form in forms(solver):
        problem = form.planted(1)
        guess = fclib.Solution(r=np.ones(problem.m))
        before = dense(problem.W), problem.q.copy()
        fclib.solve(problem, solver, guess=guess)
        np.testing.assert_array_equal(dense(problem.W), before[0])
        np.testing.assert_array_equal(problem.q, before[1])
        np.testing.assert_array_equal(guess.r, np.ones(problem.m))


@pytest.mark.parametrize(
    ("solver", "form"),
    [
        pytest.param(solver, form, id=f"{solver}-{form.name}")
        for solver in SOLVERS
        for form in FORMS
        if form not in forms(solver)
    ],
)
def test_other_forms_are_refused(solver: str, form: Form) -> None:
    for name in ("ten contacts", "mixed", "global", "no contact"):
        with pytest.raises(fclib.UnsuitableError, match=f"{solver} does not take"):
            fclib.solve(problem_of(name, form), solver)


# ---- the entry in the registry


def test_there_are_solvers_and_their_names_are_unique() -> None:
    names = [solver.name for solver in fclib.solvers()]
    assert {"auto", "nsgs", "my-pgs"} <= set(SOLVERS)
    assert len(set(names)) == len(names)
    assert names == sorted(names)


@pytest.mark.parametrize("solver", SOLVERS)
def test_says_what_it_is(solver: str) -> None:
    entry = SOLVERS[solver]
    for text in (entry.name, entry.family, entry.title, entry.citation):
        assert text.strip()
    assert entry.dimensions
    assert set(entry.dimensions) <= {2, 3}
    assert set(entry.rolling_dimensions) <= {3, 5}
    assert len(forms(solver)) == len(entry.dimensions) + len(entry.rolling_dimensions)
    names = [option.name for option in entry.options]
    assert len(set(names)) == len(names)
    reserved = set(inspect.signature(fclib.solve).parameters) - {"options"}
    assert not reserved & set(names)
    for option in entry.options:
        assert option.name.isidentifier()
        assert option.doc.strip(), option.name
        assert option.type in {"bool", "int", "float", "choice", "text"}
        assert bool(option.choices) == (option.type == "choice")
        assert option.unit or option.type in {"bool", "choice", "text"}, option.name


def problem_for(solver: str) -> Any:
    return problem_of("ten contacts", forms(solver)[0])


@pytest.mark.parametrize("solver", SOLVERS)
def test_defaults_are_accepted_as_values_and_as_text(solver: str) -> None:
    data = problem_for(solver)
    expected = fclib.solve(data, solver, 1e-6)
    values: dict[str, Any] = {option.name: option.default for option in SOLVERS[solver].options}
    texts = {name: str(value) for name, value in values.items()}
    texts = {name: {"True": "true", "False": "false"}.get(t, t) for name, t in texts.items()}
    for options in (values, texts):
        result = fclib.solve(data, solver, 1e-6, **options)
        np.testing.assert_array_equal(result.solution.r, expected.solution.r)
        assert result.iterations == expected.iterations


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_choice_and_the_ends_of_every_range_are_honest(solver: str) -> None:
    data = problem_for(solver)
    for option in SOLVERS[solver].options:
        values: list[Any] = list(option.choices)
        if option.type == "bool":
            values = [True, False]
        if option.type in {"int", "float"}:
            kind = int if option.type == "int" else float
            values = [kind(x) for x in (option.lowest, option.highest) if np.isfinite(x)]
        for value in values:
            result = fclib.solve(
                data, solver, max_iterations=100, time_limit=2, **{option.name: value}
            )
            assert_honest(data, result, 1e-8)


@pytest.mark.parametrize("solver", SOLVERS)
def test_wrong_options_are_refused_by_name(solver: str) -> None:
    data = problem_for(solver)
    with pytest.raises(fclib.OptionError, match="no_such_option"):
        fclib.solve(data, solver, no_such_option=1)
    for option in SOLVERS[solver].options:
        wrong: list[Any] = ["no such value", ""]
        if option.type in {"int", "float"}:
            wrong += [float("nan"), float("inf")]
            wrong += [option.lowest - 1] if np.isfinite(option.lowest) else []
            wrong += [option.highest * 2 + 1] if np.isfinite(option.highest) else []
        if option.type == "int":
            wrong.append(1.5)
        for value in wrong:
            with pytest.raises(fclib.OptionError, match=option.name):
                fclib.solve(data, solver, **{option.name: value})
