"""Impacts, ropes, silos, spinning bodies: each against what analysis says of it."""

import math
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import scenes
from fclib.analysis import enumerate_solutions

# MuJoCo has no release for the oldest Python that fclib takes
pytest.importorskip("mujoco")

from fclib.simulate import Step, simulate
from helpers_simulate import last_of


def energies(steps: list[Step]) -> Any:
    """Of the starts of steps (k) [J]."""
    model: Any = steps[0].model
    found = []
    for step in steps:
        model.set_state(step.position, step.start.velocity)
        found.append(model.energy())
    return np.array(found)


# ---- impacts


def test_cradle_hands_the_speed_to_the_last_ball() -> None:
    """Impacts one after the other: with e = 1 as many leave as came, at the same speed."""
    family: Any = scenes.get("NewtonsCradle")(balls=5, gap=1e-3)
    speeds = -last_of(family.scene(), 40).velocity * family.length
    assert speeds[-1] == pytest.approx(family.speed, rel=0.12)  # less what gravity took
    assert np.abs(speeds[:-1]).max() < 0.02 * family.speed


def test_cradle_without_gaps_does_what_newtons_law_says() -> None:
    """One impact at all contacts: (2 - n) / n and 2 / n of the speed, by momentum."""
    n = 5
    family: Any = scenes.get("NewtonsCradle")(balls=n, mu=0.0, gravity=1e-9)
    speeds = -last_of(family.scene(), 3).velocity * family.length / family.speed
    np.testing.assert_allclose(speeds, [(2 - n) / n] + [2 / n] * (n - 1), atol=1e-3)


def test_block_rocks_as_long_as_housner_says() -> None:
    family: Any = scenes.get("RockingBlock")(height=4.0, time_step=4e-3)
    p = math.sqrt(0.75 * family.gravity / (0.5 * math.hypot(family.width, family.height)))
    quarter = math.acosh(1 / (1 - family.tilt)) / p
    steps = simulate(family.scene(), round(1.2 * quarter / family.time_step))
    landed = next(step.time for step in steps if step.position[2] <= 0)
    assert landed == pytest.approx(quarter, rel=0.015)


def test_sphere_bounces_to_the_square_of_its_restitution() -> None:
    family: Any = scenes.get("BouncingPile")(
        spheres=1, across=1, offset=0.0, height=0.5, time_step=2e-3
    )
    z = np.array([step.position[2] for step in simulate(family.scene(), 350)]) - family.radius
    lowest = int(z.argmin())
    assert z[lowest:].max() / 0.5 == pytest.approx(0.8**2, rel=0.02)


def test_bouncing_pile_without_friction_gains_no_energy() -> None:
    family: Any = scenes.get("BouncingPile")(spheres=8, across=2, mu=0.0, height=0.02)
    steps = list(simulate(family.scene(), 150))
    assert any(np.asarray(step.problem.w).max(initial=0.0) > 0.1 for step in steps) or any(
        np.abs(np.asarray(step.problem.w)).max(initial=0.0) > 0.1 for step in steps
    )
    energy = energies(steps)
    assert np.diff(energy).max() < 1e-6 * np.abs(energy).max()


# ---- existence and uniqueness


@pytest.mark.parametrize("side", [1, 2, 4])
def test_squeezed_spheres_have_no_solution_and_the_proof_says_why(side: int) -> None:
    family: Any = scenes.assemblies()["Squeezed"]()
    for closing in (1.0, 1e-12):
        problem = family.of_size(side, closing)
        y = np.zeros(3 * problem.nc)
        y[0::3] = family.proof(side)
        np.testing.assert_array_equal(problem.H @ y, 0.0)
        assert np.asarray(problem.w) @ y == -closing
        # apart by as much, walls and spheres at rest are a solution without gravity's step
        assert (np.asarray(family.of_size(side, -closing).w) >= 0).all()
    result = fclib.solve(family.of_size(side, 1.0), time_limit=100.0)
    assert str(result.status) == "infeasible"
    assert "held bodies" not in {stage.name for stage in result.stages}  # the proof comes first
    assert fclib.solve(family.of_size(side, -1.0)).converged


def test_of_many_rows_one_is_the_proof() -> None:
    family: Any = scenes.assemblies()["Squeezed"]()
    # 64 rows at once are too many contacts to bring to where all sums vanish exactly
    problem = family.of_size(8, 1e-4)
    result = fclib.solve(problem, chain="proof: no_solution limit=60", time_limit=100.0)
    assert str(result.status) == "infeasible"
    parting = family.of_size(8, -1e-4)
    result = fclib.solve(parting, chain="proof: no_solution limit=60", time_limit=100.0)
    assert str(result.status) != "infeasible"


def test_problems_have_as_many_solutions_as_their_analysis_says() -> None:
    family: Any = scenes.assemblies()["ManySolutions"]()
    for number in range(family.problems):
        problem = family.problem(number)
        mu = float(problem.mu[0])
        c, s = math.cos(family.angle), math.sin(family.angle)
        bound = ((1 + 3 * c**2) / (3 * s * c), math.tan(family.slope), 1 / family.coupling)[
            number // 12
        ]
        found = enumerate_solutions(problem).solutions
        # take-off alone; or take-off, sliding and sticking; or take-off and all locked states
        several = 2 if number // 12 == 1 else 3
        assert len(found) == (several if mu > bound + 1e-9 else 1), problem.info.title


# ---- rope, silo, spin, friction


def test_rope_holds_below_eytelweins_limit_and_slides_above() -> None:
    speeds = []
    for share in (0.85, 1.2):
        limit = scenes.get("Rope")(over=12, short=6).limit  # type: ignore[attr-defined]
        family: Any = scenes.get("Rope")(over=12, short=6, long=round(share * limit))
        last = last_of(family.scene(), 40)
        assert last.problem.nc >= 12
        speeds.append(float(np.linalg.norm(last.velocity[:2])))
    assert speeds[0] < 1e-6
    assert speeds[1] > 0.02


def test_walls_of_a_silo_carry_more_the_higher_it_is_filled() -> None:
    shares = []
    for discs in (20, 60):
        family: Any = scenes.get("Silo")(discs=discs, across=4, outlet=0.0, sink=0.05)
        loads = []
        for step in simulate(family.scene(), 240):
            if step.index < 160:
                continue
            m: Any = step.model.model  # type: ignore[union-attr]
            floor = np.flatnonzero(m.geom_bodyid == m.body("floor").id)
            on_floor = np.isin(step.contacts.pair, floor).any(axis=1)
            normal = np.reshape(step.result.solution.r, (-1, 2))[:, 0]
            loads.append(normal[on_floor].sum() / family.time_step)
        weight = m.body_mass[:-1].sum() * family.gravity
        shares.append(np.mean(loads) / weight)
    assert 0.5 < shares[0] < 1.05
    assert shares[1] < 0.85 * shares[0]


def test_spinning_bodies_have_an_asymmetric_matrix_and_gain_no_energy() -> None:
    family: Any = scenes.get("SpinningBodies")(bodies=8, across=2)
    steps = list(simulate(family.scene(), 130))
    worst = 0.0
    for step in steps:
        if step.problem.nc:
            assert step.result.converged
            M: Any = step.problem.M
            H: Any = step.problem.H
            W = H.T @ np.linalg.solve(M.toarray(), H.toarray())
            worst = max(worst, np.abs(W - W.T).max() / np.abs(W).max())
            assert "gyroscopic" in step.problem.info.math_info
    assert 0.003 < worst < 0.3
    energy = energies(steps)
    assert np.diff(energy).max() < 1e-3 * energy.max()


def test_gyroscopic_matrix_is_the_derivative_of_the_bias() -> None:
    """Of a free body: omega x I omega has the derivative [omega] I - [I omega]."""
    family: Any = scenes.get("SpinningBodies")(bodies=1, across=1)
    from fclib.simulate import MujocoModel

    model = MujocoModel(family.scene())
    C: Any = model.assemble(1e-3).C
    inertia = np.diag(model.model.body_inertia[1])
    omega = model.velocity[3:]

    def cross(a: Any) -> Any:
        return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])

    wanted = cross(omega) @ inertia - cross(inertia @ omega)
    np.testing.assert_allclose(C.toarray()[3:, 3:], wanted, atol=1e-9 * np.abs(wanted).max())
    assert not C.toarray()[:3].any()


def test_friction_is_drawn_by_contact() -> None:
    family: Any = scenes.assemblies()["MixedFriction"]()
    even, drawn, mixed = (family.problem(number) for number in (5, 7, 9))
    assert set(np.asarray(even.mu)) == {0.5}
    assert 0.8 < np.log(np.asarray(drawn.mu)).std() < 1.2
    assert set(np.asarray(mixed.mu)) == {0.02, 1.2}


def test_coefficients_of_rolling_spheres_are_drawn_too() -> None:
    """Each sphere has its own, a contact the larger of two; without a spread all are alike."""
    smaller: dict[str, Any] = {"spheres": 12, "per_layer": 4}
    alike: Any = last_of(scenes.get("RollingSpheres")(**smaller).scene(seed=1), 60).problem
    assert (set(np.asarray(alike.mu)), set(np.asarray(alike.mu_r))) == ({0.5}, {0.015})
    last = last_of(scenes.get("RollingSpheres")(**smaller, mixed=1.0).scene(seed=1), 60)
    assert last.result.converged
    problem: Any = last.problem
    for values, least in ((problem.mu, 0.5), (problem.mu_r, 0.015)):
        drawn = np.asarray(values)
        assert len(set(drawn)) > 3
        # the floor keeps the coefficient itself
        assert drawn.max() > 2 * least


def test_primitives_that_tumble_have_an_asymmetric_matrix() -> None:
    smaller: dict[str, Any] = {"bodies": 12, "width": 4.3, "gyroscopic": True}
    worst = 0.0
    for step in simulate(scenes.get("PrimitiveSoup")(**smaller).scene(seed=0), 110):
        assert step.result.converged
        if step.problem.nc:
            M: Any = step.problem.M
            H: Any = step.problem.H
            W = H.T @ np.linalg.solve(M.toarray(), H.toarray())
            worst = max(worst, np.abs(W - W.T).max() / np.abs(W).max())
    assert 1e-3 < worst < 0.1
