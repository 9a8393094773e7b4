"""The page of the Python interface: what `fclib` has, from its stubs and its docstrings."""

from __future__ import annotations

import ast
import importlib.resources
import inspect
import re
import textwrap
from collections.abc import Iterator

import fclib

Definition = ast.FunctionDef | ast.ClassDef
OPERATORS = "__"


def pages() -> Iterator[tuple[str, str]]:
    """One page."""
    stubs = importlib.resources.files("fclib").joinpath("_core.pyi").read_text(encoding="utf-8")
    core: dict[str, list[Definition]] = {}
    for node in ast.parse(stubs).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            core.setdefault(node.name, []).append(node)
    lines = [
        "# Python",
        "",
        "What `import fclib` gives. Matrices are SciPy's sparse arrays or NumPy arrays, vectors "
        "NumPy arrays; those of problems and solutions are views of their data, not to be written "
        "to. `fclib.analysis`, `fclib.bench`, `fclib.report`, `fclib.scenes` and `fclib.simulate` "
        "are imported on their own.",
        "",
    ]
    functions = [name for name in fclib.__all__ if not is_class(name) and name[0] != "_"]
    classes = [name for name in fclib.__all__ if is_class(name)]
    for name in [*functions, *classes]:
        lines += [f"## {name}", ""]
        if name in core:
            for definition in core[name]:
                lines += described(definition)
        else:
            lines += written(name)
    yield "python.md", "\n".join(lines) + "\n"


def is_class(name: str) -> bool:
    """Whether a name is one of a class."""
    return isinstance(getattr(fclib, name), type)


def written(name: str) -> list[str]:
    """What is written in Python."""
    thing = getattr(fclib, name)
    doc = inspect.getdoc(thing) or ""
    if name == "Problem":
        return [f"```python\nProblem = {str(thing).replace('fclib._core.', '')}\n```", ""]
    if isinstance(thing, type) and issubclass(thing, Exception):
        return prose(doc)
    signature = str(inspect.signature(thing)).replace("fclib._core.", "").replace("_core.", "")
    kind = "class" if isinstance(thing, type) else "def"
    return [f"```python\n{kind} {name}{signature}\n```", "", *prose(doc)]


def described(definition: Definition) -> list[str]:
    """A function or a class of the core, from its stub."""
    if isinstance(definition, ast.FunctionDef):
        return [*fenced(signature(definition)), *text_of(definition)]
    lines = text_of(definition)
    members = [node for node in definition.body if isinstance(node, ast.FunctionDef)]
    values = [node for node in members if decorated(node, "property")]
    if values:
        lines += ["| name | type | meaning |", "|---|---|---|"]
        lines += [
            f"| `{node.name}` | {cell(ast.unparse(node.returns) if node.returns else '')} "
            f"| {cell(ast.get_docstring(node) or '')} |"
            for node in values
        ]
        lines.append("")
    for node in members:
        if node in values or (node.name.startswith(OPERATORS) and node.name != "__init__"):
            continue
        lines += [*fenced(signature(node)), *text_of(node)]
    return lines


def decorated(node: ast.FunctionDef, name: str) -> bool:
    """Whether a function has a decorator."""
    return any(isinstance(item, ast.Name) and item.id == name for item in node.decorator_list)


def signature(node: ast.FunctionDef) -> str:
    """The head of a function, folded if it is long."""
    head = f"{node.name}({ast.unparse(node.args)})"
    head = head.replace("numpy.typing.", "").replace("numpy.", "")
    if len(head) > 88:
        head = re.sub(r", (?=\*|/|\w+[:=])", ",\n    ", head).replace("(", "(\n    ", 1)
    result = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    return head + result.replace("numpy.typing.", "").replace("numpy.", "")


def fenced(code: str) -> list[str]:
    """Code, fenced."""
    return ["```python", code, "```", ""]


def text_of(node: Definition) -> list[str]:
    """The docstring, as it is."""
    return prose(ast.get_docstring(node) or "")


def prose(doc: str) -> list[str]:
    """A docstring in a fence, long lines folded."""
    lines: list[str] = []
    for line in doc.splitlines():
        indent = " " * (len(line) - len(line.lstrip()))
        lines += textwrap.wrap(line, 96, subsequent_indent=indent) if len(line) > 96 else [line]
    return ["```text", *lines, "```", ""] if doc else []


def cell(text: str) -> str:
    """Text that a table holds."""
    text = text.replace("numpy.typing.", "").replace("numpy.", "")
    return " ".join(text.split()).replace("|", r"\|")
