"""Published sets beside a built collection, and the figures of RT-0444, by one command."""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import collections
from fclib.collections.plan import Plan
from workshop.sets import collection_table, differences
from workshop.tables import _results
from workshop.tables import published_beside_ours as script

pytest.importorskip("pyarrow")
FILES = "Local/siconos/BoxesStack"  # as the list of files names the set
PUBLISHED = "BoxesStack"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five problems under the name of a published set."""
    out = tmp_path_factory.mktemp("built")
    family: Any = fclib.scenes.get("BoxesStack")
    pytest.importorskip("mujoco")
    scene = family(boxes=3, gap=2e-3, time_step=5e-3).scene(seed=0)
    plan = Plan(scene=scene, collection="rt444", problems=5, references=False)
    collections.build([plan], out, pictures=False)
    return out


def listed(path: Path, rows: list[tuple[str, object, object, object]]) -> Path:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["set", "file", "nsgs_sweeps", "dof", "contacts", "bytes"])
        for name, *known in rows:
            writer.writerow([name, "x.hdf5", *known, 1])
    return path


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> None:
    monkeypatch.setattr(sys, "argv", ["published_beside_ours.py", *map(str, arguments)])
    script.main()


def cells(text: str) -> list[list[str]]:
    return [[cell.strip() for cell in row.split("|")[1:-1]] for row in text.splitlines()]


def test_ours_stand_under_the_published_files(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    files = listed(
        tmp_path / "files.csv",
        [(FILES, k, "", 4 * k) for k in range(1, 12)] + [("Local/other", 7, 6, "")],
    )
    run(monkeypatch, built, "--files", files, "--sample", 2, "--pictures", tmp_path / "out")
    rows = cells(capsys.readouterr().out)
    second = [row[:2] for row in rows].index(["set", "of"])
    # the figures of the set, and ours under them; then sets that nothing of ours is beside
    shown = {row[0]: dict(zip(rows[0], row, strict=True)) for row in rows[2:second]}
    names = [row[0] for row in rows[:second]]
    # the report has this set too
    for name in (PUBLISHED, f"{PUBLISHED} (RT-0444)"):
        assert names[names.index(f"*{name}*") + 1] == "rt444/BoxesStack"
    assert shown[f"*{PUBLISHED}*"]["dof"] == "6 to 300"
    assert shown["rt444/BoxesStack"]["problems"] == "5"
    assert "contacts" in shown["rt444/BoxesStack"]["within"]
    assert "*Spheres*" in shown
    table = {(row[0], row[1]): row[2:] for row in rows[second + 2 :]}
    # least, 10 %, a quarter, median, three quarters, 90 %, largest
    theirs = ["11", "1", "2", "3", "6", "9", "10", "11"]
    assert table[f"*{PUBLISHED}*", "sweeps"][0] == "11"
    assert table[f"*{PUBLISHED}*", "sweeps"][1::3] == ["1", "6", "11"]
    assert table[f"*{PUBLISHED}*", "contacts"][1::6] == ["4", "44"]
    assert len(table[f"*{PUBLISHED}*", "sweeps"]) == len(theirs)
    rows_of = collections.read_catalog(built).to_pylist()
    contacts = sorted(row["nc"] for row in rows_of)
    ours = table["rt444/BoxesStack", "contacts"]
    assert (ours[0], ours[1], ours[-1]) == ("5", f"{contacts[0]}", f"{contacts[-1]}")
    # the first and the last one were solved
    first, last = (script.sweeps_of(built / rows_of[k]["local_file"], 10**5, 20) for k in (0, -1))
    sweeps = table["rt444/BoxesStack", "sweeps"]
    assert (sweeps[0], sweeps[1], sweeps[-1]) == ("2", f"{min(first, last)}", f"{max(first, last)}")
    # the name of a file did not tell it, and nothing of ours is beside the other set
    assert ("rt444/BoxesStack", "dof") not in table
    assert [key for key in table if key[0] == "*Local/other*"] == [
        ("*Local/other*", "dof"),
        ("*Local/other*", "sweeps"),
    ]
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == [f"{PUBLISHED}-{label}.png" for label in ("contacts", "sweeps")]


def test_a_family_is_measured_again(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other rows stay, under the same published sets."""
    monkeypatch.setattr(_results, "FOLDER", tmp_path)
    run(monkeypatch, built, "--results", "sets")
    with (tmp_path / "sets.csv").open(newline="") as file:
        stored = [row | {"problems": "77"} for row in csv.DictReader(file)]
    _results.store("sets", stored, title="Sets", command="by hand")
    only = ("--only", "rt444/BoxesStack")
    run(monkeypatch, built, "--results", "sets", *only)
    with (tmp_path / "sets.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["set"] for row in rows] == [row["set"] for row in stored]
    assert {row["problems"] for row in rows if row["set"] == "rt444/BoxesStack"} == {"5"}
    assert {row["problems"] for row in rows if row["set"].startswith("*")} == {"77"}
    assert "Measured last: rt444/BoxesStack." in (tmp_path / "sets.json").read_text()
    _results.store("sets", stored[:1], title="Sets", command="by hand")
    with pytest.raises(SystemExit, match=r"sets.csv: has no row of rt444/BoxesStack"):
        run(monkeypatch, built, "--results", "sets", *only)
    with pytest.raises(SystemExit, match=r"none.csv: is not stored"):
        run(monkeypatch, built, "--results", "none", *only)


def test_contacts_and_bodies_are_counted(built: Path, tmp_path: Path) -> None:
    name = "rt444/BoxesStack"
    (row,) = differences.closed(built, name)
    counts = [fclib.read(path).nc for path in (built / name).glob("*-global.hdf5")]
    assert row["contacts"] == collection_table.span(counts)
    assert (row["set"], row["problems"]) == (name, "5")
    # the corners of one box; with more boxes contacts are on several faces
    assert row["inside the face"] == "0"
    files = listed(tmp_path / "files.csv", [("Local/other", 1, 6, 2)])
    with pytest.raises(SystemExit, match=r"files.csv: has no file of the published set that rt444"):
        next(differences.untouched(built, name, files))
    with pytest.raises(SystemExit, match="rt444/Nothing: no problem"):
        next(differences.closed(built, "rt444/Nothing"))


def test_contacts_at_the_border_are_told_from_those_inside() -> None:
    x, y = np.meshgrid(np.arange(4.0), np.arange(5.0))
    point = np.column_stack((x.ravel(), y.ravel(), np.zeros(20)))
    normal = np.tile((0.0, 0.0, 1.0), (20, 1))
    assert differences.inside(SimpleNamespace(normal=normal, point=point)) == 6
    point[3, 2] = 1.0
    assert differences.inside(SimpleNamespace(normal=normal, point=point)) is None
    point[3, 2], normal[3] = 0.0, (0.0, 1.0, 0.0)
    assert differences.inside(SimpleNamespace(normal=normal, point=point)) is None


def test_bodies_that_nothing_touches_are_counted(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "rt444/BoxesStack"
    published = {"set": PUBLISHED, "ours": name, "files": f"{FILES}/"}
    monkeypatch.setattr(differences, "sets", lambda: [published])
    # ten bodies, and contacts with two ends each
    files = listed(tmp_path / "files.csv", [(FILES, 1, 60, k) for k in (1, 4, 5, 9, 20)])
    rows = list(differences.untouched(built, name, files))
    assert [row["published contacts"] for row in rows] == ["1", "4", "5", "9", "20"]
    assert [row["of them untouched, at least"] for row in rows] == ["8", "2", "0", "0", "0"]
    own = {fclib.read(path).nc for path in (built / name).glob("*-global.hdf5")}
    assert {int(row["our contacts"]) for row in rows} <= own


def test_a_list_without_the_columns_is_named(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = tmp_path / "files.csv"
    files.write_text("set,file,dof,contacts\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"files.csv: has no column nsgs_sweeps"):
        run(monkeypatch, built, "--files", files)


def test_figures_of_the_report_are_of_its_four_families(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")
    with pytest.raises(SystemExit, match="rt444/Chain: is not built"):
        run(monkeypatch, built, "--report", tmp_path / "out")
    folder, rows = script.families([built])["rt444/BoxesStack"]
    ours = {f"rt444/{name}": (folder, rows) for name in script.REPORT}
    script.report(ours, tmp_path / "all")
    assert sorted(path.parent.name for path in (tmp_path / "all").rglob("*.svg")) == [
        "figure-2",
        "figure-3",
        "figure-4",
        "figure-5",
    ]
