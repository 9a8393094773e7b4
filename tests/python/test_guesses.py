"""The measurement of stages that start from a guess."""

from __future__ import annotations

import pytest

pytest.importorskip("mujoco")

from workshop.tuning import guesses
from workshop.tuning.choose_auto import name_of, table


def test_changes_of_the_table() -> None:
    lines = table()
    found = {name: apply(lines) for name, apply in guesses.changes(lines)}
    assert found["as it is"] == lines
    guessed = [name_of(line) for line in lines if "guessed=true" in line]
    assert guessed == [guesses.SWEEPS, guesses.NEWTON, guesses.POINT]
    assert len(found["without all of them"]) == len(lines) - len(guessed)
    assert all(rows != lines for name, rows in found.items() if name != "as it is")


def test_a_guess_is_of_the_very_step_before() -> None:
    # the states of this family are several steps apart
    assert list(guesses.steps("rt444/BoxesStack", 752, 2, 1e-4)) == []
    assert len(list(guesses.steps("sequences/FourBar", 0, 2, 1e-4))) == 2


def test_ratios_are_of_families() -> None:
    times = {
        "A": {"": [2.0, 8.0], "as it is": [1.0, 1.0]},  # of its steps 2 and 8: in the mean 4
        "B": {"": [1.0, 1.0], "as it is": [1.0, 1.0]},
    }
    (row,) = guesses.rows_of(times, 1e-6)
    assert row["cold over warm, mean"] == pytest.approx(2.0)
    assert (row["least, of sums"], row["of"]) == (1.0, "B")
