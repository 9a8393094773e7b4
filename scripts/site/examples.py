"""A page for each script of examples/python, with what it prints and draws."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

# the arguments of those that need some
ARGUMENTS = {"ball": ["ball.hdf5"], "own_solver": ["ball.hdf5"]}
PICTURES = (".png", ".svg")
LIMIT = 120  # of a script [s]


def pages(root: Path, runs: bool) -> Iterator[tuple[str, str | bytes]]:
    """The scripts, in the order in which their index names them."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for script in sorted((root / "examples" / "python").glob("*.py")):
            text = script.read_text(encoding="utf-8")
            title, _, rest = (ast.get_docstring(ast.parse(text)) or "").partition("\n")
            output, pictures = run(script, Path(folder)) if runs else ("", [])
            for picture in pictures:
                yield f"examples/{script.stem}-{picture.name}", picture.read_bytes()
            place = f"({script.stem}-{pictures[0].name})" if pictures else ""
            shown = f"![{script.stem}]{place}{{width=240px}}" if pictures else ""
            what = title.partition(f": {script.name}")[0].rstrip(".")
            rows.append((shown, f"[{what}]({script.stem}.md), `{script.name}`"))
            yield f"examples/{script.stem}.md", page(script, title, rest, output, pictures)
    lines = [
        "# Examples",
        "",
        "Scripts of `examples/python/`, with what they printed when this site ",
    ]
    lines[-1] += "was made; times are of that machine. Those in C, C++ and Fortran are on "
    lines[-1] += "[a page of their own](../compiled.md)."
    # pictures first
    lines += ["", "| | |", "|---|---|"]
    lines += [f"| {' | '.join(row)} |" for row in sorted(rows, key=lambda row: not row[0])]
    yield "examples/index.md", "\n".join(lines) + "\n"


def run(script: Path, folder: Path) -> tuple[str, list[Path]]:
    """What a script prints, and the pictures that it leaves."""
    before = {path: path.stat().st_mtime_ns for path in folder.iterdir()}
    done = subprocess.run(
        [sys.executable, script, *ARGUMENTS.get(script.stem, [])],
        cwd=folder,
        env=os.environ | {"MPLBACKEND": "Agg", "COLUMNS": "100"},
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    if done.returncode != 0:
        raise RuntimeError(f"{script}: ended with {done.returncode}\n{done.stderr}")
    new = [p for p in sorted(folder.iterdir()) if p.stat().st_mtime_ns != before.get(p)]
    return done.stdout, [path for path in new if path.suffix in PICTURES]


def page(script: Path, title: str, rest: str, output: str, pictures: list[Path]) -> str:
    """The script, and what came of it."""
    arguments = " ".join(["", *ARGUMENTS.get(script.stem, [])])
    lines = [f"# {script.name}", "", title, rest, "", "```python"]
    text = script.read_text(encoding="utf-8")
    after = ast.parse(text).body[0].end_lineno or 0  # the docstring stands above
    lines += ["\n".join(text.splitlines()[after:]).strip(), "```", ""]
    lines += ["```sh", f"python examples/python/{script.name}{arguments}", "```", ""]
    if output:
        lines += ["```text", output.rstrip(), "```", ""]
    lines += [f"![{path.stem}]({script.stem}-{path.name})\n" for path in pictures]
    return "\n".join(lines)
