"""Files that are written whole or not at all."""

from __future__ import annotations

import errno
import importlib
import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fclib import _files


def test_a_failed_write_leaves_the_old_file_and_no_part(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    _files.write_csv(path, ["a", "b"], [(1, "x"), (2, "y")])
    assert path.read_text() == "a,b\n1,x\n2,y\n"

    def full(beside: Path) -> None:
        beside.write_text("half of")
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OSError, match="No space left on device") as caught:
        _files.replace_file(path, full)
    assert caught.value.filename == str(path)
    assert path.read_text() == "a,b\n1,x\n2,y\n"
    assert list(tmp_path.iterdir()) == [path]


def test_a_new_file_has_the_mode_that_the_user_wants(tmp_path: Path) -> None:
    before = os.umask(0o077)
    try:
        _files.write_text(tmp_path / "private.html", "")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "private.html").stat().st_mode) == 0o600


def test_an_error_names_the_file_and_not_its_part(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as caught:
        _files.write_text(tmp_path / "no" / "page.html", "")
    assert caught.value.filename == str(tmp_path / "no" / "page.html")
    with pytest.raises(IsADirectoryError) as folder:
        _files.write_text(tmp_path, "")
    assert folder.value.filename == str(tmp_path)
    assert not list(tmp_path.iterdir())


def test_what_is_no_plain_file_stays_what_it_is() -> None:
    null = Path("/dev/null")
    _files.write_text(null, "nothing")
    assert stat.S_ISCHR(null.stat().st_mode)


def test_an_open_file_is_not_replaced(tmp_path: Path) -> None:
    """A link like /dev/stdout stays one, though what it leads to is a plain file."""
    if not Path("/proc/self/fd").is_dir():
        pytest.skip("there is no /proc here")
    with (tmp_path / "page.html").open("w") as file:
        link = tmp_path / "stdout"
        link.symlink_to(f"/proc/self/fd/{file.fileno()}")
        assert link.is_file()
        assert _files.is_open_or_device(link)
        _files.write_text(link, "a page")
        assert link.is_symlink()
    assert (tmp_path / "page.html").read_text() == "a page"
    assert not _files.is_open_or_device(tmp_path / "page.html")
    assert not _files.is_open_or_device(tmp_path / "none.html")


# ---- pictures


def full(path: Any, *_: Any, **__: Any) -> None:
    """Write half of a file onto a full disk."""
    Path(path).write_text("half of")
    raise OSError(errno.ENOSPC, "No space left on device")


def scene(path: Path, patch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco")
    from fclib import scenes, simulate

    module = importlib.import_module("fclib.simulate.render")
    # what a renderer would draw
    patch.setattr(module, "draw", lambda *_: np.zeros((20, 20, 3), np.uint8))
    model = simulate.MujocoModel(scenes.get("BoxesStack")(boxes=1).scene())
    written = Path.write_bytes
    patch.setattr(Path, "write_bytes", full)
    try:
        simulate.render(model, path, size=(10, 10))
    finally:
        patch.setattr(Path, "write_bytes", written)


def distribution(path: Path, patch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    from fclib.collections import figures

    patch.setattr("matplotlib.figure.Figure.savefig", lambda _, *given, **__: full(*given))
    figures.draw_distribution([{"nc": 1, "n": 6, "density": 0.5}], path.parent, "one")


def matrix(path: Path, patch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("PIL")
    from fclib.report import picture

    patch.setattr("PIL.Image.Image.save", lambda _, *given, **__: full(*given))
    picture.draw_matrix(np.eye(3), path)


@pytest.mark.parametrize("draw", [scene, distribution, matrix])
def test_a_picture_that_cannot_be_written_leaves_the_old_one(
    draw: Callable[[Path, pytest.MonkeyPatch], None],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = tmp_path / "distribution.png"
    path.write_text("the old one")
    with pytest.raises(OSError, match="No space left on device"):
        draw(path, monkeypatch)
    assert path.read_text() == "the old one"
    assert list(tmp_path.iterdir()) == [path]
