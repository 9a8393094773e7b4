"""Islands, component orders, planar problems in space, units: solved on both sides."""

from __future__ import annotations

from typing import Any, TypeAlias

import hypothesis
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import strategies as st

import fclib
from ball_judge import judge
from helpers import STORAGES, converged, dense, planted_global, planted_local, planted_rolling

Plain: TypeAlias = fclib.LocalProblem | fclib.GlobalProblem

ORDERS = ("normal-first", "normal-last", "normals-first")
some = hypothesis.settings(deadline=None, max_examples=15, derandomize=True)


def local(seed: int, nc: int = 6, d: int = 3) -> fclib.LocalProblem:
    problem = planted_local(seed, d=d, nc=nc).problem
    assert isinstance(problem, fclib.LocalProblem)
    return problem


def mixed_up(problems: list[fclib.LocalProblem], seed: int) -> fclib.LocalProblem:
    """The problems as one, contacts in random order."""
    whole = fclib.merge(problems)
    d = whole.spacedim
    order = np.random.default_rng(seed).permutation(whole.nc)
    rows = (d * order[:, None] + np.arange(d)).ravel()
    W = dense(whole.W)[np.ix_(rows, rows)]
    return fclib.LocalProblem(spacedim=d, W=sp.csr_array(W), q=whole.q[rows], mu=whole.mu[order])


def plain(problem: fclib.Problem) -> Plain:
    """A problem without rolling friction, for the type checker."""
    assert isinstance(problem, (fclib.LocalProblem, fclib.GlobalProblem))
    return problem


def solved(problem: fclib.Problem) -> fclib.Solution:
    result = converged(problem, tol=1e-12)
    return result.solution


@some
@hypothesis.given(
    seed=st.integers(0, 1000),
    d=st.sampled_from([2, 3]),
    sizes=st.lists(st.integers(1, 4), min_size=1, max_size=4),
)
def test_islands_are_found_and_solved_apart(seed: int, d: int, sizes: list[int]) -> None:
    problems = [local(seed + k, nc, d) for k, nc in enumerate(sizes)]
    whole = mixed_up(problems, seed)
    islands = whole.islands()
    assert islands.count == len(sizes)
    # numbered by their first contact
    _, first = np.unique(islands.contact, return_index=True)
    assert (np.diff(first) > 0).all()
    parts = islands.split(whole)
    assert sorted(part.nc for part in parts) == sorted(sizes)
    assert fclib.digest(islands.merge(parts)) == fclib.digest(whole)
    solution = islands.merge([solved(part) for part in parts])
    assert judge(whole, solution).error < 1e-11
    again = islands.merge(islands.split(solution))
    np.testing.assert_array_equal(again.r, solution.r)


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("p", [0, 2])
def test_bodies_are_split_with_their_constraints(storage: str, p: int) -> None:
    cases = [planted_global(seed, nc=3, p=p, storage=storage) for seed in range(3)]
    problems = [c.problem for c in cases if isinstance(c.problem, fclib.GlobalProblem)]
    free = fclib.GlobalProblem(M=np.eye(2), H=np.zeros((2, 0)), f=[1.0, 2.0], w=[], mu=[])
    if storage != "dense":
        free = free.replace(M=sp.csr_array(free.M), H=sp.csr_array(free.H)).with_storage(
            "triplet" if storage == "coo" else storage
        )
    whole = fclib.merge([free, *problems])
    islands = whole.islands()
    # the body without a contact is the last
    assert islands.count == 4
    assert islands.dof[:2].tolist() == [3, 3]
    assert np.bincount(islands.bilateral, minlength=4).tolist() == [p, p, p, 0]
    parts = islands.split(whole)
    assert [part.formulation for part in parts[:3]] == [problems[0].formulation] * 3
    for part, problem in zip(parts, [*problems, free], strict=True):
        part.validate()
        assert fclib.digest(part) == fclib.digest(problem)
    assert fclib.digest(islands.merge(parts)) == fclib.digest(whole)
    solution = islands.merge([solved(part) for part in parts])
    assert judge(whole, solution).error < 1e-11


def test_zeros_that_are_stored_link_nothing() -> None:
    W = sp.csr_array(np.ones((6, 6)))
    W.data[np.array([3, 4, 5] * 3) + np.repeat([0, 6, 12], 3)] = 0
    W.data[18 + np.array([0, 1, 2] * 3) + np.repeat([0, 6, 12], 3)] = 0
    problem = fclib.LocalProblem(W=W, q=np.zeros(6), mu=[1, 1])
    assert problem.islands().contact.tolist() == [0, 1]
    assert problem.islands().split(problem)[1].W.shape == (3, 3)


def test_what_does_not_fit_is_refused() -> None:
    one, other = local(1, nc=2), local(2, nc=3)
    islands = one.islands()
    with pytest.raises(fclib.ProblemError, match="expected"):
        islands.split(other)
    with pytest.raises(fclib.ProblemError, match="2 parts for 1 islands"):
        islands.merge([one, one])
    apart = fclib.merge([one, one]).islands()
    with pytest.raises(fclib.ProblemError, match="links two islands"):
        apart.split(local(3, nc=4))
    with pytest.raises(fclib.ProblemError, match="part 1: spacedim"):
        fclib.merge([one, local(1, d=2)])
    with pytest.raises(fclib.ProblemError, match="no problem"):
        fclib.merge([])


def test_no_contact_is_one_island() -> None:
    problem = planted_global(1, nc=0).problem
    assert problem.islands().count == 1
    empty = fclib.LocalProblem(W=np.zeros((0, 0)), q=[], mu=[])
    assert empty.islands().count == 0
    assert empty.islands().split(empty) == []


# ---- orders


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("d", [2, 3])
def test_orders_of_other_tools_and_back(order: Any, d: int) -> None:
    for case in (planted_local(4, d=d, nc=4, p=2), planted_global(4, d=d, nc=4, p=2)):
        problem = plain(case.problem)
        values = problem.to_order(order)
        k = fclib.component_order(order, problem.nc, d)
        if isinstance(problem, fclib.LocalProblem):
            np.testing.assert_array_equal(dense(values["W"]), dense(problem.W)[np.ix_(k, k)])
            np.testing.assert_array_equal(values["q"], problem.q[k])
        else:
            assert isinstance(problem, fclib.GlobalProblem)
            np.testing.assert_array_equal(dense(values["H"]), dense(problem.H)[:, k])
            np.testing.assert_array_equal(dense(values["M"]), dense(problem.M))
        assert fclib.digest(type(problem).from_order(order, **values)) == fclib.digest(problem)


def test_a_solver_with_the_normal_last_agrees() -> None:
    # projected Gauss-Seidel as Pinocchio states it: c = G l + g, components T1, T2, N
    problem = plain(planted_local(8, nc=3).problem)
    values = problem.to_order("normal-last")
    G, g, mu = dense(values["W"]), values["q"], values["mu"]
    reaction = np.zeros(9)
    step = 1 / np.linalg.norm(G, 2)
    for _ in range(20000):
        for a in range(3):
            rows = slice(3 * a, 3 * a + 3)
            c = (G @ reaction + g)[rows]
            x = reaction[rows] - step * np.array([*c[:2], c[2] + mu[a] * np.hypot(*c[:2])])
            size = np.hypot(*x[:2])
            if size > mu[a] * x[2]:
                along = max(0, (mu[a] * size + x[2]) / (1 + mu[a] ** 2))
                x = along * np.array([*(mu[a] * x[:2] / size), 1.0])
            reaction[rows] = x
    ours = np.empty(9)
    ours[fclib.component_order("normal-last", 3)] = reaction
    assert judge(problem, fclib.Solution(r=ours)).error < 1e-9


def test_places_of_the_orders() -> None:
    assert fclib.component_order("normal-last", 2).tolist() == [1, 2, 0, 4, 5, 3]
    assert fclib.component_order("normals-first", 2).tolist() == [0, 3, 1, 2, 4, 5]
    assert fclib.component_order("normals-first", 2, 2).tolist() == [0, 2, 1, 3]
    with pytest.raises(fclib.OptionError, match="normal-last"):
        fclib.component_order("tangents", 2)  # type: ignore[arg-type]


# ---- planar problems in space


@some
@hypothesis.given(seed=st.integers(0, 1000), p=st.sampled_from([0, 2]))
def test_planar_problems_in_space(seed: int, p: int) -> None:
    for case in (planted_local(seed, d=2, p=p), planted_global(seed, d=2, p=p)):
        planar = case.problem
        spatial = planar.embed()
        spatial.validate()
        assert spatial.formulation == planar.formulation.replace("2", "3")
        assert judge(spatial, case.solution.embed(planar)).error < 1e-11
        back = solved(spatial).flatten(planar)
        assert judge(planar, back).error < 1e-11
        np.testing.assert_allclose(back.r, solved(planar).r, atol=1e-8)


def test_a_planar_rolling_problem_in_space() -> None:
    planar, r = planted_rolling(3, 5)
    spatial = planar.embed()
    assert spatial.spacedim == 5
    solution = fclib.Solution(r=r).embed(planar)
    np.testing.assert_array_equal(solution.r.reshape(-1, 5)[:, [0, 1, 3]].ravel(), r)
    assert fclib.merit(spatial, solution).error < 1e-12
    assert fclib.merit(planar, solved(spatial).flatten(planar)).error < 1e-11


def test_what_is_spatial_is_not_embedded() -> None:
    case = planted_local(1)
    with pytest.raises(fclib.UnsuitableError, match="not planar"):
        case.problem.embed()
    with pytest.raises(fclib.UnsuitableError, match="not planar"):
        case.solution.embed(case.problem)


# ---- units


@some
@hypothesis.given(
    seed=st.integers(0, 1000),
    velocity=st.floats(1e-3, 1e3),
    impulse=st.floats(1e-3, 1e3),
    p=st.sampled_from([0, 2]),
)
def test_units(seed: int, velocity: float, impulse: float, p: int) -> None:
    for case in (planted_local(seed, p=p), planted_global(seed, p=p)):
        problem = case.problem
        other = problem.scaled(velocity=velocity, impulse=impulse)
        solution = case.solution.scaled(problem, velocity=velocity, impulse=impulse)
        # the scaled map is the same in all units
        assert judge(other, solution).scaled_natural < 1e-11
        perturbed = fclib.Solution(r=case.solution.r + 0.1, l=case.solution.l)
        before = fclib.merit(problem, perturbed).scaled_natural
        taken = perturbed.scaled(problem, velocity=velocity, impulse=impulse)
        assert fclib.merit(other, taken).scaled_natural == pytest.approx(before, rel=1e-9)
        # solved there, and mapped back
        there = fclib.solve(other, tol=1e-12 * min(1, impulse / velocity), time_limit=10)
        back = there.solution.scaled(other, velocity=1 / velocity, impulse=1 / impulse)
        assert judge(problem, back).natural < 1e-8


def test_lengths_of_a_rolling_problem() -> None:
    for d in (3, 5):
        problem, r = planted_rolling(d, 2)
        units = {"velocity": 1e3, "impulse": 2.0, "length": 1e3}
        other = problem.scaled(**units)
        np.testing.assert_allclose(other.mu_r, 1e3 * problem.mu_r)
        np.testing.assert_array_equal(other.mu, problem.mu)
        solution = fclib.Solution(r=r).scaled(problem, **units)
        assert fclib.merit(other, solution).cone < 1e-9
        assert fclib.merit(other, solution).natural < 1e-12


def test_wrong_units_are_refused() -> None:
    with pytest.raises(fclib.OptionError, match="positive"):
        planted_local(1).problem.scaled(velocity=0)
