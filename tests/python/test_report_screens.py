"""What the first screen of each page of the site has, at two sizes; on paper; and in its words."""

from __future__ import annotations

import io
import itertools
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib.bench import Job, Limits, Record, SolverChoice, Store
from fclib.bench.profiles import caption as caption_of
from fclib.collections.figures import bins_of, is_whole
from fclib.report import Campaigns, build_site
from helpers_browser import DESK, PHONE, UNFOLD, Opener, check_accessible, colours, press_all, turn
from helpers_report import COPY, ORIGINAL, made_facts, read_data, skip_without_libraries

# what they give is of one kind here
read: Any = fclib.read
read_solution: Any = fclib.read_solution
pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")
skip_without_libraries()
pytestmark = pytest.mark.slow

SIZES = {"desk": DESK, "phone": PHONE}
PROBLEM = "#/problem/small/BoxesStack/0008"
# of each kind of page what stands on its first screen, whole: on both sizes, and on a desk alone
WHOLE: dict[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "overview": ("#/overview", ("h1", ".answer"), (".first .plot",)),
    "profiles": ("#/profiles", ("h1", ".choices"), ("figure .plot >> nth=0",)),
    "catalogue": (
        "#/catalogue",
        ("h1", "input[type=search]", "tbody tr >> nth=7"),
        (".filters fieldset >> nth=0",),
    ),
    "families": ("#/families", ("h1", ".cards img >> nth=0"), (".cards article >> nth=0",)),
    "family": ("#/family/small/BoxesStack", ("h1", ".first img"), (".first dl.facts",)),
    "problem": (PROBLEM, ("h1", ".scene .plot", "dl.chief"), (".scene .legend",)),
    "copy": (f"#/problem/{COPY}", ("h1", ".copied a", ".scene .plot", "dl.chief"), ()),
    "problem without a picture to turn": (
        "#/problem/small/BoxesStack/0000",
        ("h1", ".still img", "dl.chief"),
        (),
    ),
    "problem without a picture": ("#/problem/Alone/alone", ("h1", "dl.chief"), ()),
    "solvers": ("#/solvers", ("h1", "tbody tr >> nth=3"), ()),
    "solver": ("#/solver/auto", ("h1", "dl.facts", "table >> nth=0"), ()),
    "classes": ("#/classes", ("h1", "tbody tr >> nth=0"), ()),
    "about": ("#/about", ("h1", ".copy"), ()),
}

# what is used on another page of problems too
ALIKE = ("copy", "problem without a picture")


@pytest.fixture(scope="module")
def screens() -> Path:
    """The folder of the pictures of pages, to be looked at."""
    folder: Path = Path(__file__).parents[2] / "build" / "screens"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture(scope="module")
def problem_pages(browser: Any, site: Path) -> Iterator[dict[str, Any]]:
    """The page of a problem at each size, for several tests: to draw its scene takes seconds."""
    opener = Opener(browser, site)
    yield {size: opener(PROBLEM, viewport=viewport) for size, viewport in SIZES.items()}
    opener.close()


def check_words(page: Any, address: str) -> None:
    """No page says a word of the program, or many of one thing."""
    page.wait_for_timeout(300)  # what is loaded after the head
    text = page.locator("body").text_content()
    for wrong in ("undefined", "NaN", "null", "[object", "Infinity"):
        assert wrong not in text, (address, wrong)
    found = re.search(r"(?<![\d.,])1 (\w+ )?(problems|families|solvers|runs|instances)\b", text)
    assert found is None, (address, found)


# ---- the first screen


@pytest.mark.parametrize("name", WHOLE)
def test_a_page_shows_what_one_came_for_and_can_be_used(
    name: str, go: Opener, screens: Path
) -> None:
    """On a desk, in the light, and on a phone, in the dark: its first screen, and all below."""
    address, both, desk = WHOLE[name]
    page = go(address, viewport=DESK, color_scheme="light")
    check_first_screen(page, (*both, *desk), screens / f"{name.replace(' ', '-')}-desk.png")
    assert page.locator("nav a[aria-current=page]").count() == (name != "about")
    check_words(page, address)
    for picture in page.locator("main img").all():
        picture.scroll_into_view_if_needed()
        page.wait_for_function(
            "i => i.complete && i.naturalWidth > 0", arg=picture.element_handle()
        )
    if name not in ALIKE:
        check_accessible(page)
    page.close()
    page = go(address, viewport=PHONE, color_scheme="dark")
    check_first_screen(page, both, screens / f"{name.replace(' ', '-')}-phone.png")
    if name in ALIKE:
        return
    # what is folded too, as the controls of a figure for a paper
    page.evaluate(UNFOLD)
    folded = page.locator("main details.paper select")
    assert all(one.is_visible() for one in folded.all())
    assert folded.count() >= 2 * (name == "profiles")
    check_accessible(page)
    press_all(page)


def check_first_screen(page: Any, whole: tuple[str, ...], file: Path) -> None:
    """What stands on it, whole; nothing is as wide as to need scrolling."""
    size = page.viewport_size
    for what in whole:
        found = page.locator(f"main {what}").first
        found.wait_for()
        if ".plot" in what:
            found.and_(page.locator("[data-shown]")).wait_for()
        box = found.bounding_box()
        assert box is not None, what
        assert box["width"] > 0, what
        assert box["y"] >= 0, what
        assert box["y"] + box["height"] <= size["height"], (what, box)
    assert page.evaluate("scrollY") == 0
    assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
    shot = page.screenshot(path=file)
    image = pytest.importorskip("PIL.Image")
    seen = np.asarray(image.open(io.BytesIO(shot)).convert("RGB"))
    assert colours(seen) > 30  # no empty page


def test_the_picture_is_beside_its_facts_or_above_them(problem_pages: dict[str, Any]) -> None:
    for size, page in problem_pages.items():
        plot = page.locator(".scene .plot").bounding_box()
        known = page.locator("dl.chief").bounding_box()
        assert page.locator("dl.chief dt").count() == 8
        if size == "desk":
            assert plot["x"] + plot["width"] <= known["x"]
            assert plot["width"] > 2 * known["width"]
        else:
            assert plot["y"] + plot["height"] <= known["y"]


def test_the_eight_facts_are_those_of_the_catalogue(
    problem_pages: dict[str, Any], site: Path
) -> None:
    page = problem_pages["desk"]
    names = page.locator("dl.chief dt").all_inner_texts()
    values = page.locator("dl.chief dd").all_inner_texts()
    told = dict(zip(names, values, strict=True))
    row = row_of(site, PROBLEM.removeprefix("#/problem/"))
    assert told["contacts"] == str(row["nc"])
    assert told["degrees of freedom"] == str(row["n"])
    assert told["law"] == "Coulomb friction in space (G3DFC)"
    assert float(told["μ"]) == row["mu_min"] == row["mu_max"]
    assert told["class"] == row["class"]
    assert told["solved by"] == row["solved_of"]
    assert re.fullmatch(rf"\d+ of {3 * row['nc']}", told["rank of W"])
    assert told["existence, uniqueness"]


def column_of(site: Path, key: str) -> list[Any]:
    """A column of numbers of the catalogue of a site."""
    columns = read_data(site, "catalogue")["columns"]
    return list(next(c["values"] for c in columns if c["key"] == key))


def row_of(site: Path, name: str) -> dict[str, Any]:
    """A row of the catalogue of a site."""
    columns = read_data(site, "catalogue")["columns"]
    ids = next(c["values"] for c in columns if c["key"] == "id")
    found = {}
    for c in columns:
        value = c["values"][ids.index(name)]
        found[c["key"]] = (c["words"][value] if value >= 0 else None) if "words" in c else value
    return found


def extent(page: Any) -> tuple[float, float]:
    """How much of a picture in space its coloured bodies span, across and up."""
    image = pytest.importorskip("PIL.Image")
    plot = page.locator(".scene .plot")
    plot.and_(page.locator("[data-drawn]")).wait_for()
    page.wait_for_timeout(500)  # WebGL draws with the next picture of the screen
    seen = np.asarray(image.open(io.BytesIO(plot.screenshot())).convert("RGB")).astype(int)
    rows, columns = np.nonzero(np.ptp(seen, axis=2) > 25)
    return np.ptp(columns) / seen.shape[1], np.ptp(rows) / seen.shape[0]


@pytest.mark.parametrize("size", SIZES)
def test_the_scene_fills_the_picture_and_is_opaque(
    size: str, problem_pages: dict[str, Any]
) -> None:
    page = problem_pages[size]
    across, up = extent(page)
    assert 0.8 < max(across, up) <= 0.99
    opacities = page.locator(".scene .plot").evaluate(
        "plot => plot.data.filter((t) => t.type === 'mesh3d' && t.facecolor).map((t) => t.opacity)"
    )
    assert opacities == [1]
    page.get_by_role("checkbox", name="see-through").check()
    page.wait_for_function("document.querySelector('.scene .plot').data[0].opacity < 1")


def test_what_is_not_asked_for_first_is_folded(problem_pages: dict[str, Any]) -> None:
    page = problem_pages["desk"]
    heads = page.locator("details.folded > summary").all_inner_texts()
    assert {"All facts", "Patterns of the matrices", "Read it and solve it"} <= set(heads)
    assert page.locator("details.folded[open]").count() == 0
    assert not page.locator("code.sum", has_text=re.compile(r"^[0-9a-f]{64}$")).first.is_hidden()
    page.get_by_text("All facts").click()
    assert page.locator("details.folded[open] dt", has_text="contacts").first.is_visible()


# ---- the catalogue


def test_filters_are_beside_the_table_and_closed_on_a_phone(go: Opener, site: Path) -> None:
    page = go("#/catalogue?runs=1", viewport=DESK)
    table, filters = (page.locator(f"main {one}") for one in (".dt-container", ".filters"))
    assert filters.get_attribute("open") is not None
    beside = filters.bounding_box()
    assert beside["x"] + beside["width"] <= table.bounding_box()["x"]
    page = go("#/catalogue?runs=1", viewport=PHONE)
    assert filters_closed(page)
    assert "1 chosen" in page.locator(".filters summary").inner_text()
    names = page.locator("main tbody th").all_inner_texts()
    assert len(names) == sum(bool(x) for x in column_of(site, "runs"))


def filters_closed(page: Any) -> bool:
    return bool(page.locator(".filters").get_attribute("open") is None)


# ---- the overview


def test_the_profile_is_of_the_chosen_problems(go: Opener, site: Path) -> None:
    from playwright.sync_api import expect  # with which `go` has opened the pages

    page = go("#/overview", viewport=DESK)
    plot = page.locator(".first .plot")
    plot.hover()
    plot.and_(page.locator("[data-drawn]")).wait_for()
    names = "plot => plot.data.filter((t) => t.name && t.showlegend !== false).map((t) => t.name)"
    head = read_data(site, "site")["headlines"][-1]
    ordered = [head["legend"][k] for k in head["order"]]
    assert plot.evaluate(names) == ordered
    # one denominator in the legend
    assert {name.rpartition(" of ")[2] for name in ordered} == {str(head["instances"])}
    page.get_by_label("contacts").select_option("0-10")
    page.wait_for_function("/^1 instance /.test(document.querySelector('figcaption').textContent)")
    plot = page.locator(".first .plot")
    plot.dispatch_event("pointerenter")
    plot.and_(page.locator("[data-drawn]")).wait_for()
    assert all(name.endswith(" of 1") for name in plot.evaluate(names))
    page.locator("label", has_text="tolerance").locator("select").select_option("0")
    page.wait_for_function("location.hash.includes('tol=0')")
    # the table below is of the same tolerance
    tables = read_data(site, "site")["headlines"][0]["tables"][""]
    table = page.locator("table", has_text="CPU times of the solvers")
    last = table.locator("tbody tr").last.locator("th, td")
    # the page may draw the table again meanwhile
    expect(last.first).to_have_text(tables[-1]["solver"], timeout=30_000)


def test_the_overview_lists_no_families(go: Opener, site: Path) -> None:
    page = go("#/overview", viewport=PHONE)
    assert page.locator("main .cards").count() == 0
    for name in ("All problems", "all families", "all solvers", "what is open"):
        assert page.get_by_role("link", name=name, exact=True).is_visible()


# ---- a figure for a paper

HEAR = """new MutationObserver((seen) => seen.forEach((one) => one.addedNodes.forEach((node) => {
  if (node.srcdoc) window.sheet = node.srcdoc;
}))).observe(document.body, { childList: true })"""


def test_a_figure_for_a_paper_is_of_what_is_chosen(
    go: Opener, site: Path, collection: Path, tmp_path: Path
) -> None:
    page = go("#/profiles?tol=1&solvers=auto~nsgs", viewport=DESK)
    page.locator("main .plot[data-shown]").first.wait_for()
    page.get_by_text("A figure for a paper").click()
    page.get_by_label("width").select_option("2")
    texts = {}
    for kind in ("SVG", "PGF"):
        with page.expect_download() as saved:
            page.get_by_role("button", name=f"The figure as {kind}").click()
        texts[kind] = Path(saved.value.path()).read_text()
    caption = page.locator(".paper code").first.inner_text()
    page.evaluate(HEAR)
    page.get_by_role("button", name="The figure as PDF").click()
    page.set_content(page.wait_for_function("window.sheet").json_value())
    pdf = page.pdf(prefer_css_page_size=True)
    # two columns are 174 mm; the printed page is the figure
    assert re.search(r'<svg [^>]*width="493.23pt"', texts["SVG"])
    box = re.search(rb"/MediaBox \[0 0 ([\d.]+) [\d.]+\]", pdf)
    assert box is not None
    assert float(box[1]) == pytest.approx(493.23, abs=1)
    assert pdf.count(b"/MediaBox") == 1
    # auto is drawn through, nsgs is dashed, with other marks
    for text, dashed in ((texts["SVG"], 'stroke-dasharray="6 2"'), (texts["PGF"], "{6bp}{2bp}")):
        assert dashed in text
        assert text.count("polygon") + text.count("pathclose") > 10
        assert "auto" in text
    # it says what the command says
    with Campaigns([site.parent / "runs.sqlite"]) as campaigns:
        costs = campaigns.every.at(1e-8).shared(["auto", "nsgs"])
        told = caption_of(costs, campaigns.at(1e-8), "families")
    for word in ("instances of", "each family", "limit", "runs failed", "Abacus"):
        (part,) = (one for one in told.split("; ") if word in one)
        assert part in caption
    assert r"auto~\cite{fclib-solver-auto}, nsgs~\cite{fclib-solver-nsgs}, set rt444" in caption
    assert r"\begin{figure*}" in caption
    assert r"\input{performance-cpu_s-1e-8.pgf}" in caption


# ---- copies


def test_all_pages_count_the_same_problems(go: Opener, site: Path) -> None:
    """A copy is no problem of its own, on any page, also if the list is narrowed."""
    rows = read_data(site, "catalogue")["size"]
    known = read_data(site, "site")
    assert known["copies"] >= 1
    assert known["problems"] + known["copies"] == rows
    copies = f"{known['copies']} {'copy' if known['copies'] == 1 else 'copies'}"
    page = go("#/about", viewport=DESK)
    for address in ("#/overview", "#/families"):
        turn(page, address)
        assert f"{known['problems']} problems and {copies}" in page.inner_text("main")
    turn(page, "#/catalogue")
    said = page.locator("main input[type=search] >> xpath=../.. >> [role=status]")
    whole = f"{{}} of {known['problems']} problems and {{}} of {copies}"
    assert said.inner_text() == whole.format(known["problems"], known["copies"])
    (family,) = (one for one in known["families"] if one["copies"])
    assert sum(family["histograms"][0]["counts"]) == family["problems"]
    others = whole.format(known["problems"] - family["problems"], 0)
    page.get_by_label("filter").fill(f"family != {family['name']}")
    page.get_by_text(others, exact=True).wait_for()
    page.get_by_label("filter").fill(COPY.rpartition("/")[2])
    page.get_by_text(whole.format(0, 1), exact=True).wait_for()


def test_a_copy_leads_to_its_original_and_shows_its_runs_and_picture(
    go: Opener, site: Path
) -> None:
    copy, original = row_of(site, COPY), row_of(site, ORIGINAL)
    assert copy["same_as"] == ORIGINAL
    for key in ("runs", "solved", "class", "solved_by", "best_solver"):
        assert copy[key] == original[key], key
    page = go(f"#/problem/{COPY}", viewport=DESK)
    table = "main [role=region][aria-label$=runs] tbody"
    shown = page.locator(table).inner_text()
    assert len(shown.splitlines()) >= original["runs"]
    page.locator(".scene .plot[data-drawn]").wait_for()
    page.locator(".copied a").click()
    page.wait_for_function(f"document.querySelector('h1').textContent === '{ORIGINAL}'")
    assert page.locator(table).inner_text() == shown


# ---- classes


def store_of(path: Path, errors: dict[int, dict[str, float]], solvers: tuple[str, ...]) -> Path:
    """Runs of made-up problems: by number and solver the error; without one it is solved.

    If the error is within the tolerance, it came too late. If it is infinite, nothing came.
    """
    limits = Limits(time=10.0, wall=20.0, memory=1000.0)
    machine = {"node": "here", "cpu": "Abacus"}
    with Store(path) as store:
        for k, fact in enumerate(made_facts(len(errors))):
            for label in solvers:
                error = errors[k].get(label)
                status = (
                    "converged"
                    if error is None
                    else "cpu_limit"
                    if error == np.inf
                    else "time_limit"
                    if error <= 1e-8
                    else "stalled"
                )
                choice = SolverChoice("nsgs", {}, f"of {label}", "splitting", "fclib", label)
                record = Record(
                    status=status,
                    cpu_s=0.5,
                    merits={} if error == np.inf else {"error": error or 1e-9},
                    machine=machine,
                )
                store.add(Job(fact, choice, 1e-8, limits, 0, 1), record)
    return path


def test_the_page_of_classes_is_of_the_problems_of_the_report(opening: Any, tmp_path: Path) -> None:
    """No class of another set; what no solver of the report solves is open, with its best error.

    It is also open if nothing came of any solver, and hard if a solution came too late.
    """
    never = {"auto": np.inf, "nsgs": np.inf}
    errors = {0: {"auto": 3e-3, "nsgs": 2e-5}, 1: {"auto": 1e-2}, 2: {}, 3: never, 4: {}}
    errors[4] = {"auto": 1e-9, "nsgs": 1e-2}
    store = store_of(tmp_path / "runs.sqlite", errors, ("auto", "nsgs"))
    with Campaigns([store]) as campaigns:
        build_site(campaigns, tmp_path / "site", views=0)
    (own,) = read_data(tmp_path / "site", "site")["ratings"]
    assert own["set"] == "this report"
    assert own["families"] == [
        {"family": f"Family{k}", "easy": int(k == 2), "hard": int(k in (1, 4))}
        | {"open": int(k in (0, 3))}
        for k in range(5)
    ]
    assert own["open"] == [
        {"problem": "Family0/00000", "error": 2e-5, "by": "nsgs"},
        {"problem": "Family3/00003"},
    ]
    page = opening(tmp_path / "site")("#/about", viewport=DESK)
    for address in ("#/classes", "#/overview"):
        turn(page, address)
        assert "standard" not in page.inner_text("main")
        table = page.locator("table", has_text="2 open problems of this report")
        cells = table.locator("tbody").locator("th, td").all_inner_texts()
        assert cells[:3] == ["Family0/00000", "2e-5", "nsgs"]
        assert cells[3:] == ["Family3/00003", "–", "no solver returned any"]
        if address == "#/classes":
            assert "fclib solve --time-limit" in page.inner_text("main")
        table.locator("tbody a").first.click()
        page.wait_for_selector("main[data-page=problem]")


# ---- words and axes


def test_pages_say_no_more_and_no_less_than_is_known(opening: Any, tmp_path: Path) -> None:
    """Of one problem, one family, one solver and one run; a solver without a description.

    Those of many are read with their first screens.
    """
    small = tmp_path / "small"
    store = store_of(tmp_path / "one.sqlite", {0: {"mine": 1e-3}}, ("mine",))
    with Campaigns([store]) as campaigns:
        build_site(campaigns, small, views=0)
    page = opening(small)("#/about", viewport=DESK)
    for address in (
        *("overview", "profiles", "catalogue", "families", "family/Family0", "solvers"),
        *("problem/Family0/00000", "solver/mine", "classes"),
    ):
        turn(page, f"#/{address}")
        check_words(page, address)
    turn(page, "#/overview")
    shown = page.evaluate(
        "[NaN, undefined, null, 0.125].flatMap((x) => [Fclib.percent(x), Fclib.tolerance(x)])"
    )
    assert shown == ["–"] * 6 + ["12.5 %", "1.25e-1"]
    assert "1 solver, 1 problem, 1 family, 1 run, 0 % of them solved" in page.inner_text("main")


def test_a_problem_of_a_store_alone_says_what_is_not_known(opening: Any, tmp_path: Path) -> None:
    """Of a published run, say: its file and its analysis are elsewhere, and its digest is known."""
    store = store_of(tmp_path / "runs.sqlite", {0: {}, 1: {}}, ("mine",))
    with Store(store) as opened:
        opened.db.execute("UPDATE machines SET node = cpu")
        opened.db.execute("UPDATE problems SET formulation = 'G3DFC' WHERE family = 'Family0'")
        opened.seal()
    with Campaigns([store]) as campaigns:
        build_site(campaigns, tmp_path / "site", views=0)
    # what a store has of a global problem is of M
    entries = [row_of(tmp_path / "site", f"Family{k}/0000{k}")["nnz_W"] for k in range(2)]
    assert entries == [None, made_facts(2)[1].nnz]
    digest = made_facts(1)[0].hash
    page = opening(tmp_path / "site")("#/problem/Family0/00000", viewport=DESK)
    names = page.locator("dl.chief dt").all_inner_texts()
    told = dict(zip(names, page.locator("dl.chief dd").all_inner_texts(), strict=True))
    assert told["μ"] == "not in the stores"
    assert told["rank of W"] == told["existence, uniqueness"] == "not analysed"
    assert page.locator("dl.facts code.sum").inner_text() == digest
    assert f"{{fclib.digest {digest}, FCLIB" in page.locator("#cite + .copy").inner_text()
    facts = page.locator("dl.chief").bounding_box()
    assert facts["x"] < page.locator("h1").bounding_box()["x"] + 5  # no empty place for a picture
    turn(page, "#/overview")
    machine = page.locator("dl.facts dt", has_text="machine").locator("+ dd").inner_text()
    assert machine == "Abacus"


def test_a_problem_without_a_solution_has_no_reference(
    opening: Any, collection: Path, tmp_path: Path
) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    shutil.copytree(collection, tmp_path / "collection")
    (path,) = (tmp_path / "collection").glob("*.parquet")
    table = parquet.read_table(path)
    for name, value in (("has_solution", False), ("status", "stalled")):
        at = table.column_names.index(name)
        values = [value, *table.column(name).to_pylist()[1:]]
        table = table.set_column(at, table.schema.field(name), [values])
    parquet.write_table(table, path)
    build_site(None, tmp_path / "site", tmp_path / "collection", views=0)
    row = row_of(tmp_path / "site", "small/BoxesStack/0000")
    assert (row["has_solution"], row["status"]) == (False, "stalled")
    page = opening(tmp_path / "site")("#/problem/small/BoxesStack/0000", viewport=DESK)
    assert "stalled" in page.locator("main").text_content()
    assert "reference" not in page.locator("main").text_content()


HISTOGRAMS: dict[str, list[float]] = {
    "one": [12],
    "equal": [7, 7, 7],
    "whole": [1, 2, 2, 5, 9],
    "many": list(range(1, 1000, 3)),
    "parts": [0.5, 0.75, 1.25],
    "one part": [0.3],
    "zero": [0.0, 0.0],
}


@pytest.mark.parametrize("name", HISTOGRAMS)
def test_bins_hold_all_values_once(name: str) -> None:
    values = HISTOGRAMS[name]
    edges, counts = bins_of(values)
    assert counts.sum() == len(values)
    assert len(edges) == len(counts) + 1
    assert len(counts) <= 40
    assert len(counts) <= max(values) - min(values) + 1 or not is_whole(values)
    widths = np.diff(edges)
    np.testing.assert_allclose(widths, widths[0])
    if is_whole(values):
        # an edge is between two whole numbers, so that none is on it
        np.testing.assert_array_equal(np.remainder(edges, 1), 0.5)
    if len(set(values)) == 1:
        assert len(counts) == 1
        assert edges.mean() == pytest.approx(values[0])


# many problems, and one alone, which has its contacts only
@pytest.mark.parametrize(("family", "measures"), [("BoxesStack", 3), ("Alone", 1)])
def test_histograms_have_whole_counts_and_follow_the_theme(
    family: str, measures: int, go: Opener, site: Path
) -> None:
    page = go(f"#/family/{family}", viewport=DESK, color_scheme="dark")
    plots = page.locator(".three .plot")
    own = next(f for f in read_data(site, "site")["families"] if f["name"] == family)["histograms"]
    assert plots.count() == len(own) == measures
    colour = page.evaluate("getComputedStyle(document.body).backgroundColor")
    for k, one in enumerate(own):
        plot = plots.nth(k)
        plot.scroll_into_view_if_needed()
        plot.and_(page.locator("[data-drawn]")).wait_for()
        assert plot.evaluate("plot => [...plot.data[0].y]") == one["counts"]
        paper = "plot => getComputedStyle(plot.querySelector('.main-svg')).backgroundColor"
        assert plot.evaluate(paper) == colour
        ticks = plot.locator(".ytick text").all_text_contents()
        assert len(ticks) > 1
        assert all(text.isdigit() for text in ticks), ticks
        assert len(set(ticks)) == len(ticks)
        if one["integer"]:
            assert all(text.isdigit() for text in plot.locator(".xtick text").all_text_contents())


# ---- paper


# curves with long names: as many columns as paper has room for
LONG_NAMES = """() => document.querySelector("main").append(Fclib.lines({
  name: "long", title: "long", xlog: true, xrange: [1, 10], yrange: [0, 1], ypercent: true,
  xname: "x", xlabel: "x", ylabel: "y",
  series: [...Array(8)].map((_, k) =>
    ({ name: `of a long name ${k}`, x: [1, 2], y: [0, 1], style: k })),
}))"""


@pytest.mark.parametrize("address", ["#/overview", PROBLEM, "#/family/small/BoxesStack"])
def test_paper_has_the_charts_and_no_menus(address: str, go: Opener, site: Path) -> None:
    page = go(address, viewport=DESK, color_scheme="dark")
    page.wait_for_function("window.Plotly")
    page.evaluate(LONG_NAMES)
    hidden = page.locator(".plot:not([data-drawn])").count()
    page.emulate_media(media="print", color_scheme="dark")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    # a print waits for nothing: all is drawn when the event is over
    state = page.evaluate(
        """() => [...document.querySelectorAll("main .plot")].filter((p) => p.clientWidth)
          .map((p) => ["shown" in p.dataset, p.clientWidth,
            p.querySelector("svg")?.getBoundingClientRect().width ?? 0])"""
    )
    assert state
    for drawn, wide, svg in state:
        assert drawn, hidden
        assert abs(wide - svg) < 5  # the border
        assert wide < 720  # of A4, within margins
    if address == PROBLEM:
        # it is as wide as the page, also before the browser lays the page out for paper
        assert page.locator(".scene .plot").bounding_box()["width"] > 600
    names = page.locator(".plot[aria-label^='long'] .legendtext")
    boxes = [one.bounding_box() for one in names.all()]
    assert len(boxes) == 8
    for one, other in itertools.pairwise(boxes):
        # in a row, with room for the line before a name; or in the next row
        assert one["x"] + one["width"] + 38 <= other["x"] or one["y"] + 5 < other["y"]
    right = page.locator(".plot[aria-label^='long']").bounding_box()
    assert all(one["x"] + one["width"] < right["x"] + right["width"] for one in boxes)
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    for what in ("header.top", "footer", ".controls", ".tools", "summary", ".copy button"):
        for one in page.locator(what).all():
            assert not one.is_visible(), what
    assert page.locator("main h1").is_visible()
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"
    page.emulate_media(media="screen", color_scheme="dark")
    assert page.pdf(format="A4").startswith(b"%PDF")
