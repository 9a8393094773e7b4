"""Profiles: equal to what is worked out by hand, and to an independent implementation."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import warnings
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import helpers_cli
from fclib import bench
from fclib._solve import MERITS
from fclib.bench import campaign, profiles
from fclib.bench.job import Job, Record
from helpers_bench import facts_of
from helpers_cli import invoke

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
    version: str = "1.0",
    merit: Literal["both", "natural"] = "both",
) -> None:
    """A store, made by hand."""
    with bench.Store(path) as store:
        number = store.begin("hand", 'name = "hand"', 12, 0, node)
        for solver, own in times.items():
            for k, time in enumerate(own):
                family = "few" if k < 2 else "many"
                problem = facts_of(f"hash{k}", f"problem{k}", family=family, nc=CONTACTS[k])
                job = Job(
                    problem,
                    bench.SolverChoice(solver, {}, version),
                    tol,
                    bench.Limits(LIMIT, LIMIT, 1000),
                    repeat,
                    1,
                    merit=merit,
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


run_cli = partial(helpers_cli.run, "profile")


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


def test_repeats_count_by_the_quickest_and_keep_their_spread(store: Path) -> None:
    fill(store, {"A": [3.0, None, 4.0, None]}, repeat=1)
    fill(store, {"A": [9.0, 2.0, 4.0, None]}, repeat=2)
    costs = profiles.costs(profiles.load(store, solvers=["A"]))
    assert costs.values[:, 0].tolist() == [1, 2, 4, math.inf]
    assert costs.spread is not None
    np.testing.assert_array_equal(costs.spread[:, 0], [8, 0, 0, math.nan])
    assert profiles.summary(costs)[1]["spread"] == 0


def test_work_precision_and_convergence_by_hand(store: Path) -> None:
    fill(store, {name: [2 * t if t else None for t in own] for name, own in TIMES.items()}, 1e-9)
    rows = profiles.load(store)
    points = profiles.work_precision(rows, profiles.costs(rows), penalty=1, shift=1.0)
    points = [p for p in points if p["solver"] == "A"]
    assert [(p["tol"], p["solved"], p["of"]) for p in points] == [(1e-6, 3, 4), (1e-9, 3, 4)]
    assert points[0]["mean"] == pytest.approx((2 * 3 * 5 * 101) ** 0.25 - 1)
    assert points[1]["mean"] == pytest.approx((3 * 5 * 9 * 101) ** 0.25 - 1)
    assert points[0]["error"] == pytest.approx(0.5e-6)
    first = profiles.load(store, tolerances=[1e-6])
    curves = profiles.convergence(store, first, np.array([0.5, 2.5, 4.5]))
    assert curves["A"].tolist() == [1.0, 1.0, 0.5e-6]  # two and three of four have arrived
    assert curves["B"].tolist() == [math.inf] * 3  # that has solved two of four
    with pytest.raises(profiles.ProfileError, match="one tolerance"):
        profiles.convergence(store, rows, np.ones(1))


def test_runtimes_to_targets_use_every_run(store: Path) -> None:
    assert profiles.targets(1e-3).tolist() == [0.1, 0.01, 1e-3]
    assert profiles.targets(5e-3).tolist() == [0.1, 0.01, 5e-3]
    times = profiles.runtimes(store, profiles.load(store), 1e-6)
    # six targets: A reaches all at 1, 2 and 4 s on three problems, none on the fourth
    assert np.sort(times["A"]).tolist() == [1.0] * 6 + [2.0] * 6 + [4.0] * 6 + [math.inf] * 6
    shares = profiles.share_within(times["A"][:, None], np.array([1.0, 3.0, 9.0]))
    assert shares.tolist() == [[0.25, 0.5, 0.75]]


def test_times_of_a_history_are_of_cpu(store: Path) -> None:
    with bench.Store(store) as opened:
        opened.db.execute("UPDATE history SET time = 10 * time")
        opened.seal()
    rows = profiles.load(store, solvers=["A"])
    assert profiles.convergence(store, rows, np.array([4.5]))["A"].tolist() == [0.5e-6]


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


# ---- edges: rows made by hand, without a store


def row(solver: str, problem: int, time: float | None, **other: Any) -> dict[str, Any]:
    """A run, as a store has it: solved where there is a time."""
    made = {
        "solver": solver,
        "hash": f"hash{problem}",
        "problem": f"problem{problem}",
        "family": "family",
        "nc": 10,
        "tol": 1e-6,
        "time_limit": LIMIT,
        "status": "cpu_limit" if time is None else "converged",
        "solved": int(time is not None),
        "error": None if time is None else 1e-7,
        **dict.fromkeys(profiles.METRICS, time),
    }
    return {**made, **other}


def test_instances_without_contacts_have_no_cost_by_contact() -> None:
    rows = [row("A", 0, 1.0, nc=0), row("A", 1, 6.0, nc=2), row("A", 2, 3.0, nc=3)]
    by_contact = profiles.costs(rows).per_contact()
    assert [instance.problem for instance in by_contact.instances] == ["problem1", "problem2"]
    assert by_contact.values.tolist() == [[3], [1]]


def test_some_solvers_share_the_instances_that_all_of_them_have_run() -> None:
    rows = [row("A", 0, 1.0), row("B", 0, 2.0), row("B", 1, 3.0), row("C", 1, 4.0)]
    every = profiles.gather(rows)
    np.testing.assert_array_equal(
        every.values,
        [[1, 2, math.nan], [math.nan, 3, 4]],  # nan where it has not run
    )
    some = every.shared(["C", "B"])
    assert some.solvers == ("C", "B")
    assert [instance.problem for instance in some.instances] == ["problem1"]
    assert some.values.tolist() == [[4, 3]]
    assert some.left_out == 1
    with pytest.raises(
        profiles.ProfileError, match=r"^there is no problem that all of these solvers have run and"
    ):
        profiles.costs(rows)


def test_a_part_has_the_instances_it_is_of() -> None:
    part = profiles.costs([row("A", k, k + 1.0) for k in range(3)]).on_instances([2, 0])
    assert [instance.problem for instance in part.instances] == ["problem2", "problem0"]
    assert part.values.tolist() == [[3], [1]]


def test_each_metric_has_its_own_costs_and_its_least() -> None:
    rows = [row("A", 0, 1.0, iterations=0, memory_mb=7.0), row("A", 1, 1e-9, iterations=5)]
    assert profiles.costs(rows).values.tolist() == [[1], [1e-6]]
    assert profiles.costs(rows, "iterations").values.tolist() == [[1], [5]]
    assert profiles.costs(rows, "memory_mb").values[0].tolist() == [7]
    with pytest.raises(profiles.ProfileError, match="no metric luck; there is: cpu_s, total_cpu_s"):
        profiles.costs(rows, "luck")


def test_a_failure_is_charged_the_limit_or_the_largest_cost() -> None:
    rows = [
        *(row("A", 0, 2.0), row("B", 0, 8.0), row("C", 0, None)),
        *(row("A", 1, None), row("B", 1, None), row("C", 1, None)),
        *(row("A", 2, 3.0), row("B", 2, 20.0), row("C", 2, 1.0)),
    ]
    assert profiles.costs(rows).charges.tolist() == [LIMIT, LIMIT, LIMIT]
    # where nobody solves it, the largest of all
    assert profiles.costs(rows, "iterations").charges.tolist() == [8, 20, 20]
    assert profiles.costs(rows).best.tolist() == [2, math.inf, 1]
    nothing = profiles.costs([row("A", 0, None)], "iterations")
    assert nothing.charges.tolist() == [1]


def test_a_failure_costs_nothing_less_than_everything() -> None:
    # a run that stopped at its limit has a time, and one without a time is not solved by its status
    rows = [
        row("A", 0, 5.0, status="inaccurate"),
        row("A", 1, None, status="converged"),
        row("A", 2, 5.0),
    ]
    assert profiles.costs(rows).values.tolist() == [[math.inf], [math.inf], [5]]


def test_what_was_not_run_is_no_instance() -> None:
    for status in ("unreadable", "killed", "no_space", "lost"):
        rows = [row("A", 0, None, status=status), row("A", 1, 1.0), row("A", 2, 2.0)]
        found = profiles.gather(rows)
        assert [instance.problem for instance in found.instances] == ["problem1", "problem2"]
        assert profiles.gather(rows[:1]).solvers == ("A",)
        assert profiles.gather(rows[:1]).values.shape == (0, 1)


def test_what_a_solver_does_not_take_is_in_no_common_set() -> None:
    rows = [
        *(row("A", 0, 1.0), row("B", 0, 2.0)),
        *(row("A", 1, 3.0), row("B", 1, None, status="unsuitable")),
        *(row(name, 2, None, status="unsuitable") for name in "AB"),
    ]
    common = profiles.costs(rows)
    assert (common.values.tolist(), common.left_out) == ([[1, 2]], 1)
    assert [common.legend(k) for k in range(2)] == ["A 1 of 1", "B 1 of 1"]
    # or each of them has its own set
    costs = profiles.costs(rows, own_set=True)
    np.testing.assert_array_equal(costs.values, [[1, 2], [3, math.nan]])
    assert costs.unsuitable is not None
    assert costs.unsuitable.tolist() == [[False, False], [False, True]]
    np.testing.assert_array_equal(profiles.ratios(costs.values), [[1, 2], [1, math.nan]])
    shares = profiles.performance_profile(costs.values, np.array([1.0, 2.0]))
    assert shares.tolist() == [[1, 1], [0, 1]]
    best, a, b = profiles.summary(costs, shift=1.0)
    assert (best["of"], a["of"], b["of"], b["unsuitable"]) == (2, 2, 1, 1)
    assert (b["mean"], b["to best"]) == (pytest.approx(2), pytest.approx(2))
    assert [costs.legend(k) for k in range(2)] == ["A 2 of 2", "B 1 of 1"]
    (pair,) = profiles.pairs(costs)
    assert (pair.both, pair.only_first, pair.only_second) == (1, 0, 0)
    (family,) = profiles.families(costs)
    assert (family["unsolved"], family["most often fastest"]) == (0, "A")
    # or it counts as a failure
    counted = profiles.costs(rows, count_unsuitable=True)
    assert counted.values.tolist() == [[1, 2], [3, math.inf], [math.inf, math.inf]]


def test_a_failure_among_repeats_counts_where_it_is_most_of_them() -> None:
    cases: list[tuple[list[float | None], float]] = [
        ([4.0, 1.0], 1.0),
        ([8.0, None, 1.0, 3.0], 1.0),
        ([7.0, None], 7.0),
        ([2.0, None, None], math.inf),
        ([None, None], math.inf),
    ]
    for times, expected in cases:
        rows = [row("A", 0, time) for time in times]
        assert profiles.costs(rows).values.tolist() == [[expected]]


def test_under_several_limits_that_of_the_most_solvers_counts_then_the_largest() -> None:
    rows = [row(name, 0, 1.0, time_limit=1.0) for name in "AB"]
    rows += [row(name, 0, 2.0, time_limit=9.0) for name in "AB"]
    costs = profiles.costs(rows)
    assert (costs.values.tolist(), costs.instances[0].limit) == ([[2, 2]], 9)
    assert profiles.costs(rows[:3]).values.tolist() == [[1, 1]]


def test_the_wall_clock_is_charged_its_own_limit() -> None:
    rows = [row("A", 0, None, wall_limit=7.0), row("A", 1, None, wall_limit=None)]
    assert profiles.costs(rows, "wall_s").charges.tolist() == [7, LIMIT]
    assert profiles.costs(rows).charges.tolist() == [LIMIT, LIMIT]


def test_the_bootstrap_draws_problems() -> None:
    # one problem at twenty steps of a sequence is no more than one problem
    rows = [row(s, 0, t * k, step=k) for s, t in (("A", 1), ("B", 2)) for k in range(1, 21)]
    rows += [row("A", 1, 4.0), row("B", 1, 1.0)]
    (pair,) = profiles.pairs(profiles.costs(rows))
    assert [pair.low, pair.high] == pytest.approx([0.5, 4])
    costs = profiles.costs([row("A", 0, 1.0), row("A", 1, None)])
    low, high = profiles.bands(costs, costs.values, np.array([1.0]))
    assert (low.tolist(), high.tolist()) == ([[0]], [[1]])


def test_success_is_by_the_error_that_was_reached() -> None:
    rows = [
        row("A", 0, 1.0, error=1e-7),
        row("A", 1, 1.0, solved=0, status="inaccurate", error=1e-3),
        row("A", 2, None, error=1e-9),  # killed at its limit
        row("A", 3, None, status="unsuitable", error=None),
    ]
    (found,) = profiles.accuracies(rows, profiles.costs(rows))
    assert (found["runs"], found["error <= 0.01"], found["error <= 1e-06"]) == (3, 2 / 3, 1 / 3)


def test_the_influence_of_the_shift_is_shown() -> None:
    rows = [*(row("A", k, 1e-3) for k in range(2)), row("B", 0, 1e-5), row("B", 1, 2e-3)]
    a, b = profiles.shifts(profiles.costs(rows), shift=1e-3)
    assert {a["solver"], b["solver"]} == {"A", "B"}
    assert list(a) == ["tol", "solver", "shift 0.0001", "shift 0.001", "shift 0.01"]


def test_instances_are_in_order_of_family_problem_and_growing_accuracy() -> None:
    rows = [
        row("A", 0, 1.0, family="b"),
        *(row("A", 2, 1.0, tol=tol) for tol in (1e-8, 1e-4, 1e-6)),
        row("A", 1, 1.0, time_limit=7.0),
    ]
    found = [(i.family, i.problem, i.tol, i.limit) for i in profiles.costs(rows).instances]
    assert found == [
        ("b", "problem0", 1e-6, LIMIT),
        ("family", "problem1", 1e-6, 7),
        ("family", "problem2", 1e-4, LIMIT),
        ("family", "problem2", 1e-6, LIMIT),
        ("family", "problem2", 1e-8, LIMIT),
    ]


def test_profiles_of_no_instance_are_zero() -> None:
    assert profiles.share_within(np.zeros((0, 2)), np.array([1.0])).tolist() == [[0], [0]]


def test_the_shifted_mean_by_hand() -> None:
    values = np.array([[3.0, math.inf], [15.0, 7.0]])
    means = profiles.shifted_geometric_mean(values, np.array([10.0, 1e9]), 5, shift=1.0)
    assert means == pytest.approx([math.sqrt(4 * 16) - 1, math.sqrt(51 * 8) - 1])
    means = profiles.shifted_geometric_mean(values[:, :1], np.zeros(2), shift=100.0)
    assert means == pytest.approx([math.sqrt(103 * 115) - 100])
    # ten times the limit, a shift of 1 ms
    failed = profiles.shifted_geometric_mean(np.array([[math.inf], [0.0]]), np.array([0.3, 1.0]))
    assert failed == pytest.approx([math.sqrt(3.001 * 0.001) - 0.001])


def test_the_interval_of_a_pair_is_drawn_from_its_seed() -> None:
    random = np.random.default_rng(3)
    rows = [row(s, k, float(t)) for s in "AB" for k, t in enumerate(random.uniform(1, 9, 12))]
    costs = profiles.costs(rows)
    (pair,) = profiles.pairs(costs)
    assert profiles.pairs(costs) == profiles.pairs(costs, seed=0) == [pair]
    (other,) = profiles.pairs(costs, seed=1)
    assert (other.low, other.high) != (pair.low, pair.high)
    assert pair.low < pair.ratio < pair.high


def test_a_pair_that_solves_nothing_together_has_no_ratio() -> None:
    (pair,) = profiles.pairs(
        profiles.costs([row("A", 0, 1.0), row("B", 0, None), row("A", 1, None), row("B", 1, 1.0)])
    )
    assert (pair.both, pair.only_first, pair.only_second) == (0, 1, 1)
    assert all(math.isnan(x) for x in (pair.ratio, pair.low, pair.high))


def test_the_columns_of_the_summary() -> None:
    rows = [
        *(row("slow", 0, 3.0), row("slow", 1, 15.0), row("slow", 2, None)),
        *(row("quick", 0, 1.0), row("quick", 1, 7.0), row("quick", 2, None)),
        *(row("none", k, None) for k in range(3)),
        *(row("once", 0, 1.0), row("once", 1, None), row("once", 2, None)),
    ]
    found = profiles.summary(profiles.costs(rows), penalty=1, shift=1.0)
    assert [line["solver"] for line in found] == ["virtual best", "quick", "slow", "once", "none"]
    best = (2 * 8 * 101) ** (1 / 3) - 1
    slow = (4 * 16 * 101) ** (1 / 3) - 1
    assert found[0] == {
        "tol": 1e-6,
        "solver": "virtual best",
        "solved": 2,
        "of": 3,
        "share": pytest.approx(2 / 3),
        "unsuitable": 0,
        "fastest": 2,
        "mean": pytest.approx(best),
        "to best": pytest.approx(1),
        "median ratio": 1,
        "worst ratio": 1,
        "spread": None,
        "copies": None,
    }
    assert found[2] == {
        "tol": 1e-6,
        "solver": "slow",
        "solved": 2,
        "of": 3,
        "share": pytest.approx(2 / 3),
        "unsuitable": 0,
        "fastest": 0,
        "mean": pytest.approx(slow),
        "to best": pytest.approx(slow / best),
        "median ratio": pytest.approx((3 + 15 / 7) / 2),
        "worst ratio": 3,
        "spread": None,
        "copies": None,
    }
    assert (found[4]["median ratio"], found[4]["worst ratio"]) == (None, None)
    assert [line["fastest"] for line in found] == [2, 2, 0, 1, 0]


def test_ratios_to_the_best_mean() -> None:
    costs = profiles.costs([row("A", 0, 0.25), row("B", 0, 0.5)])
    assert [line["to best"] for line in profiles.summary(costs)] == pytest.approx([1, 1, 2])
    # there is none to what costs nothing
    free = dataclasses.replace(costs, values=np.array([[1.0, 0.0]]))
    with np.errstate(divide="ignore"):
        assert all(math.isnan(line["to best"]) for line in profiles.summary(free))


def test_what_nobody_solves_is_no_cause_for_warnings() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert profiles.ratios(np.full((1, 2), math.inf)).tolist() == [[math.inf, math.inf]]


def test_the_columns_of_families() -> None:
    rows = [
        *(row("A", 0, 1.0, nc=5), row("B", 0, 2.0, nc=5)),
        *(row("A", 1, 9.0, nc=70), row("B", 1, 3.0, nc=70)),
        *(row("A", 2, 4.0), row("B", 2, 2.0)),
        *(row(s, k, None, family="hard", nc=3, time_limit=7.0) for s in "AB" for k in (3, 4)),
    ]
    few, hard = profiles.families(profiles.costs(rows))
    assert few == {
        "family": "family",
        "problems": 3,
        "contacts": "5-70",
        "tol": 1e-6,
        "limit": LIMIT,
        "mean of fastest": 2,
        "std": pytest.approx(math.sqrt(2 / 3)),
        "unsolved": 0,
        "most often fastest": "B",
    }
    assert hard == {
        "family": "hard",
        "problems": 2,
        "contacts": "3-3",
        "tol": 1e-6,
        "limit": 7,
        "mean of fastest": None,
        "std": None,
        "unsolved": 2,
        "most often fastest": "-",
    }


def test_failures_are_counted_by_status() -> None:
    rows = [
        *(row("A", k, None) for k in range(3)),
        *(row("A", 3, 1.0), row("B", 3, 1.0)),
        row("B", 4, None, status="crashed"),
    ]
    found = profiles.failures(rows)
    assert found == [
        {"tol": 1e-6, "solver": "A", "cpu_limit": 3, "converged": 1, "crashed": 0},
        {"tol": 1e-6, "solver": "B", "cpu_limit": 0, "converged": 1, "crashed": 1},
    ]
    # the most frequent status first
    assert list(found[0]) == ["tol", "solver", "cpu_limit", "converged", "crashed"]


def test_work_and_precision_of_each_solver_where_they_compare() -> None:
    rows = [
        *(row("A", 0, 4.0, error=1e-8, iterations=3), row("B", 0, 9.0, error=1e-7, iterations=8)),
        *(row("A", 1, 4.0, error=1e-10, iterations=3), row("B", 1, None, error=1.0)),
        *(row("A", 0, None, tol=1e-9), row("B", 0, 1.0, tol=1e-9, error=0.0, iterations=8)),
        # no problem that both have run
        *(row("A", 0, 1.0, tol=1e-3), row("B", 1, 1.0, tol=1e-3)),
    ]
    costs = profiles.costs(rows, "iterations")
    found = profiles.work_precision(rows, costs, penalty=2, shift=1.0)
    assert [(line["solver"], line["tol"]) for line in found] == [
        *(("A", 1e-6), ("B", 1e-6)),
        *(("A", 1e-9), ("B", 1e-9)),
    ]
    assert found[0] == {
        "solver": "A",
        "tol": 1e-6,
        "mean": pytest.approx(3),
        "error": pytest.approx(1e-9),
        "solved": 2,
        "of": 2,
    }
    # B fails where A takes 3 iterations
    assert found[1]["mean"] == pytest.approx(math.sqrt(9 * 7) - 1)
    assert found[1]["error"] == pytest.approx(1e-7)
    assert found[2]["error"] is None
    assert found[3]["error"] == pytest.approx(1e-17)


# ---- edges: stores


def test_a_store_that_is_not_there_is_not_made(tmp_path: Path) -> None:
    absent = tmp_path / "absent.sqlite"
    for read in (
        lambda: profiles.load(absent),
        lambda: campaign.published_means(absent),
        lambda: profiles.convergence(absent, [], np.zeros(1)),
    ):
        with pytest.raises(bench.StoreError, match="there is no such store"):
            read()
        assert not absent.exists()


def test_a_store_without_runs_has_nothing_to_compare(tmp_path: Path) -> None:
    with bench.Store(tmp_path / "empty.sqlite"):
        pass
    with pytest.raises(profiles.ProfileError, match="there are no runs"):
        profiles.load(tmp_path / "empty.sqlite")


def test_runs_are_chosen_by_what_they_are_of(store: Path) -> None:
    fill(store, tol=1e-9)
    assert len(profiles.load(store)) == 24
    assert len(profiles.load(store, campaign="hand")) == 24
    assert {row["family"] for row in profiles.load(store, families=["many"])} == {"many"}
    assert {row["tol"] for row in profiles.load(store, tolerances=[1e-9])} == {1e-9}
    # in the order in which they are asked for
    chosen = [row["solver"] for row in profiles.load(store, solvers=["C", "A"])]
    assert chosen == ["C"] * 8 + ["A"] * 8
    with pytest.raises(profiles.ProfileError, match="with campaign other; there is: hand"):
        profiles.load(store, campaign="other")
    with pytest.raises(profiles.ProfileError, match="no run with solver Y, Z; there is: A, B, C"):
        profiles.load(store, solvers=["Y", "Z"])


def test_runs_of_an_unknown_machine_are_of_another_one(store: Path) -> None:
    fill(store, node="", tol=1e-7)
    with pytest.raises(profiles.ProfileError, match=r"choose one: \?, here"):
        profiles.load(store)


def test_two_merits_are_not_mixed(store: Path) -> None:
    fill(store, {"A": [1.0, 1.0, 1.0, 1.0]}, merit="natural")
    with pytest.raises(profiles.ProfileError, match="both, natural"):
        profiles.load(store)
    assert {row["merit"] for row in profiles.load(store, merit="both")} == {"both"}
    rows = profiles.load(store, merit="natural")
    assert {row["solver"] for row in rows} == {"A"}
    invoke("profile", store, code=1)
    shown = invoke("profile", store, "--merit", "natural")
    assert "natural map of the literature alone" in " ".join(shown.output.split())


def test_two_versions_of_a_solver_are_two_solvers(store: Path) -> None:
    fill(store, {"A": [1.0, 1.0, 1.0, 1.0]}, version="2.0")
    assert {row["solver"] for row in profiles.load(store)} == {*("A (1.0)", "A (2.0)"), *("B", "C")}


def test_a_version_is_told_only_where_it_tells_runs_apart(store: Path) -> None:
    fill(store, {"A": [1.0]}, version="2.0")  # of the first problem alone
    others = profiles.load(store, digests={"hash1", "hash2", "hash3"})
    assert {row["solver"] for row in others} == {"A", "B", "C"}
    assert {row["hash"] for row in others} == {"hash1", "hash2", "hash3"}
    first = profiles.load(store, digests={"hash0"})
    assert {row["solver"] for row in first} == {"A (1.0)", "A (2.0)", "B", "C"}
    with pytest.raises(profiles.ProfileError, match="no runs of these problems"):
        profiles.load(store, digests={"another"})


def test_what_campaigns_quote_is_found_by_family_and_tolerance(tmp_path: Path) -> None:
    text = """
    tolerances = [1e-3]
    [[problems]]
    family = "few"
    tolerances = [1e-4, 1e-8]
    published_mean = 2
    [[problems]]
    family = "many"
    published_mean = 0.5
    [[problems]]
    published_mean = 7.0
    [[problems]]
    family = "silent"
    """
    with bench.Store(tmp_path / "quotes.sqlite") as store:
        store.begin("quotes", text, 0, 0, "here")
        store.begin("nothing", "", 0, 0, "here")
        store.begin("undecided", "[[problems]]\npublished_mean = 1.0", 0, 0, "here")
    assert campaign.published_means(tmp_path / "quotes.sqlite") == {
        ("few", 1e-4): 2.0,
        ("few", 1e-8): 2.0,
        ("many", 1e-3): 0.5,
        ("", 1e-3): 7.0,
    }


def test_convergence_counts_what_was_reached_at_the_time_itself(store: Path) -> None:
    # A's runs have arrived at 1, 2 and 4 s; its run that failed has no history
    times = np.array([-1.0, 0.0, 1.0, 2.0, 4.0])
    rows = profiles.load(store, solvers=["A"])
    curves = profiles.convergence(store, rows.where(slice(None, None, -1)), times)
    assert curves["A"].tolist() == [math.inf, 1, 1, 1, 0.5e-6]
    assert curves["A"].dtype == float
    assert profiles.convergence(store, rows.where(slice(3, None)), times) == {}


# ---- the command


def test_the_tables_and_the_pictures(store: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    fill(store, {name: [2 * t if t else None for t in own] for name, own in TIMES.items()}, 1e-9)
    done = run_cli(store, "--out", tmp_path / "out", "--format", "svg")
    for word in ("virtual best", "cpu_limit", "95 % interval", "CPU time [s]", "few", "<= 2x"):
        assert word in done.stdout
    # one tolerance a curve
    names = ["performance-cpu_s", "data-cpu_s", "data-cpu_s-per-contact", "convergence", "runtimes"]
    names = [f"{name}-{tol}" for name in names for tol in ("1e-06", "1e-09")]
    drawn = {path.stem for path in (tmp_path / "out").glob("*.svg")}
    assert drawn == {*names, "work-precision-cpu_s"}
    with (tmp_path / "out" / "performance-cpu_s-1e-06.csv").open() as file:
        steps = list(csv.DictReader(file))
    assert [float(step["tau"]) for step in steps] == [1, 2, 4, 8]
    assert [float(step["A"]) for step in steps] == [0.25, 0.5, 0.75, 0.75]
    assert not list((tmp_path / "out").glob(".*"))


def test_names_that_matplotlib_would_read_otherwise(store: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    with bench.Store(store) as opened:
        for name, other in (("A", "_hidden"), ("B", "$x^$ cost"), ("C", r"C:\\x_{")):
            opened.db.execute("UPDATE solvers SET label = ? WHERE label = ?", (other, name))
        opened.seal()
    run_cli(store, "--out", tmp_path / "out")
    # in each of the formats
    for name in ("performance-cpu_s", "data-cpu_s", "convergence", "runtimes"):
        for kind, start in (("pdf", b"%PDF"), ("png", b"\x89PNG"), ("svg", b"<?xml")):
            assert (tmp_path / "out" / f"{name}.{kind}").read_bytes().startswith(start)
    drawn = (tmp_path / "out" / "performance-cpu_s.svg").read_text()
    assert "_hidden" in drawn
    assert "$x^$ cost" in drawn
    # what a figure is of stands below it
    for word in ("4 instances", "tolerance 1e-06", "limit 100 s", "4 of 12 runs failed"):
        assert word in drawn


def test_figures_that_are_unsteady_or_of_a_busy_machine_are_marked(store: Path) -> None:
    fill(store, {"B": [2.9, 1.3, None, None]}, repeat=1)
    with bench.Store(store) as opened:
        opened.db.execute("UPDATE machines SET cores = 2")
        opened.db.execute("UPDATE runs SET load = 1.5")
        opened.db.execute("UPDATE runs SET load = 2.5 WHERE id = 9")  # of C
        opened.seal()
    shown = invoke("profile", store)
    lines = [line for line in shown.output.splitlines() if line.startswith(("A ", "B ", "C "))]
    means = {line[0]: line for line in lines[:3]}
    assert " ~ " in means["B"]
    assert " ^ " in means["C"]
    assert not {"~", "^"} & set(means["A"])
    assert "1 of 16 runs were begun while the load was above" in " ".join(shown.output.split())


def test_machines_of_one_name_are_two(store: Path) -> None:
    fill(store, tol=1e-7)
    with bench.Store(store) as opened:
        opened.db.execute(
            "INSERT INTO machines (hash, node, cpu, cores) VALUES ('x', 'here', 'B', 4)"
        )
        opened.db.execute(
            "UPDATE runs SET machine = (SELECT id FROM machines WHERE hash = 'x') WHERE tol = 1e-7"
        )
        opened.seal()
    with pytest.raises(profiles.ProfileError, match=r"here \(4 x B\), here \(None x None\)"):
        profiles.load(store)
    assert len(profiles.load(store, machine="here (4 x B)")) == 12


def test_what_was_not_run_in_the_same_way_is_no_repeat(store: Path) -> None:
    with bench.Store(store) as opened:
        opened.db.execute("UPDATE runs SET threads = 4 WHERE id <= 2")
        opened.db.execute("UPDATE runs SET memory_limit = 50 WHERE id > 10")
        opened.seal()
    labels = {row["solver"] for row in profiles.load(store)}
    assert labels == {"A (1 threads)", "A (4 threads)", "B", "C (1000 MB)", "C (50 MB)"}


def test_tolerances_that_are_one_number(tmp_path: Path) -> None:
    with bench.Store(tmp_path / "one.sqlite") as opened:
        opened.begin("x", "tolerances = 1e-4\n[[problems]]\npublished_mean = 2", 0, 0, "here")
    assert campaign.published_means(tmp_path / "one.sqlite") == {("", 1e-4): 2.0}


def test_json(store: Path) -> None:
    done = run_cli(store, "--json", "--metric", "iterations", "--solver", "B", "--solver", "A")
    records = [json.loads(line) for line in done.stdout.splitlines()]
    summary = {r["solver"]: r for r in records if r["table"] == "summary"}
    assert set(summary) == {"virtual best", "A", "B"}
    assert summary["A"]["solved"] == 3
    run_cli(store, "--solver", "Z", code=1)
    run_cli(store.with_name("absent.sqlite"), code=1)
