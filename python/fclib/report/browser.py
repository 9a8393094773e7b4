"""The core as a module for browsers, in a site: its pages check and solve what they show.

`make wasm` builds the module (docs/browser.md); a site carries a copy of it.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from fclib.report.error import ReportError

BUILT = Path(__file__).parents[3] / "build" / "wasm" / "fclib"  # in a checkout
PLACE = "assets/browser"  # in a site
FILES = (
    *("fclib.js", "fclib-worker.js", "fclib-core.mjs", "fclib-core.wasm"),
    *("fclib-hdf5.js", "fclib-layout.js", "hdf5_hl.js", "hdf5_util.js", "licences/h5wasm.txt"),
)
# text of the page about the site on the parts of the module
READER = {
    "name": "h5wasm",
    "version": "",
    "licence": "NIST",
    "package": "the module for browsers",
    "purpose": "reading HDF5 files",
    "text": f"{PLACE}/licences/h5wasm.txt",
}


def find(folder: Path | None) -> Path | None:
    """The module's folder: the one named, or a checkout's; None if none is built.

    Raises:
        ReportError: the folder named is not the module's.
    """
    missing = [name for name in FILES if not ((folder or BUILT) / name).is_file()]
    if folder is not None and missing:
        raise ReportError(f"{folder}: has no {missing[0]}; make wasm builds such a folder")
    return None if missing else folder or BUILT


def size(module: Path) -> int:
    """The size that a page loads of it, in bytes."""
    return sum((module / name).stat().st_size for name in FILES)


def copy(module: Path, site: Path) -> int:
    """Put the module into a site, and return its size."""
    for name in FILES:
        target = site / PLACE / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(module / name, target)
    return size(module)
