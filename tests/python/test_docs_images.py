"""Every picture of the documentation is made by a command, and each family has one."""

import re
from pathlib import Path

import numpy as np
import pytest

from fclib.collections import families
from helpers import script
from helpers_report import skip_without_libraries

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")
skip_without_libraries()
pytest.importorskip("PIL")
ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
images = script("scripts/docs_images.py")


def test_every_picture_is_made_by_the_script_and_shown() -> None:
    there = {path.stem for path in (DOCS / "images").iterdir()}
    # those of the published runs are made with their page, by workshop.tables.published
    published = {name for name in there if name.startswith("published-")}
    assert there == set(images.names()) | published
    text = "".join(path.read_text(encoding="utf-8") for path in [*DOCS.glob("*.md")])
    text += (ROOT / "README.md").read_text(encoding="utf-8")
    assert there == set(re.findall(r"images/([\w-]+)\.png", text))


def test_every_family_is_on_a_sheet() -> None:
    shown = [name for sets in images.GROUPS.values() for name in images.of_group(sets)]
    assert len(shown) == len(set(shown))
    known = families()
    assert set(shown) | set(images.LIKE) == set(known)
    for name, other in images.LIKE.items():
        assert other in shown, name


def test_a_sheet_is_drawn(tmp_path: Path) -> None:
    from PIL import Image

    images.sheet(("masonry",), tmp_path / "sheet.png")
    drawn = Image.open(tmp_path / "sheet.png").convert("RGB")
    wide, tall = images.TILE[0], images.TILE[1] + images.CAPTION
    assert drawn.size == (wide * 4, tall)
    for k in range(4):
        tile = drawn.crop((k * wide, 0, (k + 1) * wide, images.TILE[1]))
        assert len(np.unique(np.asarray(tile).reshape(-1, 3), axis=0)) > 10
