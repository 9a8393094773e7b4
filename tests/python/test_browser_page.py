"""The module for browsers in a page of Chromium: a worker reads, solves, tells and stops."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import browser_module
import fclib
import golden_work
from helpers_browser import chromium, served

pytestmark = [
    pytest.mark.skipif(bool(browser_module.missing()), reason=browser_module.missing()),
    pytest.mark.slow,
]

FILE = golden_work.TINY / "KaplasTower" / "0030-local.hdf5"
# in the page: a worker, a file in base64, and what Python asks for
WORKER = """async ({ data, settings, stop }) => {
  const { FclibWorker } = await import("./fclib-worker.js");
  const fclib = new FclibWorker();
  const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
  const { problem } = await fclib.read(bytes);
  const reports = [];
  const run = fclib.solve(problem, settings, (report) => {
    reports.push([report.points.length, report.r.length]);
    if (stop) run.stop();
  });
  const { status, iterations, error, solution } = await run;
  const merit = await fclib.merit(problem, { r: solution.r });
  const refused = await fclib.solve(problem, { solver: "none" }).catch((e) => [e.name, e.kind]);
  fclib.close();
  return { status, iterations, error, merit: merit.error, reports, refused };
}"""


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """The folder of the module at this machine."""
    with served(browser_module.FOLDER) as found:
        yield found


@pytest.fixture(scope="module")
def page(address: str) -> Iterator[Any]:
    if not (browser_module.FOLDER / "hdf5_hl.js").is_file():
        pytest.skip("the module reads no HDF5: there was no npm")
    with chromium() as browser:
        opened = browser.new_page()
        opened.wrong = []
        opened.on("console", lambda message: opened.wrong.append(message.text))
        opened.on("pageerror", lambda error: opened.wrong.append(str(error)))
        opened.on(
            "request",
            lambda request: (
                None
                if request.url.startswith((address, "data:"))
                else opened.wrong.append(request.url)
            ),
        )
        opened.route(
            address, lambda route: route.fulfill(content_type="text/html", body="<p>page</p>")
        )
        opened.goto(address)
        yield opened


def ask(page: Any, path: Path, settings: dict[str, Any], stop: bool) -> Any:
    data = base64.b64encode(path.read_bytes()).decode()
    return page.evaluate(WORKER, {"data": data, "settings": settings, "stop": stop})


def test_a_worker_solves(page: Any) -> None:
    found = ask(page, FILE, {"solver": "nsgs"}, stop=False)
    native = fclib.solve(fclib.read(FILE), "nsgs")
    assert (found["status"], found["iterations"]) == ("converged", native.iterations)
    assert found["error"] == pytest.approx(native.error, abs=1e-12)
    assert found["merit"] <= 1e-8
    assert found["refused"] == ["FclibError", "option"]
    assert found["reports"][0] == [1, fclib.read(FILE).m]
    assert page.wrong == []


def test_a_worker_is_stopped(page: Any) -> None:
    found = ask(page, FILE, {"solver": "nsgs", "tol": 0, "max_iterations": 10**8}, stop=True)
    assert found["status"] == "interrupted"
    assert found["merit"] > 0
    assert page.wrong == []
