"""All solutions of small problems, by the states of their contacts."""

from __future__ import annotations

import json
from collections import Counter
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st
from scipy.optimize import linprog

import fclib
from fclib import analysis
from fclib.analysis import _enumerate
from fclib.analysis._data import Data
from fclib.analysis._reactions import reactions
from helpers import Array, dense, local_problem, planted_global, planted_local
from helpers_cli import run

some = hypothesis.settings(deadline=None, max_examples=25, derandomize=True)
seeds = st.integers(0, 10**6)

STATES = {"o": "open", "+": "slide +", "-": "slide -", "s": "stick", "c": "closed"}


def names(found: analysis.Enumeration) -> list[tuple[str, ...]]:
    return sorted(one.states for one in found.solutions)


def velocities(found: analysis.Enumeration) -> Array:
    return np.array([one.u for one in found.isolated], dtype=float)


def assert_exact(problem: fclib.LocalProblem, one: analysis.SolutionSet) -> None:
    """The solution is one of the planar problem as given, nothing rounded."""
    exact = [[Fraction(float(value)) for value in row] for row in dense(problem.W)]
    for k, row in enumerate(exact):
        terms = [a * b for a, b in zip(row, one.r, strict=True)]
        assert one.u[k] == sum(terms, Fraction(float(problem.q[k])))
    for a in range(problem.nc):
        mu = Fraction(float(problem.mu[a]))
        (un, ut), (rn, rt) = one.u[2 * a : 2 * a + 2], one.r[2 * a : 2 * a + 2]
        assert un >= 0
        assert un * rn == 0
        assert abs(rt) <= mu * rn
        assert ut == 0 or rt == (-mu if ut > 0 else mu) * rn


def by_linear_programs(W: Array, q: Array, mu: Array) -> list[tuple[str, ...]]:
    """The states that have solutions, each by a linear program in doubles: u, r and a margin."""
    nc, m = mu.size, q.size
    found = []
    for states in product(*("o+-s" if mu[a] > 0 else "oc" for a in range(nc))):
        bounds: list[tuple[float | None, float | None]] = [(None, None)] * (2 * m) + [(None, 1)]
        equal, below = [*np.hstack([np.eye(m), -W, np.zeros((m, 1))])], []
        for a, state in enumerate(states):
            N, T = 2 * a, 2 * a + 1
            row = np.zeros(2 * m + 1)
            if state == "o":
                bounds[m + N] = bounds[m + T] = (0, 0)
                row[[N, -1]] = -1, 1
                below.append(row)
                continue
            bounds[N] = (0, 0)
            bounds[m + N] = (0, None)
            if state == "c":
                bounds[m + T] = (0, 0)
            elif state == "s":
                bounds[T] = (0, 0)
                for sign in (1, -1):
                    edge = np.zeros(2 * m + 1)
                    edge[[m + T, m + N]] = sign, -mu[a]
                    below.append(edge)
            else:
                sign = 1 if state == "+" else -1
                row[[T, -1]] = -sign, 1
                below.append(row)
                edge = np.zeros(2 * m + 1)
                edge[[m + T, m + N]] = 1, sign * mu[a]
                equal.append(edge)
        goal = np.zeros(2 * m + 1)
        goal[-1] = -1
        answer = linprog(
            goal,
            A_ub=np.array(below) if below else None,
            b_ub=np.zeros(len(below)) if below else None,
            A_eq=np.array(equal),
            b_eq=np.append(q, np.zeros(len(equal) - m)),
            bounds=bounds,
        )
        if answer.status == 0 and -answer.fun > 1e-6:
            found.append(tuple(STATES[state] for state in states))
    return sorted(found)


# ---- examples of the literature


def klarbring(mu: float, q: tuple[float, ...]) -> fclib.LocalProblem:
    """A mass on springs before an obstacle: stiffness [[2, -1], [-1, 1]], W its inverse.

    Klarbring 1990, "Examples of non-uniqueness and non-existence of solutions to quasistatic
    contact problems with friction", Ingenieur-Archiv 60: unique up to mu = K_TT / |K_NT| = 1, as
    W_NN - mu W_NT changes its sign there.
    """
    return local_problem(np.linalg.inv([[2.0, -1.0], [-1.0, 1.0]]), q, [mu])


@pytest.mark.parametrize("mu", [0.25, 0.5, 0.75])
def test_klarbring_with_little_friction_has_one_solution(mu: float) -> None:
    for q in product([-1.0, -0.5, 0.5, 1.0], repeat=2):
        found = analysis.enumerate_solutions(klarbring(mu, q))
        assert found.velocity_unique is True
        assert found.reaction_unique is True
        assert len(found.isolated) == 1


def test_klarbring_with_much_friction_has_three_solutions() -> None:
    mu, q = 2.0, (1.0, 3.5)
    problem = klarbring(mu, q)
    found = analysis.enumerate_solutions(problem)
    assert names(found) == [("open",), ("slide +",), ("stick",)]
    assert found.velocity_unique is False
    assert found.reaction_unique is False
    W = dense(problem.W)
    n = -q[0] / (W[0, 0] - mu * W[0, 1])
    slides = q[1] + (W[1, 0] - mu * W[1, 1]) * n
    expected = {"open": q, "slide +": (0, slides), "stick": (0, 0)}
    for one in found.isolated:
        assert_exact(problem, one)
        assert one.error <= 1e-15
        assert np.array(one.u, float) == pytest.approx(np.array(expected[one.states[0]]), abs=1e-14)
    # slower along the obstacle, none is left but the open one
    assert names(analysis.enumerate_solutions(klarbring(mu, (1.0, 2.5)))) == [("open",)]


def rod(mu: float, theta: float, f: tuple[float, float, float]) -> fclib.GlobalProblem:
    """Painleve's rod: mass 1, half length 1, inertia 1/3, one tip on the ground.

    Painleve 1895, "Sur les lois du frottement de glissement" (C. R. Acad. Sci. 121); Genot &
    Brogliato 1999, "New results on Painleve paradoxes" (European Journal of Mechanics A/Solids 18):
    paradoxical where W_NN - mu W_NT = 1 + 3 cos^2 - 3 mu sin cos < 0, possible for mu > 4/3.
    """
    c, s = np.cos(theta), np.sin(theta)
    H = np.array([[0.0, 1.0], [1.0, 0.0], [-c, s]])
    return fclib.GlobalProblem(
        spacedim=2, M=np.diag([1.0, 1.0, 1 / 3]), H=H, f=np.array(f), w=np.zeros(2), mu=[mu]
    )


def sliding(problem: fclib.GlobalProblem, q_N: float) -> fclib.LocalProblem:
    """The same with accelerations: it slides with u_T < 0, so that r_T = mu r_N throughout."""
    W = dense(problem.condense().W)
    along = W @ [1.0, problem.mu[0]]
    return local_problem([[along[0], 0.0], [along[1], 0.0]], [q_N, 0.0], [0.0])


@pytest.mark.parametrize("mu", [1.3, 1.4])
def test_painleve_is_paradoxical_above_four_thirds(mu: float) -> None:
    worst = np.arctan(2.0)  # where (1 + 3 cos^2) / (3 sin cos) is least, 4/3
    problem = rod(mu, worst, (0, 0, 0))
    closing, parting = (analysis.enumerate_solutions(sliding(problem, q_N)) for q_N in (-1.0, 1.0))
    if mu < 4 / 3:
        assert closing.velocity_unique
        assert names(closing) == [("closed",)]
        assert names(parting) == [("open",)]
        return
    # no acceleration is right, and two are
    assert closing.verdict == "none"
    assert closing.robust
    assert names(parting) == [("closed",), ("open",)]
    assert analysis.analyze(sliding(problem, -1.0)).existence.verdict == analysis.PROVEN_NOT


def test_painleve_with_impulses_jams_or_has_three_solutions() -> None:
    worst = np.arctan(2.0)
    # f is M v_0: it slides to the left, and closes
    jam = analysis.enumerate_solutions(rod(2.0, worst, (-1.0, -0.1, 0.0)))
    assert names(jam) == [("stick",)]  # a large impulse stops it: an impact without collision
    assert jam.velocity_unique
    found = analysis.enumerate_solutions(rod(2.0, worst, (-1.0, 0.1, 0.0)))
    assert names(found) == [("open",), ("slide -",), ("stick",)]
    assert np.array([one.error for one in found.solutions]) == pytest.approx(np.zeros(3), abs=1e-14)
    few = analysis.enumerate_solutions(rod(1.2, worst, (-1.0, 0.1, 0.0)))
    assert names(few) == [("open",)]


# ---- planted solutions, and other ways to find them


@some
@hypothesis.given(
    seed=seeds, nc=st.integers(1, 6), p=st.sampled_from([0, 2]), skew=st.sampled_from([0.0, 1.0])
)
def test_a_planted_solution_is_among_those_found(seed: int, nc: int, p: int, skew: float) -> None:
    planted = planted_local(seed, d=2, nc=nc, p=p, skew=skew)
    found = analysis.enumerate_solutions(planted.problem)
    assert found.complete
    assert planted.solution.u is not None
    near = [
        one
        for one in found.isolated
        if np.allclose(np.array(one.u, float), planted.solution.u, atol=1e-9)
        and np.allclose(np.array(one.r, float), planted.solution.r, atol=1e-9)
    ]
    assert len(near) == 1
    assert near[0].error <= 1e-12
    if p:
        assert near[0].solution.l == pytest.approx(planted.solution.l, abs=1e-9)


@some
@hypothesis.given(seed=seeds, p=st.sampled_from([0, 1]))
def test_a_planted_solution_of_bodies_is_among_those_found(seed: int, p: int) -> None:
    planted = planted_global(seed, d=2, nc=4, p=p)
    found = analysis.enumerate_solutions(planted.problem)
    assert planted.solution.u is not None
    assert any(
        np.allclose(np.array(one.u, float), planted.solution.u, atol=1e-8) or not one.velocity
        for one in found.sound
    )
    assert all(one.solution.v is not None for one in found.sound)


@some
@hypothesis.given(seed=seeds, nc=st.integers(1, 3))
def test_all_states_are_those_of_linear_programs(seed: int, nc: int) -> None:
    """Small integers: W singular, asymmetric, with blocks of zeros, mu = 0, and ties."""
    rng = np.random.default_rng(seed)
    m = 2 * nc
    W = rng.integers(-2, 3, (m, m)).astype(float)
    W *= rng.uniform(size=(m, m)) < rng.choice([0.4, 1.0])
    if rng.uniform() < 0.5:
        root = W[:, : int(rng.integers(1, m + 1))]
        W = root @ root.T
    q = rng.integers(-2, 3, m).astype(float)
    if rng.uniform() < 0.3:
        q = W @ q
    mu = rng.choice([0.0, 0.5, 1.0, 2.0], nc)
    problem = local_problem(W, q, mu)
    found = analysis.enumerate_solutions(problem)
    assert found.complete
    assert names(found) == by_linear_programs(W, q, mu)
    for one in found.solutions:
        assert_exact(problem, one)
        assert one.error <= 1e-12


@some
@hypothesis.given(seed=seeds, nc=st.integers(3, 4), rank=st.integers(1, 8))
def test_what_doubles_refute_has_no_solution(seed: int, nc: int, rank: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((2 * nc, min(rank, 2 * nc)))
    W = root @ root.T + rng.choice([0.0, 0.3]) * rng.standard_normal((2 * nc, 2 * nc))
    problem = local_problem(W, rng.standard_normal(2 * nc), rng.choice([0.0, 0.3, 1.5], nc))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_enumerate, "FEW_STATES", 0)
        quick = analysis.enumerate_solutions(problem)
        patch.setattr(_enumerate, "FEW_STATES", 10**9)
        slow = analysis.enumerate_solutions(problem)
    assert names(quick) == names(slow)
    assert [one.u for one in quick.solutions] == [one.u for one in slow.solutions]


@some
@hypothesis.given(seed=seeds, nc=st.integers(1, 8), excess=st.sampled_from([-3, 0, 3]))
def test_solvers_and_certificates_agree(seed: int, nc: int, excess: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.integers(-2, 3, (2 * nc, max(1, 2 * nc + excess))).astype(float)
    W = root @ root.T
    problem = local_problem(W, rng.integers(-3, 3, 2 * nc), rng.choice([0.0, 0.25, 0.75], nc))
    found = analysis.enumerate_solutions(problem, time_limit=30)
    result = fclib.solve(problem, time_limit=2)
    assert found.complete
    if result.converged:
        assert found.verdict == "exists"
        u = dense(problem.W) @ result.solution.r + problem.q
        if found.velocity_unique:
            assert u == pytest.approx(np.array(found.solutions[0].u, float), abs=1e-5)
    if result.status == "infeasible":
        assert found.verdict == "none"
    if found.solutions:
        assert result.certificate is None


# ---- joints


def test_a_multiplier_that_pulls_leaves_no_solution() -> None:
    """W is the identity, W' = W - V R^-1 V^T is -3 along the normal."""
    problem = local_problem(np.eye(2), [-1.0, 0.0], [0.5]).replace(
        V=[[2.0], [0.0]], R=[[1.0]], s=[0.0]
    )
    assert analysis.enumerate_solutions(problem).verdict == "none"
    parting = analysis.enumerate_solutions(problem.replace(q=[1.0, 0.0]))
    assert names(parting) == [("open",), ("stick",)]
    assert parting.velocity_unique is False


def welded(b: tuple[float, float]) -> fclib.GlobalProblem:
    """A body between two redundant joints along x, on the ground."""
    return fclib.GlobalProblem(
        spacedim=2,
        M=np.eye(2),
        H=np.array([[0.0, 1.0], [1.0, 0.0]]),
        f=[1.0, -1.0],
        w=[0.0, 0.0],
        mu=[0.5],
        G=np.array([[0.1, 0.3], [0.0, 0.0]]),
        b=b,
    )


def test_redundant_joints() -> None:
    # 3 * 0.1 is not 0.3 in doubles, and both joints hold v_x at zero
    agreeing = analysis.enumerate_solutions(welded((0.0, 0.0)))
    assert agreeing.verdict == "exists"
    assert agreeing.velocity_unique
    assert names(agreeing) == [("stick",)]
    # they hold it at -1 and at -2
    apart = analysis.enumerate_solutions(welded((0.1, 0.6)))
    assert apart.verdict == "none"
    # at -2, but for rounding: that proves nothing
    nearly = analysis.enumerate_solutions(welded((0.2, 0.1 + 0.2 + 0.3)))
    assert nearly.verdict == "undecided"
    assert nearly.complete
    assert "there may be others" in nearly.reason


def test_joints_of_a_singular_R() -> None:
    """R = 0: the joint is an equation on r alone, r_T = s."""
    problem = local_problem(np.eye(2), [-1.0, 0.0], [0.5]).replace(
        V=[[0.0], [1.0]], R=[[0.0]], s=[-0.25]
    )
    found = analysis.enumerate_solutions(problem)
    assert names(found) == [("stick",)]
    assert [float(value) for value in found.solutions[0].r] == [1.0, 0.25]
    assert found.solutions[0].solution.l == pytest.approx([-0.25])
    slides = analysis.enumerate_solutions(problem.replace(s=[-0.5]))
    # at the edge of K the multiplier moves it as it likes
    assert slides.velocity_unique is False
    assert analysis.enumerate_solutions(problem.replace(s=[-0.75])).verdict == "none"


# ---- degenerate problems


def box(nc: int, f: tuple[float, float, float]) -> fclib.GlobalProblem:
    """A box on the ground, on nc contacts: three degrees of freedom."""
    H = np.zeros((3, 2 * nc))
    H[1, ::2], H[2, ::2] = 1, np.linspace(-1, 1, nc)
    H[0, 1::2], H[2, 1::2] = 1, 0.5
    return fclib.GlobalProblem(
        spacedim=2, M=np.diag([1, 1, 0.25]), H=H, f=f, w=np.zeros(2 * nc), mu=np.full(nc, 0.5)
    )


def test_a_box_at_rest_has_one_velocity_and_many_reactions() -> None:
    found = analysis.analyze(box(8, (0.25, -1.0, 0.0)))
    assert found.enumeration is not None
    assert found.enumeration.complete
    assert names(found.enumeration) == [("stick",) * 8]
    assert found.uniqueness.verdict == "unique"
    assert found.reactions.known is False
    assert found.isolated_solutions == 0
    slides = analysis.enumerate_solutions(box(8, (2.0, -1.0, 0.5)))
    assert names(slides) == [("slide +",) * 8]
    assert slides.velocity_unique is True
    assert slides.reaction_unique is False


def test_a_mass_ratio_of_1e12() -> None:
    """Stacked masses, a light one between heavy ones, pushed aside a little."""
    masses = np.array([1.0, 1e-12, 1.0])
    H = np.zeros((6, 6))
    for a in range(3):
        H[2 * a + 1, 2 * a] = H[2 * a, 2 * a + 1] = 1
        if a:
            H[2 * a - 1, 2 * a] = H[2 * a - 2, 2 * a + 1] = -1
    M = np.diag(np.repeat(masses, 2))
    f = np.ravel([[1e-3 * m, -m] for m in masses])
    problem = fclib.GlobalProblem(spacedim=2, M=M, H=H, f=f, w=np.zeros(6), mu=np.full(3, 0.5))
    found = analysis.enumerate_solutions(problem)
    assert names(found) == [("stick",) * 3]
    assert found.velocity_unique
    assert float(found.solutions[0].r[0]) == pytest.approx(2 + 1e-12, rel=1e-14)


@pytest.mark.parametrize(
    ("q", "verdict", "unique"),
    [([0.0, 0.0], "exists", True), ([1.0, 5.0], "exists", True), ([-1.0, 0.0], "none", None)],
)
def test_contacts_that_nothing_can_move(q: list[float], verdict: str, unique: bool | None) -> None:
    found = analysis.enumerate_solutions(local_problem(np.zeros((8, 8)), q * 4, [0.5] * 4))
    assert (found.verdict, found.velocity_unique) == (verdict, unique)


def test_a_contact_that_can_slide_or_stick_for_nothing() -> None:
    """W_TT = -1: what friction does is to push along."""
    found = analysis.enumerate_solutions(local_problem(np.diag([1.0, -1.0]), [-1.0, 0.0], [0.5]))
    assert names(found) == [("slide +",), ("slide -",), ("stick",)]
    assert found.velocity_unique is False


def test_joints_that_close_a_contact_leave_no_solution_after_condensation() -> None:
    """What rounding leaves of W without V R^-1 V^T moves nothing, however large the reaction is."""
    rng, tempted = np.random.default_rng(0), 0
    for _ in range(150):
        d, n = int(rng.choice([2, 3])), int(rng.integers(1, 4))
        p = int(rng.integers(1, n + 1))
        G = rng.integers(-3, 4, (n, p)) * 10.0 ** rng.integers(-4, 5, p)
        share, H = rng.integers(-3, 4, p).astype(float), rng.integers(-3, 4, (n, d)).astype(float)
        H[:, 0] = G @ share  # joints alone say how fast the contact closes
        if np.linalg.matrix_rank(G) < p or not H[:, 0].any():
            continue
        b, w = rng.integers(-3, 4, p).astype(float), rng.integers(-3, 4, d).astype(float)
        w[0] = share @ b - 10.0 ** rng.integers(-6, 3)
        masses = (rng.integers(0, 4, n) + 0.5) * 10.0 ** rng.integers(-6, 7, n)
        problem = fclib.GlobalProblem(
            spacedim=d,
            M=np.diag(masses),
            H=H,
            G=G,
            f=rng.integers(-3, 4, n).astype(float),
            w=w,
            b=b,
            mu=np.array([rng.choice([0.0, 0.5])]),
        )
        assert analysis.enumerate_solutions(problem).verdict != "exists"
        found = analysis.enumerate_solutions(problem.condense())
        assert found.verdict != "exists"
        tempted += any(one.error <= 1e-8 for one in found.solutions)
    assert tempted


def test_what_rests_on_the_last_digits_is_not_claimed() -> None:
    # a light body under a heavy one: the only solution has reactions of 2^52
    W = np.kron([[1.0, -1.0], [-1.0, 1.0 + 2.0**-52]], np.eye(2))
    light = analysis.enumerate_solutions(local_problem(W, [-1.0, 0.0, 0.5, 0.0], [0.5, 0.5]))
    assert light.verdict != "none"
    # W has rank 1 but for rounding: u = 0 is as good as the solution that is open
    W = np.outer([0.4, -0.35], [0.4, -0.35])
    q = np.array([0.2, -0.2 * 0.35 / 0.4])
    found = analysis.enumerate_solutions(local_problem(W, q, [2.0]))
    assert found.velocity_unique is not True


@pytest.mark.parametrize("size", [2.0**-100, 1.0, 2.0**100])
def test_units_decide_nothing(size: float) -> None:
    # it slides, and no doubles of r are on the border of the cone: in newtons of its own rounding
    # that is a wrong velocity
    W, q = np.array([[3.0, 1.0], [1.0, 2.0]]), [-1.0, -3.0]
    found = analysis.enumerate_solutions(local_problem(size * W, q, [0.3]))
    assert found.verdict == "exists"
    assert len(found.isolated) == 1
    assert found.velocity_unique is True


def test_a_solution_that_doubles_do_not_hold_is_no_proof_of_none() -> None:
    # the only solution has reactions of 1e330
    far = local_problem(1e-200 * np.eye(2), [-1e130, 0.0], [0.5])
    found = analysis.enumerate_solutions(far)
    assert len(found.solutions) == 1
    assert not found.sound
    assert found.verdict == "undecided"
    assert analysis.analyze(far).existence.verdict != analysis.PROVEN_NOT


@pytest.mark.parametrize("size", [1e-300, 1e-200, 1.0, 1e200, 1e300])
@pytest.mark.parametrize("mu", [1e-300, 0.5, 1e300])
def test_numbers_at_the_ends_of_doubles(size: float, mu: float) -> None:
    problem = local_problem(size * np.eye(8), [-1.0, 0.5] * 4, [mu] * 4)
    found = analysis.enumerate_solutions(problem)
    assert found.complete
    state = "slide +" if mu < 0.5 else "stick"
    assert names(found) == [(state,) * 4]
    assert found.solutions[0].r[0] == 1 / Fraction(size)


def test_no_solution_although_contacts_need_not_close() -> None:
    """A linear complementarity problem, feasible and not solvable: Farkas' lemma is silent."""
    W = np.zeros((4, 4))
    W[0, 2] = W[2, 2] = 1
    problem = local_problem(W, [-1.0, 0.0, 1.0, 0.0], [0.0, 0.0])
    assert analysis.farkas(problem, [1.0, 0.0]) is None
    found = analysis.analyze(problem, time_limit=2)
    assert found.existence.verdict == analysis.PROVEN_NOT
    assert found.certificate is None
    assert found.existence.reason.startswith("enumeration of contact states, 4 of 2 contacts")
    assert found.isolated_solutions == 0


# ---- what is not planar


def of_one_spatial_contact(W: Array, q: Array, mu: float) -> list[str]:
    """States of one spatial contact in doubles, sliding by a grid of directions."""
    found = ["open"] if q[0] > 0 else []
    r = np.linalg.solve(W, -q)
    if np.hypot(r[1], r[2]) < mu * r[0]:
        found.append("stick")
    angle = np.linspace(0, 2 * np.pi, 40001)
    e = np.array([np.cos(angle), np.sin(angle)])
    D = W[0, 0] + mu * W[0, 1:] @ e
    E = W[1:, :1] + mu * W[1:, 1:] @ e
    P = (np.array([-e[1], e[0]]) * (-q[0] * E + D * q[1:, None])).sum(axis=0)
    S = (e * (-q[0] * E + D * q[1:, None])).sum(axis=0)
    crossing = P[:-1] * P[1:] < 0
    found += ["slide"] * int((crossing & (q[0] * D < 0)[1:] & (q[0] * S > 0)[1:]).sum())
    return sorted(found)


@some
@hypothesis.given(seed=seeds, mu=st.sampled_from([0.25, 1.0, 3.0]), symmetric=st.booleans())
def test_one_spatial_contact(seed: int, mu: float, symmetric: bool) -> None:
    rng = np.random.default_rng(seed)
    W, q = rng.standard_normal((3, 3)), rng.standard_normal(3)
    W = W @ W.T if symmetric else W
    problem = local_problem(W, q, [mu])
    found = analysis.enumerate_solutions(problem)
    assert sorted(one.states[0] for one in found.solutions) == of_one_spatial_contact(W, q, mu)
    assert max((one.error for one in found.solutions), default=0) <= 1e-12
    if symmetric:
        assert found.verdict == "exists"
    if found.velocity_unique:
        result = fclib.solve(problem)
        assert dense(problem.W) @ result.solution.r + q == pytest.approx(
            np.array(found.solutions[0].u, float), abs=1e-6
        )


def test_a_spatial_contact_that_slides_in_any_direction() -> None:
    problem = local_problem(np.diag([1.0, -1.0, -1.0]), [-1.0, 0.0, 0.0], [0.5])
    found = analysis.enumerate_solutions(problem)
    assert names(found) == [("slide",), ("stick",)]
    assert found.velocity_unique is False
    assert found.isolated == ()
    assert [one.error for one in found.solutions] == [0, 0]


@pytest.mark.parametrize("across", [0.0, 0.25, 1.0])
def test_a_spatial_contact_of_a_singular_block(across: float) -> None:
    """W_aa has rank 2: a finger of two joints. What u_T2 is nothing changes."""
    problem = local_problem(np.diag([1.0, 1.0, 0.0]), [-1.0, 0.25, across], [0.5])
    found = analysis.enumerate_solutions(problem)
    if across:
        assert [one.states for one in found.solutions] == [("slide",)]
    else:
        assert names(found) == [("stick",)]
        assert not found.solutions[0].reaction
    assert all(one.error <= 1e-15 for one in found.solutions)


@pytest.mark.parametrize(
    ("q", "states", "reaction"),
    [
        ([1.0, 0.5, 0.0], [("open",)], True),
        ([0.0, 0.5, 0.0], [("slide",)], False),
        ([0.0, 0.0, 0.0], [("stick",)], False),
        ([-1.0, 0.0, 0.0], [], None),
    ],
)
def test_a_spatial_contact_that_nothing_can_move(
    q: list[float], states: list[tuple[str]], reaction: bool | None
) -> None:
    found = analysis.enumerate_solutions(local_problem(np.zeros((3, 3)), q, [0.5]))
    assert names(found) == states
    assert found.velocity_unique is (True if states else None)
    assert found.reaction_unique is reaction
    assert found.verdict == ("exists" if states else "none")


@pytest.mark.parametrize("d", [2, 3])
def test_contacts_without_friction_are_a_linear_complementarity_problem(d: int) -> None:
    rng = np.random.default_rng(d)
    nc = 10
    root = rng.standard_normal((d * nc, d * nc))
    problem = local_problem(root @ root.T, rng.standard_normal(d * nc), np.zeros(nc))
    found = analysis.enumerate_solutions(problem)
    assert found.states == 2**nc
    assert found.velocity_unique
    assert len(found.isolated) == 1
    solved = fclib.solve(problem, tol=1e-12).solution
    assert solved.r == pytest.approx(np.array(found.solutions[0].r, float), abs=1e-9)


@pytest.mark.parametrize(
    ("problem", "why"),
    [
        (planted_local(0, d=3, nc=2).problem, "only a single one"),
        (planted_local(0, d=2, nc=9).problem, r"2\^18 states"),
        (planted_local(0, d=3, nc=2, rolling=True).problem, "roll"),
    ],
)
def test_what_is_not_decided_says_why(problem: fclib.LocalProblem, why: str) -> None:
    found = analysis.enumerate_solutions(problem)
    assert found.verdict == "undecided"
    assert found.velocity_unique is None
    with pytest.raises(AssertionError, match=why):
        raise AssertionError(found.reason)


def test_what_takes_too_long_is_not_decided() -> None:
    found = analysis.enumerate_solutions(planted_local(0, d=2, nc=8).problem, time_limit=0)
    assert not found.complete
    assert found.velocity_unique is None
    assert found.verdict == "undecided"
    assert "the time was over" in found.reason


def test_eight_contacts_are_decided() -> None:
    planted = planted_local(3, d=2, nc=8)
    found = analysis.enumerate_solutions(planted.problem, time_limit=60)
    assert found.states == 4**8
    assert found.complete
    assert found.velocity_unique


# ---- commands


def test_analyze_tells_how_many_solutions_there_are(tmp_path: Path) -> None:
    several, none = tmp_path / "several.hdf5", tmp_path / "none.hdf5"
    fclib.write(several, klarbring(2.0, (1.0, 3.5)))
    fclib.write(none, sliding(rod(2.0, np.arctan(2.0), (0, 0, 0)), -1.0))
    lines = run("analyze", "--json", several, none).stdout.splitlines()
    first, second = map(json.loads, lines)
    assert first["uniqueness"] == "not unique"
    assert first["isolated_solutions"] == 3
    assert first["reactions_unique"] is False
    assert "enumeration of contact states" in first["uniqueness_reason"]
    assert second["existence"] == analysis.PROVEN_NOT
    assert second["isolated_solutions"] == 0


@pytest.mark.parametrize("seed", range(4))
def test_the_contacts_of_a_solution_never_contradict_all_states(seed: int) -> None:
    """Uniqueness of reactions from one solution and a rank, against exact enumeration."""
    rng = np.random.default_rng(seed)
    seen: Counter[tuple[str, bool | None]] = Counter()
    for k in range(60):
        nc, n = int(rng.integers(1, 4)), int(rng.integers(1, 5))
        problem: Any = fclib.GlobalProblem(
            M=np.eye(n),
            H=rng.integers(-2, 3, size=(n, 2 * nc)).astype(float),
            f=rng.integers(-3, 4, size=n).astype(float),
            w=np.zeros(2 * nc),
            mu=rng.choice([0.0, 0.3, 0.7], size=nc),
            spacedim=2,
        )
        problem = problem if k % 2 else problem.condense()
        states = analysis.enumerate_solutions(problem)
        found = [one.solution for one in states.sound]
        found += [fclib.solve(problem, name, 1e-12).solution for name in ("nsgs", "apgd")]
        for solution in found:
            error = fclib.merit(problem, solution).error
            if not error <= 1e-8:
                continue
            velocity = "unique" if states.velocity_unique else "undecided"
            said = reactions(Data.of_problem(problem), velocity, False, None, solution, error, 100)
            exact = states.reaction_unique
            assert said.known is None or exact is None or said.known == exact, said.reason
            seen[said.verdict, exact] += 1
    assert seen["unique", True] > 10
    assert seen["not unique", False] > 10
