"""Renumbered copies: the same mechanics, so that the solution of one is that of the other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import bench
from fclib.bench import comparison, profiles
from fclib.bench.copies import Copy
from helpers import converged, planted_global, planted_local, planted_rolling

PROBLEMS = {
    "local": planted_local(3, nc=5).problem,
    "planar": planted_local(3, d=2, nc=4).problem,
    "joints": planted_global(2, nc=4, p=2).problem,
    "by columns": planted_global(2, nc=4, p=2, storage="csc").problem,
    "dense": planted_global(2, nc=4, storage="dense").problem,
    "rolling": planted_rolling(5, 3)[0],
    "planar rolling": planted_rolling(3, 3)[0],
    "global rolling": planted_global(2, nc=4, rolling=True).problem,
    "no contact": fclib.LocalProblem(W=np.zeros((0, 0)), q=[], mu=[]),
}
KNOWS = """
import numpy as np
import fclib

@fclib.solver("knows")
def knows(problem, r, monitor):
    '''Knows one answer by heart.'''
    monitor.stop(r)
    if problem.nc == 5 and np.allclose(problem.q, Q):
        r[:] = R
    monitor.stop(r)
"""


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_solution_of_a_copy_is_one_of_the_problem(name: str) -> None:
    problem = PROBLEMS[name]
    for number in (1, 2):
        copy = Copy(problem, number)
        result = converged(copy.problem, tol=1e-11)
        vectors = {k: getattr(result.solution, k) for k in "vurl"}
        back = copy.back({k: value for k, value in vectors.items() if value is not None})
        carried = fclib.Solution(**back)
        there, here = (
            fclib.merit(which, of)
            for which, of in ((copy.problem, result.solution), (problem, carried))
        )
        for error in ("natural", "scaled_natural", "error"):
            assert getattr(here, error) == pytest.approx(getattr(there, error), rel=0.1, abs=1e-14)
        assert (here.open, here.stick, here.slide) == (there.open, there.stick, there.slide)
        if problem.nc:
            assert fclib.digest(copy.problem) != fclib.digest(problem)
            again = Copy(problem, number)
            assert fclib.digest(again.problem) == fclib.digest(copy.problem)


def test_an_answer_known_by_heart_solves_no_copy(tmp_path: Path) -> None:
    planted = planted_local(3, nc=5)
    assert isinstance(planted.problem, fclib.LocalProblem)
    fclib.write(tmp_path / "known.hdf5", planted.problem)
    known = {"Q": planted.problem.q, "R": planted.solution.r}
    source = KNOWS
    for letter, vector in known.items():
        source = source.replace(f" {letter}", f" np.array({vector.tolist()!r})")
    (tmp_path / "knows.py").write_text(source)
    entries: dict[str, Any] = {
        "solvers": ["knows", "nsgs"],
        "modules": ["knows.py"],
        "tolerances": [1e-8],
        "repeats": 3,
        "renumber": True,
        "problems": [{"files": "known.hdf5"}],
    }
    chosen = bench.Campaign.of(entries, tmp_path)
    bench.run_campaign(chosen, tmp_path / "runs.sqlite")
    with bench.Store(tmp_path / "runs.sqlite") as store:
        rows = store.results()
    solved = {(row["solver"], row["repeat"]): row["solved"] for row in rows}
    assert [solved["nsgs", k] for k in range(3)] == [1, 1, 1]
    assert [solved["knows", k] for k in range(3)] == [1, 0, 0]
    assert sorted({row["copy"] for row in rows}) == [0, 1, 2]
    # the median over the copies: what is known by heart is no solution of the instance
    costs = comparison.gather(profiles.load(tmp_path / "runs.sqlite"))
    solved_by = dict(zip(costs.solvers, np.isfinite(costs.values).sum(axis=0), strict=True))
    assert solved_by == {"knows": 0, "nsgs": 1}
    # a copy is no repeat of the problem itself
    plain = bench.Campaign.of(entries | {"renumber": False}, tmp_path)
    keys = [
        {job.key for job in c.plan() if job.repeat == k} for c in (chosen, plain) for k in (0, 1)
    ]
    assert keys[0] == keys[2]
    assert not keys[1] & keys[3]
