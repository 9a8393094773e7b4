"""A periodic cell: nothing depends on where its boundary is, and it feels no force from itself."""

import dataclasses
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import example, given, settings
from hypothesis import strategies as st

import fclib
from fclib import scenes

pytest.importorskip("mujoco")

from fclib.scenes import Scene
from fclib.simulate import MoreauJean, MujocoModel, simulate
from fclib.simulate.moreau_jean import Contacts

PERIOD = 4.0
REACH = 1e-2  # h of the scheme [s]


@pytest.fixture(scope="module")
def model() -> MujocoModel:
    """Spheres that fill a cell and touch across its boundary, in motion."""
    rng = np.random.Generator(np.random.PCG64(5))
    balls = []
    for i in range(25):
        place = 0.8 * np.array([*divmod(i, 5), 0.5]) - [1.6, 1.6, 0.0]
        place += rng.uniform(-0.01, 0.01, size=3)
        balls.append(
            f'<body pos="{" ".join(map(str, place))}"><freejoint/>'
            f'<geom size="{rng.uniform(0.38, 0.42)}" friction="0.5"/></body>'
        )
    xml = (
        f'<mujoco><worldbody><geom type="plane" size="1 1 1"/>{"".join(balls)}</worldbody></mujoco>'
    )
    model = MujocoModel(Scene(name="balls", xml=xml, period=(PERIOD, PERIOD)))
    model.set_state(model.position, rng.uniform(-1, 1, size=len(model.velocity)))
    return model


def on_floor(contacts: Contacts) -> Any:
    return contacts.pair.min(axis=1) == 0


def across(contacts: Contacts, model: MujocoModel) -> Any:
    """Which contacts (nc) are of bodies on two sides of the boundary."""
    places = np.concatenate((np.zeros((1, 2)), model.position.reshape(-1, 7)[:, :2]))
    first, second = places[contacts.pair].swapaxes(0, 1)
    return (np.abs(first - second) > 0.5 * PERIOD).any(axis=1) & ~on_floor(contacts)


def moved(model: MujocoModel, shift: tuple[float, float]) -> MujocoModel:
    """A model of the same scene, all its bodies shifted by as much along x and y [m]."""
    other = MujocoModel(model.scene)
    places = model.position.reshape(-1, 7)
    places[:, :2] += shift
    other.set_state(places.ravel(), model.velocity)
    return other


def test_bodies_touch_across_the_boundary(model: MujocoModel) -> None:
    contacts = model.assemble(REACH).contacts
    assert 5 < across(contacts, model).sum() < len(contacts) / 2
    # each pair once, as the spheres have one contact
    pairs = np.sort(contacts.pair[~on_floor(contacts)], axis=1)
    assert len(np.unique(pairs, axis=0)) == len(pairs)


@settings(max_examples=8, deadline=None)
@given(shift=st.tuples(*[st.floats(-10, 10)] * 2))
@example(shift=(0.5 * PERIOD, 0.5 * PERIOD))
@example(shift=(PERIOD, -2 * PERIOD))
def test_a_shifted_cell_has_the_same_problem(
    model: MujocoModel, shift: tuple[float, float]
) -> None:
    scheme = MoreauJean(h=REACH)
    parts = []
    for each in (moved(model, (0.0, 0.0)), moved(model, shift)):
        assert np.abs(each.position.reshape(-1, 7)[:, :2]).max() <= 0.5 * PERIOD
        parts.append(scheme.problem(scheme.assemble(each), each.velocity))
    here, there = (part.problem for part in parts)
    assert there.nc == here.nc > 15
    np.testing.assert_array_equal(parts[1].dofs, parts[0].dofs)
    np.testing.assert_allclose(there.f, here.f, rtol=1e-12, atol=1e-9)
    gaps = [np.sort(part.contacts.gap) for part in parts]
    np.testing.assert_allclose(gaps[1], gaps[0], atol=1e-12)
    # the order of the contacts is another, and which of two bodies is the first
    np.testing.assert_allclose(spectrum(there), spectrum(here), atol=1e-12)
    after: list[Any] = [fclib.solve(each, tol=1e-10).solution.v for each in (here, there)]
    np.testing.assert_allclose(after[1], after[0], atol=1e-7)


def spectrum(problem: Any) -> Any:
    """The eigenvalues of H^T M^-1 H, in order, for that of the largest."""
    W = (problem.H.T @ sp.linalg.spsolve(sp.csc_array(problem.M), problem.H)).toarray()
    values = np.linalg.eigvalsh(0.5 * (W + W.T))
    return values / values[-1]


def test_action_is_reaction_across_the_boundary(model: MujocoModel) -> None:
    system = model.assemble(REACH)
    H = system.H.toarray().reshape(-1, 6, system.H.shape[1])
    floor = np.repeat(on_floor(system.contacts), 3)
    # the momentum that an impulse gives to all bodies together: none, where they act on each other
    total = H[:, :3].sum(axis=0)
    assert np.abs(total[:, ~floor]).max() < 1e-12
    np.testing.assert_allclose(np.linalg.norm(total[:, floor], axis=0), 1.0)
    # and two bodies have a part in it
    far = np.repeat(across(system.contacts, model), 3)
    assert ((np.abs(H).max(axis=1) > 0)[:, far].sum(axis=0) == 2).all()


def test_momentum_is_kept_without_a_floor(model: MujocoModel) -> None:
    xml = model.scene.xml.replace('type="plane"', 'type="plane" pos="0 0 -100"')
    free = dataclasses.replace(model.scene, xml=xml, time_step=REACH)
    for step in simulate(free, 3, tol=1e-10):
        here: Any = step.model
        assert across(step.contacts, here).any()
        M, (before, after) = step.problem.M, (step.start.velocity, step.velocity)
        gained = (M @ (after - before)[step.dofs]).reshape(-1, 6)[:, :3].sum(axis=0)
        weight = 9.81 * M.diagonal()[0::6].sum()
        np.testing.assert_allclose(gained, [0, 0, -REACH * weight], atol=1e-9 * weight)


def test_rows_are_the_rates_of_the_gaps(model: MujocoModel) -> None:
    """H^T v against a difference of the gaps, also of contacts across the boundary."""
    small = 1e-7
    here = moved(model, (0.0, 0.0))
    system = here.assemble(REACH)
    rates = (system.H.T @ here.velocity)[::3]
    here.integrate(small, here.velocity)
    later = here.assemble(REACH).contacts
    np.testing.assert_array_equal(later.pair, system.contacts.pair)
    assert across(later, here).any()
    np.testing.assert_allclose((later.gap - system.contacts.gap) / small, rates, atol=1e-5)


def test_polyhedra_keep_their_shape_across_the_boundary() -> None:
    """Ghosts of meshes, whose bodies MuJoCo turns to their principal axes."""
    family: Any = scenes.get("PeriodicBox")(polyhedra=2, period=13.0)
    here = MujocoModel(family.scene(seed=0))
    gaps = []
    for x in (0.0, 6.5):
        places = here.position.reshape(-1, 7).copy()
        places[:, :3] = [(x - 1.5, 0, 9), (x + 1.5, 0.3, 9)]
        here.set_state(places.ravel(), here.velocity)
        gaps.append(here.assemble(1e-3).contacts.gap.min())
    assert gaps[0] < 0
    assert gaps[1] == pytest.approx(gaps[0], abs=1e-5)


def test_bodies_come_in_on_the_other_side() -> None:
    family: Any = scenes.get("PeriodicBox")(polyhedra=1, period=13.0)
    model = MujocoModel(family.scene(seed=0))
    v = np.zeros(6)
    v[:2] = 10.0, -4.0
    start = model.position
    for _ in range(20):
        model.integrate(0.1, v)
    end = model.position
    # 20 m along x is 7 beyond the period, -8 m along y 5 within it
    np.testing.assert_allclose((end - start)[:2] % 13.0, [7.0, 5.0])
    assert np.abs(end[:2]).max() <= 6.5


def test_ghosts_have_no_energy(model: MujocoModel) -> None:
    without = MujocoModel(dataclasses.replace(model.scene, period=None))
    without.set_state(model.position, model.velocity)
    assert moved(model, (0.0, 0.0)).energy() == pytest.approx(without.energy())


@pytest.mark.parametrize(
    ("body", "period", "message"),
    [
        ('<body><joint type="slide"/><geom size="1"/></body>', 9.0, "free bodies only"),
        ('<body><freejoint/><geom size="5"/></body>', 9.0, "body's size"),
    ],
)
def test_what_a_cell_cannot_hold_is_named(body: str, period: float, message: str) -> None:
    xml = f"<mujoco><worldbody>{body}</worldbody></mujoco>"
    scene = Scene(name="bad", xml=xml, period=(period, period))
    with pytest.raises(ValueError, match=message):
        MujocoModel(scene)


def test_rolling_moments_cross_the_boundary() -> None:
    """Two spheres that touch across the boundary have the H of two that touch within the cell."""
    ball = (
        '<body pos="{} 0.3 2"><freejoint/>'
        '<geom size="1" condim="6" friction="0.5 0 0.1" mass="1"/></body>'
    )
    found = []
    for x in (0.0, 9.5):
        balls = ball.format(x - 0.99) + ball.format(x + 0.99)
        xml = f"<mujoco><worldbody>{balls}</worldbody></mujoco>"
        model = MujocoModel(Scene(name="pair", xml=xml, period=(19.0, 13.0)))
        system = model.assemble(1e-2)
        assert len(system.contacts) == 1
        sign = np.sign(system.contacts.frame[0, 0, 0])
        found.append((sign * system.H.toarray()[:, 0], system.H.toarray()))
    np.testing.assert_allclose(found[1][0], found[0][0], atol=1e-12)
    for _, H in found:
        assert H.shape == (12, 5)
        np.testing.assert_allclose(H[:3] + H[6:9], 0, atol=1e-12)
        np.testing.assert_allclose(H[3:6, 3:] + H[9:, 3:], 0, atol=1e-12)
    same = dataclasses.replace(model.scene, period=None)
    assert MujocoModel(same).assemble(1e-2).H.shape[1] == 5


def test_what_only_looks_is_left_alone() -> None:
    look = '<geom size="1" contype="0" conaffinity="0" mass="1"/>'
    bodies = "".join(f'<body pos="{x} 0 0"><freejoint/>{look}</body>' for x in (-4.5, 4.0))
    xml = f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"
    model = MujocoModel(Scene(name="looks", xml=xml, period=(9.0, 9.0)))
    assert len(model.assemble(1e-2).contacts) == 0
