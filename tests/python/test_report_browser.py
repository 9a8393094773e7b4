"""The site in a real browser, from the file system: no error, no request, no server."""

import csv
import hashlib
import io
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib.bench import profiles
from fclib.collections import set_index, trajectory
from fclib.report import Campaigns, build_site, view_of, write_view
from helpers import planted_global
from helpers_browser import DESK, PHONE, Opener, check_accessible, colours, press_all, served, turn
from helpers_cli import invoke
from helpers_report import LABELS, make_collection, periodic_step, read_data, skip_without_libraries
from workshop.tables import report_size

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")
skip_without_libraries()
image = pytest.importorskip("matplotlib.image")
# what they give is of one kind here
read: Any = fclib.read
read_solution: Any = fclib.read_solution
pytestmark = pytest.mark.slow

# to draw a scene in space costs by the pixel
SMALL = {"width": 640, "height": 480}


def cells(page: Any, row: int = 0, table: str = "main table:visible >> nth=0") -> list[str]:
    """The texts of a row of a table."""
    found = page.locator(table).locator("tbody tr").nth(row).locator("th, td").all_inner_texts()
    return [str(text).strip() for text in found]


def column(page: Any, number: int, table: str = "main table:visible >> nth=0") -> list[str]:
    """The texts of a column of a table."""
    found = page.locator(table).locator(f"tbody tr > :nth-child({number + 1})").all_inner_texts()
    return [str(text).strip() for text in found]


def head(page: Any, name: str, table: str = "main table:visible >> nth=0") -> Any:
    """What a column is sorted by."""
    heads = page.locator(table).locator("thead th")
    return heads.filter(has=page.get_by_text(name, exact=True)).get_by_role("button")


def draw(page: Any, plot: str = "main .plot >> nth=0", traces: int = 1) -> Any:
    """A picture, when it is drawn with at least so many traces."""
    found = page.locator(plot)
    found.scroll_into_view_if_needed()
    found.and_(page.locator("[data-shown]")).wait_for()
    found.dispatch_event("pointerenter")  # Plotly draws curves that a person turns to
    found.and_(page.locator("[data-drawn]")).wait_for()
    page.wait_for_function(
        "([plot, least]) => plot.data.length >= least", arg=[found.element_handle(), traces]
    )
    return found


def test_addresses_that_lead_nowhere_say_so(go: Opener) -> None:
    page = go("#/nowhere")
    for address in ("#/problem/none/such/0001", "#/solver/none", "#/family/none"):
        assert page.inner_text("main h1") == "Not here"
        page.click("text=To the overview")
        page.wait_for_selector("main[data-page=overview]")
        turn(page, address)
    assert page.inner_text("main h1") == "Not here"
    # a family is found by its name alone
    turn(page, "#/family/BoxesStack")
    page.wait_for_selector("main .first img")


def test_the_solver_table_sorts_filters_and_keeps_its_state(go: Opener) -> None:
    page = go("#/overview")
    shown = "main table:visible >> nth=0"  # the chooser's is closed
    assert cells(page)[0] == "virtual best"
    solved = head(page, "solved")
    solved.click()
    page.locator(shown).locator("th[aria-sort=ascending]").wait_for()
    first = [int(text) for text in column(page, 2)]
    assert first == sorted(first)
    solved.click()
    page.locator(shown).locator("th[aria-sort=descending]").wait_for()
    assert [int(text) for text in column(page, 2)] == sorted(first, reverse=True)
    assert page.locator(shown).locator("th[aria-sort=descending]").inner_text().startswith("solved")
    page.get_by_role("searchbox", name="search").fill("under")
    page.wait_for_function("location.hash.includes('look=under')")
    assert column(page, 0) == ["under_score"]
    # the address alone gives the same view
    again = go(page.evaluate("location.hash"))
    assert column(again, 0) == ["under_score"]
    assert again.locator(shown).locator("th[aria-sort=descending]").count() == 1


# whether so many rows are listed, problems and copies
LISTED = """wanted => [
    ...document.querySelector('[role=status]').textContent.matchAll(/(\\d+) of/g)
].reduce((sum, found) => sum + Number(found[1]), 0) === wanted"""


def listed(text: str) -> tuple[int, int]:
    """How many rows are listed, and of how many: "9 of 11 problems and 1 of 2 copies"."""
    pairs = [(int(a), int(b)) for a, b in re.findall(r"(\d+) of (\d+)", text)]
    return sum(a for a, _ in pairs), sum(b for _, b in pairs)


def test_the_catalogue_filters_sorts_and_keeps_its_state(go: Opener, site: Path) -> None:
    page = go("#/catalogue")
    total = read_data(site, "catalogue")["size"]
    said = page.get_by_role("status")
    assert listed(said.inner_text()) == (total, total)
    page.get_by_label("filter").fill("contacts > 4 family = BoxesStack")
    page.wait_for_function(LISTED, arg=10)
    head(page, "contacts").click()
    page.locator("th[aria-sort=ascending]").wait_for()
    heads = page.locator("thead th").all_inner_texts()
    contacts = next(k for k, text in enumerate(heads) if text.startswith("contacts"))
    counts = [int(text) for text in column(page, contacts)]
    assert counts == sorted(counts)
    assert min(counts) > 4
    again = go(page.evaluate("location.hash"))
    assert listed(again.get_by_role("status").inner_text()) == (10, total)
    assert [int(text) for text in column(again, contacts)] == counts
    again.get_by_label("filter").fill("colour=red")
    again.wait_for_function(
        "document.querySelector('[role=status]').textContent.includes('no column colour')"
    )
    # what was listed before stays, and nothing is listed where that is all there is
    assert len(column(again, 0)) == 10
    empty = go("#/catalogue?q=colour%3Dred")
    assert "Nothing is listed" in empty.get_by_role("status").inner_text()
    again.get_by_label("filter").fill("")
    again.wait_for_function(LISTED, arg=total)
    with again.expect_download() as saved:
        again.get_by_role("button", name="CSV").click()
    rows = list(csv.DictReader(io.StringIO(Path(saved.value.path()).read_text())))
    assert len(rows) == total
    known = {c["key"]: c for c in read_data(site, "catalogue")["columns"]}
    places = {name: k for k, name in enumerate(known["id"]["values"])}
    for row in rows:
        assert int(row["nc"]) == known["nc"]["values"][places[row["id"]]]
        # what is not known is nothing, and no dash
        error = known["error"]["values"][places[row["id"]]]
        assert row["error"] == "" if error is None else float(row["error"]) == error
    again.click("main tbody a >> nth=0")
    again.wait_for_selector("main[data-page=problem]")


def test_profiles_are_those_of_the_bench(go: Opener, store: Path, site: Path) -> None:
    labels = [solver["label"] for solver in read_data(site, "site")["solvers"]]
    chosen = [name for name in labels if name != "rare"]
    rows = [row for row in profiles.load(store, tolerances=[1e-8]) if row["solver"] != "rare"]
    for kind in ("performance", "data", "contact"):
        page = go(f"#/profiles?tol=1&kind={kind}")
        page.wait_for_selector("main figure")
        with page.expect_download() as saved:
            page.locator("main figure").first.get_by_role("button", name="CSV").click()
        table = list(csv.reader(io.StringIO(Path(saved.value.path()).read_text())))
        assert table[0][1:] == chosen
        numbers = np.array([[float(x) for x in line] for line in table[1:]])
        costs = profiles.costs(rows)
        shown = costs.per_contact() if kind == "contact" else costs
        values = profiles.ratios(shown.values) if kind == "performance" else shown.values
        # between the steps, where six digits do not matter
        bounds = numbers[:, 0]
        inside = np.sqrt(bounds[:-1] * bounds[1:])
        wide = bounds[1:] > bounds[:-1] * (1 + 1e-4)
        expected = profiles.share_within(values, inside[wide], shown.weights("families"))
        order = [costs.solvers.index(name) for name in chosen]
        np.testing.assert_allclose(numbers[:-1, 1:][wide].T, expected[order], atol=1e-9)


def test_profiles_follow_what_is_chosen(go: Opener) -> None:
    page = go("#/profiles")
    plot = draw(page)
    assert set(plot.evaluate(TITLES)) == BUTTONS["plane"]
    assert plot.evaluate("plot => plot.data.length") == len(LABELS) - 1
    page.get_by_role("group", name="Solvers").get_by_label("nsgs").uncheck()
    page.wait_for_function("(document.querySelector('.plot').data || []).length === 2")
    page.get_by_label("axis").select_option("linear")
    page.get_by_label(re.compile("^problems")).select_option("Alone")
    page.wait_for_function("/1 instance of [0-9]/.test(document.body.textContent)")
    again = go(page.evaluate("location.hash"))
    again.wait_for_function("/1 instance of [0-9]/.test(document.body.textContent)")
    assert draw(again).evaluate("plot => plot.data.length") == 2
    assert draw(again).evaluate("plot => plot.layout.xaxis.type") == "linear"
    again.get_by_role("button", name="none").click()
    again.wait_for_selector("text=Choose some solvers")


def test_charts_are_read_by_pointer_and_keys_and_saved(go: Opener) -> None:
    page = go("#/profiles")
    plot = draw(page)
    labels = plot.locator(".hoverlayer .legend text")
    heard = page.locator("main figure >> nth=0 >> [role=status]")
    assert not labels.count()
    plot.locator(".draglayer .nsewdrag").hover()
    labels.first.wait_for()
    assert "τ =" in labels.first.text_content()
    page.mouse.move(0, 0)
    plot.focus()
    page.keyboard.press("ArrowRight")
    page.wait_for_function("said => said.textContent", arg=heard.element_handle())
    before = heard.text_content()
    assert "nsgs: " in before
    for _ in range(6):
        page.keyboard.press("ArrowRight")
        page.wait_for_timeout(60)  # Plotly answers to the first of two at once
    page.wait_for_function(
        "([said, before]) => said.textContent !== before", arg=[heard.element_handle(), before]
    )
    page.keyboard.press("Escape")
    page.wait_for_function("!document.querySelector('.hoverlayer .legend')")
    for kind, start in (("SVG", b"<svg"), ("PNG", b"\x89PNG")):
        with page.expect_download() as saved:
            page.locator("main figure").first.get_by_role("button", name=kind).click()
        assert Path(saved.value.path()).read_bytes().startswith(start)
    page.locator("main figure details summary").first.click()
    page.locator("main figure table tbody tr").first.wait_for()
    assert page.locator("main figure table tbody tr").count() > 3


def test_a_point_of_two_solvers_leads_to_its_problem(go: Opener) -> None:
    page = go("#/profiles?a=auto&b=nsgs")
    plot = draw(page, "main .plot >> nth=1")
    point = plot.locator(".scatterlayer .point").first
    point.hover(force=True)
    label = plot.locator(".hoverlayer .hovertext")
    label.wait_for()
    problem = label.locator("tspan").first.text_content()
    point.click(force=True)
    page.wait_for_selector("main[data-page=problem]")
    assert page.inner_text("main h1") == problem


TITLES = "plot => [...plot.querySelectorAll('.modebar-btn')].map(b => b.dataset.title)"
# these buttons and no others
BUTTONS = {
    "plane": {"Zoom", "Pan", "Zoom in", "Zoom out", "Reset axes"},
    "space": {"Orbital rotation", "Pan", "Reset camera to default"},
}


def test_the_network_turns_zooms_and_answers(go: Opener) -> None:
    page = go("#/problem/small/BoxesStack/0010", viewport=SMALL)
    scene = draw(page, ".scene .plot")
    canvas = scene.locator("canvas").first
    assert set(scene.evaluate(TITLES)) == BUTTONS["space"]
    eye = "plot => Object.values(plot.layout.scene.camera.eye)"
    start = scene.evaluate(eye)
    scene.focus()
    for key in ("ArrowLeft", "ArrowUp", "+"):
        page.keyboard.press(key)
    assert all(a != b for a, b in zip(scene.evaluate(eye), start, strict=True))
    page.keyboard.press("0")
    assert scene.evaluate(eye) == start
    box = canvas.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 80, y + 20, steps=4)
    page.mouse.up()
    page.mouse.wheel(0, -200)
    page.wait_for_function(
        "([plot, start]) => Object.values(plot.layout.scene.camera.eye)"
        ".every((x, k) => x !== start[k])",
        arg=[scene.element_handle(), start],
    )
    # how far Plotly turns and zooms depends on the time since the event before
    scene.focus()
    page.keyboard.press("0")
    assert scene.evaluate(eye) == start
    traces = scene.evaluate("plot => plot.data.map(trace => trace.type)")
    assert {"mesh3d", "scatter3d", "cone"} <= set(traces)
    with page.expect_download() as saved:
        page.locator(".scene").get_by_role("button", name="PNG").click()
    picture = image.imread(saved.value.path(), format="png")
    # of many shades, and not an empty one
    assert colours(np.rint(255 * picture[..., :3])) > 100
    for name in ("bodies", "fixed"):
        page.locator(".scene").get_by_role("checkbox", name=name).uncheck()
    page.wait_for_function(
        "plot => !plot.data.some(trace => trace.type === 'mesh3d')", arg=scene.element_handle()
    )
    page.locator(".scene summary").click()
    page.locator(".scene table tbody tr").first.wait_for()
    assert cells(page, 0, ".scene table")[0] == "0"
    assert page.locator(".scene table tbody tr").count() == 12
    # below it are its runs
    runs = page.get_by_role("region", name="runs")
    assert runs.locator("tbody tr").count() == 6
    page.get_by_text("Read it and solve it").click()
    assert 'fclib.load("small/BoxesStack/0010")' in page.inner_text("main")
    assert page.locator("h2", has_text="Convergence").count() == 1
    page.get_by_role("link", name="← previous").click()
    page.wait_for_function("document.querySelector('h1').textContent.endsWith('0009')")


def test_all_can_be_done_by_keys(go: Opener) -> None:
    page = go("#/catalogue")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    seen = set()
    for _ in range(40):
        page.keyboard.press("Tab")
        seen.add(page.evaluate("document.activeElement.tagName"))
    assert {"A", "BUTTON", "INPUT", "SELECT"} <= seen
    head(page, "contacts").focus()
    page.keyboard.press("Enter")
    page.locator("th[aria-sort=ascending]", has_text="contacts").wait_for()


def luminance(colour: str) -> float:
    """Of "rgb(1, 2, 3)", by WCAG."""
    parts = [int(x) / 255 for x in colour[4:-1].split(",")]
    linear = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def test_light_and_dark_can_be_read(go: Opener) -> None:
    backs = {}
    style = "getComputedStyle(document.querySelector('{}')).{}"
    for scheme in ("light", "dark"):
        page = go("#/overview", color_scheme=scheme)
        backs[scheme] = page.evaluate(style.format("body", "backgroundColor"))
        back = luminance(backs[scheme])
        for what in ("body", "main a", "caption", "main .good", "main .bad"):
            text = luminance(page.evaluate(style.format(what, "color")))
            assert (max(text, back) + 0.05) / (min(text, back) + 0.05) >= 4.5, (scheme, what)
    assert luminance(backs["light"]) > luminance(backs["dark"])
    # the button turns it round, the pictures too, and the choice stays
    plot = draw(page)
    paper = "plot => getComputedStyle(plot.querySelector('.main-svg')).backgroundColor"
    assert plot.evaluate(paper) == backs["dark"]
    page.click("#theme")
    page.wait_for_function(
        f"([plot, colour]) => ({paper})(plot) === colour",
        arg=[plot.element_handle(), backs["light"]],
    )
    assert page.evaluate(style.format("body", "backgroundColor")) == backs["light"]
    page.reload()
    page.wait_for_selector("main h1")
    assert page.evaluate(style.format("body", "backgroundColor")) == backs["light"]


def test_a_site_without_runs(
    opening: Any, collection: Path, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    build_site(None, tmp_path / "site", collection, views=1)
    go = opening(tmp_path / "site")
    page = go("#/overview")
    assert page.locator("nav a").all_inner_texts() == [
        *("Overview", "Catalogue", "Families", "Solvers", "Open")
    ]
    for name in (
        "catalogue",
        "family/small/BoxesStack",
        "problem/small/BoxesStack/0000",
        "solvers",
    ):
        turn(page, f"#/{name}")
        assert page.inner_text("main h1") != "Not here"


def test_a_page_of_one_problem(opening: Any, collection: Path, tmp_path: Path) -> None:
    """It begins with its picture and the chief facts, at two sizes."""
    distances = []
    for form, size in (("global", DESK), ("local", PHONE)):
        file = sorted(collection.rglob(f"*-{form}.hdf5"))[-1]
        target = tmp_path / f"{form}.html"
        write_view(view_of(read(file), read_solution(file)), target, title=file.name)
        page = opening(target)("", viewport=size)
        distances.append(distance(page))
        assert page.evaluate("scrollY") == 0
        for what in (".scene .plot", "dl.chief"):
            box = page.locator(what).bounding_box()
            assert box["y"] + box["height"] <= size["height"], what
        assert file.name in page.inner_text("main")
        assert "as the file has them" in page.inner_text("main")
        assert "long and thin" not in page.inner_text(".scene")
        page.click("#theme")
        page.locator(".scene summary").click()
        page.locator(".scene table tbody tr").first.wait_for()
        assert page.locator(".scene table tbody tr").count() == 12
    # a long thin scene begins near its middle
    stored = set_index.plan_of("standard/Chain").trajectory
    assert stored is not None
    write_view(view_of(trajectory.read(stored).problem(0).problem), tmp_path / "chain.html")
    page = opening(tmp_path / "chain.html")("", viewport=SMALL)
    assert distance(page) < 0.5 * min(distances)
    assert "long and thin" in page.inner_text(".scene")


def distance(page: Any) -> float:
    """How far the eye is from the middle of the scene."""
    eye = draw(page, ".scene .plot").evaluate("plot => plot.layout.scene.camera.eye")
    return float(np.linalg.norm(list(eye.values())))


def test_a_page_without_positions_says_so(opening: Any, collection: Path, tmp_path: Path) -> None:
    problem = read(sorted(collection.rglob("*-local.hdf5"))[-1])
    bare = problem.replace(bodies=None, contacts=None)
    write_view(view_of(bare), tmp_path / "page.html")
    page = opening(tmp_path / "page.html")("", viewport=SMALL)
    draw(page, ".scene .plot")
    said = page.inner_text(".scene")
    assert "A network without positions" in said
    assert "To scale" not in said


def test_a_notebook_shows_a_view(opening: Any, tmp_path: Path) -> None:
    """The frame of a cell: it unpacks the page, in a sandbox, without a request."""
    made = planted_global(1)
    problem: Any = made.problem.replace(info=fclib.ProblemInfo(title="A planted one"))
    shown = problem.view(made.solution)._repr_html_()
    cell = f"<main><h1>A cell</h1>{shown}</main>"
    (tmp_path / "cell.html").write_text(cell, encoding="utf-8")
    go = opening(tmp_path / "cell.html")
    frame = go("").frame_locator("iframe")
    assert frame.locator("main h1").inner_text() == "A planted one"
    frame.locator(".scene .plot").first.wait_for()


def test_a_periodic_cell_is_outlined(opening: Any, tmp_path: Path) -> None:
    step = periodic_step()
    record = view_of(step.problem, step.result.solution)
    write_view(record, tmp_path / "page.html")
    page = opening(tmp_path / "page.html")("", viewport=SMALL)
    scene = draw(page, ".scene .plot")
    # no line is longer than the cell, and a contact across its boundary is there twice
    longest = """plot => Math.max(...plot.data.filter(t => t.mode === "lines").flatMap(t =>
        t.x.map((x, k) => x === null || !k ? 0 : Math.abs(x - (t.x[k - 1] ?? x)))))"""
    assert scene.evaluate(longest) == pytest.approx(13.0)
    count = "plot => plot.data.filter(t => t.name).reduce((sum, t) => sum + t.x.length, 0)"
    assert scene.evaluate(count) == step.problem.nc + len(record["network"]["images"])
    page.get_by_role("checkbox", name="cell").uncheck()
    page.wait_for_function(f"plot => ({longest})(plot) < 6", arg=scene.element_handle())


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site of 24,000 runs, of which curves have no bands and are not drawn value by value."""
    folder = tmp_path_factory.mktemp("large")
    report_size.fill(folder / "runs.sqlite", 1200, 20)
    with Campaigns([folder / "runs.sqlite"]) as campaigns:
        counts = build_site(campaigns, folder / "site", views=0)
    assert counts["runs"] == 24_000
    return folder / "site"


def test_a_large_campaign_is_browsed(opening: Any, large: Path) -> None:
    go = opening(large)
    page = go("#/catalogue?sort=nc:down&page=3")
    assert page.locator("main tbody tr").count() == 25
    assert "51–75 of 1200" in page.inner_text("main")
    page.get_by_role("link", name="Next page").click()
    page.wait_for_function("location.hash.includes('page=4')")
    assert "76–100 of 1200" in page.inner_text("main")
    # a filter starts from the first page, and the data of a page come when it is asked for
    page.get_by_label("filter").fill("nc<=10")
    page.wait_for_function("location.hash.includes('q=nc') && !location.hash.includes('page')")
    assert "19 of 1200 problems" in page.get_by_role("status").first.inner_text()
    assert page.evaluate("Object.keys(Fclib.values).sort()") == ["catalogue", "site"]
    assert page.evaluate("typeof Plotly") == "undefined"
    page.click("main tbody a >> nth=0")
    page.wait_for_selector("main[data-page=problem]")
    assert "20 runs" in page.inner_text("main")

    # the first profile and the answer need neither Plotly nor the costs of all runs
    page = go("#/overview")
    plot = page.locator("main .first .plot[data-shown]")
    plot.wait_for()
    assert plot.locator("text", has_text=re.compile(r"^solver-\d\d \d+ of 1200$")).count() == 8
    assert page.evaluate("typeof Plotly") == "undefined"
    assert page.evaluate("Object.keys(Fclib.values).sort()") == ["catalogue", "site"]
    # they say what the page finds in all costs
    said = page.inner_text("main .answer")
    ranked = page.evaluate(
        """async () => {
          const [bench, costs, cat, s] = await Promise.all(
            ["t0", "t0-cpu_s", "catalogue", "site"].map(Fclib.load));
          const names = s.solvers.map((one) => one.label);
          const found = Fclib.ranked(bench, costs, names, cat.read.family, () => true,
            s.charges.penalty, s);
          return found.slice(0, 2).map((one) => [names[one.s], one.solved, one.mean]);
        }"""
    )
    (best, solved, mean), (second, fewer, more) = ranked
    for part in (f"Take {best}. It solved {solved} of 1200", f"second is {second}: {fewer} of"):
        assert part in said
    for value in (mean, more):
        assert f"{value:.3g} s" in said
    plot.hover()
    page.locator("main .first .plot[data-drawn]").wait_for()
    names = plot.evaluate("plot => plot.data.map((one) => one.name)")
    assert len([name for name in names if name]) == 8
    assert plot.locator("> svg").count() == 0

    page = go("#/profiles?weigh=instances")
    plot = draw(page, traces=20)
    costs = read_data(large, "t0-cpu_s")
    best = np.nanmin(np.array(costs, dtype=float), axis=0)
    fastest = [np.mean(np.array(own, dtype=float) <= best) for own in costs]
    shown = plot.evaluate("plot => plot.data.map(trace => trace.y[0])")
    np.testing.assert_allclose(shown, fastest, atol=1e-12)
    # so many values are read from a table, and no more than an eye can tell
    assert plot.evaluate("plot => plot.data[0].x.length") == 1000
    points = draw(page, "main .plot >> nth=1")
    first, second = (np.array(own, dtype=float) for own in costs[:2])
    either = np.isfinite(first) | np.isfinite(second)
    count = "plot => plot.data.reduce((sum, trace) => sum + trace.x.length, 0)"
    assert points.evaluate(count) == either.sum()


def test_what_was_analysed_is_shown(opening: Any, tmp_path: Path) -> None:
    """Rank and conditioning, where the collection was built with --analyze."""
    from fclib.collections import read_catalog

    make_collection(tmp_path / "collection", analyze=True)
    build_site(None, tmp_path / "site", tmp_path / "collection", views=0)
    rows = {row["id"]: row for row in read_catalog(tmp_path / "collection").to_pylist()}
    go = opening(tmp_path / "site")
    page = go("#/catalogue?q=rank_W>6&sort=conditioning_W")
    heads = page.locator("main thead th").all_inner_texts()
    ids = column(page, 0)
    assert set(ids) == {name for name, row in rows.items() if row["rank_W"] > 6}
    for key, label in (("rank_W", "rank W"), ("rank_H", "rank H"), ("islands", "islands")):
        at = next(k for k, text in enumerate(heads) if text.strip() == label)
        assert column(page, at) == [str(rows[name][key]) for name in ids]
    conditioning = [rows[name]["conditioning_W"] for name in ids]
    # up to the six digits that the site has
    assert conditioning == pytest.approx(sorted(conditioning), rel=1e-5)
    page.get_by_role("button", name="columns").click()
    page.locator(".dt-button-collection").get_by_text("rank W", exact=True).click()
    page.wait_for_function("!document.querySelector('main thead').textContent.includes('rank W')")
    page.keyboard.press("Escape")
    page.click("main tbody a >> nth=0")
    page.wait_for_selector("main[data-page=problem]")
    facts = dict(
        zip(
            page.locator(".folded .two dl.facts dt").all_text_contents(),
            page.locator(".folded .two dl.facts dd").all_text_contents(),
            strict=True,
        )
    )
    row = rows[page.inner_text("main h1")]
    assert facts["rank W"] == str(row["rank_W"])
    assert float(facts["conditioning W"]) == pytest.approx(row["conditioning_W"], rel=5e-3)
    assert facts["existence"] == row["existence"]


FILTERS = {
    # rows: nc 50, 120, 200; family Arch, LowWall, Chain; error 1e-9, none, 1e-4
    "nc > 100": [1, 2],
    "contacts>100": [1, 2],
    "contacts ≥ 120 and nc<=150": [1],
    "family != Arch": [1, 2],
    "family=lowwall or family = Chain": [1, 2],
    "masonry": [0, 1],
    "masonry not (contacts < 100)": [1],
    "best solver = nsgs": [0],
    "best_solver=nsgs": [0],
    '"low wall"': [1],
    "error < 1e-6": [0],
    'error = ""': [1],
    "solved by < 50%": [1],
    "solved by < 50 %": [1],
    "contacts < 100 or solved by = 100 %": [0, 2],
    "": [0, 1, 2],
    "nothing": [],
    "colour = red": "no column colour",
    "nc >": "needs a value",
    "nc > many": "many is no number",
    "> 5": "without a column",
    "(nc > 5": "not closed",
    "nc > 5 or": "missing at the end",
    "nc > 5)": ") is not understood",
    "nc > 1 000": "written as one, 1000",
    "nc > 1,000": "written as one, 1000",
    "50 < nc": "the column comes first",
    "and": "and stands where",
}


def test_the_filter_understands_or_says_what_it_does_not(go: Opener) -> None:
    page = go("#/about")
    found = page.evaluate(
        """(texts) => {
          const data = { nc: [50, 120, 200], family: ["Arch", "LowWall", "Chain"],
            best_solver: ["nsgs", "auto", "auto"], error: [1e-9, null, 1e-4],
            solved_by: [0.5, 0.2, 1] };
          const labels = { nc: "contacts", family: "family", best_solver: "best solver",
            error: "error", solved_by: "solved by" };
          const columns = Object.entries(labels).map(([key, label]) => ({ key, label }));
          const read = Object.fromEntries(
            Object.entries(data).map(([key, v]) => [key, (k) => v[k]]));
          const words = (k) => ["arch masonry", "a low wall of masonry", "chain"][k];
          return texts.map((text) => {
            try {
              const { test } = Fclib.parseFilter(text, { columns, read, words });
              return [0, 1, 2].filter(test);
            } catch (error) { return error.message; }
          });
        }""",
        list(FILTERS),
    )
    for (text, expected), result in zip(FILTERS.items(), found, strict=True):
        if isinstance(expected, str):
            assert isinstance(result, str), text
            assert expected in result, text
        else:
            assert result == expected, text


def test_a_finger_has_no_buttons_in_its_way(go: Opener) -> None:
    page = go("#/profiles", viewport=PHONE, has_touch=True, is_mobile=True)
    assert draw(page).evaluate(TITLES) == []


def test_the_browser_draws_what_the_files_say(go: Opener) -> None:
    """Corners of shapes of all kinds, as Python has them."""
    from fclib.collections import set_index, trajectory
    from fclib.report.solids import record_of, solids_of

    page = go("#/about")
    kinds = set()
    for family in ("machines/GearTrain", "fclib2024/PrimitiveSoup"):
        path = set_index.plan_of(family).trajectory
        assert path is not None
        problem: Any = trajectory.read(path).problem(0).problem
        solids = solids_of(problem.bodies, problem.contacts)
        kinds |= set(problem.bodies.shape_kind.tolist())
        drawn = page.evaluate(
            "solids => solids.kind.map((_, k) => Fclib.corners(solids, k))", record_of(solids)
        )
        size = solids.size  # looks at all shapes
        for shape, corners in enumerate(drawn):
            apart = np.abs(np.array(corners) - solids.world(shape)).max()
            assert apart < 1e-6 * max(size, solids.reach(shape)), (family, shape)
    assert {0, 1, 2, 3, 4, 5, 6} <= kinds


@pytest.fixture(scope="module")
def masonry(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site with its files: a small arch, a bridge, and what is no masonry."""
    from fclib import collections

    folder = tmp_path_factory.mktemp("masonry")
    plans = [
        collections.plan_of(f"standard/{name}").only(numbers)
        for name, numbers in (("Arch", (456,)), ("Bridge", (412,)), ("Walker", (651,)))
    ]
    collections.build(plans, folder / "collection", pictures=False)
    build_site(None, folder / "site", folder / "collection", with_files=True)
    return folder / "site"


WAYS: dict[str, dict[str, Any]] = {
    "mouse": {"viewport": DESK, "color_scheme": "light"},
    "keyboard": {"viewport": DESK, "color_scheme": "dark"},
    "touch": {"viewport": PHONE, "color_scheme": "dark", "has_touch": True, "is_mobile": True},
}


@pytest.mark.parametrize("way", WAYS)
def test_a_problem_is_found_seen_taken_and_cited(way: str, opening: Any, masonry: Path) -> None:
    go = opening(masonry)
    page = go("", **WAYS[way])
    presses = 0

    def press(what: Any) -> None:
        nonlocal presses
        presses += 1
        if way == "touch":
            what.tap()
        elif way == "keyboard":
            what.focus()
            page.keyboard.press("Enter")
        else:
            what.click()

    press(page.get_by_role("link", name="Catalogue", exact=True))
    page.wait_for_selector("main[data-page=catalogue]")
    field = page.get_by_label("filter", exact=True)
    press(field)
    field.fill("masonry and contacts >= 50 and contacts <= 300 and class = easy")
    said = page.get_by_role("status").first
    page.wait_for_function("said => said.textContent.startsWith('1 of')", arg=said.element_handle())
    press(page.locator("main tbody a", has_text="Bridge").first)
    page.wait_for_selector("main[data-page=problem]")
    scene = draw(page, ".scene .plot", traces=5)
    assert "as the file has them" in page.inner_text(".scene")
    assert scene.evaluate("plot => plot.data.some(t => t.type === 'mesh3d' && t.facecolor)")
    item = page.locator("ul.files li").first
    with page.expect_download() as saved:
        press(item.get_by_role("link"))
    content = Path(saved.value.path()).read_bytes()
    assert hashlib.sha256(content).hexdigest() == item.locator("code").text_content()
    press(page.get_by_role("link", name="Cite it"))
    press(page.get_by_role("button", name="Copy BibTeX"))
    entry = page.locator("#cite + .copy").inner_text()
    assert entry.startswith("@misc{fclib-problem-standard-Bridge-0412")
    assert page.locator("dl.facts code.sum").inner_text() in entry
    assert presses <= 8
    if page.viewport_size == PHONE:
        assert at_the_sides(scene.screenshot()) == 0
    if way != "keyboard":
        check_accessible(page)
    if way == "touch":
        press_all(page)


def at_the_sides(png: bytes) -> int:
    """Coloured pixels beside the left and the right edge of a picture: something is cut there."""
    image = pytest.importorskip("PIL.Image")
    seen = np.asarray(image.open(io.BytesIO(png)).convert("RGB")).astype(int)
    edges = np.concatenate([seen[:, 3:9], seen[:, -9:-3]], axis=1)
    return int((np.ptp(edges, axis=2) > 60).sum())


SELECTIONS = {
    "a filter": "#/catalogue?q=masonry+and+contacts+>%3D+50",
    "a family": "#/catalogue?family=Walker",
    "a set": "#/catalogue?collection=standard",
}


@pytest.mark.parametrize("chosen", SELECTIONS)
def test_a_selection_is_fetched_by_its_list(
    chosen: str, opening: Any, masonry: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The list that the catalogue saves, and the page's own command, on a served site."""
    from fclib import collections

    go = opening(masonry)
    page = go(SELECTIONS[chosen])
    page.get_by_text("Take what is listed").click()
    with page.expect_download() as saved:
        page.get_by_role("button", name="selection.txt").click()
    monkeypatch.chdir(tmp_path)
    saved.value.save_as("selection.txt")
    check_accessible(page)
    names = Path("selection.txt").read_text().split()
    count = int(page.get_by_role("status").first.inner_text().split()[0])
    assert len(names) == count > 0
    lines = page.locator("details .copy", has_text="--list").inner_text().splitlines()
    (line,) = (line for line in lines if "collection get" in line)

    collections.publish(masonry.parent / "collection", tmp_path / "served")
    with served(tmp_path / "served") as address:
        places = {"collection": address, "copy": tmp_path / "served", "again": ""}
        places["again"] = (tmp_path / "served").as_uri()
        for out, place in places.items():
            known = {"URL": str(place), "collection": out}
            words = ["collection", *(known.get(word, word) for word in line.split()[2:])]
            invoke(*words)
    files = [sorted(p.relative_to(out) for p in Path(out).rglob("*.hdf5")) for out in places]
    assert files[0] == files[1] == files[2]
    rows = {row["id"]: row for row in collections.read_catalog("collection").to_pylist()}
    # an archive holds a family: what was chosen is there, and nothing of another family
    assert set(names) <= set(rows)
    assert {name.rpartition("/")[0] for name in rows} == {n.rpartition("/")[0] for n in names}
    for name in names:
        content = Path("collection", rows[name]["global_file"]).read_bytes()
        assert hashlib.sha256(content).hexdigest() == rows[name]["global_sha256"]
