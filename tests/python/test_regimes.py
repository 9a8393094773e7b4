"""The set rr9118: its problems are what the published sets are. Their sizes: test_trajectory.py."""

import csv
import dataclasses
import importlib
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import fclib
import fclib.simulate
from fclib import collections
from fclib.collections import published, set_index
from fclib.scenes.local_problems import ChuteLocalProblems

# MuJoCo has no release for the oldest Python that fclib takes
pytest.importorskip("mujoco")
pytest.importorskip("skfem")

from fclib.simulate.rounding import PER_SIZE
from workshop.sets import collection_table as table
from workshop.sets import regimes

with table.PUBLISHED.open(newline="") as file:
    PUBLISHED = list(csv.DictReader(file))


def test_capsules_and_their_matrices_are_not_symmetric() -> None:
    path = published.path_of("rr9118/Capsules", "1")
    if path is None:
        pytest.skip("the published states are not here")
    problem: Any = collections.read_trajectory(path).problem(60).problem
    W = problem.H.T @ np.linalg.solve(problem.M.toarray(), problem.H.toarray())
    assert 0.002 < np.abs(W - W.T).max() / np.abs(W).max() < 0.03
    assert "gyroscopic" in problem.info.math_info
    result = fclib.solve(problem, time_limit=20.0)
    assert result.error < 1e-6


def test_ranges_that_exclude_each_other_are_found() -> None:
    row = next(row for row in PUBLISHED if row["set"] == "Chain")
    (found,) = table.exclusions(row)
    # eight contacts of 54 degrees of freedom or more are a density of 24/54 at most
    assert (found["end"], found["nearest"], found["or density"]) == (
        "least contacts",
        "9",
        "at most 0.444",
    )
    assert not list(table.exclusions(row | {"contacts": "9 to 28"}))
    assert not list(table.exclusions(row | {"dof": "48 to 60"}))
    assert not list(table.exclusions(row | {"density": "0.4 to 1.3"}))


def test_pairs_of_bodies_are_counted_whatever_their_order() -> None:
    body = np.array([[0, 1], [1, 0], [0, 1], [-1, 0]])
    problem = SimpleNamespace(n=12, nc=4, contacts=SimpleNamespace(body=body))
    assert table.touching(problem) == {"pairs of a body": "1", "contacts of a pair": "2"}


def row_of(number: int, contacts: int, **figures: Any) -> Any:
    """A step; what is not given is as in Bridge_PR, or no matter."""
    given = {"dof": 100, "depth": 0.0, "rank_ratio": 1.0, "conditioning": 9e4} | figures
    given |= {"position": None, "velocity": None}
    return regimes.Row(number=number, step=number, contacts=contacts, **given)


def test_steps_are_chosen_inside_the_published_range() -> None:
    row = next(row for row in PUBLISHED if row["set"] == "Chute_4000")
    low, high = (int(end) for end in row["contacts"].split(" to "))
    regime = regimes.Regime("Chute_4000", {}, keep=6, steps=1, fill=True)
    count = 500
    contacts = np.linspace(low - 500, high + 500, count).round().astype(int)
    steps = [row_of(k, int(contacts[k]), depth=0.03 if k % 5 == 0 else 0.0) for k in range(count)]
    kept = regimes.chosen(steps, regime)
    assert len(kept) == int(row["problems"])
    assert len({one.number for one in kept}) == len(kept)
    assert [one.number for one in kept] == sorted(one.number for one in kept)
    assert all(low <= one.contacts <= high and one.depth <= regimes.DEEPEST for one in kept)
    inside = [one for one in steps if low <= one.contacts <= high and one.depth <= regimes.DEEPEST]
    assert inside[0] in kept
    assert inside[-1] in kept
    # the largest step between two neighbours: they are spread over the whole range
    assert np.diff([one.contacts for one in kept]).max() < 0.1 * (high - low)
    # as many as are wanting, and none where there are enough
    assert len(regimes.chosen(steps, regime, len(kept) - 3)) == 3
    assert regimes.chosen(steps, regime, len(kept)) == []
    assert regimes.chosen([steps[0]], regime) == []
    few = dataclasses.replace(regime, fill=False)
    assert 2 <= len(regimes.chosen(steps, few)) <= few.keep


def test_steps_are_chosen_by_every_figure_that_is_known() -> None:
    row = next(row for row in PUBLISHED if row["set"] == "Bridge_PR")
    low, high = (float(end) for end in row["conditioning"].split(" to "))
    regime = regimes.Regime("Bridge_PR", {}, keep=4, steps=1, by=("conditioning",))
    middle = sum(int(end) for end in row["contacts"].split(" to ")) // 2
    inside = np.geomspace(low, high, 20)
    steps = [row_of(k, middle, conditioning=float(value)) for k, value in enumerate(inside)]
    far = [
        row_of(100, middle, conditioning=low / 100),
        row_of(101, middle, conditioning=high * 100),
    ]
    unknown = row_of(102, middle, conditioning=float("nan"))
    kept = regimes.chosen([*steps, *far, unknown], regime)
    assert steps[0] in kept
    assert steps[-1] in kept
    assert not set(far) & set(kept)
    filled = regimes.chosen([*steps, *far, unknown], dataclasses.replace(regime, fill=True))
    assert set(filled) == {*steps, unknown}


def test_steps_evenly_in_time_keep_those_of_chosen_sets() -> None:
    found = [row_of(k, 100 + k) for k in range(101)]
    stored = [row_of(k, 1000 + k) for k in (3, 4, 50, 77)]
    kept = regimes.in_time(found, stored, {3, 4}, 11)
    numbers = [row.number for row in kept]
    # 3 and 4 take the places of 0 and 10; 50 is one of the steps anyway, and 77 is none
    assert numbers == [3, 4, 20, 30, 40, 50, 60, 70, 80, 90, 100]
    assert [row.contacts for row in kept if row.number in (3, 4, 20, 50)] == [1003, 1004, 120, 1050]
    assert [row.number for row in regimes.in_time(found, [], set(), 3)] == [0, 50, 100]


def test_states_of_chosen_sets_are_known_by_their_digests() -> None:
    path = published.path_of("decks/SpheresInPlates", "1")
    if path is None:
        pytest.skip("the published states are not here")
    states = collections.read_trajectory(path)
    numbers = regimes.in_sets(states)
    assert numbers
    assert numbers < set(states.number.tolist())
    listed = {
        one.number for one in set_index.choices("standard") if one.family == "SpheresInPlates"
    }
    assert numbers == listed


def test_problems_of_one_contact_are_conditioned_as_published() -> None:
    low, high = 1.04, 4.66
    found = [table.figures(ChuteLocalProblems().problem(k))[1] for k in (0, 400, 833)]
    assert found == sorted(found)
    assert low <= found[0] <= low * 10**table.CLOSE
    assert high / 10**table.CLOSE <= found[-1] <= high


def test_a_regime_is_filled_up_to_the_published_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """By steps that have all figures as published; the ends of a figure are among them."""
    monkeypatch.syspath_prepend(table.PUBLISHED.parent)
    regimes: Any = importlib.import_module("regimes")
    # of the set Chain: 60 degrees of freedom, 8 to 28 contacts, 242 problems
    rows = [regimes.Row(k, k, None, None, 60, 5 + k % 30, 0.0, 1.2, 1e6) for k in range(1000)]
    own = regimes.Regime("Chain", {}, keep=20, by=("density",))
    few = regimes.chosen(rows, own)
    many = regimes.chosen(rows, dataclasses.replace(own, fill=True))
    assert len(few) <= 20 < len(many) == 242
    assert {row.number for row in few} < {row.number for row in many}
    inside = {row.contacts for row in many}
    assert (min(inside), max(inside)) == (9, 28)


def test_every_regime_stands_beside_its_published_set() -> None:
    ours = {row["set"]: row["ours"].split() for row in PUBLISHED}
    for name, regime in regimes.REGIMES.items():
        assert f"{regime.collection}/{name}" in ours[regime.published]
        family: Any = fclib.scenes.get(regime.scene or name)
        family(**regime.parameters)


@pytest.mark.parametrize(("name", "unit"), [("Spheres", 1.0), ("Spheres1mm", 1e-3)])
def test_the_column_of_spheres_begins_as_the_librarys(name: str, unit: float) -> None:
    """10 x 10 x 20 of them, 2 apart, the lowest 5 above the ground, each a little beside it."""
    regime = regimes.REGIMES[name]
    family: Any = fclib.scenes.get(regime.scene)
    model: Any = fclib.simulate.model_of(family(**regime.parameters).scene(3))
    places = model.position.reshape(-1, 7)[:, :3] / unit
    grid = np.array([(2 * i - 9, 2 * j - 9, 2 * k + 5) for k in range(20) for i in range(10)
                     for j in range(10)])  # fmt: skip
    assert np.abs(places - grid).max() <= 0.05 + 1e-9
    assert np.abs(places - grid).max() > 0.045
    mass = model.model.body_mass[1:]
    expected = 1.0 if name == "Spheres" else 1000 * 4 / 3 * np.pi * 0.9e-3**3
    np.testing.assert_allclose(mass[mass > 0], expected, rtol=1e-3)
    assert fclib.scenes.get(regime.scene)(**regime.parameters).scene(0).all_bodies


def test_a_sphere_stays_in_its_place() -> None:
    family: Any = fclib.scenes.get("SpheresInABox")
    with pytest.raises(ValueError, match=r"offset must be at most gap / 2 = 0.05, not 0.06"):
        family(offset=0.06)
    with pytest.raises(ValueError, match="width"):
        family(across=6)


def test_a_sphere_has_the_same_problem_in_the_frame_of_the_world() -> None:
    rng = np.random.default_rng(0)
    scene = fclib.scenes.get("SpheresInABox")(spheres=20, gap=0.0).scene(0)
    model = fclib.simulate.model_of(scene)
    scheme = fclib.simulate.scheme_of(model)
    position = model.position.reshape(-1, 7).copy()
    position[:, 2] -= 0.5  # the lowest ones are in the floor
    turns = rng.normal(size=(20, 4))
    position[:, 3:] = turns / np.linalg.norm(turns, axis=1, keepdims=True)
    velocity = rng.normal(size=120)
    own: Any = fclib.simulate.problem_at(model, scheme, position.ravel(), velocity).problem
    size = model.smallest_size
    assert size is not None
    state = regimes.plainest(position.ravel(), velocity, scheme.h, size)
    plain: Any = fclib.simulate.problem_at(model, scheme, *state).problem
    assert own.nc == plain.nc >= 9
    first, second = own.condense(), plain.condense()
    difference = np.abs((first.W - second.W).toarray()).max()
    assert difference < 1e-6 * np.abs(first.W.toarray()).max()
    # a point of the surface moves by less than a quantum of places in a step
    assert np.abs(first.q - second.q).max() * scheme.h < 2.0**PER_SIZE * size
    assert (state[0].reshape(-1, 7)[:, 3:] == (1, 0, 0, 0)).all()
