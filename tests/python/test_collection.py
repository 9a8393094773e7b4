"""Collections: built the same twice and after a kill, verified, published and fetched."""

import contextlib
import dataclasses
import datetime
import functools
import http.server
import importlib
import json
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import fclib
from fclib import scenes

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")

from fclib import collections
from fclib.collections import (
    archives,
    catalog,
    published,
    ratings,
    references,
    set_index,
    trajectory,
)
from fclib.collections.build import BuildError
from fclib.collections.plan import Plan
from fclib.collections.set_index import DATA
from fclib.simulate import control_of
from helpers_cli import invoke, run
from workshop.sets import metadata

FAMILIES = collections.families()

# what they give is of one kind here
read: Any = fclib.read
read_solution: Any = fclib.read_solution


def stack(boxes: int = 3) -> scenes.Scene:
    """Boxes that land within a few steps."""
    return scenes.get("BoxesStack")(boxes=boxes, gap=2e-3, time_step=5e-3).scene(seed=1)


def plan(boxes: int = 3, **settings: Any) -> Plan:
    """What is built of a small stack."""
    settings = {"problems": 12} | settings
    return Plan(scene=stack(boxes), collection="small", **settings)


def files(folder: Path) -> dict[str, bytes]:
    """What a folder holds, but for pictures."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.suffix in (".hdf5", ".parquet", ".json", ".npz", ".trajectory")
    }


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("built")
    collections.build([plan()], folder, pictures=False)
    return folder


# ---- building


def test_catalog_says_what_the_files_hold(built: Path) -> None:
    rows = collections.read_catalog(built).to_pylist()
    assert [row["id"] for row in rows] == [f"small/BoxesStack/{i:04d}" for i in range(12)]
    assert [row["number"] for row in rows] == list(range(12))
    for row in rows:
        problem = read(built / row["global_file"])
        solution = read_solution(built / row["global_file"])
        merit = fclib.merit(problem, solution)
        assert fclib.digest(problem) == row["digest"]
        assert merit.error == row["error"] <= 1e-12
        assert row["has_solution"] is True
        assert (merit.open, merit.stick, merit.slide) == (row["open"], row["stick"], row["slide"])
        assert (problem.n, problem.nc, problem.p) == (row["n"], row["nc"], row["p"])
        assert (problem.M.nnz, problem.H.nnz) == (row["nnz_M"], row["nnz_H"])
        assert row["n"] == 6 * row["bodies"]
        assert row["density"] == 3 * row["nc"] / row["n"]
        assert problem.info.title == row["title"]
        assert (row["law"], row["scheme"]) == ("Coulomb", "Moreau-Jean, velocity")
        assert (row["h"], row["theta"], row["restitution"]) == (5e-3, 1.0, 0.0)
        assert row["engine"].startswith(f"fclib {fclib.__version__}, mujoco ")
        assert row["elastic"] is False

        local = read(built / row["local_file"])
        assert local.formulation == "3DFC"
        assert local.W.nnz == row["nnz_W"]
        assert fclib.merit(local, read_solution(built / row["local_file"])).error < 1e-7


@pytest.mark.parametrize(
    ("condition", "wanted"),
    [
        ("nc > 4", lambda row: row["nc"] > 4),
        ("4 < nc <= 8 and mu < 10", lambda row: 4 < row["nc"] <= 8),
        ("not (number == 3 or number > 6)", lambda row: row["number"] not in (3, *range(7, 12))),
        ("family == 'BoxesStack' and law != 'rolling'", lambda row: True),
        ("nsgs_sweeps > 0", lambda row: False),
        ("nsgs_sweeps is None and same_as is None", lambda row: row["same_as"] is None),
        ("has_solution and -1 < step", lambda row: True),
        ("dof == 6 * 0", None),
        ("nc", None),
        ("nc >", None),
        ("ncc > 3", None),
        ("nc > 'a'", None),
        ("__import__('os').system('true')", None),
        ("nc.real > 3", None),
        ("(" * 5000, None),
        ("nc > 1e400", lambda row: False),
        ("", None),
        ("\0", None),
    ],
)
def test_problems_are_found_by_a_condition(built: Path, condition: str, wanted: Any) -> None:
    """By the command and by Python; a wrong condition is named, and runs nothing."""
    table = collections.read_catalog(built)
    if wanted is None:
        with pytest.raises(catalog.ConditionError, match=re.escape(repr(condition)[:40])):
            catalog.where(table, condition)
        return
    ids = [row["id"] for row in table.to_pylist() if wanted(row)]
    assert catalog.where(table, condition)["id"].to_pylist() == ids
    words = ["collection", "find", condition, "--in", str(built)]
    done = invoke(*words, "--files")
    assert [Path(line).parts[-1][:4] for line in done.output.splitlines()] == [
        one[-4:] for one in ids
    ]
    assert all(Path(line).is_file() for line in done.output.splitlines())
    assert f"{len(ids)} of 12 problems" in invoke(*words).output


def test_info_carries_what_the_family_says(built: Path) -> None:
    info = read(built / "small/BoxesStack/0003-global.hdf5").info
    family = scenes.get("BoxesStack")
    for text in (family.description, family.application, family.authors, family.friction):
        assert text in info.description


def test_two_builds_are_equal_byte_for_byte(built: Path, tmp_path: Path) -> None:
    collections.build([plan()], tmp_path, pictures=False)
    assert files(tmp_path) == files(built)


@pytest.mark.slow
def test_processes_give_the_same_as_one(tmp_path: Path) -> None:
    plans = [plan(problems=4), plan(boxes=2, problems=4, form="local")]
    # two plans need two names
    other = scenes.Scene.of(scenes.get("BoxesStack")(boxes=2), 0, stack(2).xml)
    plans[1] = Plan(scene=other, collection="others", problems=4, form="local", count=2)
    seen: set[str] = set()
    for jobs in (1, 2):
        collections.build(
            plans,
            tmp_path / str(jobs),
            jobs=jobs,
            progress=lambda name, *_: seen.add(name),
            pictures=False,
        )
    assert files(tmp_path / "1") == files(tmp_path / "2")
    made = {"small/BoxesStack", "others/BoxesStack"}
    assert seen == made | {f"{name}, simulated" for name in made}
    rows = collections.read_catalog(tmp_path / "1").to_pylist()
    assert {row["id"] for row in rows if row["collection"] == "others"} == {
        "others/BoxesStack/0000",
        "others/BoxesStack/0003",
    }
    assert all(row["global_file"] is None for row in rows if row["collection"] == "others")


SLOW = """
import importlib
import sys
from pathlib import Path
module = importlib.import_module("fclib.collections.build")
from fclib.collections.plan import Plan
from fclib import scenes

module.CHECKPOINT = 0.0  # at each step
store = module.store

def slow(plan, kept, *rest):
    before = store(plan, kept, *rest)
    print(kept.looked, flush=True)
    return before

module.store = slow
scene = scenes.get("BoxesStack")(boxes=3, gap=2e-3, time_step=5e-3).scene(seed=1)
settings = {"count": 3, "select": "hard"} if sys.argv[2] == "hard" else {}
plan = Plan(scene=scene, collection="small", problems=12, **settings)
module.build([plan], Path(sys.argv[1]), pictures=False)
"""


@pytest.mark.slow
@pytest.mark.parametrize("select", ["every", "hard"])
def test_killed_builds_go_on_and_end_the_same(tmp_path: Path, select: str) -> None:
    def start(folder: Path) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", SLOW, str(folder), select]
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    whole, killed = tmp_path / "whole", tmp_path / "killed"
    chosen = plan(count=3, select="hard") if select == "hard" else plan()
    collections.build([chosen], whole, pictures=False)
    looked: list[int] = []
    for after in (4, 4):
        process = start(killed)
        assert process.stdout is not None
        for lines, line in enumerate(process.stdout, start=1):
            looked.append(int(line))
            if lines == after:
                process.send_signal(signal.SIGKILL)
                break
        process.wait(60)
        process.stdout.close()
    # each went on where the one before was, or a step behind
    assert looked[-1] >= 5
    assert start(killed).wait(120) == 0
    assert files(killed) == files(whole)


@pytest.mark.slow
def test_no_process_outlives_a_killed_build(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "fclib", "collection", "build", "Chain", "Capsules"]
    with subprocess.Popen(
        [*command, "--out", str(tmp_path / "out"), "--jobs", "2"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    ) as build:
        assert build.stdout is not None
        wait_for(lambda: len(list((tmp_path / "out").rglob("*-local.hdf5"))) > 2)
        assert len(group(build.pid)) > 3
        build.kill()
        build.stdout.close()
        build.wait(60)
        wait_for(lambda: not group(build.pid))


def wait_for(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + 120
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.1)


def group(leader: int) -> list[int]:
    """The processes that are alive in a process group."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            # pid (name) state parent group ...
            state, _, number = stat.read_text().rpartition(")")[2].split()[:3]
        except (OSError, ValueError):
            continue
        if int(number) == leader and state != "Z":
            found.append(int(stat.parent.name))
    return found


def test_finished_families_are_left_alone(built: Path) -> None:
    path = built / "small/BoxesStack/0000-global.hdf5"
    before = path.stat().st_mtime_ns
    collections.build([plan()], built, pictures=False)
    assert path.stat().st_mtime_ns == before


def test_another_plan_in_the_same_folder_is_refused(built: Path) -> None:
    with pytest.raises(BuildError, match=r"BoxesStack: .*parameters|count: None, now 3"):
        collections.build([plan(count=3)], built, pictures=False)


def test_count_keeps_problems_at_equal_distances(built: Path, tmp_path: Path) -> None:
    table = collections.build([plan(count=4)], tmp_path, pictures=False)
    assert table["number"].to_pylist() == [0, 4, 7, 11]
    # a file's guess is from the step before, and a copy is one of a problem, if that is kept too
    columns = [
        name for name in table.column_names if not name.endswith("_sha256") and name != "same_as"
    ]
    whole = collections.read_catalog(built).select(columns).take([0, 4, 7, 11])
    assert table.select(columns).to_pylist() == whole.to_pylist()


def test_hard_keeps_what_costs_nsgs_most(built: Path, tmp_path: Path) -> None:
    table = collections.build([plan(count=3, select="hard")], tmp_path, pictures=False)
    sweeps = {}
    for row in collections.read_catalog(built).to_pylist():
        local = read(built / row["local_file"])
        result = fclib.solve(local, "nsgs", tol=1e-6, max_iterations=2000)
        sweeps[row["number"]] = result.iterations
    hardest = sorted(sweeps, key=lambda number: (-sweeps[number], number))[:3]
    assert table["number"].to_pylist() == sorted(hardest)
    assert table["nsgs_sweeps"].to_pylist() == [sweeps[number] for number in sorted(hardest)]
    # and nothing else is left behind
    assert len(list(tmp_path.glob("small/BoxesStack/*.hdf5"))) == 6


def test_a_scene_that_touches_nothing_ends(tmp_path: Path) -> None:
    xml = '<mujoco><worldbody><body><freejoint/><geom size="1"/></body></worldbody></mujoco>'
    scene = scenes.Scene(name="alone", xml=xml)
    table = collections.build([Plan(scene=scene, collection="none", steps=9, problems=3)], tmp_path)
    assert table.num_rows == 0


@pytest.mark.parametrize(
    ("settings", "message"), [({"count": 0}, "count"), ({"problems": None}, "number of problems")]
)
def test_nonsense_plans(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        plan(**settings)


def test_names() -> None:
    assert collections.folders(["rt444", "Chain"]) == sorted(collections.sets()["rt444"])
    assert collections.folders(["Chain", "rt444/Chain"]) == ["rt444/Chain"]
    with pytest.raises(KeyError, match=r"'rt44'; did you mean rt444\? sets: .*rt444"):
        collections.folders(["rt44"])


def test_analysis_is_in_the_catalogue_where_it_was_asked_for(built: Path, tmp_path: Path) -> None:
    pytest.importorskip("clarabel")
    table = collections.build([plan(problems=2, analyze=True)], tmp_path, pictures=False)
    for row in table.to_pylist():
        assert row["rank_W"] == np.linalg.matrix_rank(
            read(tmp_path / row["local_file"]).W.toarray()
        )
        assert row["slater"]
        assert row["existence"] == "exists by Slater"
    assert set(catalog.ANALYSIS) <= set(table.column_names)


def test_files_say_what_is_cheaply_known(built: Path, tmp_path: Path) -> None:
    for row in collections.read_catalog(built).to_pylist()[::7]:
        whole, local = read(built / row["global_file"]), read(built / row["local_file"])
        rank = int(np.linalg.matrix_rank(local.W.toarray()))
        assert local.matrix_info["W"].rank == rank == row["rank_W"]
        assert local.matrix_info["W"].comment.startswith("sparsity ")
        assert whole.matrix_info["M"].rank == whole.n
        for problem in (whole, local):
            assert "Existence: exists by Slater" in problem.info.math_info
            assert "Left out: conic programs" in problem.info.math_info
            # of u and of r apart: four contacts under a box move nothing in more than one way
            assert "Velocity: u" in problem.info.math_info
            assert "Reactions: not unique: at the solution at hand" in problem.info.math_info
        assert row["existence"] == "exists by Slater"
        singular = np.linalg.svd(whole.H.toarray(), compute_uv=False)
        kept = singular[singular > 1e-12 * singular[0]]
        assert (whole.matrix_info["H"].rank, row["rank_H"]) == (len(kept), len(kept))
        assert row["conditioning_H"] == pytest.approx(kept[0] / kept[-1], rel=1e-2)
        # the digest is of the data
        assert fclib.digest(whole) == row["digest"]
    alone = collections.build([plan(problems=2, references=False)], tmp_path, pictures=False)
    for row in alone.to_pylist():
        assert not read(tmp_path / row["local_file"]).matrix_info
    assert not set(catalog.ANALYSIS) & set(alone.column_names)


def test_every_file_has_all_metadata(built: Path) -> None:
    """Read with h5py alone."""
    paths = [*built.rglob("*.hdf5"), *(DATA / "tiny").rglob("*.hdf5")]
    assert len(paths) > 30
    for path in paths:
        with h5py.File(path) as file:
            assert list(metadata.missing(file)) == [], path


def test_metadata_that_is_missing_is_named(built: Path, tmp_path: Path) -> None:
    path = tmp_path / "one.hdf5"
    shutil.copyfile(built / "small/BoxesStack/0005-global.hdf5", path)
    gone = ("fclib_global/H/conditioning", "fclib_global/info/title", "guesses", "bodies/velocity")
    with h5py.File(path, "r+") as file:
        for name in gone:
            del file[name]
        del file["solution"]
        assert list(metadata.missing(file)) == [
            "info/title",
            "H/conditioning",
            "solution, or why there is none",
            "guess, or why there is none",
            "bodies/velocity",
        ]


def test_guesses_do_not_depend_on_what_is_built(built: Path, tmp_path: Path) -> None:
    """Zero at the first contact; else what the same contacts had in the step before."""
    some = collections.build([plan(count=4)], tmp_path / "some", pictures=False).to_pylist()
    numbers = [row["number"] for row in some]
    assert numbers == [0, 4, 7, 11]
    for row in some:
        (own,) = fclib.read_guesses(tmp_path / "some" / row["global_file"])
        (same,) = fclib.read_guesses(built / row["global_file"])
        np.testing.assert_array_equal(own.r, same.r)
        assert own.r.any() == (row["number"] > 0)
    # states without those of the step before have it stored with them
    thinned = replace(plan(), chosen=tuple(numbers))
    rows = collections.build([thinned], tmp_path / "thinned", pictures=False).to_pylist()
    states = collections.read_trajectory(tmp_path / "thinned/small/BoxesStack/states.trajectory")
    assert len(states) == len(states.guess) == 4
    for row in rows:
        path = tmp_path / "thinned" / row["global_file"]
        (own,) = fclib.read_guesses(path)
        (same,) = fclib.read_guesses(built / row["global_file"])
        assert "guess" not in fclib.read_attributes(path, "info")
        # the simulation was solved to other digits, and reactions of a box are not unique
        normal = [guess.r[::3].sum() for guess in (own, same)]
        assert normal[0] == pytest.approx(normal[1], rel=1e-3)
    # and where nobody knows it, the file says so
    bare = tmp_path / "bare" / "small/BoxesStack-1.trajectory"
    trajectory.write(bare, replace(states, guess=()))
    unknown = replace(thinned, trajectory=bare)
    rows = collections.build([unknown], tmp_path / "unknown", pictures=False).to_pylist()
    last = tmp_path / "unknown" / rows[-1]["global_file"]
    assert fclib.read_guesses(last) == []
    assert "do not have the step before" in str(fclib.read_attributes(last, "info")["guess"])


def test_a_file_says_that_its_problem_has_no_solution(tmp_path: Path) -> None:
    collections.build([Plan.of_family("Squeezed").only([2, 3])], tmp_path, pictures=False)
    words = {
        path.name: read(path).info.math_info for path in tmp_path.glob("existence/Squeezed/*.hdf5")
    }
    assert len(words) == 4
    for name, text in words.items():
        proven = name.startswith("0002")
        assert ("Existence: proven not to exist" in text) == proven, text
        path = tmp_path / "existence/Squeezed" / name
        # nothing that is no solution stands where solutions do
        assert (read_solution(path) is None) == proven
        told = fclib.read_attributes(path, "info")
        assert ("there is none, by a checked proof" in str(told.get("solution"))) == proven
    row = collections.read_catalog(tmp_path).to_pylist()[0]
    assert (row["number"], row["existence"]) == (2, "proven not to exist")
    assert (row["status"], row["has_solution"]) == ("infeasible", False)
    assert {verdict.status for verdict in collections.verify(tmp_path)} == {"ok"}
    shown = invoke("check", *sorted((tmp_path / "existence/Squeezed").glob("*.hdf5")))
    assert shown.output.count("no solution") == 2


def unsolved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of two problems of which a solver of one sweep knows no solution."""
    monkeypatch.setattr(references, "FINISH", ())
    own = plan(problems=4, solver="nsgs", options={"max_iterations": 1}).only([2, 3])
    collections.build([own], tmp_path, pictures=False)
    return tmp_path


def test_what_is_no_solution_is_a_guess_with_its_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = unsolved(tmp_path, monkeypatch)
    for row in collections.read_catalog(folder).to_pylist():
        assert row["has_solution"] is False
        assert row["error"] > 1e-8
        for form in ("global", "local"):
            path = folder / row[f"{form}_file"]
            problem, guesses = read(path), fclib.read_guesses(path)
            assert read_solution(path) is None
            told = fclib.read_attributes(path, f"guesses/{len(guesses)}")
            error = fclib.merit(problem, guesses[-1]).error
            assert told["error"] == pytest.approx(error, rel=1e-6)
            assert error > 1e-8
            assert (told["merit"], told["solver"]) == ("both", "nsgs")
            assert "none is known: guess" in str(fclib.read_attributes(path, "info")["solution"])
            assert "Existence" in problem.info.math_info
    assert {verdict.status for verdict in collections.verify(folder)} == {"ok"}
    paths = sorted(folder.glob("small/*/*.hdf5"))
    invoke("check", *paths)
    # a file that says nothing of why it has none is an error
    fclib.write(paths[0], read(paths[0]))
    invoke("check", paths[0], code=1)


def test_a_solution_that_somebody_sent_in_is_taken(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = {
        row["digest"]: read_solution(built / row["global_file"])
        for row in collections.read_catalog(built).to_pylist()[:3]
    }
    said = {"by": "somebody", "date": "2026-01-02"}
    stored = {digest: (solution, said) for digest, solution in known.items()}
    monkeypatch.setattr(ratings, "stored_solution", stored.get)
    folder = unsolved(tmp_path, monkeypatch)
    second, third = collections.read_catalog(folder).to_pylist()
    assert (second["solver"], second["has_solution"]) == ("somebody", True)
    assert third["has_solution"] is False
    path = folder / second["global_file"]
    told = fclib.read_attributes(path, "solution")
    assert (told["solver"], told["date"]) == ("somebody", "2026-01-02")
    assert np.array_equal(read_solution(path).r, known[second["digest"]].r)


def test_a_solution_says_how_good_it_is_and_whose(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = collections.read_catalog(built).to_pylist()[7]
    for form in ("global", "local"):
        path = built / row[f"{form}_file"]
        told = fclib.read_attributes(path, "solution")
        merit = fclib.merit(read(path), read_solution(path))
        assert told["error"] == merit.error
        assert (told["natural"], told["scaled_natural"]) == (merit.natural, merit.scaled_natural)
        assert (told["merit"], told["solver"]) == ("both", row["solver"])
        assert told["ends"] == "1e-12 is reached"
        assert datetime.date.fromisoformat(str(told["date"]))
    # files that do not tell the day
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    collections.build([plan(problems=1)], tmp_path, pictures=False)
    path = next(tmp_path.rglob("0000-global.hdf5"))
    assert fclib.read_attributes(path, "solution")["date"] == "1970-01-02"


def test_a_local_form_has_its_own_digits() -> None:
    whole = read(DATA / "tiny/FourBar/0150-global.hdf5")
    local = whole.condense()
    found = references.find(whole, "auto", 1e-8)
    rounded = fclib.Solution(r=(1 + 1e-10) * found.solution.r, l=found.solution.l)
    assert 1e-12 < fclib.merit(local, rounded).error <= 1e-8
    mine = references.carried(dataclasses.replace(found, solution=rounded), local)
    assert mine.error == fclib.merit(local, mine.solution).error <= 1e-12
    assert mine.ends == "1e-12 is reached"


def test_a_certified_reference_names_both_algorithms(tmp_path: Path) -> None:
    pytest.importorskip("clarabel")
    own = dataclasses.replace(plan(problems=6), certify=True).only([5])
    (row,) = collections.build([own], tmp_path, pictures=False).to_pylist()
    for form in ("global", "local"):
        path = tmp_path / row[f"{form}_file"]
        told = fclib.read_attributes(path, "solution")
        assert told["certified"] == "yes"
        first, second = str(told["algorithms"]).split("; ")
        assert first.partition(" ")[0] != second.partition(" ")[0]
        assert told["error"] == fclib.merit(read(path), read_solution(path)).error <= 1e-12
        assert told["ends"] == "1e-12 is reached"
    assert ("merit_error" in told) == (form == "global")
    with pytest.raises(BuildError, match="certify"):
        collections.build([plan(problems=6).only([5])], tmp_path, pictures=False)
    with pytest.raises(ValueError, match="nothing to certify"):
        plan(references=False, certify=True)


def test_a_reference_that_the_natural_map_alone_takes_is_solved_by_both(tmp_path: Path) -> None:
    """Light bodies: reactions of no size, so that the natural map sees only velocities."""
    whole = read(DATA / "tiny/KaplasTower/0030-global.hdf5")
    factor = 1e-7
    light = whole.replace(M=factor * whole.M, f=factor * whole.f)
    loose = fclib.solve(light, tol=1e-8, merit="natural").solution
    assert fclib.merit(light, loose).error_by("natural") <= 1e-8
    found = references.find(light, "auto", 1e-8)
    assert found.ok
    assert found.error == fclib.merit(light, found.solution).error <= 1e-12


def test_what_is_cheaply_known_is_what_the_analysis_finds(built: Path) -> None:
    pytest.importorskip("clarabel")
    from fclib import analysis

    row = collections.read_catalog(built).to_pylist()[-1]
    whole = read(built / row["global_file"])
    for problem in (whole, read(built / row["local_file"]), whole.replace(mu=0 * whole.mu)):
        local = problem.condense() if problem.n else problem
        found = analysis.brief(problem, local)
        known = analysis.analyze(problem).record
        for name, value in found.record.items():
            if isinstance(value, (bool, str)):
                assert value == known[name], name
            elif value is not None:
                assert value == pytest.approx(known[name], rel=1e-2), name


def test_all_known_solutions_are_stored(tmp_path: Path) -> None:
    own = collections.plan_of("existence/ManySolutions").only([0, 5, 8, 20, 35])
    table = collections.build([own], tmp_path, pictures=False)
    counts = set()
    words = {row["number"]: read(tmp_path / row["global_file"]).info for row in table.to_pylist()}
    for part in ("Velocity", "Reactions"):
        assert f"{part}: not unique: enumeration of contact states" in words[5].math_info
        assert f"{part}: unique: " in words[0].math_info
    for row in table.to_pylist():
        for form in ("global", "local"):
            path = tmp_path / row[f"{form}_file"]
            problem, solutions = read(path), fclib.read_solutions(path)
            counts.add(len(solutions))
            for k, one in enumerate(solutions):
                assert fclib.merit(problem, one).error < 1e-12
                assert all(np.abs(one.r - other.r).max() > 1e-6 for other in solutions[:k])
            # and nothing touching is not the one that stands for them
            assert not solutions or read_solution(path).r.any()
    assert counts >= {0, 3}
    assert {verdict.status for verdict in collections.verify(tmp_path)} == {"ok"}
    # one of several that is none is found too
    path = tmp_path / "existence/ManySolutions/0005-local.hdf5"
    several = fclib.read_solutions(path)
    wrong = several[1].replace(r=1.5 * several[1].r + 1.0, u=None)
    fclib.write_solutions(path, [several[0], wrong])
    rows = table.to_pylist()
    rows[1]["local_sha256"] = catalog.sha256(path)
    catalog.write_catalog(tmp_path / catalog.FILE, rows)
    (bad,) = (verdict for verdict in collections.verify(tmp_path) if not verdict.ok)
    assert bad.status == "wrong"
    assert "/solutions/2" in bad.message


def test_problems_of_few_contacts_say_what_all_their_states_say(tmp_path: Path) -> None:
    own = [
        collections.plan_of("impacts/RockingBlock").only([100]),
        Plan.of_family("LocalProblems").only([104]),
    ]
    table = collections.build(own, tmp_path, pictures=False)
    for row in table.to_pylist():
        words = read(tmp_path / row["local_file"]).info.math_info
        assert "Velocity: unique" in words
        assert "Reactions: unique" in words
        assert "states of the contacts" not in words.partition("Left out:")[2]
        assert (row["uniqueness"], row["reactions_unique"]) == ("unique", True)


# ---- verifying


def test_verify(built: Path, tmp_path: Path) -> None:
    collections.build([plan()], tmp_path, pictures=False)
    verdicts = list(collections.verify(tmp_path))
    assert len(verdicts) == 24
    assert all(verdict.ok for verdict in verdicts)

    folder = tmp_path / "small/BoxesStack"
    (folder / "0001-local.hdf5").unlink()
    with (folder / "0002-global.hdf5").open("r+b") as file:
        file.seek(100)
        file.write(b"?")
    wrong = {
        verdict.path: verdict.status for verdict in collections.verify(tmp_path) if not verdict.ok
    }
    assert wrong == {
        "small/BoxesStack/0001-local.hdf5": "missing",
        "small/BoxesStack/0002-global.hdf5": "changed",
    }


@pytest.mark.parametrize("fault", ["solution", "problem", "nonsense"])
def test_verify_judges_what_the_hash_does_not_tell(built: Path, tmp_path: Path, fault: str) -> None:
    """A catalogue whose hashes fit, over files that are wrong all the same."""
    row = dict(collections.read_catalog(built).to_pylist()[5])
    source = built / row["global_file"]
    problem, solution = read(source), read_solution(source)
    target = tmp_path / row["global_file"]
    target.parent.mkdir(parents=True)
    if fault == "solution":
        fclib.write(target, problem, solution.replace(r=1.01 * solution.r, u=None))
    elif fault == "problem":
        fclib.write(target, problem.replace(mu=1.5 * np.asarray(problem.mu)), solution)
    else:
        target.write_bytes(b"no file of ours")
    row |= {"local_file": None, "local_sha256": None, "global_sha256": catalog.sha256(target)}
    catalog.write_catalog(tmp_path / catalog.FILE, [row])
    (verdict,) = collections.verify(tmp_path)
    expected = {"solution": "wrong", "problem": "wrong digest", "nonsense": "unreadable"}
    assert verdict.status == expected[fault]


@pytest.mark.parametrize("mass", [1.0, 1e-9])
def test_verify_fails_exactly_if_check_does(built: Path, tmp_path: Path, mass: float) -> None:
    """From a solution that is one to one that is none, by ever larger changes of its reactions.

    Where bodies are light, the natural map alone takes them all.
    """
    row = dict(collections.read_catalog(built).to_pylist()[5])
    problem, solution = read(built / row["global_file"]), read_solution(built / row["global_file"])
    problem = problem.replace(M=mass * problem.M, f=mass * problem.f)
    row |= {"local_file": None, "local_sha256": None, "digest": fclib.digest(problem)}
    seen = set()
    for power in range(-14, 0):
        target = tmp_path / f"small/BoxesStack/{-power:04d}-global.hdf5"
        target.parent.mkdir(parents=True, exist_ok=True)
        changed = fclib.Solution(r=mass * (1 + 10.0**power) * solution.r)
        fclib.write(target, problem, changed)
        path = target.relative_to(tmp_path).as_posix()
        own = {"global_file": path, "global_sha256": catalog.sha256(target)}
        catalog.write_catalog(tmp_path / catalog.FILE, [row | own])
        (verdict,) = (one for one in collections.verify(tmp_path) if one.path == path)
        ok = invoke("check", target, code=None).exit_code == 0
        assert verdict.ok == ok == (fclib.merit(problem, read_solution(target)).error <= 1e-8)
        seen.add(ok)
    assert seen == {True, False}


def test_a_file_without_a_solution_says_why_or_is_refused(tmp_path: Path) -> None:
    """By `verify` as by `check`, whatever the catalogue says."""
    table = collections.build([plan(problems=2, references=False)], tmp_path, pictures=False)
    rows = table.to_pylist()
    paths = [tmp_path / path for row in rows for path, _ in catalog.files_of(row)]
    for path in paths:
        assert fclib.read_attributes(path, "info")["solution"] == "none was looked for"
        invoke("check", path)
    assert all(verdict.ok for verdict in collections.verify(tmp_path))
    fclib.write(paths[0], read(paths[0]))  # and no longer says why
    rows[0]["global_sha256"] = catalog.sha256(paths[0])
    catalog.write_catalog(tmp_path / catalog.FILE, rows)
    invoke("check", paths[0], code=1)
    wrong = [verdict for verdict in collections.verify(tmp_path) if not verdict.ok]
    assert [(one.path, one.status) for one in wrong] == [(rows[0]["global_file"], "no solution")]
    assert "does not say why" in wrong[0].message


def test_r_0_is_not_the_reference_of_what_has_other_solutions(tmp_path: Path) -> None:
    """Klarbring's mass on springs with much friction, five of them side by side."""
    block = np.linalg.inv([[2.0, -1.0], [-1.0, 1.0]])
    many = fclib.LocalProblem(
        spacedim=2, W=np.kron(np.eye(5), block), q=[1.0, 3.5] * 5, mu=[2.0] * 5
    )
    found = references.find(many, "auto", 1e-8)
    assert not found.solution.r.any()
    others = references.others(many, found)
    assert others
    for one in others:
        assert fclib.merit(many, one).error <= 1e-8
        assert one.r.any()
    best = references.best_first(found, many, [found.solution, *others], "nsn-ac")
    assert best.ok
    assert best.solution.r.any()
    assert best.solver == "nsn-ac"
    # with little friction there is only one, and what is solved otherwise has no need of others
    slippery = many.replace(mu=0.1 * many.mu)
    assert references.others(slippery, references.find(slippery, "auto", 1e-8)) == []
    assert references.others(many, best) == []
    path = tmp_path / "many.hdf5"
    references.write(path, many, best, (), [found.solution, *others])
    assert len(fclib.read_solutions(path)) == 1 + len(others)
    assert read_solution(path).r.any()


def test_a_cut_build_leaves_a_catalogue_of_what_is_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = scenes.Scene.of(scenes.get("BoxesStack")(boxes=2), 0, stack(2).xml)
    plans = [Plan(scene=other, collection="first", problems=3), plan()]
    module = importlib.import_module("fclib.collections.build")
    store = module.store

    def cut(own: Plan, kept: Any, *rest: Any) -> Any:
        before = store(own, kept, *rest)
        if (own.collection, kept.looked) == ("small", 5):
            raise KeyboardInterrupt
        return before

    monkeypatch.setattr(module, "store", cut)
    with pytest.raises(KeyboardInterrupt):
        collections.build(plans, tmp_path, pictures=False)
    monkeypatch.undo()
    rows = collections.read_catalog(tmp_path).to_pylist()
    names = {"first": [0, 1, 2], "small": [0, 1, 2, 3, 4, 5]}
    found = [row["id"] for row in rows]
    assert found == [f"{own}/BoxesStack/{k:04d}" for own, ks in names.items() for k in ks]
    # what came after the last checkpoint is named, and what is not whole
    stray = tmp_path / "first/BoxesStack/0009-local.hdf5"
    stray.write_bytes((tmp_path / rows[0]["local_file"]).read_bytes())
    said = {one.path: one.status for one in collections.verify(tmp_path) if not one.ok}
    assert said == {
        "small/BoxesStack": "unfinished",
        "first/BoxesStack/0009-local.hdf5": "not listed",
    }
    told = invoke("collection", "verify", tmp_path, code=1)
    site = tmp_path / "site"
    published = invoke("collection", "publish", tmp_path, "--out", site, code=1)
    for shown in (told, published):
        assert "0009-local.hdf5: is not in the catalogue" in " ".join(shown.stderr.split())
        assert "small/BoxesStack: its build was cut" in " ".join(shown.stderr.split())
    assert sorted(path.name for path in site.glob("*.zip")) == ["first-BoxesStack.zip"]
    assert len(collections.read_catalog(site)) == 3
    # the same command ends it
    stray.unlink()
    collections.build(plans, tmp_path, pictures=False)
    assert all(one.ok for one in collections.verify(tmp_path))
    assert len(collections.read_catalog(tmp_path)) == 15


def test_equal_problems_are_told(tmp_path: Path) -> None:
    twins = [plan(problems=2), dataclasses.replace(plan(problems=2), collection="twin")]
    table = collections.build(twins, tmp_path, pictures=False)
    rows = {row["id"]: row["same_as"] for row in table.to_pylist()}
    assert rows == {
        "small/BoxesStack/0000": None,
        "small/BoxesStack/0001": None,
        "twin/BoxesStack/0000": "small/BoxesStack/0000",
        "twin/BoxesStack/0001": "small/BoxesStack/0001",
    }
    assert catalog.distinct(table.to_pylist()) == 2


def test_no_doi_before_there_is_one(built: Path) -> None:
    path = built / collections.read_catalog(built).to_pylist()[0]["global_file"]
    origin = json.loads(read(path).info.description.splitlines()[-1])
    assert origin["license"] == "CC-BY-4.0"
    assert "doi" not in origin


def test_no_catalogue_is_named(tmp_path: Path) -> None:
    with pytest.raises(collections.CatalogError, match="there is no catalogue"):
        list(collections.verify(tmp_path))
    (tmp_path / catalog.FILE).write_bytes(b"PAR1 nonsense")
    with pytest.raises(collections.CatalogError, match="cannot be read as a catalogue"):
        collections.read_catalog(tmp_path)


# ---- archives


class Server(http.server.SimpleHTTPRequestHandler):
    """Serves a folder, knows ranges, and may break off in the middle of a file."""

    break_at: int | None = None  # bytes of an archive after which the connection is closed
    ranges = True
    requests: list[tuple[str, str | None]]

    def do_GET(self) -> None:
        asked = self.headers.get("Range")
        type(self).requests.append((self.path, asked))
        path = Path(self.translate_path(self.path))
        if not path.is_file():
            self.send_error(404)
            return
        content = path.read_bytes()
        total = len(content)
        first = int(asked.removeprefix("bytes=").rstrip("-")) if asked and self.ranges else 0
        if first >= total > 0:
            self.send_error(416)
            return
        self.send_response(206 if first else 200)
        self.send_header("Content-Length", str(total - first))
        self.end_headers()
        content = content[first:]
        if type(self).break_at is not None and path.suffix == ".zip":
            content, type(self).break_at = content[: type(self).break_at], None
        with contextlib.suppress(OSError):
            self.wfile.write(content)

    def log_message(self, *args: object) -> None:
        pass


@contextlib.contextmanager
def serving(folder: Path) -> Iterator[tuple[str, type[Server]]]:
    """A server of a folder, and its handler."""

    class Handler(Server):
        requests: list[tuple[str, str | None]] = []  # noqa: RUF012

    handler = functools.partial(Handler, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}", Handler
        server.shutdown()


@pytest.fixture
def site(built: Path, tmp_path: Path) -> Iterator[tuple[str, Path, type[Server]]]:
    folder = tmp_path / "site"
    collections.publish(built, folder)
    with serving(folder) as (url, handler):
        yield url, folder, handler


def test_published_twice_is_equal(built: Path, tmp_path: Path) -> None:
    for name in ("one", "two"):
        collections.publish(built, tmp_path / name)
    first, second = (
        {path.name: path.read_bytes() for path in (tmp_path / name).iterdir()}
        for name in ("one", "two")
    )
    assert first
    assert first == second


def test_what_was_changed_is_not_published(tmp_path: Path) -> None:
    collections.build([plan(problems=2)], tmp_path / "built", pictures=False)
    (tmp_path / "built/small/BoxesStack/0000-global.hdf5").write_bytes(b"")
    with pytest.raises(archives.FetchError, match=r"0000-global\.hdf5: is not the catalogue"):
        collections.publish(tmp_path / "built", tmp_path / "site")


def test_get_fetches_what_was_published(
    site: tuple[str, Path, type[Server]], built: Path, tmp_path: Path
) -> None:
    url, _, _ = site
    assert collections.get(["BoxesStack"], url, tmp_path / "copy") == ["small/BoxesStack"]
    copied = {k: v for k, v in files(tmp_path / "copy").items() if not k.startswith(".archives")}
    assert copied == files(built)


def test_get_knows_published_scenes(tmp_path: Path) -> None:
    scene = dataclasses.replace(stack(), name="two-legs")
    scenes_plan = Plan(scene=scene, collection="scenes", problems=1)
    collections.build([scenes_plan], tmp_path / "built", pictures=False)
    collections.publish(tmp_path / "built", tmp_path / "site")
    with serving(tmp_path / "site") as (url, _):
        assert collections.get(["two-legs"], url, tmp_path / "copy") == ["scenes/two-legs"]
    assert all(verdict.ok for verdict in collections.verify(tmp_path / "copy"))


@pytest.mark.parametrize("ranges", [True, False])
def test_get_goes_on_where_it_broke_off(
    site: tuple[str, Path, type[Server]], built: Path, tmp_path: Path, ranges: bool
) -> None:
    url, _, server = site
    server.break_at, server.ranges = 50_000, ranges
    collections.get(["BoxesStack"], url, tmp_path / "copy")
    asked = [rest for path, rest in server.requests if path.endswith(".zip")]
    # in blocks of 8 kB; asked again from the start where the server knows no ranges
    assert asked == [None, f"bytes={50_000 // 8192 * 8192}-"]
    assert all(verdict.ok for verdict in collections.verify(tmp_path / "copy"))


def test_get_refuses_what_the_registry_does_not_say(
    site: tuple[str, Path, type[Server]], tmp_path: Path
) -> None:
    url, folder, _ = site
    with (folder / "small-BoxesStack.zip").open("r+b") as file:
        file.seek(200)
        file.write(b"tampered")
    with pytest.raises(archives.FetchError, match="not what the registry says"):
        collections.get(["BoxesStack"], url, tmp_path / "copy")
    assert not list((tmp_path / "copy").glob("*/*/*.hdf5"))


def test_a_version_of_a_family_needs_no_set() -> None:
    assert set_index.folders(["Arch"], "1") == ["masonry/Arch"]


def test_get_of_what_is_not_there(site: tuple[str, Path, type[Server]], tmp_path: Path) -> None:
    url, _, _ = site
    with pytest.raises(KeyError, match="Chain is not published"):
        collections.get(["Chain"], url, tmp_path / "copy")
    with pytest.raises(archives.FetchError, match="404"):
        collections.get(["Chain"], url + "/elsewhere", tmp_path / "copy")
    with pytest.raises(archives.FetchError, match="cannot be fetched"):
        collections.get(["Chain"], "http://127.0.0.1:9", tmp_path / "new")
    (tmp_path / "mine").mkdir()
    with pytest.raises(archives.FetchError):
        collections.get(["Chain"], "http://127.0.0.1:9", tmp_path / "mine")
    assert not list((tmp_path / "mine").iterdir())
    assert not (tmp_path / "new").exists()


# ---- in Python


def test_collection_is_a_lazy_sequence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FCLIB_COLLECTION", str(tmp_path))
    monkeypatch.setattr(Plan, "of_family", lambda name, seed, **_: plan(boxes=2, problems=3))
    family = scenes.get("BoxesStack")
    monkeypatch.setattr(family, "collection", "small")
    problems = fclib.collection("BoxesStack")
    assert not list(tmp_path.iterdir())
    assert len(problems) == 3
    assert problems.ids[1] == "small/BoxesStack/0001"
    assert [problem.nc for problem in problems] == problems.catalog["nc"].to_pylist()
    assert fclib.digest(problems[-1]) == fclib.digest(problems["small/BoxesStack/0002"])
    assert len(problems[1:]) == 2
    solution: Any = problems.solution(0)
    assert fclib.merit(problems[0], solution).error <= 1e-8
    assert fclib.load("small/BoxesStack/0001", form="local").formulation == "3DFC"
    with pytest.raises(KeyError, match="no problem 'small/BoxesStack/0009'"):
        fclib.load("small/BoxesStack/0009")
    with pytest.raises(KeyError, match="SET/FAMILY/NUMBER"):
        fclib.load("BoxesStack")
    with pytest.raises(KeyError, match=r"fclib\.read reads a file"):
        fclib.load(tmp_path / "a.hdf5")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="form"):
        fclib.load("small/BoxesStack/0001", form="dual")


# ---- the families


# test_granular_flow.py has GranularFlow: a solution of its 10,000 contacts takes hours
@pytest.mark.parametrize("name", [name for name in FAMILIES if name != "GranularFlow"])
def test_family_is_built_from_its_default_scene(name: str, tmp_path: Path) -> None:
    plan = Plan.of_family(name, problems=2)
    # a small scene where the default one takes long
    small = getattr(collections.plan.families()[name], "small", None)
    plan = dataclasses.replace(plan, scene=collections.plan.source(name, small))
    table = collections.build([plan], tmp_path, pictures=False)
    assert table["number"].to_pylist() == [0, 1]
    # one that is proved to have no solution is told so
    expected = ["infeasible" if name == "Squeezed" else "converged", "converged"]
    assert table["status"].to_pylist() == expected
    assert all(verdict.ok for verdict in collections.verify(tmp_path))


# ---- the command line

ROBOT = """
<mujoco model="legs"><compiler angle="radian"/><option timestep="0.004"/>
<worldbody><geom type="plane" size="0 0 1"/>
<body pos="0 0 0.51"><freejoint/><geom type="box" size="0.1 0.1 0.05" mass="2"/>
  <body pos="0 0.1 0"><joint axis="0 1 0" limited="true" range="-0.3 0.3" damping="50"/>
    <geom type="capsule" size="0.03" fromto="0 0 0 0.02 0 -0.48" mass="0.5"/></body>
  <body pos="0 -0.1 0"><joint axis="0 1 0" limited="true" range="-0.3 0.3" frictionloss="{loss}"/>
    <geom type="capsule" size="0.03" fromto="0 0 0 -0.02 0 -0.48" mass="0.5"/></body>
</body></worldbody></mujoco>
"""


def test_a_set_counts_its_families_without_states_too() -> None:
    def lines(*arguments: str) -> list[Any]:
        return [json.loads(line) for line in invoke("collection", *arguments).output.splitlines()]

    listed = {row["set"]: row["problems"] for row in lines("list", "--sets", "--json")}
    for folder, problems in (("rr9118/ChuteLocalProblems", 834), ("standard/BoxesStack", 4)):
        name = folder.partition("/")[0]
        shown = {row["folder"]: row["problems"] for row in lines("show", name, "--json")}
        assert shown[folder] == problems
        assert listed[name] == sum(shown.values())


def test_copies_are_counted_once() -> None:
    """A gripper that holds still is one problem, however many steps it does so."""
    states = published.digests("robots/Gripper", set_index.version_of("robots/Gripper"))
    if not states:
        pytest.skip("its states are not stored here")
    rows = [json.loads(one) for one in invoke("collection", "list", "--json").output.splitlines()]
    lines = invoke("collection", "list", "--sets", "--json").output.splitlines()
    told = [*map(json.loads, lines)]
    own, sets = {row["family"]: row for row in rows}, {row["set"]: row for row in told}
    assert own["Gripper"]["problems"] == len(states)
    assert own["Gripper"]["distinct"] == len(set(states.values())) < len(states)
    assert own["LowWall"]["distinct"] is None
    assert sets["robots"]["distinct"] < sets["robots"]["problems"]
    assert sets["rt444"]["distinct"] == sets["rt444"]["problems"]
    assert sets["standard"]["distinct"] == sets["standard"]["problems"]


def test_simulate_makes_problems_of_any_scene(tmp_path: Path) -> None:
    path = tmp_path / "legs.xml"
    path.write_text(ROBOT.format(loss=0), encoding="utf-8")
    invoke("simulate", path, "--steps", 40, "--out", tmp_path / "out", "--no-pictures")
    rows = collections.read_catalog(tmp_path / "out").to_pylist()
    assert rows
    assert {row["family"] for row in rows} == {"legs"}
    problem = read(tmp_path / "out" / rows[-1]["global_file"])
    M = problem.M.toarray()
    assert np.abs(M - np.diag(np.diag(M))).max() > 1e-3  # one tree of bodies
    invoke("collection", "verify", tmp_path / "out")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("<mujoco><nonsense/></mujoco>", "MuJoCo refuses the MJCF"),
        (b"\xff\xfe\x00", "is no text"),
        ('<mujoco><option gravity="0 0 nan"/></mujoco>', "gravity at the start is not finite"),
    ],
)
def test_simulate_refuses_in_a_line(tmp_path: Path, content: str | bytes, message: str) -> None:
    path = tmp_path / "bad.xml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    done = invoke("simulate", path, "--out", tmp_path / "out", code=1)
    assert message in done.output
    assert not (tmp_path / "out").exists()


def test_simulate_writes_a_sequence(tmp_path: Path) -> None:
    scene, path = tmp_path / "legs.xml", tmp_path / "run.h5"
    scene.write_text(ROBOT.format(loss=0), encoding="utf-8")
    words = ["simulate", scene, "--steps", 40, "--no-pictures"]
    invoke(*words, "--out", tmp_path / "out", "--form", "global")
    done = invoke(*words, "--out", path)
    assert f"The sequence:  {path}" in done.output
    files = sorted(tmp_path.glob("out/scenes/*/*.hdf5"))
    steps: Any = fclib.Sequence(path)
    assert len(steps) == len(files) > 10
    for k, file in enumerate(files):
        assert fclib.digest(steps[k]) == fclib.digest(fclib.read(file))
        assert steps[k].info.description == fclib.read(file).info.description
        assert steps[k].bodies is not None
        known = fclib.read_solution(file)
        assert known is not None
        assert (steps.solution(k).r == known.r).all()
        told = fclib.read_attributes(f"{path}#{k}", "solution")
        assert told == fclib.read_attributes(file, "solution")
    assert sorted(one.name for one in tmp_path.iterdir()) == ["legs.xml", "out", "run.h5"]
    invoke("check", path)
    before = path.read_bytes()
    done = invoke(*words, "--out", path, code=1)
    assert "is there already; name another file" in done.output
    assert path.read_bytes() == before


def test_simulate_leaves_out_what_no_problem_holds_and_says_so(tmp_path: Path) -> None:
    path = tmp_path / "legs.xml"
    soft = ROBOT.format(loss=1).replace('mass="2"', 'mass="2" solref="0.05 1"')
    path.write_text(soft, encoding="utf-8")
    common = ("simulate", path, "--steps", 10, "--out", tmp_path / "out", "--no-pictures")
    refused = invoke(*common, "--strict", code=1)
    assert "not supported: solref and solimp" in refused.output
    assert not (tmp_path / "out").exists()
    done = invoke(*common)
    assert "Left out: solref and solimp" in done.output
    row = collections.read_catalog(tmp_path / "out").to_pylist()[0]
    assert row["left_out"] == "solref and solimp (contacts, limits and equalities are rigid)"
    described = read(tmp_path / "out" / row["global_file"]).info.description
    assert "Left out: solref and solimp" in described


def test_simulate_with_controls_and_a_keyframe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A row for each step, or a function; what is stored has the controls in its states."""
    path = tmp_path / "legs.xml"
    rest = (
        '<actuator><motor joint="knee"/></actuator><keyframe><key name="up"'
        ' qpos="0 0 0.55 1 0 0 0 0 0"/></keyframe></mujoco>'
    )
    text = ROBOT.format(loss=1).replace("<joint", '<joint name="knee"', 1)
    path.write_text(text.replace("</mujoco>", rest), encoding="utf-8")
    rows = tmp_path / "rows.csv"
    rows.write_text("0.5\n1.5\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "walking.py").write_text("def policy(t, state):\n    return [1.5 - (t == 0)]\n")
    common = ("simulate", path, "--steps", 6, "--keyframe", "up", "--no-pictures")
    digests = []
    for option, value in (("--ctrl", rows), ("--policy", "walking:policy")):
        out = tmp_path / option
        done = invoke(*common, option, value, "--out", out)
        assert "From the keyframe 'up'" in done.output
        invoke("collection", "verify", out)
        digests.append([row["digest"] for row in collections.read_catalog(out).to_pylist()])
        states = collections.read_trajectory(next(out.rglob("*.trajectory")))
        np.testing.assert_array_equal(states.position[:, -1], [0.5] + 5 * [1.5])
    assert digests[0] == digests[1]
    for wrong, message in (
        (("--keyframe", "down"), "no keyframe 'down'; it has: up"),
        (("--policy", "walking:none"), "no function 'none'"),
        (("--policy", "nothing:policy"), "cannot be imported"),
        (("--ctrl", path), "no MODULE:FUNCTION"),
        (("--ctrl", tmp_path / "none.csv"), "none.csv"),
    ):
        failed = invoke("simulate", path, "--out", tmp_path / "wrong", *wrong, code=1)
        assert message in " ".join(failed.output.split())
        assert not (tmp_path / "wrong").exists()


def test_simulate_goes_on_where_a_wrong_option_was_put_right(tmp_path: Path) -> None:
    path, out = tmp_path / "legs.xml", tmp_path / "out"
    path.write_text(ROBOT.format(loss=1), encoding="utf-8")
    (tmp_path / "rows.csv").write_text("1,2\n", encoding="utf-8")
    command = ("simulate", path, "--steps", 3, "--no-pictures", "--out", out)
    for wrong, message in (
        (("--ctrl", tmp_path / "rows.csv"), "it has no actuators"),
        (("--time-step", "1e300"), "the time step must be positive, and 1e+09 s at most"),
    ):
        failed = invoke(*command, *wrong, code=1)
        assert message in " ".join(failed.output.split())
    invoke(*command)


@pytest.mark.filterwarnings("error")
def test_an_empty_table_of_controls_is_one_line(tmp_path: Path) -> None:
    for content in ("", "\n\n", "# time\n"):
        (tmp_path / "rows.csv").write_text(content)
        with pytest.raises(ValueError, match=r"rows\.csv: is no table of controls"):
            control_of(str(tmp_path / "rows.csv"))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("breaks", "'broken:breaks': in step 0 RuntimeError: out of order, broken.py, line 3"),
        ("takes_one", "'broken:takes_one': in step 0 TypeError: takes_one() takes 1 positional"),
        ("none", "legs: has 1 controls, and those given have the shape ()"),
        ("huge", "legs: controls must be finite, and those given are [inf]"),
    ],
)
def test_a_policy_that_fails_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, words: str
) -> None:
    path = tmp_path / "legs.xml"
    text = ROBOT.format(loss=1).replace("<joint", '<joint name="knee"', 1)
    motor = '<actuator><motor joint="knee"/></actuator></mujoco>'
    path.write_text(text.replace("</mujoco>", motor), encoding="utf-8")
    (tmp_path / "broken.py").write_text(
        "import math\ndef breaks(t, state):\n    raise RuntimeError('out of\\norder')\n"
        "def takes_one(t):\n    return [0.0]\n"
        "def none(t, state):\n    pass\n"
        "def huge(t, state):\n    return [math.inf]\n"
    )
    monkeypatch.chdir(tmp_path)
    sys.modules.pop("broken", None)
    failed = invoke(
        "simulate", path, "--policy", f"broken:{name}", "--out", tmp_path / "out", code=1
    )
    assert words in " ".join(failed.output.split())


def test_simulate_finds_the_packages_of_a_urdf(tmp_path: Path) -> None:
    folder = tmp_path / "share" / "arm" / "meshes"
    folder.mkdir(parents=True)
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = [(1, 2, 4), (1, 4, 3), (5, 7, 8), (5, 8, 6), (1, 5, 6), (1, 6, 2), (3, 4, 8), (3, 8, 7)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
    (folder / "link.obj").write_text("\n".join(lines), encoding="utf-8")
    mesh = '<geometry><mesh filename="package://arm/meshes/link.obj"/></geometry>'
    inertia = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"'
    path = tmp_path / "arm.urdf"
    path.write_text(
        f'<robot name="arm"><link name="base"/><link name="link">{inertia}/></inertial>'
        f'<collision>{mesh}</collision></link><joint name="j" type="revolute"><parent link="base"/>'
        '<child link="link"/><axis xyz="0 1 0"/><limit lower="0" upper="1" effort="1"'
        ' velocity="1"/></joint></robot>',
        encoding="utf-8",
    )
    common = ("simulate", path, "--steps", 3, "--out", tmp_path / "out", "--no-pictures")
    refused = invoke(*common, code=1)
    assert "--package arm=DIR" in " ".join(refused.output.split())
    invoke(*common, "--package", f"arm={tmp_path / 'share' / 'arm'}")
    # a package is also found above the file, after three slashes too
    own = tmp_path / "share" / "arm" / "urdf" / "arm.urdf"
    own.parent.mkdir()
    text = path.read_text(encoding="utf-8").replace("package://", "package:///")
    own.write_text(text.replace("</robot>", "<xacro:left/></robot>"), encoding="utf-8")
    invoke("simulate", own, *common[2:4], "--out", tmp_path / "own", "--no-pictures")
    # a prefix that the file does not name keeps no root from floating
    floating = scenes.Scene.from_file(own, floating=True)
    assert 'type="floating"' in floating.xml


def test_archive_has_the_model_with_its_includes(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "ball.xml").write_text(
        '<mujoco><worldbody><body pos="0 0 0.099"><freejoint/><geom size="0.1"/></body>'
        "</worldbody></mujoco>"
    )
    (tmp_path / "wedge.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    model = tmp_path / "model.xml"
    text = (
        '<mujoco><include file="parts/ball.xml"/>{}<worldbody><geom type="plane" size="1 1 1"/>'
        "</worldbody></mujoco>"
    )
    model.write_text(text.format('<asset><mesh name="wedge" file="wedge.obj"/></asset>'))
    scene = scenes.Scene.from_file(model)
    assert scene.parameters["files"] == {
        name: catalog.sha256(tmp_path / name) for name in ("parts/ball.xml", "wedge.obj")
    }
    # with no mesh to fetch the states alone make the problems again
    model.write_text(text.format(""))
    invoke("simulate", model, "--steps", 3, "--no-pictures", "--out", tmp_path / "out")
    (tmp_path / "parts" / "ball.xml").unlink()
    states = collections.read_trajectory(tmp_path / "out/scenes/model/states.trajectory")
    assert states.scene.path is None
    row = collections.read_catalog(tmp_path / "out").to_pylist()[0]
    assert fclib.digest(states.problem(0).problem) == row["digest"]
    assert "parts/ball.xml" in read(tmp_path / "out" / row["global_file"]).info.description


def test_list_and_show() -> None:
    listed = invoke("collection", "list")
    for name in FAMILIES:
        assert name in listed.output
        shown = invoke("collection", "show", name)
        # some that are assembled directly have a time step of their own
        own = {field.name for field in dataclasses.fields(collections.plan.families()[name])}
        expected = name in scenes.families() or "time_step" in own
        assert ("time_step" in shown.output) == expected
    invoke("collection", "show", "Boxes", code=2)


def test_build_verify_and_publish_by_commands(tmp_path: Path) -> None:
    out = tmp_path / "out"
    form = ("--form", "local", "--tol", "1e-12")
    done = invoke("collection", "build", "Chain", "--count", 2, "--out", out, *form)
    assert "Chain" in done.output
    rows = collections.read_catalog(out).to_pylist()
    assert all(row["tol"] == 1e-12 and row["error"] <= 1e-12 for row in rows)
    invoke("collection", "build", "Chain", "--out", out, "--tol", "1e-7", code=2)
    assert len(list(out.glob("rt444/Chain/*.hdf5"))) == 2
    assert (out / "rt444/Chain/distribution.svg").is_file()
    invoke("collection", "verify", out)
    invoke("collection", "publish", out, "--out", tmp_path / "site")
    assert (tmp_path / "site/registry.txt").is_file()
    victim = next(out.glob("rt444/Chain/*.hdf5"))
    victim.write_bytes(b"")
    spoilt = invoke("collection", "verify", out, code=1)
    assert "changed" in spoilt.output


@pytest.mark.parametrize("arguments", [(), ("--all",), ("Chian",)])
def test_build_needs_names(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    invoke("collection", "build", *arguments, "--out", tmp_path, code=2)


def test_unwritable_folder_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    words = ("collection", "build", "Chain", "--count", 1, "--out", tmp_path / "file" / "below")
    done = run(*words, code=1)
    *said, error = done.stderr.splitlines()
    assert "below" in error
    assert all("is stored of" in line for line in said)


def test_a_collection_is_filtered_by_its_catalogue() -> None:
    problems = fclib.collection("tiny")
    rows = problems.catalog.to_pylist()
    small = problems.filter(nc=(5, 20), family=["Wall", "FourBar", "RollingDiscs"])
    expected = [
        row["id"]
        for row in rows
        if 5 <= row["nc"] <= 20 and row["family"] in ("Wall", "FourBar", "RollingDiscs")
    ]
    assert small.ids == expected
    assert 0 < len(small) < len(problems)
    assert [one.nc for one in small] == [row["nc"] for row in small.catalog.to_pylist()]
    assert fclib.digest(small[0]) == fclib.digest(problems[small.ids[0]])
    sliding = small.filter(lambda row: row["slide"] > 0, mu_max=lambda mu: mu < 1)
    assert set(sliding.ids) <= set(small.ids)
    assert "nc=(5, 20)" in repr(small)
    assert len(problems.filter(nc=(None, 0))) == 0
    with pytest.raises(KeyError, match="no column 'size'"):
        problems.filter(size=3)
    with pytest.raises(ValueError, match="bounds are two"):
        problems.filter(nc=(1, 2, 3))
    with pytest.raises(IndexError):
        small[len(small)]


def test_a_catalogue_is_a_data_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    problems = fclib.collection("tiny")
    pytest.importorskip("pandas")
    assert list(problems.to_pandas()["id"]) == problems.ids
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(ImportError, match="pip install polars"):
        problems.to_polars()
