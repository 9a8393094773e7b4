"""Chromium for tests of pages: without windows where there is such a one."""

import importlib
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

# the shell draws pages alone: a page costs it a quarter of what it costs the whole browser
NAMES = ("chromium-headless-shell", "chromium", "chromium-browser")

DESK = {"width": 1440, "height": 900}
PHONE = {"width": 390, "height": 844}
ROOM = {"width": 1200, "height": 900}
# the browser's, on how fast a picture is read back without a graphics card; Plotly's, on its own
# button that resets a camera
REMARKS = ("ReadPixels", "willReadFrequently", "unrecognized GUI edit: scene.aspect")


@contextmanager
def chromium() -> Iterator[Any]:
    """The first Chromium that starts: Playwright's own, or one of the system. Skips without one."""
    api = pytest.importorskip("playwright.sync_api")
    with api.sync_playwright() as playwright:
        for path in (None, *filter(None, map(shutil.which, NAMES))):
            try:
                opened = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
            except api.Error:
                continue
            yield opened
            opened.close()
            return
        pytest.skip("there is no Chromium: apt install chromium, or playwright install chromium")


class Opener:
    """Opens pages of a site or a file, and notes what a page must not do."""

    def __init__(self, browser: Any, site: Path) -> None:
        self.browser = browser
        self.file = site if site.suffix == ".html" else site / "index.html"
        self.contexts: list[Any] = []
        self.wrong: list[str] = []

    def close(self) -> None:
        """Close them; what was noted is an error."""
        for context in self.contexts:
            context.close()
        assert not self.wrong, self.wrong

    def __call__(self, address: str, **settings: Any) -> Any:
        """A page, when it shows what it is about."""
        context = self.browser.new_context(**{"viewport": ROOM, **settings})
        self.contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(60_000)
        page.on("console", lambda message: self.hear(address, message))
        page.on("pageerror", lambda error: self.wrong.append(f"{address}: {error}"))
        page.on("request", self.judge)
        page.goto(self.file.as_uri() + address)
        page.wait_for_selector("main h1")
        return page

    def hear(self, address: str, message: Any) -> None:
        if not any(remark in message.text for remark in REMARKS):
            self.wrong.append(f"{address}: {message.type} {message.text}")

    def judge(self, request: Any) -> None:
        if not request.url.startswith(("file:", "data:", "blob:")):
            self.wrong.append(f"asks for {request.url}")


def turn(page: Any, address: str) -> None:
    """Another page of the site, as a link leads to it: what a page loads once is there."""
    page.evaluate(
        """address => {
          document.querySelector("main h1").dataset.left = "";
          location.hash = address;
        }""",
        address,
    )
    page.wait_for_selector("main h1:not([data-left])")


SETTLED = "document.getAnimations().every((one) => one.playState !== 'running')"
UNFOLD = "document.querySelectorAll('main details').forEach((one) => (one.open = true))"
PRESS = """document.querySelectorAll("main button, main .modebar-btn, main summary")
    .forEach((one) => one.click())"""


def check_accessible(page: Any) -> None:
    """Nothing against a page, as it is now, is found by axe."""
    axe: Any = importlib.import_module("axe_playwright_python")
    page.add_script_tag(path=Path(axe.__file__).parent / "axe.min.js")
    page.wait_for_function(SETTLED)  # the fade is over
    found = page.evaluate("axe.run(document, { resultTypes: ['violations'], preload: false })")
    wrong = [(one["id"], one["nodes"][0]["html"][:200]) for one in found["violations"]]
    assert not wrong, (wrong, page.url, page.viewport_size)


def press_all(page: Any) -> None:
    """Every button, those of charts too: what it asks for is heard, until the page is idle."""
    page.evaluate(PRESS)
    page.wait_for_timeout(300)
    # a page that closes while it draws a picture to keep may take the browser's drawing with it
    page.evaluate("new Promise((done) => requestIdleCallback(done))")


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """The address of a folder, as `fclib report --serve` serves one."""
    from fclib.report import serving

    with serving.server(folder) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/"
        finally:
            server.shutdown()


def colours(picture: Any) -> int:
    """How many colours a picture of bytes, (rows, columns, 3), has: each as one whole number.

    `np.unique` of rows compares them byte by byte: 3 s for the picture of a desk.
    """
    return len(np.unique(np.asarray(picture, dtype=np.int32) @ np.array([1 << 16, 1 << 8, 1])))
