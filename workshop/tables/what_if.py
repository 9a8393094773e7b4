"""Sliders of "What if" in Chromium: how many solutions and pictures a second follow a drag.

    python -m workshop.tables.what_if FILE... --results what-if

Each file is opened on the page "Your file" of a site that is served at this machine. For SECONDS
the slider of mu moves with each picture of the screen, from the file's own value to a tenth and
back; of a problem whose load can be turned, the turn goes along, to 20 degrees. Counted are the
solutions that were reported and the pictures that were drawn. Chromium draws without a graphics
card here.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

import fclib
from fclib.report import build_site, serving
from workshop.tables import _results

sys.path.insert(0, str(_results.ROOT / "tests"))

import golden_work

SECONDS = 4
# in the page: what a drag does, and what it has counted
DRAG = """async (seconds) => {
  const input = (label) => document.querySelector(`.what-if input[aria-label^="${label}"]`);
  const put = (slider, value) => {
    slider.value = value;
    slider.dispatchEvent(new Event("input"));
  };
  const [mu, turn] = [input("μ"), input("turn of f, from z to x")];
  const panel = document.querySelector(".what-if"), figure = document.querySelector("figure.live");
  const start = performance.now(), own = Number(mu.value);
  let solves = 0, frames = 0;
  const watcher = new MutationObserver(() => { solves++; });
  watcher.observe(panel.querySelector("[role=status]"), { childList: true, characterData: true });
  const drawn = figure?.drawn ?? 0;
  let passed = 0;
  while ((passed = (performance.now() - start) / 1e3) < seconds) {
    const share = 1 - Math.abs(1 - (2 * passed) / seconds);
    put(mu, own - (own - 0.1) * share);
    if (turn) put(turn, 20 * share);
    frames++;
    await new Promise(requestAnimationFrame);
  }
  watcher.disconnect();
  return { turned: Boolean(turn), solves: solves / passed, frames: frames / passed,
    pictures: ((figure?.drawn ?? 0) - drawn) / passed };
}"""


def measured(page: Any, address: str, path: Path) -> dict[str, Any]:
    problem: Any = fclib.read(path)
    page.goto("about:blank")
    page.goto(f"{address}#/own")
    page.locator("input[type=file]").set_input_files(path)
    page.get_by_role("button", name="What if").click()
    page.locator(".what-if[aria-busy=false]").wait_for()
    found = page.evaluate(DRAG, SECONDS)
    return {
        "problem": f"{path.parent.name}/{path.stem}",
        "formulation": problem.formulation,
        "contacts": problem.nc,
        "changed": "mu, load" if found["turned"] else "mu",
        "solutions a second": f"{found['solves']:.0f}",
        "pictures a second": f"{found['pictures']:.0f}",
        "moves a second": f"{found['frames']:.0f}",
    }


def main() -> int:
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help="FCLIB files")
    _results.add_option(parser)
    arguments = parser.parse_args()
    known = ("chromium-headless-shell", "chromium", "chromium-browser")
    chromium = next(filter(None, map(shutil.which, known)), None)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        site = Path(folder) / "site"
        # the page needs a site with the module; of which problems does not matter
        family = golden_work.TINY / "LocalProblems"
        shutil.copytree(family, Path(folder) / "collection" / "tiny" / family.name)
        shutil.copy(family / "catalog.parquet", Path(folder) / "collection")
        counts = build_site(None, site, Path(folder) / "collection", views=0, with_files=True)
        if not counts["module"]:
            print("the module for browsers is not built: make wasm", file=sys.stderr)
            return 1
        with serving.server(site) as server, sync_playwright() as playwright:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            browser = playwright.chromium.launch(
                executable_path=chromium, args=["--no-sandbox", "--disable-gpu"]
            )
            page = browser.new_page(viewport={"width": 1000, "height": 1000})
            page.set_default_timeout(60_000)
            for path in arguments.files:
                rows.append(
                    measured(page, f"http://{serving.HOST}:{server.server_port}/", path.resolve())
                )
                print(" | ".join(str(value) for value in rows[-1].values()), flush=True)
            browser.close()
            server.shutdown()
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="Following a slider in the browser",
            note=f"Chromium, {SECONDS} s of a drag that moves with each picture of the screen; "
            "tol = 1e-8; other programs ran on the machine.",
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
