"""The module for browsers, run by Node: it computes and says what the native core does."""

from __future__ import annotations

import re
import runpy
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import browser_module
import browser_work
import fclib
import golden_work
from browser_module import BrowserError, Module
from helpers import local_problem, planted_global, planted_local

pytestmark = pytest.mark.skipif(bool(browser_module.missing()), reason=browser_module.missing())
# numbers of types that h5wasm makes no arrays of: refused in a page, and read natively
NOT_IN_PAGES = {"halves", "long doubles"}
FACTORISE = {
    "admm",
    "associated",
    "auto",
    "fp-ds",
    "homotopy",
    "nsip",
    "nsn-ac",
    "nsn-fb",
    "nsn-jm",
    "nsn-nm",
    "ppa-nsn",
}
TINY = sorted(golden_work.TINY.glob("*/*.hdf5"))


@pytest.fixture(scope="module")
def browser() -> Iterator[Module]:
    with Module() as module:
        yield module


def close(actual: Any, expected: Any) -> None:
    np.testing.assert_allclose(actual, expected, rtol=1e-12, atol=1e-12)


# ---- solvers


def test_every_solver_goes_the_same_way(browser: Module) -> None:
    """On every formulation; what differs is in tests/browser_work.csv."""
    found = list(browser_work.pairs(browser))
    wrong = browser_work.unexpected(found)
    assert not wrong, "\n".join(["if this is meant: python tests/browser_work.py --write", *wrong])
    assert {one.pair.key for one in found} == set(golden_work.read())
    # whatever the processor, sums differ in factorisations alone
    assert all(one.bits for one in found if one.pair.solver not in FACTORISE)
    assert len(browser_work.read()) < 0.05 * len(found)


def test_a_difference_is_seen() -> None:
    pair = browser_work.Pair("ball", "nsgs", "converged 10 1e-9", "converged 11 1e-9")
    (known, mark), *_ = [
        (key, row.may_differ) for key, row in golden_work.read().items() if not row.may_differ
    ]
    assert mark == ""
    differing = replace(pair, problem=known[0], solver=known[1])
    assert known not in browser_work.read()
    assert browser_work.unexpected([browser_work.Comparison(differing, False, False)])
    assert not browser_work.unexpected([browser_work.Comparison(differing, True, True)])


def test_solvers_and_options_are_those_of_python(browser: Module) -> None:
    def described(solver: Any) -> dict[str, Any]:
        dimensions = ("dimensions", "rolling_dimensions", "spin_dimensions")
        names = ("name", "family", "title", "citation", *dimensions)
        known = ("name", "type", "default", "unit", "doc", "choices", "lowest", "highest")
        return {name: getattr(solver, name) for name in names} | {
            "max_iterations": solver.max_iterations,
            "options": [{one: getattr(option, one) for one in known} for option in solver.options],
        }

    native = [described(solver) for solver in fclib.solvers() if solver.origin == "fclib"]
    assert browser("solvers") == native


def test_a_solve_is_watched_and_stopped(browser: Module) -> None:
    problem = fclib.read(TINY[0])
    m = problem.m
    found = browser("solve_watched", problem, {"solver": "nsgs"}, 3)
    assert found["result"]["status"] == "interrupted"
    assert len(found["reports"]) == 3
    assert {report["size"] for report in found["reports"]} == {m}
    errors: list[float] = []

    def report(_iteration: int, error: float, _seconds: float, _stage: str) -> bool:
        errors.append(error)
        return len(errors) < 3

    fclib.solve(problem, "nsgs", callback=report)
    close([report["error"] for report in found["reports"]], errors)
    assert browser("solve_throwing", problem) == "of the page"
    hard = golden_work.GENERATED["bodies, at the limit"]()
    limited = browser("solve", hard, {"solver": "nsgs", "tol": 1e-12, "time_limit": 0.05})
    assert limited["status"] == "time_limit"


def test_every_report_of_auto_has_its_reactions(browser: Module) -> None:
    problem = planted_local(3, nc=40).problem
    found = browser("solve_watched", problem, {}, 10**6)
    assert found["result"]["converged"]
    assert found["reports"]
    assert {report["size"] for report in found["reports"]} == {problem.m}


def test_no_solution_is_proven(browser: Module) -> None:
    closing = local_problem(np.kron([[1, -1], [-1, 1]], np.eye(3)), [-1.0, 0, 0] * 2, [0.5, 0.5])
    result = browser("solve", closing, {})
    assert result["status"] == "infeasible"
    certificate = result["certificate"]
    close(certificate["y"], fclib.solve(closing).certificate)
    checked = browser("check_certificate", closing, certificate["y"])
    assert checked["bound"] == np.inf
    assert browser("check_certificate", closing, np.array([1.0, 0.0])) is None


# ---- merits and conversions


@pytest.mark.parametrize("path", TINY, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_merits_are_those_of_python(browser: Module, path: Path) -> None:
    problem = fclib.read(path)
    solution = fclib.solve(problem, tol=1e-4).solution
    native = fclib.merit(problem, solution)
    found = browser("merit", problem, solution)
    for name, value in found.items():
        close(value, getattr(native, name))
    each = browser("contact_merits", problem, solution)
    known = fclib.contact_merits(problem, solution)
    assert each["status"] == list(known["status"])
    for name in ("u", "natural", "cone", "dual_cone"):
        close(each[name], known[name])


def test_condensed_problems_are_those_of_python(browser: Module) -> None:
    problem: Any = planted_global(8, nc=8, p=4).problem
    found = browser("condense", problem)
    native = browser_module.decoded(browser_module.encoded(problem.condense()))
    assert found["kind"] == "local"
    for name in ("q", "mu", "s"):
        close(found[name], native[name])
    for name in ("W", "V", "R"):
        assert found[name]["i"].tolist() == native[name]["i"].tolist()
        close(found[name]["x"], native[name]["x"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"kind": "round"},
            "kind: is 'round', but must be one of: global, global_rolling, global_spin, local",
        ),
        ({"q": None}, "q: is missing"),
        ({"mu": np.array([0.5, -0.25])}, "/fclib_local/vectors/mu[1]: is -0.25, but must not be"),
        ({"spacedim": 3.5}, "spacedim: is not an integer"),
        ({"q": "text"}, "q: is not an array of numbers"),
        ({"W": {"storage": "other"}}, "storage: there is no storage 'other'"),
    ],
)
def test_a_wrong_problem_is_refused(browser: Module, change: dict[str, Any], message: str) -> None:
    problem = browser_module.encoded(planted_local(1, nc=2).problem)
    with pytest.raises(BrowserError, match=re.escape(message)):
        browser("validate", problem | change)


@pytest.mark.parametrize(
    ("settings", "options"),
    [
        ({"solver": "nsgs"}, {"unknown": 1}),
        ({"solver": "nsgs"}, {"relaxation": -3.5}),
        ({"solver": "nsgs"}, {"relaxation": "1e"}),
        ({"solver": "nsgs"}, {"relaxation": 1e300}),
        ({"tol": -0.5}, {}),
        ({"time_limit": -0.5}, {}),
        ({"merit": "other"}, {}),
    ],
)
def test_wrong_settings_have_the_messages_of_python(
    browser: Module, settings: dict[str, Any], options: dict[str, Any]
) -> None:
    problem = planted_local(1, nc=2).problem
    with pytest.raises(fclib.OptionError) as native:
        fclib.solve(problem, **settings, **options)
    with pytest.raises(BrowserError) as found:
        browser("solve", problem, settings | {"options": options})
    assert (found.value.kind, str(found.value)) == ("option", str(native.value))
    with pytest.raises(BrowserError, match="unknown; there is: solver, tol"):
        browser("solve", problem, {"tolerance": 1e-6})


# ---- files


@pytest.mark.parametrize("path", TINY, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_files_are_read_as_natively(browser: Module, path: Path) -> None:
    need_hdf5()
    found = browser("read", path.read_bytes())
    assert plain(found["problem"]) == plain(fclib.read(path))
    solution = fclib.read_solution(path)
    assert (found["solution"] is None) == (solution is None)
    if solution is not None:
        assert plain(found["solution"]) == plain(solution)


def need_hdf5() -> None:
    if not (browser_module.FOLDER / "hdf5_hl.js").is_file():
        pytest.skip("the module reads no HDF5: there was no npm")


def plain(value: Any) -> Any:
    """What compares, the same for what is decoded already: 0 of JavaScript is 0.0 too."""
    return browser_module.encoded(value)


def test_texts_of_siconos_are_read(browser: Module, tmp_path: Path) -> None:
    problem = planted_global(7, nc=5).problem
    path = tmp_path / "problem.dat"
    fclib.write_siconos(path, problem)
    found = browser("read", path.read_bytes())["problem"]
    assert plain(found) == plain(fclib.read_siconos(path).replace(info=fclib.ProblemInfo()))
    with pytest.raises(BrowserError) as error:
        browser("read", b"3 2 0 six")
    path.write_text("3 2 0 six")
    with pytest.raises(fclib.FileError) as native:
        fclib.read_siconos(path)
    assert str(native.value) == f"{path}: {error.value}"


@pytest.fixture(scope="module")
def malformed(root: Path) -> dict[str, Any]:
    return runpy.run_path(str(root / "tests" / "python" / "test_malformed.py"))


def native_words(path: Path) -> str:
    """What the native reader says of a file; empty if it reads it."""
    try:
        fclib.read(path)
    except fclib.Error as error:
        return str(error).removeprefix(f"{path}: ")
    return ""


def difference(browser: Module, path: Path) -> str:
    """How the two readers differ on a file, in their words or in what they read."""
    words = native_words(path)
    try:
        found = browser("read", path.read_bytes())
    except BrowserError as error:
        same = words == str(error)
        return "" if same else f"native   {words or 'read'}\n    browser  {error}"
    if words:
        return f"native   {words}\n    browser  read"
    if plain(found["problem"]) != plain(fclib.read(path)):
        return "the problems differ"
    left_out = fclib.left_out(path)
    if found["left_out"] != left_out:
        return f"native leaves out {left_out}\n    browser {found['left_out']}"
    return ""


def test_spoilt_files_have_the_messages_of_python(
    browser: Module, malformed: dict[str, Any], tmp_path: Path
) -> None:
    need_hdf5()
    h5py = pytest.importorskip("h5py")
    local, whole = planted_local(1, p=2), planted_global(1, p=2)
    path = tmp_path / "spoilt.hdf5"
    wrong = []
    for made, cases in ((local, ("LOCAL", "OPTIONAL")), (whole, ("GLOBAL",))):
        fclib.write(path, made.problem, made.solution)
        good = path.read_bytes()
        for case, (spoil, _) in ((c, s) for name in cases for c, s in malformed[name].items()):
            path.write_bytes(good)
            with h5py.File(path, "a") as file:
                spoil(file)
            if words := difference(browser, path):
                wrong.append(f"{case}\n    {words}")
    assert not wrong, "\n".join(wrong)


def test_odd_files_are_read_or_refused_as_natively(browser: Module, tmp_path: Path) -> None:
    need_hdf5()
    odd_files = pytest.importorskip("odd_files")
    wrong = []
    for odd in odd_files.make(tmp_path):
        words = difference(browser, odd.path)
        if odd.name in NOT_IN_PAGES:
            assert "bytes each, which are not read in a page" in words
        elif words:
            wrong.append(f"{odd.kind}, {odd.name}\n    {words}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("block", [0, 512])
@pytest.mark.parametrize("version", ["v108", "v110"])
def test_what_was_not_written_is_seen_in_every_layout(
    browser: Module, tmp_path: Path, version: str, block: int
) -> None:
    """HDF5 has six ways to keep chunks, by the version of the format and the shape."""
    need_hdf5()
    h5py = pytest.importorskip("h5py")
    good, path = tmp_path / "good.hdf5", tmp_path / "layout.hdf5"
    fclib.write(good, planted_local(1).problem)
    layouts: list[dict[str, Any]] = [
        {},
        {"chunks": (18,)},
        {"chunks": (4,)},
        {"chunks": (1,)},
        {"chunks": (4,), "maxshape": (None,)},
        {"shape": (2, 9), "chunks": (1, 2), "maxshape": (None, None)},
    ]
    packings: list[dict[str, Any]] = [{}, {"compression": "gzip"}]
    cases = [
        (layout | packing, part)
        for layout in layouts
        for packing in packings
        if layout or not packing
        for part in (0, 1, 2)
    ]
    # as many chunks as need pages of an index, or a tree of more levels
    cases += [({"shape": (3000,), "chunks": (1,)}, part) for part in (0, 1, 2)]
    wrong, refused = [], 0
    for layout, part in cases:
        with (
            h5py.File(good) as source,
            h5py.File(path, "w", libver=(version, version), userblock_size=block) as file,
        ):
            source.copy("fclib_local", file)
            name = f"fclib_local/{'W/x' if layout.get('shape') == (3000,) else 'vectors/q'}"
            del file[name]
            data = file.create_dataset(name, **({"shape": (18,), "dtype": "<f8"} | layout))
            if part == 1:
                data[:1] = 1.0
            if part == 2:
                data[...] = 1.0
        refused += "missing" in native_words(path)
        if words := difference(browser, path):
            wrong.append(f"{layout}, {part} of 2 written\n    {words}")
    assert not wrong, "\n".join(wrong)
    assert refused > len(cases) / 3


@pytest.mark.parametrize("storage", ["csc", "csr", "coo", "dense"])
@pytest.mark.parametrize("name", ["W", "R", "M"])
def test_a_triangle_is_read_as_natively(
    browser: Module, root: Path, tmp_path: Path, name: str, storage: str
) -> None:
    need_hdf5()
    pack = runpy.run_path(str(root / "tests" / "python" / "test_words.py"))["pack"]
    problem: Any = (planted_global if name == "M" else planted_local)(3, nc=3, p=2).problem
    whole = getattr(problem, name)
    for file in ("whole.hdf5", "packed.hdf5"):
        fclib.write(tmp_path / file, problem.replace(**{name: (whole + whole.T) / 2}))
    pack(tmp_path / "packed.hdf5", name, storage)
    assert difference(browser, tmp_path / "packed.hdf5") == ""


def test_texts_are_utf_8(browser: Module, tmp_path: Path) -> None:
    """Whatever the file says that they are."""
    need_hdf5()
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "text.hdf5"
    fclib.write(
        path, planted_local(1).problem.replace(info=fclib.ProblemInfo(title="Coulomb – été"))
    )
    assert difference(browser, path) == ""
    with h5py.File(path, "r+") as file:
        del file["fclib_local/info/title"]
        file["fclib_local/info/title"] = "of any length – été"
    assert difference(browser, path) == ""


def test_solutions_that_were_not_written_are_absent(browser: Module, tmp_path: Path) -> None:
    need_hdf5()
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "solved.hdf5"
    made = planted_local(1, nc=2)
    fclib.write(path, made.problem, made.solution)
    for name, left_out in (("u", []), ("r", ["/solution/r: was declared and never written"])):
        with h5py.File(path, "r+") as file:
            del file[f"solution/{name}"]
            file.create_dataset(f"solution/{name}", shape=(6,), dtype="<f8")
        found = browser("read", path.read_bytes())
        assert found["left_out"] == left_out == fclib.left_out(path)
        native = fclib.read_solution(path)
        assert (found["solution"] is None) == (native is None)
        assert native is None or plain(found["solution"]) == plain(native)


def test_a_pointer_of_git_lfs_is_refused(browser: Module, tmp_path: Path) -> None:
    path = tmp_path / "pointer.hdf5"
    path.write_text(f"version https://git-lfs.github.com/spec/v1\noid sha256:{'0' * 64}\nsize 4\n")
    assert difference(browser, path) == ""


def test_what_is_no_file_is_refused(browser: Module, tmp_path: Path) -> None:
    need_hdf5()
    path = tmp_path / "whole.hdf5"
    fclib.write(path, planted_local(1).problem)
    for content in (path.read_bytes()[:600], b"\x00" * 100):
        path.write_bytes(content)
        with pytest.raises(fclib.FileError) as native:
            fclib.read(path)
        with pytest.raises(BrowserError) as found:
            browser("read", content)
        assert str(native.value) == f"{path}: {found.value}"
