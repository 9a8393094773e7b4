"""Figures on pages come from stored tables, and each table says what made it."""

from __future__ import annotations

import csv
import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


def module(path: str) -> ModuleType:
    """A script, as a module."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


results = module("scripts/site/results.py")
_results = module("benchmarks/_results.py")


FOLDER = ROOT / "docs" / "results"
TABLES = sorted(FOLDER.glob("*.csv"))
PAGES = sorted((ROOT / "docs").glob("*.md"))
# pages that are about results: no part of them has a figure of its own
WHOLE = ("choosing.md", "solvers.md", "speed.md")

# code, links, names of a program or standard with its version, tolerances, dimensions, years
NO_FIGURE = re.compile(
    r"""```.*?```|<!--.*?-->|`[^`]*`|\]\([^)]*\)|^\[Table:[^\n]*$|\{\{[^{}]*\}\}|^(?:\ {4}[^\n]*\n)+
    |^\d+\.\ |\b1e-\d+\b|\b[23]D\b|\bRT-\d+\b|\b(?:19|20)\d\d\b
    |\b(?:libfclib|Siconos|Debian|Python|MuJoCo|GCC|HDF5|Drake|Pinocchio|Newton|C\+\+|Clarabel)\s\d[\d.]*
    """,
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)


def is_of_results(text: str) -> bool:
    """Whether a part of a page quotes a stored table."""
    return bool(results.TABLE.search(text) or results.ENTRY.search(text))


def typed_figures(text: str) -> list[str]:
    """The lines of a page on which a figure is typed by hand."""

    def blank(match: re.Match[str]) -> str:
        return "\n" * match[0].count("\n")

    left = NO_FIGURE.sub(blank, text)
    return [f"{k}: {line}" for k, line in enumerate(left.splitlines(), 1) if re.search(r"\d", line)]


def sections(text: str) -> list[str]:
    """The parts of a page, each from its heading on; headings stand in no block of code."""
    return re.split(r"^(?=#{1,6} )", text, flags=re.MULTILINE)


def test_no_figure_is_typed_beside_a_stored_table() -> None:
    wrong = [
        f"{page.name}, {part.splitlines()[0]}: line {line}"
        for page in PAGES
        for part in sections(page.read_text(encoding="utf-8"))
        if page.name in WHOLE or is_of_results(part)
        for line in typed_figures(part)
    ]
    assert not wrong, "figures belong into docs/results:\n" + "\n".join(wrong)


@pytest.mark.parametrize(
    "text",
    ["`auto` solves 29 of 30 there.", "takes 0.4 s", "| a | 12 |", "a ratio of 1.5\n", "3 times"],
)
def test_a_figure_that_is_typed_is_found(text: str) -> None:
    (found,) = typed_figures("A page.\n\n" + text)
    assert found.startswith("3: ")


def test_a_figure_after_code_is_found() -> None:
    page = "## One\n\n[Table: T](results/a.csv)\n\n    code 7\n\ntakes 8 s\n\n## Two\n\ntakes 9 s\n"
    found = [typed_figures(part) for part in sections(page) if is_of_results(part)]
    assert found == [["7: takes 8 s"]]


@pytest.mark.parametrize(
    "text",
    [
        "to 1e-8 in 3D, with Siconos 4.4 on Debian 12, RT-0444 (2014)",
        "solves {{a: b, c 2}} of `30`",
        '[Table: At 5 s](results/a.csv "where: n = 3")',
        "```sh\nfclib bench --tol 1e-4 -j 2\n```",
        "See [this](bench.md#step-2).",
        "    fclib solve --limit 3\n",
    ],
)
def test_what_is_no_figure_is_left_alone(text: str) -> None:
    assert typed_figures(text) == []


def test_every_table_says_what_made_it_and_is_on_a_page() -> None:
    quoted = {
        name
        for page in PAGES
        for pattern, group in ((results.TABLE, 2), (results.ENTRY, 1))
        for name in (m[group] for m in pattern.finditer(page.read_text(encoding="utf-8")))
    }
    assert quoted == {path.stem for path in TABLES}, "a table without a page, or a page without one"
    for path in TABLES:
        rows, about = results.Results(FOLDER).load(path.stem)
        assert rows, path
        assert all(about[key] for key in results.ABOUT if key != "note"), path
        for script in re.findall(r"(?:benchmarks|scripts|tests)/[\w/]+\.py", about["command"]):
            assert (ROOT / script).is_file(), f"{path.stem}.json names {script}, which is not there"


def test_every_table_names_a_commit_that_is_there() -> None:
    git = ["git", "-C", str(ROOT)]
    shallow = subprocess.run(
        [*git, "rev-parse", "--is-shallow-repository"], capture_output=True, text=True
    ).stdout.strip()
    if shallow != "false":
        pytest.skip("this is no repository with its history")
    for path in TABLES:
        _, about = results.Results(FOLDER).load(path.stem)
        commit = about["commit"].rstrip("+")
        known = subprocess.run([*git, "merge-base", "--is-ancestor", commit, "HEAD"], check=False)
        assert known.returncode == 0, f"{path.stem}.json: {commit} is not in the history"


def test_a_table_goes_from_a_script_to_a_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_results, "FOLDER", tmp_path / "results")
    monkeypatch.setattr(sys, "argv", [f"{ROOT}/benchmarks/x.py", "/d/a.hdf5", "/b.hdf5", "--k"])
    rows = [{"solver": "auto", "mean [ms]": 1.23456}, {"solver": "a|b", "mean [ms]": 2}]
    path = _results.store("times", rows, title="Times", note="Limit 5 s.")
    with path.open(newline="") as file:
        assert list(csv.DictReader(file)) == [
            {"solver": "auto", "mean [ms]": "1.235"},
            {"solver": "a|b", "mean [ms]": "2"},
        ]
    about = json.loads(path.with_suffix(".json").read_text())
    assert about["command"] == ".venv/bin/python benchmarks/x.py FILE... --k"
    assert about["version"]
    assert about["machine"]

    site = results.Results(tmp_path / "results")
    page = site.put_into(
        "It takes {{times: auto, mean [ms]}} ms.\n\n"
        '[Table: T](results/times.csv "columns: solver")\n'
    )
    assert "It takes 1.235 ms." in page
    assert "| auto |\n| a\\|b |" in page
    assert "Limit 5 s." in page
    assert site.put_into("write `{{NAME: ROW, COLUMN}}`") == "write `{{NAME: ROW, COLUMN}}`"
    assert about["command"] in page

    for wrong, word in (
        ("{{times: nsgs, mean [ms]}}", "0 rows 'nsgs'"),
        ("{{times: auto, median}}", "the columns"),
        ("{{other: auto, mean}}", "no such table"),
        ('[Table: T](results/times.csv "columns: x")', "no column x"),
        ('[Table: T](results/times.csv "where: solver = c")', "no row"),
        ('[Table: T](results/times.csv "sorted: x")', "columns or where"),
    ):
        with pytest.raises(ValueError, match=re.escape(word)):
            site.put_into(wrong)


def test_rows_must_have_the_same_columns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_results, "FOLDER", tmp_path)
    with pytest.raises(ValueError, match="row 1 has the columns"):
        _results.store("t", [{"a": 1}, {"b": 2}], title="T")
    with pytest.raises(ValueError, match="has no row"):
        _results.store("t", [], title="T")
    assert not list(tmp_path.iterdir())
