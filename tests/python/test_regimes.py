"""The set rr9118: published states whose problems are what the published sets are."""

import csv
import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import collections
from fclib.collections import known, published
from fclib.scenes.local_problems import ChuteLocalProblems

# MuJoCo has no release for the oldest Python that fclib takes
pytest.importorskip("mujoco")
pytest.importorskip("skfem")

ROOT = Path(__file__).parents[2]
if not (ROOT / "benchmarks").is_dir():
    pytest.skip("a source distribution has no benchmarks", allow_module_level=True)


def benchmark(name: str) -> Any:
    """A script, as a module; it imports what lies beside it."""
    path = ROOT / "benchmarks" / f"{name}.py"
    sys.path.insert(0, str(path.parent))
    try:
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module


table = benchmark("collection_table")
with table.PUBLISHED.open(newline="") as file:
    PUBLISHED = list(csv.DictReader(file))
FOLDERS = [name for name in known.sets()["rr9118"] if published.versions(name)]
# of its smallest body's diameter; elastic ones have none
DEEPEST = 0.02
# ends that other ends exclude, or that the page explains
NOT_MET = {
    "rr9118/CubesH8": ("density",),
    "rr9118/CubesH8x2": ("density",),
    "rr9118/Chain": ("contacts",),
    "rr9118/PeriodicBox": ("contacts",),
}


@pytest.mark.parametrize(
    ("folder", "version"),
    [(folder, version) for folder in FOLDERS for version in published.versions(folder)],
)
def test_problem_is_the_published_one_and_no_body_is_in_another(folder: str, version: str) -> None:
    path = published.path_of(folder, version)
    assert path is not None
    states = collections.read_trajectory(path)
    assert collections.plan_of(folder, version=version).trajectory == path
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


@pytest.mark.parametrize("row", PUBLISHED, ids=lambda row: row["set"])
def test_sizes_are_those_published(row: dict[str, str]) -> None:
    """Where the published ranges of a set allow it; both ends to a tenth, as the table says."""
    folder = row["ours"]
    path = published.path_of(folder, known.version_of(folder))
    if path is None or not folder.startswith("rr9118/"):
        pytest.skip("no published states of this set")
    states = collections.read_trajectory(path)
    rows = []
    for place in range(len(states)):
        problem = states.problem(place).problem
        rows.append({"n": problem.n, "nc": problem.nc, "density": problem.m / problem.n})
    off = {word.split()[0] for word in table.within(row, rows, []).split(", ")}
    assert off <= {"yes", *NOT_MET.get(folder, ())}


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


def test_problems_of_one_contact_are_conditioned_as_published() -> None:
    low, high = 1.04, 4.66
    found = [table.figures(ChuteLocalProblems().problem(k))[1] for k in (0, 400, 833)]
    assert found == sorted(found)
    assert low <= found[0] <= low * 10**table.CLOSE
    assert high / 10**table.CLOSE <= found[-1] <= high
