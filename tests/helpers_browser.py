"""Chromium for tests of pages: without windows where there is such a one."""

import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

# the shell draws pages alone: a page costs it a quarter of what it costs the whole browser
NAMES = ("chromium-headless-shell", "chromium", "chromium-browser")


@contextmanager
def chromium() -> Iterator[Any]:
    """The first Chromium that starts: Playwright's own, or one of the system. Skips without one."""
    api = pytest.importorskip("playwright.sync_api")
    with api.sync_playwright() as playwright:
        for path in (None, *filter(None, map(shutil.which, NAMES))):
            try:
                opened = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
            except api.Error:
                continue
            yield opened
            opened.close()
            return
        pytest.skip("there is no Chromium: apt install chromium, or playwright install chromium")


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """The address of a folder, as `fclib report --serve` serves one."""
    from fclib.report import serving

    with serving.server(folder) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/"
        finally:
            server.shutdown()


def colours(picture: Any) -> int:
    """How many colours a picture of bytes, (rows, columns, 3), has: each as one whole number.

    `np.unique` of rows compares them byte by byte: 3 s for the picture of a desk.
    """
    return len(np.unique(np.asarray(picture, dtype=np.int32) @ np.array([1 << 16, 1 << 8, 1])))
