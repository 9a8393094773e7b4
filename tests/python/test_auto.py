"""The default solver: what it must solve, what it says of itself, what it must never claim.

Problems are made from bodies with a planted solution, so that each of them has one.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
import numpy.typing as npt
import pytest
import scipy.sparse as sp
from hypothesis import strategies as st

import fclib
from ball_judge import judge
from fclib import analysis, collections
from fclib.scenes.packing import Packing
from helpers import (
    auto_chain,
    bodies,
    converged,
    dense,
    last_resort,
    local_problem,
    planted_global,
    planted_local,
    planted_rolling,
    project,
)
from planted_judge import hard, planted

Array = npt.NDArray[np.float64]


def assert_honest(problem: fclib.Problem, result: fclib.Result, tol: float) -> None:
    verdict = judge(problem, result.solution)
    assert result.converged == (result.error <= tol)
    # the judge here takes no rounding off
    assert result.error == pytest.approx(float(verdict.error), rel=1e-3, abs=1e-10)
    if not result.converged:
        assert result.status in {"stalled", "inaccurate", "iteration_limit", "time_limit"}
    assert result.certificate is None


def assert_proven(problem: fclib.LocalProblem, result: fclib.Result) -> None:
    """Farkas: no r in K, however large it may be in practice, keeps all contacts from closing."""
    assert result.status == "infeasible"
    y = result.certificate
    assert y is not None
    assert (y >= 0).all()
    d = problem.spacedim
    normal = np.zeros((problem.nc, d))
    normal[:, 0] = y
    gain = -y @ problem.q[::d]
    assert gain > 0
    image = -(dense(problem.W).T @ normal.ravel()).reshape(-1, d)
    # distance from K*, whose projection is x + P_K(-x)
    distance = np.linalg.norm(project(-image, problem.mu))
    usual = np.linalg.norm(problem.q) / max(np.trace(dense(problem.W)) / problem.m, 1e-300)
    assert distance == 0 or gain / distance > 1e4 * usual


@hypothesis.settings(deadline=None, max_examples=60, derandomize=True)
@hypothesis.given(
    seed=st.integers(0, 2**32 - 1),
    nc=st.integers(1, 25),
    d=st.sampled_from([2, 3]),
    ratio=st.sampled_from([1.0, 1e2, 1e4]),
    mu=st.sampled_from([0.0, 0.05, 0.5, 1.0]),
    duplicated=st.integers(0, 1),
    boundary=st.booleans(),
)
def test_planted_bodies_are_solved(
    seed: int, nc: int, d: int, ratio: float, mu: float, duplicated: int, boundary: bool
) -> None:
    problem = bodies(seed, nc, d, ratio, mu, duplicated=duplicated, boundary=boundary)
    result = fclib.solve(problem, time_limit=20)
    assert_honest(problem, result, 1e-8)
    assert result.converged, (result, result.stages)


@hypothesis.settings(deadline=None, max_examples=40, derandomize=True)
@hypothesis.given(
    seed=st.integers(0, 2**32 - 1),
    nc=st.integers(1, 15),
    ratio=st.sampled_from([1e6, 1e8]),
    mu=st.sampled_from([3.0, 10.0, 100.0]),
    hyperstatic=st.booleans(),
    duplicated=st.integers(0, 3),
)
def test_never_a_wrong_claim(
    seed: int, nc: int, ratio: float, mu: float, hyperstatic: bool, duplicated: int
) -> None:
    problem = bodies(
        seed, nc, 3, ratio, mu, hyperstatic=hyperstatic, duplicated=min(nc, duplicated)
    )
    result = fclib.solve(problem, time_limit=5, chain=last_resort(400))
    assert_honest(problem, result, 1e-8)


@pytest.mark.parametrize("d", [2, 3])
def test_islands_are_solved_one_by_one(d: int) -> None:
    parts = [planted_local(seed, d=d, nc=5) for seed in range(4)]
    separating = local_problem(np.eye(d), [1.0] + [0.5] * (d - 1), [0.3])
    problems = [*(part.problem for part in parts), separating]
    size = sum(problem.m for problem in problems)
    W, q = np.zeros((size, size)), np.zeros(size)
    at = 0
    for problem in problems:
        assert isinstance(problem, fclib.LocalProblem)
        W[at : at + problem.m, at : at + problem.m] = dense(problem.W)
        q[at : at + problem.m] = problem.q
        at += problem.m
    mu = np.concatenate([problem.mu for problem in problems])
    whole = fclib.LocalProblem(spacedim=d, W=W, q=q, mu=mu)
    result = converged(whole, tol=1e-12)
    expected = np.concatenate([part.solution.r for part in parts] + [np.zeros(d)])
    np.testing.assert_allclose(result.solution.r, expected, atol=1e-9)


def test_rows_of_zeros_are_left_alone() -> None:
    case = planted_local(3, nc=5)
    assert isinstance(case.problem, fclib.LocalProblem)
    W = np.zeros((18, 18))
    W[:15, :15] = dense(case.problem.W)
    for normal, solvable in ((0.5, True), (0.0, True), (-0.5, False)):
        q = np.concatenate([case.problem.q, [normal, 0, 0]])
        problem = fclib.LocalProblem(W=W, q=q, mu=np.append(case.problem.mu, 0.4))
        result = fclib.solve(problem, time_limit=5)
        if solvable:
            assert result.converged
            assert_honest(problem, result, 1e-8)
        else:
            assert_proven(problem, result)


@pytest.mark.parametrize("push", [0.0, 1.0])
def test_a_pile_without_friction_is_solved(push: float) -> None:
    problem = bodies(7, nc=20, mu=0.0)
    problem = problem.replace(f=problem.f + push)
    assert fclib.solve(problem, tol=1e-12).converged


@pytest.mark.parametrize("size", [1e-6, 1e-3, 1e3, 1e6])
def test_units_leave_the_path_alone(size: float) -> None:
    # the error itself depends on the units of mass, and with it the last iterations
    for seed in range(4):
        problem = bodies(seed, nc=20)
        first = fclib.solve(problem)
        faster = fclib.solve(problem.replace(f=problem.f * size, w=problem.w * size))
        heavier = fclib.solve(problem.replace(M=problem.M * size, f=problem.f * size))
        assert faster.iterations == first.iterations
        assert faster.converged
        assert heavier.converged
        assert abs(heavier.iterations - first.iterations) <= max(10, first.iterations // 2)


def test_a_warm_start_saves_work() -> None:
    problem = bodies(5, nc=40, hyperstatic=True)
    cold = fclib.solve(problem)
    nearby = problem.replace(f=problem.f * (1 + 1e-9))
    warm = fclib.solve(nearby, guess=cold.solution)
    assert cold.converged
    assert warm.converged
    assert warm.iterations <= cold.iterations // 3


def at_rest(reaction: Array, seed: int = 0, n: int = 60) -> fclib.GlobalProblem:
    """Contacts on n coordinates, hyperstatic, that these reactions hold at rest."""
    rng = np.random.default_rng(seed)
    m = len(reaction)
    H = np.zeros((n, m))
    for a in range(0, m, 3):
        rows = rng.choice(n, 6, replace=False)
        H[np.ix_(rows, np.arange(a, a + 3))] = rng.standard_normal((6, 3))
    return fclib.GlobalProblem(
        M=np.eye(n), H=H, f=-H @ reaction, w=np.zeros(m), mu=np.full(m // 3, 0.7)
    )


def test_what_rests_takes_its_reactions_from_the_guess() -> None:
    rng = np.random.default_rng(0)
    load = np.tile([1.0, 0.1, 0.1], 60) * (1 + rng.uniform(0, 1, 180))
    before = fclib.solve(at_rest(load))
    nearby = at_rest(load * (1 + 0.01 * rng.uniform(-1, 1, 180)))
    warm = fclib.solve(nearby, guess=before.solution)
    assert before.converged
    assert warm.converged
    assert [stage.name for stage in warm.stages if stage.solved] == ["conjugate gradients"]
    assert sum(stage.factorisations for stage in warm.stages) == 0
    assert sum(stage.factorisations for stage in fclib.solve(nearby).stages) > 0


@pytest.mark.parametrize(
    ("seed", "change", "stage"),
    [(5, 1e-3, "proximal newton"), (14, 1e-2, "proximal point from the guess")],
)
def test_a_good_guess_on_few_bodies_is_repaired_on_the_bodies(
    seed: int, change: float, stage: str
) -> None:
    problem = bodies(seed, nc=40, hyperstatic=True)
    guess = fclib.solve(problem).solution
    rng = np.random.default_rng(0)
    nearby = problem.replace(f=problem.f * (1 + change * rng.uniform(-1, 1, len(problem.f))))
    warm = fclib.solve(nearby, guess=guess)
    cold = fclib.solve(nearby)
    assert warm.converged
    assert cold.converged
    assert "newton from the guess" not in [stage.name for stage in warm.stages]
    assert stage in [stage.name for stage in warm.stages if stage.solved]
    assert sum(s.factorisations for s in warm.stages) < sum(s.factorisations for s in cold.stages)


def test_the_stages_add_up() -> None:
    case = planted_global(2, nc=30)
    trace: list[tuple[int, str]] = []
    result = fclib.solve(
        case.problem,
        tol=1e-13,
        callback=lambda iteration, error, seconds, stage: trace.append((iteration, stage)),
    )
    assert result.iterations == sum(stage.iterations for stage in result.stages)
    assert {stage for _, stage in trace if stage} <= {stage.name for stage in result.stages}
    for stage in result.stages:
        assert 0 <= stage.solved <= stage.calls
        assert stage.factorisations >= 0
        assert stage.time >= 0
    assert fclib.solve(case.problem, "nsgs").stages == []


@pytest.mark.parametrize("hard", [False, True])
def test_the_limit_of_iterations_holds_in_every_stage(hard: bool) -> None:
    # conjugate gradients on what rests, and all that comes before the homotopy
    problem: Any = (
        bodies(1, 20, mu=10, hyperstatic=True, boundary=True)
        if hard
        else fclib.load("tiny/KaplasTower/0030")
    )
    whole = fclib.solve(problem).iterations
    assert whole > 50
    for limit in range(1, whole, 7):
        result = fclib.solve(problem, max_iterations=limit)
        assert result.iterations <= limit
        assert result.status == "iteration_limit"


def test_the_same_call_takes_the_same_path() -> None:
    problem = bodies(11, nc=30, hyperstatic=True)
    first, second = fclib.solve(problem), fclib.solve(problem)
    np.testing.assert_array_equal(first.solution.r, second.solution.r)
    assert [stage.iterations for stage in first.stages] == [
        stage.iterations for stage in second.stages
    ]


# ---- problems without a solution


@hypothesis.settings(deadline=None, max_examples=40, derandomize=True)
@hypothesis.given(
    seed=st.integers(0, 2**32 - 1),
    others=st.integers(0, 12),
    d=st.sampled_from([2, 3]),
    mu=st.sampled_from([0.0, 0.3, 1.0]),
    closing=st.floats(1e-3, 10),
)
def test_a_body_between_closing_walls_has_no_solution(
    seed: int, others: int, d: int, mu: float, closing: float
) -> None:
    rng = np.random.default_rng(seed)
    n = 2 * d
    wall = np.vstack([np.eye(d), np.zeros((n - d, d))])
    opposite = wall * np.array([-1.0] + [1.0] * (d - 1))
    H = np.hstack([wall, opposite, *(rng.standard_normal((n, d)) for _ in range(others))])
    w: Array = rng.standard_normal((H.shape[1],))
    w[[0, d]] = np.array([-closing, -0.5 * closing])
    problem = fclib.GlobalProblem(
        spacedim=d, M=np.eye(n), H=H, f=np.zeros(n), w=w, mu=np.full(others + 2, mu)
    )
    local = problem.condense()
    assert isinstance(local, fclib.LocalProblem)
    assert_proven(local, fclib.solve(local))
    assert fclib.solve(problem).status == "infeasible"


def walls_around(
    normals: Array, speeds: Array, scale: float, rng: np.random.Generator
) -> fclib.GlobalProblem:
    """A body of one point between walls that close; frames and their normals are at any angle."""
    count, d = normals.shape
    H = np.zeros((d, d * count))
    for a, normal in enumerate(normals):
        frame, _ = np.linalg.qr(np.column_stack([normal, rng.standard_normal((d, d - 1))]))
        H[:, d * a : d * (a + 1)] = scale * frame * np.sign(frame[:, 0] @ normal)
    w = np.zeros(d * count)
    w[::d] = -scale * speeds
    return fclib.GlobalProblem(
        spacedim=d, M=np.eye(d), H=H, f=rng.standard_normal(d), w=w, mu=rng.uniform(0, 1, count)
    )


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
def test_walls_at_any_angle_have_no_solution(d: int, scale: float) -> None:
    # no y of doubles makes H E y vanish: real numbers next to the certificate do
    rng = np.random.default_rng([d, int(np.log10(scale)) + 9])
    for count in [d + 1] * 4 + [2 * d + 1] * 2:
        normals = rng.standard_normal((count, d))
        normals[-1] = -rng.uniform(0.3, 1, count - 1) @ normals[:-1]
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        problem = walls_around(normals, rng.uniform(0.5, 2, count), scale, rng)
        result = fclib.solve(problem)
        assert result.status == "infeasible"
        assert result.certificate_bound == np.inf
        y = result.certificate
        assert y is not None
        rest = problem.H[:, ::d] @ y
        assert abs(rest).max() <= 1e-12 * scale * y.max()
        proof = analysis.check_arrays(problem, y)
        assert proof.exact
        assert proof.y is not None
        np.testing.assert_allclose(proof.y, y, rtol=1e-9)
        # walls that go away leave room
        assert fclib.solve(problem.replace(w=-np.asarray(problem.w))).converged


def test_walls_that_rounding_takes_out_of_their_plane_are_no_proof() -> None:
    # three normals in a plane at an angle: as doubles they are independent, and a motion opens all
    rng = np.random.default_rng(3)
    claimed = 0
    for _ in range(20):
        turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
        angles = 2 * np.pi * np.arange(3) / 3 + rng.uniform(0, 1)
        normals = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)]) @ turn.T
        problem = walls_around(normals, np.ones(3), 1.0, rng)
        independent = abs(np.linalg.det(problem.H[:, ::3])) > 0
        result = fclib.solve(problem, time_limit=20)
        if result.status == "infeasible":
            claimed += 1
            assert result.certificate is not None
            assert analysis.check_arrays(problem, result.certificate).exact
        elif result.converged:
            assert independent
    assert claimed < 20


def test_what_is_pressed_but_not_closing_is_not_refused() -> None:
    # the same body between walls that stand still, squeezed by its own weight only
    for speed in (0.0, 1e-9, 0.3):
        H = np.hstack([np.eye(3), np.diag([-1.0, 1.0, 1.0])])
        problem = fclib.GlobalProblem(
            M=np.eye(3), H=H, f=[0, -1, 0], w=[0, 0, 0, speed, 0, 0], mu=[0.5, 0.5]
        )
        result = fclib.solve(problem)
        assert result.status in {"converged", "stalled"}
        assert result.certificate is None


@pytest.mark.parametrize("ratio", [1e4, 1e8, 1e12])
def test_a_heavy_body_is_not_taken_for_a_wall(ratio: float) -> None:
    # a heavy body on the ground with a light one on it: reactions far above those of the light one
    H = np.zeros((6, 6))
    H[:3, :3] = np.eye(3)
    H[:3, 3:], H[3:, 3:] = -np.eye(3), np.eye(3)
    mass = np.repeat([ratio, 1.0], 3)
    problem = fclib.GlobalProblem(
        M=np.diag(mass), H=H, f=mass * np.tile([-1, 0.5, 0], 2), w=np.zeros(6), mu=[0.3, 0.3]
    )
    result = fclib.solve(problem, chain=last_resort(50))
    assert result.status != "infeasible"


def test_a_contact_that_nothing_can_move() -> None:
    problem = local_problem(np.zeros((3, 3)), [-1, 0, 0], [0.5])
    result = fclib.solve(problem)
    assert result.status == "infeasible"
    np.testing.assert_array_equal(result.certificate, [1.0])


@pytest.mark.parametrize("push", [0.0, 1.0])
@pytest.mark.parametrize("mu", [0.2, 0.5, 0.9])
def test_a_folded_path(push: float, mu: float) -> None:
    """Hyperstatic packings, where the path of the interior point folds: the homotopy goes on."""
    problem = Packing(mu=mu).of_size(300, push)
    result = fclib.solve(problem, solver="homotopy", tol=1e-8)
    assert result.converged, result
    assert judge(problem, result.solution).error <= 1.01e-8


@pytest.mark.parametrize(("size", "seed", "push"), [(100, 14, 1.0), (200, 37, 0.0)])
def test_a_jammed_packing(size: int, seed: int, push: float) -> None:
    """The path folds where nearly all rests: rounding the shift's kink unfolds it."""
    problem = Packing().of_size(size, push, seed)
    assert not fclib.solve(problem, solver="nsip").converged
    result = fclib.solve(problem, solver="nsip", smoothing=3)
    assert result.converged, result
    assert judge(problem, result.solution).error <= 1.01e-8


# ---- the chain, as data


def stage_names(result: fclib.Result) -> list[str]:
    return [stage.name for stage in result.stages]


HELD = "held bodies : held_bodies"


# packings that it solves in each of four orders of their contacts: of larger ones rounding decides
@pytest.mark.parametrize(
    ("contacts", "seed", "push", "rules"), [(400, 0, 0.0, " creep=0"), (600, 3, 1.0, "")]
)
def test_bodies_that_rest_are_held(contacts: int, seed: int, push: float, rules: str) -> None:
    """Few bodies move in a jammed packing: the others are held, and their reactions are convex."""
    problem = Packing().of_size(contacts, push, seed)
    converged(problem, chain=[HELD + rules], time_limit=30)
    # some slip: the convex problem alone is another one
    assert not fclib.solve(problem, chain="associated : associated").converged


def test_bodies_that_creep_may_have_to_move() -> None:
    """Many bodies move in some jammed packings: to hold what creeps at first leads away."""
    problem = Packing().of_size(600, 1.0, 3)
    rounds = " limit=4"
    assert fclib.solve(problem, chain=[HELD + " creep=0" + rounds]).converged
    assert not fclib.solve(problem, chain=[HELD + " creep=0.1" + rounds]).converged


def test_bodies_of_an_island_are_held() -> None:
    """A packing, and a ball that falls on the ground beside it: an island of its own."""
    packing = Packing().of_size(400, 0.0, 0)
    ball = fclib.GlobalProblem(
        spacedim=3, M=np.eye(3), H=np.eye(3), f=[1.0, 0.0, -1.0], w=np.zeros(3), mu=[0.5]
    )
    parts = (ball, packing)
    data: dict[str, Any] = {
        name: sp.block_diag([getattr(part, name) for part in parts], "csc") for name in "MH"
    }
    for name in ("f", "w", "mu"):
        data[name] = np.concatenate([getattr(part, name) for part in parts])
    problem = fclib.GlobalProblem(spacedim=3, **data)
    result = converged(problem, chain=["sweeps : gauss_seidel on=whole limit=5 worth=0", HELD])
    assert result.stages[-1].solved


def test_boxes_that_overlap_are_solved() -> None:
    """A pile of Drake's, of which most boxes rest."""
    path = Path(__file__).parents[2].parent / "shared/data/challenges/drakehard-sap-0140.hdf5"
    if not path.is_file():
        pytest.skip("there is no such file")
    problem = fclib.read(path)
    result = converged(problem, tol=1e-10)
    assert_honest(problem, result, 1e-10)


def test_near_a_solution_the_proximal_point_goes_on() -> None:
    """A heap whose islands end near solutions: each homotopy takes more factorisations than all."""
    path = Path(__file__).parents[2].parent / "shared/data/real/local3d/RockPile_tob1.hdf5"
    if not path.is_file():
        pytest.skip("there is no such file")
    problem = fclib.read(path)
    result = converged(problem)
    assert_honest(problem, result, 1e-8)
    solved = [stage.name for stage in result.stages if stage.solved]
    assert {"proximal point, near", "proximal point, longer"} & set(solved)
    assert "homotopy" not in stage_names(result)


@pytest.mark.long
def test_the_homotopy_goes_to_the_end_of_its_path() -> None:
    """A wall of `standard` that no other stage solves: its path takes thousands of points."""
    path = collections.plan_of("standard/LowWall").trajectory
    if path is None:
        pytest.skip("its states are not stored")
    problem = collections.read_trajectory(path).problem(0).problem
    result = converged(problem, time_limit=200.0)
    assert_honest(problem, result, 1e-8)
    assert result.stages[-1].name == "homotopy"


def test_each_word_of_a_chain_is_told_and_taken() -> None:
    anywhere, *methods = fclib.chain_methods()
    rules = {method.name: {rule.name for rule in method.rules} for method in methods}
    for line in auto_chain():
        _, _, stage = line.partition(":")
        name, *words = stage.split()
        keys = {word.partition("=")[0] for word in words}
        assert keys <= rules[name] | {rule.name for rule in anywhere.rules}
    for method in methods:
        assert method.doc
        told = " ".join(
            f"{rule.name}={str(rule.default).lower()}" for rule in anywhere.rules + method.rules
        )
        fclib.solve(bodies(2, 3), chain=[f"stage : {method.name} {told}"])


def test_the_chain_of_auto_is_its_table(tmp_path: Path) -> None:
    problem = bodies(4, 20, mu=0.5, hyperstatic=True)
    lines = auto_chain()
    assert len(lines) > 10
    result = fclib.solve(problem, tol=1e-10)
    path = tmp_path / "mine.chain"
    path.write_text("# the same\n\n" + "\n".join(lines))
    for chain in (lines, "; ".join(lines), path):
        again = fclib.solve(problem, tol=1e-10, chain=chain)
        assert again.iterations == result.iterations
        np.testing.assert_array_equal(again.solution.r, result.solution.r)
    names = {line.partition(":")[0].strip() for line in lines}
    assert set(stage_names(result)) <= names


def test_a_chain_of_ones_own() -> None:
    problem = bodies(4, 20, mu=0.5, hyperstatic=True)
    own = ["mine : gauss_seidel on=whole limit=3 worth=0", "end : proximal_point from=best"]
    result = converged(problem, chain=own)
    assert stage_names(result) == ["mine", "end"]
    assert result.stages[0].iterations == 3
    assert result.stages[0].families == "splitting"
    # a stage that does not apply is not entered, and what solves nothing ends as stalled
    own[1] += " below=1e-300"
    result = fclib.solve(problem, chain=own)
    assert result.status == "stalled"
    assert stage_names(result) == ["mine"]
    # one for joints is entered where there are some alone
    free, joined = planted_local(4, nc=12).problem, planted_local(5, nc=12, p=5).problem
    for problem_, names in ((free, ["b"]), (joined, ["a"])):
        chain = "a : proximal_point jointed=0.01 from=nothing limit=500; b : proximal_point"
        assert stage_names(fclib.solve(problem_, chain=chain))[:1] == names
    # the convex problem of an associated law is that of Coulomb's cone alone
    rolling = planted_rolling(5, 17, 10)[0]
    result = fclib.solve(rolling, chain="a : associated ; b : proximal_point limit=500")
    assert stage_names(result) == ["b"]


@pytest.mark.parametrize("law", ["plane", "space", "joints", "rolling"])
def test_a_problem_in_its_own_units_is_the_same_problem(law: str) -> None:
    """Sweeps do not depend on the units of contacts: two halves are as good as the whole."""
    plain: Any = planted_rolling(5, 17, 10)[0]
    if law == "plane":
        plain = bodies(4, 20, d=2, hyperstatic=True).condense()
    elif law == "space":
        plain = bodies(6, 12, mu=0.5).condense()
    elif law == "joints":
        plain = planted_local(5, nc=12, p=5).problem
    d, units = plain.spacedim, 10.0 ** np.random.default_rng(3).uniform(-3, 3, plain.nc)
    rows = sp.diags(np.repeat(units, d))
    problem = plain.replace(W=rows @ sp.csc_matrix(dense(plain.W)) @ rows, q=rows @ plain.q)
    if plain.p:
        problem = problem.replace(V=rows @ dense(plain.V))
    whole = converged(problem, chain="sweeps : gauss_seidel limit=5000 worth=0")
    assert whole.iterations > 10
    sweeps = f"sweeps : gauss_seidel on=whole limit={2 * whole.iterations // 3} worth=0"
    assert fclib.solve(problem, chain=sweeps).status == "stalled"
    chain = f"{sweeps}; own : own_units from=best range="
    result = converged(problem, chain=chain + "1e3", history=True)
    assert_honest(problem, result, 1e-8)
    assert [stage.solved for stage in result.stages] == [0, 1]
    assert result.iterations <= 1.1 * whole.iterations + 10
    assert result.history is not None
    assert result.history[-1][1] == pytest.approx(result.error, rel=1e-3, abs=1e-12)
    assert stage_names(fclib.solve(problem, chain=chain + "1e30")) == ["sweeps"]
    # nothing comes before it, so it does nothing
    assert fclib.solve(problem, chain="own : own_units range=1").status == "stalled"


def test_sweeps_end_if_too_many_are_left() -> None:
    problem = fclib.load("tiny/Capsules/0300")
    chain = "a : gauss_seidel on=whole limit=10 worth=0"
    full = fclib.solve(problem, chain=chain.replace("limit=10", "limit=1000"))
    wanted = full.iterations
    assert full.status == "converged"
    assert wanted > 30
    # after ten sweeps there are about `wanted - 10` left: with a larger bound they go on
    assert fclib.solve(problem, chain=f"{chain} left={2 * wanted}").iterations > 20
    assert fclib.solve(problem, chain=f"{chain} left=1").iterations == 10


def test_conjugate_gradients_count_each_iteration_once() -> None:
    rng = np.random.default_rng(69)
    A = rng.normal(size=(6, 6))
    problem = fclib.LocalProblem(W=A @ A.T, q=rng.normal(size=6), mu=[0.3, 0.3])
    chain = "a : conjugate_gradients at_least=1 limit=50"
    for most in range(1, 8):
        result = fclib.solve(problem, tol=0.1, chain=chain, max_iterations=most, history=True)
        assert result.iterations <= most
        assert result.history is not None
        assert [row[0] for row in result.history][-1] <= most


def test_limits_hold_in_own_units() -> None:
    problem = bodies(4, 20, mu=0.5, hyperstatic=True)
    chain = "sweeps : gauss_seidel limit=4 worth=0; own : own_units range=1.01"
    assert fclib.solve(problem, chain=chain).iterations == 8
    result = fclib.solve(problem, chain=chain, max_iterations=6)
    assert (result.status, result.iterations) == ("iteration_limit", 6)
    count = [0]

    def stop(*_: Any) -> bool:
        count[0] += 1
        return count[0] < 4

    assert fclib.solve(problem, chain=chain, callback=stop).status == "interrupted"


def many_dense_contacts(nc: int) -> fclib.LocalProblem:
    rng = np.random.default_rng(0)
    H = rng.normal(size=(nc, 3 * nc))
    return fclib.LocalProblem(W=H.T @ H, q=rng.normal(size=3 * nc), mu=np.full(nc, 0.7))


@pytest.mark.parametrize("before", ["", "sweeps : gauss_seidel limit=1; "])
def test_pivots_end_when_the_time_is_over(before: str) -> None:
    problem, chain = many_dense_contacts(200), before + "a : pivoting; own : own_units range=1"
    result = fclib.solve(problem, chain=chain, time_limit=0.2)
    assert result.status == "time_limit"
    assert result.iterations < 900  # the first covering vector alone takes 1000 pivots of 10 ms
    seen: list[float] = []

    def stop(*report: Any) -> bool:
        seen.append(report[1])
        return len(seen) < 2 + bool(before)

    result = fclib.solve(problem, chain=chain, callback=stop)
    assert result.status == "interrupted"
    assert result.iterations < 900


def test_a_tableau_that_does_not_fit_into_memory_is_not_made() -> None:
    problem = many_dense_contacts(100)
    result = fclib.solve(problem, chain="a : pivoting", memory_limit=0.005)
    assert (result.status, result.iterations) == ("stalled", 0)
    assert "do not fit into 0.005 GB" in result.message


def test_random_starts_end_when_the_time_is_over() -> None:
    chain = "a : random_starts tries=1000000"
    start = time.perf_counter()
    result = fclib.solve(many_dense_contacts(100), chain=chain, time_limit=0.05)
    assert result.status == "time_limit"
    assert time.perf_counter() - start < 20  # a million starts without a factorisation take minutes


# what the polish of the last pivots finds takes no iteration
@pytest.mark.parametrize("number", [24, 123, 205, 245])
def test_the_history_ends_with_the_error_of_the_result(number: int) -> None:
    result = fclib.solve(planted(number)[0], history=True)
    assert result.converged
    assert result.history is not None
    assert result.history[-1][1] == result.error
    assert (np.diff(result.history["time"]) >= 0).all()
    assert result.history[-1][0] == result.iterations


def test_one_factorisation_serves_many_steps_of_bodies_at_rest() -> None:
    wall: Any = fclib.scenes.assemblies()["Wall"]()
    problem = wall.of_size(400, 0.0, 0)
    chain = "a : alternating_directions worth=1000 first_look=20"
    (stage,) = converged(problem, tol=1e-6, chain=chain).stages
    assert 1 <= stage.factorisations <= 5 < stage.iterations
    # the limit of iterations holds to the last one
    result = fclib.solve(problem, tol=1e-9, chain=chain, max_iterations=17)
    assert (result.status, result.iterations) == ("iteration_limit", 17)
    # from a solution none is needed, and a nearby one is worth some
    solution = fclib.solve(problem, tol=1e-10).solution
    nearby = problem.replace(f=problem.f * (1 + 1e-6))
    warm = converged(nearby, tol=1e-6, chain=chain, guess=solution)
    assert sum(s.iterations for s in warm.stages) < stage.iterations
    # memory for no factors: it is left out
    result = fclib.solve(problem, tol=1e-6, chain=chain, memory_limit=1e-9, max_iterations=50)
    assert not result.converged
    # what they may cost does not pay for twice the first look
    result = fclib.solve(problem, tol=1e-6, chain="a : alternating_directions worth=1")
    assert [stage.iterations for stage in result.stages] == [0]


@pytest.mark.parametrize("method", ["sweep_on", "spectral_gradient"])
def test_cheap_steps_come_where_a_factorisation_is_dear(method: str) -> None:
    packing: Any = fclib.scenes.assemblies()["Packing"]()
    problem = packing.of_size(400, 0.0, 0)
    result = converged(problem, tol=1e-3, chain=f"a : {method} worth=1000")
    (stage,) = result.stages
    assert stage.factorisations == 0
    # the limit of iterations holds to the last one
    result = fclib.solve(problem, tol=1e-9, chain=f"a : {method} worth=1000", max_iterations=17)
    assert (result.status, result.iterations) == ("iteration_limit", 17)
    # what they may cost does not pay for twice the first look
    result = fclib.solve(problem, tol=1e-3, chain=f"a : {method} worth=1 first_look=10000")
    assert [stage.iterations for stage in result.stages] == [0]
    # the rate that is seen says that 1e-12 is out of reach
    result = fclib.solve(problem, tol=1e-12, chain=f"a : {method} worth=30 first_look=20")
    assert not result.converged
    assert 20 <= result.iterations < 2000


@pytest.mark.parametrize(
    ("chain", "message"),
    [
        ("", "has no stage"),
        ("# nothing", "has no stage"),
        ("sweeps", "line 1: 'sweeps' is not NAME : METHOD key=value"),
        ("\nmine: newton", "stage 'mine', line 2: 'newton' is no method; there is: gauss_seidel"),
        ("mine: polish tau=2", "stage 'mine', line 1: 'tau' is no rule of polish, which has: from"),
        ("mine: polish limit=0", "stage 'mine', line 1: option limit: 0 is outside"),
        ("mine: polish on=both", "stage 'mine', line 1: option on: 'both' is not one of: whole"),
        ("mine: polish limit=2 limit=3", "stage 'mine', line 1: 'limit' is there twice"),
        ("mine: polish limit", "stage 'mine', line 1: 'limit' is not key=value"),
        ("mine:", "stage 'mine', line 1: names no method"),
        ("a: polish; a: homotopy", "stage 'a', line 1: has the name of a stage of another family"),
        (Path("not there"), "option chain: not there"),
    ],
)
def test_a_wrong_chain_names_the_stage(chain: str | Path, message: str) -> None:
    with pytest.raises(fclib.OptionError, match=r"option chain") as caught:
        fclib.solve(bodies(4, 5), chain=chain)
    assert message in str(caught.value)


# joints that nearly follow from each other, multipliers up to 1e9 times the load
@pytest.mark.parametrize("number", [144, 196, 234, 324, 682, 900, 1426, 1470, 1802])
def test_nearly_parallel_joints_on_light_and_heavy_bodies(number: int) -> None:
    problem, _, _ = hard(number)
    result = converged(problem)
    merit = fclib.merit(problem, result.solution)
    assert max(merit.error, merit.dynamics, merit.bilateral) <= 1e-8


def test_reactions_whose_rounding_is_more_than_the_tolerance() -> None:
    # a light body between the ground and a heavy one: reactions of 2^28 of its weight
    W = np.kron(np.array([[1, -1], [-1, 1 + 2.0**-28]]), np.eye(3))
    q = np.array([-1, 0.25, 0, -1, 0, 0])
    problem = fclib.LocalProblem(spacedim=3, W=W, q=q, mu=[0.5, 0.5])
    result = converged(problem)
    assert_honest(problem, result, 1e-8)


WEDGED = {  # stages that solve a few contacts of high friction, and problems of theirs
    "pivoting": [438, 1190, 2319, 2890],
    "random starts": [1031, 1164],
}


def test_planted_problems_have_the_same_digits_with_another_blas() -> None:
    code = """
import fclib, planted_judge
print(*[fclib.digest(planted_judge.planted(k)[0]) for k in range(9)])"""
    told = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1]), **other},
            stdout=subprocess.PIPE,
            check=True,
        ).stdout
        for other in ({}, {"OPENBLAS_CORETYPE": "Prescott"})
    }
    assert len(told) == 1


@pytest.mark.parametrize(("stage", "number"), [(s, n) for s in WEDGED for n in WEDGED[s]])
def test_contacts_that_wedge_each_other(stage: str, number: int) -> None:
    problem, _, _ = planted(number)
    own = [line for line in auto_chain() if line.split(":")[0].strip() == stage]
    assert own
    result = converged(problem, chain=own)
    assert judge(problem, result.solution).error <= 1.01e-8
    others = [line for line in auto_chain() if line.split(":")[0].strip() not in WEDGED]
    assert fclib.solve(problem, chain=others, max_iterations=20000).status == "stalled"


def factorisations(result: fclib.Result) -> int:
    return sum(stage.factorisations for stage in result.stages)


def test_factors_that_do_not_fit_into_memory_are_not_made() -> None:
    problem = bodies(11, nc=30, hyperstatic=True)
    usual = converged(problem)
    assert factorisations(usual) > 0
    assert usual.message == ""
    result = fclib.solve(problem, memory_limit=1e-6)
    assert factorisations(result) == 0
    assert "do not fit into 1e-06 GB" in result.message
    assert_honest(problem, result, 1e-8)
    assert pickle.loads(pickle.dumps(result)).message == result.message
    page: Any = result
    assert result.message in page._repr_html_()
    enough = converged(problem, memory_limit=1)
    assert enough.message == ""


@pytest.mark.parametrize("seed", [0, 9, 15, 27])
def test_sweeps_go_on_where_factors_do_not_fit(seed: int) -> None:
    problem = bodies(seed, nc=30, hyperstatic=True)
    assert factorisations(fclib.solve(problem)) > 0
    result = converged(problem, memory_limit=1e-6)
    assert factorisations(result) == 0
    fewer = [line for line in auto_chain() if ": sweep_on" not in line]
    assert not fclib.solve(problem, memory_limit=1e-6, chain=fewer).converged
