"""The documentation: it builds without a warning, all links lead somewhere, nothing is fetched."""

from __future__ import annotations

import importlib
import json
import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest

import fclib
from fclib.collections import plan
from helpers import ran
from helpers_browser import served

pytest.importorskip("sphinx", reason="the documentation's tools are not installed: make docs")
pytest.importorskip("mujoco")
pytest.importorskip("matplotlib")

pytestmark = pytest.mark.slow

REPORT = "https://example.org/report"
OPTIONS = ["--quick", "--report", REPORT, "--versions", f"0.9.0,{fclib.__version__}"]
PHONE = {"width": 390, "height": 800}


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory, root: Path) -> Path:
    """The site, built; its builder ends with an error where Sphinx warns.

    Without what takes long and other tests do: pictures of the scenes, and runs of the examples.
    """
    # a folder whose name must be escaped in an address
    folder = tmp_path_factory.mktemp("built") / "a site #1"
    other = folder.parent / "0.9.0" / "index.html"  # of an earlier version, beside it
    other.parent.mkdir()
    other.touch()
    done = ran(sys.executable, root / "scripts/site/build.py", folder, *OPTIONS)
    assert "WARNING" not in done.stderr
    return folder


class Page(HTMLParser):
    """What a page refers to, and the places in it that can be referred to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.targets: list[str] = []  # that a person may follow
        self.needs: list[str] = []  # that the browser fetches by itself
        self.alone: list[str] = []  # pictures without a text
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        if "id" in values:
            self.ids.add(values["id"])
        if tag == "a" and "href" in values:
            self.targets.append(values["href"])
        if tag == "link" and values.get("rel") not in ("canonical",):
            self.needs.append(values["href"])
        if "src" in values:
            self.needs.append(values["src"])
        if tag == "img" and not values.get("alt"):
            self.alone.append(values.get("src", ""))


@pytest.fixture(scope="session")
def pages(site: Path) -> dict[Path, Page]:
    found = {path: Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    assert len(found) > 40
    return found


def test_every_link_leads_somewhere(site: Path, pages: dict[Path, Page]) -> None:
    wrong = []
    for path, page in pages.items():
        for address in [*page.targets, *page.needs]:
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.is_file():
                wrong.append(f"{path.relative_to(site)}: {address} does not exist")
                continue
            places = pages[target].ids if target in pages else {parts.fragment}
            if parts.fragment and unquote(parts.fragment) not in places:
                wrong.append(f"{path.relative_to(site)}: {address} has no such place")
    assert not wrong


def test_no_page_needs_another_host(site: Path, pages: dict[Path, Page]) -> None:
    for path, page in pages.items():
        foreign = [a for a in page.needs if urlsplit(a).scheme not in ("", "data") or a[:2] == "//"]
        assert not foreign, path.relative_to(site)
    for style in site.rglob("*.css"):
        assert not re.search(r"url\([\"']?(https?:)?//", style.read_text()), style.name
        assert not re.search(r"@import", style.read_text()), style.name


@pytest.mark.parametrize(
    ("page", "levels"),
    [("architecture", "1"), ("families/index", "1"), ("solvers/splitting", "12"), ("search", "")],
)
def test_the_menu_marks_the_way_to_the_page(site: Path, page: str, levels: str) -> None:
    text = (site / f"{page}.html").read_text()
    menu = text[text.index('<div class="sidebar-tree">') :].partition("</div>")[0]
    marked = re.findall(r'<li class="toctree-l(\d) current([^"]*)"><a class="([^"]*)"', menu)
    assert "".join(level for level, *_ in marked) == levels
    assert menu.count('href="#"') == menu.count("current reference") == bool(levels)
    for k, (_, rest, link) in enumerate(marked):
        last = k == len(marked) - 1
        assert ("current-page" in rest, link.startswith("current")) == (last, last)
    # a part of the menu is open where the page is one of it
    assert menu.count('checked=""') == sum("has-children" in rest for _, rest, _ in marked)


def test_each_page_leads_to_other_versions(site: Path) -> None:
    for page, up in (("bench", ".."), ("families/Arch", "../..")):
        text = (site / f"{page}.html").read_text()
        assert f'<a href="{up}/0.9.0/index.html">0.9.0</a>' in text
        assert f"<b>{fclib.__version__}</b>" in text


def test_every_picture_has_a_text(site: Path, pages: dict[Path, Page]) -> None:
    assert not [(p.relative_to(site), page.alone) for p, page in pages.items() if page.alone]


def test_families_and_solvers_link_to_the_report(pages: dict[Path, Page], site: Path) -> None:
    """As `--report` asks; the report's own tests open such addresses."""
    linked = {
        path.relative_to(site).as_posix(): [
            address.removeprefix(f"{REPORT}/index.html")
            for address in page.targets
            if address.startswith(REPORT)
        ]
        for path, page in pages.items()
    }
    for name in plan.families():
        assert linked[f"families/{name}.html"] == [f"#/family/{name}"]
    assert "#/catalogue" in linked["families/index.html"]
    assert "#/solver/nsgs" in linked["solvers/splitting.html"]


def test_all_that_is_generated_is_there(site: Path, root: Path) -> None:
    for name, family in plan.families().items():
        assert family.title in (site / "families" / f"{name}.html").read_text()
    solvers = "".join(path.read_text() for path in (site / "solvers").glob("*.html"))
    # of a process of its own: other tests register solvers of theirs
    found = ran(sys.executable, "-m", "fclib", "solvers", "--json").stdout
    lines = map(json.loads, found.splitlines())
    entries = [line for line in lines if "absent" not in line]
    assert len(entries) > 20
    for entry in entries:
        name = entry["solver"]
        assert f'id="solver-{re.sub("[^a-zA-Z0-9_]+", "-", name)}"' in solvers, name
        for option in entry["options"]:
            assert f">{option['option']}<" in solvers, (name, option)
    header = (site / "c-api.html").read_text()
    for name in set(re.findall(r"\b(fclib_\w+)\(", (root / "include/fclib.h").read_text())):
        assert f'id="{name.replace("_", "-")}"' in header, name
    for script in (root / "examples/python").glob("*.py"):
        assert (site / "examples" / f"{script.stem}.html").is_file()
    python = (site / "python.html").read_text()
    for name in fclib.__all__:
        assert name.startswith("_") or f'id="{name.lower().replace("_", "-")}"' in python, name


def test_examples_begin_with_their_pictures_in_a_small_size(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(root / "scripts/site")
    examples = importlib.import_module("examples")
    (tmp_path / "drawn.png").write_bytes(b"drawn")

    def run(script: Path, folder: Path) -> tuple[str, list[Path]]:
        return "said", [tmp_path / "drawn.png"] if script.stem == "robot" else []

    monkeypatch.setattr(examples, "run", run)
    pages = dict(examples.pages(root, runs=True))
    assert pages["examples/robot-drawn.png"] == b"drawn"
    assert "said" in pages["examples/robot.md"]
    rows = re.findall(
        r"^\| (.*) \| \[(.*)\]\((\w+)\.md\), `\w+\.py` \|$", pages["examples/index.md"], re.M
    )
    assert len(rows) == len(list((root / "examples/python").glob("*.py")))
    assert rows[0] == (
        "![robot](robot-drawn.png){width=240px}",
        "From a robot in MJCF to a benchmark",
        "robot",
    )
    assert not any(shown for shown, *_ in rows[1:])


# ---- in a browser


def test_pages_in_a_browser(site: Path, browser: Any) -> None:
    wrong: list[str] = []
    page = browser.new_page()
    page.on("console", lambda m: wrong.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on(
        "request", lambda r: None if r.url.startswith(("file:", "data:")) else wrong.append(r.url)
    )
    page.set_viewport_size(PHONE)
    for path in sorted(site.rglob("*.html")):
        page.goto(path.as_uri())
        width = page.evaluate("document.documentElement.scrollWidth")
        if width > PHONE["width"]:
            wrong.append(f"{path.name} is {width} wide on a phone")
    assert not wrong


def figure(page: Any, name: str, values: dict[str, float]) -> str:
    """What a figure says, once its sliders (the starts of their names) are there."""
    said: str = page.locator(f"div[data-figure={name}][data-alive]").evaluate(
        """(place, values) => {
          for (const [label, value] of Object.entries(values)) {
            const input = [...place.querySelectorAll("input")]
              .find((one) => one.ariaLabel.startsWith(label));
            input.value = value;
            input.dispatchEvent(new Event("input"));
          }
          return place.querySelector("[role=status]").textContent;
        }""",
        values,
    )
    return said


def test_figures_of_the_contact_page_are_solved_in_it(site: Path, browser: Any) -> None:
    """What its text says of them: thresholds of sliding, toppling, jamming and of the arch."""
    page = browser.new_page(viewport=PHONE)
    page.set_default_timeout(20_000)
    page.goto((site / "contact-problem.html").as_uri())
    # a folder of files keeps the pictures, and says how to have more
    assert page.locator("img[src*=contact-]").count() == 4
    if not (site / "_static" / "browser").is_dir():
        page.close()
        pytest.skip("the module for browsers is not built: make wasm")
    assert page.get_by_text("python -m http.server").count() == 4
    wrong: list[str] = []
    page.on("console", lambda message: wrong.append(message.text))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    with served(site) as address:
        page.on(
            "request",
            lambda r: None if r.url.startswith((address, "data:")) else wrong.append(r.url),
        )
        page.goto(f"{address}contact-problem.html")
        page.locator("div[data-figure=arch][data-alive]").wait_for()
        assert page.locator("img[src*=contact-]:visible").count() == 0
        assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]

        # a mass of 1 kg at 1 m/s downwards and 1.3 m/s along: friction takes mu m/s from it
        said = figure(page, "single", {"direction": 0})
        assert "slides: r = (1, −0.6, 0) N s, u = (0, 0.7, 0) m/s, û = (0.42, 0.7, 0)" in said
        assert "û · r = 0." in said
        assert "sticks: r = (1, −0.5, 0) N s" in figure(page, "single", {"size of q_T": 0.5})
        assert "is open" in figure(page, "single", {"q_N": 0.2})

        assert "0 slide" in figure(page, "stack", {"push": 0.28})
        assert "2 slide" in figure(page, "stack", {"push": 0.32})
        assert "0 open" in figure(page, "stack", {"μ": 1.3, "push": 1.09})
        assert "1 open" in figure(page, "stack", {"push": 1.13})
        assert "0 slide" in figure(page, "stack", {"μ": 0.3, "push": 0, "slope": 16.5})
        assert "slide" in figure(page, "stack", {"slope": 17}).replace("0 slide", "")
        assert "0 open" in figure(page, "stack", {"μ": 0.6, "slope": 21.5})
        assert "1 open" in figure(page, "stack", {"slope": 22})

        two = figure(page, "wedge", {})
        assert re.search("it leaves at 0.0981 m/s .*error 0.*it stays .*4 stick", two)
        assert figure(page, "wedge", {"μ": 0.46, "squeeze": 100}).count("it leaves") == 2
        assert figure(page, "wedge", {"μ": 0.5}).count("it stays") == 1

        assert "stands" in figure(page, "arch", {"thickness": 0.108})
        assert "falls" in figure(page, "arch", {"thickness": 0.106})
        assert "stands" in figure(page, "arch", {"stones": 7})
        assert "stands" in figure(page, "arch", {"thickness": 0.3, "stones": 15, "μ": 0.32})
        assert "falls" in figure(page, "arch", {"μ": 0.3})
    page.close()
    assert not wrong


FIRST = {
    "restitution": "glossary.html",
    "Delassus matrix": "glossary.html",
    "slurm": "bench.html",
    "hyperplane": "solvers/variational-inequality.html#solver-hyperplane",
}
# Sphinx shows results one after another, and says how many when all are there
FOUND = """/found [1-9]/.test(document.querySelector(".search-summary")?.textContent)"""


def test_the_search_ranks_and_formulas_are_drawn(site: Path, browser: Any) -> None:
    page = browser.new_page()
    page.on("pageerror", lambda error: pytest.fail(str(error)))
    page.goto((site / "mathematics.html").as_uri())
    formula = page.locator("div.math math").first
    assert formula.bounding_box()["width"] > 50
    # the page that defines a word is first, then the page that uses it most
    for words, first in FIRST.items():
        page.goto((site / "search.html").as_uri() + f"?q={words}")
        page.wait_for_function(FOUND)
        assert page.locator("ul.search li a").first.get_attribute("href").startswith(first), words
    page.close()
