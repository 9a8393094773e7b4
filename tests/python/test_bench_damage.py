"""Stores of which bits were flipped: a row that is read is as it was written, or it is left out."""

from __future__ import annotations

import os
import random
import shutil
import sqlite3
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import helpers_cli
from fclib import bench
from fclib.bench.job import Record
from fclib.bench.store import DamagedError, DamageWarning

FLIPPED = int(os.environ.get("FCLIB_TEST_FLIPPED", "150"))
OF_RUNS = ("campaigns", "problems", "solvers", "machines", "runs")


def campaign(**changes: Any) -> bench.Campaign:
    entries: dict[str, Any] = {
        "name": "small",
        "solvers": ["nsgs", "auto", {"name": "nsgs", "options": {"relaxation": 1.2}}],
        "tolerances": [1e-4, 1e-8],
        "history": True,
        "problems": [{"planted": {"count": 3, "contacts": 5, "seed": 1}, "family": "planted"}],
    }
    return bench.Campaign.of(entries | changes)


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FCLIB_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store in one file, with runs, histories, solutions and certificates."""
    folder = tmp_path_factory.mktemp("whole")
    made = folder / "made.sqlite"
    bench.run_campaign(campaign(), made, jobs=2)
    path = folder / "whole.sqlite"
    draw = np.random.default_rng(1)
    with bench.Store(made) as store:
        number = store.begin("steps", "", 18, 0, "here")
        for job in campaign(name="steps", tolerances=[1e-6, 1e-7]).plan():
            record = Record("converged", "a word", iterations=3, cpu_s=0.5, machine={"node": "x"})
            record.solution = {name: draw.normal(size=15).tobytes() for name in ("u", "r")}
            record.certificate = '{"y": {"1": "2/3"}}'
            store.add(job, record, number)
        store.fault(job, Record("lost", "a machine"), number)
        store.db.execute("VACUUM INTO ?", (str(path),))
    return path


def content(store: bench.Store) -> dict[str, dict[str, Any]]:
    """All that a store tells of each run, by its key; numbers of rows are not the run's."""
    found = {}
    for row in store.results():
        run = row.pop("run")
        row["certificate"] = store.certificate(run)
        row["solution"] = {name: x.tobytes() for name, x in store.solution(run).items()}
        row["history"] = store.history(run)
        assert row["key"] not in found
        found[row["key"]] = row
    return found


def check(store: bench.Store, right: dict[str, dict[str, Any]]) -> int:
    """All rows of a store are those of another one, though parts of them may be left out."""
    there = content(store)
    for key, row in there.items():
        for name, value in row.items():
            if name == "history":
                assert [report for report in right[key][name] if report in value] == value
            else:
                assert value == right[key][name] or (
                    name in ("solution", "certificate") and not value
                ), name
    return len(there)


def flipped(data: bytes, seed: int) -> bytes:
    """With one to eight bits flipped, at random places or near to each other."""
    draw = random.Random(seed)
    new = bytearray(data)
    first = draw.randrange(8 * len(data))
    places = [first] + [
        (first + draw.randrange(400)) if seed % 2 else draw.randrange(8 * len(data))
        for _ in range(draw.randrange(8))
    ]
    for place in places:
        new[place // 8 % len(data)] ^= 1 << place % 8
    return bytes(new)


def test_no_wrong_row_of_a_flipped_store_is_read_or_saved(whole: Path, tmp_path: Path) -> None:
    data = whole.read_bytes()
    with bench.Store(whole) as store:
        right = content(store)
    assert len(right) == 36
    kept, refused = [], 0
    for seed in range(FLIPPED):
        path = tmp_path / f"{seed}.sqlite"
        path.write_bytes(flipped(data, seed))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DamageWarning)
            try:
                with bench.Store(path, create=False) as store:
                    kept.append(check(store, right))
                    store.status()
                    store.faults()
                    store.texts()
                    store.export(tmp_path / "runs.csv")
            except bench.StoreError:
                refused += 1
            path.write_bytes(flipped(data, seed))
            with bench.Store(tmp_path / f"saved-{seed}.sqlite") as saved:
                try:
                    assert saved.merge([path]) == check(saved, right)
                except bench.StoreError:
                    refused += 1
        for name in (f"{seed}", f"saved-{seed}"):
            for file in tmp_path.glob(f"{name}.sqlite*"):
                file.unlink()
    # most of the stores can be read, and most of their runs
    assert len(kept) > FLIPPED / 2
    assert sum(kept) > len(kept) * len(right) * 3 / 4


@pytest.mark.parametrize("table", OF_RUNS)
def test_a_damaged_row_is_named_and_left_out(table: str, whole: Path, tmp_path: Path) -> None:
    path = tmp_path / "one.sqlite"
    path.write_bytes(whole.read_bytes())
    with bench.Store(path) as store:
        right = content(store)
        name = {"runs": "status", "machines": "cpu"}.get(table, "name")
        row = 2 if table != "machines" else 1
        store.db.execute(f"UPDATE {table} SET {name} = 'converger' WHERE rowid = {row}")
        with pytest.warns(DamageWarning, match=rf"one\.sqlite: row {row} of {table} is damaged"):
            assert check(store, right) < len(right)
    done = helpers_cli.run("bench", "export", path, tmp_path / "runs.csv")
    assert f"row {row} of {table} is damaged" in " ".join(done.stderr.split())
    assert ".py" not in done.stderr


@pytest.mark.parametrize("table", [*OF_RUNS, "files"])
def test_what_was_damaged_is_run_again(table: str, whole: Path, tmp_path: Path) -> None:
    path = tmp_path / "one.sqlite"
    path.write_bytes(whole.read_bytes())
    with bench.Store(path) as store:
        right = content(store)
        name = {"runs": "error", "machines": "cpu", "files": "problem"}
        store.db.execute(f"UPDATE {table} SET {name.get(table, 'name')} = 2.5 WHERE rowid = 1")
    with pytest.warns(DamageWarning, match=f"of {table} is damaged"):
        progress = bench.run_campaign(campaign(), path)
    assert progress.done == 18
    again = sum(progress.statuses.values())
    assert again == {
        "runs": 1, "problems": 6, "solvers": 6, "machines": 18, "campaigns": 18
    }.get(table, 0)  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with bench.Store(path) as store:
            # each run of the campaign is there, once
            keys = [job.key for job in campaign().plan()]
            assert set(keys) <= set(content(store))
            assert store.db.execute("PRAGMA integrity_check").fetchone() == ("ok",)
            assert check(store, right | {k: content(store)[k] for k in keys}) > 0


def test_an_index_that_is_damaged_repeats_no_run(whole: Path, tmp_path: Path) -> None:
    """Bits of the keys in the index of runs: rows are read from the table."""
    path = tmp_path / "one.sqlite"
    data = bytearray(whole.read_bytes())
    with bench.Store(whole) as store:
        right = content(store)
        key = min(right).encode()
    first = data.find(key)
    second = data.find(key, first + 1)
    while second >= 0:
        last, second = second, data.find(key, second + 1)
    # of the table and of the index; whichever is the index has one bit flipped
    for place in (first, last):
        own = bytearray(data)
        own[place] ^= 1
        path.write_bytes(own)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DamageWarning)
            bench.run_campaign(campaign(), path)
            with bench.Store(path) as store:
                there = [row["key"] for row in store.results()]
                assert len(there) == len(set(there))
                assert set(there) >= {job.key for job in campaign().plan()}
        for file in tmp_path.glob("one.sqlite*"):
            file.unlink()


def test_a_store_that_only_claims_to_be_old(whole: Path, tmp_path: Path) -> None:
    path = tmp_path / "one.sqlite"
    path.write_bytes(whole.read_bytes())
    database = sqlite3.connect(path)
    database.execute("UPDATE runs SET error = 0 WHERE id = 3")
    database.execute("PRAGMA user_version = 4")
    database.commit()
    database.close()
    with pytest.raises(DamagedError, match="35 of its runs can be read"):
        bench.Store(path)


def writes_between(
    store: bench.Store, other: bench.Store, name: str, monkeypatch: pytest.MonkeyPatch
) -> list[str]:
    """After each read of a store by `name`, another process stores a run of a new problem."""
    jobs = iter(campaign(name="late", tolerances=[1e-5]).plan())
    read, keys = getattr(store, name), []

    def then_write(*values: Any) -> Any:
        found = read(*values)
        found = found if isinstance(found, dict) else iter(list(found))
        if (job := next(jobs, None)) is not None:
            late = replace(job, problem=replace(job.problem, name="late", hash=job.key))
            other.add(late, Record("converged"))
            keys.append(late.key)
        return found

    monkeypatch.setattr(store, name, then_write)
    return keys


def test_a_reader_beside_a_writer_finds_no_damage(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "shared.sqlite"
    shutil.copy(whole, path)
    with bench.Store(path) as store, bench.Store(path) as other, warnings.catch_warnings():
        warnings.simplefilter("error", DamageWarning)
        before = len(store.table())
        keys = writes_between(store, other, "_by_number", monkeypatch)
        assert len(store.table()) == before
        assert keys
        store.faults()


def test_mending_beside_a_writer_removes_no_run(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "shared.sqlite"
    shutil.copy(whole, path)
    with bench.Store(path) as store, bench.Store(path) as other, warnings.catch_warnings():
        warnings.simplefilter("error", DamageWarning)
        keys = writes_between(store, other, "_right", monkeypatch)
        assert store.mend() == 0
        assert len(keys) > 3
        assert set(keys) <= other.keys()
