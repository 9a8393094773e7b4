"""The include direction: files, problems, conversions, solvers, merits, each in its layer.

A new folder must be given a place here.
"""

import ast
import graphlib
import re
from pathlib import Path

import pytest

# what a part of core/ may include: the parts of the layers above it here, and itself
LAYERS: list[set[str]] = [
    {
        "deadline.hpp",
        "error.hpp",
        "field.hpp",
        "friction.hpp",
        "function_ref.hpp",
        "error_size.hpp",
        "merit_kind.hpp",
        "number_text.hpp",
        "place.hpp",
        "version.hpp",
    },
    {"error.cpp", "number_text.cpp", "problem_info.hpp", "geometry.hpp"},
    {"contact"},
    {"linalg"},
    {"solution.hpp", "problems"},
    {"formulations.hpp"},
    {"problem.hpp"},
    {"problem.cpp"},
    {"joints"},
    {"merit", "proof", "convert", "io"},
    {"reduced"},
    {"systems"},
    {"solve"},
    {"embed", "stepping"},
    {"methods"},
    {"chain"},
    {"solvers", "solver_table.cpp"},
    {"capi"},
]
# and what it must not, not even by way of others
FORBIDDEN = {
    # a solver sees neither file nor formulation, and does not judge itself
    "solvers": {"io", "convert", "merit", "proof", "problems", "problem.hpp"},
    # what solvers are made of knows no formulation
    "chain": {"io", "convert", "merit", "proof", "problems", "problem.hpp", "solution.hpp"},
    "methods": {"io", "convert", "merit", "proof", "problems", "problem.hpp", "solution.hpp"},
    "systems": {"io", "convert", "merit", "proof", "problems", "problem.hpp", "solution.hpp"},
    "reduced": {"io", "convert", "merit", "proof", "problems", "problem.hpp", "solution.hpp"},
    "contact": {"linalg", "problems", "problem.hpp", "solution.hpp"},
    # files know no mathematics
    "io": {"contact", "reduced", "systems", "methods"},
}
# headers that not every system has, and the files of core/ that include them: a port writes these
OF_A_SYSTEM = re.compile(r"(unistd|fcntl|dlfcn|link|pthread|windows|io|direct)\.h|sys/.*")
SEES_THE_SYSTEM = {"io/replace_file.cpp", "solve/plugin.cpp"}
# made by the build from the files that are there
GENERATED = {"formulations.hpp", "version.hpp", "solver_table.cpp"}

# the parts of the Python package in one order, and what each may import of those above it: wherever
# in a file an import stands, it counts. "__init__" is what `import fclib` gives
PYTHON: dict[str, set[str]] = {
    "_entry_points": set(),
    "_files": set(),
    "_marked": set(),
    "_words": set(),
    "_geometry": {"_words"},
    "_stored": set(),
    "_suggest": set(),
    "_symmetry": set(),
    "_verdicts": set(),
    "_core": set(),
    "_laws": {"_core"},
    "_display": {"_core"},
    "_origin": {"_core"},
    "_regular": set(),
    "_digest": set(),
    "_registry": {"_core", "_entry_points", "_laws", "_suggest"},
    "_equality": set(),
    "_solve": {"_core", "_laws", "_registry"},
    "_sequence": {"_core", "_solve", "_words"},
    "_judge": {"_core", "_solve"},
    "_device": {"_core", "_words"},
    "_batch": {"_core", "_device", "_equality", "_solve", "_words"},
    "_batch_global": {"_batch", "_core", "_solve"},
    "_batch_derivatives": {"_batch", "_core", "_equality", "_solve"},
    "_workspace": {"_core", "_solve"},
    "_derivatives": {"_core", "_equality", "_laws"},
    "_layer": {"_solve", "_batch", "_batch_derivatives", "_core"},
    "torch": {"_core", "_layer"},
    "jax": {"_core", "_layer"},
    "external": {"_core", "_laws", "_marked", "_registry"},
    "analysis": {
        "_core",
        "_digest",
        "_judge",
        "_laws",
        "_registry",
        "_regular",
        "_solve",
        "_symmetry",
        "_words",
    },
    "scenes": {"_core", "_entry_points", "_geometry", "_regular", "_stored", "_suggest"},
    "simulate": {
        "_core",
        "_files",
        "_geometry",
        "_laws",
        "_origin",
        "_regular",
        "_solve",
        "_words",
        "scenes",
    },
    "recorders": {
        "_core",
        "_laws",
        "_origin",
        "_sequence",
        "_solve",
        "_words",
        "external",
        "scenes",
    },
    "collections": {
        "_regular",
        "_files",
        "_laws",
        "_core",
        "_digest",
        "_geometry",
        "_judge",
        "_stored",
        "_suggest",
        "_origin",
        "_sequence",
        "_solve",
        "_verdicts",
        "_words",
        "analysis",
        "scenes",
        "simulate",
    },
    "bench": {
        "_marked",
        "_files",
        "_laws",
        "_core",
        "_digest",
        "_entry_points",
        "_suggest",
        "_origin",
        "_registry",
        "_regular",
        "_sequence",
        "_solve",
        "_verdicts",
        "_words",
        "external",
        "analysis",
        "scenes",
        "simulate",
        "collections",
    },
    "results": {
        "_regular",
        "_files",
        "_core",
        "_verdicts",
        "_judge",
        "_digest",
        "_stored",
        "_words",
        "bench",
        "collections",
    },
    "report": {
        "_files",
        "_laws",
        "_core",
        "_geometry",
        "_origin",
        "_registry",
        "_solve",
        "_verdicts",
        "_words",
        "recorders",
        "bench",
        "collections",
    },
    "notebook": {"_files", "_words", "bench", "report"},
    "__init__": {
        "_batch",
        "_batch_derivatives",
        "_batch_global",
        "_core",
        "_derivatives",
        "_device",
        "_digest",
        "_geometry",
        "_registry",
        "_sequence",
        "_solve",
        "_workspace",
        "collections",
        "notebook",
    },
    "demo": {"_files", "__init__", "scenes", "simulate", "bench"},
    "doctor": {"_core", "__init__", "external"},
    "cli": {
        "_files",
        "_laws",
        "_judge",
        "_registry",
        "_regular",
        "_sequence",
        "_solve",
        "_verdicts",
        "_words",
        "__init__",
        "external",
        "_symmetry",
        "analysis",
        "scenes",
        "simulate",
        "recorders",
        "collections",
        "bench",
        "results",
        "report",
        "demo",
        "doctor",
    },
    "__main__": {"cli"},
}
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


def test_a_type_is_defined_once(root: Path) -> None:
    """Of two types of one name in one library the linker may take the functions of either."""
    files: dict[str, list[str]] = {}
    for path in sorted((root / "core").rglob("*.hpp")):
        around: list[str] = []
        for line in path.read_text().splitlines():
            if found := re.match(r"namespace ([\w:]*)", line):
                around.append(found[1])
            elif line.startswith("}  // namespace"):
                around.pop()
            elif found := re.match(r"(?:struct|class|enum class) (\w+)(?!\w)[^;<]*\{", line):
                files.setdefault("::".join([*around, found[1]]), []).append(path.name)
    assert len(files) > 100
    assert not {name: where for name, where in files.items() if len(where) > 1}


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
            if OF_A_SYSTEM.fullmatch(name):
                assert path.relative_to(root / "core").as_posix() in SEES_THE_SYSTEM, where


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


def imported(path: Path, package: Path) -> set[str]:
    """What a module imports of the package, wherever in it, by the dots after `fclib`.

    "" is the package itself. A name that is imported from a module is that module.
    """
    here = ("fclib", *path.relative_to(package).with_suffix("").parts[:-1])
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                base = ".".join([*here[: len(here) - node.level + 1], *filter(None, [base])])
            names = [f"{base}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Call) and "import_module" in ast.dump(node.func):
            names = [str(arg.value) for arg in node.args if isinstance(arg, ast.Constant)]
        for name in names:
            first, _, rest = name.partition(".")
            if first == "fclib":
                while rest and not is_module(package, rest):
                    rest = rest.rpartition(".")[0]
                found.add(rest)
    return found


def is_module(package: Path, name: str) -> bool:
    """Whether there is a module of this name; `_core` is built."""
    path = package.joinpath(*name.split("."))
    return name == "_core" or path.is_dir() or path.with_suffix(".py").is_file()


def name_of(path: Path, package: Path) -> str:
    """The name of a module, as `imported` has it."""
    parts = path.relative_to(package).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@pytest.fixture(scope="module")
def modules(root: Path) -> dict[str, set[str]]:
    """For each module of the package, what it imports of it."""
    package = root / "python" / "fclib"
    found = {name_of(path, package): imported(path, package) for path in package.rglob("*.py")}
    assert len(found) > 100
    return found


def python_part(module: str) -> str:
    return module.partition(".")[0] or "__init__"


def test_imports_follow_the_arrow(modules: dict[str, set[str]]) -> None:
    wrong = []
    for name, targets in modules.items():
        part = python_part(name)
        assert part in PYTHON, f"fclib.{part} has no place: give it one in PYTHON of this test"
        others = {python_part(target) for target in targets} - {part}
        wrong += [f"fclib.{name} imports {other}" for other in others - PYTHON[part]]
    assert not wrong


def test_the_parts_stand_in_one_order(modules: dict[str, set[str]]) -> None:
    above: set[str] = set()
    for part, needed in PYTHON.items():
        assert needed <= above, f"{part} comes before {needed - above}"
        used = {
            python_part(t) for name in modules if python_part(name) == part for t in modules[name]
        }
        assert needed <= used, f"{part} no longer imports {needed - used}"
        above.add(part)


def test_modules_do_not_import_each_other_in_circles(modules: dict[str, set[str]]) -> None:
    # of a package the modules alone: its __init__ gathers names of theirs
    graph = {name: targets - {name} for name, targets in modules.items()}
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        pytest.fail(f"in a circle: {' -> '.join(error.args[1])}")


def test_no_module_imports_by_way_of_its_own_package(modules: dict[str, set[str]]) -> None:
    inside = {name: name.rpartition(".")[0] for name in modules if "." in name}
    assert not [name for name, package in inside.items() if package in modules[name]]


def test_what_families_share_imports_no_family(modules: dict[str, set[str]]) -> None:
    helpers = {name for name in modules if name.startswith("scenes.shared")}
    assert helpers
    assert not [
        f"fclib.{name} imports {target}"
        for name in helpers
        for target in modules[name]
        if target.startswith("scenes") and target not in helpers
    ]


def test_no_command_imports_that_of_another(modules: dict[str, set[str]]) -> None:
    commands = {name for name in modules if name.startswith("cli.") and "._" not in name}
    assert commands
    assert not {(a, b) for a in commands for b in modules[a] & commands}


def test_only_the_core_reads_files(root: Path) -> None:
    """Those of fclib. Scenes of Siconos' mechanics are HDF5 of another layout."""
    for path in sorted((root / "python").rglob("*.py")):
        if path.name == "siconos_scene.py":
            continue
        assert not re.search(r"^\s*(import|from) h5py", path.read_text(), re.MULTILINE), path


def test_the_checks_see_what_they_should(tmp_path: Path) -> None:
    module = tmp_path / "report" / "page.py"
    module.parent.mkdir()
    for name in ("bench", "simulate", "scenes", "cli"):
        (tmp_path / name).mkdir()
    (tmp_path / "scenes" / "wall.py").touch()
    module.write_text(
        "import fclib\nfrom fclib import bench, solve, _core\nfrom ..simulate import x\n"
        "from fclib.scenes.wall import Wall\ndef f():\n    import fclib.cli\n"
    )
    assert imported(module, tmp_path) == {*("", "_core", "bench", "simulate", "scenes.wall", "cli")}
    late = tmp_path / "late.py"
    late.write_text("import importlib\ndef f():\n    importlib.import_module('fclib.cli')\n")
    assert imported(late, tmp_path) == {"cli"}
    chain = {"solvers/a.cpp": {"solve/b.hpp"}, "solve/b.hpp": {"merit/c.hpp"}}
    assert reached(chain, "solvers/a.cpp") == {"solve/b.hpp", "merit/c.hpp"}
    with pytest.raises(pytest.fail.Exception, match="new"):
        layer_of("new")
