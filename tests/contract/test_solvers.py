"""What every solver of the registry must keep, on every dimension it claims. None is named here.

Users' own solvers are held to it by the one of the documentation. External solvers, which keep
their own ways, are in tests/python/test_external.py.
"""

import inspect
import itertools
import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from helpers import dense, judge, local_problem, planted_global, planted_local

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


# ---- the problems


def in_units(mass: float, speed: float) -> Callable[[int], fclib.Problem]:
    def make(d: int) -> fclib.Problem:
        problem = planted_local(3, d=d).problem
        assert isinstance(problem, (fclib.LocalProblem, fclib.LocalRollingProblem))
        return fclib.LocalProblem(
            spacedim=d, W=problem.W / mass, q=problem.q * speed, mu=problem.mu
        )

    return make


def with_zero_block(d: int) -> fclib.Problem:
    problem = planted_local(4, d=d, nc=3).problem
    assert isinstance(problem, (fclib.LocalProblem, fclib.LocalRollingProblem))
    W = np.zeros((4 * d, 4 * d))
    W[d:, d:] = dense(problem.W)
    return local_problem(W, [1.0, *[0.3] * (d - 1), *problem.q], [0.5, *problem.mu])


def redundant(d: int) -> fclib.Problem:
    """The same contact four times: W is singular, and r is not unique."""
    return local_problem(
        np.kron(np.ones((4, 4)), np.eye(d)), ([-1.0] + [0.2] * (d - 1)) * 4, [0.4] * 4
    )


def stretched(d: int) -> fclib.Problem:
    """Masses from 1e-6 to 1e6 in one problem."""
    problem = planted_local(5, d=d).problem
    assert isinstance(problem, (fclib.LocalProblem, fclib.LocalRollingProblem))
    scale = np.repeat(10.0 ** np.linspace(-3, 3, problem.nc), d)
    return local_problem(scale[:, None] * dense(problem.W) * scale, problem.q * scale, problem.mu)


# problems that every solver should solve, and problems on which it need only be honest
SOLVABLE: dict[str, Callable[[int], fclib.Problem]] = {
    "sticks": lambda d: local_problem(np.eye(d), [-1, 0.2, 0][:d], [0.5]),
    "slides": lambda d: local_problem(np.eye(d), [-1, 2, 0][:d], [0.5]),
    "leaves": lambda d: local_problem(np.eye(d), [1, 2, 0][:d], [0.5]),
    "leaves without friction": lambda d: local_problem(
        np.eye(2 * d), ([1.0] + [0.0] * (d - 1)) * 2, [0.0, 0.5]
    ),
    "one contact": lambda d: planted_local(1, d=d, nc=1).problem,
    "two contacts": lambda d: planted_local(2, d=d, nc=2).problem,
    "ten contacts": lambda d: planted_local(3, d=d, nc=10).problem,
    "no contact": lambda d: fclib.LocalProblem(spacedim=d, W=np.zeros((0, 0)), q=[], mu=[]),
    "no friction": lambda d: planted_local(5, d=d, mu=0.0).problem,
    "global": lambda d: planted_global(6, d=d).problem,
    "mixed": lambda d: planted_local(7, d=d, p=3).problem,
    "global mixed": lambda d: planted_global(8, d=d, p=3).problem,
    "global without contact": lambda d: planted_global(9, d=d, nc=0).problem,
}
OTHERS: dict[str, Callable[[int], fclib.Problem]] = {
    "much friction": lambda d: planted_local(6, d=d, mu=1e3).problem,
    "mixed friction": lambda d: local_problem(
        np.eye(3 * d), ([-1.0] + [0.5] * (d - 1)) * 3, [0, 0.5, 1e3]
    ),
    "asymmetric": lambda d: planted_local(7, d=d, skew=1.0).problem,
    "a zero block": with_zero_block,
    "limits of joints": lambda d: local_problem(
        np.kron([[2, 1], [1, 2]], np.diag([1.0] + [0.0] * (d - 1))),
        ([-1.0] + [0.0] * (d - 1)) + ([2.0] + [0.0] * (d - 1)),
        [0.0, 0.0],
    ),
    "all zero": lambda d: local_problem(np.zeros((2 * d, 2 * d)), np.zeros(2 * d), [0.5, 0.5]),
    "zero q": lambda d: local_problem(np.eye(2 * d), np.zeros(2 * d), [0.5, 0.5]),
    "redundant": redundant,
    "stretched": stretched,
    "heavy": in_units(1e12, 1),
    "light": in_units(1e-12, 1),
    "fast": in_units(1, 1e12),
    "slow": in_units(1, 1e-12),
    "heavy and slow": in_units(1e9, 1e-9),
    "penetrates": lambda d: local_problem(np.zeros((d, d)), [-1, 0, 0][:d], [0.5]),
    "without a solution": lambda d: local_problem(np.zeros((d, d)), [-1, 0.5, 0][:d], [0.5]),
    "pushed apart": lambda d: local_problem(
        np.kron([[1, -1], [-1, 1]], np.eye(d)), ([-1.0] + [0] * (d - 1)) * 2, [0.5, 0.5]
    ),
}
PROBLEMS = SOLVABLE | OTHERS

RUNS = [
    pytest.param(solver, d, problem, id=f"{solver}-{d}d-{problem}")
    for solver, problem in itertools.product(SOLVERS, PROBLEMS)
    for d in SOLVERS[solver].dimensions
]


def assert_honest(problem: fclib.Problem, result: fclib.Result, tol: float) -> None:
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
    q = (
        problem.q
        if isinstance(problem, (fclib.LocalProblem, fclib.LocalRollingProblem))
        else problem.w
    )
    rounding = min(1e-2, EXACT * max(1.0, impulses / (float(np.linalg.norm(q)) or 1.0)))
    assert error == pytest.approx(judge(problem, solution).error, rel=1e-9, abs=rounding)
    assert (result.status == "converged") == (error <= tol)
    assert result.converged == (result.status == "converged")
    assert result.iterations >= 0
    assert result.cpu_s >= 0
    assert result.setup_s >= 0


# ---- the contract


@pytest.mark.parametrize(("solver", "d", "problem"), RUNS)
def test_says_what_the_merit_says(solver: str, d: int, problem: str) -> None:
    data = PROBLEMS[problem](d)
    for tol in (1e-4, 1e-8, 1e-15):
        result = fclib.solve(data, solver, tol, max_iterations=300, time_limit=2)
        assert result.solver == solver
        assert_honest(data, result, tol)


@pytest.mark.parametrize(
    ("solver", "d", "problem"), [run for run in RUNS if run.values[2] in SOLVABLE]
)
def test_solves_what_is_easy(solver: str, d: int, problem: str) -> None:
    data = SOLVABLE[problem](d)
    result = fclib.solve(data, solver, 1e-6, time_limit=20)
    assert_honest(data, result, 1e-6)
    assert result.status == "converged" or solver in RELAXATIONS


@pytest.mark.parametrize(("solver", "d", "problem"), RUNS)
def test_keeps_the_iteration_limit(solver: str, d: int, problem: str) -> None:
    data = PROBLEMS[problem](d)
    for limit in (1, 5):
        result = fclib.solve(data, solver, 1e-14, max_iterations=limit, time_limit=2)
        assert result.iterations <= limit
        assert_honest(data, result, 1e-14)


@pytest.mark.parametrize("solver", SOLVERS)
def test_keeps_the_time_limit(solver: str) -> None:
    for d in SOLVERS[solver].dimensions:
        data = OTHERS["pushed apart"](d)
        result = fclib.solve(data, solver, 1e-8, max_iterations=10**12, time_limit=0.05)
        ended = {"time_limit", "diverged", "stalled", "infeasible"}
        assert result.status in ended or solver in RELAXATIONS
        assert_honest(data, result, 1e-8)


@pytest.mark.parametrize("solver", SOLVERS)
def test_stops_when_asked(solver: str) -> None:
    for d in SOLVERS[solver].dimensions:
        data = PROBLEMS["ten contacts"](d)
        result = fclib.solve(data, solver, 1e-12, callback=lambda *_: False)
        assert result.status == "interrupted"
        assert_honest(data, result, 1e-12)


@pytest.mark.parametrize(("solver", "d", "problem"), RUNS)
def test_the_same_call_gives_the_same_bits(solver: str, d: int, problem: str) -> None:
    data = PROBLEMS[problem](d)
    first, second = (fclib.solve(data, solver, 1e-6, max_iterations=50) for _ in range(2))
    assert first.iterations == second.iterations
    np.testing.assert_array_equal(first.solution.r, second.solution.r)


@pytest.mark.parametrize("solver", SOLVERS)
def test_starts_from_the_guess(solver: str) -> None:
    for d, make in itertools.product(SOLVERS[solver].dimensions, (planted_local, planted_global)):
        case = make(1, d=d, p=2)
        result = fclib.solve(case.problem, solver, 1e-10, guess=case.solution)
        assert result.status == "converged"
        assert result.iterations <= 1


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("solver", SOLVERS)
def test_refuses_a_guess_that_is_not_finite(solver: str, value: float) -> None:
    for d in SOLVERS[solver].dimensions:
        problem = PROBLEMS["ten contacts"](d)
        r = np.zeros(problem.m)
        r[-1] = value
        with pytest.raises(fclib.ProblemError, match="guess r"):
            fclib.solve(problem, solver, guess=fclib.Solution(r=r))


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_history_is_what_the_callback_was_told(solver: str) -> None:
    for d in SOLVERS[solver].dimensions:
        problem = PROBLEMS["ten contacts"](d)
        told: list[tuple[int, float]] = []

        def callback(iteration: int, error: float, *_: object, told: Any = told) -> None:
            told.append((iteration, error))

        result = fclib.solve(problem, solver, 1e-6, history=True, callback=callback)
        assert result.history is not None
        assert [(row["iteration"], row["error"]) for row in result.history] == told
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


@pytest.mark.parametrize("speed", [1e-12, 1e12])
@pytest.mark.parametrize("solver", SOLVERS)
def test_solves_in_any_unit_of_speed(solver: str, speed: float) -> None:
    # the law and the error are homogeneous: q, u and r are multiplied together
    for d in SOLVERS[solver].dimensions:
        problem = in_units(1, speed)(d)
        result = fclib.solve(problem, solver, 1e-6, time_limit=20)
        assert_honest(problem, result, 1e-6)
        assert result.converged or solver in RELAXATIONS


@pytest.mark.parametrize(
    "solver", [n for n in SOLVERS if any(o.name == "seed" for o in SOLVERS[n].options)]
)
def test_a_seed_is_a_path(solver: str) -> None:
    choices: dict[str, Any] = {
        option.name: option.choices[-1] for option in SOLVERS[solver].options if option.choices
    }
    shuffled = {name: value for name, value in choices.items() if name == "shuffle"}
    for d in SOLVERS[solver].dimensions:
        problem = PROBLEMS["ten contacts"](d)
        results = [
            fclib.solve(problem, solver, 1e-15, max_iterations=3, seed=seed, **shuffled)
            for seed in (1, 1, 2)
        ]
        first, same, other = (result.solution.r for result in results)
        np.testing.assert_array_equal(first, same)
        assert not np.array_equal(first, other)


@pytest.mark.parametrize("solver", SOLVERS)
def test_leaves_its_problem_and_its_guess_alone(solver: str) -> None:
    for d in SOLVERS[solver].dimensions:
        problem = planted_local(1, d=d).problem
        assert isinstance(problem, (fclib.LocalProblem, fclib.LocalRollingProblem))
        guess = fclib.Solution(r=np.ones(problem.m))
        before = dense(problem.W), problem.q.copy()
        fclib.solve(problem, solver, guess=guess)
        np.testing.assert_array_equal(dense(problem.W), before[0])
        np.testing.assert_array_equal(problem.q, before[1])
        np.testing.assert_array_equal(guess.r, np.ones(problem.m))


@pytest.mark.parametrize("solver", SOLVERS)
def test_other_dimensions_are_refused(solver: str) -> None:
    for d in {2, 3} - set(SOLVERS[solver].dimensions):
        with pytest.raises(fclib.UnsuitableError, match=solver):
            fclib.solve(planted_local(1, d=d).problem, solver)


# ---- the entry in the registry


def test_there_are_solvers_and_their_names_are_unique() -> None:
    names = [solver.name for solver in fclib.solvers()]
    assert names
    assert len(set(names)) == len(names)
    assert names == sorted(names)


@pytest.mark.parametrize("solver", SOLVERS)
def test_says_what_it_is(solver: str) -> None:
    entry = SOLVERS[solver]
    for text in (entry.name, entry.family, entry.title, entry.citation):
        assert text.strip()
    assert entry.dimensions
    assert set(entry.dimensions) <= {2, 3}
    names = [option.name for option in entry.options]
    assert len(set(names)) == len(names)
    reserved = set(inspect.signature(fclib.solve).parameters) - {"options"}
    assert not reserved & set(names)
    for option in entry.options:
        assert option.name.isidentifier()
        assert option.doc.strip(), option.name
        assert option.type in {"bool", "int", "float", "choice"}
        assert bool(option.choices) == (option.type == "choice")
        assert option.unit or option.type in {"bool", "choice"}, option.name


def problem_for(solver: str) -> fclib.Problem:
    return planted_local(3, d=SOLVERS[solver].dimensions[0]).problem


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
