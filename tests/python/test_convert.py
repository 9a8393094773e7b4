"""Siconos' text files, storages, and ``fclib convert``."""

import contextlib
import json
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st

import fclib
import helpers_cli
from ball_judge import judge
from helpers import Array, dense, planted_global, planted_local, ran

STORAGES = ("csr", "csc", "triplet", "dense")
MATRICES = ("W", "V", "R", "M", "H", "G")
VECTORS = ("q", "mu", "s", "f", "w", "b", "mu_r")


run = partial(helpers_cli.run, "convert")


def converted(*arguments: object) -> dict[str, Any]:
    """The one record of a conversion that must go well."""
    result = run("--json", *arguments)
    (line,) = result.stdout.splitlines()
    record = json.loads(line)
    assert isinstance(record, dict)
    return record


def storage_of(a: Any) -> str:
    return "dense" if isinstance(a, np.ndarray) else str(a.format).replace("coo", "triplet")


def assert_equal(first: fclib.Problem, second: fclib.Problem) -> None:
    """The same problem, to the last bit; the storages and the info may differ."""
    assert type(first) is type(second)
    assert first.spacedim == second.spacedim
    for name in MATRICES:
        a, b = getattr(first, name, None), getattr(second, name, None)
        assert (a is None) == (b is None), name
        if a is not None and b is not None:
            assert a.shape == b.shape
            np.testing.assert_array_equal(dense(a), dense(b), err_msg=name)
    for name in VECTORS:
        a, b = getattr(first, name, None), getattr(second, name, None)
        assert (a is None) == (b is None), name
        if a is not None:
            np.testing.assert_array_equal(a, b, err_msg=name)


# ---- random problems: any finite numbers, of any size

numbers = st.one_of(
    st.just(0.0),
    st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=True),
    st.floats(-1, 1),
)


@st.composite
def arrays(draw: st.DrawFn, *shape: int) -> Array:
    size = int(np.prod(shape))
    return np.array(draw(st.lists(numbers, min_size=size, max_size=size)), float).reshape(shape)


@st.composite
def problems(draw: st.DrawFn) -> fclib.Problem:
    rolling = draw(st.booleans())
    d = draw(st.sampled_from((3, 5) if rolling else (2, 3)))
    # nothing tells whether no contact rolls
    nc = draw(st.integers(1 if rolling else 0, 3))
    mu = np.abs(draw(arrays(nc)))
    friction = {"mu": mu, "mu_r": np.abs(draw(arrays(nc)))} if rolling else {"mu": mu}
    m = d * nc
    if draw(st.booleans()):
        n = draw(st.integers(1, 4))
        data = {
            "M": draw(arrays(n, n)),
            "H": draw(arrays(n, m)),
            "f": draw(arrays(n)),
            "w": draw(arrays(m)),
        }
        make: Any = fclib.GlobalRollingProblem if rolling else fclib.GlobalProblem
    else:
        data = {"W": draw(arrays(m, m)), "q": draw(arrays(m))}
        make = fclib.LocalRollingProblem if rolling else fclib.LocalProblem
    problem: fclib.Problem = make(spacedim=d, **data, **friction)
    return problem.with_storage(draw(st.sampled_from(STORAGES)))


# ---- Siconos' texts in Python


@given(problems())
def test_a_text_reads_back_equal(tmp_path_factory: pytest.TempPathFactory, problem: Any) -> None:
    path = tmp_path_factory.getbasetemp() / "random.dat"
    fclib.write_siconos(path, problem)
    again = fclib.read_siconos(path, problem.kind)
    assert_equal(problem, again)
    for name in MATRICES:
        a = getattr(problem, name, None)
        if a is not None and storage_of(a) != "csr":
            assert storage_of(getattr(again, name)) == storage_of(a)
    # what it holds is seen without being told, but for texts that fit two kinds
    flag = problem.kind.endswith("rolling") and problem.nc == 1 and problem.mu_r[0] in (0, 1)
    if not (flag and problem.spacedim == 3):
        assert fclib.read_siconos(path).kind == problem.kind


@pytest.mark.parametrize("storage", STORAGES)
def test_with_storage_changes_nothing_else(storage: str) -> None:
    for case in (planted_local(1, p=2, storage="coo"), planted_global(2, p=2)):
        problem = case.problem
        other = problem.with_storage(storage)
        assert_equal(problem, other)
        for name in MATRICES:
            if getattr(other, name, None) is not None:
                assert storage_of(getattr(other, name)) == storage


def test_storages_that_are_none() -> None:
    problem = planted_local(1).problem
    with pytest.raises(fclib.OptionError, match="no storage 'coo'; there are: csr, csc"):
        problem.with_storage("coo")
    m = 3 * 20_000
    large = fclib.LocalProblem(W=sp.csr_array((m, m)), q=np.zeros(m), mu=np.zeros(20_000))
    with pytest.raises(fclib.UnsuitableError, match="W: is 60000 x 60000, too large"):
        large.with_storage("dense")


def test_bilateral_constraints_have_no_place_in_a_text(tmp_path: Path) -> None:
    path = tmp_path / "mixed.dat"
    for case in (planted_local(1, p=2), planted_global(1, p=2)):
        with pytest.raises(fclib.UnsuitableError, match="bilateral constraints"):
            fclib.write_siconos(path, case.problem)
    assert not list(tmp_path.iterdir())


def test_real_problems_go_through_texts(real_data: Path, tmp_path: Path) -> None:
    path = tmp_path / "real.dat"
    count = 0
    for source in sorted(real_data.glob("*/*.hdf5")):
        try:
            problem = fclib.read(source)
        except fclib.FileError:
            continue
        for changed in (problem, problem.with_storage("triplet")):
            fclib.write_siconos(path, changed)
            again = fclib.read_siconos(path)
            assert type(again) is type(problem)
            for name in ("W", "M", "H"):
                if hasattr(problem, name):
                    a, b = sp.csc_array(getattr(problem, name)), sp.csc_array(getattr(again, name))
                    assert a.shape == b.shape
                    assert abs(a - b).sum() == 0, source.name
            for name in VECTORS:
                a, b = getattr(problem, name, None), getattr(again, name, None)
                if a is not None:
                    np.testing.assert_array_equal(a, b, err_msg=source.name)
        count += 1
    assert count > 30


GOOD = "3\n1\n0\n3\n3\n3\t3\n1 0 0\n0 1 0\n0 0 1\n-1 0 0\n0.5\n"
BAD: dict[str, tuple[str, str]] = {
    "nothing": ("", "line 1: the file ends"),
    "letters": ("some text\n", "line 1: 'some' is not an integer"),
    "letters inside": (GOOD.replace("0 1 0", "0 one 0"), "line 8: 'one' is not a number"),
    "cut short": (GOOD[:-5], "line 10: the file ends inside mu"),
    "cut inside a matrix": (GOOD[:24], "line 8: the file ends inside the first matrix"),
    "nan": (GOOD.replace("-1 0 0", "-1 nan 0"), "line 10: 'nan' is not a finite number (q)"),
    "inf": (GOOD.replace("0.5", "inf"), "line 11: 'inf' is not a finite number (mu)"),
    "negative mu": (GOOD.replace("0.5", "-0.5"), "line 11: mu is -0.5"),
    "sizes that disagree": (GOOD.replace("3\t3", "3\t4"), "line 6: the first matrix is 3 x 3, and"),
    "other contacts": (GOOD.replace("3\n1\n", "3\n2\n", 1), "line 5: the first matrix is 3 x 3, b"),
    "huge contacts": (GOOD.replace("3\n1\n", "3\n700000000\n", 1), "line 2: mu has 700000000"),
    "huge matrix": (GOOD.replace("0\n3\n3\n", "0\n3\n2147483647\n", 1), "line 5: the first matrix"),
    "beyond all integers": (GOOD.replace("3\n1\n", f"3\n{10**30}\n", 1), "line 2: the number of"),
    "dimension": (GOOD.replace("3\n1\n", "7\n1\n", 1), "line 1: the dimension is 7"),
    "storage": (
        GOOD.replace("1\n0\n3", "1\n4\n3", 1),
        "line 3: the storage of the first matrix is",
    ),
    "too much": (GOOD + "1 2 3\n", "line 12: '1' follows"),
    "noise": ("".join(map(chr, range(1, 256))) * 20, "line 1: '"),
}


@pytest.fixture
def bad(tmp_path: Path) -> dict[str, Path]:
    folder = tmp_path / "bad"
    folder.mkdir()
    paths = {}
    for case, (text, _) in BAD.items():
        paths[case] = folder / f"{case.replace(' ', '-')}.dat"
        paths[case].write_text(text)
    return paths


@pytest.mark.parametrize("case", BAD)
def test_a_bad_text_is_refused_and_the_line_named(case: str, bad: dict[str, Path]) -> None:
    with pytest.raises(fclib.FileError) as caught:
        fclib.read_siconos(bad[case])
    message = str(caught.value)
    assert message.startswith(f"{bad[case]}: {BAD[case][1]}"), message
    assert message.isprintable()
    assert len(message) < len(str(bad[case])) + 150


def test_files_that_are_no_text(tmp_path: Path) -> None:
    path = tmp_path / "problem.hdf5"
    fclib.write(path, planted_local(1).problem)
    for wrong, reason in (
        (path, "is an HDF5 file"),
        (tmp_path, "is not a regular file"),
        (tmp_path / "missing.dat", "cannot be read: No such file"),
    ):
        with pytest.raises(fclib.FileError) as caught:
            fclib.read_siconos(wrong)
        assert str(caught.value).startswith(f"{wrong}: {reason}")
    text = tmp_path / "good.dat"
    text.write_text(GOOD)
    with pytest.raises(fclib.OptionError, match="no kind 'flat'; there are: "):
        fclib.read_siconos(text, "flat")


# ---- the command


def test_a_chain_from_a_text_to_a_solution(tmp_path: Path) -> None:
    case = planted_global(7, nc=5)
    text, file, local = (tmp_path / name for name in ("a.dat", "a.hdf5", "local.h5"))
    fclib.write_siconos(text, case.problem.with_storage("triplet"))
    record = converted(text, file)
    assert record["formulation"] == record["becomes"] == "G3DFC"
    assert (record["output"], record["format"]) == (str(file), "hdf5")
    assert record["storage"] == "triplet"
    assert record["solution"] is None
    assert fclib.read(file).info.title == "a"
    assert converted(file, local, "--form", "local")["becomes"] == "3DFC"

    helpers_cli.run("solve", "--write", local)
    solution = fclib.read_solution(local)
    assert solution is not None
    assert judge(case.problem, fclib.Solution(r=solution.r)).error <= 1e-7
    back = tmp_path / "back.dat"
    record = converted(local, back)
    assert record["solution"] == "dropped"
    assert record["storage"] == "blocks"
    assert_equal(fclib.read_siconos(back), fclib.read(local))


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("ending", [".hdf5", ".dat"])
def test_every_storage_is_kept_in_every_format(tmp_path: Path, storage: str, ending: str) -> None:
    source, target = tmp_path / "in.hdf5", tmp_path / f"out{ending}"
    case = planted_local(1)
    fclib.write(source, case.problem)
    record = converted("--storage", storage, source, target)
    blocks = storage == "csr" and ending == ".dat"
    assert record["storage"] == ("blocks" if blocks else storage)
    again = fclib.read(target) if ending == ".hdf5" else fclib.read_siconos(target)
    assert isinstance(again, fclib.LocalProblem)
    assert storage_of(again.W) == storage
    assert_equal(again, case.problem)


def test_storages_that_a_format_does_not_have(tmp_path: Path) -> None:
    source = tmp_path / "in.hdf5"
    fclib.write(source, planted_global(1).problem)
    for ending, storage, stored in ((".hdf5", "csc", "triplet"), (".dat", "csr", "csc")):
        target = tmp_path / f"out{ending}"
        result = run("--storage", storage, source, target, code=1)
        start = f"fclib: {source}: FCLIB writes the matrices of a global problem as {stored} in "
        assert result.stderr.startswith(start)
        assert len(result.stderr.splitlines()) == 1
        assert not target.exists()


FORMS = {"": ("GM3DFC", True), "local": ("M3DFC", True), "plain": ("3DFC", False)}


@pytest.mark.parametrize("form", FORMS)
def test_forms_keep_the_solution(tmp_path: Path, form: str) -> None:
    case = planted_global(3, p=2)
    source, target = tmp_path / "in.hdf5", tmp_path / "out.hdf5"
    fclib.write(source, case.problem, case.solution)
    record = converted(source, target, *(["--form", form] if form else []))
    formulation, mixed = FORMS[form]
    assert record["formulation"] == "GM3DFC"
    assert record["becomes"] == formulation
    assert record["solution"] == "kept"
    problem, solution = fclib.read(target), fclib.read_solution(target)
    assert problem.formulation == formulation
    assert solution is not None
    assert (solution.l is not None) == mixed
    np.testing.assert_array_equal(solution.r, case.solution.r)
    assert fclib.merit(problem, solution).error < 1e-12


@pytest.mark.parametrize("form", FORMS)
def test_forms_keep_the_guesses(tmp_path: Path, form: str) -> None:
    case = planted_global(3, p=2)
    guess = case.solution.replace(r=2 * case.solution.r)
    source, target = tmp_path / "in.hdf5", tmp_path / "out.hdf5"
    fclib.write(source, case.problem, guesses=[case.solution, guess])
    record = converted(source, target, *(["--form", form] if form else []))
    assert (record["solution"], record["guesses"]) == (None, "kept")
    problem, guesses = fclib.read(target), fclib.read_guesses(target)
    assert len(guesses) == 2
    assert fclib.merit(problem, guesses[0]).error < 1e-12
    np.testing.assert_array_equal(guesses[1].r, guess.r)
    assert guesses[1].u is not None


def test_what_is_known_of_a_matrix_is_kept_where_it_stays(tmp_path: Path) -> None:
    known = {"M": fclib.MatrixInfo(comment="mass", rank=37), "G": fclib.MatrixInfo(rank=2)}
    source = tmp_path / "in.hdf5"
    fclib.write(source, planted_global(3, p=2).problem.replace(matrix_info=known))
    for arguments, result in (
        ([], "kept"),
        (["--storage", "triplet"], "kept"),
        (["--form", "local"], "dropped"),
        (["--form", "plain"], "dropped"),
    ):
        target = tmp_path / "out.hdf5"
        assert converted("--force", *arguments, source, target)["matrix_info"] == result
        assert fclib.read(target).matrix_info == (known if result == "kept" else {})
    local = {"W": fclib.MatrixInfo(conditioning=10)}
    fclib.write(source, planted_local(3).problem.replace(matrix_info=local))
    for arguments in (["--storage", "dense"], ["--form", "plain"]):
        assert converted("--force", *arguments, source, target)["matrix_info"] == "kept"
        assert fclib.read(target).matrix_info == local
    assert converted(source, tmp_path / "out.dat")["matrix_info"] == "dropped"


def test_only_the_problem_that_they_belong_to_takes_them_along(tmp_path: Path) -> None:
    source, target = tmp_path / "in.hdf5", tmp_path / "out.hdf5"
    local, whole = planted_local(1), planted_global(1)
    fclib.write(source, local.problem)
    fclib.write(source, whole.problem, whole.solution, [whole.solution], mode="add")
    record = converted("--kind", "local", source, target)
    assert (record["solution"], record["guesses"]) == (None, None)
    assert fclib.contents(target) == ["local"]
    record = converted("--force", "--kind", "global", source, target)
    assert (record["solution"], record["guesses"]) == ("kept", "kept")
    assert fclib.contents(target) == ["global", "solution", "guesses"]


def test_the_loss_of_all_that_a_text_cannot_hold_is_said(tmp_path: Path) -> None:
    case = planted_local(1)
    source, target = tmp_path / "in.hdf5", tmp_path / "out.dat"
    known = {"W": fclib.MatrixInfo(rank=18)}
    fclib.write(source, case.problem.replace(matrix_info=known), case.solution, [case.solution])
    result = run(source, target)
    note = (
        f"fclib: {source}: the solution, the guesses and what is known of the matrices are left "
        "out, Siconos' text has no place for them"
    )
    assert result.stderr.splitlines() == [note]
    fclib.write(source, case.problem, guesses=[case.solution])
    note = f"fclib: {source}: the guesses are left out, Siconos' text has no place for them"
    assert run("--force", source, target).stderr.splitlines() == [note]


def test_the_loss_of_a_solution_is_said(tmp_path: Path) -> None:
    case = planted_local(1)
    source = tmp_path / "in.hdf5"
    fclib.write(source, case.problem, case.solution)
    result = run(source, tmp_path / "out.dat")
    note = f"fclib: {source}: the solution is left out, Siconos' text has no place for it"
    assert result.stderr.splitlines() == [note]


def test_mixed_problems_become_texts_without_their_constraints(tmp_path: Path) -> None:
    source, target = tmp_path / "in.hdf5", tmp_path / "out.dat"
    fclib.write(source, planted_global(3, p=2).problem)
    result = run(source, target, code=1)
    assert "bilateral constraints" in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not target.exists()
    assert converted(source, target, "--form", "plain")["becomes"] == "3DFC"


def test_many_files_into_a_folder(tmp_path: Path, bad: dict[str, Path]) -> None:
    texts = []
    for seed in range(3):
        texts.append(tmp_path / f"problem{seed}.dat")
        fclib.write_siconos(texts[-1], planted_local(seed).problem)
    missing = tmp_path / "missing.dat"
    folder = tmp_path / "new" / "folder"
    result = run("--json", "--out", folder, texts[0], *bad.values(), missing, *texts[1:], code=1)
    lines = result.stderr.splitlines()
    assert len(lines) == len(bad) + 1
    for line, path in zip(lines, [*bad.values(), missing], strict=True):
        assert line.startswith(f"fclib: {path}: ")
    found = [json.loads(line) for line in result.stdout.splitlines()]
    good = [record["output"] for record in found if "output" in record]
    assert good == [str(folder / f"problem{seed}.hdf5") for seed in range(3)]
    assert sorted(path.name for path in folder.iterdir()) == [Path(path).name for path in good]
    table = run("--out", folder, "--format", "siconos", *good)
    assert all(text.name.removesuffix(".dat") in table.stdout for text in texts)
    for seed, text in enumerate(texts):
        again = fclib.read_siconos(folder / text.name)
        assert_equal(again, planted_local(seed).problem)


def test_nothing_is_replaced_unasked(tmp_path: Path) -> None:
    source, target = tmp_path / "in.dat", tmp_path / "out.hdf5"
    fclib.write_siconos(source, planted_local(1).problem)
    target.write_text("precious")
    result = run(source, target, code=1)
    assert result.stderr == f"fclib: {target}: is there already; --force replaces it\n"
    assert target.read_text() == "precious"
    converted("--force", source, target)
    assert fclib.read(target).nc == 6
    # a file can be converted in its place
    converted("--force", "--storage", "csc", target, target)
    assert storage_of(fclib.read(target).with_storage("csc").W) == "csc"  # type: ignore[union-attr]


def test_the_content_tells_the_format_and_kind_decides(tmp_path: Path) -> None:
    disguised, out = tmp_path / "problem.dat", tmp_path / "out.bin"
    fclib.write(disguised, planted_local(1).problem)
    assert converted("--format", "siconos", disguised, out)["format"] == "siconos"
    assert_equal(fclib.read_siconos(out), planted_local(1).problem)
    flag = tmp_path / "flag.dat"
    flag.write_text(GOOD + "1\n")
    assert converted(flag, tmp_path / "a.hdf5")["becomes"] == "3DFC"
    rolling = converted("--kind", "local_rolling", flag, tmp_path / "b.hdf5")["becomes"]
    assert rolling == "R2DFC"
    result = run("--kind", "flat", flag, tmp_path / "c.hdf5", code=1)
    assert result.stderr.startswith(f"fclib: {flag}: kind: there is no kind 'flat'")


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["IN"],
        ["IN", "OUT", "MORE"],
        ["IN", "OUT.txt"],
        ["IN", "FOLDER"],
        ["--form", "flat", "IN", "OUT.dat"],
        ["--storage", "sparse", "IN", "OUT.dat"],
        ["--format", "xml", "IN", "OUT.dat"],
        ["--out", "FOLDER", "IN", "IN"],
        ["--unknown", "IN", "OUT.dat"],
    ],
    ids=" ".join,
)
def test_usage_errors_are_2_and_write_nothing(arguments: list[str], tmp_path: Path) -> None:
    names = {"IN": tmp_path / "in.hdf5", "FOLDER": tmp_path / "folder"}
    names["FOLDER"].mkdir()
    fclib.write(names["IN"], planted_local(1).problem)
    before = sorted(tmp_path.rglob("*"))
    result = run(*(names.get(argument, argument) for argument in arguments), code=2)
    assert "Traceback" not in result.stderr
    assert sorted(tmp_path.rglob("*")) == before


def test_an_output_that_cannot_be_written(tmp_path: Path) -> None:
    source = tmp_path / "in.hdf5"
    fclib.write(source, planted_local(1).problem)
    occupied = tmp_path / "file"
    occupied.write_text("")
    for arguments in (
        [source, tmp_path / "missing" / "out.dat"],
        [source, tmp_path / "missing" / "out.hdf5"],
        ["--out", occupied, source],
    ):
        result = run(*arguments, code=1)
        assert len(result.stderr.splitlines()) == 1
        assert "cannot be written" in result.stderr


# ---- with Siconos itself

PEER = """
import contextlib, json, sys
import numpy as np
import scipy.sparse as sp
with contextlib.suppress(ImportError):
    import scipy.sparse.coo, scipy.sparse.csc  # the names its wrapper looks for
import siconos.numerics as sn

jobs = json.load(sys.stdin)
results = []
for job in jobs:
    prefix = {"local": "frictionContact", "global": "globalFrictionContact",
              "local_rolling": "rollingFrictionContact",
              "global_rolling": "globalRollingFrictionContact"}[job["kind"]]
    problem = getattr(sn, prefix + "_new_from_filename")(job["path"])
    ending = "_printInFileName" if job["kind"] == "global" else "_printInFilename"
    status = getattr(sn, prefix + ending)(problem, job["path"] + ".back")
    assert status == 0
    result = {"d": problem.dimension, "nc": problem.numberOfContacts, "mu": list(problem.mu)}
    m = problem.dimension * problem.numberOfContacts
    if job["kind"] == "local":
        result["q"] = list(problem.q)
    if job["kind"] == "local" and problem.dimension == 3 and job["r"]:
        options = sn.SolverOptions(sn.SICONOS_FRICTION_3D_NSGS)
        options.dparam[0], options.iparam[0] = 1e-12, 100000
        result["error"] = sn.fc3d_compute_error(
            problem, np.array(job["r"]), np.zeros(m), 1e-12, options, job["norm"])[1]
        r, u = np.zeros(m), np.zeros(m)
        result["status"] = sn.fc3d_driver(problem, r, u, options)
        result["r"] = list(r)
    if job["kind"] == "global" and problem.dimension == 3 and job["r"]:
        options = sn.SolverOptions(sn.SICONOS_GLOBAL_FRICTION_3D_NSGS_WR)
        options.dparam[0], options.iparam[0] = 1e-12, 100000
        r, u, v = np.zeros(m), np.zeros(m), np.zeros(job["n"])
        result["status"] = sn.gfc3d_driver(problem, r, u, v, options)
        result["r"], result["v"] = list(r), list(v)
    results.append(result)
json.dump(results, open(sys.argv[1], "w"))
"""


@pytest.fixture(scope="module")
def siconos() -> str:
    """A Python that has Siconos."""
    for python in filter(None, (shutil.which("python3", path="/usr/bin"), sys.executable)):
        command = [python, "-c", "import scipy.sparse, siconos.numerics"]
        with contextlib.suppress(OSError):
            if subprocess.run(command, capture_output=True).returncode == 0:
                return python
    pytest.skip("Siconos, or the SciPy that it takes matrices of, is not installed")


def ask(siconos: str, folder: Path, jobs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    answers = folder / "answers.json"
    ran(siconos, "-c", PEER, answers, input=json.dumps(jobs), cwd=folder)
    found = json.loads(answers.read_text())
    assert isinstance(found, list)
    return found


def close(a: Any, b: Any) -> bool:
    """Equal to the six digits with which Siconos prints sparse entries."""
    return bool(np.all(np.abs(dense(a) - dense(b)) <= 1e-5 * np.abs(dense(a))))


def test_siconos_reads_what_we_write_and_we_what_it_writes(siconos: str, tmp_path: Path) -> None:
    jobs: list[dict[str, Any]] = []
    given_problems: list[fclib.Problem] = []
    rng = np.random.default_rng(3)
    for name, case in (
        ("l3", planted_local(1, nc=5)),
        ("l2", planted_local(2, d=2)),
        ("skew", planted_local(3, nc=3, skew=0.1)),
        ("g3", planted_global(4, nc=4)),
        ("g2", planted_global(5, d=2)),
    ):
        for storage in STORAGES:
            path = tmp_path / f"{name}.{storage}.dat"
            problem = case.problem.with_storage(storage)
            fclib.write_siconos(path, problem)
            r = case.solution.r + 0.01 * rng.standard_normal(problem.m)
            jobs.append(
                {"path": str(path), "kind": problem.kind, "n": problem.n, "r": list(r), "norm": 100}
            )
            given_problems.append(problem)
    for job, problem, answer in zip(
        jobs, given_problems, ask(siconos, tmp_path, jobs), strict=True
    ):
        assert (answer["d"], answer["nc"]) == (problem.spacedim, problem.nc)
        assert answer["mu"] == list(problem.mu)
        back = fclib.read_siconos(f"{job['path']}.back")
        assert type(back) is type(problem)
        names = ("W",) if isinstance(problem, fclib.LocalProblem) else ("M", "H")
        for name in names:
            assert close(getattr(problem, name), getattr(back, name)), job["path"]
        for name in VECTORS:
            if getattr(problem, name, None) is not None:
                np.testing.assert_array_equal(getattr(problem, name), getattr(back, name))
        if problem.spacedim == 2:
            continue
        assert answer["status"] == 0
        solution = fclib.Solution(r=answer["r"], v=answer.get("v"))
        assert fclib.merit(problem, solution).error < 1e-10, job["path"]
        if isinstance(problem, fclib.LocalProblem):
            assert answer["q"] == list(problem.q)
            # the natural map of the same reactions, which is absolute over the norm it is given
            ours = fclib.merit(problem, fclib.Solution(r=job["r"])).natural
            ours *= float(np.linalg.norm(problem.q)) / 100
            assert answer["error"] == pytest.approx(ours, rel=1e-11)


def test_siconos_reads_real_and_rolling_problems_as_they_are(
    siconos: str, real_data: Path, tmp_path: Path
) -> None:
    jobs: list[dict[str, Any]] = []
    given_problems: list[fclib.Problem] = []
    chosen = ("Capsules-i100-889", "RFC3D_cube_1", "Chute-ndof-768-nc-4-3", "GFC3D_TwoRods1")
    for source in sorted(real_data.glob("*/*.hdf5")):
        if source.stem not in chosen:
            continue
        problem = fclib.read(source)
        path = tmp_path / f"{source.stem}.dat"
        fclib.write_siconos(path, problem)
        # without reactions to judge, it is not solved either
        jobs.append({"path": str(path), "kind": problem.kind, "n": problem.n, "r": []})
        given_problems.append(problem)
    assert {problem.kind for problem in given_problems} == {
        "local",
        "global",
        "local_rolling",
        "global_rolling",
    }
    for job, problem, answer in zip(
        jobs, given_problems, ask(siconos, tmp_path, jobs), strict=True
    ):
        assert answer["mu"] == list(problem.mu)
        back = fclib.read_siconos(f"{job['path']}.back")
        assert type(back) is type(problem)
        for name in ("W", "M", "H"):
            if hasattr(problem, name):
                assert close(getattr(problem, name), getattr(back, name)), job["path"]
        for name in VECTORS:
            if getattr(problem, name, None) is not None:
                np.testing.assert_array_equal(getattr(problem, name), getattr(back, name))


def test_joints_of_many_separate_groups_are_eliminated() -> None:
    """Columns of W' with few rows, with many, and with those that only the joints couple."""
    random = np.random.default_rng(5)
    groups = []
    for size in (1, 1, 2, 30, 1, 1, 2, 1, 1, 1):
        J = random.standard_normal((3 * size + 4, 3 * size + 2))
        whole = J.T @ J
        whole[: 3 * size, : 3 * size] *= np.kron(np.eye(size), np.ones((3, 3)))  # contacts apart
        groups.append((whole, 3 * size))
    W = sp.block_diag([whole[:m, :m] for whole, m in groups], format="csr")
    V = sp.block_diag([whole[:m, m:] for whole, m in groups], format="csr")
    R = sp.block_diag([whole[m:, m:] for whole, m in groups], format="csr")
    problem = fclib.LocalProblem(
        W=W, V=V, R=R, q=random.standard_normal(W.shape[0]), s=random.standard_normal(R.shape[0]),
        mu=np.full(W.shape[0] // 3, 0.5),
    )  # fmt: skip
    left = dense(problem.eliminate().W)
    expected = dense(W) - dense(V) @ np.linalg.solve(dense(R), dense(V).T)
    assert np.abs(left - expected).max() <= 1e-11 * np.abs(expected).max()
    assert ((left != 0) == (expected != 0)).all()


@pytest.mark.parametrize("seed", range(5))
def test_a_contact_that_joints_hold_is_zero_beside_one_that_moves(seed: int) -> None:
    """The joints are not orthogonal, and leave more than the rounding of its terms."""
    random = np.random.default_rng(seed)
    n, p = 12, 6
    G = random.standard_normal((n, p)) @ np.vander(np.linspace(-1, 1, p))
    H = np.hstack([G @ random.standard_normal((p, 3)), random.standard_normal((n, 3))])
    problem = fclib.LocalProblem(
        W=H.T @ H, V=H.T @ G, R=G.T @ G, q=np.full(6, -1.0), s=np.zeros(p), mu=[0.5, 0.5]
    )
    left = dense(problem.eliminate().W)
    assert not left[:3].any()
    assert not left[:, :3].any()
    free = np.eye(n) - G @ np.linalg.pinv(G)
    np.testing.assert_allclose(left[3:, 3:], H[:, 3:].T @ free @ H[:, 3:], rtol=1e-6)
