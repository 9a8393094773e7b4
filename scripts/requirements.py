"""Print the requirements of a part of pyproject.toml, one a line: build-system, or an extra."""

import re
import sys
from pathlib import Path

part = sys.argv[1]
text = Path("pyproject.toml").read_text()
# Python 3.10 has no tomllib; the file is ours, and its lists are plain
key = "requires" if part == "build-system" else re.escape(part)
found = re.search(rf"^{key} = \[(.*?)\]", text, re.MULTILINE | re.DOTALL)
if found is None:
    sys.exit(f"pyproject.toml has no list of requirements for {part}")
print("\n".join(re.findall(r'"([^"]+)"', found.group(1))))
