"""Files that are written whole or not at all."""

from __future__ import annotations

import csv
import errno
import os
import secrets
import stat
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def replace_file(path: Path, write: Callable[[Path], object]) -> None:
    """Call `write` with the path of a new file beside `path`, which then takes its place.

    What is no plain file, such as /dev/stdout, is written as it is. OSError, which names `path`:
    also for a pipe that nothing reads, which would wait for ever.
    """
    if is_open_or_device(path):
        with _held(path):
            write(path)
        return
    beside = None
    try:
        new = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
        new.touch(exist_ok=False)
        beside = new
        mode = beside.stat().st_mode  # as the user's umask says; `write` may copy another one
        write(beside)
        beside.chmod(stat.S_IMODE(mode))
        beside.replace(path)
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        if beside is not None:
            beside.unlink(missing_ok=True)


def is_open_or_device(path: Path) -> bool:
    """Whether no new file can take the place of what is there: a device, or an open file.

    /dev/stdout is one, whatever it leads to: a plain file in its place would be /dev/stdout.
    """
    if not path.exists():
        return False
    places = [path.absolute()]
    if path.is_symlink():
        places.append(path.absolute().parent / path.readlink())
    open_ones = (Path("/proc/self/fd"), Path("/dev/fd"))
    return not path.is_file() or any(place.parent in open_ones for place in places)


@contextmanager
def _held(path: Path) -> Iterator[None]:
    """Keep a pipe open, so that its reader stays. OSError if there is none."""
    if not path.is_fifo():
        yield
        return
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
    except OSError as error:
        if error.errno != errno.ENXIO:
            raise
        raise OSError(errno.ENXIO, "is a pipe that nothing reads", str(path)) from None
    try:
        yield
    finally:
        os.close(descriptor)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file."""
    replace_file(path, lambda beside: beside.write_bytes(content))


def write_text(path: Path, text: str) -> None:
    """Write a text in UTF-8."""
    write_bytes(path, text.encode())


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Iterable[Any]]) -> None:
    """Write a table with one line for each row."""

    def write(beside: Path) -> None:
        with beside.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows(rows)

    replace_file(path, write)
