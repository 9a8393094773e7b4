"""What a report of a large campaign costs: to build, to keep, and to open in a browser.

    python -m workshop.tables.report_size [--problems 5000] [--solvers 40] [--results NAME]

The runs are made up. The times to open need Playwright and a Chromium: from the call to the moment
that the page shows what it is about, the files in the system's cache; and how much of that its main
thread computed, which tells more if others use the machine. `--results NAME` stores two tables,
NAME of the build and NAME-pages of the opening.
"""

from __future__ import annotations

import argparse
import hashlib
import random
import resource
import shutil
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fclib.bench import Store
from fclib.report import Campaigns, build_site
from workshop.tables import _results

# the data that a page loads
PARTS = {"overview": ("site", "catalogue"), "catalogue": ("site", "catalogue")}
REPEATS = 5  # times that each page is opened
CATALOGUE = "catalogue"
MARKS = {
    "overview, which solver to take": ("#/overview", "main .answer a"),
    "overview, its first profile": ("#/overview", "main .plot[data-shown]"),
    CATALOGUE: ("#/catalogue", "main table tbody tr"),
    "a problem": ("#/problem/Family1/00001", "main table tbody tr"),
    "profiles, their table of statuses": ("#/profiles", "main table tbody tr"),
    "profiles, their curves": ("#/profiles", "main .plot[data-shown]"),
}
FILTERS = ("contacts > 500", "contacts > 500 and solver-07")
# types into the filter of a catalogue, and waits for what it says
ANSWER = """async (text) => {
  const field = document.querySelector("main input[type=search]");
  const said = document.querySelector("main [role=status]"), before = said.textContent;
  field.value = text;
  field.dispatchEvent(new Event("input"));
  while (said.textContent === before) await new Promise((done) => setTimeout(done, 2));
}"""


def fill(path: Path, problems: int, solvers: int) -> None:
    """A store of problems x solvers runs at one tolerance, its rows written in one go."""
    draw = random.Random(1)
    with Store(path) as store, store.transaction():
        db = store.db
        db.execute("INSERT INTO machines (id, hash, node, cpu) VALUES (1, 'm', 'made', 'up')")
        db.executemany(
            "INSERT INTO problems (id, hash, name, family, path, kind, formulation, spacedim, n, p,"
            " nc, nnz, title) VALUES (?, ?, ?, ?, ?, 'local', '3DFC', 3, 0, 0, ?, ?, ?)",
            (
                (k, digest(k), f"{k:05d}", f"Family{k % 9}", "", 1 + k % 997, 9 * k, f"Problem {k}")
                for k in range(1, problems + 1)
            ),
        )
        db.executemany(
            "INSERT INTO solvers (id, hash, label, name, options, version, family, origin)"
            " VALUES (?, ?, ?, 'nsgs', '{}', '1', 'splitting', 'fclib')",
            ((k, f"s{k}", f"solver-{k:02d}") for k in range(1, solvers + 1)),
        )
        db.executemany(
            "INSERT INTO runs (key, problem, solver, machine, tol, time_limit, wall_limit,"
            " memory_limit, threads, repeat, status, message, solved, iterations, cpu_s, setup_s,"
            " total_cpu_s, wall_s, memory_mb, error)"
            " VALUES (?, ?, ?, 1, 1e-6, 10, 20, 1000, 1, 0, ?, '', ?, ?, ?, 0, ?, ?, ?, ?)",
            (run(draw, p, s) for p in range(1, problems + 1) for s in range(1, solvers + 1)),
        )
        store.seal()


def digest(number: int) -> str:
    """A hash as those of problems look."""
    return hashlib.sha256(str(number).encode()).hexdigest()


def run(draw: random.Random, problem: int, solver: int) -> tuple[Any, ...]:
    """The columns of a run, drawn by lot."""
    solved = draw.random() < 0.95 - solver / 100
    seconds = 10 ** draw.gauss(-3 + solver / 40, 0.7)
    status = "converged" if solved else "time_limit"
    key = f"{problem}-{solver}"
    error = 5e-7 if solved else 1e-2
    return (
        *(key, problem, solver, status, int(solved), draw.randrange(1, 9999), seconds),
        *(1.1 * seconds, 1.2 * seconds, draw.uniform(20, 90), error),
    )


def size(site: Path, *names: str) -> float:
    """Megabytes of files of data."""
    return sum((site / "data" / f"{name}.js").stat().st_size for name in names) / 1e6


def open_pages(
    site: Path, marks: Mapping[str, tuple[str, str]], answer: str, filters: Sequence[str]
) -> dict[str, tuple[float, float]]:
    """Seconds, and of CPU, until each page shows what it is about; the least of all.

    Args:
        site: the site.
        marks: by name the address of a page, and the selector of what it is about.
        answer: the name of an answer of the filter of the page CATALOGUE.
        filters: what is typed into the filter.
    """
    from playwright.sync_api import sync_playwright

    found: dict[str, list[tuple[float, float]]] = defaultdict(list)

    def note(name: str, tools: Any, act: Callable[[], object]) -> None:
        before = busy(tools)
        start = time.perf_counter()
        act()
        found[name].append((time.perf_counter() - start, busy(tools) - before))

    with sync_playwright() as playwright:
        chromium = shutil.which("chromium-headless-shell") or shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for _ in range(REPEATS):
            for name, (address, mark) in marks.items():
                page = browser.new_page()
                tools = page.context.new_cdp_session(page)
                tools.send("Performance.enable", {"timeDomain": "threadTicks"})

                def show(page: Any = page, address: str = address, mark: str = mark) -> None:
                    page.goto(f"{(site / 'index.html').as_uri()}{address}")
                    page.wait_for_selector(mark, state="attached")

                note(name, tools, show)
                page.wait_for_timeout(1000)  # nobody types before
                for text in filters if name == CATALOGUE else ():

                    def ask(page: Any = page, text: str = text) -> None:
                        page.evaluate(ANSWER, text)

                    note(answer, tools, ask)
                page.close()
        browser.close()
    return {name: (min(t for t, _ in own), min(c for _, c in own)) for name, own in found.items()}


def busy(tools: Any) -> float:
    """Seconds that the page's thread has computed."""
    metrics = tools.send("Performance.getMetrics")["metrics"]
    return float(next(m["value"] for m in metrics if m["name"] == "TaskDuration"))


def main() -> None:
    """Measure, and print a line for each figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problems", type=int, default=5000)
    parser.add_argument("--solvers", type=int, default=40)
    parser.add_argument("--out", type=Path, help="keep the site here")
    _results.add_option(parser)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "runs.sqlite"
        fill(store, options.problems, options.solvers)
        site = options.out or Path(folder) / "site"
        busy = time.process_time()
        with Campaigns([store]) as campaigns:
            counts = build_site(campaigns, site, views=0)
        busy = time.process_time() - busy
        built = {
            "runs": counts["runs"],
            "CPU [s]": busy,
            "memory [MB]": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
            "data [MB]": counts["bytes"] / 1e6,
            **{f"{name} [MB]": size(site, *files) for name, files in PARTS.items()},
            "files": len(list((site / "data").rglob("*.js"))),
        }
        print(_results.table(list(built), [built]))
        try:
            opened = open_pages(site, MARKS, "catalogue, an answer of its filter", FILTERS)
        except ImportError:
            parser.exit(1, "the times to open need Playwright\n")
    pages = [
        {"page": name, "CPU [s]": busy, "clock [s]": seconds}
        for name, (seconds, busy) in opened.items()
    ]
    print(_results.table(list(pages[0]), pages))
    if options.results:
        about = f"{options.problems} made-up problems by {options.solvers} solvers"
        _results.store(options.results, [built], title=f"A site of {about}")
        _results.store(
            f"{options.results}-pages",
            pages,
            title=f"Pages of a site of {about}, until each shows what it is about",
            note=f"The least of {REPEATS} times, in Chromium without a graphics card, since other "
            "programs may use the machine.",
        )


if __name__ == "__main__":
    main()
