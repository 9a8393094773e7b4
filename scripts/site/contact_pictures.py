"""Pictures of the figures of docs/contact-problem.md, as they stand before a slider is moved.

    .venv/bin/python scripts/site/contact_pictures.py [FOLDER]

Writes contact-NAME.png into docs/images, or that folder, by Chromium, from the module that
`make wasm` has built: what a site without the module shows, and every reader of the Markdown.
"""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import build
from playwright.sync_api import sync_playwright

PAGE = build.ROOT / "docs" / "contact-problem.md"
SCALE = 1.5  # pixels of a picture for one of the page


class _Quiet(SimpleHTTPRequestHandler):
    extensions_map = SimpleHTTPRequestHandler.extensions_map | {
        ".mjs": "text/javascript",
        ".wasm": "application/wasm",
    }

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing of what is asked for."""


def main() -> int:
    """Draw all figures of the page; 1 if there is no module."""
    out = Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else build.ROOT / "docs" / "images"
    names = re.findall(r'data-figure="(\w+)"', PAGE.read_text(encoding="utf-8"))
    figures = dict(build.figures())
    if len(figures) == 1:
        return 1  # the reason has been told
    places = "".join(f'<div class="contact-figure" data-figure="{name}"></div>' for name in names)
    page = f"""<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,">
        <style>{build.STYLE} body {{ width: 640px; font-family: sans-serif; }}</style>
        {places}<script src="_static/contact.js"></script>"""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for path, content in (figures | {"index.html": page}).items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            data = content if isinstance(content, bytes) else content.encode()
            (folder / path).write_bytes(data)
        handler = partial(_Quiet, directory=name)
        known = ("chromium-headless-shell", "chromium", "chromium-browser")
        chromium = next(filter(None, map(shutil.which, known)), None)
        with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server, sync_playwright() as driver:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
            opened = browser.new_page(device_scale_factor=SCALE)
            opened.on("pageerror", lambda error: print(error, file=sys.stderr))
            opened.goto(f"http://127.0.0.1:{server.server_port}/")
            for one in names:
                place = opened.locator(f"div[data-figure={one}][data-alive]")
                place.wait_for()
                target = out / f"contact-{one}.png"
                place.locator(".contact-pictures").screenshot(path=target)
                print(f"{target.name}: {place.get_by_role('status').inner_text()}")
            browser.close()
            server.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
