"""Joints that contradict each other: nothing of them exists, and what is proven is checked."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import fclib
from contradicting_joints import KINDS, planted
from fclib import analysis
from fclib.analysis import _existence
from fclib.analysis._data import Data
from fclib.analysis._existence import _witness, slater
from fclib.analysis._joints import joints_of, joints_of_rows
from helpers import dense, planted_global

pytest.importorskip("clarabel")


@pytest.mark.parametrize("number", range(2 * len(KINDS)))
def test_nothing_exists_of_joints_that_contradict_each_other(number: int) -> None:
    case = planted(number)
    assert case.confirmed()
    found = analysis.analyze(case.problem, time_limit=2.0)
    assert found.slater.holds is False
    assert found.uniqueness.verdict == "undecided"
    assert found.self_stress.verdict != "solvable"
    assert found.existence.verdict in (analysis.PROVEN_NOT, analysis.UNDECIDED)
    assert "contradict each other" in found.existence.reason
    if found.existence.verdict == analysis.UNDECIDED:
        assert case.kind in ("tiny", "rigid")  # within the rounding of the data
        return
    proof = found.certificate
    assert proof is not None
    assert proof.exact
    assert not proof.exact_y
    again = analysis.check(case.problem, {}, proof.exact_z)
    assert again.gain == proof.gain > 0


@pytest.mark.parametrize("seed", range(6))
def test_joints_that_repeat_others_exactly_are_no_contradiction(seed: int) -> None:
    problem: Any = planted_global(seed, d=3, p=2, nc=2).problem
    G = dense(problem.G)
    again = problem.replace(G=np.hstack([G, 2 * G]), b=np.append(problem.b, 2 * problem.b))
    once, twice = (analysis.analyze(one, time_limit=2.0) for one in (problem, again))
    assert twice.existence.verdict == once.existence.verdict
    assert twice.uniqueness.verdict == once.uniqueness.verdict
    # of a product that is rounded no more is said than what was solved
    rounded = problem.replace(G=np.hstack([G, G / 3]), b=np.append(problem.b, problem.b / 3))
    found = analysis.analyze(rounded, time_limit=2.0)
    assert found.existence.verdict in (analysis.EXISTS_AT_HAND, analysis.UNDECIDED)
    assert found.uniqueness.verdict == "undecided"


def test_a_contradiction_that_rounding_explains_is_no_proof() -> None:
    G = np.array([[0.1, 0.1], [0.7, 0.7]])
    problem = fclib.GlobalProblem(
        spacedim=2, M=np.eye(2), H=np.eye(2), G=G, f=[-1, 0], w=[0, 0], b=[0.3, 0.3 + 2.0**-50],
        mu=[0.5],
    )  # fmt: skip
    found = analysis.analyze(problem)
    assert found.existence.verdict == analysis.UNDECIDED
    assert found.uniqueness.verdict == "undecided"
    assert found.record["existence"] == "undecided"


def test_the_distance_to_what_the_joints_allow_is_a_bound() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        rows = rng.standard_normal((3, 6)) * 10.0 ** rng.uniform(-3, 3, (3, 1))
        x = rng.standard_normal(6)
        e = rows @ x
        # two of them are said again, one in other units
        B = sp.csr_array(np.vstack([rows, rows[:2] * [[1.0], [0.25]]]))
        e = np.append(e, e[:2] * [1.0, 0.25])
        joints = joints_of_rows(B, e)
        assert joints.certain
        assert joints.kept.size == 3
        for size in (1e-12, 1e-3, 1.0):
            y = x + size * rng.standard_normal(6)
            nearest = y - np.linalg.lstsq(rows, rows @ y - e[:3], rcond=None)[0]
            assert joints.distance(y) >= np.linalg.norm(y - nearest) * (1 - 1e-6) - 1e-15


def test_a_velocity_that_the_joints_do_not_allow_is_no_witness(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """B is badly conditioned: what it leaves of x is small, and the velocity is far."""
    problem = fclib.GlobalProblem(
        spacedim=2,
        M=np.eye(3),
        H=np.eye(3)[:, :2],
        G=np.array([[1.0, 1.0], [0.0, 1e-5], [0.0, 0.0]]),
        f=[-1.0, 0, 0],
        w=[0, 0],
        b=[-1.0, -1.0 + 1e-3],  # v = (1, -100, .)
        mu=[0.5],
    )
    data = Data.of_problem(problem)
    joints = joints_of(data)
    assert joints.certain
    A, c = data.matrices["H"].T.tocsr(), problem.w
    # near the rows, by 1e-3, and far from all that they allow
    assert joints.distance(np.array([1.0, 0, 0])) >= 99
    assert not slater(data, joints, True, False).holds
    # also where least squares do not bring it to them
    monkeypatch.setattr(_existence, "lsmr", lambda *_, **__: [np.zeros(3)])
    assert _witness(data, A, c, joints, np.array([1.0, 0, 0]), "forged") is None
    assert _witness(data, A, c, joints_of_rows(joints.B[:0], np.zeros(0)), np.eye(3)[0], "free")


def test_rows_beyond_the_time_are_undecided() -> None:
    case = planted(list(KINDS).index("combined"))
    found = joints_of(Data.of_problem(case.problem), time_limit=0.0)
    assert found.agree is None
    assert "no time was left" in found.reason


def test_the_combination_is_exact() -> None:
    case = planted(list(KINDS).index("equal"))
    joints = joints_of(Data.of_problem(case.problem))
    assert joints.agree is False
    G = dense(case.problem.G)
    for row in G:
        assert sum(Fraction(float(row[k])) * z for k, z in joints.combination.items()) == 0
    assert joints.gap == pytest.approx(abs(float(case.problem.b @ case.z)))
