"""Figures on pages come from stored tables, and each table says what made it."""

from __future__ import annotations

import csv
import json
import re
import sys
from pathlib import Path

import pytest

from helpers import git, script
from workshop.tables import _results

ROOT = Path(__file__).resolve().parents[2]


def script_of(command: str) -> Path:
    """The file of the script that made a table: a module of workshop/, as `called` has it."""
    _, option, name, *_ = command.split()
    assert option == "-m", command
    return ROOT / f"{name.replace('.', '/')}.py"


results = script("scripts/site/results.py")

FOLDER = ROOT / "docs" / "results"
TABLES = sorted(FOLDER.glob("*.csv"))
PAGES = [*sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "workshop").rglob("*.md"))]
READ_FIRST = [ROOT / name for name in ("README.md", "ARCHITECTURE.md", "CHANGELOG.md")]
# pages that are about results: no part of them has a figure of its own
WHOLE = ("choosing.md", "measurement.md", "solvers.md", "speed.md")

# code, links, names of a program or standard with its version, tolerances, dimensions, years, and
# two definitions: what a failure costs, and what an interval covers
NO_FIGURE = re.compile(
    r"""```.*?```|<!--.*?-->|`[^`]*`|\]\([^)]*\)|^\[Table:[^\n]*$|\{\{[^{}]*\}\}|^(?:\ {4}[^\n]*\n)+
    |^\d+\.\ |\b1e-\d+\b|\b[23]D\b|\bRT-\d+\b|\b(?:19|20)\d\d\b
    |\b(?:ten|10)\stimes\sthe\slimit\b|\b95\s%
    |\b(?:libfclib|Siconos|Debian|Python|MuJoCo|GCC|HDF5|Drake|Pinocchio|Newton|C\+\+|Clarabel)\s\d[\d.]*
    |\bHDF5\b
    """,
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)
# numbers that are written as words; smaller ones count things on the page
WORD = (
    r"(?i:(?:thir|four|fif|six|seven|eigh|nine)teen|eleven|twelve|(?:twen|thir|for|fif|six|seven|"
    r"eigh|nine)ty|hundreds?|thousands?|millions?)"
)
SMALL = r"(?i:two|three|four|five|six|seven|eight|nine|ten|half|third|quarter|fifth|tenth)"
NUMBER = rf"(?:\d|\b{WORD}\b|\b{SMALL}\b)"
FIGURE = re.compile(rf"\d|\b{WORD}\b")
# a number of what is measured: a time, a memory, a share, a ratio, how many were solved
MEASURE = re.compile(
    rf"""{NUMBER}(?:\s|\sof\san?\s|-)?(?:%|‰|per\scent\b|(?:nano|micro|milli)?seconds?\b|minutes?\b|hours?\b
    |(?:[nmµu]?s|min|h|[kKMG]i?B|[kMG]?bytes?)\b|times\b|-?fold\b|orders\sof\b)
    |(?:(?<![\d.])\d[\d,]*|\b{WORD})\s(?:problems?|runs|solves|packings)\b
    |(?:\d|\b{WORD}|\b{SMALL})\sof\s(?:the\s|all\s)?(?:\d|{WORD}|{SMALL}|problems|runs|solves|packings)\b
    |\bratio\sof\s\d
    |\b(?:solve[sd]?|loses?|lost|fails?\son)\s(?:only\s)?{NUMBER}(?!-)
    """,
    re.VERBOSE,
)
EITHER = re.compile(f"{FIGURE.pattern}|{MEASURE.pattern}", re.VERBOSE)
# before a block (a paragraph, a list, a table) whose figures are not measured: set by us, or known
SET = re.compile(r"<!-- figures: (?P<why>.*?) -->\n\n?(?P<block>(?:[^\n]+\n)+)", re.DOTALL)


def is_of_results(text: str) -> bool:
    """Whether a part of a page quotes a stored table."""
    return bool(results.TABLE.search(text) or results.ENTRY.search(text))


def typed_figures(text: str, figure: re.Pattern[str] = FIGURE) -> list[str]:
    """The lines of a page on which a figure is typed by hand."""

    def blank(match: re.Match[str]) -> str:
        return "\n" * match[0].count("\n")

    left = NO_FIGURE.sub(blank, SET.sub(blank, text))
    lines = sorted({left.count("\n", 0, match.start()) for match in figure.finditer(left)})
    return [f"{k + 1}: {left.splitlines()[k]}" for k in lines]


def sections(text: str) -> list[str]:
    """The parts of a page, each from its heading on; headings stand in no block of code."""
    return re.split(r"^(?=#{1,6} )", text, flags=re.MULTILINE)


def wrong_on(name: str, text: str) -> list[str]:
    """What is typed on a page: beside a stored table any figure, elsewhere one of a measurement."""
    return [
        f"{name}, {(part.splitlines() or [''])[0]}: line {line}"
        for part in sections(text)
        for line in typed_figures(part, EITHER if name in WHOLE or is_of_results(part) else MEASURE)
    ]


@pytest.mark.parametrize("page", [*PAGES, *READ_FIRST], ids=lambda page: page.name)
def test_no_figure_is_typed(page: Path) -> None:
    wrong = wrong_on(page.name, page.read_text(encoding="utf-8"))
    assert not wrong, "figures belong into docs/results:\n" + "\n".join(wrong)


@pytest.mark.parametrize(
    ("page", "text"),
    [
        ("README.md", "A solve takes some 40 microseconds."),
        ("CHANGELOG.md", "That is 12 % more."),
        ("docs/format.md", "The file has 4.8 MB."),
        ("docs/auto.md", "It is three times as fast."),
        ("docs/speed.md", "| auto | 0.4 s |"),
        ("workshop/tuning/notes.md", "Of these it loses two."),
    ],
)
def test_a_figure_that_is_put_into_a_page_is_found(page: str, text: str) -> None:
    """A figure of each kind, at the end of each part, whether a table is there or not."""
    for part in sections((ROOT / page).read_text(encoding="utf-8")):
        fresh = wrong_on(Path(page).name, f"{part}\n\n{text}\n")
        assert len(fresh) == 1, f"{page}: {text} is not found in\n{part[:200]}"


def test_figures_that_are_set_say_why() -> None:
    reasons = [
        match["why"]
        for page in [*PAGES, *READ_FIRST]
        for match in SET.finditer(page.read_text(encoding="utf-8"))
    ]
    assert reasons
    for reason in reasons:
        assert len(reason) > 10, reason
        for name in re.findall(r"\btests/[\w/]+\.py", reason):
            assert (ROOT / name).is_file(), f"a page names {name}, which is not there"


@pytest.mark.parametrize(
    "text",
    [
        "`auto` solves 29 of 30 there.",
        "takes 0.4 s",
        "| a | 12 |",
        "a ratio of 1.5\n",
        "3 times",
        "beside twelve other solvers",
    ],
)
def test_a_figure_that_is_typed_is_found(text: str) -> None:
    (found,) = typed_figures("A page.\n\n" + text)
    assert found.startswith("3: ")


def test_a_figure_after_code_is_found() -> None:
    page = "## One\n\n[Table: T](results/a.csv)\n\n    code 7\n\ntakes 8\n\n## Two\n\ntakes 9\n"
    assert wrong_on("a.md", page) == ["a.md, ## One: line 7: takes 8"]
    assert len(wrong_on("a.md", page.replace("9", "9 s"))) == 2
    assert len(wrong_on("speed.md", page)) == 2


def test_a_block_that_is_set_ends_with_it() -> None:
    page = "## One\n\n<!-- figures: a limit that the code has -->\n\nat most 5 s\n\ntakes 3 s\n"
    assert wrong_on("a.md", page) == ["a.md, ## One: line 7: takes 3 s"]


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


def test_a_figure_is_found_over_the_end_of_a_line() -> None:
    assert typed_figures("of these 11\nproblems\n", MEASURE) == ["1: of these 11"]
    assert typed_figures("velocity [m/s], 3.1 runs it, H^T M^-1 H, four groups\n", MEASURE) == []


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
        script = script_of(about["command"])
        assert script.is_file(), f"{path.stem}.json names {script}, which is not there"


def test_every_table_names_a_commit_that_is_there() -> None:
    if git("rev-parse", "--is-shallow-repository") != "false":
        pytest.skip("this is no repository with its history")
    for path in TABLES:
        _, about = results.Results(FOLDER).load(path.stem)
        commit = about["commit"].rstrip("+")
        known = git("rev-parse", "--verify", f"{commit}^{{commit}}")
        there = known and git("merge-base", known, "HEAD") == known
        assert there, f"{path.stem}.json: {commit} is not in the history"


def test_a_table_goes_from_a_script_to_a_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_results, "FOLDER", tmp_path / "results")
    script = f"{ROOT}/workshop/tables/x.py"
    monkeypatch.setattr(sys, "argv", [script, "/d/a.hdf5", "/b.hdf5", "--k"])
    rows = [{"solver": "auto", "mean [ms]": 1.23456}, {"solver": "a|b", "mean [ms]": 2}]
    path = _results.store("times", rows, title="Times", note="Limit 5 s.")
    with path.open(newline="") as file:
        assert list(csv.DictReader(file)) == [
            {"solver": "auto", "mean [ms]": "1.235"},
            {"solver": "a|b", "mean [ms]": "2"},
        ]
    about = json.loads(path.with_suffix(".json").read_text())
    assert about["command"] == ".venv/bin/python -m workshop.tables.x FILE... --k"
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


def test_constants_that_are_varied_stand_in_their_sources() -> None:
    """Each once, with the value that the first row of its table has."""
    pytest.importorskip("flint")
    from workshop.tuning import constants

    for one in constants.CONSTANTS:
        text = (ROOT / "core" / one.source).read_text(encoding="utf-8")
        found = re.findall(constants.pattern(one.name), text)
        assert [value for _, value in found] == [one.values[0]], one.name
