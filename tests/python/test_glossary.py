"""The glossary: every term once, and its names in the code are there."""

import importlib
import re
from pathlib import Path

import pytest

from fclib import _core


@pytest.fixture(scope="module")
def rows(root: Path) -> list[list[str]]:
    """Term, symbol, meaning, name in the code and source of each row."""
    lines = (root / "docs" / "glossary.md").read_text(encoding="utf-8").splitlines()
    cells = [[c.strip() for c in x.strip("|").split("|")] for x in lines if x.startswith("| ")]
    found = [row for row in cells if row[0] != "term"]
    assert len(found) > 80
    return found


def exists(name: str) -> bool:
    """Whether a dotted name is that of a module, or of something in one."""
    found = importlib.import_module("fclib")
    parts = name.split(".")[1:]
    for k, part in enumerate(parts, start=1):
        if not hasattr(found, part):
            try:
                importlib.import_module(".".join(["fclib", *parts[:k]]))
            except ModuleNotFoundError:
                return False
        found = getattr(found, part)
    return True


def test_every_term_stands_once(rows: list[list[str]]) -> None:
    terms = [row[0] for row in rows]
    assert all(terms)
    assert sorted(set(terms)) == sorted(terms)
    assert not [row for row in rows if len(row) != 5 or not row[2]]


def test_names_in_the_code_are_there(rows: list[list[str]]) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("pyarrow")
    names = [name for row in rows for name in re.findall(r"`(fclib\.[\w.]+)`", row[3])]
    assert len(names) > 30
    assert not [name for name in names if not exists(name)]
    assert not exists("fclib.bench.keeper")


def test_every_solver_of_the_core_has_its_term(rows: list[list[str]]) -> None:
    named = {name for row in rows for name in re.findall(r"`([\w-]+)`", row[3])}
    assert {info.name for info in _core.solvers()} <= named
