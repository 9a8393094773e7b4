"""The include direction: files, problems, conversions, solvers, merits, each in its layer.

A new folder must be given a place here.
"""

import ast
import re
from pathlib import Path

import pytest

# what a part of core/ may include: the parts of the layers above it here, and itself
LAYERS: list[set[str]] = [
    {"error.hpp", "field.hpp", "friction.hpp", "function_ref.hpp", "version.hpp"},
    {"problem_info.hpp"},
    {"contact"},
    {"linalg"},
    {"solution.hpp", "problems"},
    {"formulations.hpp"},
    {"problem.hpp"},
    {"merit", "convert", "io"},
    {"reduced"},
    {"systems"},
    {"solve"},
    {"methods"},
    {"solvers", "solver_table.cpp"},
    {"capi"},
]
# and what it must not, not even by way of others
FORBIDDEN = {
    # a solver sees neither file nor formulation, and does not judge itself
    "solvers": {"io", "convert", "merit", "problems", "problem.hpp"},
    # what solvers are made of knows no formulation
    "methods": {"io", "convert", "merit", "problems", "problem.hpp", "solution.hpp"},
    "systems": {"io", "convert", "merit", "problems", "problem.hpp", "solution.hpp"},
    "reduced": {"io", "convert", "merit", "problems", "problem.hpp", "solution.hpp"},
    "contact": {"linalg", "problems", "problem.hpp", "solution.hpp"},
    # files know no mathematics
    "io": {"contact", "reduced", "systems", "methods"},
}
# made by the build from the files that are there
GENERATED = {"formulations.hpp", "version.hpp", "solver_table.cpp"}

# what a part of the Python package may import: "api" is fclib itself
PYTHON: dict[str, set[str]] = {
    "_registry": {"_core"},
    "_solve": {"_core", "_registry"},
    "_digest": set(),
    "__init__": {"_core", "_digest", "_registry", "_solve"},
    "scenes": {"api"},
    "simulate": {"api", "scenes"},
    "external": {"api", "_registry"},
    "analysis": {"api"},
    "bench": {"api", "external", "scenes", "simulate"},
    "collections": {"api", "analysis", "scenes", "simulate"},
    "report": {"api", "bench", "collections", "scenes"},
    "demo": {"api", "scenes", "simulate", "bench", "report"},
    "doctor": {"_core", "api", "external"},
    "cli": {
        "api",
        "analysis",
        "collections",
        "scenes",
        "simulate",
        "external",
        "bench",
        "report",
        "demo",
        "doctor",
    },
    "__main__": {"cli"},
}
# and what only its functions import, when they are called
LATER: dict[str, set[str]] = {"__init__": {"collections"}}
ARROW = "files -> io -> problem -> convert -> solver -> solution -> merit"


def part_of(relative: Path) -> str:
    """The folder of a file, or its own name where it lies at the top."""
    name = relative.parts[0]
    return name.removesuffix(".in") if len(relative.parts) == 1 else name


def layer_of(part: str) -> int:
    for number, layer in enumerate(LAYERS):
        if part in layer:
            return number
    pytest.fail(f"core/{part} is in no layer: give it its place in LAYERS of this test ({ARROW})")


@pytest.fixture(scope="module")
def includes(root: Path) -> dict[str, set[str]]:
    """For each file of core/, what it includes of core/."""
    core = root / "core"
    found: dict[str, set[str]] = {}
    for path in sorted(core.rglob("*")):
        if path.is_dir() or path.suffix == ".md":
            continue
        relative = path.relative_to(core)
        quoted = re.findall(r'^\s*#\s*include\s+"([^"]+)"', path.read_text(), re.MULTILINE)
        names = set()
        for name in quoted:
            beside = relative.parent / name
            known = (core / name).is_file() or name in GENERATED
            assert known or (core / beside).is_file(), f"core/{relative} includes {name}"
            names.add(name if known else beside.as_posix())
        found[relative.as_posix()] = names
    assert len(found) > 20
    return found


def test_every_part_of_the_core_has_its_layer(includes: dict[str, set[str]]) -> None:
    for name in includes:
        layer_of(part_of(Path(name)))


def test_includes_follow_the_arrow(includes: dict[str, set[str]]) -> None:
    wrong = []
    for name, targets in includes.items():
        part = part_of(Path(name))
        for target in targets:
            other = part_of(Path(target))
            if other != part and layer_of(other) >= layer_of(part):
                wrong.append(f"core/{name} includes {target}")
    assert not wrong, f"against the arrow ({ARROW}): {wrong}"


def reached(includes: dict[str, set[str]], name: str) -> set[str]:
    """All that a file includes, by way of others too."""
    seen: set[str] = set()
    waiting = [name]
    while waiting:
        for target in includes.get(waiting.pop(), set()) - seen:
            seen.add(target)
            waiting.append(target)
    return seen


@pytest.mark.parametrize("part", FORBIDDEN)
def test_no_part_sees_what_it_must_not_know(part: str, includes: dict[str, set[str]]) -> None:
    files = [name for name in includes if part_of(Path(name)) == part]
    assert files
    wrong = [
        f"core/{name} sees {target}"
        for name in files
        for target in reached(includes, name)
        if part_of(Path(target)) in FORBIDDEN[part]
    ]
    assert not wrong


def test_a_solver_is_one_file(includes: dict[str, set[str]]) -> None:
    for name, targets in includes.items():
        if part_of(Path(name)) == "solvers":
            assert Path(name).suffix == ".cpp"
            assert not any(part_of(Path(target)) == "solvers" for target in targets), name


def test_outside_libraries_are_seen_where_they_belong(root: Path) -> None:
    for path in sorted((root / "core").rglob("*.[ch]pp")):
        system = re.findall(r"^\s*#\s*include\s+<([^>]+)>", path.read_text(), re.MULTILINE)
        for name in system:
            where = f"{path.relative_to(root)} includes {name}"
            assert "python" not in name.lower(), where
            assert not name.startswith(("nanobind", "pybind11", "numpy")), where
            if name.lower().startswith(("hdf5", "h5")):
                assert path.parent == root / "core" / "io" / "hdf5", where


def test_no_solver_and_no_formulation_is_named_outside_its_file(root: Path) -> None:
    solvers = [path.stem for path in (root / "core" / "solvers").glob("*.cpp")]
    assert solvers
    generic = [
        *(root / "bindings").glob("*.[ch]pp"),
        *(root / "core" / "solve").glob("*.[ch]pp"),
        *(root / "core" / "io").rglob("*.[ch]pp"),
    ]
    for path in generic:
        code = re.sub(r"//.*", "", path.read_text())
        for solver in solvers:
            assert not re.search(rf"\b{solver}\b", code), f"{path.relative_to(root)} names {solver}"


# ---- Python


def imports_of(path: Path, root: Path) -> set[str]:
    """The parts of fclib that a module imports, wherever in it."""
    inside = path.relative_to(root).with_suffix("").parts
    package = ("fclib", *inside[:-1])
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                base = ".".join([*package[: len(package) - node.level + 1], *filter(None, [base])])
            names = [f"{base}.{alias.name}" for alias in node.names]
        for name in names:
            parts = name.split(".")
            if parts[0] == "fclib":
                part = parts[1] if len(parts) > 1 else ""
                found.add(part if part in PYTHON or part == "_core" else "api")
    return found


def test_imports_follow_the_arrow(root: Path) -> None:
    package = root / "python" / "fclib"
    modules = sorted(package.rglob("*.py"))
    assert len(modules) > 10
    wrong = []
    for path in modules:
        part = path.relative_to(package).with_suffix("").parts[0]
        assert part in PYTHON, f"fclib.{part} has no place: give it one in PYTHON of this test"
        for other in imports_of(path, package):
            if other not in {part} | PYTHON[part] | LATER.get(part, set()):
                wrong.append(f"{path.relative_to(package)} imports {other}")
    assert not wrong


def test_parts_do_not_import_each_other_in_circles() -> None:
    settled: set[str] = {"_core", "api"}
    for part, needed in PYTHON.items():
        assert needed <= settled, part
        settled.add(part)


def test_only_the_core_reads_files(root: Path) -> None:
    for path in sorted((root / "python").rglob("*.py")):
        assert not re.search(r"^\s*(import|from) h5py", path.read_text(), re.MULTILINE), path


def test_the_checks_see_what_they_should(tmp_path: Path) -> None:
    module = tmp_path / "report" / "page.py"
    module.parent.mkdir()
    module.write_text(
        "import fclib\nfrom fclib import solve, bench\nfrom ..simulate import x\n"
        "from fclib.scenes import y\ndef f():\n    import fclib.cli\n"
    )
    assert imports_of(module, tmp_path) == {"api", "bench", "simulate", "scenes", "cli"}
    chain = {"solvers/a.cpp": {"solve/b.hpp"}, "solve/b.hpp": {"merit/c.hpp"}}
    assert reached(chain, "solvers/a.cpp") == {"solve/b.hpp", "merit/c.hpp"}
    with pytest.raises(pytest.fail.Exception, match="new"):
        layer_of("new")
