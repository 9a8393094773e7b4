"""The page of the C interface, from include/fclib.h."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

RULE = re.compile(r"^/\* -+ (.+?) -+ \*/$", re.MULTILINE)
COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
DECLARED = re.compile(
    r"^(?:[\w *]+?\b(fclib_\w+)\(|(?:struct|enum) (?:FCLIB_APICOMPILE )?(\w+) \{)"
    r"|^typedef .*?\(\*(fclib_\w+)\)",
    re.MULTILINE,
)


def pages(root: Path) -> Iterator[tuple[str, str]]:
    """One page."""
    header = (root / "include" / "fclib.h").read_text(encoding="utf-8")
    opening = header[: header.index("*/")]
    about = re.sub(r"^(/\*| \*) ?", "", opening, flags=re.MULTILINE).strip()
    lines = [
        "# fclib.h",
        "",
        "The C interface, from its header; [C, C++, Fortran](compiled.md) shows how it is used.",
        "",
        "```text",
        about,
        "```",
        "",
    ]
    parts = RULE.split(header)
    for title, body in zip(parts[1::2], parts[2::2], strict=True):
        lines += [f"## {title.capitalize()}", ""]
        for chunk in re.split(r"\n{2,}", body):
            code = COMMENT.sub("", chunk)
            names = [name for found in DECLARED.findall(code) for name in found if name]
            if not names:
                continue
            lines += [f"({name})=" for name in names]
            lines += [f"### {names[0]}", "", "```c", chunk.strip(), "```", ""]
    yield "c-api.md", "\n".join(lines)
