"""Tables of docs/results/ in the pages, so that no figure on a page is typed.

    [Table: TITLE](results/NAME.csv)                       a line by itself: the whole table
    [Table: TITLE](results/NAME.csv "columns: A, B; where: C = D")   some columns, some rows
    {{NAME: ROW, COLUMN}}                                  one entry in a sentence

ROW is the entry of the first column. What follows a backtick is left alone.
Outside the site, the first is a link to the table.
"""

from __future__ import annotations

import csv
import json
import re
from functools import cache
from pathlib import Path

# pages outside of docs/ name the way to it
TABLE = re.compile(
    r'^\[Table: ([^\]]+)\]\((?:\.\./\.\./docs/)?results/([\w-]+)\.csv(?: "([^"]*)")?\)$',
    re.MULTILINE,
)
ENTRY = re.compile(r"(?<!`)\{\{([\w-]+): *([^,{}]+), *([^{}]+?) *\}\}")
# columns of these are put to the right
NUMBER = re.compile(r"[-+]?[\d.,]*(?:e[-+]?\d+)?(?: ?%)?")
ABOUT = ("title", "command", "version", "commit", "date", "machine", "note")


class Results:
    """The tables of a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.load = cache(self._load)

    def _load(self, name: str) -> tuple[list[dict[str, str]], dict[str, str]]:
        path = self.folder / f"{name}.csv"
        if not path.is_file():
            raise ValueError(
                f"{path}: no such table; a script of workshop/ makes it (--results {name})"
            )
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        about = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
        if missing := [key for key in ABOUT if key not in about]:
            raise ValueError(f"{path.with_suffix('.json')}: has no {', '.join(missing)}")
        return rows, about

    def entry(self, name: str, row: str, column: str) -> str:
        """One entry, by the first column and the title of another."""
        rows, _ = self.load(name)
        first = next(iter(rows[0]))
        found = [r for r in rows if r[first] == row]
        if len(found) != 1 or column not in rows[0]:
            raise ValueError(
                f"{name}.csv has {len(found)} rows {row!r} in its column {first!r} and the columns "
                f"{', '.join(rows[0])}; asked for {row!r}, {column!r}"
            )
        return found[0][column]

    def table(self, title: str, name: str, choice: str) -> str:
        """A table as Markdown, and under it what made it."""
        rows, about = self.load(name)
        columns = list(rows[0])
        for part in filter(None, (part.strip() for part in choice.split(";"))):
            key, _, value = part.partition(":")
            if key == "columns":
                columns = [column.strip() for column in value.split(",")]
                if wrong := [column for column in columns if column not in rows[0]]:
                    raise ValueError(f"{name}.csv has no column {', '.join(wrong)}")
            elif key == "where":
                column, _, wanted = (word.strip() for word in value.partition("="))
                if column not in rows[0]:
                    raise ValueError(f"{name}.csv has no column {column}")
                rows = [row for row in rows if row[column] == wanted]
                if not rows:
                    raise ValueError(f"{name}.csv has no row with {value.strip()}")
            else:
                raise ValueError(f"{name}.csv: columns or where, not {part!r}")
        rules = (
            "---:|" if all(NUMBER.fullmatch(row[c]) for row in rows) else "---|" for c in columns
        )
        lines = ["| " + " | ".join(columns) + " |", "|" + "".join(rules)]
        lines += [
            "| " + " | ".join(row[column].replace("|", "\\|") for column in columns) + " |"
            for row in rows
        ]
        note = f" {about['note']}" if about["note"] else ""
        made = (
            f"*{title}.{note} Made by* `{about['command']}`, *fclib {about['version']} "
            f"({about['commit']}), {about['date']}, {about['machine']}:* "
            f"[{name}.csv](results/{name}.csv)"
        )
        return "\n".join([*lines, "", made])

    def put_into(self, text: str) -> str:
        """A page with its tables and entries."""
        text = TABLE.sub(lambda m: self.table(m[1], m[2], m[3] or ""), text)
        return ENTRY.sub(lambda m: self.entry(m[1], m[2].strip(), m[3]), text)
