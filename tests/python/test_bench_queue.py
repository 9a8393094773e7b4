"""What a campaign does with runs that could not be done: the second tries, and their end.

Each of these was taken out of the code once, and a test here failed.
"""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import pytest

from fclib.bench import runner
from fclib.bench.runner import Queue, with_guess


def job(key: str, after: str = "", step: int = 0) -> Any:
    """A run, of a sequence if it waits for another one or is its first step."""
    along = SimpleNamespace(after=after, step=step) if after or step else None
    return SimpleNamespace(key=key, along=along, after=after)


def queue(jobs: list[Any], retries: int = 2, **parts: Any) -> Queue:
    return Queue(jobs, parts.get("begin", lambda one: one), retries, *parts.get("left", ()))


@pytest.fixture(autouse=True)
def without_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "PAUSES", (0.0,))


def test_a_run_is_tried_again_as_often_as_asked_for() -> None:
    one = job("a")
    jobs = queue([one, *(job(f"other {k}") for k in range(9))], retries=2)
    jobs.many = 5  # so that one is not too many
    assert next(jobs) is one
    assert jobs.give_back(one)
    rest = [each.key for each in jobs]
    assert rest == [*(f"other {k}" for k in range(9)), "a"]  # after all others
    assert jobs.give_back(one)
    assert [each.key for each in jobs] == ["a"]
    assert not jobs.give_back(one)
    assert list(jobs) == []
    assert jobs.failed == 1


def test_second_tries_wait_for_longer_each_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "PAUSES", (0.05, 0.15))
    one = job("a")
    jobs = queue([one], retries=3)
    next(jobs)
    waited = []
    for _ in range(3):
        start = time.monotonic()
        jobs.give_back(one)
        next(jobs)
        waited.append(time.monotonic() - start)
    assert waited[0] >= 0.05
    assert min(waited[1:]) >= 0.15  # the last pause is that of all later tries


def test_where_too_many_fail_no_others_are_begun() -> None:
    ones = [job(f"{k}") for k in range(20)]
    jobs = queue(ones, retries=1)
    begun = 0
    while not jobs.troubled:
        jobs.give_back(next(jobs))
        begun += 1
    assert begun <= jobs.many + 1
    # those that failed come first now
    assert next(jobs) is ones[0]


def test_a_step_waits_for_the_one_before_it() -> None:
    first, second, third = job("1", step=1), job("2", after="1"), job("3", after="2")
    jobs = queue([third, second, first, job("alone")])
    assert next(jobs) is first
    assert next(jobs).key == "alone"
    assert list(jobs) == []
    jobs.finish(first)
    assert [each.key for each in jobs] == ["2"]
    jobs.finish(second)
    assert [each.key for each in jobs] == ["3"]


def test_what_follows_a_step_that_is_not_done_is_left_too() -> None:
    told: list[str] = []
    first, second, third, fourth = (
        job("1", step=1), job("2", after="1"), job("3", after="2"), job("4", after="3")
    )  # fmt: skip
    jobs = queue([first, second, third, fourth], left=(lambda one, _record: told.append(one.key),))
    assert next(jobs) is first
    assert list(jobs) == []  # the others wait
    jobs.leave(first, None)
    assert sorted(told) == ["2", "3", "4"]
    assert list(jobs) == []
    # ... and those that were not looked at yet
    told.clear()
    jobs = queue([first, second, third], left=(lambda one, _record: told.append(one.key),))
    assert next(jobs) is first
    jobs.leave(first, None)
    assert list(jobs) == []
    assert sorted(told) == ["2", "3"]


def test_a_job_that_another_campaign_has_done_is_passed_over() -> None:
    jobs = queue([job("a"), job("b")], begin=lambda one: one if one.key == "b" else None)
    assert [each.key for each in jobs] == ["b"]


def test_the_guess_is_the_last_solution_that_there_is() -> None:
    steps = {
        "1": SimpleNamespace(problem="p1", along=SimpleNamespace(after="", step=1)),
        "2": SimpleNamespace(problem="p2", along=SimpleNamespace(after="1", step=2)),
        "3": SimpleNamespace(problem="p3", along=SimpleNamespace(after="2", step=3)),
    }
    given: list[Any] = []

    def replaced(one: Any, guess: Any) -> Any:
        given.append(guess)
        return one

    any_steps: Any = steps
    for stored, expected in (({"1", "2"}, "p2"), ({"1"}, "p1"), (set(), None)):
        given.clear()
        store: Any = SimpleNamespace(
            solution_of=lambda key, stored=stored: (None, None) if key in stored else None
        )
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(runner, "replace", replaced)
            patch.setattr(runner, "Guess", lambda problem, *_: problem)
            with_guess(any_steps["3"], any_steps, store)
        assert given == ([] if expected is None else [expected])
