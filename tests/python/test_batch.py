"""Many small problems in one call."""

import copy
import pickle
import signal
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from capi_library import ROOT, compile_program
from helpers import ran


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
        assert merit.error <= found.error[k] <= merit.error + 1e-3 * 1e-8
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
    for arguments, words in [
        ((W, q, mu[:, :1].T), "mu: has the shape"),
        ((W, q[:3], mu), r"q: has the shape \(3, 6\)"),
        ((W[0], q, mu), "W: has the shape"),
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


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"tol": "small"}, "tol: 'small' is not a number"),
        ({"tol": None}, "tol: None is not a number"),
        ({"tol": np.ones(2)}, "tol: array.* is not a number"),
        ({"threads": "all"}, "threads: 'all' is not a 32-bit integer"),
        ({"threads": 1.5}, "threads: 1.5 is not a 32-bit integer"),
        ({"threads": 2**40}, "threads: [0-9]+ is not a 32-bit integer"),
        ({"time_limit": "1 s"}, "time_limit: '1 s' is not a number of seconds"),
        ({"spacedim": 3.0}, "spacedim: is 3.0, expected 2 or 3"),
        ({"spacedim": "3"}, "spacedim: is '3', expected 2 or 3"),
        ({"coupled": "no"}, "coupled: is 'no', expected True or False"),
    ],
)
def test_an_argument_of_a_wrong_type_is_named(wrong: dict[str, Any], words: str) -> None:
    W, q, mu = problems(2, 2)
    with pytest.raises(fclib.Error, match=f"^{words}"):
        fclib.solve_batch(W, q, mu, **wrong)
    with pytest.raises(fclib.Error, match=f"^{words}"):
        fclib.solve_batch_global(W, W, q, mu, **wrong)
    if wrong.keys() & {"threads", "spacedim"}:
        with pytest.raises(fclib.Error, match=f"^{words}"):
            fclib.vjp_batch(W, q, mu, np.zeros_like(q), **wrong)


@pytest.mark.parametrize("threads", [1, 3])
def test_a_bad_problem_has_its_status_and_hurts_no_other(threads: int) -> None:
    W, q, mu = problems(2, 200)
    good = fclib.solve_batch(W, q, mu)
    mu = mu.copy()
    mu[3, 1] = -0.1
    W[70, 2, 2] = np.nan
    q[150, 0] = np.inf
    found = fclib.solve_batch(W, q, mu, threads=threads)
    bad = found.status == found.statuses.index("invalid")
    assert np.flatnonzero(bad).tolist() == [3, 70, 150]
    assert found.wrong.startswith("problem 3: mu: contact 1 has -0.1")
    assert np.isnan(found.r[bad]).all()
    assert np.isnan(found.u[bad]).all()
    assert np.isinf(found.error[bad]).all()
    assert np.array_equal(found.r[~bad], good.r[~bad])
    assert good.wrong == ""


@pytest.mark.parametrize("contacts", [None, [2, 2, 2, 2, 2, 2]])
def test_masses_that_are_none_are_invalid(contacts: list[int] | None) -> None:
    rng = np.random.default_rng(5)
    J, v = rng.normal(size=(6, 6, 4)), rng.normal(size=(6, 4))
    given: dict[str, Any] = {
        "jacobian": J if contacts is None else J.reshape(-1, 4),
        "velocity": v, "mu": 0.5, "contacts": contacts,
    }  # fmt: skip
    diagonal = rng.uniform(0.5, 2, (6, 4))
    good = fclib.solve_batch(**given, inverse_mass=diagonal)
    assert good.converged.all()
    diagonal[4, 1] = 0  # fixed
    full = np.stack([np.diag(one) for one in diagonal])
    full[1, 2, 2] = -1
    full[2, 0, 1] = 0.3  # not symmetric
    full[3, 0, 0] = np.inf
    full[5, :2, :2] = [[1, 2], [2, 1]]
    found = fclib.solve_batch(**given, inverse_mass=full)
    names = [found.statuses[k] for k in found.status]
    assert names == ["converged", "invalid", "invalid", "invalid", "converged", "invalid"]
    assert found.wrong.startswith("problem 1: inverse_mass: is not symmetric, or negative")
    assert np.allclose(found.r.reshape(6, -1)[0], good.r.reshape(6, -1)[0], atol=1e-7)
    diagonal[3, 2] = -0.1
    found = fclib.solve_batch(**given, inverse_mass=diagonal)
    assert found.statuses[found.status[3]] == "invalid"
    assert np.count_nonzero(found.converged) == 5


def test_edges() -> None:
    none = fclib.solve_batch(np.empty((0, 6, 6)), np.empty((0, 6)), np.empty((0, 2)))
    assert len(none) == 0
    assert repr(none) == "<BatchResult: 0 of 0 converged, worst error 0.0e+00>"
    empty = fclib.solve_batch([np.empty((0, 0)), np.eye(3)], [[], [-1, 0, 0]], [[], [0]])
    assert empty.converged.all()
    assert empty.r.tolist() == [1, 0, 0]
    no_contact = fclib.solve_batch(np.empty((2, 0, 0)), np.empty((2, 0)), np.empty((2, 0)))
    assert no_contact.converged.all()


def islands(count: int, seed: int = 0) -> tuple[Any, Any, Any, Any]:
    """Six contacts in three islands of two, which are not in a row, and the pattern of W."""
    rng = np.random.default_rng(seed)
    near = np.equal.outer(np.arange(6) % 3, np.arange(6) % 3)
    h = rng.normal(size=(count, 21, 18)) * np.kron(
        np.equal.outer(np.arange(21) % 3, np.arange(6) % 3), np.ones(3)
    )
    W = np.einsum("kij,kil->kjl", h, h)
    starts = np.arange(0, 13, 2)
    return (
        W,
        rng.normal(size=(count, 18)),
        rng.uniform(0, 1, (count, 6)),
        (starts, np.nonzero(near)[1]),
    )


def test_w_by_blocks_is_the_same_problem() -> None:
    sp = pytest.importorskip("scipy.sparse")
    W, q, mu, pattern = islands(40)
    dense = fclib.solve_batch(W, q, mu)
    blocks = W.reshape(40, 6, 3, 6, 3).swapaxes(2, 3)
    near = np.equal.outer(np.arange(6) % 3, np.arange(6) % 3)
    shared = fclib.solve_batch(blocks[:, near], q, mu, pattern=pattern)
    assert np.array_equal(dense.r, shared.r)
    assert np.array_equal(dense.error, shared.error)
    for convert in (sp.csr_array, sp.csc_matrix, sp.bsr_array):
        each = fclib.solve_batch([convert(one) for one in W], list(q), list(mu), threads=2)
        assert np.array_equal(dense.r.ravel(), each.r)
    # problems of other sizes and patterns between them
    mixed = fclib.solve_batch(
        [sp.csr_array(W[0]), sp.csr_array((0, 0)), sp.csr_array(W[1][:3, :3]), sp.csr_array(W[1])],
        [q[0], [], q[1][:3], q[1]],
        [mu[0], [], mu[1][:1], mu[1]],
    )
    assert mixed.converged.all()
    assert np.array_equal(mixed.r[:18], dense.r[0])
    assert np.array_equal(mixed.r[21:], dense.r[1])


def test_islands_do_not_disturb_each_other() -> None:
    W, q, mu, _ = islands(30, seed=1)
    q[:, 0:3] *= 1e-6  # one of slow contacts
    q[:, 9:12] *= 1e-6
    found = fclib.solve_batch(W, q, mu, tol=1e-10)
    assert found.converged.all()
    for k in range(30):
        problem = fclib.LocalProblem(W=W[k], q=q[k], mu=mu[k])
        assert fclib.merit(problem, fclib.Solution(r=found.r[k])).error <= 1e-10
        ones = [np.r_[3 * a : 3 * a + 3, 3 * a + 9 : 3 * a + 12] for a in range(3)]
        for a, at in enumerate(ones):
            alone = fclib.solve_batch(W[k][np.ix_(at, at)][None], q[k][None, at], mu[k][None, a::3])
            assert alone.converged.all()
            np.testing.assert_allclose(alone.u[0], found.u[k][at], atol=1e-7 * np.abs(q[k]).max())


def test_wrong_patterns_are_refused_by_their_name() -> None:
    W, q, mu, (starts, columns) = islands(2)
    blocks = np.zeros((2, 12, 3, 3))
    cases: list[tuple[dict[str, Any], str]] = [
        ({"pattern": (starts,)}, r"pattern: is not \(starts, columns\)"),
        ({"pattern": (starts, columns[1:])}, "pattern: the last of starts"),
        ({"pattern": (starts * 1.0, columns)}, "pattern: starts is not a list of whole numbers"),
        ({"pattern": (starts, columns), "contacts": [6, 6]}, "pattern: is for problems with"),
        ({"pattern": (starts[[0, 2, 1, 3, 4, 5, 6]], columns)}, "starts: problem 0"),
    ]
    for arguments, words in cases:
        with pytest.raises(fclib.ProblemError, match=words):
            fclib.solve_batch(blocks, q, mu, **arguments)
    with pytest.raises(
        fclib.ProblemError, match=r"W: has the shape .* expected \(count, 12, 3, 3\)"
    ):
        fclib.solve_batch(W, q, mu, pattern=(starts, columns))
    found = fclib.solve_batch(blocks, q, mu, pattern=(starts, columns + 1))
    assert found.wrong == "problem 0: W: has a block whose column is out of range"


def global_problems(count: int, seed: int = 0) -> tuple[Any, Any, Any, Any, Any]:
    """Two bodies that do not touch, one with a full inertia, two contacts each."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(count, 6, 6))
    M = np.zeros((count, 12, 12))
    M[:, :6, :6] = np.einsum("kij,klj->kil", a, a) + np.eye(6)
    M[:, 6:, 6:] = 2 * np.eye(6)
    H = np.zeros((count, 12, 12))
    H[:, :6, :6], H[:, 6:, 6:] = rng.normal(size=(2, count, 6, 6))
    return (
        M,
        H,
        rng.normal(size=(count, 12)),
        rng.normal(size=(count, 12)),
        rng.uniform(0, 1, (count, 4)),
    )


def test_global_problems_as_simulators_hold_them() -> None:
    M, H, f, w, mu = global_problems(50)
    found = fclib.solve_batch_global(M, H, f, mu, w=w, threads=2)
    assert found.converged.all()
    assert found.by_auto == 0
    assert found.v is not None
    for k in range(50):
        problem = fclib.GlobalProblem(M=M[k], H=H[k], f=f[k], w=w[k], mu=mu[k])
        merit = fclib.merit(problem, fclib.Solution(r=found.r[k], u=found.u[k], v=found.v[k]))
        assert merit.error <= found.error[k] * (1 + 1e-6)
        assert found.error[k] <= 1e-8
        assert merit.dynamics <= 1e-12
    # a simulator's Jacobian, by rows, is not copied to another one
    J = np.ascontiguousarray(H.swapaxes(1, 2))
    again = fclib.solve_batch_global(M, J.swapaxes(1, 2), f, mu, w=w)
    assert np.array_equal(found.r, again.r)
    # of different sizes
    lists = fclib.solve_batch_global(
        [M[0], M[1][:6, :6], np.empty((0, 0))],
        [H[0], H[1][:6, :3], np.empty((0, 0))],
        [f[0], f[1][:6], []],
        [mu[0], mu[1][:1], []],
    )
    assert lists.converged.all()
    assert lists.offsets is not None
    assert lists.offsets.tolist() == [0, 12, 15, 15]
    assert lists.v is not None
    assert lists.v.shape == (18,)


def test_bad_global_problems_are_named() -> None:
    M, H, f, _, mu = global_problems(4)
    M[1, 0, 0] = -1
    f[2, 3] = np.nan
    found = fclib.solve_batch_global(M, H, f, mu)
    assert found.wrong == "problem 1: M: is not positive definite"
    assert [found.statuses[k] for k in found.status[[0, 1, 2, 3]]] == [
        "converged", "invalid", "invalid", "converged",
    ]  # fmt: skip
    for arguments, words in [
        ((M[0], H, f, mu), "M: has the shape"),
        ((M, H[:, :5], f, mu), "H: has the shape"),
        ((M, H, f[:, :5], mu), "f: has the shape"),
        ((list(M), H, f, mu), "H: is not a list of 4 problems, as M is"),
        ((list(M), [one[:5] for one in H], list(f), list(mu)), "H: problem 0 has the shape"),
    ]:
        with pytest.raises(fclib.ProblemError, match=words):
            fclib.solve_batch_global(*arguments)


def test_what_bodies_do_not_finish_goes_the_whole_way() -> None:
    # two walls approach: no velocity of the body satisfies both
    H = np.array([[[1.0, 0, 0, -1, 0, 0], [0, 1, 0, 0, 1, 0], [0, 0, 1, 0, 0, 1]]])
    w = np.array([[-1.0, 0, 0, -1, 0, 0]])
    found = fclib.solve_batch_global(np.eye(3)[None], H, np.zeros((1, 3)), 0.5, w=w)
    assert found.by_auto == 1
    assert found.statuses[found.status[0]] == "infeasible"


def planted(nc: int, count: int, seed: int) -> tuple[Any, Any, Any, Any, Any]:
    """Problems with known r and u, all three statuses, mu = 0, and masses of all sizes."""
    rng = np.random.default_rng(seed)
    size = np.repeat(10.0 ** rng.uniform(-3, 3, (count, nc)), 3, axis=1)
    h = rng.normal(size=(count, 3 * nc + 2, 3 * nc)) * size[:, None, :]
    W = np.einsum("kij,kil->kjl", h, h)
    mu = rng.uniform(0, 1, (count, nc)) * (rng.random((count, nc)) > 0.2)
    kind = rng.integers(0, 3, (count, nc))
    angle = rng.uniform(0, 2 * np.pi, (count, nc))
    along = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    normal = np.where(kind == 0, 0, rng.uniform(0.5, 2, (count, nc)))
    part = np.where(kind == 1, rng.uniform(0, 0.9, (count, nc)), 1) * mu * normal
    r = np.concatenate([normal[..., None], part[..., None] * along], axis=-1)
    speed = np.where(kind == 2, rng.uniform(0.1, 1, (count, nc)), 0)
    u = np.concatenate([np.where(kind == 0, 1.0, 0)[..., None], -speed[..., None] * along], axis=-1)
    u[..., 1:] += np.where(kind == 0, 0.3, 0)[..., None]
    r = r.reshape(count, -1) / size
    u = u.reshape(count, -1) * size
    return W, u - np.einsum("kij,kj->ki", W, r), mu, r, u


@pytest.mark.parametrize("tol", [1e-3, 1e-8])
def test_planted_answers_with_masses_of_all_sizes(tol: float) -> None:
    W, q, mu, r, _ = planted(4, 300, seed=2)
    found = fclib.solve_batch(W, q, mu, tol=tol)
    assert found.converged.all()
    for k in range(0, 300, 10):
        problem = fclib.LocalProblem(W=W[k], q=q[k], mu=mu[k])
        assert fclib.merit(problem, fclib.Solution(r=r[k])).error <= 1e-8
        error = fclib.merit(problem, fclib.Solution(r=found.r[k], u=found.u[k])).error
        assert error <= found.error[k] <= tol


LAWS = [(3, "rolling"), (5, "rolling"), (4, "spin"), (4, "ellipsoid"), (6, "spin")]


@pytest.mark.parametrize(("spacedim", "law"), LAWS)
def test_contacts_that_resist_rolling_and_spin(spacedim: int, law: str) -> None:
    """Local, by blocks, of all sizes, and global: as one by one, and judged by the merit."""
    rng = np.random.default_rng(spacedim)
    count, nc, n = 12, 3, 20
    H = rng.normal(size=(count, n, spacedim * nc))
    mass, w = rng.uniform(0.5, 2, (count, n)), rng.normal(size=(count, spacedim * nc))
    mu = rng.uniform(0, 1, (count, nc))
    turning: dict[str, Any] = {"mu_r": rng.uniform(0, 0.2, (count, nc))}
    if law != "rolling":
        rolls = turning if spacedim == 6 else {}
        turning = {**rolls, "mu_s": rng.uniform(0, 0.2, (count, nc)), "coupled": law == "ellipsoid"}
    W = np.einsum("kij,ki,kil->kjl", H, 1 / mass, H)
    found = fclib.solve_batch(W, w, mu, spacedim=spacedim, **turning)
    assert found.converged.all()
    assert found.by_auto == count
    of_bodies = fclib.solve_batch_global(
        np.stack([np.diag(m) for m in mass]), H, np.zeros((count, n)), mu, w=w, spacedim=spacedim,
        threads=2, **turning,
    )  # fmt: skip
    assert of_bodies.converged.all()
    kind: Any = fclib.LocalRollingProblem if law == "rolling" else fclib.LocalSpinProblem
    for k in range(count):
        own = {name: value[k] for name, value in turning.items() if name != "coupled"}
        if law != "rolling":
            own["coupled"] = int(turning["coupled"])
        problem = kind(spacedim=spacedim, W=W[k], q=w[k], mu=mu[k], **own)
        for batch in (found, of_bodies):
            solution = fclib.Solution(r=batch.r[k], u=batch.u[k])
            assert fclib.merit(problem, solution).error <= 1.01e-8
        assert batch.v is not None
        np.testing.assert_allclose(mass[k] * batch.v[k], H[k] @ batch.r[k], atol=1e-12)
        np.testing.assert_array_equal(found.r[k], fclib.solve(problem).solution.r)
    # by blocks, and as lists of several sizes
    starts, columns = nc * np.arange(nc + 1), np.tile(np.arange(nc), nc)
    blocks = W.reshape(count, nc, spacedim, nc, spacedim).swapaxes(2, 3)
    blocks = blocks.reshape(count, nc * nc, spacedim, spacedim)
    by_blocks = fclib.solve_batch(
        blocks, w, mu, spacedim=spacedim, pattern=(starts, columns), **turning
    )
    assert by_blocks.converged.all()
    np.testing.assert_allclose(by_blocks.u, found.u, atol=1e-6)
    d = spacedim
    mixed: dict[str, Any] = {name: value if name == "coupled" else [value[0], value[1][:1]]
             for name, value in turning.items()}  # fmt: skip
    lists = fclib.solve_batch(
        [W[0], W[1][:d, :d]], [w[0], w[1][:d]], [mu[0], mu[1][:1]], spacedim=d, **mixed
    )
    assert lists.converged.all()
    np.testing.assert_array_equal(lists.r[: nc * d], found.r[0])


def test_wrong_moments_are_named() -> None:
    W, q = np.stack([np.eye(4)] * 3), -np.ones((3, 4))
    mu_s = np.array([[0.1], [-1], [0.1]])
    found = fclib.solve_batch(W, q, 0.5, spacedim=4, mu_s=mu_s)
    assert found.converged.tolist() == [True, False, True]
    assert found.statuses[found.status[1]] == "invalid"
    assert np.isnan(found.r[1]).all()
    assert found.wrong.startswith("problem 1: mu_s: contact 0 has -1")
    M = np.stack([np.eye(4), -np.eye(4)])
    bad = fclib.solve_batch_global(M, M, q[:2], 0.5, spacedim=4, mu_s=0.1, coupled=True)
    assert bad.converged.tolist() == [True, False]
    assert "positive definite" in bad.wrong
    late = fclib.solve_batch(W, q, 0.5, spacedim=4, mu_s=0.1, time_limit=1e-12)
    assert {late.statuses[k] for k in late.status} == {"time_limit"}
    assert (late.u == q).all()
    change: dict[str, Any]
    for change, words in (
        ({"spacedim": 3, "mu_s": 0.1}, "is 3, expected 4 as there is mu_s"),
        ({"spacedim": 4}, "is 4, expected 2 or 3"),
        ({"spacedim": 4, "mu_r": 0.1, "mu_s": 0.1}, "expected 6 as there is mu_r and mu_s"),
        ({"spacedim": 3, "coupled": True}, "coupled: is for spacedim 4"),
        ({"spacedim": 4, "mu_s": np.ones((2, 2))}, "mu_s: has the shape"),
    ):
        with pytest.raises(fclib.ProblemError, match=words):
            fclib.solve_batch(W, q, 0.5, **change)


def test_derivatives_of_a_batch_are_those_of_each() -> None:
    W, q, mu, _, _ = planted(3, 25, seed=4)
    r = fclib.solve_batch(W, q, mu, tol=1e-13).r
    rng = np.random.default_rng(0)
    by_r, by_u, dq = rng.normal(size=(3, *q.shape))
    dW, dmu = rng.normal(size=W.shape), rng.normal(size=mu.shape)
    gradient = fclib.vjp_batch(W, q, mu, r, r=by_r, u=by_u, threads=2)
    tangent = fclib.jvp_batch(W, q, mu, r, dW=dW, dq=dq, dmu=dmu)
    compared = 0
    for k in range(25):
        problem = fclib.LocalProblem(W=W[k], q=q[k], mu=mu[k])
        one = fclib.vjp(problem, r[k], r=by_r[k], u=by_u[k])
        assert np.array_equal(one.degenerate, gradient.degenerate[k])
        if one.degenerate.any():
            continue  # either of two
        compared += 1
        assert one.unique == gradient.unique[k] == tangent.unique[k]
        for name in ("W", "q", "mu"):
            own = getattr(one, name)
            np.testing.assert_allclose(
                getattr(gradient, name)[k], own, rtol=1e-6, atol=1e-8 * np.abs(own).max()
            )
        other = fclib.jvp(problem, r[k], W=dW[k], q=dq[k], mu=dmu[k])
        for name in ("r", "u"):
            own = getattr(other, name)
            np.testing.assert_allclose(
                getattr(tangent, name)[k], own, rtol=1e-6, atol=1e-8 * np.abs(own).max()
            )
    assert compared > 10


def test_right_hand_sides_share_a_call() -> None:
    W, q, mu, _, _ = planted(2, 5, seed=5)
    r = fclib.solve_batch(W, q, mu, tol=1e-12).r
    weights = np.random.default_rng(0).normal(size=(5, 3, 6))
    many = fclib.vjp_batch(W, q, mu, r, r=weights)
    assert many.W.shape == (5, 3, 6, 6)
    changes = fclib.jvp_batch(W, q, mu, r, dq=weights)
    for k in range(3):
        assert np.array_equal(fclib.vjp_batch(W, q, mu, r, r=weights[:, k]).q, many.q[:, k])
        assert np.array_equal(fclib.jvp_batch(W, q, mu, r, dq=weights[:, k]).u, changes.u[:, k])
    with pytest.raises(fclib.ProblemError, match="u: has the shape"):
        fclib.vjp_batch(W, q, mu, r, r=weights, u=weights[:, :2])
    with pytest.raises(fclib.ProblemError, match="W: has the shape"):
        fclib.vjp_batch(W[0], q, mu, r, r=weights)


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
    ran(program, timeout=60)


def test_an_error_is_at_most_a_thousandth_of_the_tolerance_too_large() -> None:
    # what is found in double precision is too large by nearly the whole of its rounding
    W = [
        [1.014400297094653e-08, 1.8240771115785037e-09, -1.7190695533741973e-09],
        [1.8240771115785037e-09, 2.6563260480116924e-09, -8.278593366384257e-10],
        [-1.7190695533741973e-09, -8.278593366384257e-10, 3.355046240827164e-09],
    ]
    q = [-4.491317272186279, -0.3939448297023773, 0.7381702065467834]
    mu = [0.035024166107177734]
    problem = fclib.LocalProblem(W=np.array(W), q=np.array(q), mu=mu)
    for tol in (1e-3, 1e-6):
        found = fclib.solve_batch(np.array([W]), np.array([q]), np.array([mu]), tol=tol)
        error = fclib.merit(problem, fclib.Solution(r=found.r[0])).error
        assert error <= found.error[0] <= error + 1e-3 * tol


def test_a_batch_inside_a_batch_disturbs_none() -> None:
    """A handler of a signal may solve another one; rolling problems are kept between solves."""
    rng = np.random.default_rng(0)
    H = rng.normal(size=(150, 300))
    outer: dict[str, Any] = {"W": (H.T @ H)[None], "q": rng.normal(size=(1, 300)), "mu": 0.5}
    outer |= {"mu_r": 0.1, "spacedim": 5, "tol": 1e-18, "time_limit": 1.0}
    calls = []

    def handler(*_: Any) -> None:
        calls.append(
            fclib.solve_batch(np.eye(5)[None], -np.ones((1, 5)), 0.5, mu_r=0.1, spacedim=5)
        )

    before = signal.signal(signal.SIGALRM, handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.15, 0.15)
        found = fclib.solve_batch(**outer)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert calls
    problem = fclib.LocalRollingProblem(
        W=outer["W"][0], q=outer["q"][0], mu=[0.5] * 60, mu_r=[0.1] * 60, spacedim=5
    )
    error = fclib.merit(problem, fclib.Solution(r=found.r[0])).error
    assert found.error[0] == pytest.approx(error, rel=1e-3, abs=1e-15)
