"""The merit agrees with the equations in ball arithmetic, in every form and storage."""

import itertools

import numpy as np
import pytest

import fclib
from ball_judge import judge
from fclib._solve import ERRORS, MERITS
from helpers import STORAGES, Planted, local_problem, planted_global, planted_local

FORMS = list(itertools.product(["local", "global"], [2, 3], [0, 3], STORAGES))


def planted(kind: str, seed: int, d: int, p: int, storage: str, nc: int = 6) -> Planted:
    make = planted_local if kind == "local" else planted_global
    return make(seed, d=d, nc=nc, p=p, storage=storage)


def assert_agree(problem: fclib.Problem, solution: fclib.Solution) -> None:
    """Every figure to 1e-12 of the largest number that it is made of, which is that of rounding."""
    merit, verdict = fclib.merit(problem, solution), judge(problem, solution)
    for name in ERRORS:
        assert getattr(merit, name) == pytest.approx(
            float(getattr(verdict, name)), rel=1e-12, abs=1e-12
        ), name
    for name in ("open", "stick", "slide"):
        assert getattr(merit, name) == getattr(verdict, name), name
    assert merit.open + merit.stick + merit.slide == problem.nc


def wrong_solution(problem: fclib.Problem, seed: int, **given: bool) -> fclib.Solution:
    """Random numbers; u and v are there where they are asked for."""
    rng = np.random.default_rng(seed)
    return fclib.Solution(
        v=rng.standard_normal(problem.n) if given.get("v") else None,
        u=rng.standard_normal(problem.m) if given.get("u") else None,
        r=rng.standard_normal(problem.m),
        l=rng.standard_normal(problem.p) if problem.p else None,
    )


@pytest.mark.parametrize(("kind", "d", "p", "storage"), FORMS)
def test_wrong_solutions_are_judged_by_the_equations(
    kind: str, d: int, p: int, storage: str
) -> None:
    for seed in range(5):
        problem = planted(kind, seed, d, p, storage).problem
        for given in ({}, {"u": True}, {"v": True}, {"u": True, "v": True}):
            if given.get("v") and kind == "local":
                continue
            solution = wrong_solution(problem, seed, **given)
            assert_agree(problem, solution)
            assert fclib.merit(problem, solution).error > 0.01


@pytest.mark.parametrize(("kind", "d", "p", "storage"), FORMS)
def test_exact_solutions_have_none(kind: str, d: int, p: int, storage: str) -> None:
    case = planted(kind, 11, d, p, storage)
    merit = fclib.merit(case.problem, case.solution)
    assert merit.error < 1e-14
    assert merit.natural < 1e-14
    assert max(merit.cone, merit.dual_cone, merit.complementarity) < 1e-13
    assert (merit.open, merit.stick, merit.slide) == case.statuses
    assert_agree(case.problem, case.solution)


@pytest.mark.parametrize(("kind", "d", "p", "storage"), FORMS)
def test_a_slightly_wrong_solution_has_a_slight_error(
    kind: str, d: int, p: int, storage: str
) -> None:
    case = planted(kind, 12, d, p, storage)
    noise = np.random.default_rng(1).standard_normal(case.problem.m)
    for size in (1e-3, 1e-6, 1e-9):
        solution = fclib.Solution(r=case.solution.r + size * noise, l=case.solution.l)
        merit = fclib.merit(case.problem, solution)
        assert 1e-3 * size < merit.error < 1e3 * size
        # differences of nearly equal numbers agree to the rounding of those
        assert merit.error == pytest.approx(float(judge(case.problem, solution).error), abs=1e-13)


@pytest.mark.parametrize(
    ("kind", "part"),
    [(k, p) for k in ("local", "global") for p in "vurl" if (k, p) != ("local", "v")],
)
def test_each_member_that_is_there_is_judged(kind: str, part: str) -> None:
    case = planted(kind, 5, 3, 2, "csr")
    members = {name: getattr(case.solution, name) for name in ("v", "u", "r", "l")}
    members[part] = members[part] + 1e-3
    merit = fclib.merit(case.problem, fclib.Solution(**members))
    assert merit.error > 1e-5
    assert_agree(case.problem, fclib.Solution(**members))


def test_the_storage_changes_nothing() -> None:
    for kind, d, p in itertools.product(["local", "global"], [2, 3], [0, 2]):
        merits = [
            fclib.merit(case.problem, wrong_solution(case.problem, 3))
            for case in (planted(kind, 2, d, p, storage) for storage in STORAGES)
        ]
        for name in ERRORS:
            values = [getattr(merit, name) for merit in merits]
            assert values == pytest.approx([values[0]] * len(values), rel=1e-12), name


def test_the_list_of_a_merits_numbers_has_all_of_them() -> None:
    assert tuple(name for name, it in vars(fclib.Merit).items() if type(it) is property) == MERITS


def test_condensation_keeps_the_natural_error_and_the_statuses() -> None:
    for d, p in itertools.product([2, 3], [0, 2]):
        problem = planted_global(4, d=d, p=p).problem
        assert isinstance(problem, fclib.GlobalProblem)
        solution = wrong_solution(problem, 8)
        whole, local = fclib.merit(problem, solution), fclib.merit(problem.condense(), solution)
        for name in ("natural", "scaled_natural", "cone", "dual_cone", "complementarity"):
            assert getattr(whole, name) == pytest.approx(getattr(local, name), rel=1e-10), name
        assert (whole.open, whole.stick, whole.slide) == (local.open, local.stick, local.slide)


def test_a_problem_without_q_has_an_absolute_error() -> None:
    problem = local_problem(np.eye(3), np.zeros(3), [0.5])
    for size in (1e-6, 1.0, 1e6):
        solution = fclib.Solution(r=np.array([0, size, 0]))
        assert_agree(problem, solution)
        assert fclib.merit(problem, solution).natural > 0.1 * size
    assert fclib.merit(problem, fclib.Solution(r=np.zeros(3))).error == 0


def test_a_huge_reaction_does_not_hide_a_velocity() -> None:
    # r - P_K(r - u^) in floating point is 0 where r + 1 rounds to r
    for d, normal in itertools.product([2, 3], [1e10, 1e17, 1e100]):
        problem = local_problem(np.zeros((d, d)), [-1, 0, 0][:d], [0.5])
        merit = fclib.merit(problem, fclib.Solution(r=[normal, 0, 0][:d]))
        assert merit.natural == pytest.approx(1, rel=1e-12)
        assert merit.scaled_natural == pytest.approx(1, rel=1e-12)


def test_a_problem_without_contacts_is_judged_by_its_dynamics() -> None:
    case = planted_global(1, nc=0, p=2)
    assert fclib.merit(case.problem, case.solution).error < 1e-14
    wrong = fclib.Solution(v=case.solution.v, r=np.zeros(0), l=np.ones(2))
    assert fclib.merit(case.problem, wrong).dynamics > 0.1
    assert_agree(case.problem, wrong)
    empty = fclib.LocalProblem(W=np.zeros((0, 0)), q=[], mu=[])
    assert fclib.merit(empty, fclib.Solution(r=[])).error == 0


@pytest.mark.parametrize("kind", ["local", "global"])
@pytest.mark.parametrize("mixed", [0, 2])
def test_what_does_not_fit_is_an_error_and_never_a_zero(kind: str, mixed: int) -> None:
    case = planted(kind, 1, 3, mixed, "csr")
    members = {name: getattr(case.solution, name) for name in ("v", "u", "r", "l")}
    for name, values in members.items():
        if values is None:
            # what the formulation does not have must not be there
            with pytest.raises(fclib.ProblemError, match=name):
                fclib.merit(case.problem, fclib.Solution(**members | {name: np.ones(1)}))
            continue
        for wrong in (values[:-1], np.append(values, 0.0)):
            with pytest.raises(fclib.ProblemError, match=f"/solution/{name}"):
                fclib.merit(case.problem, fclib.Solution(**members | {name: wrong}))
        for value in (np.nan, np.inf, -np.inf):
            spoilt = values.copy()
            spoilt[-1] = value
            with pytest.raises(fclib.ProblemError, match=f"/solution/{name}"):
                fclib.merit(case.problem, fclib.Solution(**members | {name: spoilt}))
    for needed in ("r", "l") if mixed else ("r",):
        with pytest.raises(fclib.ProblemError, match=needed):
            fclib.merit(case.problem, fclib.Solution(**members | {needed: np.zeros(0)}))


def test_a_missing_multiplier_is_an_error() -> None:
    for case in (planted_local(1, p=2), planted_global(1, p=2)):
        with pytest.raises(fclib.ProblemError, match="/solution/l"):
            fclib.merit(case.problem, fclib.Solution(r=case.solution.r))


def test_an_invalid_problem_has_no_merit() -> None:
    r = np.zeros(3)
    for problem in (
        fclib.LocalProblem(W=np.eye(3), q=[np.nan, 0, 0], mu=[1.0]),
        fclib.LocalProblem(W=np.eye(6), q=np.zeros(3), mu=[1.0, 1.0]),
        fclib.LocalProblem(W=np.eye(3), q=np.zeros(3), mu=[1.0], spacedim=5),
    ):
        with pytest.raises(fclib.ProblemError):
            fclib.merit(problem, fclib.Solution(r=r))


def test_a_singular_mass_is_unsuitable() -> None:
    for M in (
        np.zeros((3, 3)),
        np.diag([1.0, 1, -1]),
        np.array([[1.0, 2, 0], [2, 4, 0], [0, 0, 1]]),
    ):
        problem = fclib.GlobalProblem(M=M, H=np.eye(3), f=np.ones(3), w=np.zeros(3), mu=[1.0])
        for action in (
            lambda p=problem: fclib.merit(p, fclib.Solution(r=np.zeros(3))),
            lambda p=problem: fclib.solve(p),
            lambda p=problem: p.condense(),
        ):
            with pytest.raises(fclib.UnsuitableError, match="M"):
                action()
