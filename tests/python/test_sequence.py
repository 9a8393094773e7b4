"""Consecutive problems, linked by the names of their contacts."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")

import itertools

from fclib import _geometry, collections, scenes
from fclib.collections.plan import Plan

FOLDER = "rt444/BoxesStack"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stack that lands, with its solutions and guesses."""
    scene = scenes.get("BoxesStack")(boxes=3, gap=2e-3, time_step=5e-3).scene(seed=0)
    out = tmp_path_factory.mktemp("built")
    version = collections.version("rt444")
    collections.build(
        [Plan(scene=scene, collection="rt444", version=version, problems=30)], out, pictures=False
    )
    return out


def test_guesses_are_the_impulses_of_the_same_contacts(built: Path) -> None:
    steps = list(fclib.sequence(FOLDER, built))
    assert [step.id[-4:] for step in steps] == [f"{k:04d}" for k in range(30)]
    assert steps[0].guess() is None
    carried = 0
    for before, step in itertools.pairwise(steps):
        guess, stored = step.guess(), fclib.read_guesses(built / f"{step.id}-global.hdf5")
        if step.before is None:
            assert guess is None and not stored  # noqa: PT018
            continue
        assert guess is not None
        np.testing.assert_array_equal(guess.r, stored[0].r)
        assert before.solution is not None
        assert before.problem.contacts is not None
        assert step.problem.contacts is not None
        known = dict(
            zip(before.problem.contacts.identity, before.solution.r.reshape(-1, 3), strict=True)
        )
        for name, r in zip(step.problem.contacts.identity, guess.r.reshape(-1, 3), strict=True):
            if name in known:
                # frames hardly turn in a step
                np.testing.assert_allclose(
                    r, known[name], atol=1e-3 * np.abs(before.solution.r).max()
                )
                carried += 1
    assert carried > 100
    # at rest the guess is nearly the solution
    last = steps[-1]
    cold = fclib.solve(last.problem, "nsgs", tol=1e-8)
    warm = fclib.solve(last.problem, "nsgs", tol=1e-8, guess=last.guess(steps[-2].solution))
    assert warm.iterations < cold.iterations


def test_a_new_frame_turns_the_impulse() -> None:
    def contacts(normal: Any, tangent: Any, feature: int) -> fclib.Contacts:
        columns = {"body": [[0, 1]], "shape": [[0, 1]], "feature": [feature]}
        integers = {name: np.array(value, np.int32) for name, value in columns.items()}
        return fclib.Contacts(
            **integers,
            point=np.zeros((1, 3)),
            normal=np.array([normal], float),
            tangent=np.array([tangent], float),
            gap=np.zeros(1),
        )

    before = contacts((0, 0, 1), (1, 0, 0), 3)
    turned = contacts((0, 0, 1), (0, 1, 0), 3)
    np.testing.assert_allclose(_geometry.carried(before, turned, [5, 1, 2], 3), [5, 2, -1])
    # a moment likewise; another feature of the same shapes is the nearest contact
    moved = contacts((0, 0, 1), (0, 1, 0), 4)
    np.testing.assert_allclose(
        _geometry.carried(before, moved, [5, 1, 2, 0, 1], 5), [5, 2, -1, 1, 0]
    )
    with pytest.raises(ValueError, match="4 reactions for 1 contacts of 3 components"):
        _geometry.carried(before, turned, np.zeros(4), 3)


def test_a_file_says_whose_it_is(built: Path) -> None:
    problem = fclib.read(built / FOLDER / "0003-local.hdf5")
    origin = json.loads(problem.info.description.split("\n")[-1])
    assert origin["license"] == "CC-BY-4.0"
    assert "RT-0444" in origin["citation"]
    assert origin["units"] == {"length": "m", "mass": "kg", "time": "s"}
    assert (origin["collection"], origin["number"]) == ("rt444", 3)
    row = collections.read_catalog(built).to_pylist()[3]
    assert (row["license"], row["citation"]) == (origin["license"], origin["citation"])


def test_a_set_is_no_sequence(built: Path) -> None:
    with pytest.raises(ValueError, match="rt444 has several"):
        next(fclib.sequence("rt444", built))
