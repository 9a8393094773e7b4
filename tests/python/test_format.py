"""The specification of the format: a reader that knows nothing but docs/format.md."""

import subprocess
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import fclib
import odd_files
from capi_library import compile_program
from doc_blocks import blocks_of
from helpers import STORAGES, dense, planted_global, planted_local, planted_rolling

MATRICES = ("M", "H", "G", "W", "V", "R")
VECTORS = ("f", "w", "b", "q", "s", "mu", "mu_r")
TEXTS = ("title", "description", "math_info")
PEER = Path("/usr/include/fclib.h")


@pytest.fixture(scope="module")
def reader(root: Path) -> Any:
    """The function `read` of the page, without the call below it."""
    code = next(b.code for b in blocks_of(root / "docs/format.md") if b.language == "python")
    definitions, call, _ = code.partition("problems, solution, guesses =")
    assert call
    namespace: dict[str, Any] = {}
    exec(compile(definitions, "docs/format.md", "exec"), namespace)
    return namespace["read"]


def assert_same(members: dict[str, Any], problem: fclib.Problem) -> None:
    """What was read by the page's reader is what the library reads."""
    expected = {name for name in (*MATRICES, *VECTORS) if getattr(problem, name, None) is not None}
    assert set(members) - {"spacedim", *TEXTS} == expected
    assert members["spacedim"] == problem.spacedim
    for name in expected:
        ours, theirs = getattr(problem, name), members[name]
        assert ours.shape == theirs.shape, name
        if name in MATRICES:
            # duplicates may have been added up in another order
            difference = np.abs((sp.csr_array(ours) - theirs).data).max(initial=0)
            assert difference <= 1e-14 * np.abs(theirs.data).max(initial=0), name
        else:
            np.testing.assert_array_equal(theirs, ours, err_msg=name)
    for name in TEXTS:
        assert members.get(name, "") == getattr(problem.info, name)


def assert_same_solution(vectors: dict[str, Any], solution: fclib.Solution) -> None:
    for name in ("v", "u", "r", "l"):
        ours = getattr(solution, name)
        assert (name in vectors) == (ours is not None), name
        if ours is not None:
            np.testing.assert_array_equal(vectors[name], ours)


@settings(max_examples=40)
@given(
    seed=st.integers(0, 1000),
    d=st.sampled_from([2, 3]),
    nc=st.integers(0, 24),
    p=st.integers(0, 3),
    storage=st.sampled_from(STORAGES),
    form=st.sampled_from(["global", "local"]),
    level=st.sampled_from([0, 6]),
)
def test_what_we_write(
    reader: Any,
    tmp_path_factory: pytest.TempPathFactory,
    seed: int,
    d: int,
    nc: int,
    p: int,
    storage: str,
    form: str,
    level: int,
) -> None:
    path = tmp_path_factory.mktemp("file") / "problem.hdf5"
    make = planted_global if form == "global" else planted_local
    case = make(seed, d=d, nc=nc, p=p, storage=storage)
    info = fclib.ProblemInfo(title="Stapel, höher", description="two\nlines")
    guesses = [case.solution] * (seed % 3)
    fclib.write(
        path, case.problem.replace(info=info), case.solution, guesses=guesses, compression=level
    )
    problems, solution, read_guesses = reader(path)
    assert [*problems, "solution", *(["guesses"] if guesses else [])] == fclib.contents(path)
    assert_same(problems[form], fclib.read(path))
    assert_same_solution(solution, case.solution)
    assert len(read_guesses) == len(guesses)
    for guess in read_guesses:
        assert_same_solution(guess, case.solution)


@pytest.mark.parametrize("d", [3, 5])
def test_rolling_problems(reader: Any, tmp_path: Path, d: int) -> None:
    problem, r = planted_rolling(d, seed=d)
    path = tmp_path / "rolling.hdf5"
    fclib.write(path, problem, fclib.Solution(r=r))
    problems, solution, _ = reader(path)
    assert_same(problems["local_rolling"], problem)
    np.testing.assert_array_equal(solution["r"], r)


def test_several_problems_and_whose_solution_it_is(reader: Any, tmp_path: Path) -> None:
    path = tmp_path / "both.hdf5"
    case = planted_global(1, nc=4, p=1)
    assert isinstance(case.problem, fclib.GlobalProblem)
    local = case.problem.condense()
    fclib.write(path, local)
    fclib.write(path, case.problem, case.solution, mode="add")
    problems, solution, _ = reader(path)
    assert_same(problems["global"], case.problem)
    assert_same(problems["local"], local)
    assert_same_solution(solution, case.solution)
    assert solution["v"].size == problems["global"]["M"].shape[0]


def test_what_the_page_says_of_types(tmp_path: Path) -> None:
    path = tmp_path / "types.hdf5"
    case = planted_global(2, nc=30, p=2)
    info = fclib.ProblemInfo(title="title")
    known = {"M": fclib.MatrixInfo(comment="spd", conditioning=3.0, rank=4)}
    fclib.write(path, case.problem.replace(info=info, matrix_info=known), case.solution)
    fclib.write_attributes(path, "info", {"number": 1.5, "text": "words"})
    with h5py.File(path) as file:
        root = {name: value.decode() for name, value in file.attrs.items()}
        assert root == {"format": "FCLIB 3.1", "generator": f"fclib {fclib.__version__}"}
        group = file["fclib_global"]
        assert set(group) == {"spacedim", "M", "H", "G", "vectors", "info"}
        assert set(group["M"]) == {
            *("nzmax", "m", "n", "nz", "p", "i", "x"),
            *("comment", "conditioning", "determinant", "rank"),
        }
        assert group["M/nz"][0] == group["M/nzmax"][0] == group["M/x"].size, "triplets"
        assert group["spacedim"].shape == (1,)
        assert group["info/title"][()] == b"title"
        assert group["info/title"].shape == ()
        assert group["info/title"].id.get_type().get_size() == len("title") + 1
        assert dict(group["info"].attrs) == {"number": 1.5, "text": b"words"}

        def look(name: str, item: Any) -> None:
            if not isinstance(item, h5py.Dataset) or item.dtype.kind == "S":
                return
            assert item.dtype in ("<i4", "<f8"), name
            assert item.ndim == 1, name
            if item.size < 64:
                assert item.chunks is None, name
            elif item.chunks is not None:
                assert item.chunks[0] * item.dtype.itemsize <= 2**20
                assert item.compression == "gzip"

        file.visititems(look)
        assert group["M/p"].chunks, "repeats itself, and is stored compressed"


def test_others_may_add_to_our_files(tmp_path: Path) -> None:
    """Small indices make small files, and must not end in HDF5 failing at what is added."""
    path = tmp_path / "ours.hdf5"
    problem = planted_local(1, nc=2).problem
    assert isinstance(problem, fclib.LocalProblem)
    fclib.write(path, problem)
    added = np.arange(1000, dtype="i2")
    with h5py.File(path, "r+") as file:
        file.create_dataset("added", data=added, chunks=(1,))
        for number in range(1000):
            file.create_group(f"group-{number:04}")
    with h5py.File(path) as file:
        assert (file["added"][:] == added).all()
        assert len(file) == 1002
    again = fclib.read(path)
    assert isinstance(again, fclib.LocalProblem)
    assert (again.q == problem.q).all()


def test_what_a_reader_of_ours_takes(tmp_path: Path) -> None:
    path = tmp_path / "other.hdf5"
    with h5py.File(path, "w") as file:
        group = file.create_group("fclib_local")
        group["spacedim"] = np.int64(3)  # scalar, and wide
        for name, value in {"m": 3, "n": 3, "nz": -2, "nzmax": 99}.items():
            group[f"W/{name}"] = np.array([value], dtype=np.int16)
        group["W/p"] = np.array([0, 2, 3, 4], dtype=np.uint8)
        group["W/i"] = np.array([0, 0, 1, 2, 77])  # a sum, and one beyond the end
        group["W/x"] = np.array([1.0, 1.0, 3.0, 4.0, 77.0], dtype=np.float32)
        group["vectors/q"] = np.array([-1, 0, 0])
        group["vectors/mu"] = np.array([0.5])
        group["info/title"] = "of variable length, ü"
        group["info/description"] = np.bytes_(b"without its NUL")
        file["strange"] = np.zeros((2, 2))
        group["W"].attrs["strange"] = [1, 2]
    problem = fclib.read(path)
    assert isinstance(problem, fclib.LocalProblem)
    np.testing.assert_array_equal(dense(problem.W), np.diag([2.0, 3.0, 4.0]))
    assert problem.info.title == "of variable length, ü"
    assert problem.info.description == "without its NUL"


def test_real_files(reader: Any, real_data: Path) -> None:
    seen = set()
    for path in sorted(real_data.glob("*/*.hdf5")):
        problems, _, _ = reader(path)
        for kind, members in problems.items():
            seen.add(kind)
            problem = fclib.read(path, kind)
            if problem.info.title or "title" in members:
                members = members | {"title": problem.info.title}
            # bytes that are no UTF-8 are shown in one way or another
            for name in TEXTS:
                if "�" in members.get(name, ""):
                    members[name] = getattr(problem.info, name)
            assert_same(members, problem)
    assert {"local", "global", "global_rolling", "local_rolling"} <= seen


WRITE = """
#include <fclib.h>
int main(int argc, char** argv) {
  double x[] = {1, 2, 3, 4, 0, 0}, q[] = {-1, 2, 0}, mu[] = {0.5}, r[] = {1, 0, 0};
  int p[] = {0, 1, 2, 4}, i[] = {0, 1, 2, 2, 0, 0};
  struct fclib_matrix_info about = {"a comment", 3.0, 24.0, 3};
  struct fclib_matrix W = {6, 3, 3, p, i, x, -1, &about};
  struct fclib_info info = {"a title", "a description", "convex"};
  struct fclib_local problem = {&W, 0, 0, mu, q, 0, 3, &info};
  struct fclib_solution solution = {0, q, r, 0};
  return argc == 2 && fclib_write_local(&problem, argv[1]) &&
         fclib_write_solution(&solution, argv[1]) &&
         fclib_write_guesses(1, &solution, argv[1]) ? 0 : 1;
}
"""


@pytest.mark.skipif(not PEER.is_file(), reason="libfclib-dev 3.1 is not installed")
def test_odd_files(reader: Any, tmp_path: Path) -> None:
    read = 0
    for odd in odd_files.make(tmp_path):
        try:
            problem = fclib.read(odd.path)
        except fclib.Error:
            continue
        read += 1
        assert_same(reader(odd.path)[0][odd.kind], problem)
    assert read > 90


def test_what_libfclib_writes(reader: Any, tmp_path: Path) -> None:
    source, path = tmp_path / "write.c", tmp_path / "theirs.hdf5"
    source.write_text(WRITE)
    library = next(Path("/usr/lib").rglob("libfclib.so.0")).parent
    program = compile_program(source, tmp_path / "write", f"-I{PEER.parent}", folder=library)
    subprocess.run([program, path], check=True)
    problems, solution, guesses = reader(path)
    assert_same(problems["local"], fclib.read(path))
    np.testing.assert_array_equal(dense(problems["local"]["W"]), np.diag([1.0, 2.0, 7.0]))
    np.testing.assert_array_equal(solution["r"], [1, 0, 0])
    assert len(guesses) == 1
