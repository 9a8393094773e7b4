"""A name that there is not gets the nearest one that there is."""

import pytest

from fclib import collections, scenes
from fclib._suggest import suggestion


@pytest.mark.parametrize(
    ("name", "nearest"),
    [("Chian", "Chain"), ("chain", "Chain"), ("STANDARD", "standard"), ("qqq", None), ("", None)],
)
def test_the_nearest_name(name: str, nearest: str | None) -> None:
    known = ["Chain", "Chute", "standard"]
    assert suggestion(name, known) == (f"did you mean {nearest}? " if nearest else "")


def test_sets_and_families_are_looked_for_together() -> None:
    with pytest.raises(KeyError, match=r"called 'Chian'; did you mean Chain\? sets: "):
        collections.folders(["Chian"])
    with pytest.raises(KeyError, match=r"called 'standart'; did you mean standard\? sets: "):
        collections.folders(["standart"])
    with pytest.raises(KeyError, match=r"rt444 has no family 'Chian'; did you mean Chain\? it has"):
        collections.folders(["rt444/Chian"])
    with pytest.raises(KeyError, match=r"called 'lowwal'; did you mean LowWall\? there is: "):
        scenes.get("lowwal")
