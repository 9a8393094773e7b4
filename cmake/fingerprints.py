"""Write what each built-in solver is made of, as a digest, by ``fingerprints.py CORE OUTPUT.cpp``.

The sources of a solver are its file and the driver, what they include, and the .cpp files beside
the headers among those. A change in one of them, comments too, is another solver for the bench.
"""

from __future__ import annotations

import hashlib
import re
import sys
from pathlib import Path

INCLUDE = re.compile(rb'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)
TEMPLATE = """// made by cmake/fingerprints.py
#include <map>
#include <string>

#include "fingerprints.hpp"
#include "solve/solver.hpp"

namespace fclib {{

{declarations}namespace bindings {{

const std::map<std::string, std::string>& fingerprints() {{
  static const std::map<std::string, std::string> known{{
{entries}  }};
  return known;
}}

}}  // namespace bindings
}}  // namespace fclib
"""


def sources(core: Path, roots: list[Path]) -> list[Path]:
    """All files that some files are made of, themselves too."""
    found = dict.fromkeys(roots)
    waiting = list(roots)
    while waiting:
        file = waiting.pop()
        parts = [core / name.decode() for name in INCLUDE.findall(file.read_bytes())]
        parts += [file.with_suffix(".cpp")]
        for part in parts:
            if part.is_file() and part not in found:
                found[part] = None
                waiting.append(part)
    return sorted(found)


def main() -> None:
    """Write the table."""
    core, output = Path(sys.argv[1]), Path(sys.argv[2])
    digests: dict[Path, bytes] = {}
    entries, declarations = "", ""
    for solver in sorted((core / "solvers").glob("*.cpp")):
        whole = hashlib.sha256()
        for file in sources(core, [solver, core / "solve" / "driver.cpp"]):
            if file not in digests:
                digests[file] = hashlib.sha256(file.read_bytes()).digest()
            whole.update(file.relative_to(core).as_posix().encode() + b"\0" + digests[file])
        name = solver.stem
        declarations += f"namespace {name} {{\nconst Solver& solver();\n}}\n"
        entries += f'      {{{name}::solver().name, "{whole.hexdigest()[:12]}"}},\n'
    output.write_text(TEMPLATE.format(entries=entries, declarations=declarations))


if __name__ == "__main__":
    main()
