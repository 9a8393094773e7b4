"""Runs at a larger tolerance that are read off histories, and the tenth that is repeated."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from fclib import bench
from fclib.bench.campaign import share_of
from fclib.bench.reached import read_off

PROBLEMS = [
    {"planted": {"count": 4, "contacts": 5, "seed": 1}, "family": "small"},
    {"planted": {"count": 10, "contacts": 3, "seed": 2}, "family": "smaller"},
]
HISTORY = [(1, 1e-2, 0.1, ""), (4, 4e-5, 0.4, ""), (5, 2e-4, 0.5, ""), (9, 1e-9, 1.0, "")]
RUN: dict[str, Any] = {
    **{"status": "converged", "merit": "both", "cpu_s": 2.0, "error": 2e-9, "natural": 1e-9},
    **{"total_cpu_s": 2.5, "wall_s": 3.0, "setup_s": 0.1, "iterations": 9, "memory_mb": 7.0},
    **{"stages": None, "load": 1.0, "started": 5.0, "message": "", "warm": 1, "pinned": 0},
    **{"frequency_mhz": None},
}


def campaign(**more: Any) -> bench.Campaign:
    return bench.Campaign.of(
        {"solvers": ["nsgs"], "tolerances": [1e-8], "problems": PROBLEMS, **more}
    )


def test_the_time_at_which_an_error_was_reached_is_read_off() -> None:
    """The merit was twice the solver's own error at the end: 4e-5 counts as 8e-5."""
    found = read_off(RUN | {"merit": "both"}, HISTORY, 1e-4, None)
    assert found is not None
    assert (found.status, found.iterations, found.measured) == ("converged", 4, "history")
    assert found.cpu_s == pytest.approx(0.8)  # of the 2 s of CPU in 1 s of the clock
    assert found.total_cpu_s == pytest.approx(2.5 - 1.2)
    assert found.merits == pytest.approx({"error": 8e-5, "natural": 8e-5})
    later = read_off(RUN | {"error": 3e-9}, HISTORY, 1e-4, None)
    assert later is not None
    assert later.iterations == 9  # three times 4e-5 is too much
    by_natural = read_off(RUN | {"merit": "natural", "error": 1.0}, HISTORY, 4e-5, None)
    assert by_natural is not None
    assert by_natural.iterations == 4


def test_a_run_that_failed_may_have_passed_the_larger_tolerance() -> None:
    failed = RUN | {"status": "stalled", "error": 1e-5}
    reached = read_off(failed, HISTORY[:2], 1e-4, None)
    assert reached is not None
    assert reached.status == "converged"
    never = read_off(failed | {"error": 1e-1}, HISTORY[:1], 1e-4, None)
    assert never is not None
    assert (never.status, never.cpu_s, never.iterations) == ("stalled", 2.0, 9)


def test_a_proof_is_not_read_off_as_a_solution() -> None:
    assert read_off(RUN | {"status": "infeasible", "error": 1.0}, HISTORY, 1e-4, None) is None
    assert read_off(RUN | {"status": "infeasible"}, HISTORY, 1e-4, None) is None


@pytest.mark.parametrize("lacks", [{"cpu_s": None}, {"error": None}, {"error": float("inf")}, {}])
def test_a_run_that_says_too_little_is_not_read_off(lacks: dict[str, Any]) -> None:
    assert read_off(RUN | lacks, HISTORY if lacks else [], 1e-4, None) is None


def test_a_campaign_reads_off_and_goes_on(tmp_path: Path) -> None:
    """Both tolerances are in the store after one run each; another solver's run is made twice."""
    module = tmp_path / "reached_mine.py"
    module.write_text(
        "import fclib\n\n\n@fclib.solver('reached-mine')\n"
        "def solve(problem, r, monitor):\n    r[:] = fclib.solve(problem, 'nsgs').solution.r\n"
        "    monitor.stop(r)\n"
    )
    more = {"from_history": [1e-4], "modules": [str(module)], "problems": PROBLEMS[:1]}
    chosen = campaign(solvers=["nsgs", "reached-mine"], **more)
    path = tmp_path / "both.sqlite"
    assert bench.run_campaign(chosen, path).planned == 16
    with bench.Store(path) as store:
        rows = list(store.table(more=("key",)))
        ways = Counter((row["solver"], row["tol"], row["measured"] == "history") for row in rows)
        assert ways == {
            ("nsgs", 1e-8, False): 4,
            ("nsgs", 1e-4, True): 4,
            ("reached-mine", 1e-8, False): 4,
            ("reached-mine", 1e-4, False): 4,
        }
        own = {(row["hash"], row["tol"]): row for row in rows if row["solver"] == "nsgs"}
        for (digest, tol), row in own.items():
            assert row["status"] == "converged"
            assert row["iterations"] <= own[digest, 1e-8]["iterations"]
            assert row["error"] <= tol
            assert row["cpu_s"] <= own[digest, 1e-8]["cpu_s"]
    again = bench.run_campaign(chosen, path)
    assert (again.skipped, sum(again.statuses.values())) == (16, 0)
    # what is run again is read off again
    once_more = bench.run_campaign(chosen, path, retry=["converged"])
    assert sum(once_more.statuses.values()) == 16


def test_a_tenth_is_repeated_between_the_others() -> None:
    plan = campaign(repeats=3, repeated=0.3, renumber=True).plan()
    counts = Counter(job.problem.hash for job in plan)
    assert sorted(counts.values()) == [1] * 10 + [3] * 4
    assert {job.repeat for job in plan} == {0, 1, 2}
    assert all(job.keep == (counts[job.problem.hash] == 3 and not job.repeat) for job in plan)
    # any part of the campaign has as large a share of each family, and repeats before its end
    families = Counter(job.problem.family for job in plan)
    half = Counter(job.problem.family for job in plan[: len(plan) // 2])
    assert all(abs(half[name] / count - 0.5) < 0.2 for name, count in families.items())
    assert {job.repeat for job in plan[: len(plan) // 2]} == {0, 1, 2}
    for digest in counts:
        own = [job.repeat for job in plan if job.problem.hash == digest]
        assert own == sorted(own)
    assert len(campaign(repeats=3).plan()) == 3 * 14


def test_only_what_was_solved_is_repeated(tmp_path: Path) -> None:
    """A solver that ends after one sweep solves no problem, so it is run once."""
    module = tmp_path / "reached_short.py"
    module.write_text(
        "import fclib\n\n\n@fclib.solver('short')\ndef solve(problem, r, monitor):\n"
        "    r[:] = fclib.solve(problem, 'nsgs', max_iterations=1).solution.r\n"
        "    monitor.stop(r)\n"
    )
    chosen = campaign(
        solvers=["nsgs", "short"],
        modules=[str(module)],
        problems=PROBLEMS[:1],
        repeats=2,
        renumber=True,
        repeat_solved=True,
        from_history=[1e-4],
    )
    path = tmp_path / "solved.sqlite"
    bench.run_campaign(chosen, path)
    with bench.Store(path) as store:
        rows = list(store.table())
        (status,) = store.status()
    assert (status.done, status.planned) == (32, 32)  # a campaign that has ended is whole
    counts = Counter((row["solver"], row["tol"], row["repeat"]) for row in rows)
    whole = {("nsgs", tol, repeat): 4 for tol in (1e-8, 1e-4) for repeat in (0, 1)}
    assert counts == whole | {("short", tol, 0): 4 for tol in (1e-8, 1e-4)}
    assert all(bool(row["solved"]) == (row["solver"] == "nsgs") for row in rows)
    again = bench.run_campaign(chosen, path)
    assert (again.planned, again.skipped, sum(again.statuses.values())) == (32, 32, 0)


def test_a_share_is_evenly_spread() -> None:
    assert share_of(range(100), 0.1) == [4, 14, 24, 34, 44, 54, 64, 74, 84, 94]
    assert share_of(range(3), 0.1) == [1]
    assert share_of([], 0.1) == []
    assert share_of(range(4), 1.0) == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("entry", "word"),
    [
        ({"repeated": 1.5}, "repeated: 1.5 is above 1"),
        ({"repeated": 0}, "repeated"),
        ({"repeat_solved": 1}, "repeat_solved"),
        ({"from_history": [1e-8]}, "not larger"),
        ({"from_history": 1e-4}, "no list"),
    ],
)
def test_wrong_entries_are_named(entry: dict[str, Any], word: str) -> None:
    with pytest.raises(bench.CampaignError, match=word):
        campaign(**entry)
