"""The digest names the data of a problem, and nothing else."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import fclib


def local(W: Any, q: Any = (-1.0, 0.5, 0.25), mu: Any = (0.5,), **more: Any) -> fclib.LocalProblem:
    return fclib.LocalProblem(W=W, q=np.array(q), mu=np.array(mu), spacedim=3, **more)


W = np.array([[2.0, 0.5, 0.0], [0.5, 2.0, 0.0], [0.0, 0.0, 1.0]])


def test_storage_does_not_count() -> None:
    explicit_zero = sp.csr_array(
        (np.array([2.0, 0.5, 0.0, 0.5, 2.0, 1.0]), np.array([0, 1, 2, 0, 1, 2]), [0, 3, 5, 6]),
        shape=(3, 3),
    )
    rows, columns = W.nonzero()
    twice = sp.coo_array(
        (np.tile(W[rows, columns] / 2, 2), (np.tile(rows, 2), np.tile(columns, 2))), shape=(3, 3)
    )
    digests = {
        fclib.digest(local(matrix))
        for matrix in (W, sp.csr_array(W), sp.csc_array(W), sp.coo_array(W), explicit_zero, twice)
    }
    assert len(digests) == 1


def test_a_file_keeps_it(tmp_path: Path) -> None:
    problem = local(sp.csr_array(W))
    fclib.write(tmp_path / "p.hdf5", problem)
    assert fclib.digest(fclib.read(tmp_path / "p.hdf5")) == fclib.digest(problem)


def test_words_do_not_count_and_signs_of_zero_neither() -> None:
    assert fclib.digest(local(W, info=fclib.ProblemInfo(title="a"))) == fclib.digest(local(W))
    assert fclib.digest(local(W, q=(-1, 0.0, 1))) == fclib.digest(local(W, q=(-1, -0.0, 1)))


@pytest.mark.parametrize(
    "other",
    [
        lambda: local(W * (1 + 2**-52)),
        lambda: local(W, q=(-1.0, 0.5, 0.25 + 1e-16)),
        lambda: local(W, mu=(0.6,)),
        lambda: local(W.T @ W),
        lambda: fclib.LocalProblem(W=W[:2, :2], q=[-1, 0.5], mu=[0.5], spacedim=2),
    ],
)
def test_every_number_counts(other: Callable[[], fclib.Problem]) -> None:
    assert fclib.digest(other()) != fclib.digest(local(W))
