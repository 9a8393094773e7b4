"""The set `standard`: how it is chosen, and how its problems stand."""

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import _solve, _stored, scenes
from fclib.analysis import analyze, check, read_certificate

pytest.importorskip("pyarrow")

from fclib import collections
from fclib.collections import published, ratings, set_index, trajectory
from helpers_cli import invoke
from workshop.sets import choose, features

load: Any = fclib.load
there = pytest.mark.skipif(
    published.root() is None, reason="the package of trajectories is not here"
)


# ---- features


def test_features_are_what_their_names_say() -> None:
    source = set_index.plan_of("tiny/FourBar").scene
    problem = load("tiny/FourBar/0150")
    found = features.structure(features.Matrix(problem), source)
    assert (found["nc"], found["n"], found["p"]) == (problem.nc, problem.n, problem.p)
    assert found["density"] == pytest.approx(3 * problem.nc / problem.n)
    assert found["rolling"] == found["planar"] == found["elastic"] == 0
    record = analyze(problem).record
    assert found["rank_ratio"] == pytest.approx(3 * problem.nc / record["rank_W"])
    assert found["conditioning"] == pytest.approx(record["conditioning_W"], rel=1e-6)
    # its joints join what contacts do not: islands of the contacts alone are no fewer
    assert (found["islands"] or 0) >= record["islands"]
    rolling = load("tiny/RollingDiscs/0040")
    found = features.structure(
        features.Matrix(rolling), set_index.plan_of("tiny/RollingDiscs").scene
    )
    assert (found["rolling"], found["planar"], found["spacedim"]) == (1, 1, 3)


@there
def test_standard_has_the_states_of_its_list() -> None:
    for folder in collections.sets()["standard"]:
        own = {
            c.number: c.digest
            for c in set_index.choices("standard")
            if f"standard/{c.family}" == folder
        }
        stored = published.versions(folder)
        if stored:
            assert published.digests(folder, stored[-1]) == own
        else:
            assert folder.partition("/")[2] in scenes.assemblies()


# ---- how problems stand


def run(problem: str, solver: str, error: float | None, **more: Any) -> dict[str, Any]:
    digest = {f"{c.family}/{c.number:04d}": c.digest for c in set_index.choices("tiny")}[problem]
    status = "converged" if error is not None and error <= 1e-8 else "time_limit"
    values: dict[str, Any] = {"version": "1", "time_limit": 1.0, "status": status, "cpu_s": 0.5}
    values |= {"tol": 1e-8, "merit": "both", "start": "cold", "hash": digest, "started": SECOND}
    return values | {"error": error, "solver": solver} | more


LISTS = ("standard", "hard", "open")
SECOND, DAY = 1_767_312_000.0, 86_400.0  # [s] 2026-01-02


@pytest.fixture
def runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of published runs, empty, and a package of trajectories without solutions."""
    stored = published.root()
    if stored is None:
        pytest.skip("the package of trajectories is not here")
    package = tmp_path / "package"
    package.mkdir()
    (package / published.FOLDER).symlink_to(stored)
    monkeypatch.setattr(published, "IN_PLACE", package)
    monkeypatch.setattr(_stored, "published_runs", lambda: tmp_path / "runs")
    (tmp_path / "runs").mkdir()
    return tmp_path / "runs"


def publish(folder: Path, rows: list[dict[str, Any]]) -> None:
    """Add a part with these runs."""
    import pyarrow
    import pyarrow.parquet

    name = f"some-{len(list(folder.iterdir()))}.parquet"
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist(rows), folder / name)


def classes_by_problem(name: str = "tiny") -> dict[str, str]:
    return {row.id.partition("/")[2]: row.rating for row in ratings.ratings_of(name)[0]}


def test_classes_follow_from_runs(runs: Path) -> None:
    wall, kaplas, discs = "Wall/0003", "KaplasTower/0030", "RollingDiscs/0040"
    squeezed = "Capsules/0300"
    rows = [run(wall, name, 1e-9 if name in "abc" else None) for name in "abcd"]
    rows += [run(kaplas, name, 1e-9 if name in "ab" else 1e-3) for name in "abce"]
    rows += [run(discs, "a", 2e-8), run(discs, "b", 1e-4), run(discs, "c", None)]
    # a proof that there is no solution is as good as one
    rows += [run(squeezed, name, None, status="infeasible") for name in "ab"]
    # who does not take it has no vote
    rows += [run(kaplas, "d", None, status="unsuitable")]
    # of two versions the newer one
    rows += [run(kaplas, "c", 1e-9, started=SECOND - DAY, version="0")]
    publish(runs, rows)
    found = classes_by_problem()
    assert (found[wall], found[kaplas], found[discs]) == ("easy", "hard", "open")
    assert found[squeezed] == "easy"
    assert found["FourBar/0150"] == ""
    (row,) = [row for row in ratings.ratings_of("tiny")[0] if row.rating == "open"]
    assert row.best is not None
    assert (row.best.solver, row.best.error, row.solved, row.voters) == ("a", 2e-8, 0, 3)
    basis = ratings.ratings_of("tiny")[1]
    assert basis is not None
    assert (basis.limits, basis.solvers) == ((1.0,), tuple("abcde"))
    # a longer run has no vote, and what it solves is no longer open
    publish(runs, [run(discs, "auto", 9e-9, time_limit=60.0)])
    assert classes_by_problem()[discs] == "hard"
    # a build asks for one problem, by its digest
    ratings._by_digest.cache_clear()
    for known in ratings.ratings_of("tiny")[0]:
        assert (ratings.class_of("tiny", known.digest) or "") == known.rating
        assert ratings.class_of("no set", known.digest) is None
    ratings._by_digest.cache_clear()


def test_runs_vote_at_the_limit_of_most_runs(runs: Path) -> None:
    """So a problem has one class, whatever set it is in."""
    wall, kaplas, discs = "Wall/0003", "KaplasTower/0030", "RollingDiscs/0040"
    rows = [run(wall, name, 1e-9) for name in "abcd"]
    rows += [run(kaplas, name, 1e-9 if name == "a" else None, time_limit=10.0) for name in "abc"]
    # of both limits the one at which there are more runs of all problems
    rows += [run(discs, name, 1e-9, time_limit=10.0) for name in "abc"]
    rows += [run(discs, "a", None)]
    # a solution that was taken in has no vote, where nothing was run
    bars = load("tiny/FourBar/0150")
    finder = {"by": "me", "error": 1e-9, "date": "2026-01-02"}
    solution = fclib.Solution(r=np.zeros(bars.spacedim * bars.nc), l=np.zeros(bars.p))
    ratings.store_solution(bars, fclib.digest(bars), solution, finder)
    publish(runs, rows)
    found = {row.id.partition("/")[2]: row for row in ratings.ratings_of("tiny")[0]}
    assert {name: row.limit for name, row in found.items() if row.rating} == {
        wall: 1.0,
        kaplas: 10.0,
        discs: 10.0,
    }
    assert (found[kaplas].rating, found[kaplas].solved, found[kaplas].voters) == ("hard", 1, 3)
    assert (found[discs].rating, found[discs].solved) == ("easy", 3)
    basis = ratings.ratings_of("tiny")[1]
    assert basis is not None
    assert "within 1 or 10 s of CPU a run, by 4 solvers (a, b, c, d;" in str(basis)


def test_a_problem_has_one_class_in_all_sets() -> None:
    found: dict[str, dict[str, str]] = {}
    for name in ("standard", "hard", "open", "rr9118", "rt444", "machines", "fclib2024"):
        for row in ratings.ratings_of(name)[0]:
            found.setdefault(row.digest, {})[row.id] = row.rating
    assert not [own for own in found.values() if len(set(own.values())) > 1]


def test_of_copies_the_median_counts(runs: Path) -> None:
    """As in a profile; the least error of all is known."""
    rows = [run("Wall/0003", "a", 1e-9, cpu_s=cpu) for cpu in (0.9, 0.1)]
    rows += [run("Wall/0003", "b", error) for error in (2e-3, 3e-9, None)]
    # in whatever parts they are
    publish(runs, rows[::2])
    publish(runs, rows[1::2])
    first, second = sorted(ratings.runs(), key=lambda run: run.solver)
    assert (first.solver, first.cpu, first.solved) == ("a", 0.1, True)
    assert (second.solver, second.error, second.solved) == ("b", 3e-9, False)
    assert classes_by_problem()["Wall/0003"] == "hard"


def test_only_cold_runs_to_the_tolerance_by_both_merits_count(runs: Path) -> None:
    others = ({"tol": 1e-4}, {"merit": "natural"}, {"start": "warm"})
    publish(runs, [run("Wall/0003", "a", 1e-9, **other) for other in others])
    assert ratings.runs() == ()


def test_a_damaged_part_is_named(runs: Path) -> None:
    (runs / "some.parquet").write_bytes(b"PAR1")
    done = invoke("collection", "status", "tiny", code=1)
    assert "some.parquet: cannot be read as published runs" in " ".join(done.output.split())
    (runs / "some.parquet").unlink()
    path = ratings.folder() / "solutions" / "0123456789abcdef.json"
    path.parent.mkdir(parents=True)
    for text in ("", "[]", "{}"):
        path.write_text(text)
        done = invoke("collection", "status", "tiny", code=1)
        assert "0123456789abcdef.json: is no solution and no proof" in " ".join(done.output.split())
    path.unlink()
    # an error that is no number is none
    finder = json.dumps({"by": "me", "error": np.nan, "date": "2026-01-02"})
    np.savez(path.with_suffix(".npz"), origin=finder, r=np.zeros(3))
    done = invoke("collection", "status", "tiny", code=1)
    assert "its error is nan" in " ".join(done.output.split())


def test_a_better_solution_is_verified_and_taken(runs: Path, tmp_path: Path) -> None:
    name = "tiny/RollingDiscs/0040"
    family = name.partition("/")[2]
    publish(runs, [run(family, solver, 1e-3) for solver in "ab"])
    problem = load(name)
    rough, fine = (fclib.solve(problem, tol=tol).solution for tol in (1e-5, 1e-10))
    path = tmp_path / "found.hdf5"

    def offer(problem: Any, solution: Any, *more: str, code: int = 0) -> Any:
        fclib.write(path, problem, solution)
        return invoke("collection", "take", path, "--by", "me", *more, code=code)

    # what the file says is not believed
    done = offer(problem, rough.replace(r=0 * rough.r), code=1)
    assert "0.001 is known by" in done.output
    # in its local form too
    local = problem.condense()
    offer(local, fclib.Solution(r=rough.r))
    (row,) = [row for row in ratings.ratings_of("tiny")[0] if row.id == name]
    assert row.rating == "open" or row.best is not None
    assert row.best is not None
    assert (row.best.solver, row.best.status) == ("me", ratings.TAKEN)
    own, solution, said = ratings.known_solution(name)
    assert fclib.digest(own) == row.digest
    assert fclib.merit(own, solution).error == pytest.approx(said["error"], rel=1e-3)
    # the best iterate of an open problem is no solution
    shown = tmp_path / "shown.hdf5"
    invoke("collection", "status", name, "--out", shown)
    assert fclib.contents(shown) == [own.kind, "guesses"]
    told = fclib.read_attributes(shown, "guesses/1")
    assert (told["solver"], told["date"]) == ("me", said["date"])
    assert told["error"] == pytest.approx(said["error"], rel=1e-3)
    # not better
    offer(problem, rough, code=1)
    # another problem, unless it is named
    other = problem.replace(f=problem.f * (1 + 1e-12))
    done = offer(other, fine, code=1)
    assert "name it" in done.output
    offer(other, fine, "--problem", name)
    assert classes_by_problem()[family] == "hard"
    done = offer(problem, fine, code=1)
    assert "is hard, and solutions are taken of open problems" in done.output
    offer(problem, None, code=1)


def test_a_proof_that_there_is_no_solution_is_taken(runs: Path, tmp_path: Path) -> None:
    """It is checked on the collection's own problem, and the problem is no longer open."""
    name = "existence/Squeezed/0000"
    rows = [run("Wall/0003", solver, 1e-3) for solver in "ab"]
    closing = scenes.assemblies()["Squeezed"]().problem(0)
    publish(runs, [row | {"hash": fclib.digest(closing)} for row in rows])
    path, proof = tmp_path / "squeezed.hdf5", tmp_path / "proof.json"
    fclib.write(path, closing)
    proof.write_text(invoke("analyze", path, "--json").stdout)
    other = ("--problem", "existence/Squeezed/0001")
    done = invoke("collection", "take", proof, "--by", "me", *other, code=1)
    assert "was not run" in done.output
    nothing = tmp_path / "nothing.json"
    for text in ('{"y": [1], "z": []}', "[" * 100_000):
        nothing.write_text(text)
        done = invoke("collection", "take", nothing, "--by", "me", "--problem", name, code=1)
        assert "nothing.json" in done.output or "proves nothing" in done.output
    nothing.write_text('{"y": [1], "z": []}')
    assert "name the problem" in invoke("collection", "take", nothing, "--by", "me", code=1).output
    done = invoke("collection", "take", proof, "--by", "me", "--problem", name)
    (row,) = [row for row in ratings.ratings_of("existence")[0] if row.id == name]
    assert (row.rating, row.solved, row.voters) == ("hard", 0, 2)
    assert row.best is not None
    assert (row.best.solver, row.best.status, row.best.error) == ("me", "infeasible", None)
    assert "hard" in invoke("collection", "status", name).output


def test_a_proof_up_to_a_norm_is_not_taken(
    runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """W is rounded: it proves something of reactions that are not huge."""
    W = np.eye(6)
    W[0, 3] = W[3, 0] = -1.0 - 2.0**-52
    W[0, 1] = W[1, 0] = 1e-15
    q = np.array([-1.0, 0, 0, -1.0, 0, 0])
    problem = fclib.LocalProblem(spacedim=3, W=W, q=q, mu=np.ones(2))
    assert not check(problem, {0: 1, 1: 1}).exact
    row = ratings.RatedProblem("a/B/0000", "0" * 64, "open", 0, 2, 1.0, None, None)
    monkeypatch.setattr(ratings, "_open_one", lambda name: row)
    monkeypatch.setattr(ratings, "problem_of", lambda name: problem)
    proof = tmp_path / "proof.json"
    proof.write_text('{"y": [1, 1], "z": []}')
    with pytest.raises(ratings.RatingError, match="exact proofs are taken"):
        ratings.accept_proof(proof, "me", "a/B/0000")


@there
def test_stored_proofs_prove() -> None:
    listed = {c.digest[: ratings.DIGITS]: c for own in LISTS for c in set_index.choices(own)}
    paths = sorted((ratings.folder() / "solutions").glob("*.json"))
    assert paths
    for path in paths:
        y, z, digest = read_certificate(path)
        assert digest is not None
        assert digest.startswith(path.stem)
        chosen = listed[path.stem]
        own: Any = scenes.assemblies()[chosen.scene or chosen.family](**chosen.parameters)
        assert check(own.problem(chosen.number), y, z).exact


def test_status_tells_classes_and_what_they_rest_on(runs: Path, tmp_path: Path) -> None:
    assert "no published run is of its" in invoke("collection", "status", "tiny", code=1).output
    store = tmp_path / "runs.sqlite"
    solvers = ("--solver", "nsgs", "--solver", "auto")
    files = set_index.DATA / "tiny"
    done = invoke(
        *("bench", "--problems", files / "Wall/0003-global.hdf5"),
        *("--problems", files / "RollingDiscs/0040-global.hdf5", *solvers),
        *("--tol", 1e-8, "--time-limit", 5, "--store", store),
        code=None,
    )
    assert done.exit_code in (0, 1), done.output
    done = invoke("results", "pack", store, "--name", "tiny", "--in", runs)
    done = invoke("collection", "status", "tiny")
    assert "to 1e-08 within 5 s of CPU a run, by 2 solvers (auto, nsgs" in done.output
    rows = [
        json.loads(line)
        for line in invoke("collection", "status", "tiny", "--json").output.splitlines()
    ]
    found = {row["problem"]: row["class"] for row in rows}
    assert found["tiny/Wall/0003"] == "easy"
    assert found["tiny/FourBar/0150"] == "not run"
    done = invoke("collection", "status", "tiny/Wall/9999", code=1)
    assert "there is no such problem" in done.output
    invoke("collection", "status", "nothing", code=2)
    invoke("collection", "status", "tiny", "--out", tmp_path / "x.hdf5", code=2)


@there
def test_families_without_states_have_members_too() -> None:
    """Those that are assembled, as those whose states are stored."""
    members = ratings.members("existence")
    assert len(members) == 36 + 56 + 30
    family: Any = scenes.assemblies()["Jammed"]
    one = scenes.Assembled(family=family(), seed=0).problem(7)
    assert members["existence/Jammed/0007"] == fclib.digest(one)
    assert len(ratings.members("rr9118")) == len(set_index.choices("rr9118")) + 834


@there
def test_stored_solutions_have_the_errors_that_are_said() -> None:
    digests = {
        digest[: ratings.DIGITS]: name
        for own in LISTS
        for name, digest in ratings.members(own).items()
    }
    stored = sorted((ratings.folder() / "solutions").glob("*.npz"))
    known_ones = [path for path in stored if path.stem in digests]
    assert known_ones == stored
    for path in stored[:: max(1, len(stored) // 4)]:
        own, solution, said = ratings.known_solution(digests[path.stem])
        # on another machine the problem differs by rounding
        assert fclib.merit(own, solution).error == pytest.approx(said["error"], rel=0.1)


# ---- what depends on what


@there
def test_no_problem_depends_on_auto(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a solver `auto` that returns nonsense all digests are those that are published."""
    pytest.importorskip("mujoco")

    def nonsense(problem: Any, *args: Any, **options: Any) -> Any:
        return solve(problem, "nsgs", 1.0, max_iterations=1, guess=None)

    solve = _solve.solve
    monkeypatch.setattr(_solve, "solve", nonsense)
    plans = [collections.plan_of(f"tiny/{name}") for name in ("FourBar", "PlanarBlocks")]
    table = collections.build(plans, tmp_path, pictures=False)
    assert {set_index.origin_of(row) for row in table.to_pylist()} == {"published"}
    assert set(table["solver"].to_pylist()) == {"nsgs"}


def test_part_of_a_trajectory_is_some_of_its_problems(tmp_path: Path) -> None:
    path = published.path_of("rt444/KaplasTower", set_index.version_of("rt444/KaplasTower"))
    if path is None:
        pytest.skip("its states are not stored here")
    states = trajectory.read(path)
    target = tmp_path / "part.trajectory"
    trajectory.write(target, trajectory.part(states, [150, 7], "some", "3"))
    part = trajectory.read(target)
    assert part.number.tolist() == [7, 150]
    assert (part.origin["collection"], part.origin["version"]) == ("some", "3")
    assert fclib.digest(part.problem(1).problem) == states.digest[states.index(150)]
    assert target.stat().st_size < path.stat().st_size


def test_chosen_states_are_stored_once(tmp_path: Path) -> None:
    path = published.path_of("rt444/KaplasTower", set_index.version_of("rt444/KaplasTower"))
    if path is None:
        pytest.skip("its states are not stored here")
    base = tmp_path / "trajectories"
    source = "rt444/KaplasTower-1.trajectory"
    (base / source).parent.mkdir(parents=True)
    shutil.copy(path, base / source)
    states = trajectory.read(path)
    part = trajectory.part(states, [150, 7], "some", "3")
    part = replace(part, guess=(None, np.ones(3)))
    target = base / "some" / "KaplasTower-3.trajectory"
    trajectory.write(target, part, source=source)
    assert target.stat().st_size < 2000
    again = trajectory.read(target)
    assert again.origin == part.origin
    assert again.digest == part.digest
    assert again.guess[0] is None
    assert np.array_equal(np.asarray(again.guess[1]), np.ones(3))
    for name in ("number", "step", "position", "velocity", "sketch"):
        np.testing.assert_array_equal(getattr(again, name), getattr(part, name))
    assert fclib.digest(again.problem(1).problem) == part.digest[1]
    assert trajectory.read_digests(target) == dict(zip([7, 150], part.digest, strict=True))
    assert trajectory.read_origin(target) == (again.scene, part.origin)

    # the file of the states has other problems of these numbers, names this one, or is not there
    (base / source).unlink()
    trajectory.write(base / source, replace(states, digest=states.digest[::-1]))
    with pytest.raises(trajectory.TrajectoryError, match="has other problems of these numbers"):
        trajectory.read(target)
    (base / source).unlink()
    trajectory.write(base / source, part, source="some/KaplasTower-3.trajectory")
    with pytest.raises(trajectory.TrajectoryError, match="damaged"):
        trajectory.read(target)
    (base / source).unlink()
    with pytest.raises(trajectory.TrajectoryError, match=f"{source}, which is not there"):
        trajectory.read(target)


# ---- lists of earlier versions


@pytest.fixture
def grown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A set in two versions: the older one has other problems of a family, and one that stays.

    The present files of the families do not take the parameters of its scenes.
    """
    towers = published.path_of("rt444/KaplasTower", "1")
    packing = published.path_of("robots/Gripper", "1")
    if towers is None or packing is None:
        pytest.skip("the package of trajectories is not here")
    package, data = tmp_path / "package", tmp_path / "data"
    (data / set_index.OLDER).mkdir(parents=True)
    numbers: dict[tuple[str, str], list[int]] = {
        ("KaplasTower", "1"): [7, 150],
        ("KaplasTower", "2"): [9, 150],
        ("Gripper", "1"): [0, 3],
    }
    lists: dict[str, list[set_index.Choice]] = {"1": [], "2": []}
    for (family, version), own in numbers.items():
        states = trajectory.read(towers if family == "KaplasTower" else packing)
        part = trajectory.part(states, own, "hard", version)
        scene = replace(part.scene, parameters={**part.scene.parameters, "of_old": 1.0})
        path = package / published.FOLDER / "hard" / f"{family}-{version}{trajectory.SUFFIX}"
        path.parent.mkdir(parents=True, exist_ok=True)
        trajectory.write(path, replace(part, scene=scene))
        for version_ in ("1", "2") if family == "Gripper" else (version,):
            lists[version_] += [
                set_index.Choice(family, scene.parameters, scene.seed or 0, n, n, digest)
                for n, digest in zip(own, part.digest, strict=True)
            ]
    choose.write_list(data / set_index.OLDER / "hard-1.json", lists["1"], {})
    choose.write_list(data / "hard.json", lists["2"], {})
    monkeypatch.setattr(published, "IN_PLACE", package)
    monkeypatch.setattr(set_index, "DATA", data)
    monkeypatch.setitem(set_index.SETS, "hard", ("2", "what few solvers solve"))
    set_index.choices.cache_clear()
    yield
    set_index.choices.cache_clear()


def test_a_version_of_a_set_has_families_that_did_not_change(grown: None) -> None:
    """The present one has all families, each by its newest states; an older one has its own."""
    assert set_index.folders(["hard"], "2") == set_index.folders(["hard"])
    assert sorted(set_index.folders(["hard"])) == ["hard/Gripper", "hard/KaplasTower"]
    for version, towers in (("1", [7, 150]), ("2", [9, 150])):
        found = {
            (folder.partition("/")[2], int(number)): digest
            for folder in set_index.folders(["hard"], version)
            for plan in [set_index.plan_of(folder, version=version)]
            for number, digest in published.digests(folder, plan.version).items()
            if number in plan.numbers()
        }
        assert found == {(c.family, c.number): c.digest for c in set_index.listed("hard", version)}
        assert set_index.plan_of("hard/KaplasTower", version=version).numbers().tolist() == towers
    assert set_index.plan_of("hard/Gripper", version="2").version == "1"
    with pytest.raises(collections.VersionError, match="version 99 is not stored here"):
        set_index.plan_of("hard/KaplasTower", version="99")


def test_problems_of_an_older_list_are_named_with_their_version(
    grown: None, tmp_path: Path
) -> None:
    pytest.importorskip("mujoco")
    with pytest.raises(collections.VersionError, match=r"version 1 had: .* hard --version 1"):
        load("hard/KaplasTower/0007", folder=tmp_path)
    plan = collections.plan_of("hard/KaplasTower", version="1", references=False)
    collections.build([plan], tmp_path, pictures=False)
    rows = collections.read_catalog(tmp_path).to_pylist()
    assert [row["number"] for row in rows] == [7, 150]
    assert {set_index.origin_of(row) for row in rows} == {"published"}


def test_a_list_is_built_from_scenes_that_its_families_no_longer_make(
    grown: None, tmp_path: Path
) -> None:
    pytest.importorskip("mujoco")
    plan = collections.plan_of("hard/KaplasTower", references=False)
    assert plan.scene.parameters["of_old"] == 1.0
    collections.build([plan], tmp_path, pictures=False)
    rows = collections.read_catalog(tmp_path).to_pylist()
    assert [(row["number"], set_index.origin_of(row)) for row in rows] == [
        (9, "published"),
        (150, "published"),
    ]
