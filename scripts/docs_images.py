"""All pictures of docs/images, from stored states and stored runs.

    python scripts/docs_images.py [NAME...] [--out docs/images]

    bridge, walker, ...    a stored state of a family, some with the contact forces of its solution
    stack                  the last step of `make demo`
    families-GROUP         small pictures of all families of a group of sets
    report-...             pages of a report of the stored runs, by Chromium
    contact-...            figures of docs/contact-problem.md, by scripts/site/contact_pictures.py

The first two need OpenGL (see `fclib.simulate.render`), the third Pillow, the fourth what `fclib
report` needs, the last one the module for browsers.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import fclib
from fclib import collections, demo, results, scenes, simulate
from fclib.bench import Store
from fclib.collections import families, set_index, trajectory
from fclib.report import Campaigns, build_site, drawings, picture, view_of, write_view
from fclib.report.solids import solids_of

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"


@dataclass(frozen=True)
class Shot:
    """What a picture shows."""

    family: str
    # of its states in the set standard, in turn, -1 is the last one; the step of a simulation, if
    # there are no states, or if forces are shown
    number: int
    size: tuple[int, int]  # width and height [pixels]
    forces: bool = False


SHOTS = {
    "bridge": Shot("Bridge", 4, (800, 500)),
    "aqueduct": Shot("Aqueduct", -1, (800, 500)),
    "low-wall": Shot("LowWall", -1, (660, 400)),
    "cubes-h8": Shot("CubesH8", 40, (480, 600), forces=True),
    "low-wall-fem": Shot("LowWallFEM", 40, (840, 360), forces=True),
    "closed-chains": Shot("ClosedChains", 200, (480, 640)),
    "quadruped": Shot("Quadruped", 120, (800, 500)),
    "walker": Shot("Walker", 130, (420, 560), forces=True),
}
# the sets whose families are on one sheet
GROUPS = {
    "families-rt444": ("rt444",),
    "families-masonry": ("masonry",),
    "families-deformable": ("deformable",),
    "families-mixed": ("mixed",),
    "families-robots": ("robots",),
    "families-machines": ("machines",),
    "families-quasistatic": ("quasistatic", "laws", "assembly", "flows", "spin"),
    "families-simulators": ("simulators",),
    "families-decks": ("decks",),
    "families-grains": ("granular", "rolling", "planar"),
    "families-dynamics": ("impacts", "existence", "dynamics"),
    "families-ladder": ("ladder", "local"),
}
# not on them: without stored states, and they look like another one of their group
LIKE = {
    "CubesH8x20": "CubesH8",
    "ElasticCubesx20": "ElasticCubes",
    "ChuteLocalProblems": "LocalProblems",
}
TILE, CAPTION, COLUMNS = (240, 180), 24, 4
SHADES = 128  # of a sheet
LANDED = 60  # steps after which what is simulated for a sheet has something to show
BOXES, STEPS = 6, 50  # of the demo
# pages of the report: address, what is taken of it, the window
PAGES = {
    "report-overview": ("index.html", "", (1100, 1000)),
    "report-pair": ("index.html#/profiles", "main .plot >> nth=-1", (1100, 900)),
    "report-network": ("network.html", ".scene .plot", (1100, 900)),
}
# in the order of preference; the first is what the tests install
CHROMIUM = ("chromium-headless-shell", "chromium", "chromium-browser")
SHOWN = "standard/Arch/0217"  # its forces are of its reference solution


def names() -> list[str]:
    """All pictures, in the order in which they are made."""
    return [*SHOTS, "stack", *GROUPS, *PAGES, *figures()]


def figures() -> list[str]:
    """Those of the figures of a page that are solved in the reader's browser."""
    text = (ROOT / "docs" / "contact-problem.md").read_text(encoding="utf-8")
    return [f"contact-{name}" for name in re.findall(r'data-figure="(\w+)"', text)]


# ---- states, by OpenGL


def shoot(shot: Shot, path: Path) -> None:
    """Write a picture; the scene's own view and focus are those of its class now."""
    family: Any = scenes.get(shot.family)
    own = f"standard/{shot.family}"
    stored = not shot.forces and own in set_index.sets()["standard"]
    plan = set_index.plan_of(own) if stored else None
    if plan is None or plan.trajectory is None:
        *_, step = simulate.simulate(family().scene(0), steps=shot.number)
        simulate.render(step if shot.forces else step.model, path, size=shot.size)
        return
    states = trajectory.read(plan.trajectory)
    seen = family().scene(states.scene.seed)
    model = simulate.model_of(replace(states.scene, view=seen.view, focus=seen.focus))
    place = range(len(states.number))[shot.number]
    model.set_state(states.position[place], states.velocity[place])
    simulate.render(model, path, size=shot.size)


def stack(path: Path) -> None:
    """The picture that `make demo` draws."""
    with tempfile.TemporaryDirectory() as folder:
        for _ in demo.simulate(Path(folder), BOXES, STEPS, path):
            pass


# ---- families


def problem_of(name: str) -> Any:
    """A problem of a family: of its stored states the middle one, else one that is made now."""
    if name in scenes.assemblies():
        family: Any = scenes.assemblies()[name]()
        return family.problem(family.problems // 2, 0)
    for own in (f"standard/{name}", f"{families()[name].collection}/{name}"):
        try:
            plan = set_index.plan_of(own)
        except KeyError:
            continue
        if plan.trajectory is not None:
            states = trajectory.read(plan.trajectory)
            return states.problem(len(states.number) // 2).problem
    *_, last = simulate.simulate(scenes.get(name)().scene(0), steps=LANDED)
    contacts, bodies = simulate.geometry_of(last.model, last.contacts)
    return last.problem.replace(contacts=contacts, bodies=bodies)


def of_group(sets: tuple[str, ...]) -> list[str]:
    """The families of sets, in their order."""
    known_ones = [(name, kind) for name, kind in families().items() if name not in LIKE]
    return [name for own in sets for name, kind in known_ones if kind.collection == own]


def sheet(sets: tuple[str, ...], path: Path) -> None:
    """Small pictures of all families of some sets, with their names."""
    from PIL import Image, ImageDraw, ImageFont

    own = of_group(sets)
    columns = min(COLUMNS, len(own))
    wide, tall = TILE[0], TILE[1] + CAPTION
    whole = Image.new("RGB", (columns * wide, -(-len(own) // columns) * tall), "white")
    pen, font = ImageDraw.Draw(whole), ImageFont.load_default(size=15)
    with tempfile.TemporaryDirectory() as folder:
        for k, name in enumerate(own):
            file = Path(folder) / "one.png"
            problem = problem_of(name)
            bodies, contacts = problem.bodies, problem.contacts
            if bodies is None or contacts is None or not len(bodies.shape_kind):
                picture.draw_matrix(drawings.matrix_of(problem), file, TILE)
            else:
                near = contacts.point[(contacts.shape >= 0).all(axis=1)]
                picture.draw(solids_of(bodies, contacts), file, TILE, near=near)
            tile = Image.open(file)
            x, y = (k % columns) * wide, (k // columns) * tall
            whole.paste(tile, (x, y), tile)
            pen.text((x + wide / 2, y + TILE[1] + 4), name, "black", font, anchor="ma")
    whole.quantize(SHADES).save(path, optimize=True)


# ---- the report


def stored_runs(folder: Path, store: Path) -> None:
    """A store of the published runs of the problems in a folder."""
    wanted = set(collections.read_catalog(folder).column("digest").to_pylist())
    where = results.folder()
    with Store(store) as target:
        for part in results.shards(where) if where else []:
            rows = (row for row in results.rows_of(part.path) if row["hash"] in wanted)
            target.add_rows(rows, part.machines)


def report(folder: Path) -> Path:
    """A report of all stored runs; its folder."""
    plans = [set_index.plan_of(name) for name in set_index.sets()["standard"]]
    bare = [replace(p, references=p.name == SHOWN.rpartition("/")[0]) for p in plans]
    collections.build(bare, folder / "collection", pictures=False)
    stored_runs(folder / "collection", folder / "runs.sqlite")
    site = folder / "site"
    with Campaigns([folder / "runs.sqlite"]) as runs:
        build_site(runs, site, folder / "collection", views=0)
    file = folder / "collection" / f"{SHOWN}-global.hdf5"
    write_view(view_of(fclib.read(file), fclib.read_solution(file)), site / "network.html")
    return site


def pages(wanted: list[str], site: Path, out: Path) -> None:
    """Write pictures of pages of a report."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=chromium_path(), args=["--no-sandbox"])
        for name in wanted:
            place, part, (width, height) = PAGES[name]
            page = chromium.new_page(viewport={"width": width, "height": height})
            page.goto(f"{site.as_uri()}/{place}")
            plot = page.locator(part or "main .plot >> nth=0")
            plot.scroll_into_view_if_needed()
            plot.and_(page.locator("[data-shown]")).wait_for()
            page.wait_for_timeout(1500)  # pictures in space are drawn after they are said to be
            if part:
                plot.screenshot(path=out / f"{name}.png")
            else:
                page.evaluate("scrollTo(0, 0)")
                page.screenshot(path=out / f"{name}.png")
            page.close()
        chromium.close()


def chromium_path() -> str | None:
    """Of the system, if there is one; else Playwright's own."""
    return next(filter(None, map(shutil.which, CHROMIUM)), None)


def main() -> int:
    """Make all pictures, or some."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(names()))
    parser.add_argument("--out", type=Path, default=IMAGES)
    options = parser.parse_args()
    wanted = options.names or names()
    for name in wanted:
        if name not in names():
            parser.error(f"there is no picture {name}; there are {', '.join(names())}")
    for name in wanted:
        path = options.out / f"{name}.png"
        if name in SHOTS:
            shoot(SHOTS[name], path)
        elif name == "stack":
            stack(path)
        elif name in GROUPS:
            sheet(GROUPS[name], path)
    if own := [name for name in wanted if name in PAGES]:
        with tempfile.TemporaryDirectory() as folder:
            pages(own, report(Path(folder)), options.out)
    if set(wanted) & set(figures()):
        script = ROOT / "scripts" / "site" / "contact_pictures.py"
        return subprocess.run([sys.executable, script, options.out], check=False).returncode
    return 0


if __name__ == "__main__":
    sys.exit(main())
