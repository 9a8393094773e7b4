"""``fclib doctor``: what it finds, what it calls broken, and what it says to do."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

import fclib
from fclib import _core, doctor, external
from fclib.cli.doctor import command
from helpers import ran


def before(*folders: Path) -> str:
    """A PYTHONPATH with these folders first."""
    return os.pathsep.join(filter(None, [*map(str, folders), os.environ.get("PYTHONPATH")]))


def pretend(folder: Path, name: str, version: str, code: str = "", package: str = "") -> Path:
    """A module, and its package, that are found before those that are installed."""
    (folder / name).mkdir(parents=True)
    (folder / name / "__init__.py").write_text(code)
    package = package or name
    info = folder / f"{package}-{version}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: {version}\n")
    return folder


def test_what_is_here() -> None:
    command = [sys.executable, "-m", "fclib", "doctor", "--json"]
    done = ran(*command)
    findings = {one["name"]: one for one in map(json.loads, done.stdout.splitlines())}
    keys = ["part", "name", "state", "found", "purpose", "problem", "remedy"]
    assert all(list(finding) == keys for finding in findings.values())
    assert findings["fclib"]["found"] == fclib.__version__
    assert findings["HDF5"]["found"] == _core.build_info()["hdf5_compiled"]
    assert findings["Eigen"]["found"].startswith("3.")
    assert (findings["METIS"]["state"] == "ok") == (_core.build_info()["metis"] == "yes")
    judge = re.fullmatch(r"(long double|double-double), (\d+) bits", findings["judge"]["found"])
    assert judge is not None
    assert int(judge[2]) >= 64, "a judge needs more digits than a double"
    for name in ("Python", "numpy", "scipy", "trial"):
        assert findings[name]["state"] == "ok", findings[name]
    for name in ("mujoco", "clarabel", "scs", "pyarrow", "matplotlib", "dask", "siconos"):
        assert name in findings
    if findings["mujoco"]["state"] == "ok":
        assert "MuJoCo" not in findings["rendering"]["purpose"]
    # whoever only uses fclib needs none of these
    assert not {"pytest", "ruff", "mypy"} & set(findings)
    for finding in findings.values():
        assert finding["state"] in ("ok", "absent"), finding
        assert bool(finding["remedy"]) <= (finding["state"] == "absent")


@pytest.fixture(scope="module")
def pretended(tmp_path_factory: pytest.TempPathFactory) -> dict[str, doctor.Finding]:
    """What is found where packages are broken, too old, or of another interpreter."""
    folder = tmp_path_factory.mktemp("pretended")
    pretend(folder, "clarabel", "99.0", "import nowhere")
    pretend(folder, "scs", "0.1")
    pretend(folder, "mujoco", "4.0.1")
    pretend(folder, "pooch", "9.0", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    pretend(folder, "pinocchio", "99.1", "ADMMConstraintSolver = PGSConstraintSolver = 0", "pin")
    pretend(folder, "siconos", "99.2", "version = '99.3'")
    packages, others = ("clarabel", "scs", "mujoco", "pooch", "numpy"), ("pinocchio", "siconos")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        patch.setenv("PYTHONPATH", before(folder))
        patch.setenv("FCLIB_SICONOS_PYTHON", sys.executable)
        patch.setattr(doctor, "requirements", of_names(doctor.requirements(), packages))
        adapters = [one for one in external.adapters() if one.PREFIX.rstrip(":") in others]
        patch.setattr(external, "adapters", lambda: adapters)
        return {finding.name: finding for finding in doctor.examine()}


def of_names(known: list[doctor.Requirement], names: tuple[str, ...]) -> Any:
    """Gives those of some packages: each takes a process that imports it."""
    return lambda: [one for one in known if one.package in names]


def test_what_is_broken_is_said_with_what_to_do(pretended: dict[str, doctor.Finding]) -> None:
    assert "No module named 'nowhere'" in pretended["clarabel"].problem
    assert "pip install --force-reinstall" in pretended["clarabel"].remedy
    assert pretended["scs"].problem == "is 0.1, and fclib needs >=3.2.4"
    assert pretended["scs"].remedy == 'pip install "scs>=3.2.4"'
    assert pretended["pooch"].problem == "the process was ended by SIGSEGV"
    if sys.version_info >= (3, 11):
        assert pretended["mujoco"].problem == "is 4.0.1, and fclib needs 4.0.0"
        assert pretended["mujoco"].remedy == 'pip install "mujoco==4.0.0"'
    broken = {name for name, finding in pretended.items() if finding.state == "broken"}
    assert broken >= {"clarabel", "scs", "pooch"}
    assert "numpy" in set(pretended) - broken


def test_solvers_that_are_no_extra_have_their_versions(
    pretended: dict[str, doctor.Finding],
) -> None:
    assert pretended["pinocchio"].found == "99.1"
    # the word of the other interpreter, not what is installed beside fclib
    assert pretended["siconos"].found == f"99.3 in {sys.executable}"


def test_a_folder_that_takes_no_files_is_found(tmp_path: Path) -> None:
    code = (
        "import tempfile\nfrom fclib import doctor\n"
        f"tempfile.tempdir = {str(tmp_path / 'nowhere')!r}\n"
        "finding = doctor.check_work()\n"
        "print(finding.state, finding.remedy)\n"
    )
    done = ran(sys.executable, "-c", code)
    assert done.stdout.startswith("broken make room")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="takes LD_PRELOAD")
def test_another_hdf5_is_an_error_and_not_the_end(tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None or _core.build_info()["hdf5_bundled"]:
        pytest.skip("needs a C compiler, and an HDF5 that is a library of the system")
    source, library = tmp_path / "other.c", tmp_path / "other.so"
    source.write_text(
        "int H5get_libversion(unsigned* a, unsigned* b, unsigned* c)\n"
        "{ *a = 9; *b = 8; *c = 7; return 0; }\n"
    )
    subprocess.run([compiler, "-shared", "-fPIC", str(source), "-o", str(library)], check=True)
    code = "import fclib\ntry:\n    fclib.read('x')\nexcept fclib.FileError as e:\n    print(e)\n"
    environment = os.environ | {"LD_PRELOAD": str(library)}
    environment.pop("HDF5_DISABLE_VERSION_CHECK", None)
    done = ran(sys.executable, "-c", code, env=environment)
    assert "HDF5 9.8.7 is loaded" in done.stdout

    code = "from fclib import doctor\nprint(*doctor.check_core(), sep='\\n')"
    findings = ran(sys.executable, "-c", code, env=environment)
    assert "state='broken', found='9.8.7'" in findings.stdout


@pytest.mark.parametrize(
    ("versions", "found", "allowed"),
    [
        (">=3.8", "3.8.0", True),
        (">=3.8", "3.10.1", True),
        (">=3.8", "3.7.9", False),
        (">=14", "26.0.1", True),
        (">=3.2.4", "3.2.4rc1", True),
        ("==4.0.0", "4.0.0", True),
        ("==4.0.0", "4.0.1", False),
        ("", "1", True),
    ],
)
def test_versions_are_compared_by_their_numbers(versions: str, found: str, allowed: bool) -> None:
    assert doctor.Requirement("x", versions, (), True).allows(found) == allowed


def test_every_extra_has_a_purpose() -> None:
    """A new extra is looked at, or is one for those who work on fclib."""
    extras = {extra for one in doctor.requirements() for extra in one.extras}
    assert set(doctor.PURPOSE) <= extras
    assert extras - set(doctor.PURPOSE) <= {"test", "lint", "package", "docs", "coverage"}


def test_the_table_is_for_people(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = [
        doctor.Finding("core", "HDF5", "ok", "1.10.8"),
        doctor.Finding("solvers", "scs", "broken", "0.1", "", "is 0.1", 'pip install "scs>=3"'),
        doctor.Finding("solvers", "pinocchio", "absent", "", "", "", "pip install pin"),
    ]
    monkeypatch.setattr(doctor, "examine", lambda: found)
    with pytest.raises(typer.Exit) as stop:
        command()
    assert stop.value.exit_code == 1
    text = capsys.readouterr().out
    assert '-> pip install "scs>=3"' in text
    assert "-> pip install pin" in text
    assert "1 broken: do what its arrow says" in text
    with pytest.raises(typer.Exit) as stop:
        command(as_json=True)
    assert stop.value.exit_code == 1
    assert [json.loads(line)["state"] for line in capsys.readouterr().out.splitlines()] == [
        *("ok", "broken", "absent")
    ]
    monkeypatch.setattr(doctor, "examine", lambda: [found[0], found[2]])
    with pytest.raises(typer.Exit) as stop:
        command()
    assert stop.value.exit_code == 0
    assert "Nothing is broken; 1 optional is not installed." in capsys.readouterr().out
