"""Profiles: equal to what is worked out by hand, and to an independent implementation."""

from __future__ import annotations

import csv
import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fclib import bench
from fclib.bench import profiles
from fclib.bench.job import MERITS, Job, ProblemFacts, Record

# CPU times of three solvers on four problems; None: failed
TIMES: dict[str, list[float | None]] = {
    "A": [1.0, 2.0, 4.0, None],
    "B": [2.0, 1.0, None, None],
    "C": [4.0, 8.0, 1.0, None],
}
CONTACTS = [1, 10, 100, 1000]
LIMIT = 100.0


def fill(
    path: Path,
    times: dict[str, list[float | None]] = TIMES,
    tol: float = 1e-6,
    repeat: int = 0,
    node: str = "here",
) -> None:
    """A store, made by hand."""
    with bench.Store(path) as store:
        number = store.begin("hand", 'name = "hand"', 12, 0, node)
        for solver, own in times.items():
            for k, time in enumerate(own):
                problem = ProblemFacts(
                    hash=f"hash{k}",
                    name=f"problem{k}",
                    family="few" if k < 2 else "many",
                    path="",
                    kind="local",
                    formulation="local 3D",
                    spacedim=3,
                    n=0,
                    p=0,
                    nc=CONTACTS[k],
                    nnz=9,
                    title="",
                )
                job = Job(
                    problem,
                    bench.SolverChoice(solver, {}),
                    tol,
                    bench.Limits(LIMIT, LIMIT, 1000),
                    repeat,
                    1,
                )
                error = 0.5 * tol if time else 1.0
                record = Record(
                    status="converged" if time else "cpu_limit",
                    iterations=round(10 * time) if time else None,
                    cpu_s=time,
                    wall_s=time,
                    merits=dict.fromkeys(MERITS, error),
                    machine={"node": node},
                    history=[(0, 1.0, 0.0, ""), (1, error, time, "")] if time else None,
                )
                assert store.add(job, record, number)


@pytest.fixture
def store(tmp_path: Path) -> Path:
    fill(tmp_path / "hand.sqlite")
    return tmp_path / "hand.sqlite"


def run_cli(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "fclib", "profile", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True)


# ---- by hand


def test_the_performance_profile_by_hand(store: Path) -> None:
    costs = profiles.costs(profiles.load(store))
    assert costs.solvers == ("A", "B", "C")
    inf = math.inf
    # the best are A, B, C and nobody
    expected = [[1, 2, 4], [2, 1, 8], [4, inf, 1], [inf, inf, inf]]
    np.testing.assert_array_equal(profiles.ratios(costs.values), expected)
    shares = profiles.performance_profile(costs.values, np.array([1, 1.99, 2, 4, 8, 1e300]))
    np.testing.assert_array_equal(
        shares,
        [
            [0.25, 0.25, 0.5, 0.75, 0.75, 0.75],
            [0.25, 0.25, 0.5, 0.5, 0.5, 0.5],
            [0.25, 0.25, 0.25, 0.5, 0.75, 0.75],
        ],
    )


def test_data_profiles_by_hand(store: Path) -> None:
    costs = profiles.costs(profiles.load(store))
    shares = profiles.share_within(costs.values, np.array([0.5, 1, 2, 4, 100]))
    np.testing.assert_array_equal(shares[0], [0, 0.25, 0.5, 0.75, 0.75])
    # times of A by contact: 1, 0.2, 0.04, inf
    shares = profiles.share_within(costs.per_contact().values, np.array([0.04, 0.2, 1]))
    np.testing.assert_array_equal(shares[0], [0.25, 0.5, 0.75])


def test_the_summary_by_hand(store: Path) -> None:
    costs = profiles.costs(profiles.load(store))
    rows = {row["solver"]: row for row in profiles.summary(costs, penalty=10, shift=1.0)}
    assert profiles.summary(costs)[0]["solver"] == "virtual best"
    assert {name: row["solved"] for name, row in rows.items()} == {
        **{"virtual best": 3, "A": 3, "B": 2, "C": 3}
    }
    assert [rows[name]["fastest"] for name in "ABC"] == [1, 1, 1]
    # a failure is charged 10 x 100 s; the shift is 1 s
    assert rows["A"]["mean"] == pytest.approx((2 * 3 * 5 * 1001) ** 0.25 - 1)
    assert rows["B"]["mean"] == pytest.approx((3 * 2 * 1001 * 1001) ** 0.25 - 1)
    assert rows["virtual best"]["mean"] == pytest.approx((2 * 2 * 2 * 1001) ** 0.25 - 1)
    assert (rows["A"]["median ratio"], rows["A"]["worst ratio"]) == (2, 4)


def test_pairs_by_hand(store: Path) -> None:
    costs = profiles.costs(profiles.load(store))
    pairs = {(pair.first, pair.second): pair for pair in profiles.pairs(costs)}
    assert set(pairs) == {("A", "B"), ("A", "C"), ("B", "C")}
    # A : B is 1/2 and 2
    pair = pairs["A", "B"]
    assert pair.ratio == pytest.approx(1)
    assert (pair.both, pair.only_first, pair.only_second) == (2, 1, 0)
    assert [pair.low, pair.high] == pytest.approx([0.5, 2])
    # B : C is 1/2 and 1/8
    assert pairs["B", "C"].ratio == pytest.approx(0.25)
    assert [pair.first for pair in profiles.pairs(costs, against="B")] == ["A", "C"]


def test_families_by_hand(store: Path) -> None:
    rows = profiles.families(profiles.costs(profiles.load(store)), {("few", 1e-6): 7.0})
    assert [(row["family"], row["problems"], row["unsolved"]) for row in rows] == [
        ("few", 2, 0),
        ("many", 2, 1),
    ]
    assert [row["mean of fastest"] for row in rows] == [1, 1]
    assert [row["published"] for row in rows] == [7, None]


def test_repeats_count_by_their_median(store: Path) -> None:
    fill(store, {"A": [3.0, None, 4.0, None]}, repeat=1)
    fill(store, {"A": [9.0, 2.0, 4.0, None]}, repeat=2)
    values = profiles.costs(profiles.load(store, solvers=["A"])).values[:, 0]
    assert values.tolist() == [3, 2, 4, math.inf]


def test_work_precision_and_convergence_by_hand(store: Path) -> None:
    fill(store, {name: [2 * t if t else None for t in own] for name, own in TIMES.items()}, 1e-9)
    rows = profiles.load(store)
    points = [p for p in profiles.work_precision(rows, penalty=1, shift=1.0) if p["solver"] == "A"]
    assert [(p["tol"], p["solved"], p["of"]) for p in points] == [(1e-6, 3, 4), (1e-9, 3, 4)]
    assert points[0]["mean"] == pytest.approx((2 * 3 * 5 * 101) ** 0.25 - 1)
    assert points[1]["mean"] == pytest.approx((3 * 5 * 9 * 101) ** 0.25 - 1)
    assert points[0]["error"] == pytest.approx(0.5e-6)
    first = profiles.load(store, tolerances=[1e-6])
    curves = profiles.convergence(store, first, np.array([0.5, 2.5]))
    assert curves["A"].tolist() == [1.0, 0.5e-6]  # two of three have arrived


def test_what_is_compared(store: Path) -> None:
    fill(store, {"D": [1.0]})
    costs = profiles.costs(profiles.load(store))
    assert (len(costs.instances), costs.left_out) == (1, 3)
    fill(store, node="there", tol=1e-7)
    with pytest.raises(profiles.ProfileError, match="here, there"):
        profiles.load(store)
    assert len(profiles.load(store, machine="there")) == 12
    with pytest.raises(profiles.ProfileError, match="there is: few, many"):
        profiles.load(store, families=["none"])


# ---- against other implementations

COSTS = hnp.arrays(
    float,
    st.tuples(st.integers(1, 12), st.integers(1, 5)),
    elements=st.one_of(st.floats(1e-6, 1e6), st.just(math.inf)),
)


def slow_profile(values: Any, tau: float) -> list[float]:
    """The definition of Dolan & More, one comparison after the other."""
    problems, solvers = values.shape
    shares = []
    for s in range(solvers):
        count = 0
        for p in range(problems):
            best = min(values[p])
            if values[p][s] < math.inf and values[p][s] / best <= tau:
                count += 1
        shares.append(count / problems)
    return shares


@given(COSTS, st.lists(st.floats(1, 1e12), min_size=1, max_size=5))
def test_profiles_agree_with_the_definition(values: Any, taus: list[float]) -> None:
    curves = profiles.performance_profile(values, np.array(taus))
    for k, tau in enumerate(taus):
        assert curves[:, k].tolist() == slow_profile(values, tau)


@given(COSTS)
def test_profiles_grow_to_the_share_that_is_solved(values: Any) -> None:
    taus = np.array([1.0, 2.0, 10.0, 1e300])
    curves = profiles.performance_profile(values, taus)
    assert (np.diff(curves, axis=1) >= 0).all()
    np.testing.assert_array_equal(curves[:, -1], np.isfinite(values).mean(axis=0))
    # somebody is the best where anybody solves it
    assert curves[:, 0].sum() >= np.isfinite(values).any(axis=1).mean() - 1e-12


@given(COSTS, st.floats(1e-3, 10))
def test_the_mean_agrees_with_the_definition(values: Any, shift: float) -> None:
    charges = np.full(len(values), 1e6)
    means = profiles.shifted_geometric_mean(values, charges, 10, shift)
    whole = np.where(np.isfinite(values), values, 1e7)
    expected = [math.exp(sum(math.log(x + shift) for x in c) / len(c)) - shift for c in whole.T]
    np.testing.assert_allclose(means, expected, rtol=1e-6, atol=1e-9 * shift)


# ---- the command


def test_the_tables_and_the_pictures(store: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    fill(store, {name: [2 * t if t else None for t in own] for name, own in TIMES.items()}, 1e-9)
    done = run_cli(store, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    for word in ("virtual best", "cpu_limit", "95 % interval", "CPU time [s]", "few", "<= 2x"):
        assert word in done.stdout
    names = ["performance-cpu_s", "data-cpu_s", "data-cpu_s-per-contact", "work-precision-cpu_s"]
    for name in [*names, "convergence"]:
        for kind, start in (("pdf", b"%PDF"), ("png", b"\x89PNG"), ("svg", b"<?xml")):
            assert (tmp_path / "out" / f"{name}.{kind}").read_bytes().startswith(start)
    with (tmp_path / "out" / "performance-cpu_s.csv").open() as file:
        steps = list(csv.DictReader(file))
    assert [float(step["tau"]) for step in steps] == [1, 2, 4, 8]
    assert [float(step["A"]) for step in steps] == [0.25, 0.5, 0.75, 0.75]
    assert not list((tmp_path / "out").glob(".*"))


def test_json(store: Path) -> None:
    done = run_cli(store, "--json", "--metric", "iterations", "--solver", "B", "--solver", "A")
    assert done.returncode == 0, done.stderr
    records = [json.loads(line) for line in done.stdout.splitlines()]
    summary = {r["solver"]: r for r in records if r["table"] == "summary"}
    assert set(summary) == {"virtual best", "A", "B"}
    assert summary["A"]["solved"] == 3
    assert run_cli(store, "--solver", "Z").returncode == 1
    assert run_cli(store.with_name("absent.sqlite")).returncode == 1
