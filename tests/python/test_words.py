"""What is said of files that are not what they seem, and of matrices that are not symmetric."""

import shutil
import signal
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp

import fclib
import helpers_cli
from fclib import analysis, recorders
from helpers import dense, planted_global, planted_local


def written(path: Path) -> Path:
    fclib.write(path, planted_local(1, nc=2).problem)
    return path


def refusal(path: Path) -> str:
    """The one line that every command says of a file."""
    lines = []
    for command in ("info", "solve", "check", "analyze"):
        run = helpers_cli.run(command, str(path), code=1)
        (line,) = run.stderr.splitlines()
        lines.append(line.removeprefix(f"fclib: {path}: "))
    assert len(set(lines)) == 1, lines
    with pytest.raises(fclib.FileError) as caught:
        fclib.read(path)
    assert str(caught.value) == f"{path}: {lines[0]}"
    return lines[0]


def test_a_pointer_of_git_lfs(tmp_path: Path) -> None:
    path = tmp_path / "pointer.hdf5"
    path.write_text(
        f"version https://git-lfs.github.com/spec/v1\noid sha256:{'0' * 64}\nsize 41184\n"
    )
    assert refusal(path) == "is a pointer of Git LFS, not the file itself: run 'git lfs pull'"


@pytest.mark.parametrize("form", ["local", "global"])
@pytest.mark.parametrize("storage", ["dense", "csr", "coo"])
def test_a_text_of_siconos(tmp_path: Path, form: str, storage: str) -> None:
    path = tmp_path / "problem.dat"
    make = planted_local if form == "local" else planted_global
    fclib.write_siconos(path, make(1, nc=2, storage=storage).problem)
    words = "is not an HDF5 file. If it is the text of Siconos (.dat), convert it: 'fclib convert"
    assert refusal(path) == f"{words} {path} NEW.hdf5'"
    helpers_cli.run("convert", str(path), str(tmp_path / "new.hdf5"))
    assert fclib.read(tmp_path / "new.hdf5").nc == 2


@pytest.mark.parametrize("text", ["", "3", "3 nodes", "a,b\n1,2\n", "7 7 7", "3.5 2 0\n"])
def test_other_texts(tmp_path: Path, text: str) -> None:
    path = tmp_path / "text.hdf5"
    path.write_text(text)
    assert refusal(path).startswith("is not an HDF5 file")
    assert "Siconos" not in refusal(path)


DYING = """
import os, signal, sys, h5py
file = h5py.File(sys.argv[1], "r+", libver="latest")
if sys.argv[2] == "swmr":
    file.swmr_mode = True
else:
    file["more"] = range(100)
    file.flush()
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize(
    ("mode", "block"),
    # a file in SWMR mode can be read at any moment, but HDF5 looks for it behind no user block
    [("plain", 0), ("plain", 512), ("plain", 2048), ("swmr", 512), ("swmr", 2048)],
)
def test_a_file_whose_writer_died(tmp_path: Path, mode: str, block: int) -> None:
    path = tmp_path / "dead.hdf5"
    with (
        h5py.File(written(tmp_path / "good.hdf5")) as good,
        h5py.File(path, "w", libver="latest", userblock_size=block) as file,
    ):
        good.copy("fclib_local", file)
    assert fclib.read(path).nc == 2
    done = subprocess.run([sys.executable, "-c", DYING, path, mode], capture_output=True)
    assert done.returncode == -signal.SIGKILL, done.stderr
    words = refusal(path)
    assert words.startswith("was not closed by the program that wrote it.")
    assert f"run 'h5clear -s {path}'" in words
    with pytest.raises(fclib.FileError, match="was not closed"):
        fclib.write_solution(path, fclib.Solution(r=np.zeros(6)))
    if (clear := shutil.which("h5clear")) is not None:
        subprocess.run([clear, "-s", path], check=True)
        assert fclib.read(path).nc == 2


def test_a_file_in_swmr_mode_whose_writer_died_is_read(tmp_path: Path) -> None:
    path = tmp_path / "dead.hdf5"
    with (
        h5py.File(written(tmp_path / "good.hdf5")) as good,
        h5py.File(path, "w", libver="latest") as file,
    ):
        good.copy("fclib_local", file)
    done = subprocess.run([sys.executable, "-c", DYING, path, "swmr"], capture_output=True)
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert fclib.digest(fclib.read(path)) == fclib.digest(fclib.read(tmp_path / "good.hdf5"))
    fclib.write_solution(path, fclib.Solution(r=np.zeros(6)))
    assert fclib.read_solution(path) is not None


def test_links_to_other_files(tmp_path: Path) -> None:
    good = written(tmp_path / "good.hdf5")
    for target, where in (("nowhere.hdf5", "/fclib_local"), ("good.hdf5", "/nothing")):
        path = tmp_path / "link.hdf5"
        with h5py.File(path, "w") as file:
            file["fclib_local"] = h5py.ExternalLink(target, where)
        words = refusal(path)
        assert words.startswith(
            f"/fclib_local: is an external link to '{where}' of the file '{target}', which "
        )
        there = target == good.name
        assert words.endswith(
            f"is not {'followed' if there else 'there'}: copy what it links to into this file"
        )


def test_the_names_in_links_do_not_steer_the_terminal(tmp_path: Path) -> None:
    path = written(tmp_path / "good.hdf5")
    for link in (
        h5py.SoftLink("/no\x1b[31m\nwhere" + 300 * "x"),
        h5py.ExternalLink("no\x1b[31m\nfile" + 300 * "y", "/no\twhere" + 300 * "z"),
    ):
        with h5py.File(path, "r+") as file:
            del file["fclib_local/W"]
            file["fclib_local/W"] = link
        words = refusal(path)
        assert words.isprintable()
        assert len(words) < 250


# ---- triangles, and matrices that are not symmetric


def pack(path: Path, name: str, storage: str, upper: bool = False) -> None:
    """Leave one triangle of a matrix, and say so."""
    with h5py.File(path, "r+") as file:
        (root,) = (key for key in file if key.startswith("fclib_"))
        group = file[f"{root}/{name}"]
        problem = fclib.read(path.with_name("whole.hdf5"))
        whole = sp.coo_array(getattr(problem, name))
        half = sp.coo_array(sp.triu(whole) if upper else sp.tril(whole))
        if storage == "dense":
            values = {"x": half.toarray().ravel(order="F")}
            nz = -3
        elif storage == "coo":
            values, nz = {"p": half.col, "i": half.row, "x": half.data}, half.nnz
        else:
            made = sp.csc_array(half) if storage == "csc" else sp.csr_array(half)
            values = {"p": made.indptr, "i": made.indices, "x": made.data}
            nz = -1 if storage == "csc" else -2
        for key in ("p", "i", "x", "nz", "nzmax"):
            if key in group:
                del group[key]
        for key, array in values.items():
            group[key] = array.astype("<f8" if key == "x" else "<i4")
        group["nz"], group["nzmax"] = np.array([nz], "<i4"), np.array([half.nnz], "<i4")
        group.attrs["symmetric_packed"] = np.int64(1)


@pytest.mark.parametrize("upper", [False, True])
@pytest.mark.parametrize("storage", ["csc", "csr", "coo", "dense"])
@pytest.mark.parametrize("name", ["W", "R", "M"])
def test_a_triangle_that_stands_for_both(
    tmp_path: Path, name: str, storage: str, upper: bool
) -> None:
    make = planted_global if name == "M" else planted_local
    case = make(3, nc=3, p=2)
    problem = case.problem
    whole = getattr(problem, name)
    symmetric = (whole + whole.T) / 2
    problem = problem.replace(**{name: symmetric})
    for file in ("whole.hdf5", "packed.hdf5"):
        fclib.write(tmp_path / file, problem)
    pack(tmp_path / "packed.hdf5", name, storage, upper)
    again = getattr(fclib.read(tmp_path / "packed.hdf5"), name)
    np.testing.assert_array_equal(dense(again), dense(symmetric))


def test_the_attribute_may_be_of_any_type(tmp_path: Path) -> None:
    for value in (1, True, 1.0, np.array([1], "<i2")):
        for file in ("whole.hdf5", "packed.hdf5"):
            fclib.write(tmp_path / file, planted_local(1, nc=2).problem)
        pack(tmp_path / "packed.hdf5", "W", "csc")
        with h5py.File(tmp_path / "packed.hdf5", "r+") as file:
            file["fclib_local/W"].attrs["symmetric_packed"] = value
        one, other = fclib.read(tmp_path / "packed.hdf5"), fclib.read(tmp_path / "whole.hdf5")
        assert isinstance(one, fclib.LocalProblem)
        assert isinstance(other, fclib.LocalProblem)
        lower = np.tril(dense(other.W))
        expected = lower + np.tril(lower, -1).T
        np.testing.assert_array_equal(dense(one.W), expected)


def test_what_is_not_symmetric_is_told(tmp_path: Path) -> None:
    W = np.diag([1.0, 2.0, 2.0])
    W[0, 1], W[1, 0] = 0.5, 0.25
    problem = fclib.LocalProblem(W=W, q=[-1, 0, 0], mu=[0.5])
    path = tmp_path / "skew.hdf5"
    fclib.write(path, problem)
    words = f"fclib: {path}: W is not symmetric: max |W - W^T| is 0.12 of max |W|"
    for command in ("info", "solve"):
        run = helpers_cli.run(command, str(path))
        assert run.stderr.splitlines() == [words], command
    assert "not symmetric, by 0.12" in analysis.analyze(problem).words
    # one triangle alone
    fclib.write(path, problem.replace(W=np.tril(W)))
    run = helpers_cli.run("info", str(path))
    assert run.stderr.startswith(words.replace("0.12", "0.12"))
    assert "symmetric_packed = 1" in run.stderr
    # rounding is no word
    W[0, 1] = W[1, 0] * (1 + 1e-15)
    fclib.write(path, problem.replace(W=W))
    assert helpers_cli.run("solve", str(path)).stderr == ""


def test_pointers_that_are_all_zero_in_memory() -> None:
    whole = sp.csr_array(np.eye(3) + 0.1)
    whole.indptr[:] = 0
    with pytest.raises(fclib.ProblemError, match=r"W\.indptr: says that there is no entry"):
        fclib.LocalProblem(W=whole, q=[-1, 0, 0], mu=[0.5])


# ---- what 3.1 stores of vectors that it is not given


def unwrite(file: h5py.File, name: str) -> None:
    shape = file[name].shape
    del file[name]
    file.create_dataset(name, shape=shape, dtype="<f8")


@pytest.mark.parametrize("form", ["local", "global"])
def test_vectors_that_were_never_written_are_absent(tmp_path: Path, form: str) -> None:
    path = tmp_path / "p.hdf5"
    case = (planted_local if form == "local" else planted_global)(1, nc=2, p=1)
    fclib.write(path, case.problem, case.solution)
    fclib.write_guesses(path, [case.solution])
    velocities = ("u",) if form == "local" else ("u", "v")
    with h5py.File(path, "r+") as file:
        for name in velocities:
            unwrite(file, f"solution/{name}")
            unwrite(file, f"guesses/1/{name}")
    (guess,) = fclib.read_guesses(path)
    for found in (fclib.read_solution(path), guess):
        assert found is not None
        assert all(getattr(found, name) is None for name in velocities)
        assert fclib.merit(case.problem, found).error <= 1e-8  # they follow from r
    helpers_cli.run("check", str(path))

    with h5py.File(path, "r+") as file:
        unwrite(file, "solution/r")
    assert fclib.read_solution(path) is None
    assert fclib.contents(path) == [form, "guesses"]
    run = helpers_cli.run("check", str(path), code=1)
    assert "no solution" in run.stderr
    run = helpers_cli.run("info", str(path))
    assert run.stderr == (f"fclib: {path}: /solution/r: was declared and never written: left out\n")
    with h5py.File(path, "r+") as file:
        unwrite(file, "guesses/1/r")
    with pytest.raises(fclib.FileError, match=r"/guesses/1/r: was declared and never written"):
        fclib.read_guesses(path)
    # it gives way to one
    fclib.write_solution(path, case.solution)
    assert fclib.read_solution(path) is not None


def test_one_thing_is_no_plural(tmp_path: Path) -> None:
    """Messages with a number of things agree with it."""
    recording = recorders.Recording(tmp_path / "steps")

    def wrong() -> None:
        raise ValueError("a number is not finite")

    recording.take(wrong)
    assert recording.without.startswith("left out of 1 step: number 0. Of number 0: a number")
    with fclib.SequenceWriter(tmp_path / "one.h5") as writer:
        writer.append(planted_local(1, nc=2).problem)
    assert repr(fclib.Sequence(tmp_path / "one.h5")).endswith("one.h5: 1 step>")
    with pytest.raises(fclib.FileError, match="has 1 step; the first is number 0"):
        fclib.read(f"{tmp_path / 'one.h5'}#3")
    result = fclib.solve(planted_local(1, nc=5).problem, "nsgs", tol=1e-15, max_iterations=1)
    assert ", 1 iteration, " in repr(result)
