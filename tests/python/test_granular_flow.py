"""The stored states of a granular flow: what they hold, and the mechanics of their problems."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import _stored
from fclib.collections import set_index
from fclib.scenes import assemblies, granular_flow
from fclib.scenes.granular_flow import DIAMETER, MU, SIZES, STATES, GranularFlow, bodies_of, stored
from fclib.scenes.shared import assembly

SMALL = range(STATES)  # the problems of the least size
FLOWS = 4  # one of them, in the middle of the flow


def test_bytes_of_integers_are_those_integers() -> None:
    random = np.random.Generator(np.random.PCG64(0))
    for bits in (1, 7, 8, 20, 40):
        values = random.integers(-(2**bits), 2**bits, (3, 50))
        values[0, 0] = -(2**bits)
        planes = granular_flow.planes_of(values)
        assert planes.dtype == np.uint8
        assert len(planes) <= (bits + 9) // 8
        np.testing.assert_array_equal(granular_flow.whole(planes), values)


def test_file_that_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(granular_flow, "IN_PLACE", tmp_path / "none")
    monkeypatch.setattr(_stored, "COLLECTION", "fclib_collection_that_is_missing")
    with pytest.raises(FileNotFoundError, match="pip install fclib-collection"):
        granular_flow.path()
    # what lists families goes on without the package
    assert GranularFlow.digests() == ()
    assert set_index.distinct_of(["flows/GranularFlow"]) is None


@pytest.mark.parametrize("size", range(len(SIZES)))
def test_sizes_and_times(size: int) -> None:
    states = stored(size)
    assert len(states) == STATES
    assert [state.time for state in states] == sorted({state.time for state in states})
    assert states[0].time == 0
    for state in states:
        assert len(state.radii) == np.prod(SIZES[size])
        assert state.radii.min() >= 0.4 * DIAMETER * (1 - 1e-4)  # rounded
        assert state.radii.max() <= 0.5 * DIAMETER
    contacts = len(bodies_of(states[STATES // 2]).first)
    wanted = (10_000, 30_000, 100_000)[size]
    assert 0.85 * wanted < contacts < 1.25 * wanted


def test_digests_are_those_that_were_stored() -> None:
    digests = GranularFlow.digests()
    assert len(digests) == len(set(digests)) == GranularFlow.problems
    for number in (0, FLOWS):
        assert fclib.digest(GranularFlow().problem(number)) == digests[number]


def test_no_grain_is_deep_in_another_or_outside() -> None:
    for number in SMALL:
        state = stored(0)[number]
        bodies = bodies_of(state)
        assert -bodies.gaps.min() < 0.02 * DIAMETER
        x, y, z = state.places.T
        for away in (x, y, state.wide - y, z):
            assert (away - state.radii).min() > -0.02 * DIAMETER


def test_contacts_are_all_pairs_within_reach() -> None:
    """Counted again without a tree, of the grains in a slice."""
    state = stored(0)[FLOWS]
    bodies = bodies_of(state)
    reach = granular_flow.REACH * DIAMETER
    near = np.flatnonzero(state.places[:, 0] < 4 * DIAMETER)
    apart = np.linalg.norm(state.places[near, None] - state.places[None], axis=2)
    touches = apart - state.radii[near, None] - state.radii[None] <= reach
    touches[np.arange(len(near)), near] = False
    found = np.zeros(len(state.radii), dtype=int)
    inside = bodies.first >= 0
    np.add.at(found, bodies.first[inside], 1)
    np.add.at(found, bodies.second[inside], 1)
    np.testing.assert_array_equal(found[near], touches.sum(axis=1))


def test_momentum_comes_from_gravity_and_from_the_walls() -> None:
    problem: Any = GranularFlow().problem(FLOWS)
    state = stored(0)[FLOWS]
    mass = problem.M.diagonal().reshape(-1, 6)
    v0 = np.hstack((state.velocities, state.spins))
    known = json.loads(problem.info.description)
    assert known["time_step"] == state.step
    gravity = np.zeros(6)
    gravity[2] = -assembly.GRAVITY
    expected = mass * (v0 + state.step * gravity)
    np.testing.assert_allclose(np.reshape(problem.f, (-1, 6)), expected, rtol=1e-12, atol=1e-18)
    volume = 4 / 3 * np.pi * state.radii**3
    np.testing.assert_allclose(mass[:, 0], granular_flow.DENSITY * volume)
    np.testing.assert_allclose(mass[:, 3], 0.4 * mass[:, 0] * state.radii**2)

    result = fclib.solve(problem, "nsgs", tol=2e-3)
    assert result.error <= 2e-3
    assert result.solution.v is not None
    v = np.reshape(result.solution.v, (-1, 6))
    gained = (mass * (v - v0))[:, :3].sum(axis=0)
    # contacts of grains cancel: only those with walls act on the whole
    ground = problem.contacts.body[:, 0] == 0
    frames = np.stack(
        (
            problem.contacts.normal,
            problem.contacts.tangent,
            np.cross(problem.contacts.normal, problem.contacts.tangent),
        ),
        axis=1,
    )
    r = np.reshape(result.solution.r, (-1, 3))
    walls = np.einsum("ck,ckj->j", r[ground], frames[ground])
    weight = state.step * assembly.GRAVITY * mass[:, 0].sum()
    np.testing.assert_allclose(gained - walls, [0, 0, -weight], atol=1e-9 * weight)
    # the floor holds part of the weight, the back wall pushes outwards
    assert 0.1 * weight < walls[2] < 3 * weight


def test_flow_loses_energy() -> None:
    """From the opening on: potential and kinetic energy together, of all three sizes."""
    for size in range(len(SIZES)):
        energies = []
        for state in stored(size):
            mass = granular_flow.DENSITY * 4 / 3 * np.pi * state.radii**3
            height = assembly.GRAVITY * (mass * state.places[:, 2]).sum()
            moving = 0.5 * (mass * (state.velocities**2).sum(axis=1)).sum()
            turning = 0.2 * (mass * state.radii**2 * (state.spins**2).sum(axis=1)).sum()
            energies.append(height + moving + turning)
        assert np.all(np.diff(energies) < 0)
        fronts = [np.quantile(state.places[:, 0], 0.99) for state in stored(size)]
        assert np.all(np.diff(fronts) > 0)
        assert fronts[-1] > 1.5 * fronts[0]


def test_friction_is_one() -> None:
    assert set(assemblies()["GranularFlow"]().problem(0).mu.tolist()) == {MU}
