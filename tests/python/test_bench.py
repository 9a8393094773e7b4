"""Campaigns and their store: nothing is lost, nothing is done twice."""

from __future__ import annotations

import json
import math
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import fclib
import helpers_cli
from fclib import bench
from fclib._solve import MERITS
from fclib.bench import problems
from fclib.bench.job import Job, Record
from helpers import planted_global, planted_local, ran
from helpers_cli import invoke

KILLS = int(os.environ.get("FCLIB_TEST_KILLS", "4"))
RUNS = int(os.environ.get("FCLIB_TEST_RUNS", "200"))


@pytest.fixture(autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FCLIB_CACHE", str(tmp_path_factory.getbasetemp() / "cache"))


def campaign(**changes: Any) -> bench.Campaign:
    entries: dict[str, Any] = {
        "name": "small",
        "solvers": ["nsgs", "auto", {"name": "nsgs", "options": {"relaxation": 1.2}}],
        "tolerances": [1e-4, 1e-8],
        "problems": [{"planted": {"count": 3, "contacts": 5, "seed": 1}, "family": "planted"}],
    }
    return bench.Campaign.of(entries | changes)


run_cli = partial(helpers_cli.run, "bench")


# ---- what is run


def test_a_campaign_is_run_once(tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite"
    first = bench.run_campaign(campaign(), path, jobs=2)
    assert (first.planned, first.skipped, first.solved) == (18, 0, 18)
    again = bench.run_campaign(campaign(), path)
    assert (again.planned, again.skipped, again.solved) == (18, 18, 0)
    more = bench.run_campaign(campaign(repeats=2), path)
    assert (more.planned, more.skipped, more.solved) == (36, 18, 18)
    with bench.Store(path) as store:
        rows = store.results()
    assert len(rows) == 36
    assert {row["solver"] for row in rows} == {"nsgs", "auto", "nsgs relaxation=1.2"}
    assert {row["tol"] for row in rows} == {1e-4, 1e-8}
    assert {row["family"] for row in rows} == {"planted"}
    for row in rows:
        assert row["error"] <= row["tol"]
        assert row["cpu_s"] > 0
        assert row["version"].startswith(f"{fclib.__version__}-")
        assert row["measured"]
        assert row["said_cpu_s"] <= row["total_cpu_s"] + 0.1
        assert row["hash"]


def test_the_merits_are_those_of_the_solution(tmp_path: Path) -> None:
    fclib.write(tmp_path / "one.hdf5", planted_global(3).problem)
    path = tmp_path / "store.sqlite"
    chosen = campaign(solvers=["nsgs"], tolerances=[1e-6], problems=[{"files": str(tmp_path)}])
    bench.run_campaign(chosen, path)
    with bench.Store(path) as store:
        (row,) = store.results()
    problem = fclib.read(tmp_path / "one.hdf5")
    merit = fclib.merit(problem, fclib.solve(problem, "nsgs", 1e-6).solution)
    assert {name: row[name] for name in MERITS} == {name: getattr(merit, name) for name in MERITS}
    assert row["hash"] == fclib.digest(problem)
    assert (row["problem"], row["family"], row["formulation"]) == (
        "one",
        tmp_path.name,
        problem.formulation,
    )


def test_the_order_is_shuffled_repeat_by_repeat_and_the_same_each_time() -> None:
    plan = campaign(repeats=3).plan()
    assert [job.repeat for job in plan] == [0] * 18 + [1] * 18 + [2] * 18
    orders = [[(j.problem.name, j.solver.title, j.tol) for j in plan[k : k + 18]] for k in (0, 18)]
    assert orders[0] != orders[1]
    assert sorted(orders[0]) == sorted(orders[1])
    assert [job.key for job in campaign(repeats=3).plan()] == [job.key for job in plan]


def test_the_key_tells_runs_apart() -> None:
    (job, *_) = campaign().plan()
    others: list[dict[str, Any]] = [
        {"tol": 1e-5},
        {"repeat": 1},
        {"threads": 2},
        {"limits": bench.Limits(1, 2, 3)},
        {"solver": bench.SolverChoice("nsgs", {"relaxation": 1.3})},
        {"solver": bench.SolverChoice("nsgs", {}, version="other")},
    ]
    keys = {replace(job, **other).key for other in others}
    assert len(keys | {job.key}) == len(others) + 1
    # where a file lies and what a table calls a solver does not matter
    moved = replace(
        job,
        problem=replace(job.problem, path="/else", name="x"),
        solver=replace(job.solver, label="other"),
    )
    assert moved.key == job.key


def test_problems_are_made_the_same_each_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    digests = []
    for folder in ("a", "b"):
        monkeypatch.setenv("FCLIB_CACHE", str(tmp_path / folder))
        digests.append(sorted(job.key for job in campaign().plan()))
    assert digests[0] == digests[1]


def test_a_sample_is_evenly_spread() -> None:
    paths = [Path(str(k)) for k in range(9)]
    for count, chosen in ((1, "4"), (2, "08"), (3, "048"), (9, "012345678"), (99, "012345678")):
        assert "".join(map(str, problems.sample(paths, count))) == chosen
    assert problems.sample(paths, None) == paths


def test_history_on_request(tmp_path: Path) -> None:
    for wanted in (False, True):
        path = tmp_path / f"{wanted}.sqlite"
        bench.run_campaign(campaign(history=wanted, solvers=["nsgs"], tolerances=[1e-8]), path)
        with bench.Store(path) as store:
            histories = [store.history(row["run"]) for row in store.results()]
        assert all(bool(history) == wanted for history in histories)
    for history in histories:
        iterations = [report[0] for report in history]
        assert iterations == sorted(iterations)
        assert history[-1][1] <= 1e-8


# ---- interrupted at any point


def test_what_is_interrupted_is_not_said_to_run(tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite"

    def stop(progress: bench.Progress) -> None:
        if progress.done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bench.run_campaign(campaign(), path, show=stop)
    (shown,) = [
        json.loads(line) for line in run_cli("--status", path, "--json").stdout.splitlines()
    ]
    assert shown["state"] == "interrupted"
    # of one that was killed its process tells, and not how long it has been silent
    with bench.Store(path) as store:
        store.db.execute("UPDATE campaigns SET ended = NULL, seen = 0, pid = ?", (os.getpid(),))
        store.seal()
    assert '"running"' in run_cli("--status", path, "--json").stdout
    with bench.Store(path) as store:
        store.db.execute("UPDATE campaigns SET seen = 1e12, pid = 4194305")
        store.seal()
    assert '"interrupted"' in run_cli("--status", path, "--json").stdout


TABLE = """
name = "killed"
solvers = ["nsgs", "auto"]
tolerances = [1e-4]
repeats = {repeats}
[[problems]]
planted = {{ count = 4, contacts = 4, seed = 5 }}
"""


def rows_of(path: Path) -> int:
    """How many runs a store has, 0 where it is not there yet."""
    if not path.exists():
        return 0
    database = sqlite3.connect(path)
    try:
        return int(database.execute("SELECT COUNT(*) FROM runs").fetchone()[0])
    except sqlite3.OperationalError:
        return 0
    finally:
        database.close()


def marked(mark: str) -> list[int]:
    """Processes in whose environment a text is."""
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            if mark in path.read_text(errors="replace"):
                found.append(int(path.parent.name))
        except OSError:
            continue
    return found


@pytest.mark.slow
def test_no_run_is_lost_or_doubled_by_kill_9(tmp_path: Path) -> None:
    repeats = RUNS // 8
    (tmp_path / "killed.toml").write_text(TABLE.format(repeats=repeats))
    path = tmp_path / "store.sqlite"
    command = [sys.executable, "-m", "fclib", "bench", tmp_path / "killed.toml"]
    command += ["--store", path, "-j", "2", "--json"]
    moments, mark = random.Random(1), f"FCLIB_TEST_MARK={tmp_path}"
    environment = os.environ | {"FCLIB_TEST_MARK": str(tmp_path)}
    counts = []
    seen: dict[str, tuple[Any, ...]] = {}
    for kill in range(KILLS):
        process = subprocess.Popen(
            list(map(str, command)), stdout=subprocess.DEVNULL, env=environment
        )
        if kill % 4:  # at any moment of its work
            end = time.monotonic() + 30
            while rows_of(path) == len(seen) and time.monotonic() < end:
                time.sleep(0.01)
            time.sleep(moments.uniform(0, 4e-3 * RUNS / KILLS))
        else:  # while it starts, makes the store, or looks at the problems
            time.sleep(moments.uniform(0.2, 1.5))
        process.send_signal(signal.SIGKILL)
        process.wait()
        if path.exists():
            database = sqlite3.connect(path)
            assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)
            try:
                rows = database.execute("SELECT key, id, started, error FROM runs").fetchall()
            except sqlite3.OperationalError:  # killed before it had made the tables
                rows = []
            database.close()
            # what was there is there, as it was
            now = {row[0]: row for row in rows}
            assert len(now) == len(rows)
            assert seen.items() <= now.items()
            seen = now
        counts.append(len(seen))
    ran(*command)
    with bench.Store(path) as store:
        rows = store.results()
        states = store.status()
    assert len(rows) == len({row["key"] for row in rows}) == 8 * repeats
    assert {(row["problem"], row["solver"], row["repeat"]) for row in rows} == {
        (row["problem"], solver, repeat)
        for row in rows
        for solver in ("nsgs", "auto")
        for repeat in range(repeats)
    }
    assert (
        seen.items()
        <= {
            row["key"]: (row["key"], row["run"], row["started"], row["error"]) for row in rows
        }.items()
    )
    # the kills came while it worked; each start went on where the last one was
    assert max(counts) > 0
    assert states[0].planned == states[0].done == 8 * repeats
    assert len(states) > 1
    # nobody is left of those that were killed
    end = time.monotonic() + 20
    while marked(mark) and time.monotonic() < end:
        time.sleep(0.1)
    assert not marked(mark)


@pytest.mark.slow
def test_two_campaigns_write_one_store(tmp_path: Path) -> None:
    (tmp_path / "two.toml").write_text(TABLE.format(repeats=12))
    path = tmp_path / "store.sqlite"
    command = [sys.executable, "-m", "fclib", "bench", tmp_path / "two.toml", "--store", path]
    both = [
        subprocess.Popen(
            [*map(str, command), "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        for _ in range(2)
    ]
    counts = []
    for process in both:
        words, errors = process.communicate(timeout=120)
        assert process.returncode == 0, errors
        counts.append(json.loads(words))
    with bench.Store(path) as store:
        keys = [row["key"] for row in store.results()]
    assert len(keys) == len(set(keys)) == 96
    assert sum(count["solved"] for count in counts) == 96


# ---- the store


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FCLIB_CACHE", str(tmp_path_factory.getbasetemp() / "cache"))
        path = tmp_path_factory.mktemp("small") / "store.sqlite"
        bench.run_campaign(campaign(history=True), path, jobs=2)
        yield path


def elsewhere(source: Path, target: Path, node: str) -> None:
    """A copy of a store, as another machine would have made it."""
    with bench.Store(source) as store:
        store.db.execute("VACUUM INTO ?", (str(target),))
    with bench.Store(target) as store:
        store.db.execute("UPDATE machines SET node = ?1, hash = ?1", (node,))
        store.seal()


def test_what_cannot_begin_leaves_no_store(small: Path, tmp_path: Path) -> None:
    path = tmp_path / "new.sqlite"
    arguments = ("--problems", tmp_path / "none.hdf5", "--solver", "auto", "--store")
    done = run_cli(*arguments, path, code=1)
    assert "none.hdf5" in done.stderr
    assert list(tmp_path.iterdir()) == []
    runs = len(bench.Store(small).results())
    run_cli(*arguments, small, code=1)
    assert len(bench.Store(small).results()) == runs > 0


def test_interrupted_before_there_is_a_store(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("fclib.bench.cluster.on_scheduler", interrupted)
    fclib.write(tmp_path / "one.hdf5", planted_local(0).problem)
    store = tmp_path / "new.sqlite"
    command = ["bench", "--problems", tmp_path / "one.hdf5", "--solver", "auto"]
    command += ["--scheduler", "tcp://localhost:1", "--store", store]
    before = signal.getsignal(signal.SIGINT)
    result = invoke(*command, code=130)
    assert "interrupted" in result.stderr
    assert signal.getsignal(signal.SIGINT) is before
    assert not store.exists()


def test_merge(small: Path, tmp_path: Path) -> None:
    elsewhere(small, tmp_path / "other.sqlite", "other")
    merged = tmp_path / "merged.sqlite"
    run_cli("merge", merged, small, tmp_path / "other.sqlite")
    with bench.Store(merged) as store, bench.Store(small) as first:
        rows, original = store.results(), first.results()
        assert len(rows) == 2 * len(original)
        assert len({row["node"] for row in rows}) == 2
        kept = [name for name in original[0] if name != "run"]
        mine = [row for row in rows if row["machine"] == original[0]["machine"]]
        assert [[row[k] for k in kept] for row in mine] == [[r[k] for k in kept] for r in original]
        for row, old in zip(mine, original, strict=True):
            assert store.history(row["run"]) == first.history(old["run"]) != []
        # once more changes nothing
        assert store.merge([small, tmp_path / "other.sqlite"]) == 0
        assert len(store.status()) == 1
    run_cli("merge", merged, merged, code=1)


def test_some_of_the_runs(small: Path) -> None:
    with bench.Store(small) as store:
        rows = store.results()
        some = [row for row in rows if row["tol"] == 1e-8 and row["solver"] != "auto"]
        assert len(some) == 6
        assert store.results("tol = ? AND solver <> 'auto'", [1e-8]) == some
        assert store.results("solver <> 'auto'", tol=1e-8) == some
        assert store.results("run < 0") == []


def test_export(small: Path, tmp_path: Path) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    with bench.Store(small) as store:
        rows, columns = store.results(), store.columns()
    assert list(rows[0]) == columns
    for name in ("runs.csv", "runs.parquet"):
        run_cli("export", small, tmp_path / name)
    assert pq.read_table(tmp_path / "runs.parquet").to_pylist() == rows
    import csv

    with (tmp_path / "runs.csv").open() as file:
        read = list(csv.DictReader(file))
    assert [float(row["error"]) for row in read] == [row["error"] for row in rows]
    assert sorted(tmp_path.iterdir()) == [tmp_path / "runs.csv", tmp_path / "runs.parquet"]
    run_cli("export", small, tmp_path / "runs.txt", code=1)


def test_export_does_not_write_over_the_store(small: Path, tmp_path: Path) -> None:
    store = tmp_path / "store.csv"
    shutil.copy(small, store)
    assert "is what is read" in run_cli("export", store, store, code=1).stderr
    assert store.read_bytes() == small.read_bytes()


def test_status(small: Path) -> None:
    done = run_cli("--status", small, "--json")
    (record,) = map(json.loads, done.stdout.splitlines())
    assert (record["state"], record["runs"], record["solved"]) == ("finished", "18 of 18", 18)
    assert "finished" in run_cli("--status", small).stdout


def test_what_is_no_store_is_said(tmp_path: Path) -> None:
    (tmp_path / "text.sqlite").write_text("no database, whatever its name\n" * 100)
    with pytest.raises(bench.StoreError, match=r"text\.sqlite"):
        bench.Store(tmp_path / "text.sqlite")
    database = sqlite3.connect(tmp_path / "other.sqlite")
    database.execute("CREATE TABLE runs (id INTEGER)")
    database.commit()
    database.close()
    with pytest.raises(bench.StoreError, match="no store of fclib"):
        bench.Store(tmp_path / "other.sqlite")
    with bench.Store(tmp_path / "new.sqlite") as store:
        store.db.execute("PRAGMA user_version = 99")
    with pytest.raises(bench.StoreError, match="version 99"):
        bench.Store(tmp_path / "new.sqlite")
    with pytest.raises(bench.StoreError, match="is a folder"):
        bench.Store(tmp_path)
    with pytest.raises(bench.StoreError, match="there is no folder"):
        bench.Store(tmp_path / "absent" / "new.sqlite")
    run_cli("--status", tmp_path / "absent.sqlite", code=1)
    assert not (tmp_path / "absent.sqlite").exists()


def test_what_is_no_store_is_not_made_one(tmp_path: Path) -> None:
    """SQLite takes a file of one byte for a new database."""
    letter = tmp_path / "letter.json"
    letter.write_text("{")
    for create in (False, True):
        with pytest.raises(bench.StoreError, match=r"letter\.json: is no database, and no store"):
            bench.Store(letter, create=create)
    assert letter.read_text() == "{"
    bare = tmp_path / "bare.sqlite"
    with closing(sqlite3.connect(bare)) as database:
        database.execute("PRAGMA user_version = 7")
    before = bare.read_bytes()
    with pytest.raises(bench.StoreError, match="without tables, and no store"):
        bench.Store(bare, create=False)
    assert bare.read_bytes() == before


def test_what_cannot_be_merged_leaves_no_store(tmp_path: Path) -> None:
    new, wrong = tmp_path / "new.sqlite", tmp_path / "wrong.parquet"
    wrong.write_text("no table")
    run_cli("merge", new, tmp_path / "none.sqlite", code=1)
    run_cli("merge", new, wrong, code=1)
    with pytest.raises(RuntimeError), bench.Store(new):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == [wrong]


def made_older(path: Path) -> None:
    """Make of a store what fclib 1.0 made."""
    database = sqlite3.connect(path)
    (view,) = database.execute("SELECT sql FROM sqlite_master WHERE name = 'results'").fetchone()
    database.execute("DROP VIEW results")
    for (table,) in database.execute(
        "SELECT name FROM sqlite_master WHERE type = 'table'"
    ).fetchall():
        database.execute(f"ALTER TABLE {table} DROP COLUMN checksum")
    database.execute("ALTER TABLE solvers DROP COLUMN about")
    database.execute(view.replace(", solvers.about", ""))
    database.execute("PRAGMA user_version = 4")
    database.commit()
    database.close()


@pytest.mark.parametrize("writable", [True, False])
def test_a_store_of_the_earlier_version_is_brought_up_to_date(
    writable: bool, small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = tmp_path / "old.sqlite"
    with bench.Store(small) as store:
        store.db.execute("VACUUM INTO ?", (str(old),))
        rows = [row | {"about": None} for row in store.results()]
    made_older(old)
    before = old.read_bytes()
    if not writable:
        monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)
    for _ in range(2):
        with bench.Store(old, create=False) as store:
            assert store.results() == rows
            assert store.history(rows[0]["run"])
    assert (old.read_bytes() == before) != writable
    if writable:
        # what was run is not run again, and what solvers say of themselves is added
        again = bench.run_campaign(campaign(history=True), old)
        assert (again.skipped, again.solved) == (18, 0)
        more = bench.run_campaign(campaign(history=True, repeats=2), old)
        assert more.solved == 18
        with bench.Store(old) as store:
            assert all(json.loads(row["about"])["title"] for row in store.results())


def test_a_store_in_a_folder_that_cannot_be_written(
    small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(small, tmp_path / "one.sqlite")
    files = sorted(tmp_path.iterdir())
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)
    with bench.Store(tmp_path / "one.sqlite", create=False) as store:
        assert len(store.results()) == 18
        with pytest.raises(bench.StoreError, match=r"one\.sqlite: cannot be written: copy it"):
            store.begin("x", "", 0, 0, "")
    assert sorted(tmp_path.iterdir()) == files


def test_what_is_left_of_a_damaged_store_is_saved(small: Path, tmp_path: Path) -> None:
    path = tmp_path / "damaged.sqlite"
    with bench.Store(small) as store:
        store.db.execute("VACUUM INTO ?", (str(path),))
    data = bytearray(path.read_bytes())
    size = int.from_bytes(data[16:18], "big")
    database = sqlite3.connect(path)
    (root,) = database.execute(
        "SELECT rootpage FROM sqlite_master WHERE name = 'history'"
    ).fetchone()
    database.close()
    data[(root - 1) * size : root * size] = b"\xff" * size
    path.write_bytes(data)
    with pytest.raises(bench.StoreError, match=r"damaged.*18 of its runs.*fclib bench merge"):
        bench.Store(path)
    with bench.Store(tmp_path / "saved.sqlite") as saved:
        assert saved.merge([path]) == 18
        assert {row["error"] for row in saved.results()} == {
            row["error"] for row in bench.Store(small).results()
        }
    (tmp_path / "empty.sqlite").touch()
    with pytest.raises(bench.StoreError, match="is empty"):
        bench.Store(tmp_path / "empty.sqlite", create=False)


# ---- what comes from outside


def fake(outcome: Any, count: list[str]) -> Any:
    """A runner that runs nothing: the records are those that `outcome(job, attempt)` says."""
    attempts: Counter[str] = Counter()

    def run(jobs: Iterator[Job]) -> Iterator[tuple[Job, Record]]:
        while (job := next(jobs, None)) is not None:
            attempts[job.key] += 1
            count.append(job.key)
            status = outcome(job, attempts[job.key])
            yield job, Record(status, "a word \ud800", machine={"node": "here"})

    return run


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fclib.bench.runner.PAUSES", (0.0, 0.0))


@pytest.mark.usefixtures("hasty")
def test_what_is_spoilt_from_outside_is_tried_again(tmp_path: Path) -> None:
    done: list[str] = []
    runner = fake(lambda job, attempt: "converged" if attempt > 2 else "killed", done)
    progress = bench.run_campaign(campaign(), tmp_path / "a.sqlite", runner=runner)
    assert (progress.solved, len(done), progress.stopped) == (18, 3 * 18, "")
    with bench.Store(tmp_path / "a.sqlite") as store:
        assert {row["status"] for row in store.results()} == {"converged"}
        assert store.faults() == []


@pytest.mark.usefixtures("hasty")
def test_what_cannot_be_run_is_no_failure_and_is_tried_by_the_next_campaign(tmp_path: Path) -> None:
    done: list[str] = []
    chosen = campaign(repeats=2)
    unlucky = chosen.plan()[3].key
    runner = fake(lambda job, _: "lost" if job.key == unlucky else "stalled", done)
    progress = bench.run_campaign(chosen, tmp_path / "a.sqlite", runner=runner)
    assert (sum(progress.statuses.values()), progress.not_run["lost"]) == (35, 1)
    assert not progress.stopped
    assert done.count(unlucky) == 3
    with bench.Store(tmp_path / "a.sqlite") as store:
        assert not store.has(unlucky)
        (fault,) = store.faults()
        assert (fault["status"], fault["message"]) == ("lost", "a word ?")
    again = bench.run_campaign(
        chosen, tmp_path / "a.sqlite", runner=fake(lambda *_: "converged", done)
    )
    assert (again.skipped, again.solved) == (35, 1)
    with bench.Store(tmp_path / "a.sqlite") as store:
        assert store.faults() == []
    # and those of a status that is named
    more = bench.run_campaign(
        chosen, tmp_path / "a.sqlite", runner=fake(lambda *_: "converged", done), retry=["stalled"]
    )
    assert (more.skipped, more.solved) == (1, 35)


@pytest.mark.usefixtures("hasty")
def test_a_campaign_of_which_a_tenth_cannot_run_stops(tmp_path: Path) -> None:
    done: list[str] = []
    chosen = campaign(repeats=10)
    runner = fake(lambda *_: "unreadable", done)
    progress = bench.run_campaign(chosen, tmp_path / "a.sqlite", runner=runner)
    assert "could not be done" in progress.stopped
    assert "unreadable: a word" in progress.stopped
    assert len(done) == 3 * 18  # of 180


def test_the_campaign_that_stops_says_so_and_exits_with_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fclib.write(tmp_path / "one.hdf5", planted_local(3).problem)
    store = tmp_path / "store.sqlite"
    arguments = ["bench", "--problems", str(tmp_path), "--solver", "nsgs"]
    arguments += ["--store", str(store), "--retries", "0"]
    lost = Record("lost", "gone")
    monkeypatch.setattr("fclib.bench.pool.run", lambda jobs, _: ((job, lost) for job in jobs))
    done = invoke(*arguments, code=1)
    assert "stopped: 1 of 1 run could not be done" in " ".join(done.stderr.split())
    assert bench.Store(store).results() == []


def test_a_solver_that_kills_itself_stays_in_the_comparison(tmp_path: Path) -> None:
    fclib.write(tmp_path / "one.hdf5", planted_local(3).problem)
    kills_itself = "cmd:sh -c 'kill -9 $$' {input}"
    chosen = campaign(
        solvers=[kills_itself, "nsgs"], tolerances=[1e-6], problems=[{"files": str(tmp_path)}]
    )
    progress = bench.run_campaign(chosen, tmp_path / "store.sqlite")
    assert not progress.not_run
    with bench.Store(tmp_path / "store.sqlite") as store:
        assert store.faults() == []
        found = {row["solver"]: row["status"] for row in store.results()}
    assert found == {kills_itself: "crashed", "nsgs": "converged"}


def test_what_a_solver_does_not_take_is_known_before_it_runs(tmp_path: Path) -> None:
    """And nothing that it says when it runs takes a problem out of the comparison."""
    fclib.write(tmp_path / "planar.hdf5", planted_local(3, d=2).problem)
    (tmp_path / "picky.py").write_text(
        "import fclib\n"
        "@fclib.solver('spatial', dimensions=(3,))\n"
        "def spatial(problem, r, monitor):\n    raise SystemExit('is never called')\n"
        "@fclib.solver('picky')\n"
        "def picky(problem, r, monitor):\n    raise fclib.UnsuitableError('too hard')\n"
    )
    entries = {"solvers": ["spatial", "picky"], "modules": ["picky.py"], "tolerances": [1e-6]}
    chosen = bench.Campaign.of({**entries, "problems": [{"files": "planar.hdf5"}]}, tmp_path)
    bench.run_campaign(chosen, tmp_path / "store.sqlite")
    with bench.Store(tmp_path / "store.sqlite") as store:
        found = {row["solver"]: row["status"] for row in store.results()}
    assert found == {"spatial": "unsuitable", "picky": "error"}


def test_nothing_in_the_current_folder_is_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("random", "signal", "re", "json", "numpy", "fclib"):
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\n")
    monkeypatch.chdir(tmp_path)
    chosen = campaign(solvers=["nsgs"], tolerances=[1e-4])
    progress = bench.run_campaign(chosen, tmp_path / "store.sqlite")
    assert progress.solved == 3
    assert not (tmp_path / "ran").exists()


def test_a_module_that_ends_the_process_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "quits.py").write_text("import sys\nsys.exit(0)\n")
    with pytest.raises(bench.CampaignError, match=r"quits.py: SystemExit: 0"):
        campaign(modules=[str(tmp_path / "quits.py")])


def test_a_module_does_not_take_the_place_of_another(tmp_path: Path) -> None:
    (tmp_path / "random.py").write_text("raise SystemExit\n")
    (tmp_path / "pytest.py").write_text("raise SystemExit\n")
    for name in ("random.py", "pytest.py"):
        with pytest.raises(bench.CampaignError, match=r"another module is called"):
            campaign(modules=[str(tmp_path / name)])


# ---- what ran


OWN = """
import fclib
import own_helper

@fclib.solver("own-fingerprint")
def solve(problem, r, monitor):
    return own_helper.solve(r)
"""


def test_the_version_of_a_solver_is_that_of_what_it_is_made_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    helper, own = tmp_path / "own_helper.py", tmp_path / "own_module.py"
    own.write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    program = tmp_path / "program.py"
    versions: list[tuple[str, ...]] = []
    for text in ("def solve(r): return r", "def solve(r): return r", "def solve(r): return 2 * r"):
        for path in (helper, program):
            path.write_text(text)
        for name in ("own_helper", "own_module"):
            sys.modules.pop(name, None)
        command = f"cmd:{sys.executable} {program} {{input}}"
        chosen = campaign(solvers=["auto", "own-fingerprint", command], modules=[str(own)])
        versions.append(tuple(choice.version for choice in chosen.solvers))
    same, again, changed = versions
    assert same == again
    assert same[0] == changed[0] == f"{fclib.__version__}-{fclib._core.fingerprints()['auto']}"
    assert same[1] != changed[1]
    assert same[2] != changed[2]
    digests = fclib._core.fingerprints()
    assert set(digests) == {solver.name for solver in fclib._core.solvers()}
    assert len(set(digests.values())) == len(digests)


def test_the_version_takes_in_each_package_that_a_module_imports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    own = tmp_path / "own_module.py"
    own.write_text("import first_own\nimport second_own\n" + OWN.replace("own_helper", "first_own"))
    packages = ("first_own", "second_own")
    versions = set()
    for changed in (None, *packages):
        for name in packages:
            (tmp_path / name).mkdir(exist_ok=True)
            factor = 2 if name == changed else 1
            text = f"def solve(r): return {factor} * r"
            (tmp_path / name / "__init__.py").write_text(text)
        for name in (*packages, "own_module"):
            sys.modules.pop(name, None)
        chosen = campaign(solvers=["own-fingerprint"], modules=[str(own)])
        versions.add(chosen.solvers[0].version)
    assert len(versions) == 3


# ---- a budget


def test_a_budget_is_spread_over_families_and_whole_problems(tmp_path: Path) -> None:
    groups = [
        {"planted": {"count": 4, "contacts": 4, "seed": 1}, "family": "a"},
        {"planted": {"count": 2, "contacts": 5, "seed": 1}, "family": "b"},
    ]
    chosen = campaign(problems=groups, budget="54s", tolerances=[1e-4])
    assert (chosen.budget, campaign(budget="2h").budget) == (54, 7200)

    def run(jobs: Iterator[Job]) -> Iterator[tuple[Job, Record]]:
        while (job := next(jobs, None)) is not None:
            yield job, Record("converged", total_cpu_s=6.0, wall_s=1.0, machine={"node": "here"})

    progress = bench.run_campaign(chosen, tmp_path / "a.sqlite", runner=run)
    # three problems of six, by all three solvers
    assert (progress.solved, progress.left_over) == (9, 9)
    with bench.Store(tmp_path / "a.sqlite") as store:
        counts = Counter((row["family"], row["problem"]) for row in store.results())
    assert sorted(family for family, _ in counts) == ["a", "a", "b"]
    assert set(counts.values()) == {3}
    # with more it goes on
    more = campaign(problems=groups, budget=60, tolerances=[1e-4])
    progress = bench.run_campaign(more, tmp_path / "a.sqlite", runner=run)
    assert (progress.skipped, progress.solved, progress.left_over) == (9, 1, 8)


def test_sets_of_the_collection_are_named() -> None:
    pytest.importorskip("pyarrow")
    plan = campaign(problems=["set:tiny"], solvers=["auto"], tolerances=[1e-4]).plan()
    assert len(plan) == len(fclib.collection("tiny"))
    assert {Path(job.problem.path).is_absolute() for job in plan} == {True}
    with pytest.raises(fclib.Error, match=r"set nowhere: .*tiny"):
        campaign(problems=["set:nowhere"]).plan()


def test_a_set_that_is_built_in_part_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pyarrow")
    from fclib.bench import generated
    from fclib.collections import library

    folders = library.Collection("tiny").folders
    there, built = set(folders[:3]), []

    def build(plan: Any, folder: Path, progress: Any) -> None:
        for done in range(5):
            progress(plan.name, done, 5)
        built.append(plan.name)

    monkeypatch.setattr(library, "is_there", lambda name, folder: name in there)
    monkeypatch.setattr(generated, "_build", build)
    said: list[str] = []
    campaign(problems=["set:tiny"], solvers=["auto"], tolerances=[1e-4]).plan(tell=said.append)
    # those that were asked for and are not there, and no others
    assert built == folders[3:]
    assert said[0].startswith(f"set tiny: 3 of {len(folders)} families are there; ")
    assert "fclib collection build tiny --no-references --out " in said[0]
    # a word for each family at once, and not one for each problem
    assert said[1:-1] == [
        f"family {k} of {len(folders) - 3}: {name}, 0 of 5 problems"
        for k, name in enumerate(folders[3:], start=1)
    ]
    there.update(folders)
    said.clear()
    campaign(problems=["set:tiny"], solvers=["auto"], tolerances=[1e-4]).plan(tell=said.append)
    assert said == []


def test_a_sample_of_a_family_is_built_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pyarrow")
    pytest.importorskip("mujoco")
    monkeypatch.setenv("FCLIB_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("FCLIB_COLLECTION", str(tmp_path / "collection"))
    name, settings = "rt444/KaplasTower", {"solvers": ["auto"], "tolerances": [1e-4]}
    plan = campaign(problems=[{"set": name, "sample": 4}], **settings).plan()
    names = [job.problem.name for job in plan]
    assert sorted(names) == [f"KaplasTower/{k:04d}-global" for k in (0, 67, 133, 200)]
    files = list(tmp_path.rglob("*-global.hdf5"))
    assert len(files) == 4
    # a reference would take longer than the runs
    assert [fclib.read_solution(file) for file in files] == [None] * 4
    assert not (tmp_path / "collection").exists()
    # those that a sample of the whole family takes
    assert problems.sample(list(range(201)), 4) == [0, 67, 133, 200]
    # also of a family whose problems were chosen
    plan = campaign(problems=[{"set": "decks/ElasticCubes", "sample": 1}], **settings).plan()
    assert [job.problem.nc > 0 for job in plan] == [True]
    assert len(list(tmp_path.rglob("*-global.hdf5"))) == 5
    # and of a whole set
    plan = campaign(problems=["set:simulators/PyBulletBoxes"], **settings).plan()
    files = sorted({Path(job.problem.path) for job in plan})
    assert len(files) == len(fclib.collections.plan_of("simulators/PyBulletBoxes").numbers())
    assert [fclib.read_solution(file) for file in files] == [None] * len(files)
    assert not (tmp_path / "collection").exists()
    said: list[str] = []
    again = campaign(problems=["set:simulators/PyBulletBoxes"], **settings).plan(tell=said.append)
    assert (said, len(again)) == ([], len(plan))


def test_files_of_a_set_that_is_not_built_name_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FCLIB_COLLECTION", str(tmp_path))
    wanted = {
        "standard/*/*-global.hdf5": "standard",
        "rt444/Chain/*.hdf5": "rt444/Chain",
        "standard": "standard",
    }
    for pattern, name in wanted.items():
        with pytest.raises(fclib.FileError) as told:
            problems.files_of([f"${{FCLIB_COLLECTION}}/{pattern}"], Path("/"))
        assert str(told.value).endswith(f"fclib collection build {name} --out {tmp_path}")
    for pattern in (f"{tmp_path}/mine/*.hdf5", "/nowhere/standard/*.hdf5"):
        with pytest.raises(fclib.FileError) as told:
            problems.files_of([pattern], Path("/"))
        assert "collection build" not in str(told.value)


@pytest.mark.parametrize(
    ("entry", "wanted"),
    [
        ({"files": "scene"}, {"0001-global", "0002-local", "other"}),
        ({"files": "scene/*.hdf5"}, {"0001-global", "0002-local", "other"}),
        ({"files": "scene", "form": "local"}, {"0001-local", "0002-local", "other"}),
        ({"files": "scene", "form": "both"}, {"0001-global", "0001-local", "0002-local", "other"}),
        (
            {"files": ["scene/0001-local.hdf5", "scene"]},
            {"0001-global", "0001-local", "0002-local", "other"},
        ),
        ({"files": "scene/0001-local.hdf5"}, {"0001-local"}),
    ],
)
def test_one_form_of_a_problem_is_run(
    entry: dict[str, Any], wanted: set[str], tmp_path: Path
) -> None:
    folder = tmp_path / "scene"
    folder.mkdir()
    for seed, name in enumerate(("0001-global", "0001-local", "0002-local", "other")):
        fclib.write(folder / f"{name}.hdf5", planted_local(seed).problem)
    chosen = bench.Campaign.of({"solvers": ["nsgs"], "problems": [entry]}, tmp_path)
    words: list[str] = []
    jobs = chosen.plan(tell=words.append)
    assert {Path(job.problem.path).stem for job in jobs} == wanted
    left_out = wanted < {"0001-global", "0001-local", "0002-local", "other"} and len(wanted) > 1
    assert [word.startswith("left out: 1 file,") for word in words] == [True] * left_out


# ---- what is asked for


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"solvers": []}, "no list of solvers"),
        ({"solvers": "auto"}, "no list of solvers"),
        ({"solvers": ["nsgss"]}, r"solvers\[0\].*nsgss.*nearest are nsgs, "),
        ({"solvers": [{"name": "nsgs", "options": "relaxation=1"}]}, r"\.options: is no table"),
        ({"solvers": ["nsgs relaxation=-1"]}, "relaxation"),
        ({"solvers": ["nsgs", "nsgs"]}, "two that are called 'nsgs'"),
        ({"solvers": [{"options": {}}]}, "no name"),
        ({"problems": []}, r"no \[\[problems\]\]"),
        ({"problems": [{"family": "x"}]}, "neither files"),
        ({"problems": [{"set": "tiny", "form": "square"}]}, r"problems\[0\]\.form"),
        ({"problems": [{"set": "tiny", "form": "both"}]}, r"'both' is none of global, local"),
        ({"problems": [{"simulate": {}, "form": "both"}]}, r"'both' is none of global, local"),
        ({"problems": [{"planted": {}, "form": "global"}]}, "planted problems are local"),
        ({"budget": "long"}, "budget"),
        ({"problems": [{"files": "a", "colour": "red"}]}, r"problems\[0\]\.colour"),
        ({"problems": [{"planted": {"count": 1}}]}, "no contacts"),
        ({"tolerances": []}, "tolerances: the list is empty"),
        ({"history": "no"}, "history: 'no' is neither true nor false"),
        ({"solvers": [{"name": "nsgs", "optional": 1}]}, r"solvers\[0\]\.optional: 1 is neither"),
        ({"time_limit": 0}, "time_limit: 0 is not a positive number"),
        ({"memory": 0}, "memory: 0 is not a positive number"),
        ({"problems": ["a"]}, r"write \[\[problems\]\]"),
        ({"problems": "a"}, r"write \[\[problems\]\]"),
        ({"problems": [{"planted": {"count": 1, "contacts": "3"}}]}, r"planted\.contacts: '3'"),
        ({"problems": [{"simulate": "Chain"}]}, r"problems\[0\]\.simulate: is no table"),
        (
            {"problems": [{"simulate": {"family": "Chain", "steps": "3"}}]},
            r"simulate\.steps: '3' is no list",
        ),
        ({"tolerance": 1e-8}, "tolerance: is not known here; did you mean tolerances"),
        ({"seed": "a"}, "seed: 'a'"),
        ({"tolerances": [-1]}, "positive"),
        ({"tolerances": [math.inf]}, "tolerances: with an infinite bound"),
        ({"from_history": [math.inf]}, "from_history: with an infinite bound"),
        ({"time_limit": "long"}, "time_limit.*long"),
        ({"repeats": 0}, "repeats"),
        ({"modules": ["absent.py"]}, r"absent\.py"),
    ],
)
def test_a_campaign_that_is_not_understood(changes: dict[str, Any], word: str) -> None:
    with pytest.raises(bench.CampaignError, match=word):
        campaign(**changes)


def test_a_file_with_a_wrong_list_of_problems(tmp_path: Path) -> None:
    (tmp_path / "wrong.toml").write_text('solvers = ["auto"]\nproblems = "data"\n')
    with pytest.raises(bench.CampaignError, match=r"wrong\.toml: problems: write"):
        bench.Campaign.read(tmp_path / "wrong.toml")


def test_scenes_that_are_not_understood() -> None:
    pytest.importorskip("mujoco")
    for recipe, word in (
        ({"family": "Boxes"}, "simulate Boxes: no family"),
        (
            {"family": "BoxesStack", "parameters": {"bocses": 3}},
            "no parameter bocses; it has boxes",
        ),
    ):
        chosen = campaign(problems=[{"simulate": {"steps": [1], **recipe}}])
        with pytest.raises(fclib.OptionError, match=word):
            chosen.plan()


def test_steps_of_a_scene_in_either_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.setenv("FCLIB_CACHE", str(tmp_path))
    group = {"simulate": {"family": "Chain", "steps": [40]}}
    found: dict[str | None, Any] = {}
    for form in (None, "local", "global"):
        chosen = campaign(problems=[{**group, **({"form": form} if form else {})}])
        found[form] = fclib.read(chosen.plan()[0].problem.path)
    assert isinstance(found["global"], fclib.GlobalProblem)
    assert found["global"].contacts is not None
    for form in (None, "local"):
        assert isinstance(found[form], fclib.LocalProblem)
        assert found["global"].condense().q == pytest.approx(found[form].q, abs=1e-12)


def test_solvers_that_may_be_missing() -> None:
    chosen = campaign(solvers=["nsgs", {"name": "elsewhere:best", "optional": True}])
    assert [choice.name for choice in chosen.solvers] == ["nsgs"]
    assert "elsewhere:best" in chosen.missing[0]


def test_solvers_as_texts() -> None:
    (choice,) = campaign(solvers=["nsgs relaxation=1.2 shuffle=once"]).solvers
    assert (choice.name, choice.options) == ("nsgs", {"relaxation": "1.2", "shuffle": "once"})
    (choice,) = campaign(solvers=["cmd:true {input} a=b"]).solvers
    assert (choice.name, choice.options) == ("cmd:true {input} a=b", {})
    with pytest.raises(bench.CampaignError, match="'relaxation' is not of the form name=value"):
        campaign(solvers=["nsgs relaxation"])


def test_groups_have_limits_of_their_own() -> None:
    chosen = campaign(
        time_limit=3.0,
        problems=[
            {"files": "a"},
            {"files": "b", "time_limit": 7, "memory": 50, "tolerances": [1e-2]},
        ],
    )
    assert [group.limits.time for group in chosen.groups] == [3, 7]
    assert [group.limits.wall for group in chosen.groups] == [3, 7]
    assert [group.limits.memory for group in chosen.groups] == [4000, 50]
    assert [group.tolerances for group in chosen.groups] == [(1e-4, 1e-8), (1e-2,)]


def test_files_folders_and_globs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(6):
        folder = tmp_path / "deep" / f"family{number % 2}"
        folder.mkdir(parents=True, exist_ok=True)
        fclib.write(folder / f"{number}.hdf5", planted_local(number, nc=2).problem)
    monkeypatch.setenv("WHERE", str(tmp_path / "deep"))
    for files, expected in (
        ("$WHERE", "024135"),
        ("$WHERE/family1", "135"),
        ("$WHERE/*/[0-2].hdf5", "021"),
        (["$WHERE/family0/4.hdf5", "$WHERE/family0"], "402"),
    ):
        entries = {"files": files}
        plan = campaign(solvers=["nsgs"], tolerances=[1e-4], problems=[entries]).plan()
        # a file that is called by a number is named with its folder
        names = [job.problem.name for job in plan]
        assert sorted(names) == sorted(f"family{int(k) % 2}/{k}" for k in expected)
        assert all(job.problem.name.startswith(f"{job.problem.family}/") for job in plan)
    sampled = campaign(solvers=["nsgs"], problems=[{"files": "$WHERE", "sample": 3}]).plan()
    assert {job.problem.name[-1] for job in sampled} == {"0", "4", "5"}
    with pytest.raises(fclib.FileError, match="absent"):
        campaign(problems=[{"files": "$WHERE/absent"}]).plan()


def test_a_campaign_by_flags(tmp_path: Path) -> None:
    fclib.write(tmp_path / "one.hdf5", planted_local(3).problem)
    path = tmp_path / "store.sqlite"
    run_cli(
        *("--problems", tmp_path / "*.hdf5", "--solver", "nsgs", "--solver", "nsgs relaxation=1.1"),
        *("--tol", "1e-4", "--tol", "1e-6", "--time-limit", "5", "--store", path),
    )
    with bench.Store(path) as store:
        rows = store.results()
    assert len(rows) == 4
    assert {row["time_limit"] for row in rows} == {5}
    run_cli("--problems", tmp_path, code=2)
    run_cli("nowhere.toml", code=2)


def test_the_published_campaigns_are_understood(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = sorted((root / "campaigns").glob("*.toml"))
    assert "quick" in [path.stem for path in paths]
    for path in paths:
        read = bench.Campaign.read(path)
        assert read.title
        assert bench.Campaign.read(path.stem).solvers == read.solvers
    assert len(bench.Campaign.read("quick").solvers) >= 12
