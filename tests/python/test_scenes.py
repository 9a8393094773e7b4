"""Every family keeps the contract of scenes; none is named here but where its own facts are."""

import dataclasses
import json

import numpy as np
import pytest

from fclib import scenes

# MuJoCo has no release for the oldest Python that fclib takes
pytest.importorskip("mujoco")

from fclib.simulate import MujocoModel, simulate

FAMILIES = scenes.families()


def test_families_are_found() -> None:
    assert "BoxesStack" in FAMILIES
    assert scenes.get("BoxesStack") is FAMILIES["BoxesStack"]


def test_unknown_family_lists_the_known_ones() -> None:
    with pytest.raises(KeyError, match=r"'BoxStack'.*BoxesStack"):
        scenes.get("BoxStack")


@pytest.mark.parametrize("name", FAMILIES)
def test_family_says_what_it_is(name: str) -> None:
    family = FAMILIES[name]
    for text in ("title", "description", "application", "authors", "friction"):
        assert getattr(family, text).strip(), text
    for parameter in dataclasses.fields(family):
        assert parameter.default is not dataclasses.MISSING, parameter.name
        assert parameter.metadata["unit"], parameter.name
        assert parameter.metadata["doc"], parameter.name


@pytest.mark.parametrize("name", FAMILIES)
def test_scene_follows_from_parameters_and_seed(name: str) -> None:
    family = FAMILIES[name]
    scene = family().scene(seed=7)
    # the parameters survive a file's text
    parameters = json.loads(json.dumps(dict(scene.parameters)))
    assert family(**parameters).scene(seed=7) == scene
    assert scene.seed == 7
    assert scene.name == name


@pytest.mark.parametrize("name", FAMILIES)
def test_scene_is_simulated(name: str) -> None:
    steps = list(simulate(FAMILIES[name]().scene(seed=0), 3))
    assert [step.index for step in steps] == [0, 1, 2]
    for step in steps:
        assert step.result.converged
        assert len(step.contacts) == step.problem.nc
        assert np.isfinite(step.position).all()


@pytest.mark.parametrize("boxes", [1, 2, 50])
def test_boxes_stack_has_its_boxes(boxes: int) -> None:
    model = MujocoModel(scenes.get("BoxesStack")(boxes=boxes, mass=3.0).scene())
    assert model.velocity.size == 6 * boxes
    np.testing.assert_allclose(model.model.body_mass[1:], 3.0)
    # a cube: m a^2 / 6 about each axis
    np.testing.assert_allclose(model.model.body_inertia[1:], 3.0 * 2.0**2 / 6)


def test_boxes_stack_lands_on_four_points_a_box() -> None:
    scene = scenes.get("BoxesStack")(boxes=3, gap=0.005, time_step=5e-3).scene(seed=1)
    *_, last = simulate(scene, 25)
    assert last.problem.nc == 12
    pairs, counts = np.unique(last.contacts.pair, axis=0, return_counts=True)
    np.testing.assert_array_equal(pairs, [[0, 1], [1, 2], [2, 3]])
    np.testing.assert_array_equal(counts, 4)


def test_boxes_stack_seed_draws_the_offsets() -> None:
    family = scenes.get("BoxesStack")
    low, high = family(boxes=3).scene(seed=0), family(boxes=5).scene(seed=0)
    start = [MujocoModel(scene).position.reshape(-1, 7) for scene in (low, high)]
    np.testing.assert_array_equal(start[0], start[1][:3])
    assert np.abs(start[1][:, :2]).max() <= 0.05
    other = MujocoModel(family(boxes=3).scene(seed=1)).position.reshape(-1, 7)
    assert np.all(other[:, :2] != start[0][:, :2])


@pytest.mark.parametrize(
    ("name", "value"), [("boxes", 0), ("size", 0.0), ("mass", -1.0), ("mu", -0.1), ("gap", -1e-3)]
)
def test_boxes_stack_refuses_nonsense(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        scenes.get("BoxesStack")(**{name: value})
