"""What people install: the wheel's linking, man pages, completion, the screen of help, metadata."""

import os
import re
import shutil
import sys
import zipfile
from io import BytesIO
from pathlib import Path

import pytest

import fclib
from helpers import ran


def run(*command: object, **environment: str) -> str:
    done = ran(*command, env=os.environ | environment)
    return done.stdout


# ---- first minutes


def test_the_help_fits_a_screen() -> None:
    text = run(sys.executable, "-m", "fclib", "--help", COLUMNS="80")
    lines = text.rstrip().splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    assert "..." not in text.split("\n", 1)[1], "what a command does is cut short"
    assert "  doctor " in text


def test_a_shell_completes_commands_and_options(tmp_path: Path) -> None:
    bash, script = shutil.which("bash"), Path(sys.executable).with_name("fclib")
    if bash is None or not script.is_file():
        pytest.skip("there is no bash, or fclib is not installed")
    environment = {
        "HOME": str(tmp_path),
        "PATH": f"{script.parent}{os.pathsep}{os.environ['PATH']}",
    }
    run(bash, "-c", "fclib --install-completion; exit $?", **environment)
    (installed,) = tmp_path.rglob("fclib.sh")
    assert str(installed) in (tmp_path / ".bashrc").read_text()

    def completed(words: str) -> list[str]:
        lines = (
            f"source {installed}",
            "name=$(complete -p fclib | sed 's/.*-F \\([^ ]*\\).*/\\1/')",
            f"COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))",
            '$name fclib; echo "${COMPREPLY[@]}"',
        )
        return run(bash, "-c", "\n".join(lines), **environment).split()

    assert completed("fclib so") == ["solve", "solvers"]
    assert completed("fclib solve --ti") == ["--time-limit"]


def test_every_command_has_a_man_page(root: Path, tmp_path: Path) -> None:
    stale = tmp_path / "fclib-gone.1"
    stale.write_text("")
    run(sys.executable, root / "scripts" / "man_pages.py", tmp_path)
    assert not stale.exists()
    commands = re.findall(
        r"^  (\w+)  +", run(sys.executable, "-m", "fclib", "-h").split("Commands:")[1], re.MULTILINE
    )
    assert len(commands) > 10
    names = {path.name for path in tmp_path.glob("*.1")}
    assert names >= {"fclib.1", "fclib-bench-run.1", *(f"fclib-{one}.1" for one in commands)}
    page = (tmp_path / "fclib-solve.1").read_text()
    for part in (".SH NAME", ".SH SYNOPSIS", ".SH OPTIONS", "\\-\\-time\\-limit", "1e\\-08"):
        assert part in page
    groff = shutil.which("groff")
    if groff is not None:
        for path in tmp_path.glob("*.1"):
            checked = ran(groff, "-man", "-ww", "-z", path)
            assert checked.stderr == "", path.name


# ---- what is said in several places


def test_versions_agree(root: Path) -> None:
    version = fclib.__version__
    cmake = (root / "CMakeLists.txt").read_text()
    recipe = (root / "recipe" / "recipe.yaml").read_text()
    assert f"project(fclib VERSION {version} " in cmake
    assert f"\nversion: {version}\n" in (root / "CITATION.cff").read_text()
    assert f'\n  version: "{version}"\n' in recipe
    c_version = re.search(r"FCLIB_C_VERSION ([\d.]+)", cmake)
    assert c_version is not None
    assert f'c_version: "{c_version[1]}"' in recipe


def test_the_recipe_asks_for_what_the_package_asks_for(root: Path) -> None:
    recipe = (root / "recipe" / "recipe.yaml").read_text()
    project = (root / "pyproject.toml").read_text()
    needed = re.search(r"^dependencies = \[(.*?)^\]", project, re.MULTILINE | re.DOTALL)
    built_by = re.search(r"^requires = \[(.*?)\]", project, re.MULTILINE)
    assert needed is not None
    assert built_by is not None
    found = re.findall(r'"([\w-]+)([<>=]=[\d.]+)', needed[1] + built_by[1])
    assert len(found) >= 6
    for name, versions in found:
        assert f"- {name} {versions}\n" in recipe, name


# ---- the wheel, where make wheel has made one; scripts/check_wheel.py, which it runs, tries it


def test_the_wheel_needs_no_hdf5(root: Path) -> None:
    elf = pytest.importorskip("elftools.elf.elffile", reason="make wheel installs pyelftools")
    wheels = sorted((root / "dist").glob("fclib-*.whl"))
    if not wheels:
        pytest.skip("make wheel has made none")
    for wheel in wheels:
        archive = zipfile.ZipFile(wheel)
        (core,) = (n for n in archive.namelist() if n.startswith("fclib/_core") and ".so" in n)
        library = elf.ELFFile(BytesIO(archive.read(core)))
        tags = library.get_section_by_name(".dynamic").iter_tags("DT_NEEDED")
        assert not [tag.needed for tag in tags if "hdf5" in tag.needed]
        symbols = library.get_section_by_name(".dynsym").iter_symbols()
        assert not [
            one.name
            for one in symbols
            if one.name.startswith("H5") and one["st_shndx"] != "SHN_UNDEF"
        ]
