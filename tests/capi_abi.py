"""The binary interface that the header makes, recorded by libabigail: tests/capi/fclib.abi.

    python tests/capi_abi.py --write        after a change that is meant; its diff is reviewed

A library of empty functions is compiled from the header alone, with the versions of the symbols.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
HEADER = ROOT / "include" / "fclib.h"
VERSIONS = ROOT / "cmake" / "fclib.map"
RECORDED = ROOT / "tests" / "capi" / "fclib.abi"


def declared() -> list[str]:
    """The declarations of the functions in the header."""
    text = re.sub(r"/\*.*?\*/", "", HEADER.read_text(), flags=re.DOTALL)
    return re.findall(r"^[\w *]+?\bfclib_\w+\([^()]*\)(?=;)", text, re.MULTILINE)


def exported() -> dict[str, str]:
    """The version of each name, by the list of what is exported."""
    text = re.sub(r"/\*.*?\*/", "", VERSIONS.read_text(), flags=re.DOTALL)
    return {
        name: version
        for version, body in re.findall(r"(FCLIB_[\d.]+) \{(.*?)\}", text, re.DOTALL)
        for name in re.findall(r"\bfclib_\w+", body)
    }


def describe(folder: Path) -> Path:
    """What libabigail says of the header as it is."""
    source, library, result = (folder / name for name in ("stub.c", "libfclib.so.0", "now.abi"))
    bodies = "".join(f"{declaration} {{ __builtin_trap(); }}\n" for declaration in declared())
    source.write_text(f"#include <fclib.h>\n{bodies}")
    compiler = shutil.which("cc") or "cc"
    options = ["-g", "-w", "-shared", "-fPIC", f"-I{HEADER.parent}", "-Wl,-soname,libfclib.so.0"]
    script = f"-Wl,--version-script={VERSIONS}"
    command = [compiler, *options, script, str(source), "-o", str(library)]
    subprocess.run(command, check=True, cwd=folder)
    plain = ["--no-corpus-path", "--no-comp-dir-path", "--no-show-locs", "--no-elf-needed"]
    subprocess.run(["abidw", *plain, "--out-file", str(result), str(library)], check=True)
    result.write_text(result.read_text().replace(f"{folder}/", ""))
    return result


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        raise SystemExit(__doc__)
    with tempfile.TemporaryDirectory() as name:
        shutil.copyfile(describe(Path(name)), RECORDED)
