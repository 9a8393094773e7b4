"""Commands that are interrupted or killed: one line, whole files, no process left behind."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import fclib
from fclib import _marked, bench
from fclib.bench import processes
from helpers import planted_local

PATIENCE = 300.0  # [s] for what a machine that is shared does in one
MARK = "FCLIB_TEST_MARK"
SCENE = """
<mujoco><worldbody>
  <geom type="plane" size="1 1 1"/>
  <body pos="0 0 0.1"><freejoint/><geom type="box" size=".1 .1 .1"/></body>
</worldbody></mujoco>
"""


def wait_for(holds: Callable[[], object]) -> None:
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


def maps(pid: int) -> str:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/maps").read_text()
    return ""


RUN = "from fclib_command import main; main()"
# a state is kept at each step, not every five seconds
EAGER = (
    "import importlib, sys; importlib.import_module('fclib.collections.record');"
    f" sys.modules['fclib.collections.record'].CHECKPOINT = 0; {RUN}"
)


class Running:
    """A command in a session of its own, as a terminal has it."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.folder = folder
        self.mark = f"{MARK}={folder}"
        self.process = subprocess.Popen(
            [sys.executable, "-c", EAGER if arguments[0] == "simulate" else RUN, *arguments],
            env=os.environ | dict([self.mark.split("=", 1)]),
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def wait_for(self, holds: Callable[[], object]) -> None:
        wait_for(lambda: holds() or self.process.poll() is not None)
        assert self.process.poll() is None, self.process.communicate()

    def interrupt(self) -> str:
        """Ctrl-C; what it says."""
        os.killpg(self.process.pid, signal.SIGINT)
        _, said = self.process.communicate(timeout=PATIENCE)
        assert self.process.returncode == 130, said
        return said

    def left(self) -> list[int]:
        """What runs of it."""
        alive = (pid for pid in _marked.marked(self.mark) if pid != self.process.pid)
        return [pid for pid in alive if processes.state(pid) not in ("", "Z", "X")]


# what is called, and the sign that it is in the midst of its work
COMMANDS = {
    "bench": (
        ["bench", "--problems", "p.hdf5", "--solver", "nsgs", "--repeats", "9999", "-j", "2"],
        "bench.sqlite",
    ),
    "simulate": (["simulate", "scene.xml", "--steps", "99999"], "problems/*/*/.state/*.npz"),
    "build": (["collection", "build", "Chain", "Capsules", "--jobs", "2"], "*/rt444/*/*-local*"),
    "report": (["report", "runs.sqlite", "--out", "site"], ""),
}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    fclib.write(folder / "p.hdf5", planted_local(0, nc=5).problem)
    groups = [{"files": [str(folder / "p.hdf5")]}]
    campaign = {"name": "runs", "solvers": ["nsgs"], "problems": groups, "repeats": 100}
    bench.run_campaign(bench.Campaign.of(campaign), folder / "runs.sqlite")
    (folder / "scene.xml").write_text(SCENE)
    return folder


@pytest.fixture(params=COMMANDS)
def running(request: pytest.FixtureRequest, runs: Path, tmp_path: Path) -> Iterator[Running]:
    arguments, sign = COMMANDS[request.param]
    shutil.copytree(runs, tmp_path, dirs_exist_ok=True)
    with started(tmp_path, *arguments) as command:
        command.wait_for(
            # a report is soon made: its first look at the store
            lambda: any(tmp_path.glob(sign)) if sign else "_sqlite3" in maps(command.process.pid)
        )
        yield command


@contextlib.contextmanager
def started(folder: Path, *arguments: str) -> Iterator[Running]:
    command = Running(folder, *arguments)
    try:
        yield command
    finally:
        command.process.kill()
        command.process.communicate()


def test_while_it_imports(tmp_path: Path) -> None:
    with started(tmp_path, "bench", "tiny") as command:
        # the first extension of what is imported; the last one is seconds away
        command.wait_for(lambda: "_multiarray_umath" in maps(command.process.pid))
        assert command.interrupt() == "fclib: interrupted\n"
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_in_the_midst_of_its_work(running: Running) -> None:
    said = running.interrupt()
    assert said.splitlines()[-1].startswith("fclib: interrupted"), said
    assert "Traceback" not in said
    wait_for(lambda: not running.left())
    for path in running.folder.rglob("*"):
        assert path.suffix not in (".tmp", ".part"), path
        if path.suffix == ".hdf5":
            fclib.read(path)


@pytest.mark.slow
def test_no_process_outlives_a_kill(running: Running) -> None:
    running.process.kill()
    running.process.wait()
    wait_for(lambda: not running.left())
