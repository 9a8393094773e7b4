"""Build the documentation: build.py OUT [--quick] [--report ADDRESS] [--versions NAME,...], a site
that opens from a folder and any host.

Its sources are README.md, ARCHITECTURE.md and their like, docs/, and pages that follow from the
code. All are brought into one folder, from which Sphinx makes the site; a warning is an error.
--quick draws no scene and runs no example. --report says where a site of `fclib report` is served:
the pages of families and solvers then link to theirs in it. --versions names the folders beside OUT
that have the sites of other versions: each page then links to them.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import c_api
import commands
import examples
import families
import python_api
import ranking
import results
import solvers
from sphinx.cmd.build import main as sphinx

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
AS_THEY_ARE = {
    "README.md": "index.md",
    "ARCHITECTURE.md": "architecture.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "CHANGELOG.md": "changelog.md",
}
SCORER = "scorer.js"
MODULE = ROOT / "build" / "wasm" / "fclib"
MODULE_FILES = ("fclib.js", "fclib-core.mjs", "fclib-core.wasm")
# the menu; FOLDER/* stands for the generated pages of a folder
MENU = {
    "Start": [
        "installing",
        "tutorial-problem",
        "tutorial-solver",
        "tutorial-robot",
        "tutorial-embed",
        "examples/index",
    ],
    "The problem": ["contact-problem", "mathematics", "format", "analysis", "glossary"],
    "The collection": [
        "collection",
        "family-groups",
        "families/index",
        "families-of-your-own",
        "simulate",
        "recorders",
    ],
    "The solvers": ["choosing", "speed", "auto", "solvers", "solvers/index", "solvers-of-your-own"],
    "The bench": [
        "bench",
        "one-run",
        "measurement",
        "published-runs",
        "published-results",
        "published-2018",
        "report",
    ],
    "Interfaces": [
        "command-line",
        "python",
        "compiled",
        "matlab",
        "embedding",
        "recipes",
        "browser",
        "c-api",
    ],
    "Around it": [
        "comparison",
        "migrating",
        "citing",
        "stability",
        "architecture",
        "decisions",
        "contributing",
        "testing",
        "security",
        "changelog",
    ],
}
STYLE = """\
.content { width: 54em; }
math {
  font-family: "STIX Two Math", "Latin Modern Math", "Cambria Math", "DejaVu Math TeX Gyre", math;
}
div.math { overflow-x: auto; margin: 1em 0; }
div.math math { margin: 0.4em 0; }
article img { max-width: 100%; height: auto; }
article table { font-size: 0.85em; }
article table img { max-width: 30vw; }
article td:first-child code { white-space: nowrap; }
article .align-right { margin: 0 0 1em 1.5em; }
.versions { padding: 0 var(--sidebar-item-spacing-horizontal); font-size: 0.85em; }
.contact-pictures { display: flex; flex-wrap: wrap; gap: 0.5em; }
.contact-pictures svg { flex: 1 1 18em; min-width: 0; max-width: 40em; cursor: default; }
.contact-pictures svg[tabindex] { cursor: grab; }
.contact-sliders {
  display: grid; gap: 0.3em 1.5em; grid-template-columns: repeat(auto-fill, minmax(14em, 1fr));
}
.contact-sliders label { display: grid; font-size: 0.85em; }
.contact-says { font-size: 0.85em; opacity: 0.85; }
@media (max-width: 46em) {
  article .align-right { float: none; margin: 1em 0; }
  article table:has(img) td:last-child { min-width: 14em; }
  article table:has(td:nth-child(4)) { width: max-content; max-width: none; }
  article table:has(td:nth-child(4)) td { max-width: 13em; }
}
"""


def pages(quick: bool, report: str) -> Iterator[tuple[str, str | bytes]]:
    """Every page and picture that docs/ does not have, by its path."""
    for source, page in AS_THEY_ARE.items():
        yield page, (ROOT / source).read_text(encoding="utf-8")
    yield "_static/site.css", STYLE
    yield from figures()
    yield from families.pages(draws=not quick, report=report)
    yield from solvers.pages(ROOT, report)
    yield from commands.pages()
    yield from python_api.pages()
    yield from c_api.pages(ROOT)
    yield from examples.pages(ROOT, runs=not quick)


def figures() -> Iterator[tuple[str, str | bytes]]:
    """What solves on docs/contact-problem.md, if `make wasm` has built the module for it."""
    script = (HERE / "assets" / "contact.js").read_text(encoding="utf-8")
    if all((MODULE / name).is_file() for name in MODULE_FILES):
        script = script.replace("const BUILT = false", "const BUILT = true")
        for name in MODULE_FILES:
            yield f"_static/browser/{name}", (MODULE / name).read_bytes()
    else:
        print("docs/contact-problem.md has pictures alone: make wasm makes its figures move")
    yield "_static/contact.js", script


def gather(folder: Path, quick: bool, report: str) -> None:
    """Bring all sources into a folder."""
    shutil.copytree(ROOT / "docs", folder, dirs_exist_ok=True)
    for name, content in pages(quick, report):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            path.write_text(content, encoding="utf-8")
    tables = results.Results(folder / "results")
    texts = []
    for path in sorted(folder.rglob("*.md")):
        name = path.relative_to(folder).as_posix()
        text = path.read_text(encoding="utf-8")
        try:
            text = tables.put_into(text)
        except ValueError as error:
            sys.exit(f"{name}: {error}")
        text = linked(text, "../" * name.count("/"))
        if name == "index.md":
            text += "".join(toctree(entries, title) for title, entries in MENU.items())
        elif name.endswith("/index.md"):
            below = sorted(p.stem for p in path.parent.glob("*.md") if p != path)
            text += toctree(below)
        path.write_text(text, encoding="utf-8")
        texts.append((name.removesuffix(".md"), text))
    (folder / SCORER).write_text(ranking.script(texts), encoding="utf-8")


def toctree(entries: list[str], title: str = "") -> str:
    """A part of the menu."""
    caption = f":caption: {title}\n" if title else ""
    return f"\n```{{toctree}}\n:hidden:\n{caption}\n" + "\n".join(entries) + "\n```\n"


def linked(text: str, up: str) -> str:
    """The text with the names of pages, as `docs/NAME.md`, as links; not in code."""
    parts = re.split(r"(^```.*?^```$|^(?:    [^\n]*\n)+)", text, flags=re.MULTILINE | re.DOTALL)
    return "".join(part if k % 2 else with_links(part, up) for k, part in enumerate(parts))


def with_links(text: str, up: str) -> str:
    """A part of a text that is no code."""
    text = re.sub(r'(?<=src=")docs/|(?<=\]\()docs/', "", text)
    text = re.sub(r"`?(?<![\w/])(?<!\]\()docs/([\w-]+)\.md`?", rf"[\1]({up}\1.md)", text)
    for source, page in AS_THEY_ARE.items():
        if source != "README.md":
            text = re.sub(
                rf"(?<![\w/\[])(?<!\]\()`?{source}`?(?!\w|\]\()", f"[{source}]({up}{page})", text
            )
    return text


def main(out: Path, quick: bool, report: str, versions: str) -> int:
    """Build in the place of what an earlier build left; the exit status of Sphinx."""
    if (out / ".buildinfo").is_file():
        shutil.rmtree(out)
    elif out.exists() and any(out.iterdir()):
        sys.exit(f"{out}: is a folder that holds something else than this site; name another one")
    with tempfile.TemporaryDirectory() as folder:
        sources = Path(folder) / "docs"
        gather(sources, quick, report)
        options = ["-b", "html", "-W", "--keep-going", "-q", "-E", "-d", f"{folder}/doctrees"]
        options += ["-c", str(HERE), "-D", f"html_static_path={sources / '_static'}"]
        options += ["-A", f"versions={versions}"]
        options += ["-D", f"html_search_scorer={sources / SCORER}"]
        status = sphinx([*options, str(sources), str(out)])
    if status == 0:
        print(f"{out}/index.html")
    return status


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--report", default="", metavar="ADDRESS")
    parser.add_argument("--versions", default="", metavar="NAME,...")
    chosen = parser.parse_args()
    if chosen.report and "://" not in chosen.report:
        parser.error(f"--report {chosen.report}: is no address, such as https://host/report")
    sys.exit(main(chosen.out, chosen.quick, chosen.report.rstrip("/"), chosen.versions))
