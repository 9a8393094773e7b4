"""Blocks without inertia: stiffness, the slip of Cattaneo and Mindlin, asymmetric tangents."""

import functools
import itertools
import math
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from fclib import _symmetry
from fclib.scenes import assemblies
from fclib.scenes.elastic_punch import ASIDE, KINDS_OF_FACE, PRESSING, STEPS, history, stiffness
from fclib.scenes.plastic_tangent import DILATANCIES
from fclib.scenes.shared.bricks import Block, isotropic
from helpers import converged

ROUND = 1  # of KINDS_OF_FACE, the smaller one
FLAT = 0


def family(name: str, **parameters: Any) -> Any:
    return assemblies()[name](**parameters)


def blocks(r: Any) -> Any:
    return np.reshape(r, (-1, 3))


# ---- stiffness


@pytest.fixture(name="block")
def block_() -> Block:
    return Block((3, 2, 2), (0.1, 0.2, 0.15))


def symmetric(random: Any) -> Any:
    """A tangent of strains: its minor symmetries alone."""
    C = random.uniform(-1, 1, (3, 3, 3, 3))
    C = C + C.transpose(1, 0, 2, 3)
    return C + C.transpose(0, 1, 3, 2)


def test_patch_of_any_tangent_carries_its_stress_on_the_surface_alone(block: Block) -> None:
    """A linear displacement: forces are stress times area on faces, none inside."""
    random = np.random.Generator(np.random.PCG64(1))
    C = symmetric(random)
    assert np.abs(C - C.transpose(2, 3, 0, 1)).max() > 0.1
    K = stiffness(block, C)
    gradient = random.uniform(-1, 1, (3, 3))
    places = block.places()
    moved = places @ gradient.T
    stress = np.einsum("ikjl,jl->ik", C, gradient)
    expected = np.zeros_like(places)
    numbers = block.numbers()
    for axis, end in itertools.product(range(3), (0, -1)):
        face = np.take(numbers, end, axis=axis)
        others = [k for k in range(3) if k != axis]
        share = np.full(face.shape, block.edges[others[0]] * block.edges[others[1]])
        share[[0, -1]] *= 0.5
        share[:, [0, -1]] *= 0.5
        outwards = 1.0 if end else -1.0
        np.add.at(expected, face.ravel(), outwards * share.ravel()[:, None] * stress[:, axis])
    np.testing.assert_allclose(blocks(K @ moved.ravel()), expected, atol=1e-13)


def test_stiffness_is_that_of_quadrature(block: Block) -> None:
    """One brick by two points of Gauss for each axis, which are exact."""
    one = Block((1, 1, 1), block.edges)
    C = symmetric(np.random.Generator(np.random.PCG64(2)))
    K = np.zeros((24, 24))
    corners = np.array(list(itertools.product((0, 1), repeat=3)))
    edges = np.array(block.edges)
    for point in itertools.product((0.5 - math.sqrt(1 / 12), 0.5 + math.sqrt(1 / 12)), repeat=3):
        values = np.where(corners, point, 1 - np.array(point))
        slopes = np.where(corners, 1.0, -1.0) / edges
        dN = np.stack(
            [slopes[:, k] * np.prod(np.delete(values, k, axis=1), axis=1) for k in range(3)], axis=1
        )
        K += np.einsum("ak,ikjl,bl->aibj", dN, C, dN).reshape(24, 24) * edges.prod() / 8
    found = stiffness(one, C).toarray()
    # in the order of bricks, not of nodes
    order = (3 * one.bricks()[0][:, None] + np.arange(3)).ravel()
    np.testing.assert_allclose(found[np.ix_(order, order)], K, atol=1e-14)


def test_rigid_motions_are_free_of_force(block: Block) -> None:
    K = stiffness(block, isotropic(2.0, 0.3))
    assert _symmetry.asymmetry(K) == 0
    places = block.places()
    for axis in range(3):
        shift = np.zeros_like(places)
        shift[:, axis] = 1.0
        np.testing.assert_allclose(K @ shift.ravel(), 0, atol=1e-14)
        turned = np.cross(np.eye(3)[axis], places)
        np.testing.assert_allclose(K @ turned.ravel(), 0, atol=1e-14)


# ---- the punch


@functools.cache
def path(face: int) -> list[tuple[Any, Any]]:
    """Problems and solutions along the path."""
    own = family("ElasticPunch")
    found = []
    for step in range(STEPS):
        problem = own.problem(face * STEPS + step)
        result = converged(problem, tol=1e-9)
        found.append((problem, result.solution))
    return found


def loads(face: int) -> tuple[Any, Any]:
    """Along the path: pressing force, and the one aside."""
    r = np.array([blocks(solution.r).sum(axis=0) for _, solution in path(face)])
    return r[:, 0], r[:, 1]


@pytest.mark.parametrize("face", [FLAT, ROUND])
def test_stored_slip_is_that_of_the_step_before(face: int) -> None:
    own = family("ElasticPunch")
    for step, (problem, solution) in enumerate(path(face)):
        v = blocks(problem.H.T @ solution.v)[:, 1:]
        np.testing.assert_allclose(history()[face][step], v, atol=1e-7 * own.down)
        if step + 1 < STEPS:
            after = blocks(path(face)[step + 1][0].w)[:, 1:]
            np.testing.assert_array_equal(after, -history()[face][step])


@pytest.mark.parametrize("face", [FLAT, ROUND])
def test_holder_carries_what_the_plane_presses(face: int) -> None:
    """Reactions of the clamped face, from the whole stiffness."""
    own = family("ElasticPunch")
    kind, bricks = KINDS_OF_FACE[face]
    del kind
    block = Block((bricks, bricks, bricks // 2), (own.edge / bricks,) * 3)
    K = stiffness(block, isotropic(own.young, own.poisson))
    top = block.numbers()[:, :, -1].ravel()
    held = (3 * top[:, None] + np.arange(3)).ravel()
    free = np.setdiff1d(np.arange(K.shape[0]), held)
    for step in (PRESSING - 1, PRESSING + 2, STEPS - 1):
        _, solution = path(face)[step]
        aside, down = own.holder(step)
        whole = np.zeros(K.shape[0])
        whole[free] = solution.v
        whole[held] = np.tile([aside, 0.0, -down], len(top))
        carried = blocks((K @ whole)[held]).sum(axis=0)
        pressing, along = (part[step] for part in loads(face))
        expected = [-pressing, -along]
        np.testing.assert_allclose(carried[[2, 0]], expected, atol=1e-6 * pressing)


def test_round_face_slips_in_a_ring_as_cattaneo_and_mindlin_say() -> None:
    """The part of the contact that sticks: (1 - Q / (mu P))^(2/3) of its area."""
    own = family("ElasticPunch")
    pressing, along = loads(ROUND)
    sticking = []
    for step in range(PRESSING, PRESSING + ASIDE):
        problem, solution = path(ROUND)[step]
        r = blocks(solution.r)
        u = blocks(problem.H.T @ solution.v + problem.w)
        closed = r[:, 0] > 1e-7 * pressing[step]
        sticks = closed & (np.linalg.norm(u[:, 1:], axis=1) < 1e-9)
        share = np.count_nonzero(sticks) / np.count_nonzero(closed)
        expected = (1 - abs(along[step]) / (own.mu * pressing[step])) ** (2 / 3)
        assert abs(share - expected) < 0.16  # a mesh of 8 x 8 has few rings
        sticking.append(share)
        # the ring: what sticks is nearer to the middle than what slips
        far = np.linalg.norm(problem.contacts.point[:, :2] - 0.5 * own.edge, axis=1)
        if sticks.any():
            assert far[sticks].mean() < far[closed & ~sticks].mean()
    assert sticking == sorted(sticking, reverse=True)
    assert sticking[-1] < 0.2 < 0.6 < sticking[0]


def test_force_aside_is_mindlins_and_never_beyond_coulombs() -> None:
    own = family("ElasticPunch")
    pressing, along = loads(ROUND)
    limit = own.mu * pressing
    assert np.all(np.abs(along) <= limit * (1 + 1e-9))
    # under the same pressing, Q = mu P (1 - (1 - d / d0)^(3/2)) for a displacement d up to d0
    shares = np.abs(along[PRESSING : PRESSING + ASIDE]) / limit[PRESSING : PRESSING + ASIDE]
    d = np.arange(1, ASIDE + 1) / ASIDE
    d0 = d[2] / (1 - (1 - shares[2]) ** (2 / 3))
    expected = 1 - np.maximum(1 - d / d0, 0) ** 1.5
    np.testing.assert_allclose(shares, expected, atol=0.05)
    # a way back is no way forth: at the same place the force differs
    middle = PRESSING + ASIDE + 2  # aside is 0 again
    assert own.holder(middle)[0] == pytest.approx(0, abs=1e-12)
    assert along[middle] / limit[middle] > 0.1
    assert abs(along[PRESSING - 1]) < 1e-6 * limit[0]


def test_holder_far_aside_drags_the_block_with_coulombs_force() -> None:
    """Rigid limit: all contacts slide, and Q is mu P up to what slides across."""
    own = family("ElasticPunch", aside=2e-2)
    kind, bricks = KINDS_OF_FACE[ROUND]
    before = history()[ROUND][PRESSING - 1]
    problem = own.of_step(kind, bricks, PRESSING + ASIDE - 1, before)
    result = converged(problem, tol=1e-9)
    pressing, along, across = blocks(result.solution.r).sum(axis=0)
    assert -along == pytest.approx(own.mu * pressing, rel=5e-3)
    assert abs(across) < 1e-4 * pressing


# ---- the tangent


def strains() -> Any:
    """(6 x 9) an orthonormal basis of symmetric matrices."""
    basis = []
    for i, j in itertools.combinations_with_replacement(range(3), 2):
        one = np.zeros((3, 3))
        one[i, j] = one[j, i] = 1.0 if i == j else math.sqrt(0.5)
        basis.append(one.ravel())
    return np.array(basis)


def test_stress_is_on_the_yield_surface_and_its_tangent_keeps_it_there() -> None:
    """Without hardening a strain leaves F as it is; unloading is not the tangent's."""
    own = family("PlasticTangent", hardening=1e-9)
    stress = own.stress()

    def F(sigma: Any) -> float:
        s = sigma - np.trace(sigma) / 3 * np.eye(3)
        return float(math.sqrt(0.5 * (s * s).sum()) + own.internal * np.trace(sigma) / 3)

    assert F(stress) == pytest.approx(0, abs=1e-9 * own.pressure)
    # beta < alpha: the bound is above 0, and so small a share of it is nothing beside G / 20
    C = own.tangent(0.0)
    strain = 1e-9 * strains()[2].reshape(3, 3)
    elastic = family("PlasticTangent", hardening=1e9).tangent(0.0)
    slack = F(stress + np.einsum("ikjl,jl->ik", C, strain))
    free = F(stress + np.einsum("ikjl,jl->ik", elastic, strain))
    assert abs(slack) < 0.1 * abs(free)


@pytest.mark.parametrize("dilatancy", DILATANCIES)
def test_tangent_is_asymmetric_by_what_dilatancy_lacks(dilatancy: float) -> None:
    own = family("PlasticTangent")
    C = own.tangent(dilatancy)
    s = own.stress() + own.pressure * np.eye(3)
    root = math.sqrt(0.5 * (s * s).sum())
    alpha, beta = own.internal, dilatancy * own.internal
    cross = np.multiply.outer(np.eye(3), s) - np.multiply.outer(s, np.eye(3))
    difference = C - C.transpose(2, 3, 0, 1)
    # (alpha - beta) K G / (sqrt(J2) (n C m + hardening)), up to the hardening
    factor = (difference * cross).sum() / (cross * cross).sum()
    np.testing.assert_allclose(difference, factor * cross, atol=1e-9 * own.bulk)
    if dilatancy == 1:
        assert factor == 0
    else:
        whole = (alpha - beta) * own.bulk * own.shear / root
        assert own.shear + own.bulk * alpha * beta < whole / factor
    P = strains()
    matrix = P @ C.reshape(9, 9) @ P.T
    assert np.linalg.eigvalsh(matrix + matrix.T)[0] > 0


def test_tangent_below_the_bound_is_not_definite() -> None:
    P = strains()
    C = family("PlasticTangent", hardening=0.8).tangent(-0.5)
    matrix = P @ C.reshape(9, 9) @ P.T
    assert np.linalg.eigvalsh(matrix + matrix.T)[0] < 0


def test_both_forms_of_the_tangent_are_asymmetric_and_have_one_solution() -> None:
    for number, dilatancy in ((1, 1.0), (7, 0.0)):
        problem = family("PlasticTangent").problem(number)
        local = problem.condense()
        M = problem.M.toarray()
        W = local.W.toarray() if sp.issparse(local.W) else np.asarray(local.W)
        expected = problem.H.T @ np.linalg.solve(M, problem.H.toarray())
        np.testing.assert_allclose(W, expected, atol=1e-11 * np.abs(W).max())
        for matrix in (problem.M, sp.csc_array(W)):
            if dilatancy == 1:
                assert _symmetry.asymmetry(matrix) < 1e-12
            else:
                assert _symmetry.asymmetry(matrix) > 0.05
        ends = []
        for form in (problem, local):
            result = converged(form, tol=1e-10)
            ends.append(result.solution.r)
        np.testing.assert_allclose(ends[0], ends[1], atol=1e-5 * np.abs(ends[0]).max())


def test_holder_that_stays_leaves_the_stress_as_it_is() -> None:
    """Reactions are then those of the stress before: pressure and shear times area."""
    own = family("PlasticTangent", mu=2.0)
    problem = own.of_move(6, 0.0, (0.0, 0.0))
    result = converged(problem, tol=1e-10)
    r = blocks(result.solution.r)
    share = np.full((7, 7), (own.edge / 6) ** 2)
    share[[0, -1]] *= 0.5
    share[:, [0, -1]] *= 0.5
    stress = own.stress()
    for component, row in ((0, 2), (1, 0), (2, 1)):
        np.testing.assert_allclose(
            r[:, component], -share.ravel() * stress[row, 2], atol=1e-6 * own.pressure * 1e-3
        )
    assert result.solution.v is not None
    np.testing.assert_allclose(result.solution.v, 0, atol=1e-6 * own.move)
