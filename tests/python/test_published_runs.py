"""Published runs: packed and read back, checked, and put beside a store of another machine."""

from __future__ import annotations

import hashlib
import json
import math
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import bench
from fclib.bench import calibration, generated, machine
from fclib.bench.calibration import Calibration, calibration_in, ratio_of
from fclib.bench.comparison import odds
from fclib.bench.job import Job, Record

pytest.importorskip("pyarrow")

from fclib import results
from fclib.results.beside import replaced
from fclib.results.shards import DIGITS
from helpers_cli import invoke
from workshop.tables import two_machines

PLAN = {
    "name": "small",
    "solvers": ["nsgs", "apgd"],
    "tolerances": [1e-4, 1e-8],
    "problems": [{"planted": {"count": 4, "contacts": 5, "seed": 1}, "family": "planted"}],
}
SECONDS = {f"solve {k}": 1e-3 * 2**k for k in range(6)}
PINNED = {"nsgs": [7, 11, 14, 15], "apgd": [20, 29, 51, 58]}  # iterations
CALIBRATED = Calibration(calibration.VERSION, "2026-01-01", 0.1, SECONDS, 0.01)


def facts(node: str, speed: float | None) -> dict[str, Any]:
    """The facts of a machine that is so much slower than CALIBRATED; None: not calibrated."""
    own: dict[str, Any] = {"node": node, "cpu": "some processor", "cores": 2, "memory_gb": 8.0}
    if speed is not None:
        seconds = {name: speed * value for name, value in SECONDS.items()}
        own["calibration"] = replace(CALIBRATED, seconds=seconds).record()
    return own


def store(
    path: Path, own: dict[str, Any], solvers: list[str], cpu: float = 0.01, version: str = ""
) -> Path:
    """A store of runs that were not run; those of a named version are of a later day."""

    def of_version(job: Job) -> Job:
        return replace(job, solver=replace(job.solver, version=version)) if version else job

    campaign = bench.Campaign.of({**PLAN, "solvers": solvers})
    with bench.Store(path) as opened:
        number = opened.begin("small", "text", 1, 0, own["node"])
        runs: list[tuple[Job, Record]] = [
            (
                of_version(job),
                Record(
                    "converged",
                    "",
                    iterations=7,
                    cpu_s=cpu,
                    wall_s=cpu,
                    total_cpu_s=cpu,
                    merits={"error": job.tol / 2, "natural": job.tol / 3},
                    machine=own,
                    history=[(0, 1.0, 0.0, ""), (7, job.tol / 2, cpu, "newton")],
                    started=1.8e9 if version else 1.7e9,
                ),
            )
            for job in campaign.plan()
        ]
        opened.add_all(runs, number)
        opened.alive(number, ended=True)
    return path


def packed(tmp_path: Path, node: str = "theirs", speed: float | None = 2.0, **more: Any) -> Path:
    """The published runs of another machine."""
    path = store(tmp_path / "theirs.sqlite", facts(node, speed), ["nsgs", "apgd"], **more)
    with bench.Store(path) as opened:
        found = results.pack(opened, tmp_path / "parts", "small", "fast")
    assert found is not None
    return found


# ---- a part


def test_a_part_holds_the_runs_and_no_name_of_the_machine(tmp_path: Path) -> None:
    part = packed(tmp_path, node="secret-host")
    assert results.verify(part) == []
    (found,) = results.shards(tmp_path / "parts")
    assert (found.name, found.runs, list(found.machines)) == ("small", 16, ["fast"])
    assert found.digest in part.name
    assert [one["name"] for one in found.campaigns] == ["small"]
    rows = list(results.rows_of(part))
    assert {row["solver"] for row in rows} == {"nsgs", "apgd"}
    assert all(row["history"][1]["stage"] == "newton" for row in rows)
    assert b"secret-host" not in part.read_bytes()
    assert str(tmp_path).encode() not in part.read_bytes()
    assert "secret-host" not in json.dumps([rows, dict(found.machines)])


def test_what_is_packed_comes_back(tmp_path: Path) -> None:
    part = packed(tmp_path)
    (own,) = results.shards(tmp_path / "parts")
    with (
        bench.Store(tmp_path / "back.sqlite") as back,
        bench.Store(tmp_path / "theirs.sqlite") as old,
    ):
        assert back.add_rows(results.rows_of(part), own.machines) == 16
        assert back.add_rows(results.rows_of(part), own.machines) == 0
        hidden = {"run", "campaign", "machine", "node", "message"}
        first, second = (
            sorted(
                json.dumps({k: v for k, v in row.items() if k not in hidden}, sort_keys=True)
                for row in one.table(more=("key", "message", "stages"))
            )
            for one in (old, back)
        )
        assert first == second
        for first_report, second_report in zip(back.history(1), old.history(1), strict=True):
            assert first_report[::3] == second_report[::3]
            assert first_report[1:3] == pytest.approx(second_report[1:3], rel=1e-6)
        assert back.mend() == 0


def test_a_part_is_never_written_twice(tmp_path: Path) -> None:
    first = packed(tmp_path)
    before = first.read_bytes()
    with bench.Store(tmp_path / "theirs.sqlite") as opened:
        there = results.shards(tmp_path / "parts")
        assert results.pack(opened, tmp_path / "parts", "small", "fast", there) is None
    store(tmp_path / "theirs.sqlite", facts("theirs", 2.0), ["ppa-nsn"])
    with bench.Store(tmp_path / "theirs.sqlite") as opened:
        second = results.pack(opened, tmp_path / "parts", "small", "fast", there)
    assert second is not None
    assert second != first
    assert first.read_bytes() == before
    assert {row["solver"] for row in results.rows_of(second)} == {"ppa-nsn"}


def test_a_campaign_goes_on_from_published_runs(tmp_path: Path) -> None:
    """No published run is done again or packed again, and its machine keeps its name."""
    packed(tmp_path)
    parts = tmp_path / "parts"
    words = ["results", "unpack", str(tmp_path / "mine.sqlite"), "--in", str(parts)]
    done = invoke(*words, "--name", "small")
    assert "16 runs are new" in done.output
    more = bench.Campaign.of({**PLAN, "solvers": ["nsgs", "apgd", "ppa-nsn"]})
    progress = bench.run_campaign(more, tmp_path / "mine.sqlite")
    assert (progress.skipped, sum(progress.statuses.values())) == (16, 8)
    with bench.Store(tmp_path / "mine.sqlite") as opened:
        found = results.pack(opened, parts, "small", "slow", results.shards(parts))
        assert found is not None
        rows = list(results.rows_of(found))
        assert {(row["solver"], row["node"]) for row in rows} == {("ppa-nsn", "slow")}
        assert list(results.shards(parts)[0].machines) != list(results.shards(parts)[1].machines)
        assert results.pack(opened, parts, "small", "slow", results.shards(parts)) is None
    # a machine may be published under its own host name
    named = store(tmp_path / "named.sqlite", facts("slow", 1.0), ["admm"])
    with bench.Store(named) as opened:
        assert results.pack(opened, parts, "small", "slow", results.shards(parts)) is not None
        assert results.pack(opened, parts, "small", "slow", results.shards(parts)) is None
    wrong = invoke(*words, "--name", "large", code=1)
    assert "large: there is no such part" in wrong.output


def test_a_part_that_was_changed_is_found(tmp_path: Path) -> None:
    part = packed(tmp_path)
    data = bytearray(part.read_bytes())
    data[len(data) // 2] ^= 1
    part.write_bytes(data)
    with pytest.raises(results.ShardError, match=r"the content is|cannot be read"):
        raise results.ShardError(results.verify(part)[0])
    for name, content in (("no.parquet", b"PAR1 and no more PAR1"), ("empty.parquet", b"")):
        other = tmp_path / name
        other.write_bytes(content)
        with pytest.raises(results.ShardError, match="cannot be read"):
            results.verify(other)


def test_rows_that_contradict_themselves_are_found(tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    part = packed(tmp_path)
    table = pq.read_table(part)
    rows = table.to_pylist()
    rows[0]["error"] = 1.0
    rows[1]["solved"] = 0
    rows[2]["cpu_s"] = math.nan
    rows[3] = dict(rows[4])
    # of these the tolerance bounds the natural map alone
    assert rows[5]["status"] == rows[6]["status"] == "converged"
    rows[5] |= {"merit": "natural", "error": 1.0}
    rows[6] |= {"merit": "natural", "natural": 1.0}
    wrong = tmp_path / part.name
    pq.write_table(type(table).from_pylist(rows, schema=table.schema), wrong)
    said = "\n".join(results.verify(wrong))
    for word in ("row 0: is converged", "row 1: has the status", "row 2: cpu_s", "there twice"):
        assert word in said
    assert "row 5" not in said
    assert "row 6: is converged, and its error 1.0" in said


def changed(part: Path, to: Path, changes: dict[str, Any], row: int = 0) -> Path:
    """A part with other entries in a row, under the name of its content."""
    import pyarrow.parquet as pq

    table = pq.read_table(part)
    rows = table.to_pylist()
    rows[row] |= changes
    to.mkdir(exist_ok=True)
    pq.write_table(type(table).from_pylist(rows, schema=table.schema), to / "new")
    digest = hashlib.sha256((to / "new").read_bytes()).hexdigest()[:DIGITS]
    return (to / "new").rename(to / f"small-{digest}.parquet")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"cpu_s": None}, "is solved in None s"),
        ({"cpu_s": 50.0, "total_cpu_s": 50.0}, "is solved in 50.0 s, and its limit is"),
        ({"cpu_s": 0.5}, "more than total_cpu_s"),
        ({"said_cpu_s": -5.0}, "said_cpu_s is -5.0"),
        ({"error": -1.0}, "error is -1.0"),
        ({"solved": 2}, "solved is 2"),
        ({"merit": "foo"}, "merit is 'foo'"),
        ({"start": "hot"}, "start is 'hot'"),
        ({"status": "foo", "solved": 0}, "status is 'foo'"),
        ({"time_limit": None}, "has no time_limit"),
        ({"time_limit": math.inf}, "time_limit is inf"),
        ({"wall_limit": -1.0}, "wall_limit is -1.0"),
        ({"tol": 0.0}, "tol is 0.0"),
        ({"nc": None}, "has no nc"),
        ({"started": None}, "has no started"),
        ({"started": 1e300}, "which is to come"),
        ({"started": math.nan}, "started is nan"),
        ({"solver_name": "mine"}, "which is another solver"),
        ({"status": "infeasible", "key": "another"}, "proven to have no solution"),
        ({"node": "another"}, "is of a machine that the metadata lack"),
    ],
    ids=str,
)
def test_what_no_run_can_be_is_refused(changes: dict[str, Any], said: str, tmp_path: Path) -> None:
    wrong = results.verify(changed(packed(tmp_path), tmp_path / "other", changes))
    assert said in "\n".join(wrong)
    assert len(wrong) == 1


def test_a_run_is_there_once_whatever_its_key_says(tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    part = packed(tmp_path)
    rows = pq.read_table(part).to_pylist()
    again = rows[1] | {"key": "another", "cpu_s": 1e-9}
    said = results.verify(changed(part, tmp_path / "other", again))
    assert said == ["row 1: the run " + rows[1]["key"] + " is there twice"]
    # and so in all parts together
    changed(part, tmp_path / "parts", {"status": "stalled", "solved": 0})
    said_of_all = invoke("results", "verify", "--in", tmp_path / "parts", code=1).output
    assert f"the run {rows[0]['key']} is in small-" in said_of_all


def test_machines_of_one_processor_stay_apart(tmp_path: Path) -> None:
    """Each has times and a calibration of its own."""
    path = store(tmp_path / "both.sqlite", facts("one", 1.0), ["nsgs"])
    store(path, facts("two", 3.0), ["apgd"])
    with bench.Store(path) as opened:
        part = results.pack(opened, tmp_path / "parts", "small")
    assert part is not None
    assert results.verify(part) == []
    (found,) = results.shards(tmp_path / "parts")
    names = {"some processor", "some processor (2)"}
    assert found.machines.keys() == names
    assert {row["node"] for row in results.rows_of(part)} == names
    with results.alone([part]) as joined, bench.Store(joined.path) as opened:
        cpu = {row["solver"]: row["cpu_s"] for row in opened.table()}
    assert max(cpu.values()) / min(cpu.values()) == pytest.approx(3.0)
    # what is published is not published again if another machine joins
    first = store(tmp_path / "grows.sqlite", facts("one", 1.0), ["nsgs"])
    parts = tmp_path / "grown"
    with bench.Store(first) as opened:
        assert results.pack(opened, parts, "small") is not None
    store(first, facts("two", 3.0), ["apgd"])
    with bench.Store(first) as opened:
        more = results.pack(opened, parts, "small", there=results.shards(parts))
    assert more is not None
    assert {(row["solver"], row["node"]) for row in results.rows_of(more)} == {
        ("apgd", "some processor (2)")
    }


def test_runs_of_a_larger_limit_count_on_the_board_and_smaller_ones_are_told(
    tmp_path: Path,
) -> None:
    parts = tmp_path / "parts"
    packed(tmp_path, speed=1.0)  # nsgs and apgd, 10 s
    own = Record(
        "converged", cpu_s=0.02, total_cpu_s=0.02, merits={"error": 0.0, "natural": 0.0},
        machine=facts("theirs", 1.0), started=1.7e9,
    )  # fmt: skip
    for solver, limit in (("bb", 60.0), ("admm", 5.0)):
        plan = {**PLAN, "solvers": [solver], "time_limit": limit, "wall_limit": 7.0 * limit}
        jobs = bench.Campaign.of(plan).plan()
        with bench.Store(tmp_path / f"{solver}.sqlite") as opened:
            slow = replace(own, cpu_s=30.0, total_cpu_s=30.0)
            opened.add_all([(jobs[0], slow if limit > 10 else own), *((j, own) for j in jobs[1:])])
            assert results.pack(opened, parts, "small", "fast") is not None
    told: list[str] = []
    rows = results.leaders(results.shards(parts), told.append)
    solved = {(row["solver"], row["solved"]) for row in rows}
    assert solved == {("nsgs", 4), ("apgd", 4), ("bb", 3), ("bb", 4)}
    why = "they had 5 s or less, and most solvers 10 s"
    assert told == [f"small: left out because {why}: admm"]
    for row in rows:
        low, high = map(float, row["95 % interval"].split(" to "))
        assert low - 0.01 <= row["share"] <= high + 0.01
        # one family, so all problems weigh the same
        assert (low, high) == pytest.approx(odds(row["solved"], row["of"]), abs=0.006)
        assert row["machine"] == "fast"


def test_a_set_that_does_not_compare_does_not_stop_the_others(tmp_path: Path) -> None:
    part = packed(tmp_path)
    changed(part, tmp_path / "parts", {"key": "another", "repeat": 7, "merit": "natural"})
    other = store(tmp_path / "other.sqlite", facts("theirs", 2.0), ["bb"])
    with bench.Store(other) as opened:
        assert results.pack(opened, tmp_path / "parts", "whole", "fast") is not None
    said = invoke("results", "leaders", "--in", tmp_path / "parts", code=1).output
    assert "small: " in said
    assert "whole" in said


@pytest.mark.parametrize("name", ["tol", "solver", "status", "hash", "history", "cpu_s"])
def test_a_part_without_a_column_is_none(name: str, tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    part = packed(tmp_path)
    table = pq.read_table(part)
    other = tmp_path / part.name
    pq.write_table(table.drop_columns([name]), other)
    mine = store(tmp_path / "mine.sqlite", facts("mine", 1.0), ["ppa-nsn"])
    for call in (results.verify, lambda path: list(results.shards(path.parent))):
        with pytest.raises(results.ShardError, match=f"no column '{name}'"):
            call(other)
    with pytest.raises(results.ShardError, match="no column"), results.beside(mine, [other]):
        pass
    place = table.column_names.index(name)
    pq.write_table(table.set_column(place, name, [[[1]] * len(table)]), other)
    with pytest.raises(results.ShardError, match=f"column '{name}': is of type"):
        results.verify(other)
    if name in ("tol", "solver", "status", "hash"):
        kind = table.schema.field(name)
        nothing = pa.array([None] * len(table), kind.type)
        rows = table.set_column(place, kind, nothing)
        pq.write_table(rows.replace_schema_metadata(table.schema.metadata), other)
        assert f"row 0: has no {name}" in results.verify(other)


def test_programs_are_published_without_their_folders(tmp_path: Path) -> None:
    from fclib.results.shards import public_name

    assert public_name("cmd:/home/me/secret/solve --fast {input}") == "cmd:solve"
    assert public_name("plugin:/home/me/libx.so") == "plugin:libx.so"
    assert public_name("siconos:nsgs") == "siconos:nsgs"
    packed(tmp_path)
    (own,) = results.shards(tmp_path / "parts")
    assert all("text" not in one for one in own.campaigns)


# ---- beside


def test_times_come_to_the_scale_of_this_machine(tmp_path: Path) -> None:
    """Theirs is twice as slow: their 10 ms are 5 ms here; what I ran myself stays."""
    part = packed(tmp_path, speed=2.0)
    mine = store(tmp_path / "mine.sqlite", facts("mine", 1.0), ["nsgs"], cpu=0.004)
    with results.beside(mine, [part]) as found:
        assert found.runs == 8  # of apgd; nsgs is there already
        assert found.ratios["fast"].mean == pytest.approx(0.5)
        with bench.Store(found.path, create=False) as opened:
            rows = list(opened.table())
    cpu = {row["solver"]: row["cpu_s"] for row in rows}
    assert cpu == {"nsgs": pytest.approx(0.004), "apgd": pytest.approx(0.005)}
    assert {row["node"] for row in rows} == {"mine"}
    with results.beside(mine, [part], scale=False) as found, bench.Store(found.path) as opened:
        assert max(row["cpu_s"] for row in opened.table()) == pytest.approx(0.01)
    assert not found.path.exists()


def test_a_run_that_would_be_too_slow_here_has_failed(tmp_path: Path) -> None:
    part = packed(tmp_path, speed=1.0, cpu=8.0)  # of 10 s
    mine = store(tmp_path / "mine.sqlite", facts("mine", 2.0), ["ppa-nsn"])
    with results.beside(mine, [part]) as found, bench.Store(found.path) as opened:
        rows = [row for row in opened.table() if row["solver"] == "apgd"]
    assert {(row["status"], row["solved"], row["cpu_s"]) for row in rows} == {
        ("time_limit", 0, 16.0)
    }


def test_what_cannot_be_compared_is_named(tmp_path: Path) -> None:
    part = packed(tmp_path)
    plain = store(tmp_path / "plain.sqlite", facts("mine", None), ["nsgs"])
    with pytest.raises(results.BesideError, match="--calibrate"), results.beside(plain, [part]):
        pass
    mine = store(tmp_path / "mine.sqlite", facts("mine", 1.0), ["nsgs"])
    (tmp_path / "bare").mkdir()
    bare = packed(tmp_path / "bare", speed=None)
    with (
        pytest.raises(results.ShardError, match="fast was not calibrated"),
        results.beside(mine, [bare]),
    ):
        pass
    store(mine, facts("other", 1.0), ["apgd"])
    with pytest.raises(results.BesideError, match="several machines"), results.beside(mine, [part]):
        pass
    with results.beside(mine, [part], "mine") as found:
        assert found.runs > 0


def test_the_interval_of_a_ratio_covers_that_of_another_solver() -> None:
    """Noise of 5 % in each solve: the interval has a further one in 90 to 99 of 100 cases."""
    rng = np.random.default_rng(0)
    covered = 0
    for _ in range(400):
        noisy = [
            {name: value * speed * math.exp(rng.normal(0, 0.05)) for name, value in SECONDS.items()}
            for speed in (3.0, 1.0)
        ]
        found = ratio_of(*(replace(CALIBRATED, seconds=own) for own in noisy))
        another = 3.0 * math.exp(rng.normal(0, 0.05) - rng.normal(0, 0.05))
        covered += found.low <= another <= found.high
    assert 360 <= covered <= 396
    with pytest.raises(ValueError, match="do not compare"):
        ratio_of(CALIBRATED, replace(CALIBRATED, version=0))


@pytest.mark.parametrize(("slower", "within"), [(3.0, "yes"), (3.5, "no")])
def test_two_machines_are_compared_solver_by_solver(
    slower: float, within: str, tmp_path: Path
) -> None:
    """By its calibration the second machine is three times slower, by each solve the same."""
    solvers = ["nsgs", "apgd"]
    first = store(tmp_path / "a.sqlite", facts("a", 1.0), solvers)
    second = store(tmp_path / "b.sqlite", facts("b", 3.0), solvers, cpu=0.01 * slower)
    ratio = ratio_of(*map(two_machines.calibration_of, (second, first)))
    near = replace(ratio, low=2.9, high=3.1)
    times = [two_machines.times_of(path) for path in (first, second)]
    rows = two_machines.rows_of(times[0], times[1], near, 0.001)
    assert sorted(row["solver"] for row in rows) == sorted(solvers)
    assert {row["within"] for row in rows} == {within}
    assert {row["times, B over A"] for row in rows} == {f"{slower:.3g}"}
    assert two_machines.rows_of(times[0], times[1], near, 0.02) == []  # too short in A
    bare = store(tmp_path / "bare.sqlite", facts("a", None), solvers)
    with pytest.raises(SystemExit, match="has 0 calibrations"):
        two_machines.calibration_of(bare)


@pytest.mark.parametrize(
    "known",
    [
        {},
        {"calibration": 3},
        {"calibration": {"seconds": {}}},
        {"calibration": {"seconds": {"a": 0}}},
    ],
)
def test_facts_without_a_calibration_have_none(known: dict[str, Any]) -> None:
    assert calibration_in(known) is None


def test_solves_whose_code_changed_do_not_count() -> None:
    earlier = {"nsip, 3 contacts": 9.0, "nsn-ac, 3 contacts": 9.0, "nsgs, 3 contacts": 1.0}
    found = calibration_in({"calibration": replace(CALIBRATED, seconds=earlier).record()})
    assert found is not None
    assert found.seconds == {"nsgs, 3 contacts": 1.0}


def test_a_calibration_does_the_work_that_it_has_always_done() -> None:
    """If this fails, `calibration.VERSION` must change: other work takes another time."""
    problems = [generated.plant(size, 3, 1) for size in calibration.SIZES]
    assert {
        solver: [fclib.solve(one, solver, tol=calibration.TOLERANCE).iterations for one in problems]
        for solver in calibration.SOLVERS
    } == PINNED


# ---- the commands


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("FCLIB_CACHE", str(tmp_path / "cache"))
    machine.facts.cache_clear()
    yield tmp_path / "cache"
    machine.facts.cache_clear()


def test_this_machine_is_calibrated_once(own_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibration, "SECONDS", 0.1)
    monkeypatch.setattr(calibration, "SIZES", (3, 30))
    assert "calibration" not in machine.facts()
    found = calibration.calibrate(0.1)
    path = calibration.save(found)
    assert path.parent == own_cache
    assert calibration_in(machine.facts()) == found
    assert ratio_of(found, found).mean == 1
    path.write_text("no JSON")
    machine.facts.cache_clear()
    assert calibration_in(machine.facts()) is None


def test_the_commands(tmp_path: Path) -> None:
    store(tmp_path / "theirs.sqlite", facts("theirs", 2.0), ["nsgs", "apgd"])
    mine = store(tmp_path / "mine.sqlite", facts("mine", 1.0), ["ppa-nsn"])
    parts = tmp_path / "parts"

    def said(*words: object, code: int = 0) -> str:
        return str(invoke(*words, code=code).output)

    options = ("--name", "small", "--in", parts, "--machine", "fast")
    part = said("results", "pack", tmp_path / "theirs.sqlite", *options).strip()
    assert "there is no new run" in said("results", "pack", tmp_path / "theirs.sqlite", *options)
    assert "fast" in said("results", "list", "--in", parts)
    shown = [
        json.loads(line) for line in said("results", "show", "--in", parts, "--json").splitlines()
    ]
    assert [(row["solver"], row["tol"], row["solved"]) for row in shown] == [
        *(("apgd", tol, 4) for tol in (1e-8, 1e-4)),
        *(("nsgs", tol, 4) for tol in (1e-8, 1e-4)),
    ]
    assert "ok" in said("results", "verify", "--in", parts)
    text = said("profile", mine, "--with", part)
    assert "16 published runs; times of fast x 0.5" in " ".join(text.split())
    for name in ("nsgs", "apgd", "ppa-nsn"):
        assert name in text
    assert "nsgs" not in said("profile", mine)
    assert "--calibrate" in said(
        "profile",
        store(tmp_path / "bare.sqlite", facts("b", None), ["nsgs"]),
        "--with",
        part,
        code=1,
    )
    shutil.rmtree(parts)
    parts.mkdir()
    assert "no part" in said("results", "verify", "--in", parts, code=1)
    for word in ("list", "show", "leaders"):
        told = said("results", word, "--in", parts, code=1)
        assert "".join(f"fclib: {parts}: has no part, *.parquet".split()) in "".join(told.split())
        told = said("results", word, "--in", part, code=1)
        assert "".join(f"fclib: {part}: is no folder of parts".split()) in "".join(told.split())


def test_a_long_history_is_thinned_and_keeps_its_ends() -> None:
    from fclib.results.shards import REPORTS, thinned

    found = thinned([(k, 1.0 / (k + 1), 0.1 * k, "") for k in range(10_000)])
    assert (found[0]["iteration"], found[-1]["iteration"]) == (0, 9999)
    assert REPORTS / 2 < len(found) <= REPORTS + 2
    assert found[-1]["error"] == pytest.approx(1e-4)
    assert len(thinned([(1, 1.0, 0.0, "")])) == 1
    assert thinned([]) == []


def test_published_runs_count_under_a_smaller_limit(tmp_path: Path) -> None:
    """Theirs is 10 s, mine is 1 s: what took 2 s has failed, and what took less is solved."""
    part = packed(tmp_path, speed=1.0, cpu=2.0)
    plan = {**PLAN, "solvers": ["ppa-nsn"], "time_limit": 1.0}
    own = Record("converged", cpu_s=0.1, merits={"error": 0.0}, machine=facts("mine", 1.0))
    mine = tmp_path / "mine.sqlite"
    with bench.Store(mine) as opened:
        opened.add_all([(job, own) for job in bench.Campaign.of(plan).plan()])
    with results.beside(mine, [part]) as found, bench.Store(found.path) as opened:
        rows = [row for row in opened.table() if row["solver"] != "ppa-nsn"]
    assert {(row["status"], row["time_limit"]) for row in rows} == {("time_limit", 1.0)}
    assert len(rows) == 16
    # what I have run myself is not taken from others
    again = {**plan, "solvers": ["nsgs", "ppa-nsn"]}
    with bench.Store(tmp_path / "both.sqlite") as opened:
        opened.add_all([(job, own) for job in bench.Campaign.of(again).plan()])
    with results.beside(tmp_path / "both.sqlite", [part]) as found:
        with bench.Store(found.path) as opened:
            cpu = {row["cpu_s"] for row in opened.table() if row["solver"] == "nsgs"}
        assert cpu == {0.1}
    # mine is 100 s: 10 s count for all, and mine took longer on one problem
    larger = {**plan, "time_limit": 100.0}
    slow = replace(own, cpu_s=50.0)
    with bench.Store(tmp_path / "larger.sqlite") as opened:
        jobs = bench.Campaign.of(larger).plan()
        opened.add_all([(jobs[0], slow), *((job, own) for job in jobs[1:])])
    with (
        results.beside(tmp_path / "larger.sqlite", [part]) as found,
        bench.Store(found.path) as opened,
    ):
        assert "own runs under the smaller limit" in str(found)
        assert found.lowered == len(jobs)
        rows = list(opened.table())
        assert opened.faults() == []
    assert {row["time_limit"] for row in rows} == {10.0}
    mine_now = [row["status"] for row in rows if row["solver"] == "ppa-nsn"]
    assert mine_now.count("time_limit") == 1
    assert mine_now.count("converged") == len(jobs) - 1
    assert len(rows) == len(jobs) + 16


@pytest.mark.parametrize(("name", "label"), [("slow", "slow"), ("fast", "fast (2)")])
def test_published_runs_are_on_one_scale(tmp_path: Path, name: str, label: str) -> None:
    """Processors give machines their published names: another machine may have the same one."""
    part = packed(tmp_path, speed=2.0)
    (tmp_path / "more").mkdir()
    slow = store(tmp_path / "more" / "slow.sqlite", facts("slow", 4.0), ["ppa-nsn"])
    with bench.Store(slow) as opened:
        other = results.pack(opened, tmp_path / "parts", "small", name)
    assert other is not None
    with results.alone([part, other]) as found, bench.Store(found.path) as opened:
        cpu = {row["solver"]: row["cpu_s"] for row in opened.table()}
        assert {row["node"] for row in opened.table()} == {"fast"}
    assert cpu == {
        "nsgs": pytest.approx(0.01),
        "apgd": pytest.approx(0.01),
        "ppa-nsn": pytest.approx(0.005),
    }
    assert {one: ratio.mean for one, ratio in found.ratios.items()} == {label: pytest.approx(0.5)}
    mine = store(tmp_path / "mine.sqlite", facts("here", 1.0), ["bb"])
    with results.beside(mine, [part, other]) as found, bench.Store(found.path) as opened:
        cpu = {row["solver"]: row["cpu_s"] for row in opened.table()}
    assert label in found.ratios
    assert (cpu["nsgs"], cpu["ppa-nsn"]) == (pytest.approx(0.005), pytest.approx(0.0025))
    with pytest.raises(results.ShardError, match="no runs"), results.alone([]):
        pass


def test_a_version_is_left_out_if_another_one_has_run_the_same() -> None:
    def rows(solver: str, version: str, day: float, count: int, limit: float = 10.0) -> list[Any]:
        same = {"merit": "both", "start": "cold", "sequence": "", "step": 0, "threads": 1}
        own = {"solver": solver, "options": "{}", "version": version, "memory_limit": 8e3}
        own |= {"started": day}
        return [
            {**same, **own, "hash": str(k), "tol": 1e-8, "time_limit": limit} for k in range(count)
        ]

    def named(*versions: str) -> set[Any]:
        return {("auto", "{}", version, 8e3) for version in versions}

    old = rows("auto", "1", 1.0, 3)
    others = rows("nsgs", "1", 5.0, 9) + rows("auto", "other", 2.0, 9)[5:]
    assert replaced(old + others) == set()
    assert replaced(old + others + rows("auto", "2", 3.0, 3)) == named("1")
    assert replaced(old + rows("auto", "2", 3.0, 2)) == named("2")  # it has run less
    assert replaced(old + rows("auto", "2", 3.0, 4)[1:]) == set()  # each has a run of its own
    assert replaced(old + rows("auto", "2", 3.0, 3, limit=1.0)) == set()
    assert replaced(old + rows("auto", "2", 0.5, 4)) == named("1")
    three = old + rows("auto", "2", 3.0, 3) + rows("auto", "3", 4.0, 4)
    assert replaced(three) == named("1", "2")


def test_a_comparison_shows_the_newest_version_that_has_run_all(tmp_path: Path) -> None:
    part = packed(tmp_path)
    newer = store(tmp_path / "newer.sqlite", facts("theirs", 2.0), ["nsgs"], version="newer")
    with bench.Store(newer) as opened:
        later = results.pack(opened, tmp_path / "parts", "small", "fast")
    assert later is not None
    with results.alone([part, later]) as found, bench.Store(found.path) as opened:
        shown = {(row["solver"], row["version"] == "newer") for row in opened.table()}
    assert shown == {("nsgs", True), ("apgd", False)}
    mine = store(tmp_path / "mine.sqlite", facts("here", 1.0), ["ppa-nsn"])
    with results.beside(mine, [part, later]) as found, bench.Store(found.path) as opened:
        shown = {(row["solver"], row["version"] == "newer") for row in opened.table()}
    assert shown == {("nsgs", True), ("apgd", False), ("ppa-nsn", False)}


def test_a_solver_of_a_file_is_run_beside_published_ones(
    tmp_path: Path, own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`fclib bench CAMPAIGN --solver mine.py --with PART`: mine alone is run."""
    (tmp_path / "walk_mine.py").write_text(
        "import fclib\n\n\n@fclib.solver('walk-mine')\n"
        "def solve(problem, r, monitor):\n    r[:] = fclib.solve(problem, 'nsgs').solution.r\n"
        "    monitor.stop(r)\n"
    )
    campaign = tmp_path / "small.toml"
    campaign.write_text(
        'solvers = ["nsgs", "apgd"]\ntolerances = [1e-4]\n[[problems]]\nfamily = "planted"\n'
        "planted = { count = 4, contacts = 5, seed = 1 }\n"
    )
    part = packed(tmp_path)
    calibration.save(CALIBRATED)
    words = [
        *("bench", str(campaign), "--solver", str(tmp_path / "walk_mine.py")),
        *("--with", str(part), "--store", str(tmp_path / "mine.sqlite")),
    ]
    done = invoke(*words)
    assert "8 published runs" in " ".join(done.output.split())
    with bench.Store(tmp_path / "mine.sqlite") as opened:
        assert {row["solver"] for row in opened.table()} == {"walk-mine"}
    for name in ("nsgs", "apgd", "walk-mine"):
        assert name in done.output
    invoke("bench", campaign, "--with", part, code=2)
