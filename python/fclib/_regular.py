"""Files that a user names, before they are read: a device or a pipe may have no end."""

from __future__ import annotations

import errno
import os
from pathlib import Path


def regular(path: str | os.PathLike[str]) -> Path:
    """The path. OSError if it is there, and neither a file nor a folder."""
    found = Path(path)
    if found.exists() and not found.is_file() and not found.is_dir():
        raise OSError(errno.EINVAL, "is no regular file", os.fspath(path))
    return found


def resolved(path: str | os.PathLike[str]) -> Path:
    """The path without symbolic links; one that leads to itself stays, and no file is there."""
    # Path.resolve raises RuntimeError for such a link, before Python 3.13
    return Path(os.path.realpath(path))


def reason_of(error: Exception) -> str:
    """The first line of an error of reading, without its number and the file."""
    words = error.strerror if isinstance(error, OSError) else None
    return (words or str(error)).splitlines()[0]
