"""Problems by their names: from the package, or built or fetched into the user's folder."""

from __future__ import annotations

import copy
import importlib
import os
import re
from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from pathlib import Path
from typing import Any, overload

from fclib import _core
from fclib._solve import Problem
from fclib._words import counted
from fclib.collections import archives, catalog, published, set_index
from fclib.collections.build import build

FOLDER = "FCLIB_COLLECTION"  # environment variable: the folder, instead of the user's cache
FORMS = ("global", "local")
SOURCE = "FCLIB_COLLECTION_URL"  # environment variable: address of the published archives


def default_folder() -> Path:
    """The folder that FCLIB_COLLECTION names, or one in the user's cache, by version."""
    named = os.environ.get(FOLDER)
    return Path(named) if named else archives.cache_folder() / f"collection-{_core.version}"


def is_there(name: str, folder: Path) -> bool:
    """Whether SET/FAMILY is built, or was fetched, in a folder."""
    return (folder / name / catalog.FILE).is_file()


def ensure(name: str, folder: Path) -> None:
    """Fetch SET/FAMILY from FCLIB_COLLECTION_URL, or build it, if it is missing; minutes at most.

    Args:
        name: SET/FAMILY.
        folder: of the collection.

    Raises:
        VersionError: the folder has another version of it.
    """
    part = folder / name / catalog.FILE
    if part.is_file():
        wanted, found = set_index.version_of(name), version_in(part)
        # the version of a user's own set is a name, not a number that could be older
        if found is not None and found.isdecimal() and found != wanted:
            raise published.VersionError(
                f"{part.parent}: holds version {found} of {name}, and the present one is {wanted}:"
                " remove it, or name another folder (FCLIB_COLLECTION); its problems are read from"
                " there by their files, and fclib collection build"
                f" {name} --version {found} makes them if that version is stored"
            )
        return
    source = os.environ.get(SOURCE)
    if source:
        archives.get([name], source, folder)
    else:
        build([set_index.plan_of(name)], folder, pictures=False)


def folders_in(folder: Path, name: str) -> list[str]:
    """The folders SET/FAMILY in a collection of the user's own set, or of a family of it."""
    if not re.fullmatch(r"[\w.-]+(/[\w.-]+)?", name):
        return []
    pattern = name if "/" in name else f"{name}/*"
    return [
        part.parent.relative_to(folder).as_posix()
        for part in sorted(folder.glob(f"{pattern}/{catalog.FILE}"))
    ]


def version_in(part: Path) -> str | None:
    """The version of a family's part of a catalogue; None if it has none or no problem."""
    found: list[str | None] = catalog.read_catalog(part)["version"].to_pylist()
    return found[0] if found else None


class Collection(Sequence[Problem]):
    """The problems of a set or a family, in the order of names; each is read on demand.

    >>> problems = fclib.collection("rt444")
    >>> problems[0], problems["rt444/KaplasTower/0100"]
    >>> for problem in problems.filter(family="Chain", nc=(10, 20)):
    ...     print(fclib.solve(problem))
    >>> problems.to_pandas()
    """

    def __init__(self, name: str = "rt444", folder: str | Path | None = None) -> None:
        """If there is no such set or family, a KeyError lists the known names."""
        self.name = name
        # a set in the package needs no module that handles folders
        ours = name.split("/")[0] in set_index.sets()
        own = [] if ours else folders_in(Path(folder) if folder else default_folder(), name)
        self.folders = own or set_index.folders([name])
        shipped = all(own.split("/")[0] in set_index.SHIPPED for own in self.folders)
        if shipped:
            self.folder = set_index.DATA
        else:
            self.folder = Path(folder) if folder is not None else default_folder()
        self._catalog: Any = None
        self._places: dict[str, int] | None = None
        self._filters: tuple[str, ...] = ()

    def __repr__(self) -> str:
        text = f"Collection({self.name!r}, {str(self.folder)!r})"
        return text + "".join(f".filter({one})" for one in self._filters)

    @property
    def catalog(self) -> Any:
        """The rows of these problems (pyarrow.Table); builds missing ones.

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

    def filter(
        self, rows: str | Callable[[Mapping[str, Any]], bool] | None = None, /, **columns: Any
    ) -> Collection:
        """The problems whose rows of the catalogue meet all conditions.

        >>> problems.filter(family="Chain", nc=(10, 20), mu_max=lambda mu: mu < 0.5)
        >>> problems.filter("nc > 1000 and mu < 0.5")
        >>> problems.filter(lambda row: row["slide"] > row["stick"])

        Args:
            rows: a condition in words, as `fclib collection find` takes it; or a function, called
                with each row, as a dict by column.
            columns: the condition on each column: a value; bounds (lowest, highest), None for no
                bound; a list or a set of values; or a function that is true for the values wanted.
                A row without a value is left out, unless None is asked for.

        Raises:
            KeyError: the catalogue has no such column.
            ConditionError: the condition cannot be understood.
        """
        table = self.catalog
        if isinstance(rows, str):
            table = catalog.where(table, rows)
        if unknown := sorted(columns.keys() - set(table.column_names)):
            raise KeyError(
                f"the catalogue of {self.name} has no column {unknown[0]!r}; there are: "
                + ", ".join(table.column_names)
            )
        kept = [True] * table.num_rows
        for name, wanted in columns.items():
            for k, value in enumerate(table[name].to_pylist()):
                kept[k] = kept[k] and is_wanted(value, wanted)
        if callable(rows):
            for k, row in enumerate(table.to_pylist()):
                kept[k] = kept[k] and bool(rows(row))
        found = copy.copy(self)
        found._catalog = table.filter(catalog.arrow().array(kept, "bool"))
        found._places = None
        words = rows if isinstance(rows, str) else getattr(rows, "__name__", "...")
        words = [] if rows is None else [words]
        words += [f"{name}={wanted!r}" for name, wanted in columns.items()]
        found._filters = (*self._filters, ", ".join(words))
        return found

    def to_pandas(self) -> Any:
        """The catalogue as pandas.DataFrame. ImportError if pandas is not installed."""
        installed("pandas")
        return self.catalog.to_pandas()

    def to_polars(self) -> Any:
        """The catalogue as polars.DataFrame. ImportError if polars is not installed."""
        return installed("polars").from_arrow(self.catalog)

    @property
    def ids(self) -> list[str]:
        """The names of the problems."""
        return list(self._place_of())

    def _place_of(self) -> dict[str, int]:
        if self._places is None:
            self._places = {name: k for k, name in enumerate(self.catalog["id"].to_pylist())}
        return self._places

    def path(self, which: int | str, form: str | None = None) -> Path:
        """The file of a problem, by its place or its name. Raises IndexError, KeyError.

        The form is "global" or "local"; by default the global one of a problem that has both.
        """
        if isinstance(which, str):
            places = self._place_of()
            if which not in places:
                first = f"; the first is {next(iter(places))!r}" if places else ": it is empty"
                raise KeyError(f"{self.name} has no problem {which!r}{first}")
            which = places[which]
        if not -len(self) <= which < len(self):
            raise IndexError(
                f"{self!r} has {counted(len(self), 'problem')}, and none of number {which}"
            )
        for name in (form,) if form else FORMS:
            file: str | None = self.catalog[f"{name}_file"][which].as_py()
            if file is not None:
                return self.folder / file
        raise KeyError(f"the {form} form of {self.ids[which]} was not built, or it has none")

    def solution(self, which: int | str, form: str | None = None) -> _core.Solution | None:
        """The stored solution of a problem."""
        return _core.read_solution(self.path(which, form))

    def __len__(self) -> int:
        return len(self._place_of())

    @overload
    def __getitem__(self, which: int | str) -> Problem: ...

    @overload
    def __getitem__(self, which: slice) -> list[Problem]: ...

    def __getitem__(self, which: int | str | slice) -> Problem | list[Problem]:
        """The global form, or the only one, of a problem, by its place or its name."""
        if isinstance(which, slice):
            return [self[i] for i in range(*which.indices(len(self)))]
        return _core.read(self.path(which))


def is_wanted(value: Any, wanted: Any) -> bool:
    """Whether a value meets a condition of Collection.filter."""
    if callable(wanted):
        return value is not None and bool(wanted(value))
    if isinstance(wanted, tuple):
        if len(wanted) != 2:
            raise ValueError(f"bounds are two, (lowest, highest), and a list has values: {wanted}")
        low, high = wanted
        inside = value is not None and (low is None or value >= low)
        return inside and (high is None or value <= high)
    if isinstance(wanted, (list, AbstractSet)):
        return value in wanted
    return bool(value == wanted)


def installed(package: str) -> Any:
    """Import an optional package. Without it an ImportError says what to install."""
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise ImportError(
            f"{package} is not there ({error}); install it with: pip install {package}"
        ) from error


def load(name: str, form: str | None = None, folder: str | Path | None = None) -> Problem:
    """One problem by its name, for example ``"rt444/KaplasTower/0100"``.

    Args:
        name: SET/FAMILY/NUMBER.
        form: "global" or "local"; by default the global one of a problem that has both.
        folder: folder of the collection; by default in the user's cache.

    Raises:
        KeyError: there is no such problem. If the folder has another version of it, the error is a
            VersionError, which is a KeyError.
        ValueError: the form is neither.
    """
    if form not in (None, *FORMS):
        raise ValueError(f'the form is "global" or "local", not {form!r}')
    parts = str(name).split("/")
    if len(parts) != 3:
        raise KeyError(
            f"a problem is named SET/FAMILY/NUMBER, not {str(name)!r}; fclib.read reads a file"
        )
    if parts[0] in set_index.SHIPPED:
        # this needs no module that reads catalogues
        for own in (form,) if form else FORMS:
            path = set_index.DATA / f"{name}-{own}.hdf5"
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
    """The stored versions of a list that have a problem which the present one lacks."""
    own, _, number = name.rpartition("/")
    listed = set_index.choices(own.partition("/")[0])
    if not listed or not number.isdecimal():
        return []
    there = any(f"{own.partition('/')[0]}/{c.family}/{c.number:04d}" == name for c in listed)
    return [] if there else published.versions_with(own, int(number))
