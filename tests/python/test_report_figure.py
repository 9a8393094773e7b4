"""One figure for a paper: its size, its strokes, its caption, and what it cites."""

from __future__ import annotations

import dataclasses
import itertools
import re
from pathlib import Path

import pytest

import helpers_cli
from fclib.bench import Store, plots, profiles
from fclib.report import ReportError, citing, figure, write_figure
from helpers_report import add_runs, made_facts

pytest.importorskip("matplotlib")

LABELS = ("auto", "nsgs", "under_score")
SETS = ("tiny", "hard")


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("runs") / "runs.sqlite"
    facts = [
        dataclasses.replace(one, path=f"/there/{SETS[k % 2]}/{one.family}/{k}-local.hdf5")
        for k, one in enumerate(made_facts(6))
    ]
    add_runs(path, facts, LABELS, history=False)
    return path


def cited(text: str) -> set[str]:
    """The keys that a caption cites."""
    return {key for keys in re.findall(r"\\cite\{([^}]*)\}", text) for key in keys.split(",")}


@pytest.mark.parametrize("curve", ["performance", "data", "contact", "accuracy"])
def test_a_figure_has_its_caption_and_all_that_it_cites(
    curve: str, store: Path, tmp_path: Path
) -> None:
    done = helpers_cli.run(
        *("profile", store, "--figure", tmp_path / "sub" / "one.svg", "--curve", curve)
    )
    figure, caption, entries = (
        (tmp_path / "sub" / f"one.{kind}").read_text() for kind in ("svg", "tex", "bib")
    )
    assert all(str(tmp_path / "sub" / f"one.{kind}") in done.stdout for kind in ("svg", "bib"))
    for label in LABELS:
        assert label in figure
        assert label.replace("_", r"\_") in caption
    words = ["instances", "set hard, version", "set tiny, version", "limit 10 s", "fclib of auto"]
    words += ["0.0001, 1e-08"] if curve == "accuracy" else ["tolerance 1e-08"]
    for word in words:
        assert word in caption
    known = set(re.findall(r"^@\w+\{([^,]+),", entries, flags=re.MULTILINE))
    assert cited(caption) == known
    assert {"fclib", "fclib2014", "fclib-set-tiny", "fclib-set-hard"} < known


NAMES = ("box_stack", "50% & more", "a#b{c}", "x^2~y\\z$", "é_ü", "a,b", "a;b", "<n|m>")


@pytest.fixture
def odd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A store whose solvers and sets have such names; two of them are versions of one solver."""
    path = tmp_path / "odd.sqlite"
    monkeypatch.setattr(figure, "SETS", dict.fromkeys(NAMES))
    monkeypatch.setattr(citing, "SETS", {name: ("1", f"of {name}") for name in NAMES})
    facts = [
        dataclasses.replace(one, path=f"/there/{name}/{one.family}/{k}-local.hdf5")
        for k, (one, name) in enumerate(zip(made_facts(len(NAMES)), NAMES, strict=True))
    ]
    add_runs(path, facts, NAMES, history=False)
    with Store(path) as store:
        store.db.execute("UPDATE solvers SET name = label, origin = 'elsewhere'")
        store.db.execute("UPDATE solvers SET name = 'box_stack' WHERE label = 'a,b'")
        store.seal()
    return path


def test_names_are_escaped_in_captions_and_are_valid_keys(odd: Path, tmp_path: Path) -> None:
    write_figure(odd, tmp_path / "my_figure.svg", curve="data", note="100 % of them, #1")
    caption, entries = ((tmp_path / f"my_figure.{kind}").read_text() for kind in ("tex", "bib"))
    shown = re.sub(r"\\(cite|label|includegraphics)\{[^}]*\}", "", caption)
    assert r"100 \% of them, \#1" in shown
    fields = "\n".join(re.findall(r"^  \w+ = \{(.*)\},?$", entries, re.MULTILINE))
    for name in NAMES:
        for text in (shown, entries):
            assert plots.latex_text(name) in text, name
    for text in (shown, fields):
        bare = re.sub(r"\\[&%$#_{}]", "", text)
        assert not re.search(r"[&%$#_^<>|]", bare), bare
        assert bare.replace("~", "").count("{") == bare.count("}")
    keys = re.findall(r"^@\w+\{([^,]+),$", entries, flags=re.MULTILINE)
    assert len(keys) == len(set(keys)) == entries.count("@")
    assert all(re.fullmatch(r"[A-Za-z0-9_-]+", key) for key in keys)
    # each of them has its own entry: solvers, sets, the software and the report
    assert cited(caption) == set(keys)
    assert len(keys) == 2 * len(NAMES) + 2
    assert "fclib-solver-box_stack-2" in keys


def test_a_file_that_tex_cannot_name_is_refused(store: Path, tmp_path: Path) -> None:
    with pytest.raises(ReportError, match=r"50%\.pdf: TeX needs a name of letters"):
        write_figure(store, tmp_path / "50%.pdf")


def test_a_figure_is_of_the_chosen_runs(store: Path, tmp_path: Path) -> None:
    paths = write_figure(store, tmp_path / "a.pdf", sets=["hard"], solvers=["nsgs", "auto"])
    assert [path.name for path in paths] == ["a.pdf", "a.tex", "a.bib"]
    caption = paths[1].read_text()
    assert "3 instances" in caption
    assert "tiny" not in caption + paths[2].read_text()
    assert "under" not in caption
    again = write_figure(store, tmp_path / "b.pdf", sets=["hard"], solvers=["nsgs", "auto"])
    assert paths[0].read_bytes() == again[0].read_bytes()
    with pytest.raises(profiles.ProfileError, match=r"set soft; there is: hard, tiny"):
        write_figure(store, tmp_path / "a.pdf", sets=["soft"])


@pytest.mark.parametrize("columns", plots.WIDTHS)
def test_a_figure_is_as_wide_as_its_columns(columns: int, store: Path, tmp_path: Path) -> None:
    write_figure(store, tmp_path / "a.svg", columns=columns, font="serif")
    text = (tmp_path / "a.svg").read_text()
    width = re.search(r'width="([\d.]+)pt"', text)
    assert width is not None
    assert float(width[1]) == pytest.approx(plots.WIDTHS[columns] / 25.4 * 72)
    assert "serif" in text
    assert rf"\begin{{figure{'*' if columns == 2 else ''}}}" in (tmp_path / "a.tex").read_text()


def test_curves_are_told_apart_without_colours() -> None:
    strokes = [plots.stroke(k) for k in range(20)]
    seen = {(str(one["linestyle"]), one["marker"]) for one in strokes}
    assert len(seen) == len(strokes)
    # no two beside each other in the legend share either
    for one, other in itertools.pairwise(strokes):
        assert one["linestyle"] != other["linestyle"]
        assert one["marker"] != other["marker"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--figure", "a.png"], "a figure ends in .pdf, .svg, .pgf"),
        (["--figure", "a.pgf"], "PGF needs one of lualatex, xelatex, pdflatex"),
        (["--figure", "a.pdf", "--font", "Nonesuch"], "no font 'Nonesuch'"),
        (["--figure", "a.pdf", "--tol", "1e-8", "--curve", "accuracy"], "several tolerances"),
        (["--figure", "a.pdf", "--json"], "leave out --out, --json"),
        (["--out", "a", "--format", "pgf"], "PGF needs one of"),
    ],
)
def test_what_cannot_be_drawn_is_said_in_a_word(
    options: list[str], words: str, store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", "")  # no TeX
    done = helpers_cli.run("profile", store, *options, code=None)
    assert done.returncode != 0
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.glob("a.*"))
