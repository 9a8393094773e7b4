"""Pages of the report that check and solve their problem in a browser, served to this machine."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import browser_module
import golden_work
from fclib.cli import app
from fclib.report import ReportError, browser, build_site, serving
from helpers_report import read_data

pytest.importorskip("pyarrow")
pytest.importorskip("plotly")
pytest.importorskip("itables")
TOWER = "#/problem/tiny/KaplasTower/0030"


@pytest.fixture(scope="module")
def catalogue(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tower of `tiny`, as a collection."""
    folder = tmp_path_factory.mktemp("tower") / "collection"
    family = folder / "tiny" / "KaplasTower"
    shutil.copytree(golden_work.TINY / "KaplasTower", family)
    shutil.copy(family / "catalog.parquet", folder)
    return folder


@pytest.fixture(scope="module")
def site(catalogue: Path) -> Path:
    folder = catalogue.parent / "a site #1"
    try:
        module = browser.find(browser_module.FOLDER)
    except ReportError as error:
        pytest.skip(str(error))
    build_site(None, folder, catalogue, with_files=True, views=0, module=module)
    return folder


def test_a_site_without_the_module_says_so(
    catalogue: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(browser, "BUILT", tmp_path / "none")
    out = tmp_path / "site"
    words = ["report", "--catalog", str(catalogue), "--out", str(out), "--views", "0"]
    done = CliRunner().invoke(app, [*words, "--with-files"])
    assert done.exit_code == 0, done.output
    assert "do not check and solve problems" in done.output
    assert read_data(out, "site")["module"] == 0
    assert not (out / browser.PLACE).exists()
    # what a file's solution is worth stands there in full
    first = read_data(out, "files/0")[0]["files"][0]
    assert first["merit"]["error"] < 1e-8
    done = CliRunner().invoke(app, [*words, "--with-files", "--browser", str(tmp_path)])
    assert done.exit_code == 1
    assert "has no fclib.js; make wasm builds such a folder" in " ".join(done.output.split())
    done = CliRunner().invoke(app, [*words, "--browser", str(tmp_path)])
    assert done.exit_code == 1
    assert "say --with-files" in done.output


def test_what_is_no_site_is_not_served(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["report", "--serve", "--out", str(tmp_path)])
    assert done.exit_code == 1
    assert "is no site" in done.output


def test_a_site_is_served_until_an_interrupt(site: Path) -> None:
    words = [sys.executable, "-m", "fclib", "report", "--serve", "--out", str(site)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        found = re.match(r"(http://127\.0\.0\.1:\d+/) ", process.stdout.readline())
        assert found is not None
        types = {}
        for name in ("fclib-core.wasm", "fclib-core.mjs", "fclib.js"):
            with urllib.request.urlopen(f"{found[1]}{browser.PLACE}/{name}") as answer:
                types[name.rpartition(".")[2]] = answer.headers["Content-Type"]
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
    assert types == {"wasm": "application/wasm", "mjs": "text/javascript", "js": "text/javascript"}


@pytest.fixture
def page(site: Path) -> Iterator[Any]:
    """The tower's page at an address of this machine, and in `wrong` what it must not do."""
    api = pytest.importorskip("playwright.sync_api")
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)
    with serving.server(site) as server, api.sync_playwright() as playwright:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/"
        try:
            chromium = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        except api.Error:
            server.shutdown()
            pytest.skip("there is no Chromium: apt install chromium")
        opened = chromium.new_page(viewport={"width": 390, "height": 800})
        opened.set_default_timeout(20_000)
        wrong: list[str] = []
        opened.on("console", lambda message: wrong.append(message.text))
        opened.on("pageerror", lambda error: wrong.append(str(error)))
        opened.on(
            "request",
            lambda request: (
                None
                if request.url.startswith((address, "data:", "file:"))
                else wrong.append(request.url)
            ),
        )
        opened.goto(address + TOWER)
        yield opened
        chromium.close()
        server.shutdown()
        assert not wrong


@pytest.mark.slow
def test_a_tower_is_checked_and_solved_on_its_page(page: Any, site: Path) -> None:
    page.get_by_role("button", name="Check it here").click()
    checked = page.locator("table", has_text="compared").locator("tbody tr")
    checked.first.wait_for()
    stored = read_data(site, "files/0")[0]["files"][0]["merit"]
    assert checked.count() == len(stored) == 12
    words = [str(row).split("\t")[3].strip() for row in checked.all_inner_texts()]
    assert words == ["equal to 1e-12"] * 12

    # another stored value is told, and so is another file
    page.evaluate(
        """const [first, second] = Fclib.values["files/0"][0].files;
        first.merit.natural += 1e-9;
        second.sha256 = "0";"""
    )
    page.get_by_role("button", name="Check it here").click()
    page.get_by_text("differs by 1e-9").wait_for()
    form = page.locator("select", has_text="local form")
    form.select_option("1")
    page.get_by_role("button", name="Check it here").click()
    page.get_by_text("is another file than when the site was made").wait_for()
    form.select_option("0")

    page.get_by_role("button", name="Solve it here").click()
    start = page.get_by_role("button", name="Start")
    stop = page.get_by_role("button", name="Stop")
    rows = page.locator("table", has_text="time [s]").locator("tbody tr")

    def newest() -> list[str]:
        return [str(cell).strip() for cell in rows.first.locator("th, td").all_inner_texts()]

    for count, solver in enumerate(("auto", "nsgs")):
        page.locator("select:has(option[value=nsgs])").select_option(solver)
        start.click()
        page.get_by_text(re.compile(f"^{solver}: converged after")).wait_for()
        rows.nth(count).wait_for()
        found = newest()
        assert found[:3] == [solver, "1e-8", "converged"]
        assert float(found[5]) <= 1e-8
    assert page.locator("svg.curve polyline").get_attribute("points")

    # without an end: it is watched and stopped, and the page lives on
    page.get_by_label("tolerance", exact=True).fill("0")
    page.get_by_label("iterations", exact=True).fill("100000000")
    page.evaluate(
        r"""new MutationObserver(() => {
          const named = (text) => [...document.querySelectorAll("main button")]
            .find((one) => one.textContent === text);
          if (/iteration \d+, error/.test(document.querySelector("main").textContent)
              && !named("Stop").disabled) named("Stop").click();
        }).observe(document.querySelector("main"), { childList: true, subtree: true })"""
    )
    start.click()
    page.get_by_text(re.compile("nsgs: interrupted after")).wait_for()
    rows.nth(2).wait_for()
    found = newest()
    assert found[2] == "interrupted"
    assert float(found[5]) > 0
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")

    # what is no number is said, and nothing runs
    page.get_by_label("time limit [s]", exact=True).fill("")
    start.click()
    page.get_by_text("time limit [s]: not a number of at least 0.1").wait_for()
    assert stop.is_disabled()

    # a folder of files: the page says how to serve it
    page.goto((site / "index.html").as_uri() + TOWER)
    page.get_by_text(f"fclib report --serve --out '{site}'").wait_for()
    assert page.get_by_role("button", name="Check it here").count() == 0
