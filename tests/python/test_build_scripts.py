"""What the scripts around the build make of what the tools print; the development install."""

import hashlib
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import rebuild
from helpers import git, ran, script

DEPENDENCIES = """\
core/a.o: #deps 3, deps mtime 1700000000000000000 (VALID)
    ../core/solvers/a.cpp
    ../core/methods/m.hpp
    /usr/include/hdf5.h

core/b.o: #deps 2, deps mtime 1700000000000000000 (VALID)
    ../core/solvers/b.cpp
    ../core/methods/../methods/m.hpp

core/gone.o: #deps 1, deps mtime 1 (STALE)
    ../core/methods/m.hpp

"""


@pytest.fixture(scope="module")
def build_cost() -> ModuleType:
    return script("scripts/build_cost.py")


@pytest.fixture(scope="module")
def coverage_report() -> ModuleType:
    return script("scripts/coverage_report.py")


# ---- what a build costs


def test_touching_a_header_costs_the_objects_that_include_it(
    build_cost: ModuleType, tmp_path: Path
) -> None:
    objects = {"core/a.o": 3.0, "core/b.o": 4.0}
    includes = build_cost.dependencies(DEPENDENCIES)
    assert set(includes) == set(objects), "an entry that ninja calls stale is none"
    costs = build_cost.touching(objects, includes, tmp_path / "build", tmp_path)
    assert [(one.name, one.seconds, one.objects) for one in costs] == [
        ("core/methods/m.hpp", 7.0, 2),
        ("core/solvers/b.cpp", 4.0, 1),
        ("core/solvers/a.cpp", 3.0, 1),
    ]


def test_goals_are_judged_by_the_dearest_file(build_cost: ModuleType) -> None:
    def judged(whole: float, method: float, solver: float) -> list[str]:
        cost = build_cost.Cost
        return list(
            build_cost.goals(
                [
                    cost("total", build_cost.WHOLE, whole, 60),
                    cost("touch", "core/methods/a.hpp", method, 9),
                    cost("touch", "core/methods/b.hpp", 1.0, 1),
                    cost("touch", "core/solvers/a.cpp", solver, 1),
                    cost("object", "core/solvers/a.cpp.o", 1000.0, 1),
                ]
            )
        )

    assert all(line.partition(": ")[2].count(": reached") for line in judged(240, 40, 15))
    wrong = judged(241, 41, 16)
    assert len(wrong) == 3
    assert all("NOT reached" in line for line in wrong)
    assert "core/methods/a.hpp" in wrong[1]


def test_costs_are_kept_and_compared(build_cost: ModuleType, tmp_path: Path) -> None:
    costs = [
        build_cost.Cost("total", build_cost.WHOLE, 10.0, 2),
        build_cost.Cost("touch", "core/field.hpp", 7.25, 2),
    ]
    build_cost.write_csv(tmp_path / "costs.csv", costs)
    assert build_cost.read_csv(tmp_path / "costs.csv") == costs
    now = [build_cost.Cost("total", build_cost.WHOLE, 5.0, 2), costs[1]]
    lines = build_cost.table(now, costs, 10)
    assert any(line.split()[:2] == ["10.0", "5.0"] for line in lines)


def test_only_what_two_objects_define_is_duplicate(build_cost: ModuleType) -> None:
    first = """\
0000000000000000 0000000000000010 W _Z4bothv
0000000000000000 0000000000000020 T _Z3onev
0000000000000000 0000000000000100 V _ZTI4data
                 U malloc
"""
    second = """\
0000000000000000 0000000000000010 W _Z4bothv
0000000000000000 0000000000000004 t local
"""
    assert build_cost.duplicate_share([first]) == (0, 0x30)
    assert build_cost.duplicate_share([first, second]) == (0x10, 0x44)


def test_what_a_compiler_took_is_recorded(build_cost: ModuleType, tmp_path: Path) -> None:
    work = "import sys; open(sys.argv[2], 'w'); sum(range(10**6))"
    output = str(tmp_path / "a.o")
    assert build_cost.record(tmp_path, [sys.executable, "-c", work, "-o", output]) == 0
    assert build_cost.record(tmp_path, [sys.executable, "-c", "raise SystemExit(3)"]) == 3
    objects, linking = build_cost.recorded(tmp_path)
    assert list(objects) == [output]
    assert objects[output] > 0
    assert linking == 0


# ---- lines that no test runs


def test_a_line_that_one_instance_runs_is_run(coverage_report: ModuleType) -> None:
    lines = [
        {"line_number": 1, "count": 0},
        {"line_number": 1, "count": 2},
        {"line_number": 2, "count": 0},
        {"line_number": 3, "count": 0, "gcovr/noncode": True},
    ]
    assert coverage_report.merged([{"file": "a.hpp", "lines": lines}]) == {
        "a.hpp": {1: True, 2: False}
    }


def test_what_cmake_tried_the_compiler_on_is_no_part_of_the_counts(
    coverage_report: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("gcovr", reason="of make coverage")
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("there is no g++")
    build = tmp_path / "build" / "coverage"
    one, tried = build / "CMakeFiles" / "one.dir", build / "CMakeFiles" / "tried"
    for folder in (one, tried, tmp_path / "core"):
        folder.mkdir(parents=True)
    source = tmp_path / "core" / "a.cpp"
    source.write_text("int main(int n, char**) {\n  if (n > 1)\n    return 1;\n  return 0;\n}\n")
    gone = tried / "gone.cpp"
    gone.write_text("int gone() { return 0; }\n")
    compile_it = [compiler, "--coverage", "-O0"]
    subprocess.run([*compile_it, "-c", gone.name, "-o", "gone.o"], cwd=tried, check=True)
    gone.unlink()
    subprocess.run([*compile_it, "-c", source, "-o", one / "a.o"], cwd=build, check=True)
    subprocess.run([*compile_it, one / "a.o", "-o", build / "a"], cwd=build, check=True)
    subprocess.run([build / "a"], cwd=build, check=True)

    monkeypatch.setattr(coverage_report, "ROOT", tmp_path)
    assert coverage_report.lines_of_cpp(build) == {
        "core/a.cpp": {1: True, 2: True, 3: False, 4: True}
    }


def test_lines_that_no_test_runs_are_named(coverage_report: ModuleType) -> None:
    good = dict.fromkeys(range(1, 97), True)
    bad = {1: True, 2: False, 3: False, 5: False}
    lines, enough = coverage_report.report({"C++": {"good.cpp": good, "bad.cpp": bad}}, 92.0)
    assert enough, "97 of 100"
    assert any("bad.cpp: 2-3, 5" in line for line in lines)
    assert not any("good.cpp" in line for line in lines)


@pytest.mark.parametrize("missed", [9, 100])
def test_too_few_lines_of_one_language_are_too_few(
    coverage_report: ModuleType, missed: int
) -> None:
    good = {"a.py": dict.fromkeys(range(100), True)}
    bad = {"a.cpp": {number: number >= missed for number in range(100)}}
    assert coverage_report.report({"Python": good}, 92.0)[1]
    assert not coverage_report.report({"C++": bad, "Python": good}, 92.0)[1]
    assert not coverage_report.report({"C++": {}, "Python": good}, 92.0)[1], "nothing was counted"


# ---- the development install


def cache(build: Path, *lines: str) -> Path:
    build.mkdir(exist_ok=True)
    (build / "CMakeCache.txt").write_text("\n".join(["# made by CMake", *lines, ""]))
    return build


def test_only_a_development_build_of_this_python_is_built_before_tests(tmp_path: Path) -> None:
    build = tmp_path / "build"
    ours = f"Python_EXECUTABLE:PATH={sys.executable}"
    assert not rebuild.is_development_build(build)
    assert not rebuild.is_development_build(cache(build, "SKBUILD_STATE:STRING=wheel", ours))
    assert rebuild.is_development_build(cache(build, "SKBUILD_STATE:STRING=editable", ours))
    assert rebuild.is_development_build(cache(build, "FCLIB_INPLACE:BOOL=ON", ours))
    theirs = "Python_EXECUTABLE:PATH=/opt/other/bin/python"
    assert not rebuild.is_development_build(cache(build, "SKBUILD_STATE:STRING=editable", theirs))


def test_a_build_that_fails_ends_the_tests(tmp_path: Path) -> None:
    inplace = "SKBUILD_STATE:STRING=editable"
    build = cache(tmp_path / "build", inplace, f"Python_EXECUTABLE:PATH={sys.executable}")
    with pytest.raises(pytest.exit.Exception, match="does not build"):
        rebuild.rebuild(build)  # a folder with nothing to build


# ---- wheels


def test_a_python_takes_the_wheel_of_its_tags() -> None:
    try_wheels = script("scripts/try_wheels.py")
    names = ("cp310-cp310", "cp311-cp311", "cp312-abi3")
    wheels = [Path(f"fclib-0.1.0-{name}-manylinux_2_28_x86_64.whl") for name in names]
    taken = {minor: try_wheels.wheel_for(minor, wheels) for minor in range(9, 15)}
    assert taken == {
        9: None,
        10: wheels[0],
        11: wheels[1],
        12: wheels[2],
        13: wheels[2],
        14: wheels[2],
    }
    assert try_wheels.wheel_for(11, wheels[:1]) is None, "without abi3 it is for one version"


# ---- in another project


@pytest.mark.skipif(not shutil.which("ninja"), reason="takes cmake and ninja")
@pytest.mark.parametrize(
    "taken",
    [
        "add_subdirectory({root} fclib)",
        "include(FetchContent)\n"
        "FetchContent_Declare(fclib SOURCE_DIR {root})\n"
        "FetchContent_MakeAvailable(fclib)",
    ],
)
def test_another_project_takes_the_c_library_in(root: Path, tmp_path: Path, taken: str) -> None:
    cmake = shutil.which("cmake")
    if cmake is None:
        pytest.skip("there is no cmake")
    (tmp_path / "mine.c").write_text("#include <fclib.h>\nint main(void) { return 0; }\n")
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.25)\nproject(mine C CXX)\n"
        # a Python that has nothing: whoever takes the library in needs none
        "set(Python_EXECUTABLE /nowhere/python)\n"
        f"{taken.format(root=root.as_posix())}\n"
        "add_executable(mine mine.c)\ntarget_link_libraries(mine fclib::fclib)\n"
    )
    build = tmp_path / "build"
    ran(cmake, "-S", tmp_path, "-B", build, "-G", "Ninja")
    targets = ran("ninja", "-C", build, "-t", "targets", "all").stdout
    assert re.search(r"libfclib\.(so|a|dylib)", targets)
    assert "_core_stub" not in targets, "the extension of Python is no part of another's project"


# ---- a release


def test_a_release_names_its_version_everywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    release = script("scripts/release.py")
    monkeypatch.setattr(release, "ROOT", tmp_path)
    monkeypatch.setattr(release, "git", lambda *words: "")
    (tmp_path / "recipe").mkdir()
    (tmp_path / "CMakeLists.txt").write_text("project(fclib VERSION 2.3.4 LANGUAGES C)")
    (tmp_path / "CHANGELOG.md").write_text("# Changelog\n\n## 2.3.4\n")
    (tmp_path / "CITATION.cff").write_text("version: 2.3.4\n")
    (tmp_path / "recipe/recipe.yaml").write_text('  version: "2.3.3"\n')
    assert release.version() == "2.3.4"
    (fault,) = release.faults("2.3.4")
    assert fault.startswith("recipe/recipe.yaml")
    monkeypatch.setattr(
        release, "git", lambda *words: {"rev-list": "a", "rev-parse": "b"}.get(words[0], "")
    )
    assert any("never changes" in fault for fault in release.faults("2.3.4"))


def test_a_release_has_checksums_and_a_list_of_parts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("cyclonedx", reason="a tool of the tests that is not installed")
    release = script("scripts/release.py")
    dist = tmp_path / "dist"
    (dist / "collection").mkdir(parents=True)
    name = release.version()
    for file in (
        f"fclib-{name}.tar.gz",
        f"fclib-{name}.whl",
        "libfclib0.deb",
        "collection/data.whl",
    ):
        (dist / file).write_text(file)
    monkeypatch.setattr(release, "ROOT", tmp_path)
    monkeypatch.setattr(release, "version", lambda: name)
    with pytest.raises(SystemExit, match="there is no site"):
        release.finish(dist)
    (tmp_path / "build/site").mkdir(parents=True)
    (tmp_path / "build/site/index.html").write_text("<p>")
    release.finish(dist)
    lines = (dist / "SHA256SUMS").read_text().splitlines()
    sums = {file: digest for digest, file in (line.split("  ") for line in lines)}
    assert set(sums) == {path.name for path in dist.iterdir() if path.is_file()} - {"SHA256SUMS"}
    for file, digest in sums.items():
        assert hashlib.sha256((dist / file).read_bytes()).hexdigest() == digest
    parts = json.loads((dist / f"fclib-{name}.cdx.json").read_text())
    names = {part["name"]: part.get("version") for part in parts["components"]}
    assert names["numpy"] == np.__version__
    assert {"hdf5", "eigen", "nanobind", "data.whl"} <= set(names)
    assert parts["bomFormat"] == "CycloneDX"
    (dist / "libfclib0.deb").unlink()
    with pytest.raises(SystemExit, match=r"has no \*.deb"):
        release.finish(dist)


# ---- JavaScript


def test_javascript_is_linted_or_it_is_said_that_it_is_not(root: Path) -> None:
    def dry(*words: str) -> str:
        done = ran("make", "--dry-run", "lint", *words, cwd=root)
        return done.stdout

    without, with_npm = dry("HAS_NPM="), dry("HAS_NPM=/usr/bin/npm")
    assert "there is no npm" in without
    assert "eslint" not in without
    assert "there is no npm" not in with_npm
    for tool in ("prettier", "eslint"):
        lines = [line for line in with_npm.splitlines() if f"/.bin/{tool} " in line]
        named = {word for line in lines for word in line.split() if word.endswith((".js", ".mjs"))}
        kept = set(git("ls-files", "*.js", "*.mjs").split())
        if not kept:
            pytest.skip("this is no repository")
        config = "build/javascript/eslint.config.mjs"
        assert named - {config} == kept, tool


def test_javascript_tools_are_pinned_by_checksums_alone(root: Path) -> None:
    folder = root / "scripts" / "javascript"
    wanted = json.loads((folder / "package.json").read_text())["devDependencies"]
    lock = json.loads((folder / "package-lock.json").read_text())["packages"]
    assert lock.pop("")["devDependencies"] == wanted
    assert all(version[0].isdigit() for version in wanted.values())
    for name, entry in lock.items():
        assert entry["integrity"].startswith("sha512-"), name
        assert "resolved" not in entry, name


def test_lines_of_javascript_have_at_most_100_characters(root: Path) -> None:
    files = [root / name for name in git("ls-files", "*.js", "*.mjs").split()]
    if not files:
        pytest.skip("this is no repository")
    long = [
        f"{path.relative_to(root)}:{number}"
        for path in files
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if len(line) > 100
    ]
    assert not long


# ---- what says what there is


def test_the_readme_of_the_scripts_has_a_line_on_each(root: Path) -> None:
    text = (root / "scripts" / "README.md").read_text()
    named = re.findall(r"^\| `([\w./-]+)` \|", text, re.MULTILINE)
    kept = git("ls-files", "scripts").split()
    if not kept:
        pytest.skip("this is no repository")
    first = {Path(path).parts[1] + "/" * (len(Path(path).parts) > 2) for path in kept}
    assert named == sorted(named)
    assert set(named) == first - {"README.md"}


def test_make_help_shows_every_verb(root: Path) -> None:
    text = (root / "Makefile").read_text()
    verbs = re.findall(r"^\.PHONY: (.*?[^\\])$", text, re.MULTILINE | re.DOTALL)
    shown = ran("make", "help", cwd=root).stdout
    for verb in verbs[0].replace("\\", " ").split():
        assert verb == "help" or re.search(rf"^make {verb} ", shown, re.MULTILINE), verb
