"""Problems by their names: from the package, or from the user's folder, built or fetched there."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, overload

from fclib import _core
from fclib.collections import archives, catalog, known, published
from fclib.collections.build import build

FOLDER = "FCLIB_COLLECTION"  # environment: the folder, instead of the user's cache
FORMS = ("global", "local")
SOURCE = "FCLIB_COLLECTION_URL"  # environment: where published archives lie


def default_folder() -> Path:
    """The folder that FCLIB_COLLECTION names, or one in the user's cache, by version."""
    named = os.environ.get(FOLDER)
    return Path(named) if named else archives.cache_folder() / f"collection-{_core.version}"


def ensure(name: str, folder: Path) -> None:
    """Make SET/FAMILY be there: fetched from FCLIB_COLLECTION_URL, or built; minutes at most.

    Raises:
        VersionError: the folder has another version of it.
    """
    part = folder / name / catalog.FILE
    if part.is_file():
        wanted, found = known.version_of(name), version_in(part)
        # a version of one's own has a name, and no number that could be older
        if found is not None and found.isdecimal() and found != wanted:
            raise published.VersionError(
                f"{part.parent}: holds version {found} of {name}, and the present one is {wanted}:"
                " remove it, or name another folder (FCLIB_COLLECTION); its problems are read from"
                " there by their files, and fclib collection build"
                f" {name} --version {found} makes them where that version is stored"
            )
        return
    source = os.environ.get(SOURCE)
    if source:
        archives.get([name], source, folder)
    else:
        build([known.plan_of(name)], folder, pictures=False)


def folders_in(folder: Path, name: str) -> list[str]:
    """The folders SET/FAMILY that a collection has of a set, or a family in one, of one's own."""
    if name.split("/")[0] in known.sets() or not re.fullmatch(r"[\w.-]+(/[\w.-]+)?", name):
        return []
    pattern = name if "/" in name else f"{name}/*"
    return [
        part.parent.relative_to(folder).as_posix()
        for part in sorted(folder.glob(f"{pattern}/{catalog.FILE}"))
    ]


def version_in(part: Path) -> str | None:
    """The version of a family's part of a catalogue; None where it has none or no problem."""
    found: list[str | None] = catalog.read_catalog(part)["version"].to_pylist()
    return found[0] if found else None


class Collection(Sequence[Any]):
    """The problems of a set or a family, in the order of their names; read when asked for.

    >>> problems = fclib.collection("rt444")
    >>> problems[0], problems["rt444/KaplasTower/0100"]
    >>> problems.catalog.to_pandas()
    """

    def __init__(self, name: str = "rt444", folder: str | Path | None = None) -> None:
        """KeyError, with the known names, where there is no such set or family."""
        self.name = name
        own = folders_in(Path(folder) if folder is not None else default_folder(), name)
        self.folders = own or known.folders([name])
        shipped = all(own.split("/")[0] in known.SHIPPED for own in self.folders)
        if shipped:
            self.folder = known.DATA
        else:
            self.folder = Path(folder) if folder is not None else default_folder()
        self._catalog: Any = None

    def __repr__(self) -> str:
        return f"Collection({self.name!r}, {str(self.folder)!r})"

    @property
    def catalog(self) -> Any:
        """The rows of these problems (pyarrow.Table); builds what is not there.

        Raises:
            ImportError: pyarrow or MuJoCo is missing.
            OSError: the folder cannot be written, or the archive not fetched.
        """
        if self._catalog is None:
            pa = catalog.arrow()
            tables = []
            for own in self.folders:
                ensure(own, self.folder)
                tables.append(catalog.read_catalog(self.folder / own))
            self._catalog = pa.concat_tables(
                [table.replace_schema_metadata(None) for table in tables], promote_options="default"
            )
        return self._catalog

    @property
    def ids(self) -> list[str]:
        """The names of the problems."""
        names: list[str] = self.catalog["id"].to_pylist()
        return names

    def path(self, which: int | str, form: str | None = None) -> Path:
        """The file of a problem, by its place or its name. IndexError, KeyError.

        The form is "global" or "local"; by default the global one of a problem that has both.
        """
        ids = self.ids
        if isinstance(which, str):
            if which not in ids:
                raise KeyError(f"{self.name} has no problem {which!r}; the first is {ids[0]!r}")
            which = ids.index(which)
        for name in (form,) if form else FORMS:
            file: str | None = self.catalog[f"{name}_file"][which].as_py()
            if file is not None:
                return self.folder / file
        raise KeyError(f"the {form} form of {ids[which]} was not built, or it has none")

    def solution(self, which: int | str, form: str | None = None) -> _core.Solution | None:
        """The stored solution of a problem."""
        return _core.read_solution(self.path(which, form))

    def __len__(self) -> int:
        return len(self.ids)

    @overload
    def __getitem__(self, which: int | str) -> Any: ...

    @overload
    def __getitem__(self, which: slice) -> list[Any]: ...

    def __getitem__(self, which: int | str | slice) -> Any:
        """The global form, or the only one, of a problem, by its place or its name."""
        if isinstance(which, slice):
            return [self[i] for i in range(*which.indices(len(self)))]
        return _core.read(self.path(which))


def load(name: str, form: str | None = None, folder: str | Path | None = None) -> Any:
    """One problem by its name, as ``"rt444/KaplasTower/0100"``.

    Args:
        name: SET/FAMILY/NUMBER.
        form: "global" or "local"; by default the global one of a problem that has both.
        folder: where the collection lies; by default the user's cache.

    Raises:
        KeyError: there is no such problem; VersionError, which is one: the folder has it in another
            version than the present one.
        ValueError: a form that is neither.
    """
    if form not in (None, *FORMS):
        raise ValueError(f'the form is "global" or "local", not {form!r}')
    parts = name.split("/")
    if len(parts) != 3:
        raise KeyError(f"a problem is named SET/FAMILY/NUMBER, not {name!r}")
    if parts[0] in known.SHIPPED:
        # needs nothing that reads catalogues
        for own in (form,) if form else FORMS:
            path = known.DATA / f"{name}-{own}.hdf5"
            if path.is_file():
                return _core.read(path)
    older = older_versions(name)
    if older:
        raise published.VersionError(
            f"{name}: the present version of {parts[0]} has no such problem, version {older[-1]}"
            f" had: fclib collection build {parts[0]} --version {older[-1]} makes its files"
        )
    return _core.read(Collection(f"{parts[0]}/{parts[1]}", folder).path(name, form))


def older_versions(name: str) -> list[str]:
    """The stored versions of a list that have a problem, where the present one has it not."""
    own, _, number = name.rpartition("/")
    listed = known.choices(own.partition("/")[0])
    if not listed or not number.isdecimal():
        return []
    there = any(f"{own.partition('/')[0]}/{c.family}/{c.number:04d}" == name for c in listed)
    return [] if there else published.versions_with(own, int(number))
