"""One figure for a paper: its size, its strokes, its caption, and what it cites."""

from __future__ import annotations

import dataclasses
import itertools
import re
from pathlib import Path

import pytest

import helpers_cli
from fclib.bench import plots, profiles
from fclib.report import write_figure
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
    assert done.returncode == 0, done.stderr
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
    done = helpers_cli.run("profile", store, *options)
    assert done.returncode != 0
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.glob("a.*"))
