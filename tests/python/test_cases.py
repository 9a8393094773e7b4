"""Problems on which a verdict was wrong, and what is true of them."""

from __future__ import annotations

import json
import os
import re
from fractions import Fraction
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp

import fclib
from ball_judge import judge
from fclib import analysis
from helpers import converged, dense, last_resort, ring
from helpers_cli import run

FOLDER = Path(os.environ.get("FCLIB_DATA", Path(__file__).parents[3] / "shared" / "data" / "real"))
CASES = sorted((FOLDER.parent / "cases").glob("*.hdf5"))


def cases(*names: str) -> pytest.MarkDecorator:
    found = [path for path in CASES if path.name.startswith(names)]
    return pytest.mark.parametrize(
        "path",
        [pytest.param(path, id=path.stem) for path in found]
        or [pytest.param(None, marks=pytest.mark.skip(reason="the cases are not there"))],
    )


def stacked(power: int, extra: bool = False) -> fclib.LocalProblem:
    """A light body between the ground and a heavy one: W is positive definite."""
    small = np.array([[1.0, -1.0], [-1.0, 1.0 + 2.0**-power]])
    W = np.kron(small, np.eye(3))
    q = np.kron([-1.0, 0.5], [1.0, 0, 0])
    if extra:  # an open contact that has nothing to do with them, indefinite by rounding
        W = np.block([[W, np.zeros((6, 3))], [np.zeros((3, 6)), np.diag([1.0, 1.0, -1e-9])]])
        q = np.append(q, [1.0, 0, 0])
    return fclib.LocalProblem(spacedim=3, W=W, q=q, mu=np.full(q.size // 3, 0.5))


@pytest.mark.parametrize("extra", [False, True])
@pytest.mark.parametrize("power", [25, 28, 40, 46, 50, 51, 52])
def test_a_light_body_under_a_heavy_one_is_not_infeasible(power: int, extra: bool) -> None:
    problem = stacked(power, extra)
    y = np.ones(problem.nc)
    y[2:] = 0
    assert analysis.farkas(problem, y) is None
    assert fclib.solve(problem, time_limit=5, chain=last_resort(50)).status != "infeasible"
    # it would be, were it not for the last digit
    W = np.array(problem.W.toarray() if hasattr(problem.W, "toarray") else problem.W)
    W[3:6, 3:6] = np.eye(3)
    proof = analysis.farkas(problem.replace(W=W), y)
    assert proof is not None
    assert proof.exact


@cases("cx07", "cx08", "cx09", "cx10")
def test_what_has_a_solution_is_not_called_infeasible(path: Path) -> None:
    problem = fclib.read(path)
    # of cx09 the last digit of the reactions is worth 6e-7
    tolerance = 1e-7 if path.name.startswith("cx09") else 1e-8
    result = converged(problem, tol=tolerance)
    if not path.name.startswith("cx07"):  # what its large multipliers round is taken off there
        assert judge(problem, result.solution).error <= tolerance
    assert analysis.analyze(problem, time_limit=5).existence.verdict != analysis.PROVEN_NOT


@cases("cx01")
def test_joints_that_leave_no_solution(path: Path) -> None:
    problem = fclib.read(path)
    found = analysis.analyze(problem)
    assert found.existence.verdict == analysis.PROVEN_NOT
    assert found.certificate is not None
    assert found.certificate.exact
    assert found.certificate.exact_y == {0: 1}
    assert found.certificate.exact_z == {0: -2}
    assert found.definiteness.word == "indefinite"
    result = fclib.solve(problem)
    assert result.status == "infeasible"
    assert result.certificate_bound == np.inf


@cases("cx02")
def test_two_velocities_are_not_called_unique(path: Path) -> None:
    found = analysis.analyze(fclib.read(path))
    assert found.uniqueness.verdict == "not unique"
    assert found.uniqueness.contraction > 1
    assert found.enumeration is not None
    assert found.isolated_solutions == 3
    speeds = [one.u for one in found.enumeration.isolated]
    assert np.array(speeds, dtype=float) == pytest.approx(np.array([[1, 6], [0, 1], [0, 0]]))
    assert [one.error for one in found.enumeration.isolated] == [0, 0, 0]


@cases("cx13")
def test_a_welded_body_has_rank_0(path: Path) -> None:
    found = analysis.analyze(fclib.read(path))
    assert found.spectra["W"].rank == 0
    assert found.hyperstaticity == 3


@cases("cx14")
def test_no_solution_with_its_proof(path: Path) -> None:
    found = analysis.analyze(fclib.read(path), time_limit=5)
    assert found.existence.verdict == analysis.PROVEN_NOT
    assert found.certificate is not None
    # W was rounded: the statement has a bound
    assert 1e14 < found.certificate.bound < np.inf


@cases("contradictory-joints")
def test_contradicting_joints_leave_no_solution(path: Path) -> None:
    problem = fclib.read(path)
    found = analysis.analyze(problem)
    assert found.existence.verdict == analysis.PROVEN_NOT
    assert found.certificate is not None
    assert found.certificate.exact
    assert not found.certificate.exact_y
    assert found.uniqueness.verdict == "undecided"
    with pytest.raises(fclib.UnsuitableError, match="contradicts the others"):
        fclib.solve(problem)


@cases("closed_chain_step20")
def test_a_limit_that_loops_hold_gets_no_reaction(path: Path) -> None:
    problem = fclib.read(path)
    assert isinstance(problem, fclib.GlobalProblem)
    local = problem.condense()
    assert local.s is not None
    held = fclib.Solution(r=np.zeros(12), l=-np.linalg.solve(dense(local.R), local.s))
    none = fclib.merit(problem, held)
    for solver in ("auto", "nsgs", "nsn-ac", "admm"):
        for guess in (None, fclib.Solution(r=np.full(12, 1e3), l=np.zeros(10))):
            result = fclib.solve(problem, solver, guess=guess)
            assert np.abs(result.solution.r).max() <= 1e-12, solver
            assert result.error <= none.error * (1 + 1e-6), solver
            # the joints ask for 2e-12 m/s there, which is all that is wrong
            assert result.error * np.linalg.norm(local.q) <= 1e-11
            assert result.status in ("stalled", "inaccurate"), solver
            assert fclib.merit(problem, result.solution).error == pytest.approx(result.error)


def test_a_proof_in_rational_numbers() -> None:
    problem = ring()
    proof = analysis.farkas(problem, np.ones(3))
    assert proof is not None
    assert proof.exact
    H = np.asarray(problem.H.toarray() if hasattr(problem.H, "toarray") else problem.H)
    for row in H:
        assert sum(Fraction(float(row[2 * a])) * proof.exact_y[a] for a in range(3)) == 0


@pytest.mark.parametrize("count", [4, 6, 8])
def test_a_proof_where_walls_face_each_other(count: int) -> None:
    # the normals of two of them are opposite but for rounding: neither follows from the other
    for weights in (np.ones(count), np.tile([1.0, 1 + 1e-9], count // 2), np.eye(count)[0] + 1):
        y = np.resize(weights, count)
        y[count // 2 :] = y[: count // 2]
        proof = analysis.farkas(ring(count), y)
        assert proof is not None
        assert proof.exact
        assert proof.contacts == count


def test_a_certificate_from_a_file(tmp_path: Path) -> None:
    problem = ring()
    fclib.write(tmp_path / "ring.hdf5", problem)
    proof = analysis.farkas(problem, np.ones(3))
    assert proof is not None
    good = tmp_path / "good.json"
    good.write_text(json.dumps(proof.record(problem)))
    wrong = tmp_path / "wrong.json"
    wrong.write_text(json.dumps({"y": {"0": 1, "1": 1}}))
    command = ("check", tmp_path / "ring.hdf5", "--json", "--certificate")
    done = run(*command, good)
    assert json.loads(done.stdout)["exact"] is True
    done = run(*command, wrong, code=1)
    assert "contact 0" in json.loads(done.stdout)["message"]


# ---- files of other writers, and files whose data are missing


@cases("never_written", "p_zeros")
def test_missing_data_are_no_proof(path: Path) -> None:
    words = {
        "never_written": "/fclib_local/W/x: was declared and never written",
        "p_zeros": "/fclib_local/W/p: says that there is no entry, but x has 36",
    }[path.stem]
    with pytest.raises(fclib.Error, match=re.escape(f"{path}: {words}")):
        fclib.read(path)
    for command in ("info", "check", "solve", "analyze"):
        done = run(command, path, code=1)
        assert done.stdout == ""
        assert words in done.stderr


@cases("symmetric_packed")
def test_a_packed_triangle_is_the_whole(path: Path) -> None:
    problem = fclib.read(path)
    assert isinstance(problem, fclib.LocalProblem)
    W = dense(problem.W)
    np.testing.assert_array_equal(W, W.T)
    with h5py.File(path) as file:
        group = file["fclib_local/W"]
        p, i, x = (group[name][:] for name in ("p", "i", "x"))
    lower = sp.csc_array((x, i, p), shape=(6, 6)).toarray()
    np.testing.assert_array_equal(W, lower + lower.T - np.diag(np.diag(lower)))
    result = converged(problem)
    assert judge(problem, result.solution).error <= 1e-8


@cases("f8ints", "matlab_all", "col2d", "text_as_uint8", "vl_array")
def test_what_other_programs_write_is_read(path: Path) -> None:
    problem = fclib.read(path)
    assert problem.nc == 2
    result = converged(problem)
    assert judge(problem, result.solution).error <= 1e-8
    title = {"text_as_uint8": "bytes as numbers"}.get(path.stem, "")
    assert problem.info.title == title
    assert len(fclib.left_out(path)) == (3 if path.stem == "vl_array" else 0)


@cases("external_broken", "git_lfs_pointer")
def test_what_a_file_is_that_holds_no_problem(path: Path) -> None:
    words = {
        "external_broken": "/fclib_local: is an external link to '/fclib_local' of the file",
        "git_lfs_pointer": "is a pointer of Git LFS, not the file itself: run 'git lfs pull'",
    }[path.stem]
    with pytest.raises(fclib.FileError, match=re.escape(f"{path}: {words}")):
        fclib.read(path)
