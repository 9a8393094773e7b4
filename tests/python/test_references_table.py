"""The table of stored solutions: check and verify side by side."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import pytest

import fclib
from helpers import planted_local, ran
from helpers_report import make_collection

pytest.importorskip("pyarrow")


def table(folder: Path, root: Path) -> subprocess.CompletedProcess[str]:
    return ran(sys.executable, "-m", "workshop.tables.references", folder, code=None, cwd=root)


def test_it_tells_where_check_and_verify_differ(tmp_path: Path, root: Path) -> None:
    folder = make_collection(tmp_path / "collection")
    done = table(folder, root)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[1].startswith("set,files,ok")

    # a file that the catalogue does not know, and one that it knows and that is gone
    added = folder / "small" / "Added" / "0000-local.hdf5"
    added.parent.mkdir(parents=True)
    case = planted_local(3, nc=4)
    fclib.write(added, case.problem, case.solution)
    gone = next(path for path in sorted(folder.rglob("*.hdf5")) if path != added)
    gone.unlink()
    damaged = folder / "small" / "Added" / "0001-local.hdf5"
    damaged.write_bytes(b"no HDF5")
    done = table(folder, root)
    assert done.returncode == 1
    assert "Added/0000-local.hdf5: check says ok, verify says not listed" in done.stdout
    # neither takes the damaged one
    assert (
        next(csv.DictReader(done.stdout[done.stdout.index("set,") :].splitlines()))["others"] == "1"
    )
    assert f"{gone.relative_to(folder)}: missing, and check has not read it" in done.stdout
