"""Cohesion, compliant patches and friction by ellipses: laws that become Coulomb's problem."""

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest

import fclib
from fclib.analysis._conventions import conventions
from fclib.scenes import assemblies
from fclib.scenes.shared import assembly
from helpers import converged

H = assembly.STEP
FALL = assembly.GRAVITY * H  # what gravity gives in a step [m/s]


def family(name: str, **parameters: Any) -> Any:
    return assemblies()[name](**parameters)


def facts(problem: Any) -> dict[str, Any]:
    return dict(json.loads(problem.info.description))


def solved(problem: Any, tol: float = 1e-9) -> Any:
    result = converged(problem, tol=tol)
    return result.solution


def blocks(r: Any) -> Any:
    return np.reshape(r, (-1, 3))


# ---- cohesion


@pytest.mark.parametrize("blocks_", [1, 5, 25])
def test_tower_hangs_from_what_carries_its_weight_on(blocks_: int) -> None:
    speeds = []
    for share in (0.98, 1.02):
        problem = family("CohesiveWall").of_kind("tower", 4 * blocks_, share)
        assert problem.nc == 4 * blocks_
        speeds.append(np.abs(solved(problem).v).max() / FALL)
    # too little glue: what lacks of the weight accelerates it
    assert speeds[0] == pytest.approx(0.02, rel=1e-4)
    assert speeds[1] < 1e-5


def test_reactions_with_cohesion_pull_and_balance_the_tower() -> None:
    problem = family("CohesiveWall").of_kind("tower", 20, 1.5)
    glue = facts(problem)["cohesion_impulse"]
    r = blocks(solved(problem).r).copy()
    r[:, 0] -= glue
    # each joint pulls by the weight below it; no more than the glue
    pulled = r[:, 0].reshape(-1, 4).sum(axis=1)
    np.testing.assert_allclose(pulled, -1000.0 * FALL * np.arange(5, 0, -1), rtol=1e-6)
    assert r[:, 0].min() > -glue


@pytest.mark.parametrize("kind", ["curtain", "pushed"])
def test_shifted_problem_is_the_law_with_cohesion(kind: str) -> None:
    """On the problem that has not been shifted: momentum, and the law of each contact."""
    own = family("CohesiveWall")
    problem = own.of_kind(kind, 100, 0.05 if kind == "pushed" else 0.9)
    glue = facts(problem)["cohesion_impulse"]
    bodies = assembly.running_bond(100, 0, push=own.push if kind == "pushed" else 0.0)
    plain: Any = bodies.problem(own.mu, "")
    solution = solved(problem, 1e-11)
    # a curtain is the wall upside down, with the same masses and gravity
    np.testing.assert_allclose(problem.M.toarray(), plain.M.toarray())
    r = blocks(solution.r).copy()
    r[:, 0] -= glue
    free = plain.f
    np.testing.assert_allclose(
        problem.M @ solution.v, problem.H @ r.ravel() + free, atol=1e-9 * np.abs(free).max()
    )
    u = blocks(problem.H.T @ solution.v)
    scale = np.abs(solution.v).max()
    assert u[:, 0].min() > -1e-8 * scale
    apart = u[:, 0] > 1e-6 * scale
    assert apart.any() == (kind == "curtain")
    np.testing.assert_allclose(r[apart, 0], -glue, atol=1e-6 * glue)
    tangential = np.linalg.norm(r[:, 1:], axis=1)
    assert np.all(tangential <= own.mu * (r[:, 0] + glue) + 1e-7 * glue)
    slides = np.linalg.norm(u[:, 1:], axis=1) > 1e-5 * scale
    np.testing.assert_allclose(tangential[slides], own.mu * (r[slides, 0] + glue), atol=1e-5 * glue)


@pytest.mark.parametrize("kind", ["tower", "pushed"])
def test_the_normal_of_a_glued_block_is_first(kind: str) -> None:
    # W has equal entries for N and T1 there, as a round body for both tangents
    assert conventions(family("CohesiveWall").of_kind(kind, 100, 0.9)) == []


def test_wall_without_glue_is_the_plain_one() -> None:
    own = family("CohesiveWall")
    bodies = assembly.running_bond(100, 3, push=own.push)
    bare = own.of_kind("pushed", 100, 0.0, seed=3)
    assert fclib.digest(bare) == fclib.digest(bodies.problem(own.mu, ""))


# ---- compliance


@pytest.mark.parametrize("points", [2, 8])
@pytest.mark.parametrize("share", [0.5, 0.98, 1.02])
def test_box_between_pads_falls_by_what_friction_lacks(points: int, share: float) -> None:
    problem = family("CompliantPatches").grip(points, 0.0, share)
    v = solved(problem).v
    np.testing.assert_allclose(v[2], -max(0.0, 1 - share) * FALL, atol=1e-7)
    np.testing.assert_allclose(v[[0, 1, 3, 4, 5]], 0, atol=1e-7)


def test_patches_hold_a_box_from_turning() -> None:
    """Beside its middle the pads need more friction: a moment, too."""
    turning = []
    for share in (1.1, 3.0):
        problem = family("CompliantPatches").grip(8, 0.5, share)
        turning.append(abs(solved(problem).v[3]))
    assert turning[0] > 1e-2
    assert turning[1] < 1e-6


def test_normal_reactions_are_springs_and_dampers() -> None:
    own = family("CompliantPatches")
    problem = own.wall(100, 2, 1e9)
    solution = solved(problem, 1e-10)
    nc, count = problem.nc, problem.n - problem.nc
    # the velocities of the bodies alone
    u = blocks(problem.H[:count].T @ solution.v[:count])[:, 0]
    stiffness = problem.M.diagonal()[count:] / (H * (H + own.relaxation))
    # R = 1 / (h k (h + tau)) is the inverse mass
    np.testing.assert_allclose(problem.M.diagonal()[count:], H * stiffness * (H + own.relaxation))
    assert set(np.round(stiffness / facts(problem)["stiffness"][0], 9)) <= {1.0, 2.0}
    gap = problem.contacts.gap
    force = np.maximum(0.0, -H * stiffness * (gap + (H + own.relaxation) * u))
    r = blocks(solution.r)[:, 0]
    np.testing.assert_allclose(r, force, atol=1e-6 * r.max())
    assert 0 < np.count_nonzero(r < 1e-9 * r.max()) < nc


def test_local_form_has_compliance_on_the_diagonal() -> None:
    problem = family("CompliantPatches").grip(4, 0.0, 1.1)
    count, nc = 6, problem.nc
    rigid = problem.H[:count]
    W = rigid.T @ np.diag(1 / problem.M.diagonal()[:count]) @ rigid.toarray()
    R = np.zeros(3 * nc)
    R[0::3] = 1 / problem.M.diagonal()[count:]
    local = problem.condense()
    found = local.W.toarray() if hasattr(local.W, "toarray") else np.asarray(local.W)
    np.testing.assert_allclose(found, W + np.diag(R), atol=1e-12 * np.abs(W).max())
    assert np.linalg.matrix_rank(W) == 6


# ---- ellipses


def sled(ratio: float, angle: float, push: tuple[float, float]) -> Any:
    """A flat block on the ground, its grain at an angle from x, with an impulse at its foot."""
    own = family("BrushedWall")
    wide = assembly.running_bond(4, 0, spread=0.0)
    assert len(wide.masses) == 1
    mass = float(wide.masses[0])
    flat = dataclasses.replace(wide, centres=wide.centres * [1, 1, 0])  # no moment about its foot
    problem = own.scaled(flat, np.full(4, angle), ratio, "")
    f = problem.f.copy()
    f[:2] += mass * np.array(push)
    # the first axis of the frames, on which angles count
    return problem.replace(f=f), own, mass


def ellipse(own: Any, ratio: float, x: float, y: float) -> float:
    """The size of a force in the ellipse, along the grain and across it, at r_N = 1."""
    root = math.sqrt(ratio)
    return math.hypot(x * root / own.mu, y / (root * own.mu))


@pytest.mark.parametrize("ratio", [1.0, 4.0])
@pytest.mark.parametrize("angle", [0.0, 0.7])
@pytest.mark.parametrize("heading", [0.3, 1.2])
def test_block_slides_beyond_the_ellipse_and_along_its_normal(
    ratio: float, angle: float, heading: float
) -> None:
    for share in (0.98, 1.5):
        problem, own, _ = sled(ratio, angle, (0.0, 0.0))
        T1 = problem.contacts.tangent[0]
        T2 = np.cross(problem.contacts.normal[0], T1)
        along, across = math.cos(heading), math.sin(heading)
        size = share * FALL / ellipse(own, ratio, along, across)
        push = size * (along * T1 + across * T2)
        problem, own, _ = sled(ratio, angle, (push[0], push[1]))
        v = solved(problem, 1e-11).v
        u = np.array([v[:3] @ T1, v[:3] @ T2])
        if share < 1:
            assert np.abs(u).max() < 1e-7
            continue
        # the reaction is on the ellipse, and the velocity is along its normal there
        force = (u - size * np.array([along, across])) / FALL  # on the block
        assert ellipse(own, ratio, *force) == pytest.approx(1.0, abs=1e-6)
        root = math.sqrt(ratio)
        normal = force * np.array([root**2, 1 / root**2])
        assert u[0] * normal[1] - u[1] * normal[0] == pytest.approx(0, abs=1e-8)
        assert u @ normal < 0


def test_scaled_reactions_are_those_of_an_ellipse_and_dissipate_most() -> None:
    own = family("BrushedWall")
    problem = own.problem(6)  # ratio 20
    known = facts(problem)
    S = np.array(known["S"])
    assert (known["mu1"], known["mu2"]) == pytest.approx(
        (own.mu / math.sqrt(20), own.mu * math.sqrt(20))
    )
    solution = solved(problem, 1e-10)
    r = blocks(solution.r) / S
    u = blocks(problem.H.T @ solution.v) * S
    # H of the file, scaled back, moves bodies as the directions of its table say
    ground = problem.contacts.body[:, 0] == 0
    own_body = 6 * (problem.contacts.body[:, 1] - 1)
    linear = np.stack([solution.v[own_body + k] for k in range(3)], axis=1)
    spin = np.stack([solution.v[own_body + 3 + k] for k in range(3)], axis=1)
    arm = problem.contacts.point - problem.bodies.place[problem.contacts.body[:, 1]]
    moved = linear + np.cross(spin, arm)
    expected = (moved * problem.contacts.tangent).sum(axis=1)
    np.testing.assert_allclose(u[ground, 1], expected[ground], atol=1e-9)
    axes = np.array([known["mu1"], known["mu2"]])
    size = np.linalg.norm(r[:, 1:] / axes, axis=1)
    scale = r[:, 0].max()
    assert np.all(size <= r[:, 0] + 1e-7 * scale)
    # the largest dissipation of an ellipse: -r_N || (mu1 u1, mu2 u2) ||
    power = (r[:, 1:] * u[:, 1:]).sum(axis=1)
    most = -r[:, 0] * np.linalg.norm(u[:, 1:] * axes, axis=1)
    np.testing.assert_allclose(power, most, atol=1e-7 * scale * np.abs(u).max())
    assert most.min() < -1e-3 * scale * np.abs(u).max()


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("CohesiveWall", {"mu": -0.1}),
        ("CompliantPatches", {"depth": 0.0}),
        ("BrushedWall", {"mu": 0.0}),
        ("PegInHole", {"width": 0.0}),
        ("Capstan", {"held": -1.0}),
        ("ElasticPunch", {"poisson": 0.5}),
        ("PlasticTangent", {"bulk": math.nan}),
    ],
)
def test_nonsense_is_refused(name: str, wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        family(name, **wrong)
