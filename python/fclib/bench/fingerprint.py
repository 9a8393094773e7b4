"""A digest of the sources of a solver: two versions of it have different digests.

A run is repeated only if its solver has changed since.

    of the core     its sources and those they include, as the core was built
    a program       the files that the command names, the program itself too
    a plugin        its shared object
    a module        its file and those it imports; of packages the version
    an adapter      the version of its package
"""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import shlex
import shutil
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from fclib import _core, external
from fclib.external import command, plugin

LENGTH = 12  # digits of a digest
INSTALLED = tuple(
    f"{Path(sysconfig.get_path(name)).resolve()}/"
    for name in ("stdlib", "platstdlib", "purelib", "platlib")
)


def version_of(info: _core.SolverInfo, modules: Sequence[str] = ()) -> str:
    """The version of a solver; two solvers with the same version are the same.

    Args:
        info: the solver.
        modules: the user's files; one of them may define it.
    """
    if info.name in _core.fingerprints():
        return f"{_core.version}-{_core.fingerprints()[info.name]}"
    if info.name.startswith(command.PREFIX):
        return _of_files(_named(info.name.removeprefix(command.PREFIX)))
    if info.name.startswith(plugin.PREFIX):
        return _of_files([Path(info.name.removeprefix(plugin.PREFIX))])
    for path in modules:
        if Path(path).stem == info.origin:
            return _of_module(sys.modules[info.origin], Path(path))
    for adapter in external.adapters():
        if info.name.startswith(adapter.PREFIX):
            return adapter.version().partition(" in ")[0]  # without the interpreter that has it
    try:
        return importlib.metadata.version(info.origin)
    except (importlib.metadata.PackageNotFoundError, ValueError):
        return ""


def _digest(parts: dict[str, bytes]) -> str:
    whole = hashlib.sha256()
    for name in sorted(parts):
        whole.update(name.encode() + b"\0" + parts[name] + b"\0")
    return whole.hexdigest()[:LENGTH]


def _of_files(paths: Sequence[Path]) -> str:
    parts = {str(k): hashlib.sha256(path.read_bytes()).digest() for k, path in enumerate(paths)}
    return _digest(parts)


def _named(text: str) -> list[Path]:
    """The files that a command names, its program first."""
    words = shlex.split(text)
    program = shutil.which(words[0])
    found = [Path(program)] if program else []
    return found + [path for word in words[1:] if (path := Path(word)).is_file()]


def _of_module(module: ModuleType, path: Path) -> str:
    """A digest of a module with all that it imports, as far as that is imported."""
    parts: dict[str, bytes] = {}
    waiting = [(module, path)]
    seen = {path}
    while waiting:
        current, file = waiting.pop()
        text = file.read_bytes()
        # by its whole name: files of two packages may have the same name
        parts[f"{current.__name__}.py"] = hashlib.sha256(text).digest()
        for name in _imported(text, current.__name__, getattr(current, "__package__", "") or ""):
            found = sys.modules.get(name)
            where = Path(getattr(found, "__file__", None) or "").resolve()
            top = name.partition(".")[0]
            if found is None or where in seen or not where.is_file():
                continue
            seen.add(where)
            if top in sys.stdlib_module_names:
                parts[" python"] = sys.version.encode()
            elif str(where).startswith(INSTALLED) or where.suffix != ".py" or top == "fclib":
                parts[f" {top}"] = _installed(top, where)
            else:
                waiting.append((found, where))
    return _digest(parts)


def _installed(name: str, file: Path) -> bytes:
    """The version of a package; if it has none, its file."""
    for package in importlib.metadata.packages_distributions().get(name, [name]):
        try:
            return importlib.metadata.version(package).encode()
        except importlib.metadata.PackageNotFoundError:
            continue
    return hashlib.sha256(file.read_bytes()).digest()


def _imported(text: bytes, module: str, package: str) -> list[str]:
    """The names of modules that a source imports, anywhere in it."""
    names = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1]
            base = ".".join([*above, node.module or ""]).strip(".") if node.level else node.module
            names += [base or "", *(f"{base}.{alias.name}" for alias in node.names)]
    return [name for name in dict.fromkeys(names) if name and name != module]
