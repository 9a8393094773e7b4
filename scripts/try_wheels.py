"""Try the wheels of dist/ with each Python from 3.10 to 3.14 that is found, made first if asked.

.venv/bin/python scripts/try_wheels.py                   the Pythons of PATH and of pyenv
.venv/bin/python scripts/try_wheels.py --chroot FOLDER   and that of a chroot (scripts/try_on.sh)
.venv/bin/python scripts/try_wheels.py --build BUNDLED   make wheels of the sdist first, with the
                                                         libraries that wheel-libraries.sh made

Each is installed into a new environment beside h5py, and check_wheel.py tries it there. It is said
which Pythons are left out: not found, or with no wheel for them.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DIST = ROOT / "dist"
MINORS = range(10, 15)
ABI3 = 12  # of 3.12 and all that follow: wheel.py-api in pyproject.toml
TELL = "import sys, venv, ensurepip; print(*sys.version_info[:2])"


@dataclass(frozen=True)
class Interpreter:
    """A Python, here or in a chroot."""

    minor: int
    python: str  # as it is called there
    root: Path | None = None  # of the chroot

    @property
    def words(self) -> list[str]:
        """The command that it is."""
        inside = [] if self.root is None else ["chroot", str(self.root)]
        return [*inside, self.python]

    def __str__(self) -> str:
        return f"3.{self.minor} ({self.python}{f' in {self.root}' if self.root else ''})"


def answers(words: Sequence[str]) -> int | None:
    """The minor version of a Python that can make environments."""
    try:
        done = subprocess.run([*words, "-c", TELL], capture_output=True, text=True, check=False)
    except OSError:
        return None
    told = re.fullmatch(r"3 (\d+)\s*", done.stdout) if done.returncode == 0 else None
    return int(told[1]) if told else None


def interpreters(chroots: Sequence[Path]) -> list[Interpreter]:
    """One for each version here, and that of each chroot."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    found = []
    for minor in MINORS:
        # not the shims of pyenv, which answer for the version of the day
        on_path = shutil.which(f"python3.{minor}")
        for path in [Path(on_path or "shims"), *sorted(pyenv.glob(f"3.{minor}.*/bin/python3"))]:
            if "shims" not in path.parts and answers([str(path)]) == minor:
                found.append(Interpreter(minor, str(path)))
                break
    for root in chroots:
        told = answers(["chroot", str(root), "python3"])
        if told is None:
            sys.exit(f"{root}: python3 of this chroot does not answer")
        found.append(Interpreter(told, "python3", root.resolve()))
    return found


def wheel_for(minor: int, wheels: Sequence[Path]) -> Path | None:
    """The wheel that a Python takes, by the tags in its name."""
    for wheel in wheels:
        python, abi = wheel.stem.split("-")[2:4]
        least = int(python.removeprefix("cp3"))
        if least == minor or (abi == "abi3" and least <= minor):
            return wheel
    return None


def build(found: Sequence[Interpreter], bundled: Path) -> None:
    """A wheel for each version before 3.12, and one for all from there on."""
    (sdist,) = DIST.glob("fclib-*.tar.gz")
    made = ROOT / "build" / "wheel"
    shutil.rmtree(made, ignore_errors=True)
    for old in DIST.glob("fclib-*.whl"):
        old.unlink()
    here = [one for one in found if one.root is None]
    # the core is compiled once: where the sources and the objects lie is the same for all
    source = ROOT / "build" / "wheel-source"
    shutil.rmtree(source, ignore_errors=True)
    source.mkdir(parents=True)
    unpack = ["tar", "-xzf", str(sdist), "-C", str(source), "--strip-components", "1"]
    subprocess.run(unpack, check=True)
    abi3 = next((one for one in here if one.minor >= ABI3), None)
    for one in [*(one for one in here if one.minor < ABI3), *([abi3] if abi3 else [])]:
        print(f"== a wheel by Python {one}", flush=True)
        command = [*one.words, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", made]
        command += [f"--config-settings=cmake.define.FCLIB_BUNDLED={bundled.resolve()}"]
        command += [f"--config-settings=build-dir={ROOT / 'build' / 'wheel-objects'}", source]
        subprocess.run(list(map(str, command)), check=True)
    tools = Path(sys.executable).parent
    environment = os.environ | {"PATH": f"{tools}{os.pathsep}{os.environ['PATH']}"}
    repair = [str(tools / "auditwheel"), "repair", "--wheel-dir", str(DIST)]
    subprocess.run([*repair, *map(str, made.glob("*.whl"))], check=True, env=environment)


def try_one(one: Interpreter, wheel: Path) -> str:
    """What is wrong; empty if nothing is."""
    scratch = None if one.root is None else one.root / "tmp"
    with tempfile.TemporaryDirectory(dir=scratch) as name:
        folder = Path(name)
        shutil.copy(wheel, folder)
        (folder / "scripts").mkdir()
        shutil.copy(ROOT / "scripts" / "check_wheel.py", folder / "scripts")
        inside = folder if one.root is None else Path("/", folder.relative_to(one.root))
        python = Interpreter(one.minor, str(inside / "environment" / "bin" / "python"), one.root)
        steps = [
            [*one.words, "-m", "venv", str(inside / "environment")],
            [*python.words, "-m", "pip", "install", "--quiet", str(inside / wheel.name), "h5py"],
            [*python.words, str(inside / "scripts" / "check_wheel.py")],
        ]
        for step in steps:
            done = subprocess.run(step, capture_output=True, text=True)
            if done.returncode != 0:
                return (done.stdout + done.stderr).strip()
        print(done.stdout.strip())
    return ""


def main() -> None:
    """Build, if asked, try them all, and end with 1 if one fails."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--build", type=Path, metavar="BUNDLED", help="make the wheels first")
    parser.add_argument("--chroot", type=Path, action="append", default=[], help="a Debian's root")
    asked = parser.parse_args()
    found = interpreters(asked.chroot)
    if asked.build:
        build(found, asked.build)
    wheels = sorted(DIST.glob("fclib-*.whl"))
    if not wheels:
        sys.exit(f"{DIST} has no wheel: make wheels")
    failed = False
    summary = []
    for minor in MINORS:
        here = [one for one in found if one.minor == minor]
        wheel = wheel_for(minor, wheels)
        if not here:
            summary.append(f"Python 3.{minor}: not found here, left out")
        for one in here:
            if wheel is None:
                summary.append(f"Python {one}: no wheel is for it, left out")
                continue
            print(f"== {wheel.name} on Python {one}", flush=True)
            wrong = try_one(one, wheel)
            failed |= bool(wrong)
            summary.append(f"Python {one}: {wheel.name} {'FAILS' if wrong else 'works'}")
            if wrong:
                print(wrong)
    print("", *summary, sep="\n")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
