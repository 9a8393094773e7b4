"""Try a wheel as its users will: in an empty environment, with h5py and its HDF5 beside it.

python scripts/check_wheel.py WHEEL     look into it, install it into a new environment, try it
python scripts/check_wheel.py           try the fclib that is installed for this Python
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
import venv
import zipfile
from io import BytesIO
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "python" / "fclib"

# one process, two versions of HDF5: each writes what the other reads, with files open in both
TOGETHER = """
import sys
from pathlib import Path
for name in sys.argv[1:]:
    __import__(name)
import fclib, fclib._device, h5py, numpy as np

problem = fclib.LocalProblem(W=np.eye(6), q=np.arange(-1.0, 5.0), mu=np.full(2, 0.5))
fclib.write("ours.hdf5", problem)
with h5py.File("theirs.hdf5", "w") as other, h5py.File("ours.hdf5", "r+") as file:
    other["x"] = np.arange(1000.0)
    file["fclib_local/vectors/q"][:] = -1.0
    other.flush()
    fclib.write("again.hdf5", problem)
    assert fclib.read("again.hdf5").q[0] == -1.0
    other["y"] = other["x"][:] * 2
assert (fclib.read("ours.hdf5").q == -1.0).all()
with h5py.File("again.hdf5") as file, h5py.File("theirs.hdf5") as other:
    assert (file["fclib_local/vectors/q"][:] == problem.q).all()
    assert (other["y"][:] == 2 * np.arange(1000.0)).all()
# an error of one is none of the other's
for read, error in ((fclib.read, fclib.FileError), (h5py.File, OSError)):
    Path("no.hdf5").write_bytes(b"no HDF5")
    try:
        read("no.hdf5")
    except error:
        pass
    else:
        raise AssertionError(f"{read} has read what is no file of HDF5")
solved = fclib.solve(fclib.read("ours.hdf5"), tol=1e-10)
assert solved.status == "converged", solved

info = fclib._core.build_info()
assert info["hdf5"] == info["hdf5_compiled"]
assert info["metis"], "the wheel has no METIS"
# with all its headers
assert "struct FewCoordinates" in fclib._device.sources(), "no kernel for a GPU"
maps = Path("/proc/self/maps")
if maps.exists():
    loaded = {line.split()[-1] for line in maps.read_text().splitlines() if "hdf5" in line}
    strangers = {path for path in loaded if "/h5py" not in path and path.startswith("/")}
    strangers = {path for path in strangers if Path(path).suffix != ".hdf5"}
    assert not strangers, f"loaded beside that of h5py: {strangers}"
print(f"{' then '.join(sys.argv[1:])}: HDF5 {info['hdf5']} and {h5py.version.hdf5_version}")
"""


def look_into(wheel: Path) -> None:
    """What must be in a wheel, and what must not."""
    from elftools.elf.elffile import ELFFile

    archive = zipfile.ZipFile(wheel)
    names = set(archive.namelist())
    wanted = {
        f"fclib/{path.relative_to(PACKAGE)}"
        for path in PACKAGE.rglob("*")
        if path.is_file() and path.suffix != ".pyc" and not path.name.startswith("_core.")
    }
    wanted |= {f"fclib/bench/campaigns/{path.name}" for path in (ROOT / "campaigns").glob("*.toml")}
    wanted |= {
        "fclib_command.py",
        "fclib/_core.pyi",
        *(f"fclib/licenses/{one}" for one in ("HDF5", "METIS", "Eigen", "nanobind")),
    }
    lacking = sorted(wanted - names)
    assert not lacking, f"{wheel.name} lacks {lacking}"
    pages = [name for name in names if name.endswith(".1")]
    assert any(name.endswith("share/man/man1/fclib.1") for name in pages), "there is no man page"

    (core,) = (name for name in names if name.startswith("fclib/_core") and name.endswith(".so"))
    elf = ELFFile(BytesIO(archive.read(core)))
    needed = {tag.needed for tag in elf.get_section_by_name(".dynamic").iter_tags("DT_NEEDED")}
    outside = {name for name in needed if not name.startswith(("libc.", "libm.", "ld-linux"))}
    assert outside <= {"libstdc++.so.6", "libgcc_s.so.1", "libz.so.1"}, f"{core} needs {needed}"
    exported = [
        symbol.name
        for symbol in elf.get_section_by_name(".dynsym").iter_symbols()
        if symbol["st_shndx"] != "SHN_UNDEF" and symbol.name.startswith(("H5", "METIS", "gk_"))
    ]
    assert not exported, f"{core} exports {exported[:3]} of HDF5 or METIS"
    print(f"{wheel.name}: {len(names)} files, {wheel.stat().st_size / 1e6:.1f} MB; needs {needed}")


def environment() -> dict[str, str]:
    """That of a user: nothing points at this repository, nor at a library of the system."""
    left_out = ("PYTHONPATH", "PYTHONHOME", "LD_LIBRARY_PATH", "LD_PRELOAD", "VIRTUAL_ENV")
    return {key: value for key, value in os.environ.items() if key not in left_out}


def try_installed(python: str) -> None:
    """Both orders of import, and the command line."""
    with tempfile.TemporaryDirectory() as folder:

        def run(*words: str) -> str:
            done = subprocess.run(
                [python, *words], cwd=folder, env=environment(), capture_output=True, text=True
            )
            if done.returncode != 0:
                sys.exit(f"{' '.join(words[:3])}: {done.stdout}{done.stderr}")
            return done.stdout

        for order in (("fclib", "h5py"), ("h5py", "fclib")):
            print(run("-c", TOGETHER, *order).strip())
        solved = json.loads(run("-m", "fclib", "solve", "--json", "again.hdf5"))
        assert solved["status"] == "converged", solved
        findings = [
            json.loads(line) for line in run("-m", "fclib", "doctor", "--json").splitlines()
        ]
        hdf5 = next(finding for finding in findings if finding["name"] == "HDF5")
        print(f"fclib doctor: {len(findings)} findings; HDF5 {hdf5['found']}, {hdf5['purpose']}")
        assert hdf5["purpose"] == "inside the extension", hdf5


def main() -> None:
    """As the arguments say."""
    if len(sys.argv) == 1:
        return try_installed(sys.executable)
    wheel = Path(sys.argv[1]).resolve()
    look_into(wheel)
    with tempfile.TemporaryDirectory() as folder:
        started = time.monotonic()
        venv.create(folder, with_pip=True)
        python = str(Path(folder) / "bin" / "python")
        install = [python, "-m", "pip", "install", "--quiet", str(wheel), "h5py"]
        subprocess.run(install, env=environment(), cwd=folder, check=True)
        print(f"installed with h5py into a new environment in {time.monotonic() - started:.0f} s")
        try_installed(python)


if __name__ == "__main__":
    main()
