"""Ranks, existence with its proofs, uniqueness, reference solutions, contacts and energy."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import h5py
import hypothesis
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import strategies as st

import fclib
from fclib import analysis
from fclib.analysis import _brief, _existence, _reference, _spectrum
from fclib.analysis._brief import brief
from fclib.analysis._data import Data
from helpers import (
    dense,
    local_problem,
    planted_global,
    planted_local,
    planted_rolling,
    project,
    ran,
    real_folder,
    ring,
)
from helpers_cli import run

some = hypothesis.settings(deadline=None, max_examples=20, derandomize=True)


FOUND = sorted(real_folder().glob("*/*.hdf5"))
needs_data = pytest.mark.skipif(not FOUND, reason=f"there are no real problems in {real_folder()}")


def few_contacts() -> list[Any]:
    """Real problems whose ranks dense algebra finds in a moment."""
    small = []
    for path in FOUND:
        with h5py.File(path) as file:
            group = next(file[name] for name in file if name.startswith("fclib_"))
            if group["vectors/mu"].size <= 150:
                small.append(pytest.param(path, id=f"{path.parent.name}/{path.stem}"))
    return small or [None]


def assert_no_solution(problem: fclib.Problem, proof: analysis.Certificate | None) -> None:
    """Farkas, from the data: no r in K, with its lambda, keeps all contacts from closing."""
    assert proof is not None
    local = problem
    if isinstance(problem, (fclib.GlobalProblem, fclib.GlobalRollingProblem)):
        local = problem.condense()
    assert isinstance(local, (fclib.LocalProblem, fclib.LocalRollingProblem))
    y, d = proof.y, local.spacedim
    assert (y >= 0).all()
    normal = np.zeros(local.m)
    normal[::d] = y
    image = -dense(local.W).T @ normal
    gain = -y @ local.q[::d]
    rest = np.zeros(0)
    if local.V is not None:
        z = proof.z
        assert z is not None
        assert local.s is not None
        image = image - dense(local.V) @ z
        rest = dense(local.V).T @ normal + dense(local.R).T @ z
        gain = gain - z @ local.s
    assert gain > 0
    outside = np.linalg.norm(project(-image.reshape(-1, d), local.mu))
    distance = np.hypot(outside, np.linalg.norm(rest))
    trace = np.trace(dense(local.W)) / local.m
    usual = np.linalg.norm(local.q) / abs(trace or 1.0)
    assert distance == 0 or gain / distance > 1e3 * usual


# ---- real problems


@needs_data
@pytest.mark.parametrize("path", few_contacts())
def test_ranks_are_those_of_dense_algebra(path: Path) -> None:
    problem = fclib.read(path)
    found = analysis.analyze(problem)
    local = problem
    if isinstance(problem, (fclib.GlobalProblem, fclib.GlobalRollingProblem)):
        local = problem.condense()
        H = dense(problem.H)
        assert found.spectra["H"].rank == (np.linalg.matrix_rank(H) if H.size else 0)
    assert isinstance(local, (fclib.LocalProblem, fclib.LocalRollingProblem))
    W = dense(local.W)
    size = abs(W).max(initial=0)
    assert found.asymmetry["W"] == pytest.approx(
        abs(W - W.T).max() / size if size else 0, rel=1e-12, abs=1e-18
    )
    if problem.nc:
        values = np.linalg.svd(W, compute_uv=False)
        rank = int(np.linalg.matrix_rank(W))
        spectrum = found.spectra["W"]
        assert spectrum.rank == rank
        # the smallest singular value is known to the rounding of the largest
        accuracy = 1e-13 * values[0] / values[rank - 1] + 1e-9
        assert spectrum.conditioning == pytest.approx(values[0] / values[rank - 1], rel=accuracy)
        assert found.hyperstaticity == problem.m - rank
    # each of them has been solved: none may be said to have no solution
    assert found.existence.verdict in (analysis.EXISTS_SLATER, analysis.EXISTS_AT_HAND)
    assert found.existence.error <= 1e-8
    json.dumps(found.record, allow_nan=False)


@needs_data
def test_a_real_problem_has_a_reference_solution() -> None:
    path = real_folder() / "local3d" / "Capsules-i125-1213.hdf5"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    problem = fclib.read(path)
    found = analysis.reference(problem)
    assert found.certified, found.reason
    assert found.error <= 1e-12
    assert found.reaction == "minimum norm"
    assert found.solution is not None
    other = fclib.solve(problem, tol=1e-12).solution
    assert np.linalg.norm(found.solution.r) < np.linalg.norm(other.r)


# ---- ranks


@some
@hypothesis.given(
    seed=st.integers(0, 10**6), rank=st.integers(1, 30), extra=st.integers(0, 20), d=st.booleans()
)
def test_sparse_and_dense_counts_agree(seed: int, rank: int, extra: int, d: bool) -> None:
    rng = np.random.default_rng(seed)
    size = rank + extra
    factor = rng.standard_normal((size, rank)) * (rng.uniform(size=(size, rank)) < 0.5)
    right = factor if d else factor + 0.1 * rng.standard_normal(factor.shape) * (factor != 0)
    a = sp.csc_array(factor @ right.T)
    a.eliminate_zeros()
    if a.nnz == 0:
        return
    expected = _spectrum.spectrum(a)
    assert expected.rank == np.linalg.matrix_rank(a.toarray())
    values = np.linalg.svd(a.toarray(), compute_uv=False)
    assert expected.largest == pytest.approx(values[0])
    # what the sparse thresholds cannot tell apart is left out
    gap = values[values > 1e-14 * values[0]]
    if gap.min() < 1e-5 * values[0]:
        return
    sparse = _spectrum.spectrum(a, limit=1)
    assert sparse.rank == expected.rank
    assert "inertia" in sparse.method or min(a.shape) == 1 or "dense" in sparse.method
    assert sparse.conditioning == pytest.approx(expected.conditioning, rel=0.05)


def test_blocks_are_found() -> None:
    a = sp.block_diag([np.diag([1.0, 2.0]), np.ones((2, 3)), np.zeros((1, 2)), [[4.0]]])
    found = _spectrum.spectrum(sp.csc_array(a))
    assert found.rank == 4
    assert found.largest == 4
    assert found.smallest == 1
    low, high, _ = _spectrum.lowest_eigenvalue(sp.csc_array(np.diag([3.0, -1.0, 0.0])))
    assert (low, high) == (-1, 3)
    low, _, _ = _spectrum.lowest_eigenvalue(sp.csc_array(np.diag([3.0, 0.0])))
    assert low == 0


@pytest.mark.parametrize("lowest", [0.5, 0.0, -0.5])
def test_the_sign_of_sparse_matrices(lowest: float) -> None:
    rng = np.random.default_rng(1)
    q, _ = np.linalg.qr(rng.standard_normal((12, 12)))
    a = q @ np.diag([lowest, *rng.uniform(1, 2, 11)]) @ q.T
    low, _, method = _spectrum.lowest_eigenvalue(sp.csc_array((a + a.T) / 2), limit=3)
    assert "inertia" in method
    assert np.sign(round(low, 9)) == np.sign(lowest) or abs(low) < 1e-9


# ---- problems without a solution


def squeezed(d: int, mu: float, others: int, seed: int = 0) -> fclib.GlobalProblem:
    """A body between walls that close on it, other bodies touch it and each other."""
    rng = np.random.default_rng(seed)
    n = d * (others + 1)
    H = np.zeros((n, d * (others + 2)))
    H[:d, :d] = np.eye(d)
    H[:d, d : 2 * d] = -np.eye(d)
    for k in range(others):
        frame, _ = np.linalg.qr(rng.standard_normal((d, d)))
        own = slice(d * (k + 1), d * (k + 2))
        column = slice(d * (k + 2), d * (k + 3))
        H[own, column] = frame
        H[:d, column] = -frame
    w = np.zeros(H.shape[1])
    w[[0, d]] = [-1.0, -0.5]
    f = rng.standard_normal(n)
    return fclib.GlobalProblem(spacedim=d, M=np.eye(n), H=H, f=f, w=w, mu=np.full(others + 2, mu))


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("mu", [0.0, 0.4, 3.0])
@pytest.mark.parametrize("others", [0, 5])
def test_a_body_between_closing_walls(d: int, mu: float, others: int) -> None:
    problem = squeezed(d, mu, others)
    found = analysis.analyze(problem, time_limit=3)
    assert found.existence.verdict == analysis.PROVEN_NOT
    assert found.slater.holds is not True
    assert_no_solution(problem, found.certificate)
    assert found.record["certificate_contacts"] == [0, 1]
    # of the local form alone, and without the solver's own proof
    data = Data.of_problem(problem.condense())
    assert_no_solution(problem, _existence.prove(data))


@pytest.mark.parametrize("count", [3, 4, 7])
def test_a_ring_of_walls_that_pushes_a_body_out_of_itself(count: int) -> None:
    # normals that hold each other: no motion leaves all walls that come nearer
    problem = ring(count)
    found = analysis.analyze(problem)
    assert found.existence.verdict == analysis.PROVEN_NOT
    assert_no_solution(problem, found.certificate)
    # where they go away there is a solution, strictly inside K*
    apart = analysis.analyze(problem.replace(w=-problem.w))
    assert apart.existence.verdict == analysis.EXISTS_SLATER


@pytest.mark.parametrize("mu", [1.5, 2.0, 4.0])
def test_the_rod_of_painleve(mu: float) -> None:
    # a sliding rod at 45 degrees (m = l / 2 = 1): the normal acceleration is A r + b with
    # A = 1 + 3 cos a (cos a - mu sin a), negative from mu = 5/3 on, and b < 0
    push = 1 + 1.5 * (1 - mu)
    problem = fclib.LocalProblem(
        spacedim=2, W=np.array([[push, 0.0], [0.0, 1.0]]), q=[-1.0, 0.3], mu=[0.2]
    )
    found = analysis.analyze(problem)
    if push < 0:
        assert found.definiteness.word == "indefinite"
        assert found.existence.verdict == analysis.PROVEN_NOT
        assert_no_solution(problem, found.certificate)
    else:
        assert found.existence.verdict == analysis.EXISTS_SLATER


def test_friction_and_an_asymmetric_w_leave_no_way_out() -> None:
    # with Painleve's coupling in W itself: u_N = (a r_N + b r_T) - 1 with |b| mu < -a
    W = np.array([[-1.0, 0.5], [0.0, 1.0]])
    for mu, closes in ((1.0, True), (3.0, False)):
        problem = fclib.LocalProblem(spacedim=2, W=W, q=[-1.0, 0.0], mu=[mu])
        found = analysis.analyze(problem)
        assert found.existence.verdict == analysis.PROVEN_NOT
        if closes:
            assert_no_solution(problem, found.certificate)
        else:
            # r = (1, 4) keeps it from closing, but friction along u_T does no such thing: only the
            # states of the contact tell
            assert found.certificate is None
            assert "enumeration" in found.existence.reason


def test_a_bilateral_constraint_holds_what_is_pushed() -> None:
    # the body cannot leave along x, and a wall comes from there
    problem = fclib.GlobalProblem(
        M=np.eye(3),
        H=np.eye(3),
        G=np.eye(3)[:, :1],
        f=np.zeros(3),
        w=[-1.0, 0, 0],
        b=[0.0],
        mu=[0.5],
    )
    found = analysis.analyze(problem)
    assert found.existence.verdict == analysis.PROVEN_NOT
    assert_no_solution(problem, found.certificate)
    assert analysis.analyze(problem.replace(b=[-2.0])).existence.verdict == analysis.EXISTS_SLATER


def test_a_rolling_body_between_closing_walls() -> None:
    W = np.zeros((10, 10))
    block = np.diag([1.0, 1.0, 1.0, 2.0, 2.0])
    sign = np.diag([-1.0, 1.0, 1.0, 1.0, 1.0])
    W[:5, :5], W[:5, 5:], W[5:, :5], W[5:, 5:] = block, block @ sign, sign @ block, block
    q = np.zeros(10)
    q[[0, 5]] = -1
    problem = fclib.LocalRollingProblem(spacedim=5, W=W, q=q, mu=[0.3, 0.3], mu_r=[0.1, 0.1])
    found = analysis.analyze(problem)
    assert found.existence.verdict == analysis.PROVEN_NOT
    proof = found.certificate
    assert proof is not None
    normal = np.zeros(10)
    normal[::5] = proof.y
    np.testing.assert_allclose(W @ normal, 0, atol=1e-9)
    assert proof.y @ q[::5] < 0


@pytest.mark.parametrize("speed", [-0.2, 0.0, 0.2])
def test_contacts_without_degrees_of_freedom(speed: float, tmp_path: Path) -> None:
    """Their velocity is w: there is a solution where it leaves none of them closing."""
    problem = fclib.GlobalProblem(
        spacedim=3,
        M=sp.csc_array((0, 0)),
        H=sp.csc_array((0, 6)),
        f=np.zeros(0),
        w=np.array([0.1, 0, 0, speed, 0, 0]),
        mu=np.array([0.5, 0.5]),
    )
    found = analysis.analyze(problem)
    assert "nothing can move" in found.units.trouble[0]
    if speed < 0:
        assert found.existence.verdict == "proven not to exist"
        assert_no_solution(problem, found.existence.certificate)
    else:
        assert found.existence.verdict.startswith("exists")
    assert found.slater.holds is (speed > 0)
    fclib.write(tmp_path / "fixed.hdf5", problem)
    done = run("analyze", tmp_path / "fixed.hdf5")
    assert "Traceback" not in done.stderr
    assert "2 contacts that nothing can move" in done.stdout + done.stderr


def test_what_proves_nothing_is_no_proof() -> None:
    problem = squeezed(3, 0.4, 2).condense()
    assert isinstance(problem, fclib.LocalProblem)
    assert analysis.farkas(problem, np.array([1.0, 1, 0, 0])) is not None
    assert analysis.farkas(problem, np.array([1.0, 0, 0, 0])) is None
    # what is near a proof is brought to it, and is none itself
    near = analysis.farkas(problem, np.array([1.0, 1, 1e-3, 0]))
    assert near is not None
    assert near.exact
    assert near.exact_y == {0: 1, 1: 1}
    with pytest.raises(analysis.CertificateError, match="contact 0: "):
        analysis.check(problem, {0: 1, 1: 1, 2: 1e-3})
    assert analysis.farkas(problem, np.array([-1.0, -1, 0, 0])) is None
    assert analysis.farkas(problem, np.zeros(4)) is None
    with pytest.raises(fclib.ProblemError, match="nc = 4"):
        analysis.farkas(problem, np.ones(3))


@pytest.mark.parametrize(
    ("y", "message"),
    [
        ('{"0": "1e5000"}', "too large for doubles"),
        ("[1e308, 1e308, 1e308, 1e308]", "too large for doubles"),
        ('{"0": "1e9999999999"}', "is no number"),  # would fill the memory
    ],
)
def test_a_certificate_of_huge_numbers_is_refused(tmp_path: Path, y: str, message: str) -> None:
    problem = squeezed(3, 0.4, 2).condense()
    fclib.write(tmp_path / "squeezed.hdf5", problem)
    (tmp_path / "y.json").write_text(f'{{"y": {y}}}')
    done = run("check", tmp_path / "squeezed.hdf5", "--certificate", tmp_path / "y.json", code=1)
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1


# ---- problems with a solution


@some
@hypothesis.given(
    seed=st.integers(0, 2**32 - 1),
    nc=st.integers(1, 8),
    d=st.sampled_from([2, 3]),
    p=st.sampled_from([0, 2]),
    mu=st.sampled_from([0.0, 0.3, 2.0]),
)
def test_planted_problems_are_never_called_infeasible(
    seed: int, nc: int, d: int, p: int, mu: float
) -> None:
    for case in (planted_local(seed, d, nc, p, mu), planted_global(seed, d, nc, p, mu)):
        found = analysis.analyze(case.problem)
        assert found.existence.verdict == analysis.EXISTS_SLATER
        assert _existence.prove(Data.of_problem(case.problem)) is None


@some
@hypothesis.given(
    seed=st.integers(0, 2**32 - 1),
    nc=st.integers(2, 8),
    duplicated=st.integers(0, 2),
    mu=st.sampled_from([0.0, 0.3, 2.0]),
)
def test_hyperstatic_problems_are_never_called_infeasible(
    seed: int, nc: int, duplicated: int, mu: float
) -> None:
    # fewer bodies than contacts hold, and a planted solution
    rng = np.random.default_rng(seed)
    case = planted_local(seed, nc=nc, mu=mu)
    u, r = case.solution.u, case.solution.r
    assert u is not None
    n = max(3, 3 * nc // 2)
    H = rng.standard_normal((n, 3 * nc))
    H = np.hstack([H, H[:, : 3 * duplicated]])
    u, r = np.append(u, u[: 3 * duplicated]), np.append(r, r[: 3 * duplicated])
    v = rng.standard_normal(n)
    problem = fclib.GlobalProblem(
        M=np.eye(n), H=H, f=v - H @ r, w=u - H.T @ v, mu=np.full(nc + duplicated, mu)
    )
    for form in (problem, problem.condense()):
        found = analysis.analyze(form, time_limit=2)
        assert found.existence.verdict != analysis.PROVEN_NOT
        assert found.hyperstaticity == 3 * (nc + duplicated) - np.linalg.matrix_rank(H)
        assert _existence.prove(Data.of_problem(form)) is None


@pytest.mark.parametrize("local", [False, True])
def test_a_jammed_body_has_a_solution_and_no_slater_point(local: bool) -> None:
    # between walls that stand still: whatever the prestress, u = 0
    H = np.hstack([np.eye(3), np.diag([-1.0, 1.0, 1.0])])
    whole = fclib.GlobalProblem(M=np.eye(3), H=H, f=[0.5, -0.1, 0], w=np.zeros(6), mu=[0.5, 0.5])
    found = analysis.analyze(whole.condense() if local else whole)
    assert found.slater.holds is False
    assert found.slater.margin <= 1e-7
    assert found.existence.verdict == analysis.EXISTS_AT_HAND
    assert found.certificate is None
    assert found.hyperstaticity == 3


def test_a_slater_point_is_strictly_inside() -> None:
    case = planted_global(3, d=3, nc=5, p=2)
    problem = case.problem
    assert isinstance(problem, fclib.GlobalProblem)
    # more contacts than the bodies can move apart freely
    H = np.hstack([dense(problem.H), dense(problem.H)])
    problem = problem.replace(H=H, w=np.tile(problem.w, 2), mu=np.tile(problem.mu, 2))
    found = analysis.analyze(problem).slater
    assert found.holds
    u = found.velocity
    assert u is not None
    parts = u.reshape(-1, 3)
    assert (parts[:, 0] > problem.mu * np.linalg.norm(parts[:, 1:], axis=1)).all()
    # it is a velocity that the bodies can have, the constraints kept
    G, b = dense(problem.G), problem.b
    assert b is not None
    rows, right = np.vstack([H.T, G.T]), np.concatenate([u - problem.w, -b])
    v, *_ = np.linalg.lstsq(rows, right, rcond=None)
    np.testing.assert_allclose(rows @ v, right, atol=1e-8)


def test_contradictory_constraints_have_no_slater_point() -> None:
    # redundant and contradictory bilateral constraints: no solver, no Slater point, no claim
    problem = fclib.GlobalProblem(
        M=np.eye(3),
        H=np.eye(3),
        G=np.array([[0.0, 0], [1, 1], [0, 0]]),
        f=[-1.0, 0, 0],
        w=np.zeros(3),
        b=[0.0, 1.0],
        mu=[0.5],
    )
    found = analysis.analyze(problem)
    assert found.slater.holds is not True
    assert found.existence.verdict in (analysis.UNDECIDED, analysis.PROVEN_NOT)
    consistent = analysis.analyze(problem.replace(b=[0.0, 0.0]))
    assert consistent.existence.verdict == analysis.EXISTS_SLATER


def test_no_verdict_waits_for_a_solution_that_it_does_not_need(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    limits = []

    def solve(*arguments: Any, time_limit: float, **rest: Any) -> Any:
        limits.append(time_limit)
        return fclib.solve(*arguments, time_limit=1e-9, **rest)  # never solved

    monkeypatch.setattr("fclib._solve.solve", solve)
    found = analysis.analyze(local_problem(np.eye(3), q=[-1.0, 0.5, 0], mu=[0.4]))
    assert found.existence.verdict == analysis.EXISTS_SLATER
    assert found.existence.solution is None
    # a body between two walls at rest: there is no Slater point, so the solution decides
    W = np.array([[1.0, 0, -1, 0], [0, 1, 0, 1], [-1, 0, 1, 0], [0, 1, 0, 1]])
    walls = local_problem(W, q=np.zeros(4), mu=[0.3, 0.3])
    assert analysis.analyze(walls, time_limit=20.0).existence.verdict != analysis.EXISTS_SLATER
    assert limits == [_existence.LOOK, 20.0]


# ---- uniqueness, units, words


def test_a_contraction_makes_the_velocity_unique() -> None:
    for mu, unique in ((0.3, True), (1.5, False)):
        problem = local_problem(np.eye(6), [-1, 1, 0, -1, 0, 2], [mu, mu])
        found = analysis.analyze(problem).uniqueness
        assert found.contraction == pytest.approx(mu)
        assert (found.verdict == "unique") == unique
        assert found.reactions


@hypothesis.settings(some, max_examples=5)
@hypothesis.given(seed=st.integers(0, 10**6), mu=st.floats(0.01, 0.5))
def test_the_contraction_bounds_the_fixed_point(seed: int, mu: float) -> None:
    problem = planted_local(seed, nc=4, mu=mu).problem
    assert isinstance(problem, fclib.LocalProblem)
    constant = analysis.analyze(problem).uniqueness.contraction
    W, q = dense(problem.W), problem.q
    rng = np.random.default_rng(seed)
    images = []
    shifts = rng.uniform(0, 1, (2, 4))
    for s in shifts:
        r = np.zeros(12)
        for _ in range(1000):
            u = W @ r + q
            u[::3] += s
            step = r - u / np.linalg.norm(W, 2)
            r = project(step.reshape(-1, 3), problem.mu).ravel()
        u = (W @ r + q).reshape(-1, 3)
        images.append(mu * np.linalg.norm(u[:, 1:], axis=1))
    moved = np.linalg.norm(images[0] - images[1])
    assert moved <= constant * np.linalg.norm(shifts[0] - shifts[1]) + 1e-9


def test_without_friction_the_velocity_is_unique() -> None:
    H = np.hstack([np.eye(3), np.eye(3)])
    problem = fclib.GlobalProblem(M=np.eye(3), H=H, f=[-1, 0, 0], w=np.zeros(6), mu=[0, 0])
    found = analysis.analyze(problem).uniqueness
    assert (found.verdict, found.reactions) == ("unique", False)


@pytest.mark.parametrize("size", [1e-3, 1e-15, 1e-17, 1e-30])
def test_heavy_bodies_are_no_rounding_of_light_ones(size: float) -> None:
    # frictionless, the first contact alone; of the others r = 0 and r = 1 / size are solutions
    normal = np.array([[1, 0, 0], [0, size, -2 * size], [0, -2 * size, size]])
    W = np.kron(normal, np.diag([1.0, 0.0])) + np.kron(np.diag(np.diag(normal)), [[0, 0], [0, 1]])
    problem = local_problem(W, [1.0, 0, 1, 0, 1, 0], np.zeros(3))
    for r in (0.0, 1 / size):
        solution = fclib.Solution(r=np.array([0.0, 0, r, 0, r, 0]))
        assert fclib.merit(problem, solution).error <= 1e-15
    found = analysis.analyze(problem)
    assert found.definiteness.word == "indefinite"
    assert found.uniqueness.verdict == "not unique"
    assert found.existence.verdict == "exists by enumeration"
    assert found.isolated_solutions == 2
    said = brief(problem, problem)
    assert said.record["definiteness"] == "indefinite"
    assert said.record["uniqueness"] is None
    # and what is asymmetric is so beside a part that is not
    skew = np.diag([1.0, size])
    skew = np.block([[skew, np.zeros((2, 2))], [np.zeros((2, 2)), size * np.eye(2)]])
    skew[1, 3], skew[3, 1] = 0.5 * size, -0.5 * size
    reason = analysis.analyze(local_problem(skew, [1.0, 0, 1, 0], [0.01, 0.01])).uniqueness.reason
    assert "contraction" not in reason


@pytest.mark.filterwarnings("error")
def test_contacts_of_nothing_beside_large_joints_overflow_nothing() -> None:
    problem = fclib.GlobalProblem(
        M=np.eye(3),
        H=np.zeros((3, 3)),
        G=np.array([[1e10], [0], [0]]),
        f=[1.0, 0, 0],
        w=[-1e-3, 0, 0],
        b=[5e9],
        mu=[0.5],
    )
    found = analysis.analyze(problem)
    assert found.existence.verdict == analysis.PROVEN_NOT
    assert_no_solution(problem, found.existence.certificate)


def test_units_far_from_one_are_said() -> None:
    problem = planted_local(1).problem
    assert analysis.analyze(problem).units.trouble == ()
    heavy = analysis.analyze(problem.scaled(impulse=1e7))
    assert any("scaled(impulse=" in line for line in heavy.units.trouble)
    assert heavy.units.mass == pytest.approx(1e7 * analysis.analyze(problem).units.mass)
    stuck = local_problem(np.diag([1.0, 1, 1, 0, 0, 0]), [-1, 0, 0, 1, 0, 0], [0.3, 0.3])
    assert "nothing can move" in analysis.analyze(stuck).units.trouble[0]


def test_nothing_in_contact() -> None:
    found = analysis.analyze(planted_global(1, nc=0).problem)
    assert found.existence.verdict == analysis.EXISTS_SLATER
    assert found.islands == found.largest_island == 0
    json.dumps(found.record, allow_nan=False)


def test_without_a_solution_nothing_is_unique() -> None:
    closing = fclib.LocalProblem(spacedim=2, W=np.zeros((2, 2)), q=[-1.0, 0.0], mu=[0.0])
    floating = fclib.GlobalProblem(
        M=np.eye(1), H=np.zeros((1, 0)), G=np.ones((1, 2)), f=[1.0], w=[], b=[0.0, 1.0], mu=[]
    )
    for problem in (closing, floating):
        found = analysis.analyze(problem)
        assert found.existence.verdict == analysis.PROVEN_NOT
        assert found.uniqueness.verdict == found.reactions.verdict == "undecided"
        assert found.self_stress.verdict != analysis.SOLVABLE


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [1e-170, 1e170, 1e300])
def test_velocities_whose_squares_no_double_holds_are_analysed(size: float) -> None:
    found = analysis.analyze(local_problem(np.eye(3), [-size, 0.5 * size, 0], [0.3]), time_limit=1)
    assert found.existence.verdict == analysis.EXISTS_SLATER
    assert found.units.velocity == pytest.approx(size * np.sqrt(1.25 / 3))
    assert any(line.startswith("velocities of") for line in found.units.trouble)


@pytest.mark.filterwarnings("error")
def test_a_contact_whose_W_no_double_holds_is_refused() -> None:
    problem = fclib.GlobalProblem(
        M=np.eye(3), H=1e160 * np.eye(3), f=np.zeros(3), w=[-1.0, 0.7, 0], mu=[0.5]
    )
    with pytest.raises(fclib.ProblemError, match="not a finite number"):
        analysis.analyze(problem, time_limit=1)


def test_friction_whose_square_overflows_is_analysed() -> None:
    problem = local_problem(np.eye(3), [-1, 1, 0], [1e300])
    found = analysis.analyze(problem)
    assert found.existence.verdict == analysis.EXISTS_SLATER
    assert np.isnan(found.uniqueness.contraction)


def test_every_key_is_documented(root: Path) -> None:
    text = (root / "docs" / "analysis.md").read_text()
    problem = squeezed(3, 0.4, 1)
    rolling, _ = planted_rolling(5, 1)
    mixed = planted_global(1, nc=2, p=2).problem
    for one in (problem, rolling, mixed):
        for key in analysis.analyze(one, time_limit=2).record:
            name, _, matrix = key.partition("_")
            general = f"{name}_A" if matrix[:1] in "MHGWVR" and matrix else key
            assert f"`{key}`" in text or f"`{general}`" in text, key
    for key in analysis.reference(mixed).record:
        assert f"`{key}`" in text, key


# ---- reference solutions


@some
@hypothesis.given(seed=st.integers(0, 10**6), p=st.sampled_from([0, 2]))
def test_references_of_planted_problems(seed: int, p: int) -> None:
    for case in (planted_local(seed, nc=4, p=p, mu=0.3), planted_global(seed, nc=4, p=p, mu=0.3)):
        found = analysis.reference(case.problem)
        assert found.certified, found.reason
        assert found.error <= 1e-12
        assert found.solution is not None
        first, second = found.runs[0], found.second
        assert second is not None
        assert not set(first.families) & set(second.families)
        assert found.reaction == "unique"
        np.testing.assert_allclose(found.solution.r, case.solution.r, atol=1e-8)


def table(mu: float, push: float = 0.0) -> fclib.GlobalProblem:
    """A square table of 1 kg on four legs, at rest or pushed along x [N s]."""
    corners = np.array([[1.0, 1], [1, -1], [-1, -1], [-1, 1]])
    H = np.zeros((6, 12))
    for k, (x, y) in enumerate(corners):
        for column, force in enumerate(np.roll(np.eye(3), 1, axis=0)):
            H[:3, 3 * k + column] = force
            H[3:, 3 * k + column] = np.cross([x, y, 0], force)
    f = np.array([push, 0, -1.0, 0, 0, 0])
    return fclib.GlobalProblem(M=np.eye(6), H=H, f=f, w=np.zeros(12), mu=np.full(4, mu))


@pytest.mark.parametrize("push", [0.0, 0.1])
@pytest.mark.parametrize("local", [False, True])
def test_the_least_reactions_of_a_table_are_equal(push: float, local: bool) -> None:
    problem = table(0.5, push)
    found = analysis.reference(problem.condense() if local else problem)
    assert found.certified, found.reason
    assert found.reaction == "minimum norm"
    assert found.freedom == 6
    assert found.solution is not None
    r = found.solution.r.reshape(4, 3)
    np.testing.assert_allclose(r[:, 0], 0.25, atol=1e-7)
    np.testing.assert_allclose(r[:, 1], -push / 4, atol=1e-7)


def test_sliding_reactions_keep_their_direction() -> None:
    problem = table(0.2, push=2.0)
    found = analysis.reference(problem)
    assert found.certified, found.reason
    assert found.solution is not None
    r = found.solution.r.reshape(4, 3)
    np.testing.assert_allclose(r[:, 1], -0.2 * r[:, 0], atol=1e-12)
    assert found.merit is not None
    assert found.merit.slide == 4
    # one freedom is left: the legs along the diagonals
    assert (found.reaction, found.freedom) == ("minimum norm", 1)
    turned = np.array([1.0, -1, 1, -1])
    assert abs(turned @ r[:, 0]) < 1e-7


def test_friction_at_its_limit_bounds_the_least_reactions() -> None:
    # legs whose own least reactions would leave the cone: pushed to the limit of friction
    problem = table(0.2, push=0.19)
    found = analysis.reference(problem)
    assert found.certified, found.reason
    assert found.solution is not None
    r = found.solution.r.reshape(4, 3)
    assert (np.hypot(r[:, 1], r[:, 2]) <= 0.2 * r[:, 0] * (1 + 1e-12)).all()
    np.testing.assert_allclose(r[:, 0].sum(), 1, atol=1e-10)


def test_references_of_rolling_problems() -> None:
    for d in (3, 5):
        problem, r = planted_rolling(d, 4)
        found = analysis.reference(problem)
        assert found.certified, found.reason
        assert found.solution is not None
        np.testing.assert_allclose(found.solution.r, r, atol=1e-9)


def test_no_reference_where_there_is_no_solution() -> None:
    found = analysis.reference(squeezed(3, 0.4, 1), time_limit=1)
    assert not found.certified
    assert found.solution is None
    assert "no algorithm came nearer" in found.reason
    json.dumps(found.record, allow_nan=False)
    with pytest.raises(fclib.ProblemError, match="no solution"):
        _ = found.attributes


def twins(push: float = 0.0, mu: float = 0.5) -> fclib.LocalProblem:
    """A mass on two contacts in the same place: each may carry the load."""
    J = np.tile(np.eye(2), (2, 1))
    return fclib.LocalProblem(spacedim=2, W=J @ J.T, q=J @ [-1.0, push], mu=[mu, mu])


@pytest.mark.parametrize(("push", "mu"), [(0.0, 0.5), (0.25, 0.5), (2.0, 0.5), (2.0, 0.0)])
def test_contacts_at_rest_without_reaction_may_carry_load(push: float, mu: float) -> None:
    problem = twins(push, mu)
    found = analysis.reference(problem)
    assert found.certified, found.reason
    assert found.reaction == "minimum norm"
    assert found.solution is not None
    r = found.solution.r.reshape(2, 2)
    np.testing.assert_allclose(r[:, 0], 0.5, atol=1e-9)
    np.testing.assert_allclose(r[0], r[1], atol=1e-9)
    assert found.error <= 1e-12


def test_a_contact_that_nothing_moves_may_carry_load() -> None:
    W = np.diag([1.0, 1, 0, 0])
    for q in ([-1.0, 0, 0, 0], [-1.0, 2, 0, 0], [1.0, 0, 0, 0], [0.0, 0, 0, 0]):
        found = analysis.reference(fclib.LocalProblem(spacedim=2, W=W, q=q, mu=[0.5, 0.5]))
        assert found.certified, found.reason
        assert (found.reaction, found.freedom) == ("minimum norm", 2)
    still = fclib.GlobalProblem(
        spacedim=2, M=np.eye(2), H=np.zeros((2, 2)), f=[1, 0], w=np.zeros(2), mu=[0.5]
    )
    found = analysis.reference(still)
    assert (found.reaction, found.freedom) == ("minimum norm", 2)


@pytest.mark.parametrize("law", ["plain", "rolling", "spin", "ellipsoid"])
@pytest.mark.parametrize("move", [0, 1])
def test_the_least_reactions_of_twins_of_every_law(law: str, move: int) -> None:
    d = {"plain": 3, "rolling": 5}.get(law, 4)
    J = np.tile(np.eye(d), (2, 1))
    free = np.zeros(d)
    free[0], free[1] = -1, 2.0 * move
    kind, extra = {
        "plain": (fclib.LocalProblem, {}),
        "rolling": (fclib.LocalRollingProblem, {"mu_r": [0.25] * 2}),
        "spin": (fclib.LocalSpinProblem, {"mu_s": [0.25] * 2}),
        "ellipsoid": (fclib.LocalSpinProblem, {"mu_s": [0.25] * 2, "coupled": True}),
    }[law]
    make: Any = kind
    assert isinstance(extra, dict)
    problem = make(spacedim=d, W=J @ J.T, q=J @ free, mu=[0.5, 0.5], **extra)
    found = analysis.reference(problem)
    assert found.certified, found.reason
    assert found.reaction == "minimum norm"
    # what slides may only share the load along its ray; what spins or rolls besides is still free
    free_parts = {"plain": (3, 1), "rolling": (5, 3), "spin": (4, 2), "ellipsoid": (4, 1)}
    assert found.freedom == free_parts[law][move]
    assert found.solution is not None
    r = found.solution.r.reshape(2, d)
    np.testing.assert_allclose(r[0], r[1], atol=1e-8)
    np.testing.assert_allclose(r[0, :2], [0.5, -0.25 * move], atol=1e-8)


def test_reactions_are_undecided_where_rounding_hides_the_rank() -> None:
    g = 2.0**-20
    J = np.array([[1.0, 0, 0], [0, 1, 0], [1, 0, g], [0, 1, 0]])
    problem = fclib.LocalProblem(spacedim=2, W=J @ J.T, q=J @ [-1.0, 0, 0], mu=[0.5, 0.5])
    found = analysis.reference(problem)
    # the exact reactions are unique in N; an error of 1e-12 does not tell
    assert found.reaction in ("undecided", "one of several")


def test_a_run_that_does_nothing_confirms_nothing() -> None:
    g = 2.0**-22
    J = np.zeros((6, 6))
    J[0, 0] = J[2, 0] = J[4, 1] = J[4, 2] = J[1, 3] = J[3, 4] = J[5, 5] = 1
    J[2, 1] = g
    W = J @ J.T
    r, u = np.array([1.5, 0, 0.5, 0, 0, 0]), np.array([0.0, 0, 0, 0, 1, 0])
    problem = fclib.LocalProblem(spacedim=2, W=W, q=u - W @ r, mu=np.zeros(3))
    found = analysis.reference(problem)
    # the velocity is unique, as analyze says: an error within the target does not tell it
    assert analysis.analyze(problem).uniqueness.verdict == "unique"
    assert found.others == ()
    assert not found.certified
    assert "another velocity" in found.reason
    assert found.second is None


@pytest.mark.parametrize("q", [[-1.0, 0], [-1.0, 0.25], [1.0, 0], [-1.0, 2]])
def test_a_confirming_run_starts_away_from_the_solution(q: list[float]) -> None:
    problem = fclib.LocalProblem(spacedim=2, W=np.eye(2), q=q, mu=[0.5])
    found = analysis.reference(problem)
    assert found.certified, found.reason
    assert found.second is not None
    assert found.second.iterations > 0
    assert found.others == ()


def test_other_solutions_are_found_where_there_are_some() -> None:
    # Klarbring 1990
    W = np.linalg.inv([[2.0, -1.0], [-1.0, 1.0]])
    problem = fclib.LocalProblem(spacedim=2, W=W, q=[1.0, 3.5], mu=[2.0])
    stick = analysis.enumerate_solutions(problem).isolated[2]
    solved = analysis.reference(problem)
    assert solved.solution is not None
    data = Data.of_problem(problem)
    assert _reference._another(data, solved.solution, stick.solution, 1e-12)
    assert not _reference._another(data, solved.solution, solved.solution, 1e-12)


def jointed(G: Any, M: Any = (1.0, 2, 3)) -> fclib.GlobalProblem:
    """A body on two contacts, with joints that may be redundant."""
    H = np.zeros((3, 4))
    H[0, 0] = H[1, 1] = H[0, 2] = H[1, 3] = 1
    H[2, 1], H[2, 3] = 0.3, -0.3
    p = np.shape(G)[1]
    return fclib.GlobalProblem(
        spacedim=2,
        M=np.diag(M),
        H=H,
        f=[-1, 0.5, 0.1],
        w=np.zeros(4),
        mu=[0.5, 0.5],
        G=G,
        b=np.zeros(p),
    )


@pytest.mark.parametrize(
    "G",
    [
        [[0.0, 0], [0.1, 0.1], [1 / 3, 1 / 3]],
        [[0.0, 0], [0.1, 0], [1 / 3, 0]],
        [[0.0, 0], [0.1, 0.1 * (1 + 3e-16)], [1 / 3, 1 / 3]],
        [[0.0, 0], [0.0, 0], [0, 0]],
    ],
)
def test_references_with_redundant_joints(G: list[list[float]], tmp_path: Path) -> None:
    problem = jointed(G)
    found = analysis.reference(problem)
    assert found.solution is not None
    assert found.error <= 1e-12
    assert found.solution.l is not None
    assert np.isfinite(found.solution.l).all()
    path = tmp_path / "jointed.hdf5"
    fclib.write(path, problem)
    # it slides with more than one velocity: the status says so, and nothing is raised
    record = json.loads(run("analyze", "--reference", "--json", path, code=None).stdout)
    assert record["reference_reaction"] == found.reaction


def test_the_least_reactions_beside_redundant_joints() -> None:
    # the joints leave one direction free, and both contacts act along it
    H = np.zeros((3, 4))
    H[0, 0] = H[1, 1] = H[0, 2] = H[1, 3] = 1
    G = np.array([[0.0, 0, 0], [1, 2, 0], [1, 2, 0]])
    problem = fclib.GlobalProblem(
        spacedim=2,
        M=np.diag([1.0, 2.0**20, 1]),
        H=H,
        f=[-1, 0, 0],
        w=np.zeros(4),
        mu=[0.5, 0.5],
        G=G,
        b=np.zeros(3),
    )
    found = analysis.reference(problem)
    assert found.certified, found.reason
    assert found.reaction == "minimum norm"
    assert found.solution is not None
    np.testing.assert_allclose(found.solution.r, [0.5, 0, 0.5, 0], atol=1e-9)
    assert found.error <= 1e-12


@pytest.mark.parametrize("kind", ["local", "global"])
@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_least_reactions_are_no_larger_than_known_ones(kind: str, mu: float) -> None:
    """Planted problems with dyadic data, contacts at rest without reaction, and many masses."""
    rng = np.random.default_rng(7)
    for _ in range(25):
        nc, d = int(rng.integers(2, 6)), 2
        state = rng.integers(0, 3, nc)  # open, at rest, pressed
        u, r = np.zeros((nc, d)), np.zeros((nc, d))
        u[state == 0, 0] = 1
        r[state == 2, 0] = 0.5
        r[state == 2, 1] = 0.5 * mu * rng.integers(-1, 2, int((state == 2).sum())) / 2
        n = int(rng.integers(1, 2 * nc + 1))
        H = rng.integers(-4, 5, (n, d * nc)) / 2
        mass = np.exp2(rng.integers(-10, 11, n))
        mus = np.full(nc, mu)
        if kind == "local":
            W = H.T / mass @ H
            problem: Any = fclib.LocalProblem(spacedim=d, W=W, q=u.ravel() - W @ r.ravel(), mu=mus)
        else:
            v = rng.integers(-2, 3, n) / 2
            problem = fclib.GlobalProblem(
                spacedim=d,
                M=np.diag(mass),
                H=H,
                f=mass * v - H @ r.ravel(),
                w=u.ravel() - H.T @ v,
                mu=mus,
            )
        found = analysis.reference(problem)
        assert found.solution is not None
        assert found.solution.u is not None
        if np.linalg.norm(found.solution.u - u.ravel()) > 1e-12 * max(
            1.0, float(np.linalg.norm(u))
        ):
            continue  # another solution
        size = float(np.linalg.norm(r))
        if found.reaction == "unique":
            np.testing.assert_allclose(found.solution.r, r.ravel(), atol=1e-6 * max(size, 1e-3))
        if found.reaction == "minimum norm":
            assert np.linalg.norm(found.solution.r) <= size * (1 + 1e-6) + 1e-12


@pytest.mark.parametrize(
    "wrong",
    [
        {"target": "x"},
        {"target": None},
        {"target": float("nan")},
        {"target": 0},
        {"target": -1e-9},
        {"target": float("inf")},
        {"time_limit": None},
        {"time_limit": "x"},
        {"time_limit": 0},
        {"time_limit": float("nan")},
    ],
)
def test_wrong_numbers_are_named(wrong: dict[str, Any]) -> None:
    problem = twins()
    (name,) = wrong
    with pytest.raises(fclib.OptionError, match=f"{name}: "):
        analysis.reference(problem, **wrong)
    if name == "time_limit":
        with pytest.raises(fclib.OptionError, match="time_limit: "):
            analysis.analyze(problem, **wrong)
        if wrong[name] != 0:  # then it ends at once
            with pytest.raises(fclib.OptionError, match="time_limit: "):
                analysis.enumerate_solutions(problem, **wrong)
    elif wrong[name] not in (0, -1e-9):
        with pytest.raises(fclib.OptionError, match="tol: "):
            analysis.analyze(problem, tol=wrong[name])


@pytest.mark.parametrize("call", ["reference", "analyze", "enumerate_solutions"])
@pytest.mark.parametrize("problem", [None, 3, "a file.hdf5", fclib.Solution(r=[1.0, 0])])
def test_what_is_no_problem_is_named(call: str, problem: Any) -> None:
    with pytest.raises(fclib.ProblemError, match=r"problem: a .* is none of"):
        getattr(analysis, call)(problem)


# ---- contacts and energy


@pytest.mark.parametrize("make", [planted_local, planted_global])
@pytest.mark.parametrize("p", [0, 2])
def test_contacts_are_those_of_the_merit(make: Any, p: int) -> None:
    case = make(5, nc=7, p=p)
    rows = analysis.contacts(case.problem, case.solution)
    assert rows.shape == (7,)
    counts = tuple(int((rows["status"] == s).sum()) for s in ("open", "stick", "slide"))
    merit = fclib.merit(case.problem, case.solution)
    assert counts == (merit.open, merit.stick, merit.slide) == case.statuses
    assert rows["cone"].max() == pytest.approx(merit.cone, abs=1e-15)
    r, u = case.solution.r.reshape(7, 3), case.solution.u.reshape(7, 3)
    np.testing.assert_allclose(rows["r_n"], r[:, 0])
    np.testing.assert_allclose(rows["u_t"], np.linalg.norm(u[:, 1:], axis=1), atol=1e-11)
    slides = rows["status"] == "slide"
    np.testing.assert_allclose(rows["used"][slides], 1)
    assert np.isnan(rows["used"][rows["status"] == "open"]).all()
    np.testing.assert_allclose(
        rows["dissipated"][slides], (rows["mu"] * rows["r_n"] * rows["u_t"])[slides], rtol=1e-9
    )


def test_contacts_of_a_rolling_problem() -> None:
    problem, r = planted_rolling(5, 3)
    rows = analysis.contacts(problem, fclib.Solution(r=r))
    assert {"mu_r", "r_r", "u_r"} <= set(rows.dtype.names or ())
    np.testing.assert_allclose(rows["r_r"], np.linalg.norm(r.reshape(-1, 5)[:, 3:], axis=1))


@pytest.mark.parametrize("p", [0, 2])
def test_the_energy_balances(p: int) -> None:
    case = planted_global(6, nc=6, p=p)
    found = analysis.energy(case.problem, case.solution)
    assert found.residual < 1e-12
    u = case.solution.u
    assert u is not None
    assert found.dissipated == pytest.approx(-case.solution.r @ u)
    # reactions of another problem do not balance with this v
    wrong = analysis.energy(case.problem, case.solution.replace(r=1.1 * case.solution.r))
    assert wrong.residual > 1e-4
    local = planted_local(6, p=p)
    assert analysis.energy(local.problem, local.solution).residual < 1e-12
    assert local.solution.u is not None
    other = local.solution.replace(u=local.solution.u + 0.1)
    assert analysis.energy(local.problem, other).residual > 1e-4


def test_pushing_down_on_the_ground_costs_the_energy_it_had() -> None:
    ball = fclib.GlobalProblem(
        M=2 * np.eye(3), H=np.eye(3), f=[-6.0, 0, 0], w=np.zeros(3), mu=[0.3]
    )
    found = analysis.energy(ball, fclib.solve(ball).solution)
    assert (found.free, found.work) == pytest.approx((9, -9))
    assert found.kinetic == pytest.approx(0, abs=1e-15)


# ---- files and the command line


def test_attributes_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "a.hdf5"
    case = planted_global(1, nc=2)
    fclib.write(path, case.problem)
    assert fclib.read_attributes(path, "solution") == {}
    with pytest.raises(fclib.FileError, match="/solution"):
        fclib.write_attributes(path, "solution", {"a": 1.0})
    fclib.write_solution(path, case.solution)
    fclib.write_attributes(path, "solution", {"merit": 1e-13, "by": "hand, é"})
    fclib.write_attributes(path, "solution", {"merit": 2e-13})
    fclib.write_attributes(path, "info", {"rank": 3})
    assert fclib.read_attributes(path, "solution") == {"merit": 2e-13, "by": "hand, é"}
    assert fclib.read_attributes(path, "info") == {"rank": 3.0}
    with h5py.File(path, "a") as file:
        assert file["solution"].attrs["merit"] == 2e-13
        file["solution"].attrs["many"] = [1.0, 2.0]
        file["solution"].attrs["long"] = "x"  # of variable length
        file["solution"].attrs["whole"] = 3
    assert fclib.read_attributes(path, "solution") == {
        "merit": 2e-13,
        "by": "hand, é",
        "whole": 3.0,
    }
    # what is said of a solution goes with it
    fclib.write_solution(path, case.solution)
    assert fclib.read_attributes(path, "solution") == {}
    assert fclib.read_attributes(path, "info") == {"rank": 3.0}
    # a guess has its own, and they go with it
    with pytest.raises(fclib.FileError, match="/guesses"):
        fclib.write_attributes(path, "guesses/1", {"error": 1.0})
    fclib.write_guesses(path, [case.solution, case.solution])
    fclib.write_attributes(path, "guesses/2", {"error": 0.5})
    assert fclib.read_attributes(path, "guesses/1") == {}
    assert fclib.read_attributes(path, "guesses/2") == {"error": 0.5}
    assert fclib.read_attributes(path, "guesses/3") == {}
    with pytest.raises(fclib.FileError, match="/guesses/3"):
        fclib.write_attributes(path, "guesses/3", {"error": 1.0})
    fclib.write_guesses(path, [case.solution, case.solution])
    assert fclib.read_attributes(path, "guesses/2") == {}
    with pytest.raises(fclib.OptionError, match="solution, info"):
        fclib.read_attributes(path, "guesses")


def test_the_command_analyses_stores_and_checks(tmp_path: Path) -> None:
    path = tmp_path / "table.hdf5"
    guess = fclib.Solution(r=np.zeros(12))
    problem = table(0.5, 0.1).replace(info=fclib.ProblemInfo(title="a table"))
    fclib.write(path, problem, guesses=[guess])
    done = run("analyze", "--write", "--reference", "--json", path)
    record = json.loads(done.stdout)
    assert record["existence"] == analysis.EXISTS_SLATER
    assert record["rank_W"] == 6
    assert record["reference_certified"] is True
    stored = fclib.read(path)
    assert fclib.digest(stored) == fclib.digest(problem) == record["digest"]
    assert stored.info.title == "a table"
    assert "exists by Slater" in stored.info.math_info
    assert stored.matrix_info["H"].rank == 6
    assert stored.matrix_info["M"].conditioning == 1
    assert len(fclib.read_guesses(path)) == 1
    assert fclib.read_attributes(path, "info")["hyperstaticity"] == 6
    told = fclib.read_attributes(path, "solution")
    assert told["reaction"] == "minimum norm"
    assert told["certified"] == "yes"
    assert isinstance(told["merit_error"], float)
    assert told["merit_error"] <= 1e-12
    assert "fclib " in str(told["versions"])

    # what is there is judged again, and the words are kept through another analysis
    checked = run("check", "--tol", "1e-12", "--contacts", "--json", path)
    judged = json.loads(checked.stdout)
    assert (judged["stick"], judged["open"], judged["slide"]) == (4, 0, 0)
    assert judged["says"]["certified"] == "yes"
    assert [row["status"] for row in judged["contacts"]] == ["stick"] * 4
    run("analyze", "--write", path)
    assert fclib.read_attributes(path, "solution") == told
    shown = run("check", "--contacts", path)
    assert shown.stdout.count("stick") >= 4


def test_the_command_names_what_is_infeasible(tmp_path: Path) -> None:
    path = tmp_path / "squeezed.hdf5"
    fclib.write(path, squeezed(3, 0.4, 1))
    done = run("analyze", path)
    assert analysis.PROVEN_NOT in done.stdout
    assert "Farkas" in done.stderr
    missing = run("analyze", tmp_path / "none.hdf5", code=1)
    assert "none.hdf5" in missing.stderr


def test_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    H = np.hstack([np.eye(3), np.diag([-1.0, 1.0, 1.0])])
    jammed = fclib.GlobalProblem(M=np.eye(3), H=H, f=[1, 0, 0], w=np.zeros(6), mu=[0.5, 0.5])
    monkeypatch.setattr("fclib.analysis._conic.available", lambda: False)
    with pytest.raises(ImportError, match=r"fclib\[analysis\]"):
        analysis.analyze(jammed)


def test_importing_fclib_loads_none_of_it() -> None:
    code = (
        "import sys, fclib; print([m for m in ('clarabel', 'fclib.analysis') if m in sys.modules])"
    )
    done = ran(sys.executable, "-c", code)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("W", "q", "mu"),
    [
        ([[2.0, 1e-16], [-1e-16, -1e-16]], [-1e-16, 2.0], 1e40),
        ([[0.0, 1e-16], [1.0, 1e8]], [-1e-8, -1.0], 1.0),
    ],
)
def test_what_is_refuted_exactly_is_not_said_to_exist(W: Any, q: Any, mu: float) -> None:
    """A solution within the tolerance, of a problem whose every state is refuted."""
    found = analysis.analyze(fclib.LocalProblem(spacedim=2, W=W, q=q, mu=[mu]))
    assert found.existence.verdict == analysis.UNDECIDED
    assert "each state of the contacts is refuted" in found.existence.reason


def test_joints_of_huge_units_end_in_no_traceback() -> None:
    rng = np.random.default_rng(3)
    for scale in (1e10, 1e100, 1e150):
        B = rng.normal(size=(5, 4)) * np.array([1, 1, 1, scale])
        problem = fclib.LocalProblem(
            spacedim=2,
            W=np.eye(2),
            q=[-1.0, 0.1],
            mu=[0.5],
            V=rng.normal(size=(2, 4)),
            R=B.T @ B,
            s=rng.normal(size=4),
        )
        assert analysis.analyze(problem, time_limit=2).existence.verdict in analysis.VERDICTS


# ---- a quick look

load: Any = fclib.load


def singular(a: Any, bound: float = 1e-12) -> tuple[int, float]:
    """Rank and conditioning by all singular values."""
    values = np.linalg.svd(a.toarray(), compute_uv=False)
    kept = values[values > bound * values[0]]
    return len(kept), kept[0] / kept[-1]


def test_quick_spectra_are_those_of_all_singular_values() -> None:
    """Symmetric, asymmetric, long and wide; of blocks that are found directly, and by A^T A."""
    random = np.random.default_rng(5)
    low = sp.csc_array(random.standard_normal((40, 12)) @ random.standard_normal((12, 40)))
    wide = sp.csc_array(random.standard_normal((30, 90)))
    for a in (low, sp.csc_array(low + low.T), wide, wide.T.tocsc(), sp.block_diag([low, wide])):
        a = sp.csc_array(a)
        rank, conditioning = singular(a)
        for limit in (1000, 100):
            found = _spectrum.quick_spectrum(a, limit)
            assert not found.estimate
            assert found.rank == rank
            assert found.conditioning == pytest.approx(conditioning, rel=1e-6)


def test_large_blocks_are_squared_or_estimated(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(6)
    # a chain: one block, and no structural defect
    a = sp.csc_array(sp.diags_array([random.uniform(1, 2, 200)] * 2, offsets=[0, 1]))
    rank, conditioning = singular(a)
    monkeypatch.setattr(_spectrum, "SVD", 50)
    squared = _spectrum.quick_spectrum(a, 300)
    assert "A^T A" in squared.method
    assert squared.rank == rank
    assert squared.conditioning == pytest.approx(conditioning, rel=1e-4)
    rough = _spectrum.quick_spectrum(a, 100)
    assert rough.estimate
    assert "60 steps of Lanczos" in rough.method
    assert rough.rank == rank
    assert 1 < rough.conditioning <= conditioning * (1 + 1e-9)
    assert rough.largest == pytest.approx(squared.largest, rel=1e-2)
    # what is singular does not look ill-conditioned
    thin = random.standard_normal((120, 30))
    gram = sp.csc_array(thin @ thin.T)
    assert _spectrum.quick_spectrum(gram, 100).conditioning <= singular(gram)[1] * (1 + 1e-6)
    # all steps give all values
    small = sp.csc_array(random.standard_normal((20, 20)))
    exact = np.linalg.svd(small.toarray(), compute_uv=False)
    values = _spectrum.bidiagonal(small.__matmul__, small.T.__matmul__, 20)
    np.testing.assert_allclose(values, exact, rtol=1e-8)


def test_brief_facts_of_joints_and_of_an_asymmetric_W(monkeypatch: pytest.MonkeyPatch) -> None:
    linked = load("tiny/FourBar/0150")
    found = brief(linked, linked.condense())
    reduced = linked.condense().eliminate()
    assert set(found.matrix_info) == {"M", "H", "G", "W", "V", "R"}
    assert all(one.rank and one.conditioning for one in found.matrix_info.values())
    rank, _ = singular(sp.csc_array(reduced.W))
    assert found.matrix_info["W"].rank == found.record["rank_W"] == rank
    assert "of W' = W - V R^-1 V^T by" in found.matrix_info["W"].comment
    W = np.eye(6) + 0.2 * np.triu(np.ones((6, 6)), 1)
    skew = fclib.LocalProblem(spacedim=3, W=W, q=np.array([-1.0, 0, 0] * 2), mu=[0.5, 0.5])
    found = brief(skew, skew)
    rank, conditioning = singular(sp.csc_array(W))
    assert found.matrix_info["W"].rank == rank
    assert found.matrix_info["W"].conditioning == pytest.approx(conditioning, rel=1e-2)
    assert "not symmetric by 0.2" in found.words
    # larger than what is found, the rank is a bound, and says so
    monkeypatch.setattr(_brief, "RANKS", 20)
    monkeypatch.setattr(_spectrum, "SVD", 5)
    for problem in (linked, load("tiny/KaplasTower/0030")):
        rough = brief(problem, problem.condense())
        info = rough.matrix_info["W"]
        assert "at most" in info.comment
        assert "Lanczos" in info.comment
        exact = analysis.analyze(problem).record
        assert info.rank >= exact["rank_W"]
        assert info.conditioning <= 1.01 * exact["conditioning_W"]
        assert rough.record["rank_W"] is None
        assert "The rank of W" in rough.words
