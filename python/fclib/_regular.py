"""A check of files that a user names, before they are read: a device or a pipe may have no end."""

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
