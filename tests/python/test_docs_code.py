"""Every code block of README.md, ARCHITECTURE.md and docs/ is run, or says why it is not.

Python blocks of a page run one after the other in one namespace; blocks of commands run in a folder
that has the files which the pages speak of. A command with a placeholder (FILE, `...`) is looked
up: the command and its options must exist. `pytest tests/python/test_docs_code.py -rs` lists what
is not run, with the reason that the page states.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import sys
import types
from pathlib import Path
from typing import Any

import pytest
import typer

import fclib
from capi_library import compile_fortran, compile_program
from doc_blocks import WORDS, Block, blocks_of, pages
from fclib import bench
from fclib.cli import app
from helpers import planted_local, ran
from helpers_cli import invoke
from helpers_report import make_store

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")

pytestmark = pytest.mark.slow

BLOCKS = {page: list(blocks_of(page)) for page in pages()}
PYTHON = [page for page, blocks in BLOCKS.items() if any(b.language == "python" for b in blocks)]
SHELL = [page for page, blocks in BLOCKS.items() if any(b.language == "sh" for b in blocks)]
OTHERS = [
    b
    for blocks in BLOCKS.values()
    for b in blocks
    if b.language not in ("python", "sh", *WORDS) and b.runs
]
LANGUAGES = {
    "python",
    "sh",
    "toml",
    "c",
    "cpp",
    "fortran",
    "cmake",
    "js",
    "octave",
    "matlab",
    *WORDS,
}
# what a page's Python uses and does not define, since it shows a part of a file
BEFORE = {
    "docs/analysis.md": "import fclib\nproblem = fclib.read('problem.hdf5')",
    "docs/solvers-of-your-own.md": (
        "import fclib, numpy as np, numpy.typing as npt, scipy.sparse as sp\n"
        "from typing import Annotated"
    ),
}
PLACEHOLDER = re.compile(r"(?<![\w{$.-])[A-Z]{2,}(?![\w}=-])|\.\.\.|\[")
SCENE = """
<mujoco>
  <worldbody>
    <geom type="plane" size="0 0 1"/>
    <body pos="0 0 4.8">
      <freejoint/>
      <geom type="box" size="0.1 0.1 0.1" mass="1"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory, root: Path, collection: Path) -> Path:
    """A folder with the files of which the pages speak."""
    from fclib.demo import simulate

    folder = tmp_path_factory.mktemp("made")
    kept = [*simulate(folder / "demo", boxes=3, steps=50, picture=None)][-4:]
    for path in (folder / "demo").iterdir():
        if not any(path in (stored.global_path, stored.local_path) for stored in kept):
            path.unlink()
    shutil.copy(folder / "demo/stack-049-local.hdf5", folder / "problem.hdf5")
    fclib.write_siconos(folder / "problem.dat", fclib.read(folder / "problem.hdf5"))
    for name in ("data/stack/one", "data/two", "data/more/walls-1", "mine/one"):
        path = folder / f"{name}.hdf5"
        path.parent.mkdir(parents=True, exist_ok=True)
        case = planted_local(len(name), nc=4)
        fclib.write(path, case.problem, case.solution)
    with fclib.SequenceWriter(folder / "run.h5") as writer:
        for k in range(20):
            writer.append(planted_local(k).problem)
    for name in ("robot.xml", "scene.xml"):
        (folder / name).write_text(SCENE)
    shutil.copy(root / "examples/python/own_solver.py", folder / "my_solver.py")
    shutil.copytree(collection, folder / "collection")
    # of one tolerance: each has pictures of its own
    quick = make_store(folder / "quick.sqlite", folder / "collection", files=4, tolerances=(1e-8,))
    with bench.Store(quick) as store:
        store.db.execute("UPDATE machines SET node = 'node7'")
        store.seal()
    for name in ("one", "two", "a", "b"):
        shutil.copy(quick, folder / f"{name}.sqlite")
    return folder


@pytest.fixture
def scratch(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of that folder, which is the current one."""
    folder = tmp_path / "scratch"
    shutil.copytree(made, folder)
    monkeypatch.chdir(folder)
    monkeypatch.setenv("FCLIB_CACHE", str(made.parent / "cache"))
    return folder


# ---- what there is


def test_the_language_of_every_block_is_known() -> None:
    wrong = [str(b) for bs in BLOCKS.values() for b in bs if b.language not in LANGUAGES]
    assert not wrong
    assert len(PYTHON) > 5
    assert len(SHELL) > 8


@pytest.mark.parametrize("block", [b for bs in BLOCKS.values() for b in bs if b.reason], ids=str)
def test_what_is_not_run_says_why(block: Block, root: Path) -> None:
    assert len(block.reason) > 10
    for name in re.findall(r"\btests/\S+\.py", block.reason):
        assert (root / name).is_file(), f"the reason names {name}, which is not there"
    if block.words:
        assert all(word in block.code for word in block.words), "the mark names no line"
    else:
        pytest.skip(block.reason)


# ---- Python


@pytest.mark.parametrize("page", PYTHON, ids=lambda page: page.name)
def test_python_blocks(
    page: Path, scratch: Path, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = types.ModuleType("page")
    monkeypatch.setitem(sys.modules, "page", module)
    namespace = vars(module)
    name = page.relative_to(root).as_posix()
    exec(BEFORE.get(name, ""), namespace)
    for block in BLOCKS[page]:
        if block.language == "python" and block.runs:
            exec(compile("\n" * block.line + block.code, name, "exec"), namespace)


def test_the_solver_of_the_page_is_that_of_the_example(root: Path) -> None:
    example = (root / "examples/python/own_solver.py").read_text()
    page = root / "docs/solvers-of-your-own.md"
    code = next(b.code for b in BLOCKS[page] if b.language == "python")
    assert code.strip() in example


# ---- commands


def command_of(words: list[str]) -> tuple[Any, list[str]]:
    """The command that a line calls, and what it is given."""
    found: Any = typer.main.get_command(app)
    for k, word in enumerate(words):
        inner = getattr(found, "commands", {}).get(word)
        if inner is None:
            # the word run may be left out
            default = getattr(found, "commands", {}).get("run")
            return default or found, words[k:]
        found = inner
    return found, []


def look_up(line: str) -> None:
    """Fail where a command of ours, or an option of it, does not exist."""
    words = shlex.split(re.sub(r"\.\.\.|[\[\]]", " ", line))[1:]
    command, given = command_of(words)
    if getattr(command, "commands", None):
        assert "..." in line, f"there is no such command: {line}"
        assert not given, f"there is no such command: {line}"
        return
    known = {name for item in command.params for name in (*item.opts, *item.secondary_opts)}
    for word in given:
        if word.startswith("--") or re.fullmatch(r"-[a-z]", word):
            assert word.partition("=")[0] in known, f"{command.name} has no option {word}: {line}"


def look_up_other(line: str, root: Path) -> None:
    """Fail where what a line of another program names is not in the repository."""
    words = shlex.split(line)
    if words[0] == "make":
        assert re.search(rf"^{words[1]}:", (root / "Makefile").read_text(), re.MULTILINE), line
    elif words[0] in (".venv/bin/python", "python"):
        if words[1] == "-m":
            words[1:3] = [f"{words[2].replace('.', '/')}.py"]
        script = (root / words[1]).read_text()
        if "_results.add_option(" in script:
            script += (root / "workshop/tables/_results.py").read_text()
        for word in words[2:]:
            assert not word.startswith("--") or f'"{word}"' in script, f"{line}: no option {word}"
    elif words[:2] == ["pip", "install"]:
        extra = re.search(r"fclib\[(\w+)\]", line)
        assert extra, f"{line}: not known to be right"
        assert re.search(rf"^{extra[1]} = \[", (root / "pyproject.toml").read_text(), re.MULTILINE)
    else:
        pytest.fail(f"{line}: cannot be checked; a mark before the block must say why")


def call(line: str) -> None:
    """Run a command of ours here, as a shell would call it."""
    words = []
    for word in shlex.split(line)[1:]:
        expands = "*" in word and f"'{word}'" not in line
        words += sorted(str(path) for path in Path().glob(word)) if expands else [word]
    invoke(*words)


@pytest.mark.parametrize("page", SHELL, ids=lambda page: page.name)
def test_commands(page: Path, scratch: Path, root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("webbrowser.open", lambda address: True)
    for block in BLOCKS[page]:
        if block.language != "sh":
            continue
        for line in block.commands():
            if line.startswith("fclib "):
                look_up(line)
                if PLACEHOLDER.search(line) or block.skips(line):
                    continue
                if "cmd:./pgs" in line:
                    compile_program(root / "examples/c/pgs.c", scratch / "pgs", "-std=c99")
                call(line)
            elif not block.skips(line):
                look_up_other(line, root)


def test_the_check_of_commands_sees_what_is_wrong() -> None:
    look_up("fclib solve FILE --tol 1e-4")
    look_up("fclib bench CAMPAIGN --store one.sqlite")
    look_up("fclib collection build rt444 --out DIR")
    for line in (
        "fclib solve FILE --tolerance 1e-4",
        "fclib sovle FILE",
        "fclib collection mke",
        "fclib bench merge --nothing",
    ):
        with pytest.raises((AssertionError, pytest.fail.Exception)):
            look_up(line)


# ---- the other languages


def check_toml(code: str, scratch: Path) -> None:
    """A campaign is one, other TOML is TOML."""
    program = scratch / "pgs"  # that it is there is enough
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib
    entries = tomllib.loads(code)
    if "solvers" in entries:
        assert bench.Campaign.of(entries).plan()


def check_cmake(code: str, root: Path) -> None:
    """The commands and the targets are those of the installed package."""
    config = (root / "cmake/fclib-config.cmake.in").read_text()
    lists = (root / "CMakeLists.txt").read_text()
    assert "find_package(fclib" in code
    assert "fclib" in config
    target = re.search(r"target_link_libraries\(\w+ (fclib::\w+)\)", code)
    assert target is not None
    assert target[1] in lists + config


def run_octave(code: str, scratch: Path) -> None:
    octave = shutil.which("octave-cli")
    if octave is None:
        pytest.skip("there is no Octave")
    (scratch / "block.m").write_text(code)
    fclib.write(scratch / "problem.hdf5", planted_local(1).problem)
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = ran(
        octave, "--no-init-file", "block.m", cwd=scratch, env=os.environ | {"PATH": programs}
    )
    line = done.stdout.splitlines()[-1]
    assert line in ("6 contacts, 324 entries in W", "0 errors"), done.stdout


@pytest.mark.parametrize("block", OTHERS, ids=str)
def test_blocks_in_other_languages(block: Block, scratch: Path, root: Path) -> None:
    if block.language == "toml":
        check_toml(block.code, scratch)
        return
    if block.language == "cmake":
        check_cmake(block.code, root)
        return
    if block.language == "octave":
        run_octave(block.code, scratch)
        return
    suffix = {"c": ".c", "cpp": ".cpp", "fortran": ".f90"}[block.language]
    source = scratch / f"block{suffix}"
    source.write_text(block.code)
    if block.language == "fortran":
        program = compile_fortran(source, scratch / "block")
    else:
        program = compile_program(source, scratch / "block")
    done = ran(program, "problem.hdf5")
    assert done.stdout
