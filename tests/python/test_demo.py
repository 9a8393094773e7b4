"""``fclib demo``: the main job, small, from the scene to the table."""

from __future__ import annotations

import csv
import json
from functools import partial
from pathlib import Path

import pytest

import fclib
import helpers_cli

pytest.importorskip("mujoco")

STEPS = 22  # the first box lands in step 14


run = partial(helpers_cli.run, "demo", "--boxes", 2, "--steps", STEPS, "--no-campaign", "--out")


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, str]:
    """Where a demo has written, and what it said."""
    folder = tmp_path_factory.mktemp("demo")
    done = run(folder)
    return folder, done.stdout, done.stderr


def test_the_demo_stores_solves_and_judges_every_step(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "demo"
    done = run(folder, "--json")
    records = [json.loads(line) for line in done.stdout.splitlines()]
    paths = sorted(folder.glob("*.hdf5"))
    assert len(paths) == 2 * STEPS
    # each problem in two configurations, and the CSV says the same
    assert len(records) == 4 * STEPS
    with (folder / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["problem"] for row in rows] == [record["problem"] for record in records]
    assert [float(row["error"]) for row in rows] == [record["error"] for record in records]
    assert max(record["nc"] for record in records) == 8

    # what is stored is what the records say
    for path in paths:
        problem, solution = fclib.read(path), fclib.read_solution(path)
        assert solution is not None
        own = [record for record in records if record["problem"] == path.stem]
        assert fclib.merit(problem, solution).error == min(r["error"] for r in own) <= 1e-8
        assert {record["nc"] for record in own} == {problem.nc}


def test_the_two_forms_of_a_step_are_one_problem(shown: tuple[Path, str, str]) -> None:
    folder = shown[0]
    for step in (0, STEPS - 1):
        whole = fclib.read(folder / f"stack-{step:03d}-global.hdf5")
        local = fclib.read(folder / f"stack-{step:03d}-local.hdf5")
        assert isinstance(whole, fclib.GlobalProblem)
        assert isinstance(local, fclib.LocalProblem)
        solution = fclib.read_solution(folder / f"stack-{step:03d}-global.hdf5")
        assert solution is not None
        assert fclib.merit(local, fclib.Solution(r=solution.r)).error <= 1e-8
        assert whole.n == 12
        assert "seed" in whole.info.description


def test_the_table_is_for_people(shown: tuple[Path, str, str]) -> None:
    _, table, said = shown
    for word in ("problem", "iterations", "cpu_s", "error", "converged", "runs.csv"):
        assert word in table
    assert "\x1b" not in table
    assert "simulating" not in said  # no progress bar into a pipe


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    done = run(tmp_path / "file", code=1)
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert str(tmp_path / "file") in done.stderr


def test_the_demo_ends_with_a_campaign_and_its_profile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.setenv("FCLIB_CACHE", str(tmp_path / "cache"))
    # what makes it long is not to be shown here
    short = "solvers = ['auto', 'nsgs']\n[[problems]]\nplanted = { count = 2, contacts = 5 }\n"
    monkeypatch.setattr("fclib.bench.campaign.PUBLISHED", tmp_path)
    (tmp_path / "quick.toml").write_text(short)
    done = helpers_cli.run("demo", "--boxes", 1, "--steps", 2, "--out", tmp_path / "demo")
    assert "virtual best" in done.stdout
    assert (tmp_path / "demo" / "quick.sqlite").exists()
    assert (tmp_path / "demo" / "profile" / "performance-cpu_s.pdf").exists()
