"""Bilateral constraints of which some follow from others: solved where they agree, else refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import pytest

import fclib
from ball_judge import judge
from helpers import converged, dense, planted_global, planted_local

Array: TypeAlias = npt.NDArray[np.float64]

SOLVERS = ["auto", "nsgs", "nsn-ac"]


def doubled(p: int) -> Array:
    """Each constraint twice, as a parallel linkage has them, the second in other units."""
    return np.hstack([np.eye(p), 3.0 * np.eye(p)])


def closed(p: int) -> Array:
    """The last constraint is the sum of the others: a loop that closes."""
    return np.hstack([np.eye(p), np.ones((p, 1))])


def with_nothing(p: int) -> Array:
    """A constraint of nothing."""
    return np.hstack([np.zeros((p, 1)), np.eye(p)])


REPEATS: dict[str, Callable[[int], Array]] = {
    "doubled": doubled,
    "closed": closed,
    "with_nothing": with_nothing,
}


def repeated_global(seed: int, repeats: Array, rolling: bool = False, d: int = 3) -> Any:
    problem: Any = planted_global(seed, d=d, p=len(repeats), rolling=rolling).problem
    return problem.replace(G=dense(problem.G) @ repeats, b=repeats.T @ problem.b)


def repeated_local(seed: int, repeats: Array, rolling: bool = False, d: int = 3) -> Any:
    problem: Any = planted_local(seed, d=d, p=len(repeats), rolling=rolling).problem
    return problem.replace(
        V=dense(problem.V) @ repeats,
        R=repeats.T @ dense(problem.R) @ repeats,
        s=repeats.T @ problem.s,
    )


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("make", [repeated_global, repeated_local])
@pytest.mark.parametrize("repeats", REPEATS)
def test_consistent_constraints_are_solved_with_the_shortest_multiplier(
    repeats: str, make: Any, solver: str
) -> None:
    pattern = REPEATS[repeats](4)
    for rolling in (False, True):
        if rolling and solver == "nsn-ac":
            continue
        problem = make(3, pattern, rolling)
        result = fclib.solve(problem, solver=solver)
        assert result.status == "converged", (result.status, result.error)
        assert judge(problem, result.solution).error <= 1e-8
        # shortest: without a part in what the multipliers may add up to without effect
        lam = result.solution.l
        assert lam is not None
        idle = np.linalg.svd(pattern)[2][4:]
        assert np.linalg.norm(idle @ lam) <= 1e-12 * np.linalg.norm(lam)


@pytest.mark.parametrize("make", [repeated_global, repeated_local])
@pytest.mark.parametrize("repeats", REPEATS)
def test_constraints_that_contradict_others_are_refused_by_name(repeats: str, make: Any) -> None:
    pattern = REPEATS[repeats](4)
    problem = make(5, pattern)
    name = "b" if isinstance(problem, fclib.GlobalProblem) else "s"
    wrong = getattr(problem, name).copy()
    row = 0 if repeats == "with_nothing" else 4
    wrong[row] += 0.25
    with pytest.raises(fclib.UnsuitableError, match="contradicts the others") as caught:
        fclib.solve(problem.replace(**{name: wrong}))
    named = int(str(caught.value).split("bilateral constraint ")[1].split(":")[0])
    # one of those that the wrong one is a combination with
    others = np.flatnonzero(np.linalg.svd(pattern)[2][4:].T.any(axis=1))
    assert named in others
    if repeats == "with_nothing":
        assert named == 0


@pytest.mark.parametrize("angle", [1e-5, 1e-6, 1e-7])
def test_nearly_parallel_constraints_are_solved_where_the_bodies_are_known(angle: float) -> None:
    """R = G^T M^-1 G has the square of their condition number, beyond any double."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        planted = planted_global(seed, p=2)
        problem: Any = planted.problem
        G = dense(problem.G).copy()
        G[:, 1] = G[:, 0] + angle * rng.standard_normal(len(G))
        v, multiplier = planted.solution.v, planted.solution.l
        assert v is not None
        assert multiplier is not None
        lam = np.linalg.lstsq(G, dense(problem.G) @ multiplier, rcond=None)[0]
        force = dense(problem.M) @ v - dense(problem.H) @ planted.solution.r - G @ lam
        hard = problem.replace(G=G, b=-G.T @ v, f=force)
        result = fclib.solve(hard)
        assert result.status == "converged", (seed, result.status, result.error)
        assert judge(hard, result.solution).error <= 1e-8


def test_constraints_of_many_loops_are_solved() -> None:
    """A frame of 40 bodies in a ring of rods, each held twice."""
    rng = np.random.default_rng(1)
    n, d = 120, 3
    ring = np.zeros((n, 40))
    for k in range(40):
        ring[3 * k : 3 * k + 3, k] = rng.standard_normal(3)
        other = 3 * ((k + 1) % 40)
        ring[other : other + 3, k] = rng.standard_normal(3)
    G = np.hstack([ring, ring])
    H = np.zeros((n, d * 5))
    for a in range(5):
        H[24 * a : 24 * a + 3, d * a : d * a + d] = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    problem = fclib.GlobalProblem(
        spacedim=d, M=np.eye(n), H=H, f=rng.standard_normal(n), w=np.zeros(d * 5),
        mu=np.full(5, 0.5), G=G, b=np.zeros(80),
    )  # fmt: skip
    result = converged(problem)
    assert judge(problem, result.solution).error <= 1e-8
    lam = result.solution.l
    assert lam is not None
    assert lam[:40] == pytest.approx(lam[40:], rel=1e-9, abs=1e-12)


def held_contact(seed: int) -> fclib.GlobalProblem:
    """A contact that the joints hold in all its directions beside one that they do not."""
    rng = np.random.default_rng(seed)
    n, p = 12, 5
    root = rng.standard_normal((n, n))
    G = rng.standard_normal((n, p))
    turn = rng.standard_normal((p, 3))
    H = np.hstack([G @ turn, rng.standard_normal((n, 3))])
    b = rng.standard_normal(p)
    # u = turn^T G^T v + w = 0 of the first
    w = np.concatenate([turn.T @ b, np.zeros(3)])
    return fclib.GlobalProblem(
        spacedim=3, M=root @ root.T + np.eye(n), H=H, f=10 * rng.standard_normal(n), w=w,
        mu=np.full(2, 0.5), G=G, b=b,
    )  # fmt: skip


def test_a_contact_that_joints_hold_is_not_moved_by_rounding() -> None:
    for seed in range(30):
        problem = held_contact(seed)
        plain = problem.condense().eliminate()
        assert not dense(plain.W)[:3].any(), seed
        assert not dense(plain.W)[:, :3].any(), seed
        assert not plain.q[:3].any(), seed
        result = fclib.solve(problem)
        assert result.status == "converged", (seed, result.status, result.error)


def held_by_close_joints(seed: int, angle: float, closing: float) -> fclib.GlobalProblem:
    """A contact that joints hold which nearly follow from each other, beside one that moves."""
    problem = held_contact(seed)
    assert problem.b is not None
    rng = np.random.default_rng(seed)
    G = dense(problem.G).copy()
    G[:, 1] = G[:, 0] + angle * rng.standard_normal(len(G))
    turn = rng.standard_normal((5, 3))
    # what the first two tell apart is large in their multipliers
    turn[0] -= 1 / angle
    turn[1] += 1 / angle
    H = np.hstack([G @ turn, dense(problem.H)[:, 3:]])
    w = np.concatenate([turn.T @ problem.b, np.zeros(3)])
    w[0] -= closing
    return problem.replace(G=G, H=H, w=w)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("angle", [1e-2, 1e-3, 1e-4])
def test_a_contact_that_close_joints_hold_gets_no_reaction(angle: float, solver: str) -> None:
    """W'_aa is what R^-1 V^T leaves of it, whose rounding grows with R's condition."""
    for seed in range(10):
        for closing in (0.0, 1e-13):
            problem = held_by_close_joints(seed, angle, closing)
            plain = problem.condense().eliminate()
            assert not dense(plain.W)[:3].any(), seed
            result = fclib.solve(problem, solver=solver, tol=1e-6)
            assert not result.solution.r[:3].any(), (seed, result.solution.r)
            guess = fclib.Solution(r=np.full(6, 1e8), l=np.zeros(5))
            warm = fclib.solve(problem, solver=solver, tol=1e-6, guess=guess)
            for found in (result, warm):
                assert found.converged, (seed, found.status, found.error)
                assert not found.solution.r[:3].any()


def test_constraints_that_differ_by_the_rounding_of_velocities_do_not_contradict() -> None:
    for seed in range(10):
        problem: Any = planted_global(seed, p=2).problem
        G = dense(problem.G)
        twice = problem.replace(G=np.hstack([G, G]), b=np.array([0.0, 0.0, 3e-17, -3e-17]))
        assert fclib.solve(twice).status != "infeasible"


def test_a_contradiction_is_refused_where_the_tolerance_does_not_allow_it() -> None:
    off = 1e-6  # [m/s] between a constraint and its repetition
    for seed in range(10):
        problem: Any = planted_global(seed, p=2).problem
        G = dense(problem.G)
        twice = problem.replace(G=np.hstack([G, G]), b=np.array([0.0, 0.0, off, -off]))
        result = converged(twice, tol=1e-4)
        v = result.solution.v
        assert v is not None
        left = np.abs(dense(twice.G).T @ v + twice.b)
        assert left.max() >= 0.5 * off  # no velocity does better
        assert (left <= 1e-4 * (np.abs(dense(twice.G)).T @ np.abs(v) + np.abs(twice.b))).all()
        with pytest.raises(fclib.UnsuitableError, match=r"contradicts the others.*best solution"):
            fclib.solve(twice, tol=1e-8)
        local = twice.condense()
        assert fclib.solve(local, tol=1e-4).converged
        with pytest.raises(fclib.UnsuitableError, match=r"contradicts the others.*best solution"):
            fclib.solve(local, tol=1e-8)
        with pytest.raises(fclib.UnsuitableError, match="contradicts the others"):
            local.eliminate()


def rotated(axis: Array, angle: float) -> Array:
    """The rotation about an axis of length one."""
    a = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * a + (1 - np.cos(angle)) * a @ a)


def loop_in_single_precision(
    seed: int, off: float = 0.0, precision: Any = np.float32
) -> fclib.GlobalProblem:
    """Four rods in a ring of hinges, anywhere in space, on two contacts, as an engine has them.

    Each hinge has five rows; three of the twenty follow from the others. All numbers are rounded
    to `precision`, b is its rounding too; `off` [m/s] is a true contradiction.
    """

    def rounded(x: npt.ArrayLike) -> npt.NDArray[Any]:
        return np.asarray(x, dtype=precision)

    rng = np.random.default_rng(seed)
    to = rng.standard_normal(3)
    turn = rotated(to / np.linalg.norm(to), rng.uniform(0.3, 3.0))
    width, height = rng.uniform(0.3, 0.6, 2)
    corners = np.array([[0, 0, 0], [width, 0, 0], [width, 0, height], [0, 0, height]]) @ turn.T
    centres = (corners + np.roll(corners, 1, axis=0)) / 2  # of rod k, between hinges k - 1 and k
    masses = rng.uniform(0.5, 2.0, 4)
    M = np.zeros((24, 24))
    for k, mass in enumerate(masses):
        M[6 * k : 6 * k + 3, 6 * k : 6 * k + 3] = mass * np.eye(3)
        M[6 * k + 3 : 6 * k + 6, 6 * k + 3 : 6 * k + 6] = mass * 0.01 * np.eye(3)

    def rows(axes: Array, point: Array, body: int) -> Array:
        """Velocities of a body's point along axes."""
        arm = rounded(rounded(point) - rounded(centres[body]))
        result = np.zeros((len(axes), 24), dtype=precision)
        result[:, 6 * body : 6 * body + 3] = axes
        result[:, 6 * body + 3 : 6 * body + 6] = np.cross(arm, axes)
        return result

    J = []
    for k in range(4):
        other = (k + 1) % 4
        axes = rounded(np.eye(3))
        J.append(rows(axes, corners[k], k) - rows(axes, corners[k], other))
        across = np.zeros((2, 24), dtype=precision)
        normal = rounded(turn[:, [0, 2]].T)
        across[:, 6 * k + 3 : 6 * k + 6] = normal
        across[:, 6 * other + 3 : 6 * other + 6] = -normal
        J.append(across)
    G = np.vstack(J).astype(float).T
    b = rounded(rng.uniform(-1, 1, 20) * 1e-7).astype(float)
    if off:
        # along what no velocity reaches, in the metric of M
        A = np.linalg.solve(np.linalg.cholesky(M), G)
        b += off * np.linalg.svd(A)[2][-1]
    H = np.hstack([rows(turn.T[[2, 0, 1]], corners[k], 0).T for k in (0, 3)])
    f = np.zeros(24)
    for k, mass in enumerate(masses):
        f[6 * k : 6 * k + 3] = -0.05 * mass * turn[:, 2]
    f[:3] += rng.standard_normal(3) * 0.1
    return fclib.GlobalProblem(
        spacedim=3, M=M, H=H.astype(float), G=G, f=f, w=np.zeros(6), mu=[0.5, 0.5], b=b
    )


def agreeing(problem: fclib.GlobalProblem, rank: int) -> fclib.GlobalProblem:
    """The nearest rows of this rank in the metric of M, by a singular value decomposition."""
    L = np.linalg.cholesky(dense(problem.M))
    A = np.linalg.solve(L, dense(problem.G))
    length = np.linalg.norm(A, axis=0)
    U, sizes, Vt = np.linalg.svd(A / length)
    b = Vt[:rank].T @ (Vt[:rank] @ (problem.b / length)) * length
    G = L @ (U[:, :rank] * sizes[:rank]) @ Vt[:rank] * length
    return problem.replace(G=G, b=b)


@pytest.mark.parametrize("solver", SOLVERS)
def test_loops_in_single_precision_are_made_consistent(solver: str) -> None:
    for seed in range(12):
        problem = loop_in_single_precision(seed)
        result = fclib.solve(problem, solver=solver)
        assert result.status == "converged", (seed, result.status, result.error, result.message)
        assert " m/s" in result.message
        assert "single precision" in result.message
        # whoever makes the rows agree finds the same solution, and so does the merit
        assert judge(agreeing(problem, 17), result.solution).error <= 2e-8, seed
        assert fclib.merit(problem, result.solution).error == pytest.approx(result.error, rel=1e-6)
        v = result.solution.v
        assert v is not None
        wrong = fclib.Solution(r=result.solution.r, l=result.solution.l, v=v + 1e-5)
        assert fclib.merit(problem, wrong).error > 1e-6
        # along rows that say nothing a multiplier does nothing: it hides no error
        lam = result.solution.l
        assert lam is not None
        idle = np.linalg.svd(dense(problem.G))[2][-1]
        pushed = fclib.Solution(r=result.solution.r, l=lam + 1e8 * idle, v=v + 1e-3)
        assert fclib.merit(problem, pushed).error > 1e-6


def test_a_true_contradiction_in_single_precision_stays_refused() -> None:
    for seed in range(6):
        for off in (1e-4, 1e-2):
            with pytest.raises(fclib.UnsuitableError, match="contradicts the others"):
                fclib.solve(loop_in_single_precision(seed, off))
        # and what is rounding of floats is none of doubles, unless the problem says so
        with pytest.raises(fclib.UnsuitableError, match="contradicts the others"):
            fclib.solve(loop_in_single_precision(seed, 1e-8, np.float64))
        stated = loop_in_single_precision(seed, 1e-8, np.float64).replace(
            info=fclib.ProblemInfo(description='Rounded.\n{"precision": 6e-08}')
        )
        result = converged(stated)
        assert "stated precision" in result.message


def test_numbers_of_few_bits_are_meant_exactly() -> None:
    """They are floats too, and were rounded by nobody."""
    G = np.array([[1.0, 1.0], [-0.5, -0.5], [0.25, 0.25]])
    problem = fclib.GlobalProblem(
        spacedim=3, M=np.eye(3), H=np.eye(3), G=G, f=[-1, 0, 1], w=np.zeros(3), mu=[0.5],
        b=[0.0, 1e-9],
    )  # fmt: skip
    assert problem.consistent() is None
    with pytest.raises(fclib.UnsuitableError, match="contradicts the others"):
        fclib.solve(problem, tol=1e-12)


def test_the_local_form_of_a_loop_in_single_precision_is_consistent() -> None:
    problem = loop_in_single_precision(0)
    local = problem.condense()
    result = converged(local)
    assert judge(local, result.solution).error <= 1e-8
    whole = fclib.solve(problem).solution
    assert result.solution.r == pytest.approx(whole.r, rel=1e-6, abs=1e-9)


def test_a_recorded_loop_in_single_precision_is_solved() -> None:
    """A four-bar at rest on the ground: three of its 20 rows follow from others, to 1e-7."""
    path = Path(__file__).parents[2].parent / "shared/data/challenges/newton-fourbar-0100.hdf5"
    if not path.exists():
        pytest.skip("the recorded loop is not here")
    problem = fclib.read(path)
    assert isinstance(problem, fclib.GlobalProblem)
    assert problem.b is not None
    for solver in SOLVERS:
        result = converged(problem, solver=solver)
        assert "1.1e-07 m/s" in result.message
        assert judge(agreeing(problem, 17), result.solution).error <= 2e-8
        v = result.solution.v
        assert v is not None
        assert np.abs(v).max() < 2e-6  # it rests, and no rounding turns it
    b = problem.b.copy()
    b[13] += 1e-3
    with pytest.raises(fclib.UnsuitableError, match=r"contradicts the others.*best solution"):
        fclib.solve(problem.replace(b=b))


def test_what_conversions_lose_to_rounding_is_put_right() -> None:
    """Nearly parallel constraints that disagree: fast bodies, of which the contacts see little."""
    for seed in range(20):
        problem: Any = planted_global(seed, p=2).problem
        rng = np.random.default_rng(seed)
        G = dense(problem.G).copy()
        G[:, 1] = G[:, 0] + 1e-7 * rng.standard_normal(len(G))
        b = problem.b.copy()
        b[1] = b[0] + 1e-4 * rng.standard_normal()
        hard = problem.replace(G=G, b=b)
        result = fclib.solve(hard)
        assert result.status == "converged", (seed, result.status, result.error)
        assert judge(hard, result.solution).error <= 1e-8


def test_a_component_without_inertia_of_its_own_is_not_taken_for_one_that_is_held() -> None:
    """W' is no matrix of bodies here: zero on its diagonal, and not beside it."""
    W = np.array([[1.0, 0, 0.5], [0, 1, 0], [0.5, 0, 1]])
    problem = fclib.LocalProblem(
        spacedim=3,
        W=W,
        V=np.array([[1.0], [0], [0]]),
        R=np.array([[1.0]]),
        q=[-1, 0, -1],
        s=[0.0],
        mu=[0.5],
    )
    eliminated = dense(problem.eliminate().W)
    assert eliminated == pytest.approx(W - np.diag([1.0, 0, 0]))


def test_what_closes_by_rounding_is_not_called_infeasible() -> None:
    """Joints hold a contact in its normal direction, to the last digits of their velocities."""
    H, G = np.zeros((6, 6)), np.zeros((6, 1))
    H[:3, :3] = H[3:, 3:] = np.eye(3)
    G[0] = 1
    slow, fast = 2e-15, 1e-3
    problem = fclib.GlobalProblem(
        spacedim=3,
        M=np.eye(6),
        H=H,
        G=G,
        f=[0, 1, 0, -3, 0.5, 0],
        b=[slow],
        w=np.zeros(6),
        mu=[0.5, 0.5],
    )
    assert fclib.solve(problem).status == "converged"
    assert fclib.solve(problem.replace(b=[fast])).status == "infeasible"


def test_no_claim_rests_on_what_closes_far_below_the_free_velocities() -> None:
    """A contact that nothing moves closes by 1e-9 m/s: exactly proven, and no claim of a solver."""
    H = np.zeros((3, 6))
    H[:, 3:] = np.eye(3)

    def closing(speed: float) -> fclib.GlobalProblem:
        w = [-speed, 0, 0, 0, 0, 0]
        return fclib.GlobalProblem(spacedim=3, M=np.eye(3), H=H, f=[-3, 0.5, 0], w=w, mu=[0.5] * 2)

    assert fclib.solve(closing(1e-9), tol=1e-17).status == "stalled"
    assert fclib.solve(closing(1e-3), tol=1e-17).status == "infeasible"


def light_bodies_on_joints(seed: int) -> Any:
    """Bodies of 1e-9 to 1e-5 kg, each on a joint of a heavy one; contacts press on them."""
    rng = np.random.default_rng(seed)
    k, nc = 4, 3
    masses = np.concatenate([10 ** rng.uniform(0, 2, k), 10 ** rng.uniform(-9, -5, k)])
    G = np.vstack([np.eye(k), -np.eye(k)])
    H = np.zeros((2 * k, 3 * nc))
    for c in range(nc):
        i, j, other = rng.integers(k), rng.integers(k), rng.integers(2 * k)
        H[k + i, 3 * c] = H[k + j, 3 * c + 1] = H[other, 3 * c + 2] = 1
    f = np.zeros(2 * k)
    f[:k] = -rng.uniform(1, 100, k)
    w = rng.standard_normal(3 * nc) * 1e-3
    return fclib.GlobalProblem(M=np.diag(masses), H=H, G=G, f=f, w=w, b=np.zeros(k), mu=[0.5] * nc)


@pytest.mark.parametrize("seed", [29, 42, 52])
def test_what_misses_the_tolerance_holds_its_joints(seed: int) -> None:
    """What rounding breaks of them is no error of the best solution that was found."""
    problem = light_bodies_on_joints(seed)
    result = fclib.solve(problem, tol=1e-12)
    assert not result.converged
    # with the same r: a light body has the velocity of its heavy one
    M, H, r = dense(problem.M).diagonal(), dense(problem.H), result.solution.r
    force = H @ r + problem.f
    own = (force[:4] + force[4:]) / (M[:4] + M[4:])
    v = np.concatenate([own, own])
    held = fclib.Solution(v=v, u=H.T @ v + problem.w, r=r, l=force[4:] - M[4:] * own)
    assert result.error <= 1.5 * fclib.merit(problem, held).error
