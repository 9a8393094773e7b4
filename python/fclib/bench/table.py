"""Runs in columns: a million runs need arrays, not a dict each.

A column of numbers is a float64 array, nan if a value is missing; `solved` is an array of bool,
`run` one of int64. A column of texts is `Words`, which stores each text once.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import Any, TypeAlias, overload

import numpy as np
import numpy.typing as npt

# columns of whole numbers
WHOLE = frozenset(
    (
        *("run", "spacedim", "n", "p", "nc", "nnz", "threads", "repeat", "solved", "iterations"),
        *("copy", "step", "guess", "warm", "pinned", "cores"),
    )
)
# columns that are texts even if no row has one
TEXTS = frozenset(
    (
        *("key", "campaign", "problem", "family", "formulation", "title", "hash", "solver"),
        *("solver_name", "options", "version", "solver_family", "origin", "about", "merit"),
        *("status", "message", "start", "sequence", "stages", "measured", "node", "cpu", "machine"),
        "path",
    )
)
Text: TypeAlias = str | None
Chosen: TypeAlias = npt.NDArray[np.bool_] | npt.NDArray[np.int64] | slice


@dataclass(frozen=True, eq=False)
class Words:
    """A column of texts, each stored once: row k has ``values[codes[k]]``."""

    values: npt.NDArray[np.object_]  # distinct; None is one of them if a row has no text
    codes: npt.NDArray[np.int64]

    @classmethod
    def of_texts(cls, texts: Iterable[Text]) -> Words:
        """The column of these texts."""
        places: dict[Text, int] = {}
        codes = [places.setdefault(text, len(places)) for text in texts]
        return cls(_objects(places), np.array(codes, dtype=np.int64))

    def __len__(self) -> int:
        return len(self.codes)

    @overload
    def __getitem__(self, chosen: int) -> Text: ...
    @overload
    def __getitem__(self, chosen: Chosen) -> Words: ...
    def __getitem__(self, chosen: int | Chosen) -> Text | Words:
        if isinstance(chosen, (int, np.integer)):
            found: Text = self.values[self.codes[chosen]]
            return found
        return Words(self.values, self.codes[chosen])

    def __eq__(self, text: object) -> npt.NDArray[np.bool_]:  # type: ignore[override]
        """Which rows have this text."""
        return self.is_in([text])

    def __ne__(self, text: object) -> npt.NDArray[np.bool_]:  # type: ignore[override]
        return ~self.is_in([text])

    __hash__ = None  # type: ignore[assignment]

    def is_in(self, texts: Iterable[Any]) -> npt.NDArray[np.bool_]:
        """Which rows have one of these texts."""
        wanted = texts if isinstance(texts, (AbstractSet, Mapping)) else set(texts)
        found = np.array([value in wanted for value in self.values], dtype=bool)
        return np.asarray(found[self.codes]) if len(found) else np.zeros(len(self), bool)

    def present(self) -> list[Text]:
        """The texts that occur, sorted; None is last."""
        found = [self.values[k] for k in np.unique(self.codes)]
        return sorted(found, key=lambda text: (text is None, text or ""))

    def tolist(self) -> list[Text]:
        """The text of each row."""
        return list(self.values[self.codes]) if len(self) else []

    def map(self, function: Callable[[Text], Text]) -> Words:
        """The column with each text replaced by another."""
        new = Words.of_texts(map(function, self.values))
        return Words(new.values, new.codes[self.codes] if len(self) else self.codes)


Column: TypeAlias = npt.NDArray[Any] | Words


class Table:
    """Runs, a row each, in columns. Iterating gives dicts, one after another, which is slow."""

    def __init__(self, columns: Mapping[str, Column]) -> None:
        """Raises ValueError if the columns differ in length."""
        self._columns = dict(columns)
        lengths = {len(column) for column in self._columns.values()}
        if len(lengths) > 1:
            raise ValueError(f"the columns of a table have different lengths: {sorted(lengths)}")
        self._length = lengths.pop() if lengths else 0

    @classmethod
    def of_rows(cls, rows: Iterable[Mapping[str, Any]]) -> Table:
        """The table of rows with the same keys; a column with any text becomes one of texts."""
        rows = list(rows)
        found: dict[str, Column] = {}
        for name in rows[0] if rows else ():
            values = [row[name] for row in rows]
            if name in TEXTS or any(isinstance(value, str) for value in values):
                found[name] = Words.of_texts(values)
            else:
                found[name] = numbers_of(name, values)
        return cls(found)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the columns."""
        return tuple(self._columns)

    def __contains__(self, name: object) -> bool:
        return name in self._columns

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, which: str | int | slice) -> Any:
        """A column by its name, a row by its place, or a table of several rows."""
        if isinstance(which, str):
            return self._columns[which]
        return self.where(which) if isinstance(which, slice) else self.row(which)

    def where(self, chosen: Chosen | Sequence[int]) -> Table:
        """The table of some rows: a mask, or their places in any order."""
        places: Any = chosen if isinstance(chosen, slice) else np.asarray(chosen)
        if not isinstance(places, slice) and not places.size:
            places = places.astype(np.int64 if places.dtype != bool else bool)
        return Table({name: column[places] for name, column in self._columns.items()})

    def with_columns(self, **columns: Column) -> Table:
        """The table with columns added, or replaced."""
        return Table({**self._columns, **columns})

    def numbers(self, *names: str) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """A number for each row; rows that agree in all these columns have the same.

        Returns:
            The numbers, in the order of their first appearance, and the first row of each number.
        """
        number = np.zeros(len(self), dtype=np.int64)
        for name in names:
            column = self._columns[name]
            if isinstance(column, Words):
                codes, count = column.codes, len(column.values)
            else:
                values, codes = np.unique(column, return_inverse=True)
                count = len(values)
            number = number * count + codes.reshape(-1)
            # renumbered from 0, so that no product overflows
            number = np.unique(number, return_inverse=True)[1].reshape(-1)
        _, first, number = np.unique(number, return_index=True, return_inverse=True)
        order = np.argsort(first, kind="stable")
        rank = np.empty(len(order), dtype=np.int64)
        rank[order] = np.arange(len(order))
        return rank[number.reshape(-1)], first[order]

    def values(self, name: str) -> list[Any]:
        """A column in Python's types: None if a value is missing, whole numbers as int."""
        column = self._columns[name]
        if isinstance(column, Words):
            return column.tolist()
        if name in WHOLE:
            return [None if value != value else int(value) for value in column.tolist()]
        return [None if value != value else value for value in column.tolist()]

    def row(self, k: int) -> dict[str, Any]:
        """A row as a dict: None if a value is missing, whole numbers as int."""
        return next(iter(self.where([k])))

    def __iter__(self) -> Iterator[dict[str, Any]]:
        for values in zip(*map(self.values, self._columns), strict=True):
            yield dict(zip(self._columns, values, strict=True))


def numbers_of(name: str, values: Sequence[Any] | npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The column of numbers of this name; None is nan."""
    found = np.array(values, dtype=np.float64)
    if name == "solved":
        return found > 0  # nan gives False
    return found.astype(np.int64) if name == "run" else found


def object_in(text: str | None) -> dict[str, Any]:
    """The JSON object of a column; an empty one if it is not valid."""
    try:
        found = json.loads(text or "{}")
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _objects(values: Iterable[Any]) -> npt.NDArray[np.object_]:
    texts = list(values)
    found = np.empty(len(texts), dtype=object)
    found[:] = texts
    return found
