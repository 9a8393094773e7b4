"""Where MuJoCo is not installed: what needs it says so in a line, and all else works."""

import importlib.metadata
import re
import subprocess
import sys
from pathlib import Path

import pytest
from typer.main import get_command

import fclib
from fclib import cli, collections, scenes
from fclib.collections import plan
from helpers import ran

SAID = r"fclib: [^\n]*MuJoCo[^\n]*pip install 'fclib\[simulate\]'[^\n]*\n?"

SCENE = '<mujoco><worldbody><body><freejoint/><geom size="1"/></body></worldbody></mujoco>'


@pytest.fixture
def without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in which MuJoCo cannot be imported, by no process that is started."""
    blocked = tmp_path / "blocked"
    blocked.mkdir()
    (blocked / "mujoco.py").write_text('raise ImportError("no MuJoCo here")\n')
    monkeypatch.setenv("PYTHONPATH", str(blocked))
    monkeypatch.setenv("FCLIB_CACHE", str(tmp_path / "cache"))
    (tmp_path / "scene.xml").write_text(SCENE)
    problem = fclib.LocalProblem(W=[[1.0, 0, 0], [0, 1, 0], [0, 0, 1]], q=[-1.0, 2, 0], mu=[0.5])
    fclib.write(tmp_path / "one.hdf5", problem, fclib.solve(problem, tol=1e-10).solution)
    return tmp_path


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "fclib", *words]
    return ran(*command, code=None, cwd=folder)


def test_it_is_an_extra() -> None:
    """Engines that are recorded may need it too: mujoco-warp, of another extra."""
    asked = [line for line in importlib.metadata.requires("fclib") or () if "mujoco" in line]
    assert asked
    for line in asked:
        extra = "recorders" if line.startswith("mujoco-warp") else "simulate"
        assert re.search(rf"extra == .{extra}.", line), line


@pytest.mark.parametrize(
    "words",
    [
        "simulate scene.xml --out made",
        "demo --out made",
        "collection build tiny --out made",
        "collection build rt444/Chain --count 1 --out made",
        "collection simulate rt444/BoxesStack --count 2 --out made",
        "bench quick --store made.sqlite",
    ],
)
def test_what_needs_it_says_so_in_a_line(without: Path, words: str) -> None:
    done = run(without, *words.split())
    assert done.returncode != 0
    # on a slow machine a build says first how far it is
    said = re.sub(r"^tiny/\w+: \d+ of \d+\n", "", done.stderr, flags=re.MULTILINE)
    assert re.fullmatch(SAID, said), done.stderr


def test_a_scene_with_files_says_so_too(without: Path) -> None:
    text = '<asset><mesh name="a" file="a.obj"/></asset><worldbody>'
    (without / "scene.xml").write_text(SCENE.replace("<worldbody>", text))
    code = "from fclib import scenes; scenes.Scene.from_file('scene.xml')"
    done = ran(sys.executable, "-c", code, code=None, cwd=without)
    last = done.stderr.strip().splitlines()[-1]
    assert re.fullmatch(r"ImportError: scene\.xml .*pip install 'fclib\[simulate\]'.*", last), last


@pytest.mark.parametrize(
    "words",
    [
        "info one.hdf5",
        "solve one.hdf5 --write",
        "check one.hdf5",
        "convert one.hdf5 other.hdf5",
        "solvers",
        "collection list",
        "collection show rt444/BoxesStack",
        "collection build ladder/Wall --count 1 --no-pictures --out made",
        "bench run --problems one.hdf5 --solver nsgs --tol 1e-6 --store made.sqlite",
    ],
)
def test_what_does_not_need_it_works(without: Path, words: str) -> None:
    done = run(without, *words.split())
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_command_has_its_help(without: Path) -> None:
    """All in one process: each imports what it needs at its top."""
    code = "from helpers_cli import run\n" + "".join(
        f"done = run({', '.join(map(repr, [*words, '--help']))})\n"
        f"assert done.returncode == 0, {words!r}\n"
        for words in commands(get_command(cli.app), ())
    )
    code += "assert 'mujoco' not in sys.modules\n"
    code = f"import sys; sys.path.append({str(Path(__file__).parents[1])!r})\n" + code
    ran(sys.executable, "-c", code, cwd=without)


def commands(command: object, words: tuple[str, ...]) -> list[tuple[str, ...]]:
    """A command and those below it."""
    below = getattr(command, "commands", {})
    return [words, *(one for name in below for one in commands(below[name], (*words, name)))]


def test_the_page_names_the_sets_that_do_without(root: Path) -> None:
    """They have no scene whose collisions MuJoCo would find."""
    text = (root / "docs" / "collection.md").read_text()
    told = re.search(r"These are built without MuJoCo: ([^.]*)\.", text)
    assert told is not None
    # a set also has families of others that were chosen for it, as rr9118 has Chain
    members = {
        name: {folder.partition("/")[2] for folder in collections.sets()[name]}
        for name in {kind.collection for kind in plan.families().values()}
    }
    free = set(scenes.assemblies())
    whole = {name for name, families in members.items() if families <= free}
    single = {
        f"{name}/{family}"
        for name, families in members.items()
        if name not in whole
        for family in families & free
    }
    assert set(re.findall(r"`([\w/]+)`", told[1])) == whole | single
