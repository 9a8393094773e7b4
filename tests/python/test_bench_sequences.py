"""Campaigns along sequences: each step from a solution of one before it, and from nothing."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import bench
from fclib.bench import cluster, pool, profiles
from fclib.bench.job import Guess, Job, Record
from fclib.collections.references import guess_of
from fclib.report.runs import Campaigns
from helpers import planted_local
from helpers_cli import tables

NC = 5
STEPS = 6
LIMIT = 60.0  # [s], which the limit of iterations comes before on any machine
HOPELESS = 3  # the step that has no solution, in `broken`
SAME = ("key", "start", "sequence", "step", "guess", "status", "iterations", "error", "solver")


def step_of(k: int, hopeless: bool = False) -> fclib.LocalProblem:
    """A step of a sequence in which the contacts change their places from step to step."""
    whole = planted_local(3, nc=NC).problem
    assert isinstance(whole, fclib.LocalProblem)
    order = np.random.default_rng(k).permutation(NC)
    rows = (3 * order[:, None] + np.arange(3)).ravel()
    W = np.asarray(whole.W.todense() if hasattr(whole.W, "todense") else whole.W)
    q = whole.q + 0.02 * np.sin(k + np.arange(3 * NC))
    if hopeless:
        W, q = np.zeros_like(W), np.tile([-1.0, 0.0, 0.0], NC)
    contacts = fclib.Contacts(
        body=np.column_stack((np.zeros(NC), order + 1)).astype(np.int32),
        shape=np.zeros((NC, 2), np.int32),
        feature=np.zeros(NC, np.int32),
        point=np.zeros((NC, 3)),
        normal=np.tile([0.0, 0.0, 1.0], (NC, 1)),
        tangent=np.tile([1.0, 0.0, 0.0], (NC, 1)),
        gap=np.zeros(NC),
    )
    return fclib.LocalProblem(
        spacedim=3, W=W[np.ix_(rows, rows)], q=q[rows], mu=whole.mu[order], contacts=contacts
    )


def files(folder: Path, hopeless: int | None = None) -> Path:
    folder.mkdir()
    for k in range(STEPS):
        fclib.write(folder / f"{k:04d}.hdf5", step_of(k, k == hopeless))
    return folder


@pytest.fixture(scope="module")
def smooth(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return files(tmp_path_factory.mktemp("sequences") / "smooth")


@pytest.fixture(scope="module")
def broken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return files(tmp_path_factory.mktemp("sequences") / "broken", HOPELESS)


def entries(folder: Path, **changes: Any) -> dict[str, Any]:
    group = {"files": str(folder), "sequence": changes.pop("sequence", {})}
    known = {
        "name": "along",
        "solvers": ["nsgs", {"name": "nsgs", "options": {"relaxation": 1.2}}],
        "tolerances": [1e-6],
        "time_limit": LIMIT,
        "problems": [group],
    }
    return known | changes


def campaign(folder: Path, **changes: Any) -> bench.Campaign:
    return bench.Campaign.of(entries(folder, **changes))


def rows_of(path: Path) -> list[dict[str, Any]]:
    with bench.Store(path, create=False) as store:
        return store.results()


def outcome(path: Path) -> list[tuple[Any, ...]]:
    """What must be the same however often a campaign was interrupted."""
    return sorted(tuple(str(row[name]) for name in SAME) for row in rows_of(path))


def chain(rows: list[dict[str, Any]], solver: str = "nsgs") -> list[dict[str, Any]]:
    own = [row for row in rows if row["start"] == "warm" and row["solver"] == solver]
    return sorted(own, key=lambda row: int(row["step"]))


@pytest.fixture(scope="module")
def quiet(smooth: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("stores") / "quiet.sqlite"
    done = bench.run_campaign(campaign(smooth), path, jobs=2)
    assert (done.planned, done.solved) == (4 * STEPS, 4 * STEPS)
    return path


@pytest.fixture(scope="module")
def with_a_failure(broken: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("stores") / "failure.sqlite"
    bench.run_campaign(campaign(broken), path)
    return path


# ---- what is run


def by_hand(folder: Path) -> Iterator[tuple[int | None, fclib.Result]]:
    """Each step from the last that was solved: the number of that, and the result."""
    known: tuple[int, Any, Any] | None = None
    for k in range(STEPS):
        problem = fclib.read(folder / f"{k:04d}.hdf5")
        guess = guess_of(known[1], known[2], problem) if known else None
        result = fclib.solve(problem, "nsgs", 1e-6, guess=guess, time_limit=LIMIT)
        yield (known[0] if known else None), result
        if result.status == "converged":
            known = k, problem, result.solution


@pytest.mark.parametrize("kind", ["smooth", "broken"])
def test_each_step_starts_from_the_last_solution_of_the_same_solver(
    kind: str, request: pytest.FixtureRequest, quiet: Path, with_a_failure: Path
) -> None:
    folder = request.getfixturevalue(kind)
    rows = rows_of(quiet if kind == "smooth" else with_a_failure)
    warm = chain(rows)
    assert [row["step"] for row in warm] == list(range(STEPS))
    assert {row["sequence"] for row in warm} == {f"{folder.name}, from 0"}
    for row, (guess, result) in zip(warm, by_hand(folder), strict=True):
        assert (row["guess"], row["status"]) == (guess, result.status)
        if row["solved"]:
            assert row["iterations"] == result.iterations
    cold = {row["hash"]: row for row in rows if row["start"] == "cold" and row["solver"] == "nsgs"}
    assert {row["sequence"] for row in cold.values()} == {None}
    assert warm[0]["iterations"] == cold[warm[0]["hash"]]["iterations"]
    if kind == "smooth":
        later = sum(row["iterations"] for row in warm[1:])
        assert later < sum(cold[row["hash"]]["iterations"] for row in warm[1:])
    else:
        assert not warm[HOPELESS]["solved"]
        assert [row["guess"] for row in warm] == [None, 0, 1, 2, 2, 4]


def test_which_problems_are_the_steps(smooth: Path) -> None:
    plan = campaign(smooth, solvers=["nsgs"], sequence={"start": 1, "count": 2, "stride": 3}).plan()
    assert sorted({job.problem.name[-4:] for job in plan}) == ["0001", "0004"]
    steps = {job.along.step: job for job in plan if job.along}
    assert sorted(steps) == [0, 1]
    assert {job.along.sequence for job in steps.values() if job.along} == {"smooth, from 1 by 3"}
    # the first steps are a sample
    fewer = bench.Campaign.of(entries(smooth) | {"problems": [
        {"files": str(smooth), "sequence": {}, "sample": 2}
    ]}).plan()  # fmt: skip
    assert sorted({job.problem.name[-4:] for job in fewer}) == ["0000", "0001"]


def test_a_cut_leaves_the_first_steps_warm_and_cold(smooth: Path) -> None:
    """Also if only a share of the runs is repeated, or a budget ends the campaign."""
    for more in ({"repeats": 2, "repeated": 0.1}, {"budget": "1h"}):
        plan = [job for job in campaign(smooth, **more).plan() if not job.repeat]
        places = {job.problem.hash: job.along.step for job in plan if job.along}
        steps = [places[job.problem.hash] for job in plan]
        assert steps == sorted(steps)
        assert [bool(job.along) for job in plan[:4]].count(True) == 2  # of two solvers


def test_a_step_is_another_run_where_the_steps_before_are_others(smooth: Path) -> None:
    def keys(**sequence: int) -> dict[str, str]:
        plan = campaign(smooth, solvers=["nsgs"], sequence=sequence).plan()
        return {job.problem.name[-4:]: job.key for job in plan if job.along}

    whole, fewer, later = keys(), keys(count=3), keys(start=1)
    assert fewer == {name: whole[name] for name in fewer}
    assert not set(later.values()) & set(whole.values())
    cold = {job.key for job in campaign(smooth, solvers=["nsgs"]).plan() if not job.along}
    assert not cold & set(whole.values())
    # cold runs are those of a campaign that knows of no sequence
    known = {"problems": [{"files": str(smooth)}]}
    assert cold == {job.key for job in campaign(smooth, solvers=["nsgs"], **known).plan()}


@pytest.mark.parametrize(
    ("group", "words"),
    [
        ({"sequence": {"start": -1}}, "start: -1 is not a whole number, 0 or more"),
        ({"sequence": {"count": 0}}, "sequence.count: 0"),
        ({"sequence": {"stride": True}}, "sequence.stride: True"),
        ({"sequence": {"begin": 1}}, "sequence.begin: is not known here; there is: count"),
        ({"sequence": 3}, "sequence: is no table"),
        (
            {"sequence": {}, "planted": {"count": 2, "contacts": 3}},
            "of files, a set or a simulation",
        ),
    ],
)
def test_what_is_no_sequence_is_said(smooth: Path, group: dict[str, Any], words: str) -> None:
    with pytest.raises(bench.CampaignError, match=words):
        campaign(smooth, problems=[{"files": str(smooth)} | group])


def test_what_cannot_be_a_sequence_is_said(smooth: Path, tmp_path: Path) -> None:
    with pytest.raises(fclib.Error, match=r"two problems or more: .*smooth, from 5 has 1"):
        campaign(smooth, sequence={"start": STEPS - 1}).plan()
    for k in range(2):
        fclib.write(tmp_path / f"{k}.hdf5", planted_local(k).problem)
    with pytest.raises(fclib.Error, match=r"0\.hdf5: does not name its contacts"):
        campaign(tmp_path).plan()


@pytest.mark.parametrize("form", ["global", "local"])
def test_a_sequence_of_the_stored_states_of_a_family(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.setenv("FCLIB_CACHE", str(tmp_path / "cache"))
    group = {"set": "rt444/Chain", "form": form, "sequence": {"start": 100, "count": 3}}
    chosen = campaign(tmp_path, solvers=["nsgs"], problems=[group])
    plan = chosen.plan()
    names = [job.problem.name for job in plan if job.along]
    assert sorted(names) == ["Chain-00100", "Chain-00101", "Chain-00102"]
    assert {job.problem.family for job in plan} == {"Chain"}
    assert {job.problem.kind for job in plan} == {form}
    assert {job.along.sequence for job in plan if job.along} == {"rt444/Chain, from 100"}
    for name, words in (("rt444", "one family"), ("rt444/Chan", "Chan")):
        with pytest.raises(fclib.Error, match=words):
            campaign(tmp_path, problems=[{"set": name, "sequence": {}}]).plan()


def step_in(job: Job) -> int:
    assert job.along is not None
    return job.along.step


# ---- interrupted, spoilt, tried again

KILLED = """
import json, os, signal, sys
from fclib import bench
entries, path, runs = json.loads(sys.argv[1])
left = [runs]
def show(progress):
    if sum(progress.statuses.values()) >= runs:
        os.kill(os.getpid(), signal.SIGKILL)
bench.run_campaign(bench.Campaign.of(entries), path, jobs=2, show=show)
"""


# a start costs seconds: fewer kills if all steps are solved
@pytest.mark.parametrize(("kind", "after"), [("smooth", (5,)), ("broken", (5, 6))])
def test_a_killed_campaign_ends_as_an_uninterrupted_one(
    kind: str,
    after: tuple[int, ...],
    request: pytest.FixtureRequest,
    quiet: Path,
    with_a_failure: Path,
    tmp_path: Path,
) -> None:
    folder, path, kills = request.getfixturevalue(kind), tmp_path / "killed.sqlite", 0
    for runs in (*after, 100):
        words = json.dumps([entries(folder), str(path), runs])
        ended = subprocess.run([sys.executable, "-c", KILLED, words], check=False)
        assert ended.returncode in (0, -9)
        kills += ended.returncode == -9
    assert ended.returncode == 0
    assert kills == len(after)
    assert outcome(path) == outcome(quiet if kind == "smooth" else with_a_failure)


def spoilt(step: int) -> Any:
    """A runner in which a step of one of the chains is always killed from outside."""

    def run(jobs: Iterator[Job]) -> Iterator[tuple[Job, Record]]:
        for job, record in pool.run(jobs, 1):
            ours = job.along and job.along.step == step and job.solver.title == "nsgs"
            yield job, Record("killed", "by hand") if ours else record

    return run


def test_what_follows_a_step_that_was_not_run_is_not_run(
    smooth: Path, quiet: Path, tmp_path: Path
) -> None:
    path = tmp_path / "spoilt.sqlite"
    done = bench.run_campaign(campaign(smooth), path, runner=spoilt(2), retries=0)
    assert dict(done.not_run) == {"killed": STEPS - 2}
    assert not done.stopped
    rows = rows_of(path)
    assert [row["step"] for row in chain(rows)] == [0, 1]
    assert len(chain(rows, "nsgs relaxation=1.2")) == STEPS
    with bench.Store(path) as store:
        messages = sorted(fault["message"] for fault in store.faults())
    assert messages == [*["a step before it was not run: by hand"] * (STEPS - 3), "by hand"]
    again = bench.run_campaign(campaign(smooth), path)
    assert again.done == again.planned
    assert outcome(path) == outcome(quiet)


def test_the_steps_beyond_a_budget_are_done_later(
    smooth: Path, quiet: Path, tmp_path: Path
) -> None:
    path = tmp_path / "budget.sqlite"
    little = bench.run_campaign(campaign(smooth, budget=1e-9), path)
    assert little.left_over > 0
    assert little.done + little.left_over == little.planned == 4 * STEPS
    bench.run_campaign(campaign(smooth, budget="1h"), path)
    assert outcome(path) == outcome(quiet)


def test_what_follows_a_run_that_is_done_again_is_done_again(
    broken: Path, with_a_failure: Path, tmp_path: Path
) -> None:
    path = Path(shutil.copy(with_a_failure, tmp_path / "again.sqlite"))
    failed = chain(rows_of(path))[HOPELESS]
    before = {row["key"]: row["run"] for row in rows_of(path)}
    bench.run_campaign(campaign(broken), path, retry=[failed["status"]])
    again = {row["key"]: row["run"] for row in rows_of(path)}
    new = {key for key, run in again.items() if before[key] != run}
    # the cold run of the step, and all warm ones from it on, of two solvers
    assert len(new) == 2 * (1 + STEPS - HOPELESS)
    assert outcome(path) == outcome(with_a_failure)


def test_solutions_go_with_merged_runs(quiet: Path, smooth: Path, tmp_path: Path) -> None:
    path = tmp_path / "merged.sqlite"
    with bench.Store(path) as store:
        store.merge([quiet])
        found = {row["run"]: store.solution(row["run"]) for row in store.results()}
        rows = store.results()
    for row in rows:
        problem = fclib.read(smooth / f"{row['problem'][-4:]}.hdf5")
        u, r = found[row["run"]]["u"], found[row["run"]]["r"]
        assert fclib.merit(problem, fclib.Solution(r=r, u=u)).error == row["error"]


def test_a_guess_goes_to_a_machine_that_shares_no_folder(
    smooth: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FCLIB_CACHE", str(tmp_path / "far away"))
    plan = campaign(smooth, solvers=["nsgs"]).plan()
    first, second = sorted((job for job in plan if job.along), key=lambda job: step_in(job))[:2]
    r = fclib.solve(fclib.read(first.problem.path), "nsgs", 1e-6).solution.r.tobytes()
    problems = [first.problem, second.problem]
    data = [Path(problem.path).read_bytes() for problem in problems]
    away = [replace(problem, path=f"/nowhere/{problem.name}") for problem in problems]
    job = replace(second, problem=away[1], guess=Guess(away[0], 0, r, None))
    record = cluster.do(job, data[1], data[0])
    assert (record.status, record.guessed) == ("converged", True), record.message
    assert cluster.do(job, data[1]).status == "unreadable"


# ---- what it says


def test_no_profile_takes_warm_and_cold_runs(quiet: Path) -> None:
    cold, warm = profiles.load(quiet), profiles.load(quiet, start="warm")
    assert {row["start"] for row in cold} == {"cold"}
    assert {row["start"] for row in warm} == {"warm"}
    assert len(profiles.costs(cold).instances) == STEPS
    # the first step had nothing to start from
    assert {row["step"] for row in warm} == set(range(1, STEPS))
    assert len(profiles.costs(warm).instances) == STEPS - 1
    assert "warm" in profiles.caption(profiles.costs(warm), warm)
    assert "warm" not in profiles.caption(profiles.costs(cold), cold)


def test_a_problem_of_two_sequences_is_two_instances(
    smooth: Path, quiet: Path, tmp_path: Path
) -> None:
    path = Path(shutil.copy(quiet, tmp_path / "two.sqlite"))
    bench.run_campaign(campaign(smooth, sequence={"start": 1, "stride": 2}), path)
    costs = profiles.costs(profiles.load(path, start="warm"))
    assert len(costs.instances) == STEPS - 1 + 2
    assert len({instance.hash for instance in costs.instances}) == STEPS - 1


def test_steps_at_rest_are_instances_of_their_own(tmp_path: Path) -> None:
    (tmp_path / "rest").mkdir()
    for k in range(4):
        fclib.write(tmp_path / "rest" / f"{k:04d}.hdf5", step_of(0))
    path = tmp_path / "rest.sqlite"
    done = bench.run_campaign(campaign(tmp_path / "rest", solvers=["nsgs"]), path)
    assert done.solved == 1 + 4  # one problem, cold; four steps, warm
    costs = profiles.costs(profiles.load(path, start="warm"))
    assert len(costs.instances) == 3
    assert costs.spread is not None
    assert np.isnan(costs.spread).all()  # no repeats
    (row,) = profiles.along(path, profiles.load(path, start=None))
    assert (row["of"], row["solved cold"], row["iterations warm"]) == (3, 3, 0)


def test_the_steps_of_a_simulation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.setenv("FCLIB_CACHE", str(tmp_path / "cache"))
    group = {"simulate": {"family": "Chain", "steps": [0, 40, 41, 43]}, "sequence": {"start": 1}}
    path = tmp_path / "store.sqlite"
    own = campaign(tmp_path, problems=[group], solvers=["nsgs"], tolerances=[1e-4])
    assert bench.run_campaign(own, path).solved == 6
    warm = chain(rows_of(path))
    assert [Path(row["problem"]).stem[-3:] for row in warm] == ["040", "041", "043"]
    assert [row["guess"] for row in warm] == [None, 0, 1]
    assert {row["sequence"] for row in warm} == {"Chain, from 1"}
    with pytest.raises(bench.CampaignError, match="of files, a set or a simulation"):
        campaign(tmp_path, problems=[group | {"set": "tiny"}])


def test_warm_beside_cold(quiet: Path, with_a_failure: Path) -> None:
    for path, steps, solved in ((quiet, STEPS - 1, STEPS - 1), (with_a_failure, STEPS - 1, 4)):
        rows = rows_of(path)
        table = profiles.along(path, profiles.load(path, start=None))
        assert [row["solver"] for row in table] == ["nsgs", "nsgs relaxation=1.2"]
        row, warm = table[0], chain(rows)[1:]
        cold = {r["hash"]: r for r in rows if r["start"] == "cold" and r["solver"] == "nsgs"}
        assert (row["of"], row["solved warm"], row["solved cold"]) == (steps, solved, solved)
        assert row["without a guess"] == 0
        assert row["iterations warm"] == sum(one["iterations"] for one in warm)
        assert row["iterations cold"] == sum(cold[one["hash"]]["iterations"] for one in warm)
        spent = [
            sum(one["cpu_s"] for one in own) for own in (warm, [cold[o["hash"]] for o in warm])
        ]
        assert row["cold CPU / warm CPU"] == pytest.approx(spent[1] / spent[0])
        assert 0 < row["drift"] < 1e-3


def test_the_command_tells_them_apart(quiet: Path, tmp_path: Path) -> None:
    assert {row["of"] for row in tables(quiet)["summary"]} == {STEPS}
    assert {row["of"] for row in tables(quiet, "--start", "warm")["summary"]} == {STEPS - 1}
    assert tables(quiet)["along"] == tables(quiet, "--start", "warm")["along"]
    with Campaigns([quiet]) as report:
        assert {row["start"] for row in report.rows} == {"cold"}
        assert report.overview()["along"] == tables(quiet)["along"]
    alone = tmp_path / "cold.sqlite"
    with bench.Store(alone) as store:
        store.merge([quiet])
        store.db.execute("DELETE FROM runs WHERE start = 'warm'")
    with pytest.raises(profiles.ProfileError, match="no run with start warm; there is: cold"):
        profiles.load(alone, start="warm")
