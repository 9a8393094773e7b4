"""The trajectories that are published: a file for each version of a family, never rewritten.

    SET/FAMILY-VERSION.trajectory

They lie in the package `fclib-collection`, installed beside this one, or in `collection/` of a
checkout. Versions are counted 1, 2, ...; without a version the newest one is used.
"""

from __future__ import annotations

import functools
from pathlib import Path

from fclib import _stored
from fclib.collections import trajectory

PACKAGE = _stored.COLLECTION
IN_PLACE = _stored.CHECKOUT / "collection" / PACKAGE
FOLDER = "trajectories"


class VersionError(KeyError):
    """The version of a problem is not the one asked for, or is not stored here."""

    def __str__(self) -> str:
        return str(self.args[0])


def root() -> Path | None:
    """The folder of the published trajectories; None if the package is not installed."""
    package = _stored.folder_of(PACKAGE, IN_PLACE)
    return package / FOLDER if package is not None else None


def folders(name: str) -> list[str]:
    """The folders SET/FAMILY of a set that have any stored version."""
    base = root()
    found = sorted((base / name).glob(f"*-*{trajectory.SUFFIX}")) if base is not None else []
    return list(dict.fromkeys(f"{name}/{path.stem.rpartition('-')[0]}" for path in found))


def versions(folder: str) -> list[str]:
    """The stored versions of SET/FAMILY, the oldest first."""
    base = root()
    name, _, family = folder.partition("/")
    if base is None or not family:
        return []
    found = [
        path.stem.removeprefix(f"{family}-")
        for path in (base / name).glob(f"{family}-*{trajectory.SUFFIX}")
    ]
    return sorted((version for version in found if version.isdecimal()), key=int)


def path_of(folder: str, version: str) -> Path | None:
    """The file of a version of SET/FAMILY; None if it is not stored here."""
    base = root()
    return base / file_name(folder, version) if version in versions(folder) and base else None


def file_name(folder: str, version: str) -> str:
    """The file of a version of SET/FAMILY, below a folder of trajectories."""
    return f"{folder}-{version}{trajectory.SUFFIX}"


def digests(folder: str, version: str) -> dict[int, str]:
    """The digest of each problem of a version of SET/FAMILY; empty if it is not stored here."""
    path = path_of(folder, version)
    return _digests(path) if path is not None else {}


def versions_with(folder: str, number: int) -> list[str]:
    """The stored versions of SET/FAMILY that have a problem, the oldest first."""
    return [one for one in versions(folder) if number in digests(folder, one)]


def seed(folder: str, version: str) -> int | None:
    """The seed of the scene of a version that is stored here."""
    path = path_of(folder, version)
    return _origin(path)[0].seed if path is not None else None


_digests = functools.lru_cache(maxsize=64)(trajectory.read_digests)
_origin = functools.lru_cache(maxsize=64)(trajectory.read_origin)
