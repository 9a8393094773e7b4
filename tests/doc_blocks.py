"""The code blocks of the Markdown pages, found by markdown-it."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt

ROOT = Path(__file__).parent.parent
# `<!-- not run: why -->` before a block, or `<!-- not run (word, word): why -->` for some lines
MARK = re.compile(r"<!--\s*not run(?: \(([^)]*)\))?:\s*(.*?)\s*-->", re.DOTALL)
# `<!-- needs: a module, another -->`: run where these are installed
NEEDS = re.compile(r"<!--\s*needs:\s*([\w, ]+?)\s*-->")
PROGRAMS = ("fclib", ".venv/bin/python", "make", "cmake", "pip", "dask", "python", "cc", "ninja")
# languages that hold nothing to run
WORDS = ("text", "math", "bibtex")


@dataclass(frozen=True)
class Block:
    """A block of code of a page."""

    page: str  # path from the root
    line: int
    language: str
    code: str
    reason: str = ""  # why it is not run, or not all of it
    words: tuple[str, ...] = ()  # of the lines that the reason is for; none: of all
    file: str = ""  # the name under which a reader saves it: ```python NAME

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"

    @property
    def runs(self) -> bool:
        """Whether some of it is to be run."""
        return self.language not in WORDS and (not self.reason or bool(self.words))

    def skips(self, line: str) -> bool:
        """Whether a line of it is not to be run."""
        return bool(self.reason) and (not self.words or any(w in line for w in self.words))

    def commands(self) -> Iterator[str]:
        """The commands of a block of them: continued lines joined, remarks left out."""
        joined = re.sub(r"\\\n\s*", "", self.code)
        for line in joined.splitlines():
            # what follows after two blanks is a remark or an explanation
            command = re.split(r"\s{2,}|\s+# ", line.strip())[0]
            if command and not command.startswith("#"):
                yield from command.split(" && ")


def pages() -> list[Path]:
    """The pages whose blocks are tested one by one."""
    tops = ["README.md", "ARCHITECTURE.md"]
    docs = sorted((ROOT / "docs").glob("*.md"))
    notes = sorted((ROOT / "workshop").rglob("*.md"))
    own = [page for page in docs if page not in tutorials()]
    return [*(ROOT / name for name in tops), *own, *notes]


def tutorials() -> list[Path]:
    """The pages that are followed from the first line to the last, in an empty folder."""
    return sorted((ROOT / "docs").glob("tutorial-*.md"))


def blocks_of(page: Path) -> Iterator[Block]:
    """The blocks of a page, in order."""
    reason = ""
    words: tuple[str, ...] = ()
    for token in MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8")):
        if token.type == "html_block":
            found = MARK.search(token.content)
            reason = " ".join(found[2].split()) if found else ""
            names = (found[1] or "").split(",") if found else []
            words = tuple(name.strip() for name in names if name.strip())
            if needs := NEEDS.search(token.content):
                absent = [one for one in needs[1].split(", ") if not importlib.util.find_spec(one)]
                reason = f"not installed here: {', '.join(absent)}" if absent else ""
        elif token.type in ("fence", "code_block"):
            assert token.map is not None
            language, _, file = token.info.strip().partition(" ")
            language = language or guess(token.content)
            name = page.relative_to(ROOT).as_posix()
            yield Block(name, token.map[0] + 1, language, token.content, reason, words, file)
            reason, words = "", ()


def guess(code: str) -> str:
    """The language of a block that states none."""
    first = code.split(maxsplit=1)[0]
    if first.startswith("[") and "=" in code:
        return "toml"
    return "sh" if first in PROGRAMS or first.startswith("#") else "text"
