"""Families of installed packages: they are found by their entry points, and used like our own."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import pytest

from fclib import collections
from fclib.collections import set_index
from fclib.scenes.shared import added
from helpers import ran

FACTS = """
    title: ClassVar[str] = "One box"
    description: ClassVar[str] = "A box falls on a plane."
    application: ClassVar[str] = "multibody systems"
    authors: ClassVar[str] = "somebody else"
    friction: ClassVar[str] = "Coulomb"
    collection: ClassVar[str] = "elsewhere"
    problems: ClassVar[int] = 3
"""
FAMILIES = f'''
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

import fclib
from fclib.scenes import Scene, parameter

MJCF = """<mujoco><worldbody><geom type="plane" size="0 0 1" friction="{{mu}}"/>
<body pos="0 0 {{height}}"><freejoint/><geom type="box" size=".1 .1 .1" friction="{{mu}}"/></body>
</worldbody></mujoco>"""


@dataclass(frozen=True)
class NoFamily:
    """Somebody's own dataclass in the same module."""


@dataclass(frozen=True, kw_only=True)
class FallingBox:
    """A scene."""
{FACTS}
    mu: float = parameter(0.4, "1", "coefficient of friction")
    restitution: float = parameter(0.0, "1", "Newton's coefficient of restitution")
    time_step: float = parameter(2e-3, "s", "time step h")

    def scene(self, seed: int = 0) -> Scene:
        return Scene.of(self, seed, MJCF.format(mu=self.mu, height=0.1001))


@dataclass(frozen=True, kw_only=True)
class Pressed:
    """Problems that are assembled directly."""
{FACTS.replace("One box", "One contact")}
    mu: float = parameter(0.4, "1", "coefficient of friction")

    def problem(self, number: int, seed: int = 0) -> fclib.LocalProblem:
        q = np.array([-1.0 - number, 0.1, 0.0])
        info = fclib.ProblemInfo(title=f"problem {{number}}")
        return fclib.LocalProblem(W=np.eye(3), q=q, mu=[self.mu], info=info)
'''


def install(folder: Path, package: str, code: str, points: dict[str, str]) -> None:
    """Put a package of one file into a folder, with its metadata."""
    (folder / f"{package}.py").write_text(textwrap.dedent(code))
    info = folder / f"{package}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    lines = [f"{name} = {target}" for name, target in points.items()]
    (info / "entry_points.txt").write_text("\n".join([f"[{added.GROUP}]", *lines, ""]))


def run(folder: Path, *words: object, code: int = 0) -> subprocess.CompletedProcess[str]:
    """Python with the packages of a folder."""
    more = {"PYTHONPATH": str(folder), "FCLIB_CACHE": str(folder / "cache"), "COLUMNS": "200"}
    done = ran(sys.executable, *words, code=code, env=os.environ | more, cwd=folder)
    return done


def records(done: subprocess.CompletedProcess[str]) -> list[dict[str, Any]]:
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a package that adds two families."""
    folder = tmp_path_factory.mktemp("site")
    install(folder, "boxes_of_others", FAMILIES, {"boxes": "boxes_of_others"})
    return folder


def test_the_command_line_lists_and_shows_them(site: Path) -> None:
    rows = {row["family"]: row for row in records(run(site, "-m", "fclib", "collection", "list",
                                                      "--json"))}  # fmt: skip
    assert rows["FallingBox"]["set"] == rows["Pressed"]["set"] == "elsewhere"
    assert rows["Pressed"]["problems"] == 3
    assert set(collections.families()) == set(rows) - {"FallingBox", "Pressed"}
    (shown,) = records(run(site, "-m", "fclib", "collection", "show", "FallingBox", "--json"))
    assert [row["parameter"] for row in shown["parameters"]] == ["mu", "restitution", "time_step"]
    sets = records(run(site, "-m", "fclib", "collection", "list", "--sets", "--json"))
    mine = {row["set"]: row for row in sets}["elsewhere"]
    assert (mine["families"], mine["problems"], mine["version"]) == (2, 6, "1")
    # sets whose problems never change have not grown
    extended = {row["set"]: row["families"] for row in sets}["extended"]
    assert extended == len(collections.sets()["extended"])


def test_they_are_built_and_verified(site: Path, tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    run(site, "-m", "fclib", "collection", "build", "elsewhere", "--out", tmp_path)
    rows = collections.read_catalog(tmp_path).to_pylist()
    assert sorted(row["id"] for row in rows) == [
        f"elsewhere/{family}/{number:04d}" for family in ("FallingBox", "Pressed")
        for number in range(3)
    ]  # fmt: skip
    assert all(row["has_solution"] for row in rows)
    # the licence and the citation of our collection are not theirs
    assert {(row["license"], row["citation"]) for row in rows} == {(None, None)}
    run(site, "-m", "fclib", "collection", "verify", tmp_path)
    # the problems are files like others: they need no package
    assert {one.status for one in collections.verify(tmp_path) if not one.ok} == set()
    assert {set_index.origin_of(row) for row in rows} == {"yours"}


def test_a_campaign_simulates_them(site: Path, tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(
        textwrap.dedent(
            """
            solvers = ["auto"]
            tolerances = [1e-6]

            [[problems]]
            simulate = { family = "FallingBox", parameters = { mu = 0.2 }, steps = [5, 6] }
            [[problems]]
            set = "elsewhere/Pressed"
            """
        )
    )
    text = run(site, "-m", "fclib", "bench", campaign, "--store", tmp_path / "runs.sqlite")
    assert "5" in text.stdout + text.stderr
    exported = tmp_path / "runs.csv"
    run(site, "-m", "fclib", "bench", "export", tmp_path / "runs.sqlite", exported)
    lines = exported.read_text().splitlines()
    assert len(lines) == 1 + 5
    assert sum("FallingBox" in line for line in lines) == 2


def test_problems_are_made_anew_if_the_package_has_changed(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    install(tmp_path, "boxes_of_others", FAMILIES, {"boxes": "boxes_of_others"})
    script = (
        "from fclib.bench.generated import simulated\nfrom fclib import collections\n"
        "(path,) = simulated('FallingBox', {}, [5], 0); print(path.parent.name)\n"
        "print(collections.plan_of('elsewhere/Pressed').fingerprint())"
    )
    first = run(tmp_path, "-c", script).stdout
    assert run(tmp_path, "-c", script).stdout == first
    module = tmp_path / "boxes_of_others.py"
    module.write_text(module.read_text().replace("height=0.1001", "height=0.1002").replace(
        "[-1.0 - number", "[-2.0 - number"))  # fmt: skip
    second = run(tmp_path, "-c", script).stdout
    pairs = list(zip(first.splitlines(), second.splitlines(), strict=True))
    assert len(pairs) == 2
    assert all(one != other for one, other in pairs)


FAULTS = {
    "gone = no_such_module": "cannot be loaded: ModuleNotFoundError",
    "raises = broken:missing": "cannot be loaded: AttributeError",
    "number = broken:NUMBER": "7 is neither a class nor a module",
    "plain = broken:Plain": "Plain is no dataclass with scene",
    "empty = broken_empty": "the module broken_empty has no family",
    "arch = broken:Arch": "there is another family called Arch",
    "ours = broken:Ours": "Ours is in the set masonry, which is fclib's; name a set of your own",
    "listed = broken:Listed": "Listed is in the set standard, which is fclib's",
    "outside = broken:Outside": "Outside is in the set '../elsewhere'",
    "untitled = broken:Untitled": "Untitled has no text 'title'",
    "uncounted = broken:Uncounted": "Uncounted has no number of 'problems'",
    "unitless = broken:Unitless": "Unitless: 'mu' has no default, unit or meaning",
}


def test_a_broken_entry_point_is_named_and_hurts_no_other(tmp_path: Path) -> None:
    def family(name: str, facts: str = FACTS, body: str = "") -> str:
        more = f"{body}\n    def problem(self, number, seed=0): pass"
        return f"@dataclass(frozen=True)\nclass {name}:{facts}{more}\n"

    code = "from dataclasses import dataclass\nfrom typing import ClassVar\nNUMBER = 7\n"
    code += "class Plain: pass\n"
    code += family("Arch")
    for name, other in {"Ours": "masonry", "Listed": "standard", "Outside": "../elsewhere"}.items():
        code += family(name, FACTS.replace("elsewhere", other))
    code += family("Untitled", re.sub(r".*title: .*\n", "", FACTS))
    code += family("Uncounted", FACTS.replace("= 3", "= 0"))
    code += family("Unitless", body="    mu: float = 0.5")
    points = dict(words.split(" = ") for words in FAULTS)
    install(tmp_path, "broken", code, points)
    (tmp_path / "broken_empty.py").write_text("")
    install(tmp_path, "boxes_of_others", FAMILIES, {"boxes": "boxes_of_others:Pressed"})
    script = "from fclib import collections; print(' '.join(collections.families()))"
    done = run(tmp_path, "-c", script)
    assert set(done.stdout.split()) == {*collections.families(), "Pressed"}
    for words, message in FAULTS.items():
        name = words.partition(" ")[0]
        assert f"entry point {name} of fclib.families: {message}" in done.stderr, name
    assert done.stderr.count("it is left out") >= len(FAULTS)


def test_the_sets_that_take_no_families_are_all_known() -> None:
    own = {family.collection for family in collections.families().values()}
    assert own | set(added.LISTS) == set(set_index.SETS)
