"""Many small problems in one call."""

import copy
import pickle
import subprocess
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from capi_library import ROOT, compile_program


def problems(nc: int, count: int, spacedim: int = 3, seed: int = 0) -> tuple[Any, Any, Any]:
    """W of rank 6 at most, so that many contacts are redundant."""
    rng = np.random.default_rng(seed)
    h = rng.normal(size=(count, 6, spacedim * nc))
    q = np.einsum("kij,ki->kj", h, rng.normal(size=(count, 6)))
    return np.einsum("kij,kil->kjl", h, h), q, rng.uniform(0, 1, (count, nc))


@pytest.mark.parametrize("spacedim", [2, 3])
@pytest.mark.parametrize("nc", [1, 3, 8])
def test_each_is_solved_and_judged_by_the_merit(nc: int, spacedim: int) -> None:
    W, q, mu = problems(nc, 60, spacedim)
    found = fclib.solve_batch(W, q, mu, spacedim=spacedim)
    assert found.converged.all()
    assert found.by_auto <= 3
    for k in range(60):
        problem = fclib.LocalProblem(spacedim=spacedim, W=W[k], q=q[k], mu=mu[k])
        merit = fclib.merit(problem, fclib.Solution(r=found.r[k], u=found.u[k]))
        assert merit.error == pytest.approx(found.error[k], rel=1e-9, abs=1e-15)
        assert merit.error <= 1e-8


def test_numbers_of_contacts_may_vary() -> None:
    parts = [problems(nc, 1, seed=nc) for nc in (1, 4, 2)]
    W, q, mu = ([part[k][0] for part in parts] for k in range(3))
    lists = fclib.solve_batch(W, q, mu)
    flat = fclib.solve_batch(
        np.concatenate([w.ravel() for w in W]),
        np.concatenate(q),
        np.concatenate(mu),
        contacts=[1, 4, 2],
        threads=2,
    )
    assert np.array_equal(lists.r, flat.r)
    assert flat.offsets is not None
    assert flat.offsets.tolist() == [0, 3, 15, 21]
    again = fclib.solve_batch(W, q, mu, guess=np.split(flat.r, flat.offsets[1:-1]))
    assert again.iterations.sum() <= flat.iterations.sum()
    assert repr(flat).startswith("<BatchResult: 3 of 3 converged")


def test_results_are_values() -> None:
    W, q, mu = problems(2, 4)
    found, again = (fclib.solve_batch(W, q, mu) for _ in range(2))
    assert found == again
    assert hash(found) == hash(again)
    assert pickle.loads(pickle.dumps(found)) == copy.deepcopy(found) == found
    assert found != fclib.solve_batch(W[:3], q[:3], mu[:3])
    assert found != fclib.solve_batch(W, 2 * q, mu)
    assert found != "found"


def test_what_is_not_finished_goes_the_whole_way() -> None:
    W, q, mu = problems(1, 3)
    W[1] = 0
    q[1] = [-1, 0, 0]
    found = fclib.solve_batch(W, q, mu)
    assert found.statuses[found.status[1]] == "infeasible"
    assert found.by_auto == 1
    assert found.converged.tolist() == [True, False, True]


def test_wrong_input_is_refused_by_its_name() -> None:
    W, q, mu = problems(2, 4)
    bad = mu.copy()
    bad[3, 1] = -0.1
    for arguments, words in [
        ((W, q, bad), "problem 3: mu: contact 1"),
        ((W, q, mu[:, :1].T), "mu: has the shape"),
        ((W, q[:3], mu), r"q: has the shape \(3, 6\)"),
        ((W[0], q, mu), "W: has the shape"),
        ((np.where(W > 1, np.nan, W), q, mu), "W: has an entry that is not finite"),
        ((W.astype(complex), q, mu), "W: is not an array of real numbers"),
    ]:
        with pytest.raises(fclib.ProblemError, match=words):
            fclib.solve_batch(*arguments)
    with pytest.raises(fclib.OptionError, match="threads"):
        fclib.solve_batch(W, q, mu, threads=-1)
    with pytest.raises(fclib.OptionError, match="time_limit"):
        fclib.solve_batch(W, q, mu, time_limit=0)
    with pytest.raises(fclib.ProblemError, match="q: has 3 problems, expected 4"):
        fclib.solve_batch(W.ravel(), list(q[:3]), mu, contacts=[2] * 4)


def test_a_limit_of_time_leaves_the_rest_with_their_merit() -> None:
    W, q, mu = problems(6, 20000)
    found = fclib.solve_batch(W, q, mu, time_limit=1e-3)
    late = found.status == found.statuses.index("time_limit")
    assert late.any()
    assert (found.r[late] == 0).all()
    assert (found.error[late] > 1e-8).all()


def test_the_lock_of_python_is_released() -> None:
    W, q, mu = problems(6, 20000)
    counted = 0
    done = threading.Event()

    def solve() -> None:
        fclib.solve_batch(W, q, mu)
        done.set()

    thread = threading.Thread(target=solve)
    thread.start()
    while not done.is_set():
        counted += 1
    thread.join()
    assert counted > 1000


def test_from_c(tmp_path: Path) -> None:
    program = compile_program(ROOT / "tests/capi/batch.c", tmp_path / "batch", "-lm")
    done = subprocess.run([program], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
