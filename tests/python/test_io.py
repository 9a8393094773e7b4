"""Files keep every number, in the layout of libfclib 3.1, and are never left half written."""

import errno
import fcntl
import gc
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import fclib
from fclib import scenes
from helpers import STORAGES, Array, Planted, dense, planted_global, planted_local, ran, stored

Draw: TypeAlias = Callable[[st.SearchStrategy[Any]], Any]
Layout: TypeAlias = dict[str, tuple[str, tuple[int, ...]]]

FINITE = st.floats(allow_nan=False, allow_infinity=False)
NONNEGATIVE = st.floats(min_value=0, allow_nan=False, allow_infinity=False)
TEXT = st.text(st.characters(blacklist_characters="\0", blacklist_categories=["Cs"]), max_size=20)

LOCAL_MATRICES, LOCAL_VECTORS = ("W", "V", "R"), ("q", "mu", "s")
GLOBAL_MATRICES, GLOBAL_VECTORS = ("M", "H", "G"), ("f", "w", "mu", "b")


# ---- random problems: any structure, any finite number


def draw_vector(draw: Draw, size: int, values: st.SearchStrategy[float] = FINITE) -> Array:
    return np.array(draw(st.lists(values, min_size=size, max_size=size)), dtype=float)


def draw_matrix(draw: Draw, rows: int, cols: int) -> Any:
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    values = rng.standard_normal((rows, cols)) * 10.0 ** rng.integers(-300, 300, (rows, cols))
    values[rng.uniform(size=values.shape) < draw(st.sampled_from([0.0, 0.5, 1.0]))] = 0
    return stored(values, draw(st.sampled_from(STORAGES)), rng)


@st.composite
def infos(draw: st.DrawFn) -> fclib.ProblemInfo:
    return fclib.ProblemInfo(title=draw(TEXT), description=draw(TEXT), math_info=draw(TEXT))


@st.composite
def matrix_infos(draw: st.DrawFn, names: Sequence[str]) -> dict[str, fclib.MatrixInfo]:
    known = draw(st.lists(st.sampled_from(names), unique=True)) if names else []
    return {
        name: fclib.MatrixInfo(
            comment=draw(TEXT),
            conditioning=draw(st.floats(allow_nan=False)),
            determinant=draw(FINITE),
            rank=draw(st.integers(0, 2**31 - 1)),
        )
        for name in known
    }


@st.composite
def local_problems(draw: st.DrawFn) -> fclib.LocalProblem:
    d, nc, p = draw(st.sampled_from([2, 3])), draw(st.integers(0, 4)), draw(st.integers(0, 3))
    m = d * nc
    mixed = {"V": draw_matrix(draw, m, p), "R": draw_matrix(draw, p, p), "s": draw_vector(draw, p)}
    return fclib.LocalProblem(
        spacedim=d,
        W=draw_matrix(draw, m, m),
        q=draw_vector(draw, m),
        mu=draw_vector(draw, nc, NONNEGATIVE),
        info=draw(infos()),
        # without contacts there is no W
        matrix_info=draw(matrix_infos(["W"] * (m > 0) + ["V", "R"] * (p > 0))),
        **(mixed if p else {}),
    )


@st.composite
def global_problems(draw: st.DrawFn) -> fclib.GlobalProblem:
    d, nc, p = draw(st.sampled_from([2, 3])), draw(st.integers(0, 4)), draw(st.integers(0, 3))
    n = draw(st.integers(1, 8))
    mixed = {"G": draw_matrix(draw, n, p), "b": draw_vector(draw, p)}
    return fclib.GlobalProblem(
        spacedim=d,
        M=draw_matrix(draw, n, n),
        H=draw_matrix(draw, n, d * nc),
        f=draw_vector(draw, n),
        w=draw_vector(draw, d * nc),
        mu=draw_vector(draw, nc, NONNEGATIVE),
        info=draw(infos()),
        matrix_info=draw(matrix_infos(["M", "H", *(["G"] if p else [])])),
        **(mixed if p else {}),
    )


# ---- equality, to the last bit


def assert_same_vectors(a: Any, b: Any, names: tuple[str, ...]) -> None:
    for name in names:
        first, second = getattr(a, name), getattr(b, name)
        assert (first is None) == (second is None), name
        if first is not None:
            np.testing.assert_array_equal(first, second, err_msg=name)


def assert_same_stored(a: Any, b: Any) -> None:
    """The same storage, the same entries, in the same order."""
    if a is None or b is None:
        assert a is b
        return
    assert a.shape == b.shape
    if isinstance(a, np.ndarray):
        np.testing.assert_array_equal(a, b)
        return
    assert a.format == b.format
    parts = ("row", "col", "data") if a.format == "coo" else ("indptr", "indices", "data")
    for part in parts:
        np.testing.assert_array_equal(getattr(a, part), getattr(b, part))


def assert_same(a: fclib.Problem, b: fclib.Problem) -> None:
    assert type(a) is type(b)
    assert a.spacedim == b.spacedim
    assert a.formulation == b.formulation
    assert a.info == b.info
    assert a.matrix_info == b.matrix_info
    if isinstance(a, fclib.LocalProblem):
        assert_same_vectors(a, b, LOCAL_VECTORS)
        for name in LOCAL_MATRICES:
            assert_same_stored(getattr(a, name), getattr(b, name))
    else:
        assert_same_vectors(a, b, GLOBAL_VECTORS)
        for name in GLOBAL_MATRICES:
            first, second = getattr(a, name), getattr(b, name)
            assert (first is None) == (second is None), name
            if first is not None:
                assert second.format == "coo"
                assert first.shape == second.shape
                np.testing.assert_array_equal(dense(first), dense(second), err_msg=name)


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("io")


@settings(max_examples=150)
@given(problem=local_problems(), data=st.data())
def test_local_problems_come_back_as_they_were_stored(
    scratch: Path, problem: fclib.LocalProblem, data: st.DataObject
) -> None:
    draw = data.draw
    solution = fclib.Solution(
        u=draw_vector(draw, problem.m),
        r=draw_vector(draw, problem.m),
        l=draw_vector(draw, problem.p) if problem.p else None,
    )
    path = scratch / "local.hdf5"
    fclib.write(path, problem, solution, dense=True)
    assert_same(problem, fclib.read(path))
    assert_same_vectors(solution, fclib.read_solution(path), ("v", "u", "r", "l"))


@settings(max_examples=100)
@given(problem=global_problems(), data=st.data())
def test_global_problems_come_back_as_triplets_of_the_same_matrices(
    scratch: Path, problem: fclib.GlobalProblem, data: st.DataObject
) -> None:
    draw = data.draw
    solution = fclib.Solution(
        v=draw_vector(draw, problem.n),
        u=draw_vector(draw, problem.m),
        r=draw_vector(draw, problem.m),
        l=draw_vector(draw, problem.p) if problem.p else None,
    )
    path = scratch / "global.hdf5"
    fclib.write(path, problem)
    assert fclib.read_solution(path) is None
    fclib.write_solution(path, solution)
    assert_same(problem, fclib.read(path))
    assert_same_vectors(solution, fclib.read_solution(path), ("v", "u", "r", "l"))


@pytest.mark.parametrize("mixed", [0, 2])
def test_velocities_that_a_solution_lacks_are_completed(scratch: Path, mixed: int) -> None:
    path = scratch / "completed.hdf5"
    for case in (planted_local(1, p=mixed), planted_global(1, p=mixed)):
        reactions = fclib.Solution(r=case.solution.r, l=case.solution.l)
        fclib.write(path, case.problem, reactions)
        first = fclib.read_solution(path)
        fclib.write_solution(path, reactions)
        for stored_solution in (first, fclib.read_solution(path)):
            assert stored_solution is not None
            for name in ("v", "u", "r", "l"):
                expected, found = (getattr(s, name) for s in (case.solution, stored_solution))
                assert (expected is None) == (found is None), name
                if expected is not None:
                    np.testing.assert_allclose(found, expected, atol=1e-13, err_msg=name)


@settings(max_examples=50)
@given(problem=st.one_of(local_problems(), global_problems()))
def test_problems_and_solutions_can_be_pickled(problem: fclib.Problem) -> None:
    copy = pickle.loads(pickle.dumps(problem))
    assert (copy.info, copy.matrix_info) == (problem.info, problem.matrix_info)
    if isinstance(problem, fclib.LocalProblem):
        assert_same(problem, copy)
    else:
        assert_same_vectors(problem, copy, GLOBAL_VECTORS)
        for name in GLOBAL_MATRICES:
            assert_same_stored(getattr(problem, name), getattr(copy, name))
    solution = fclib.Solution(r=np.arange(problem.m, dtype=float))
    assert_same_vectors(solution, pickle.loads(pickle.dumps(solution)), ("v", "u", "r", "l"))


def test_large_datasets_come_back_through_chunks_and_compression(tmp_path: Path) -> None:
    planted = planted_local(1, nc=60)
    path = tmp_path / "large.hdf5"
    fclib.write(path, planted.problem, planted.solution)
    with h5py.File(path) as file:
        dataset = file["fclib_local/W/x"]
        assert dataset.chunks is not None
        assert dataset.compression == "gzip"
        assert dataset.shuffle
    assert_same(planted.problem, fclib.read(path))


def test_datasets_of_many_chunks_come_back(tmp_path: Path) -> None:
    m = 900
    rng = np.random.default_rng(1)
    x = rng.normal(size=(m, m))
    problem = fclib.LocalProblem(W=sp.csr_array(x), q=rng.normal(size=m), mu=[0.5] * (m // 3))
    path = tmp_path / "large.hdf5"
    fclib.write(path, problem)
    with h5py.File(path) as file:
        dataset = file["fclib_local/W/x"]
        assert dataset.chunks[0] * 6 < dataset.size
        np.testing.assert_array_equal(dataset[()], x.ravel())
    assert_same(problem, fclib.read(path))


# ---- the layout, seen by another reader


def tree(path: Path) -> Layout:
    """Type and shape of each dataset of a file."""
    found: Layout = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            text = h5py.check_string_dtype(item.dtype)
            kind = item.dtype.str if text is None else f"text[{text.length}]"
            found[name] = (kind, item.shape)

    with h5py.File(path) as file:
        file.visititems(visit)
    return found


def matrix_layout(group: str, p: int, entries: int) -> Layout:
    layout: Layout = {f"{group}/{name}": ("<i4", (1,)) for name in ("nzmax", "m", "n", "nz")}
    layout[f"{group}/p"] = ("<i4", (p,))
    layout[f"{group}/i"] = ("<i4", (entries,))
    layout[f"{group}/x"] = ("<f8", (entries,))
    return layout


INFO = fclib.ProblemInfo(title="A title", description="Ünïcode", math_info="")
INFO_LAYOUT = {
    "title": ("text[8]", ()),
    "description": ("text[10]", ()),
    "math_info": ("text[1]", ()),
}


def test_layout_of_a_mixed_local_file(tmp_path: Path) -> None:
    path = tmp_path / "local.hdf5"
    problem = fclib.LocalProblem(
        spacedim=2,
        W=sp.csr_array(np.diag([1.0, 2, 3, 4])),
        V=sp.csc_array(np.ones((4, 3))),
        R=np.eye(3),
        q=np.arange(4.0),
        mu=[0.5, 0.25],
        s=np.ones(3),
        info=INFO,
    )
    solution = fclib.Solution(u=np.ones(4), r=np.zeros(4), l=np.ones(3))
    fclib.write(path, problem, solution, dense=True)
    dense_layout = matrix_layout("fclib_local/R", 0, 9)
    del dense_layout["fclib_local/R/p"], dense_layout["fclib_local/R/i"]
    assert tree(path) == {
        "fclib_local/spacedim": ("<i4", (1,)),
        **matrix_layout("fclib_local/W", 5, 4),
        **matrix_layout("fclib_local/V", 4, 12),
        **dense_layout,
        "fclib_local/vectors/q": ("<f8", (4,)),
        "fclib_local/vectors/mu": ("<f8", (2,)),
        "fclib_local/vectors/s": ("<f8", (3,)),
        **{f"fclib_local/info/{name}": layout for name, layout in INFO_LAYOUT.items()},
        "solution/u": ("<f8", (4,)),
        "solution/r": ("<f8", (4,)),
        "solution/l": ("<f8", (3,)),
    }
    with h5py.File(path) as file:
        group = file["fclib_local"]
        assert [group[f"{name}/nz"][0] for name in "WVR"] == [-2, -1, -3]
        assert [group[f"V/{name}"][0] for name in ("nzmax", "m", "n")] == [12, 4, 3]
        np.testing.assert_array_equal(group["W/p"], [0, 1, 2, 3, 4])
        np.testing.assert_array_equal(group["W/i"], [0, 1, 2, 3])
        assert group["info/description"][()].decode() == "Ünïcode"
        assert {"format", "generator"} <= set(file.attrs)


def test_layout_of_a_global_file_is_triplets_rows_in_i(tmp_path: Path) -> None:
    path = tmp_path / "global.hdf5"
    H = np.array([[0.0, 2, 0], [0, 0, 5]])
    problem = fclib.GlobalProblem(
        M=np.diag([1.0, 2]), H=sp.csc_array(H), f=np.ones(2), w=np.zeros(3), mu=[0.5], info=INFO
    )
    fclib.write(path, problem, fclib.Solution(v=np.ones(2), u=np.ones(3), r=np.zeros(3)))
    assert tree(path) == {
        "fclib_global/spacedim": ("<i4", (1,)),
        # a dense matrix gives all its entries
        **matrix_layout("fclib_global/M", 4, 4),
        **matrix_layout("fclib_global/H", 2, 2),
        "fclib_global/vectors/f": ("<f8", (2,)),
        "fclib_global/vectors/w": ("<f8", (3,)),
        "fclib_global/vectors/mu": ("<f8", (1,)),
        **{f"fclib_global/info/{name}": layout for name, layout in INFO_LAYOUT.items()},
        "solution/v": ("<f8", (2,)),
        "solution/u": ("<f8", (3,)),
        "solution/r": ("<f8", (3,)),
    }
    with h5py.File(path) as file:
        group = file["fclib_global/H"]
        assert [group[name][0] for name in ("m", "n", "nz", "nzmax")] == [2, 3, 2, 2]
        triplets = zip(group["i"], group["p"], group["x"], strict=True)
        assert sorted(triplets) == [(0, 1, 2.0), (1, 2, 5.0)]


@pytest.mark.parametrize("mixed", [0, 2])
def test_the_same_problem_gives_the_same_bytes(tmp_path: Path, mixed: int) -> None:
    for k, planted in enumerate([planted_local(3, p=mixed), planted_global(3, nc=20, p=mixed)]):
        paths = [tmp_path / f"{k}-first.hdf5", tmp_path / f"{k}-second.hdf5"]
        for path in paths:
            fclib.write(path, planted.problem, planted.solution)
        assert paths[0].read_bytes() == paths[1].read_bytes()


# ---- files of other writers


def test_a_file_that_is_being_written_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "open.hdf5"
    fclib.write(path, one_contact())
    with h5py.File(path, "r+") as file:
        file["fclib_local/vectors/q"][0] = 7.0
        for read in (fclib.read, fclib.read_solution, fclib.contents):
            with pytest.raises(fclib.FileError, match=r"open\.hdf5: another program has it open"):
                read(path)
    with h5py.File(path, "r"):  # one that reads it is in nobody's way
        problem = fclib.read(path)
        assert isinstance(problem, fclib.LocalProblem)
        assert problem.q[0] == 7.0


def test_a_file_that_is_being_copied_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "part.hdf5"
    fclib.write(tmp_path / "whole.hdf5", planted_local(1, nc=20).problem)
    whole = (tmp_path / "whole.hdf5").read_bytes()
    for size in range(0, len(whole), max(1, len(whole) // 50)):
        path.write_bytes(whole[:size])
        with pytest.raises(fclib.FileError, match=r"part\.hdf5: .*(cut short|not an HDF5 file)"):
            fclib.read(path)


def write_by_hand(path: Path, variant: str) -> None:
    """A local problem of two contacts in 2D, W in columns, as somebody else may have written it."""
    integer = {"int64": "<i8", "big-endian": ">i4"}.get(variant, "<i4")
    real = {"big-endian": ">f8", "float32": "<f4"}.get(variant, "<f8")
    spare = 3 if variant == "nzmax" else 0
    layout: dict[str, Any] = {}
    if variant == "chunked":
        layout = {"chunks": (2,), "compression": "gzip"}

    def scalar(value: int) -> Any:
        return np.array(value if variant == "scalar" else [value], dtype=integer)

    with h5py.File(path, "w") as file:
        group = file.create_group("fclib_local")
        group["spacedim"] = scalar(2)
        W = group.create_group("W")
        for name, value in {"nzmax": 6 + spare, "m": 4, "n": 4, "nz": -1}.items():
            W[name] = scalar(value)
        W.create_dataset("p", data=np.array([0, 2, 4, 5, 6], integer), **layout)
        indices = np.array([0, 1, 0, 1, 2, 3] + [99] * spare, integer)
        W.create_dataset("i", data=indices, **layout)
        values = np.array([2, 0.5, 0.25, 3, 4, 5] + [np.nan] * spare, real)
        W.create_dataset("x", data=values, **layout)
        group.create_dataset("vectors/q", data=np.array([-1, 0.5, 2, 0.25], real), **layout)
        group.create_dataset("vectors/mu", data=np.array([0.5, 0.75], real), **layout)
        if variant == "variable-length":
            group["info/title"] = "a title"
        elif variant == "unterminated":
            group["info/title"] = np.array(b"a title", dtype="S7")
        elif variant != "no info":
            group["info/title"] = np.array(b"a title\0and garbage", dtype="S20")


@pytest.mark.parametrize(
    "variant",
    [
        "plain",
        "int64",
        "big-endian",
        "float32",
        "chunked",
        "scalar",
        "nzmax",
        "variable-length",
        "unterminated",
        "no info",
    ],
)
def test_files_of_other_writers_are_read(tmp_path: Path, variant: str) -> None:
    path = tmp_path / "other.hdf5"
    write_by_hand(path, variant)
    problem = fclib.read(path)
    assert isinstance(problem, fclib.LocalProblem)
    expected = [[2, 0.25, 0, 0], [0.5, 3, 0, 0], [0, 0, 4, 0], [0, 0, 0, 5]]
    np.testing.assert_array_equal(dense(problem.W), expected)
    np.testing.assert_array_equal(problem.q, [-1, 0.5, 2, 0.25])
    np.testing.assert_array_equal(problem.mu, [0.5, 0.75])
    assert problem.info.title == ("" if variant == "no info" else "a title")


def test_what_else_a_file_holds_does_not_disturb(tmp_path: Path) -> None:
    path = tmp_path / "guesses.hdf5"
    fclib.write(path, planted_local(1).problem)
    with h5py.File(path, "a") as file:
        file["guesses/number_of_guesses"] = np.array([0], "<i4")
        file["fclib_local/info/more"] = 3.0
    assert_same(planted_local(1).problem, fclib.read(path))
    assert fclib.contents(path) == ["local"]
    assert fclib.read_guesses(path) == []
    fclib.write_guesses(path, [planted_local(1).solution], mode="add")
    assert len(fclib.read_guesses(path)) == 1


def test_what_is_known_of_a_matrix_is_read(tmp_path: Path) -> None:
    path = tmp_path / "known.hdf5"
    planted = planted_local(1, p=2)
    fclib.write(path, planted.problem)
    with h5py.File(path, "a") as file:
        file["fclib_local/W/comment"] = np.array(b"of full rank", dtype="S13")
        file["fclib_local/W/conditioning"] = np.array([12.5])
        file["fclib_local/W/determinant"] = np.array([2.0])
        file["fclib_local/W/rank"] = np.array([18], "<i4")
        file["fclib_local/V/determinant"] = np.array([3.0])
    known = {
        "W": fclib.MatrixInfo(comment="of full rank", conditioning=12.5, determinant=2.0, rank=18),
        "V": fclib.MatrixInfo(determinant=3.0),
    }
    problem = fclib.read(path)
    assert problem.matrix_info == known
    assert_same(planted.problem.replace(matrix_info=known), problem)
    fclib.write(path, problem)
    with h5py.File(path) as file:
        assert file["fclib_local/W/comment"][()] == b"of full rank"
        assert file["fclib_local/W/rank"][0] == 18
        assert file["fclib_local/W/conditioning"][0] == 12.5
        assert file["fclib_local/W/determinant"][0] == 2
        # a reader of libfclib 3.1 wants all or nothing
        assert {"comment", "conditioning", "determinant", "rank"} <= set(file["fclib_local/V"])
        assert "rank" not in file["fclib_local/R"]


def test_what_is_known_of_a_matrix_goes_with_it() -> None:
    known = {name: fclib.MatrixInfo(comment=name) for name in "MHG"}
    problem = planted_global(1, p=2).problem.replace(matrix_info=known)
    assert problem.matrix_info == known
    assert problem.with_storage("dense").matrix_info == known
    assert isinstance(problem, fclib.GlobalProblem)
    assert problem.condense().matrix_info == {}
    assert set(problem.replace(M=2 * problem.M).matrix_info) == {"H", "G"}
    assert problem.replace(mu=2 * problem.mu).matrix_info == known
    assert problem.replace(matrix_info={}).matrix_info == {}
    with pytest.raises(TypeError):
        problem.matrix_info["M"] = fclib.MatrixInfo()  # type: ignore[index]
    with pytest.raises(fclib.ProblemError, match=r"matrix_info\['W'\]: .* no such matrix"):
        problem.replace(matrix_info={"W": fclib.MatrixInfo()})
    plain = planted_global(1).problem
    with pytest.raises(fclib.ProblemError, match=r"matrix_info\['G'\]"):
        plain.replace(matrix_info={"G": fclib.MatrixInfo()})


# ---- guesses, and several things in one file


def assert_same_guesses(path: Path, expected: Sequence[fclib.Solution]) -> None:
    found = fclib.read_guesses(path)
    assert len(found) == len(expected)
    for guess, other in zip(found, expected, strict=True):
        assert_same_vectors(guess, other, ("v", "u", "r", "l"))


def guesses_of(planted: Planted, count: int) -> list[fclib.Solution]:
    """Guesses, whole ones."""
    s = planted.solution
    return [s.replace(r=k * s.r, u=np.full(s.r.size, k)) for k in range(count)]


@pytest.mark.parametrize("p", [0, 2])
def test_guesses_come_back(tmp_path: Path, p: int) -> None:
    for k, planted in enumerate([planted_local(1, p=p), planted_global(1, p=p)]):
        path, guesses = tmp_path / f"{k}.hdf5", guesses_of(planted, 11)
        fclib.write(path, planted.problem, guesses=guesses[:9])
        assert fclib.contents(path) == [planted.problem.kind, "guesses"]
        assert_same_guesses(path, guesses[:9])
        fclib.write_guesses(path, guesses[9:], mode="add")
        assert_same_guesses(path, guesses)
        fclib.write_solution(path, planted.solution)
        assert_same_guesses(path, guesses)
        assert_same(planted.problem, fclib.read(path))
        fclib.write_guesses(path, guesses[2:4])
        assert_same_guesses(path, guesses[2:4])
        fclib.write_guesses(path, [])
        assert fclib.read_guesses(path) == []
        assert fclib.contents(path) == [planted.problem.kind, "solution"]


def test_velocities_that_a_guess_lacks_are_completed(tmp_path: Path) -> None:
    path = tmp_path / "completed.hdf5"
    for planted in (planted_local(1, p=2), planted_global(1, p=2)):
        u = planted.solution.u
        assert u is not None
        guess = planted.solution.replace(u=None, v=None)
        fclib.write(path, planted.problem, None, [guess])
        fclib.write_guesses(path, [guess], mode="add")
        for found in fclib.read_guesses(path):
            assert found.u is not None
            np.testing.assert_allclose(found.u, u, atol=1e-13)


def test_a_guess_that_does_not_fit_is_named(written: Path) -> None:
    path = written / "p.hdf5"
    before = path.read_bytes()
    planted = planted_local(1)
    wrong = [planted.solution, fclib.Solution(r=np.zeros(5))]
    actions: list[Callable[[], None]] = [
        lambda: fclib.write(path, planted.problem, guesses=wrong),
        lambda: fclib.write_guesses(path, wrong),
        lambda: fclib.write_guesses(path, wrong, mode="add"),
    ]
    for action in actions:
        with pytest.raises(fclib.ProblemError, match="/guesses/2/r: has 5 entries, expected m"):
            action()
    assert path.read_bytes() == before
    with pytest.raises(fclib.FileError, match="no problem"):
        fclib.write_guesses(empty_file(written), [])


def empty_file(folder: Path) -> Path:
    with h5py.File(folder / "empty.hdf5", "w"):
        pass
    return folder / "empty.hdf5"


def test_a_problem_is_added_to_a_file(tmp_path: Path) -> None:
    path = tmp_path / "both.hdf5"
    local, whole = planted_local(1), planted_global(2)
    fclib.write(path, local.problem, mode="add")
    fclib.write(path, whole.problem, whole.solution, guesses_of(whole, 2), mode="add")
    assert fclib.contents(path) == ["global", "local", "solution", "guesses"]
    assert_same(local.problem, fclib.read(path, "local"))
    assert_same(whole.problem, fclib.read(path, "global"))
    # they are those of the global problem
    fclib.write_solution(path, whole.solution.replace(u=None, v=None))
    fclib.write_guesses(path, guesses_of(whole, 1), mode="add")
    assert len(fclib.read_guesses(path)) == 3
    before = path.read_bytes()
    with pytest.raises(fclib.FileError, match="belongs to its global problem, not to the local"):
        fclib.write(path, local.problem, local.solution, mode="replace")
    with pytest.raises(fclib.FileError, match="/fclib_local: is in the file already"):
        fclib.write(path, local.problem, mode="add")
    assert path.read_bytes() == before

    # another local problem leaves what is the global one's, another global one does not
    fclib.write(path, planted_local(3).problem, mode="replace")
    assert_same(planted_local(3).problem, fclib.read(path, "local"))
    assert fclib.contents(path) == ["global", "local", "solution", "guesses"]
    fclib.write(path, planted_global(3).problem, mode="replace")
    assert fclib.contents(path) == ["global", "local"]
    fclib.write(path, whole.problem)
    assert fclib.contents(path) == ["global"]


def test_a_solution_never_comes_to_belong_to_another_problem(tmp_path: Path) -> None:
    path = tmp_path / "local.hdf5"
    local, whole = planted_local(1), planted_global(1)
    for stored_with in ({"solution": local.solution}, {"guesses": [local.solution]}):
        fclib.write(path, local.problem, **stored_with)
        before = path.read_bytes()
        for mode in MODES:
            with pytest.raises(fclib.FileError, match="would become those of the global problem"):
                fclib.write(path, whole.problem, mode=mode)
        assert path.read_bytes() == before


def test_a_problem_that_is_replaced_leaves_no_hole(tmp_path: Path) -> None:
    path, fresh = tmp_path / "step.hdf5", tmp_path / "fresh.hdf5"
    for nc in (40, 5, 30, 8, 40):
        planted = planted_local(1, nc=nc)
        fclib.write(path, planted.problem, mode="replace")
        fclib.write(fresh, planted.problem)
        assert path.read_bytes() == fresh.read_bytes()
        fclib.write_solution(path, planted.solution)
    # what is another's stays
    with h5py.File(path, "a") as file:
        file["mine"] = 3
    fclib.write(path, planted_local(2).problem, mode="replace")
    assert fclib.contents(path) == ["local"]
    with h5py.File(path, "a") as file:
        assert file["mine"][()] == 3
        del file["mine"]
        file.attrs["mine"] = 4
    fclib.write(path, planted_local(3).problem, mode="replace")
    assert_same(planted_local(3).problem, fclib.read(path))
    with h5py.File(path) as file:
        assert file.attrs["mine"] == 4


MODES: list[Literal["add", "replace"]] = ["add", "replace"]


def test_modes_and_levels_that_are_none(written: Path) -> None:
    path, planted = written / "p.hdf5", planted_local(1)
    before = path.read_bytes()
    with pytest.raises(fclib.OptionError, match="no mode 'append'; there are: overwrite, add, rep"):
        fclib.write(path, planted.problem, mode="append")  # type: ignore[call-overload]
    with pytest.raises(fclib.OptionError, match="no mode 'overwrite'; there are: replace, add"):
        fclib.write_guesses(path, [], mode="overwrite")  # type: ignore[arg-type]
    for level in (-2, 10):
        said = f"level: is {level}, but must be 0 to 9"
        with pytest.raises(fclib.OptionError, match=said):
            fclib.write(path, planted.problem, compression=level)
        with pytest.raises(fclib.OptionError, match=said):
            fclib.write_solution(path, planted.solution, compression=level)
        with pytest.raises(fclib.OptionError, match=said):
            fclib.write_guesses(path, [], compression=level)
    assert path.read_bytes() == before


def test_the_level_of_compression_is_that_asked_for(tmp_path: Path) -> None:
    planted = planted_local(1, nc=60)
    r = np.arange(planted.problem.m, dtype=float)
    sizes = {}
    for level in (0, 1, 9):
        path = tmp_path / f"{level}.hdf5"
        fclib.write(path, planted.problem, compression=level)
        fclib.write_solution(path, fclib.Solution(r=r), compression=level)
        fclib.write_guesses(path, [fclib.Solution(r=r)], compression=level)
        with h5py.File(path) as file:
            for name in ("fclib_local/W/x", "solution/r", "guesses/1/r"):
                assert file[name].compression_opts == (level or None), name
        assert_same(planted.problem, fclib.read(path))
        sizes[level] = path.stat().st_size
    assert sizes[9] <= sizes[1] < sizes[0]


def test_kind_chooses_where_a_file_holds_both(tmp_path: Path) -> None:
    path, other = tmp_path / "both.hdf5", tmp_path / "global.hdf5"
    local, whole = planted_local(1).problem, planted_global(2).problem
    fclib.write(path, local)
    fclib.write(other, whole)
    with h5py.File(path, "a") as file, h5py.File(other) as source:
        source.copy("fclib_global", file)
    assert sorted(fclib.contents(path)) == ["global", "local"]
    assert_same(local, fclib.read(path, "local"))
    assert_same(whole, fclib.read(path, kind="global"))
    with pytest.raises(fclib.FileError, match=r"both\.hdf5.*local"):
        fclib.read(path)
    with pytest.raises(fclib.FileError, match=r"global\.hdf5.*local"):
        fclib.read(other, "local")


# ---- writing, all or nothing


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def written(tmp_path: Path) -> Path:
    """A folder that holds one file, p.hdf5."""
    fclib.write(tmp_path / "p.hdf5", planted_local(1).problem)
    return tmp_path


def invalid_problem() -> fclib.LocalProblem:
    return fclib.LocalProblem(W=np.eye(3), q=[np.nan, 0, 0], mu=[1.0])


def test_a_rewritten_file_is_the_new_one_alone(written: Path) -> None:
    fclib.write(written / "p.hdf5", planted_global(2).problem)
    assert fclib.contents(written / "p.hdf5") == ["global"]
    fclib.write_solution(written / "p.hdf5", planted_global(2).solution)
    assert fclib.contents(written / "p.hdf5") == ["global", "solution"]
    assert names_in(written) == ["p.hdf5"]


def test_an_invalid_problem_leaves_the_old_file(written: Path) -> None:
    before = (written / "p.hdf5").read_bytes()
    with pytest.raises(fclib.ProblemError, match=r"p\.hdf5.*q\[0\]"):
        fclib.write(written / "p.hdf5", invalid_problem())
    with pytest.raises(fclib.ProblemError, match="/solution/r"):
        fclib.write_solution(written / "p.hdf5", fclib.Solution(r=np.zeros(3)))
    with pytest.raises(fclib.ProblemError, match="new"):
        fclib.write(written / "new.hdf5", invalid_problem())
    assert (written / "p.hdf5").read_bytes() == before
    assert names_in(written) == ["p.hdf5"]


@pytest.mark.parametrize("kind", ["folder", "nowhere", "through a file"])
def test_a_place_that_cannot_be_written_is_a_file_error(written: Path, kind: str) -> None:
    (written / "folder").mkdir()
    path = {
        "folder": written / "folder",
        "nowhere": written / "nowhere" / "p.hdf5",
        "through a file": written / "p.hdf5" / "p.hdf5",
    }[kind]
    for action in (
        lambda: fclib.write(path, planted_local(1).problem),
        lambda: fclib.write_solution(path, planted_local(1).solution),
        lambda: fclib.write_guesses(path, [planted_local(1).solution]),
        lambda: fclib.write(path, planted_local(1).problem, mode="add"),
        lambda: fclib.read_guesses(path),
        lambda: fclib.read(path),
        lambda: fclib.contents(path),
        lambda: fclib.read_solution(path),
    ):
        with pytest.raises(fclib.FileError) as caught:
            action()
        assert str(path) in str(caught.value)
    assert names_in(written) == ["folder", "p.hdf5"]
    assert names_in(written / "folder") == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_or_file_is_a_file_error(written: Path) -> None:
    before = (written / "p.hdf5").read_bytes()
    (written / "p.hdf5").chmod(0o400)
    with pytest.raises(fclib.FileError, match=r"p\.hdf5"):
        fclib.write(written / "p.hdf5", planted_local(2).problem)
    written.chmod(0o500)
    with pytest.raises(fclib.FileError, match=r"new\.hdf5"):
        fclib.write(written / "new.hdf5", planted_local(2).problem)
    written.chmod(0o700)
    assert (written / "p.hdf5").read_bytes() == before
    assert names_in(written) == ["p.hdf5"]


def test_a_disk_that_fills_up_leaves_the_old_file(written: Path) -> None:
    resource = pytest.importorskip("resource")
    code = (
        "import resource, signal, sys, numpy as np, fclib\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "rng = np.random.default_rng(1)\n"
        "problem = fclib.LocalProblem(W=rng.standard_normal((300, 300)), q=np.zeros(300),\n"
        "                             mu=np.ones(100))\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, resource.RLIM_INFINITY))\n"
        "try:\n"
        "    fclib.write(sys.argv[1], problem)\n"
        "except fclib.FileError as error:\n"
        "    print(error)\n"
    )
    assert resource.RLIMIT_FSIZE >= 0
    path = written / "p.hdf5"
    before = path.read_bytes()
    run = ran(sys.executable, "-c", code, path)
    assert run.stdout.startswith(str(path))
    assert path.read_bytes() == before
    assert names_in(written) == ["p.hdf5"]


def test_permissions_of_a_replaced_file_are_kept(written: Path) -> None:
    path = written / "p.hdf5"
    for mode in (0o640, 0o600, 0o664):
        path.chmod(mode)
        fclib.write(path, planted_local(2).problem)
        assert path.stat().st_mode & 0o7777 == mode
        fclib.write_solution(path, planted_local(2).solution)
        assert path.stat().st_mode & 0o7777 == mode


def test_a_new_file_has_the_permissions_of_any_other(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    fclib.write(tmp_path / "p.hdf5", planted_local(1).problem)
    assert (tmp_path / "p.hdf5").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_link_stays_and_its_file_is_replaced(written: Path) -> None:
    (written / "elsewhere").mkdir()
    (written / "p.hdf5").rename(written / "elsewhere" / "p.hdf5")
    link = written / "link.hdf5"
    link.symlink_to(Path("elsewhere") / "p.hdf5")
    fclib.write(link, planted_global(1).problem)
    assert link.is_symlink()
    assert fclib.contents(written / "elsewhere" / "p.hdf5") == ["global"]
    assert names_in(written / "elsewhere") == ["p.hdf5"]


def test_a_link_to_nothing_yet_stays_and_its_file_is_made(tmp_path: Path) -> None:
    link = tmp_path / "link.hdf5"
    link.symlink_to("later.hdf5")
    fclib.write(link, planted_global(1).problem)
    assert link.is_symlink()
    assert fclib.contents(tmp_path / "later.hdf5") == ["global"]


@pytest.fixture
def fifo(tmp_path: Path) -> Iterator[Path]:
    """A pipe, in place of all that is neither a file nor a folder."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    yield path
    assert names_in(tmp_path) == ["pipe"]


@pytest.mark.parametrize(
    "call",
    [
        "write(sys.argv[1], fclib.LocalProblem(W=np.eye(3), q=np.zeros(3), mu=[1.0]))",
        "write_solution(sys.argv[1], fclib.Solution(r=np.zeros(3)))",
        "write_guesses(sys.argv[1], [fclib.Solution(r=np.zeros(3))])",
        "read(sys.argv[1])",
        "read_guesses(sys.argv[1])",
        "contents(sys.argv[1])",
    ],
)
def test_what_is_no_file_is_neither_read_nor_replaced(fifo: Path, call: str) -> None:
    code = (
        "import sys, numpy as np, fclib\n"
        f"try:\n    fclib.{call}\n"
        "except fclib.FileError as error:\n    print(error)\n"
    )
    run = ran(sys.executable, "-c", code, fifo, timeout=300)
    assert str(fifo) in run.stdout
    assert fifo.is_fifo()


@pytest.mark.parametrize("name", ["ü ß.hdf5", "a'b\"c.hdf5", "%s%n.hdf5", "-h.hdf5"])
def test_any_name_of_a_file_will_do(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    with pytest.raises(fclib.FileError) as caught:
        fclib.read(path)
    assert str(path) in str(caught.value)
    fclib.write(path, planted_local(1).problem)
    assert_same(planted_local(1).problem, fclib.read(str(path)))


def test_a_name_that_is_not_utf8_is_no_worse(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"\xff.hdf5")
    with pytest.raises(fclib.FileError, match="no such file"):
        fclib.read(path)
    fclib.write(path, planted_local(1).problem)
    assert_same(planted_local(1).problem, fclib.read(path))


# ---- arrays


def test_arrays_are_views_that_cannot_be_written() -> None:
    problem = planted_local(1, p=2).problem
    assert isinstance(problem, fclib.LocalProblem)
    for array in (problem.q, problem.mu, problem.s):
        assert array is not None
        assert not array.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    assert np.shares_memory(problem.q, problem.q)
    with pytest.raises(AttributeError):
        problem.q = np.zeros(problem.m)  # type: ignore[misc]


@pytest.mark.parametrize("storage", STORAGES)
def test_matrices_share_the_memory_of_their_problem(storage: str) -> None:
    W = np.diag([1.0, 2, 3]) + np.eye(3, k=1)
    make = {"csr": sp.csr_array, "csc": sp.csc_array, "coo": sp.coo_array, "dense": np.array}
    problem = fclib.LocalProblem(W=make[storage](W), q=np.zeros(3), mu=[1.0])
    first: Any = problem.W
    second: Any = problem.W
    if storage == "dense":
        assert np.shares_memory(first, second)
        assert not first.flags.writeable
        return
    for part in ("row", "col", "data") if storage == "coo" else ("indptr", "indices", "data"):
        assert np.shares_memory(getattr(first, part), getattr(second, part)), part
        assert not getattr(first, part).flags.writeable, part
    np.testing.assert_array_equal(first.toarray(), W)


def test_unsorted_matrices_can_be_sorted_without_harm_to_the_problem() -> None:
    unsorted = sp.csr_array(
        (np.array([1.0, 2, 3, 4]), np.array([2, 0, 1, 2]), np.array([0, 2, 3, 4])), shape=(3, 3)
    )
    problem = fclib.LocalProblem(W=unsorted, q=np.zeros(3), mu=[1.0])
    copy: Any = problem.W
    copy.sum_duplicates()
    again: Any = problem.W
    np.testing.assert_array_equal(again.indices, [2, 0, 1, 2])
    np.testing.assert_array_equal(copy.toarray(), again.toarray())


def test_arrays_keep_their_problem_alive() -> None:
    problem = planted_local(1, nc=40).problem
    assert isinstance(problem, fclib.LocalProblem)
    expected_q, expected_x = problem.q.copy(), np.array(problem.W.data)
    q, W = problem.q, problem.W
    del problem
    gc.collect()
    # what was freed would be taken again
    junk = [np.full(expected_x.size, 7.0) for _ in range(20)]
    np.testing.assert_array_equal(q, expected_q)
    np.testing.assert_array_equal(W.data, expected_x)
    assert len(junk) == 20


def test_a_problem_owns_its_data() -> None:
    q = np.array([1.0, 2, 3])
    problem = fclib.LocalProblem(W=np.eye(3), q=q, mu=[1.0])
    q[0] = 5
    assert problem.q[0] == 1


def test_complex_numbers_are_not_silently_made_real() -> None:
    builds: list[Callable[[], Any]] = [
        lambda: fclib.LocalProblem(W=1j * np.eye(3), q=np.zeros(3), mu=[1.0]),
        lambda: fclib.LocalProblem(W=sp.csr_array(1j * np.eye(3)), q=np.zeros(3), mu=[1.0]),
        lambda: fclib.LocalProblem(W=np.eye(3), q=1j * np.ones(3), mu=[1.0]),
    ]
    for build in builds:
        with pytest.raises(fclib.ProblemError):
            build()


@pytest.mark.parametrize(
    "wrong",
    [
        {"spacedim": "three"},
        {"info": "a title"},
        {"q": "numbers"},
        {"q": np.zeros((1, 3))},
        {"W": np.zeros(9)},
        {"W": None},
        {"unknown": 1},
    ],
    ids=str,
)
def test_an_argument_of_the_wrong_type_is_named(wrong: dict[str, Any]) -> None:
    arguments: dict[str, Any] = {"W": np.eye(3), "q": np.zeros(3), "mu": [1.0]} | wrong
    with pytest.raises((TypeError, fclib.ProblemError), match=next(iter(wrong))):
        fclib.LocalProblem(**arguments)


# ---- what a replaced file keeps


def one_contact() -> fclib.LocalProblem:
    return fclib.LocalProblem(spacedim=2, W=np.eye(2), q=[-1, 0], mu=[0.5])


def test_of_a_file_of_two_names_one_is_replaced(tmp_path: Path) -> None:
    path, other = tmp_path / "a.hdf5", tmp_path / "b.hdf5"
    fclib.write(path, planted_local(1).problem)
    os.link(path, other)
    kept = other.read_bytes()
    fclib.write(path, one_contact())
    assert fclib.read(path).m == 2
    assert other.read_bytes() == kept  # a backup of links stays what it was
    assert sorted(tmp_path.iterdir()) == [path, other]


FULL_DISK = """
import os, sys, numpy as np, fclib
rng = np.random.default_rng(1)
def problem(m):
    W = rng.normal(size=(m, m))
    return fclib.LocalProblem(spacedim=2, W=W, q=np.ones(m), mu=np.ones(m // 2))
path = sys.argv[1] + "/a.hdf5"
fclib.write(path, problem(160), compression=0)
try:
    fclib.write(path, problem(320), compression=0)
except fclib.FileError as error:
    print(error)
print(fclib.read(path).m, sorted(os.listdir(sys.argv[1])))
fclib.write(path, problem(10))
print(fclib.read(path).m)
"""


def test_a_full_disk_leaves_the_old_file(tmp_path: Path) -> None:
    """On a small file system that goes with its process."""
    disk = ["sh", "-c", 'mount -t tmpfs -o size=1m none "$0" && exec "$@"', str(tmp_path)]
    apart = ["unshare", "--mount", "--map-root-user"]
    if not shutil.which("unshare") or subprocess.run([*apart, *disk, "true"]).returncode:
        pytest.skip("no file system can be mounted")
    run = ran(*apart, *disk, sys.executable, "-c", FULL_DISK, tmp_path)
    assert run.stderr == ""
    assert run.stdout.splitlines() == [
        f"{tmp_path}/a.hdf5: cannot be written: {os.strerror(errno.ENOSPC)}",
        "160 ['a.hdf5']",
        "10",
    ]


@pytest.mark.skipif(not hasattr(os, "setxattr"), reason="extended attributes are Linux's")
def test_a_replaced_file_keeps_owner_and_attributes(tmp_path: Path) -> None:
    path = tmp_path / "a.hdf5"
    fclib.write(path, planted_local(1).problem)
    try:
        os.setxattr(path, "user.note", b"mine")
    except OSError:
        pytest.skip("the file system has no extended attributes")
    path.chmod(0o640)
    owner = (12345, 12346) if os.geteuid() == 0 else (os.getuid(), os.getgid())
    os.chown(path, *owner)
    fclib.write(path, one_contact())
    status = path.stat()
    assert os.getxattr(path, "user.note") == b"mine"
    assert (status.st_uid, status.st_gid, status.st_mode & 0o777) == (*owner, 0o640)


@pytest.fixture
def locked_folder() -> Iterator[Path]:
    """A folder that may be read and not be written."""
    with tempfile.TemporaryDirectory(prefix="fclib-io-") as name:
        folder = Path(name) / "locked"
        folder.mkdir()
        Path(name).chmod(0o755)
        yield folder
        folder.chmod(0o755)


def as_nobody(body: Callable[[], object]) -> bool:
    """Whether it ends well in a process without the rights of root."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            if os.geteuid() == 0:
                os.setuid(65534)
            body()
            code = 0
        finally:
            os._exit(code)
    return os.waitpid(child, 0)[1] == 0


def test_a_file_that_cannot_be_replaced_stays(locked_folder: Path) -> None:
    path = locked_folder / "a.hdf5"
    fclib.write(path, planted_local(1).problem)
    kept = path.read_bytes()
    path.chmod(0o666)
    locked_folder.chmod(0o555)

    def refused() -> None:
        for target in (path, locked_folder / "new.hdf5"):
            with pytest.raises(fclib.FileError, match="no new file can be made beside it"):
                fclib.write(target, one_contact())

    assert as_nobody(refused)
    if os.geteuid() == 0:  # a file of somebody else's, in a folder for all
        locked_folder.chmod(0o777)

        def not_ours() -> None:
            with pytest.raises(fclib.FileError, match="owner, permissions and attributes"):
                fclib.write(path, one_contact())

        assert as_nobody(not_ours)
    assert path.read_bytes() == kept
    assert [entry.name for entry in locked_folder.iterdir()] == ["a.hdf5"]


# ---- other threads


def test_python_goes_on_while_a_file_is_written(tmp_path: Path) -> None:
    path = tmp_path / "a.hdf5"
    fclib.write(path, one_contact())
    folder = os.open(tmp_path, os.O_RDONLY)
    fcntl.flock(folder, fcntl.LOCK_EX)  # writers wait for their turn
    solution = fclib.Solution(r=[1, 0])
    writer = threading.Thread(target=fclib.write_solution, args=(path, solution), daemon=True)
    writer.start()
    writer.join(0.2)
    assert writer.is_alive()
    os.close(folder)  # by a thread that still runs
    writer.join(60)
    assert not writer.is_alive()
    assert fclib.read_solution(path) is not None


def test_several_solutions_are_kept_beside_the_one(written: Path) -> None:
    path = written / "p.hdf5"
    planted = planted_local(1)
    r = planted.solution.r
    assert fclib.read_solutions(path) == []
    fclib.write_solutions(path, [r, 0 * r])
    assert fclib.contents(path) == ["local", "solutions"]
    first, second = fclib.read_solutions(path)
    np.testing.assert_array_equal(first.r, r)
    assert first.u is not None
    assert not second.r.any()
    with h5py.File(path) as file:
        assert file["solutions/number_of_solutions"][0] == 2
        assert file["solutions/error"][0] < 1e-10 < file["solutions/error"][1]
    # they stay where the solution is replaced, and go with the problem
    fclib.write_solution(path, r)
    assert len(fclib.read_solutions(path)) == 2
    fclib.write(path, planted_local(2).problem, mode="replace")
    assert fclib.read_solutions(path) == []
    # also from a file of which something stays
    fclib.write_solutions(path, [planted_local(2).solution] * 2)
    with h5py.File(path, "a") as file:
        file.create_group("mine")
    fclib.write(path, planted_local(1).problem, mode="replace")
    assert fclib.read_solutions(path) == []
    assert fclib.contents(path) == ["local"]
    with h5py.File(path) as file:
        assert set(file) == {"fclib_local", "mine"}
    fclib.write_solutions(path, [])
    with pytest.raises(fclib.ProblemError, match="solutions"):
        fclib.write_solutions(path, [r, "r"])


def test_a_rewritten_problem_keeps_nothing_of_the_old_one(written: Path) -> None:
    """Also in a file that holds more than this problem, which is changed where it stands."""
    family: Any = scenes.assemblies()["Units"](contacts=40)
    old: Any = scenes.Assembled(family=family, seed=0).problem(1)
    assert old.bodies is not None
    new: Any = old.replace(contacts=None, bodies=None)
    r = np.zeros(old.m)
    for foreign in (False, True):
        path = written / f"foreign-{foreign}.hdf5"
        fclib.write(path, old, r, [r])
        fclib.write_solutions(path, [r, r])
        if foreign:
            with h5py.File(path, "r+") as file:
                file["mine"] = 1.0
        fclib.write(path, new, mode="replace")
        assert fclib.contents(path) == [old.kind]
        assert fclib.read_solution(path) is None
        assert fclib.read_guesses(path) == []
        assert fclib.read_solutions(path) == []
        assert fclib.read(path).bodies is None
        with h5py.File(path) as file:
            assert ("mine" in file) == foreign
