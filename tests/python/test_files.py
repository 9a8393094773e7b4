"""Files that are written whole or not at all."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

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
