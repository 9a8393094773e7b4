"""The work of every solver, against the table in the repository: tests/golden_work.py."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

import fclib
import golden_work
from golden_work import Row

EXACT = Row("ball", "auto", "converged", 100, "sweeps 1/90/0; newton 2/10/12")
TENTH = replace(EXACT, may_differ="10 %")
FREE = replace(EXACT, may_differ="free")


def test_the_work_is_that_of_the_table() -> None:
    found = golden_work.differences(golden_work.read(), golden_work.runs())
    assert not found, "\n".join(
        ["if this is meant, make the table anew: python tests/golden_work.py --write", *found]
    )


def test_the_table_has_every_solver_and_formulation() -> None:
    table = golden_work.read()
    expected = {solver.name for solver in fclib.solvers() if solver.origin == "fclib"}
    assert {row.solver for row in table.values()} == expected
    kinds = {
        (type(problem), problem.spacedim, problem.p > 0) for _, problem, _ in golden_work.problems()
    }
    plain = {(kind, d) for kind, d, _ in kinds}
    for local, on_bodies, dimensions in (
        (fclib.LocalProblem, fclib.GlobalProblem, (2, 3)),
        (fclib.LocalRollingProblem, fclib.GlobalRollingProblem, (3, 5)),
    ):
        for d in dimensions:
            assert {(local, d), (on_bodies, d)} <= plain
            assert (on_bodies, d, True) in kinds
    assert max(row.iterations for row in table.values()) == golden_work.ITERATIONS
    # the table is of use where nearly all of it is compared to the last iteration
    marks = [row.may_differ for row in table.values()]
    assert set(marks) == {"", "10 %", "free"}
    assert marks.count("") > 0.9 * len(marks)


@pytest.mark.parametrize(
    ("was", "now", "differs", "differs_exactly"),
    [
        (EXACT, EXACT, False, False),
        (EXACT, replace(EXACT, may_differ="free"), False, False),  # a mark is no work
        (EXACT, replace(EXACT, iterations=101), True, True),
        (EXACT, replace(EXACT, status="stalled"), True, True),
        (EXACT, replace(EXACT, stages="sweeps 1/90/0; newton 2/10/13"), True, True),
        (TENTH, replace(TENTH, iterations=110), False, True),
        (TENTH, replace(TENTH, iterations=112), True, True),
        (TENTH, replace(TENTH, stages="sweeps 1/90/0; newton 2/10/14"), True, True),
        (TENTH, replace(TENTH, stages="sweeps 1/90/0"), True, True),
        (TENTH, replace(TENTH, status="stalled"), True, True),
        (FREE, replace(FREE, status="stalled", iterations=7), False, True),
        (EXACT, replace(EXACT, iterations=7, may_differ="clock"), False, False),
        (EXACT, None, True, True),
        (FREE, None, True, True),
        (None, EXACT, True, True),
    ],
)
def test_a_difference_is_seen(
    was: Row | None, now: Row | None, differs: bool, differs_exactly: bool
) -> None:
    old, new = ({row.key: row} if row else {} for row in (was, now))
    assert bool(golden_work.differences(old, new)) == differs
    exactly = golden_work.differences(old, new, exact=True)
    assert bool(exactly) == differs_exactly
    if exactly:
        assert exactly[0].startswith("ball | auto")
        assert str(was or "not there") in exactly[0]
        assert str(now or "not there") in exactly[0]


def test_rounding_leaves_a_problem_what_it_is() -> None:
    for name, problem, _ in golden_work.problems():
        for attribute in golden_work.DATA:
            was: Any = getattr(problem, attribute, None)
            if was is None:
                continue
            is_: Any = getattr(golden_work.nearby(problem, 1), attribute)
            assert type(was) is type(is_), (name, attribute)
            assert abs(was - is_).max() <= 2 * golden_work.ROUNDING * abs(was).max()
