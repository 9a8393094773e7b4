"""Files that are already there, taken into a collection as a set like any other."""

import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib

pytest.importorskip("pyarrow")

from fclib import collections
from fclib.collections import catalog
from fclib.collections.set_index import DATA
from helpers_cli import invoke

# what they give is of one kind here
read: Any = fclib.read
read_solution: Any = fclib.read_solution


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """Two families of one problem each, one without its solution, and what is no problem."""
    folder = tmp_path / "from afar"
    names = sorted((DATA / "tiny").glob("*/*-local.hdf5"))[:2]
    for path in names:
        target = folder / path.parent.name / f"{path.parent.name}.hdf5"
        target.parent.mkdir(parents=True)
        shutil.copyfile(path, target)
    bare = folder / names[0].parent.name / "bare.h5"
    fclib.write(bare, read(names[0]).replace(mu=0.5 * read(names[0]).mu))
    (folder / "torn.hdf5").write_bytes(names[0].read_bytes()[:1000])
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_files_become_a_set(source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before, out = contents(source), tmp_path / "collection"
    result = invoke("collection", "add", source, "--out", out, code=1)
    assert "torn.hdf5" in result.stderr
    assert contents(source) == before
    rows = collections.read_catalog(out).to_pylist()
    assert len(rows) == 3
    assert {row["collection"] for row in rows} == {"from_afar"}
    assert {row["source"] for row in rows} == {
        path.relative_to(source).as_posix() for path in source.glob("*/*")
    }
    for row in rows:
        problem = read(source / row["source"])
        loaded: Any = fclib.load(row["id"], folder=out)
        np.testing.assert_array_equal(loaded.q, problem.q)
        assert row["digest"] == fclib.digest(problem)
        own = read_solution(source / row["source"])
        kept = read_solution(out / row["local_file"])
        assert own is None or np.array_equal(own.r, kept.r)
        assert fclib.merit(problem, kept).error == row["error"] <= 1e-8
        told = fclib.read_attributes(out / row["local_file"], "solution")
        assert (told["error"], told["solver"]) == (row["error"], row["solver"])
    assert [row["solver"] for row in rows].count("the file") == 2
    assert all(verdict.ok for verdict in collections.verify(out))
    # nor does a copy whose solution nobody looked for keep silent
    quick = tmp_path / "quick"
    arguments = ["collection", "add", str(source), "--no-references", "--out", str(quick)]
    invoke(*arguments, code=1)
    paths = list(quick.glob("from_afar/*/*.hdf5"))
    assert sum(read_solution(path) is None for path in paths) == 1
    invoke("check", *paths)
    assert all(verdict.ok for verdict in collections.verify(quick))
    monkeypatch.setenv("FCLIB_COLLECTION", str(out))
    assert len(fclib.collection("from_afar")) == 3
    with pytest.raises(KeyError, match="no set"):
        fclib.collection("from_nowhere")


def test_what_is_no_solution_is_not_taken_in_as_one(tmp_path: Path) -> None:
    """Files that hold reactions of zero as their solution, as real ones do."""
    folder, out = tmp_path / "afar", tmp_path / "collection"
    folder.mkdir()
    problem = read(DATA / "tiny/Wall/0003-local.hdf5")
    zero = fclib.Solution(r=np.zeros(problem.m))
    for name in ("zero", "again"):
        fclib.write(folder / f"{name}.hdf5", problem, zero, [zero])
    fclib.write_attributes(folder / "zero.hdf5", "info", {"numberOfInvolvedDS": 3})
    for rules in (collections.Rules(references=False), collections.Rules()):
        shutil.rmtree(out, ignore_errors=True)
        assert collections.add(folder, out, "mine", rules) == []
        for row in collections.read_catalog(out).to_pylist():
            path = out / row["local_file"]
            kept, guesses = read_solution(path), fclib.read_guesses(path)
            assert row["has_solution"] == rules.references == (kept is not None)
            if rules.references:
                assert fclib.merit(problem, kept).error <= 1e-12
                assert len(guesses) == 1
            else:
                told = fclib.read_attributes(path, "guesses/2")
                assert (told["error"], told["solver"]) == (row["error"], "the file")
                assert len(guesses) == 2
        info = fclib.read_attributes(out / rows_of(out)["zero.hdf5"]["local_file"], "info")
        assert info["numberOfInvolvedDS"] == 3
        assert all(verdict.ok for verdict in collections.verify(out))
    assert rows_of(out)["zero.hdf5"]["same_as"] == "mine/afar/0000"
    done = invoke("collection", "add", folder, "--name", "mine", "--out", out)
    assert "zero.hdf5: the same problem as mine/afar/0000" in " ".join(done.output.split())


def test_files_that_held_what_is_no_solution(real_data: Path, tmp_path: Path) -> None:
    """A wrong reference, one of several solutions, and a problem that has none."""
    names = ("hand-0040-wrong-reference", "manysolutions-0005-no-word", "squeezed-0000-nonsolution")
    folder, out = tmp_path / "cases", tmp_path / "out"
    folder.mkdir()
    for name in names:
        path = real_data.parent / "cases" / f"{name}.hdf5"
        if not path.is_file():
            pytest.skip("the cases are not there")
        shutil.copyfile(path, folder / path.name)
    assert collections.add(folder, out, "cases") == []
    hand, several, squeezed = (rows_of(out)[f"{name}.hdf5"] for name in names)
    assert (hand["solver"] != "the file", hand["has_solution"]) == (True, True)
    assert hand["error"] <= 1e-12
    assert (several["solver"], several["has_solution"]) == ("the file", True)
    assert len(fclib.read_solutions(out / several["global_file"])) == 3
    assert (squeezed["status"], squeezed["has_solution"]) == ("infeasible", False)
    path = out / squeezed["global_file"]
    assert fclib.contents(path) == ["global"]
    assert "there is none" in str(fclib.read_attributes(path, "info")["solution"])
    assert all(verdict.ok for verdict in collections.verify(out))


def rows_of(out: Path) -> dict[str, dict[str, Any]]:
    """The rows of a catalogue by the source of each."""
    return {row["source"]: row for row in collections.read_catalog(out).to_pylist()}


def test_it_goes_on_and_keeps_what_it_has(source: Path, tmp_path: Path) -> None:
    out, rules = tmp_path / "collection", collections.Rules(references=False)
    assert [refusal.path.name for refusal in collections.add(source, out, "mine", rules)] == [
        "torn.hdf5"
    ]
    first = contents(out)
    collections.add(source, out, "mine", rules)
    assert contents(out) == first
    # a copy that is gone comes back; a file that changed is another problem, the old one stays
    row = collections.read_catalog(out).to_pylist()[0]
    (out / row["local_file"]).unlink()
    collections.add(source, out, "mine", rules)
    assert contents(out) == first
    changed = read(source / row["source"])
    fclib.write(source / row["source"], changed.replace(q=2 * changed.q), mode="replace")
    collections.add(source, out, "mine", rules)
    rows = collections.read_catalog(out).to_pylist()
    assert [own["source"] for own in rows].count(row["source"]) == 2
    assert rows[0] == row
    assert catalog.sha256(out / row["local_file"]) == row["local_sha256"]


@pytest.mark.parametrize(
    ("where", "name", "words"),
    [
        ("from afar", "rt444", "published set"),
        ("missing", "mine", "no folder"),
        ("empty", "mine", "holds no file"),
    ],
)
def test_what_cannot_be_added_is_one_line(
    source: Path, tmp_path: Path, where: str, name: str, words: str
) -> None:
    (tmp_path / "empty").mkdir()
    result = invoke(
        "collection", "add", tmp_path / where, "--name", name, "--out", source, code=None
    )
    assert result.exit_code in (1, 2)
    assert words in " ".join(result.stderr.replace("│", " ").split())


def test_a_name_that_no_catalogue_holds_is_left_out(source: Path, tmp_path: Path) -> None:
    found = sorted(source.rglob("*.hdf5"))
    try:
        shutil.copy(found[0], source / os.fsdecode(b"\xff.hdf5"))
    except OSError:
        pytest.skip("the file system has names in UTF-8 alone")
    out = tmp_path / "out"
    result = invoke("collection", "add", source, "--out", out, code=1)
    assert "its name is not UTF-8" in " ".join(result.stderr.split())
    rows = catalog.read_catalog(out).to_pylist()
    assert found[0].relative_to(source).as_posix() in {row["source"] for row in rows}
