"""Problems, solutions and results as values: pickled, copied, compared, shown, made of arrays."""

import copy
import pickle
import re
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import fclib
from fclib.recorders._assemble import dense
from helpers import planted_global, planted_local


def local() -> Any:
    return planted_local(seed=1, nc=4, p=2).problem


def things() -> list[Any]:
    problem = local()
    result = fclib.solve(problem, history=True)
    hopeless = fclib.solve(fclib.LocalProblem(W=np.zeros((3, 3)), q=[-1, 0, 0], mu=[0.5]))
    assert hopeless.certificate is not None
    nsgs = fclib.find_solver("nsgs")
    found = [problem, planted_global(seed=2, nc=3, p=1).problem, result, hopeless, *result.stages]
    found += [result.solution, fclib.merit(problem, result), *nsgs.options]
    return [pytest.param(one, id=f"{k}-{type(one).__name__}") for k, one in enumerate(found)]


COPIES: list[Callable[[Any], Any]] = [
    lambda one: pickle.loads(pickle.dumps(one)),
    copy.copy,
    copy.deepcopy,
]


@pytest.mark.parametrize("one", things())
def test_copies_are_equal_and_hash_alike(one: Any) -> None:
    for make in COPIES:
        other = make(one)
        assert other is not one
        assert other == one
        assert hash(other) == hash(one)
        assert repr(other) == repr(one)
    assert one != "another"


def test_a_result_keeps_all_it_says() -> None:
    result = fclib.solve(local(), history=True)
    other = pickle.loads(pickle.dumps(result))
    for name in ("status", "iterations", "error", "cpu_s", "setup_s", "solver", "certificate"):
        assert getattr(other, name) == getattr(result, name)
    np.testing.assert_array_equal(other.history, result.history)
    assert [stage.time for stage in other.stages] == [stage.time for stage in result.stages]
    hopeless = fclib.solve(fclib.LocalProblem(W=np.zeros((3, 3)), q=[-1, 0, 0], mu=[0.5]))
    other = pickle.loads(pickle.dumps(hopeless))
    assert other.certificate.tolist() == [1]
    assert other.certificate_bound == hopeless.certificate_bound


def test_one_entry_makes_another_value() -> None:
    problem = local()
    result = fclib.solve(problem)
    assert problem != problem.replace(mu=problem.mu * [1, 1, 1, 1 + 1e-15])
    assert problem != problem.replace(info=fclib.ProblemInfo(title="another"))
    assert problem != problem.with_storage("dense")
    r = np.array(result.solution.r)
    r[3] += 1e-15
    assert result.solution != result.solution.replace(r=r)
    other = result.solution.replace(r=r + 1)
    assert fclib.merit(problem, other) != fclib.merit(problem, result)
    # times are no part of it
    assert fclib.solve(problem) == result
    assert fclib.solve(problem, tol=1e-3, solver="nsgs") != result


def test_tables_of_contacts_are_pickled_and_compared() -> None:
    problem = local()
    count = problem.nc
    numbers = np.arange(3.0 * count).reshape(count, 3)
    pairs = np.zeros((count, 2), np.int32)
    contacts = fclib.Contacts(
        body=pairs,
        shape=pairs,
        feature=np.arange(count, dtype=np.int32),
        point=numbers,
        normal=numbers,
        tangent=numbers,
        gap=np.zeros(count),
    )
    problem = problem.replace(contacts=contacts)
    other = pickle.loads(pickle.dumps(problem))
    assert other == problem
    np.testing.assert_array_equal(other.contacts.point, numbers)
    assert problem != problem.replace(contacts=None)


def test_solvers_are_pickled_by_their_names() -> None:
    info = fclib.find_solver("nsgs")
    assert pickle.loads(pickle.dumps(info)).name == "nsgs"


def test_islands_are_copied() -> None:
    islands = local().islands()
    other = pickle.loads(pickle.dumps(islands))
    assert other.count == islands.count
    np.testing.assert_array_equal(other.contact, islands.contact)


def test_problems_go_to_other_processes() -> None:
    problems = [planted_local(seed=seed, nc=2).problem for seed in range(3)]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(fclib.solve, problems))
    assert found == [fclib.solve(problem) for problem in problems]


def test_arrays_are_taken_where_a_solution_is(tmp_path: Path) -> None:
    problem: Any = planted_local(seed=3, nc=3).problem
    result = fclib.solve(problem)
    r = result.solution.r
    assert fclib.solve(problem, guess=r).iterations == 0
    assert fclib.solve(problem, guess=result).iterations == 0
    expected = fclib.merit(problem, fclib.Solution(r=r))
    assert fclib.merit(problem, list(r)) == expected == fclib.merit(problem, result)
    assert fclib.merit_1(problem, r) == fclib.merit_1(problem, result.solution)
    assert fclib.contact_merits(problem, r)["natural"].shape == (3,)
    path = tmp_path / "p.hdf5"
    guesses: list[Any] = [r, result]
    fclib.write(path, problem, r, guesses)
    stored = fclib.read_solution(path)
    assert stored is not None
    np.testing.assert_array_equal(stored.r, r)
    fclib.write_guesses(path, np.stack([r, r, 0 * r]))
    assert len(fclib.read_guesses(path)) == 3
    fclib.write_solution(path, 2 * r)
    assert fclib.read_solution(path) != stored
    with pytest.raises(fclib.ProblemError, match="guess: is not one-dimensional"):
        fclib.solve(problem, guess=np.zeros((3, 3)))
    with pytest.raises(fclib.ProblemError, match="solution: is not an array of"):
        fclib.merit(problem, "r")
    with pytest.raises(fclib.ProblemError, match="r: has 2 entries, expected m = 9"):
        fclib.merit(problem, [1, 2])
    with pytest.raises(fclib.ProblemError, match=r"guesses\[1\]: is not"):
        fclib.write(path, problem, r, [*guesses[:1], "r"])


@pytest.mark.parametrize(
    ("mu", "message"),
    [
        ([0.5, 0.5], ": has 2 entries, expected nc = 1, one for each contact"),
        ([], ": has 0 entries, expected nc = 1"),
        ([np.nan], r"\[0\]: the value is not a finite number"),
        ([-0.1], r"\[0\]: is -0.1, but must not be negative"),
    ],
)
def test_wrong_friction_is_refused_where_it_is_given(mu: Any, message: str) -> None:
    with pytest.raises(fclib.ProblemError, match="^mu" + message):
        fclib.LocalProblem(W=np.eye(3), q=np.zeros(3), mu=mu)
    with pytest.raises(fclib.ProblemError, match="^mu" + message):
        fclib.GlobalProblem(M=np.eye(2), H=np.zeros((2, 3)), f=np.zeros(2), w=np.zeros(3), mu=mu)
    with pytest.raises(fclib.ProblemError, match="^mu" + message):
        fclib.LocalProblem(W=np.eye(3), q=np.zeros(3), mu=[0.5]).replace(mu=mu)
    with pytest.raises(fclib.ProblemError, match="^mu_r" + message):
        fclib.LocalRollingProblem(spacedim=3, W=np.eye(3), q=np.zeros(3), mu=[0.5], mu_r=mu)


@pytest.mark.parametrize("one", things())
def test_notebooks_show_a_table(one: Any) -> None:
    if isinstance(one, fclib.OptionInfo) or type(one).__name__ == "Stage":
        return
    shown = one._repr_html_()
    assert shown.startswith("<table>")
    assert f"fclib.{type(one).__name__}" in shown


def test_what_is_shown_is_text_and_no_markup() -> None:
    problem = local().replace(info=fclib.ProblemInfo(title="<script>"))
    assert "&lt;script&gt;" in problem._repr_html_()
    assert "M3DFC" in problem._repr_html_()


def test_values_are_compared_with_nothing() -> None:
    for thing in things():
        assert (thing == None, thing != None) == (False, True)  # noqa: E711


def wrong_places() -> dict[str, Any]:
    """Matrices of SciPy that contradict themselves, which SciPy does not look at."""
    found = {}
    for name, array, place, value in (
        ("W/i[0]", "indices", 0, 6),
        ("W/i[0]", "indices", 0, -1),
        ("W/i[0]", "indices", 0, 2**31 - 1),
        ("W/p[3]", "indptr", 2, 1000),
        ("W/p[2]", "indptr", 2, -1),
        ("W/p[0]", "indptr", 0, 5),
        ("W/i", "indptr", 6, 1000),
    ):
        matrix = sp.csr_array(np.ones((6, 6)))
        getattr(matrix, array)[place] = value
        found[f"{array}[{place}] = {value}"] = (matrix, name)
    return found


@pytest.mark.parametrize("what", wrong_places())
def test_a_matrix_that_contradicts_itself_is_refused_where_it_is_made(what: str) -> None:
    matrix, where = wrong_places()[what]
    with pytest.raises(fclib.ProblemError, match=f"^{re.escape(where)}: "):
        fclib.LocalProblem(W=matrix, q=np.ones(6), mu=[0.5, 0.5])


@pytest.mark.parametrize("what", [*wrong_places(), "blocks", "keys"])
def test_a_matrix_that_contradicts_itself_ends_no_process(what: str) -> None:
    """SciPy would read beyond its arrays as soon as it turns one into another form."""
    if what == "blocks":
        matrix: Any = sp.bsr_array(np.ones((6, 6)), blocksize=(3, 3))
        matrix.indices[0] = 10**7
    elif what == "keys":
        matrix = sp.dok_array(np.ones((6, 6)))
        matrix._dict[10**7, 1] = 1.0
    else:
        matrix, _ = wrong_places()[what]
    q, mu = np.array([-1.0, 0, 0, 1, 0, 0]), [0.5, 0.5]
    problem = fclib.LocalProblem(W=np.eye(6), q=q, mu=mu)
    with pytest.raises(fclib.ProblemError, match=r"^problem 1: W"):
        fclib.solve_batch([np.eye(6), matrix], [q, q], 0.5)
    with pytest.raises(fclib.ProblemError, match=r"^W"):
        fclib.jvp(problem, fclib.solve(problem), W=matrix)
    with pytest.raises(fclib.ProblemError, match=r"^jacobian"):
        dense(matrix, "jacobian", (6, 6))
    with pytest.raises(fclib.ProblemError, match=r"^W"):
        problem.replace(W=matrix)


def test_a_sparse_vector_is_no_matrix() -> None:
    with pytest.raises(fclib.ProblemError, match="W: is not a matrix"):
        fclib.LocalProblem(W=sp.coo_array(np.arange(3.0)), q=np.ones(3), mu=[0.5])


@pytest.mark.parametrize(
    "stored",
    [
        lambda x: x.astype(np.int64 if x.dtype.kind == "i" else np.float32),
        lambda x: x.astype(x.dtype.newbyteorder(">")),
        lambda x: np.repeat(x, 2)[::2],
        lambda x: np.require(x, requirements="O").view(),
        lambda x: np.frombuffer(x.tobytes(), x.dtype),
        lambda x: np.ma.array(x),
    ],
    ids=["other type", "other bytes", "gaps", "view", "read only", "no mask"],
)
def test_arrays_give_the_same_problem_however_they_are_stored(stored: Any) -> None:
    W = sp.csr_array(np.array([[2.0, 0.5, 0], [0.5, 2, 0], [0, 0, 2]]))
    q, mu = np.array([-1.0, 0.25, 0]), np.array([0.5])
    assert W.indices.dtype == np.int32
    wanted = fclib.LocalProblem(W=W, q=q, mu=mu)
    other = sp.csr_array(W)
    other.data, other.indices, other.indptr = stored(W.data), stored(W.indices), stored(W.indptr)
    assert fclib.LocalProblem(W=other, q=stored(q), mu=stored(mu)) == wanted


def test_masked_entries_are_refused() -> None:
    whole = {"W": np.eye(3), "q": np.array([-1.0, 0, 0]), "mu": np.array([0.5])}
    for name in whole:
        data: dict[str, Any] = dict(whole)
        masked = np.ma.array(data[name])
        fclib.LocalProblem(**data | {name: masked})
        masked[(0,) * masked.ndim] = np.ma.masked
        with pytest.raises(fclib.ProblemError, match=f"^{name}: has masked entries"):
            fclib.LocalProblem(**data | {name: masked})
        with pytest.raises(fclib.ProblemError, match=f"^{name}: has masked entries"):
            fclib.solve_batch(**{k: v[None] for k, v in (data | {name: masked}).items()})
    guess = np.ma.array(np.ones(3), mask=[True, False, False])
    with pytest.raises(fclib.ProblemError, match="masked"):
        fclib.solve(fclib.LocalProblem(W=np.eye(3), q=[-1, 0, 0], mu=[0.5]), guess=guess)
