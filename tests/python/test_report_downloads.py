"""What one takes from the report: files, lines that work, citations, lists of problems."""

import hashlib
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import _registry, collections
from fclib.report import build_site, citing
from fclib.report.recipes import recipes
from helpers_cli import invoke
from helpers_report import read_data, skip_without_libraries

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")
skip_without_libraries()
NAME = "standard/Walker"  # of a set that is a list
read: Any = fclib.read


def numbers(folder: Path) -> list[int]:
    found: list[int] = collections.read_catalog(folder)["number"].to_pylist()
    return found


@pytest.fixture(scope="module")
def collection(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two problems of one family, by their names."""
    folder = tmp_path_factory.mktemp("taking") / "collection"
    plan = collections.plan_of(NAME)
    assert plan.chosen is not None
    names = [f"{NAME}/{number:04d}" for number in plan.chosen[:2]]
    invoke("collection", "build", names[0], "--out", folder, "--no-pictures")
    assert numbers(folder) == [plan.chosen[0]]
    # another one comes to it, and the first one stays; a list says the same
    listed = folder.parent / "selection.txt"
    listed.write_text(f"# mine\n{names[1]}\n\n")
    invoke("collection", "build", "--list", listed, "--out", folder, "--no-pictures")
    assert numbers(folder) == list(plan.chosen[:2])
    # what is there is left as it is
    path = folder / NAME / "catalog.parquet"
    before = path.stat().st_mtime_ns
    invoke("collection", "build", names[0], "--out", folder, "--no-pictures")
    assert path.stat().st_mtime_ns == before
    return folder


def test_a_name_that_is_none_is_said(tmp_path: Path) -> None:
    done = invoke("collection", "build", f"{NAME}/9999", "--out", tmp_path, code=2)
    assert "has no problem 9999" in done.output
    invoke("collection", "build", "standard/7", "--out", tmp_path, code=2)
    empty = tmp_path / "empty.txt"
    empty.write_text("# nothing\n")
    done = invoke("collection", "build", "--list", empty, "--out", tmp_path, code=1)
    assert "names nothing" in done.output


def test_files_of_the_site_are_those_of_the_catalogue(collection: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    build_site(None, site, collection, with_files=True)
    records = read_data(site, "files/0")
    assert len(records) == 2
    for row, record in zip(collections.read_catalog(collection).to_pylist(), records, strict=True):
        assert record["digest"] == row["digest"]
        kinds = {one["path"].rpartition("-")[2]: one for one in record["files"]}
        assert set(kinds) == {"global.hdf5", "local.hdf5", "reference.npz", "picture.png"}
        for one in record["files"]:
            content = (site / one["href"]).read_bytes()
            assert hashlib.sha256(content).hexdigest() == one["sha256"]
            assert len(content) == one["bytes"]
        assert kinds["global.hdf5"]["sha256"] == row["global_sha256"]
        with np.load(site / kinds["reference.npz"]["href"]) as arrays:
            stored = fclib.read_solution(collection / row["global_file"])
            assert stored is not None
            np.testing.assert_array_equal(arrays["r"], stored.r)
    # or links to where the folder is served
    build_site(None, site, collection, files_at="https://example.org/data/", views=0)
    (first, *_) = read_data(site, "files/0")[0]["files"]
    assert first["href"] == f"https://example.org/data/{first['path']}"
    assert not (site / "files").exists()


@pytest.mark.parametrize("form", ["global", "local"])
def test_lines_of_the_page_work_as_they_stand(
    form: str, collection: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("h5py")
    from scipy.io import loadmat

    file = sorted(collection.rglob(f"*-{form}.hdf5"))[0]
    problem = read(file)
    shutil.copyfile(file, tmp_path / "problem.hdf5")
    monkeypatch.chdir(tmp_path)
    own = recipes([problem.formulation])[problem.formulation]
    exec(own["h5py"].replace("{path}", "problem.hdf5"), {})
    found = loadmat("problem.mat", simplify_cells=True)
    for name in ("W", "V", "M", "H", "G"):
        matrix = getattr(problem, name, None)
        if matrix is not None:
            own_matrix = matrix.toarray() if hasattr(matrix, "toarray") else np.asarray(matrix)
            np.testing.assert_array_equal(found[name].toarray(), own_matrix)
    np.testing.assert_array_equal(np.ravel(found["mu"]), problem.mu)
    values: dict[str, Any] = {}
    exec(own["python"].replace("{path}", "problem.hdf5"), values)
    assert values["result"].status == "converged"
    for line in own["shell"].splitlines()[:1]:
        words = line.replace("{path}", "problem.hdf5").split()[1:]
        invoke(*words)
    library = next(iter(Path(os.environ.get("FCLIB_BUILD", "none")).rglob("libfclib.so")), None)
    compiler = shutil.which("cc")
    if library is None or compiler is None:
        return
    Path("recipe.c").write_text(own["c"].replace("{path}", "problem.hdf5"))
    include = Path(__file__).parents[2] / "include"
    link = [f"-L{library.parent}", "-lfclib", f"-Wl,-rpath,{library.parent}"]
    subprocess.run([compiler, "recipe.c", f"-I{include}", *link, "-o", "recipe"], check=True)
    assert subprocess.run(["./recipe"], check=False).returncode == 0


def test_the_line_that_builds_names_one_problem() -> None:
    assert recipes(["G3DFC"])["G3DFC"]["build"].startswith("fclib collection build {id} --out")


def test_every_solver_has_its_papers() -> None:
    known = citing.references()
    shipped = {"fclib", "siconos", "clarabel", "scs", "pinocchio"}
    for solver in _registry.solvers():
        if solver.origin not in shipped:
            continue  # of another test in this process
        keys = citing.keys_of(solver.citation)
        assert set(keys) <= set(known), solver.name
        assert keys or "this project" in solver.citation, solver.name
    for key, entry in known.items():
        assert entry.startswith("@"), key
        assert entry.count("{") == entry.count("}"), key
        assert re.search(r"\byear = \{(\d{4})\}", entry), key
    text = citing.implementation("nsgs", "Gauss-Seidel", "fclib 1")
    assert text.count("{") == text.count("}")
    assert citing.family({"set": "a", "name": "B"}).count("{") == citing.family(
        {"set": "a", "name": "B"}
    ).count("}")


def test_citations_agree() -> None:
    """CITATION.cff, docs/citing.md and the pages name the same report, book and software."""
    root = Path(__file__).parents[2]
    cff = (root / "CITATION.cff").read_text(encoding="utf-8")
    page = (root / "docs" / "citing.md").read_text(encoding="utf-8")
    assert f"version: {fclib.__version__}" in cff
    assert f"version = {{{fclib.__version__}}}" in citing.software()
    title = re.search(r'^title: "(.*)"', cff, re.MULTILINE)
    assert title is not None
    plain = re.sub(r"[{}]", "", citing.software())
    assert title[1] in plain
    assert citing.REPORT.partition(",\n  institution")[0].split("title")[1].replace(
        " ", ""
    ) in page.replace(" ", "")
    for number in ("RT-0444", "2014"):
        assert number in cff
        assert number in citing.REPORT
    doi = re.search(r"doi = \{(.*)\}", citing.references()["acary2018"])
    assert doi is not None
    assert doi[1] in cff
    assert doi[1] in page
