"""The default solver solves what can be solved, and says honestly when it could not."""

import itertools
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import fclib
from ball_judge import judge
from fclib import _registry
from helpers import STORAGES, converged, dense, local_problem, planted_global, planted_local


def endless() -> fclib.LocalProblem:
    """Without a solution: two contacts push each other away, and the reactions grow."""
    W = np.kron([[1, -1], [-1, 1]], np.eye(3))
    return local_problem(W, [-1, 0, 0, -1, 0, 0], [0.5, 0.5])


def hard() -> fclib.LocalProblem:
    """Many iterations from a solution."""
    problem = planted_local(1, nc=30).problem
    assert isinstance(problem, fclib.LocalProblem)
    return problem


def assert_solved(problem: fclib.Problem, result: fclib.Result, tol: float = 1e-8) -> None:
    assert result.status == "converged"
    assert result.converged
    assert result.error <= tol
    assert judge(problem, result.solution).error <= tol * (1 + 1e-6)


# ---- problems with known solutions


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("mixed", [0, 3])
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("kind", ["local", "global"])
def test_planted_problems_are_solved(kind: str, d: int, mixed: int, storage: str) -> None:
    make = planted_local if kind == "local" else planted_global
    for seed in range(5):
        case = make(seed, d=d, nc=8, p=mixed, storage=storage)
        result = fclib.solve(case.problem)
        assert_solved(case.problem, result)
        assert (result.solution.v is None) == (kind == "local")
        assert result.solution.u is not None
        # contacts weakly coupled, friction moderate: the solution is unique
        np.testing.assert_allclose(result.solution.r, case.solution.r, atol=1e-5)
        merit = fclib.merit(case.problem, result.solution)
        assert (merit.open, merit.stick, merit.slide) == case.statuses


@pytest.mark.parametrize("tol", [1e-2, 1e-4, 1e-12])
def test_the_tolerance_is_kept(tol: float) -> None:
    for make in (planted_local, planted_global):
        case = make(3, nc=10)
        assert_solved(case.problem, fclib.solve(case.problem, tol=tol), tol)


@pytest.mark.parametrize(("d", "kind"), list(itertools.product([2, 3], ["local", "global"])))
def test_bilateral_constraints_hold(d: int, kind: str) -> None:
    make = planted_local if kind == "local" else planted_global
    problem = make(7, d=d, nc=5, p=4).problem
    solution = fclib.solve(problem, tol=1e-10).solution
    r, lam = solution.r, solution.l
    assert lam is not None
    local = (fclib.LocalProblem, fclib.LocalRollingProblem, fclib.LocalSpinProblem)
    if isinstance(problem, local):
        assert problem.s is not None
        residual = dense(problem.V).T @ r + dense(problem.R) @ lam + problem.s
    else:
        v = solution.v
        assert v is not None
        assert problem.b is not None
        residual = dense(problem.G).T @ v + problem.b
        dynamics = dense(problem.M) @ v - dense(problem.H) @ r - dense(problem.G) @ lam - problem.f
        assert np.abs(dynamics).max() < 1e-9
    assert np.abs(residual).max() < 1e-9


def test_an_asymmetric_matrix_is_not_taken_for_a_symmetric_one() -> None:
    for seed, d in itertools.product(range(5), [2, 3]):
        case = planted_local(seed, d=d, nc=8, skew=1.0)
        W = dense(case.problem.W) if isinstance(case.problem, fclib.LocalProblem) else None
        assert W is not None
        assert np.abs(W - W.T).max() > 0.05
        assert_solved(case.problem, fclib.solve(case.problem))


def test_an_asymmetric_mass_is_not_taken_for_a_symmetric_one() -> None:
    rng = np.random.default_rng(1)
    M = np.eye(9) + 0.2 * rng.standard_normal((9, 9))
    problem = fclib.GlobalProblem(
        M=M, H=np.eye(9), f=rng.standard_normal(9), w=np.zeros(9), mu=[0.3, 0.2, 0.1]
    )
    result = fclib.solve(problem)
    assert_solved(problem, result)
    assert result.solution.v is not None
    np.testing.assert_allclose(M @ result.solution.v, result.solution.r + problem.f, atol=1e-12)


# ---- small cases, known by hand


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(
    ("q", "mu", "r"),
    [
        ([1, 2], 0.5, [0, 0]),  # it leaves
        ([-1, 0.2], 0.5, [1, -0.2]),  # it sticks
        ([-1, 2], 0.5, [1, -0.5]),  # it slides
        ([-1, -2], 0.5, [1, 0.5]),
        ([-1, 2], 0, [1, 0]),  # it slides without friction
        ([-1, 2], 1e3, [1, -2]),  # it cannot but stick
        ([0, 0], 0.5, [0, 0]),
        ([0, 1], 0.5, [0, 0]),  # it grazes
    ],
)
def test_one_contact(d: int, q: list[float], mu: float, r: list[float]) -> None:
    problem = local_problem(np.eye(d), [*q, 0.0][:d], [mu])
    result = fclib.solve(problem, tol=1e-12)
    assert_solved(problem, result, 1e-12)
    np.testing.assert_allclose(result.solution.r, [*r, 0.0][:d], atol=1e-11)


@pytest.mark.parametrize("mu", [0.0, 1e-6, 1e3])
def test_extreme_friction(mu: float) -> None:
    for d in (2, 3):
        case = planted_local(2, d=d, nc=6, mu=mu)
        assert_solved(case.problem, fclib.solve(case.problem))


def test_a_contact_without_compliance() -> None:
    for q in ([1, 0.5, 0], [0, 0, 0], [1, 0, 0]):
        case = planted_local(4, nc=2)
        assert isinstance(case.problem, fclib.LocalProblem)
        W = np.zeros((9, 9))
        W[3:, 3:] = dense(case.problem.W)
        problem = local_problem(W, [*q, *case.problem.q], [0.5, *case.problem.mu])
        result = fclib.solve(problem)
        assert_solved(problem, result)
        np.testing.assert_allclose(result.solution.r[3:], case.solution.r, atol=1e-6)


def test_no_compliance_at_all() -> None:
    problem = local_problem(np.zeros((6, 6)), [1, 0.5, 0, 0, 0, 0], [0.5, 0.5])
    result = fclib.solve(problem)
    assert_solved(problem, result)
    assert not result.solution.r[:3].any()


def test_no_contact_at_all() -> None:
    for d in (2, 3):
        problem = fclib.LocalProblem(spacedim=d, W=np.zeros((0, 0)), q=[], mu=[])
        result = fclib.solve(problem)
        assert_solved(problem, result)
        assert result.solution.r.shape == (0,)
        case = planted_global(1, d=d, nc=0, p=2)
        result = fclib.solve(case.problem)
        assert_solved(case.problem, result)
        assert result.solution.v is not None
        assert case.solution.v is not None
        np.testing.assert_allclose(result.solution.v, case.solution.v, atol=1e-12)


# ---- units


def scaled(problem: fclib.LocalProblem, mass: float, speed: float) -> fclib.LocalProblem:
    """The same problem in a unit of mass 1/mass, and of speed 1/speed."""
    return fclib.LocalProblem(
        spacedim=problem.spacedim, W=problem.W / mass, q=problem.q * speed, mu=problem.mu
    )


@pytest.mark.parametrize("speed", [1e-6, 1e-3, 1e3, 1e6])
def test_units_of_length_and_time_change_nothing(speed: float) -> None:
    for seed in range(3):
        problem = planted_local(seed, nc=10).problem
        assert isinstance(problem, fclib.LocalProblem)
        first, second = fclib.solve(problem), fclib.solve(scaled(problem, 1, speed))
        assert second.converged
        assert abs(first.iterations - second.iterations) <= 1
        np.testing.assert_allclose(second.solution.r / speed, first.solution.r, atol=1e-7)


@pytest.mark.parametrize("mass", [1e-6, 1e-3, 1e3, 1e6])
def test_units_of_mass_do_not_change_the_iterates(mass: float) -> None:
    # the error does change: it adds impulses and velocities
    for seed in range(3):
        problem = planted_local(seed, nc=10).problem
        assert isinstance(problem, fclib.LocalProblem)
        first = fclib.solve(problem, tol=0, max_iterations=6)
        second = fclib.solve(scaled(problem, mass, 1), tol=0, max_iterations=6)
        assert first.iterations == second.iterations == 6
        np.testing.assert_allclose(second.solution.r / mass, first.solution.r, atol=1e-10)


@pytest.mark.parametrize("mass", [1e-6, 1e-3, 1e3, 1e6])
def test_problems_in_any_unit_of_mass_are_solved(mass: float) -> None:
    for seed in range(3):
        problem = planted_local(seed, nc=10).problem
        assert isinstance(problem, fclib.LocalProblem)
        other = scaled(problem, mass, 1)
        # impulses of the size of mass round to 1e-16 of it
        tol = 1e-8 * max(1, mass)
        assert_solved(other, fclib.solve(other, tol=tol), tol)


@pytest.mark.parametrize(
    ("mass", "ends"),
    # near the bound it is the processor's luck whether the method's own error is small enough
    [(1e11, {"stalled", "inaccurate"}), (1e13, {"stalled"})],
)
def test_where_doubles_are_too_coarse_the_digit_is_said(mass: float, ends: set[str]) -> None:
    for seed in range(3):
        problem = planted_local(seed, nc=10).problem
        assert isinstance(problem, fclib.LocalProblem)
        other = scaled(problem, mass, 1)
        result = fclib.solve(other)
        assert result.status in ends
        assert "too coarse" in result.message
        most = float(result.message.split()[-1])
        assert result.error <= most
        # by the sizes of what is added up, and as it is: one digit of each reaction, up or down
        r = np.asarray(result.solution.r)
        signs = np.random.default_rng(seed).choice([-1, 1], r.size)
        moved = fclib.Solution(r=np.nextafter(r, signs * np.inf))
        assert 1e-3 * most < judge(other, moved).error < 2 * most
        assert fclib.solve(problem).message == ""
        assert fclib.solve(other, max_iterations=1, solver="nsgs").message == ""


# ---- limits, callback, warm start


def test_the_iteration_limit_is_kept_and_said() -> None:
    for limit in (1, 2, 7):
        result = fclib.solve(hard(), tol=1e-14, max_iterations=limit)
        assert result.status == "iteration_limit"
        assert not result.converged
        assert result.iterations == limit
        assert result.error > 1e-14
        assert result.error == pytest.approx(float(judge(hard(), result.solution).error), rel=1e-9)


def test_the_limit_holds_for_all_runs_of_the_solver_together() -> None:
    """The merit of a badly scaled global problem sends the solver back to work."""
    for seed in range(10):
        case = planted_global(seed, nc=5, p=3)
        for tol, limit in itertools.product([1e-13, 1e-15, 1e-16], [5, 50]):
            result = fclib.solve(case.problem, tol=tol, max_iterations=limit)
            assert result.iterations <= limit
            assert result.converged == (result.error <= tol)


def test_the_time_limit_is_kept_and_said() -> None:
    result = fclib.solve(endless(), "nsgs", max_iterations=10**15, time_limit=0.2)
    assert result.status == "time_limit"
    assert not result.converged
    assert result.error > 0.1
    assert result.iterations > 0


@pytest.mark.parametrize("limit", [5, 50, 500])
def test_a_problem_without_a_solution_is_not_solved(limit: int) -> None:
    penetrating = local_problem(np.zeros((3, 3)), [-1, 0, 0], [0.5])
    for problem in (endless(), penetrating):
        result = fclib.solve(problem, max_iterations=limit)
        assert result.status != "converged"
        assert result.error > 0.1
        assert result.error == pytest.approx(float(judge(problem, result.solution).error))


def test_the_callback_follows_the_iterations() -> None:
    history: list[tuple[int, float, float, str]] = []
    result = converged(hard(), callback=lambda *progress: history.append(progress))
    iterations, errors, times, stages = zip(*history, strict=True)
    assert stages[-1] == result.stages[-1].name
    assert iterations[0] == 0
    assert iterations[-1] == result.iterations
    assert list(iterations) == sorted(set(iterations))
    assert list(times) == sorted(times)
    assert errors[-1] == pytest.approx(result.error, rel=1e-6)
    assert errors[0] > errors[-1]


def test_the_callback_stops_the_solver() -> None:
    result = fclib.solve(hard(), tol=1e-14, callback=lambda iteration, *_: iteration < 3)
    assert result.status == "interrupted"
    assert not result.converged
    assert 3 <= result.iterations < 6
    assert result.error == pytest.approx(float(judge(hard(), result.solution).error), rel=1e-9)


@pytest.mark.parametrize("answer", [False, np.False_, 0])
def test_any_false_answer_of_the_callback_stops_the_solver(answer: Any) -> None:
    assert fclib.solve(hard(), tol=1e-14, callback=lambda *_: answer).status == "interrupted"
    converged(hard(), callback=lambda *_: np.bool_(True))


@pytest.mark.parametrize(
    ("wrong", "word"),
    [
        ({"solver": None}, "solver: None is not a name"),
        ({"tol": "small"}, "tol: 'small' is not a number"),
        ({"tol": np.ones(2)}, "tol: array.* is not a number"),
        ({"max_iterations": 1.5}, "max_iterations: 1.5 is not a 64-bit integer"),
        ({"max_iterations": 10**30}, "max_iterations: 10+ is not a 64-bit integer"),
        ({"time_limit": "1 s"}, "time_limit: '1 s' is not a number of seconds"),
        ({"callback": 3}, "callback: 3 is not a function"),
        ({"history": 1}, "history: 1 is not True or False"),
    ],
)
def test_an_argument_of_a_wrong_type_is_named(wrong: dict[str, Any], word: str) -> None:
    with pytest.raises(fclib.OptionError, match=word):
        fclib.solve(hard(), **wrong)


def test_what_is_no_problem_is_refused_by_name() -> None:
    with pytest.raises(fclib.ProblemError, match="problem: a ndarray is none of LocalProblem"):
        fclib.solve(np.eye(3))  # type: ignore[arg-type]


def test_a_type_error_of_the_callback_comes_through() -> None:
    with pytest.raises(TypeError, match="unsupported operand"):
        fclib.solve(hard(), callback=lambda iteration, *_: iteration + None)


def test_an_error_of_the_callback_comes_through() -> None:
    def fail(*_: object) -> None:
        raise LookupError("from the callback")

    with pytest.raises(LookupError, match="from the callback"):
        fclib.solve(hard(), callback=fail)


def test_a_guess_at_the_solution_needs_no_work() -> None:
    for case in (
        planted_local(1, nc=10),
        planted_local(1, nc=10, p=2),
        planted_global(1, nc=10),
        planted_global(1, d=2, nc=10, p=2),
    ):
        result = fclib.solve(case.problem, guess=case.solution)
        assert_solved(case.problem, result)
        assert result.iterations <= 1
        assert fclib.solve(case.problem).iterations > 1


def of_law(law: str) -> fclib.Problem:
    """A global problem of eight contacts."""
    if law in ("Coulomb", "planar", "rolling"):
        return planted_global(
            3, nc=8, d=2 if law == "planar" else 3, rolling=law == "rolling"
        ).problem
    base: Any = planted_global(3, nc=16, d=2).problem
    return fclib.GlobalSpinProblem(
        spacedim=4,
        M=base.M,
        H=base.H,
        f=base.f,
        w=base.w,
        mu=[0.5] * 8,
        mu_s=[0.1] * 8,
        coupled=int(law == "coupled"),
    )


@pytest.mark.parametrize("law", ["Coulomb", "planar", "rolling", "spin", "coupled"])
def test_a_guess_that_is_the_solution_is_returned(law: str) -> None:
    """It is judged as it is, before the problem is condensed."""
    problem = of_law(law)
    known = fclib.solve(problem, tol=1e-10)
    again = fclib.solve(problem, tol=1e-8, guess=known.solution)
    np.testing.assert_array_equal(again.solution.r, known.solution.r)
    assert (again.status, again.iterations, again.solver) == ("converged", 0, "auto")
    assert again.error == fclib.merit(problem, again.solution).error <= 1e-10
    assert_solved(problem, again)
    assert again.cpu_s > 0
    assert again.setup_s > 0
    # who listens hears of it
    heard = fclib.solve(problem, guess=known.solution, history=True).history
    assert heard is not None
    assert len(heard) > 0
    for off in (1e-6, 1e-2):
        near = fclib.Solution(r=known.solution.r * (1 + off))
        better = fclib.solve(problem, tol=1e-8, guess=near)
        assert_solved(problem, better)
        assert better.iterations > 0


def test_a_guess_that_moves_nothing_is_left_for_zero() -> None:
    """Two contacts press on a body from both sides; nothing else does."""
    H = sp.csc_array(np.array([[1.0, 0, 0, -1, 0, 0], [0, 1, 0, 0, 1, 0], [0, 0, 1, 0, 0, 1]]))
    for f in (np.zeros(3), np.array([0, 0, 1e-3])):
        problem = fclib.GlobalProblem(M=sp.eye_array(3), H=H, f=f, w=np.zeros(6), mu=[0.5, 0.5])
        squeezed = fclib.Solution(r=np.array([2.0, 0, -f[2] / 2, 2, 0, -f[2] / 2]))
        result = fclib.solve(problem, guess=squeezed)
        assert_solved(problem, result)
        np.testing.assert_array_equal(result.solution.r, squeezed.r if f.any() else np.zeros(6))


def test_a_guess_that_does_not_fit_is_an_error() -> None:
    problem = hard()
    half = np.zeros(problem.m)
    half[4] = np.inf
    for r, words in (
        (np.zeros(problem.m - 1), f"guess r: has {problem.m - 1} entries, expected m"),
        (np.zeros(3), "guess r: has 3 entries, expected m"),
        (half, r"guess r\[4\]: the value is not a finite number"),
    ):
        with pytest.raises(fclib.ProblemError, match=words):
            fclib.solve(problem, guess=fclib.Solution(r=r))
    with pytest.raises(fclib.ProblemError, match="guess r: has 0 entries, expected m"):
        fclib.solve(problem, guess=[])


def test_the_same_call_gives_the_same_bits() -> None:
    for case in (planted_local(1, nc=20), planted_global(2, nc=6, p=2)):
        first, second = fclib.solve(case.problem), fclib.solve(case.problem)
        assert first.iterations == second.iterations
        assert first.error == second.error
        np.testing.assert_array_equal(first.solution.r, second.solution.r)


def test_invalid_problems_are_not_solved() -> None:
    for problem in (
        local_problem(np.eye(3), [np.nan, 0, 0], [1.0]),
        fclib.LocalProblem(W=np.eye(3), q=np.zeros(6), mu=[1.0]),
    ):
        with pytest.raises(fclib.ProblemError):
            fclib.solve(problem)


@pytest.mark.parametrize("name", ["W", "V", "R"])
@pytest.mark.parametrize("form", [sp.coo_array, sp.csc_array, sp.csr_array])
def test_entries_whose_sum_is_infinite_are_bad_input(name: str, form: Any) -> None:
    places = ([0, 0, 1, 2], [0, 0, 1, 2])
    large = sp.coo_array(([1e308, 1e308, 1.0, 1.0], places), shape=(3, 3))
    if form is not sp.coo_array:  # its own conversion adds them up
        pointers = np.array([0, 2, 3, 4])
        large = form((large.data, np.array(places[0]), pointers), shape=(3, 3))
    eye: dict[str, Any] = {"W": np.eye(3), "V": np.eye(3), "R": -np.eye(3)}
    problem = fclib.LocalProblem(**(eye | {name: large}), q=-np.ones(3), mu=[1.0], s=np.zeros(3))
    words = rf"{name}/x\[0\]: the sum of the entries in row 0, column 0 is not a finite number"
    for use in (fclib.solve, fclib.LocalProblem.validate):
        with pytest.raises(fclib.ProblemError, match=words):
            use(problem)


def test_contradicting_bilateral_constraints_are_unsuitable() -> None:
    G = np.ones((9, 2))  # the same constraint twice
    rng = np.random.default_rng(1)
    problem = fclib.GlobalProblem(
        M=np.eye(9),
        H=np.eye(9, 3),
        G=G,
        f=rng.standard_normal(9),
        w=np.zeros(3),
        mu=[0.5],
        b=[0, 0],
    )
    result = converged(problem)
    assert result.solution.l is not None
    np.testing.assert_allclose(result.solution.l[0], result.solution.l[1])  # the shortest
    with pytest.raises(fclib.UnsuitableError, match=r"bilateral constraint \d: contradicts"):
        fclib.solve(problem.replace(b=[0, 1]))


# ---- options


def test_a_name_with_spaces_is_a_name(tmp_path: Path) -> None:
    """Of a registered solver, and of a plugin; what is no name has options behind it."""
    plugin = tmp_path / "my plugin.so"
    plugin.touch()
    assert _registry.parse_solver(f"plugin:{plugin}") == (f"plugin:{plugin}", {})
    assert _registry.parse_solver("plugin:a.so step=0.5") == ("plugin:a.so", {"step": "0.5"})
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(_registry._registered, "my solver", fclib.find_solver("nsgs"))
        assert _registry.parse_solver("my solver") == ("my solver", {})
    with pytest.raises(fclib.OptionError, match="'solver' is not of the form"):
        _registry.parse_solver("my solver")


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"solver": "no such solver"}, "no such solver"),
        ({"solver": ""}, "solver"),
        ({"solver": "nsgs relaxation"}, "'relaxation' is not of the form name=value"),
        ({"solver": "nsgs relaxatio=1"}, "relaxatio"),
        ({"solver": "nsgs 'relaxation=1"}, "quotation"),
        ({"no_such_option": 1}, "no_such_option"),
        ({"relaxation": "fast"}, "relaxation"),
        ({"relaxation": True}, "relaxation"),
        ({"relaxation": 0.0}, "relaxation"),
        ({"relaxation": 2.0}, "relaxation"),
        ({"relaxation": float("nan")}, "relaxation"),
        ({"relaxation": ""}, "relaxation"),
        ({"relaxation": [1.0]}, "relaxation"),
        ({"relaxation": None}, "relaxation"),
        ({"relaxation": list(range(1000))}, r"relaxation: \[0, 1, 2, 3, 4, 5, \.\.\.\] is not"),
        ({"options": {"relaxation": 1.2}}, r"options: is a table; .* a table as \*\*options"),
        ({"seed": 1.5}, "seed"),
        ({"seed": -1}, "seed"),
        ({"seed": 2**64}, "seed"),
        ({"shuffle": "sometimes"}, "shuffle"),
        ({"shuffle": 1}, "shuffle"),
        ({"tol": -1e-8}, "tol"),
        ({"tol": float("nan")}, "tol"),
        ({"tol": float("inf")}, "tol: inf is not a finite number of 0 or more"),
        ({"max_iterations": 0}, "max_iterations"),
        ({"max_iterations": -5}, "max_iterations"),
        ({"time_limit": 0.0}, "time_limit"),
        ({"time_limit": float("nan")}, "time_limit"),
    ],
    ids=str,
)
def test_a_wrong_option_is_named(arguments: dict[str, Any], named: str) -> None:
    with pytest.raises(fclib.OptionError, match=named) as caught:
        fclib.solve(hard(), **({"solver": "nsgs"} | arguments))
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, ValueError)


def test_an_unknown_name_comes_with_the_known_ones() -> None:
    with pytest.raises(fclib.OptionError, match="nsgs"):
        fclib.solve(hard(), "nsgz")
    with pytest.raises(fclib.OptionError, match="relaxation"):
        fclib.solve(hard(), "nsgs", relax=1.0)


@pytest.mark.parametrize(
    "options",
    [
        {"relaxation": 1},
        {"relaxation": np.float64(1.2)},
        {"relaxation": "1.2"},
        {"seed": np.int64(3), "shuffle": "once"},
        {"shuffle": "always", "seed": "7"},
        {"local_solver": "projection"},
        {"local_solver": "projection", "shuffle": "always", "relaxation": 0.8},
        {"error_interval": 5},
    ],
    ids=str,
)
def test_every_configuration_solves(options: dict[str, Any]) -> None:
    for make, d, p in itertools.product([planted_local, planted_global], [2, 3], [0, 2]):
        case = make(5, d=d, nc=8, p=p)
        assert_solved(case.problem, fclib.solve(case.problem, "nsgs", **options))


def test_a_solver_has_its_options_in_its_name_as_on_the_command_line() -> None:
    problem = hard()

    def result(solver: str, **options: Any) -> Any:
        return fclib.solve(problem, solver, tol=0, max_iterations=3, **options).solution.r

    apart = result("nsgs", relaxation=1.2)
    np.testing.assert_array_equal(result("nsgs relaxation=1.2"), apart)
    np.testing.assert_array_equal(result("nsgs relaxation=0.9", relaxation=1.2), apart)
    assert np.abs(result("nsgs") - apart).max() > 1e-6


def test_the_seed_chooses_the_order() -> None:
    def iterate(seed: int) -> Any:
        options: dict[str, Any] = {"shuffle": "always", "seed": seed}
        return fclib.solve(hard(), "nsgs", tol=0, max_iterations=3, **options).solution.r

    np.testing.assert_array_equal(iterate(1), iterate(1))
    assert np.abs(iterate(1) - iterate(2)).max() > 1e-6


# ---- signals and threads


def test_ctrl_c_stops_a_long_solve() -> None:
    code = (
        "import numpy as np, fclib\n"
        "W = np.kron([[1, -1], [-1, 1]], np.eye(3))\n"
        "problem = fclib.LocalProblem(W=W, q=[-1, 0, 0, -1, 0, 0], mu=[0.5, 0.5])\n"
        "told = False\n"
        "def tell(*_):\n"
        "    global told\n"
        "    if not told:\n"
        "        print('solving', flush=True)\n"
        "    told = True\n"
        "try:\n"
        "    fclib.solve(problem, 'nsgs', callback=tell, max_iterations=10**15)\n"
        "except KeyboardInterrupt:\n"
        "    print('interrupted', flush=True)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "solving\n"
        process.send_signal(signal.SIGINT)
        try:
            output, errors = process.communicate(timeout=300)
        except subprocess.TimeoutExpired:
            process.kill()
            raise
    assert output == "interrupted\n", errors
    assert process.returncode == 0


def test_python_goes_on_while_a_solver_runs() -> None:
    moments: list[float] = []
    done = threading.Event()

    def tick() -> None:
        while not done.wait(0.005):
            moments.append(time.monotonic())

    ticker = threading.Thread(target=tick)
    ticker.start()
    start = time.monotonic()
    result = fclib.solve(endless(), "nsgs", max_iterations=10**15, time_limit=0.5)
    end = time.monotonic()
    done.set()
    ticker.join()
    assert result.status == "time_limit"
    within = [moment for moment in moments if start + 0.05 < moment < end - 0.05]
    assert len(within) >= 3


def test_threads_solve_at_once_and_right() -> None:
    cases = [planted_local(seed, nc=20) for seed in range(6)]
    expected = [fclib.solve(case.problem, tol=1e-10).solution.r for case in cases]
    found: list[Any] = [None] * len(cases)

    def work(k: int) -> None:
        found[k] = fclib.solve(cases[k].problem, tol=1e-10, callback=lambda *_: True).solution.r

    threads = [threading.Thread(target=work, args=(k,)) for k in range(len(cases))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for r, right in zip(found, expected, strict=True):
        np.testing.assert_array_equal(r, right)


def test_the_child_of_a_fork_counts_its_own_time() -> None:
    code = """
import os, time
import numpy as np
import fclib

rng = np.random.default_rng(0)
A = rng.standard_normal((300, 300))
problem = fclib.LocalProblem(
    spacedim=3, W=A @ A.T, q=rng.standard_normal(300), mu=np.full(100, 0.5)
)
while time.thread_time() < 1:
    fclib.solve(problem, solver="nsgs", max_iterations=50)
child = os.fork()
if child == 0:
    start = time.thread_time()
    result = fclib.solve(problem, solver="nsgs", tol=1e-300, max_iterations=2000)
    os._exit(not result.cpu_s > 0.5 * (time.thread_time() - start))
raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
    done = subprocess.run([sys.executable, "-c", code], timeout=120, check=False)
    assert done.returncode == 0
