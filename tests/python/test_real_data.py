"""The problems that other programs wrote: they read, come back, and are solved."""

import csv
import json
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

import fclib
from ball_judge import judge
from helpers import columns, ran, real_folder

KINDS = ("local3d", "global3d", "local2d", "global2d", "condensed3d")
EXACT = 1e-12
SWEEPS = 20_000  # a problem


def files(*kinds: str) -> list[Path]:
    return [path for kind in kinds for path in sorted((real_folder() / kind).glob("*.hdf5"))]


def name_of(path: Path) -> str:
    return f"{path.parent.name}/{path.stem}"


FOUND = files(*KINDS)
ALL = [pytest.param(path, id=name_of(path)) for path in FOUND] or [pytest.param(None)]
needs_data = pytest.mark.skipif(not FOUND, reason=f"there are no real problems in {real_folder()}")


@pytest.fixture(scope="module")
def index(real_data: Path) -> dict[str, dict[str, str]]:
    with (real_data / "INDEX.csv").open() as file:
        return {f"{row['kind']}/{row['name']}": row for row in csv.DictReader(file)}


def stored_entries(problem: fclib.Problem) -> int:
    """Entries of the matrices as they stand in the file, duplicates and zeros too."""
    names = "W" if isinstance(problem, fclib.LocalProblem) else "MH"
    matrices = [getattr(problem, name) for name in names]
    return sum(a.size if isinstance(a, np.ndarray) else a.data.size for a in matrices)


@needs_data
@pytest.mark.parametrize("path", ALL)
def test_sizes_are_those_of_the_index(path: Path, index: dict[str, dict[str, str]]) -> None:
    problem = fclib.read(path)
    name = name_of(path).replace("condensed3d", "global3d").replace("-gcondensed", "")
    if path.parent.name == "condensed3d":
        # its source is listed, and it has the contacts of its source
        row = index[name.removesuffix("-condensed")]
        assert isinstance(problem, fclib.LocalProblem)
    else:
        row = index[name]
        assert stored_entries(problem) == int(row["nnz"])
        assert problem.n == int(row["n"] or 0)
    assert problem.spacedim == int(row["spacedim"])
    assert problem.m == int(row["m"])
    assert problem.nc == int(row["nc"])
    if problem.nc:
        assert problem.mu.min() == pytest.approx(float(row["mu_min"]), rel=1e-6)
        assert problem.mu.max() == pytest.approx(float(row["mu_max"]), rel=1e-6)


def test_info_prints_the_sizes_of_the_index(index: dict[str, dict[str, str]]) -> None:
    paths = files("local3d", "global3d", "local2d", "global2d")
    run = ran(sys.executable, "-m", "fclib", "info", "--json", *paths)
    for line, path in zip(run.stdout.splitlines(), paths, strict=True):
        record, row = json.loads(line), index[name_of(path)]
        for key in ("spacedim", "n", "m", "nc", "nnz"):
            assert record[key] == int(row[key] or 0), (path.name, key)


@needs_data
@pytest.mark.parametrize("path", ALL)
def test_rewriting_and_reading_back_is_equal(path: Path, tmp_path: Path) -> None:
    problem, solution = fclib.read(path), fclib.read_solution(path)
    copy = tmp_path / "copy.hdf5"
    fclib.write(copy, problem, solution)
    again, solution_again = fclib.read(copy), fclib.read_solution(copy)
    assert again.formulation == problem.formulation
    for name in ("title", "description", "math_info"):
        assert getattr(again.info, name) == getattr(problem.info, name)
    local = isinstance(problem, fclib.LocalProblem)
    for name in ("q", "mu") if local else ("f", "w", "mu"):
        np.testing.assert_array_equal(getattr(again, name), getattr(problem, name))
    for name in ("W",) if local else ("M", "H"):
        first, second = columns(getattr(problem, name)), columns(getattr(again, name))
        assert first.shape == second.shape
        assert (first != second).nnz == 0
    assert (solution is None) == (solution_again is None)
    if solution is not None and solution_again is not None:
        for name in ("v", "u", "r", "l"):
            np.testing.assert_array_equal(getattr(solution, name), getattr(solution_again, name))


@pytest.mark.parametrize(
    ("kinds", "least", "solver", "share"),
    [
        (("local3d", "global3d"), 30, "nsgs", 0.8),
        (("local2d", "global2d"), 1, "nsgs", 0.8),
        (("rolling", "rolling_local"), 5, "auto", 1.0),
    ],
)
def test_most_problems_are_solved_and_every_error_is_true(
    kinds: tuple[str, ...], least: int, solver: str, share: float, real_data: Path
) -> None:
    paths = files(*kinds)
    assert len(paths) >= least
    solved = []
    for path in paths:
        problem = fclib.read(path)
        result = fclib.solve(problem, solver, 1e-8, max_iterations=SWEEPS)
        assert abs(result.error - judge(problem, result.solution).error) <= EXACT, path.name
        assert result.converged == (result.error <= 1e-8)
        if result.converged:
            solved.append(path.name)
    assert len(solved) >= share * len(paths), sorted({path.name for path in paths} - set(solved))


@pytest.mark.parametrize("solver", ["aclm", "tresca"])
def test_fixed_points_do_not_circle(solver: str, real_data: Path) -> None:
    """With a constant relaxation of one both are above 1e-4 after a minute."""
    problem = fclib.read(real_data / "local3d" / "RockPile_tob1.hdf5")
    assert fclib.solve(problem, solver, 1e-4, max_iterations=200_000).converged


def test_condensation_agrees_with_that_of_the_index(real_data: Path) -> None:
    pairs = 0
    for path in files("global3d"):
        for suffix in ("-condensed", "-gcondensed"):
            other = real_data / "condensed3d" / f"{path.stem}{suffix}.hdf5"
            if not other.is_file():
                continue
            pairs += 1
            whole, expected = fclib.read(path), fclib.read(other)
            assert isinstance(whole, fclib.GlobalProblem)
            assert isinstance(expected, fclib.LocalProblem)
            local = whole.condense()
            difference = abs(columns(local.W) - columns(expected.W)).max()
            assert difference <= 1e-10 * abs(columns(expected.W)).max(), path.name
            scale = np.abs(expected.q).max()
            np.testing.assert_allclose(local.q, expected.q, atol=1e-10 * scale, rtol=1e-10)
    assert pairs >= 5


def test_stored_vectors_are_not_believed(real_data: Path) -> None:
    unwritten = judged = 0
    for path in files(*KINDS):
        # their writer was given no reactions: HDF5 would read zeros
        if "/solution/r: was declared and never written" in fclib.left_out(path):
            unwritten += 1
            assert fclib.read_solution(path) is None
            assert "solution" not in fclib.contents(path)
        problem = fclib.read(path)
        for guess in fclib.read_guesses(path):
            merit = fclib.merit(problem, guess)
            judged += 1
            assert abs(merit.error - judge(problem, guess).error) <= EXACT * max(1, merit.error)
    assert unwritten > 0
    assert judged > 0


def test_texts_are_those_of_the_file_and_end_where_they_end(real_data: Path) -> None:
    paths = files(*KINDS)
    assert paths
    for path in paths:
        problem = fclib.read(path)
        with h5py.File(path) as file:
            group = file[f"fclib_{problem.kind}"].get("info", {})
            for name in ("title", "description", "math_info"):
                stored = group[name][()].split(b"\0")[0] if name in group else b""
                assert getattr(problem.info, name) == stored.decode(errors="replace"), path.name


def test_a_layout_that_is_not_known_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "problem.hdf5"
    with h5py.File(path, "w") as file:
        file.create_group("fclib_bouncing/vectors")
    with pytest.raises(fclib.FileError, match="holds no problem") as caught:
        fclib.read(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
