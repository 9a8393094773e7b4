"""Each tutorial is followed from its first line to its last, in an empty folder.

A block that has a file's name is saved, commands are run by a shell, and each must end with 0.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from capi_library import compiler, library_folder
from doc_blocks import blocks_of, tutorials
from helpers import ran

pytest.importorskip("mujoco")

pytestmark = pytest.mark.slow


def c_library(target: Path) -> dict[str, str]:
    """The environment in which the installed C library is found."""
    compiler("C")
    folder = library_folder()
    install = ["cmake", "--install", str(folder), "--prefix", str(target), "--component"]
    for part in ("library", "development"):
        subprocess.run([*install, part], check=True, stdout=subprocess.DEVNULL)
    (found,) = target.rglob("fclib.pc")
    return {"PKG_CONFIG_PATH": str(found.parent), "LD_LIBRARY_PATH": str(found.parent.parent)}


@pytest.mark.parametrize("page", tutorials(), ids=lambda page: page.stem)
def test_a_tutorial_works_as_it_is_written(page: Path, tmp_path: Path) -> None:
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "FCLIB_CACHE": str(tmp_path / "cache"),
        "MPLBACKEND": "Agg",
    }
    blocks = [block for block in blocks_of(page) if block.runs]
    if any(block.language == "c" for block in blocks):
        environment |= c_library(tmp_path / "prefix")
    folder = tmp_path / "work"
    folder.mkdir()
    text = " ".join(page.read_text(encoding="utf-8").split())
    commands = 0
    for block in blocks:
        if block.file:
            assert f"as `{block.file}`" in text, f"{block}: the reader is not told its name"
            (folder / block.file).write_text(block.code)
            continue
        assert block.language == "sh", f"{block}: neither a file nor commands"
        for line in block.commands():
            done = ran("sh", "-c", line, code=None, cwd=folder, env=environment)
            said = (done.stdout + done.stderr)[-3000:]
            assert done.returncode == 0, f"{block}: {line}\n{said}"
            commands += 1
    assert commands >= 2


def test_there_are_four() -> None:
    assert [page.stem for page in tutorials()] == [
        "tutorial-embed",
        "tutorial-problem",
        "tutorial-robot",
        "tutorial-solver",
    ]
