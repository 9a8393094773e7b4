"""The set rr9118: published states whose problems are what the published sets are."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import collections
from fclib.collections import known, published

# MuJoCo has no release for the oldest Python that fclib takes
pytest.importorskip("mujoco")
pytest.importorskip("skfem")

ROOT = Path(__file__).parents[2]
FOLDERS = [name for name in known.sets()["rr9118"] if published.versions(name)]
# of its smallest body's diameter; elastic ones have none
DEEPEST = 0.02


@pytest.mark.parametrize("folder", FOLDERS)
def test_problem_is_the_published_one_and_no_body_is_in_another(folder: str) -> None:
    path = published.path_of(folder, "1")
    assert path is not None
    states = collections.read_trajectory(path)
    assert collections.plan_of(folder).trajectory == path
    size = states.model.smallest_size
    # the first, the last, and one between; a large one alone
    places = {0, len(states) // 2, len(states) - 1} if states.position.shape[1] < 2e4 else {0}
    for place in places:
        step = states.problem(place)
        problem: Any = step.problem
        if problem.n < 50000:  # its digest depends on the sums of a large mesh
            assert fclib.digest(problem) == states.digest[place]
        assert -step.contacts.gap.min() <= DEEPEST * 2 * (size or 1.0)


def test_capsules_and_their_matrices_are_not_symmetric() -> None:
    path = published.path_of("rr9118/Capsules", "1")
    if path is None:
        pytest.skip("the published states are not here")
    problem: Any = collections.read_trajectory(path).problem(20).problem
    W = problem.H.T @ np.linalg.solve(problem.M.toarray(), problem.H.toarray())
    assert 0.002 < np.abs(W - W.T).max() / np.abs(W).max() < 0.03
    assert "gyroscopic" in problem.info.math_info
    result = fclib.solve(problem, time_limit=20.0)
    assert result.error < 1e-6


@pytest.mark.parametrize(
    ("folder", "published_name"),
    [
        ("Aqueduct", "Aqueduct_PR"),
        ("Capsules", "Capsules"),
        ("Chute1000", "Chute_1000"),
        ("CubesH8", "Cubes_H8_5"),
    ],
)
def test_numbers_of_contacts_are_those_published(folder: str, published_name: str) -> None:
    table = ROOT / "benchmarks" / "published_sets.csv"
    path = published.path_of(f"rr9118/{folder}", "1")
    if path is None or not table.is_file():
        pytest.skip("the published states or the table are not here")
    with table.open(newline="") as file:
        row = next(row for row in csv.DictReader(file) if row["set"] == published_name)
    low, high = (int(word) for word in row["contacts"].split(" to "))
    states = collections.read_trajectory(path)
    counts = [states.problem(place).problem.nc for place in range(0, len(states), 3)]
    counts.append(states.problem(len(states) - 1).problem.nc)
    assert low <= min(counts)
    assert 0.9 * high <= max(counts) <= high
