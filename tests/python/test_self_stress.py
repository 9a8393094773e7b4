"""Whether reactions can grow without moving anything, and that what says so is a proof."""

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import fclib
from fclib import analysis, scenes
from fclib.analysis._bounds import least_singular, lower_bound, root_above
from fclib.analysis._data import Data
from fclib.analysis._existence import Slater, slater
from fclib.analysis._joints import joints_of
from fclib.analysis._self_stress import self_stress

pytest.importorskip("clarabel")


def judged(data: Data) -> analysis.SelfStress:
    joints = joints_of(data)
    return self_stress(data, joints, slater(data, joints, True, False))


def verdict(problem: fclib.Problem) -> analysis.SelfStress:
    return judged(Data.of_problem(problem))


def walls(gap: float = 0.0, friction: float = 0.5) -> fclib.GlobalProblem:
    """A point between two walls, pushed sideways."""
    H = np.hstack([np.eye(3), np.diag([-1.0, 1.0, -1.0])])
    w = [gap, 0, 0, 0, 0, 0]
    return fclib.GlobalProblem(M=np.eye(3), H=H, f=[1, 0.3, 0], w=w, mu=[friction] * 2)


def wedge(friction: float) -> fclib.GlobalProblem:
    """A point in the plane that two faces hold, at a right angle to each other."""
    H = np.array([[1.0, 0.0, 0.0, -1.0], [0.0, 1.0, 1.0, 0.0]])
    return fclib.GlobalProblem(
        spacedim=2, M=np.eye(2), H=H, f=[-1.0, -1.0], w=np.zeros(4), mu=[friction] * 2
    )


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_walls_that_stand_still_prestress_and_those_that_part_do_not(friction: float) -> None:
    still = verdict(walls(friction=friction))
    assert still.verdict == "prestressed"
    assert still.vector is not None
    assert np.array_equal(walls().H @ still.vector, np.zeros(3))
    assert (still.vector[::3] > 0).all()
    parting = verdict(walls(1.0, friction))
    assert parting.verdict == "solvable"
    assert parting.bound >= np.linalg.norm(fclib.solve(walls(1.0, friction), tol=1e-12).solution.r)


def test_a_wedge_jams_from_the_angle_of_friction_on() -> None:
    assert verdict(wedge(1.001)).verdict == "prestressed"
    assert verdict(wedge(0.999)).verdict == "solvable"
    # on the border neither is strict
    assert verdict(wedge(1.0)).verdict == "open"


def test_packings_of_few_bodies_are_prestressed_and_larger_ones_solvable() -> None:
    family: Any = scenes.assemblies()["Packing"]()
    small, large = (family.of_size(size, 0.0, 0) for size in (60, 200))
    stressed = verdict(small)
    assert stressed.verdict == "prestressed"
    assert stressed.vector is not None
    r = stressed.vector.reshape(-1, 3)
    assert (np.linalg.norm(r[:, 1:], axis=1) <= small.mu * r[:, 0] + 1e-15).all()
    assert np.linalg.norm(small.H @ stressed.vector) <= 1e-10 * np.linalg.norm(r)
    free = verdict(large)
    assert free.verdict == "solvable"
    solution = fclib.solve(large).solution
    assert np.linalg.norm(solution.r) <= free.bound
    # it carries its proof: the velocity is inside K*, contact by contact
    assert free.vector is not None
    assert Data.of_problem(large).dual_margin(large.H.T @ free.vector + large.w).min() > 0


def test_joints_and_local_problems() -> None:
    problem = walls(1.0)
    local = verdict(problem.condense())
    assert local.verdict == "solvable"
    assert local.bound == pytest.approx(verdict(problem).bound, rel=1e-3)
    assert verdict(walls().condense()).verdict == "prestressed"
    # a joint that holds the normal: a contact may press on it, and nothing moves
    G = np.array([[1.0], [0.0], [0.0]])
    assert verdict(walls(1.0).replace(G=G, b=[0.0])).verdict == "prestressed"
    along = walls(1.0).replace(G=G[::-1].copy(), b=[1e-3])
    assert verdict(along).verdict == "solvable"
    # said twice, the second row follows from the first exactly
    twice = np.hstack([G[::-1], G[::-1]])
    assert verdict(along.replace(G=twice, b=[1e-3, 1e-3])).verdict == "solvable"
    # said otherwise, no velocity is there; the walls that part may have any stress all the same
    assert verdict(along.replace(G=twice, b=[1e-3, 2e-3])).verdict == "prestressed"


def test_a_velocity_that_is_not_inside_proves_nothing() -> None:
    data = Data.of_problem(walls(1.0))
    for witness in (np.zeros(3), np.array([-0.5, 0.3, 0.0]), np.array([1.1, 0.0, 0.0])):
        forged = Slater(True, 1.0, np.ones(6), "forged", witness=witness)
        found = self_stress(data, joints_of(data), forged)
        u = data.matrices["H"].T @ witness + walls(1.0).w
        assert (found.verdict == "solvable") == (data.dual_margin(u).min() > 0)
    # an M that is not positive definite makes W what it is not
    broken = replace(data, problem=walls(1.0).replace(M=np.diag([1.0, 1.0, -1.0])))
    assert judged(broken).verdict != "solvable"


def test_a_part_that_is_next_to_nothing_may_have_other_solutions() -> None:
    # heavy bodies beside a light one, of a W that is indefinite: both r solve it
    heavy = np.array([[9, -2, 1, -2], [-2, 3, -1, 6], [1, -1, 3, 6], [-2, 6, 6, 5.0]])
    W = np.eye(6)
    W[2:, 2:] = 2.0**-51 * heavy
    q = np.array([-3, 1, 2.0**-8, -(2.0**-9), 2.0**-9, -(2.0**-10)])
    problem = fclib.LocalProblem(spacedim=2, W=W, q=q, mu=[0.5, 1.0, 1.0])
    states = analysis.enumerate_solutions(problem)
    sizes = sorted(float(np.linalg.norm(np.array(one.r, float))) for one in states.isolated)
    assert len(sizes) == 2
    data = Data.of_problem(problem)
    found = judged(data)
    assert found.verdict == "solvable"
    assert sizes[0] <= found.bound < found.far <= sizes[1]


def test_bounds_hold_in_exact_arithmetic() -> None:
    rng = np.random.default_rng(4)
    for size in (1, 2, 5, 40):
        B = rng.standard_normal((size, size + 3)) * 10.0 ** rng.uniform(-3, 3, (size, 1))
        singular = np.linalg.svd(B, compute_uv=False)[-1]
        assert least_singular(sp.csr_array(B)) <= singular * (1 + 1e-12)
        a = rng.standard_normal((size, size))
        a = a + a.T
        lowest = float(np.linalg.eigvalsh(a)[0])
        bound = lower_bound(sp.csr_array(a))
        assert bound <= lowest + 1e-12 * abs(a).max() * size
        assert bound >= min(2.1 * lowest, lowest / 2 - 1e-12)
    # singular: not shown to be positive
    assert lower_bound(sp.csr_array(np.ones((3, 3)))) <= 0
    for x in (Fraction(2), Fraction(1, 3), Fraction(10) ** 400, Fraction(0)):
        assert root_above(x) ** 2 >= x


@pytest.mark.parametrize("size", [1e-308, 1e-30, 1e200, 1e308])
@pytest.mark.parametrize("stiffness", [1e-308, 1.0, 1e200, 1e308])
@pytest.mark.parametrize("friction", [0.5, 1e300])
def test_numbers_at_the_ends_of_doubles_give_a_verdict(
    size: float, stiffness: float, friction: float
) -> None:
    """Nothing overflows where a proof is looked for."""
    q = [-size, 0.1 * size, size, size]
    problem = fclib.LocalProblem(spacedim=2, W=np.eye(4) * stiffness, q=q, mu=[0.3, friction])
    with np.errstate(all="ignore"):
        found = analysis.analyze(problem, time_limit=2)
    assert found.existence.verdict == analysis.EXISTS_SLATER
    assert found.self_stress.verdict in (analysis.SOLVABLE, analysis.OPEN)
