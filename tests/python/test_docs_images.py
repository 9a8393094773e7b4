"""Every picture of the documentation is made by a command, and each family has one."""

import importlib.util
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fclib.collections import families
from helpers_report import skip_without_libraries

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")
skip_without_libraries()
pytest.importorskip("PIL")
ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


@pytest.fixture(scope="module")
def script() -> Any:
    spec = importlib.util.spec_from_file_location(
        "docs_images", ROOT / "scripts" / "docs_images.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["docs_images"] = module  # its dataclasses ask for it
    spec.loader.exec_module(module)
    return module


def test_every_picture_is_made_by_the_script_and_shown(script: Any) -> None:
    there = {path.stem for path in (DOCS / "images").iterdir()}
    # those of the published runs are made with their page, by workshop.tables.published
    published = {name for name in there if name.startswith("published-")}
    assert there == set(script.names()) | published
    text = "".join(path.read_text(encoding="utf-8") for path in [*DOCS.glob("*.md")])
    text += (ROOT / "README.md").read_text(encoding="utf-8")
    assert there == set(re.findall(r"images/([\w-]+)\.png", text))


def test_every_family_is_on_a_sheet(script: Any) -> None:
    shown = [name for sets in script.GROUPS.values() for name in script.of_group(sets)]
    assert len(shown) == len(set(shown))
    known = families()
    assert set(shown) | set(script.LIKE) == set(known)
    for name, other in script.LIKE.items():
        assert other in shown, name


def test_a_sheet_is_drawn(script: Any, tmp_path: Path) -> None:
    from PIL import Image

    script.sheet(("masonry",), tmp_path / "sheet.png")
    drawn = Image.open(tmp_path / "sheet.png").convert("RGB")
    wide, tall = script.TILE[0], script.TILE[1] + script.CAPTION
    assert drawn.size == (wide * 4, tall)
    for k in range(4):
        tile = drawn.crop((k * wide, 0, (k + 1) * wide, script.TILE[1]))
        assert len(np.unique(np.asarray(tile).reshape(-1, 3), axis=0)) > 10
