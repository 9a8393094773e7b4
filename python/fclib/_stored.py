"""Where packages of data are: installed beside this one, or in their places in a checkout."""

from __future__ import annotations

import importlib.util
from pathlib import Path

COLLECTION = "fclib_collection"  # of stored states
RESULTS = "fclib_results"  # of published runs
CHECKOUT = Path(__file__).resolve().parents[2]


def folder_of(package: str, in_place: Path) -> Path | None:
    """The folder of a package of data; None if it is not there.

    Args:
        package: its name.
        in_place: its folder in a checkout, which counts first.
    """
    if in_place.is_dir():
        return in_place
    spec = importlib.util.find_spec(package)
    if spec is None or spec.origin is None:
        return None
    return Path(spec.origin).parent


def published_runs() -> Path | None:
    """The folder of the parts of published runs; None if their package is not there."""
    package = folder_of(RESULTS, CHECKOUT / "results" / RESULTS)
    return package / "runs" if package is not None else None
