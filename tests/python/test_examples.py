"""The scripts of examples/python: they run as they are, and what they leave is right."""

import os
import re
import sqlite3
import sys
from pathlib import Path

import pytest

import fclib
from helpers import ran

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")
imread = pytest.importorskip("matplotlib.image").imread


def run(root: Path, folder: Path, script: str, *arguments: object) -> str:
    command = [sys.executable, str(root / "examples/python" / script), *map(str, arguments)]
    done = ran(
        *command,
        cwd=folder,
        env=os.environ | {"MPLBACKEND": "Agg", "FCLIB_CACHE": str(folder / "cache")},
    )
    return done.stdout


def assert_drawn(path: Path) -> None:
    """A picture that is not empty."""
    pixels = imread(path)[..., :3]
    assert 0.002 < (pixels.min(axis=2) < 0.9).mean() < 0.9


def test_look(root: Path, tmp_path: Path) -> None:
    output = run(root, tmp_path, "look.py")
    assert "40 contacts, friction 0.7 to 0.7" in output
    assert "exists by Slater" in output
    assert_drawn(tmp_path / "look.png")
    assert fclib.read(tmp_path / "stack.hdf5").nc == 40


@pytest.mark.parametrize("worlds", [(256,), pytest.param((), marks=pytest.mark.long)])
def test_mass_and_friction_of_a_cube_in_many_worlds(
    worlds: tuple[int, ...], root: Path, tmp_path: Path
) -> None:
    last = run(root, tmp_path, "worlds.py", *worlds).splitlines()[-2]
    mass, mu = (float(number) for number in re.findall(r"(?:mass|mu) ([\d.]+)", last))
    assert abs(mass - 1.7) < 0.01
    assert abs(mu - 0.35) < 0.005


def test_five_solvers_converge(root: Path, tmp_path: Path) -> None:
    output = run(root, tmp_path, "convergence.py")
    lines = [line.split() for line in output.splitlines()[1:]]
    assert [words[0] for words in lines] == ["nsgs", "fp-eg-upk", "admm", "nsn-ac", "auto"]
    assert all(words[1] == "converged" and float(words[5]) <= 1.01e-8 for words in lines)
    assert_drawn(tmp_path / "convergence.png")


def test_an_own_solver_on_the_bench(root: Path, tmp_path: Path) -> None:
    output = run(root, tmp_path, "bench_own_solver.py")
    assert "48 runs, 0 of them stored before" in output
    assert re.search(r"^my-pgs +solved 6 of 6", output, re.MULTILINE)
    assert_drawn(tmp_path / "own.png")


def test_from_a_robot_to_a_benchmark(root: Path, tmp_path: Path) -> None:
    output = run(root, tmp_path, "robot.py")
    files = sorted((tmp_path / "robot").glob("*.hdf5"))
    assert f"{len(files)} problems" in output
    assert len(files) > 3
    for path in files:
        problem, solution = fclib.read(path), fclib.read_solution(path)
        assert solution is not None
        assert fclib.merit(problem, solution).error_by("natural") <= 1e-8
    with sqlite3.connect(tmp_path / "robot.sqlite") as store:
        runs = store.execute("SELECT count(*), sum(solved) FROM results").fetchone()
    assert runs == (4 * len(files), 4 * len(files))
