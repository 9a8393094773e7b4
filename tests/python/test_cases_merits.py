"""What a merit must see: light bodies beside heavy ones, self-stress, small units, and rounding."""

import json
from typing import Any

import numpy as np
import pytest

import fclib
from ball_judge import judge
from helpers import Array, bodies, case, converged, dense, planted_global, planted_local
from helpers_cli import invoke

TOLERANCE = 1e-8
# the part that is wrong and by how much [m/s]
WRONG = {
    "cx03_merit_light_body": ("v", 50.0),
    "cx04_merit_light_body_contact": ("v", 50.0),
    "cx05_merit_selfstress": ("v", 710.0),
    "cx06_merit_u": ("u", 300.0),
}


# ---- the cases


@pytest.mark.parametrize("name", WRONG)
def test_a_stored_velocity_that_is_wrong_is_named(name: str) -> None:
    path = case(f"{name}.hdf5")
    part, size = WRONG[name]
    answer = invoke("check", path, "--json", code=1)
    record = json.loads(answer.stdout.strip().splitlines()[-1])
    assert record["status"] == "wrong"
    assert record["error"] > 0.5
    named = {one["part"]: one for one in record["mismatches"]}
    assert abs(named[part]["difference"]) == pytest.approx(size, rel=0.01)
    assert f"{part}[{named[part]['index']}]" in invoke("check", path, code=1).output


def test_a_grain_flung_up_is_not_ok() -> None:
    path = case("cx11_merit_small_grain.hdf5")
    answer = invoke("check", path, "--json", code=1)
    record = json.loads(answer.stdout)
    assert record["status"] == "wrong"
    assert record["scaled_natural"] == pytest.approx(3.99, abs=0.02)
    invoke("check", path, "--merit", "natural")


def test_small_masses_are_solved_in_both_merits() -> None:
    problem = fclib.read(case("cx12_converged_small_masses_1e-06.hdf5"))
    result = fclib.solve(problem, tol=TOLERANCE)
    merit = fclib.merit(problem, result.solution)
    assert (result.status == "converged") == (max(merit.natural, merit.scaled_natural) <= TOLERANCE)
    assert result.status == "converged"
    natural = converged(problem, tol=TOLERANCE, merit="natural")
    assert fclib.merit(problem, natural.solution).error_by("natural") <= TOLERANCE


# ---- planted


def light_and_heavy(ratio: float, contact: bool) -> tuple[fclib.GlobalProblem, fclib.Solution]:
    """Particles of mass 1 and `ratio` on a plane, falling; the light one may be free."""
    mass = np.repeat([1.0, ratio], 3)
    touching = (0, 1) if contact else (1,)
    H = np.zeros((6, 3 * len(touching)))
    for k, body in enumerate(touching):
        H[3 * body : 3 * body + 3, 3 * k : 3 * k + 3] = np.eye(3)
    f = mass * np.tile([-10.0, 1.0, 0.0], 2)
    problem = fclib.GlobalProblem(
        M=np.diag(mass), H=H, f=f, w=np.zeros(H.shape[1]), mu=np.full(len(touching), 0.5)
    )
    r = np.zeros(H.shape[1])
    for k, body in enumerate(touching):
        r[3 * k : 3 * k + 2] = mass[3 * body] * np.array([10.0, -1.0])
    v = (H @ r + f) / mass
    return problem, fclib.Solution(v=v, u=H.T @ v, r=r)


@pytest.mark.parametrize("ratio", [1.0, 1e3, 1e6, 1e9, 1e12])
@pytest.mark.parametrize("contact", [False, True])
def test_no_mass_ratio_hides_a_velocity(ratio: float, contact: bool) -> None:
    problem, solution = light_and_heavy(ratio, contact)
    assert fclib.merit(problem, solution).error <= 1e-12
    for index in range(6):
        v = solution.v + 1e-3 * (np.arange(6) == index)
        merit = fclib.merit(problem, fclib.Solution(v=v, r=solution.r))
        assert merit.dynamics > 1e-5, index
        named = fclib.contact_merits(problem, fclib.Solution(v=v, r=solution.r))["mismatches"]
        assert [(one["part"], one["index"]) for one in named] == [("v", index)]
        assert named[0]["difference"] == pytest.approx(1e-3, rel=1e-6)


@pytest.mark.parametrize("ratio", [1.0, 1e3, 1e6, 1e9, 1e12, 1e15, 1e18])
@pytest.mark.parametrize("local", [False, True])
def test_no_mass_ratio_hides_a_reaction(ratio: float, local: bool) -> None:
    given, exact = light_and_heavy(ratio, contact=True)
    problem: Any = given.condense() if local else given
    for guess in (exact.r, None):  # the solver's own error must see it too
        r = fclib.solve(problem, guess=guess, tol=TOLERANCE).solution.r
        np.testing.assert_allclose(r, exact.r, rtol=1e-6)
    for index in range(2):  # the light one is the first, and the second where all are equal
        r = exact.r.copy()
        r[3 * index] *= 2  # it flies up at the 10 m/s at which it fell
        assert fclib.merit(problem, r).scaled_natural > 0.5
        repaired = fclib.solve(problem, guess=r, tol=TOLERANCE).solution.r
        np.testing.assert_allclose(repaired, exact.r, rtol=1e-6)


@pytest.mark.parametrize("mu", [0.5, 1e2, 1e4, 1e8, 1e12])
@pytest.mark.parametrize("rolling", [False, True])
def test_no_friction_hides_a_penetration(mu: float, rolling: bool) -> None:
    d = 5 if rolling else 3
    law: Any = {"mu_r": [0.1]} if rolling else {}
    kind: Any = fclib.LocalRollingProblem if rolling else fclib.LocalProblem
    q = np.zeros(d)
    q[:2] = -1.0, 1.0
    problem = kind(spacedim=d, W=np.eye(d), q=q, mu=[mu], **law)
    assert fclib.merit(problem, np.zeros(d)).scaled_natural > 0.5
    result = converged(problem, tol=TOLERANCE)
    assert np.asarray(result.solution.u)[0] > -1e-6


def test_a_batch_sees_the_light_beside_the_heavy() -> None:
    given, exact = light_and_heavy(1e15, contact=True)
    problem = given.condense()
    wrong = exact.r * np.repeat([2.0, 1.0], 3)
    W, q = dense(problem.W), problem.q
    solved = fclib.solve_batch([W], [q], problem.mu, guess=[wrong], tol=TOLERANCE)
    np.testing.assert_allclose(np.ravel(solved.r), exact.r, rtol=1e-6)


def stressed(size: float, local: bool) -> tuple[Any, fclib.Solution]:
    """A body squeezed by `size` between two walls, and another one on the ground."""
    H = np.zeros((4, 6))
    H[0, 0], H[1, 1] = 1, 1  # d = 2: N, T of the first wall, the second, and the ground
    H[0, 2], H[1, 3] = -1, 1
    H[2, 4], H[3, 5] = 1, 1
    f = np.array([0.0, 0.0, -10.0, 1.0])
    problem: Any = fclib.GlobalProblem(
        spacedim=2, M=np.eye(4), H=H, f=f, w=np.zeros(6), mu=np.full(3, 0.5)
    )
    r = np.array([size, 0, size, 0, 10.0, -1.0])
    solution = fclib.Solution(v=np.zeros(4), u=np.zeros(6), r=r)
    if local:
        problem, solution = problem.condense(), fclib.Solution(u=np.zeros(6), r=r)
    return problem, solution


@pytest.mark.parametrize("size", [1.0, 1e6, 1e11])
def test_a_self_stress_hides_no_velocity(size: float) -> None:
    problem, solution = stressed(size, local=False)
    assert fclib.merit(problem, solution).error == 0
    wrong = fclib.Solution(v=[0, 0, 1e-3, 0], u=[0, 0, 0, 0, 1e-3, 0], r=solution.r)
    assert fclib.merit(problem, wrong).dynamics > 1e-5
    problem, solution = stressed(size, local=True)
    assert fclib.merit(problem, solution).error == 0
    for index in range(4, 6):
        u = 1e-3 * (np.arange(6) == index)
        assert fclib.merit(problem, fclib.Solution(u=u, r=solution.r)).kinematics > 1e-5


@pytest.mark.parametrize("kind", ["local", "global"])
@pytest.mark.parametrize("rolling", [False, True])
@pytest.mark.parametrize("p", [0, 3])
def test_what_a_solver_returns_passes_and_a_wrong_member_does_not(
    kind: str, rolling: bool, p: int
) -> None:
    make = planted_local if kind == "local" else planted_global
    for seed in range(3):
        problem = make(seed, d=5 if rolling else 3, p=p, rolling=rolling).problem
        for tol in (1e-6, 1e-10):
            result = fclib.solve(problem, tol=tol)
            merit = fclib.merit(problem, result.solution)
            assert merit.error <= tol
            assert max(merit.dynamics, merit.bilateral, merit.kinematics) <= 1e-13
        members = {name: getattr(result.solution, name) for name in ("v", "u", "r", "l")}
        for name in ("v", "u", "l"):
            if members[name] is None:
                continue
            for index in range(len(members[name])):
                changed = members[name] + 1e-5 * (np.arange(len(members[name])) == index)
                wrong = fclib.Solution(**members | {name: changed})
                assert fclib.merit(problem, wrong).error > 1e-8


@pytest.mark.parametrize("ratio", [1e3, 1e6])
def test_solutions_of_very_different_masses_pass(ratio: float) -> None:
    for seed in range(3):
        problem = bodies(seed, nc=8, ratio=ratio)
        result = fclib.solve(problem, tol=TOLERANCE)
        merit = fclib.merit(problem, result.solution)
        assert (merit.error <= TOLERANCE) == (result.status == "converged")
        assert merit.dynamics <= 1e-12
        assert merit.kinematics <= 1e-12


# ---- rounding


def tree_in_flight(seed: int) -> fclib.GlobalProblem:
    """A tree of bodies of which the base alone moves: its joints at their limits feel rounding."""
    rng = np.random.default_rng(seed)
    n = 6 + int(rng.integers(1, 12))
    root: Array = rng.standard_normal((n, n))
    M = root @ root.T + np.eye(n)
    v = np.zeros(n)
    v[:6] = 10 * rng.standard_normal(6)
    nc = int(rng.integers(1, n - 5))
    H = np.zeros((n, 3 * nc))
    H[6 + np.arange(nc), 3 * np.arange(nc)] = 1
    return fclib.GlobalProblem(M=M, H=H, f=M @ v, w=np.zeros(3 * nc), mu=np.zeros(nc))


@pytest.mark.parametrize("solver", ["auto", "nsgs", "nsn-ac", "admm", "ppa-nsn"])
def test_a_problem_with_nothing_to_do_is_solved(solver: str) -> None:
    for seed in range(20):
        problem = tree_in_flight(seed)
        assert np.linalg.norm(problem.condense().q) < 1e-12
        for tol in (1e-4, 1e-8, 1e-12):
            result = converged(problem, solver, tol)
            assert fclib.merit(problem, result.solution).error <= tol
            assert np.linalg.norm(result.solution.r) < 1e-9


def test_more_than_rounding_is_to_be_done() -> None:
    """A joint that closes at 1e-9 m/s is no rounding of 10 m/s."""
    problem = tree_in_flight(3)
    w = problem.w.copy()
    w[0] = -1e-9
    problem = problem.replace(w=w)
    assert fclib.merit(problem, fclib.Solution(r=np.zeros(problem.m))).natural > 0.5
    result = converged(problem, tol=1e-4)
    assert result.solution.r[0] > 0


# ---- units


def velocity(problem: Any, result: fclib.Result) -> Array:
    """The velocity at the contacts, recomputed."""
    return np.asarray(fclib.contact_merits(problem, result.solution)["u"])


@pytest.mark.parametrize("impulse", [1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9])
def test_the_tolerance_holds_in_any_units(impulse: float) -> None:
    for seed in range(3):
        problem = bodies(seed, nc=6)
        u = velocity(problem, fclib.solve(problem, tol=1e-12))
        scaled = problem.scaled(impulse=impulse)
        result = fclib.solve(scaled, tol=TOLERANCE)
        merit = fclib.merit(scaled, result.solution)
        assert result.status == "converged"
        assert max(merit.natural, merit.scaled_natural) <= TOLERANCE
        q = np.linalg.norm(problem.condense().q)
        assert np.linalg.norm(velocity(scaled, result) - u) <= 1e3 * TOLERANCE * q


def test_the_natural_map_alone_may_be_asked_for() -> None:
    problem = bodies(1, nc=6).scaled(impulse=1e-9)
    alone = converged(problem, tol=TOLERANCE, merit="natural")
    assert alone.error == fclib.merit(problem, alone.solution).error_by("natural")
    both = fclib.solve(problem, tol=TOLERANCE)
    assert both.error == fclib.merit(problem, both.solution).error
    assert alone.iterations <= both.iterations
    with pytest.raises(fclib.OptionError, match="merit"):
        fclib.solve(problem, merit="wrong")  # type: ignore[arg-type]
    with pytest.raises(fclib.OptionError, match="merit"):
        fclib.merit(problem, both.solution).error_by("wrong")


def grain_and_wall(unit: float) -> fclib.LocalProblem:
    """A grain on the ground, and ground beside a wall that goes away: nothing can move them."""
    W = np.zeros((6, 6))
    W[:3, :3] = np.eye(3)
    problem = fclib.LocalProblem(W=W, q=np.array([-1.0, 0, 0, 1, 0, 0]), mu=np.full(2, 0.5))
    return problem.scaled(impulse=unit)


@pytest.mark.parametrize("unit", [1e-12, 1e-9, 1.0, 1e9])
def test_what_nothing_can_move_hides_no_grain(unit: float) -> None:
    # its reaction is five times too large, and flings it up
    wrong = fclib.Solution(r=unit * np.array([5.0, 0, 0, 0, 0, 0]))
    problem = grain_and_wall(unit)
    merit = fclib.merit(problem, wrong)
    assert merit.scaled_natural == pytest.approx(4 / np.sqrt(2), rel=1e-6)
    assert merit.scaled_natural == pytest.approx(float(judge(problem, wrong).scaled_natural))
    for result in (fclib.solve(problem), fclib.Workspace().solve(problem)):
        assert result.converged
        assert result.solution.r[0] == pytest.approx(unit, rel=1e-7)
    W, q = np.array([dense(problem.W)]), np.array([problem.q])
    batch = fclib.solve_batch(W, q, 0.5)
    assert batch.r[0, 0] == pytest.approx(unit, rel=1e-7)


@pytest.mark.parametrize("size", [1.0, 2.0**30, 2.0**60])
def test_a_negative_trace_hides_nothing(size: float) -> None:
    # frictionless and indefinite: r_N = 0 closes, and any other pulls or closes faster
    W = size * np.diag([-1.0, 1.0, 1.0])
    problem = fclib.LocalProblem(W=W, q=[-1.0, 0, 0], mu=[0.0])
    for r in (0.0, 1e-3 / size, 1.0 / size):
        solution = fclib.Solution(r=[r, 0, 0])
        assert fclib.merit(problem, solution).scaled_natural > 0.5
    # both contacts open and pressed
    W = size * np.array([[3.0, 0, 0, 0], [0, -3.0, 0, 0], [0, 0, 3.0, 0], [0, 0, 0, -3.0]])
    problem = fclib.LocalProblem(spacedim=2, W=W, q=[1.0, 0, 1.0, 0], mu=[0.0, 0.0])
    pressed = fclib.Solution(r=np.array([1.0, 0, 1.0, 0]) / size)
    assert fclib.merit(problem, pressed).scaled_natural > 0.1
